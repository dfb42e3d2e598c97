//! Colour maps.

use glam::DVec3;

use super::shown_range;
use crate::settings::transfer_function::{Ramp, TransferFunction};
use crate::volume::Volume;

/// A named sequence of colours to spread over a range of values, or the palette of the volume's own file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Colormap {
    /// Dark violet over green to yellow, in even steps of lightness.
    Viridis,
    /// Black over purple to pale yellow, in even steps of lightness.
    Magma,
    /// Black over red to pale yellow, in even steps of lightness.
    Inferno,
    /// Blue over pink to yellow, in even steps of lightness.
    Plasma,
    /// Black to white.
    Gray,
    /// Black over red and yellow to white.
    Hot,
    /// A rainbow with smooth lightness.
    Turbo,
    /// Blue over light grey to red.
    Coolwarm,
    /// The colours that the volume's file assigns to its values ([`Volume::palette`]).
    File,
}

// Fitted to matplotlib's maps of these names (CC0; turbo is Google's), with an error of at most 6 of 255 in every channel.
const VIRIDIS: &[u32] = &[
    0x440154, 0x481867, 0x472c79, 0x41408a, 0x3a5288, 0x32628a, 0x2b728b, 0x25818a, 0x219089, 0x1e9f85, 0x27ad7d,
    0x3dbc70, 0x5cc867, 0x81d348, 0xaadc36, 0xd5e216, 0xfde725,
];
const MAGMA: &[u32] = &[
    0x000004, 0x090721, 0x1e1248, 0x340f6b, 0x52117d, 0x681d7f, 0x812582, 0x9b2f7e, 0xb5367a, 0xce406f, 0xe65062,
    0xf4685a, 0xfb865f, 0xfda46f, 0xfdc286, 0xfcdfa0, 0xfcfdbf,
];
const INFERNO: &[u32] = &[
    0x000004, 0x080721, 0x1e0d48, 0x3a0868, 0x540f6b, 0x6d186d, 0x862167, 0xa02a60, 0xb83652, 0xce4448, 0xe1582f,
    0xef7021, 0xfc8c07, 0xf9ac0c, 0xfcc92f, 0xefe962, 0xfcffa4,
];
const PLASMA: &[u32] = &[
    0x0d0887, 0x330493, 0x4a029f, 0x6800ab, 0x7c02a5, 0x93109f, 0xa72492, 0xb93483, 0xc94875, 0xd75866, 0xe46b59,
    0xee7f4b, 0xf6943d, 0xfbaa37, 0xfdc324, 0xf7dd28, 0xf0f921,
];
const GRAY: &[u32] = &[0x000000, 0xffffff];
const HOT: &[u32] = &[
    0x0b0000, 0x300000, 0x5a0000, 0x830000, 0xad0000, 0xe10000, 0xff0400, 0xff3400, 0xff5700, 0xff8700, 0xffab00,
    0xffd500, 0xffff02, 0xffff45, 0xffff80, 0xffffbe, 0xffffff,
];
const TURBO: &[u32] = &[
    0x30123b, 0x3d3fa5, 0x466be7, 0x4292ff, 0x26bbee, 0x14ddc2, 0x2ef297, 0x6efe60, 0xa1fe38, 0xc9ee30, 0xeed038,
    0xfcae34, 0xfb801e, 0xea510b, 0xd13001, 0xaa1600, 0x7a0403,
];
const COOLWARM: &[u32] = &[
    0x3b4cc0, 0x4d63d8, 0x617dea, 0x7796f7, 0x8dabfe, 0xa3beff, 0xb8cbf9, 0xcbd5ee, 0xddd8dd, 0xeccfc5, 0xf5c0ad,
    0xf8ad93, 0xf5957a, 0xec8463, 0xde5c4c, 0xcb4238, 0xb40426,
];

impl Colormap {
    /// All colour maps with their names in scene files.
    pub const ALL: [(&'static str, Self); 9] = [
        ("viridis", Self::Viridis),
        ("magma", Self::Magma),
        ("inferno", Self::Inferno),
        ("plasma", Self::Plasma),
        ("gray", Self::Gray),
        ("hot", Self::Hot),
        ("turbo", Self::Turbo),
        ("coolwarm", Self::Coolwarm),
        ("file", Self::File),
    ];

    /// Evenly spaced colours, `0xrrggbb`; `None` for the file's palette.
    fn colors(self) -> Option<&'static [u32]> {
        Some(match self {
            Self::Viridis => VIRIDIS,
            Self::Magma => MAGMA,
            Self::Inferno => INFERNO,
            Self::Plasma => PLASMA,
            Self::Gray => GRAY,
            Self::Hot => HOT,
            Self::Turbo => TURBO,
            Self::Coolwarm => COOLWARM,
            Self::File => return None,
        })
    }

    /// The map's colours, evenly spaced from the least to the greatest value, each component in [0, 1]; `None` for the file's palette.
    pub fn rgb(self) -> Option<Vec<DVec3>> {
        self.colors().map(|colors| colors.iter().copied().map(rgb).collect())
    }

    /// The map for a volume, over the values that it shows ([`shown_range`]), or the palette of its file; `None` if that has no palette.
    pub fn of(self, volume: &Volume, transfer: &TransferFunction) -> Option<Ramp<DVec3>> {
        match self.colors() {
            Some(colors) => Some(over(colors, shown_range(volume, transfer).unwrap_or_default())),
            None => volume.palette().map(|palette| Ramp::through(palette.to_vec())),
        }
    }
}

/// A colour `0xrrggbb`.
fn rgb(color: u32) -> DVec3 {
    DVec3::from([16, 8, 0].map(|shift| f64::from(color >> shift & 0xff) / 255.0))
}

/// Evenly spaced colours over values from `lo` to `hi`; the last colour if these are equal.
fn over(colors: &[u32], [lo, hi]: [f64; 2]) -> Ramp<DVec3> {
    let last = (colors.len() - 1) as f64;
    // Halves are used because the range may exceed the largest f64.
    let place = |at: usize| 2.0 * (lo / 2.0 + (hi / 2.0 - lo / 2.0) * (at as f64 / last));
    let mut points: Vec<_> = colors.iter().enumerate().map(|(at, &color)| (place(at), rgb(color))).collect();
    // Values are f32, so only equal ends coincide.
    points.dedup_by(|later, earlier| {
        let is_same = later.0 <= earlier.0;
        if is_same {
            earlier.1 = later.1;
        }
        is_same
    });
    Ramp::through(points)
}
