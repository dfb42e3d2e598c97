//! The f64 twin by itself: what must hold of its perspective, its axis-aligned sheets and its composite-every-sample, and how far it is from
//! a dense ray march of the same field. `cargo test --release --test twins -- --nocapture` prints what was measured.
#![expect(clippy::unwrap_used, reason = "tests")]

#[expect(dead_code, reason = "not every file needs all of it")]
mod common;

use std::path::Path;

use glam::{DVec3, UVec2, UVec3};
use sheetsplat::camera::{Camera, Projection};
use sheetsplat::image::Image;
use sheetsplat::kernel::Kernel;
use sheetsplat::reference::visibility::Test;
use sheetsplat::reference::{self, ray_march};
use sheetsplat::scene::Scene;
use sheetsplat::splatting::{Compositing, Method, Order};
use sheetsplat::volume::{Volume, builtin};

use common::{Random, camera, scene, transfer};

const METHODS: [Method; 3] = [Method::ImageAligned, Method::AxisAligned, Method::CompositeEverySample];
const COMPOSITINGS: [Compositing; 3] = [Compositing::Linear, Compositing::Exponential, Compositing::Xray];

fn render(volume: &Volume, scene: &Scene) -> Image {
    reference::render(volume, &scene.transfer.resolve(volume), scene).unwrap()
}

fn perspective(direction: [f64; 3], fov_y: f64, distance: f64, near: Option<f64>) -> Camera {
    let projection = Projection::Perspective { fov_y, distance: Some(distance), near };
    Camera { projection, ..camera(direction, 1.0) }
}

/// Differences of all channels.
fn errors(a: &[[f32; 4]], b: &[[f32; 4]]) -> Vec<f64> {
    assert_eq!(a.len(), b.len());
    a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| f64::from(a - b)).collect()
}

fn rms(a: &Image, b: &Image) -> f64 {
    let errors = errors(&a.pixels, &b.pixels);
    (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt()
}

fn largest_difference(a: &Image, b: &Image) -> f64 {
    errors(&a.pixels, &b.pixels).into_iter().fold(0.0, |worst: f64, error| worst.max(error.abs()))
}

/// Decibels over the pixels where either differs from opaque black.
fn psnr(a: &[[f32; 4]], b: &[[f32; 4]]) -> f64 {
    const BLACK: [f32; 4] = [0.0, 0.0, 0.0, 1.0];
    let (a, b): (Vec<[f32; 4]>, Vec<[f32; 4]>) = a.iter().zip(b).filter(|(a, b)| **a != BLACK || **b != BLACK).unzip();
    assert!(a.len() > 500, "only {} pixels show anything", a.len());
    let errors = errors(&a, &b);
    -10.0 * (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).log10()
}

/// A small head, semi-transparent.
fn head() -> (Volume, Scene) {
    let mut scene = scene(72, 60);
    scene.transfer = transfer(&[(40.0, [0.9, 0.6, 0.4]), (255.0, [1.0, 1.0, 0.9])], &[(30.0, 0.0), (120.0, 0.3)]);
    (builtin::volume("head:32").unwrap(), scene)
}

/// The twin and every so-manieth pixel marched.
fn against_the_ray_march(volume: &Volume, scene: &Scene, stride: u32) -> f64 {
    let transfer = scene.transfer.resolve(volume);
    let splatted = reference::render(volume, &transfer, scene).unwrap();
    let lines = |size: u32| (0..size).step_by(stride as usize);
    let pixels: Vec<UVec2> =
        lines(splatted.height).flat_map(|y| lines(splatted.width).map(move |x| UVec2::new(x, y))).collect();
    let marched = ray_march::pixels(volume, &transfer, scene, &pixels).unwrap();
    let splatted: Vec<[f32; 4]> =
        pixels.iter().map(|at| splatted.pixels[(at.x + at.y * splatted.width) as usize]).collect();
    psnr(&splatted, &marched)
}

/// The nerve at fov 30, an image large enough that a grid unit covers a pixel at the far end, so that no low-pass rule sets in.
#[test]
fn ray_march_of_the_nerve() {
    let volume = builtin::volume("nerve:128").unwrap();
    let mut scene = scene(288, 288);
    scene.camera.projection = Projection::Perspective { fov_y: 30.0, distance: None, near: None };
    scene.splatting.compositing = Compositing::Exponential;
    let decibels = against_the_ray_march(&volume, &scene, 2);
    println!("builtin:nerve:128: {decibels:.1} dB");
    assert!(decibels >= 45.0, "{decibels}");
}

/// A real, strongly anisotropic volume, where the data lie beside the checkout.
#[test]
fn ray_march_of_the_quarter_head() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/scenes/quarter-head-perspective.toml");
    if !path.exists() {
        println!("skipped: there is no {}", path.display());
        return;
    }
    let mut scene = Scene::open(&path, &[]).unwrap();
    (scene.image.width, scene.image.height) = (192, 192);
    let volume = scene.load_volume().unwrap();
    let decibels = against_the_ray_march(&volume, &scene, 1);
    println!("quarter-head-perspective: {decibels:.1} dB");
    assert!(decibels >= 45.0, "{decibels}");
}

