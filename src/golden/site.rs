//! Where a test's goldens are, and where it leaves what fails.

use std::path::{Component, Path, PathBuf};

use super::GoldenError;

/// A place in the source of a test, as its compiler knew it.
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
        // Absolute paths stay what they are when joined.
        let ancestors = Path::new(self.manifest_dir).ancestors();
        let source = ancestors.map(|folder| folder.join(self.file)).find(|source| source.is_file());
        source
            .map(|source| source.with_file_name("goldens"))
            .ok_or_else(|| GoldenError::Source { file: self.file.to_owned(), manifest_dir: self.manifest_dir.into() })
    }

    /// A folder of the source file's own in `target/goldens`.
    pub(super) fn failures(&self) -> PathBuf {
        let file = Path::new(self.file).with_extension("");
        let inside = file.components().filter(|component| matches!(component, Component::Normal(_)));
        self.target().join("goldens").join(inside.collect::<PathBuf>())
    }

    fn target(&self) -> PathBuf {
        let beside_tmp = self.target_tmpdir.and_then(|tmpdir| Path::new(tmpdir).parent()).map(Path::to_owned);
        // Unit tests are below the target folder, in which Cargo leaves this file.
        let above_program = || {
            let program = std::env::current_exe().ok()?;
            program.ancestors().find(|folder| folder.join("CACHEDIR.TAG").is_file()).map(Path::to_owned)
        };
        beside_tmp.or_else(above_program).unwrap_or_else(|| Path::new(self.manifest_dir).join("target"))
    }
}
