// Pixel coordinates and warped depth of a voxel.
fn project(voxel: vec3u) -> vec3f {
    let p = vec4f(vec3f(voxel), 1.0);
    return vec3f(dot(frame.screen_from_voxel[0], p), dot(frame.screen_from_voxel[1], p), dot(frame.screen_from_voxel[2], p));
}
