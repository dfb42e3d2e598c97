//! The f64 evaluation by itself: properties of its perspective, its axis-aligned sheets and its composite-every-sample.
//! `cargo test --test cpu twins:: -- --nocapture` prints the measurements.

use glam::{DVec3, UVec3};
use sheetsplat::image::Image;
use sheetsplat::internals::kernel::Kernel;
use sheetsplat::internals::reference;
use sheetsplat::internals::reference::visibility::Test;
use sheetsplat::scene::Scene;
use sheetsplat::settings::{Camera, Projection};
use sheetsplat::settings::{Compositing, Method, Order};
use sheetsplat::volume::{Volume, builtin};

use crate::common::compare::{assert_at_least, assert_at_most, largest};
use crate::common::images::{largest_difference, rms};
use crate::common::{BY_AMOUNTS, F32, Random, camera, scene, transfer};

const METHODS: [Method; 3] = [Method::ImageAligned, Method::AxisAligned, Method::CompositeEverySample];

fn render(volume: &Volume, scene: &Scene) -> Image {
    reference::render(volume, &[scene.channels[0].transfer.resolve(volume)], scene).unwrap()
}

fn perspective(direction: [f64; 3], fov_y: f64, distance: f64, near: Option<f64>) -> Camera {
    let projection = Projection::Perspective { fov_y, distance: Some(distance), near };
    Camera { projection, ..camera(direction, 1.0) }
}

/// The differences of all channels.
fn errors(a: &Image, b: &Image) -> Vec<f64> {
    assert_eq!(a.pixels.len(), b.pixels.len());
    a.pixels.as_flattened().iter().zip(b.pixels.as_flattened()).map(|(a, b)| f64::from(a - b)).collect()
}

/// A small head, semi-transparent.
fn head() -> (Volume, Scene) {
    let mut scene = scene(72, 60);
    scene.channels[0].transfer =
        transfer(&[(40.0, [0.9, 0.6, 0.4]), (255.0, [1.0, 1.0, 0.9])], &[(30.0, 0.0), (120.0, 0.3)]);
    (builtin::volume("head:32").unwrap(), scene)
}

/// An eye that moves away while its angle narrows approaches an orthographic camera: the difference halves when the distance doubles. On
/// anisotropic grids slabs have other angles in perspective (SPEC §5), so only what does not depend on them is compared.
#[test]
fn a_far_eye_is_orthographic() {
    const HEIGHT: f64 = 60.0;
    for (spacing, compositing) in [
        ([1.0, 1.0, 1.0], Compositing::Linear),
        ([1.0, 1.0, 1.0], Compositing::Exponential),
        ([1.0, 1.0, 1.0], Compositing::Xray),
        ([1.0, 1.0, 3.0], Compositing::Xray),
    ] {
        for method in METHODS {
            let (volume, mut scene) = head();
            let volume = volume.with_spacing("head", DVec3::from(spacing)).unwrap();
            scene.shading.ambient = 0.6;
            (scene.splatting.method, scene.splatting.compositing) = (method, compositing);
            scene.camera = camera([0.4, 0.9, -0.3], HEIGHT);
            let orthographic = render(&volume, &scene);
            let differences = [1024.0, 2048.0, 4096.0].map(|distance: f64| {
                let fov_y = 2.0 * (HEIGHT / 2.0 / distance).atan().to_degrees();
                // A whole number of slabs lies between eye and centre, so the planes are the same.
                scene.camera = perspective([0.4, 0.9, -0.3], fov_y, distance, None);
                rms(&orthographic, &render(&volume, &scene))
            });
            println!("{spacing:?} {method:?} {compositing:?}: {differences:.6?}");
            assert_at_most(differences[0], 0.011, format_args!("{spacing:?} {method:?} {compositing:?}"));
            let rates = [differences[0] / differences[1], differences[1] / differences[2]];
            assert!(
                rates.iter().all(|rate| (1.8..2.2).contains(rate)),
                "{spacing:?} {method:?} {compositing:?}: {rates:?}"
            );
        }
    }
}

