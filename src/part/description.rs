//! What identifies a part, as JSON in its file (SPEC §11).

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{Identity, Part};
use crate::image::ImageError;
use crate::image::open::content;
use crate::scene::names::{CLASSIFICATIONS, COMPOSITINGS, ORDERS, name_of};
use crate::settings::window::{Region, Window};

/// The version of the description.
const VERSION: u32 = 1;

/// The largest image, pixels along a side, as on the native backend.
const MAX_SIZE: u32 = 32_768;

/// The keys of the description.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Description {
    version: u32,
    /// The fingerprint.
    scene: String,
    /// Width and height of the whole image.
    size: [u32; 2],
    /// x, y, width, height.
    region: [u32; 4],
    /// From the first slab to the end.
    slabs: [i32; 2],
    scene_slabs: [i32; 2],
    compositing: String,
    classification: String,
    order: String,
    background: [f64; 4],
}

/// The JSON text of a part.
pub(super) fn to_json(part: &Part) -> serde_json::Result<String> {
    let Part { identity, window: Window { slabs, region }, .. } = part;
    let Region { x, y, width, height } = *region;
    serde_json::to_string(&Description {
        version: VERSION,
        scene: identity.fingerprint.clone(),
        size: identity.size,
        region: [x, y, width, height],
        slabs: [slabs.start, slabs.end],
        scene_slabs: [identity.slabs.start, identity.slabs.end],
        compositing: name_of(COMPOSITINGS, identity.compositing).to_owned(),
        classification: name_of(CLASSIFICATIONS, identity.classification).to_owned(),
        order: name_of(ORDERS, identity.order).to_owned(),
        background: identity.background,
    })
}

/// What a JSON text says of the part in a file.
pub(super) fn from_json(path: &Path, text: &str) -> Result<(Identity, Window), ImageError> {
    let invalid = |key: &str, found: String, allowed: &str| content(path, key, found, allowed.to_owned());
    let description: Description = serde_json::from_str(text)
        .map_err(|error| invalid("part", error.to_string(), "the description that sheetsplat render writes"))?;
    let Description { version, size, region: [x, y, width, height], slabs, scene_slabs, background, .. } = description;
    if version != VERSION {
        return Err(invalid("part.version", version.to_string(), &VERSION.to_string()));
    }
    if size.iter().any(|side| !(1..=MAX_SIZE).contains(side)) {
        return Err(invalid("part.size", format!("{}×{}", size[0], size[1]), &format!("1 to {MAX_SIZE}")));
    }
    for (key, [start, end]) in [("part.slabs", slabs), ("part.scene_slabs", scene_slabs)] {
        let is_within = Window::ALL_SLABS.contains(&start) && Window::ALL_SLABS.contains(&end);
        if start > end || !is_within {
            return Err(invalid(key, format!("{start}..{end}"), "A..B, A at most B, both within ±2^30"));
        }
    }
    let is_color = |channel: &f64| (0.0..=1.0).contains(channel);
    if !background.iter().all(is_color) {
        return Err(invalid("part.background", format!("{background:?}"), "four numbers in [0, 1]"));
    }
    let region = Region { x, y, width, height };
    let is_small = [x, y, width, height].iter().all(|number| *number <= MAX_SIZE);
    if !is_small || region.check(size).is_err() {
        let allowed = format!("X,Y,W,H of at least one pixel within the image of {}×{}", size[0], size[1]);
        return Err(invalid("part.region", region.to_string(), &allowed));
    }
    let identity = Identity {
        compositing: choice(path, "part.compositing", COMPOSITINGS, &description.compositing)?,
        classification: choice(path, "part.classification", CLASSIFICATIONS, &description.classification)?,
        order: choice(path, "part.order", ORDERS, &description.order)?,
        fingerprint: description.scene,
        size,
        slabs: scene_slabs[0]..scene_slabs[1],
        background,
    };
    Ok((identity, Window { slabs: slabs[0]..slabs[1], region }))
}

fn choice<T: Copy>(path: &Path, key: &str, choices: &[(&'static str, T)], found: &str) -> Result<T, ImageError> {
    let named = choices.iter().find(|(name, _)| *name == found);
    let allowed = || choices.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ");
    named.map(|(_, choice)| *choice).ok_or_else(|| content(path, key, format!("{found:?}"), allowed()))
}
