//! Cameras: the position of the image plane, and the pixel of a world point (SPEC §2).

use std::ops::Bound;

use glam::{DMat3, DVec3};

use crate::error::RenderError;
use crate::error::setting::{Interval, SettingError, scaled};
use crate::volume::Grid;

/// The range of pixel sizes, in the volume's smallest spacings.
const PIXELS: std::ops::RangeInclusive<f64> = 1e-25..=1e25;

/// Up and direction count as parallel if the sine of their angle is below this.
pub(super) const PARALLEL: f64 = 1e-9;

/// How the volume is projected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Parallel rays.
    Orthographic {
        /// World units over the image's height; `None` is determined by [`Camera::fit`].
        height: Option<f64>,
    },
    /// Rays through an eye point.
    Perspective {
        /// The opening angle over the image's height in degrees, in (0, 180).
        fov_y: f64,
        /// World units from the eye to `center`; `None` is determined by [`Camera::fit`].
        distance: Option<f64>,
        /// World units from the eye to the near plane; `None` means one `unit` (the smallest voxel spacing).
        near: Option<f64>,
    },
}

/// What a camera frames if its centre, height or distance is not stated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Fit {
    /// The whole volume, visible or not.
    #[default]
    Volume,
    /// The visible object: the box of the voxels that take part, which [`Scene::explicit`](crate::Scene::explicit) determines.
    Object,
}

/// A camera in world units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Orthographic or perspective.
    pub projection: Projection,
    /// The direction from the eye into the scene, of any length except 0.
    pub direction: DVec3,
    /// The direction that points up on the screen; not parallel to `direction`.
    pub up: DVec3,
    /// The world point at the image's centre; `None` means the middle of what [`Self::fit`] frames.
    pub center: Option<DVec3>,
    /// What determines the values that are not stated.
    pub fit: Fit,
    /// Whether `direction` and `up` are chosen for the volume ([`Eye`](crate::appearance::Eye)) as long as both are the defaults.
    pub is_eye_open: bool,
}

impl Default for Camera {
    fn default() -> Self {
        Self {
            projection: Projection::Orthographic { height: None },
            direction: DVec3::Y,
            up: DVec3::Z,
            center: None,
            fit: Fit::Volume,
            is_eye_open: false,
        }
    }
}

impl Camera {
    /// The camera of a scene that states neither a camera nor a transfer function: it shows the object, from where the volume is best seen (SPEC §2).
    pub fn of_object() -> Self {
        Self { fit: Fit::Object, is_eye_open: true, ..Self::default() }
    }

    /// Whether the volume chooses `direction` and `up`. Others than the defaults count as stated.
    pub fn has_open_eye(&self) -> bool {
        let Self { direction, up, .. } = Self::default();
        self.is_eye_open && (self.direction, self.up) == (direction, up)
    }

    /// The camera with a stated `direction` and `up`.
    pub fn looking(self, [direction, up]: [DVec3; 2]) -> Self {
        Self { direction, up, is_eye_open: false, ..self }
    }

    /// The viewing coordinate system u (screen right), v (screen up), w (into the scene), orthonormal (§4.2).
    pub fn basis(&self) -> ViewBasis {
        let w = scaled(self.direction).normalize();
        let u = w.cross(scaled(self.up)).normalize();
        ViewBasis { u, v: u.cross(w), w }
    }

    /// The world point at the image's centre: as stated, or the volume's centre.
    pub fn middle(&self) -> DVec3 {
        self.center.unwrap_or_default()
    }

    /// [`Self::middle`] from a grid's centre.
    pub fn middle_from(&self, grid: &Grid) -> DVec3 {
        self.middle() - grid.place()
    }

    /// Whether an object's box must determine a value ([`Extent::fit`](crate::settings::Extent::fit)).
    pub fn needs_object(&self) -> bool {
        let is_open = match self.projection {
            Projection::Orthographic { height } => height.is_none(),
            Projection::Perspective { distance, .. } => distance.is_none(),
        };
        self.fit == Fit::Object && (is_open || self.center.is_none())
    }

    /// The camera turned right-handed about its `up` by an angle in degrees; `center` does not change.
    pub fn turned(self, degrees: f64) -> Self {
        let rotation = DMat3::from_axis_angle(scaled(self.up).normalize(), degrees.to_radians());
        self.looking([rotation * scaled(self.direction), self.up])
    }

    /// The size of a pixel in `unit`s (SPEC §2) for an image that is `height_world` world units and `height` pixels high.
    ///
    /// # Errors
    /// If pixel coordinates leave the range of `f32` with pixels of that size.
    pub fn pixel_size(height_world: f64, grid: &Grid, height: u32) -> Result<f64, RenderError> {
        let image_units = f64::from(height) * grid.unit();
        let pix = height_world / image_units;
        if PIXELS.contains(&pix) {
            return Ok(pix);
        }
        let allowed = within(PIXELS.start() * image_units, PIXELS.end() * image_units);
        Err(SettingError::new("camera.height", height_world, allowed).into())
    }