/// The absorption of a uniform block along the central ray depends on its thickness, for any spacing, slab width and obliquity; a wide
/// kernel has no ripple.
#[test]
fn a_blocks_opacity_is_that_of_its_thickness() {
    const LAYERS: u32 = 5;
    for spacing in [[1.0, 1.0, 1.0], [1.0, 1.0, 5.0], [3.2, 3.2, 1.5], [1.0, 2.0, 1.0]].map(DVec3::from) {
        for (direction, distance) in [([0.0, 1.0, 0.0], 150.0), ([0.2, 0.9, -0.1], 150.0), ([0.0, 1.0, 0.0], 400.0)] {
            let dims = UVec3::new(37, LAYERS, 33);
            let volume = Volume::new("block", dims, spacing, vec![1.0; dims.element_product() as usize]).unwrap();
            let mut scene = scene(1, 1);
            scene.camera = perspective(direction, 1.0, distance, None);
            scene.image.background = [0.0; 4];
            scene.channels[0].transfer = transfer(&[(0.0, [0.2, 0.5, 0.9])], &[(0.0, 0.1)]);
            (scene.splatting.radius, scene.splatting.falloff) = (4.0, 1.0);
            scene.splatting.compositing = Compositing::Exponential;
            let length = f64::from(LAYERS) * spacing.y / volume.grid().unit() / scene.camera.basis().w.y;
            let depth = -(1.0_f64 - 0.1).ln() * length;
            for (method, slab_width) in [
                (Method::ImageAligned, 0.5),
                (Method::ImageAligned, 1.0),
                (Method::ImageAligned, 2.7),
                (Method::AxisAligned, 1.0),
            ] {
                (scene.splatting.method, scene.splatting.slab_width) = (method, slab_width);
                let alpha = f64::from(render(&volume, &scene).pixels[0][3]);
                let error = alpha / (1.0 - (-depth).exp()) - 1.0;
                let what = format_args!("{spacing} {direction:?} {distance} {method:?} {slab_width}");
                assert_at_most(error.abs(), 1e-3, what);
            }
        }
    }
}

/// A wall across the view under a headlight: each pixel sees it at its own angle.
#[test]
fn a_headlight_shines_from_the_eye() {
    let dims = UVec3::new(61, 9, 61);
    let values = (0..dims.element_product()).map(|at| (at / dims.x % dims.y) as f32).collect();
    let volume = Volume::new("wall", dims, DVec3::ONE, values).unwrap();
    let mut scene = scene(33, 33);
    scene.camera = perspective([0.0, 1.0, 0.0], 60.0, 40.0, None);
    scene.channels[0].transfer = transfer(&[(0.0, [1.0; 3])], &[(0.0, 0.9)]);
    (scene.shading.ambient, scene.shading.diffuse, scene.shading.specular) = (0.0, 1.0, 0.0);
    scene.splatting.compositing = Compositing::Exponential;
    let image = render(&volume, &scene);
    for (at, pixel) in image.pixels.iter().enumerate() {
        let offset = (DVec3::new((at % 33) as f64, (at / 33) as f64, 0.0) - 16.0).truncate() / 16.5
            * 30.0_f64.to_radians().tan();
        let cosine = (1.0 + offset.length_squared()).sqrt().recip();
        assert!(pixel[3] > 0.9999, "pixel {at} shows the wall alone");
        assert_at_most((f64::from(pixel[0]) - cosine).abs(), 6e-4, format_args!("pixel {at}"));
    }
}

/// In a minified view a kernel keeps its total amount, per section at its own depth (low-pass rule).
#[test]
fn minified_kernels_keep_their_amount() {
    let mut values = vec![0.0; 125];
    values[62] = 1.0;
    let volume = Volume::new("voxel", UVec3::splat(5), DVec3::new(1.0, 1.0, 3.0), values).unwrap();
    for (method, direction) in METHODS.into_iter().flat_map(|m| [[0.0, 1.0, 0.0], [0.4, 0.5, -0.7]].map(|d| (m, d))) {
        let total = |size: u32| {
            let mut scene = scene(size, size);
            scene.camera = perspective(direction, 90.0, 20.0, None);
            scene.image.background = [0.0; 4];
            scene.channels[0].transfer = transfer(&[(0.0, [1.0; 3])], &[(0.0, 0.0), (1.0, 0.02)]);
            // The kernels are so wide that the positions of pixel centres do not matter.
            (scene.splatting.radius, scene.splatting.falloff) = (4.0, 1.0);
            scene.splatting.method = method;
            scene.splatting.compositing = Compositing::Xray;
            let alpha: f64 = render(&volume, &scene).pixels.iter().map(|pixel| f64::from(pixel[3])).sum();
            alpha / f64::from(size).powi(2)
        };
        // Two grid units per pixel, and one per 13 pixels.
        let (minified, magnified) = (total(20), total(521));
        assert_at_most((minified / magnified - 1.0).abs(), 2.7e-4, format_args!("{method:?} {direction:?}"));
    }
}

