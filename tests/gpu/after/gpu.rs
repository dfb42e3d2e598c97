//! Images of the GPU against the twin.

use std::collections::BTreeMap;

use glam::{DVec3, UVec3};
use sheetsplat::headless::{GpuHeadless, readback};
use sheetsplat::image::Image;
use sheetsplat::internals::reference::{self, Host};
use sheetsplat::internals::view_geometry::ViewGeometry;
use sheetsplat::scene::Scene;
use sheetsplat::settings::{Compositing, Gradient, Interpolation, LabelTables, Order, Ramp, Rasterizer, SlabProfile};
use sheetsplat::stats::Counts;
use sheetsplat::volume::{Labels, Volume, builtin};

use crate::after::{eye, render, scene};
use crate::common::cases::{in_turns, pairs};
use crate::common::compare::{assert_at_least, assert_at_most, decibels};
use crate::common::devices::{Drawing, gpu};
use crate::common::images::{largest_difference, rms};
use crate::common::surfaces::{DepthRange, surfaces};
use crate::common::{COMPOSITINGS, RASTERIZERS, camera, transfer};

/// A small head on a grid with such an aspect, semi-transparent, with a step in its opacity.
fn head(spacing: [f64; 3]) -> (Volume, Scene) {
    let mut scene = scene(70, 56);
    scene.channels[0].transfer = transfer(
        &[(40.0, [0.9, 0.6, 0.4]), (255.0, [1.0, 1.0, 0.9])],
        &[(30.0, 0.0), (70.0, 0.3), (71.0, 0.02), (150.0, 0.0), (200.0, 0.8)],
    );
    scene.splatting.culling = false;
    scene.camera = camera([0.4, 0.9, -0.3], 30.0);
    (builtin::volume("head:24").unwrap().with_spacing("head", DVec3::from(spacing)).unwrap(), scene)
}

/// Asserts that the images by all rasterizers are the twin's to some dB. The twin's shows something: at least a hundredth of its pixels, in more than
/// one colour.
fn assert_twins(gpu: &GpuHeadless, (volume, scene): (&Volume, &Scene), least: f64, case: &str) {
    let expected = render(volume, scene);
    assert_shows(&expected, scene);
    for rasterizer in RASTERIZERS {
        let image = Drawing::By(rasterizer).render(gpu, volume, scene).image;
        let measured = decibels(rms(&image, &expected));
        println!("{case}, {rasterizer:?}: {measured:.1} dB");
        assert_at_least(measured, least, format_args!("{case}, {rasterizer:?}"));
    }
}

fn assert_shows(image: &Image, scene: &Scene) {
    let shown: Vec<_> = image.pixels.iter().filter(|pixel| pixel[3] > 0.02).collect();
    let [low, high] =
        [f32::min, f32::max].map(|of| image.pixels.iter().map(|pixel| pixel[1]).reduce(of).unwrap_or(0.0));
    let compositing = scene.splatting.compositing;
    assert!(shown.len() >= image.pixels.len() / 100, "{compositing:?}: {} pixels", shown.len());
    assert!(high - low > 0.04, "{compositing:?}: {low} to {high}");
}

/// The volume with a texture: in homogeneous matter rounding would decide about the direction of the kernel's gradient.
fn textured(volume: &Volume) -> Volume {
    let values = (0_u32..).zip(volume.values()).map(|(at, v)| v + (at.wrapping_mul(2_654_435_761) >> 28) as f32);
    Volume::new("textured", volume.dims(), volume.grid().spacing, values.collect()).unwrap()
}

