//! Volumes that are read box by box while a backend draws windows of them: the image of the volume in memory, to rounding.

use std::collections::{BTreeMap, HashSet};
use std::sync::Arc;
use std::sync::atomic::Ordering;

use glam::{DVec3, UVec3};
use sheetsplat::Image;
use sheetsplat::headless::{Backend, Headless, HeadlessView};
use sheetsplat::part::Part;
use sheetsplat::scene::Scene;
use sheetsplat::settings::{Compositing, Gradient, Region, Window};
use sheetsplat::stats::StoreCounts;
use sheetsplat::volume::{
    IndexedStore, Labels, SampleType, Store, StoreIndex, StreamedLevel, StreamedVolume, Volume, builtin,
};

use crate::common::Random;
use crate::common::compare::{assert_at_least, assert_at_most};
use crate::common::images::{largest_difference, psnr};
use crate::common::label_maps::{labels, scene_of_labels};
use crate::common::store::{self, MemoryStore};
use crate::merging::headless;

/// A scene of a head's values, without its labels.
fn head(size: u32, sets: &[&str]) -> (Volume, Scene) {
    let volume = builtin::volume(&format!("head:{size}")).unwrap();
    let volume = Volume::new("head", volume.dims(), volume.spacing(), volume.values().to_vec()).unwrap();
    let always = [
        "image={width=61,height=47,background=[0.2,0.4,0.6,0.5]}",
        "camera={direction=[0.4,0.9,-0.3],fit=\"volume\"}",
        "splatting={opacity_threshold=1,classification=\"before\"}",
        "transfer={color=[[0,[0.3,0.5,0.9]],[255,[1,0.8,0.4]]],opacity=[[0,0],[40,0.02],[160,0.5]]}",
    ];
    let sets: Vec<String> = always.iter().chain(sets).map(|&set| set.to_owned()).collect();
    let source = sheetsplat::scene::VolumeSource::Builtin("head".to_owned());
    (volume, Scene::from_volume(source, &sets).unwrap())
}

pub(crate) fn streamed(volume: &Volume, store: impl Store + 'static, memory: u64) -> StreamedVolume {
    store::streamed(Arc::new(store), 0, volume, memory)
}

/// Draws a volume in boxes of at most 256 KiB and asserts that the image is that of the volume in memory.
fn assert_same(backend: Backend, size: u32, sets: &[&str]) -> StoreCounts {
    assert_same_with(backend, size, sets, 1 << 20)
}

/// As [`assert_same`], with boxes of a quarter of some bytes.
fn assert_same_with(backend: Backend, size: u32, sets: &[&str], memory: u64) -> StoreCounts {
    let (volume, scene) = head(size, sets);
    let headless = headless(backend);
    let whole = headless.render_volume(volume.clone(), &scene).unwrap().image;
    let store = MemoryStore::new(&volume, UVec3::new(8, 12, 10));
    let drawn = headless.render_volume(streamed(&volume, store, memory), &scene).unwrap();
    assert_eq!((drawn.stats.backend.as_str(), drawn.stats.width), (backend.name(), 61));
    let name = format!("{backend} {sets:?}");
    assert_at_least(psnr(&drawn.image.pixels, &whole.pixels, [0.2, 0.4, 0.6, 0.5], 500), 100.0, &name);
    // Many shades, so that a wrong value would be seen.
    let shades: HashSet<_> = whole.pixels.iter().map(|pixel| pixel.map(|channel| (channel * 255.0) as u8)).collect();
    assert_at_least(shades.len() as f64, 40.0, format!("{name}: shades"));
    let counts = drawn.stats.store.unwrap();
    // Each chunk's bytes count once, however many boxes need it.
    assert!(counts.bytes_read > 0 && counts.bytes_read <= volume.values().len() as u64, "{sets:?} {counts:?}");
    assert!(counts.chunks_read > 0 && counts.chunk_bytes <= memory / 4, "{sets:?} {counts:?}");
    assert!(counts.chunk_bytes < 4 * volume.values().len() as u64 / 2, "{sets:?} {counts:?}");
    counts
}

