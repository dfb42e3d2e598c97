// The tile rasterizer with classification after splatting (SPEC §9): a subgroup gathers values and gradients on the slab planes, and
// classifies, shades and composites the slabs between two planes at its pixels. Everything else is as in `gather.wgsl`.
//
// A group's sheets are the sums on its four far planes. Its near plane is the previous group's last plane, whose field pixels carry in memory. Each channel
// (SPEC §10) is a layer with bricks and sums of its own; the sheets of all are added up before they are composited.

// What pixels carry from plane to plane; see `shared/slab`.
@group(0) @binding(5) var<storage, read_write> carried: array<vec4u>;
// For every channel.
@group(0) @binding(15) var<uniform> planes_of: array<FieldPlanes, MOST_LAYERS>;
// The bits of every voxel's coefficient, a number; read only if `EXACT`.
@group(0) @binding(16) var coefficients: texture_2d_array<u32>;
// Those of the voxels' own, if they have any.
@group(0) @binding(17) var colors: texture_2d_array<u32>;

// The maximum number of channels.
const MOST_LAYERS = 16u;

// The planes of the layer that is drawn.
var<private> planes: FieldPlanes;

// The first of a group's planes is one slab behind its near plane.
const FIRST_PLANE = 1.0;

// §8's economies apply only to splatted colours.
const ECONOMIES = false;
var<private> shallow: vec4u;

fn shallow_after(words: vec4u, pixels: Pixels, opacity: vec4f) -> vec4u {
    return words;
}

fn layers() -> u32 {
    return CHANNELS;
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

fn current_layer() -> u32 {
    return seen_channel.number;
}

// Whether the layer is the group's last one, with which its slabs are composited.
fn is_last_layer() -> bool {
    return seen_channel.number + 1u == CHANNELS;
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

// Rays end where they leave the box of voxel centres.
fn cuts_rays() -> bool {
    return true;
}

// Whether pixels look along their rays.
fn looks_along_rays() -> bool {
    return true;
}

// A voxel's place: pixels right of the image's middle and below it, both times the depth from the eye, and sheet depth.
fn placed(voxel: vec3u) -> vec4f {
    return homogeneous(vec4f(vec3f(voxel), 1.0));
}

// The screen box that a kernel reaches on the group's far planes. From the first plane to the last its nearest point moves in one direction.
fn screen_box(p: vec4f) -> ScreenBox {
    let middle = 0.5 * vec2f(frame.size) - first_px;
    if !PERSPECTIVE {
        return ScreenBox(p.xy + middle, sheet_group.half_box);
    }
    let first = on_plane(p.xy, p.z, sheet_group.near + frame.slab_width).center_px - first_px;
    let last = on_plane(p.xy, p.z, sheet_group.near + f32(SHEETS) * frame.slab_width).center_px - first_px;
    return ScreenBox(0.5 * (first + last), 0.5 * abs(last - first) + sheet_group.half_box);
}

// Whether a kernel may be seen on some plane of the group.
fn is_searched_in_perspective(search: SearchBounds, p: vec4f) -> bool {
    let middle = 0.5 * vec2f(frame.size);
    let first = on_plane(p.xy, p.z, sheet_group.near + frame.slab_width).center_px - middle;
    let last = on_plane(p.xy, p.z, sheet_group.near + f32(SHEETS) * frame.slab_width).center_px - middle;
    return all(max(first, last) >= search.low.xy) && all(min(first, last) <= search.high.xy)
        && p.z >= search.low.z && p.z <= search.high.z;
}

// The range of the frame's sheets whose far planes a kernel reaches, from the first to the one after the last.
fn overlapped_sheets(p: vec4f) -> vec2f {
    let reach = frame.support / planes.step.w - gather.depth_error;
    let sheets = (p.z + vec2f(-reach, reach) - gather.near) / frame.slab_width;
    return vec2f(floor(sheets.x), ceil(sheets.y) - 1.0);
}

// The planes of a group that a voxel is gathered on.
fn sections_here(p: vec4f, sheets: vec2f) -> u32 {
    let here = sheets_here(sheets);
    return u32(here.y - here.x);
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
    passes += passes_per_look() + PASSES_PER_SLABS + select(0u, PASSES_PER_SUMS, CHANNELS > 1u);
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
