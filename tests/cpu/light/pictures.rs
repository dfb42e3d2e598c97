//! Pictures in the light that sheets leave, by the native backend against the f64 evaluation.

use std::sync::Arc;

use glam::DVec3;
use sheetsplat::Scene;
use sheetsplat::cpu::{CpuRenderer, Simd};
use sheetsplat::image::Image;
use sheetsplat::internals::reference;
use sheetsplat::scene::{Channel, VolumeSource};
use sheetsplat::settings::{Classification, Compositing, Light, Method, Projection, Ramp, Region, Shading, Window};
use sheetsplat::volume::{Volume, builtin};

use crate::common::compare::{assert_at_least, assert_at_most};
use crate::common::images::{bits, largest_difference, rms};
use crate::common::{COMPOSITINGS, SPACINGS, lit_by_sheets, scene, transfer};
use crate::light::on_threads;
use crate::native::{draw, head, psnr, shown};

const CLASSIFICATIONS: [(Classification, f64); 2] = [(Classification::Before, 100.0), (Classification::After, 100.0)];

/// A head in the light of both kinds of sheets.
fn lit(classification: Classification) -> (Volume, Scene) {
    let (volume, mut scene) = head();
    scene.splatting.classification = classification;
    scene.shading = lit_by_sheets(scene.shading);
    (volume, scene)
}

/// A volume with a second channel, its mirror image, in another colour.
fn two_channels(volume: &Volume, scene: &mut Scene) -> Volume {
    let mirrored = volume.values().iter().rev().collect();
    let mirrored = Volume::new("mirrored", volume.dims(), volume.spacing(), mirrored).unwrap();
    let mut channel = Channel::new(VolumeSource::Memory);
    channel.transfer = transfer(&[(0.0, [0.1, 0.9, 0.2])], &[(20.0, 0.0), (220.0, 0.8)]);
    scene.channels.push(channel);
    volume.clone().with_channels("two", vec![mirrored]).unwrap()
}

fn exact(volume: &Volume, scene: &Scene) -> Image {
    reference::render(volume, &scene.resolve(volume), scene).unwrap()
}

/// The scene with another compositing; for `minimum`, whose values are those of the air around the head else, close by the inside of it, of which small
/// values have an opacity.
fn composited(compositing: Compositing, volume: &Volume, scene: &mut Scene) {
    scene.splatting.compositing = compositing;
    if compositing == Compositing::Surface {
        scene.channels[0].transfer.opacity = Some(Ramp::new(vec![(30.0, 0.0), (80.0, 0.6), (200.0, 0.9)]).unwrap());
    }
    if compositing == Compositing::Minimum {
        let half = volume.grid().center() * volume.spacing();
        scene.camera.projection = Projection::Orthographic { height: Some(1.8 * half.z) };
        scene.clip.crop = Some([-0.45 * half, 0.4 * half]);
        scene.channels[0].transfer.opacity = Some(Ramp::new(vec![(0.0, 0.9), (60.0, 0.8), (200.0, 0.1)]).unwrap());
    }
}

#[test]
fn pictures_are_those_of_the_f64_evaluation() {
    for (classification, required) in CLASSIFICATIONS {
        let mut worst = f64::INFINITY;
        let mut check = |what: &str, change: &dyn Fn(&mut Volume, &mut Scene)| {
            let (mut volume, mut scene) = lit(classification);
            change(&mut volume, &mut scene);
            let expected = exact(&volume, &scene);
            assert!(shown(&expected) > 0.05, "{what} shows nothing");
            let mut dark = scene.clone();
            (dark.shading.occlusion, dark.shading.shadow) = (0.0, 0.0);
            let unlit = exact(&volume, &dark);
            assert!(rms(&unlit, &expected) > 1e-3, "{what}: sheets change nothing");
            let psnr = psnr(&draw(&volume, &scene).image, &expected);
            println!("{classification:?}, {what}: {psnr:.1} dB");
            assert_at_least(psnr, required, format_args!("{what}, {classification:?}"));
            worst = worst.min(psnr);
        };
        let perspective = Projection::Perspective { fov_y: 40.0, distance: None, near: None };
        // After splatting averages are not shaded.
        let is_shaded = |of: &Compositing| *of != Compositing::Average || classification == Classification::Before;
        for compositing in COMPOSITINGS.into_iter().filter(is_shaded) {
            check(&format!("{compositing:?}"), &|volume, scene| composited(compositing, volume, scene));
        }
        check("perspective", &|_, scene| scene.camera.projection = perspective);
        check("headlight", &|_, scene| scene.shading.light = Light::Headlight);
        check("occlusion alone", &|_, scene| scene.shading.shadow = 0.0);
        check("shadow alone of a fixed light in perspective", &|_, scene| {
            scene.shading.occlusion = 0.0;
            scene.shading.light = Light::Direction(DVec3::new(1.0, -2.0, 1.0));
            scene.camera.projection = perspective;
        });
        for spacing in SPACINGS {
            check(&format!("spacing {spacing:?}"), &|volume, _| {
                *volume = volume.clone().with_spacing("head", DVec3::from(spacing)).unwrap();
            });
        }
        for slab_width in [0.3, 2.0] {
            check(&format!("slab width {slab_width}"), &|_, scene| scene.splatting.slab_width = slab_width);
        }
        check("linear profile", &|_, scene| {
            scene.splatting.slab_profile = sheetsplat::settings::SlabProfile::Linear;
        });
        check("cut", &|volume, scene| {
            let half = volume.grid().center() * volume.spacing();
            // No voxel's centre lies on a cut, where rounding would decide.
            scene.clip.planes = vec![[0.31, 1.0, -0.23, 0.3 * half.y], [-1.0, 0.21, 0.13, 0.6 * half.x]];
            scene.clip.crop = Some([-0.8 * half, 0.71 * half]);
        });
        for compositing in COMPOSITINGS.into_iter().filter(is_shaded) {
            check(&format!("channels, {compositing:?}"), &|volume, scene| {
                composited(compositing, volume, scene);
                *volume = two_channels(volume, scene);
            });
        }
        if classification == Classification::Before {
            check("slices", &|_, scene| scene.splatting.method = Method::AxisAligned);
            check("samples", &|_, scene| scene.splatting.method = Method::CompositeEverySample);
        }
        println!("{classification:?}: at least {worst:.1} dB");
    }
}

