//! The counts of a frame with classification after splatting (SPEC §§8, 9).
//!
//! A voxel may be drawn if the values around it can have an opacity above 0. These values lie between the coefficients of all voxels within two kernel
//! radii (as widened by the low-pass rule) and a slab: of all in such a box around its brick of 4×4×4 voxels, and of all that are nearer to itself.
//! A slab needs both of its planes, and each plane all of its voxels.

use std::ops::Range;
use std::sync::Arc;

use glam::{DVec3, UVec2, UVec3};

use super::Frame;
use super::pixel::Pixel;
use super::slab_integral::is_visible;
use crate::error::RenderError;
use crate::image::channels::Joining;
use crate::lists::quad_plan::tile_grid;
use crate::parallel::prelude::*;
use crate::reference::Host;
use crate::scene::Scene;
use crate::settings::splatting::Classification;
use crate::settings::transfer_function::{Tables, TransferFunction};
use crate::stats::Counts;
use crate::volume::Volume;

/// The side of a brick in voxels.
const SIDE: u32 = 4;

/// The distance in voxels up to which voxels are told apart; where kernels reach farther, all of a brick may be drawn.
const WIDEST: f64 = 16.0;

/// The difference of two distances' squares that rounding may be.
const ROUNDING: f64 = 1e-6;

/// How far voxels are from each other that affect the same slabs, in voxels.
struct Reach {
    /// Along each axis.
    along: DVec3,
    /// In all; nearer ones do.
    distance: f64,
}

/// The counts of the frame that [`crate::reference::render_for`] draws.
///
/// # Errors
/// If the scene needs more than can be computed.
pub fn count(volume: &Volume, transfer: &[TransferFunction], scene: &Scene) -> Result<Counts, RenderError> {
    // Counts do not depend on light.
    Ok(count_in(&Frame::of_channels(Host::default(), volume, transfer, (scene, Some(&Arc::default())))?))
}

/// The counts of the frames of all channels, each of whose fields is drawn by itself. No voxel is shaded, because pixels are shaded instead.
pub(super) fn count_in(frames: &[Frame]) -> Counts {
    let frame = &frames[0];
    // Where channels share sheets, all of a brick may be drawn.
    let shares = frames.len() > 1 && Joining::of(frame.scene.splatting.compositing, Classification::After).is_none();
    let drawn: Vec<Vec<Vec<UVec3>>> = frames.iter().map(|frame| drawn_bricks(frame, shares)).collect();
    let pairs = frames.iter().zip(&drawn).flat_map(|(frame, bricks)| bricks.iter().map(move |brick| (frame, brick)));
    let counts = pairs.map(|(frame, brick)| {
        let sections = brick.iter().map(|voxel| planes(frame, *voxel)).sum();
        [brick.len() as u64, sections]
    });
    let [voxels, sections] = counts.fold([0, 0], |a, b: [u64; 2]| [a[0] + b[0], a[1] + b[1]]);
    let sheets = sheets(frame, &drawn.concat());
    let [columns, rows] = tile_grid([frame.scene.image.width, frame.scene.image.height]).map(u64::from);
    Counts {
        voxels_total: frame.volume.values().len() as u64,
        voxels_in_range: voxels,
        sections_total: sections,
        sections_rasterized: sections,
        sheets,
        tiles_total: columns * rows * sheets,
        tiles_composited: columns * rows * sheets,
        ..Counts::default()
    }
}

/// The voxels of a channel, which shares sheets with others or does not, that may be drawn, by brick, without holes.
fn drawn_bricks(frame: &Frame, shares: bool) -> Vec<Vec<UVec3>> {
    let grid = &frame.geometry.grid;
    let reach = reach(frame);
    let tables = tables(frame);
    let bricks = grid.dims.map(|n| n.div_ceil(SIDE));
    let ball = ball(reach.distance.min(WIDEST));
    let in_brick = |index: u32| {
        let first = UVec3::new(index % bricks.x, index / bricks.x % bricks.y, index / bricks.x / bricks.y) * SIDE;
        let end = (first + SIDE).min(grid.dims);
        if !shows(frame, &tables, box_around(frame, (first, end), reach.along)) {
            return Vec::new();
        }
        let is_drawn = |&voxel: &UVec3| {
            let around = || ball.iter().filter_map(|row| row.around(frame, voxel));
            !frame.volume.value(voxel).is_nan()
                && (shares || reach.distance > WIDEST || shows(frame, &tables, around()))
        };
        voxels(first, end).filter(is_drawn).collect()
    };
    let drawn = (0..bricks.element_product()).into_par_iter().map(in_brick);
    drawn.filter(|brick| !brick.is_empty()).collect()
}

