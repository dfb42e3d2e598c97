//! Kernel sections added to a tile's sheet buffers (SPEC §5), a pixel at a time and all sections of a voxel at once; the same sums as
//! `shaders/splat.wgsl`. Each pixel's additions come in the order in which voxels do, whatever the vectors' width.

use std::ops::Range;

use fearless_simd::prelude::*;
use fearless_simd::{f32x4, f32x8, u8x32};

use super::cull::{OpenMask, Pixels};
use super::kernel::KernelTables;
use super::reached::{Reached, WIDEST};
use super::sheets::{BySlot, CHANNELS, HALF_RING, PixelSums, RING, Ring, SECTIONS, Sums, slot_of};
use super::vector::{LANES, columns, iota};

/// Numbers of half a vector: those of three slots, and one more.
const HALF: usize = LANES / 2;

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
    #[inline(always)]
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

/// A splat's next sections, up to [`SECTIONS`], as they are added to pixels.
#[derive(Clone, Copy, Debug, Default)]
struct Footprint {
    /// `(C·m, m)` over λ.
    color: [f32; CHANNELS],
    /// The slot of their first sheet, and how many they are.
    slot: usize,
    sections: usize,
    /// `H(0, 0, t)` of eq. 3 at the planes before the sections, and behind them: by slot, in perspective by section. Where there is no section, both are
    /// at one place.
    near: [f32; LANES],
    far: [f32; LANES],
    local: LocalSections,
    /// Where their pixels end in the list.
    end: usize,
}

/// In perspective every section has a footprint of its own, of the size that pixels have at its middle.
#[derive(Clone, Copy, Debug, Default)]
struct LocalSections {
    /// ρ² of a pixel along the footprint's axis and across it, and the low-pass rule's amplitude.
    along: [f32; LANES],
    across: [f32; LANES],
    amplitude: [f32; LANES],
}

impl Footprint {
    #[inline(always)]
    fn set_planes<S: Simd>(&mut self, simd: S, kernel: &KernelTables, [near, far]: [f32x8<S>; 2]) {
        let (near, far) = kernel.along(simd, near.combine(far)).split();
        (self.near, self.far) = (near.to_array(), far.to_array());
    }
}

/// Footprints that are listed together: the pixels that they reach, which are added to the sheets later.
#[derive(Debug)]
pub(super) struct Footprints {
    reached: Reached,
    all: [Footprint; MOST_FOOTPRINTS],
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
    fn clear(&mut self) {
        (self.count, self.reached.count) = (0, 0);
    }
}

/// The number of sheets from that of a slot on to that of every slot; [`RING`] where a vector's number belongs to no slot.
const ORDERS: [BySlot; RING] = {
    const NONE: f32 = RING as f32;
    [
        [0.0, 1.0, 2.0, NONE, 3.0, 4.0, 5.0, NONE],
        [5.0, 0.0, 1.0, NONE, 2.0, 3.0, 4.0, NONE],
        [4.0, 5.0, 0.0, NONE, 1.0, 2.0, 3.0, NONE],
        [3.0, 4.0, 5.0, NONE, 0.0, 1.0, 2.0, NONE],
        [2.0, 3.0, 4.0, NONE, 5.0, 0.0, 1.0, NONE],
        [1.0, 2.0, 3.0, NONE, 4.0, 5.0, 0.0, NONE],
    ]
};

impl Splatter {
    /// Lists the open pixels of a tile that a splat's next sections reach, if there are any; the box that contains them.
    #[inline(always)]
    pub(super) fn list<S: Simd>(
        &self,
        simd: S,
        splat: &Splat,
        open: &OpenMask,
        Footprints { reached, all, count }: &mut Footprints,
    ) -> Option<Pixels> {
        let footprint = &mut all[*count % MOST_FOOTPRINTS];
        (footprint.color, footprint.slot) = (splat.amount, slot_of(splat.sheets[0]));
        footprint.sections = splat.sections();
        let pixels = match self.pixel_per_depth {
            None => Some(splat.pixels),
            Some(pixel_per_depth) => self.local_sections(simd, splat, pixel_per_depth, footprint),
        }
        .filter(|pixels| open.sees(pixels))?;
        match self.pixel_per_depth {
            None => self.list_flat(simd, splat, (&pixels, open), footprint, reached),
            Some(_) => self.list_local(simd, splat, (&pixels, open), &footprint.local, reached),
        }
        footprint.end = reached.count;
        *count += 1;
        Some(pixels)
    }

