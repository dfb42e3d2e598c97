//! Stores whose chunks are read while they are drawn: the bytes of the volume in memory, from no more than can matter.

use std::sync::Arc;

use glam::{DVec3, UVec3};
use sheetsplat::cpu::{CpuRenderer, StreamRenderer};
use sheetsplat::headless::{Backend, Headless, HeadlessOptions};
use sheetsplat::scene::ImageSettings;
use sheetsplat::scene::VolumeSource;
use sheetsplat::settings::{Classification, Region, Window};
use sheetsplat::stats::StoreCounts;
use sheetsplat::volume::{
    Grid, IndexedStore, Store, StoreIndex, StoreLevel, StreamedLevel, ValueSlice, Volume, VolumeError,
};
use sheetsplat::{Image, RenderError, Scene};

use crate::common::compare::{assert_at_least, assert_at_most};
use crate::common::images::{largest_difference, psnr};
use crate::common::store::{self, MemoryStore};

/// A store that holds no chunk.
#[derive(Debug)]
struct LargeStore([StoreLevel; 1]);

impl Store for LargeStore {
    fn levels(&self) -> &[StoreLevel] {
        &self.0
    }

    fn read(&self, _: usize, _: UVec3, _: UVec3, _: &mut [f32]) -> Result<u64, VolumeError> {
        unreachable!("no chunk is held")
    }

    fn contains(&self, _: usize, _: UVec3) -> Result<bool, VolumeError> {
        Ok(false)
    }

    fn fill(&self) -> f32 {
        0.0
    }

    fn identity(&self) -> String {
        "large".to_owned()
    }
}

fn scene(sets: &[&str]) -> Scene {
    let always = ["image={width=101,height=83,background=[0.2,0.4,0.1,0.5]}", "splatting.classification=before"];
    let sets: Vec<String> = always.iter().chain(sets).map(|&set| set.to_owned()).collect();
    Scene::from_volume(VolumeSource::Builtin("head:72".to_owned()), &sets).unwrap()
}

/// A scene's volume without its labels.
fn values(scene: &Scene) -> Volume {
    let volume = scene.load_volume().unwrap();
    Volume::new("head", volume.dims(), volume.spacing(), volume.values().to_vec()).unwrap()
}

/// A level of a store in a scene, for which all that depends on values is chosen by a sample.
fn renderer(
    store: Arc<dyn Store>,
    level: usize,
    sample: &Volume,
    scene: &Scene,
    memory: u64,
) -> Result<StreamRenderer, RenderError> {
    StreamRenderer::new(store::streamed(store, level, sample, memory), scene)
}

/// Draws a store and asserts that the image and the work are those of the volume in memory.
fn assert_same(volume: &Volume, scene: &Scene, chunk: UVec3, memory: u64) -> StoreCounts {
    let name = format!("{chunk} {memory} {scene:?}");
    let whole = CpuRenderer::new(volume.clone(), scene).unwrap().draw().unwrap();
    let store = Arc::new(MemoryStore::new(volume, chunk));
    let renderer = renderer(store, 0, volume, scene, memory).unwrap();
    let streamed = renderer.draw().unwrap();
    assert!(streamed.image.pixels.as_flattened().iter().all(|channel| channel.is_finite()), "{name}");
    let background = whole.image.pixels[0];
    let shown = whole.image.pixels.iter().filter(|pixel| **pixel != background).count();
    assert!(shown * 8 > whole.image.pixels.len(), "{shown} pixels: {name}");
    assert!(streamed.image == whole.image, "the images differ: {name}");
    let [actual, expected] = [streamed.stats.counts, whole.stats.counts];
    assert_eq!(actual.voxels_total, expected.voxels_total, "{name}");
    if scene.splatting.classification == Classification::After {
        return streamed.stats.store.unwrap();
    }
    assert_eq!(actual.voxels_shaded, expected.voxels_shaded, "{name}");
    assert_eq!(actual.sections_rasterized, expected.sections_rasterized, "{name}");
    streamed.stats.store.unwrap()
}

/// [`assert_same`] for chunks of several sizes, and memory for all of them or for one.
fn assert_same_in_chunks(scene: &Scene) {
    let volume = values(scene);
    for (chunk, memory) in [([32, 32, 32], 1 << 30), ([7, 30, 16], 1 << 30), ([16, 16, 16], 1 << 17)] {
        let counts = assert_same(&volume, scene, chunk.into(), memory);
        assert!(counts.chunks_read > 0 && counts.chunks_read <= counts.chunks_total, "{scene:?} {counts:?}");
    }
}

