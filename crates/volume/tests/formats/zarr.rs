//! Zarr stores, which `tests/fixtures/make_zarr.py` writes by zarr-python, ome-zarr and ngff-zarr.

use std::fs;
use std::path::Path;

use glam::{DVec3, UVec3};
use serde_json::{Value, json};
use sheetsplat_volume::{Labels, ReadOptions, SampleType, Volume, VolumeError, open_store, sample};

use super::{DIMS, Folder, SPACING, assert_warned, fixture, open, values, warned};

/// Asserts an error about a field with these words.
#[track_caller]
fn assert_error<T: std::fmt::Debug>(result: Result<T, VolumeError>, field: &str, words: &[&str]) {
    let message = result.unwrap_err().to_string();
    assert!(message.contains(&format!(": {field}: ")) && words.iter().all(|word| message.contains(word)), "{message}");
}

/// The values x + 10 y + 100 z of a larger grid.
fn larger(dims: UVec3) -> Vec<f32> {
    let [nx, ny, nz] = dims.to_array();
    let row = |z: u32, y: u32| (0..nx).map(move |x| (x + 10 * y + 100 * z) as f32);
    (0..nz).flat_map(|z| (0..ny).flat_map(move |y| row(z, y))).collect()
}

#[test]
fn every_type_and_order_of_bytes() {
    let mut names: Vec<String> = ["u1"].map(|name| format!("v2.zip:{name}")).to_vec();
    for kind in ["i2", "u2", "i4", "u4", "i8", "u8", "f2", "f4", "f8"] {
        names.extend([format!("v2.zip:little-{kind}"), format!("v2.zip:big-{kind}")]);
    }
    for kind in ["uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64", "float16", "float32", "float64"] {
        names.push(format!("v3.zip:{kind}"));
    }
    for name in names {
        open(&format!("zarr/{name}"));
    }
    for name in ["v2.zip:i1", "v3.zip:int8"] {
        let volume = Volume::open(&fixture(&format!("zarr/{name}"))).unwrap();
        let expected: Vec<f32> = values().iter().map(|value| value - 128.0).collect();
        assert_eq!((volume.values(), volume.encoding().unwrap().sample_type), ((&expected).into(), SampleType::I8));
    }
    let truth = Volume::open(&fixture("zarr/v3.zip:bool")).unwrap();
    let expected: Vec<f32> = values().iter().map(|value| f32::from(value % 3.0 == 0.0)).collect();
    assert_eq!(truth.values(), expected);
    let volume = open("zarr/v3.zip:uint16");
    assert_eq!((volume.spacing(), volume.unit()), (DVec3::ONE, None));
    assert_eq!((volume.encoding().unwrap().format, volume.encoding().unwrap().sample_type), ("Zarr", SampleType::U16));
}

#[test]
fn every_way_to_store_chunks() {
    for name in ["fortran", "deflated", "slashes", "bz2", "gzip", "zlib", "zstd"] {
        open(&format!("zarr/v2.zip:{name}"));
    }
    for name in ["big", "dots", "gzip", "zstd", "checked", "blosc", "transposed", "sharded", "sharded-start"] {
        open(&format!("zarr/v3.zip:{name}"));
    }
    let dims = UVec3::new(20, 16, 12);
    let expected = larger(dims);
    for compressor in ["blosclz", "lz4", "lz4hc", "zlib", "zstd"] {
        for shuffle in 0..3 {
            let name = format!("zarr/v2.zip:blosc-{compressor}-{shuffle}");
            let volume = Volume::open(&fixture(&name)).unwrap_or_else(|error| panic!("{error}"));
            assert_eq!((volume.dims(), volume.values()), (dims, (&expected).into()), "{name}");
        }
    }
    for compressor in ["lz4", "blosclz"] {
        let volume = Volume::open(&fixture(&format!("zarr/v2.zip:blosc-{compressor}-noise"))).unwrap();
        let noise: Vec<f32> = volume.values().iter().zip(&expected).map(|(value, plain)| value - plain).collect();
        assert!(noise.iter().all(|noise| [0.0, 5000.0, 10000.0, 15000.0].contains(noise)), "{compressor}");
        assert!(noise.iter().any(|&noise| noise > 0.0));
    }
}

