//! The rasterizers compared with each other, and the choice between them: `splatting.rasterizer` and `splatting.footprint_box`.

use glam::{DVec3, UVec3};
use sheetsplat::RenderError;
use sheetsplat::headless::{GpuHeadless, Rendering};
use sheetsplat::internals::gpu::device::{DeviceRequirements, TILE_FEATURES};
use sheetsplat::internals::gpu::targets::CompositingBuffer;
use sheetsplat::scene::{Channel, Scene, VolumeSource};
use sheetsplat::settings::Projection;
use sheetsplat::settings::{Classification, Compositing, Gradient, Interpolation};
use sheetsplat::settings::{Economies, FootprintBox, FootprintForm, Method, Order, Rasterizer};
use sheetsplat::volume::{Volume, builtin};
use sheetsplat::wgpu::{Features, Limits};

use crate::common::compare::assert_at_least;
use crate::common::devices::{gpu, on_adapter};
use crate::common::images::{BLACK, psnr};
use crate::common::{BY_AMOUNTS, RASTERIZERS, Random, scene, transfer};

fn head() -> (Volume, Scene) {
    let mut scene = scene(90, 75);
    scene.camera.direction = DVec3::new(0.4, 0.9, -0.3);
    scene.channels[0].transfer =
        transfer(&[(40.0, [0.9, 0.6, 0.4]), (255.0, [1.0, 1.0, 0.9])], &[(30.0, 0.0), (120.0, 0.3)]);
    (builtin::volume("head:32").unwrap(), scene)
}

/// A device with only these features.
fn open(features: Features) -> GpuHeadless {
    with(DeviceRequirements { features, limits: Limits::default() })
}

/// A device with too little workgroup memory for tiles.
fn little() -> GpuHeadless {
    let limits = Limits { max_compute_workgroup_storage_size: 16383, ..Limits::default() };
    with(DeviceRequirements { features: TILE_FEATURES, limits })
}

fn with(requirements: DeviceRequirements) -> GpuHeadless {
    GpuHeadless::new(&on_adapter().with_requirements(requirements)).unwrap()
}

const EYE: Projection = Projection::Perspective { fov_y: 40.0, distance: None, near: None };

/// The rasterizer that drew a frame.
fn drawn_by(gpu: &GpuHeadless, volume: &Volume, scene: &Scene) -> String {
    gpu.render_volume(volume.clone(), scene).unwrap().stats.rasterizer
}

/// The key in a refused scene's message, and the message.
fn refusal(gpu: &GpuHeadless, volume: &Volume, scene: &Scene) -> (String, String) {
    match gpu.render_volume(volume.clone(), scene) {
        Err(RenderError::OutOfRange(error)) => (error.key.clone(), error.to_string()),
        other => panic!("{other:?}"),
    }
}

/// More than the tile rasterizer supports behind a tile: 2744 bricks in two pixels and four sheets.
fn crowded() -> (Volume, Scene) {
    let mut scene = scene(2, 2);
    scene.channels[0].transfer = transfer(&[(0.0, [1.0; 3])], &[(0.0, 0.001)]);
    scene.splatting.slab_width = 8.0;
    let values = vec![1.0; 56 * 56 * 56];
    (Volume::new("crowded", UVec3::splat(56), DVec3::ONE, values).unwrap(), scene)
}

#[test]
fn auto_chooses_tiles_where_they_are_supported() {
    let [subgroups, none] = [TILE_FEATURES, Features::empty()].map(open);
    let (volume, mut scene) = head();
    assert_eq!(scene.splatting.rasterizer, Rasterizer::Auto, "the default");
    assert_eq!(drawn_by(&subgroups, &volume, &scene), "tiles");
    assert_eq!(drawn_by(&none, &volume, &scene), "tiles");
    assert_eq!(drawn_by(&little(), &volume, &scene), "quads");
    for rasterizer in RASTERIZERS {
        scene.splatting.rasterizer = rasterizer;
        assert_eq!(drawn_by(&subgroups, &volume, &scene), format!("{rasterizer:?}").to_lowercase());
    }
    scene.splatting.rasterizer = Rasterizer::Auto;
    scene.splatting.footprint = FootprintForm::Sections;
    assert_eq!(drawn_by(&subgroups, &volume, &scene), "quads");
    let (volume, scene) = crowded();
    assert_eq!(drawn_by(&subgroups, &volume, &scene), "quads");
}

