//! The values of keys in scene files: read into settings, whose own checks test ranges, and as they are written.

use std::collections::BTreeMap;
use std::ops::{Add, Mul};

use glam::DVec3;
use toml::Value;

use super::SceneError;
use super::color::{rgb, rgba};
use super::keys::LabelTable;
use super::reader::{Entry, Section};
use crate::error::setting::{Interval, SettingError};
use crate::settings::clip::MAX_PLANES;
use crate::settings::key::{Choice, Keyed, PIXELS, Slot};
use crate::settings::light::Light;
use crate::settings::transfer_function::{LabelTables, Ramp, RampError};
use crate::volume::{SIZES, dims_of};

/// The allowed labels, for errors.
const LABEL: &str = "an integer >= 0, from 2⁶³ on in quotes";

/// The allowed levels, for errors.
const LEVEL: &str = "an integer >= 0 or \"auto\"";

/// The allowed integers that count something, for errors.
const COUNT: &str = "an integer >= 0";

impl Section<'_> {
    /// Reads keys over what settings have.
    pub(super) fn fill<T: Keyed>(&mut self, settings: &mut T) -> Result<(), SceneError> {
        for key in T::KEYS {
            if let Some(entry) = self.take(key.name) {
                read(&entry, (key.slot)(settings))?;
            }
        }
        Ok(())
    }

    /// The settings of a table that has only their keys, over what they have.
    pub(super) fn filled<T: Keyed>(mut self, mut settings: T) -> Result<T, SceneError> {
        self.fill(&mut settings)?;
        self.finish()?;
        Ok(settings)
    }
}

/// Stores an entry's value.
fn read(entry: &Entry, slot: Slot) -> Result<(), SceneError> {
    match slot {
        Slot::Switch(into) => *into = entry.value.as_bool().ok_or_else(|| entry.mistyped("true or false"))?,
        Slot::Number(range, into) => *into = entry.number(range)?,
        Slot::Given(range, into) => *into = Some(entry.number(range)?),
        Slot::Choice(Choice { names, mut choose, .. }) => {
            let allowed = || names.iter().map(|name| format!("{name:?}")).collect::<Vec<_>>().join(" or ");
            let text = entry.value.as_str().ok_or_else(|| entry.mistyped(allowed()))?;
            choose(names.iter().position(|name| *name == text).ok_or_else(|| entry.refused(allowed()))?);
        }
        Slot::Direction(into) => *into = entry.numbers(Interval::FINITE)?.into(),
        Slot::Vector(range, into) => *into = Some(entry.numbers(range)?.into()),
        Slot::Light(into) => *into = light(entry)?,
        Slot::Pixels(into) => *into = entry.integer(PIXELS)?,
        Slot::Background(into) => *into = rgba(entry)?,
        Slot::Planes(into) => *into = rows(entry, &format!("an array of at most {MAX_PLANES} [nx, ny, nz, d]"))?,
        Slot::Crop(into) => {
            let corners = "[[x, y, z], [x, y, z]], each number of the first below that of the second";
            let [low, high] = entry.array(corners)?;
            *into = Some([low.numbers(Interval::FINITE)?.into(), high.numbers(Interval::FINITE)?.into()]);
        }
        Slot::Colors(into) => *into = Some(points(entry, "[value, [r, g, b]]", rgb)?),
        Slot::Shares(point, into) => *into = Some(points(entry, point, |share| share.number(Interval::SHARE))?),
        Slot::Ranges(into) => *into = Some(rows(entry, "an array of one or more [lo, hi]")?),
        Slot::Labels(into) => *into = labels(entry)?,
        Slot::Label(into) => {
            // TOML's integers end at 2⁶³.
            let quoted = entry.value.as_str().map(|text| text.parse().map_err(|_| entry.refused(LABEL)));
            *into = Some(quoted.unwrap_or_else(|| entry.integer(LABEL))?);
        }
        Slot::Text(allowed, into) => {
            *into = Some(entry.value.as_str().ok_or_else(|| entry.mistyped(allowed))?.to_owned());
        }
        Slot::Number32(into) => *into = Some(entry.integer(COUNT)?),
        Slot::Level(into) => match entry.value.as_str() {
            Some("auto") => *into = None,
            Some(_) => return Err(entry.refused(LEVEL)),
            None => *into = Some(entry.integer(LEVEL)?),
        },
        Slot::Series(into) => {
            let number = || entry.integer::<u32>("an integer >= 0, or a SeriesInstanceUID in quotes");
            *into = Some(match entry.value.as_str() {
                Some(text) => text.to_owned(),
                None => number()?.to_string(),
            });
        }
        Slot::Dims(into) => {
            let [x, y, z] = entry.array::<3>(SIZES)?.map(|size| size.integer::<i64>(SIZES));
            *into = Some(dims_of([x?, y?, z?]).ok_or_else(|| entry.refused(SIZES))?);
        }
        Slot::Bytes(into) => *into = Some(entry.integer(COUNT)?),
    }
    Ok(())
}

