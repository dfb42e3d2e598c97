//! Volumes whose values take few bits: images are the bytes that the same values give as `f32`.

use glam::DVec3;
use sheetsplat::Scene;
use sheetsplat::cpu::CpuRenderer;
use sheetsplat::settings::{Classification, Compositing, Gradient, Interpolation};
use sheetsplat::volume::Volume;

use crate::common::{gpu, transfer};
use crate::same_bytes::bits;
use crate::{draw, head, shown, twin};

/// Volumes of 8 and 16 bits, with and without a sign; the bytes of their values; and a scene that shows what `head` does.
fn cases() -> Vec<(Volume, usize, Scene)> {
    let (head, _) = head();
    let cases = [(1.0, 0.0, 1), (0.5, -64.0, 1), (200.0, 0.0, 2), (200.0, -20_000.0, 2)];
    let case = |(slope, intercept, bytes): (f32, f32, usize)| {
        let mut values: Vec<f32> = head.values().iter().map(|value| (value * slope).floor() + intercept).collect();
        values[0] = 0.0;
        let volume = Volume::new("head", head.dims(), DVec3::new(1.0, 1.2, 0.9), values).unwrap();
        let at = |value: f64| value * f64::from(slope) + f64::from(intercept);
        let (_, mut scene) = crate::head();
        scene.transfer = transfer(
            &[(at(40.0), [0.9, 0.6, 0.4]), (at(220.0), [1.0, 1.0, 0.9])],
            &[(at(30.0), 0.0), (at(80.0), 0.15), (at(200.0), 0.9)],
        );
        (volume, bytes, scene)
    };
    cases.into_iter().map(case).collect()
}

/// The same volume with the sign of its first value, a zero, which only `f32` holds.
fn as_f32(volume: &Volume) -> Volume {
    let mut values = volume.values().to_vec();
    values[0] = -0.0;
    let volume = Volume::new("head", volume.dims(), volume.spacing(), values).unwrap();
    assert_eq!(volume.values().bytes(), 4 * volume.values().len());
    volume
}

/// Several frames of one renderer, since later ones keep what the first one computes.
fn frames(volume: &Volume, scene: &Scene) -> Vec<Vec<u32>> {
    let mut renderer = CpuRenderer::new(volume.clone(), scene).unwrap();
    let mut frame = || {
        renderer.turn(10.0).unwrap();
        bits(&renderer.draw().unwrap().image)
    };
    (0..3).map(|_| frame()).collect()
}

#[test]
fn images_do_not_depend_on_how_values_are_kept() {
    for (volume, bytes, mut scene) in cases() {
        assert_eq!(volume.values().bytes(), bytes * volume.values().len());
        let other = as_f32(&volume);
        for classification in [Classification::Before, Classification::After] {
            for (gradient, radius, interpolation) in [
                (Gradient::Differences, 2.0, Interpolation::Smooth),
                (Gradient::Kernel, 2.0, Interpolation::Smooth),
                (Gradient::Differences, 2.5, Interpolation::Smooth),
                (Gradient::Kernel, 2.5, Interpolation::Smooth),
                (Gradient::Differences, 2.0, Interpolation::Exact),
            ] {
                for compositing in [Compositing::Exponential, Compositing::Maximum] {
                    scene.splatting.classification = classification;
                    (scene.shading.gradient, scene.splatting.radius) = (gradient, radius);
                    (scene.splatting.interpolation, scene.splatting.compositing) = (interpolation, compositing);
                    let (drawn, expected) = (frames(&volume, &scene), frames(&other, &scene));
                    assert!(drawn == expected, "{bytes} bytes: {:?}", scene.splatting);
                    assert!(shown(&draw(&volume, &scene).image) > 0.05, "{bytes} bytes: {:?}", scene.splatting);
                }
            }
        }
        for classification in [Classification::Before, Classification::After] {
            (scene.splatting.classification, scene.splatting.interpolation) = (classification, Interpolation::Smooth);
            assert!(bits(&twin(&volume, &scene)) == bits(&twin(&other, &scene)), "{bytes} bytes: {classification:?}");
        }
    }
}

#[test]
fn images_of_the_gpu_do_not_depend_on_it_either() {
    let gpu = gpu();
    for (volume, bytes, mut scene) in cases() {
        for classification in [Classification::Before, Classification::After] {
            scene.splatting.classification = classification;
            let [drawn, expected] =
                [volume.clone(), as_f32(&volume)].map(|volume| gpu.render_volume(volume, &scene).unwrap().image);
            assert!(bits(&drawn) == bits(&expected), "{bytes} bytes: {classification:?}");
        }
    }
}
