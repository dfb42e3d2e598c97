//! The position and shape of kernels on the slab planes of a view, including SPEC §9's low-pass rule.
//!
//! Within a plane the offset from a voxel to a pixel's point is affine in the pixel: `δ = A·(pixel - centre) + t·n`, where n is the planes' normal in
//! the grid, t the plane's distance from the voxel, and the centre the pixel position of the plane's point nearest to the voxel. All planes of a
//! view share A's singular vectors, and its two singular values, which the low-pass rule caps at 1, grow in proportion to the depth from the
//! eye. So every kernel is a Gaussian of `(a, b, t)`, with a and b in grid units along two axes that all planes share.

use glam::{DMat2, DMat3, DVec2, DVec3, UVec3};

use crate::geometry::view_geometry::ViewGeometry;
use crate::volume::Grid;

/// The radius in voxels up to which voxels are told apart by spheres around them, whose cost grows with their sections.
const WIDEST: f64 = 16.0;

/// How far voxels are from each other that affect the same slabs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reach {
    /// Along each axis, in whole voxels.
    pub along: UVec3,
    /// The greatest square of their distance in voxels; nothing where all voxels of a brick are taken together, as where kernels are very wide.
    pub squared: Option<u32>,
}

impl Reach {
    /// Where channels share sheets whole bricks are taken, since tiles find the voxels of all at once, and know of a brick which channels have it.
    pub fn sharing(self, channels: usize) -> Self {
        Self { squared: self.squared.filter(|_| channels == 1), ..self }
    }
}

/// The planes of a view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaneGeometry {
    /// Unit vectors in the grid: two within planes, and the planes' normal, away from the eye.
    pub axes: [DVec3; 3],
    /// The pixel offset (x right, y down) of length 1 whose image in the plane is along the first axis; turned, `(-y, x)`, the second axis.
    pub screen_axis: DVec2,
    /// The length of a pixel along the two axes in grid units; with an eye, at depth 1 from it.
    pub per_pixel: DVec2,
    /// The number of grid units along the normal for a sheet depth of 1.
    pub per_depth: f64,
    /// The change of the products of the first, second and fourth row of [`ViewGeometry::screen_from_voxel`] for one grid unit along the
    /// normal.
    pub step: DVec3,
    grid: Grid,
    radius: f64,
    /// The eye's sheet depth.
    eye: Option<f64>,
}

impl PlaneGeometry {
    /// The planes of an image-aligned view.
    pub fn new(view: &ViewGeometry, grid: &Grid) -> Self {
        let (basis, aspect) = (&view.basis, grid.aspect());
        let (right, down) = (basis.u / aspect, -basis.v / aspect);
        let (normal, scale, per_depth) = match &view.perspective {
            None => ((basis.w / aspect).normalize(), view.pix, 1.0),
            Some(perspective) => {
                let along_w = basis.w * aspect;
                (along_w.normalize(), perspective.eye.pixel_per_depth, along_w.length().recip())
            }
        };
        let [right, down] = [right, down].map(|step| (step - step.dot(normal) * normal) * scale);
        let (rr, rd, dd) = (right.dot(right), right.dot(down), down.dot(down));
        // The eigenvectors of AᵀA are the right singular vectors.
        let screen_axis = DVec2::from_angle(libm::atan2(rd, (rr - dd) / 2.0) / 2.0);
        let images = DMat2::from_cols(screen_axis, screen_axis.perp());
        let [first, second] = [images.x_axis, images.y_axis].map(|axis| right * axis.x + down * axis.y);
        let rows = view.screen_from_voxel;
        Self {
            axes: [first.normalize(), second.normalize(), normal],
            screen_axis,
            per_pixel: DVec2::new(first.length(), second.length()),
            per_depth,
            step: DVec3::from([0, 1, 3].map(|row| rows[row].truncate().dot(normal))),
            grid: *grid,
            radius: view.radius,
            eye: view.perspective.map(|_| view.slabs.origin),
        }
    }

    /// The depth from the eye of the plane at a sheet depth; 1 without an eye.
    pub fn distance_from_eye(&self, sheet_depth: f64) -> f64 {
        self.eye.map_or(1.0, |eye| sheet_depth - eye)
    }

