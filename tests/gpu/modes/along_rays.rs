//! Maximum, minimum and average over a whole ray.

use glam::{DVec3, UVec2};
use sheetsplat::image::Image;
use sheetsplat::internals::view_geometry::ViewGeometry;
use sheetsplat::scene::Scene;
use sheetsplat::settings::Clip;
use sheetsplat::settings::Projection;
use sheetsplat::settings::{Compositing, Method, Order};
use sheetsplat::volume::{Volume, builtin};

use crate::common::compare::{assert_at_most, largest};
use crate::common::devices::{DRAWINGS, gpu};
use crate::common::images::largest_difference;
use crate::common::{Random, camera, scene, transfer};
use crate::modes::{COLOR, OPACITY, constant, render, view_of};

/// The part of a pixel's ray in a box with this half size in grid steps: its ends in grid steps from the volume's centre.
fn in_box(view: &ViewGeometry, aspect: DVec3, pixel: usize, half: DVec3) -> Option<[DVec3; 2]> {
    let size = UVec2::from(view.size);
    let place = UVec2::new(pixel as u32 % size.x, pixel as u32 / size.x).as_dvec2() + 0.5 - size.as_dvec2() / 2.0;
    let [origin, end] = [0.0, 1.0].map(|depth| view.rays().at(place, depth) / aspect);
    let (mut first, mut last) = (f64::NEG_INFINITY, f64::INFINITY);
    for axis in 0..3 {
        let at = [-half[axis], half[axis]].map(|plane| (plane - origin[axis]) / (end - origin)[axis]);
        (first, last) = (first.max(at[0].min(at[1])), last.min(at[0].max(at[1])));
    }
    (first < last).then(|| [first, last].map(|depth| origin + depth * (end - origin)))
}

/// Views of a constant volume from any direction, with and without an eye, with sheets of any width and slices.
fn views_of_a_constant(random: &mut Random) -> Vec<(Volume, Scene)> {
    let mut views = Vec::new();
    for case in 0..12 {
        let spacing = DVec3::from(random.pick(&[[1.0, 1.0, 1.0], [1.0, 1.0, 2.0], [1.5, 2.0, 1.0]]));
        let (volume, mut scene) = constant([22, 20, 21], spacing);
        scene.camera.direction = if case == 0 { DVec3::Y } else { random.direction() };
        if case % 3 == 1 {
            scene.camera.projection = Projection::Perspective { fov_y: 20.0, distance: None, near: None };
        }
        if case % 4 == 3 {
            scene.splatting.method = Method::AxisAligned;
        }
        scene.splatting.slab_width = random.pick(&[0.4, 1.0, 1.7]);
        views.push((volume, scene));
    }
    views
}

#[test]
fn the_average_of_a_constant_is_the_constant() {
    let gpu = gpu();
    let (mut inside, mut brightest) = (0, 0.0_f64);
    for (volume, mut scene) in views_of_a_constant(&mut Random(5)) {
        scene.splatting.compositing = Compositing::Average;
        let (center, radius, view) = (volume.grid().center(), scene.splatting.radius, view_of(&volume, &scene));
        for drawing in DRAWINGS {
            let image = render(drawing, gpu, &volume, &scene).0;
            for (at, pixel) in image.pixels.iter().enumerate() {
                let alpha = f64::from(pixel[3]);
                brightest = brightest.max(largest([alpha / OPACITY]));
                let Some(ends) = in_box(&view, volume.grid().aspect(), at, center + 0.5) else {
                    assert_eq!(alpha, 0.0, "pixel {at} is beside the volume: {scene:?}");
                    continue;
                };
                // The ends are farther from the faces' edges than kernels reach, even if the ray is slanted.
                let is_inside = |end: DVec3| {
                    (center + 0.5 - end.abs()).to_array().iter().filter(|&&step| step >= 1.5 * radius).count() == 2
                };
                if ends.into_iter().all(is_inside) {
                    inside += 1;
                    // Quads' amounts are f16, and in perspective kernels are projected along their own rays.
                    let tolerance = if view.perspective.is_some() { 5e-3 } else { 2e-3 };
                    let what = format_args!("pixel {at}: {pixel:?} with {scene:?}");
                    assert_at_most((alpha / OPACITY - 1.0).abs(), tolerance, what);
                    assert_at_most((f64::from(pixel[2]) / alpha - COLOR[2]).abs(), 1.6e-4, what);
                }
            }
        }
    }
    println!("{inside} pixels, at most {brightest:.3} times the constant at edges");
    assert!(inside > 5000, "only {inside} pixels were compared");
    // Kernels blur the volume's edges, which exceed the inside by at most this.
    assert_at_most(brightest, 1.2, "times the constant");
}

#[test]
fn the_minimum_of_a_constant_is_the_constant_inside() {
    let gpu = gpu();
    let mut inside = 0;
    for (volume, mut scene) in views_of_a_constant(&mut Random(6)) {
        scene.splatting.compositing = Compositing::Minimum;
        let (complete, view) = (volume.grid().center() - scene.splatting.radius, view_of(&volume, &scene));
        // A middle may lie a hundredth of a slab outside.
        let [within, around] = [complete - 0.1, complete + 0.1];
        for (drawing, order) in DRAWINGS.into_iter().zip([Order::FrontToBack, Order::BackToFront, Order::FrontToBack]) {
            scene.splatting.order = order;
            let image = render(drawing, gpu, &volume, &scene).0;
            for (at, pixel) in image.pixels.iter().enumerate() {
                let alpha = f64::from(pixel[3]);
                if in_box(&view, volume.grid().aspect(), at, within).is_some() {
                    inside += 1;
                    assert_at_most((alpha / OPACITY - 1.0).abs(), 1.7e-3, format_args!("pixel {at} with {scene:?}"));
                } else if in_box(&view, volume.grid().aspect(), at, around).is_none() {
                    assert_eq!(*pixel, [0.0; 4], "pixel {at}: {scene:?}");
                }
            }
        }
    }
    assert!(inside > 5000, "only {inside} pixels were compared");
}