#[test]
fn missing_chunks_have_the_fill_value() {
    let expected =
        |fill: f32| values().into_iter().enumerate().map(move |(i, value)| if i % 5 == 4 { fill } else { value });
    let volume = Volume::open(&fixture("zarr/v2.zip:missing")).unwrap();
    assert!(volume.values().iter().eq(expected(-7.0)), "{:?}", volume.values());
    let volume = Volume::open(&fixture("zarr/v2.zip:holes")).unwrap();
    assert_eq!(volume.holes(), 12);
    let store = open_store(&fixture("zarr/v2.zip:missing"), &ReadOptions::default()).unwrap();
    assert_eq!((store.fill(), store.levels().len(), store.levels()[0].chunk), (-7.0, 1, UVec3::new(4, 3, 2)));
    assert!(store.contains(0, UVec3::ZERO).unwrap() && !store.contains(0, UVec3::X).unwrap());
    assert_error(store.contains(0, UVec3::new(2, 0, 0)), "chunk", &["[2, 0, 0]", "[2, 2, 2]"]);
    let store = open_store(&fixture("zarr/v3.zip:sharded-missing"), &ReadOptions::default()).unwrap();
    let held = |x, y, z| store.contains(0, UVec3::new(x, y, z)).unwrap();
    assert!(held(0, 0, 0) && !held(1, 0, 0) && !held(0, 1, 0) && !held(2, 0, 0) && !held(0, 0, 1));
    let mut values = [0.0; 60];
    let read = store.read(0, UVec3::ZERO, DIMS, &mut values).unwrap();
    let expected = |i: usize| if i < 20 && i % 5 < 2 && i / 5 < 2 { (i % 5 + 10 * (i / 5)) as f32 } else { 9.0 };
    assert!(values.iter().enumerate().all(|(i, &value)| value == expected(i)), "{values:?}");
    assert!((1..1000).contains(&read), "{read}");
}

/// Writes a store of 8 chunks, of which it holds the first, with ones; the others are 7.
pub(crate) fn write_sparse(store: &Path) {
    let metadata = json!({
        "zarr_format": 3, "node_type": "array", "shape": [4, 4, 4], "data_type": "uint8", "fill_value": 7,
        "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": [2, 2, 2]}},
        "chunk_key_encoding": {"name": "default"}, "codecs": [{"name": "bytes"}],
    });
    fs::create_dir_all(store.join("c/0/0")).unwrap();
    fs::write(store.join("zarr.json"), metadata.to_string()).unwrap();
    fs::write(store.join("c/0/0/0"), [1; 8]).unwrap();
}

/// A store that is gone is no store without chunks, nor is one that lost a chunk.
#[test]
fn stores_that_are_removed_are_errors() {
    let folder = Folder::new();
    let store = folder.0.path().join("a.zarr");
    write_sparse(&store);
    let open = || open_store(&store, &ReadOptions::default()).unwrap();
    let [one, another] = [open(), open()];
    let read = |store: &dyn sheetsplat_volume::Store, from: UVec3| {
        let mut value = [0.0];
        store.read(0, from, UVec3::ONE, &mut value).map(|_| value[0])
    };
    assert_eq!([UVec3::ZERO, UVec3::splat(2)].map(|from| read(&*one, from).unwrap()), [1.0, 7.0]);
    fs::remove_file(store.join("c/0/0/0")).unwrap();
    let message = read(&*one, UVec3::ZERO).unwrap_err().to_string();
    assert!(message.contains("c/0/0/0: ") && message.contains("not found"), "{message}");
    assert_eq!(read(&*one, UVec3::splat(2)).unwrap(), 7.0);
    fs::remove_dir_all(&store).unwrap();
    let message = read(&*another, UVec3::splat(2)).unwrap_err().to_string();
    assert!(message.contains("a.zarr/c: No such file"), "{message}");
}

