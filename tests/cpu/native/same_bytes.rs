//! The same bytes (SPEC §12), whatever the number of threads and the instruction set: of images, first hits and counts.

use std::sync::Arc;

use glam::DVec3;
use sheetsplat::Scene;
use sheetsplat::cpu::{CpuRenderer, Simd, StreamRenderer};
use sheetsplat::headless::Rendering;
use sheetsplat::scene::{Channel, VolumeSource};
use sheetsplat::settings::{Classification, Compositing, Method, Order, Projection};
use sheetsplat::stats::Counts;
use sheetsplat::volume::{SampleType, Volume};

use crate::common::images::bits;
use crate::common::store::{self, MemoryStore};
use crate::common::{COMPOSITINGS, Random, transfer};
use crate::native::after::random_after;
use crate::native::{head, random_case, surfaces};

const THREADS: [usize; 5] = [1, 2, 3, 7, 64];

/// What a frame gives.
fn drawn(renderer: &mut CpuRenderer) -> (Vec<u32>, Vec<u32>, Counts) {
    let Rendering { image, stats } = renderer.draw().unwrap();
    let hits = renderer.first_hits().unwrap_or_default().iter().map(|depth| depth.to_bits());
    (bits(&image), hits.collect(), stats.counts)
}

/// Some views of every kind.
fn cases(random: &mut Random, count: usize) -> Vec<(String, CpuRenderer)> {
    let mut cases = Vec::new();
    let mut add = |what: String, volume: &Volume, scene: &Scene, host: Option<(Vec<f32>, Option<f64>)>| {
        let mut renderer = CpuRenderer::new(volume.clone(), scene).unwrap();
        if let Some((depths, first_hit)) = host {
            renderer.set_surfaces(Some(depths)).unwrap();
            renderer.set_first_hit(first_hit).unwrap();
        }
        cases.push((format!("{what} with {scene:?}"), renderer));
    };
    for case in 0..count {
        let compositing = COMPOSITINGS[case % COMPOSITINGS.len()];
        for classification in [Classification::Before, Classification::After] {
            let is_after = classification == Classification::After;
            let (volume, mut scene) = if is_after { random_after(random) } else { random_case(random) };
            if scene.splatting.method != Method::CompositeEverySample {
                scene.splatting.compositing = compositing;
            }
            if scene.splatting.compositing == Compositing::Surface {
                scene.splatting.order = Order::FrontToBack;
            }
            add(format!("case {case}"), &volume, &scene, None);
            // What follows has sheets that are parallel to the image.
            scene.splatting.method = Method::ImageAligned;
            scene.splatting.compositing = compositing;
            scene.splatting.order = Order::FrontToBack;
            match (case + usize::from(is_after)) % 3 {
                0 => {
                    let depths = surfaces::depths(random, &volume, &scene);
                    let threshold = scene.splatting.opacity_threshold;
                    let first_hit = (compositing != Compositing::Minimum).then_some(0.4_f64.min(threshold));
                    add(format!("host {case}"), &volume, &scene, Some((depths, first_hit)));
                }
                1 => {
                    let (channels, scene) = two_channels(&volume, &scene);
                    add(format!("channels {case}"), &channels, &scene, None);
                }
                _ => add(format!("colours {case}"), &colored(&volume), &scene, None),
            }
        }
    }
    cases
}

/// A volume with a second channel, its mirror image, in another colour.
fn two_channels(volume: &Volume, scene: &Scene) -> (Volume, Scene) {
    let mirrored = volume.values().iter().rev().collect();
    let mirrored = Volume::new("mirrored", volume.dims(), volume.spacing(), mirrored).unwrap();
    let mut channel = Channel::new(VolumeSource::Memory);
    channel.transfer = transfer(&[(0.0, [0.1, 0.9, 0.2])], &[(20.0, 0.0), (220.0, 0.8)]);
    let mut scene = scene.clone();
    scene.channels.push(channel);
    (volume.clone().with_channels("two", vec![mirrored]).unwrap(), scene)
}

/// A volume of colours whose luminance is about that of the values.
fn colored(volume: &Volume) -> Volume {
    let of_value = |(index, value): (usize, f32)| {
        let [value, other] = [value.clamp(0.0, 255.0), ((index * 37) % 256) as f32];
        [value.round(), (0.9 * value).round(), (0.5 * value).round(), 128.0 + (other / 2.0).floor()]
    };
    let colors: Vec<[f32; 4]> = volume.values().iter().enumerate().map(of_value).collect();
    Volume::from_colors("colours", volume.dims(), volume.spacing(), (&colors, SampleType::U8)).unwrap()
}

