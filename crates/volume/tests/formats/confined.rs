//! Limits on where files may be, with the paths and links of Unix.

use std::os::unix::fs::symlink;

use sheetsplat_volume::{Labels, RawLayout, ReadOptions, SampleType};

use crate::*;

/// A folder `in` with a volume, and files outside it.
fn folders() -> (Folder, PathBuf, ReadOptions) {
    let folder = Folder::new();
    let inside = folder.0.path().join("in");
    fs::create_dir(&inside).unwrap();
    for name in ["c.npy", "list.mhd", "list.nhdr", "part0.bin", "part1.bin", "part2.bin", "pair.hdr", "pair.img"] {
        fs::copy(fixture(name), inside.join(name)).unwrap();
        fs::copy(fixture(name), folder.0.path().join(name)).unwrap();
    }
    let options = ReadOptions::default().confined_to(&inside);
    (folder, inside, options)
}

/// Asserts that the message names the file and the folder.
#[track_caller]
fn assert_outside<T>(result: Result<T, VolumeError>, file: &str) {
    let message = result.err().expect("an error").to_string();
    let rest = message.split_once(file).map(|(_, rest)| rest);
    assert!(
        rest.is_some_and(|rest| rest.starts_with(": file: found a path that leads elsewhere, allowed: ")),
        "{message}"
    );
    assert!(message.contains("/in, to which reading is confined"), "{message}");
}

#[test]
fn files_are_confined() {
    let (folder, inside, options) = folders();
    let open = |name: &str| Volume::open_with(&inside.join(name), &options);
    for name in ["c.npy", "list.mhd", "list.nhdr", "pair.hdr", "pair.img", "../in/c.npy"] {
        assert_eq!(open(name).unwrap().values(), values(), "{name}");
    }
    assert_outside(open("../c.npy"), "c.npy");
    assert_outside(Labels::open_with(&inside.join("../c.npy"), &options), "c.npy");
    let layout = RawLayout { dims: DIMS, sample_type: SampleType::U8, big_endian: false, offset: 80 };
    let raw = |name: &str| Volume::open_raw_with(&inside.join(name), &layout, &options);
    assert!(raw("../c.npy").is_err_and(|error| error.to_string().contains("leads elsewhere")));
    assert_outside(raw("../part0.bin"), "part0.bin");
    assert_outside(Volume::open_with(folder.0.path(), &options), folder.0.path().to_str().unwrap());
    // The error does not tell whether the file exists.
    assert_outside(open("../missing.npy"), "missing.npy");
    assert!(matches!(open("missing.npy"), Err(VolumeError::Io { .. })));
    // A folder whose name merely begins like the other's.
    fs::create_dir(folder.0.path().join("inner")).unwrap();
    fs::copy(fixture("c.npy"), folder.0.path().join("inner/c.npy")).unwrap();
    assert_outside(open("../inner/c.npy"), "c.npy");
    let nowhere = ReadOptions::default().confined_to(folder.0.path().join("nowhere"));
    let missing = Volume::open_with(&inside.join("c.npy"), &nowhere);
    assert!(matches!(missing, Err(VolumeError::Io { path, .. }) if path.ends_with("nowhere")));
}

#[test]
fn links_are_followed() {
    let (folder, inside, options) = folders();
    symlink(inside.join("c.npy"), inside.join("good.npy")).unwrap();
    symlink(folder.0.path().join("c.npy"), inside.join("bad.npy")).unwrap();
    symlink(folder.0.path().join("missing.npy"), inside.join("dangling.npy")).unwrap();
    symlink(folder.0.path(), inside.join("up")).unwrap();
    symlink(&inside, folder.0.path().join("link")).unwrap();
    let open = |path: PathBuf| Volume::open_with(&path, &options);
    assert_eq!(open(inside.join("good.npy")).unwrap().values(), values());
    for name in ["bad.npy", "dangling.npy", "up/c.npy"] {
        assert_outside(open(inside.join(name)), name);
    }
    assert_eq!(open(folder.0.path().join("link/c.npy")).unwrap().values(), values());
    // The folder itself may be named by a link.
    let linked = ReadOptions::default().confined_to(folder.0.path().join("link"));
    assert_eq!(Volume::open_with(&inside.join("c.npy"), &linked).unwrap().values(), values());
}

#[test]
fn files_named_by_headers_are_confined() {
    let (folder, inside, options) = folders();
    for (header, text, instead) in [
        ("list.mhd", "part1.bin", "../part1.bin"),
        ("list.nhdr", "part1.bin", "../part1.bin"),
        ("list.mhd", "part1.bin", "/etc/passwd"),
    ] {
        fs::write(inside.join(header), replaced(header, text, instead)).unwrap();
        assert_outside(Volume::open_with(&inside.join(header), &options), instead);
    }
    fs::write(inside.join("list.mhd"), replaced("list.mhd", "part1.bin", "../part1.bin")).unwrap();
    assert_eq!(Volume::open(&inside.join("list.mhd")).unwrap().values(), values(), "as ever without the option");
    fs::write(inside.join("one.mhd"), replaced("flipped.mhd", "flipped.raw", "../part1.bin")).unwrap();
    assert_outside(Volume::open_with(&inside.join("one.mhd"), &options), "part1.bin");
    fs::remove_file(inside.join("pair.img")).unwrap();
    symlink(folder.0.path().join("pair.img"), inside.join("pair.img")).unwrap();
    assert_outside(Volume::open_with(&inside.join("pair.hdr"), &options), "pair.img");
    // A slice in a folder of slices.
    let slices = inside.join("slices");
    fs::create_dir(&slices).unwrap();
    for name in ["z8.tif", "z9.tif"] {
        fs::copy(fixture("slices").join(name), slices.join(name)).unwrap();
    }
    assert_eq!(Volume::open_with(&slices, &options).unwrap().values(), &values()[..40]);
    symlink(fixture("slices/z10.tif"), slices.join("z10.tif")).unwrap();
    assert_outside(Volume::open_with(&slices, &options), "z10.tif");
}
