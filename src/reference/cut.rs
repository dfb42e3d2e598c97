//! Cuts: the part of a pixel's ray, and so of its sheets, that clip planes and a host's surfaces leave. The f64 evaluation of
//! `shaders/shared/cut.wgsl`.

use std::ops::Range;

use glam::{DVec3, UVec2};

use super::{Buffer, Geometry};
use crate::parallel::prelude::*;
use crate::settings::clip::HalfSpace;
use crate::settings::splatting::Method;

/// For every pixel, row by row, the visible stretch of its ray in sheets: sheet k fills `k..k + 1`. Empty if nothing is visible.
#[derive(Clone, Debug, PartialEq)]
pub struct Cuts {
    stretches: Vec<Range<f64>>,
}

impl Cuts {
    /// The stretches that clip planes leave in front of opaque surfaces, whose depths along w are given for every pixel, in `unit`s from the
    /// eye (orthographic: from the camera's centre).
    pub fn new(geometry: &Geometry, surfaces: Option<&[f64]>) -> Self {
        let width = geometry.size.x as u32;
        let pixels = (0..width * geometry.size.y as u32).into_par_iter();
        let stretch = |at: u32| {
            let ray = PixelRay::new(geometry, UVec2::new(at % width, at / width));
            ray.sheets(geometry, shown(geometry, surfaces, at))
        };
        Self { stretches: pixels.map(stretch).collect() }
    }

    /// Reduces every pixel of a sheet to its visible part.
    pub fn apply(&self, sheet: &mut Buffer, number: i32) {
        for (pixel, stretch) in sheet.pixels.iter_mut().zip(&self.stretches) {
            *pixel *= share(stretch, number);
        }
    }

    /// Whether everything behind a sheet is hidden at a pixel.
    pub fn ends_before(&self, pixel: usize, number: i32) -> bool {
        self.stretches[pixel].end <= f64::from(number)
    }

    /// The visible stretch at a pixel, in sheets.
    pub fn stretch(&self, pixel: usize) -> &Range<f64> {
        &self.stretches[pixel]
    }

    /// The visible stretch of one sheet at a pixel, in sheets.
    pub fn within(&self, pixel: usize, number: i32) -> Range<f64> {
        let stretch = self.stretch(pixel);
        stretch.start.max(f64::from(number))..stretch.end.min(f64::from(number) + 1.0)
    }
}

/// The range of depths that clip planes leave in front of opaque surfaces at a pixel.
pub fn shown(geometry: &Geometry, surfaces: Option<&[f64]>, pixel: u32) -> Range<f64> {
    let width = geometry.size.x as u32;
    let mut depths = PixelRay::new(geometry, UVec2::new(pixel % width, pixel / width)).inside(&geometry.clip);
    if let Some(surfaces) = surfaces {
        depths.end = depths.end.min(surfaces[pixel as usize]);
    }
    depths
}

/// The fraction of a sheet that a stretch covers.
fn share(stretch: &Range<f64>, number: i32) -> f64 {
    let near = f64::from(number);
    (stretch.end.min(near + 1.0) - stretch.start.max(near)).max(0.0)
}

/// The ray of a pixel's centre as a function of the depth along w: positions in `unit`s from the volume's centre.
#[derive(Clone, Copy, Debug)]
pub struct PixelRay {
    /// The position at depth 0.
    pub origin: DVec3,
    /// The change of position per `unit` of depth.
    pub along: DVec3,
}

impl PixelRay {
    /// The ray of the pixel at a position counted from the upper left.
    pub fn new(geometry: &Geometry, pixel: UVec2) -> Self {
        let offset = pixel.as_dvec2() + 0.5 - geometry.size / 2.0;
        let across = offset.x * geometry.basis.u - offset.y * geometry.basis.v;
        match &geometry.eye {
            None => Self { origin: geometry.center + across * geometry.pix, along: geometry.basis.w },
            Some(eye) => Self { origin: eye.position, along: geometry.basis.w + across * eye.pixel_per_depth },
        }
    }

    /// The range of depths inside all half spaces.
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

    /// The position in sheets at a depth: sheet k lies between k and k + 1.
    pub fn sheet(&self, geometry: &Geometry, depth: f64) -> f64 {
        let at = self.origin + depth * self.along;
        match (geometry.method, &geometry.eye) {
            (Method::ImageAligned, None) => geometry.orthographic_depth(at) / geometry.slab_width,
            (Method::ImageAligned, Some(_)) => depth / geometry.slab_width,
            _ => {
                let (axis, sign) = geometry.slice_axis();
                sign * (at / geometry.grid.aspect() + geometry.grid.center())[axis] + 0.5
            }
        }
    }

    /// The depth at a position in sheets.
    pub fn depth(&self, geometry: &Geometry, sheet: f64) -> f64 {
        let at_origin = self.sheet(geometry, 0.0);
        (sheet - at_origin) / (self.sheet(geometry, 1.0) - at_origin)
    }

    /// A range of depths, converted to sheets.
    fn sheets(&self, geometry: &Geometry, depths: Range<f64>) -> Range<f64> {
        if depths.is_empty() {
            return 0.0..0.0;
        }
        // Sheets are counted along w. A ray far off the axis may meet slices in reverse order, or stay within one.
        let slope = self.sheet(geometry, 1.0) - self.sheet(geometry, 0.0);
        if slope == 0.0 {
            return f64::NEG_INFINITY..f64::INFINITY;
        }
        let [a, b] = [depths.start, depths.end]
            .map(|depth| if depth.is_finite() { self.sheet(geometry, depth) } else { depth * slope });
        a.min(b)..a.max(b)
    }
}
