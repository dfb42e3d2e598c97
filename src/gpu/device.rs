//! What the renderer needs of a device, and what it makes of one that has more.

use std::fmt;

use wgpu::{Adapter, Device, DeviceDescriptor, Features, Limits, TextureFormat};

use super::layout::FOLD;
use super::volume_texture;
use crate::gpu::fault::DeviceFault;

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
    #[error("adapter \"{adapter}\" gave no device: {source}")]
    #[non_exhaustive]
    RequestDevice {
        /// The adapter's name.
        adapter: String,
        /// What wgpu said.
        source: wgpu::RequestDeviceError,
    },
    /// The device could not compile the renderer.
    #[error("adapter \"{adapter}\" cannot run the renderer: {fault}")]
    #[non_exhaustive]
    Pipelines {
        /// The adapter's name.
        adapter: String,
        /// What the device reported.
        fault: DeviceFault,
    },
    /// A feature is missing that the options ask for.
    #[error("device feature: required {required:?}, actual: {actual:?}")]
    #[non_exhaustive]
    MissingFeatures {
        /// What is needed.
        required: Features,
        /// What the device has.
        actual: Features,
    },
    /// Limits that are not enough for any frame.
    #[error("device limits: {}", list(.0))]
    Limits(Vec<InsufficientLimit>),
    /// An option of the renderer that this device, or any, cannot fulfil.
    #[error("{option}: found {found}, allowed: {allowed}")]
    #[non_exhaustive]
    Unsupported {
        /// The field of [`RendererOptions`](crate::renderer::options::RendererOptions).
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

/// Features that the renderer uses where a device has them. None is required.
pub const WANTED_FEATURES: Features = Features::FLOAT32_BLENDABLE.union(Features::TIMESTAMP_QUERY).union(TILE_FEATURES);

/// Features that the tile rasterizer cannot do without.
pub const TILE_FEATURES: Features = Features::SUBGROUP.union(Features::SUBGROUP_BARRIER);

/// Features and limits of a device.
#[derive(Clone, Debug, PartialEq)]
pub struct DeviceRequirements {
    /// Features to request.
    pub features: Features,
    /// Limits to request.
    pub limits: Limits,
}

impl DeviceRequirements {
    /// What no frame can do without: less than WebGPU's defaults. What an image or a volume needs beyond it, they say when they are
    /// prepared.
    pub const LEAST: Self = Self {
        features: Features::empty(),
        limits: Limits {
            max_texture_dimension_2d: volume_texture::LEAST_SIDE,
            max_texture_array_layers: 128,
            max_storage_buffers_per_shader_stage: 8,
            max_uniform_buffers_per_shader_stage: 4,
            max_dynamic_uniform_buffers_per_pipeline_layout: 1,
            max_color_attachments: 1,
            max_color_attachment_bytes_per_sample: 16,
            max_compute_workgroup_storage_size: 2048,
            max_compute_invocations_per_workgroup: 256,
            max_compute_workgroup_size_x: 256,
            max_compute_workgroup_size_y: 8,
            max_compute_workgroup_size_z: 1,
            max_compute_workgroups_per_dimension: FOLD,
            // Everything else is no more than WebGL 2 has, without compute shaders and storage buffers.
            ..Limits::downlevel_webgl2_defaults()
        },
    };

    /// What to request from this adapter, to render as well as it can: WebGPU's default limits, raised where the adapter allows
    /// larger images and volumes, and lowered where it has less. Whether that is enough, [`Self::check`] says.
    pub fn for_adapter(adapter: &Adapter) -> Self {
        let available = adapter.limits();
        let limits = Limits {
            max_texture_dimension_2d: available.max_texture_dimension_2d,
            max_texture_array_layers: available.max_texture_array_layers,
            max_buffer_size: available.max_buffer_size,
            max_compute_workgroup_storage_size: available.max_compute_workgroup_storage_size,
            max_storage_buffer_binding_size: available.max_storage_buffer_binding_size,
            // Four sheets of RGBA32F.
            max_color_attachment_bytes_per_sample: 64,
            ..Limits::default()
        };
        Self { features: adapter.features() & WANTED_FEATURES, limits: limits.or_worse_values_from(&available) }
    }

    /// Adds these features to a host's descriptor, and takes the better of each limit.
    pub fn merge_into(&self, descriptor: &mut DeviceDescriptor<'_>) {
        descriptor.required_features |= self.features;
        descriptor.required_limits = descriptor.required_limits.clone().or_better_values_from(&self.limits);
    }

    /// Checks that a device can run every pass: that it has [`Self::LEAST`].
    ///
    /// # Errors
    /// [`DeviceError::Limits`] with every limit that is not enough, what is required, and what the device has.
    pub fn check(device: &Device) -> Result<(), DeviceError> {
        let insufficient = Self::insufficient(&device.limits());
        if insufficient.is_empty() { Ok(()) } else { Err(DeviceError::Limits(insufficient)) }
    }

    /// Every limit that is less than [`Self::LEAST`] asks for.
    pub fn insufficient(limits: &Limits) -> Vec<InsufficientLimit> {
        let mut insufficient = Vec::new();
        Self::LEAST.limits.check_limits_with_fail_fn(limits, false, |limit, required, actual| {
            insufficient.push(InsufficientLimit { limit, required, actual });
        });
        insufficient
    }
}

/// How many sheets one quad draws into: `wanted` if given, else as many colour attachments as the device allows, up to 4.
///
/// # Errors
/// If `wanted` is not 1, 2 or 4, or more than the device allows.
pub fn sheets_per_group(device: &Device, format: TextureFormat, wanted: Option<u32>) -> Result<u32, DeviceError> {
    let limits = device.limits();
    let bytes = format.target_pixel_byte_cost().unwrap_or(16);
    let attachments = limits.max_color_attachments.min(limits.max_color_attachment_bytes_per_sample / bytes);
    let possible = [1, 2, 4].into_iter().filter(|&sheets| sheets == 1 || sheets <= attachments);
    let most = possible.clone().max().unwrap_or(1);
    let sheets = wanted.unwrap_or(most);
    if possible.clone().any(|possible| possible == sheets) {
        return Ok(sheets);
    }
    let possible: Vec<String> = possible.map(|sheets| sheets.to_string()).collect();
    let allowed = format!("{} of {format:?} on this device", possible.join(" or "));
    Err(DeviceError::Unsupported { option: "sheets_per_group", found: sheets.to_string(), allowed })
}

/// The format of sheet buffers: `wanted` if given, else `Rgba32Float` where that can be blended, else `Rgba16Float`.
///
/// # Errors
/// If `wanted` is `Rgba32Float` and the device cannot blend it, or is none of the two.
pub fn sheet_format(device: &Device, wanted: Option<TextureFormat>) -> Result<TextureFormat, DeviceError> {
    let blends_f32 = device.features().contains(Features::FLOAT32_BLENDABLE);
    match wanted {
        Some(TextureFormat::Rgba32Float) if !blends_f32 => {
            Err(DeviceError::MissingFeatures { required: Features::FLOAT32_BLENDABLE, actual: device.features() })
        }
        Some(format @ (TextureFormat::Rgba32Float | TextureFormat::Rgba16Float)) => Ok(format),
        Some(format) => Err(DeviceError::Unsupported {
            option: "sheet_format",
            found: format!("{format:?}"),
            allowed: "Rgba32Float or Rgba16Float".to_owned(),
        }),
        None if blends_f32 => Ok(TextureFormat::Rgba32Float),
        None => Ok(TextureFormat::Rgba16Float),
    }
}
