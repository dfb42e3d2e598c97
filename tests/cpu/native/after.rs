//! Classification after splatting (SPEC §9): whole frames against the f64 twin, culling, counts.

use std::collections::BTreeMap;

use glam::DVec3;
use sheetsplat::cpu;
use sheetsplat::internals::reference::{self, Host};
use sheetsplat::scene::{Scene, VolumeSource};
use sheetsplat::settings::{
    Classification, Compositing, Gradient, Interpolation, LabelTables, Light, Method, Order, Projection, Ramp,
    SlabProfile,
};
use sheetsplat::volume::{Labels, Volume};

use crate::common::images::bits;
use crate::common::shared::shared;
use crate::common::{BY_AMOUNTS, BY_MEANS, Random, SPACINGS, camera};
use crate::native::{culled_cases, draw, head, psnr, random_case, shown, twin};

/// PSNR that SPEC §12 asks for, dB, by gradient.
fn required(scene: &Scene) -> f64 {
    if scene.shading.gradient == Gradient::Kernel { 55.0 } else { 60.0 }
}

fn after() -> (Volume, Scene) {
    let (volume, mut scene) = head();
    scene.splatting.classification = Classification::After;
    (volume, scene)
}

/// Any view of any settings that are drawn after splatting.
pub(crate) fn random_after(random: &mut Random) -> (Volume, Scene) {
    let (volume, mut scene) = random_case(random);
    let splatting = &mut scene.splatting;
    splatting.classification = Classification::After;
    splatting.method = Method::ImageAligned;
    splatting.falloff = random.pick(&[2.0, 2.0, 1.0, 0.3, 8.0]);
    splatting.slab_width = random.pick(&[0.15, 0.3, 0.5, 1.0, 1.0, 2.0]);
    if splatting.radius == 2.0 && splatting.falloff > 0.99 && random.bits().is_multiple_of(2) {
        splatting.interpolation = Interpolation::Exact;
    }
    if random.bits().is_multiple_of(3) {
        scene.shading.gradient = Gradient::Kernel;
    }
    (volume, scene)
}

#[test]
fn settings_one_by_one_against_the_twin() {
    let (volume, plain) = after();
    let mut worst = [f64::INFINITY; 2];
    let mut check = |what: &str, volume: &Volume, change: &dyn Fn(&mut Scene)| {
        for compositing in BY_AMOUNTS {
            let mut scene = plain.clone();
            scene.splatting.compositing = compositing;
            change(&mut scene);
            let expected = twin(volume, &scene);
            assert!(shown(&expected) > 0.05, "{what} shows nothing");
            let psnr = psnr(&draw(volume, &scene).image, &expected);
            println!("{what}, {compositing:?}: {psnr:.1} dB");
            assert!(psnr > required(&scene), "{what}, {compositing:?}: {psnr} dB");
            let worst = &mut worst[usize::from(scene.shading.gradient == Gradient::Kernel)];
            *worst = worst.min(psnr);
        }
    };
    let perspective = Projection::Perspective { fov_y: 40.0, distance: None, near: None };
    check("defaults", &volume, &|_| {});
    check("unshaded", &volume, &|scene| scene.shading.enabled = false);
    check("perspective", &volume, &|scene| scene.camera.projection = perspective);
    check("an eye inside", &volume, &|scene| {
        scene.camera.projection = Projection::Perspective { fov_y: 90.0, distance: Some(4.0), near: Some(3.0) };
    });
    check("the kernel's gradient", &volume, &|scene| scene.shading.gradient = Gradient::Kernel);
    check("the kernel's gradient in perspective", &volume, &|scene| {
        scene.shading.gradient = Gradient::Kernel;
        scene.camera.projection = perspective;
    });
    check("exact", &volume, &|scene| scene.splatting.interpolation = Interpolation::Exact);
    for spacing in SPACINGS {
        let volume = volume.clone().with_spacing("head", DVec3::from(spacing)).unwrap();
        for gradient in [Gradient::Differences, Gradient::Kernel] {
            check(&format!("spacing {spacing:?}"), &volume, &|scene| scene.shading.gradient = gradient);
            check(&format!("spacing {spacing:?} in perspective"), &volume, &|scene| {
                scene.camera.projection = perspective;
                scene.shading.gradient = gradient;
            });
        }
    }
    for slab_width in [0.15, 0.5, 2.0] {
        check(&format!("slab width {slab_width}"), &volume, &|scene| scene.splatting.slab_width = slab_width);
    }
    for (radius, falloff) in [(1.4, 0.5), (3.0, 1.0), (4.0, 0.3)] {
        check(&format!("radius {radius}, falloff {falloff}"), &volume, &|scene| {
            (scene.splatting.radius, scene.splatting.falloff) = (radius, falloff);
        });
    }
    for height in [4.0, 45.0] {
        check(&format!("height {height}"), &volume, &|scene| {
            (scene.image.width, scene.image.height) = if height > 10.0 { (20, 12) } else { (96, 80) };
            scene.camera = camera([0.3, 0.8, -0.5], height);
        });
    }
    for order in [Order::FrontToBack, Order::BackToFront] {
        check(&format!("cut, {order:?}"), &volume, &|scene| {
            let half = volume.grid().center() * volume.spacing();
            scene.clip.planes = vec![[0.3, 1.0, -0.2, 0.3 * half.y], [-1.0, 0.2, 0.1, 0.6 * half.x]];
            scene.clip.crop = Some([-0.8 * half, 0.71 * half]);
            scene.splatting.order = order;
        });
    }
    check("fixed light", &volume, &|scene| scene.shading.light = Light::Direction(DVec3::new(1.0, -1.0, 0.5)));
    check("gradient opacity", &volume, &|scene| {
        scene.channels[0].transfer.gradient_opacity = Some(Ramp::new(vec![(0.0, 0.0), (20.0, 1.0)]).unwrap());
    });
    check("iso-ranges", &volume, &|scene| {
        scene.channels[0].transfer.iso_ranges = Some(vec![[50.0, 90.0], [210.0, 300.0]]);
    });
    println!("worst: {worst:.1?} dB");
}

