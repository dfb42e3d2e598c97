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
        // Unit tests run below the target folder, in which Cargo puts this file.
        let above_program = || {
            let program = std::env::current_exe().ok()?;
            program.ancestors().find(|folder| folder.join("CACHEDIR.TAG").is_file()).map(Path::to_owned)
        };
        beside_tmp.or_else(above_program).unwrap_or_else(|| Path::new(self.manifest_dir).join("target"))
    }
}
