//! Views in perspective and sheets along the slices (SPEC §§2, 3.1, 5): whole frames by each rasterizer against the f64 evaluation, with
//! eyes outside, beside and inside the volume. `cargo test --test gpu views:: -- --nocapture` prints the measurements.

use sheetsplat::headless::{GpuHeadless, Rendering};
use sheetsplat::internals::reference;
use sheetsplat::scene::Scene;
use sheetsplat::settings::Light;
use sheetsplat::settings::{Method, Order, Rasterizer};
use sheetsplat::stats::Counts;
use sheetsplat::volume::Volume;

use crate::common::compare::{assert_at_least, assert_at_most};
use crate::common::devices::gpu;
use crate::common::images::{BLACK, largest_difference, psnr};
use crate::common::{BY_AMOUNTS, F32, RASTERIZERS, Random, SPACINGS, random_eye, random_volume, scene, transfer};

/// Any view in perspective, or any view of slices, some of them orthographic.
fn random_case(random: &mut Random) -> (Volume, Scene) {
    let spacing = random.pick(&SPACINGS);
    let volume = random_volume(random, (5.0, 14.0), spacing);
    let mut scene = scene(random.uniform(20.0, 70.0) as u32, random.uniform(20.0, 60.0) as u32);
    scene.splatting.method = random.pick(&[Method::ImageAligned, Method::AxisAligned]);
    if scene.splatting.method == Method::ImageAligned || !random.bits().is_multiple_of(3) {
        scene.camera = random_eye(random, volume.grid());
    } else {
        scene.camera.direction = random.direction();
    }
    let (haze, solid) = (random.pick(&[0.0, 0.02, 0.2]), random.pick(&[0.3, 0.9, 1.0]));
    let opacity = [(5.0, 0.0), (20.0, haze), (200.0, solid)];
    scene.channels[0].transfer = transfer(&[(0.0, [0.2, 0.5, 1.0]), (200.0, [1.0, 0.9, 0.8])], &opacity);
    let fixed = Light::Direction(random.direction());
    scene.shading.light = random.pick(&[Light::Headlight, fixed]);
    scene.splatting.compositing = random.pick(&BY_AMOUNTS);
    scene.splatting.slab_width = random.pick(&[0.5, 1.0, 2.0, 3.0]);
    scene.splatting.radius = random.pick(&[1.4, 2.0, 2.7]);
    // The reference culls nothing.
    scene.splatting.culling = false;
    (volume, scene)
}

fn render(gpu: &GpuHeadless, volume: &Volume, scene: &Scene, rasterizer: Rasterizer, order: Order) -> Rendering {
    let mut scene = scene.clone();
    (scene.splatting.rasterizer, scene.splatting.order) = (rasterizer, order);
    gpu.render_volume(volume.clone(), &scene).unwrap()
}

#[test]
fn any_view_equals_the_reference() {
    let gpu = gpu();
    let mut random = Random(1998);
    // The PSNR in dB by rasterizer and method.
    let mut worst = [[f64::INFINITY; 2]; 2];
    let mut seen = 0;
    for case in 0..24 {
        let (volume, scene) = random_case(&mut random);
        let transfer = scene.channels[0].transfer.resolve(&volume);
        let expected = reference::render(&volume, std::slice::from_ref(&transfer), &scene).unwrap();
        let all = |counts: &Counts| [counts.voxels_in_range, counts.sections_total, counts.sheets, counts.tiles_total];
        let counts = reference::count(&volume, std::slice::from_ref(&transfer), &scene).unwrap();
        seen += usize::from(expected.pixels.iter().filter(|pixel| **pixel != BLACK).count() > 100);
        for (at, rasterizer) in RASTERIZERS.into_iter().enumerate() {
            let [forwards, backwards] =
                [Order::FrontToBack, Order::BackToFront].map(|order| render(gpu, &volume, &scene, rasterizer, order));
            for rendering in [&forwards, &backwards] {
                assert_eq!(all(&rendering.stats.counts), all(&counts), "case {case}, {rasterizer:?}: {scene:?}");
            }
            let decibels = psnr(&forwards.image.pixels, &expected.pixels, BLACK, 0);
            let worst = &mut worst[at][scene.splatting.method as usize];
            *worst = worst.min(decibels);
            assert_at_least(decibels, 75.0, format_args!("case {case}, {rasterizer:?} with {scene:?}"));
            // Each sheet adds a subtraction, a product and a sum of numbers up to 1, in either order, whose roundings have either sign.
            let allowed = 1.5 * F32 * counts.sheets as f64;
            let difference = largest_difference(&forwards.image, &backwards.image);
            assert_at_most(difference, allowed, format_args!("case {case}, {rasterizer:?} with {scene:?}"));
        }
    }
    println!("image-aligned in perspective and axis-aligned, at least: {worst:.1?} dB by {RASTERIZERS:?}");
    assert!(seen > 15, "only {seen} views show much");
}

/// Threads that draw and pick with one device get what each of them would get alone, whichever of them waits for the GPU.
#[test]
fn threads_share_a_device() {
    let gpu = gpu();
    let mut random = Random(7);
    let cases: Vec<_> = std::iter::repeat_with(|| random_case(&mut random)).take(4).collect();
    let draw = |(volume, scene): &(Volume, Scene)| {
        let mut view = gpu.view(volume.clone(), scene).unwrap();
        view.set_first_hit(Some(0.1)).unwrap();
        let Rendering { image, stats } = gpu.draw(&mut view).unwrap();
        let [x, y] = [image.width / 2, image.height / 2];
        (image, stats.counts, gpu.pick(&view, [x, y]).unwrap().map(|pick| pick.voxel))
    };
    let alone: Vec<_> = cases.iter().map(draw).collect();
    assert!(alone.iter().any(|(_, _, voxel)| voxel.is_some()));
    std::thread::scope(|threads| {
        for (case, expected) in cases.iter().zip(&alone) {
            threads.spawn(move || (0..8).for_each(|_| assert!(draw(case) == *expected)));
        }
    });
}
