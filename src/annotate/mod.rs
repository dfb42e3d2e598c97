//! Words in pictures: a scale bar, colour bars, a legend, and the sides of the patient. They stand beside the picture, which gets smaller, and cover
//! none of it.

pub(crate) mod canvas;
mod color_bar;
mod kind;
mod layout;
mod legend;
mod round;
mod scale_bar;
mod sides;
pub(crate) mod style;
pub(crate) mod text;

pub use kind::Annotation;
pub use layout::Layout;

use crate::SettingError;
use crate::scene::Scene;
use crate::volume::Volume;

/// The room that annotations take in a scene's pictures of a volume.
///
/// # Errors
/// If one of them is impossible for the scene or the volume, or the picture would be less than a quarter of the image, or 16 pixels, wide or high.
pub fn layout(annotations: &[Annotation], scene: &Scene, volume: &Volume) -> Result<Layout, SettingError> {
    Layout::new(annotations, scene, volume)
}
