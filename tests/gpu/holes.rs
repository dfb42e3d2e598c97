//! Holes, which are voxels whose samples are NaN or infinite (SPEC §3): gradients, lists, statistics, and whole images.
//! `cargo test --test gpu holes:: -- --nocapture` prints the measurements.

use std::collections::BTreeMap;

use glam::{DVec3, UVec3};
use sheetsplat::appearance::{Preset, categories, shown_range};
use sheetsplat::image::Image;
use sheetsplat::internals::reference;
use sheetsplat::scene::{Scene, TransferSettings};
use sheetsplat::settings::{Camera, Compositing, LabelTables, Method, Projection, Ramp, Rasterizer, TransferFunction};
use sheetsplat::volume::{Labels, Volume, builtin};

use crate::common::compare::assert_at_least;
use crate::common::devices::{DRAWINGS, Drawing, gpu};
use crate::common::images::{BLACK, psnr};
use crate::common::{COMPOSITINGS, RASTERIZERS, Random, camera, random_volume, scene, transfer};

/// The possible samples of a hole.
const HOLES: [f32; 3] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];

/// The same volume with holes in it.
fn punched(volume: &Volume, mut is_hole: impl FnMut(UVec3) -> bool) -> Volume {
    let grid = volume.grid();
    let sample = |(index, value)| if is_hole(grid.voxel_at(index)) { HOLES[index as usize % 3] } else { value };
    let values = (0..).zip(volume.values()).map(sample).collect();
    Volume::new("holes", grid.dims, grid.spacing, values).unwrap()
}

