//! What a scene states about its channels together (SPEC §10).

use std::borrow::Cow;

use glam::DVec3;

use super::load::has_labels_for_values;
use super::{Channel, Scene, TransferSettings, VolumeSource};
use crate::appearance::{Preset, categories, channel_color, channel_display, labels_of_several, one_of_several};
use crate::settings::transfer_function::{Ramp, TransferFunction};
use crate::settings::{Classification, Gradient};
use crate::volume::{Channels, Volume};

impl Scene {
    /// The settings of a channel of the scene's volume. A scene with settings for one channel shows all of its volume's by them; in any other, channels
    /// without settings have the default ones.
    pub(super) fn settings_of(&self, number: usize) -> Cow<'_, Channel> {
        let default = || {
            let transfer =
                TransferSettings { preset: self.channels.first().transfer.preset, ..TransferSettings::default() };
            Cow::Owned(Channel { transfer, ..Channel::new(VolumeSource::Memory) })
        };
        let number = if self.channels.len() == 1 { 0 } else { number };
        self.channels.get(number).map_or_else(default, Cow::Borrowed)
    }

    /// The complete transfer functions for a volume's channels ([`TransferSettings::resolve`]); an invisible channel has no opacity.
    /// Where a volume has several channels, those whose colours are not stated have their files', or else a colour each (magenta and green, then cyan,
    /// magenta and yellow, …); those whose opacities are not, a window of their values each. Label maps among them keep their labels' colours, unless a
    /// preset shows projections. On a light background projections of one channel are dark, as on film.
    pub fn resolve(&self, volume: &Volume) -> Channels<TransferFunction> {
        if self.is_fitting() {
            return self.fitted(volume).resolve(volume);
        }
        volume.each_channel(|number, channel| {
            if self.settings_of(number).visible {
                let membership = self.takes_membership(volume) && self.is_label_map(number, channel);
                TransferFunction { membership, ..self.transfer_of(number, volume, channel) }
            } else {
                TransferFunction::transparent()
            }
        })
    }

    /// Whether channels that are label maps take normals of the membership of labels (SPEC §15).
    fn takes_membership(&self, volume: &Volume) -> bool {
        match self.shading.gradient {
            Gradient::Auto => self.classification(volume) == Classification::Before,
            gradient => gradient == Gradient::Membership,
        }
    }

    /// The gradient for a volume: that which is stated, or the one that [`Gradient::Auto`] stands for.
    pub(super) fn gradient(&self, volume: &Volume) -> Gradient {
        let is_label_map = |(number, channel): (usize, &Volume)| self.is_label_map(number, channel);
        match self.shading.gradient {
            Gradient::Auto if !self.takes_membership(volume) => Gradient::Differences,
            Gradient::Auto if (0..).zip(volume.channels()).any(is_label_map) => Gradient::Membership,
            Gradient::Auto => Gradient::Differences,
            stated => stated,
        }
    }

    /// Whether a channel's values are labels.
    pub(super) fn is_label_map(&self, number: usize, channel: &Volume) -> bool {
        has_labels_for_values(&self.settings_of(number), channel)
    }

    /// The transfer function of a channel, visible or not.
    fn transfer_of(&self, number: usize, volume: &Volume, channel: &Volume) -> TransferFunction {
        let settings = &self.settings_of(number).transfer;
        let count = volume.channel_count();
        let has_color = settings.color.is_some() || settings.colormap.is_some();
        if count == 1 {
            let transfer = settings.resolve(channel);
            let is_film = !has_color && settings.preset.is_some_and(Preset::is_projection) && self.image.is_light();
            let black = || Ramp::through(vec![(0.0, DVec3::ZERO)]);
            return if is_film { TransferFunction { color: black(), ..transfer } } else { transfer };
        }
        let has_opacity = settings.opacity.is_some();
        // What the settings state in full needs no look at the values.
        let shows_labels = !(has_color && has_opacity)
            && settings.preset.is_none_or(|preset| !preset.is_projection())
            && categories::is_label_map(channel);
        let chosen = |preset: Option<Preset>| match preset {
            _ if shows_labels => labels_of_several(channel, preset),
            None | Some(Preset::None | Preset::Confocal) => one_of_several(channel),
            Some(preset) if number > 0 => preset.transfer_of_later(channel),
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
    pub(super) fn explicit_channels(&self, volume: &Volume) -> Channels<Channel> {
        volume.each_channel(|number, channel| {
            let settings = self.settings_of(number).into_owned();
            // A channel without a table is one of the first one's volume, which only that one's table describes.
            let settings = match number < self.channels.len() {
                true => settings,
                false => Channel { visible: settings.visible, ..Channel::new(VolumeSource::Memory) },
            };
            let name = settings.name.or_else(|| channel.channel_name().map(str::to_owned));
            // The preset that declares values to be labels stays, because their looks may not tell.
            let preset =
                settings.transfer.preset.filter(|preset| *preset == Preset::Labels && channel.labels().is_none());
            let transfer = TransferSettings {
                preset,
                ..TransferSettings::stating(self.transfer_of(number, volume, channel), channel)
            };
            Channel { name, transfer, ..settings }
        })
    }

    /// The scene with only some of its channels, by their numbers in ascending order, for a volume of these. The scene must have settings for each of them.
    pub(crate) fn of_channels(&self, numbers: &[usize]) -> Self {
        let kept = self.channels.iter().enumerate().filter(|(number, _)| numbers.contains(number));
        let Some(channels) = Channels::of(kept.map(|(_, channel)| channel.clone())) else { return self.clone() };
        Self { channels, ..self.clone() }
    }

    /// The name of a channel of a volume: the scene's, the file's, or `channel N`, counted from 0.
    pub fn channel_name(&self, volume: &Volume, number: usize) -> String {
        let stated = self.channels.get(number).and_then(|channel| channel.name.clone());
        let of_file = || volume.channel(number)?.channel_name().map(str::to_owned);
        stated.or_else(of_file).unwrap_or_else(|| format!("channel {number}"))
    }
}
