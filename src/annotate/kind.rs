//! The annotations and their names.

use std::str::FromStr;

use crate::SettingError;

/// The words that can stand beside a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Annotation {
    /// A bar of a round length in the volume's units; for orthographic cameras only.
    Scale,
    /// The colour of each value, for each channel.
    Colors,
    /// The colour of each label or channel.
    Legend,
    /// The sides of the patient at the picture's edges: R, L, A, P, S and I.
    Sides,
}

impl Annotation {
    /// All annotations with their names.
    pub const ALL: [(&'static str, Self); 4] =
        [("scale", Self::Scale), ("colors", Self::Colors), ("legend", Self::Legend), ("sides", Self::Sides)];
}

impl FromStr for Annotation {
    type Err = SettingError;

    fn from_str(name: &str) -> Result<Self, SettingError> {
        let named = Self::ALL.into_iter().find(|(known, _)| *known == name);
        let allowed = || Self::ALL.map(|(known, _)| known).join(", ");
        named.map(|(_, annotation)| annotation).ok_or_else(|| SettingError::new("annotate", name, allowed()))
    }
}

/// The error for an annotation that is impossible for a scene or a volume.
pub(super) fn refused(annotation: &str, found: &str, allowed: &str) -> SettingError {
    SettingError::new(format!("annotate: {annotation}"), found, allowed)
}
