//! Lists (§5.1): a changed view shows bit for bit what a fresh one shows, and a change touches only what depends on it.

#[path = "../../benches/lists/slice_lists.rs"]
mod slice_lists;

use std::sync::Arc;

use glam::DVec3;
use sheetsplat::Renderer;
use sheetsplat::headless::GpuHeadless;
use sheetsplat::internals::gpu::classified_volume::Touched;
use sheetsplat::internals::iso_range::{ValueSet, ordinal};
use sheetsplat::internals::value_list::ValueList;
use sheetsplat::scene::{Scene, TransferSettings};
use sheetsplat::settings::Light;
use sheetsplat::settings::{Camera, Projection};
use sheetsplat::settings::{Classification, Compositing, FootprintForm, Method, Rasterizer, Splatting};
use sheetsplat::settings::{Ramp, TransferFunction};
use sheetsplat::volume::{Volume, builtin};
use sheetsplat::{Prepared, SceneView};

use slice_lists::SliceLists;

use crate::common::devices::gpu;
use crate::common::{COMPOSITINGS, RASTERIZERS, Random, camera, scene, transfer};

fn skin() -> TransferSettings {
    transfer(&[(20.0, [0.2, 0.4, 0.9]), (200.0, [1.0, 0.8, 0.6])], &[(60.0, 0.0), (120.0, 0.6), (255.0, 1.0)])
}

fn head() -> (Arc<Volume>, Scene) {
    let scene = Scene { camera: camera([0.5, 0.8, -0.2], 170.0), ..scene(90, 75) }.with_transfer(skin());
    (Arc::new(builtin::volume("head:48").unwrap()), scene)
}

/// The voxels that take part, determined by a scan.
fn taking_part(volume: &Volume, transfer: &TransferFunction) -> Vec<bool> {
    (0..)
        .zip(volume.values())
        .map(|(index, value)| {
            let gradient = volume.gradient(volume.grid().voxel_at(index));
            transfer.tables(volume.label(index)).alpha(value.into(), gradient.length()) > 0.0
        })
        .collect()
}

fn assert_fresh(gpu: &GpuHeadless, view: &mut SceneView, name: &str) {
    let drawn = gpu.draw(view).unwrap();
    let scene = view.scene().clone().with_transfer(view.volume().transfer()[0].clone());
    let fresh = gpu.render_volume(view.volume().volume().clone(), &scene).unwrap();
    assert!(drawn.image == fresh.image, "{name}: the image is not that of a fresh view");
    let counts = |rendering: &sheetsplat::headless::Rendering| {
        let mut counts = rendering.stats.counts;
        // Bricks that became empty are tested without effect.
        counts.bricks_tested = 0;
        counts
    };
    assert_eq!(counts(&drawn), counts(&fresh), "{name}");
    // The next frame is the same.
    assert!(gpu.draw(view).unwrap().image == drawn.image, "{name}: the next frame differs");
}

#[test]
fn a_changed_view_is_a_fresh_one() {
    let gpu = gpu();
    for rasterizer in RASTERIZERS {
        assert_changes_are_fresh(gpu, rasterizer);
    }
}

