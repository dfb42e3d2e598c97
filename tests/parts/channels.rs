//! Volumes of several channels, and segmented ones, that are read box by box: the image of the volume in memory.

use std::sync::Arc;

use glam::{DVec3, UVec3};
use sheetsplat::Image;
use sheetsplat::headless::Backend;
use sheetsplat::scene::{Scene, VolumeSource};
use sheetsplat::settings::{Region, Window};
use sheetsplat::volume::{Channels, SampleType, StreamedChannel, StreamedLevel, StreamedVolume, Volume, builtin};

use crate::common::compare::{assert_at_least, assert_at_most};
use crate::common::images::{largest_difference, psnr};
use crate::common::store::MemoryStore;
use crate::merging::headless;
use crate::streamed::in_four;

pub(crate) const BACKENDS: [Backend; 3] = [Backend::Reference, Backend::Gpu, Backend::Cpu];

/// A head, from the second channel on mirrored along an axis each; the first one with its labels, if it is to have any.
pub(crate) fn volume(channels: u32, has_labels: bool) -> Volume {
    let head = builtin::volume("head:40").unwrap();
    let channel = |number: u32| {
        let grid = *head.grid();
        let mirrored = |index: u32| {
            let mut voxel = grid.voxel_at(index);
            if number > 0 {
                let axis = number as usize - 1;
                voxel[axis] = head.dims()[axis] - 1 - voxel[axis];
            }
            head.value(voxel)
        };
        let values = (0..head.dims().element_product()).map(mirrored).collect();
        Volume::new("head", head.dims(), head.spacing(), values).unwrap()
    };
    let others = (1..channels).map(channel).collect();
    let first = if has_labels { head.clone() } else { channel(0) };
    first.with_channels("head", others).unwrap()
}

/// The bytes of a volume's values, colours and labels.
pub(crate) fn bytes(volume: &Volume) -> u64 {
    let labels = volume.labels().map_or(0, size_of_val);
    let of_channel = |channel: &Volume| 4 * channel.values().len() + channel.colors().map_or(0, size_of_val);
    (volume.channels().map(of_channel).sum::<usize>() + labels) as u64
}

/// A head with colours of its own, whose luminances are its values.
fn colored() -> Volume {
    let head = builtin::volume("head:40").unwrap();
    let color = |(at, value): (usize, f32)| {
        let wave = |speed: f32| value * (0.75 + 0.25 * (at as f32 * speed).sin());
        [wave(0.003), wave(0.05), wave(0.011), 255.0 - wave(0.02) / 2.0].map(f32::round)
    };
    let colors: Vec<[f32; 4]> = head.values().iter().enumerate().map(color).collect();
    Volume::from_colors("head", head.dims(), head.spacing(), (&colors, SampleType::U8)).unwrap()
}

/// The stores of a volume, the labels' last, and the volume as a stream of them, whose boxes take at most three quarters of the volume's bytes.
pub(crate) fn streamed(volume: &Volume) -> (Vec<Arc<MemoryStore>>, StreamedVolume) {
    let memory = 3 * bytes(volume);
    let mut stores: Vec<Arc<MemoryStore>> = (0..)
        .zip(volume.channels())
        .map(|(number, channel)| Arc::new(MemoryStore::new(channel, UVec3::new(8 + number, 12, 10))))
        .collect();
    let level = |store: &Arc<MemoryStore>| StreamedLevel::new("store", store.clone(), 0);
    let mut channels = Channels::of(stores.iter().map(|store| StreamedChannel::from(level(store)))).unwrap();
    if let Some(labels) = volume.labels() {
        let values = labels.iter().map(|&label| label.into()).collect();
        let labels = Volume::new("labels", volume.dims(), DVec3::ONE, values).unwrap();
        stores.push(Arc::new(MemoryStore { identity: "labels", ..MemoryStore::new(&labels, UVec3::splat(7)) }));
        *channels.first_mut() = channels.first().clone().with_labels(level(&stores[stores.len() - 1])).unwrap();
    }
    (stores, StreamedVolume { channels, sample: Arc::new(volume.clone()), memory })
}

/// A scene of a volume of several channels, or of one.
pub(crate) fn scene(channels: u32, sets: &[&str]) -> Scene {
    let transfer =
        |color: &str| format!("{{color=[[0,{color}],[255,[1,0.8,0.4]]],opacity=[[0,0],[40,0.02],[160,0.5]]}}");
    let colors = ["[0.3,0.5,0.9]", "[0.9,0.1,0.2]", "[0.2,0.9,0.3]"];
    let of_channel = |number: usize| match channels {
        1 => format!("transfer={}", transfer(colors[0])),
        _ => format!("channel[{number}].transfer={}", transfer(colors[number])),
    };
    let always = [
        "image={width=61,height=47,background=[0.2,0.4,0.6,0.5]}",
        "camera={direction=[0.4,0.9,-0.3],fit=\"volume\"}",
        "splatting={opacity_threshold=1,classification=\"before\"}",
    ];
    let sets = always.iter().chain(sets).map(|&set| set.to_owned());
    let sets: Vec<String> = (0..channels as usize).map(of_channel).chain(sets).collect();
    Scene::from_volume(VolumeSource::Builtin("head".to_owned()), &sets).unwrap()
}

