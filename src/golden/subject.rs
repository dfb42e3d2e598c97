//! What is compared with a golden.

use std::fmt::{Display, Formatter};
use std::path::Path;

#[cfg(feature = "gpu")]
use wgpu::AdapterInfo;

use super::file;
use crate::headless::Rendering;
#[cfg(feature = "gpu")]
use crate::headless::device::driver_name;
use crate::image::{Image, ImageError};
use crate::volume::ReadOptions;

/// The adapter and driver that made an image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MadeOn {
    /// The adapter's name.
    pub adapter: String,
    /// Its driver's name and version.
    pub driver: String,
}

impl MadeOn {
    /// Whether two images were made on the same adapter, with whatever driver: what Mesa puts in parentheses behind an
    /// adapter's name is about the driver. Two images that know of none count as made alike.
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
        write!(f, "{}, driver {}", self.adapter, self.driver)
    }
}

/// An image, and what it was made on if that is known: a [`Rendering`], an [`Image`] with the information of the adapter
/// that a host made it on, or an image alone.
pub trait Subject {
    /// The image.
    fn image(&self) -> &Image;

    /// What it was made on; unknown unless a type says so.
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
        Some(MadeOn { adapter: self.stats.adapter.clone(), driver: self.stats.driver.clone() })
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

/// An image file, and what it says it was made on. Goldens say so, in the text of the PNG.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// The image.
    pub image: Image,
    /// What it was made on, if the file says so.
    pub made_on: Option<MadeOn>,
}

impl Picture {
    /// Opens an image file of any format of [`Image::open`].
    ///
    /// # Errors
    /// As [`Image::open`].
    pub fn open(path: &Path) -> Result<Self, ImageError> {
        Self::open_with(path, &ReadOptions::default())
    }

    /// [`Picture::open`] under a folder that reading is confined to, or a memory limit.
    ///
    /// # Errors
    /// As [`Image::open_with`].
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
