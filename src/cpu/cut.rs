//! What clip planes and the crop box leave of pixels' rays, and how those look at sheets; the same as `shaders/shared/cut.wgsl`.

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

/// How a frame's pixels look at sheets.
#[derive(Clone, Debug)]
pub(super) struct RayMode {
    pub(super) rays: PixelRays,
    /// What is kept, where anything is cut away.
    kept: Option<Vec<HalfSpace>>,
    means: Option<Means>,
}

/// How the pixels of a tile look at sheets, by row; slabs are counted from `base` on.
#[derive(Clone, Debug, Default)]
pub(super) struct TileRays {
    base: i32,
    /// Where the stretches of rays that show start and end, where anything is cut away; empty where nothing shows.
    pub(super) shown: Option<Vec<[[f32; COLUMNS]; 2]>>,
    /// What sheets are multiplied by to be means.
    pub(super) weights: Option<PixelValues>,
    /// From where to where the middles of slabs lie that count, where not all do.
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

    /// What lies within some half spaces shows.
    pub(super) fn within(view: &ViewGeometry, grid: &Grid, kept: Vec<HalfSpace>) -> Self {
        Self { rays: PixelRays::new(view, grid), kept: Some(kept), means: None }
    }

    /// The depths at which a ray shows something.
    fn shown(&self, ray: &PixelRay) -> Range<f64> {
        ray.inside(self.kept.as_deref().unwrap_or_default())
    }

    /// How the pixels of a tile look at sheets, given its first pixel.
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
