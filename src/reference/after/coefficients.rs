//! The coefficients whose field has each voxel's value at that voxel: `splatting.interpolation = "exact"` (SPEC §9).
//!
//! At voxel j the field is `Σ g(i-j)·c_i / N_j`, so the coefficients solve `G·c = N·v`, with `G_ij = g(i-j)` over all voxels except holes
//! and N the row sums of G. G is symmetric, and positive definite where the discrete kernel's transform is positive, which the settings
//! ensure ([`Splatting::check`](crate::settings::Splatting::check)). Conjugate gradients therefore solve the system for any radius and any
//! kernel (Hestenes, Stiefel, *Methods of conjugate gradients for solving linear systems*, 1952).

use glam::IVec3;

use crate::error::RenderError;
use crate::error::setting::SettingError;
use crate::parallel::prelude::*;
use crate::volume::Grid;

/// The maximum error of the field at voxels, relative to the range of values; the specification requires 1e-5.
const TOLERANCE: f64 = 1e-9;

/// The maximum number of steps of conjugate gradients. Systems that the settings allow take at most some 200.
const MAX_STEPS: usize = 2000;

/// The coefficients for values on a grid; NaN at holes, where values are NaN.
///
/// # Errors
/// If the iteration does not converge because of rounding, as for values whose range is tiny compared with their size.
pub fn exact(grid: &Grid, values: &[f64], radius: f64, falloff: f64) -> Result<Vec<f64>, RenderError> {
    let taps = Taps::new(radius, falloff);
    let finite = || values.iter().copied().filter(|value| !value.is_nan());
    let (min, max) = (finite().fold(f64::INFINITY, f64::min), finite().fold(f64::NEG_INFINITY, f64::max));
    // A constant has constant coefficients, so values can be shifted to where rounding is smallest.
    let middle = (min + max) / 2.0;
    let is_hole: Vec<bool> = values.iter().map(|value| value.is_nan()).collect();
    let moved: Vec<f64> = values.iter().map(|value| if value.is_nan() { 0.0 } else { value - middle }).collect();
    let present: Vec<f64> = is_hole.iter().map(|&is_hole| f64::from(!is_hole)).collect();
    let product = |c: &[f64]| taps.convolve(grid, c, &is_hole);
    let weights = product(&present);

    let mut c = moved.clone();
    let first = product(&c);
    let mut residual: Vec<f64> = (0..c.len()).map(|j| weights[j] * moved[j] - first[j]).collect();
    let mut direction = residual.clone();
    let mut squared = dot(&residual, &residual);
    let error = |residual: &[f64]| {
        let at_voxels = residual.iter().zip(&weights).filter(|(_, weight)| **weight > 0.0);
        at_voxels.map(|(residual, weight)| (residual / weight).abs()).fold(0.0, f64::max)
    };
    // With only holes the range is negative infinity.
    let tolerance = TOLERANCE * (max - min).max(0.0);
    for _ in 0..MAX_STEPS {
        if error(&residual) <= tolerance {
            let c = c.iter().zip(&is_hole).map(|(c, &is_hole)| if is_hole { f64::NAN } else { c + middle });
            return Ok(c.collect());
        }
        let image = product(&direction);
        let step = squared / dot(&direction, &image);
        c.iter_mut().zip(&direction).for_each(|(c, direction)| *c += step * direction);
        residual.iter_mut().zip(&image).for_each(|(residual, image)| *residual -= step * image);
        let before = std::mem::replace(&mut squared, dot(&residual, &residual));
        let share = squared / before;
        direction
            .iter_mut()
            .zip(&residual)
            .for_each(|(direction, residual)| *direction = residual + share * *direction);
    }
    let (key, found) = ("splatting.interpolation", "\"exact\" for values for which it does not converge");
    Err(SettingError::new(key, found, "\"smooth\", or a larger splatting.falloff").into())
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The discrete kernel.
struct Taps {
    /// Offsets and their weights.
    taps: Vec<(IVec3, f64)>,
}

impl Taps {
    fn new(radius: f64, falloff: f64) -> Self {
        let reach = radius.ceil() as i32;
        let cube = (-reach..=reach).flat_map(|z| (-reach..=reach).map(move |y| (y, z)));
        let offsets = cube.flat_map(|(y, z)| (-reach..=reach).map(move |x| IVec3::new(x, y, z)));
        let weighted = offsets.map(|offset| (offset, offset.as_dvec3().length_squared()));
        let within = weighted.filter(|(_, squared)| *squared < radius * radius);
        Self { taps: within.map(|(offset, squared)| (offset, (-falloff * squared).exp())).collect() }
    }

    /// `G·c`; 0 at holes, where c is 0 too.
    fn convolve(&self, grid: &Grid, c: &[f64], is_hole: &[bool]) -> Vec<f64> {
        let dims = grid.dims.as_ivec3();
        let [nx, ny] = [dims.x as usize, dims.y as usize];
        let mut sums = vec![0.0; c.len()];
        sums.par_chunks_mut(nx).enumerate().for_each(|(row, sums)| {
            let (y, z) = ((row % ny) as i32, (row / ny) as i32);
            for &(offset, weight) in &self.taps {
                let (from_y, from_z) = (y + offset.y, z + offset.z);
                if !(0..dims.y).contains(&from_y) || !(0..dims.z).contains(&from_z) {
                    continue;
                }
                let from = (from_z as usize * ny + from_y as usize) * nx;
                let (first, end) = ((-offset.x).max(0), (dims.x - offset.x).min(dims.x));
                for x in first..end {
                    sums[x as usize] += weight * c[from + (x + offset.x) as usize];
                }
            }
            sums.iter_mut().zip(&is_hole[row * nx..]).filter(|(_, is_hole)| **is_hole).for_each(|(sum, _)| *sum = 0.0);
        });
        sums
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use glam::{DVec3, UVec3};

    use super::*;

    /// The field has the voxels' values also around holes, which are in none of the sums.
    #[test]
    fn fields_have_the_values_at_voxels() {
        let grid = Grid::new(UVec3::new(6, 5, 4), DVec3::ONE);
        let value = |index: u32| match index * 7919 % 31 {
            3 | 17 => f64::NAN,
            rest => 1e6 + f64::from(rest * rest),
        };
        let values: Vec<f64> = (0..120).map(value).collect();
        let coefficients = exact(&grid, &values, 2.0, 1.0).unwrap();
        for (j, expected) in (0..).zip(&values) {
            assert_eq!(coefficients[j as usize].is_nan(), expected.is_nan());
            let (mut sum, mut weights) = (0.0, 0.0);
            for (i, coefficient) in (0..).zip(&coefficients).filter(|(_, coefficient)| !coefficient.is_nan()) {
                let squared = grid.voxel_at(i).as_dvec3().distance_squared(grid.voxel_at(j).as_dvec3());
                let weight = if squared < 4.0 { (-squared).exp() } else { 0.0 };
                sum += weight * coefficient;
                weights += weight;
            }
            assert!(expected.is_nan() || (sum / weights - expected).abs() < 1e-5, "{j}: {sum} / {weights}, {expected}");
        }
    }

    #[test]
    fn constants_and_volumes_of_holes_alone() {
        let grid = Grid::new(UVec3::new(3, 3, 3), DVec3::ONE);
        assert!(exact(&grid, &[5.0; 27], 2.0, 2.0).unwrap().iter().all(|&c| (c - 5.0).abs() < 1e-12));
        assert!(exact(&grid, &[f64::NAN; 27], 2.0, 2.0).unwrap().iter().all(|c| c.is_nan()));
    }
}
