// The counts of a frame; `gpu::layout::Tally` documents the fields.
struct Tally {
    voxels_shaded: atomic<u32>,
    sections_rasterized: atomic<u32>,
    quads: atomic<u32>,
    bricks_tested: atomic<u32>,
    bricks_visited: atomic<u32>,
    padding_0: u32,
    padding_1: u32,
    padding_2: u32,
}
