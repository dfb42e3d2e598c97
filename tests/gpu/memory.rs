//! GPU memory: what is reported, and that it is freed.

use std::sync::{LazyLock, Mutex, MutexGuard, PoisonError};

use glam::{DVec3, UVec3};
use sheetsplat::headless::GpuHeadless;
use sheetsplat::scene::Scene;
use sheetsplat::settings::LabelTables;
use sheetsplat::settings::Light;
use sheetsplat::settings::Projection;
use sheetsplat::settings::{Method, Order, Splatting};
use sheetsplat::volume::{Volume, builtin};
use sheetsplat::wgpu::PollType;
use sheetsplat::{GpuVolume, SceneView};

use crate::common::devices::{FORMS, gpu_with_small_bindings, new_gpu, on_adapter};
use crate::common::{RASTERIZERS, scene, transfer};

fn head(size: u32) -> (Volume, Scene) {
    let mut scene = scene(60, 50);
    scene.channels[0].transfer = transfer(&[(40.0, [0.9, 0.6, 0.4])], &[(30.0, 0.0), (120.0, 0.3)]);
    (builtin::volume(&format!("head:{size}")).unwrap(), scene)
}

/// A device of these tests' own: the other tests of the program allocate on theirs while these count.
fn gpu() -> &'static GpuHeadless {
    static OWN: LazyLock<GpuHeadless> = LazyLock::new(new_gpu);
    &OWN
}

/// Held by a test as long as it runs, because all of them count what the same device has allocated.
fn alone() -> MutexGuard<'static, ()> {
    static ALONE: Mutex<()> = Mutex::new(());
    ALONE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The bytes that wgpu has allocated, once the device is idle.
fn allocated(gpu: &GpuHeadless) -> u64 {
    gpu.device().poll(PollType::wait_indefinitely()).unwrap();
    gpu.device().generate_allocator_report().unwrap().total_allocated_bytes
}

/// 200 renders on one device, of 5 volumes and 40 sizes, by both rasterizers.
#[test]
fn memory_is_freed() {
    let _alone = alone();
    let gpu = gpu();
    let volumes = [8, 12, 16, 20, 24].map(head);
    let mut held = Vec::new();
    for number in 0..200 {
        let (volume, mut scene) = volumes[number % 5].clone();
        scene.splatting.rasterizer = RASTERIZERS[number % 2];
        (scene.image.width, scene.image.height) = (20 + (number % 40) as u32 * 7, 200 - (number % 40) as u32 * 3);
        let mut view = gpu.view(volume, &scene).unwrap();
        view.set_first_hit((number % 3 == 0).then_some(0.1)).unwrap();
        gpu.draw(&mut view).unwrap();
        assert!(allocated(gpu) >= view.gpu_bytes(), "it is really there");
        drop(view);
        held.push(allocated(gpu));
    }
    // Pipelines stay, and a few hundred bytes of wgpu's own vary; any buffer of a frame's image is larger.
    let most = held[..10].iter().max().unwrap() + 1024;
    assert!(held[10..].iter().all(|&bytes| bytes <= most), "{held:?}");
    assert!(most < 1 << 20, "{held:?}");
}

/// A view that grows and shrinks uses at most 4 times what a new one uses, and frees all of it.
#[test]
fn a_view_that_shrinks_frees_memory() {
    let _alone = alone();
    let gpu = gpu();
    for rasterizer in RASTERIZERS {
        let (volume, mut scene) = head(16);
        scene.splatting.rasterizer = rasterizer;
        let before = allocated(gpu);
        let mut view = gpu.view(volume.clone(), &scene).unwrap();
        for number in 0..40 {
            (scene.image.width, scene.image.height) = if number % 2 == 0 { (400, 300) } else { (60, 50) };
            view.set_image(scene.image).unwrap();
            gpu.draw(&mut view).unwrap();
            let mut fresh = gpu.view(volume.clone(), &scene).unwrap();
            gpu.draw(&mut fresh).unwrap();
            assert!((fresh.gpu_bytes()..=4 * fresh.gpu_bytes()).contains(&view.gpu_bytes()), "{rasterizer:?} {number}");
        }
        drop(view);
        let after = allocated(gpu);
        assert!(after <= before + (1 << 16), "{rasterizer:?}: {before} {after}");
    }
}

