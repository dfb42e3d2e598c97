//! Where voxels are in a view, in f64: pixel coordinates, sheet depth, which slabs their kernels reach (SPEC §5); and how a kernel lies on
//! the screen. Every voxel of a brick is at the brick's first place and an offset that depends on its place alone.

use std::ops::Range;

use glam::{DVec2, DVec3, UVec3};

use super::queue::{BySlot, NO_SHEET};
use crate::geometry::slab;
use crate::geometry::view_geometry::{Perspective, ViewGeometry};
use crate::lists::brick::Brick;
use crate::lists::brick::{self, BRICK_VOXELS};
use crate::settings::splatting::Order;
use crate::volume::Grid;

/// Where a voxel is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// Pixel coordinates times `from_eye`, from the image's middle.
    x: f64,
    y: f64,
    /// Sheet depth, in slabs from plane 0.
    pub(super) depth: f64,
    /// The depth from the eye, `unit`s; 1 without one.
    pub(super) from_eye: f64,
}

impl Place {
    fn plus(self, other: Self) -> Self {
        let Self { x, y, depth, from_eye } = other;
        Self { x: self.x + x, y: self.y + y, depth: self.depth + depth, from_eye: self.from_eye + from_eye }
    }
}

/// How a kernel is seen along its voxel's ray: all that its sections have in common.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lens {
    /// Grid units along the kernel's ray to a slab's width.
    pub(super) per_slab: f64,
    /// 1/λ.
    pub(super) per_lambda: f64,
    /// The unit vector to the eye.
    pub(super) to_eye: DVec3,
    /// Of views with an eye.
    pub(super) local: Option<Local>,
}

/// How footprints lie on the screen in perspective (§3.3.2).
#[derive(Clone, Copy, Debug)]
pub(super) struct Local {
    /// The unit vector on the screen along one axis of the footprint's ellipse.
    pub(super) axis: DVec2,
    /// ρ² of one `unit` along that axis, and across it.
    pub(super) metric: DVec2,
    /// `(r·w)/λ`: the depth that one grid unit along the ray gains, `unit`s.
    pub(super) depth_per_warped: f64,
    /// Where the near plane cuts the kernel, grid units from its centre.
    pub(super) cut: f64,
}

/// Where the voxels of a brick are, from its first place, by slot.
#[derive(Clone, Debug)]
struct Offsets {
    x: BySlot<f64>,
    y: BySlot<f64>,
    depth: BySlot<f64>,
    from_eye: BySlot<f64>,
    /// In voxels along each axis.
    voxel: [BySlot<f64>; 3],
}

/// A frame's projection.
#[derive(Clone, Debug)]
pub(super) struct Projection {
    pub(super) view: ViewGeometry,
    /// 1, or -1 where sheets are numbered from the farthest on: in the order in which they are composited.
    pub(super) direction: i32,
    /// The sheets that are composited.
    pub(super) window: Range<i32>,
    /// The least sheet that a voxel begins in which reaches the window. Voxels begin where they do in a whole image, so that a part's sums are added
    /// up in the same order: the least difference would decide between equal sheets.
    least: i32,
    offsets: Offsets,
    /// The minimum and maximum depth of these offsets.
    depths: [f64; 2],
    /// How kernels are seen without perspective: all of them alike.
    pub(super) flat: Lens,
}

