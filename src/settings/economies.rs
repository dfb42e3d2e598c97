//! The economies that the paper proposes as future work (§8), a scene file's `[splatting.experimental]`. They hardly pay.

use std::fmt::{self, Display, Formatter};

use super::key::{Keyed, Slot};

/// The table's full key.
pub(crate) const TABLE: &str = "splatting.experimental";

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
    /// The first of them that is on; `None` if all are off.
    pub(crate) fn in_use(mut self) -> Option<EconomyInUse> {
        let mut default = Self::default();
        Self::KEYS.iter().find_map(|key| match [(key.slot)(&mut self), (key.slot)(&mut default)] {
            [Slot::Number(_, value), Slot::Number(_, off)] if value != off => {
                Some(EconomyInUse { key: format!("{TABLE}.{}", key.name), value: *value, off: *off })
            }
            _ => None,
        })
    }
}

/// An economy that is on; displayed as a scene file states it.
#[derive(Clone, Debug)]
pub(crate) struct EconomyInUse {
    pub(crate) key: String,
    pub(crate) value: f64,
    /// The value that turns it off.
    pub(crate) off: f64,
}

impl Display for EconomyInUse {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{} = {}", self.key, self.value)
    }
}
