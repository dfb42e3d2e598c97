//! Devices with lower limits than lavapipe: WebGPU's default limits, tiny buffers, missing features, and no adapter.

use glam::{DVec3, UVec3};
use sheetsplat::RenderError;
use sheetsplat::headless::{GpuHeadless, HeadlessOptions};
use sheetsplat::internals::ClippedVoxels;
use sheetsplat::internals::brick::BrickList;
use sheetsplat::internals::classify::classify;
use sheetsplat::internals::gpu::brick_lists::BrickLists;
use sheetsplat::internals::gpu::layout::{Band, Brick};
use sheetsplat::internals::gpu::targets::CompositingBuffer;
use sheetsplat::internals::gpu::volume_texture;
use sheetsplat::scene::Scene;
use sheetsplat::settings::Projection;
use sheetsplat::settings::{Compositing, FootprintForm, Rasterizer};
use sheetsplat::stats::Counts;
use sheetsplat::volume::{Volume, builtin};
use sheetsplat::wgpu::{Features, Limits, TextureFormat};
use sheetsplat::{DeviceError, DeviceRequirements, InsufficientLimit};

use crate::common::adapter::adapter;
use crate::common::compare::{self, assert_at_least, assert_at_most};
use crate::common::devices::gpu;
use crate::common::images::{largest_difference, rms};
use crate::common::{COMPOSITINGS, F16, F32, scene, transfer};

/// A device with these limits and features that draws by quads, which need least.
fn open(limits: Limits, features: Features, sheet_format: Option<TextureFormat>) -> Result<GpuHeadless, DeviceError> {
    let options = crate::common::devices::on_adapter().with_requirements(DeviceRequirements { features, limits });
    let mut options = options.with_rasterizer(Rasterizer::Quads);
    options.sheet_format = sheet_format;
    GpuHeadless::new(&options)
}

/// A small translucent head, so that every sheet counts.
fn head() -> (Volume, Scene) {
    let mut scene = scene(150, 110);
    scene.camera.direction = DVec3::new(0.4, 0.9, -0.3);
    scene.channels[0].transfer =
        transfer(&[(40.0, [0.9, 0.6, 0.4]), (255.0, [1.0, 1.0, 0.9])], &[(30.0, 0.0), (120.0, 0.3)]);
    (builtin::volume("head:32").unwrap(), scene)
}

#[test]
fn webgpu_default_limits_and_no_features() {
    let least = open(Limits::default(), Features::empty(), None).unwrap();
    assert_eq!(least.renderer().sheet_format(), TextureFormat::Rgba16Float);
    let full = gpu();
    assert_eq!(full.renderer().sheet_format(), TextureFormat::Rgba32Float);
    let (volume, mut scene) = head();
    for compositing in COMPOSITINGS {
        for footprint in [FootprintForm::SummedArea, FootprintForm::Sections] {
            (scene.splatting.compositing, scene.splatting.footprint) = (compositing, footprint);
            // Which pixels are opaque depends on the last bit of a sum, so f16 and f32 cull differently.
            scene.splatting.culling = false;
            let images = [&least, full].map(|gpu| gpu.render_volume(volume.clone(), &scene).unwrap().image);
            let decibels = compare::decibels(rms(&images[0], &images[1]));
            // On this device sheets are f16, and footprints are drawn by quads.
            assert_at_least(decibels, 52.0, format_args!("{compositing:?} {footprint:?}"));
            // Culling's guarantee holds for f16 sheets, too, because drawn sections are drawn as without culling. A colour may exceed its
            // alpha by an f16 rounding.
            scene.splatting.culling = true;
            let culled = least.render_volume(volume.clone(), &scene).unwrap().image;
            let allowed = (1.0 - scene.splatting.opacity_threshold) * (1.0 + 2.0 * F16) + 64.0 * F32;
            let changed = largest_difference(&culled, &images[0]);
            assert_at_most(changed, allowed, format_args!("{compositing:?} {footprint:?}: culling"));
        }
    }
}

