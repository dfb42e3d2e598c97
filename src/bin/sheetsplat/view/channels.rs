//! The list of channels in the panel (SPEC §10): their names in their colours, each with a box that shows or hides it.

use eframe::egui::{Color32, RichText, Ui};
use sheetsplat::scene::Scene;
use sheetsplat::settings::{Ramp, TransferFunction};
use sheetsplat::volume::Volume;

/// The names of a volume's channels, and whether each is shown.
pub(super) struct Channels {
    rows: Vec<(String, bool)>,
}

impl Channels {
    /// The channels of a volume as a scene shows them.
    pub(super) fn new(scene: &Scene, volume: &Volume) -> Self {
        // Without settings of its own a channel has the scene's.
        let of = |number: usize| if scene.further.is_empty() { 0 } else { number };
        let is_shown = |number| scene.channels().nth(of(number)).is_none_or(|channel| channel.visible);
        let row = |number| (scene.channel_name(volume, number), is_shown(number));
        Self { rows: (0..volume.channels().count()).map(row).collect() }
    }

    /// The transfer functions of all channels, hidden ones too.
    pub(super) fn transfer(scene: &Scene, volume: &Volume) -> TransferFunction {
        let mut all = scene.clone();
        all.visible = true;
        all.further.iter_mut().for_each(|channel| channel.visible = true);
        all.resolve(volume)
    }

    /// Whether there is more than one.
    pub(super) fn are_several(&self) -> bool {
        self.rows.len() > 1
    }

    /// The list.
    pub(super) fn show(&mut self, ui: &mut Ui, transfer: &TransferFunction) {
        for ((name, is_shown), of) in self.rows.iter_mut().zip(transfer.channels()) {
            let color = of.color.points().last().map(|(_, color)| *color).unwrap_or_default();
            let [red, green, blue] = (color * 255.0).to_array().map(|channel| channel.round() as u8);
            ui.checkbox(is_shown, RichText::new(name.as_str()).color(Color32::from_rgb(red, green, blue)));
        }
    }

    /// Transfer functions without those of hidden channels.
    pub(super) fn shown(&self, transfer: &TransferFunction) -> TransferFunction {
        let mut shown = transfer.clone();
        let Ok(nothing) = Ramp::new(vec![(0.0, 0.0)]) else { return shown };
        let hide = |of: &mut TransferFunction, (_, is_shown): &(String, bool)| {
            if !is_shown {
                of.opacity = nothing.clone();
                of.labels.clear();
            }
        };
        let (first, further) = self.rows.split_at(self.rows.len().min(1));
        first.iter().for_each(|row| hide(&mut shown, row));
        shown.further.iter_mut().zip(further).for_each(|(of, row)| hide(of, row));
        shown
    }

    /// Notes in a scene that states every channel which are shown.
    pub(super) fn note(&self, scene: &mut Scene) {
        let (first, further) = self.rows.split_at(self.rows.len().min(1));
        first.iter().for_each(|(_, is_shown)| scene.visible = *is_shown);
        scene.further.iter_mut().zip(further).for_each(|(channel, (_, is_shown))| channel.visible = *is_shown);
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn hidden_channels_have_no_opacity_and_come_back() {
        let channel = "[[channel]]\nvolume.builtin = 'head:12'\n";
        let text = format!("{channel}visible = false\nname = 'first'\n{channel}{channel}");
        let scene = Scene::parse(&text, "test", Path::new(""), &[]).unwrap();
        let volume = scene.load_volume().unwrap();
        let mut channels = Channels::new(&scene, &volume);
        assert_eq!(channels.rows[0], ("first".to_owned(), false));
        channels.rows[2].1 = false;
        let all = Channels::transfer(&scene, &volume);
        let shown = channels.shown(&all);
        let opacities = |of: &TransferFunction| of.channels().map(|of| of.alpha(1e6, 0.0) > 0.0).collect::<Vec<_>>();
        assert_eq!((opacities(&all), opacities(&shown)), (vec![true; 3], vec![false, true, false]));
        let mut noted = scene.clone();
        channels.note(&mut noted);
        assert_eq!((noted.visible, noted.further[0].visible, noted.further[1].visible), (false, true, false));
    }
}
