//! The field between two planes, classified and shaded there (SPEC §9): it gives the sheet of a slab, eight pixels at a time.

use fearless_simd::f32x8;
use fearless_simd::prelude::*;
use glam::DVec3;

use super::cells::Bits;
use super::frame::Frame;
use super::planes::Plane;
use super::sheet::SlabSheet;
use super::slab_integral::Means;
use crate::after::slab_integral;
use crate::cpu::count::bits;
use crate::cpu::cull::OpenMask;
use crate::cpu::cut::TileRays;
use crate::cpu::shade;
use crate::cpu::sheets::{Buffers, CHANNELS, COLUMNS, ROWS};
use crate::cpu::vector::{LANES, mask};

/// The field of eight pixels in a slab.
pub(super) struct Slab<S: Simd> {
    /// k.
    pub(super) number: i32,
    /// The pixels that may show something.
    pub(super) lanes: u32,
    /// f0 and f1, as numbers.
    pub(super) values: [f32x8<S>; 2],
    /// Which pixels have a value on the near plane, and on the far one.
    pub(super) has_value: [u32; 2],
}

/// The labels of eight pixels.
type Labels = [Option<u16>; LANES];

/// The rays of a tile's pixels, as slabs are seen along them.
pub(super) struct Looks<'a> {
    pub(super) origin: [usize; 2],
    pub(super) rays: &'a TileRays,
    /// The stretches of rays that count, as in `rays`.
    pub(super) shown: &'a [[[f32; COLUMNS]; 2]],
    /// To the eye, by row and component, where pixels differ.
    pub(super) to_eye: Option<&'a [[[f32; COLUMNS]; 3]]>,
}

impl<'a> Looks<'a> {
    /// The rays of a tile, given its first pixel; `to_eye` is empty if all pixels share one direction.
    pub(super) fn new(origin: [usize; 2], rays: &'a TileRays, to_eye: &'a [[[f32; COLUMNS]; 3]]) -> Self {
        let to_eye = (!to_eye.is_empty()).then_some(to_eye);
        Self { origin, rays, shown: rays.shown.as_deref().unwrap_or_default(), to_eye }
    }

    /// The stretches of eight pixels' rays that count.
    #[inline(always)]
    pub(super) fn stretch<S: Simd>(&self, simd: S, [column, row]: [usize; 2]) -> [f32x8<S>; 2] {
        self.shown[row].each_ref().map(|ends| f32x8::from_slice(simd, &ends[column..column + LANES]))
    }

    /// Directions to the eye of eight pixels.
    #[inline(always)]
    pub(super) fn to_eye<S: Simd>(&self, simd: S, frame: &Frame<'_>, [column, row]: [usize; 2]) -> [f32x8<S>; 3] {
        std::array::from_fn(|axis| match self.to_eye {
            None => f32x8::splat(simd, frame.to_eye[axis]),
            Some(rows) => f32x8::from_slice(simd, &rows[row][axis][column..column + LANES]),
        })
    }

    /// Which of eight pixels' rays enter through a cut, whose face is not shaded, in a slab.
    #[inline(always)]
    pub(super) fn faces(&self, lanes: u32, [column, row]: [usize; 2], slab: impl Fn(usize) -> i32) -> u32 {
        let Some(faces) = &self.rays.faces else { return 0 };
        bits(lanes.into())
            .map(|lane| lane as usize)
            .fold(0, |found, lane| found | u32::from(faces[row][column + lane] == Some(slab(lane))) << lane)
    }

    /// The middles of the stretches of eight rays in a slab, in slabs.
    fn middles(&self, slab: i32, [column, row]: [usize; 2]) -> [f64; LANES] {
        let begin = self.rays.begin(slab);
        let [starts, ends] = &self.shown[row];
        let middle = |at: usize| self.rays.slab((starts[at].max(begin) + ends[at].min(begin + 1.0)) / 2.0);
        std::array::from_fn(|lane| middle(column + lane))
    }
}

