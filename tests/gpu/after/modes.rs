//! `maximum`, `minimum`, `average` and `surface`, gradient opacity, iso-ranges and label tables.

use glam::{DVec3, UVec3};
use sheetsplat::internals::reference::{self, Host};
use sheetsplat::scene::Scene;
use sheetsplat::settings::{Compositing, LabelTables, Ramp};
use sheetsplat::volume::{Labels, Volume, builtin};

use crate::after::{render, scene, volume};
use crate::common::{camera, transfer};

/// Opacity rises with the value, so it shows which value was chosen.
#[test]
fn maximum_average_and_minimum_are_in_order() {
    let volume = builtin::volume("head:24").unwrap();
    let mut scene = scene(40, 36);
    scene.camera.direction = DVec3::new(0.4, 0.9, -0.3);
    scene.shading.enabled = false;
    scene.channels[0].transfer = transfer(&[(0.0, [1.0; 3])], &[(0.0, 0.0), (255.0, 1.0)]);
    let [maximum, average, minimum] =
        [Compositing::Maximum, Compositing::Average, Compositing::Minimum].map(|compositing| {
            scene.splatting.compositing = compositing;
            render(&volume, &scene)
        });
    let mut parted = 0;
    for ((max, mean), min) in maximum.pixels.iter().zip(&average.pixels).zip(&minimum.pixels) {
        assert!(max[3] >= mean[3] && mean[3] >= min[3], "{max:?} {mean:?} {min:?}");
        parted += usize::from(max[3] > mean[3] + 0.1 && mean[3] > min[3] + 0.05);
    }
    assert!(parted > 80, "{parted}");
}

/// A ramp along the ray gives the values at the ends and in the middle of the cells' box, as far as planes reach.
#[test]
fn extremes_of_a_ramp() {
    let volume = volume([10, 20, 10], DVec3::ONE, |voxel| voxel.y.into());
    let mut scene = scene(3, 3);
    scene.camera = camera([0.0, 1.0, 0.0], 3.0);
    scene.shading.enabled = false;
    scene.channels[0].transfer = transfer(&[(0.0, [1.0; 3])], &[(0.0, 0.0), (20.0, 1.0)]);
    // Planes are at the voxels' middles, from -10 to 10 in the box, and at its ends kernels see only the last voxel.
    for (compositing, expected, tolerance) in
        [(Compositing::Maximum, 19.0, 0.3), (Compositing::Minimum, 0.0, 0.3), (Compositing::Average, 9.5, 1e-6)]
    {
        scene.splatting.compositing = compositing;
        for pixel in render(&volume, &scene).pixels {
            let value = f64::from(pixel[3]) * 20.0;
            assert!((value - expected).abs() < tolerance, "{compositing:?}: {value}");
        }
    }
    // The nearest of equal values counts; and if a cut leaves no plane, the line of values between two planes.
    scene.splatting.compositing = Compositing::Maximum;
    scene.clip.crop = Some([DVec3::new(-9.0, 0.3, -9.0), DVec3::new(9.0, 0.7, 9.0)]);
    for pixel in render(&volume, &scene).pixels {
        assert!((f64::from(pixel[3]) * 20.0 - 10.0).abs() < 1e-6, "{pixel:?}");
    }
    let constant = crate::after::volume([10, 20, 10], DVec3::ONE, |_| 10.0);
    scene.clip.crop = None;
    let host = Host { surfaces: None, first_hit: Some(0.5) };
    let transfer = scene.channels[0].transfer.resolve(&constant);
    let hits =
        reference::render_for(host, &constant, std::slice::from_ref(&transfer), &scene, None).unwrap().first_hits;
    assert!(hits.iter().all(|depth| (depth + 10.0).abs() < 1e-9), "{hits:?}");
}

