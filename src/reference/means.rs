//! The weights of sheets in compositing by means ([`Compositing`]): the f64 evaluation of `shaders/shared/means.wgsl`.

use std::ops::{Range, RangeInclusive};

use glam::{DVec3, UVec2};

use super::cut::{self, PixelRay};
use super::{Buffer, Geometry};
use crate::parallel::prelude::*;
use crate::settings::clip::HalfSpace;
use crate::settings::splatting::Compositing;

/// The tolerance for slabs' middles, in slabs, and for rays beside a box of voxel centres, in grid steps.
const HAIR: f64 = 0.01;

/// For every pixel, row by row, the weight of sheets and which of them count.
#[derive(Clone, Debug, PartialEq)]
pub struct Means {
    /// The factor for sheets.
    weights: Vec<f64>,
    /// The range of middles of the slabs that count, in sheets (sheet k fills `k..k + 1`); only for `Minimum`.
    counted: Option<Vec<RangeInclusive<f64>>>,
}

impl Means {
    /// The weights for compositing by means over what clip planes and opaque surfaces leave; see [`Cuts::new`](super::Cuts::new).
    pub fn new(geometry: &Geometry, compositing: Compositing, surfaces: Option<&[f64]>) -> Self {
        let width = geometry.size.x as u32;
        let pixels = 0..width * geometry.size.y as u32;
        let ray = |at: u32| PixelRay::new(geometry, UVec2::new(at % width, at / width));
        let near = geometry.eye.map_or(f64::NEG_INFINITY, |eye| eye.near);
        let in_box = |at: u32, half_steps: DVec3, nearest: f64| {
            let inside = ray(at).inside(&volume_box(geometry, half_steps));
            inside.start.max(nearest)..inside.end
        };
        let shown = |at: u32, inside: Range<f64>| {
            let shown = cut::shown(geometry, surfaces, at);
            inside.start.max(shown.start)..inside.end.min(shown.end)
        };
        let (_, centers) = geometry.grid.whole();
        let weight = |at: u32| {
            let ray = ray(at);
            if !compositing.is_average() {
                let sheets_per_depth = ray.sheet(geometry, 1.0) - ray.sheet(geometry, 0.0);
                return sheets_per_depth.abs() / ray.along.length();
            }
            let depths = shown(at, in_box(at, centers + 0.5, near));
            let misses = in_box(at, centers + HAIR, near).is_empty() || depths.is_empty();
            if misses { 0.0 } else { 1.0 / ((depths.end - depths.start) * ray.along.length()) }
        };
        // The maximum depth by which a kernel reaches beyond a voxel at the near plane.
        let reach = geometry.radius * (geometry.basis.w * geometry.grid.aspect()).length();
        let complete = (centers - geometry.radius).max(centers / 2.0) + HAIR;
        let counted = |at: u32| {
            let ray = ray(at);
            let depths = shown(at, in_box(at, complete, near + reach));
            if depths.is_empty() {
                return f64::INFINITY..=f64::NEG_INFINITY;
            }
            let [a, b] = [depths.start, depths.end].map(|depth| ray.sheet(geometry, depth));
            let middle = (a + b) / 2.0;
            a.min(b).min(middle - 0.5) - HAIR..=a.max(b).max(middle + 0.5) + HAIR
        };
        Self {
            weights: pixels.clone().into_par_iter().map(weight).collect(),
            counted: (compositing.keeps_least()).then(|| pixels.into_par_iter().map(counted).collect()),
        }
    }

    /// The sheets that count at any pixel, even if they are empty.
    pub fn sheets(&self) -> Range<i32> {
        let counted = || self.counted.iter().flatten().filter(|counted| !counted.is_empty());
        let first = counted().map(|counted| *counted.start()).fold(f64::INFINITY, f64::min);
        let last = counted().map(|counted| *counted.end()).fold(f64::NEG_INFINITY, f64::max);
        if first > last { 0..0 } else { (first - 0.5).ceil() as i32..(last + 0.5).floor() as i32 }
    }

    /// Converts a sheet into its means.
    pub fn apply(&self, sheet: &mut Buffer) {
        sheet.pixels.iter_mut().zip(&self.weights).for_each(|(pixel, weight)| *pixel *= *weight);
    }

    /// Whether a sheet counts at a pixel.
    pub fn counts(&self, pixel: usize, number: i32) -> bool {
        self.counted.as_ref().is_none_or(|counted| counted[pixel].contains(&(f64::from(number) + 0.5)))
    }
}

/// A box around the centre of the volume, of which the grid may be a part, given half its size.
pub(super) fn volume_box(geometry: &Geometry, half_steps: DVec3) -> [HalfSpace; 6] {
    let (center, _) = geometry.grid.whole();
    HalfSpace::around(center, half_steps, &geometry.grid)
}
