//! Cameras from a host's matrices: views see every point at the pixel where the host does.

use glam::dcamera::rh::{proj::directx as proj, view};
use glam::{DMat4, DQuat, DVec2, DVec3, UVec3};
use sheetsplat::internals::view_geometry::ViewGeometry;
use sheetsplat::settings::Splatting;
use sheetsplat::settings::{Camera, Projection};
use sheetsplat::volume::Grid;

use crate::common::Random;

const SIZE: [u32; 2] = [1920, 1080];
const ASPECT: f64 = 1920.0 / 1080.0;

/// The pixel of a point in a host's viewport, and its w in clip space.
fn pixel(clip_from_world: &DMat4, point: DVec3) -> (DVec2, f64) {
    let clip = *clip_from_world * point.extend(1.0);
    let ndc = clip.truncate().truncate() / clip.w;
    ((ndc * DVec2::new(0.5, -0.5) + 0.5) * DVec2::from(SIZE.map(f64::from)), clip.w)
}

fn near(camera: &Camera) -> Option<f64> {
    match camera.projection {
        Projection::Perspective { near, .. } => near,
        Projection::Orthographic { .. } => None,
    }
}

/// A host's view of a volume that is rotated, moved and scaled in its scene; and the scale.
fn random_placed(random: &mut Random) -> (DMat4, DMat4, f64) {
    let scale = random.uniform(0.2, 5.0);
    let rotation = DQuat::from_axis_angle(random.direction(), random.uniform(0.0, 6.0));
    let place = random.within(DVec3::splat(-50.0), DVec3::splat(50.0));
    let world = DMat4::from_scale_rotation_translation(DVec3::splat(scale), rotation, place);
    let eye = place + random.direction() * scale * random.uniform(60.0, 300.0);
    let target = place + random.direction() * scale * random.uniform(0.0, 20.0);
    (world, view::look_at_mat4(eye, target, random.direction()), scale)
}

#[test]
fn points_fall_on_the_hosts_pixels() {
    let mut random = Random(31);
    let grid = Grid::new(UVec3::new(40, 30, 50), DVec3::new(1.0, 1.5, 0.8));
    let (mut before, mut points) = (0, 0);
    for _ in 0..200 {
        let (world, view, scale) = random_placed(&mut random);
        let fov_y = random.uniform(0.2, 2.2);
        let (n, f) = (random.uniform(0.01, 2.0) * scale, random.uniform(400.0, 4000.0) * scale);
        let height = random.uniform(10.0, 200.0) * scale;
        let (top, right) = (height / 2.0, height / 2.0 * ASPECT);
        let projections = [
            (proj::perspective(fov_y, ASPECT, n, f), Some(n)),
            (proj::perspective_infinite(fov_y, ASPECT, n), Some(n)),
            (proj::perspective_infinite_reverse(fov_y, ASPECT, n), Some(n)),
            (proj::perspective(fov_y, ASPECT, f, n), Some(n)),
            (proj::orthographic(-right, right, -top, top, n, f), None),
            (proj::orthographic(-right, right, -top, top, f, n), None),
        ];
        for (projection, n) in projections {
            // Matrices are homogeneous: any factor gives the same mapping.
            let clip_from_world = projection * view * world * random.uniform(0.5, 2.0);
            let camera = Camera::from_clip_from_world(clip_from_world, SIZE).unwrap();
            let plane = n.map(|n| n / scale);
            assert_eq!(near(&camera).is_some(), plane.is_some());
            if let (Some(near), Some(plane)) = (near(&camera), plane) {
                assert!((near / plane - 1.0).abs() < 1e-9, "near {near}, not {plane}");
            }
            let seen = ViewGeometry::new(&grid, &camera, &Splatting::default(), SIZE).unwrap();
            for _ in 0..50 {
                let voxel = random.within(DVec3::ZERO, grid.dims.as_dvec3()).as_uvec3();
                let (expected, w) = pixel(&clip_from_world, (voxel.as_dvec3() - grid.center()) * grid.spacing);
                if w <= 0.0 || expected.abs().max_element() > 1e4 {
                    before += 1;
                    continue;
                }
                points += 1;
                let actual = seen.project(voxel).truncate();
                assert!((actual - expected).abs().max_element() < 1e-9, "{actual}, not {expected}: {camera:?}");
            }
        }
    }
    assert!(points > 30_000, "{points} points, {before} before the eye or far off");
}