/// Asserts that a volume is drawn the same while it is read.
fn assert_same(backend: Backend, volume: &Volume, scene: &Scene) {
    let headless = headless(backend);
    let whole = headless.render_volume(volume.clone(), scene).unwrap().image;
    let (stores, streamed) = streamed(volume);
    let drawn = headless.render_volume(streamed, scene).unwrap();
    let name = format!("{backend} {:?}", scene.splatting);
    assert_at_least(psnr(&drawn.image.pixels, &whole.pixels, [0.2, 0.4, 0.6, 0.5], 500), 100.0, &name);
    if backend != Backend::Gpu {
        assert_at_most(largest_difference(&drawn.image, &whole), 1e-6, &name);
    }
    let counts = drawn.stats.store.unwrap();
    let chunks: u64 = stores.iter().map(|store| store.levels[0].chunks().as_u64vec3().element_product()).sum();
    assert_eq!((counts.chunks_total, drawn.stats.backend.as_str()), (chunks, backend.name()), "{name}");
    assert!(stores.iter().all(|store| store.read.lock().unwrap().len() > 1), "{name}");
    assert!(counts.chunks_read > stores.len() as u64 && counts.chunks_read <= chunks, "{name} {counts:?}");
    assert!(counts.bytes_read > 0 && counts.chunk_bytes < bytes(volume), "{name} {counts:?}");
}

const SCENES: [&[&str]; 6] = [
    &[],
    &["splatting.compositing=exponential", "splatting.classification=after"],
    &["camera.projection=perspective", "splatting.classification=after", "splatting.slab_width=0.7"],
    &["splatting.compositing=xray", "splatting.classification=after", "shading.gradient=kernel"],
    &["splatting.compositing=surface", "splatting.radius=1.4", "clip.planes=[[0.5,0.3,1,2]]"],
    &["splatting.compositing=surface", "splatting.classification=after"],
];

#[test]
fn several_channels_are_those_of_the_volume_in_memory() {
    for (channels, sets) in
        [(3, SCENES[0]), (2, SCENES[1]), (2, SCENES[2]), (3, SCENES[3]), (2, SCENES[4]), (3, SCENES[5])]
    {
        let (volume, scene) = (volume(channels, false), scene(channels, sets));
        for backend in BACKENDS {
            assert_same(backend, &volume, &scene);
        }
    }
}

#[test]
fn colors_are_those_of_the_volume_in_memory() {
    for (channels, sets) in [(1, SCENES[0]), (1, SCENES[1]), (2, SCENES[2]), (1, SCENES[3]), (2, SCENES[4])] {
        let others = if channels == 2 { vec![volume(1, false)] } else { Vec::new() };
        let volume = colored().with_channels("head", others).unwrap();
        for backend in BACKENDS {
            assert_same(backend, &volume, &scene(channels, sets));
        }
    }
    let headless = headless(Backend::Reference);
    let (_, streamed) = streamed(&colored());
    let gray = StreamedVolume { sample: Arc::new(volume(1, false)), ..streamed };
    let error = headless.render_volume(gray, &scene(1, &[])).unwrap_err().to_string();
    let words = "found a sample of 1 channels, 0 of them with labels and 0 with colours, allowed: 1 channels, 0 of them with labels and 1 with colours";
    assert!(error.contains(words), "{error}");
}

/// Channels that share no sheets are drawn one by one.
#[test]
fn images_of_channels_add_up_as_in_memory() {
    let volume = volume(2, false);
    for (classification, compositing) in
        [("before", "maximum"), ("after", "maximum"), ("before", "minimum"), ("after", "minimum"), ("after", "average")]
    {
        let splatting = format!(
            "splatting={{opacity_threshold=1,classification=\"{classification}\",compositing=\"{compositing}\"}}"
        );
        for backend in BACKENDS {
            assert_same(backend, &volume, &scene(2, &[&splatting]));
        }
    }
}

