//! Windows of about equal work that together show a whole image (SPEC §11).

use std::ops::Range;

use crate::error::RenderError;
use crate::error::setting::SettingError;
use crate::finished::FinishedScene;
use crate::geometry::view_geometry::ViewGeometry;
use crate::kernel::Kernel;
use crate::lists::brick::{self, Brick};
use crate::lists::classify::brick_list;
use crate::scene::{OpenVolume, Scene};
use crate::settings::window::{Region, Window};

/// The maximum number of cells along a side of the image, and of bins along the depth, in which work is counted.
const CELLS: u32 = 64;
const BINS: usize = 1024;

/// Divides the image of a scene into parts of about equal work: pixels of kernel sections, without what opaque pixels hide. Each region's slab
/// ranges follow one another. Of a view that shows no slab there is one part for each region, fewer than are asked for.
///
/// # Errors
/// If the scene has no parts, or fewer slabs and pixels than parts are asked for.
pub fn split(volume: &OpenVolume, scene: &Scene, parts: usize) -> Result<Vec<Window>, RenderError> {
    let size = [scene.image.width, scene.image.height];
    super::check(volume.sample(), scene, &Window::whole(size))?;
    let work = Work::new(volume, scene)?;
    // As many regions as slab ranges in each of them: ranges divide the volume's memory, regions keep what hides.
    let regions = parts.isqrt().max(1);
    let counts: Vec<usize> = (0..regions).map(|at| parts * (at + 1) / regions - parts * at / regions).collect();
    let mut cut = Vec::new();
    work.divide(Area { x: 0..work.cells[0], y: 0..work.cells[1] }, &counts, &mut cut);
    let mut windows = Vec::new();
    for (area, count) in cut {
        let region = work.region(&area);
        if work.slabs.is_empty() {
            // A view that misses the volume has no slabs to divide: a part of none is as good as several.
            windows.push(Window { slabs: work.slabs.clone(), region });
            continue;
        }
        if count > work.slabs.len() {
            let allowed = format!("at most {} for {} slabs", regions * work.slabs.len(), work.slabs.len());
            return Err(SettingError::new("parts", parts.to_string(), allowed).into());
        }
        windows.extend(work.ranges(&area, count).into_iter().map(|slabs| Window { slabs, region }));
    }
    Ok(windows)
}

/// The work of a frame by place on the image and by depth.
struct Work {
    size: [u32; 2],
    /// The side of a cell in pixels.
    cell: u32,
    /// The number of columns and rows of cells.
    cells: [usize; 2],
    slabs: Range<i32>,
    /// The number of bins, each of equally many slabs.
    bins: usize,
    /// By row, column and bin.
    amounts: Vec<f64>,
}

/// A rectangle of cells.
struct Area {
    x: Range<usize>,
    y: Range<usize>,
}

impl Work {
    fn new(volume: &OpenVolume, scene: &Scene) -> Result<Self, RenderError> {
        let (grid, volume) = (volume.grid(), volume.sample());
        let finished = FinishedScene::new(volume, scene)?;
        let (scene, seen) = finished.framed(volume, grid)?;
        let (size, slabs) = (seen.size, seen.slabs_of(grid));
        // A sample's voxels share the place and the slabs of those that they stand for.
        let view = ViewGeometry::new(volume.grid(), &scene.camera, &scene.splatting, size)?;
        let cell = size[0].max(size[1]).div_ceil(CELLS).max(1);
        let cells = size.map(|side| side.div_ceil(cell) as usize);
        let bins = slabs.len().clamp(1, BINS);
        let amounts = vec![0.0; cells[0] * cells[1] * bins];
        let mut work = Self { size, cell, cells, slabs, bins, amounts };
        let clipped = scene.clip.voxels(volume.grid(), scene.splatting.radius);
        let bricks = brick_list(volume, &finished.transfer, &clipped);
        let support = Kernel::new(scene.splatting.radius, scene.splatting.falloff).support();
        bricks.bricks().iter().for_each(|brick| work.add(brick, &view, support));
        Ok(work)
    }

    /// Adds the work of a brick, evenly over its box on the screen and its slabs.
    fn add(&mut self, brick: &Brick, view: &ViewGeometry, support: f64) {
        let (middle, half) = brick::bounds(brick);
        let Some(bounds) = view.bounds(middle, half) else { return };
        let Some(slabs) = view.slabs.covered(bounds.depths.clone()) else { return };
        let half_box = view.half_box(support, bounds.depths);
        let cells = |axis: usize| {
            let last = f64::from(self.size[axis]);
            let low = (bounds.low - half_box)[axis].clamp(0.0, last);
            let high = (bounds.high + half_box)[axis].clamp(0.0, last);
            let cell = f64::from(self.cell);
            (low / cell) as usize..((high / cell).ceil() as usize).min(self.cells[axis])
        };
        let (columns, rows) = (cells(0), cells(1));
        let bin = |slab: i32| {
            let at = i64::from(slab.clamp(self.slabs.start, self.slabs.end)) - i64::from(self.slabs.start);
            at as usize * self.bins / self.slabs.len().max(1)
        };
        let bins = bin(slabs.start)..(bin(slabs.end - 1) + 1).min(self.bins);
        let pixels = (2.0 * half_box.x * 2.0 * half_box.y).min(f64::from(self.size[0]) * f64::from(self.size[1]));
        let places = (columns.len() * rows.len() * bins.len()) as f64;
        let amount = f64::from(brick::present(brick).count_ones()) * pixels * slabs.len() as f64 / places;
        for (row, column) in rows.flat_map(|row| columns.clone().map(move |column| (row, column))) {
            let first = (row * self.cells[0] + column) * self.bins;
            self.amounts[first..first + self.bins][bins.clone()].iter_mut().for_each(|work| *work += amount);
        }
    }

