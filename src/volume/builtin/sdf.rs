//! Signed distances (negative inside) and how a solid becomes voxel values.

use glam::{DVec3, UVec3};
use rayon::prelude::*;

use super::Grid;

/// Edge of the blocks that are decided at once, in voxels.
const BLOCK: u32 = 8;

/// Half the width of the smooth step from outside to inside a tissue, in units of the finest spacing.
const SOFTNESS: f64 = 1.25;

/// How much faster than the true distance the estimates below may change. Blocks farther from a surface than this
/// times their radius are taken to be on one side of it.
const SLACK: f64 = 1.5;

/// Distance to an ellipsoid, to first order: exact at the surface, the right sign elsewhere.
pub(super) fn ellipsoid(p: DVec3, center: DVec3, radii: DVec3) -> f64 {
    let q = (p - center) / radii;
    let (level, slope) = (q.length(), (q / radii).length());
    if slope > 0.0 { level * (level - 1.0) / slope } else { -radii.min_element() }
}

/// Distance to a tube from `a` to `b` with rounded ends, its radius going from `radii.0` to `radii.1`.
pub(super) fn tube(p: DVec3, a: DVec3, b: DVec3, radii: (f64, f64)) -> f64 {
    let axis = b - a;
    let t = ((p - a).dot(axis) / axis.length_squared()).clamp(0.0, 1.0);
    (p - a - t * axis).length() - radii.0 - t * (radii.1 - radii.0)
}

/// Both solids, the crease between them filled over a width of about `k`.
pub(super) fn union(a: f64, b: f64, k: f64) -> f64 {
    let overlap = (k - (a - b).abs()).max(0.0);
    a.min(b) - overlap * overlap / (4.0 * k)
}

/// What is in both solids, the edge rounded over a width of about `k`.
pub(super) fn intersection(a: f64, b: f64, k: f64) -> f64 {
    -union(-a, -b, k)
}

/// A wave of period 1 and amplitude 1 that looks like a sine, from arcs of parabolas: the same on every machine.
pub(super) fn wave(t: f64) -> f64 {
    // Adding 1.5·2⁵² leaves no bits for the fraction: the nearest whole number, without a call.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    let t = t - ((t + ROUND) - ROUND);
    16.0 * t * (0.5 - t.abs())
}

/// A cubic step from 0 at `low` to 1 at `high`.
pub(super) fn smoothstep(low: f64, high: f64, x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// One part of a sculpture: a shape, how it joins what is there, and over which width.
pub(super) enum Part {
    /// Adds an ellipsoid: centre, radii, width.
    Add([f64; 3], [f64; 3], f64),
    /// Adds a tube: from, to, the radii there, width.
    AddTube([f64; 3], [f64; 3], (f64, f64), f64),
    /// Takes an ellipsoid away: centre, radii, width.
    Cut([f64; 3], [f64; 3], f64),
    /// Takes a tube away: from, to, the radii there, width.
    CutTube([f64; 3], [f64; 3], (f64, f64), f64),
}

/// Distance to what the parts make of a solid at distance `start`, in order.
pub(super) fn sculpt(p: DVec3, start: f64, parts: &[Part]) -> f64 {
    parts.iter().fold(start, |d, part| match *part {
        Part::Add(center, radii, k) => union(d, ellipsoid(p, center.into(), radii.into()), k),
        Part::AddTube(from, to, radii, k) => union(d, tube(p, from.into(), to.into(), radii), k),
        Part::Cut(center, radii, k) => intersection(d, -ellipsoid(p, center.into(), radii.into()), k),
        Part::CutTube(from, to, radii, k) => intersection(d, -tube(p, from.into(), to.into(), radii), k),
    })
}

/// A tissue: its value, and the distance to it at a world position.
pub(super) struct Layer<'a> {
    value: f64,
    /// How deep below the surface another tissue begins, and its value.
    core: (f64, f64),
    distance: Box<dyn Fn(DVec3) -> f64 + Sync + 'a>,
}

impl<'a> Layer<'a> {
    pub(super) fn new(value: f64, distance: impl Fn(DVec3) -> f64 + Sync + 'a) -> Self {
        Self { value, core: (0.0, value), distance: Box::new(distance) }
    }

    /// The same with another tissue from a depth on.
    pub(super) fn with_core(self, depth: f64, value: f64) -> Self {
        Self { core: (depth, value), ..self }
    }
}

impl Grid {
    /// World position of a (fractional) voxel.
    pub(super) fn position(&self, voxel: DVec3) -> DVec3 {
        (voxel - self.center()) * self.spacing
    }

