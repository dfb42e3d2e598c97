//! The frame plan against `reference::geometry`: every kernel's brick is in the range of every sheet group that the kernel
//! reaches into.

use glam::{DVec3, UVec3};
use sheetsplat::brick;
use sheetsplat::gpu::layout::{Brick, Voxel};
use sheetsplat::plan::{FramePlan, View, add_sections, count_sections};
use sheetsplat::reference::Geometry;
use sheetsplat::splatting::Order;
use sheetsplat::volume::Grid;

use crate::common::{Random, camera, scene};

#[test]
fn every_kernel_is_looked_at_by_every_group_that_it_reaches_into() {
    let mut random = Random(23);
    for spacing in [[1.0, 1.0, 1.0], [1.0, 1.0, 5.0], [3.2, 3.2, 1.5]] {
        let grid = Grid { dims: UVec3::new(19, 18, 17), spacing: DVec3::from(spacing) };
        // Two lists, and voxels that take no part.
        let taking_part = (0..grid.dims.element_product()).filter(|_| random.uniform(0.0, 1.0) < 0.7);
        let voxels: Vec<Voxel> =
            taking_part.map(|index| Voxel { index, value: 1.0, normal: 0, gradient_magnitude: 0.0 }).collect();
        let lists = [&voxels[..1000], &voxels[1000..]].map(|list| brick::group(&grid, list));
        for (radius, slab_width, sheets) in [(2.0, 1.0, 4), (1.4, 0.3, 2), (4.0, 2.7, 4), (1.0, 8.0, 1)] {
            for order in [Order::FrontToBack, Order::BackToFront] {
                let mut scene = scene(64, 48);
                scene.camera = camera(random.direction().to_array(), 12.0);
                (scene.splatting.radius, scene.splatting.slab_width) = (radius, slab_width);
                let geometry = Geometry::new(&grid, &scene).unwrap();
                let view = View::new(&grid, &scene.camera, &scene.splatting, [64, 48]).unwrap();
                let plan = FramePlan::new(lists.each_ref().map(|(_, bricks)| bricks.as_slice()), view, sheets, order);

                let firsts: Vec<i32> = plan.groups.iter().map(|group| group.first_slab).collect();
                let (forwards, backwards) = (firsts.is_sorted_by(|a, b| a < b), firsts.is_sorted_by(|a, b| a > b));
                assert!(if order == Order::FrontToBack { forwards } else { backwards }, "{firsts:?}");

                let mut sections = 0;
                for (list, (voxels, bricks)) in lists.iter().enumerate() {
                    for (at, brick) in bricks.iter().enumerate() {
                        let slot = plan.orders[list].iter().position(|&brick| brick as usize == at).unwrap() as u32;
                        for voxel in members(voxels, brick) {
                            let depth = geometry.depth(grid.voxel_at(voxel.index));
                            for k in -200_i32..200 {
                                let near = f64::from(k) * geometry.slab_width;
                                let far = near + geometry.slab_width;
                                let overlap = (depth + radius).min(far) - (depth - radius).max(near);
                                assert!(overlap.abs() > 1e-8, "a random view has no kernel that just touches a plane");
                                if overlap > 0.0 {
                                    sections += 1;
                                    let first = k - k.rem_euclid(sheets as i32);
                                    let group = plan.groups.iter().find(|group| group.first_slab == first).unwrap();
                                    assert!((group.near - f64::from(first) * geometry.slab_width).abs() < 1e-9);
                                    assert!(group.bricks[list].contains(&slot), "voxel {}, slab {k}", voxel.index);
                                }
                            }
                        }
                    }
                }
                let counted = lists.iter().map(|(voxels, _)| {
                    let indices: Vec<u32> = voxels.iter().map(|voxel| voxel.index).collect();
                    count_sections(&grid, &indices, &view).unwrap()
                });
                assert_eq!(counted.reduce(add_sections).unwrap().0, sections);
            }
        }
    }
}

#[test]
fn bricks_hold_every_voxel_once_within_their_box() {
    let mut random = Random(5);
    let grid = Grid { dims: UVec3::new(11, 6, 9), spacing: DVec3::ONE };
    let taking_part = (0..grid.dims.element_product()).filter(|_| random.uniform(0.0, 1.0) < 0.4);
    let voxels: Vec<Voxel> =
        taking_part.map(|index| Voxel { index, value: 1.0, normal: 0, gradient_magnitude: 0.0 }).collect();
    let (sorted, bricks) = brick::group(&grid, &voxels);
    let mut seen: Vec<u32> = Vec::new();
    for brick in &bricks {
        assert!((1..=64).contains(&brick.count));
        let low = UVec3::new(brick.x, brick.y, brick.z);
        let high = low + UVec3::new(brick.extent & 0xff, (brick.extent >> 8) & 0xff, brick.extent >> 16);
        let places: Vec<UVec3> = members(&sorted, brick).iter().map(|voxel| grid.voxel_at(voxel.index)).collect();
        // Tight: some voxel touches every side, and none lies beyond.
        assert_eq!(places.iter().copied().reduce(UVec3::min), Some(low));
        assert_eq!(places.iter().copied().reduce(UVec3::max), Some(high));
        seen.extend(members(&sorted, brick).iter().map(|voxel| voxel.index));
    }
    seen.sort_unstable();
    assert_eq!(seen, voxels.iter().map(|voxel| voxel.index).collect::<Vec<_>>());
}

fn members<'a>(voxels: &'a [Voxel], brick: &Brick) -> &'a [Voxel] {
    &voxels[brick.first as usize..(brick.first + brick.count) as usize]
}
