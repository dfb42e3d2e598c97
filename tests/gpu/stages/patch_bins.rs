//! The tile rasterizer's bins against `reference::geometry`: every kernel's brick is in the bin of every tile and sheet group that the
//! kernel reaches.

use std::collections::BTreeSet;
use std::ops::Range;

use glam::{DVec2, DVec3, DVec4, UVec3};
use sheetsplat::internals::brick::{self, BrickList};
use sheetsplat::internals::brick_union;
use sheetsplat::internals::gpu::layout::Brick;
use sheetsplat::internals::kernel::Kernel;
use sheetsplat::internals::patch_bins::{self, PATCH, PatchBins, SHEETS, TileCapacityError, Work};
use sheetsplat::internals::reference::{self, Geometry};
use sheetsplat::internals::view_geometry::ViewGeometry;
use sheetsplat::scene::Scene;
use sheetsplat::settings::Projection;
use sheetsplat::settings::{Order, Window};
use sheetsplat::volume::Grid;

use crate::common::{Random, camera, scene};

/// A view of some bricks.
struct Case {
    scene: Scene,
    grid: Grid,
    bricks: BrickList,
}

impl Case {
    /// Some voxels do not take part.
    fn new(random: &mut Random, spacing: [f64; 3], size: [u32; 2]) -> Self {
        let grid = Grid::new(UVec3::new(15, 13, 18), spacing.into());
        let count = grid.dims.element_product();
        let voxels: Vec<u32> = (0..count).filter(|_| random.uniform(0.0, 1.0) < 0.3).collect();
        let mut scene = scene(size[0], size[1]);
        let unit = grid.unit();
        scene.camera = camera(random.direction().to_array(), random.uniform(5.0, 40.0) * unit);
        scene.splatting.radius = random.uniform(1.0, 3.0);
        scene.splatting.slab_width = random.pick(&[0.3, 1.0, 2.6]);
        if random.bits().is_multiple_of(2) {
            let distance = Some(random.uniform(10.0, 60.0) * unit);
            scene.camera.projection = Projection::Perspective { fov_y: 40.0, distance, near: Some(4.0 * unit) };
        }
        if random.bits().is_multiple_of(2) {
            scene.splatting.order = Order::BackToFront;
        }
        Self { scene, grid, bricks: BrickList::new(&grid, &voxels) }
    }

    fn kernel(&self) -> Kernel {
        Kernel::new(self.scene.splatting.radius, self.scene.splatting.falloff)
    }

    fn bins(&self, most_words: u64) -> Result<PatchBins, TileCapacityError> {
        self.bins_of(&Window::whole([1; 2]).slabs, most_words)
    }

    /// The bins of some slabs.
    fn bins_of(&self, drawn: &Range<i32>, most_words: u64) -> Result<PatchBins, TileCapacityError> {
        let Scene { camera, splatting, image, .. } = &self.scene;
        let view = ViewGeometry::new(&self.grid, camera, splatting, [image.width, image.height]).unwrap();
        PatchBins::new(
            self.bricks.bricks(),
            (&view, None),
            splatting.order,
            (0.0..0.0, drawn),
            self.kernel().support(),
            Work { search: 0, threads: 8, layers: 1, looks: true },
            most_words,
        )
    }

    /// The entries that the kernels need: group, tile, brick.
    fn needed(&self) -> BTreeSet<(i32, [u32; 2], u32)> {
        let geometry = Geometry::new(&self.grid, &self.scene).unwrap();
        let kernel = self.kernel();
        let last = geometry.size - 1.0;
        let mut needed = BTreeSet::new();
        for (number, brick) in (0..).zip(self.bricks.bricks()) {
            for (_, voxel) in brick::voxels(brick).filter(|(_, voxel)| geometry.is_beyond_near(*voxel)) {
                let (center, depth) = (geometry.pixel(voxel), geometry.depth(voxel));
                let splat = reference::Splat { center, depth, amount: DVec4::ONE, alpha: 1.0 };
                for k in geometry.slabs(&splat, kernel.radius()) {
                    let Some(section) = geometry.section(&splat, k, &kernel) else { continue };
                    let (low, high) = section.pixels(kernel.support());
                    let (low, high) = (low.max(DVec2::ZERO), high.min(last));
                    if low.cmple(high).all() {
                        let [low, high] = [low, high].map(|pixel| pixel.as_uvec2().to_array());
                        let tiles = |axis: usize| low[axis] / PATCH[axis]..=high[axis] / PATCH[axis];
                        let group = k.div_euclid(SHEETS as i32);
                        needed.extend(tiles(1).flat_map(|y| tiles(0).map(move |x| (group, [x, y], number))));
                    }
                }
            }
        }
        needed
    }

