// Finds the voxels of the visited bricks that a sheet group draws (§6). One workgroup per visited brick, one thread per slot.
//
// #import shared/brick
// #import shared/culled
// #import shared/frame
// #import shared/local_ray
// #import shared/project

@group(0) @binding(1) var<uniform> sheet_group: SheetGroup;
@group(0) @binding(2) var<storage, read> bricks: array<Brick>;
@group(0) @binding(3) var<storage, read> occluded: array<u32>;
@group(0) @binding(4) var<storage, read_write> visits: array<Visit>;
@group(0) @binding(5) var<storage, read_write> states: array<BrickState>;
@group(0) @binding(6) var<storage, read_write> culled: Culled;
@group(0) @binding(7) var<storage, read> visit_args: Indirect;

override SHEETS: u32 = 4u;
// Whether a group is not sheets, but the plane at its near end (SPEC §9).
override PLANE: bool = false;

var<workgroup> hidden_now: array<atomic<u32>, 2>;
var<workgroup> drawn_now: array<atomic<u32>, 2>;
var<workgroup> sections_now: atomic<u32>;

// Whether the box filter that starts at a pixel finds only opaque pixels.
fn is_occluded(x: u32, y: u32) -> bool {
    let word = occluded[y * tile_grid(frame.size).x + x / TILE];
    return (word & (1u << (x % TILE))) != 0u;
}

// Whether every pixel of the footprint's box is opaque. Depending on where in its pixel the centre lies, the box is as large as the filter, or a
// pixel larger, in which case the filters at its corners cover it. Off the image the nearest filter on it serves as well, because it
// contains the part of the box that is on the image.
fn is_hidden(center_px: vec2f) -> bool {
    let last = vec2f(frame.size - 1u);
    let margin = sheet_group.half_box + BOX_SLACK;
    let first = vec2u(clamp(ceil(center_px - margin - 0.5), vec2f(0.0), last));
    let end = max(first, vec2u(clamp(floor(center_px + margin - 0.5) - vec2f(sheet_group.box_filter), vec2f(0.0), last)));
    return is_occluded(first.x, first.y) && is_occluded(end.x, first.y)
        && is_occluded(first.x, end.y) && is_occluded(end.x, end.y);
}

// Beyond every image.
const FARTHER_PX = 1e9;

// Marks the tiles that a footprint's box with this half overlaps.
fn mark_tiles(center_px: vec2f, half_box: vec2f) {
    let last = vec2f(frame.size - 1u);
    let first_tile = vec2u(clamp(center_px - half_box - 0.5, vec2f(0.0), last)) / TILE;
    let last_tile = vec2u(clamp(center_px + half_box, vec2f(0.0), last)) / TILE;
    let columns = tile_grid(frame.size).x;
    for (var y = first_tile.y; y <= last_tile.y; y += 1u) {
        for (var x = first_tile.x; x <= last_tile.x; x += 1u) {
            let tile = y * columns + x;
            if atomicLoad(&culled.tiles[tile]) == 0u {
                atomicStore(&culled.tiles[tile], 1u);
            }
        }
    }
}

@compute @workgroup_size(64)
fn main(@builtin(local_invocation_index) slot: u32, @builtin(workgroup_id) workgroup: vec3u) {
    start(workgroup.z);
    let at = unfold(workgroup);
    if at >= visit_args.count {
        return;
    }
    let visit = visits[at];
    let state = states[visit.brick];
    let word = slot / 32u;
    let bit = 1u << (slot % 32u);
    let brick = bricks[visit.brick];
    if (brick.present[word] & ~state.hidden[word] & bit) != 0u {
        let p = project(voxel_of(brick, slot));
        let center_px = p.xy;
        // Voxels close to the eye have no place on the screen: nothing is known of them.
        let is_close = PLANE && frame.near > 0.0 && p.w <= CLOSE * frame.reach;
        let on_screen = is_close || (all(center_px + sheet_group.half_box >= vec2f(0.5))
            && all(center_px - sheet_group.half_box <= vec2f(frame.size) - 0.5));
        // The sheets of this group that the kernel overlaps by more than the rounding errors of depths: a kernel that ends at a plane does not
        // reach the sheet behind it. The first voxel's depth is about as large as any.
        let error = 2e-7 * (frame.radius + abs(frame.screen_from_voxel[2].w) + abs(sheet_group.near));
        var reached = overlapped(p, error, frame.near > 0.0);
        if PLANE {
            reached = p.z + (frame.reach - error) * vec2f(-1.0, 1.0);
        }
        let depths = (reached - sheet_group.near) / frame.slab_width;
        var first_sheet = max(floor(depths.x), 0.0);
        var end_sheet = min(ceil(depths.y), f32(SHEETS));
        if PLANE {
            first_sheet = 0.0;
            end_sheet = select(0.0, 1.0, depths.x < 0.0 && depths.y > 0.0);
        }
        let is_drawn = on_screen && (is_close || !((sheet_group.culling | zero) != 0u && is_hidden(center_px)));
        // Front to back, boxes only shrink: what is off the screen or hidden stays so. Back to front, where nothing is hidden, they grow.
        if !is_drawn && frame.order == FRONT_TO_BACK {
            atomicOr(&hidden_now[word], bit);
        }
        var sections = select(0u, u32(end_sheet - first_sheet), is_drawn && first_sheet < end_sheet);
        // In perspective the group's box may reach onto the screen where no section's own does. (A one-shot loop, see gather.wgsl.)
        let is_beside = !PLANE && sections > 0u && frame.near > 0.0 && any(abs(center_px - 0.5 * vec2f(frame.size)) > 0.5 * vec2f(frame.size));
        for (var once = is_beside; once; once = false) {
            let ray = local_ray(center_px);
            let planes = sheet_planes(ray, p.z, p.w, sheet_group.near);
            let maps = section_maps(ray, p.w, planes.near, planes.far);
            sections = sections_on_screen(center_px, ray.axis, maps, vec2f(first_sheet, end_sheet));
        }
        if sections > 0u {
            atomicOr(&drawn_now[word], bit);
            atomicAdd(&sections_now, sections);
            mark_tiles(center_px, select(sheet_group.half_box, vec2f(FARTHER_PX), is_close));
        }
    }
    workgroupBarrier();
    if slot == 0u {
        let drawn = vec2u(atomicLoad(&drawn_now[0]), atomicLoad(&drawn_now[1]));
        let hidden = vec2u(atomicLoad(&hidden_now[0]), atomicLoad(&hidden_now[1]));
        let fresh = countOneBits(drawn & ~state.shaded);
        visits[at].drawn = drawn;
        visits[at].fresh = drawn & ~state.shaded;
        states[visit.brick] = BrickState(state.hidden | hidden, state.shaded | drawn);
        atomicAdd(&culled.tally.voxels_shaded, fresh.x + fresh.y);
        atomicAdd(&culled.tally.sections_rasterized, atomicLoad(&sections_now));
    }
}