/// The voxels from one to before another.
fn voxels(first: UVec3, end: UVec3) -> impl Iterator<Item = UVec3> {
    (first.z..end.z)
        .flat_map(move |z| (first.y..end.y).flat_map(move |y| (first.x..end.x).map(move |x| UVec3::new(x, y, z))))
}

/// How far from a voxel, and from its brick, those are that affect the same slabs.
fn reach(frame: &Frame) -> Reach {
    let geometry = &frame.geometry;
    let last = geometry.size.as_uvec2() - 1;
    let corners = [last.with_x(0), last.with_y(0), last, UVec2::ZERO].map(|corner| frame.pixel(corner));
    let slab = corners.iter().map(Pixel::step).reduce(DVec3::max).unwrap_or_default();
    // Kernels are widest where pixels are largest, on the farthest plane that meets the volume's kernels.
    let half = geometry.grid.center() * geometry.grid.aspect();
    let normal = geometry.basis.w;
    let farthest = geometry.eye.map_or(0.0, |eye| normal.dot(-eye.position) + normal.abs().dot(half));
    let kernel = geometry.radius * (normal * geometry.grid.aspect()).length();
    let rule = frame.low_pass_at(farthest + kernel + geometry.slab_width);
    let (half_box, widest) = rule.map_or((DVec3::ZERO, 1.0), |rule| (rule.half_box(geometry.radius), rule.widest));
    Reach { along: 2.0 * half_box + slab, distance: 2.0 * widest * geometry.radius + slab.length() }
}

/// The tables that apply to any voxel.
fn tables<'a>(frame: &Frame<'a>) -> Vec<Tables<'a>> {
    let labels = frame.volume.labels().map(|_| frame.transfer.labels.keys()).into_iter().flatten();
    let labels = labels.map(|&label| frame.transfer.tables(Some(label)));
    labels.chain([frame.transfer.tables(None)]).collect()
}

/// A row along x of the voxels that are nearer to one than a distance.
struct BallRow {
    /// From that voxel to the row's middle one.
    y: i32,
    z: i32,
    /// The voxels on either side of it.
    half: u32,
}

/// The voxels nearer to one than a distance, itself among them.
fn ball(distance: f64) -> Vec<BallRow> {
    let half = distance.ceil() as i32;
    let squared = distance * distance - ROUNDING;
    let row = |(y, z): (i32, i32)| {
        let left = squared - f64::from(y * y + z * z);
        let half = (0..=half as u32).rev().find(|&x| f64::from(x * x) < left)?;
        Some(BallRow { y, z, half })
    };
    (-half..=half).flat_map(|z| (-half..=half).map(move |y| (y, z))).filter_map(row).collect()
}

impl BallRow {
    /// The indices in memory of those of its voxels that exist around a voxel.
    fn around(&self, frame: &Frame, voxel: UVec3) -> Option<Range<u32>> {
        let dims = frame.volume.dims();
        let (y, z) = (voxel.y.checked_add_signed(self.y)?, voxel.z.checked_add_signed(self.z)?);
        let row = dims.x * (y + dims.y * z);
        let (first, last) = (voxel.x.saturating_sub(self.half), (voxel.x + self.half).min(dims.x - 1));
        (y < dims.y && z < dims.z).then_some(row + first..row + last + 1)
    }
}

