//! Which voxels matter where classification comes after splatting (SPEC §9): those whose kernels reach a slab that may hold an opacity.
//!
//! A ray's stretch through a slab has its middle in some voxel's cell. Values on both of its ends are weighted means over voxels within `reach` of that
//! cell. If no value between the least and the greatest of those has an opacity, the slab holds none, nor does it if some of the voxels are
//! left out: a weighted mean of fewer values lies between the same two. So voxels out of reach of all other cells are not drawn, and no
//! image changes. This is decided voxel by voxel: whole bricks would be half again as many.
//!
//! Kernels fall off fast, and the outermost voxels within reach have a small share of any mean. So the bounds are narrower: those of the inner
//! voxels, moved by that share towards those of all. That holds where all inner voxels are drawn, and is checked.

use glam::{DVec2, DVec3, UVec3};
use rayon::prelude::*;

use crate::geometry::view_geometry::{Perspective, ViewGeometry};
use crate::gpu::layout::Brick;
use crate::lists::brick::{self, BRICK_VOXELS};
use crate::lists::iso_range::{ValueSet, of_ordinal};
use crate::settings::splatting::{Compositing, Splatting};
use crate::settings::transfer_function::TransferFunction;
use crate::volume::Grid;

/// A value's place among those of a volume, from 0 to 255.
type Level = u8;

/// What decides which voxels matter.
#[derive(Clone, Debug, PartialEq)]
pub struct Matter {
    /// The values that have an opacity.
    visible: ValueSet,
    compositing: Compositing,
    /// How far from a cell voxels lie, along each axis, that bear on the slabs whose middle is in it.
    reach: UVec3,
    /// The kernel's radius and falloff, and the most that a ray is long from plane to plane, `unit`s; only where no kernel is wider than that.
    kernel: Option<[f64; 3]>,
}

impl Matter {
    /// What a transfer function shows in a view, and in all others that see voxels from as near and as far.
    pub fn new(transfer: &TransferFunction, splatting: &Splatting, view: &ViewGeometry, grid: &Grid) -> Self {
        let aspect = grid.aspect();
        // Pixels, which kernels are never narrower than, and a ray's length from plane to plane, `unit`s, are largest in the farthest corner.
        let (pix, step) = match &view.perspective {
            None => (view.pix, splatting.slab_width),
            Some(Perspective { eye, .. }) => {
                let farthest = eye.position.length() + (grid.center() * aspect).length() + splatting.slab_width;
                let half_px = DVec2::from(view.size.map(f64::from)) / 2.0;
                (eye.pix(farthest), splatting.slab_width * (half_px * eye.pixel_per_depth).length().hypot(1.0))
            }
        };
        let half_box = DVec3::splat(view.radius * pix.max(1.0));
        let labels = transfer.labels.keys().map(|&label| Some(label)).chain([None]);
        let visible = labels.map(|label| ValueSet::of_tables(&transfer.tables(label)));
        // Voxels at this distance do not bear on them any more.
        let reach = (half_box + 0.5 * step / aspect + 0.5 - 1e-4).ceil().as_uvec3() - 1;
        Self {
            visible: visible.fold(ValueSet::default(), |all, values| all.union(&values)),
            compositing: splatting.compositing,
            reach,
            kernel: (pix <= 1.0).then_some([view.radius, splatting.falloff, step]),
        }
    }

    /// The bricks of the voxels that matter, holes left out, in memory order. Values are those that kernels are weighted with.
    pub fn bricks(&self, grid: &Grid, values: &[f32]) -> Vec<Brick> {
        let Some(levels) = Levels::new(&self.visible, self.compositing, values) else { return Vec::new() };
        let (dims, reach) = (grid.dims, self.reach);
        let has_holes = values.par_iter().any(|value| value.is_nan());
        let ends = levels.of(values);
        let shown = match self.kernel {
            Some(kernel) if !has_holes && reach.min_element() > 0 => self.shown_by_share(grid, &levels, &ends, kernel),
            _ => shown(&levels, &filtered(&ends, dims, reach)),
        };
        bricks(grid, values, &box_filter(shown, dims, reach, u8::max))
    }

