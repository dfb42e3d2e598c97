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

/// Files whose beginnings, or whose texts, are also those of another format.
#[test]
fn weaker_signatures_yield() {
    let folder = Folder::new();
    // `DICM` decides, whatever its preamble holds; without its first element after it, it is a text.
    for preamble in [&b"II*\0"[..], b"MM\0*", b"NRRD0004\n", b"\x93NUMPY", b"PK\x03\x04", b"# vtk DataFile Version"] {
        let mut bytes = fs::read(fixture("frames.dcm")).unwrap();
        bytes[..preamble.len()].copy_from_slice(preamble);
        assert_eq!(folder.open("volume", &bytes).unwrap().encoding().unwrap().format, "DICOM", "{preamble:?}");
    }
    let nrrd = fs::read(fixture("itk.nrrd")).unwrap();
    let (magic, rest) = nrrd.split_at(9);
    let comment = [&b"# "[..], &b" ".repeat(117), b"DICM <VTKFile\n"].concat();
    assert_eq!(folder.open("volume", &[magic, &comment, rest].concat()).unwrap().values(), values());
    // NIfTI's magic among the samples of an array, and VTI's element in the title of a legacy file.
    let header = "{'descr': '|u1', 'fortran_order': False, 'shape': (2, 2, 100), }";
    let mut npy = [&b"\x93NUMPY\x01\0\x76\0"[..], header.as_bytes(), &b" ".repeat(118 - header.len())].concat();
    npy.resize(128 + 400, 7);
    npy[344..348].copy_from_slice(b"n+1\0");
    assert_eq!(folder.open("volume", &npy).unwrap().encoding().unwrap().format, "NPY");
    let legacy = b"# vtk DataFile Version 3.0\nfrom <VTKFile>\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 2 2 2\nORIGIN 0 0 0\nSPACING 1 1 1\n\
        POINT_DATA 8\nSCALARS a int\nLOOKUP_TABLE default\n0 1 2 3 4 5 6 7\n";
    assert_eq!(folder.open("volume", legacy).unwrap().encoding().unwrap().format, "VTK");
}
