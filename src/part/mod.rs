//! Parts of an image (SPEC §11): some slabs, some pixels, or both, drawn anywhere and at any time, that merge exactly into the whole image.
//!
//! [`Headless::render_part`](crate::headless::Headless::render_part) draws a part of a scene's image, and [`Image::merge`](crate::Image::merge) puts the parts
//! together.
//!
//! ```
//! use sheetsplat::headless::{Backend, Headless, HeadlessOptions};
//! use sheetsplat::scene::VolumeSource;
//! use sheetsplat::settings::{Region, Window};
//! use sheetsplat::{Image, Scene};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let settings = ["image={width=64,height=64}".to_owned(), "splatting.opacity_threshold=1".to_owned()];
//! let scene = Scene::from_volume(VolumeSource::Builtin("head:48".to_owned()), &settings)?;
//! let headless = Headless::new(&HeadlessOptions::default().with_backend(Backend::Cpu))?;
//! let region = Region::whole([64, 64]);
//! let front = headless.render_part(&scene, &Window { slabs: -1000..0, region })?;
//! let back = headless.render_part(&scene, &Window { slabs: 0..1000, region })?;
//! let image = Image::merge([back, front])?;
//! assert_eq!(image.pixels.len(), 64 * 64);
//! # Ok(())
//! # }
//! ```

#[cfg(feature = "codecs")]
mod channels;
mod check;
mod content;
#[cfg(feature = "codecs")]
mod description;
#[cfg(feature = "codecs")]
mod exr;
#[cfg(feature = "codecs")]
mod file;
pub(crate) mod fingerprint;
mod identity;
mod mean;
mod merge;
#[cfg(feature = "codecs")]
mod npz;
mod resolve;
mod split;

#[cfg(feature = "codecs")]
pub(crate) use channels::hash_of;
#[cfg(any(feature = "cpu", feature = "gpu"))]
pub(crate) use check::check_sheets;
pub(crate) use check::{adds_up, check};
pub use content::{Content, Extreme};
pub use identity::{Identity, Part};
pub use mean::MeanTables;
pub(crate) use mean::note_labels;
pub use merge::MergeError;
#[cfg(feature = "golden")]
pub(crate) use merge::resolved;
#[cfg(feature = "codecs")]
pub(crate) use npz::archive;
#[cfg(feature = "cpu")]
pub(crate) use resolve::Resolver;
pub use split::split;
