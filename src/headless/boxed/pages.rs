//! What a GPU holds of a volume that is read while it is drawn: pages in slots ([`PagePool`]), which stay while there is room. The volume is read block by block, about chunk
//! by chunk, front to back, each block once for a view: then it is known which of its voxels are drawn, and which pages these need.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap, HashMap, HashSet};
use std::ops::{Range, RangeInclusive};

use glam::{DVec2, DVec3, UVec3};

use super::block::{ALL, Block, Division, DrawnPage, OWN, Parts, Rim};
use super::channel::{LevelChunks, VoxelBox};
use super::chunks::{Chunks, PIXELS, SLABS, Step};
use super::needed_pages::{Needed, format_of, numbers_of, pages_around};
use super::open_pixels::OpenPixels;
use super::page_pool::{ChannelPage, PagePool, PageTexels};
use crate::after::brick_ranges::Bearing;
use crate::after::normalization::Normalization;
use crate::error::RenderError;
use crate::geometry::plane_geometry::PlaneGeometry;
use crate::geometry::view_geometry::ViewGeometry;
use crate::gpu::gpu_volume::GpuVolume;
use crate::gpu::shown_bricks::{BrickNeeds, shown_lists};
use crate::headless::given_light::GivenLight;
use crate::headless::gpu::GpuHeadless;
use crate::lists::brick::{self, Brick, BrickList, SIDE};
use crate::lists::classify::brick_list;
use crate::lists::patch_bins::SHEETS;
use crate::parallel::prelude::*;
use crate::parallel::{current_num_threads, join};
use crate::part::Content;
use crate::scene::Scene;
use crate::settings::splatting::Classification;
use crate::settings::transfer_function::TransferFunction;
use crate::settings::window::{Region, Window};
use crate::stats::{Stats, StoreCounts};
use crate::volume::{Grid, HollowChannel, StreamedVolume, Volume};

/// The bits of a voxel's place in its page along each axis. Small pages come with more neighbours, for gradients, and large ones are too few in little memory.
const PAGE_BITS: RangeInclusive<u32> = 2..=4;

/// The number of pages for which there must be room, so that they need not be smaller.
const MANY_PAGES: u64 = 512;

/// What voxels' kernels reach beyond themselves for rounding, in voxels.
const ROUNDING: f64 = 0.5;

/// The blocks for each thread that are read while a window is drawn.
const AHEAD: usize = 4;

/// The part of the slots' memory that lists of bricks may take after a window is drawn.
const LISTS_SHARE: u64 = 2;

/// The least voxels along each axis whose depth is drawn at a time: fewer would read less of what is hidden, in more frames.
const LEAST_DEPTH: u32 = 16;

/// What is read of a volume, and held on a GPU, for a view.
pub(super) struct Pages<'a> {
    chunks: Chunks<'a>,
    gpu: &'a GpuHeadless,
    /// The scene of the channels that are drawn.
    scene: Scene,
    /// What [`BrickNeeds`] are with classification after splatting.
    needs: Option<BrickNeeds>,
    /// What the values of each channel are splatted as.
    numbers: Vec<Normalization>,
    pool: PagePool,
    division: Division,
    /// The slabs that are drawn at a time where opaque pixels may hide those behind them.
    depth: i32,
    /// The blocks that were read, by their places.
    blocks: HashMap<UVec3, Block>,
    /// The blocks that the next window needs, whatever this one shows, which threads read while it is drawn.
    ahead: Vec<UVec3>,
    /// Counts windows.
    clock: u64,
}

/// A window's voxels: the blocks and the numbers of their pages that are drawn, all pages that these need, and a box around them.
pub(super) struct Paging {
    drawn: Vec<(UVec3, usize)>,
    pages: Vec<ChannelPage>,
    /// The first page, and the number of pages along each axis.
    within: (UVec3, UVec3),
}

/// A page that was read; nothing of it if the format of values cannot store one.
type ReadPage = (ChannelPage, Option<PageTexels>);

/// What is known of a block, and those of its pages that it needs itself.
type Read = (Block, Vec<ReadPage>);

/// A page of a block that may be seen: its first slab, the block, and its number there.
type Ahead = (i32, [u32; 3], usize);

