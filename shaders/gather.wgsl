// The tile rasteriser: draws tiles front to back without sheet buffers in memory. A subgroup keeps the sheets of a group for its
// pixels in registers, gathers the kernel sections that fall on them (§3.2), composites them (eq. 2), and skips what lies behind
// its opaque pixels (§6). Subgroups share nothing, so there are no barriers, and sums have one order whatever else runs.
//
// Threads hold four pixels each, one below the other, in units of 8×4 pixels; a tile has four units, and a subgroup of 8 to 32 threads
// goes round them, one, two or all at a time. What it knows of voxels serves all rounds. Software drivers execute what an `if` leaves
// out but not a loop without iterations, hence some loops that run at most once.

@group(0) @binding(1) var<uniform> gathers: array<Gather, 1>;
@group(0) @binding(2) var<uniform> part: Part;
@group(0) @binding(3) var<storage, read> bricks: array<Brick>;
// Where every sheet group of every tile starts in `entries`.
@group(0) @binding(4) var<storage, read> starts: array<u32>;
// Bricks' numbers.
@group(0) @binding(5) var<storage, read> entries: array<u32>;
// The control points of all ramps, one ramp after the other: value, then rgb or (ordinate, 0, 0); then the table of labels.
@group(0) @binding(6) var<storage, read> control_points: array<vec4f>;
@group(0) @binding(7) var values: texture_2d_array<u32>;
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

// Threads of a workgroup: those of the largest subgroup.
override THREADS: u32 = 32u;

var<private> gather: Gather;

// The subgroup.
var<private> lane: u32;
var<private> lanes: u32;

// Passes through loops, and bricks visited.
var<private> passes: u32;
var<private> bricks_visited: u32;

// Sheets of a group.
const SHEETS = 4u;

// Threads that hold a tile, and units of it.
const TILE_THREADS = 32u;
const UNITS = 4u;

// Passes through loops that are not counted where they are made. The pass that finds a loop at its end is one, and in that pass one
// through every loop inside; loops that run at most once take two.
const PASSES_PER_GROUP = 6u;
const PASSES_PER_FILL = 36u;
const PASSES_PER_FIND = 5u;
const PASSES_PER_SHADING = 7u;
const PASSES_PER_ROUND = 18u;
const PASSES_PER_BATCH = 4u;
const PASSES_PER_ADDITION = 2u;

// To look at how four rays are cut, or along which way means are taken.
fn passes_per_look() -> u32 {
    return select(0u, 140u, CUT || is_by_means());
}

// Voxels of the queue that are looked through at a time, one bit each.
const BATCH = 64u;

// Whether a voxel that is not seen in one group may be seen in the next: there boxes around footprints are of another size.
fn may_appear() -> bool {
    return PERSPECTIVE || ECONOMIES;
}

// The group that is drawn: its number, its first sheet, where that begins, and half the box around its footprints.
struct SheetGroup {
    number: u32,
    first_sheet: f32,
    near: f32,
    half_box: vec2f,
}

// The frame's sheets from the first that a kernel overlaps to the one after the last.
fn overlapped_sheets(p: vec4f) -> vec2f {
    let sheets = (overlapped(p, gather.depth_error, PERSPECTIVE) - gather.near) / frame.slab_width;
    return vec2f(floor(sheets.x), ceil(sheets.y));
}

// Those of them that are in a group.
fn sheets_in(group: SheetGroup, sheets: vec2f) -> vec2f {
    return clamp(sheets, vec2f(group.first_sheet), vec2f(group.first_sheet + f32(SHEETS)));
}

// The first of the groups that a kernel overlaps, in the order in which they are drawn.
fn first_group(sheets: vec2f) -> f32 {
    let sheet = select(min(sheets.y, f32(gather.groups * SHEETS)) - 1.0, max(sheets.x, 0.0), ORDER == FRONT_TO_BACK);
    return floor(sheet / f32(SHEETS));
}

// The units in which the box around a footprint, or a part of its extent, holds one of some pixels.
fn units_seen(words: vec4u, center: vec2f, half_box: vec2f, part: f32) -> u32 {
    let half = half_box * part + BOX_SLACK;
    if PARALLELOGRAM {
        return units_in_parallelogram(words, center, half, gather.half_width * part + BOX_SLACK);
    }
    return units_in_box(words, center, half);
}

