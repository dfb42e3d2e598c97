//! The frame plan against `reference::geometry`: every kernel's brick is in the range of every sheet group that the kernel reaches.

use std::ops::Range;

use glam::{DVec3, UVec3};
use sheetsplat::internals::brick::{self, BrickList};
use sheetsplat::internals::quad_plan::{FramePlan, Overlaps};
use sheetsplat::internals::reference::Geometry;
use sheetsplat::internals::view_geometry::ViewGeometry;
use sheetsplat::settings::{Order, Window};
use sheetsplat::volume::Grid;

use crate::common::{Random, camera, scene};

#[test]
fn every_kernel_is_looked_at_by_every_group_that_it_reaches_into() {
    let mut random = Random(23);
    for spacing in [[1.0, 1.0, 1.0], [1.0, 1.0, 5.0], [3.2, 3.2, 1.5]] {
        let grid = Grid::new(UVec3::new(19, 18, 17), DVec3::from(spacing));
        // There are two lists, and voxels that do not take part.
        let taking_part = (0..grid.dims.element_product()).filter(|_| random.uniform(0.0, 1.0) < 0.7);
        let voxels: Vec<u32> = taking_part.collect();
        let lists = [&voxels[..1000], &voxels[1000..]].map(|list| BrickList::new(&grid, list));
        for (radius, slab_width, sheets) in [(2.0, 1.0, 4), (1.4, 0.3, 2), (4.0, 2.7, 4), (1.0, 8.0, 1)] {
            for order in [Order::FrontToBack, Order::BackToFront] {
                let mut scene = scene(64, 48);
                scene.camera = camera(random.direction().to_array(), 12.0);
                (scene.splatting.radius, scene.splatting.slab_width) = (radius, slab_width);
                let geometry = Geometry::new(&grid, &scene).unwrap();
                let view = ViewGeometry::new(&grid, &scene.camera, &scene.splatting, [64, 48]).unwrap();
                let plan_of = |drawn: &Range<i32>| {
                    FramePlan::new(lists.each_ref().map(BrickList::bricks), view, sheets, order, 0.0..0.0, drawn)
                };
                let plan = plan_of(&Window::whole([1; 2]).slabs);
                // A part has the groups that its slabs lie in, and no others.
                for drawn in [-3..5, 2..3, -400..-1, 4..4] {
                    let is_drawn = |first: i32| first < drawn.end && first + sheets as i32 > drawn.start;
                    let groups = plan.groups.iter().filter(|group| !drawn.is_empty() && is_drawn(group.first_slab));
                    assert_eq!(plan_of(&drawn).groups, groups.cloned().collect::<Vec<_>>(), "{drawn:?}");
                }

                let firsts: Vec<i32> = plan.groups.iter().map(|group| group.first_slab).collect();
                let (forwards, backwards) = (firsts.is_sorted_by(|a, b| a < b), firsts.is_sorted_by(|a, b| a > b));
                assert!(if order == Order::FrontToBack { forwards } else { backwards }, "{firsts:?}");

                let mut sections = 0;
                for (list, bricks) in lists.iter().enumerate() {
                    for (at, brick) in bricks.bricks().iter().enumerate() {
                        let slot = plan.orders[list].iter().position(|&brick| brick as usize == at).unwrap() as u32;
                        for (_, voxel) in brick::voxels(brick) {
                            let depth = geometry.depth(voxel);
                            for k in -200_i32..200 {
                                let near = f64::from(k) * geometry.slab_width;
                                let far = near + geometry.slab_width;
                                let overlap = (depth + radius).min(far) - (depth - radius).max(near);
                                assert!(overlap.abs() > 1e-8, "a random view has no kernel that just touches a plane");
                                if overlap > 0.0 {
                                    sections += 1;
                                    let first = k - k.rem_euclid(sheets as i32);
                                    let group = plan.groups.iter().find(|group| group.first_slab == first).unwrap();
                                    assert!((group.planes.start - f64::from(first) * geometry.slab_width).abs() < 1e-9);
                                    assert!(group.bricks[list].contains(&slot), "voxel {voxel}, slab {k}");
                                }
                            }
                        }
                    }
                }
                let counted = lists.iter().map(|list| Overlaps::count(list.bricks(), &view));
                assert_eq!(counted.reduce(Overlaps::and).unwrap().sections, sections);
            }
        }
    }
}

#[test]
fn bricks_hold_every_voxel_once_within_their_box() {
    let mut random = Random(5);
    let grid = Grid::new(UVec3::new(11, 6, 9), DVec3::ONE);
    let count = grid.dims.element_product();
    let voxels: Vec<u32> = (0..count).filter(|_| random.uniform(0.0, 1.0) < 0.4).collect();
    let mut list = BrickList::new(&grid, &voxels);
    assert_holds(&list, &voxels);
    assert!(list.bricks().is_sorted_by_key(brick::position));

    // Other voxels replace them, some in bricks that were empty.
    let others: Vec<u32> = (0..count).filter(|_| random.uniform(0.0, 1.0) < 0.1).collect();
    let few = BrickList::new(&grid, &others);
    let mut few_then_all = few.clone();
    let all: Vec<u32> = (0..count).collect();
    few_then_all.change(&all.iter().copied().filter(|&voxel| !few.contains(voxel)).collect::<Vec<_>>(), &[]);
    assert!(!few_then_all.bricks().is_sorted_by_key(brick::position), "some bricks are new");
    assert_holds(&few_then_all, &all);
    assert_eq!(few_then_all.compacted(), BrickList::new(&grid, &all));
    list.change(
        &others.iter().copied().filter(|voxel| !voxels.contains(voxel)).collect::<Vec<_>>(),
        &voxels.iter().copied().filter(|voxel| !others.contains(voxel)).collect::<Vec<_>>(),
    );
    assert_holds(&list, &others);
    assert!(list.bricks().iter().any(|brick| brick::present(brick) == 0), "some bricks are empty");
    assert_eq!(list.compacted(), BrickList::new(&grid, &others));
}

fn assert_holds(list: &BrickList, voxels: &[u32]) {
    let mut seen: Vec<u32> = Vec::new();
    for (at, brick) in list.bricks().iter().enumerate() {
        let low = UVec3::new(brick.x, brick.y, brick.z);
        let high = low + UVec3::new(brick.extent & 3, (brick.extent >> 2) & 3, (brick.extent >> 4) & 3);
        let places: Vec<UVec3> = brick::voxels(brick).map(|(_, voxel)| voxel).collect();
        // The box is tight: some voxel touches every side, and none lies outside.
        if !places.is_empty() {
            assert_eq!(places.iter().copied().reduce(UVec3::min), Some(low));
            assert_eq!(places.iter().copied().reduce(UVec3::max), Some(high));
        }
        for (slot, voxel) in brick::voxels(brick) {
            let index = voxel.x + 11 * (voxel.y + 6 * voxel.z);
            assert_eq!(list.place(index), Some(at as u32 * 64 + slot));
            seen.push(index);
        }
    }
    seen.sort_unstable();
    assert_eq!(seen, voxels);
    assert!((0..11 * 6 * 9).all(|index| list.contains(index) == voxels.contains(&index)));
}
