//! Errors of the renderer, and of volumes. Those of scenes are defined beside them; [`headless`](crate::headless) unites them all.

pub(crate) mod device;

pub(crate) use sheetsplat_volume::internals::setting;

#[cfg(feature = "gpu")]
use wgpu::Device;

use crate::volume::VolumeError;
#[cfg(feature = "gpu")]
use device::DeviceFault;
use setting::SettingError;

/// Why a frame could not be prepared or read back.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// A setting is invalid, or this volume or device does not support it, or a host's matrix or texture does not fit.
    #[error(transparent)]
    OutOfRange(#[from] SettingError),
    /// A volume that is read while it is drawn could not be read.
    #[error(transparent)]
    Volume(#[from] VolumeError),
    /// The frame needs more than a limit of the device allows.
    #[error("{what}: the device's {limit} is {actual}, required: {required}")]
    #[non_exhaustive]
    Limit {
        /// The setting that needs it (`image.width`, `image.height`, …).
        what: &'static str,
        /// The wgpu limit's name.
        limit: &'static str,
        /// The amount that the frame needs.
        required: u64,
        /// The amount that the device allows.
        actual: u64,
    },
    /// The device failed: it is lost, or out of memory, or found a mistake.
    #[cfg(feature = "gpu")]
    #[error(transparent)]
    Device(#[from] DeviceFault),
    /// The result of drawing could not be read back.
    #[error("read-back failed: {0}")]
    Readback(String),
}

/// Checks that something is on the device that is to work with it: wgpu may panic if not.
#[cfg(feature = "gpu")]
pub(crate) fn check_device(device: &Device, of: &Device, what: &str) -> Result<(), RenderError> {
    if device == of {
        return Ok(());
    }
    let (found, allowed) = (format!("another device than that of {what}"), format!("the device of {what}"));
    Err(SettingError::new("device", found, allowed).into())
}
