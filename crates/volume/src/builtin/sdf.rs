//! Signed distances (negative inside), and how solids become voxel values.

use glam::{DVec3, UVec3};

use super::Grid;
use crate::parallel::prelude::*;

/// The edge, in voxels, of the largest blocks that are tested as a whole.
const BLOCK: u32 = 8;

/// Half the width of the smooth step into a tissue, in units of the finest spacing.
const SOFTNESS: f64 = 1.25;

/// An upper bound on how fast the distance estimates below change, relative to the true distance. A block farther from a surface than
/// this times its radius lies on one side of it.
const SLACK: f64 = 1.5;

/// Distance to an ellipsoid, to first order: exact at the surface, the right sign elsewhere.
pub(super) fn ellipsoid(p: DVec3, center: DVec3, radii: DVec3) -> f64 {
    let q = (p - center) / radii;
    let (level, slope) = (q.length(), (q / radii).length());
    if slope > 0.0 { level * (level - 1.0) / slope } else { -radii.min_element() }
}

/// Distance to a tube from `a` to `b` with rounded ends, whose radius goes from `radii.0` to `radii.1`.
pub(super) fn tube(p: DVec3, a: DVec3, b: DVec3, radii: (f64, f64)) -> f64 {
    let axis = b - a;
    let t = ((p - a).dot(axis) / axis.length_squared()).clamp(0.0, 1.0);
    (p - a - t * axis).length() - radii.0 - t * (radii.1 - radii.0)
}

/// The union of two solids, with the crease between them filled over a width of about `k`.
pub(super) fn union(a: f64, b: f64, k: f64) -> f64 {
    let overlap = (k - (a - b).abs()).max(0.0);
    a.min(b) - overlap * overlap / (4.0 * k)
}

/// The intersection of two solids, with the edge rounded over a width of about `k`.
pub(super) fn intersection(a: f64, b: f64, k: f64) -> f64 {
    -union(-a, -b, k)
}

/// A sine-like wave of period 1 and amplitude 1 made of parabolas, the same on every machine.
pub(super) fn wave(t: f64) -> f64 {
    // Adding 1.5·2⁵² leaves no bits for the fraction, which rounds to the nearest whole number without a function call.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    let t = t - ((t + ROUND) - ROUND);
    16.0 * t * (0.5 - t.abs())
}

/// A cubic step from 0 at `low` to 1 at `high`.
pub(super) fn smoothstep(low: f64, high: f64, x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// A part of a sculpture: a shape, how it joins the solid so far, and the width over which it blends.
pub(super) enum Part {
    /// Adds an ellipsoid: centre, radii, blend width.
    Add([f64; 3], [f64; 3], f64),
    /// Adds a tube: two ends, the radii there, blend width.
    AddTube([f64; 3], [f64; 3], (f64, f64), f64),
    /// Cuts out an ellipsoid: centre, radii, blend width.
    Cut([f64; 3], [f64; 3], f64),
    /// Cuts out a tube: two ends, the radii there, blend width.
    CutTube([f64; 3], [f64; 3], (f64, f64), f64),
}

/// Distance to the solid at distance `start` after the parts are applied in order.
pub(super) fn sculpt(p: DVec3, start: f64, parts: &[Part]) -> f64 {
    parts.iter().fold(start, |d, part| match *part {
        Part::Add(center, radii, k) => union(d, ellipsoid(p, center.into(), radii.into()), k),
        Part::AddTube(from, to, radii, k) => union(d, tube(p, from.into(), to.into(), radii), k),
        Part::Cut(center, radii, k) => intersection(d, -ellipsoid(p, center.into(), radii.into()), k),
        Part::CutTube(from, to, radii, k) => intersection(d, -tube(p, from.into(), to.into(), radii), k),
    })
}

/// One more than the maximum label; 0 means that no layer covers the voxel.
const LABELS: usize = 8;

/// The value and label that a voxel is painted with.
#[derive(Clone, Copy)]
pub(super) struct Tissue {
    pub(super) value: f64,
    pub(super) label: u16,
}

/// A tissue and its signed distance as a function of the world position.
pub(super) struct Layer<'a> {
    tissue: Tissue,
    /// The depth below the surface at which another tissue begins.
    depth: f64,
    core: Tissue,
    distance: Box<dyn Fn(DVec3) -> f64 + Sync + 'a>,
}

impl<'a> Layer<'a> {
    pub(super) fn new(value: f64, label: u16, distance: impl Fn(DVec3) -> f64 + Sync + 'a) -> Self {
        let tissue = Tissue { value, label };
        Self { tissue, depth: 0.0, core: tissue, distance: Box::new(distance) }
    }

    /// The same layer with another tissue below a depth.
    pub(super) fn with_core(self, depth: f64, value: f64, label: u16) -> Self {
        Self { depth, core: Tissue { value, label }, ..self }
    }
}

/// Values and labels of some slices, from slice `z` on.
struct Slab<'a> {
    z: u32,
    values: &'a mut [f32],
    labels: &'a mut [u16],
}

impl Grid {
    /// The world position of a (fractional) voxel.
    pub(super) fn position(&self, voxel: DVec3) -> DVec3 {
        (voxel - self.center()) * self.spacing
    }

