//! `shaders/tiles.wgsl` against a plain evaluation of its rules: exact lists, arguments and counts.

use bytemuck::Zeroable;
use sheetsplat::headless::GpuHeadless;
use sheetsplat::internals::gpu::layout::{Frame, Indirect, SheetGroup, Tally};
use sheetsplat::internals::gpu::targets::Targets;
use sheetsplat::internals::pass::tiles::Tiles;
use sheetsplat::internals::quad_plan::{TILE, tile_grid};
use sheetsplat::settings::Order;
use sheetsplat::wgpu::{BufferUsages, TextureFormat};

use crate::common::Random;
use crate::common::devices::gpu;
use crate::stages::{at_offsets, compute, contents, frame, indirect, init};

/// The stage's input.
#[derive(Debug)]
struct Case {
    size: [u32; 2],
    reach: [u32; 2],
    culling: bool,
    tiles: bool,
    /// Whether each tile received splats.
    touched: Vec<bool>,
    /// Whether each tile's pixels are all opaque.
    opaque: Vec<bool>,
    /// Of groups that are planes (SPEC §9): for every tile the number of the last group with a value in it, or 0, and the order of groups.
    planes: Option<(Vec<u32>, Order)>,
}

/// The number of the group that is tested.
const NUMBER: u32 = 7;

impl Case {
    fn random(random: &mut Random, size: [u32; 2], reach: [u32; 2]) -> Self {
        let [columns, rows] = tile_grid(size);
        // Few, many or all of the tiles.
        let mut flags = || {
            let share = [0.0, 0.02, 0.5, 0.95, 1.0][random.bits() as usize % 5];
            (0..columns * rows).map(|_| random.uniform(0.0, 1.0) < share).collect()
        };
        let (touched, opaque) = (flags(), flags());
        Self {
            size,
            reach,
            culling: !random.bits().is_multiple_of(4),
            tiles: !random.bits().is_multiple_of(4),
            touched,
            opaque,
            planes: None,
        }
    }

    /// Whether the plane before has a value in a tile, which then holds for the whole slab.
    fn is_behind_value(&self, tile: usize) -> bool {
        self.planes.as_ref().is_some_and(|(last_groups, order)| {
            let before = if *order == Order::FrontToBack { NUMBER - 1 } else { NUMBER + 1 };
            last_groups[tile] == before
        })
    }

    fn composited(&self) -> Vec<u32> {
        let is_composited = |tile: &u32| {
            let at = *tile as usize;
            (!self.tiles || self.touched[at] || self.is_behind_value(at)) && !(self.culling && self.opaque[at])
        };
        (0..self.touched.len() as u32).filter(is_composited).collect()
    }

    /// The tiles with a pixel whose box reaches into a composited tile.
    fn occluding(&self) -> Vec<u32> {
        if !self.culling {
            return Vec::new();
        }
        let columns = tile_grid(self.size)[0];
        let composited = self.composited();
        let reaches = |a: u32, b: u32, reach: u32| {
            // The nearest pixels of two tiles along an axis are adjacent if the tiles are.
            a == b || b > a && (b - a - 1) * TILE < reach
        };
        (0..self.touched.len() as u32)
            .filter(|tile| {
                composited.iter().any(|other| {
                    reaches(tile % columns, other % columns, self.reach[0])
                        && reaches(tile / columns, other / columns, self.reach[1])
                })
            })
            .collect()
    }

    fn check(&self, gpu: &GpuHeadless, stage: &Tiles, group: u32) {
        const GROUPS: u32 = 5;
        let device = gpu.device();
        let targets = Targets::new(device, self.size, TextureFormat::Rgba32Float, 1).unwrap();
        let opaque: Vec<u32> = self.opaque.iter().map(|&opaque| opaque.into()).collect();
        gpu.queue().write_buffer(&targets.opaque_tiles, 0, bytemuck::cast_slice(&opaque));
        let order = self.planes.as_ref().map_or(Order::FrontToBack, |(last_groups, order)| {
            gpu.queue().write_buffer(&targets.last_groups, 0, bytemuck::cast_slice(last_groups));
            *order
        });
        let counts: [u32; 8] = [3, 1, 4, 1, 5, 9, 2, 6];
        assert_eq!(size_of_val(&counts), size_of::<Tally>());
        let culled: Vec<u32> = counts.into_iter().chain(self.touched.iter().map(|&touched| touched.into())).collect();
        let culled = init(device, &culled, BufferUsages::STORAGE);
        let frame = Frame {
            culling: self.culling.into(),
            tiles: self.tiles.into(),
            order: order as u32,
            ..frame(|scene| (scene.image.width, scene.image.height) = self.size.into())
        };
        let frame = init(device, &[frame], BufferUsages::UNIFORM);
        let uniforms: Vec<SheetGroup> = (0..GROUPS)
            .map(|index| SheetGroup { box_filter: self.reach, index, number: NUMBER, ..SheetGroup::zeroed() })
            .collect();
        let (groups, stride) = at_offsets(device, &uniforms);
        let lists = stage.prepare(device, [&frame, &groups, &culled], &targets, GROUPS as usize, None).unwrap();
        compute(gpu, |pass| stage.record(pass, &lists, group * stride));

        for (name, buffer, expected) in
            [("composited", &lists.composited, self.composited()), ("occluding", &lists.occluding, self.occluding())]
        {
            let words: Vec<u32> = contents(gpu, buffer);
            let (args, tiles) = words.split_at(size_of::<Indirect>() / 4);
            let args: Indirect = bytemuck::cast(<[u32; 9]>::try_from(args).unwrap());
            assert_eq!(args, indirect(expected.len() as u32), "{name}: {self:?}");
            // The order does not matter.
            let mut tiles = tiles[..expected.len()].to_vec();
            tiles.sort_unstable();
            assert_eq!(tiles, expected, "{name}: {self:?}");
        }
        let culled: Vec<u32> = contents(gpu, &culled);
        assert_eq!(culled[..8], counts, "the tally's counts are other stages'");
        assert!(culled[8..].iter().all(|&flag| flag == 0), "the flags are ready for the next group: {self:?}");
        let mut of_groups = [0; GROUPS as usize];
        of_groups[group as usize] = self.composited().len() as u32;
        assert_eq!(contents::<u32>(gpu, &lists.counts), of_groups);
    }
}

