//! Saving images.

use std::path::Path;

use super::{Format, Image, ImageError, PngDepth, exr, output, png};
use crate::volume::npy;

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
    /// replaces, without set-uid and set-gid, and its owner and group where the user may give files to these. Symbolic links are followed; pipes and devices are written directly.
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
        self.encode_described(path, depth, None)
    }

    /// The bytes of a file with a text that describes it, of ASCII alone, where the format has room for one. The pixels are those of [`Image::encode`].
    pub(crate) fn encode_described(
        &self,
        path: &Path,
        depth: PngDepth,
        text: Option<&str>,
    ) -> Result<Vec<u8>, ImageError> {
        // The encoders trust this.
        if self.pixels.len() as u64 != u64::from(self.width) * u64::from(self.height) {
            let source = "pixels do not fill width × height".into();
            return Err(ImageError::Encode { path: path.to_owned(), source });
        }
        match Format::of(path)? {
            Format::Png => png::encode(self, depth, text).map_err(Into::into),
            Format::Exr => exr::encode(self, text).map_err(Into::into),
            Format::Npy => Ok(self.npy()),
        }
        .map_err(|source| ImageError::Encode { path: path.to_owned(), source })
    }

    fn npy(&self) -> Vec<u8> {
        let shape = [u64::from(self.height), u64::from(self.width), 4];
        npy::encode(&shape, self.pixels.iter().flatten().copied())
    }
}
