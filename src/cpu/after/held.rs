//! The voxels of a store that some slabs of a tile may see, copied from its chunks.

use std::ops::Range;

use glam::{DVec3, UVec3};

use super::cells::{Cells, Work, may_show};
use super::extent::{Extent, Held, RIM};
use super::frame::Frame;
use super::matter::Matter;
use super::needs::Needs;
use super::place::Placement;
use crate::cpu::cull::OpenMask;
use crate::cpu::sheets::{COLUMNS, ROWS};
use crate::volume::{ValueSlice, Values, Volume};

/// The depth of the slabs whose voxels are held together, in voxels: deeper ones copy less often what neighbouring slabs share.
const DEPTH: f64 = 8.0;

/// A value, its bits, and the copies with which those of cells are computed.
const BYTES_PER_VOXEL: f64 = 7.0;

impl Held {
    /// Whether the voxels suffice for the open pixels of a tile, given by its first pixel, in a slab.
    pub(super) fn suffices(&self, frame: &Frame<'_>, slab: i32, origin: [usize; 2], open: &OpenMask) -> bool {
        if !self.slabs.contains(&slab) {
            return false;
        }
        let Matter::Streamed { stream, .. } = frame.matter else { return true };
        if self.missing.is_empty() {
            return true;
        }
        let needs = Needs::new(frame, stream, slab, origin, open);
        !self.missing.iter().any(|&number| needs.chunk(number))
    }

    /// The slab, behind one in which nothing shows, in which something may.
    pub(super) fn blank_until(&self, slab: i32) -> Option<i32> {
        // Chunks that are missing may be needed in the next one.
        self.is_blank.then(|| if self.missing.is_empty() { self.slabs.end } else { slab + 1 })
    }
}

impl Frame<'_> {
    /// The voxels that the open pixels of a tile, given by its first pixel, may see in a slab and some behind it; `None` if they are in memory anyway.
    pub(super) fn hold(&self, slab: i32, origin: [usize; 2], open: &OpenMask) -> Option<Held> {
        let Matter::Streamed { stream, .. } = self.matter else { return None };
        let slabs = slab..slab.saturating_add(self.slabs_held());
        let half_box = self.placement.geometry.widest_half_box(&self.placement.view);
        let extent = self.extent(&slabs, origin, open, half_box);
        let nothing = |missing| {
            let volume = Volume::piece(self.grid.resized(UVec3::ZERO), Values::default());
            Some(Held { slabs: slabs.clone(), extent, volume, cells: None, is_blank: true, missing })
        };
        if stream.range((extent.low, extent.held)).is_some_and(|range| self.is_dark(range)) {
            return nothing(Vec::new());
        }
        let needs = Needs::new(self, stream, slab, origin, open);
        let (seen, missing): (Vec<u32>, Vec<u32>) =
            stream.chunks_in((extent.low, extent.held)).partition(|&number| needs.chunk(number));
        let shown = self.shown();
        if seen.is_empty() && shown.is_some() {
            return nothing(missing);
        }
        let values = stream.values((extent.low, extent.held), &seen);
        let is_blank = shown.is_some_and(|shown| !may_show((&values).into(), &self.numbers, shown));
        let grid = self.grid.resized(extent.held);
        let cells = shown.filter(|_| !is_blank);
        let cells = cells.map(|shown| Cells::new(&grid, (&values).into(), &self.numbers, half_box, shown, Work::Alone));
        Some(Held { slabs, extent, volume: Volume::piece(grid, values), cells, is_blank, missing })
    }

    /// The least and the greatest number with an opacity; `None` where all values count.
    fn shown(&self) -> Option<[f32; 2]> {
        (!self.compositing.is_choice()).then_some(self.integrals.shown)
    }

    /// Whether no value between two has an opacity. If there are only holes, of which the minimum is the larger one, there is no value.
    pub(super) fn is_dark(&self, [min, max]: [f32; 2]) -> bool {
        self.shown().is_some_and(|shown| min > max || !may_show(ValueSlice::F32(&[min, max]), &self.numbers, shown))
    }

    /// The number of slabs whose voxels are held together.
    fn slabs_held(&self) -> i32 {
        (DEPTH / self.placement.slab_step().max_element()).clamp(1.0, 64.0) as i32
    }

    /// The most bytes that a tile holds, whose pixels are those farthest from the eye.
    pub(in crate::cpu) fn held_bytes(&self) -> f64 {
        let Placement { view, geometry, .. } = &self.placement;
        let points = self.points(self.touched.end, [0; 2]);
        let across = points
            .map_or(DVec3::ZERO, |(points, _)| points.right.abs() * COLUMNS as f64 + points.down.abs() * ROWS as f64);
        let along = self.placement.slab_step() * f64::from(self.slabs_held());
        let around = 2.0 * (geometry.widest_half_box(view).ceil() + RIM) + 2.0;
        let voxels = (across + along + around).min(self.grid.dims.as_dvec3()).element_product();
        voxels * BYTES_PER_VOXEL
    }

    /// The box around the points of a tile's open pixels on slabs' planes.
    fn extent(&self, slabs: &Range<i32>, origin: [usize; 2], open: &OpenMask, half_box: DVec3) -> Extent {
        let rows = || (0..ROWS).filter(|&row| open.row(row) != 0);
        let columns = rows().fold(0, |bits, row| bits | open.row(row));
        let of_rows = [rows().next().unwrap_or(0), rows().next_back().unwrap_or(ROWS - 1)];
        let of_columns = [columns.trailing_zeros() as usize, 31 - columns.leading_zeros() as usize];
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for plane in [slabs.start, slabs.end] {
            // Behind the eye there are no points, and the first ones before it are those of the plane at the eye.
            let plane = if self.placement.view.perspective.is_some() { plane.max(0) } else { plane };
            for (column, row) in of_columns.into_iter().flat_map(|column| of_rows.map(|row| (column, row))) {
                let at = self.voxel_at([origin[0] + column.min(COLUMNS - 1), origin[1] + row], plane.into());
                (low, high) = (low.min(at), high.max(at));
            }
        }
        let dims = self.grid.dims;
        // The nearest cubes inside the volume, and their neighbours for differences.
        let most = (dims.as_dvec3() - 5.0).max(DVec3::ZERO);
        let least = dims.as_dvec3().min(DVec3::splat(5.0));
        let low = (low.floor() - half_box.ceil() - RIM).clamp(DVec3::ZERO, most);
        let end = (high.floor() + half_box.ceil() + RIM + 1.0).clamp(least, dims.as_dvec3());
        let low = low.as_uvec3();
        Extent { dims, low, held: end.as_uvec3() - low }
    }
}
