//! Differences between images, whose channels must all be finite.

use sheetsplat::image::Image;

use super::compare;

/// Opaque black, the default background.
pub(crate) const BLACK: [f32; 4] = [0.0, 0.0, 0.0, 1.0];

/// The differences of every pixel's channels, all of which must be finite.
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

/// The root mean square of the first channels.
#[track_caller]
fn rms_of(a: &[[f32; 4]], b: &[[f32; 4]], channels: usize) -> f64 {
    compare::root_mean_square(errors(a, b).iter().flat_map(|error| &error[..channels]).copied())
}

/// The largest difference in any channel.
#[track_caller]
pub(crate) fn largest_difference(a: &Image, b: &Image) -> f64 {
    compare::largest(errors(&a.pixels, &b.pixels).into_iter().flatten())
}

/// The root mean square over all channels.
#[track_caller]
pub(crate) fn rms(a: &Image, b: &Image) -> f64 {
    rms_of(&a.pixels, &b.pixels, 4)
}

/// The root mean square over all colours, without alpha.
#[track_caller]
pub(crate) fn color_rms(a: &Image, b: &Image) -> f64 {
    rms_of(&a.pixels, &b.pixels, 3)
}

/// The PSNR in dB over the pixels where either image differs from the (premultiplied) background, of which there must be at least `least`.
/// Infinite if the images are equal, or if both show only the background and `least` is 0.
#[track_caller]
pub(crate) fn psnr(a: &[[f32; 4]], b: &[[f32; 4]], background: [f32; 4], least: usize) -> f64 {
    assert_eq!(a.len(), b.len());
    let differs = |(a, b): &(&[f32; 4], &[f32; 4])| **a != background || **b != background;
    let (a, b): (Vec<[f32; 4]>, Vec<[f32; 4]>) = a.iter().zip(b).filter(differs).unzip();
    assert!(a.len() >= least, "only {} pixels show anything", a.len());
    if a.is_empty() { f64::INFINITY } else { compare::decibels(rms_of(&a, &b, 4)) }
}

/// The bits of every channel.
pub(crate) fn bits(image: &Image) -> Vec<u32> {
    image.pixels.as_flattened().iter().map(|channel| channel.to_bits()).collect()
}
