//! The facts about a volume that its file leaves open.

use super::Volume;

impl Volume {
    /// The facts that were assumed because the volume's file does not state them, each as a name and what it was taken to be: the order of its axes, their
    /// spacing, its unit, and how the volume lies. Empty for a volume that comes from no file.
    pub fn assumptions(&self) -> Vec<String> {
        if self.encoding.is_none() {
            return Vec::new();
        }
        let axes = self.assumed_axes.map(|axes| format!("axes: {axes}"));
        let spacing = self.is_spacing_assumed.then(|| "spacing: 1 along each axis".to_owned());
        let unit = self.unit.is_none().then(|| "unit: none".to_owned());
        let lies = match self.grid.is_turned() {
            true => "orientation: that of no patient",
            false => "orientation: that of no patient, with right-handed axes",
        };
        let orientation = self.orientation.is_none().then(|| lies.to_owned());
        [axes, spacing, unit, orientation].into_iter().flatten().collect()
    }
}
