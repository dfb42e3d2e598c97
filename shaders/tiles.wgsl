// Finds the tiles that a sheet group composites, and those in which the occlusion buffer changes (§6). One workgroup.
//
// #import shared/brick
// #import shared/culled
// #import shared/frame
// #import shared/tile_list

@group(0) @binding(1) var<uniform> sheet_group: SheetGroup;
@group(0) @binding(2) var<storage, read_write> culled: Culled;
// 1 for tiles whose pixels are all opaque, which splats no longer change.
@group(0) @binding(3) var<storage, read> opaque_tiles: array<u32>;
@group(0) @binding(4) var<storage, read_write> composited: TileList;
@group(0) @binding(5) var<storage, read_write> occluding: TileList;
// The number of tiles that every group composited.
@group(0) @binding(6) var<storage, read_write> counts: array<u32>;
// For every tile the number of the group that it was composited for last.
@group(0) @binding(7) var<storage, read> last_groups: array<u32>;

// Whether a group is a plane (SPEC §9). Where it has no value, the value of the previous plane holds for the whole slab.
override PLANE: bool = false;

const WORKGROUP_SIZE = 256u;

var<workgroup> composited_count: atomic<u32>;
var<workgroup> occluding_count: atomic<u32>;

fn is_composited(tile: u32) -> bool {
    let before = select(sheet_group.number + 1u, sheet_group.number - 1u, frame.order == FRONT_TO_BACK);
    let is_behind_value = PLANE && last_groups[tile] != 0u && last_groups[tile] == before;
    let touched = frame.tiles == 0u || atomicLoad(&culled.tiles[tile]) != 0u || is_behind_value;
    return touched && (frame.culling == 0u || opaque_tiles[tile] == 0u);
}

// Whether the box filter that starts at some pixel of a tile, to the right and down, reaches into a composited tile.
fn is_near_composited(at: vec2u, grid: vec2u) -> bool {
    let margin = (sheet_group.box_filter + TILE - 1u) / TILE;
    let high = min(at + margin, grid - 1u);
    for (var y = at.y; y <= high.y; y += 1u) {
        for (var x = at.x; x <= high.x; x += 1u) {
            if is_composited(y * grid.x + x) {
                return true;
            }
        }
    }
    return false;
}

@compute @workgroup_size(256)
fn main(@builtin(local_invocation_index) thread: u32, @builtin(workgroup_id) workgroup: vec3u) {
    start(workgroup.z);
    let grid = tile_grid(frame.size);
    let count = grid.x * grid.y;
    // The order of the lists does not matter, because tiles do not overlap.
    for (var tile = thread; tile < count; tile += WORKGROUP_SIZE) {
        if is_composited(tile) {
            composited.tiles[atomicAdd(&composited_count, 1u)] = tile;
        }
    }
    if frame.culling != 0u {
        for (var tile = thread; tile < count; tile += WORKGROUP_SIZE) {
            if is_near_composited(vec2u(tile % grid.x, tile / grid.x), grid) {
                occluding.tiles[atomicAdd(&occluding_count, 1u)] = tile;
            }
        }
    }
    workgroupBarrier();
    storageBarrier();
    for (var tile = thread; tile < count; tile += WORKGROUP_SIZE) {
        atomicStore(&culled.tiles[tile], 0u);
    }
    if thread == 0u {
        composited.args = indirect(atomicLoad(&composited_count));
        occluding.args = indirect(atomicLoad(&occluding_count));
        counts[sheet_group.index] = atomicLoad(&composited_count);
    }
}
