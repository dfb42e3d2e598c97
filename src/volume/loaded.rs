//! The result of every reader.

use std::collections::BTreeMap;

use glam::{DVec3, UVec3};

use super::Orientation;
use super::samples::SampleType;

/// The contents of a file of values or labels.
pub(crate) struct Loaded<T> {
    pub(crate) dims: UVec3,
    /// The type of the samples in the file.
    pub(crate) kind: SampleType,
    /// World units between voxels, if the file states them.
    pub(super) spacing: Option<DVec3>,
    /// The unit of the spacing, if the file states it.
    pub(super) unit: Option<String>,
    /// The orientation, if the file states it.
    pub(super) orientation: Option<Orientation>,
    /// The colours that the file assigns to values, in ascending order of values.
    pub(super) palette: Option<Vec<(f64, DVec3)>>,
    /// The values' names, if they are labels.
    pub(super) label_names: BTreeMap<u16, String>,
    /// One value per voxel, x fastest.
    pub(crate) values: Vec<T>,
}

impl<T> Loaded<T> {
    /// Values about which the file states nothing else.
    pub(super) fn new(dims: UVec3, kind: SampleType, values: Vec<T>) -> Self {
        let label_names = BTreeMap::new();
        Self { dims, kind, spacing: None, unit: None, orientation: None, palette: None, label_names, values }
    }
}
