//! Segmented volumes: valid and invalid label files, and whole frames with tables for labels against the f64 evaluation, by both rasterizers.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{DVec3, UVec3};
use sheetsplat::RenderError;
use sheetsplat::headless::GpuHeadless;
use sheetsplat::internals::reference;
use sheetsplat::scene::Scene;
use sheetsplat::settings::Projection;
use sheetsplat::settings::{Compositing, Method, Order, Rasterizer};
use sheetsplat::settings::{LabelTables, Ramp, TransferFunction};
use sheetsplat::volume::{Labels, Volume, VolumeError, builtin};

use crate::common::compare::{assert_at_least, assert_at_most};
use crate::common::devices::{DRAWINGS, Drawing, gpu};
use crate::common::images::largest_difference;
use crate::common::{Random, camera, scene, transfer};

/// A folder with a volume of 2×3×2 voxels, 1×1×2.5 apart, and a label file beside it.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        folder.write("volume.nrrd", "type: uint8\nspacings: 1 1 2.5\nsizes: 2 3 2", &[7; 12]);
        folder
    }

    fn write(&self, name: &str, fields: &str, data: &[u8]) {
        let header = format!("NRRD0005\ndimension: 3\nencoding: raw\nendian: little\n{fields}\n\n");
        std::fs::write(self.0.path().join(name), [header.as_bytes(), data].concat()).unwrap();
    }

    /// The volume of a scene in the folder.
    fn load(&self, volume: &str) -> Result<Volume, VolumeError> {
        let scene = format!("[volume]\n{volume}\nlabels = 'labels.nrrd'");
        Scene::parse(&scene, "scene.toml", self.0.path(), &[]).unwrap().load_volume()
    }

    #[track_caller]
    fn assert_refused(&self, volume: &str, field: &str, found: &str, allowed: &str) {
        let path = self.0.path().join("labels.nrrd");
        let message = self.load(volume).unwrap_err().to_string();
        assert_eq!(message, format!("{}: {field}: found {found}, allowed: {allowed}", path.display()));
    }
}

const PATH: &str = "path = 'volume.nrrd'";

#[test]
fn labels_of_every_type() {
    let folder = Folder::new();
    let labels: [u16; 12] = [0, 1, 2, 3, 4, 5, 127, 100, 9, 0, 0, 1];
    macro_rules! check {
        ($($type:ty, $name:literal);*) => {$(
            for (endian, bytes) in [
                ("little", labels.map(|label| (label as $type).to_le_bytes()).concat()),
                ("big", labels.map(|label| (label as $type).to_be_bytes()).concat()),
            ] {
                let header = format!(
                    "NRRD0001\ntype: {}\nendian: {endian}\ndimension: 3\nsizes: 2 3 2\nencoding: raw\n\n", $name
                );
                std::fs::write(folder.0.path().join("labels.nrrd"), [header.as_bytes(), &bytes].concat()).unwrap();
                assert_eq!(folder.load(PATH).unwrap().labels(), Some(&labels[..]), "{} {endian}", $name);
            }
        )*};
    }
    check!(i8, "int8"; u8, "uint8"; i16, "int16"; u16, "uint16"; i32, "int32"; u32, "uint32"; i64, "int64"; u64, "uint64";
           f32, "float"; f64, "double");
    // The maximum label, in types that can hold it.
    folder.write("labels.nrrd", "type: ushort\nsizes: 2 3 2", &[0xff; 24]);
    let volume = folder.load(PATH).unwrap();
    assert_eq!((volume.label(0), volume.label(11)), (Some(65535), Some(65535)));
    folder.write("labels.nrrd", "type: int\nsizes: 2 3 2", &65535_i32.to_le_bytes().repeat(12));
    assert_eq!(folder.load(PATH).unwrap().labels(), Some(&[65535; 12][..]));
}

