//! One tile of the image, slab by slab from front to back, where classification comes after splatting (SPEC §9): the slab between two planes is
//! classified for the open pixels whose rays enter it in a cell of a brick that may have an opacity, and composited.

use std::collections::VecDeque;
use std::iter::Peekable;
use std::ops::Range;
use std::sync::Arc;

use fearless_simd::Simd;

use super::classify::Looks;
use super::extreme::Chosen;
use super::frame::Frame;
use super::place::ScreenBox;
use super::planes::Plane;
use super::search::Search;
use super::sheet::SlabSheet;
use crate::cpu::bin::Placed;
use crate::cpu::composite::{Stretch, tiles_of};
use crate::cpu::count::Tally;
use crate::cpu::cull::{OpenMask, Pixels, columns_between};
use crate::cpu::cut::TileRays;
use crate::cpu::project::floor;
use crate::cpu::sheets::{Buffers, COLUMNS, ROWS, Sheet};
use crate::part::Extreme;

/// The number of slabs before its first one in which a brick is read, so that it is in the cache when that slab comes.
const AHEAD: i32 = 2;

/// A brick that comes next.
struct NearBrick<'a> {
    placed: &'a Placed,
    /// The slab with which it ends.
    end: i32,
    pixels: Pixels,
}

/// The state with which a thread draws one tile after another.
pub(super) struct TileWalk<'a> {
    /// The first channel's, for what all channels have in common.
    frame: &'a Frame<'a>,
    channels: Vec<Channel<'a>>,
    /// The slabs whose sheets may hold anything.
    touched: Range<i32>,
    /// The tile's first pixel.
    origin: [usize; 2],
    open: OpenMask,
    rays: TileRays,
    to_eye: Vec<[[f32; COLUMNS]; 3]>,
    /// The sheets of the current slab's segments.
    sheets: Vec<SlabSheet>,
    buffers: Buffers,
    chosen: Chosen,
    search: Search,
    tally: Tally,
}

/// One channel of a tile.
struct Channel<'a> {
    frame: &'a Frame<'a>,
    /// The current slab's.
    planes: [Plane; 2],
    /// The bricks whose cells the current slab may be in: the slab with which they end, and their pixels.
    active: Vec<(i32, Pixels)>,
}

