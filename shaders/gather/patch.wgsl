// A patch of the tile rasterizer, drawn front to back: its bindings, the loop over its groups, and the rounds in which a subgroup visits its
// pixels. The stage's own file defines what a voxel adds to sheets and how they are composited.
//
// Needs gather.wgsl: add_sections, begin_layer, composite_pixels, counts_gaps, draws_all_groups, find_handed_on, is_due_without_voxels, layers, looks_along_rays.
// Needs gather/amounts.wgsl: shade_voxels.
// Needs gather/economies.wgsl: shallow_after.
// Needs gather/pixels.wgsl: halves_of, load_image, open_word, pixels_of.
// Needs gather/planes.wgsl: Sheets, save_sheets, saved_sheets.
// Needs gather/queue.wgsl: empty_queue, queue_count.
// Needs gather/ramps.wgsl: Ramp, ramp_of.
// Needs gather/region.wgsl: PATCH_HEIGHT, PATCH_WIDTH, with_blocks.
// Needs gather/sheets.wgsl: Sheets, find_stretches, save_sheets, saved_sheets.
// Needs gather/slabs.wgsl: find_handed_on, find_stretches.
// Needs gather/subgroup_barrier.wgsl: meet.
// Needs gather/subgroup_lanes.wgsl: sums_of_lanes, united.
// Needs gather/uniforms.wgsl: Gather, Gathered, PatchRange.
// Needs gather/voxels.wgsl: GatheredGroup, find_voxels, keep_voxels, may_appear, search_bounds.
// Needs gather/walk.wgsl: is_walked, walk.
// Needs gather/workgroup_barrier.wgsl: meet.
// Needs gather/workgroup_lanes.wgsl: sums_of_lanes, united.
// Needs gather_planes.wgsl: add_sections, begin_layer, composite_pixels, counts_gaps, draws_all_groups, is_due_without_voxels, layers, looks_along_rays, shade_voxels, shallow_after.
// Needs shared/brick.wgsl: Brick, Indirect, LAYER_BITS, indirect, layer_bit, unfold.
// Needs shared/cut.wgsl: Cut, FAR.
// Needs shared/frame.wgsl: FRONT_TO_BACK, TILE, frame, start, tile_grid, zero.
@group(0) @binding(1) var<uniform> gathers: array<Gather, 1>;
@group(0) @binding(2) var<uniform> patch_range: PatchRange;
@group(0) @binding(3) var<storage, read> bricks: array<Brick>;
// For every patch and sheet group the place of its first brick in this list; behind all of these the indices of bricks.
@group(0) @binding(4) var<storage, read> bins: array<u32>;
// The control points of all ramps, one ramp after the other: value, then rgb or (ordinate, 0, 0); then the table of labels.
@group(0) @binding(6) var<storage, read> control_points: array<vec4f>;
@group(0) @binding(7) var values: texture_2d_array<u32>;
@group(0) @binding(8) var<storage, read_write> acc: array<vec4f>;
@group(0) @binding(9) var<storage, read_write> gathered: Gathered;
// For every group, nearest first, half the screen box in pixels around its footprints.
@group(0) @binding(10) var<storage, read> half_boxes: array<vec2f>;
@group(0) @binding(11) var labels: texture_2d_array<u32>;
// The arguments of the next dispatch, which is empty unless a subgroup has left work for it.
@group(0) @binding(12) var<storage, read_write> next: Indirect;
@group(0) @binding(13) var<uniform> cut: Cut;
@group(0) @binding(14) var surfaces: texture_depth_2d;
// The slots of pages, where voxels are in pages.
@group(0) @binding(18) var pages: texture_2d_array<u32>;

// `frame.compositing` and `frame.order`.
override COMPOSITING: u32 = 0u;
override ORDER: u32 = 0u;
// Whether every voxel has its own ray.
override PERSPECTIVE: bool = false;
// Whether a footprint's box is the parallelogram of Fig. 13, else its bounding rectangle.
override PARALLELOGRAM: bool = false;
// Whether anything is cut, and whether first hits are requested.
override CUT: bool = false;
override FIRST_HIT: bool = false;

