//! Whole images.

use glam::{DVec3, UVec3};
use sheetsplat::internals::reference::after::Frame;
use sheetsplat::internals::reference::{self, Host};
use sheetsplat::scene::Scene;
use sheetsplat::settings::{Compositing, Interpolation, Light, Ramp};
use sheetsplat::volume::{Volume, builtin};

use crate::common::images::{BLACK, color_rms, psnr, rms};
use crate::common::{Random, camera, transfer};
use crate::{eye, render, scene, volume};

/// A head seen obliquely, some of whose tissues are nearly opaque.
fn head() -> (Volume, Scene) {
    let mut scene = scene(64, 60);
    scene.camera.direction = DVec3::new(0.4, 0.9, -0.3);
    scene.splatting.compositing = Compositing::Exponential;
    scene.transfer = transfer(
        &[(40.0, [0.9, 0.6, 0.4]), (150.0, [0.5, 0.2, 0.2]), (255.0, [1.0, 1.0, 0.9])],
        &[(30.0, 0.0), (60.0, 0.3), (120.0, 0.1), (200.0, 0.9)],
    );
    (builtin::volume("head:32").unwrap(), scene)
}

/// A ray's opacity depends on its length in the box of voxel cells, for any direction, spacing and slab width.
#[test]
fn a_uniform_slab_is_as_opaque_as_it_is_thick() {
    const OPACITY: f64 = 0.07;
    let mut random = Random(5);
    for case in 0..20 {
        let spacing = random.pick(&[DVec3::ONE, DVec3::new(1.0, 1.0, 5.0), DVec3::new(2.0, 1.0, 1.5)]);
        let axis = case % 3;
        let mut dims = UVec3::splat(40);
        dims[axis] = 4;
        let volume = volume(dims.to_array(), spacing, |_| 1.0);
        let direction = loop {
            let direction = random.direction();
            if direction[axis].abs() > 0.75 {
                break direction;
            }
        };
        let mut scene = scene(9, 9);
        let up = scene.camera.up;
        scene.camera = camera(direction.to_array(), 3.0);
        scene.camera.up = up;
        if case % 2 == 1 {
            scene.camera.projection =
                sheetsplat::settings::Projection::Perspective { fov_y: 2.0, distance: Some(60.0), near: None };
        }
        scene.splatting.slab_width = random.pick(&[0.3, 1.0, 1.7]);
        scene.splatting.compositing = Compositing::Exponential;
        scene.shading.enabled = false;
        scene.transfer = transfer(&[(0.0, [0.2, 0.5, 0.9])], &[(0.0, OPACITY)]);
        let units = 4.0 * spacing[axis] / spacing.min_element();
        let image = render(&volume, &scene);
        for pixel in &image.pixels {
            // The cosine of rays in perspective differs by a thousandth.
            let expected = 1.0 - (1.0 - OPACITY).powf(units / direction[axis].abs());
            let tolerance = if case % 2 == 1 { 0.02 } else { 1e-5 };
            assert!((f64::from(pixel[3]) / expected - 1.0).abs() < tolerance, "{direction}: {pixel:?}, not {expected}");
            assert!((pixel[2] / pixel[3] - 0.9).abs() < 1e-5);
        }
    }
}

/// In perspective the opacity is exact: every ray has its own length.
#[test]
fn perspective_rays_have_their_own_lengths() {
    let volume = volume([30, 4, 30], DVec3::ONE, |_| 1.0);
    let mut scene = scene(9, 9);
    scene.camera.projection = eye(20.0);
    scene.camera.up = DVec3::Z;
    scene.splatting.compositing = Compositing::Xray;
    scene.shading.enabled = false;
    scene.transfer = transfer(&[(0.0, [1.0; 3])], &[(0.0, 0.1)]);
    let image = render(&volume, &scene);
    for (at, pixel) in (0..).zip(&image.pixels) {
        let step = 2.0 * 12.5_f64.to_radians().tan() / 9.0;
        let (x, y) = ((f64::from(at % 9) - 4.0) * step, (f64::from(at / 9) - 4.0) * step);
        let expected = 0.1 * 4.0 * (1.0 + x * x + y * y).sqrt();
        assert!((f64::from(pixel[3]) - expected).abs() < 1e-6, "{at}: {pixel:?}, not {expected}");
    }
}