/// A transfer function under which every compositing shows something.
fn for_all(mut scene: Scene, compositing: Compositing) -> Scene {
    scene.splatting.compositing = compositing;
    let opacity: &[(f64, f64)] = match compositing {
        Compositing::Maximum => &[(20.0, 0.0), (100.0, 0.2), (250.0, 0.9)],
        Compositing::Minimum => {
            // The head alone: outside of it all minima are 0.
            scene.clip.crop = Some([DVec3::new(-6.0, -6.0, -8.0), DVec3::new(6.0, 5.0, 7.0)]);
            &[(0.0, 0.9), (60.0, 0.6), (150.0, 0.1), (255.0, 0.0)]
        }
        Compositing::Average => {
            // Not symmetric, or the middle of many rays would lie on a border between two voxels.
            scene.clip.crop = Some([DVec3::new(-11.0, -10.6, -16.4), DVec3::new(10.3, 11.2, 15.1)]);
            &[(10.0, 0.0), (60.0, 0.7), (90.0, 0.2)]
        }
        Compositing::Surface => &[(30.0, 0.0), (70.0, 0.7), (71.0, 0.1), (150.0, 0.2), (180.0, 0.8)],
        _ => return scene,
    };
    scene.channels[0].transfer.opacity = Some(Ramp::new(opacity.to_vec()).unwrap());
    scene
}

#[test]
fn images_are_the_twins() {
    let gpu = gpu();
    let (spacings, ways) = (
        [[1.0, 1.0, 1.0], [1.0, 1.0, 2.5]],
        [(Interpolation::Smooth, Gradient::Differences, 2.0), (Interpolation::Exact, Gradient::Kernel, 1.0)],
    );
    for [compositing, projection, way, spacing] in pairs([COMPOSITINGS.len(), 3, ways.len(), spacings.len()]) {
        let (compositing, spacing) = (COMPOSITINGS[compositing], spacings[spacing]);
        let (volume, base) = head(spacing);
        let projection = [base.camera.projection, eye(60.0), eye(9.0)][projection];
        let mut scene = for_all(base, compositing);
        scene.camera.projection = projection;
        let gradient;
        (scene.splatting.interpolation, gradient, scene.splatting.falloff) = ways[way];
        scene.shading.gradient = gradient;
        let volume = if compositing == Compositing::Minimum { textured(&volume) } else { volume };
        let case = format!("{spacing:?} {compositing:?} {gradient:?} {projection:?}");
        let required = if gradient == Gradient::Kernel { 55.0 } else { 60.0 };
        assert_twins(gpu, (&volume, &scene), required, &case);
    }
}

/// Another setting of a scene.
type Change = fn(&mut Scene);

/// Thin and thick slabs, other kernels, minified voxels, the other order, gradient opacity, iso-ranges, cuts.
#[test]
fn settings_are_the_twins() {
    let gpu = gpu();
    let cases: [(&str, Change); 16] = [
        ("cubic", |scene| scene.splatting.slab_profile = SlabProfile::Cubic),
        ("thin", |scene| scene.splatting.slab_width = 0.3),
        ("thick", |scene| scene.splatting.slab_width = 3.0),
        ("radius 1.4", |scene| scene.splatting.radius = 1.4),
        ("radius 2.7", |scene| scene.splatting.radius = 2.7),
        // Where the Gaussian vanishes within the radius.
        ("radius 4", |scene| scene.splatting.radius = 4.0),
        ("falloff 3", |scene| scene.splatting.falloff = 3.0),
        ("minified", |scene| scene.camera = camera([0.4, 0.9, -0.3], 120.0)),
        ("back to front", |scene| scene.splatting.order = Order::BackToFront),
        ("unshaded", |scene| scene.shading.enabled = false),
        ("iso-ranges", |scene| scene.channels[0].transfer.iso_ranges = Some(vec![[40.0, 90.0], [180.0, 230.0]])),
        ("planes", |scene| scene.clip.planes = vec![[0.3, 1.0, 0.2, 0.5]]),
        ("all tiles", |scene| scene.splatting.tiles = false),
        ("gradient opacity", |scene| {
            scene.channels[0].transfer.gradient_opacity = Some(Ramp::new(vec![(0.0, 0.2), (40.0, 1.0)]).unwrap());
        }),
        ("crop", |scene| scene.clip.crop = Some([DVec3::new(-9.0, -2.0, -9.0), DVec3::new(7.0, 9.0, 12.0)])),
        ("thin crop", |scene| {
            // Most rays meet no plane within it.
            scene.clip.crop = Some([DVec3::new(-30.0, 0.2, -30.0), DVec3::new(30.0, 0.7, 30.0)]);
            if scene.splatting.compositing != Compositing::Minimum {
                scene.channels[0].transfer.opacity = Some(Ramp::new(vec![(30.0, 0.1), (255.0, 0.9)]).unwrap());
            }
        }),
    ];
    for (at, projection) in [None, Some(eye(50.0))].into_iter().enumerate() {
        for (turn, (name, change)) in cases.iter().enumerate() {
            for compositing in in_turns(2 * turn + at, COMPOSITINGS) {
                // Surfaces are found front to back only.
                if *name == "back to front" && compositing == Compositing::Surface {
                    continue;
                }
                let (volume, scene) = head([1.0, 1.0, 1.5]);
                let mut scene = for_all(scene, compositing);
                change(&mut scene);
                scene.camera.projection = projection.unwrap_or(scene.camera.projection);
                let case = format!("{name} {compositing:?} {projection:?}");
                assert_twins(gpu, (&volume, &scene), 60.0, &case);
            }
        }
    }
}

