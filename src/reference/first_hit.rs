//! At which depth a pixel's opacity reaches a value; the twin of `shaders/first_hit.wgsl`.

use super::cut::PixelRay;
use super::{Buffer, Cuts, Geometry};
use glam::UVec2;

/// Of every pixel, row by row, where the opacity is reached, in sheets (number k fills `k..k + 1`).
pub(super) struct FirstHits {
    opacity: f64,
    sheets: Vec<Option<f64>>,
}

impl FirstHits {
    /// None yet; of no pixel, if no opacity is asked for.
    pub(super) fn new(opacity: Option<f64>, geometry: &Geometry) -> Self {
        let pixels = (geometry.size.x * geometry.size.y) as usize;
        Self { opacity: opacity.unwrap_or(0.0), sheets: vec![None; if opacity.is_some() { pixels } else { 0 }] }
    }

    /// Notes the pixels whose opacity one sheet raised to the value: there, if it grows evenly over what shows of the sheet.
    pub(super) fn note(&mut self, before: &Buffer, after: &Buffer, number: i32, cuts: Option<&Cuts>) {
        for (pixel, hit) in self.sheets.iter_mut().enumerate().filter(|(_, hit)| hit.is_none()) {
            let [before, after] = [before, after].map(|acc| acc.pixels[pixel].w);
            if after >= self.opacity {
                let whole = f64::from(number)..f64::from(number) + 1.0;
                let shown = cuts.map_or(whole, |cuts| cuts.within(pixel, number));
                *hit = Some(shown.start + (shown.end - shown.start) * (self.opacity - before) / (after - before));
            }
        }
    }

    /// Depths along w, `unit`s; infinite where the opacity is not reached.
    pub(super) fn depths(&self, geometry: &Geometry) -> Vec<f64> {
        let width = geometry.size.x as usize;
        let depth = |(pixel, sheet): (usize, &Option<f64>)| {
            let ray = PixelRay::new(geometry, UVec2::new((pixel % width) as u32, (pixel / width) as u32));
            sheet.map_or(f64::INFINITY, |sheet| ray.depth(geometry, sheet))
        };
        self.sheets.iter().enumerate().map(depth).collect()
    }
}