// The number of threads in a workgroup: those of the largest subgroup, but at most those that hold a patch.
override THREADS: u32 = 32u;
// The number of workgroups per patch: more than one only if too much lies behind it.
override WORKGROUPS_PER_PATCH: u32 = 1u;

var<private> gather: Gather;

// The subgroup.
var<private> lane: u32;
var<private> lanes: u32;

// The patch: the centre of its first pixel, and a mask of the subgroup's pixels, over all its rounds, that are not opaque.
var<private> first_px: vec2f;
var<private> open: vec4u;

// The group that is being drawn.
var<private> sheet_group: GatheredGroup;

// Counts of passes through loops, bricks visited, and voxels and sections drawn.
var<private> passes: u32;
var<private> bricks_visited: u32;
var<private> drawn: vec2u;

var<private> color_ramp: Ramp;
var<private> opacity_ramp: Ramp;
var<private> gradient_opacity_ramp: Ramp;

// The number of sheets in a sheet group.
const SHEETS = 4u;

// The number of threads that hold a patch, and of its halves of blocks, which the smallest subgroups draw.
const PATCH_THREADS = 32u;
const HALVES = 8u;

// Passes through loops that are not counted where they occur. Every loop costs one extra pass for its exit check, and so do the loops nested
// in it; one-shot loops cost two.
const PASSES_PER_GROUP = 6u;
const PASSES_PER_FILL = 36u;
const PASSES_PER_FIND = 5u;
const PASSES_PER_SHADING = 7u;
const PASSES_PER_ROUND = 18u;
const PASSES_PER_BATCH = 4u;
const PASSES_PER_ADDITION = 2u;

// The passes that determine how four rays are cut, or over which stretch means count.
fn passes_per_look() -> u32 {
    return select(0u, 140u, looks_along_rays());
}

// The number of voxels of the queue that are tested at a time, one bit each.
const BATCH = 64u;

// The progress in a patch: a mask of its pixels that stay open after the group, and a mask of halves of blocks whose sheets are not empty.
struct Progress {
    open: vec4u,
    shallow: vec4u,
    begun: u32,
}

// The outcome of a group: whether the queue held all of its voxels at once, and whether it had any.
struct GroupOutcome {
    is_whole: bool,
    has_drawn: bool,
}

// Distributes the ramps' control points among the lanes.
fn hold_ramps() {
    color_ramp = ramp_of(0u, frame.ramps.x);
    opacity_ramp = ramp_of(frame.ramps.x, frame.ramps.y);
    gradient_opacity_ramp = ramp_of(frame.ramps.y, frame.ramps.z);
}

// Finds the open pixels of the threads from `threads.x` to the one before `threads.y`. Returns a mask of their halves of blocks.
fn find_open_pixels(corner: vec2u, threads: vec2u, thread: u32) -> u32 {
    var own_halves = 0u;
    for (var round = threads.x; round < threads.y; round += THREADS) {
        let pixels = pixels_of(corner, round + thread);
        find_stretches(pixels.column, pixels.rows);
        let opacity = transpose(load_image(pixels))[3];
        own_halves |= halves_of(pixels.thread);
        open = with_blocks(open, pixels.thread, open_word(pixels, opacity, -FAR));
        shallow = shallow_after(shallow, pixels, opacity);
        find_handed_on(pixels);
    }
    return own_halves;
}

// Makes the `at`-th group in compositing order the current one.
fn begin_group(at: u32) {
    let number = select(gather.groups - 1u - at, at, ORDER == FRONT_TO_BACK);
    let first_sheet = f32(number * SHEETS);
    let near = gather.near + first_sheet * frame.slab_width;
    sheet_group = GatheredGroup(number, first_sheet, near, half_boxes[number]);
}

