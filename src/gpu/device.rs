//! What the renderer needs of a device, and what it makes of one that has more.

use wgpu::{
    Adapter, Backends, Device, DeviceType, ErrorFilter, Features, InstanceDescriptor, InstanceFlags, Limits,
    TextureFormat,
};

use super::volume_texture;

/// Why no device could be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DeviceError {
    /// There is no adapter, or none with the requested name.
    #[error("no GPU adapter: required {required}, actual: {actual}")]
    NoAdapter {
        /// What was asked for.
        required: String,
        /// What there is.
        actual: String,
    },
    /// The adapter refused to make a device.
    #[error("adapter \"{adapter}\" gave no device: {source}")]
    RequestDevice {
        /// The adapter's name.
        adapter: String,
        /// What wgpu said.
        source: wgpu::RequestDeviceError,
    },
    /// The device could not compile the renderer.
    #[error("adapter \"{adapter}\" cannot run the renderer: {error}")]
    Pipelines {
        /// The adapter's name.
        adapter: String,
        /// What wgpu said.
        error: String,
    },
    /// A feature is missing that the options ask for.
    #[error("device feature: required {required:?}, actual: {actual:?}")]
    MissingFeatures {
        /// What is needed.
        required: Features,
        /// What the device has.
        actual: Features,
    },
    /// A limit is below what every frame needs.
    #[error("device limit {limit}: required {required}, actual: {actual}")]
    Limit {
        /// wgpu's name of the limit.
        limit: &'static str,
        /// What is needed.
        required: u64,
        /// What the device has.
        actual: u64,
    },
}

/// Features that the renderer uses where a device has them. None is required.
pub const WANTED_FEATURES: Features =
    Features::FLOAT32_BLENDABLE.union(Features::TIMESTAMP_QUERY).union(Features::SUBGROUP);

/// Features and limits for a device that renders as well as the adapter can: to be merged into a device descriptor.
#[derive(Clone, Debug)]
pub struct DeviceRequirements {
    /// Features to request.
    pub features: Features,
    /// Limits to request.
    pub limits: Limits,
}

impl DeviceRequirements {
    /// What to request from this adapter: WebGPU's default limits, raised where the adapter allows larger images and
    /// volumes.
    pub fn for_adapter(adapter: &Adapter) -> Self {
        let available = adapter.limits();
        let limits = Limits {
            max_texture_dimension_2d: available.max_texture_dimension_2d,
            max_texture_array_layers: available.max_texture_array_layers,
            max_buffer_size: available.max_buffer_size,
            max_storage_buffer_binding_size: available.max_storage_buffer_binding_size,
            // Four sheets of RGBA32F.
            max_color_attachment_bytes_per_sample: available.max_color_attachment_bytes_per_sample.min(64),
            ..Limits::default()
        };
        Self { features: adapter.features() & WANTED_FEATURES, limits }
    }
}

