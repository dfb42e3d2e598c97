//! Coefficients whose field has every voxel's value at that voxel: `splatting.interpolation = "exact"` (SPEC §9).
//!
//! At voxel j the field is `Σ g(i-j)·c_i / N_j`, so the coefficients solve `G·c = N·v` with `G_ij = g(i-j)` over all voxels but holes. Kernels are
//! cut off at a sphere; where its voxels form a cube, for radii above √3 and at most 2, G is a product of three matrices along the
//! axes, each with three diagonals, and is solved along every line by two sweeps, forwards and backwards: a recursive filter (Thomas's algorithm). With other
//! radii, and with holes, conjugate gradients solve it. The sweeps need 4 bytes per voxel beside the result, conjugate gradients 16.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use glam::{IVec3, UVec3};

use crate::error::RenderError;
use crate::error::setting::SettingError;
use crate::parallel::prelude::*;
use crate::volume::{Grid, Texel, ValueSlice, Volume};

/// The maximum error of the field at the voxels, relative to the values' range; SPEC §9 asks for 1e-5.
const TOLERANCE: f64 = 2e-6;

/// The number of steps after which conjugate gradients give up. Valid settings need at most about 200.
const MAX_STEPS: u32 = 2000;

/// The radii at which a kernel holds the 27 voxels around its own and no others.
const CUBE: std::ops::RangeInclusive<f64> = 1.732_050_807_568_878..=2.0;

/// The target of the log's records that tell the progress: "WHAT: N %", in the end 100 %. The program shows them as a line on the terminal.
pub const PROGRESS: &str = "sheetsplat::progress";

/// The last solutions, so that a volume that is read again is not solved again. A volume keeps its own as long as it lives.
static SOLVED: Mutex<Solutions> = Mutex::new(Solutions { last: VecDeque::new(), max_bytes: 128 << 20 });

/// The solutions that were used last, most recent first. Together they take at most `max_bytes`.
#[derive(Debug)]
struct Solutions {
    last: VecDeque<(Fingerprint, Arc<[f32]>)>,
    max_bytes: usize,
}

/// A hash of values, their grid's dimensions, and the kernel: all that the solution depends on.
type Fingerprint = blake3::Hash;

impl Solutions {
    fn get(&mut self, fingerprint: Fingerprint) -> Option<Arc<[f32]>> {
        let place = self.last.iter().position(|(of, _)| *of == fingerprint)?;
        let found = self.last.remove(place)?;
        let coefficients = Arc::clone(&found.1);
        self.last.push_front(found);
        Some(coefficients)
    }

    fn insert(&mut self, fingerprint: Fingerprint, coefficients: &Arc<[f32]>) {
        let bytes_of = |coefficients: &Arc<[f32]>| size_of_val::<[f32]>(coefficients);
        if bytes_of(coefficients) > self.max_bytes {
            return;
        }
        // Of threads that solved the same, the last one's is kept.
        self.last.retain(|(of, _)| *of != fingerprint);
        self.last.push_front((fingerprint, Arc::clone(coefficients)));
        let mut bytes = 0;
        let max_bytes = self.max_bytes;
        self.last.retain(|(_, coefficients)| {
            bytes += bytes_of(coefficients);
            bytes <= max_bytes
        });
    }
}

fn fingerprint(grid: &Grid, values: ValueSlice<'_>, (radius, falloff): (f64, f64)) -> Fingerprint {
    let mut hasher = blake3::Hasher::new();
    grid.dims.to_array().iter().for_each(|n| _ = hasher.update(&n.to_le_bytes()));
    [radius, falloff].iter().for_each(|x| _ = hasher.update(&x.to_le_bytes()));
    values.chunks(1 << 14).for_each(|chunk| _ = hasher.update(bytemuck::cast_slice(&chunk.to_vec())));
    hasher.finalize()
}

/// The coefficients of a volume's values, which the volume keeps, and the process for a while. The log's target [`PROGRESS`] gets the progress.
///
/// # Errors
/// As for [`exact`].
pub fn of_volume(volume: &Volume, kernel: (f64, f64)) -> Result<Arc<[f32]>, RenderError> {
    volume.coefficients(kernel, || {
        solved(volume.grid(), volume.values(), kernel, &|share| {
            log::info!(target: PROGRESS, "coefficients of splatting.interpolation = \"exact\": {:.0} %", 100.0 * share);
        })
    })
}

