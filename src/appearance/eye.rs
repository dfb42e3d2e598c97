//! The side from which a volume is seen where nothing states it (SPEC §2), by what its file states.

use std::fmt;

use glam::{DMat3, DVec3};

use super::Preset;
use crate::settings::camera::least_axis;
use crate::volume::Volume;

/// Degrees to the side and upwards from the front of a patient, and from the shown side of anything else.
const OF_PATIENT: [f64; 2] = [20.0, 10.0];
const OF_OBJECT: [f64; 2] = [30.0, 20.0];

/// The format whose files have patient axes even if they state no orientation: its method 1.
const HAS_METHOD_1: &str = "NIfTI";

/// Where the eye is, and why (SPEC §2). `Display` gives the reason in words.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Eye {
    /// The volume has one or two samples along this axis (0 to 2), along which it is seen.
    Thin(usize),
    /// The file states a patient, who is seen from the front.
    Patient {
        /// The front of the patient (anterior) in the volume's axes.
        anterior: DVec3,
        /// The head of the patient (superior) in the volume's axes.
        superior: DVec3,
        /// Whether this is the format's default instead of the file's statement.
        is_assumed: bool,
    },
    /// A stack of microscopic slices, of which the first is the nearest, with its first row on top.
    Stack,
    /// The extent along this axis (0 to 2) is at most half of the other two, so that the broad side is shown.
    Flat(usize),
    /// The file states nothing that tells: the side of -y is shown, with z upwards.
    Unknown,
}

impl Eye {
    /// The eye for a volume under a preset; of several channels, for the first one.
    pub fn of(volume: &Volume, preset: Option<Preset>) -> Self {
        let grid = volume.drawn_grid();
        let spacing = grid.finest_spacing();
        let extents = grid.dims.as_dvec3() * grid.spacing;
        let samples = volume.levels().first().map_or((extents / spacing).round(), |finest| finest.as_dvec3());
        let least = least_axis(samples);
        if samples[least] <= 2.0 {
            return Self::Thin(least);
        }
        let is_assumed = volume.encoding().is_some_and(|encoding| encoding.format == HAS_METHOD_1);
        let patient = |axes: DMat3, is_assumed| {
            // The axes are orthonormal, so the transpose is the inverse.
            let [anterior, superior] = [DVec3::Y, DVec3::Z].map(|direction| axes.transpose() * direction);
            Self::Patient { anterior, superior, is_assumed }
        };
        if let Some(orientation) = volume.orientation() {
            return patient(orientation.axes, false);
        } else if is_assumed {
            return patient(DMat3::IDENTITY, true);
        }
        if preset == Some(Preset::Confocal) || volume.unit().is_some_and(|unit| ["µm", "nm"].contains(&unit)) {
            return Self::Stack;
        }
        let extents = samples * spacing;
        let flat = least_axis(extents);
        // The middle extent is the smaller one of the other two.
        let middle = DVec3::select(axis(flat).cmpgt(DVec3::ZERO), DVec3::INFINITY, extents).min_element();
        if extents[flat] <= middle / 2.0 { Self::Flat(flat) } else { Self::Unknown }
    }

    /// [`Camera::direction`](crate::settings::Camera::direction) and [`Camera::up`](crate::settings::Camera::up).
    pub fn direction_and_up(&self) -> [DVec3; 2] {
        let (side, up, [aside, above]) = match *self {
            Self::Thin(thin) => (axis(thin), upright(thin), [0.0; 2]),
            Self::Patient { anterior, superior, .. } => (anterior, superior, OF_PATIENT),
            Self::Stack => return [DVec3::Z, DVec3::NEG_Y],
            Self::Flat(flat) => (axis(flat), upright(flat), OF_OBJECT),
            Self::Unknown => (DVec3::NEG_Y, DVec3::Z, OF_OBJECT),
        };
        let [(sin_aside, cos_aside), (sin_above, cos_above)] =
            [aside, above].map(|degrees: f64| libm::sincos(degrees.to_radians()));
        let towards_eye = (side * cos_aside + up.cross(side) * sin_aside) * cos_above + up * sin_above;
        [-towards_eye, up]
    }
}

impl fmt::Display for Eye {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = |axis: usize| ["x", "y", "z"][axis];
        match *self {
            Self::Thin(thin) => write!(to, "along {}, which has one or two samples", name(thin)),
            Self::Patient { is_assumed: false, .. } => to.write_str("in front of the patient, as the file states"),
            Self::Patient { is_assumed: true, .. } => {
                to.write_str("in front of the patient, assumed by the format's method 1, as the file states no orientation")
            }
            Self::Stack => to.write_str("in front of the first slice, as a microscope shows it"),
            Self::Flat(flat) => write!(to, "on the broad side, as the extent along {} is the smallest by half", name(flat)),
            Self::Unknown => to.write_str("on the side of -y, z up, as the file states no orientation (if the object lies otherwise, state camera.up)"),
        }
    }
}

fn axis(number: usize) -> DVec3 {
    [DVec3::X, DVec3::Y, DVec3::Z][number]
}

