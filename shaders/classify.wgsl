// What every pixel sees of the slab between a plane and the one drawn before it: classified, shaded and composited (SPEC §9), in the tiles that either plane
// has a value in, and noted where pixels are opaque (§6). One workgroup per tile.

@group(0) @binding(1) var<uniform> band: Band;
// The sums of `field`.
@group(0) @binding(2) var sheets: texture_2d_array<f32>;
@group(0) @binding(3) var<storage, read_write> acc: array<vec4f>;
@group(0) @binding(4) var<storage, read> composited: TileList;
@group(0) @binding(5) var<storage, read_write> opaque: array<u32>;
@group(0) @binding(6) var<storage, read_write> opaque_tiles: array<u32>;
@group(0) @binding(7) var<uniform> sheet_group: SheetGroup;
@group(0) @binding(8) var<uniform> cut: Cut;
@group(0) @binding(9) var surfaces: texture_depth_2d;
@group(0) @binding(10) var<storage, read_write> hits: array<u32>;
// For every tile the number of the last group whose plane has a value in it.
@group(0) @binding(11) var<storage, read_write> last_groups: array<u32>;
@group(0) @binding(12) var<storage, read> control_points: array<vec4f>;
@group(0) @binding(13) var labels: texture_2d_array<u32>;
@group(0) @binding(14) var values: texture_2d_array<u32>;
@group(0) @binding(15) var<uniform> planes: FieldPlanes;
// Of every pixel what the plane before has: its number, and its gradient, numbers per `unit`. Then what `is_by_means` keeps.
@group(0) @binding(16) var<storage, read_write> carried: array<vec4f>;

// `frame.compositing`.
override COMPOSITING: u32 = 0u;
// Whether clip planes or a host's surfaces cut rays, and whether first hits are asked for.
override CUT: bool = false;
override FIRST_HIT: bool = false;
// Whether gradients are the field's derivative.
override KERNEL_GRADIENT: bool = false;

const WORKGROUP_ROWS = 8u;

var<workgroup> opaque_rows: array<atomic<u32>, TILE>;
var<workgroup> is_carried: atomic<u32>;

// The point of a pixel's ray at a sheet depth, in voxels.
fn voxel_at(at: vec3f, sheet_depth: f32) -> vec3f {
    let depth = (sheet_depth - dot(cut.sheet_at.xyz, at)) / dot(cut.sheet_along.xyz, at);
    var place = vec3f();
    for (var axis = 0u; axis < 3u; axis += 1u) {
        place[axis] = dot(cut.box_at[axis].xyz, at) + depth * dot(cut.box_along[axis].xyz, at);
    }
    return place + 0.5 * vec3f(frame.dims.xyz - 1u);
}

// The voxel whose cell holds a point.
fn nearest_voxel(place: vec3f) -> vec3u {
    return vec3u(clamp(floor(place + 0.5), vec3f(0.0), vec3f(frame.dims.xyz - 1u)));
}

// What a pixel sees of the plane that was drawn: the number and the gradient.
fn plane_sample(pixel: vec2u, at: vec3f) -> vec4f {
    let first = textureLoad(sheets, pixel, 0, 0);
    let second = textureLoad(sheets, pixel, 1, 0);
    var is_value = first.x >= MIN_WEIGHT;
    if HOLES {
        is_value = is_value && !is_hole(stored_at(index_of(nearest_voxel(voxel_at(at, sheet_group.near)))));
    }
    if !is_value {
        return vec4f(NO_NUMBER, 0.0, 0.0, 0.0);
    }
    let number = first.y / first.x;
    if !KERNEL_GRADIENT {
        return vec4f(number, vec3f(first.zw, second.x) / first.x);
    }
    let moment = second.yzw - number * vec3f(first.zw, second.x);
    return vec4f(number, in_grid(-2.0 * frame.falloff / first.x * moment) / frame.aspect.xyz);
}

// What a stretch of a slab, given by its middle, looks like.
struct Look {
    // m and C, shaded.
    amount: f32,
    color: vec3f,
}

fn ramps_at(at: vec3f, sheet_depth: f32) -> vec4u {
    if !LABELS {
        return vec4u(0u, frame.ramps.xyz);
    }
    return ramps_of(index_of(nearest_voxel(voxel_at(at, sheet_depth))));
}

// Two points' numbers and gradients, from the nearer to the farther one.
fn look(near: vec4f, far: vec4f, ramps: vec4u, light: Lighting) -> Look {
    let means = slab_integral(ramps.w, near.x, far.x);
    if means.amount <= 0.0 {
        return Look(0.0, vec3f(0.0));
    }
    let gradient = gradient_of(0.5 * planes.per_number * mix(near.yzw, far.yzw, means.share));
    let factor = ramp(ramps.z, ramps.w, gradient.magnitude).x;
    return Look(means.amount * factor, shade(means.color, gradient, light));
}