/// Version 2 may leave open what voxels are whose chunk is absent.
#[test]
fn chunks_without_a_fill_value_must_be_there() {
    let folder = Folder::new();
    let metadata = |fill: Value| {
        json!({
            "zarr_format": 2, "shape": [2, 2, 4], "chunks": [2, 2, 2], "dtype": "|u1", "fill_value": fill, "order": "C",
            "compressor": null, "filters": null, "dimension_separator": ".",
        })
        .to_string()
        .into_bytes()
    };
    let chunk = [1, 2, 3, 4, 5, 6, 7, 8];
    let null = folder.store(&[(".zarray", &metadata(Value::Null)), ("0.0.0", &chunk)]);
    assert_error(Volume::open(&null), "chunk", &["0.0.1", "found nothing", "a fill_value other than null"]);
    let store = open_store(&null, &ReadOptions::default()).unwrap();
    assert!(store.contains(0, UVec3::ZERO).unwrap());
    assert_error(store.contains(0, UVec3::X), "chunk", &["0.0.1"]);
    let mut values = [0.0; 8];
    assert_error(store.read(0, UVec3::X, UVec3::splat(2), &mut values), "chunk", &["0.0.1"]);
    store.read(0, UVec3::ZERO, UVec3::splat(2), &mut values).unwrap();
    assert_error(sample("null", &*store, u64::MAX), "chunk", &["0.0.1"]);
    let whole = folder.store(&[(".zarray", &metadata(Value::Null)), ("0.0.0", &chunk), ("0.0.1", &chunk)]);
    assert_eq!(Volume::open(&whole).unwrap().values().iter().sum::<f32>(), 72.0);
    let seven = folder.store(&[(".zarray", &metadata(json!(7))), ("0.0.0", &chunk)]);
    assert_eq!(Volume::open(&seven).unwrap().value(UVec3::new(3, 0, 0)), 7.0);
}

#[test]
fn images_of_ome_zarr() {
    for name in ["image-0.4.zarr", "image-0.5.zarr"] {
        let path = fixture(&format!("zarr/{name}"));
        let (volume, warnings) = warned(|| Volume::open(&path).unwrap());
        assert_warned(&warnings, "2 times: the first is read");
        assert_eq!((volume.dims(), volume.spacing(), volume.unit()), (DIMS, SPACING, Some("µm")));
        let encoding = volume.encoding().unwrap();
        assert_eq!((encoding.channels, encoding.times, encoding.sample_type), (2, 2, SampleType::U16));
        let with_time = |time: u32| Volume::open_with(&path, &ReadOptions::default().with_time(time)).unwrap();
        for time in 0..2 {
            let volume = with_time(time);
            for (number, channel) in volume.channels().enumerate() {
                let offset = 1000.0 * number as f32 + 10_000.0 * time as f32;
                assert!(channel.values().iter().zip(values()).all(|(found, value)| found == value + offset), "{name}");
            }
        }
        let names: Vec<_> = volume.channels().map(|channel| channel.channel_name().unwrap()).collect();
        assert_eq!(names, ["nuclei", "membrane"]);
        let display = volume.channel(1).unwrap().display().unwrap();
        assert_eq!((display.colors.as_slice(), display.window), (&[DVec3::Y][..], Some([1000.0, 1234.0])));
        let one = Volume::open_with(&path, &ReadOptions::default().with_channel(1).with_time(1)).unwrap();
        assert_eq!(
            (one.value(UVec3::new(4, 3, 2)), one.channel_name(), one.channel_count()),
            (11234.0, Some("membrane"), 1)
        );
        let refused = Volume::open_with(&path, &ReadOptions::default().with_channel(2));
        assert_error(refused, "channel", &["found 2", "0 to 1"]);
    }
}

#[test]
fn labels_of_ome_zarr() {
    let labels = Labels::open(&fixture("zarr/image-0.5.zarr/labels/cells")).unwrap();
    let expected: Vec<u16> = values().iter().map(|&value| value as u16 % 4).collect();
    assert_eq!((labels.dims, labels.values.as_ref()), (DIMS, expected.as_slice()));
    let names: Vec<_> = labels.names.iter().map(|(&label, name)| (label, name.as_str())).collect();
    assert_eq!(names, [(1, "cell"), (2, "vessel")]);
    let volume = Volume::open(&fixture("zarr/image-0.5.zarr/labels/cells")).unwrap();
    assert_eq!(volume.palette().unwrap(), [(1.0, DVec3::X), (2.0, DVec3::Y)]);
}

#[test]
fn images_of_another_writer() {
    for name in ["ngff.zarr", "ngff.ozx"] {
        let volume = open(&format!("zarr/{name}"));
        assert_eq!((volume.spacing(), volume.encoding().unwrap().sample_type), (SPACING, SampleType::U8));
    }
}