/// Whole kernels or sections: along a slice axis both add up to the same opacity, and to the same colour in smooth volumes.
#[test]
fn axis_aligned_equals_image_aligned_along_an_axis() {
    let dims = UVec3::splat(24);
    let values: Vec<f32> = (0..dims.element_product())
        .map(|at| UVec3::new(at % 24, at / 24 % 24, at / 576).as_dvec3() - 11.5)
        .map(|p| (100.0 * (-p.length_squared() / 60.0).exp()) as f32)
        .collect();
    for spacing in [[1.0, 1.0, 1.0], [1.0, 1.0, 2.0]].map(DVec3::from) {
        let volume = Volume::new("blob", dims, spacing, values.clone()).unwrap();
        for direction in [[0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]] {
            let mut scene = scene(64, 64);
            scene.camera = Camera { up: DVec3::new(0.0, 0.6, 0.8), ..camera(direction, 36.0) };
            if direction[2] == 0.0 {
                scene.camera.up = DVec3::Z;
            }
            scene.channels[0].transfer =
                transfer(&[(0.0, [0.2, 0.3, 1.0]), (100.0, [1.0, 0.8, 0.2])], &[(0.0, 0.0), (100.0, 0.2)]);
            scene.image.background = [0.0; 4];
            scene.splatting.compositing = Compositing::Exponential;
            let image_aligned = render(&volume, &scene);
            scene.splatting.method = Method::AxisAligned;
            let axis_aligned = render(&volume, &scene);
            let errors = errors(&image_aligned, &axis_aligned);
            let worst = |channel: usize| largest(errors.iter().skip(channel).step_by(4).copied());
            println!("{spacing} {direction:?}: alpha {:.1e}, red {:.1e}, blue {:.1e}", worst(3), worst(0), worst(2));
            assert_at_most(worst(3), 2.0 * F32, format_args!("alpha, {spacing} {direction:?}"));
            assert_at_most(worst(0).max(worst(2)), 3.6e-3, format_args!("colours, {spacing} {direction:?}"));
            assert!(image_aligned.pixels.iter().any(|pixel| pixel[3] > 0.5));
        }
    }
}

/// Seen along -x the order of slices is reversed; the wrong order would be visible.
#[test]
fn slices_are_ordered_along_w() {
    let (nx, ny, nz) = (12, 16, 16);
    // Red at low x, and blue at high x.
    let values = (0..nx * ny * nz).map(|at| (at % nx) as f32).collect();
    let volume = Volume::new("two", UVec3::new(nx, ny, nz), DVec3::ONE, values).unwrap();
    for (x, method) in [1.0, -1.0].into_iter().flat_map(|x| METHODS.map(|method| (x, method))) {
        for projection in [None, Some(Projection::Perspective { fov_y: 20.0, distance: Some(40.0), near: None })] {
            let mut scene = scene(9, 9);
            scene.camera = camera([x, 0.3, 0.2], 4.0);
            scene.camera.projection = projection.unwrap_or(scene.camera.projection);
            scene.channels[0].transfer = transfer(&[(3.0, [1.0, 0.0, 0.0]), (8.0, [0.0, 0.0, 1.0])], &[(0.0, 0.7)]);
            scene.shading.enabled = false;
            scene.splatting.method = method;
            let [red, _, blue, _] = render(&volume, &scene).pixels[40];
            let (front, back) = if x > 0.0 { (red, blue) } else { (blue, red) };
            assert!(front > 0.9 && back < 0.1, "{x} {method:?} {projection:?}: {front} {back}");
        }
    }
}

