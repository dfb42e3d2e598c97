//! A plain evaluation of the rules of culling (§6): the bricks and voxels that a sheet group visits and draws, and what is known of them afterwards.

use std::collections::BTreeSet;

use glam::{DVec2, DVec3, DVec4, UVec3};
use sheetsplat::internals::brick::{self, BRICK_VOXELS};
use sheetsplat::internals::gpu::layout::{Brick, Frame, SheetGroup};
use sheetsplat::internals::kernel::Kernel;
use sheetsplat::internals::quad_plan::{TILE, tile_grid};
use sheetsplat::internals::reference::{self, Geometry};
use sheetsplat::internals::view_geometry::ViewGeometry;
use sheetsplat::settings::{Method, Order};
use sheetsplat::volume::Grid;

use super::{ABSENT, Groups, indices};
use crate::common::{F32, Random};

/// An upper bound on the f32 errors of pixel coordinates and depths in these tests: sums of numbers below 600. Close to an eye pixel
/// coordinates are large, and so are their errors.
const EPSILON: f64 = 5e-4;

/// Decisions that f32 arithmetic makes like f64; those that it may make differently are noted.
struct Decisions {
    unsure: bool,
    /// The f32 error of pixel coordinates.
    pixels: f64,
}

impl Decisions {
    pub(super) fn new(pixels: f64) -> Self {
        Self { unsure: false, pixels: pixels.max(EPSILON) }
    }

    fn at_least(&mut self, a: f64, b: f64, epsilon: f64) -> bool {
        self.unsure |= (a - b).abs() < epsilon;
        a >= b
    }

    /// `x` between 0 and `last`, rounded down.
    fn floor(&mut self, x: f64, last: f64, epsilon: f64) -> u32 {
        let [low, floor, high] = [x - epsilon, x, x + epsilon].map(|x| x.clamp(0.0, last).floor());
        self.unsure |= low != high;
        floor as u32
    }

    /// `x` between 0 and `last`, rounded up.
    fn ceil(&mut self, x: f64, last: f64) -> u32 {
        last as u32 - self.floor(last - x, last, self.pixels)
    }

    /// The first and last pixel from which the box filter covers the boxes of footprints with centres from `low` to `high`.
    fn filter(&mut self, size: [u32; 2], group: &SheetGroup, low: DVec2, high: DVec2) -> [[u32; 2]; 2] {
        // Pixel centres are at half-integers; the shader adds its slack.
        let margin = half_box(group) + 0.01;
        let (low, high) = ((low - margin - 0.5).to_array(), (high + margin - 0.5).to_array());
        let axes = [0, 1].map(|axis| {
            let last = f64::from(size[axis] - 1);
            let first = self.ceil(low[axis], last);
            [first, self.floor(high[axis] - f64::from(group.box_filter[axis]), last, self.pixels).max(first)]
        });
        [[axes[0][0], axes[1][0]], [axes[0][1], axes[1][1]]]
    }

    fn pixel(&mut self, center: DVec2, size: [u32; 2]) -> [u32; 2] {
        [0, 1].map(|axis| self.floor(center[axis], f64::from(size[axis] - 1), self.pixels))
    }
}

fn half_box(group: &SheetGroup) -> DVec2 {
    DVec2::from(group.half_box.map(f64::from))
}

/// An image's occlusion buffer, as a set of hidden boxes.
#[derive(Clone)]
pub(super) struct Occluded {
    pub(super) size: [u32; 2],
    pub(super) bits: Vec<bool>,
}

impl Occluded {
    fn at(&self, [x, y]: [u32; 2]) -> bool {
        self.bits[(y * self.size[0] + x) as usize]
    }

    pub(super) fn words(&self) -> Vec<u32> {
        let columns = tile_grid(self.size)[0];
        (0..self.size[1])
            .flat_map(|y| (0..columns).map(move |column| (column * TILE, y)))
            .map(|(left, y)| {
                let is_set = |i: &u32| left + i < self.size[0] && self.at([left + i, y]);
                (0..TILE).filter(is_set).fold(0, |word, i| word | 1 << i)
            })
            .collect()
    }

