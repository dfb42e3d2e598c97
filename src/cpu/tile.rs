//! One tile of the image, front to back: bricks arrive with the first sheet that they may reach, every voxel waits for its own first sheet,
//! is tested for being hidden there, shaded, and drawn into all the sheets that its kernel reaches; then that sheet is composited. Where voxels
//! are composited one by one there is one sheet, composited after each of them.

use std::cmp::Reverse;
use std::iter::Peekable;
use std::ops::Range;
use std::sync::Arc;

use super::batch::Batch;
use super::bin::Placed;
use super::composite::Stretch;
use super::count::{Tally, bits};
use super::cull::{Boxes, OpenMask, Pixels};
use super::cut::TileRays;
use super::frame::{Frame, Voxels};
use super::project::Place;
use super::queue::{Queue, Waiting};
use super::sheets::{Buffers, COLUMNS, RING, ROWS, Ring, SECTIONS, slot_of};
use super::splat::{Footprints, Splat};
use super::stream::{Approach, Chunk, Stream};
use super::vector::LANES;
use crate::lists::brick;
use crate::lists::brick::Brick;
use fearless_simd::prelude::*;

/// A brick that has arrived.
#[derive(Clone)]
struct Arrived {
    /// The chunk whose brick it is, if voxels come from a store; nothing after its last sheet.
    chunk: Option<Arc<Chunk>>,
    /// Its number in the list of bricks, or the chunk's.
    number: u32,
    brick: Brick,
    place: Place,
    half_box: [f32; 2],
    /// The sheet behind its last one.
    end: i32,
}

/// Up to eight voxels that begin in a sheet.
#[derive(Default)]
struct Starts {
    count: usize,
    /// Their bricks' indices among those that have arrived, and their slots.
    voxels: [[u32; 2]; LANES],
    /// Pixel coordinates.
    centers: [[f32; LANES]; 2],
    /// Half the sizes of boxes that contain their footprints.
    half_boxes: [[f32; LANES]; 2],
}

impl Starts {
    #[inline(always)]
    fn add(&mut self, voxel: [u32; 2], center: [f32; 2], half_box: [f32; 2]) {
        let lane = self.count;
        self.voxels[lane] = voxel;
        for axis in 0..2 {
            self.centers[axis][lane] = center[axis];
            self.half_boxes[axis][lane] = half_box[axis];
        }
        self.count += 1;
    }
}

