//! Transfer functions: from voxel values to colour and opacity (SPEC §3).

use std::collections::BTreeMap;
use std::ops::{Add, Mul};

use glam::DVec3;

use crate::volume::Volume;

/// Why control points make no [`Ramp`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RampError {
    /// There are none.
    #[error("no control points, allowed: at least one")]
    Empty,
    /// A position is infinite or not a number.
    #[error("the position of control point {index} is not finite")]
    NotFinite {
        /// Which one, from 0.
        index: usize,
    },
    /// A position is not above the one before it.
    #[error("the position of control point {index} is not above the one before it")]
    NotIncreasing {
        /// Which one, from 0, so at least 1.
        index: usize,
    },
}

/// A piecewise linear function through control points, constant before the first and after the last.
#[derive(Clone, Debug, PartialEq)]
pub struct Ramp<T> {
    /// At least one; positions are finite and strictly increasing.
    points: Vec<(f64, T)>,
}

impl<T: Copy + Add<Output = T> + Mul<f64, Output = T>> Ramp<T> {
    /// A ramp through `(position, value)` points.
    ///
    /// # Errors
    /// If there are no points, or their positions are not finite and strictly increasing.
    pub fn new(points: Vec<(f64, T)>) -> Result<Self, RampError> {
        if points.is_empty() {
            return Err(RampError::Empty);
        }
        if let Some(index) = points.iter().position(|(position, _)| !position.is_finite()) {
            return Err(RampError::NotFinite { index });
        }
        if let Some(before) = points.windows(2).position(|pair| pair[1].0 <= pair[0].0) {
            return Err(RampError::NotIncreasing { index: before + 1 });
        }
        Ok(Self { points })
    }

    /// The control points, by increasing position.
    pub fn points(&self) -> &[(f64, T)] {
        &self.points
    }

    /// The ramp's value at a position; at a control point exactly that point's.
    pub fn at(&self, position: f64) -> T {
        let after = self.points.partition_point(|point| point.0 <= position);
        if after == 0 || after == self.points.len() {
            return self.points[after.saturating_sub(1)].1;
        }
        let ((x0, y0), (x1, y1)) = (self.points[after - 1], self.points[after]);
        // Points more than f64::MAX apart have no finite distance, their halves do.
        let scale = if (x1 - x0).is_finite() { 1.0 } else { 0.5 };
        let share = (position * scale - x0 * scale) / (x1 * scale - x0 * scale);
        y0 * (1.0 - share) + y1 * share
    }
}

/// What a voxel's value and gradient look like, and its label in a segmented volume.
#[derive(Clone, Debug, PartialEq)]
pub struct TransferFunction {
    /// Red, green and blue in [0, 1] over voxel values.
    pub color: Ramp<DVec3>,
    /// Opacity per unit length in [0, 1] over voxel values.
    pub opacity: Ramp<f64>,
    /// A factor in [0, 1] over gradient magnitudes (value per world unit); `None` is 1 everywhere.
    pub gradient_opacity: Option<Ramp<f64>>,
    /// Closed intervals `[lo, hi]` of the values that take part; `None` is all of them.
    pub iso_ranges: Option<Vec<[f64; 2]>>,
    /// Of a segmented volume the tables of single labels. Labels without any go by the ramps above. They mean nothing for other
    /// volumes.
    pub labels: BTreeMap<u16, LabelTables>,
}

/// What a label's voxels look like instead.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelTables {
    /// Whether they take part at all.
    pub visible: bool,
    /// As [`TransferFunction::color`], which `None` stands for.
    pub color: Option<Ramp<DVec3>>,
    /// As [`TransferFunction::opacity`], which `None` stands for.
    pub opacity: Option<Ramp<f64>>,
    /// As [`TransferFunction::gradient_opacity`], which `None` stands for.
    pub gradient_opacity: Option<Ramp<f64>>,
}

impl Default for LabelTables {
    fn default() -> Self {
        Self { visible: true, color: None, opacity: None, gradient_opacity: None }
    }
}

impl LabelTables {
    /// Whether voxels that take part look otherwise than without them; else only who takes part is another.
    pub fn matter_to_shading(&self) -> bool {
        self.visible && (self.color.is_some() || self.opacity.is_some() || self.gradient_opacity.is_some())
    }
}

/// The tables that voxels of one label go by, whether they are the label's own or not.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tables<'a> {
    /// Whether they take part at all.
    pub visible: bool,
    /// [`TransferFunction::color`].
    pub color: &'a Ramp<DVec3>,
    /// [`TransferFunction::opacity`].
    pub opacity: &'a Ramp<f64>,
    /// [`TransferFunction::gradient_opacity`].
    pub gradient_opacity: Option<&'a Ramp<f64>>,
    /// [`TransferFunction::iso_ranges`], the same for all labels.
    pub iso_ranges: Option<&'a [[f64; 2]]>,
}

impl Tables<'_> {
    /// α, the opacity per unit length: `opacity(value) · gradient_opacity(|g|)`, and 0 outside the iso-ranges or if invisible.
    pub fn alpha(&self, value: f64, gradient_magnitude: f64) -> f64 {
        if !self.visible || !self.in_iso_range(value) {
            return 0.0;
        }
        let factor = self.gradient_opacity.map_or(1.0, |ramp| ramp.at(gradient_magnitude));
        self.opacity.at(value) * factor
    }

    /// Whether a voxel of this value takes part at all.
    pub fn in_iso_range(&self, value: f64) -> bool {
        self.iso_ranges.is_none_or(|ranges| ranges.iter().any(|&[lo, hi]| lo <= value && value <= hi))
    }
}

