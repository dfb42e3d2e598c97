//! The differences between two images.

use std::fmt::{Display, Formatter};

use super::Tolerance;
use crate::image::Image;

/// The differences between two images of equal size, and whether a tolerance allows them. Its display is a report of several lines.
///
/// Channels are compared as 8-bit numbers, as in a PNG, but premultiplied by alpha, so that the colour of a transparent pixel does
/// not count. For opaque images these are the PNG's own channels.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// Pixels per row.
    pub width: u32,
    /// Number of rows.
    pub height: u32,
    /// The largest difference in each channel, RGBA, 0 to 255.
    pub max: [u8; 4],
    /// x and y of the pixel with the largest difference; the first one of several.
    pub worst: [u32; 2],
    /// The mean difference per channel, 0 to 255. Alpha counts unless both images are opaque.
    pub mean: f64,
    /// The peak signal-to-noise ratio in dB over the same channels; infinite for equal images.
    pub psnr_db: f64,
    /// The number of pixels in which a channel differs by more than the tolerance.
    pub outliers: u64,
    /// The tolerance.
    pub tolerance: Tolerance,
    /// Each pixel's largest difference in any channel.
    differences: Vec<u8>,
}

/// Why two images cannot be compared.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ComparisonError {
    /// The image has no pixels, or their number is not width × height.
    #[error(
        "the {which} image: found {found} pixels for {width}×{height}, allowed: width × height pixels, at least one"
    )]
    Pixels {
        /// `actual` or `golden`.
        which: &'static str,
        /// The stated number of pixels per row.
        width: u32,
        /// The stated number of rows.
        height: u32,
        /// The number of pixels.
        found: usize,
    },
    /// A channel is NaN or infinite.
    #[error("the {which} image: found {found} at x {x}, y {y}, allowed: finite numbers")]
    NotFinite {
        /// `actual` or `golden`.
        which: &'static str,
        /// Infinity or NaN.
        found: f32,
        /// The pixel's column.
        x: usize,
        /// The pixel's row.
        y: usize,
    },
    /// The images differ in size.
    #[error("the actual image is {}×{} pixels, the golden {}×{}", actual[0], actual[1], golden[0], golden[1])]
    Size {
        /// Width and height.
        actual: [u32; 2],
        /// Width and height.
        golden: [u32; 2],
    },
}

impl Comparison {
    /// The thresholds for which a report counts the pixels that differ by more.
    pub const SWEEP: [u8; 9] = [0, 1, 2, 3, 5, 10, 20, 50, 100];

    /// Compares two images.
    ///
    /// # Errors
    /// If the images differ in size, or one of them has no pixels, not width × height pixels, or a channel that is not finite.
    pub fn new(actual: &Image, golden: &Image, tolerance: Tolerance) -> Result<Self, ComparisonError> {
        let (width, height) = (actual.width, actual.height);
        let [actual_pixels, golden_pixels] = [eight_bit(actual, "actual")?, eight_bit(golden, "golden")?];
        if [width, height] != [golden.width, golden.height] {
            return Err(ComparisonError::Size { actual: [width, height], golden: [golden.width, golden.height] });
        }
        let opaque = actual_pixels.iter().chain(&golden_pixels).all(|pixel| pixel[3] == u8::MAX);
        let mut max = [0; 4];
        let (mut sum, mut squares) = (0, 0);
        let mut differences = Vec::with_capacity(actual_pixels.len());
        for (actual, golden) in
            actual_pixels.into_iter().map(premultiplied).zip(golden_pixels.into_iter().map(premultiplied))
        {
            let channels: [u8; 4] = std::array::from_fn(|channel| actual[channel].abs_diff(golden[channel]));
            max = std::array::from_fn(|channel| max[channel].max(channels[channel]));
            sum += channels.into_iter().map(u64::from).sum::<u64>();
            squares += channels.into_iter().map(|difference| u64::from(difference).pow(2)).sum::<u64>();
            differences.push(channels.into_iter().fold(0, u8::max));
        }
        let most = max.into_iter().fold(0, u8::max);
        let worst = differences.iter().position(|&difference| difference == most).unwrap_or(0) as u64;
        let count = differences.len() as f64 * if opaque { 3.0 } else { 4.0 };
        let mut comparison = Self {
            width,
            height,
            max,
            worst: [(worst % u64::from(width)) as u32, (worst / u64::from(width)) as u32],
            mean: sum as f64 / count,
            psnr_db: 10.0 * (255.0 * 255.0 * count / squares as f64).log10(),
            outliers: 0,
            tolerance,
            differences,
        };
        comparison.outliers = comparison.beyond(tolerance.per_channel());
        Ok(comparison)
    }

