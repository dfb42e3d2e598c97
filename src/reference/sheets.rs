//! The assignment of splats to sheets, and the order of sheets: the f64 evaluation of `src/lists/bucket.rs`.

use std::collections::BTreeMap;

use super::{Geometry, Splat};
use crate::kernel::Kernel;
use crate::settings::splatting::Method;

/// For every sheet that has splats, their indices, front to back: image-aligned by slab (§3.2), axis-aligned by slice (§3.1).
/// Composite-every-sample has no sheets.
///
/// `voxels` are the splats' indices in memory.
pub fn buckets(voxels: &[u32], splats: &[Splat], geometry: &Geometry, kernel: &Kernel) -> BTreeMap<i32, Vec<u32>> {
    let mut buckets = BTreeMap::<i32, Vec<u32>>::new();
    for ((&voxel, splat), index) in voxels.iter().zip(splats).zip(0..) {
        let touched = match geometry.method {
            Method::ImageAligned => geometry.drawn_slabs(splat, kernel.radius()),
            Method::AxisAligned => {
                let slice = geometry.slice(geometry.grid.voxel_at(voxel));
                slice..slice + 1
            }
            Method::CompositeEverySample => 0..0,
        };
        touched.for_each(|k| buckets.entry(k).or_default().push(index));
    }
    buckets
}

/// The order in which voxels are composited one by one (§3, Westover's first form), nearest first: by depth along w, then by index in
/// memory.
///
/// The depth along w, not the distance from the eye, also counts in perspective. Voxels whose footprints overlap lie nearly on one ray,
/// where both give the same order; and so slabs, slices and voxels share one order, which becomes the orthographic one as the eye recedes.
/// Depths are rounded (to 2⁻²⁰ units), so that rounding errors do not decide the order at 45°.
pub fn by_depth(voxels: &[u32], geometry: &Geometry) -> Vec<u32> {
    let depth = |&index: &u32| {
        let voxel = geometry.grid.voxel_at(voxels[index as usize]);
        (geometry.depth_along_w(voxel) * f64::from(1 << 20)).round() as i64
    };
    let mut order: Vec<u32> = (0..voxels.len() as u32).collect();
    order.sort_by_cached_key(depth);
    order
}