    /// Values of layers painted over each other onto 0, in order, with edges as soft as a scanner's. A voxel longer
    /// than it is wide is a mean along its length that reaches to the next ones, as a thick slice is.
    pub(super) fn paint(&self, layers: &[Layer]) -> Vec<f32> {
        let slice = self.dims.x as usize * self.dims.y as usize;
        let mut values = vec![0.0; slice * self.dims.z as usize];
        let everything: Vec<_> = layers.iter().collect();
        values.par_chunks_mut(slice * BLOCK as usize).enumerate().for_each(|(slab, values)| {
            let z = slab as u32 * BLOCK;
            for y in (0..self.dims.y).step_by(BLOCK as usize) {
                for x in (0..self.dims.x).step_by(BLOCK as usize) {
                    self.paint_block(values, z, UVec3::new(x, y, z), BLOCK, &everything);
                }
            }
        });
        values
    }

    /// Paints the block of `size`³ voxels at `low` into `values`, which start at slice `z`. Only the layers that can
    /// change within the block are handed down to its eighths.
    fn paint_block(&self, values: &mut [f32], z: u32, low: UVec3, size: u32, layers: &[&Layer]) {
        let high = (low + size).min(self.dims);
        if low.cmpge(high).any() {
            return;
        }
        // From the centre to the farthest place that a voxel is sampled at.
        let extent = (high - low - 1).as_dvec3() + if self.samples() > 1 { 2.0 * DVec3::Z } else { DVec3::ZERO };
        let reach = (extent * self.spacing).length() / 2.0 * SLACK + SOFTNESS * self.unit();
        let center = self.position((low + high - 1).as_dvec3() / 2.0);
        let mut kept: Vec<&Layer> = Vec::with_capacity(layers.len());
        let mut uniform = Some(0.0);
        // From the top down to one that hides the others.
        for &layer in layers.iter().rev() {
            let distance = (layer.distance)(center);
            if distance > reach {
                continue;
            }
            let solid = (distance < -reach - layer.core.0).then_some(layer.core.1);
            uniform = solid.filter(|_| kept.is_empty());
            kept.push(layer);
            if distance < -reach {
                break;
            }
        }
        kept.reverse();
        let row = |y: u32, k: u32| (self.dims.x as usize) * (y as usize + self.dims.y as usize * (k - z) as usize);
        if let Some(value) = uniform {
            for (k, y) in (low.z..high.z).flat_map(|k| (low.y..high.y).map(move |y| (k, y))) {
                values[row(y, k) + low.x as usize..row(y, k) + high.x as usize].fill(value as f32);
            }
        } else if size > 2 {
            for corner in 0..8 {
                let offset = UVec3::new(corner & 1, corner >> 1 & 1, corner >> 2) * (size / 2);
                self.paint_block(values, z, low + offset, size / 2, &kept);
            }
        } else {
            for (k, y) in (low.z..high.z).flat_map(|k| (low.y..high.y).map(move |y| (k, y))) {
                for x in low.x..high.x {
                    values[row(y, k) + x as usize] = self.voxel(UVec3::new(x, y, k), &kept);
                }
            }
        }
    }

    fn voxel(&self, voxel: UVec3, layers: &[&Layer]) -> f32 {
        // Weights of a tent from slice to slice.
        let n = self.samples();
        let sum: f64 = (1 - n..n)
            .map(|k| {
                let shift = DVec3::Z * (f64::from(k) / f64::from(n));
                f64::from(n - k.abs()) * self.value(self.position(voxel.as_dvec3() + shift), layers)
            })
            .sum();
        (sum / f64::from(n * n)).round() as f32
    }

    /// The value at a world position: from the top layer down, as long as something shows through.
    fn value(&self, p: DVec3, layers: &[&Layer]) -> f64 {
        let soft = SOFTNESS * self.unit();
        let (mut value, mut through) = (0.0, 1.0);
        for layer in layers.iter().rev() {
            let distance = (layer.distance)(p);
            let (depth, core) = layer.core;
            let coverage = smoothstep(soft, -soft, distance);
            let tissue = layer.value + (core - layer.value) * smoothstep(soft, -soft, distance + depth);
            value += through * coverage * tissue;
            through *= 1.0 - coverage;
            if through == 0.0 {
                break;
            }
        }
        value
    }

    /// Samples along z that a voxel's value is made of, per slice.
    fn samples(&self) -> i32 {
        (self.spacing.z / self.unit()).round().max(1.0) as i32
    }
}