/// The upward direction of a view along an axis.
fn upright(along: usize) -> DVec3 {
    if along == 2 { DVec3::Y } else { DVec3::Z }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use glam::UVec3;

    use super::*;
    use crate::volume::Orientation;

    fn volume(dims: [u32; 3], spacing: [f64; 3]) -> Volume {
        let dims = UVec3::from(dims);
        let values = (0..dims.element_product()).map(|index| (index % 5) as f32).collect();
        Volume::new("made", dims, spacing.into(), values).unwrap()
    }

    /// The volume in a patient, with its axes x, y and z towards these directions in RAS.
    fn lying(volume: Volume, axes: [DVec3; 3]) -> Volume {
        let orientation = Orientation { axes: DMat3::from_cols(axes[0], axes[1], axes[2]), origin: DVec3::ZERO };
        volume.with_orientation("made", Some(orientation)).unwrap()
    }

    /// SPEC §2: `e = (n·cos β + t·sin β)·cos γ + up·sin γ`, by a rotation about up and one about the level axis.
    fn expected(side: DVec3, up: DVec3, [aside, above]: [f64; 2]) -> [DVec3; 2] {
        let turned = DMat3::from_axis_angle(up, aside.to_radians()) * side;
        let raised = DMat3::from_axis_angle(turned.cross(up), above.to_radians()) * turned;
        [-raised, up]
    }

    fn check(volume: &Volume, preset: Option<Preset>, [direction, up]: [DVec3; 2]) {
        let eye = Eye::of(volume, preset);
        let [found, found_up] = eye.direction_and_up();
        assert!(found.abs_diff_eq(direction, 1e-12) && found_up.abs_diff_eq(up, 1e-12), "{eye:?}: {found} {found_up}");
    }

    #[test]
    fn thin_volumes_are_seen_along_their_axis() {
        check(&volume([9, 8, 1], [1.0; 3]), None, [DVec3::NEG_Z, DVec3::Y]);
        check(&volume([2, 8, 7], [1.0; 3]), Some(Preset::Confocal), [DVec3::NEG_X, DVec3::Z]);
        check(&volume([9, 2, 7], [1.0, 40.0, 1.0]), None, [DVec3::NEG_Y, DVec3::Z]);
        // Before a patient.
        let slice = lying(volume([9, 8, 2], [1.0; 3]), [DVec3::X, DVec3::Y, DVec3::Z]);
        check(&slice, None, [DVec3::NEG_Z, DVec3::Y]);
    }

    #[test]
    fn patients_are_seen_from_the_front() {
        // Flat along y and in µm, both of which come after the patient.
        let flat = || volume([9, 3, 7], [1.0; 3]);
        let ras = [DVec3::X, DVec3::Y, DVec3::Z];
        check(&lying(flat(), ras), Some(Preset::Confocal), expected(DVec3::Y, DVec3::Z, [20.0, 10.0]));
        // LPS, as scanners write it: y runs to the back.
        let lps = [DVec3::NEG_X, DVec3::NEG_Y, DVec3::Z];
        check(&lying(flat(), lps), None, expected(DVec3::NEG_Y, DVec3::Z, [20.0, 10.0]));
        // Coronal slices from the front to the back, with rows from the head down.
        let coronal = [DVec3::X, DVec3::NEG_Z, DVec3::NEG_Y];
        check(&lying(flat(), coronal), None, expected(DVec3::NEG_Z, DVec3::NEG_Y, [20.0, 10.0]));
        // An oblique scan.
        let tilt = DMat3::from_rotation_x(0.3) * DMat3::from_rotation_z(-0.2);
        let axes = tilt.transpose();
        check(
            &lying(flat(), [axes.x_axis, axes.y_axis, axes.z_axis]),
            None,
            expected(tilt * DVec3::Y, tilt * DVec3::Z, [20.0, 10.0]),
        );
        let ras = Eye::of(&lying(flat(), ras), None);
        assert!(matches!(ras, Eye::Patient { is_assumed: false, .. }), "{ras:?}");
    }

    #[test]
    fn stacks_of_confocal_microscopes_are_seen_from_their_first_slice() {
        check(&volume([40, 40, 5], [1.0; 3]), Some(Preset::Confocal), [DVec3::Z, DVec3::NEG_Y]);
        assert_eq!(Eye::of(&volume([40, 40, 5], [1.0; 3]), Some(Preset::Mip)), Eye::Flat(2));
    }

    #[test]
    fn flat_things_show_their_broad_side() {
        check(&volume([8, 9, 4], [1.0; 3]), None, expected(DVec3::Z, DVec3::Y, [30.0, 20.0]));
        check(&volume([12, 5, 10], [1.0; 3]), None, expected(DVec3::Y, DVec3::Z, [30.0, 20.0]));
        check(&volume([5, 12, 10], [1.0; 3]), None, expected(DVec3::X, DVec3::Z, [30.0, 20.0]));
        // By lengths, not by samples.
        check(&volume([8, 8, 4], [1.0, 1.0, 3.0]), None, expected(DVec3::NEG_Y, DVec3::Z, [30.0, 20.0]));
        check(&volume([8, 8, 8], [1.0, 1.0, 0.5]), None, expected(DVec3::Z, DVec3::Y, [30.0, 20.0]));
    }

    #[test]
    fn everything_else_is_seen_from_the_side_of_minus_y() {
        check(&volume([8, 9, 5], [1.0; 3]), None, expected(DVec3::NEG_Y, DVec3::Z, [30.0, 20.0]));
        // A rod has two small extents.
        assert_eq!(Eye::of(&volume([4, 5, 30], [1.0; 3]), None), Eye::Unknown);
    }
}
