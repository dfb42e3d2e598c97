//! Early splat elimination, tiles and sheet groups (SPEC §6): they change what a frame costs, not what it shows.

#![expect(clippy::unwrap_used, reason = "tests")]

use glam::{DVec3, UVec3};
use sheetsplat::headless::{Headless, HeadlessOptions, Rendering};
use sheetsplat::image::Image;
use sheetsplat::reference;
use sheetsplat::reference::visibility::Test;
use sheetsplat::scene::{Scene, VolumeSource};
use sheetsplat::splatting::{Compositing, FootprintForm, Rasterizer};
use sheetsplat::transfer_function::Ramp;
use sheetsplat::volume::{Volume, builtin};

/// What f32 and f16 arithmetic may differ by between two ways to the same image: amounts are f16, but the same ones; sums of
/// a few hundred f32 terms of at most 1 differ by some 1e-5.
const ROUNDING: f32 = 2e-5;

fn headless(sheets_per_group: Option<u32>) -> Headless {
    let adapter = Some("llvmpipe".to_owned());
    Headless::new(&HeadlessOptions { adapter, sheets_per_group, ..HeadlessOptions::default() }).unwrap()
}

/// SplitMix64.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) as f64 / u64::MAX as f64
    }

    fn pick<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[(self.next() * choices.len() as f64) as usize % choices.len()]
    }
}

/// Balls and noise on a grid that is no multiple of a brick.
fn random_volume(random: &mut Random) -> Volume {
    let dims = UVec3::new(0, 0, 0).map(|_: u32| 9 + (random.next() * 22.0) as u32);
    let spacing = DVec3::from(random.pick(&[[1.0, 1.0, 1.0], [1.0, 1.0, 2.0], [3.2, 3.2, 1.5], [1.0, 1.0, 5.0]]));
    let balls: Vec<(DVec3, f64)> = (0..5)
        .map(|_| (DVec3::new(random.next(), random.next(), random.next()) * dims.as_dvec3(), 2.0 + 7.0 * random.next()))
        .collect();
    let mut values = Vec::new();
    for z in 0..dims.z {
        for y in 0..dims.y {
            for x in 0..dims.x {
                let p = UVec3::new(x, y, z).as_dvec3();
                let inside = balls.iter().any(|(center, radius)| p.distance(*center) < *radius);
                values.push(if inside { 200.0 } else { 20.0 * random.next() } as f32);
            }
        }
    }
    Volume::new("random", dims, spacing, values).unwrap()
}

fn random_scene(random: &mut Random) -> Scene {
    let mut scene = Scene::new(VolumeSource::Builtin("cube".to_owned()));
    scene.camera.direction = DVec3::new(random.next() - 0.5, random.next() - 0.5, random.next() - 0.45);
    scene.image.width = 33 + (random.next() * 90.0) as u32;
    scene.image.height = 33 + (random.next() * 90.0) as u32;
    scene.transfer.color = Some(Ramp::new(vec![(0.0, DVec3::new(0.2, 0.5, 1.0)), (200.0, DVec3::ONE)]).unwrap());
    let (haze, solid) = (random.pick(&[0.0, 0.01, 0.2]), random.pick(&[0.3, 0.9, 1.0]));
    scene.transfer.opacity = Some(Ramp::new(vec![(5.0, 0.0), (20.0, haze), (200.0, solid)]).unwrap());
    scene.splatting.compositing = random.pick(&[Compositing::Linear, Compositing::Exponential]);
    scene.splatting.opacity_threshold = random.pick(&[0.5, 0.8, 0.95, 0.999, 1.0]);
    scene.splatting.slab_width = random.pick(&[0.5, 1.0, 2.0]);
    scene.splatting.radius = random.pick(&[1.4, 2.0]);
    scene.splatting.footprint = random.pick(&[FootprintForm::SummedArea, FootprintForm::Sections]);
    if random.next() < 0.5 {
        // Close by: the object reaches beyond every edge of the image.
        scene.camera.projection = sheetsplat::camera::Projection::Orthographic { height: Some(12.0) };
        scene.camera.center = DVec3::new(random.next(), random.next(), random.next()) * 8.0 - 4.0;
    }
    scene
}

