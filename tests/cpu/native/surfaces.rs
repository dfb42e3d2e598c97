//! A host's opaque surfaces, against the f64 evaluation and by themselves.

use sheetsplat::RenderError;
use sheetsplat::cpu::CpuRenderer;
use sheetsplat::image::Image;
use sheetsplat::internals::reference::{self, Host};
use sheetsplat::scene::Scene;
use sheetsplat::settings::{Classification, Compositing, Method, Projection};
use sheetsplat::volume::Volume;

use super::modes::{OUTLIERS, share_off};
use super::{REQUIRED, draw, head, psnr, random_case, shown};
use crate::common::compare::assert_at_most;
use crate::common::images::largest_difference;
use crate::common::{COMPOSITINGS, Random};

fn drawn(volume: &Volume, scene: &Scene, depths: &[f32]) -> Image {
    let mut renderer = CpuRenderer::new(volume.clone(), scene).unwrap();
    renderer.set_surfaces(Some(depths.to_vec())).unwrap();
    let image = renderer.draw().unwrap().image;
    assert!(image.pixels.as_flattened().iter().all(|channel| channel.is_finite()), "not finite: {scene:?}");
    image
}

fn twin(volume: &Volume, scene: &Scene, depths: &[f32]) -> Image {
    let unit = volume.grid().unit();
    let depths: Vec<f64> = depths.iter().map(|&depth| f64::from(depth) / unit).collect();
    let host = Host { surfaces: Some(&depths), ..Host::default() };
    reference::render_for(host, volume, &[scene.channels[0].transfer.resolve(volume)], scene, None).unwrap().image
}

/// Depths for every pixel: some beyond everything, some in front of it, most among it.
pub(crate) fn depths(random: &mut Random, volume: &Volume, scene: &Scene) -> Vec<f32> {
    let half = (volume.grid().center() * volume.spacing()).length();
    let middle = match scene.camera.projection {
        Projection::Perspective { distance, .. } => distance.unwrap(),
        _ => 0.0,
    };
    let pixels = scene.image.width * scene.image.height;
    let any = |random: &mut Random| match random.bits() % 8 {
        0 => f32::INFINITY,
        1 => f32::NEG_INFINITY,
        _ => (middle + random.uniform(-half, half)) as f32,
    };
    (0..pixels).map(|_| any(random)).collect()
}

#[test]
fn surfaces_end_rays_as_the_twins_do() {
    let mut random = Random(91);
    let (mut worst, mut seen) = (f64::INFINITY, 0.0_f64);
    // The shares of pixels that are off, before and after splatting.
    let mut chosen = [Vec::new(), Vec::new()];
    for case in 0..56 {
        let (volume, mut scene) = random_case(&mut random);
        scene.splatting.method = Method::ImageAligned;
        scene.splatting.culling = false;
        if case % 2 == 1 {
            scene.splatting.classification = Classification::After;
            scene.splatting.falloff = 2.0;
            scene.splatting.radius = 2.0;
        }
        if case % 4 < 2 {
            scene.splatting.compositing = COMPOSITINGS[case % COMPOSITINGS.len()];
            scene.splatting.order = sheetsplat::settings::Order::FrontToBack;
        }
        let depths = depths(&mut random, &volume, &scene);
        let (actual, expected) = (drawn(&volume, &scene, &depths), twin(&volume, &scene, &depths));
        seen = seen.max(shown(&actual));
        // Of nearly equal values f32 may choose others, and a surface is there or not.
        if matches!(scene.splatting.compositing, Compositing::Maximum | Compositing::Minimum | Compositing::Surface) {
            let share = share_off(&actual.pixels, &expected.pixels);
            chosen[case % 2].push(share);
            assert_at_most(share, 8.0 * OUTLIERS, format_args!("case {case}: pixels with {scene:?}"));
            continue;
        }
        let decibels = psnr(&actual, &expected);
        let required = if case % 2 == 1 { 60.0 } else { REQUIRED };
        assert!(decibels >= required, "case {case}: {decibels:.1} dB, {scene:?}");
        worst = worst.min(decibels);
    }
    assert!(seen > 0.3, "the pictures show something: {seen}");
    println!("{worst:.1} dB at least; of chosen values and surfaces these shares of the pixels are off: {chosen:.4?}");
    assert!(chosen.iter().all(|shares| shares.len() >= 3), "{chosen:?}");
}

#[test]
fn nothing_is_visible_behind_a_surface_and_everything_in_front_of_it() {
    let (volume, mut scene) = head();
    let pixels = (scene.image.width * scene.image.height) as usize;
    for classification in [Classification::Before, Classification::After] {
        scene.splatting.classification = classification;
        let plain = draw(&volume, &scene).image;
        assert!(shown(&plain) > 0.03, "{classification:?}: {}", shown(&plain));
        // Rays with ends scale their sheets, by 1 here but for rounding.
        let open = drawn(&volume, &scene, &vec![f32::INFINITY; pixels]);
        assert!(largest_difference(&open, &plain) < 2e-6, "{classification:?}");
        let hidden = drawn(&volume, &scene, &vec![-1e6; pixels]);
        assert_eq!(shown(&hidden), 0.0, "{classification:?}");
        // Half of the picture.
        let left: Vec<f32> = (0..pixels).map(|at| if at % 96 < 48 { -1e6 } else { 1e6 }).collect();
        let half = drawn(&volume, &scene, &left);
        for (at, (pixel, plain)) in half.pixels.iter().zip(&plain.pixels).enumerate() {
            let expected = if at % 96 < 48 { [0.0, 0.0, 0.0, 1.0] } else { *plain };
            let is_same = pixel.iter().zip(expected).all(|(a, b)| (a - b).abs() < 2e-6);
            assert!(is_same, "{classification:?}, {at}: {pixel:?}, not {expected:?}");
        }
    }
}

#[test]
fn surfaces_that_cannot_be_are_refused_by_name() {
    let (volume, scene) = head();
    let mut renderer = CpuRenderer::new(volume, &scene).unwrap();
    let error = renderer.set_surfaces(Some(vec![1.0, f32::NAN])).unwrap_err().to_string();
    assert!(error.contains("surfaces[1]") && error.contains("NaN") && error.contains("infinity"), "{error}");
    renderer.set_surfaces(Some(vec![1.0; 5])).unwrap();
    let RenderError::OutOfRange(error) = renderer.draw().unwrap_err() else { panic!("another kind of error") };
    let error = error.to_string();
    assert!(error.contains("surfaces: found 5 depths") && error.contains("7680"), "{error}");
    renderer.set_surfaces(None).unwrap();
    assert!(renderer.draw().is_ok());
}
