// The points of pixels' rays, and the voxels whose cells contain them.
// The stage declares `cut`.
//
// #import shared/frame

// The point of a pixel's ray at a sheet depth, in voxels.
fn voxel_at(at: vec3f, sheet_depth: f32) -> vec3f {
    let depth = (sheet_depth - dot(cut.sheet_at.xyz, at)) / dot(cut.sheet_along.xyz, at);
    var place = vec3f();
    for (var axis = 0u; axis < 3u; axis += 1u) {
        place[axis] = dot(cut.box_at[axis].xyz, at) + depth * dot(cut.box_along[axis].xyz, at);
    }
    return place + 0.5 * vec3f(frame.dims.xyz - 1u);
}

// The voxel whose cell holds a point.
fn nearest_voxel(place: vec3f) -> vec3u {
    return vec3u(clamp(floor(place + 0.5), vec3f(0.0), vec3f(frame.dims.xyz - 1u)));
}
