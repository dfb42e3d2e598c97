//! The pixels of a part, and how those of consecutive slab ranges merge (SPEC §11).

use crate::settings::splatting::{Classification, Compositing};

/// Extremes that differ by less, relative to the range of the coefficients, count as equal, as where a whole image is drawn.
const HAIR_OF_RANGE: f32 = 2e-6;

/// The pixels of a part's region, row by row, before the background.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Content {
    /// The compositing buffer: premultiplied RGBA. For the sums of `xray` and `average` it is not clamped; for `minimum` (classified before
    /// splatting) alpha is 2 less the opacity, and 0 where nothing counted. For `average` classified after splatting, pixels with points on planes have the
    /// mean of these points' own colours and A, or nothing.
    pub colors: Vec<[f32; 4]>,
    /// For `maximum`, `minimum` and `average` classified after splatting, the value that every pixel chose; otherwise empty.
    pub extremes: Vec<Extreme>,
}

/// The value that a pixel chose among those along its ray (SPEC §9).
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Extreme {
    /// The value's place in the range of the field's coefficients, from 0 to 1; for `average` the mean value itself.
    pub value: f32,
    /// [`Self::POINT`] for a point on a plane, and for `average` 1 more for each other one; [`Self::MIDDLE`] for the middle of the visible stretch, which
    /// counts where no plane has a point, and 0 if nothing counted.
    pub counted: f32,
    /// For `average` of a segmented volume with tables of labels, the label of the voxel in the middle of the stretch of the pixel's ray that counts,
    /// where points on planes count; otherwise 0.
    pub label: f32,
}

impl Extreme {
    /// A point on a plane counted.
    pub const POINT: f32 = 2.0;
    /// Only the middle of the visible stretch counted.
    pub const MIDDLE: f32 = 1.0;

    /// Whether points on planes count.
    pub(crate) fn has_points(&self) -> bool {
        self.counted > Self::MIDDLE
    }
}

impl Content {
    /// Pixels that show nothing, with extremes or without.
    pub(crate) fn empty(pixels: usize, has_extremes: bool) -> Self {
        let extremes = vec![Extreme::default(); if has_extremes { pixels } else { 0 }];
        Self { colors: vec![[0.0; 4]; pixels], extremes }
    }
}

impl Content {
    /// Merges the slabs behind some slabs into them.
    pub(super) fn merge(&mut self, back: &Self, (compositing, classification): (Compositing, Classification)) {
        let colors = self.colors.iter_mut().zip(&back.colors);
        if compositing.chooses_values(classification) {
            for ((front, back), (chosen, other)) in colors.zip(self.extremes.iter_mut().zip(&back.extremes)) {
                let [points, behind] = [*chosen, *other].map(|of| of.counted - Extreme::MIDDLE);
                if compositing.is_average() && points > 0.0 && behind > 0.0 {
                    let share = f64::from(behind) / f64::from(points + behind);
                    let mean = |a: f32, b: f32| (f64::from(a) + (f64::from(b) - f64::from(a)) * share) as f32;
                    *front = std::array::from_fn(|channel| mean(front[channel], back[channel]));
                    let value = mean(chosen.value, other.value);
                    *chosen = Extreme { value, counted: chosen.counted + behind, ..*chosen };
                } else if is_better(compositing, *other, *chosen) {
                    (*front, *chosen) = (*back, *other);
                }
            }
            return;
        }
        colors.for_each(|(front, back)| *front = pixel(compositing, *front, *back));
    }
}

/// Whether a value replaces a nearer one.
fn is_better(compositing: Compositing, other: Extreme, chosen: Extreme) -> bool {
    if other.counted != chosen.counted {
        return other.counted > chosen.counted;
    }
    match compositing.keeps_least() {
        true => other.value < chosen.value - HAIR_OF_RANGE,
        false => other.value > chosen.value + HAIR_OF_RANGE,
    }
}

/// A pixel of two consecutive slab ranges.
fn pixel(compositing: Compositing, front: [f32; 4], back: [f32; 4]) -> [f32; 4] {
    match compositing {
        Compositing::Linear | Compositing::Exponential => {
            // Opacity beyond 1 is a rounding error and must not hide another part.
            let rest = (1.0 - front[3]).max(0.0);
            std::array::from_fn(|channel| front[channel] + rest * back[channel])
        }
        Compositing::Xray | Compositing::Average => std::array::from_fn(|channel| front[channel] + back[channel]),
        // The nearest of equal ones.
        Compositing::Maximum | Compositing::Minimum => {
            if back[3] > front[3] {
                back
            } else {
                front
            }
        }
        Compositing::Surface if front[3] >= 1.0 => front,
        Compositing::Surface => back,
    }
}