    /// World units over the image's height for an orthographic camera: as stated, or such that the volume's sphere
    /// ([`Grid::bounding_radius`]) fits the shorter image axis. `None` for a perspective camera.
    pub fn orthographic_height(&self, grid: &Grid, kernel_radius: f64, width: u32, height: u32) -> Option<f64> {
        let Projection::Orthographic { height: given } = self.projection else { return None };
        let whole = 2.0 * grid.bounding_radius(kernel_radius);
        Some(given.unwrap_or(whole * (f64::from(height) / f64::from(width)).max(1.0)))
    }

    /// `fov_y`, `distance` and `near` of a perspective camera: as stated, or such that the volume's sphere ([`Grid::bounding_radius`]) fits
    /// between the image's upper and lower edge, and one [`Grid::unit`]. `None` for an orthographic camera.
    fn perspective(&self, grid: &Grid, kernel_radius: f64) -> Option<[f64; 3]> {
        let Projection::Perspective { fov_y, distance, near } = self.projection else { return None };
        let whole = grid.bounding_radius(kernel_radius) / libm::sin(fov_y.to_radians() / 2.0);
        Some([fov_y, distance.unwrap_or(whole), near.unwrap_or(grid.unit())])
    }

    /// The same camera with its centre and projection stated, where necessary from the whole volume, so that it shows every volume as it shows
    /// this one.
    pub fn explicit(&self, grid: &Grid, kernel_radius: f64, width: u32, height: u32) -> Self {
        let projection = match self.perspective(grid, kernel_radius) {
            Some([fov_y, distance, near]) => {
                Projection::Perspective { fov_y, distance: Some(distance), near: Some(near) }
            }
            None => Projection::Orthographic { height: self.orthographic_height(grid, kernel_radius, width, height) },
        };
        Self { projection, center: Some(self.middle()), ..*self }
    }

    /// The eye of a perspective camera for an image `height` pixels high; `None` for an orthographic one. The default distance shows the
    /// volume's sphere whole from top to bottom, whatever the image's width.
    ///
    /// # Errors
    /// If pixels at the near plane or at the far end of the volume are too small or too large for `f32`.
    pub fn eye(&self, grid: &Grid, kernel_radius: f64, height: u32) -> Result<Option<Eye>, RenderError> {
        let Some([fov_y, distance, near]) = self.perspective(grid, kernel_radius) else { return Ok(None) };
        let (unit, sphere) = (grid.unit(), grid.bounding_radius(kernel_radius));
        let [distance, near] = [distance, near].map(|world| world / unit);
        let position = self.middle_from(grid) / unit - distance * self.basis().w;
        let pixel_per_depth = 2.0 * libm::tan(fov_y.to_radians() / 2.0) / f64::from(height);
        let eye = Eye { position, distance, near, pixel_per_depth };
        let (least, largest) = (PIXELS.start() / pixel_per_depth, PIXELS.end() / pixel_per_depth);
        let farthest = position.length() + sphere / unit;
        if !(least..=largest).contains(&eye.near) {
            let allowed = within(least * unit, largest * unit);
            return Err(SettingError::new("camera.near", eye.near * unit, allowed).into());
        }
        if farthest.is_nan() || farthest > largest {
            let allowed = format!("an eye at most {:.1e} from the volume's end", largest * unit);
            return Err(SettingError::new("camera.distance", distance * unit, allowed).into());
        }
        Ok(Some(eye))
    }
}

fn within(min: f64, max: f64) -> Interval {
    Interval::new(Bound::Included(min), Bound::Included(max))
}

/// A perspective camera's eye (SPEC §2). Lengths are in `unit`s, depths are along w.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eye {
    /// The position.
    pub position: DVec3,
    /// The depth of [`Camera::center`].
    pub distance: f64,
    /// The depth of the near plane.
    pub near: f64,
    /// The size of a pixel at depth 1: `2·tan(fov_y/2)/H`.
    pub pixel_per_depth: f64,
}

impl Eye {
    /// `pix(d)`, the size of a pixel at a depth.
    pub fn pix(&self, depth: f64) -> f64 {
        depth * self.pixel_per_depth
    }

    /// Checks that the indices of slabs fit in 32 bits, with slab 0 at the eye.
    ///
    /// # Errors
    /// If there are too many slabs before the volume.
    pub fn check_slabs(&self, grid: &Grid, slab_width: f64) -> Result<(), RenderError> {
        let last = self.position.length() / slab_width;
        // The factor leaves room for the volume itself.
        if last <= f64::from(i32::MAX) * 0.99 {
            return Ok(());
        }
        let found = format!("{:e}, so {last:e} slabs before the volume", self.distance * grid.unit());
        let allowed = format!("eyes and slab widths with at most {} slabs between eye and volume", i32::MAX);
        Err(SettingError::new("camera.distance", found, allowed).into())
    }
}

/// The orthonormal vectors of the viewing coordinate system, in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViewBasis {
    /// The direction right on the screen.
    pub u: DVec3,
    /// The direction up on the screen.
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

/// The first axis with the least number.
pub(crate) fn least_axis(numbers: DVec3) -> usize {
    (0..3).fold(0, |least, axis| if numbers[axis] < numbers[least] { axis } else { least })
}