/// The state with which a thread draws one tile after another.
pub(super) struct TileWalk<'a> {
    frame: &'a Frame<'a>,
    /// The tile's first pixel.
    origin: [usize; 2],
    open: OpenMask,
    rays: TileRays,
    ring: Ring,
    footprints: Footprints,
    buffers: Buffers,
    /// The chunks of a store that may be seen from some sheet on.
    approach: Approach,
    /// The bricks of a store's chunks that have been read but not arrived, the next one last.
    read: Vec<(Arc<Chunk>, u32)>,
    arrived: Vec<Arrived>,
    /// What has been drawn of them, as [`Drawn`](super::count::Drawn) records it.
    marks: Vec<u64>,
    queue: Queue,
    /// Voxels with more sections than are drawn at a time, by the slot of their next sheet.
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
            ring: Ring::new(),
            footprints: Footprints::new(),
            buffers: Buffers::new(),
            approach: Approach::default(),
            read: Vec::new(),
            arrived: Vec::new(),
            marks: Vec::new(),
            queue: Queue::default(),
            continued: std::array::from_fn(|_| Vec::new()),
            pending: 0,
            tally: Tally::default(),
        }
    }

    /// Draws a tile, given its first pixel and its bricks by first sheet: what its buffers hold then, and how its pixels look at sheets.
    #[inline(always)]
    pub(super) fn draw<S: Simd>(
        &mut self,
        simd: S,
        origin: [usize; 2],
        placed: &[Placed],
        bricks: &[u32],
    ) -> (&Buffers, &TileRays, Tally) {
        let mut bricks = bricks.iter().map(|&at| &placed[at as usize]).peekable();
        // A part of an image (SPEC §11) needs the sheets that count even where only other parts have bricks.
        let counted = Some(self.frame.counted.start).filter(|_| self.frame.is_part() && !self.frame.counted.is_empty());
        let first = bricks.peek().map(|placed| placed.first).or(counted);
        self.reset(origin);
        if let Some(first) = first {
            self.walk(simd, first, &mut bricks);
        }
        self.leave(simd, i32::MAX);
        (&self.buffers, &self.rays, self.tally)
    }

    /// Clears the state for a tile.
    fn reset(&mut self, origin: [usize; 2]) {
        let [width, height] = self.frame.projection.view.size.map(|side| side as usize);
        self.origin = origin;
        self.open = OpenMask::new((width - origin[0]).min(COLUMNS), (height - origin[1]).min(ROWS));
        self.open.close_outside(&self.frame.region, origin);
        self.rays = self.frame.rays.of_tile(origin);
        if let (Some(shown), Some(_)) = (&self.rays.shown, self.frame.compositor.threshold) {
            self.open.close_empty(shown);
        }
        self.ring.clear();
        self.buffers.clear();
        self.approach.clear();
        self.read.clear();
        self.arrived.clear();
        self.marks.clear();
        self.queue.clear();
        self.continued.iter_mut().for_each(Vec::clear);
        self.pending = 0;
        self.tally = Tally::default();
    }

    #[inline(always)]
    fn walk<'b, S: Simd>(&mut self, simd: S, first: i32, bricks: &mut Peekable<impl Iterator<Item = &'b Placed>>) {
        // Empty sheets are composited where they count.
        let Range { start, end } = self.frame.counted.clone();
        let mut sheet = if start < end { first.min(start) } else { first };
        loop {
            match self.frame.voxels {
                Voxels::Whole { .. } => {
                    while let Some(placed) = bricks.next_if(|placed| placed.first <= sheet) {
                        self.tally.bricks_visited += u64::from(self.arrive(simd, None, placed, sheet));
                    }
                }
                Voxels::Streamed(stream) => {
                    self.read_chunks(stream, bricks, sheet);
                    while let Some((chunk, at)) = self.read.pop_if(|(chunk, at)| chunk.placed(*at).first <= sheet) {
                        let is_seen = self.arrive(simd, Some(&chunk), chunk.placed(at), sheet);
                        self.tally.bricks_visited += u64::from(is_seen);
                    }
                }
            }
            self.start(simd, sheet);
            self.add_footprints(simd);
            if !self.frame.is_each {
                self.composite(simd, sheet);
            }
            if self.open.is_closed() {
                break;
            }
            let is_waiting = self.pending != 0 || !self.queue.is_empty();
            let is_idle = !is_waiting && self.ring.is_empty() && self.buffers.kept == 0 && sheet + 1 >= end;
            let read = self.read.last().map(|(chunk, at)| chunk.placed(*at).first);
            let chunks = bricks.peek().map(|placed| placed.first).into_iter().chain(self.approach.first());
            let next = chunks.chain(read).min();
            sheet = match next {
                Some(first) if is_idle => first.max(sheet + 1),
                None if is_idle => break,
                _ => sheet + 1,
            };
            if matches!(self.frame.voxels, Voxels::Streamed(_)) && sheet % RING as i32 == 0 {
                self.leave(simd, sheet);
            }
        }
    }

    /// Composites a sheet.
    fn composite<S: Simd>(&mut self, simd: S, sheet: i32) {
        // One function for every instruction set, instead of a copy at every call.
        simd.vectorize(
            #[inline(always)]
            || {
                let Self { frame, open, rays, ring, buffers, tally, .. } = self;
                if sheet < frame.projection.window.start {
                    // Another part composites it.
                    ring.sheet(sheet).clear(simd);
                    return;
                }
                let begin = rays.begin(frame.projection.direction * sheet);
                let tiles = frame.compositor.composite(
                    simd,
                    &mut ring.sheet(sheet),
                    buffers,
                    (rays, Stretch::slab(begin)),
                    open,
                );
                open.close_found();
                if frame.touched.contains(&sheet) {
                    tally.tiles_composited += tiles;
                }
            },
        );
    }

    /// Reads the chunks of which a brick may be seen at a sheet.
    fn read_chunks<'b>(
        &mut self,
        stream: &Arc<Stream>,
        chunks: &mut Peekable<impl Iterator<Item = &'b Placed>>,
        sheet: i32,
    ) {
        while let Some(placed) = chunks.next_if(|placed| placed.first <= sheet) {
            self.approach.add(stream, placed);
        }
        let Self { approach, open, origin, .. } = self;
        let wanted = approach.reached(stream, sheet, |placed| sees(open, *origin, placed));
        if wanted.is_empty() {
            return;
        }
        wanted.iter().for_each(|&number| stream.request(number));
        let tile = [self.origin[0] / COLUMNS, self.origin[1] / ROWS];
        for chunk in wanted.into_iter().filter_map(|number| stream.chunk(number)) {
            let of_tile = chunk.bricks_of(tile);
            self.read.extend(of_tile.map(|at| (Arc::clone(&chunk), at)));
        }
        // The order of a volume in memory.
        self.read.sort_unstable_by_key(|(chunk, at)| Reverse(chunk.order(*at)));
    }

    /// Adds what was drawn of bricks whose last sheet is before this one to the counts, and lets go of their chunks.
    fn leave<S: Simd>(&mut self, simd: S, sheet: i32) {
        let Self { frame, arrived, marks, tally, .. } = self;
        for (arrived, marks) in arrived.iter_mut().zip(marks.chunks_mut(frame.drawn.masks)) {
            let Arrived { number, brick, place, end, .. } = *arrived;
            if end > sheet || marks[0] == 0 && arrived.chunk.is_none() {
                continue;
            }
            let chunk = arrived.chunk.take();
            let drawn = chunk.as_ref().map_or(&frame.drawn, |chunk| &**chunk.drawn());
            simd.vectorize(
                #[inline(always)]
                || drawn.add(number, marks, &frame.projection.sections(&brick, place), tally),
            );
            marks.fill(0);
        }
    }

    /// Lets a brick's voxels wait for their first sheets, unless the brick is hidden; whether it is not.
    fn arrive<S: Simd>(&mut self, simd: S, chunk: Option<&Arc<Chunk>>, placed: &Placed, sheet: i32) -> bool {
        if !self.sees_brick(placed) {
            return false;
        }
        let Frame { projection, voxels, .. } = self.frame;
        let brick = match (voxels, chunk) {
            (_, Some(chunk)) => *chunk.brick(placed.brick),
            (Voxels::Whole { bricks, .. }, None) => bricks[placed.brick as usize],
            (Voxels::Streamed(_), None) => return false,
        };
        let place = projection.of_brick(&brick);
        if let Voxels::Whole { materials, .. } = voxels {
            materials.read_ahead(placed.brick, &brick);
        }
        let number = self.arrived.len() as u32;
        let Placed { half_box, end, .. } = *placed;
        self.arrived.push(Arrived { chunk: chunk.cloned(), number: placed.brick, brick, place, half_box, end });
        self.marks.resize(self.arrived.len() * self.frame.drawn.masks, 0);
        simd.vectorize(
            #[inline(always)]
            || {
                let first_sheets = projection.first_sheets(&brick, place);
                let waiting = Waiting { brick: number, voxels: brick::present(&brick) };
                self.queue.add(simd, waiting, &first_sheets, sheet);
            },
        );
        true
    }

    /// Whether any pixel is open that a brick's footprints may touch.
    fn sees_brick(&self, placed: &Placed) -> bool {
        sees(&self.open, self.origin, placed)
    }

    /// Lists the pixels of voxels that start or continue in a sheet.
    #[inline(always)]
    fn start<S: Simd>(&mut self, simd: S, sheet: i32) {
        let continued = std::mem::take(&mut self.continued[slot_of(sheet)]);
        self.pending -= continued.len();
        for splat in &continued {
            self.list_splat(simd, splat);
        }
        let Some(mut starting) = self.queue.advance() else { return };
        if self.frame.is_each {
            starting = self.sorted_by_depth(&starting);
        }
        let mut batch = Batch::new(&self.frame.projection, self.frame.amplitude);
        let mut starts = Starts::default();
        let shift = self.frame.projection.shift(self.origin);
        for waiting in &starting {
            let Arrived { place, half_box, .. } = self.arrived[waiting.brick as usize];
            for slot in bits(waiting.voxels) {
                starts.add([waiting.brick, slot], self.frame.projection.center(place, slot, shift), half_box);
                if starts.count == LANES {
                    self.start_voxels(simd, &mut starts, sheet, &mut batch);
                }
            }
        }
        self.start_voxels(simd, &mut starts, sheet, &mut batch);
        self.draw_batch(simd, &mut batch);
        self.queue.reuse(starting);
    }

    /// Draws those of up to eight voxels that are seen, in batches.
    #[inline(always)]
    fn start_voxels<S: Simd>(&mut self, simd: S, starts: &mut Starts, sheet: i32, batch: &mut Batch<'a>) {
        let frame = self.frame;
        // In perspective these contain the boxes of all sections.
        let boxes = Boxes::within(simd, &starts.centers, &starts.half_boxes);
        for lane in 0..std::mem::take(&mut starts.count) {
            let Some(pixels) = boxes.pixels(lane).filter(|pixels| self.open.sees(pixels)) else { continue };
            let [arrived, slot] = starts.voxels[lane];
            let Arrived { number, brick, place, .. } = self.arrived[arrived as usize];
            self.marks[arrived as usize * frame.drawn.masks] |= 1 << slot;
            let voxel = brick::origin(&brick) + brick::in_brick(slot);
            batch.materials[batch.count] = match &frame.voxels {
                Voxels::Whole { channels, materials, .. } => {
                    let kept = materials.of_brick(number, channels, &brick);
                    kept.map(|of| materials.of_slot(of, slot)).ok_or(voxel)
                }
                Voxels::Streamed(_) => Err(voxel),
            };
            match frame.projection.view.perspective {
                None => batch.flat(frame.projection.flat_sections(place, slot, sheet), sheet),
                Some(_) => batch.lens(frame, frame.projection.of_voxel(place, slot), voxel, sheet),
            }
            let center = [starts.centers[0][lane], starts.centers[1][lane]];
            batch.add([arrived, slot], center, pixels);
            if batch.count == LANES {
                self.draw_batch(simd, batch);
            }
        }
    }

    /// Voxels that are composited one by one, sorted by depth, equal ones by their position in memory.
    fn sorted_by_depth(&self, waiting: &[Waiting]) -> Vec<Waiting> {
        let Frame { projection, grid, .. } = self.frame;
        let singles = |waiting: &Waiting| {
            let brick = waiting.brick;
            bits(waiting.voxels).map(move |slot| Waiting { brick, voxels: 1 << slot })
        };
        let mut voxels: Vec<Waiting> = waiting.iter().flat_map(singles).collect();
        voxels.sort_by_cached_key(|waiting| {
            let brick = self.arrived[waiting.brick as usize].brick;
            let voxel = brick::origin(&brick) + brick::in_brick(waiting.voxels.trailing_zeros());
            (projection.depth_key(grid, voxel), grid.index_of(voxel))
        });
        if projection.direction < 0 {
            voxels.reverse();
        }
        voxels
    }

    /// Looks up what is left of light at each of some voxels, and which of them cuts go through.
    // Not inlined, so that it is compiled once for all instruction sets.
    #[inline(never)]
    fn light_batch(&self, batch: &mut Batch<'_>, count: usize) {
        let Frame { lights, cut_cells, .. } = self.frame;
        if lights.is_none() && cut_cells.is_none() {
            return;
        }
        let mut faces = 0;
        for lane in 0..count {
            let [brick, slot] = batch.splats[lane].voxel;
            let voxel = (brick::origin(&self.arrived[brick as usize].brick) + brick::in_brick(slot)).as_dvec3();
            if let Some(lights) = lights {
                batch.unshaded.set_left(lane, lights.left(voxel));
            }
            faces |= u32::from(cut_cells.as_ref().is_some_and(|cells| cells.contain(voxel))) << lane;
        }
        batch.unshaded.set_faces(faces);
    }

    fn draw_batch<S: Simd>(&mut self, simd: S, batch: &mut Batch<'_>) {
        // One function for every instruction set, instead of a copy at every call.
        simd.vectorize(
            #[inline(always)]
            || {
                let count = std::mem::take(&mut batch.count);
                self.light_batch(batch, count);
                let mut amounts = [[0.0; LANES]; 4];
                for channel in 0..self.frame.channels() {
                    // All at once, so that the memory is waited for once.
                    for lane in 0..count {
                        match batch.materials[lane] {
                            Ok(materials) => batch.unshaded.set_material(lane, &materials[channel]),
                            Err(voxel) => {
                                let arrived = batch.splats[lane].voxel[0] as usize;
                                let chunk = self.arrived[arrived].chunk.as_deref();
                                batch.unshaded.set_material(lane, &self.frame.material(chunk, channel, voxel));
                            }
                        }
                    }
                    let of_channel = self.frame.shader.shade(simd, &batch.unshaded);
                    // A voxel's footprint is the same in all channels, so their amounts are drawn as one.
                    let sums = amounts.as_flattened_mut().iter_mut().zip(of_channel.as_flattened());
                    sums.for_each(|(sum, amount)| *sum += amount);
                }
                for (lane, splat) in batch.splats[..count].iter_mut().enumerate() {
                    let [red, green, blue, amount] = &amounts;
                    splat.amount = [red[lane], green[lane], blue[lane], amount[lane]];
                    self.list_splat(simd, splat);
                }
            },
        );
    }

    /// Lists the pixels of a voxel's next sections, if they are seen, and keeps the voxel if it has more.
    fn list_splat<S: Simd>(&mut self, simd: S, splat: &Splat) {
        // One function for every instruction set, instead of a copy at every call.
        simd.vectorize(
            #[inline(always)]
            || {
                let Self { frame, open, footprints, ring, .. } = &mut *self;
                let [first, end] = splat.sheets;
                let next = end.min(first + SECTIONS as i32);
                if let Some(pixels) = frame.splatter.list(simd, splat, open, footprints) {
                    ring.mark(pixels.columns, pixels.rows, slot_of(first), splat.sections());
                    let [brick, slot] = splat.voxel;
                    let masks = self.frame.drawn.masks;
                    let part = (1 + splat.drawn as usize).min(masks - 1);
                    self.marks[brick as usize * masks + part] |= 1 << slot;
                    if self.frame.is_each || self.footprints.is_full() {
                        self.add_footprints(simd);
                    }
                    if self.frame.is_each {
                        self.composite(simd, first);
                    }
                }
                if next < end {
                    self.continued[slot_of(next)].push(Splat {
                        sheets: [next, end],
                        first_plane: splat.first_plane + splat.step * SECTIONS as f32,
                        drawn: splat.drawn + 1,
                        ..*splat
                    });
                    self.pending += 1;
                }
            },
        );
    }

    /// Adds the footprints that are listed to the sheets.
    fn add_footprints<S: Simd>(&mut self, simd: S) {
        simd.vectorize(
            #[inline(always)]
            || {
                let Self { frame, footprints, ring, .. } = self;
                frame.splatter.add(simd, footprints, ring);
            },
        );
    }
}

/// Whether any pixel of a tile, given by its first pixel, is open that footprints of a brick or a box of voxels may touch.
fn sees(open: &OpenMask, origin: [usize; 2], placed: &Placed) -> bool {
    let [x, y] = placed.middle;
    let center = [x - origin[0] as f32, y - origin[1] as f32];
    Pixels::within(center, placed.half).is_some_and(|pixels| open.sees(&pixels))
}