/// The estimate is exact for volumes of part of a row, a row, several, and several layers, with values of one, two or four bytes.
#[test]
fn a_volumes_bytes_are_known_before() {
    let _alone = alone();
    let gpu = gpu();
    for dims in [[3, 5, 7], [2048, 1, 1], [2049, 1, 1], [64, 64, 65], [2048, 2049, 1]] {
        let dims = UVec3::from(dims);
        let count = dims.element_product();
        let rows = u64::from(count).div_ceil(2048).min(2048) * u64::from(count).div_ceil(1 << 22);
        for (step, bytes) in [(1.0, 1), (300.0, 2), (0.5, 4)] {
            let values = (0..count).map(|voxel| (voxel % 7) as f32 * step).collect();
            let volume = Volume::new("steps", dims, DVec3::ONE, values).unwrap();
            let [estimate, _] = GpuVolume::estimate(gpu.device(), &volume).unwrap();
            let on_gpu = GpuVolume::new(gpu.device(), gpu.queue(), volume).unwrap();
            assert_eq!(on_gpu.gpu_bytes(), estimate, "{dims}");
            assert_eq!(estimate, rows * 2048 * bytes, "{dims}");
        }
    }
    // With labels, some of whose tables matter to shading.
    let (volume, mut scene) = head(20);
    let [values, both] = GpuVolume::estimate(gpu.device(), &volume).unwrap();
    let mut view = gpu.view(volume.clone(), &scene).unwrap();
    gpu.draw(&mut view).unwrap();
    assert_eq!(view.volume().gpu_volume().gpu_bytes(), values);
    let color = scene.channels[0].transfer.color.clone();
    scene.channels[0].transfer.labels = [(1, LabelTables { color, ..LabelTables::default() })].into();
    let mut view = gpu.view(volume, &scene).unwrap();
    gpu.draw(&mut view).unwrap();
    assert_eq!(view.volume().gpu_volume().gpu_bytes(), both);
}

/// The estimate is exact before anything of a frame is allocated, for each rasterizer, several brick lists and bands of rows.
#[test]
fn a_frames_bytes_are_known_before() {
    let _alone = alone();
    let [roomy, small] = [new_gpu(), gpu_with_small_bindings(64 << 10)];
    let profiling = GpuHeadless::new(&on_adapter().with_profile(true)).unwrap();
    let (volume, base) = head(40);
    let mut scenes = Vec::new();
    for (rasterizer, footprint) in FORMS {
        let mut scene = base.clone();
        (scene.splatting.rasterizer, scene.splatting.footprint) = (rasterizer, footprint);
        scenes.push(scene.clone());
        scene.camera.projection = Projection::Perspective { fov_y: 40.0, distance: None, near: None };
        scene.splatting.order = Order::BackToFront;
        scenes.push(scene.clone());
        scene.splatting.method = Method::AxisAligned;
        scene.channels[0].transfer.labels =
            [(1, LabelTables { color: scene.channels[0].transfer.color.clone(), ..Default::default() })].into();
        scenes.push(scene);
    }
    let mut every_sample = base.clone();
    every_sample.splatting.method = Method::CompositeEverySample;
    scenes.push(every_sample);
    let mut empty = base.clone();
    empty.channels[0].transfer.iso_ranges = Some(vec![[-2.0, -1.0]]);
    scenes.push(empty);
    for (name, gpu) in [("roomy", &roomy), ("small", &small), ("profiling", &profiling)] {
        let mut checked = 0;
        for scene in &scenes {
            let mut view = gpu.view(volume.clone(), scene).unwrap();
            let Splatting { method, order, rasterizer, .. } = scene.splatting;
            let case = format!("{name}: {method:?} {order:?} {rasterizer:?}");
            for first_hit in [None, Some(0.2)] {
                let asks = method != Method::CompositeEverySample && order == Order::FrontToBack;
                view.set_first_hit(first_hit.filter(|_| asks)).unwrap();
                let before = view.gpu_bytes();
                let estimate = gpu.renderer().estimate(&view);
                assert_eq!(view.gpu_bytes(), before, "{case}: nothing is allocated");
                match (estimate, gpu.renderer().prepare(gpu.device(), gpu.queue(), &mut view)) {
                    (Ok(estimate), Ok(_)) => {
                        assert_eq!(estimate, fresh(gpu, &view), "{case} {first_hit:?}");
                        checked += 1;
                    }
                    (Err(estimate), Err(error)) => assert_eq!(estimate.to_string(), error.to_string(), "{case}"),
                    (estimate, prepared) => panic!("{case}: {estimate:?}, {prepared:?}"),
                }
            }
        }
        assert!(checked >= 10, "{name}: {checked}");
    }
}

