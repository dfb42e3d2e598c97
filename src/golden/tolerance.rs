//! How much an image may differ from its golden.

/// The steps of 255 by which a channel may differ, and the fraction of pixels that may differ by more: the outliers.
///
/// The default, 3 steps and no outlier, allows for the rounding of processors and driver versions. Where an early decision can flip, at
/// a silhouette or a voxel that is barely hidden, a fraction of 0.001 allows for a few outliers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance {
    per_channel: u8,
    outliers: f64,
}

/// A tolerance that would allow visible differences.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{what}: found {found}, allowed: 0 to {allowed}")]
pub struct LaxTolerance {
    /// The quantity that is too large.
    pub what: &'static str,
    /// Its value.
    pub found: f64,
    /// Its maximum.
    pub allowed: f64,
}

impl Default for Tolerance {
    fn default() -> Self {
        Self { per_channel: 3, outliers: 0.0 }
    }
}

impl Tolerance {
    /// None: every pixel is equal.
    pub const EXACT: Self = Self { per_channel: 0, outliers: 0.0 };

    /// The widest tolerance: 16 of 255, and one pixel in 100. It applies if the golden was made on another adapter: culling with the
    /// default `opacity_threshold` alone may change a channel by 13.
    pub const WIDEST: Self = Self { per_channel: 16, outliers: 0.01 };

    /// A tolerance of `per_channel` steps of 255 (0 to 16) with a fraction of outliers (0 to 0.01) among the pixels.
    ///
    /// # Errors
    /// If either exceeds [`Tolerance::WIDEST`]: a test that passes then would say little.
    pub fn new(per_channel: u8, outliers: f64) -> Result<Self, LaxTolerance> {
        let widest = Self::WIDEST;
        if per_channel > widest.per_channel {
            let (found, allowed) = (per_channel.into(), widest.per_channel.into());
            return Err(LaxTolerance { what: "tolerance per channel", found, allowed });
        }
        if !(0.0..=widest.outliers).contains(&outliers) {
            return Err(LaxTolerance { what: "share of outliers", found: outliers, allowed: widest.outliers });
        }
        Ok(Self { per_channel, outliers })
    }

    /// The steps of 255 by which a channel may differ.
    pub fn per_channel(self) -> u8 {
        self.per_channel
    }

    /// The fraction of pixels that may differ by more.
    pub fn outliers(self) -> f64 {
        self.outliers
    }
}