    /// Whether the tolerance allows the differences.
    pub fn passes(&self) -> bool {
        self.share(self.outliers) <= self.tolerance.outliers()
    }

    /// The number of pixels in which a channel differs by more than `threshold`.
    pub fn beyond(&self, threshold: u8) -> u64 {
        self.differences.iter().filter(|&&difference| difference > threshold).count() as u64
    }

    /// An opaque image of the differences: black for none, grey within the tolerance (20 times the difference), red to yellow beyond it.
    pub fn difference_image(&self) -> Image {
        let pixel = |&difference: &u8| {
            let shade = f32::from(difference.saturating_mul(20)) / 255.0;
            if difference > self.tolerance.per_channel() {
                [1.0, shade / 2.0, 0.0, 1.0]
            } else {
                [shade, shade, shade, 1.0]
            }
        };
        Image { width: self.width, height: self.height, pixels: self.differences.iter().map(pixel).collect() }
    }

    fn share(&self, pixels: u64) -> f64 {
        pixels as f64 / self.differences.len() as f64
    }
}

impl Display for Comparison {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let percent = |pixels| self.share(pixels) * 100.0;
        let Self { width, height, max: [red, green, blue, alpha], worst: [x, y], outliers, tolerance, .. } = self;
        writeln!(
            f,
            "{outliers} of {width}×{height} pixels ({:.3} %) differ by more than {} of 255, allowed: {:.3} %",
            percent(*outliers),
            tolerance.per_channel(),
            tolerance.outliers() * 100.0,
        )?;
        writeln!(f, "largest difference: red {red}, green {green}, blue {blue}, alpha {alpha}; worst at x {x}, y {y}")?;
        writeln!(f, "mean difference: {:.4}", self.mean)?;
        writeln!(f, "PSNR: {:.2} dB", self.psnr_db)?;
        write!(f, "pixels that differ by more than")?;
        for threshold in Self::SWEEP {
            let pixels = self.beyond(threshold);
            write!(f, "\n{threshold:>7}: {pixels:>9} ({:.3} %)", percent(pixels))?;
        }
        Ok(())
    }
}

/// The pixels as in a PNG: 8 bits, straight alpha.
///
/// # Errors
/// If there are no pixels, not width × height pixels, or one is not finite.
pub(super) fn eight_bit(image: &Image, which: &'static str) -> Result<Vec<[u8; 4]>, ComparisonError> {
    let &Image { width, height, ref pixels } = image;
    if pixels.is_empty() || pixels.len() as u64 != u64::from(width) * u64::from(height) {
        return Err(ComparisonError::Pixels { which, width, height, found: pixels.len() });
    }
    if let Some(at) = pixels.as_flattened().iter().position(|channel| !channel.is_finite()) {
        let (found, x, y) = (pixels.as_flattened()[at], at / 4 % width as usize, at / 4 / width as usize);
        return Err(ComparisonError::NotFinite { which, found, x, y });
    }
    Ok(image.straight_channels(255).map(|pixel| pixel.map(|channel| channel as u8)).collect())
}

fn premultiplied([r, g, b, a]: [u8; 4]) -> [u8; 4] {
    let times_alpha = |channel: u8| ((u16::from(channel) * u16::from(a) + 127) / 255) as u8;
    [times_alpha(r), times_alpha(g), times_alpha(b), a]
}
