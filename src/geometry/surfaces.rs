//! A host's opaque surfaces, which hide the part of a volume behind them.

use glam::{DMat4, DVec2, DVec3, DVec4};
use wgpu::{TextureUsages, TextureView};

use crate::error::RenderError;
use crate::error::setting::{Interval, SettingError};
use crate::geometry::view_geometry::{Rays, ViewGeometry};
use crate::volume::Grid;

/// The maximum distance in pixels between positions projected by the host and by the camera.
const AGREEMENT: f64 = 0.02;

/// A host's depth texture, and the projection it was drawn with.
#[derive(Clone, Debug)]
pub struct Surfaces {
    /// A view of only the depth aspect of a texture that has [`TextureUsages::TEXTURE_BINDING`] and one sample per pixel. The far plane's
    /// depth (1, or 0 if reversed) means that there is no surface.
    pub depth: TextureView,
    /// The texel, counted from the left and from above, of the image's first pixel.
    pub origin: [u32; 2],
    /// Maps world coordinates, whose origin is the volume's centre, to wgpu's clip space: the product of the host's projection, its view
    /// and the volume's transformation. It must agree with the camera over the image's pixels.
    pub clip_from_world: DMat4,
}

/// The depth of a surface as a function of a pixel's position (x right of the image's middle, y below it, in pixels) and the texture's value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceDepths {
    /// The depth along w in `unit`s is the product of this row with (x, y, value, 1) divided by that of `w`.
    pub depth: DVec4,
    /// The row for the divisor of `depth`.
    pub w: DVec4,
    /// The texture's value where there is no surface.
    pub none: f64,
}

impl SurfaceDepths {
    /// In front of everything where the texture's value is not 1.
    pub(crate) const IN_FRONT: Self =
        Self { depth: DVec4::new(0.0, 0.0, 0.0, -1e9), w: DVec4::new(0.0, 0.0, 0.0, 1.0), none: 1.0 };
}

impl Surfaces {
    /// Checks the texture and the matrix. Whether the projection is the camera's is checked when a frame is prepared.
    ///
    /// # Errors
    /// If the texture does not have one readable depth per pixel, or the matrix is not finite or not invertible.
    pub fn check(&self) -> Result<(), SettingError> {
        const DEPTH: &str = "surfaces.depth";
        const MATRIX: &str = "surfaces.clip_from_world";
        let texture = self.depth.texture();
        if !texture.format().has_depth_aspect() {
            return Err(SettingError::new(DEPTH, format!("{:?}", texture.format()), "a depth format"));
        }
        if texture.sample_count() != 1 {
            let found = format!("{} samples per pixel", texture.sample_count());
            return Err(SettingError::new(DEPTH, found, "1: resolve it first"));
        }
        if !texture.usage().contains(TextureUsages::TEXTURE_BINDING) {
            let found = format!("{:?}", texture.usage());
            return Err(SettingError::new(DEPTH, found, "TEXTURE_BINDING among them"));
        }
        Interval::FINITE.check_each(MATRIX, &self.clip_from_world.to_cols_array())?;
        if !self.clip_from_world.inverse().is_finite() {
            let found = format!("{}, which has no inverse", self.clip_from_world);
            return Err(SettingError::new(MATRIX, found, "projections of space onto the screen"));
        }
        Ok(())
    }

    /// Checks that the texture covers the image and that its projection is the view's.
    pub(crate) fn depths(&self, view: &ViewGeometry, grid: &Grid) -> Result<SurfaceDepths, RenderError> {
        let refused = |key, found: String, allowed: String| Err(SettingError::new(key, found, allowed).into());
        let texture = self.depth.texture();
        let reached = [0, 1].map(|axis| u64::from(self.origin[axis]) + u64::from(view.size[axis]));
        if reached[0] > texture.width().into() || reached[1] > texture.height().into() {
            let found = format!("{}×{} texels", texture.width(), texture.height());
            return refused("surfaces.depth", found, format!("at least {}×{}", reached[0], reached[1]));
        }
        let rays = view.rays();
        let off = self.disagreement(view, &rays, grid);
        if off.is_nan() || off > AGREEMENT {
            let found = format!("a projection that is {off:.3} pixels off the camera's");
            return refused("surfaces.clip_from_world", found, format!("at most {AGREEMENT}"));
        }
        Ok(self.by_value(view, &rays, grid))
    }

    /// The maximum distance in pixels between the projections by the host and by the camera, of points at the volume's near end, middle and
    /// far end.
    fn disagreement(&self, view: &ViewGeometry, rays: &Rays, grid: &Grid) -> f64 {
        let half = DVec2::from(view.size.map(f64::from)) / 2.0;
        let (middle, half_depth) = (rays.depth_of(DVec3::ZERO), (grid.center() * grid.aspect()).length() + 1.0);
        // The nearest point must lie in front of the eye.
        let least = if view.perspective.is_some() { 0.1 * (middle.abs() + half_depth) } else { f64::NEG_INFINITY };
        let depths = [middle - half_depth, middle, middle + half_depth].map(|depth| depth.max(least));
        let corners = [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (0.1, -0.3)];
        let points = corners.into_iter().flat_map(|(x, y)| depths.map(|depth| (DVec2::new(x, y) * half, depth)));
        let off = points.map(|(place, depth)| {
            let clip = self.clip_from_world * (rays.at(place, depth) * grid.unit() + grid.place()).extend(1.0);
            let there = DVec2::new(clip.x, -clip.y) / clip.w * half;
            if clip.w > 0.0 { (there - place).length() } else { f64::INFINITY }
        });
        off.fold(0.0, |worst: f64, off| if worst.is_nan() || off <= worst { worst } else { off })
    }

    fn by_value(&self, view: &ViewGeometry, rays: &Rays, grid: &Grid) -> SurfaceDepths {
        let world_from_clip = self.clip_from_world.inverse();
        let [x, y, z, w] = [0, 1, 2, 3].map(|row| world_from_clip.row(row));
        let ahead = view.basis.w / grid.unit();
        let depth =
            x * ahead.x + y * ahead.y + z * ahead.z - w * (view.basis.w.dot(rays.origin[2]) + ahead.dot(grid.place()));
        // Converts pixels to normalized device coordinates.
        let [width, height] = view.size.map(f64::from);
        let scale = DVec4::new(2.0 / width, -2.0 / height, 1.0, 1.0);
        let (depth, w) = (depth * scale, w * scale);
        let at = |value: f64| {
            let ndc = DVec4::new(0.0, 0.0, value, 1.0);
            let (depth, w) = (depth.dot(ndc), w.dot(ndc));
            // The far plane may be at infinity.
            if w.abs() < 1e-12 * depth.abs() { f64::INFINITY } else { depth / w }
        };
        SurfaceDepths { depth, w, none: if at(0.0) > at(1.0) { 0.0 } else { 1.0 } }
    }
}