#[test]
fn an_invalid_label_is_named_with_its_voxel() {
    let folder = Folder::new();
    let allowed = "labels, whole numbers from 0 on";
    let refused = |name: &str, good: &[u8], bad: &[u8], shown: &str| {
        // The eighth voxel is invalid.
        let data = [good.repeat(7), bad.to_vec(), good.repeat(4)].concat();
        folder.write("labels.nrrd", &format!("type: {name}\nsizes: 2 3 2"), &data);
        folder.assert_refused(PATH, "data", &format!("{shown} at voxel [1, 0, 1]"), allowed);
    };
    refused("int8", &[1], &[0xff], "-1");
    refused("short", &[1, 0], &(-32768_i16).to_le_bytes(), "-32768");
    refused("int", &1_i32.to_le_bytes(), &(-65536_i32).to_le_bytes(), "-65536");
    refused("float", &1_f32.to_le_bytes(), &2.5_f32.to_le_bytes(), "2.5");
    refused("float", &1_f32.to_le_bytes(), &f32::NAN.to_le_bytes(), "NaN");
    // The number is not whole, although its nearest f32 is.
    refused("double", &1_f64.to_le_bytes(), &3.000_000_000_1_f64.to_le_bytes(), "3.0000000001");
}

#[test]
fn labels_of_another_grid_are_refused() {
    let folder = Folder::new();
    folder.write("labels.nrrd", "type: uint8\nsizes: 3 2 2", &[0; 12]);
    folder.assert_refused(PATH, "sizes", "[3, 2, 2]", "[2, 3, 2], the volume's");
    folder.write("labels.nrrd", "type: uint8\nsizes: 2 3 1", &[0; 6]);
    folder.assert_refused(PATH, "sizes", "[2, 3, 1]", "[2, 3, 2], the volume's");
    folder.assert_refused("builtin = 'head:16'", "sizes", "[2, 3, 1]", "[16, 16, 10], the volume's");

    // The label file's spacing counts if it states one, up to rounding, unless the scene's spacing replaces both.
    let with_spacing =
        |fields: &str| folder.write("labels.nrrd", &format!("type: uint8\nsizes: 2 3 2{fields}"), &[3; 12]);
    for same in
        ["", "\nspacings: 1 1 2.5", "\nspacings: 1.00004 1 2.5", "\nspace directions: (0,1,0) (-1,0,0) (0,0,2.5)"]
    {
        with_spacing(same);
        let volume = folder.load(PATH).unwrap();
        assert_eq!((volume.label(5), volume.spacing()), (Some(3), DVec3::new(1.0, 1.0, 2.5)), "{same}");
    }
    let allowed = "[1.0, 1.0, 2.5], the volume's";
    for (other, found) in [
        ("spacings: 1 1 2.499", "[1.0, 1.0, 2.499]"),
        ("spacings: 1 1.001 2.5", "[1.0, 1.001, 2.5]"),
        ("space directions: (2,0,0) (0,2,0) (0,0,5)", "[2.0, 2.0, 5.0]"),
    ] {
        with_spacing(&format!("\n{other}"));
        folder.assert_refused(PATH, "spacing", found, allowed);
        let volume = folder.load(&format!("{PATH}\nspacing = [4, 4, 4]")).unwrap();
        assert_eq!((volume.label(5), volume.spacing()), (Some(3), DVec3::splat(4.0)), "{other}");
    }
}

#[test]
fn broken_label_files_are_refused() {
    let folder = Folder::new();
    let path = folder.0.path().join("labels.nrrd");
    let message = folder.load(PATH).unwrap_err().to_string();
    assert!(message.starts_with(&format!("{}: No such file", path.display())), "{message}");
    folder.write("labels.nrrd", "type: uint8\nsizes: 2 3 2", &[0; 11]);
    folder.assert_refused(PATH, "data", "11 bytes", "12 bytes (12 samples of 1)");
    let other = folder.0.path().join("labels.png");
    std::fs::write(&other, [1; 12]).unwrap();
    assert!(matches!(Labels::open(&other), Err(VolumeError::Invalid { field, .. }) if field == "format"));

    let volume = builtin::volume("cube:4").unwrap();
    let labels = Labels {
        origin: "here".to_owned(),
        dims: volume.dims(),
        spacing: None,
        values: Arc::new([1; 63]),
        names: BTreeMap::new(),
    };
    let message = volume.with_labels(labels).unwrap_err().to_string();
    assert_eq!(message, "here: data: found 63 labels, allowed: 64 labels");
}

#[test]
fn a_label_file_replaces_the_builtin_labels() {
    let folder = Folder::new();
    folder.write("labels.nrrd", "type: uint8\nsizes: 8 8 5", &[9; 320]);
    let volume = folder.load("builtin = 'head:8'").unwrap();
    assert_eq!((volume.labels(), volume.label_names().get(&2)), (Some(&[9; 320][..]), None));
    assert_eq!(builtin::volume("head:8").unwrap().label_names()[&2], "skull");
    folder.write("labels.nrrd", "type: uint8\nsizes: 8 8 8", &[5; 512]);
    assert_eq!(folder.load("builtin = 'cube:8'").unwrap().labels(), Some(&[5; 512][..]));
}

