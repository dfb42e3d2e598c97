//! Kernel sections added to a tile's sheet buffers (SPEC §5), a row of eight pixels at a time and every section of a voxel for them; the same
//! sums as `shaders/splat.wgsl`. Each pixel's additions come in the order in which voxels do, whatever the vectors' width.

use fearless_simd::f32x8;
use fearless_simd::prelude::*;

use super::cull::{OpenMask, Pixels, columns_between};
use super::kernel::KernelTables;
use super::sheets::{Buffers, CHANNELS, COLUMNS, RING, SECTIONS, SheetRow, slot_of};
use super::vector::{LANES, iota};

/// A voxel in the coordinates of a tile.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Splat {
    /// Its pixel coordinates; the centre of the tile's first pixel is at 0, 0.
    pub(super) center: [f32; 2],
    /// `(C·m, m)` over λ, and the low-pass amplitude where it is the same for all sections.
    pub(super) amount: [f32; 4],
    /// The range of sheets still to be drawn, in the order of compositing.
    pub(super) sheets: [i32; 2],
    /// The distance from the voxel to the plane where that range begins, grid units along its ray.
    pub(super) first_plane: f32,
    /// The distance from plane to plane.
    pub(super) step: f32,
    /// The voxel: the index of its brick among those that have arrived, and its slot there.
    pub(super) voxel: [u32; 2],
    /// Sheets that have been drawn, in units of [`SECTIONS`].
    pub(super) drawn: u32,
    /// In perspective.
    pub(super) local: LocalFootprint,
}

/// How a kernel lies on the screen in perspective: as [`Local`](super::project::Local), in f32.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LocalFootprint {
    pub(super) axis: [f32; 2],
    pub(super) metric: [f32; 2],
    pub(super) depth_per_warped: f32,
    pub(super) from_eye: f32,
    pub(super) cut: f32,
}

/// The data that all splats of a frame share.
#[derive(Clone, Debug)]
pub(super) struct Splatter {
    pub(super) kernel: KernelTables,
    pub(super) radius: f32,
    /// Orthographic: ρ² of a pixel offset (dx, dy) is `x·dx² + y·dx·dy + z·dy²`.
    pub(super) metric: [f32; 3],
    /// Orthographic: half the box around footprints, pixels.
    pub(super) half_box: [f32; 2],
    /// In perspective the size of a pixel at depth 1, `unit`s.
    pub(super) pixel_per_depth: Option<f32>,
    /// True if sheets hold whole kernels, whose footprint is that at the voxel's depth.
    pub(super) is_whole: bool,
}

/// The sections of a splat in up to [`SECTIONS`] sheets.
pub(super) struct Sections {
    count: usize,
    /// `H(0, 0, t)` of eq. 3 at the planes between them.
    planes: [f32; LANES],
    /// In perspective ρ² of a pixel along the footprint's axis and across it, and the low-pass rule's amplitude, by section.
    along: [f32; LANES],
    across: [f32; LANES],
    amplitude: [f32; LANES],
    /// In perspective how far from the voxel's row each reaches, pixels.
    reach: [f32; LANES],
    /// The pixels that any of them reaches; `None` for no pixel of the tile.
    pub(super) pixels: Option<Pixels>,
}

