//! Culling, tiles and groups (SPEC §6) change only the cost.

use glam::DVec3;
use sheetsplat::headless::GpuHeadless;
use sheetsplat::settings::Compositing;
use sheetsplat::settings::Projection;
use sheetsplat::volume::builtin;

use crate::common::compare::assert_at_most;
use crate::common::devices::{DRAWINGS, Drawing, drawn_forms, gpu, on_adapter};
use crate::common::{BY_MEANS, RASTERIZERS, Random, scene};
use crate::modes::{OUTLIERS, random_case, render, share_off};

/// Behind a surface everything is culled, and the image does not change.
#[test]
fn surfaces_cull_and_the_others_do_not() {
    let gpu = gpu();
    let volume = builtin::volume("head:48").unwrap();
    let mut scene = scene(100, 90);
    scene.camera.direction = DVec3::new(0.4, 0.8, -0.3);
    // The threshold is below the opacity that is stored while no surface has been reached.
    scene.splatting.opacity_threshold = 0.2;
    let projections = [scene.camera.projection, Projection::Perspective { fov_y: 40.0, distance: None, near: None }];
    for (compositing, projection) in
        BY_MEANS.into_iter().flat_map(|compositing| projections.map(|projection| (compositing, projection)))
    {
        (scene.splatting.compositing, scene.camera.projection) = (compositing, projection);
        for (drawing, footprint) in drawn_forms() {
            scene.splatting.footprint = footprint;
            let [with, without] = [true, false].map(|culling| {
                scene.splatting.culling = culling;
                render(drawing, gpu, &volume, &scene)
            });
            let share = share_off(&with.0.pixels, &without.0.pixels, 1e-4);
            assert_at_most(share, OUTLIERS, format_args!("{compositing:?}, {drawing:?}, {footprint:?}: pixels"));
            let [with, without] = [with, without].map(|(_, counts)| counts.sections_rasterized);
            match compositing {
                Compositing::Surface => assert!(with < without * 2 / 3, "{drawing:?}: {with} of {without}"),
                _ => assert_eq!(with, without, "{compositing:?}, {drawing:?}"),
            }
        }
    }
}

/// The image does not depend on how sheets are grouped and which tiles are composited.
#[test]
fn tiles_and_groups_change_nothing() {
    let renderers = [1, 2, 4].map(|n| GpuHeadless::new(&on_adapter().with_sheets_per_group(n)).unwrap());
    let mut random = Random(91);
    for (case, compositing) in (0..12).zip(BY_MEANS.into_iter().cycle()) {
        let (volume, mut scene) = random_case(&mut random);
        scene.splatting.compositing = compositing;
        for rasterizer in RASTERIZERS {
            let [with, without] = [true, false].map(|tiles| {
                scene.splatting.tiles = tiles;
                render(Drawing::By(rasterizer), &renderers[2], &volume, &scene).0
            });
            assert_eq!(with, without, "case {case}, {rasterizer:?}");
        }
        let [one, two, four] = [0, 1, 2].map(|at| render(DRAWINGS[0], &renderers[at], &volume, &scene).0);
        for few in [one, two] {
            let share = share_off(&few.pixels, &four.pixels, 1e-4);
            assert_at_most(share, OUTLIERS, format_args!("case {case}: pixels with {scene:?}"));
        }
    }
}
