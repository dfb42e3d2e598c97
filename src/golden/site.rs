//! The folders of a test's goldens and of its failures.

use std::path::{Component, Path, PathBuf};

use super::GoldenError;

/// A place in a test's source, as known to the compiler.
#[derive(Clone, Copy, Debug)]
pub struct Site<'a> {
    /// `CARGO_MANIFEST_DIR`: the folder of the package.
    pub manifest_dir: &'a str,
    /// `file!()`: absolute, or relative to the package or its workspace.
    pub file: &'a str,
    /// `CARGO_TARGET_TMPDIR`, which only integration tests have.
    pub target_tmpdir: Option<&'a str>,
}

impl Site<'_> {
    /// The folder `goldens` beside the source file.
    pub(super) fn goldens(&self) -> Result<PathBuf, GoldenError> {
        // Joining an absolute path replaces the folder.
        let ancestors = Path::new(self.manifest_dir).ancestors();
        let source = ancestors.map(|folder| folder.join(self.file)).find(|source| source.is_file());
        source
            .map(|source| source.with_file_name("goldens"))
            .ok_or_else(|| GoldenError::Source { file: self.file.to_owned(), manifest_dir: self.manifest_dir.into() })
    }

    /// The source file's own folder in `target/goldens`.
    pub(super) fn failures(&self) -> PathBuf {
        let file = Path::new(self.file).with_extension("");
        let inside = file.components().filter(|component| matches!(component, Component::Normal(_)));
        self.target().join("goldens").join(inside.collect::<PathBuf>())
    }

    fn target(&self) -> PathBuf {
        let beside_tmp = self.target_tmpdir.and_then(|tmpdir| Path::new(tmpdir).parent()).map(Path::to_owned);
        // Unit tests run below the target folder, in which Cargo puts these files: the second one even where it did not make the folder.
        let is_target =
            |folder: &&Path| ["CACHEDIR.TAG", ".rustc_info.json"].iter().any(|file| folder.join(file).is_file());
        let above_program = || std::env::current_exe().ok()?.ancestors().find(is_target).map(Path::to_owned);
        beside_tmp.or_else(above_program).unwrap_or_else(|| Path::new(self.manifest_dir).join("target"))
    }
}
