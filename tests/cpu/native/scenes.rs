//! Scenes of a renderer that change.

use glam::DVec3;
use sheetsplat::cpu::CpuRenderer;
use sheetsplat::scene::Scene;
use sheetsplat::settings::{Camera, Classification, Clip, Compositing, Gradient, Interpolation, Light, Splatting};
use sheetsplat::volume::builtin;

use crate::common::images::bits;
use crate::common::{Random, scene, transfer};
use crate::native::draw;

/// A change of a scene.
fn change(scene: &mut Scene, random: &mut Random) {
    let Splatting { classification, compositing, interpolation, radius, slab_width, .. } = &mut scene.splatting;
    match random.bits() % 10 {
        0 => {
            let direction = DVec3::new(random.uniform(-1.0, 1.0), random.uniform(0.2, 1.0), random.uniform(-1.0, 1.0));
            scene.camera = Camera { direction, ..scene.camera };
        }
        1 => scene.shading.light = Light::Direction(DVec3::new(random.uniform(-1.0, 1.0), 1.0, 0.3)),
        2 => scene.shading.gradient = random.pick(&[Gradient::Differences, Gradient::Kernel]),
        3 => {
            let low = random.uniform(20.0, 120.0);
            scene.channels[0].transfer =
                transfer(&[(0.0, [0.9, 0.7, 0.5]), (255.0, [1.0; 3])], &[(low, 0.0), (low + 30.0, 0.8)]);
        }
        4 => scene.clip = Clip { planes: vec![[1.0, 0.2, 0.0, random.uniform(-4.0, 4.0)]], ..Clip::default() },
        5 => *classification = random.pick(&[Classification::Before, Classification::After]),
        6 => {
            *compositing = random.pick(&[
                Compositing::Linear,
                Compositing::Exponential,
                Compositing::Maximum,
                Compositing::Surface,
            ]);
        }
        7 => *interpolation = random.pick(&[Interpolation::Smooth, Interpolation::Exact]),
        8 => *slab_width = random.pick(&[0.3, 0.5, 1.0]),
        _ => *radius = random.pick(&[1.5, 2.0]),
    }
}

#[test]
fn a_changed_scene_is_drawn_as_a_new_one() {
    let volume = std::sync::Arc::new(builtin::volume("head:16").unwrap());
    let mut random = Random(19);
    let mut scene = scene(40, 40);
    scene.channels[0].transfer = transfer(&[(0.0, [1.0; 3])], &[(40.0, 0.0), (90.0, 0.7)]);
    scene.camera.projection = sheetsplat::settings::Projection::Orthographic { height: Some(20.0) };
    let mut renderer = CpuRenderer::new(volume.clone(), &scene).unwrap();
    let mut images = std::collections::BTreeSet::new();
    for step in 0..60 {
        change(&mut scene, &mut random);
        renderer.set_scene(&scene).unwrap();
        let [drawn, new] = [renderer.draw().unwrap(), draw(&volume, &scene)];
        assert_eq!(bits(&drawn.image), bits(&new.image), "step {step}: {scene:?}");
        assert_eq!(drawn.stats.counts, new.stats.counts, "step {step}: {scene:?}");
        images.insert(bits(&drawn.image));
    }
    assert!(images.len() > 30, "only {} images", images.len());
    // A scene that is refused changes nothing.
    let before = bits(&renderer.draw().unwrap().image);
    let mut wrong = scene.clone();
    wrong.splatting.radius = f64::NAN;
    assert!(renderer.set_scene(&wrong).unwrap_err().to_string().contains("splatting.radius"));
    assert_eq!(bits(&renderer.draw().unwrap().image), before);
    assert_eq!(renderer.scene().splatting, scene.splatting);
}
