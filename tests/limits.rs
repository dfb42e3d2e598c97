//! Devices that allow less than lavapipe does: WebGPU's default limits, tiny buffers, missing features, no adapter.
#![expect(clippy::unwrap_used, reason = "tests")]

#[expect(dead_code, reason = "not every file needs all of it")]
mod common;

use glam::DVec3;
use sheetsplat::classify::classify;
use sheetsplat::error::RenderError;
use sheetsplat::gpu::device::{self, DeviceError, DeviceRequirements};
use sheetsplat::gpu::layout::Voxel;
use sheetsplat::gpu::targets::Targets;
use sheetsplat::gpu::voxel_list::VoxelLists;
use sheetsplat::headless::{Headless, HeadlessOptions};
use sheetsplat::image::Image;
use sheetsplat::scene::Scene;
use sheetsplat::splatting::{Compositing, FootprintForm};
use sheetsplat::volume::{Volume, builtin};
use sheetsplat::wgpu::{Features, Limits, TextureFormat};

use common::{F32, gpu, scene, transfer};

fn open(limits: Limits, features: Features, sheet_format: Option<TextureFormat>) -> Result<Headless, DeviceError> {
    let requirements = Some(DeviceRequirements { features, limits });
    Headless::new(&HeadlessOptions { requirements, sheet_format, ..HeadlessOptions::default() })
}

/// A small head, translucent, so that every sheet counts.
fn head() -> (Volume, Scene) {
    let mut scene = scene(150, 110);
    scene.camera.direction = DVec3::new(0.4, 0.9, -0.3);
    scene.transfer = transfer(&[(40.0, [0.9, 0.6, 0.4]), (255.0, [1.0, 1.0, 0.9])], &[(30.0, 0.0), (120.0, 0.3)]);
    (builtin::volume("head:32").unwrap(), scene)
}

/// Root mean square and largest difference of any channel.
fn difference(a: &Image, b: &Image) -> (f64, f64) {
    assert_eq!(a.pixels.len(), b.pixels.len());
    let channels = a.pixels.as_flattened().iter().zip(b.pixels.as_flattened());
    let (mut squares, mut largest) = (0.0, 0.0_f64);
    for (a, b) in channels {
        let error = f64::from(a - b).abs();
        squares += error * error;
        largest = largest.max(error);
    }
    ((squares / (4 * a.pixels.len()) as f64).sqrt(), largest)
}

#[test]
fn webgpu_default_limits_and_no_features() {
    let least = open(Limits::default(), Features::empty(), None).unwrap();
    assert_eq!(least.renderer().sheet_format(), TextureFormat::Rgba16Float);
    let full = gpu();
    assert_eq!(full.renderer().sheet_format(), TextureFormat::Rgba32Float);
    let (volume, mut scene) = head();
    for compositing in [Compositing::Linear, Compositing::Exponential, Compositing::Xray] {
        for footprint in [FootprintForm::SummedArea, FootprintForm::Sections] {
            (scene.splatting.compositing, scene.splatting.footprint) = (compositing, footprint);
            let images = [&least, &full].map(|gpu| gpu.render_volume(&volume, &scene).unwrap().image);
            let (rms, _) = difference(&images[0], &images[1]);
            // f16 sheets are asked for 45 dB against the twin, f32 ones for far more.
            let decibels = -20.0 * rms.log10();
            assert!(decibels > 45.0, "{compositing:?} {footprint:?}: {decibels} dB");
        }
    }
}

#[test]
fn rgba32float_sheets_take_the_default_limits_too() {
    let gpu = open(Limits::default(), Features::FLOAT32_BLENDABLE, None).unwrap();
    assert_eq!(gpu.renderer().sheet_format(), TextureFormat::Rgba32Float);
    let (volume, scene) = head();
    let images = [gpu, self::gpu()].map(|gpu| gpu.render_volume(&volume, &scene).unwrap().image);
    assert!(images[0].pixels == images[1].pixels, "the same device, the same work, the same bytes");
}

#[test]
fn small_bindings_split_voxels_and_image() {
    let (_, mut scene) = head();
    let volume = builtin::volume("head:64").unwrap();
    let classified: Vec<Voxel> = classify(&volume, &scene.transfer.resolve(&volume));
    let full = gpu();
    for bytes in [16 << 10, 64 << 10] {
        let limits = Limits { max_storage_buffer_binding_size: bytes, max_buffer_size: bytes, ..Limits::default() };
        let small = open(limits, Features::FLOAT32_BLENDABLE, None).unwrap();
        assert_eq!(small.device().limits().max_buffer_size, bytes, "wgpu gave what was asked for");
        let lists = VoxelLists::upload(small.device(), &classified);
        assert!(lists.lists.len() > 3, "{} lists", lists.lists.len());
        assert_eq!(lists.len(), classified.len() as u64);
        let targets = Targets::new(small.device(), [150, 110], TextureFormat::Rgba32Float).unwrap();
        assert!(targets.bands.len() > 3, "{} bands", targets.bands.len());
        for compositing in [Compositing::Linear, Compositing::Exponential, Compositing::Xray] {
            for background in [[0.0, 0.0, 0.0, 1.0], [0.2, 0.9, 0.5, 0.5]] {
                (scene.splatting.compositing, scene.image.background) = (compositing, background);
                let renderings = [&small, &full].map(|gpu| gpu.render_volume(&volume, &scene).unwrap());
                assert_eq!(renderings[0].stats.counts, renderings[1].stats.counts);
                let (_, largest) = difference(&renderings[0].image, &renderings[1].image);
                // The lists change the order in which a sheet's footprints are added: no more than 64 of them meet in a
                // pixel of a sheet. What that changes in a sheet's amount changes the image no more.
                let sheets = renderings[1].stats.counts.sheets as f64;
                assert!(largest < 64.0 * F32 * sheets, "{bytes} bytes {compositing:?}: {largest}");
            }
        }
    }
}