#[test]
fn thinner_slabs_converge() {
    for (projection, compositing) in
        [(None, Compositing::Exponential), (Some(eye(800.0)), Compositing::Xray), (None, Compositing::Maximum)]
    {
        let (volume, mut scene) = head();
        scene.camera.projection = projection.unwrap_or(scene.camera.projection);
        scene.splatting.compositing = compositing;
        let images = [1.0, 0.5, 0.25, 0.125].map(|width| {
            scene.splatting.slab_width = width;
            render(&volume, &scene)
        });
        let steps: Vec<f64> = images.windows(2).map(|pair| rms(&pair[0], &pair[1])).collect();
        println!("{compositing:?}: {steps:.5?}");
        assert!(steps[0] > 1e-4 && steps[0] < 0.1, "{compositing:?}: {steps:?}");
        // A maximum is taken over only the planes' points.
        let factor = if compositing == Compositing::Maximum { 0.8 } else { 0.7 };
        assert!(steps[1] < factor * steps[0] && steps[2] < factor * steps[1], "{compositing:?}: {steps:?}");
    }
}

/// Fig. 3's cube from 44.8° to 45.2°. Unshaded it hardly changes. Its lit faces do: normals have no length, so the light ends abruptly where
/// kernels end, and the bright edge in front moves; but no more than at other angles, and by a tenth of what axis-aligned sheets do there.
#[test]
fn the_cube_does_not_pop() {
    let volume = builtin::volume("cube").unwrap();
    for (compositing, interpolation) in
        [(Compositing::Linear, Interpolation::Smooth), (Compositing::Exponential, Interpolation::Exact)]
    {
        let mut scene = scene(128, 128);
        scene.camera.up = DVec3::Z;
        scene.transfer = transfer(&[(0.0, [0.0, 0.5, 1.0]), (255.0, [1.0; 3])], &[(0.0, 0.0), (255.0, 0.5)]);
        (scene.shading.ambient, scene.shading.diffuse, scene.shading.specular) = (0.0, 1.0, 0.0);
        (scene.splatting.compositing, scene.splatting.interpolation) = (compositing, interpolation);
        let turned = |scene: &Scene, from: f64| {
            let [before, after] = [from, from + 0.4].map(|degrees: f64| {
                let (sine, cosine) = degrees.to_radians().sin_cos();
                let mut scene = scene.clone();
                scene.camera.direction = DVec3::new(sine, cosine, 0.0);
                render(&volume, &scene)
            });
            assert!(before.pixels.iter().filter(|pixel| pixel[3] > 0.9).count() > 2000);
            color_rms(&before, &after)
        };
        let [lit, lit_elsewhere] = [44.8, 43.3].map(|from| turned(&scene, from));
        scene.shading.enabled = false;
        let unlit = turned(&scene, 44.8);
        println!("{compositing:?} {interpolation:?}: {lit:.5}, {lit_elsewhere:.5}, unlit {unlit:.5}");
        assert!(unlit < 0.003, "{compositing:?} {interpolation:?}: {unlit}");
        assert!(lit < 0.006 && lit < 1.1 * lit_elsewhere, "{lit} {lit_elsewhere}");
    }
}

/// Half a volume that hides everything behind it gives the same image as a surface and by nearly opaque compositing.
#[test]
fn surface_and_exponential_agree_on_an_opaque_step() {
    let volume = volume([20, 20, 20], DVec3::ONE, |voxel| {
        let p = voxel.as_dvec3() - 9.5;
        if p.length() < 7.3 { 100.0 } else { 0.0 }
    });
    for slab_width in [0.25, 0.125] {
        let mut scene = scene(64, 64);
        scene.camera = camera([0.2, 1.0, -0.3], 18.0);
        scene.image.background = [0.0, 0.0, 0.0, 1.0];
        scene.shading.light = Light::Direction(DVec3::new(-0.5, -1.0, 0.5));
        scene.transfer = transfer(&[(0.0, [0.9, 0.5, 0.2])], &[(49.9, 0.0), (50.1, 1.0)]);
        scene.splatting.slab_width = slab_width;
        let [surface, exponential] = [Compositing::Surface, Compositing::Exponential].map(|compositing| {
            scene.splatting.compositing = compositing;
            render(&volume, &scene)
        });
        let decibels = psnr(&surface.pixels, &exponential.pixels, BLACK, 1000);
        println!("slab width {slab_width}: {decibels:.1} dB");
        assert!(decibels > 40.0, "slab width {slab_width}: {decibels}");
    }
}

