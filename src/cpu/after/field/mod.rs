//! The field of the voxels' values, and its gradient, at points of slab planes (SPEC §9), as in `reference::after::field`.
//!
//! A point gathers the voxels within the kernel's radius of it. Splatting them one by one gives the same sums, but a pixel that is opaque or
//! sees no matter would then be paid for too, and every voxel would read and write all planes in memory for every pixel: this is four times
//! slower (`benches/RESULTS.md`). [`cube`] does this for the 4×4×4 voxels around a point inside the volume, [`rows`] for any kernel at any point.

mod cube;
mod rows;

use std::f64::consts::LOG2_E;

pub(super) use cube::Weights;
use fearless_simd::f32x8;
use fearless_simd::prelude::*;
use glam::DVec3;

use super::colors::ColorsOf;
use super::differences::Differences;
use super::extent::{Extent, Held};
use super::low_pass::LowPass;
use super::planes::Points;
use crate::after::normalization::Normalization;
use crate::cpu::count::bits;
use crate::cpu::vector::{LANES, columns};
use crate::settings::shading::Gradient;
use crate::volume::{ValueSlice, Volume};

/// The minimum sum of weights of a point that has a value.
const MIN_WEIGHT: f32 = 1e-3;

/// The largest radius of kernels that reach no farther than the 4×4×4 voxels around a point.
const CUBE_RADIUS: f64 = 2.0;

/// The least scale of numbers by which sums are multiplied instead of values.
const MIN_SCALE: f64 = 1e-30;

/// What the field is made of.
#[derive(Clone, Copy, Debug)]
pub(super) struct Field<'a> {
    /// The voxels at hand.
    volume: &'a Volume,
    pub(super) extent: Extent,
    /// c for each of them, in memory order; NaN at holes.
    coefficients: ValueSlice<'a>,
    /// Those of the voxels' own colours, if they have any.
    colors: Option<ColorsOf<'a>>,
    /// The differences of the values, if they are kept.
    differences: Option<&'a Differences>,
    numbers: Normalization,
    radius: f64,
    radius_squared: f32,
    /// From |δ|² to the exponent of 2 of the Gaussian.
    exponent: f32,
    /// The range of numbers is from values less `base`, times `scale`.
    base: f32,
    scale: f32,
    gradient: Gradient,
    /// The length in world units that gradients are numbers per: a power of two, so that products with it round nothing, about as long as the smallest spacing,
    /// so that no spacing lets squares of gradients overflow.
    pub(super) gradient_length: f64,
    /// From differences of half numbers on either side to the gradient.
    per_spacing: [f32; 3],
    /// From `Σ (c - f)·g·δ / N` to the kernel's gradient.
    per_moment: [f32; 3],
    /// Whether 4×4×4 voxels are all that a kernel reaches, and sums of values less `base` cannot overflow.
    is_cube: bool,
}

/// The largest power of two that is at most a normal positive number.
fn power_of_two(number: f64) -> f64 {
    const EXPONENT: u64 = 0x7ff0_0000_0000_0000;
    f64::from_bits(number.to_bits() & EXPONENT)
}

