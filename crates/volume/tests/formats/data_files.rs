//! Headers of NRRD and MetaImage that name a file for every slice, as NRRD's own library and ITK read them.

use crate::*;

const HEADERS: [&str; 4] = ["list.nhdr", "pattern.nhdr", "list.mhd", "pattern.mhd"];

/// A header of a fixture with some text replaced, in a folder with the fixture's data files and a file of two slices.
#[track_caller]
fn with(name: &str, text: &str, instead: &str) -> Result<Volume, VolumeError> {
    let folder = Folder::new();
    let mut parts = Vec::new();
    for part in ["part0.bin", "part1.bin", "part2.bin"] {
        let bytes = fs::read(fixture(part)).unwrap();
        fs::write(folder.0.path().join(part), &bytes).unwrap();
        parts.push(bytes);
    }
    fs::write(folder.0.path().join("all.bin"), parts.concat()).unwrap();
    for (row, bytes) in parts.concat().chunks(10).enumerate() {
        fs::write(folder.0.path().join(format!("row {row:>3}.bin")), bytes).unwrap();
        fs::write(folder.0.path().join(format!("row{row:03}.bin")), bytes).unwrap();
    }
    folder.open(name, &replaced(name, text, instead))
}

#[test]
fn lists_and_patterns() {
    for name in HEADERS {
        assert_eq!(open(name).spacing(), SPACING, "{name}");
    }
}

#[test]
fn files_have_rows_slices_or_slabs() {
    let list = "LIST\npart0.bin\npart1.bin\npart2.bin\n";
    let rows: Vec<String> = (0..12).map(|row| format!("row {row:>3}.bin\n")).collect();
    for (name, text, instead) in [
        ("list.nhdr", list, "LIST 2\npart0.bin\npart1.bin\npart2.bin\n".to_owned()),
        ("list.nhdr", list, "LIST 3\npart0.bin\npart1.bin\npart2.bin\n".to_owned()),
        ("list.nhdr", list, "LIST 3\nall.bin\n\n".to_owned()),
        ("list.nhdr", list, format!("LIST 1\n{}", rows.concat())),
        ("list.mhd", list, "LIST 3D\nall.bin".to_owned()),
        ("list.mhd", list, "LIST 2\npart0.bin\npart1.bin\npart2.bin".to_owned()),
        ("pattern.nhdr", "part%d.bin 0 2 1 2", "row%03d.bin 0 11 1 1".to_owned()),
        ("pattern.nhdr", "part%d.bin 0 2 1 2", "part%d.bin 0 2 1".to_owned()),
    ] {
        let volume = with(name, text, &instead).unwrap_or_else(|error| panic!("{instead}: {error}"));
        assert_eq!((volume.dims(), volume.values()), (DIMS, (&values()).into()), "{instead}");
    }
    let backwards = with("pattern.mhd", "part%d.bin 0 2 1", "part%d.bin 2 0 -1").unwrap();
    assert_eq!(backwards.values().slice(..20), values()[40..]);
    // For a name alone the numbers start at 1.
    let from_one = with("pattern.mhd", "part%d.bin 0 2 1", "part%d.bin");
    assert!(matches!(from_one, Err(VolumeError::Io { path, .. }) if path.ends_with("part3.bin")));
}

#[test]
fn wrong_names() {
    let refused = |name: &str, text: &str, instead: &str, found: &str, allowed: &str| {
        let field = if name.ends_with(".mhd") { "ElementDataFile" } else { "data file" };
        assert_refused(with(name, text, instead), name, field, found, allowed);
    };
    for name in ["list.nhdr", "list.mhd"] {
        refused(name, "part0.bin\n", "", "2 files", "3, one for each slice");
        refused(name, "LIST", "LIST 1", "3 files", "12, one for each row");
        refused(name, "LIST\npart0.bin", "LIST 3", "2 files", "as many as share 3 slices evenly");
        refused(name, "LIST\npart0.bin\npart1.bin\npart2.bin", "LIST 3", "0 files", "as many as share");
        refused(name, "LIST", "LIST 4", "LIST 4", "how many axes a file has whole");
        let missing = with(name, "part1.bin", "part7.bin");
        assert!(matches!(missing, Err(VolumeError::Io { path, .. }) if path.ends_with("part7.bin")), "{name}");
        let short = with(name, "part1.bin", "row000.bin");
        assert_refused(short, "row000.bin", "data", "10 bytes", "40 bytes (20 samples of 2)");
    }
    for name in ["pattern.nhdr", "pattern.mhd"] {
        refused(name, "%d.bin 0 2 1", "%d.bin 0 3 1", "4 files", "3, one for each slice");
        refused(name, "%d.bin 0 2 1", "%d.bin 0 4294967295 1", "4294967296 files", "3, one for each slice");
        for wrong in
            ["%s.bin 0 2 1", "%d%d.bin 0 2 1", "%d.bin 0 2 0", "%d.bin 2 0 1", "%d.bin 0 two 1", "%99d.bin 0 2 1"]
        {
            refused(name, "%d.bin 0 2 1", wrong, wrong, "a pattern with one %d");
        }
    }
}
