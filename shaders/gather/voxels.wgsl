// The voxels that a subgroup of the tile rasterizer draws in a sheet group: which of the previous ones stay, which are added, their shading, and
// their counts.
//
// Needs gather.wgsl: ORDER, PARALLELOGRAM, PASSES_PER_FIND, PASSES_PER_SHADING, PERSPECTIVE, SHEETS, bricks, color_ramp, drawn, first_px, gather, gathered, gradient_opacity_ramp, lane, lanes, opacity_ramp, open, passes, sheet_group.
// Needs gather/economies.wgsl: ECONOMIES, economic_blocks, is_worthwhile, whole_sheet.
// Needs gather/kernel.wgsl: footprint_at.
// Needs gather/queue.wgsl: enqueue, queue_amounts, queue_blocks, queue_count, queue_first, queue_points, queue_size.
// Needs gather/ramps.wgsl: is_long, ramp_at.
// Needs gather/region.wgsl: blocks_in_box, blocks_in_parallelogram, bounds_of.
// Needs gather/walk.wgsl: Found, SearchBounds, next_voxels.
// Needs shared/brick.wgsl: BRICK_VOXELS, voxel_of.
// Needs shared/frame.wgsl: BOX_SLACK, FRONT_TO_BACK, frame.
// Needs shared/local_ray.wgsl: sections_on_screen.
// Needs shared/project.wgsl: overlapped, project.
// Needs shared/ramps.wgsl: LABELS, ramp, ramps_of.
// Needs shared/shading.wgsl: lighting, shade.
// Needs shared/volume.wgsl: gradient_at, index_of, value_at.

// A group of sheets: its number, its first sheet, the depth where that begins, and half the box around its footprints.
struct GatheredGroup {
    number: u32,
    first_sheet: f32,
    near: f32,
    half_box: vec2f,
}

// The range of the frame's sheets that a kernel overlaps, from the first to the one after the last.
fn overlapped_sheets(p: vec4f) -> vec2f {
    let sheets = (overlapped(p, gather.depth_error, PERSPECTIVE) - gather.near) / frame.slab_width;
    return vec2f(floor(sheets.x), ceil(sheets.y));
}

// The part of that range in the sheet group.
fn sheets_here(sheets: vec2f) -> vec2f {
    return clamp(sheets, vec2f(sheet_group.first_sheet), vec2f(sheet_group.first_sheet + f32(SHEETS)));
}

// The first group, in drawing order, that a kernel overlaps.
fn first_group(sheets: vec2f) -> f32 {
    let sheet = select(min(sheets.y, f32(gather.groups * SHEETS)) - 1.0, max(sheets.x, 0.0), ORDER == FRONT_TO_BACK);
    return floor(sheet / f32(SHEETS));
}

// A mask of the blocks in which the box around a footprint, scaled by `part`, contains a pixel of the mask.
fn blocks_seen(words: vec4u, center: vec2f, half_box: vec2f, part: f32) -> u32 {
    let half = half_box * part + BOX_SLACK;
    if PARALLELOGRAM {
        return blocks_in_parallelogram(words, center, half, gather.half_width * part + BOX_SLACK);
    }
    return blocks_in_box(words, center, half);
}

// The extent of a kernel's sections in the group, relative to the kernel's: that of the section nearest to the kernel's centre.
fn extent_here(p: vec4f) -> f32 {
    if PERSPECTIVE || ECONOMIES {
        return 1.0;
    }
    let far = sheet_group.near + f32(SHEETS) * frame.slab_width;
    let beside = max(max(sheet_group.near - p.z, p.z - far), 0.0) * frame.kernel_per_depth / frame.support;
    return sqrt(max(1.0 - beside * beside, 0.0));
}

// Whether a voxel that is not seen in one group may be seen in the next, because boxes around footprints have another size there.
fn may_appear() -> bool {
    return PERSPECTIVE || ECONOMIES;
}

