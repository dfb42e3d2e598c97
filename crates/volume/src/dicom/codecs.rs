//! The codecs of compressed frames.

use hayro_jpeg2000::{DecodeSettings, DecoderContext, Image};
use jpeg_decoder::{Decoder, PixelFormat};

use super::super::stream::MAX_EXPANSION;

/// The encoding of frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Codec {
    None,
    Rle,
    Jpeg,
    Jpeg2000,
}

/// The frame size in bytes that any code may decode to, however short: JPEG 2000 spends next to nothing on a slice of air.
const SMALL: u64 = 1 << 20;

impl Codec {
    /// The codec of a transfer syntax.
    ///
    /// # Errors
    /// The transfer syntax, with its name if it is known.
    pub(super) fn of(transfer_syntax: &str) -> Result<Self, String> {
        let name = match transfer_syntax.strip_prefix("1.2.840.10008.1.2").unwrap_or("none") {
            "" | ".1" | ".1.99" | ".2" => return Ok(Self::None),
            ".5" => return Ok(Self::Rle),
            // Baseline, extended and lossless JPEG.
            ".4.50" | ".4.51" | ".4.57" | ".4.70" => return Ok(Self::Jpeg),
            ".4.90" | ".4.91" => return Ok(Self::Jpeg2000),
            ".4.80" | ".4.81" => " (JPEG-LS)",
            ".4.92" | ".4.93" => " (JPEG 2000 of several components)",
            ".4.201" | ".4.202" | ".4.203" => " (High-Throughput JPEG 2000)",
            other if other.starts_with(".4.10") => " (a video)",
            _ => "",
        };
        Err(format!("{transfer_syntax}{name}"))
    }

    /// What [`Self::of`] accepts, for errors.
    pub(super) const ALLOWED: &str = "1.2.840.10008.1.2 with nothing or .1, .2 (uncompressed), .1.99 (deflated), .5 (RLE), .4.50, .4.51, .4.57, .4.70 (JPEG), .4.90, .4.91 (JPEG 2000) behind it";

    /// A decoded frame of `columns` × `rows` samples of `sample` bytes, in the machine's byte order.
    ///
    /// # Errors
    /// A description of what is wrong with the code.
    pub(super) fn decode(self, code: Vec<u8>, [columns, rows]: [u16; 2], sample: usize) -> Result<Vec<u8>, String> {
        let pixels = usize::from(columns) * usize::from(rows);
        let bytes = (pixels * sample) as u64;
        let is_small = self == Self::Jpeg2000 && bytes <= SMALL;
        if (code.len() as u64).saturating_mul(MAX_EXPANSION) < bytes && !is_small {
            return Err(format!("{} bytes of code for {pixels} pixels", code.len()));
        }
        match self {
            Self::None => Ok(code),
            Self::Rle => rle(&code, pixels, sample),
            Self::Jpeg => jpeg(&code, [columns, rows], sample),
            Self::Jpeg2000 => jpeg_2000(&code, [columns, rows], sample),
        }
    }
}

/// RLE: planes of bytes, the most significant first, each in PackBits after a header with their offsets.
fn rle(code: &[u8], pixels: usize, sample: usize) -> Result<Vec<u8>, String> {
    let (header, _) = code.split_at_checked(64).ok_or("no header of 64 bytes")?;
    let words: Vec<usize> = header.as_chunks().0.iter().map(|&word| u32::from_le_bytes(word) as usize).collect();
    if words[0] != sample {
        return Err(format!("{} segments, not {sample}", words[0]));
    }
    let mut bytes = Vec::new();
    for plane in 1..=sample {
        let end = if plane < sample { words[plane + 1] } else { code.len() };
        let segment = code.get(words[plane]..end).ok_or("a segment out of the frame")?;
        let unpacked = unpack_bits(segment, pixels);
        if unpacked.len() != pixels {
            return Err(format!("{} samples in a segment, not {pixels}", unpacked.len()));
        }
        // Memory is allocated only once the length is known to be right.
        if bytes.is_empty() {
            bytes = vec![0; pixels * sample];
        }
        let place = if cfg!(target_endian = "big") { plane - 1 } else { sample - plane };
        for (byte, to) in unpacked.iter().zip(bytes.iter_mut().skip(place).step_by(sample)) {
            *to = *byte;
        }
    }
    Ok(bytes)
}