#[test]
fn back_to_front_equals_front_to_back() {
    let (volume, mut scene) = head();
    let volume = volume.with_spacing("head", DVec3::new(1.0, 1.0, 2.0)).unwrap();
    let mut by_method = Vec::new();
    for (method, compositing) in METHODS.into_iter().flat_map(|method| BY_AMOUNTS.map(|c| (method, c))) {
        for camera in [camera([0.4, 0.9, -0.3], 50.0), perspective([0.4, 0.9, -0.3], 40.0, 60.0, None)] {
            scene.camera = camera;
            (scene.splatting.method, scene.splatting.compositing) = (method, compositing);
            let [forwards, backwards] = [Order::FrontToBack, Order::BackToFront].map(|order| {
                scene.splatting.order = order;
                render(&volume, &scene)
            });
            let difference = largest_difference(&forwards, &backwards);
            // The images are f32.
            assert_at_most(difference, 2.0 * F32, format_args!("{method:?} {compositing:?}"));
            by_method.push(forwards);
        }
    }
    // The methods differ, except for sums.
    let [image_aligned, axis_aligned, every_sample] = [0, 6, 12].map(|at| &by_method[at..at + 6]);
    for (a, b) in [(image_aligned, axis_aligned), (axis_aligned, every_sample), (image_aligned, every_sample)] {
        let differences: Vec<f64> = (0..4).map(|at| largest_difference(&a[at], &b[at])).collect();
        println!("linear and exponential differ by {differences:.4?}");
        differences.iter().for_each(|&difference| assert_at_least(difference, 3.7e-3, "the methods differ"));
        assert_at_most(largest_difference(&a[4], &b[4]), 2.0 * F32, "orthographic sums are those of whole kernels");
    }
}

/// Voxels composited one by one are not added up first: two along a ray are composited one after the other.
#[test]
fn every_sample_is_composited_by_itself() {
    let volume = Volume::new("two", UVec3::new(1, 2, 1), DVec3::ONE, vec![1.0, 2.0]).unwrap();
    let mut scene = scene(1, 1);
    scene.camera = camera([0.0, 1.0, 0.0], 1e-3);
    scene.image.background = [0.0; 4];
    scene.shading.enabled = false;
    scene.channels[0].transfer = transfer(&[(1.0, [1.0, 0.0, 0.0]), (2.0, [0.0, 0.0, 1.0])], &[(0.0, 0.8)]);
    scene.splatting.method = Method::CompositeEverySample;
    let kernel = Kernel::new(2.0, 2.0);
    let amount = 0.8 * kernel.section(0.0, -2.0, 2.0);
    for order in [Order::FrontToBack, Order::BackToFront] {
        scene.splatting.order = order;
        let [red, _, blue, alpha] = render(&volume, &scene).pixels[0].map(f64::from);
        let expected = [amount, amount * (1.0 - amount), amount + amount * (1.0 - amount)];
        let worst = largest([red, blue, alpha].iter().zip(expected).map(|(a, b)| a - b));
        assert_at_most(worst, 1.5 * F32, format_args!("{order:?}: {red} {blue} {alpha}, not {expected:?}"));
    }
}

/// Early splat elimination keeps its guarantee in perspective, with each section's own box, and for slices.
#[test]
fn culling_in_perspective_and_by_slices() {
    let volume = builtin::volume("head:40").unwrap();
    for spacing in [[1.0, 1.0, 1.0], [1.0, 1.0, 3.0]].map(DVec3::from) {
        let volume = volume.clone().with_spacing("head", spacing).unwrap();
        for (method, projection) in [Method::ImageAligned, Method::AxisAligned].into_iter().flat_map(|method| {
            let perspective = |fov_y, distance| Projection::Perspective { fov_y, distance, near: None };
            [Projection::Orthographic { height: None }, perspective(30.0, None), perspective(80.0, Some(45.0))]
                .map(|projection| (method, projection))
        }) {
            let mut scene = scene(100, 90);
            scene.camera = Camera { projection, ..camera([0.55, 0.8, -0.3], 1.0) };
            scene.splatting.method = method;
            let transfer = [scene.channels[0].transfer.resolve(&volume)];
            let render = |test| reference::render_culled(&volume, &transfer, &scene, test).unwrap();
            let [all, culled] = [None, Some(Test::Box)].map(render);
            let difference = largest_difference(&all.image, &culled.image);
            let drawn = culled.sections as f64 / all.sections as f64;
            println!("{spacing} {method:?} {projection:?}: {:.1} % drawn, {difference:.1e}", 100.0 * drawn);
            let allowed = 1.0 - scene.splatting.opacity_threshold + 1e-6;
            assert_at_most(difference, allowed, format_args!("{spacing} {method:?} {projection:?}"));
            assert!(drawn < 0.6, "{drawn}");
            let counts = reference::count(&volume, &transfer, &scene).unwrap();
            assert_eq!(counts.sections_total, all.sections);
            assert!(method == Method::ImageAligned || counts.sections_total == counts.voxels_in_range);
        }
    }
}

