//! The transfer function as far as a scene states it, and how it is completed.

use std::collections::BTreeMap;

use glam::DVec3;

use super::label_ramps::{by_id, by_place};
use crate::appearance::{Colormap, Preset};
use crate::settings::transfer_function::{LabelTables, Ramp, TransferFunction};
use crate::volume::Volume;

/// The transfer function as far as a scene states it; the rest is chosen once the volume is known.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TransferSettings {
    /// The preset that chooses the rest; `None` means the preset that fits ([`Scene::fitted`](crate::scene::Scene::fitted)) where nothing else is
    /// stated, or else [`TransferFunction::from_histogram`].
    pub preset: Option<Preset>,
    /// The colour map over the visible values, used if `color` is `None`.
    pub colormap: Option<Colormap>,
    /// Red, green and blue in [0, 1] over voxel values; `None` is chosen from the volume. Where values are places of labels in the file ([`Volume::label_ids`]),
    /// this, the opacity and the iso-ranges are over the file's numbers.
    pub color: Option<Ramp<DVec3>>,
    /// Opacity per unit length in [0, 1] over voxel values; `None` is chosen from the volume.
    pub opacity: Option<Ramp<f64>>,
    /// A factor in [0, 1] over gradient magnitudes (value per world unit); `None` means 1 everywhere.
    pub gradient_opacity: Option<Ramp<f64>>,
    /// Closed intervals `[lo, hi]` of the values that take part; `None` means all values.
    pub iso_ranges: Option<Vec<[f64; 2]>>,
    /// Tables for single labels of a segmented volume, by their numbers in the file ([`Volume::label_ids`]); empty for other volumes. Numbers that the file
    /// lacks have no effect.
    pub labels: BTreeMap<u64, LabelTables>,
}

impl From<TransferFunction> for TransferSettings {
    /// Settings that state everything, with labels that are their own numbers.
    fn from(transfer: TransferFunction) -> Self {
        Self::numbered(transfer, &u64::from)
    }
}

impl TransferSettings {
    /// Settings that state everything, given the number of each label.
    fn numbered(transfer: TransferFunction, number: &dyn Fn(u16) -> u64) -> Self {
        // Whether values are labels is the volume's own.
        let TransferFunction { color, opacity, gradient_opacity, iso_ranges, labels, membership: _ } = transfer;
        let (color, opacity) = (Some(color), Some(opacity));
        let mut numbered = BTreeMap::new();
        for (label, tables) in labels {
            numbered.insert(number(label), tables);
        }
        Self { preset: None, colormap: None, color, opacity, gradient_opacity, iso_ranges, labels: numbered }
    }

    /// Settings that state everything about a volume's own channel, with labels by their numbers in its file.
    #[doc(hidden)]
    pub fn stating(transfer: TransferFunction, volume: &Volume) -> Self {
        Self::numbered(by_id(transfer, volume), &|label| volume.label_id(label))
    }

    /// Whether more is stated than a preset.
    pub(super) fn states_more(&self) -> bool {
        *self != Self { preset: self.preset, ..Self::default() }
    }

    /// The complete transfer function for a volume. Colours and opacities that are not stated (for labels, too) come from the preset or
    /// from [`TransferFunction::from_histogram`], independently of each other. A colour map covers the visible values ([`Colormap::of`]).
    pub fn resolve(&self, volume: &Volume) -> TransferFunction {
        self.resolve_by(volume, |preset| match preset {
            Some(preset) => preset.transfer(volume),
            None => TransferFunction::from_histogram(volume),
        })
    }

    /// [`Self::resolve`] with what a preset, or none, chooses.
    pub(super) fn resolve_by(
        &self,
        volume: &Volume,
        of: impl Fn(Option<Preset>) -> TransferFunction,
    ) -> TransferFunction {
        let chosen = || of(self.preset);
        let mut transfer = match (&self.color, &self.opacity) {
            (Some(color), Some(opacity)) if self.preset.is_none_or(|preset| preset == Preset::None) => {
                TransferFunction::by_value(color.clone(), opacity.clone())
            }
            _ => chosen(),
        };
        if let Some(opacity) = &self.opacity {
            transfer.opacity = opacity.clone();
        }
        // Presets have no gradient opacity.
        transfer.gradient_opacity = self.gradient_opacity.clone();
        transfer.iso_ranges = self.iso_ranges.clone();
        for (&id, own) in &self.labels {
            let Some(label) = volume.label_of_id(id) else { continue };
            let LabelTables { color, opacity, gradient_opacity, membership, .. } =
                transfer.labels.remove(&label).unwrap_or_default();
            let tables = LabelTables {
                visible: own.visible,
                color: own.color.clone().or(color),
                opacity: own.opacity.clone().or(opacity),
                gradient_opacity: own.gradient_opacity.clone().or(gradient_opacity),
                membership: own.membership || membership,
            };
            transfer.labels.insert(label, tables);
        }
        if let Some(color) = &self.color {
            transfer.color = color.clone();
        }
        let mut transfer = by_place(transfer, volume, [self.color.is_some(), self.opacity.is_some()]);
        if let (None, Some(map)) = (&self.color, self.colormap) {
            transfer.color = map.of(volume, &transfer).unwrap_or(transfer.color);
        }
        transfer
    }
}
