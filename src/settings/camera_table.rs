//! `[camera]` of a scene file, which states the keys of both projections, so that a change of `projection` alone works.

use super::camera::{Camera, PARALLEL, Projection};
use super::key::Keyed;
use crate::error::setting::{SettingError, scaled};

/// A camera, and what it would be with the other projection.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CameraTable {
    pub(crate) camera: Camera,
    pub(crate) is_perspective: bool,
    pub(crate) height: Option<f64>,
    pub(crate) fov_y: f64,
    pub(crate) distance: Option<f64>,
    pub(crate) near: Option<f64>,
}

impl Default for CameraTable {
    fn default() -> Self {
        Camera::default().into()
    }
}

impl From<Camera> for CameraTable {
    fn from(camera: Camera) -> Self {
        let table = Self { camera, is_perspective: false, height: None, fov_y: 30.0, distance: None, near: None };
        match camera.projection {
            Projection::Orthographic { height } => Self { height, ..table },
            Projection::Perspective { fov_y, distance, near } => {
                Self { is_perspective: true, fov_y, distance, near, ..table }
            }
        }
    }
}

impl From<CameraTable> for Camera {
    fn from(table: CameraTable) -> Self {
        let CameraTable { camera, is_perspective, height, fov_y, distance, near } = table;
        let perspective = Projection::Perspective { fov_y, distance, near };
        let projection = if is_perspective { perspective } else { Projection::Orthographic { height } };
        Self { projection, ..camera }
    }
}

impl Camera {
    /// Checks that the values are in range.
    ///
    /// # Errors
    /// If a number is not finite or out of its range, a vector is 0, or `up` is parallel to `direction`.
    pub fn check(&self) -> Result<(), SettingError> {
        CameraTable::from(*self).check()
    }
}

impl CameraTable {
    /// Checks the keys of both projections.
    pub(crate) fn check(&self) -> Result<(), SettingError> {
        self.check_keys("camera")?;
        let Camera { direction, up, .. } = self.camera;
        if scaled(direction).normalize().cross(scaled(up).normalize()).length() < PARALLEL {
            let found = format!("{up} with direction {direction}");
            return Err(SettingError::new("camera.up", found, "a vector not parallel to camera.direction"));
        }
        Ok(())
    }
}
