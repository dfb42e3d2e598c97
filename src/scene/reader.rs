//! Typed access to a scene's TOML tables. Every error names the origin, the full key, what was found and what is allowed.

use std::ops::{Add, Mul};

use glam::UVec3;
use toml::{Table, Value};

use super::{ImageSettings, SceneError};
use crate::error::setting::{Allowed, Found, Interval, SettingError};
use crate::settings::economies::KEYS;
use crate::settings::transfer_function::{Ramp, RampError};
use crate::volume::{SIZES, dims_of};

/// The origin of values set on the command line.
pub(super) const OVERRIDE: &str = "--set";

/// The origin of each key's value.
pub(super) struct Origins<'a> {
    /// The scene file.
    pub(super) file: &'a str,
    /// The keys given by `--set`.
    pub(super) overridden: Vec<String>,
    /// The file's tables with the overrides applied.
    pub(super) written: Table,
}

impl Origins<'_> {
    /// The error for the value of `key`. Its origin is the command line if that key, or one of the `related` keys that it must be
    /// consistent with, was overridden.
    pub(super) fn invalid(
        &self,
        key: &str,
        related: &[&str],
        found: impl Into<String>,
        allowed: impl Into<Allowed>,
    ) -> SceneError {
        let is_overridden = |key: &str| self.overridden.iter().any(|set| is_within(key, set));
        let any_overridden = is_overridden(key) || related.iter().any(|key| is_overridden(key));
        SceneError::Invalid {
            origin: if any_overridden { OVERRIDE } else { self.file }.to_owned(),
            key: key.to_owned(),
            found: found.into(),
            allowed: allowed.into(),
        }
    }

    /// The overrides of a table's keys. They also create the table if the file has none: `colour.red` adds a table `colour`.
    pub(super) fn overrides_within(&self, table: &str) -> Vec<&str> {
        self.overridden.iter().filter(|set| is_within(set, table)).map(String::as_str).collect()
    }

    /// The error for settings that their type's check refused, quoting the value as written.
    pub(super) fn refused(&self, error: SettingError) -> SceneError {
        let SettingError { key, found, allowed, .. } = error;
        let related: &[&str] = match &key[..] {
            "camera.up" => &["camera.direction"],
            "splatting.compositing" => &["preset", "splatting.method", "splatting.order"],
            "splatting.classification" => {
                let [whole_below, beta, resolution] = KEYS.map(|(key, _)| key);
                &["splatting.method", whole_below, beta, resolution]
            }
            "splatting.falloff" => &["splatting.classification"],
            "splatting.interpolation" => &["splatting.classification", "splatting.radius", "splatting.falloff"],
            _ => &[],
        };
        let found = match (found, self.written_at(&key)) {
            // An error about several keys is described in words.
            (Found::Text(text), _) if !related.is_empty() => text,
            (_, Some(value)) => concise(value),
            (found, None) => found.to_string(),
        };
        self.invalid(&key, related, found, allowed)
    }

    /// The value of a key, such as `transfer.opacity[2][1]`.
    fn written_at(&self, key: &str) -> Option<&Value> {
        let mut names = key.split(['.', '[']);
        let first = self.written.get(names.next()?)?;
        names.try_fold(first, |value, name| match name.strip_suffix(']') {
            Some(index) => value.get(index.parse::<usize>().ok()?),
            None => value.get(name),
        })
    }
}

/// Whether `key` is `ancestor` or one of its elements: `camera.up[1]` is within `camera.up` and `camera`.
fn is_within(key: &str, ancestor: &str) -> bool {
    key.strip_prefix(ancestor).is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
}

/// A table whose keys are taken out one by one; those left at the end are unknown.
pub(super) struct Section<'a> {
    pub(super) origins: &'a Origins<'a>,
    /// The table's full key; empty for the root.
    pub(super) name: String,
    table: Table,
    /// The keys requested so far.
    known: Vec<&'static str>,
}

impl<'a> Section<'a> {
    /// The whole file.
    pub(super) fn root(origins: &'a Origins<'a>, table: Table) -> Self {
        Self { origins, name: String::new(), table, known: Vec::new() }
    }

    /// The table under a key; empty if missing.
    pub(super) fn section(&mut self, name: &'static str) -> Result<Self, SceneError> {
        let empty = Self { origins: self.origins, name: self.key(name), table: Table::new(), known: Vec::new() };
        let mut section = empty;
        self.read(name, &mut section, |entry| entry.section("a table"))?;
        Ok(section)
    }