impl Splatter {
    /// The sections to be drawn next.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn sections<S: Simd>(&self, simd: S, splat: &Splat) -> Sections {
        let count = ((splat.sheets[1] - splat.sheets[0]) as usize).min(SECTIONS);
        let mut t = iota(simd) * splat.step + splat.first_plane;
        let mut sections = Sections {
            count,
            planes: [0.0; LANES],
            along: [0.0; LANES],
            across: [0.0; LANES],
            amplitude: [0.0; LANES],
            reach: [0.0; LANES],
            pixels: None,
        };
        let mut half_box = self.half_box;
        if let Some(pixel_per_depth) = self.pixel_per_depth {
            let local = &splat.local;
            t = t.max(f32x8::splat(simd, local.cut));
            let radius = f32x8::splat(simd, self.radius);
            let within = t.max(-radius).min(radius);
            // Of sections that are to be drawn: the last lane's far plane does not matter.
            let middle = match self.is_whole {
                true => f32x8::splat(simd, 0.0),
                false => (within + within.slide::<1>(within)) * 0.5,
            };
            let pix = (middle * local.depth_per_warped + local.from_eye) * pixel_per_depth;
            let squared = pix * pix;
            let (along, across) = (squared * local.metric[0], squared * local.metric[1]);
            // The low-pass rule: at least a pixel for a grid unit.
            let one = f32x8::splat(simd, 1.0);
            let amplitude = one / (along.max(one) * across.max(one)).sqrt();
            // Above 0, for pixels whose squares are too small.
            let least = f32x8::splat(simd, 1e-30);
            let (along, across) = (along.min(one).max(least), across.min(one).max(least));
            let [x, y] = local.axis.map(|component| component * component);
            let width = (one / along * x + one / across * y).sqrt() * self.kernel.support;
            let height = (one / along * y + one / across * x).sqrt() * self.kernel.support;
            let largest =
                |lanes: f32x8<S>| lanes.to_array()[..count].iter().fold(0.0_f32, |a, &b| if a > b { a } else { b });
            half_box = [largest(width), largest(height)];
            (sections.along, sections.across) = (along.to_array(), across.to_array());
            sections.amplitude = amplitude.to_array();
            sections.reach = (height * self.kernel.reach(simd, t, t.slide::<1>(t))).to_array();
        }
        sections.planes = self.kernel.along(simd, t).to_array();
        sections.pixels = Pixels::within(splat.center, half_box);
        sections
    }

    /// Adds sections to a tile's sheets.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn draw<S: Simd>(
        &self,
        simd: S,
        splat: &Splat,
        sections: &Sections,
        open: &OpenMask,
        buffers: &mut Buffers,
    ) {
        let Some(Pixels { columns: [left, right], rows }) = sections.pixels else { return };
        let slot = slot_of(splat.sheets[0]);
        let mut written = 0;
        for column in (left..=right).step_by(LANES) {
            let block = Block { splat, sections, column, rows, slot, open };
            written |= match self.pixel_per_depth {
                // A loop of a fixed length is unrolled.
                None => match sections.count {
                    1 => self.draw_block::<S, 1>(simd, &block, &mut buffers.sheets),
                    2 => self.draw_block::<S, 2>(simd, &block, &mut buffers.sheets),
                    3 => self.draw_block::<S, 3>(simd, &block, &mut buffers.sheets),
                    4 => self.draw_block::<S, 4>(simd, &block, &mut buffers.sheets),
                    5 => self.draw_block::<S, 5>(simd, &block, &mut buffers.sheets),
                    6 => self.draw_block::<S, 6>(simd, &block, &mut buffers.sheets),
                    _ => self.draw_block::<S, SECTIONS>(simd, &block, &mut buffers.sheets),
                },
                Some(_) => self.draw_local_block(simd, &block, &mut buffers.sheets),
            };
        }
        for section in 0..sections.count {
            buffers.written[(slot + section) % RING] |= written;
        }
    }

    /// Eight columns of N sections without perspective, which all have one footprint. Returns the bits of the rows.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn draw_block<S: Simd, const N: usize>(&self, simd: S, block: &Block<'_>, sheets: &mut [SheetRow]) -> u64 {
        let Block { splat, sections, column, rows: [first, last], slot, .. } = *block;
        let dx = iota(simd) + (column as f32 - splat.center[0]);
        let [xx, xy, yy] = self.metric;
        let mut written = 0;
        for begin in (first..=last).step_by(BLOCK_ROWS) {
            // All rows of a block first, also those beyond the last one: independent sums without a branch, two rows to a vector.
            let zero = f32x8::splat(simd, 0.0);
            let (mut rims, mut in_planes) = ([zero; BLOCK_ROWS], [zero; BLOCK_ROWS]);
            for pair in (0..BLOCK_ROWS).step_by(2) {
                let rho_squared = |row: usize| {
                    let dy = (begin + row) as f32 - splat.center[1];
                    dx * (dx * xx + xy * dy) + yy * dy * dy
                };
                let [first, second] = [rho_squared(pair), rho_squared(pair + 1)];
                (rims[pair], rims[pair + 1]) = self.kernel.rim(simd, first.combine(second)).split();
                in_planes[pair] = self.kernel.in_plane(simd, first);
                in_planes[pair + 1] = self.kernel.in_plane(simd, second);
            }
            for (target, row) in sheets[begin..=last.min(begin + BLOCK_ROWS - 1)].iter_mut().zip(begin..) {
                if block.is_closed(row) {
                    continue;
                }
                written |= 1 << row;
                let at = (row - begin) % BLOCK_ROWS;
                let (rim, in_plane) = (rims[at], in_planes[at]);
                let mut near = cut_by_rim(simd, sections.planes[0], rim);
                for section in 0..N {
                    let far = cut_by_rim(simd, sections.planes[section + 1], rim);
                    add((far - near) * in_plane, splat.amount, column, &mut target[(slot + section) % RING]);
                    near = far;
                }
            }
        }
        written
    }

    /// Eight columns in perspective: every section has its own footprint, of the size that pixels have at its middle. Returns the bits of
    /// the rows.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn draw_local_block<S: Simd>(&self, simd: S, block: &Block<'_>, sheets: &mut [SheetRow]) -> u64 {
        let Block { splat, sections, column, rows: [first, last], slot, .. } = *block;
        let dx = iota(simd) + (column as f32 - splat.center[0]);
        let [x, y] = splat.local.axis;
        let mut written = 0;
        for (target, row) in sheets[first..=last].iter_mut().zip(first..) {
            if block.is_closed(row) {
                continue;
            }
            written |= 1 << row;
            let dy = row as f32 - splat.center[1];
            let along = dx * x + dy * y;
            let across = dx * -y + dy * x;
            let (along, across) = (along * along, across * across);
            for section in 0..sections.count {
                if dy.abs() > sections.reach[section] {
                    continue;
                }
                let rho_squared = along * sections.along[section] + across * sections.across[section];
                let rim = self.kernel.rim(simd, rho_squared);
                let in_plane = self.kernel.in_plane(simd, rho_squared) * sections.amplitude[section];
                let near = cut_by_rim(simd, sections.planes[section], rim);
                let far = cut_by_rim(simd, sections.planes[(section + 1) % LANES], rim);
                add((far - near) * in_plane, splat.amount, column, &mut target[(slot + section) % RING]);
            }
        }
        written
    }
}

