//! What made an image.

use std::fmt::{Display, Formatter};

#[cfg(feature = "gpu")]
use wgpu::AdapterInfo;

use crate::headless::Backend;
#[cfg(feature = "gpu")]
use crate::headless::device::driver_name;

/// The adapter and driver that made an image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MadeOn {
    /// The adapter's name, or `cpu backend`, `reference backend`.
    pub adapter: String,
    /// Its driver's name and version.
    pub driver: String,
}

impl MadeOn {
    /// An image of a backend that needs no adapter.
    pub(super) fn by(backend: &str) -> Self {
        Self { adapter: format!("{backend} backend"), driver: String::new() }
    }

    /// Whether such an image is the same on every machine.
    pub(super) fn is_exact(&self) -> bool {
        *self == Self::by(Backend::Cpu.name())
    }

    /// Whether two images were made on the same adapter, with any driver: the part of an adapter's name that Mesa puts in parentheses
    /// describes the driver. Two images of unknown origin count as made on the same adapter.
    pub fn same(one: Option<&Self>, other: Option<&Self>) -> bool {
        let name = |made_on: &Self| made_on.adapter.split(" (").next().map(str::to_owned);
        one.map(name) == other.map(name)
    }
}

#[cfg(feature = "gpu")]
impl From<&AdapterInfo> for MadeOn {
    fn from(info: &AdapterInfo) -> Self {
        Self { adapter: info.name.clone(), driver: driver_name(info) }
    }
}

impl Display for MadeOn {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        match self.driver.as_str() {
            "" => f.write_str(&self.adapter),
            driver => write!(f, "{}, driver {driver}", self.adapter),
        }
    }
}
