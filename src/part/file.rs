//! Files of parts. Like any input, a file is trusted only as far as its bytes can hold what it claims.

use std::path::Path;

use super::channels::{Decoded, from_channels};
use super::{Content, Part, exr, npz};
use crate::image::open::{content, of_volume, read};
use crate::image::{ImageError, output};
use crate::volume::{Access, Channels, ReadOptions};

/// The formats by extension, ignoring case.
enum Format {
    Exr,
    Npz,
}

impl Format {
    fn of(path: &Path) -> Result<Self, ImageError> {
        let extension = path.extension().and_then(|extension| extension.to_str());
        match extension.map(str::to_ascii_lowercase).as_deref() {
            Some("exr") => Ok(Self::Exr),
            Some("npz") => Ok(Self::Npz),
            _ => {
                let found = extension.map_or("none".to_owned(), |extension| format!("\".{extension}\""));
                Err(content(path, "extension", found, ".exr or .npz for a part of an image".to_owned()))
            }
        }
    }
}

impl Part {
    /// Checks that [`Part::save`] knows the extension of a file, before a long render.
    ///
    /// # Errors
    /// If the extension is unknown.
    pub fn check_format(path: &Path) -> Result<(), ImageError> {
        Format::of(path).map(|_| ())
    }

    /// Opens a part that [`Part::save`] or `sheetsplat render` wrote. The file is its name.
    ///
    /// # Errors
    /// If the file cannot be read, holds no part, or needs more memory than [`ReadOptions::memory`] allows by default.
    pub fn open(path: &Path) -> Result<Self, ImageError> {
        Self::open_with(path, &ReadOptions::default())
    }

    /// Like [`Part::open`], with a folder that files must lie in and a memory limit.
    ///
    /// # Errors
    /// As for [`Part::open`], and if the options do not allow it.
    pub fn open_with(path: &Path, options: &ReadOptions) -> Result<Self, ImageError> {
        let format = Format::of(path)?;
        let access = Access::new(options).map_err(of_volume)?;
        let decoded = match format {
            Format::Exr => exr::decode(path, &read(path, &access)?, &access)?,
            Format::Npz => npz::decode(path, &access)?,
        };
        Ok(Self::of_channels(path.display().to_string(), decoded))
    }

    /// The part that the bytes of an EXR file hold, for programs that send parts without files. Its name is for errors.
    ///
    /// # Errors
    /// If the bytes hold no part, or it needs more memory than [`ReadOptions::memory`] allows by default.
    pub fn from_exr(name: &str, bytes: &[u8]) -> Result<Self, ImageError> {
        let access = Access::new(&ReadOptions::default()).map_err(of_volume)?;
        Ok(Self::of_channels(name.to_owned(), exr::decode(Path::new(name), bytes, &access)?))
    }

    fn of_channels(name: String, (identity, window, channels): Decoded) -> Self {
        let per_image = channels.len() / identity.images;
        // A description has at least one image.
        let contents = Channels::of(channels.chunks(per_image).map(from_channels));
        Self { name, ..Self::named(identity, window, contents.unwrap_or_else(|| Content::default().into())) }
    }

    /// Saves the part by the file's extension: `.exr`, whose data window is the region and whose display window is the whole image, with the
    /// description as a text attribute; or `.npz` with an array `pixels` (height × width × channels) and the description `part.json`. The file appears whole or not at all.
    ///
    /// # Errors
    /// If the extension is unknown or the file cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), ImageError> {
        let bytes = self.encode(path)?;
        output::write(path, &bytes).map_err(|source| ImageError::Io { path: path.to_owned(), source })
    }

    /// The bytes that [`Part::save`] writes into a file.
    ///
    /// # Errors
    /// If the extension is unknown, or the part's pixels do not fill its region.
    pub fn encode(&self, path: &Path) -> Result<Vec<u8>, ImageError> {
        let format = Format::of(path)?;
        let pixels = self.window.region.pixels();
        let extremes = if self.identity.has_extremes() { pixels } else { 0 };
        for of_image in &self.contents {
            if (of_image.colors.len(), of_image.extremes.len()) != (pixels, extremes) {
                let found = format!("{} and {}", of_image.colors.len(), of_image.extremes.len());
                return Err(content(path, "pixels", found, format!("{pixels} and {extremes} extremes")));
            }
        }
        if self.contents.len() != self.identity.images {
            let (found, allowed) = (self.contents.len().to_string(), self.identity.images.to_string());
            return Err(content(path, "images of channels", found, allowed));
        }
        match format {
            Format::Exr => exr::encode(path, self),
            Format::Npz => npz::encode(path, self),
        }
    }
}
