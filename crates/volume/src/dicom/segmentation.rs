//! The volume of a segmentation: its frames, each of one segment and one slice, become labels or fractions on one grid.
//!
//! Slices that no frame names are 0. Where segments overlap, labels lie in several channels, as in `.seg.nrrd`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use glam::DVec3;

use super::super::VolumeError;
use super::super::access::Access;
use super::super::error::volume::invalid;
use super::super::grid::{SIZES, dims_of};
use super::super::loaded::Loaded;
use super::super::orientation::Orientation;
use super::super::sample_type::SampleType;
use super::super::samples::Samples;
use super::super::series::{MAX_CHANNELS, Series};
use super::super::shear::Lattice;
use super::super::voxels::Voxels;
use super::groups::{Chosen, POSITION, Slice};
use super::image::Image;
use super::segments::Meaning;
use super::series::{EXACT, NEARLY_EVEN, axes_of, lattice_of};
use crate::parallel::prelude::*;

/// The maximum number of slices: those of a whole body at a tenth of a millimetre are fewer.
const MAX_SLICES: f64 = 65_536.0;

/// The frames of a segmentation on their grid.
struct Frames<'a> {
    path: &'a Path,
    image: &'a Image,
    access: &'a Access,
    /// One slice.
    slice: Samples,
    count: usize,
    /// The frame of each segment in each slice; of the number 0 where samples are numbers of segments.
    of_segments: BTreeMap<u16, BTreeMap<usize, usize>>,
}

/// Labels that do not overlap.
struct Layer {
    labels: Vec<u16>,
    numbers: BTreeSet<u16>,
}

/// Reads the chosen frames, all of one segmentation.
pub(super) fn assemble(path: &Path, chosen: Chosen, access: &Access) -> Result<Loaded, VolumeError> {
    let Chosen { images, mut slices, listed } = chosen;
    let (lattice, places) = lattice(path, &images, &mut slices)?;
    let image = &images[slices[0].image];
    let Some(segments) = &image.segments else {
        return Err(invalid(path, "SegmentSequence", "no such element", "the segments of a segmentation"));
    };
    let allowed = match segments.meaning {
        Meaning::Binary => &[SampleType::U8][..],
        Meaning::Fractional(_) | Meaning::Numbers => &[SampleType::U8, SampleType::U16],
    };
    if image.pixels.samples != 1 || !allowed.contains(&image.kind()) {
        let found = format!("{} samples of {} a pixel", image.pixels.samples, image.kind());
        return Err(invalid(path, "BitsAllocated", found, "one of 1 or 8 bits, of fractions and numbers also of 16"));
    }
    let count = places.last().map_or(0, |&last| last + 1);
    let sizes = [u64::from(image.pixels.columns), u64::from(image.pixels.rows), count as u64];
    let wrong = || invalid(path, "Rows, Columns, slices", format!("{sizes:?}"), SIZES);
    let dims = dims_of(sizes).ok_or_else(wrong)?;
    let mut of_segments = BTreeMap::<u16, BTreeMap<usize, usize>>::new();
    for (slice, &place) in slices.iter().zip(&places) {
        let number = segments.of_frames.get(slice.frame).copied().unwrap_or(0);
        if let Some(other) = of_segments.entry(number).or_default().insert(place, slice.frame) {
            let found = format!("the same for frames {} and {}", other + 1, slice.frame + 1);
            return Err(invalid(path, POSITION, found, "one frame of a segment in each slice"));
        }
    }
    let kind = match segments.meaning {
        Meaning::Binary => SampleType::U16,
        _ => image.kind(),
    };
    let rescale = match segments.meaning {
        Meaning::Fractional(most) => Some([1.0 / f64::from(most), 0.0]),
        _ => None,
    };
    let slice =
        Samples { kind, dims: dims.with_z(1), big_endian: cfg!(target_endian = "big"), rescale, z_fastest: false };
    let frames = Frames { path, image, access, slice, count, of_segments };
    let (values, series, legends, channel_names) = match segments.meaning {
        Meaning::Binary => {
            let layers = frames.layers()?;
            let series = frames.series(layers.len())?;
            let mut values = access.wanted().none();
            for channel in series.channels(access.selection()) {
                frames.append_layer(&layers[channel as usize], &mut values)?;
            }
            (values, series, layers.iter().map(|layer| segments.legend(Some(&layer.numbers))).collect(), Vec::new())
        }
        Meaning::Fractional(_) => {
            let (values, series) = frames.channels()?;
            let names = frames.of_segments.keys().map(|&number| segments.name(number)).collect();
            (values, series, Vec::new(), names)
        }
        Meaning::Numbers => {
            let (values, series) = frames.channels()?;
            let mut legend = segments.legend(None);
            legend.palette = image.palette.clone().or(legend.palette);
            (values, series, vec![legend], Vec::new())
        }
    };
    let orientation = Some(Orientation::of_lps(lattice.axes, slices[0].position));
    let (spacing, unit) = (Some(lattice.spacing), Some("mm".to_owned()));
    let loaded = Loaded::new(dims, kind, values);
    let loaded = Loaded { spacing, unit, orientation, legends, series, channel_names, series_names: listed, ..loaded };
    lattice.straighten(path, POSITION, loaded, access)
}

