//! Cameras: where the image plane stands, and which pixel a world point falls on (SPEC §2).

use glam::{DMat3, DVec3};

use crate::error::RenderError;
use crate::volume::Grid;

/// The least and the largest pixel, in the volume's smallest spacings.
const PIXELS: std::ops::RangeInclusive<f64> = 1e-25..=1e25;

/// How the volume is projected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Parallel rays.
    Orthographic {
        /// World units over the image's height; `None` shows the whole volume.
        height: Option<f64>,
    },
    /// Rays through an eye point.
    Perspective {
        /// Opening angle over the image's height, degrees, in (0, 180).
        fov_y: f64,
        /// World units from the eye to `center`; `None` shows the whole volume.
        distance: Option<f64>,
        /// World units from the eye to the near plane; `None` is one `unit` (the smallest voxel spacing).
        near: Option<f64>,
    },
}

/// A camera in world units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Orthographic or perspective.
    pub projection: Projection,
    /// From the eye into the scene; any length but 0.
    pub direction: DVec3,
    /// What is up on the screen; not parallel to `direction`.
    pub up: DVec3,
    /// The world point at the image's centre.
    pub center: DVec3,
}

impl Default for Camera {
    fn default() -> Self {
        Self {
            projection: Projection::Orthographic { height: None },
            direction: DVec3::Y,
            up: DVec3::Z,
            center: DVec3::ZERO,
        }
    }
}

impl Camera {
    /// The viewing coordinate system u (screen right), v (screen up), w (into the scene), orthonormal (§4.2).
    pub fn basis(&self) -> ViewBasis {
        let w = self.direction.normalize();
        let u = w.cross(self.up).normalize();
        ViewBasis { u, v: u.cross(w), w }
    }

    /// Size of a pixel in `unit`s (SPEC §2) for an image `height_world` world units and `height` pixels high.
    ///
    /// # Errors
    /// If coordinates in pixels of that size leave the range of `f32`.
    pub fn pixel_size(height_world: f64, grid: &Grid, height: u32) -> Result<f64, RenderError> {
        let image_units = f64::from(height) * grid.unit();
        let pix = height_world / image_units;
        if PIXELS.contains(&pix) {
            return Ok(pix);
        }
        Err(RenderError::OutOfRange {
            key: "camera.height",
            found: format!("{height_world:e}"),
            allowed: format!("{:.1e} to {:.1e}", PIXELS.start() * image_units, PIXELS.end() * image_units),
        })
    }

    /// World units over the image's height for an orthographic camera: as given, or so that the volume's sphere
    /// ([`Grid::bounding_radius`]) fits the shorter image axis. `None` for a perspective camera.
    pub fn orthographic_height(&self, grid: &Grid, kernel_radius: f64, width: u32, height: u32) -> Option<f64> {
        let Projection::Orthographic { height: given } = self.projection else { return None };
        let whole = 2.0 * grid.bounding_radius(kernel_radius);
        Some(given.unwrap_or(whole * (f64::from(height) / f64::from(width)).max(1.0)))
    }
}

/// The orthonormal vectors of the viewing coordinate system, in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViewBasis {
    /// Screen right.
    pub u: DVec3,
    /// Screen up.
    pub v: DVec3,
    /// The viewing direction.
    pub w: DVec3,
}

impl ViewBasis {
    /// The matrix whose rows are u, v and w.
    pub fn rows(&self) -> DMat3 {
        DMat3::from_cols(self.u, self.v, self.w).transpose()
    }
}
