//! Volumes whose values take few bits: images are the bytes that the same values give as `f32`.

use sheetsplat::Scene;
use sheetsplat::cpu::CpuRenderer;
use sheetsplat::settings::{Classification, Compositing, Gradient, Interpolation};
use sheetsplat::volume::Volume;

use crate::common::images::bits;
use crate::common::values::{as_f32, cases};
use crate::native::{draw, shown, twin};

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
