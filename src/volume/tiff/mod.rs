//! TIFF and BigTIFF files: a stack of pages in one file, or a folder of slices, uncompressed or by LZW, Deflate or PackBits.
//!
//! The spacing comes from ImageJ's or OME's description, or else from the resolution, which has no distance between pages: then the
//! distance between columns serves. Values are the file's, whichever it calls black.

mod description;
mod directory;
mod overlay;
mod pages;
mod run;
mod trial;

use std::path::{Path, PathBuf};

use glam::DVec3;

use self::description::Calibration;
use self::pages::{Page, Pages};
use super::VolumeError;
use super::access::Access;
use super::loaded::Loaded;
use super::samples::{SIZES, Samples, Stream, Voxel, dims_of};
use super::source::invalid;

/// Reads the pages of one file.
pub(super) fn read<T: Voxel>(path: &Path, access: &Access) -> Result<Loaded<T>, VolumeError> {
    let mut pages = Pages::open(path, access)?;
    let calibration = Calibration::of(&mut pages)?;
    let mut slices = Slices::new(path, &pages, &calibration)?;
    if let Some(count) = calibration.slices.filter(|&count| count > 1 && !pages.has_more()) {
        // ImageJ writes data too large for TIFF as one directory, followed by all slices.
        let offset = pages.contiguous()?;
        let samples = slices.samples(count)?;
        let mut stream = Stream::raw(access.open(path)?)?;
        stream.skip(offset)?;
        let samples = Samples { big_endian: pages.is_big_endian(), ..samples };
        slices.values = stream.samples(&samples, true)?;
        slices.count = count;
    } else {
        slices.add(&mut pages, access)?;
        while pages.next()? {
            slices.add(&mut pages, access)?;
        }
    }
    match calibration.slices {
        Some(count) if count != slices.count => {
            Err(invalid(path, "pages", slices.count, format!("{count}, as the description says")))
        }
        _ => slices.finish(&calibration),
    }
}

/// Reads a folder of files with one page each, in the given order.
pub(super) fn read_folder<T: Voxel>(path: &Path, files: &[PathBuf], access: &Access) -> Result<Loaded<T>, VolumeError> {
    let mut kinds: Vec<(Page, Vec<&PathBuf>)> = Vec::new();
    for file in files {
        let pages = Pages::open(file, access)?;
        if pages.has_more() {
            return Err(invalid(file, "pages", "more than one", "one page per file in a folder of slices"));
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
    let mut first = Pages::open(slices_of_one_kind[0], access)?;
    let calibration = Calibration::of(&mut first)?;
    let mut slices = Slices::new(path, &first, &calibration)?;
    run::check(path, files)?;
    for file in slices_of_one_kind {
        slices.add(&mut Pages::open(file, access)?, access)?;
    }
    slices.finish(&calibration)
}

/// Slices of one size and type, appended in order.
struct Slices<'a, T> {
    path: &'a Path,
    page: Page,
    /// The first page's palette, unless another page has a different one.
    palette: Option<Vec<[u8; 3]>>,
    rescale: Option<[f64; 2]>,
    count: u32,
    values: Vec<T>,
}

impl<'a, T: Voxel> Slices<'a, T> {
    fn new(path: &'a Path, pages: &Pages, calibration: &Calibration) -> Result<Self, VolumeError> {
        let (page, palette) = (pages.page, pages.palette.clone());
        Ok(Self { path, page, palette, rescale: calibration.rescale, count: 0, values: Vec::new() })
    }

    fn samples(&self, count: u32) -> Result<Samples, VolumeError> {
        let Page { size: [width, height], kind } = self.page;
        let Some(dims) = dims_of([width, height, count]) else {
            return Err(invalid(self.path, "sizes", format!("{count} pages of {}", self.page), SIZES));
        };
        Ok(Samples { kind, dims, big_endian: cfg!(target_endian = "big"), rescale: self.rescale, z_fastest: false })
    }

    fn add(&mut self, pages: &mut Pages, access: &Access) -> Result<(), VolumeError> {
        if pages.page != self.page {
            let allowed = format!("{}, as the first page", self.page);
            return Err(invalid(&pages.path, &pages.name(), pages.page, allowed));
        }
        if self.palette.is_some() && pages.palette != self.palette {
            log::warn!("{}: {} has another palette: no colour map is offered", pages.path.display(), pages.name());
            self.palette = None;
        }
        let samples = self.samples(self.count + 1)?;
        if self.count == 0 {
            access.reserve(&pages.path, &pages.name(), self.page, self.page.bytes())?;
        }
        self.samples(1)?.reserve::<T>(&pages.path, access)?;
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
        let palette = self.palette.map(|colors| values_of(&colors, self.rescale)).filter(|palette| !palette.is_empty());
        let unit = calibration.unit.clone();
        Ok(Loaded { spacing, unit, palette, ..Loaded::new(dims, kind, self.values) })
    }
}

/// The colours of the values that a palette's indices become, in ascending order.
fn values_of(colors: &[[u8; 3]], rescale: Option<[f64; 2]>) -> Vec<(f64, DVec3)> {
    let [slope, intercept] = rescale.unwrap_or([1.0, 0.0]);
    let rgb = |color: [u8; 3]| DVec3::from(color.map(|channel| f64::from(channel) / 255.0));
    // Volumes store values as f32.
    let value = |index: usize| f64::from((index as f64 * slope + intercept) as f32);
    let mut points: Vec<_> = colors.iter().enumerate().map(|(index, &color)| (value(index), rgb(color))).collect();
    points.retain(|(value, _)| value.is_finite());
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    points.dedup_by_key(|point| point.0);
    points
}
