//! What can be compared with a golden.

use std::fmt::{Display, Formatter};
use std::path::Path;

#[cfg(feature = "gpu")]
use wgpu::AdapterInfo;

use super::file;
#[cfg(feature = "gpu")]
use crate::headless::device::driver_name;
use crate::headless::{Backend, Rendering};
use crate::image::{Image, ImageError};
use crate::stats::Stats;
use crate::volume::ReadOptions;

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
    fn by(backend: &str) -> Self {
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

/// An image, and the adapter that made it if known: a [`Rendering`], an [`Image`] with the information of a host's adapter, or an image
/// alone.
pub trait Subject {
    /// The image.
    fn image(&self) -> &Image;

    /// The adapter and driver that made it, if known.
    fn made_on(&self) -> Option<MadeOn> {
        None
    }
}

impl Subject for Image {
    fn image(&self) -> &Image {
        self
    }
}

impl Subject for Rendering {
    fn image(&self) -> &Image {
        &self.image
    }

    fn made_on(&self) -> Option<MadeOn> {
        let Stats { adapter, driver, backend, .. } = &self.stats;
        let is_named = [Backend::Cpu, Backend::Reference].iter().any(|named| named.name() == backend);
        Some(match is_named {
            true => MadeOn::by(backend),
            false => MadeOn { adapter: adapter.clone(), driver: driver.clone() },
        })
    }
}

#[cfg(feature = "gpu")]
impl Subject for (&Image, &AdapterInfo) {
    fn image(&self) -> &Image {
        self.0
    }

    fn made_on(&self) -> Option<MadeOn> {
        Some(self.1.into())
    }
}

impl<T: Subject + ?Sized> Subject for &T {
    fn image(&self) -> &Image {
        (**self).image()
    }

    fn made_on(&self) -> Option<MadeOn> {
        (**self).made_on()
    }
}

/// An image file, with the adapter and driver that made it if the file names them, as goldens do in the PNG's texts.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// The image.
    pub image: Image,
    /// The adapter and driver that made it, if the file names them.
    pub made_on: Option<MadeOn>,
}

impl Picture {
    /// Opens an image file of any format of [`Image::open`].
    ///
    /// # Errors
    /// As for [`Image::open`].
    pub fn open(path: &Path) -> Result<Self, ImageError> {
        Self::open_with(path, &ReadOptions::default())
    }

    /// Like [`Picture::open`], with a folder that files must lie in and a memory limit.
    ///
    /// # Errors
    /// As for [`Image::open_with`].
    pub fn open_with(path: &Path, options: &ReadOptions) -> Result<Self, ImageError> {
        Ok(Self { image: Image::open_with(path, options)?, made_on: file::made_on(path) })
    }
}

impl Subject for Picture {
    fn image(&self) -> &Image {
        &self.image
    }

    fn made_on(&self) -> Option<MadeOn> {
        self.made_on.clone()
    }
}