const SCENES: [&[&str]; 14] = [
    &[],
    &["splatting.compositing=exponential", "splatting.classification=after"],
    &["camera.projection=perspective", "camera.direction=[1,0.2,0.1]"],
    &["camera.projection=perspective", "splatting.classification=after", "splatting.slab_width=0.7"],
    &["splatting.compositing=xray", "splatting.classification=after", "shading.gradient=kernel"],
    &["splatting.compositing=surface", "splatting.radius=1.4", "shading.enabled=true", OPAQUE],
    &["splatting.compositing=surface", "splatting.classification=after", "clip.planes=[[0.5,0.3,1,2]]"],
    &["splatting.compositing=maximum", "splatting.order=back-to-front"],
    &["splatting.compositing=maximum", "splatting.classification=after"],
    &["splatting.compositing=minimum", INSIDE, SEEN_ANYWHERE],
    &["splatting.compositing=minimum", INSIDE, SEEN_ANYWHERE, "splatting.classification=after"],
    &["splatting.compositing=average", SEEN_ANYWHERE],
    &[
        "splatting.compositing=average",
        SEEN_ANYWHERE,
        "splatting.classification=after",
        "camera.projection=perspective",
    ],
    &["splatting.compositing=minimum", SEEN_ANYWHERE, "camera.projection=perspective", "camera.direction=[1,0.2,0.1]"],
];

/// What is dense is opaque, so that surfaces before splatting show it.
const OPAQUE: &str = "transfer.opacity=[[0,0],[40,0.02],[60,0.9]]";

const THIN_AROUND_OPAQUE: &str = "transfer.opacity=[[60,0.001],[61,0],[199,0],[200,1]]";

/// A box in the head, with little air.
const INSIDE: &str = "clip.crop=[[-40,-45,-30],[45,40,35]]";

/// Air is no more transparent than what it lies around.
const SEEN_ANYWHERE: &str = "transfer.opacity=[[0,0.4],[40,0.1],[110,0.6],[160,0.9]]";

#[test]
fn boxes_by_the_f64_evaluation_are_the_volume_in_memory() {
    for sets in SCENES {
        assert_same(Backend::Reference, 64, sets);
    }
}

#[test]
fn boxes_by_the_gpu_are_the_volume_in_memory() {
    for sets in [&[0, 1, 3, 6][..], &[8, 9, 10, 11, 12, 13]].concat().into_iter().map(|at: usize| SCENES[at]) {
        assert_same(Backend::Gpu, 64, sets);
    }
    assert_same(Backend::Gpu, 64, &["splatting.rasterizer=quads", "splatting.classification=after"]);
}

/// Close to the eye footprints are far wider than kernels, and reach pixels whose rays pass far from the voxel.
#[test]
fn footprints_beside_an_eye_in_the_volume_are_drawn() {
    let [perspective, wide] = ["camera.projection=perspective", "camera.fov_y=80"];
    let scenes = [
        &[perspective, wide, "camera.distance=30"][..],
        &[perspective, wide, "camera.distance=60", "camera.direction=[1,0.2,0.1]", "splatting.rasterizer=quads"],
    ];
    for sets in scenes {
        assert_same(Backend::Gpu, 64, sets);
        // The box with all of them does not fit into the memory.
        let (volume, scene) = head(64, sets);
        let store = MemoryStore::new(&volume, UVec3::new(8, 12, 10));
        let refused =
            headless(Backend::Reference).render_volume(streamed(&volume, store, 1 << 20), &scene).unwrap_err();
        assert!(refused.to_string().contains("volume.level"), "{refused}");
    }
}