// The bounds of voxels whose kernels reach the group, or start in it, and whose boxes reach open pixels.
fn search_bounds(is_start: bool) -> SearchBounds {
    let bounds = bounds_of(open);
    let offset = first_px - 0.5 * vec2f(frame.size);
    let margin = sheet_group.half_box + BOX_SLACK;
    let far = sheet_group.near + f32(SHEETS) * frame.slab_width;
    let reach = frame.reach + gather.depth_error;
    let least_reach = select(frame.reach, 0.0, frame.kernel_per_depth == 0.0) - 2.0 * gather.depth_error;
    var depths = vec2f(sheet_group.near - reach, far + reach);
    if is_start && ORDER == FRONT_TO_BACK {
        depths.x = sheet_group.near + least_reach;
    }
    if is_start && ORDER != FRONT_TO_BACK {
        depths.y = far - least_reach;
    }
    return SearchBounds(vec3f(bounds.low - margin + offset, depths.x), vec3f(bounds.high + margin + offset, depths.y));
}

// Keeps the previous group's voxels in the queue that reach into this group and are seen in it.
fn keep_voxels() {
    let count = queue_count;
    queue_count = 0u;
    for (var i = 0u; i < count; i += lanes) {
        passes += 1u;
        let slot = queue_first + min(i + lane, count - 1u);
        let point = queue_points[slot];
        let amount = queue_amounts[slot];
        let p = vec4f(bitcast<vec3f>(point.xyz), 1.0);
        let sheets = overlapped_sheets(p);
        let is_in = i + lane < count && is_drawn_here(p, sheets);
        subgroupBarrier();
        let kept_slot = enqueue(is_in, point.w, p, blocks_here(p));
        if is_in {
            queue_amounts[kept_slot] = amount;
            count_drawn(point.w, p, sheets, false);
        }
    }
}

// Fills the queue with voxels: all that reach into the group, or those that start in it.
fn find_voxels(search: SearchBounds, is_start: bool) {
    while queue_count + lanes <= queue_size {
        passes += PASSES_PER_FIND;
        var found: Found;
        let count = next_voxels(search, &found);
        if count == 0u {
            break;
        }
        let p = project(found.at);
        let sheets = overlapped_sheets(p);
        let may_be_new = !is_start || first_group(sheets) == f32(sheet_group.number);
        _ = enqueue(lane < count && is_drawn_here(p, sheets) && may_be_new, found.voxel, p, blocks_here(p));
    }
}

// Whether a kernel reaches into the group and its box contains an open pixel.
fn is_drawn_here(p: vec4f, sheets: vec2f) -> bool {
    let here = sheets_here(sheets);
    return here.x < here.y && blocks_seen(open, p.xy - first_px, sheet_group.half_box, 1.0) != 0u;
}

// The blocks that a kernel's sections in the group reach.
fn blocks_here(p: vec4f) -> u32 {
    return blocks_seen(open, p.xy - first_px, sheet_group.half_box, extent_here(p));
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

fn shaded(voxel: vec3u, p: vec4f) -> Shaded {
    let index = index_of(voxel);
    let value = value_at(index);
    let gradient = gradient_at(voxel);
    var ramps = vec4u(0u, frame.ramps.xyz);
    var color = vec3f(0.0);
    var alpha = 0.0;
    var is_searched = LABELS;
    if LABELS {
        ramps = ramps_of(index);
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
    let m = amount(alpha);
    color = shade(color, gradient, lighting(p.xy, PERSPECTIVE));
    return Shaded(vec4f(color * m, m), alpha);
}

// Counts a voxel that is drawn into the group, and its sections there, unless another patch has counted it. A voxel drawn whole counts as one
// section.
fn count_drawn(voxel: u32, p: vec4f, sheets: vec2f, is_whole: bool) {
    // The group's index among those that the kernel reaches, counted from the nearest; a whole kernel is drawn once.
    let nth = select(sheet_group.number - u32(max(sheets.x, 0.0)) / SHEETS, 0u, is_whole);
    let word = nth * gather.bricks * 2u + voxel / 32u;
    let bit = 1u << (voxel % 32u);
    if (atomicOr(&gathered.words[gather.drawn + word], bit) & bit) != 0u {
        return;
    }
    let here = sheets_here(sheets);
    var sections = u32(here.y - here.x);
    if PERSPECTIVE {
        let footprint = footprint_at(p, sheet_group.near, -1.0, vec4f(0.0));
        sections = sections_on_screen(p.xy, footprint.axis, footprint.maps, here - sheet_group.first_sheet);
    }
    sections = select(sections, min(sections, 1u), is_whole);
    drawn += vec2u(select(0u, 1u, nth == 0u && sections > 0u), sections);
}
