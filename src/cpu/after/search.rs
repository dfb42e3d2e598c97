//! The greatest or least value of each pixel's ray (SPEC §9), of a volume in memory, without most of the others: values whose bounds show that they
//! are not chosen are left out, and the choice is the one among all.
//!
//! A value's bound is that of the bricks' coefficients around its point. Along the rays of eight pixels values are computed in the order of their
//! bounds, until the bounds of all others are no greater than what was found. The rule by which a value is chosen from the nearest to the
//! farthest, "greater than the last choice by more than a hair", is then proved for the choice by bounds; where it is not, more values are computed.

use std::ops::Range;

use fearless_simd::f32x8;
use fearless_simd::prelude::*;

use super::classify::Looks;
use super::extreme::Chosen;
use super::frame::Frame;
use super::low_pass::LowPass;
use super::planes::{Plane, Points};
use crate::after::brick_ranges::BrickRanges;
use crate::cpu::count::bits;
use crate::cpu::cull::OpenMask;
use crate::cpu::sheets::{COLUMNS, ROWS};
use crate::cpu::vector::LANES;

/// Rounding errors of means, relative to the numbers' range, which is about 1.
const SLACK: f32 = 3e-6;

/// A plane and eight pixels' points on it.
#[derive(Clone, Copy, Debug)]
struct Visit {
    /// Values that are known, and bounds of the others; of minima their negatives.
    most: [f32; LANES],
    /// The pixels whose stretches hold their points.
    counted: u32,
    /// The pixels whose values are known.
    known: u32,
    /// The greatest of the bounds; -∞ once the plane has been visited.
    bound: f32,
}

/// The memory of a search through a tile.
#[derive(Debug)]
pub(super) struct Search {
    /// The points of the tile's planes, from the first one on.
    first: i32,
    points: Vec<Option<(Points, LowPass)>>,
    visits: Vec<Visit>,
    plane: Plane,
    /// The bricks that no tile had looked at before.
    pub(super) bricks: u64,
}

/// Eight pixels' choices, as indices of visits; `None` where no value is known.
type Choices = [Option<usize>; LANES];

impl Search {
    pub(super) fn new(has_colors: bool) -> Self {
        Self { first: 0, points: Vec::new(), visits: Vec::new(), plane: Plane::new(has_colors), bricks: 0 }
    }

    /// Finds the values that a tile's open pixels choose; without bounds by looking at all.
    #[inline(always)]
    pub(super) fn choose<S: Simd>(
        &mut self,
        simd: S,
        frame: &Frame<'_>,
        looks: &Looks<'_>,
        open: &OpenMask,
        bounds: Option<&BrickRanges>,
        chosen: &mut Chosen,
    ) {
        self.points.clear();
        self.bricks = 0;
        for row in 0..ROWS {
            for column in (0..COLUMNS).step_by(LANES) {
                let at = [column, row];
                let [starts, ends] = looks.stretch(simd, at);
                let lanes = starts.simd_lt(ends).to_bitmask() as u32 & (open.row(row) >> column) & 0xff;
                if lanes == 0 {
                    continue;
                }
                let (starts, ends) = (starts.to_array(), ends.to_array());
                let planes = frame
                    .planes_within(looks, bits(lanes.into()).map(|lane| [starts[lane as usize], ends[lane as usize]]));
                self.reach(frame, looks, &planes);
                match bounds {
                    None => planes.for_each(|plane| self.look(simd, frame, looks, (plane, lanes), at, chosen)),
                    Some(bounds) => self.choose_bounded(simd, frame, looks, bounds, (planes, lanes), at, chosen),
                }
                for lane in bits(u64::from(lanes & !chosen.are_chosen(simd, at))) {
                    let middle = (starts[lane as usize] + ends[lane as usize]) * 0.5;
                    let slab = looks.rays.slab(middle.floor()) as i32;
                    self.reach(frame, looks, &(slab..slab + 2));
                    for plane in [slab, slab + 1] {
                        self.look(simd, frame, looks, (plane, 1 << lane), at, chosen);
                    }
                }
            }
        }
    }

    /// Finds the points of planes unless they are known.
    fn reach(&mut self, frame: &Frame<'_>, looks: &Looks<'_>, planes: &Range<i32>) {
        if planes.is_empty() {
            return;
        }
        let of = |plane: i32| frame.points(plane, looks.origin);
        let end = self.first.saturating_add(self.points.len() as i32);
        if self.points.is_empty() {
            (self.first, self.points) = (planes.start, planes.clone().map(of).collect());
            return;
        }
        if planes.start < self.first {
            self.points.splice(0..0, (planes.start..self.first).map(of));
            self.first = planes.start;
        }
        self.points.extend((end..planes.end).map(of));
    }

