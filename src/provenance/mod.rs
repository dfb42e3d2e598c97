//! Pictures that tell how they were made, so that anybody can draw them again and compare.
//!
//! ```text
//! scene, volume, files ─ Provenance ─ encode → a PNG or EXR file: the picture, and a text
//! the file             ─ open, scene ───────→ the same scene, with the files that it names found again
//! the file             ─ Verifier ──────────→ the same pixels, or why not
//! ```
//!
//! The text names no folder outside the picture's own: a file that lies elsewhere has its name and its hash.

mod encoded;
mod names;
mod oracle;
mod picture;
mod sources;
mod text;
mod verifier;

pub use oracle::Deviation;
pub use sources::Sources;
pub use text::Provenance;
pub use verifier::{Unverifiable, Verified, Verifier};