/// The rows along x, as indices in memory, of a box of voxels and those up to a distance around it.
fn box_around(frame: &Frame, (first, end): (UVec3, UVec3), reach: DVec3) -> impl Iterator<Item = Range<u32>> {
    let dims = frame.volume.dims();
    let low = (first.as_dvec3() - reach).ceil().max(DVec3::ZERO).as_uvec3();
    let high = (end.as_dvec3() - 1.0 + reach).floor().min(dims.as_dvec3() - 1.0).as_uvec3();
    let rows = (low.z..=high.z).flat_map(move |z| (low.y..=high.y).map(move |y| dims.x * (y + dims.y * z)));
    rows.map(move |row| row + low.x..row + high.x + 1)
}

/// Whether any value between the minimum and the maximum of the coefficients of some rows of voxels may have an opacity; holes do not count.
fn shows(frame: &Frame, tables: &[Tables], rows: impl Iterator<Item = Range<u32>>) -> bool {
    let coefficients = frame.field.coefficients();
    let mut ends = [f64::INFINITY, f64::NEG_INFINITY];
    for row in rows {
        let row = &coefficients[row.start as usize..row.end as usize];
        // NaN is neither less nor greater.
        let wider =
            row.iter().fold(ends, |[min, max], &c| [if c < min { c } else { min }, if c > max { c } else { max }]);
        // What a range of values shows, a wider one does too.
        if wider != ends && meets_opacity(tables, bearing(frame, wider)) {
            return true;
        }
        ends = wider;
    }
    false
}

/// The range in which a value with an opacity makes a brick matter: a greater value hides smaller maxima, a smaller one greater minima, and
/// averages are taken of all values.
fn bearing(frame: &Frame, [min, max]: [f64; 2]) -> [f64; 2] {
    let all = frame.field.range();
    match frame.scene.splatting.compositing {
        compositing if compositing.is_average() => all,
        compositing if compositing.keeps_least() => [min, all[1]],
        compositing if compositing.is_extreme() => [all[0], max],
        _ => [min, max],
    }
}

/// Whether any value between two ends has an opacity above 0.
fn meets_opacity(tables: &[Tables], ends: [f64; 2]) -> bool {
    tables.iter().any(|tables| is_visible(tables, ends))
}

/// The number of planes whose distance from a voxel is less than the kernel's radius, in grid units.
fn planes(frame: &Frame, voxel: UVec3) -> u64 {
    let geometry = &frame.geometry;
    let normal_length = if geometry.eye.is_some() { (geometry.basis.w * geometry.grid.aspect()).length() } else { 1.0 };
    let (depth, reach) = (geometry.depth(voxel), geometry.radius * normal_length);
    let first = ((depth - reach) / geometry.slab_width).floor() + 1.0;
    let last = ((depth + reach) / geometry.slab_width).ceil() - 1.0;
    // Planes at the eye and behind it have no value.
    let first = if geometry.eye.is_some() { first.max(1.0) } else { first };
    (last - first + 1.0).max(0.0) as u64
}

/// The number of slabs from the first to the last that the cells of some bricks' voxels reach, in boxes around each brick's.
fn sheets(frame: &Frame, bricks: &[Vec<UVec3>]) -> u64 {
    let geometry = &frame.geometry;
    let aspect = geometry.grid.aspect();
    let (normal, origin) = match &geometry.eye {
        None => (geometry.ro / aspect, -geometry.grid.place() / geometry.grid.unit()),
        Some(eye) => (geometry.basis.w, eye.position),
    };
    let depths = bricks.iter().map(|voxels| {
        let ends = |of: fn(UVec3, UVec3) -> UVec3| voxels.iter().copied().reduce(of).unwrap_or_default().as_dvec3();
        let (first, end) = (ends(UVec3::min) - 0.5, ends(UVec3::max) + 0.5);
        let middle = ((first + end) / 2.0 - geometry.grid.center()) * aspect;
        let (middle, half) = (normal.dot(middle - origin), normal.abs().dot((end - first) / 2.0 * aspect));
        (middle - half, middle + half)
    });
    let near = geometry.eye.map_or(f64::NEG_INFINITY, |eye| eye.near);
    let ends = depths.reduce(|(near, far), (first, last)| (near.min(first), far.max(last)));
    let count = |(first, last): (f64, f64)| {
        ((last / geometry.slab_width).ceil() - (first.max(near) / geometry.slab_width).floor()).max(0.0) as u64
    };
    ends.map_or(0, count)
}