fn assert_changes_are_fresh(gpu: &GpuHeadless, rasterizer: Rasterizer) {
    let (volume, mut scene) = head();
    scene.splatting.rasterizer = rasterizer;
    // Few voxels at first, so that the lists must grow later.
    scene.channels[0].transfer.iso_ranges = Some(vec![[200.0, 255.0]]);
    let mut view = gpu.view(volume.clone(), &scene).unwrap();
    assert_fresh(gpu, &mut view, "first");
    let mut random = Random(8);
    let (mut entered, mut left, mut rebuilt) = (0, 0, 0);
    for step in 0..40 {
        let before = taking_part(&volume, &view.volume().transfer()[0]);
        let old = view.volume().transfer()[0].clone();
        let touched = match random.bits() % 4 {
            0 => {
                let lo = random.uniform(-20.0, 200.0);
                let ranges = vec![[lo, lo + random.uniform(0.0, 60.0)], [random.uniform(0.0, 255.0), 300.0]];
                view.set_iso_ranges(Some(ranges)).unwrap()
            }
            1 => view.set_iso_ranges(None).unwrap(),
            2 => {
                let start = random.uniform(0.0, 150.0);
                let opacity = Ramp::new(vec![(start, 0.0), (start + 20.0, 0.7), (255.0, random.uniform(0.0, 1.0))]);
                view.set_transfer_function(TransferFunction { opacity: opacity.unwrap(), ..old }).unwrap()
            }
            _ => {
                let start = random.uniform(0.0, 8.0);
                let ramp = Ramp::new(vec![(start, 0.0), (start + 3.0, 1.0)]).unwrap();
                let gradient_opacity = (random.uniform(0.0, 1.0) < 0.7).then_some(ramp);
                view.set_transfer_function(TransferFunction { gradient_opacity, ..old }).unwrap()
            }
        };
        let after = taking_part(&volume, &view.volume().transfer()[0]);
        let count = |was: bool, is: bool| {
            before.iter().zip(&after).filter(|&(&before, &after)| (before, after) == (was, is)).count() as u64
        };
        assert_eq!((touched.entered, touched.left), (count(false, true), count(true, false)), "step {step}");
        entered += touched.entered;
        left += touched.left;
        rebuilt += u64::from(touched.rebuilt);
        // Only some changes are drawn.
        if random.uniform(0.0, 1.0) < 0.75 || touched.rebuilt {
            assert_fresh(gpu, &mut view, &format!("{rasterizer:?}, step {step}"));
        }
    }
    assert!(entered > 10_000 && left > 10_000, "{entered} entered, {left} left");
    assert!((1..20).contains(&rebuilt), "{rebuilt} of 40 changes needed more room");
}

/// After changes of labels' tables or visibility, too, a view equals a fresh one, with each rasterizer.
#[test]
fn changed_labels_are_fresh_ones() {
    let gpu = gpu();
    for (rasterizer, seed) in [(Rasterizer::Tiles, 21), (Rasterizer::Quads, 22)] {
        let (volume, mut scene) = head();
        scene.splatting.rasterizer = rasterizer;
        let mut view = gpu.view(volume.clone(), &scene).unwrap();
        assert_fresh(gpu, &mut view, "without tables");
        let mut random = Random(seed);
        let (mut entered, mut left) = (0, 0);
        for step in 0..30 {
            let before = taking_part(&volume, &view.volume().transfer()[0]);
            let mut transfer = view.volume().transfer()[0].clone();
            let label = (random.bits() % 8) as u16;
            let start = random.uniform(0.0, 150.0);
            let tables = transfer.labels.entry(label).or_default();
            let touched = match random.bits() % 7 {
                0 | 1 => view.set_label_visible(label, !tables.visible),
                2 => {
                    transfer.labels.remove(&label);
                    view.set_transfer_function(transfer).unwrap()
                }
                3 => {
                    tables.color = Some(Ramp::new(vec![(start, random.direction().abs())]).unwrap());
                    view.set_transfer_function(transfer).unwrap()
                }
                4 => {
                    let points = vec![(start, 0.0), (start + 30.0, random.uniform(0.1, 1.0))];
                    tables.opacity = Some(Ramp::new(points).unwrap());
                    view.set_transfer_function(transfer).unwrap()
                }
                5 => {
                    let points = vec![(start / 20.0, 0.0), (start / 20.0 + 3.0, 1.0)];
                    tables.gradient_opacity = Some(Ramp::new(points).unwrap());
                    view.set_transfer_function(transfer).unwrap()
                }
                _ => view.set_iso_ranges((start < 50.0).then(|| vec![[2.0 * start, 250.0]])).unwrap(),
            };
            let after = taking_part(&volume, &view.volume().transfer()[0]);
            let count = |was: bool, is: bool| {
                before.iter().zip(&after).filter(|&(&before, &after)| (before, after) == (was, is)).count() as u64
            };
            let name = format!("{rasterizer:?}, step {step}");
            assert_eq!((touched.entered, touched.left), (count(false, true), count(true, false)), "{name}");
            entered += touched.entered;
            left += touched.left;
            // Only some changes are drawn.
            if random.uniform(0.0, 1.0) < 0.75 {
                assert_fresh(gpu, &mut view, &name);
            }
        }
        assert!(entered > 1000 && left > 1000, "{entered} entered, {left} left");
    }
}

