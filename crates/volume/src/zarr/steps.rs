//! Codecs from bytes to bytes, which never write more than a chunk should hold.

use std::borrow::Cow;
use std::io::Read;

use bzip2::bufread::MultiBzDecoder;
use flate2::bufread::{MultiGzDecoder, ZlibDecoder};

use super::super::VolumeError;
use super::blosc;
use super::json::Json;
use super::zstandard::zstandard;

/// The names of codecs, for errors.
const NAMES: &str =
    "blosc, bz2, gzip, shuffle, zlib, zstd; in version 3 also bytes, crc32c, sharding_indexed, transpose";

/// The bytes of a checksum.
const CHECKSUM: usize = size_of::<u32>();

/// The maximum number of bytes of a chunk that is compressed: no compression makes it that much longer.
pub(super) fn compressed(bytes: u64) -> u64 {
    bytes.saturating_mul(2).saturating_add(1 << 16)
}

/// A codec from bytes to bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Step {
    Checksum,
    /// The first bytes of all elements of some size, then their second bytes, and so on.
    Shuffle(usize),
    Compression(Compression),
}

/// A compression. What else its metadata states concerns only writers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Compression {
    Blosc,
    Bzip2,
    Gzip,
    Zlib,
    Zstandard,
}

/// The names in metadata of versions 2 and 3.
const NAMED: [(&str, Compression); 9] = [
    ("blosc", Compression::Blosc),
    ("bz2", Compression::Bzip2),
    ("numcodecs.bz2", Compression::Bzip2),
    ("gzip", Compression::Gzip),
    ("zlib", Compression::Zlib),
    ("numcodecs.zlib", Compression::Zlib),
    ("numcodecs.blosc", Compression::Blosc),
    ("zstd", Compression::Zstandard),
    ("numcodecs.zstd", Compression::Zstandard),
];

impl Step {
    /// A codec that both versions have.
    pub(super) fn read(name: &Json, configuration: &Json) -> Result<Self, VolumeError> {
        let text = name.text().unwrap_or_default();
        if ["shuffle", "numcodecs.shuffle"].contains(&text) {
            let size = configuration.get("elementsize");
            let element = size.integer().filter(|&size| size > 0).and_then(|size| usize::try_from(size).ok());
            return element.map(Self::Shuffle).ok_or_else(|| size.invalid("a positive number of bytes"));
        }
        Compression::named(text).map(Self::Compression).ok_or_else(|| name.invalid(NAMES))
    }

    /// The maximum number of bytes of the code of some bytes, of a chunk whose code has at most `chunk` bytes if it is compressed.
    pub(super) fn bound(self, bytes: u64, chunk: u64) -> u64 {
        match self {
            Self::Checksum => bytes.saturating_add(CHECKSUM as u64),
            Self::Shuffle(_) => bytes,
            Self::Compression(_) => bytes.max(chunk),
        }
    }

    /// Decodes at most `limit` bytes.
    pub(super) fn decode<'a>(self, code: Cow<'a, [u8]>, limit: u64) -> Result<Cow<'a, [u8]>, String> {
        match self {
            Self::Checksum => {
                let end = code.len().checked_sub(CHECKSUM).ok_or("fewer bytes than a checksum has")?;
                if crc32c::crc32c(&code[..end]).to_le_bytes() != code[end..] {
                    return Err("another checksum (crc32c) than that of the bytes".to_owned());
                }
                Ok(match code {
                    Cow::Borrowed(code) => Cow::Borrowed(&code[..end]),
                    Cow::Owned(mut code) => {
                        code.truncate(end);
                        Cow::Owned(code)
                    }
                })
            }
            Self::Shuffle(element) => {
                if !code.len().is_multiple_of(element) {
                    return Err(format!("{} bytes, shuffled in elements of {element}", code.len()));
                }
                let mut decoded = vec![0; code.len()];
                blosc::unshuffle_bytes(&code, element, &mut decoded);
                Ok(Cow::Owned(decoded))
            }
            Self::Compression(compression) => {
                let decoded = compression.expand(&code, limit).map_err(|error| format!("{compression:?}: {error}"))?;
                Ok(Cow::Owned(decoded))
            }
        }
    }
}

impl Compression {
    pub(super) fn named(name: &str) -> Option<Self> {
        NAMED.into_iter().find(|(known, _)| *known == name).map(|(_, compression)| compression)
    }

    /// Decodes at most `limit` bytes.
    pub(super) fn expand(self, code: &[u8], limit: u64) -> Result<Vec<u8>, String> {
        let all = |reader: &mut dyn Read| -> Result<Vec<u8>, String> {
            let mut decoded = Vec::new();
            // One more, which tells that there are too many.
            let read = reader.take(limit.saturating_add(1)).read_to_end(&mut decoded);
            read.map_err(|error| error.to_string())?;
            Ok(decoded)
        };
        let decoded = match self {
            Self::Blosc => blosc::decode(code, limit as usize)?,
            Self::Bzip2 => all(&mut MultiBzDecoder::new(code))?,
            Self::Gzip => all(&mut MultiGzDecoder::new(code))?,
            Self::Zlib => all(&mut ZlibDecoder::new(code))?,
            Self::Zstandard => {
                let mut decoded = vec![0; limit as usize];
                let written = zstandard(code, &mut decoded)?;
                decoded.truncate(written);
                decoded
            }
        };
        if decoded.len() as u64 > limit {
            return Err(format!("more than the {limit} bytes that it should have"));
        }
        Ok(decoded)
    }
}
