//! Uncompressed files that are read by boxes.

use std::sync::Arc;

use sheetsplat_volume::{RawLayout, ReadOptions, SampleType, Store, Texel, open_raw_store, open_store, sample};

use crate::*;

/// Reads every box of a store, each of which must hold the volume's values.
#[track_caller]
pub(crate) fn assert_holds(store: &Arc<dyn Store>, volume: &Volume, name: &str) {
    let [level] = store.levels() else { panic!("{name}: {store:?}") };
    assert_eq!((level.grid.dims, level.grid.spacing), (volume.dims(), volume.spacing()), "{name}");
    assert!(store.contains(0, UVec3::ZERO).unwrap(), "{name}");
    let [nx, ny, nz] = volume.dims().to_array();
    for (x, y, z) in (0..nx).flat_map(|x| (0..ny).flat_map(move |y| (0..nz).map(move |z| (x, y, z)))) {
        let from = UVec3::new(x, y, z);
        let dims = (volume.dims() - from).min(UVec3::new(1 + y, 1 + z, 2));
        let mut found = vec![0.0; dims.element_product() as usize];
        let read = store.read(0, from, dims, &mut found).unwrap();
        assert!(read >= dims.element_product().into(), "{name}: {read}");
        let at = |index: u32| from + UVec3::new(index % dims.x, index / dims.x % dims.y, index / dims.x / dims.y);
        let is_same = |(index, value): (u32, &f32)| *value == volume.value(at(index));
        assert!((0..).zip(&found).all(is_same), "{name}, {dims} from {from}: {found:?}");
        let Some(own) = volume.colors() else { continue };
        let mut colors = vec![Texel::default(); found.len()];
        found.fill(0.0);
        assert_eq!(store.read_colors(0, from, dims, &mut found, &mut colors).unwrap(), read, "{name}");
        assert!((0..).zip(&found).all(is_same), "{name}, {dims} from {from}: {found:?}");
        let color = |index: u32| own[volume.grid().index_of(at(index)) as usize];
        assert!((0..).zip(&colors).all(|(index, &found)| found == color(index)), "{name}, {dims} from {from}");
    }
    assert_eq!(store.has_colors(), volume.colors().is_some(), "{name}");
    // All of them, with whatever else the file states.
    assert!(sample(name, &**store, u64::MAX).unwrap() == *volume, "{name}: {:?}", store.facts());
}

#[test]
fn boxes_of_uncompressed_files() {
    for name in ["sform.nii", "nifti2-big.nii", "pair.hdr", "local.mha", "flipped.mhd", "turned/las.nii", "c.npy"] {
        let store = open_store(&fixture(name), &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}"));
        assert_holds(&store, &Volume::open(&fixture(name)).unwrap(), name);
    }
    for (name, channel, time) in
        [("both.npy", 1, 2), ("both.npy", 0, 0), ("itk.mha", 1, 0), ("times.nii", 0, 2), ("channels.npy", 1, 0)]
    {
        let (path, options) =
            (fixture("channels").join(name), ReadOptions::default().with_channel(channel).with_time(time));
        let store = open_store(&path, &options).unwrap_or_else(|error| panic!("{error}"));
        assert_holds(&store, &Volume::open_with(&path, &options).unwrap(), name);
    }
    let layout = RawLayout { dims: DIMS, sample_type: SampleType::F32, big_endian: true, offset: 7 };
    let store = open_raw_store(&fixture("float32-big-7.raw"), &layout, &ReadOptions::default()).unwrap();
    assert_holds(&store, &Volume::open_raw(&fixture("float32-big-7.raw"), &layout).unwrap(), "raw");
}

/// Components of colours lie side by side, or one volume after the other.
#[test]
fn boxes_of_files_of_colors() {
    let folder = Folder::new();
    let nrrd = |name: &str, sizes: &str, kinds: &str, samples: u16| {
        let header = format!("NRRD0004\ntype: uint16\ndimension: 4\nsizes: {sizes}\nkinds: {kinds}\n");
        let code = (0..samples).flat_map(|at| at.wrapping_mul(40_503).to_be_bytes());
        let bytes: Vec<u8> =
            format!("{header}encoding: raw\nendian: big\n\n").into_bytes().into_iter().chain(code).collect();
        let path = folder.0.path().join(name);
        fs::write(&path, bytes).unwrap();
        path
    };
    let made = [
        nrrd("rgb.nrrd", "3 5 4 6", "RGB-color domain domain domain", 360),
        nrrd("planar.nrrd", "5 4 6 3", "domain domain domain RGB-color", 360),
        nrrd("rgba.nrrd", "4 5 4 6", "RGBA-color domain domain domain", 480),
        nrrd("planar-rgba.nrrd", "5 4 6 4", "domain domain domain RGBA-color", 480),
    ];
    let of_others = ["rgb.nii", "rgb.npy", "rgba.npy"].map(|name| fixture("colors").join(name));
    for path in made.into_iter().chain(of_others) {
        let store = open_store(&path, &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}"));
        assert_holds(&store, &Volume::open(&path).unwrap(), &path.display().to_string());
    }
    let times = fixture("colors").join("times.nii");
    let at = |time: u32| ReadOptions::default().with_time(time);
    let store = |time: u32| open_store(&times, &at(time)).unwrap();
    assert_holds(&store(1), &Volume::open_with(&times, &at(1)).unwrap(), "times.nii");
    assert_ne!(store(0).identity(), store(1).identity());
}