/// With culling no channel differs by more than 1 - T, and something is left out where opaque pixels hide something. Where nothing hides
/// anything, the images are equal but for rounding.
#[test]
fn culling_keeps_its_promise() {
    const THRESHOLD: f64 = 0.9;
    let gpu = gpu();
    let compositings =
        [Compositing::Linear, Compositing::Exponential, Compositing::Xray, Compositing::Maximum, Compositing::Surface];
    for (turn, compositing) in compositings.into_iter().enumerate() {
        for projection in in_turns(turn, [None, Some(eye(600.0))]) {
            // Large enough for much to be hidden.
            let (volume, mut scene) = (builtin::volume("head:48").unwrap(), head([1.0, 1.0, 1.0]).1);
            scene.camera = camera([0.4, 0.9, -0.3], 300.0);
            scene.splatting.opacity_threshold = THRESHOLD;
            let colors = [(40.0, [0.9, 0.6, 0.4]), (255.0, [1.0, 1.0, 0.9])];
            scene.channels[0].transfer = transfer(&colors, &[(30.0, 0.0), (60.0, 0.9)]);
            scene = for_all(scene, compositing);
            scene.camera.projection = projection.unwrap_or(scene.camera.projection);
            for rasterizer in RASTERIZERS {
                scene.splatting.culling = false;
                let drawing = Drawing::By(rasterizer);
                let whole = drawing.render(gpu, &volume, &scene);
                assert_shows(&whole.image, &scene);
                scene.splatting.culling = true;
                let culled = drawing.render(gpu, &volume, &scene);
                let farthest = largest_difference(&whole.image, &culled.image);
                let is_gradual = matches!(compositing, Compositing::Linear | Compositing::Exponential);
                let allowed = if is_gradual { 1.0 - THRESHOLD + 1e-5 } else { 1e-5 };
                let case = format!("{compositing:?} {projection:?} {rasterizer:?}");
                assert_at_most(farthest, allowed, &case);
                let [all, drawn] = [whole, culled].map(|rendering| rendering.stats.counts.sections_rasterized);
                println!("{case}: {farthest:.5}, {drawn} of {all}");
                assert!(drawn <= all, "{case}: {drawn} of {all}");
                if is_gradual || compositing == Compositing::Surface {
                    assert!(drawn < all * 9 / 10, "{case}: {drawn} of {all}");
                }
            }
        }
    }
}