/// The rows whose weights are computed together.
const BLOCK_ROWS: usize = 8;

/// Sections to be drawn into eight columns of pixels.
struct Block<'a> {
    splat: &'a Splat,
    sections: &'a Sections,
    column: usize,
    /// The first and the last row.
    rows: [usize; 2],
    /// That of the first section.
    slot: usize,
    open: &'a OpenMask,
}

impl Block<'_> {
    /// Whether all its pixels in a row are opaque.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn is_closed(&self, row: usize) -> bool {
        self.open.row(row) & columns_between(self.column, (self.column + LANES - 1).min(COLUMNS - 1)) == 0
    }
}

/// `H(0, 0, t)` at a plane, or at the rim on its side.
#[cfg_attr(not(debug_assertions), inline(always))]
fn cut_by_rim<S: Simd>(simd: S, plane: f32, rim: f32x8<S>) -> f32x8<S> {
    f32x8::splat(simd, plane).max(-rim).min(rim)
}

/// Adds a colour to eight pixels of a sheet, by weights.
#[cfg_attr(not(debug_assertions), inline(always))]
fn add<S: Simd>(weights: f32x8<S>, colors: [f32; 4], column: usize, sheet: &mut [[f32; COLUMNS + LANES]; CHANNELS]) {
    let column = column.min(COLUMNS);
    let weights = weights.to_array();
    for (channel, color) in sheet.iter_mut().zip(colors) {
        // The compiler vectorizes this loop. Loading an `f32x8` instead goes through a copy on the stack.
        if let Some(pixels) = channel[column..].first_chunk_mut::<LANES>() {
            for (pixel, weight) in pixels.iter_mut().zip(weights) {
                *pixel += weight * color;
            }
        }
    }
}