/// The memory of a new view with the same settings.
fn fresh(gpu: &GpuHeadless, view: &SceneView) -> u64 {
    let volume = view.volume().gpu_volume();
    let mut fresh = SceneView::new(gpu.device(), volume, view.scene()).unwrap();
    fresh.set_first_hit(view.first_hits().map(|_| 0.2)).unwrap();
    gpu.renderer().prepare(gpu.device(), gpu.queue(), &mut fresh).unwrap();
    fresh.gpu_bytes()
}

/// After changes with and without room for the added bricks.
#[test]
fn a_changed_views_bytes_are_known_before() {
    let _alone = alone();
    let gpu = gpu();
    let (volume, mut scene) = head(40);
    scene.channels[0].transfer.iso_ranges = Some(vec![[100.0, 110.0]]);
    for rasterizer in RASTERIZERS {
        scene.splatting.rasterizer = rasterizer;
        let mut view = gpu.view(volume.clone(), &scene).unwrap();
        for range in [[99.0, 111.0], [50.0, 255.0], [90.0, 95.0], [40.0, 255.0]] {
            view.set_iso_ranges(Some(vec![range])).unwrap();
            let estimate = gpu.renderer().estimate(&view).unwrap();
            let mut again = scene.clone();
            again.channels[0].transfer.iso_ranges = Some(vec![range]);
            let mut fresh = gpu.view(volume.clone(), &again).unwrap();
            gpu.renderer().prepare(gpu.device(), gpu.queue(), &mut fresh).unwrap();
            assert_eq!(estimate, fresh.gpu_bytes(), "{rasterizer:?} {range:?}");
            gpu.draw(&mut view).unwrap();
        }
    }
}

/// A host can bind the texture of first hits once; later frames keep it, and nothing more.
#[test]
fn first_hits_stay_where_they_are() {
    let _alone = alone();
    let gpu = gpu();
    for rasterizer in RASTERIZERS {
        let (volume, mut scene) = head(16);
        scene.splatting.rasterizer = rasterizer;
        let mut view = gpu.view(volume, &scene).unwrap();
        view.set_first_hit(Some(0.1)).unwrap();
        gpu.draw(&mut view).unwrap();
        let texture = view.first_hits().unwrap().clone();
        let (bytes, held) = (view.gpu_bytes(), allocated(gpu));
        for _ in 0..5 {
            view.set_light(Light::Direction(DVec3::X)).unwrap();
            gpu.draw(&mut view).unwrap();
            assert!(*view.first_hits().unwrap() == texture, "{rasterizer:?}");
        }
        assert_eq!(view.gpu_bytes(), bytes);
        assert!(allocated(gpu) <= held + 1024, "{rasterizer:?}");
        scene.image.width += 1;
        view.set_image(scene.image).unwrap();
        gpu.renderer().prepare(gpu.device(), gpu.queue(), &mut view).unwrap();
        assert!(*view.first_hits().unwrap() != texture, "of another size");
    }
}