/// Volumes with holes, and labels with their own tables, one of them invisible.
#[test]
fn holes_and_labels_are_the_twins() {
    let gpu = gpu();
    for (turn, compositing) in COMPOSITINGS.into_iter().enumerate() {
        for projection in in_turns(turn, [None, Some(eye(50.0))]) {
            let mut scene = for_all(head([1.0, 1.0, 1.5]).1, compositing);
            scene.camera.projection = projection.unwrap_or(scene.camera.projection);
            holes_and_labels(gpu, scene);
        }
    }
}

fn holes_and_labels(gpu: &GpuHeadless, mut scene: Scene) {
    let compositing = scene.splatting.compositing;
    let (volume, _) = head([1.0, 1.0, 1.5]);
    let hollow = (0..).zip(volume.values()).map(|(at, v)| if at % 97 < 3 { f32::NAN } else { v }).collect();
    let hollow = Volume::new("hollow", volume.dims(), volume.grid().spacing, hollow).unwrap();
    assert_twins(gpu, (&hollow, &scene), 60.0, &format!("holes, {compositing:?}"));
    let values = (0..).zip(volume.values()).map(|(at, _)| (at / 9 % 4) as u16).collect();
    let (dims, origin) = (volume.dims(), "labels".to_owned());
    let labels = Labels { origin, dims, spacing: None, values, names: BTreeMap::new() };
    let labelled = volume.with_labels(labels).unwrap();
    let own =
        LabelTables { opacity: Some(Ramp::new(vec![(20.0, 0.0), (90.0, 0.7)]).unwrap()), ..LabelTables::default() };
    scene.channels[0].transfer.labels =
        [(1, own), (2, LabelTables { visible: false, ..LabelTables::default() })].into();
    assert_twins(gpu, (&labelled, &scene), 60.0, &format!("labels, {compositing:?}"));
}

/// Where all values around are equal, no pixel takes the rounding of their sums for a gradient.
#[test]
fn constant_regions_have_no_normal() {
    let (_, mut scene) = head([1.0; 3]);
    scene.shading.gradient = Gradient::Kernel;
    scene.channels[0].transfer =
        transfer(&[(0.0, [0.9, 0.6, 0.4]), (255.0, [1.0, 1.0, 0.9])], &[(190.0, 0.0), (200.0, 0.5)]);
    let value = |index: u32| match index {
        0 => 0.0,
        4095 => 255.0,
        _ => 201.3,
    };
    let volume = Volume::new("block", glam::UVec3::splat(16), DVec3::ONE, (0..4096).map(value).collect()).unwrap();
    for rasterizer in [Rasterizer::Quads, Rasterizer::Tiles] {
        for falloff in [1.0, 2.0] {
            (scene.splatting.rasterizer, scene.splatting.falloff) = (rasterizer, falloff);
            let (ours, expected) =
                (gpu().render_volume(volume.clone(), &scene).unwrap().image, render(&volume, &scene));
            assert!(expected.pixels.iter().any(|pixel| pixel[3] > 0.9), "falloff {falloff}");
            let measured = decibels(rms(&ours, &expected));
            println!("{rasterizer:?}, falloff {falloff}: {measured:.1} dB");
            assert_at_least(measured, 60.0, format_args!("{rasterizer:?}, falloff {falloff}"));
        }
    }
}

