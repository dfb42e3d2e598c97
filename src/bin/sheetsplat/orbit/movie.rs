//! Movies: all frames in one file.

use std::io::{self, Write};
use std::path::Path;

use sheetsplat::image::{Image, PngDepth};

use super::y4m::{Chroma, Y4m};

/// Movie formats by extension.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Format {
    Apng,
    Gif,
    Y4m,
}

/// The settings that all frames of a movie share.
pub(super) struct Settings {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) frames: u32,
    pub(super) fps: u16,
    pub(super) depth: PngDepth,
    pub(super) chroma: Chroma,
}

/// Encodes frames one after the other.
pub(super) enum Encoder<W: Write> {
    Apng { writer: png::Writer<W>, depth: PngDepth },
    Gif { encoder: gif::Encoder<W>, size: [u16; 2], fps: u16, added: u64 },
    Y4m(Y4m<W>),
}

impl Format {
    pub(super) fn of(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "apng" => Some(Self::Apng),
            "gif" => Some(Self::Gif),
            "y4m" => Some(Self::Y4m),
            _ => None,
        }
    }

    /// Checks that the format supports the settings.
    ///
    /// # Errors
    /// What was found, and what is allowed.
    pub(super) fn check(self, settings: &Settings) -> Result<(), String> {
        let Settings { width, height, fps, chroma, .. } = *settings;
        let size = format!("image.width × image.height: found {width}×{height}");
        match self {
            Self::Gif if width.max(height) > u32::from(u16::MAX) => {
                Err(format!("{size}, allowed: at most 65535 in a GIF"))
            }
            // Delays are in hundredths of a second, and players slow down delays shorter than two of them.
            Self::Gif if fps > 50 => Err(format!("--fps: found {fps}, allowed: at most 50 in a GIF")),
            Self::Y4m if chroma == Chroma::Halved && (width % 2, height % 2) != (0, 0) => {
                Err(format!("{size}, allowed: even numbers, or --chroma 444"))
            }
            _ => Ok(()),
        }
    }
}

impl<W: Write> Encoder<W> {
    pub(super) fn new(format: Format, settings: &Settings, to: W) -> io::Result<Self> {
        let Settings { width, height, frames, fps, depth, chroma } = *settings;
        match format {
            Format::Apng => {
                let mut encoder = png::Encoder::new(to, width, height);
                encoder.set_color(png::ColorType::Rgba);
                encoder.set_depth(match depth {
                    PngDepth::Eight => png::BitDepth::Eight,
                    PngDepth::Sixteen => png::BitDepth::Sixteen,
                });
                encoder.set_animated(frames, 0)?;
                encoder.set_frame_delay(1, fps)?;
                // A frame replaces the previous one, even where it is transparent.
                encoder.set_blend_op(png::BlendOp::Source)?;
                Ok(Self::Apng { writer: encoder.write_header()?, depth })
            }
            Format::Gif => {
                let size = [width, height].map(|side| u16::try_from(side).unwrap_or(u16::MAX));
                let mut encoder = gif::Encoder::new(to, size[0], size[1], &[]).map_err(io::Error::other)?;
                encoder.set_repeat(gif::Repeat::Infinite).map_err(io::Error::other)?;
                Ok(Self::Gif { encoder, size, fps, added: 0 })
            }
            Format::Y4m => Ok(Self::Y4m(Y4m::new(to, [width, height], fps, chroma)?)),
        }
    }

    pub(super) fn add(&mut self, image: &Image) -> io::Result<()> {
        match self {
            Self::Apng { writer, depth: PngDepth::Eight } => {
                let bytes: Vec<u8> = image.straight_channels(255).flatten().map(|channel| channel as u8).collect();
                Ok(writer.write_image_data(&bytes)?)
            }
            Self::Apng { writer, depth: PngDepth::Sixteen } => {
                let bytes: Vec<u8> = image.straight_channels(u16::MAX).flatten().flat_map(u16::to_be_bytes).collect();
                Ok(writer.write_image_data(&bytes)?)
            }
            Self::Gif { encoder, size: [width, height], fps, added } => {
                // Premultiplied colours equal colours over black.
                let channels = image.pixels.iter().flat_map(|&[r, g, b, _]| [r, g, b]);
                let bytes: Vec<u8> =
                    channels.map(|channel| (channel * 255.0).round().clamp(0.0, 255.0) as u8).collect();
                let mut frame = gif::Frame::from_rgb(*width, *height, &bytes);
                // The delay is the difference of two rounded times, so that errors do not add up.
                let [from, to] = [*added, *added + 1].map(|n| (100 * n + u64::from(*fps) / 2) / u64::from(*fps));
                frame.delay = (to - from) as u16;
                *added += 1;
                encoder.write_frame(&frame).map_err(io::Error::other)
            }
            Self::Y4m(y4m) => y4m.add(image),
        }
    }

    /// Writes the end of the file.
    pub(super) fn finish(self) -> io::Result<()> {
        match self {
            Self::Apng { writer, .. } => Ok(writer.finish()?),
            Self::Gif { encoder, .. } => encoder.into_inner().map(|_| ()).map_err(io::Error::other),
            Self::Y4m(_) => Ok(()),
        }
    }
}
