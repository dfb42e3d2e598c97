//! NPZ archives, as NumPy writes them.

use sheetsplat_volume::{Encoding, Labels, SampleType};

use crate::*;

fn named(archive: &str, array: &str) -> PathBuf {
    fixture(&format!("{archive}:{array}"))
}

#[test]
fn one_array_or_the_one_that_is_named() {
    assert_eq!(
        open("one.npz").encoding(),
        Some(Encoding { format: "NPZ", sample_type: SampleType::F32, channels: 1, times: 1 })
    );
    for path in [named("one.npz", "values"), named("two.npz", "values")] {
        assert_eq!(Volume::open(&path).unwrap().values(), values(), "{}", path.display());
    }
    let labels = Labels::open(&named("two.npz", "values")).unwrap();
    assert!(labels.values.iter().map(|&label| f32::from(label)).eq(values()));
}

#[test]
fn wrong_names() {
    assert_refused(
        Volume::open(&fixture("two.npz")),
        "two.npz",
        "arrays",
        "2 arrays: \"zeros\", \"values\"",
        "file.npz:name",
    );
    let nameless = Volume::open(&named("two.npz", "value"));
    assert_refused(nameless, "two.npz:value", "arrays", "\"zeros\", \"values\"", "an array called \"value\"");
    assert_refused(Volume::open(&named("two.npz", "zeros")), "two.npz:zeros", "shape", "(7,)", "three dimensions");
    let missing = Volume::open(&named("three.npz", "values"));
    assert!(matches!(missing, Err(VolumeError::Io { path, .. }) if path.ends_with("three.npz")));
    let other = Folder::new().open("a.npz", &replaced("one.npz", "values.npy", "values.txt"));
    // The directory is at the end, so the replaced bytes before it do not count.
    assert_eq!(other.unwrap().values(), values());
    let text = fs::read(fixture("one.npz")).unwrap();
    let at = text.windows(10).rposition(|window| window == b"values.npy").unwrap();
    let other = Folder::new().open("a.npz", &patched("one.npz", at, b"values.txt"));
    assert_refused(other, "a.npz", "arrays", "0 arrays", "one array");
}

/// A file with some bytes of its last member's directory entry replaced, from this offset on.
fn entry(name: &str, at: usize, bytes: &[u8]) -> Vec<u8> {
    let whole = fs::read(fixture(name)).unwrap();
    let entry = whole.windows(4).rposition(|window| window == b"PK\x01\x02").unwrap();
    patched(name, entry + at, bytes)
}

#[test]
fn damaged_archives() {
    let folder = Folder::new();
    let refused = |bytes: &[u8], field: &str, found: &str, allowed: &str| {
        assert_refused(folder.open("a.npz", bytes), "a.npz", field, found, allowed);
    };
    let values = "values.npy";
    refused(&entry("one.npz", 8, &[1]), values, "an encrypted file", "not encrypted");
    refused(&entry("one.npz", 10, &[12]), values, "compression 12", "stored (0) or deflated (8)");
    refused(&entry("one.npz", 16, &[1, 2, 3, 4]), "data", "a checksum that differs from", "undamaged");
    refused(&entry("one.npz", 42, &[1]), "archive", "to other bytes", "a whole ZIP archive");
    refused(&entry("one.npz", 42, &[0xff; 4]), "archive", "out of the file", "a whole ZIP archive");
    refused(&entry("one.npz", 20, &[0, 0, 1, 0]), "archive", "out of the file", "a whole ZIP archive");
    let whole = fs::read(fixture("one.npz")).unwrap();
    for length in 4..whole.len() {
        refused(&whole[..length], "archive", "no end of a directory", "a whole ZIP archive");
    }
    // A comment may follow.
    assert_eq!(folder.open("a.npz", &[&whole[..], b"comment"].concat()).unwrap().dims(), DIMS);
}
