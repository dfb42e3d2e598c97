//! The slices of one grid: their order and distances.

use std::path::Path;

use glam::{DMat3, DVec3};

use super::super::VolumeError;
use super::super::access::Access;
use super::super::error::volume::invalid;
use super::super::orientation::{lengths_and_directions, orthogonal};
use super::super::shear::{self, Lattice};
use super::super::uneven::Even;
use super::frames::Frame;
use super::groups::{POSITION, Slice};
use super::image::Image;
use super::stacks::{Stacks, name_of};

/// The error of positions, as a fraction of a step, that gives no warning.
const EVEN: f64 = 0.01;
/// The error of positions, as a fraction of a step, up to which slices are taken to be evenly spaced.
pub(super) const NEARLY_EVEN: f64 = 0.1;
/// The maximum sideways distance of a slice from the line, as a fraction of a pixel.
const STRAIGHT: f64 = 0.5;
/// The distance, as a fraction of a pixel, that counts as none: sideways, and between slices at one place.
pub(super) const EXACT: f64 = 0.01;

/// All frames of a volume, in order along its z axis.
pub(super) struct Series {
    pub(super) stacks: Stacks,
    /// The lattice in LPS.
    pub(super) lattice: Lattice,
    /// How slices at uneven distances are resampled.
    pub(super) even: Option<Even>,
}

impl Series {
    /// The volume that some frames of images make up, which have one size and orientation.
    pub(super) fn of(
        path: &Path,
        images: &[Image],
        mut slices: Vec<Slice>,
        access: &Access,
    ) -> Result<Self, VolumeError> {
        let first = &images[slices[0].image].frames[slices[0].frame];
        let axes = axes_of(path, first)?;
        let [x, y] = first.spacing;
        let pixel = x.min(y);
        let along = |slice: &Slice| slice.position.dot(axes.z_axis);
        slices.sort_by(|a, b| along(a).total_cmp(&along(b)));
        let (mut places, mut begun) = (Vec::with_capacity(slices.len()), along(&slices[0]));
        for slice in &slices {
            let is_further = along(slice) - begun > EXACT * pixel;
            places.push(places.last().map_or(0, |&place: &usize| place + usize::from(is_further)));
            begun = if is_further { along(slice) } else { begun };
        }
        let stacks = Stacks::of(path, images, slices, &places, access)?;
        let slices = &stacks.stacks[0];
        let name = |slice: &Slice| name_of(images, slice);
        let positions: Vec<f64> = slices.iter().map(along).collect();
        let (z, even) = match step(&positions) {
            Steps::None => (first.thickness.unwrap_or(x), None),
            Steps::Even { step, off } => {
                if off > EVEN * step {
                    let path = path.display();
                    log::warn!(
                        "{path}: slices are not evenly spaced: taken to be {step:.4} mm apart, which is wrong by up to {off:.4} mm"
                    );
                }
                (step, None)
            }
            Steps::Uneven { at, step, usual } => {
                let [one, next] = [&slices[at], &slices[at + 1]].map(name);
                let found = format!("{step:.4} mm between {one} and {next}, {usual:.4} mm between others");
                let allowed = "slices of which at most three times as many are missing";
                let even = Even::of(&positions)
                    .map_err(|distances| invalid(path, POSITION, format!("{found}: {distances}"), allowed))?;
                let (path, z, count) = (path.display(), even.step, even.places.len());
                log::warn!(
                    "{path}: slices are not evenly spaced, {found}: resampled to {count} slices, {z:.4} mm apart"
                );
                (z, Some(even))
            }
        };
        let spacing = DVec3::new(x, y, z);
        let number = |i: usize| if even.is_some() { (positions[i] - positions[0]) / z } else { i as f64 };
        let lattice = lattice_of(path, images, slices, (spacing, axes), number)?;
        for (slice, other) in stacks.stacks[1..].iter().flat_map(|stack| slices.iter().zip(stack)) {
            let off = slice.position.distance(other.position);
            if off > STRAIGHT * pixel {
                let found = format!("{off:.4} mm between {} and {}", name(slice), name(other));
                return Err(invalid(path, POSITION, found, "images of several times or channels at the same places"));
            }
        }
        Ok(Self { stacks, lattice, even })
    }
}

