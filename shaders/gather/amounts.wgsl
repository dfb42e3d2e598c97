// The colours and amounts that the voxels in a subgroup's queue add to sheets, if they are classified and shaded before splatting (§3).
//
// Needs gather/economies.wgsl: economic_blocks, is_worthwhile, whole_sheet.
// Needs gather/kernel.wgsl: footprint_at.
// Needs gather/patch.wgsl: PASSES_PER_SHADING, PERSPECTIVE, bricks, color_ramp, first_px, gather, gradient_opacity_ramp, lane, lanes, opacity_ramp, passes, sheet_group.
// Needs gather/queue.wgsl: queue_amounts, queue_blocks, queue_count, queue_first, queue_points.
// Needs gather/ramps.wgsl: is_long, ramp_at.
// Needs gather/voxels.wgsl: ScreenBox, count_drawn, sheets_here.
// Needs gather/walk.wgsl: SearchBounds.
// Needs shared/brick.wgsl: BRICK_VOXELS, voxel_of.
// Needs shared/channels.wgsl: CHANNELS, ChannelSum, total, with_channel.
// Needs shared/frame.wgsl: frame.
// Needs shared/local_ray.wgsl: sections_on_screen.
// Needs shared/own_color.wgsl: own_color.
// Needs shared/project.wgsl: overlapped, project.
// Needs shared/ramps.wgsl: LABELS, ramp, ramps_of.
// Needs shared/shading.wgsl: lighting, shade.
// Needs shared/texels.wgsl: index_of.
// Needs shared/volume.wgsl: Gradient, HOLES, gradient_at, is_hole, read_channel, stored_at, value_of.

// The range of the frame's sheets that a kernel overlaps, from the first to the one after the last.
fn overlapped_sheets(p: vec4f) -> vec2f {
    let sheets = (overlapped(p, gather.depth_error, PERSPECTIVE) - gather.near) / frame.slab_width;
    return vec2f(floor(sheets.x), ceil(sheets.y));
}

// The number of a kernel's sections in the group that are drawn.
fn sections_here(p: vec4f, sheets: vec2f) -> u32 {
    let here = sheets_here(sheets);
    if PERSPECTIVE {
        let footprint = footprint_at(p, sheet_group.near, -1.0, vec4f(0.0));
        return sections_on_screen(p.xy, footprint.axis, footprint.maps, here - sheet_group.first_sheet);
    }
    return u32(here.y - here.x);
}

// A voxel's projection.
fn placed(voxel: vec3u) -> vec4f {
    return project(voxel);
}

// The box around the footprint at a projection.
fn screen_box(p: vec4f) -> ScreenBox {
    return ScreenBox(p.xy - first_px, sheet_group.half_box);
}

// Whether a voxel's footprint may be seen on the screen, and its kernel reaches the group.
fn is_searched_in_perspective(search: SearchBounds, p: vec4f) -> bool {
    let is_on_screen = all(p.xy >= search.low.xy * p.w) && all(p.xy <= search.high.xy * p.w);
    return is_on_screen && p.z >= search.low.z && p.z <= search.high.z && p.w > frame.near;
}

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
        let blocks = economic_blocks(queue_blocks[slot], shaded, p, sheets);
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
        let further = shaded_further(voxel, channel, p);
        channels = with_channel(channels, further.amount);
        alpha += further.alpha;
    }
    return Shaded(total(channels), alpha);
}

// In a channel after the first.
fn shaded_further(voxel: vec3u, channel: u32, p: vec4f) -> Shaded {
    let index = index_of(voxel);
    let ramps = ramps_of(channel, index);
    let stored = stored_at(index);
    let value = value_of(stored);
    let gradient = gradient_at(voxel);
    let own = own_color(channel, index, ramp(ramps.x, ramps.y, value));
    let alpha = ramp(ramps.y, ramps.z, value).x * ramp(ramps.z, ramps.w, gradient.magnitude).x;
    return of_opacity(own.rgb, select(alpha * own.a, 0.0, HOLES && is_hole(stored)), gradient, p);
}

fn of_opacity(color: vec3f, alpha: f32, gradient: Gradient, p: vec4f) -> Shaded {
    let m = amount(alpha);
    return Shaded(vec4f(shade(color, gradient, lighting(p.xy, PERSPECTIVE)) * m, m), alpha);
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
    return of_opacity(own.rgb, select(alpha * own.a, 0.0, HOLES && is_hole(stored)), gradient, p);
}
