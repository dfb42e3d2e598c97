//! Kernel sections added to a tile's sheet buffers (SPEC §5), a pixel at a time and all sections of a voxel at once; the same sums as
//! `shaders/splat.wgsl`. Each pixel's additions come in the order in which voxels do, whatever the vectors' width.

use fearless_simd::prelude::*;
use fearless_simd::{f32x4, f32x8, u8x32};

use super::cull::{OpenMask, Pixels};
use super::kernel::KernelTables;
use super::reached::Reached;
use super::sheets::{BySlot, CHANNELS, COLUMNS, HALF_RING, PixelSums, RING, ROWS, Ring, SECTIONS, Sums, slot_of};

/// Slack around footprints' boxes in perspective: pixels, and a fraction of the box.
const SLACK: f32 = 1e-3;
const RELATIVE_SLACK: f32 = 1e-5;

/// The footprints that are listed together at the most.
const MOST_FOOTPRINTS: usize = 16;

/// A voxel in the coordinates of a tile.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Splat {
    /// Its pixel coordinates; the centre of the tile's first pixel is at 0, 0.
    pub(super) center: [f32; 2],
    /// The pixels of the tile that it may reach.
    pub(super) pixels: Pixels,
    /// `(C·m, m)` over λ, and the low-pass amplitude where it is the same for all sections.
    pub(super) amount: [f32; 4],
    /// The range of sheets still to be drawn, in the order of compositing.
    pub(super) sheets: [i32; 2],
    /// The distance from the voxel to the plane where that range begins, grid units along its ray.
    pub(super) first_plane: f32,
    /// The distance from plane to plane.
    pub(super) step: f32,
    /// The voxel: the index of its brick among those that have arrived, and its slot there.
    pub(super) voxel: [u32; 2],
    /// Sheets that have been drawn, in units of [`SECTIONS`].
    pub(super) drawn: u32,
    /// In perspective.
    pub(super) local: LocalFootprint,
}

impl Splat {
    /// The number of sections to be drawn next.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn sections(&self) -> usize {
        ((self.sheets[1] - self.sheets[0]) as usize).min(SECTIONS)
    }
}

/// How a kernel lies on the screen in perspective: as [`Local`](super::project::Local), in f32.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LocalFootprint {
    pub(super) axis: [f32; 2],
    pub(super) metric: [f32; 2],
    pub(super) depth_per_warped: f32,
    pub(super) from_eye: f32,
    pub(super) cut: f32,
}

/// The data that all splats of a frame share.
#[derive(Clone, Debug)]
pub(super) struct Splatter {
    pub(super) kernel: KernelTables,
    pub(super) radius: f32,
    /// Orthographic: ρ² of a pixel offset (dx, dy) is `x·dx² + y·dx·dy + z·dy²`.
    pub(super) metric: [f32; 3],
    /// In perspective the size of a pixel at depth 1, `unit`s.
    pub(super) pixel_per_depth: Option<f32>,
    /// True if sheets hold whole kernels, whose footprint is that at the voxel's depth.
    pub(super) is_whole: bool,
}

/// The sections of a splat in up to [`SECTIONS`] sheets, by slot. Slots without a section have planes at one place.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sections {
    /// `H(0, 0, t)` of eq. 3 at the planes before the sections.
    near: BySlot,
    /// The same behind them.
    far: BySlot,
    /// In perspective ρ² of a pixel along the footprint's axis and across it, and the low-pass rule's amplitude.
    along: BySlot,
    across: BySlot,
    amplitude: BySlot,
}

/// Footprints that are listed together: the pixels that they reach, which are added to the sheets later.
#[derive(Debug)]
pub(super) struct Footprints {
    reached: Reached,
    /// Their sections, colours, and where their pixels end in the list.
    all: [(Sections, [f32; CHANNELS], usize); MOST_FOOTPRINTS],
    count: usize,
}

impl Footprints {
    pub(super) fn new() -> Self {
        Self { reached: Reached::new(), all: Default::default(), count: 0 }
    }

    /// Whether there may be no room for another one.
    pub(super) fn is_full(&self) -> bool {
        self.count == MOST_FOOTPRINTS || self.reached.is_full()
    }

    /// Forgets all of them.
    pub(super) fn clear(&mut self) {
        (self.count, self.reached.count) = (0, 0);
    }
}

