//! One tile of the image, front to back, where classification comes after splatting (SPEC §9): bricks arrive with the first plane that they may
//! reach, every voxel waits for its own first plane and is splatted onto all that its kernel reaches, unless opaque pixels hide it; then the slab
//! before the current plane is classified and composited.

use std::iter::Peekable;

use fearless_simd::Simd;

use super::classify::Looks;
use super::extreme::{Chosen, is_choice};
use super::frame::Frame;
use super::place::{Place, ScreenBox};
use super::planes::Planes;
use super::splat::Splat;
use crate::cpu::bin::Placed;
use crate::cpu::count::{Tally, bits};
use crate::cpu::cull::{Boxes, OpenMask, Pixels};
use crate::cpu::cut::TileRays;
use crate::cpu::queue::{Queue, Waiting};
use crate::cpu::sheets::{Buffers, COLUMNS, RING, ROWS, SECTIONS, slot_of};
use crate::cpu::vector::LANES;
use crate::lists::brick;
use crate::lists::brick::BRICK_VOXELS;
use crate::part::Extreme;
use crate::settings::splatting::Compositing;

/// The state with which a thread draws one tile after another.
pub(super) struct TileWalk<'a> {
    frame: &'a Frame<'a>,
    /// The tile's first pixel.
    origin: [usize; 2],
    open: OpenMask,
    rays: TileRays,
    to_eye: Vec<[[f32; COLUMNS]; 3]>,
    planes: Planes,
    buffers: Buffers,
    chosen: Chosen,
    arrived: Vec<(u32, Place)>,
    queue: Queue,
    /// Voxels that reach more planes than are drawn at a time, by the slot of the plane that is their next.
    continued: [Vec<Splat>; RING],
    /// The number of those.
    pending: usize,
    tally: Tally,
}

impl<'a> TileWalk<'a> {
    pub(super) fn new(frame: &'a Frame<'a>) -> Self {
        Self {
            frame,
            origin: [0; 2],
            open: OpenMask::new(COLUMNS, ROWS),
            rays: TileRays::default(),
            to_eye: Vec::new(),
            planes: Planes::new(),
            buffers: Buffers::new(),
            chosen: Chosen::new(frame.compositing),
            arrived: Vec::new(),
            queue: Queue::default(),
            continued: std::array::from_fn(|_| Vec::new()),
            pending: 0,
            tally: Tally::default(),
        }
    }