/// Where a subgroup is a workgroup, barriers of workgroups serve as well; and without subgroups a workgroup's threads share values in its memory.
#[test]
fn tiles_need_no_subgroups() {
    // Room for all sums.
    let limits = Limits { max_compute_workgroup_storage_size: 32768, ..Limits::default() };
    let [of_subgroups, only_subgroups, of_workgroups] = [TILE_FEATURES, Features::SUBGROUP, Features::empty()]
        .map(|features| with(DeviceRequirements { features, limits: limits.clone() }));
    let (volume, mut scene) = head();
    // Thick slabs, so that a group has more voxels than the queue holds, and they wait for room in it.
    (scene.splatting.rasterizer, scene.splatting.slab_width) = (Rasterizer::Tiles, 2.0);
    type Change = fn(&mut Scene);
    let of_lanes: [(&str, Change); 10] = [
        ("before, from an eye", |scene| scene.camera.projection = EYE),
        ("after, from an eye", |scene| {
            (scene.camera.projection, scene.splatting.classification) = (EYE, Classification::After);
        }),
        ("parallelogram", |scene| scene.splatting.footprint_box = FootprintBox::Parallelogram),
        ("back to front", |scene| scene.splatting.order = Order::BackToFront),
        ("economies", |scene| {
            scene.splatting.experimental = Economies { whole_below: 0.1, beta: 1.0, resolution: 0.01 };
        }),
        ("many control points", |scene| {
            let opacity: Vec<_> = (0..40).map(|at| (f64::from(at) * 6.0, f64::from(at % 5) * 0.02)).collect();
            scene.channels[0].transfer = transfer(&[(0.0, [0.9, 0.8, 0.7])], &opacity);
        }),
        ("kernel, exact", |scene| {
            (scene.splatting.classification, scene.splatting.interpolation) =
                (Classification::After, Interpolation::Exact);
            scene.shading.gradient = Gradient::Kernel;
        }),
        ("kernel, from an eye", |scene| {
            (scene.splatting.classification, scene.shading.gradient) = (Classification::After, Gradient::Kernel);
            scene.camera.projection = EYE;
        }),
        ("surface", |scene| {
            let splatting = &mut scene.splatting;
            (splatting.classification, splatting.compositing) = (Classification::After, Compositing::Surface);
            scene.channels[0].transfer = transfer(&[(0.0, [0.9, 0.6, 0.4])], &[(60.0, 0.0), (100.0, 1.0)]);
        }),
        ("average", |scene| {
            let splatting = &mut scene.splatting;
            (splatting.classification, splatting.compositing) = (Classification::After, Compositing::Average);
        }),
    ];
    for (what, change) in of_lanes {
        let mut scene = scene.clone();
        change(&mut scene);
        for culling in [true, false] {
            scene.splatting.culling = culling;
            let [expected, only, workgroups] = [&of_subgroups, &only_subgroups, &of_workgroups]
                .map(|gpu| gpu.render_volume(volume.clone(), &scene).unwrap());
            assert!(only.image == expected.image, "{what}");
            assert_eq!(only.stats.counts, expected.stats.counts, "{what}");
            assert_alike(&workgroups, &expected, culling, what);
        }
    }
}

/// Asserts that a workgroup's threads have drawn what a subgroup's have. Their queue is shorter, so that sums are rounded elsewhere, other bricks are
/// visited again, and with culling a voxel may be hidden sooner or later.
fn assert_alike(workgroups: &Rendering, subgroups: &Rendering, culling: bool, what: &str) {
    let decibels = psnr(&workgroups.image.pixels, &subgroups.image.pixels, BLACK, 300);
    println!("{what}: {decibels:.1} dB");
    assert_at_least(decibels, 140.0, what);
    let [mut counts, expected] = [workgroups, subgroups].map(|rendering| rendering.stats.counts);
    counts.bricks_visited = expected.bricks_visited;
    assert!(culling || counts == expected, "{what}: {counts:?}, not {expected:?}");
}

/// The same of two channels that share sheets.
#[test]
fn channels_need_no_subgroups() {
    let limits = Limits { max_compute_workgroup_storage_size: 32768, ..Limits::default() };
    let gpus = [TILE_FEATURES, Features::empty()]
        .map(|features| with(DeviceRequirements { features, limits: limits.clone() }));
    let (volume, mut scene) = head();
    let values = volume.values().iter().map(|value| 255.0 - value).collect();
    let other = Volume::new("other", volume.grid().dims, volume.spacing(), values).unwrap();
    let volume = volume.with_channels("both", vec![other]).unwrap();
    let mut channel = Channel::new(VolumeSource::Memory);
    channel.transfer = transfer(&[(0.0, [0.2, 0.5, 0.9])], &[(100.0, 0.0), (200.0, 0.1)]);
    scene.splatting.rasterizer = Rasterizer::Tiles;
    scene.channels.push(channel);
    for (classification, culling) in [
        (Classification::Before, true),
        (Classification::Before, false),
        (Classification::After, true),
        (Classification::After, false),
    ] {
        // Narrower subgroups cull other voxels.
        let is_narrow = gpus[0].device().adapter_info().subgroup_max_size < 8;
        (scene.splatting.classification, scene.splatting.culling) = (classification, culling && !is_narrow);
        let [expected, actual] = gpus.each_ref().map(|gpu| gpu.render_volume(volume.clone(), &scene).unwrap());
        assert_alike(&actual, &expected, culling, &format!("{classification:?}"));
    }
}