impl Frame<'_> {
    /// Classifies the slab between two planes, into the sheets of its segments. The length of rays is left out.
    #[inline(always)]
    // The state of one tile, of which each is changed by itself.
    #[expect(clippy::too_many_arguments, reason = "the parts of a tile's state")]
    pub(super) fn classify<S: Simd>(
        &self,
        simd: S,
        number: i32,
        looks: &Looks<'_>,
        planes: &mut [Plane; 2],
        wanted: &[u32; ROWS],
        open: &mut OpenMask,
        (sheets, buffers): (&mut [SlabSheet], &mut Buffers),
    ) {
        for (row, bits) in wanted.iter().enumerate() {
            for column in (0..COLUMNS).step_by(LANES) {
                let lanes = bits >> column & u32::from(u8::MAX);
                let lanes = self.reaching(simd, lanes, looks, number, [column, row]);
                let lanes = self.showing(simd, lanes, planes, [column, row]);
                if lanes == 0 {
                    continue;
                }
                let Some(slab) = self.slab(simd, number, lanes, planes, [column, row]) else { continue };
                if self.compositing.has_surface() {
                    let found = self.find_surfaces(simd, &slab, looks, planes, [column, row], buffers);
                    open.close(row, found << column);
                    continue;
                }
                let amounts = self.amounts(simd, &slab, looks, planes, [column, row]);
                for (sheet, amounts) in sheets.iter_mut().zip(amounts) {
                    if let Some(amounts) = amounts {
                        sheet.add(simd, [column, row], amounts);
                    }
                }
            }
        }
        if self.compositing.has_surface() {
            open.join();
        }
    }

    /// Which of eight pixels' visible stretches reach into a slab.
    #[inline(always)]
    pub(super) fn reaching<S: Simd>(&self, simd: S, lanes: u32, looks: &Looks<'_>, slab: i32, at: [usize; 2]) -> u32 {
        if lanes == 0 {
            return 0;
        }
        let [start, end] = looks.stretch(simd, at);
        let begin = looks.rays.begin(slab);
        let is_there = start.simd_le(f32x8::splat(simd, begin + 1.0)) & end.simd_ge(f32x8::splat(simd, begin));
        lanes & is_there.to_bitmask() as u32
    }

    /// For which of eight pixels values between those on a slab's two planes may have an opacity.
    #[inline(always)]
    pub(super) fn showing<S: Simd>(&self, simd: S, lanes: u32, planes: &mut [Plane; 2], at: [usize; 2]) -> u32 {
        if lanes == 0 {
            return 0;
        }
        let [column, row] = at;
        let mut bits = Bits::default();
        for plane in planes {
            let (cells, extent) = match &plane.held {
                Some(held) => (held.cells.as_ref(), &held.extent),
                None => (self.matter.cells(), &self.field.extent),
            };
            let Some(cells) = cells else { return lanes };
            if lanes & !(plane.seen[row] >> column) != 0 {
                // There are no values at the eye.
                let new = match &plane.points {
                    Some((points, _)) => cells.of(points.eight(simd, extent, [0, 0], at).indices),
                    None => Bits::default(),
                };
                plane.seen[row] |= u32::from(u8::MAX) << column;
                plane.reaches[row] |= new.reaches << column;
                plane.stays[row] |= new.stays << column;
            }
            bits.reaches |= plane.reaches[row] >> column;
            bits.stays |= plane.stays[row] >> column;
        }
        lanes & bits.reaches & bits.stays
    }

    /// Computes the values of some of eight pixels on a plane, unless they are known.
    // Not inlined, so that it is compiled once for every instruction set.
    #[inline(never)]
    pub(super) fn find_values<S: Simd>(&self, simd: S, plane: &mut Plane, lanes: u32, [column, row]: [usize; 2]) {
        let missing = lanes & !(plane.known[row] >> column);
        if missing == 0 {
            return;
        }
        plane.known[row] |= missing << column;
        let values = &mut plane.rows[row].values;
        let Some(of) = &plane.points else { return values[column..column + LANES].fill(f32::NAN) };
        simd.vectorize(
            #[inline(always)]
            || {
                let field = plane.held.as_ref().map_or(self.field, |held| self.field.of(held));
                let new = field.values(simd, of, [column, row], missing, &mut plane.weights);
                bits(missing.into()).for_each(|lane| values[column + lane as usize] = new[lane as usize]);
            },
        );
    }

    /// Computes the gradients of those of eight pixels on a plane that have values, unless they are known.
    #[inline(never)]
    pub(super) fn find_gradients<S: Simd>(&self, simd: S, plane: &mut Plane, lanes: u32, [column, row]: [usize; 2]) {
        let missing = lanes & !(plane.graded[row] >> column);
        if missing == 0 {
            return;
        }
        plane.graded[row] |= missing << column;
        let Some(of) = &plane.points else { return };
        let (gradients, weights) = (&mut plane.rows[row].gradients, &mut plane.weights);
        simd.vectorize(
            #[inline(always)]
            || {
                let field = plane.held.as_ref().map_or(self.field, |held| self.field.of(held));
                let new = field.gradients(simd, of, [column, row], missing, weights);
                for (gradients, new) in gradients.iter_mut().zip(new) {
                    bits(missing.into()).for_each(|lane| gradients[column + lane as usize] = new[lane as usize]);
                }
            },
        );
    }

    /// The field of eight pixels in a slab; `None` if none of its values has an opacity.
    #[inline(always)]
    pub(super) fn slab<S: Simd>(
        &self,
        simd: S,
        number: i32,
        lanes: u32,
        planes: &mut [Plane; 2],
        [column, row]: [usize; 2],
    ) -> Option<Slab<S>> {
        let splat = |number: f32| f32x8::splat(simd, number);
        let [near, far] = planes;
        self.find_values(simd, near, lanes, [column, row]);
        self.find_values(simd, far, lanes, [column, row]);
        let [near, far] =
            [near, far].map(|plane| f32x8::from_slice(simd, &plane.rows[row].values[column..column + LANES]));
        let (has_near, has_far) = (near.simd_eq(near), far.simd_eq(far));
        let f0 = has_near.select(near, far);
        let f1 = has_far.select(far, near);
        let [low, high] = self.integrals.shown;
        let may_show = f0.max(f1).simd_ge(splat(low)) & f0.min(f1).simd_le(splat(high)) & (has_near | has_far);
        let lanes = lanes & may_show.to_bitmask() as u32;
        let has_value = [has_near, has_far].map(|lanes| lanes.to_bitmask() as u32);
        (lanes != 0).then_some(Slab { number, lanes, values: [f0, f1], has_value })
    }

    /// ∇f0 and ∇f1 of some of eight pixels in a slab.
    #[inline(always)]
    pub(super) fn gradients<S: Simd>(
        &self,
        simd: S,
        slab: &Slab<S>,
        lanes: u32,
        planes: &mut [Plane; 2],
        [column, row]: [usize; 2],
    ) -> [[f32x8<S>; 3]; 2] {
        let [near, far] = planes;
        self.find_gradients(simd, near, lanes & slab.has_value[0], [column, row]);
        self.find_gradients(simd, far, lanes & slab.has_value[1], [column, row]);
        let [has_near, has_far] = slab.has_value.map(|bits| mask(simd, bits));
        let load = |plane: &Plane, axis: usize| {
            f32x8::from_slice(simd, &plane.rows[row].gradients[axis][column..column + LANES])
        };
        let (first, second) =
            ([load(near, 0), load(near, 1), load(near, 2)], [load(far, 0), load(far, 1), load(far, 2)]);
        [
            std::array::from_fn(|axis| has_near.select(first[axis], second[axis])),
            std::array::from_fn(|axis| has_far.select(second[axis], first[axis])),
        ]
    }

    /// The labels of eight pixels at the middles of their stretches in a slab; `None` if labels have no tables of their own.
    #[inline(always)]
    fn slab_labels(&self, slab: i32, lanes: u32, looks: &Looks<'_>, [column, row]: [usize; 2]) -> Option<Labels> {
        let middles = self.labels.then(|| looks.middles(slab, [column, row]))?;
        let at = [looks.origin[0] + column, looks.origin[1] + row];
        let mut labels = [None; LANES];
        for lane in bits(lanes.into()).map(|lane| lane as usize) {
            labels[lane] = self.label(at, lane, middles[lane]);
        }
        Some(labels)
    }

    /// The means of some of eight pixels between two values, given the labels there; if they only tell what is visible, nothing but the amounts.
    #[inline(always)]
    fn means_between<S: Simd>(
        &self,
        simd: S,
        lanes: (u32, bool),
        values: [f32x8<S>; 2],
        labels: &Option<Labels>,
    ) -> Means<S> {
        let table_of = labels.as_ref().map(|labels| |lane: usize| self.integrals.table(labels[lane]));
        self.integrals.means(simd, lanes, values, table_of)
    }

    /// The mean amounts of eight pixels in a slab.
    #[inline(always)]
    pub(super) fn means<S: Simd>(&self, simd: S, slab: &Slab<S>, looks: &Looks<'_>, at: [usize; 2]) -> Means<S> {
        let labels = self.slab_labels(slab.number, slab.lanes, looks, at);
        self.means_between(simd, (slab.lanes, true), slab.values, &labels)
    }

    /// The number in the middle of a cubic slab (SPEC §9), given its mean amount: that of the cubic through the values and slopes at its planes; on the line between
    /// them where only rounding tells the slab from one that shows nothing.
    #[inline(always)]
    pub(super) fn middle<S: Simd>(
        &self,
        simd: S,
        ([f0, f1], amount): ([f32x8<S>; 2], f32x8<S>),
        [near, far]: &[[f32x8<S>; 3]; 2],
        looks: &Looks<'_>,
        [column, row]: [usize; 2],
    ) -> f32x8<S> {
        let to_eye = looks.to_eye(simd, self, [column, row]);
        let [x, y, z]: [f32x8<S>; 3] = std::array::from_fn(|axis| (far[axis] - near[axis]) * to_eye[axis]);
        let mut bend = (x + y + z) * self.bend;
        if let Some(lengths) = &looks.rays.weights {
            bend *= f32x8::from_slice(simd, &lengths[row][column..column + LANES]);
        }
        let splat = |number: f32| f32x8::splat(simd, number);
        let ([least, greatest], low, high) = (self.integrals.shown, f0.min(f1), f0.max(f1));
        let is_at_end = high.simd_lt(splat(least + self.hair)) | low.simd_gt(splat(greatest - self.hair));
        let mut is_straight = is_at_end & amount.simd_lt(splat(slab_integral::MIN_BENT));
        if self.compositing.has_surface() {
            is_straight |= (amount * (high - low)).simd_lt(splat(slab_integral::SINGLE));
        }
        (f0 + f1) * 0.5 + is_straight.select(splat(0.0), bend)
    }

    /// The amounts that the segments of a slab add to eight pixels, by channel; `None` if none of them shows anything there.
    #[inline(always)]
    fn amounts<S: Simd>(
        &self,
        simd: S,
        slab: &Slab<S>,
        looks: &Looks<'_>,
        planes: &mut [Plane; 2],
        [column, row]: [usize; 2],
    ) -> [Option<[f32x8<S>; CHANNELS]>; 2] {
        let zero = f32x8::splat(simd, 0.0);
        let labels = self.slab_labels(slab.number, slab.lanes, looks, [column, row]);
        let [first, last] = slab.values;
        let (mut lanes, mut values) = (slab.lanes, slab.values);
        let (mut own, mut gradients, mut amounts) = (None, [[zero; 3]; 2], [None; 2]);
        let mut middle = zero;
        let faces = looks.faces(lanes, [column, row], |_| slab.number);
        // The whole slab, which tells what is visible, and then the halves of the cubic profile: one place for all, because much is compiled into it.
        for step in 0..=2 {
            let means = self.means_between(simd, (lanes, step == 0 && self.segments > 1), values, &labels);
            let visible = means.visible(simd, lanes);
            let mut part = [step as f32 * 0.5 - 0.5, 0.5];
            if step == 0 {
                if visible == 0 {
                    return amounts;
                }
                lanes = visible;
                own = self.slab_colors(simd, slab, visible, planes, [column, row]);
                if self.needs_gradients {
                    gradients = self.gradients(simd, slab, visible, planes, [column, row]);
                }
                if self.segments > 1 {
                    middle = self.middle(simd, (slab.values, means.amount), &gradients, looks, [column, row]);
                    values = [first, middle];
                    continue;
                }
                part = [0.0, 1.0];
            }
            let (mut amount, mut color) = (means.amount, means.color);
            if let Some([red, green, blue, alpha]) = own {
                (amount, color) = (amount * alpha, [red, green, blue]);
            }
            if self.needs_gradients {
                let [near, far] = gradients;
                let share = means.share * part[1] + part[0];
                let gradient = std::array::from_fn(|axis| near[axis] + (far[axis] - near[axis]) * share);
                let left = self.left_between(simd, visible, (looks, planes), [column, row], share);
                let shaded = self.shaded(simd, color, gradient, looks.to_eye(simd, self, [column, row]), left);
                color = shade::select(mask(simd, faces), color, shaded);
                if self.has_gradient_opacity {
                    let length = self.length(gradient);
                    let factors: [f32; LANES] = std::array::from_fn(|lane| {
                        let ramp = self.transfer.tables(labels.and_then(|labels| labels[lane])).gradient_opacity;
                        ramp.map_or(1.0, |ramp| ramp.at(length[lane]) as f32)
                    });
                    amount *= f32x8::load_array(simd, factors);
                }
            }
            // Where nothing is visible the gradient is unknown.
            let is_visible = mask(simd, visible);
            let [red, green, blue] = color.map(|channel| is_visible.select(channel * amount, zero));
            let sheet = [red, green, blue, is_visible.select(amount, zero)];
            if self.segments == 1 {
                return [Some(sheet), None];
            }
            if visible != 0 {
                amounts[step - 1] = Some(sheet);
            }
            values = [middle, last];
        }
        amounts
    }

    /// Colours shaded by gradients, in the light that is left.
    #[inline(always)]
    pub(super) fn shaded<S: Simd>(
        &self,
        simd: S,
        color: [f32x8<S>; 3],
        gradient: [f32x8<S>; 3],
        to_eye: [f32x8<S>; 3],
        left: [f32x8<S>; 2],
    ) -> [f32x8<S>; 3] {
        let splat = |number: f32| f32x8::splat(simd, number);
        let [x, y, z] = gradient;
        let length = (x * x + y * y + z * z).sqrt();
        let is_flat = length.simd_lt(splat(self.min_gradient));
        let per_length = is_flat.select(splat(0.0), splat(-1.0) / is_flat.select(splat(1.0), length));
        self.shader.color(simd, color, [x * per_length, y * per_length, z * per_length], to_eye, left)
    }

    /// The length of gradients, values per world unit.
    #[inline(always)]
    pub(super) fn length<S: Simd>(&self, [x, y, z]: [f32x8<S>; 3]) -> [f64; LANES] {
        let lengths = (x * x + y * y + z * z).sqrt() * self.per_number;
        lengths.to_array().map(|length| f64::from(length) / self.field.gradient_length)
    }

    /// The label of the voxel whose cell contains a point of a pixel's ray, given by its position among slabs.
    pub(super) fn label(&self, [x, y]: [usize; 2], lane: usize, slab: f64) -> Option<u16> {
        self.matter.label(self.grid.index_of(self.grid.nearest(self.voxel_at([x + lane, y], slab))))
    }

    /// The label of the voxel whose cell contains the middle of a pixel's stretch: that which parts of an image note (SPEC §11).
    pub(super) fn middle_label(&self, pixel: [usize; 2]) -> Option<u16> {
        self.matter.label(self.grid.index_of(self.rays.middle_voxel(pixel, &self.grid)))
    }

    /// A place on a pixel's ray, in voxels.
    pub(super) fn voxel_at(&self, pixel: [usize; 2], slab: f64) -> DVec3 {
        let (grid, ray) = (&self.grid, self.rays.rays.of(pixel));
        ray.at(ray.depth(slab)) / grid.aspect() + grid.center()
    }

    /// The value of a number.
    pub(super) fn value(&self, number: f32) -> f64 {
        let numbers = &self.numbers;
        numbers.base + f64::from(number) / numbers.scale
    }
}
