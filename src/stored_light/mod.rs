//! Light sheets of a scene in a file (SPEC §14), so that processes that draw frames or parts of the scene need not each make them.
//!
//! ```text
//! scene ─ of ────→ both stacks; a hash of matter (volume, transfer functions, cuts); where each stack's light comes from
//! file  ─ open ──→ the same, to the bit
//! both  ─ lights → the light of a scene that has the same matter and the same light; any other is refused
//! ```

#[cfg(feature = "codecs")]
mod description;
#[cfg(feature = "codecs")]
mod file;
mod stored;

pub use stored::StoredLight;
pub(crate) use stored::explicit;