/// The number of sheets from that of a slot on to that of every slot; [`RING`] where a vector's number belongs to no slot.
#[cfg_attr(not(debug_assertions), inline(always))]
fn order_from<S: Simd>(simd: S, slot: usize) -> f32x8<S> {
    const NONE: f32 = RING as f32;
    const ORDERS: [BySlot; RING] = [
        [0.0, 1.0, 2.0, NONE, 3.0, 4.0, 5.0, NONE],
        [5.0, 0.0, 1.0, NONE, 2.0, 3.0, 4.0, NONE],
        [4.0, 5.0, 0.0, NONE, 1.0, 2.0, 3.0, NONE],
        [3.0, 4.0, 5.0, NONE, 0.0, 1.0, 2.0, NONE],
        [2.0, 3.0, 4.0, NONE, 5.0, 0.0, 1.0, NONE],
        [1.0, 2.0, 3.0, NONE, 4.0, 5.0, 0.0, NONE],
    ];
    f32x8::load_array_ref(simd, &ORDERS[slot])
}

impl Splatter {
    /// The sections to be drawn next, and the pixels that any of them reaches; `None` for no pixel of the tile.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn sections<S: Simd>(&self, simd: S, splat: &Splat) -> (Sections, Option<Pixels>) {
        let splat_f32 = |number: f32| f32x8::splat(simd, number);
        let count = splat.sections();
        let order = order_from(simd, slot_of(splat.sheets[0]));
        let end = splat_f32(count as f32);
        let mut near = order.min(end) * splat.step + splat.first_plane;
        let mut far = (order + 1.0).min(end) * splat.step + splat.first_plane;
        let (mut sections, mut pixels) = (Sections::default(), Some(splat.pixels));
        if let Some(pixel_per_depth) = self.pixel_per_depth {
            let local = &splat.local;
            let cut = splat_f32(local.cut);
            (near, far) = (near.max(cut), far.max(cut));
            let radius = splat_f32(self.radius);
            let within = [near.max(-radius).min(radius), far.max(-radius).min(radius)];
            let middle = if self.is_whole { splat_f32(0.0) } else { (within[0] + within[1]) * 0.5 };
            let pix = (middle * local.depth_per_warped + local.from_eye) * pixel_per_depth;
            let squared = pix * pix;
            let (along, across) = (squared * local.metric[0], squared * local.metric[1]);
            // The low-pass rule: at least a pixel for a grid unit.
            let one = splat_f32(1.0);
            let amplitude = one / (along.max(one) * across.max(one)).sqrt();
            // Above 0, for pixels whose squares are too small.
            let least = splat_f32(1e-30);
            let (along, across) = (along.min(one).max(least), across.min(one).max(least));
            // Slots without a section are like the last one with a section.
            let [x, y] = local.axis.map(|component| component * component);
            let width = (one / along * x + one / across * y).sqrt() * self.kernel.support;
            let height = (one / along * y + one / across * x).sqrt() * self.kernel.support;
            // The box contains the footprint whatever is rounded, so that the footprint alone decides, and not the vectors that cover the box.
            let half_box = [width.reduce_max(), height.reduce_max()].map(|half| half * (1.0 + RELATIVE_SLACK) + SLACK);
            pixels = Pixels::within(splat.center, half_box);
            (sections.along, sections.across) = (along.to_array(), across.to_array());
            sections.amplitude = amplitude.to_array();
        }
        let (near, far) = self.kernel.along(simd, near.combine(far)).split();
        (sections.near, sections.far) = (near.to_array(), far.to_array());
        (sections, pixels)
    }

    /// Lists the open pixels of a tile that a splat's sections reach.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn list<S: Simd>(
        &self,
        simd: S,
        splat: &Splat,
        sections: &Sections,
        (pixels, open): (&Pixels, &OpenMask),
        footprints: &mut Footprints,
    ) {
        let Footprints { reached, all, count } = footprints;
        let limit = S::f32s::splat(simd, self.kernel.support_squared);
        match self.pixel_per_depth {
            // All sections have one footprint.
            None => {
                let [xx, xy, yy] = self.metric;
                reached.list(
                    simd,
                    splat.center,
                    pixels,
                    open,
                    #[cfg_attr(not(debug_assertions), inline(always))]
                    move |[dx, dy]: [S::f32s; 2]| {
                        let rho_squared = dx * (dx * xx + dy * xy) + dy * yy * dy;
                        (rho_squared.simd_lt(limit), [rho_squared])
                    },
                );
            }
            // Every section has its own, of the size that pixels have at its middle.
            Some(_) => {
                let load = |numbers: BySlot| f32x8::load_array(simd, numbers);
                // Of the largest section's footprint.
                let (least_along, least_across) =
                    (load(sections.along).reduce_min(), load(sections.across).reduce_min());
                let [x, y] = splat.local.axis;
                reached.list(
                    simd,
                    splat.center,
                    pixels,
                    open,
                    #[cfg_attr(not(debug_assertions), inline(always))]
                    move |[dx, dy]: [S::f32s; 2]| {
                        let (along, across) = (dx * x + dy * y, dx * -y + dy * x);
                        let (along, across) = (along * along, across * across);
                        ((along * least_along + across * least_across).simd_lt(limit), [along, across])
                    },
                );
            }
        }
        all[*count % MOST_FOOTPRINTS] = (*sections, splat.amount, reached.count);
        *count += 1;
    }

    /// Adds the listed footprints to the sheets, one after the other.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn add<S: Simd>(&self, simd: S, footprints: &mut Footprints, ring: &mut Ring) {
        let is_flat = self.pixel_per_depth.is_none();
        let Footprints { reached, all, count } = &mut *footprints;
        let Reached { count: listed, pixels, numbers } = reached;
        let [first, second] = &mut **numbers;
        if is_flat {
            let vectors = first.chunks_exact_mut(S::f32s::LEN).zip(second.chunks_exact_mut(S::f32s::LEN));
            for (first, second) in vectors.take(listed.div_ceil(S::f32s::LEN)) {
                let rho_squared = S::f32s::from_slice(simd, first);
                self.kernel.rim(simd, rho_squared).store_slice(first);
                self.kernel.in_plane(simd, rho_squared).store_slice(second);
            }
        }
        let mut start = 0;
        for (sections, color, end) in &all[..*count] {
            let range = start..*end;
            start = *end;
            let numbers = first[range.clone()].iter().zip(&second[range.clone()]);
            let pixels = pixels[range].iter().zip(numbers);
            let load = |numbers: BySlot| f32x8::load_array(simd, numbers);
            let (near, far) = (load(sections.near), load(sections.far));
            let (color, sums) = (splatted(simd, *color), &mut *ring.pixels);
            if is_flat {
                for (&pixel, (&rim, &in_plane)) in pixels {
                    let rim = f32x8::splat(simd, rim);
                    let weights = (cut_by_rim(far, rim) - cut_by_rim(near, rim)) * in_plane;
                    add(simd, weights, color, &mut sums[pixel as usize % (ROWS * COLUMNS)]);
                }
                continue;
            }
            let (to_along, to_across) = (load(sections.along), load(sections.across));
            let amplitude = load(sections.amplitude);
            for (&pixel, (&along, &across)) in pixels {
                let rho_squared = to_along * along + to_across * across;
                let rim = self.kernel.rim(simd, rho_squared);
                let in_plane = self.kernel.in_plane(simd, rho_squared) * amplitude;
                add(simd, (cut_by_rim(far, rim) - cut_by_rim(near, rim)) * in_plane, color, &mut sums[pixel as usize % (ROWS * COLUMNS)]);
            }
        }
        footprints.clear();
    }
}