#[test]
fn rgba32float_sheets_take_the_default_limits_too() {
    let gpu = open(Limits::default(), Features::FLOAT32_BLENDABLE, None).unwrap();
    assert_eq!(gpu.renderer().sheet_format(), TextureFormat::Rgba32Float);
    // Every device allows 32 bytes of colour attachments, which are two such sheets.
    let pairs = GpuHeadless::new(&crate::common::devices::on_adapter().with_sheets_per_group(2)).unwrap();
    let (volume, mut scene) = head();
    scene.splatting.rasterizer = Rasterizer::Quads;
    let renderings = [gpu, pairs].map(|gpu| gpu.render_volume(volume.clone(), &scene).unwrap());
    assert_eq!(renderings[0].stats.counts, renderings[1].stats.counts);
    assert!(renderings[0].image == renderings[1].image, "the same device, the same work, the same bytes");
}

/// A quad draws as many sheets as the device's colour attachments hold: in both formats, four, two or one.
#[test]
fn attachments_limit_the_sheets_of_a_group() {
    let (volume, mut scene) = head();
    scene.splatting.culling = false;
    scene.splatting.rasterizer = Rasterizer::Quads;
    let quads = |bytes: u32, attachments: u32, format: TextureFormat| {
        let limits = Limits {
            max_color_attachment_bytes_per_sample: bytes,
            max_color_attachments: attachments,
            ..Limits::default()
        };
        let gpu = open(limits, Features::FLOAT32_BLENDABLE, Some(format)).unwrap();
        gpu.render_volume(volume.clone(), &scene).unwrap().stats.counts
    };
    let fixed = |sheets: u32| {
        let options = crate::common::devices::on_adapter().with_sheets_per_group(sheets);
        GpuHeadless::new(&options).unwrap().render_volume(volume.clone(), &scene).unwrap().stats.counts
    };
    let of = [1, 2, 4].map(fixed);
    assert!(of[0].quads > of[1].quads && of[1].quads > of[2].quads, "{of:?}");
    let (half, single) = (TextureFormat::Rgba16Float, TextureFormat::Rgba32Float);
    for (bytes, attachments, format, at) in [
        (32, 8, half, 2),
        (16, 8, half, 1),
        (32, 3, half, 1),
        (32, 1, half, 0),
        (64, 4, single, 2),
        (32, 8, single, 1),
        (16, 8, single, 0),
    ] {
        assert_eq!(quads(bytes, attachments, format), of[at], "{bytes} bytes, {attachments} attachments, {format:?}");
    }
}