    /// Stores the value of a key in `into`, if the key is present.
    pub(super) fn read<T>(
        &mut self,
        name: &'static str,
        into: &mut T,
        read: impl FnOnce(&Entry<'a>) -> Result<T, SceneError>,
    ) -> Result<(), SceneError> {
        self.known.push(name);
        if let Some(value) = self.table.remove(name) {
            *into = read(&Entry { origins: self.origins, key: self.key(name), value })?;
        }
        Ok(())
    }

    /// The value of a required key.
    pub(super) fn require<T>(
        &mut self,
        name: &'static str,
        allowed: &str,
        read: impl FnOnce(&Entry<'a>) -> Result<T, SceneError>,
    ) -> Result<T, SceneError> {
        let mut value = None;
        self.read(name, &mut value, |entry| read(entry).map(Some))?;
        value.ok_or_else(|| self.origins.invalid(&self.key(name), &[], "no such key", allowed))
    }

    /// Whether a key is present.
    pub(super) fn states(&self, name: &str) -> bool {
        self.table.contains_key(name)
    }

    /// Refuses a former key, naming the key that replaced it.
    pub(super) fn moved(&self, former: &str, key: &str) -> Result<(), SceneError> {
        if !self.table.contains_key(former) {
            return Ok(());
        }
        Err(self.origins.invalid(&self.key(former), &[], "the former name of a setting", key))
    }

    /// Refuses the keys that were not requested.
    pub(super) fn finish(self) -> Result<(), SceneError> {
        let Some(name) = self.table.keys().next() else { return Ok(()) };
        let key = self.key(&name.escape_debug().to_string());
        let similar =
            self.known.iter().map(|known| (strsim::jaro(known, name), known)).filter(|(share, _)| *share > 0.8);
        let meant = similar.max_by(|(one, _), (other, _)| one.total_cmp(other));
        let found = meant.map_or("an unknown key".to_owned(), |(_, meant)| format!("an unknown key (perhaps {meant})"));
        Err(self.origins.invalid(&key, &self.origins.overrides_within(&key), found, self.known.join(", ")))
    }

    /// The full name of a key.
    fn key(&self, name: &str) -> String {
        if self.name.is_empty() { name.to_owned() } else { format!("{}.{name}", self.name) }
    }
}

/// The allowed labels, for errors.
pub(super) const LABEL: &str = "an integer >= 0, from 2⁶³ on in quotes";

/// A value and its full key.
pub(super) struct Entry<'a> {
    origins: &'a Origins<'a>,
    key: String,
    pub(super) value: Value,
}

impl<'a> Entry<'a> {
    /// The error for a value that is out of range.
    pub(super) fn refused(&self, allowed: impl Into<Allowed>) -> SceneError {
        self.origins.invalid(&self.key, &[], concise(&self.value), allowed)
    }

    /// The error for a value of the wrong type.
    pub(super) fn mistyped(&self, allowed: impl Into<Allowed>) -> SceneError {
        self.origins.invalid(&self.key, &self.origins.overrides_within(&self.key), typed(&self.value), allowed)
    }

    /// The value as a table.
    pub(super) fn section(&self, allowed: &str) -> Result<Section<'a>, SceneError> {
        let table = self.value.as_table().ok_or_else(|| self.mistyped(allowed))?.clone();
        Ok(Section { origins: self.origins, name: self.key.clone(), table, known: Vec::new() })
    }

    pub(super) fn boolean(&self) -> Result<bool, SceneError> {
        self.value.as_bool().ok_or_else(|| self.mistyped("true or false"))
    }

    pub(super) fn text(&self, allowed: &str) -> Result<String, SceneError> {
        self.value.as_str().map(str::to_owned).ok_or_else(|| self.mistyped(allowed))
    }

    /// A choice by its name.
    pub(super) fn choice<T: Copy>(&self, choices: &[(&str, T)]) -> Result<T, SceneError> {
        let allowed = || choices.iter().map(|(name, _)| format!("{name:?}")).collect::<Vec<_>>().join(" or ");
        let text = self.value.as_str().ok_or_else(|| self.mistyped(allowed()))?;
        let chosen = choices.iter().find(|(name, _)| *name == text);
        chosen.map(|&(_, choice)| choice).ok_or_else(|| self.refused(allowed()))
    }

    /// A number of pixels.
    pub(super) fn pixels(&self) -> Result<u32, SceneError> {
        let allowed = ImageSettings::PIXELS;
        let integer = self.value.as_integer().ok_or_else(|| self.mistyped(allowed))?;
        u32::try_from(integer).map_err(|_| self.refused(allowed))
    }

    /// The number of voxels along x, y and z.
    pub(super) fn dims(&self) -> Result<UVec3, SceneError> {
        let sizes = self.array::<3>(SIZES)?.map(|size| size.value.as_integer().ok_or_else(|| size.mistyped(SIZES)));
        let [x, y, z] = sizes;
        dims_of([x?, y?, z?]).ok_or_else(|| self.refused(SIZES))
    }

    /// A number of bytes.
    pub(super) fn bytes(&self) -> Result<u64, SceneError> {
        let allowed = "an integer >= 0";
        let integer = self.value.as_integer().ok_or_else(|| self.mistyped(allowed))?;
        u64::try_from(integer).map_err(|_| self.refused(allowed))
    }

