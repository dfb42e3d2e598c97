//! The samples of a file as a stream of bytes, decompressed.
//!
//! What a header promises is checked against what the file can hold before memory is allocated. Samples are converted as they are
//! read, so that loading needs little more memory than the values.

use std::io::{self, BufRead, BufReader, Read, Seek};
use std::path::{Path, PathBuf};

#[cfg(feature = "bzip2")]
use bzip2::bufread::MultiBzDecoder;
use flate2::bufread::MultiGzDecoder;
#[cfg(feature = "metaimage")]
use flate2::bufread::ZlibDecoder;

use super::access::Access;
use super::error::volume::{VolumeError, invalid, io_error};
use super::file::File;
use super::numbers::{Numbers, TextEnd};
use super::sample_type::SampleType;
use super::samples::Samples;
use super::source::{CHUNK, Source};
use super::voxels::Voxels;

/// Deflate spends at least 2 bits on a match of at most 258 bytes, so a stream expands at most by this factor.
pub(super) const MAX_EXPANSION: u64 = 1032;

impl Samples {
    /// Reserves the memory that their voxels take at most.
    pub(super) fn reserve(&self, path: &Path, access: &Access) -> Result<(), VolumeError> {
        let [x, y, z] = self.dims.to_array();
        // Reordering the axes needs a second copy.
        let copies = if self.z_fastest { 2 } else { 1 };
        access.reserve(
            path,
            "data",
            format!("{x} × {y} × {z} voxels"),
            copies * u64::from(self.count()) * access.wanted().bytes(self.kind, self.rescale.is_some()),
        )
    }
}

/// The rest of a file, decompressed.
pub(super) struct Stream {
    pub(super) path: PathBuf,
    reader: Reader,
    /// The number of bytes left; an upper bound if the stream is compressed.
    left: u64,
    pub(super) access: Access,
}

enum Reader {
    Raw(BufReader<File>),
    /// A decoder, and what its input must be, for errors.
    Decoder(Box<dyn Read>, &'static str),
}

impl Stream {
    /// The rest of a file as it is.
    pub(super) fn raw(mut file: Source) -> Result<Self, VolumeError> {
        Ok(Self { left: file.left()?, path: file.path, reader: Reader::Raw(file.reader), access: file.access })
    }

    /// The rest of a file, decompressed from one or more gzip members.
    pub(super) fn gzip(mut file: Source) -> Result<Self, VolumeError> {
        let left = file.left()?.saturating_mul(MAX_EXPANSION);
        let decoder = Box::new(MultiGzDecoder::new(file.reader));
        Ok(Self::decoded(&file.path, decoder, "whole and undamaged gzip members", left, &file.access))
    }

    /// The rest of a file, decompressed from one zlib stream.
    #[cfg(feature = "metaimage")]
    pub(super) fn zlib(mut file: Source) -> Result<Self, VolumeError> {
        let left = file.left()?.saturating_mul(MAX_EXPANSION);
        let decoder = Box::new(Zlib(ZlibDecoder::new(file.reader)));
        Ok(Self::decoded(&file.path, decoder, "one whole and undamaged zlib stream", left, &file.access))
    }

    /// The rest of a file, decompressed from one or more bzip2 streams. Their size does not bound the output; the number of samples does.
    #[cfg(feature = "bzip2")]
    pub(super) fn bzip2(file: Source) -> Self {
        let decoder = Box::new(MultiBzDecoder::new(file.reader));
        Self::decoded(&file.path, decoder, "whole and undamaged bzip2 streams", u64::MAX, &file.access)
    }

    /// The rest of a file, numbers as text, read as samples in the machine's byte order.
    pub(super) fn text(mut file: Source, kind: SampleType, end: TextEnd) -> Result<Self, VolumeError> {
        // A number takes at least a digit and a space.
        let left = (file.left()? / 2 + 1).saturating_mul(kind.bytes());
        let decoder = Box::new(Numbers::new(file.reader, kind, end));
        Ok(Self::decoded(&file.path, decoder, "numbers as text", left, &file.access))
    }

    /// The rest of a file, decoded from two hexadecimal digits per byte.
    pub(super) fn hex(mut file: Source) -> Result<Self, VolumeError> {
        let left = file.left()? / 2;
        let decoder = Box::new(Hex(file.reader));
        Ok(Self::decoded(&file.path, decoder, "pairs of hexadecimal digits", left, &file.access))
    }

    /// What `reader` decodes from a file, at most `left` bytes. `allowed` says what its input must be.
    pub(super) fn decoded(
        path: &Path,
        reader: Box<dyn Read>,
        allowed: &'static str,
        left: u64,
        access: &Access,
    ) -> Self {
        Self { path: path.to_owned(), reader: Reader::Decoder(reader, allowed), left, access: access.clone() }
    }

    /// The exact number of bytes left; `None` if the stream is compressed.
    pub(super) fn exactly_left(&self) -> Option<u64> {
        matches!(self.reader, Reader::Raw(_)).then_some(self.left)
    }

    /// The position in the file; `None` if the stream is compressed.
    pub(super) fn position(&mut self) -> Result<Option<u64>, VolumeError> {
        let Reader::Raw(reader) = &mut self.reader else { return Ok(None) };
        reader.stream_position().map(Some).map_err(io_error(&self.path))
    }

