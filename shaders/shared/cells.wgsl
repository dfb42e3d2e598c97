// Points on pixels' rays, and the voxels whose cells hold them. A stage that includes this includes `cut`.

// The point of a ray at a sheet depth, in voxels.
fn voxel_at(at: vec3f, sheet_depth: f32) -> vec3f {
    let depth = (sheet_depth - dot(cut.sheet_at.xyz, at)) / dot(cut.sheet_along.xyz, at);
    var place = vec3f();
    for (var axis = 0u; axis < 3u; axis += 1u) {
        place[axis] = dot(cut.box_at[axis].xyz, at) + depth * dot(cut.box_along[axis].xyz, at);
    }
    return place + 0.5 * vec3f(frame.dims.xyz - 1u);
}

// The index of the voxel whose cell holds a point, beyond all cells of the nearest one.
fn nearest_index(place: vec3f) -> u32 {
    return index_of(vec3u(clamp(floor(place + 0.5), vec3f(0.0), vec3f(frame.dims.xyz - 1u))));
}