#[test]
fn the_same_bytes_on_any_number_of_threads_and_by_every_instruction_set() {
    for (classification, _) in CLASSIFICATIONS {
        let (volume, scene) = lit(classification);
        let drawn = |threads: usize, simd: Option<Simd>| {
            on_threads(threads, || {
                let mut renderer = CpuRenderer::new(volume.clone(), &scene).unwrap();
                simd.map_or(Ok(()), |simd| renderer.set_simd(simd)).unwrap();
                bits(&renderer.draw().unwrap().image)
            })
        };
        let alone = drawn(1, None);
        assert!([2, 7].iter().all(|&threads| drawn(threads, None) == alone), "{classification:?}");
        for simd in Simd::available() {
            assert!(drawn(2, Some(simd)) == alone, "{classification:?} {simd:?}");
        }
    }
}

/// A part has the light of the whole volume.
#[test]
fn parts_merge_to_the_whole() {
    for (classification, _) in CLASSIFICATIONS {
        let (volume, mut scene) = lit(classification);
        scene.splatting.opacity_threshold = 1.0;
        let mut renderer = CpuRenderer::new(Arc::new(volume), &scene).unwrap();
        let whole = renderer.draw().unwrap().image;
        let region = Region::whole([scene.image.width, scene.image.height]);
        let mut part = |slabs| renderer.draw_part(&Window { slabs, region }).unwrap().0;
        let merged = sheetsplat::Image::merge([part(-100..-2), part(-2..3), part(3..100)]).unwrap();
        let apart = largest_difference(&merged, &whole);
        assert!(apart < 1e-6, "{classification:?}: {apart:e}");
    }
}

/// Light that is exponential does not depend on the slabs of the picture.
#[test]
fn light_does_not_depend_on_slab_widths() {
    for (classification, _) in CLASSIFICATIONS {
        let (volume, mut scene) = lit(classification);
        scene.splatting.compositing = Compositing::Exponential;
        let mut mean_light = |slab_width: f64| {
            scene.splatting.slab_width = slab_width;
            let mean = |scene: &Scene| {
                let pixels = draw(&volume, scene).image.pixels;
                pixels.iter().map(|pixel| f64::from(pixel[0] + pixel[1] + pixel[2])).sum::<f64>()
            };
            let mut unlit = scene.clone();
            (unlit.shading.occlusion, unlit.shading.shadow) = (0.0, 0.0);
            mean(&scene) / mean(&unlit)
        };
        let (narrow, wide) = (mean_light(0.5), mean_light(2.0));
        println!("{classification:?}: {narrow:.4} of the light at 0.5, {wide:.4} at 2");
        assert!(narrow < 0.9 && (narrow - wide).abs() < 0.01, "{classification:?}: {narrow} {wide}");
    }
}

/// Shadows move evenly while the light turns around a cube: no step of 0.4° changes the picture by much more than others do.
#[test]
fn turning_light_does_not_pop() {
    let volume = builtin::volume("cube").unwrap();
    let mut scene = scene(80, 80);
    scene.camera.direction = DVec3::new(0.5, 0.8, -0.4);
    scene.splatting.compositing = Compositing::Exponential;
    scene.channels[0].transfer = transfer(&[(0.0, [0.9, 0.8, 0.7])], &[(0.0, 0.0), (255.0, 0.6)]);
    scene.shading = Shading { ambient: 0.3, diffuse: 0.7, shadow: 1.0, ..scene.shading };
    let mut renderer = CpuRenderer::new(volume, &scene).unwrap();
    let mut before: Option<Image> = None;
    let mut steps = Vec::new();
    for step in 0..=112 {
        let (sine, cosine) = (f64::from(step) * 0.4).to_radians().sin_cos();
        scene.shading.light = Light::Direction(DVec3::new(-cosine, -sine, 0.8));
        renderer.set_scene(&scene).unwrap();
        let image = renderer.draw().unwrap().image;
        steps.extend(before.map(|before| rms(&before, &image)));
        before = Some(image);
    }
    steps.sort_by(f64::total_cmp);
    let (median, largest) = (steps[steps.len() / 2], steps[steps.len() - 1]);
    println!("steps: median {median:.2e}, largest {largest:.2e}");
    assert!(median > 1e-5);
    assert_at_most(largest / median, 1.5, "the largest step");
}
