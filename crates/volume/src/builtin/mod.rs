//! Procedural volumes: test objects that need no files.

mod head;
mod nerve;
mod sdf;
mod tomato;

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::{DVec3, UVec3};

use super::access::{Access, ReadOptions};
use super::{Grid, Labels, Volume, VolumeError};
use crate::parallel::prelude::*;

/// The names that [`volume`] accepts.
pub const NAMES: &[&str] = &["cube", "head", "nerve", "tomato", "marschner-lobb"];

/// The sizes that `NAME:N` accepts for the largest dimension.
const SIZES: std::ops::RangeInclusive<u32> = 2..=1024;

/// A procedural volume by name (SPEC §8): `NAME` in the paper's size, or `NAME:N` with N voxels along the largest dimension and the
/// same extent in world units.
///
/// Values are those of an 8-bit scanner, whole numbers from 0 to 255, except that `marschner-lobb` is not rounded. They are the same in
/// every run. In a segmented volume (see [`labels`]) every voxel has the label of the tissue that fills most of it.
///
/// # Errors
/// If the name is unknown, N is not a whole number from 2 to 1024, or the volume needs more memory than [`ReadOptions::memory`]
/// allows by default.
pub fn volume(name: &str) -> Result<Volume, VolumeError> {
    read(name, &Access::new(&ReadOptions::default())?)
}

#[doc(hidden)]
pub fn read(name: &str, access: &Access) -> Result<Volume, VolumeError> {
    let origin = format!("builtin:{name}");
    let invalid = |field: &str, found: &str, allowed: String| VolumeError::Invalid {
        origin: origin.clone(),
        field: field.to_owned(),
        found: format!("\"{found}\""),
        allowed,
    };
    let (kind, size) = kind_and_size(name);
    let (dims, spacing, painted) = match kind {
        "cube" => ([48, 48, 48], DVec3::ONE, Painted::Values(cube)),
        "head" => ([256, 256, 163], DVec3::ONE, Painted::Tissues(head::painted)),
        "nerve" => ([512, 512, 76], DVec3::new(1.0, 1.0, 5.0), Painted::Values(nerve::values)),
        "tomato" => ([256, 256, 64], DVec3::new(1.0, 1.0, 3.0), Painted::Tissues(tomato::painted)),
        "marschner-lobb" => ([64, 64, 64], DVec3::ONE, Painted::Values(marschner_lobb)),
        _ => return Err(invalid("name", kind, format!("{}, each alone or as NAME:N", NAMES.join(", ")))),
    };
    let full = UVec3::from(dims);
    let longest = full.max_element();
    let n = match size {
        None => longest,
        Some(size) => size.parse().ok().filter(|n| SIZES.contains(n)).ok_or_else(|| {
            invalid("size", size, format!("a whole number from {} to {}", SIZES.start(), SIZES.end()))
        })?,
    };
    let dims = UVec3::from(dims.map(|side| ((side * n + longest / 2) / longest).max(1)));
    let grid = Grid::new(dims, spacing * (f64::from(longest) / f64::from(n)));
    let bytes = match painted {
        Painted::Values(_) => size_of::<f32>(),
        Painted::Tissues(_) => size_of::<f32>() + size_of::<u16>(),
    };
    let [x, y, z] = dims.to_array();
    let voxels = u64::from(dims.element_product());
    access.reserve(origin.as_ref(), "size", format!("{x} × {y} × {z} voxels"), voxels * bytes as u64)?;
    let (values, labels) = match painted {
        Painted::Values(values) => (values(&grid), None),
        Painted::Tissues(painted) => {
            let (values, labels) = painted(&grid);
            (values, Some(labels))
        }
    };
    let volume = Volume::new(&origin, grid.dims, grid.spacing, values)?;
    match labels {
        Some(values) => {
            let names = self::labels(name).unwrap_or_default();
            let names = names.iter().map(|&(label, name)| (label, name.to_owned())).collect();
            volume.with_labels(Labels { origin, dims: grid.dims, spacing: None, values: values.into(), names })
        }
        None => Ok(volume),
    }
}

/// The function that makes a volume's values, or its values and labels.
enum Painted {
    Values(fn(&Grid) -> Vec<f32>),
    Tissues(fn(&Grid) -> (Vec<f32>, Vec<u16>)),
}

/// The labels of a procedural volume, each with its name, for `NAME` or `NAME:N`: empty if the volume is not segmented, `None` if
/// there is no such volume.
///
/// | | 0 | 1 | 2 | 3 | 4 | 5 | 6 | 7 |
/// |---|---|---|---|---|---|---|---|---|
/// | `head` | air | skin and soft tissue | skull | fluid around the brain | grey matter | white matter | ventricles | eyes |
/// | `tomato` | air | wall | gel | placenta | core | seeds | | |
pub fn labels(name: &str) -> Option<&'static [(u16, &'static str)]> {
    match kind_and_size(name).0 {
        "head" => Some(head::LABELS),
        "tomato" => Some(tomato::LABELS),
        kind => NAMES.contains(&kind).then_some(&[]),
    }
}

fn kind_and_size(name: &str) -> (&str, Option<&str>) {
    name.split_once(':').map_or((name, None), |(kind, size)| (kind, Some(size)))
}

/// A solid cube of 32³ world units: 255 inside, 0 outside, and no value in between.
fn cube(grid: &Grid) -> Vec<f32> {
    sample(grid, |p| if p.abs().max_element() < 16.0 { 255.0 } else { 0.0 })
}

/// The test signal of Marschner and Lobb (1994) over [-1, 1]³, with f_M = 6 and α = 0.25, times 255.
fn marschner_lobb(grid: &Grid) -> Vec<f32> {
    const FREQUENCY: f64 = 6.0;
    const ALPHA: f64 = 0.25;
    let half = grid.center() * grid.spacing;
    sample(grid, |p| {
        let p = p / half;
        let ripple = libm::cos(TAU * FREQUENCY * libm::cos(FRAC_PI_2 * (p.x * p.x + p.y * p.y).sqrt()));
        255.0 * (1.0 - libm::sin(FRAC_PI_2 * p.z) + ALPHA * (1.0 + ripple)) / (2.0 * (1.0 + ALPHA))
    })
}

/// A function of the world position, evaluated at every voxel.
fn sample(grid: &Grid, value: impl Fn(DVec3) -> f64 + Sync) -> Vec<f32> {
    let UVec3 { x: nx, y: ny, z: nz } = grid.dims;
    let mut values = vec![0.0; nx as usize * ny as usize * nz as usize];
    values.par_chunks_mut(nx as usize).enumerate().for_each(|(row, values)| {
        let (y, z) = (row as u32 % ny, row as u32 / ny);
        for (x, out) in (0..nx).zip(values) {
            *out = value(grid.world_position(UVec3::new(x, y, z))) as f32;
        }
    });
    values
}