/// Rows that lie close together in a file are read at once, up to a length that a plane here exceeds, and others one by one.
#[test]
fn rows_near_and_far_apart_are_read() {
    let folder = Folder::new();
    let path = folder.0.path().join("wide.raw");
    let dims = UVec3::new(1500, 400, 3);
    let sample = |index: u32| (index.wrapping_mul(40_503) >> 3) as u16;
    let bytes: Vec<u8> = (0..dims.element_product()).flat_map(|index| sample(index).to_be_bytes()).collect();
    fs::write(&path, &bytes).unwrap();
    let layout = RawLayout { dims, sample_type: SampleType::U16, big_endian: true, offset: 0 };
    let store = || open_raw_store(&path, &layout, &ReadOptions::default()).unwrap();
    let read = |from: UVec3, box_dims: UVec3| {
        let mut found = vec![0.0; box_dims.element_product() as usize];
        store().read(0, from, box_dims, &mut found).map(|_| found).map_err(|error| error.to_string())
    };
    for (from, box_dims) in [
        (UVec3::new(3, 5, 1), UVec3::new(2, 40, 2)),
        (UVec3::ZERO, UVec3::new(64, 400, 3)),
        (UVec3::new(700, 1, 0), UVec3::new(800, 399, 3)),
        (UVec3::ZERO, dims),
    ] {
        let at = |index: u32| {
            from + UVec3::new(index % box_dims.x, index / box_dims.x % box_dims.y, index / box_dims.x / box_dims.y)
        };
        let value = |voxel: UVec3| f32::from(sample(voxel.x + dims.x * (voxel.y + dims.y * voxel.z)));
        let expected = (0..box_dims.element_product()).map(|index| value(at(index))).collect();
        assert!(read(from, box_dims) == Ok(expected), "{box_dims} from {from}");
    }
    // Wider rows, whose box's rows lie further apart, of a file that was cut off after the first two planes.
    let layout = RawLayout { dims: UVec3::new(6000, 100, 3), ..layout };
    let store = open_raw_store(&path, &layout, &ReadOptions::default()).unwrap();
    let mut found = [0.0; 3 * 100 * 2];
    store.read(0, UVec3::new(5, 0, 0), UVec3::new(3, 100, 2), &mut found).unwrap();
    for (number, row) in (0..).zip(found.chunks_exact(3)) {
        let first = 5 + 6000 * (number % 100) + 6000 * 100 * (number / 100);
        assert_eq!(row, [0, 1, 2].map(|x| f32::from(sample(first + x))), "row {number}");
    }
    fs::File::options().write(true).open(&path).unwrap().set_len(2 * (6000 * 100 * 2 + 7)).unwrap();
    let mut found = [0.0; 3 * 100 * 3];
    let error = store.read(0, UVec3::new(5, 0, 0), UVec3::new(3, 100, 3), &mut found).unwrap_err().to_string();
    assert!(error.contains("found the end of the file before voxel [5, 0, 2], allowed: the whole file"), "{error}");
}

/// The identity is that of the samples, wherever the file is.
#[test]
fn files_of_other_samples_have_other_identities() {
    let folder = Folder::new();
    let bytes = fs::read(fixture("c.npy")).unwrap();
    let identity = |name: &str, bytes: &[u8]| {
        folder.open(name, bytes).unwrap();
        open_store(&folder.0.path().join(name), &ReadOptions::default()).unwrap().identity()
    };
    let mut other = bytes.clone();
    *other.last_mut().unwrap() ^= 1;
    assert_eq!(identity("a.npy", &bytes), identity("b.npy", &bytes));
    assert_ne!(identity("a.npy", &bytes), identity("c.npy", &other));
}

#[test]
fn what_is_not_read_by_boxes_is_refused() {
    let refusal = |name: &str| open_store(&fixture(name), &ReadOptions::default()).unwrap_err().to_string();
    for (name, words) in [
        ("fortran-big.npy", "found z fastest"),
        ("bzip2.nrrd", "found a compressed stream"),
        ("itk.nii.gz", "found a compressed stream"),
        ("zlib.mha", "found a compressed stream"),
        ("sheared.nii", "axes at right angles"),
        ("complex.nii", "found 0 places"),
        ("list.mhd", "found 3 places"),
        ("ome.tif", "allowed: one that is read by boxes: Zarr, and uncompressed NRRD"),
        ("channels/channels.npy", "channels: found 2"),
    ] {
        let message = refusal(name);
        assert!(message.contains(words), "{message}");
    }
}