/// A change of a label touches only its own voxels, and none if the same voxels take part.
#[test]
fn a_change_of_a_label_touches_its_voxels() {
    let gpu = gpu();
    let (volume, scene) = head();
    let mut view = gpu.view(volume.clone(), &scene).unwrap();
    let of_label = |label: u16| {
        let part = taking_part(&volume, &scene.channels[0].transfer.resolve(&volume))
            .into_iter()
            .zip(volume.labels().unwrap());
        part.filter(|&(is_part, &of)| is_part && of == label).count() as u64
    };
    let prepare = |view: &mut SceneView| gpu.renderer().prepare(gpu.device(), gpu.queue(), view).unwrap().bucketed;
    assert!(prepare(&mut view) && of_label(4) > 100 && of_label(7) > 10);
    assert_eq!(view.set_label_visible(4, true), Touched::default());
    assert!(!prepare(&mut view), "nothing changed");
    assert_eq!(view.set_label_visible(4, false), Touched { left: of_label(4), ..Touched::default() });
    assert_fresh(gpu, &mut view, "grey matter hidden");
    let touched = view.set_label_visible(4, true);
    assert_eq!((touched.entered, touched.left), (of_label(4), 0));
    assert_fresh(gpu, &mut view, "grey matter shown");
    // Hidden by its opacity instead.
    let mut transfer = view.volume().transfer()[0].clone();
    transfer.labels.entry(7).or_default().opacity = Some(Ramp::new(vec![(0.0, 0.0)]).unwrap());
    assert_eq!(view.set_transfer_function(transfer).unwrap(), Touched { left: of_label(7), ..Touched::default() });
    assert_fresh(gpu, &mut view, "eyes without opacity");
    // Colours and opacities of a visible label: its voxels are only shaded again.
    for green in [0.2, 0.7] {
        let mut transfer = view.volume().transfer()[0].clone();
        let tables = transfer.labels.entry(5).or_default();
        tables.color = Some(Ramp::new(vec![(0.0, DVec3::new(0.1, green, 0.1))]).unwrap());
        tables.opacity = Some(Ramp::new(vec![(60.0, 0.0), (140.0, green)]).unwrap());
        assert_eq!(view.set_transfer_function(transfer).unwrap(), Touched::default());
        assert!(!prepare(&mut view), "colour and opacity of a label");
        assert_fresh(gpu, &mut view, "colour and opacity of a label");
    }
    // A volume that is not segmented has no labels to hide.
    let cube = Arc::new(builtin::volume("cube:16").unwrap());
    let mut view = gpu.view(cube, &scene).unwrap();
    assert_eq!(view.set_label_visible(0, false), Touched::default());
    assert_fresh(gpu, &mut view, "no labels");
}

/// Axis-aligned slices are the same for many directions (§3.1): every axis is sorted once, and a new view along it sorts nothing.
#[test]
fn a_turn_sorts_no_slices() {
    let gpu = gpu();
    let (volume, mut scene) = head();
    scene.splatting.method = Method::AxisAligned;
    scene.splatting.rasterizer = Rasterizer::Quads;
    let mut view = gpu.view(volume, &scene).unwrap();
    let mut look = |direction: [f64; 3], projection: Option<Projection>| {
        let camera = camera(direction, 170.0);
        view.set_camera(Camera { projection: projection.unwrap_or(camera.projection), ..camera }).unwrap();
        let bucketed = gpu.renderer().prepare(gpu.device(), gpu.queue(), &mut view).unwrap().bucketed;
        assert_fresh(gpu, &mut view, &format!("{direction:?}"));
        bucketed
    };
    assert!(look([0.5, 0.8, -0.2], None), "along y for the first time");
    assert!(!look([0.6, 0.7, 0.1], None), "still along y");
    let perspective = Projection::Perspective { fov_y: 40.0, distance: None, near: None };
    assert!(!look([0.6, 0.7, 0.1], Some(perspective)), "with an eye");
    assert!(look([0.8, 0.5, -0.2], None), "along x");
    assert!(look([0.1, 0.2, 0.9], None), "along z");
    assert!(look([0.1, 0.2, -0.9], None), "against z");
    assert!(!look([-0.3, 0.7, 0.6], None), "y is known");
    assert!(!look([0.7, 0.3, 0.3], None), "x, too");
    assert!(!look([0.0, 0.001, -1.0], None), "and -z");
}

