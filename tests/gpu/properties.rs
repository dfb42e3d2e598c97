//! Properties that every image must have, whatever the volume, tested on whole frames.

use std::f64::consts::TAU;

use glam::{DVec3, UVec3};
use sheetsplat::headless::GpuHeadless;
use sheetsplat::image::Image;
use sheetsplat::internals::view_geometry::ViewGeometry;
use sheetsplat::scene::Scene;
use sheetsplat::settings::{Classification, Compositing, Gradient, Order, Projection, Ramp};
use sheetsplat::volume::{Volume, builtin};

use crate::common::cases::{in_turns, pairs};
use crate::common::compare::{assert_at_most, largest};
use crate::common::devices::{DRAWINGS, Drawing, drawn_forms, gpu, new_gpu};
use crate::common::images::largest_difference;
use crate::common::{COMPOSITINGS, F16, F32, Random, camera, scene, transfer};

fn render(drawing: Drawing, gpu: &GpuHeadless, volume: &Volume, scene: &Scene) -> (Image, u64) {
    let rendering = drawing.render(gpu, volume, scene);
    (rendering.image, rendering.stats.counts.sheets)
}

/// Alpha, row by row.
fn alpha(image: &Image) -> Vec<f64> {
    image.pixels.iter().map(|pixel| pixel[3].into()).collect()
}

/// A small head, semi-transparent, from an oblique direction.
fn head() -> (Volume, Scene) {
    let volume = builtin::volume("head:32").unwrap();
    let mut scene = scene(96, 80);
    scene.camera.direction = DVec3::new(0.4, 0.9, -0.3);
    scene.channels[0].transfer =
        transfer(&[(40.0, [0.9, 0.6, 0.4]), (255.0, [1.0, 1.0, 0.9])], &[(30.0, 0.0), (120.0, 0.3)]);
    (volume, scene)
}

#[test]
fn empty_volume_is_exactly_the_background() {
    let gpu = gpu();
    let (volume, mut scene) = head();
    let visible = scene.channels[0].transfer.clone();
    let transparent = transfer(&[(0.0, [1.0, 0.5, 0.2])], &[(0.0, 0.0)]);
    let mut excluded = visible.clone();
    excluded.iso_ranges = Some(vec![[1000.0, 2000.0]]);
    let elsewhere = DVec3::new(1e4, 0.0, 0.0);
    let cases = [(transparent, DVec3::ZERO), (excluded, DVec3::ZERO), (visible, elsewhere)];
    let orders = [Order::FrontToBack, Order::BackToFront];
    for (number, (transfer, center)) in cases.into_iter().enumerate() {
        (scene.channels[0].transfer, scene.camera.center) = (transfer, Some(center));
        for (compositing, order) in (number..)
            .zip(COMPOSITINGS)
            .flat_map(|(turn, compositing)| in_turns(turn, orders).into_iter().map(move |order| (compositing, order)))
        {
            (scene.splatting.compositing, scene.splatting.order) = (compositing, order);
            if scene.splatting.check().is_err() {
                continue;
            }
            for background in [[0.0, 0.0, 0.0, 1.0], [0.3, 0.7, 1.0, 1.0], [0.3, 0.7, 1.0, 0.6], [1.0, 1.0, 1.0, 0.0]] {
                scene.image.background = background;
                let [r, g, b, a] = background;
                let expected = [r * a, g * a, b * a, a].map(|channel| channel as f32);
                for drawing in DRAWINGS {
                    let (image, _) = render(drawing, gpu, &volume, &scene);
                    assert!(
                        image.pixels.iter().all(|pixel| *pixel == expected),
                        "{drawing:?} {compositing:?} {order:?} {background:?} {center}"
                    );
                }
            }
        }
    }
}

/// A uniform slab, `layers` voxels thick along one axis and wide along the others, cut out of space by sampling: every ray near its middle runs
/// through `layers` times the spacing, divided by the cosine, of the same material.
struct UniformSlab {
    axis: usize,
    layers: u32,
    /// World units, the smallest of them 1, so that world lengths are in `unit`s.
    spacing: DVec3,
}

impl UniformSlab {
    /// The number of voxels along the other axes, enough for the middle of the image to show no borders.
    const WIDTH: u32 = 88;
    /// The opacity per unit length, and the amount that it corresponds to.
    const OPACITY: f64 = 0.07;

