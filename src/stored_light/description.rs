//! The description of light sheets, as JSON in their file.

use std::path::Path;
use std::sync::Arc;

use glam::{DVec3, DVec4};
use serde::{Deserialize, Serialize};

use super::stored::{NAMES, StoredLight};
use crate::image::ImageError;
use crate::image::open::content;
use crate::light::{LightSheets, LightSource};
use crate::settings::window::Window;

/// The version of the description.
const VERSION: u32 = 1;

/// The keys of the description.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Description {
    version: u32,
    /// The fingerprint of what keeps light off.
    matter: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    occlusion: Option<Stack>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    shadow: Option<Stack>,
    /// The hash of all sheets, by which damage is found.
    sheets: String,
}

/// A stack of sheets.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Stack {
    to_light: [f64; 3],
    up: [f64; 3],
    spread: f64,
    step: f64,
    /// Radius and falloff.
    kernel: [f64; 2],
    /// The number of the first plane.
    first: i32,
    planes: usize,
    /// Where positions are among the sheets.
    place: [[f64; 4]; 3],
}

/// A stack without its sheets: where its light comes from, where positions are among them, the number of the first one, and how many there are.
pub(super) struct Described {
    pub(super) source: LightSource,
    pub(super) place: [DVec4; 3],
    pub(super) first: i32,
    pub(super) planes: usize,
}

impl Stack {
    fn of((source, sheets): &(LightSource, Arc<LightSheets>)) -> Self {
        let LightSource { to_light, up, spread, step, kernel } = *source;
        let (to_light, up) = (to_light.to_array(), up.to_array());
        let place = sheets.place().map(|row| row.to_array());
        Self { to_light, up, spread, step, kernel, first: sheets.first, planes: sheets.planes(), place }
    }

    fn described(&self) -> Described {
        let Self { to_light, up, spread, step, kernel, first, planes, place } = *self;
        let (to_light, up) = (DVec3::from(to_light), DVec3::from(up));
        let source = LightSource { to_light, up, spread, step, kernel };
        Described { source, place: place.map(DVec4::from), first, planes }
    }
}

/// The JSON text of light, given the hash of its sheets.
pub(super) fn to_json(light: &StoredLight, sheets: String) -> serde_json::Result<String> {
    let [occlusion, shadow] = light.stacks.each_ref().map(|stack| stack.as_ref().map(Stack::of));
    serde_json::to_string(&Description { version: VERSION, matter: light.matter.clone(), occlusion, shadow, sheets })
}

/// The fingerprint of what keeps light off, both stacks, and the hash of all sheets, from a JSON text.
pub(super) fn from_json(path: &Path, text: &str) -> Result<(String, [Option<Described>; 2], String), ImageError> {
    let invalid = |key: &str, found: String, allowed: &str| content(path, key, found, allowed.to_owned());
    let description: Description = serde_json::from_str(text)
        .map_err(|error| invalid("light", error.to_string(), "the description that sheetsplat light writes"))?;
    let Description { version, matter, occlusion, shadow, sheets } = description;
    if version != VERSION {
        return Err(invalid("light.version", version.to_string(), &VERSION.to_string()));
    }
    let stacks = [occlusion, shadow].map(|stack| stack.map(|stack| stack.described()));
    if stacks.iter().all(Option::is_none) {
        return Err(invalid("light", "neither occlusion nor shadow".to_owned(), "one of them, or both"));
    }
    for (name, Described { first, planes, .. }) in
        NAMES.iter().zip(&stacks).filter_map(|(name, of)| Some((name, of.as_ref()?)))
    {
        let most = Window::ALL_SLABS.end;
        if !Window::ALL_SLABS.contains(first) {
            return Err(invalid(&format!("light.{name}.first"), first.to_string(), "a plane within ±2^30"));
        }
        if !(1..=most as usize).contains(planes) {
            return Err(invalid(&format!("light.{name}.planes"), planes.to_string(), "1 to 2^30"));
        }
    }
    Ok((matter, stacks, sheets))
}
