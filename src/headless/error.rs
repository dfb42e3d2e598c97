//! All errors of headless rendering in one type.

#[cfg(feature = "cpu")]
use crate::cpu::StreamError;
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
    Render(#[from] RenderError),
}

#[cfg(feature = "cpu")]
impl From<StreamError> for Error {
    fn from(error: StreamError) -> Self {
        match error {
            StreamError::Volume(error) => error.into(),
            StreamError::Render(error) => error.into(),
        }
    }
}
