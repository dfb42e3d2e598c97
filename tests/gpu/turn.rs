//! Fig. 14: a nerve cell with spacing 1:1:5 turns past 45°, where axis-aligned sheets change their axis and its brightness jumps;
//! image-aligned sheets turn with it. `cargo test --test gpu turn:: -- --nocapture` prints the measurements; `cargo bench --bench paper` draws
//! the curves.

use std::sync::Arc;

use glam::DVec3;
use sheetsplat::cpu::CpuRenderer;
use sheetsplat::image::Image;
use sheetsplat::scene::Scene;
use sheetsplat::settings::{Camera, Method};
use sheetsplat::volume::builtin;

use crate::common::compare::{assert_at_least, largest};
use crate::common::devices::gpu;
use crate::common::{scene, transfer};

/// The first of pairs of angles half a degree apart, from head-on to side-on, and the two around 45°.
const ANGLES: [f64; 8] = [0.0, 15.0, 30.0, 44.5, 45.0, 60.0, 75.0, 89.5];
const STEP: f64 = 0.5;

/// The largest change of the image's mean brightness over a step.
fn largest_change(mut draw: impl FnMut(Camera) -> Image, scene: &Scene) -> f64 {
    let mut brightness = |degrees: f64| {
        let mut camera = scene.camera;
        let (sine, cosine) = degrees.to_radians().sin_cos();
        camera.direction = DVec3::new(sine, 0.0, cosine);
        camera.up = DVec3::Y;
        let image = draw(camera);
        let sum: f64 = image.pixels.iter().flat_map(|pixel| pixel[..3].iter()).map(|&c| f64::from(c)).sum();
        sum / (3 * image.pixels.len()) as f64
    };
    largest(ANGLES.map(|angle| brightness(angle + STEP) - brightness(angle)))
}

#[test]
fn image_aligned_sheets_do_not_pop() {
    let gpu = gpu();
    let volume = Arc::new(builtin::volume("nerve:256").unwrap());
    let mut scene = scene(128, 128);
    scene.channels[0].transfer = transfer(&[(0.0, [1.0; 3])], &[(30.0, 0.0), (90.0, 0.2)]);
    let changes = [Method::ImageAligned, Method::AxisAligned].map(|method| {
        scene.splatting.method = method;
        let mut view = gpu.view(volume.clone(), &scene).unwrap();
        let mut native = CpuRenderer::new(volume.clone(), &scene).unwrap();
        let by_gpu = |camera| {
            view.set_camera(camera).unwrap();
            gpu.draw(&mut view).unwrap().image
        };
        let natively = |camera| {
            native.set_camera(camera).unwrap();
            native.draw().unwrap().image
        };
        [largest_change(by_gpu, &scene), largest_change(natively, &scene)]
    });
    for (at, name) in ["GPU", "native"].into_iter().enumerate() {
        let [image_aligned, axis_aligned] = changes.map(|change| change[at]);
        println!("{name}: {image_aligned:.2e}, {axis_aligned:.2e}, {:.1}", axis_aligned / image_aligned);
        assert_at_least(
            axis_aligned / image_aligned,
            15.0,
            format_args!("{name}: how much more axis-aligned sheets pop"),
        );
    }
}