/// A ramp along y that starts with 0 at one face.
fn ramp() -> (Volume, Scene) {
    let volume = volume([10, 20, 10], DVec3::ONE, |voxel| voxel.y.into());
    let mut scene = scene(3, 3);
    scene.camera = camera([0.2, 1.0, -0.3], 3.0);
    scene.shading.enabled = false;
    scene.splatting.compositing = Compositing::Surface;
    scene.channels[0].transfer = transfer(&[(0.0, [0.0; 3]), (20.0, [1.0, 0.5, 0.25])], &[(0.0, 0.0), (20.0, 1.0)]);
    (volume, scene)
}

#[test]
fn surfaces_stand_where_half_is_reached() {
    let (volume, mut scene) = ramp();
    let half = |scene: &Scene| {
        let host = Host { surfaces: None, first_hit: Some(0.1) };
        let transfer = scene.channels[0].transfer.resolve(&volume);
        let rendered = reference::render_for(host, &volume, std::slice::from_ref(&transfer), scene, None).unwrap();
        // The alpha in the middle of the image, and the depth as y from the middle.
        (rendered.image.pixels[4], rendered.first_hits[4] * scene.camera.basis().w.y)
    };
    for width in [0.3, 1.0, 1.6] {
        scene.splatting.slab_width = width;
        let (pixel, y) = half(&scene);
        assert!((y - 0.5).abs() < 0.01, "{width}: {y}");
        let is_there = [0.5, 0.25, 0.125, 1.0].iter().zip(pixel).all(|(a, b)| (a - b).abs() < 1e-4);
        assert!(is_there, "{width}: {pixel:?}");
    }
    // The surface moves: to the first value in an iso-range; by gradient opacity; to the face of a cut; or it disappears.
    scene.channels[0].transfer.iso_ranges = Some(vec![[12.5, 13.0]]);
    assert!((half(&scene).1 - 3.0).abs() < 0.02, "{:?}", half(&scene));
    // Also to a single value.
    for value in [12.5, 13.0 - 1.0 / 3.0, 14.1] {
        scene.channels[0].transfer.iso_ranges = Some(vec![[value, value]]);
        assert!((half(&scene).1 - (value - 9.5)).abs() < 0.02, "{value}: {:?}", half(&scene));
    }
    scene.channels[0].transfer.iso_ranges = None;
    scene.channels[0].transfer.gradient_opacity = Some(Ramp::new(vec![(0.0, 0.0), (1.0, 0.8)]).unwrap());
    assert!((half(&scene).1 - 3.0).abs() < 0.02, "{:?}", half(&scene));
    scene.clip.planes = vec![[0.0, 1.0, 0.0, -4.2]];
    assert!((half(&scene).1 - 4.2).abs() < 1e-6, "{:?}", half(&scene));
    scene.channels[0].transfer.gradient_opacity = Some(Ramp::new(vec![(0.0, 0.0), (1.0, 0.4)]).unwrap());
    assert_eq!(half(&scene).0, [0.0; 4]);
}

/// A slab's amount is multiplied by the gradient's opacity, after any logarithm.
#[test]
fn gradient_opacity_scales_amounts() {
    let (volume, mut scene) = ramp();
    for compositing in [Compositing::Xray, Compositing::Exponential] {
        scene.splatting.compositing = compositing;
        scene.channels[0].transfer.opacity = Some(Ramp::new(vec![(0.0, 0.0), (20.0, 0.05)]).unwrap());
        let depth = |scene: &Scene| {
            let alpha = f64::from(render(&volume, scene).pixels[4][3]);
            if compositing == Compositing::Xray { alpha } else { -(-alpha).ln_1p() }
        };
        scene.channels[0].transfer.gradient_opacity = None;
        let whole = depth(&scene);
        scene.channels[0].transfer.gradient_opacity = Some(Ramp::new(vec![(0.0, 0.0), (2.0, 0.6)]).unwrap());
        let part = depth(&scene);
        assert!(whole > 0.2 && (part / whole - 0.3).abs() < 1e-5, "{compositing:?}: {part} of {whole}");
    }
}

