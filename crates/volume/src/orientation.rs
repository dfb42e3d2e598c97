//! How a volume lies in a patient.

use glam::{DMat3, DVec3};

/// The maximum cosine of an angle that counts as a right angle.
pub(super) const MAX_COSINE: f64 = 1e-4;

/// The maximum error of a direction's length.
#[cfg(any(feature = "metaimage", feature = "vtk"))]
const UNIT_LENGTH: f64 = 1e-4;

/// Converts LPS, which DICOM and MetaImage use, to RAS.
pub(super) const RAS_FROM_LPS: DVec3 = DVec3::new(-1.0, -1.0, 1.0);

/// Where a volume's axes point in a patient, in RAS: +x to the patient's right, +y to the front (anterior), +z to the head
/// (superior).
///
/// The orientation does not move the grid: world axes are the volume's own, the first of them turned where these are left-handed (SPEC §2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orientation {
    /// The unit vectors along the volume's x, y and z in RAS, one per column.
    pub axes: DMat3,
    /// The position of voxel (0, 0, 0) in RAS, in world units; 0 where the file states none.
    pub origin: DVec3,
}

/// The side from which a patient is seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PatientSide {
    /// The face; the head is up.
    Front,
    /// The back; the head is up.
    Back,
    /// The patient's left side; the head is up.
    Left,
    /// The patient's right side; the head is up.
    Right,
    /// The top of the head; the face is up.
    Top,
    /// From the feet; the face is up.
    Bottom,
}

impl Orientation {
    /// The orientation of axes and an origin that a file states in LPS.
    #[cfg(feature = "dicom")]
    pub(super) fn of_lps(axes: DMat3, origin: DVec3) -> Self {
        Self { axes: DMat3::from_diagonal(RAS_FROM_LPS) * axes, origin: RAS_FROM_LPS * origin }
    }

    /// `Camera::direction` and `Camera::up`, in world space, that show this side of the patient.
    pub fn direction_and_up(&self, view: PatientSide) -> [DVec3; 2] {
        let ras = match view {
            PatientSide::Front => [DVec3::NEG_Y, DVec3::Z],
            PatientSide::Back => [DVec3::Y, DVec3::Z],
            PatientSide::Left => [DVec3::X, DVec3::Z],
            PatientSide::Right => [DVec3::NEG_X, DVec3::Z],
            PatientSide::Top => [DVec3::NEG_Z, DVec3::Y],
            PatientSide::Bottom => [DVec3::Z, DVec3::Y],
        };
        // The axes are orthonormal, so the transpose is the inverse.
        ras.map(|vector| self.axes.transpose() * vector)
    }

    /// Whether the axes are left-handed in the patient, as a file's own may be ([`Volume::file_orientation`](crate::Volume::file_orientation)); a volume's are
    /// not.
    pub fn is_mirrored(&self) -> bool {
        self.axes.determinant() < 0.0
    }
}

/// The lengths and directions of the vectors between neighbouring voxels along the three axes.
///
/// # Errors
/// A description of the axes if they are not orthogonal or not of positive finite length.
pub(super) fn lengths_and_directions(steps: [DVec3; 3]) -> Result<(DVec3, DMat3), String> {
    let lengths = steps.map(DVec3::length);
    if !lengths.iter().all(|&length| length > 0.0 && length.is_finite()) {
        return Err(format!("axes of the lengths {lengths:?}"));
    }
    let [x, y, z] = steps.map(|step| step / step.length());
    let cosine = DVec3::new(x.dot(y), y.dot(z), z.dot(x)).abs().max_element();
    if cosine > MAX_COSINE {
        return Err(format!("axes that are not orthogonal, at a cosine of {cosine:.6}"));
    }
    Ok((DVec3::from_array(lengths), DMat3::from_cols(x, y, z)))
}

/// The directions of three vectors that should have length 1 already.
///
/// # Errors
/// A description of the axes, and what is allowed.
#[cfg(any(feature = "metaimage", feature = "vtk"))]
pub(super) fn unit_directions(axes: [DVec3; 3]) -> Result<DMat3, (String, String)> {
    let (lengths, directions) = lengths_and_directions(axes).map_err(|found| (found, orthogonal()))?;
    if (lengths - 1.0).abs().max_element() > UNIT_LENGTH {
        let found = format!("axes of the lengths {:?}", lengths.to_array());
        return Err((found, format!("lengths of 1, to {UNIT_LENGTH}")));
    }
    Ok(directions)
}

/// What [`lengths_and_directions`] accepts, for errors.
#[cfg(any(feature = "dicom", feature = "metaimage", feature = "vtk"))]
pub(super) fn orthogonal() -> String {
    format!("orthogonal axes, cosines of at most {MAX_COSINE}")
}