    /// The planes of a splat's next sections without perspective, and its pixels.
    #[inline(always)]
    fn list_flat<S: Simd>(
        &self,
        simd: S,
        splat: &Splat,
        (pixels, open): (&Pixels, &OpenMask),
        footprint: &mut Footprint,
        reached: &mut Reached,
    ) {
        let order = f32x8::load_array_ref(simd, &ORDERS[footprint.slot % RING]);
        let end = f32x8::splat(simd, footprint.sections as f32);
        let near = order.min(end) * splat.step + splat.first_plane;
        let far = (order + 1.0).min(end) * splat.step + splat.first_plane;
        footprint.set_planes(simd, &self.kernel, [near, far]);
        let [xx, xy, yy] = self.metric;
        let limit = S::f32s::splat(simd, self.kernel.support_squared);
        reached.list(
            simd,
            splat.center,
            pixels,
            open,
            #[inline(always)]
            move |[dx, dy]: [S::f32s; 2]| {
                let rho_squared = dx * (dx * xx + dy * xy) + dy * yy * dy;
                (rho_squared.simd_lt(limit), [rho_squared])
            },
        );
    }

    /// The pixels of a splat's next sections in perspective.
    #[inline(always)]
    fn list_local<S: Simd>(
        &self,
        simd: S,
        splat: &Splat,
        (pixels, open): (&Pixels, &OpenMask),
        sections: &LocalSections,
        reached: &mut Reached,
    ) {
        // Of the largest section's footprint.
        let along = f32x8::load_array_ref(simd, &sections.along).reduce_min();
        let across = f32x8::load_array_ref(simd, &sections.across).reduce_min();
        let [x, y] = splat.local.axis;
        let limit = S::f32s::splat(simd, self.kernel.support_squared);
        reached.list(
            simd,
            splat.center,
            pixels,
            open,
            #[inline(always)]
            move |[dx, dy]: [S::f32s; 2]| {
                let (u, v) = (dx * x + dy * y, dx * -y + dy * x);
                let (u, v) = (u * u, v * v);
                ((u * along + v * across).simd_lt(limit), [u, v])
            },
        );
    }

    /// The next sections of a splat in perspective, and the pixels that any of them reaches; `None` for no pixel of the tile.
    #[inline(always)]
    fn local_sections<S: Simd>(
        &self,
        simd: S,
        splat: &Splat,
        pixel_per_depth: f32,
        footprint: &mut Footprint,
    ) -> Option<Pixels> {
        let splat_f32 = |number: f32| f32x8::splat(simd, number);
        // Numbers of no section are like the last one's.
        let before = iota(simd).min(splat_f32(splat.sections() as f32 - 1.0));
        let (local, cut) = (&splat.local, splat_f32(splat.local.cut));
        let near = (before * splat.step + splat.first_plane).max(cut);
        let far = ((before + 1.0) * splat.step + splat.first_plane).max(cut);
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
        let [x, y] = local.axis.map(|component| component * component);
        let width = (one / along * x + one / across * y).sqrt() * self.kernel.support;
        let height = (one / along * y + one / across * x).sqrt() * self.kernel.support;
        footprint.set_planes(simd, &self.kernel, [near, far]);
        footprint.local =
            LocalSections { along: along.to_array(), across: across.to_array(), amplitude: amplitude.to_array() };
        // The box contains the footprint whatever is rounded, so that the footprint alone decides, and not the vectors that cover the box.
        let half_box = [width.reduce_max(), height.reduce_max()].map(|half| half * (1.0 + RELATIVE_SLACK) + SLACK);
        Pixels::within(splat.center, half_box)
    }

    /// Adds the listed footprints to the sheets, one after the other.
    #[inline(always)]
    pub(super) fn add<S: Simd>(&self, simd: S, footprints: &mut Footprints, ring: &mut Ring) {
        let Footprints { reached, all, count } = &mut *footprints;
        if self.pixel_per_depth.is_none() {
            self.weigh(simd, reached);
        }
        let mut start = 0;
        for footprint in &all[..*count] {
            let listed = start..footprint.end;
            start = footprint.end;
            match self.pixel_per_depth {
                None => add_flat(simd, footprint, (reached, listed), ring),
                Some(_) => self.add_local(simd, footprint, (reached, listed), ring),
            }
        }
        footprints.clear();
    }

