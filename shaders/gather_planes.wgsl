// The tile rasterizer with classification after splatting (SPEC §9): a subgroup gathers values and gradients on the slab planes, and
// classifies, shades and composites the slabs between two planes at its pixels. Everything else is as in `gather.wgsl`.
//
// A group's sheets are the sums on its four far planes. Its near plane is the previous group's last plane, whose field pixels carry in memory. Each channel
// (SPEC §10) is a layer with bricks and sums of its own; the sheets of all are added up before they are composited.
//
// #import gather/bits
// #import gather/group
// #import gather/pixels
// #import gather/plane_reach
// #import gather/planes
// #import gather/queue
// #import gather/region
// #import gather/slabs
// #import gather/state
// #import gather/voxels
// #import shared/brick
// #import shared/channels
// #import shared/frame
// #import shared/number
// #import shared/planes
// #import shared/seen
// #import shared/splatted_color
// #import shared/texels
// #import shared/volume

// For every channel.
@group(0) @binding(15) var<uniform> planes_of: array<FieldPlanes, MOST_LAYERS>;
// The bits of every voxel's coefficient, a number; read only if `EXACT`.
@group(0) @binding(16) var coefficients: texture_2d_array<u32>;
// Those of the voxels' own, if they have any.
@group(0) @binding(17) var colors: texture_2d_array<u32>;
// See `shared/light`.
@group(0) @binding(19) var light_sheets: texture_3d<f32>;

// The maximum number of channels.
const MOST_LAYERS = 16u;

// Economies (§8) apply only to splatted colours.
fn shallow_after(words: vec4u, pixels: Pixels, opacity: vec4f) -> vec4u {
    return words;
}

fn begin_layer(layer: u32) {
    see_channel(layer);
    see_table();
    if layer == 0u {
        halves_handed_here = halves_handed_on;
        halves_handed_on = 0u;
        halves_with_sheets = 0u;
        sheets_of_layers = vec4u(0u);
    }
    // A constant index spares a gather.
    if CHANNELS == 1u {
        planes = planes_of[0];
    } else {
        planes = planes_of[layer];
    }
}

// Groups are drawn whose near plane has values.
fn counts_gaps() -> bool {
    return halves_handed_on != 0u;
}

fn draws_all_groups() -> bool {
    return false;
}

// The previous group may end on a plane whose values hold for the next slab, too; and with the last layer what any has shown is composited.
fn is_due_without_voxels(halves: u32) -> bool {
    let held = halves_handed_here | select(0u, halves_with_sheets, is_last_layer());
    return (held & halves) != 0u;
}

fn draws_front_to_back() -> bool {
    return true;
}

// Loads the layer's values and differences of the voxels of the queue from `first` on.
fn shade_voxels(first: u32) {
    for (var i = first; i < queue_count; i += lanes) {
        passes += PASSES_PER_LOAD;
        let is_in = i + lane < queue_count;
        let slot = queue_first + min(i + lane, queue_count - 1u);
        let voxel = queue_points[slot].w;
        let at = voxel_of(bricks[voxel / BRICK_VOXELS], voxel % BRICK_VOXELS);
        // A brick of several layers holds the voxels of each, of which some are holes in others.
        let is_hole_here = HOLES && CHANNELS > 1u && is_hole(stored_at(index_of(at)));
        let is_there = is_of_layer(queue_blocks[slot]) && !is_hole_here;
        let number = number_at(index_of(at));
        var gradient = vec3f(0.0);
        if !KERNEL_GRADIENT {
            gradient = half_differences(at) * (2.0 * planes.value_scale);
        }
        if is_in {
            queue_amounts[slot] = select(vec4f(0.0, 0.0, 0.0, NO_NUMBER), vec4f(gradient, number), is_there);
            if has_own_colors() {
                // The coefficients of a hole's colour are NaN.
                queue_colors[slot] = select(vec4f(0.0), splatted_color(planes.colors, index_of(at)), is_there);
            }
            let p = placed(at);
            if is_there {
                count_drawn(voxel, p, overlapped_sheets(p), false);
            }
        }
    }
}

// Adds the queue's voxels that some blocks see to the sums of a thread's pixels in them. Returns whether there were any.
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
            let amount = queue_amounts[slot];
            let is_there = i + lane < seen_count && (CHANNELS == 1u || amount.w != NO_NUMBER);
            var own = kernel_at(bitcast<vec4f>(queue_points[slot]), amount, is_there);
            if OWN_COLORS {
                own.color = queue_colors[select(0u, slot, has_own_colors())];
            }
            hold_kernel(own);
            // Every lane adds all voxels at its own pixels, two at a time.
            let count = min(seen_count - i, lanes);
            passes += PASSES_PER_ADDITION + (count + 1u) / 2u;
            for (var j = 0u; j < count; j += 2u) {
                let a = kernel_of(own, j);
                let b = kernel_of(own, j + 1u);
                var at_a = in_plane(a, pixels, 0u);
                var at_b = in_plane(b, pixels, 0u);
                (*sheets).first = with_voxel(with_voxel((*sheets).first, a, at_a, 0u), b, at_b, 0u);
                if PERSPECTIVE {
                    at_a = in_plane(a, pixels, 1u);
                    at_b = in_plane(b, pixels, 1u);
                }
                (*sheets).second = with_voxel(with_voxel((*sheets).second, a, at_a, 1u), b, at_b, 1u);
                if PERSPECTIVE {
                    at_a = in_plane(a, pixels, 2u);
                    at_b = in_plane(b, pixels, 2u);
                }
                (*sheets).third = with_voxel(with_voxel((*sheets).third, a, at_a, 2u), b, at_b, 2u);
                if PERSPECTIVE {
                    at_a = in_plane(a, pixels, 3u);
                    at_b = in_plane(b, pixels, 3u);
                }
                (*sheets).fourth = with_voxel(with_voxel((*sheets).fourth, a, at_a, 3u), b, at_b, 3u);
            }
        }
    }
    return is_added;
}

// Adds the layer's slabs in front of the four planes, whose sums are complete, to the group's; after the last layer they are composited.
fn composite_pixels(pixels: Pixels, sheets: Sheets, progress: ptr<function, Progress>) {
    passes += PASSES_PER_LOOK + PASSES_PER_SLABS + select(0u, PASSES_PER_SUMS, CHANNELS > 1u);
    find_stretches(pixels.column, pixels.rows);
    if FIRST_HIT {
        load_hits(pixels);
    }
    let image = composite_slabs(load_image(pixels), sheets, pixels);
    for (var is_last = is_last_layer(); is_last; is_last = false) {
        store_image(pixels, image);
        if FIRST_HIT {
            store_hits(pixels);
        }
        let opacity = transpose(image)[3];
        let far = sheet_group.near + f32(SHEETS) * frame.slab_width;
        (*progress).open = with_blocks((*progress).open, pixels.thread, open_word(pixels, opacity, far));
    }
}

// Passes to load the values of one voxel per lane.
const PASSES_PER_LOAD = 2u;

// Passes to classify, shade and composite four slabs at four pixels.
const PASSES_PER_SLABS = 200u;

// Passes to add their sheets to those of other layers.
const PASSES_PER_SUMS = 64u;