#[test]
fn streams_are_the_volume_in_memory() {
    let gradient = "transfer={color=[[0,[0,0,0]],[40,[1,0.5,0]],[160,[1,1,1]]],opacity=[[0,0],[40,0.02],[160,0.4]],gradient_opacity=[[0,0],[30,1]]}";
    for sets in [
        &[][..],
        &["camera.direction=[0.3,-0.5,0.8]", "splatting.compositing=exponential"],
        &["camera.projection=perspective", "camera.direction=[1,0.2,0.1]"],
        &["camera.projection=perspective", "camera.distance=20", "splatting.slab_width=0.6"],
        &["splatting.order=back-to-front", "camera.direction=[-0.4,0.5,0.2]"],
        &["splatting.culling=false"],
        &["splatting.compositing=maximum"],
        &["splatting.compositing=minimum", "transfer={color=[[0,[1,0.5,0]],[160,[1,1,1]]],opacity=[[0,0.3],[160,1]]}"],
        &["splatting.compositing=average", "clip.planes=[[0.5,0.3,1,2]]"],
        &["splatting.compositing=surface"],
        &["splatting.compositing=xray"],
        &["clip.planes=[[0.5,0.3,1,2]]", "camera.direction=[0.3,-0.5,0.8]"],
        &["splatting.opacity_threshold=0.9", "camera.up=[0,1,0]", "camera.direction=[0,0,1]"],
        &[gradient],
    ] {
        assert_same_in_chunks(&scene(sets));
    }
}

#[test]
fn hidden_and_empty_chunks_are_not_read() {
    let side = 96;
    // A wall across x = 20, and a block behind it that is as wide.
    let value = |[x, y, z]: [u32; 3]| {
        let is_wall = (20..28).contains(&x);
        let is_block = (70..80).contains(&x) && (32..64).contains(&y) && (32..64).contains(&z);
        if is_wall || is_block { 200.0 } else { 0.0 }
    };
    let voxels = (0..side).flat_map(|z| (0..side).flat_map(move |y| (0..side).map(move |x| [x, y, z])));
    let volume = Volume::new("wall", UVec3::splat(side), DVec3::ONE, voxels.map(value).collect()).unwrap();
    let transfer = "transfer={color=[[0,[1,1,1]]],opacity=[[100,0],[200,1]]}";
    let scene = scene(&[transfer, "camera.direction=[1,0,0]", "splatting.compositing=exponential"]);
    let counts = assert_same(&volume, &scene, UVec3::splat(32), 1 << 30);
    // The wall's chunks, 3 by 3; those behind it that gradients at x = 27 need are its own.
    assert_eq!((counts.chunks_total, counts.chunks_read, counts.bytes_read), (27, 9, 9 * 32 * 32 * 32));
    let all = Scene {
        splatting: {
            let mut splatting = scene.splatting;
            splatting.culling = false;
            splatting
        },
        ..scene
    };
    // The block reaches into one chunk; the other chunks are not held.
    assert_eq!(assert_same(&volume, &all, UVec3::splat(32), 1 << 30).chunks_read, 10);
    // There the block reaches into two.
    for (culling, chunks) in [(true, 9), (false, 11)] {
        let mut after = all.clone();
        (after.splatting.classification, after.splatting.culling) = (Classification::After, culling);
        let thin = Volume::new("wall", volume.dims(), DVec3::ONE, nearer(volume.values())).unwrap();
        assert_eq!(assert_same(&thin, &after, UVec3::splat(32), 1 << 30).chunks_read, chunks);
    }
}