/// Orthographic, slabs and march are the same field, so what is left is the slab width: it goes with its square.
#[test]
fn ray_march_and_thin_slabs() {
    let (volume, mut scene) = head();
    let volume = volume.with_spacing("head", DVec3::new(1.0, 1.0, 3.0)).unwrap();
    scene.camera = camera([0.4, 0.9, -0.3], 60.0);
    scene.splatting.compositing = Compositing::Exponential;
    let decibels = [1.0, 0.5, 0.25].map(|slab_width| {
        scene.splatting.slab_width = slab_width;
        against_the_ray_march(&volume, &scene, 1)
    });
    println!("slab widths 1, 0.5, 0.25: {decibels:.1?} dB");
    assert!(decibels[0] > 45.0 && decibels[1] > decibels[0] + 10.0 && decibels[2] > decibels[1] + 10.0, "{decibels:?}");
}

/// An eye that moves away while its angle narrows sees what an orthographic camera sees: the difference halves when the distance doubles.
/// On anisotropic grids slabs lie at other angles in perspective (SPEC §5), which leaves what does not depend on them.
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
                // Whole numbers of slabs between eye and centre: the planes are the same.
                scene.camera = perspective([0.4, 0.9, -0.3], fov_y, distance, None);
                rms(&orthographic, &render(&volume, &scene))
            });
            println!("{spacing:?} {method:?} {compositing:?}: {differences:.6?}");
            assert!(differences[0] < 0.02, "{spacing:?} {method:?} {compositing:?}: {differences:?}");
            let rates = [differences[0] / differences[1], differences[1] / differences[2]];
            assert!(
                rates.iter().all(|rate| (1.8..2.2).contains(rate)),
                "{spacing:?} {method:?} {compositing:?}: {rates:?}"
            );
        }
    }
}

/// What a block of one opacity absorbs along the central ray is that of its thickness, whatever spacing, slab width and obliquity; a
/// wide kernel leaves no ripple.
#[test]
fn a_blocks_opacity_is_that_of_its_thickness() {
    const LAYERS: u32 = 5;
    let mut worst: f64 = 0.0;
    for spacing in [[1.0, 1.0, 1.0], [1.0, 1.0, 5.0], [3.2, 3.2, 1.5], [1.0, 2.0, 1.0]].map(DVec3::from) {
        for (direction, distance) in [([0.0, 1.0, 0.0], 150.0), ([0.2, 0.9, -0.1], 150.0), ([0.0, 1.0, 0.0], 400.0)] {
            let dims = UVec3::new(37, LAYERS, 33);
            let volume = Volume::new("block", dims, spacing, vec![1.0; dims.element_product() as usize]).unwrap();
            let mut scene = scene(1, 1);
            scene.camera = perspective(direction, 1.0, distance, None);
            scene.image.background = [0.0; 4];
            scene.transfer = transfer(&[(0.0, [0.2, 0.5, 0.9])], &[(0.0, 0.1)]);
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
                worst = worst.max(error.abs());
                assert!(
                    error.abs() < 1e-3,
                    "{spacing} {direction:?} {distance} {method:?} {slab_width}: off by {error:.2e}"
                );
            }
        }
    }
    println!("a block's opacity: off by {worst:.1e} at most");
}

