//! Whole images.

use glam::{DVec3, UVec3};
use sheetsplat::internals::reference::after::Frame;
use sheetsplat::internals::reference::{self, Host};
use sheetsplat::scene::Scene;
use sheetsplat::settings::{Compositing, Ramp};
use sheetsplat::volume::{Volume, builtin};

use crate::after::{eye, render, scene, volume};
use crate::common::{camera, transfer};

/// A head seen obliquely, some of whose tissues are nearly opaque.
pub(crate) fn head() -> (Volume, Scene) {
    let mut scene = scene(64, 60);
    scene.camera.direction = DVec3::new(0.4, 0.9, -0.3);
    scene.splatting.compositing = Compositing::Exponential;
    scene.channels[0].transfer = transfer(
        &[(40.0, [0.9, 0.6, 0.4]), (150.0, [0.5, 0.2, 0.2]), (255.0, [1.0, 1.0, 0.9])],
        &[(30.0, 0.0), (60.0, 0.3), (120.0, 0.1), (200.0, 0.9)],
    );
    (builtin::volume("head:32").unwrap(), scene)
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
    scene.channels[0].transfer = transfer(&[(0.0, [1.0; 3])], &[(0.0, 0.1)]);
    let image = render(&volume, &scene);
    for (at, pixel) in (0..).zip(&image.pixels) {
        let step = 2.0 * 12.5_f64.to_radians().tan() / 9.0;
        let (x, y) = ((f64::from(at % 9) - 4.0) * step, (f64::from(at / 9) - 4.0) * step);
        let expected = 0.1 * 4.0 * (1.0 + x * x + y * y).sqrt();
        assert!((f64::from(pixel[3]) - expected).abs() < 1e-6, "{at}: {pixel:?}, not {expected}");
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
    scene.channels[0].transfer = transfer(&[(0.0, [1.0; 3])], &[(0.0, 0.01)]);
    let transfer = scene.channels[0].transfer.resolve(&volume);
    // 12 voxels of 2 units each.
    let alpha = |scene: &Scene, surfaces: Option<&[f64]>| {
        let host = Host { surfaces, first_hit: Some(0.05) };
        reference::render_for(host, &volume, std::slice::from_ref(&transfer), scene, None).unwrap()
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
    scene.splatting.culling = false;
    for (compositing, projection) in [(Compositing::Linear, None), (Compositing::Exponential, Some(eye(600.0)))] {
        scene.splatting.compositing = compositing;
        scene.camera.projection = projection.unwrap_or(scene.camera.projection);
        let transfer = scene.channels[0].transfer.resolve(&volume);
        let frame = Frame::new(Host::default(), &volume, std::slice::from_ref(&transfer), &scene).unwrap();
        let pixels = (0..20).flat_map(|y| (0..24).map(move |x| glam::UVec2::new(x, y)));
        let slabs = pixels.map(|at| frame.pixel(at).slabs()).filter(|slabs| !slabs.is_empty());
        let (first, end) = slabs.fold((i32::MAX, i32::MIN), |(a, b), slabs| (a.min(slabs.start), b.max(slabs.end)));
        let mut acc = reference::Buffer::new(24, 20);
        for k in first..end {
            for segment in 0..2 {
                let sheet = frame.slab_sheet(k, segment);
                reference::composite::composite(&mut acc, &sheet, compositing, scene.splatting.order);
            }
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
    let transfer = scene.channels[0].transfer.resolve(&volume);
    let counts = reference::count(&volume, std::slice::from_ref(&transfer), &scene).unwrap();
    assert_eq!(counts.voxels_total, u64::from(volume.dims().element_product()));
    assert!(counts.voxels_in_range > 0 && counts.voxels_in_range <= counts.voxels_total);
    // A kernel of radius 2 meets four planes at distances of one unit, and rarely three.
    let planes = counts.sections_total as f64 / counts.voxels_in_range as f64;
    assert!((3.9..=4.0).contains(&planes), "{planes}");
    assert!(counts.sheets > 20 && counts.sheets < 80, "{counts:?}");
    scene.splatting.slab_width = 0.5;
    let halved = reference::count(&volume, std::slice::from_ref(&transfer), &scene).unwrap();
    assert!((7.9..=8.1).contains(&(halved.sections_total as f64 / halved.voxels_in_range as f64)));
    // For a single bright voxel in the dark, only bricks within two kernels and a slab of it count.
    let dot =
        crate::after::volume([40, 40, 40], DVec3::ONE, |voxel| f64::from(u8::from(voxel == UVec3::splat(21))) * 255.0);
    scene.splatting.slab_width = 1.0;
    scene.channels[0].transfer.opacity = Some(Ramp::new(vec![(10.0, 0.0), (20.0, 1.0)]).unwrap());
    let transfer = scene.channels[0].transfer.resolve(&dot);
    let counts = reference::count(&dot, std::slice::from_ref(&transfer), &scene).unwrap();
    assert!((64..=4096).contains(&counts.voxels_in_range), "{counts:?}");
    scene.channels[0].transfer.opacity = Some(Ramp::new(vec![(300.0, 0.0), (310.0, 1.0)]).unwrap());
    let transfer = scene.channels[0].transfer.resolve(&dot);
    let counts = reference::count(&dot, std::slice::from_ref(&transfer), &scene).unwrap();
    assert_eq!([counts.voxels_in_range, counts.sections_total, counts.sheets], [0; 3]);
    assert!(render(&dot, &scene).pixels.iter().all(|pixel| *pixel == [0.0; 4]));
}
