//! What clip planes and a host's surfaces leave of a pixel's ray, and so of its sheets; the twin of `shaders/shared/cut.wgsl`.

use std::ops::Range;

use glam::{DVec3, UVec2};
use rayon::prelude::*;

use super::{Buffer, Geometry};
use crate::settings::clip::HalfSpace;
use crate::settings::splatting::Method;

/// Of every pixel, row by row, the stretch of its ray that shows, in sheets: number k fills `k..k + 1`. Empty if nothing shows.
#[derive(Clone, Debug, PartialEq)]
pub struct Cuts {
    stretches: Vec<Range<f64>>,
}

impl Cuts {
    /// What clip planes leave in front of opaque surfaces, of which there is the depth along w, in `unit`s from the eye (orthographic:
    /// from the camera's centre), for every pixel.
    pub fn new(geometry: &Geometry, surfaces: Option<&[f64]>) -> Self {
        let width = geometry.size.x as u32;
        let pixels = (0..width * geometry.size.y as u32).into_par_iter();
        let stretch = |at: u32| {
            let ray = PixelRay::new(geometry, UVec2::new(at % width, at / width));
            ray.sheets(geometry, shown(geometry, surfaces, at))
        };
        Self { stretches: pixels.map(stretch).collect() }
    }

    /// Of every pixel of a sheet what shows of it.
    pub fn apply(&self, sheet: &mut Buffer, number: i32) {
        for (pixel, stretch) in sheet.pixels.iter_mut().zip(&self.stretches) {
            *pixel *= share(stretch, number);
        }
    }

    /// Whether nothing behind a sheet shows at a pixel.
    pub fn ends_before(&self, pixel: usize, number: i32) -> bool {
        self.stretches[pixel].end <= f64::from(number)
    }

    /// The stretch that shows at a pixel, in sheets.
    pub fn stretch(&self, pixel: usize) -> &Range<f64> {
        &self.stretches[pixel]
    }

    /// The stretch of a sheet that shows at a pixel, in sheets.
    pub fn within(&self, pixel: usize, number: i32) -> Range<f64> {
        let stretch = self.stretch(pixel);
        stretch.start.max(f64::from(number))..stretch.end.min(f64::from(number) + 1.0)
    }
}

/// The depths at which a pixel shows something, from and to: what clip planes leave in front of opaque surfaces.
pub fn shown(geometry: &Geometry, surfaces: Option<&[f64]>, pixel: u32) -> Range<f64> {
    let width = geometry.size.x as u32;
    let mut depths = PixelRay::new(geometry, UVec2::new(pixel % width, pixel / width)).inside(&geometry.clip);
    if let Some(surfaces) = surfaces {
        depths.end = depths.end.min(surfaces[pixel as usize]);
    }
    depths
}

/// The part of a sheet that a stretch covers.
fn share(stretch: &Range<f64>, number: i32) -> f64 {
    let near = f64::from(number);
    (stretch.end.min(near + 1.0) - stretch.start.max(near)).max(0.0)
}

/// The ray of a pixel's centre, by its depth along w: positions in `unit`s from the volume's centre.
#[derive(Clone, Copy, Debug)]
pub struct PixelRay {
    /// Where the depth is 0.
    pub origin: DVec3,
    /// By one `unit` of depth.
    pub along: DVec3,
}

impl PixelRay {
    /// The ray of a pixel, counted from the upper left.
    pub fn new(geometry: &Geometry, pixel: UVec2) -> Self {
        let offset = pixel.as_dvec2() + 0.5 - geometry.size / 2.0;
        let across = offset.x * geometry.basis.u - offset.y * geometry.basis.v;
        match &geometry.eye {
            None => Self { origin: geometry.center + across * geometry.pix, along: geometry.basis.w },
            Some(eye) => Self { origin: eye.position, along: geometry.basis.w + across * eye.pixel_per_depth },
        }
    }

    /// The depths inside of all half spaces.
    pub fn inside(&self, half_spaces: &[HalfSpace]) -> Range<f64> {
        let mut depths = f64::NEG_INFINITY..f64::INFINITY;
        for HalfSpace { normal, offset } in half_spaces {
            let (at_origin, slope) = (normal.dot(self.origin) + offset, normal.dot(self.along));
            if slope > 0.0 {
                depths.start = depths.start.max(-at_origin / slope);
            } else if slope < 0.0 {
                depths.end = depths.end.min(-at_origin / slope);
            } else if at_origin < 0.0 {
                depths.end = f64::NEG_INFINITY;
            }
        }
        depths
    }

    /// Where sheets are at a depth: sheet k between k and k + 1.
    pub fn sheet(&self, geometry: &Geometry, depth: f64) -> f64 {
        let at = self.origin + depth * self.along;
        match (geometry.method, &geometry.eye) {
            (Method::ImageAligned, None) => (at / geometry.grid.aspect()).dot(geometry.ro) / geometry.slab_width,
            (Method::ImageAligned, Some(_)) => depth / geometry.slab_width,
            _ => {
                let (axis, sign) = geometry.slice_axis();
                sign * (at / geometry.grid.aspect() + geometry.grid.center())[axis] + 0.5
            }
        }
    }

    /// The depth of a place among sheets.
    pub fn depth(&self, geometry: &Geometry, sheet: f64) -> f64 {
        let at_origin = self.sheet(geometry, 0.0);
        (sheet - at_origin) / (self.sheet(geometry, 1.0) - at_origin)
    }

    /// A stretch of depths in sheets.
    fn sheets(&self, geometry: &Geometry, depths: Range<f64>) -> Range<f64> {
        if depths.is_empty() {
            return 0.0..0.0;
        }
        // Sheets are counted along w; a ray wide off the axis may meet slices the other way round, or stay in one.
        let slope = self.sheet(geometry, 1.0) - self.sheet(geometry, 0.0);
        if slope == 0.0 {
            return f64::NEG_INFINITY..f64::INFINITY;
        }
        let [a, b] = [depths.start, depths.end]
            .map(|depth| if depth.is_finite() { self.sheet(geometry, depth) } else { depth * slope });
        a.min(b)..a.max(b)
    }
}
