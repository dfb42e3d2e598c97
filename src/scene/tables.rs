//! The tables of a scene file: their keys, types and ranges (SPEC §7).

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::DVec3;

use super::color::{rgb, rgba};
use super::names::{
    BOXES, CLASSIFICATIONS, COMPOSITINGS, ENDIANS, FITS, FORMS, GRADIENTS, INTERPOLATIONS, LABEL_GRADIENTS, METHODS,
    ORDERS, PROFILES, RASTERIZERS,
};
use super::overrides::MAX_CHANNELS;
use super::reader::{Entry, LABEL, Section};
use super::{Channel, Fitting, ImageSettings, SceneError, TransferSettings, VolumeSource};
use crate::appearance::{Colormap, Preset};
use crate::error::setting::Interval;
use crate::settings::camera::{Camera, FOV_Y, Projection};
use crate::settings::clip::{Clip, MAX_PLANES};
use crate::settings::economies::{Economies, KEYS};
use crate::settings::shading::{LIGHT_SPREAD, LIGHT_STEP, Light, Shading};
use crate::settings::splatting::{FALLOFF, RADIUS, SLAB_WIDTH, Splatting};
use crate::settings::transfer_function::{LabelTables, Ramp};
use crate::volume::{RawLayout, SPACING, SampleType, check_spacing, written_in};

/// The tables of one channel.
pub(super) struct ChannelTables<'a> {
    /// The channel's key; empty for a scene of `[volume]` and `[transfer]`.
    key: String,
    name: Option<String>,
    visible: bool,
    volume: Section<'a>,
    transfer: Section<'a>,
    /// Whether there is a table `transfer`.
    pub(super) states_transfer: bool,
}

/// Takes out `[[channel]]`, or `[volume]` and `[transfer]` in its place.
pub(super) fn channel_tables<'a>(root: &mut Section<'a>) -> Result<Vec<ChannelTables<'a>>, SceneError> {
    let mut channels = Vec::new();
    let states_single = ["volume", "transfer"].map(|table| root.states(table));
    let first = ChannelTables {
        key: String::new(),
        name: None,
        visible: true,
        volume: root.section("volume")?,
        transfer: root.section("transfer")?,
        states_transfer: states_single[1],
    };
    root.read("channel", &mut channels, |entry| entry.items("tables [[channel]]"))?;
    if channels.is_empty() {
        return Ok(vec![first]);
    }
    let allowed = "either [[channel]], or [volume] and [transfer]";
    if states_single != [false; 2] {
        let overridden = ["volume", "transfer"].map(|table| root.origins.overrides_within(table)).concat();
        return Err(root.origins.invalid("channel", &overridden, "both", allowed));
    }
    if channels.len() > MAX_CHANNELS {
        let (found, allowed) = (format!("{} tables", channels.len()), format!("at most {MAX_CHANNELS}"));
        return Err(root.origins.invalid("channel", &[], found, allowed));
    }
    let of_channel = |item: &Entry<'a>| {
        let mut section = item.section("a table [[channel]]")?;
        let (mut name, mut visible) = (None, true);
        section.read("name", &mut name, |entry| entry.text("a name").map(Some))?;
        section.read("visible", &mut visible, Entry::boolean)?;
        let states_transfer = section.states("transfer");
        let (volume, transfer) = (section.section("volume")?, section.section("transfer")?);
        let key = section.name.clone();
        section.finish()?;
        Ok(ChannelTables { key, name, visible, volume, transfer, states_transfer })
    };
    channels.iter().map(of_channel).collect()
}

