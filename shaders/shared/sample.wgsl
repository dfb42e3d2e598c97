// A voxel on its way to slab planes; `gpu::layout::Sample` documents the fields.
struct Sample {
    x: f32,
    y: f32,
    depth: f32,
    from_eye: f32,
    number: f32,
    gradient_x: f32,
    gradient_y: f32,
    gradient_z: f32,
}
