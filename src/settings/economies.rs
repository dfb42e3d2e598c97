//! The economies that the paper proposes as future work (§8), a scene file's `[splatting.experimental]`. They hardly pay.

use std::fmt::{self, Display, Formatter};

use crate::error::setting::{Interval, SettingError};

/// The keys, each with its former name in `[splatting]`.
pub(crate) const KEYS: [(&str, &str); 3] = [
    ("splatting.experimental.whole_below", "whole_below"),
    ("splatting.experimental.beta", "beta"),
    ("splatting.experimental.resolution", "resolution"),
];

/// Ways to draw less where it is hardly visible (§8, the paper's future work). Only the tile rasterizer has them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Economies {
    /// Voxels with an opacity per unit length below this are projected as whole kernels, into the sheet that contains their centre. 0 turns
    /// this off.
    pub whole_below: f64,
    /// β-acceleration: where every pixel in a kernel's box has reached this opacity, the kernel is projected whole, into the first group of
    /// sheets that it reaches. No channel changes by more than `1 - beta`. It works front to back only, and not for
    /// `surface`. 1 turns this off.
    pub beta: f64,
    /// A footprint ends where it adds less than this to its sheet's alpha. 0 draws the whole kernel.
    pub resolution: f64,
}

impl Default for Economies {
    /// All of them are off.
    fn default() -> Self {
        Self { whole_below: 0.0, beta: 1.0, resolution: 0.0 }
    }
}

impl Economies {
    pub(super) fn check(&self) -> Result<(), SettingError> {
        for ((key, found), allowed) in
            self.values().into_iter().zip([Interval::SHARE, Interval::THRESHOLD, Interval::SHARE])
        {
            allowed.check(key, found)?;
        }
        Ok(())
    }

    /// The first of them that is on; `None` if all are off.
    pub(crate) fn in_use(&self) -> Option<EconomyInUse> {
        let off = Self::default().values();
        let used = self.values().into_iter().zip(off).find(|(value, off)| value != off);
        used.map(|((key, value), (_, off))| EconomyInUse { key, value, off })
    }

    fn values(&self) -> [(&'static str, f64); 3] {
        let [whole_below, beta, resolution] = KEYS.map(|(key, _)| key);
        [(whole_below, self.whole_below), (beta, self.beta), (resolution, self.resolution)]
    }
}

/// An economy that is on; displayed as a scene file states it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EconomyInUse {
    pub(crate) key: &'static str,
    pub(crate) value: f64,
    /// The value that turns it off.
    pub(crate) off: f64,
}

impl Display for EconomyInUse {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{} = {}", self.key, self.value)
    }
}