/// Reads the tables of all channels. `given` is the source of a first volume that names none.
pub(super) fn channels(
    tables: Vec<ChannelTables>,
    folder: &Path,
    mut given: Option<VolumeSource>,
    preset: Option<Preset>,
) -> Result<Vec<Channel>, SceneError> {
    let mut channels = Vec::new();
    for ChannelTables { key, name, visible, volume: of_volume, transfer: of_transfer, .. } in tables {
        let origins = of_volume.origins;
        let is_first = channels.is_empty();
        let VolumeSettings { source, spacing, labels, label_table, index, time, level, series } =
            volume(of_volume, folder, if is_first { given.take() } else { Some(VolumeSource::Memory) })?;
        let states_more = spacing.is_some()
            || labels.is_some()
            || label_table.is_some()
            || index.is_some()
            || time.is_some()
            || level.is_some()
            || series.is_some();
        let is_nameless = source == VolumeSource::Memory;
        if is_nameless && (!is_first && states_more || label_table.is_some()) {
            let found = "keys of a volume without path or builtin";
            let allowed = "keys of a volume of the channel's own";
            return Err(origins.invalid(&format!("{key}.volume"), &[], found, allowed));
        }
        let transfer = TransferSettings { preset, ..transfer(of_transfer)? };
        let channel = Channel {
            name,
            visible,
            volume: source,
            spacing,
            labels,
            label_table,
            index,
            time,
            level,
            series,
            transfer,
        };
        if !channel.transfer.labels.is_empty() && !channel.may_have_labels() {
            let key = |name: &str| if key.is_empty() { name.to_owned() } else { format!("{key}.{name}") };
            let allowed = "no such tables, or volume.labels, or volume.builtin = \"head\" or \"tomato\"";
            let related = [key("volume.path"), key("volume.builtin"), key("volume.labels")];
            let found = "tables for a volume without labels";
            return Err(origins.invalid(
                &key("transfer.label"),
                &related.each_ref().map(String::as_str),
                found,
                allowed,
            ));
        }
        channels.push(channel);
    }
    Ok(channels)
}

/// `[volume]`.
struct VolumeSettings {
    source: VolumeSource,
    spacing: Option<DVec3>,
    labels: Option<PathBuf>,
    label_table: Option<PathBuf>,
    index: Option<u32>,
    time: Option<u32>,
    level: Option<u32>,
    series: Option<String>,
}

/// Reads `[volume]`; `given` is the source of a table that names none.
fn volume(mut section: Section, folder: &Path, given: Option<VolumeSource>) -> Result<VolumeSettings, SceneError> {
    let (mut path, mut builtin, mut spacing, mut labels, mut label_table) = (None, None, None, None, None);
    section.read("path", &mut path, |entry| entry.text("a volume file's path").map(Some))?;
    section.read("builtin", &mut builtin, |entry| entry.text("a builtin volume's name").map(Some))?;
    section.read("spacing", &mut spacing, |entry| entry.numbers(SPACING).map(|s| Some(DVec3::from_array(s))))?;
    section.read("labels", &mut labels, |entry| {
        entry.text("a label file's path").map(|path| Some(written_in(folder, &path)))
    })?;
    if cfg!(not(target_arch = "wasm32")) {
        section.read("label_table", &mut label_table, |entry| {
            let text = entry.text("a table's path, or builtin:freesurfer")?;
            Ok(Some(if text.starts_with("builtin:") { text.into() } else { written_in(folder, &text) }))
        })?;
    }
    let (mut index, mut time, mut level) = (None, None, None);
    section.read("index", &mut index, |entry| entry.count().map(Some))?;
    section.read("time", &mut time, |entry| entry.count().map(Some))?;
    section.read("level", &mut level, Entry::level)?;
    let mut series = None;
    section.read("series", &mut series, Entry::series)?;
    let raw = raw_layout(&mut section)?;
    let (origins, key) = (section.origins, section.name.clone());
    section.finish()?;
    if let Some(spacing) = spacing {
        check_spacing(&format!("{key}.spacing"), spacing).map_err(|error| origins.refused(error))?;
    }
    let refused = |found| origins.invalid(&key, &[], found, format!("either {key}.path or {key}.builtin"));
    let source = match (path, builtin) {
        (Some(path), None) => VolumeSource::File(written_in(folder, &path)),
        (None, Some(name)) => VolumeSource::Builtin(name),
        (None, None) => given.ok_or_else(|| refused("neither path nor builtin"))?,
        (Some(_), Some(_)) => return Err(refused("both path and builtin")),
    };
    let source = match (source, raw) {
        (source, None) => source,
        (VolumeSource::File(path), Some(layout)) => VolumeSource::Raw(path, layout),
        (_, Some(_)) => {
            let found = "a volume that is not a file";
            return Err(origins.invalid(&format!("{key}.dims"), &[], found, format!("{key}.path")));
        }
    };
    Ok(VolumeSettings { source, spacing, labels, label_table, index, time, level, series })
}

