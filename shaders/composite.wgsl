// Composites a group of sheet buffers into the compositing buffer (eq. 2, front to back by default; SPEC §5), in the tiles that received
// splats, and marks opaque pixels (§6). One workgroup per tile.
//
// #import shared/band
// #import shared/brick
// #import shared/compositing
// #import shared/cut
// #import shared/frame
// #import shared/means
// #import shared/opaque
// #import shared/tile_list

@group(0) @binding(1) var<uniform> band: Band;
@group(0) @binding(2) var sheets: texture_2d_array<f32>;
@group(0) @binding(3) var<storage, read_write> acc: array<vec4f>;
@group(0) @binding(4) var<storage, read> composited: TileList;
// The opacity buffer, clamped to the threshold: one bit per pixel, set from `opacity_threshold` on.
@group(0) @binding(5) var<storage, read_write> opaque: array<u32>;
@group(0) @binding(6) var<storage, read_write> opaque_tiles: array<u32>;
@group(0) @binding(7) var<uniform> sheet_group: SheetGroup;
@group(0) @binding(8) var<uniform> cuts: array<Cut, 1>;
@group(0) @binding(9) var surfaces: texture_depth_2d;
// For every pixel the bits of its first hit's sheet depth; 0 where the opacity has not been reached.
@group(0) @binding(10) var<storage, read_write> hits: array<u32>;
// For every tile the number of the last group that composited it.
@group(0) @binding(11) var<storage, read_write> last_groups: array<u32>;

var<private> cut: Cut;

// `frame.compositing`.
override COMPOSITING: u32 = 0u;
// Whether anything is cut, and whether first hits are requested.
override CUT: bool = false;
override FIRST_HIT: bool = false;

// Whether a sheet changes the image.
fn counts(opacity: f32, middle: f32, counted: vec2f) -> bool {
    switch COMPOSITING {
        case MINIMUM: {
            return counted.x <= middle && middle <= counted.y;
        }
        case SURFACE: {
            return true;
        }
        default: {
            return opacity > 0.0;
        }
    }
}

@compute @workgroup_size(32, 8)
fn main(@builtin(local_invocation_id) local: vec3u, @builtin(workgroup_id) workgroup: vec3u) {
    start(workgroup.z);
    // For the reason that `start` gives.
    cut = cuts[zero];
    let at = unfold(workgroup);
    if at >= composited.args.count {
        return;
    }
    let tile = composited.tiles[at];
    let words = tile_grid(frame.size).x;
    let corner = vec2u(tile % words, tile / words) * TILE;
    // All threads must reach the barrier, and a browser cannot know that they would all return here.
    let is_in_band = corner.y >= band.first_row && corner.y < band.first_row + band.rows;
    let layers = textureNumLayers(sheets);
    let is_after_gap = last_groups[tile] + 1u != sheet_group.number;
    for (var row = select(TILE, local.y, is_in_band); row < TILE; row += WORKGROUP_ROWS) {
        let pixel = corner + vec2u(local.x, row);
        var is_opaque = true;
        if all(pixel < frame.size) {
            let slot = (pixel.y - band.first_row) * frame.size.x + pixel.x;
            var image = acc[slot];
            if COMPOSITING == SURFACE && is_after_gap && image.a < 1.0 {
                // The stored mean must be that of the previous sheet. If that sheet was empty here, the stored one is older and does not count.
                image = vec4f(0.0);
            }
            var ray = vec2f(-FAR, FAR);
            if CUT {
                ray = shown(vec2f(pixel) + 0.5);
            }
            var looks = Means();
            if is_by_means() {
                looks = means(vec2f(pixel) + 0.5);
            }
            for (var i = 0u; i < layers; i += 1u) {
                let layer = select(layers - 1u - i, i, frame.order == FRONT_TO_BACK);
                var sheet = textureLoad(sheets, pixel, layer, 0);
                let near = sheet_group.near + f32(layer) * frame.slab_width;
                let part = vec2f(max(ray.x, near), min(ray.y, near + frame.slab_width));
                if CUT && COMPOSITING != MINIMUM {
                    sheet *= shown_share(ray, near, frame.slab_width);
                }
                if is_by_means() {
                    sheet *= looks.weight;
                }
                let middle = near + 0.5 * frame.slab_width;
                if counts(sheet.a, middle, looks.counted) && (!CUT || is_drawn_slab(middle)) {
                    let before = image.a;
                    image = composite(image, sheet, COMPOSITING, frame.order);
                    if FIRST_HIT && COMPOSITING == SURFACE && before < 1.0 && image.a >= 1.0 {
                        let at = near + (crossing(before, sheet.a) - 0.5) * frame.slab_width;
                        hits[pixel.y * frame.size.x + pixel.x] = noted(clamp(at, ray.x, ray.y));
                    }
                    if FIRST_HIT && COMPOSITING != SURFACE && before < cut.first_hit && image.a >= cut.first_hit {
                        let share = (cut.first_hit - before) / (image.a - before);
                        hits[pixel.y * frame.size.x + pixel.x] = noted(mix(part.x, part.y, share));
                    }
                }
            }
            acc[slot] = image;
            // Whatever lies behind a cut is hidden, as behind opaque voxels.
            let is_cut = CUT && min(ray.y, cut.slabs.y) <= sheet_group.near + f32(layers) * frame.slab_width;
            is_opaque = image.a >= frame.opacity_threshold || is_cut;
        }
        mark_opaque(local.x, row, is_opaque);
    }
    workgroupBarrier();
    if !is_in_band {
        return;
    }
    write_opaque(tile, local.xy);
    if all(local.xy == vec2u()) {
        last_groups[tile] = sheet_group.number;
    }
}
