// The tile rasterizer: draws patches front to back without sheet buffers in memory. A subgroup keeps the sheets of a group for its
// pixels in registers, gathers the kernel sections that fall on them (§3.2), composites them (eq. 2), and skips what lies behind
// its opaque pixels (§6). Subgroups share nothing, so barriers are among a subgroup's threads, and the order of sums is fixed.
//
// Threads hold four pixels each, one below the other, in blocks of 8×4 pixels. A patch has four blocks; a subgroup of 4 to 32 threads draws half of
// one, one, two or all of them at a time, in rounds. What it knows about voxels serves all rounds.
//
// One-shot loops: software drivers execute both sides of an `if` under a mask, but skip a loop without iterations. Work that is often skipped
// therefore stands in `for (var x = condition; x; x = false)`, a loop that runs at most once.
//
// #import gather/bits
// #import gather/economies
// #import gather/group
// #import gather/kernel
// #import gather/pixels
// #import gather/queue
// #import gather/region
// #import gather/sheets
// #import gather/state
// #import shared/frame
// #import shared/means

// Those of the voxels' own, if they have any.
@group(0) @binding(15) var colors: texture_2d_array<u32>;
// The gradients of the membership of labels.
@group(0) @binding(16) var membership: texture_2d_array<u32>;
// See `shared/light`.
@group(0) @binding(19) var light_sheets: texture_3d<f32>;

fn begin_layer(layer: u32) {}

// Nothing is handed on from group to group.
fn find_handed_on(pixels: Pixels) {}

// Whether groups without voxels are composited too.
fn counts_gaps() -> bool {
    return COMPOSITING == MINIMUM || COMPOSITING == SURFACE;
}

// Whether all of them are, even behind the last brick of a patch.
fn draws_all_groups() -> bool {
    return COMPOSITING == MINIMUM;
}

fn is_due_without_voxels(halves: u32) -> bool {
    return counts_gaps();
}

// Adds the sections of the queue's voxels that some blocks see to the sheets of a thread's pixels in them. Returns whether there were any.
fn add_sections(sheets: ptr<function, Sheets>, pixels: Pixels, blocks: u32) -> bool {
    var is_added = false;
    for (var base = 0u; base < queue_count; base += BATCH) {
        passes += PASSES_PER_BATCH;
        let seen = seen_in_batch(blocks, base);
        let ones = countOneBits(seen);
        let seen_count = ones.x + ones.y;
        is_added |= seen_count > 0u;
        for (var i = 0u; i < seen_count; i += lanes) {
            let slot = queue_first + base + nth_set_bit(seen, min(i + lane, seen_count - 1u));
            let amount = select(vec4f(0.0), queue_amounts[slot], i + lane < seen_count);
            let whole = whole_sheet(queue_blocks[slot]);
            let own = footprint_at(bitcast<vec4f>(queue_points[slot]), sheet_group.near, whole, amount);
            hold_footprint(own);
            // Every lane adds the sections of all voxels at its own pixels, two voxels at a time.
            let count = min(seen_count - i, lanes);
            passes += PASSES_PER_ADDITION + (count + 1u) / 2u;
            for (var j = 0u; j < count; j += 2u) {
                let a = footprint_of(own, j);
                let b = footprint_of(own, j + 1u);
                let at_a = offsets_in(a, pixels.column, pixels.rows);
                let at_b = offsets_in(b, pixels.column, pixels.rows);
                var of_a = chords(a, at_a, 0u);
                var of_b = chords(b, at_b, 0u);
                (*sheets).first += added(section(a.first_plane, a.planes.x, of_a), a.amount)
                    + added(section(b.first_plane, b.planes.x, of_b), b.amount);
                if PERSPECTIVE {
                    of_a = chords(a, at_a, 1u);
                    of_b = chords(b, at_b, 1u);
                }
                (*sheets).second += added(section(a.planes.x, a.planes.y, of_a), a.amount)
                    + added(section(b.planes.x, b.planes.y, of_b), b.amount);
                if PERSPECTIVE {
                    of_a = chords(a, at_a, 2u);
                    of_b = chords(b, at_b, 2u);
                }
                (*sheets).third += added(section(a.planes.y, a.planes.z, of_a), a.amount)
                    + added(section(b.planes.y, b.planes.z, of_b), b.amount);
                if PERSPECTIVE {
                    of_a = chords(a, at_a, 3u);
                    of_b = chords(b, at_b, 3u);
                }
                (*sheets).fourth += added(section(a.planes.z, a.planes.w, of_a), a.amount)
                    + added(section(b.planes.z, b.planes.w, of_b), b.amount);
            }
        }
    }
    return is_added;
}

// Passes to composite a group's sheets.
const PASSES_PER_SHEETS = 6u;

// Composites a thread's complete sheets into its pixels.
fn composite_pixels(pixels: Pixels, sheets: Sheets, progress: ptr<function, Progress>) {
    passes += PASSES_PER_SHEETS + select(0u, PASSES_PER_LOOK, CUT || is_by_means());
    find_stretches(pixels.column, pixels.rows);
    if FIRST_HIT {
        load_hits(pixels);
    }
    let image = composite_group(load_image(pixels), sheets, sheet_group.near);
    store_image(pixels, image);
    if FIRST_HIT {
        store_hits(pixels);
    }
    let opacity = transpose(image)[3];
    let far = sheet_group.near + f32(SHEETS) * frame.slab_width;
    (*progress).open = with_blocks((*progress).open, pixels.thread, open_word(pixels, opacity, far));
    (*progress).shallow = shallow_after((*progress).shallow, pixels, opacity);
}
