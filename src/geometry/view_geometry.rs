//! The geometry of a view in the terms of SPEC §5: where voxels project to, the shape of their footprints, and how sheets cut the grid.
//! Lengths are in `unit`s (SPEC §2).

use std::ops::Range;

use glam::{DMat3, DVec2, DVec3, DVec4, UVec3};

use crate::error::RenderError;
use crate::error::setting::SettingError;
use crate::geometry::grid_warp::{self, FootprintMap};
use crate::geometry::slab::{MAX_SLABS, SlabGrid};
use crate::settings::camera::{Camera, Eye, ViewBasis};
use crate::settings::splatting::{Method, Splatting};
use crate::volume::Grid;

/// The reach of an axis-aligned voxel in slices: small enough that rounding never takes it into another slice.
const SLICE_REACH: f64 = 0.25;

/// Slabs centred on slices.
const SLICES: SlabGrid = SlabGrid { origin: -0.5, width: 1.0 };

/// The geometry of a view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViewGeometry {
    /// The viewing coordinate system in world space.
    pub basis: ViewBasis,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Rows whose products with voxel indices (i, j, k, 1) give the pixels right of the image's middle and below it, both multiplied by the
    /// fourth product; the sheet depth; and the depth from the eye (1 without an eye).
    ///
    /// [`ViewGeometry::slabs`] are slabs of sheet depth. For image-aligned sheets, sheet depth is the depth in the warped grid if
    /// orthographic, or the depth in `unit`s in perspective, both from the volume's centre; for axis-aligned ones it is the slice, counted
    /// along w. It is 0 if every voxel is composited by itself.
    pub screen_from_voxel: [DVec4; 4],
    /// The slabs.
    pub slabs: SlabGrid,
    /// The maximum reach of a kernel in sheet depth.
    pub reach: f64,
    /// Grid units of a kernel per unit of sheet depth: 1, or enough for a slice to hold the whole kernel. For image-aligned sheets in
    /// perspective it differs between voxels.
    pub kernel_per_depth: f64,
    /// [`Camera::center`] in `unit`s.
    pub center: DVec3,
    /// The size of a pixel in `unit`s; in perspective, at [`Camera::center`].
    pub pix: f64,
    /// The map from footprints to the screen; in perspective, for the central ray at [`Camera::center`].
    pub footprint: FootprintMap,
    /// `λ` of the central ray: the warped length of one `unit` along it.
    pub lambda: f64,
    /// The additional geometry of a view in perspective.
    pub perspective: Option<Perspective>,
    /// The kernel's radius in grid units.
    pub radius: f64,
}

/// The additional geometry of a view in perspective.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Perspective {
    /// The eye, relative to the volume's centre.
    pub eye: Eye,
    /// The eye's position in voxel indices.
    pub eye_voxel: DVec3,
    /// The grid aspect.
    pub aspect: DVec3,
    /// The indices of the last voxel.
    pub last: DVec3,
    /// Whether planes of constant sheet depth are parallel to the image.
    pub is_image_aligned: bool,
}

/// The rays of pixels. A position in `unit`s from the volume's centre is a function of a pixel's position (x right of the image's middle,
/// y below it, in pixels) and the depth along w from the eye, or from the camera's centre if orthographic.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rays {
    /// The position at depth 0: its change per pixel right, its change per pixel down, and its value at the image's middle.
    pub origin: [DVec3; 3],
    /// The same three for the change of position per `unit` of depth.
    pub along: [DVec3; 3],
}

impl Rays {
    /// The position at a depth on a pixel's ray.
    pub fn at(&self, place: DVec2, depth: f64) -> DVec3 {
        let of = |[right, down, middle]: [DVec3; 3]| right * place.x + down * place.y + middle;
        of(self.origin) + of(self.along) * depth
    }

    /// The depth of a position.
    pub fn depth_of(&self, position: DVec3) -> f64 {
        self.along[2].dot(position - self.origin[2])
    }
}

/// The bounds of some voxels in a view.
#[derive(Clone, Debug, PartialEq)]
pub struct Bounds {
    /// The minimum pixel coordinates.
    pub low: DVec2,
    /// The maximum pixel coordinates.
    pub high: DVec2,
    /// The minimum and maximum sheet depth that their kernels reach.
    pub depths: Range<f64>,
}

