//! The tables of a scene file, and what their keys mean together (SPEC §7).

use std::path::Path;

use super::keys::VolumeTable;
use super::overrides::MAX_CHANNELS;
use super::reader::{Entry, Origins, Section};
use super::{Channel, Fitting, SceneError, TransferSettings, VolumeSource};
use crate::appearance::Preset;
use crate::settings::camera::Camera;
use crate::settings::camera_table::CameraTable;
use crate::settings::economies::{Economies, TABLE};
use crate::settings::key::{Key, Keyed};
use crate::settings::splatting::Splatting;
use crate::volume::{RawLayout, SampleType, builtin_name, check_spacing, written_in};

/// The tables of one channel.
pub(super) struct ChannelTables<'a> {
    /// The channel's key; empty for a scene of `[volume]` and `[transfer]`.
    key: String,
    /// Its name, and whether it is visible.
    channel: Channel,
    volume: Section<'a>,
    transfer: Section<'a>,
    /// Whether there is a table `transfer`.
    pub(super) states_transfer: bool,
}

impl<'a> ChannelTables<'a> {
    /// Takes out `volume` and `transfer` of a channel, or of a file.
    fn of(section: &mut Section<'a>, channel: Channel) -> Result<Self, SceneError> {
        let states_transfer = section.states("transfer");
        let (volume, transfer) = (section.section("volume")?, section.section("transfer")?);
        Ok(Self { key: section.name.clone(), channel, volume, transfer, states_transfer })
    }
}

/// Takes out `[[channel]]`, or `[volume]` and `[transfer]` in its place.
pub(super) fn channel_tables<'a>(root: &mut Section<'a>) -> Result<Vec<ChannelTables<'a>>, SceneError> {
    let states_single = root.states("volume") || root.states("transfer");
    let single = ChannelTables::of(root, Channel::default())?;
    let channels = root.take("channel").map_or(Ok(Vec::new()), |entry| entry.items("tables [[channel]]"))?;
    if channels.is_empty() {
        return Ok(vec![single]);
    }
    if states_single {
        let overridden = ["volume", "transfer"].map(|table| root.origins.overrides_within(table)).concat();
        let allowed = "either [[channel]], or [volume] and [transfer]";
        return Err(root.origins.invalid("channel", &overridden, "both", allowed));
    }
    if channels.len() > MAX_CHANNELS {
        let (found, allowed) = (format!("{} tables", channels.len()), format!("at most {MAX_CHANNELS}"));
        return Err(root.origins.invalid("channel", &[], found, allowed));
    }
    let of_channel = |item: &Entry<'a>| {
        let mut section = item.section("a table [[channel]]")?;
        let mut channel = Channel::default();
        section.fill(&mut channel)?;
        let tables = ChannelTables::of(&mut section, channel)?;
        section.finish()?;
        Ok(tables)
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
    for ChannelTables { key, channel, volume: of_volume, transfer: of_transfer, .. } in tables {
        let origins = of_volume.origins;
        let is_first = channels.is_empty();
        let of_volume = volume(of_volume, folder, if is_first { given.take() } else { Some(VolumeSource::Memory) })?;
        let is_nameless = of_volume.volume == VolumeSource::Memory;
        if is_nameless && (!is_first && of_volume != Channel::default() || of_volume.label_table.is_some()) {
            let found = "keys of a volume without path or builtin";
            let allowed = "keys of a volume of the channel's own";
            return Err(origins.invalid(&format!("{key}.volume"), &[], found, allowed));
        }
        let transfer = TransferSettings { preset, ..transfer(of_transfer)? };
        let channel = Channel { name: channel.name, visible: channel.visible, transfer, ..of_volume };
        if !channel.transfer.labels.is_empty() && !channel.may_have_labels() {
            let key = |name: &str| if key.is_empty() { name.to_owned() } else { format!("{key}.{name}") };
            let allowed = "no such tables, or volume.labels, or volume.builtin = \"head\" or \"tomato\"";
            let related = [key("volume.path"), key("volume.builtin"), key("volume.labels")];
            let found = "tables for a volume without labels";
            let related = related.each_ref().map(String::as_str);
            return Err(origins.invalid(&key("transfer.label"), &related, found, allowed));
        }
        channels.push(channel);
    }
    Ok(channels)
}

