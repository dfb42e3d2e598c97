//! Label maps: volumes whose values are labels, not amounts. Every label has its own colour, and 0 is hidden.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use glam::DVec3;

use super::quantile::histogram;
use crate::settings::transfer_function::{LabelTables, Ramp, TransferFunction};
use crate::volume::{Volume, are_sharp};

/// The opacity of every label except 0.
const OPACITY: f64 = 0.9;

/// The distinct labels, ascending.
pub fn distinct(labels: &[u16]) -> Vec<u16> {
    let mut present = vec![false; 1 << 16];
    for &label in labels {
        present[usize::from(label)] = true;
    }
    (0..=u16::MAX).filter(|&label| present[usize::from(label)]).collect()
}

/// The distinct values of a volume, ascending, if all of them except holes are labels: whole numbers from 0 to 65535.
pub fn values(volume: &Volume) -> Option<Vec<u16>> {
    counts(volume).map(|counts| counts.iter().map(|&(label, _)| label).collect())
}

/// The labels of [`values`], each with its number of voxels.
fn counts(volume: &Volume) -> Option<&[(u16, u64)]> {
    let values = volume.values();
    volume.label_facts().counts(|| {
        if !values.par_iter().all(|value| f32::from(value as u16) == value || value.is_nan()) {
            return None;
        }
        let counts = histogram(values, 1 << 16, |value| Some(usize::from(value as u16)));
        Some((0..=u16::MAX).zip(counts).filter(|&(_, count)| count > 0).collect())
    })
}

/// Whether a volume's values look like labels rather than amounts: at least three labels, in regions with sharp borders. Of the voxels
/// whose neighbours on an axis differ, at most a third have a value that differs from both; in images most do. Of the pairs of
/// neighbours that are not background, at least half are equal. A mask of two values does not count: it has a surface, like any object.
/// If the file names its labels, the volume is a label map in any case.
pub fn is_label_map(volume: &Volume) -> bool {
    if volume.colors().is_some() {
        return false;
    }
    let Some(counts) = counts(volume) else { return false };
    if volume.is_known_label_map() {
        return true;
    }
    if counts.len() < 3 {
        return false;
    }
    // The lowest of the most frequent values.
    let background = counts.iter().rev().max_by_key(|(_, count)| count).map_or(0.0, |&(label, _)| f32::from(label));
    volume.label_facts().has_sharp_borders(|| are_sharp(volume, background))
}

/// A label's colour (red, green and blue in [0, 1]), the same in every volume. Hues advance by the golden angle, so that neighbours in number are far
/// apart. Lightness goes round three steps; the order changes every 21 labels, when hues are nearly the same again. The constants were searched for:
/// they keep the first 16 labels apart by at least 20.2 in CIEDE2000.
pub fn color(label: u16) -> DVec3 {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    const LIGHTNESS: [f64; 3] = [0.644, 0.837, 0.469];
    let hue = TAU * (0.437 + f64::from(label) * GOLDEN).fract();
    // Three digits suffice and are easier to read in a scene file.
    (oklch(LIGHTNESS[usize::from((label % 3 + label / 21 % 3) % 3)], 0.274, hue) * 1e3).round() / 1e3
}

/// A label map's transfer function, by the colours that its file states, in ascending order of values, or else [`color()`]. Each colour is at its label's
/// number, so no voxel has a colour in between.
pub fn transfer(labels: &[u16], palette: &[(f64, DVec3)]) -> TransferFunction {
    transfer_by(labels, palette, color)
}

/// [`transfer`] for the labels of a volume, by their numbers in its file.
pub(crate) fn transfer_of(volume: &Volume, labels: &[u16], palette: &[(f64, DVec3)]) -> TransferFunction {
    transfer_by(labels, palette, |label| color_of(volume, label))
}

fn transfer_by(labels: &[u16], palette: &[(f64, DVec3)], color: impl Fn(u16) -> DVec3) -> TransferFunction {
    let of = |label: u16| (f64::from(label), stated_color(palette, label).unwrap_or_else(|| color(label)));
    let shown: Vec<_> = labels.iter().filter(|&&label| label > 0).map(|&label| of(label)).collect();
    let shown = if shown.is_empty() { vec![(0.0, DVec3::ONE)] } else { shown };
    TransferFunction::by_value(Ramp::through(shown), Ramp::through(vec![(0.0, 0.0), (1.0, OPACITY)]))
}

/// The colour that a file states for a label, given its colours in ascending order of values.
fn stated_color(palette: &[(f64, DVec3)], label: u16) -> Option<DVec3> {
    let at = palette.binary_search_by(|(value, _)| value.total_cmp(&label.into())).ok()?;
    Some(palette[at].1)
}

/// Tables with the same colours for the labels of a segmented volume, whose opacities depend on its values. Label 0 is hidden.
pub fn tables(labels: &[u16]) -> BTreeMap<u16, LabelTables> {
    tables_by(labels, color)
}

