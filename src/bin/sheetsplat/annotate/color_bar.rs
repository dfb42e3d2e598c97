//! The colour bar, which shows the colour of each value.

use glam::DVec3;
use sheetsplat::appearance::{categories, shown_range};
use sheetsplat::image::Image;
use sheetsplat::scene::Scene;
use sheetsplat::settings::Compositing;
use sheetsplat::settings::TransferFunction;
use sheetsplat::volume::Volume;

use super::round::ticks;
use super::{PADDING, plate_for};
use crate::canvas::{LINE, filled, lay, rule, text_width, write};
use crate::failure::Failure;

/// The width of the bar in pixels; its maximum height follows, half of the image's where that allows.
const WIDTH: u32 = 16;
const HEIGHTS: [u32; 2] = [64, 320];

/// The length of a tick in pixels, and its distance from the number.
const TICK: u32 = 4;
const GAP: u32 = 4;

/// The bar with the colours of visible values before shading; in projections scaled by their opacities.
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
    if volume.colors().is_some() {
        return refused("a volume of colours", "values that a table gives colours");
    }
    if volume.labels().is_none() && categories::is_label_map(volume) {
        return refused("a volume of labels", "values that are not labels, or --annotate legend");
    }
    let Some([lo, hi]) = shown_range(volume, transfer) else {
        return refused("no voxel with an opacity above 0", "visible voxels");
    };
    let height = (scene.image.height / 2).clamp(HEIGHTS[0], HEIGHTS[1]);
    // Half a line is left between numbers.
    let apart = (hi - lo) / f64::from(height) * f64::from(LINE + LINE / 2);
    let ticks = ticks([lo, hi], apart);
    let text = ticks.iter().map(|(_, label)| text_width(label)).max().unwrap_or(0);

    let top = PADDING + LINE / 2;
    let mut plate = plate_for([WIDTH + TICK + GAP + text, height + LINE]);
    // The value at the middle of a row of pixels, counted from the top.
    let value = |row: u32| hi - (hi - lo) * (f64::from(row) + 0.5) / f64::from(height);
    for row in 0..height {
        let share = if is_projection { transfer.opacity.at(value(row)) } else { 1.0 };
        let [r, g, b, a] = scene.image.background;
        let behind = DVec3::new(r, g, b) * a;
        let color = behind.lerp(transfer.color.at(value(row)), share).as_vec3().extend(1.0);
        lay(&mut plate, [PADDING, top + row], &filled([WIDTH, 1], color.to_array()));
    }
    for (value, label) in &ticks {
        let share = if lo < hi { (hi - value) / (hi - lo) } else { 0.5 };
        let row = ((share * f64::from(height)) as u32).min(height - 1);
        rule(&mut plate, [PADDING + WIDTH, top + row], [TICK, 1]);
        write(&mut plate, [PADDING + WIDTH + TICK + GAP, top + row - LINE / 2], label);
    }
    Ok(plate)
}
