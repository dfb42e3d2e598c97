//! The parts of pixels' rays that clip planes and the crop box leave, and how rays meet sheets, as in `shaders/shared/cut.wgsl`.

use std::ops::Range;

use super::means::Means;
use super::ray::{PixelRay, PixelRays};
use super::sheets::{COLUMNS, ROWS};
use crate::geometry::view_geometry::ViewGeometry;
use crate::scene::Scene;
use crate::settings::clip::HalfSpace;
use crate::volume::Grid;

/// A number for every pixel of a tile, by row.
type PixelValues = Vec<[f32; COLUMNS]>;

/// How the rays of a frame's pixels meet sheets.
#[derive(Clone, Debug)]
pub(super) struct RayMode {
    pub(super) rays: PixelRays,
    /// The half spaces that are kept; `None` if nothing is cut.
    kept: Option<Vec<HalfSpace>>,
    means: Option<Means>,
}

/// How the rays of a tile's pixels meet sheets, by row. Slabs are counted from `base`.
#[derive(Clone, Debug, Default)]
pub(super) struct TileRays {
    base: i32,
    /// The start and end of each ray's visible stretch, empty if the ray shows nothing; `None` if nothing is cut.
    pub(super) shown: Option<Vec<[[f32; COLUMNS]; 2]>>,
    /// The factors that turn sheets into means; `None` if they are not needed.
    pub(super) weights: Option<PixelValues>,
    /// The range of the middles of slabs that count; `None` if all do.
    pub(super) counted: Option<Vec<[[f32; COLUMNS]; 2]>>,
}

impl RayMode {
    pub(super) fn new(scene: &Scene, view: &ViewGeometry, grid: &Grid) -> Self {
        let compositing = scene.splatting.compositing;
        Self {
            rays: PixelRays::new(view, grid),
            kept: (!scene.clip.is_empty()).then(|| scene.clip.half_spaces(grid)),
            means: compositing.is_by_means().then(|| Means::new(view, grid, &scene.splatting)),
        }
    }

    /// Only the parts of rays within some half spaces show.
    pub(super) fn within(view: &ViewGeometry, grid: &Grid, kept: Vec<HalfSpace>) -> Self {
        Self { rays: PixelRays::new(view, grid), kept: Some(kept), means: None }
    }

    /// The range of depths at which a ray shows something.
    fn shown(&self, ray: &PixelRay) -> Range<f64> {
        ray.inside(self.kept.as_deref().unwrap_or_default())
    }

    /// How the rays of a tile's pixels meet sheets; `origin` is the tile's first pixel.
    pub(super) fn of_tile(&self, origin: [usize; 2], base: i32) -> TileRays {
        let from_base = |slabs: [f64; 2]| slabs.map(|slab| (slab - f64::from(base)) as f32);
        let ends = |of: &dyn Fn(&PixelRay) -> [f64; 2]| {
            let mut rows = vec![[[0.0; COLUMNS]; 2]; ROWS];
            self.each_pixel(origin, |ray, [x, y]| [rows[y][0][x], rows[y][1][x]] = from_base(of(ray)));
            rows
        };
        let weights = self.means.as_ref().map(|means| {
            let mut rows = vec![[0.0; COLUMNS]; ROWS];
            self.each_pixel(origin, |ray, [x, y]| rows[y][x] = means.weight(ray, self.shown(ray)) as f32);
            rows
        });
        let nothing = [0.0, f64::NEG_INFINITY];
        TileRays {
            base,
            shown: self.kept.is_some().then(|| ends(&|ray| ray.slabs(self.shown(ray)).unwrap_or(nothing))),
            weights,
            counted: self
                .means
                .as_ref()
                .filter(|means| means.is_choosy())
                .map(|means| ends(&|ray| means.counted(ray, self.shown(ray)))),
        }
    }

    fn each_pixel(&self, origin: [usize; 2], mut then: impl FnMut(&PixelRay, [usize; 2])) {
        for (y, x) in (0..ROWS).flat_map(|y| (0..COLUMNS).map(move |x| (y, x))) {
            then(&self.rays.of([origin[0] + x, origin[1] + y]), [x, y]);
        }
    }
}

impl TileRays {
    /// Where a slab begins, in the terms of the stretches.
    pub(super) fn begin(&self, slab: i32) -> f32 {
        (slab - self.base) as f32
    }

    /// The place among slabs that is meant by a number in the terms of the stretches.
    pub(super) fn slab(&self, at: f32) -> f64 {
        f64::from(self.base) + f64::from(at)
    }
}