/// A volume of noise in blocks of labels, some of which are so small that neighbours differ.
fn segmented(labels: &[u16], spacing: [f64; 3]) -> Volume {
    let dims = UVec3::new(15, 13, 14);
    let mut random = Random(4);
    let values = (0..dims.element_product()).map(|_| random.uniform(0.0, 255.0) as f32).collect();
    let volume = Volume::new("segmented", dims, spacing.into(), values).unwrap();
    let label = |index: u32| {
        let block = volume.grid().voxel_at(index) / UVec3::new(5, 2, 3);
        labels[(block.x + 2 * block.y + 5 * block.z) as usize % labels.len()]
    };
    let values = (0..dims.element_product()).map(label).collect();
    volume
        .with_labels(Labels { origin: "blocks".to_owned(), dims, spacing: None, values, names: BTreeMap::new() })
        .unwrap()
}

fn ramp<T>(points: &[(f64, T)]) -> Option<Ramp<T>>
where
    T: Copy + std::ops::Add<Output = T> + std::ops::Mul<f64, Output = T>,
{
    Some(Ramp::new(points.to_vec()).unwrap())
}

fn rgb(color: [f64; 3]) -> Option<Ramp<DVec3>> {
    ramp(&[(0.0, DVec3::from(color)), (255.0, DVec3::from(color) / 2.0)])
}

/// Tables that differ from the main one in every possible way.
fn tables(labels: &[u16]) -> impl Iterator<Item = (u64, LabelTables)> {
    let none = LabelTables::default;
    let gradients = [(10.0, 0.0), (20.0, 0.3), (60.0, 1.0)];
    let many: Vec<(f64, f64)> = (0..45).map(|at| (f64::from(at) * 5.5, f64::from(at % 4) / 8.0)).collect();
    let all = [
        LabelTables { color: rgb([1.0, 0.2, 0.1]), opacity: ramp(&[(0.0, 0.6)]), ..none() },
        LabelTables { visible: false, color: rgb([0.1, 1.0, 0.1]), opacity: ramp(&[(0.0, 1.0)]), ..none() },
        LabelTables { color: rgb([0.1, 0.2, 1.0]), ..none() },
        LabelTables { opacity: ramp(&[(100.0, 0.0), (110.0, 0.5), (200.0, 0.0)]), ..none() },
        LabelTables { gradient_opacity: ramp(&gradients), ..none() },
        LabelTables { opacity: ramp(&many), gradient_opacity: ramp(&[(0.0, 1.0)]), ..none() },
        LabelTables { visible: false, ..none() },
    ];
    labels.iter().map(|&label| u64::from(label)).zip(all)
}

/// Draws a scene by everything that draws it, with and without culling, and compares with the f64 evaluation.
fn check(gpu: &GpuHeadless, name: &str, volume: &Volume, scene: &Scene) {
    let transfer = scene.channels[0].transfer.resolve(volume);
    let mut scene = scene.clone();
    scene.splatting.culling = false;
    let scene = &scene;
    let expected = reference::render(volume, std::slice::from_ref(&transfer), scene).unwrap();
    let counts = reference::count(volume, std::slice::from_ref(&transfer), scene).unwrap();
    let plain = TransferFunction { labels: BTreeMap::new(), ..transfer };
    let plain = reference::render(volume, std::slice::from_ref(&plain), scene).unwrap();
    assert_at_least(largest_difference(&plain, &expected), 0.1, format_args!("{name}: without labels"));
    for drawing in DRAWINGS {
        let mut scene = scene.clone();
        let name = format!("{name} {drawing:?}");
        scene.splatting.culling = false;
        let drawn = drawing.render(gpu, volume, &scene);
        assert_eq!(drawn.stats.counts.voxels_in_range, counts.voxels_in_range, "{name}");
        let allowed = if drawing.rounds_to_f16() { 4.8e-4 } else { 4.8e-5 };
        assert_at_most(largest_difference(&drawn.image, &expected), allowed, &name);
        scene.splatting.culling = true;
        let culled = drawing.render(gpu, volume, &scene);
        let allowed = 1.0 - scene.splatting.opacity_threshold + 1e-4;
        assert_at_most(largest_difference(&culled.image, &drawn.image), allowed, format_args!("{name}: culling"));
    }
}

