//! Saving images.

use std::path::Path;

use super::{Format, Image, ImageError, output};

/// Bits per channel of a PNG file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PngDepth {
    /// 8 bits.
    #[default]
    Eight,
    /// 16 bits.
    Sixteen,
}

impl Image {
    /// Checks that [`Image::save`] knows the extension of a file, before a long render.
    ///
    /// # Errors
    /// If the extension is unknown.
    pub fn check_format(path: &Path) -> Result<(), ImageError> {
        Format::of(path).map(|_| ())
    }

    /// Saves the image by the file's extension: `.png` (straight alpha, `depth` bits), or `.exr` or `.npy` (f32 premultiplied RGBA; NPY has
    /// shape height × width × 4). A regular file is written to a temporary file that is then renamed, with the permissions of the file it
    /// replaces. Symbolic links are followed; pipes and devices are written directly.
    ///
    /// # Errors
    /// If the extension is unknown or the file cannot be written.
    pub fn save(&self, path: &Path, depth: PngDepth) -> Result<(), ImageError> {
        let bytes = self.encode(path, depth)?;
        output::write(path, &bytes).map_err(|source| ImageError::Io { path: path.to_owned(), source })
    }

    /// The bytes that [`Image::save`] writes into a file.
    ///
    /// # Errors
    /// If the extension is unknown or the image cannot be encoded.
    pub fn encode(&self, path: &Path, depth: PngDepth) -> Result<Vec<u8>, ImageError> {
        match Format::of(path)? {
            Format::Png => self.encode_as(path, self.straight(depth), ::image::ImageFormat::Png),
            Format::Exr => self.encode_as(path, self.float(), ::image::ImageFormat::OpenExr),
            Format::Npy => self.npy().map_err(|source| ImageError::Io { path: path.to_owned(), source }),
        }
    }

    fn encode_as(
        &self,
        path: &Path,
        image: Option<::image::DynamicImage>,
        format: ::image::ImageFormat,
    ) -> Result<Vec<u8>, ImageError> {
        let mut bytes = std::io::Cursor::new(Vec::new());
        let size_mismatch = || std::io::Error::other("pixels do not fill width × height");
        image
            .ok_or_else(|| ::image::ImageError::IoError(size_mismatch()))
            .and_then(|image| image.write_to(&mut bytes, format))
            .map_err(|source| ImageError::Encode { path: path.to_owned(), source })?;
        Ok(bytes.into_inner())
    }

    /// Integer channels with straight alpha.
    fn straight(&self, depth: PngDepth) -> Option<::image::DynamicImage> {
        let (width, height) = (self.width, self.height);
        match depth {
            PngDepth::Eight => {
                let channels = self.straight_channels(255).flatten().map(|channel| channel as u8).collect();
                ::image::RgbaImage::from_raw(width, height, channels).map(Into::into)
            }
            PngDepth::Sixteen => {
                let channels = self.straight_channels(u16::MAX).flatten().collect();
                ::image::ImageBuffer::from_raw(width, height, channels).map(::image::DynamicImage::ImageRgba16)
            }
        }
    }

    /// Each pixel with straight alpha, its channels rounded to steps of 1/`full`; black where alpha is 0.
    pub fn straight_channels(&self, full: u16) -> impl Iterator<Item = [u16; 4]> {
        let full = f32::from(full);
        self.pixels.iter().map(move |&[r, g, b, a]| {
            let scale = if a > 0.0 { a.recip() } else { 0.0 };
            [r * scale, g * scale, b * scale, a].map(|channel| (channel * full).round().clamp(0.0, full) as u16)
        })
    }

    fn float(&self) -> Option<::image::DynamicImage> {
        let channels = self.pixels.as_flattened().to_vec();
        ::image::Rgba32FImage::from_raw(self.width, self.height, channels).map(Into::into)
    }

    fn npy(&self) -> std::io::Result<Vec<u8>> {
        use npyz::WriterBuilder;
        let mut bytes = Vec::new();
        let shape = [u64::from(self.height), u64::from(self.width), 4];
        let mut writer = npyz::WriteOptions::new().default_dtype().shape(&shape).writer(&mut bytes).begin_nd()?;
        writer.extend(self.pixels.as_flattened())?;
        writer.finish()?;
        Ok(bytes)
    }
}