/// [`tables`] for the labels of a volume, with the colours that their file states, or else by their numbers in it.
pub(crate) fn tables_of(volume: &Volume, labels: &[u16]) -> BTreeMap<u16, LabelTables> {
    let stated = volume.label_colors();
    tables_by(labels, |label| stated_color(stated, label).unwrap_or_else(|| color_of(volume, label)))
}

fn tables_by(labels: &[u16], color: impl Fn(u16) -> DVec3) -> BTreeMap<u16, LabelTables> {
    let table = |label: u16| {
        let color = Some(Ramp::through(vec![(0.0, color(label))]));
        LabelTables { visible: label > 0, color, ..LabelTables::default() }
    };
    let mut tables = BTreeMap::new();
    for label in distinct(labels) {
        tables.insert(label, table(label));
    }
    tables
}

/// A label's colour by its number in the file, the same in every volume. Numbers beyond 16 bits share colours with others.
fn color_of(volume: &Volume, label: u16) -> DVec3 {
    /// The largest prime of 16 bits, so that numbers in regular steps have different colours.
    const PRIME: u64 = 65_521;
    match volume.label_id(label) {
        id if id > u64::from(u16::MAX) => color((id % PRIME) as u16),
        id => color(id as u16),
    }
}

/// The sRGB colour for lightness, chroma and hue in Ottosson's Oklab, with less chroma if it is outside the gamut.
fn oklch(lightness: f64, chroma: f64, hue: f64) -> DVec3 {
    let rgb = |chroma: f64| {
        let (a, b) = (chroma * libm::cos(hue), chroma * libm::sin(hue));
        let l = (lightness + 0.396_337_777_4 * a + 0.215_803_757_3 * b).powi(3);
        let m = (lightness - 0.105_561_345_8 * a - 0.063_854_172_8 * b).powi(3);
        let s = (lightness - 0.089_484_177_5 * a - 1.291_485_548_0 * b).powi(3);
        DVec3::new(
            4.076_741_662_1 * l - 3.307_711_591_3 * m + 0.230_969_929_2 * s,
            -1.268_438_004_6 * l + 2.609_757_401_1 * m - 0.341_319_396_5 * s,
            -0.004_196_086_3 * l - 0.703_418_614_7 * m + 1.707_614_701_0 * s,
        )
    };
    let is_in_gamut = |rgb: &DVec3| rgb.min_element() >= 0.0 && rgb.max_element() <= 1.0;
    let chromas = (0..=20).map(|step| chroma * (1.0 - f64::from(step) / 20.0));
    let linear = chromas.map(rgb).find(is_in_gamut).unwrap_or(DVec3::splat(lightness.powi(3)));
    let encoded = |c: f64| if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * libm::pow(c, 1.0 / 2.4) - 0.055 };
    DVec3::from(linear.to_array().map(encoded))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// CIE L*a*b* of an sRGB colour, white D65.
    fn lab(color: DVec3) -> DVec3 {
        let linear = |c: f64| if c <= 0.040_45 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) };
        let [r, g, b] = color.to_array().map(linear);
        let f = |t: f64| if t > 216.0 / 24_389.0 { t.cbrt() } else { (24_389.0 / 27.0 * t + 16.0) / 116.0 };
        let x = f((0.412_456_4 * r + 0.357_576_1 * g + 0.180_437_5 * b) / 0.950_47);
        let y = f(0.212_672_9 * r + 0.715_152_2 * g + 0.072_175 * b);
        let z = f((0.019_333_9 * r + 0.119_192 * g + 0.950_304_1 * b) / 1.088_83);
        DVec3::new(116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z))
    }

    /// In CIE L*a*b*, where they are farther apart than in CIEDE2000.
    #[test]
    fn the_first_labels_are_told_apart() {
        let colors: Vec<DVec3> = (0..=16).map(|label| lab(color(label))).collect();
        for (at, one) in colors.iter().enumerate() {
            for other in &colors[..at] {
                assert!(one.distance(*other) >= 20.0, "{at}: {one} {other}");
            }
        }
    }

    /// The hue of the next label is more than a quarter of a circle away.
    #[test]
    fn neighbours_differ_in_hue() {
        let hue = |label: u16| {
            let lab = lab(color(label));
            lab.z.atan2(lab.y)
        };
        for label in 1..500 {
            let apart = (hue(label) - hue(label - 1)).rem_euclid(TAU);
            assert!(apart.min(TAU - apart) > TAU / 5.0, "{label}: {apart}");
        }
    }

    #[test]
    fn colours_that_the_file_states_come_first() {
        let purple = DVec3::new(0.5, 0.0, 0.5);
        let transfer = transfer(&[0, 1, 2], &[(0.0, DVec3::ONE), (2.0, purple)]);
        let points: Vec<(f64, DVec3)> = transfer.color.points().to_vec();
        assert_eq!(points, [(1.0, color(1)), (2.0, purple)]);
    }
}