    /// Skips `bytes` bytes, or all that are left if there are fewer.
    pub(super) fn skip(&mut self, bytes: u64) -> Result<(), VolumeError> {
        let bytes = bytes.min(self.left);
        self.left -= bytes;
        match &mut self.reader {
            Reader::Raw(reader) => reader.seek_relative(bytes as i64).map_err(io_error(&self.path)),
            Reader::Decoder(reader, _) => {
                let skipped = io::copy(&mut reader.by_ref().take(bytes), &mut io::sink());
                skipped.map(drop).map_err(|error| self.damage(error))
            }
        }
    }

    /// The next `bytes` bytes, of a header.
    #[cfg(any(feature = "mgh", feature = "nifti", feature = "npy", feature = "vtk"))]
    pub(super) fn bytes(&mut self, bytes: u64) -> Result<Vec<u8>, VolumeError> {
        let mut header = Vec::new();
        let read = self.read_up_to(bytes, &mut header)?;
        self.left -= read.min(self.left);
        if read < bytes {
            return Err(invalid(&self.path, "header", format!("{read} bytes"), format!("{bytes} bytes")));
        }
        Ok(header)
    }

    /// The samples. The stream must end after them, unless it is a `window` into a file in which more may follow.
    pub(super) fn samples(mut self, samples: &Samples, window: bool) -> Result<Voxels, VolumeError> {
        let expected = samples.bytes();
        match self.exactly_left() {
            Some(left) if left < expected || left > expected && !window => {
                return Err(samples.mismatch(&self.path, left));
            }
            None if self.left < expected => {
                return Err(samples.mismatch(&self.path, format!("at most {}", self.left)));
            }
            _ => {}
        }
        samples.reserve(&self.path, &self.access)?;
        let values = self.read_samples(samples)?;
        // Reading to the end also checks a compressed stream's last checksum.
        if let Reader::Decoder(reader, _) = &mut self.reader {
            let rest = if window { u64::MAX } else { 1 };
            let rest =
                io::copy(&mut reader.by_ref().take(rest), &mut io::sink()).map_err(|error| self.damage(error))?;
            if rest > 0 && !window {
                return Err(samples.mismatch(&self.path, format!("more than {expected}")));
            }
        }
        Ok(values)
    }

    pub(super) fn read_samples(&mut self, samples: &Samples) -> Result<Voxels, VolumeError> {
        let path = self.path.clone();
        let (mut values, mut chunk) = (self.access.wanted().none(), Vec::with_capacity(CHUNK as usize));
        // An uncompressed file certainly holds all samples. What a compressed stream holds is unknown, so memory grows as it is decoded.
        let known = if self.exactly_left().is_some() { samples.count() as usize } else { 0 };
        values.try_reserve_exact(known).map_err(samples.too_many(&path))?;
        let mut left = samples.bytes();
        while left > 0 {
            chunk.clear();
            let wanted = left.min(CHUNK);
            let read = self.read_up_to(wanted, &mut chunk)?;
            if read < wanted {
                return Err(samples.mismatch(&path, samples.bytes() - left + read));
            }
            self.access.note_rounding(samples.append(&path, &chunk, &mut values)?);
            left -= read;
        }
        values.shrink_to_fit();
        samples.in_order(&path, values)
    }

    /// Appends up to `bytes` bytes, fewer only at the end, and returns their number.
    pub(super) fn read_up_to(&mut self, bytes: u64, into: &mut Vec<u8>) -> Result<u64, VolumeError> {
        let read = match &mut self.reader {
            Reader::Raw(reader) => reader.by_ref().take(bytes).read_to_end(into),
            Reader::Decoder(reader, _) => reader.by_ref().take(bytes).read_to_end(into),
        };
        read.map(|read| read as u64).map_err(|error| self.damage(error))
    }

    /// Tells damage from errors of the operating system: decoders report damage as an I/O error without an OS error code.
    fn damage(&self, error: io::Error) -> VolumeError {
        match (&self.reader, error.raw_os_error()) {
            (Reader::Decoder(_, allowed), None) => invalid(&self.path, "data", error, allowed),
            _ => io_error(&self.path)(error),
        }
    }
}

/// Bytes written as hexadecimal digits, with any white space between them.
struct Hex<R>(R);

impl<R: BufRead> Read for Hex<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let (mut written, mut high) = (0, None);
        while written < buffer.len() {
            let Some(&byte) = self.0.fill_buf()?.first() else {
                match high {
                    None => break,
                    Some(_) => return Err(io::Error::other("a digit without a second one")),
                }
            };
            self.0.consume(1);
            if byte.is_ascii_whitespace() {
                continue;
            }
            let Some(digit) = char::from(byte).to_digit(16) else {
                return Err(io::Error::other(format!("\"{}\", no hexadecimal digit", byte.escape_ascii())));
            };
            match high.take() {
                None => high = Some(digit << 4),
                Some(high) => {
                    buffer[written] = (high | digit) as u8;
                    written += 1;
                }
            }
        }
        Ok(written)
    }
}

/// A zlib stream that must end the file.
#[cfg(feature = "metaimage")]
struct Zlib(ZlibDecoder<BufReader<File>>);

#[cfg(feature = "metaimage")]
impl Read for Zlib {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = self.0.read(buffer)?;
        if read == 0 && !buffer.is_empty() && !self.0.get_mut().fill_buf()?.is_empty() {
            return Err(io::Error::other("bytes after the end of the stream"));
        }
        Ok(read)
    }
}
