//! The frame plan against `reference::geometry`: every kernel is in the range of every slab that it reaches into.

use glam::{DVec2, DVec3, UVec3};
use sheetsplat::kernel::Kernel;
use sheetsplat::plan::{FramePlan, View};
use sheetsplat::reference::Geometry;
use sheetsplat::splatting::Order;
use sheetsplat::volume::Grid;

use crate::common::{Random, camera, scene};

#[test]
fn every_kernel_is_drawn_in_every_slab_that_it_reaches() {
    let mut random = Random(23);
    for spacing in [[1.0, 1.0, 1.0], [1.0, 1.0, 5.0], [3.2, 3.2, 1.5]] {
        let grid = Grid { dims: UVec3::new(9, 8, 7), spacing: DVec3::from(spacing) };
        // Two lists, and voxels that take no part.
        let indices: Vec<u32> = (0..grid.dims.element_product()).filter(|_| random.uniform(0.0, 1.0) < 0.7).collect();
        let lists = [&indices[..100], &indices[100..]];
        for (radius, slab_width) in [(2.0, 1.0), (1.4, 0.3), (4.0, 2.7), (1.0, 8.0)] {
            for order in [Order::FrontToBack, Order::BackToFront] {
                let mut scene = scene(64, 48);
                // Close up: some voxels are off the screen.
                scene.camera = camera(random.direction().to_array(), 12.0);
                (scene.splatting.radius, scene.splatting.slab_width) = (radius, slab_width);
                let geometry = Geometry::new(&grid, &scene).unwrap();
                let view = View::new(&grid, &scene.camera, &scene.splatting, [64, 48]).unwrap();
                let kernel = Kernel::new(radius, scene.splatting.falloff);
                let plan = FramePlan::new(&grid, lists, view, &kernel, order);

                let planned: Vec<i32> =
                    plan.slabs.iter().map(|slab| (slab.near / geometry.slab_width).round() as i32).collect();
                let forwards = planned.is_sorted_by(|a, b| a < b);
                let backwards = planned.is_sorted_by(|a, b| a > b);
                assert!(if order == Order::FrontToBack { forwards } else { backwards }, "{planned:?}");

                let pixels_from_footprint = geometry.footprint_from_pixels.inverse();
                let (mut sections, mut on_screen) = (0, 0);
                for (list, indices) in lists.into_iter().enumerate() {
                    for (at, &index) in (0..).zip(indices) {
                        let (depth, center) =
                            (geometry.depth(grid.voxel_at(index)), geometry.pixel(grid.voxel_at(index)));
                        // A pixel of the image within the footprint's bounding box.
                        let half = kernel.support()
                            * DVec2::new(pixels_from_footprint.row(0).length(), pixels_from_footprint.row(1).length());
                        let (low, high) = ((center - half - 0.5).ceil(), (center + half - 0.5).floor());
                        let shown = low.max(DVec2::ZERO).cmple(high.min(geometry.size - 1.0)).all();
                        let slot = plan.orders[list].iter().position(|&voxel| voxel == at).map(|slot| slot as u32);
                        assert!(slot.is_some() || !shown, "voxel {index} at {center} is missing");
                        on_screen += u32::from(shown);
                        for k in -200..200 {
                            let near = f64::from(k) * geometry.slab_width;
                            let overlap = (depth + radius).min(near + geometry.slab_width) - (depth - radius).max(near);
                            assert!(overlap.abs() > 1e-7, "a random view has no kernel that just touches a plane");
                            sections += u64::from(overlap > 0.0);
                            if let Some(slot) = slot.filter(|_| overlap > 0.0) {
                                let slab = planned.iter().position(|&planned| planned == k).unwrap();
                                let range = &plan.slabs[slab].splats[list];
                                assert!(range.contains(&slot), "voxel {index}, {overlap} deep in slab {k}: {range:?}");
                            }
                        }
                    }
                }
                assert_eq!(plan.counts.sections_total, sections);
                assert!(on_screen > 50 && plan.counts.voxels_in_range == indices.len() as u64);
            }
        }
    }
}
