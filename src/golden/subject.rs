//! What can be compared with a golden.

use std::path::Path;

#[cfg(feature = "gpu")]
use wgpu::AdapterInfo;

use super::{MadeOn, file};
use crate::headless::{Backend, Rendering};
use crate::image::{Image, ImageError};
use crate::stats::Stats;
use crate::volume::ReadOptions;

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
