//! Frames as codecs have them.

use jpeg_decoder::{Decoder, PixelFormat};

use super::super::samples::MAX_EXPANSION;

/// How frames are encoded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Codec {
    None,
    Rle,
    Jpeg,
}

impl Codec {
    /// By the transfer syntax.
    pub(super) fn of(transfer_syntax: &str) -> Option<Self> {
        Some(match transfer_syntax.strip_prefix("1.2.840.10008.1.2")? {
            "" | ".1" | ".2" => Self::None,
            ".5" => Self::Rle,
            // Baseline, extended, and lossless ones.
            ".4.50" | ".4.51" | ".4.57" | ".4.70" => Self::Jpeg,
            _ => return None,
        })
    }

    /// What [`Self::of`] takes.
    pub(super) const ALLOWED: &str = "1.2.840.10008.1.2 with nothing or .1, .2 (uncompressed), .5 (RLE), .4.50, .4.51, .4.57, .4.70 (JPEG) behind it";

    /// A frame of so many columns, rows and bytes per sample, in the machine's byte order.
    ///
    /// # Errors
    /// What it is instead.
    pub(super) fn decode(self, code: Vec<u8>, [columns, rows]: [u16; 2], sample: usize) -> Result<Vec<u8>, String> {
        let pixels = usize::from(columns) * usize::from(rows);
        if (code.len() as u64).saturating_mul(MAX_EXPANSION) < (pixels * sample) as u64 {
            return Err(format!("{} bytes of code for {pixels} pixels", code.len()));
        }
        match self {
            Self::None => Ok(code),
            Self::Rle => rle(&code, pixels, sample),
            Self::Jpeg => jpeg(&code, [columns, rows], sample),
        }
    }
}

/// Planes of bytes, the most significant ones first, each in PackBits behind a header of their offsets.
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
        // Known to be that long only now.
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

/// At most so many bytes.
fn unpack_bits(mut code: &[u8], limit: usize) -> Vec<u8> {
    let mut bytes = Vec::new();
    while let Some((&count, rest)) = code.split_first() {
        match count {
            // So many bytes, as they are.
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
        _ => return Err("colours".to_owned()),
    };
    if [info.width, info.height] != size || bytes != sample {
        return Err(format!("{} × {} samples of {bytes} bytes", info.width, info.height));
    }
    decoder.decode().map_err(|error| error.to_string())
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