/// Decodes PackBits, up to `limit` bytes.
fn unpack_bits(mut code: &[u8], limit: usize) -> Vec<u8> {
    let mut bytes = Vec::new();
    while let Some((&count, rest)) = code.split_first() {
        match count {
            // A run of literal bytes.
            0..=127 => {
                let (literal, after) = rest.split_at(rest.len().min(usize::from(count) + 1));
                bytes.extend_from_slice(literal);
                code = after;
            }
            128 => code = rest,
            129..=255 => {
                let Some((&byte, after)) = rest.split_first() else { break };
                bytes.extend(std::iter::repeat_n(byte, 257 - usize::from(count)));
                code = after;
            }
        }
        if bytes.len() >= limit {
            bytes.truncate(limit);
            break;
        }
    }
    bytes
}

fn jpeg(code: &[u8], size: [u16; 2], sample: usize) -> Result<Vec<u8>, String> {
    let mut decoder = Decoder::new(code);
    decoder.set_max_decoding_buffer_size(usize::from(size[0]) * usize::from(size[1]) * sample);
    decoder.read_info().map_err(|error| error.to_string())?;
    let info = decoder.info().ok_or("no frame")?;
    let bytes = match info.pixel_format {
        PixelFormat::L8 => 1,
        PixelFormat::L16 => 2,
        PixelFormat::RGB24 => 3,
        _ => return Err("colours".to_owned()),
    };
    if [info.width, info.height] != size || bytes != sample {
        return Err(format!("{} × {} samples of {bytes} bytes", info.width, info.height));
    }
    decoder.decode().map_err(|error| error.to_string())
}

/// A codestream of one component.
fn jpeg_2000(code: &[u8], size: [u16; 2], sample: usize) -> Result<Vec<u8>, String> {
    // The decoder does not report whether samples are signed; the codestream's first segment does.
    let &[0xff, 0x4f, 0xff, 0x51, ref segment @ ..] = code else { return Err("no codestream".to_owned()) };
    let Some(&[0, 1, depth]) = segment.get(36..39) else { return Err("several components".to_owned()) };
    let (is_signed, bits) = (depth & 0x80 != 0, u32::from(depth & 0x7f) + 1);
    if bits > 16 || bits as usize > 8 * sample {
        return Err(format!("samples of {bits} bits"));
    }
    let settings = DecodeSettings { strict: true, ..DecodeSettings::default() };
    let image = Image::new(code, &settings).map_err(|error| error.to_string())?;
    if [image.width(), image.height()] != size.map(u32::from) {
        return Err(format!("{} × {} samples", image.width(), image.height()));
    }
    let mut context = DecoderContext::default();
    let decoded = image.decode(&mut context).map_err(|error| error.to_string())?;
    let [component] = decoded.components() else { return Err("several components".to_owned()) };
    // The decoder also gives signed samples as offsets from the minimum. Lossy ones may lie outside the range.
    let least = if is_signed { 1 << (bits - 1) } else { 0 };
    let largest = ((1_i32 << bits) - 1) as f32;
    let numbers = component.samples().iter().map(|value| value.round().clamp(0.0, largest) as i32 - least);
    let mut bytes = Vec::with_capacity(component.samples().len() * sample);
    for number in numbers {
        let number = number.to_le_bytes();
        bytes.extend_from_slice(&number[..sample]);
        if cfg!(target_endian = "big") {
            let first = bytes.len() - sample;
            bytes[first..].reverse();
        }
    }
    Ok(bytes)
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;

    #[test]
    fn packed_bits() {
        assert_eq!(unpack_bits(&[2, 1, 2, 3, 128, 254, 7, 0, 9], 100), [1, 2, 3, 7, 7, 7, 9]);
        assert_eq!(unpack_bits(&[129, 5], 3), [5, 5, 5]);
        for damaged in [&[5, 1, 2][..], &[255], &[]] {
            assert!(unpack_bits(damaged, 100).len() < 3, "{damaged:?}");
        }
    }

    #[test]
    fn damaged_frames_are_told() {
        let rle = |code: &[u8]| Codec::Rle.decode(code.to_vec(), [2, 1], 2).unwrap_err();
        let mut code = [0; 68];
        assert!(rle(&code[..63]).contains("no header"), "{}", rle(&code[..63]));
        assert!(rle(&code).contains("0 segments, not 2"), "{}", rle(&code));
        (code[0], code[4], code[8]) = (2, 64, 69);
        assert!(rle(&code).contains("a segment out of the frame"), "{}", rle(&code));
        code[8] = 66;
        assert!(rle(&code).contains("1 samples in a segment, not 2"), "{}", rle(&code));
    }
}