    fn volume(&self) -> Volume {
        let mut dims = UVec3::splat(Self::WIDTH);
        dims[self.axis] = self.layers;
        // Where voxels are far apart, fewer of them make borders of the same width.
        for axis in (0..3).filter(|&axis| axis != self.axis) {
            dims[axis] = (f64::from(Self::WIDTH) / self.spacing[axis]).ceil() as u32 + 8;
        }
        Volume::new("slab", dims, self.spacing, vec![1.0; dims.element_product() as usize]).unwrap()
    }

    /// µL of SPEC §5: the amount per unit length times the length of a ray.
    fn depth(&self, direction: DVec3) -> f64 {
        let length = f64::from(self.layers) * self.spacing[self.axis] / direction.normalize()[self.axis].abs();
        -(1.0 - Self::OPACITY).ln() * length
    }

    /// Checks that every ray of the image enters and leaves the slab farther from its borders than a kernel reaches.
    fn assert_shows_no_border(&self, volume: &Volume, scene: &Scene) {
        let view =
            ViewGeometry::new(volume.grid(), &scene.camera, &scene.splatting, [scene.image.width, scene.image.height])
                .unwrap();
        let (basis, reach) = (view.basis, scene.splatting.radius * self.spacing);
        let half = volume.grid().center() * self.spacing;
        let height = scene.camera.orthographic_height(volume.grid(), 2.0, 1, 1).unwrap();
        for (right, up) in [(-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5), (0.5, 0.5)] {
            for side in [-1.0, 1.0] {
                let p = (basis.u * right + basis.v * up) * height;
                let to_face = side * (half[self.axis] + reach[self.axis]) - p[self.axis];
                let at_face = p + basis.w * (to_face / basis.w[self.axis]);
                for axis in (0..3).filter(|&axis| axis != self.axis) {
                    assert!(at_face[axis].abs() < half[axis] - reach[axis], "{at_face} of {half}: {:?}", basis.w);
                }
            }
        }
    }

    fn check(&self, gpu: &GpuHeadless, drawing: Drawing, direction: DVec3, slab_width: f64) {
        const SIZE: u32 = 48;
        let volume = self.volume();
        let mut scene = scene(SIZE, SIZE);
        scene.camera = camera(direction.to_array(), 0.4 * f64::from(SIZE));
        if direction.normalize().dot(scene.camera.up).abs() > 0.99 {
            scene.camera.up = DVec3::Y;
        }
        scene.image.background = [0.0; 4];
        scene.shading.enabled = false;
        scene.channels[0].transfer = transfer(&[(0.0, [0.2, 0.5, 0.9])], &[(0.0, Self::OPACITY)]);
        scene.splatting.compositing = Compositing::Exponential;
        scene.splatting.slab_width = slab_width;
        self.assert_shows_no_border(&volume, &scene);
        let (image, _) = render(drawing, gpu, &volume, &scene);

        let expected = self.depth(direction);
        // The mean over whole periods of the lattice: a window without edges suppresses ripples that fit into it several times.
        let hann = |i: u32| 1.0 - (TAU * (f64::from(i) + 0.5) / f64::from(SIZE)).cos();
        let (mut weights, mut mean_alpha, mut mean_depth) = (0.0, 0.0, 0.0);
        for (i, alpha) in (0..).zip(alpha(&image)) {
            let depth = -(-alpha).ln_1p();
            // The kernel's ripple: a Gaussian of falloff 2 leaves 2·exp(-π²/2) = 1.4 % per axis of a cubic lattice.
            assert_at_most((depth / expected - 1.0).abs(), 0.04, format_args!("{direction} pixel {i}"));
            let weight = hann(i % SIZE) * hann(i / SIZE);
            weights += weight;
            mean_alpha += weight * alpha;
            mean_depth += weight * depth;
        }
        // Amounts are rounded to f16 in either direction.
        let (alpha, depth) = (mean_alpha / weights, mean_depth / weights);
        let expected_alpha = 1.0 - (-expected).exp();
        let name =
            format!("axis {}, spacing {}, direction {direction}, slab width {slab_width}", self.axis, self.spacing);
        assert_at_most((alpha / expected_alpha - 1.0).abs(), 1.4e-4, format_args!("{name}: alpha"));
        assert_at_most((depth / expected - 1.0).abs(), 1e-4, format_args!("{name}: depth"));
    }
}

