//! The palette of an image whose pixels are indices (`PALETTE COLOR`).

use glam::DVec3;

use super::super::VolumeError;
use super::dataset::{Dataset, Tag, tags};

/// The maximum number of colours.
const MAX_COLORS: usize = 2048;

/// For red, green and blue: what the table holds, and the table.
const TABLES: [[Tag; 2]; 3] = [
    [tags::RED_DESCRIPTOR, tags::RED_TABLE],
    [tags::GREEN_DESCRIPTOR, tags::GREEN_TABLE],
    [tags::BLUE_DESCRIPTOR, tags::BLUE_TABLE],
];

/// The colours of indices, in ascending order.
pub(super) type Palette = Vec<(f64, DVec3)>;

/// Reads an image's palette.
pub(super) fn read(data: &Dataset, is_signed: bool) -> Result<Palette, VolumeError> {
    let mut palette = Palette::new();
    for (component, [descriptor, table]) in TABLES.into_iter().enumerate() {
        let allowed = format!("at most {MAX_COLORS} colours, the first index, and 8 or 16 bits, as for red");
        let stated = data.shorts(descriptor).ok_or_else(|| data.missing(descriptor, &allowed))?;
        let &[count, first, bits @ (8 | 16)] = stated.as_slice() else {
            return Err(data.invalid(descriptor, format!("{stated:?}"), allowed));
        };
        let count = usize::from(count);
        if !(1..=MAX_COLORS).contains(&count) || component > 0 && count != palette.len() {
            return Err(data.invalid(descriptor, format!("{stated:?}"), allowed));
        }
        let allowed = format!("{count} numbers of {bits} bits");
        let words = data.shorts(table).ok_or_else(|| data.missing(table, &allowed))?;
        // Numbers of 8 bits lie two by two in words, the first in the low byte, or each in a word of its own.
        let numbers: Vec<u16> = match (bits, words.len()) {
            (_, length) if length == count => words,
            (8, length) if length == count.div_ceil(2) => {
                words.iter().flat_map(|word| [word & 0xff, word >> 8]).take(count).collect()
            }
            _ => return Err(data.invalid(table, format!("{} bytes", 2 * words.len()), allowed)),
        };
        // Some programs state 16 bits and write numbers of 8.
        let full = if bits == 8 || numbers.iter().all(|&number| number < 256) { 255.0 } else { 65535.0 };
        if component == 0 {
            let first = if is_signed { f64::from(first.cast_signed()) } else { f64::from(first) };
            palette.extend((0..count).map(|at| (first + at as f64, DVec3::ZERO)));
        }
        for ((_, color), number) in palette.iter_mut().zip(numbers) {
            color[component] = (f64::from(number) / full).min(1.0);
        }
    }
    Ok(palette)
}
