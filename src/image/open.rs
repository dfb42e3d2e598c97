//! Opening images. Like any input, a file is trusted only as far as its bytes can hold what it claims.

use std::path::Path;

use ::exr::meta::BlockDescription;
use ::exr::meta::header::Header;

use super::png::Png;
use super::{Format, Image, ImageError, exr};
use crate::volume::{Access, ReadOptions, VolumeError, npy};

/// The maximum expansion of a byte in a PNG or EXR file: deflate's, the best compression that they use.
pub(crate) const MAX_EXPANSION: u64 = 1032;

impl Image {
    /// Opens an image by the file's extension: `.png` of any type, `.exr`, or `.npy` as [`Image::save`] writes it (f32, shape
    /// height × width × 4, in either order). Without alpha in the file, the image is opaque.
    ///
    /// # Errors
    /// If the extension is unknown, the file cannot be read or holds no such image, or the image needs more memory than
    /// [`ReadOptions::memory`] allows by default.
    pub fn open(path: &Path) -> Result<Self, ImageError> {
        Self::open_with(path, &ReadOptions::default())
    }

    /// Like [`Image::open`], with a folder that files must lie in and a memory limit.
    ///
    /// # Errors
    /// As for [`Image::open`], and if the options do not allow it.
    pub fn open_with(path: &Path, options: &ReadOptions) -> Result<Self, ImageError> {
        let format = Format::of(path)?;
        let access = Access::new(options).map_err(of_volume)?;
        match format {
            Format::Png => Self::decode_png(path, &access),
            Format::Exr => Self::decode_exr(path, &access),
            Format::Npy => Self::decode_npy(path, &access),
        }
    }

    fn decode_png(path: &Path, access: &Access) -> Result<Self, ImageError> {
        let failed = |source: ::png::DecodingError| ImageError::Decode { path: path.to_owned(), source: source.into() };
        let bytes = read(path, access)?;
        let png = Png::new(&bytes).map_err(failed)?;
        let [width, height] = png.size();
        check_size(path, png.size(), (bytes.len(), png.bits_per_pixel(), png.channel_bytes()), access)?;
        let mut pixels = png.pixels().map_err(failed)?;
        for [r, g, b, a] in &mut pixels {
            (*r, *g, *b) = (*r * *a, *g * *a, *b * *a);
        }
        Ok(Self { width, height, pixels })
    }

    fn decode_exr(path: &Path, access: &Access) -> Result<Self, ImageError> {
        let failed = |source: ::exr::error::Error| ImageError::Decode { path: path.to_owned(), source: source.into() };
        let bytes = read(path, access)?;
        check_blocks(path, &bytes)?;
        for header in exr::headers(&bytes).map_err(failed)? {
            for size in [header.layer_size, header.shared_attributes.display_window.size] {
                let size = [size.width(), size.height()].map(|side| u32::try_from(side).unwrap_or(u32::MAX));
                let channel_bytes = pixels_of(size).saturating_mul(size_of::<[f32; 4]>() as u64);
                // At least three half floats.
                check_size(path, size, (bytes.len(), 3 * 16, channel_bytes), access)?;
            }
        }
        exr::decode(&bytes).map_err(failed)
    }

    /// An array of rows of pixels of channels, read by the volume reader as slices of rows of voxels.
    fn decode_npy(path: &Path, access: &Access) -> Result<Self, ImageError> {
        let array = npy::array(path, access).map_err(of_volume)?;
        let [channels, width, height] = array.dims.to_array();
        if channels != 4 {
            let found = format!("({height}, {width}, {channels})");
            return Err(content(path, "shape", found, "(height, width, 4)".to_owned()));
        }
        if array.kind != crate::volume::SampleType::F32 {
            return Err(content(path, "descr", array.kind.to_string(), "float32".to_owned()));
        }
        Ok(Self { width, height, pixels: array.values.as_slice().chunks(4).map(|pixel| pixel.run(0)).collect() })
    }
}