/// A head close by. For `minimum`, whose values are those of the air around it else, the inside of it alone, and small values have an opacity.
fn close_by(compositing: Compositing) -> (Volume, Scene) {
    let (volume, mut scene) = after();
    let half = volume.grid().center() * volume.spacing();
    scene.camera.projection = Projection::Orthographic { height: Some(1.8 * half.z) };
    scene.splatting.compositing = compositing;
    if compositing == Compositing::Minimum {
        scene.clip.crop = Some([-0.45 * half, 0.4 * half]);
        scene.channels[0].transfer.opacity = Some(Ramp::new(vec![(0.0, 0.9), (60.0, 0.8), (200.0, 0.1)]).unwrap());
    }
    (volume, scene)
}

#[test]
fn values_chosen_and_surfaces_against_the_twin() {
    let mut worst = f64::INFINITY;
    let mut check = |what: &str, change: &dyn Fn(&mut Volume, &mut Scene)| {
        for compositing in BY_MEANS {
            let (mut volume, mut scene) = close_by(compositing);
            change(&mut volume, &mut scene);
            let expected = twin(&volume, &scene);
            let shown = shown(&expected);
            let psnr = psnr(&draw(&volume, &scene).image, &expected);
            println!("{what}, {compositing:?}: {psnr:.1} dB, {shown:.2} of the image");
            assert!(shown > 0.015, "{what}, {compositing:?} shows nothing");
            assert!(psnr > required(&scene), "{what}, {compositing:?}: {psnr} dB");
            worst = worst.min(psnr);
        }
    };
    check("defaults", &|_, _| {});
    check("perspective", &|volume, scene| {
        let distance = Some(2.5 * volume.grid().center().z * volume.spacing().z);
        scene.camera.projection = Projection::Perspective { fov_y: 40.0, distance, near: None };
    });
    check("the kernel's gradient", &|_, scene| scene.shading.gradient = Gradient::Kernel);
    check("exact", &|_, scene| scene.splatting.interpolation = Interpolation::Exact);
    check("thick slabs", &|_, scene| scene.splatting.slab_width = 8.0);
    check("thin slabs", &|_, scene| scene.splatting.slab_width = 0.3);
    check("cut", &|volume, scene| {
        let half = volume.grid().center() * volume.spacing();
        scene.clip.planes = vec![[0.3, 1.0, -0.2, 0.2 * half.y], [-1.0, 0.2, 0.1, 0.3 * half.x]];
    });
    check("unshaded", &|_, scene| scene.shading.enabled = false);
    check("a thin piece", &|_, scene| {
        scene.clip.planes = vec![[0.4, 0.9, -0.3, 3.3], [-0.4, -0.9, 0.3, 3.3]];
        scene.splatting.slab_width = 2.0;
    });
    check("gradient opacity", &|_, scene| {
        scene.channels[0].transfer.gradient_opacity = Some(Ramp::new(vec![(0.0, 0.56), (2.0, 1.0)]).unwrap());
    });
    check("iso-ranges", &|_, scene| {
        scene.channels[0].transfer.iso_ranges = Some(vec![[20.0, 30.0], [45.0, 215.0], [230.0, 300.0]]);
    });
    check("labels", &|volume, scene| {
        *volume = segmented(volume);
        scene.channels[0].transfer.labels = labels();
        // Otherwise middles of rays from side to side lie between cells.
        let half = volume.grid().center() * volume.spacing();
        scene.clip.crop = Some([DVec3::new(-0.47, -0.41, -0.52) * half, DVec3::new(0.53, 0.46, 0.44) * half]);
    });
    println!("worst: {worst:.1} dB");
}