/// Every pixel uses the table of the voxel whose cell it sees.
#[test]
fn labels_go_by_cells() {
    let dims = [10, 20, 10];
    let values = volume(dims, DVec3::ONE, |_| 10.0);
    // The nearer half has one label, the other a label without tables.
    let labels: Vec<u16> = (0..2000).map(|index| u16::from(values.grid().voxel_at(index).y < 10) * 7).collect();
    let labels = Labels {
        origin: "test".to_owned(),
        dims: UVec3::from(dims),
        spacing: None,
        values: labels.into(),
        names: std::collections::BTreeMap::new(),
    };
    let volume = values.with_labels(labels).unwrap();
    let mut scene = scene(3, 3);
    scene.camera = camera([0.0, 1.0, 0.0], 3.0);
    scene.shading.enabled = false;
    scene.splatting.compositing = Compositing::Xray;
    scene.channels[0].transfer = transfer(&[(0.0, [0.0, 1.0, 0.0])], &[(0.0, 0.01)]);
    let red = Ramp::new(vec![(0.0, DVec3::X)]).unwrap();
    let opacity = Some(Ramp::new(vec![(0.0, 0.02)]).unwrap());
    scene.channels[0].transfer.labels.insert(7, LabelTables { color: Some(red), opacity, ..LabelTables::default() });
    for pixel in render(&volume, &scene).pixels {
        let expected = [0.2, 0.1, 0.0, 0.3];
        assert!(pixel.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{pixel:?}");
    }
    scene.channels[0].transfer.labels.get_mut(&7).unwrap().visible = false;
    assert!(render(&volume, &scene).pixels.iter().all(|pixel| (pixel[3] - 0.1).abs() < 1e-6));
    // A surface is at the border of the cells, although planes are elsewhere.
    scene.splatting.compositing = Compositing::Surface;
    scene.splatting.slab_width = 0.7;
    scene.channels[0].transfer.opacity = Some(Ramp::new(vec![(0.0, 0.8)]).unwrap());
    let host = Host { surfaces: None, first_hit: Some(0.1) };
    let transfer = scene.channels[0].transfer.resolve(&volume);
    let rendered = reference::render_for(host, &volume, std::slice::from_ref(&transfer), &scene, None).unwrap();
    assert!(rendered.first_hits.iter().all(|depth| depth.abs() < 1e-9), "{:?}", rendered.first_hits);
    assert!(rendered.image.pixels.iter().all(|pixel| *pixel == [0.0, 1.0, 0.0, 1.0]));
}

/// A value between two planes counts for as long as the pixel sees it: steps and peaks are integrated, not sampled.
#[test]
fn peaks_keep_their_amount() {
    let (volume, mut scene) = ramp();
    scene.camera = camera([0.0, 1.0, 0.0], 3.0);
    scene.splatting.compositing = Compositing::Xray;
    // This kernel has no ripple, so the ramp is straight.
    (scene.splatting.radius, scene.splatting.falloff) = (3.0, 1.0);
    // A triangle of height 1 and width 0.1 over values, which grow by 1 per unit of the ray.
    scene.channels[0].transfer.opacity = Some(Ramp::new(vec![(11.32, 0.0), (11.37, 1.0), (11.42, 0.0)]).unwrap());
    for width in [0.3, 1.0, 2.7] {
        scene.splatting.slab_width = width;
        let alpha = f64::from(render(&volume, &scene).pixels[4][3]);
        assert!((alpha - 0.05).abs() < 0.0005, "{width}: {alpha}");
    }
    // An iso-range of the same width cuts a piece out of the ramp.
    scene.channels[0].transfer.opacity = Some(Ramp::new(vec![(0.0, 0.5)]).unwrap());
    scene.channels[0].transfer.iso_ranges = Some(vec![[11.32, 11.42]]);
    for width in [0.3, 1.0, 2.7] {
        scene.splatting.slab_width = width;
        let alpha = f64::from(render(&volume, &scene).pixels[4][3]);
        assert!((alpha - 0.05).abs() < 0.0005, "{width}: {alpha}");
    }
}
