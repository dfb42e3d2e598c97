// The tile rasteriser: draws tiles front to back without sheet buffers in memory. A subgroup keeps the sheets of a group for its
// pixels in registers, gathers the kernel sections that fall on them (§3.2), composites them (eq. 2), and skips what lies behind
// its opaque pixels (§6). Subgroups share nothing, so there are no barriers, and sums have one order whatever else runs.
//
// A tile's 64 threads hold four pixels each, one below the other, in units of 8×4 pixels; a subgroup of 8 to 32 threads holds
// the rectangle of its units. Software drivers execute what an `if` leaves out but not a loop without iterations, hence some
// loops that run at most once.

@group(0) @binding(0) var<uniform> frame_uniform: Frame;
@group(0) @binding(1) var<uniform> gather_uniform: Gather;
@group(0) @binding(2) var<uniform> part: Part;
@group(0) @binding(3) var<storage, read> bricks: array<Brick>;
// Where every sheet group of every tile starts in `entries`.
@group(0) @binding(4) var<storage, read> starts: array<u32>;
// A brick's number and, in the last byte, the units of the tile that it may touch.
@group(0) @binding(5) var<storage, read> entries: array<u32>;
// The control points of all ramps, one ramp after the other: value, then rgb or (ordinate, 0, 0); then the table of labels.
@group(0) @binding(6) var<storage, read> control_points: array<vec4f>;
@group(0) @binding(7) var values: texture_2d_array<f32>;
@group(0) @binding(8) var<storage, read_write> acc: array<vec4f>;
@group(0) @binding(9) var<storage, read_write> gathered: Gathered;
// Of every group, nearest first, half the screen box around its footprints, pixels.
@group(0) @binding(10) var<storage, read> half_boxes: array<vec2f>;
@group(0) @binding(11) var labels: texture_2d_array<u32>;

// `frame.compositing` and `frame.order`.
override COMPOSITING: u32 = 0u;
override ORDER: u32 = 0u;
// Whether voxels have rays of their own.
override PERSPECTIVE: bool = false;
// Whether a footprint's box is the parallelogram of Fig. 13, else its bounding rectangle.
override PARALLELOGRAM: bool = false;
// Whether any of §8's economies is asked for.
override ECONOMIES: bool = false;

// Read once: a uniform read in a loop costs a software driver a gather.
var<private> frame: Frame;
var<private> gather: Gather;

// The subgroup.
var<private> lane: u32;
var<private> lanes: u32;

// Sheets of a group.
const SHEETS = 4u;

// Pixels across a tile, and across the widest region.
const TILE_SIDE = 16u;

// Units of a tile.
const UNITS = 8u;

// The four sheets of a group at a thread's four pixels: red, green, blue and alpha columns.
struct Sheets {
    first: mat4x4f,
    second: mat4x4f,
    third: mat4x4f,
    fourth: mat4x4f,
}

// The pixels of a subgroup.
struct Region {
    // Bounds of its pixel centres.
    low: vec2f,
    high: vec2f,
    // Bounds of those that are not opaque.
    open_low: vec2f,
    open_high: vec2f,
    // For each of the units' rows the lanes whose pixel there is not opaque.
    open: vec4u,
    // The same for pixels that have not reached β.
    shallow: vec4u,
}

// A voxel's kernel as the pixels see it.
struct Footprint {
    center_px: vec2f,
    // `(C·m, m)` times the low-pass amplitude over λ; 0 without a voxel.
    amount: vec4f,
    // H(0, 0, t) of eq. 3 at the group's first plane and at the four after it.
    first_plane: f32,
    planes: vec4f,
    // In perspective, how its sections' footprints lie on the screen.
    axis: vec2f,
    maps: SectionMaps,
    // Among the economies: ρ² from which a footprint adds too little, by sheet.
    rim: vec4f,
}

