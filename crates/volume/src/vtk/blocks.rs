//! The packing of an array's bytes: base64 text and compressed blocks.

use std::io::{self, BufRead, Read};
use std::{slice, vec};

use flate2::read::ZlibDecoder;

use super::super::stream::MAX_EXPANSION;

/// A compressor, by its name in the file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Compressor {
    Zlib,
    Lz4,
}

impl Compressor {
    /// The maximum ratio of a block's size to its compressed size.
    pub(super) fn max_expansion(self) -> u64 {
        match self {
            Self::Zlib => MAX_EXPANSION,
            // Every byte of a long match adds 255 bytes.
            Self::Lz4 => 255,
        }
    }

    fn decode(self, code: &[u8], size: u64) -> io::Result<Vec<u8>> {
        let damaged = |what: String| io::Error::other(format!("a block of {what}, not of {size} bytes"));
        if (code.len() as u64).saturating_mul(self.max_expansion()) < size {
            return Err(damaged(format!("{} bytes of code", code.len())));
        }
        match self {
            Self::Zlib => {
                let mut block = Vec::new();
                // Reading to the end checks the checksum.
                ZlibDecoder::new(code).take(size + 1).read_to_end(&mut block)?;
                if block.len() as u64 == size { Ok(block) } else { Err(damaged(format!("{} bytes", block.len()))) }
            }
            Self::Lz4 => {
                // The length is known before memory is allocated.
                let decoded = lz4_length(code);
                if decoded != Some(size) {
                    return Err(damaged(format!("{} bytes", decoded.unwrap_or_default())));
                }
                let mut block = vec![0; size as usize];
                let decoded = lz4_flex::block::decompress_into(code, &mut block).map_err(io::Error::other)?;
                if decoded as u64 == size { Ok(block) } else { Err(damaged(format!("{decoded} bytes"))) }
            }
        }
    }
}

/// The length of an LZ4 block, from the lengths of its literals and matches.
fn lz4_length(code: &[u8]) -> Option<u64> {
    let mut code = code.iter();
    let mut total = 0;
    loop {
        let token = *code.next()?;
        let literals = lz4_number(token >> 4, &mut code)?;
        total += literals;
        if literals > 0 {
            code.nth(literals as usize - 1)?;
        }
        // The last literals have no match.
        if code.as_slice().is_empty() {
            return Some(total);
        }
        let _offset = code.nth(1)?;
        total += 4 + lz4_number(token & 15, &mut code)?;
    }
}

/// A 4-bit number that continues after 15, and then after every 255.
fn lz4_number(first: u8, code: &mut slice::Iter<u8>) -> Option<u64> {
    let mut number = u64::from(first);
    let mut goes_on = first == 15;
    while goes_on {
        let byte = *code.next()?;
        number += u64::from(byte);
        goes_on = byte == 255;
    }
    Some(number)
}

/// The type of the numbers in an array's header.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct HeaderType {
    pub(super) bytes: usize,
    pub(super) big_endian: bool,
}

impl HeaderType {
    pub(super) fn read(self, reader: &mut impl Read) -> io::Result<u64> {
        let mut bytes = [0; 8];
        // The bytes are little-endian.
        reader.read_exact(&mut bytes[..self.bytes])?;
        if self.big_endian {
            bytes[..self.bytes].reverse();
        }
        Ok(u64::from_le_bytes(bytes))
    }
}

/// The decompressed bytes of consecutive blocks.
pub(super) struct Blocks<R> {
    reader: R,
    compressor: Compressor,
    /// The compressed and uncompressed sizes of the remaining blocks, in bytes.
    sizes: vec::IntoIter<[u64; 2]>,
    block: Vec<u8>,
    /// The number of consumed bytes of `block`.
    read: usize,
}

impl<R: Read> Blocks<R> {
    /// Reads the header: the number of blocks, their size, the last one's size, and their compressed sizes. The blocks must have `bytes`
    /// bytes in total.
    pub(super) fn new(mut reader: R, header: HeaderType, compressor: Compressor, bytes: u64) -> io::Result<Self> {
        let [count, size, last] = [header.read(&mut reader)?, header.read(&mut reader)?, header.read(&mut reader)?];
        // A last size of 0 stands for a whole block.
        let whole = if last == 0 { count } else { count.saturating_sub(1) };
        if whole.checked_mul(size).and_then(|whole| whole.checked_add(last)) != Some(bytes) {
            let found = format!("{count} blocks of {size} bytes, the last of {last}, not {bytes} bytes");
            return Err(io::Error::other(found));
        }
        let mut sizes = Vec::new();
        // Sizes are appended one by one, because there may be fewer than the count says.
        for block in 0..count {
            sizes.push([header.read(&mut reader)?, if block < whole { size } else { last }]);
        }
        Ok(Self { reader, compressor, sizes: sizes.into_iter(), block: Vec::new(), read: 0 })
    }
}

