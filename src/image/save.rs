//! Saving images.

use std::io::Write;
use std::path::Path;

use super::{Format, Image, ImageError};

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
    /// Checks that [`Image::save`] knows the extension of a file, so that a long render does not end in vain.
    ///
    /// # Errors
    /// If it does not.
    pub fn check_format(path: &Path) -> Result<(), ImageError> {
        Format::of(path).map(|_| ())
    }

    /// Saves the image by the file's extension: `.png` (straight alpha, `depth` bits), `.exr` or `.npy` (f32
    /// premultiplied RGBA; NPY has shape height × width × 4). Written aside, then renamed.
    ///
    /// # Errors
    /// If the extension is unknown or the file cannot be written.
    pub fn save(&self, path: &Path, depth: PngDepth) -> Result<(), ImageError> {
        let bytes = match Format::of(path)? {
            Format::Png => self.encode(path, self.straight(depth), ::image::ImageFormat::Png)?,
            Format::Exr => self.encode(path, self.float(), ::image::ImageFormat::OpenExr)?,
            Format::Npy => self.npy().map_err(|source| ImageError::Io { path: path.to_owned(), source })?,
        };
        write_aside(path, &bytes).map_err(|source| ImageError::Io { path: path.to_owned(), source })
    }

    fn encode(
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

    /// Every pixel with straight alpha, its channels rounded to steps of 1/`full`; black where nothing is to be seen.
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

/// Writes a file so that it is there whole or not at all: into a temporary file beside it, then renamed.
///
/// # Errors
/// What the operating system says.
pub fn write_aside(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    aside(path, bytes)?.persist(path)?;
    Ok(())
}

/// The first half of [`write_aside`]: the temporary file, which is gone unless it is persisted.
///
/// # Errors
/// What the operating system says.
pub fn aside(path: &Path, bytes: &[u8]) -> std::io::Result<tempfile::NamedTempFile> {
    if path.is_dir() {
        return Err(std::io::ErrorKind::IsADirectory.into());
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    // Temporary files are private by default; an image is as readable as any file the user makes.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file = builder.prefix(".sheetsplat-").tempfile_in(folder)?;
    file.write_all(bytes)?;
    Ok(file)
}