/// Values whose bounds show that they are not chosen are left out with `culling`, which changes no bit.
#[test]
fn bounds_change_no_byte_of_a_choice() {
    let mut random = Random(48);
    let mut left_out = 0;
    for case in 0..60 {
        let (mut volume, mut scene) = random_after(&mut random);
        scene.splatting.compositing = [Compositing::Maximum, Compositing::Minimum][case % 2];
        if case % 3 == 0 {
            // Plateaus, and values that differ by about a hair.
            let flat = |value: f32| (value / 64.0).floor() * 64.0 + 1e-3 * (value / 8.0).floor();
            let values = volume.values().iter().map(flat).collect();
            volume = Volume::new("plateaus", volume.dims(), volume.spacing(), values).unwrap();
        }
        let [all, bounded] = [false, true].map(|culling| {
            scene.splatting.culling = culling;
            draw(&volume, &scene)
        });
        assert_eq!(bits(&bounded.image), bits(&all.image), "case {case}: {scene:?}");
        left_out += all.stats.counts.bricks_visited - bounded.stats.counts.bricks_visited;
    }
    assert!(left_out > 40, "only {left_out} bricks are left out");
}

/// Neighbouring slabs of equal values: the nearest is chosen, however rounding tells them apart, and its gradient gives the normal.
#[test]
fn of_equal_extremes_the_nearest_is_chosen() {
    let values = (0..24 * 24 * 24_u32).map(|index| {
        let [x, y, z] = [index % 24, index / 24 % 24, index / 576];
        // A plateau that other matter touches behind, and noise around it.
        if (6..18).contains(&y) && (4..20).contains(&x) && (4..20).contains(&z) {
            200.1
        } else {
            (index * 7919 % 97) as f32
        }
    });
    let volume = Volume::new("plateau", glam::UVec3::splat(24), DVec3::ONE, values.collect()).unwrap();
    for direction in [[0.0, 1.0, 0.0], [0.2, 0.9, -0.1]] {
        for interpolation in [Interpolation::Smooth, Interpolation::Exact] {
            let (_, mut scene) = after();
            scene.camera = camera(direction, 20.0);
            scene.splatting.compositing = Compositing::Maximum;
            scene.splatting.interpolation = interpolation;
            let psnr = psnr(&draw(&volume, &scene).image, &twin(&volume, &scene));
            println!("{direction:?}, {interpolation:?}: {psnr:.1} dB");
            assert!(psnr > required(&scene), "{direction:?}, {interpolation:?}: {psnr} dB");
        }
    }
}

/// The preset `mip` shows the voxels' own greatest values, at a pixel per voxel along an axis.
#[test]
#[ignore = "needs the shared data: SHEETSPLAT_SHARED=FOLDER"]
fn shared_maximum_of_a_neuron_is_that_of_its_voxels() {
    let volume = Volume::open(&shared("data/neuron.nrrd")).unwrap();
    let [nx, ny, _] = volume.dims().to_array().map(|n| n as usize);
    let sets = [
        "preset=mip".to_owned(),
        format!("image={{width={nx},height={ny}}}"),
        format!("camera={{direction=[0,0,1],up=[0,-1,0],fit=\"volume\",height={ny}}}"),
    ];
    let scene = Scene::from_volume(VolumeSource::Memory, &sets).unwrap();
    let mut greatest = vec![0.0_f32; nx * ny];
    for (at, value) in volume.values().iter().enumerate() {
        let greatest = &mut greatest[at % (nx * ny)];
        *greatest = greatest.max(value);
    }
    let image = draw(&volume, &scene).image;
    let bright = (0..nx * ny).filter(|&at| greatest[at] >= 100.0);
    let (mut ours, mut theirs, mut count) = (0.0, 0.0, 0);
    for at in bright {
        // Opacities rise from 0 to the greatest value's, 255.
        ours += 255.0 * f64::from(image.pixels[at][0]);
        theirs += f64::from(greatest[at]);
        count += 1;
    }
    println!("{:.2} where the voxels' is {:.2}, {count} pixels", ours / f64::from(count), theirs / f64::from(count));
    assert!(count > 3000 && (ours / theirs - 1.0).abs() < 0.001, "{ours} {theirs} of {count} pixels");
}

