//! Which chunks of a store are read, and what is an error about them.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use glam::UVec3;
use sheetsplat::Scene;
use sheetsplat::appearance::{Preset, quantiles};
use sheetsplat::cpu::{CpuRenderer, StreamRenderer};
use sheetsplat::headless::{Backend, Headless, HeadlessOptions};
use sheetsplat::scene::VolumeSource;
use sheetsplat::volume::{IndexedStore, Store, StoreIndex, StreamedVolume, Volume, builtin};

use crate::common::compare::assert_at_most;
use crate::common::store::{self, MemoryStore};

fn head(size: u32) -> Volume {
    let volume = builtin::volume(&format!("head:{size}")).unwrap();
    Volume::new("head", volume.dims(), volume.spacing(), volume.values().to_vec()).unwrap()
}

fn scene(sets: &[&str]) -> Scene {
    let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
    Scene::from_volume(VolumeSource::Builtin("head".to_owned()), &sets).unwrap()
}

fn indexed(volume: &Volume, chunk: u32) -> IndexedStore {
    let store = || MemoryStore::new(volume, UVec3::splat(chunk));
    let index = StoreIndex::new(&store(), "store", &|| {}).unwrap();
    IndexedStore::new(Arc::new(store()), index, "a.index").unwrap()
}

fn streamed(store: impl Store + 'static, sample: &Volume) -> StreamedVolume {
    store::streamed(Arc::new(store), 0, sample, 1 << 24)
}

/// Of an opaque head most chunks with visible values are behind others, or beside what pixels see before they are opaque. Where classification comes after
/// splatting, chunks without visible values are read, too, that lie around what is seen.
#[test]
fn most_chunks_of_an_opaque_head_are_not_read() {
    let volume = head(256);
    let [first, end] = [12.0, 30.0];
    let opacity = format!("transfer={{color=[[0,[1,0.9,0.8]]],opacity=[[{first},0],[{end},1]]}}");
    for (classification, most) in [("before", 0.6), ("after", 1.1)] {
        let scene = scene(&[
            &opacity,
            "image={width=160,height=160}",
            "camera={direction=[0.55,0.8,0.15],up=[0,0,-1],fit=\"volume\"}",
            &format!("splatting={{compositing=\"exponential\",classification=\"{classification}\"}}"),
        ]);
        let store = indexed(&volume, 16);
        let across = store.levels()[0].chunks();
        let chunks = (0..across.element_product())
            .map(|at| UVec3::new(at % across.x, at / across.x % across.y, at / (across.x * across.y)));
        let visible = chunks.filter(|&chunk| store.chunk_range(0, chunk).unwrap()[1] > first as f32).count();
        let whole = CpuRenderer::new(volume.clone(), &scene).unwrap().draw().unwrap();
        let drawn = StreamRenderer::new(streamed(store, &volume), &scene).unwrap().draw().unwrap();
        assert!(drawn.image == whole.image, "{classification}");
        let read = drawn.stats.store.unwrap().chunks_read as f64;
        println!("{classification}: {read} of {visible} chunks, {:.2}", read / visible as f64);
        assert!(visible > 100);
        assert_at_most(read / visible as f64, most, classification);
    }
}

/// A chunk that the store lacks, although an index made earlier tells values of it, is an error that names it, whether drawn chunk by chunk or box by box.
#[test]
fn chunks_that_an_index_tells_of_must_be_there() {
    let full = head(48);
    let side = 16;
    let missing = UVec3::new(1, 0, 1);
    let is_missing = |at: UVec3| at / side == missing;
    let values: Vec<f32> = (0..full.values().len() as u32)
        .map(|index| if is_missing(full.grid().voxel_at(index)) { 0.0 } else { full.values().at(index as usize) })
        .collect();
    let damaged = Volume::new("head", full.dims(), full.spacing(), values).unwrap();
    let store = |volume: &Volume| MemoryStore::new(volume, UVec3::splat(side));
    let index = StoreIndex::new(&store(&full), "store", &|| {}).unwrap();
    let [min, max] = indexed(&full, side).chunk_range(0, missing).unwrap();
    assert!(max > 0.0, "{min} {max}");
    for (backend, classification) in [(Backend::Cpu, "before"), (Backend::Cpu, "after"), (Backend::Reference, "before")]
    {
        let scene = scene(&[
            "image={width=40,height=30}",
            "camera={direction=[0.4,0.9,-0.3],fit=\"volume\"}",
            "transfer={color=[[0,[1,1,1]]],opacity=[[0,0],[255,0.2]]}",
            &format!("splatting={{classification=\"{classification}\",culling=false}}"),
        ]);
        let headless = Headless::new(&HeadlessOptions::default().with_backend(backend)).unwrap();
        let lying = IndexedStore::new(Arc::new(store(&damaged)), index.clone(), "a.index").unwrap();
        let error = headless.render_volume(streamed(lying, &full), &scene).unwrap_err().to_string();
        let expected = format!(
            "a.index: chunk: found no chunk {missing} of level 0 in the store, allowed: the one with values from {min} to {max} that \
             the index tells of"
        );
        assert_eq!(error, expected, "{backend} {classification}");
        // Chunks that were absent when the index was made are no error.
        let index = StoreIndex::new(&store(&damaged), "store", &|| {}).unwrap();
        let honest = IndexedStore::new(Arc::new(store(&damaged)), index, "a.index").unwrap();
        headless.render_volume(streamed(honest, &full), &scene).unwrap();
    }
    // A box is checked that is read without asking whether chunks are held.
    let lying = IndexedStore::new(Arc::new(store(&damaged)), index, "a.index").unwrap();
    let mut values = [0.0; 64];
    assert!(lying.read(0, missing * side + 3, UVec3::splat(4), &mut values).is_err());
    assert!(lying.read(0, UVec3::ZERO, UVec3::splat(4), &mut values).is_ok());
}

