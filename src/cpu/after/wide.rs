//! Slabs whose kernels are wide, because pixels are much larger than voxels (the low-pass rule of SPEC §9): each of their pixels gathers many voxels. A
//! small picture has few tiles of such pixels, too few for all cores, so the pixels of a slab are computed on all cores before it is classified.

use fearless_simd::Simd;

use super::classify::Looks;
use super::field::Weights;
use super::frame::Frame;
use super::planes::Plane;
use crate::cpu::count::bits;
use crate::cpu::sheets::{COLUMNS, ROWS};
use crate::cpu::vector::LANES;
use crate::parallel::prelude::*;

/// Eight neighbouring pixels: the column and row of the first one in the tile, and a bit for each of them that is meant.
type Eight = ([usize; 2], u32);

impl Frame<'_> {
    /// Finds the values and gradients that [`Self::classify`] needs, if kernels are wide.
    #[inline(always)]
    pub(super) fn find_wide<S: Simd>(
        &self,
        simd: S,
        number: i32,
        looks: &Looks<'_>,
        planes: &mut [Plane; 2],
        wanted: &[u32; ROWS],
    ) {
        if !planes.iter().any(Plane::is_wide) {
            return;
        }
        let mut eights = Vec::new();
        for (row, bits) in wanted.iter().enumerate().filter(|(_, bits)| **bits != 0) {
            for column in (0..COLUMNS).step_by(LANES) {
                let lanes = bits >> column & u32::from(u8::MAX);
                let lanes = self.reaching(simd, lanes, looks, number, [column, row]);
                eights.push(([column, row], self.showing(simd, lanes, planes, [column, row])));
            }
        }
        for plane in planes.iter_mut() {
            self.find_all_values(simd, plane, &eights);
        }
        // A surface needs the gradients of few pixels.
        if !self.needs_gradients || self.compositing.has_surface() {
            return;
        }
        let mut visible = [Vec::new(), Vec::new()];
        for (at, lanes) in eights.into_iter().filter(|(_, lanes)| *lanes != 0) {
            let Some(slab) = self.slab(simd, number, lanes, planes, at) else { continue };
            let lanes = self.means(simd, &slab, looks, at).visible(simd, slab.lanes);
            for (visible, has_value) in visible.iter_mut().zip(slab.has_value) {
                visible.push((at, lanes & has_value));
            }
        }
        for (plane, visible) in planes.iter_mut().zip(&visible) {
            self.find_all_gradients(simd, plane, visible);
        }
    }

    /// [`Self::find_values`] on all cores.
    fn find_all_values<S: Simd>(&self, simd: S, plane: &mut Plane, eights: &[Eight]) {
        let missing = missing(&plane.known, eights);
        let (Some(of), false) = (&plane.points, missing.is_empty()) else { return };
        let field = plane.held.as_ref().map_or(self.field, |held| self.field.of(held));
        let found = missing.par_iter().with_max_len(1).map(|&(at, lanes)| {
            // Wide kernels keep no weights.
            simd.vectorize(
                #[inline(always)]
                || field.values(simd, of, at, lanes, &mut Weights::new()),
            )
        });
        let found: Vec<_> = found.collect();
        for (([column, row], lanes), values) in missing.into_iter().zip(found) {
            plane.known[row] |= lanes << column;
            bits(lanes.into()).for_each(|lane| {
                plane.rows[row].values[column + lane as usize] = values[lane as usize];
            });
        }
    }

    /// [`Self::find_gradients`] on all cores.
    fn find_all_gradients<S: Simd>(&self, simd: S, plane: &mut Plane, eights: &[Eight]) {
        let missing = missing(&plane.graded, eights);
        let (Some(of), false) = (&plane.points, missing.is_empty()) else { return };
        let field = plane.held.as_ref().map_or(self.field, |held| self.field.of(held));
        let found = missing.par_iter().with_max_len(1).map(|&(at, lanes)| {
            simd.vectorize(
                #[inline(always)]
                || field.gradients(simd, of, at, lanes, &mut Weights::new()),
            )
        });
        let found: Vec<_> = found.collect();
        for (([column, row], lanes), gradients) in missing.into_iter().zip(found) {
            plane.graded[row] |= lanes << column;
            for (all, new) in plane.rows[row].gradients.iter_mut().zip(gradients) {
                bits(lanes.into()).for_each(|lane| all[column + lane as usize] = new[lane as usize]);
            }
        }
    }
}

/// The pixels of eights that are not known yet.
fn missing(known: &[u32; ROWS], eights: &[Eight]) -> Vec<Eight> {
    let missing = eights.iter().map(|&([column, row], lanes)| ([column, row], lanes & !(known[row] >> column)));
    missing.filter(|(_, lanes)| *lanes != 0).collect()
}
