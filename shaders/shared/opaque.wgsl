// Marks the opaque pixels of a tile (§6), with a workgroup of 32×8 threads per tile. `opaque` has one bit per pixel, and `opaque_tiles` a word per tile.
// The stage declares `opaque` and `opaque_tiles`.
//
// #import shared/frame

const WORKGROUP_ROWS = 8u;

// One word per row of the tile. Pixels off the image count as opaque.
var<workgroup> opaque_rows: array<atomic<u32>, TILE>;

fn mark_opaque(column: u32, row: u32, is_opaque: bool) {
    if is_opaque {
        atomicOr(&opaque_rows[row], 1u << column);
    }
}

// Writes what all threads have marked, after a barrier.
fn write_opaque(tile: u32, thread: vec2u) {
    let columns = tile_grid(frame.size).x;
    if thread.y != 0u {
        return;
    }
    let y = tile / columns * TILE + thread.x;
    if y < frame.size.y {
        opaque[y * columns + tile % columns] = atomicLoad(&opaque_rows[thread.x]);
    }
    if thread.x == 0u {
        var all_opaque = 0xffffffffu;
        for (var row = 0u; row < TILE; row += 1u) {
            all_opaque &= atomicLoad(&opaque_rows[row]);
        }
        opaque_tiles[tile] = select(0u, 1u, all_opaque == 0xffffffffu);
    }
}
