//! The levels of an OME-Zarr image: <https://ngff.openmicroscopy.org/0.5/#multiscale-md>.
//!
//! This is read from JSON here: `ome_zarr_metadata` tells of a wrong value neither where it stands nor what is allowed, and brings five crates.

use std::path::Path;

use glam::{DMat3, DVec3};

use super::super::VolumeError;
use super::super::unit;
use super::axes::{Axes, Axis, KINDS};
use super::json::Json;

/// An image's axes, and its arrays from the finest.
pub(super) struct Multiscale {
    pub(super) axes: Axes,
    pub(super) unit: Option<String>,
    /// The directions of x, y and z in the patient (RAS), if all of them are stated.
    pub(super) orientation: Option<DMat3>,
    pub(super) datasets: Vec<Dataset>,
}

/// An array, and where its voxels are.
pub(super) struct Dataset {
    /// The array's path within the store.
    pub(super) path: String,
    /// The distance between voxels.
    pub(super) spacing: DVec3,
    /// The place of the first voxel's centre.
    pub(super) first: DVec3,
}

const SPACE: [Axis; 3] = [Axis::X, Axis::Y, Axis::Z];

/// Scales and translations of all axes in the order t, c, z, y, x.
struct Placement([(f64, f64); KINDS]);

impl Multiscale {
    /// Reads the first of an image's `multiscales`, `multiscale`.
    pub(super) fn read(path: &Path, multiscale: &Json) -> Result<Self, VolumeError> {
        let axes_json = multiscale.get("axes");
        let axes = Axes::read(&axes_json)?;
        let members = axes_json.members();
        let units = SPACE.map(|axis| Some(members[axes.of(axis)?].get("unit").text().unwrap_or_default()));
        let mut datasets: Vec<Dataset> = Vec::new();
        for dataset in multiscale.get("datasets").list("a list of at least one dataset")? {
            let mut placement = Placement([(1.0, 0.0); KINDS]);
            placement.transform(&dataset.get("coordinateTransformations"), &axes)?;
            placement.transform(&multiscale.get("coordinateTransformations"), &axes)?;
            let [z, y, x] = [Axis::Z, Axis::Y, Axis::X].map(|axis| placement.0[axis as usize]);
            let (spacing, first) = (DVec3::new(x.0, y.0, z.0), DVec3::new(x.1, y.1, z.1));
            datasets.push(Dataset { path: path_of(&dataset.get("path"))?, spacing, first });
        }
        let finest = datasets.first().map_or(DVec3::ONE, |finest| finest.spacing);
        let (unit, factors) = unit::shared((path, "axes' units"), finest, units);
        for Dataset { spacing, first, .. } in &mut datasets {
            (*spacing, *first) = (*spacing * factors, *first * factors);
        }
        if datasets.is_empty() {
            return Err(multiscale.get("datasets").invalid("a list of at least one dataset"));
        }
        let orientation = orientation(&axes_json, &axes)?;
        Ok(Self { axes, unit, orientation, datasets })
    }
}

impl Placement {
    /// Applies transformations, the first one first.
    fn transform(&mut self, transformations: &Json, axes: &Axes) -> Result<(), VolumeError> {
        if !transformations.is_some() {
            return Ok(());
        }
        for transformation in transformations.list("a list of scales and translations")? {
            let kind = transformation.get("type");
            match kind.text() {
                Some("identity") => {}
                Some("scale") => {
                    let scales = numbers(&transformation.get("scale"), axes, 1.0, |scale| scale > 0.0)?;
                    for ((scale, first), by) in self.0.iter_mut().zip(scales) {
                        (*scale, *first) = (*scale * by, *first * by);
                    }
                }
                Some("translation") => {
                    let translations = numbers(&transformation.get("translation"), axes, 0.0, |_| true)?;
                    for ((_, first), by) in self.0.iter_mut().zip(translations) {
                        *first += by;
                    }
                }
                _ => return Err(kind.invalid("identity, scale or translation")),
            }
        }
        Ok(())
    }
}

/// The directions of x, y and z in a patient, by the axes' `orientation` (RFC 4 of NGFF); `None` unless each has one of the six.
///
/// # Errors
/// If two of them lie along the same line.
fn orientation(all: &Json, axes: &Axes) -> Result<Option<DMat3>, VolumeError> {
    const DIRECTIONS: [(&str, DVec3); 6] = [
        ("left-to-right", DVec3::X),
        ("right-to-left", DVec3::NEG_X),
        ("posterior-to-anterior", DVec3::Y),
        ("anterior-to-posterior", DVec3::NEG_Y),
        ("inferior-to-superior", DVec3::Z),
        ("superior-to-inferior", DVec3::NEG_Z),
    ];
    let members = all.members();
    let direction = |axis: Axis| {
        let value = members[axes.of(axis)?].get("orientation").get("value");
        DIRECTIONS.iter().find(|(name, _)| Some(*name) == value.text()).map(|&(_, direction)| direction)
    };
    let [Some(x), Some(y), Some(z)] = SPACE.map(direction) else { return Ok(None) };
    let directions = DMat3::from_cols(x, y, z);
    if directions.determinant() == 0.0 {
        return Err(all.invalid("orientations along three different lines"));
    }
    Ok(Some(directions))
}

/// A finite number for each axis.
fn numbers(list: &Json, axes: &Axes, other: f64, is_valid: fn(f64) -> bool) -> Result<[f64; KINDS], VolumeError> {
    let allowed = format!("{} numbers, one for each axis; of scales, none that is not above 0", axes.count());
    let members = list.list(&allowed)?;
    let numbers: Option<Vec<f64>> = members.iter().map(|member| member.number().filter(|&n| is_valid(n))).collect();
    let numbers = numbers.filter(|numbers| numbers.len() == axes.count()).ok_or_else(|| list.invalid(&allowed))?;
    Ok(axes.sort(&numbers, other))
}

/// A path that leads down from a folder.
fn path_of(path: &Json) -> Result<String, VolumeError> {
    let is_name = |name: &str| !["", ".", ".."].contains(&name) && !name.contains(['\\', ':', '\0']);
    match path.text() {
        Some(text) if text.split('/').all(is_name) => Ok(text.to_owned()),
        _ => Err(path.invalid("a path that leads to an array within the store, without . and ..")),
    }
}