/// A wall across the view under a headlight: each pixel sees it at its own angle.
#[test]
fn a_headlight_shines_from_the_eye() {
    let dims = UVec3::new(61, 9, 61);
    let values = (0..dims.element_product()).map(|at| (at / dims.x % dims.y) as f32).collect();
    let volume = Volume::new("wall", dims, DVec3::ONE, values).unwrap();
    let mut scene = scene(33, 33);
    scene.camera = perspective([0.0, 1.0, 0.0], 60.0, 40.0, None);
    scene.transfer = transfer(&[(0.0, [1.0; 3])], &[(0.0, 0.9)]);
    (scene.shading.ambient, scene.shading.diffuse, scene.shading.specular) = (0.0, 1.0, 0.0);
    scene.splatting.compositing = Compositing::Exponential;
    let image = render(&volume, &scene);
    for (at, pixel) in image.pixels.iter().enumerate() {
        let offset = (DVec3::new((at % 33) as f64, (at / 33) as f64, 0.0) - 16.0).truncate() / 16.5
            * 30.0_f64.to_radians().tan();
        let cosine = (1.0 + offset.length_squared()).sqrt().recip();
        assert!(pixel[3] > 0.9999, "pixel {at} shows the wall alone");
        assert!((f64::from(pixel[0]) - cosine).abs() < 2e-3, "pixel {at}: {}, not {cosine}", pixel[0]);
    }
}

/// Minified, a kernel keeps what it adds to the image: per section, at its own depth (low-pass rule).
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
            scene.transfer = transfer(&[(0.0, [1.0; 3])], &[(0.0, 0.0), (1.0, 0.02)]);
            // Wide enough that it does not matter where the pixels' centres fall.
            (scene.splatting.radius, scene.splatting.falloff) = (4.0, 1.0);
            scene.splatting.method = method;
            scene.splatting.compositing = Compositing::Xray;
            let alpha: f64 = render(&volume, &scene).pixels.iter().map(|pixel| f64::from(pixel[3])).sum();
            alpha / f64::from(size).powi(2)
        };
        // Two grid units to a pixel, and one to 13.
        let (minified, magnified) = (total(20), total(521));
        assert!((minified / magnified - 1.0).abs() < 5e-3, "{method:?} {direction:?}: {minified}, not {magnified}");
    }
}

/// Whole kernels or sections: along a slice axis both add up to the same opacity, and to the same colour where the volume is smooth.
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
            scene.transfer = transfer(&[(0.0, [0.2, 0.3, 1.0]), (100.0, [1.0, 0.8, 0.2])], &[(0.0, 0.0), (100.0, 0.2)]);
            scene.image.background = [0.0; 4];
            scene.splatting.compositing = Compositing::Exponential;
            let image_aligned = render(&volume, &scene);
            scene.splatting.method = Method::AxisAligned;
            let axis_aligned = render(&volume, &scene);
            let errors = errors(&image_aligned.pixels, &axis_aligned.pixels);
            let worst = |channel: usize| errors.iter().skip(channel).step_by(4).fold(0.0, |w: f64, e| w.max(e.abs()));
            println!("{spacing} {direction:?}: alpha {:.1e}, red {:.1e}, blue {:.1e}", worst(3), worst(0), worst(2));
            assert!(worst(3) < 1e-6 && worst(0) < 5e-3 && worst(2) < 5e-3, "{spacing} {direction:?}");
            assert!(image_aligned.pixels.iter().any(|pixel| pixel[3] > 0.5));
        }
    }
}

