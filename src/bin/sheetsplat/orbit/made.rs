//! The list of the frames that were made: a file beside them, because not every format has room for what a frame shows.
//!
//! Each line holds two hashes: of what the frame shows, and of its file's bytes. Runs that draw other frames of the same movie append lines at the same time;
//! a line that is lost or torn only means that its frame is drawn again.

use std::collections::HashSet;
use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};

/// The maximum length of a list in bytes, of 130 for each frame.
const MAX_BYTES: u64 = 1 << 28;

/// The list, as it was before this run.
pub(super) struct Made {
    path: PathBuf,
    lines: HashSet<String>,
}

impl Made {
    /// Reads the list at a path. Without such a file no frame was made.
    ///
    /// # Errors
    /// If it cannot be read.
    pub(super) fn open(path: PathBuf) -> io::Result<Self> {
        let mut bytes = Vec::new();
        match File::open(&path) {
            Ok(file) => _ = file.take(MAX_BYTES).read_to_end(&mut bytes)?,
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            Err(error) => return Err(error),
        }
        let lines = String::from_utf8_lossy(&bytes).lines().map(str::to_owned).collect();
        Ok(Self { path, lines })
    }

    /// Whether a file is the one that was made of a frame, given the hash of what that shows.
    pub(super) fn has(&self, shown: blake3::Hash, frame: &Path) -> bool {
        !self.lines.is_empty() && fs::read(frame).is_ok_and(|bytes| self.lines.contains(&line(shown, &bytes)))
    }

    /// Appends a frame that has been written.
    ///
    /// # Errors
    /// If the list cannot be written.
    pub(super) fn add(&self, shown: blake3::Hash, bytes: &[u8]) -> io::Result<()> {
        let line = line(shown, bytes);
        if self.lines.contains(&line) {
            return Ok(());
        }
        let mut file = OpenOptions::new().append(true).create(true).open(&self.path)?;
        // At once, so that lines of other runs lie before or behind it; after a torn line it begins anew.
        file.write_all(format!("\n{line}\n").as_bytes())
    }

    /// The list's file.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }
}

fn line(shown: blake3::Hash, bytes: &[u8]) -> String {
    format!("{} {}", shown.to_hex(), blake3::hash(bytes).to_hex())
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;

    #[test]
    fn torn_lines_and_other_bytes_are_no_frames() {
        let folder = tempfile::tempdir().unwrap();
        let [list, frame] = ["list", "frame"].map(|name| folder.path().join(name));
        let [shown, other] = [b"a", b"b"].map(|bytes| blake3::hash(bytes));
        fs::write(&list, "torn").unwrap();
        fs::write(&frame, "pixels").unwrap();
        let open = || Made::open(list.clone()).unwrap();
        assert!(!open().has(shown, &frame));
        open().add(shown, b"pixels").unwrap();
        open().add(shown, b"pixels").unwrap();
        assert!(open().has(shown, &frame) && !open().has(other, &frame));
        fs::write(&frame, "pixel").unwrap();
        assert!(!open().has(shown, &frame));
        fs::remove_file(&frame).unwrap();
        assert!(!open().has(shown, &frame));
    }
}
