//! The two planes of a tile's slab: the points of their pixels, and the field there as far as it was asked for (SPEC §9).

use std::sync::Arc;

use fearless_simd::prelude::*;
use fearless_simd::{f32x8, i32x8, u32x8};
use glam::DVec3;

use super::extent::{Extent, Held};
use super::field::Weights;
use super::low_pass::LowPass;
use crate::cpu::project::floor;
use crate::cpu::sheets::{COLUMNS, ROWS};
use crate::cpu::vector::{LANES, iota};

/// A row of a plane's pixels.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlaneRow {
    /// f, as a number; NaN where there is no value.
    pub(super) values: [f32; COLUMNS],
    /// ∇f, numbers per world unit.
    pub(super) gradients: [[f32; COLUMNS]; 3],
}

/// The points of a plane where the rays of a tile's pixels meet it, in voxel coordinates.
#[derive(Clone, Copy, Debug)]
pub(super) struct Points {
    /// Of the tile's first pixel, and the steps to the next column and row.
    pub(super) first: DVec3,
    pub(super) right: DVec3,
    pub(super) down: DVec3,
}

/// Eight neighbouring points of a plane, in voxels after the first voxel of their cells, which are those of the nearest points inside the volume.
#[derive(Clone, Copy, Debug)]
pub(super) struct Eight {
    /// The voxels by axis.
    pub(super) cells: [[i32; LANES]; 3],
    /// From there, by axis.
    pub(super) rest: [[f32; LANES]; 3],
    /// The voxels' indices in memory.
    pub(super) indices: [u32; LANES],
}

impl Eight {
    /// Some points.
    pub(super) const NONE: Self = Self { cells: [[0; LANES]; 3], rest: [[0.0; LANES]; 3], indices: [0; LANES] };
}

impl Points {
    /// The point of a pixel.
    #[inline(always)]
    pub(super) fn of(&self, column: usize, row: usize) -> DVec3 {
        self.first + self.right * column as f64 + self.down * row as f64
    }

    /// The points of eight pixels, their cells `before` voxels early, where the volume has at least `behind` voxels after them. A point that the
    /// voxels at hand do not surround has the index of some of them.
    #[inline(always)]
    pub(super) fn eight<S: Simd>(
        &self,
        simd: S,
        extent: &Extent,
        [before, behind]: [i32; 2],
        [column, row]: [usize; 2],
    ) -> Eight {
        let first = self.of(column, row);
        let (dims, low, held) = (extent.dims.to_array(), extent.low.to_array(), extent.held.to_array());
        let mut eight = Eight::NONE;
        let mut index = i32x8::splat(simd, 0);
        for axis in [2, 1, 0] {
            // Relative to a whole number near by, so that f32 tells where in its cell a point is.
            let whole = floor(first[axis].clamp(-1e9, 1e9));
            let at = iota(simd) * self.right[axis] as f32 + (first[axis] - f64::from(whole)) as f32;
            let last = dims[axis] as i32 - 1 - behind;
            let cell = at.floor().to_int::<i32x8<S>>() + (whole - before);
            let cell = cell.max(i32x8::splat(simd, 0)).min(i32x8::splat(simd, last.max(0)));
            let rest = at - (cell - whole).to_float::<f32x8<S>>();
            let there = (cell - low[axis] as i32).max(i32x8::splat(simd, 0));
            index = index * held[axis] as i32 + there.min(i32x8::splat(simd, held[axis] as i32 - 1));
            eight.cells[axis] = cell.to_array();
            eight.rest[axis] = rest.to_array();
        }
        eight.indices = index.bitcast::<u32x8<S>>().to_array();
        eight
    }
}

/// One plane of a tile.
#[derive(Debug)]
pub(super) struct Plane {
    /// k.
    pub(super) number: i32,
    /// `None` at the eye and behind it, where there are no values.
    pub(super) points: Option<(Points, LowPass)>,
    /// The voxels of a store around the points.
    pub(super) held: Option<Arc<Held>>,
    /// The weights of the last points whose values or gradients were computed.
    pub(super) weights: Box<Weights>,
    /// The pixels whose cells' bits are known, row by row, and these.
    pub(super) seen: [u32; ROWS],
    pub(super) reaches: [u32; ROWS],
    pub(super) stays: [u32; ROWS],
    /// The pixels whose values are known.
    pub(super) known: [u32; ROWS],
    /// The pixels whose gradients are known.
    pub(super) graded: [u32; ROWS],
    /// The pixels whose colours are known, where voxels have their own.
    pub(super) colored: [u32; ROWS],
    /// The pixels that have been chosen from, where compositing chooses.
    pub(super) chosen: [u32; ROWS],
    pub(super) rows: Vec<PlaneRow>,
    /// The colours of pixels, row by row; empty where voxels have none of their own.
    pub(super) colors: Vec<[[f32; COLUMNS]; 4]>,
}

impl Plane {
    /// Some plane, of which nothing is known, with or without colours.
    pub(super) fn new(has_colors: bool) -> Self {
        let row = PlaneRow { values: [f32::NAN; COLUMNS], gradients: [[0.0; COLUMNS]; 3] };
        let none = [0; ROWS];
        Self {
            number: 0,
            points: None,
            held: None,
            weights: Box::new(Weights::new()),
            seen: none,
            reaches: none,
            stays: none,
            known: none,
            graded: none,
            colored: none,
            chosen: none,
            rows: vec![row; ROWS],
            colors: vec![[[0.0; COLUMNS]; 4]; if has_colors { ROWS } else { 0 }],
        }
    }

    /// Takes its values from other voxels of a store.
    pub(super) fn hold(&mut self, held: Option<Arc<Held>>) {
        self.held = held;
        // They have the voxels' indices.
        self.weights.clear();
    }

    /// Whether kernels are wide ([`LowPass::is_wide`]).
    pub(super) fn is_wide(&self) -> bool {
        self.points.as_ref().is_some_and(|(_, low_pass)| low_pass.is_wide)
    }

    /// Makes this plane another one.
    pub(super) fn become_plane(&mut self, number: i32, points: Option<(Points, LowPass)>) {
        (self.number, self.points) = (number, points);
        self.weights.clear();
        let Self { seen, reaches, stays, known, graded, colored, chosen, .. } = self;
        for rows in [seen, reaches, stays, known, graded, colored, chosen] {
            *rows = [0; ROWS];
        }
    }
}
