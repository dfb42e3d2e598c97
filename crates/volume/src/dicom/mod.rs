//! DICOM: a folder with the slices of one series, or one file of one or more frames.
//!
//! The position of slices along their normal gives their order and spacing. They must lie on one line; if the line is not along the
//! normal, as with a tilted gantry, the volume is sheared. Each slice's own rescale slope and intercept are applied.
//!
//! Files are parsed here, not by `dicom-object` and `dicom-pixeldata`, which allocate whatever length an element states, recurse as
//! deep as sequences nest, and index past the end of damaged frames.

mod bytes;
mod codecs;
mod dataset;
mod elements;
mod image;
mod palette;
mod series;

use std::path::{Path, PathBuf};

use glam::DMat3;

use self::image::Image;
use self::series::Series;
use super::VolumeError;
use super::access::Access;
use super::error::volume::invalid;
use super::grid::{SIZES, dims_of};
use super::loaded::Loaded;
use super::orientation::{Orientation, RAS_FROM_LPS};
use super::samples::Samples;
use super::series::apart;
use super::voxel::{Many, Voxel};
use crate::parallel;
use crate::parallel::prelude::*;

/// Reads the frames of one file.
pub(super) fn read<T: Voxel>(path: &Path, access: &Access) -> Result<Loaded<T>, VolumeError> {
    let Some(image) = Image::open(path, access)? else {
        return Err(invalid(path, "PixelData", "no such element", "an image"));
    };
    if image.frames.len() == 1 {
        log::warn!("{}: one slice; a folder with all slices of a series is read as one volume", path.display());
    }
    assemble(path, vec![image], access)
}

/// Reads the slices of a series, each in a file of its own.
pub(super) fn read_folder<T: Voxel>(
    folder: &Path,
    files: &[PathBuf],
    access: &Access,
) -> Result<Loaded<T>, VolumeError> {
    let images: Result<Vec<_>, _> = files.par_iter().map(|path| Image::open(path, access)).collect();
    let images: Vec<Image> = images?.into_iter().flatten().collect();
    series::check_one(folder, &images)?;
    assemble(folder, images, access)
}

fn assemble<T: Voxel>(path: &Path, images: Vec<Image>, access: &Access) -> Result<Loaded<T>, VolumeError> {
    let Series { slices, lattice } = Series::of(path, &images)?;
    let first = &images[slices[0].image];
    let components = first.pixels.samples;
    let sizes = [u64::from(first.pixels.columns), u64::from(first.pixels.rows), slices.len() as u64];
    let [columns, rows, count] = sizes;
    // Those of a colour count as voxels along x while they are read.
    let sides = [columns * u64::from(components), rows, count];
    let dims = dims_of(sides).ok_or_else(|| invalid(path, "Rows, Columns, slices", format!("{sizes:?}"), SIZES))?;
    let kind = first.pixels.kind;
    let rescale_of =
        |slice: &series::Slice| Some(slice.rescale).filter(|&rescale| rescale != [1.0, 0.0] && components == 1);
    let rescale = slices.iter().find_map(rescale_of);
    let all = Samples { kind, dims, big_endian: false, rescale, z_fastest: false };
    all.reserve::<T>(path, access)?;
    let mut values = T::Many::default();
    // One slice per thread at a time, because codecs are slow.
    for slices in slices.chunks(parallel::current_num_threads()) {
        let frames: Vec<_> = slices.par_iter().map(|slice| images[slice.image].frame(slice.frame, access)).collect();
        for (slice, frame) in slices.iter().zip(frames) {
            let image = &images[slice.image];
            let big_endian = cfg!(target_endian = "big");
            let samples =
                Samples { kind: image.pixels.kind, dims, big_endian, rescale: rescale_of(slice), z_fastest: false };
            samples.append::<T>(&image.path, &frame?, &mut values)?;
        }
    }
    values.shrink_to_fit();
    let values = apart::<T>(values, components.into()).map_err(all.too_many(path))?;
    let dims = dims.with_x(dims.x / u32::from(components));
    let series = match components {
        1 => super::series::Series::default(),
        _ => super::series::Series::of_colors(components.into(), 1),
    };
    let origin = RAS_FROM_LPS * slices[0].position;
    let orientation = Some(Orientation { axes: DMat3::from_diagonal(RAS_FROM_LPS) * lattice.axes, origin });
    let (spacing, unit) = (Some(lattice.spacing), Some("mm".to_owned()));
    let is_rescaled = slices.iter().any(|slice| slice.rescale != [1.0, 0.0]);
    let is_shared = images.iter().all(|image| image.palette == first.palette);
    if first.palette.is_some() && (is_rescaled || !is_shared) {
        log::warn!("{}: palettes differ, or indices are rescaled: no colour map is offered", path.display());
    }
    let palette = first.palette.clone().filter(|_| is_shared && !is_rescaled);
    let value_unit = first.value_unit.clone();
    let loaded = Loaded { spacing, unit, value_unit, orientation, palette, series, ..Loaded::new(dims, kind, values) };
    lattice.straighten(path, series::POSITION, loaded, access)
}
