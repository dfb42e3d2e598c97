//! How much images differ.

use sheetsplat::image::Image;

/// Opaque black, the default background.
pub(crate) const BLACK: [f32; 4] = [0.0, 0.0, 0.0, 1.0];

/// Differences of the first so many channels.
fn errors(a: &[[f32; 4]], b: &[[f32; 4]], channels: usize) -> impl Iterator<Item = f64> {
    assert_eq!(a.len(), b.len());
    let of_pixel = move |(a, b): (&[f32; 4], &[f32; 4])| -> [f64; 4] {
        std::array::from_fn(|i| if i < channels { f64::from(a[i]) - f64::from(b[i]) } else { 0.0 })
    };
    a.iter().zip(b).flat_map(of_pixel)
}

/// The root of the mean square of the first so many channels.
fn rms_of(a: &[[f32; 4]], b: &[[f32; 4]], channels: usize) -> f64 {
    (errors(a, b, channels).map(|error| error * error).sum::<f64>() / (channels * a.len()) as f64).sqrt()
}

/// The largest difference of any channel.
pub(crate) fn largest_difference(a: &Image, b: &Image) -> f64 {
    errors(&a.pixels, &b.pixels, 4).fold(0.0, |worst, error| worst.max(error.abs()))
}

/// The root of the mean square over all channels.
pub(crate) fn rms(a: &Image, b: &Image) -> f64 {
    rms_of(&a.pixels, &b.pixels, 4)
}

/// The root of the mean square over all colours, without alpha.
pub(crate) fn color_rms(a: &Image, b: &Image) -> f64 {
    rms_of(&a.pixels, &b.pixels, 3)
}

/// Decibels over the pixels where either differs from the background (premultiplied), which are `least` or more.
pub(crate) fn psnr(a: &[[f32; 4]], b: &[[f32; 4]], background: [f32; 4], least: usize) -> f64 {
    let differs = |(a, b): &(&[f32; 4], &[f32; 4])| **a != background || **b != background;
    let (a, b): (Vec<[f32; 4]>, Vec<[f32; 4]>) = a.iter().zip(b).filter(differs).unzip();
    assert!(a.len() >= least, "only {} pixels show anything", a.len());
    -20.0 * rms_of(&a, &b, 4).log10()
}
