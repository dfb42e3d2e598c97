//! How much an image may differ from its golden.

/// Steps of 255 that a channel may differ by, and the share of the pixels that may differ by more: the outliers.
///
/// The default allows for the rounding of processors and driver versions, 3 steps, and no outlier. Where an early
/// decision can flip, at a silhouette or a voxel that is just hidden, 0.001 is room for a few.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance {
    per_channel: u8,
    outliers: f64,
}

/// A tolerance that would let pass what can be seen.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{what}: found {found}, allowed: 0 to {allowed}")]
pub struct LaxTolerance {
    /// Which of the two numbers.
    pub what: &'static str,
    /// What it is.
    pub found: f64,
    /// What it may be at most.
    pub allowed: f64,
}

impl Default for Tolerance {
    fn default() -> Self {
        Self { per_channel: 3, outliers: 0.0 }
    }
}

impl Tolerance {
    /// The widest there is: 16 of 255, and one pixel in 100. On another adapter than the golden's this one holds: culling with
    /// the default `opacity_threshold` may itself change a channel by 13.
    pub const WIDEST: Self = Self { per_channel: 16, outliers: 0.01 };

    /// A tolerance of `per_channel` steps of 255 (0 to 16) with a share of `outliers` (0 to 0.01) among the pixels.
    ///
    /// # Errors
    /// If either is beyond that of [`Tolerance::WIDEST`]: a test that passes then would say little.
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

    /// Steps of 255 that a channel may differ by.
    pub fn per_channel(self) -> u8 {
        self.per_channel
    }

    /// The share of the pixels that may have a channel that differs by more.
    pub fn outliers(self) -> f64 {
        self.outliers
    }
}
