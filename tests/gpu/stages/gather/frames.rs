//! Whole frames by the tile rasterizer's stage against the f64 evaluation: every view, all dispatches and bands, and what is hidden.

use glam::{DVec2, DVec3, DVec4, UVec3};
use sheetsplat::internals::brick;
use sheetsplat::internals::gpu::layout::Tally;
use sheetsplat::internals::pass::gather::Gather;
use sheetsplat::internals::patch_bins::{Passes, PatchBins};
use sheetsplat::internals::reference::footprint::Footprint;
use sheetsplat::scene::{Scene, TransferSettings};
use sheetsplat::settings::{Compositing, FootprintBox, Light, Method, Order, Projection, Ramp};
use sheetsplat::volume::Volume;

use super::{Drawn, Fixture};
use crate::common::compare::{apart, assert_at_most, largest, root_mean_square};
use crate::common::devices::gpu;
use crate::common::{BY_AMOUNTS, Random, camera, scene, transfer};
use crate::stages::section::{KERNELS, Seen};

/// Values of a small volume with noise everywhere and transparent places, with its transfer function: with as many control points as
/// threads hold, or more.
fn noise(random: &mut Random, dims: UVec3, spacing: [f64; 3], opacity: f64, points: u32) -> (Volume, TransferSettings) {
    let values = (0..dims.element_product()).map(|_| random.uniform(0.0, 255.0) as f32).collect();
    let volume = Volume::new("noise", dims, DVec3::from(spacing), values).unwrap();
    let at = |i: u32| 255.0 * f64::from(i) / f64::from(points);
    let color: Vec<_> = (0..points).map(|i| (at(i), [(); 3].map(|()| random.uniform(0.0, 1.0)))).collect();
    let scalar: Vec<_> = (0..points).map(|i| (at(i) + 60.0, random.uniform(0.1, 1.0) * opacity)).collect();
    let opacity: Vec<_> = [(40.0, 0.0)].into_iter().chain(scalar).collect();
    let gradient = (0..points).map(|i| (at(i), random.uniform(0.2, 1.0))).collect();
    (volume, TransferSettings { gradient_opacity: Some(Ramp::new(gradient).unwrap()), ..transfer(&color, &opacity) })
}

/// Direction, spacing, `unit`s per pixel, and image size.
type Frame = ([f64; 3], [f64; 3], f64, [u32; 2]);

/// Along an axis and oblique, anisotropic, magnified and minified, partly off the screen, and of sizes that are not multiples of a tile's.
const FRAMES: [Frame; 8] = [
    ([0.0, 1.0, 0.0], [1.0, 1.0, 1.0], 0.25, [70, 45]),
    ([-0.3, -0.9, 0.2], [1.0, 1.0, 1.0], 0.5, [33, 50]),
    ([0.0, 0.0, 1.0], [1.0, 1.0, 3.0], 0.7, [16, 32]),
    ([0.6, 0.5, 0.6], [1.0, 1.0, 3.0], 0.4, [65, 17]),
    ([0.6, -0.5, -0.6], [1.0, 1.0, 5.0], 0.3, [47, 64]),
    ([0.5, 0.3, 0.8], [3.2, 3.2, 1.5], 0.05, [40, 31]),
    ([0.1, 0.9, 0.4], [1.0, 1.0, 5.0], 4.0, [15, 7]),
    ([0.7, 0.2, 0.3], [1.0, 2.0, 1.0], 12.0, [1, 1]),
];

/// A scene with a frame's camera, not quite at the middle.
fn frame_scene((direction, spacing, units_per_pixel, [width, height]): Frame, random: &mut Random) -> Scene {
    let mut scene = scene(width, height);
    let unit = spacing.into_iter().fold(f64::INFINITY, f64::min);
    scene.camera = camera(direction, units_per_pixel * unit * f64::from(height));
    scene.camera.up = DVec3::new(0.2, 0.3, 1.0);
    scene.camera.center = Some(DVec3::from_array([(); 3].map(|()| random.uniform(-2.0, 2.0))));
    scene
}

/// An eye that sees the frame's middle plane at the frame's scale, in front of the volume or in it.
fn eye((_, spacing, units_per_pixel, [_, height]): Frame, random: &mut Random) -> Projection {
    let unit = spacing.into_iter().fold(f64::INFINITY, f64::min);
    let distance = random.uniform(6.0, 40.0);
    let fov_y = 2.0 * (units_per_pixel * f64::from(height) / 2.0 / distance).atan().to_degrees();
    let near = random.uniform(1.0, 6.0);
    Projection::Perspective { fov_y, distance: Some(distance * unit), near: Some(near * unit) }
}