    /// Looks at the points of a plane as [`Frame::choose`] does.
    // Not inlined, so that it is compiled once for every instruction set.
    #[inline(never)]
    fn look<S: Simd>(
        &mut self,
        simd: S,
        frame: &Frame<'_>,
        looks: &Looks<'_>,
        (number, lanes): (i32, u32),
        at: [usize; 2],
        chosen: &mut Chosen,
    ) {
        self.become_plane(number);
        self.bricks += frame.draw_bricks(simd, &self.plane, lanes, at);
        simd.vectorize(
            #[inline(always)]
            || frame.choose_from(simd, looks, &mut self.plane, lanes, at, chosen),
        );
    }

    fn become_plane(&mut self, number: i32) {
        self.plane.become_plane(number, self.points[(number - self.first) as usize]);
    }

    /// Finds the choices of eight pixels by bounds.
    // Not inlined, so that it is compiled once for every instruction set.
    #[inline(never)]
    #[expect(clippy::too_many_arguments, reason = "the parts of a tile's state")]
    fn choose_bounded<S: Simd>(
        &mut self,
        simd: S,
        frame: &Frame<'_>,
        looks: &Looks<'_>,
        bounds: &BrickRanges,
        (planes, lanes): (Range<i32>, u32),
        at: [usize; 2],
        chosen: &mut Chosen,
    ) {
        simd.vectorize(
            #[inline(always)]
            || {
                self.bound(simd, frame, looks, bounds, (&planes, lanes), at);
                self.visit_greatest(simd, frame, planes.start, lanes, at);
                let mut choices = self.choices(frame);
                while let Some((visit, lanes)) = self.doubtful(frame, &choices) {
                    self.visit(simd, frame, (planes.start, visit), lanes, at);
                    choices = self.choices(frame);
                }
                for (lane, choice) in choices.iter().enumerate() {
                    let Some(visit) = choice.filter(|visit| !choices[..lane].contains(&Some(*visit))) else { continue };
                    let same = choices.iter().enumerate().filter(|(_, other)| **other == Some(visit));
                    let lanes = same.fold(0, |lanes, (lane, _)| lanes | 1 << lane);
                    self.look(simd, frame, looks, (planes.start + visit as i32, lanes), at, chosen);
                }
            },
        );
    }

    /// Bounds the values of eight pixels on planes.
    #[inline(always)]
    fn bound<S: Simd>(
        &mut self,
        simd: S,
        frame: &Frame<'_>,
        looks: &Looks<'_>,
        bounds: &BrickRanges,
        (planes, lanes): (&Range<i32>, u32),
        at: [usize; 2],
    ) {
        let [starts, ends] = looks.stretch(simd, at);
        self.visits.clear();
        for number in planes.clone() {
            let here = f32x8::splat(simd, looks.rays.begin(number));
            let mut counted = (starts.simd_le(here) & here.simd_le(ends)).to_bitmask() as u32 & lanes;
            let mut most = [f32::NEG_INFINITY; LANES];
            match &self.points[(number - self.first) as usize] {
                Some((points, _)) if counted != 0 => {
                    let cells = points.eight(simd, &frame.field.extent, [0, 0], at).cells;
                    most = std::array::from_fn(|lane| frame.most(bounds.at(cells.map(|axis| axis[lane] as u32))));
                }
                _ => counted = 0,
            }
            let bound = bits(counted.into()).fold(f32::NEG_INFINITY, |most_of, lane| most_of.max(most[lane as usize]));
            self.visits.push(Visit { most, counted, known: 0, bound });
        }
    }

    /// Computes values in the order of their bounds, until no other's is greater than those found by more than a hair.
    #[inline(always)]
    fn visit_greatest<S: Simd>(&mut self, simd: S, frame: &Frame<'_>, first: i32, lanes: u32, at: [usize; 2]) {
        let counted = self.visits.iter().fold(0, |counted, visit| counted | visit.counted) & lanes;
        let mut best: [f32; LANES] =
            std::array::from_fn(|lane| if counted >> lane & 1 == 1 { f32::NEG_INFINITY } else { f32::INFINITY });
        loop {
            let mut next = (f32::NEG_INFINITY, 0);
            for (number, visit) in self.visits.iter().enumerate() {
                next = if visit.bound > next.0 { (visit.bound, number) } else { next };
            }
            let (bound, visit) = next;
            let least = best.iter().fold(f32::INFINITY, |least, &best| least.min(best));
            if bound == f32::NEG_INFINITY || bound <= least + frame.hair {
                return;
            }
            self.visits[visit].bound = f32::NEG_INFINITY;
            let Visit { most, counted, .. } = self.visits[visit];
            let wanted = (0..LANES).filter(|&lane| most[lane] > best[lane] + frame.hair);
            let wanted = wanted.fold(0, |lanes, lane| lanes | 1 << lane) & counted;
            self.visit(simd, frame, (first, visit), wanted, at);
            let Visit { most, .. } = &self.visits[visit];
            bits(wanted.into()).for_each(|lane| best[lane as usize] = best[lane as usize].max(most[lane as usize]));
        }
    }

