//! The passes through loops that a transfer function costs the tile rasterizer, which counts them ([`patch_bins`](crate::lists::patch_bins)).

use crate::rasterizer::request::{After, FrameRequest};

/// Before splatting those to look up a voxel's control points, where all ramps are searched in memory if any is, because threads hold at most one point each; after
/// splatting those to search tables in a slab, those of its halves, and those to find a surface.
pub(super) fn of(request: &FrameRequest, by_label: bool) -> u32 {
    let lengths = request.ramps.lengths();
    if let Some(after) = &request.after {
        let is_surface = request.splatting.compositing.has_surface();
        return slab_passes(request) + if is_surface { surface_passes(request, after, by_label) } else { 0 };
    }
    let channels = request.ramps.channels;
    let in_memory = by_label || channels > 1 || lengths.iter().any(|&points| points > request.least_lanes);
    let searches = 1 + lengths.iter().map(|&points| of_search(points)).sum::<u32>();
    if in_memory { channels * (1 + searches) } else { 0 }
}

/// The passes of the loops of a slab's second half, and those to find whether the slab shows anything, without any search.
const PASSES_OF_HALVES: u32 = 16;

/// The passes of searches in a slab, and of its halves. An integral searches for two cells, and each stretch that is shown for the opacity of a gradient.
fn slab_passes(request: &FrameRequest) -> u32 {
    let segments = request.splatting.segments();
    let integrals = 2 * segments - 1;
    let [.., points] = request.ramps.lengths();
    let of_gradient = if points > 1 { 2 + of_search(points) } else { 0 };
    2 * integrals * request.ramps.search_steps() + segments * of_gradient + PASSES_OF_HALVES * (segments - 1)
}

/// The number of points that are tested for a surface in a cell of a table, but for one more: `SAMPLES` of `shaders/shared/first_surface.wgsl`.
const SAMPLES: u32 = 32;

/// The number of bisections between two of them: `F32_HALVINGS` there.
const HALVINGS: u32 = 24;

/// The maximum number of passes to find a surface in a slab.
fn surface_passes(request: &FrameRequest, after: &After, by_label: bool) -> u32 {
    let [.., points] = request.ramps.lengths();
    let is_graded = points > 1;
    // Every test may look up the gradient's opacity.
    let of_test = 1 + if is_graded { 3 + of_search(points) } else { 2 };
    let of_profile = request.splatting.segments();
    let tested = 1 + if is_graded { SAMPLES / of_profile } else { 1 };
    let cells = request.ramps.cells();
    let of_cells = |segments: u32| {
        segments * (cells * (4 + tested * of_test) + 2 * (2 + of_search(cells.max(1)))) + HALVINGS * of_test
    };
    if !by_label {
        return of_cells(of_profile);
    }
    // Where each voxel has its own table, the way through its cell is searched by itself, and so is each part of one that lies in two segments.
    let borders = after.planes.slab_step(&request.view).to_array().map(|step| step as u32 + 2);
    (borders.iter().sum::<u32>() + of_profile - 1).saturating_mul(1 + of_cells(1))
}

/// The passes through loops of a binary search among `points` control points.
fn of_search(points: u32) -> u32 {
    points.ilog2() + 2
}
