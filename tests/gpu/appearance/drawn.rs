//! What the chosen appearance shows, by whatever draws.

use glam::{DVec3, UVec3};
use sheetsplat::appearance::{Preset, categories};
use sheetsplat::image::Image;
use sheetsplat::settings::Rasterizer;
use sheetsplat::volume::Volume;

use crate::appearance::{builtin_scene, three_five};
use crate::common::devices::{Drawing, gpu};
use crate::common::{camera, scene};

/// The rasterizer that `auto` chooses, and the native backend.
const BY_CHOICE: [Drawing; 2] = [Drawing::By(Rasterizer::Auto), Drawing::Native];

/// Where 3 meets 5, all colours are mixtures of the two, without the colour of 4.
#[test]
fn the_border_of_two_labels_has_no_third_colour() {
    let gpu = gpu();
    let volume = three_five();
    let mut scene = scene(90, 60);
    scene.camera = camera([0.0, 1.0, 0.0], 20.0);
    scene.shading.enabled = false;
    for drawing in BY_CHOICE {
        assert_mixtures_of_two(drawing, &drawing.render(gpu, &volume, &scene).image);
    }
}

fn assert_mixtures_of_two(drawing: Drawing, image: &Image) {
    let [three, four, five] = [3, 4, 5].map(categories::color);
    let normal = three.cross(five).normalize();
    assert!(normal.dot(four).abs() > 0.1, "4 is no mixture");
    let mut seen = [0; 3];
    // The middle of the box, without the corner.
    for y in 20..40 {
        for x in 15..75 {
            let [r, g, b, _] = image.pixels[y * 90 + x].map(f64::from);
            let color = DVec3::new(r, g, b);
            assert!(normal.dot(color).abs() < 1e-3, "{drawing:?}: {color} at {x} {y}");
            seen[0] += u32::from(color.distance(three) < 0.02);
            seen[1] += u32::from(color.distance(five) < 0.02);
            seen[2] += u32::from(color.distance(three) > 0.1 && color.distance(five) > 0.1);
        }
    }
    assert!(seen[0] > 300 && seen[1] > 300, "{drawing:?}: {seen:?}");
    assert!(seen[2] < 20 * 9, "{drawing:?}: a wide border: {seen:?}");
}

#[test]
fn an_xray_along_an_axis_reaches_white_and_no_more() {
    let gpu = gpu();
    for (name, direction) in
        [("head:48", [0.0, 1.0, 0.0]), ("tomato:48", [1.0, 0.0, 0.0]), ("nerve:64", [0.0, 0.0, 1.0])]
    {
        let mut scene = builtin_scene(name, &["preset=xray", "image.width=80", "image.height=80"]);
        scene.camera.direction = direction.into();
        scene.camera.up = if direction[2] == 0.0 { DVec3::Z } else { DVec3::Y };
        let volume = scene.load_volume().unwrap();
        for drawing in BY_CHOICE {
            let image = drawing.render(gpu, &volume, &scene).image;
            let brightest = image.pixels.iter().map(|pixel| pixel[0]).fold(0.0, f32::max);
            let saturated = image.pixels.iter().filter(|pixel| pixel[0] >= 1.0).count();
            let what = format!("{name}, {drawing:?}");
            assert!(brightest > 0.35 && saturated < 80 * 80 / 50, "{what}: {brightest}, {saturated} pixels are white");
            assert!(image.pixels.iter().all(|[r, g, b, _]| r == g && g == b), "{what}: no grey");
        }
    }
}

/// A bright ball behind a dim wall: the maximum along the ray shows through anything in front of it.
#[test]
fn a_mip_shows_the_brightest_value() {
    let gpu = gpu();
    let dims = UVec3::new(20, 24, 20);
    let value = |index: u32| {
        let p = UVec3::new(index % 20, index / 20 % 24, index / 480).as_dvec3();
        match p {
            p if p.distance(DVec3::new(9.5, 17.0, 9.5)) < 4.5 => 200.0,
            p if (3.0..7.0).contains(&p.y) => 80.0,
            _ => 0.0,
        }
    };
    let volume = Volume::new("ball", dims, DVec3::ONE, (0..dims.element_product()).map(value).collect()).unwrap();
    let mut scene = builtin_scene("cube:8", &["preset=mip", "image.width=40", "image.height=40"]);
    scene.camera = camera([0.0, 1.0, 0.0], 20.0);
    for drawing in BY_CHOICE {
        let image = drawing.render(gpu, &volume, &scene).image;
        let [ball, wall] = [20 * 40 + 20, 6 * 40 + 6].map(|at: usize| f64::from(image.pixels[at][0]));
        assert!(ball > 0.9 && (0.3..0.5).contains(&wall), "{drawing:?}: {ball} {wall}");
    }
}

#[test]
fn every_preset_shows_something_of_every_builtin() {
    let gpu = gpu();
    for (preset, kind) in Preset::ALL {
        for name in ["head:32", "tomato:32", "nerve:48"] {
            if kind == Preset::Labels && name.starts_with("nerve") {
                continue;
            }
            let scene = builtin_scene(
                name,
                &[&format!("preset={preset}"), "image.width=64", "image.height=64", "camera.direction=[0,1,0]"],
            );
            // Without contrast agent few vessels are visible, and thin branches are faint in a sum.
            let least = match kind {
                Preset::CtVessels => 20,
                Preset::Xray => 40,
                _ => 80,
            };
            let volume = scene.load_volume().unwrap();
            for drawing in BY_CHOICE {
                let image = drawing.render(gpu, &volume, &scene).image;
                let lit = image.pixels.iter().filter(|pixel| pixel[..3].iter().any(|&c| c > 0.1)).count();
                assert!(lit > least, "{preset} of {name}, {drawing:?}: {lit} pixels");
            }
        }
    }
}
