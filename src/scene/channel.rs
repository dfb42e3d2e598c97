//! A scene's channels (SPEC §10): where their volumes come from, and their transfer functions.

use std::borrow::Cow;
use std::path::PathBuf;

use glam::DVec3;

use super::{Scene, TransferSettings, VolumeSource};
use crate::appearance::{Preset, categories, channel_color, channel_display, labels_of_several, one_of_several};
use crate::settings::transfer_function::TransferFunction;
use crate::volume::{Volume, builtin};

/// A channel of a scene: a volume and its transfer function.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Channel {
    /// The name in legends and picks; `None` uses the file's.
    pub name: Option<String>,
    /// Whether the channel is drawn.
    pub visible: bool,
    /// The source of the volume. For a channel after the first, [`VolumeSource::Memory`] stands for the channel of the same number in the first
    /// channel's volume.
    pub volume: VolumeSource,
    /// World units between neighbouring voxels, each above 0, in place of the volume's own spacing.
    pub spacing: Option<DVec3>,
    /// A file with one label per voxel, in place of the volume's own labels.
    pub labels: Option<PathBuf>,
    /// The number, from 0, of the channel that is read of a file with several.
    pub index: Option<u32>,
    /// The number, from 0, of the time that is read of a file with several; `None` reads the first.
    pub time: Option<u32>,
    /// The level, from 0 for the finest, that is read of a store with several; `None` chooses one ([`Scene::choose_levels`]).
    pub level: Option<u32>,
    /// Colour and opacity.
    pub transfer: TransferSettings,
}

impl Channel {
    /// A channel of a volume with every setting at its default.
    pub fn new(volume: VolumeSource) -> Self {
        let transfer = TransferSettings::default();
        Self {
            name: None,
            visible: true,
            volume,
            spacing: None,
            labels: None,
            index: None,
            time: None,
            level: None,
            transfer,
        }
    }

    /// Whether the volume can have labels; an unknown builtin volume might.
    pub(super) fn may_have_labels(&self) -> bool {
        let has_none = match &self.volume {
            VolumeSource::File(_) | VolumeSource::Raw(..) => true,
            VolumeSource::Builtin(name) => builtin::labels(name).is_some_and(<[_]>::is_empty),
            VolumeSource::Memory => false,
        };
        self.labels.is_some() || !has_none
    }
}

impl Scene {
    /// The channels that the scene has settings for, the first of which are the scene's own.
    pub fn channels(&self) -> impl Iterator<Item = Cow<'_, Channel>> {
        let Self { name, visible, volume, spacing, labels, index, time, level, transfer, .. } = self;
        let first = Channel {
            name: name.clone(),
            visible: *visible,
            volume: volume.clone(),
            spacing: *spacing,
            labels: labels.clone(),
            index: *index,
            time: *time,
            level: *level,
            transfer: transfer.clone(),
        };
        std::iter::once(Cow::Owned(first)).chain(self.further.iter().map(Cow::Borrowed))
    }

    /// The settings of a channel of the scene's volume. A scene with settings for one channel shows all of its volume's by them; in any other, channels
    /// without settings have the default ones.
    pub(super) fn settings_of(&self, number: usize) -> Cow<'_, Channel> {
        let default = || {
            let transfer = TransferSettings { preset: self.transfer.preset, ..TransferSettings::default() };
            Cow::Owned(Channel { transfer, ..Channel::new(VolumeSource::Memory) })
        };
        let number = if self.further.is_empty() { 0 } else { number };
        self.channels().nth(number).unwrap_or_else(default)
    }

    /// The complete transfer function for a volume and all of its channels ([`TransferSettings::resolve`]); an invisible channel has no opacity.
    /// Where a volume has several channels, those whose colours are not stated have their files', or else a colour each (magenta and green, then cyan,
    /// magenta and yellow, …); those whose opacities are not, a window of their values each. Label maps among them keep their labels' colours, unless a
    /// preset shows projections.
    pub fn resolve(&self, volume: &Volume) -> TransferFunction {
        let mut channels = (0..).zip(volume.channels()).map(|(number, channel)| {
            if self.settings_of(number).visible {
                self.transfer_of(number, volume, channel)
            } else {
                TransferFunction::transparent()
            }
        });
        let first = channels.next().unwrap_or_else(TransferFunction::transparent);
        TransferFunction { further: channels.collect(), ..first }
    }

    /// The transfer function of a channel, visible or not.
    fn transfer_of(&self, number: usize, volume: &Volume, channel: &Volume) -> TransferFunction {
        let settings = &self.settings_of(number).transfer;
        let count = volume.channels().count();
        if count == 1 {
            return settings.resolve(channel);
        }
        let has_color = settings.color.is_some() || settings.colormap.is_some();
        let has_opacity = settings.opacity.is_some();
        // What the settings state in full needs no look at the values.
        let shows_labels = !(has_color && has_opacity)
            && settings.preset.is_none_or(Preset::keeps_labels)
            && categories::is_label_map(channel);
        let chosen = |preset: Option<Preset>| match preset {
            _ if shows_labels => labels_of_several(channel, preset),
            None | Some(Preset::Confocal) => one_of_several(channel),
            Some(preset) if number > 0 => preset.transfer_of_further(channel),
            Some(preset) => preset.transfer(channel),
        };
        let keeps_color = shows_labels || matches!(settings.preset, Some(Preset::Fusion | Preset::Labels));
        if has_color || keeps_color {
            return settings.resolve_by(channel, chosen);
        }
        let own = channel.display().and_then(channel_display::color);
        let color = own.unwrap_or_else(|| channel_color(number, count));
        TransferSettings { color: Some(color), ..settings.clone() }.resolve_by(channel, chosen)
    }

    /// The channels of a volume with everything stated that depends on it.
    pub(super) fn explicit_channels(&self, volume: &Volume) -> Vec<Channel> {
        let channel = |(number, channel): (usize, &Volume)| {
            let settings = self.settings_of(number).into_owned();
            // A channel without a table is one of the first one's volume, which only that one's table describes.
            let settings = match number <= self.further.len() {
                true => settings,
                false => Channel { visible: settings.visible, ..Channel::new(VolumeSource::Memory) },
            };
            let name = settings.name.or_else(|| channel.channel_name().map(str::to_owned));
            Channel { name, transfer: self.transfer_of(number, volume, channel).into(), ..settings }
        };
        (0..).zip(volume.channels()).map(channel).collect()
    }

    /// The scene with only some of its channels, by their numbers in ascending order, for a volume of these. The scene must have settings for each of them.
    pub(crate) fn of_channels(&self, numbers: &[usize]) -> Self {
        let kept = self.channels().enumerate().filter(|(number, _)| numbers.contains(number));
        let mut kept = kept.map(|(_, channel)| channel.into_owned());
        let Some(first) = kept.next() else { return self.clone() };
        let Channel { name, visible, volume, spacing, labels, index, time, level, transfer } = first;
        let further = kept.collect();
        Self { name, visible, volume, spacing, labels, index, time, level, transfer, further, ..self.clone() }
    }

    /// The name of a channel of a volume: the scene's, the file's, or `channel N`, counted from 0.
    pub fn channel_name(&self, volume: &Volume, number: usize) -> String {
        let stated = self.channels().nth(number).and_then(|channel| channel.name.clone());
        let of_file = || volume.channel(number)?.channel_name().map(str::to_owned);
        stated.or_else(of_file).unwrap_or_else(|| format!("channel {number}"))
    }
}
