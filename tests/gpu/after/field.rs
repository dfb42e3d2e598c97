//! Values and gradients on the slab planes.

use glam::{DMat2, DVec2, DVec3, UVec2, UVec3};
use sheetsplat::internals::grid_warp;
use sheetsplat::internals::reference::after::low_pass::LowPass;
use sheetsplat::internals::reference::after::{Field, Frame};
use sheetsplat::internals::reference::{Geometry, Host};
use sheetsplat::scene::Scene;
use sheetsplat::settings::{Gradient, Interpolation, Projection};
use sheetsplat::volume::Volume;

use crate::after::{eye, scene, volume};
use crate::common::{Random, random_volume};

const NO_RULE: (DVec3, DVec3) = (DVec3::X, DVec3::Y);

fn no_rule() -> LowPass {
    LowPass::new(NO_RULE.0, NO_RULE.1)
}

/// The points at which the rays of all pixels meet all planes in the voxels' box, with the field there.
fn samples(volume: &Volume, scene: &Scene, check: impl Fn(DVec3, f64, DVec3)) -> usize {
    let transfer = scene.channels[0].transfer.resolve(volume);
    let frame = Frame::new(Host::default(), volume, std::slice::from_ref(&transfer), scene).unwrap();
    let last = volume.dims().as_dvec3() - 1.0;
    let mut count = 0;
    for (x, y) in (0..scene.image.height).flat_map(|y| (0..scene.image.width).map(move |x| (x, y))) {
        let pixel = frame.pixel(UVec2::new(x, y));
        for plane in pixel.slabs() {
            let at = pixel.at(plane.into());
            if at.cmpge(DVec3::ZERO).all() && at.cmple(last).all() {
                let sample = pixel.sample(plane).unwrap();
                check(at, sample.value, sample.gradient);
                count += 1;
            }
        }
    }
    count
}

#[test]
fn a_constant_volume_reconstructs_its_value() {
    for (spacing, projection) in [DVec3::ONE, DVec3::new(1.0, 3.0, 2.0)]
        .into_iter()
        .flat_map(|spacing| [None, Some(eye(40.0))].map(|projection| (spacing, projection)))
    {
        let volume = volume([9, 8, 7], spacing, |_| 37.0);
        for interpolation in [Interpolation::Smooth, Interpolation::Exact] {
            let mut scene = scene(24, 20);
            scene.camera.direction = DVec3::new(0.4, 0.9, -0.3);
            scene.camera.projection = projection.unwrap_or(scene.camera.projection);
            scene.splatting.interpolation = interpolation;
            for gradient in [Gradient::Differences, Gradient::Kernel] {
                scene.shading.gradient = gradient;
                let count = samples(&volume, &scene, |at, value, gradient| {
                    assert!((value / 37.0 - 1.0).abs() < 1e-5, "{at}: {value}");
                    assert!(gradient.length() < 1e-9, "{at}: {gradient}");
                });
                assert!(count > 300, "{count}");
            }
        }
    }
}

#[test]
fn a_ramp_has_its_normal() {
    for (spacing, projection) in [DVec3::ONE, DVec3::new(1.0, 3.0, 2.0)]
        .into_iter()
        .flat_map(|spacing| [None, Some(eye(40.0))].map(|projection| (spacing, projection)))
    {
        let slope = DVec3::new(3.0, -2.0, 1.0);
        let volume = volume([10, 9, 8], spacing, |voxel| slope.dot(voxel.as_dvec3() * spacing));
        let mut scene = scene(24, 20);
        // Pixels are smaller than grid units, because the low-pass rule changes the derivatives of wider kernels.
        scene.camera.projection = projection.unwrap_or(Projection::Orthographic { height: Some(12.0) });
        scene.camera.direction = DVec3::new(-0.4, 0.9, 0.5);
        // The field's derivative ripples, with this kernel by less than half a degree; the values themselves are smoothed.
        (scene.splatting.radius, scene.splatting.falloff) = (3.0, 1.0);
        for (gradient, degrees) in [(Gradient::Differences, 0.1), (Gradient::Kernel, 0.5)] {
            scene.shading.gradient = gradient;
            let count = samples(&volume, &scene, |at, value, gradient| {
                let margin = at.min(volume.dims().as_dvec3() - 1.0 - at).min_element();
                if margin >= 3.0 {
                    let angle = gradient.angle_between(slope).to_degrees();
                    assert!(angle < degrees, "{at}: {angle}° off");
                    assert!((gradient.length() / slope.length() - 1.0).abs() < 0.01, "{at}: {gradient}");
                    assert!((value - slope.dot(at * spacing)).abs() < 0.05, "{at}: {value}");
                }
            });
            assert!(count > 500, "{count}");
        }
    }
}