// The extent of a kernel's sections in a group as a part of the kernel's: that of the section next to the kernel's centre.
fn extent_in(group: SheetGroup, p: vec4f) -> f32 {
    if PERSPECTIVE || ECONOMIES {
        return 1.0;
    }
    let far = group.near + f32(SHEETS) * frame.slab_width;
    let beside = max(max(group.near - p.z, p.z - far), 0.0) * frame.kernel_per_depth / frame.support;
    return sqrt(max(1.0 - beside * beside, 0.0));
}

// A thread's four pixels.
struct Pixels {
    // Of the tile's.
    unit: u32,
    first: vec2u,
    // Centres.
    column: f32,
    rows: vec4f,
    // In the compositing buffer.
    slot: u32,
    is_inside: vec4<bool>,
}

fn pixels_of(corner: vec2u, thread: u32) -> Pixels {
    let unit = thread / 8u;
    let first = corner + vec2u((unit & 1u) * 8u + thread % 8u, (unit >> 1u) * 4u);
    let is_inside = vec4<bool>(first.x < frame.size.x) & (vec4u(first.y) + vec4u(0u, 1u, 2u, 3u) < vec4u(frame.size.y));
    let slot = (first.y - part.first_row) * frame.size.x + first.x;
    return Pixels(unit, first, f32(first.x) + 0.5, f32(first.y) + vec4f(0.5, 1.5, 2.5, 3.5), slot, is_inside);
}

fn load_image(pixels: Pixels) -> mat4x4f {
    let row = frame.size.x;
    let last = arrayLength(&acc) - 1u;
    let slots = min(vec4u(pixels.slot) + vec4u(0u, row, 2u * row, 3u * row), vec4u(last));
    return mat4x4f(acc[slots.x], acc[slots.y], acc[slots.z], acc[slots.w]);
}

fn store_image(pixels: Pixels, image: mat4x4f) {
    let row = frame.size.x;
    if pixels.is_inside.x {
        acc[pixels.slot] = image[0];
    }
    if pixels.is_inside.y {
        acc[pixels.slot + row] = image[1];
    }
    if pixels.is_inside.z {
        acc[pixels.slot + 2u * row] = image[2];
    }
    if pixels.is_inside.w {
        acc[pixels.slot + 3u * row] = image[3];
    }
}

fn load_hits(pixels: Pixels) {
    let word = gather.hits + pixels.first.y * frame.size.x + pixels.first.x;
    let last = gather.hits + frame.size.x * frame.size.y - 1u;
    let words = min(vec4u(word) + vec4u(0u, 1u, 2u, 3u) * frame.size.x, vec4u(last));
    hits = vec4u(
        atomicLoad(&gathered.words[words.x]),
        atomicLoad(&gathered.words[words.y]),
        atomicLoad(&gathered.words[words.z]),
        atomicLoad(&gathered.words[words.w]),
    );
}

fn store_hits(pixels: Pixels) {
    let word = gather.hits + pixels.first.y * frame.size.x + pixels.first.x;
    for (var i = 0u; i < 4u; i += 1u) {
        if pixels.is_inside[i] {
            atomicStore(&gathered.words[word + i * frame.size.x], hits[i]);
        }
    }
}

// Which of a thread's pixels are not opaque. Pixels off the image count as opaque, and what lies behind a cut is as hidden as what lies
// behind opaque voxels.
fn open_word(pixels: Pixels, opacity: vec4f, depth: f32) -> u32 {
    var is_open = pixels.is_inside & (opacity < vec4f(select(3e38, frame.opacity_threshold, frame.culling != 0u)));
    if CUT {
        is_open &= shown_from < shown_to;
        is_open &= vec4<bool>(frame.culling == 0u) | (shown_to > vec4f(depth));
    }
    return unit_word(is_open);
}

// Which have not reached β.
fn shallow_word(pixels: Pixels, opacity: vec4f) -> u32 {
    return unit_word(pixels.is_inside & (opacity < vec4f(gather.beta)));
}

