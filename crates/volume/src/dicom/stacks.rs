//! Several images at one place: times and channels, told apart by what differs.

use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use super::super::VolumeError;
use super::super::access::Access;
use super::super::error::volume::invalid;
use super::super::series::{MAX_CHANNELS, Series, SeriesOrder};
use super::groups::{POSITION, Slice};
use super::image::Image;
use super::marks::{self, MARKS, Mark};

/// Slices that lie side by side, place by place.
pub(super) struct Stacks {
    /// The names of channels and of times; empty if there is only one.
    pub(super) channels: Vec<String>,
    pub(super) times: Vec<String>,
    /// Whole stacks, of which all channels of a time lie together.
    pub(super) stacks: Vec<Vec<Slice>>,
}

/// A slice's place, and the number of what tells it apart from others there.
struct Told {
    slice: Slice,
    place: usize,
    key: usize,
}

impl Stacks {
    pub(super) fn series(&self) -> Series {
        let (channels, times) = (self.channels.len().max(1) as u32, self.times.len().max(1) as u32);
        Series { channels, times, order: SeriesOrder::ChannelsFirst, is_color: false }
    }

    /// The stacks of some slices, which are sorted by their places. `place_of` gives the number of a slice's place, which ascends.
    pub(super) fn of(
        path: &Path,
        images: &[Image],
        slices: Vec<Slice>,
        places: &[usize],
        access: &Access,
    ) -> Result<Self, VolumeError> {
        let mut told: Vec<Told> =
            slices.into_iter().zip(places).map(|(slice, &place)| Told { slice, place, key: 0 }).collect();
        drop_duplicates(path, images, &mut told, access)?;
        let most = told.chunk_by(|a, b| a.place == b.place).map(<[Told]>::len).max().unwrap_or(0);
        if most <= 1 {
            let stack = told.into_iter().map(|told| told.slice).collect();
            return Ok(Self { channels: Vec::new(), times: Vec::new(), stacks: vec![stack] });
        }
        let used = tell_apart(images, &mut told, most);
        let is_told = told.chunk_by(|a, b| a.place == b.place).all(|place| {
            let keys: BTreeSet<usize> = place.iter().map(|told| told.key).collect();
            keys.len() == place.len()
        });
        if !is_told {
            return by_rank(path, images, told, most);
        }
        by_marks(path, images, told, &used)
    }
}

/// The value of a mark of a slice; empty if its file has none.
fn mark_of<'a>(images: &'a [Image], slice: &Slice, mark: usize) -> &'a str {
    let image = &images[slice.image];
    let mut marked = image.frames[slice.frame].marked.iter().chain(&image.marked);
    marked.find(|(number, _)| *number == mark).map_or("", |(_, value)| value)
}

/// A slice's name in messages.
pub(super) fn name_of(images: &[Image], slice: &Slice) -> String {
    match images[slice.image].frames.len() {
        1 => images[slice.image].path.file_name().unwrap_or_default().display().to_string(),
        _ => format!("frame {}", slice.frame + 1),
    }
}

