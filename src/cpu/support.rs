//! Settings that the native backend does not support yet are errors, never wrong pictures.

use crate::error::RenderError;
use crate::error::setting::SettingError;
use crate::scene::Scene;

/// The largest image, pixels along a side.
const MAX_SIZE: u32 = 32_768;

/// Checks that all settings of a scene are supported.
///
/// # Errors
/// If one is not.
pub(super) fn check(scene: &Scene) -> Result<(), RenderError> {
    let refused = |key: &str, found: String, allowed: String| Err(SettingError::new(key, found, allowed).into());
    for (key, found) in [("image.width", scene.image.width), ("image.height", scene.image.height)] {
        if found > MAX_SIZE {
            return refused(key, found.to_string(), format!("at most {MAX_SIZE}"));
        }
    }
    let splatting = &scene.splatting;
    let other = "or another backend than \"cpu\"";
    if let Some(economy) = splatting.experimental.in_use() {
        return refused(&economy.key, economy.value.to_string(), format!("{}, {other}", economy.off));
    }
    Ok(())
}