#[test]
fn uniform_slab_opacity_is_that_of_its_thickness() {
    let gpu = gpu();
    for drawing in DRAWINGS {
        let mut random = Random(17);
        for (spacing, axis) in [DVec3::ONE, DVec3::new(1.0, 1.0, 5.0)].into_iter().flat_map(|s| [0, 2].map(|a| (s, a)))
        {
            let slab = UniformSlab { axis, layers: 4, spacing };
            for slab_width in [1.0, 1.0, 1.0, 0.5, 1.7] {
                // Any direction that is not so flat along the slab that its borders become visible.
                let direction = loop {
                    let direction = random.direction();
                    if direction[axis].abs() > 0.75 {
                        break direction;
                    }
                };
                slab.check(gpu, drawing, direction, slab_width);
            }
            slab.check(gpu, drawing, DVec3::AXES[axis], 1.0);
        }
    }
}

#[test]
fn exponential_alpha_does_not_depend_on_the_slab_width() {
    let gpu = gpu();
    for (spacing, drawing) in [DVec3::ONE, DVec3::new(1.0, 1.0, 5.0)]
        .into_iter()
        .flat_map(|spacing| DRAWINGS.map(|drawing| (spacing, drawing)))
    {
        let (volume, mut scene) = head();
        let volume = volume.with_spacing("head", spacing).unwrap();
        scene.splatting.compositing = Compositing::Exponential;
        // With thinner sheets pixels become opaque at other sheets.
        scene.splatting.culling = false;
        scene.image.background = [0.0; 4];
        let reference = alpha(&render(drawing, gpu, &volume, &scene).0);
        assert!(reference.iter().any(|alpha| (0.3..0.9).contains(alpha)) && reference.contains(&0.0));
        for slab_width in [0.25, 0.37, 0.5, 2.0, 3.1, 4.0] {
            scene.splatting.slab_width = slab_width;
            let (image, sheets) = render(drawing, gpu, &volume, &scene);
            // Planes and depths are f32, below 32 here, so the far plane of a slab and the near plane of the next one leave a gap, or
            // overlap, by up to a step of 2⁻¹⁹. There is one plane per slab width, each attenuated by what lies before it, and two
            // roundings per sheet.
            let step = 2.0_f64.powi(-19);
            let finest = slab_width.min(1.0);
            let all = 2.0 * step / finest + 4.0 * F32 * sheets as f64;
            // The errors have either sign and never occur all at once.
            let tolerance = 0.15 * all;
            let worst = largest(alpha(&image).iter().zip(&reference).map(|(a, b)| a - b));
            assert_at_most(worst, tolerance, format_args!("{drawing:?} {slab_width}, spacing {spacing}"));
        }
    }
}

#[test]
fn back_to_front_equals_front_to_back() {
    let gpu = gpu();
    let (volume, mut scene) = head();
    // Nothing is culled back to front.
    scene.splatting.culling = false;
    // Close by in perspective, footprints of nearer sections reach onto the screen where farther ones do not.
    let close = Projection::Perspective { fov_y: 50.0, distance: Some(45.0), near: None };
    let projections = [scene.camera.projection, close];
    let forms: Vec<_> = drawn_forms().collect();
    for [compositing, drawn, projection] in pairs([COMPOSITINGS.len(), forms.len(), 2]) {
        let (compositing, (drawing, form), projection) =
            (COMPOSITINGS[compositing], forms[drawn], projections[projection]);
        if compositing == Compositing::Surface {
            continue;
        }
        (scene.splatting.compositing, scene.camera.projection) = (compositing, projection);
        scene.splatting.footprint = form;
        scene.splatting.order = Order::FrontToBack;
        let (front_to_back, sheets) = render(drawing, gpu, &volume, &scene);
        scene.splatting.order = Order::BackToFront;
        let (back_to_front, _) = render(drawing, gpu, &volume, &scene);
        let difference = largest_difference(&front_to_back, &back_to_front);
        // Each sheet adds a subtraction, a product and a sum of numbers up to 1, in either order, whose roundings have either sign. The native
        // backend's sheets sum up voxels in either order, too.
        let roundings = if drawing == Drawing::Native { 1.6 } else { 0.8 };
        let tolerance = roundings * F32 * sheets as f64;
        assert_at_most(difference, tolerance, format_args!("{compositing:?} {drawing:?} {form:?} {projection:?}"));
    }
}

