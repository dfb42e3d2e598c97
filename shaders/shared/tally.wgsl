// Counts of a frame, and the tiles that the current sheet group draws into; `gpu::layout::Tally` documents the fields.
struct Tally {
    voxels_shaded: atomic<u32>,
    sections_rasterized: atomic<u32>,
    quads: atomic<u32>,
    bricks_tested: atomic<u32>,
    bricks_visited: atomic<u32>,
    padding_0: u32,
    padding_1: u32,
    padding_2: u32,
    tiles: array<atomic<u32>>,
}
