//! Errors of devices and of choosing a backend.

use std::fmt;

#[cfg(feature = "gpu")]
use wgpu::Features;

/// A failure that the device reported. Messages have one line.
#[cfg(feature = "gpu")]
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum DeviceFault {
    /// Memory ran out. The same device may still provide smaller amounts.
    #[error("the device is out of memory: {0}")]
    OutOfMemory(String),
    /// wgpu's validation found a mistake in this library or in a host's arguments.
    #[error("device error: {0}")]
    Validation(String),
    /// The driver failed, for example to compile a shader.
    #[error("internal device error: {0}")]
    Internal(String),
    /// The device has stopped working. A new one, with new volumes and a new renderer, may work.
    #[error("the device is lost")]
    Lost,
}

/// A device could not be opened or used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DeviceError {
    /// No adapter exists, or none has the requested name.
    #[error("no GPU adapter: required {required}, actual: {actual}{}", after(advice.as_deref()))]
    #[non_exhaustive]
    NoAdapter {
        /// The requested adapter.
        required: String,
        /// The adapters that exist.
        actual: String,
        /// The driver to install, if no adapter exists.
        advice: Option<String>,
    },
    /// The adapter refused to make a device.
    #[cfg(feature = "gpu")]
    #[error("adapter \"{adapter}\" gave no device: {source}")]
    #[non_exhaustive]
    RequestDevice {
        /// The adapter's name.
        adapter: String,
        /// wgpu's error.
        source: wgpu::RequestDeviceError,
    },
    /// The device could not compile the renderer.
    #[cfg(feature = "gpu")]
    #[error("adapter \"{adapter}\" cannot run the renderer: {fault}")]
    #[non_exhaustive]
    Pipelines {
        /// The adapter's name.
        adapter: String,
        /// The device's error.
        fault: DeviceFault,
    },
    /// The device lacks a feature that the options need.
    #[cfg(feature = "gpu")]
    #[error("device feature: required {required:?}, actual: {actual:?}")]
    #[non_exhaustive]
    MissingFeatures {
        /// The required features.
        required: Features,
        /// The features of the device.
        actual: Features,
    },
    /// A backend that is not compiled in.
    #[error("the {backend} backend: the library was built without it, by the feature `{backend}`")]
    #[non_exhaustive]
    MissingBackend {
        /// Its name.
        backend: &'static str,
    },
    /// The device's limits are insufficient for any frame.
    #[error("device limits: {}", list(.0))]
    Limits(Vec<InsufficientLimit>),
    /// An option of the renderer is not supported by this device, or by any.
    #[error("{option}: found {found}, allowed: {allowed}")]
    #[non_exhaustive]
    Unsupported {
        /// The field of `RendererOptions`.
        option: &'static str,
        /// The option's value.
        found: String,
        /// The values that this device supports.
        allowed: String,
    },
}

/// A limit of a device that is insufficient.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InsufficientLimit {
    /// The limit's name in wgpu.
    pub limit: &'static str,
    /// The required value: a minimum, or a maximum for `min_…` limits.
    pub required: u64,
    /// The device's value.
    pub actual: u64,
}

impl fmt::Display for InsufficientLimit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { limit, required, actual } = self;
        write!(f, "{limit}: required {required}, actual: {actual}")
    }
}

/// The advice as a suffix of the message.
fn after(advice: Option<&str>) -> String {
    advice.map_or(String::new(), |advice| format!("; {advice}"))
}

fn list(limits: &[InsufficientLimit]) -> String {
    limits.iter().map(InsufficientLimit::to_string).collect::<Vec<_>>().join("; ")
}