/// The directions of a frame's rows, of its columns, and of its normal.
pub(super) fn axes_of(path: &Path, frame: &Frame) -> Result<DMat3, VolumeError> {
    let [row, column] = frame.directions;
    let axes = lengths_and_directions([row, column, row.cross(column)]);
    let (_, axes) = axes.map_err(|found| invalid(path, "ImageOrientationPatient", found, orthogonal()))?;
    Ok(axes)
}

/// The lattice of slices in the order of their places, each a `number` of steps behind the first.
pub(super) fn lattice_of(
    path: &Path,
    images: &[Image],
    slices: &[Slice],
    (spacing, axes): (DVec3, DMat3),
    number: impl Fn(usize) -> f64,
) -> Result<Lattice, VolumeError> {
    let name = |slice: &Slice| name_of(images, slice);
    let pixel = spacing.x.min(spacing.y);
    let offset = |slice: &Slice| slice.position - slices[0].position;
    let sideways = |slice: &Slice| offset(slice) - offset(slice).dot(axes.z_axis) * axes.z_axis;
    // The slice that is farthest from the line through the first slice along the normal plus `drift` per step.
    let farthest = |drift: DVec3| {
        let off = |(i, slice)| ((sideways(slice) - number(i) * drift).length(), slice);
        slices.iter().enumerate().map(off).fold((0.0, &slices[0]), |a, b| if b.0 > a.0 { b } else { a })
    };
    let (mut off, mut slice) = farthest(DVec3::ZERO);
    let mut lattice = Lattice::straight(spacing, axes);
    if off > STRAIGHT * pixel {
        // If the slices are sheared, the line runs through the first and the last one.
        let last = slices.len() - 1;
        let steps = number(last);
        let drift = if steps > 0.0 { sideways(&slices[last]) / steps } else { DVec3::ZERO };
        (off, slice) = farthest(drift);
        if off > STRAIGHT * pixel {
            let found = format!("{}, {off:.4} mm off the line through the first and the last slice", name(slice));
            return Err(invalid(path, POSITION, found, format!("slices on one line, to half a pixel of {pixel} mm")));
        }
        let [x, y, z] = [0, 1, 2].map(|axis| spacing[axis] * axes.col(axis));
        lattice = Lattice::of([x, y, z + drift]).map_err(|found| invalid(path, POSITION, found, shear::allowed()))?;
    }
    if off > EXACT * pixel {
        let (path, name) = (path.display(), name(slice));
        log::warn!("{path}: slices are not quite on one line: {name} is {off:.4} mm off, the largest error");
    }
    Ok(lattice)
}

/// The steps between ascending positions.
enum Steps {
    /// There is only one position.
    None,
    /// All steps are about equal; positions are off by at most `off`.
    Even { step: f64, off: f64 },
    /// The step after position `at` differs most from the usual one.
    Uneven { at: usize, step: f64, usual: f64 },
}

fn step(positions: &[f64]) -> Steps {
    let steps: Vec<f64> = positions.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let Some(last) = steps.len().checked_sub(1) else { return Steps::None };
    let step = (positions[last + 1] - positions[0]) / (last + 1) as f64;
    let errors = positions.iter().enumerate().map(|(i, position)| (position - positions[0] - i as f64 * step).abs());
    let off = errors.fold(0.0, f64::max);
    // Decimal fractions of millimetres are not exact.
    if off <= NEARLY_EVEN * step * (1.0 + 1e-6) {
        return Steps::Even { step, off };
    }
    let usual = median(&steps);
    let difference = |step: f64| (step - usual).abs();
    let at = (0..=last).fold(0, |at, next| if difference(steps[next]) > difference(steps[at]) { next } else { at });
    Steps::Uneven { at, step: steps[at], usual }
}

fn median(steps: &[f64]) -> f64 {
    let mut sorted = steps.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}
