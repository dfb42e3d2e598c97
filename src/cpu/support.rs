//! What the native backend does not draw yet: an error, never a wrong picture.

use crate::error::RenderError;
use crate::scene::Scene;
use crate::setting_error::SettingError;
use crate::settings::splatting::{Classification, Economies};

/// The largest image, pixels along a side.
const MAX_SIZE: u32 = 32_768;

/// Checks that all that a scene asks for can be drawn.
///
/// # Errors
/// If it cannot.
pub(super) fn check(scene: &Scene) -> Result<(), RenderError> {
    let refused = |key: &str, found: String, allowed: String| Err(SettingError::new(key, found, allowed).into());
    for (key, found) in [("image.width", scene.image.width), ("image.height", scene.image.height)] {
        if found > MAX_SIZE {
            return refused(key, found.to_string(), format!("at most {MAX_SIZE}"));
        }
    }
    let splatting = &scene.splatting;
    let other = "or another backend than \"cpu\"";
    if splatting.classification == Classification::After {
        return refused("splatting.classification", "\"after\"".to_owned(), format!("\"before\", {other}"));
    }
    let Economies { whole_below, beta, resolution } = splatting.economies;
    let none = Economies::default();
    for (key, found, allowed) in [
        ("splatting.whole_below", whole_below, none.whole_below),
        ("splatting.beta", beta, none.beta),
        ("splatting.resolution", resolution, none.resolution),
    ] {
        if found != allowed {
            return refused(key, found.to_string(), format!("{allowed}, {other}"));
        }
    }
    Ok(())
}