#[test]
fn frames_of_labels_equal_the_reference() {
    let gpu = gpu();
    // The last label has no table; 65535 is the maximum label.
    for labels in [[0, 1, 2, 3, 4, 5, 6, 7], [9, 65535, 300, 12, 65534, 20, 40000, 1]] {
        for (spacing, compositing, order) in [
            ([1.0, 1.0, 1.0], Compositing::Linear, Order::FrontToBack),
            ([1.0, 1.0, 2.5], Compositing::Exponential, Order::FrontToBack),
            ([1.3, 1.0, 0.8], Compositing::Exponential, Order::BackToFront),
            ([1.0, 2.0, 1.0], Compositing::Xray, Order::FrontToBack),
        ] {
            let volume = segmented(&labels, spacing);
            let mut scene = scene(61, 53);
            scene.camera = camera([0.5, 0.7, -0.4], 36.0);
            scene.channels[0].transfer = transfer(
                &[(20.0, [0.9, 0.8, 0.3]), (250.0, [1.0, 1.0, 1.0])],
                &[(10.0, 0.0), (100.0, 0.3), (200.0, 0.1)],
            );
            scene.channels[0].transfer.labels = tables(&labels).collect();
            scene.splatting.compositing = compositing;
            scene.splatting.order = order;
            check(gpu, &format!("{labels:?} {spacing:?} {compositing:?}"), &volume, &scene);
            // Labels without gradient opacity use the main table's; iso-ranges apply to all.
            scene.channels[0].transfer.gradient_opacity = ramp(&[(5.0, 0.2), (40.0, 1.0)]);
            scene.channels[0].transfer.iso_ranges = Some(vec![[30.0, 90.0], [120.0, 230.0]]);
            check(gpu, &format!("{labels:?} {spacing:?} {compositing:?}, all tables"), &volume, &scene);
        }
    }
}

/// The same in perspective.
#[test]
fn labels_in_perspective_equal_the_reference() {
    let gpu = gpu();
    let labels = [0, 1, 2, 3, 4, 5, 6, 7];
    let mut scene = scene(61, 53);
    scene.camera = camera([0.5, 0.7, -0.4], 36.0);
    scene.camera.projection = Projection::Perspective { fov_y: 40.0, distance: Some(45.0), near: None };
    scene.channels[0].transfer = transfer(&[(20.0, [0.9, 0.8, 0.3])], &[(10.0, 0.0), (100.0, 0.3), (200.0, 0.1)]);
    scene.channels[0].transfer.labels = tables(&labels).collect();
    scene.splatting.compositing = Compositing::Exponential;
    check(gpu, "perspective", &segmented(&labels, [1.0, 1.0, 1.6]), &scene);
}

/// The same with every kernel composited by itself, which shades as quads do.
#[test]
fn labels_of_every_sample_equal_the_reference() {
    let gpu = gpu();
    let labels = [0, 1, 2, 3, 4, 5, 6, 7];
    let volume = segmented(&labels, [1.0, 1.0, 1.6]);
    let mut scene = scene(61, 53);
    scene.camera = camera([0.5, 0.7, -0.4], 36.0);
    scene.channels[0].transfer = transfer(&[(20.0, [0.9, 0.8, 0.3])], &[(10.0, 0.0), (100.0, 0.3), (200.0, 0.1)]);
    scene.channels[0].transfer.labels = tables(&labels).collect();
    scene.splatting.method = Method::CompositeEverySample;
    let expected = reference::render(&volume, &[scene.channels[0].transfer.resolve(&volume)], &scene).unwrap();
    for drawing in [Drawing::By(Rasterizer::Quads), Drawing::Native] {
        let drawn = drawing.render(gpu, &volume, &scene);
        assert_at_most(largest_difference(&drawn.image, &expected), 2.5e-4, format!("every sample {drawing:?}"));
    }
}

