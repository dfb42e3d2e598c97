//! The tables of a scene file: their keys, types and ranges (SPEC §7).

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::DVec3;

use super::names::{
    BOXES, CLASSIFICATIONS, COMPOSITINGS, ENDIANS, FITS, FORMS, GRADIENTS, INTERPOLATIONS, METHODS, ORDERS, RASTERIZERS,
};
use super::reader::{Entry, LABEL, Section};
use super::{ImageSettings, SceneError, TransferSettings, VolumeSource};
use crate::appearance::Colormap;
use crate::error::setting::Interval;
use crate::settings::camera::{Camera, FOV_Y, Fit, Projection};
use crate::settings::clip::{Clip, MAX_PLANES};
use crate::settings::economies::{Economies, KEYS};
use crate::settings::shading::{Light, Shading};
use crate::settings::splatting::{FALLOFF, RADIUS, SLAB_WIDTH, Splatting};
use crate::settings::transfer_function::{LabelTables, Ramp};
use crate::volume::{RawLayout, SPACING, SampleType, check_spacing};

/// `[volume]`.
pub(super) struct VolumeSettings {
    pub(super) source: VolumeSource,
    pub(super) spacing: Option<DVec3>,
    pub(super) labels: Option<PathBuf>,
}

/// Reads `[volume]`; `given` is the source of a table that names none.
pub(super) fn volume(
    mut section: Section,
    folder: &Path,
    given: Option<VolumeSource>,
) -> Result<VolumeSettings, SceneError> {
    let (mut path, mut builtin, mut spacing, mut labels) = (None, None, None, None);
    section.read("path", &mut path, |entry| entry.text("a volume file's path").map(Some))?;
    section.read("builtin", &mut builtin, |entry| entry.text("a builtin volume's name").map(Some))?;
    section.read("spacing", &mut spacing, |entry| entry.numbers(SPACING).map(|s| Some(DVec3::from_array(s))))?;
    section
        .read("labels", &mut labels, |entry| entry.text("a label file's path").map(|path| Some(folder.join(path))))?;
    let raw = raw_layout(&mut section)?;
    let origins = section.origins;
    section.finish()?;
    if let Some(spacing) = spacing {
        check_spacing("volume.spacing", spacing).map_err(|error| origins.refused(error))?;
    }
    let refused = |found| origins.invalid("volume", &[], found, "either volume.path or volume.builtin");
    let source = match (path, builtin) {
        (Some(path), None) => VolumeSource::File(folder.join(path)),
        (None, Some(name)) => VolumeSource::Builtin(name),
        (None, None) => given.ok_or_else(|| refused("neither path nor builtin"))?,
        (Some(_), Some(_)) => return Err(refused("both path and builtin")),
    };
    let source = match (source, raw) {
        (source, None) => source,
        (VolumeSource::File(path), Some(layout)) => VolumeSource::Raw(path, layout),
        (_, Some(_)) => return Err(origins.invalid("volume.dims", &[], "a volume that is not a file", "volume.path")),
    };
    Ok(VolumeSettings { source, spacing, labels })
}

/// The layout of a raw file: `dims`, which requires `type`, `endian` and `offset`.
fn raw_layout(section: &mut Section) -> Result<Option<RawLayout>, SceneError> {
    let (mut dims, mut sample_type, mut big_endian, mut offset) = (None, None, None, None);
    section.read("dims", &mut dims, |entry| entry.dims().map(Some))?;
    section.read("type", &mut sample_type, |entry| entry.choice(&SampleType::NAMED).map(Some))?;
    section.read("endian", &mut big_endian, |entry| entry.choice(ENDIANS).map(Some))?;
    section.read("offset", &mut offset, |entry| entry.bytes().map(Some))?;
    let missing = |key: &str, allowed: &str| section.origins.invalid(key, &["volume.dims"], "no such key", allowed);
    let Some(dims) = dims else {
        if sample_type.is_some() || big_endian.is_some() || offset.is_some() {
            return Err(missing("volume.dims", "the sizes of a raw file, to which type, endian and offset belong"));
        }
        return Ok(None);
    };
    let Some(sample_type) = sample_type else {
        let names = SampleType::NAMED.map(|(name, _)| format!("{name:?}")).join(" or ");
        return Err(missing("volume.type", &names));
    };
    let is_one_byte = matches!(sample_type, SampleType::I8 | SampleType::U8);
    let Some(big_endian) = big_endian.or(is_one_byte.then_some(false)) else {
        return Err(missing("volume.endian", "\"little\" or \"big\""));
    };
    Ok(Some(RawLayout { dims, sample_type, big_endian, offset: offset.unwrap_or(0) }))
}

