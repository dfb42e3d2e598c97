//! Blosc chunks: <https://github.com/Blosc/c-blosc/blob/main/README_CHUNK_FORMAT.rst>.
//!
//! A chunk is a header of 16 bytes, the positions of its blocks, and the blocks. A block is one compressed stream, or one for each byte of an element
//! where the bytes of elements are sorted ("shuffled") by their place.

use std::io::Read;

use flate2::read::ZlibDecoder;

/// The size of the header.
const HEADER: usize = 16;
/// Elements of more bytes, and blocks in which a byte of all elements takes fewer bytes, are not split.
const MAX_SPLITS: usize = 16;
const MIN_SPLIT: usize = 128;

/// Bits of the header's flags.
const BYTE_SHUFFLE: u8 = 1;
const STORED: u8 = 2;
const BIT_SHUFFLE: u8 = 4;
const NOT_SPLIT: u8 = 16;

/// Decodes a chunk of at most `limit` bytes. The error says what is wrong with it.
pub(super) fn decode(chunk: &[u8], limit: usize) -> Result<Vec<u8>, String> {
    let header: &[u8; HEADER] = chunk.first_chunk().ok_or("a chunk shorter than its header")?;
    let [flags, element] = [header[2], header[3]];
    let [bytes, block_bytes, _] = [4, 8, 12].map(|at| number(chunk, at).unwrap_or(0) as usize);
    if bytes > limit {
        return Err(format!("{bytes} bytes, more than the {limit} that it should have"));
    }
    if flags & STORED != 0 {
        let stored = chunk[HEADER..].get(..bytes).ok_or("fewer bytes than the header states")?;
        return Ok(stored.to_vec());
    }
    if bytes == 0 {
        return Ok(Vec::new());
    }
    if block_bytes == 0 {
        return Err("blocks of no bytes".to_owned());
    }
    let element = usize::from(element).max(1);
    let mut decoded = vec![0; bytes];
    let mut scratch = vec![0; block_bytes.min(bytes)];
    for (index, block) in decoded.chunks_mut(block_bytes).enumerate() {
        let at = number(chunk, HEADER + 4 * index).ok_or("fewer blocks than the header states")? as usize;
        let code = chunk.get(at..).ok_or("a block beyond the end")?;
        let is_split = flags & NOT_SPLIT == 0 && element <= MAX_SPLITS && block.len() == block_bytes;
        let is_split = is_split && block_bytes / element >= MIN_SPLIT && block_bytes.is_multiple_of(element);
        let streams = if is_split { element } else { 1 };
        let sorted = &mut scratch[..block.len()];
        decode_block(code, flags >> 5, streams, sorted)?;
        if flags & BYTE_SHUFFLE != 0 && element > 1 {
            unshuffle_bytes(sorted, element, block);
        } else if flags & BIT_SHUFFLE != 0 && (block.len() / element).is_multiple_of(8) {
            unshuffle_bits(sorted, element, block);
        } else {
            block.copy_from_slice(sorted);
        }
    }
    Ok(decoded)
}

/// Decodes the streams of a block, each preceded by its length.
fn decode_block(mut code: &[u8], compressor: u8, streams: usize, block: &mut [u8]) -> Result<(), String> {
    for stream in block.chunks_mut(block.len() / streams) {
        let length = number(code, 0).ok_or("a stream without its length")? as usize;
        let bytes = code[4..].get(..length).ok_or("a stream beyond the end")?;
        code = &code[4 + length..];
        if length == stream.len() {
            stream.copy_from_slice(bytes);
            continue;
        }
        let expected = stream.len();
        let written = match compressor {
            0 => blosc_lz(bytes, stream).ok_or("a damaged BloscLZ stream")?,
            1 => lz4_flex::block::decompress_into(bytes, stream).map_err(|error| error.to_string())?,
            3 => ZlibDecoder::new(bytes).read_exact(stream).map(|()| expected).map_err(|error| error.to_string())?,
            4 => super::zstandard::zstandard(bytes, stream)?,
            2 => return Err("Snappy, which is not read".to_owned()),
            other => return Err(format!("compressor {other}")),
        };
        if written != expected {
            return Err(format!("{written} bytes in a stream of {expected}"));
        }
    }
    Ok(())
}

/// Puts the bytes of elements, sorted by their place in the element, together. Bytes after the last whole element keep their places.
pub(super) fn unshuffle_bytes(sorted: &[u8], element: usize, into: &mut [u8]) {
    let count = sorted.len() / element;
    let whole = count * element;
    for (place, bytes) in sorted[..whole].chunks_exact(count.max(1)).enumerate() {
        for (target, &byte) in into[place..].iter_mut().step_by(element).zip(bytes) {
            *target = byte;
        }
    }
    into[whole..].copy_from_slice(&sorted[whole..]);
}

/// Puts the bits of elements, sorted by their place in the element, together.
fn unshuffle_bits(sorted: &[u8], element: usize, into: &mut [u8]) {
    let count = sorted.len() / element;
    let whole = count * element;
    into[..whole].fill(0);
    for (place, bits) in sorted[..whole].chunks_exact((count / 8).max(1)).enumerate() {
        let (byte, bit) = (place / 8, place % 8);
        for (group, &packed) in bits.iter().enumerate() {
            for within in 0..8 {
                into[(8 * group + within) * element + byte] |= (packed >> within & 1) << bit;
            }
        }
    }
    into[whole..].copy_from_slice(&sorted[whole..]);
}

/// Decodes a BloscLZ stream and returns the number of bytes; `None` if it is damaged or longer than `into`.
fn blosc_lz(code: &[u8], into: &mut [u8]) -> Option<usize> {
    /// The largest distance in 13 bits; a further one follows in 16 bits.
    const LAST_NEAR: usize = 8191;
    let mut code = code.iter().copied();
    let mut written = 0;
    let mut control = code.next()? & 31;
    loop {
        if control < 32 {
            let count = usize::from(control) + 1;
            for target in into.get_mut(written..written + count)? {
                *target = code.next()?;
            }
            written += count;
        } else {
            let mut count = usize::from(control >> 5) + 2;
            let high = usize::from(control & 31) << 8;
            if count == 9 {
                loop {
                    let more = code.next()?;
                    count += usize::from(more);
                    if more != 255 {
                        break;
                    }
                }
            }
            let low = usize::from(code.next()?);
            let mut distance = high + low + 1;
            if distance == LAST_NEAR + 1 {
                distance = LAST_NEAR + 1 + (usize::from(code.next()?) << 8) + usize::from(code.next()?);
            }
            let from = written.checked_sub(distance)?;
            if written + count > into.len() {
                return None;
            }
            // Byte by byte, because the stretch may overlap itself.
            for at in 0..count {
                into[written + at] = into[from + at];
            }
            written += count;
        }
        match code.next() {
            Some(next) => control = next,
            None => return Some(written),
        }
    }
}

/// The unsigned little-endian 32-bit integer at a position.
fn number(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..)?.first_chunk().map(|&bytes| u32::from_le_bytes(bytes))
}
