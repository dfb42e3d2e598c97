//! The sides of the patient at the picture's edges: R, L, A, P, S and I.

use glam::{DMat3, DVec3};

use super::kind::refused;
use crate::SettingError;
use crate::settings::Camera;
use crate::volume::Volume;

/// The sides towards which x, y and z of RAS run, and the opposite ones.
const TOWARDS: [char; 3] = ['R', 'A', 'S'];
const AGAINST: [char; 3] = ['L', 'P', 'I'];

/// A direction has a side's letter within 67.5° of it, so that one half way between two sides has both.
const LEAST: f64 = 0.383;

/// The widest letters.
pub(super) const WIDEST: &str = "RA";

/// The volume's axes in RAS.
pub(super) fn axes(volume: &Volume) -> Result<DMat3, SettingError> {
    let allowed = "volumes whose files state how they lie in a patient";
    volume
        .orientation()
        .map(|orientation| orientation.axes)
        .ok_or_else(|| refused("sides", "a volume that states no patient", allowed))
}

/// The letters at the left, right, upper and lower edge.
pub(super) fn letters(camera: &Camera, axes: DMat3) -> [String; 4] {
    let basis = camera.basis();
    [-basis.u, basis.u, basis.v, -basis.v].map(|direction| named(axes * direction))
}

/// The one or two sides nearest to a direction in RAS, the nearest first.
fn named(direction: DVec3) -> String {
    let parts = direction.normalize_or_zero().to_array();
    let mut order = [0, 1, 2];
    // Sorting is stable, so that equal parts keep their order on every machine.
    order.sort_by(|&a, &b| parts[b].abs().total_cmp(&parts[a].abs()));
    let shown = order.into_iter().take(2).filter(|&axis| parts[axis].abs() > LEAST);
    shown.map(|axis| if parts[axis] > 0.0 { TOWARDS[axis] } else { AGAINST[axis] }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::{Orientation, PatientSide};

    /// The letters when a patient is seen from a side.
    fn seen(axes: [DVec3; 3], side: PatientSide) -> [String; 4] {
        let axes = DMat3::from_cols(axes[0], axes[1], axes[2]);
        let orientation = Orientation { axes, origin: DVec3::ZERO };
        letters(&Camera::default().looking(orientation.direction_and_up(side)), axes)
    }

    #[test]
    fn letters_are_those_of_radiology_whatever_the_axes() {
        let ras = [DVec3::X, DVec3::Y, DVec3::Z];
        let lps = [DVec3::NEG_X, DVec3::NEG_Y, DVec3::Z];
        let sagittal = [DVec3::NEG_Y, DVec3::Z, DVec3::NEG_X];
        for axes in [ras, lps, sagittal] {
            // Left, right, top, bottom: in front of patients, their right is on the left.
            for (side, expected) in [
                (PatientSide::Front, ["R", "L", "S", "I"]),
                (PatientSide::Back, ["L", "R", "S", "I"]),
                (PatientSide::Left, ["A", "P", "S", "I"]),
                (PatientSide::Right, ["P", "A", "S", "I"]),
                (PatientSide::Top, ["L", "R", "A", "P"]),
                (PatientSide::Bottom, ["R", "L", "A", "P"]),
            ] {
                assert_eq!(seen(axes, side), expected, "{axes:?} {side:?}");
            }
        }
    }

    #[test]
    fn directions_between_two_sides_have_both() {
        assert_eq!(named(DVec3::new(0.9, -0.3, 0.0)), "R");
        assert_eq!(named(DVec3::new(-0.6, 0.8, 0.1)), "AL");
        assert_eq!(named(DVec3::new(-0.58, 0.57, -0.56)), "LA");
    }
}
