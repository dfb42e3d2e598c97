//! The list of channels in the panel (SPEC §10): each with a box that shows or hides it, its colour, and its name, which gives the editor its transfer function.

use eframe::egui::{Color32, RichText, Ui};
use glam::DVec3;
use sheetsplat::appearance::categories;
use sheetsplat::scene::Scene;
use sheetsplat::settings::{Ramp, TransferFunction};
use sheetsplat::volume::{self, Volume};

/// A volume's channels as the panel shows them.
pub(super) struct Channels {
    rows: Vec<Row>,
    /// The number of the channel whose transfer function is edited.
    edited: usize,
}

struct Row {
    name: String,
    is_shown: bool,
    /// Whether one colour may stand for the channel: not for colours of voxels, nor for those of labels.
    has_color: bool,
}

/// What the user changed in the list, beside what is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Change {
    /// Another channel is edited.
    Edited,
    /// The edited channel has another colour.
    Color,
}

impl Channels {
    /// The channels of a volume as a scene shows them.
    pub(super) fn new(scene: &Scene, volume: &Volume) -> Self {
        // Without settings of its own a channel has the scene's.
        let of = |number: usize| if scene.channels.len() == 1 { 0 } else { number };
        let is_shown = |number| scene.channels.get(of(number)).is_none_or(|channel| channel.visible);
        let row = |(number, channel): (usize, &Volume)| Row {
            name: scene.channel_name(volume, number),
            is_shown: is_shown(number),
            has_color: channel.colors().is_none() && !categories::is_label_map(channel),
        };
        Self { rows: volume.channels().enumerate().map(row).collect(), edited: 0 }
    }

    /// The transfer functions of all channels, hidden ones too.
    pub(super) fn transfer(scene: &Scene, volume: &Volume) -> volume::Channels<TransferFunction> {
        let mut all = scene.clone();
        all.channels.iter_mut().for_each(|channel| channel.visible = true);
        all.resolve(volume)
    }

    /// Whether there is more than one.
    pub(super) fn are_several(&self) -> bool {
        self.rows.len() > 1
    }

    /// The number of the channel whose transfer function is edited.
    pub(super) fn edited(&self) -> usize {
        self.edited
    }

    /// The name of that channel.
    pub(super) fn edited_name(&self) -> &str {
        self.rows.get(self.edited).map_or("", |row| &row.name)
    }

    /// The transfer function of that channel.
    pub(super) fn edited_of<'a>(&self, transfer: &'a mut [TransferFunction]) -> &'a mut TransferFunction {
        &mut transfer[self.edited]
    }

    /// The list.
    pub(super) fn show(&mut self, ui: &mut Ui, transfer: &mut [TransferFunction]) -> Option<Change> {
        let Self { rows, edited } = self;
        let mut change = None;
        for ((number, row), of) in rows.iter_mut().enumerate().zip(transfer) {
            let color = of.color.points().last().map(|(_, color)| *color).unwrap_or_default();
            let mut srgb = (color * 255.0).to_array().map(|channel| channel.round() as u8);
            let [red, green, blue] = srgb;
            ui.horizontal(|ui| {
                ui.checkbox(&mut row.is_shown, "");
                if row.has_color && ui.color_edit_button_srgb(&mut srgb).changed() {
                    recolor(of, DVec3::from_array(srgb.map(f64::from)) / 255.0);
                    change = change.or((*edited == number).then_some(Change::Color));
                }
                let name = RichText::new(&row.name).color(Color32::from_rgb(red, green, blue));
                if ui.selectable_label(*edited == number, name).clicked() && *edited != number {
                    *edited = number;
                    change = Some(Change::Edited);
                }
            });
        }
        change
    }

    /// Transfer functions without those of hidden channels.
    pub(super) fn shown(&self, transfer: &volume::Channels<TransferFunction>) -> volume::Channels<TransferFunction> {
        let mut shown = transfer.clone();
        let Ok(nothing) = Ramp::new(vec![(0.0, 0.0)]) else { return shown };
        for (_, of) in self.rows.iter().zip(&mut shown).filter(|(row, _)| !row.is_shown) {
            of.opacity = nothing.clone();
            of.labels.clear();
        }
        shown
    }

    /// Notes in a scene that states every channel which are shown, and their transfer functions.
    pub(super) fn note(&self, scene: &mut Scene, transfer: &[TransferFunction]) {
        for ((channel, row), of) in scene.channels.iter_mut().zip(&self.rows).zip(transfer) {
            (channel.visible, channel.transfer) = (row.is_shown, of.clone().into());
        }
    }
}

