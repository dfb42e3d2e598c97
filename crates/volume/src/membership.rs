//! Normals of label maps: the gradient of a label's membership, which is 1 in its voxels and 0 elsewhere, by weighted regression over a window of
//! 9×9×9 voxels (SPEC §15). It depends on labels alone, so that a volume keeps it: in blocks of 8×8×8 voxels, each computed when one of its
//! voxels is first asked for.

use std::sync::{Arc, OnceLock};

use glam::{DVec3, UVec3};

use super::grid::Grid;

/// How far the window reaches from its voxel along each axis.
#[doc(hidden)]
pub const MEMBERSHIP_REACH: u32 = 4;
const REACH: usize = MEMBERSHIP_REACH as usize;

/// The side of a block in voxels.
const SIDE: usize = 8;

/// The number of taps of a window along an axis.
const TAPS: usize = 2 * REACH + 1;

/// The side of what bears on a block.
const SPAN: usize = SIDE + 2 * REACH;

const VOXELS: usize = SIDE * SIDE * SIDE;

/// Membership per voxel below which a gradient is 0: what rounding leaves of a window with one label, or with labels that balance. One other voxel at
/// the corner of a window gives 2.7e-5.
const NOTHING: f64 = 1e-12;

/// The gradients that a volume keeps, shared by its clones.
#[derive(Clone, Debug, Default)]
pub(super) struct KeptMembership(Arc<OnceLock<Membership>>);

/// The labels of a volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Members {
    /// Its values: a label map.
    OfValues,
    /// The labels beside its values: a segmented volume.
    OfLabels,
}

/// The gradients of the membership of every voxel's own label.
#[derive(Debug)]
struct Membership {
    across: UVec3,
    /// The only label of each block; NaN where there are several, or a hole. No block waits for another, which might be a task of the same thread.
    only: Box<[OnceLock<f32>]>,
    blocks: Box<[OnceLock<Option<Box<Block>>>]>,
}

/// The gradients in a block, where a voxel has one.
#[derive(Debug)]
pub(super) struct Block {
    /// Which voxels have one: a bit each, x fastest.
    has: [u64; SIDE],
    /// Their gradients, in membership per voxel along each axis.
    gradients: Box<[[f32; 3]]>,
}

impl Block {
    /// The gradient of one of its voxels, in membership per voxel.
    pub(super) fn at(&self, voxel: UVec3) -> [f32; 3] {
        let [x, y, word] = voxel.to_array().map(|at| at as usize % SIDE);
        let bit = x + SIDE * y;
        if self.has[word] >> bit & 1 == 0 {
            return [0.0; 3];
        }
        let before: u32 = self.has[..word].iter().map(|bits| bits.count_ones()).sum();
        self.gradients[(before + (self.has[word] & ((1 << bit) - 1)).count_ones()) as usize]
    }
}

impl KeptMembership {
    /// The gradients in the block of a voxel of a grid, if any voxel of the block has one. `label` tells the label of a voxel, given by its index: NaN in a hole.
    pub(super) fn block(&self, grid: &Grid, voxel: UVec3, label: impl Fn(usize) -> f32) -> Option<&Block> {
        let all = self.0.get_or_init(|| Membership::new(grid));
        let (at, label) = (voxel / SIDE as u32, &label);
        let gradients = || if all.is_plain(grid, at, label) { None } else { block(label, grid, at) };
        all.blocks[all.number(at)].get_or_init(gradients).as_deref()
    }
}

impl Membership {
    fn new(grid: &Grid) -> Self {
        let across = grid.dims.map(|count| count.div_ceil(SIDE as u32));
        let count = 0..across.element_product();
        let (only, blocks) = (count.clone().map(|_| OnceLock::new()), count.map(|_| OnceLock::new()));
        Self { across, only: only.collect(), blocks: blocks.collect() }
    }

    fn number(&self, at: UVec3) -> usize {
        Grid::new(self.across, DVec3::ONE).index_of(at) as usize
    }