/// The layout of a raw file: `dims`, which requires `type`, `endian` and `offset`.
fn raw_layout(section: &mut Section) -> Result<Option<RawLayout>, SceneError> {
    let (mut dims, mut sample_type, mut big_endian, mut offset) = (None, None, None, None);
    section.read("dims", &mut dims, |entry| entry.dims().map(Some))?;
    section.read("type", &mut sample_type, |entry| entry.choice(&SampleType::NAMED).map(Some))?;
    section.read("endian", &mut big_endian, |entry| entry.choice(ENDIANS).map(Some))?;
    section.read("offset", &mut offset, |entry| entry.bytes().map(Some))?;
    let table = section.name.clone();
    let missing = |key: &str, allowed: &str| {
        let related = format!("{table}.dims");
        section.origins.invalid(&format!("{table}.{key}"), &[&related], "no such key", allowed)
    };
    let Some(dims) = dims else {
        if sample_type.is_some() || big_endian.is_some() || offset.is_some() {
            return Err(missing("dims", "the sizes of a raw file, to which type, endian and offset belong"));
        }
        return Ok(None);
    };
    let Some(sample_type) = sample_type else {
        let names = SampleType::NAMED.map(|(name, _)| format!("{name:?}")).join(" or ");
        return Err(missing("type", &names));
    };
    let is_one_byte = matches!(sample_type, SampleType::I8 | SampleType::U8);
    let Some(big_endian) = big_endian.or(is_one_byte.then_some(false)) else {
        return Err(missing("endian", "\"little\" or \"big\""));
    };
    Ok(Some(RawLayout { dims, sample_type, big_endian, offset: offset.unwrap_or(0) }))
}

/// Reads `[camera]`. Keys of the other projection are checked but have no effect, so that overriding `projection` alone works. `default` has
/// what is not stated.
pub(super) fn camera(mut section: Section, default: Camera) -> Result<Camera, SceneError> {
    let mut camera = default;
    let mut is_perspective = false;
    let (mut height, mut fov_y, mut distance, mut near) = (None, 30.0, None, None);
    let projections = [("orthographic", false), ("perspective", true)];
    section.read("projection", &mut is_perspective, |entry| entry.choice(&projections))?;
    let (mut direction, mut up) = (None, None);
    section.read("direction", &mut direction, |entry| vector(entry).map(Some))?;
    section.read("up", &mut up, |entry| vector(entry).map(Some))?;
    if direction.is_some() || up.is_some() {
        camera = camera.looking([direction.unwrap_or(camera.direction), up.unwrap_or(camera.up)]);
    }
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
    section.read("background", &mut image.background, rgba)?;
    section.finish()?;
    Ok(image)
}