#[test]
fn lists_are_those_of_the_rules() {
    let gpu = gpu();
    let stage = Tiles::new(gpu.device());
    let mut random = Random(4);
    // From one tile to more tiles than a workgroup has threads.
    let sizes = [[1, 1], [32, 32], [33, 64], [700, 500], [2000, 20], [9, 1000], [1024, 1024]];
    let reaches = [[0, 0], [1, 0], [32, 31], [33, 64], [5, 70], [200, 1]];
    let mut lengths = [0; 2];
    for case in 0..60 {
        let size: [u32; 2] = sizes[case % sizes.len()];
        let reach: [u32; 2] = reaches[case / sizes.len() % reaches.len()];
        let reach = [reach[0].min(size[0]), reach[1].min(size[1])];
        let case = Case::random(&mut random, size, reach);
        case.check(gpu, &stage, random.bits() as u32 % 5);
        if case.culling {
            lengths[0] += case.composited().len();
            lengths[1] += case.occluding().len();
        }
    }
    assert!(lengths[0] > 1000 && lengths[1] > lengths[0], "{lengths:?}");
}

/// Groups that are planes are composited where the plane before has a value, too, front to back and back to front.
#[test]
fn lists_of_planes_are_those_of_the_rules() {
    let gpu = gpu();
    let stage = Tiles::of_planes(gpu.device());
    let mut random = Random(9);
    let sizes = [[33, 64], [700, 500], [2000, 20]];
    let mut behind = 0;
    for case in 0..24 {
        let size: [u32; 2] = sizes[case % sizes.len()];
        let reach = [random.bits() as u32 % 40, 3];
        let mut case = Case::random(&mut random, size, reach);
        let order = random.pick(&[Order::FrontToBack, Order::BackToFront]);
        let last = (0..case.touched.len()).map(|_| random.pick(&[0, NUMBER - 2, NUMBER - 1, NUMBER, NUMBER + 1]));
        case.planes = Some((last.collect(), order));
        case.check(gpu, &stage, random.bits() as u32 % 5);
        behind += case.composited().iter().filter(|&&tile| case.tiles && !case.touched[tile as usize]).count();
    }
    assert!(behind > 100, "{behind}");
}

/// One tile in the middle: the occlusion buffer changes as far around it as the box reaches, in whole tiles.
#[test]
fn margins_are_the_reach_in_whole_tiles() {
    let gpu = gpu();
    let stage = Tiles::new(gpu.device());
    let (columns, rows) = (11, 9);
    for (reach, margin) in
        [([0, 0], [0, 0]), ([1, 32], [1, 1]), ([33, 31], [2, 1]), ([64, 65], [2, 3]), ([500, 0], [11, 0])]
    {
        let mut touched = vec![false; columns * rows];
        touched[4 * columns + 5] = true;
        let size = [columns as u32 * TILE - 7, rows as u32 * TILE - 1];
        let opaque = vec![false; columns * rows];
        let case = Case { size, reach, culling: true, tiles: true, touched, opaque, planes: None };
        let expected: Vec<u32> = (0..(columns * rows) as u32)
            .filter(|tile| {
                let reaches = |at: u32, other: u32, margin: u32| (other.saturating_sub(margin)..=other).contains(&at);
                reaches(tile % 11, 5, margin[0]) && reaches(tile / 11, 4, margin[1])
            })
            .collect();
        assert_eq!(case.occluding(), expected, "{reach:?}");
        case.check(gpu, &stage, 0);
    }
}
