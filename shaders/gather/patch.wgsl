// A patch of the tile rasterizer, drawn front to back: the loop over its groups, and the rounds in which a subgroup visits its pixels. The stage's
// own file defines what a voxel adds to sheets and how they are composited.
//
// #import gather/barrier
// #import gather/group
// #import gather/lanes
// #import gather/pixels
// #import gather/queue
// #import gather/ramps
// #import gather/reach
// #import gather/region
// #import gather/stage
// #import gather/state
// #import gather/voxels
// #import gather/walk
// #import shared/brick
// #import shared/cut
// #import shared/frame

// The outcome of a group: whether the queue held all of its voxels at once, and whether it had any.
struct GroupOutcome {
    is_whole: bool,
    has_drawn: bool,
}

// Finds the open pixels of the threads from `threads.x` to the one before `threads.y`. Returns a mask of their halves of blocks.
fn find_open_pixels(corner: vec2u, threads: vec2u, thread: u32) -> u32 {
    var own_halves = 0u;
    for (var round = threads.x; round < threads.y; round += THREADS) {
        let pixels = pixels_of(corner, round + thread);
        find_stretches(pixels.column, pixels.rows);
        let opacity = transpose(load_image(pixels))[3];
        own_halves |= halves_of(pixels.thread);
        open = with_blocks(open, pixels.thread, open_word(pixels, opacity, -FAR));
        shallow = shallow_after(shallow, pixels, opacity);
        find_handed_on(pixels);
    }
    return own_halves;
}

// Makes the `at`-th group in compositing order the current one.
fn begin_group(at: u32) {
    let number = select(gather.groups - 1u - at, at, ORDER == FRONT_TO_BACK);
    let first_sheet = f32(number * SHEETS);
    let near = gather.near + first_sheet * frame.slab_width;
    sheet_group = GatheredGroup(number, first_sheet, near, half_boxes[number]);
}

// Adds the sections of the queue's voxels to the sheets of all pixels, round by round. After the last voxels of the group (`is_last`) the sheets
// are composited; before, they wait in workgroup memory.
fn draw_queue(corner: vec2u, threads: vec2u, thread: u32, is_last: bool, progress: ptr<function, Progress>) {
    for (var round = threads.x; round < threads.y; round += THREADS) {
        passes += PASSES_PER_ROUND;
        let pixels = pixels_of(corner, round + thread);
        let blocks = united(1u << pixels.block);
        let halves = halves_of(pixels.thread);
        var has_begun = ((*progress).begun & halves) != 0u;
        var sheets = Sheets();
        for (; has_begun; has_begun = false) {
            sheets = saved_sheets(round + thread);
        }
        let is_added = add_sections(&sheets, pixels, blocks);
        if is_added {
            (*progress).begun |= halves;
        }
        for (var is_left = is_added && !is_last; is_left; is_left = false) {
            save_sheets(round + thread, sheets);
        }
        let is_due = is_last && (((*progress).begun & halves) != 0u || is_due_without_voxels(halves));
        for (var is_done = is_due; is_done; is_done = false) {
            composite_pixels(pixels, sheets, progress);
        }
    }
}

// Draws a layer of the group: finds voxels, shades those of the queue from the `first`-th on, and adds their sections, once for every filling of the queue.
fn draw_layer(corner: vec2u, threads: vec2u, thread: u32, first: u32, is_kept: bool) -> GroupOutcome {
    let search = search_bounds(is_kept);
    var progress = Progress(open, shallow, 0u);
    var outcome = GroupOutcome(true, draws_all_groups());
    var first_new = first;
    loop {
        passes += PASSES_PER_FILL;
        find_voxels(search, is_kept);
        meet();
        shade_voxels(first_new);
        meet();
        let is_last = is_walked();
        outcome.has_drawn |= queue_count > 0u;
        draw_queue(corner, threads, thread, is_last, &progress);
        meet();
        if is_last {
            break;
        }
        outcome.is_whole = false;
        queue_count = 0u;
        first_new = 0u;
    }
    open = progress.open;
    shallow = progress.shallow;
    return outcome;
}

// Counts the `at`-th group as composited in the 32×32 tile of a pixel, once for all of the tile's patches.
fn count_composited(at: u32, pixel: vec2u) {
    let tiles = tile_grid(frame.size);
    let number = (at * tiles.y + pixel.y / TILE) * tiles.x + pixel.x / TILE;
    let bit = 1u << (number % 32u);
    if (atomicOr(&gathered.words[gather.composited + number / 32u], bit) & bit) == 0u {
        atomicAdd(&gathered.words[at], 1u);
    }
}

// Stores the group at which the next dispatch continues, and adds the subgroup's counts to the frame's.
fn finish(at: u32, reached: u32) {
    let all_counts = sums_of_lanes(drawn);
    if lane == 0u {
        // Where all pixels are opaque nothing is left to do.
        let is_done = at == gather.groups || all(open == vec4u(0u));
        atomicStore(&gathered.words[reached], select(at, gather.groups, is_done));
        if !is_done {
            next = indirect((patch_range.end_patch - patch_range.first_patch) * WORKGROUPS_PER_PATCH);
        }
        atomicAdd(&gathered.tally.voxels_shaded, all_counts.x);
        atomicAdd(&gathered.tally.sections_rasterized, all_counts.y);
        atomicAdd(&gathered.tally.bricks_visited, bricks_visited);
    }
}

