//! DICOM: a folder with the slices of one series, or one file of one or more frames.
//!
//! The position of slices along their normal gives their order and spacing. They must lie on one line; if the line is not along the
//! normal, as with a tilted gantry, the volume is sheared; if their distances differ, it is resampled. Each slice's own rescale slope and intercept are
//! applied. A folder with several series is read as the largest; several images at each place are times or channels.
//!
//! Files are parsed here, not by `dicom-object` and `dicom-pixeldata`, which allocate whatever length an element states, recurse as
//! deep as sequences nest, and index past the end of damaged frames.

mod bytes;
mod codecs;
mod dataset;
mod elements;
mod frames;
mod groups;
mod image;
mod marks;
mod palette;
mod segmentation;
mod segments;
mod series;
mod stacks;
mod table;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use self::frames::Assumed;
use self::groups::{Chosen, Slice};
use self::image::{Image, Opened};
use self::series::Series;
use self::stacks::Stacks;
use super::VolumeError;
use super::access::Access;
use super::error::volume::invalid;
use super::grid::{SIZES, dims_of};
use super::loaded::{Legend, Loaded};
use super::orientation::Orientation;
use super::samples::Samples;
use super::series::apart;
use crate::parallel;
use crate::parallel::prelude::*;

/// Reads the frames of one file.
pub(super) fn read(path: &Path, access: &Access) -> Result<Loaded, VolumeError> {
    let Some(opened) = Image::open(path, access)? else {
        return Err(invalid(path, "PixelData", "no such element", "an image"));
    };
    let chosen = groups::choose(path, vec![opened], access)?;
    if chosen.slices.len() == 1 && chosen.segments().is_none() {
        log::warn!("{}: one slice; a folder with all slices of a series is read as one volume", path.display());
    }
    assemble(path, chosen, access)
}

/// Reads the slices of a series, each in a file of its own.
pub(super) fn read_folder(folder: &Path, files: &[PathBuf], access: &Access) -> Result<Loaded, VolumeError> {
    let opened: Result<Vec<_>, _> = files.par_iter().map(|path| Image::open(path, access)).collect();
    let opened: Vec<Opened> = opened?.into_iter().flatten().collect();
    assemble(folder, groups::choose(folder, opened, access)?, access)
}

fn assemble(path: &Path, chosen: Chosen, access: &Access) -> Result<Loaded, VolumeError> {
    if chosen.segments().is_some() {
        return segmentation::assemble(path, chosen, access);
    }
    let Chosen { images, slices, listed } = chosen;
    let Series { stacks, lattice, even } = Series::of(path, &images, slices, access)?;
    let count = stacks.stacks[0].len();
    let (origin, first) = (stacks.stacks[0][0].position, &images[stacks.stacks[0][0].image]);
    let components = first.pixels.samples;
    let sizes = [u64::from(first.pixels.columns), u64::from(first.pixels.rows), count as u64];
    let [columns, rows, _] = sizes;
    // Those of a colour count as voxels along x while they are read.
    let sides = [columns * u64::from(components), rows, count as u64];
    let wrong_sizes = || invalid(path, "Rows, Columns, slices", format!("{sizes:?}"), SIZES);
    let dims = dims_of(sides).ok_or_else(wrong_sizes)?;
    let (several, selection) = (stacks.series(), access.selection());
    if components > 1 && several.channels > 1 {
        return Err(invalid(path, "channels", format!("{} of colours", several.channels), "colours in one channel"));
    }
    several.check(path, selection)?;
    let read: Vec<&[Slice]> = several
        .channels(selection)
        .map(|channel| stacks.stacks[several.block(channel, selection) as usize].as_slice())
        .collect();
    let kind = first.kind();
    let rescale_of = |slice: &Slice| Some(slice.rescale).filter(|&rescale| rescale != [1.0, 0.0] && components == 1);
    let all_read = || read.iter().copied().flatten();
    let rescale = all_read().find_map(rescale_of);
    let all = Samples { kind, dims, big_endian: false, rescale, z_fastest: false };
    let mut values = access.wanted().none();
    for slices in &read {
        all.reserve(path, access)?;
        // One slice per thread at a time, because codecs are slow.
        for slices in slices.chunks(parallel::current_num_threads()) {
            let frames: Vec<_> =
                slices.par_iter().map(|slice| images[slice.image].frame(slice.frame, access)).collect();
            for (slice, frame) in slices.iter().zip(frames) {
                let image = &images[slice.image];
                let big_endian = cfg!(target_endian = "big");
                let samples =
                    Samples { kind: image.kind(), dims, big_endian, rescale: rescale_of(slice), z_fastest: false };
                access.note_rounding(samples.append(&image.path, &frame?, &mut values)?);
            }
        }
    }
    values.shrink_to_fit();
    let values = apart(values, components.into()).map_err(all.too_many(path))?;
    let is_indexed = first.palette.is_some();
    let (dims, values) = match even {
        None => (dims, values),
        Some(even) => {
            let even = if is_indexed { even.nearest() } else { even };
            let resampled = dims_of([sides[0], rows, even.places.len() as u64]).ok_or_else(wrong_sizes)?;
            let bytes = u64::from(resampled.element_product()) * access.wanted().alone() * read.len() as u64;
            access.reserve(path, groups::POSITION, format!("{} slices", even.places.len()), bytes)?;
            let inner = columns as usize * rows as usize;
            let values = even.resampled(&values, inner, count).map_err(all.too_many(path))?;
            (resampled, values)
        }
    };
    let dims = dims.with_x(dims.x / u32::from(components));
    let series = match components {
        1 => several,
        _ => super::series::Series::of_colors(components.into(), several.times),
    };
    if let Some(assumed) = first.assumed {
        let (path, elements, z) = (path.display(), assumed.names(), lattice.spacing.z);
        log::warn!("{path}: no {elements}: frames are taken to be stacked {z} apart");
    }
    let orientation = Orientation::of_lps(lattice.axes, origin);
    let orientation = Some(orientation).filter(|_| matches!(first.assumed, None | Some(Assumed::Steps)));
    let unit = Some("mm".to_owned()).filter(|_| first.assumed != Some(Assumed::Grid));
    let types: BTreeSet<&str> = all_read()
        .map(|slice| images[slice.image].frames[slice.frame].rescale_type.as_deref().unwrap_or("none"))
        .collect();
    if types.len() > 1 {
        let types: Vec<&str> = types.into_iter().collect();
        log::warn!("{}: RescaleType: {}: values are not all in one unit", path.display(), types.join(", "));
    }
    let is_rescaled = all_read().any(|slice| slice.rescale != [1.0, 0.0]);
    let is_shared = all_read().all(|slice| images[slice.image].palette == first.palette);
    if is_indexed && (is_rescaled || !is_shared) {
        log::warn!("{}: palettes differ, or indices are rescaled: no colour map is offered", path.display());
    }
    let palette = first.palette.clone().filter(|_| is_shared && !is_rescaled);
    let Stacks { channels: channel_names, times: time_names, .. } = stacks;
    let value_unit = first.value_unit.clone();
    let loaded = Loaded {
        spacing: Some(lattice.spacing),
        unit,
        value_unit,
        orientation,
        legends: vec![Legend::of_palette(palette)],
        series,
        channel_names,
        time_names,
        series_names: listed,
        ..Loaded::new(dims, kind, values)
    };
    lattice.straighten(path, groups::POSITION, loaded, access)
}
