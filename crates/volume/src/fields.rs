//! The named fields of a text header.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::path::PathBuf;

use super::VolumeError;
use super::error::volume::invalid;
use super::text::shown;

/// A header's fields, each at most once.
pub(super) struct Fields {
    pub(super) path: PathBuf,
    fields: BTreeMap<String, String>,
}

impl Fields {
    pub(super) fn new(path: PathBuf) -> Self {
        Self { path, fields: BTreeMap::new() }
    }

    pub(super) fn add(&mut self, name: &str, value: &str) -> Result<(), VolumeError> {
        match self.fields.insert(name.to_owned(), value.trim().to_owned()) {
            None => Ok(()),
            Some(_) => Err(self.invalid(name, "the field twice", "each field once")),
        }
    }

    pub(super) fn get(&self, name: &str) -> Option<&str> {
        self.fields.get(name).map(String::as_str)
    }

    /// A field's value, which `parse` makes from its text, or from `None` if the field is missing.
    pub(super) fn value<T>(
        &self,
        name: &str,
        allowed: &str,
        parse: impl Fn(Option<&str>) -> Option<T>,
    ) -> Result<T, VolumeError> {
        let text = self.get(name);
        parse(text).ok_or_else(|| self.refused(name, text, allowed))
    }

    /// The error for a field's text. It is no part of [`Self::value`], which is compiled for every field.
    #[cold]
    #[inline(never)]
    fn refused(&self, name: &str, text: Option<&str>, allowed: &str) -> VolumeError {
        self.invalid(name, text.map_or("no such field".to_owned(), shown), allowed)
    }

    pub(super) fn invalid(&self, field: &str, found: impl Display, allowed: impl Display) -> VolumeError {
        invalid(&self.path, field, found, allowed)
    }
}