/// An array of arrays of numbers.
fn rows<const N: usize>(entry: &Entry, allowed: &str) -> Result<Vec<[f64; N]>, SceneError> {
    entry.items(allowed)?.iter().map(|item| item.numbers(Interval::FINITE)).collect()
}

/// A light's name or a direction.
fn light(entry: &Entry) -> Result<Light, SceneError> {
    let allowed = "\"headlight\", \"upper-left\" or [x, y, z]";
    match entry.value.as_str() {
        Some("headlight") => Ok(Light::Headlight),
        Some("upper-left") => Ok(Light::UpperLeft),
        Some(_) => Err(entry.refused(allowed)),
        None if entry.value.is_array() => Ok(Light::Direction(entry.numbers(Interval::FINITE)?.into())),
        None => Err(entry.mistyped(allowed)),
    }
}

/// Control points `[position, value]`; `point` is their form, for errors.
fn points<T>(entry: &Entry, point: &str, value: impl Fn(&Entry) -> Result<T, SceneError>) -> Result<Ramp<T>, SceneError>
where
    T: Copy + Add<Output = T> + Mul<f64, Output = T>,
{
    let allowed = format!("an array of one or more {point}");
    let items = entry.items(&allowed)?;
    let points = items.iter().map(|item| {
        let [at, of_point] = item.array(point)?;
        Ok((at.number(Interval::FINITE)?, value(&of_point)?))
    });
    Ramp::new(points.collect::<Result<_, SceneError>>()?).map_err(|error| match error {
        RampError::Empty => entry.refused(allowed),
        RampError::NotFinite { index, position } => {
            let key = format!("{}[{index}][0]", entry.key);
            entry.origins.refused(SettingError::new(key, position, Interval::FINITE))
        }
        RampError::NotIncreasing { index, .. } => {
            items[index].refused("points whose first number is above that of the point before")
        }
    })
}

/// `[[transfer.label]]`.
fn labels(entry: &Entry) -> Result<BTreeMap<u64, LabelTables>, SceneError> {
    let mut labels = BTreeMap::new();
    for item in entry.items("tables [[transfer.label]]")? {
        let section = item.section("a table [[transfer.label]]")?;
        let LabelTable { label, tables } = section.filled(LabelTable::default())?;
        let key = format!("{}.label", item.key);
        let label = label.ok_or_else(|| entry.origins.invalid(&key, &[], "no such key", LABEL))?;
        tables.check(&item.key).map_err(|error| entry.origins.refused(error))?;
        if labels.insert(label, tables).is_some() {
            let allowed = "a label that no earlier table has";
            return Err(entry.origins.refused(SettingError::new(key, label.to_string(), allowed)));
        }
    }
    Ok(labels)
}

/// A key's value; `None` for one that is not stated, or written by tables of their own.
pub(super) fn value(slot: &Slot) -> Option<Value> {
    Some(match slot {
        Slot::Switch(value) => (**value).into(),
        Slot::Number(_, value) => (**value).into(),
        Slot::Given(_, value) => (**value)?.into(),
        Slot::Choice(Choice { names, chosen, .. }) => names[(*chosen)?].into(),
        Slot::Direction(value) => vector(**value),
        Slot::Vector(_, value) => vector((**value)?),
        Slot::Light(Light::Headlight) => "headlight".into(),
        Slot::Light(Light::UpperLeft) => "upper-left".into(),
        Slot::Light(Light::Direction(direction)) => vector(*direction),
        Slot::Pixels(value) => i64::from(**value).into(),
        Slot::Background(value) => numbers(**value),
        Slot::Planes(value) => value.iter().copied().map(numbers).collect::<Vec<_>>().into(),
        Slot::Crop(value) => (**value)?.map(vector).to_vec().into(),
        Slot::Colors(value) => ramp(value.as_ref()?, vector),
        Slot::Shares(_, value) => ramp(value.as_ref()?, Value::from),
        Slot::Ranges(value) => value.as_ref()?.iter().copied().map(numbers).collect::<Vec<_>>().into(),
        Slot::Labels(_) => return None,
        Slot::Label(value) => {
            (**value).map(|label| i64::try_from(label).map_or(label.to_string().into(), Value::from))?
        }
        Slot::Text(_, value) | Slot::Series(value) => value.as_deref()?.into(),
        Slot::Number32(value) | Slot::Level(value) => i64::from((**value)?).into(),
        Slot::Dims(value) => (**value)?.to_array().map(i64::from).map(Value::from).to_vec().into(),
        Slot::Bytes(value) => i64::try_from((**value)?).ok()?.into(),
    })
}

/// A ramp as `[position, value]` points.
fn ramp<T>(ramp: &Ramp<T>, value: impl Fn(T) -> Value) -> Value
where
    T: Copy + std::ops::Add<Output = T> + std::ops::Mul<f64, Output = T>,
{
    ramp.points().iter().map(|&(at, of)| Value::Array(vec![at.into(), value(of)])).collect::<Vec<_>>().into()
}

fn vector(vector: DVec3) -> Value {
    numbers(vector.to_array())
}

fn numbers(numbers: impl IntoIterator<Item = f64>) -> Value {
    numbers.into_iter().collect::<Vec<_>>().into()
}
