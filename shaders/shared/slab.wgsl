// The slab between two planes at a pixel: what one channel adds to the pixel there, and what pixels carry from plane to plane (SPEC §§9, 10).
// The stage declares `COMPOSITING`, `CUT`, `carried`, `control_points`, `cut` and `draws_front_to_back`.
//
// #import shared/cells
// #import shared/channels
// #import shared/compositing
// #import shared/cut
// #import shared/field_voxel
// #import shared/first_surface
// #import shared/frame
// #import shared/planes
// #import shared/project
// #import shared/ramps
// #import shared/seen
// #import shared/shading
// #import shared/slab_integral

// What pixels carry from plane to plane, as bits: for every channel a record of each pixel, then for every channel whose voxels have colours of their own.
// A channel's record: the number on the previous plane, and there its gradient in numbers per `unit`. For `maximum` and `minimum` the gradient is packed
// and followed by the number chosen so far; for `average` the sum and the count of the numbers so far are in its place. A record of colours: the
// colour and A on the previous plane; for `average` their sum once there is a number. Records of channels differ from these bits in `NOTHING_CARRIED`,
// so that a cleared buffer holds nothing.
// Tiles that add up several channels' sheets hold these behind all records; see `gather/slabs.wgsl`.

// What a pixel carries before its first plane.
const NOTHING_CARRIED = vec4u(NO_NUMBER_BITS, 0u, 0u, NO_NUMBER_BITS);

// What a point without a value is.
const NO_SAMPLE = vec4f(NO_NUMBER, 0.0, 0.0, 0.0);

// Numbers that differ by less, relative to the range of all numbers, count as equal: in homogeneous matter only rounding tells them apart.
const HAIR_OF_RANGE = 2e-6;

// The slack in slabs for rays that enter through a cut where two slabs meet.
const HAIR_OF_SLAB = 1e-4;

// By how much of a cell the middles of rays are moved before their voxel is found: where cells meet, rounding would decide pixel by pixel.
const HAIR_OF_CELL = 1e-3;

// The record of the channel that is looked at, for one of as many pixels as there are.
fn carried_by(slot: u32, pixels: u32) -> vec4u {
    return carried[seen_channel.number * pixels + slot] ^ NOTHING_CARRIED;
}

fn carry(slot: u32, pixels: u32, held: vec4u) {
    carried[seen_channel.number * pixels + slot] = held ^ NOTHING_CARRIED;
}

// The record of its colours.
fn carried_color(slot: u32, pixels: u32) -> vec4f {
    if !has_own_colors() {
        return vec4f(0.0);
    }
    return bitcast<vec4f>(carried[(CHANNELS + seen_channel.colors - 1u) * pixels + slot]);
}

fn carry_color(slot: u32, pixels: u32, color: vec4f) {
    if has_own_colors() {
        carried[(CHANNELS + seen_channel.colors - 1u) * pixels + slot] = bitcast<vec4u>(color);
    }
}

// The sample at the previous plane.
fn carried_sample(held: vec4u) -> vec4f {
    if COMPOSITING == AVERAGE {
        return vec4f(bitcast<f32>(held.x), 0.0, 0.0, 0.0);
    }
    if COMPOSITING == MAXIMUM || COMPOSITING == MINIMUM {
        return vec4f(bitcast<f32>(held.x), unpacked(held.y, held.z));
    }
    return bitcast<vec4f>(held);
}

// The same with another sample.
fn with_sample(held: vec4u, drawn: vec4f) -> vec4u {
    if COMPOSITING == AVERAGE {
        return vec4u(bitcast<u32>(drawn.x), held.yzw);
    }
    if COMPOSITING == MAXIMUM || COMPOSITING == MINIMUM {
        return vec4u(bitcast<u32>(drawn.x), packed(drawn.yzw), held.w);
    }
    return bitcast<vec4u>(drawn);
}

// A pixel's ray in the slab, and what it sees of one channel there.
struct Slab {
    // The position on the image that identifies the ray.
    at: vec3f,
    // The sheet depths of the planes, of the plane that was drawn last, and of the stretch of the whole ray that counts; reversed if it is empty.
    near: f32,
    far: f32,
    plane: f32,
    ray: vec2f,
    // The sheet depth at which the ray enters through a cut whose face is not shaded.
    face: f32,
    // The ray's length per sheet depth, and its way from plane to plane in `unit`s.
    per_depth: f32,
    way: vec3f,
    // The samples at the planes; where only one has a value, it stands for both.
    first: vec4f,
    last: vec4f,
    // The middle of the cubic through both, in numbers and slopes.
    middle: vec4f,
    // The mean of the planes' colours.
    own: vec4f,
    // The sample and the colour at the plane that was drawn last.
    drawn: vec4f,
    drawn_color: vec4f,
}