impl<'a> Pages<'a> {
    /// What a scene, with everything stated, needs of a volume; `None` if no channel has an opacity, or one has normals of the membership of labels.
    ///
    /// # Errors
    /// If the chunks are too many, or the device has no room for pages.
    pub(super) fn new(
        gpu: &'a GpuHeadless,
        volume: &'a StreamedVolume,
        scene: &Scene,
        view: &ViewGeometry,
    ) -> Result<Option<Self>, RenderError> {
        let transfer = scene.resolve(&volume.sample);
        if transfer.iter().any(TransferFunction::has_membership) {
            return Ok(None);
        }
        let chunks = Chunks::new(volume, scene, view)?;
        let drawn: Vec<usize> = chunks.channels().map(|channel| channel.number).collect();
        let Some(first) = chunks.channels().next() else { return Ok(None) };
        let (grid, splatting) = (volume.grid(), &scene.splatting);
        let needs = (splatting.classification == Classification::After).then(|| BrickNeeds {
            reach: PlaneGeometry::new(view, grid).reach(view).sharing(drawn.len()),
            coefficients: None,
            bearing: Bearing::of(splatting.compositing),
        });
        let rim = match &needs {
            Some(needs) => needs.reach.along,
            None => UVec3::splat(u32::from(transfer.iter().any(TransferFunction::is_by_gradient))),
        };
        let hollow = chunks.channels().map(|channel| HollowChannel {
            labels: channel.levels().count() > 1,
            colors: volume.channels.get(channel.number).is_some_and(|of| of.values.store.has_colors()),
            holes: false,
        });
        let hollow: Vec<HollowChannel> = hollow.collect();
        let voxel = chunks.voxel_bytes();
        let are_many = |bits: &u32| chunks.budget() >= MANY_PAGES * (voxel << (3 * bits));
        let bits = PAGE_BITS.rev().find(are_many).unwrap_or(*PAGE_BITS.start());
        let all = grid.dims.map(|n| n.div_ceil(1 << bits)).as_u64vec3().element_product() * hollow.len() as u64;
        let format = format_of(volume);
        let pool = PagePool::new((gpu.device(), gpu.queue()), bits, (hollow, format), (chunks.budget(), all))?;
        let chunk = first.levels().next().map_or(UVec3::ONE, LevelChunks::chunk);
        let side = chunk.min(grid.dims).map(|n| n.clamp(1 << bits, 64).next_multiple_of(1 << bits));
        let numbers = drawn.iter().map(|&number| numbers_of(volume, number)).collect();
        let scene = scene.of_channels(&drawn);
        let half = side.max(UVec3::splat(LEAST_DEPTH)).as_dvec3() / 2.0;
        let deep = view.screen_from_voxel[2].truncate().abs().dot(2.0 * half);
        let depth = ((deep / view.slabs.width).ceil() as i32).max(1);
        let rim = rim.map(|n| n.next_multiple_of(SIDE));
        let (blocks, ahead) = (HashMap::new(), Vec::new());
        let division = Division { dims: grid.dims, bits, side, rim };
        Ok(Some(Self { chunks, gpu, scene, needs, numbers, pool, division, depth, blocks, ahead, clock: 0 }))
    }

