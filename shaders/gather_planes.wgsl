// The tile rasterizer where classification comes after splatting (SPEC §9): as `gather.wgsl`, but a subgroup gathers values and gradients
// on the slab planes, and classifies, shades and composites what its pixels see between two planes.
//
// A group's sheets are the sums on its four far planes. Its near plane is the group before's last, whose field is handed on. A dispatch that goes
// on where another one has stopped looks at the group before once more, to have that.

const FIRST_PLANE = 1.0;
const GROUPS_LOOKED_BACK = 1u;

fn counts_gaps() -> bool {
    return false;
}

// The group before may end on a plane whose values hold for the next slab, too.
fn is_due_without_voxels(blocks: u32) -> bool {
    return (blocks_handed_on & blocks) != 0u;
}

// Whether pixels look along their rays.
fn looks_along_rays() -> bool {
    return true;
}

// Where a voxel is seen.
fn placed(voxel: vec3u) -> vec4f {
    return project(voxel);
}

// The frame's sheets from the first whose far plane a kernel reaches to the one after the last.
fn overlapped_sheets(p: vec4f) -> vec2f {
    let sheets = (overlapped(p, gather.depth_error, PERSPECTIVE) - gather.near) / frame.slab_width;
    return vec2f(floor(sheets.x), ceil(sheets.y) - 1.0);
}

// The planes of a group that a voxel is gathered on.
fn sections_here(p: vec4f, sheets: vec2f) -> u32 {
    let here = sheets_here(sheets);
    return u32(here.y - here.x);
}

// Looks up the values and differences of the voxels in the queue from one on.
fn shade_voxels(first: u32) {
    for (var i = first; i < queue_count; i += lanes) {
        passes += PASSES_PER_SHADING;
        let is_in = i + lane < queue_count;
        let slot = queue_first + min(i + lane, queue_count - 1u);
        let voxel = queue_points[slot].w;
        let at = voxel_of(bricks[voxel / BRICK_VOXELS], voxel % BRICK_VOXELS);
        let number = (value_at(index_of(at)) - gather.number_base) * gather.number_scale;
        let differences = half_differences(at);
        if is_in {
            queue_amounts[slot] = vec4f(differences, number);
            let p = placed(at);
            count_drawn(voxel, p, overlapped_sheets(p), false);
        }
    }
}

// A voxel as the pixels see it.
struct PlaneKernel {
    center_px: vec2f,
    // The differences and the number, (d, c).
    amount: vec4f,
    // The Gaussian of the distances from the four planes, 0 without a voxel; and ρ² from which the kernel is 0 on each.
    weights: vec4f,
    cuts: vec4f,
}

fn kernel_at(point: vec4f, amount: vec4f, is_there: bool) -> PlaneKernel {
    let distances = (sheet_group.near - point.z + vec4f(1.0, 2.0, 3.0, 4.0) * frame.slab_width) * frame.kernel_per_depth;
    let squared = distances * distances;
    let weights = select(vec4f(0.0), exp2(squared * gather.metric.w), vec4<bool>(is_there));
    return PlaneKernel(point.xy, amount, weights, frame.support * frame.support - squared);
}

// What another lane holds.
fn kernel_of(own: PlaneKernel, other: u32) -> PlaneKernel {
    return PlaneKernel(
        subgroupShuffle(own.center_px, other),
        subgroupShuffle(own.amount, other),
        subgroupShuffle(own.weights, other),
        subgroupShuffle(own.cuts, other),
    );
}

// How a voxel's kernel lies on a plane at four pixels: ρ², and the Gaussian of it.
struct InPlane {
    rho_squared: vec4f,
    gaussian: vec4f,
}

fn in_plane(kernel: PlaneKernel, pixels: Pixels) -> InPlane {
    let dx = pixels.column - kernel.center_px.x;
    let dy = pixels.rows - kernel.center_px.y;
    let rho_squared = dy * (gather.metric.z * dy + gather.metric.y * dx) + gather.metric.x * dx * dx;
    return InPlane(rho_squared, exp2(rho_squared * gather.metric.w));
}

// The kernel on one of the planes.
fn cut_off(at: InPlane, weight: f32, cut: f32) -> vec4f {
    return select(vec4f(0.0), at.gaussian * weight, at.rho_squared < vec4f(cut));
}

// Adds the queue's voxels that some blocks see to the sums of a thread's pixels in them. Whether there are any.
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
            let own = kernel_at(bitcast<vec4f>(queue_points[slot]), queue_amounts[slot], i + lane < seen_count);
            // Every lane adds all voxels at its own pixels, two at a time.
            let count = min(seen_count - i, lanes);
            passes += PASSES_PER_ADDITION + (count + 1u) / 2u;
            for (var j = 0u; j < count; j += 2u) {
                let a = kernel_of(own, j);
                let b = kernel_of(own, j + 1u);
                let at_a = in_plane(a, pixels);
                let at_b = in_plane(b, pixels);
                (*sheets).first = with_voxel((*sheets).first, cut_off(at_a, a.weights.x, a.cuts.x), a.amount);
                (*sheets).first = with_voxel((*sheets).first, cut_off(at_b, b.weights.x, b.cuts.x), b.amount);
                (*sheets).second = with_voxel((*sheets).second, cut_off(at_a, a.weights.y, a.cuts.y), a.amount);
                (*sheets).second = with_voxel((*sheets).second, cut_off(at_b, b.weights.y, b.cuts.y), b.amount);
                (*sheets).third = with_voxel((*sheets).third, cut_off(at_a, a.weights.z, a.cuts.z), a.amount);
                (*sheets).third = with_voxel((*sheets).third, cut_off(at_b, b.weights.z, b.cuts.z), b.amount);
                (*sheets).fourth = with_voxel((*sheets).fourth, cut_off(at_a, a.weights.w, a.cuts.w), a.amount);
                (*sheets).fourth = with_voxel((*sheets).fourth, cut_off(at_b, b.weights.w, b.cuts.w), b.amount);
            }
        }
    }
    return is_added;
}

// Composites the slabs before the four planes of which the sums are whole now.
fn composite_pixels(pixels: Pixels, sheets: Sheets, progress: ptr<function, Progress>) {
    passes += passes_per_look() + PASSES_PER_SLABS;
    look(pixels.column, pixels.rows);
    if FIRST_HIT {
        load_hits(pixels);
    }
    let image = composite_slabs(load_image(pixels), sheets, pixels);
    store_image(pixels, image);
    if FIRST_HIT {
        store_hits(pixels);
    }
    let opacity = transpose(image)[3];
    let far = sheet_group.near + f32(SHEETS) * frame.slab_width;
    (*progress).open = with_blocks((*progress).open, pixels.block, open_word(pixels, opacity, far));
}

// Passes to classify, shade and composite four slabs at four pixels.
const PASSES_PER_SLABS = 80u;
