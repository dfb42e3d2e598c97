//! Opening images.

use std::path::Path;

use super::{Format, Image, ImageError};

impl Image {
    /// Opens an image by the file's extension: `.png` of any type, `.exr`, or `.npy` as [`Image::save`] writes it (f32 of
    /// shape height × width × 4). Where a file has no alpha, the image is opaque.
    ///
    /// # Errors
    /// If the extension is unknown, or the file cannot be read or holds no such image.
    pub fn open(path: &Path) -> Result<Self, ImageError> {
        let format = Format::of(path)?;
        let bytes = std::fs::read(path).map_err(|source| ImageError::Io { path: path.to_owned(), source })?;
        match format {
            Format::Png => {
                let mut image = Self::decode(path, &bytes, ::image::ImageFormat::Png)?;
                for pixel in &mut image.pixels {
                    let [r, g, b, a] = *pixel;
                    *pixel = [r * a, g * a, b * a, a];
                }
                Ok(image)
            }
            Format::Exr => Self::decode(path, &bytes, ::image::ImageFormat::OpenExr),
            Format::Npy => Self::decode_npy(path, &bytes),
        }
    }

    /// Channels as the file has them, 0 to 1 where they are integers.
    fn decode(path: &Path, bytes: &[u8], format: ::image::ImageFormat) -> Result<Self, ImageError> {
        let image = ::image::load_from_memory_with_format(bytes, format)
            .map_err(|source| ImageError::Decode { path: path.to_owned(), source: source.into() })?
            .into_rgba32f();
        let (width, height) = image.dimensions();
        Ok(Self { width, height, pixels: image.into_raw().as_chunks().0.to_vec() })
    }

    fn decode_npy(path: &Path, bytes: &[u8]) -> Result<Self, ImageError> {
        let content = |what, found: String, allowed: &str| ImageError::Content {
            path: path.to_owned(),
            what,
            found,
            allowed: allowed.to_owned(),
        };
        let failed = |source: std::io::Error| ImageError::Decode { path: path.to_owned(), source: source.into() };
        let file = npyz::NpyFile::new(bytes).map_err(failed)?;
        let found = format!("{:?}", file.shape());
        let wrong_shape = || content("shape", found, "[height, width, 4]");
        let &[height, width, 4] = file.shape() else { return Err(wrong_shape()) };
        let (Ok(width), Ok(height)) = (u32::try_from(width), u32::try_from(height)) else { return Err(wrong_shape()) };
        if file.order() != npyz::Order::C {
            return Err(content("fortran_order", "True".to_owned(), "False"));
        }
        let descr = file.dtype().descr();
        let channels: npyz::NpyReader<f32, _> = file.data().map_err(|_| content("descr", descr, "'<f4' or '>f4'"))?;
        let channels = channels.collect::<Result<Vec<_>, _>>().map_err(failed)?;
        // The shape's product may have wrapped around.
        if channels.len() as u64 / 4 != u64::from(width) * u64::from(height) {
            return Err(content("data", format!("{} values", channels.len()), "height · width · 4"));
        }
        Ok(Self { width, height, pixels: channels.as_chunks().0.to_vec() })
    }
}