/// Reads `[clip]` over a preset's values.
pub(super) fn clip(mut section: Section, mut clip: Clip) -> Result<Clip, SceneError> {
    section.read("planes", &mut clip.planes, planes)?;
    section.read("crop", &mut clip.crop, |entry| crop(entry).map(Some))?;
    section.read("shade_faces", &mut clip.shade_faces, Entry::boolean)?;
    section.finish()?;
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
fn transfer(mut section: Section) -> Result<TransferSettings, SceneError> {
    let mut transfer = TransferSettings::default();
    let TransferSettings { color, opacity, gradient_opacity, .. } = &mut transfer;
    ramps(&mut section, color, opacity, gradient_opacity)?;
    section.read("iso_ranges", &mut transfer.iso_ranges, |entry| iso_ranges(entry).map(Some))?;
    section.read("label", &mut transfer.labels, labels)?;
    section.read("colormap", &mut transfer.colormap, |entry| entry.choice(&Colormap::ALL).map(Some))?;
    let (origins, key) = (section.origins, section.name.clone());
    section.finish()?;
    transfer.check_as(&key).map_err(|error| origins.refused(error))?;
    if transfer.color.is_some() && transfer.colormap.is_some() {
        let allowed = format!("one of {key}.color and {key}.colormap");
        return Err(origins.invalid(&key, &[], "both color and colormap", allowed));
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
    let share = |entry: &Entry| entry.number(Interval::SHARE);
    section.read("color", color, |entry| entry.ramp("[value, [r, g, b]]", rgb).map(Some))?;
    section.read("opacity", opacity, |entry| entry.ramp("[value, opacity]", share).map(Some))?;
    let point = "[gradient magnitude, factor]";
    section.read("gradient_opacity", gradient_opacity, |entry| entry.ramp(point, share).map(Some))
}

/// Reads `[[transfer.label]]`.
fn labels(entry: &Entry) -> Result<BTreeMap<u64, LabelTables>, SceneError> {
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
        section.read("gradient", &mut tables.membership, |entry| entry.choice(LABEL_GRADIENTS))?;
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
    section.read("occlusion", &mut shading.occlusion, |entry| entry.number(Interval::SHARE))?;
    section.read("occlusion_spread", &mut shading.occlusion_spread, |entry| entry.number(LIGHT_SPREAD))?;
    section.read("shadow", &mut shading.shadow, |entry| entry.number(Interval::SHARE))?;
    section.read("shadow_spread", &mut shading.shadow_spread, |entry| entry.number(LIGHT_SPREAD))?;
    section.read("light_step", &mut shading.light_step, |entry| entry.number(LIGHT_STEP))?;
    section.finish()?;
    Ok(shading)
}

/// The choices that are left to a preset in `[shading]` and `[splatting]`: the keys that are missing.
pub(super) fn fitting(shading: &Section, splatting: &Section, clip: &Section) -> Fitting {
    let is_open = |key: &str| !shading.states(key);
    Fitting {
        is_open: true,
        enabled: is_open("enabled"),
        ambient: is_open("ambient"),
        diffuse: is_open("diffuse"),
        specular: is_open("specular"),
        shininess: is_open("shininess"),
        light: is_open("light"),
        occlusion: is_open("occlusion"),
        shadow: is_open("shadow"),
        light_step: is_open("light_step"),
        compositing: !splatting.states("compositing"),
        shade_faces: !clip.states("shade_faces"),
    }
}

/// Reads `[splatting]` over a preset's values.
pub(super) fn splatting(mut section: Section, mut splatting: Splatting) -> Result<Splatting, SceneError> {
    section.read("method", &mut splatting.method, |entry| entry.choice(METHODS))?;
    section.read("radius", &mut splatting.radius, |entry| entry.number(RADIUS))?;
    section.read("falloff", &mut splatting.falloff, |entry| entry.number(FALLOFF))?;
    section.read("slab_width", &mut splatting.slab_width, |entry| entry.number(SLAB_WIDTH))?;
    section.read("slab_profile", &mut splatting.slab_profile, |entry| entry.choice(PROFILES))?;
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
    section.finish()?;
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

/// Reads a light's name or a direction.
fn light(entry: &Entry) -> Result<Light, SceneError> {
    let allowed = "\"headlight\", \"upper-left\" or [x, y, z]";
    match entry.value.as_str() {
        Some("headlight") => Ok(Light::Headlight),
        Some("upper-left") => Ok(Light::UpperLeft),
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
