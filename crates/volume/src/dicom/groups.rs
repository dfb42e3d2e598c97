//! The series in a folder, of which one is read.

use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::path::Path;

use glam::DVec3;

use super::super::VolumeError;
use super::super::access::Access;
use super::super::error::volume::invalid;
use super::frames::Frame;
use super::image::{Belonging, Image, Opened};
use super::segments::Segments;

/// Directions with a smaller difference, and pixel sizes with a smaller relative difference, count as equal.
const SAME: f64 = 1e-4;
/// The number of series that messages list, and of kinds of frames in one that are told apart.
const LISTED: usize = 16;

/// The element with a slice's position.
pub(super) const POSITION: &str = "ImagePositionPatient";

/// A frame of a volume.
#[derive(Clone, Copy)]
pub(super) struct Slice {
    /// The index of its image, and of the frame in that.
    pub(super) image: usize,
    pub(super) frame: usize,
    pub(super) position: DVec3,
    pub(super) rescale: [f64; 2],
}

/// The slices that are read.
pub(super) struct Chosen {
    pub(super) images: Vec<Image>,
    pub(super) slices: Vec<Slice>,
    /// The series to choose from, if there are several.
    pub(super) listed: Vec<String>,
}

impl Chosen {
    /// The segments, if the slices are those of a segmentation.
    pub(super) fn segments(&self) -> Option<&Segments> {
        self.slices.first().and_then(|slice| self.images[slice.image].segments.as_ref())
    }
}

/// Frames of one series that share size, spacing and orientation, and the files of this series that are refused.
#[derive(Default)]
struct Group {
    slices: Vec<Slice>,
    refused: Vec<usize>,
    /// How many slices the volume should have; 0 for a segmentation, which goes behind the scan beside it.
    weight: usize,
    series: String,
    described: String,
}

/// Chooses the series that the options name, or else the largest.
///
/// # Errors
/// If there is none, or the chosen one has files that cannot be read.
pub(super) fn choose(path: &Path, opened: Vec<Opened>, access: &Access) -> Result<Chosen, VolumeError> {
    let (mut images, mut refused) = (Vec::new(), Vec::new());
    for one in opened {
        match one {
            Opened::Image(image) => images.push(*image),
            Opened::Refused { belonging, is_placed, error } => refused.push((belonging, is_placed, error)),
        }
    }
    let mut groups = groups_of(path, &images, &refused);
    let listed: Vec<String> = groups.iter().zip(0..).map(|(group, at)| format!("{at}: {}", group.described)).collect();
    let shown = || {
        let more = if listed.len() > LISTED { ", …" } else { "" };
        listed[..listed.len().min(LISTED)].join(", ") + more
    };
    let chosen = match access.series() {
        Some(wanted) => {
            let named = groups.iter().position(|group| group.series == wanted);
            let numbered = wanted.parse().ok().filter(|&number: &usize| number < groups.len());
            named.or(numbered).ok_or_else(|| {
                invalid(path, "series", wanted, format!("a number or a SeriesInstanceUID of {}", shown()))
            })?
        }
        None => {
            let largest = (0..groups.len()).min_by_key(|&at| Reverse(groups[at].weight));
            largest.ok_or_else(|| invalid(path, "PixelData", "no image", "the slices of a series"))?
        }
    };
    if listed.len() > 1 && access.series().is_none() {
        let (path, count) = (path.display(), listed.len());
        log::warn!("{path}: {count} series: {}: {chosen}, the largest, is read, and another by --series", shown());
    }
    let Group { slices, refused: of_chosen, .. } = groups.swap_remove(chosen);
    let mut left_out = Vec::new();
    for (at, (belonging, is_placed, error)) in refused.into_iter().enumerate() {
        if !of_chosen.contains(&at) {
            continue;
        }
        if is_placed || slices.is_empty() {
            return Err(error);
        }
        left_out.push(belonging.path.file_name().unwrap_or_default().display().to_string());
    }
    if !left_out.is_empty() {
        let (path, count) = (path.display(), left_out.len());
        let names = left_out[..count.min(8)].join(", ");
        let more = if count > 8 { ", …" } else { "" };
        log::warn!("{path}: {count} images without ImagePositionPatient are left out: {names}{more}");
    }
    let listed = if listed.len() > 1 { listed } else { Vec::new() };
    Ok(Chosen { images, slices, listed })
}