impl<'a> Field<'a> {
    /// `extent` tells where in the volume the voxels at hand are.
    pub(super) fn new(
        (volume, extent): (&'a Volume, Extent),
        (coefficients, colors): (ValueSlice<'a>, Option<ColorsOf<'a>>),
        differences: Option<&'a Differences>,
        numbers: Normalization,
        (radius, falloff): (f64, f64),
        gradient: Gradient,
    ) -> Self {
        let gradient_length = power_of_two(volume.spacing().min_element());
        let spacing = volume.spacing() / gradient_length;
        let is_moderate = (MIN_SCALE..1.0 / MIN_SCALE).contains(&numbers.scale);
        let in_f32 = |numbers: DVec3| numbers.to_array().map(|number| number as f32);
        Self {
            volume,
            extent,
            coefficients,
            colors,
            differences,
            numbers,
            radius,
            radius_squared: (radius * radius) as f32,
            exponent: (-falloff * LOG2_E) as f32,
            base: numbers.base as f32,
            scale: numbers.scale as f32,
            gradient,
            gradient_length,
            per_spacing: in_f32(1.0 / spacing),
            per_moment: in_f32(-2.0 * falloff / spacing),
            is_cube: Self::is_narrow(radius) && is_moderate && extent.dims.min_element() as usize >= cube::SIDE,
        }
    }

    /// The field of other voxels of the same volume.
    #[inline(always)]
    pub(super) fn of<'b>(&self, held: &'b Held) -> Field<'b> {
        let volume = &held.volume;
        Field { volume, extent: held.extent, coefficients: volume.values(), colors: None, differences: None, ..*self }
    }

    /// Whether a kernel reaches no farther than the 4×4×4 voxels around a point.
    pub(super) fn is_narrow(radius: f64) -> bool {
        radius <= CUBE_RADIUS
    }

    /// The distance of voxels from a point that its value needs, by axis, where kernels reach some distance: those of its cube, too; and with
    /// `has_gradient` those that its gradient needs.
    pub(super) fn reach(&self, half_box: DVec3, has_gradient: bool) -> DVec3 {
        let of_value = half_box.ceil().max(DVec3::splat(cube::SIDE as f64 / 2.0));
        let is_difference = has_gradient && self.gradient != Gradient::Kernel;
        if is_difference { of_value + 1.0 } else { of_value }
    }

    /// The number of a coefficient.
    #[inline(always)]
    pub(super) fn number(&self, coefficient: f32) -> f32 {
        (coefficient - self.base) * self.scale
    }

    /// What is kept of a voxel, given its index.
    pub(super) fn read(&self, index: usize) -> (f32, Option<f32>) {
        (self.coefficients.at(index), self.differences.map(|differences| differences.at(3 * index)))
    }

    /// Whether voxels have colours of their own.
    pub(super) fn has_colors(&self) -> bool {
        self.colors.is_some()
    }

    /// Finds the weights of those of eight points of a plane that have a bit, in cubes as near as the volume's borders allow: voxels of a cube that the
    /// kernel does not reach have no weight. Returns what [`Weights::find`] does; `None` if kernels reach beyond cubes.
    // Twice in a program, which is faster, but once in a page, whose code must be short.
    #[cfg_attr(target_arch = "wasm32", inline(never))]
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    fn find_weights<S: Simd>(
        &self,
        simd: S,
        (points, low_pass): &(Points, LowPass),
        at: [usize; 2],
        lanes: u32,
        weights: &mut Weights,
    ) -> Option<[[f32; cube::SIDE]; LANES]> {
        if !(self.is_cube && low_pass.is_identity) {
            return None;
        }
        let cubes = points.eight(simd, &self.extent, [1, cube::SIDE as i32 - 1], at);
        Some(weights.find(simd, self, cubes, at, lanes))
    }

    /// f, as numbers, at those of eight points of a plane that have a bit; NaN where there is no value. `weights` are those that the plane keeps.
    #[inline(always)]
    pub(super) fn values<S: Simd>(
        &self,
        simd: S,
        of: &(Points, LowPass),
        [column, row]: [usize; 2],
        lanes: u32,
        weights: &mut Weights,
    ) -> [f32; LANES] {
        let mut values = [f32::NAN; LANES];
        let mut left = lanes;
        if let Some(sums) = self.find_weights(simd, of, [column, row], lanes, weights) {
            let (weight, sum) = (weights.totals(simd), cube::sums_of(simd, &sums) * self.scale);
            let has_value = weight.simd_ge(f32x8::splat(simd, MIN_WEIGHT));
            has_value.select(sum / weight, f32x8::splat(simd, f32::NAN)).store_array(&mut values);
            // Where the sum is not finite a hole is near.
            let is_finite = sum.abs().simd_le(f32x8::splat(simd, f32::MAX));
            left &= !(is_finite.to_bitmask() as u32);
        }
        for lane in bits(left.into()) {
            let lane = lane as usize;
            values[lane] = self.row_value(simd, of.0.of(column + lane, row), &of.1);
        }
        values
    }

    /// ∇f in numbers per world unit, by component, at those of eight points of a plane that have a bit.
    #[inline(always)]
    pub(super) fn gradients<S: Simd>(
        &self,
        simd: S,
        of: &(Points, LowPass),
        [column, row]: [usize; 2],
        lanes: u32,
        weights: &mut Weights,
    ) -> [[f32; LANES]; 3] {
        let mut gradients = [[0.0; LANES]; 3];
        let mut left = lanes;
        if weights.are_known([column, row], lanes)
            || self.find_weights(simd, of, [column, row], lanes, weights).is_some()
        {
            gradients = match self.gradient {
                Gradient::Kernel => self.cubes_moments(simd, weights, lanes),
                _ => self.cubes_differences(simd, weights, lanes),
            };
            // Where the sum is not finite a hole is near.
            let [x, y, z] = gradients.each_ref().map(|component| f32x8::load_array_ref(simd, component));
            let is_finite = (x + y + z).abs().simd_le(f32x8::splat(simd, f32::MAX));
            left &= !(is_finite.to_bitmask() as u32);
        }
        for lane in bits(left.into()) {
            let lane = lane as usize;
            let (at, low_pass) = (of.0.of(column + lane, row), &of.1);
            let gradient = match self.gradient {
                Gradient::Kernel => self.kernel_gradient(self.row_moments(simd, at, low_pass)),
                _ => self.row_differences(simd, at, low_pass),
            };
            (0..3).for_each(|axis| gradients[axis][lane] = gradient[axis]);
        }
        gradients
    }

    /// `Σ d·g / N` of the points that have a bit.
    #[inline(always)]
    fn cubes_differences<S: Simd>(&self, simd: S, weights: &Weights, lanes: u32) -> [[f32; LANES]; 3] {
        let mut sums = [[0.0; cube::SIDE]; LANES];
        for lane in bits(lanes.into()) {
            let lane = lane as usize;
            self.cube_differences(simd, weights, lane).store_array(&mut sums[lane]);
        }
        let [x, y, z, _] = columns(simd, sums.each_ref());
        let per_weight = f32x8::splat(simd, 0.5 * self.scale) / weights.totals(simd);
        let [per_x, per_y, per_z] = self.per_spacing;
        [x * per_weight * per_x, y * per_weight * per_y, z * per_weight * per_z].map(|of| of.to_array())
    }

    /// The kernel's gradients of the points that have a bit.
    #[inline(always)]
    fn cubes_moments<S: Simd>(&self, simd: S, weights: &Weights, lanes: u32) -> [[f32; LANES]; 3] {
        let per_weight = (1.0 / weights.totals(simd)).to_array();
        let mut gradients = [[0.0; LANES]; 3];
        for lane in bits(lanes.into()) {
            let lane = lane as usize;
            let gradient = self.kernel_gradient(self.cube_moments(simd, weights, lane, per_weight[lane]));
            (0..3).for_each(|axis| gradients[axis][lane] = gradient[axis]);
        }
        gradients
    }

    /// The kernel's gradient for `Σ (c - f)·g·δ / N`.
    #[inline(always)]
    fn kernel_gradient(&self, [x, y, z]: [f32; 3]) -> [f32; 3] {
        let [per_x, per_y, per_z] = self.per_moment;
        [x * per_x, y * per_y, z * per_z]
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use glam::{DVec2, DVec4, UVec3};

    use super::*;
    use crate::cpu::after::colors::Colors;
    use crate::cpu::simd::{chosen, dispatch};
    use crate::geometry::plane_geometry::PlaneGeometry;
    use crate::geometry::view_geometry::ViewGeometry;
    use crate::reference::after as twin;
    use crate::scene::{Scene, VolumeSource};
    use crate::settings::splatting::Interpolation;
    use crate::volume::{SampleType, Values};

    /// Numbers from 0 to 1.
    fn random(state: &mut u64) -> f64 {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*state >> 33) as f64 / (1_u64 << 31) as f64
    }

    /// The largest differences from the f64 evaluation of values, as numbers, and of gradients in numbers per voxel, over points in and around
    /// a volume; and how many points had values.
    fn worst(volume: &Volume, sets: &[&str], state: &mut u64) -> (f64, f64, u32) {
        let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
        let scene = Scene::from_volume(VolumeSource::Builtin("head:8".to_owned()), &sets).unwrap();
        let (splatting, grid) = (&scene.splatting, volume.grid());
        let numbers = Normalization::of(volume.values().iter()).unwrap();
        let kernel = (splatting.radius, splatting.falloff);
        let whole = (volume, Extent::whole(grid));
        let differences = Differences::new(volume).unwrap();
        let [ours, keeping] = [None, Some(&differences)].map(|differences| {
            Field::new(whole, (volume.values(), None), differences, numbers, kernel, scene.shading.gradient)
        });
        let expected = twin::Field::new(volume, &scene).unwrap();
        let view = ViewGeometry::new(grid, &scene.camera, splatting, [64, 64]).unwrap();
        let geometry = PlaneGeometry::new(&view, grid);
        let low_pass = LowPass::new(&geometry, 1.0);
        let [first, second, _] = geometry.axes;
        let step = |pixel: DVec2| {
            let along = [geometry.screen_axis, geometry.screen_axis.perp()].map(|axis| axis.dot(pixel));
            first * geometry.per_pixel.x * along[0] + second * geometry.per_pixel.y * along[1]
        };
        let twins = twin::low_pass::LowPass::new(step(DVec2::X), step(DVec2::Y));
        let (mut value_error, mut gradient_error, mut count) = (0.0_f64, 0.0_f64, 0);
        for _ in 0..300 {
            let place = DVec3::from([(); 3].map(|()| random(state)));
            let points = Points {
                first: place * (grid.dims.as_dvec3() + 3.0) - 2.0,
                right: (DVec3::from([(); 3].map(|()| random(state))) - 0.5) * 2.0,
                down: DVec3::ZERO,
            };
            for lane in 0..8 {
                let at = points.of(lane, 0);
                let of = (points, low_pass);
                let (number, [gradient, kept]) = dispatch!(chosen().unwrap().1, simd => {
                    let mut weights = Weights::new();
                    let numbers = ours.values(simd, &of, [0, 0], 1 << lane, &mut weights);
                    let gradient = |field: &Field<'_>, weights: &mut Weights| {
                        field.gradients(simd, &of, [0, 0], 1 << lane, weights).map(|component| component[lane])
                    };
                    (numbers[lane], [gradient(&ours, &mut weights), gradient(&keeping, &mut Weights::new())])
                });
                assert_eq!(kept.map(f32::to_bits), gradient.map(f32::to_bits), "{at} {sets:?}");
                let value = expected.value(at, &twins);
                assert_eq!(number.is_nan(), value.is_none(), "{at} {sets:?}");
                let Some(value) = value else { continue };
                value_error = value_error.max((f64::from(number) - numbers.apply(value)).abs());
                let theirs = expected.gradient(at, &twins) * numbers.scale;
                let error = (DVec3::from(gradient.map(f64::from)) / ours.gradient_length - theirs) * volume.spacing();
                assert!(error.is_finite(), "{at} {sets:?}");
                gradient_error = gradient_error.max(error.abs().max_element());
                count += 1;
            }
        }
        (value_error, gradient_error, count)
    }

    #[test]
    fn the_field_is_that_of_the_f64_evaluation() {
        let mut state = 1;
        let kernels: [&[&str]; 5] = [
            &[],
            &["splatting.falloff=1"],
            &["splatting.radius=1.3"],
            &["splatting.radius=3.2", "splatting.falloff=0.7"],
            // Pixels larger than voxels.
            &["camera.height=400"],
        ];
        for dims in [UVec3::new(12, 9, 11), UVec3::new(3, 12, 5)] {
            for holes in [false, true] {
                let value = |state: &mut u64| match random(state) {
                    hole if holes && hole < 0.05 => f32::NAN,
                    number => (1000.0 + 100.0 * number) as f32,
                };
                let values = (0..dims.element_product()).map(|_| value(&mut state)).collect();
                let volume = Volume::new("random", dims, DVec3::new(1.0, 0.5, 2.0), values).unwrap();
                for kernel in kernels {
                    for gradient in ["shading.gradient=differences", "shading.gradient=kernel"] {
                        let sets = [kernel, &[gradient]].concat();
                        let (values, gradients, count) = worst(&volume, &sets, &mut state);
                        assert!(values < 3e-6 && gradients < 2e-5, "{sets:?} of {dims}: {values} {gradients}");
                        assert!(count > 500, "{sets:?} of {dims}: only {count} points have values");
                    }
                }
            }
        }
    }

    /// Differences of whole numbers are kept as such where they fit in 16 bits, twice.
    #[test]
    fn the_field_of_whole_numbers_is_that_of_the_f64_evaluation() {
        let mut state = 3;
        let dims = UVec3::new(12, 9, 11);
        for (greatest, is_small) in [(16_383_u16, true), (16_384, false)] {
            // Neighbours that are as far apart as they can be, too.
            let mut value = || match random(&mut state) {
                extreme if extreme < 0.4 => greatest * u16::from(extreme < 0.2),
                number => (number * f64::from(greatest)) as u16,
            };
            let values: Vec<u16> = (0..dims.element_product()).map(|_| value()).collect();
            let volume = Volume::from_values("random", dims, DVec3::new(1.0, 0.5, 2.0), Values::U16(values)).unwrap();
            assert_eq!(matches!(Differences::new(&volume), Some(Differences::Small(_))), is_small);
            let (values, gradients, count) = worst(&volume, &["shading.gradient=differences"], &mut state);
            assert!(values < 3e-6 && gradients < 2e-5, "{values} {gradients}");
            assert!(count > 500, "only {count} points have values");
        }
    }

    #[test]
    fn colours_are_those_of_the_f64_evaluation() {
        let mut state = 7;
        let (dims, spacing) = (UVec3::new(11, 9, 10), DVec3::new(1.0, 0.5, 2.0));
        let color = |state: &mut u64| match random(state) {
            hole if hole < 0.05 => [f32::NAN; 4],
            _ => [(); 4].map(|()| (255.0 * random(state)).round() as f32),
        };
        let colors: Vec<[f32; 4]> = (0..dims.element_product()).map(|_| color(&mut state)).collect();
        let volume = Volume::from_colors("random", dims, spacing, (&colors, SampleType::U8)).unwrap();
        let numbers = Normalization::of(volume.values().iter()).unwrap();
        for (kernel, interpolation) in [
            ([2.0, 2.0], Interpolation::Smooth),
            ([3.2, 0.7], Interpolation::Smooth),
            ([2.0, 2.0], Interpolation::Exact),
        ] {
            let [radius, falloff] = kernel;
            let sets = [format!("splatting.radius={radius}"), format!("splatting.falloff={falloff}")];
            let mut scene = Scene::from_volume(VolumeSource::Builtin("head:8".to_owned()), &sets).unwrap();
            scene.splatting.interpolation = interpolation;
            let own = Colors::new(&volume, interpolation == Interpolation::Exact, (radius, falloff)).unwrap().unwrap();
            let coefficients = (volume.values(), own.of(&volume));
            let whole = (&volume, Extent::whole(volume.grid()));
            let ours = Field::new(whole, coefficients, None, numbers, (radius, falloff), Gradient::Differences);
            let theirs = twin::Field::new(&volume, &scene).unwrap();
            let view = ViewGeometry::new(volume.grid(), &scene.camera, &scene.splatting, [512, 512]).unwrap();
            let low_pass = LowPass::new(&PlaneGeometry::new(&view, volume.grid()), 1.0);
            let twins = twin::low_pass::LowPass::new(DVec3::ZERO, DVec3::ZERO);
            assert!(low_pass.is_identity);
            let (mut largest, mut count) = (0.0_f64, 0);
            for _ in 0..500 {
                let at = DVec3::from([(); 3].map(|()| random(&mut state))) * (dims.as_dvec3() + 1.0) - 1.0;
                if theirs.value(at, &twins).is_none() {
                    continue;
                }
                let expected = theirs.color(at, &twins).unwrap();
                let actual = dispatch!(chosen().unwrap().1, simd => ours.color(simd, (at, &low_pass)));
                largest = largest.max((DVec4::from(actual.map(f64::from)) - expected).abs().max_element());
                count += 1;
            }
            assert!(largest < 3e-6 && count > 300, "{kernel:?} {interpolation:?}: {largest} at {count} points");
        }
    }
}
