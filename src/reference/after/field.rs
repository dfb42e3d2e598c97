//! The field of the voxels' values, and its gradient, at a point (SPEC §9).
//!
//! Every voxel i that is not a hole has the weight `g_i = exp(-falloff·|δ_i|²)` if `|δ_i| < radius`, else 0. With `N = Σ g_i` the field is
//! `f = Σ c_i·g_i / N`: a weighted mean, so constant data has no ripple, not even at borders.

use glam::{DVec3, UVec3};

use super::coefficients;
use super::low_pass::LowPass;
use crate::error::RenderError;
use crate::scene::Scene;
use crate::settings::shading::Gradient;
use crate::settings::splatting::Interpolation;
use crate::volume::{Grid, Volume};

/// Where the sum of the weights is less than this, there is no value.
const MIN_WEIGHT: f64 = 1e-3;

/// A volume's field.
#[derive(Debug)]
pub struct Field<'a> {
    volume: &'a Volume,
    /// c for every voxel; NaN at holes.
    coefficients: Vec<f64>,
    radius: f64,
    falloff: f64,
    gradient: Gradient,
}

impl<'a> Field<'a> {
    /// The field of a volume under a scene's settings.
    ///
    /// # Errors
    /// If no coefficients interpolate the volume's values.
    pub fn new(volume: &'a Volume, scene: &Scene) -> Result<Self, RenderError> {
        let (radius, falloff) = (scene.splatting.radius, scene.splatting.falloff);
        let values = volume.values().iter().map(|&value| f64::from(if value.is_finite() { value } else { f32::NAN }));
        let values: Vec<f64> = values.collect();
        let coefficients = match scene.splatting.interpolation {
            Interpolation::Smooth => values,
            Interpolation::Exact => coefficients::exact(volume.grid(), &values, radius, falloff)?,
        };
        Ok(Self { volume, coefficients, radius, falloff, gradient: scene.shading.gradient })
    }

    /// f at a point in voxel coordinates; `None` where the sum of the weights is too small or the nearest voxel is a hole.
    pub fn value(&self, at: DVec3, low_pass: &LowPass) -> Option<f64> {
        if self.coefficients[nearest(self.volume.grid(), at) as usize].is_nan() {
            return None;
        }
        let (mut sum, mut weights) = (0.0, 0.0);
        self.each(at, low_pass, |index, weight, _| {
            sum += self.coefficients[index as usize] * weight;
            weights += weight;
        });
        (weights >= MIN_WEIGHT).then(|| sum / weights)
    }

    /// ∇f per world unit of the unwarped space, at a point that has a value.
    pub fn gradient(&self, at: DVec3, low_pass: &LowPass) -> DVec3 {
        let grid = self.volume.grid();
        let mut weights = 0.0;
        match self.gradient {
            Gradient::Differences => {
                let mut sum = DVec3::ZERO;
                self.each(at, low_pass, |index, weight, _| {
                    sum += self.volume.gradient(grid.voxel_at(index)) * weight;
                    weights += weight;
                });
                sum / weights
            }
            Gradient::Kernel => {
                let (mut sum, mut offsets, mut moment) = (0.0, DVec3::ZERO, DVec3::ZERO);
                // Differences from one coefficient, so that the gradient of a constant is exactly 0: its direction would be rounding errors.
                let mut base = None;
                self.each(at, low_pass, |index, weight, offset| {
                    let coefficient = self.coefficients[index as usize];
                    let coefficient = coefficient - *base.get_or_insert(coefficient);
                    sum += coefficient * weight;
                    offsets += weight * offset;
                    moment += coefficient * weight * offset;
                    weights += weight;
                });
                -2.0 * self.falloff * (moment - sum / weights * offsets) / weights / grid.spacing
            }
        }
    }

    /// Calls `with` for every voxel of weight above 0 that is not a hole: its index in memory, `g_i` and `δ_i`.
    fn each(&self, at: DVec3, low_pass: &LowPass, mut with: impl FnMut(u32, f64, DVec3)) {
        let dims = self.volume.dims();
        let half_box = low_pass.half_box(self.radius);
        let low = (at - half_box).ceil().max(DVec3::ZERO);
        let end = ((at + half_box).floor() + 1.0).min(dims.as_dvec3());
        if low.cmpge(end).any() {
            return;
        }
        let (low, end) = (low.as_uvec3(), end.as_uvec3());
        for (z, y) in (low.z..end.z).flat_map(|z| (low.y..end.y).map(move |y| (z, y))) {
            let row = dims.x * (y + dims.y * z);
            for x in low.x..end.x {
                let offset = low_pass.lowered * (at - UVec3::new(x, y, z).as_dvec3());
                let squared = offset.length_squared();
                if squared < self.radius * self.radius && !self.coefficients[(row + x) as usize].is_nan() {
                    with(row + x, (-self.falloff * squared).exp(), offset);
                }
            }
        }
    }

    /// The coefficients of all voxels; NaN at holes.
    pub fn coefficients(&self) -> &[f64] {
        &self.coefficients
    }
}

/// The index in memory of the voxel whose cell contains a point in voxel coordinates; beyond all cells, of the nearest voxel.
pub fn nearest(grid: &Grid, at: DVec3) -> u32 {
    let last = grid.dims.as_dvec3() - 1.0;
    grid.index_of((at + 0.5).floor().clamp(DVec3::ZERO, last).as_uvec3())
}
