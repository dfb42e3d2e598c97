//! The geometry of light sheets towards one direction (SPEC §14), which is that of §5 seen from the light.

use std::ops::Range;

use glam::{DVec3, DVec4};

use crate::error::RenderError;
use crate::error::setting::{SettingError, scaled};
use crate::geometry::view_geometry::ViewGeometry;
use crate::lists::brick::Brick;
use crate::lists::quad_plan::Overlaps;
use crate::scene::Scene;
use crate::settings::camera::{Camera, Projection, least_axis};
use crate::settings::splatting::Splatting;
use crate::volume::Grid;

/// The sine of the angle between `up` and the light below which another axis is up.
const PARALLEL: f64 = 0.1;

/// The most bytes of one stack.
const MOST_BYTES: f64 = (1_u64 << 32) as f64;

/// Where the voxels of a grid are among light sheets.
#[derive(Clone, Debug)]
pub(super) struct LightView {
    pub(super) view: ViewGeometry,
    /// The pixels along each side of a sheet.
    pub(super) side: usize,
    /// Rows whose products with voxel coordinates (i, j, k, 1) give a point's place in a stack, moved towards the light by a kernel's reach: pixels right of
    /// the first one's centre, pixels below it, and planes from plane 0 on.
    pub(super) place: [DVec4; 3],
}

impl LightView {
    /// The view from a light in the direction of a unit vector, with a camera's `up`.
    ///
    /// # Errors
    /// If a stack would take more than 4 GiB.
    pub(super) fn new(grid: &Grid, scene: &Scene, up: DVec3, to_light: DVec3) -> Result<Self, RenderError> {
        let (step, radius) = (scene.shading.light_step, scene.splatting.radius);
        let side = side(grid.bounding_radius(radius) / grid.unit(), step);
        let bytes = side * side * side * size_of::<f32>() as f64;
        if bytes > MOST_BYTES {
            let found = format!("{step}, so {:.1} GB of light sheets", bytes / 1e9);
            let allowed = format!("at least {:.1}", (step * libm::cbrt(bytes / MOST_BYTES) * 10.0).ceil() / 10.0);
            return Err(SettingError::new("shading.light_step", found, allowed).into());
        }
        let camera = Camera {
            projection: Projection::Orthographic { height: Some(side * step * grid.unit()) },
            direction: -to_light,
            up: raised(scaled(up).normalize(), to_light),
            center: None,
            ..Camera::default()
        };
        let splatting =
            Splatting { radius, falloff: scene.splatting.falloff, slab_width: step, ..Splatting::default() };
        let view = ViewGeometry::new(grid, &camera, &splatting, [side as u32; 2])?;
        let aspect = grid.aspect();
        let bias = radius * (aspect * to_light).length() * to_light / aspect;
        let moved = |row: DVec4| row + DVec4::W * row.truncate().dot(bias);
        let [x, y, depth, _] = view.screen_from_voxel;
        let half = (side - 1.0) / 2.0;
        let place = [moved(x) + DVec4::W * half, moved(y) + DVec4::W * half, moved(depth) / view.slabs.width];
        Ok(Self { view, side: side as usize, place })
    }

    /// The slabs that the kernels of any voxels reach; empty without any.
    pub(super) fn slabs(&self, bricks: &[Brick]) -> Range<i32> {
        Overlaps::count(bricks, &self.view).slabs
    }
}

/// The pixels along each side of sheets with some step, for a scene whose sphere has some radius, both in `unit`s.
pub(super) fn side(radius: f64, step: f64) -> f64 {
    2.0 * (radius / step).ceil() + 1.0
}

/// The camera's `up`, of length 1, or, where it is nearly along the light, the world axis least along that.
fn raised(up: DVec3, to_light: DVec3) -> DVec3 {
    if up.cross(to_light).length() >= PARALLEL {
        return up;
    }
    DVec3::AXES[least_axis(to_light.abs())]
}
