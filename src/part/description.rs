//! What identifies a part, as JSON in its file (SPEC §11).

use std::collections::BTreeMap;
use std::path::Path;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::channels::{hash_of, to_channels};
use super::check::MAX_IMAGES;
use super::mean::MeanTables;
use super::{Identity, Part};
use crate::image::ImageError;
use crate::image::channels::Joining;
use crate::image::open::content;
use crate::settings::keys::{CLASSIFICATIONS, COMPOSITINGS, ORDERS, name_of};
use crate::settings::transfer_function::{LabelTables, Ramp, TransferFunction};
use crate::settings::window::{Region, Window};

/// The version of the description.
const VERSION: u32 = 2;

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
    opacity_threshold: f64,
    culling: bool,
    background: [f64; 4],
    /// Not where there is one.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    images: usize,
    /// For `average` classified after splatting, of every image.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    means: Vec<Mean>,
    /// The hash of all channels, by which damage is found.
    pixels: String,
}

fn one() -> usize {
    1
}

fn is_one(count: &usize) -> bool {
    *count == 1
}

/// The tables of means: control points over values.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Mean {
    color: Vec<(f64, [f64; 3])>,
    opacity: Vec<(f64, f64)>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    iso_ranges: Option<Vec<[f64; 2]>>,
    has_colors: bool,
    /// Of a segmented volume.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    labels: BTreeMap<u16, OfLabel>,
}

/// A label's own tables.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct OfLabel {
    visible: bool,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    color: Option<Vec<(f64, [f64; 3])>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    opacity: Option<Vec<(f64, f64)>>,
}

fn points_of(color: &Ramp<DVec3>) -> Vec<(f64, [f64; 3])> {
    color.points().iter().map(|(value, rgb)| (*value, rgb.to_array())).collect()
}

fn color_of(points: Vec<(f64, [f64; 3])>) -> Result<Ramp<DVec3>, String> {
    let points = points.into_iter().map(|(value, rgb)| (value, DVec3::from(rgb))).collect();
    Ramp::new(points).map_err(|error| format!("color: {error}"))
}

fn opacity_of(points: Vec<(f64, f64)>) -> Result<Ramp<f64>, String> {
    Ramp::new(points).map_err(|error| format!("opacity: {error}"))
}

impl From<&LabelTables> for OfLabel {
    fn from(tables: &LabelTables) -> Self {
        let opacity = tables.opacity.as_ref().map(|opacity| opacity.points().to_vec());
        Self { visible: tables.visible, color: tables.color.as_ref().map(points_of), opacity }
    }
}

impl OfLabel {
    fn tables(self) -> Result<LabelTables, String> {
        let (color, opacity) = (self.color.map(color_of).transpose()?, self.opacity.map(opacity_of).transpose()?);
        Ok(LabelTables { visible: self.visible, color, opacity, ..LabelTables::default() })
    }
}

impl From<&MeanTables> for Mean {
    fn from(tables: &MeanTables) -> Self {
        Self {
            color: points_of(&tables.transfer.color),
            opacity: tables.transfer.opacity.points().to_vec(),
            iso_ranges: tables.transfer.iso_ranges.clone(),
            has_colors: tables.has_colors,
            labels: tables.transfer.labels.iter().map(|(label, tables)| (*label, tables.into())).collect(),
        }
    }
}

impl Mean {
    /// The tables, if they are ones of a transfer function.
    fn tables(self) -> Result<MeanTables, String> {
        let Self { color, opacity, iso_ranges, has_colors, labels } = self;
        let mut transfer = TransferFunction::by_value(color_of(color)?, opacity_of(opacity)?);
        let of_label = |(label, tables): (u16, OfLabel)| Ok::<_, String>((label, tables.tables()?));
        transfer.labels = labels.into_iter().map(of_label).collect::<Result<_, _>>()?;
        transfer.iso_ranges = iso_ranges;
        transfer.parts().check("mean").map_err(|error| error.to_string())?;
        Ok(MeanTables { transfer, has_colors })
    }
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
        opacity_threshold: identity.opacity_threshold,
        culling: identity.culling,
        background: identity.background,
        images: identity.images,
        means: identity.means.iter().map(Mean::from).collect(),
        pixels: hash_of(&to_channels(part)),
    })
}

/// The identity and window of the part in a file, and the hash of its channels, from a JSON text.
pub(super) fn from_json(path: &Path, text: &str) -> Result<(Identity, Window, String), ImageError> {
    let invalid = |key: &str, found: String, allowed: &str| content(path, key, found, allowed.to_owned());
    let description: Description = serde_json::from_str(text)
        .map_err(|error| invalid("part", error.to_string(), "the description that sheetsplat render writes"))?;
    let Description { version, size, region: [x, y, width, height], slabs, scene_slabs, background, .. } = description;
    let Description { images, means, opacity_threshold, culling, pixels, .. } = description;
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
    if !(opacity_threshold > 0.0 && opacity_threshold <= 1.0) {
        return Err(invalid("part.opacity_threshold", opacity_threshold.to_string(), "a number in (0, 1]"));
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
    let compositing = choice(path, "part.compositing", COMPOSITINGS, &description.compositing)?;
    let classification = choice(path, "part.classification", CLASSIFICATIONS, &description.classification)?;
    let most = if Joining::of(compositing, classification) == Some(Joining::Sum) { MAX_IMAGES } else { 1 };
    if !(1..=most).contains(&images) {
        return Err(invalid("part.images", images.to_string(), &format!("1 to {most}")));
    }
    let expected = if compositing.shows_means(classification) { images } else { 0 };
    if means.len() != expected {
        let allowed =
            format!("{expected}: one for each image where compositing is \"average\" and classification \"after\"");
        return Err(invalid("part.means", format!("{} tables", means.len()), &allowed));
    }
    let means: Result<_, _> = means.into_iter().map(Mean::tables).collect();
    let identity = Identity {
        compositing,
        classification,
        images,
        means: means.map_err(|found| invalid("part.means", found, "tables of a transfer function"))?,
        order: choice(path, "part.order", ORDERS, &description.order)?,
        fingerprint: description.scene,
        size,
        slabs: scene_slabs[0]..scene_slabs[1],
        opacity_threshold,
        culling,
        background,
    };
    Ok((identity, Window { slabs: slabs[0]..slabs[1], region }, pixels))
}

fn choice<T: Copy>(path: &Path, key: &str, choices: &[(&'static str, T)], found: &str) -> Result<T, ImageError> {
    let named = choices.iter().find(|(name, _)| *name == found);
    let allowed = || choices.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ");
    named.map(|(_, choice)| *choice).ok_or_else(|| content(path, key, format!("{found:?}"), allowed()))
}
