//! Texts in pictures' files that describe them, and the pixels as files hold them.

use std::path::Path;

use super::format::{Format, MAX_TEXT};
use super::open::{content, of_volume, read};
use super::{Image, ImageError, PngDepth, exr, png};
use crate::volume::{Access, ReadOptions};

/// How a file holds its pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Integers with straight alpha.
    Png(PngDepth),
    /// Floats, premultiplied.
    Float,
}

impl Kind {
    /// The kind of a file with room for a text; `None` without such room.
    pub(crate) fn of(path: &Path, depth: PngDepth) -> Result<Option<Self>, ImageError> {
        Ok(match Format::of(path)? {
            Format::Png => Some(Self::Png(depth)),
            Format::Exr => Some(Self::Float),
            Format::Npy => None,
        })
    }

    /// The channels of an image's pixels as a file holds them: integers, or the bits of floats.
    pub(crate) fn channels(self, image: &Image) -> Vec<[u32; 4]> {
        let full = match self {
            Self::Float => return image.pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect(),
            Self::Png(PngDepth::Eight) => 255,
            Self::Png(PngDepth::Sixteen) => u16::MAX,
        };
        image.straight_channels(full).map(|pixel| pixel.map(u32::from)).collect()
    }

    /// The hash of an image's pixels as a file holds them, as hexadecimal digits. A picture that is opened has that of the one that was saved, whatever
    /// compressed its file; the colour of transparent pixels does not count.
    pub(crate) fn hash(self, image: &Image) -> String {
        let mut hash = blake3::Hasher::new();
        let name: &[u8] = match self {
            Self::Png(PngDepth::Eight) => b"sheetsplat pixels 1 of 8 bits\n",
            Self::Png(PngDepth::Sixteen) => b"sheetsplat pixels 1 of 16 bits\n",
            Self::Float => b"sheetsplat pixels 1 of floats\n",
        };
        hash.update(name).update(&image.width.to_le_bytes()).update(&image.height.to_le_bytes());
        for pixels in self.channels(image).chunks(1 << 14) {
            let bytes: Vec<u8> = pixels.iter().flatten().flat_map(|channel| channel.to_le_bytes()).collect();
            hash.update(&bytes);
        }
        hash.finalize().to_hex().to_string()
    }
}

/// The text that describes a picture's file; `None` if it has none.
///
/// # Errors
/// If the file cannot be read, is no picture of its extension, or the text is too long.
pub(crate) fn text(path: &Path, options: &ReadOptions) -> Result<Option<String>, ImageError> {
    let failed =
        |source: Box<dyn std::error::Error + Send + Sync>| ImageError::Decode { path: path.to_owned(), source };
    let format = Format::of(path)?;
    let access = Access::new(options).map_err(of_volume)?;
    let text = match format {
        Format::Npy => None,
        Format::Png => png::text(&read(path, &access)?).map_err(|error| failed(error.into()))?,
        Format::Exr => exr::text(&read(path, &access)?).map_err(|error| failed(error.into()))?,
    };
    match text {
        Some(text) if text.len() > MAX_TEXT => {
            let found = format!("{} bytes", text.len());
            Err(content(path, "text", found, format!("at most {MAX_TEXT} bytes")))
        }
        text => Ok(text),
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;

    /// Every alpha and many colours, some of them beyond what a file holds.
    fn image() -> Image {
        let pixel = |at: u32| {
            let [alpha, color] = [at % 256, (at * 97) % 256].map(|byte| byte as f32 / 255.0);
            [color * alpha, 1.1 * alpha * alpha, 0.3 * alpha, alpha]
        };
        Image { width: 256, height: 16, pixels: (0..4096).map(pixel).collect() }
    }

    #[test]
    fn a_text_changes_no_pixel_and_a_file_keeps_the_hash_of_its_pixels() {
        let folder = tempfile::tempdir().unwrap();
        let options = ReadOptions::default();
        for (name, depth) in [("8.png", PngDepth::Eight), ("16.png", PngDepth::Sixteen), ("float.exr", PngDepth::Eight)]
        {
            let path = folder.path().join(name);
            let kind = Kind::of(&path, depth).unwrap().unwrap();
            std::fs::write(&path, image().encode(&path, depth).unwrap()).unwrap();
            let plain = Image::open(&path).unwrap();
            assert_eq!(text(&path, &options).unwrap(), None);
            std::fs::write(&path, image().encode_described(&path, depth, Some("a\nb")).unwrap()).unwrap();
            assert_eq!(text(&path, &options).unwrap().as_deref(), Some("a\nb"));
            let mut described = Image::open(&path).unwrap();
            assert_eq!(described, plain);
            assert_eq!(kind.hash(&described), kind.hash(&image()), "{name}");
            described.pixels[300][1] += 0.01;
            assert_ne!(kind.hash(&described), kind.hash(&image()), "{name}");
        }
    }

    #[test]
    fn texts_are_bounded() {
        let folder = tempfile::tempdir().unwrap();
        let long = "x".repeat(MAX_TEXT + 1);
        for name in ["a.png", "a.exr"] {
            let path = folder.path().join(name);
            std::fs::write(&path, image().encode_described(&path, PngDepth::Eight, Some(&long)).unwrap()).unwrap();
            assert!(text(&path, &ReadOptions::default()).is_err(), "{name}");
        }
    }
}
