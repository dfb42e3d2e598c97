//! Which voxels matter where classification comes after splatting (SPEC §9): those whose kernels reach a slab that may hold an opacity.
//!
//! A ray's stretch through a slab has its middle in some voxel's cell. Values on both of its ends are weighted means over voxels within `reach` of that
//! cell. If no value between the least and the greatest of those has an opacity, the slab holds none, nor does it if some of the voxels are
//! left out: a weighted mean of fewer values lies between the same two. So voxels out of reach of all other cells are not drawn, and no
//! image changes. This is decided voxel by voxel: whole bricks would be half again as many.

use glam::{DVec2, DVec3, UVec3};
use rayon::prelude::*;

use crate::geometry::view_geometry::{Perspective, ViewGeometry};
use crate::gpu::layout::Brick;
use crate::lists::brick::{self, BRICK_VOXELS};
use crate::lists::iso_range::{ValueSet, ordinal};
use crate::settings::splatting::Compositing;
use crate::settings::transfer_function::TransferFunction;
use crate::volume::Grid;

/// How values stand to those that have an opacity: below all of them, among the lowest, above these and below the next, and so on. Odd ones
/// have an opacity.
type Class = u8;

/// The most ranges of values that are told apart; farther ones count as one.
const MOST_RANGES: usize = 100;

/// What decides which voxels matter.
#[derive(Clone, Debug, PartialEq)]
pub struct Matter {
    /// The values that have an opacity.
    visible: ValueSet,
    compositing: Compositing,
    /// How far from a cell voxels lie, along each axis, that bear on the slabs whose middle is in it.
    reach: UVec3,
}

impl Matter {
    /// What a transfer function shows in a view, and in all others that see voxels from as near and as far.
    pub fn new(transfer: &TransferFunction, compositing: Compositing, view: &ViewGeometry, grid: &Grid) -> Self {
        let aspect = grid.aspect();
        // Pixels, which kernels are never narrower than, and a ray's length from plane to plane, `unit`s, are largest in the farthest corner.
        let (pix, step) = match &view.perspective {
            None => (view.pix, view.slabs.width / view.lambda),
            Some(Perspective { eye, .. }) => {
                let farthest = eye.position.length() + (grid.center() * aspect).length() + view.slabs.width;
                let half_px = DVec2::from(view.size.map(f64::from)) / 2.0;
                (eye.pix(farthest), view.slabs.width * (half_px * eye.pixel_per_depth).length().hypot(1.0))
            }
        };
        let half_box = DVec3::splat(view.radius * pix.max(1.0));
        let labels = transfer.labels.keys().map(|&label| Some(label)).chain([None]);
        let visible = labels.map(|label| ValueSet::of_tables(&transfer.tables(label)));
        let visible = visible.fold(ValueSet::default(), |all, values| all.union(&values));
        // Voxels at this distance do not bear on them any more.
        let reach = (half_box + 0.5 * step / aspect + 0.5 - 1e-4).ceil().as_uvec3() - 1;
        Self { visible, compositing, reach }
    }

    /// The bricks of the voxels that matter, holes left out, in memory order. Values are those that kernels are weighted with.
    pub fn bricks(&self, grid: &Grid, values: &[f32]) -> Vec<Brick> {
        let ranges = self.visible.ranges();
        if ranges.is_empty() {
            return Vec::new();
        }
        let ranges = &ranges[..ranges.len().min(MOST_RANGES)];
        let class = |value: f32| {
            let ordinal = ordinal(value);
            let below = ranges.partition_point(|range| range.start <= ordinal);
            let is_above = below > 0 && below < MOST_RANGES && ranges[below - 1].end <= ordinal;
            if below == 0 { 0 } else { (2 * below - 1) as Class + Class::from(is_above) }
        };
        let last = 2 * ranges.len() as Class - 1;
        let dims = grid.dims;
        let classes = |hole: Class| -> Vec<Class> {
            values.par_iter().map(|&value| if value.is_nan() { hole } else { class(value) }).collect()
        };
        let least = box_filter(classes(Class::MAX), dims, self.reach, Class::min);
        let greatest = box_filter(classes(0), dims, self.reach, Class::max);
        let shows = |(least, greatest): (Class, &Class)| -> Class {
            let greatest = *greatest;
            let shows = match self.compositing {
                _ if least > greatest => false,
                // Values below all that have an opacity are never the greatest where one that has is.
                Compositing::Maximum => greatest >= 1,
                Compositing::Minimum => least <= last,
                Compositing::Average => true,
                _ => least != greatest || least % 2 == 1,
            };
            Class::from(shows)
        };
        let shown: Vec<Class> = least.into_par_iter().zip(&greatest).map(shows).collect();
        drop(greatest);
        bricks(grid, values, &box_filter(shown, dims, self.reach, Class::max))
    }
}

/// The bricks of the voxels that matter and are no holes.
fn bricks(grid: &Grid, values: &[f32], matters: &[Class]) -> Vec<Brick> {
    let side = BRICK_VOXELS.ilog2() / 3;
    let side = 1 << side;
    let across = grid.dims.map(|n| n.div_ceil(side));
    let layer = |z: u32| -> Vec<Brick> {
        let places = (0..across.y).flat_map(|y| (0..across.x).map(move |x| UVec3::new(x, y, z) * side));
        places
            .filter_map(|first| {
                let present = (0..BRICK_VOXELS).filter(|&place| {
                    let at = first + brick::in_brick(place);
                    let is_inside = at.cmplt(grid.dims).all();
                    is_inside && {
                        let index = grid.index_of(at) as usize;
                        matters[index] != 0 && !values[index].is_nan()
                    }
                });
                brick::of_places(first, present.fold(0, |bits, place| bits | 1_u64 << place))
            })
            .collect()
    };
    let layers: Vec<Vec<Brick>> = (0..across.z).into_par_iter().map(layer).collect();
    layers.concat()
}

/// For every voxel what `choose` makes of those within reach, one axis after the other.
fn box_filter(
    values: Vec<Class>,
    dims: UVec3,
    reach: UVec3,
    choose: impl Fn(Class, Class) -> Class + Sync,
) -> Vec<Class> {
    let [width, layer] = [dims.x as usize, (dims.x * dims.y) as usize];
    let choose_rows = |row: &mut [Class], other: &[Class]| {
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
        for (row, y) in found.chunks_mut(width).zip(0..) {
            row.copy_from_slice(&from[y as usize * width..][..width]);
            for other in neighbours(y, reach.y, dims.y) {
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
