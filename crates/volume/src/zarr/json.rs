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

    /// The error for this value.
    pub(super) fn invalid(&self, allowed: &str) -> VolumeError {
        let found = self.value.map_or("nothing".to_owned(), |value| shown(&value.to_string()));
        invalid(self.path, &self.key, found, allowed)
    }
}
