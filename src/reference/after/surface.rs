//! `surface` after splatting (SPEC §9): the pixel is opaque, with the shaded colour of the point, where `opacity·gradient_opacity` first
//! reaches one half along the ray. Values are linear along segments of slabs, gradients from plane to plane.

use std::cell::LazyCell;

use glam::{DVec3, DVec4};

use super::pixel::{Composited, Pixel, Slab};
use super::slab_integral::knots;
use crate::settings::transfer_function::Tables;

/// The opacity at a surface.
const HALF: f64 = 0.5;

/// The number of samples between control points, where the gradient's length makes the opacity nonlinear.
const SAMPLES: u32 = 32;

/// The number of bisections between the two samples around the surface.
const HALVINGS: u32 = 50;

/// The pixel of its first surface.
pub(super) fn composite(pixel: &Pixel) -> Composited {
    let mut near = None;
    for (first, k) in (0..).zip(pixel.slabs()) {
        if first == 0 {
            near = pixel.value(k);
        }
        let far = pixel.value(k + 1);
        if let Some(found) = Slab::new(k, near, far).and_then(|slab| in_slab(pixel, &slab)) {
            return found;
        }
        near = far;
    }
    Composited::new(DVec4::ZERO, None)
}

/// The surface within a slab.
fn in_slab(pixel: &Pixel, slab: &Slab) -> Option<Composited> {
    let first = f64::from(slab.number);
    let gradients = LazyCell::new(|| pixel.gradients(slab));
    let gradient = |t: f64| gradients[0].lerp(gradients[1], t);
    let own = pixel.slab_color(slab);
    let opacity = own.map_or(1.0, |own| own.w);
    for segment in pixel.segments(slab) {
        let value = |t: f64| {
            let ([start, end], [f0, f1]) = (segment.ends, segment.values);
            f0 + (f1 - f0) * ((t - start) / (end - start))
        };
        for [start, end] in cells(pixel, slab.number, segment.ends) {
            let tables = pixel.tables(first + (start + end) / 2.0);
            let line = Line { tables, values: [start, end].map(value), start, end, opacity };
            if let Some(t) = line.first_surface(&gradient) {
                let base = own.map_or_else(|| tables.color.at(value(t)), DVec4::truncate);
                let color = pixel.shaded(base, gradient(t), (slab.number, first + t)).extend(1.0);
                return Some(Composited::new(color, pixel.frame().host.first_hit.map(|_| first + t)));
            }
        }
    }
    None
}

/// The visible part of a stretch of a slab, whose places run from 0 at its near plane to 1 at its far plane, split where the ray passes from one voxel's cell
/// into another's if their labels may differ.
fn cells(pixel: &Pixel, slab: i32, ends: [f64; 2]) -> Vec<[f64; 2]> {
    let (shown, first) = (pixel.shown(slab), f64::from(slab));
    let (start, end) = (ends[0].max(shown.start - first), ends[1].min(shown.end - first));
    if start >= end {
        return Vec::new();
    }
    let mut cuts = vec![start, end];
    if pixel.frame().volume.labels().is_some() {
        let [from, to] = [start, end].map(|t| pixel.at(first + t) + 0.5);
        for axis in 0..3 {
            let (low, high) = (from[axis].min(to[axis]), from[axis].max(to[axis]));
            let borders = low.floor() as i64 + 1..high.ceil() as i64;
            let share = |border: i64| (border as f64 - from[axis]) / (to[axis] - from[axis]);
            cuts.extend(borders.map(|border| start + (end - start) * share(border)));
        }
        cuts.sort_by(f64::total_cmp);
    }
    cuts.windows(2).map(|pair| [pair[0], pair[1]]).filter(|[start, end]| start < end).collect()
}

/// Values that run linearly over a part of a slab to which one set of tables applies.
struct Line<'a> {
    tables: Tables<'a>,
    values: [f64; 2],
    /// The part's position in the slab.
    start: f64,
    end: f64,
    /// A of the slab's colour.
    opacity: f64,
}

impl Line<'_> {
    /// The first position in the slab with an opacity of one half.
    fn first_surface(&self, gradient: &impl Fn(f64) -> DVec3) -> Option<f64> {
        let tables = &self.tables;
        let [f0, f1] = self.values;
        let value = |s: f64| f0 + (f1 - f0) * s;
        let place = |s: f64| self.start + (self.end - self.start) * s;
        let knots = knots(tables, self.values);
        // Gradient opacity can only reduce the opacity.
        if !tables.visible || knots.iter().all(|&s| tables.opacity.at(value(s)) < HALF) {
            return None;
        }
        let factor =
            |s: f64| self.opacity * tables.gradient_opacity.map_or(1.0, |ramp| ramp.at(gradient(place(s)).length()));
        let samples = if tables.gradient_opacity.is_some() { SAMPLES } else { 1 };
        for piece in knots.windows(2) {
            let [low, high] = [piece[0], piece[1]];
            // Iso-ranges are closed, so a piece's first point may be visible although the piece is not.
            if self.shows_at(low, tables.exact(value(low), self.values), factor) {
                return Some(place(low));
            }
            if !tables.in_iso_range(value((low + high) / 2.0)) {
                continue;
            }
            let opacity = |s: f64| tables.opacity.at(value(s)) * factor(s);
            let at = |sample: u32| low + (high - low) * f64::from(sample) / f64::from(samples);
            if let Some(sample) = (1..=samples).find(|&sample| opacity(at(sample)) >= HALF) {
                let (mut below, mut above) = (at(sample - 1), at(sample));
                for _ in 0..HALVINGS {
                    let middle = (below + above) / 2.0;
                    if opacity(middle) >= HALF { above = middle } else { below = middle }
                }
                return Some(place(above));
            }
        }
        self.shows_at(1.0, f1, factor).then(|| place(1.0))
    }

    /// Whether a point with this value has an opacity of one half.
    fn shows_at(&self, s: f64, value: f64, factor: impl Fn(f64) -> f64) -> bool {
        let opacity = self.tables.opacity.at(value);
        opacity >= HALF && self.tables.in_iso_range(value) && opacity * factor(s) >= HALF
    }
}
