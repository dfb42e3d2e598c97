// The volume's values and gradients. `values` is a texture array that `gpu::volume_texture` folds.
// The stage declares `values`.
//
// #import shared/frame
// #import shared/texels

// Whether any voxel is a hole (SPEC §3); then values are stored as the bits of an f32.
override HOLES: bool = false;

// The channel that is read (SPEC §10), and the index of its first value.
var<private> channel_read: u32 = 0u;
var<private> first_value: u32 = 0u;

// Makes a channel the one that is read, given by its number among those that share sheets.
fn read_channel(channel: u32) {
    channel_read = frame.first_channel + channel;
    first_value = channel_read * voxel_count();
}

fn value_at(index: u32) -> f32 {
    return value_of(stored_at(index));
}

fn stored_at(index: u32) -> u32 {
    let texel = texel_of(first_value + index, textureDimensions(values).x);
    return textureLoad(values, texel.xy, texel.z, 0).x;
}

fn value_of(stored: u32) -> f32 {
    return select(bitcast<f32>(stored), f32(stored) + frame.value_offset, frame.whole_values != 0u);
}

// Whether the stored bits are NaN, a hole. Compilers may assume that no float is NaN, so the bits are tested.
fn is_hole(stored: u32) -> bool {
    return (stored & 0x7f800000u) == 0x7f800000u;
}

struct Gradient {
    // -g/|g|; 0 if the gradient has no direction.
    normal: vec3f,
    // |g| in value per world unit; 0 if the gradient has no direction.
    magnitude: f32,
}

// An eighth of a number, by its exponent's bits: drivers take a common factor out of a difference. 0 if the eighth is not normal.
fn eighth(number: f32) -> f32 {
    let bits = bitcast<u32>(number);
    return select(0.0, bitcast<f32>(bits - 0x1800000u), (bits & 0x7f800000u) > 0x1800000u);
}

// Half the difference along an axis in value per `unit`; one-sided at the border and beside a hole, 0 without a neighbour. The voxel is `at` steps from
// the first of `count` along the axis.
fn half_difference(voxel: vec3u, step: vec3u, at: u32, count: u32, scale: f32) -> f32 {
    var before = min(at, 1u);
    var after = min(count - 1u - at, 1u);
    if HOLES {
        before = select(before, 0u, is_hole(stored_at(index_of(voxel - before * step))));
        after = select(after, 0u, is_hole(stored_at(index_of(voxel + after * step))));
    }
    // Eighths, because values may be more than the largest f32 apart.
    let difference = eighth(value_at(index_of(voxel + after * step))) - eighth(value_at(index_of(voxel - before * step)));
    return difference * select(8.0 * scale, 4.0 * scale, before + after == 2u);
}

// Half of the central differences in the unwarped space (§4.2, SPEC §3), value per `unit`.
fn half_differences(voxel: vec3u) -> vec3f {
    return vec3f(
        half_difference(voxel, vec3u(1u, 0u, 0u), voxel.x, frame.dims.x, frame.gradient.x),
        half_difference(voxel, vec3u(0u, 1u, 0u), voxel.y, frame.dims.y, frame.gradient.y),
        half_difference(voxel, vec3u(0u, 0u, 1u), voxel.z, frame.dims.z, frame.gradient.z),
    );
}

// A gradient given by its half, value per `unit`.
fn gradient_of(g: vec3f) -> Gradient {
    // Scaled first, because squares leave the range of f32 long before the gradient does: by a power of two, as GPUs divide by at most 2¹²⁶. The largest
    // component comes to lie between 2 and 4.
    let largest = max(max(abs(g.x), abs(g.y)), abs(g.z));
    let exponent = max(bitcast<u32>(largest) & 0x7f800000u, 0x800000u);
    let scale = bitcast<f32>(exponent - 0x800000u);
    let direction = g * bitcast<f32>(0x7f800000u - exponent);
    let size = length(direction);
    // Multiplied in this order, the product leaves the range of f32 only if the magnitude does.
    let magnitude = (scale * frame.per_unit) * (2.0 * size * frame.per_unit);
    if magnitude < frame.gradient.w {
        return Gradient(vec3f(0.0), 0.0);
    }
    return Gradient(-direction / size, magnitude);
}
