//! TIFF and BigTIFF files: a stack of pages in one file, or a folder of slices, uncompressed or by LZW, Deflate or PackBits.
//!
//! The spacing comes from ImageJ's or OME's description, or else from the resolution, which has no distance between pages: then the
//! distance between columns serves. Values are the file's, whichever it calls black.

mod calibration;
mod description;
mod directory;
mod display;
mod ome;
mod overlay;
mod pages;
mod run;
mod set;
mod shaped;
mod stack;
mod trial;

use std::path::{Path, PathBuf};

use glam::DVec3;

use self::calibration::Calibration;
use self::pages::{Page, Pages};
use self::stack::{Place, Runs, Stack};
use super::VolumeError;
use super::access::Access;
use super::error::volume::invalid;
use super::grid::{SIZES, dims_of};
use super::loaded::{Legend, Loaded};
use super::samples::Samples;
use super::series::{Series, apart};
use super::stream::Stream;
use super::voxels::{Voxels, Wanted};

/// Reads the pages of one file.
pub(super) fn read(path: &Path, access: &Access) -> Result<Loaded, VolumeError> {
    let mut pages = Pages::open(path, access)?;
    let calibration = Calibration::of(&mut pages)?;
    let mut slices = Slices::new(path, &pages, &calibration)?;
    let stack = calibration.stack.map(|stack| stack.of_pixels(pages.page.samples));
    let stack = stack.as_ref();
    let (series, selection) = (stack.map(Stack::series).unwrap_or_default(), access.selection());
    if pages.page.samples > 1 && series.channels > 1 {
        return Err(invalid(path, "channels", format!("{} of colours", series.channels), "colours in one channel"));
    }
    series.check(path, selection)?;
    let channels = series.channels(selection);
    slices.channels.resize_with(channels.len(), || OfChannel::none(access.wanted()));
    // The channel of a page among those that are read, and its slice.
    let wanted = |number: u32| {
        let alone = Place { slice: number, ..Place::default() };
        let place = stack.map_or(alone, |stack| stack.place(number));
        let is_read = place.time == selection.time.unwrap_or(0) && channels.contains(&place.channel);
        is_read.then(|| ((place.channel - channels.start) as usize, place.slice))
    };
    let described = stack.and_then(Stack::pages);
    let mut count = 0;
    // Without such a statement, what follows a page are no planes.
    if let Some(all) = described.filter(|&all| all > 1 && calibration.is_contiguous && !pages.has_more()) {
        let samples = Samples { big_endian: pages.is_big_endian(), ..slices.samples(1)? };
        let mut stream = Stream::raw(access.open(path)?)?;
        stream.skip(pages.contiguous()?)?;
        if let Some(left) = stream.exactly_left().filter(|&left| left < samples.bytes().saturating_mul(all.into())) {
            let allowed = format!("{} bytes ({all} pages)", samples.bytes() * u64::from(all));
            return Err(invalid(path, "data", format!("{left} bytes"), allowed));
        }
        while count < all {
            match wanted(count) {
                Some((channel, slice)) => {
                    samples.reserve(path, access)?;
                    let page = stream.read_samples(&samples)?;
                    let appended = slices.channels[channel].values.append_from(&page, 0..page.count());
                    appended.map_err(samples.too_many(path))?;
                    slices.channels[channel].slices.push(slice);
                }
                None => stream.skip(samples.bytes())?,
            }
            count += 1;
        }
    } else {
        let others = set::others(path, &calibration, access)?;
        let is_set = !others.is_empty();
        let mut read = |pages: &mut Pages, runs: &Runs| -> Result<(), VolumeError> {
            for page in 0.. {
                // A page of a set that no element is about is none of its planes.
                if let Some(number) = if is_set { runs.stated(page) } else { Some(runs.number_of(page)) } {
                    if let Some(place) = wanted(number) {
                        slices.add(pages, place, access)?;
                    }
                    count += 1;
                }
                if !pages.next()? {
                    break;
                }
            }
            Ok(())
        };
        read(&mut pages, &calibration.runs)?;
        for (file, runs) in others {
            read(&mut Pages::open(&file, access)?, runs)?;
        }
    }
    match described {
        Some(all) if all != count => Err(invalid(path, "pages", count, format!("{all}, as the description says"))),
        _ => {
            let loaded = slices.finish(&calibration)?;
            let series = if loaded.series.is_color { Series { times: series.times, ..loaded.series } } else { series };
            let assumed_axes = (stack.is_none() && count > 1).then_some("pages are slices along z");
            Ok(Loaded { series, assumed_axes, ..loaded })
        }
    }
}