    pub(super) fn chunks(&self) -> &Chunks<'a> {
        &self.chunks
    }

    fn grid(&self) -> &Grid {
        self.chunks.geometry().1
    }

    /// What has been read.
    pub(super) fn counts(&self) -> StoreCounts {
        let mut counts = self.chunks.counts();
        counts.chunk_bytes += self.pool.bytes();
        counts
    }

    /// The first step in which slabs behind a region are drawn front to back: as many as opaque pixels are not likely to hide, if they hide anything, and as pages
    /// have slots; `None` if those of the first slab have too few.
    ///
    /// # Errors
    /// If a store cannot be read, or holds a value that is no label.
    pub(super) fn step(
        &mut self,
        (region, open): (&Region, &OpenPixels),
        slabs: &Range<i32>,
        hides: bool,
    ) -> Result<Option<Step<Paging>>, RenderError> {
        self.clock += 1;
        // 32 bits count the voxels of all channels, with their labels and colours.
        let most_voxels = u64::from(u32::MAX) / (3 * self.numbers.len() as u64);
        // A group of sheets that two windows share is drawn twice.
        let group = |slab: i32| slab.div_euclid(SHEETS as i32) * SHEETS as i32;
        let limit = group(slabs.start.saturating_add(self.depth).saturating_add(SHEETS as i32 - 1));
        let mut end = if hides { slabs.end.min(limit.max(slabs.start + 1)) } else { slabs.end };
        let mut blocks = self.seen_blocks((region, open), slabs.start..end);
        blocks.sort_unstable_by_key(|&(first, block)| Reverse((first, block.to_array())));
        let nearest = blocks.last().map(|&(_, block)| ((block * self.division.side) >> self.division.bits, UVec3::ONE));
        let (mut drawn, mut needed) = (Vec::new(), Needed::default());
        // The pages of blocks that were read, by the first slab in which they are seen. A page is seen no sooner than its block.
        let mut ahead = BinaryHeap::new();
        loop {
            let nearest = ahead.peek().map_or(i32::MAX, |&Reverse((first, ..)): &Reverse<Ahead>| first);
            if blocks.last().is_some_and(|&(first, _)| first <= nearest) {
                let batch = blocks.split_off(blocks.len().saturating_sub(current_num_threads()));
                let capacity = self.pool.capacity();
                self.know(batch.iter().map(|&(_, block)| block), (open, &(slabs.start..end)))?;
                if self.pool.capacity() < capacity {
                    // Values need more bits than it seemed, so that there is no room for what has been chosen.
                    return self.step((region, open), slabs, hides);
                }
                for (_, at) in batch {
                    ahead.extend(self.seen_pages(at, open, &(slabs.start..end)));
                }
                continue;
            }
            let Some(Reverse((first, at, number))) = ahead.pop() else { break };
            let at = UVec3::from(at);
            let Some(block) = self.blocks.get_mut(&at) else { continue };
            block.used = self.clock;
            let pages = self.needed_pages((at, number), (open, &(slabs.start..end)));
            // Slots are fewer once values need more bits.
            if !needed.add(&pages, (self.pool.capacity(), most_voxels), self.division.bits) {
                // Of slabs before the first one of a page that has no slot everything is drawn.
                end = if group(first) > slabs.start { group(first) } else { first };
                break;
            }
            drawn.push((at, number));
        }
        if end <= slabs.start {
            return Ok(None);
        }
        let next = blocks.iter().rev().map(|&(_, block)| block).filter(|block| !self.blocks.contains_key(block));
        self.ahead = next.take(if hides { 0 } else { AHEAD * current_num_threads() }).collect();
        // Slabs may count that show nothing.
        let within = needed.within().or(nearest.filter(|_| self.chunks.counts_all()));
        let pages = Needed::sorted(needed.pages);
        Ok(Some((slabs.start..end, within.map(|within| Paging { drawn, pages, within }))))
    }

    /// The blocks of which open pixels may see something in some slabs, each with the first slab in which it is seen, without those that are known to show nothing there.
    fn seen_blocks(&self, (region, open): (&Region, &OpenPixels), slabs: Range<i32>) -> Vec<(i32, UVec3)> {
        let Some(VoxelBox { low, end }) = self.chunks.needed(region, &slabs) else { return Vec::new() };
        let (first, last) = (low / self.division.side, (end - 1) / self.division.side);
        let rows = (first.z..=last.z).flat_map(|z| (first.y..=last.y).map(move |y| [y, z]));
        let rows: Vec<[u32; 2]> = rows.collect();
        let in_row = |[y, z]: [u32; 2]| {
            let blocks = (first.x..=last.x).map(move |x| UVec3::new(x, y, z));
            blocks.filter_map(|block| self.seen(block, open, &slabs)).collect::<Vec<_>>()
        };
        rows.into_par_iter().flat_map_iter(in_row).collect()
    }

    /// Whether open pixels may see something of a block in some slabs, and in which one first.
    fn seen(&self, block: UVec3, open: &OpenPixels, slabs: &Range<i32>) -> Option<(i32, UVec3)> {
        let first = self.first_slab(self.division.voxels_of(block).bounds(), open, slabs)?;
        let is_empty = || self.blocks.get(&block).is_some_and(|known| known.pages.is_empty());
        let shows_nothing =
            !self.chunks.counts_all() && is_empty() && self.missing_parts(block, (open, slabs)).is_none();
        (!shows_nothing).then_some((first, block))
    }

    /// Those parts of a block and its rim by which it must be known what open pixels may see in some slabs, if they are more than those by which it is known: after
    /// splatting those that are seen themselves, before splatting all.
    fn missing_parts(&self, block: UVec3, (open, slabs): (&OpenPixels, &Range<i32>)) -> Option<Parts> {
        let is_seen = |part: &VoxelBox| self.needs.is_none() || self.first_slab(part.bounds(), open, slabs).is_some();
        let parts = self.division.rim_of(block).parts();
        let wanted = parts.filter(|(_, part)| is_seen(part)).fold(OWN, |wanted, (part, _)| wanted | part);
        let known = self.blocks.get(&block).map_or(0, |block| block.parts);
        (known & wanted != wanted).then_some(known | wanted)
    }

    /// The pages of a block, by their numbers there, of which open pixels may see something in some slabs.
    fn seen_pages(&self, at: UVec3, open: &OpenPixels, slabs: &Range<i32>) -> Vec<Reverse<Ahead>> {
        let pages = self.blocks.get(&at).into_iter().flat_map(|block| block.pages.iter().enumerate());
        let seen = pages.filter_map(|(number, drawn)| {
            let first = self.first_slab(self.division.voxels_of_page(drawn.page).bounds(), open, slabs)?;
            Some(Reverse((first, at.to_array(), number)))
        });
        seen.collect()
    }

    /// The pages of a block's page, given by its number there, and of its neighbours that are needed for what open pixels may see of it in some slabs.
    fn needed_pages(
        &self,
        (at, number): (UVec3, usize),
        (open, slabs): (&OpenPixels, &Range<i32>),
    ) -> Vec<ChannelPage> {
        let Some(block) = self.blocks.get(&at) else { return Vec::new() };
        let is_seen = |brick: &&Brick| self.first_slab(brick::bounds(brick), open, slabs).is_some();
        let lists = block.pages[number].lists.iter().enumerate();
        lists.flat_map(|(list, bricks)| self.needed_by(bricks.iter().filter(is_seen), list, &block.channels)).collect()
    }

    /// The pages that the bricks of a page in a list need, in the channels that are present.
    fn needed_by<'b>(
        &self,
        bricks: impl Iterator<Item = &'b Brick>,
        list: usize,
        present: &[usize],
    ) -> Vec<ChannelPage> {
        let mut pages: Vec<UVec3> = Vec::new();
        for page in bricks.flat_map(|brick| pages_around(brick, self.grid().dims, self.division.bits)) {
            if !pages.contains(&page) {
                pages.push(page);
            }
        }
        // After splatting each channel has a list.
        let own = [list];
        let channels = if self.needs.is_some() { &own } else { present };
        pages.iter().flat_map(|&page| channels.iter().map(move |&channel| (channel, page))).collect()
    }

    /// The first of some slabs in which open pixels may see something of a box of voxels, given by its middle and half its size; at least a slab before it is reached.
    fn first_slab(&self, (middle, half): (DVec3, DVec3), open: &OpenPixels, slabs: &Range<i32>) -> Option<i32> {
        let (view, _) = self.chunks.geometry();
        let bounds = self.chunks.bounds(middle, half + ROUNDING)?;
        let (depths, slack) = (view.depths(middle, half + ROUNDING), SLABS * view.slabs.width);
        let own = view.slabs.covered(depths.start - slack..depths.end + slack)?;
        let is_in_slabs = own.start < slabs.end && own.end > slabs.start;
        let is_seen = is_in_slabs && open.any_between(bounds.low - PIXELS, bounds.high + DVec2::splat(PIXELS));
        is_seen.then_some(own.start)
    }

    /// Reads those blocks of which it is not known what open pixels may see in some slabs.
    fn know(
        &mut self,
        blocks: impl Iterator<Item = UVec3>,
        seen: (&OpenPixels, &Range<i32>),
    ) -> Result<(), RenderError> {
        let missing = blocks.filter_map(|block| Some((block, self.missing_parts(block, seen)?)));
        let read = self.read_all(missing.collect())?;
        self.take(read)
    }

    /// Reads parts of blocks and their rims, each with its block's place.
    fn read_all(&self, blocks: Vec<(UVec3, Parts)>) -> Result<Vec<(UVec3, Read)>, RenderError> {
        blocks.into_par_iter().map(|(block, parts)| Ok((block, self.read(block, parts)?))).collect()
    }

    /// Notes what was read.
    fn take(&mut self, read: Vec<(UVec3, Read)>) -> Result<(), RenderError> {
        let mut all_pages = Vec::new();
        for (at, (block, pages)) in read {
            all_pages.extend(pages);
            self.blocks.insert(at, block);
        }
        self.put(all_pages, 0)?;
        Ok(())
    }

    /// Takes pages up. Where the format of values cannot store one, it drops all pages for another format, in which there is room for at least so many; then it
    /// returns whether it did not.
    fn put(&mut self, pages: Vec<ReadPage>, least: usize) -> Result<bool, RenderError> {
        if pages.iter().any(|(_, texels)| texels.is_none()) {
            self.pool.widen(least)?;
            return Ok(false);
        }
        pages.iter().for_each(|(page, texels)| texels.iter().for_each(|texels| self.pool.put(*page, texels)));
        Ok(true)
    }

    /// Reads parts of a block and its rim: what is known of it, and those of its pages that it needs itself.
    fn read(&self, at: UVec3, parts: Parts) -> Result<Read, RenderError> {
        let rim = self.division.rim_of(at);
        let Rim { own, within } = rim;
        let mut block = Block { parts, used: self.clock, ..Block::default() };
        let boxes = rim.boxes(parts);
        let Some((volume, numbers)) = self.chunks.read_parts((within, &boxes), own)? else {
            return Ok((block, Vec::new()));
        };
        let unread = within.voxels() - boxes.iter().map(VoxelBox::voxels).sum::<u64>();
        block.has_holes = volume.channels().any(|channel| channel.holes() > unread);
        let drawn = self.chunks.channels().enumerate().filter(|(_, channel)| numbers.contains(&channel.number));
        block.channels = drawn.map(|(at, _)| at).collect();
        let mut pages = BTreeMap::new();
        for (number, list) in self.lists(&volume, &block.channels).iter().enumerate() {
            let list_of = if self.needs.is_some() { block.channels[number] } else { 0 };
            for brick in list.bricks() {
                let at = within.low + UVec3::new(brick.x, brick.y, brick.z);
                if at.cmplt(own.low).any() || at.cmpge(own.end).any() {
                    continue;
                }
                let lists: &mut Vec<Vec<Brick>> = pages
                    .entry((at >> self.division.bits).to_array())
                    .or_insert_with(|| vec![Vec::new(); self.list_count()]);
                lists[list_of].push(Brick { x: at.x, y: at.y, z: at.z, ..*brick });
                block.bytes += size_of::<Brick>() as u64;
            }
        }
        let mut needed = HashSet::new();
        for (page, lists) in pages {
            for (list, bricks) in lists.iter().enumerate() {
                needed.extend(self.needed_by(bricks.iter(), list, &block.channels));
            }
            block.pages.push(DrawnPage { page: page.into(), lists });
        }
        let texels = |(channel, page): ChannelPage| {
            let low = self.division.voxels_of_page(page).low;
            let is_here = low.cmpge(own.low).all() && low.cmplt(own.end).all();
            let of = block.channels.iter().position(|&present| present == channel).filter(|_| is_here)?;
            let texels = PageTexels::cut_out(
                volume.channels().nth(of)?,
                low - within.low,
                self.division.bits,
                self.pool.format(),
            );
            Some(((channel, page), texels))
        };
        let texels = Needed::sorted(needed).into_iter().filter_map(texels).collect();
        Ok((block, texels))
    }

    /// The number of lists: one for each channel after splatting, else one for all.
    fn list_count(&self) -> usize {
        if self.needs.is_some() { self.numbers.len() } else { 1 }
    }

    /// The voxels of a box that are drawn, in a list for each of the channels that it has, or in one for all of them.
    fn lists(&self, volume: &Volume, channels: &[usize]) -> Vec<BrickList> {
        let scene = self.scene.of_channels(channels);
        let transfer = scene.resolve(volume);
        match &self.needs {
            Some(needs) => shown_lists(volume, &transfer, needs),
            None => {
                let clipped = scene.clip.voxels(volume.grid(), scene.splatting.radius);
                vec![brick_list(volume, &transfer, &clipped)]
            }
        }
    }

    /// Draws a window of some pages to those pixels, row by row, that are not closed.
    ///
    /// # Errors
    /// If a store cannot be read, or the device fails.
    pub(super) fn draw(
        &mut self,
        Paging { drawn, pages, within: (low, across) }: Paging,
        (window, closed): (&Window, Option<&[bool]>),
        light: Option<&GivenLight>,
    ) -> Result<(Content, Stats), RenderError> {
        while !self.hold(&pages)? {}
        let from = low << self.division.bits;
        let grid = self.grid().part(from, (across << self.division.bits).min(self.grid().dims - from));
        let known = || drawn.iter().filter_map(|(at, number)| self.blocks.get(at).map(|block| (block, *number)));
        let open = match closed {
            Some(closed) => OpenPixels::new(window.region, closed.iter().map(|is_closed| !is_closed)),
            None => OpenPixels::all(window.region),
        };
        let lists = (0..self.list_count()).map(|list| {
            // A page lies partly in other windows, or behind closed pixels.
            let bricks: Vec<&Brick> = known().flat_map(|(block, number)| &block.pages[number].lists[list]).collect();
            let is_seen = |brick: &&Brick| self.first_slab(brick::bounds(brick), &open, &window.slabs).is_some();
            let seen = bricks.into_par_iter().filter(is_seen);
            let moved =
                |brick: &Brick| Brick { x: brick.x - from.x, y: brick.y - from.y, z: brick.z - from.z, ..*brick };
            BrickList::of_bricks(&grid, seen.map(moved).collect())
        });
        let lists = lists.collect();
        // A channel of which a page is not needed has holes there.
        let holes = self.numbers.len() > 1 || known().any(|(block, _)| block.has_holes);
        let hollow: Vec<HollowChannel> =
            (0..self.numbers.len()).map(|number| HollowChannel { holes, ..self.pool.channel(number) }).collect();
        let paged = self.pool.paged((low, across), &pages, (self.numbers.clone(), lists))?;
        let volume = GpuVolume::paged(self.pool.device(), Volume::hollow(grid, &hollow), paged);
        let ahead = std::mem::take(&mut self.ahead);
        let of_thread = &*self;
        let draw = || of_thread.gpu.draw_pages(&volume, &of_thread.scene, (window, closed), light);
        let (drawn, read) = join(draw, || of_thread.read_all(ahead.into_iter().map(|block| (block, ALL)).collect()));
        self.forget();
        self.take(read?)?;
        drawn
    }

    /// Reads those of some pages that are not held; if the format changed, which it does once, some are still missing, and it returns false.
    fn hold(&mut self, pages: &[ChannelPage]) -> Result<bool, RenderError> {
        let missing = self.pool.need(pages);
        for batch in missing.chunks(16 * current_num_threads().max(1)) {
            let of_thread = &*self;
            let read = batch.par_iter().map(|&page| Ok((page, of_thread.read_page(page)?)));
            let read = read.collect::<Result<Vec<_>, RenderError>>()?;
            if !self.put(read, pages.len())? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Reads a page of a channel; nothing if the format of values cannot store one.
    fn read_page(&self, (channel, page): ChannelPage) -> Result<Option<PageTexels>, RenderError> {
        let within = self.division.voxels_of_page(page);
        let grid = self.grid().part(within.low, within.end - within.low);
        let of = self.chunks.channels().nth(channel);
        let volume = of.map_or_else(|| Ok(Volume::hollow(grid, &[])), |channel| channel.read_all(within, &grid))?;
        Ok(PageTexels::cut_out(&volume, UVec3::ZERO, self.division.bits, self.pool.format()))
    }

    /// Drops what is known of the blocks that were not used for the longest time, if all together take too much memory.
    fn forget(&mut self) {
        let mut held: u64 = self.blocks.values().map(|block| block.bytes).sum();
        let most = self.chunks.budget() / LISTS_SHARE;
        if held <= most {
            return;
        }
        let known = self.blocks.iter().filter(|(_, block)| block.bytes > 0);
        let mut oldest: Vec<(u64, [u32; 3])> = known.map(|(at, block)| (block.used, at.to_array())).collect();
        oldest.sort_unstable();
        for at in oldest.into_iter().map(|(_, at)| UVec3::from(at)) {
            if held <= most {
                return;
            }
            held -= self.blocks.remove(&at).map_or(0, |block| block.bytes);
        }
    }
}