/// The coefficients of the colours of a volume's voxels, red, green, blue and A (SPEC §10); NaN at holes. `None` if voxels have none of their own.
///
/// # Errors
/// As for [`exact`].
pub fn of_colors(volume: &Volume, kernel: (f64, f64)) -> Result<Option<Arc<[[f32; 4]]>>, RenderError> {
    let Some(texels) = volume.colors() else { return Ok(None) };
    let mut colors = vec![[0.0; 4]; texels.len()];
    for component in 0..4 {
        let own = |(texel, value): (&Texel, f32)| {
            if value.is_nan() { f32::NAN } else { f32::from(texel[component]) / f32::from(u16::MAX) }
        };
        let numbers: Vec<f32> = texels.par_iter().zip(volume.values().par_iter()).map(own).numbers();
        let exact = solved(volume.grid(), (&numbers).into(), kernel, &|share| {
            let percent = 25.0 * (component as f64 + share);
            log::info!(target: PROGRESS, "coefficients of the voxels' colours: {percent:.0} %");
        })?;
        colors.par_iter_mut().zip(exact.par_iter()).for_each(|(color, &number)| color[component] = number);
    }
    Ok(Some(colors.into()))
}

/// The same as [`exact`] gives, from the process's last solutions if they have it.
///
/// # Errors
/// As for [`exact`].
pub fn solved(
    grid: &Grid,
    values: ValueSlice<'_>,
    kernel: (f64, f64),
    progress: &dyn Fn(f64),
) -> Result<Arc<[f32]>, RenderError> {
    // A page reads no volume twice.
    if cfg!(target_arch = "wasm32") {
        return Ok(exact(grid, values, kernel, progress)?.into());
    }
    let fingerprint = fingerprint(grid, values, kernel);
    let solutions = || SOLVED.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(known) = solutions().get(fingerprint) {
        progress(1.0);
        return Ok(known);
    }
    let coefficients = exact(grid, values, kernel, progress)?.into();
    solutions().insert(fingerprint, &coefficients);
    Ok(coefficients)
}

/// The coefficients of values on a grid; NaN at holes, where values are NaN. Calls `progress` with the fraction that is done, in the end 1.
///
/// # Errors
/// If the iteration does not converge, because rounding is too coarse for values whose range is tiny compared with their size.
pub fn exact(
    grid: &Grid,
    values: ValueSlice<'_>,
    (radius, falloff): (f64, f64),
    progress: &dyn Fn(f64),
) -> Result<Vec<f32>, RenderError> {
    let ends = values.iter().fold([f32::INFINITY, f32::NEG_INFINITY], |[min, max], v| [min.min(v), max.max(v)]);
    let [min, max] = ends.map(f64::from);
    if radius <= 1.0 || min >= max || min > max {
        // Each voxel is alone in its kernel, or all values are equal, or there are only holes.
        progress(1.0);
        return Ok(values.to_vec());
    }
    // The coefficients of a constant are that constant, so values can be shifted to around 0, where rounding is finest.
    let middle = ((min + max) / 2.0) as f32;
    let has_holes = values.iter().any(f32::is_nan);
    let moved = if CUBE.contains(&radius) && !has_holes {
        along_axes(grid.dims, values, middle, falloff, progress)
    } else {
        let tolerance = TOLERANCE * (max - min);
        let moved = conjugate_gradients(grid, values, middle, &Taps::new(radius, falloff), tolerance, progress);
        moved.ok_or_else(|| {
            let (key, found) = ("splatting.interpolation", "\"exact\" for values that it does not converge for");
            SettingError::new(key, found, "\"smooth\", or a larger splatting.falloff")
        })?
    };
    progress(1.0);
    let back = |(c, value): (&f32, f32)| if value.is_nan() { f32::NAN } else { c + middle };
    Ok(moved.par_iter().zip(values.par_iter()).map(back).numbers())
}

