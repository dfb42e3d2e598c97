//! Files whose values are labels beyond 16 bits, such as those of atlases: the values become labels that take their places.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use glam::DVec3;

use super::access::Access;
use super::borders::are_sharp;
use super::error::volume::VolumeError;
use super::format;
use super::label_ids::Numbered;
use super::loaded::{Legend, Loaded};
use super::value_slice::ValueSlice;
use super::voxels::Wanted;
use super::{Values, Volume};

/// Labels in place of values, and what the file says of them.
pub(super) struct NumberedValues {
    values: Values,
    ids: Option<Arc<[u64]>>,
    names: BTreeMap<u16, String>,
    palette: Option<Vec<(f64, DVec3)>>,
}

/// Whether all values are whole numbers from 0 on, and some take more than 16 bits.
pub(super) fn are_beyond_16_bits(values: ValueSlice<'_>) -> bool {
    let largest = f32::from(u16::MAX);
    values.iter().any(|value| value > largest) && values.iter().all(|value| value >= 0.0 && value.fract() == 0.0)
}

impl Volume {
    /// The labels that take the place of a file's values, if these are labels beyond 16 bits: because the file says so, or because they look like labels. The
    /// file is read once more, since `f32` does not tell all of them apart.
    pub(super) fn labels_beyond_16_bits(
        &self,
        path: &Path,
        legend: &Legend,
        access: &Access,
    ) -> Option<NumberedValues> {
        let are_stated = legend.is_of_labels();
        let numbered = match Self::numbers_of(path, access) {
            Ok(numbered) => numbered,
            Err(error) if are_stated => {
                log::warn!("{error}: the values are drawn as amounts");
                return None;
            }
            Err(_) => return None,
        };
        let Numbered { labels, ids } = numbered;
        let mut counts = BTreeMap::<u16, u64>::new();
        let mut last = None;
        for &label in &labels {
            // Neighbours mostly have one label, so that runs are counted at once.
            match &mut last {
                Some((same, count)) if *same == label => *count += 1,
                _ => {
                    add(&mut counts, last);
                    last = Some((label, 1_u64));
                }
            }
        }
        add(&mut counts, last);
        // The lowest of the most frequent labels.
        let background = counts.iter().rev().max_by_key(|(_, count)| **count).map_or(0, |(&label, _)| label);
        let is_enough = counts.len() >= 3;
        let pieces = Self::piece(self.grid, Values::from(labels).narrowed());
        if !(are_stated || is_enough && are_sharp(&pieces, background.into())) {
            return None;
        }
        let names = legend.label_names(ids.as_deref());
        let palette = Some(legend.label_colors(ids.as_deref())).filter(|palette| !palette.is_empty());
        Some(NumberedValues { values: pieces.values, ids, names, palette })
    }

    /// The same volume with labels for values.
    pub(super) fn with_numbered(self, numbered: NumberedValues) -> Self {
        let NumberedValues { values, ids, names, palette } = numbered;
        Self { values, label_ids: ids, label_names: names, palette, ..self }
    }

    fn numbers_of(path: &Path, access: &Access) -> Result<Numbered, VolumeError> {
        let (_, loaded) = format::read(path, &access.wanting(Wanted::Ids))?;
        loaded.check_single(path, "one: a label for every voxel")?;
        let Loaded { values, .. } = loaded;
        values.into_ids().numbered(path)
    }
}

fn add(counts: &mut BTreeMap<u16, u64>, run: Option<(u16, u64)>) {
    if let Some((label, count)) = run {
        *counts.entry(label).or_default() += count;
    }
}