/// Chunks whose values an index tells to be invisible are not read, and images are those of the volume in memory.
#[test]
fn an_index_spares_chunks_and_tells_the_range() {
    // Dim everywhere, but for a bright block in the first chunk along x, and the middle one along y and z.
    let value = |[x, y, z]: [u32; 3]| {
        let is_inside = (8..16).contains(&x) && [y, z].iter().all(|at| (44..52).contains(at));
        if is_inside { 200.0 } else { 20.0 + ((x * 7 + y * 5 + z * 3) % 11) as f32 }
    };
    let voxels = (0..96).flat_map(|z| (0..96).flat_map(move |y| (0..128).map(move |x| [x, y, z])));
    let volume = Volume::new("block", UVec3::new(128, 96, 96), DVec3::ONE, voxels.map(value).collect()).unwrap();
    let transfer = "transfer={color=[[0,[1,1,1]]],opacity=[[100,0],[200,1]]}";
    let store = || Arc::new(MemoryStore { is_range_known: false, ..MemoryStore::new(&volume, UVec3::splat(32)) });
    let progress = std::sync::atomic::AtomicU32::new(0);
    let step = || {
        progress.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
    };
    let index = StoreIndex::new(&*store(), "store", &step).unwrap();
    assert_eq!(progress.into_inner(), 4 * 3 * 3);
    // Chunks beside it hold the rim that values between theirs and the block's need.
    for (classification, expected) in [("before", 1), ("after", 2 * 3 * 3)] {
        let classification = format!("splatting.classification={classification}");
        let scene = scene(&[transfer, "camera.direction=[0.3,-0.5,0.8]", "camera.fit=volume", &classification]);
        let whole = CpuRenderer::new(volume.clone(), &scene).unwrap().draw().unwrap();
        let draw = |store: Arc<dyn Store>| {
            let streamed = renderer(store, 0, &volume, &scene, 1 << 30).unwrap().draw().unwrap();
            (streamed.image, streamed.stats.store.unwrap().chunks_read)
        };
        let indexed = Arc::new(IndexedStore::new(store(), index.clone(), "index").unwrap());
        let ranges = [UVec3::new(0, 1, 1), UVec3::ONE].map(|chunk| indexed.chunk_range(0, chunk).unwrap());
        assert_eq!((indexed.range(0).unwrap(), ranges), ([20.0, 200.0], [[20.0, 200.0], [20.0, 30.0]]));
        let (image, chunks) = draw(indexed);
        assert!(image == whole.image, "the images differ: {classification}");
        assert_eq!(chunks, expected, "{classification}");
        assert_eq!(draw(store()).1, 36, "{classification}");
    }
    let other = Arc::new(MemoryStore::new(&volume, UVec3::splat(48)));
    let error = IndexedStore::new(other, index, "a.index").unwrap_err().to_string();
    assert!(error.starts_with("a.index: level: found levels of [") && error.contains("those of the store"), "{error}");
}

/// Values ten voxels nearer along x, so that slabs drawn together with the last that shows the wall are within its chunks.
fn nearer(values: ValueSlice<'_>) -> Vec<f32> {
    values.iter().skip(10).chain([0.0; 10]).collect()
}

#[test]
fn failures_are_errors() {
    let scene = scene(&[]);
    let volume = values(&scene);
    let store = MemoryStore { broken_from: Some(30), ..MemoryStore::new(&volume, UVec3::splat(16)) };
    let store = Arc::new(store);
    let broken = renderer(store.clone(), 0, &volume, &scene, 1 << 30).unwrap();
    assert_eq!(broken.draw().unwrap_err().to_string(), "store: the disk is gone");
    let error = renderer(store.clone(), 1, &volume, &scene, 1 << 30).unwrap_err();
    assert_eq!(error.to_string(), "volume.level: found 1, allowed: 0 to 0");
    let mut small = Scene { image: ImageSettings { width: 1, height: 1, ..scene.image }, ..scene.clone() };
    small.splatting.classification = Classification::After;
    let large =
        Arc::new(LargeStore([StoreLevel { grid: Grid::new(UVec3::splat(1024), DVec3::ONE), chunk: UVec3::splat(64) }]));
    let error = renderer(large, 0, &volume, &small, 1 << 24).unwrap().draw().unwrap_err().to_string();
    assert!(error.starts_with("volume.level: found 0, in which 32×64 pixels see a box of voxels of "), "{error}");
    let mut labelled = store::streamed(store.clone(), 0, &volume, 1 << 30);
    let mut several = labelled.clone();
    several.channels.push(labelled.channels.first().clone());
    labelled.channels.first_mut().labels = Some(StreamedLevel::new("labels", store.clone(), 0));
    for (volume, found) in [(labelled, "labels"), (several, "several channels")] {
        let error = StreamRenderer::new(volume, &scene).unwrap_err().to_string();
        assert!(error.starts_with(&format!("volume: found {found} of a volume that is streamed")), "{error}");
    }
    for chunk in [UVec3::ZERO, UVec3::new(1, 0, 1)] {
        let empty = Arc::new(MemoryStore::new(&volume, chunk));
        let error = renderer(empty, 0, &volume, &scene, 1 << 30).unwrap_err().to_string();
        assert!(error.starts_with("volume: found chunks of [") && error.contains("at least 1"), "{error}");
    }
    for (set, expected) in [
        (
            "splatting={classification=\"after\",interpolation=\"exact\"}",
            "splatting.interpolation: found \"exact\" for a volume that is streamed",
        ),
        ("splatting.method=composite-every-sample", "splatting.method: found \"composite-every-sample\""),
    ] {
        let scene = Scene::from_volume(scene.channels[0].volume.clone(), &[set.to_owned()]).unwrap();
        let error = renderer(store.clone(), 0, &volume, &scene, 1 << 30).unwrap_err().to_string();
        assert!(error.starts_with(expected), "{error}");
    }
}