/// Table 3's parameters, changed at run time: the image equals a fresh view's, and the footprint table is made again for another kernel, in the
/// sections form also for another slab width, and never for a threshold (§3.3.1).
#[test]
fn parameters_change_at_run_time() {
    let gpu = gpu();
    let (volume, mut scene) = head();
    let prepare = |view: &mut SceneView| gpu.renderer().prepare(gpu.device(), gpu.queue(), view).unwrap();
    let perspective = Projection::Perspective { fov_y: 30.0, distance: None, near: None };
    let projections = [scene.camera.projection, perspective];
    for (rasterizer, footprint, projection) in [
        (Rasterizer::Tiles, FootprintForm::SummedArea),
        (Rasterizer::Quads, FootprintForm::SummedArea),
        (Rasterizer::Quads, FootprintForm::Sections),
    ]
    .into_iter()
    .flat_map(|(rasterizer, footprint)| projections.map(|projection| (rasterizer, footprint, projection)))
    {
        (scene.splatting.rasterizer, scene.splatting.footprint) = (rasterizer, footprint);
        scene.camera.projection = projection;
        let mut view = gpu.view(volume.clone(), &scene).unwrap();
        let has_table = rasterizer == Rasterizer::Quads;
        assert_eq!(prepare(&mut view), Prepared { bucketed: true, tabled: has_table }, "the first frame");
        let first = scene.splatting;
        let (sections, wider) = (footprint == FootprintForm::Sections, Splatting { slab_width: 2.0, ..first });
        let narrower = Splatting { radius: 1.4, slab_width: 3.0, ..first };
        for (name, splatting, bucketed, tabled) in [
            ("slab width 2", wider, true, sections),
            ("slab width 3", Splatting { slab_width: 3.0, ..first }, true, sections),
            ("threshold 0.8", Splatting { slab_width: 3.0, opacity_threshold: 0.8, ..first }, false, false),
            ("radius 1.4", narrower, true, has_table),
            ("falloff 3", Splatting { falloff: 3.0, ..narrower }, false, has_table),
            ("as at first", first, true, has_table),
        ] {
            view.set_splatting(splatting).unwrap();
            let name = format!("{rasterizer:?}, {footprint:?}, {projection:?}: {name}");
            assert_eq!(prepare(&mut view), Prepared { bucketed, tabled }, "{name}");
            assert_fresh(gpu, &mut view, &name);
        }
    }
}

/// Any compositing can change to any other. Buckets stay, except for `minimum`, for which empty sheets count too.
#[test]
fn every_compositing_is_a_fresh_one() {
    let gpu = gpu();
    let looks_at_all = |compositing| compositing == Compositing::Minimum;
    for rasterizer in RASTERIZERS {
        let (volume, mut scene) = head();
        scene.splatting.rasterizer = rasterizer;
        let mut view = gpu.view(volume, &scene).unwrap();
        gpu.draw(&mut view).unwrap();
        for skip in 1..COMPOSITINGS.len() {
            for at in 0..COMPOSITINGS.len() {
                let [old, compositing] =
                    [view.scene().splatting.compositing, COMPOSITINGS[at * skip % COMPOSITINGS.len()]];
                view.set_splatting(Splatting { compositing, ..view.scene().splatting }).unwrap();
                let name = format!("{rasterizer:?}: {old:?}, then {compositing:?}");
                let prepared = gpu.renderer().prepare(gpu.device(), gpu.queue(), &mut view).unwrap();
                assert_eq!(prepared.bucketed, looks_at_all(old) != looks_at_all(compositing), "{name}");
                assert_fresh(gpu, &mut view, &name);
            }
        }
    }
}

/// The cost of each setter: buckets only for cameras, slabs and bricks; voxels only for those that enter and leave.
#[test]
fn a_change_recomputes_only_what_depends_on_it() {
    let gpu = gpu();
    // What tiles do not support is drawn by quads, temporarily or always.
    for rasterizer in [Rasterizer::Auto, Rasterizer::Quads] {
        assert_costs(gpu, rasterizer);
    }
}

