//! `shaders/occlude.wgsl` against a plain evaluation: a pixel is occluded if all pixels on the image in the box that starts there are
//! opaque. Bits make this exact.

use std::collections::BTreeSet;
use std::ops::Range;

use bytemuck::Zeroable;
use glam::{DVec3, UVec3};
use sheetsplat::headless::GpuHeadless;
use sheetsplat::internals::brick::BrickList;
use sheetsplat::internals::gpu::layout::SheetGroup;
use sheetsplat::internals::gpu::targets::Targets;
use sheetsplat::internals::gpu::uniforms;
use sheetsplat::internals::kernel::Kernel;
use sheetsplat::internals::pass::occlude::Occlude;
use sheetsplat::internals::quad_plan::{FramePlan, TILE, tile_grid};
use sheetsplat::internals::view_geometry::ViewGeometry;
use sheetsplat::settings::{Method, Order, Window};
use sheetsplat::volume::Grid;
use sheetsplat::wgpu::{BufferUsages, TextureFormat};

use crate::common::devices::gpu;
use crate::common::{Random, SPACINGS, random_eye, scene};
use crate::stages::{at_offsets, compute, contents, frame, init, tile_list};

/// One bit per pixel of an image.
#[derive(Clone, PartialEq)]
struct Mask {
    size: [u32; 2],
    bits: Vec<bool>,
}

impl Mask {
    fn at(&self, x: u32, y: u32) -> bool {
        self.bits[(y * self.size[0] + x) as usize]
    }

    /// Words of 32 pixels of a row; bits off the image are `off`.
    fn words(&self, off: bool) -> Vec<u32> {
        let [width, height] = self.size;
        let columns = tile_grid(self.size)[0];
        (0..height)
            .flat_map(|y| (0..columns).map(move |column| (column * TILE, y)))
            .map(|(left, y)| {
                let bit = |x: u32| if x < width { self.at(x, y) } else { off };
                (0..TILE).filter(|i| bit(left + i)).fold(0, |word, i| word | 1 << i)
            })
            .collect()
    }

    fn from_words(size: [u32; 2], words: &[u32]) -> Self {
        let columns = tile_grid(size)[0];
        let bit = |x: u32, y: u32| words[(y * columns + x / TILE) as usize] >> (x % TILE) & 1 == 1;
        Self { size, bits: (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| bit(x, y))).collect() }
    }

    /// The mask of pixels from which the whole box to the right and down, clipped at the image's borders, is set.
    fn eroded(&self, reach: [u32; 2]) -> Self {
        let [width, height] = self.size;
        // With sums over rectangles, a box is four look-ups.
        let stride = width as usize + 1;
        let mut sums = vec![0; stride * (height as usize + 1)];
        for y in 0..height as usize {
            for x in 0..width as usize {
                let clear = u32::from(!self.at(x as u32, y as u32));
                sums[(y + 1) * stride + x + 1] =
                    clear + sums[y * stride + x + 1] + sums[(y + 1) * stride + x] - sums[y * stride + x];
            }
        }
        let is_set = |x: u32, y: u32| {
            let (left, top) = (x as usize, y as usize);
            let (right, bottom) = (width.min(x + reach[0] + 1) as usize, height.min(y + reach[1] + 1) as usize);
            let sum = |x: usize, y: usize| sums[y * stride + x];
            sum(right, bottom) + sum(left, top) == sum(left, bottom) + sum(right, top)
        };
        Self { size: self.size, bits: (0..height).flat_map(|y| (0..width).map(move |x| is_set(x, y))).collect() }
    }

    /// A mask that is mostly set, with clear rectangles and single clear pixels.
    fn random(random: &mut Random, size: [u32; 2]) -> Self {
        let mut mask = Self { size, bits: vec![true; (size[0] * size[1]) as usize] };
        for _ in 0..random.bits() % 5 {
            let side = if random.bits().is_multiple_of(2) { 1.0 } else { 20.0 };
            mask.fill(random, side, false);
        }
        mask
    }

    /// Sets or clears a rectangle with sides of up to `most`, anywhere.
    fn fill(&mut self, random: &mut Random, most: f64, value: bool) {
        let corner = self.size.map(|side| random.uniform(0.0, f64::from(side)) as u32);
        let sides = [(); 2].map(|()| random.uniform(1.0, most + 1.0) as u32);
        for y in corner[1]..self.size[1].min(corner[1] + sides[1]) {
            for x in corner[0]..self.size[0].min(corner[0] + sides[0]) {
                self.bits[(y * self.size[0] + x) as usize] = value;
            }
        }
    }

    /// The tiles in which two masks differ, and those whose boxes reach into them.
    fn changed_tiles(&self, other: &Self, reach: [u32; 2]) -> Vec<u32> {
        let [columns, _] = tile_grid(self.size);
        let margin = reach.map(|pixels| pixels.div_ceil(TILE));
        let mut tiles = BTreeSet::new();
        for y in 0..self.size[1] {
            for x in 0..self.size[0] {
                if self.at(x, y) != other.at(x, y) {
                    let (column, row) = (x / TILE, y / TILE);
                    for row in row.saturating_sub(margin[1])..=row {
                        for column in column.saturating_sub(margin[0])..=column {
                            tiles.insert(row * columns + column);
                        }
                    }
                }
            }
        }
        tiles.into_iter().collect()
    }
}

struct Fixture<'a> {
    gpu: &'a GpuHeadless,
    stage: &'a Occlude,
    reach: [u32; 2],
    targets: Targets,
}

