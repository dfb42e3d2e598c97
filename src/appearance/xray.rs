//! Opacity for summed projections.

use glam::DVec3;

use super::haze::constant;
use super::object::Object;
use super::quantile::quantiles;
use crate::settings::transfer_function::{Ramp, TransferFunction};
use crate::volume::{Grid, ValueSlice, Volume};

/// The fraction of rays that reach full brightness.
const SATURATED: f64 = 0.01;

/// White, with an opacity proportional to the value above the background's, such that the brightest rays along the volume's axes just
/// reach 1.
pub(super) fn transfer(volume: &Volume) -> TransferFunction {
    let values = volume.values();
    let Some(Object { background, ceiling, .. }) = Object::find(values) else {
        let longest = volume.dims().as_dvec3() * volume.grid().aspect();
        return constant(longest.max_element().recip());
    };
    let top = f64::from(values.iter().fold(f32::MIN, f32::max)).min(ceiling);
    let sums = ray_sums(volume.grid(), values, [background, top]);
    let brightest = quantiles((&sums).into(), |sum| sum > 0.0, [1.0 - SATURATED]).map_or(1.0, |[sum]| f64::from(sum));
    // A value that alone is brighter than those rays is white.
    let top = top.min(background + brightest);
    let opacity = ((top - background) / brightest).min(1.0);
    let color = Ramp::through(vec![(background, DVec3::ONE)]);
    TransferFunction::by_value(color, Ramp::through(vec![(background, 0.0), (top, opacity)]))
}

/// For all axis-parallel rays through voxels, the integral of the values above the background, none greater than the top, with lengths in
/// [`Grid::unit`]s.
fn ray_sums(grid: &Grid, values: ValueSlice<'_>, [background, top]: [f64; 2]) -> Vec<f32> {
    let [nx, ny, nz] = grid.dims.to_array().map(|n| n as usize);
    let mut sums = [vec![0.0; ny * nz], vec![0.0; nx * nz], vec![0.0; nx * ny]];
    for (row, values) in values.chunks(nx).enumerate() {
        let (y, z) = (row % ny, row / ny);
        for (x, value) in values.iter().enumerate() {
            // 0 in a hole, because `f64::max` ignores NaN.
            let above = (f64::from(value) - background).max(0.0).min(top - background);
            for (sums, at) in sums.iter_mut().zip([row, x + nx * z, x + nx * y]) {
                sums[at] += above;
            }
        }
    }
    let steps = grid.aspect().to_array();
    sums.iter().zip(steps).flat_map(|(sums, step)| sums.iter().map(move |sum| (sum * step) as f32)).collect()
}