#[test]
fn every_run_gives_the_same_bytes() {
    let (volume, mut scene) = head();
    let (first, second) = (gpu(), &new_gpu());
    let perspective = Projection::Perspective { fov_y: 60.0, distance: None, near: None };
    let projections = [scene.camera.projection, perspective, perspective];
    let cases = COMPOSITINGS.into_iter().zip(projections.into_iter().cycle());
    for ((compositing, projection), (drawing, form)) in
        cases.flat_map(|case| drawn_forms().map(move |drawn| (case, drawn)))
    {
        (scene.splatting.compositing, scene.camera.projection) = (compositing, projection);
        scene.splatting.footprint = form;
        let bytes = |gpu: &GpuHeadless| {
            let (image, _) = render(drawing, gpu, &volume, &scene);
            bytemuck::cast_slice::<_, u8>(image.pixels.as_flattened()).to_vec()
        };
        let image = bytes(first);
        assert_eq!(image.len(), 96 * 80 * 16);
        assert!(image == bytes(first), "{compositing:?} {drawing:?} {form:?} {projection:?}, on the same device");
        assert!(image == bytes(second), "{compositing:?} {drawing:?} {form:?} {projection:?}, on a new device");
    }
}

/// Classified after splatting, too.
#[test]
fn every_run_after_splatting_gives_the_same_bytes() {
    let (volume, mut scene) = head();
    scene.splatting.classification = Classification::After;
    scene.channels[0].transfer.opacity = Some(Ramp::new(vec![(30.0, 0.0), (120.0, 0.9)]).unwrap());
    let (first, second) = (gpu(), &new_gpu());
    let perspective = Projection::Perspective { fov_y: 60.0, distance: None, near: None };
    let projections = [scene.camera.projection, perspective];
    for (compositing, drawing) in COMPOSITINGS.into_iter().flat_map(|of| DRAWINGS.map(|drawing| (of, drawing))) {
        for (projection, gradient) in projections.into_iter().zip([Gradient::Differences, Gradient::Kernel]) {
            (scene.splatting.compositing, scene.camera.projection) = (compositing, projection);
            scene.shading.gradient = gradient;
            let [one, again, elsewhere] =
                [&first, &first, &second].map(|gpu| render(drawing, gpu, &volume, &scene).0.pixels);
            let what = format!("{compositing:?} {drawing:?} {projection:?}");
            assert!(one.iter().any(|pixel| *pixel != one[0]) || compositing == Compositing::Minimum, "{what}");
            assert!(one == again, "{what}, on the same device");
            assert!(one == elsewhere, "{what}, on a new device");
        }
    }
}

#[test]
fn constant_colour_is_constant_colour_times_alpha() {
    let gpu = gpu();
    let (volume, mut scene) = head();
    let color = [0.3, 0.61, 0.97];
    scene.channels[0].transfer = transfer(&[(0.0, color)], &[(30.0, 0.0), (200.0, 1.0)]);
    scene.shading.enabled = false;
    scene.image.background = [0.0; 4];
    for (drawing, compositing) in DRAWINGS
        .into_iter()
        .flat_map(|drawing| [Compositing::Linear, Compositing::Exponential].map(|how| (drawing, how)))
    {
        scene.splatting.compositing = compositing;
        // Quads round the amount and the amount times colour to f16; sheets and their sum are f32.
        let rounding = if drawing.rounds_to_f16() { 2.0 * F16 } else { 0.0 };
        for slab_width in [0.5, 1.0, 3.0] {
            scene.splatting.slab_width = slab_width;
            let (image, sheets) = render(drawing, gpu, &volume, &scene);
            assert!(image.pixels.iter().any(|pixel| pixel[3] > 0.99));
            for (i, pixel) in image.pixels.iter().enumerate() {
                let alpha = f64::from(pixel[3]);
                for (channel, color) in pixel.iter().zip(color) {
                    let tolerance = rounding * color * alpha + 4.0 * F32 * sheets as f64;
                    let what = format_args!("{drawing:?} {compositing:?} slab width {slab_width} pixel {i}: {pixel:?}");
                    assert_at_most((f64::from(*channel) - color * alpha).abs(), tolerance, what);
                }
            }
        }
    }
}
