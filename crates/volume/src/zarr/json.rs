//! Values in files of metadata, with the keys that lead to them, for errors.

use std::path::Path;

use serde_json::Value;

use super::super::VolumeError;
use super::super::error::volume::invalid;
use super::super::text::shown;

/// A value, or the lack of one.
#[derive(Clone)]
pub(super) struct Json<'a> {
    path: &'a Path,
    key: String,
    value: Option<&'a Value>,
}

/// Parses a file.
pub(super) fn parse(path: &Path, bytes: &[u8]) -> Result<Value, VolumeError> {
    serde_json::from_slice(bytes).map_err(|error| invalid(path, "metadata", error, "JSON"))
}

impl<'a> Json<'a> {
    /// The whole of a file.
    pub(super) fn new(path: &'a Path, value: &'a Value) -> Self {
        Self { path, key: String::new(), value: Some(value) }
    }

    /// Whether the file has this name.
    pub(super) fn is_in(&self, name: &str) -> bool {
        self.path.ends_with(name)
    }

    /// The value of a key.
    pub(super) fn get(&self, key: &str) -> Self {
        let value = self.value.and_then(|value| value.get(key)).filter(|value| !value.is_null());
        let key = if self.key.is_empty() { key.to_owned() } else { format!("{}.{key}", self.key) };
        Self { path: self.path, key, value }
    }

    /// Whether there is a value.
    pub(super) fn is_some(&self) -> bool {
        self.value.is_some()
    }

    /// The value, if there is one.
    pub(super) fn value(&self) -> Option<&'a Value> {
        self.value
    }

    /// The members of a list.
    pub(super) fn list(&self, allowed: &str) -> Result<Vec<Self>, VolumeError> {
        let Some(Value::Array(values)) = self.value else { return Err(self.invalid(allowed)) };
        let member = |(index, value): (usize, &'a Value)| {
            let key = format!("{}[{index}]", self.key);
            Self { path: self.path, key, value: Some(value) }
        };
        Ok(values.iter().enumerate().map(member).collect())
    }

    /// The members of a list; none if there is no value or another one.
    pub(super) fn members(&self) -> Vec<Self> {
        self.list("").unwrap_or_default()
    }

    /// A text; `None` if there is no value or another one.
    pub(super) fn text(&self) -> Option<&'a str> {
        self.value.and_then(Value::as_str)
    }

    /// A finite number; `None` if there is no value or another one.
    pub(super) fn number(&self) -> Option<f64> {
        self.value.and_then(Value::as_f64).filter(|number| number.is_finite())
    }

    /// A whole number that is not negative; `None` if there is no value or another one.
    pub(super) fn integer(&self) -> Option<u64> {
        self.value.and_then(Value::as_u64)
    }

    /// A list of whole numbers that are not negative.
    pub(super) fn integers(&self, allowed: &str) -> Result<Vec<u64>, VolumeError> {
        let integers = self.list(allowed)?.iter().map(Self::integer).collect::<Option<_>>();
        integers.ok_or_else(|| self.invalid(allowed))
    }

    /// Checks that this is the only value allowed.
    pub(super) fn expect(&self, allowed: &Value) -> Result<(), VolumeError> {
        if self.value == Some(allowed) { Ok(()) } else { Err(self.invalid(&allowed.to_string())) }
    }

    /// Checks that an object, if there is one, has no other keys than these.
    pub(super) fn only(&self, keys: &[&str]) -> Result<(), VolumeError> {
        let object = self.value.and_then(Value::as_object);
        match object.and_then(|object| object.keys().find(|key| !keys.contains(&key.as_str()))) {
            Some(key) => Err(self.get(key).invalid(&format!("no key but {keys:?}"))),
            None => Ok(()),
        }
    }

    /// The error for this value.
    pub(super) fn invalid(&self, allowed: &str) -> VolumeError {
        let found = match self.value {
            None => "nothing".to_owned(),
            Some(Value::String(text)) => shown(text),
            Some(value) => shown(&value.to_string()),
        };
        invalid(self.path, &self.key, found, allowed)
    }
}