/// The near plane cuts through one kernel: the part before it disappears, and all of it once the voxel lies before it.
#[test]
fn the_near_plane_cuts_kernels() {
    let mut values = vec![0.0; 27];
    values[13] = 1.0;
    let kernel = Kernel::new(2.0, 2.0);
    for (spacing, method) in [[1.0, 1.0, 1.0], [1.0, 2.0, 1.0]].into_iter().flat_map(|s| METHODS.map(|m| (s, m))) {
        let volume = Volume::new("voxel", UVec3::splat(3), DVec3::from(spacing), values.clone()).unwrap();
        for before in [5.0, 2.0, 1.7, 1.0, 0.5, 0.1, 0.001, 0.0, -0.001, -1.0] {
            let mut scene = scene(1, 1);
            scene.camera = perspective([0.0, 1.0, 0.0], 1e-3, 10.0, Some(10.0 - before));
            scene.image.background = [0.0; 4];
            scene.channels[0].transfer = transfer(&[(0.0, [1.0; 3])], &[(0.0, 0.0), (1.0, 0.3)]);
            scene.splatting.compositing = Compositing::Xray;
            scene.splatting.method = method;
            let stretch = spacing[1];
            let part = if before > 0.0 { kernel.section(0.0, -before / stretch, 2.0) * stretch } else { 0.0 };
            let alpha = f64::from(render(&volume, &scene).pixels[0][3]);
            let what = format_args!("{spacing:?} {method:?} near {before} before: {alpha}");
            assert_at_most((alpha - 0.3 * part).abs(), 0.5 * F32, what);
            let counts = reference::count(&volume, &[scene.channels[0].transfer.resolve(&volume)], &scene).unwrap();
            assert_eq!(counts.voxels_in_range, u64::from(before > 0.0));
            if method == Method::ImageAligned {
                // Slabs of width 1 start at the eye; the voxel is at 10.
                let first = (10.0 - before).max(10.0 - 2.0 * stretch).floor();
                let sections = if before > 0.0 { 10.0 + 2.0 * stretch - first } else { 0.0 };
                assert_eq!(counts.sections_total as f64, sections, "{before}");
            }
        }
    }
}

/// For any eye and any angle, no number becomes NaN.
#[test]
fn every_view_is_finite() {
    let mut random = Random(11);
    let (volume, mut scene) = head();
    (scene.image.width, scene.image.height) = (24, 20);
    for case in 0..60 {
        let volume = volume.clone().with_spacing("head", DVec3::new(1.0, 1.0, [1.0, 5.0][case % 2])).unwrap();
        let fov_y = [1e-3, 5.0, 60.0, 170.0, 179.999][case % 5];
        let near = [1e-9, 1e-3, 0.1, 1.0, 30.0][case / 5 % 5];
        scene.camera = perspective(random.direction().to_array(), fov_y, random.uniform(0.01, 60.0), Some(near));
        scene.camera.center = Some(random.direction() * 10.0);
        scene.splatting.method = METHODS[case % 3];
        scene.splatting.compositing = BY_AMOUNTS[case / 3 % 3];
        let transfer = [scene.channels[0].transfer.resolve(&volume)];
        let culled = reference::render_culled(&volume, &transfer, &scene, Some(Test::Box)).unwrap();
        let valid = |channel: &f32| (0.0..=1.000_001).contains(channel);
        assert!(culled.image.pixels.as_flattened().iter().all(valid), "{:?}", scene.camera);
    }
}
