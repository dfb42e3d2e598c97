//! The threads that draw a patch of the tile rasterizer together, on different devices.

use std::ops::RangeInclusive;

use wgpu::{Device, DeviceType, Features};

use crate::gpu::shaders::Lanes;
use crate::lists::patch_bins::PATCH;

/// The number of threads that hold a patch, four pixels each.
pub(super) const PATCH_THREADS: u32 = PATCH[0] * PATCH[1] / 4;

/// The number of threads in a workgroup: those of the largest subgroup, but at most those that hold a patch.
pub(super) fn threads(device: &Device) -> u32 {
    let least = if lanes(device) == Lanes::Workgroup { LEAST_LANES } else { 1 };
    device.adapter_info().subgroup_max_size.clamp(least, PATCH_THREADS)
}

/// The least number of threads that draw a patch together on a device.
pub(crate) fn least_lanes(device: &Device) -> u32 {
    let smallest = device.adapter_info().subgroup_min_size;
    if lanes(device) == Lanes::Workgroup { threads(device) } else { smallest }
}

/// The least threads of a workgroup that is not divided into subgroups.
const LEAST_LANES: u32 = 8;

/// The sizes of subgroups that draw patches.
const SUBGROUP_SIZES: RangeInclusive<u32> = 4..=64;

/// The threads that draw a patch together on a device.
pub(crate) fn lanes(device: &Device) -> Lanes {
    let info = device.adapter_info();
    let sizes = [info.subgroup_min_size, info.subgroup_max_size];
    lanes_of(device.features(), sizes, info.device_type == DeviceType::Cpu)
}

/// The same for a device with some features, and subgroups of these least and most threads. Where a subgroup is a workgroup, barriers of workgroups serve as well. Some devices
/// have no others, and GPUs need only make what a thread has written to workgroup memory visible to the others at these. A software driver, which keeps
/// the order of reads and writes, takes 1.1 to 1.2 times as long with them.
fn lanes_of(features: Features, sizes: [u32; 2], is_software: bool) -> Lanes {
    let has_subgroups = features.contains(Features::SUBGROUP) && sizes.iter().all(|size| SUBGROUP_SIZES.contains(size));
    let is_only = sizes[0] >= sizes[1].min(PATCH_THREADS);
    match features.contains(Features::SUBGROUP_BARRIER) {
        true if has_subgroups && (is_software || !is_only) => Lanes::Subgroup,
        _ if has_subgroups && is_only => Lanes::OnlySubgroup,
        _ => Lanes::Workgroup,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Devices as they are: Vulkan on NVIDIA, AMD and Intel, DirectX 12 on these, where subgroups have no barriers, lavapipe, and devices without
    /// subgroups or with others.
    #[test]
    fn every_device_has_lanes() {
        let with_barriers = Features::SUBGROUP | Features::SUBGROUP_BARRIER;
        let none = Features::empty();
        for (features, sizes, is_software, expected) in [
            (with_barriers, [32, 32], false, Lanes::OnlySubgroup),
            (with_barriers, [32, 64], false, Lanes::OnlySubgroup),
            (with_barriers, [64, 64], false, Lanes::OnlySubgroup),
            (with_barriers, [8, 32], false, Lanes::Subgroup),
            (with_barriers, [4, 64], false, Lanes::Subgroup),
            (with_barriers, [8, 8], true, Lanes::Subgroup),
            (with_barriers, [2, 32], false, Lanes::Workgroup),
            (with_barriers, [32, 128], false, Lanes::Workgroup),
            (Features::SUBGROUP, [8, 8], true, Lanes::OnlySubgroup),
            (Features::SUBGROUP, [32, 64], false, Lanes::OnlySubgroup),
            (Features::SUBGROUP, [8, 32], false, Lanes::Workgroup),
            (Features::SUBGROUP_BARRIER, [32, 32], false, Lanes::Workgroup),
            (none, [32, 32], false, Lanes::Workgroup),
            (none, [4, 128], false, Lanes::Workgroup),
        ] {
            assert_eq!(lanes_of(features, sizes, is_software), expected, "{features:?}, {sizes:?}, {is_software}");
        }
    }
}
