//! A key of a scene file, declared once (SPEC §7): its name, where its value lies in a settings type, its type and range, and a sentence. Reading, checking
//! and writing scene files and their JSON Schema all go through the declarations. [`keys`](super::keys) has those of this room.

use std::collections::BTreeMap;

use glam::{DVec3, UVec3};

use super::light::Light;
use super::transfer_function::{LabelTables, Ramp};
use crate::error::setting::{Interval, SettingError, check_direction};

/// The allowed widths and heights, for errors.
pub(crate) const PIXELS: &str = "an integer from 1 to the device's texture limit";

/// A key of a table.
pub(crate) struct Key<T> {
    pub(crate) name: &'static str,
    /// For users, with the unit. Only the program prints sentences; a page's file has none of them.
    #[cfg_attr(not(feature = "cli"), expect(dead_code, reason = "the program's"))]
    pub(crate) sentence: &'static str,
    pub(crate) slot: for<'a> fn(&'a mut T) -> Slot<'a>,
}

impl<T> Key<T> {
    pub(crate) const fn new(name: &'static str, sentence: &'static str, slot: fn(&mut T) -> Slot<'_>) -> Self {
        Self { name, sentence: if cfg!(feature = "cli") { sentence } else { "" }, slot }
    }
}

/// A key: its name, the field of its value if that has another one, its type and range, and its sentence.
macro_rules! key {
    ($name:ident, $slot:ident $(($($argument:expr),+))?, $sentence:literal) => {
        key!(stringify!($name), $name, $slot $(($($argument),+))?, $sentence)
    };
    ($name:expr, $($field:ident).+, $slot:ident $(($($argument:expr),+))?, $sentence:literal) => {
        Key::new($name, $sentence, |settings| $slot($($($argument,)+)? &mut settings.$($field).+))
    };
}
pub(crate) use key;

/// The settings of a table, whose defaults are the table's.
pub(crate) trait Keyed: Clone + Default + 'static {
    /// The keys, in the order in which errors list them.
    const KEYS: &'static [Key<Self>];

    /// Checks that each value is in range; `table` is the table's full key.
    fn check_keys(&self, table: &str) -> Result<(), SettingError> {
        let mut settings = self.clone();
        for Key { name, slot, .. } in Self::KEYS {
            let error = |of: SettingError| SettingError::new(format!("{table}.{name}{}", of.key), of.found, of.allowed);
            slot(&mut settings).check().map_err(error)?;
        }
        Ok(())
    }
}

/// The place of a value, with its type and range. `None` stands for a key that is not stated.
pub(crate) enum Slot<'a> {
    Switch(&'a mut bool),
    Number(Interval, &'a mut f64),
    Given(Interval, &'a mut Option<f64>),
    Choice(Choice<'a>),
    /// A vector of any length except 0.
    Direction(&'a mut DVec3),
    Vector(Interval, &'a mut Option<DVec3>),
    Light(&'a mut Light),
    Pixels(&'a mut u32),
    Background(&'a mut [f64; 4]),
    Planes(&'a mut Vec<[f64; 4]>),
    Crop(&'a mut Option<[DVec3; 2]>),
    /// Control points of colours.
    Colors(&'a mut Option<Ramp<DVec3>>),
    /// Control points of numbers in [0, 1], with the form of a point.
    Shares(&'static str, &'a mut Option<Ramp<f64>>),
    /// Closed intervals.
    Ranges(&'a mut Option<Vec<[f64; 2]>>),
    Labels(&'a mut BTreeMap<u64, LabelTables>),
    Label(&'a mut Option<u64>),
    /// Text, with what it stands for.
    Text(&'static str, &'a mut Option<String>),
    /// A number of a channel or time, from 0.
    Number32(&'a mut Option<u32>),
    /// A level's number, or `"auto"`.
    Level(&'a mut Option<u32>),
    /// A series' number or identity.
    Series(&'a mut Option<String>),
    Dims(&'a mut Option<UVec3>),
    Bytes(&'a mut Option<u64>),
}

impl Slot<'_> {
    /// Checks the range of a single value; an error's key is the element's index alone, or empty.
    fn check(&self) -> Result<(), SettingError> {
        match self {
            Self::Number(range, number) => range.check("", **number),
            Self::Given(range, number) => range.check_given("", **number),
            Self::Direction(vector) => check_direction("", **vector),
            Self::Light(Light::Direction(vector)) => check_direction("", *vector),
            Self::Vector(range, Some(vector)) => range.check_each("", &vector.to_array()),
            Self::Pixels(0) => Err(SettingError::new("", 0.0, PIXELS)),
            Self::Background(color) => Interval::SHARE.check_each("", &color[..]),
            _ => Ok(()),
        }
    }

    /// Takes over the value that a preset chooses, if it is the default. Presets choose keys of few types.
    pub(crate) fn fit(self, default: Slot, chosen: Slot) {
        match (self, default, chosen) {
            (Self::Switch(value), Slot::Switch(default), Slot::Switch(chosen)) if value == default => *value = *chosen,
            (Self::Number(_, value), Slot::Number(_, default), Slot::Number(_, chosen)) if value == default => {
                *value = *chosen;
            }
            (Self::Light(value), Slot::Light(default), Slot::Light(chosen)) if value == default => *value = *chosen,
            (Self::Choice(mut value), Slot::Choice(default), Slot::Choice(Choice { chosen: Some(at), .. }))
                if value.chosen == default.chosen =>
            {
                (value.choose)(at);
            }
            _ => {}
        }
    }
}

/// One of several values that have names.
pub(crate) struct Choice<'a> {
    pub(crate) names: Vec<&'static str>,
    /// The chosen one; `None` for a value without a name, which scene files cannot state.
    pub(crate) chosen: Option<usize>,
    pub(crate) choose: Box<dyn FnMut(usize) + 'a>,
}

/// The place of a choice.
pub(crate) fn choice<'a, T: Copy + PartialEq>(all: &'static [(&'static str, T)], place: &'a mut T) -> Slot<'a> {
    choice_of(all, Some(*place), move |at| *place = all[at].1)
}

/// The place of a choice that may be missing.
pub(crate) fn chosen<'a, T: Copy + PartialEq>(all: &'static [(&'static str, T)], place: &'a mut Option<T>) -> Slot<'a> {
    choice_of(all, *place, move |at| *place = Some(all[at].1))
}

fn choice_of<'a, T: PartialEq>(all: &[(&'static str, T)], of: Option<T>, choose: impl FnMut(usize) + 'a) -> Slot<'a> {
    let chosen = all.iter().position(|(_, choice)| of.as_ref() == Some(choice));
    Slot::Choice(Choice { names: all.iter().map(|(name, _)| *name).collect(), chosen, choose: Box::new(choose) })
}