impl Frames<'_> {
    fn series(&self, channels: usize) -> Result<Series, VolumeError> {
        if channels > MAX_CHANNELS as usize {
            let found = format!("{channels} channels of segments");
            return Err(invalid(self.path, "SegmentSequence", found, format!("at most {MAX_CHANNELS}")));
        }
        let series = Series { channels: channels as u32, ..Series::default() };
        series.check(self.path, self.access.selection())?;
        Ok(series)
    }

    /// All slices, for the reservation of memory.
    fn whole(&self) -> Samples {
        Samples { dims: self.slice.dims.with_z(self.count as u32), ..self.slice }
    }

    /// The samples of the selected segments, a channel each.
    fn channels(&self) -> Result<(Voxels, Series), VolumeError> {
        let series = self.series(self.of_segments.len())?;
        let mut values = self.access.wanted().none();
        let none = vec![0; self.slice.bytes() as usize];
        for channel in series.channels(self.access.selection()) {
            let Some(frames) = self.of_segments.values().nth(channel as usize) else { continue };
            self.whole().reserve(self.path, self.access)?;
            for place in 0..self.count {
                let frame = frames.get(&place).map(|&frame| self.image.frame(frame, self.access)).transpose()?;
                let bytes = frame.as_ref().unwrap_or(&none);
                let rounding = self.slice.append(&self.image.path, bytes, &mut values)?;
                self.access.note_rounding(rounding);
            }
        }
        values.shrink_to_fit();
        Ok((values, series))
    }

    /// The labels of binary segments: each segment, in the order of numbers, lies in the first layer whose segments it does not overlap.
    fn layers(&self) -> Result<Vec<Layer>, VolumeError> {
        let size = self.slice.count() as usize;
        let whole = self.whole();
        let found = format!("{} voxels of a segment", whole.dims);
        self.access.reserve(self.path, "PixelData", found, whole.count().into())?;
        let mut layers = Vec::<Layer>::new();
        for (&number, frames) in &self.of_segments {
            let mask = |(&place, &frame): (&usize, &usize)| {
                let mask = self.image.frame(frame, self.access)?;
                match mask.iter().find(|&&sample| sample > 1) {
                    Some(sample) => {
                        let found = format!("{sample} in frame {}", frame + 1);
                        Err(invalid(self.path, "PixelData", found, "0 or 1 in BINARY segments"))
                    }
                    None => Ok((place, mask)),
                }
            };
            let frames: Vec<_> = frames.iter().collect();
            let masks: Vec<(usize, Vec<u8>)> = frames.into_par_iter().map(mask).collect::<Result<_, _>>()?;
            let is_free = |layer: &Layer| {
                masks.iter().all(|(place, mask)| {
                    let labels = &layer.labels[place * size..][..size];
                    labels.iter().zip(mask).all(|(&label, &sample)| label == 0 || sample == 0)
                })
            };
            let at = match layers.iter().position(is_free) {
                Some(at) => at,
                None => {
                    layers.push(Layer { labels: self.no_labels(number)?, numbers: BTreeSet::new() });
                    layers.len() - 1
                }
            };
            let layer = &mut layers[at];
            layer.numbers.insert(number);
            for (place, mask) in masks {
                let labels = &mut layer.labels[place * size..][..size];
                labels.iter_mut().zip(mask).filter(|(_, sample)| *sample == 1).for_each(|(label, _)| *label = number);
            }
        }
        Ok(layers)
    }

    fn no_labels(&self, number: u16) -> Result<Vec<u16>, VolumeError> {
        let whole = self.whole();
        let found = format!("{} voxels of segment {number}", whole.dims);
        self.access.reserve(self.path, "data", found, whole.bytes())?;
        let mut labels = Vec::new();
        labels.try_reserve_exact(whole.count() as usize).map_err(whole.too_many(self.path))?;
        labels.resize(whole.count() as usize, 0);
        Ok(labels)
    }

    fn append_layer(&self, layer: &Layer, values: &mut Voxels) -> Result<(), VolumeError> {
        self.whole().reserve(self.path, self.access)?;
        for labels in layer.labels.chunks(self.slice.count() as usize) {
            let bytes: Vec<u8> = labels.iter().flat_map(|label| label.to_ne_bytes()).collect();
            self.slice.append(self.path, &bytes, values)?;
        }
        Ok(())
    }
}

