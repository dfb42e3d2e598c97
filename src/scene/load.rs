//! Loading the volumes of a scene's channels.

use std::path::Path;
use std::sync::Arc;

use glam::DVec3;

use super::{Channel, Scene, VolumeSource};
use crate::appearance::{Preset, categories};
use crate::volume::{
    self, Access, AdaptedStore, Channels, LabelTable, Resampling, Selection, Store, StreamedChannel, StreamedLevel,
    Volume, VolumeError, builtin, raw_store,
};

/// The scene's volume with all channels, on the first one's grid.
pub(super) fn channels(scene: &Scene, access: &Access) -> Result<Volume, VolumeError> {
    let [first, others @ ..] = named(scene) else { return Err(in_memory("volume")) };
    let volume = channel(first, "volume", access)?;
    if others.is_empty() {
        return Ok(volume);
    }
    single(volume.channel_count(), 0, first)?;
    let others = (1..).zip(others).map(|(number, settings)| {
        let key = format!("channel[{number}].volume");
        let own = channel(settings, &key, access)?;
        single(own.channel_count(), number, settings)?;
        let resampling = if has_labels_for_values(settings, &own) { Resampling::Nearest } else { Resampling::Linear };
        own.onto(&volume, resampling, (&key, Path::new(&origin(&settings.volume))), access)
    });
    let others = others.collect::<Result<_, VolumeError>>()?;
    volume.with_channels(&origin(&first.volume), others)
}

/// The channels that name volumes: all, or the first one where the others are its volume's.
fn named(scene: &Scene) -> &[Channel] {
    let is_own = |channel: &Channel| channel.volume == VolumeSource::Memory;
    let named = if scene.channels[1..].iter().all(is_own) { 1 } else { scene.channels.len() };
    &scene.channels[..named]
}

/// Whether the values of a channel's volume are labels, of which none lies between two others.
pub(super) fn has_labels_for_values(settings: &Channel, volume: &Volume) -> bool {
    let is_declared = settings.transfer.preset == Some(Preset::Labels) && volume.labels().is_none();
    categories::is_label_map(volume) || is_declared && categories::values(volume).is_some()
}

/// The scene's volume to be read by boxes; `None` if it has several channels or labels, or is no file.
pub(super) fn store(scene: &Scene, access: &Access) -> Option<Result<Arc<dyn Store>, VolumeError>> {
    let [first @ Channel { labels: None, label_table: None, .. }] = &*scene.channels else { return None };
    let access = access
        .selecting(Selection { channel: first.index, time: first.time, level: None })
        .of_series(first.series.as_deref());
    let store = match &first.volume {
        VolumeSource::File(path) => volume::store(path, &access),
        VolumeSource::Raw(path, layout) => raw_store(path, layout, &access),
        VolumeSource::Builtin(_) | VolumeSource::Memory => return None,
    };
    Some(store.and_then(|store| spaced(&origin(&first.volume), store, first.spacing)))
}

/// The channels that a scene names, or all of the only file that it names, to be read by boxes; `None` if one of them comes from no file, or has a
/// table of labels.
///
/// # Errors
/// If a file cannot be read by boxes, lacks what is selected, or holds several channels where several channels name volumes.
pub(super) fn streamed(scene: &Scene, access: &Access) -> Option<Result<Channels<StreamedChannel>, VolumeError>> {
    let is_file = |channel: &Channel| {
        matches!(channel.volume, VolumeSource::File(_) | VolumeSource::Raw(..)) && channel.label_table.is_none()
    };
    let (first, others) = named(scene).split_first()?;
    named(scene).iter().all(is_file).then(|| {
        let mut channels = streamed_file(first, access)?;
        if !others.is_empty() {
            single(channels.len(), 0, first)?;
        }
        for (number, settings) in (1..).zip(others) {
            let own = streamed_file(settings, access)?;
            single(own.len(), number, settings)?;
            own.into_iter().for_each(|channel| channels.push(channel));
        }
        Ok(channels)
    })
}