    /// The entries of the bins.
    fn held(&self, bins: &PatchBins) -> BTreeSet<(i32, [u32; 2], u32)> {
        let [columns, _] = patch_bins::grid([self.scene.image.width, self.scene.image.height]);
        let first_group = bins.first_slab.div_euclid(SHEETS as i32);
        let mut held = BTreeSet::new();
        for (bin, bounds) in bins.starts().windows(2).enumerate() {
            let (tile, at) = (bin as u32 / bins.groups, bin as u32 % bins.groups);
            let in_order = match self.scene.splatting.order {
                Order::FrontToBack => at,
                Order::BackToFront => bins.groups - 1 - at,
            };
            let entries = &bins.words[bounds[0] as usize..bounds[1] as usize];
            let position = |entry: &u32| brick::position(&self.bricks.bricks()[*entry as usize]);
            assert!(entries.is_sorted_by(|a, b| position(a) < position(b)), "in memory order, once each");
            let at = [tile % columns, tile / columns];
            held.extend(entries.iter().map(|&entry| (first_group + in_order as i32, at, entry)));
        }
        held
    }
}

#[test]
fn every_kernel_is_in_the_bins_that_it_reaches_into() {
    let mut random = Random(51);
    // The numbers of entries needed and held, without and with an eye.
    let mut all = [[0, 0]; 2];
    for spacing in [[1.0, 1.0, 1.0], [1.0, 1.0, 5.0], [3.2, 3.2, 1.5]] {
        for size in [[64, 48], [33, 17], [7, 90], [1, 1]].into_iter().cycle().take(12) {
            let case = Case::new(&mut random, spacing, size);
            let bins = case.bins(u64::MAX).unwrap();
            let (needed, held) = (case.needed(), case.held(&bins));
            assert_eq!(bins.half_boxes.len(), bins.groups as usize);
            let missing: Vec<_> = needed.difference(&held).collect();
            // A part has the bins of the groups that its slabs lie in, and no others.
            for drawn in [-3..5, 2..3, -400..-1, 4..4] {
                let is_drawn = |group: i32| group * 4 < drawn.end && group * 4 + 4 > drawn.start && !drawn.is_empty();
                let of_part = held.iter().filter(|(group, ..)| is_drawn(*group)).copied();
                assert_eq!(case.held(&case.bins_of(&drawn, u64::MAX).unwrap()), of_part.collect(), "{drawn:?}");
            }
            assert!(missing.is_empty(), "{} of {}, {:?}: {:?}", missing.len(), needed.len(), missing[0], case.scene);
            let of = &mut all[usize::from(matches!(case.scene.camera.projection, Projection::Perspective { .. }))];
            *of = [of[0] + needed.len(), of[1] + held.len()];
        }
    }
    // Bricks are boxes around their voxels, and all footprints in a group have the same box.
    let [without, with] = all.map(|[needed, held]| held as f64 / needed as f64);
    assert!(without < 1.6 && with < 3.0, "{without} and {with} times as much as needed");
}

