//! Stores of every kind are drawn as the NRRD file of the same values, byte by byte.

use std::fs;
use std::path::{Path, PathBuf};

use glam::UVec3;
use sheetsplat::Scene;
use sheetsplat::cpu::{CpuRenderer, StreamRenderer};
use sheetsplat::scene::{OpenVolume, VolumeSource};
use sheetsplat::volume::{ReadOptions, StreamedVolume, Volume, open_store};

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(name)
}

/// Writes an uncompressed NRRD file of a volume's values.
fn write_nrrd(path: &Path, volume: &Volume) {
    let [[nx, ny, nz], [sx, sy, sz]] = [volume.dims().as_dvec3().to_array(), volume.spacing().to_array()];
    let header = format!(
        "NRRD0004\ntype: float\ndimension: 3\nsizes: {nx} {ny} {nz}\nspacings: {sx:e} {sy:e} {sz:e}\nencoding: raw\nendian: little\n\n"
    );
    let values = volume.values().iter().flat_map(|value| value.to_le_bytes());
    fs::write(path, header.into_bytes().into_iter().chain(values).collect::<Vec<u8>>()).unwrap();
}

fn scene(path: &Path, sets: &[&str]) -> Scene {
    let always = [
        "image={width=37,height=29}",
        "camera={direction=[0.4,0.9,-0.3],fit=\"volume\"}",
        "transfer={color=[[0,[0.3,0.5,0.9]],[300,[1,0.8,0.4]]],opacity=[[0,0.02],[300,0.3]]}",
    ];
    let sets: Vec<String> = always.iter().chain(sets).map(|&set| set.to_owned()).collect();
    Scene::from_volume(VolumeSource::File(path.to_owned()), &sets).unwrap()
}

/// Draws a file as a stream of boxes, and asserts that the image is that of an NRRD file of its values, and so with the NRRD file as a stream.
fn assert_drawn_alike(path: &Path, options: &ReadOptions) {
    let folder = tempfile::tempdir().unwrap();
    let values = Volume::open_with(path, options).unwrap();
    let nrrd = folder.path().join("values.nrrd");
    write_nrrd(&nrrd, &values);
    let whole = Volume::open(&nrrd).unwrap();
    assert_eq!((whole.dims(), whole.spacing()), (values.dims(), values.spacing()), "{}", path.display());
    let scene = scene(&nrrd, &["splatting.classification=before"]);
    let expected = CpuRenderer::new(whole, &scene).unwrap().draw().unwrap().image;
    assert!(expected.pixels.iter().any(|pixel| pixel[3] > 0.1), "{}", path.display());
    for (path, options) in [(path, options), (nrrd.as_path(), &ReadOptions::default())] {
        let store = open_store(path, options).unwrap_or_else(|error| panic!("{error}"));
        let streamed = StreamedVolume::new("store", store, 0, 1 << 24).unwrap();
        let drawn = StreamRenderer::new(streamed, &scene).unwrap().draw().unwrap();
        assert!(drawn.image == expected, "{}", path.display());
        let counts = drawn.stats.store.unwrap();
        assert!(counts.chunks_read > 0 && counts.bytes_read > 0, "{counts:?}");
    }
}

#[test]
fn every_kind_of_store_is_drawn_as_nrrd() {
    let plain = ReadOptions::default();
    for name in
        ["v3.zip:sharded", "v3.zip:sharded-start", "v3.zip:gzip", "v3.zip:zstd", "v3.zip:transposed", "v3.zip:big"]
    {
        assert_drawn_alike(&fixture("zarr").join(name), &plain);
    }
    for name in ["v2.zip:blosc-lz4-1", "v2.zip:blosc-zstd-2", "v2.zip:fortran", "v2.zip:bz2", "v2.zip:missing"] {
        assert_drawn_alike(&fixture("zarr").join(name), &plain);
    }
    for name in ["ngff.zarr", "ngff.ozx"] {
        assert_drawn_alike(&fixture("zarr").join(name), &plain);
    }
    // One channel of two, at either time.
    for name in ["image-0.4.zarr", "image-0.5.zarr"] {
        let options = |channel, time| ReadOptions::default().with_channel(channel).with_time(time);
        for (channel, time) in [(0, 0), (1, 0), (0, 1)] {
            let (path, options) = (fixture("zarr").join(name), options(channel, time));
            assert_drawn_alike(&path, &options);
        }
    }
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let (path, to) = (entry.as_ref().unwrap().path(), to.join(entry.unwrap().file_name()));
        if path.is_dir() { copy(&path, &to) } else { _ = fs::copy(&path, &to).unwrap() }
    }
}

