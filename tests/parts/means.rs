//! Parts of `average` after splatting (SPEC §9), which carry the means of values that only the whole image's classification makes colours.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{DVec3, UVec3};
use sheetsplat::headless::Backend;
use sheetsplat::part::Extreme;
use sheetsplat::scene::Scene;
use sheetsplat::settings::{
    Classification, Compositing, LabelTables, Order, Projection, Ramp, Rasterizer, Region, Window,
};
use sheetsplat::volume::{Labels, SampleType, Volume};
use sheetsplat::{Image, Part};

use crate::common::compare::assert_at_most;
use crate::common::images::largest_difference;
use crate::common::store::MemoryStore;
use crate::merging::{compare, head, headless, parts};
use crate::streamed::streamed;

/// A head whose means are shown. Slabs are as thick as four voxels, so that rays through its corners meet no plane.
fn means(size: u32) -> (Arc<Volume>, Scene) {
    let (volume, mut scene) = head(size, [size + 13, size + 5]);
    scene.splatting.compositing = Compositing::Average;
    scene.splatting.classification = Classification::After;
    scene.splatting.slab_width = 4.0;
    scene.camera.direction = DVec3::new(0.9, 0.5, -0.8);
    scene.channels[0].transfer.iso_ranges = Some(vec![[-1.0, 70.0], [90.0, 300.0]]);
    (volume, scene)
}

/// The same with colours of the voxels' own.
fn colored(size: u32) -> (Arc<Volume>, Scene) {
    let (volume, scene) = means(size);
    let color = |(at, value): (usize, f32)| [value, 255.0 - value, (at % 256) as f32, 100.0 + value * 0.5];
    let colors: Vec<[f32; 4]> = volume.values().iter().enumerate().map(color).collect();
    let volume = Volume::from_colors("colours", volume.dims(), volume.spacing(), (&colors, SampleType::F32)).unwrap();
    (Arc::new(volume), scene)
}

#[test]
fn parts_merge_by_every_backend() {
    for (volume, mut scene) in [means(40), colored(40)] {
        for (projection, order) in [
            (Projection::Orthographic { height: None }, Order::FrontToBack),
            (Projection::Perspective { fov_y: 40.0, distance: None, near: None }, Order::BackToFront),
        ] {
            (scene.camera.projection, scene.splatting.order) = (projection, order);
            compare_ranges(Backend::Cpu, &volume, &scene);
            compare_ranges(Backend::Reference, &volume, &scene);
            for rasterizer in [Rasterizer::Quads, Rasterizer::Tiles] {
                scene.splatting.rasterizer = rasterizer;
                compare_ranges(Backend::Gpu, &volume, &scene);
            }
        }
    }
}

/// Some pixels' means are of many points in several parts, some have one point, and some only the middle of their rays.
fn compare_ranges(backend: Backend, volume: &Arc<Volume>, scene: &Scene) {
    let all = merging_parts(backend, volume, scene);
    let counts: Vec<f32> = all.iter().flat_map(|part| &part.contents[0].extremes).map(|mean| mean.counted).collect();
    for counted in [0.0, Extreme::MIDDLE, Extreme::POINT, 4.0] {
        assert!(counts.contains(&counted), "{backend} {counted}");
    }
}

/// The parts of an image, which merge into it.
fn merging_parts(backend: Backend, volume: &Arc<Volume>, scene: &Scene) -> Vec<Part> {
    let headless = headless(backend);
    let whole = headless.render_volume(Arc::clone(volume), scene).unwrap().image;
    let all = parts(headless, volume, scene, 3);
    let merged = Image::merge(all.clone()).unwrap();
    assert_at_most(largest_difference(&merged, &whole), 1e-6, format!("{backend} {:?}", scene.splatting));
    let shown = whole.pixels.iter().filter(|pixel| **pixel != whole.pixels[0]).count();
    assert!(shown * 10 > whole.pixels.len(), "{shown}");
    all
}

/// What a part says of values does not depend on the range that numbers are scaled by.
#[test]
fn parts_of_thin_slabs_and_exact_fields_merge() {
    let (volume, mut scene) = means(24);
    scene.splatting.slab_width = 0.5;
    scene.splatting.interpolation = sheetsplat::settings::Interpolation::Exact;
    compare(Backend::Cpu, &volume, &scene);
}

#[test]
fn parts_of_a_streamed_volume_merge() {
    let (volume, scene) = means(48);
    // Without the labels that a head has.
    let volume = Volume::new("head", volume.dims(), volume.spacing(), volume.values().to_vec()).unwrap();
    let headless = headless(Backend::Cpu);
    let store = MemoryStore::new(&volume, UVec3::splat(12));
    let mut view = headless.view(streamed(&volume, store, 1 << 20), &scene).unwrap();
    let whole = headless.draw(&mut view).unwrap().image;
    let [width, height] = [whole.width, whole.height];
    let region = Region { x: 0, y: 0, width, height };
    let parts: Vec<Part> = [-100..-2, -2..1, 1..100]
        .map(|slabs| headless.draw_part(&mut view, &Window { slabs, region }).unwrap().0)
        .into();
    assert_at_most(largest_difference(&Image::merge(parts).unwrap(), &whole), 1e-6, "streamed");
}

