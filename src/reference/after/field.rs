//! The field of the voxels' values, and its gradient, at a point (SPEC §9).
//!
//! Every voxel i that is not a hole has the weight `g_i = exp(-falloff·|δ_i|²)` if `|δ_i| < radius`, else 0. With `N = Σ g_i` the field is
//! `f = Σ c_i·g_i / N`: a weighted mean, so constant data has no ripple, not even at borders.

use glam::{DVec3, DVec4, UVec3};

use super::coefficients;
use super::low_pass::LowPass;
use crate::error::RenderError;
use crate::scene::Scene;
use crate::settings::shading::Gradient;
use crate::volume::{Grid, Volume};

/// Where the sum of the weights is less than this, there is no value.
const MIN_WEIGHT: f64 = 1e-3;

/// A volume's field.
#[derive(Debug)]
pub struct Field<'a> {
    volume: &'a Volume,
    /// c for every voxel; NaN at holes.
    coefficients: Vec<f64>,
    /// The same of colours and A, if the voxels have their own (SPEC §10); 0 at holes.
    colors: Option<Vec<DVec4>>,
    /// Their minimum and maximum.
    range: [f64; 2],
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
        let values = volume.values().iter().map(|value| f64::from(if value.is_finite() { value } else { f32::NAN }));
        let values: Vec<f64> = values.collect();
        let coefficients = match scene.splatting.is_exact() {
            false => values,
            true => coefficients::exact(volume.grid(), &values, radius, falloff)?,
        };
        let colors = volume.colors().is_some().then(|| colors(volume, scene)).transpose()?;
        // `min` and `max` ignore NaN.
        let range =
            coefficients.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[min, max], &c| [min.min(c), max.max(c)]);
        Ok(Self { volume, coefficients, colors, range, radius, falloff, gradient: scene.shading.gradient })
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

    /// The colour and A at a point that has a value, in [0, 1]; `None` where voxels have none of their own.
    pub fn color(&self, at: DVec3, low_pass: &LowPass) -> Option<DVec4> {
        let colors = self.colors.as_ref()?;
        let (mut sum, mut weights) = (DVec4::ZERO, 0.0);
        self.each(at, low_pass, |index, weight, _| {
            sum += colors[index as usize] * weight;
            weights += weight;
        });
        Some((sum / weights).clamp(DVec4::ZERO, DVec4::ONE))
    }

    /// ∇f per world unit of the unwarped space, at a point that has a value.
    pub fn gradient(&self, at: DVec3, low_pass: &LowPass) -> DVec3 {
        let grid = self.volume.grid();
        let mut weights = 0.0;
        match self.gradient {
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
            _ => {
                let mut sum = DVec3::ZERO;
                self.each(at, low_pass, |index, weight, _| {
                    sum += self.volume.gradient(grid.voxel_at(index)) * weight;
                    weights += weight;
                });
                sum / weights
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

    /// The minimum and maximum coefficient.
    pub fn range(&self) -> [f64; 2] {
        self.range
    }

    /// The coefficients of all voxels; NaN at holes.
    pub fn coefficients(&self) -> &[f64] {
        &self.coefficients
    }
}

/// The coefficients of a volume's colours.
fn colors(volume: &Volume, scene: &Scene) -> Result<Vec<DVec4>, RenderError> {
    let (radius, falloff) = (scene.splatting.radius, scene.splatting.falloff);
    let is_hole = |index: u32| volume.values().at(index as usize).is_nan();
    let indices = 0..volume.values().len() as u32;
    let mut colors: Vec<DVec4> = indices.clone().filter_map(|index| volume.color(index)).collect();
    if scene.splatting.is_exact() {
        for component in 0..4 {
            let own = |index: u32| if is_hole(index) { f64::NAN } else { colors[index as usize][component] };
            let numbers: Vec<f64> = indices.clone().map(own).collect();
            let exact = coefficients::exact(volume.grid(), &numbers, radius, falloff)?;
            colors.iter_mut().zip(exact).for_each(|(color, number)| color[component] = number);
        }
    }
    Ok(colors)
}

/// The index in memory of the voxel whose cell contains a point in voxel coordinates; beyond all cells, of the nearest voxel.
pub fn nearest(grid: &Grid, at: DVec3) -> u32 {
    let last = grid.dims.as_dvec3() - 1.0;
    grid.index_of((at + 0.5).floor().clamp(DVec3::ZERO, last).as_uvec3())
}
