//! What every reader gives.

use std::collections::BTreeMap;

use glam::{DVec3, UVec3};

use super::Orientation;
use super::samples::SampleType;

/// What is in a file of values or of labels.
pub(crate) struct Loaded<T> {
    pub(crate) dims: UVec3,
    /// Of the samples that the values come from.
    pub(crate) kind: SampleType,
    /// If the file gives one.
    pub(super) spacing: Option<DVec3>,
    /// What the spacing is in, if the file says so.
    pub(super) unit: Option<String>,
    /// If the file gives one.
    pub(super) orientation: Option<Orientation>,
    /// The colours that the file gives to values, ascending by value.
    pub(super) palette: Option<Vec<(f64, DVec3)>>,
    /// What the values are called, where they are labels.
    pub(super) label_names: BTreeMap<u16, String>,
    /// X fastest, as many as there are voxels.
    pub(crate) values: Vec<T>,
}

impl<T> Loaded<T> {
    /// Values of which the file says nothing else.
    pub(super) fn new(dims: UVec3, kind: SampleType, values: Vec<T>) -> Self {
        let label_names = BTreeMap::new();
        Self { dims, kind, spacing: None, unit: None, orientation: None, palette: None, label_names, values }
    }
}
