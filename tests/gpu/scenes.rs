//! Scenes of a view that change, by every backend.

use glam::DVec3;
use sheetsplat::headless::{Backend, Headless, HeadlessOptions};
use sheetsplat::scene::Scene;
use sheetsplat::settings::Light;
use sheetsplat::volume::builtin;

use crate::common::compare::assert_at_most;
use crate::common::images::{bits, largest_difference};
use crate::common::{scene, transfer};

#[test]
fn views_of_every_backend_change_their_scenes() {
    let volume = std::sync::Arc::new(builtin::volume("head:12").unwrap());
    let mut first = scene(24, 24);
    first.channels[0].transfer = transfer(&[(0.0, [1.0; 3])], &[(40.0, 0.0), (90.0, 0.7)]);
    let turned = Scene { camera: first.camera.turned(30.0), ..first.clone() };
    let mut other = turned.clone();
    other.channels[0].transfer = transfer(&[(0.0, [1.0, 0.5, 0.2])], &[(60.0, 0.0), (100.0, 0.9)]);
    let all = [Backend::Gpu, Backend::Cpu, Backend::Reference];
    let headless = all.map(|backend| Headless::new(&HeadlessOptions::default().with_backend(backend)).unwrap());
    for headless in &headless {
        let mut view = headless.view(volume.clone(), &first).unwrap();
        view.set_first_hit(Some(0.5)).unwrap();
        for scene in [&turned, &other, &first] {
            headless.set_scene(&mut view, scene).unwrap();
            let image = headless.draw(&mut view).unwrap().image;
            let fresh = headless.draw(&mut headless.view(volume.clone(), scene).unwrap()).unwrap().image;
            assert_eq!(bits(&image), bits(&fresh), "{:?}", headless.backend());
            headless.pick(&view, [12, 12]).expect("first hits are still asked for");
        }
    }
    let [gpu, cpu, _] = &headless;
    let mut of_cpu = cpu.view(volume, &first).unwrap();
    let message = gpu.set_scene(&mut of_cpu, &other).unwrap_err().to_string();
    assert!(message.contains("cpu") && message.contains("gpu"), "{message}");
}

/// Directions have any length that numbers have.
#[test]
fn directions_have_any_length() {
    let volume = std::sync::Arc::new(builtin::volume("head:12").unwrap());
    let headless = [Backend::Gpu, Backend::Cpu, Backend::Reference]
        .map(|backend| Headless::new(&HeadlessOptions::default().with_backend(backend)).unwrap());
    let scene = |length: f64| {
        let mut scene = scene(24, 24);
        scene.channels[0].transfer = transfer(&[(0.0, [1.0; 3])], &[(40.0, 0.0), (90.0, 0.7)]);
        scene.camera.direction = DVec3::new(0.4, 0.9, -0.3) * length;
        scene.camera.up = DVec3::Z * length;
        scene.shading.light = Light::Direction(DVec3::new(0.5, -0.7, 0.6) * length);
        scene
    };
    for headless in &headless {
        let image = |length| headless.render_volume(volume.clone(), &scene(length)).unwrap().image;
        let unit = image(1.0);
        assert!(unit.pixels.iter().any(|pixel| pixel[0] > 0.2), "{:?}", headless.backend());
        for length in [1e-200, 1e-20, 1e20, 1e200] {
            let difference = largest_difference(&unit, &image(length));
            assert_at_most(difference, 1e-5, format_args!("{:?}, {length}", headless.backend()));
        }
    }
}