/// Drops slices that are the same image as another one at their place, with a warning: nothing tells them apart, and their files have the same identity
/// or the same samples.
fn drop_duplicates(path: &Path, images: &[Image], told: &mut Vec<Told>, access: &Access) -> Result<(), VolumeError> {
    let mut dropped = Vec::new();
    let mut kept = Vec::with_capacity(told.len());
    let key = |slice: &Slice| {
        let marks: Vec<&str> = (0..MARKS.len()).map(|mark| mark_of(images, slice, mark)).collect();
        (marks, images[slice.image].number.as_str(), slice.rescale.map(f64::to_bits), slice.frame)
    };
    for place in told.chunk_by(|a, b| a.place == b.place) {
        let mut by_key = BTreeMap::new();
        if place.len() > 1 {
            for told in place {
                *by_key.entry(key(&told.slice)).or_insert(0_usize) += 1;
            }
        }
        let (mut instances, mut contents) = (BTreeSet::new(), BTreeSet::new());
        for told in place {
            let image = &images[told.slice.image];
            if place.len() > 1 && by_key[&key(&told.slice)] > 1 {
                let has_instance = !image.instance.is_empty();
                let is_new = !has_instance || instances.insert((key(&told.slice), image.instance.as_str()));
                let is_new = is_new && {
                    let samples = image.frame(told.slice.frame, access)?;
                    contents.insert((key(&told.slice), *blake3::hash(&samples).as_bytes()))
                };
                if !is_new {
                    dropped.push(name_of(images, &told.slice));
                    continue;
                }
            }
            kept.push(Told { ..*told });
        }
    }
    *told = kept;
    if !dropped.is_empty() {
        let (path, count) = (path.display(), dropped.len());
        let names = dropped[..count.min(8)].join(", ");
        let more = if count > 8 { ", …" } else { "" };
        log::warn!("{path}: {count} images are there twice and are left out: {names}{more}");
    }
    Ok(())
}

/// Numbers slices by the marks that tell apart those at one place, and returns these marks.
fn tell_apart(images: &[Image], told: &mut [Told], most: usize) -> Vec<usize> {
    let mut used = Vec::new();
    for mark in 0..MARKS.len() {
        let value = |told: &Told| mark_of(images, &told.slice, mark);
        let values: BTreeSet<&str> = told.iter().map(value).collect();
        // A mark that varies with the place is no time or channel.
        if values.len() < 2 || values.len() > most {
            continue;
        }
        let parts = told.chunk_by(|a, b| a.place == b.place).any(|place| {
            let before: BTreeSet<usize> = place.iter().map(|told| told.key).collect();
            let after: BTreeSet<(usize, &str)> = place.iter().map(|told| (told.key, value(told))).collect();
            before.len() < after.len()
        });
        if parts {
            let mut keys = BTreeMap::new();
            for told in &mut *told {
                let next = keys.len();
                told.key = *keys.entry((told.key, value(told))).or_insert(next);
            }
            used.push(mark);
        }
    }
    used
}

/// Times in the order in which images were made, where every place has equally many.
fn by_rank(path: &Path, images: &[Image], mut told: Vec<Told>, most: usize) -> Result<Stacks, VolumeError> {
    let mut stacks: Vec<Vec<Slice>> = (0..most).map(|_| Vec::new()).collect();
    let rank = |a: &Told, b: &Told| {
        let by_mark = |mark: usize| marks::order(mark_of(images, &a.slice, mark), mark_of(images, &b.slice, mark));
        let number = |told: &Told| &images[told.slice.image].number;
        let marks = (0..MARKS.len()).map(by_mark).find(|&order| order != Ordering::Equal);
        marks
            .unwrap_or(Ordering::Equal)
            .then_with(|| marks::order(number(a), number(b)))
            .then([a.slice.image, a.slice.frame].cmp(&[b.slice.image, b.slice.frame]))
    };
    told.sort_by(|a, b| a.place.cmp(&b.place).then_with(|| rank(a, b)));
    for place in told.chunk_by(|a, b| a.place == b.place) {
        if place.len() < most {
            return Err(unequal(path, images, &told, most));
        }
        for (told, stack) in place.iter().zip(&mut stacks) {
            stack.push(told.slice);
        }
    }
    let times = (1..=most).map(|number| format!("image {number} of each place")).collect();
    Ok(Stacks { channels: Vec::new(), times, stacks })
}

fn unequal(path: &Path, images: &[Image], told: &[Told], most: usize) -> VolumeError {
    let mut places = told.chunk_by(|a, b| a.place == b.place);
    let names = |place: &[Told]| {
        let names = place[..place.len().min(4)].iter().map(|told| name_of(images, &told.slice));
        names.collect::<Vec<_>>().join(", ")
    };
    let full = places.clone().find(|place| place.len() == most).map(names).unwrap_or_default();
    let other = places.find(|place| place.len() < most).map(|place| (place.len(), names(place)));
    let (count, other) = other.unwrap_or_default();
    let known: Vec<&str> = MARKS.iter().map(Mark::name).collect();
    let allowed = format!("equally many at each place, or images that differ in {}", known.join(", "));
    invalid(path, POSITION, format!("{most} images at one place ({full}), {count} at another ({other})"), allowed)
}

