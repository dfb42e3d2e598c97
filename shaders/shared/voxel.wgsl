// A relevant voxel; `gpu::layout::Voxel` documents the fields.
struct Voxel {
    index: u32,
    value: f32,
    normal: u32,
    gradient_magnitude: f32,
}
