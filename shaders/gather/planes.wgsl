// The sums that a thread of the tile rasterizer gathers on the four planes behind a group's slabs, and the field that they make (SPEC §9).
//
// Needs nothing yet.

// Sums over the voxels around a plane at a thread's four pixels: N = Σ g, Σ c·g, and Σ d·g with d the voxels' differences.
struct PlaneSums {
    weight: vec4f,
    value: vec4f,
    x: vec4f,
    y: vec4f,
    z: vec4f,
}

// Those on the far planes of a group's four slabs.
struct Sheets {
    first: PlaneSums,
    second: PlaneSums,
    third: PlaneSums,
    fourth: PlaneSums,
}

// Columns of sums that a thread holds.
const SAVED = 20u;

// The sums of all of a patch's threads, while some of a group's voxels wait for the queue.
var<workgroup> saved: array<vec4f, SAVED * PATCH_THREADS>;

fn save_sheets(thread: u32, sheets: Sheets) {
    save_plane(thread, 0u, sheets.first);
    save_plane(thread, 5u, sheets.second);
    save_plane(thread, 10u, sheets.third);
    save_plane(thread, 15u, sheets.fourth);
}

fn save_plane(thread: u32, column: u32, sums: PlaneSums) {
    let first = column * PATCH_THREADS + thread;
    saved[first] = sums.weight;
    saved[first + PATCH_THREADS] = sums.value;
    saved[first + 2u * PATCH_THREADS] = sums.x;
    saved[first + 3u * PATCH_THREADS] = sums.y;
    saved[first + 4u * PATCH_THREADS] = sums.z;
}

fn saved_sheets(thread: u32) -> Sheets {
    return Sheets(saved_plane(thread, 0u), saved_plane(thread, 5u), saved_plane(thread, 10u), saved_plane(thread, 15u));
}

fn saved_plane(thread: u32, column: u32) -> PlaneSums {
    let first = column * PATCH_THREADS + thread;
    return PlaneSums(
        saved[first],
        saved[first + PATCH_THREADS],
        saved[first + 2u * PATCH_THREADS],
        saved[first + 3u * PATCH_THREADS],
        saved[first + 4u * PATCH_THREADS],
    );
}

// Sums with a voxel of some differences and some number, (d, c), where it has these weights.
fn with_voxel(sums: PlaneSums, weight: vec4f, amount: vec4f) -> PlaneSums {
    return PlaneSums(
        sums.weight + weight,
        sums.value + weight * amount.w,
        sums.x + weight * amount.x,
        sums.y + weight * amount.y,
        sums.z + weight * amount.z,
    );
}

// The field on a plane at a thread's four pixels, with its gradient in the terms of `half_differences`.
struct Fields {
    has_value: vec4<bool>,
    value: vec4f,
    x: vec4f,
    y: vec4f,
    z: vec4f,
}

// Where the weights sum to less than this there is no value.
const MIN_WEIGHT = 1e-3;

fn fields_of(sums: PlaneSums) -> Fields {
    let has_value = sums.weight >= vec4f(MIN_WEIGHT);
    let per_weight = 1.0 / select(vec4f(1.0), sums.weight, has_value);
    return Fields(has_value, sums.value * per_weight, sums.x * per_weight, sums.y * per_weight, sums.z * per_weight);
}

// The far planes' fields of the group before.
var<workgroup> handed_on: array<vec4f, 5u * PATCH_THREADS>;

// The blocks of which some plane was handed on that has values, one bit each.
var<private> blocks_handed_on: u32;

fn hand_on(thread: u32, fields: Fields) {
    handed_on[thread] = select(vec4f(0.0), vec4f(1.0), fields.has_value);
    handed_on[PATCH_THREADS + thread] = fields.value;
    handed_on[2u * PATCH_THREADS + thread] = fields.x;
    handed_on[3u * PATCH_THREADS + thread] = fields.y;
    handed_on[4u * PATCH_THREADS + thread] = fields.z;
}

fn fields_handed_on(thread: u32, is_any: bool) -> Fields {
    let has_value = (handed_on[thread] != vec4f(0.0)) & vec4<bool>(is_any);
    return Fields(
        has_value,
        select(vec4f(0.0), handed_on[PATCH_THREADS + thread], has_value),
        select(vec4f(0.0), handed_on[2u * PATCH_THREADS + thread], has_value),
        select(vec4f(0.0), handed_on[3u * PATCH_THREADS + thread], has_value),
        select(vec4f(0.0), handed_on[4u * PATCH_THREADS + thread], has_value),
    );
}