/// Reads a folder of files with one page each, in the given order.
pub(super) fn read_folder(path: &Path, files: &[PathBuf], access: &Access) -> Result<Loaded, VolumeError> {
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
    slices.channels.push(OfChannel::none(access.wanted()));
    for (slice, file) in (0..).zip(slices_of_one_kind) {
        slices.add(&mut Pages::open(file, access)?, (0, slice), access)?;
    }
    let assumed_axes = Some("files are slices along z, in the order of their names");
    Ok(Loaded { assumed_axes, ..slices.finish(&calibration)? })
}

/// The slices of a channel in the order of the file.
struct OfChannel {
    values: Voxels,
    /// The number of each slice.
    slices: Vec<u32>,
}

impl OfChannel {
    /// No slices of what is wanted.
    fn none(wanted: Wanted) -> Self {
        Self { values: wanted.none(), slices: Vec::new() }
    }

    /// The values with the slices in order; `None` if a slice is missing or comes twice.
    fn in_order(self) -> Option<Voxels> {
        let Self { mut values, mut slices } = self;
        let mut sorted = slices.clone();
        sorted.sort_unstable();
        if !sorted.into_iter().eq(0..slices.len() as u32) {
            return None;
        }
        let size = values.count() / slices.len().max(1);
        for at in 0..slices.len() {
            // Each exchange brings one slice to its place, which lies behind this one.
            while slices[at] as usize != at {
                let to = slices[at] as usize;
                values.swap(at * size, to * size, size);
                slices.swap(at, to);
            }
        }
        Some(values)
    }
}

/// Slices of one size and type, appended to the values of their channel.
struct Slices<'a> {
    path: &'a Path,
    page: Page,
    /// The first page's palette, unless another page has a different one.
    palette: Option<Vec<[u8; 3]>>,
    rescale: Option<[f64; 2]>,
    channels: Vec<OfChannel>,
}

impl<'a> Slices<'a> {
    fn new(path: &'a Path, pages: &Pages, calibration: &Calibration) -> Result<Self, VolumeError> {
        let (page, palette) = (pages.page, pages.palette.clone());
        Ok(Self { path, page, palette, rescale: calibration.rescale, channels: Vec::new() })
    }

    fn samples(&self, count: u32) -> Result<Samples, VolumeError> {
        let Page { size: [width, height], samples, kind, .. } = self.page;
        let Some(dims) = width.checked_mul(samples).and_then(|width| dims_of([width, height, count])) else {
            return Err(invalid(self.path, "sizes", format!("{count} pages of {}", self.page), SIZES));
        };
        Ok(Samples { kind, dims, big_endian: cfg!(target_endian = "big"), rescale: self.rescale, z_fastest: false })
    }

    /// The number of slices that a channel has.
    fn count(&self, channel: usize) -> u32 {
        let [width, height] = self.page.size.map(u64::from);
        let samples = width * height * u64::from(self.page.samples);
        (self.channels[channel].values.count() as u64 / samples.max(1)) as u32
    }