impl Projection {
    /// A frame of some of a view's slabs.
    pub(super) fn new(view: ViewGeometry, order: Order, slabs: &Range<i32>) -> Self {
        let direction = if order == Order::FrontToBack { 1 } else { -1 };
        let offset = |slot: usize| offset(&view, brick::in_brick(slot as u32).as_dvec3());
        let offsets = Offsets {
            x: std::array::from_fn(|slot| offset(slot).x),
            y: std::array::from_fn(|slot| offset(slot).y),
            depth: std::array::from_fn(|slot| offset(slot).depth),
            from_eye: std::array::from_fn(|slot| offset(slot).from_eye),
            voxel: [0, 1, 2].map(|axis| std::array::from_fn(|slot| brick::in_brick(slot as u32).as_dvec3()[axis])),
        };
        let depths = offsets
            .depth
            .iter()
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], &depth| [low.min(depth), high.max(depth)]);
        let per_slab = whole_kernel(&view);
        let flat = Lens { per_slab, per_lambda: 1.0 / view.lambda, to_eye: -view.basis.w, local: None };
        let window = sheets_of(direction, slabs);
        let span = (2.0 * view.reach / view.slabs.width).ceil() as i32 + 1;
        Self { direction, least: window.start - span, window, offsets, depths, flat, view }
    }

    /// Where a brick's first place is.
    pub(super) fn of_brick(&self, brick: &Brick) -> Place {
        let rows = self.view.screen_from_voxel;
        let [x, y, depth, from_eye] = rows.map(|row| row.dot(brick::origin(brick).as_dvec3().extend(1.0)));
        Place { x, y, depth: (depth - self.view.slabs.origin) / self.view.slabs.width, from_eye }
    }

    /// Where one of a brick's voxels is.
    pub(super) fn of_voxel(&self, brick: Place, slot: u32) -> Place {
        let Offsets { x, y, depth, from_eye, .. } = &self.offsets;
        let slot = slot as usize;
        brick.plus(Place { x: x[slot], y: y[slot], depth: depth[slot], from_eye: from_eye[slot] })
    }

    /// The offset from coordinates relative to the image's middle to coordinates relative to the centre of a tile's first pixel, `origin`.
    pub(super) fn shift(&self, origin: [usize; 2]) -> [f64; 2] {
        std::array::from_fn(|axis| f64::from(self.view.size[axis]) / 2.0 - 0.5 - origin[axis] as f64)
    }

    /// The pixel coordinates of one of a brick's voxels in a tile, given the tile's [`Self::shift`].
    #[inline(always)]
    pub(super) fn center(&self, brick: Place, slot: u32, shift: [f64; 2]) -> [f32; 2] {
        let slot = slot as usize % BRICK_VOXELS as usize;
        let (x, y) = (brick.x + self.offsets.x[slot], brick.y + self.offsets.y[slot]);
        match self.view.perspective {
            None => [(x + shift[0]) as f32, (y + shift[1]) as f32],
            Some(_) => {
                let from_eye = brick.from_eye + self.offsets.from_eye[slot];
                [(x / from_eye + shift[0]) as f32, (y / from_eye + shift[1]) as f32]
            }
        }
    }

    /// The sections that a voxel without perspective has from a sheet on: the distance from the voxel to the plane where they begin, grid units along
    /// its ray, and the end of its range of sheets.
    #[inline(always)]
    pub(super) fn flat_sections(&self, brick: Place, slot: u32, sheet: i32) -> (f32, i32) {
        let depth = brick.depth + self.offsets.depth[slot as usize % BRICK_VOXELS as usize];
        let reach = self.view.reach / self.view.slabs.width;
        let first_plane = ((self.plane_before(sheet) - depth) * self.flat.per_slab) as f32;
        (first_plane, self.numbered(depth - reach, depth + reach).end)
    }

    /// The plane at which a sheet begins, in the order of compositing.
    pub(super) fn plane_before(&self, sheet: i32) -> f64 {
        let plane = f64::from(self.direction) * f64::from(sheet);
        if self.direction > 0 { plane } else { plane + 1.0 }
    }

    /// The sheets that a voxel's kernel overlaps, in the order in which they are composited; none before the near plane.
    #[inline]
    pub(super) fn sheets(&self, place: Place, voxel: UVec3) -> Range<i32> {
        match &self.view.perspective {
            Some(perspective) => self.sheets_of_eye(perspective, (place.depth, place.from_eye), voxel.as_dvec3()),
            None => {
                let reach = self.view.reach / self.view.slabs.width;
                self.numbered(place.depth - reach, place.depth + reach)
            }
        }
    }

    /// The same in perspective, given the voxel's sheet depth in slabs and its depth from the eye. Without a branch, so that loops are vectorized.
    #[inline(always)]
    fn sheets_of_eye(
        &self,
        Perspective { eye, eye_voxel, is_image_aligned, .. }: &Perspective,
        (depth, from_eye): (f64, f64),
        voxel: DVec3,
    ) -> Range<i32> {
        // (r·w)/λ is the depth over the distance in voxels: a length by the root that is vectorized, which the crate's is not.
        let along_ray = self.view.radius * from_eye / (voxel - eye_voxel).length_squared().sqrt();
        let before = if *is_image_aligned { along_ray.min(from_eye - eye.near) } else { self.view.reach };
        let behind = if *is_image_aligned { along_ray } else { self.view.reach };
        let width = self.view.slabs.width;
        let Range { start, end } = self.numbered(depth - before / width, depth + behind / width);
        let is_behind_near = from_eye > eye.near;
        if is_behind_near { start..end } else { 0..0 }
    }

    /// The first sheets of a brick's voxels by slot, those of empty slots too where that is faster; [`NO_SHEET`] for none.
    #[inline(always)]
    pub(super) fn first_sheets(&self, brick: &Brick, place: Place) -> BySlot<i32> {
        let mut first = [NO_SHEET; BRICK_VOXELS as usize];
        if self.view.perspective.is_none() {
            let reach = self.view.reach / self.view.slabs.width;
            let [lowest, highest] = self.depths.map(|offset| place.depth + offset);
            if self.is_uncut(&self.unclipped(lowest - reach, highest + reach)) {
                // Every voxel has sheets, so that only the start of its range is needed.
                for (first, offset) in first.iter_mut().zip(&self.offsets.depth) {
                    let depth = place.depth + offset;
                    *first = match self.direction > 0 {
                        true => first_plane(depth - reach),
                        false => 1 - end_plane(depth + reach),
                    };
                }
                return first;
            }
            for (first, offset) in first.iter_mut().zip(&self.offsets.depth) {
                let depth = place.depth + offset;
                let sheets = self.numbered(depth - reach, depth + reach);
                *first = if sheets.start < sheets.end { sheets.start } else { NO_SHEET };
            }
            return first;
        }
        let [starts, ends] = self.in_perspective(brick, place);
        for (first, (start, end)) in first.iter_mut().zip(starts.into_iter().zip(ends)) {
            *first = if start < end { start } else { NO_SHEET };
        }
        first
    }

    /// The starts and ends of [`Self::sheets`] of a brick's voxels in perspective, by slot; of empty slots any.
    #[inline(always)]
    fn in_perspective(&self, brick: &Brick, place: Place) -> [BySlot<i32>; 2] {
        let mut sheets = [[0; BRICK_VOXELS as usize]; 2];
        let Some(perspective) = &self.view.perspective else { return sheets };
        let origin = brick::origin(brick).as_dvec3();
        let Offsets { depth, from_eye, voxel: [x, y, z], .. } = &self.offsets;
        let [starts, ends] = &mut sheets;
        for slot in 0..BRICK_VOXELS as usize {
            let depths = (place.depth + depth[slot], place.from_eye + from_eye[slot]);
            let voxel = origin + DVec3::new(x[slot], y[slot], z[slot]);
            Range { start: starts[slot], end: ends[slot] } = self.sheets_of_eye(perspective, depths, voxel);
        }
        sheets
    }

    /// The number of sheets that each of a brick's voxels overlaps, by slot; of empty slots any number.
    #[inline(always)]
    pub(super) fn sections(&self, brick: &Brick, place: Place) -> BySlot<u32> {
        let mut sections = [0; BRICK_VOXELS as usize];
        if self.view.perspective.is_some() {
            let [starts, ends] = self.in_perspective(brick, place);
            for (sections, (start, end)) in sections.iter_mut().zip(starts.into_iter().zip(ends)) {
                *sections = end.saturating_sub(start).max(0) as u32;
            }
            return sections;
        }
        // All slots, without a branch, so that the loop is vectorized.
        let reach = self.view.reach / self.view.slabs.width;
        for (sections, offset) in sections.iter_mut().zip(&self.offsets.depth) {
            let depth = place.depth + offset;
            let Range { start, end } = self.numbered(depth - reach, depth + reach);
            *sections = end.saturating_sub(start).max(0) as u32;
        }
        sections
    }

    /// Slabs between two depths by more than rounding errors ([`slab::ROUNDING`]), as sheets, up to the last that is composited; none if they end
    /// before the first.
    #[inline(always)]
    fn numbered(&self, first: f64, end: f64) -> Range<i32> {
        let Range { start, end } = self.unclipped(first, end);
        self.reaching(start, end)
    }

    /// The same of all sheets.
    #[inline(always)]
    fn unclipped(&self, first: f64, end: f64) -> Range<i32> {
        let (first, end) = (first_plane(first), end_plane(end));
        if self.direction > 0 { first..end } else { 1 - end..1 - first }
    }

    /// Whether all of these sheets are composited; then [`Self::reaching`] clips no range among them.
    fn is_uncut(&self, sheets: &Range<i32>) -> bool {
        sheets.start >= self.window.start && sheets.end <= self.window.end
    }

    #[inline(always)]
    fn reaching(&self, first: i32, end: i32) -> Range<i32> {
        first.max(self.least)..if end > self.window.start { end.min(self.window.end) } else { i32::MIN }
    }

    /// A brick's range of slabs as sheets, as for voxels.
    pub(super) fn reached(&self, slabs: &Range<i32>) -> Range<i32> {
        let sheets = sheets_of(self.direction, slabs);
        self.reaching(sheets.start, sheets.end)
    }

    /// A range of slabs as sheets, of those that are composited.
    pub(super) fn sheets_of(&self, slabs: &Range<i32>) -> Range<i32> {
        let sheets = sheets_of(self.direction, slabs);
        sheets.start.max(self.window.start)..sheets.end.min(self.window.end)
    }

    /// What voxels are sorted by that are composited one by one: their depth along w. Depths that differ by less than rounding errors may
    /// (2⁻²⁰ `unit`s) are equal.
    pub(super) fn depth_key(&self, grid: &Grid, voxel: UVec3) -> i64 {
        let from = self.view.perspective.map_or(self.view.center, |perspective| perspective.eye.position);
        let depth = (grid.world_position(voxel) / grid.unit() - from).dot(self.view.basis.w);
        (depth * f64::from(1 << 20)).round() as i64
    }

    /// How a voxel's kernel is seen from an eye.
    #[inline]
    pub(super) fn lens(&self, perspective: &Perspective, place: Place, voxel: UVec3) -> Lens {
        let view = &self.view;
        let Perspective { eye, eye_voxel, aspect, is_image_aligned, .. } = perspective;
        // In voxels and in `unit`s: the warped ray and the ray.
        let warped = voxel.as_dvec3() - eye_voxel;
        let ray = warped * *aspect;
        let (distance_warped, distance) = (warped.length(), ray.length());
        let ro = warped / distance_warped;
        let per_depth = distance_warped / place.from_eye;
        // Footprint coordinates are offsets parallel to the image, warped, without what is along the ray: crossed with its direction.
        let right = (view.basis.u / *aspect).cross(ro);
        let down = (-view.basis.v / *aspect).cross(ro);
        let axis = principal_axis(right.length_squared() - down.length_squared(), 2.0 * right.dot(down));
        let along = axis.x * right + axis.y * down;
        let across = axis.x * down - axis.y * right;
        let local = Local {
            axis,
            metric: DVec2::new(along.length_squared(), across.length_squared()),
            depth_per_warped: 1.0 / per_depth,
            cut: (eye.near - place.from_eye) * per_depth,
        };
        Lens {
            per_slab: if *is_image_aligned { view.slabs.width * per_depth } else { whole_kernel(view) },
            per_lambda: distance / distance_warped,
            to_eye: -ray / distance,
            local: Some(local),
        }
    }
}