impl TransferFunction {
    /// The tables that voxels of a label go by; `None` for those of a volume that is not segmented.
    pub fn tables(&self, label: Option<u16>) -> Tables<'_> {
        let own = label.and_then(|label| self.labels.get(&label));
        Tables {
            visible: own.is_none_or(|own| own.visible),
            color: own.and_then(|own| own.color.as_ref()).unwrap_or(&self.color),
            opacity: own.and_then(|own| own.opacity.as_ref()).unwrap_or(&self.opacity),
            gradient_opacity: own.and_then(|own| own.gradient_opacity.as_ref()).or(self.gradient_opacity.as_ref()),
            iso_ranges: self.iso_ranges.as_deref(),
        }
    }

    /// [`Tables::alpha`] without a label.
    pub fn alpha(&self, value: f64, gradient_magnitude: f64) -> f64 {
        self.tables(None).alpha(value, gradient_magnitude)
    }

    /// Whether a voxel of this value takes part at all.
    pub fn in_iso_range(&self, value: f64) -> bool {
        self.tables(None).in_iso_range(value)
    }

    /// A transfer function for volumes that come without one: a nearly opaque surface around what stands out from the
    /// background, skin-coloured, whitening towards high values. A constant volume becomes a grey haze.
    pub fn from_histogram(volume: &Volume) -> Self {
        let (color, opacity) = match Surface::find(volume.values()) {
            Some(Surface { background, threshold, bright }) => {
                // Soft enough that the surface shows no voxel steps, and always clear of the background.
                let half_width = (threshold - background) / 3.0;
                (
                    vec![(threshold, DVec3::new(0.92, 0.74, 0.62)), (bright, DVec3::new(1.0, 0.95, 0.85))],
                    vec![(threshold - half_width, 0.0), (threshold + half_width, 0.9)],
                )
            }
            None => (vec![(0.0, DVec3::splat(0.7))], vec![(0.0, 0.5)]),
        };
        Self {
            color: Ramp { points: color },
            opacity: Ramp { points: opacity },
            gradient_opacity: None,
            iso_ranges: None,
            labels: BTreeMap::new(),
        }
    }
}

/// What a histogram tells about the object in a volume; `background < threshold < bright`.
struct Surface {
    /// The background's mean value.
    background: f64,
    /// The value that separates the object from the background.
    threshold: f64,
    /// What only the brightest eighth of the object exceeds.
    bright: f64,
}

impl Surface {
    const BINS: usize = 256;

    /// `None` if all values are the same.
    ///
    /// Otsu's threshold tells object from background. It lies half way between their means, though, where faint parts
    /// (skin, leaves, thin branches) are lost; where object meets background, samples mix the two, so the surface is
    /// put half way between the background's mean and the object's faintest eighth.
    fn find(values: &[f32]) -> Option<Self> {
        let (lo, hi) = values.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(lo, hi), &v| (lo.min(v), hi.max(v)));
        if lo >= hi {
            return None;
        }
        let (least, range) = (f64::from(lo), f64::from(hi) - f64::from(lo));
        let (mut counts, mut least_count) = ([0.0; Self::BINS], 0.0);
        for &value in values {
            let bin = (f64::from(value) - least) / range * Self::BINS as f64;
            counts[(bin as usize).min(Self::BINS - 1)] += 1.0;
            least_count += if value == lo { 1.0 } else { 0.0 };
        }
        let value_of = |bin: f64| least + (bin + 0.5) / Self::BINS as f64 * range;

        // Sparse data, such as a labelled cell: its background was cleared already, all the rest is object.
        let (background, first) = if least_count > 0.99 * values.len() as f64 {
            counts[0] -= least_count;
            (least, 0)
        } else {
            let first = otsu_split(&counts);
            let (count, sum) = count_and_sum(&counts[..first]);
            (value_of(sum / count), first)
        };
        let object = &counts[first..];
        let (object_count, _) = count_and_sum(object);
        let quantile = |share: f64| {
            let mut left = share * object_count;
            let bin = object.iter().position(|count| {
                left -= count;
                left <= 0.0
            });
            value_of((first + bin.unwrap_or(object.len() - 1)) as f64)
        };
        Some(Self { background, threshold: (background + quantile(0.125)) / 2.0, bright: quantile(0.875) })
    }
}

/// The first bin of the upper class when the variance between the two classes is the greatest (Otsu 1979). Neither the
/// first bin nor the last one may be empty.
fn otsu_split(counts: &[f64]) -> usize {
    let (total_count, total_sum) = count_and_sum(counts);
    let (mut count, mut sum) = (0.0, 0.0);
    let (mut best, mut best_variance) = (1, 0.0);
    for split in 1..counts.len() {
        count += counts[split - 1];
        sum += counts[split - 1] * (split - 1) as f64;
        let distance = (total_sum - sum) / (total_count - count) - sum / count;
        let variance = count * (total_count - count) * distance * distance;
        if variance > best_variance {
            (best, best_variance) = (split, variance);
        }
    }
    best
}

/// The number of values in some bins, and the sum of their bins' indices.
fn count_and_sum(counts: &[f64]) -> (f64, f64) {
    counts.iter().enumerate().fold((0.0, 0.0), |(count, sum), (bin, &n)| (count + n, sum + n * bin as f64))
}