/// The groups of some images, in the order of the series' numbers and identities, the largest one of a series first.
fn groups_of(path: &Path, images: &[Image], refused: &[(Belonging, bool, VolumeError)]) -> Vec<Group> {
    /// The images and the refused files of a series.
    type Members<'a> = (&'a str, Vec<usize>, Vec<usize>);
    let mut series: BTreeMap<(i64, &str), Members> = BTreeMap::new();
    for (at, image) in images.iter().enumerate() {
        let Belonging { series: uid, series_number, description, .. } = &image.belonging;
        series.entry((*series_number, uid)).or_insert((description, Vec::new(), Vec::new())).1.push(at);
    }
    for (at, (Belonging { series: uid, series_number, description, .. }, ..)) in refused.iter().enumerate() {
        series.entry((*series_number, uid)).or_insert((description, Vec::new(), Vec::new())).2.push(at);
    }
    let mut groups = Vec::new();
    for ((_, uid), (description, members, refused_ones)) in series {
        let frames = members.iter().flat_map(|&image| {
            images[image].frames.iter().enumerate().map(move |(frame, found)| (image, frame, found))
        });
        let (kinds, others) = kinds_of(frames, |&(first, _, kind): &(usize, usize, &Frame), &(image, _, frame)| {
            let near = |a: f64, b: f64| (a - b).abs() <= SAME * a.max(b);
            let [a, b] = [&images[first].pixels, &images[image].pixels];
            // Segments of several files may not share a grid.
            let is_segmentation = |image: usize| images[image].segments.is_some();
            (first == image || !is_segmentation(first) && !is_segmentation(image))
                && a.samples == b.samples
                && [a.columns, a.rows] == [b.columns, b.rows]
                && near(kind.spacing[0], frame.spacing[0])
                && near(kind.spacing[1], frame.spacing[1])
                && (0..2).all(|axis| kind.directions[axis].abs_diff_eq(frame.directions[axis], SAME))
        });
        if others > 0 {
            let path = path.display();
            log::warn!(
                "{path}: {others} frames of more than {LISTED} sizes and orientations in one series are left out"
            );
        }
        let is_one = kinds.len() == 1;
        let of_kind = |members: Vec<(usize, usize, &Frame)>| {
            let (first, _, frame) = members[0];
            let pixels = &images[first].pixels;
            let [x, y] = frame.spacing;
            let [row, column] = frame.directions;
            let along = if is_one { String::new() } else { format!(", {x} × {y} mm, along {row} and {column}") };
            let (count, columns, rows) = (members.len(), pixels.columns, pixels.rows);
            let described = format!("{count} of {columns} × {rows}{along}, {description} ({uid})");
            let slice = |(image, frame, of): (usize, usize, &Frame)| Slice {
                image,
                frame,
                position: of.position,
                rescale: of.rescale,
            };
            let slices: Vec<Slice> = members.into_iter().map(slice).collect();
            let weight = if images[first].segments.is_some() { 0 } else { slices.len() };
            Group { weight, slices, refused: Vec::new(), series: uid.to_owned(), described }
        };
        let mut of_series: Vec<Group> = kinds.into_iter().map(of_kind).collect();
        of_series.sort_by_key(|group| Reverse(group.weight));
        if of_series.is_empty() {
            let described = format!("{} unreadable, {description} ({uid})", refused_ones.len());
            of_series.push(Group { series: uid.to_owned(), described, ..Group::default() });
        }
        of_series[0].weight += refused_ones.iter().filter(|&&at| refused[at].1).count();
        of_series[0].refused = refused_ones;
        groups.append(&mut of_series);
    }
    groups
}

/// The first kinds of some items, each with its items, and the number of items of other kinds. Every item is compared with the first ones of these kinds
/// alone.
fn kinds_of<T>(items: impl Iterator<Item = T>, are_alike: impl Fn(&T, &T) -> bool) -> (Vec<Vec<T>>, usize) {
    let (mut kinds, mut others) = (Vec::<Vec<T>>::new(), 0);
    for item in items {
        match kinds.iter().position(|kind| are_alike(&kind[0], &item)) {
            Some(kind) => kinds[kind].push(item),
            None if kinds.len() < LISTED => kinds.push(vec![item]),
            None => others += 1,
        }
    }
    (kinds, others)
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    #[test]
    fn kinds_are_found_by_few_comparisons() {
        let compared = Cell::new(0_usize);
        let are_alike = |a: &u32, b: &u32| {
            compared.set(compared.get() + 1);
            a == b
        };
        let (kinds, others) = kinds_of((0..10_000).chain(0..3), are_alike);
        let counts: Vec<usize> = kinds.iter().map(Vec::len).collect();
        assert_eq!((&counts[..4], counts.len(), others), (&[2, 2, 2, 1][..], LISTED, 9984));
        assert!(compared.get() <= LISTED * 10_003, "{}", compared.get());
    }
}
