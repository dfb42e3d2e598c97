//! How a program without a host opens its device: what the command line and a window of its own share.

use std::sync::OnceLock;

use wgpu::{Adapter, AdapterInfo, Backends, DeviceType, Instance, InstanceDescriptor, InstanceFlags};

use crate::gpu::device::DeviceError;

/// The instance of a program of its own: the drivers that can run the renderer, and what the environment says.
pub fn instance_descriptor() -> InstanceDescriptor {
    let mut descriptor = InstanceDescriptor::new_without_display_handle_from_env();
    // Our own arguments need no validating dispatch before every indirect call.
    descriptor.flags -= InstanceFlags::VALIDATION_INDIRECT_CALL;
    descriptor.backends &= Backends::PRIMARY;
    descriptor
}

/// The adapters of [`instance_descriptor`]'s instance.
pub fn adapters() -> Vec<Adapter> {
    // One for all, as only within an instance devices can be told from one another.
    static INSTANCE: OnceLock<Instance> = OnceLock::new();
    let instance = INSTANCE.get_or_init(|| Instance::new(instance_descriptor()));
    pollster::block_on(instance.enumerate_adapters(Backends::PRIMARY))
}

/// An adapter's driver, and its version where it tells.
pub fn driver_name(info: &AdapterInfo) -> String {
    format!("{} {}", info.driver, info.driver_info).trim().to_owned()
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
