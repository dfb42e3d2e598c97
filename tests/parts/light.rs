//! Light (SPEC §14) of volumes that are read box by box, and of parts of channels whose images are added up: that of the whole volume.

use std::sync::Arc;

use glam::{DVec3, UVec3};
use sheetsplat::Image;
use sheetsplat::headless::Backend;
use sheetsplat::internals::fingerprint;
use sheetsplat::scene::{OpenVolume, Scene};
use sheetsplat::volume::{Grid, StoreLevel, StreamedChannel, StreamedLevel, StreamedVolume, Volume};

use crate::channels::{BACKENDS, bytes, scene, streamed, volume};
use crate::common::compare::{assert_at_least, assert_at_most};
use crate::common::images::{largest_difference, psnr, rms};
use crate::common::store::MemoryStore;
use crate::merging::headless;
use crate::streamed::in_four;

const LIGHT: &str = "shading={occlusion=0.8,shadow=0.7,light=\"upper-left\",ambient=0.6,diffuse=0.4,light_step=4}";

/// A scene in the light of both kinds of sheets.
fn lit(channels: u32, sets: &[&str]) -> Scene {
    scene(channels, &[sets, &[LIGHT]].concat())
}

/// A volume as a stream with more memory, by a factor of its bytes.
fn with_memory(volume: &Volume, factor: f64) -> StreamedVolume {
    StreamedVolume { memory: (bytes(volume) as f64 * factor) as u64, ..streamed(volume).1 }
}

#[test]
fn streams_have_the_light_of_the_volume_in_memory() {
    let (two, labelled) = (volume(2, false), volume(1, true));
    let after = "splatting={opacity_threshold=1,classification=\"after\"}";
    let exponential = "splatting={opacity_threshold=1,classification=\"before\",compositing=\"exponential\"}";
    let maximum = "splatting={opacity_threshold=1,classification=\"before\",compositing=\"maximum\"}";
    for (channels, volume, sets) in [
        (2, &two, &[exponential][..]),
        (2, &two, &[after, "camera.projection=perspective"]),
        (2, &two, &[maximum]),
        (1, &labelled, &[after]),
        (1, &labelled, &["transfer.label=[{label=1,visible=false}]", "clip.planes=[[0.5,0.3,1,2]]"]),
    ] {
        let scene = lit(channels, sets);
        for backend in BACKENDS {
            let headless = headless(backend);
            let whole = headless.render_volume(volume.clone(), &scene).unwrap();
            let unlit = headless.render_volume(volume.clone(), &self::scene(channels, sets)).unwrap();
            assert_at_least(rms(&unlit.image, &whole.image), 1e-2, format_args!("{sets:?}: sheets change something"));
            // Boxes hold less than the volume of two channels.
            let drawn = headless.render_volume(with_memory(volume, 3.5 * 2.0 / f64::from(channels)), &scene).unwrap();
            let name = format!("{backend} {sets:?}");
            let found = psnr(&drawn.image.pixels, &whole.image.pixels, [0.2, 0.4, 0.6, 0.5], 500);
            println!("{name}: {found:.1} dB");
            assert_at_least(found, 100.0, &name);
            let stats = drawn.stats;
            assert_eq!((stats.light_level, stats.light_stride), (Some(0), Some(1)), "{name}");
            assert_eq!((whole.stats.light_level, whole.stats.light_stride), (None, None), "{name}");
        }
    }
}

/// A part has the light of all channels, although each is drawn by itself.
#[test]
fn parts_of_channels_whose_images_add_up_have_their_light() {
    let volume = volume(2, false);
    for (compositing, classification) in [("maximum", "before"), ("maximum", "after"), ("average", "before")] {
        let splatting = format!(
            "splatting={{opacity_threshold=1,compositing=\"{compositing}\",classification=\"{classification}\"}}"
        );
        let scene = lit(2, &[&splatting]);
        for backend in BACKENDS {
            let headless = headless(backend);
            let whole = headless.render_volume(volume.clone(), &scene).unwrap().image;
            let in_memory = headless.view(volume.clone(), &scene).unwrap();
            let streamed = headless.view(with_memory(&volume, 3.5), &scene).unwrap();
            for mut view in [in_memory, streamed] {
                let merged = Image::merge(in_four(headless, &mut view)).unwrap();
                let tolerance = if backend == Backend::Gpu { 1e-4 } else { 1e-6 };
                let name = format!("{backend} {compositing} {classification}");
                assert_at_most(largest_difference(&merged, &whole), tolerance, name);
            }
        }
    }
}

#[test]
fn light_that_memory_does_not_hold_is_refused() {
    let volume = volume(2, false);
    for backend in BACKENDS {
        let refused = |memory: u64, scene: &Scene| {
            let volume = StreamedVolume { memory, ..streamed(&volume).1 };
            headless(backend).view(volume, scene).map(|_| ()).map_err(|error| error.to_string())
        };
        let error = refused(1 << 19, &lit(2, &[])).unwrap_err();
        for words in ["shading.occlusion", "found 0.8, whose light needs 1 MiB, 1 MiB of them", "quarter", "light_step"]
        {
            assert!(error.contains(words), "no {words:?} in {error}");
        }
        let mut shadow = lit(2, &[]);
        shadow.shading.occlusion = 0.0;
        assert!(refused(1 << 19, &shadow).unwrap_err().contains("shading.shadow: found 0.7"));
        shadow.shading.shadow = 0.0;
        refused(1 << 20, &shadow).unwrap();
        refused(1 << 22, &lit(2, &[])).unwrap();
    }
}

/// Light of another level, or of every other voxel, is another picture.
#[test]
fn what_light_is_made_of_enters_the_fingerprint() {
    let volume = volume(1, false);
    let of_side = |side: u32| {
        let grid = Grid::new(UVec3::splat(side), DVec3::ONE);
        let mut store = MemoryStore::new(&volume, UVec3::splat(64));
        store.levels = [StoreLevel { grid, chunk: UVec3::splat(64) }];
        let channels = StreamedChannel::from(StreamedLevel::new("store", Arc::new(store), 0)).into();
        let sample = Arc::new(volume.clone());
        OpenVolume::Streamed(StreamedVolume { channels, sample, memory: 1 << 30 })
    };
    let scene = lit(1, &[]);
    let with_light = |side| fingerprint(&of_side(side), &scene).unwrap();
    let mut dark = scene.clone();
    (dark.shading.occlusion, dark.shading.shadow) = (0.0, 0.0);
    assert_ne!(with_light(40), fingerprint(&of_side(40), &dark).unwrap());
    // 256³ voxels are light's limit.
    let OpenVolume::Streamed(large) = of_side(513) else { panic!("it is streamed") };
    let thinned = large.thinned(1 << 24);
    assert_eq!((thinned.level, thinned.stride, thinned.dims), (0, 4, UVec3::splat(129)));
}
