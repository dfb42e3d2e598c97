//! Golden files: PNGs compressed as far as possible, with the adapter and driver in text chunks.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use super::MadeOn;
use crate::image::{ImageError, output};

const ADAPTER: &str = "Adapter";
const DRIVER: &str = "Driver";

/// Writes 8-bit pixels with straight alpha to a temporary file that is then renamed. Creates the folder if it does not exist.
pub(super) fn write(
    path: &Path,
    [width, height]: [u32; 2],
    pixels: &[[u8; 4]],
    made_on: Option<&MadeOn>,
) -> Result<(), ImageError> {
    let write = || {
        let bytes = encode([width, height], pixels, made_on)?;
        path.parent().map_or(Ok(()), std::fs::create_dir_all)?;
        output::write(path, &bytes)
    };
    write().map_err(|source| ImageError::Io { path: path.to_owned(), source })
}

fn encode([width, height]: [u32; 2], pixels: &[[u8; 4]], made_on: Option<&MadeOn>) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    let opaque = pixels.iter().all(|pixel| pixel[3] == u8::MAX);
    encoder.set_color(if opaque { png::ColorType::Rgb } else { png::ColorType::Rgba });
    encoder.set_compression(png::Compression::High);
    encoder.set_filter(png::Filter::Adaptive);
    if let Some(MadeOn { adapter, driver }) = made_on {
        encoder.add_itxt_chunk(ADAPTER.to_owned(), adapter.clone())?;
        if !driver.is_empty() {
            encoder.add_itxt_chunk(DRIVER.to_owned(), driver.clone())?;
        }
    }
    let mut writer = encoder.write_header()?;
    let channels: Vec<u8> = if opaque {
        pixels.iter().flat_map(|&[r, g, b, _]| [r, g, b]).collect()
    } else {
        pixels.as_flattened().to_vec()
    };
    writer.write_image_data(&channels)?;
    writer.finish()?;
    Ok(bytes)
}

/// The adapter and driver in a file's text chunks; `None` if it is not a PNG or has no such chunks.
pub(super) fn made_on(path: &Path) -> Option<MadeOn> {
    let reader = png::Decoder::new(BufReader::new(File::open(path).ok()?)).read_info().ok()?;
    let text = |keyword: &str| {
        let chunks = &reader.info().utf8_text;
        chunks.iter().find(|chunk| chunk.keyword == keyword && !chunk.compressed)?.get_text().ok()
    };
    Some(MadeOn { adapter: text(ADAPTER)?, driver: text(DRIVER).unwrap_or_default() })
}