/// bioformats2raw numbers the images of a converted file.
#[test]
fn the_first_image_of_a_converted_file_is_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("converted.zarr");
    copy(&fixture("zarr/image-0.4.zarr"), &path.join("0"));
    fs::write(path.join(".zgroup"), "{\"zarr_format\":2}").unwrap();
    fs::write(path.join(".zattrs"), "{\"bioformats2raw.layout\":3}").unwrap();
    let options = ReadOptions::default().with_channel(1);
    let first = Volume::open_with(&fixture("zarr/image-0.4.zarr"), &options).unwrap();
    assert!(Volume::open_with(&path, &options).unwrap() == first);
    assert_drawn_alike(&path, &options);
    fs::remove_dir_all(path.join("0")).unwrap();
    let error = Volume::open_with(&path, &options).unwrap_err().to_string();
    assert!(error.contains("found nothing, allowed: the first image"), "{error}");
}

/// A spacing of the scene's own is no reason to read a file as a whole.
#[test]
fn spacings_of_scenes_are_streamed() {
    let folder = tempfile::tempdir().unwrap();
    let (dims, path) = (UVec3::new(140, 130, 120), folder.path().join("values.nrrd"));
    let value = |index: u32| (index % 140 + index / 140 % 130 + index / 18_200) as f32;
    let values = (0..dims.element_product()).map(value).collect();
    write_nrrd(&path, &Volume::new("values", dims, glam::DVec3::ONE, values).unwrap());
    let scene = scene(&path, &["volume.spacing=[1,2,0.5]", "splatting.classification=before"]);
    let open = |memory| scene.open_volume_with(&ReadOptions::default().with_memory(memory)).unwrap();
    let (streamed, whole) = with_one_thread(|| (open(8_500_000), open(1 << 30)));
    let OpenVolume::Whole(whole) = whole else { panic!("the volume is not in memory") };
    let OpenVolume::Streamed(streamed) = streamed else { panic!("the volume is in memory") };
    assert_eq!(streamed.channels[0].values.store.levels()[0].grid.spacing, whole.spacing());
    let drawn = StreamRenderer::new(streamed, &scene).unwrap().draw().unwrap().image;
    assert!(drawn == CpuRenderer::new(whole, &scene).unwrap().draw().unwrap().image);
}

/// What reading a store takes decides whether it is streamed: chunks through the whole depth let all values take four bytes at once, flat ones do not.
#[test]
fn stores_that_cannot_be_read_within_the_limit_are_streamed() {
    let folder = tempfile::tempdir().unwrap();
    let side = 64_usize;
    for (thickness, is_whole) in [(16, true), (64, false)] {
        let path = folder.path().join(format!("{thickness}.zarr"));
        fs::create_dir(&path).unwrap();
        let metadata = format!(
            r#"{{"zarr_format":2,"shape":[{side},{side},{side}],"chunks":[{thickness},16,16],"dtype":"|u1","order":"C","compressor":null,"filters":null,"fill_value":0}}"#
        );
        fs::write(path.join(".zarray"), metadata).unwrap();
        for (z, y, x) in (0..side / thickness).flat_map(|z| (0..4).flat_map(move |y| (0..4).map(move |x| (z, y, x)))) {
            let chunk: Vec<u8> = (0..thickness * 256)
                .map(|at| ((z * thickness + at / 256) + 2 * (16 * y + at / 16 % 16) + (16 * x + at % 16)) as u8)
                .collect();
            fs::write(path.join(format!("{z}.{y}.{x}")), chunk).unwrap();
        }
        let scene = scene(&path, &["splatting.classification=before"]);
        let open = |memory| scene.open_volume_with(&ReadOptions::default().with_memory(memory)).unwrap();
        // A byte for each value are 256 KiB, and four are 1 MiB.
        let (within, whole) = with_one_thread(|| (open(700 << 10), open(1 << 30)));
        let OpenVolume::Whole(whole) = whole else { panic!("{thickness}: the volume is not in memory") };
        assert_eq!(whole.value(UVec3::new(17, 33, 50)), (50 + 2 * 33 + 17) as f32, "{thickness}");
        let expected = CpuRenderer::new(whole, &scene).unwrap().draw().unwrap().image;
        let drawn = match within {
            OpenVolume::Whole(volume) if is_whole => CpuRenderer::new(volume, &scene).unwrap().draw(),
            OpenVolume::Streamed(volume) if !is_whole => StreamRenderer::new(volume, &scene).unwrap().draw(),
            _ => panic!("{thickness}: in memory or not?"),
        };
        assert!(drawn.unwrap().image == expected, "{thickness}");
    }
}

/// Runs something with one thread, because every thread needs some memory.
fn with_one_thread<T: Send>(run: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap().install(run)
}