// One of the ramps: where its control points are, and the one of the first of them that this lane holds.
struct Ramp {
    first: u32,
    end: u32,
    own: vec4f,
}

// Where the n-th set bit is.
fn nth_set_bit(bits: vec2u, n: u32) -> u32 {
    let low = countOneBits(bits.x);
    var found = vec3u(bits.x, n, 0u);
    if n >= low {
        found = vec3u(bits.y, n - low, 32u);
    }
    return half(half(half(half(half(found, 16u), 8u), 4u), 2u), 1u).z;
}

// One step of a binary search in (word, bits to skip, position): goes on in the upper bits if the lower ones have too few.
fn half(found: vec3u, width: u32) -> vec3u {
    let count = countOneBits(found.x & ((1u << width) - 1u));
    return select(found, vec3u(found.x >> width, found.y - count, found.z + width), found.y >= count);
}

// Piecewise linear between the control points, clamped outside.
fn ramp_at(held: Ramp, value: f32) -> vec3f {
    let count = held.end - held.first;
    // How many points are at or below the value; every lane holds one of the first of them.
    var below = 0u;
    below += select(0u, 16u, lanes >= 32u && is_below(held, below + 15u, value));
    below += select(0u, 8u, lanes >= 16u && is_below(held, below + 7u, value));
    below += select(0u, 4u, is_below(held, below + 3u, value));
    below += select(0u, 2u, is_below(held, below + 1u, value));
    below += select(0u, 1u, is_below(held, below, value));
    below += select(0u, 1u, is_below(held, below, value));
    let a = subgroupShuffle(held.own, max(below, 1u) - 1u);
    let b = subgroupShuffle(held.own, min(below, min(count, lanes) - 1u));
    var result = between(a, b, value);
    // More points than lanes are searched in memory.
    for (var once = count > lanes; once; once = false) {
        result = ramp(held.first, held.end, value);
    }
    return result;
}

// Whether one of the first control points is at or below a value.
fn is_below(held: Ramp, at: u32, value: f32) -> bool {
    return at < min(held.end - held.first, lanes) && subgroupShuffle(held.own.x, at % lanes) <= value;
}

fn ramp_of(first: u32, end: u32) -> Ramp {
    return Ramp(first, end, control_points[min(first + lane, end - 1u)]);
}

// H(0, 0, t) of eq. 3: the kernel's integral along the ray through its centre, from the centre to t.
fn along(t: f32) -> f32 {
    let x = clamp(t, -frame.support, frame.support);
    let z = x * x * gather.along_scale - 1.0;
    return x * polynomial(gather.along, z);
}

fn polynomial(c: array<vec4f, 4>, z: f32) -> f32 {
    let powers = vec4f(1.0, z, z * z, z * z * z);
    let fourth = z * z * z * z;
    return dot(powers, c[0]) + fourth * (dot(powers, c[1]) + fourth * (dot(powers, c[2]) + fourth * dot(powers, c[3])));
}

