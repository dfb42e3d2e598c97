// The voxels that a subgroup of the tile rasterizer draws in a sheet group: which of the previous ones stay, which are added, their shading, and
// their counts.
//
// #import gather/barrier
// #import gather/group
// #import gather/queue
// #import gather/reach
// #import gather/region
// #import gather/state
// #import gather/walk
// #import shared/brick
// #import shared/frame

// The extent of a kernel's sections in the group, relative to the kernel's: that of the section nearest to the kernel's centre.
fn extent_here(p: vec4f) -> f32 {
    if PERSPECTIVE || ECONOMIES {
        return 1.0;
    }
    let first = sheet_group.near + FIRST_PLANE * frame.slab_width;
    let far = sheet_group.near + f32(SHEETS) * frame.slab_width;
    let beside = max(max(first - p.z, p.z - far), 0.0) * frame.kernel_per_depth / frame.support;
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
    let least_reach = least_kernel_reach() - 2.0 * gather.depth_error;
    var depths = vec2f(sheet_group.near + FIRST_PLANE * frame.slab_width - reach, far + reach);
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
        let layers_in = layers_in_queue(slot);
        let amount = queue_amounts[slot];
        let color = queue_colors[min(slot, QUEUE_COLORS - 1u)];
        let p = vec4f(bitcast<vec3f>(point.xyz), 1.0);
        let sheets = overlapped_sheets(p);
        let is_in = i + lane < count && is_drawn_here(p, sheets);
        meet();
        let kept_slot = enqueue(is_in, point.w, p, blocks_here(p) | layers_in);
        if is_in {
            queue_amounts[kept_slot] = amount;
            if QUEUE_COLORS > 1u {
                queue_colors[kept_slot] = color;
            }
            // Where there are several layers, shading counts it in each.
            if layers() == 1u {
                count_drawn(point.w, p, sheets, false);
            }
        }
    }
}

// The bits of the layers of a voxel in the queue, if there are several.
fn layers_in_queue(slot: u32) -> u32 {
    return select(0u, queue_blocks[slot] & LAYER_BITS, layers() > 1u);
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
        let p = placed(found.at);
        let sheets = overlapped_sheets(p);
        let may_be_new = !is_start || first_group(sheets) == f32(sheet_group.number);
        let blocks = blocks_here(p) | select(0u, found.in_layers, layers() > 1u);
        _ = enqueue(lane < count && is_drawn_here(p, sheets) && may_be_new, found.voxel, p, blocks);
    }
}

// Whether a kernel reaches into the group and its box contains an open pixel.
fn is_drawn_here(p: vec4f, sheets: vec2f) -> bool {
    let here = sheets_here(sheets);
    return here.x < here.y && blocks_seen(open, screen_box(p), 1.0) != 0u;
}

// The blocks that a kernel's sections in the group reach.
fn blocks_here(p: vec4f) -> u32 {
    return blocks_seen(open, screen_box(p), extent_here(p));
}

// Counts a voxel that is drawn into the group in the current layer, and its sections there, unless another patch has counted it. A voxel drawn whole counts as one
// section.
fn count_drawn(voxel: u32, p: vec4f, sheets: vec2f, is_whole: bool) {
    // The group's index among those that the kernel reaches, counted from the nearest; a whole kernel is drawn once.
    let nth = select(sheet_group.number - u32(max(sheets.x, 0.0)) / SHEETS, 0u, is_whole);
    let word = (nth * layers() + current_layer()) * gather.bricks * 2u + voxel / 32u;
    let bit = 1u << (voxel % 32u);
    if (atomicOr(&gathered.words[gather.drawn + word], bit) & bit) != 0u {
        return;
    }
    let all = sections_here(p, sheets);
    let sections = select(all, min(all, 1u), is_whole);
    drawn += vec2u(select(0u, 1u, nth == 0u && sections > 0u), sections);
}
