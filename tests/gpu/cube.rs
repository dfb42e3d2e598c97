//! Figs. 3 and 6: a cube seen at 44.8° and 45.2°, between which axis-aligned sheets change their axis and image-aligned ones hardly change.
//! `cargo test --test gpu cube:: -- --nocapture` prints the measurements.

use glam::DVec3;
use sheetsplat::image::Image;
use sheetsplat::internals::reference;
use sheetsplat::scene::Scene;
use sheetsplat::settings::Ramp;
use sheetsplat::settings::{Compositing, Method, Splatting};
use sheetsplat::volume::{Volume, builtin};

use crate::common::compare::assert_at_most;
use crate::common::devices::{DRAWINGS, Drawing, gpu};
use crate::common::images::color_rms;
use crate::common::{scene, transfer};

const SIZE: u32 = 256;

/// Opacity 0.5 per unit, with only diffuse light on both faces.
fn cube() -> (Volume, Scene) {
    let mut scene = scene(SIZE, SIZE);
    scene.channels[0].transfer = transfer(&[(0.0, [1.0; 3])], &[(0.0, 0.0), (255.0, 0.5)]);
    (scene.shading.ambient, scene.shading.diffuse, scene.shading.specular) = (0.0, 1.0, 0.0);
    (builtin::volume("cube").unwrap(), scene)
}

/// The mean red of a face away from its edges; the face extends 22 units to a side and 16 up and down.
fn face(image: &Image, side: f64, pixels_per_unit: f64) -> f64 {
    let reds = image.pixels.iter().zip(0..).filter_map(|(pixel, at)| {
        let x = side * (f64::from(at % SIZE) - 127.5) / pixels_per_unit;
        let y = (f64::from(at / SIZE) - 127.5) / pixels_per_unit;
        ((6.0..16.0).contains(&x) && y.abs() < 10.0).then_some(f64::from(pixel[0]))
    });
    let (count, sum) = reds.fold((0.0, 0.0), |(count, sum), red| (count + 1.0, sum + red));
    sum / count
}

/// The difference between the two views, and the brightness ratio of the face that looks slightly more towards the light.
struct Turned {
    rms: f64,
    ratio: f64,
}

impl Turned {
    fn new(name: &str, render: impl Fn(&Volume, &Scene) -> Image, volume: &Volume, mut scene: Scene) -> Self {
        let [before, after] = [44.8_f64, 45.2].map(|degrees| {
            let (sine, cosine) = degrees.to_radians().sin_cos();
            scene.camera.direction = DVec3::new(sine, cosine, 0.0);
            render(volume, &scene)
        });
        let pixels_per_unit = f64::from(SIZE) / 2.0 / volume.grid().bounding_radius(2.0);
        let [right, left] = [1.0, -1.0].map(|side| face(&before, side, pixels_per_unit));
        let rms = color_rms(&before, &after);
        let Splatting { method, compositing, .. } = scene.splatting;
        println!("{name}, {method:?}, {compositing:?}: rms {rms:.4}, right face over left {:.4}", right / left);
        Self { rms, ratio: right / left }
    }
}

#[test]
fn the_cube_does_not_pop() {
    let gpu = gpu();
    let by = |drawing: Drawing| {
        let gpu = &gpu;
        move |volume: &Volume, scene: &Scene| drawing.render(gpu, volume, scene).image
    };
    let twin = |volume: &Volume, scene: &Scene| {
        reference::render(volume, &[scene.channels[0].transfer.resolve(volume)], scene).unwrap()
    };
    // The faces are turned 44.8° and 45.2° from the light.
    let cosines = 44.8_f64.to_radians().cos() / 45.2_f64.to_radians().cos();
    let (volume, mut scene) = cube();
    let by_all = |scene: &Scene| {
        let drawn = DRAWINGS.map(|drawing| {
            let name = format!("{drawing:?}");
            let turned = Turned::new(&name, by(drawing), &volume, scene.clone());
            (name, turned)
        });
        let twin = ("twin".to_owned(), Turned::new("twin", twin, &volume, scene.clone()));
        drawn.into_iter().chain([twin]).collect::<Vec<_>>()
    };
    for (name, Turned { rms, ratio }) in by_all(&scene) {
        assert_at_most(rms, 0.003, &name);
        // Along the flatter of two rays more of the lit layer lies before the dark inside, which reduces the ratio slightly.
        assert!(1.0 < ratio && ratio < cosines, "{name}: {ratio}");
    }
    scene.splatting.method = Method::AxisAligned;
    for (name, Turned { rms, ratio }) in by_all(&scene) {
        assert!((0.045..0.055).contains(&rms), "{name}: {rms}");
        assert!(ratio > 1.2, "{name}: {ratio}");
    }
    scene.splatting.method = Method::ImageAligned;
    scene.splatting.compositing = Compositing::Exponential;
    for (name, Turned { rms, ratio }) in by_all(&scene) {
        assert_at_most(rms, 0.00165, &name);
        assert!(1.0027 < ratio && ratio < cosines, "{name}: {ratio}");
    }
    // A lit layer that hides everything behind it.
    scene.channels[0].transfer.opacity = Some(Ramp::new(vec![(0.0, 0.0), (255.0, 1.0)]).unwrap());
    for (name, Turned { ratio, .. }) in by_all(&scene) {
        assert_at_most((ratio / cosines - 1.0).abs(), 0.0006, name);
    }
}