// The sections of a kernel in the group's four sheets at a column's four pixels: two entries of eq. 3 subtracted, where
// H(a, b, t) is H(0, 0, t) times the Gaussian of ρ² = a² + b², and t ends at the chord of the kernel's ball.
fn sections(footprint: Footprint, column: f32, rows: vec4f) -> mat4x4f {
    let dx = column - footprint.center_px.x;
    let dy = rows - footprint.center_px.y;
    if PERSPECTIVE {
        let along = footprint.axis.x * dx + footprint.axis.y * dy;
        let across = footprint.axis.x * dy - footprint.axis.y * dx;
        let a = along * along;
        let b = across * across;
        let maps = footprint.maps;
        let planes = footprint.planes;
        return mat4x4f(
            section(a * maps.along.x + b * maps.across.x, footprint.first_plane, planes.x, footprint.rim.x) * maps.amplitude.x,
            section(a * maps.along.y + b * maps.across.y, planes.x, planes.y, footprint.rim.y) * maps.amplitude.y,
            section(a * maps.along.z + b * maps.across.z, planes.y, planes.z, footprint.rim.z) * maps.amplitude.z,
            section(a * maps.along.w + b * maps.across.w, planes.z, planes.w, footprint.rim.w) * maps.amplitude.w,
        );
    }
    let rho_squared = dy * (gather.metric.z * dy + gather.metric.y * dx) + gather.metric.x * dx * dx;
    let rim = rim_at(rho_squared);
    let in_plane = in_plane_at(rho_squared, footprint.rim.x);
    let plane_0 = clamp(vec4f(footprint.first_plane), -rim, rim);
    let plane_1 = clamp(vec4f(footprint.planes.x), -rim, rim);
    let plane_2 = clamp(vec4f(footprint.planes.y), -rim, rim);
    let plane_3 = clamp(vec4f(footprint.planes.z), -rim, rim);
    let plane_4 = clamp(vec4f(footprint.planes.w), -rim, rim);
    return mat4x4f(
        (plane_1 - plane_0) * in_plane,
        (plane_2 - plane_1) * in_plane,
        (plane_3 - plane_2) * in_plane,
        (plane_4 - plane_3) * in_plane,
    );
}

// One section, between two planes.
fn section(rho_squared: vec4f, near: f32, far: f32, footprint_rim: f32) -> vec4f {
    let rim = rim_at(rho_squared);
    let thickness = clamp(vec4f(far), -rim, rim) - clamp(vec4f(near), -rim, rim);
    return thickness * in_plane_at(rho_squared, footprint_rim);
}

// The Gaussian of ρ², up to the footprint's rim.
fn in_plane_at(rho_squared: vec4f, footprint_rim: f32) -> vec4f {
    let in_plane = exp2(rho_squared * gather.metric.w);
    if ECONOMIES {
        return select(vec4f(0.0), in_plane, rho_squared < vec4f(footprint_rim));
    }
    return in_plane;
}

// H(0, 0, t) where the chord of the kernel's ball ends.
fn rim_at(rho_squared: vec4f) -> vec4f {
    let chord_squared = max(frame.support * frame.support - rho_squared, vec4f(0.0));
    let z = chord_squared * gather.chord_scale.x + gather.chord_scale.y;
    let c = gather.chord;
    let low = c[0].x + z * (c[0].y + z * (c[0].z + z * c[0].w));
    let high = c[1].x + z * (c[1].y + z * (c[1].z + z * c[1].w));
    let z_squared = z * z;
    return sqrt(chord_squared) * (low + z_squared * z_squared * high);
}

// What a voxel adds to a sheet at four pixels.
fn added(section: vec4f, amount: vec4f) -> mat4x4f {
    return mat4x4f(section * amount.x, section * amount.y, section * amount.z, section * amount.w);
}

// What another lane holds.
fn footprint_of(own: Footprint, other: u32) -> Footprint {
    var footprint: Footprint;
    footprint.center_px = subgroupShuffle(own.center_px, other);
    footprint.amount = subgroupShuffle(own.amount, other);
    footprint.first_plane = subgroupShuffle(own.first_plane, other);
    footprint.planes = subgroupShuffle(own.planes, other);
    if PERSPECTIVE {
        footprint.axis = subgroupShuffle(own.axis, other);
        footprint.maps.along = subgroupShuffle(own.maps.along, other);
        footprint.maps.across = subgroupShuffle(own.maps.across, other);
        footprint.maps.amplitude = subgroupShuffle(own.maps.amplitude, other);
    }
    if ECONOMIES {
        footprint.rim = subgroupShuffle(own.rim, other);
    }
    return footprint;
}