    fn add(&mut self, pages: &mut Pages, (channel, slice): (usize, u32), access: &Access) -> Result<(), VolumeError> {
        if pages.page != self.page {
            let allowed = format!("{}, as the first page", self.page);
            return Err(invalid(&pages.path, &pages.name(), pages.page, allowed));
        }
        if self.palette.is_some() && pages.palette != self.palette {
            log::warn!("{}: {} has another palette: no colour map is offered", pages.path.display(), pages.name());
            self.palette = None;
        }
        let count = self.count(channel);
        let samples = self.samples(count + 1)?;
        if count == 0 && channel == 0 {
            access.reserve(&pages.path, &pages.name(), self.page, self.page.bytes())?;
        }
        self.samples(1)?.reserve(&pages.path, access)?;
        let bytes = pages.bytes()?;
        self.channels[channel].slices.push(slice);
        access.note_rounding(samples.append(&pages.path, &bytes, &mut self.channels[channel].values)?);
        Ok(())
    }

    fn finish(mut self, calibration: &Calibration) -> Result<Loaded, VolumeError> {
        let samples = self.samples(self.count(0))?;
        let Samples { dims, kind, .. } = samples;
        let components = self.page.samples;
        let dims = dims.with_x(dims.x / components);
        let mut all = None;
        let too_many = samples.too_many(self.path);
        for channel in std::mem::take(&mut self.channels) {
            let allowed = "every slice of every channel and time once, as the description says";
            let refused = || invalid(self.path, "TiffData", "a slice that is missing or comes twice", allowed);
            let values = channel.in_order().ok_or_else(refused)?;
            match &mut all {
                None => all = Some(values),
                Some(all) => all.append_from(&values, 0..values.count()).map_err(&too_many)?,
            }
        }
        let mut all: Voxels = all.unwrap_or_else(|| Wanted::Values.none());
        all.shrink_to_fit();
        let all = apart(all, components as usize).map_err(&too_many)?;
        let series = if components > 1 { Series::of_colors(components, 1) } else { Series::default() };
        let spacing = calibration.spacing.map(|[x, y]| {
            let z = calibration.between_slices.unwrap_or_else(|| {
                let unit = calibration.unit.as_deref().unwrap_or_default();
                log::warn!("{}: no distance between slices is given: taken to be {x} {unit}", self.path.display());
                x
            });
            DVec3::new(x, y, z)
        });
        let palette = self.palette.and_then(|colors| values_of(&colors, self.rescale));
        let unit = calibration.unit.clone();
        let (channel_names, displays) = (calibration.channel_names.clone(), calibration.displays.clone());
        let legends = vec![Legend::of_palette(palette)];
        Ok(Loaded { spacing, unit, legends, channel_names, displays, series, ..Loaded::new(dims, kind, all) })
    }
}

/// The colours of the values that a palette's indices become, in ascending order.
fn values_of(colors: &[[u8; 3]], rescale: Option<[f64; 2]>) -> Option<Vec<(f64, DVec3)>> {
    let [slope, intercept] = rescale.unwrap_or([1.0, 0.0]);
    let rgb = |color: [u8; 3]| DVec3::from(color.map(|channel| f64::from(channel) / 255.0));
    // Volumes store values as f32.
    let value = |index: usize| f64::from((index as f64 * slope + intercept) as f32);
    let points = colors.iter().enumerate().map(|(index, &color)| (value(index), rgb(color)));
    Legend::ascending(points.filter(|(value, _)| value.is_finite()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slices_come_into_their_order() {
        let of = |slices: &[u32]| {
            let values: Vec<u64> =
                slices.iter().flat_map(|&slice| [10, 11].map(|of| 10 * u64::from(slice) + of - 10)).collect();
            let values = OfChannel { values: values.into(), slices: slices.to_vec() }.in_order();
            values.map(|values| values.ids())
        };
        for slices in [&[0, 1, 2, 3, 4][..], &[4, 3, 2, 1, 0], &[1, 2, 3, 4, 0], &[2, 0, 1, 4, 3]] {
            assert_eq!(of(slices), Some(vec![0, 1, 10, 11, 20, 21, 30, 31, 40, 41]), "{slices:?}");
        }
        assert_eq!((of(&[0, 0, 1]), of(&[0, 2]), of(&[])), (None, None, Some(Vec::new())));
    }
}
