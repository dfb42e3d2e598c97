//! Appearance chosen for a volume: the default, presets, colour maps, and the colours of labels.

pub mod categories;
pub(crate) mod channel_display;
mod colormap;
mod eye;
mod haze;
mod hounsfield;
mod object;
mod padding;
mod preset;
mod quantile;
mod shown_range;
mod split;
mod suggestion;
mod xray;

use glam::DVec3;

pub use colormap::Colormap;
pub use eye::Eye;
pub use preset::Preset;
pub use quantile::{histogram, quantiles};
pub use shown_range::shown_range;

use crate::settings::transfer_function::{Ramp, TransferFunction};
use crate::volume::{ValueSlice, Volume};
use haze::constant;
use object::Object;

impl TransferFunction {
    /// A transfer function for volumes that come without one: a nearly opaque surface around what stands out from the background,
    /// skin-coloured and whiter towards high values. A constant volume becomes a grey haze. Label maps ([`categories::is_label_map`]) get
    /// the colours of [`categories`].
    pub fn from_histogram(volume: &Volume) -> Self {
        let labels = categories::is_label_map(volume).then(|| categories::values(volume)).flatten();
        labels.map_or_else(
            || surface(volume),
            |labels| categories::transfer_of(volume, &labels, volume.palette().unwrap_or_default()),
        )
    }
}

/// Whether few values, such as -1e30, are so far from the others that an `f32` cannot tell these apart where all values are scaled to about 1, as for classification
/// after splatting (SPEC §9).
pub(crate) fn exceeds_digits(volume: &Volume) -> bool {
    // Values of 8 or 16 bits never do.
    matches!(volume.values(), ValueSlice::F32(_)) && Object::find(volume.values()).is_some_and(|of| of.exceeds_digits)
}

/// The transfer function of one of several channels that comes without one, in its file's colour or one given: as with [`Preset::Confocal`], or for a
/// volume of colours as for one alone.
pub(crate) fn one_of_several(volume: &Volume) -> TransferFunction {
    match volume.colors() {
        Some(_) => TransferFunction::from_histogram(volume),
        None => preset::confocal_of_several(volume),
    }
}

/// The transfer function of a label map among several channels: its labels' colours, under [`Preset::Fusion`] translucent.
pub(crate) fn labels_of_several(volume: &Volume, preset: Option<Preset>) -> TransferFunction {
    let labels = categories::transfer_of(volume, &categories::values(volume).unwrap_or_default(), &[]);
    match preset {
        Some(Preset::Fusion) => TransferFunction { opacity: preset::translucent_labels(), ..labels },
        _ => labels,
    }
}

/// [`TransferFunction::from_histogram`] for values that are not labels.
fn surface(volume: &Volume) -> TransferFunction {
    match Object::find(volume.values()) {
        Some(object) => {
            let color =
                vec![(object.threshold(), DVec3::new(0.92, 0.74, 0.62)), (object.bright, DVec3::new(1.0, 0.95, 0.85))];
            TransferFunction::by_value(Ramp::through(color), object.surface(0.9))
        }
        None => constant(0.5),
    }
}

/// The colour of a channel among several, if nothing states it: magenta and green for two, else cyan, magenta, yellow, and then red, green, blue
/// and gray again and again.
pub(crate) fn channel_color(number: usize, count: usize) -> Ramp<DVec3> {
    const CYAN: DVec3 = DVec3::new(0.0, 1.0, 1.0);
    const MAGENTA: DVec3 = DVec3::new(1.0, 0.0, 1.0);
    const YELLOW: DVec3 = DVec3::new(1.0, 1.0, 0.0);
    let colors = match count {
        1 => &[DVec3::ONE][..],
        2 => &[MAGENTA, DVec3::Y],
        _ => &[CYAN, MAGENTA, YELLOW, DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE],
    };
    Ramp::through(vec![(0.0, colors[number % colors.len()])])
}
