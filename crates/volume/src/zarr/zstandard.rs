//! Zstandard, of whole chunks and of blocks in Blosc.

use ruzstd::decoding::FrameDecoder;

/// Decodes frames of Zstandard and returns the number of bytes.
pub(super) fn zstandard(code: &[u8], into: &mut [u8]) -> Result<usize, String> {
    // Writers that do not know a chunk's length state a larger window, of which the decoder allocates all.
    const WINDOW: u64 = 8 << 20;
    let mut decoder = FrameDecoder::new();
    decoder.set_max_window_size(WINDOW.max(into.len() as u64));
    decoder.decode_all(code, into).map_err(|error| error.to_string())
}
