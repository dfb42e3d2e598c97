//! ZIP archives whose files are stored or deflated.
//!
//! The archive's directory is read here: crates for ZIP allocate as many entries as the archive claims to have, and only the place
//! where a file begins is needed.

use std::io::{self, Read, Seek, SeekFrom};
#[cfg(feature = "zarr")]
use std::ops::Range;

use flate2::Crc;
use flate2::bufread::DeflateDecoder;

use super::VolumeError;
use super::error::volume::{invalid, io_error};
use super::source::Source;
use super::stream::{MAX_EXPANSION, Stream};

/// The size of the directory's end record without its comment, and the maximum length of the comment.
const END: u64 = 22;
const MAX_COMMENT: u64 = 0xffff;

/// Methods of compression.
const STORED: u64 = 0;
const DEFLATED: u64 = 8;

/// Where an archive lists its files.
pub(super) struct Directory {
    at: u64,
    files: u64,
}

impl Directory {
    pub(super) fn read(file: &mut Source) -> Result<Self, VolumeError> {
        let length = file.left()?;
        let tail = (END + MAX_COMMENT).min(length);
        let bytes = bytes_at(file, length - tail, tail)?;
        let end = bytes.windows(END as usize).rposition(|window| window.starts_with(b"PK\x05\x06"));
        let Some(end) = end else {
            return Err(invalid(&file.path, "archive", "no end of a directory", "a whole ZIP archive"));
        };
        let (files, at) = (number(&bytes, end + 10, 2), number(&bytes, end + 16, 4));
        if files < 0xffff && at < 0xffff_ffff {
            return Ok(Self { at, files });
        }
        // A large archive keeps these numbers in a ZIP64 end record, whose locator precedes the ordinary one.
        let locator = (length - tail + end as u64).checked_sub(20).ok_or_else(|| damaged(file))?;
        let locator = bytes_at(file, locator, 20)?;
        let end = bytes_at(file, number(&locator, 8, 8), 56)?;
        if !locator.starts_with(b"PK\x06\x07") || !end.starts_with(b"PK\x06\x06") {
            return Err(damaged(file));
        }
        Ok(Self { at: number(&end, 48, 8), files: number(&end, 32, 8) })
    }

    /// The files whose names end in some way.
    pub(super) fn members(&self, file: &mut Source, end: &str) -> Result<Vec<Member>, VolumeError> {
        let (mut at, mut members) = (self.at, Vec::new());
        for _ in 0..self.files {
            let entry = bytes_at(file, at, 46)?;
            if !entry.starts_with(b"PK\x01\x02") {
                return Err(damaged(file));
            }
            let [name, extra, comment] = [28, 30, 32].map(|at| number(&entry, at, 2));
            let rest = bytes_at(file, at.saturating_add(46), name + extra)?;
            let (name_bytes, extra_bytes) = rest.split_at(name as usize);
            at = at.saturating_add(46 + name + extra + comment);
            let mut member = Member {
                name: String::from_utf8_lossy(name_bytes).into_owned(),
                is_encrypted: entry[8] & 1 == 1,
                method: number(&entry, 10, 2),
                checksum: number(&entry, 16, 4) as u32,
                bytes: number(&entry, 24, 4),
                compressed: number(&entry, 20, 4),
                at: number(&entry, 42, 4),
            };
            member.widen(extra_bytes).ok_or_else(|| damaged(file))?;
            if member.name.ends_with(end) {
                members.push(member);
            }
        }
        Ok(members)
    }
}

/// A file in the archive.
#[derive(Clone)]
pub(super) struct Member {
    pub(super) name: String,
    is_encrypted: bool,
    method: u64,
    checksum: u32,
    pub(super) bytes: u64,
    compressed: u64,
    at: u64,
}

impl Member {
    /// Replaces numbers that are too large for 32 bits by those of the extra field, if it has them.
    fn widen(&mut self, mut extra: &[u8]) -> Option<()> {
        const WIDE: u64 = 1;
        while extra.len() >= 4 {
            let (kind, length) = (number(extra, 0, 2), number(extra, 2, 2) as usize);
            let (field, after) = extra[4..].split_at_checked(length)?;
            if kind == WIDE {
                let mut wide = field.chunks_exact(8).map(|bytes| number(bytes, 0, 8));
                for narrow in [&mut self.bytes, &mut self.compressed, &mut self.at] {
                    if *narrow == 0xffff_ffff {
                        *narrow = wide.next()?;
                    }
                }
            }
            extra = after;
        }
        Some(())
    }

