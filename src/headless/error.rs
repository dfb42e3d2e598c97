//! All errors of headless rendering in one type.

use crate::error::RenderError;
use crate::error::device::DeviceError;
use crate::scene::SceneError;
use crate::volume::VolumeError;

/// Anything that can go wrong between a scene file and its image.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The scene.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The volume.
    #[error(transparent)]
    Volume(#[from] VolumeError),
    /// The device.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// The frame.
    #[error(transparent)]
    Render(RenderError),
}

impl From<RenderError> for Error {
    fn from(error: RenderError) -> Self {
        match error {
            RenderError::Volume(error) => Self::Volume(error),
            error => Self::Render(error),
        }
    }
}
