//! The device's features and limits: what the renderer requires, and what it uses if available.

use wgpu::{Adapter, Device, DeviceDescriptor, Features, Limits, TextureFormat};

use super::layout::FOLD;
use super::volume_texture;
pub use crate::error::device::{DeviceError, InsufficientLimit};

/// Features that the renderer uses if the device has them. It requires none of them.
pub const WANTED_FEATURES: Features = Features::FLOAT32_BLENDABLE.union(Features::TIMESTAMP_QUERY).union(TILE_FEATURES);

/// Features that the tile rasterizer uses. It requires none of them.
pub const TILE_FEATURES: Features = Features::SUBGROUP.union(Features::SUBGROUP_BARRIER);

/// Features and limits of a device.
#[derive(Clone, Debug, PartialEq)]
pub struct DeviceRequirements {
    /// The features to request.
    pub features: Features,
    /// The limits to request.
    pub limits: Limits,
}

impl DeviceRequirements {
    /// The minimum for any frame, which is less than WebGPU's defaults. Further requirements of an image or a volume are checked when it is
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
            // All other limits are at most those of WebGL 2, without compute shaders and storage buffers.
            ..Limits::downlevel_webgl2_defaults()
        },
    };

    /// The features and limits to request from an adapter for the best rendering: WebGPU's default limits, raised where the adapter allows larger
    /// images and volumes, and lowered where it has less. [`Self::check`] tells whether that suffices.
    pub fn for_adapter(adapter: &Adapter) -> Self {
        let available = adapter.limits();
        let limits = Limits {
            max_texture_dimension_2d: available.max_texture_dimension_2d,
            max_texture_array_layers: available.max_texture_array_layers,
            max_buffer_size: available.max_buffer_size,
            max_compute_workgroup_storage_size: available.max_compute_workgroup_storage_size,
            max_storage_buffer_binding_size: available.max_storage_buffer_binding_size,
            // Four sheets of `Rgba32Float`.
            max_color_attachment_bytes_per_sample: 64,
            ..Limits::default()
        };
        Self { features: adapter.features() & WANTED_FEATURES, limits: limits.or_worse_values_from(&available) }
    }

    /// Adds the features to a host's descriptor, and sets each limit to the better of both.
    pub fn merge_into(&self, descriptor: &mut DeviceDescriptor<'_>) {
        descriptor.required_features |= self.features;
        descriptor.required_limits = descriptor.required_limits.clone().or_better_values_from(&self.limits);
    }

    /// Checks that a device can run every pass: that it has at least [`Self::LEAST`].
    ///
    /// # Errors
    /// [`DeviceError::Limits`] with every insufficient limit, the required value and the device's value.
    pub fn check(device: &Device) -> Result<(), DeviceError> {
        let insufficient = Self::insufficient(&device.limits());
        if insufficient.is_empty() { Ok(()) } else { Err(DeviceError::Limits(insufficient)) }
    }

    /// Every limit that is worse than in [`Self::LEAST`].
    pub fn insufficient(limits: &Limits) -> Vec<InsufficientLimit> {
        let mut insufficient = Vec::new();
        Self::LEAST.limits.check_limits_with_fail_fn(limits, false, |limit, required, actual| {
            insufficient.push(InsufficientLimit { limit, required, actual });
        });
        insufficient
    }
}

/// The number of sheets that one quad draws: `wanted` if stated, or else as many as the device's colour attachments allow, up to 4.
///
/// # Errors
/// If `wanted` is not 1, 2 or 4, or the device does not allow it.
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

/// The format of sheet buffers: `wanted` if stated, or else `Rgba32Float` if the device can blend that, or else `Rgba16Float`.
///
/// # Errors
/// If `wanted` is neither of these two, or the device cannot blend it.
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