/// Boxes of a store are those of the whole, and what is read of it is counted.
#[test]
fn stores_are_read_by_boxes() {
    let options = ReadOptions::default().with_channel(1).with_time(1);
    let store = open_store(&fixture("zarr/image-0.5.zarr"), &options).unwrap();
    let [fine, coarse] = store.levels() else { panic!("{store:?}") };
    assert_eq!((fine.grid.dims, fine.grid.spacing, fine.chunk), (DIMS, SPACING, UVec3::new(5, 4, 2)));
    assert_eq!((coarse.grid.dims, coarse.grid.spacing), (UVec3::new(3, 2, 3), DVec3::new(1.0, 4.0, 3.0)));
    let (from, dims) = (UVec3::new(1, 2, 1), UVec3::new(3, 2, 2));
    let mut found = vec![0.0; 12];
    assert!(store.read(0, from, dims, &mut found).unwrap() > 0);
    let expected =
        (0..12).map(|i| 11_000 + 1 + i % 3 + 10 * (2 + i / 3 % 2) + 100 * (1 + i / 6)).map(|value| value as f32);
    assert_eq!(found, expected.collect::<Vec<_>>());
    let mut found = vec![0.0; 18];
    store.read(1, UVec3::ZERO, coarse.grid.dims, &mut found).unwrap();
    let expected = (0..18).map(|i| 11_000 + 2 * (i % 3) + 20 * (i / 3 % 2) + 100 * (i / 6)).map(|value| value as f32);
    assert_eq!(found, expected.collect::<Vec<_>>());
    assert_error(store.read(0, from, DIMS, &mut [0.0; 60]), "box", &["[5, 4, 3] voxels from [1, 2, 1]"]);
    assert_error(store.read(0, UVec3::ZERO, UVec3::ONE, &mut [0.0; 2]), "values", &["found 2", "1, one"]);
    assert_error(store.read(2, UVec3::ZERO, UVec3::ONE, &mut [0.0]), "level", &["found 2", "0 to 1"]);
    let refused = open_store(&fixture("zarr/image-0.5.zarr"), &ReadOptions::default());
    assert_error(refused, "channels", &["found 2", "0 to 1"]);
    // Whatever the metadata state, a sample has, too.
    let whole = Volume::open_with(&fixture("zarr/image-0.5.zarr"), &options).unwrap();
    let sampled = sample("store", &*store, u64::MAX).unwrap();
    assert!(sampled.values() == whole.values() && whole.display().is_some());
    assert_eq!((sampled.display(), sampled.channel_name()), (whole.display(), whole.channel_name()));
    assert_eq!((sampled.unit(), sampled.encoding()), (whole.unit(), whole.encoding()));
    // The identity does not depend on the place, but on what is read.
    let other = open_store(&fixture("zarr/image-0.5.zarr"), &options.clone().with_time(0)).unwrap();
    let again = open_store(&fixture("zarr/../zarr/image-0.5.zarr"), &options).unwrap();
    assert_eq!((store.identity().len(), store.identity()), (64, again.identity()));
    assert_ne!(store.identity(), other.identity());
}

/// The metadata of an uncompressed array of 16-bit integers in a single chunk.
fn array(shape: &[usize]) -> Value {
    json!({
        "zarr_format": 3, "node_type": "array", "shape": shape, "data_type": "uint16", "fill_value": 0,
        "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": shape}},
        "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}},
        "codecs": [{"name": "bytes", "configuration": {"endian": "little"}}],
    })
}

/// The metadata of an image with one level.
fn image(axes: &str) -> Value {
    let kind = |axis| match axis {
        't' => "time",
        'c' => "channel",
        _ => "space",
    };
    let scale = |axis| match axis {
        'x' => 0.5,
        'y' => 2.0,
        'z' => 3.0,
        _ => 1.0,
    };
    let scales: Vec<f64> = axes.chars().map(scale).collect();
    let axes: Vec<Value> = axes.chars().map(|axis| json!({"name": axis.to_string(), "type": kind(axis)})).collect();
    let datasets = json!([{"path": "0", "coordinateTransformations": [{"type": "scale", "scale": scales}]}]);
    let multiscale = json!({"axes": axes, "datasets": datasets});
    json!({"zarr_format": 3, "node_type": "group", "attributes": {"ome": {"version": "0.5", "multiscales": [multiscale]}}})
}