impl Fixture<'_> {
    /// Computes the listed tiles from a mask and returns the occlusion buffer.
    fn run(&self, mask: &Mask, tiles: &[u32]) -> Vec<u32> {
        let device = self.gpu.device();
        let frame = frame(|scene| (scene.image.width, scene.image.height) = mask.size.into());
        let frame = init(device, &[frame], BufferUsages::UNIFORM);
        // The group is not at the first offset.
        let group = SheetGroup { box_filter: self.reach, ..SheetGroup::zeroed() };
        let (group, offset) = at_offsets(device, &[SheetGroup::zeroed(), group]);
        // As the composite stage leaves it: off the image all pixels are opaque.
        self.gpu.queue().write_buffer(&self.targets.opaque, 0, bytemuck::cast_slice(&mask.words(true)));
        let tiles = tile_list(device, tiles);
        let groups = self.stage.bind(device, [&frame, &group], &tiles, &self.targets);
        compute(self.gpu, |pass| self.stage.record(pass, &groups, offset, &tiles));
        contents(self.gpu, &self.targets.occluded)
    }
}

#[test]
fn occluded_where_the_whole_box_is_opaque() {
    let gpu = gpu();
    let stage = Occlude::new(gpu.device());
    let mut random = Random(12);
    let (mut occluded, mut pixels) = (0, 0);
    let sizes = [[1, 1], [33, 31], [70, 45], [32, 64], [157, 90], [200, 3], [5, 150]];
    for size in sizes.into_iter().cycle().take(90) {
        let most = [0.0, 8.0, 68.0, 140.0][random.bits() as usize % 4];
        // A box is never wider than the image, because `reach` is at most its size.
        let reach = size.map(|side: u32| side.min(random.uniform(0.0, most + 1.0) as u32));
        let targets = Targets::new(gpu.device(), size, TextureFormat::Rgba32Float, 1).unwrap();
        let fixture = Fixture { gpu, stage: &stage, reach, targets };
        let [columns, rows] = tile_grid(size);
        let mut mask = Mask::random(&mut random, size);
        let words = fixture.run(&mask, &(0..columns * rows).rev().collect::<Vec<_>>());
        let expected = mask.eroded(reach);
        assert!(Mask::from_words(size, &words) == expected, "{size:?}, reach {reach:?}: all tiles");

        // A few more pixels become opaque, and only the tiles that these can change are listed.
        let before = mask.clone();
        mask.fill(&mut random, 30.0, true);
        let tiles = mask.changed_tiles(&before, reach);
        let words = fixture.run(&mask, &tiles);
        let expected = mask.eroded(reach);
        assert!(Mask::from_words(size, &words) == expected, "{size:?}, reach {reach:?}: {} tiles", tiles.len());
        occluded += expected.bits.iter().filter(|&&bit| bit).count();
        pixels += expected.bits.len();
    }
    assert!(occluded > pixels / 10 && occluded < pixels * 9 / 10, "{occluded} of {pixels} pixels are occluded");
}

#[test]
fn tiles_that_are_not_listed_stay() {
    let gpu = gpu();
    let stage = Occlude::new(gpu.device());
    let size = [150, 75];
    let targets = Targets::new(gpu.device(), size, TextureFormat::Rgba32Float, 1).unwrap();
    for stale in [&targets.opaque_columns, &targets.occluded] {
        gpu.queue().write_buffer(stale, 0, bytemuck::cast_slice(&vec![0x0f0f_0f0f_u32; stale.size() as usize / 4]));
    }
    let fixture = Fixture { gpu, stage: &stage, reach: [0, 5], targets };
    let mask = Mask { size, bits: vec![true; 150 * 75] };
    let listed = [3, 6, 14];
    let words = fixture.run(&mask, &listed);
    for (at, word) in (0..).zip(words) {
        let tile = at / 5 / TILE * 5 + at % 5;
        let expected = if listed.contains(&tile) { u32::MAX } else { 0x0f0f_0f0f };
        assert_eq!(word, expected, "row {} of tile {tile}", at / 5);
    }
    assert!(fixture.run(&mask, &[]).contains(&0x0f0f_0f0f), "nothing listed, nothing done");
}

/// The result of a group's box in a tile where nothing changes stays valid for the groups behind it, if none has a larger box.
#[test]
fn boxes_shrink_on_the_way_back() {
    let mut random = Random(13);
    let mut shrunk = 0;
    for spacing in SPACINGS {
        let grid = Grid::new(UVec3::new(40, 31, 36), DVec3::from(spacing));
        let bricks = BrickList::new(&grid, &(0..grid.dims.element_product()).collect::<Vec<_>>());
        for _ in 0..30 {
            let mut scene = scene(90, 70);
            scene.camera = random_eye(&mut random, &grid);
            scene.splatting.method = random.pick(&[Method::ImageAligned, Method::AxisAligned]);
            scene.splatting.slab_width = random.pick(&[0.3, 1.0, 2.6]);
            let view = ViewGeometry::new(&grid, &scene.camera, &scene.splatting, [90, 70]).unwrap();
            let kernel = Kernel::new(scene.splatting.radius, scene.splatting.falloff);
            let plan = FramePlan::new(
                [bricks.bricks()],
                view,
                random.pick(&[1, 2, 4]),
                Order::FrontToBack,
                0.0..0.0,
                &Window::whole([1; 2]).slabs,
            );
            let filter =
                |planes: &Range<f64>| uniforms::group(&view, &kernel, &scene.splatting, planes.clone()).box_filter;
            let filters: Vec<[u32; 2]> = plan.groups.iter().map(|group| filter(&group.planes)).collect();
            for pair in filters.windows(2) {
                assert!(pair[1][0] <= pair[0][0] && pair[1][1] <= pair[0][1], "{pair:?}, {scene:?}");
                shrunk += usize::from(pair[0] != pair[1]);
            }
        }
    }
    assert!(shrunk > 100, "boxes shrink {shrunk} times only");
}