/// Reads `[volume]` into a channel; `given` is the source of a table that names none.
fn volume(section: Section, folder: &Path, given: Option<VolumeSource>) -> Result<Channel, SceneError> {
    let (origins, key) = (section.origins, section.name.clone());
    let table = section.filled(VolumeTable::default())?;
    if let Some(spacing) = table.channel.spacing {
        check_spacing(&format!("{key}.spacing"), spacing).map_err(|error| origins.refused(error))?;
    }
    let raw = raw_layout(origins, &key, &table)?;
    let VolumeTable { path, builtin, labels, label_table, channel, .. } = table;
    let refused = |found| origins.invalid(&key, &[], found, format!("either {key}.path or {key}.builtin"));
    let source = match (path, builtin) {
        (Some(path), None) => VolumeSource::File(written_in(folder, &path)),
        (None, Some(name)) => VolumeSource::Builtin(name),
        (None, None) => given.ok_or_else(|| refused("neither path nor builtin"))?,
        (Some(_), Some(_)) => return Err(refused("both path and builtin")),
    };
    let volume = match (source, raw) {
        (source, None) => source,
        (VolumeSource::File(path), Some(layout)) => VolumeSource::Raw(path, layout),
        (_, Some(_)) => {
            let found = "a volume that is not a file";
            return Err(origins.invalid(&format!("{key}.dims"), &[], found, format!("{key}.path")));
        }
    };
    let table = |text: String| match builtin_name(Path::new(&text)) {
        Some(_) => text.into(),
        None => written_in(folder, &text),
    };
    let labels = labels.map(|path| written_in(folder, &path));
    Ok(Channel { volume, labels, label_table: label_table.map(table), ..channel })
}

/// The layout of a raw file: `dims`, which requires `type`, `endian` and `offset`.
fn raw_layout(origins: &Origins, key: &str, table: &VolumeTable) -> Result<Option<RawLayout>, SceneError> {
    let VolumeTable { dims, sample_type, big_endian, offset, .. } = *table;
    let missing = |name: &str, allowed: &str| {
        let related = format!("{key}.dims");
        origins.invalid(&format!("{key}.{name}"), &[&related], "no such key", allowed)
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

/// Reads `[camera]`. Keys of the other projection are checked but have no effect. `default` has what is not stated.
pub(super) fn camera(section: Section, default: Camera) -> Result<Camera, SceneError> {
    let origins = section.origins;
    let states_eye = section.states("direction") || section.states("up");
    let mut table = section.filled(CameraTable::from(default))?;
    table.camera.is_eye_open &= !states_eye;
    table.check().map_err(|error| origins.refused(error))?;
    Ok(table.into())
}

/// Reads `[transfer]`.
fn transfer(section: Section) -> Result<TransferSettings, SceneError> {
    let (origins, key) = (section.origins, section.name.clone());
    let transfer = section.filled(TransferSettings::default())?;
    transfer.parts().check(&key).map_err(|error| origins.refused(error))?;
    if transfer.color.is_some() && transfer.colormap.is_some() {
        let allowed = format!("one of {key}.color and {key}.colormap");
        return Err(origins.invalid(&key, &[], "both color and colormap", allowed));
    }
    Ok(transfer)
}

/// The choices that are left to a preset in some tables: the keys that are missing.
pub(super) fn fitting(sections: [&Section; 3]) -> Fitting {
    let mut fitting = Fitting::ALL;
    for (key, is_open) in fitting.keys() {
        *is_open = !sections.iter().any(|section| section.states(key));
    }
    fitting
}

/// Reads `[splatting]` over a preset's values.
pub(super) fn splatting(mut section: Section, mut splatting: Splatting) -> Result<Splatting, SceneError> {
    section.fill(&mut splatting)?;
    splatting.experimental = section.section("experimental")?.filled(Economies::default())?;
    for Key { name, .. } in Economies::KEYS {
        section.moved(name, &format!("{TABLE}.{name}"))?;
    }
    section.finish()?;
    Ok(splatting)
}
