//! Rendered images and their files.

#[cfg(feature = "codecs")]
mod format;
#[cfg(feature = "codecs")]
pub(crate) mod open;
#[cfg(feature = "codecs")]
#[doc(hidden)]
pub mod output;
#[cfg(feature = "codecs")]
mod save;

#[cfg(feature = "codecs")]
use format::Format;
#[cfg(feature = "codecs")]
pub use format::ImageError;
#[cfg(feature = "codecs")]
pub use save::PngDepth;

/// An image of f32 premultiplied RGBA, with row 0 at the top. Colours are display-referred (SPEC §3).
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Pixels per row.
    pub width: u32,
    /// Number of rows.
    pub height: u32,
    /// `width · height` pixels, row by row.
    pub pixels: Vec<[f32; 4]>,
}
