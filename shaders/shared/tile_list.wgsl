// A list of tiles, and the size of a draw or dispatch over them; `gpu::layout::TileList` documents the fields.
//
// #import shared/brick

struct TileList {
    args: Indirect,
    tiles: array<u32>,
}
