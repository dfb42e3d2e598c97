//! The first directory of a file.
//!
//! The decoder reads it before limits can be set, and makes room for as many values as its entries promise, so these are looked at
//! before.

use std::fs::File;
use std::io::{self, BufReader, ErrorKind, Read, Seek, SeekFrom};

/// Values of one entry, in a file of so many bytes: strips have an offset and a length each.
pub(super) fn most_values(file_bytes: u64) -> u64 {
    file_bytes / 6 + 256
}

/// Tags that may have any number of values; nobody reads these with the others.
const DESCRIPTION: u16 = 270;
const XMP: u16 = 700;
const PRIVATE: u16 = 32768;

/// The first entry that has too many values, and how many it has; what is no TIFF has none.
pub(super) fn overlong_entry(file: &mut BufReader<File>, file_bytes: u64) -> io::Result<Option<(u16, u64)>> {
    match find(file, most_values(file_bytes)) {
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => Ok(None),
        found => found,
    }
}

fn find(file: &mut BufReader<File>, most: u64) -> io::Result<Option<(u16, u64)>> {
    let mut magic = [0; 4];
    file.read_exact(&mut magic)?;
    let (big_endian, is_big) = (magic[0] == b'M', magic.contains(&43));
    let (offset, count) = if is_big { (8, 8) } else { (4, 2) };
    if is_big {
        file.seek_relative(4)?;
    }
    let first = number(file, offset, big_endian)?;
    file.seek(SeekFrom::Start(first))?;
    for _ in 0..number(file, count, big_endian)? {
        let tag = number(file, 2, big_endian)? as u16;
        let _type = number(file, 2, big_endian)?;
        let values = number(file, offset, big_endian)?;
        let _value_or_offset = number(file, offset, big_endian)?;
        if values > most && tag < PRIVATE && ![DESCRIPTION, XMP].contains(&tag) {
            return Ok(Some((tag, values)));
        }
    }
    Ok(None)
}

/// Where the entry of a tag with one value of 16 bits has the low byte of that, in the directory at `directory`.
pub(super) fn low_byte_of(file: &mut (impl Read + Seek), directory: u64, tag: u16) -> io::Result<Option<u64>> {
    /// The type of values of 16 bits.
    const SHORT: u64 = 3;
    let mut magic = [0; 4];
    file.rewind()?;
    file.read_exact(&mut magic)?;
    let (big_endian, is_big) = (magic[0] == b'M', magic.contains(&43));
    let (offset, count) = if is_big { (8, 8) } else { (4, 2) };
    file.seek(SeekFrom::Start(directory))?;
    for _ in 0..number(file, count, big_endian)? {
        let found = number(file, 2, big_endian)?;
        let kind = number(file, 2, big_endian)?;
        let values = number(file, offset, big_endian)?;
        let at = file.stream_position()?;
        let _value_or_offset = number(file, offset, big_endian)?;
        if (found, kind, values) == (tag.into(), SHORT, 1) {
            return Ok(Some(at + u64::from(big_endian)));
        }
    }
    Ok(None)
}

fn number(file: &mut impl Read, bytes: usize, big_endian: bool) -> io::Result<u64> {
    let mut number = [0; 8];
    file.read_exact(&mut number[..bytes])?;
    if big_endian {
        number[..bytes].reverse();
    }
    Ok(u64::from_le_bytes(number))
}