// Adds the sections of the queue's voxels to the sheets of all pixels, round by round. After the last voxels of the group (`is_last`) the sheets
// are composited; before, they wait in workgroup memory.
fn draw_queue(corner: vec2u, threads: vec2u, thread: u32, is_last: bool, progress: ptr<function, Progress>) {
    for (var round = threads.x; round < threads.y; round += THREADS) {
        passes += PASSES_PER_ROUND;
        let pixels = pixels_of(corner, round + thread);
        let blocks = united(1u << pixels.block);
        let halves = halves_of(pixels.thread);
        var has_begun = ((*progress).begun & halves) != 0u;
        var sheets = Sheets();
        for (; has_begun; has_begun = false) {
            sheets = saved_sheets(round + thread);
        }
        let is_added = add_sections(&sheets, pixels, blocks);
        if is_added {
            (*progress).begun |= halves;
        }
        for (var is_left = is_added && !is_last; is_left; is_left = false) {
            save_sheets(round + thread, sheets);
        }
        let is_due = is_last && (((*progress).begun & halves) != 0u || is_due_without_voxels(halves));
        for (var is_done = is_due; is_done; is_done = false) {
            composite_pixels(pixels, sheets, progress);
        }
    }
}

// Draws a layer of the group: finds voxels, shades those of the queue from the `first`-th on, and adds their sections, once for every filling of the queue.
fn draw_layer(corner: vec2u, threads: vec2u, thread: u32, first: u32, is_kept: bool) -> GroupOutcome {
    let search = search_bounds(is_kept);
    var progress = Progress(open, shallow, 0u);
    var outcome = GroupOutcome(true, draws_all_groups());
    var first_new = first;
    loop {
        passes += PASSES_PER_FILL;
        find_voxels(search, is_kept);
        meet();
        shade_voxels(first_new);
        meet();
        let is_last = is_walked();
        outcome.has_drawn |= queue_count > 0u;
        draw_queue(corner, threads, thread, is_last, &progress);
        meet();
        if is_last {
            break;
        }
        outcome.is_whole = false;
        queue_count = 0u;
        first_new = 0u;
    }
    open = progress.open;
    shallow = progress.shallow;
    return outcome;
}

// Counts the `at`-th group as composited in the 32×32 tile of a pixel, once for all of the tile's patches.
fn count_composited(at: u32, pixel: vec2u) {
    let tiles = tile_grid(frame.size);
    let number = (at * tiles.y + pixel.y / TILE) * tiles.x + pixel.x / TILE;
    let bit = 1u << (number % 32u);
    if (atomicOr(&gathered.words[gather.composited + number / 32u], bit) & bit) == 0u {
        atomicAdd(&gathered.words[at], 1u);
    }
}

// Stores the group at which the next dispatch continues, and adds the subgroup's counts to the frame's.
fn finish(at: u32, reached: u32) {
    let all_counts = sums_of_lanes(drawn);
    if lane == 0u {
        // Where all pixels are opaque nothing is left to do.
        let is_done = at == gather.groups || all(open == vec4u(0u));
        atomicStore(&gathered.words[reached], select(at, gather.groups, is_done));
        if !is_done {
            next = indirect((patch_range.end_patch - patch_range.first_patch) * WORKGROUPS_PER_PATCH);
        }
        atomicAdd(&gathered.tally.voxels_shaded, all_counts.x);
        atomicAdd(&gathered.tally.sections_rasterized, all_counts.y);
        atomicAdd(&gathered.tally.bricks_visited, bricks_visited);
    }
}

// Draws a group's layers, given by its patch and its place in compositing order. Voxels are found once for all layers, if the queue has room for them; if not, each
// layer after the first finds its own.
fn draw_group(corner: vec2u, threads: vec2u, thread: u32, place: vec2u, is_kept: bool) -> GroupOutcome {
    if !is_kept {
        queue_count = 0u;
    }
    keep_voxels();
    let bin = place.x * gather.groups + place.y;
    var all = GroupOutcome(true, false);
    for (var layer = 0u; layer < layers(); layer += 1u) {
        begin_layer(layer);
        let is_found = layer > 0u && all.is_whole;
        if layer > 0u && !is_found {
            queue_count = 0u;
        }
        if !is_found {
            walk(bins[bin], bins[bin + 1u], select(layer_bit(layer), LAYER_BITS, layer == 0u));
        }
        // Voxels have amounts of their own in each layer.
        let first = select(0u, queue_count, layers() == 1u);
        let outcome = draw_layer(corner, threads, thread, first, is_kept && (layer == 0u || is_found));
        all = GroupOutcome(all.is_whole && outcome.is_whole, all.has_drawn || outcome.has_drawn);
    }
    return all;
}