    /// Half the box in grid units around the voxels whose kernels reach a point at a depth from the eye.
    pub fn half_box(&self, from_eye: f64) -> DVec3 {
        let mut widened = DMat3::IDENTITY;
        for (axis, per_pixel) in self.axes.into_iter().zip((self.per_pixel * from_eye).to_array()) {
            let outer = DMat3::from_cols(axis * axis.x, axis * axis.y, axis * axis.z);
            widened += outer * (per_pixel.max(1.0) - 1.0);
        }
        self.radius * DVec3::new(widened.x_axis.length(), widened.y_axis.length(), widened.z_axis.length())
    }

    /// Half the screen box in pixels around a voxel's projection that contains the voxel's kernel on the plane at a sheet depth, for voxels whose
    /// box reaches the image; infinite if the kernel may be anywhere.
    pub fn half_box_px(&self, sheet_depth: f64, size: [u32; 2]) -> DVec2 {
        let from_eye = self.distance_from_eye(sheet_depth);
        let axis = self.screen_axis;
        let reach = self.radius / (self.per_pixel * from_eye).min(DVec2::ONE);
        let footprint = (axis * reach.x).abs() + (axis.perp() * reach.y).abs();
        if self.eye.is_none() {
            return footprint;
        }
        // A voxel t from the plane is projected to x where the nearest point of the plane is seen t·(step - x·step.z)/from_eye away.
        let nearest = from_eye - self.radius * self.step.z;
        if nearest < 1e-6 * from_eye {
            return DVec2::INFINITY;
        }
        let half_image = DVec2::from(size.map(f64::from)) / 2.0 + footprint;
        let step = self.step.truncate().abs();
        let farthest = (half_image * from_eye + self.radius * step) / nearest;
        footprint + self.radius * (step + farthest * self.step.z) / from_eye
    }

    /// How far voxels are that affect the same slabs: two kernel radii, widened as on the farthest plane that meets the volume, and a slab.
    pub fn reach(&self, view: &ViewGeometry) -> Reach {
        let slab_step = self.slab_step(view);
        let widest = (self.per_pixel * self.farthest(view)).max_element().max(1.0);
        let radius = 2.0 * self.radius * widest + slab_step.length();
        Reach {
            // Rounding must not lose a voxel.
            along: whole(2.0 * self.widest_half_box(view) + slab_step + 1e-9),
            // Kernels end before their radius.
            squared: (radius <= WIDEST).then(|| (radius * radius - 1e-6).ceil() as u32 - 1),
        }
    }

    /// The distance from a brick, in whole voxels along each axis, of the voxels that affect the values of a slab whose near plane a pixel's ray
    /// meets in a cell of one of the brick's voxels: half a cell, a kernel radius and a slab.
    pub fn reach_from_cells(&self, view: &ViewGeometry) -> UVec3 {
        // Cells are found in f32.
        whole(0.5 + self.widest_half_box(view) + self.slab_step(view) + 0.01)
    }

    /// Half the box around the voxels whose kernels reach a point, on the farthest plane that meets the volume.
    pub fn widest_half_box(&self, view: &ViewGeometry) -> DVec3 {
        self.half_box(self.farthest(view))
    }

    /// The depth from the eye of the farthest plane that meets the volume.
    fn farthest(&self, view: &ViewGeometry) -> f64 {
        let center = self.grid.center();
        let row = view.screen_from_voxel[2];
        let farthest = row.dot(center.extend(1.0)) + row.truncate().abs().dot(center) + view.reach + view.slabs.width;
        self.distance_from_eye(farthest)
    }

    /// The longest step from plane to plane on any pixel's ray, in voxels along each axis.
    pub fn slab_step(&self, view: &ViewGeometry) -> DVec3 {
        let rays = view.rays();
        // To the centres of the outermost pixels.
        let half = (DVec2::from(view.size.map(f64::from)) - 1.0) / 2.0;
        let corners = [DVec2::ONE, DVec2::NEG_X + DVec2::Y, DVec2::X + DVec2::NEG_Y, DVec2::NEG_ONE].map(|corner| {
            let place = corner * half;
            (rays.at(place, 1.0) - rays.at(place, 0.0)).abs()
        });
        let along = corners.into_iter().reduce(DVec3::max).unwrap_or_default();
        let row = view.screen_from_voxel[2].truncate() / self.grid.aspect();
        // Sheet depth per depth along w is the same on all rays.
        along * (view.slabs.width / row.dot(view.basis.w)) / self.grid.aspect()
    }
}

/// Distances in whole voxels.
fn whole(reach: DVec3) -> UVec3 {
    reach.floor().min(DVec3::splat(f64::from(u32::MAX / 4))).as_uvec3()
}