    /// Computes the values of some of eight pixels on a plane.
    #[inline(always)]
    fn visit<S: Simd>(&mut self, simd: S, frame: &Frame<'_>, (first, visit): (i32, usize), lanes: u32, at: [usize; 2]) {
        if lanes == 0 {
            return;
        }
        self.become_plane(first + visit as i32);
        self.bricks += frame.draw_bricks(simd, &self.plane, lanes, at);
        frame.find_values(simd, &mut self.plane, lanes, at);
        let (values, visit) = (&self.plane.rows[at[1]].values[at[0]..], &mut self.visits[visit]);
        visit.known |= lanes;
        for lane in bits(lanes.into()) {
            let value = values[lane as usize];
            // Where there is no value none is chosen.
            visit.most[lane as usize] = if value.is_nan() { f32::NEG_INFINITY } else { frame.sign() * value };
        }
    }

    /// The choices of eight pixels from the values that are known.
    #[inline(always)]
    fn choices(&self, frame: &Frame<'_>) -> Choices {
        let mut choices = [None; LANES];
        let mut best = [f32::NEG_INFINITY; LANES];
        for (number, visit) in self.visits.iter().enumerate().filter(|(_, visit)| visit.known != 0) {
            for lane in bits(visit.known.into()).map(|lane| lane as usize) {
                if visit.most[lane] > best[lane] + frame.hair {
                    (best[lane], choices[lane]) = (visit.most[lane], Some(number));
                }
            }
        }
        choices
    }

    /// The visit with the greatest bound of those whose values may change the choices, and the pixels whose choices they may change. A choice stands if
    /// it is greater than all nearer values by more than a hair, and none behind it is greater than it by more than that.
    #[inline(always)]
    fn doubtful(&self, frame: &Frame<'_>, choices: &Choices) -> Option<(usize, u32)> {
        let hair = frame.hair;
        let chosen = choices.map(|choice| choice.map_or(usize::MAX, |visit| visit));
        let best: [f32; LANES] = std::array::from_fn(|lane| match choices[lane] {
            Some(visit) => self.visits[visit].most[lane],
            None => f32::NEG_INFINITY,
        });
        let mut chained = 0;
        for (number, visit) in self.visits.iter().enumerate().filter(|(_, visit)| visit.known != 0) {
            let close = |&lane: &usize| number < chosen[lane] && visit.most[lane] + hair >= best[lane];
            chained |=
                bits(visit.known.into()).map(|lane| lane as usize).filter(close).fold(0, |all, lane| all | 1 << lane);
        }
        let mut found = None;
        let mut greatest = f32::NEG_INFINITY;
        for (number, visit) in self.visits.iter().enumerate() {
            let mut lanes = 0_u32;
            for lane in 0..LANES {
                let most = visit.most[lane];
                let is_doubtful = match number < chosen[lane] {
                    true => chained >> lane & 1 == 1 || most + hair >= best[lane],
                    false => most > best[lane] + hair,
                };
                lanes |= u32::from(is_doubtful) << lane;
            }
            lanes &= visit.counted & !visit.known;
            let bound = bits(lanes.into()).fold(f32::NEG_INFINITY, |bound, lane| bound.max(visit.most[lane as usize]));
            if lanes != 0 && (found.is_none() || bound > greatest) {
                (found, greatest) = (Some((number, lanes)), bound);
            }
        }
        found
    }
}

impl Frame<'_> {
    /// The planes, of those that are drawn, within any of some stretches of rays.
    fn planes_within(&self, looks: &Looks<'_>, stretches: impl Iterator<Item = [f32; 2]>) -> Range<i32> {
        let all =
            stretches.fold([f32::INFINITY, f32::NEG_INFINITY], |all, one| [all[0].min(one[0]), all[1].max(one[1])]);
        let [first, last] = all.map(|end| looks.rays.slab(end));
        (first.ceil() as i32).max(self.slabs.start)..(last.floor() as i32).saturating_add(1).min(self.slabs.end)
    }

    /// 1, or of minima -1.
    fn sign(&self) -> f32 {
        if self.compositing.keeps_least() { -1.0 } else { 1.0 }
    }

    /// The greatest number of values within a range, or of minima the negative of the least, rounded up.
    #[inline(always)]
    fn most(&self, [min, max]: [f32; 2]) -> f32 {
        let extreme = if self.compositing.keeps_least() { min } else { max };
        self.sign() * self.field.number(extreme) + SLACK
    }

    /// Records that the bricks of some of eight points of a plane are drawn. Returns how many were not before.
    #[inline(always)]
    fn draw_bricks<S: Simd>(&self, simd: S, plane: &Plane, lanes: u32, at: [usize; 2]) -> u64 {
        let Some((points, _)) = &plane.points else { return 0 };
        let cells = points.eight(simd, &self.field.extent, [0, 0], at).cells;
        let brick = |lane: u32| self.placement.brick_of(cells.map(|axis| axis[lane as usize] as u32));
        bits(lanes.into()).map(|lane| u64::from(self.draw_brick(brick(lane)))).sum()
    }
}