/// A matrix rounded to f32 still gives a camera, which is the same to a fraction of a pixel.
#[test]
fn matrices_in_f32_are_cameras_too() {
    let mut random = Random(32);
    let grid = Grid::new(UVec3::splat(40), DVec3::ONE);
    for _ in 0..200 {
        let (world, view, scale) = random_placed(&mut random);
        for projection in [
            proj::perspective_infinite_reverse(0.8, ASPECT, 0.1 * scale),
            proj::perspective(0.8, ASPECT, 0.1 * scale, 1000.0 * scale),
            proj::orthographic(-80.0 * ASPECT, 80.0 * ASPECT, -80.0, 80.0, 0.1, 1000.0),
        ] {
            let clip_from_world = (projection.as_mat4() * view.as_mat4() * world.as_mat4()).as_dmat4();
            let camera = Camera::from_clip_from_world(clip_from_world, SIZE).unwrap();
            let seen = ViewGeometry::new(&grid, &camera, &Splatting::default(), SIZE).unwrap();
            let voxel = random.within(DVec3::ZERO, grid.dims.as_dvec3()).as_uvec3();
            let (expected, _) = pixel(&clip_from_world, voxel.as_dvec3() - grid.center());
            let actual = seen.project(voxel).truncate();
            assert!((actual - expected).abs().max_element() < 0.1, "{actual}, not {expected}");
        }
    }
}

#[test]
fn other_mappings_are_refused_by_kind() {
    let view = view::look_at_mat4(DVec3::new(30.0, 80.0, 20.0), DVec3::ZERO, DVec3::Z);
    let perspective = proj::perspective(0.6, ASPECT, 0.5, 500.0);
    let orthographic = proj::orthographic(-40.0 * ASPECT, 40.0 * ASPECT, -40.0, 40.0, 0.5, 500.0);
    let shifted = DMat4::from_translation(DVec3::new(0.25, 0.0, 0.0));
    let stretched = DMat4::from_scale(DVec3::new(1.0, 1.1, 1.0));
    let mirrored = DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0));
    let mut sheared = DMat4::IDENTITY;
    sheared.y_axis.x = 0.2;
    let mut oblique = perspective;
    (oblique.x_axis.z, oblique.y_axis.z) = (0.1, 0.2);
    let not_a_number = DMat4::from_cols_array(&[f64::NAN; 16]);
    for (clip_from_world, found) in [
        (shifted * perspective * view, "0.250000 of half the image's width off its centre"),
        (stretched * perspective * view, "pixels 1.1"),
        (stretched * orthographic * view, "pixels 1.1"),
        (sheared * perspective * view, "a sheared image"),
        (sheared * orthographic * view, "a sheared image"),
        (perspective * view * DMat4::from_scale(DVec3::new(1.0, 2.0, 1.0)), "off its centre"),
        (mirrored * perspective * view, "a mirrored image"),
        (oblique * view, "a near plane tilted by"),
        (DMat4::ZERO, "a matrix without an inverse"),
        (DMat4::from_scale(DVec3::new(1.0, 0.0, 1.0)), "a matrix without an inverse"),
        (not_a_number, "NaN"),
    ] {
        let error = Camera::from_clip_from_world(clip_from_world, SIZE).unwrap_err().to_string();
        assert!(error.starts_with("clip_from_world: found ") && error.contains(found), "{found}: {error}");
        assert!(error.contains(", allowed: "), "{error}");
    }
    // Off centre by less than the rounding errors of f32.
    let hardly = DMat4::from_translation(DVec3::new(1e-7, 0.0, 0.0));
    Camera::from_clip_from_world(hardly * perspective * view, SIZE).unwrap();
    let error = Camera::from_clip_from_world(perspective * view, [1920, 0]).unwrap_err().to_string();
    assert!(error.contains("1920 by 0 pixels"), "{error}");
}