/// A host's surfaces cut rays, and first hits are where the twin has them.
#[test]
fn surfaces_and_first_hits_are_the_twins() {
    let gpu = gpu();
    for (case, compositing) in (0..).zip(COMPOSITINGS) {
        for projection in in_turns(case as usize, [None, Some(eye(60.0))]) {
            let (volume, scene) = head([1.0, 1.0, 1.5]);
            let mut scene = for_all(scene, compositing);
            scene.camera.projection = projection.unwrap_or(scene.camera.projection);
            let size = [scene.image.width, scene.image.height];
            let view = ViewGeometry::new(volume.grid(), &scene.camera, &scene.splatting, size).unwrap();
            let middle = view.rays().depth_of(DVec3::ZERO);
            let depth = |at: u32| {
                let place = [at % size[0], at / size[0]].map(f64::from);
                let is_gap = (place[0] * 0.3).sin() * (place[1] * 0.2).cos() > 0.6;
                if is_gap { f64::INFINITY } else { (middle + 2.0 + 4.0 * (place[0] * 0.2).sin()).max(0.05) }
            };
            let depths: Vec<f64> = (0..size[0] * size[1]).map(depth).collect();
            let first_hit = (compositing != Compositing::Minimum).then_some(0.1);
            let host = Host { surfaces: Some(&depths), first_hit };
            let expected =
                reference::render_for(host, &volume, &[scene.channels[0].transfer.resolve(&volume)], &scene, None)
                    .unwrap();
            assert_shows(&expected.image, &scene);
            let whole = render(&volume, &scene);
            assert!(rms(&whole, &expected.image) > 1e-3, "{compositing:?}: the surface cuts nothing");
            for rasterizer in RASTERIZERS {
                scene.splatting.rasterizer = rasterizer;
                let what = format!("{compositing:?} {projection:?} {rasterizer:?}");
                let mut drawn = gpu.view(volume.clone(), &scene).unwrap();
                let unit = volume.grid().unit();
                let planes = [if projection.is_some() { 1.0 } else { 0.01 }, 1000.0];
                let given = surfaces(gpu, &view, unit, DepthRange::Standard, planes, &depths, [case, 3]);
                drawn.set_surfaces(Some(given)).unwrap();
                drawn.set_first_hit(first_hit).unwrap();
                let image = gpu.draw(&mut drawn).unwrap().image;
                let measured = decibels(rms(&image, &expected.image));
                println!("{what}: {measured:.1} dB");
                assert_at_least(measured, 60.0, &what);
                let Some(texture) = drawn.first_hits() else { continue };
                let bytes = readback::texture(gpu.device(), gpu.queue(), texture).unwrap();
                let hits = bytemuck::pod_collect_to_vec::<_, f32>(&bytes).into_iter().map(f64::from);
                let hits: Vec<f64> = hits.map(|depth| depth / unit).collect();
                assert_eq!(hits.len(), expected.first_hits.len());
                assert!(hits.iter().filter(|hit| hit.is_finite()).count() > hits.len() / 200, "{what}: few hits");
                let is_close = |(hit, expected): &(&f64, &f64)| hit == expected || (**hit - **expected).abs() < 2e-3;
                let off = hits.len() - hits.iter().zip(&expected.first_hits).filter(is_close).count();
                assert!(off <= hits.len() / 400, "{what}: {off} of {} hits", hits.len());
            }
        }
    }
}

/// Voxels that are left out show nothing, even where values have an opacity that hardly differ from those around, as far away as kernels reach.
#[test]
fn what_is_left_out_shows_nothing() {
    let gpu = gpu();
    let bright =
        |voxel: UVec3| (voxel.x + 31 * voxel.y + 977 * voxel.z).wrapping_mul(2_654_435_761).is_multiple_of(1600);
    for spacing in [[1.0, 1.0, 1.0], [1.0, 1.4, 0.8]] {
        let volume =
            crate::after::volume([30, 26, 34], DVec3::from(spacing), |voxel| if bright(voxel) { 255.0 } else { 0.0 });
        for projection in [None, Some(eye(60.0))] {
            let mut scene = head([1.0; 3]).1;
            scene.camera = camera([0.43, 0.87, -0.31], 34.0);
            scene.camera.projection = projection.unwrap_or(scene.camera.projection);
            scene.channels[0].transfer.opacity = Some(Ramp::new(vec![(0.0, 0.0), (0.4, 0.3)]).unwrap());
            scene.channels[0].transfer.color = Some(Ramp::new(vec![(0.0, DVec3::X), (255.0, DVec3::Y)]).unwrap());
            scene.splatting.compositing = Compositing::Exponential;
            assert_twins(gpu, (&volume, &scene), 60.0, &format!("{spacing:?} {projection:?}"));
            let Counts { voxels_in_range, voxels_total, .. } =
                Drawing::By(Rasterizer::Tiles).render(gpu, &volume, &scene).stats.counts;
            assert!(voxels_in_range * 2 < voxels_total, "{voxels_in_range} of {voxels_total}");
        }
    }
}

