//! Words in pictures: a scale bar, colour bars, a legend, and the sides of the patient. They stand beside the picture, which gets smaller, and cover
//! none of it.

pub(crate) mod canvas;
mod color_bar;
mod layout;
mod legend;
mod round;
mod scale_bar;
mod sides;
pub(crate) mod style;
pub(crate) mod text;

use std::str::FromStr;

pub use layout::Layout;

use crate::SettingError;
use crate::scene::Scene;
use crate::volume::Volume;

/// What can stand beside a picture.
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

/// The room that annotations take in a scene's pictures of a volume.
///
/// # Errors
/// If one of them is impossible for the scene or the volume, or the picture would be less than a quarter of the image, or 16 pixels, wide or high.
pub fn layout(annotations: &[Annotation], scene: &Scene, volume: &Volume) -> Result<Layout, SettingError> {
    Layout::new(annotations, scene, volume)
}

fn refused(annotation: &str, found: &str, allowed: &str) -> SettingError {
    SettingError::new(format!("annotate: {annotation}"), found, allowed)
}
