//! Files in memory in place of the disk's.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use sheetsplat_volume::{Files, Labels, ReadOptions};

use crate::*;

/// All fixtures in memory, by their paths below the folder of fixtures.
fn fixtures() -> BTreeMap<PathBuf, Arc<[u8]>> {
    let root = fixture("");
    let mut folders = vec![root.clone()];
    let mut files = BTreeMap::new();
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                files.insert(path.strip_prefix(&root).unwrap().to_owned(), fs::read(&path).unwrap().into());
            }
        }
    }
    files
}

fn options(files: &BTreeMap<PathBuf, Arc<[u8]>>) -> ReadOptions {
    let files: Files = files.iter().map(|(path, bytes)| (path, Arc::clone(bytes))).collect();
    ReadOptions::default().with_files(files)
}

#[test]
fn files_in_memory_are_read_like_the_disks() {
    let files = fixtures();
    let options = options(&files);
    let root = fixture("");
    let mut volumes = 0;
    let folders = [Path::new("slices"), Path::new("series")];
    for path in files.keys().map(PathBuf::as_path).chain(folders) {
        let of_disk = Volume::open(&root.join(path));
        let of_memory = Volume::open_with(path, &options);
        match (of_disk, of_memory) {
            (Ok(expected), Ok(volume)) => {
                assert!(volume == expected, "{}", path.display());
                volumes += 1;
            }
            (Err(expected), Err(error)) => {
                let expected = expected.to_string().replace(&*root.to_string_lossy(), "");
                assert_eq!(error.to_string(), expected);
            }
            (expected, found) => panic!("{}: {expected:?} {found:?}", path.display()),
        }
    }
    assert!(volumes > 50, "{volumes}");
}

/// A program that gives files does not open others, whatever a header or a path names.
#[test]
fn the_disk_is_not_read() {
    let given = options(&BTreeMap::from([("c.npy".into(), fs::read(fixture("c.npy")).unwrap().into())]));
    for name in ["pair.hdr", "list.nhdr", "c.npy"] {
        let path = fixture(name);
        let message = Volume::open_with(&path, &given).unwrap_err().to_string();
        assert_eq!(message, format!("{}: no such file among those given: c.npy", path.display()));
        assert!(Labels::open_with(&path, &given).is_err());
    }
    let header = fs::read(fixture("list.nhdr")).unwrap();
    let alone = options(&BTreeMap::from([(fixture("list.nhdr"), header.into())]));
    let message = Volume::open_with(&fixture("list.nhdr"), &alone).unwrap_err().to_string();
    assert!(message.contains("part0.bin: no such file among those given"), "{message}");
}
