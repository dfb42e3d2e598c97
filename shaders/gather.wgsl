// The tile rasteriser: draws tiles front to back without sheet buffers in memory. A subgroup keeps the sheets of a group for its
// pixels in registers, gathers the kernel sections that fall on them (§3.2), composites them (eq. 2), and skips what lies behind
// its opaque pixels (§6). Subgroups share nothing, so there are no barriers, and sums have one order whatever else runs.
//
// A tile's 64 threads hold four pixels each, one below the other, in units of 8×4 pixels; a subgroup of 8 to 32 threads holds
// the rectangle of its units. Software drivers execute what an `if` leaves out but not a loop without iterations, hence some
// loops that run at most once.

@group(0) @binding(1) var<uniform> gathers: array<Gather, 1>;
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
// The next dispatch: nothing, if no subgroup says otherwise.
@group(0) @binding(12) var<storage, read_write> next: Indirect;
@group(0) @binding(13) var<uniform> cut: Cut;
@group(0) @binding(14) var surfaces: texture_depth_2d;

// `frame.compositing` and `frame.order`.
override COMPOSITING: u32 = 0u;
override ORDER: u32 = 0u;
// Whether voxels have rays of their own.
override PERSPECTIVE: bool = false;
// Whether a footprint's box is the parallelogram of Fig. 13, else its bounding rectangle.
override PARALLELOGRAM: bool = false;
// Whether any of §8's economies is asked for.
override ECONOMIES: bool = false;
// Whether anything is cut, and whether first hits are asked for.
override CUT: bool = false;
override FIRST_HIT: bool = false;

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

// Pixels of a thread.
const PIXELS = 4u;

// The frame's sheets from the first that a kernel overlaps to the one after the last.
fn overlapped_sheets(p: vec4f) -> vec2f {
    let sheets = (overlapped(p, gather.depth_error, PERSPECTIVE) - gather.near) / frame.slab_width;
    return vec2f(floor(sheets.x), ceil(sheets.y));
}

fn draw(tile: u32, thread: u32) {
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
    var is_shown = is_inside;
    look(column, rows);
    if CUT {
        is_shown &= shown_from < shown_to;
    }
    if FIRST_HIT {
        let word = gather.hits + pixel.y * frame.size.x + pixel.x;
        let past = vec4u(0u, 1u, 2u, 3u) * frame.size.x;
        let last = gather.hits + frame.size.x * frame.size.y - 1u;
        hits = vec4u(
            atomicLoad(&gathered.words[min(word + past.x, last)]),
            atomicLoad(&gathered.words[min(word + past.y, last)]),
            atomicLoad(&gathered.words[min(word + past.z, last)]),
            atomicLoad(&gathered.words[min(word + past.w, last)]),
        );
    }
    region = opened(region, is_shown, transpose(image)[3], column, rows);

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
        if cursor == end && COMPOSITING != MINIMUM {
            image = after_gap(image);
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
        // What is empty counts for the least.
        var has_drawn = COMPOSITING == MINIMUM;

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
                    var sections = u32(here.y - here.x);
                    if PERSPECTIVE {
                        sections = sections_on_screen(p.xy, own.axis, own.maps, here - first_sheet);
                    }
                    sections_rasterized += select(sections, min(sections, 1u), whole >= 0.0);
                    voxels_shaded += select(0u, 1u, nth == 0u && sections > 0u);
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

        if !has_drawn {
            image = after_gap(image);
        }
        for (; has_drawn; has_drawn = false) {
            let width = frame.slab_width;
            if ORDER == FRONT_TO_BACK {
                image = composite_sheet(image, sheets.first, near);
                image = composite_sheet(image, sheets.second, near + width);
                image = composite_sheet(image, sheets.third, near + 2.0 * width);
                image = composite_sheet(image, sheets.fourth, near + 3.0 * width);
            } else {
                image = composite_sheet(image, sheets.fourth, near + 3.0 * width);
                image = composite_sheet(image, sheets.third, near + 2.0 * width);
                image = composite_sheet(image, sheets.second, near + width);
                image = composite_sheet(image, sheets.first, near);
            }
            var is_left = is_shown;
            if CUT && frame.culling != 0u {
                // What lies behind a cut is as hidden as what lies behind opaque voxels.
                is_left &= shown_to > vec4f(far);
            }
            region = opened(region, is_left, transpose(image)[3], column, rows);
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
    if FIRST_HIT {
        let word = gather.hits + pixel.y * frame.size.x + pixel.x;
        for (var i = 0u; i < PIXELS; i += 1u) {
            if is_inside[i] {
                atomicStore(&gathered.words[word + i * frame.size.x], hits[i]);
            }
        }
    }
    let counts = subgroupAdd(vec2u(voxels_shaded, sections_rasterized));
    if lane == 0u {
        // Where all is opaque nothing is left to do.
        let is_done = at == gather.groups || all(region.open == vec4u(0u));
        atomicStore(&gathered.words[reached], select(at, gather.groups, is_done));
        if !is_done {
            next = indirect(part.end_tile - part.first_tile);
        }
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
    start(workgroup.z);
    gather = gathers[zero];
    let tile = part.first_tile + unfold(workgroup);
    var is_left = false;
    if tile < part.end_tile {
        let first_bin = tile * gather.groups;
        let unit = firstTrailingBit(subgroupOr(1u << (thread / 8u)));
        let at = atomicLoad(&gathered.words[gather.reached + tile * UNITS + unit]);
        // Groups without bricks count for the least, also behind the last brick of the tile.
        let first = select(at, 0u, COMPOSITING == MINIMUM && at < gather.groups);
        is_left = starts[first_bin + first] < starts[first_bin + gather.groups];
    }
    for (; is_left; is_left = false) {
        draw(tile, thread);
    }
}