/// The same where not all threads of a workgroup execute an instruction together, as lavapipe's do where its vectors hold 8: barriers keep them from reading too soon, and
/// from writing over what others have yet to read.
#[test]
fn threads_of_several_vectors_wait_for_one_another() {
    let mut test = std::process::Command::new(std::env::current_exe().unwrap());
    let run = test
        .args(["--exact", "rasterizers::channels_need_no_subgroups"])
        .env("LP_NATIVE_VECTOR_WIDTH", "128")
        .output()
        .unwrap();
    let output = String::from_utf8_lossy(&run.stdout);
    assert!(run.status.success() && output.contains("1 passed"), "{output}{}", String::from_utf8_lossy(&run.stderr));
}

/// After splatting, sums with the kernel's gradient and those of colours need more workgroup memory than WebGPU's default. Quads draw them there.
#[test]
fn quads_draw_what_tiles_do_not_after_splatting() {
    let gpu = open(TILE_FEATURES);
    let (volume, mut scene) = head();
    scene.splatting.classification = Classification::After;
    assert_eq!(drawn_by(&gpu, &volume, &scene), "tiles");
    type Change = fn(&mut Scene);
    let kernel: Change = |scene| scene.shading.gradient = Gradient::Kernel;
    let cases: [(Change, &[&str]); 1] = [(kernel, &["max_compute_workgroup_storage_size", "16384", "18720"])];
    for (change, words) in cases {
        let mut scene = scene.clone();
        change(&mut scene);
        assert_eq!(drawn_by(&gpu, &volume, &scene), "quads");
        scene.splatting.rasterizer = Rasterizer::Tiles;
        let message = gpu.render_volume(volume.clone(), &scene).unwrap_err().to_string();
        words.iter().for_each(|word| assert!(message.contains(word), "no {word:?} in {message}"));
    }
}

#[test]
fn settings_that_require_tiles_are_refused_without_them() {
    let subgroups = open(TILE_FEATURES);
    let refused = |gpu: &GpuHeadless, (volume, scene): &(Volume, Scene), words: &[&str]| {
        let (key, message) = refusal(gpu, volume, scene);
        assert_eq!(key, "splatting.rasterizer", "{message}");
        words.iter().for_each(|word| assert!(message.contains(word), "no {word:?} in {message}"));
    };
    let with = |change: fn(&mut Scene)| {
        let (volume, mut scene) = head();
        change(&mut scene);
        (volume, scene)
    };
    let tiles = with(|scene| scene.splatting.rasterizer = Rasterizer::Tiles);
    let little = little();
    refused(&little, &tiles, &["max_compute_workgroup_storage_size", "16383", "16384", "\"quads\""]);
    let parallelogram = with(|scene| scene.splatting.footprint_box = FootprintBox::Parallelogram);
    refused(&little, &parallelogram, &["\"tiles\"", "16383"]);
    assert_eq!(drawn_by(&subgroups, &parallelogram.0, &parallelogram.1), "tiles");
    let sections = with(|scene| {
        (scene.splatting.rasterizer, scene.splatting.footprint) = (Rasterizer::Tiles, FootprintForm::Sections);
    });
    refused(&subgroups, &sections, &["splatting.footprint", "\"sections\"", "\"summed-area\"", "\"quads\""]);
    let quads = with(|scene| {
        (scene.splatting.rasterizer, scene.splatting.footprint_box) = (Rasterizer::Quads, FootprintBox::Parallelogram);
    });
    refused(&subgroups, &quads, &["\"quads\"", "splatting.footprint_box", "\"parallelogram\"", "\"tiles\""]);
    let (volume, mut scene) = crowded();
    scene.splatting.rasterizer = Rasterizer::Tiles;
    refused(&subgroups, &(volume, scene), &["bricks behind a patch", "\"quads\""]);
}