/// Depths of first hits, by all compositings that have them.
#[test]
fn first_hits_are_the_twins() {
    for (compositing, opacity) in [
        (Compositing::Linear, 0.4),
        (Compositing::Exponential, 0.7),
        (Compositing::Maximum, 0.3),
        (Compositing::Surface, 1.0),
    ] {
        let (volume, plain) = close_by(compositing);
        let distance = Some(2.5 * volume.grid().center().z * volume.spacing().z);
        let perspective = Projection::Perspective { fov_y: 40.0, distance, near: None };
        for projection in [plain.camera.projection, perspective] {
            let mut scene = plain.clone();
            scene.camera.projection = projection;
            let host = Host { first_hit: Some(opacity), ..Host::default() };
            let transfer = [scene.channels[0].transfer.resolve(&volume)];
            let expected = reference::render_for(host, &volume, &transfer, &scene, None).unwrap().first_hits;
            let mut renderer = cpu::CpuRenderer::new(volume.clone(), &scene).unwrap();
            renderer.set_first_hit(Some(opacity)).unwrap();
            renderer.draw().unwrap();
            let unit = volume.grid().unit();
            let (mut hits, mut wrong) = (0, 0);
            for (actual, expected) in renderer.first_hits().unwrap().iter().zip(&expected) {
                hits += u32::from(expected.is_finite());
                // NaN is close to nothing.
                let is_close = (f64::from(*actual) - expected * unit).abs() < 1e-2;
                let agrees = if expected.is_finite() { is_close } else { actual.is_infinite() };
                wrong += u32::from(!agrees);
            }
            println!("{compositing:?}: {wrong} of {hits}");
            // Where opacity grows slowly around the one asked for, rounding moves the depth.
            assert!(hits > 300 && wrong * 1000 < hits, "{compositing:?}: {wrong} of {hits}");
        }
    }
}

fn segmented(volume: &Volume) -> Volume {
    let of_voxel = |index: u32| (volume.grid().voxel_at(index).element_sum() % 5 / 2) as u16;
    let labels = Labels {
        origin: "labels".to_owned(),
        dims: volume.dims(),
        spacing: None,
        values: (0..volume.values().len() as u32).map(of_voxel).collect(),
        names: BTreeMap::new(),
    };
    volume.clone().with_labels(labels).unwrap()
}

/// One label has tables of its own, another one is hidden.
fn labels() -> BTreeMap<u64, LabelTables> {
    let own = LabelTables {
        opacity: Some(Ramp::new(vec![(0.0, 0.0), (20.0, 0.4), (150.0, 0.8)]).unwrap()),
        color: Some(Ramp::new(vec![(0.0, DVec3::new(0.1, 0.9, 0.3))]).unwrap()),
        gradient_opacity: Some(Ramp::new(vec![(0.0, 0.5), (20.0, 1.0)]).unwrap()),
        ..LabelTables::default()
    };
    BTreeMap::from([(1, own), (2, LabelTables { visible: false, ..LabelTables::default() })])
}

#[test]
fn holes_and_labels_against_the_twin() {
    let (volume, mut scene) = after();
    let mut values = volume.values().to_vec();
    values.iter_mut().step_by(11).for_each(|value| *value = f32::NAN);
    let holey = Volume::new("holey", volume.dims(), volume.spacing(), values).unwrap();
    for interpolation in [Interpolation::Smooth, Interpolation::Exact] {
        scene.splatting.interpolation = interpolation;
        assert!(psnr(&draw(&holey, &scene).image, &twin(&holey, &scene)) > 60.0, "{interpolation:?}");
    }
    let segmented = segmented(&volume);
    scene.channels[0].transfer.labels = labels();
    let expected = twin(&segmented, &scene);
    assert!(psnr(&expected, &twin(&volume, &scene)) < 40.0, "labels show");
    assert!(psnr(&draw(&segmented, &scene).image, &expected) > 60.0);
}

