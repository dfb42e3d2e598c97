// A projected and shaded voxel; `gpu::layout::Splat` documents the fields.
struct Splat {
    x_px: f32,
    y_px: f32,
    depth: f32,
    from_eye: f32,
    rg: u32,
    ba: u32,
}