#[test]
fn rgba32float_sheets_need_blending() {
    match open(Limits::default(), Features::empty(), Some(TextureFormat::Rgba32Float)) {
        Err(error @ DeviceError::MissingFeatures { required, actual }) => {
            assert_eq!(required, Features::FLOAT32_BLENDABLE);
            assert!(!actual.contains(required));
            let message = error.to_string();
            assert!(message.contains("required") && message.contains("FLOAT32_BLENDABLE"), "{message}");
            assert!(message.contains("actual"), "{message}");
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn images_larger_than_a_texture_are_an_error() {
    let limits = Limits { max_texture_dimension_2d: 256, ..Limits::default() };
    let gpu = open(limits, Features::empty(), None).unwrap();
    let (volume, mut scene) = head();
    for (size, key) in [((257, 16), "image.width"), ((16, 300), "image.height")] {
        (scene.image.width, scene.image.height) = size;
        match gpu.render_volume(&volume, &scene) {
            Err(error @ RenderError::Limit { what, limit, required, actual }) => {
                let expected = (key, "max_texture_dimension_2d", u64::from(size.0.max(size.1)), 256);
                assert_eq!((what, limit, required, actual), expected);
                let message = error.to_string();
                for part in [key, "max_texture_dimension_2d", &required.to_string(), "256"] {
                    assert!(message.contains(part), "{message}");
                }
            }
            other => panic!("{size:?}: {other:?}"),
        }
    }
    (scene.image.width, scene.image.height) = (256, 16);
    gpu.render_volume(&volume, &scene).unwrap();
}

#[test]
fn a_row_larger_than_a_binding_is_an_error() {
    let limits = Limits { max_storage_buffer_binding_size: 1024, ..Limits::default() };
    let gpu = open(limits, Features::empty(), None).unwrap();
    let (volume, mut scene) = head();
    (scene.image.width, scene.image.height) = (65, 16);
    match gpu.render_volume(&volume, &scene) {
        Err(RenderError::Limit { what, limit, required, actual }) => {
            assert!(what.contains("image.width"), "{what}");
            assert_eq!((limit, required, actual), ("max_storage_buffer_binding_size", 65 * 16, 1024));
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn an_unknown_adapter_is_an_error_that_names_those_there_are() {
    let there = Headless::new(&HeadlessOptions::default()).unwrap();
    let name = there.render_volume(&head().0, &head().1).unwrap().stats.adapter;
    match Headless::new(&HeadlessOptions { adapter: Some("no such GPU".to_owned()), ..HeadlessOptions::default() }) {
        Err(error @ DeviceError::NoAdapter { .. }) => {
            let message = error.to_string();
            assert!(message.contains("\"no such GPU\"") && message.contains(&name), "{message}");
        }
        other => panic!("{other:?}"),
    }
    // Any part of a name will do, in any case.
    let part = name[1..].to_uppercase();
    Headless::new(&HeadlessOptions { adapter: Some(part), ..HeadlessOptions::default() }).unwrap();
}

#[test]
fn a_limit_that_is_too_small_is_named() {
    let small: [(&str, u64, u64, Limits); 5] = [
        ("max_texture_array_layers", 128, 64, Limits { max_texture_array_layers: 64, ..Limits::default() }),
        (
            "max_storage_buffers_per_shader_stage",
            4,
            3,
            Limits { max_storage_buffers_per_shader_stage: 3, ..Limits::default() },
        ),
        (
            "max_compute_invocations_per_workgroup",
            256,
            128,
            Limits { max_compute_invocations_per_workgroup: 128, ..Limits::default() },
        ),
        ("max_compute_workgroup_size_x", 256, 64, Limits { max_compute_workgroup_size_x: 64, ..Limits::default() }),
        (
            "max_color_attachment_bytes_per_sample",
            16,
            8,
            Limits { max_color_attachment_bytes_per_sample: 8, ..Limits::default() },
        ),
    ];
    for (name, needed, available, limits) in small {
        match open(limits, Features::empty(), None) {
            Err(error @ DeviceError::Limit { limit, required, actual }) => {
                assert_eq!((limit, required, actual), (name, needed, available));
                let message = error.to_string();
                for part in [name, &needed.to_string(), &available.to_string()] {
                    assert!(message.contains(part), "{message}");
                }
            }
            other => panic!("{name}: {other:?}"),
        }
    }
    device::check(gpu().device()).unwrap();
}

#[test]
fn limits_beyond_the_adapter_are_an_error_that_names_it() {
    let limits = Limits { max_texture_dimension_2d: u32::MAX, ..Limits::default() };
    match open(limits, Features::empty(), None) {
        Err(error @ DeviceError::RequestDevice { .. }) => {
            let message = error.to_string();
            assert!(message.contains("max_texture_dimension_2d"), "{message}");
        }
        other => panic!("{other:?}"),
    }
}
