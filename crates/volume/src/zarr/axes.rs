//! The axes of an array.

use std::fmt::{self, Display, Formatter};

use super::super::VolumeError;
use super::json::Json;

/// An axis; as a number, its place among five axes in the order t, c, z, y, x.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Axis {
    Time,
    Channel,
    Z,
    Y,
    X,
}

/// The number of kinds of axes.
pub(super) const KINDS: usize = 5;

/// For each kind of axis in the order t, c, z, y, x its place among an array's axes, if the array has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Axes([Option<usize>; KINDS]);

const ALLOWED: &str = "2 to 5 different axes x, y, z, c and t, x and y among them";

impl Axes {
    /// The axes of an array without other metadata: the last ones of t, c, z, y, x.
    pub(super) fn plain(count: usize) -> Option<Self> {
        let missing = KINDS.checked_sub(count).filter(|_| count >= 3)?;
        Some(Self([0, 1, 2, 3, 4].map(|kind: usize| kind.checked_sub(missing))))
    }

    /// The axes of an array that names them, if all names are known ones, with x and y among them.
    pub(super) fn named(names: &[String]) -> Option<Self> {
        let mut places = [None; KINDS];
        for (place, name) in names.iter().enumerate() {
            let kind = named(&name.to_ascii_lowercase())?;
            if places[kind as usize].replace(place).is_some() {
                return None;
            }
        }
        Some(Self(places)).filter(|axes| axes.of(Axis::X).is_some() && axes.of(Axis::Y).is_some())
    }

    /// Whether axes have no names, or those that xarray gives to axes without names.
    pub(super) fn say_nothing(names: &[String]) -> bool {
        let is_default = |name: &String| name.strip_prefix("dim_").is_some_and(|number| number.parse::<u32>().is_ok());
        names.iter().all(|name| name.is_empty() || is_default(name))
    }

    /// The axes of an OME-Zarr image.
    pub(super) fn read(axes: &Json) -> Result<Self, VolumeError> {
        let mut places = [None; KINDS];
        for (place, axis) in axes.list(ALLOWED)?.iter().enumerate() {
            let Some(kind) = kind_of(axis) else {
                return Err(
                    axis.invalid("an object with the name x, y or z, or the type or name of a channel (c) or time (t)")
                );
            };
            if places[kind as usize].replace(place).is_some() {
                return Err(axes.invalid(ALLOWED));
            }
        }
        let axes_found = Self(places);
        if axes_found.of(Axis::X).is_none() || axes_found.of(Axis::Y).is_none() {
            return Err(axes.invalid(ALLOWED));
        }
        Ok(axes_found)
    }

    /// The place of an axis.
    pub(super) fn of(&self, axis: Axis) -> Option<usize> {
        self.0[axis as usize]
    }

    /// The number of axes.
    pub(super) fn count(&self) -> usize {
        self.0.iter().flatten().count()
    }

    /// Numbers by kind of those that belong to an array's axes; `other` belongs to an axis that the array lacks.
    pub(super) fn sort<T: Copy>(&self, numbers: &[T], other: T) -> [T; KINDS] {
        self.0.map(|place| place.map_or(other, |place| numbers[place]))
    }

    /// Numbers for the array's axes of those by kind.
    pub(super) fn unsort<T: Copy + Default>(&self, numbers: [T; KINDS]) -> Vec<T> {
        let mut unsorted = vec![T::default(); self.count()];
        for (place, number) in self.0.iter().zip(numbers) {
            if let Some(place) = place {
                unsorted[*place] = number;
            }
        }
        unsorted
    }
}

impl Display for Axes {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let mut named: Vec<_> =
            self.0.iter().zip(["t", "c", "z", "y", "x"]).filter_map(|(&at, name)| Some((at?, name))).collect();
        named.sort_unstable();
        f.write_str(&named.iter().map(|&(_, name)| name).collect::<Vec<_>>().join(", "))
    }
}

/// The kind of an axis by its name alone, as an array states it that has no types of axes. Arrays of xarray in Python have the same names.
fn named(name: &str) -> Option<Axis> {
    Some(match name {
        "t" | "time" | "times" => Axis::Time,
        "c" | "channel" | "channels" => Axis::Channel,
        "z" | "depth" | "slice" | "slices" | "plane" | "pln" => Axis::Z,
        "y" | "row" | "rows" | "height" => Axis::Y,
        "x" | "column" | "columns" | "col" | "cols" | "width" => Axis::X,
        _ => return None,
    })
}

/// The kind of an axis by its type and name.
fn kind_of(axis: &Json) -> Option<Axis> {
    let name = axis.get("name").text()?.to_ascii_lowercase();
    match (axis.get("type").text(), name.as_str()) {
        (Some("time"), _) | (None, "t") => Some(Axis::Time),
        (Some("channel"), _) | (None, "c") => Some(Axis::Channel),
        (Some("space") | None, "x") => Some(Axis::X),
        (Some("space") | None, "y") => Some(Axis::Y),
        (Some("space") | None, "z") => Some(Axis::Z),
        _ => None,
    }
}