    /// The cells that may show something, by the outermost voxels' share of the means.
    fn shown_by_share(&self, grid: &Grid, levels: &Levels, ends: &[Vec<Level>; 2], kernel: [f64; 3]) -> Vec<u8> {
        let (dims, reach) = (grid.dims, self.reach);
        let inner_reach = reach - 1;
        let inner = filtered(ends, dims, inner_reach);
        let all = filtered(&inner, dims, UVec3::ONE);
        let by_all = shown(levels, &all);
        let share = outer_share(grid.aspect(), inner_reach, kernel);
        let toward = |from: Level, to: Level| f64::from(from) + share * (f64::from(to) - f64::from(from));
        let mut shown: Vec<u8> = (0..by_all.len())
            .into_par_iter()
            .map(|at| {
                let shows_by_share = || {
                    let low = toward(inner[0][at], all[0][at]).floor() as Level;
                    let high = toward(inner[1][at], all[1][at]).ceil() as Level;
                    levels.show(low, high)
                };
                // At the border voxels are missing whose share others have.
                u8::from(by_all[at] != 0 && (shows_by_share() || !is_inside(dims, at, reach)))
            })
            .collect();
        loop {
            let drawn = box_filter(shown.clone(), dims, reach, u8::max);
            let is_whole = box_filter(drawn.clone(), dims, inner_reach, u8::min);
            let only = |level: &Level, drawn: &u8, none: Level| if *drawn != 0 { *level } else { none };
            let low = ends[0].par_iter().zip(&drawn).map(|(level, drawn)| only(level, drawn, Level::MAX)).collect();
            let high = ends[1].par_iter().zip(&drawn).map(|(level, drawn)| only(level, drawn, 0)).collect();
            let [low, high] = filtered(&[low, high], dims, reach);
            // Where not all inner voxels are drawn, those that are might show something that is not there.
            let found = (shown.par_iter_mut().enumerate())
                .filter(|(at, shown)| **shown == 0 && by_all[*at] != 0 && is_whole[*at] == 0)
                .filter(|(at, _)| low[*at] <= high[*at] && levels.show(low[*at], high[*at]))
                .map(|(_, shown)| *shown = 1)
                .count();
            if found == 0 {
                return shown;
            }
        }
    }
}

/// Levels of values, and which of them have an opacity.
struct Levels {
    least: f32,
    per_value: f32,
    compositing: Compositing,
    /// How many levels below each have values with an opacity.
    visible_below: [u16; 257],
}

impl Levels {
    /// `None` if there are no values, or none of them can have an opacity.
    fn new(visible: &ValueSet, compositing: Compositing, values: &[f32]) -> Option<Self> {
        let ends = |[low, high]: [f32; 2], value: f32| [low.min(value), high.max(value)];
        let none = [f32::INFINITY, f32::NEG_INFINITY];
        let chunk = |chunk: &[f32]| chunk.iter().fold(none, |found, &value| ends(found, value));
        let [least, greatest] =
            values.par_chunks(1 << 16).map(chunk).reduce(|| none, |a, b| [a[0].min(b[0]), a[1].max(b[1])]);
        if least > greatest || visible.ranges().is_empty() {
            return None;
        }
        let range = f64::from(greatest) - f64::from(least);
        let per_value = if range > 0.0 { (255.0 / range) as f32 } else { 0.0 };
        let mut levels = Self { least, per_value, compositing, visible_below: [0; 257] };
        let ranges: Vec<[Level; 2]> = (visible.ranges().iter())
            .map(|range| [of_ordinal(range.start), of_ordinal(range.end - 1)])
            .filter(|&[low, high]| low <= greatest && high >= least)
            .map(|[low, high]| [levels.place(low).floor() as Level, levels.place(high).ceil() as Level])
            .collect();
        let mut below = 0;
        for level in 0..=255 {
            below += u16::from(ranges.iter().any(|&[low, high]| low <= level && level <= high));
            levels.visible_below[usize::from(level) + 1] = below;
        }
        (below > 0).then_some(levels)
    }

    /// Where a value stands, as a fraction; rounding errors are taken care of by `of`.
    fn place(&self, value: f32) -> f32 {
        ((value - self.least) * self.per_value).clamp(0.0, 255.0)
    }

    /// The levels at or below all values, and those at or above; of holes none.
    fn of(&self, values: &[f32]) -> [Vec<Level>; 2] {
        let low = |&value: &f32| if value.is_nan() { Level::MAX } else { self.place(value).floor() as Level };
        let high = |&value: &f32| if value.is_nan() { 0 } else { self.place(value).ceil() as Level };
        [values.par_iter().map(low).collect(), values.par_iter().map(high).collect()]
    }

    /// Whether a slab may show something that values from one level to another lie along.
    fn show(&self, low: Level, high: Level) -> bool {
        let below = |level: usize| self.visible_below[level];
        match self.compositing {
            // Values below all that have an opacity are never the greatest where one that has is.
            Compositing::Maximum => below(usize::from(high) + 1) > 0,
            Compositing::Minimum => below(256) > below(usize::from(low)),
            Compositing::Average => true,
            _ => below(usize::from(high) + 1) > below(usize::from(low)),
        }
    }
}

/// The least and the greatest levels within reach of every voxel.
fn filtered([low, high]: &[Vec<Level>; 2], dims: UVec3, reach: UVec3) -> [Vec<Level>; 2] {
    [box_filter(low.clone(), dims, reach, u8::min), box_filter(high.clone(), dims, reach, u8::max)]
}

/// The cells that may show something, by the least and the greatest level around each.
fn shown(levels: &Levels, [low, high]: &[Vec<Level>; 2]) -> Vec<u8> {
    low.par_iter().zip(high).map(|(&low, &high)| u8::from(low <= high && levels.show(low, high))).collect()
}

/// Whether all voxels within reach of one are in the volume.
fn is_inside(dims: UVec3, index: usize, reach: UVec3) -> bool {
    let index = index as u32;
    let at = UVec3::new(index % dims.x, index / dims.x % dims.y, index / (dims.x * dims.y));
    at.cmpge(reach).all() && (at + reach).cmplt(dims).all()
}

