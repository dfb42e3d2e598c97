// The colours and amounts that the voxels in a subgroup's queue add to sheets, if they are classified and shaded before splatting (§3).
//
// #import gather/economies
// #import gather/queue
// #import gather/ramps
// #import gather/sheet_reach
// #import gather/state
// #import gather/voxels
// #import shared/brick
// #import shared/channels
// #import shared/frame
// #import shared/gradient
// #import shared/own_color
// #import shared/project
// #import shared/ramps
// #import shared/shading
// #import shared/texels
// #import shared/volume

// Shades the voxels of the queue from `first` on.
fn shade_voxels(first: u32) {
    for (var i = first; i < queue_count; i += lanes) {
        // Every lane shades its own voxel.
        passes += PASSES_PER_SHADING + gather.search_passes;
        let is_in = i + lane < queue_count;
        let slot = queue_first + min(i + lane, queue_count - 1u);
        let voxel = queue_points[slot].w;
        let at = voxel_of(bricks[voxel / BRICK_VOXELS], voxel % BRICK_VOXELS);
        let p = project(at);
        let shaded = shaded(at, p);
        let sheets = overlapped_sheets(p);
        let blocks = economic_blocks(queue_blocks[slot], shaded.amount, shaded.alpha, p, sheets);
        if is_in {
            queue_amounts[slot] = shaded.amount;
            queue_blocks[slot] = blocks;
            if PERSPECTIVE {
                queue_points[slot].w = bitcast<u32>(p.w);
            }
        }
        if is_in && is_worthwhile(blocks) {
            count_drawn(voxel, p, sheets, whole_sheet(blocks) >= 0.0);
        }
    }
}

// A voxel's colour and amount per unit length, `(C·m, m)`, and its opacity.
struct Shaded {
    amount: vec4f,
    alpha: f32,
}

// The sums over all channels (SPEC §10), in which a voxel's footprint is the same.
fn shaded(voxel: vec3u, p: vec4f) -> Shaded {
    var channels = ChannelSum();
    var alpha = 0.0;
    // One place for all channels, because much is compiled into it.
    for (var channel = select(zero, 0u, CHANNELS == 1u); channel < CHANNELS; channel += 1u) {
        read_channel(channel);
        let own = shaded_in(channel, voxel, p);
        channels = with_channel(channels, own.amount);
        alpha += own.alpha;
    }
    return Shaded(total(channels), alpha);
}

// In one channel.
fn shaded_in(channel: u32, voxel: vec3u, p: vec4f) -> Shaded {
    let index = index_of(voxel);
    let stored = stored_at(index);
    let value = value_of(stored);
    let gradient = gradient_at(voxel);
    let ramps = ramps_of(channel, index);
    var color = vec3f(0.0);
    var alpha = 0.0;
    // Lanes hold the first channel's ramps.
    let is_held = !LABELS && channel == 0u;
    for (var is_short = is_held; is_short; is_short = false) {
        color = ramp_at(color_ramp, value);
        // Without gradient opacity the ramp is a single point, which every lane holds.
        var by_gradient = gradient_opacity_ramp.own.y;
        for (var is_graded = ramps.w > ramps.z + 1u; is_graded; is_graded = false) {
            by_gradient = ramp_at(gradient_opacity_ramp, gradient.magnitude).x;
        }
        alpha = ramp_at(opacity_ramp, value).x * by_gradient;
    }
    let is_long = is_long(color_ramp) || is_long(opacity_ramp) || is_long(gradient_opacity_ramp);
    for (var is_searched = !is_held || is_long; is_searched; is_searched = false) {
        color = ramp(ramps.x, ramps.y, value);
        alpha = ramp(ramps.y, ramps.z, value).x * ramp(ramps.z, ramps.w, gradient.magnitude).x;
    }
    let own = own_color(channel, index, color);
    let opacity = select(alpha * own.a, 0.0, HOLES && is_hole(stored));
    let shaded = shade(own.rgb, gradient, voxel_lighting(voxel, p.xy, PERSPECTIVE), vec3f(voxel));
    return Shaded(vec4f(shaded, 1.0) * amount(opacity), opacity);
}