fn assert_costs(gpu: &GpuHeadless, rasterizer: Rasterizer) {
    let renderer: &Renderer = gpu.renderer();
    let (volume, mut scene) = head();
    scene.splatting.rasterizer = rasterizer;
    let mut view = gpu.view(volume, &scene).unwrap();
    let prepare = |view: &mut SceneView| renderer.prepare(gpu.device(), gpu.queue(), view).unwrap().bucketed;
    assert!(prepare(&mut view), "the first frame has no buckets yet");
    assert!(!prepare(&mut view), "nothing changed");

    view.set_light(Light::Direction(DVec3::new(1.0, 0.3, 2.0))).unwrap();
    assert!(!prepare(&mut view), "light");
    assert_fresh(gpu, &mut view, "light");
    view.set_shading(sheetsplat::settings::Shading { ambient: 0.5, shininess: 3.0, ..scene.shading }).unwrap();
    assert!(!prepare(&mut view), "shading");
    assert_fresh(gpu, &mut view, "shading");
    let old = view.volume().transfer()[0].clone();
    let color = Ramp::new(vec![(0.0, DVec3::new(1.0, 0.2, 0.1)), (200.0, DVec3::ONE)]).unwrap();
    // More control points than before, and other opacities above 0 for the same values.
    let opacity = Ramp::new(vec![(60.0, 0.0), (70.0, 0.1), (80.0, 0.4), (100.0, 0.2), (140.0, 0.9)]).unwrap();
    let touched = view.set_transfer_function(TransferFunction { color, opacity, ..old }).unwrap();
    assert_eq!((touched.entered, touched.left), (0, 0));
    assert!(!prepare(&mut view), "colours and opacities");
    assert_fresh(gpu, &mut view, "colours and opacities");
    let mut splatting = scene.splatting;
    splatting.compositing = Compositing::Exponential;
    splatting.opacity_threshold = 0.8;
    view.set_splatting(splatting).unwrap();
    assert!(!prepare(&mut view), "compositing");
    assert_fresh(gpu, &mut view, "compositing");
    view.set_splatting(sheetsplat::settings::Splatting { footprint: FootprintForm::Sections, ..splatting }).unwrap();
    assert_fresh(gpu, &mut view, "footprint");
    view.set_splatting(sheetsplat::settings::Splatting { radius: 1.4, ..splatting }).unwrap();
    assert!(prepare(&mut view), "radius");
    assert_fresh(gpu, &mut view, "radius");

    view.turn(20.0).unwrap();
    assert!(prepare(&mut view), "camera");
    assert_fresh(gpu, &mut view, "camera");
    view.set_image(sheetsplat::scene::ImageSettings { width: 130, height: 40, background: [0.1, 0.2, 0.3, 0.5] })
        .unwrap();
    assert_fresh(gpu, &mut view, "image");
    let touched = view.set_iso_ranges(Some(vec![[100.0, 255.0]])).unwrap();
    assert!(touched.left > 0 && touched.entered == 0);
    assert!(prepare(&mut view), "bricks changed");
    assert_fresh(gpu, &mut view, "iso-range");
    // The view is prepared twice before it is drawn.
    assert!(view.set_iso_ranges(Some(vec![[80.0, 255.0]])).unwrap().entered > 0);
    assert!(prepare(&mut view));
    assert!(view.set_iso_ranges(Some(vec![[70.0, 255.0]])).unwrap().entered > 0);
    assert!(prepare(&mut view));
    assert_fresh(gpu, &mut view, "two iso-ranges");
    // The view is prepared, and then needs more than the device allows.
    assert!(view.set_iso_ranges(None).unwrap().entered > 0);
    assert!(prepare(&mut view));
    let image = view.scene().image;
    view.set_image(sheetsplat::scene::ImageSettings { width: 1 << 20, ..image }).unwrap();
    assert!(renderer.prepare(gpu.device(), gpu.queue(), &mut view).is_err());
    view.set_image(image).unwrap();
    assert_fresh(gpu, &mut view, "after an error");
}