// Draws a group's layers, given by its patch and its place in compositing order. Voxels are found once for all layers, if the queue has room for them; if not, each
// layer after the first finds its own.
fn draw_group(corner: vec2u, threads: vec2u, thread: u32, place: vec2u, is_kept: bool) -> GroupOutcome {
    if !is_kept {
        queue_count = 0u;
    }
    keep_voxels();
    let bin = place.x * gather.groups + place.y;
    var all = GroupOutcome(true, false);
    for (var layer = 0u; layer < layers(); layer += 1u) {
        begin_layer(layer);
        let is_found = layer > 0u && all.is_whole;
        if layer > 0u && !is_found {
            queue_count = 0u;
        }
        if !is_found {
            walk(bins[bin], bins[bin + 1u], select(layer_bit(layer), LAYER_BITS, layer == 0u));
        }
        // Voxels have amounts of their own in each layer.
        let first = select(0u, queue_count, layers() == 1u);
        let outcome = draw_layer(corner, threads, thread, first, is_kept && (layer == 0u || is_found));
        all = GroupOutcome(all.is_whole && outcome.is_whole, all.has_drawn || outcome.has_drawn);
    }
    return all;
}

// The number of bricks that some groups of a patch visit.
fn brick_count(patch_number: u32, first: u32, end: u32) -> u32 {
    let bin = patch_number * gather.groups;
    return bins[bin + end] - bins[bin + first];
}

// The number of patches along a row.
fn patch_columns() -> u32 {
    return (frame.size.x + PATCH_WIDTH - 1u) / PATCH_WIDTH;
}

// Draws a patch's groups in compositing order, from where the previous dispatch stopped, until all pixels are opaque.
fn draw(number: u32, first_thread: u32, thread: u32) {
    hold_ramps();
    let columns = patch_columns();
    let corner = vec2u(number % columns, number / columns) * vec2u(PATCH_WIDTH, PATCH_HEIGHT);
    first_px = vec2f(corner) + 0.5;
    empty_queue(thread);
    let threads = vec2u(first_thread, first_thread + PATCH_THREADS / WORKGROUPS_PER_PATCH);
    let own_halves = find_open_pixels(corner, threads, thread);

    let reached = gather.reached + number * HALVES + firstTrailingBit(own_halves);
    var at = atomicLoad(&gathered.words[reached]);
    // Whether the queue holds all voxels of the previous group.
    var is_kept = false;
    for (; at < gather.groups && any(open != vec4u(0u)); at += 1u) {
        let count = brick_count(number, at, at + 1u);
        // A driver may end long loops, so work that would need too many passes is left to the next dispatch.
        if passes + gather.passes_per_group + count * gather.passes_per_brick > gather.most_passes {
            break;
        }
        passes += PASSES_PER_GROUP + 4u * (layers() - 1u);
        if count == 0u && !counts_gaps() {
            is_kept = false;
            continue;
        }
        begin_group(at);
        let outcome = draw_group(corner, threads, thread, vec2u(number, at), is_kept);
        is_kept = outcome.is_whole && !may_appear();
        for (var has_drawn = outcome.has_drawn; has_drawn; has_drawn = false) {
            if lane == 0u {
                count_composited(at, corner);
            }
        }
    }
    finish(at, reached);
}

// The patch of the range that a workgroup draws, counted from the first. A software driver gives each thread one stretch of all workgroups, so that rows of
// patches far from each other follow one another, and every stretch has about as much to draw.
fn interleaved(at: u32) -> u32 {
    let columns = patch_columns();
    let rows = (patch_range.end_patch - patch_range.first_patch) / columns;
    return at / columns * patch_range.row_step % rows * columns + at % columns;
}

// Draws what a workgroup has to draw of its patch.
fn draw_of_workgroup(workgroup: vec3u, thread: u32) {
    start(workgroup.z);
    gather = gathers[zero];
    let at_workgroup = unfold(workgroup);
    let at_patch = at_workgroup / WORKGROUPS_PER_PATCH;
    let number = patch_range.first_patch + interleaved(at_patch);
    let first_thread = at_workgroup % WORKGROUPS_PER_PATCH * (PATCH_THREADS / WORKGROUPS_PER_PATCH);
    let half = firstTrailingBit(halves_of(first_thread + thread));
    var is_left = false;
    if at_patch < patch_range.end_patch - patch_range.first_patch {
        let at = atomicLoad(&gathered.words[gather.reached + number * HALVES + half]);
        // Some modes count empty groups too, even behind the last brick of the patch.
        let first = select(at, 0u, draws_all_groups() && at < gather.groups);
        is_left = brick_count(number, first, gather.groups) > 0u;
    }
    for (; is_left; is_left = false) {
        draw(number, first_thread, thread);
    }
}