    /// Draws a tile, given its first pixel and its bricks by first plane. Returns its filled buffers and how its rays meet slabs.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn draw<S: Simd>(
        &mut self,
        simd: S,
        origin: [usize; 2],
        placed: &[Placed],
        bricks: &[u32],
    ) -> (&Buffers, &TileRays, Tally) {
        let mut bricks = bricks.iter().map(|&at| &placed[at as usize]).peekable();
        self.buffers.clear();
        self.chosen.clear();
        self.tally = Tally::default();
        if let Some(first) = bricks.peek().map(|placed| placed.first) {
            self.reset(origin, first);
            self.walk(simd, first, &mut bricks);
            if is_choice(self.frame.compositing) {
                let Self { frame, rays, to_eye, buffers, chosen, .. } = self;
                frame.classify_chosen(simd, &Looks::new(self.origin, rays, to_eye), chosen, buffers);
            }
        }
        (&self.buffers, &self.rays, self.tally)
    }

    /// The values that the tile's pixels chose, row by row.
    pub(super) fn extremes(&self) -> Vec<Extreme> {
        self.chosen.extremes(self.frame, &self.rays)
    }

    /// Prepares the walk through a tile, which begins with a plane.
    fn reset(&mut self, origin: [usize; 2], plane: i32) {
        let [width, height] = self.frame.placement.view.size.map(|side| side as usize);
        self.origin = origin;
        self.open = OpenMask::new((width - origin[0]).min(COLUMNS), (height - origin[1]).min(ROWS));
        self.open.close_outside(&self.frame.region, origin);
        (self.rays, self.to_eye) = self.frame.rays_of_tile(origin, plane);
        if let (Some(shown), Some(_)) = (&self.rays.shown, self.frame.compositor.threshold) {
            self.open.close_empty(shown);
        }
        (0..RING).for_each(|slot| self.planes.clear(slot));
        self.arrived.clear();
        self.queue.clear();
        self.continued.iter_mut().for_each(Vec::clear);
        self.pending = 0;
    }

    #[cfg_attr(not(debug_assertions), inline(always))]
    fn walk<'b, S: Simd>(&mut self, simd: S, first: i32, bricks: &mut Peekable<impl Iterator<Item = &'b Placed>>) {
        let mut plane = first;
        loop {
            while let Some(placed) = bricks.next_if(|placed| placed.first <= plane) {
                self.tally.bricks_visited += u64::from(self.arrive(simd, placed, plane));
            }
            self.start(simd, plane);
            self.composite(simd, plane - 1);
            self.planes.clear(slot_of(plane - 1));
            if self.open.is_closed() {
                break;
            }
            let is_waiting = self.pending != 0 || !self.queue.is_empty();
            let is_idle = !is_waiting && self.planes.written == [0; RING];
            plane = match bricks.peek() {
                Some(placed) if is_idle => placed.first.max(plane + 1),
                None if is_idle => break,
                _ => plane + 1,
            };
        }
    }

    /// Classifies and composites a slab.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn composite<S: Simd>(&mut self, simd: S, slab: i32) {
        let Self { frame, open, rays, to_eye, buffers, tally, planes, chosen, .. } = self;
        let looks = Looks::new(self.origin, rays, to_eye);
        if is_choice(frame.compositing) {
            return frame.choose(simd, slab + 1, &looks, planes, chosen);
        }
        // The planes around a range of slabs bound slabs outside of it as well.
        if !frame.slabs.contains(&slab) {
            return;
        }
        frame.classify(simd, slab, &looks, planes, open, buffers);
        if frame.compositing == Compositing::Surface {
            return;
        }
        let begin = rays.begin(slab);
        let is_composited = frame.compositor.composite(simd, buffers, (rays, begin), open);
        tally.sheets_composited += u64::from(is_composited && frame.touched.contains(&slab));
    }

    /// Lets a brick's voxels wait for their first planes, unless the brick is hidden; whether it is not.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn arrive<S: Simd>(&mut self, simd: S, placed: &Placed, plane: i32) -> bool {
        let placement = &self.frame.placement;
        let brick = &self.frame.bricks[placed.brick as usize];
        let is_seen = |bounds: ScreenBox| self.pixels(bounds).is_some_and(|pixels| self.open.sees(&pixels));
        if !placement.bounds(brick).is_some_and(|(bounds, _)| is_seen(bounds)) {
            return false;
        }
        let place = placement.of_brick(brick);
        let number = self.arrived.len() as u32;
        self.arrived.push((placed.brick, place));
        let waiting = Waiting { brick: number, voxels: brick::present(brick) };
        self.queue.add(simd, waiting, &placement.first_planes(place), plane);
        true
    }

    /// The tile's pixels within a box on the screen.
    fn pixels(&self, [low, high]: ScreenBox) -> Option<Pixels> {
        let (center, half) = ((low + high) / 2.0, (high - low) / 2.0);
        let center = [center.x - self.origin[0] as f64 - 0.5, center.y - self.origin[1] as f64 - 0.5];
        Pixels::within(center.map(|at| at as f32), half.to_array().map(|half| half as f32))
    }

    /// Draws the voxels that start or continue at a plane.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn start<S: Simd>(&mut self, simd: S, plane: i32) {
        let continued = std::mem::take(&mut self.continued[slot_of(plane)]);
        self.pending -= continued.len();
        for splat in &continued {
            self.draw_splat(simd, splat);
        }
        let Some(starting) = self.queue.advance() else { return };
        for &waiting in &starting {
            self.start_voxels(simd, waiting, plane);
        }
        self.queue.reuse(starting);
    }

    /// Draws voxels of a brick, if they are seen.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn start_voxels<S: Simd>(&mut self, simd: S, waiting: Waiting, plane: i32) {
        let Frame { placement, bricks, coefficients, volume, .. } = self.frame;
        let (number, brick_place) = self.arrived[waiting.brick as usize];
        let origin = brick::origin(&bricks[number as usize]);
        // With an eye every plane has its own footprint, which is tested when it is drawn.
        let half_box = placement.flat_half_box();
        for first in (0..BRICK_VOXELS as usize).step_by(LANES) {
            let lanes = waiting.voxels >> first & 0xff;
            if lanes == 0 {
                continue;
            }
            let centers = placement.centers(brick_place, first, self.origin);
            let boxes = Boxes::within(simd, &centers, half_box.unwrap_or_default());
            for lane in bits(lanes) {
                let lane = lane as usize;
                let pixels = boxes.pixels(lane).filter(|pixels| self.open.sees(pixels));
                if half_box.is_some() && pixels.is_none() {
                    continue;
                }
                let slot = (first + lane) as u32;
                let place = placement.of_voxel(brick_place, slot);
                let end = placement.planes(place.depth..place.depth).end;
                let (c, gradient) = coefficients.voxel(volume, origin + brick::in_brick(slot));
                let splat = Splat {
                    voxel: [number, slot],
                    place,
                    center: [centers[0][lane], centers[1][lane]],
                    pixels,
                    number: c,
                    gradient,
                    planes: [plane, end],
                    drawn: 0,
                };
                self.draw_splat(simd, &splat);
            }
        }
    }

    /// Draws a voxel on the next planes, if they are visible, and keeps it if it reaches more.
    #[cfg_attr(not(debug_assertions), inline(always))]
    fn draw_splat<S: Simd>(&mut self, simd: S, splat: &Splat) {
        let frame = self.frame;
        let [first, end] = splat.planes;
        let next = end.min(first + SECTIONS as i32);
        if frame.splatter.draw(simd, (&frame.placement, self.origin), splat, &self.open, &mut self.planes) {
            frame.drawn.splat(splat.voxel, splat.drawn, (next - first) as u64, &mut self.tally);
        }
        if next < end {
            self.continued[slot_of(next)].push(Splat { planes: [next, end], drawn: splat.drawn + 1, ..*splat });
            self.pending += 1;
        }
    }
}
