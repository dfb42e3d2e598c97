//! VTK's files of regular grids: XML ImageData (`.vti`), and the older `STRUCTURED_POINTS` (`.vtk`).
//!
//! What lies in a file besides one array of one number per voxel is left out. VTK's axes are those of no patient; a direction matrix
//! turns the volume as a whole, so it is checked and has no effect.

mod blocks;
mod image_data;
mod legacy;

pub(super) use image_data::read as read_image_data;
pub(super) use legacy::read as read_legacy;

/// Says which one of several arrays is taken.
fn warn_of_choice<'a>(path: &std::path::Path, names: impl Iterator<Item = &'a str>, taken: &str) {
    let names: Vec<&str> = names.collect();
    if names.len() > 1 {
        log::warn!("{}: of the arrays {} the volume is {taken}", path.display(), names.join(", "));
    }
}