/// Nothing is culled, and quads round amounts to f16.
#[test]
fn rasterizers_agree() {
    let gpu = gpu();
    let (volume, mut scene) = head();
    scene.splatting.culling = false;
    let mut random = Random(61);
    // Sums that are divided by their own alpha keep the fewest exact digits.
    for (compositing, required) in BY_AMOUNTS.into_iter().zip([80.0, 88.0, 92.0]).cycle().take(24) {
        scene.splatting.compositing = compositing;
        scene.splatting.order = random.pick(&[Order::FrontToBack, Order::BackToFront]);
        scene.splatting.method = random.pick(&[Method::ImageAligned, Method::AxisAligned]);
        scene.splatting.slab_width = random.pick(&[0.4, 1.0, 2.5]);
        scene.camera.direction = random.direction();
        scene.camera.projection = random.pick(&[
            Projection::Orthographic { height: Some(150.0) },
            Projection::Perspective { fov_y: 40.0, distance: None, near: None },
            Projection::Perspective { fov_y: 60.0, distance: Some(90.0), near: Some(30.0) },
        ]);
        let spacing = random.pick(&[[1.0, 1.0, 1.0], [1.0, 1.0, 3.0], [1.0, 1.0, 5.0], [3.2, 3.2, 1.5]]);
        let volume = volume.clone().with_spacing("head", DVec3::from(spacing) * 4.0).unwrap();
        let [quads, tiles] = RASTERIZERS.map(|rasterizer| {
            scene.splatting.rasterizer = rasterizer;
            gpu.render_volume(volume.clone(), &scene).unwrap().image
        });
        let decibels = psnr(&quads.pixels, &tiles.pixels, BLACK, 250);
        assert_at_least(decibels, required, format_args!("{scene:?}"));
    }
}

/// Bindings hold only a few rows of the image and a few bricks, so the image is drawn band by band from a list of all bricks.
#[test]
fn small_bindings_change_no_bit_of_tiles() {
    let (volume, mut scene) = head();
    (scene.image.width, scene.image.height) = (300, 200);
    scene.splatting.rasterizer = Rasterizer::Tiles;
    let [full, small] = [Limits::default().max_storage_buffer_binding_size, 200 << 10].map(|bytes| {
        let limits = Limits { max_storage_buffer_binding_size: bytes, ..Limits::default() };
        let requirements = DeviceRequirements { features: TILE_FEATURES, limits };
        GpuHeadless::new(&on_adapter().with_requirements(requirements)).unwrap()
    });
    assert_eq!(CompositingBuffer::bands(&small.device().limits(), [300, 200]).unwrap().len(), 7);
    for order in [Order::FrontToBack, Order::BackToFront] {
        scene.splatting.order = order;
        let [full, small] = [&full, &small].map(|gpu| gpu.render_volume(volume.clone(), &scene).unwrap());
        assert!(full.image == small.image, "{order:?}");
        assert_eq!(full.stats.counts, small.stats.counts);
    }
}

/// Counts this thread's warnings about quads.
struct Warnings;

thread_local! {
    static WARNINGS: std::cell::RefCell<Vec<String>> = const { std::cell::RefCell::new(Vec::new()) };
}

impl log::Log for Warnings {
    fn enabled(&self, metadata: &log::Metadata<'_>) -> bool {
        metadata.level() <= log::Level::Warn
    }

    fn log(&self, record: &log::Record<'_>) {
        if self.enabled(record.metadata()) && record.target().starts_with("sheetsplat") {
            WARNINGS.with_borrow_mut(|warnings| warnings.push(record.args().to_string()));
        }
    }

    fn flush(&self) {}
}

#[test]
fn a_fallback_to_quads_says_why_once() {
    log::set_logger(&Warnings).unwrap();
    log::set_max_level(log::LevelFilter::Warn);
    let (volume, scene) = head();
    let sections = |mut scene: Scene| {
        scene.splatting.footprint = FootprintForm::Sections;
        scene
    };
    for (gpu, scene, reason) in [
        (little(), scene.clone(), Some("max_compute_workgroup_storage_size")),
        (open(TILE_FEATURES), scene.clone(), None),
        // The settings require quads.
        (little(), sections(scene), None),
    ] {
        let mut view = gpu.view(volume.clone(), &scene).unwrap();
        assert!(view.fallback().is_none());
        for _ in 0..2 {
            gpu.draw(&mut view).unwrap();
            assert_eq!(view.fallback().is_some(), reason.is_some());
        }
        let warnings = WARNINGS.take();
        assert_eq!(warnings.len(), usize::from(reason.is_some()), "{warnings:?}");
        for text in warnings.into_iter().chain(view.fallback().map(ToString::to_string)) {
            assert!(text.contains(reason.unwrap()), "{text}");
        }
    }
}
