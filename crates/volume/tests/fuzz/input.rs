//! Inputs of fuzz targets as files. Included by the libFuzzer packages and by the tests that run their targets.

use std::path::PathBuf;
use std::sync::LazyLock;
use std::{env, fs, process};

/// A function that processes an input.
pub(crate) type Target = fn(&[u8]);

/// A folder for this process's inputs.
pub(crate) static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = env::temp_dir().join(format!("sheetsplat-fuzz-{}", process::id()));
    fs::create_dir_all(&folder).expect("a folder for temporary files");
    folder
});

/// Writes bytes to a file with this name.
pub(crate) fn file(name: &str, bytes: &[u8]) -> PathBuf {
    let path = FOLDER.join(name);
    // Overwriting a file may wait for the disk; creating a new one does not.
    _ = fs::remove_file(&path);
    fs::write(&path, bytes).expect("a temporary file");
    path
}

/// Removes the temporary files of this process.
pub(crate) fn clean_up() {
    _ = fs::remove_dir_all(&*FOLDER);
}