    /// Paints layers over each other onto 0, in order, with edges as soft as a scanner's. A voxel that is longer than wide is a mean along
    /// its length that reaches into its neighbours, as a thick slice is. A voxel's label is the tissue that fills most of it.
    pub(super) fn paint(&self, layers: &[Layer]) -> (Vec<f32>, Vec<u16>) {
        let slice = self.dims.x as usize * self.dims.y as usize;
        let count = slice * self.dims.z as usize;
        let (mut values, mut labels) = (vec![0.0; count], vec![0; count]);
        let everything: Vec<_> = layers.iter().collect();
        let slabs = slice * BLOCK as usize;
        let slabs = values.par_chunks_mut(slabs).zip(labels.par_chunks_mut(slabs));
        slabs.enumerate().for_each(|(slab, (values, labels))| {
            let z = slab as u32 * BLOCK;
            let mut slab = Slab { z, values, labels };
            for y in (0..self.dims.y).step_by(BLOCK as usize) {
                for x in (0..self.dims.x).step_by(BLOCK as usize) {
                    self.paint_block(&mut slab, UVec3::new(x, y, z), BLOCK, &everything);
                }
            }
        });
        (values, labels)
    }

    /// Paints the block of `size`³ voxels at `low`. Only layers that can change within the block are passed to its octants.
    fn paint_block(&self, slab: &mut Slab, low: UVec3, size: u32, layers: &[&Layer]) {
        let high = (low + size).min(self.dims);
        if low.cmpge(high).any() {
            return;
        }
        // The distance from the centre to the farthest sampled position.
        let extent = (high - low - 1).as_dvec3() + if self.samples() > 1 { 2.0 * DVec3::Z } else { DVec3::ZERO };
        let reach = (extent * self.spacing).length() / 2.0 * SLACK + SOFTNESS * self.unit();
        let center = self.position((low + high - 1).as_dvec3() / 2.0);
        let mut kept: Vec<&Layer> = Vec::with_capacity(layers.len());
        let mut uniform = Some(Tissue { value: 0.0, label: 0 });
        // Layers from the top down to one that hides all others.
        for &layer in layers.iter().rev() {
            let distance = (layer.distance)(center);
            if distance > reach {
                continue;
            }
            let solid = (distance < -reach - layer.depth).then_some(layer.core);
            uniform = solid.filter(|_| kept.is_empty());
            kept.push(layer);
            if distance < -reach {
                break;
            }
        }
        kept.reverse();
        let z = slab.z;
        let row = |y: u32, k: u32| (self.dims.x as usize) * (y as usize + self.dims.y as usize * (k - z) as usize);
        if let Some(Tissue { value, label }) = uniform {
            for (k, y) in (low.z..high.z).flat_map(|k| (low.y..high.y).map(move |y| (k, y))) {
                let voxels = row(y, k) + low.x as usize..row(y, k) + high.x as usize;
                slab.values[voxels.clone()].fill(value as f32);
                slab.labels[voxels].fill(label);
            }
        } else if size > 2 {
            for corner in 0..8 {
                let offset = UVec3::new(corner & 1, corner >> 1 & 1, corner >> 2) * (size / 2);
                self.paint_block(slab, low + offset, size / 2, &kept);
            }
        } else {
            for (k, y) in (low.z..high.z).flat_map(|k| (low.y..high.y).map(move |y| (k, y))) {
                for x in low.x..high.x {
                    let at = row(y, k) + x as usize;
                    (slab.values[at], slab.labels[at]) = self.voxel(UVec3::new(x, y, k), &kept);
                }
            }
        }
    }

    fn voxel(&self, voxel: UVec3, layers: &[&Layer]) -> (f32, u16) {
        // Weights of a tent from slice to slice.
        let n = self.samples();
        let (mut sum, mut shares) = (0.0, [0.0; LABELS]);
        for k in 1 - n..n {
            let shift = DVec3::Z * (f64::from(k) / f64::from(n));
            let weight = f64::from(n - k.abs());
            sum += weight * self.value(self.position(voxel.as_dvec3() + shift), layers, weight, &mut shares);
        }
        // The lowest label wins a tie.
        let most = (1..LABELS).fold(0, |most, label| if shares[label] > shares[most] { label } else { most });
        ((sum / f64::from(n * n)).round() as f32, most as u16)
    }

    /// The value at a world position, from the top layer down as long as it is transparent. Adds each tissue's fraction, times `weight`,
    /// to the labels' shares.
    fn value(&self, p: DVec3, layers: &[&Layer], weight: f64, shares: &mut [f64; LABELS]) -> f64 {
        let soft = SOFTNESS * self.unit();
        let (mut value, mut through) = (0.0, 1.0);
        for &&Layer { tissue, depth, core, ref distance } in layers.iter().rev() {
            let distance = distance(p);
            let coverage = smoothstep(soft, -soft, distance);
            let in_core = smoothstep(soft, -soft, distance + depth);
            value += through * coverage * (tissue.value + (core.value - tissue.value) * in_core);
            shares[usize::from(tissue.label)] += weight * through * coverage * (1.0 - in_core);
            shares[usize::from(core.label)] += weight * through * coverage * in_core;
            through *= 1.0 - coverage;
            if through == 0.0 {
                break;
            }
        }
        shares[0] += weight * through;
        value
    }

    /// The number of samples per slice along z in a voxel's value.
    fn samples(&self) -> i32 {
        (self.spacing.z / self.unit()).round().max(1.0) as i32
    }
}