/// Normals of labels depend on voxels four from their own, and a box may hold too few labels to look like a label map.
#[test]
fn boxes_of_label_maps_are_the_volume_in_memory() {
    let mut random = Random(53);
    let dims = UVec3::new(40, 44, 38);
    let labels = labels(&mut random, dims).into_iter().map(f32::from).collect();
    let volume = Volume::new("labels", dims, DVec3::new(1.0, 1.0, 1.3), labels).unwrap().as_label_map();
    for (backend, compositing) in [(Backend::Reference, Compositing::Linear), (Backend::Gpu, Compositing::Exponential)]
    {
        let mut scene = scene_of_labels(&mut random);
        scene.shading.gradient = Gradient::Auto;
        scene.splatting.compositing = compositing;
        scene.splatting.opacity_threshold = 1.0;
        let headless = headless(backend);
        let whole = headless.render_volume(volume.clone(), &scene).unwrap().image;
        let store = MemoryStore::new(&volume, UVec3::new(8, 12, 10));
        let drawn = headless.render_volume(streamed(&volume, store, 1 << 20), &scene).unwrap();
        let background = scene.image.background.map(|channel| channel as f32);
        assert_at_least(psnr(&drawn.image.pixels, &whole.pixels, background, 500), 100.0, format!("{backend}"));
        assert!(drawn.stats.store.unwrap().chunk_bytes < 1 << 20);
    }
}

/// A GPU keeps the pages that further windows need. Where it has room for all, each chunk is read once, and of others the voxels beside drawn ones.
#[test]
fn pages_are_kept() {
    let (volume, scene) = head(64, &["splatting.slab_width=2", "splatting.opacity_threshold=0.95"]);
    let headless = headless(Backend::Gpu);
    let draw = |memory: u64| {
        let store = Arc::new(MemoryStore::new(&volume, UVec3::splat(16)));
        let drawn = headless.render_volume(store::streamed(store.clone(), 0, &volume, memory), &scene).unwrap();
        let listed = drawn.stats.counts.voxels_in_range;
        (drawn.image, drawn.stats.store.unwrap(), store.reads.load(Ordering::Relaxed), listed)
    };
    let whole = headless.render_volume(volume.clone(), &scene).unwrap().stats.counts.voxels_in_range;
    let (image, counts, reads, listed) = draw(8 << 20);
    assert!(reads < 3 * counts.chunks_read, "{reads} {counts:?}");
    // A page lies in several windows; those of its voxels that one does not show are not drawn there.
    assert!(2 * listed < 3 * whole, "{listed} {whole}");
    // With few slots pages go and come back.
    let (few, counts, again, _) = draw(1 << 19);
    assert!(again > 2 * reads, "{again} {reads} {counts:?}");
    assert_at_least(psnr(&few.pixels, &image.pixels, [0.2, 0.4, 0.6, 0.5], 500), 40.0, "few slots");
}

/// Where a part of a chunk takes as long to read as all of it, chunks are read once as long as they fit into memory.
#[test]
fn decoded_chunks_are_kept() {
    let (head, scene) = head(64, &["splatting.classification=after"]);
    let values = head.values().iter().map(|value| value * 1.001).collect();
    let volume = Volume::new("head", head.dims(), head.spacing(), values).unwrap();
    let headless = headless(Backend::Reference);
    let draw = |memory: u64, decodes_whole_chunks: bool, chunk: UVec3| {
        let store = Arc::new(MemoryStore { decodes_whole_chunks, ..MemoryStore::new(&volume, chunk) });
        let drawn = headless.render_volume(store::streamed(store.clone(), 0, &volume, memory), &scene).unwrap();
        let counts = drawn.stats.store.unwrap();
        assert!(counts.chunk_bytes <= memory / 2, "{counts:?}");
        (drawn.image, counts, store.reads.load(Ordering::Relaxed))
    };
    let (image, counts, reads) = draw(1 << 20, false, UVec3::new(4, 6, 5));
    assert!(reads > 3 * counts.chunks_read, "{reads} {counts:?}");
    let (kept, counts, reads) = draw(1 << 20, true, UVec3::new(4, 6, 5));
    assert!(kept == image && reads == counts.chunks_read, "{reads} {counts:?}");
    // Chunks of more voxels take more than a quarter of the memory.
    let (few, counts, reads) = draw(3 << 18, true, UVec3::new(8, 12, 10));
    assert!(reads > counts.chunks_read, "{reads} {counts:?}");
    assert_at_least(psnr(&few.pixels, &image.pixels, [0.2, 0.4, 0.6, 0.5], 500), 100.0, "in less memory");
}

