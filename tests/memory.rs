//! GPU memory: what is reported, and that it is given back.
#![expect(clippy::unwrap_used, reason = "tests")]

#[expect(dead_code, reason = "not every file needs all of it")]
mod common;

use glam::{DVec3, UVec3};
use sheetsplat::GpuVolume;
use sheetsplat::headless::Headless;
use sheetsplat::scene::Scene;
use sheetsplat::transfer_function::LabelTables;
use sheetsplat::volume::{Volume, builtin};
use sheetsplat::wgpu::PollType;

use common::{RASTERIZERS, gpu, scene, transfer};

fn head(size: u32) -> (Volume, Scene) {
    let mut scene = scene(60, 50);
    scene.transfer = transfer(&[(40.0, [0.9, 0.6, 0.4])], &[(30.0, 0.0), (120.0, 0.3)]);
    (builtin::volume(&format!("head:{size}")).unwrap(), scene)
}

/// Bytes that wgpu has allocated, once nothing is under way.
fn allocated(gpu: &Headless) -> u64 {
    gpu.device().poll(PollType::wait_indefinitely()).unwrap();
    gpu.device().generate_allocator_report().unwrap().total_allocated_bytes
}

/// 200 renders on one device, of 5 volumes and 40 sizes, by both rasterizers.
#[test]
fn memory_is_given_back() {
    let gpu = gpu();
    let volumes = [8, 12, 16, 20, 24].map(head);
    let mut held = Vec::new();
    for number in 0..200 {
        let (volume, mut scene) = volumes[number % 5].clone();
        scene.splatting.rasterizer = RASTERIZERS[number % 2];
        (scene.image.width, scene.image.height) = (20 + (number % 40) as u32 * 7, 200 - (number % 40) as u32 * 3);
        let mut view = gpu.view(volume, &scene).unwrap();
        view.set_first_hit((number % 3 == 0).then_some(0.1));
        gpu.draw(&mut view).unwrap();
        assert!(allocated(&gpu) >= view.gpu_bytes(), "it is really there");
        drop(view);
        held.push(allocated(&gpu));
    }
    // What pipelines have stays, and a few hundred bytes of wgpu's own come and go; any buffer of a frame's image is larger.
    let most = held[..10].iter().max().unwrap() + 1024;
    assert!(held[10..].iter().all(|&bytes| bytes <= most), "{held:?}");
    assert!(most < 1 << 20, "{held:?}");
}

/// A view that grows and shrinks holds at most 4 times what a new one does, and gives all of it back.
#[test]
fn a_view_that_shrinks_gives_back() {
    let gpu = gpu();
    for rasterizer in RASTERIZERS {
        let (volume, mut scene) = head(16);
        scene.splatting.rasterizer = rasterizer;
        let before = allocated(&gpu);
        let mut view = gpu.view(volume.clone(), &scene).unwrap();
        for number in 0..40 {
            (scene.image.width, scene.image.height) = if number % 2 == 0 { (400, 300) } else { (60, 50) };
            view.set_image(scene.image);
            gpu.draw(&mut view).unwrap();
            let mut fresh = gpu.view(volume.clone(), &scene).unwrap();
            gpu.draw(&mut fresh).unwrap();
            assert!((fresh.gpu_bytes()..=4 * fresh.gpu_bytes()).contains(&view.gpu_bytes()), "{rasterizer:?} {number}");
        }
        drop(view);
        let after = allocated(&gpu);
        assert!(after <= before + (1 << 16), "{rasterizer:?}: {before} {after}");
    }
}

/// Exactly: of volumes of a part of a row, a row, several, and several layers.
#[test]
fn a_volumes_bytes_are_known_before() {
    let gpu = gpu();
    for dims in [[3, 5, 7], [2048, 1, 1], [2049, 1, 1], [64, 64, 65], [2048, 2049, 1]] {
        let dims = UVec3::from(dims);
        let count = dims.element_product();
        let values = (0..count).map(|voxel| (voxel % 7) as f32).collect();
        let volume = Volume::new("steps", dims, DVec3::ONE, values).unwrap();
        let on_gpu = GpuVolume::new(gpu.device(), gpu.queue(), volume).unwrap();
        assert_eq!(on_gpu.gpu_bytes(), GpuVolume::estimate(count)[0], "{dims}");
    }
    // With labels, of whose tables some matter to shading.
    let (volume, mut scene) = head(20);
    let [values, both] = GpuVolume::estimate(volume.values().len() as u32);
    let mut view = gpu.view(volume.clone(), &scene).unwrap();
    gpu.draw(&mut view).unwrap();
    assert_eq!(view.volume().gpu_volume().gpu_bytes(), values);
    let color = scene.transfer.color.clone();
    scene.transfer.labels = [(1, LabelTables { color, ..LabelTables::default() })].into();
    let mut view = gpu.view(volume, &scene).unwrap();
    gpu.draw(&mut view).unwrap();
    assert_eq!(view.volume().gpu_volume().gpu_bytes(), both);
}
