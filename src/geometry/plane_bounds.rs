//! The screen bounds of voxels' kernels on slab planes.

use glam::{DVec2, DVec3};

use super::plane_geometry::PlaneGeometry;
use crate::geometry::view_geometry::{Bounds, ViewGeometry};

impl PlaneGeometry {
    /// The bounds of a box of voxels, given its middle and half its extent in voxel indices: the pixels of the points nearest to the voxels, on the
    /// planes that their kernels reach, and these planes' sheet depths. `None` if all of the planes lie before the near plane.
    pub fn bounds(&self, view: &ViewGeometry, middle: DVec3, half: DVec3) -> Option<Bounds> {
        let Some(perspective) = &view.perspective else { return view.bounds(middle, half) };
        let (row, width, origin) = (view.screen_from_voxel[2], view.slabs.width, view.slabs.origin);
        let (depth, reach) =
            (row.dot(middle.extend(1.0)), row.truncate().abs().dot(half) + view.radius / self.per_depth);
        // The first plane that counts is the one before the near plane, and no plane has a value at the eye.
        let first_slab = ((perspective.eye.near / width).floor() - 1.0).max(0.0);
        let depths = (depth - reach).max(origin + first_slab * width)..depth + reach;
        if depths.is_empty() {
            return None;
        }
        let first = ((depths.start - origin) / width).floor() + 1.0;
        let last = ((depths.end - origin) / width).ceil().max(first);
        let half_image = DVec2::from(view.size.map(f64::from)) / 2.0;
        let mut bounds = Bounds { low: DVec2::INFINITY, high: DVec2::NEG_INFINITY, depths };
        // From plane to plane the point moves in one direction.
        for from_eye in [first * width, last * width] {
            let ends = [(0, self.step.x), (1, self.step.y)].map(|(row, step)| {
                let step = step * self.per_depth;
                let row = view.screen_from_voxel[row] - step * view.screen_from_voxel[2];
                let at = row.dot(middle.extend(1.0)) + step * (origin + from_eye);
                let spread = row.truncate().abs().dot(half);
                [(at - spread) / from_eye, (at + spread) / from_eye]
            });
            let [[left, right], [top, bottom]] = ends;
            bounds.low = bounds.low.min(DVec2::new(left, top) + half_image);
            bounds.high = bounds.high.max(DVec2::new(right, bottom) + half_image);
        }
        Some(bounds)
    }

    /// Half the screen box in pixels of a kernel of the radius `support` on a plane at a depth from the eye, around the voxel's nearest point.
    pub fn footprint_half_box(&self, support: f64, from_eye: f64) -> DVec2 {
        let reach = support / (self.per_pixel * from_eye).min(DVec2::ONE);
        let (first, second) = (self.screen_axis * reach.x, self.screen_axis.perp() * reach.y);
        (first * first + second * second).map(f64::sqrt)
    }
}
