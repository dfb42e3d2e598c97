//! The depth at which a pixel's opacity reaches a value: the f64 evaluation of `shaders/first_hit.wgsl`.

use glam::UVec2;

use super::composite::crossing;
use super::cut::PixelRay;
use super::{Buffer, Cuts, Geometry};
use crate::settings::splatting::Compositing;

/// For every pixel, row by row, the position in sheets at which the opacity is reached (sheet k fills `k..k + 1`).
pub(super) struct FirstHits {
    opacity: f64,
    compositing: Compositing,
    sheets: Vec<Option<f64>>,
}

impl FirstHits {
    /// No pixel has reached the opacity yet.
    pub(super) fn new(opacity: f64, compositing: Compositing, geometry: &Geometry) -> Self {
        let pixels = (geometry.size.x * geometry.size.y) as usize;
        Self { opacity, compositing, sheets: vec![None; pixels] }
    }

    /// Notes the pixels in which one sheet raised the opacity to the value: the position is interpolated linearly within the sheet's visible
    /// part. For a surface it is the surface's own.
    pub(super) fn note(&mut self, before: &Buffer, sheet: &Buffer, after: &Buffer, number: i32, cuts: Option<&Cuts>) {
        let is_surface = self.compositing.has_surface();
        let opacity = if is_surface { 1.0 } else { self.opacity };
        for (pixel, hit) in self.sheets.iter_mut().enumerate().filter(|(_, hit)| hit.is_none()) {
            let [before, sheet, after] = [before, sheet, after].map(|buffer| buffer.pixels[pixel]);
            if after.w < opacity {
                continue;
            }
            let whole = f64::from(number)..f64::from(number) + 1.0;
            let shown = cuts.map_or(whole, |cuts| cuts.within(pixel, number));
            *hit = Some(if is_surface {
                let at = f64::from(number) - 0.5 + crossing(before, sheet);
                cuts.map_or(at, |cuts| at.max(cuts.stretch(pixel).start).min(cuts.stretch(pixel).end))
            } else {
                shown.start + (shown.end - shown.start) * (opacity - before.w) / (after.w - before.w)
            });
        }
    }

    /// The depths along w in `unit`s; infinite where the opacity is not reached.
    pub(super) fn depths(&self, geometry: &Geometry) -> Vec<f64> {
        let width = geometry.size.x as usize;
        let depth = |(pixel, sheet): (usize, &Option<f64>)| {
            let ray = PixelRay::new(geometry, UVec2::new((pixel % width) as u32, (pixel / width) as u32));
            sheet.map_or(f64::INFINITY, |sheet| ray.depth(geometry, sheet))
        };
        self.sheets.iter().enumerate().map(depth).collect()
    }
}