impl ViewGeometry {
    /// # Errors
    /// If pixels are too small or too large for `f32`, or there are more than [`MAX_SLABS`] slabs.
    pub fn new(grid: &Grid, camera: &Camera, splatting: &Splatting, size: [u32; 2]) -> Result<Self, RenderError> {
        let [width, height] = size;
        let (basis, aspect, radius) = (camera.basis(), grid.aspect(), splatting.radius);
        let eye = camera.eye(grid, radius, height)?;
        let pix = match (&eye, camera.orthographic_height(grid, radius, width, height)) {
            (None, Some(height_world)) => Camera::pixel_size(height_world, grid, height)?,
            (eye, _) => eye.map_or(1.0, |eye| eye.pix(eye.distance)),
        };
        // The warped grid in units of voxels is the voxel index grid, so eq. 11 applies to (i, j, k) - centre directly.
        let warped = grid_warp::m_view_warped(&basis, aspect);
        let m_vol = grid_warp::m_vol(&warped);
        let (w_wo, lambda) = grid_warp::w_wo(&warped);
        let row = |row: DVec3, at_center: f64| row.extend(at_center - row.dot(grid.center()));
        // The point at the image's middle, and the pixels per `unit` there.
        let (origin, scale) = match &eye {
            None => (camera.middle_from(grid) / grid.unit(), 1.0 / pix),
            Some(eye) => (eye.position, 1.0 / eye.pixel_per_depth),
        };
        let along_w = basis.w * aspect;
        let (slabs, depth_row, reach, kernel_per_depth) = match (splatting.method, &eye) {
            (Method::ImageAligned, None) => {
                let slabs = SlabGrid { origin: 0.0, width: splatting.slab_width * lambda };
                slabs.check(w_wo.abs().dot(grid.center()) + radius, splatting.slab_width)?;
                // Slabs are counted from the world's origin, so that the grids of levels, and of boxes of voxels, share them.
                (slabs, row(m_vol.row(2), m_vol.row(2).dot(grid.place() / grid.spacing)), radius, 1.0)
            }
            (Method::ImageAligned, Some(eye)) => {
                let slabs = SlabGrid { origin: eye.position.dot(basis.w), width: splatting.slab_width };
                // A kernel reaches `radius·(r·w)/λ` from its voxel. The maximum is for rays along w·ar².
                let reach = radius * along_w.length();
                slabs.check(basis.w.abs().dot(grid.center() * aspect) + reach, splatting.slab_width)?;
                eye.check_slabs(grid, splatting.slab_width)?;
                (slabs, row(along_w, 0.0), reach, 1.0)
            }
            // Every voxel is composited by itself, so sheets have no order.
            (Method::CompositeEverySample, _) => (SLICES, DVec4::ZERO, SLICE_REACH, 2.0 * radius),
            (Method::AxisAligned, _) => {
                let (axis, sign) = slice_axis(basis.w);
                if grid.dims[axis] > MAX_SLABS {
                    let found = format!("\"axis-aligned\", so {} slices", grid.dims[axis]);
                    return Err(SettingError::new("splatting.method", found, format!("at most {MAX_SLABS}")).into());
                }
                let mut row = DVec4::ZERO;
                row[axis] = sign;
                (SLICES, row, SLICE_REACH, 2.0 * radius)
            }
        };
        let perspective = eye.map(|eye| Perspective {
            eye,
            eye_voxel: eye.position / aspect + grid.center(),
            aspect,
            last: grid.dims.as_dvec3() - 1.0,
            is_image_aligned: splatting.method == Method::ImageAligned,
        });
        Ok(Self {
            basis,
            size,
            screen_from_voxel: [
                row(m_vol.row(0) * scale, -basis.u.dot(origin) * scale),
                row(m_vol.row(1) * -scale, basis.v.dot(origin) * scale),
                depth_row,
                if eye.is_some() { row(along_w, -basis.w.dot(origin)) } else { DVec4::W },
            ],
            slabs,
            reach,
            kernel_per_depth,
            center: camera.middle_from(grid) / grid.unit(),
            pix,
            footprint: FootprintMap::new(&warped, pix),
            lambda,
            perspective,
            radius,
        })
    }

    /// The rays of the view's pixels.
    pub fn rays(&self) -> Rays {
        let ViewBasis { u, v, w } = self.basis;
        match &self.perspective {
            None => Rays { origin: [u * self.pix, -v * self.pix, self.center], along: [DVec3::ZERO, DVec3::ZERO, w] },
            Some(Perspective { eye, .. }) => Rays {
                origin: [DVec3::ZERO, DVec3::ZERO, eye.position],
                along: [u * eye.pixel_per_depth, -v * eye.pixel_per_depth, w],
            },
        }
    }

    /// A row whose product with (x, y, z, 1) is the sheet depth of a position in `unit`s from the volume's centre.
    pub fn sheet_depth_row(&self, aspect: DVec3, center: DVec3) -> DVec4 {
        let row = self.screen_from_voxel[2];
        (row.truncate() / aspect).extend(row.dot(center.extend(1.0)))
    }