// A sheet over or under what is there, at four pixels.
fn composite_sheet(image: mat4x4f, sheet: mat4x4f) -> mat4x4f {
    let pixels = transpose(sheet);
    return mat4x4f(
        composite(image[0], pixels[0], COMPOSITING, ORDER),
        composite(image[1], pixels[1], COMPOSITING, ORDER),
        composite(image[2], pixels[2], COMPOSITING, ORDER),
        composite(image[3], pixels[3], COMPOSITING, ORDER),
    );
}

// The frame's sheets from the first that a kernel overlaps to the one after the last.
fn overlapped_sheets(p: vec4f) -> vec2f {
    let sheets = (overlapped(p, gather.depth_error, PERSPECTIVE) - gather.near) / frame.slab_width;
    return vec2f(floor(sheets.x), ceil(sheets.y));
}

// What a voxel at p adds to the group whose first sheet starts at `near`, in sections or, into the sheet `whole` of them, as a whole.
fn footprint_at(p: vec4f, near: f32, whole: f32, amount: vec4f) -> Footprint {
    var footprint: Footprint;
    footprint.center_px = p.xy;
    var first_step = near - p.z;
    var steps = near - p.z + vec4f(1.0, 2.0, 3.0, 4.0) * frame.slab_width;
    if ECONOMIES && whole >= 0.0 {
        // As far as a kernel reaches, on either side of the sheet.
        first_step = -WHOLE;
        steps = select(vec4f(-WHOLE), vec4f(WHOLE), vec4f(1.0, 2.0, 3.0, 4.0) > vec4f(whole));
    }
    if PERSPECTIVE {
        let ray = local_ray(p.xy);
        let per_depth = select(frame.kernel_per_depth, ray.kernel_per_depth, frame.kernel_per_depth == 0.0);
        let cut = near_cut(ray, p.w);
        let first = max(first_step * per_depth, cut);
        let planes = max(steps * per_depth, vec4f(cut));
        footprint.amount = amount * ray.per_lambda;
        footprint.first_plane = along(first);
        footprint.planes = vec4f(along(planes.x), along(planes.y), along(planes.z), along(planes.w));
        footprint.axis = ray.axis;
        footprint.maps = section_maps(ray, p.w, vec4f(first, planes.xyz), planes);
    } else {
        let planes = steps * frame.kernel_per_depth;
        footprint.amount = amount * frame.amplitude;
        footprint.first_plane = along(first_step * frame.kernel_per_depth);
        footprint.planes = vec4f(along(planes.x), along(planes.y), along(planes.z), along(planes.w));
    }
    if ECONOMIES {
        let amplitude = select(vec4f(1.0), footprint.maps.amplitude, PERSPECTIVE);
        footprint.rim = log(footprint.amount.a * amplitude * gather.peak) / frame.falloff;
    }
    return footprint;
}

// Sheet depths beyond every kernel's reach.
const WHOLE = 1e6;

// Which pixels are not opaque, and their bounds.
fn opened(region: Region, is_inside: vec4<bool>, opacity: vec4f, column: f32, rows: vec4f) -> Region {
    // Pixels off the image count as opaque.
    let is_open = is_inside & (opacity < vec4f(select(3e38, frame.opacity_threshold, frame.culling != 0u)));
    var result = region;
    if ECONOMIES {
        let is_shallow = is_inside & (opacity < vec4f(gather.beta));
        result.shallow = vec4u(
            subgroupBallot(is_shallow.x).x,
            subgroupBallot(is_shallow.y).x,
            subgroupBallot(is_shallow.z).x,
            subgroupBallot(is_shallow.w).x,
        );
    }
    result.open = vec4u(
        subgroupBallot(is_open.x).x,
        subgroupBallot(is_open.y).x,
        subgroupBallot(is_open.z).x,
        subgroupBallot(is_open.w).x,
    );
    let from_top = select(vec4f(1e9), rows, is_open);
    let from_bottom = select(vec4f(-1e9), rows, is_open);
    let top = min(min(from_top.x, from_top.y), min(from_top.z, from_top.w));
    let bottom = max(max(from_bottom.x, from_bottom.y), max(from_bottom.z, from_bottom.w));
    result.open_low = subgroupMin(vec2f(select(1e9, column, any(is_open)), top));
    result.open_high = subgroupMax(vec2f(select(-1e9, column, any(is_open)), bottom));
    return result;
}

