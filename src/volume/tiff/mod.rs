//! TIFF files: a stack of pages in one file, or a folder of slices. BigTIFF too; as they are, or by LZW, Deflate or PackBits.
//!
//! Spacing is what ImageJ or OME say in the description, else what the resolution says. What no page has room for, the distance
//! between pages, is then that between columns. Values are those of the file, whatever it says is black.

mod description;
mod directory;
mod pages;
mod run;
mod trial;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::DVec3;

use self::description::Calibration;
use self::pages::{Page, Pages};
use super::VolumeError;
use super::loaded::Loaded;
use super::samples::{SIZES, Samples, Stream, Voxel, dims_of};
use super::source::{Source, invalid};

/// Reads the pages of one file.
pub(super) fn read<T: Voxel>(path: &Path) -> Result<Loaded<T>, VolumeError> {
    let mut pages = Pages::open(path)?;
    let calibration = Calibration::of(&mut pages)?;
    let mut slices = Slices::new(path, &pages, &calibration)?;
    if let Some(count) = calibration.slices.filter(|&count| count > 1 && !pages.has_more()) {
        // ImageJ writes what is too large for one TIFF so: one directory, and the slices one after the other.
        let offset = pages.contiguous()?;
        let samples = slices.samples(count)?;
        let mut stream = Stream::raw(Source::open(path)?)?;
        stream.skip(offset)?;
        let samples = Samples { big_endian: pages.is_big_endian(), ..samples };
        slices.values = stream.samples(&samples, true)?;
        slices.count = count;
    } else {
        slices.add(&mut pages)?;
        while pages.next()? {
            slices.add(&mut pages)?;
        }
    }
    match calibration.slices {
        Some(count) if count != slices.count => {
            Err(invalid(path, "pages", slices.count, format!("{count}, as the description says")))
        }
        _ => slices.finish(&calibration),
    }
}

/// Reads a folder of files of one page each, in this order.
pub(super) fn read_folder<T: Voxel>(path: &Path, files: &[PathBuf]) -> Result<Loaded<T>, VolumeError> {
    let mut kinds: Vec<(Page, Vec<&PathBuf>)> = Vec::new();
    for file in files {
        let pages = Pages::open(file)?;
        if pages.has_more() {
            return Err(invalid(file, "pages", "more than one", "one, as files of a folder are slices"));
        }
        match kinds.iter_mut().find(|(page, _)| *page == pages.page) {
            Some((_, files)) => files.push(file),
            None => kinds.push((pages.page, vec![file])),
        }
    }
    let [(_, slices_of_one_kind)] = kinds.as_slice() else {
        let name = |path: &Path| path.file_name().unwrap_or_default().display().to_string();
        let shown = kinds.iter().map(|(page, paths)| format!("{} of {page} ({}, …)", paths.len(), name(paths[0])));
        let found = shown.collect::<Vec<_>>().join(", ");
        return Err(invalid(path, "slices", found, "slices of one size and type"));
    };
    let mut first = Pages::open(slices_of_one_kind[0])?;
    let calibration = Calibration::of(&mut first)?;
    let mut slices = Slices::new(path, &first, &calibration)?;
    run::check(path, files)?;
    for file in slices_of_one_kind {
        slices.add(&mut Pages::open(file)?)?;
    }
    slices.finish(&calibration)
}

/// Slices of one size and type, as they come.
struct Slices<'a, T> {
    path: &'a Path,
    page: Page,
    rescale: Option<[f64; 2]>,
    count: u32,
    values: Vec<T>,
}

impl<'a, T: Voxel> Slices<'a, T> {
    fn new(path: &'a Path, pages: &Pages, calibration: &Calibration) -> Result<Self, VolumeError> {
        Ok(Self { path, page: pages.page, rescale: calibration.rescale, count: 0, values: Vec::new() })
    }

    fn samples(&self, count: u32) -> Result<Samples, VolumeError> {
        let Page { size: [width, height], kind } = self.page;
        let Some(dims) = dims_of([width, height, count]) else {
            return Err(invalid(self.path, "sizes", format!("{count} pages of {}", self.page), SIZES));
        };
        Ok(Samples { kind, dims, big_endian: cfg!(target_endian = "big"), rescale: self.rescale, z_fastest: false })
    }

    fn add(&mut self, pages: &mut Pages) -> Result<(), VolumeError> {
        if pages.page != self.page {
            let allowed = format!("{}, as the first page", self.page);
            return Err(invalid(&pages.path, &pages.name(), pages.page, allowed));
        }
        let samples = self.samples(self.count + 1)?;
        let bytes = pages.bytes()?;
        samples.append(&pages.path, &bytes, &mut self.values)?;
        self.count += 1;
        Ok(())
    }

    fn finish(mut self, calibration: &Calibration) -> Result<Loaded<T>, VolumeError> {
        let Samples { dims, kind, .. } = self.samples(self.count)?;
        self.values.shrink_to_fit();
        let spacing = calibration.spacing.map(|[x, y]| {
            let z = calibration.between_slices.unwrap_or_else(|| {
                let unit = calibration.unit.as_deref().unwrap_or_default();
                log::warn!("{}: no distance between slices is given: taken to be {x} {unit}", self.path.display());
                x
            });
            DVec3::new(x, y, z)
        });
        Ok(Loaded {
            dims,
            kind,
            spacing,
            unit: calibration.unit.clone(),
            orientation: None,
            label_names: BTreeMap::new(),
            values: self.values,
        })
    }
}