/// A plane through the middle halves every ray, and so does a host's surface.
#[test]
fn cuts_shorten_rays() {
    let volume = volume([12, 12, 12], DVec3::new(1.0, 2.0, 1.0), |_| 1.0);
    let mut scene = scene(6, 6);
    scene.camera = camera([0.0, 1.0, 0.0], 4.0);
    scene.splatting.compositing = Compositing::Xray;
    scene.splatting.slab_width = 0.7;
    scene.shading.enabled = false;
    scene.transfer = transfer(&[(0.0, [1.0; 3])], &[(0.0, 0.01)]);
    let transfer = scene.transfer.resolve(&volume);
    // 12 voxels of 2 units each.
    let alpha = |scene: &Scene, surfaces: Option<&[f64]>| {
        let host = Host { surfaces, first_hit: Some(0.05) };
        reference::render_for(host, &volume, &transfer, scene, None).unwrap()
    };
    let whole = alpha(&scene, None);
    assert!(whole.image.pixels.iter().all(|pixel| (pixel[3] - 0.24).abs() < 1e-6));
    // The surface is five units behind the front face, which is 12 before the middle.
    assert!(whole.first_hits.iter().all(|depth| (depth + 7.0).abs() < 1e-9), "{:?}", whole.first_hits);
    let surfaces = [-4.5; 36];
    let before_surfaces = alpha(&scene, Some(&surfaces));
    assert!(before_surfaces.image.pixels.iter().all(|pixel| (pixel[3] - 0.075).abs() < 1e-6));
    scene.clip.planes = vec![[0.0, 1.0, 0.0, 0.3]];
    let behind_plane = alpha(&scene, None);
    assert!(behind_plane.image.pixels.iter().all(|pixel| (pixel[3] - 0.123).abs() < 1e-6));
    assert!(behind_plane.first_hits.iter().all(|depth| (depth - 4.7).abs() < 1e-9), "{:?}", behind_plane.first_hits);
}

/// Sheets composited one after the other give the image.
#[test]
fn sheets_make_the_image() {
    let (volume, mut scene) = head();
    (scene.image.width, scene.image.height) = (24, 20);
    for (compositing, projection) in [(Compositing::Linear, None), (Compositing::Exponential, Some(eye(600.0)))] {
        scene.splatting.compositing = compositing;
        scene.camera.projection = projection.unwrap_or(scene.camera.projection);
        let transfer = scene.transfer.resolve(&volume);
        let frame = Frame::new(Host::default(), &volume, &transfer, &scene).unwrap();
        let pixels = (0..20).flat_map(|y| (0..24).map(move |x| glam::UVec2::new(x, y)));
        let slabs = pixels.map(|at| frame.pixel(at).slabs()).filter(|slabs| !slabs.is_empty());
        let (first, end) = slabs.fold((i32::MAX, i32::MIN), |(a, b), slabs| (a.min(slabs.start), b.max(slabs.end)));
        let mut acc = reference::Buffer::new(24, 20);
        for k in first..end {
            reference::composite::composite(&mut acc, &frame.slab_sheet(k), compositing, scene.splatting.order);
        }
        let image = render(&volume, &scene);
        assert!(image.pixels.iter().any(|pixel| pixel[3] > 0.9));
        for (sheets, pixel) in acc.pixels.iter().zip(&image.pixels) {
            assert!((sheets.as_vec4() - glam::Vec4::from(*pixel)).abs().max_element() < 1e-6, "{sheets} {pixel:?}");
        }
    }
}

/// The statistics cover everything that is drawn: if the rest is cut off, the image stays the same.
#[test]
fn counts() {
    let (volume, mut scene) = head();
    let transfer = scene.transfer.resolve(&volume);
    let counts = reference::count(&volume, &transfer, &scene).unwrap();
    assert_eq!(counts.voxels_total, u64::from(volume.dims().element_product()));
    assert!(counts.voxels_in_range > 0 && counts.voxels_in_range <= counts.voxels_total);
    // A kernel of radius 2 meets four planes at distances of one unit, and rarely three.
    let planes = counts.sections_total as f64 / counts.voxels_in_range as f64;
    assert!((3.9..=4.0).contains(&planes), "{planes}");
    assert!(counts.sheets > 20 && counts.sheets < 80, "{counts:?}");
    scene.splatting.slab_width = 0.5;
    let halved = reference::count(&volume, &transfer, &scene).unwrap();
    assert!((7.9..=8.1).contains(&(halved.sections_total as f64 / halved.voxels_in_range as f64)));
    // For a single bright voxel in the dark, only bricks within two kernels and a slab of it count.
    let dot = crate::volume([40, 40, 40], DVec3::ONE, |voxel| f64::from(u8::from(voxel == UVec3::splat(21))) * 255.0);
    scene.splatting.slab_width = 1.0;
    scene.transfer.opacity = Some(Ramp::new(vec![(10.0, 0.0), (20.0, 1.0)]).unwrap());
    let transfer = scene.transfer.resolve(&dot);
    let counts = reference::count(&dot, &transfer, &scene).unwrap();
    assert!((64..=4096).contains(&counts.voxels_in_range), "{counts:?}");
    scene.transfer.opacity = Some(Ramp::new(vec![(300.0, 0.0), (310.0, 1.0)]).unwrap());
    let transfer = scene.transfer.resolve(&dot);
    let counts = reference::count(&dot, &transfer, &scene).unwrap();
    assert_eq!([counts.voxels_in_range, counts.sections_total, counts.sheets], [0; 3]);
    assert!(render(&dot, &scene).pixels.iter().all(|pixel| *pixel == [0.0; 4]));
}