/// Every chunk is told of once, whatever draws, and the number is that of the statistics.
#[test]
fn progress_is_told_chunk_by_chunk() {
    let volume = head(48);
    for backend in [Backend::Cpu, Backend::Reference] {
        let scene = scene(&["image={width=40,height=30}", "splatting.classification=before"]);
        let (calls, most) = (Arc::new(AtomicU64::new(0)), Arc::new(AtomicU64::new(0)));
        let (told, last) = (Arc::clone(&calls), Arc::clone(&most));
        let progress = Arc::new(move |read: u64, total: u64| {
            assert!((1..=total).contains(&read) && total == 3 * 3 * 2, "{read} of {total}");
            told.fetch_add(1, Ordering::Relaxed);
            last.fetch_max(read, Ordering::Relaxed);
        });
        let store = MemoryStore::new(&volume, UVec3::splat(16));
        let total = store.levels()[0].chunks().element_product();
        assert_eq!(total, 18, "{}", volume.dims());
        let headless = Headless::new(&HeadlessOptions::default().with_backend(backend)).unwrap();
        let drawn = headless.render_volume(streamed(store, &volume).watched_by(progress), &scene).unwrap();
        let [calls, most] = [calls, most].map(|count| count.load(Ordering::Relaxed));
        assert_eq!(calls, most, "{backend}");
        assert!(calls >= drawn.stats.store.unwrap().chunks_read && calls > 4, "{backend}: {calls}");
    }
}

/// What a scene leaves open is nearly the same for a sample as for all values.
#[test]
fn samples_have_the_distribution_of_all_values() {
    let volume = head(96);
    let store = Arc::new(MemoryStore::new(&volume, UVec3::splat(16)));
    let bytes = 4 * volume.values().len() as u64;
    // An eighth of the memory is for the sample: every second voxel along each axis.
    let streamed = StreamedVolume::new("head", store, 0, bytes * 2).unwrap();
    let sample = &streamed.sample;
    assert_eq!(sample.dims(), volume.dims().map(|count| count.div_ceil(2)));
    let reads = sample.reads().unwrap();
    assert!(reads.chunks_read > 0 && reads.chunks_read <= reads.chunks_total && reads.bytes_read > 0, "{reads:?}");
    let of = |volume: &Volume| quantiles(volume.values(), |value| value > 1.0, [0.05, 0.25, 0.5, 0.75, 0.95]).unwrap();
    for (of_sample, of_all) in of(sample).into_iter().zip(of(&volume)) {
        assert_at_most(f64::from((of_sample - of_all).abs()), 2.0, format!("{of_sample} {of_all}"));
    }
    assert_eq!(Preset::suggested(sample), Preset::suggested(&volume));
    // A histogram of 16 bins.
    let histogram = |volume: &Volume| -> Vec<f64> {
        let mut bins = [0.0; 16];
        volume.values().iter().for_each(|value| bins[(value / 16.0).clamp(0.0, 15.0) as usize] += 1.0);
        bins.map(|bin| bin / volume.values().len() as f64).to_vec()
    };
    for (of_sample, of_all) in histogram(sample).into_iter().zip(histogram(&volume)) {
        assert_at_most((of_sample - of_all).abs(), 0.01, "bin");
    }
    // The frame counts them.
    let scene = scene(&["image={width=40,height=30}", "splatting.classification=before"]);
    let counts = StreamRenderer::new(streamed.clone(), &scene).unwrap().draw().unwrap().stats.store.unwrap();
    assert_eq!((counts.sample_chunks_read, counts.sample_bytes_read), (reads.chunks_read, reads.bytes_read));
}