/// Checks that a device can run every pass.
///
/// # Errors
/// If a limit is too small; the error says required and actual.
pub fn check(device: &Device) -> Result<(), DeviceError> {
    let limits = device.limits();
    let needs: [(&'static str, u64, u64); 9] = [
        ("max_texture_dimension_2d", volume_texture::SIDE.into(), limits.max_texture_dimension_2d.into()),
        ("max_texture_array_layers", 128, limits.max_texture_array_layers.into()),
        ("max_storage_buffers_per_shader_stage", 8, limits.max_storage_buffers_per_shader_stage.into()),
        ("max_uniform_buffers_per_shader_stage", 2, limits.max_uniform_buffers_per_shader_stage.into()),
        (
            "max_dynamic_uniform_buffers_per_pipeline_layout",
            1,
            limits.max_dynamic_uniform_buffers_per_pipeline_layout.into(),
        ),
        ("max_compute_invocations_per_workgroup", 256, limits.max_compute_invocations_per_workgroup.into()),
        ("max_compute_workgroup_size_x", 256, limits.max_compute_workgroup_size_x.into()),
        ("max_compute_workgroups_per_dimension", 32768, limits.max_compute_workgroups_per_dimension.into()),
        ("max_color_attachment_bytes_per_sample", 16, limits.max_color_attachment_bytes_per_sample.into()),
    ];
    match needs.into_iter().find(|(_, required, actual)| actual < required) {
        Some((limit, required, actual)) => Err(DeviceError::Limit { limit, required, actual }),
        None => Ok(()),
    }
}

/// How many sheets one quad can draw into: as many colour attachments as the device allows, up to 4.
pub fn sheets_per_group(device: &Device, format: TextureFormat) -> u32 {
    let limits = device.limits();
    let bytes = format.target_pixel_byte_cost().unwrap_or(16);
    match limits.max_color_attachments.min(limits.max_color_attachment_bytes_per_sample / bytes) {
        0 | 1 => 1,
        2 | 3 => 2,
        _ => 4,
    }
}

/// The format of sheet buffers: `wanted` if given, else `Rgba32Float` where that can be blended, else `Rgba16Float`.
///
/// # Errors
/// If `wanted` is `Rgba32Float` and the device cannot blend it.
pub fn sheet_format(device: &Device, wanted: Option<TextureFormat>) -> Result<TextureFormat, DeviceError> {
    let blends_f32 = device.features().contains(Features::FLOAT32_BLENDABLE);
    match wanted {
        Some(TextureFormat::Rgba32Float) if !blends_f32 => {
            Err(DeviceError::MissingFeatures { required: Features::FLOAT32_BLENDABLE, actual: device.features() })
        }
        Some(format) => Ok(format),
        None if blends_f32 => Ok(TextureFormat::Rgba32Float),
        None => Ok(TextureFormat::Rgba16Float),
    }
}

/// The instance of a program of its own: the drivers that can run the renderer, and what the environment says.
pub fn instance_descriptor() -> InstanceDescriptor {
    let mut descriptor = InstanceDescriptor::new_without_display_handle_from_env();
    // Our own arguments need no validating dispatch before every indirect call.
    descriptor.flags -= InstanceFlags::VALIDATION_INDIRECT_CALL;
    descriptor.backends &= Backends::PRIMARY;
    descriptor
}

/// The adapter with `name` in its name, in any case, or the most capable one: a GPU before a software driver.
///
/// # Errors
/// If there is none.
pub fn choose_adapter(adapters: &[Adapter], name: Option<&str>) -> Result<Adapter, DeviceError> {
    let names: Vec<String> = adapters.iter().map(|adapter| adapter.get_info().name).collect();
    let wanted = |adapter: &&Adapter| {
        name.is_none_or(|name| adapter.get_info().name.to_lowercase().contains(&name.to_lowercase()))
    };
    let rank = |adapter: &&Adapter| match adapter.get_info().device_type {
        DeviceType::DiscreteGpu => 0,
        DeviceType::IntegratedGpu => 1,
        DeviceType::VirtualGpu => 2,
        DeviceType::Cpu => 3,
        DeviceType::Other => 4,
    };
    adapters.iter().filter(wanted).min_by_key(rank).cloned().ok_or_else(|| DeviceError::NoAdapter {
        required: name.map_or("any Vulkan, Metal or DirectX 12 adapter".to_owned(), |name| format!("\"{name}\"")),
        actual: if names.is_empty() { "none".to_owned() } else { names.join(", ") },
    })
}

/// The result of `work`, and the first error that the device reported meanwhile, if any.
pub fn scoped<T>(device: &Device, work: impl FnOnce() -> T) -> (T, Option<String>) {
    let scopes = [ErrorFilter::Validation, ErrorFilter::OutOfMemory, ErrorFilter::Internal]
        .map(|filter| device.push_error_scope(filter));
    let result = work();
    // Scopes are a stack: the last pushed is the first popped. All must be popped even after an error.
    let errors: Vec<_> = scopes.into_iter().rev().filter_map(|scope| pollster::block_on(scope.pop())).collect();
    (result, errors.first().map(ToString::to_string))
}
