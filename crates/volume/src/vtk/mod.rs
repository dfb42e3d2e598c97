//! VTK's files of regular grids: XML ImageData (`.vti`) and legacy `STRUCTURED_POINTS` (`.vtk`).
//!
//! One array with one component is read; the rest of the file is ignored. VTK's axes have no relation to a patient. A direction matrix
//! rotates the volume as a whole, so it is checked but has no effect.

mod blocks;
mod image_data;
mod legacy;

pub(super) use image_data::read as read_image_data;
pub(super) use legacy::read as read_legacy;

/// Warns which one of several arrays is used.
fn warn_of_choice<'a>(path: &std::path::Path, names: impl Iterator<Item = &'a str>, taken: &str) {
    let names: Vec<&str> = names.collect();
    if names.len() > 1 {
        log::warn!("{}: of the arrays {} the volume is {taken}", path.display(), names.join(", "));
    }
}
