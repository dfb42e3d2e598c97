//! The legend, which shows the colour of each label or, of several channels, of each channel.

use sheetsplat::appearance::{categories, shown_range};
use sheetsplat::image::Image;
use sheetsplat::scene::Scene;
use sheetsplat::settings::TransferFunction;
use sheetsplat::volume::Volume;

use super::plate::{PADDING, plate_for};
use crate::canvas::{LINE, filled, lay, text_width, write};
use crate::failure::Failure;

/// The size of the colour patch in a line in pixels, and the gap after it.
const PATCH: [u32; 2] = [20, 12];
const GAP: u32 = 6;

/// The gap between two columns in pixels.
const COLUMN_GAP: u32 = 12;

/// The maximum number of characters of a label's name.
const LONGEST: usize = 40;

/// A label's number and name, or a channel's name, and its colours from the lowest visible value to the highest.
struct Entry {
    text: String,
    colors: Vec<[f32; 4]>,
}

/// The legend in as many columns as needed for a height of at most `room` pixels.
pub(super) fn plate(scene: &Scene, volume: &Volume, transfer: &TransferFunction, room: u32) -> Result<Image, Failure> {
    let entries =
        if volume.further().is_empty() { entries(volume, transfer)? } else { channels(scene, volume, transfer)? };
    let rows = (room.saturating_sub(2 * PADDING) / LINE).max(1).min(entries.len() as u32);
    let columns: Vec<&[Entry]> = entries.chunks(rows as usize).collect();
    let text_of = |column: &[Entry]| column.iter().map(|entry| text_width(&entry.text)).max().unwrap_or(0);
    let widths: Vec<u32> = columns.iter().map(|column| PATCH[0] + GAP + text_of(column)).collect();
    let gaps = COLUMN_GAP.saturating_mul(columns.len() as u32 - 1);
    let width = widths.iter().fold(gaps, |sum, width| sum.saturating_add(*width));
    let mut plate = plate_for([width, rows * LINE]);
    let mut left = PADDING;
    for (column, width) in columns.iter().zip(widths) {
        for (entry, row) in column.iter().zip(0..) {
            let top = PADDING + row * LINE;
            for (&color, x) in entry.colors.iter().zip(0..) {
                lay(&mut plate, [left + x, top + (LINE - PATCH[1]) / 2], &filled([1, PATCH[1]], color));
            }
            write(&mut plate, [left + PATCH[0] + GAP, top], &entry.text);
        }
        left += width + COLUMN_GAP;
    }
    Ok(plate)
}

/// The channels that show something, each with its colours over the values that it shows; in place of a label map, its labels.
fn channels(scene: &Scene, volume: &Volume, transfer: &TransferFunction) -> Result<Vec<Entry>, Failure> {
    let entry = |(number, (channel, transfer)): (usize, (&Volume, &TransferFunction))| {
        let Some([low, high]) = shown_range(channel, transfer) else { return Vec::new() };
        if channel.labels().is_none() && categories::is_label_map(channel) {
            return labels(channel, transfer, &categories::values(channel).unwrap_or_default());
        }
        let value = |x: u32| low + (high - low) * f64::from(x) / f64::from(PATCH[0] - 1);
        let color = |x: u32| transfer.color.at(value(x)).as_vec3().extend(1.0).to_array();
        let text = shortened(&scene.channel_name(volume, number));
        vec![Entry { text, colors: (0..PATCH[0]).map(color).collect() }]
    };
    let entries: Vec<Entry> = volume.channels().zip(transfer.channels()).enumerate().flat_map(entry).collect();
    if entries.is_empty() {
        return refused("no channel with an opacity above 0", "visible channels");
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
    let place = |x: u32| f64::from(x) / f64::from(PATCH[0] - 1);
    let colors = (0..PATCH[0]).map(|x| table.color.at(values[0] * (1.0 - place(x)) + values[1] * place(x)));
    let name = volume.label_names().get(&label).map_or_else(String::new, |name| format!(" {}", shortened(name)));
    Entry { text: format!("{label}{name}"), colors: colors.map(|rgb| rgb.as_vec3().extend(1.0).to_array()).collect() }
}

fn refused<T>(found: &str, allowed: &str) -> Result<T, Failure> {
    Err(Failure::Input(format!("--annotate: legend: found {found}, allowed: {allowed}")))
}

fn entries(volume: &Volume, transfer: &TransferFunction) -> Result<Vec<Entry>, Failure> {
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
                return refused("a volume without labels", "label maps, segmented volumes and several channels");
            }
        },
    };
    if entries.is_empty() {
        return refused("no label with a colour of its own", "labels with colours, as with --preset labels");
    }
    Ok(entries)
}

/// A name of bounded length.
pub(super) fn shortened(name: &str) -> String {
    match name.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}...", &name[..end]),
        None => name.to_owned(),
    }
}