// The slab between a plane and the one drawn before it, given their samples and colours, of which one at least has a value.
fn slab_between(place: Slab, drawn: vec4f, before: vec4f, drawn_color: vec4f, color_before: vec4f) -> Slab {
    let own = select(drawn, before, drawn.x == NO_NUMBER);
    let other = select(before, drawn, before.x == NO_NUMBER);
    let own_color = select(drawn_color, color_before, drawn.x == NO_NUMBER);
    let other_color = select(color_before, drawn_color, before.x == NO_NUMBER);
    var slab = place;
    slab.first = select(own, other, draws_front_to_back());
    slab.last = select(other, own, draws_front_to_back());
    let bend = dot(slab.first.yzw - slab.last.yzw, slab.way) / 8.0;
    slab.middle = 0.5 * (slab.first + slab.last) + vec4f(bend, vec3f(0.0));
    slab.own = 0.5 * (own_color + other_color);
    slab.drawn = drawn;
    slab.drawn_color = drawn_color;
    return slab;
}

// The sample on the line of values between the planes.
fn sample_at(slab: Slab, sheet_depth: f32) -> vec4f {
    return mix(slab.first, slab.last, (sheet_depth - slab.near) / frame.slab_width);
}

// A pixel's colour, with what it carries from plane to plane, and the sheet depth of its first hit.
struct Composited {
    image: vec4f,
    carried: vec4u,
    carried_color: vec4f,
    hit: f32,
    is_changed: bool,
}

// Whether the slab whose middle has this sheet depth is drawn.
fn is_drawn(middle: f32) -> bool {
    return !CUT || is_drawn_slab(middle);
}

// The part of a pixel's ray in the slab that counts.
fn part_of(ray: vec2f, near: f32, far: f32) -> vec2f {
    return vec2f(max(ray.x, near), min(ray.y, far));
}

// The lighting of a point at a sheet depth of a ray, within a slab.
fn lighting_in(light: Lighting, slab: Slab, near: f32) -> Lighting {
    let from_near = slab.face + HAIR_OF_SLAB * frame.slab_width - near;
    return Lighting(light.light, light.half_vector, from_near >= 0.0 && from_near < frame.slab_width);
}

// A ray in a slab whose planes' samples are not known yet. `ray` is its stretch, and the depth of its face.
fn place_between(px: vec2f, at: vec3f, near: f32, drawn: f32, ray: vec3f, per_depth: f32) -> Slab {
    let none = vec4f(0.0);
    let way = normalize(warped_ray(px) * frame.aspect.xyz) * (per_depth * frame.slab_width);
    return Slab(at, near, near + frame.slab_width, drawn, ray.xy, ray.z, per_depth, way, none, none, none, none, none, none);
}

// A stretch of a slab along which samples run linearly.
struct Segment {
    near: f32,
    width: f32,
    first: vec4f,
    last: vec4f,
}

// The `i`-th of a slab's segments: all of it, or the halves of its cubic profile.
fn segment_of(slab: Slab, i: u32) -> Segment {
    let width = frame.slab_width / f32(SEGMENTS);
    let first = select(slab.first, slab.middle, i == 1u);
    let last = select(slab.last, slab.middle, i + 1u < SEGMENTS);
    return Segment(slab.near + f32(i) * width, width, first, last);
}

// `after::slab_integral` explains these.
const MIN_BENT = 1e-3;
const SINGLE = 5e-7;

// The sample in the middle, given the slab's mean amount: on the line between the planes where only rounding tells the slab from one that shows nothing.
fn middle_of(slab: Slab, amount: f32, table: Table) -> vec4f {
    let low = min(slab.first.x, slab.last.x);
    let high = max(slab.first.x, slab.last.x);
    // Bins divide the range of all numbers.
    let hair = HAIR_OF_RANGE * table.head.y / table.domain.y;
    let is_faint = amount < MIN_BENT && (high < table.head.z + hair || low > table.head.w - hair);
    let is_single = COMPOSITING == SURFACE && amount * (high - low) < SINGLE;
    return select(slab.middle, 0.5 * (slab.first + slab.last), is_faint || is_single);
}

// The sheets of a slab's segments.
struct SlabSheets {
    near: vec4f,
    far: vec4f,
}