/// Of a chunk that is read in parts, their bytes count together, but never more than the chunk has.
#[test]
fn bytes_of_a_chunks_parts_add_up() {
    let (volume, scene) = head(64, &[SEEN_ANYWHERE]);
    for backend in [Backend::Reference, Backend::Gpu] {
        let store = MemoryStore::new(&volume, volume.dims());
        let drawn = headless(backend).render_volume(streamed(&volume, store, 1 << 20), &scene).unwrap();
        let counts = drawn.stats.store.unwrap();
        assert_eq!((counts.chunks_read, counts.bytes_read), (1, volume.values().len() as u64), "{backend}");
    }
}

/// What becomes of a voxel, given by its index, and its value.
type Change<'a> = &'a dyn Fn(usize, f32) -> f32;

/// Pages hold values in as few bits as samples have, and in more once a value turns out not to be one of them: none of the first values, a fraction in the middle, or a
/// hole at the end.
#[test]
fn pages_hold_what_values_are() {
    let (head, scene) = head(64, &["splatting.classification=after"]);
    let fraction = |at: usize, value: f32| if at == 150_000 { value + 0.25 } else { value };
    let hole = |at: usize, value: f32| if at == 250_000 { f32::NAN } else { value };
    let kinds: [(SampleType, Change<'_>); 7] = [
        (SampleType::U8, &|_, value| value),
        (SampleType::I8, &|_, value| (value / 2.0).floor() - 60.0),
        (SampleType::U16, &|_, value| value * 200.0),
        (SampleType::I16, &|_, value| value * 100.0 - 9000.0),
        (SampleType::U8, &|_, value| value * 3.0),
        (SampleType::U8, &fraction),
        (SampleType::I16, &hole),
    ];
    let mut memory = Vec::new();
    for (sample_type, value) in kinds {
        let values = head.values().iter().enumerate().map(|(at, own)| value(at, own)).collect();
        let volume = Volume::new("head", head.dims(), head.spacing(), values).unwrap();
        let [low, high] = [value(0, 40.0), value(0, 160.0)];
        let sets = [format!(
            "transfer={{color=[[{low},[0.3,0.5,0.9]],[{high},[1,0.8,0.4]]],opacity=[[{low},0],[{high},0.5]]}}"
        )];
        let scene = scene.clone().with_transfer(super::streamed::head(64, &[&sets[0]]).1.channels[0].transfer.clone());
        let headless = headless(Backend::Gpu);
        let whole = headless.render_volume(volume.clone(), &scene).unwrap().image;
        let store = MemoryStore { sample_type: Some(sample_type), ..MemoryStore::new(&volume, UVec3::splat(16)) };
        let drawn = headless.render_volume(streamed(&volume, store, 1 << 20), &scene).unwrap();
        let name = format!("{sample_type} from {low} to {high}");
        assert_at_least(psnr(&drawn.image.pixels, &whole.pixels, [0.2, 0.4, 0.6, 0.5], 500), 100.0, &name);
        memory.push(drawn.stats.store.unwrap().chunk_bytes);
    }
    assert!(memory.iter().all(|&bytes| bytes <= 1 << 18), "{memory:?}");
}

/// Behind the opaque middle of a wall nothing of the haze is drawn, although the box of the open pixels around it contains it.
#[test]
fn what_boxes_in_front_hide_is_not_drawn() {
    let dims = UVec3::new(64, 36, 36);
    let is_wall = |at: [u32; 3]| at[0] < 6 && (4..32).contains(&at[1]) && (4..32).contains(&at[2]);
    let at = |index: u32| [index % 64, index / 64 % 36, index / (64 * 36)];
    let values = (0..dims.element_product()).map(|index| if is_wall(at(index)) { 200.0 } else { 60.0 }).collect();
    let volume = Volume::new("wall", dims, DVec3::ONE, values).unwrap();
    let labels = Volume::new("labels", dims, DVec3::ONE, vec![1.0; volume.values().len()]).unwrap();
    let (origin, values) = ("labels".to_owned(), vec![1; volume.values().len()].into());
    let labelled = Labels { origin, dims, spacing: None, values, names: BTreeMap::new() };
    let labelled = volume.clone().with_labels(labelled).unwrap();
    let sets = ["camera={direction=[1,0.01,0.02],height=40}", "splatting.opacity_threshold=0.95", THIN_AROUND_OPAQUE];
    let (_, mut scene) = head(8, &sets);
    for (backend, has_labels) in [(Backend::Cpu, true), (Backend::Gpu, false)] {
        let [hidden, all] = [true, false].map(|culling| {
            scene.splatting.culling = culling;
            let sample = if has_labels { &labelled } else { &volume };
            let mut streamed = streamed(sample, MemoryStore::new(&volume, UVec3::splat(12)), 1 << 20);
            let labels = || StreamedLevel::new("labels", Arc::new(MemoryStore::new(&labels, UVec3::splat(12))), 0);
            streamed.channels[0].labels = has_labels.then(labels);
            headless(backend).render_volume(streamed, &scene).unwrap()
        });
        let [fewer, sections] = [&hidden, &all].map(|drawn| drawn.stats.counts.sections_rasterized);
        assert!(sections > 100_000 && fewer * 10 < sections * 6, "{backend}: {fewer} {sections}");
        assert_at_least(psnr(&hidden.image.pixels, &all.image.pixels, [0.2, 0.4, 0.6, 0.5], 500), 40.0, backend);
    }
}

/// After splatting voxels bear on others around them; but those of what opaque pixels hide are not read for that.
#[test]
fn what_pages_hide_is_not_read() {
    let dims = UVec3::new(96, 36, 36);
    let value = |index: u32| 200.0 - 8.0 * (index / 96 % 7) as f32;
    let volume = Volume::new("wall", dims, DVec3::ONE, (0..dims.element_product()).map(value).collect()).unwrap();
    let (_, scene) = head(
        8,
        &[
            "camera={direction=[1,0.01,0.02],height=10}",
            "splatting={opacity_threshold=0.95,classification=\"after\"}",
            "transfer.opacity=[[100,0],[150,0.9]]",
        ],
    );
    let headless = headless(Backend::Gpu);
    let whole = headless.render_volume(volume.clone(), &scene).unwrap().image;
    let store = Arc::new(MemoryStore::new(&volume, UVec3::splat(32)));
    let drawn = headless.render_volume(store::streamed(store.clone(), 0, &volume, 1 << 19), &scene).unwrap();
    assert_at_least(psnr(&drawn.image.pixels, &whole.pixels, [0.2, 0.4, 0.6, 0.5], 500), 100.0, "wall");
    let read = store.read.lock().unwrap();
    assert!(!read.is_empty() && read.iter().all(|low| low[0] < 64), "{read:?}");
}

/// Holes are no neighbours for gradients, in boxes neither.
#[test]
fn boxes_with_holes_are_the_volume_in_memory() {
    for sets in [&["splatting.rasterizer=tiles"][..], &["splatting.rasterizer=quads"], SCENES[1], SCENES[8]] {
        let (head, scene) = head(64, &[sets, &["shading.enabled=true"]].concat());
        let holed = |(at, value)| if at % 7 == 0 { f32::NAN } else { value };
        let values = head.values().iter().enumerate().map(holed).collect();
        let volume = Volume::new("holed", head.dims(), head.spacing(), values).unwrap();
        for backend in [Backend::Reference, Backend::Gpu] {
            let headless = headless(backend);
            let whole = headless.render_volume(volume.clone(), &scene).unwrap().image;
            let store = MemoryStore::new(&volume, UVec3::new(8, 12, 10));
            let drawn = headless.render_volume(streamed(&volume, store, 1 << 20), &scene).unwrap().image;
            let name = format!("{backend} {sets:?}");
            assert_at_least(psnr(&drawn.pixels, &whole.pixels, [0.2, 0.4, 0.6, 0.5], 500), 100.0, name);
        }
    }
}

/// What opaque pixels hide, what the store does not hold, and what an index tells to be invisible is not read.
#[test]
fn boxes_that_show_nothing_are_not_read() {
    let opaque = "transfer={color=[[0,[0.3,0.5,0.9]],[255,[1,0.8,0.4]]],opacity=[[60,0],[61,1]]}";
    let near = ["camera.height=9", "splatting.opacity_threshold=0.95", opaque];
    let hidden = assert_same_with(Backend::Reference, 64, &near, 1 << 18);
    let all = assert_same_with(Backend::Reference, 64, &[near[0], "splatting.culling=false", opaque], 1 << 18);
    assert!(hidden.chunks_read * 3 < all.chunks_read * 2, "{hidden:?} {all:?}");
    let (volume, mut scene) = head(128, &near);
    let [hidden, all] = [true, false].map(|culling| {
        scene.splatting.culling = culling;
        let store = MemoryStore::new(&volume, UVec3::new(8, 12, 10));
        headless(Backend::Gpu).render_volume(streamed(&volume, store, 1 << 20), &scene).unwrap().stats.store.unwrap()
    });
    assert!(hidden.chunks_read * 3 < all.chunks_read * 2, "{hidden:?} {all:?}");

    // A bright block in a corner of a volume that the store holds everywhere.
    let (_, scene) = head(8, &["transfer.opacity=[[180,0],[200,1]]"]);
    let bright = |index: u32| [index % 60, index / 60 % 60, index / 3600].iter().all(|&n| n < 9);
    let values = (0..60 * 60 * 60).map(|index| if bright(index) { 200.0 } else { 20.0 }).collect();
    let volume = Volume::new("block", UVec3::splat(60), DVec3::ONE, values).unwrap();
    let store = || MemoryStore::new(&volume, UVec3::splat(12));
    let index = StoreIndex::new(&store(), "store", &|| {}).unwrap();
    let indexed = IndexedStore::new(Arc::new(store()), index, "index").unwrap();
    let headless = headless(Backend::Reference);
    let plain = headless.render_volume(streamed(&volume, store(), 1 << 20), &scene).unwrap();
    let told = headless.render_volume(streamed(&volume, indexed, 1 << 20), &scene).unwrap();
    assert_at_most(largest_difference(&plain.image, &told.image), 1e-6, "with an index");
    assert!(plain.image.pixels.iter().any(|pixel| pixel[3] > 0.9));
    let read = [plain, told].map(|drawn| drawn.stats.store.unwrap().chunks_read);
    assert!(read[1] < read[0], "{read:?}");
    let (_, nothing) = head(8, &["transfer.opacity=[[240,0],[250,1]]"]);
    let index = StoreIndex::new(&store(), "store", &|| {}).unwrap();
    let indexed = IndexedStore::new(Arc::new(store()), index, "index").unwrap();
    let drawn = headless.render_volume(streamed(&volume, indexed, 1 << 20), &nothing).unwrap();
    assert_eq!((drawn.stats.store.unwrap().chunks_read, drawn.stats.backend.as_str()), (0, "reference"));
    assert!(drawn.image.pixels.iter().all(|pixel| *pixel == drawn.image.pixels[0]));
}

/// Three layers along the view, of which an index tells that only the front one shows anything; but the value that a pixel chooses lies in the last one. The one between
/// is thicker than boxes are, and a hole where values near it would tell of that one.
#[test]
fn values_without_opacity_count_where_one_is_chosen() {
    let layers = |values: [f32; 3]| {
        let at = |index: u32| values[(index % 180 / 36).div_ceil(3).min(2) as usize] + (index / 180 % 36) as f32 / 10.0;
        Volume::new("layers", UVec3::new(180, 36, 36), DVec3::ONE, (0..180 * 36 * 36).map(at).collect()).unwrap()
    };
    for (compositing, values) in [
        ("maximum", [150.0, 20.0, 240.0]),
        ("minimum", [150.0, 240.0, 20.0]),
        ("average", [150.0, 20.0, 110.0]),
        ("maximum", [150.0, f32::NAN, 240.0]),
        ("minimum", [150.0, f32::NAN, 20.0]),
    ] {
        let volume = layers(values);
        let sets = [
            "camera={direction=[1,0.02,0.03],height=30}",
            "transfer.opacity=[[80,0],[90,0.9],[100,0.2],[120,0],[130,0],[140,0.5],[200,0.5],[210,0]]",
            &format!("splatting={{classification=\"after\",opacity_threshold=1,compositing=\"{compositing}\"}}"),
        ];
        let (_, scene) = head(8, &sets);
        let indexed = || {
            let store = MemoryStore::new(&volume, UVec3::splat(6));
            let index = StoreIndex::new(&store, "store", &|| {}).unwrap();
            IndexedStore::new(Arc::new(store), index, "index").unwrap()
        };
        for backend in [Backend::Reference, Backend::Gpu] {
            let headless = headless(backend);
            let whole = headless.render_volume(volume.clone(), &scene).unwrap().image;
            let drawn = headless.render_volume(streamed(&volume, indexed(), 1 << 18), &scene).unwrap();
            let name = format!("{backend} {compositing}");
            assert_at_least(psnr(&drawn.image.pixels, &whole.pixels, [0.2, 0.4, 0.6, 0.5], 0), 100.0, name);
        }
    }
}

/// The parts of two ranges of slabs and two regions, which make up an image of 61×47 pixels.
pub(crate) fn in_four(headless: &Headless, view: &mut HeadlessView) -> Vec<Part> {
    let mut parts = Vec::new();
    for slabs in [-1000..-3, -3..1000] {
        for (x, width) in [(0, 25), (25, 36)] {
            let window = Window { slabs: slabs.clone(), region: Region { x, y: 0, width, height: 47 } };
            parts.push(headless.draw_part(view, &window).unwrap().0);
        }
    }
    parts
}

#[test]
fn parts_of_boxes_merge() {
    let (volume, scene) = head(64, &["splatting.classification=after"]);
    let headless = headless(Backend::Reference);
    let store = MemoryStore::new(&volume, UVec3::splat(12));
    let mut view = headless.view(streamed(&volume, store, 1 << 20), &scene).unwrap();
    let whole = headless.draw(&mut view).unwrap().image;
    let parts = in_four(headless, &mut view);
    assert_at_most(largest_difference(&Image::merge(parts).unwrap(), &whole), 1e-6, "parts");
}

#[test]
fn what_boxes_cannot_show_is_refused() {
    let headless = headless(Backend::Reference);
    let (volume, scene) = head(24, &[]);
    let store = || MemoryStore::new(&volume, UVec3::splat(12));
    let error = headless.render_volume(streamed(&volume, store(), 1 << 10), &scene).unwrap_err().to_string();
    assert!(error.starts_with("volume.level: found 0, in which few pixels see a box of more than 256"), "{error}");
    let broken = MemoryStore { broken_from: Some(10), ..store() };
    let error = headless.render_volume(streamed(&volume, broken, 1 << 20), &scene).unwrap_err().to_string();
    assert_eq!(error, "store: the disk is gone");
}