    /// Whether a block and those around it have one label.
    fn is_plain(&self, grid: &Grid, at: UVec3, label: &impl Fn(usize) -> f32) -> bool {
        let only = |at: UVec3| *self.only[self.number(at)].get_or_init(|| only(label, grid, at));
        let here = only(at);
        let [low, high] = [at.saturating_sub(UVec3::ONE), (at + 1).min(self.across - 1)];
        let mut around = (low.z..=high.z).flat_map(|z| (low.y..=high.y).map(move |y| UVec3::new(0, y, z)));
        around.all(|row| (low.x..=high.x).all(|x| only(row.with_x(x)) == here))
    }
}

/// The only label of a block, or NaN.
fn only(label: &impl Fn(usize) -> f32, grid: &Grid, at: UVec3) -> f32 {
    let low = at * SIDE as u32;
    let high = (low + SIDE as u32).min(grid.dims);
    let first = label(grid.index_of(low) as usize);
    let mut rows = (low.z..high.z).flat_map(|z| (low.y..high.y).map(move |y| low.with_y(y).with_z(z)));
    let is_plain = rows.all(|row| {
        let from = grid.index_of(row) as usize;
        (from..from + (high.x - low.x) as usize).all(|index| label(index) == first)
    });
    if is_plain { first } else { f32::NAN }
}

/// The weights of a window along an axis, cut at the border: for the mean, and for the slope.
#[derive(Clone, Copy)]
struct Taps {
    mean: [f64; TAPS],
    slope: [f64; TAPS],
}

impl Taps {
    /// The weights of the window around a voxel, given by its place among `count` voxels along the axis.
    fn new(at: usize, count: usize) -> Self {
        let offsets: [f64; TAPS] = std::array::from_fn(|tap| tap as f64 - REACH as f64);
        let is_inside = |tap: usize| (REACH..count + REACH).contains(&(at + tap));
        let weights: [f64; TAPS] = std::array::from_fn(|tap| match is_inside(tap) {
            true => libm::exp(-offsets[tap] * offsets[tap] / 8.0),
            false => 0.0,
        });
        let total: f64 = weights.iter().sum();
        let middle = weights.iter().zip(offsets).map(|(weight, offset)| weight * offset).sum::<f64>() / total;
        let from_middle = offsets.map(|offset| offset - middle);
        let variance: f64 = weights.iter().zip(from_middle).map(|(weight, offset)| weight * offset * offset).sum();
        let slope = |tap: usize| if variance > 0.0 { weights[tap] * from_middle[tap] / variance } else { 0.0 };
        Self { mean: weights.map(|weight| weight / total), slope: std::array::from_fn(slope) }
    }

    /// The weights for each of a block's voxels along an axis of `count` voxels.
    fn of_block(first: u32, count: u32) -> [Self; SIDE] {
        // A block may reach beyond the border, where no voxel is asked for.
        std::array::from_fn(|at| Self::new((first as usize + at).min(count as usize - 1), count as usize))
    }
}

/// The gradients of a block; `None` if no voxel has one.
fn block(label: &impl Fn(usize) -> f32, grid: &Grid, at: UVec3) -> Option<Box<Block>> {
    let first = at * SIDE as u32;
    let labels = around(label, grid, first);
    let mut present: Vec<f32> = Vec::new();
    for &label in labels.iter().filter(|label| !label.is_nan()) {
        if present.last() != Some(&label) && !present.contains(&label) {
            present.push(label);
        }
    }
    let taps = [0, 1, 2].map(|axis| Taps::of_block(first[axis], grid.dims[axis]));
    let mut gradients = vec![[0.0_f64; 3]; VOXELS];
    for label in present {
        let own: Vec<usize> = (0..VOXELS).filter(|&slot| labels[centre(slot)] == label).collect();
        if !own.is_empty() {
            let slopes = slopes(&labels, label, &taps);
            own.into_iter().for_each(|slot| gradients[slot] = slopes[slot / SIDE].map(|row| row[slot % SIDE]));
        }
    }
    let mut has = [0_u64; SIDE];
    let is_something = |gradient: &[f64; 3]| gradient.iter().any(|slope| slope.abs() > NOTHING);
    for (slot, _) in gradients.iter().enumerate().filter(|(_, gradient)| is_something(gradient)) {
        has[slot / 64] |= 1 << (slot % 64);
    }
    let kept: Box<[[f32; 3]]> =
        gradients.into_iter().filter(is_something).map(|gradient| gradient.map(|slope| slope as f32)).collect();
    (!kept.is_empty()).then(|| Box::new(Block { has, gradients: kept }))
}

