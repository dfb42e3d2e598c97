//! Random scenes over every key's range against the f64 evaluation, and with culling against without.

use std::sync::Arc;

use glam::UVec3;
use sheetsplat::cpu::{self, StreamRenderer};
use sheetsplat::image::Image;
use sheetsplat::settings::{Classification, Interpolation, Method};
use sheetsplat::volume::{IndexedStore, Store, StoreIndex};

use crate::common::cases::cases;
use crate::common::random_scene::Case;
use crate::common::store::{MemoryStore, streamed};
use crate::common::tally::{Tally, evaluate, required};

fn draw(case: &Case) -> Image {
    let rendering = cpu::render(case.volume.clone(), &case.scene);
    rendering.unwrap_or_else(|error| panic!("{error}: {}", case.describe())).image
}

fn check(tally: &mut Tally, mut case: Case) {
    case.scene.splatting.culling = false;
    let whole = draw(&case);
    tally.compare(&case, (&evaluate(&case), &whole), required(&case.scene), "cpu");
    case.scene.splatting.culling = true;
    tally.compare_culled(&case, (&whole, &draw(&case)), "cpu");
}

#[test]
fn random_scenes_are_the_twins() {
    let mut tally = Tally::new();
    for seed in 0..cases(500, 2000) as u64 {
        check(&mut tally, Case::new(seed, seed));
    }
    tally.finish();
}

/// A store is the volume in memory, with little memory, too, and an index changes no byte of it.
#[test]
fn random_streams_are_the_volume_in_memory() {
    let mut streams = 0;
    for seed in 0..cases(300, 1500) as u64 {
        let Case { volume, mut scene, .. } = Case::new(seed, seed);
        if volume.channels().count() > 1 || volume.labels().is_some() || volume.colors().is_some() {
            continue;
        }
        let splatting = &mut scene.splatting;
        splatting.method = Method::ImageAligned;
        if splatting.classification != Classification::Before {
            splatting.interpolation = Interpolation::Smooth;
        }
        let whole = cpu::render(volume.clone(), &scene).unwrap().image;
        // Before splatting nothing depends on the range.
        let is_range_known = scene.splatting.classification != Classification::Before;
        let store = MemoryStore { is_range_known, ..MemoryStore::new(&volume, UVec3::new(8, 12, 10)) };
        let store: Arc<dyn Store> = Arc::new(store);
        let index = StoreIndex::new(&*store, "store", &|| {}).unwrap();
        let indexed = Arc::new(IndexedStore::new(Arc::clone(&store), index, "index").unwrap());
        for (name, store, memory) in [("a store", store, 1 << 15), ("an index", indexed, 1 << 30)] {
            let stream = StreamRenderer::new(streamed(store, 0, &volume, memory), &scene).unwrap();
            let same = stream.draw().unwrap().image == whole;
            assert!(same, "{name}: {}", Case::new(seed, seed).describe());
        }
        streams += 1;
    }
    assert!(streams > 50, "{streams} of the volumes are of one channel");
}
