//! How a program without a host opens its device; the command line and a program's own window share this.

use std::sync::OnceLock;

use wgpu::{Adapter, AdapterInfo, Backends, DeviceType, Instance, InstanceDescriptor, InstanceFlags};

use super::driver;
use crate::gpu::device::{DeviceError, DeviceRequirements, InsufficientLimit};

/// The instance for a program without a host: the drivers that can run the renderer, with the environment's overrides.
pub fn instance_descriptor() -> InstanceDescriptor {
    let mut descriptor = InstanceDescriptor::new_without_display_handle_from_env();
    // Validation adds a dispatch before every indirect call; our own arguments need none.
    descriptor.flags -= InstanceFlags::VALIDATION_INDIRECT_CALL;
    descriptor.backends &= Backends::PRIMARY;
    descriptor
}

/// The adapters of [`instance_descriptor`]'s instance.
pub fn adapters() -> Vec<Adapter> {
    // There is a single instance, because devices can be told apart only within an instance.
    static INSTANCE: OnceLock<Instance> = OnceLock::new();
    let instance = INSTANCE.get_or_init(|| Instance::new(instance_descriptor()));
    pollster::block_on(instance.enumerate_adapters(Backends::PRIMARY))
}

/// Whether there is a GPU that can run the renderer, and not only a software driver.
pub fn has_gpu() -> bool {
    has_device_file()
        && adapters().iter().any(|adapter| {
            let is_software = adapter.get_info().device_type == DeviceType::Cpu;
            !is_software
                && DeviceRequirements::insufficient(&DeviceRequirements::for_adapter(adapter).limits).is_empty()
        })
}

/// Whether the kernel shows a GPU: without one, no driver need be loaded.
fn has_device_file() -> bool {
    let any = |folder: &str, start: &str| {
        let mut entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        entries.any(|entry| entry.file_name().to_string_lossy().starts_with(start))
    };
    // The kernel's own drivers, NVIDIA's, Windows' under WSL, and Mali's have files of their own.
    let has = || {
        [("/dev/dri", "renderD"), ("/dev", "nvidia"), ("/dev", "dxg"), ("/dev", "mali")]
            .iter()
            .any(|&(folder, start)| any(folder, start))
    };
    cfg!(not(target_os = "linux")) || has()
}

/// An adapter's driver, and its version where it tells.
pub fn driver_name(info: &AdapterInfo) -> String {
    format!("{} {}", info.driver, info.driver_info).trim().to_owned()
}

/// The properties by which an adapter is chosen.
#[derive(Clone, Debug, PartialEq)]
struct Candidate {
    name: String,
    device_type: DeviceType,
    /// The limits that make it unusable.
    insufficient: Vec<InsufficientLimit>,
}

/// The adapter with `name` in its name, ignoring case, or the most capable one: an adapter that can run the renderer before one that
/// cannot, and a GPU before a software driver. If a software driver replaces a GPU that cannot run the renderer, this is logged.
///
/// # Errors
/// If there is no such adapter.
pub fn choose_adapter(adapters: &[Adapter], name: Option<&str>) -> Result<Adapter, DeviceError> {
    let candidate = |adapter: &Adapter| {
        let AdapterInfo { name, device_type, .. } = adapter.get_info();
        let insufficient = DeviceRequirements::insufficient(&DeviceRequirements::for_adapter(adapter).limits);
        Candidate { name, device_type, insufficient }
    };
    let candidates: Vec<Candidate> = adapters.iter().map(candidate).collect();
    match choose(&candidates, name) {
        Some((at, passed_over)) => {
            if let Some(note) = passed_over.map(|gpu| note(&candidates[gpu], &candidates[at])) {
                log::warn!("{note}");
            }
            Ok(adapters[at].clone())
        }
        None => {
            let names: Vec<&str> = candidates.iter().map(|candidate| candidate.name.as_str()).collect();
            Err(DeviceError::NoAdapter {
                required: name
                    .map_or("any Vulkan, Metal or DirectX 12 adapter".to_owned(), |name| format!("\"{name}\"")),
                actual: if names.is_empty() { "none".to_owned() } else { names.join(", ") },
                advice: names.is_empty().then(driver::advice),
            })
        }
    }
}

