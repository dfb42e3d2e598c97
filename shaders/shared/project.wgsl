// Pixel coordinates and warped depth of the voxel with this index in the volume.
fn project(index: u32) -> vec3f {
    let row = frame.dims.x;
    let slice = row * frame.dims.y;
    let p = vec4f(f32(index % row), f32(index % slice / row), f32(index / slice), 1.0);
    return vec3f(dot(frame.screen_from_voxel[0], p), dot(frame.screen_from_voxel[1], p), dot(frame.screen_from_voxel[2], p));
}
