//! Devices with low and insufficient limits, and options that no device supports.

use sheetsplat::internals::gpu::device::{DeviceError, InsufficientLimit, TILE_FEATURES};
use sheetsplat::{Blend, DeviceRequirements, Renderer, RendererOptions};
use wgpu::{Features, Limits, TextureFormat};

use crate::compare::{assert_at_most, largest};
use crate::{Host, OPAQUE, TRANSPARENT, pixels, scene};

const F32: TextureFormat = TextureFormat::Rgba32Float;

fn replacing(format: TextureFormat) -> RendererOptions {
    RendererOptions::for_target(format).with_blend(Blend::Replace)
}

/// The least capable devices and fully capable ones give the same images, with every method and rasterizer.
#[test]
fn the_least_capable_device_and_webgpus_defaults_suffice() {
    let full = Host::new();
    let least = Limits { max_storage_buffer_binding_size: 16 << 20, ..DeviceRequirements::LEAST.limits };
    for limits in [least, Limits::default()] {
        for features in [Features::empty(), TILE_FEATURES] {
            let host = Host::with(features, limits.clone());
            DeviceRequirements::check(&host.device).unwrap();
            for (key, value) in [
                ("method", "'image-aligned'"),
                ("method", "'axis-aligned'"),
                ("method", "'composite-every-sample'"),
                ("footprint", "'sections'"),
            ] {
                let mut scene = scene(OPAQUE);
                // Whether pixels become opaque may differ between f16 and f32.
                let sets = ["splatting.culling=false".to_owned(), format!("splatting.{key}={value}")];
                let text = "volume.builtin = 'head:32'";
                scene.splatting =
                    sheetsplat::Scene::parse(text, "", std::path::Path::new("."), &sets).unwrap().splatting;
                let images = [&host, &full].map(|host| {
                    let renderer = host.renderer(replacing(F32));
                    pixels(&host.render(&renderer, F32, &mut host.view(&scene)))
                });
                let channels = images[0].as_flattened().iter().zip(images[1].as_flattened());
                let most = largest(channels.map(|(a, b)| f64::from(*a) - f64::from(*b)));
                // On the least device sheets are f16.
                assert_at_most(most, 0.02, format_args!("{key} {value} {features:?}"));
            }
        }
    }
}

#[test]
fn check_names_every_insufficient_limit() {
    let limits = Limits {
        max_texture_dimension_2d: 1024,
        max_storage_buffers_per_shader_stage: 7,
        max_compute_invocations_per_workgroup: 128,
        ..Limits::default()
    };
    let host = Host::with(Features::empty(), limits);
    let expected = [
        ("max_texture_dimension_2d", 2048, 1024),
        ("max_storage_buffers_per_shader_stage", 8, 7),
        ("max_compute_invocations_per_workgroup", 256, 128),
    ];
    let expected = expected.map(|(limit, required, actual)| InsufficientLimit { limit, required, actual });
    for result in
        [DeviceRequirements::check(&host.device), Renderer::new(&host.device, &host.queue, &replacing(F32)).map(|_| ())]
    {
        let error = result.unwrap_err();
        let message = error.to_string();
        assert!(message.contains("max_storage_buffers_per_shader_stage: required 8, actual: 7"), "{message}");
        assert!(matches!(error, DeviceError::Limits(limits) if limits == expected), "{message}");
    }
}

#[test]
fn merging_takes_the_better_of_both() {
    let mut descriptor = wgpu::DeviceDescriptor {
        required_features: Features::DEPTH_CLIP_CONTROL,
        required_limits: Limits {
            max_texture_dimension_2d: 9000,
            max_storage_buffers_per_shader_stage: 3,
            min_uniform_buffer_offset_alignment: 64,
            ..Limits::default()
        },
        ..wgpu::DeviceDescriptor::default()
    };
    DeviceRequirements { features: TILE_FEATURES, limits: Limits::default() }.merge_into(&mut descriptor);
    assert_eq!(descriptor.required_features, Features::DEPTH_CLIP_CONTROL | TILE_FEATURES);
    let expected = Limits {
        max_texture_dimension_2d: 9000,
        // Lower is better for this limit.
        min_uniform_buffer_offset_alignment: 64,
        ..Limits::default()
    };
    assert_eq!(descriptor.required_limits, expected);
}

