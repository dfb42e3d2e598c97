//! The legend, which shows the colour of each label or, of several channels, of each channel.

use super::canvas::{empty, filled, lay};
use super::kind::refused;
use super::style::Style;
use super::text;
use crate::SettingError;
use crate::appearance::{categories, shown_range};
use crate::image::Image;
use crate::scene::Scene;
use crate::settings::TransferFunction;
use crate::volume::Volume;

/// The size of the colour patch in a line, the gap after it, the gap between two columns, and the longest name, in heights of the font.
const PATCH: [f32; 2] = [1.2, 0.75];
const GAP: f32 = 0.4;
const COLUMN_GAP: f32 = 0.75;
const LONGEST: f32 = 14.0;

/// The number of colours in a patch.
const COLORS: u32 = 20;

/// A label's number and name, or a channel's name, and its colours from the lowest visible value to the highest.
struct Entry {
    text: String,
    colors: Vec<[f32; 4]>,
}

/// The legend in as many columns as needed for a height of at most `room` pixels.
pub(super) fn plate(
    scene: &Scene,
    volume: &Volume,
    transfer: &[TransferFunction],
    style: &Style,
    room: u32,
) -> Result<Image, SettingError> {
    let mut entries = match transfer {
        [transfer] => entries(volume, transfer)?,
        _ => channels(scene, volume, transfer)?,
    };
    for Entry { text, .. } in &mut entries {
        *text = text::fitted(text, style.em, style.pixels(LONGEST));
    }
    let line = style.line();
    let rows = (room / line).max(1).min(entries.len() as u32);
    let columns: Vec<&[Entry]> = entries.chunks(rows as usize).collect();
    let [patch, thick, gap] = [PATCH[0], PATCH[1], GAP].map(|ems| style.pixels(ems));
    let text_of = |column: &[Entry]| column.iter().map(|entry| style.width(&entry.text)).max().unwrap_or(0);
    let widths: Vec<u32> = columns.iter().map(|column| patch + gap + text_of(column)).collect();
    let column_gap = style.pixels(COLUMN_GAP);
    let gaps = column_gap.saturating_mul(columns.len() as u32 - 1);
    let width = widths.iter().fold(gaps, |sum, width| sum.saturating_add(*width));
    let mut plate = empty([width, rows * line]);
    let mut left = 0;
    for (column, width) in columns.iter().zip(widths) {
        for (entry, row) in column.iter().zip(0..) {
            let top = row * line;
            for x in 0..patch {
                let color = entry.colors[(x * COLORS / patch) as usize];
                lay(&mut plate, [left + x, top + (line - thick) / 2], &filled([1, thick], color));
            }
            style.write(&mut plate, [left + patch + gap, top], &entry.text);
        }
        left += width + column_gap;
    }
    Ok(plate)
}

/// The channels that show something, each with its colours over the values that it shows; in place of a label map, its labels.
fn channels(scene: &Scene, volume: &Volume, transfer: &[TransferFunction]) -> Result<Vec<Entry>, SettingError> {
    let entry = |(number, (channel, transfer)): (usize, (&Volume, &TransferFunction))| {
        let Some([low, high]) = shown_range(channel, transfer) else { return Vec::new() };
        if channel.labels().is_none() && categories::is_label_map(channel) {
            return labels(channel, transfer, &categories::values(channel).unwrap_or_default());
        }
        let value = |x: u32| low + (high - low) * f64::from(x) / f64::from(COLORS - 1);
        let color = |x: u32| transfer.color.at(value(x)).as_vec3().extend(1.0).to_array();
        let text = scene.channel_name(volume, number);
        vec![Entry { text, colors: (0..COLORS).map(color).collect() }]
    };
    let entries: Vec<Entry> = volume.channels().zip(transfer).enumerate().flat_map(entry).collect();
    if entries.is_empty() {
        return Err(refused("legend", "no channel with an opacity above 0", "visible channels"));
    }
    Ok(entries)
}

/// The labels of a label map that show.
fn labels(volume: &Volume, transfer: &TransferFunction, labels: &[u16]) -> Vec<Entry> {
    let shown = labels.iter().filter(|&&label| transfer.alpha(f64::from(label), f64::INFINITY) > 0.0);
    shown.map(|&label| entry(volume, transfer, label, [f64::from(label); 2])).collect()
}

/// A label with its colours over values.
fn entry(volume: &Volume, transfer: &TransferFunction, label: u16, values: [f64; 2]) -> Entry {
    let table = transfer.tables(Some(label));
    let place = |x: u32| f64::from(x) / f64::from(COLORS - 1);
    let colors = (0..COLORS).map(|x| table.color.at(values[0] * (1.0 - place(x)) + values[1] * place(x)));
    let name = volume.label_names().get(&label).map_or_else(String::new, |name| format!(" {name}"));
    Entry {
        text: format!("{}{name}", volume.label_id(label)),
        colors: colors.map(|rgb| rgb.as_vec3().extend(1.0).to_array()).collect(),
    }
}

fn entries(volume: &Volume, transfer: &TransferFunction) -> Result<Vec<Entry>, SettingError> {
    let entries: Vec<Entry> = match volume.labels() {
        Some(labels) => {
            let values = shown_range(volume, transfer).unwrap_or_default();
            let has_color =
                |label: &u16| transfer.labels.get(label).is_some_and(|tables| tables.visible && tables.color.is_some());
            let present = categories::distinct(labels);
            present.into_iter().filter(has_color).map(|label| entry(volume, transfer, label, values)).collect()
        }
        None => match categories::values(volume) {
            Some(values) => labels(volume, transfer, &values),
            None => {
                let allowed = "label maps, segmented volumes and several channels";
                return Err(refused("legend", "a volume without labels", allowed));
            }
        },
    };
    if entries.is_empty() {
        let allowed = "labels with colours, as with preset \"labels\"";
        return Err(refused("legend", "no label with a colour of its own", allowed));
    }
    Ok(entries)
}
