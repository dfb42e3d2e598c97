// The first point between two samples of a pixel's ray at which `opacity·gradient_opacity` reaches one half (SPEC §9, `surface`). Values and
// gradients run linearly between the samples.
// The stage declares `control_points`.
//
// #import shared/cells
// #import shared/cut
// #import shared/ramps
// #import shared/seen
// #import shared/slab_integral
// #import shared/texels

// The share of the way that stands for no surface.
const NO_SURFACE = 2.0;

// The number of segments of a slab, along each of which numbers run linearly: 2 by the cubic profile.
override SEGMENTS: u32 = 1u;

// The number of points tested in a cell, over which the opacity is linear, if the gradient's opacity is not constant: segments share them.
const SAMPLES = 32u;

// The number of bisections between two tested points; more would not change an f32.
const F32_HALVINGS = 24u;

// The opacity at a number in a cell of the table, given by the cell's first entry.
fn opacity_in(cell: vec4f, x: f32) -> f32 {
    return cell.z + cell.w * clamp((x - cell.x) * cell.y, 0.0, 1.0);
}

// Whether the point at this share of the way, whose number is in a cell, is at least half opaque. `alpha` is a factor of its opacity.
fn is_half_opaque(cell: vec4f, x: f32, near: vec4f, far: vec4f, alpha: f32, share: f32, table: Table) -> bool {
    let opacity = opacity_in(cell, x) * alpha;
    return opacity >= 0.5 && opacity * gradient_opacity(table, gradient_between(near, far, share)) >= 0.5;
}

// The share of the way from one sample to the other at which the surface is, if it is between two shares and one transfer function applies there. `alpha` is
// a factor of opacities.
fn surface_between(near: vec4f, far: vec4f, alpha: f32, start: f32, end: f32, table: Table) -> f32 {
    let head = table.head;
    let domain = table.domain;
    let first = clamp(mix(near.x, far.x, start), domain.x, domain.z);
    let last = clamp(mix(near.x, far.x, end), domain.x, domain.z);
    // The table's head holds the range of numbers with an opacity, of linear slabs those that are at least half opaque.
    if max(first, last) < head.z || min(first, last) > head.w {
        return NO_SURFACE;
    }
    let cells = cells_of(table);
    let samples = select(SAMPLES / SEGMENTS, 1u, table.ramps.w - table.ramps.z <= 1u);
    let size = last - first;
    let is_rising = size >= 0.0;
    let last_cell = cell_of(table, last);
    for (var at = cell_of(table, first); ; at = select(at - 1u, at + 1u, is_rising)) {
        let cell = control_points[cells + CELL * at];
        let cell_end = control_points[cells + CELL * at + 1u].w;
        let enters = clamp(first, cell.x, cell_end);
        let leaves = clamp(last, cell.x, cell_end);
        if max(opacity_in(cell, enters), opacity_in(cell, leaves)) >= 0.5 {
            let enter = mix(start, end, select(0.0, (enters - first) / size, size != 0.0));
            let leave = mix(start, end, select(1.0, (leaves - first) / size, size != 0.0));
            var below = 0.0;
            for (var i = 0u; i <= samples; i += 1u) {
                var above = f32(i) / f32(samples);
                if is_half_opaque(cell, mix(enters, leaves, above), near, far, alpha, mix(enter, leave, above), table) {
                    for (var halving = 0u; halving < F32_HALVINGS; halving += 1u) {
                        let middle = 0.5 * (below + above);
                        let number = mix(enters, leaves, middle);
                        if is_half_opaque(cell, number, near, far, alpha, mix(enter, leave, middle), table) {
                            above = middle;
                        } else {
                            below = middle;
                        }
                    }
                    return mix(enter, leave, above);
                }
                below = above;
            }
        }
        if at == last_cell {
            return NO_SURFACE;
        }
    }
    return NO_SURFACE;
}

// A surface between two samples, and the transfer function there.
struct Surface {
    share: f32,
    table: Table,
}

// The same where each voxel has its own ramps: the way is split at the borders of voxels' cells. `first` and `last` are the samples' points, in
// voxels. Many surfaces lie on a border, where rounding would decide whose ramps hold, so the ramps are returned, too.
fn surface_in_cells(near: vec4f, far: vec4f, alpha: f32, start: f32, end: f32, first: vec3f, last: vec3f) -> Surface {
    var found = Surface(NO_SURFACE, Table());
    let way = last - first;
    var share = start;
    while share < end {
        let place = mix(first, last, share) + 0.5;
        let border = select(ceil(place) - 1.0, floor(place) + 1.0, way >= vec3f(0.0));
        let steps = select(vec3f(FAR), (border - place) / way, way != vec3f(0.0));
        // A border that rounding has not quite passed must not hold the ray up.
        let next = min(max(share + min(min(steps.x, steps.y), steps.z), share + 1e-6), end);
        let ramps = ramps_of(seen_channel.number, index_of(nearest_voxel(mix(first, last, 0.5 * (share + next)))));
        found.table = table_of(ramps);
        found.share = surface_between(near, far, alpha, share, next, found.table);
        if found.share != NO_SURFACE {
            return found;
        }
        share = next;
    }
    return found;
}
