//! Orbit, zoom and pan: how drags and scrolls move the camera of a viewer.

use glam::{DMat3, DVec2};

use crate::error::setting::{SettingError, scaled};
use crate::settings::camera::{Camera, Projection};
use crate::volume::Grid;

/// The maximum elevation of the camera in degrees over the plane perpendicular to `up`: at 90 the screen has no up.
pub const MAX_ELEVATION: f64 = 89.0;

/// The range of heights for zooming, in diameters of the volume.
const HEIGHTS: [f64; 2] = [1e-3, 1e2];

/// Turns the camera around its centre so that what is in front follows a pointer that moves right and down by some degrees: first about
/// `up` (azimuth), then up or down (elevation, clamped). `up` does not change.
pub fn orbit(camera: &mut Camera, degrees: DVec2) {
    let (up, w) = (scaled(camera.up).normalize(), scaled(camera.direction).normalize());
    let horizontal = w.reject_from_normalized(up).normalize();
    let azimuth = DMat3::from_axis_angle(up, -degrees.x.to_radians());
    let elevation = (elevation(camera) + degrees.y).clamp(-MAX_ELEVATION, MAX_ELEVATION);
    let (sine, cosine) = libm::sincos(elevation.to_radians());
    *camera = camera.looking([azimuth * horizontal * cosine - up * sine, camera.up]);
}

/// The camera whose eye has gone to the right about `up` by `azimuth` degrees, and then up by `elevation` degrees. `up` and the centre do not change.
///
/// # Errors
/// If the eye would stand more than [`MAX_ELEVATION`] degrees above or below the plane perpendicular to `up`.
pub fn eye_moved(camera: &Camera, azimuth: f64, elevation: f64) -> Result<Camera, SettingError> {
    if azimuth == 0.0 && elevation == 0.0 {
        return Ok(*camera);
    }
    let mut moved = camera.turned(azimuth);
    let above = self::elevation(&moved) + elevation;
    if above.abs() > MAX_ELEVATION {
        let found = format!("{elevation}, which puts the eye {above:.1} degrees above the level");
        return Err(SettingError::new("elevation", found, format!("at most {MAX_ELEVATION} above or below it")));
    }
    orbit(&mut moved, DVec2::new(0.0, elevation));
    Ok(moved)
}

/// The degrees of the eye over the plane through the camera's centre that is perpendicular to `up`.
pub fn elevation(camera: &Camera) -> f64 {
    let (up, w) = (scaled(camera.up).normalize(), scaled(camera.direction).normalize());
    -libm::asin(w.dot(up).clamp(-1.0, 1.0)).to_degrees()
}

/// The height of the image in world units, at the depth of the camera's centre.
pub fn height(camera: &Camera, grid: &Grid, kernel_radius: f64, size: [u32; 2]) -> f64 {
    let [width, height] = size;
    match camera.projection {
        Projection::Orthographic { height: given } => given
            .or_else(|| camera.orthographic_height(grid, kernel_radius, width, height))
            .unwrap_or(grid.bounding_radius(kernel_radius)),
        Projection::Perspective { fov_y, distance, .. } => {
            let half_angle = fov_y.to_radians() / 2.0;
            let whole = grid.bounding_radius(kernel_radius) / libm::sin(half_angle);
            2.0 * libm::tan(half_angle) * distance.unwrap_or(whole)
        }
    }
}

/// Multiplies the height of the image, now `height` world units, by `factor`: by another height, or in perspective by another distance
/// between the eye and the centre.
pub fn zoom(camera: &mut Camera, grid: &Grid, height: f64, factor: f64) {
    let diameter = 2.0 * grid.bounding_radius(0.0);
    let height = (height * factor).clamp(HEIGHTS[0] * diameter, HEIGHTS[1] * diameter);
    match &mut camera.projection {
        Projection::Orthographic { height: given } => *given = Some(height),
        Projection::Perspective { fov_y, distance, .. } => {
            *distance = Some(height / (2.0 * libm::tan(fov_y.to_radians() / 2.0)));
        }
    }
}