/// The counts of un-culled frames are the twin's.
#[test]
fn counts_are_the_twins() {
    let gpu = gpu();
    for (turn, compositing) in COMPOSITINGS.into_iter().enumerate() {
        for projection in in_turns(turn, [None, Some(eye(200.0))]) {
            // One bright voxel and one dark voxel, one of which has an opacity.
            let volume =
                crate::after::volume([30, 26, 34], DVec3::new(1.0, 1.0, 1.5), |voxel| match voxel.to_array() {
                    [7, 9, 8] => 255.0,
                    [21, 18, 23] => 0.0,
                    _ => 100.0,
                });
            let mut scene = for_all(head([1.0; 3]).1, compositing);
            // Everything is in view.
            scene.camera = camera([0.4, 0.9, -0.3], 80.0);
            scene.camera.projection = projection.unwrap_or(scene.camera.projection);
            let opacity = match compositing {
                Compositing::Minimum => vec![(0.0, 0.9), (90.0, 0.0)],
                _ => vec![(120.0, 0.0), (250.0, 0.9)],
            };
            scene.channels[0].transfer.opacity = Some(Ramp::new(opacity).unwrap());
            // Tiles gather nothing at pixels whose rays are cut away.
            scene.clip.crop = None;
            scene.splatting.tiles = false;
            let expected = reference::count(&volume, &[scene.channels[0].transfer.resolve(&volume)], &scene).unwrap();
            let of = |counts: &Counts| {
                [
                    counts.voxels_total,
                    counts.voxels_in_range,
                    counts.sections_total,
                    counts.sections_rasterized,
                    counts.sheets,
                ]
            };
            for rasterizer in RASTERIZERS {
                let what = format!("{compositing:?} {projection:?} {rasterizer:?}");
                let ours = Drawing::By(rasterizer).render(gpu, &volume, &scene).stats.counts;
                println!("{what}: {:?}", of(&ours));
                assert_eq!(of(&ours), of(&expected), "{what}");
                assert!(ours.voxels_in_range > 0);
                let is_average = compositing == Compositing::Average;
                assert_eq!(ours.voxels_in_range == ours.voxels_total, is_average, "{what}: {:?}", of(&ours));
            }
        }
    }
}

/// What a frame will take is known before it is prepared.
#[test]
fn memory_is_estimated() {
    let gpu = gpu();
    for (interpolation, falloff) in [(Interpolation::Smooth, 2.0), (Interpolation::Exact, 1.0)] {
        let (volume, mut scene) = head([1.0, 1.0, 1.0]);
        (scene.splatting.interpolation, scene.splatting.falloff) = (interpolation, falloff);
        let mut view = gpu.view(volume, &scene).unwrap();
        let estimated = gpu.renderer().estimate(&view).unwrap();
        gpu.draw(&mut view).unwrap();
        assert_eq!(view.gpu_bytes(), estimated, "{interpolation:?}");
    }
}

/// An iso-range that is a single value has a surface where values pass it.
#[test]
fn surfaces_of_a_single_value_are_the_twins() {
    let gpu = gpu();
    let (volume, scene) = head([1.0, 1.0, 1.5]);
    let mut scene = for_all(scene, Compositing::Surface);
    scene.channels[0].transfer.opacity = Some(Ramp::new(vec![(0.0, 0.8)]).unwrap());
    for value in [60.0, 100.3] {
        scene.channels[0].transfer.iso_ranges = Some(vec![[value, value]]);
        assert_twins(gpu, (&volume, &scene), 60.0, &format!("{value}"));
    }
}