    /// Without perspective, what all sections have in common: replaces every listed pixel's ρ² by `H(0, 0, t)` at the rim and the Gaussian.
    #[inline(always)]
    fn weigh<S: Simd>(&self, simd: S, reached: &mut Reached) {
        let width = S::f32s::LEN;
        let [first, second] = &mut *reached.numbers;
        let vectors = first.chunks_exact_mut(width).zip(second.chunks_exact_mut(width));
        for (first, second) in vectors.take(reached.count.div_ceil(width)) {
            let rho_squared = S::f32s::from_slice(simd, first);
            self.kernel.rim(simd, rho_squared).store_slice(first);
            self.kernel.in_plane(simd, rho_squared).store_slice(second);
        }
    }

    /// In perspective: weights by section of a vector of pixels, then by pixel of all sections.
    #[inline(always)]
    fn add_local<S: Simd>(
        &self,
        simd: S,
        footprint: &Footprint,
        (reached, listed): (&Reached, Range<usize>),
        ring: &mut Ring,
    ) {
        let width = S::f32s::LEN;
        let color = splatted(simd, footprint.color);
        let Footprint { near, far, local: LocalSections { along, across, amplitude }, slot, .. } = footprint;
        let mut weights = [[0.0; WIDEST]; LANES];
        for start in listed.clone().step_by(width) {
            let u = S::f32s::from_slice(simd, &reached.numbers[0][start..start + width]);
            let v = S::f32s::from_slice(simd, &reached.numbers[1][start..start + width]);
            for section in 0..footprint.sections.min(SECTIONS) {
                let rho_squared = u * along[section] + v * across[section];
                let rim = self.kernel.rim(simd, rho_squared);
                let in_plane = self.kernel.in_plane(simd, rho_squared) * amplitude[section];
                let [near, far] = [near, far].map(|planes| planes[section]);
                let near = cut_by_rim(S::f32s::splat(simd, near), rim);
                let far = cut_by_rim(S::f32s::splat(simd, far), rim);
                ((far - near) * in_plane).store_slice(&mut weights[lane_of(slot + section)][..width]);
            }
            let pixels = &reached.pixels[start..listed.end.min(start + width)];
            for (at, pixels) in pixels.chunks(HALF).enumerate() {
                let of_four = weights.each_ref().map(|of_lane| &of_lane.as_chunks::<HALF>().0[at]);
                let by_pixel = columns(simd, of_four);
                for (&pixel, weights) in pixels.iter().zip(by_pixel) {
                    add(simd, weights, color, &mut ring.pixels[pixel as usize]);
                }
            }
        }
    }
}

/// Without perspective all sections have one footprint.
#[inline(always)]
fn add_flat<S: Simd>(simd: S, footprint: &Footprint, (reached, listed): (&Reached, Range<usize>), ring: &mut Ring) {
    let (near, far) = (f32x8::load_array_ref(simd, &footprint.near), f32x8::load_array_ref(simd, &footprint.far));
    let color = splatted(simd, footprint.color);
    let numbers = reached.numbers.each_ref().map(|numbers| &numbers[listed.clone()]);
    for ((&pixel, &rim), &in_plane) in reached.pixels[listed.clone()].iter().zip(numbers[0]).zip(numbers[1]) {
        let rim = f32x8::splat(simd, rim);
        let weights = (cut_by_rim(far, rim) - cut_by_rim(near, rim)) * in_plane;
        add(simd, weights, color, &mut ring.pixels[pixel as usize]);
    }
}

/// The number of a slot's weight in a vector, given a slot or one of the ring's next turn.
#[inline(always)]
fn lane_of(slot: usize) -> usize {
    const LANES_OF: [usize; 2 * RING] = [0, 1, 2, 4, 5, 6, 0, 1, 2, 4, 5, 6];
    LANES_OF[slot % (2 * RING)]
}

/// `H(0, 0, t)` at planes, or at the rim on their side.
#[inline(always)]
fn cut_by_rim<S: Simd, V: SimdFloat<S, Element = f32>>(planes: V, rim: V) -> V {
    planes.max(-rim).min(rim)
}

/// A colour for each of a vector's two slots.
#[inline(always)]
fn splatted<S: Simd>(simd: S, color: [f32; CHANNELS]) -> f32x8<S> {
    let color = f32x4::load_array(simd, color);
    color.combine(color)
}

/// Adds a colour to a pixel of all open sheets, by weights.
#[inline(always)]
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