// A voxel's color and what it adds per unit length, `(C·m, m)`, and its opacity.
struct Shaded {
    amount: vec4f,
    alpha: f32,
}

fn shaded(voxel: vec3u, p: vec4f, color_ramp: Ramp, opacity_ramp: Ramp, gradient_opacity_ramp: Ramp) -> Shaded {
    let index = index_of(voxel);
    let value = value_at(index);
    let gradient = gradient_at(voxel);
    var ramps = vec4u(0u, frame.ramps.xyz);
    var color = vec3f(0.0);
    var alpha = 0.0;
    var is_searched = LABELS;
    if LABELS {
        ramps = ramps_of(index);
    } else {
        color = ramp_at(color_ramp, value);
        alpha = ramp_at(opacity_ramp, value).x;
        // Without a gradient opacity it is one point, which every lane holds.
        var by_gradient = gradient_opacity_ramp.own.y;
        for (var is_graded = ramps.w > ramps.z + 1u; is_graded; is_graded = false) {
            by_gradient = ramp_at(gradient_opacity_ramp, gradient.magnitude).x;
        }
        alpha *= by_gradient;
        is_searched = is_long(color_ramp) || is_long(opacity_ramp) || is_long(gradient_opacity_ramp);
    }
    for (; is_searched; is_searched = false) {
        color = ramp(ramps.x, ramps.y, value);
        alpha = ramp(ramps.y, ramps.z, value).x * ramp(ramps.z, ramps.w, gradient.magnitude).x;
    }
    let m = amount(alpha);
    color = shade(color, gradient, lighting(p.xy, PERSPECTIVE));
    return Shaded(vec4f(color * m, m), alpha);
}

// Counts a voxel that is drawn into a group, and its sections there, if no other tile has: as one if it is drawn as a whole.
fn count_drawn(voxel: u32, p: vec4f, group: SheetGroup, sheets: vec2f, is_whole: bool) -> vec2u {
    // Of the groups that the kernel reaches into, counted from the nearest; a whole one is drawn once.
    let nth = select(group.number - u32(max(sheets.x, 0.0)) / SHEETS, 0u, is_whole);
    let word = nth * gather.bricks * 2u + voxel / 32u;
    let bit = 1u << (voxel % 32u);
    if (atomicOr(&gathered.words[gather.drawn + word], bit) & bit) != 0u {
        return vec2u(0u);
    }
    let here = sheets_in(group, sheets);
    var sections = u32(here.y - here.x);
    if PERSPECTIVE {
        let footprint = footprint_at(p, group.near, -1.0, vec4f(0.0));
        sections = sections_on_screen(p.xy, footprint.axis, footprint.maps, here - group.first_sheet);
    }
    sections = select(sections, min(sections, 1u), is_whole);
    return vec2u(select(0u, 1u, nth == 0u && sections > 0u), sections);
}

// Where voxels are whose kernels reach a group, or start in it, and whose boxes reach some of a tile's pixels.
fn sought_by(bounds: Bounds, group: SheetGroup, first_px: vec2f, is_start: bool) -> Sought {
    let offset = first_px - 0.5 * vec2f(frame.size);
    let margin = group.half_box + BOX_SLACK;
    let far = group.near + f32(SHEETS) * frame.slab_width;
    let reach = frame.reach + gather.depth_error;
    let least_reach = select(frame.reach, 0.0, frame.kernel_per_depth == 0.0) - 2.0 * gather.depth_error;
    var depths = vec2f(group.near - reach, far + reach);
    if is_start && ORDER == FRONT_TO_BACK {
        depths.x = group.near + least_reach;
    }
    if is_start && ORDER != FRONT_TO_BACK {
        depths.y = far - least_reach;
    }
    return Sought(vec3f(bounds.low - margin + offset, depths.x), vec3f(bounds.high + margin + offset, depths.y));
}

// Whether groups without voxels are composited all the same.
fn counts_gaps() -> bool {
    return COMPOSITING == MINIMUM || COMPOSITING == SURFACE;
}

