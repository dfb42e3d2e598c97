//! The parts of pixels' rays that clip planes, the crop box and a host's surfaces leave, and how rays meet sheets, as in `shaders/shared/cut.wgsl`.

use std::ops::Range;
use std::sync::Arc;

use glam::{DVec3, UVec3};

use super::means::Means;
use super::ray::{PixelRay, PixelRays};
use super::sheets::{COLUMNS, ROWS};
use crate::geometry::view_geometry::ViewGeometry;
use crate::scene::Scene;
use crate::settings::clip::HalfSpace;
use crate::volume::Grid;

/// A number for every pixel of a tile, by row.
type PixelValues = Vec<[f32; COLUMNS]>;

/// Opaque surfaces of a host, which end rays.
#[derive(Clone, Debug)]
pub(super) struct Surfaces {
    /// Row by row, in world units along the camera's direction.
    pub(super) depths: Arc<[f32]>,
    /// The image's width and height.
    pub(super) size: [usize; 2],
    /// The length of a `unit` in world units.
    pub(super) unit: f64,
}

impl Surfaces {
    /// The depth at a pixel, in `unit`s; infinite beyond the image's edges, where tiles have pixels too.
    fn depth(&self, [x, y]: [usize; 2]) -> f64 {
        let [width, height] = self.size;
        if x < width && y < height { f64::from(self.depths[y * width + x]) / self.unit } else { f64::INFINITY }
    }
}

/// How the rays of a frame's pixels meet sheets.
#[derive(Clone, Debug)]
pub(super) struct RayMode {
    pub(super) rays: PixelRays,
    /// The half spaces that are kept; `None` if nothing is cut.
    kept: Option<Vec<HalfSpace>>,
    /// As many of the first of these are cuts whose faces are not shaded.
    unshaded: usize,
    surfaces: Option<Surfaces>,
    means: Option<Means>,
    /// The box around the volume's voxels and their neighbourhoods.
    volume: [HalfSpace; 6],
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
    /// The slabs in which rays enter through cuts whose faces are not shaded; `None` if there are no such cuts.
    pub(super) faces: Option<Vec<[Option<i32>; COLUMNS]>>,
}

/// The slack in slabs for rays that enter where two slabs meet, which is in the farther one.
const FACE_SLACK: f64 = 1e-9;

impl RayMode {
    pub(super) fn new(scene: &Scene, view: &ViewGeometry, grid: &Grid, surfaces: Option<Surfaces>) -> Self {
        let compositing = scene.splatting.compositing;
        Self {
            rays: PixelRays::new(view, grid),
            kept: (surfaces.is_some() || !scene.clip.is_empty()).then(|| scene.clip.half_spaces(grid)),
            unshaded: 0,
            surfaces,
            means: compositing.is_by_means().then(|| Means::new(view, grid, &scene.splatting)),
            volume: around(grid),
        }
    }

    /// Only the parts of rays within some half spaces, and in front of surfaces, are visible. As many of the first half spaces are cuts whose faces
    /// are not shaded.
    pub(super) fn within(
        view: &ViewGeometry,
        grid: &Grid,
        (kept, unshaded): (Vec<HalfSpace>, usize),
        surfaces: Option<Surfaces>,
    ) -> Self {
        let rays = PixelRays::new(view, grid);
        Self { rays, kept: Some(kept), unshaded, surfaces, means: None, volume: around(grid) }
    }

    /// The slab in which a ray enters through a cut whose face is not shaded.
    fn face(&self, ray: &PixelRay) -> Option<i32> {
        let (cuts, others) = self.kept.as_deref().unwrap_or_default().split_at(self.unshaded);
        let start = ray.inside(cuts).start;
        (start > ray.inside(others).start).then(|| (ray.slab(start) + FACE_SLACK).floor() as i32)
    }

    /// The range of depths at which a pixel's ray shows something.
    fn shown(&self, ray: &PixelRay, pixel: [usize; 2]) -> Range<f64> {
        let inside = ray.inside(self.kept.as_deref().unwrap_or_default());
        let end = self.surfaces.as_ref().map_or(f64::INFINITY, |surfaces| surfaces.depth(pixel));
        inside.start..inside.end.min(end)
    }

    /// The voxel whose cell has the middle of the stretch of a pixel's ray that shows something.
    pub(super) fn middle_voxel(&self, pixel: [usize; 2], grid: &Grid) -> UVec3 {
        let ray = self.rays.of(pixel);
        ray.middle_voxel(&self.shown(&ray, pixel), grid)
    }

    /// The slab from which a tile's are counted: where its middle enters the volume, so that the numbers are small, and rounded in the same way
    /// whatever is drawn there.
    fn base(&self, origin: [usize; 2]) -> i32 {
        let ray = self.rays.of([origin[0] + COLUMNS / 2, origin[1] + ROWS / 2]);
        let Range { start, end } = ray.inside(&self.volume);
        let depth = if start < end { start } else { 0.0 };
        let slab =
            ray.slabs(depth..f64::INFINITY).map_or(0.0, |[first, last]| if first.is_finite() { first } else { last });
        if slab.is_finite() { slab.floor() as i32 } else { 0 }
    }

    /// How the rays of a tile's pixels meet sheets; `origin` is the tile's first pixel.
    pub(super) fn of_tile(&self, origin: [usize; 2]) -> TileRays {
        let base = self.base(origin);
        let from_base = |slabs: [f64; 2]| slabs.map(|slab| (slab - f64::from(base)) as f32);
        let ends = |of: &dyn Fn(&PixelRay, Range<f64>) -> [f64; 2]| {
            let mut rows = vec![[[0.0; COLUMNS]; 2]; ROWS];
            self.each_pixel(origin, |ray, shown, [x, y]| [rows[y][0][x], rows[y][1][x]] = from_base(of(ray, shown)));
            rows
        };
        let weights = self.means.as_ref().map(|means| {
            let mut rows = vec![[0.0; COLUMNS]; ROWS];
            self.each_pixel(origin, |ray, shown, [x, y]| rows[y][x] = means.weight(ray, shown) as f32);
            rows
        });
        let nothing = [0.0, f64::NEG_INFINITY];
        TileRays {
            base,
            shown: self.kept.is_some().then(|| ends(&|ray, shown| ray.slabs(shown).unwrap_or(nothing))),
            weights,
            counted: self
                .means
                .as_ref()
                .filter(|means| means.is_choosy())
                .map(|means| ends(&|ray, shown| means.counted(ray, shown))),
            faces: (self.unshaded > 0).then(|| {
                let mut rows = vec![[None; COLUMNS]; ROWS];
                self.each_pixel(origin, |ray, _, [x, y]| rows[y][x] = self.face(ray));
                rows
            }),
        }
    }

    /// For every pixel of a tile its ray, the range of depths at which that shows something, and its place in the tile.
    fn each_pixel(&self, origin: [usize; 2], mut then: impl FnMut(&PixelRay, Range<f64>, [usize; 2])) {
        for (y, x) in (0..ROWS).flat_map(|y| (0..COLUMNS).map(move |x| (y, x))) {
            let pixel = [origin[0] + x, origin[1] + y];
            let ray = self.rays.of(pixel);
            then(&ray, self.shown(&ray, pixel), [x, y]);
        }
    }
}

/// The half spaces of a box around a grid's voxels.
fn around(grid: &Grid) -> [HalfSpace; 6] {
    HalfSpace::around(DVec3::ZERO, grid.center() + 1.0, grid)
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