// `linear`, `exponential`, `xray`: a channel's sheets.
fn sheets_of(slab: Slab, in_open: Lighting) -> SlabSheets {
    let light = lighting_in(in_open, slab, slab.near);
    let part = part_of(slab.ray, slab.near, slab.far);
    let table = table_at(slab.at, 0.5 * (part.x + part.y), 0.0);
    var sheets = SlabSheets();
    var seen_slab = slab;
    // First the whole slab, whose halves count only if it shows anything: one place for all, because much is compiled into it.
    let is_seen = is_drawn(0.5 * (slab.near + slab.far));
    for (var step = select(SEGMENTS + 1u, 2u - SEGMENTS, is_seen); step <= SEGMENTS; step += 1u) {
        let is_whole = step == 0u;
        var segment = segment_of(seen_slab, max(step, 1u) - 1u);
        if is_whole {
            segment.last = slab.last;
        }
        let means = slab_integral(table, segment.first.x, segment.last.x);
        if means.amount <= 0.0 && is_whole {
            break;
        }
        if is_whole {
            seen_slab.middle = middle_of(slab, means.amount, table);
        }
        for (var is_shown = means.amount > 0.0 && !is_whole; is_shown; is_shown = false) {
            let way = Way(slab.at, segment.near, segment.near + segment.width);
            let seen = look_at(means, segment.first, segment.last, way, slab.own, table, light);
            let share = shown_share(slab.ray, segment.near, segment.width);
            let sheet = vec4f(seen.color, 1.0) * (seen.amount * share * segment.width * slab.per_depth);
            sheets.near = select(sheets.near, sheet, step == 1u);
            sheets.far = select(sheets.far, sheet, step == 2u);
        }
    }
    return sheets;
}

// Composites the sums of the channels' sheets in turn (SPEC §10).
fn composite_sheets(sheets: SlabSheets, ray: vec2f, near: f32, image: vec4f) -> Composited {
    var result = Composited(image, vec4u(), vec4f(), FAR, false);
    for (var k = 0u; k < SEGMENTS; k += 1u) {
        let i = select(SEGMENTS - 1u - k, k, draws_front_to_back());
        let width = frame.slab_width / f32(SEGMENTS);
        let begin = near + f32(i) * width;
        let now = composite_sheet(select(sheets.near, sheets.far, i == 1u), part_of(ray, begin, begin + width), result.image);
        let hit = select(result.hit, now.hit, now.hit != FAR);
        result = Composited(now.image, vec4u(), vec4f(), hit, result.is_changed || now.is_changed);
    }
    return result;
}

fn composite_sheet(sheet: vec4f, part: vec2f, image: vec4f) -> Composited {
    let is_changed = sheet.a > 0.0;
    let order = select(BACK_TO_FRONT, FRONT_TO_BACK, draws_front_to_back());
    let composited = select(image, composite(image, sheet, COMPOSITING, order), is_changed);
    let reached = (cut.first_hit - image.a) / (composited.a - image.a);
    let is_hit = is_changed && image.a < cut.first_hit && composited.a >= cut.first_hit;
    return Composited(composited, vec4u(), vec4f(), select(FAR, mix(part.x, part.y, reached), is_hit), is_changed);
}

// `surface`: the pixel is opaque where its ray first meets one.
fn find_surface(slab: Slab, image: vec4f, in_open: Lighting) -> Composited {
    let light = lighting_in(in_open, slab, slab.near);
    let result = Composited(image, vec4u(), vec4f(), FAR, false);
    let part = part_of(slab.ray, slab.near, slab.far);
    // Of two surfaces the nearer one counts.
    if part.x >= part.y || !is_drawn(0.5 * (slab.near + slab.far)) || (draws_front_to_back() && image.a >= 1.0) {
        return result;
    }
    let alpha = colored(vec3f(0.0), slab.own).a;
    var seen_slab = slab;
    if SEGMENTS > 1u {
        let table = table_at(slab.at, 0.5 * (part.x + part.y), 0.0);
        seen_slab.middle = middle_of(slab, slab_integral(table, slab.first.x, slab.last.x).amount, table);
    }
    for (var i = 0u; i < SEGMENTS; i += 1u) {
        let segment = segment_of(seen_slab, i);
        let far = segment.near + segment.width;
        let start = max(slab.ray.x - segment.near, 0.0) / segment.width;
        let end = 1.0 - max(far - slab.ray.y, 0.0) / segment.width;
        var found = Surface(NO_SURFACE, seen_table);
        if start < end {
            if LABELS {
                let first = voxel_at(slab.at, segment.near);
                found = surface_in_cells(segment.first, segment.last, alpha, start, end, first, voxel_at(slab.at, far));
            } else {
                found.share = surface_between(segment.first, segment.last, alpha, start, end, seen_table);
            }
        }
        if found.share != NO_SURFACE {
            let sheet_depth = segment.near + found.share * segment.width;
            let gradient = gradient_between(segment.first, segment.last, found.share);
            let number = mix(segment.first.x, segment.last.x, found.share);
            let color = colored(color_at(found.table, number), slab.own);
            let voxel = point_on(Way(slab.at, sheet_depth, sheet_depth), 0.0);
            let shaded = vec4f(shade(color.rgb, gradient, light, voxel), 1.0);
            return Composited(shaded, vec4u(), vec4f(), sheet_depth, true);
        }
    }
    return result;
}

