//! Messages about files have no control characters, whatever a file holds.

use std::fs;
use std::path::Path;

use sheetsplat_volume::Volume;

/// The places of a file that are damaged, at most.
const PLACES: usize = 400;

/// An escape in any place of any file, and at the end of its name, is in no message.
#[test]
fn messages_have_no_escapes() {
    let folder = tempfile::tempdir().unwrap();
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/fixtures");
    let (mut files, mut errors) = (0, 0);
    for entry in fs::read_dir(fixtures).unwrap() {
        let path = entry.unwrap().path();
        if !path.is_file() || path.extension().is_some_and(|extension| extension == "py") {
            continue;
        }
        files += 1;
        let bytes = fs::read(&path).unwrap();
        let name = path.file_name().unwrap().to_str().unwrap();
        let copy = folder.path().join(format!("\u{1b}[31m{name}"));
        // Headers lie at the beginning, but for a few formats.
        let head = bytes.len().min(4096);
        for place in (0..head).step_by(head.div_ceil(PLACES).max(1)) {
            let mut damaged = bytes.clone();
            damaged[place] = 0x1b;
            fs::write(&copy, damaged).unwrap();
            if let Err(error) = Volume::open(&copy) {
                errors += 1;
                let message = error.to_string();
                assert!(!message.contains(char::is_control), "{name}, byte {place}: {message:?}");
            }
        }
    }
    assert!(files > 20 && errors > 1000, "{errors} errors of {files} files");
}