/// `H(0, 0, t)` at planes, or at the rim on their side.
#[cfg_attr(not(debug_assertions), inline(always))]
fn cut_by_rim<S: Simd>(planes: f32x8<S>, rim: f32x8<S>) -> f32x8<S> {
    planes.max(-rim).min(rim)
}

/// A colour for each of a vector's two slots.
#[cfg_attr(not(debug_assertions), inline(always))]
fn splatted<S: Simd>(simd: S, color: [f32; CHANNELS]) -> f32x8<S> {
    let color = f32x4::load_array(simd, color);
    color.combine(color)
}

/// Adds a colour to a pixel of all open sheets, by weights.
#[cfg_attr(not(debug_assertions), inline(always))]
fn add<S: Simd>(simd: S, weights: f32x8<S>, color: f32x8<S>, pixel: &mut PixelSums) {
    for (Sums(sums), bytes) in pixel.iter_mut().zip(&WEIGHT_OF_CHANNELS) {
        let weights = weights.swizzle_dyn_within_blocks(u8x32::load_array_ref(simd, bytes));
        (f32x8::load_array_ref(simd, sums) + weights * color).store_slice(sums);
    }
}

/// The bytes of a half of a vector that give all channels its n-th weight.
const WEIGHT_OF_CHANNELS: [[u8; 32]; HALF_RING] = {
    let mut all = [[0; 32]; HALF_RING];
    let mut at = 0;
    while at < 32 * HALF_RING {
        all[at / 32][at % 32] = (at / 32 * 4 + at % 4) as u8;
        at += 1;
    }
    all
};