// Whether the box around a voxel's footprint holds a pixel of those in `open`. Lanes 0 to 15 hold the pixels across the upper
// units of a region, 16 to 31 those across the lower.
fn is_visible(center_px: vec2f, margin: vec2f, region: Region, open: vec4u) -> bool {
    let center = center_px - region.low;
    let size = region.high - region.low;
    let first_row = i32(clamp(ceil(center.y - margin.y), 0.0, 16.0));
    let end_row = i32(clamp(floor(center.y + margin.y), -1.0, size.y)) + 1;
    let down = i32((1u << u32(end_row)) - (1u << u32(first_row)));
    let upper = vec4u(-(vec4i(down) >> vec4u(0u, 1u, 2u, 3u) & vec4i(1)));
    let lower = vec4u(-(vec4i(down) >> vec4u(4u, 5u, 6u, 7u) & vec4i(1)));
    var across_upper = across(vec4f(center.x), margin.x, size.x);
    var across_lower = across_upper;
    if PARALLELOGRAM {
        // The sides follow the shear of eq. 9.
        let rows = vec4f(0.0, 1.0, 2.0, 3.0) - center.y;
        let half_width = gather.half_width + BOX_SLACK;
        across_upper = across(center.x + gather.shear * rows, half_width, size.x);
        across_lower = across(center.x + gather.shear * (rows + 4.0), half_width, size.x);
    }
    let box = (upper & across_upper) | (lower & (across_lower << vec4u(16u)));
    return end_row > first_row && any((box & open) != vec4u(0u));
}

// The pixels of a row within a distance of a point, one bit each.
fn across(center: vec4f, half_width: f32, last: f32) -> vec4u {
    let first = vec4i(clamp(ceil(center - half_width), vec4f(0.0), vec4f(16.0)));
    let end = vec4i(clamp(floor(center + half_width), vec4f(-1.0), vec4f(last))) + 1;
    return select(vec4u(0u), (vec4u(1u) << vec4u(end)) - (vec4u(1u) << vec4u(first)), end > first);
}