impl Folder {
    /// Writes an image or array and returns its path.
    fn store(&self, files: &[(&str, &[u8])]) -> std::path::PathBuf {
        let folder = self.0.path().join("store.zarr");
        _ = fs::remove_dir_all(&folder);
        for (name, bytes) in files {
            let path = folder.join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, bytes).unwrap();
        }
        folder
    }
}

/// All orders of some letters.
fn orders(letters: &str) -> Vec<String> {
    if letters.is_empty() {
        return vec![String::new()];
    }
    let after = |(at, letter): (usize, char)| {
        let rest = [&letters[..at], &letters[at + 1..]].concat();
        orders(&rest).into_iter().map(move |order| format!("{letter}{order}"))
    };
    letters.char_indices().flat_map(after).collect()
}

#[test]
fn axes_in_any_order() {
    let folder = Folder::new();
    let sizes = |axis| "tczyx".find(axis).map(|place| [2, 3, 3, 4, 5][place]).unwrap();
    let factor = |axis| "tczyx".find(axis).map(|place| [10_000, 1000, 100, 10, 1][place]).unwrap();
    let all: Vec<String> = ["tczyx", "czyx", "tzyx", "zyx", "yx"].iter().flat_map(|letters| orders(letters)).collect();
    assert_eq!(all.len(), 120 + 24 + 24 + 6 + 2);
    for axes in all {
        let shape: Vec<usize> = axes.chars().map(sizes).collect();
        let sample = |index: usize| {
            let (mut rest, mut value) = (index, 0);
            for (axis, size) in axes.chars().rev().zip(shape.iter().rev()) {
                value += factor(axis) * (rest % size) as u16;
                rest /= size;
            }
            value
        };
        let samples: Vec<u8> = (0..shape.iter().product()).flat_map(|index| sample(index).to_le_bytes()).collect();
        let key = format!("0/c/{}", vec!["0"; shape.len()].join("/"));
        let (group, array) = (image(&axes).to_string(), array(&shape).to_string());
        let files = [("zarr.json", group.as_bytes()), ("0/zarr.json", array.as_bytes()), (&key, &samples)];
        let path = folder.store(&files);
        let (time, channels) = (u32::from(axes.contains('t')), if axes.contains('c') { 3 } else { 1 });
        let volume = Volume::open_with(&path, &ReadOptions::default().with_time(time)).unwrap();
        let count = if axes.contains('z') { 60 } else { 20 };
        for (channel, number) in volume.channels().zip(0_u16..) {
            let offset = f32::from(number) * 1000.0 + time as f32 * 10_000.0;
            let expected: Vec<f32> = values()[..count].iter().map(|value| value + offset).collect();
            assert_eq!(channel.values(), expected, "{axes}, channel {number}");
        }
        assert_eq!(volume.channels().count(), channels, "{axes}");
        let spacing = if axes.contains('z') { SPACING } else { SPACING.with_z(1.0) };
        assert_eq!(volume.spacing(), spacing, "{axes}");
    }
}

/// A level lies where its translation says, from the finest one's centre, whose unit is that of all lengths.
#[test]
fn levels_of_an_image() {
    let path = fixture("zarr/ngff.zarr");
    let at = |level: u32| Volume::open_with(&path, &ReadOptions::default().with_level(level));
    let [fine, coarse] = [0, 1].map(|level| at(level).unwrap());
    assert_eq!((fine.level(), fine.levels()), (0, &[DIMS, UVec3::new(2, 2, 1)][..]));
    assert_eq!((coarse.level(), coarse.levels(), coarse.dims()), (1, fine.levels(), UVec3::new(2, 2, 1)));
    assert_eq!((coarse.spacing(), coarse.grid().unit(), fine.grid().unit()), (2.0 * SPACING, 0.5, 0.5));
    // x: (10.25 + 0.5) - (10 + 1), y: (-19.5 + 2) - (-20.5 + 3), z: 31.5 - (30 + 3).
    assert_eq!((coarse.grid().place(), fine.grid().place()), (DVec3::new(-0.25, 0.0, -1.5), DVec3::ZERO));
    let wider = coarse.with_spacing("test", SPACING * 2.0).unwrap();
    assert_eq!((wider.spacing(), wider.grid().place()), (4.0 * SPACING, DVec3::new(-0.5, 0.0, -3.0)));
    assert_error(at(2), "level", &["found 2", "0 to 1"]);
    let other = Volume::open_with(&fixture("c.npy"), &ReadOptions::default().with_level(1));
    assert_error(other, "level", &["found 1", "0, the only one"]);
    let small = Volume::open_with(&path, &ReadOptions::default().with_memory(100));
    assert_error(small, "level", &["0: 5 × 4 × 3, 220 bytes; 1: 2 × 2 × 1, 16 bytes", "level 1 or a coarser one"]);
}

