// The control points of all ramps, searched in memory, and the ramps of a voxel (SPEC §3). The stage declares `control_points`, and `labels`, a
// texture array that `gpu::volume_texture` folds.

// Whether any label has its own ramps.
override LABELS: bool = false;

// The start of a voxel's ramps, and the ends of those for colour, opacity and gradient opacity.
fn ramps_of(index: u32) -> vec4u {
    if !LABELS {
        return vec4u(0u, frame.ramps.xyz);
    }
    let texel = texel_of(index, textureDimensions(labels).x);
    let label = textureLoad(labels, texel.xy, texel.z, 0).x;
    return vec4u(control_points[frame.ramps.w + min(label, frame.last_label)]);
}

// The same of a voxel in a channel after the first, which has no ramps of labels.
fn ramps_of_channel(channel: u32) -> vec4u {
    return vec4u(control_points[frame.channel_table + channel - 1u]);
}

// Piecewise linear between the control points first..end, clamped outside.
fn ramp(first: u32, end: u32, value: f32) -> vec3f {
    // The first control point above the value.
    var above = first;
    var last = end;
    while above < last {
        let middle = (above + last) / 2u;
        let is_at_or_below = control_points[middle].x <= value;
        above = select(above, middle + 1u, is_at_or_below);
        last = select(middle, last, is_at_or_below);
    }
    let a = control_points[max(above, first + 1u) - 1u];
    let b = control_points[min(above, end - 1u)];
    return between(a, b, value);
}
