//! A sequential reader of a file's bytes, which inflates them where the file says so.

use std::io::{self, BufRead, BufReader, Chain, Cursor, Read};
use std::path::PathBuf;

use flate2::bufread::DeflateDecoder;

use super::super::VolumeError;
use super::super::error::volume::{invalid, io_error};
use super::super::file::File;
use super::super::source::{CHUNK, Source};
use super::super::stream::MAX_EXPANSION;

/// The remaining bytes of a file.
pub(super) struct Bytes {
    path: PathBuf,
    reader: Reader,
    /// The number of bytes consumed.
    at: u64,
    /// The maximum number of bytes that are left; the exact number unless the file is deflated.
    left: u64,
}

enum Reader {
    File(BufReader<File>),
    Inflated(BufReader<DeflateDecoder<Deflated>>),
}

/// The bytes that were already read, and the rest of the file.
type Deflated = Chain<Cursor<Vec<u8>>, BufReader<File>>;

impl Bytes {
    /// A file's first bytes, and a reader of the whole file.
    pub(super) fn open(mut source: Source) -> Result<(Vec<u8>, Self), VolumeError> {
        let left = source.left()?;
        let head = source.reader.fill_buf().map_err(io_error(&source.path))?;
        let head = head[..head.len().min(132)].to_vec();
        Ok((head, Self { path: source.path, reader: Reader::File(source.reader), at: 0, left }))
    }

    /// A reader of the rest, inflated. `begun` holds bytes of the rest that were already read.
    pub(super) fn inflated(self, begun: &[u8]) -> Result<Self, VolumeError> {
        let Reader::File(file) = self.reader else { return Ok(self) };
        let left = (self.left + begun.len() as u64).saturating_mul(MAX_EXPANSION);
        let inflated = DeflateDecoder::new(Cursor::new(begun.to_vec()).chain(file));
        let reader = Reader::Inflated(BufReader::with_capacity(CHUNK as usize, inflated));
        Ok(Self { path: self.path, reader, at: 0, left })
    }

    pub(super) fn is_inflated(&self) -> bool {
        matches!(self.reader, Reader::Inflated(_))
    }

    /// The number of bytes consumed.
    pub(super) fn at(&self) -> u64 {
        self.at
    }

    /// The maximum number of bytes that are left.
    pub(super) fn at_most(&self) -> u64 {
        self.left
    }

    pub(super) fn is_at_end(&mut self) -> Result<bool, VolumeError> {
        let buffer = match &mut self.reader {
            Reader::File(reader) => reader.fill_buf(),
            Reader::Inflated(reader) => reader.fill_buf(),
        };
        let is_empty = buffer.map(<[u8]>::is_empty);
        Ok(self.left == 0 || is_empty.map_err(|error| self.damage(error))?)
    }

    /// The next bytes.
    pub(super) fn take<const N: usize>(&mut self) -> Result<[u8; N], VolumeError> {
        let mut bytes = [0; N];
        self.read(&mut bytes)?;
        Ok(bytes)
    }

    /// Fills `bytes` with the next ones.
    pub(super) fn read(&mut self, bytes: &mut [u8]) -> Result<(), VolumeError> {
        let read = match &mut self.reader {
            Reader::File(reader) => reader.read_exact(bytes),
            Reader::Inflated(reader) => reader.read_exact(bytes),
        };
        read.map_err(|error| self.damage(error))?;
        self.advance(bytes.len() as u64);
        Ok(())
    }

    /// The next `bytes` bytes, fewer only at the end. Memory grows as they are read.
    pub(super) fn read_up_to(&mut self, bytes: u64) -> Result<Vec<u8>, VolumeError> {
        let mut all = Vec::new();
        let read = match &mut self.reader {
            Reader::File(reader) => reader.take(bytes).read_to_end(&mut all),
            Reader::Inflated(reader) => reader.take(bytes).read_to_end(&mut all),
        };
        let read = read.map_err(|error| self.damage(error))?;
        self.advance(read as u64);
        Ok(all)
    }

    /// Skips `bytes` bytes, all of which must exist.
    pub(super) fn skip(&mut self, bytes: u64) -> Result<(), VolumeError> {
        let skipped = match &mut self.reader {
            Reader::File(reader) => match i64::try_from(bytes) {
                Ok(offset) if bytes <= self.left => reader.seek_relative(offset).map(|()| bytes),
                _ => Err(io::ErrorKind::UnexpectedEof.into()),
            },
            Reader::Inflated(reader) => io::copy(&mut reader.take(bytes), &mut io::sink()),
        };
        if skipped.map_err(|error| self.damage(error))? < bytes {
            return Err(self.damage(io::ErrorKind::UnexpectedEof.into()));
        }
        self.advance(bytes);
        Ok(())
    }

    fn advance(&mut self, bytes: u64) {
        self.at += bytes;
        self.left = self.left.saturating_sub(bytes);
    }

    /// Tells damage from errors of the operating system: the decoder reports damage as an I/O error without an OS error code.
    fn damage(&self, error: io::Error) -> VolumeError {
        match error.raw_os_error() {
            Some(_) => io_error(&self.path)(error),
            None if error.kind() == io::ErrorKind::UnexpectedEof => {
                invalid(&self.path, "elements", "the end of the file", "whole elements")
            }
            None => invalid(&self.path, "elements", error, "an undamaged deflated stream"),
        }
    }
}
