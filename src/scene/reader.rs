//! Typed access to a scene's TOML tables. Every error names the origin, the full key, what was found and what is allowed.

use toml::{Table, Value};

use super::SceneError;
use crate::error::setting::{Allowed, Found, Interval, SettingError};
use crate::settings::economies::TABLE;

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
        let is_related = |key: &&str| is_overridden(key) || !self.overrides_within(key).is_empty();
        let any_overridden = is_overridden(key) || related.iter().any(is_related);
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
            "splatting.classification" => &["splatting.method", TABLE],
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
        match self.take(name) {
            Some(entry) => entry.section("a table"),
            None => Ok(Self { origins: self.origins, name: self.key(name), table: Table::new(), known: Vec::new() }),
        }
    }

    /// Takes out the value of a key, if the key is present.
    pub(super) fn take(&mut self, name: &'static str) -> Option<Entry<'a>> {
        self.known.push(name);
        let value = self.table.remove(name)?;
        Some(Entry { origins: self.origins, key: self.key(name), value })
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

/// A value and its full key.
pub(super) struct Entry<'a> {
    pub(super) origins: &'a Origins<'a>,
    pub(super) key: String,
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

    /// An integer that a type holds.
    pub(super) fn integer<T: TryFrom<i64>>(&self, allowed: &str) -> Result<T, SceneError> {
        let integer = self.value.as_integer().ok_or_else(|| self.mistyped(allowed))?;
        T::try_from(integer).map_err(|_| self.refused(allowed))
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
