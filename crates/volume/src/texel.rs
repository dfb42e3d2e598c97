//! The colour of a voxel (SPEC §10).

use glam::{DVec3, DVec4};

use super::sample_type::SampleType;

/// Red, green, blue and A of a voxel, each from 0 to [`u16::MAX`], which stands for 1. Numbers of 8 and 16 bits are exact.
pub type Texel = [u16; 4];

/// The bytes that a voxel takes while its colour is made of its components, beside these: its numbers side by side, its luminance and its colour.
pub const COLOR_BYTES: u64 = size_of::<([f32; 4], f32, Texel)>() as u64;

/// The weights of red, green and blue in the luminance (ITU-R BT.709).
const LUMINANCE: DVec3 = DVec3::new(0.2126, 0.7152, 0.0722);

/// The colour of stored numbers of a type.
pub(super) fn texel(numbers: [f32; 4], kind: SampleType) -> Texel {
    numbers.map(|number| share(number, kind))
}

/// The luminance of stored numbers; NaN if one of them, or A, is not finite.
pub(super) fn luminance([red, green, blue, alpha]: [f32; 4]) -> f32 {
    let numbers = DVec3::new(red.into(), green.into(), blue.into());
    if numbers.is_finite() && alpha.is_finite() { numbers.dot(LUMINANCE) as f32 } else { f32::NAN }
}

/// A stored number as a share of its type's maximum.
fn share(number: f32, kind: SampleType) -> u16 {
    let full = f64::from(u16::MAX);
    // A cast of NaN gives 0.
    (f64::from(number) / kind.full() * full).clamp(0.0, full).round() as u16
}

/// A texel in [0, 1].
pub(super) fn shares(texel: Texel) -> DVec4 {
    DVec4::from_array(texel.map(f64::from)) / f64::from(u16::MAX)
}
