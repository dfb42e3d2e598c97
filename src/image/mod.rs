//! Rendered images and their files.

pub(crate) mod channels;
#[cfg(feature = "golden")]
pub(crate) mod described;
#[cfg(feature = "codecs")]
mod exr;
#[cfg(feature = "codecs")]
mod format;
#[cfg(feature = "codecs")]
pub(crate) mod open;
#[cfg(feature = "codecs")]
#[doc(hidden)]
pub mod output;
mod pixels;
#[cfg(feature = "codecs")]
mod png;
#[cfg(feature = "codecs")]
mod save;

#[cfg(feature = "codecs")]
use format::Format;
#[cfg(feature = "codecs")]
pub use format::ImageError;
#[cfg(feature = "golden")]
pub(crate) use format::MAX_TEXT;
pub use pixels::Image;
#[cfg(feature = "codecs")]
pub use png::PngDepth;