/// Moves the centre so that what is at its depth follows a pointer that moves right and down by some world units.
pub fn pan(camera: &mut Camera, moved: DVec2) {
    let basis = camera.basis();
    camera.center = Some(camera.middle() + basis.v * moved.y - basis.u * moved.x);
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use glam::{DVec3, UVec3};

    use super::*;

    const GRID: Grid = Grid::new(UVec3::new(20, 20, 10), DVec3::new(1.0, 1.0, 3.0));

    /// The position of a world point on the screen, right and up from the centre.
    fn on_screen(camera: &Camera, point: DVec3) -> DVec2 {
        let basis = camera.basis();
        DVec2::new((point - camera.middle()).dot(basis.u), (point - camera.middle()).dot(basis.v))
    }

    #[test]
    fn what_is_in_front_follows_the_pointer() {
        for (direction, up) in
            [(DVec3::Y, DVec3::Z), (DVec3::new(0.3, 0.9, -0.2), DVec3::Z), (DVec3::X, DVec3::new(0.1, 2.0, 0.3))]
        {
            let camera = Camera { direction, up, center: Some(DVec3::new(1.0, 2.0, 3.0)), ..Camera::default() };
            let front = camera.middle() - direction.normalize();
            for (degrees, way) in [(DVec2::X, DVec2::X), (-DVec2::X, -DVec2::X), (DVec2::Y, -DVec2::Y)] {
                let mut turned = camera;
                orbit(&mut turned, 3.0 * degrees);
                let moved = on_screen(&turned, front) - on_screen(&camera, front);
                assert!(moved.normalize().dot(way) > 0.99, "{direction} {up} {degrees}: {moved}");
            }
        }
    }

    #[test]
    fn orbiting_turns_by_the_right_hand_about_up() {
        let mut camera = Camera::default();
        orbit(&mut camera, DVec2::new(-90.0, 0.0));
        assert!(camera.direction.abs_diff_eq(-DVec3::X, 1e-12), "{}", camera.direction);
        orbit(&mut camera, DVec2::new(-270.0, 0.0));
        assert!(camera.direction.abs_diff_eq(DVec3::Y, 1e-12), "{}", camera.direction);
    }

    #[test]
    fn an_eye_goes_to_the_right_and_up_or_is_refused() {
        let camera = Camera::default();
        assert_eq!(eye_moved(&camera, 0.0, 0.0).unwrap(), camera);
        let moved = eye_moved(&camera, 90.0, 30.0).unwrap();
        assert!(moved.direction.abs_diff_eq(DVec3::new(-0.75_f64.sqrt(), 0.0, -0.5), 1e-12), "{}", moved.direction);
        let again = eye_moved(&moved, 0.0, 60.0).unwrap_err().to_string();
        assert_eq!(
            again,
            "elevation: found 60, which puts the eye 90.0 degrees above the level, allowed: at most 89 above or below it"
        );
    }

    #[test]
    fn elevation_is_clamped_and_comes_back() {
        for sign in [1.0, -1.0] {
            let mut camera = Camera { direction: DVec3::new(1.0, 1.0, 0.0), ..Camera::default() };
            orbit(&mut camera, DVec2::new(0.0, sign * 1000.0));
            let elevation = camera.direction.z.asin().to_degrees();
            assert!((elevation + sign * MAX_ELEVATION).abs() < 1e-9, "{elevation}");
            orbit(&mut camera, DVec2::new(0.0, -sign * MAX_ELEVATION));
            assert!(camera.direction.abs_diff_eq(DVec3::new(0.5_f64.sqrt(), 0.5_f64.sqrt(), 0.0), 1e-9));
        }
    }

    #[test]
    fn an_eye_above_looks_down() {
        let camera = Camera { direction: DVec3::new(1.0, 0.0, -1e200), up: DVec3::Z * 1e-200, ..Camera::default() };
        assert!((elevation(&camera) - 90.0).abs() < 1e-9);
        let mut camera = Camera { direction: DVec3::new(1e200, 0.0, -1e200), ..camera };
        assert!((elevation(&camera) - 45.0).abs() < 1e-9);
        orbit(&mut camera, DVec2::new(0.0, 15.0));
        assert!((elevation(&camera) - 60.0).abs() < 1e-9);
    }

    #[test]
    fn zoom_scales_the_visible_height_in_both_projections() {
        let perspective = Projection::Perspective { fov_y: 40.0, distance: None, near: None };
        for projection in [Projection::Orthographic { height: None }, perspective] {
            let mut camera = Camera { projection, ..Camera::default() };
            let size = [300, 400];
            let whole = height(&camera, &GRID, 2.0, size);
            assert!(whole > 30.0, "{whole}");
            zoom(&mut camera, &GRID, whole, 0.25);
            let quarter = height(&camera, &GRID, 2.0, size);
            assert!((quarter - whole / 4.0).abs() < 1e-9, "{quarter} {whole}");
            zoom(&mut camera, &GRID, quarter, 1e-30);
            assert!(height(&camera, &GRID, 2.0, size) > 0.01);
            zoom(&mut camera, &GRID, quarter, 1e30);
            assert!(height(&camera, &GRID, 2.0, size) < 1e4);
        }
    }

    #[test]
    fn what_is_at_the_centre_follows_a_pan() {
        let mut camera = Camera { direction: DVec3::new(0.3, 0.9, -0.2), ..Camera::default() };
        pan(&mut camera, DVec2::new(5.0, 2.0));
        assert!(on_screen(&camera, DVec3::ZERO).abs_diff_eq(DVec2::new(5.0, -2.0), 1e-12));
    }
}