/// A range of slabs as sheets, which are numbered in the order of compositing.
fn sheets_of(direction: i32, slabs: &Range<i32>) -> Range<i32> {
    if direction > 0 { slabs.clone() } else { 1 - slabs.end..1 - slabs.start }
}

/// The place of an offset in voxels.
fn offset(view: &ViewGeometry, voxels: DVec3) -> Place {
    let [x, y, depth, from_eye] = view.screen_from_voxel.map(|row| row.truncate().dot(voxels));
    Place { x, y, depth: depth / view.slabs.width, from_eye }
}

/// Grid units along a kernel's ray to a slab's width, where slices hold whole kernels.
fn whole_kernel(view: &ViewGeometry) -> f64 {
    view.slabs.width * view.kernel_per_depth
}

/// The unit vector along the larger axis of a quadratic form, at half the angle of (`difference`, `product`).
fn principal_axis(difference: f64, product: f64) -> DVec2 {
    let size = DVec2::new(difference, product).length();
    if size == 0.0 {
        return DVec2::X;
    }
    // Whichever of the half angle's cosine and sine does not cancel gives the other.
    let larger = ((1.0 + difference.abs() / size) / 2.0).sqrt();
    let smaller = product / (2.0 * size * larger);
    if difference >= 0.0 { DVec2::new(larger, smaller) } else { DVec2::new(smaller, larger) }
}