    /// The middle of the image in pixels.
    fn middle(&self) -> DVec2 {
        DVec2::from(self.size.map(f64::from)) / 2.0
    }

    /// The width of stored sections (§3.2) in grid units, for the central ray in perspective. Slices hold whole kernels.
    pub fn section_width(&self) -> f64 {
        match &self.perspective {
            Some(Perspective { is_image_aligned: true, .. }) => self.slabs.width * self.lambda,
            _ => self.slabs.width * self.kernel_per_depth,
        }
    }

    /// A voxel's pixel coordinates (x right, y down) and its sheet depth. The voxel must lie in front of the eye.
    pub fn project(&self, voxel: UVec3) -> DVec3 {
        let p = voxel.as_dvec3().extend(1.0);
        let [x, y, depth, from_eye] = self.screen_from_voxel.map(|row| row.dot(p));
        (DVec2::new(x, y) / from_eye + self.middle()).extend(depth)
    }

    /// The place, in voxel indices, at a sheet depth on the ray through pixel coordinates: what [`Self::project`] projects there.
    pub fn voxel_at(&self, pixel: DVec2, sheet_depth: f64) -> DVec3 {
        let [x, y, depth, from_eye] = self.screen_from_voxel;
        let at = pixel - self.middle();
        // Three planes meet there.
        let planes = [x - from_eye * at.x, y - from_eye * at.y, depth - DVec4::W * sheet_depth];
        let normals = DMat3::from_cols_array_2d(&planes.map(|plane| plane.truncate().to_array())).transpose();
        normals.inverse() * -DVec3::from_array(planes.map(|plane| plane.w))
    }

    /// The slabs that a voxel's kernel overlaps; empty before the near plane.
    #[inline(always)]
    pub fn touched(&self, voxel: UVec3) -> Range<i32> {
        let p = voxel.as_dvec3();
        let depth = self.screen_from_voxel[2].dot(p.extend(1.0));
        let Some(Perspective { eye, eye_voxel, is_image_aligned, .. }) = &self.perspective else {
            return self.slabs.touched(depth - self.reach, depth + self.reach);
        };
        let from_eye = self.screen_from_voxel[3].dot(p.extend(1.0));
        if from_eye <= eye.near {
            return 0..0;
        }
        if !is_image_aligned {
            return self.slabs.touched(depth - self.reach, depth + self.reach);
        }
        // (r·w)/λ is the depth divided by the distance in voxels.
        let reach = self.radius * from_eye / (p - eye_voxel).length();
        self.slabs.touched(depth - reach.min(from_eye - eye.near), depth + reach)
    }

