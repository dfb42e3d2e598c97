//! What all targets do with a file.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use std::{env, fs, process};

use sheetsplat::volume::{Volume, VolumeError};

static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = env::temp_dir().join(format!("sheetsplat-fuzz-{}", process::id()));
    fs::create_dir_all(&folder).expect("a folder for temporary files");
    folder
});

/// Writes bytes to a file of this name, and opens it: a whole volume or an error.
pub fn volume(name: &str, bytes: &[u8], open: impl Fn(&Path) -> Result<Volume, VolumeError>) {
    let path = FOLDER.join(name);
    // Written over, a file may be waited for until it is on the disk; a new one is not.
    _ = fs::remove_file(&path);
    fs::write(&path, bytes).expect("a temporary file");
    if let Ok(volume) = open(&path) {
        assert_eq!(volume.values().len(), volume.dims().element_product() as usize);
        let holes = volume.values().iter().filter(|value| value.is_nan()).count() as u64;
        assert!(holes == volume.holes() && holes < volume.values().len() as u64);
        assert!(!volume.values().iter().any(|value| value.is_infinite()));
    }
}