/// Scenes whose classification comes after splatting.
const AFTER: [&[&str]; 18] = [
    &[],
    &["camera.direction=[0.3,-0.5,0.8]", "splatting.compositing=exponential"],
    &["camera.projection=perspective", "camera.direction=[1,0.2,0.1]"],
    &["camera.projection=perspective", "camera.distance=20", "splatting.slab_width=0.6"],
    &["splatting.culling=false", "camera.direction=[-0.4,0.5,0.2]"],
    &["splatting.compositing=maximum", "camera.direction=[-0.4,0.5,0.2]"],
    &["splatting.compositing=minimum", "transfer={color=[[0,[1,0.5,0]],[160,[1,1,1]]],opacity=[[0,0.3],[160,1]]}"],
    &["splatting.compositing=average", "clip.planes=[[0.5,0.3,1,2]]"],
    &["splatting.compositing=surface"],
    &["splatting.compositing=xray"],
    &["clip.planes=[[0.5,0.3,1,2]]", "camera.direction=[0.3,-0.5,0.8]"],
    &["splatting.opacity_threshold=0.9", "camera.up=[0,1,0]", "camera.direction=[0,0,1]"],
    &["shading.gradient=kernel", "camera.direction=[0.3,-0.5,0.8]"],
    &["splatting.slab_width=0.25"],
    &["splatting.slab_width=3", "camera.direction=[0.3,-0.5,0.8]"],
    &["splatting.radius=3.2", "splatting.falloff=0.7"],
    // Pixels larger than voxels, and much smaller ones.
    &["image={width=32,height=26}", "camera.direction=[0.3,-0.5,0.8]"],
    &["camera.height=9", "camera.direction=[0.3,-0.5,0.8]"],
];

#[test]
fn streams_classified_after_splatting_are_the_volume_in_memory() {
    let gradient = "transfer={color=[[0,[0,0,0]],[40,[1,0.5,0]],[160,[1,1,1]]],opacity=[[0,0],[40,0.02],[160,0.4]],gradient_opacity=[[0,0],[30,1]]}";
    for sets in AFTER.into_iter().chain([&[gradient][..]]) {
        assert_same_in_chunks(&scene(&[&["splatting.classification=after"], sets].concat()));
    }
}

/// Where a store does not know the range of its values, numbers are scaled by that of the sample.
#[test]
fn stores_of_unknown_range_are_the_volume_in_memory_to_rounding() {
    let transfer = "transfer={color=[[0,[0,0,0]],[40,[1,0.5,0]],[160,[1,1,1]]],opacity=[[0,0],[40,0.02],[160,0.4]]}";
    for compositing in ["linear", "exponential", "maximum", "surface"] {
        let compositing = format!("splatting.compositing={compositing}");
        let scene = scene(&["splatting.classification=after", "camera.fit=volume", transfer, &compositing]);
        let volume = values(&scene);
        let whole = CpuRenderer::new(volume.clone(), &scene).unwrap().draw().unwrap().image;
        let store = Arc::new(MemoryStore { is_range_known: false, ..MemoryStore::new(&volume, UVec3::splat(32)) });
        // Its greatest value is a third of the volume's.
        let dim = volume.values().iter().map(|value| value / 3.0).collect();
        let sample = Volume::new("sample", volume.dims(), volume.spacing(), dim).unwrap();
        let streamed = renderer(store, 0, &sample, &scene, 1 << 30).unwrap().draw().unwrap().image;
        let background = [0.2, 0.4, 0.1, 0.5];
        assert_at_least(psnr(&streamed.pixels, &whole.pixels, background, 1000), 100.0, compositing);
    }
}