/// Seen along -x the slices' order is the other way round; an order the wrong way shows.
#[test]
fn slices_are_ordered_along_w() {
    let (nx, ny, nz) = (12, 16, 16);
    // Red at low x, blue at high x.
    let values = (0..nx * ny * nz).map(|at| (at % nx) as f32).collect();
    let volume = Volume::new("two", UVec3::new(nx, ny, nz), DVec3::ONE, values).unwrap();
    for (x, method) in [1.0, -1.0].into_iter().flat_map(|x| METHODS.map(|method| (x, method))) {
        for projection in [None, Some(Projection::Perspective { fov_y: 20.0, distance: Some(40.0), near: None })] {
            let mut scene = scene(9, 9);
            scene.camera = camera([x, 0.3, 0.2], 4.0);
            scene.camera.projection = projection.unwrap_or(scene.camera.projection);
            scene.transfer = transfer(&[(3.0, [1.0, 0.0, 0.0]), (8.0, [0.0, 0.0, 1.0])], &[(0.0, 0.7)]);
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
    for (method, compositing) in METHODS.into_iter().flat_map(|method| COMPOSITINGS.map(|c| (method, c))) {
        for camera in [camera([0.4, 0.9, -0.3], 50.0), perspective([0.4, 0.9, -0.3], 40.0, 60.0, None)] {
            scene.camera = camera;
            (scene.splatting.method, scene.splatting.compositing) = (method, compositing);
            let [forwards, backwards] = [Order::FrontToBack, Order::BackToFront].map(|order| {
                scene.splatting.order = order;
                render(&volume, &scene)
            });
            let difference = largest_difference(&forwards, &backwards);
            // The images are f32.
            assert!(difference <= 1e-6, "{method:?} {compositing:?}: {difference}");
            by_method.push(forwards);
        }
    }
    // The methods are not the same, but for sums.
    let [image_aligned, axis_aligned, every_sample] = [0, 6, 12].map(|at| &by_method[at..at + 6]);
    for (a, b) in [(image_aligned, axis_aligned), (axis_aligned, every_sample), (image_aligned, every_sample)] {
        let differences: Vec<f64> = (0..4).map(|at| largest_difference(&a[at], &b[at])).collect();
        println!("linear and exponential differ by {differences:.4?}");
        assert!(differences.iter().all(|&difference| difference > 1e-3), "{differences:?}");
        assert!(largest_difference(&a[4], &b[4]) < 1e-5, "orthographic sums are those of whole kernels");
    }
}

/// Voxels composited one by one are not added up first: two in one place along the ray, opacity by opacity.
#[test]
fn every_sample_is_composited_by_itself() {
    let volume = Volume::new("two", UVec3::new(1, 2, 1), DVec3::ONE, vec![1.0, 2.0]).unwrap();
    let mut scene = scene(1, 1);
    scene.camera = camera([0.0, 1.0, 0.0], 1e-3);
    scene.image.background = [0.0; 4];
    scene.shading.enabled = false;
    scene.transfer = transfer(&[(1.0, [1.0, 0.0, 0.0]), (2.0, [0.0, 0.0, 1.0])], &[(0.0, 0.8)]);
    scene.splatting.method = Method::CompositeEverySample;
    let kernel = Kernel::new(2.0, 2.0);
    let amount = 0.8 * kernel.section(0.0, -2.0, 2.0);
    for order in [Order::FrontToBack, Order::BackToFront] {
        scene.splatting.order = order;
        let [red, _, blue, alpha] = render(&volume, &scene).pixels[0].map(f64::from);
        let expected = [amount, amount * (1.0 - amount), amount + amount * (1.0 - amount)];
        let worst = [red, blue, alpha].iter().zip(expected).fold(0.0, |w: f64, (a, b)| w.max((a - b).abs()));
        assert!(worst < 1e-6, "{order:?}: {red} {blue} {alpha}, not {expected:?}");
    }
}

/// Early splat elimination keeps its guarantee in perspective, with sections' own boxes, and for slices.
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
            let transfer = scene.transfer.resolve(&volume);
            let render = |test| reference::render_culled(&volume, &transfer, &scene, test).unwrap();
            let [all, culled] = [None, Some(Test::Box)].map(render);
            let difference = largest_difference(&all.image, &culled.image);
            let drawn = culled.sections as f64 / all.sections as f64;
            println!("{spacing} {method:?} {projection:?}: {:.1} % drawn, {difference:.1e}", 100.0 * drawn);
            assert!(difference <= 1.0 - scene.splatting.opacity_threshold + 1e-6, "{difference}");
            assert!(drawn < 0.6, "{drawn}");
            let counts = reference::count(&volume, &transfer, &scene).unwrap();
            assert_eq!(counts.sections_total, all.sections);
            assert!(method == Method::ImageAligned || counts.sections_total == counts.voxels_in_range);
        }
    }
}

/// The near plane through one kernel: what lies before it is gone, and all of it once the voxel does.
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
            scene.transfer = transfer(&[(0.0, [1.0; 3])], &[(0.0, 0.0), (1.0, 0.3)]);
            scene.splatting.compositing = Compositing::Xray;
            scene.splatting.method = method;
            let stretch = spacing[1];
            let part = if before > 0.0 { kernel.section(0.0, -before / stretch, 2.0) * stretch } else { 0.0 };
            let alpha = f64::from(render(&volume, &scene).pixels[0][3]);
            assert!(
                (alpha - 0.3 * part).abs() < 1e-6,
                "{spacing:?} {method:?} near {before} before: {alpha}, not {}",
                0.3 * part
            );
            let counts = reference::count(&volume, &scene.transfer.resolve(&volume), &scene).unwrap();
            assert_eq!(counts.voxels_in_range, u64::from(before > 0.0));
            if method == Method::ImageAligned {
                // Slabs of width 1 from the eye on; the voxel is at 10.
                let first = (10.0 - before).max(10.0 - 2.0 * stretch).floor();
                let sections = if before > 0.0 { 10.0 + 2.0 * stretch - first } else { 0.0 };
                assert_eq!(counts.sections_total as f64, sections, "{before}");
            }
        }
    }
}

