//! `surface` after splatting (SPEC §9): where along a ray `opacity·gradient_opacity` first reaches one half, the pixel is opaque and has that
//! point's shaded colour. Values are linear along segments of slabs, gradients from plane to plane.

use fearless_simd::f32x8;
use fearless_simd::prelude::*;
use glam::DVec3;

use super::classify::{Looks, Slab};
use super::frame::Frame;
use super::planes::Plane;
use crate::cpu::shade;
use crate::cpu::sheets::Buffers;
use crate::cpu::vector::{LANES, mask};
use crate::settings::transfer_function::Tables;

/// The opacity of a surface.
const HALF: f64 = 0.5;

/// Samples of a stretch over which values cross no control point, where the gradient's length bends the opacity.
const SAMPLES: u32 = 32;

/// Halvings of the stretch between two samples that holds the surface.
const HALVINGS: u32 = 30;

/// A pixel's line through a segment of a slab, where one set of tables holds. Places are shares of the slab.
#[derive(Clone, Copy)]
struct Line<'a> {
    tables: Tables<'a>,
    /// The segment's ends, and the values there.
    segment: [f64; 2],
    values: [f64; 2],
    /// The gradients at the slab's planes.
    gradients: [DVec3; 2],
    /// From where to where.
    ends: [f64; 2],
    /// A of the slab's colour.
    own: f64,
}

impl Frame<'_> {
    /// Looks for the surfaces of eight pixels in a slab; which of them have one.
    #[inline(always)]
    pub(super) fn find_surfaces<S: Simd>(
        &self,
        simd: S,
        slab: &Slab<S>,
        looks: &Looks<'_>,
        planes: &mut [Plane; 2],
        [column, row]: [usize; 2],
        buffers: &mut Buffers,
    ) -> u32 {
        let stretch = looks.stretch(simd, [column, row]);
        let begin = looks.rays.begin(slab.number);
        let [starts, ends] = stretch.map(|end| (end - begin).to_array());
        let numbers = slab.values.map(f32x8::to_array);
        let lines = self.gradients(simd, slab, slab.lanes, planes, [column, row]);
        let gradients = lines.map(|gradient| gradient.map(f32x8::to_array));
        let own = self.slab_colors(simd, slab, slab.lanes, planes, [column, row]);
        let own = own.map(|own| own.map(f32x8::to_array));
        let middles = match self.segments {
            1 => [0.0; LANES],
            _ => {
                let amount = self.means(simd, slab, looks, [column, row]).amount;
                self.middle(simd, (slab.values, amount), &lines, looks, [column, row]).to_array()
            }
        };
        let (mut found, mut places, mut colors) = (0, [0.0; LANES], [[0.0; LANES]; 3]);
        for lane in (0..LANES).filter(|lane| slab.lanes >> lane & 1 == 1) {
            let [start, end] = [starts[lane].max(0.0), ends[lane].min(1.0)].map(f64::from);
            let [f0, f1] = numbers.map(|numbers| self.value(numbers[lane]));
            let gradients = gradients.map(|[x, y, z]| {
                let per_world = f64::from(self.per_number) / self.field.gradient_length;
                DVec3::new(x[lane].into(), y[lane].into(), z[lane].into()) * per_world
            });
            let at = [looks.origin[0] + column + lane, looks.origin[1] + row];
            let middle = self.value(middles[lane]);
            let halves = [([0.0, 0.5], [f0, middle]), ([0.5, 1.0], [middle, f1])];
            let segments = if self.segments > 1 { &halves[..] } else { &[([0.0, 1.0], [f0, f1])] };
            let own_alpha = own.map_or(1.0, |[.., alpha]| alpha[lane].into());
            let surface = segments.iter().find_map(|&(segment, values)| {
                let part = [start.max(segment[0]), end.min(segment[1])];
                self.pieces(at, f64::from(slab.number), part).into_iter().find_map(|ends| {
                    let middle = f64::from(slab.number) + (ends[0] + ends[1]) / 2.0;
                    let label = if self.labels { self.label(at, 0, middle) } else { None };
                    let tables = self.transfer.tables(label);
                    let line = Line { tables, segment, values, gradients, ends, own: own_alpha };
                    line.first_surface().map(|place| (line, place))
                })
            });
            if let Some((line, place)) = surface {
                let color = line.tables.color.at(line.value(place));
                (0..3).for_each(|channel| {
                    colors[channel][lane] = own.map_or(color[channel] as f32, |own| own[channel][lane]);
                });
                places[lane] = place as f32;
                found |= 1 << lane;
            }
        }
        if found == 0 {
            return 0;
        }
        let place = f32x8::load_array(simd, places);
        let [near, far] = lines;
        let gradient = std::array::from_fn(|axis| near[axis] + (far[axis] - near[axis]) * place);
        let color = colors.each_ref().map(|channel| f32x8::load_array_ref(simd, channel));
        let left = self.left_between(simd, found, (looks, planes), [column, row], place);
        let shaded = self.shaded(simd, color, gradient, looks.to_eye(simd, self, [column, row]), left);
        let faces = looks.faces(found, [column, row], |_| slab.number);
        let [red, green, blue] = shade::select(mask(simd, faces), color, shaded);
        let is_found = mask(simd, found);
        let put = |pixels: &mut [f32], new: f32x8<S>| {
            let old = f32x8::from_slice(simd, pixels);
            is_found.select(new, old).store_slice(pixels);
        };
        for (channel, new) in buffers.acc[row].iter_mut().zip([red, green, blue, f32x8::splat(simd, 1.0)]) {
            put(&mut channel[column..column + LANES], new);
        }
        put(&mut buffers.hits[row][column..column + LANES], place + begin);
        found
    }

    /// A stretch within a slab, cut where the ray passes from one voxel's cell into another's if their labels may differ.
    fn pieces(&self, pixel: [usize; 2], slab: f64, [start, end]: [f64; 2]) -> Vec<[f64; 2]> {
        // The stretch of a ray that shows nothing ends at negative infinity.
        if start >= end {
            return Vec::new();
        }
        let mut cuts = vec![start, end];
        if self.labels {
            let [from, to] = [start, end].map(|share| self.voxel_at(pixel, slab + share) + 0.5);
            for axis in 0..3 {
                let (low, high) = if from[axis] < to[axis] { (from[axis], to[axis]) } else { (to[axis], from[axis]) };
                let borders = low.floor() as i64 + 1..high.ceil() as i64;
                let share = |border: i64| (border as f64 - from[axis]) / (to[axis] - from[axis]);
                cuts.extend(borders.map(|border| start + (end - start) * share(border)));
            }
            cuts.sort_by(f64::total_cmp);
        }
        cuts.windows(2).map(|pair| [pair[0], pair[1]]).filter(|[start, end]| start < end).collect()
    }
}

