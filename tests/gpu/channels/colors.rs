//! Volumes of colours (SPEC §10): the voxel's own colour, opacity over its luminance times A.

use glam::{DVec3, UVec3};
use sheetsplat::headless::{Backend, GpuHeadless};
use sheetsplat::settings::{Classification, Compositing, Gradient, Interpolation, Rasterizer, Splatting};
use sheetsplat::volume::{SampleType, Volume};
use sheetsplat::{GpuVolume, Scene};

use super::{CLASSIFICATIONS, NATIVE, draw};
use crate::common::cases::in_turns;
use crate::common::compare::{assert_at_least, assert_at_most, decibels};
use crate::common::devices::gpu;
use crate::common::images::{largest_difference, rms};
use crate::common::{COMPOSITINGS, RASTERIZERS, Random, camera, scene, transfer};

/// A ball of waves of colour in bytes, with A and some holes, and a scene that shows it.
fn colored(random: &mut Random, spacing: DVec3) -> (Volume, Scene) {
    let dims = UVec3::new(13, 11, 12);
    let phase = random.uniform(0.0, 6.0);
    let colors: Vec<[f32; 4]> = (0..dims.element_product())
        .map(|index| {
            let voxel = UVec3::new(index % dims.x, index / dims.x % dims.y, index / dims.x / dims.y).as_dvec3();
            let from_center = voxel - (dims.as_dvec3() - 1.0) / 2.0;
            if random.bits().is_multiple_of(101) {
                return [f32::NAN; 4];
            }
            let inside = (1.0 - from_center.length() / 6.5).clamp(0.0, 1.0).sqrt();
            let wave = |scale: f64| ((voxel.element_sum() * scale + phase).sin() * 0.5 + 0.5) * inside * 255.0;
            let alpha = ((voxel.x * 0.4).cos() * 0.5 + 0.5) * 255.0;
            [wave(0.3), wave(0.5), wave(0.2), alpha].map(|number| number.round() as f32)
        })
        .collect();
    let volume = Volume::from_colors("colours", dims, spacing, (&colors, SampleType::U8)).unwrap();
    let mut scene = scene(40, 36);
    scene.camera = camera(random.direction().to_array(), 22.0);
    scene.splatting.culling = false;
    scene.channels[0].transfer = transfer(&[(0.0, [1.0, 0.0, 0.0])], &[(20.0, 0.0), (140.0, 0.7)]);
    (volume, scene)
}

#[test]
fn the_native_backend_draws_what_the_twin_draws() {
    let mut random = Random(51);
    for (classification, compositing) in
        CLASSIFICATIONS.into_iter().flat_map(|c| COMPOSITINGS.map(|compositing| (c, compositing)))
    {
        for interpolation in [Interpolation::Smooth, Interpolation::Exact] {
            if interpolation == Interpolation::Exact && classification == Classification::Before {
                continue;
            }
            let (volume, mut scene) = colored(&mut random, DVec3::new(1.0, 1.2, 0.9));
            scene.splatting = Splatting { classification, compositing, interpolation, ..scene.splatting };
            scene.shading.gradient = Gradient::Differences;
            let [actual, expected] = NATIVE.map(|backend| draw(backend, &volume, &scene));
            assert!(expected.image.pixels.iter().filter(|pixel| pixel[3] > 0.05).count() > 200);
            let required = match (classification, compositing) {
                (_, Compositing::Surface) => 40.0,
                (Classification::After, _) => 60.0,
                _ => 80.0,
            };
            let what = format!("{classification:?} {compositing:?} {interpolation:?}");
            if actual.image != expected.image {
                assert_at_least(decibels(rms(&actual.image, &expected.image)), required, &what);
            }
            assert_eq!(actual.stats.counts.voxels_in_range, expected.stats.counts.voxels_in_range, "{what}");
        }
    }
}

/// Compares the GPU's images with the twin's.
fn assert_is_the_twins(gpu: &GpuHeadless, volume: &Volume, scene: &Scene) {
    let Splatting { classification, compositing, interpolation, .. } = scene.splatting;
    let expected = draw(Backend::Reference, volume, scene);
    assert!(expected.image.pixels.iter().filter(|pixel| pixel[3] > 0.05).count() > 100, "{compositing:?}");
    for rasterizer in RASTERIZERS {
        let splatting = Splatting { rasterizer, ..scene.splatting };
        let actual = gpu.render_volume(volume.clone(), &Scene { splatting, ..scene.clone() }).unwrap();
        let what = format!("{classification:?} {compositing:?} {interpolation:?} by {rasterizer:?}");
        let required = match (classification, rasterizer, compositing) {
            (_, _, Compositing::Surface) => 40.0,
            (Classification::After, ..) | (_, Rasterizer::Quads, _) => 60.0,
            _ => 80.0,
        };
        let measured = decibels(rms(&actual.image, &expected.image));
        println!("{what}: {measured:.1} dB");
        assert_at_least(measured, required, &what);
        assert_eq!(actual.stats.counts.voxels_in_range, expected.stats.counts.voxels_in_range, "{what}");
    }
}

#[test]
fn the_gpu_draws_what_the_twin_draws() {
    let gpu = gpu();
    let mut random = Random(52);
    for (turn, (classification, compositing)) in
        CLASSIFICATIONS.into_iter().flat_map(|c| COMPOSITINGS.map(|compositing| (c, compositing))).enumerate()
    {
        for interpolation in in_turns(turn, [Interpolation::Smooth, Interpolation::Exact]) {
            if interpolation == Interpolation::Exact && classification == Classification::Before {
                continue;
            }
            let (volume, mut scene) = colored(&mut random, DVec3::new(1.0, 1.2, 0.9));
            scene.splatting = Splatting { classification, compositing, interpolation, ..scene.splatting };
            assert_is_the_twins(gpu, &volume, &scene);
        }
    }
}

