//! Properties of a surface.

use glam::DVec3;
use sheetsplat::internals::reference;
use sheetsplat::scene::Scene;
use sheetsplat::settings::Compositing;
use sheetsplat::settings::Projection;
use sheetsplat::volume::{Volume, builtin};

use crate::common::compare::{self, assert_at_least};
use crate::common::devices::{DRAWINGS, gpu};
use crate::common::{camera, scene, transfer};
use crate::modes::{COLOR, HostFrame, constant, draw_for_host, render};

/// A volume with one opacity in one half and 0 in the other, divided by a plane between voxels.
fn step(opacity: f64) -> (Volume, Scene) {
    let (volume, mut scene) = constant([40, 40, 40], DVec3::ONE);
    let values = (0..64_000).map(|index| f32::from(volume.grid().voxel_at(index).y >= 20)).collect();
    let volume = Volume::new("step", volume.grid().dims, DVec3::ONE, values).unwrap();
    scene.camera = camera([0.2, 1.0, -0.3], 12.0);
    (scene.splatting.radius, scene.splatting.falloff) = (2.0, 2.0);
    scene.splatting.compositing = Compositing::Surface;
    scene.channels[0].transfer = transfer(&[(0.0, [1.0, 0.0, 0.0]), (1.0, COLOR)], &[(0.0, 0.0), (1.0, opacity)]);
    (volume, scene)
}

/// The surface of a step is opaque, at the step, with the inside's colour; where the opacity never reaches one half, the pixel is empty.
#[test]
fn the_surface_of_a_step() {
    let gpu = gpu();
    for (drawing, width) in DRAWINGS.into_iter().flat_map(|drawing| [0.3, 1.0, 1.6].map(|width| (drawing, width))) {
        for projection in [None, Some(Projection::Perspective { fov_y: 12.0, distance: Some(60.0), near: None })] {
            let (volume, mut scene) = step(1.0);
            scene.camera.projection = projection.unwrap_or(scene.camera.projection);
            scene.splatting.slab_width = width;
            let pixels = [[60, 54], [6, 100], [110, 4]];
            let HostFrame { image, picks, .. } =
                draw_for_host(drawing, gpu, (&volume, &scene), (Some(0.7), None), &pixels);
            for (at, pixel) in image.pixels.iter().enumerate() {
                let color = COLOR.map(|channel| channel as f32);
                let is_inside = pixel.iter().zip(color).all(|(a, b)| (a - b).abs() < 1e-3);
                assert!(is_inside && pixel[3] == 1.0, "pixel {at}: {pixel:?} with {scene:?}");
            }
            for pick in picks {
                let pick = pick.unwrap();
                // Between the voxels before and behind it, as exactly as the mean is linear.
                assert!(pick.position.y.abs() < 0.1 * f64::max(width, 1.0), "{drawing:?}, {width}: {pick:?}");
            }
            // At a lower opacity the surface lies farther inside.
            let (volume, mut scene) = step(0.6);
            scene.splatting.slab_width = width;
            let image = render(drawing, gpu, &volume, &scene).0;
            assert!(image.pixels.iter().all(|pixel| pixel[3] == 1.0));
            let (volume, mut scene) = step(0.45);
            scene.splatting.slab_width = width;
            let image = render(drawing, gpu, &volume, &scene).0;
            assert!(image.pixels.iter().all(|pixel| *pixel == [0.0; 4]));
        }
    }
}

/// Haze before a gap leaves no colour on a surface behind it, although no sheet in the gap is composited.
#[test]
fn haze_before_a_gap_does_not_colour_a_surface() {
    let gpu = gpu();
    let (volume, mut scene) = constant([9, 100, 9], DVec3::ONE);
    // With slabs of 8 and groups of 4: haze up to the end of one group, nothing in the next, and the surface in the first sheet after that.
    let value = |index| match volume.grid().voxel_at(index).y {
        0..=15 => 1.0,
        52.. => 2.0,
        _ => 0.0,
    };
    let values = (0..8100).map(value).collect();
    let volume = Volume::new("haze", volume.grid().dims, DVec3::ONE, values).unwrap();
    scene.camera = camera([0.0, 1.0, 0.0], 4.0);
    (scene.splatting.radius, scene.splatting.falloff) = (2.0, 2.0);
    (scene.splatting.compositing, scene.splatting.slab_width) = (Compositing::Surface, 8.0);
    scene.channels[0].transfer =
        transfer(&[(1.0, [1.0, 0.0, 0.0]), (2.0, [0.0, 0.0, 1.0])], &[(0.0, 0.0), (1.0, 0.45), (2.0, 0.9)]);
    let expected = reference::render(&volume, &[scene.channels[0].transfer.resolve(&volume)], &scene).unwrap();
    for (drawing, tiles) in DRAWINGS.into_iter().flat_map(|drawing| [true, false].map(|tiles| (drawing, tiles))) {
        scene.splatting.tiles = tiles;
        for pixels in [&expected, &render(drawing, gpu, &volume, &scene).0].map(|image| &image.pixels) {
            let is_blue = |pixel: &[f32; 4]| pixel[3] == 1.0 && pixel[0] < 1e-6 && (pixel[2] - 1.0).abs() < 2e-3;
            assert!(pixels.iter().all(is_blue), "{drawing:?}, {tiles}: {:?}", pixels[6540]);
        }
    }
}

/// The PSNR of a surface by slabs as wide as voxels against one by the thinnest slabs. Without interpolation, its colours would be those of
/// other depths from ring to ring: 27 dB for the head and for the waves.
#[test]
fn a_surface_has_no_rings() {
    let gpu = gpu();
    for (name, direction, opacity, least) in [
        ("head:40", [0.5, 0.85, -0.2], [(30.0, 0.0), (60.0, 1.0)], 31.0),
        ("marschner-lobb:40", [0.2, 0.7, -0.7], [(115.0, 0.0), (130.0, 0.9)], 28.0),
    ] {
        let volume = builtin::volume(name).unwrap();
        let mut scene = scene(128, 128);
        scene.camera.direction = DVec3::from(direction);
        scene.splatting.compositing = Compositing::Surface;
        scene.channels[0].transfer =
            transfer(&[(20.0, [0.9, 0.3, 0.2]), (110.0, [0.8, 0.75, 0.3]), (200.0, [0.3, 0.5, 1.0])], &opacity);
        scene.image.background = [0.0; 4];
        for drawing in DRAWINGS {
            let [wide, thin] = [1.0, 0.05].map(|width| {
                scene.splatting.slab_width = width;
                render(drawing, gpu, &volume, &scene).0.pixels
            });
            let opaque = wide.iter().zip(&thin).filter(|(a, b)| a[3] == 1.0 && b[3] == 1.0);
            let errors: Vec<f64> =
                opaque.flat_map(|(a, b)| (0..3).map(|i| f64::from(a[i]) - f64::from(b[i]))).collect();
            let decibels = compare::decibels(compare::root_mean_square(errors.iter().copied()));
            println!("{name}, {drawing:?}: {decibels:.1} dB over {} colours", errors.len());
            assert!(errors.len() > 3000, "{name}, {drawing:?}: {} colours", errors.len());
            assert_at_least(decibels, least, format_args!("{name}, {drawing:?}"));
        }
    }
}
