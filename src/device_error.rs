//! Why nothing can draw.

use std::fmt;

#[cfg(feature = "gpu")]
use crate::gpu::fault::DeviceFault;
#[cfg(feature = "gpu")]
use wgpu::Features;

/// Why no device could be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DeviceError {
    /// There is no adapter, or none with the requested name.
    #[error("no GPU adapter: required {required}, actual: {actual}{}", after(advice.as_deref()))]
    #[non_exhaustive]
    NoAdapter {
        /// What was asked for.
        required: String,
        /// What there is.
        actual: String,
        /// What to install, where there is no adapter at all.
        advice: Option<String>,
    },
    /// The adapter refused to make a device.
    #[cfg(feature = "gpu")]
    #[error("adapter \"{adapter}\" gave no device: {source}")]
    #[non_exhaustive]
    RequestDevice {
        /// The adapter's name.
        adapter: String,
        /// What wgpu said.
        source: wgpu::RequestDeviceError,
    },
    /// The device could not compile the renderer.
    #[cfg(feature = "gpu")]
    #[error("adapter \"{adapter}\" cannot run the renderer: {fault}")]
    #[non_exhaustive]
    Pipelines {
        /// The adapter's name.
        adapter: String,
        /// What the device reported.
        fault: DeviceFault,
    },
    /// A feature is missing that the options ask for.
    #[cfg(feature = "gpu")]
    #[error("device feature: required {required:?}, actual: {actual:?}")]
    #[non_exhaustive]
    MissingFeatures {
        /// What is needed.
        required: Features,
        /// What the device has.
        actual: Features,
    },
    /// A backend that is not compiled in.
    #[error("the {backend} backend: the library was built without it, by the feature `{backend}`")]
    #[non_exhaustive]
    MissingBackend {
        /// Its name.
        backend: &'static str,
    },
    /// Limits that are not enough for any frame.
    #[error("device limits: {}", list(.0))]
    Limits(Vec<InsufficientLimit>),
    /// An option of the renderer that this device, or any, cannot fulfil.
    #[error("{option}: found {found}, allowed: {allowed}")]
    #[non_exhaustive]
    Unsupported {
        /// The field of `RendererOptions`.
        option: &'static str,
        /// What it is.
        found: String,
        /// What would do on this device.
        allowed: String,
    },
}

/// A limit of a device that is not enough.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InsufficientLimit {
    /// wgpu's name of the limit.
    pub limit: &'static str,
    /// What is needed: at least that much, of `min_…` limits at most.
    pub required: u64,
    /// What the device has.
    pub actual: u64,
}

impl fmt::Display for InsufficientLimit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { limit, required, actual } = self;
        write!(f, "{limit}: required {required}, actual: {actual}")
    }
}

/// Advice after what is wrong.
fn after(advice: Option<&str>) -> String {
    advice.map_or(String::new(), |advice| format!("; {advice}"))
}

fn list(limits: &[InsufficientLimit]) -> String {
    limits.iter().map(InsufficientLimit::to_string).collect::<Vec<_>>().join("; ")
}
