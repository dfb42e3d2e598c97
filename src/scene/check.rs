//! Checks of scene settings that their types do not enforce.

use super::{Channel, ImageSettings, Scene, TransferSettings};
use crate::appearance::Colormap;
use crate::error::setting::SettingError;
use crate::settings::key::Keyed;
use crate::settings::transfer_function::{Parts, check_pieces};
use crate::settings::{Classification, Gradient};
use crate::volume::{Volume, check_spacing};

impl ImageSettings {
    /// Checks that the values are in range.
    ///
    /// # Errors
    /// If width or height is 0, or the background is not in [0, 1].
    pub fn check(&self) -> Result<(), SettingError> {
        self.check_keys("image")
    }
}

impl TransferSettings {
    /// Checks that the values are in range.
    ///
    /// # Errors
    /// As for [`TransferFunction::check`](crate::settings::TransferFunction::check).
    pub fn check(&self) -> Result<(), SettingError> {
        self.parts().check("transfer")
    }

    pub(super) fn parts(&self) -> Parts<'_> {
        Parts {
            color: self.color.as_ref(),
            opacity: self.opacity.as_ref(),
            gradient_opacity: self.gradient_opacity.as_ref(),
            iso_ranges: self.iso_ranges.as_deref(),
            labels: self.labels.iter().map(|(&label, tables)| (label, tables)).collect(),
        }
    }

    /// Checks that the volume has the labels or palette that the settings need.
    ///
    /// # Errors
    /// If there are tables for labels, or the preset `labels`, and the volume has no labels; or if the colour map is the file's and the
    /// volume has no palette.
    pub fn check_volume(&self, volume: &Volume) -> Result<(), SettingError> {
        self.check_volume_as("transfer", volume)
    }

    fn check_volume_as(&self, table: &str, volume: &Volume) -> Result<(), SettingError> {
        if !self.labels.is_empty() && volume.labels().is_none() {
            let found = "tables for a volume without labels";
            return Err(SettingError::new(format!("{table}.label"), found, "no such tables, or a volume with labels"));
        }
        if self.colormap == Some(Colormap::File) && volume.palette().is_none() {
            let allowed = "another colour map, or a TIFF file whose pixels are indices of a palette";
            return Err(SettingError::new(
                format!("{table}.colormap"),
                "file, for a volume without a palette",
                allowed,
            ));
        }
        if self.preset.is_some_and(|preset| !preset.suits(volume)) {
            let allowed = "values that are whole numbers from 0 to 65535, or labels in the volume";
            return Err(SettingError::new("preset", "labels, for a volume without labels", allowed));
        }
        Ok(())
    }
}

/// The largest falloff at which sums in f32 keep the kernel's gradient. There a neighbour weighs e⁻⁸ times as much as the voxel at the point.
const MOST_FALLOFF: f64 = 8.0;

impl Scene {
    /// Whether a GPU loses the normals of some pixels, because its sums in f32 lose the neighbours' weights: with `shading.gradient = "kernel"`, above a
    /// falloff of 8. The native backend and the f64 evaluation have them.
    pub fn loses_normals_on_gpu(&self) -> bool {
        self.shading.gradient == Gradient::Kernel && self.splatting.falloff > MOST_FALLOFF
    }

    /// Checks all settings, as reading a scene file does. Every function that accepts a scene calls this.
    ///
    /// # Errors
    /// If a setting is invalid. What depends on the volume or the device is checked when a frame is prepared.
    pub fn check(&self) -> Result<(), SettingError> {
        if let Some(spacing) = self.channels.first().spacing {
            check_spacing("volume.spacing", spacing)?;
        }
        self.check_tables()?;
        for (number, channel) in self.channels.iter().enumerate() {
            channel.transfer.parts().check(&self.transfer_table(number))?;
        }
        self.check_pieces()?;
        self.check_membership()
    }

    /// [`Self::check`], and that a volume has what the scene needs ([`Self::check_volume`]).
    ///
    /// # Errors
    /// As for these.
    pub fn check_for(&self, volume: &Volume) -> Result<(), SettingError> {
        self.check()?;
        self.check_volume(volume)
    }

    /// Checks the settings of all tables but those of channels.
    pub(super) fn check_tables(&self) -> Result<(), SettingError> {
        self.camera.check()?;
        self.image.check()?;
        self.clip.check()?;
        self.shading.check()?;
        self.splatting.check()
    }

    /// The key that asks for normals of the membership of labels, if any does; a table's number counts from 0, as in errors.
    pub(super) fn membership_key(&self) -> Option<String> {
        if self.shading.gradient == Gradient::Membership {
            return Some("shading.gradient".to_owned());
        }
        let of_channel = |(number, channel): (usize, &Channel)| {
            let at = channel.transfer.labels.values().position(|tables| tables.membership)?;
            Some(format!("{}.label[{at}].gradient", self.transfer_table(number)))
        };
        self.channels.iter().enumerate().find_map(of_channel)
    }

    /// Checks that values are classified before splatting where voxels have normals of the membership of their labels (SPEC §15).
    pub(super) fn check_membership(&self) -> Result<(), SettingError> {
        match self.membership_key() {
            Some(key) if self.splatting.classification == Classification::After => {
                let found = "\"membership\" with splatting.classification = \"after\"";
                Err(SettingError::new(key, found, "classification \"before\" with it, or \"differences\""))
            }
            _ => Ok(()),
        }
    }

    /// Checks that the tables of all channels together are not too long.
    pub(super) fn check_pieces(&self) -> Result<(), SettingError> {
        check_pieces(&self.transfer_table(0), self.channels.iter().map(|channel| channel.transfer.parts()))
    }

    /// Checks that a volume has the channels that the scene has tables for, and the labels or palettes that these need.
    ///
    /// # Errors
    /// If it lacks any of them: see [`TransferSettings::check_volume`].
    pub fn check_volume(&self, volume: &Volume) -> Result<(), SettingError> {
        let (tables, channels) = (self.channels.len(), volume.channel_count());
        if tables > channels {
            let found = format!("tables for {tables} channels");
            return Err(SettingError::new("channel", found, format!("at most {channels}, as many as the volume has")));
        }
        for (number, volume) in volume.channels().enumerate() {
            self.settings_of(number).transfer.check_volume_as(&self.transfer_table(number), volume)?;
        }
        let is_label_map = |(number, channel): (usize, &Volume)| self.is_label_map(number, channel);
        if self.shading.gradient == Gradient::Membership && !volume.channels().enumerate().any(is_label_map) {
            let allowed = "\"differences\" or \"kernel\", or a label map: for labels beside values gradient in [[transfer.label]]";
            return Err(SettingError::new("shading.gradient", "\"membership\" for values that are no labels", allowed));
        }
        Ok(())
    }

    /// The key of a channel's transfer function.
    fn transfer_table(&self, number: usize) -> String {
        if self.channels.len() == 1 { "transfer".to_owned() } else { format!("channel[{number}].transfer") }
    }
}
