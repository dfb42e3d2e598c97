// The volume's values and gradients. The stage declares `values`, a texture array that `gpu::volume_texture` folds.

fn value_at(index: u32) -> f32 {
    return textureLoad(values, vec2u(index & 2047u, (index >> 11u) & 2047u), index >> 22u, 0).x;
}

// Index of a voxel in the volume, x fastest.
fn index_of(voxel: vec3u) -> u32 {
    return voxel.x + frame.dims.x * (voxel.y + frame.dims.y * voxel.z);
}

struct Gradient {
    // -g/|g|, 0 without a direction.
    normal: vec3f,
    // |g|, value per world unit; 0 without a direction.
    magnitude: f32,
}

// Half the difference along an axis, value per `unit`; one-sided at the border, 0 with one sample.
fn half_difference(index: u32, stride: u32, at: u32, count: u32, scale: f32) -> f32 {
    let before = min(at, 1u);
    let after = min(count - 1u - at, 1u);
    // Halves, as values may be more than the largest f32 apart.
    let difference = 0.5 * value_at(index + after * stride) - 0.5 * value_at(index - before * stride);
    return difference * select(2.0 * scale, scale, before + after == 2u);
}

// Central differences in the unwarped space (§4.2, SPEC §3).
fn gradient_at(voxel: vec3u) -> Gradient {
    let index = index_of(voxel);
    let row = frame.dims.x;
    let g = vec3f(
        half_difference(index, 1u, voxel.x, frame.dims.x, frame.gradient.x),
        half_difference(index, row, voxel.y, frame.dims.y, frame.gradient.y),
        half_difference(index, row * frame.dims.y, voxel.z, frame.dims.z, frame.gradient.z),
    );
    // Squares leave the range of f32 long before the gradient does.
    let largest = max(max(abs(g.x), abs(g.y)), abs(g.z));
    let direction = g / select(1.0, largest, largest > 0.0);
    let size = length(direction);
    // In this order the product leaves the range of f32 where the magnitude does, and nowhere else.
    let magnitude = (largest * frame.per_unit) * (2.0 * size * frame.per_unit);
    if magnitude < frame.gradient.w {
        return Gradient(vec3f(0.0), 0.0);
    }
    return Gradient(-direction / size, magnitude);
}