impl Line<'_> {
    fn value(&self, place: f64) -> f64 {
        let [start, end] = self.segment;
        self.values[0] + (self.values[1] - self.values[0]) * ((place - start) / (end - start))
    }

    /// The opacity at a place, whatever the iso-ranges.
    fn opacity(&self, place: f64) -> f64 {
        let factor = self
            .tables
            .gradient_opacity
            .map_or(1.0, |ramp| ramp.at(self.gradients[0].lerp(self.gradients[1], place).length()));
        self.tables.opacity.at(self.value(place)) * factor * self.own
    }

    fn shows(&self, place: f64) -> bool {
        self.tables.in_iso_range(self.tables.exact(self.value(place), self.values)) && self.opacity(place) >= HALF
    }

    /// The places between which the opacity's ramp has no kink and no iso-range ends, with both ends.
    fn knots(&self) -> Vec<f64> {
        let [f0, f1] = self.values;
        let ([start, end], [from, to]) = (self.ends, self.segment);
        let iso_ranges = self.tables.iso_ranges.iter().flat_map(|ranges| ranges.iter().flatten().copied());
        let values = self.tables.opacity.points().iter().map(|point| point.0).chain(iso_ranges);
        let places = values
            .map(|value| from + (to - from) * ((value - f0) / (f1 - f0)))
            .filter(|&place| start < place && place < end);
        let mut knots: Vec<f64> = places.chain([start, end]).collect();
        knots.sort_by(f64::total_cmp);
        knots
    }

    /// The first place with an opacity of one half.
    fn first_surface(&self) -> Option<f64> {
        if !self.tables.visible {
            return None;
        }
        let knots = self.knots();
        let samples = if self.tables.gradient_opacity.is_some() { SAMPLES } else { 1 };
        for piece in knots.windows(2) {
            let [low, high] = [piece[0], piece[1]];
            // The ends of iso-ranges belong to them, so a piece's first point may show where the piece does not.
            if self.shows(low) {
                return Some(low);
            }
            if !self.tables.in_iso_range(self.value((low + high) / 2.0)) {
                continue;
            }
            let at = |sample: u32| low + (high - low) * f64::from(sample) / f64::from(samples);
            if let Some(sample) = (1..=samples).find(|&sample| self.opacity(at(sample)) >= HALF) {
                let (mut below, mut above) = (at(sample - 1), at(sample));
                for _ in 0..HALVINGS {
                    let middle = (below + above) / 2.0;
                    if self.opacity(middle) >= HALF { above = middle } else { below = middle }
                }
                return Some(above);
            }
        }
        knots.last().copied().filter(|&last| self.shows(last))
    }
}