/// The minimum opacity is 0 where any part of the ray is empty, wherever it is, and however little of the volume takes part.
#[test]
fn the_minimum_across_a_gap_is_empty() {
    let gpu = gpu();
    for empty in [4..9, 20..60, 0..50, 12..60] {
        let (volume, mut scene) = constant([15, 60, 15], DVec3::ONE);
        let values: Vec<f32> = (0..volume.values().len() as u32)
            .map(|index| f32::from(!empty.contains(&volume.grid().voxel_at(index).y)))
            .collect();
        let volume = Volume::new("gap", volume.grid().dims, DVec3::ONE, values).unwrap();
        (scene.splatting.radius, scene.splatting.falloff) = (1.5, 2.0);
        scene.splatting.compositing = Compositing::Minimum;
        scene.channels[0].transfer = transfer(&[(0.0, COLOR)], &[(0.0, 0.0), (1.0, OPACITY)]);
        scene.camera = camera([0.0, 1.0, 0.0], 20.0);
        for (drawing, order) in DRAWINGS
            .into_iter()
            .flat_map(|drawing| [Order::FrontToBack, Order::BackToFront].map(|order| (drawing, order)))
        {
            scene.splatting.order = order;
            scene.clip = Clip::default();
            let image = render(drawing, gpu, &volume, &scene).0;
            assert!(image.pixels.iter().all(|pixel| *pixel == [0.0; 4]), "{empty:?} {drawing:?} {order:?}");
            // A part that is cut away is not a gap.
            let side = |y: u32, sign: f64| [0.0, sign, 0.0, -sign * (f64::from(y) - 29.5 + sign)];
            let kept = if empty.end < 55 { side(empty.end + 1, 1.0) } else { side(empty.start - 2, -1.0) };
            scene.clip.planes = vec![kept];
            let image = render(drawing, gpu, &volume, &scene).0;
            let alpha = image.pixels[54 * 120 + 60][3];
            assert!(alpha > 0.25, "{empty:?} {drawing:?} {order:?}: {alpha}");
        }
    }
}

/// The same if whole groups of sheets, between, before and behind others, are empty and nothing is drawn into them.
#[test]
fn the_minimum_across_empty_groups_is_empty() {
    let gpu = gpu();
    // With slabs of 8 and groups of 4, every slab of two groups has content, and none between them.
    for parts in [[0..16, 52..100], [0..16, 0..0], [0..0, 52..100], [0..0, 0..100]] {
        let (volume, mut scene) = constant([9, 100, 9], DVec3::ONE);
        let value = |index| f32::from(parts.iter().any(|part| part.contains(&volume.grid().voxel_at(index).y)));
        let volume = Volume::new("parts", volume.grid().dims, DVec3::ONE, (0..8100).map(value).collect()).unwrap();
        scene.camera = camera([0.0, 1.0, 0.0], 4.0);
        (scene.splatting.radius, scene.splatting.falloff) = (2.0, 2.0);
        (scene.splatting.compositing, scene.splatting.slab_width) = (Compositing::Minimum, 8.0);
        scene.channels[0].transfer = transfer(&[(0.0, COLOR)], &[(0.0, 0.0), (1.0, OPACITY)]);
        for (drawing, order) in DRAWINGS
            .into_iter()
            .flat_map(|drawing| [Order::FrontToBack, Order::BackToFront].map(|order| (drawing, order)))
        {
            scene.splatting.order = order;
            let image = render(drawing, gpu, &volume, &scene).0;
            if parts[1].len() == 100 {
                let alpha = image.pixels[54 * 120 + 60][3];
                assert!(alpha > 0.25, "{drawing:?} {order:?}: {alpha}");
            } else {
                let is_empty = image.pixels.iter().all(|pixel| *pixel == [0.0; 4]);
                assert!(is_empty, "{parts:?} {drawing:?} {order:?}");
            }
        }
    }
}

/// Seen from the other side, a picture is mirrored.
#[test]
fn maximum_and_average_are_the_same_from_behind() {
    let gpu = gpu();
    let volume = builtin::volume("head:40").unwrap();
    let mut random = Random(77);
    let widths = [0.5, 1.0, 2.0];
    for (compositing, width) in
        [Compositing::Maximum, Compositing::Average].into_iter().flat_map(|c| widths.map(|width| (c, width)))
    {
        let direction = random.direction();
        for drawing in DRAWINGS {
            let mut scene = scene(70, 61);
            scene.splatting.compositing = compositing;
            scene.splatting.slab_width = width;
            scene.shading.enabled = false;
            scene.channels[0].transfer = transfer(&[(0.0, [1.0, 0.7, 0.4])], &[(0.0, 0.0), (255.0, 1.0)]);
            let [front, behind] = [direction, -direction].map(|direction| {
                scene.camera.direction = direction;
                render(drawing, gpu, &volume, &scene).0
            });
            let mirrored = behind.pixels.chunks(70).flat_map(|row| row.iter().rev().copied()).collect();
            let difference = largest_difference(&front, &Image { pixels: mirrored, ..behind });
            assert_at_most(difference, 4e-6, format_args!("{compositing:?} {drawing:?} {width}"));
            assert!(front.pixels.iter().filter(|pixel| pixel[0] > 0.02).count() > 300);
        }
    }
}