    /// A stream of the file's bytes.
    pub(super) fn open(&self, mut file: Source) -> Result<Stream, VolumeError> {
        self.seek(&mut file, 0)?;
        let Source { path, access, .. } = &file;
        let (path, access) = (path.clone(), access.clone());
        let (reader, left): (Box<dyn Read>, u64) = match self.method {
            STORED => (Box::new(Checked::new(file.reader.take(self.compressed), self.checksum)), self.compressed),
            _ => {
                let code = DeflateDecoder::new(file.reader.take(self.compressed));
                (Box::new(Checked::new(code, self.checksum)), self.compressed.saturating_mul(MAX_EXPANSION))
            }
        };
        Ok(Stream::decoded(&path, reader, "a whole and undamaged file in the archive", left.min(self.bytes), &access))
    }

    /// Some of the file's bytes. The checksum is checked where they are all.
    #[cfg(feature = "zarr")]
    pub(super) fn bytes(&self, mut file: Source, range: Range<u64>) -> Result<Vec<u8>, VolumeError> {
        let count = range.end - range.start;
        if self.method == STORED && count < self.bytes {
            self.seek(&mut file, range.start)?;
            let mut found = Vec::new();
            file.reader.by_ref().take(count).read_to_end(&mut found).map_err(io_error(&file.path))?;
            return if found.len() as u64 == count { Ok(found) } else { Err(damaged(&file)) };
        }
        let path = file.path.clone();
        let mut stream = self.open(file)?;
        let mut found = Vec::new();
        stream.skip(range.start)?;
        // One byte more than there is, so that the end is reached where the checksum is checked.
        stream.read_up_to(count + u64::from(range.end == self.bytes), &mut found)?;
        if found.len() as u64 == count {
            return Ok(found);
        }
        Err(invalid(&path, &self.name, format!("{} bytes", found.len()), format!("{count} bytes")))
    }

    /// Moves to a byte of the file, as it is stored.
    fn seek(&self, file: &mut Source, byte: u64) -> Result<(), VolumeError> {
        let refused = |found: String| {
            Err(invalid(&file.path, &self.name, found, "a file that is stored (0) or deflated (8), and not encrypted"))
        };
        if self.is_encrypted {
            return refused("an encrypted file".to_owned());
        }
        if ![STORED, DEFLATED].contains(&self.method) {
            return refused(format!("compression {}", self.method));
        }
        let local = bytes_at(file, self.at, 30)?;
        if !local.starts_with(b"PK\x03\x04") {
            return Err(damaged(file));
        }
        let first = self.at.saturating_add(30 + number(&local, 26, 2) + number(&local, 28, 2));
        file.reader.seek(SeekFrom::Start(first)).map_err(io_error(&file.path))?;
        if file.left()? < self.compressed || byte > self.compressed {
            return Err(damaged(file));
        }
        file.reader.seek_relative(byte as i64).map_err(io_error(&file.path))
    }
}

/// A reader that checks its bytes against a checksum.
struct Checked<R> {
    reader: R,
    sum: Crc,
    expected: u32,
}

impl<R> Checked<R> {
    fn new(reader: R, expected: u32) -> Self {
        Self { reader, sum: Crc::new(), expected }
    }
}

impl<R: Read> Read for Checked<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = self.reader.read(buffer)?;
        self.sum.update(&buffer[..read]);
        if read == 0 && !buffer.is_empty() && self.sum.sum() != self.expected {
            return Err(io::Error::other("a checksum that differs from the archive's"));
        }
        Ok(read)
    }
}

/// `bytes` bytes of the file from `at` on, all of which must exist.
fn bytes_at(file: &mut Source, at: u64, bytes: u64) -> Result<Vec<u8>, VolumeError> {
    if at > i64::MAX as u64 {
        return Err(damaged(file));
    }
    let mut found = Vec::new();
    let read =
        file.reader.seek(SeekFrom::Start(at)).and_then(|_| file.reader.by_ref().take(bytes).read_to_end(&mut found));
    match read.map_err(io_error(&file.path))? as u64 == bytes {
        true => Ok(found),
        false => Err(damaged(file)),
    }
}

fn damaged(file: &Source) -> VolumeError {
    invalid(&file.path, "archive", "a directory that leads out of the file, or to other bytes", "a whole ZIP archive")
}

/// The unsigned little-endian integer in the `size` bytes from `at` on.
fn number(bytes: &[u8], at: usize, size: usize) -> u64 {
    bytes[at..at + size].iter().rev().fold(0, |number, &byte| number << 8 | u64::from(byte))
}
