//! Files that are being read.

use std::fs;
use std::io::{BufRead, BufReader, Read, Seek};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::VolumeError;
use super::access::Access;
use super::error::volume::{invalid, io_error};
use super::file::File;

/// The maximum length of a header line in bytes.
const MAX_LINE: u64 = 64 << 10;
/// The maximum length of a header in bytes.
pub(super) const MAX_HEADER: u64 = 1 << 20;
/// The number of bytes read at a time: a multiple of the size of every sample type.
pub(super) const CHUNK: u64 = 64 << 10;

impl Access {
    pub(super) fn open(&self, path: &Path) -> Result<Source, VolumeError> {
        self.check_input(path)?;
        self.open_to_look(path)
    }

    /// Opens a file only to determine its format.
    pub(super) fn open_to_look(&self, path: &Path) -> Result<Source, VolumeError> {
        match self.given() {
            Some(files) => Ok(Source::in_memory(path, files.get(path).map_err(io_error(path))?, self)),
            None => Source::open(path, &self.resolve(path)?, self),
        }
    }
}

/// A file that is being read.
pub(super) struct Source {
    pub(super) path: PathBuf,
    bytes: u64,
    pub(super) reader: BufReader<File>,
    pub(super) access: Access,
}

impl Source {
    /// Opens `path` at `resolved`, the place it leads to. [`Access::open`] does both.
    fn open(path: &Path, resolved: &Path, access: &Access) -> Result<Self, VolumeError> {
        // The kind of file is checked before opening, because opening a pipe would wait for its writer.
        let metadata = fs::metadata(resolved).map_err(io_error(path))?;
        if !metadata.is_file() {
            return Err(invalid(path, "file", "a folder, pipe or device", "a regular file"));
        }
        let file = File::on_disk(fs::File::open(resolved).map_err(io_error(path))?, access.bytes_read());
        Ok(Self::new(path, metadata.len(), file, access))
    }

    /// Opens a file that is in memory.
    fn in_memory(path: &Path, bytes: &Arc<[u8]>, access: &Access) -> Self {
        Self::new(path, bytes.len() as u64, File::in_memory(bytes, access.bytes_read()), access)
    }

    fn new(path: &Path, bytes: u64, file: File, access: &Access) -> Self {
        let reader = BufReader::with_capacity(CHUNK as usize, file);
        Self { path: path.to_owned(), bytes, reader, access: access.clone() }
    }

    /// The number of bytes left to read.
    pub(super) fn left(&mut self) -> Result<u64, VolumeError> {
        Ok(self.bytes.saturating_sub(self.reader.stream_position().map_err(io_error(&self.path))?))
    }

    /// The next header line without its end; `None` at the end of the file. `budget` is the number of bytes that the header may still use.
    pub(super) fn line(&mut self, budget: &mut u64) -> Result<Option<String>, VolumeError> {
        let (mut line, limit) = (Vec::new(), MAX_LINE.min(*budget));
        let read = self.reader.by_ref().take(limit).read_until(b'\n', &mut line);
        let read = read.map_err(io_error(&self.path))? as u64;
        if read == limit && !line.ends_with(b"\n") {
            let allowed = format!("lines of less than {MAX_LINE} bytes, less than {MAX_HEADER} bytes in all");
            return Err(invalid(&self.path, "header", "more", allowed));
        }
        *budget -= read;
        let text = line.strip_suffix(b"\n").unwrap_or(&line);
        let text = text.strip_suffix(b"\r").unwrap_or(text);
        Ok((read > 0).then(|| String::from_utf8_lossy(text).into_owned()))
    }

    /// Skips `bytes` bytes, or all that are left if there are fewer.
    pub(super) fn skip(&mut self, bytes: u64) -> Result<(), VolumeError> {
        let bytes = bytes.min(self.left()?);
        self.reader.seek_relative(bytes as i64).map_err(io_error(&self.path))
    }

    /// The remaining lines of a header, without blank ones.
    pub(super) fn lines(&mut self, budget: &mut u64) -> Result<Vec<String>, VolumeError> {
        let mut lines = Vec::new();
        while let Some(line) = self.line(budget)? {
            if !line.trim().is_empty() {
                lines.push(line.trim().to_owned());
            }
        }
        Ok(lines)
    }

    pub(super) fn skip_lines(&mut self, lines: u64) -> Result<(), VolumeError> {
        for skipped in 0..lines {
            if self.reader.skip_until(b'\n').map_err(io_error(&self.path))? == 0 {
                let allowed = format!("at most the {skipped} lines of the file");
                return Err(invalid(&self.path, "line skip", lines, allowed));
            }
        }
        Ok(())
    }
}