/// A file states the tables of means, and only where there are means.
#[test]
fn tables_belong_to_means() {
    let (volume, scene) = means(24);
    let part = parts(headless(Backend::Cpu), &volume, &scene, 2).remove(0);
    let folder = tempfile::tempdir().unwrap();
    let reopened = |change: &dyn Fn(&mut Part)| {
        let path = folder.path().join("part.npz");
        let mut part = part.clone();
        change(&mut part);
        part.save(&path).unwrap();
        Part::open(&path).map(|opened| opened.identity).map_err(|error| error.to_string())
    };
    assert_eq!(reopened(&|_| ()).unwrap(), part.identity);
    let message = reopened(&|part| part.identity.means.clear()).unwrap_err();
    assert!(
        message.contains("part.means: found 0 tables, allowed: 1: one for each image where compositing is \"average\""),
        "{message}"
    );
    let message = reopened(&|part| part.identity.compositing = Compositing::Maximum).unwrap_err();
    assert!(message.contains("part.means: found 1 tables, allowed: 0: "), "{message}");
    let message = reopened(&|part| {
        part.identity.means[0].transfer.opacity = Ramp::new(vec![(0.0, 0.5), (1.0, 1.5)]).unwrap();
    });
    let message = message.unwrap_err();
    assert!(message.contains("part.means: found mean.opacity[1][1]: found 1.5"), "{message}");
    let message = reopened(&|part| part.identity.means[0].transfer.iso_ranges = Some(vec![[2.0, 1.0]]));
    assert!(message.unwrap_err().contains("mean.iso_ranges[0]"));
    // Tables that are too long for the description in an NPZ file are refused before anything is written; EXR holds them.
    let long = (0..60_000).map(|at| (f64::from(at) / 7.0, DVec3::splat(0.5))).collect();
    let mut part = part;
    part.identity.means[0].transfer.color = Ramp::new(long).unwrap();
    let message = part.save(&folder.path().join("long.npz")).unwrap_err().to_string();
    assert!(message.contains("part.json: found ") && message.contains("or a file .exr"), "{message}");
    assert!(!folder.path().join("long.npz").exists());
    part.save(&folder.path().join("long.exr")).unwrap();
    assert_eq!(Part::open(&folder.path().join("long.exr")).unwrap().identity, part.identity);
}

/// A head in thirds of one label each, of which one has tables of its own, one is invisible, and one is like a volume that is not segmented.
fn labelled(size: u32) -> (Arc<Volume>, Scene) {
    let (volume, mut scene) = means(size);
    let dims = volume.dims();
    let label = |index: u32| 3 * (volume.grid().voxel_at(index).y * 3 / dims.y) as u16;
    let values = (0..dims.element_product()).map(label).collect();
    let labels = Labels { origin: "test".to_owned(), dims, spacing: None, values, names: BTreeMap::new() };
    let color = Ramp::new(vec![(0.0, DVec3::X), (255.0, DVec3::Y)]).unwrap();
    let opacity = Ramp::new(vec![(0.0, 0.0), (60.0, 0.9)]).unwrap();
    let own = LabelTables { color: Some(color), opacity: Some(opacity), ..LabelTables::default() };
    let hidden = LabelTables { visible: false, ..LabelTables::default() };
    scene.channels[0].transfer.labels = BTreeMap::from([(0, hidden), (3, own)]);
    (Arc::new(Volume::clone(&volume).with_labels(labels).unwrap()), scene)
}

/// The voxel in the middle of a ray's stretch decides whose tables classify the mean. Most parts do not show that voxel.
#[test]
fn labels_in_the_middle_of_rays_decide() {
    let (volume, mut scene) = labelled(40);
    for projection in [
        Projection::Orthographic { height: None },
        Projection::Perspective { fov_y: 40.0, distance: None, near: Some(6.0) },
    ] {
        scene.camera.projection = projection;
        for crop in [None, Some([DVec3::new(-15.0, -90.0, -90.0), DVec3::new(17.0, 90.0, 90.0)])] {
            scene.clip.crop = crop;
            for backend in [Backend::Cpu, Backend::Reference, Backend::Gpu] {
                let all = merging_parts(backend, &volume, &scene);
                let means = || all.iter().flat_map(|part| &part.contents[0].extremes);
                let noted = |label: f32| means().any(|mean| mean.label == label && mean.counted >= Extreme::POINT);
                assert!([0.0, 3.0, 6.0].into_iter().all(noted));
            }
        }
    }
}

/// Files state the tables of labels, and pixels note labels.
#[test]
fn files_hold_labels_and_their_tables() {
    let (volume, scene) = labelled(24);
    let has_label = |part: &Part| part.contents[0].extremes.iter().any(|mean| mean.label == 3.0);
    let part = parts(headless(Backend::Cpu), &volume, &scene, 2).into_iter().find(has_label).unwrap();
    let folder = tempfile::tempdir().unwrap();
    for name in ["part.npz", "part.exr"] {
        let path = folder.path().join(name);
        part.save(&path).unwrap();
        assert_eq!(Part { name: part.name.clone(), ..Part::open(&path).unwrap() }, part, "{name}");
    }
    let mut wrong = part;
    let tables = wrong.identity.means[0].transfer.labels.get_mut(&3).unwrap();
    tables.opacity = Some(Ramp::new(vec![(0.0, 0.5), (1.0, 1.5)]).unwrap());
    let path = folder.path().join("wrong.npz");
    wrong.save(&path).unwrap();
    let message = Part::open(&path).unwrap_err().to_string();
    assert!(message.contains("part.means: found mean.label[3].opacity[1][1]: found 1.5"), "{message}");
}