/// The most that voxels farther than `inner` from a cell, along some axis, have of the mean at the ends of a stretch with its middle in that cell. A little more
/// than was found at the points that are tried.
fn outer_share(aspect: DVec3, inner: UVec3, [radius, falloff, step]: [f64; 3]) -> f64 {
    const DIRECTIONS: u32 = 64;
    let reach = (radius + 0.5 + step / 2.0).ceil() as i32;
    let offsets = move || (-reach..=reach).map(f64::from);
    let cube = || offsets().flat_map(|x| offsets().flat_map(move |y| offsets().map(move |z| DVec3::new(x, y, z))));
    let voxels: Vec<DVec3> = cube().collect();
    let direction = |at: u32| {
        // Points of a spiral, evenly spread over the sphere.
        let z = 1.0 - (2.0 * f64::from(at) + 1.0) / f64::from(DIRECTIONS);
        let (sine, cosine) = (f64::from(at) * 2.399_963_229_728_653).sin_cos();
        DVec3::new(cosine, sine, 0.0) * (1.0 - z * z).sqrt() + DVec3::Z * z
    };
    let middles = (0..27).map(|at| DVec3::new(f64::from(at % 3), f64::from(at / 3 % 3), f64::from(at / 9)) / 4.0);
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    let points = middles.flat_map(|middle| {
        (0..DIRECTIONS).map(direction).chain(axes).map(move |way| middle + way * step / 2.0 / aspect)
    });
    let share = |point: DVec3| {
        let (mut outer, mut all) = (0.0, 0.0);
        for &voxel in &voxels {
            let squared = (voxel - point).length_squared();
            if squared < radius * radius {
                let weight = (-falloff * squared).exp();
                all += weight;
                outer += if voxel.abs().cmpgt(inner.as_dvec3()).any() { weight } else { 0.0 };
            }
        }
        outer / all
    };
    (1.1 * points.collect::<Vec<_>>().into_par_iter().map(share).reduce(|| 0.0, f64::max) + 0.005).min(1.0)
}

/// The bricks of the voxels that matter and are no holes.
fn bricks(grid: &Grid, values: &[f32], matters: &[u8]) -> Vec<Brick> {
    let side = 1 << (BRICK_VOXELS.ilog2() / 3);
    let across = grid.dims.map(|n| n.div_ceil(side));
    let layer = |z: u32| -> Vec<Brick> {
        let places = (0..across.y).flat_map(|y| (0..across.x).map(move |x| UVec3::new(x, y, z) * side));
        places
            .filter_map(|first| {
                let is_present = |&place: &u32| {
                    let at = first + brick::in_brick(place);
                    let is_inside = at.cmplt(grid.dims).all();
                    let index = if is_inside { grid.index_of(at) as usize } else { 0 };
                    is_inside && matters[index] != 0 && !values[index].is_nan()
                };
                let present = (0..BRICK_VOXELS).filter(is_present);
                brick::of_places(first, present.fold(0, |bits, place| bits | 1_u64 << place))
            })
            .collect()
    };
    let layers: Vec<Vec<Brick>> = (0..across.z).into_par_iter().map(layer).collect();
    layers.concat()
}

/// For every voxel what `choose` makes of those within reach, one axis after the other.
fn box_filter(values: Vec<u8>, dims: UVec3, reach: UVec3, choose: impl Fn(u8, u8) -> u8 + Sync) -> Vec<u8> {
    let [width, layer] = [dims.x as usize, (dims.x * dims.y) as usize];
    let choose_rows = |row: &mut [u8], other: &[u8]| {
        row.iter_mut().zip(other).for_each(|(value, &other)| *value = choose(*value, other));
    };
    // Along z from layers, then along y from rows, then along x within rows.
    let mut along_z = values.clone();
    along_z.par_chunks_mut(layer).enumerate().for_each(|(z, found)| {
        for other in neighbours(z as u32, reach.z, dims.z) {
            choose_rows(found, &values[other as usize * layer..][..layer]);
        }
    });
    let mut along_y = values;
    along_y.par_chunks_mut(layer).zip(along_z.par_chunks(layer)).for_each(|(found, from)| {
        for (y, row) in found.chunks_mut(width).enumerate() {
            row.copy_from_slice(&from[y * width..][..width]);
            for other in neighbours(y as u32, reach.y, dims.y) {
                choose_rows(row, &from[other as usize * width..][..width]);
            }
        }
    });
    along_z.par_chunks_mut(width).zip(along_y.par_chunks(width)).for_each(|(row, from)| {
        row.copy_from_slice(from);
        for step in 1..=(reach.x as usize).min(width - 1) {
            choose_rows(row, &from[step..]);
            choose_rows(&mut row[step..], from);
        }
    });
    along_z
}

/// The other places within reach of one.
fn neighbours(at: u32, reach: u32, count: u32) -> impl Iterator<Item = u32> {
    (at.saturating_sub(reach)..(at + reach + 1).min(count)).filter(move |&other| other != at)
}