/// The field has every voxel's value, at borders and corners too, for any kernel and spacing; a smooth field is far from the values of noise.
#[test]
fn exact_fields_interpolate() {
    let mut random = Random(9);
    for (radius, falloff) in [(2.0, 2.0), (2.0, 1.0), (2.0, 0.95), (1.0, 0.3), (1.5, 3.0), (3.2, 1.1), (4.0, 11.0)] {
        let volume = random_volume(&mut random, (5.0, 12.0), [1.0, 1.0, 3.0]);
        let mut scene = scene(8, 8);
        (scene.splatting.radius, scene.splatting.falloff) = (radius, falloff);
        scene.splatting.interpolation = Interpolation::Exact;
        scene.splatting.check().unwrap();
        let field = Field::new(&volume, &scene).unwrap();
        let values = volume.values().iter().map(f64::from);
        let (min, max) = values.clone().fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(v), b.max(v)));
        let worst = |field: &Field| {
            let error = |(value, index): (f64, u32)| {
                (field.value(volume.grid().voxel_at(index).as_dvec3(), &no_rule()).unwrap() - value).abs()
            };
            values.clone().zip(0..).map(error).fold(0.0, f64::max) / (max - min)
        };
        let exact = worst(&field);
        assert!(exact < 1e-5, "radius {radius}, falloff {falloff}: {exact} of the range");
        scene.splatting.interpolation = Interpolation::Smooth;
        if radius > 1.0 && falloff < 4.0 {
            assert!(worst(&Field::new(&volume, &scene).unwrap()) > 0.05, "radius {radius}, falloff {falloff}");
        }
    }
}

/// The kernel's gradient is the field's derivative.
#[test]
fn the_kernel_gradient_is_the_derivative() {
    const STEP: f64 = 1e-5;
    let mut random = Random(4);
    let volume = random_volume(&mut random, (8.0, 12.0), [1.0, 1.5, 3.0]);
    let mut scene = scene(8, 8);
    scene.shading.gradient = Gradient::Kernel;
    // This kernel is negligible at its radius, so no voxel lies on a visible rim.
    (scene.splatting.radius, scene.splatting.falloff) = (4.0, 2.0);
    for interpolation in [Interpolation::Smooth, Interpolation::Exact] {
        scene.splatting.interpolation = interpolation;
        let field = Field::new(&volume, &scene).unwrap();
        for _ in 0..50 {
            let at = random.within(DVec3::ZERO, volume.dims().as_dvec3() - 1.0);
            let gradient = field.gradient(at, &no_rule());
            let value = |offset: DVec3| field.value(at + offset, &no_rule()).unwrap();
            let difference = |axis: DVec3| (value(axis * STEP) - value(-axis * STEP)) / (2.0 * STEP);
            let expected = DVec3::from(DVec3::AXES.map(difference)) / volume.spacing();
            assert!((gradient - expected).length() < 1e-4 * (1.0 + expected.length()), "{at}: {gradient}, {expected}");
        }
    }
}

/// f as the specification writes it, voxel by voxel: `δ = A·(pixel offset) + e` with A's singular values lowered to at most 1.
fn as_specified(volume: &Volume, scene: &Scene, geometry: &Geometry, pixel: DVec2, plane: i32) -> Option<f64> {
    let (grid, basis) = (volume.grid(), &geometry.basis);
    let aspect = grid.aspect();
    let distance = f64::from(plane) * geometry.slab_width;
    let pix = geometry.eye.map_or(geometry.pix, |eye| eye.pix(distance));
    let mut columns = [basis.u * pix / aspect, -basis.v * pix / aspect];
    if geometry.eye.is_none() {
        columns = columns.map(|column| column - column.dot(geometry.ro) * geometry.ro);
    }
    // In the plane's own coordinates A is 2×2, and rotations on both sides give its singular values.
    let normal = columns[0].cross(columns[1]).normalize();
    let across = columns[0].normalize();
    let along = normal.cross(across);
    let flat = |p: DVec3| DVec2::new(p.dot(across), p.dot(along));
    let a = DMat2::from_cols(flat(columns[0]), flat(columns[1]));
    let symmetric = a.transpose() * a;
    let angle = (2.0 * symmetric.x_axis.y).atan2(symmetric.x_axis.x - symmetric.y_axis.y) / 2.0;
    let right = DMat2::from_angle(angle);
    let stretched = a * right;
    let lowered = DMat2::from_cols(
        stretched.x_axis / stretched.x_axis.length().max(1.0),
        stretched.y_axis / stretched.y_axis.length().max(1.0),
    ) * right.transpose();
    let (mut sum, mut weights) = (0.0, 0.0);
    for (index, value) in (0..).zip(volume.values()) {
        let voxel = grid.voxel_at(index);
        let p = grid.world_position(voxel) / grid.unit();
        let (offset, e) = match &geometry.eye {
            None => (pixel - geometry.pixel(voxel), geometry.ro * (distance - geometry.depth(voxel))),
            Some(eye) => {
                // δ at the middle of the image, from which A leads to the smallest |δ|.
                let middle = (eye.position + basis.w * distance - p) / aspect;
                let nearest = geometry.size / 2.0 - a.inverse() * flat(middle);
                (pixel - nearest, normal * middle.dot(normal))
            }
        };
        let within = lowered * offset;
        let delta = across * within.x + along * within.y + e;
        if delta.length() < scene.splatting.radius {
            let weight = (-scene.splatting.falloff * delta.length_squared()).exp();
            sum += f64::from(value) * weight;
            weights += weight;
        }
    }
    (weights >= 1e-3).then(|| sum / weights)
}