#[test]
fn small_bindings_split_voxels_and_image() {
    let (_, mut scene) = head();
    let volume = builtin::volume("head:64").unwrap();
    let voxels = classify(&volume, &[scene.channels[0].transfer.resolve(&volume)], &ClippedVoxels::default());
    let bricks = BrickList::new(volume.grid(), &voxels);
    let full = open(Limits::default(), Features::FLOAT32_BLENDABLE, None).unwrap();
    // 32 rows of 150 pixels are 75 KiB, so a band has one or two rows of tiles.
    for (bytes, bands) in [(76 << 10, 4), (150 << 10, 2)] {
        let limits = Limits { max_storage_buffer_binding_size: bytes, ..Limits::default() };
        let small = open(limits, Features::FLOAT32_BLENDABLE, None).unwrap();
        assert_eq!(small.device().limits().max_storage_buffer_binding_size, bytes, "wgpu gave what was asked for");
        let lists = BrickLists::upload(small.device(), BrickList::new(volume.grid(), &voxels));
        assert!(lists.lists.len() > 2, "{} lists", lists.lists.len());
        assert_eq!(lists.len(), voxels.len() as u64);
        let of_lists: Vec<Brick> = lists.bricks().flatten().copied().collect();
        assert_eq!(of_lists, bricks.bricks(), "together they are all there is");
        assert!(lists.lists.iter().all(|list| list.buffer.size() <= bytes));
        let rows = CompositingBuffer::bands(&small.device().limits(), [150, 110]).unwrap();
        let compositing_buffer = CompositingBuffer::new(small.device(), [150, 110], &rows);
        assert_eq!(compositing_buffer.bands.len(), bands);
        for (at, band) in compositing_buffer.bands.iter().enumerate() {
            let Band { first_row, rows } = band.band;
            assert_eq!((first_row % 32, first_row + rows), (0, if at + 1 == bands { 110 } else { first_row + rows }));
            assert!(band.acc.size() <= bytes && band.acc.size() == u64::from(rows) * 150 * 16);
        }
        scene.splatting.culling = false;
        for compositing in COMPOSITINGS {
            for background in [[0.0, 0.0, 0.0, 1.0], [0.2, 0.9, 0.5, 0.5]] {
                (scene.splatting.compositing, scene.image.background) = (compositing, background);
                let renderings = [&small, &full].map(|gpu| gpu.render_volume(volume.clone(), &scene).unwrap());
                assert_same_work(&renderings[0].stats.counts, &renderings[1].stats.counts);
                let largest = largest_difference(&renderings[0].image, &renderings[1].image);
                // The lists change the order in which a sheet's footprints are added, and so the roundings of its amount. The image changes
                // by no more.
                let sheets = renderings[1].stats.counts.sheets as f64;
                assert_at_most(largest, 0.4 * F32 * sheets, format_args!("{bytes} bytes {compositing:?}"));
            }
        }
        // With culling, every list's bricks are culled by what all lists drew, so the guarantee holds.
        for compositing in [Compositing::Linear, Compositing::Exponential] {
            (scene.splatting.compositing, scene.splatting.culling) = (compositing, false);
            let without = small.render_volume(volume.clone(), &scene).unwrap();
            scene.splatting.culling = true;
            let with = small.render_volume(volume.clone(), &scene).unwrap();
            let allowed = 1.0 - scene.splatting.opacity_threshold + 64.0 * F32;
            let changed = largest_difference(&with.image, &without.image);
            assert_at_most(changed, allowed, format_args!("{bytes} bytes {compositing:?}: culling"));
            let [with, without] = [with, without].map(|rendering| rendering.stats.counts.quads);
            assert!(with < without, "{bytes} bytes {compositing:?}: nothing is culled");
        }
    }
}

/// Several lists do the work of one, except that each has its own buckets, so shorter ranges of bricks are tested.
fn assert_same_work(lists: &Counts, one: &Counts) {
    assert!(lists.bricks_tested <= one.bricks_tested, "{} {}", lists.bricks_tested, one.bricks_tested);
    let mut expected = *one;
    expected.bricks_tested = lists.bricks_tested;
    assert_eq!(*lists, expected);
}