fn draw(tile: u32, thread: u32) {
    let color_ramp = ramp_of(0u, frame.ramps.x);
    let opacity_ramp = ramp_of(frame.ramps.x, frame.ramps.y);
    let gradient_opacity_ramp = ramp_of(frame.ramps.y, frame.ramps.z);

    let columns = (frame.size.x + TILE_WIDTH - 1u) / TILE_WIDTH;
    let corner = vec2u(tile % columns, tile / columns) * vec2u(TILE_WIDTH, TILE_HEIGHT);
    let first_px = vec2f(corner) + 0.5;
    empty_queue(thread);

    // The units that the subgroup goes round, and their pixels that are not opaque.
    var own_units = 0u;
    var open = vec4u(0u);
    var shallow = vec4u(0u);
    for (var first = 0u; first < TILE_THREADS; first += THREADS) {
        let pixels = pixels_of(corner, first + thread);
        look(pixels.column, pixels.rows);
        let opacity = transpose(load_image(pixels))[3];
        own_units |= subgroupOr(1u << pixels.unit);
        open = with_units(open, pixels.unit, open_word(pixels, opacity, -FAR));
        if ECONOMIES {
            shallow = with_units(shallow, pixels.unit, shallow_word(pixels, opacity));
        }
    }

    var counts = vec2u(0u);
    let first_bin = tile * gather.groups;
    let reached = gather.reached + tile * UNITS + firstTrailingBit(own_units);
    var at = atomicLoad(&gathered.words[reached]);
    var end = starts[first_bin + at];
    // Whether the queue holds all voxels of the group before.
    var is_kept = false;
    for (; at < gather.groups && any(open != vec4u(0u)); at += 1u) {
        let first_entry = end;
        end = starts[first_bin + at + 1u];
        // A driver may end loops that go on for too long: what would take too many passes is left to the next dispatch.
        if passes + gather.passes_per_group + (end - first_entry) * gather.passes_per_brick > gather.most_passes {
            break;
        }
        passes += PASSES_PER_GROUP;
        if first_entry == end && !counts_gaps() {
            is_kept = false;
            continue;
        }
        let number = select(gather.groups - 1u - at, at, ORDER == FRONT_TO_BACK);
        let first_sheet = f32(number * SHEETS);
        let near = gather.near + first_sheet * frame.slab_width;
        let far = near + f32(SHEETS) * frame.slab_width;
        let group = SheetGroup(number, first_sheet, near, half_boxes[number]);

        // Of the voxels before those stay that reach into this group and are seen there.
        let count_before = select(0u, queue_count, is_kept);
        queue_count = 0u;
        for (var i = 0u; i < count_before; i += lanes) {
            passes += 1u;
            let slot = queue_first + min(i + lane, count_before - 1u);
            let point = queue_points[slot];
            let voxel = point.w;
            let p = vec4f(bitcast<vec3f>(point.xyz), 1.0);
            let amount = queue_amounts[slot];
            let sheets = overlapped_sheets(p);
            let here = sheets_in(group, sheets);
            let center = p.xy - first_px;
            let is_seen = units_seen(open, center, group.half_box, 1.0) != 0u;
            let units = units_seen(open, center, group.half_box, extent_in(group, p));
            let is_in = i + lane < count_before && here.x < here.y && is_seen;
            let new_slot = queue_first + queue_count + before(ballot(is_in));
            enqueue(is_in, voxel, p, units);
            if is_in {
                queue_amounts[new_slot] = amount;
                counts += count_drawn(voxel, p, group, sheets, false);
            }
        }

        var kept_count = queue_count;
        var sought = sought_by(bounds_of(open), group, first_px, is_kept);
        walk(first_entry, end);
        var open_after = open;
        var shallow_after = shallow;
        var has_drawn = COMPOSITING == MINIMUM;
        // The units of which some of the group has been added.
        var begun = 0u;
        var is_whole_group = true;
        loop {
            passes += PASSES_PER_FILL;
            while queue_count + lanes <= queue_size {
                passes += PASSES_PER_FIND;
                var found: Found;
                let count = find_voxels(sought, &found);
                if count == 0u {
                    break;
                }
                let p = project(found.at);
                let sheets = overlapped_sheets(p);
                let here = sheets_in(group, sheets);
                let center = p.xy - first_px;
                let is_seen = units_seen(open, center, group.half_box, 1.0) != 0u;
                let units = units_seen(open, center, group.half_box, extent_in(group, p));
                let is_sought = !is_kept || first_group(sheets) == f32(number);
                enqueue(lane < count && here.x < here.y && is_seen && is_sought, found.voxel, p, units);
            }
            for (var i = kept_count; i < queue_count; i += lanes) {
                // Every lane shades its voxel.
                passes += PASSES_PER_SHADING + gather.search_passes;
                let is_in = i + lane < queue_count;
                let slot = queue_first + min(i + lane, queue_count - 1u);
                let voxel = queue_points[slot].w;
                let at = voxel_of(bricks[voxel / BRICK_VOXELS], voxel % BRICK_VOXELS);
                let p = project(at);
                let shaded = shaded(at, p, color_ramp, opacity_ramp, gradient_opacity_ramp);
                let sheets = overlapped_sheets(p);
                var is_drawn = is_in;
                var is_whole = false;
                if ECONOMIES {
                    let center = p.xy - first_px;
                    let is_deep = units_seen(shallow, center, group.half_box, 1.0) == 0u;
                    // The sheet of the group that takes the kernel as a whole.
                    var whole = -1.0;
                    is_whole = is_deep || shaded.alpha < gather.whole_below;
                    if is_whole {
                        let last_of_first = floor(max(sheets.x, 0.0) / f32(SHEETS)) * f32(SHEETS) + f32(SHEETS - 1u);
                        let center_sheet = floor((p.z - gather.near) / frame.slab_width);
                        let sheet = clamp(center_sheet, sheets.x, sheets.y - 1.0);
                        whole = select(sheet, min(sheet, last_of_first), is_deep) - first_sheet;
                        is_drawn &= whole >= 0.0 && whole < f32(SHEETS);
                    }
                    let rims = footprint_at(p, near, whole, shaded.amount).rim;
                    let rim = max(max(rims.x, rims.y), max(rims.z, rims.w));
                    let part = sqrt(clamp(rim, 0.0, frame.support * frame.support)) / frame.support;
                    let units = units_seen(open, center, group.half_box, part);
                    is_drawn &= rim > 0.0 && units != 0u;
                    let with_whole = units | select(0u, (1u + u32(max(whole, 0.0))) << WHOLE_SHIFT, is_whole);
                    if is_in {
                        queue_units[slot] = select(0u, with_whole, is_drawn);
                    }
                }
                if is_in {
                    queue_amounts[slot] = shaded.amount;
                    if PERSPECTIVE {
                        queue_points[slot].w = bitcast<u32>(p.w);
                    }
                }
                if is_drawn {
                    counts += count_drawn(voxel, p, group, sheets, is_whole);
                }
            }
            let is_last = is_walked();
            has_drawn |= queue_count > 0u;
            for (var round = 0u; round < TILE_THREADS; round += THREADS) {
                passes += PASSES_PER_ROUND;
                let pixels = pixels_of(corner, round + thread);
                let units = subgroupOr(1u << pixels.unit);
                var has_begun = (begun & units) != 0u;
                // While voxels wait for the queue, sheets are in the workgroup's memory.
                var sheets = Sheets();
                for (; has_begun; has_begun = false) {
                    sheets = saved_sheets(round + thread);
                }
                var is_added = false;
                for (var base = 0u; base < queue_count; base += BATCH) {
                    passes += PASSES_PER_BATCH;
                    // The voxels of which the subgroup's pixels see something.
                    let batch_count = min(queue_count - base, BATCH);
                    var seen = vec2u(0u);
                    for (var i = 0u; i < batch_count; i += 2u * lanes) {
                        passes += 1u;
                        seen |= bits_from(i, ballot(is_queued_for(units, base + i + lane)));
                        seen |= bits_from(i + lanes, ballot(is_queued_for(units, base + i + lanes + lane)));
                    }
                    let ones = countOneBits(seen);
                    let seen_count = ones.x + ones.y;
                    is_added |= seen_count > 0u;
                    for (var i = 0u; i < seen_count; i += lanes) {
                        let slot = queue_first + base + nth_set_bit(seen, min(i + lane, seen_count - 1u));
                        let amount = select(vec4f(0.0), queue_amounts[slot], i + lane < seen_count);
                        var whole = -1.0;
                        if ECONOMIES {
                            whole = f32(queue_units[slot] >> WHOLE_SHIFT) - 1.0;
                        }
                        let own = footprint_at(bitcast<vec4f>(queue_points[slot]), near, whole, amount);
                        // Every lane adds all voxels' sections at its own pixels, two voxels at a time.
                        let count = min(seen_count - i, lanes);
                        passes += PASSES_PER_ADDITION + (count + 1u) / 2u;
                        for (var j = 0u; j < count; j += 2u) {
                            let a = footprint_of(own, j);
                            let b = footprint_of(own, j + 1u);
                            let at_a = offsets_in(a, pixels.column, pixels.rows);
                            let at_b = offsets_in(b, pixels.column, pixels.rows);
                            var of_a = chords(a, at_a, 0u);
                            var of_b = chords(b, at_b, 0u);
                            sheets.first += added(section(a.first_plane, a.planes.x, of_a), a.amount)
                                + added(section(b.first_plane, b.planes.x, of_b), b.amount);
                            if PERSPECTIVE {
                                of_a = chords(a, at_a, 1u);
                                of_b = chords(b, at_b, 1u);
                            }
                            sheets.second += added(section(a.planes.x, a.planes.y, of_a), a.amount)
                                + added(section(b.planes.x, b.planes.y, of_b), b.amount);
                            if PERSPECTIVE {
                                of_a = chords(a, at_a, 2u);
                                of_b = chords(b, at_b, 2u);
                            }
                            sheets.third += added(section(a.planes.y, a.planes.z, of_a), a.amount)
                                + added(section(b.planes.y, b.planes.z, of_b), b.amount);
                            if PERSPECTIVE {
                                of_a = chords(a, at_a, 3u);
                                of_b = chords(b, at_b, 3u);
                            }
                            sheets.fourth += added(section(a.planes.z, a.planes.w, of_a), a.amount)
                                + added(section(b.planes.z, b.planes.w, of_b), b.amount);
                        }
                    }
                }
                if is_added {
                    begun |= units;
                }
                for (var is_left = is_added && !is_last; is_left; is_left = false) {
                    save_sheets(round + thread, sheets);
                }
                for (var is_done = is_last && ((begun & units) != 0u || counts_gaps()); is_done; is_done = false) {
                    passes += passes_per_look();
                    look(pixels.column, pixels.rows);
                    if FIRST_HIT {
                        load_hits(pixels);
                    }
                    let image = composite_group(load_image(pixels), sheets, near);
                    store_image(pixels, image);
                    if FIRST_HIT {
                        store_hits(pixels);
                    }
                    let opacity = transpose(image)[3];
                    open_after = with_units(open_after, pixels.unit, open_word(pixels, opacity, far));
                    if ECONOMIES {
                        shallow_after = with_units(shallow_after, pixels.unit, shallow_word(pixels, opacity));
                    }
                }
            }
            if is_last {
                break;
            }
            is_whole_group = false;
            queue_count = 0u;
            kept_count = 0u;
        }
        open = open_after;
        shallow = shallow_after;
        is_kept = is_whole_group && !may_appear();
        for (; has_drawn; has_drawn = false) {
            if lane == 0u {
                let tiles = tile_grid(frame.size);
                let number = (at * tiles.y + corner.y / TILE) * tiles.x + corner.x / TILE;
                let bit = 1u << (number % 32u);
                if (atomicOr(&gathered.words[gather.composited + number / 32u], bit) & bit) == 0u {
                    atomicAdd(&gathered.words[at], 1u);
                }
            }
        }
    }

    let all_counts = subgroupAdd(counts);
    if lane == 0u {
        // Where all is opaque nothing is left to do.
        let is_done = at == gather.groups || all(open == vec4u(0u));
        atomicStore(&gathered.words[reached], select(at, gather.groups, is_done));
        if !is_done {
            next = indirect(part.end_tile - part.first_tile);
        }
        atomicAdd(&gathered.tally.voxels_shaded, all_counts.x);
        atomicAdd(&gathered.tally.sections_rasterized, all_counts.y);
        atomicAdd(&gathered.tally.bricks_visited, bricks_visited);
    }
}

@compute @workgroup_size(THREADS)
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
