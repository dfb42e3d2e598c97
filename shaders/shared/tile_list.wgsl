// Some tiles, and the sizes of a draw or dispatch over them; `gpu::layout::TileList` documents the fields.
struct TileList {
    args: Indirect,
    tiles: array<u32>,
}