impl<'a> TileWalk<'a> {
    pub(super) fn new(frames: &'a [Frame<'a>]) -> Self {
        let frame = &frames[0];
        let channel = |frame: &'a Frame<'a>| {
            let planes = [(); 2].map(|()| Plane::new(frame.field.has_colors()));
            Channel { frame, planes, active: Vec::new() }
        };
        Self {
            frame,
            channels: frames.iter().map(channel).collect(),
            touched: Frame::touched(frames),
            origin: [0; 2],
            open: OpenMask::new(COLUMNS, ROWS),
            rays: TileRays::default(),
            to_eye: Vec::new(),
            sheets: (0..frame.segments).map(|_| SlabSheet::new()).collect(),
            buffers: Buffers::new(),
            chosen: Chosen::new(frame.compositing, frame.field.has_colors()),
            search: Search::new(frame.field.has_colors()),
            tally: Tally::default(),
        }
    }

    /// Draws a tile, given its first pixel and its bricks by first slab. Returns its filled buffers and how its rays meet slabs.
    #[inline(always)]
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
        if self.frame.is_searched() {
            self.reset(origin, self.touched.start);
            self.search(simd);
        } else if let Some(first) = bricks.peek().map(|placed| placed.first) {
            self.reset(origin, first);
            self.walk(simd, first, &mut bricks);
            if self.frame.compositing.is_choice() {
                let Self { frame, rays, to_eye, buffers, chosen, .. } = self;
                frame.classify_chosen(simd, &Looks::new(self.origin, rays, to_eye), chosen, buffers);
            }
        }
        (&self.buffers, &self.rays, self.tally)
    }

    /// Finds the values that the tile's pixels choose, and classifies them.
    #[inline(always)]
    fn search<S: Simd>(&mut self, simd: S) {
        let Self { frame, rays, to_eye, buffers, chosen, search, open, tally, .. } = self;
        let looks = Looks::new(self.origin, rays, to_eye);
        search.choose(simd, frame, &looks, open, frame.matter.extremes().filter(|_| frame.is_bounded), chosen);
        tally.bricks_visited = search.bricks;
        frame.classify_chosen(simd, &looks, chosen, buffers);
    }

    /// The values that the tile's pixels chose, row by row; see [`Chosen::extremes`].
    pub(super) fn extremes(&self, pixels: &mut [[f32; 4]]) -> Vec<Extreme> {
        self.chosen.extremes(self.frame, &self.rays, pixels)
    }

    /// Prepares the walk through a tile, which begins with a slab.
    fn reset(&mut self, origin: [usize; 2], slab: i32) {
        let [width, height] = self.frame.placement.view.size.map(|side| side as usize);
        self.origin = origin;
        self.open = OpenMask::new((width - origin[0]).min(COLUMNS), (height - origin[1]).min(ROWS));
        self.open.close_outside(&self.frame.region, origin);
        (self.rays, self.to_eye) = self.frame.rays_of_tile(origin);
        if let (Some(shown), Some(_)) = (&self.rays.shown, self.frame.compositor.threshold) {
            self.open.close_empty(shown);
        }
        for Channel { frame, planes, active } in &mut self.channels {
            planes[1].become_plane(slab, frame.points(slab, origin));
            planes.iter_mut().for_each(|plane| plane.hold(None));
            active.clear();
        }
    }

    #[inline(always)]
    fn walk<'b, S: Simd>(&mut self, simd: S, first: i32, bricks: &mut Peekable<impl Iterator<Item = &'b Placed>>) {
        let mut slab = first;
        // The bricks that come next.
        let mut near = VecDeque::new();
        while !self.open.is_closed() {
            while let Some(placed) = bricks.next_if(|placed| placed.first <= slab.saturating_add(AHEAD)) {
                near.extend(self.approach(placed));
            }
            let is_here = |brick: &NearBrick<'_>| brick.placed.first <= slab;
            while near.front().is_some_and(is_here)
                && let Some(brick) = near.pop_front()
            {
                self.arrive(&brick);
            }
            let mut is_idle = true;
            for Channel { active, .. } in &mut self.channels {
                active.retain(|&(end, _)| slab < end);
                is_idle &= active.is_empty();
            }
            if is_idle {
                let next = near.front().map(|brick| brick.placed).or_else(|| bricks.peek().copied());
                let Some(next) = next else { break };
                slab = self.go_on(slab, next.first);
                continue;
            }
            self.enter(slab);
            if let Some(end) = self.blank_until(slab) {
                slab = self.go_on(slab, end);
                continue;
            }
            self.composite(simd, slab);
            slab = self.go_on(slab, slab + 1);
        }
    }

    /// Goes on from a slab to another one, and closes the opaque pixels at the end of a group of sheets. Returns the other slab.
    fn go_on(&mut self, from: i32, to: i32) -> i32 {
        let group_of = |slab: i32| slab.div_euclid(self.frame.sheets_per_test);
        if group_of(from) != group_of(to) {
            self.open.close_found();
        }
        to
    }

    /// Reads a brick that comes next, unless its pixels are opaque.
    fn approach<'b>(&self, placed: &'b Placed) -> Option<NearBrick<'b>> {
        let Frame { placement, matter, .. } = self.frame;
        let voxels = matter.bounds(placed.brick);
        let (bounds, slabs) = placement.bounds(voxels);
        let pixels = pixels_of(self.origin, bounds).filter(|pixels| self.open.sees(pixels))?;
        self.channels[placed.channel as usize].frame.read_ahead(voxels);
        Some(NearBrick { placed, end: slabs.end, pixels })
    }

    /// Takes in a brick, unless its pixels are opaque.
    fn arrive(&mut self, NearBrick { placed, end, pixels }: &NearBrick<'_>) {
        if self.open.sees(pixels) {
            let Channel { frame, active, .. } = &mut self.channels[placed.channel as usize];
            active.push((*end, *pixels));
            frame.draw_brick(placed.brick);
            self.tally.bricks_visited += 1;
        }
    }

    /// Goes to a slab, to the next one if it can be.
    fn enter(&mut self, slab: i32) {
        let Self { channels, origin, open, .. } = self;
        for Channel { frame, planes, .. } in channels {
            planes.swap(0, 1);
            if planes[0].held.as_ref().is_none_or(|held| !held.suffices(frame, slab, *origin, open)) {
                let held = frame.hold(slab, *origin, open).map(Arc::new);
                planes.iter_mut().for_each(|plane| plane.hold(held.clone()));
            }
            for (plane, number) in planes.iter_mut().zip([slab, slab + 1]) {
                if plane.number != number || number == slab + 1 {
                    plane.become_plane(number, frame.points(number, *origin));
                }
            }
        }
    }

    /// The slab, behind the current one, before which no voxel that the tile holds of a store has an opacity; `None` if one may have in the current one.
    fn blank_until(&self, slab: i32) -> Option<i32> {
        let blank = |channel: &Channel<'_>| channel.planes[0].held.as_ref()?.blank_until(slab);
        self.channels.iter().map(blank).reduce(|a, b| Some(a?.min(b?))).flatten()
    }

    /// Classifies and composites a slab.
    #[inline(always)]
    fn composite<S: Simd>(&mut self, simd: S, slab: i32) {
        let Self { frame, open, rays, to_eye, sheets, buffers, tally, channels, chosen, .. } = self;
        let looks = Looks::new(self.origin, rays, to_eye);
        for channel in channels.iter_mut().filter(|channel| !channel.active.is_empty()) {
            let wanted = channel.wanted(open);
            let Channel { frame, planes, .. } = channel;
            if frame.compositing.is_choice() {
                frame.choose(simd, &looks, planes, &wanted, chosen);
            } else {
                frame.find_wide(simd, slab, &looks, planes, &wanted);
                frame.classify(simd, slab, &looks, planes, &wanted, open, (sheets, buffers));
            }
        }
        if frame.compositing.is_by_means() {
            return;
        }
        if self.touched.contains(&slab) {
            let filled = sheets.iter().fold(0, |rows, sheet| rows | sheet.rows());
            tally.tiles_composited += tiles_of(filled & open.rows());
        }
        for (number, sheet) in sheets.iter_mut().enumerate() {
            let segment = Stretch::segment(rays.begin(slab), number, frame.segments);
            frame.compositor.composite(simd, sheet, buffers, (rays, segment), open);
        }
    }
}

/// The pixels of a tile, given by its first pixel, within a box on the screen.
pub(super) fn pixels_of(origin: [usize; 2], [low, high]: ScreenBox) -> Option<Pixels> {
    let of_axis = |axis: usize, count: usize| {
        let from_first = origin[axis] as f64 + 0.5;
        let first = -floor(-(low[axis] - from_first).clamp(0.0, count as f64));
        let last = floor((high[axis] - from_first).clamp(-1.0, count as f64 - 1.0));
        (first <= last).then_some([first as usize, last as usize])
    };
    Some(Pixels { columns: of_axis(0, COLUMNS)?, rows: of_axis(1, ROWS)? })
}

impl Channel<'_> {
    /// The bits of the open pixels, row by row, whose rays may meet a brick's cells in the current slab.
    fn wanted(&self, open: &OpenMask) -> [u32; ROWS] {
        let mut wanted = [0; ROWS];
        for (_, Pixels { columns: [left, right], rows: [first, last] }) in &self.active {
            let columns = columns_between(*left, *right);
            wanted[*first..=*last].iter_mut().for_each(|row| *row |= columns);
        }
        wanted.iter_mut().enumerate().for_each(|(row, wanted)| *wanted &= open.row(row));
        wanted
    }
}