@compute @workgroup_size(32, 8)
fn main(@builtin(local_invocation_id) local: vec3u, @builtin(workgroup_id) workgroup: vec3u) {
    start(workgroup.z);
    let list_place = unfold(workgroup);
    if list_place >= composited.args.count {
        return;
    }
    let tile = composited.tiles[list_place];
    let words = tile_grid(frame.size).x;
    let corner = vec2u(tile % words, tile / words) * TILE;
    if corner.y < band.first_row || corner.y >= band.first_row + band.rows {
        return;
    }
    let last_group = last_groups[tile];
    let is_front_to_back = frame.order == FRONT_TO_BACK;
    let group_before = select(sheet_group.number + 1u, sheet_group.number - 1u, is_front_to_back);
    let is_after_gap = last_group == 0u || last_group != group_before;
    // The slab's planes.
    let near = select(sheet_group.near, sheet_group.near - frame.slab_width, is_front_to_back);
    let far = near + frame.slab_width;
    for (var row = local.y; row < TILE; row += WORKGROUP_ROWS) {
        let pixel = corner + vec2u(local.x, row);
        // Pixels off the image count as opaque.
        var is_opaque = true;
        if all(pixel < frame.size) {
            let slot = (pixel.y - band.first_row) * frame.size.x + pixel.x;
            let px = vec2f(pixel) + 0.5;
            let at = place_of(px);
            var image = acc[slot];
            let drawn = plane_sample(pixel, at);
            let before = select(carried[slot], vec4f(NO_NUMBER, 0.0, 0.0, 0.0), is_after_gap);
            carried[slot] = drawn;
            if drawn.x != NO_NUMBER {
                atomicStore(&is_carried, 1u);
            }
            var depths = in_box(at, cut.box_half.xyz);
            if CUT {
                depths = both(depths, shown_depths(px));
            }
            let ray = sheet_depths(at, depths);
            // By what the ray's stretch is less than the slab, so that inside nothing is rounded.
            let missing = max(ray.x - near, 0.0) + max(far - ray.y, 0.0);
            let share = max(1.0 - missing / frame.slab_width, 0.0);
            // No `if` depends on the ray alone, for the reason that `start` gives.
            if min(drawn.x, before.x) != NO_NUMBER {
                // If only one plane has a value it stands for both.
                let own = select(drawn, before, drawn.x == NO_NUMBER);
                let other = select(before, drawn, before.x == NO_NUMBER);
                let first = select(own, other, is_front_to_back);
                let last = select(other, own, is_front_to_back);
                let part = vec2f(max(ray.x, near), min(ray.y, far));
                let ramps = ramps_at(at, 0.5 * (part.x + part.y));
                let seen = look(first, last, ramps, lighting(px, frame.near > 0.0));
                let slope = select(vec2f(0.0), frame.pixel_per_depth * at.xy, frame.near > 0.0);
                let per_sheet = sqrt(1.0 + dot(slope, slope)) / dot(cut.sheet_along.xyz, at);
                let sheet = vec4f(seen.color, 1.0) * (seen.amount * share * frame.slab_width * per_sheet);
                let opacity = image.a;
                image = select(image, composite(image, sheet, COMPOSITING, frame.order), sheet.a > 0.0);
                acc[slot] = image;
                if FIRST_HIT && opacity < cut.first_hit && image.a >= cut.first_hit {
                    let reached = (cut.first_hit - opacity) / (image.a - opacity);
                    hits[pixel.y * frame.size.x + pixel.x] = noted(mix(part.x, part.y, reached));
                }
            }
            // What lies behind a cut is as hidden as what lies behind opaque voxels.
            is_opaque = image.a >= frame.opacity_threshold || CUT && ray.y <= far;
        }
        if is_opaque {
            atomicOr(&opaque_rows[row], 1u << local.x);
        }
    }
    workgroupBarrier();
    if local.y == 0u {
        let y = corner.y + local.x;
        if y < frame.size.y {
            opaque[y * words + corner.x / TILE] = atomicLoad(&opaque_rows[local.x]);
        }
        if local.x == 0u {
            var all_opaque = 0xffffffffu;
            for (var row = 0u; row < TILE; row += 1u) {
                all_opaque &= atomicLoad(&opaque_rows[row]);
            }
            opaque_tiles[tile] = select(0u, 1u, all_opaque == 0xffffffffu);
            if atomicLoad(&is_carried) != 0u {
                last_groups[tile] = sheet_group.number;
            }
        }
    }
}