#[test]
fn culling_keeps_its_guarantee() {
    // The halves of cubic slabs are opaque a little later.
    for (slab_profile, least) in [(SlabProfile::Linear, 10), (SlabProfile::Cubic, 8)] {
        let mut random = Random(2001);
        let culled = culled_cases(40, || {
            let (volume, mut scene) = random_after(&mut random);
            scene.splatting.slab_profile = slab_profile;
            (volume, scene)
        });
        assert!(culled > least, "{slab_profile:?}: only {culled} cases cull anything");
    }
}

#[test]
fn counts_are_the_twins() {
    let mut random = Random(8);
    for case in 0..20 {
        let (volume, mut scene) = random_after(&mut random);
        scene.splatting.culling = false;
        let counts = draw(&volume, &scene).stats.counts;
        let expected = reference::count(&volume, &[scene.channels[0].transfer.resolve(&volume)], &scene).unwrap();
        assert_eq!(counts.voxels_total, expected.voxels_total, "case {case}");
        assert_eq!(counts.voxels_in_range, expected.voxels_in_range, "case {case}");
        assert_eq!(counts.sections_total, expected.sections_total, "case {case}");
        assert_eq!(counts.sheets, expected.sheets, "case {case}");
        assert_eq!(counts.tiles_total, expected.tiles_total, "case {case}");
        assert!(counts.tiles_composited <= counts.tiles_total, "case {case}");
        assert_eq!(counts.voxels_shaded, 0, "case {case}");
    }
    let (volume, scene) = after();
    let counts = draw(&volume, &scene).stats.counts;
    assert_eq!(counts.sections_rasterized, counts.sections_total, "all is on the screen");
}

/// Where all values around are equal, no pixel takes the rounding of their sums for a gradient.
#[test]
fn constant_regions_have_no_normal() {
    let (_, mut scene) = after();
    scene.shading.gradient = Gradient::Kernel;
    let dims = glam::UVec3::splat(16);
    let value = |index: u32| match index {
        0 => 0.0,
        4095 => 255.0,
        _ => 201.3,
    };
    let volume = Volume::new("block", dims, DVec3::ONE, (0..4096).map(value).collect()).unwrap();
    for falloff in [1.0, 2.0] {
        scene.splatting.falloff = falloff;
        let expected = twin(&volume, &scene);
        assert!(shown(&expected) > 0.2, "falloff {falloff}");
        let psnr = psnr(&draw(&volume, &scene).image, &expected);
        println!("falloff {falloff}: {psnr:.1} dB");
        assert!(psnr > 60.0, "falloff {falloff}: {psnr} dB");
    }
}

/// An iso-range that is a single value has a surface where values pass it.
#[test]
fn surfaces_of_a_single_value_against_the_twin() {
    let (volume, mut scene) = close_by(Compositing::Surface);
    scene.channels[0].transfer.opacity = Some(Ramp::new(vec![(0.0, 0.8)]).unwrap());
    for value in [60.0, 100.3] {
        scene.channels[0].transfer.iso_ranges = Some(vec![[value, value]]);
        let expected = twin(&volume, &scene);
        assert!(shown(&expected) > 0.1, "{value} shows nothing");
        let psnr = psnr(&draw(&volume, &scene).image, &expected);
        assert!(psnr > required(&scene), "{value}: {psnr} dB");
    }
}

/// Among values that are equal over whole regions, rounding must not choose another point, whose light is another.
#[test]
fn extremes_of_plateaus_are_the_twins() {
    let mut random = Random(4711);
    let mut worst = f64::INFINITY;
    for case in 0..40 {
        let (mut volume, mut scene) = random_after(&mut random);
        scene.splatting.compositing = [Compositing::Maximum, Compositing::Minimum][case % 2];
        let values = volume.values().iter().map(|value| (value / 64.0).floor() * 64.0).collect();
        volume = Volume::new("plateaus", volume.dims(), volume.spacing(), values).unwrap();
        worst = worst.min(psnr(&draw(&volume, &scene).image, &twin(&volume, &scene)));
    }
    assert!(worst > 80.0, "{worst} dB");
}
