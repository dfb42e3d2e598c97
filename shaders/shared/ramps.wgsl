// The control points of all ramps, searched in memory, and the ramps of a voxel (SPEC §3). `labels` is a texture array that `gpu::volume_texture`
// folds, of the labels of all segmented channels.
// The stage declares `control_points` and `labels`.
//
// #import shared/frame
// #import shared/shading
// #import shared/texels

// Whether any label has its own ramps.
override LABELS: bool = false;

// The number of entries of each channel in the table of channels; `gpu::ramps` documents them.
const CHANNEL_ENTRIES = 3u;

// The start of a voxel's ramps in a channel, and the ends of those for colour, opacity and gradient opacity.
fn ramps_of(channel: u32, index: u32) -> vec4u {
    if !LABELS && channel == 0u {
        return vec4u(0u, frame.ramps.xyz);
    }
    let entry = frame.channel_table + CHANNEL_ENTRIES * channel;
    if LABELS {
        // The start of the channel's table of labels, its last entry, and the channel's number among the segmented ones, from 1.
        let labelled = vec3u(control_points[entry + 1u].xyz);
        if labelled.z != 0u {
            let texel = texel_of((labelled.z - 1u) * voxel_count() + index, textureDimensions(labels).x);
            let label = textureLoad(labels, texel.xy, texel.z, 0).x;
            return vec4u(control_points[labelled.x + min(label, labelled.y)]);
        }
    }
    return vec4u(control_points[entry]);
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