/// The place of a block's voxel among all that bear on the block.
fn centre(slot: usize) -> usize {
    let [x, y, z] = [slot % SIDE, slot / SIDE % SIDE, slot / SIDE / SIDE];
    x + REACH + SPAN * (y + REACH + SPAN * (z + REACH))
}

/// The places within the border among all that bear on a block: the first, and the one behind the last.
fn inside(grid: &Grid, first: UVec3) -> [UVec3; 2] {
    let reach = UVec3::splat(MEMBERSHIP_REACH);
    [reach.saturating_sub(first), (grid.dims + reach - first).min(UVec3::splat(SPAN as u32))]
}

/// The labels that bear on a block; NaN beyond the border, as in holes.
fn around(label: &impl Fn(usize) -> f32, grid: &Grid, first: UVec3) -> Vec<f32> {
    let mut labels = vec![f32::NAN; SPAN * SPAN * SPAN];
    let [low, end] = inside(grid, first);
    for z in low.z..end.z {
        for y in low.y..end.y {
            let from = grid.index_of(first + UVec3::new(low.x, y, z) - MEMBERSHIP_REACH) as usize;
            let row = SPAN * (y as usize + SPAN * z as usize);
            let places = row + low.x as usize..row + end.x as usize;
            labels[places].iter_mut().zip(from..).for_each(|(own, index)| *own = label(index));
        }
    }
    labels
}

/// Numbers of a row of a block's voxels.
type Row = [f64; SIDE];

/// Adds the products of numbers and a weight to a row.
fn add(row: &mut Row, weight: f64, numbers: &Row) {
    row.iter_mut().zip(numbers).for_each(|(sum, number)| *sum += weight * number);
}

/// The slopes of one label's membership along x, y and z, by rows of a block's voxels. The window's weights are products of such along each axis, so that
/// sums go axis after axis, each over its taps in order: a voxel's are the same in any block.
fn slopes(labels: &[f32], label: f32, [along_x, along_y, along_z]: &[[Taps; SIDE]; 3]) -> [[Row; 3]; SIDE * SIDE] {
    const NONE: Row = [0.0; SIDE];
    // First along x: every row's mean of the membership, and its slope.
    let (mut mean, mut slope) = ([NONE; SPAN * SPAN], [NONE; SPAN * SPAN]);
    for ((labels, mean), slope) in labels.chunks_exact(SPAN).zip(&mut mean).zip(&mut slope) {
        let shares: [f64; SPAN] = std::array::from_fn(|x| f64::from(u8::from(labels[x] == label)));
        if shares.iter().any(|&share| share > 0.0) {
            for tap in 0..TAPS {
                for x in 0..SIDE {
                    mean[x] += along_x[x].mean[tap] * shares[x + tap];
                    slope[x] += along_x[x].slope[tap] * shares[x + tap];
                }
            }
        }
    }
    // Then along y: the mean of slopes along x, the slope of means, and the mean of means.
    let mut of_layers = [[NONE; 3]; SIDE * SPAN];
    for (at, sums) in of_layers.iter_mut().enumerate() {
        let (y, layer) = (at % SIDE, at / SIDE);
        for tap in 0..TAPS {
            let row = y + tap + SPAN * layer;
            add(&mut sums[0], along_y[y].mean[tap], &slope[row]);
            add(&mut sums[1], along_y[y].slope[tap], &mean[row]);
            add(&mut sums[2], along_y[y].mean[tap], &mean[row]);
        }
    }
    // Last along z: the means of both slopes, and the slope of means.
    let mut slopes = [[NONE; 3]; SIDE * SIDE];
    for (at, sums) in slopes.iter_mut().enumerate() {
        let (y, z) = (at % SIDE, at / SIDE);
        for tap in 0..TAPS {
            let weights = [along_z[z].mean[tap], along_z[z].mean[tap], along_z[z].slope[tap]];
            for (axis, weight) in weights.into_iter().enumerate() {
                add(&mut sums[axis], weight, &of_layers[y + SIDE * (z + tap)][axis]);
            }
        }
    }
    slopes
}
