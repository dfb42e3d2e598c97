//! PNG files: straight alpha, integers.

use std::io::Cursor;

use ::png::{BitDepth, ColorType, Compression, Decoder, DecodingError, Encoder, EncodingError, Transformations};

use super::Image;
use super::format::KEYWORD;
#[cfg(feature = "golden")]
use super::format::MAX_TEXT;

/// Bits per channel of a PNG file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PngDepth {
    /// 8 bits.
    #[default]
    Eight,
    /// 16 bits.
    Sixteen,
}

/// The bytes of a file with these channels, red, green, blue and alpha for each pixel, and a text that describes it.
pub(super) fn encode(image: &Image, depth: PngDepth, text: Option<&str>) -> Result<Vec<u8>, EncodingError> {
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, image.width, image.height);
    encoder.set_color(ColorType::Rgba);
    // The default takes thirty times as long, about as long as drawing a frame, for files that are up to a fifth shorter.
    encoder.set_compression(Compression::Fast);
    let channels = match depth {
        PngDepth::Eight => {
            encoder.set_depth(BitDepth::Eight);
            image.straight_channels(255).flatten().map(|channel| channel as u8).collect()
        }
        PngDepth::Sixteen => {
            encoder.set_depth(BitDepth::Sixteen);
            image.straight_channels(u16::MAX).flatten().flat_map(u16::to_be_bytes).collect::<Vec<u8>>()
        }
    };
    if let Some(text) = text {
        encoder.add_itxt_chunk(KEYWORD.to_owned(), text.to_owned())?;
    }
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&channels)?;
    writer.finish()?;
    Ok(bytes)
}

/// The text that describes a file, before its pixels or behind them, where other programs may put it.
#[cfg(feature = "golden")]
pub(super) fn text(bytes: &[u8]) -> Result<Option<String>, DecodingError> {
    let mut reader = Decoder::new(Cursor::new(bytes)).read_info()?;
    let find = |reader: &::png::Reader<Cursor<&[u8]>>| {
        let mut chunk = reader.info().utf8_text.iter().find(|chunk| chunk.keyword == KEYWORD)?.clone();
        Some(chunk.decompress_text_with_limit(MAX_TEXT).and_then(|()| chunk.get_text()))
    };
    if let Some(text) = find(&reader) {
        return text.map(Some);
    }
    reader.finish()?;
    find(&reader).transpose()
}

/// A file whose header has been read.
pub(super) struct Png<'a> {
    reader: ::png::Reader<Cursor<&'a [u8]>>,
}

impl<'a> Png<'a> {
    /// Reads the header.
    pub(super) fn new(bytes: &'a [u8]) -> Result<Self, DecodingError> {
        let mut decoder = Decoder::new(Cursor::new(bytes));
        // Palettes become colours, less than eight bits become eight, a transparent colour becomes alpha.
        decoder.set_transformations(Transformations::EXPAND);
        Ok(Self { reader: decoder.read_info()? })
    }

    /// Width and height.
    pub(super) fn size(&self) -> [u32; 2] {
        let (width, height) = self.reader.info().size();
        [width, height]
    }

    /// The bytes of all channels.
    pub(super) fn channel_bytes(&self) -> u64 {
        self.reader.output_buffer_size().map_or(u64::MAX, |bytes| bytes as u64)
    }

    /// Bits of a pixel in the file before compression.
    pub(super) fn bits_per_pixel(&self) -> u64 {
        self.reader.info().bits_per_pixel() as u64
    }

    /// All pixels, straight, from 0 to 1.
    pub(super) fn pixels(mut self) -> Result<Vec<[f32; 4]>, DecodingError> {
        let mut bytes = vec![0; self.reader.output_buffer_size().unwrap_or(0)];
        self.reader.next_frame(&mut bytes)?;
        let (color, depth) = self.reader.output_color_type();
        let channels: Vec<f32> = match depth {
            BitDepth::Sixteen => bytes
                .as_chunks()
                .0
                .iter()
                .map(|&pair| f32::from(u16::from_be_bytes(pair)) / f32::from(u16::MAX))
                .collect(),
            _ => bytes.iter().map(|&byte| f32::from(byte) / f32::from(u8::MAX)).collect(),
        };
        Ok(channels.chunks_exact(color.samples()).map(|pixel| rgba(color, pixel)).collect())
    }
}

/// A pixel's channels; opaque without alpha.
fn rgba(color: ColorType, pixel: &[f32]) -> [f32; 4] {
    match (color, pixel) {
        (ColorType::GrayscaleAlpha, &[gray, alpha]) => [gray, gray, gray, alpha],
        (_, &[gray]) => [gray, gray, gray, 1.0],
        (_, &[red, green, blue]) => [red, green, blue, 1.0],
        (_, &[red, green, blue, alpha]) => [red, green, blue, alpha],
        _ => [0.0; 4],
    }
}
