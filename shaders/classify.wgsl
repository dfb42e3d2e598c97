// Classifies, shades and composites the slab between a plane and the previously drawn one (SPEC §9), in the tiles in which either plane has a
// value, and marks opaque pixels (§6). One workgroup per tile.

@group(0) @binding(1) var<uniform> band: Band;
// The sums of `field`, two layers for each channel; then those of `field_colors`, one for each channel whose voxels have colours of their own.
@group(0) @binding(2) var sheets: texture_2d_array<f32>;
@group(0) @binding(3) var<storage, read_write> acc: array<vec4f>;
@group(0) @binding(4) var<storage, read> composited: TileList;
@group(0) @binding(5) var<storage, read_write> opaque: array<u32>;
@group(0) @binding(6) var<storage, read_write> opaque_tiles: array<u32>;
@group(0) @binding(7) var<uniform> sheet_group: SheetGroup;
@group(0) @binding(8) var<uniform> cuts: array<Cut, 1>;
@group(0) @binding(9) var surfaces: texture_depth_2d;
@group(0) @binding(10) var<storage, read_write> hits: array<u32>;
// For every tile the number of the last group whose plane has a value in it.
@group(0) @binding(11) var<storage, read_write> last_groups: array<u32>;
@group(0) @binding(12) var<storage, read> control_points: array<vec4f>;
@group(0) @binding(13) var labels: texture_2d_array<u32>;
@group(0) @binding(14) var values: texture_2d_array<u32>;
@group(0) @binding(15) var<uniform> planes: FieldPlanes;
// What pixels carry from plane to plane, as bits: for every channel a record of each pixel, then for every channel whose voxels have colours of their own.
// A channel's record: the number on the previous plane, and there its gradient in numbers per `unit`. For `maximum` and `minimum` the gradient is packed
// and followed by the number chosen so far; for `average` the sum and the count of the numbers so far are in its place. A record of colours: the
// colour and A on the previous plane; for `average` their sum once there is a number.
@group(0) @binding(16) var<storage, read_write> carried: array<vec4u>;

var<private> cut: Cut;

// `frame.compositing`.
override COMPOSITING: u32 = 0u;
// Whether clip planes or a host's surfaces cut rays, and whether first hits are asked for.
override CUT: bool = false;
override FIRST_HIT: bool = false;
// Whether gradients are the field's derivative.
override KERNEL_GRADIENT: bool = false;

var<workgroup> is_carried: atomic<u32>;

// What a pixel sees of the plane that was drawn: the channel's number and gradient.
fn plane_sample(pixel: vec2u, at: vec3f) -> vec4f {
    let first = textureLoad(sheets, pixel, 2u * seen_channel.number, 0);
    let second = textureLoad(sheets, pixel, 2u * seen_channel.number + 1u, 0);
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
    let moment = (second.yzw - number * vec3f(first.zw, second.x)) / first.x;
    let is_noise = dot(moment, moment) < seen_channel.min_moment * seen_channel.min_moment;
    let gradient = in_grid(-2.0 * frame.falloff * moment) / frame.aspect.xyz;
    return vec4f(number, select(gradient, vec3f(0.0), is_noise));
}

// The colour and A of the channel on the plane that was drawn, where it has a number.
fn plane_color(pixel: vec2u) -> vec4f {
    let weight = textureLoad(sheets, pixel, 2u * seen_channel.number, 0).x;
    let sum = textureLoad(sheets, pixel, 2u * CHANNELS + seen_channel.colors - 1u, 0);
    return clamp(sum / weight, vec4f(0.0), vec4f(1.0));
}

// Numbers that differ by less, relative to the range of all numbers, count as equal: in homogeneous matter only rounding tells them apart.
const HAIR_OF_RANGE = 2e-6;

// What a pixel carries before its first plane.
const NOTHING_CARRIED = vec4u(NO_NUMBER_BITS, 0u, 0u, NO_NUMBER_BITS);

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
    // The sheet depths of the planes, and of the stretch of the whole ray that counts; reversed if it is empty.
    near: f32,
    far: f32,
    ray: vec2f,
    // The samples at the planes; where only one has a value, it stands for both.
    first: vec4f,
    last: vec4f,
    // The mean of the planes' colours.
    own: vec4f,
    // The sample and the colour at the plane that was drawn.
    drawn: vec4f,
    drawn_color: vec4f,
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