/// The last plane up to a depth and its rounding error ([`slab::ROUNDING`]), in slabs: the one nearest to half a slab before. Because of that error no depth lies in
/// the middle between two planes.
#[inline(always)]
fn first_plane(depth: f64) -> i32 {
    nearest(depth + (slab::ROUNDING - 0.5))
}

/// The first plane from a depth less its rounding error on.
#[inline(always)]
fn end_plane(depth: f64) -> i32 {
    nearest(depth - (slab::ROUNDING - 0.5))
}

/// Added to a number below 2³¹, 1.5·2⁵² rounds it to a whole number, which is then in the low bits.
const MAGIC: f64 = 6_755_399_441_055_744.0;

/// The nearest whole number.
#[inline(always)]
fn nearest(x: f64) -> i32 {
    (x + MAGIC).to_bits() as i32
}

/// The largest integer that is not above a number, without the system's `floor` or a branch.
#[inline(always)]
pub(super) fn floor(x: f64) -> i32 {
    let rounded = (x + MAGIC) - MAGIC;
    let floored = rounded - f64::from(u8::from(rounded > x));
    nearest(floored)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::slab::SlabGrid;

    #[test]
    fn floors() {
        for x in [-3.0, -2.5, -0.1, 0.0, 0.9, 7.0, 1e6 + 0.5] {
            assert_eq!(f64::from(floor(x)), x.floor(), "{x}");
        }
    }

    #[test]
    fn planes_enclose_depths_but_for_rounding_errors() {
        for x in [-3.0, -2.5, -0.5, -0.1, 0.0, 0.5, 0.9, 1.5, 7.0, 1e6 + 0.5] {
            for error in [-1e-10, 0.0, 1e-10] {
                let depth = x + error;
                let slabs = SlabGrid { origin: 0.0, width: 1.0 }.touched(depth, depth + 1.0);
                assert_eq!(first_plane(depth)..end_plane(depth + 1.0), slabs, "{depth}");
            }
        }
    }

    #[test]
    fn a_principal_axis_is_at_half_the_angle() {
        for step in 0..360 {
            let angle = f64::from(step).to_radians();
            let axis = principal_axis(3.0 * angle.cos(), 3.0 * angle.sin());
            assert!((axis.length() - 1.0).abs() < 1e-12, "{step}");
            let doubled = DVec2::new(axis.x * axis.x - axis.y * axis.y, 2.0 * axis.x * axis.y);
            assert!(doubled.abs_diff_eq(DVec2::from_angle(angle), 1e-12), "{step}: {axis}");
        }
        assert_eq!(principal_axis(0.0, 0.0), DVec2::X);
    }
}