// `maximum`, `minimum`, `average`: chooses among the planes' points, or means them. While there is no such point, the pixel has the colour of the
// middle of its stretch, if the slab holds it.
fn choose(slab: Slab, image: vec4f, before: vec4u, color_before: vec4f, in_open: Lighting) -> Composited {
    let plane = slab.plane;
    // A plane belongs to the slab behind it.
    let is_plane_drawn = is_drawn(plane + 0.5 * frame.slab_width);
    let is_point = slab.drawn.x != NO_NUMBER && slab.ray.x <= plane && plane <= slab.ray.y && is_plane_drawn;
    let middle = 0.5 * (slab.ray.x + slab.ray.y);
    let is_here = slab.ray.x <= slab.ray.y && slab.near <= middle && middle < slab.far;
    let is_middle_here = is_here && is_drawn(0.5 * (slab.near + slab.far));
    var carried = before;
    var carried_color = slab.drawn_color;
    var own = slab.drawn_color;
    var is_chosen = is_point;
    var sheet_depth = plane;
    var point = slab.drawn;
    var is_first = false;
    if COMPOSITING == AVERAGE {
        let sum = bitcast<vec2f>(before.yz) + select(vec2f(0.0), vec2f(slab.drawn.x, 1.0), is_point);
        carried = vec4u(0u, bitcast<vec2u>(sum), 0u);
        is_first = sum.y == 0.0;
        let colors = select(color_before, vec4f(0.0), before.z == 0u) + select(vec4f(0.0), slab.drawn_color, is_point);
        carried_color = select(colors, slab.drawn_color, is_first);
        own = colors / max(sum.y, 1.0);
        point = vec4f(sum.x / max(sum.y, 1.0), 0.0, 0.0, 0.0);
        sheet_depth = middle;
    } else {
        let best = bitcast<f32>(before.w);
        // The nearest of equal ones is chosen.
        let domain = control_points[frame.ramps.z + 1u];
        let hair = select(-HAIR_OF_RANGE, HAIR_OF_RANGE, draws_front_to_back()) * (domain.z - domain.x);
        let gain = select(slab.drawn.x - best, best - slab.drawn.x, COMPOSITING == MINIMUM);
        is_chosen = is_point && (best == NO_NUMBER || gain > hair);
        is_first = best == NO_NUMBER && !is_point;
        // Back to front, where a nearer point may be chosen that is not quite as good, the best number stays.
        let is_best = is_chosen && (best == NO_NUMBER || gain > 0.0);
        carried.w = select(before.w, bitcast<u32>(slab.drawn.x), is_best);
    }
    if is_first && is_middle_here {
        is_chosen = true;
        sheet_depth = middle;
        point = sample_at(slab, middle);
        own = slab.own;
    }
    if !is_chosen {
        return Composited(image, carried, carried_color, FAR, false);
    }
    let table = table_at(slab.at, sheet_depth, select(0.0, HAIR_OF_CELL, COMPOSITING == AVERAGE));
    var seen = Look();
    if COMPOSITING == AVERAGE {
        let mean = slab_integral(table, point.x, point.x);
        let color = colored(mean.color, own);
        seen = Look(mean.amount * color.a, color.rgb);
    } else {
        // A plane belongs to the slab behind it.
        let light = lighting_in(in_open, slab, select(slab.near, sheet_depth, is_point));
        seen = look(point, point, Way(slab.at, sheet_depth, sheet_depth), own, table, light);
    }
    let alpha = min(seen.amount, 1.0);
    let is_hit = alpha >= cut.first_hit;
    // Compositing stores 2 minus a minimum's opacity.
    let stored = select(alpha, 2.0 - alpha, COMPOSITING == MINIMUM);
    return Composited(vec4f(seen.color * alpha, stored), carried, carried_color, select(FAR, sheet_depth, is_hit), true);
}
