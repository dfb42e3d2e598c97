//! Colours of the voxels' own (SPEC §10) on slab planes: interpolated like the field, and a slab takes the mean of its two planes'.

use std::sync::Arc;

use fearless_simd::f32x8;
use fearless_simd::prelude::*;
use glam::DVec3;

use super::classify::Slab;
use super::frame::Frame;
use super::low_pass::LowPass;
use super::planes::Plane;
use crate::after::coefficients;
use crate::cpu::count::bits;
use crate::cpu::vector::{LANES, mask};
use crate::error::RenderError;
use crate::volume::{Texel, Volume};

/// Red, green, blue and A.
pub(super) type Color = [f32; 4];

/// The coefficients of colours.
#[derive(Clone, Debug)]
pub(super) enum Colors {
    /// The voxels' own.
    Smooth,
    /// Those of `interpolation = "exact"`, in memory order.
    Exact(Arc<[Color]>),
}

/// The coefficients of a volume's colours, to be read.
#[derive(Clone, Copy, Debug)]
pub(super) enum ColorsOf<'a> {
    Smooth(&'a [Texel]),
    Exact(&'a [Color]),
}

impl Colors {
    /// Those of a volume; `None` if its voxels have no colours of their own.
    ///
    /// # Errors
    /// If no coefficients are found that interpolate the colours.
    pub(super) fn new(volume: &Volume, is_exact: bool, kernel: (f64, f64)) -> Result<Option<Self>, RenderError> {
        if !is_exact {
            return Ok(volume.colors().map(|_| Self::Smooth));
        }
        Ok(coefficients::of_colors(volume, kernel)?.map(Self::Exact))
    }

    pub(super) fn of<'a>(&'a self, volume: &'a Volume) -> Option<ColorsOf<'a>> {
        match self {
            Self::Smooth => volume.colors().map(ColorsOf::Smooth),
            Self::Exact(colors) => Some(ColorsOf::Exact(colors)),
        }
    }
}

impl ColorsOf<'_> {
    /// The coefficients of a voxel, given by its index in memory.
    pub(super) fn at(&self, index: usize) -> Color {
        match self {
            Self::Smooth(texels) => texels[index].map(share),
            Self::Exact(colors) => colors[index],
        }
    }
}

/// A texel's number in [0, 1].
fn share(number: u16) -> f32 {
    f32::from(number) / f32::from(u16::MAX)
}

impl Frame<'_> {
    /// Computes the colours of those of eight pixels on a plane that have values, unless they are known.
    #[inline(never)]
    pub(super) fn find_colors<S: Simd>(&self, simd: S, plane: &mut Plane, lanes: u32, [column, row]: [usize; 2]) {
        let missing = lanes & !(plane.colored[row] >> column);
        if missing == 0 {
            return;
        }
        plane.colored[row] |= missing << column;
        let Some((points, low_pass)) = &plane.points else { return };
        for lane in bits(missing.into()) {
            let column = column + lane as usize;
            let at: (DVec3, &LowPass) = (points.of(column, row), low_pass);
            let color = self.field.color(simd, at);
            (0..4).for_each(|component| plane.colors[row][component][column] = color[component]);
        }
    }

    /// The mean colours of some of eight pixels on the two planes of a slab, if voxels have colours of their own.
    #[inline(always)]
    pub(super) fn slab_colors<S: Simd>(
        &self,
        simd: S,
        slab: &Slab<S>,
        lanes: u32,
        planes: &mut [Plane; 2],
        [column, row]: [usize; 2],
    ) -> Option<[f32x8<S>; 4]> {
        if !self.field.has_colors() {
            return None;
        }
        for (plane, has_value) in planes.iter_mut().zip(slab.has_value) {
            self.find_colors(simd, plane, lanes & has_value, [column, row]);
        }
        let [has_near, has_far] = slab.has_value.map(|bits| mask(simd, bits));
        let load = |plane: &Plane, component: usize| {
            f32x8::from_slice(simd, &plane.colors[row][component][column..column + LANES])
        };
        Some(std::array::from_fn(|component| {
            let [near, far] = [load(&planes[0], component), load(&planes[1], component)];
            (has_near.select(near, far) + has_far.select(far, near)) * 0.5
        }))
    }
}