    pub(super) fn new(size: [u32; 2], value: bool) -> Self {
        Self { size, bits: vec![value; (size[0] * size[1]) as usize] }
    }

    /// Rectangles of random sides.
    pub(super) fn random(random: &mut Random, size: [u32; 2]) -> Self {
        let mut mask = Self::new(size, false);
        for _ in 0..3 {
            let low = size.map(|side| random.uniform(-10.0, f64::from(side)).max(0.0) as u32);
            let sides = size.map(|side| random.uniform(1.0, f64::from(side)) as u32);
            for y in low[1]..size[1].min(low[1] + sides[1]) {
                for x in low[0]..size[0].min(low[0] + sides[0]) {
                    mask.bits[(y * size[0] + x) as usize] = true;
                }
            }
        }
        mask
    }
}

/// The expected results, accumulated from the start of a frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Expected {
    /// The list's voxels that the last group draws, in order.
    pub(super) drawn: Vec<u32>,
    /// Hidden and shaded voxels by brick.
    pub(super) states: Vec<(u64, u64)>,
    /// The numbers of voxels shaded, sections, quads, bricks tested and bricks visited.
    pub(super) counts: [u32; 5],
    pub(super) tiles: BTreeSet<u32>,
}

/// A frame's rules: those of §6, as in the shaders' comments.
pub(super) struct Rules<'a> {
    pub(super) grid: &'a Grid,
    pub(super) frame: &'a Frame,
    pub(super) view: &'a ViewGeometry,
    pub(super) geometry: Geometry,
    pub(super) kernel: Kernel,
    pub(super) order_of_sheets: Order,
    pub(super) kind: Groups,
    pub(super) bricks: &'a [Brick],
    pub(super) indices: &'a [u32],
    pub(super) groups: &'a [SheetGroup],
    /// The list's bricks in bucket order.
    pub(super) order: &'a [u32],
    /// Voxels, by index in the volume, that f32 arithmetic may treat differently.
    pub(super) unsure: BTreeSet<u32>,
}