/// The selected channels of a file, the first of them with the labels of its settings.
fn streamed_file(settings: &Channel, access: &Access) -> Result<Channels<StreamedChannel>, VolumeError> {
    let level = settings.level.unwrap_or(0);
    let own = access
        .selecting(Selection { channel: settings.index, time: settings.time, level: None })
        .of_series(settings.series.as_deref());
    let stores = match &settings.volume {
        VolumeSource::File(path) => volume::stores(path, &own)?,
        VolumeSource::Raw(path, layout) => vec![raw_store(path, layout, &own)?],
        VolumeSource::Builtin(_) | VolumeSource::Memory => return Err(in_memory("volume")),
    };
    let streamed = |origin: String, store| {
        let store = spaced(&origin, store, settings.spacing)?;
        Ok(StreamedLevel::new(origin, store, level as usize))
    };
    // Every file has a channel.
    let stores = Channels::of(stores).ok_or_else(|| in_memory("volume"))?;
    let mut channels: Channels<StreamedChannel> =
        stores.try_map(|store| streamed(origin(&settings.volume), store).map(Into::into))?;
    if let Some(path) = &settings.labels {
        let labels = streamed(path.display().to_string(), volume::store(path, &access.whole_at(level))?)?;
        *channels.first_mut() = channels.first().clone().with_labels(labels)?;
    }
    Ok(channels)
}

/// A store with the spacing that a scene states, if it states one.
fn spaced(origin: &str, store: Arc<dyn Store>, spacing: Option<DVec3>) -> Result<Arc<dyn Store>, VolumeError> {
    match spacing {
        Some(spacing) => Ok(Arc::new(AdaptedStore::spaced(origin, store, spacing)?)),
        None => Ok(store),
    }
}

/// Where a volume comes from, for errors.
pub(super) fn origin(source: &VolumeSource) -> String {
    match source {
        VolumeSource::File(path) | VolumeSource::Raw(path, _) => path.display().to_string(),
        VolumeSource::Builtin(name) => format!("builtin:{name}"),
        VolumeSource::Memory => "scene".to_owned(),
    }
}

/// Checks that one channel's volume is one channel.
fn single(count: usize, number: usize, settings: &Channel) -> Result<(), VolumeError> {
    match count {
        1 => Ok(()),
        _ => Err(VolumeError::invalid(
            origin(&settings.volume),
            format!("channel[{number}].volume"),
            format!("a volume of {count} channels"),
            "volumes of one channel, where several channels name volumes".to_owned(),
        )),
    }
}

/// The volume of one channel.
fn channel(settings: &Channel, key: &str, access: &Access) -> Result<Volume, VolumeError> {
    let selection = Selection { channel: settings.index, time: settings.time, level: settings.level };
    let access = &access.of_spacing(settings.spacing);
    let volume = match &settings.volume {
        VolumeSource::File(path) => {
            Volume::read(path, &access.selecting(selection).of_series(settings.series.as_deref()))?
        }
        VolumeSource::Raw(..) | VolumeSource::Builtin(_)
            if selection != Selection::default() || settings.series.is_some() =>
        {
            return Err(VolumeError::invalid(
                origin(&settings.volume),
                key.to_owned(),
                "index, time, level or series of a volume without channels, times, levels or series to choose from"
                    .to_owned(),
                "none of these keys, or a file of several channels, times, levels or series".to_owned(),
            ));
        }
        VolumeSource::Raw(path, layout) => Volume::read_raw(path, layout, access)?,
        VolumeSource::Builtin(name) => builtin::read(name, access)?,
        VolumeSource::Memory => return Err(in_memory(key)),
    };
    let volume = match &settings.labels {
        Some(path) => {
            let access = access.whole_at(volume.level());
            volume.with_labels_of(path, settings.spacing.is_some(), &access)?
        }
        None => volume,
    };
    // A page, whose size counts, has no such key.
    let volume = match settings.label_table.as_ref().filter(|_| cfg!(not(target_arch = "wasm32"))) {
        Some(path) => volume.with_label_table(&LabelTable::read(path, access)?)?,
        None => volume,
    };
    match settings.spacing {
        Some(spacing) => volume.with_spacing(&origin(&settings.volume), spacing),
        None => Ok(volume),
    }
}

/// The error for a volume that no scene can name.
fn in_memory(key: &str) -> VolumeError {
    VolumeError::invalid(
        "scene".to_owned(),
        key.to_owned(),
        "a volume in memory".to_owned(),
        format!("{key}.path or {key}.builtin"),
    )
}