/// After splatting a changed transfer function tests bricks anew: the view equals a fresh one, and nothing is sorted where it shows the same bricks.
#[test]
fn after_splatting_a_changed_view_is_a_fresh_one() {
    let gpu = gpu();
    for rasterizer in RASTERIZERS {
        let (volume, mut scene) = head();
        (scene.splatting.rasterizer, scene.splatting.classification) = (rasterizer, Classification::After);
        let mut view = gpu.view(volume, &scene).unwrap();
        let prepare = |view: &mut SceneView| gpu.renderer().prepare(gpu.device(), gpu.queue(), view).unwrap().bucketed;
        assert!(prepare(&mut view), "{rasterizer:?}: the first frame");
        assert_fresh(gpu, &mut view, "first");
        let (mut changed, mut same) = (0, 0);
        for (name, points) in [
            ("other opacities of the same values", vec![(60.0, 0.0), (90.0, 0.2), (255.0, 0.9)]),
            ("bone", vec![(190.0, 0.0), (220.0, 0.9)]),
            ("fainter bone", vec![(190.0, 0.0), (240.0, 0.5)]),
            ("a peak between values", vec![(99.0, 0.0), (100.5, 0.8), (102.0, 0.0)]),
            ("everything", vec![(0.0, 0.01), (200.0, 0.5)]),
            ("nothing", vec![(0.0, 0.0)]),
            ("as at first", vec![(60.0, 0.0), (120.0, 0.6), (255.0, 1.0)]),
        ] {
            let old = view.volume().transfer()[0].clone();
            let transfer = TransferFunction { opacity: Ramp::new(points).unwrap(), ..old };
            let touched = view.set_transfer_function(transfer).unwrap();
            let name = format!("{rasterizer:?}: {name}");
            let has_changed = touched.entered + touched.left > 0;
            assert_eq!(prepare(&mut view), has_changed, "{name}: {touched:?}");
            (changed, same) = (changed + u32::from(has_changed), same + u32::from(!has_changed));
            assert_fresh(gpu, &mut view, &name);
        }
        assert!(changed >= 4 && same >= 2, "{changed} {same}");
        let color = Ramp::new(vec![(0.0, DVec3::new(1.0, 0.2, 0.1))]).unwrap();
        let transfer = TransferFunction { color, ..view.volume().transfer()[0].clone() };
        assert_eq!(view.set_transfer_function(transfer).unwrap(), Touched::default());
        assert!(!prepare(&mut view), "{rasterizer:?}: a colour");
        assert_fresh(gpu, &mut view, "a colour");
    }
}

/// A view that is empty at first.
#[test]
fn from_nothing() {
    let gpu = gpu();
    for rasterizer in RASTERIZERS {
        let (volume, mut scene) = head();
        scene.splatting.rasterizer = rasterizer;
        scene.channels[0].transfer.iso_ranges = Some(vec![[1e6, 2e6]]);
        let mut view = gpu.view(volume, &scene).unwrap();
        assert_fresh(gpu, &mut view, "nothing");
        assert!(view.set_iso_ranges(None).unwrap().entered > 1000);
        assert_fresh(gpu, &mut view, "everything");
        view.set_iso_ranges(Some(vec![[1e6, 2e6]])).unwrap();
        assert_fresh(gpu, &mut view, "nothing again");
    }
}

/// The minimum value takes part only if the transfer function says so, because its voxels are not in the sorted list.
#[test]
fn the_value_list_leaves_out_the_background() {
    let gpu = gpu();
    let (volume, scene) = head();
    let view = gpu.view(volume.clone(), &scene).unwrap();
    let least = volume.values().iter().fold(f32::INFINITY, f32::min);
    let background = volume.values().iter().filter(|&value| value == least).count();
    assert!(background > 1000);
    let list = view.volume().value_list();
    assert_eq!(list.bytes(), 4 * (volume.values().len() - background) as u64);
    let all = TransferFunction { opacity: Ramp::new(vec![(0.0, 1.0)]).unwrap(), ..view.volume().transfer()[0].clone() };
    assert_eq!(list.within(volume.values(), &ValueSet::of(&all)).len(), volume.values().len());
}

#[test]
fn slices_together_hold_what_the_volume_list_holds() {
    let volume = builtin::volume("tomato:24").unwrap();
    let transfer = TransferSettings::default().resolve(&volume);
    let transfer = TransferFunction { iso_ranges: Some(vec![[30.0, 90.0]]), ..transfer };
    let (values, set) = (volume.values(), ValueSet::of(&transfer));
    let mut expected = ValueList::new(values).within(values, &set);
    expected.sort_unstable();
    assert!(expected.len() > 100 && expected.len() < values.len() / 2, "{}", expected.len());
    for axis in 0..3 {
        let lists = SliceLists::new(values, volume.grid(), axis);
        assert_eq!(lists.len(), volume.grid().dims[axis] as usize);
        let mut found = Vec::new();
        for slice in 0..lists.len() {
            for voxels in lists.within(values, slice, &set) {
                assert!(voxels.is_sorted_by_key(|&voxel| ordinal(values.at(voxel as usize))));
                assert!(voxels.iter().all(|&voxel| volume.grid().voxel_at(voxel)[axis] as usize == slice));
                found.extend_from_slice(voxels);
            }
        }
        found.sort_unstable();
        assert_eq!(found, expected, "axis {axis}");
    }
}