/// The solution if G is a product: `N·v`, then one axis after the other.
fn along_axes(dims: UVec3, values: ValueSlice<'_>, middle: f32, falloff: f64, progress: &dyn Fn(f64)) -> Vec<f32> {
    let neighbour = libm::exp(-falloff);
    let [nx, ny, nz] = dims.to_array().map(|n| n as usize);
    let filters = [nx, ny, nz].map(|n| Sweeps::new(n, neighbour));
    let mut c: Vec<f32> = values.par_iter().map(|value| value - middle).numbers();
    // N is a product too: the rows along each axis can be multiplied by their sums right before they are solved.
    c.par_chunks_mut(nx).for_each(|row| filters[0].solve(row, 1, 0));
    progress(0.3);
    c.par_chunks_mut(nx * ny).for_each(|slice| (0..nx).for_each(|x| filters[1].solve(slice, nx, x)));
    progress(0.6);
    // Lines along z pass through all slices, so a row of them at a time is copied together.
    let rows: Vec<Vec<f32>> = (0..ny)
        .into_par_iter()
        .map(|y| {
            let row = |z: usize| &c[(z * ny + y) * nx..][..nx];
            let mut lines: Vec<f32> = (0..nz).flat_map(row).copied().collect();
            (0..nx).for_each(|x| filters[2].solve(&mut lines, nx, x));
            lines
        })
        .collect();
    c.par_chunks_mut(nx).enumerate().for_each(|(at, row)| {
        let (y, z) = (at % ny, at / ny);
        row.copy_from_slice(&rows[y][z * nx..][..nx]);
    });
    c
}

/// Two sweeps along a line, forwards and backwards: the solution of a system with 1 on its diagonal and `neighbour` beside it.
struct Sweeps {
    neighbour: f64,
    /// The sums of the matrix's rows.
    sums: Vec<f64>,
    /// One over the diagonal after elimination.
    pivots: Vec<f64>,
}

impl Sweeps {
    fn new(count: usize, neighbour: f64) -> Self {
        let sum = |at: usize| 1.0 + neighbour * (f64::from(u8::from(at > 0)) + f64::from(u8::from(at + 1 < count)));
        let mut pivots = vec![1.0; count];
        for at in 1..count {
            pivots[at] = 1.0 / (1.0 - neighbour * neighbour * pivots[at - 1]);
        }
        Self { neighbour, sums: (0..count).map(sum).collect(), pivots }
    }

    /// Replaces every `stride`-th number, from `first` on, by the solution.
    fn solve(&self, line: &mut [f32], stride: usize, first: usize) {
        let Self { neighbour, sums, pivots } = self;
        let mut solved = Vec::with_capacity(sums.len());
        let mut before = 0.0;
        for (at, (sum, pivot)) in sums.iter().zip(pivots).enumerate() {
            before = (sum * f64::from(line[first + at * stride]) - neighbour * before) * pivot;
            solved.push(before);
        }
        let mut after = 0.0;
        for at in (0..solved.len()).rev() {
            after = solved[at] - neighbour * pivots[at] * after;
            line[first + at * stride] = after as f32;
        }
    }
}

/// Hestenes and Stiefel's method (1952): G is symmetric, and the settings ensure that it is positive definite. `None` if it does not converge.
fn conjugate_gradients(
    grid: &Grid,
    values: ValueSlice<'_>,
    middle: f32,
    taps: &Taps,
    tolerance: f64,
    progress: &dyn Fn(f64),
) -> Option<Vec<f32>> {
    let is_hole: Vec<bool> = values.par_iter().map(|value| value.is_nan()).numbers();
    let moved: Vec<f32> = values.par_iter().map(|value| if value.is_nan() { 0.0 } else { value - middle }).numbers();
    let present: Vec<f32> = is_hole.par_iter().map(|&is_hole| if is_hole { 0.0 } else { 1.0 }).numbers();
    let weights = taps.convolve(grid, &present, &is_hole);
    let first = taps.convolve(grid, &moved, &is_hole);
    let mut residual: Vec<f32> =
        (weights.par_iter().zip(&moved).zip(&first)).map(|((weight, value), first)| weight * value - first).numbers();
    let mut c = moved;
    let mut direction = residual.clone();
    let mut squared = dot(&residual, &residual);
    let error = |residual: &[f32]| {
        let errors = residual.par_iter().zip(&weights).filter(|(_, weight)| **weight > 0.0);
        f64::from(errors.map(|(residual, weight)| (residual / weight).abs()).reduce(|| 0.0, f32::max))
    };
    let begin = error(&residual).max(f64::MIN_POSITIVE);
    for _ in 0..MAX_STEPS {
        let left = error(&residual);
        if left <= tolerance {
            return Some(c);
        }
        // The error falls by about the same factor in every step.
        progress((libm::log(begin / left) / libm::log(begin / tolerance)).clamp(0.0, 1.0));
        let image = taps.convolve(grid, &direction, &is_hole);
        let step = squared / dot(&direction, &image);
        c.par_iter_mut().zip(&direction).for_each(|(c, direction)| *c += step as f32 * direction);
        residual.par_iter_mut().zip(&image).for_each(|(residual, image)| *residual -= step as f32 * image);
        let before = std::mem::replace(&mut squared, dot(&residual, &residual));
        let share = (squared / before) as f32;
        direction
            .par_iter_mut()
            .zip(&residual)
            .for_each(|(direction, residual)| *direction = residual + share * *direction);
    }
    None
}