/// The metadata with a value replaced.
fn with(mut metadata: Value, pointer: &str, value: Value) -> Vec<u8> {
    *metadata.pointer_mut(pointer).unwrap() = value;
    metadata.to_string().into_bytes()
}

#[test]
fn damaged_stores_are_refused() {
    let folder = Folder::new();
    let (group, plain) = (image("zyx").to_string().into_bytes(), array(&[3, 4, 5]).to_string().into_bytes());
    let samples: Vec<u8> = values().iter().flat_map(|&value| (value as u16).to_le_bytes()).collect();
    let open = |group: &[u8], array: &[u8], samples: &[u8]| {
        let path = folder.store(&[("zarr.json", group), ("0/zarr.json", array), ("0/c/0/0/0", samples)]);
        Volume::open_with(&path, &ReadOptions::default().with_memory(1 << 24))
    };
    assert_eq!(open(&group, &plain, &samples).unwrap().values(), values());
    let multiscale = "/attributes/ome/multiscales/0";
    let dataset = format!("{multiscale}/datasets/0");
    for (pointer, value, field, words) in [
        ("/axes", json!([]), "axes", &["x and y among them"][..]),
        ("/axes/0/name", json!("x"), "axes", &["different axes"]),
        ("/axes/0/type", json!("frequency"), "axes[0]", &["frequency"]),
        ("/axes/0", json!(7), "axes[0]", &["found \"7\""]),
        ("/datasets", json!([]), "datasets", &["at least one"]),
        ("/datasets/0/path", json!("../0"), "datasets[0].path", &["../0", "without . and .."]),
        ("/datasets/0/path", json!("/etc"), "datasets[0].path", &["/etc"]),
        ("/datasets/0/path", json!("1"), "array", &["nothing", ".zarray"]),
        ("/datasets/0/coordinateTransformations/0/scale", json!([1, 2]), "scale", &["3 numbers"]),
        ("/datasets/0/coordinateTransformations/0/scale", json!([1, 2, 0]), "scale", &["not above 0"]),
        ("/datasets/0/coordinateTransformations/0/scale", json!([1, 1, 1e9]), "spacing", &["none above 10000"]),
        ("/datasets/0/coordinateTransformations/0/type", json!("affine"), "type", &["affine", "translation"]),
    ] {
        let damaged = with(image("zyx"), &format!("{multiscale}{pointer}"), value);
        let message = open(&damaged, &plain, &samples).unwrap_err().to_string();
        assert!(
            message.contains(&format!("{field}: found")) && words.iter().all(|word| message.contains(word)),
            "{message}"
        );
    }
    let scaled = |count: usize| {
        with(
            image("zyx"),
            &dataset,
            json!({"path": "0", "coordinateTransformations": vec![json!({"type": "identity"}); count]}),
        )
    };
    assert!(open(&scaled(9), &plain, &samples).is_ok());
    for (pointer, value, field, words) in [
        ("/shape", json!([3, 4]), "chunk_grid.configuration.chunk_shape", &["2 positive sizes"][..]),
        ("/shape", json!([3, 4, 0]), "shape", &["3 × 4 × 0", "positive"]),
        ("/shape", json!([3, 4, u64::MAX]), "shape", &["at most 4294967295 each"]),
        ("/shape", json!([60_000, 60_000, 2]), "chunks", &["20000 × 15000 × 1", "at most 67108864"]),
        ("/shape", json!([3000, 4000, 5]), "data", &["memory limit of 16777216"]),
        ("/shape", json!("all"), "shape", &["all", "a list of sizes"]),
        ("/data_type", json!("complex64"), "data_type", &["complex64", "uint16"]),
        ("/data_type", json!("int17"), "data_type", &["int17"]),
        ("/fill_value", json!("none"), "fill_value", &["none", "a whole number of the type uint16"]),
        (
            "/chunk_grid/configuration/chunk_shape",
            json!([1 << 20, 1 << 20, 1 << 20]),
            "chunks",
            &["at most 4294967295 values"],
        ),
        ("/chunk_grid/configuration/chunk_shape", json!([1 << 10, 1 << 10, 1 << 10]), "chunks", &["memory limit"]),
        (
            "/chunk_grid/configuration/chunk_shape",
            json!([0, 4, 5]),
            "chunk_grid.configuration.chunk_shape",
            &["positive"],
        ),
        ("/chunk_grid/name", json!("spiral"), "chunk_grid.name", &["spiral", "regular"]),
        ("/codecs", json!([]), "codecs", &["one of bytes and sharding_indexed"]),
        ("/codecs/0/name", json!("jpeg"), "codecs[0].name", &["jpeg", "blosc, bz2, gzip, shuffle, zlib, zstd"]),
    ] {
        let damaged = with(array(&[3, 4, 5]), pointer, value);
        let message = open(&group, &damaged, &samples).unwrap_err().to_string();
        let is_about = message.contains(&format!(": {field}: found"));
        assert!(is_about && words.iter().all(|word| message.contains(word)), "{pointer}: {message}");
    }
    for cut in [0, 1, 119] {
        assert_error(open(&group, &plain, &samples[..cut]), "chunk", &["0/c/0/0/0", "chunk from [0, 0, 0]"]);
    }
    assert_error(open(&group, &plain, &vec![0; 1 << 20]), "chunk", &["is 1048576, expected at most 120", "0/c/0/0/0"]);
    // Streams that would expand to more than the chunk holds.
    for (codec, code) in [
        ("gzip", gzip(&vec![7; 1 << 20])),
        ("zstd", [&[0x28, 0xb5, 0x2f, 0xfd, 0xe0][..], &[0xff; 8], &[1, 0, 0]].concat()),
        ("blosc", [&[2, 1, 0x21, 2][..], &(1_u32 << 31).to_le_bytes(), &[0, 0, 1, 0], &[20, 0, 0, 0]].concat()),
    ] {
        let codecs =
            json!([{"name": "bytes", "configuration": {"endian": "little"}}, {"name": codec, "configuration": {}}]);
        let damaged = with(array(&[3, 4, 5]), "/codecs", codecs);
        assert_error(open(&group, &damaged, &code), "chunk", &["0/c/0/0/0"]);
    }
    let shards = json!([{"name": "sharding_indexed", "configuration": {
        "chunk_shape": [3, 4, 5], "codecs": [{"name": "bytes", "configuration": {"endian": "little"}}],
        "index_codecs": [{"name": "bytes", "configuration": {"endian": "little"}}], "index_location": "start"}}]);
    let sharded = with(array(&[3, 4, 5]), "/codecs", shards);
    let shard = |from: u64, bytes: u64| [&from.to_le_bytes()[..], &bytes.to_le_bytes(), &samples].concat();
    assert_eq!(open(&group, &sharded, &shard(16, 120)).unwrap().values(), values());
    assert!(open(&group, &sharded, &shard(u64::MAX, u64::MAX)).unwrap().values().iter().all(|value| value == 0.0));
    for (from, bytes) in [(17, 120), (u64::MAX, 2), (16, 119), (1 << 40, 120)] {
        assert_error(open(&group, &sharded, &shard(from, bytes)), "chunk", &["0/c/0/0/0"]);
    }
    assert_error(open(&group, &sharded, &[0; 15]), "chunk", &["15 bytes, whose index alone takes 16"]);
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    use std::io::Write;
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

#[test]
fn files_stay_within_the_folder() {
    let folder = Folder::new();
    let (group, plain) = (image("zyx").to_string().into_bytes(), array(&[3, 4, 5]).to_string().into_bytes());
    let path = folder.store(&[("zarr.json", &group), ("0/zarr.json", &plain)]);
    let options = ReadOptions::default().confined_to(folder.0.path());
    // Without chunks every value is the fill value.
    assert!(Volume::open_with(&path, &options).unwrap().values().iter().all(|value| value == 0.0));
    #[cfg(unix)]
    for target in ["/etc", "/no/such/folder"] {
        _ = fs::remove_file(path.join("0/c"));
        std::os::unix::fs::symlink(target, path.join("0/c")).unwrap();
        let message = Volume::open_with(&path, &options).unwrap_err().to_string();
        assert!(message.contains("a path that leads elsewhere"), "{message}");
    }
}