/// The volume has more voxels than a layer of the texture, with labels where the next one begins.
#[test]
fn labels_in_several_layers() {
    let gpu = gpu();
    let dims = UVec3::new(2049, 1100, 2);
    let place = UVec3::new(14, 947, 1);
    let near = |index: u32| (index % dims.x).abs_diff(place.x) < 12 && (index / dims.x % dims.y).abs_diff(place.y) < 8;
    let values = (0..dims.element_product()).map(|index| if near(index) { 200.0 } else { 0.0 }).collect();
    let labels: Arc<[u16]> = (0..dims.element_product()).map(|index| (index * 7 / 3 % 4) as u16).collect();
    let volume = Volume::new("layers", dims, DVec3::ONE, values).unwrap();
    let labels = Labels { origin: "layers".to_owned(), dims, spacing: None, values: labels, names: BTreeMap::new() };
    let volume = volume.with_labels(labels).unwrap();
    let mut scene = scene(64, 48);
    scene.camera = camera([0.02, 0.5, -0.9], 30.0);
    scene.camera.center = Some(volume.grid().world_position(place));
    scene.channels[0].transfer = transfer(&[(0.0, [1.0; 3])], &[(100.0, 0.0), (150.0, 0.2)]);
    scene.channels[0].transfer.labels = tables(&[1, 2, 3]).collect();
    scene.channels[0].transfer.iso_ranges = Some(vec![[100.0, 300.0]]);
    check(gpu, "several layers", &volume, &scene);
}

/// If tables only hide voxels, shading needs no labels, and they stay on the CPU.
#[test]
fn hiding_a_label_needs_no_texture() {
    let gpu = gpu();
    let volume = Arc::new(segmented(&[3, 4], [1.0; 3]));
    let mut scene = scene(32, 32);
    scene.channels[0].transfer = transfer(&[(0.0, [1.0; 3])], &[(0.0, 0.5)]);
    let bytes = |scene: &Scene| {
        let mut view = gpu.view(volume.clone(), scene).unwrap();
        gpu.draw(&mut view).unwrap();
        view.volume().gpu_bytes()
    };
    let all = bytes(&scene);
    scene.channels[0].transfer.labels =
        [(3, LabelTables { visible: false, color: rgb([1.0; 3]), ..LabelTables::default() })].into();
    assert!(bytes(&scene) < all, "hiding half of the voxels needs more memory");
    scene.channels[0].transfer.labels.insert(4, LabelTables { color: rgb([1.0; 3]), ..LabelTables::default() });
    assert!(bytes(&scene) > all - 100, "labels take no memory");
}

#[test]
fn tables_without_labels_are_an_error() {
    let gpu = gpu();
    let mut scene = scene(16, 16);
    scene.channels[0].transfer.labels = tables(&[1]).collect();
    let error = gpu.render_volume(builtin::volume("cube:8").unwrap(), &scene).unwrap_err();
    assert!(matches!(&error, RenderError::OutOfRange(error) if error.key == "transfer.label"), "{error}");
    // A label that no voxel has is ignored, because one transfer function serves many volumes.
    scene.channels[0].transfer.labels = tables(&[77]).collect();
    gpu.render_volume(builtin::volume("head:8").unwrap(), &scene).unwrap();
}

/// 3D Slicer writes the names and colours of segments.
#[test]
fn names_and_colours_of_segments_are_read() {
    let folder = Folder::new();
    let segments = "Segment0_ID:=Segment_1\nSegment0_LabelValue:=5\nSegment0_Name:=left lung: lower\nSegment1_Name:=no value\n\
                    Segment2_LabelValue:=many\nSegment2_Name:=bad\nSegment3_LabelValue:=7\nother_LabelValue:=9\nother_Name:=no\n\
                    Segment0_Color:=0.5 0.25 1\nSegment2_Color:=1 1 1\nSegment3_Color:=2 0 0";
    folder.write("labels.nrrd", &format!("type: uint8\nsizes: 2 3 2\n{segments}"), &[5; 12]);
    let names = BTreeMap::from([(5, "left lung: lower".to_owned())]);
    assert_eq!(folder.load(PATH).unwrap().label_names(), &names);
    // A volume whose values are labels has names, too, even if there is only one.
    let volume = Volume::open(&folder.0.path().join("labels.nrrd")).unwrap();
    assert_eq!(volume.label_names(), &names);
    assert!(sheetsplat::appearance::categories::is_label_map(&volume));
    let colors = vec![(5.0, DVec3::new(0.5, 0.25, 1.0))];
    assert_eq!(volume.palette(), Some(&colors[..]));
    assert_eq!(TransferFunction::from_histogram(&volume).color.points(), colors);
}
