//! One label alone.

use std::collections::BTreeSet;

use super::Scene;
use crate::appearance::{Preset, categories};
use crate::error::setting::SettingError;
use crate::volume::Volume;

/// The key in errors.
const KEY: &str = "only";

/// The most names that an error lists.
const MOST_NAMES: usize = 40;

impl Scene {
    /// The scene of a volume with one label alone. `label` is its name, or its number in the file ([`Volume::label_ids`]); labels of one name are shown together.
    /// In a segmented volume, all other labels are hidden. In a label map, the iso-ranges become the label's values. The appearance that the scene leaves open is
    /// stated, as [`Scene::fitted`] chooses it.
    ///
    /// # Errors
    /// If the volume has no labels, or no such label; or if it is read by boxes and has labels beside values, of which not all are known then.
    pub fn only(&self, label: &str, volume: &Volume) -> Result<Self, SettingError> {
        let refused = |allowed: String| SettingError::new(KEY, format!("\"{label}\""), allowed);
        let mut scene = self.fitted(volume);
        let is_map =
            || scene.channels.first().transfer.preset == Some(Preset::Labels) || categories::is_label_map(volume);
        let names = volume.label_names();
        let mut chosen: BTreeSet<u16> =
            names.iter().filter(|(_, name)| *name == label).map(|(&label, _)| label).collect();
        if chosen.is_empty() {
            chosen.extend(label.parse().ok().and_then(|id| volume.label_of_id(id)));
        }
        // The volume's labels, if the chosen ones are among them.
        let found = |present: Vec<u16>| match present.iter().any(|label| chosen.contains(label)) {
            true => Ok(present),
            false => Err(refused(allowed(volume, &present))),
        };
        match volume.labels() {
            Some(_) if volume.drawn_grid() != volume.grid() => {
                return Err(refused("a volume with labels that fits into memory".to_owned()));
            }
            Some(labels) => {
                let present = found(categories::distinct(labels))?;
                let of_labels = &mut scene.channels.first_mut().transfer.labels;
                for label in present {
                    of_labels.entry(volume.label_id(label)).or_default().visible = chosen.contains(&label);
                }
            }
            None if is_map() => {
                found(categories::values(volume).unwrap_or_default())?;
                let ids = chosen.iter().map(|&label| volume.label_id(label) as f64);
                scene.channels.first_mut().transfer.iso_ranges = Some(ids.map(|id| [id, id]).collect());
            }
            None => return Err(refused("a label map, or a volume with labels".to_owned())),
        }
        Ok(scene)
    }
}

/// The labels of a volume, by name or else by number.
fn allowed(volume: &Volume, present: &[u16]) -> String {
    let name = |label: &u16| match volume.label_names().get(label) {
        Some(name) => format!("\"{name}\""),
        None => volume.label_id(*label).to_string(),
    };
    let more = present.len().saturating_sub(MOST_NAMES);
    let names: Vec<String> = present.iter().take(MOST_NAMES).map(name).collect();
    let rest = if more == 0 { String::new() } else { format!(" and {more} more") };
    format!("{}{rest}, or a label's number", names.join(", "))
}
