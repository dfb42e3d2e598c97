//! Scans and scenes that are not in the repository. The tests that need them are named `shared_…` and ignored, so that they are listed even
//! where they do not run. `SHEETSPLAT_SHARED=FOLDER cargo test shared_ -- --ignored` runs them, and fails if the data is missing.

use std::path::PathBuf;

/// A file or folder of the shared data, which must exist.
pub(crate) fn shared(path: &str) -> PathBuf {
    let folder = std::env::var_os("SHEETSPLAT_SHARED");
    let folder = folder.expect("SHEETSPLAT_SHARED does not say which folder holds the shared data");
    let path = PathBuf::from(folder).join(path);
    assert!(path.exists(), "there is no {}", path.display());
    path
}