    fn of_cell(&self, [column, row]: [usize; 2]) -> &[f64] {
        &self.amounts[(row * self.cells[0] + column) * self.bins..][..self.bins]
    }

    /// The work of a column or row of cells in an area.
    fn line(&self, area: &Area, axis: usize, at: usize) -> f64 {
        let across = if axis == 0 { area.y.clone() } else { area.x.clone() };
        let cell = |other: usize| if axis == 0 { [at, other] } else { [other, at] };
        across.map(|other| self.of_cell(cell(other)).iter().sum::<f64>()).sum()
    }

    /// Divides an area into one for each count, of work in proportion to it. Where cells are too few, counts share one.
    fn divide(&self, area: Area, counts: &[usize], found: &mut Vec<(Area, usize)>) {
        let total: usize = counts.iter().sum();
        let axis = usize::from(area.y.len() > area.x.len());
        let along = if axis == 0 { area.x.clone() } else { area.y.clone() };
        if counts.len() == 1 || along.len() < 2 {
            return found.push((area, total));
        }
        let (first, second) = counts.split_at(counts.len() / 2);
        let share = first.iter().sum::<usize>() as f64 / total as f64;
        let lines: Vec<f64> = along.clone().map(|at| self.line(&area, axis, at)).collect();
        let cut = along.start + nearest_cut(&lines, share);
        let (mut low, mut high) = (Area { x: area.x.clone(), y: area.y.clone() }, area);
        match axis {
            0 => (low.x.end, high.x.start) = (cut, cut),
            _ => (low.y.end, high.y.start) = (cut, cut),
        }
        self.divide(low, first, found);
        self.divide(high, second, found);
    }

    /// The pixels of an area.
    fn region(&self, area: &Area) -> Region {
        let ends = |cells: &Range<usize>, axis: usize| {
            [cells.start, cells.end].map(|cell| (cell as u32 * self.cell).min(self.size[axis]))
        };
        let ([left, right], [top, bottom]) = (ends(&area.x, 0), ends(&area.y, 1));
        Region { x: left, y: top, width: right - left, height: bottom - top }
    }

    /// Divides the slabs of an area into ranges of about equal work, none of which is empty.
    fn ranges(&self, area: &Area, count: usize) -> Vec<Range<i32>> {
        let mut bins = vec![0.0; self.bins];
        for (y, x) in area.y.clone().flat_map(|y| area.x.clone().map(move |x| (y, x))) {
            bins.iter_mut().zip(self.of_cell([x, y])).for_each(|(sum, work)| *sum += work);
        }
        let total: f64 = bins.iter().sum();
        let per_bin = self.slabs.len() as f64 / self.bins as f64;
        // Where the work before a place is this share of all.
        let place = |share: f64| {
            let (mut sum, wanted) = (0.0, share * total);
            for (at, work) in bins.iter().enumerate() {
                if sum + work >= wanted && *work > 0.0 {
                    return (at as f64 + (wanted - sum) / work) * per_bin;
                }
                sum += work;
            }
            share * self.slabs.len() as f64
        };
        let (first, end) = (self.slabs.start, self.slabs.end);
        let (mut start, mut ranges) = (first, Vec::new());
        for at in 1..=count {
            let left = (count - at) as i32;
            let wanted = if at == count { end } else { first + place(at as f64 / count as f64).round() as i32 };
            let cut = wanted.clamp(start + 1, end - left);
            ranges.push(start..cut);
            start = cut;
        }
        ranges
    }
}

/// How many of some lines, but not all, have the work nearest to a share of all.
fn nearest_cut(lines: &[f64], share: f64) -> usize {
    let total: f64 = lines.iter().sum();
    if total == 0.0 {
        return ((lines.len() as f64 * share).round() as usize).clamp(1, lines.len() - 1);
    }
    let (mut sum, mut best, mut error) = (0.0, 1, f64::INFINITY);
    for (at, line) in lines[..lines.len() - 1].iter().enumerate() {
        sum += line;
        let found = (sum - share * total).abs();
        if found < error {
            (best, error) = (at + 1, found);
        }
    }
    best
}