#[test]
fn unsupported_options_are_named() {
    let host = Host::with(Features::empty(), Limits::default());
    let of = RendererOptions::for_target;
    let depth = |format| of(TextureFormat::Rgba8Unorm).with_depth_format(format);
    let samples = |sample_count, format| replacing(format).with_sample_count(sample_count);
    let sheets = |sheets| of(TextureFormat::Rgba8Unorm).with_sheets_per_group(sheets);
    let sheet_format = |format| of(TextureFormat::Rgba8Unorm).with_sheet_format(format);
    for (options, option, found) in [
        (of(TextureFormat::Rgba8Uint), "target_format", "Rgba8Uint"),
        (of(TextureFormat::Bc7RgbaUnorm), "target_format", "Bc7RgbaUnorm"),
        (of(TextureFormat::Depth32Float), "target_format", "Depth32Float"),
        (of(TextureFormat::NV12), "target_format", "NV12"),
        (of(TextureFormat::Rgba8Snorm), "target_format", "Rgba8Snorm"),
        (of(TextureFormat::Rgb9e5Ufloat), "target_format", "Rgb9e5Ufloat"),
        (of(F32), "blend", "Rgba32Float"),
        (depth(TextureFormat::Rgba8Unorm), "depth_format", "Rgba8Unorm"),
        (samples(0, TextureFormat::Rgba8Unorm), "sample_count", "0"),
        (samples(3, TextureFormat::Rgba8Unorm), "sample_count", "3"),
        (samples(8, TextureFormat::Rgba8Unorm), "sample_count", "8 of Rgba8Unorm"),
        (samples(4, F32), "sample_count", "4 of Rgba32Float"),
        (sheets(0), "sheets_per_group", "0"),
        (sheets(3), "sheets_per_group", "3"),
        (sheets(8), "sheets_per_group", "8"),
        (sheet_format(TextureFormat::Rgba8Unorm), "sheet_format", "Rgba8Unorm"),
    ] {
        match Renderer::new(&host.device, &host.queue, &options) {
            Err(error @ DeviceError::Unsupported { .. }) => {
                let message = error.to_string();
                let start = format!("{option}: found ");
                assert!(message.starts_with(&start) && message.contains(found), "{option} {found}: {message}");
                assert!(message.contains(", allowed: "), "{message}");
            }
            other => panic!("{option} {found}: {other:?}"),
        }
    }
    // The values that they name as allowed are supported.
    for options in [replacing(F32), of(TextureFormat::Rgba16Float), samples(4, TextureFormat::Rgba8Unorm), sheets(2)] {
        host.renderer(options);
    }
    Host::new().renderer(of(F32));
}

/// All formats that every device can render to and blend.
#[test]
fn every_renderable_format_is_supported() {
    use TextureFormat::{Bgra8Unorm, R8Unorm, R16Float, Rg8Unorm, Rg16Float, Rgb10a2Unorm, Rgba8Unorm};
    let host = Host::with(Features::empty(), Limits::default());
    for format in [R8Unorm, Rg8Unorm, Rgba8Unorm, Bgra8Unorm, Rgb10a2Unorm, R16Float, Rg16Float] {
        let renderer = host.renderer(RendererOptions::for_target(format));
        let texels = host.render(&renderer, format, &mut host.view(&scene(OPAQUE)));
        assert!(texels.iter().any(|&byte| byte != texels[0]), "{format:?}: nothing is to be seen");
    }
}

/// On one adapter, devices with WebGPU's default limits and with all features give the same bytes.
#[test]
fn deterministic_images_do_not_depend_on_the_device() {
    let hosts = [Host::with(Features::empty(), Limits::default()), Host::new()];
    for background in [OPAQUE, TRANSPARENT] {
        let scene = scene(background);
        let images = |options: RendererOptions| {
            hosts.each_ref().map(|host| {
                let renderer = host.renderer(options);
                pixels(&host.render(&renderer, F32, &mut host.view(&scene)))
            })
        };
        let [least, full] = images(RendererOptions::DETERMINISTIC);
        assert!(least == full, "the same bytes");
        let [least, full] = images(replacing(F32));
        assert!(least != full, "devices differ, where they may choose");
    }
}
