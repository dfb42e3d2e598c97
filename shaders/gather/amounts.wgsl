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
    read_channel(0u);
    let first = shaded_first(voxel, p);
    var channels = with_channel(ChannelSum(), first.amount);
    var alpha = first.alpha;
    for (var channel = 1u; channel < CHANNELS; channel += 1u) {
        read_channel(channel);
        let later = shaded_later(voxel, channel, p);
        channels = with_channel(channels, later.amount);
        alpha += later.alpha;
    }
    return Shaded(total(channels), alpha);
}

// In a channel after the first.
fn shaded_later(voxel: vec3u, channel: u32, p: vec4f) -> Shaded {
    let index = index_of(voxel);
    let ramps = ramps_of(channel, index);
    let stored = stored_at(index);
    let value = value_of(stored);
    let gradient = gradient_at(voxel);
    let own = own_color(channel, index, ramp(ramps.x, ramps.y, value));
    let alpha = ramp(ramps.y, ramps.z, value).x * ramp(ramps.z, ramps.w, gradient.magnitude).x;
    return of_opacity(own.rgb, select(alpha * own.a, 0.0, HOLES && is_hole(stored)), gradient, voxel, p);
}

fn of_opacity(color: vec3f, alpha: f32, gradient: Gradient, voxel: vec3u, p: vec4f) -> Shaded {
    let m = amount(alpha);
    return Shaded(vec4f(shade(color, gradient, voxel_lighting(voxel, p.xy, PERSPECTIVE), vec3f(voxel)) * m, m), alpha);
}

// In the first channel.
fn shaded_first(voxel: vec3u, p: vec4f) -> Shaded {
    let index = index_of(voxel);
    let stored = stored_at(index);
    let value = value_of(stored);
    let gradient = gradient_at(voxel);
    var ramps = vec4u(0u, frame.ramps.xyz);
    var color = vec3f(0.0);
    var alpha = 0.0;
    var is_searched = LABELS;
    if LABELS {
        ramps = ramps_of(0u, index);
    } else {
        color = ramp_at(color_ramp, value);
        alpha = ramp_at(opacity_ramp, value).x;
        // Without gradient opacity the ramp is a single point, which every lane holds.
        var by_gradient = gradient_opacity_ramp.own.y;
        for (var is_graded = ramps.w > ramps.z + 1u; is_graded; is_graded = false) {
            by_gradient = ramp_at(gradient_opacity_ramp, gradient.magnitude).x;
        }
        alpha *= by_gradient;
        is_searched = is_long(color_ramp) || is_long(opacity_ramp) || is_long(gradient_opacity_ramp);
    }
    for (; is_searched; is_searched = false) {
        color = ramp(ramps.x, ramps.y, value);
        alpha = ramp(ramps.y, ramps.z, value).x * ramp(ramps.z, ramps.w, gradient.magnitude).x;
    }
    let own = own_color(0u, index, color);
    return of_opacity(own.rgb, select(alpha * own.a, 0.0, HOLES && is_hole(stored)), gradient, voxel, p);
}