/// The lattice of some frames, which are sorted along their normal, and the number of each frame's slice.
fn lattice(path: &Path, images: &[Image], slices: &mut [Slice]) -> Result<(Lattice, Vec<usize>), VolumeError> {
    let first = &images[slices[0].image].frames[slices[0].frame];
    let axes = axes_of(path, first)?;
    let [x, y] = first.spacing;
    let along = |slice: &Slice| slice.position.dot(axes.z_axis);
    slices.sort_by(|a, b| along(a).total_cmp(&along(b)));
    let heights: Vec<f64> = slices.iter().map(|slice| along(slice) - along(&slices[0])).collect();
    let same = EXACT * x.min(y);
    let steps: Vec<f64> = heights.windows(2).map(|pair| pair[1] - pair[0]).filter(|&step| step > same).collect();
    let step = match step_of(&heights, &steps, first.between) {
        Ok(Some(step)) => step,
        Ok(None) => first.thickness.unwrap_or(x),
        Err(found) => {
            let allowed = format!("slices at multiples of one distance, at most {MAX_SLICES} of them");
            return Err(invalid(path, POSITION, found, allowed));
        }
    };
    if let Some(stated) = first.between.filter(|stated| !steps.is_empty() && (stated - step).abs() > NEARLY_EVEN * step)
    {
        log::warn!(
            "{}: SpacingBetweenSlices: {stated} mm do not fit the frames' positions: slices are taken to be {step:.4} mm apart",
            path.display()
        );
    }
    let number = |at: usize| (heights[at] / step).round();
    let lattice = lattice_of(path, images, slices, (DVec3::new(x, y, step), axes), number)?;
    Ok((lattice, (0..slices.len()).map(|at| number(at) as usize).collect()))
}

/// The distance between slices: the stated one if all heights are multiples of it, or else the least one between neighbours, each as the span of all divides
/// into. `None` if there is only one slice.
///
/// # Errors
/// The distances, if heights are multiples of neither, or lie in too many slices.
fn step_of(heights: &[f64], steps: &[f64], stated: Option<f64>) -> Result<Option<f64>, String> {
    let (Some(&span), false) = (heights.last(), steps.is_empty()) else { return Ok(stated) };
    let [least, most] = steps.iter().fold([f64::INFINITY, 0.0_f64], |[a, b], &step| [a.min(step), b.max(step)]);
    let divided = |step: f64| span / (span / step).round();
    let fits = |step: f64| {
        let is_near = |height: &f64| (height / step - (height / step).round()).abs() <= NEARLY_EVEN;
        // Slices at two places are two slices.
        step.is_finite() && step > 0.0 && least > 0.5 * step && heights.iter().all(is_near)
    };
    let step =
        stated.map(divided).filter(|&step| fits(step)).or_else(|| Some(divided(least)).filter(|&step| fits(step)));
    match step {
        Some(step) if span / step < MAX_SLICES => Ok(Some(step)),
        Some(step) => Err(format!("{span} mm in slices {step:.4} mm apart")),
        None => Err(format!("distances from {least:.4} to {most:.4} mm")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step(heights: &[f64], stated: Option<f64>) -> Result<Option<f64>, String> {
        let steps: Vec<f64> = heights.windows(2).map(|pair| pair[1] - pair[0]).filter(|&step| step > 1e-3).collect();
        step_of(heights, &steps, stated)
    }

    #[test]
    fn slices_lie_at_multiples_of_a_step() {
        // Two frames of the first slice; the stated distance tells how many slices no frame names.
        assert_eq!(step(&[0.0, 0.0, 6.0, 9.0], None), Ok(Some(3.0)));
        assert_eq!(step(&[0.0, 0.0, 6.0, 9.0], Some(1.5)), Ok(Some(1.5)));
        // The stated distance may be rounded, or not fit at all.
        assert_eq!(step(&[0.0, 6.25, 9.375], Some(3.1)), Ok(Some(3.125)));
        assert_eq!(step(&[0.0, 6.0, 9.0], Some(4.0)), Ok(Some(3.0)));
        assert_eq!((step(&[0.0, 0.0], Some(4.0)), step(&[0.0], None)), (Ok(Some(4.0)), Ok(None)));
    }

    #[test]
    fn other_slices_are_refused() {
        assert_eq!(step(&[0.0, 3.0, 7.0], None), Err("distances from 3.0000 to 4.0000 mm".to_owned()));
        assert_eq!(step(&[0.0, 3.0, 7.0], Some(2.0)), Err("distances from 3.0000 to 4.0000 mm".to_owned()));
        assert_eq!(step(&[0.0, 65_536.0], Some(1.0)), Err("65536 mm in slices 1.0000 mm apart".to_owned()));
        assert!(step(&[0.0, 65_535.0], Some(1.0)).is_ok() && step(&[0.0, 1.0], Some(1e-300)).is_err());
    }
}
