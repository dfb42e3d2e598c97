//! Files that are being read, and the wording of errors about them.

use std::fmt::Display;
use std::fs;
use std::io::{self, BufRead, BufReader, Read, Seek};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::DVec3;

use super::VolumeError;
use super::access::Access;
use super::file::File;

/// The maximum length of a header line in bytes.
const MAX_LINE: u64 = 64 << 10;
/// The maximum length of a header in bytes.
pub(super) const MAX_HEADER: u64 = 1 << 20;
/// The number of bytes read at a time: a multiple of the size of every sample type.
pub(super) const CHUNK: u64 = 64 << 10;

/// A file that is being read.
pub(super) struct Source {
    pub(super) path: PathBuf,
    bytes: u64,
    pub(super) reader: BufReader<File>,
    pub(super) access: Access,
}

impl Source {
    /// Opens `path` at `resolved`, the place it leads to. [`Access::open`] does both.
    pub(super) fn open(path: &Path, resolved: &Path, access: &Access) -> Result<Self, VolumeError> {
        // The kind of file is checked before opening, because opening a pipe would wait for its writer.
        let metadata = fs::metadata(resolved).map_err(io_error(path))?;
        if !metadata.is_file() {
            return Err(invalid(path, "file", "a folder, pipe or device", "a regular file"));
        }
        let file = File::on_disk(fs::File::open(resolved).map_err(io_error(path))?, access.bytes_read());
        Ok(Self::new(path, metadata.len(), file, access))
    }

    /// Opens a file that is in memory.
    pub(super) fn in_memory(path: &Path, bytes: &Arc<[u8]>, access: &Access) -> Self {
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

pub(super) fn invalid(path: &Path, field: &str, found: impl Display, allowed: impl Display) -> VolumeError {
    super::invalid(&path.display().to_string(), field, found.to_string(), allowed.to_string())
}

pub(super) fn io_error(path: &Path) -> impl Fn(io::Error) -> VolumeError {
    |source| VolumeError::Io { path: path.to_owned(), source }
}

/// Text from a file, shortened and on one line.
pub(super) fn shown(text: &str) -> String {
    let short: String = text.chars().take(60).collect();
    format!("{short:?}{}", if short.len() < text.len() { "…" } else { "" })
}

pub(super) fn lower(text: &str) -> String {
    text.to_ascii_lowercase()
}

pub(super) fn three<T>(items: impl Iterator<Item = Option<T>>) -> Option<[T; 3]> {
    items.collect::<Option<Vec<T>>>()?.try_into().ok()
}

/// A finite number.
pub(super) fn number(text: &str) -> Option<f64> {
    text.trim().parse().ok().filter(|number: &f64| number.is_finite())
}

/// A vector `(x,y,z)`, with or without spaces around the numbers.
pub(super) fn vector(text: &str) -> Option<DVec3> {
    let components = text.trim().strip_prefix('(')?.strip_suffix(')')?;
    three(components.split(',').map(number)).map(DVec3::from_array)
}