/// Reads `[camera]`. Keys of the other projection are checked but have no effect, so that overriding `projection` alone works. `fit` is
/// the default.
pub(super) fn camera(mut section: Section, fit: Fit) -> Result<Camera, SceneError> {
    let mut camera = Camera { fit, ..Camera::default() };
    let mut is_perspective = false;
    let (mut height, mut fov_y, mut distance, mut near) = (None, 30.0, None, None);
    let projections = [("orthographic", false), ("perspective", true)];
    section.read("projection", &mut is_perspective, |entry| entry.choice(&projections))?;
    section.read("direction", &mut camera.direction, vector)?;
    section.read("up", &mut camera.up, vector)?;
    section.read("center", &mut camera.center, |entry| vector(entry).map(Some))?;
    section.read("fit", &mut camera.fit, |entry| entry.choice(FITS))?;
    section.read("height", &mut height, |entry| entry.number(Interval::POSITIVE).map(Some))?;
    section.read("fov_y", &mut fov_y, |entry| entry.number(FOV_Y))?;
    section.read("distance", &mut distance, |entry| entry.number(Interval::POSITIVE).map(Some))?;
    section.read("near", &mut near, |entry| entry.number(Interval::POSITIVE).map(Some))?;
    let origins = section.origins;
    section.finish()?;
    let perspective = Projection::Perspective { fov_y, distance, near };
    let orthographic = Projection::Orthographic { height };
    let [used, unused] = if is_perspective { [perspective, orthographic] } else { [orthographic, perspective] };
    for projection in [unused, used] {
        camera.projection = projection;
        camera.check().map_err(|error| origins.refused(error))?;
    }
    Ok(camera)
}

/// Reads `[image]`.
pub(super) fn image(mut section: Section) -> Result<ImageSettings, SceneError> {
    let mut image = ImageSettings::default();
    section.read("width", &mut image.width, Entry::pixels)?;
    section.read("height", &mut image.height, Entry::pixels)?;
    section.read("background", &mut image.background, |entry| entry.numbers(Interval::SHARE))?;
    let origins = section.origins;
    section.finish()?;
    image.check().map_err(|error| origins.refused(error))?;
    Ok(image)
}

/// Reads `[clip]`.
pub(super) fn clip(mut section: Section) -> Result<Clip, SceneError> {
    let mut clip = Clip::default();
    section.read("planes", &mut clip.planes, planes)?;
    section.read("crop", &mut clip.crop, |entry| crop(entry).map(Some))?;
    let origins = section.origins;
    section.finish()?;
    clip.check().map_err(|error| origins.refused(error))?;
    Ok(clip)
}

/// Reads a list of planes.
fn planes(entry: &Entry) -> Result<Vec<[f64; 4]>, SceneError> {
    let items = entry.items(&format!("an array of at most {MAX_PLANES} [nx, ny, nz, d]"))?;
    items.iter().map(|item| item.numbers(Interval::FINITE)).collect()
}

/// Reads the two corners of a box.
fn crop(entry: &Entry) -> Result<[DVec3; 2], SceneError> {
    let allowed = "[[x, y, z], [x, y, z]], each number of the first below that of the second";
    let [low, high] = entry.array(allowed)?;
    Ok([vector(&low)?, vector(&high)?])
}

/// Reads `[transfer]`.
pub(super) fn transfer(mut section: Section) -> Result<TransferSettings, SceneError> {
    let mut transfer = TransferSettings::default();
    let TransferSettings { color, opacity, gradient_opacity, .. } = &mut transfer;
    ramps(&mut section, color, opacity, gradient_opacity)?;
    section.read("iso_ranges", &mut transfer.iso_ranges, |entry| iso_ranges(entry).map(Some))?;
    section.read("label", &mut transfer.labels, labels)?;
    section.read("colormap", &mut transfer.colormap, |entry| entry.choice(&Colormap::ALL).map(Some))?;
    let origins = section.origins;
    section.finish()?;
    transfer.check().map_err(|error| origins.refused(error))?;
    if transfer.color.is_some() && transfer.colormap.is_some() {
        return Err(origins.invalid(
            "transfer",
            &[],
            "both color and colormap",
            "one of transfer.color and transfer.colormap",
        ));
    }
    Ok(transfer)
}

/// Reads the ramps that the main table and the tables of labels may have.
fn ramps(
    section: &mut Section,
    color: &mut Option<Ramp<DVec3>>,
    opacity: &mut Option<Ramp<f64>>,
    gradient_opacity: &mut Option<Ramp<f64>>,
) -> Result<(), SceneError> {
    let rgb = |entry: &Entry| entry.numbers(Interval::SHARE).map(DVec3::from_array);
    let share = |entry: &Entry| entry.number(Interval::SHARE);
    section.read("color", color, |entry| entry.ramp("[value, [r, g, b]]", rgb).map(Some))?;
    section.read("opacity", opacity, |entry| entry.ramp("[value, opacity]", share).map(Some))?;
    let point = "[gradient magnitude, factor]";
    section.read("gradient_opacity", gradient_opacity, |entry| entry.ramp(point, share).map(Some))
}

