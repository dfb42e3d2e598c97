//! Checks of what a scene holds beside the settings' own types.

use super::{ImageSettings, Scene, TransferSettings};
use crate::appearance::Colormap;
use crate::setting_error::{Interval, SettingError};
use crate::settings::transfer_function::{check_iso_ranges, check_labels, check_ramps};
use crate::volume::{Volume, check_spacing};

impl ImageSettings {
    /// What widths and heights may be.
    pub(super) const PIXELS: &str = "an integer from 1 to the device's texture limit";

    /// Checks what types do not say.
    ///
    /// # Errors
    /// If width or height is 0, or the background is not in [0, 1].
    pub fn check(&self) -> Result<(), SettingError> {
        for (key, pixels) in [("image.width", self.width), ("image.height", self.height)] {
            if pixels == 0 {
                return Err(SettingError::new(key, f64::from(pixels), Self::PIXELS));
            }
        }
        Interval::SHARE.check_each("image.background", &self.background)
    }
}

impl TransferSettings {
    /// Checks what types do not say.
    ///
    /// # Errors
    /// If a colour, opacity or factor is not in [0, 1], also in a label's tables, there are iso-ranges but not one, or one is not finite or
    /// reversed.
    pub fn check(&self) -> Result<(), SettingError> {
        check_ramps("transfer", self.color.as_ref(), self.opacity.as_ref(), self.gradient_opacity.as_ref())?;
        check_iso_ranges(self.iso_ranges.as_deref())?;
        check_labels(&self.labels)
    }

    /// Checks that a volume has what the settings are for.
    ///
    /// # Errors
    /// If it has no labels and there are tables for some, or the preset for labels, or if it has no palette and the colour map is that.
    pub fn check_volume(&self, volume: &Volume) -> Result<(), SettingError> {
        if !self.labels.is_empty() && volume.labels().is_none() {
            let found = "tables for a volume without labels";
            return Err(SettingError::new("transfer.label", found, "none, or labels in the volume"));
        }
        if self.colormap == Some(Colormap::File) && volume.palette().is_none() {
            let allowed = "another colour map, or a TIFF file whose pixels are indices of a palette";
            return Err(SettingError::new("transfer.colormap", "file, for a volume without a palette", allowed));
        }
        if self.preset.is_some_and(|preset| !preset.suits(volume)) {
            let allowed = "values that are whole numbers from 0 to 65535, or labels in the volume";
            return Err(SettingError::new("preset", "labels for a volume that has none", allowed));
        }
        Ok(())
    }
}

impl Scene {
    /// Checks all settings, as reading a scene file does. Whoever takes a scene calls it.
    ///
    /// # Errors
    /// If a setting is not allowed; what only the volume or the device can tell is found out when a frame is prepared.
    pub fn check(&self) -> Result<(), SettingError> {
        if let Some(spacing) = self.spacing {
            check_spacing("volume.spacing", spacing)?;
        }
        self.camera.check()?;
        self.image.check()?;
        self.clip.check()?;
        self.transfer.check()?;
        self.shading.check()?;
        self.splatting.check()
    }
}