#[test]
fn frames() {
    let (gpu, stage) = (gpu(), Gather::default());
    let mut random = Random(42);
    let mut lit = 0;
    for (compositing, order) in BY_AMOUNTS
        .into_iter()
        .flat_map(|compositing| [Order::FrontToBack, Order::BackToFront].map(|order| (compositing, order)))
    {
        for frame in FRAMES.into_iter().cycle().take(10) {
            let mut scene = frame_scene(frame, &mut random);
            let (radius, falloff) = random.pick(&KERNELS);
            (scene.splatting.radius, scene.splatting.falloff) = (radius, falloff);
            scene.splatting.slab_width = random.pick(&[0.3, 1.0, 2.6]);
            (scene.splatting.compositing, scene.splatting.order) = (compositing, order);
            scene.splatting.culling = false;
            if random.bits().is_multiple_of(2) {
                scene.camera.projection = eye(frame, &mut random);
            }
            if random.bits().is_multiple_of(3) {
                scene.splatting.method = Method::AxisAligned;
            }
            if random.bits().is_multiple_of(2) {
                scene.shading.light = Light::Direction(random.direction());
            }
            let dims = UVec3::new(7, 10, 9);
            let points = random.pick(&[1, 4, 8, 9, 40]);
            let opacity = if compositing == Compositing::Xray { 0.01 } else { 0.6 };
            let (mut volume, transfer) = noise(&mut random, dims, frame.1, opacity, points);
            scene.channels[0].transfer = transfer;
            if random.bits().is_multiple_of(3) {
                let sample = |value: f32| if random.bits().is_multiple_of(4) { f32::NAN } else { value };
                let values = volume.values().iter().map(sample).collect();
                volume = Volume::new("holes", dims, volume.spacing(), values).unwrap();
            }
            let fixture = Fixture::new(gpu, &stage, scene, volume);
            let (actual, expected) = (fixture.draw_all().acc, fixture.twin());
            let errors: Vec<f64> =
                actual.iter().zip(&expected).flat_map(|(actual, expected)| (*actual - *expected).to_array()).collect();
            // Every kernel errs by less than 5e-6 of its peak, mostly near its rim, so the errors of few kernels coincide in a pixel.
            let what = format!("{:?}, {:?}", fixture.seen.scene, fixture.seen.kernel);
            assert_at_most(largest(errors.iter().copied()), 4e-5, &what);
            assert_at_most(root_mean_square(errors), 5e-6, &what);
            lit += expected.iter().filter(|pixel| (0.01..0.99).contains(&pixel.w)).count();
        }
    }
    assert!(lit > 20_000, "only {lit} pixels were compared");
}

/// However groups are divided among dispatches and rows among bindings, the work and the bytes are the same.
#[test]
fn dispatches_and_bands_change_no_more_than_rounding() {
    let (gpu, stage) = (gpu(), Gather::default());
    let mut random = Random(43);
    for (compositing, order) in [
        (Compositing::Linear, Order::FrontToBack),
        (Compositing::Linear, Order::BackToFront),
        (Compositing::Surface, Order::FrontToBack),
        (Compositing::Minimum, Order::FrontToBack),
        (Compositing::Minimum, Order::BackToFront),
    ] {
        let (volume, transfer) = noise(&mut random, UVec3::new(17, 30, 21), [1.0, 1.0, 2.0], 0.9, 4);
        // The voxels are opaque enough for surfaces.
        let transfer = TransferSettings { gradient_opacity: None, ..transfer };
        let mut scene = Scene { camera: camera([0.3, 0.9, -0.2], 40.0), ..scene(101, 77) }.with_transfer(transfer);
        (scene.splatting.order, scene.splatting.opacity_threshold) = (order, 0.8);
        scene.splatting.compositing = compositing;
        let fixture = Fixture::new(gpu, &stage, scene, volume);
        let bins = fixture.bins();
        assert!(bins.groups > 8, "{}", bins.groups);
        let whole = fixture.draw(&bins, None, &fixture.empty(), u32::MAX);
        assert!(whole.acc.iter().any(|pixel| pixel.w > 0.9));
        assert!(whole.tally.sections_rasterized > 10_000, "{:?}", whole.tally);
        // The maximum number of bricks in a group.
        let bricks = bins.starts().windows(2).map(|group| group[1] - group[0]).max().unwrap();
        let one_group = bins.passes.per_group + bricks * bins.passes.per_brick;
        // This suffices for all groups if each dispatch processes one.
        let dispatches = bins.groups;
        for (most, rows) in [(one_group + 1000, u32::MAX), (one_group, 32), (bins.passes.most, 64)] {
            let passes = Passes { most, ..bins.passes };
            let first = PatchBins { passes, dispatches: 1, ..bins.clone() };
            let is_same = |drawn: &Drawn| {
                // Voxels are added in another order if a dispatch finds again what it could have kept.
                let pairs = drawn.acc.iter().zip(&whole.acc);
                largest(pairs.map(|(a, b)| apart(*a, *b))) < 1e-5
            };
            let is_cut = !is_same(&fixture.draw(&first, None, &fixture.empty(), rows));
            assert_eq!(is_cut, most < bins.passes.most, "one dispatch of {most} passes");
            let parts = fixture.draw(&PatchBins { dispatches, ..first }, None, &fixture.empty(), rows);
            // Bricks entirely behind opaque pixels are not fetched, or in another dispatch.
            let tally = Tally { bricks_visited: whole.tally.bricks_visited, ..parts.tally };
            assert!(is_same(&parts), "{compositing:?}, {order:?}, {rows} rows");
            let acc = whole.acc.clone();
            assert!(Drawn { tally, acc, ..parts } == whole, "{compositing:?}, {order:?}, {rows} rows");
        }
    }
}

