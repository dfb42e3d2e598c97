//! VTK's files of regular and rectilinear grids: XML ImageData (`.vti`) and RectilinearGrid (`.vtr`), and legacy `STRUCTURED_POINTS` and
//! `RECTILINEAR_GRID` (`.vtk`).
//!
//! One array with one component is read; the rest of the file is ignored. VTK's axes have no relation to a patient. A direction matrix
//! rotates the volume as a whole, so it is checked but has no effect.

mod blocks;
mod choice;
mod image_data;
mod legacy;
mod rectilinear;

pub(super) use image_data::read as read_image_data;
pub(super) use legacy::read as read_legacy;