impl<R> Blocks<R> {
    /// The size of the largest block in bytes.
    pub(super) fn largest(&self) -> u64 {
        self.sizes.as_slice().iter().map(|&[_, size]| size).max().unwrap_or_default()
    }
}

impl<R: Read> Read for Blocks<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while self.read == self.block.len() {
            let Some([compressed, size]) = self.sizes.next() else { return Ok(0) };
            let mut code = Vec::new();
            if self.reader.by_ref().take(compressed).read_to_end(&mut code)? as u64 != compressed {
                return Err(io::ErrorKind::UnexpectedEof.into());
            }
            (self.block, self.read) = (self.compressor.decode(&code, size)?, 0);
        }
        let read = (&self.block[self.read..]).read(buffer)?;
        self.read += read;
        Ok(read)
    }
}

/// The bytes that base64 text encodes, in one or several separately padded pieces. The text ends at an XML tag.
pub(super) struct Base64<R> {
    reader: R,
    group: [u8; 3],
    /// The unread range of `group`.
    left: std::ops::Range<usize>,
}

impl<R: BufRead> Base64<R> {
    pub(super) fn new(reader: R) -> Self {
        Self { reader, group: [0; 3], left: 0..0 }
    }

    /// Decodes the next four characters; `false` at the end.
    fn next_group(&mut self) -> io::Result<bool> {
        let (mut bits, mut characters, mut padding) = (0_u32, 0, 0);
        while characters < 4 {
            let Some(&byte) = self.reader.fill_buf()?.first() else { break };
            if byte == b'<' {
                break;
            }
            self.reader.consume(1);
            let value = match byte {
                b'A'..=b'Z' => byte - b'A',
                b'a'..=b'z' => byte - b'a' + 26,
                b'0'..=b'9' => byte - b'0' + 52,
                b'+' => 62,
                b'/' => 63,
                b'=' => {
                    padding += 1;
                    0
                }
                byte if byte.is_ascii_whitespace() => continue,
                byte => return Err(damaged_base64(format!("\"{}\"", byte.escape_ascii()))),
            };
            if padding > 0 && byte != b'=' {
                return Err(damaged_base64("padding within four characters".to_owned()));
            }
            bits = bits << 6 | u32::from(value);
            characters += 1;
        }
        match (characters, padding) {
            (0, _) => return Ok(false),
            (4, 0..=2) => {}
            _ => return Err(damaged_base64(format!("{characters} characters, {padding} of them padding"))),
        }
        let [_, group @ ..] = bits.to_be_bytes();
        (self.group, self.left) = (group, 0..3 - padding);
        Ok(true)
    }
}

fn damaged_base64(found: String) -> io::Error {
    io::Error::other(format!("{found} in base64 text"))
}

impl<R: BufRead> Read for Base64<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let mut written = 0;
        while written < buffer.len() {
            match self.left.next() {
                Some(at) => {
                    buffer[written] = self.group[at];
                    written += 1;
                }
                None if self.next_group()? => {}
                None => break,
            }
        }
        Ok(written)
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;

    fn decoded(text: &str) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        Base64::new(text.as_bytes()).read_to_end(&mut bytes)?;
        Ok(bytes)
    }

    #[test]
    fn lengths_of_lz4() {
        for length in [0, 1, 12, 13, 14, 15, 16, 300, 5000, 100_000] {
            let bytes: Vec<u8> = (0..length).map(|at: usize| (((at * at) >> 7) & at) as u8).collect();
            let code = lz4_flex::block::compress(&bytes);
            assert_eq!(lz4_length(&code), Some(length as u64));
            assert_ne!(lz4_length(&code[..code.len() - 1]), Some(length as u64));
        }
    }

    #[test]
    fn base64_in_pieces() {
        assert_eq!(decoded("").unwrap(), b"");
        assert_eq!(decoded(" aGVh\nZA== aGVhZHM=aGVhZGVy<more").unwrap(), b"headheadsheader");
        for text in ["aGV", "a===", "aG=h", "aGV*", "====", "aGVhZ<"] {
            assert!(decoded(text).is_err(), "{text}");
        }
    }
}
