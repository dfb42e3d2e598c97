//! The colour bar, which shows the colour of each value, and of several channels the colour bars.

use glam::DVec3;

use super::canvas::{empty, filled, lay, turned};
use super::kind::refused;
use super::round::ticks;
use super::style::Style;
use super::text;
use crate::SettingError;
use crate::appearance::{categories, shown_range};
use crate::image::Image;
use crate::scene::Scene;
use crate::settings::TransferFunction;
use crate::volume::Volume;

/// The width of a bar, the length of a tick, the distance between a tick and its number, and between two channels' bars, in heights of the font.
const WIDTH: f32 = 1.0;
const TICK: f32 = 0.3;
const GAP: f32 = 0.3;
const BAR_GAP: f32 = 0.8;

/// The share of the room's height that a bar takes.
const SHARE: f64 = 0.6;

/// The bar with the colours of visible values before shading; in projections scaled by their opacities. With several channels, each that shows something
/// has its own, with its name, except volumes of colours and label maps. `room` is the greatest height in pixels.
pub(super) fn plate(
    scene: &Scene,
    volume: &Volume,
    transfer: &[TransferFunction],
    style: &Style,
    room: u32,
) -> Result<Image, SettingError> {
    // Where a pixel shows a single value, its opacity acts as brightness.
    let is_projection = scene.splatting.compositing.is_extreme();
    if scene.splatting.compositing.is_sum() {
        let found = "splatting.compositing = \"xray\" or \"average\", which add colours up";
        return Err(refused("colors", found, "any other compositing"));
    }
    let are_several = volume.channel_count() > 1;
    let height = ((f64::from(room) * SHARE) as u32).max(1);
    let mut bars = Vec::new();
    for (number, (channel, transfer)) in volume.channels().zip(transfer).enumerate() {
        let are_colors = channel.colors().is_some();
        let are_labels = channel.labels().is_none() && categories::is_label_map(channel);
        match are_several {
            false if are_colors => {
                return Err(refused("colors", "a volume of colours", "values that a table gives colours"));
            }
            false if are_labels => {
                let allowed = "values that are not labels, or --annotate legend";
                return Err(refused("colors", "a volume of labels", allowed));
            }
            true if are_colors || are_labels => continue,
            _ => {}
        }
        bars.extend(Bar::new(title(scene, volume, number), channel, transfer, style, height));
    }
    if bars.is_empty() {
        return Err(refused("colors", "no voxel with an opacity above 0", "visible voxels"));
    }
    let gap = style.pixels(BAR_GAP);
    let width: u32 = bars.iter().map(|bar| bar.width(style)).sum::<u32>() + gap * (bars.len() as u32 - 1);
    // Numbers at the ends reach half a line beyond the bar.
    let mut plate = empty([width, height + style.line()]);
    let [r, g, b, a] = scene.image.background;
    let behind = DVec3::new(r, g, b) * a;
    let mut left = 0;
    for bar in &bars {
        bar.draw(&mut plate, [left, style.line() / 2], style, is_projection.then_some(behind));
        left += bar.width(style) + gap;
    }
    Ok(plate)
}

/// A channel's name, and the unit of its values in parentheses, as far as they are known; of several channels always a name.
fn title(scene: &Scene, volume: &Volume, number: usize) -> Option<String> {
    let channel = volume.channel(number)?;
    let stated = scene.channels.get(number).and_then(|channel| channel.name.clone());
    let name = stated.or_else(|| channel.channel_name().map(str::to_owned));
    let name = name.or_else(|| (volume.channel_count() > 1).then(|| scene.channel_name(volume, number)));
    match (name, channel.value_unit()) {
        (Some(name), Some(unit)) => Some(format!("{name} ({unit})")),
        (None, Some(unit)) => Some(unit.to_owned()),
        (name, None) => name,
    }
}

/// A channel's bar.
struct Bar<'a> {
    /// The title, which runs upwards beside the numbers.
    title: Option<Image>,
    range: [f64; 2],
    /// Values and the text beside them.
    ticks: Vec<(f64, String)>,
    transfer: &'a TransferFunction,
    height: u32,
}

impl<'a> Bar<'a> {
    /// `None` if the channel shows nothing.
    fn new(
        title: Option<String>,
        volume: &Volume,
        transfer: &'a TransferFunction,
        style: &Style,
        height: u32,
    ) -> Option<Self> {
        let [lo, hi] = shown_range(volume, transfer)?;
        // Half a line is left between numbers.
        let apart = (hi - lo) / f64::from(height) * f64::from(style.line() + style.line() / 2);
        let title = title.map(|title| text::fitted(&title, style.em, height + style.line()));
        let title = title.map(|title| turned(&style.words(&title)));
        Some(Self { title, range: [lo, hi], ticks: ticks([lo, hi], apart), transfer, height })
    }

    /// The width up to the numbers' end.
    fn before_title(&self, style: &Style) -> u32 {
        let numbers = self.ticks.iter().map(|(_, label)| style.width(label)).max().unwrap_or(0);
        style.pixels(WIDTH) + style.pixels(TICK) + style.pixels(GAP) + numbers
    }

    fn width(&self, style: &Style) -> u32 {
        let title = self.title.as_ref().map_or(0, |title| style.pixels(GAP) + title.width);
        self.before_title(style) + title
    }

    /// Draws the bar with its corner at a place. `behind` is what lies behind the colours where opacity acts as brightness.
    fn draw(&self, plate: &mut Image, [left, top]: [u32; 2], style: &Style, behind: Option<DVec3>) {
        let ([lo, hi], height) = (self.range, self.height);
        let [width, stroke] = [style.pixels(WIDTH), style.stroke()];
        // A frame, so that the bar's end shows on a background of its colour.
        style.rule(plate, [left, top.saturating_sub(stroke)], [width, height + 2 * stroke]);
        // The value at the middle of a row of pixels, counted from the top.
        let value = |row: u32| hi - (hi - lo) * (f64::from(row) + 0.5) / f64::from(height);
        for row in 0..height {
            let color = self.transfer.color.at(value(row));
            let color = behind.map_or(color, |behind| behind.lerp(color, self.transfer.opacity.at(value(row))));
            let inner = width.saturating_sub(2 * stroke).max(1);
            let strip = filled([inner, 1], color.as_vec3().extend(1.0).to_array());
            lay(plate, [left + stroke, top + row], &strip);
        }
        let [tick, gap] = [style.pixels(TICK), style.pixels(GAP)];
        for (value, label) in &self.ticks {
            let share = if lo < hi { (hi - value) / (hi - lo) } else { 0.5 };
            let row = top + ((share * f64::from(height)) as u32).min(height - 1);
            style.rule(plate, [left + width, row.saturating_sub(stroke / 2)], [tick, stroke]);
            style.write(plate, [left + width + tick + gap, row.saturating_sub(style.line() / 2)], label);
        }
        if let Some(title) = &self.title {
            let above = (plate.height - title.height.min(plate.height)) / 2;
            lay(plate, [left + self.before_title(style) + gap, above], title);
        }
    }
}