#[test]
fn rgba32float_sheets_need_blending() {
    match open(Limits::default(), Features::empty(), Some(TextureFormat::Rgba32Float)) {
        Err(error @ DeviceError::MissingFeatures { required, actual, .. }) => {
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
    let limits = Limits { max_texture_dimension_2d: 2048, ..Limits::default() };
    let gpu = open(limits, Features::empty(), None).unwrap();
    let (volume, mut scene) = head();
    for (size, key) in [((2049, 16), "image.width"), ((16, 3000), "image.height")] {
        (scene.image.width, scene.image.height) = size;
        match gpu.render_volume(volume.clone(), &scene) {
            Err(error @ RenderError::Limit { what, limit, required, actual, .. }) => {
                let expected = (key, "max_texture_dimension_2d", u64::from(size.0.max(size.1)), 2048);
                assert_eq!((what, limit, required, actual), expected);
                let message = error.to_string();
                for part in [key, "max_texture_dimension_2d", &required.to_string(), "2048"] {
                    assert!(message.contains(part), "{message}");
                }
            }
            other => panic!("{size:?}: {other:?}"),
        }
    }
    (scene.image.width, scene.image.height) = (2048, 16);
    gpu.render_volume(volume.clone(), &scene).unwrap();
}

/// Volumes that need more layers than the device has get larger ones: 128 layers of 2048² voxels hold 2²⁹. With WebGPU's default limits there is
/// room for any number of voxels that fits in 32 bits.
#[test]
fn layers_grow_with_the_volume() {
    let side = |limits: &Limits, voxels| volume_texture::side(limits, "the volume's values", voxels);
    let default = Limits::default();
    let few = Limits { max_texture_array_layers: 128, ..Limits::default() };
    assert_eq!([1, 1 << 30, (1 << 30) + 1].map(|voxels| side(&default, voxels).unwrap()), [2048, 2048, 4096]);
    assert_eq!(side(&default, u32::MAX.into()).unwrap(), 4096);
    assert_eq!([1 << 29, (1 << 29) + 1, (1 << 31) + 1].map(|voxels| side(&few, voxels).unwrap()), [2048, 4096, 8192]);
    let small = Limits { max_texture_dimension_2d: 2048, ..few };
    match side(&small, (1 << 29) + 1) {
        Err(error @ RenderError::Limit { limit, required, actual, .. }) => {
            assert_eq!((limit, required, actual), ("max_texture_array_layers", 129, 128));
            assert!(error.to_string().contains("the volume's values"), "{error}");
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_row_of_tiles_larger_than_a_binding_is_an_error() {
    let limits = Limits { max_storage_buffer_binding_size: 32 << 10, ..Limits::default() };
    let gpu = open(limits, Features::empty(), None).unwrap();
    let (volume, mut scene) = head();
    (scene.image.width, scene.image.height) = (65, 16);
    match gpu.render_volume(volume.clone(), &scene) {
        Err(RenderError::Limit { what, limit, required, actual, .. }) => {
            assert!(what.contains("image.width"), "{what}");
            assert_eq!((limit, required, actual), ("max_storage_buffer_binding_size", 65 * 32 * 16, 32 << 10));
        }
        other => panic!("{other:?}"),
    }
    (scene.image.width, scene.image.height) = (64, 100);
    gpu.render_volume(volume.clone(), &scene).unwrap();
}

#[test]
fn an_unknown_adapter_is_an_error_that_names_those_there_are() {
    let there = GpuHeadless::new(&HeadlessOptions::default()).unwrap();
    let name = there.render_volume(head().0, &head().1).unwrap().stats.adapter;
    match GpuHeadless::new(&HeadlessOptions::default().with_adapter("no such GPU")) {
        Err(error @ DeviceError::NoAdapter { .. }) => {
            let message = error.to_string();
            assert!(message.contains("\"no such GPU\"") && message.contains(&name), "{message}");
        }
        other => panic!("{other:?}"),
    }
    // Any part of a name selects it, ignoring case.
    let part = name[1..].to_uppercase();
    GpuHeadless::new(&HeadlessOptions::default().with_adapter(part)).unwrap();
}

#[test]
fn a_limit_that_is_too_small_is_named() {
    let small: [(&str, u64, u64, Limits); 6] = [
        ("max_texture_dimension_2d", 2048, 1024, Limits { max_texture_dimension_2d: 1024, ..Limits::default() }),
        ("max_texture_array_layers", 128, 64, Limits { max_texture_array_layers: 64, ..Limits::default() }),
        (
            "max_storage_buffers_per_shader_stage",
            8,
            7,
            Limits { max_storage_buffers_per_shader_stage: 7, ..Limits::default() },
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
            Err(error @ DeviceError::Limits(_)) => {
                let message = error.to_string();
                let DeviceError::Limits(limits) = error else { unreachable!() };
                assert_eq!(limits, [InsufficientLimit { limit: name, required: needed, actual: available }]);
                for part in [name, &needed.to_string(), &available.to_string()] {
                    assert!(message.contains(part), "{message}");
                }
            }
            other => panic!("{name}: {other:?}"),
        }
    }
    DeviceRequirements::check(gpu().device()).unwrap();
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

/// The work and the bytes are the same on the least and the most capable device.
#[test]
fn deterministic_options_do_not_depend_on_the_device() {
    let requirements = DeviceRequirements { features: Features::empty(), limits: Limits::default() };
    let options = HeadlessOptions::DETERMINISTIC.with_adapter(adapter());
    let (volume, scene) = head();
    let renderings = [options.clone().with_requirements(requirements), options]
        .map(|options| GpuHeadless::new(&options).unwrap().render_volume(volume.clone(), &scene).unwrap());
    assert_eq!(renderings[0].stats.counts, renderings[1].stats.counts);
    assert!(renderings[0].image == renderings[1].image);
    assert!(renderings[0].image != gpu().render_volume(volume, &scene).unwrap().image, "gpu() draws by tiles, in f32");
}

/// One bit per pixel of a tall image, where bindings hold only a few rows of it.
#[test]
fn masks_larger_than_a_binding_are_an_error() {
    let limits = Limits { max_storage_buffer_binding_size: 76 << 10, ..Limits::default() };
    let gpu = open(Limits { max_texture_dimension_2d: 16384, ..limits }, Features::empty(), None).unwrap();
    let (volume, mut scene) = head();
    let mut view = gpu.view(volume, &scene).unwrap();
    (scene.image.width, scene.image.height) = (150, 16384);
    view.set_image(scene.image).unwrap();
    match gpu.draw(&mut view) {
        Err(RenderError::Limit { what, limit, required, actual, .. }) => {
            assert_eq!((what, limit), ("sheetsplat.opaque", "max_storage_buffer_binding_size"));
            // Five words hold a row.
            assert_eq!((required, actual), (5 * 4 * 16384, 76 << 10));
        }
        other => panic!("{other:?}"),
    }
    (scene.image.width, scene.image.height) = (150, 110);
    view.set_image(scene.image).unwrap();
    gpu.draw(&mut view).unwrap();
}

/// There are more values than WebGPU's default binding holds; some at the end take part and are drawn like those of a separate volume.
#[test]
fn a_volume_larger_than_a_binding_is_rendered_with_webgpus_default_limits() {
    let gpu = open(Limits::default(), Features::empty(), None).unwrap();
    let (small, shape) = (UVec3::splat(12), UVec3::new(330, 330, 320));
    assert!(4 * shape.as_u64vec3().element_product() > gpu.device().limits().max_storage_buffer_binding_size);
    let value = |p: UVec3| if (p - small / 2).element_product().is_multiple_of(3) { 50.0 } else { 150.0 + p.x as f32 };
    let inside = |p: UVec3| if p.cmpge(small / 2).all() && p.cmplt(small).all() { value(p) } else { 0.0 };
    let whole = |dims: UVec3| {
        let mut values = vec![0.0; dims.element_product() as usize];
        for voxel in 0..small.element_product() {
            let p = UVec3::new(voxel % small.x, voxel / small.x % small.y, voxel / (small.x * small.y));
            let at = dims - small + p;
            values[(at.x + dims.x * (at.y + dims.y * at.z)) as usize] = inside(p);
        }
        Volume::new("balls", dims, DVec3::ONE, values).unwrap()
    };
    let (_, mut scene) = head();
    scene.camera.projection = Projection::Orthographic { height: Some(14.0) };
    let images = [small, shape].map(|dims| {
        // The same voxels are in the middle.
        scene.camera.center = Some((dims - small).as_dvec3() / 2.0);
        gpu.render_volume(whole(dims), &scene).unwrap()
    });
    let [alone, end] = &images;
    assert_eq!(alone.stats.counts.voxels_in_range, end.stats.counts.voxels_in_range);
    // The slabs are at other positions.
    assert_at_most(largest_difference(&alone.image, &end.image), 1.4e-3, "the same voxels");
    assert!(end.image.pixels.iter().any(|pixel| pixel[0] > 0.2), "something is to be seen");
}