/// Balls in noise with holes: scattered, in a block, at all borders, and all around single voxels.
fn volumes(random: &mut Random, spacing: [f64; 3]) -> [(&'static str, Volume); 4] {
    let whole = random_volume(random, (14.0, 20.0), spacing);
    let dims = whole.dims();
    let scattered = punched(&whole, |_| random.uniform(0.0, 1.0) < 0.2);
    let block = punched(&whole, |at| at.cmpge(dims / 3).all() && at.cmplt(2 * dims / 3).all());
    let borders = punched(&whole, |at| at.cmpeq(UVec3::ZERO).any() || at.cmpeq(dims - 1).any());
    let alone = punched(&whole, |at| (at.x + at.y + at.z) % 2 == 0);
    [("scattered", scattered), ("a block", block), ("borders", borders), ("alone", alone)]
}

/// All voxels that take part are visible, shaded, and modulated by their gradients.
fn translucent(camera: Camera) -> Scene {
    let mut scene = Scene { camera, ..scene(61, 47) };
    scene.channels[0].transfer = TransferSettings {
        gradient_opacity: Some(Ramp::new(vec![(0.0, 0.3), (20.0, 0.6), (80.0, 1.0)]).unwrap()),
        ..transfer(&[(0.0, [0.1, 0.3, 0.9]), (200.0, [1.0, 0.8, 0.6])], &[(0.0, 0.02), (250.0, 0.5)])
    };
    scene.splatting.culling = false;
    scene
}

/// Cameras beside the volume, near it, and in it.
fn cameras() -> [Camera; 3] {
    let perspective = |distance, near| Camera {
        projection: Projection::Perspective { fov_y: 50.0, distance: Some(distance), near: Some(near) },
        ..camera([-0.5, 0.7, 0.4], 1.0)
    };
    [camera([0.3, 0.9, -0.2], 34.0), perspective(40.0, 1.0), perspective(6.0, 2.0)]
}

fn assert_finite(image: &Image, what: &str) {
    assert!(image.pixels.as_flattened().iter().all(|channel| channel.is_finite()), "{what}: a channel is not finite");
}

/// The PSNR in dB of a frame against the f64 evaluation, over the pixels that show anything.
fn decibels(actual: &Image, expected: &Image, what: &str) -> f64 {
    assert_finite(expected, what);
    assert_finite(actual, what);
    psnr(&actual.pixels, &expected.pixels, BLACK, 300)
}

#[test]
fn gradients_are_one_sided_beside_holes() {
    let mut values = vec![0.0; 27];
    let index = |at: [u32; 3]| (at[0] + 3 * at[1] + 9 * at[2]) as usize;
    for (at, value) in [([1, 1, 1], 7.0), ([0, 1, 1], 3.0), ([2, 1, 1], 13.0), ([1, 0, 1], 4.0), ([1, 1, 0], 5.0)] {
        values[index(at)] = value;
    }
    values[index([1, 2, 1])] = f32::NAN;
    let gradient = |holes: &[[u32; 3]]| {
        let mut values = values.clone();
        holes.iter().for_each(|&at| values[index(at)] = f32::INFINITY);
        let volume = Volume::new("cross", UVec3::splat(3), DVec3::new(1.0, 2.0, 4.0), values).unwrap();
        assert_eq!(volume.holes(), 1 + holes.len() as u64);
        volume.gradient(UVec3::ONE)
    };
    assert_eq!(gradient(&[]), DVec3::new(10.0 / 2.0, 3.0 / 2.0, -5.0 / 8.0));
    assert_eq!(gradient(&[[0, 1, 1]]), DVec3::new(6.0, 3.0 / 2.0, -5.0 / 8.0));
    assert_eq!(gradient(&[[2, 1, 1], [1, 1, 2]]), DVec3::new(4.0, 3.0 / 2.0, 2.0 / 4.0));
    assert_eq!(gradient(&[[1, 0, 1], [1, 1, 0]]), DVec3::new(10.0 / 2.0, 0.0, -7.0 / 4.0));
    assert_eq!(gradient(&[[0, 1, 1], [2, 1, 1], [1, 0, 1], [1, 1, 0], [1, 1, 2]]), DVec3::ZERO);
    assert_eq!(gradient(&[[1, 1, 1]]), DVec3::ZERO, "that of a hole");
}

/// The same number computed differently: among the finite values of a voxel and its neighbours on an axis, the last minus the first.
#[test]
fn gradients_of_any_volume_are_finite_neighbours_differences() {
    let mut random = Random(5);
    for (name, volume) in volumes(&mut random, [1.0, 1.5, 3.0]) {
        let dims = volume.dims().as_ivec3();
        for index in 0..volume.values().len() as u32 {
            let voxel = volume.grid().voxel_at(index);
            let is_hole = volume.value(voxel).is_nan();
            let along = |axis: usize| {
                let line = (-1..=1).filter_map(|step| {
                    let mut at = voxel.as_ivec3();
                    at[axis] += step;
                    let is_inside = at.cmpge(glam::IVec3::ZERO).all() && at.cmplt(dims).all();
                    let value = is_inside.then(|| volume.value(at.as_uvec3())).filter(|value| value.is_finite())?;
                    Some((f64::from(step), f64::from(value)))
                });
                let line: Vec<_> = line.collect();
                match (line.first(), line.last()) {
                    (Some(first), Some(last)) if last.0 > first.0 && !is_hole => {
                        (last.1 - first.1) / ((last.0 - first.0) * volume.spacing()[axis])
                    }
                    _ => 0.0,
                }
            };
            assert_eq!(volume.gradient(voxel).to_array(), [0, 1, 2].map(along), "{name}: {voxel}");
        }
    }
}

#[test]
fn volumes_with_holes_compare() {
    let volume = |sample: f32, other: f32| Volume::new("a", UVec3::new(3, 1, 1), DVec3::ONE, vec![1.0, sample, other]);
    let with_hole = volume(f32::NAN, 2.0).unwrap();
    assert_eq!(with_hole, volume(f32::INFINITY, 2.0).unwrap());
    assert_eq!(with_hole.clone(), with_hole);
    assert_ne!(with_hole, volume(0.0, 2.0).unwrap());
    assert_ne!(with_hole, volume(f32::NAN, 3.0).unwrap());
    let message = Volume::new("a", UVec3::ONE, DVec3::ONE, vec![f32::NAN]).unwrap_err().to_string();
    assert_eq!(message, "a: data: found only NaN or infinite samples, allowed: at least one finite sample");
}

/// Compositing by amounts, with both projections and all methods.
#[test]
fn frames_equal_the_reference() {
    let gpu = gpu();
    let mut random = Random(17);
    let mut worst = [f64::INFINITY; 4];
    for (name, volume) in volumes(&mut random, [1.0, 1.0, 1.5]) {
        for (at, camera) in cameras().into_iter().enumerate() {
            for (compositing, method) in [
                (Compositing::Linear, Method::ImageAligned),
                (Compositing::Exponential, Method::ImageAligned),
                (Compositing::Exponential, Method::AxisAligned),
                (Compositing::Linear, Method::CompositeEverySample),
            ] {
                let mut scene = translucent(camera);
                (scene.splatting.compositing, scene.splatting.method) = (compositing, method);
                let expected =
                    reference::render(&volume, &[scene.channels[0].transfer.resolve(&volume)], &scene).unwrap();
                let by_gpu = match method {
                    Method::CompositeEverySample => vec![(2, Drawing::By(Rasterizer::Auto), 90.0)],
                    _ => {
                        let [quads, tiles] = RASTERIZERS.map(Drawing::By);
                        vec![(0, quads, 90.0), (1, tiles, 109.0)]
                    }
                };
                for (variant, drawing, required) in by_gpu.into_iter().chain([(3, Drawing::Native, 110.0)]) {
                    let what = format!("{name}, camera {at}, {compositing:?}, {method:?}, {drawing:?}");
                    let decibels = decibels(&drawing.render(gpu, &volume, &scene).image, &expected, &what);
                    worst[variant] = worst[variant].min(decibels);
                    assert_at_least(decibels, required, &what);
                }
            }
        }
    }
    println!("quads, tiles, samples, native: {worst:.1?} dB at worst");
}

/// Where nothing depends on gradients, a hole equals a hidden voxel: the bytes are the same for all compositings, with culling too.
#[test]
fn a_hole_is_a_hidden_voxel() {
    let gpu = gpu();
    let (mut random, mut shown) = (Random(23), 0);
    for (name, volume) in volumes(&mut random, [1.0, 1.0, 1.0]).into_iter().take(2) {
        let labels = Labels {
            origin: "labels".to_owned(),
            dims: volume.dims(),
            spacing: None,
            values: volume.values().iter().map(|value| u16::from(value.is_nan())).collect(),
            names: BTreeMap::new(),
        };
        let filled = volume.values().iter().map(|value| if value.is_nan() { 200.0 } else { value }).collect();
        let filled = Volume::new("filled", volume.dims(), volume.spacing(), filled).unwrap();
        let filled = filled.with_labels(labels).unwrap();
        for (compositing, camera) in COMPOSITINGS.into_iter().zip(cameras().into_iter().cycle()) {
            let mut scene = translucent(camera);
            (scene.splatting.culling, scene.splatting.compositing) = (true, compositing);
            // The voxels are opaque enough for surfaces.
            scene.channels[0].transfer =
                transfer(&[(0.0, [0.1, 0.3, 0.9]), (200.0, [1.0, 0.8, 0.6])], &[(0.0, 0.02), (250.0, 0.9)]);
            scene.shading.enabled = false;
            let mut hidden = scene.clone();
            hidden.channels[0].transfer.labels.insert(1, LabelTables { visible: false, ..LabelTables::default() });
            let what = format!("{name}, {compositing:?}");
            let twin = |volume: &Volume, scene: &Scene| {
                reference::render(volume, &[scene.channels[0].transfer.resolve(volume)], scene).unwrap()
            };
            assert_finite(&twin(&volume, &scene), &what);
            assert!(twin(&volume, &scene) == twin(&filled, &hidden), "{what}: the twin");
            for drawing in DRAWINGS {
                let (drawn, expected) = (drawing.render(gpu, &volume, &scene), drawing.render(gpu, &filled, &hidden));
                assert_finite(&drawn.image, &what);
                assert!(drawn.image == expected.image, "{what}, {drawing:?}");
                assert_eq!(drawn.stats.counts, expected.stats.counts, "{what}, {drawing:?}");
                shown += usize::from(drawn.image.pixels.iter().any(|pixel| *pixel != BLACK));
            }
        }
    }
    assert_eq!(shown, 2 * DRAWINGS.len() * COMPOSITINGS.len());
}

/// A changed view equals a fresh one: no hole enters, whatever values take part.
#[test]
fn lists_leave_holes_out() {
    let gpu = gpu();
    let [(_, volume), ..] = volumes(&mut Random(29), [1.0, 1.0, 2.0]);
    let scene = translucent(cameras()[0]);
    let mut view = gpu.view(volume.clone(), &scene).unwrap();
    let finite = volume.values().len() as u64 - volume.holes();
    let above = |value: f32| volume.values().iter().filter(|&found| found >= value).count() as u64;
    for (iso_ranges, expected) in [
        (Some(vec![[-1e300, -1.0]]), 0),
        (None, finite),
        (Some(vec![[150.0, 1e300]]), above(150.0)),
        (Some(vec![[-1e300, 1e300]]), finite),
    ] {
        view.set_iso_ranges(iso_ranges.clone()).unwrap();
        let drawn = gpu.draw(&mut view).unwrap();
        assert_eq!(drawn.stats.counts.voxels_in_range, expected, "{iso_ranges:?}");
        let fresh = scene.clone().with_transfer(TransferSettings { iso_ranges, ..scene.channels[0].transfer.clone() });
        assert!(drawn.image == gpu.render_volume(volume.clone(), &fresh).unwrap().image);
    }
    let list = view.volume().value_list();
    let least = volume.values().iter().fold(f32::INFINITY, f32::min);
    let background = volume.values().iter().filter(|&value| value == least).count() as u64;
    assert_eq!(list.bytes(), 4 * (finite - background));
}

/// The appearance chosen for a volume is that for its finite samples: layers of holes before and behind it change nothing.
#[test]
fn appearance_is_that_of_the_finite_samples() {
    let padded = |volume: &Volume| {
        let dims = volume.dims();
        let layers = vec![f32::NAN; 3 * (dims.x * dims.y) as usize];
        let values = [layers.clone(), volume.values().to_vec(), layers].concat();
        Volume::new("padded", dims + UVec3::Z * 6, volume.spacing(), values).unwrap()
    };
    let bare = |volume: Volume| Volume::new("bare", volume.dims(), volume.spacing(), volume.values().to_vec()).unwrap();
    let head = bare(builtin::volume("head:40").unwrap());
    let hounsfield = head.values().iter().map(|value| value * 10.0 - 1000.0).collect();
    let blocks = (0..20 * 20 * 20).map(|at: u32| (at % 20 / 5 + 4 * (at / 20 % 20 / 10)) as f32).collect();
    let volumes = [
        ("head", head.clone()),
        ("Hounsfield units", Volume::new("ct", head.dims(), head.spacing(), hounsfield).unwrap()),
        ("nerve", bare(builtin::volume("nerve:64").unwrap())),
        ("labels", Volume::new("labels", UVec3::splat(20), DVec3::ONE, blocks).unwrap()),
        ("fractions", bare(builtin::volume("marschner-lobb:24").unwrap())),
    ];
    for (name, volume) in volumes {
        let padded = padded(&volume);
        assert!(padded.holes() > 0);
        let chosen = TransferFunction::from_histogram(&volume);
        assert_eq!(TransferFunction::from_histogram(&padded), chosen, "{name}");
        assert_eq!(shown_range(&padded, &chosen), shown_range(&volume, &chosen), "{name}");
        assert_eq!(categories::is_label_map(&padded), categories::is_label_map(&volume), "{name}");
        assert_eq!(categories::is_label_map(&padded), name == "labels", "{name}");
        assert_eq!(categories::values(&padded), categories::values(&volume), "{name}");
        for (preset_name, preset) in Preset::ALL {
            assert_eq!(preset.suits(&padded), preset.suits(&volume), "{name}, {preset_name}");
            assert_eq!(preset.transfer(&padded), preset.transfer(&volume), "{name}, {preset_name}");
        }
    }
}

/// Regions with scattered holes are still a label map.
#[test]
fn holes_are_no_labels_and_no_borders() {
    let values = (0..24 * 24 * 24).map(|at: u32| {
        let is_hole = at.wrapping_mul(2_654_435_761) >> 30 == 0;
        if is_hole { f32::NAN } else { (at % 24 / 6 + 4 * (at / 24 % 24 / 8)) as f32 }
    });
    let volume = Volume::new("labels", UVec3::splat(24), DVec3::ONE, values.collect()).unwrap();
    assert!(volume.holes() > 3000);
    assert_eq!(categories::values(&volume), Some((0..12).collect()));
    assert!(categories::is_label_map(&volume));
}
