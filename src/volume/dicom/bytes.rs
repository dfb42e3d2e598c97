//! A file's bytes, one after the other, inflated where the file says so.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Chain, Cursor, Read};
use std::path::PathBuf;

use flate2::bufread::DeflateDecoder;

use super::super::VolumeError;
use super::super::samples::MAX_EXPANSION;
use super::super::source::{CHUNK, Source, invalid, io_error};

/// The rest of a file.
pub(super) struct Bytes {
    path: PathBuf,
    reader: Reader,
    /// How many bytes were before.
    at: u64,
    /// The maximum number of bytes that are left; the exact number unless the file is deflated.
    left: u64,
}

enum Reader {
    File(BufReader<File>),
    Inflated(BufReader<DeflateDecoder<Deflated>>),
}

/// What was read already, and the rest of the file.
type Deflated = Chain<Cursor<Vec<u8>>, BufReader<File>>;

impl Bytes {
    /// A file's first bytes, and all of it.
    pub(super) fn open(mut source: Source) -> Result<(Vec<u8>, Self), VolumeError> {
        let left = source.left()?;
        let head = source.reader.fill_buf().map_err(io_error(&source.path))?;
        let head = head[..head.len().min(132)].to_vec();
        Ok((head, Self { path: source.path, reader: Reader::File(source.reader), at: 0, left }))
    }

    /// What the rest is inflated, if `begun` was read of it already.
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

    /// How many bytes were before.
    pub(super) fn at(&self) -> u64 {
        self.at
    }

    /// How many bytes are left at most.
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

    /// So many bytes, fewer at the end. Memory is taken as they come.
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

    /// Skips bytes; there must be as many.
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

    /// The decoder reports damage as an I/O error, without the code that the operating system's own carry.
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