#[test]
fn threads_change_no_bit() {
    let pools = THREADS.map(|count| rayon::ThreadPoolBuilder::new().num_threads(count).build().unwrap());
    for (what, mut renderer) in cases(&mut Random(3), 9) {
        let [one, more @ ..] = pools.each_ref().map(|pool| pool.install(|| drawn(&mut renderer)));
        for (threads, other) in THREADS[1..].iter().zip(&more) {
            assert!(*other == one, "{threads} threads differ from one: {what}");
        }
    }
}

/// A picture of one tile, whose pixels are larger than voxels.
#[test]
fn threads_change_no_bit_of_a_small_picture() {
    let (volume, mut scene) = head();
    (scene.image.width, scene.image.height) = (9, 7);
    scene.splatting.classification = Classification::After;
    let pools = THREADS.map(|count| rayon::ThreadPoolBuilder::new().num_threads(count).build().unwrap());
    for compositing in [Compositing::Linear, Compositing::Surface, Compositing::Average] {
        scene.splatting.compositing = compositing;
        let mut renderer = CpuRenderer::new(volume.clone(), &scene).unwrap();
        let [one, more @ ..] = pools.each_ref().map(|pool| pool.install(|| drawn(&mut renderer)));
        assert!(one.0.iter().any(|bits| *bits != one.0[0]), "something shows");
        for (threads, other) in THREADS[1..].iter().zip(&more) {
            assert!(*other == one, "{threads} threads differ from one: {compositing:?}");
        }
    }
}

#[test]
fn instruction_sets_change_no_bit() {
    let levels = Simd::available();
    println!("{levels:?}");
    assert!(levels.len() >= 2, "only {levels:?}");
    for (what, mut renderer) in cases(&mut Random(21), 12) {
        let [first, more @ ..] = &levels[..] else { unreachable!() };
        renderer.set_simd(*first).unwrap();
        let expected = drawn(&mut renderer);
        for level in more {
            renderer.set_simd(*level).unwrap();
            assert!(drawn(&mut renderer) == expected, "{level:?} differs from {first:?}: {what}");
        }
        assert_eq!(renderer.draw().unwrap().stats.driver, more[more.len() - 1].name());
    }
    for missing in Simd::ALL.into_iter().filter(|level| !levels.contains(level)) {
        let (volume, scene) = head();
        let message = CpuRenderer::new(volume, &scene).unwrap().set_simd(missing).unwrap_err().to_string();
        assert!(message.contains("SHEETSPLAT_SIMD") && message.contains(missing.name()), "{message}");
    }
}

/// Of a store that is read while it is drawn; `tests/program/backends.rs` compares instruction sets.
#[test]
fn threads_change_no_bit_of_a_stream() {
    let (volume, mut scene) = head();
    let volume = Volume::new("head", volume.dims(), volume.spacing(), volume.values().to_vec()).unwrap();
    scene.splatting.culling = true;
    for (classification, compositing, projection) in [
        (Classification::Before, Compositing::Linear, None),
        (Classification::Before, Compositing::Surface, None),
        (Classification::After, Compositing::Exponential, None),
        (
            Classification::After,
            Compositing::Linear,
            Some(Projection::Perspective { fov_y: 40.0, distance: None, near: None }),
        ),
    ] {
        (scene.splatting.classification, scene.splatting.compositing) = (classification, compositing);
        scene.camera.projection = projection.unwrap_or(scene.camera.projection);
        let store = Arc::new(MemoryStore::new(&volume, DVec3::splat(8.0).as_uvec3()));
        let renderer = StreamRenderer::new(store::streamed(store, 0, &volume, 1 << 30), &scene).unwrap();
        let [one, more @ ..] = THREADS.map(|count| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build().unwrap();
            bits(&pool.install(|| renderer.draw().unwrap().image))
        });
        assert!(one.iter().any(|bits| bits != &one[0]), "something shows");
        for (threads, other) in THREADS[1..].iter().zip(&more) {
            assert!(*other == one, "{threads} threads differ from one: {classification:?}, {compositing:?}");
        }
    }
}
