//! How much images differ. Every channel of both must be finite.

use sheetsplat::image::Image;

use super::compare;

/// Opaque black, the default background.
pub(crate) const BLACK: [f32; 4] = [0.0, 0.0, 0.0, 1.0];

/// Differences of every pixel's channels, all of them finite: a difference of anything else is not.
#[track_caller]
fn errors(a: &[[f32; 4]], b: &[[f32; 4]]) -> Vec<[f64; 4]> {
    assert_eq!(a.len(), b.len());
    let difference =
        |(a, b): (&[f32; 4], &[f32; 4])| -> [f64; 4] { std::array::from_fn(|i| f64::from(a[i]) - f64::from(b[i])) };
    let errors: Vec<[f64; 4]> = a.iter().zip(b).map(difference).collect();
    let broken = errors.iter().position(|error| !error.iter().all(|channel| channel.is_finite()));
    assert_eq!(broken.map(|at| (at, a[at], b[at])), None, "a pixel that is not finite");
    errors
}

/// The root of the mean square of the first channels.
#[track_caller]
fn rms_of(a: &[[f32; 4]], b: &[[f32; 4]], channels: usize) -> f64 {
    compare::root_mean_square(errors(a, b).iter().flat_map(|error| &error[..channels]).copied())
}

/// The largest difference of any channel.
#[track_caller]
pub(crate) fn largest_difference(a: &Image, b: &Image) -> f64 {
    compare::largest(errors(&a.pixels, &b.pixels).into_iter().flatten())
}

/// The root of the mean square over all channels.
#[track_caller]
pub(crate) fn rms(a: &Image, b: &Image) -> f64 {
    rms_of(&a.pixels, &b.pixels, 4)
}

/// The root of the mean square over all colours, without alpha.
#[track_caller]
pub(crate) fn color_rms(a: &Image, b: &Image) -> f64 {
    rms_of(&a.pixels, &b.pixels, 3)
}

/// Decibels over the pixels where either differs from the background (premultiplied), which are `least` or more. Infinite where the
/// images are equal, or where neither shows anything and `least` is 0.
#[track_caller]
pub(crate) fn psnr(a: &[[f32; 4]], b: &[[f32; 4]], background: [f32; 4], least: usize) -> f64 {
    assert_eq!(a.len(), b.len());
    let differs = |(a, b): &(&[f32; 4], &[f32; 4])| **a != background || **b != background;
    let (a, b): (Vec<[f32; 4]>, Vec<[f32; 4]>) = a.iter().zip(b).filter(differs).unzip();
    assert!(a.len() >= least, "only {} pixels show anything", a.len());
    if a.is_empty() { f64::INFINITY } else { compare::decibels(rms_of(&a, &b, 4)) }
}
