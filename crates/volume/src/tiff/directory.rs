//! Checks of a file's first directory.
//!
//! The decoder reads it before limits can be set and allocates as many values as its entries promise, so the entries are checked first.

use std::io::{self, BufReader, ErrorKind, Read, Seek, SeekFrom};

use super::super::file::File;

/// The maximum number of values of an entry in a file of this size: strips have an offset and a length each.
pub(super) fn most_values(file_bytes: u64) -> u64 {
    file_bytes / 6 + 256
}

/// A tag that may have any number of values; it is read separately.
const DESCRIPTION: u16 = 270;
/// The descriptions that are looked at.
const MAX_DESCRIPTIONS: usize = 4;
const XMP: u16 = 700;
const PRIVATE: u16 = 32768;

/// The first entry that has too many values, and their number; `None` if every entry is short enough or the file is not a TIFF.
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

/// An entry of a directory.
struct Entry {
    tag: u64,
    kind: u64,
    values: u64,
    /// The position of its value, if that is short enough, or else of the value's position.
    at: u64,
    value_or_offset: u64,
    /// The bytes that a value may take in the entry.
    room: u64,
    big_endian: bool,
}

/// Visits the entries of the directory at `directory`, until one has a result.
fn visit<T>(
    file: &mut (impl Read + Seek),
    directory: u64,
    mut result: impl FnMut(Entry) -> Option<T>,
) -> io::Result<Option<T>> {
    let mut magic = [0; 4];
    file.rewind()?;
    file.read_exact(&mut magic)?;
    let (big_endian, is_big) = (magic[0] == b'M', magic.contains(&43));
    let (offset, count) = if is_big { (8, 8) } else { (4, 2) };
    file.seek(SeekFrom::Start(directory))?;
    for _ in 0..number(file, count, big_endian)? {
        let tag = number(file, 2, big_endian)?;
        let kind = number(file, 2, big_endian)?;
        let values = number(file, offset, big_endian)?;
        let at = file.stream_position()?;
        let value_or_offset = number(file, offset, big_endian)?;
        let entry = Entry { tag, kind, values, at, value_or_offset, room: offset as u64, big_endian };
        if let Some(result) = result(entry) {
            return Ok(Some(result));
        }
    }
    Ok(None)
}

/// The position of the low byte of a tag's value, in the directory at `directory`, if the tag has one 16-bit value.
pub(super) fn low_byte_of(file: &mut (impl Read + Seek), directory: u64, tag: u16) -> io::Result<Option<u64>> {
    /// The type code of 16-bit values.
    const SHORT: u64 = 3;
    visit(file, directory, |entry| {
        let is_it = (entry.tag, entry.kind, entry.values) == (tag.into(), SHORT, 1);
        is_it.then_some(entry.at + u64::from(entry.big_endian))
    })
}

/// The position and length of the text of every description in the directory at `directory`, in the order of the entries: some programs write two.
pub(super) fn descriptions(file: &mut (impl Read + Seek), directory: u64) -> io::Result<Vec<(u64, u64)>> {
    /// The type codes of bytes and of text.
    const BYTES: [u64; 2] = [1, 2];
    let mut found = Vec::new();
    visit(file, directory, |Entry { tag, kind, values, at, value_or_offset, room, .. }| -> Option<()> {
        if tag == u64::from(DESCRIPTION) && BYTES.contains(&kind) && found.len() < MAX_DESCRIPTIONS {
            found.push((if values > room { value_or_offset } else { at }, values));
        }
        None
    })?;
    Ok(found)
}

fn number(file: &mut impl Read, bytes: usize, big_endian: bool) -> io::Result<u64> {
    let mut number = [0; 8];
    file.read_exact(&mut number[..bytes])?;
    if big_endian {
        number[..bytes].reverse();
    }
    Ok(u64::from_le_bytes(number))
}