fn largest_difference(a: &Image, b: &Image) -> f32 {
    a.pixels.as_flattened().iter().zip(b.pixels.as_flattened()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

fn render(headless: &Headless, volume: &Volume, scene: &Scene) -> Rendering {
    headless.render_volume(volume.clone(), scene).unwrap()
}

#[test]
fn culling_keeps_its_guarantee() {
    let headless = headless(None);
    let mut random = Random(1999);
    let mut culled = 0;
    for case in 0..40 {
        let volume = random_volume(&mut random);
        let mut scene = random_scene(&mut random);
        scene.splatting.culling = true;
        let with = render(&headless, &volume, &scene);
        scene.splatting.culling = false;
        let without = render(&headless, &volume, &scene);
        let allowed = (1.0 - scene.splatting.opacity_threshold) as f32 + ROUNDING;
        let difference = largest_difference(&with.image, &without.image);
        assert!(difference <= allowed, "case {case}: {difference} > {allowed} with {scene:?}");
        assert!(with.stats.counts.sections_rasterized <= without.stats.counts.sections_rasterized);
        culled += usize::from(with.stats.counts.sections_rasterized < without.stats.counts.sections_rasterized);
    }
    assert!(culled > 20, "only {culled} of the cases cull anything");
}

#[test]
fn tiles_change_no_bit() {
    let headless = headless(None);
    let mut random = Random(42);
    for case in 0..12 {
        let volume = random_volume(&mut random);
        let mut scene = random_scene(&mut random);
        scene.splatting.tiles = true;
        let with = render(&headless, &volume, &scene);
        scene.splatting.tiles = false;
        let without = render(&headless, &volume, &scene);
        assert_eq!(with.image, without.image, "case {case}");
        assert!(with.stats.counts.tiles_composited <= without.stats.counts.tiles_composited);
    }
}

#[test]
fn groups_change_nothing_but_rounding() {
    let renderers = [1, 2, 4].map(|sheets| headless(Some(sheets)));
    let mut random = Random(7);
    for case in 0..10 {
        let volume = random_volume(&mut random);
        let mut scene = random_scene(&mut random);
        scene.splatting.culling = false;
        scene.splatting.rasterizer = Rasterizer::Quads;
        let [one, two, four] = [0, 1, 2].map(|at| render(&renderers[at], &volume, &scene));
        for other in [&two, &four] {
            let difference = largest_difference(&one.image, &other.image);
            assert!(difference <= ROUNDING, "case {case}: {difference}");
            assert_eq!(one.stats.counts.sections_rasterized, other.stats.counts.sections_rasterized);
            assert!(one.stats.counts.quads >= other.stats.counts.quads);
        }
    }
}

#[test]
fn culled_frames_are_byte_identical() {
    let mut random = Random(3);
    let volume = random_volume(&mut random);
    let mut scene = random_scene(&mut random);
    scene.splatting.opacity_threshold = 0.8;
    let headless_a = headless(None);
    let first = render(&headless_a, &volume, &scene);
    assert_eq!(first.image, render(&headless_a, &volume, &scene).image);
    assert_eq!(first.image, render(&headless(None), &volume, &scene).image);
}

/// The GPU lets through what the exact test lets through, and little more.
#[test]
fn culling_is_nearly_exact() {
    let headless = headless(None);
    let volume = builtin::volume("head:96").unwrap();
    let mut scene = Scene::new(VolumeSource::Builtin("head:96".to_owned()));
    scene.camera.direction = DVec3::new(0.55, 0.8, -0.12);
    (scene.image.width, scene.image.height) = (192, 192);
    scene.camera.projection = sheetsplat::camera::Projection::Orthographic { height: Some(172.0) };
    let transfer = scene.transfer.resolve(&volume);
    let exact = reference::render_culled(&volume, &transfer, &scene, Some(Test::Box)).unwrap().sections;
    let counts = render(&headless, &volume, &scene).stats.counts;
    let ratio = counts.sections_rasterized as f64 / exact as f64;
    println!("{} of {} sections, exactly {exact}: ratio {ratio:.3}", counts.sections_rasterized, counts.sections_total);
    assert!(counts.sections_rasterized as f64 > 0.99 * exact as f64);
    assert!(ratio <= 1.25, "{ratio}");
}

/// Fig. 10's test costs nothing visible, Fig. 11a's shows errors.
#[test]
fn the_papers_simpler_tests() {
    let volume = builtin::volume("head:48").unwrap();
    let mut scene = Scene::new(VolumeSource::Builtin("head:48".to_owned()));
    (scene.image.width, scene.image.height) = (96, 96);
    scene.camera.projection = sheetsplat::camera::Projection::Orthographic { height: Some(172.0) };
    let transfer = scene.transfer.resolve(&volume);
    let image = |test| reference::render_culled(&volume, &transfer, &scene, test).unwrap().image;
    let all = image(None);
    let allowed = (1.0 - scene.splatting.opacity_threshold) as f32;
    assert!(largest_difference(&all, &image(Some(Test::Box))) <= allowed);
    let by_center = largest_difference(&all, &image(Some(Test::Center)));
    assert!(by_center > 2.0 * allowed, "the centre's pixel alone is off by {by_center} only");
}

/// Fig. 13: what the rectangle costs. Ours bounds the footprint, not the parallelogram around it, so that it can be the tighter of
/// the two by a little. Both keep the guarantee.
#[test]
fn what_the_rectangle_costs() {
    let volume = builtin::volume("head:40").unwrap();
    let mut costs = Vec::new();
    for (spacing, direction) in [
        ([1.0, 1.0, 1.0], [0.55, 0.8, -0.3]),
        ([1.0, 1.0, 3.0], [0.55, 0.8, -0.3]),
        ([1.0, 1.0, 5.0], [0.4, 0.7, -0.6]),
        ([3.2, 3.2, 1.5], [0.6, 0.5, -0.6]),
    ] {
        let volume = volume.clone().with_spacing("head", DVec3::from(spacing)).unwrap();
        let mut scene = Scene::new(VolumeSource::Builtin("head:40".to_owned()));
        scene.camera.direction = DVec3::from(direction);
        scene.camera.up = DVec3::new(0.3, 0.1, 1.0);
        (scene.image.width, scene.image.height) = (120, 120);
        let transfer = scene.transfer.resolve(&volume);
        let render = |test| reference::render_culled(&volume, &transfer, &scene, test).unwrap();
        let [all, rectangle, parallelogram] = [None, Some(Test::Box), Some(Test::Parallelogram)].map(render);
        let allowed = (1.0 - scene.splatting.opacity_threshold) as f32;
        assert!(largest_difference(&all.image, &rectangle.image) <= allowed);
        assert!(largest_difference(&all.image, &parallelogram.image) <= allowed);
        let cost = rectangle.sections as f64 / parallelogram.sections as f64;
        println!("{spacing:?} along {direction:?}: the rectangle lets through {cost:.3} times the sections");
        assert!(cost > 0.95);
        costs.push(cost);
    }
    assert!((costs[0] - 1.0).abs() < 1e-9, "a cubic grid has no shear: {costs:?}");
    assert!(costs.iter().any(|&cost| cost > 1.01), "{costs:?}");
}

/// The paper's bounding box suits what is in one place, its tiles what is dispersed, and its counters say how few splats a tile
/// has seen.
#[test]
fn tiles_and_the_bounding_box() {
    let volume = |voxels: &[UVec3]| {
        let dims = UVec3::new(100, 3, 100);
        let mut values = vec![0.0; dims.element_product() as usize];
        voxels.iter().for_each(|at| values[(at.x + dims.x * (at.y + dims.y * at.z)) as usize] = 1.0);
        Volume::new("voxels", dims, DVec3::ONE, values).unwrap()
    };
    let areas = |voxels: &[UVec3]| {
        let mut scene = Scene::new(VolumeSource::Builtin("cube".to_owned()));
        scene.camera.direction = DVec3::Y;
        scene.camera.projection = sheetsplat::camera::Projection::Orthographic { height: Some(100.0) };
        (scene.image.width, scene.image.height) = (200, 200);
        scene.transfer.opacity = Some(Ramp::new(vec![(0.0, 0.0), (1.0, 0.5)]).unwrap());
        let volume = volume(voxels);
        reference::render_culled(&volume, &scene.transfer.resolve(&volume), &scene, Some(Test::Box)).unwrap().areas
    };
    // Two pixels a voxel: the footprint reaches 4 pixels from its centre. In the middle of a tile; four slabs.
    let inside = UVec3::new(8, 1, 91);
    let one = areas(&[inside]);
    assert_eq!((one.bounding_box, one.tiles, one.counted_tiles), (4 * 8 * 8, 4 * 32 * 32, 0));
    let two = areas(&[inside, UVec3::new(88, 1, 11)]);
    assert_eq!((two.bounding_box, two.tiles, two.counted_tiles), (4 * 168 * 168, 2 * 4 * 32 * 32, 0));
    // A tile of 32×32 pixels needs 13 splats of 9×9. Sheet by sheet it has seen 16 voxels more.
    let block: Vec<UVec3> = (0..16).map(|i| UVec3::new(7 + i % 4, 1, 90 + i / 4)).collect();
    let many = areas(&block);
    assert_eq!((many.tiles, many.counted_tiles), (4 * 32 * 32, 4 * 32 * 32));
    let few = areas(&block[..4]);
    assert_eq!((few.tiles, few.counted_tiles), (4 * 32 * 32, 32 * 32));
}

/// Timing changes no image, and there are times for every stage, also where a frame has more passes than a query set has queries.
#[test]
fn profiled_frames() {
    let volume = builtin::volume("head:64").unwrap();
    let mut scene = Scene::new(VolumeSource::Builtin("head:64".to_owned()));
    (scene.image.width, scene.image.height) = (40, 40);
    scene.splatting.slab_width = 0.05;
    let devices = [false, true].map(|profile| {
        let (adapter, sheets_per_group) = (Some("llvmpipe".to_owned()), Some(1));
        Headless::new(&HeadlessOptions { adapter, sheets_per_group, profile, ..HeadlessOptions::default() }).unwrap()
    });
    for (rasterizer, stages) in [
        (Rasterizer::Quads, &["composite", "cull", "resolve", "splat"][..]),
        (Rasterizer::Tiles, &["gather", "resolve"]),
    ] {
        scene.splatting.rasterizer = rasterizer;
        let [plain, profiled] = [0, 1].map(|at| render(&devices[at], &volume, &scene));
        assert_eq!(plain.image, profiled.image);
        assert_eq!(plain.stats.counts, profiled.stats.counts);
        assert!(plain.stats.stages_ms.is_empty());
        assert!(profiled.stats.counts.sheets * 3 > 2048, "{} sheets", profiled.stats.counts.sheets);
        let times = &profiled.stats.stages_ms;
        assert_eq!(times.keys().copied().collect::<Vec<_>>(), stages);
        assert!(times.values().all(|&ms| ms > 0.0), "{times:?}");
        let sum: f64 = times.values().sum();
        assert!(sum <= profiled.stats.frame_ms, "{times:?} in {} ms", profiled.stats.frame_ms);
    }
}