/// The minimum opacity is 0 where the ray is empty behind the last brick, even if a dispatch ends there.
#[test]
fn the_minimum_extends_behind_all_bricks() {
    let (gpu, stage) = (gpu(), Gather::default());
    let dims = UVec3::new(12, 60, 12);
    let value = |index: u32| if (4..8).contains(&(index / dims.x % dims.y)) { 1.0 } else { 0.0 };
    let volume = Volume::new("front", dims, DVec3::ONE, (0..dims.element_product()).map(value).collect()).unwrap();
    // One pixel in the middle sees all voxels, so that a group needs about the maximum number of passes.
    let mut scene = Scene { camera: camera([0.0, 1.0, 0.0], 200.0), ..scene(17, 17) };
    scene.channels[0].transfer = transfer(&[(0.0, [1.0; 3])], &[(0.0, 0.0), (1.0, 0.5)]);
    scene.splatting.compositing = Compositing::Minimum;
    let fixture = Fixture::new(gpu, &stage, scene, volume);
    let bins = fixture.bins();
    let bricks = bins.starts().windows(2).map(|group| group[1] - group[0]).max().unwrap();
    let passes = Passes { most: bins.passes.per_group + bricks * bins.passes.per_brick, ..bins.passes };
    let middle = |dispatches| {
        let bins = PatchBins { passes, dispatches, ..bins.clone() };
        fixture.draw(&bins, None, &fixture.empty(), u32::MAX).acc[8 * 17 + 8]
    };
    // Empty means 2 minus an opacity of 0.
    let nothing = DVec4::W * 2.0;
    assert_eq!(middle(bins.groups), nothing);
    // With 8 threads the dispatch that draws the last brick needs all its passes for that.
    assert!((1..bins.groups).any(|dispatches| middle(dispatches) != nothing));
}

/// More voxels are behind a tile and in a sheet group than fit in the workgroup's queue, so sheets wait for the rest.
#[test]
fn more_voxels_than_the_queue_holds() {
    let (gpu, stage) = (gpu(), Gather::default());
    let mut random = Random(45);
    for (slab_width, order) in [(1.0, Order::FrontToBack), (0.3, Order::BackToFront), (2.6, Order::FrontToBack)] {
        let (volume, transfer) = noise(&mut random, UVec3::splat(24), [1.0; 3], 0.05, 4);
        let mut scene = Scene { camera: camera([0.3, 0.9, -0.2], 26.0), ..scene(33, 17) }.with_transfer(transfer);
        (scene.splatting.slab_width, scene.splatting.order, scene.splatting.culling) = (slab_width, order, false);
        let fixture = Fixture::new(gpu, &stage, scene, volume);
        let bins = fixture.bins();
        let bricks = bins.starts().windows(2).map(|bin| bin[1] - bin[0]).max().unwrap();
        // The queue holds a few hundred voxels; two thirds of all voxels are drawn.
        assert!(bricks * 64 > 3000 || slab_width < 1.0, "{bricks} bricks");
        let (actual, expected) = (fixture.draw(&bins, None, &fixture.empty(), u32::MAX).acc, fixture.twin());
        let errors = actual.iter().zip(&expected).map(|(actual, expected)| apart(*actual, *expected));
        assert_at_most(largest(errors), 1e-5, format_args!("slab width {slab_width}"));
        assert!(expected.iter().any(|pixel| pixel.w > 0.1));
    }
}