/// Checks that no block of an EXR file claims more than the file's bytes can hold: decoders allocate a whole block first.
pub(crate) fn check_blocks(path: &Path, bytes: &[u8]) -> Result<(), ImageError> {
    let failed = |source: ::exr::error::Error| ImageError::Decode { path: path.to_owned(), source: source.into() };
    let most = u128::from(MAX_EXPANSION) * bytes.len() as u128;
    let block_bytes = |header: &Header| {
        let pixels = match header.blocks {
            BlockDescription::Tiles(tiles) => tiles.tile_size.width() as u128 * tiles.tile_size.height() as u128,
            BlockDescription::ScanLines => {
                header.compression.scan_lines_per_block() as u128 * header.layer_size.width() as u128
            }
        };
        header.channels.bytes_per_pixel as u128 * pixels
    };
    let headers = exr::headers(bytes).map_err(failed)?;
    match headers.iter().map(block_bytes).max() {
        Some(block) if block > most => {
            let found = format!("a block of {block} bytes in {} bytes", bytes.len());
            Err(content(path, "size", found, format!("at most {most} bytes")))
        }
        _ => Ok(()),
    }
}

fn pixels_of([width, height]: [u32; 2]) -> u64 {
    u64::from(width) * u64::from(height)
}

/// Checks that a file can hold the pixels that it claims, given its length, their bits before compression and the bytes of all channels; and that
/// they fit into memory.
fn check_size(
    path: &Path,
    [width, height]: [u32; 2],
    (length, bits_per_pixel, channel_bytes): (usize, u64, u64),
    access: &Access,
) -> Result<(), ImageError> {
    let pixels = pixels_of([width, height]);
    let most = 8 * MAX_EXPANSION * length as u64 / bits_per_pixel.max(1);
    if pixels > most {
        let found = format!("{width} × {height} pixels in {length} bytes");
        return Err(content(path, "size", found, format!("at most {most} pixels")));
    }
    // Two copies: as in the file, and as floats.
    let memory = channel_bytes.saturating_add(pixels.saturating_mul(size_of::<[f32; 4]>() as u64));
    access.reserve(path, "size", format_args!("{width} × {height} pixels"), memory).map_err(of_volume)
}

/// The bytes of a regular file; a pipe or a device might never end.
pub(crate) fn read(path: &Path, access: &Access) -> Result<Vec<u8>, ImageError> {
    let path = &*access.resolve(path).map_err(of_volume)?;
    let failed = |source| ImageError::Io { path: path.to_owned(), source };
    // The kind of file is checked before opening, because opening a pipe would wait for its writer.
    if !std::fs::metadata(path).map_err(failed)?.is_file() {
        let found = "a directory, pipe or device".to_owned();
        return Err(content(path, "file", found, "a regular file".to_owned()));
    }
    std::fs::read(path).map_err(failed)
}

/// The image error for an error of the volume reader.
pub(crate) fn of_volume(error: VolumeError) -> ImageError {
    match error.into_parts() {
        Ok((path, source)) => ImageError::Io { path, source },
        Err([origin, field, found, allowed]) => content(Path::new(&origin), &field, found, allowed),
    }
}

pub(crate) fn content(path: &Path, what: &str, found: String, allowed: String) -> ImageError {
    ImageError::Content { path: path.to_owned(), what: what.to_owned(), found, allowed }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use ::exr::prelude::*;

    use super::{Image, ImageError};

    /// A small tiled image whose header is changed to claim tiles of 2¹³ × 2¹³ pixels.
    #[test]
    fn blocks_of_exr_files_are_no_larger_than_the_file_can_hold() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("tiles.exr");
        let channels = SpecificChannels::rgba(|_: Vec2<usize>| (0.5_f32, 0.25_f32, 1.0_f32, 1.0_f32));
        let blocks = Blocks::Tiles(Vec2(4, 4));
        let encoding = Encoding { compression: Compression::ZIP16, blocks, line_order: LineOrder::Increasing };
        let layer = Layer::new((4, 4), LayerAttributes::named("layer"), encoding, channels);
        ::exr::prelude::Image::from_layer(layer).write().non_parallel().to_file(&path).unwrap();
        assert_eq!(Image::open(&path).unwrap().pixels, [[0.5, 0.25, 1.0, 1.0]; 16]);

        let mut bytes = std::fs::read(&path).unwrap();
        // The attribute's name, its type, its size, and the tiles' width and height.
        let attribute = b"tiles\0tiledesc\0";
        let at = bytes.windows(attribute.len()).position(|window| window == attribute).unwrap() + attribute.len() + 4;
        bytes[at..at + 4].copy_from_slice(&(1_u32 << 13).to_le_bytes());
        bytes[at + 4..at + 8].copy_from_slice(&(1_u32 << 13).to_le_bytes());
        std::fs::write(&path, bytes).unwrap();
        let error = Image::open(&path).unwrap_err();
        assert!(matches!(&error, ImageError::Content { found, .. } if found.starts_with("a block of ")), "{error}");
    }
}