/// Pixels are smaller or larger than grid units, or both.
#[test]
fn planes_are_as_specified() {
    let mut random = Random(11);
    let mut values = 0;
    for case in 0..24 {
        let spacing = random.pick(&[[1.0, 1.0, 1.0], [1.0, 1.0, 4.0], [3.0, 1.0, 2.0]]);
        let volume = random_volume(&mut random, (5.0, 9.0), spacing);
        let mut scene = scene(11, 9);
        scene.camera.direction = random.direction();
        // Lowered maps have steps of exactly 1, so only chance keeps voxels off the rims of kernels.
        scene.camera.center = Some(random.within(DVec3::splat(-0.5), DVec3::splat(0.5)));
        let size = (volume.grid().center() * volume.spacing()).length();
        scene.camera.projection = if case % 2 == 0 {
            Projection::Orthographic { height: Some(size * random.pick(&[0.5, 2.5])) }
        } else {
            Projection::Perspective {
                fov_y: random.pick(&[8.0, 60.0]),
                distance: Some(size * random.pick(&[0.7, 2.5])),
                near: None,
            }
        };
        scene.splatting.slab_width = random.pick(&[0.5, 1.0, 1.7]);
        scene.splatting.radius = random.pick(&[1.4, 2.0, 2.7]);
        let transfer = scene.channels[0].transfer.resolve(&volume);
        let frame = Frame::new(Host::default(), &volume, std::slice::from_ref(&transfer), &scene).unwrap();
        for plane in -6..30 {
            if frame.geometry().eye.is_some() && plane <= 0 {
                assert!(frame.plane_field(plane).iter().all(Option::is_none));
                continue;
            }
            for (at, sample) in (0..).zip(frame.plane_field(plane)) {
                let pixel = DVec2::new(f64::from(at % 11), f64::from(at / 11)) + 0.5;
                let expected = as_specified(&volume, &scene, frame.geometry(), pixel, plane);
                let found = sample.map(|sample| sample.value);
                let close = match (found, expected) {
                    (Some(found), Some(expected)) => (found - expected).abs() < 1e-8,
                    (None, None) => true,
                    _ => false,
                };
                assert!(close, "case {case}, plane {plane}, {pixel}: {found:?}, not {expected:?}");
                values += usize::from(found.is_some());
            }
        }
    }
    assert!(values > 10_000, "{values}");
}

/// Planes are where the slabs of classification before splatting begin: `k·Δ` along the ray.
#[test]
fn planes_are_a_slab_width_apart() {
    let volume = volume([6, 6, 6], DVec3::new(1.0, 2.0, 5.0), |_| 1.0);
    let mut scene = scene(7, 7);
    scene.camera.direction = DVec3::new(0.3, -0.5, 0.7);
    scene.splatting.slab_width = 0.6;
    let transfer = scene.channels[0].transfer.resolve(&volume);
    let frame = Frame::new(Host::default(), &volume, std::slice::from_ref(&transfer), &scene).unwrap();
    let pixel = frame.pixel(UVec2::new(3, 3));
    assert!((pixel.at(0.0) - volume.grid().center()).length() < 1e-12);
    let step = (pixel.at(5.0) - pixel.at(4.0)) * volume.spacing();
    assert!((step - 0.6 * frame.geometry().basis.w).length() < 1e-12, "{step}");
    let warped = grid_warp::m_view_warped(&frame.geometry().basis, volume.grid().aspect());
    let (_, lambda) = grid_warp::w_wo(&warped);
    assert!((frame.geometry().slab_width - 0.6 * lambda).abs() < 1e-12);
    assert_eq!(volume.dims(), UVec3::splat(6));
}
