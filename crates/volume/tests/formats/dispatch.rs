//! Determination of a file's format.

use crate::*;

#[test]
fn unknown_formats_list_the_known_ones() {
    let folder = Folder::new();
    assert_refused(folder.open("volume.jpg", b"a picture"), "volume.jpg", "format", "\".jpg\"", "NRRD (.nrrd, .nhdr)");
    assert_refused(folder.open("volume", b""), "volume", "format", "none", "NRRD (.nrrd, .nhdr)");
}

#[test]
fn first_bytes_decide() {
    let folder = Folder::new();
    let nrrd = fs::read(fixture("itk.nrrd")).unwrap();
    for name in ["volume.nii", "volume.img", "volume", "volume.jpg", "VOLUME.NRRD"] {
        assert_eq!(folder.open(name, &nrrd).unwrap().values(), values(), "{name}");
    }
}

/// ITK writes NRRD in its own coordinates, LPS.
#[test]
fn nrrd_of_itk() {
    let lps = DVec3::new(-1.0, -1.0, 1.0);
    assert_lies(&open("itk.nrrd"), DMat3::from_diagonal(lps) * rotation(), lps * ORIGIN);
}