/// The index of the chosen adapter, and that of the unusable GPU that it replaces if it is a software driver.
fn choose(candidates: &[Candidate], name: Option<&str>) -> Option<(usize, Option<usize>)> {
    let is_named =
        |at: &usize| name.is_none_or(|name| candidates[*at].name.to_lowercase().contains(&name.to_lowercase()));
    let rank = |at: usize| match candidates[at].device_type {
        DeviceType::DiscreteGpu => 0,
        DeviceType::IntegratedGpu => 1,
        DeviceType::VirtualGpu => 2,
        DeviceType::Cpu => 3,
        DeviceType::Other => 4,
    };
    let named = || (0..candidates.len()).filter(is_named);
    let chosen = named().min_by_key(|&at| (!candidates[at].insufficient.is_empty(), rank(at)))?;
    let is_software = candidates[chosen].device_type == DeviceType::Cpu;
    let best = named().min_by_key(|&at| rank(at)).filter(|&best| is_software && best != chosen);
    Some((chosen, best))
}

/// Why a software driver is used although there is a GPU.
fn note(gpu: &Candidate, chosen: &Candidate) -> String {
    let missing: Vec<String> = gpu.insufficient.iter().map(ToString::to_string).collect();
    format!(
        "{} cannot run the renderer ({}): {}, a software driver, is used",
        gpu.name,
        missing.join("; "),
        chosen.name
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn candidate(name: &str, device_type: DeviceType, is_sufficient: bool) -> Candidate {
        let limit = InsufficientLimit { limit: "max_buffer_size", required: 9, actual: 5 };
        let insufficient = if is_sufficient { Vec::new() } else { vec![limit] };
        Candidate { name: name.to_owned(), device_type, insufficient }
    }

    #[test]
    fn a_gpu_that_will_do_comes_first() {
        let card = candidate("GeForce", DeviceType::DiscreteGpu, true);
        let chip = candidate("Intel", DeviceType::IntegratedGpu, true);
        let software = candidate("llvmpipe (LLVM 15)", DeviceType::Cpu, true);
        let all = [software.clone(), chip, card];
        assert_eq!(choose(&all, None), Some((2, None)));
        assert_eq!(choose(&all[..2], None), Some((1, None)));
        assert_eq!(choose(&all[..1], None), Some((0, None)));
        assert_eq!(choose(&all, Some("LLVMpipe")), Some((0, None)));
        assert_eq!(choose(&all, Some("radeon")), None);
        assert_eq!(choose(&[], None), None);
    }

    #[test]
    fn a_gpu_that_will_not_do_is_passed_over() {
        let old_card = candidate("Old Card", DeviceType::DiscreteGpu, false);
        let chip = candidate("Intel", DeviceType::IntegratedGpu, true);
        let software = candidate("llvmpipe", DeviceType::Cpu, true);
        // If another GPU is usable there is no note.
        assert_eq!(choose(&[old_card.clone(), software.clone(), chip], None), Some((2, None)));
        assert_eq!(choose(&[software.clone(), old_card.clone()], None), Some((0, Some(1))));
        let expected = "Old Card cannot run the renderer (max_buffer_size: required 9, actual: 5): llvmpipe, a software driver, is used";
        assert_eq!(note(&old_card, &software), expected);
        // An adapter chosen by name is tested when it is opened.
        assert_eq!(choose(&[software.clone(), old_card.clone()], Some("card")), Some((1, None)));
        // A software driver that is unusable too does not replace the GPU.
        let weak = candidate("llvmpipe", DeviceType::Cpu, false);
        assert_eq!(choose(&[weak, old_card], None), Some((1, None)));
    }
}
