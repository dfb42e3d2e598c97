//! Errors of the renderer. Loading errors live with the volume and the scene, and all of them together with [`headless`](crate::headless).

#[cfg(feature = "gpu")]
use wgpu::Device;

#[cfg(feature = "gpu")]
use crate::gpu::fault::DeviceFault;
use crate::setting_error::SettingError;

/// Why a frame could not be prepared or read back.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// A setting that is not allowed, or that asks of this volume or device what no renderer can do; or a host's matrix or texture
    /// that does not fit.
    #[error(transparent)]
    OutOfRange(#[from] SettingError),
    /// The frame needs more than a limit of the device allows.
    #[error("{what}: the device's {limit} is {actual}, required: {required}")]
    #[non_exhaustive]
    Limit {
        /// What needs it (`image.width`, `image.height`, …).
        what: &'static str,
        /// The wgpu limit's name.
        limit: &'static str,
        /// What the frame needs.
        required: u64,
        /// What the device allows.
        actual: u64,
    },
    /// The device failed: it is lost, or out of memory, or found a mistake.
    #[cfg(feature = "gpu")]
    #[error(transparent)]
    Device(#[from] DeviceFault),
    /// What was drawn did not come back.
    #[error("read-back failed: {0}")]
    Readback(String),
}

/// Checks that something is on the device that is to work with it: wgpu may panic if not.
#[cfg(feature = "gpu")]
pub(crate) fn check_device(device: &Device, of: &Device, what: &str) -> Result<(), RenderError> {
    if device == of {
        return Ok(());
    }
    let (found, allowed) = (format!("another one than that of {what}"), format!("the device of {what}"));
    Err(SettingError::new("device", found, allowed).into())
}