    /// The bounds of a box of voxels with the given middle and half size in voxel indices; `None` before the near plane.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn bounds(&self, middle: DVec3, half: DVec3) -> Option<Bounds> {
        let rows = self.screen_from_voxel;
        let [x, y, _, from_eye] = rows.map(|row| row.dot(middle.extend(1.0)));
        let [dx, dy, _, thickness] = rows.map(|row| row.truncate().abs().dot(half));
        let (low, high) = (DVec2::new(x - dx, y - dy), DVec2::new(x + dx, y + dy));
        let near = self.perspective.map_or(0.0, |perspective| perspective.eye.near);
        let (nearest, farthest) = ((from_eye - thickness).max(near), from_eye + thickness);
        (farthest > near).then(|| Bounds {
            low: (low / nearest).min(low / farthest) + self.middle(),
            high: (high / nearest).max(high / farthest) + self.middle(),
            depths: self.depths(middle, half),
        })
    }

    /// The sheet depths that the kernels of a box of voxels reach, given its middle and half size in voxel indices. Where sheets are parallel
    /// to the image, only depths beyond the near plane count; the range is empty if the kernels reach no such depth.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn depths(&self, middle: DVec3, half: DVec3) -> Range<f64> {
        let [_, _, depth, from_eye] = self.screen_from_voxel.map(|row| row.dot(middle.extend(1.0)));
        let [_, _, spread, thickness] = self.screen_from_voxel.map(|row| row.truncate().abs().dot(half));
        let Some(Perspective { eye, eye_voxel, is_image_aligned: true, .. }) = &self.perspective else {
            return depth - spread - self.reach..depth + spread + self.reach;
        };
        let distance = ((middle - eye_voxel).abs() - half).max(DVec3::ZERO).length();
        let reach = self.reach.min(self.radius * (from_eye + thickness).max(0.0) / distance);
        (depth - spread - reach).max(self.slabs.origin + eye.near)..depth + spread + reach
    }

    /// The slabs that kernels and cells of a grid's voxels may reach, whatever the transfer function: a scene's slabs (SPEC §11).
    pub fn slabs_of(&self, grid: &Grid) -> Range<i32> {
        let center = grid.center();
        let kernels = self.depths(center, center);
        let row = self.screen_from_voxel[2];
        let (depth, spread) = (row.dot(center.extend(1.0)), row.truncate().abs().dot(center + 0.5));
        let near = self.perspective.map_or(f64::NEG_INFINITY, |perspective| self.slabs.origin + perspective.eye.near);
        let cells = (depth - spread).max(near)..depth + spread;
        let of = |depths: Range<f64>| self.slabs.covered(depths).unwrap_or(0..0);
        match [of(kernels), of(cells)] {
            [either, none] | [none, either] if none.is_empty() => either,
            [a, b] => a.start.min(b.start)..a.end.max(b.end),
        }
    }

    /// Whether the kernels of all voxels reach the same sheet depths in another view. For axis-aligned sheets this holds for all views along
    /// the same axis (§3.1).
    pub fn has_depths_of(&self, other: &Self) -> bool {
        let eye = |view: &Self| view.perspective.filter(|perspective| perspective.is_image_aligned);
        let depths = |view: &Self| (view.screen_from_voxel[2], view.slabs, view.reach, view.radius);
        depths(self) == depths(other) && eye(self) == eye(other)
    }

    /// Whether sheets are volume slices, which are the same for many directions.
    pub fn is_by_slices(&self) -> bool {
        self.slabs == SLICES
    }

    /// Half the screen box in pixels around the footprints, of a radius in grid units, that kernels leave on the screen between two planes of
    /// sheet depth (§6). In perspective it bounds all of them; it is infinite where they may cover the whole screen.
    #[cfg_attr(not(target_arch = "wasm32"), inline(always))]
    pub fn half_box(&self, support: f64, planes: Range<f64>) -> DVec2 {
        let Some(Perspective { eye, aspect, .. }) = &self.perspective else {
            return self.footprint.half_box(support);
        };
        let nearest = self.nearest_from_eye(planes).max(eye.near);
        // Half the image, plus a pixel for every grid unit of a footprint that the low-pass rule widens.
        let half = (self.middle() + support) * eye.pixel_per_depth;
        let w = self.basis.w * aspect;
        let half_box = |axis: DVec3, half: f64| {
            let axis = axis * aspect;
            let spare = 1.0 - support * w.length() / nearest;
            if spare < 1e-6 {
                return f64::INFINITY;
            }
            // A footprint is the shadow of an ellipsoid along its ray of slope s, which reaches as far as the ellipsoid along `axis - s·w`. The
            // steepest ray belongs to the farthest voxel that reaches the image.
            let s = (half + support * axis.length() / nearest) / spare;
            let pixels = support * (axis - s * w).length().max((axis + s * w).length()) / eye.pix(nearest);
            // The low-pass rule adds at most what the ellipse's axes lack of `support`; an ellipsoid is at least a `unit` thick. The sum is
            // largest where pixels are smallest, so boxes shrink towards the back.
            let thinnest = eye.pix(nearest).recip().min(1.0);
            libm::hypot(pixels, support * (1.0 - thinnest * thinnest).sqrt())
        };
        DVec2::new(half_box(self.basis.u, half.x), half_box(self.basis.v, half.y))
    }

    /// The minimum depth from the eye at which sections between two planes of sheet depth are projected.
    fn nearest_from_eye(&self, planes: Range<f64>) -> f64 {
        match &self.perspective {
            Some(Perspective { is_image_aligned: true, .. }) | None => planes.start - self.slabs.origin,
            // The minimum over whole slices.
            Some(Perspective { last, .. }) => {
                let slice = self.screen_from_voxel[2].truncate();
                let within = |plane: f64| (plane * slice).clamp(DVec3::ZERO, *last);
                let across = slice.abs();
                let first = within(planes.start).min(within(planes.end)) * across;
                let end = within(planes.start).max(within(planes.end)) * across + *last * (1.0 - across);
                let row = self.screen_from_voxel[3];
                let (middle, half) = ((first + end) / 2.0, (end - first) / 2.0);
                let (depth, spread) = (row.dot(middle.extend(1.0)), row.truncate().abs().dot(half));
                depth - spread
            }
        }
    }
}

/// The axis with the largest |w| component (§3.1; ties: x, then y, then z), and whether slices count up or down along it.
fn slice_axis(w: DVec3) -> (usize, f64) {
    let size = w.abs();
    let axis = if size.x >= size.y && size.x >= size.z {
        0
    } else if size.y >= size.z {
        1
    } else {
        2
    };
    (axis, 1.0_f64.copysign(w[axis]))
}