// `linear`, `exponential`, `xray`: a channel's sheet.
fn sheet_of(slab: Slab, light: Lighting) -> vec4f {
    let part = part_of(slab.ray, slab.near, slab.far);
    let share = select(0.0, shown_share(slab.ray, slab.near), is_drawn(0.5 * (slab.near + slab.far)));
    let seen = look(slab.first, slab.last, slab.own, ramps_at(slab.at, 0.5 * (part.x + part.y)), light);
    let slope = select(vec2f(0.0), frame.pixel_per_depth * slab.at.xy, frame.near > 0.0);
    let per_sheet = sqrt(1.0 + dot(slope, slope)) / dot(cut.sheet_along.xyz, slab.at);
    return vec4f(seen.color, 1.0) * (seen.amount * share * frame.slab_width * per_sheet);
}

// Composites the sum of the channels' sheets (SPEC §10).
fn composite_sheet(sheet: vec4f, part: vec2f, image: vec4f) -> Composited {
    let is_changed = sheet.a > 0.0;
    let composited = select(image, composite(image, sheet, COMPOSITING, frame.order), is_changed);
    let reached = (cut.first_hit - image.a) / (composited.a - image.a);
    let is_hit = is_changed && image.a < cut.first_hit && composited.a >= cut.first_hit;
    return Composited(composited, vec4u(), vec4f(), select(FAR, mix(part.x, part.y, reached), is_hit), is_changed);
}

// `surface`: the pixel is opaque where its ray first meets one.
fn find_surface(slab: Slab, image: vec4f, light: Lighting) -> Composited {
    let start = max(slab.ray.x - slab.near, 0.0) / frame.slab_width;
    let shown_end = 1.0 - max(slab.far - slab.ray.y, 0.0) / frame.slab_width;
    let end = select(start, shown_end, is_drawn(0.5 * (slab.near + slab.far)));
    let alpha = colored(vec3f(0.0), slab.own).a;
    var share = NO_SURFACE;
    // Of two surfaces the nearer one counts.
    if start < end && (frame.order != FRONT_TO_BACK || image.a < 1.0) {
        if LABELS {
            let first = voxel_at(slab.at, slab.near);
            share = surface_in_cells(slab.first, slab.last, alpha, start, end, first, voxel_at(slab.at, slab.far));
        } else {
            share = surface_between(slab.first, slab.last, alpha, start, end, vec4u(0u, frame.ramps.xyz));
        }
    }
    if share == NO_SURFACE {
        return Composited(image, vec4u(), vec4f(), FAR, false);
    }
    let sheet_depth = slab.near + share * frame.slab_width;
    let ramps = ramps_at(slab.at, sheet_depth);
    let gradient = gradient_between(slab.first, slab.last, share);
    let color = colored(color_at(ramps.w, mix(slab.first.x, slab.last.x, share)), slab.own);
    return Composited(vec4f(shade(color.rgb, gradient, light), 1.0), vec4u(), vec4f(), sheet_depth, true);
}

// `maximum`, `minimum`, `average`: chooses among the planes' points, or means them. While there is no such point, the pixel has the colour of the
// middle of its stretch, if the slab holds it.
fn choose(slab: Slab, image: vec4f, before: vec4u, color_before: vec4f, light: Lighting) -> Composited {
    let plane = sheet_group.near;
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
        let hair = select(-HAIR_OF_RANGE, HAIR_OF_RANGE, frame.order == FRONT_TO_BACK) * (domain.z - domain.x);
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
    let ramps = ramps_at(slab.at, sheet_depth);
    var seen = Look();
    if COMPOSITING == AVERAGE {
        let mean = slab_integral(ramps.w, point.x, point.x);
        let color = colored(mean.color, own);
        seen = Look(mean.amount * color.a, color.rgb);
    } else {
        seen = look(point, point, own, ramps, light);
    }
    let alpha = min(seen.amount, 1.0);
    let is_hit = alpha >= cut.first_hit;
    // Compositing stores 2 minus a minimum's opacity.
    let stored = select(alpha, 2.0 - alpha, COMPOSITING == MINIMUM);
    return Composited(vec4f(seen.color * alpha, stored), carried, carried_color, select(FAR, sheet_depth, is_hit), true);
}

