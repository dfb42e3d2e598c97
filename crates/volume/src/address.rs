//! Paths that name more than a file: addresses of stores that are read over HTTP, and files in archives.

use std::path::{Path, PathBuf};

/// Whether a path is an address.
pub fn is_address(path: &Path) -> bool {
    let begins =
        |text: &str, scheme: &str| text.get(..scheme.len()).is_some_and(|head| head.eq_ignore_ascii_case(scheme));
    path.to_str().is_some_and(|text| ["http://", "https://"].iter().any(|scheme| begins(text, scheme)))
}

/// The name of a builtin table in a path `builtin:NAME`.
pub fn builtin_name(path: &Path) -> Option<&str> {
    path.to_str()?.strip_prefix("builtin:")
}

/// A path that is written in a folder: one that is relative leads from there, an address does not.
pub fn written_in(folder: &Path, path: &str) -> PathBuf {
    if is_address(Path::new(path)) { PathBuf::from(path) } else { folder.join(path) }
}

/// The parts of a path such as `file.npz:name` before and after the colon, for archives of several volumes; any other path is the first part.
pub fn archive_and_inner(path: &Path) -> (&Path, Option<&str>) {
    const EXTENSIONS: [&str; 3] = [".npz:", ".zip:", ".ozx:"];
    let split = path.to_str().filter(|_| !path.exists()).and_then(|text| {
        let lower = text.to_ascii_lowercase();
        let at = EXTENSIONS.iter().filter_map(|end| Some(lower.rfind(end)? + end.len())).max()?;
        Some((Path::new(&text[..at - 1]), Some(&text[at..])))
    });
    split.unwrap_or((path, None))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_no_paths_of_a_folder() {
        for path in ["http://a/b.zarr", "HTTPS://a", "https://a:8080/b.zarr?c=d"] {
            assert!(is_address(Path::new(path)));
            assert_eq!(written_in(Path::new("folder"), path), PathBuf::from(path));
        }
        for path in ["", "http", "http:/a", "ftp://a/b", "file:///a", "a/http://b", "é"] {
            assert!(!is_address(Path::new(path)));
            assert_eq!(written_in(Path::new("folder"), path), Path::new("folder").join(path));
        }
    }
}
