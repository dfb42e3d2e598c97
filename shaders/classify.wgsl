// Classifies, shades and composites the slab between a plane and the previously drawn one (SPEC §9), in the tiles in which either plane has a
// value, and marks opaque pixels (§6). One workgroup per tile.
//
// #import shared/band
// #import shared/brick
// #import shared/cells
// #import shared/channels
// #import shared/cut
// #import shared/frame
// #import shared/means
// #import shared/opaque
// #import shared/planes
// #import shared/project
// #import shared/seen
// #import shared/shading
// #import shared/slab
// #import shared/texels
// #import shared/tile_list
// #import shared/volume

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
// What pixels carry from plane to plane; see `shared/slab`.
@group(0) @binding(16) var<storage, read_write> carried: array<vec4u>;
// The slots of pages, where voxels are in pages.
@group(0) @binding(17) var pages: texture_2d_array<u32>;
// See `shared/light`.
@group(0) @binding(18) var light_sheets: texture_3d<f32>;

var<private> cut: Cut;

// `frame.compositing`.
override COMPOSITING: u32 = 0u;
// Whether clip planes or a host's surfaces cut rays, and whether first hits are asked for.
override CUT: bool = false;
override FIRST_HIT: bool = false;
// Whether gradients are the field's derivative.
override KERNEL_GRADIENT: bool = false;

var<workgroup> is_carried: atomic<u32>;

fn draws_front_to_back() -> bool {
    return frame.order == FRONT_TO_BACK;
}

// What a pixel sees of the plane that was drawn: the channel's number and gradient.
fn plane_sample(pixel: vec2u, at: vec3f) -> vec4f {
    let first = textureLoad(sheets, pixel, 2u * seen_channel.number, 0);
    let second = textureLoad(sheets, pixel, 2u * seen_channel.number + 1u, 0);
    var is_value = first.x >= MIN_WEIGHT;
    if HOLES {
        is_value = is_value && !is_hole(stored_at(index_of(nearest_voxel(voxel_at(at, sheet_group.near)))));
    }
    if !is_value {
        return NO_SAMPLE;
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
    let group_before = select(sheet_group.number + 1u, sheet_group.number - 1u, draws_front_to_back());
    let is_after_gap = last_group == 0u || last_group != group_before;
    // The slab's planes.
    let near = select(sheet_group.near, sheet_group.near - frame.slab_width, draws_front_to_back());
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
            var face = FAR;
            if CUT {
                let cuts = shown_depths(px);
                let in_volume = depths;
                depths = both(depths, cuts);
                face = face_depth(at, depths, cuts, in_volume.x);
            }
            let ray = sheet_depths(at, depths);
            let slope = slope_of(px);
            let per_depth = sqrt(1.0 + dot(slope, slope)) / abs(dot(cut.sheet_along.xyz, at));
            let place = place_between(px, at, near, sheet_group.near, vec3f(ray, face), per_depth);
            var composited = Composited(image, vec4u(), vec4f(), FAR, false);
            var near_sheets = ChannelSum();
            var far_sheets = ChannelSum();
            for (var channel = 0u; channel < CHANNELS; channel += 1u) {
                see_channel(channel);
                let drawn = plane_sample(pixel, at);
                let held = carried_by(slot, pixels);
                let before = select(carried_sample(held), NO_SAMPLE, is_after_gap);
                var now = held;
                let color_before = carried_color(slot, pixels);
                var drawn_color = vec4f(0.0);
                if has_own_colors() {
                    drawn_color = select(vec4f(0.0), plane_color(pixel), drawn.x != NO_NUMBER);
                }
                // The sum of an average's colours stays where a plane has no number.
                var color_now = select(drawn_color, color_before, COMPOSITING == AVERAGE && held.z != 0u);
                if drawn.x != NO_NUMBER {
                    atomicStore(&is_carried, 1u);
                }
                if min(drawn.x, before.x) != NO_NUMBER {
                    see_table();
                    let slab = slab_between(place, drawn, before, drawn_color, color_before);
                    let light = lighting(px, frame.near > 0.0);
                    if COMPOSITING == SURFACE {
                        composited = find_surface(slab, image, light);
                    } else if is_by_means() {
                        composited = choose(slab, image, held, color_before, light);
                        now = composited.carried;
                        color_now = composited.carried_color;
                    } else {
                        let own = sheets_of(slab, light);
                        near_sheets = with_channel(near_sheets, own.near);
                        far_sheets = with_channel(far_sheets, own.far);
                    }
                }
                carry(slot, pixels, with_sample(now, drawn));
                carry_color(slot, pixels, color_now);
            }
            if !is_by_means() {
                composited = composite_sheets(SlabSheets(total(near_sheets), total(far_sheets)), ray, near, image);
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
