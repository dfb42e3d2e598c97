//! The colour bar, which shows the colour of each value, and of several channels the colour bars.

use glam::DVec3;
use sheetsplat::appearance::{categories, shown_range};
use sheetsplat::image::Image;
use sheetsplat::scene::Scene;
use sheetsplat::settings::Compositing;
use sheetsplat::settings::TransferFunction;
use sheetsplat::volume::Volume;

use super::legend::shortened;
use super::plate::{PADDING, plate_for};
use super::round::ticks;
use crate::canvas::{LINE, filled, lay, rule, text_width, write};
use crate::failure::Failure;

/// The width of the bar in pixels; its maximum height follows, half of the image's where that allows.
const WIDTH: u32 = 16;
const HEIGHTS: [u32; 2] = [64, 320];

/// The length of a tick in pixels, and its distance from the number.
const TICK: u32 = 4;
const GAP: u32 = 4;

/// The gap between two channels' bars in pixels.
const BAR_GAP: u32 = 10;

/// The bar with the colours of visible values before shading; in projections scaled by their opacities. Of several channels, each that shows something
/// has its own, below its name, except volumes of colours and label maps.
pub(super) fn plate(scene: &Scene, volume: &Volume, transfer: &TransferFunction) -> Result<Image, Failure> {
    let refused = |found: &str, allowed: &str| {
        Err(Failure::Input(format!("--annotate: colors: found {found}, allowed: {allowed}")))
    };
    // Where a pixel shows a single value, its opacity acts as brightness.
    let is_projection = match scene.splatting.compositing {
        Compositing::Maximum | Compositing::Minimum => true,
        Compositing::Xray | Compositing::Average => {
            let found = "splatting.compositing = \"xray\" or \"average\", which add colours up";
            return refused(found, "any other compositing");
        }
        _ => false,
    };
    let are_several = !volume.further().is_empty();
    let height = (scene.image.height / 2).clamp(HEIGHTS[0], HEIGHTS[1]);
    let mut bars = Vec::new();
    for (number, (channel, transfer)) in volume.channels().zip(transfer.channels()).enumerate() {
        let are_colors = channel.colors().is_some();
        let are_labels = channel.labels().is_none() && categories::is_label_map(channel);
        match are_several {
            false if are_colors => return refused("a volume of colours", "values that a table gives colours"),
            false if are_labels => {
                return refused("a volume of labels", "values that are not labels, or --annotate legend");
            }
            true if are_colors || are_labels => continue,
            _ => {}
        }
        let name = are_several.then(|| shortened(&scene.channel_name(volume, number)));
        bars.extend(Bar::new(name, channel, transfer, height));
    }
    if bars.is_empty() {
        return refused("no voxel with an opacity above 0", "visible voxels");
    }
    let names = if are_several { LINE } else { 0 };
    let width: u32 = bars.iter().map(Bar::width).sum::<u32>() + BAR_GAP * (bars.len() as u32 - 1);
    let mut plate = plate_for([width, names + height + LINE]);
    let [r, g, b, a] = scene.image.background;
    let behind = DVec3::new(r, g, b) * a;
    let mut left = PADDING;
    for bar in &bars {
        if let Some(name) = &bar.name {
            write(&mut plate, [left, PADDING], name);
        }
        bar.draw(&mut plate, [left, PADDING + names + LINE / 2], height, is_projection.then_some(behind));
        left += bar.width() + BAR_GAP;
    }
    Ok(plate)
}

/// A channel's bar.
struct Bar<'a> {
    name: Option<String>,
    range: [f64; 2],
    /// Values and the text beside them.
    ticks: Vec<(f64, String)>,
    transfer: &'a TransferFunction,
}

impl<'a> Bar<'a> {
    /// `None` if the channel shows nothing.
    fn new(name: Option<String>, volume: &Volume, transfer: &'a TransferFunction, height: u32) -> Option<Self> {
        let [lo, hi] = shown_range(volume, transfer)?;
        // Half a line is left between numbers.
        let apart = (hi - lo) / f64::from(height) * f64::from(LINE + LINE / 2);
        Some(Self { name, range: [lo, hi], ticks: ticks([lo, hi], apart), transfer })
    }

    fn width(&self) -> u32 {
        let text = self.ticks.iter().map(|(_, label)| text_width(label)).max().unwrap_or(0);
        let name = self.name.as_deref().map_or(0, text_width);
        (WIDTH + TICK + GAP + text).max(name)
    }

    /// Draws the bar with its corner at a place. `behind` is what lies behind the colours where opacity acts as brightness.
    fn draw(&self, plate: &mut Image, [left, top]: [u32; 2], height: u32, behind: Option<DVec3>) {
        let [lo, hi] = self.range;
        // The value at the middle of a row of pixels, counted from the top.
        let value = |row: u32| hi - (hi - lo) * (f64::from(row) + 0.5) / f64::from(height);
        for row in 0..height {
            let color = self.transfer.color.at(value(row));
            let color = behind.map_or(color, |behind| behind.lerp(color, self.transfer.opacity.at(value(row))));
            lay(plate, [left, top + row], &filled([WIDTH, 1], color.as_vec3().extend(1.0).to_array()));
        }
        for (value, label) in &self.ticks {
            let share = if lo < hi { (hi - value) / (hi - lo) } else { 0.5 };
            let row = ((share * f64::from(height)) as u32).min(height - 1);
            rule(plate, [left + WIDTH, top + row], [TICK, 1]);
            write(plate, [left + WIDTH + TICK + GAP, top + row - LINE / 2], label);
        }
    }
}