/// Gives all values of a channel one colour.
fn recolor(transfer: &mut TransferFunction, color: DVec3) {
    let at = transfer.color.points().first().map_or(0.0, |point| point.0);
    if let Ok(ramp) = Ramp::new(vec![(at, color)]) {
        transfer.color = ramp;
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use std::path::Path;

    use eframe::egui::{Context, Event, Modifiers, PointerButton, Pos2, RawInput, Rect, pos2, vec2};

    use super::*;

    /// Three channels, of which the first is hidden.
    fn three() -> (Scene, Volume) {
        let channel = "[[channel]]\nvolume.builtin = 'head:12'\n";
        let text = format!("{channel}visible = false\nname = 'first'\n{channel}{channel}");
        let scene = Scene::parse(&text, "test", Path::new(""), &[]).unwrap();
        let volume = scene.load_volume().unwrap();
        (scene, volume)
    }

    #[test]
    fn hidden_channels_have_no_opacity_and_come_back() {
        let (scene, volume) = three();
        let mut channels = Channels::new(&scene, &volume);
        assert_eq!((channels.rows[0].name.as_str(), channels.rows[0].is_shown), ("first", false));
        channels.rows[2].is_shown = false;
        let all = Channels::transfer(&scene, &volume);
        let shown = channels.shown(&all);
        let opacities = |of: &[TransferFunction]| of.iter().map(|of| of.alpha(1e6, 0.0) > 0.0).collect::<Vec<_>>();
        assert_eq!((opacities(&all), opacities(&shown)), (vec![true; 3], vec![false, true, false]));
        let mut noted = scene.explicit(&volume);
        channels.note(&mut noted, &all);
        assert_eq!(noted.channels[2].transfer.opacity.as_ref(), Some(&all[2].opacity));
        assert_eq!(noted.channels.map(|channel| channel.visible)[..], [false, true, false]);
    }

    #[test]
    fn a_click_on_a_name_edits_that_channel() {
        let (scene, volume) = three();
        let mut channels = Channels::new(&scene, &volume);
        let mut transfer = Channels::transfer(&scene, &volume);
        let before = transfer.clone();
        let context = Context::default();
        let mut changes = Vec::new();
        let mut show = |events: Vec<Event>| {
            let screen_rect = Some(Rect::from_min_size(Pos2::ZERO, vec2(300.0, 200.0)));
            let input = RawInput { screen_rect, events, ..RawInput::default() };
            let mut output = context.run_ui(input, |ui| changes.extend(channels.show(ui, &mut transfer)));
            // Nothing paints the text.
            output.textures_delta.clear();
        };
        show(Vec::new());
        // Names stand to the right of boxes and colours, one below the other.
        for y in (2..150).step_by(6) {
            let pos = pos2(90.0, y as f32);
            let button = |pressed| {
                let (button, modifiers) = (PointerButton::Primary, Modifiers::NONE);
                Event::PointerButton { pos, button, pressed, modifiers }
            };
            show(vec![Event::PointerMoved(pos), button(true)]);
            show(vec![button(false)]);
        }
        // The first one is edited already; each of the others once.
        assert_eq!((changes, channels.edited), (vec![Change::Edited; 2], 2));
        assert_eq!(channels.edited_name(), "channel 2");
        assert!(transfer == before, "nothing else changes");
        channels.edited_of(&mut transfer).iso_ranges = Some(vec![[1.0, 2.0]]);
        assert!(transfer[2].iso_ranges.is_some() && transfer[..2] == before[..2]);
    }

    #[test]
    fn a_channel_takes_one_colour() {
        let (scene, volume) = three();
        let mut transfer = Channels::transfer(&scene, &volume);
        let before = transfer.clone();
        recolor(&mut transfer[1], DVec3::X);
        assert!([-5.0, 0.0, 300.0].iter().all(|&value| transfer[1].color.at(value) == DVec3::X));
        assert_eq!(transfer[1].opacity, before[1].opacity);
        assert!(transfer[0].color == before[0].color && transfer[2] == before[2]);
    }
}