/// The number of dispatches suffices for what lies behind two pixels, and is hardly larger.
#[test]
fn dispatches_are_enough() {
    let mut random = Random(52);
    for (side, slab_width, is_one) in [(12, 1.0, true), (24, 1.0, false), (24, 0.3, false), (4, 0.05, true)] {
        let mut case = Case::new(&mut random, [1.0; 3], [2, 2]);
        case.grid.dims = UVec3::splat(side);
        case.bricks = BrickList::new(&case.grid, &(0..side.pow(3)).collect::<Vec<_>>());
        case.scene.camera = camera([0.3, 0.9, -0.2], 30.0);
        (case.scene.splatting.radius, case.scene.splatting.slab_width) = (1.5, slab_width);
        let bins = case.bins(u64::MAX).unwrap();
        assert_eq!(bins.dispatches == 1, is_one, "{side} {slab_width}: {}", bins.dispatches);
        let (passes, bricks) = (bins.passes, bins.words.len() as u32 - bins.bins - 1);
        let all = bins.groups * passes.per_group + bricks * passes.per_brick;
        assert!(bins.dispatches * passes.most >= all, "{} for {all}", bins.dispatches);
        assert!(bins.dispatches <= 2 * (all / passes.most) + 1, "{} for {all}", bins.dispatches);
    }
}

#[test]
fn joined_bricks_have_the_voxels_of_all_lists() {
    let mut random = Random(54);
    let grid = Grid::new(UVec3::new(13, 9, 10), DVec3::ONE);
    let all: Vec<u32> = (0..grid.dims.element_product()).collect();
    let mut some = |one_in: u64| all.iter().copied().filter(|_| random.bits().is_multiple_of(one_in)).collect();
    let voxels: Vec<Vec<u32>> = [2, 50, 200, 9, 1000, 30, 70, 40, 300, 90].map(&mut some).to_vec();
    let lists: Vec<BrickList> = voxels.iter().map(|voxels| BrickList::new(&grid, voxels)).collect();
    let joined = brick_union::of(&lists.iter().map(BrickList::bricks).collect::<Vec<_>>());
    let mut union = voxels.concat();
    union.sort_unstable();
    union.dedup();
    let without_lists: Vec<Brick> =
        joined.iter().map(|brick| Brick { extent: brick.extent & 0xffff, ..*brick }).collect();
    assert_eq!(without_lists, BrickList::new(&grid, &union).bricks());
    for (number, list) in lists.iter().enumerate() {
        let has = |at: &Brick| list.bricks().iter().any(|brick| brick::position(brick) == brick::position(at));
        for brick in &joined {
            assert_eq!(brick.extent >> (16 + number) & 1 == 1, has(brick), "list {number}, {brick:?}");
        }
    }
    // Bricks that have become empty are left out.
    let mut left = lists[1].clone();
    left.change(&[], &voxels[1]);
    assert_eq!(brick_union::of(&[left.bricks(), left.bricks()]), []);
}

#[test]
fn quantities_that_exceed_the_capacity_are_named() {
    let mut random = Random(53);
    let mut case = Case::new(&mut random, [1.0; 3], [64, 48]);
    case.scene.camera = camera([0.3, 0.9, -0.2], 30.0);
    let bins = case.bins(u64::MAX).unwrap();
    let [starts, all] = [bins.starts().len(), bins.words.len()].map(|count| count as u64);
    let entries = all - starts;
    assert!(entries > 1);
    assert_eq!(case.bins(all).as_ref(), Ok(&bins), "just enough room");
    let unfit = |what, required, actual| Err(TileCapacityError { what, required, actual });
    assert_eq!(case.bins(all - 1), unfit("bricks in patches and sheet groups", entries, entries - 1));
    assert_eq!(case.bins(starts - 1), unfit("patches times sheet groups", starts - 1, starts - 2));

    // 2744 bricks are behind two pixels, in four sheets.
    case.grid.dims = UVec3::splat(56);
    case.bricks = BrickList::new(&case.grid, &(0..56 * 56 * 56).collect::<Vec<_>>());
    (case.scene.image.width, case.scene.image.height) = (2, 2);
    (case.scene.splatting.slab_width, case.scene.camera) = (8.0, camera([0.0, 1.0, 0.0], 60.0));
    let Err(TileCapacityError { what: "bricks behind a patch in one sheet group", required, actual }) =
        case.bins(u64::MAX)
    else {
        panic!("all bricks fit");
    };
    assert!(actual < required && required <= 2744, "{required} {actual}");
}