    /// The number of a channel or time.
    pub(super) fn count(&self) -> Result<u32, SceneError> {
        let allowed = "an integer >= 0";
        let integer = self.value.as_integer().ok_or_else(|| self.mistyped(allowed))?;
        u32::try_from(integer).map_err(|_| self.refused(allowed))
    }

    /// The number of a level; `None` for one that is chosen.
    pub(super) fn level(&self) -> Result<Option<u32>, SceneError> {
        let allowed = "an integer >= 0 or \"auto\"";
        match (self.value.as_integer(), self.value.as_str()) {
            (Some(integer), _) => u32::try_from(integer).map(Some).map_err(|_| self.refused(allowed)),
            (_, Some("auto")) => Ok(None),
            (_, Some(_)) => Err(self.refused(allowed)),
            _ => Err(self.mistyped(allowed)),
        }
    }

    /// A series, by its number or its identity.
    pub(super) fn series(&self) -> Result<Option<String>, SceneError> {
        let allowed = "an integer >= 0, or a SeriesInstanceUID in quotes";
        match (self.value.as_integer(), self.value.as_str()) {
            (Some(integer), _) => {
                u32::try_from(integer).map(|number| Some(number.to_string())).map_err(|_| self.refused(allowed))
            }
            (_, Some(text)) => Ok(Some(text.to_owned())),
            _ => Err(self.mistyped(allowed)),
        }
    }

    /// A label.
    pub(super) fn label(&self) -> Result<u64, SceneError> {
        match (self.value.as_integer(), self.value.as_str()) {
            (Some(integer), _) => u64::try_from(integer).map_err(|_| self.refused(LABEL)),
            // TOML's integers end at 2⁶³.
            (_, Some(text)) => text.parse().map_err(|_| self.refused(LABEL)),
            _ => Err(self.mistyped(LABEL)),
        }
    }

    /// A number, written as a float or an integer. The settings' own check tests its range.
    pub(super) fn number(&self, range: Interval) -> Result<f64, SceneError> {
        match self.value {
            Value::Integer(integer) => Ok(integer as f64),
            Value::Float(float) => Ok(float),
            _ => Err(self.mistyped(range)),
        }
    }

    /// An array of N numbers.
    pub(super) fn numbers<const N: usize>(&self, range: Interval) -> Result<[f64; N], SceneError> {
        self.numbers_or(range, &format!("{N} numbers, each {range}"))
    }

    /// An array of N numbers, where errors say that something else is allowed too.
    pub(super) fn numbers_or<const N: usize>(&self, range: Interval, allowed: &str) -> Result<[f64; N], SceneError> {
        let mut numbers = [0.0; N];
        let items: [Entry; N] = self.array(allowed)?;
        for (number, item) in numbers.iter_mut().zip(items) {
            *number = item.number(range)?;
        }
        Ok(numbers)
    }

    /// An array of a fixed length.
    pub(super) fn array<const N: usize>(&self, allowed: &str) -> Result<[Self; N], SceneError> {
        self.items(allowed)?.try_into().map_err(|_| self.refused(allowed))
    }

    /// An array of any length.
    pub(super) fn items(&self, allowed: &str) -> Result<Vec<Self>, SceneError> {
        let values = self.value.as_array().ok_or_else(|| self.mistyped(allowed))?;
        let item = |(index, value): (usize, &Value)| Entry {
            origins: self.origins,
            key: format!("{}[{index}]", self.key),
            value: value.clone(),
        };
        Ok(values.iter().enumerate().map(item).collect())
    }

    /// Control points `[position, value]`; `point` is an example for errors.
    pub(super) fn ramp<T>(
        &self,
        point: &str,
        read: impl Fn(&Entry) -> Result<T, SceneError>,
    ) -> Result<Ramp<T>, SceneError>
    where
        T: Copy + Add<Output = T> + Mul<f64, Output = T>,
    {
        let allowed = format!("an array of one or more {point}");
        let items = self.items(&allowed)?;
        let points = items.iter().map(|item| {
            let [at, value] = item.array(point)?;
            Ok((at.number(Interval::FINITE)?, read(&value)?))
        });
        Ramp::new(points.collect::<Result<_, SceneError>>()?).map_err(|error| match error {
            RampError::Empty => self.refused(allowed),
            RampError::NotFinite { index, position } => {
                let key = format!("{}[{index}][0]", self.key);
                self.origins.refused(SettingError::new(key, position, Interval::FINITE))
            }
            RampError::NotIncreasing { index, .. } => {
                items[index].refused("points whose first number is above that of the point before")
            }
        })
    }
}

/// A value as TOML, and its type.
pub(super) fn typed(value: &Value) -> String {
    format!("{} ({})", concise(value), value.type_str())
}

/// A value as TOML, on one line of bounded length.
fn concise(value: &Value) -> String {
    const LONGEST: usize = 80;
    let text = match value {
        // TOML's own format would write hundreds of zeros for such numbers.
        Value::Float(number) if value.to_string().len() > 20 => format!("{number:e}"),
        _ => value.to_string().replace(['\n', '\r'], " "),
    };
    match text.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text,
    }
}