// The number of bricks that some groups of a patch visit.
fn brick_count(patch_number: u32, first: u32, end: u32) -> u32 {
    let bin = patch_number * gather.groups;
    return bins[bin + end] - bins[bin + first];
}

// The number of patches along a row.
fn patch_columns() -> u32 {
    return (frame.size.x + PATCH_WIDTH - 1u) / PATCH_WIDTH;
}

// Draws a patch's groups in compositing order, from where the previous dispatch stopped, until all pixels are opaque.
fn draw(number: u32, first_thread: u32, thread: u32) {
    hold_ramps();
    let columns = patch_columns();
    let corner = vec2u(number % columns, number / columns) * vec2u(PATCH_WIDTH, PATCH_HEIGHT);
    first_px = vec2f(corner) + 0.5;
    empty_queue(thread);
    let threads = vec2u(first_thread, first_thread + PATCH_THREADS / WORKGROUPS_PER_PATCH);
    let own_halves = find_open_pixels(corner, threads, thread);

    let reached = gather.reached + number * HALVES + firstTrailingBit(own_halves);
    var at = atomicLoad(&gathered.words[reached]);
    // Whether the queue holds all voxels of the previous group.
    var is_kept = false;
    for (; at < gather.groups && any(open != vec4u(0u)); at += 1u) {
        let count = brick_count(number, at, at + 1u);
        // A driver may end long loops, so work that would need too many passes is left to the next dispatch.
        if passes + gather.passes_per_group + count * gather.passes_per_brick > gather.most_passes {
            break;
        }
        passes += PASSES_PER_GROUP + 4u * (layers() - 1u);
        if count == 0u && !counts_gaps() {
            is_kept = false;
            continue;
        }
        begin_group(at);
        let outcome = draw_group(corner, threads, thread, vec2u(number, at), is_kept);
        is_kept = outcome.is_whole && !may_appear();
        for (var has_drawn = outcome.has_drawn; has_drawn; has_drawn = false) {
            if lane == 0u {
                count_composited(at, corner);
            }
        }
    }
    finish(at, reached);
}

// The patch of the range that a workgroup draws, counted from the first. A software driver gives each thread one stretch of all workgroups, so that rows of
// patches far from each other follow one another, and every stretch has about as much to draw.
fn interleaved(at: u32) -> u32 {
    let columns = patch_columns();
    let rows = (patch_range.end_patch - patch_range.first_patch) / columns;
    return at / columns * patch_range.row_step % rows * columns + at % columns;
}

// Draws what a workgroup has to draw of its patch.
fn draw_of_workgroup(workgroup: vec3u, thread: u32) {
    start(workgroup.z);
    gather = gathers[zero];
    let at_workgroup = unfold(workgroup);
    let at_patch = at_workgroup / WORKGROUPS_PER_PATCH;
    let number = patch_range.first_patch + interleaved(at_patch);
    let first_thread = at_workgroup % WORKGROUPS_PER_PATCH * (PATCH_THREADS / WORKGROUPS_PER_PATCH);
    let half = firstTrailingBit(halves_of(first_thread + thread));
    var is_left = false;
    if at_patch < patch_range.end_patch - patch_range.first_patch {
        let at = atomicLoad(&gathered.words[gather.reached + number * HALVES + half]);
        // Some modes count empty groups too, even behind the last brick of the patch.
        let first = select(at, 0u, draws_all_groups() && at < gather.groups);
        is_left = brick_count(number, first, gather.groups) > 0u;
    }
    for (; is_left; is_left = false) {
        draw(number, first_thread, thread);
    }
}