/// The labels have tables of their own: one is hidden, and one is opaque where the others show nothing.
#[test]
fn labels_are_those_of_the_volume_in_memory() {
    let label =
        "label=[{label=1,visible=false},{label=2,color=[[0,[1,0,0]]],opacity=[[0,0.3]]},{label=3,color=[[0,[0,1,1]]]}]";
    let tables = [format!("transfer.{label}"), format!("channel[0].transfer.{label}")];
    // The label in the middle of a ray decides about its mean, whichever box has it.
    let means: &[&str] = &["splatting.compositing=average", "splatting.classification=after"];
    for sets in [SCENES[0], SCENES[1], SCENES[4], means] {
        let (volume, scene) = (volume(1, true), scene(1, &[&[&*tables[0]], sets].concat()));
        for backend in BACKENDS {
            assert_same(backend, &volume, &scene);
        }
    }
    assert_same(Backend::Cpu, &volume(2, true), &scene(2, &[&tables[1]]));
}

/// Nothing is read of a channel that is hidden or has no opacity, nor of its labels; what is left is drawn as without it.
#[test]
fn channels_that_show_nothing_are_not_read() {
    let volume = volume(3, true);
    for backend in BACKENDS {
        for sets in [
            ["channel[0].visible=false", "channel[2].transfer={color=[[0,[1,1,1]]],opacity=[[0,0]]}"],
            ["channel[0].transfer.iso_ranges=[[-9,-1]]", "channel[2].transfer.iso_ranges=[[-40,-30]]"],
        ] {
            for (compositing, classification) in [("linear", "after"), ("maximum", "before")] {
                let splatting = format!(
                    "splatting={{opacity_threshold=1,compositing=\"{compositing}\",classification=\"{classification}\"}}"
                );
                let scene = scene(3, &[&sets[..], &[&splatting]].concat());
                let (stores, streamed) = streamed(&volume);
                let headless = headless(backend);
                let drawn = headless.render_volume(streamed, &scene).unwrap();
                let read = [0, 1, 2, 3].map(|number: usize| stores[number].read.lock().unwrap().len());
                assert!(read[1] > 1 && [read[0], read[2], read[3]] == [0; 3], "{backend} {sets:?}: {read:?}");
                let whole = headless.render_volume(volume.clone(), &scene).unwrap();
                let name = format!("{backend} {compositing} {sets:?}");
                assert_at_least(psnr(&drawn.image.pixels, &whole.image.pixels, [0.2, 0.4, 0.6, 0.5], 500), 100.0, name);
            }
        }
        let hidden = [0, 1, 2].map(|number| format!("channel[{number}].visible=false"));
        for compositing in ["linear", "maximum"] {
            let compositing = format!("splatting.compositing={compositing}");
            let sets: Vec<&str> = hidden.iter().chain([&compositing]).map(String::as_str).collect();
            let drawn = headless(backend).render_volume(streamed(&volume).1, &scene(3, &sets)).unwrap();
            let counts = drawn.stats.store.unwrap();
            assert_eq!((counts.chunks_read, counts.bytes_read, drawn.stats.width), (0, 0, 61), "{backend}");
            assert!(drawn.image.pixels.iter().all(|pixel| *pixel == drawn.image.pixels[0]), "{backend}");
        }
    }
}

#[test]
fn parts_of_several_channels_merge() {
    let (volume, scene) = (volume(2, true), scene(2, &["splatting.classification=after"]));
    for backend in BACKENDS {
        let headless = headless(backend);
        let (_, streamed) = streamed(&volume);
        let mut view = headless.view(streamed.clone(), &scene).unwrap();
        let whole = headless.draw(&mut view).unwrap().image;
        let parts = in_four(headless, &mut view);
        // Every store counts for what a part belongs to.
        let mut fingerprints = vec![parts[0].identity.fingerprint.clone()];
        let another = |volume: &Volume| {
            let store = MemoryStore { identity: "another", ..MemoryStore::new(volume, UVec3::splat(12)) };
            StreamedLevel::new("another", Arc::new(store), 0)
        };
        let values = another(&volume);
        let first = streamed.channels.first();
        let labels = StreamedLevel { level: 0, ..first.labels.clone().unwrap() };
        let window = Window { slabs: 0..0, region: Region { x: 0, y: 0, width: 1, height: 1 } };
        for (number, channel) in [
            (1, values.clone().into()),
            (0, StreamedChannel { values: values.clone(), ..first.clone() }),
            (0, StreamedChannel { labels: Some(values), ..first.clone() }),
            (0, StreamedChannel { values: labels, ..first.clone() }),
        ] {
            let mut other = streamed.clone();
            other.channels[number] = channel;
            let mut view = headless.view(other, &scene).unwrap();
            fingerprints.push(headless.draw_part(&mut view, &window).unwrap().0.identity.fingerprint);
        }
        let count = fingerprints.len();
        fingerprints.sort();
        fingerprints.dedup();
        assert_eq!(fingerprints.len(), count);
        assert_at_most(largest_difference(&Image::merge(parts).unwrap(), &whole), 1e-6, backend);
    }
}

