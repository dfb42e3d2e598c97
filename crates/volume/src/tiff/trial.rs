//! A trial decoding, which measures what a compressed strip or tile really holds.
//!
//! The decoder allocates what the directory states. If that is unusually much, the strip is first decoded without being stored.

use std::io::{self, BufRead, Read};

use flate2::bufread::ZlibDecoder;
use weezl::{BitOrder, LzwStatus, decode::Configuration};

/// The codes of compressions.
const LZW: u16 = 5;
const DEFLATE: [u16; 2] = [8, 32946];
const PACK_BITS: u16 = 32773;

/// Whether a code of this length is so short for `bytes` decoded bytes that it should be decoded on trial first.
pub(super) fn is_suspicious(code: u64, bytes: u64) -> bool {
    bytes > (16 << 20) + 4 * code
}

/// Whether the code decodes to at least `bytes` bytes. Code that cannot be decoded at all yields 0 bytes.
pub(super) fn holds(code: impl BufRead, compression: u16, bytes: u64) -> io::Result<bool> {
    let held = match compression {
        LZW => lzw(code, bytes),
        PACK_BITS => pack_bits(code, bytes),
        method if DEFLATE.contains(&method) => io::copy(&mut ZlibDecoder::new(code).take(bytes), &mut io::sink()),
        _ => return Ok(false),
    };
    match held {
        Ok(held) => Ok(held >= bytes),
        // Errors of the operating system have an OS error code; others mean damage.
        Err(error) if error.raw_os_error().is_none() => Ok(false),
        Err(error) => Err(error),
    }
}

fn lzw(mut code: impl BufRead, bytes: u64) -> io::Result<u64> {
    let mut decoder = Configuration::with_tiff_size_switch(BitOrder::Msb, 8).with_yield_on_full_buffer(true).build();
    let mut scratch = vec![0; 1 << 16];
    let mut held = 0;
    while held < bytes {
        let result = decoder.decode_bytes(code.fill_buf()?, &mut scratch);
        code.consume(result.consumed_in);
        held += result.consumed_out as u64;
        match result.status.map_err(io::Error::other)? {
            LzwStatus::Ok => {}
            LzwStatus::NoProgress | LzwStatus::Done => break,
        }
    }
    Ok(held)
}

fn pack_bits(code: impl BufRead, bytes: u64) -> io::Result<u64> {
    let mut held = 0;
    let mut code = code.bytes();
    while held < bytes {
        let Some(count) = code.next().transpose()? else { break };
        match count {
            0..=127 => {
                let literals = u64::from(count) + 1;
                held += code.by_ref().take(literals as usize).count() as u64;
            }
            128 => {}
            129..=255 => {
                code.next().transpose()?;
                held += 257 - u64::from(count);
            }
        }
    }
    Ok(held)
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use std::io::Write;

    use super::*;

    #[test]
    fn what_code_holds() {
        let zeros = vec![0; 100_000];
        let lzw = weezl::encode::Encoder::with_tiff_size_switch(BitOrder::Msb, 8).encode(&zeros).unwrap();
        let mut deflate = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
        deflate.write_all(&zeros).unwrap();
        let deflate = deflate.finish().unwrap();
        let pack_bits = [129, 0].repeat(781).into_iter().chain([31]).chain([0; 32]).collect::<Vec<u8>>();
        for (compression, code) in [(LZW, lzw), (DEFLATE[1], deflate), (PACK_BITS, pack_bits)] {
            assert!(holds(code.as_slice(), compression, 100_000).unwrap(), "{compression}");
            assert!(!holds(code.as_slice(), compression, 100_001).unwrap(), "{compression}");
            assert!(!holds(&code[..code.len() / 2], compression, 100_000).unwrap(), "{compression}");
            assert!(!holds(&b"\xff\xffno code"[..], compression, 100_000).unwrap(), "{compression}");
        }
    }
}
