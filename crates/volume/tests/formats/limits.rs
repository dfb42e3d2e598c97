//! Limits on memory.

use sheetsplat_volume::ReadOptions;

use crate::*;

/// The limit is what 60 values take: as many bytes as the samples have if these are 1 or 2 and not rescaled, else 4.
#[test]
fn memory_is_limited_in_every_format() {
    let read = |name: &str, bytes: u64| Volume::open_with(&fixture(name), &ReadOptions::default().with_memory(bytes));
    // Each format's file, the bytes of a value, and the memory that it needs besides the values.
    for (name, bytes, besides) in [
        ("itk.nrrd", 4, 0),
        ("bzip2.nrrd", 2, 0),
        ("text.nrrd", 4, 0),
        ("hex.nrrd", 2, 0),
        ("list.nhdr", 2, 0),
        ("local.mha", 4, 0),
        ("zlib.mha", 4, 0),
        ("sform.nii", 4, 0),
        ("itk.nii.gz", 4, 0),
        ("pair.hdr", 2, 0),
        ("c.npy", 1, 0),
        ("one.npz", 4, 0),
        // For reordering its axes.
        ("fortran-big.npy", 2, 120),
        // For a page.
        ("plain.tif", 4, 80),
        ("tiled.tif", 4, 80),
        ("slices", 2, 40),
        ("imagej-large.tif", 4, 0),
        ("series", 4, 0),
        ("frames.dcm", 4, 0),
        ("rle.dcm", 4, 0),
        ("text.vti", 2, 0),
        ("appended.vti", 1, 0),
        // For a block.
        ("appended-lz4.vti", 4, 64),
        ("text.vtk", 4, 0),
        ("binary.vtk", 2, 0),
    ] {
        let needed = 60 * bytes + besides;
        assert!(read(name, needed).is_ok(), "{name}: {:?}", read(name, needed).err());
        let message = read(name, needed - 1).expect_err(name).to_string();
        assert!(message.contains(": found ") && message.contains("bytes of memory, allowed: "), "{message}");
        assert!(message.contains(&format!("the memory limit of {} bytes", needed - 1)), "{message}");
    }
    let exact = read("c.npy", 59).unwrap_err().to_string();
    let expected = "c.npy: data: found 5 × 4 × 3 voxels, which take 60 bytes of memory, allowed: at most the memory limit of 59 bytes";
    assert!(exact.ends_with(expected), "{exact}");
}