/// Reads `[[transfer.label]]`.
fn labels(entry: &Entry) -> Result<BTreeMap<u16, LabelTables>, SceneError> {
    let mut labels = BTreeMap::new();
    for item in entry.items("tables [[transfer.label]]")? {
        let mut section = item.section("a table [[transfer.label]]")?;
        let (origins, key) = (section.origins, section.name.clone());
        let label = section.require("label", LABEL, |entry| match entry.label()? {
            label if labels.contains_key(&label) => Err(entry.refused("a label that no earlier table has")),
            label => Ok(label),
        })?;
        let mut tables = LabelTables::default();
        section.read("visible", &mut tables.visible, Entry::boolean)?;
        ramps(&mut section, &mut tables.color, &mut tables.opacity, &mut tables.gradient_opacity)?;
        section.finish()?;
        tables.check(&key).map_err(|error| origins.refused(error))?;
        labels.insert(label, tables);
    }
    Ok(labels)
}

/// Reads `[shading]` over a preset's values.
pub(super) fn shading(mut section: Section, mut shading: Shading) -> Result<Shading, SceneError> {
    section.read("enabled", &mut shading.enabled, Entry::boolean)?;
    section.read("light", &mut shading.light, light)?;
    section.read("ambient", &mut shading.ambient, |entry| entry.number(Interval::NOT_NEGATIVE))?;
    section.read("diffuse", &mut shading.diffuse, |entry| entry.number(Interval::NOT_NEGATIVE))?;
    section.read("specular", &mut shading.specular, |entry| entry.number(Interval::NOT_NEGATIVE))?;
    section.read("shininess", &mut shading.shininess, |entry| entry.number(Interval::POSITIVE))?;
    section.read("gradient", &mut shading.gradient, |entry| entry.choice(GRADIENTS))?;
    let origins = section.origins;
    section.finish()?;
    shading.check().map_err(|error| origins.refused(error))?;
    Ok(shading)
}

/// Reads `[splatting]` over a preset's values.
pub(super) fn splatting(mut section: Section, mut splatting: Splatting) -> Result<Splatting, SceneError> {
    section.read("method", &mut splatting.method, |entry| entry.choice(METHODS))?;
    section.read("radius", &mut splatting.radius, |entry| entry.number(RADIUS))?;
    section.read("falloff", &mut splatting.falloff, |entry| entry.number(FALLOFF))?;
    section.read("slab_width", &mut splatting.slab_width, |entry| entry.number(SLAB_WIDTH))?;
    section.read("classification", &mut splatting.classification, |entry| entry.choice(CLASSIFICATIONS))?;
    section.read("interpolation", &mut splatting.interpolation, |entry| entry.choice(INTERPOLATIONS))?;
    section.read("footprint", &mut splatting.footprint, |entry| entry.choice(FORMS))?;
    section.read("compositing", &mut splatting.compositing, |entry| entry.choice(COMPOSITINGS))?;
    section.read("order", &mut splatting.order, |entry| entry.choice(ORDERS))?;
    section.read("opacity_threshold", &mut splatting.opacity_threshold, |entry| entry.number(Interval::THRESHOLD))?;
    section.read("culling", &mut splatting.culling, Entry::boolean)?;
    section.read("tiles", &mut splatting.tiles, Entry::boolean)?;
    section.read("rasterizer", &mut splatting.rasterizer, |entry| entry.choice(RASTERIZERS))?;
    section.read("footprint_box", &mut splatting.footprint_box, |entry| entry.choice(BOXES))?;
    splatting.experimental = economies(section.section("experimental")?)?;
    for (key, former) in KEYS {
        section.moved(former, key)?;
    }
    let origins = section.origins;
    section.finish()?;
    splatting.check().map_err(|error| origins.refused(error))?;
    Ok(splatting)
}

/// `[splatting.experimental]`.
fn economies(mut section: Section) -> Result<Economies, SceneError> {
    let mut economies = Economies::default();
    section.read("whole_below", &mut economies.whole_below, |entry| entry.number(Interval::SHARE))?;
    section.read("beta", &mut economies.beta, |entry| entry.number(Interval::THRESHOLD))?;
    section.read("resolution", &mut economies.resolution, |entry| entry.number(Interval::SHARE))?;
    section.finish()?;
    Ok(economies)
}

/// Reads a vector of three numbers.
fn vector(entry: &Entry) -> Result<DVec3, SceneError> {
    entry.numbers(Interval::FINITE).map(DVec3::from_array)
}

/// Reads `"headlight"` or a direction.
fn light(entry: &Entry) -> Result<Light, SceneError> {
    let allowed = "\"headlight\" or [x, y, z]";
    match entry.value.as_str() {
        Some("headlight") => Ok(Light::Headlight),
        Some(_) => Err(entry.refused(allowed)),
        None if entry.value.is_array() => vector(entry).map(Light::Direction),
        None => Err(entry.mistyped(allowed)),
    }
}

/// Reads closed intervals.
fn iso_ranges(entry: &Entry) -> Result<Vec<[f64; 2]>, SceneError> {
    let items = entry.items("an array of one or more [lo, hi]")?;
    items.iter().map(|item| item.numbers(Interval::FINITE)).collect()
}