@compute @workgroup_size(32, 8)
fn main(@builtin(local_invocation_id) local: vec3u, @builtin(workgroup_id) workgroup: vec3u) {
    start(workgroup.z);
    // For the reason that `start` gives.
    cut = cuts[zero];
    let list_place = unfold(workgroup);
    if list_place >= composited.args.count {
        return;
    }
    let tile = composited.tiles[list_place];
    let words = tile_grid(frame.size).x;
    let corner = vec2u(tile % words, tile / words) * TILE;
    // All threads must reach the barrier, and a browser cannot know that they would all return here.
    let is_in_band = corner.y >= band.first_row && corner.y < band.first_row + band.rows;
    let last_group = last_groups[tile];
    let is_front_to_back = frame.order == FRONT_TO_BACK;
    let group_before = select(sheet_group.number + 1u, sheet_group.number - 1u, is_front_to_back);
    let is_after_gap = last_group == 0u || last_group != group_before;
    // The slab's planes.
    let near = select(sheet_group.near, sheet_group.near - frame.slab_width, is_front_to_back);
    let far = near + frame.slab_width;
    let pixels = band.rows * frame.size.x;
    for (var row = select(TILE, local.y, is_in_band); row < TILE; row += WORKGROUP_ROWS) {
        let pixel = corner + vec2u(local.x, row);
        var is_opaque = true;
        if all(pixel < frame.size) {
            let slot = (pixel.y - band.first_row) * frame.size.x + pixel.x;
            let px = vec2f(pixel) + 0.5;
            let at = place_of(px);
            let image = acc[slot];
            var depths = in_box(at, cut.box_half.xyz);
            if CUT {
                depths = both(depths, shown_depths(px));
            }
            let ray = sheet_depths(at, depths);
            var composited = Composited(image, vec4u(), vec4f(), FAR, false);
            var sheets_of_channels = ChannelSum();
            for (var channel = 0u; channel < CHANNELS; channel += 1u) {
                see_channel(channel);
                let drawn = plane_sample(pixel, at);
                let held = select(carried[channel * pixels + slot], NOTHING_CARRIED, last_group == 0u);
                let before = select(carried_sample(held), vec4f(NO_NUMBER, 0.0, 0.0, 0.0), is_after_gap);
                var now = held;
                let color_slot = (CHANNELS + seen_channel.colors - 1u) * pixels + slot;
                var drawn_color = vec4f(0.0);
                var color_before = vec4f(0.0);
                if has_own_colors() {
                    drawn_color = select(vec4f(0.0), plane_color(pixel), drawn.x != NO_NUMBER);
                    color_before = select(bitcast<vec4f>(carried[color_slot]), vec4f(0.0), last_group == 0u);
                }
                // The sum of an average's colours stays where a plane has no number.
                var color_now = select(drawn_color, color_before, COMPOSITING == AVERAGE && held.z != 0u);
                if drawn.x != NO_NUMBER {
                    atomicStore(&is_carried, 1u);
                }
                if min(drawn.x, before.x) != NO_NUMBER {
                    // If only one plane has a value, it stands for both.
                    let own = select(drawn, before, drawn.x == NO_NUMBER);
                    let other = select(before, drawn, before.x == NO_NUMBER);
                    let first = select(own, other, is_front_to_back);
                    let last = select(other, own, is_front_to_back);
                    let own_color = select(drawn_color, color_before, drawn.x == NO_NUMBER);
                    let other_color = select(color_before, drawn_color, before.x == NO_NUMBER);
                    let color = 0.5 * (own_color + other_color);
                    let slab = Slab(at, near, far, ray, first, last, color, drawn, drawn_color);
                    let light = lighting(px, frame.near > 0.0);
                    if COMPOSITING == SURFACE {
                        composited = find_surface(slab, image, light);
                    } else if is_by_means() {
                        composited = choose(slab, image, held, color_before, light);
                        now = composited.carried;
                        color_now = composited.carried_color;
                    } else {
                        sheets_of_channels = with_channel(sheets_of_channels, sheet_of(slab, light));
                    }
                }
                carried[channel * pixels + slot] = with_sample(now, drawn);
                if has_own_colors() {
                    carried[color_slot] = bitcast<vec4u>(color_now);
                }
            }
            if !is_by_means() {
                composited = composite_sheet(total(sheets_of_channels), part_of(ray, near, far), image);
            }
            if composited.is_changed {
                acc[slot] = composited.image;
            }
            if FIRST_HIT && composited.is_changed && (is_by_means() || composited.hit != FAR) {
                let hit = select(noted(composited.hit), 0u, composited.hit == FAR);
                hits[pixel.y * frame.size.x + pixel.x] = hit;
            }
            // What lies behind a cut is as hidden as what lies behind opaque voxels.
            is_opaque = composited.image.a >= frame.opacity_threshold || (CUT && min(ray.y, cut.slabs.y) <= far);
        }
        mark_opaque(local.x, row, is_opaque);
    }
    workgroupBarrier();
    if !is_in_band {
        return;
    }
    write_opaque(tile, local.xy);
    if all(local.xy == vec2u()) && atomicLoad(&is_carried) != 0u {
        last_groups[tile] = sheet_group.number;
    }
}
