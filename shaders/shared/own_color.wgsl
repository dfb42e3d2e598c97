// The colours of voxels in channels of which some have colours of voxels' own (SPEC §10).
// The stage declares `control_points`.
//
// #import shared/colors
// #import shared/frame
// #import shared/ramps

// The colour and A of a voxel, given by its index, in a channel; a given colour and 1 if its voxels have none of their own.
fn own_color(channel: u32, index: u32, given: vec3f) -> vec4f {
    if FULL_COLOR == 0u {
        return vec4f(given, 1.0);
    }
    let place = u32(control_points[frame.channel_table + CHANNEL_ENTRIES * channel + 1u].w);
    if place == 0u {
        return vec4f(given, 1.0);
    }
    return stored_color(place, index);
}