/// The scalar product, summed in the same order in every run.
fn dot(a: &[f32], b: &[f32]) -> f64 {
    const CHUNK: usize = 1 << 16;
    let of_chunk = |(a, b): (&[f32], &[f32])| a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum::<f64>();
    a.par_chunks(CHUNK).zip(b.par_chunks(CHUNK)).map(of_chunk).collect::<Vec<f64>>().iter().sum()
}

/// The discrete kernel: offsets and weights.
struct Taps(Vec<(IVec3, f32)>);

impl Taps {
    fn new(radius: f64, falloff: f64) -> Self {
        let reach = radius.ceil() as i32;
        let offsets = (-reach..=reach).flat_map(|z| (-reach..=reach).map(move |y| (y, z)));
        let offsets = offsets.flat_map(|(y, z)| (-reach..=reach).map(move |x| IVec3::new(x, y, z)));
        let weighted = offsets.map(|offset| (offset, offset.as_dvec3().length_squared()));
        let within = weighted.filter(|(_, squared)| *squared < radius * radius);
        Self(within.map(|(offset, squared)| (offset, libm::exp(-falloff * squared) as f32)).collect())
    }

    /// `G·c`, 0 at holes, where c is 0, too.
    fn convolve(&self, grid: &Grid, c: &[f32], is_hole: &[bool]) -> Vec<f32> {
        let dims = grid.dims.as_ivec3();
        let [nx, ny] = [dims.x as usize, dims.y as usize];
        let mut sums = vec![0.0_f32; c.len()];
        sums.par_chunks_mut(nx).enumerate().for_each(|(row, sums)| {
            let (y, z) = ((row % ny) as i32, (row / ny) as i32);
            for &(offset, weight) in &self.0 {
                let (from_y, from_z) = (y + offset.y, z + offset.z);
                if !(0..dims.y).contains(&from_y) || !(0..dims.z).contains(&from_z) {
                    continue;
                }
                let (first, end) = ((-offset.x).max(0), (dims.x - offset.x).min(dims.x));
                if first >= end {
                    continue;
                }
                let from = (from_z as usize * ny + from_y as usize) * nx;
                let source = &c[from + (first + offset.x) as usize..from + (end + offset.x) as usize];
                let target = &mut sums[first as usize..end as usize];
                target.iter_mut().zip(source).for_each(|(sum, c)| *sum += weight * c);
            }
            sums.iter_mut().zip(&is_hole[row * nx..]).filter(|(_, is_hole)| **is_hole).for_each(|(sum, _)| *sum = 0.0);
        });
        sums
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::reference::after::coefficients::exact as twin;

    /// By sweeps and by conjugate gradients, without holes and with them, in volumes as thin as a voxel too.
    #[test]
    fn coefficients_are_the_twins() {
        for (dims, holes) in [([9, 8, 7], false), ([9, 8, 7], true), ([6, 1, 5], false), ([1, 1, 1], false)] {
            let grid = Grid::new(UVec3::from(dims), DVec3::ONE);
            let value = |index: u32| match index * 7919 % 31 {
                3 if holes => f32::NAN,
                rest => 1000.0 + (rest * rest) as f32,
            };
            let values: Vec<f32> = (0..grid.dims.element_product()).map(value).collect();
            for kernel in [(2.0, 2.0), (2.0, 1.0), (1.8, 1.0), (1.5, 2.0), (3.0, 1.5), (1.0, 2.0)] {
                let ours = exact(&grid, (&values).into(), kernel, &|_| {}).unwrap();
                let in_f64: Vec<f64> = values.iter().map(|&value| value.into()).collect();
                let expected = twin(&grid, &in_f64, kernel.0, kernel.1).unwrap();
                for (ours, expected) in ours.iter().zip(expected) {
                    let same = ours.is_nan() && expected.is_nan() || (f64::from(*ours) - expected).abs() < 0.05;
                    assert!(same, "{dims:?} {kernel:?}: {ours}, not {expected}");
                }
            }
        }
    }

    /// SPEC §9: the field is the value at every voxel but holes, to 1e-5 of the values' range; at borders, at corners and beside holes too.
    #[test]
    fn the_field_is_the_value_at_every_voxel() {
        let grid = Grid::new(UVec3::new(11, 9, 8), DVec3::ONE);
        let kernels = [
            (2.0, 2.0),
            (2.0, 1.0),
            (2.0, 0.95),
            (1.8, 1.5),
            (1.0, 0.3),
            (1.5, 3.0),
            (3.2, 1.1),
            (4.0, 1.0),
            (4.0, 11.0),
        ];
        for (kernel, holes) in kernels.into_iter().flat_map(|kernel| [false, true].map(|holes| (kernel, holes))) {
            let value = |index: u32| match index.wrapping_mul(2_654_435_761) >> 24 {
                0..12 if holes => f32::NAN,
                noise => noise as f32 * 16.0 - 1000.0,
            };
            let values: Vec<f32> = (0..grid.dims.element_product()).map(value).collect();
            let coefficients = exact(&grid, (&values).into(), kernel, &|_| {}).unwrap();
            let (radius, falloff) = kernel;
            let mut worst = 0.0_f64;
            for (index, &value) in (0..).zip(&values).filter(|(_, value)| !value.is_nan()) {
                let at = grid.voxel_at(index).as_dvec3();
                let (mut sum, mut weights) = (0.0, 0.0);
                for (other, &c) in (0..).zip(&coefficients).filter(|(_, c)| !c.is_nan()) {
                    let squared = grid.voxel_at(other).as_dvec3().distance_squared(at);
                    if squared < radius * radius {
                        let weight = (-falloff * squared).exp();
                        sum += weight * f64::from(c);
                        weights += weight;
                    }
                }
                worst = worst.max((sum / weights - f64::from(value)).abs());
            }
            let (min, max) = values.iter().fold((f32::MAX, f32::MIN), |(a, b), &v| (a.min(v), b.max(v)));
            let range = f64::from(max) - f64::from(min);
            assert!(worst <= 1e-5 * range, "{kernel:?}, holes {holes}: {worst} of {range}");
        }
    }

    #[test]
    fn volumes_that_are_read_again_are_not_solved_again() {
        let grid = Grid::new(UVec3::new(5, 6, 7), DVec3::ONE);
        let values: Vec<f32> = (0..210).map(|index| ((index * 31) % 17) as f32).collect();
        let solve = |values: &[f32], kernel| {
            let steps = std::cell::Cell::new(0);
            let solution = solved(&grid, values.into(), kernel, &|share| {
                steps.set(steps.get() + 1);
                assert!(share <= 1.0);
            });
            (solution.unwrap(), steps.get())
        };
        let (first, steps) = solve(&values, (2.0, 1.25));
        assert!(steps > 1, "{steps}");
        let (again, steps) = solve(&values.clone(), (2.0, 1.25));
        assert!(Arc::ptr_eq(&first, &again) && steps == 1, "{steps}");
        assert!(!Arc::ptr_eq(&first, &solve(&values, (2.0, 1.5)).0), "another kernel");
        let mut changed = values.clone();
        changed[100] += 1.0;
        assert!(!Arc::ptr_eq(&first, &solve(&changed, (2.0, 1.25)).0), "another value");
    }

    #[test]
    fn the_last_solutions_stay_as_long_as_they_fit() {
        let mut solutions = Solutions { last: VecDeque::new(), max_bytes: 100 };
        let keys = [1_u8, 2, 3, 4].map(|key| blake3::hash(&[key]));
        let ten: Arc<[f32]> = vec![0.0; 10].into();
        keys[..3].iter().for_each(|&key| solutions.insert(key, &ten));
        assert!(solutions.get(keys[0]).is_none() && solutions.get(keys[1]).is_some());
        // The one that was asked for last stays.
        solutions.insert(keys[0], &ten);
        assert!(solutions.get(keys[1]).is_some() && solutions.get(keys[2]).is_none());
        let large: Arc<[f32]> = vec![0.0; 26].into();
        solutions.insert(keys[3], &large);
        assert!(solutions.get(keys[3]).is_none() && solutions.get(keys[1]).is_some());
    }
}