/// Draws over a mask of opaque pixels: a voxel is drawn if and only if its footprint's box contains the centre of an open pixel. Pixels of the
/// parallelogram outside the rectangle need not count.
#[test]
fn hidden_behind_what_is_there() {
    let (gpu, stage) = (gpu(), Gather::default());
    let mut random = Random(44);
    let (mut drawn_in_all, mut hidden_in_all) = (0, 0);
    for footprint_box in [FootprintBox::Rectangle, FootprintBox::Parallelogram] {
        for frame in FRAMES.into_iter().cycle().take(24) {
            let mut scene = frame_scene(frame, &mut random);
            scene.splatting.footprint_box = footprint_box;
            scene.splatting.radius = random.uniform(1.0, 3.0);
            // The voxels are so faint that nothing becomes opaque.
            scene.channels[0].transfer = transfer(&[(0.0, [1.0; 3])], &[(0.0, 1e-6)]);
            let values = vec![1.0; 8 * 9 * 7];
            let volume = Volume::new("dense", UVec3::new(8, 9, 7), DVec3::from(frame.1), values).unwrap();
            let fixture = Fixture::new(gpu, &stage, scene, volume);
            let open = open_pixels(&mut random, fixture.seen.view.size);
            let mut acc = vec![DVec4::ONE; fixture.empty().len()];
            for &[x, y] in &open {
                acc[(y * fixture.seen.view.size[0] + x) as usize] = DVec4::ZERO;
            }
            let drawn = fixture.draw(&fixture.bins(), None, &acc, u32::MAX).drawn;

            let Seen { kernel, geometry, .. } = &fixture.seen;
            let half_box = geometry.half_box(kernel.support());
            let sheared = Footprint::new(geometry.footprint_from_pixels).sheared_from_pixels();
            let half_width = kernel.support() / sheared.x_axis.x;
            // Whether the box, enlarged by `slack` pixels, contains the centre of an open pixel.
            let is_open = |center: DVec2, slack: f64, also_outside: bool| {
                open.iter().any(|&[x, y]| {
                    let d = DVec2::new(x.into(), y.into()) + 0.5 - center;
                    let in_rectangle = d.abs().cmple(half_box + slack);
                    let across = d.x + d.y * sheared.y_axis.x / sheared.x_axis.x;
                    let is_between = in_rectangle.y && across.abs() <= half_width + slack;
                    match footprint_box {
                        FootprintBox::Rectangle => in_rectangle.all(),
                        FootprintBox::Parallelogram => is_between && (in_rectangle.x || also_outside),
                    }
                })
            };
            for (at, brick) in fixture.bricks.bricks().iter().enumerate() {
                for (slot, voxel) in brick::voxels(brick) {
                    // The bit in the first group that the kernel reaches.
                    let is_drawn = drawn[at * 2 + slot as usize / 32] >> (slot % 32) & 1 == 1;
                    let center = geometry.pixel(voxel);
                    let what = || format!("{voxel} at {center}, {footprint_box:?}, {frame:?}, {kernel:?}");
                    assert!(is_drawn || !is_open(center, 0.0, false), "not drawn: {}", what());
                    // The shader's slack is a hundredth of a pixel.
                    assert!(!is_drawn || is_open(center, 0.02, true), "drawn: {}", what());
                    drawn_in_all += usize::from(is_drawn);
                    hidden_in_all += usize::from(!is_drawn);
                }
            }
        }
    }
    assert!(drawn_in_all > 2000 && hidden_in_all > 2000, "{drawn_in_all} drawn, {hidden_in_all} hidden");
}

/// Some rectangles and single pixels of an image.
fn open_pixels(random: &mut Random, size: [u32; 2]) -> Vec<[u32; 2]> {
    let mut pixels = Vec::new();
    for _ in 0..random.bits() % 4 {
        let most = if random.bits().is_multiple_of(2) { 1.0 } else { 12.0 };
        let [left, top] = size.map(|side| random.uniform(0.0, f64::from(side)) as u32);
        let [width, height] = [(); 2].map(|()| random.uniform(1.0, most + 1.0) as u32);
        let rows = top..size[1].min(top + height);
        pixels.extend(rows.flat_map(|y| (left..size[0].min(left + width)).map(move |x| [x, y])));
    }
    pixels
}