/// Colours in the second and fourth of four channels.
#[test]
fn the_gpu_draws_colours_of_any_channel() {
    let gpu = gpu();
    let mut random = Random(56);
    for (round, (classification, compositing)) in COMPOSITINGS
        .into_iter()
        .enumerate()
        .flat_map(|(turn, compositing)| in_turns(turn, CLASSIFICATIONS).into_iter().map(move |c| (c, compositing)))
        .enumerate()
    {
        let (first, mut scene) = colored(&mut random, DVec3::ONE);
        let (second, _) = colored(&mut random, DVec3::ONE);
        let plain = |from: &Volume, factor: f32| {
            let values = from.values().iter().map(|value| factor * value).collect();
            Volume::new("values", from.dims(), DVec3::ONE, values).unwrap()
        };
        let channels = vec![first.clone(), plain(&first, 0.8), second.clone()];
        let volume = plain(&second, 0.9).with_channels("test", channels).unwrap();
        let faint = |color| transfer(&[(0.0, color)], &[(20.0, 0.0), (140.0, 0.3)]);
        let own = scene.channels[0].transfer.clone();
        let transfers = [faint([0.1, 0.9, 0.2]), own.clone(), faint([0.9, 0.1, 0.8]), own];
        super::set_transfers(&mut scene, &transfers);
        scene.splatting = Splatting { classification, compositing, ..scene.splatting };
        if round % 3 == 2 && classification == Classification::After {
            scene.splatting.interpolation = Interpolation::Exact;
        }
        assert_is_the_twins(gpu, &volume, &scene);
    }
}

#[test]
fn gray_colours_are_a_volume_of_values() {
    let mut random = Random(53);
    let (colored, mut scene) = colored(&mut random, DVec3::ONE);
    let values: Vec<f32> = colored.values().iter().map(|value| value.round()).collect();
    let grays: Vec<[f32; 4]> = values.iter().map(|&value| [value, value, value, 255.0]).collect();
    let dims = colored.dims();
    let grays = Volume::from_colors("grays", dims, DVec3::ONE, (&grays, SampleType::U8)).unwrap();
    let plain = Volume::new("values", dims, DVec3::ONE, values).unwrap();
    scene.channels[0].transfer = transfer(&[(0.0, [0.0; 3]), (255.0, [1.0; 3])], &[(20.0, 0.0), (140.0, 0.7)]);
    for (classification, backend) in CLASSIFICATIONS.into_iter().flat_map(|c| NATIVE.map(|backend| (c, backend))) {
        scene.splatting.classification = classification;
        let [a, b] = [&grays, &plain].map(|volume| draw(backend, volume, &scene).image);
        // A slab's own colour is the mean of two planes', not that over the values between them.
        let allowed = if classification == Classification::After { 0.02 } else { 2e-5 };
        assert_at_most(largest_difference(&a, &b), allowed, format!("{backend} {classification:?}"));
    }
}

#[test]
fn alpha_is_a_factor_of_opacity() {
    let mut random = Random(54);
    let (volume, mut scene) = colored(&mut random, DVec3::ONE);
    let with_alpha = |alpha: f32| {
        let colors: Vec<[f32; 4]> = (0..volume.values().len() as u32)
            .map(|index| {
                let [red, green, blue, _] = (volume.color(index).unwrap() * 255.0).as_vec4().to_array();
                [red, green, blue, alpha].map(f32::round)
            })
            .collect();
        Volume::from_colors("colours", volume.dims(), DVec3::ONE, (&colors, SampleType::U8)).unwrap()
    };
    let faint = transfer(&[(0.0, [1.0; 3])], &[(20.0, 0.0), (140.0, 0.2 * 0.7)]);
    let strong = transfer(&[(0.0, [1.0; 3])], &[(20.0, 0.0), (140.0, 0.7)]);
    for (classification, backend) in CLASSIFICATIONS.into_iter().flat_map(|c| NATIVE.map(|backend| (c, backend))) {
        scene.splatting.classification = classification;
        let mut image = |volume: &Volume, transfer: &sheetsplat::scene::TransferSettings| {
            scene.channels[0].transfer = transfer.clone();
            draw(backend, volume, &scene).image
        };
        let (expected, actual) = (image(&with_alpha(255.0), &faint), image(&with_alpha(51.0), &strong));
        assert_at_most(largest_difference(&actual, &expected), 2e-5, format!("{backend} {classification:?}"));
        let nothing = image(&with_alpha(0.0), &strong);
        assert!(nothing.pixels.iter().all(|pixel| pixel[..3] == [0.0; 3]), "{backend} {classification:?}");
    }
}

#[test]
fn colours_take_their_own_memory() {
    let gpu = gpu();
    let (volume, _) = colored(&mut Random(55), DVec3::ONE);
    let plain = Volume::new("values", volume.dims(), DVec3::ONE, volume.values().to_vec()).unwrap();
    let bytes = |volume: &Volume| {
        let estimated = GpuVolume::estimate(gpu.device(), volume).unwrap()[0];
        let uploaded = GpuVolume::new(gpu.device(), gpu.queue(), volume.clone()).unwrap();
        assert_eq!(uploaded.gpu_bytes(), estimated);
        estimated
    };
    // Four bytes for each voxel, like an f32 value.
    assert_eq!(bytes(&volume), 2 * bytes(&plain));
}
