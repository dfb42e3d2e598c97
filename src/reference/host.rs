//! What a host adds to a scene.

use crate::error::setting::SettingError;
use crate::scene::Scene;
use crate::settings::splatting::check_first_hit;

/// What a host adds to a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Host<'a> {
    /// For every pixel the depth along w of an opaque surface, in `unit`s from the eye (orthographic: from the camera's centre).
    pub surfaces: Option<&'a [f64]>,
    /// The opacity whose depth is requested.
    pub first_hit: Option<f64>,
}

impl Host<'_> {
    /// Checks that there is a surface depth for every pixel, and the requested opacity, as [`SceneView`](crate::SceneView) does.
    pub(super) fn check(&self, scene: &Scene) -> Result<(), SettingError> {
        let pixels = scene.image.width as usize * scene.image.height as usize;
        if let Some(depths) = self.surfaces {
            if depths.len() != pixels {
                let found = format!("{} depths", depths.len());
                return Err(SettingError::new("surfaces", found, format!("{pixels}, one for every pixel")));
            }
            if let Some(at) = depths.iter().position(|depth| depth.is_nan()) {
                return Err(SettingError::new(format!("surfaces[{at}]"), depths[at], "a number, or infinity"));
            }
        }
        self.first_hit.map_or(Ok(()), check_first_hit)
    }
}