#[test]
fn channels_that_do_not_belong_together_are_refused() {
    let volume = volume(2, true);
    let (_, StreamedVolume { channels, .. }) = streamed(&volume);
    let [first, second] = &*channels else { panic!("two channels") };
    let level = |name: &str, dims: UVec3, spacing: f64, value: f32| {
        let values = (0..dims.element_product()).map(|_| value).collect();
        let volume = Volume::new("other", dims, DVec3::splat(spacing), values).unwrap();
        StreamedLevel::new(name, Arc::new(MemoryStore::new(&volume, UVec3::splat(16))), 0)
    };
    let (dims, spacing) = (volume.dims(), volume.spacing().x);
    let open = |first: &StreamedChannel, second: StreamedChannel| {
        StreamedVolume::of_channels(Channels::new(first.clone(), [second]), 1 << 22)
            .map(|_| ())
            .map_err(|error| error.to_string())
    };
    assert_eq!(open(first, second.clone()), Ok(()));
    for (other, expected) in [
        (level("pet", dims - 1, spacing, 1.0).into(), "pet: channel[1].volume: found a grid of "),
        (level("pet", dims, spacing * 1.01, 1.0).into(), "pet: channel[1].volume: found a grid of "),
        (StreamedLevel { level: 1, ..second.values.clone() }.into(), "store: level: found 1, allowed: 0 to 0"),
        (second.clone().with_labels(level("seg", dims + 1, 1.0, 1.0)).unwrap(), "seg: labels: found a grid of "),
        (second.clone().with_labels(level("seg", dims, 1.0, 0.5)).unwrap(), "seg: data: found 0.5 at voxel [0, 0, 0]"),
        (second.clone().with_labels(level("seg", dims, 1.0, 65536.0)).unwrap(), "seg: data: found 65536 at voxel"),
    ] {
        let error = open(first, other).unwrap_err();
        assert!(error.starts_with(expected), "{error}");
    }
    let error = open(first, level("pet", dims - 1, spacing, 1.0).into()).unwrap_err();
    assert!(error.ends_with(", for a volume that is streamed, or more memory"), "{error}");

    // A label that the sample does not show is found when it is read.
    let seg = first.clone().with_labels(level("seg", dims, 1.0, 0.5)).unwrap();
    let (_, streamed) = streamed(&volume);
    let mut other = streamed.clone();
    *other.channels.first_mut() = seg;
    let error = headless(Backend::Cpu).render_volume(other, &scene(2, &[]));
    let error = error.unwrap_err().to_string();
    assert!(error.starts_with("seg: data: found 0.5 at voxel [") && error.contains("labels, whole numbers"), "{error}");
    // A sample of fewer channels, or without labels.
    for (sample, found) in
        [(self::volume(2, false), "2 channels, 0 of them"), (self::volume(3, true), "3 channels, 1 of them")]
    {
        let other = StreamedVolume { sample: Arc::new(sample), ..streamed.clone() };
        let error = headless(Backend::Reference).view(other, &scene(2, &[])).unwrap_err().to_string();
        assert!(error.starts_with(&format!("volume: found a sample of {found}")), "{error}");
    }
    // What was put together by hand is checked, too.
    let mut other = streamed.clone();
    other.channels[1].values = level("pet", dims - 1, spacing, 1.0);
    let error = headless(Backend::Cpu).view(other, &scene(2, &[])).unwrap_err().to_string();
    assert!(error.starts_with("pet: channel[1].volume: found a grid of "), "{error}");
}

/// Of channels whose images add up each is streamed by itself.
#[test]
fn parts_of_images_that_add_up_merge() {
    for (labelled, compositing, classification) in [
        (true, "maximum", "before"),
        (true, "average", "after"),
        (false, "average", "after"),
        (true, "minimum", "before"),
        (false, "minimum", "after"),
    ] {
        let volume = volume(2, labelled);
        let splatting = format!(
            "splatting={{opacity_threshold=1,classification=\"{classification}\",compositing=\"{compositing}\"}}"
        );
        let table = "channel[0].transfer.label=[{label=2,color=[[0,[1,0,0]]],opacity=[[0,0.3]]}]";
        let tables = if labelled { &[table][..] } else { &[] };
        let scene = scene(2, &[&[&*splatting], tables].concat());
        for backend in BACKENDS {
            let headless = headless(backend);
            let mut view = headless.view(streamed(&volume).1, &scene).unwrap();
            let whole = headless.draw(&mut view).unwrap().image;
            let parts = in_four(headless, &mut view);
            assert_eq!(parts[0].contents.len(), 2);
            let merged = Image::merge(parts).unwrap();
            assert_at_most(largest_difference(&merged, &whole), 1e-6, format!("{backend} {compositing}"));
            let (_, stats) = headless.draw_part(&mut view, &Window::whole([61, 47])).unwrap();
            assert_eq!(
                stats.store.map(|store| store.chunks_total),
                headless.draw(&mut view).unwrap().stats.store.map(|store| store.chunks_total)
            );
        }
    }
}