impl Rules<'_> {
    /// A voxel's pixel coordinates, sheet depth, and depth from the eye; a voxel nearer than the near plane is projected as if it were on it.
    fn project(&self, p: DVec3) -> DVec4 {
        let [x, y, depth, from_eye] =
            self.frame.screen_from_voxel.map(|row| DVec4::from(row.map(f64::from)).dot(p.extend(1.0)));
        let center = DVec2::new(x, y) / from_eye.max(self.frame.near.into()) + self.geometry.size / 2.0;
        center.extend(depth).extend(from_eye)
    }

    /// Whether any pixel of the image lies in the box around `low..high` widened by the footprint.
    fn is_on_screen(&self, decisions: &mut Decisions, group: &SheetGroup, low: DVec2, high: DVec2) -> bool {
        let (low, high) = (low - half_box(group), high + half_box(group));
        let size = self.frame.size.map(f64::from);
        // All four sides are tested, so that every uncertain one is noted.
        let sides = [(high.x, 0.5), (high.y, 0.5), (size[0] - 0.5, low.x), (size[1] - 0.5, low.y)]
            .map(|(a, b)| decisions.at_least(a, b, decisions.pixels));
        sides.into_iter().all(|side| side)
    }

    /// Whether what is this far from the eye has no place on the screen, but bears on planes (`CLOSE` of the shaders).
    fn is_close(&self, decisions: &mut Decisions, from_eye: f64) -> bool {
        let reach = 1.001 * f64::from(self.frame.reach);
        self.kind == Groups::Planes && self.frame.near > 0.0 && decisions.at_least(reach, from_eye, EPSILON)
    }

    fn visits(
        &self,
        decisions: &mut Decisions,
        brick: &Brick,
        hidden: u64,
        group: &SheetGroup,
        occluded: &Occluded,
    ) -> bool {
        if brick::present(brick) & !hidden == 0 {
            return false;
        }
        let (middle, half) = brick::bounds(brick);
        let [_, _, depth, from_eye] = self.view.screen_from_voxel.map(|row| row.dot(middle.extend(1.0)));
        let [_, _, spread, thickness] = self.view.screen_from_voxel.map(|row| row.truncate().abs().dot(half));
        // The shader adds this slack.
        let reach = spread + f64::from(self.frame.reach) + 1e-3;
        let near = f64::from(group.near);
        let far = match self.kind {
            Groups::Sheets(sheets) => near + f64::from(sheets) * f64::from(self.frame.slab_width),
            Groups::Planes => near,
        };
        let is_before = decisions.at_least(near, depth + reach, EPSILON);
        let is_behind = decisions.at_least(depth - reach, far, EPSILON);
        if is_before || is_behind {
            return false;
        }
        if self.is_close(decisions, from_eye - thickness) {
            return true;
        }
        let is_clipped = decisions.at_least(self.frame.near.into(), from_eye + thickness, EPSILON);
        let Some(bounds) = self.view.bounds(middle, half) else { return false };
        let (low, high) = (bounds.low - 1e-3, bounds.high + 1e-3);
        if is_clipped || !self.is_on_screen(decisions, group, low, high) {
            return false;
        }
        if group.culling == 0 {
            return true;
        }
        let all_occluded = |margin: f64| {
            let [first, last] = Decisions::new(0.0).filter(self.frame.size, group, low - margin, high + margin);
            (first[1]..=last[1]).all(|y| (first[0]..=last[0]).all(|x| occluded.at([x, y])))
        };
        decisions.unsure |= all_occluded(decisions.pixels) != all_occluded(-decisions.pixels);
        !all_occluded(0.0)
    }

    /// Adds what a group draws to the results expected so far.
    pub(super) fn cull(&mut self, group: usize, occluded: &Occluded, so_far: &mut Expected) {
        so_far.drawn.clear();
        let group = &self.groups[group];
        for &at in &self.order[group.first_brick as usize..][..group.brick_count as usize] {
            let brick = self.bricks[at as usize];
            so_far.counts[3] += 1;
            let corner = UVec3::new(brick.x, brick.y, brick.z);
            let mut decisions = Decisions::new(self.pixel_error(corner.as_dvec3()));
            let visits = self.visits(&mut decisions, &brick, so_far.states[at as usize].0, group, occluded);
            if decisions.unsure {
                // The brick reaches the group only barely: its box, which has slack, does, but perhaps none of its voxels.
                self.unsure.extend(indices(self.grid, &brick).into_iter().filter(|&index| index != ABSENT));
            }
            if !visits {
                continue;
            }
            so_far.counts[4] += 1;
            let left = brick::present(&brick) & !so_far.states[at as usize].0;
            for slot in (0..BRICK_VOXELS).filter(|slot| left >> slot & 1 == 1) {
                let id = at * BRICK_VOXELS + slot;
                let voxel = self.grid.voxel_at(self.indices[id as usize]);
                let mut decisions = Decisions::new(self.pixel_error(voxel.as_dvec3()));
                self.cull_voxel(&mut decisions, (at, slot, id), voxel, group, occluded, so_far);
                if decisions.unsure {
                    self.unsure.insert(self.indices[id as usize]);
                }
            }
        }
        so_far.counts[2] += so_far.drawn.len() as u32;
    }

    /// The f32 error of a voxel's pixel coordinates, or of its surroundings; bounded by that at the near plane.
    fn pixel_error(&self, p: DVec3) -> f64 {
        let nearest = self.view.screen_from_voxel[3].dot(p.extend(1.0)).abs().max(self.frame.near.into());
        let [x, y] = [0, 1].map(|row| (self.view.screen_from_voxel[row] * p.extend(1.0)).abs().element_sum());
        if self.geometry.eye.is_some() { 16.0 * F32 * x.max(y) / nearest } else { 0.0 }
    }

    /// The number of a voxel's sections that the group draws, by the f64 evaluation: those with a footprint whose own box contains a pixel.
    fn sections(&self, decisions: &mut Decisions, voxel: UVec3, group: &SheetGroup) -> u32 {
        let Geometry { method, eye, .. } = self.geometry;
        if self.kind == Groups::Planes {
            let depth = self.view.screen_from_voxel[2].dot(voxel.as_dvec3().extend(1.0));
            return u32::from(!decisions.at_least((depth - f64::from(group.near)).abs(), self.view.reach, EPSILON));
        }
        if eye.is_some_and(|eye| !decisions.at_least(self.geometry.depth(voxel), eye.near, EPSILON)) {
            return 0;
        }
        let splat =
            |depth| reference::Splat { center: self.geometry.pixel(voxel), depth, amount: DVec4::ONE, alpha: 1.0 };
        let depth = self.geometry.depth(voxel);
        let first = ((f64::from(group.near) - self.view.slabs.origin) / self.view.slabs.width).round() as i32;
        let within = |depth: f64| {
            let sheets = match method {
                Method::ImageAligned => self.geometry.slabs(&splat(depth), self.kernel.radius()),
                _ => self.geometry.slice(voxel)..self.geometry.slice(voxel) + 1,
            };
            sheets.start.max(first)..sheets.end.min(first + self.kind.sheets() as i32)
        };
        decisions.unsure |= within(depth - EPSILON) != within(depth + EPSILON);
        let (half_group, epsilon) = (half_box(group), decisions.pixels);
        let is_on_screen = |k: &i32| {
            let Some(section) = self.geometry.section(&splat(depth), *k, &self.kernel) else { return false };
            let half_box = section.footprint.half_box(self.kernel.support());
            assert!(
                half_box.cmple(half_group * (1.0 + 4.0 * F32)).all(),
                "{voxel}: {half_box}, the group's {half_group}"
            );
            let inside = (section.center + half_box - 0.5).min(self.geometry.size - 0.5 - section.center + half_box);
            decisions.unsure |= inside.min_element().abs() < epsilon + 1e-4 * half_box.max_element();
            inside.min_element() >= 0.0
        };
        within(depth).filter(is_on_screen).count() as u32
    }

    fn cull_voxel(
        &self,
        decisions: &mut Decisions,
        (brick, slot, id): (u32, u32, u32),
        voxel: UVec3,
        group: &SheetGroup,
        occluded: &Occluded,
        so_far: &mut Expected,
    ) {
        let size = self.frame.size;
        let p = self.project(voxel.as_dvec3());
        let center = DVec2::new(p.x, p.y);
        let is_close = self.is_close(decisions, p.w);
        let is_on_screen = is_close || self.is_on_screen(decisions, group, center, center);
        let is_hidden = !is_close && group.culling == 1 && {
            let [first, last] = decisions.filter(size, group, center, center);
            let corners = [first, [last[0], first[1]], [first[0], last[1]], last];
            corners.into_iter().all(|corner| occluded.at(corner))
        };
        let state = &mut so_far.states[brick as usize];
        if !is_on_screen || is_hidden {
            // Back to front, where nothing is hidden, boxes may grow.
            state.0 |= u64::from(self.order_of_sheets == Order::FrontToBack) << slot;
            return;
        }
        let sections = self.sections(decisions, voxel, group);
        if sections == 0 {
            return;
        }
        so_far.drawn.push(id);
        so_far.counts[1] += sections;
        so_far.counts[0] += u32::from(state.1 >> slot & 1 == 0);
        state.1 |= 1 << slot;
        // Every tile with a pixel whose centre is in the footprint's box, plus at most one more row or column of tiles.
        let half = if is_close { DVec2::splat(1e9) } else { half_box(group) };
        let center = if is_close { DVec2::ZERO } else { center };
        let low = decisions.pixel(center - half - 0.5, size).map(|pixel| pixel / TILE);
        let high = decisions.pixel(center + half, size).map(|pixel| pixel / TILE);
        let columns = tile_grid(size)[0];
        so_far.tiles.extend((low[1]..=high[1]).flat_map(|y| (low[0]..=high[0]).map(move |x| y * columns + x)));
    }
}