/// Any number of threads draws the same image, and reads the same chunks.
#[test]
fn threads_change_nothing() {
    for classification in ["before", "after"] {
        let classification = format!("splatting.classification={classification}");
        threads_change_nothing_in(&scene(&["camera.direction=[0.3,-0.5,0.8]", &classification]));
    }
}

fn threads_change_nothing_in(scene: &Scene) {
    let volume = values(scene);
    let draw = |threads: usize| {
        let store = Arc::new(MemoryStore::new(&volume, UVec3::splat(16)));
        let renderer = renderer(store, 0, &volume, scene, 1 << 18).unwrap();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let rendering = pool.install(|| renderer.draw()).unwrap();
        let counts = rendering.stats.store.unwrap();
        (rendering.image, rendering.stats.counts, counts.chunks_read, counts.bytes_read)
    };
    let first = draw(1);
    for threads in [2, 5] {
        assert!(draw(threads) == first, "{threads} threads: {:?}", scene.splatting);
    }
}

/// Parts of a volume that is streamed have the pixels of the same parts of one in memory, merge, and need fewer chunks than the whole image.
#[test]
fn parts_of_streams_are_those_of_the_volume_in_memory() {
    for (classification, compositing) in
        [("before", "linear"), ("before", "surface"), ("after", "exponential"), ("after", "maximum")]
    {
        let scene = scene(&[
            &format!(
                "splatting={{classification=\"{classification}\",compositing=\"{compositing}\",opacity_threshold=1}}"
            ),
            "camera.direction=[0.3,-0.5,0.8]",
        ]);
        let volume = values(&scene);
        let store = || Arc::new(MemoryStore::new(&volume, UVec3::splat(16)));
        let streamed = renderer(store(), 0, &volume, &scene, 1 << 18).unwrap();
        let mut whole = CpuRenderer::new(volume.clone(), &scene).unwrap();
        let all = streamed.draw().unwrap();
        let total = all.stats.store.unwrap().chunks_read;
        let mut parts = Vec::new();
        for slabs in [-1000..-9, -9..14, 14..1000] {
            for region in [(0, 0, 101, 40), (0, 40, 64, 43), (64, 40, 37, 43)] {
                let (x, y, width, height) = region;
                let window = Window { slabs: slabs.clone(), region: Region { x, y, width, height } };
                let (part, stats) = streamed.draw_part(&window).unwrap();
                let expected = whole.draw_part(&window).unwrap().0;
                assert!(part.contents == expected.contents, "{classification} {compositing} {window:?}");
                assert_ne!(part.identity.fingerprint, expected.identity.fingerprint);
                let StoreCounts { chunks_read, chunks_total, .. } = stats.store.unwrap();
                // What the first slabs hide of later ones is drawn in parts.
                let most = if window.slabs.start == -1000 { total } else { chunks_total };
                assert!(chunks_read < most, "{chunks_read} of {most}: {classification} {compositing} {window:?}");
                parts.push(part);
            }
        }
        let largest = largest_difference(&Image::merge(parts).unwrap(), &all.image);
        assert_at_most(largest, 1e-6, format!("{classification} {compositing}"));
    }
}

/// What opens a volume may leave it to be read while it is drawn.
#[test]
fn headless_views_are_streamed() {
    let scene = scene(&["camera.direction=[0.3,-0.5,0.8]"]);
    let volume = values(&scene);
    let store: Arc<dyn Store> = Arc::new(MemoryStore::new(&volume, UVec3::splat(16)));
    let streamed = store::streamed(store, 0, &volume, 1 << 20);
    let headless = |backend| Headless::new(&HeadlessOptions::default().with_backend(backend)).unwrap();
    let cpu = headless(Backend::Cpu);
    let mut view = cpu.view(streamed.clone(), &scene).unwrap();
    let mut whole = cpu.view(volume, &scene).unwrap();
    let mut other = scene.clone();
    other.shading.ambient = 0.7;
    for scene in [&scene, &other] {
        for view in [&mut view, &mut whole] {
            cpu.set_scene(view, scene).unwrap();
            view.turn(30.0).unwrap();
        }
        let drawn = cpu.draw(&mut view).unwrap();
        assert!(drawn.image == cpu.draw(&mut whole).unwrap().image);
        assert!(drawn.stats.store.unwrap().chunks_read > 0);
    }
    let error = view.set_first_hit(Some(0.5)).unwrap_err().to_string();
    assert!(error.starts_with("first_hit: found first hits of a volume that is streamed"), "{error}");
    assert!(cpu.pick(&view, [0, 0]).is_err());
}