fn draw(tile: u32, thread: u32) {
    frame = frame_uniform;
    gather = gather_uniform;
    let color_ramp = ramp_of(0u, frame.ramps.x);
    let opacity_ramp = ramp_of(frame.ramps.x, frame.ramps.y);
    let gradient_opacity_ramp = ramp_of(frame.ramps.y, frame.ramps.z);

    let columns = (frame.size.x + TILE_SIDE - 1u) / TILE_SIDE;
    let unit = thread / 8u;
    let pixel = vec2u(tile % columns, tile / columns) * TILE_SIDE + vec2u((unit & 1u) * 8u + thread % 8u, (unit >> 1u) * 4u);
    let column = f32(pixel.x) + 0.5;
    let rows = f32(pixel.y) + vec4f(0.5, 1.5, 2.5, 3.5);
    let units = subgroupOr(1u << unit);
    var region: Region;
    region.low = subgroupMin(vec2f(column, rows.x));
    region.high = subgroupMax(vec2f(column, rows.w));

    let slot = (pixel.y - part.first_row) * frame.size.x + pixel.x;
    let is_inside = vec4<bool>(pixel.x < frame.size.x) & (vec4u(pixel.y) + vec4u(0u, 1u, 2u, 3u) < vec4u(frame.size.y));
    var image = mat4x4f();
    if is_inside.x {
        image[0] = acc[slot];
    }
    if is_inside.y {
        image[1] = acc[slot + frame.size.x];
    }
    if is_inside.z {
        image[2] = acc[slot + 2u * frame.size.x];
    }
    if is_inside.w {
        image[3] = acc[slot + 3u * frame.size.x];
    }
    region = opened(region, is_inside, transpose(image)[3], column, rows);

    var voxels_shaded = 0u;
    var sections_rasterized = 0u;
    var bricks_visited = 0u;
    let first_bin = tile * gather.groups;
    let reached = gather.reached + tile * UNITS + firstTrailingBit(units);
    var at = atomicLoad(&gathered.words[reached]);
    var end = starts[first_bin + at];
    // A driver may end loops that go on for too long: what would take too many passes is left to the next dispatch.
    var passes = 0u;
    for (; at < gather.groups && any(region.open != vec4u(0u)); at += 1u) {
        var cursor = end;
        end = starts[first_bin + at + 1u];
        if passes + gather.passes_per_group + (end - cursor) * gather.passes_per_brick > gather.most_passes {
            break;
        }
        passes += gather.passes_per_group;
        if cursor == end {
            continue;
        }
        let group = select(gather.groups - 1u - at, at, ORDER == FRONT_TO_BACK);
        let first_sheet = f32(group * SHEETS);
        let near = gather.near + first_sheet * frame.slab_width;
        let far = near + f32(SHEETS) * frame.slab_width;
        // Where voxels are whose kernels reach this group and whose boxes reach pixels that are not opaque.
        let reach = frame.reach - gather.depth_error;
        let margin = half_boxes[group] + BOX_SLACK;
        let middle = 0.5 * vec2f(frame.size);
        let reaching_low = vec3f(region.open_low - margin - middle, near - reach);
        let reaching_high = vec3f(region.open_high + margin - middle, far + reach);
        var sheets = Sheets();
        var has_drawn = false;

        // Entries are fetched one per lane: the brick's number, corner and voxels.
        var to_visit = 0u;
        var fetched = 0u;
        var fetched_corner = vec3u(0u);
        var fetched_present = vec2u(0u);
        // The brick that is visited: the voxels to draw, and how many of them have been queued.
        var brick = 0u;
        var corner = vec3u(0u);
        var visible = vec2u(0u);
        var visible_count = 0u;
        var queued_count = 0u;
        loop {
            // The queue, filled with voxels of as many bricks as it takes: one per lane.
            var count = 0u;
            var queued_place = vec2u(0u);
            var queued = vec3u(0u);
            while count < lanes {
                while queued_count == visible_count && (to_visit != 0u || cursor < end) {
                    while to_visit == 0u && cursor < end {
                        passes += gather.passes_per_fetch;
                        let entry = entries[min(cursor + lane, end - 1u)];
                        to_visit = subgroupBallot(cursor + lane < end && ((entry >> 24u) & units) != 0u).x;
                        fetched = entry & 0xffffffu;
                        let record = bricks[fetched];
                        fetched_corner = vec3u(record.x, record.y, record.z) & vec3u(~3u);
                        fetched_present = record.present;
                        cursor += lanes;
                    }
                    if to_visit == 0u {
                        break;
                    }
                    let next = firstTrailingBit(to_visit);
                    to_visit &= to_visit - 1u;
                    brick = subgroupShuffle(fetched, next);
                    corner = subgroupShuffle(fetched_corner, next);
                    let present = subgroupShuffle(fetched_present, next);
                    bricks_visited += 1u;
                    passes += gather.passes_per_visit;

                    // Every lane tests a run of the brick's places.
                    let run = BRICK_VOXELS / lanes;
                    let at_corner = homogeneous(vec4f(vec3f(corner), 1.0));
                    var reaching = 0u;
                    for (var i = 0u; i < run; i += 1u) {
                        let p = at_corner + homogeneous(vec4f(vec3f(in_brick(lane * run + i)), 0.0));
                        let scale = select(1.0, p.w, PERSPECTIVE);
                        let on_screen = all(p.xy >= reaching_low.xy * scale) && all(p.xy <= reaching_high.xy * scale);
                        if on_screen && p.z > reaching_low.z && p.z < reaching_high.z && p.w > frame.near {
                            reaching |= 1u << i;
                        }
                    }
                    let shift = lane * run;
                    let shifted = reaching << (shift % 32u);
                    visible = present & subgroupOr(select(vec2u(0u, shifted), vec2u(shifted, 0u), shift < 32u));
                    let ones = countOneBits(visible);
                    visible_count = ones.x + ones.y;
                    queued_count = 0u;
                }
                if queued_count == visible_count {
                    break;
                }
                let nth = lane - count;
                let slot = nth_set_bit(visible, (nth + queued_count) % BRICK_VOXELS);
                if lane >= count && nth < visible_count - queued_count {
                    queued_place = vec2u(brick, slot);
                    queued = corner + in_brick(slot);
                }
                let taken = min(visible_count - queued_count, lanes - count);
                count += taken;
                queued_count += taken;
            }
            if count == 0u {
                break;
            }
            has_drawn = true;
            passes += gather.passes_per_queue;

            // Every lane shades its voxel.
            let p = project(queued);
            let sheets_overlapped = overlapped_sheets(p);
            let here = clamp(sheets_overlapped, vec2f(first_sheet), vec2f(first_sheet + f32(SHEETS)));
            var is_drawn = lane < count && here.x < here.y && is_visible(p.xy, margin, region, region.open);
            let index = index_of(queued);
            let value = value_at(index);
            let gradient = gradient_at(queued);
            var color: vec3f;
            var alpha: f32;
            if LABELS {
                let ramps = ramps_of(index);
                color = ramp(ramps.x, ramps.y, value);
                alpha = ramp(ramps.y, ramps.z, value).x * ramp(ramps.z, ramps.w, gradient.magnitude).x;
            } else {
                color = ramp_at(color_ramp, value);
                alpha = ramp_at(opacity_ramp, value).x * ramp_at(gradient_opacity_ramp, gradient.magnitude).x;
            }
            let m = amount(alpha);
            color = shade(color, gradient, lighting(p.xy, PERSPECTIVE));
            // The sheet of the group that takes the kernel as a whole; before the first if none does.
            var whole = -1.0;
            if ECONOMIES {
                let center_sheet = floor((p.z - gather.near) / frame.slab_width);
                let is_deep = !is_visible(p.xy, margin, region, region.shallow);
                let last_of_first = floor(max(sheets_overlapped.x, 0.0) / f32(SHEETS)) * f32(SHEETS) + f32(SHEETS - 1u);
                if is_deep || alpha < gather.whole_below {
                    let sheet = clamp(center_sheet, sheets_overlapped.x, sheets_overlapped.y - 1.0);
                    whole = select(sheet, min(sheet, last_of_first), is_deep) - first_sheet;
                    is_drawn = is_drawn && whole >= 0.0 && whole < f32(SHEETS);
                }
            }
            var own = footprint_at(p, near, whole, vec4f(color * m, m));
            if ECONOMIES {
                let rim = max(max(own.rim.x, own.rim.y), max(own.rim.z, own.rim.w));
                let part = sqrt(clamp(rim, 0.0, frame.support * frame.support)) / frame.support;
                is_drawn = is_drawn && rim > 0.0 && is_visible(p.xy, half_boxes[group] * part + BOX_SLACK, region, region.open);
            }
            own.amount = select(vec4f(0.0), own.amount, is_drawn);
            if is_drawn {
                // Of the groups that the kernel reaches into, counted from the nearest; a whole one is drawn once.
                let nth = select(group - u32(max(sheets_overlapped.x, 0.0)) / SHEETS, 0u, whole >= 0.0);
                let word = (nth * gather.bricks + queued_place.x) * 2u + queued_place.y / 32u;
                let bit = 1u << (queued_place.y % 32u);
                if (atomicOr(&gathered.words[gather.drawn + word], bit) & bit) == 0u {
                    sections_rasterized += select(u32(here.y - here.x), 1u, whole >= 0.0);
                    voxels_shaded += select(0u, 1u, nth == 0u);
                }
            }

            if ECONOMIES {
                // Those that are drawn, one after the other.
                let drawn = subgroupBallot(is_drawn).x;
                count = countOneBits(drawn);
                own = footprint_of(own, min(nth_set_bit(vec2u(drawn, 0u), lane), lanes - 1u));
                own.amount = select(vec4f(0.0), own.amount, lane < count);
            }

            // Every lane adds all voxels' sections at its own pixels, two voxels at a time.
            for (var i = 0u; i < count; i += 2u) {
                let a = footprint_of(own, i);
                let b = footprint_of(own, i + 1u);
                let s = sections(a, column, rows);
                let t = sections(b, column, rows);
                sheets.first += added(s[0], a.amount) + added(t[0], b.amount);
                sheets.second += added(s[1], a.amount) + added(t[1], b.amount);
                sheets.third += added(s[2], a.amount) + added(t[2], b.amount);
                sheets.fourth += added(s[3], a.amount) + added(t[3], b.amount);
            }
        }

        for (; has_drawn; has_drawn = false) {
            if ORDER == FRONT_TO_BACK {
                image = composite_sheet(image, sheets.first);
                image = composite_sheet(image, sheets.second);
                image = composite_sheet(image, sheets.third);
                image = composite_sheet(image, sheets.fourth);
            } else {
                image = composite_sheet(image, sheets.fourth);
                image = composite_sheet(image, sheets.third);
                image = composite_sheet(image, sheets.second);
                image = composite_sheet(image, sheets.first);
            }
            region = opened(region, is_inside, transpose(image)[3], column, rows);
            if lane == 0u {
                let tiles = tile_grid(frame.size);
                let number = (at * tiles.y + pixel.y / TILE) * tiles.x + pixel.x / TILE;
                let bit = 1u << (number % 32u);
                if (atomicOr(&gathered.words[gather.composited + number / 32u], bit) & bit) == 0u {
                    atomicAdd(&gathered.words[at], 1u);
                }
            }
        }
    }

    if is_inside.x {
        acc[slot] = image[0];
    }
    if is_inside.y {
        acc[slot + frame.size.x] = image[1];
    }
    if is_inside.z {
        acc[slot + 2u * frame.size.x] = image[2];
    }
    if is_inside.w {
        acc[slot + 3u * frame.size.x] = image[3];
    }
    let counts = subgroupAdd(vec2u(voxels_shaded, sections_rasterized));
    if lane == 0u {
        // Where all is opaque nothing is left to do.
        atomicStore(&gathered.words[reached], select(at, gather.groups, all(region.open == vec4u(0u))));
        atomicAdd(&gathered.tally.voxels_shaded, counts.x);
        atomicAdd(&gathered.tally.sections_rasterized, counts.y);
        atomicAdd(&gathered.tally.bricks_visited, bricks_visited);
    }
}

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_index) thread: u32,
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(subgroup_size) subgroup_size: u32,
    @builtin(subgroup_invocation_id) subgroup_invocation_id: u32,
) {
    lanes = subgroup_size;
    lane = subgroup_invocation_id;
    let tile = part.first_tile + unfold(workgroup);
    var is_left = false;
    if tile < part.end_tile {
        let first_bin = tile * gather_uniform.groups;
        let unit = firstTrailingBit(subgroupOr(1u << (thread / 8u)));
        let at = atomicLoad(&gathered.words[gather_uniform.reached + tile * UNITS + unit]);
        is_left = starts[first_bin + at] < starts[first_bin + gather_uniform.groups];
    }
    for (; is_left; is_left = false) {
        draw(tile, thread);
    }
}