/// Any eye, any angle: every number stays one.
#[test]
fn no_view_breaks_down() {
    let mut random = Random(11);
    let (volume, mut scene) = head();
    (scene.image.width, scene.image.height) = (24, 20);
    for case in 0..60 {
        let volume = volume.clone().with_spacing("head", DVec3::new(1.0, 1.0, [1.0, 5.0][case % 2])).unwrap();
        let fov_y = [1e-3, 5.0, 60.0, 170.0, 179.999][case % 5];
        let near = [1e-9, 1e-3, 0.1, 1.0, 30.0][case / 5 % 5];
        scene.camera = perspective(random.direction().to_array(), fov_y, random.uniform(0.01, 60.0), Some(near));
        scene.camera.center = random.direction() * 10.0;
        scene.splatting.method = METHODS[case % 3];
        scene.splatting.compositing = COMPOSITINGS[case / 3 % 3];
        let transfer = scene.transfer.resolve(&volume);
        let culled = reference::render_culled(&volume, &transfer, &scene, Some(Test::Box)).unwrap();
        let valid = |channel: &f32| (0.0..=1.000_001).contains(channel);
        assert!(culled.image.pixels.as_flattened().iter().all(valid), "{:?}", scene.camera);
    }
}

/// Figs. 3 and 6: the cube at 44.8° and 45.2°, both faces under a headlight.
#[test]
fn the_cube_does_not_pop() {
    let volume = builtin::volume("cube").unwrap();
    let mut scene = scene(256, 256);
    scene.transfer = transfer(&[(0.0, [1.0; 3])], &[(0.0, 0.0), (255.0, 0.5)]);
    (scene.shading.ambient, scene.shading.diffuse, scene.shading.specular) = (0.0, 1.0, 0.0);
    let pixels_per_unit = 128.0 / volume.grid().bounding_radius(2.0);
    // The mean red of a face, away from its edges: it reaches 22 units to a side and 16 up and down.
    let face = |image: &Image, side: f64| {
        let reds = image.pixels.iter().enumerate().filter_map(|(at, pixel)| {
            let x = side * ((at % 256) as f64 - 127.5) / pixels_per_unit;
            let y = ((at / 256) as f64 - 127.5) / pixels_per_unit;
            ((6.0..16.0).contains(&x) && y.abs() < 10.0).then_some(f64::from(pixel[0]))
        });
        let (count, sum) = reds.fold((0.0, 0.0), |(count, sum), red| (count + 1.0, sum + red));
        sum / count
    };
    let measured = METHODS.map(|method| {
        scene.splatting.method = method;
        let [before, after] = [44.8_f64, 45.2].map(|degrees| {
            let (sine, cosine) = degrees.to_radians().sin_cos();
            scene.camera.direction = DVec3::new(sine, cosine, 0.0);
            render(&volume, &scene)
        });
        // Alpha is 1 everywhere: the rms is that of the colours.
        let rms = rms(&before, &after) * (4.0_f64 / 3.0).sqrt();
        let ratio = face(&before, 1.0) / face(&before, -1.0);
        println!("cube, {method:?}: rms {rms:.4}, right face over left {ratio:.4}");
        (rms, ratio)
    });
    let [(image_aligned, ratio), (axis_aligned, popped), _] = measured;
    assert!(image_aligned <= 0.003, "{image_aligned}");
    assert!((0.045..0.055).contains(&axis_aligned), "{axis_aligned}");
    // The face that looks a little more towards the light is the brighter one, by less than the cosines' ratio of 1.0070: along the flatter
    // of two rays more of the lit layer lies before the dark inside.
    let cosines = 44.8_f64.to_radians().cos() / 45.2_f64.to_radians().cos();
    assert!(1.0 < ratio && ratio < cosines, "{ratio}");
    assert!(popped > 1.2, "{popped}");
}