/// Channels and times by the marks that tell slices apart.
fn by_marks(path: &Path, images: &[Image], told: Vec<Told>, used: &[usize]) -> Result<Stacks, VolumeError> {
    let places = told.last().map_or(0, |told| told.place + 1);
    let mut by_key: BTreeMap<usize, Vec<&Told>> = BTreeMap::new();
    for told in &told {
        by_key.entry(told.key).or_default().push(told);
    }
    let all = by_key.len();
    by_key.retain(|_, stack| stack.len() == places);
    if by_key.is_empty() {
        let most = told.chunk_by(|a, b| a.place == b.place).map(<[Told]>::len).max().unwrap_or(0);
        return Err(unequal(path, images, &told, most));
    }
    if by_key.len() < all {
        let names: Vec<&str> = used.iter().map(|&mark| MARKS[mark].name()).collect();
        log::warn!(
            "{}: {} of {all} volumes, told apart by {}, lack slices and are left out",
            path.display(),
            all - by_key.len(),
            names.join(" and ")
        );
    }
    // The values of marks that part channels, and of those that part times.
    let values = |stack: &[&Told], is_channel: bool| -> Vec<String> {
        let marks = used.iter().filter(|&&mark| MARKS[mark].is_channel == is_channel);
        marks.map(|&mark| mark_of(images, &stack[0].slice, mark).to_owned()).collect()
    };
    let names = |is_channel: bool| -> Vec<&str> {
        used.iter().map(|&mark| &MARKS[mark]).filter(|mark| mark.is_channel == is_channel).map(Mark::name).collect()
    };
    let mut keyed: BTreeMap<[Vec<Ordered>; 2], Vec<Slice>> = BTreeMap::new();
    for stack in by_key.values() {
        let key = [false, true].map(|is_channel| values(stack, is_channel).into_iter().map(Ordered).collect());
        keyed.insert(key, stack.iter().map(|told| told.slice).collect());
    }
    let distinct = |at: usize| -> BTreeSet<&Vec<Ordered>> { keyed.keys().map(|key| &key[at]).collect() };
    let [times, channels] = [distinct(0), distinct(1)];
    let described = |of: &BTreeSet<&Vec<Ordered>>, names: &[&str]| -> Vec<String> {
        let described = |values: &&Vec<Ordered>| {
            let named = names.iter().zip(values.iter()).map(|(name, Ordered(value))| format!("{name} {value}"));
            named.collect::<Vec<_>>().join(", ")
        };
        if of.len() > 1 { of.iter().map(described).collect() } else { Vec::new() }
    };
    let is_whole = times.len() * channels.len() == keyed.len() && channels.len() <= MAX_CHANNELS as usize;
    let (channels, times) = if is_whole {
        (described(&channels, &names(true)), described(&times, &names(false)))
    } else {
        let all = keyed.keys().map(|[times, channels]| {
            let one = |of: &Vec<Ordered>, names: &[&str]| {
                names.iter().zip(of).map(|(name, Ordered(value))| format!("{name} {value}")).collect::<Vec<_>>()
            };
            [one(times, &names(false)), one(channels, &names(true))].concat().join(", ")
        });
        (Vec::new(), all.collect())
    };
    Ok(Stacks { channels, times, stacks: keyed.into_values().collect() })
}

/// A mark's value in the order of its numbers.
struct Ordered(String);

impl Ord for Ordered {
    fn cmp(&self, other: &Self) -> Ordering {
        marks::order(&self.0, &other.0)
    }
}

impl PartialOrd for Ordered {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Ordered {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Ordered {}
