//! Transfer functions, from voxel values to colour and opacity (SPEC §3).

use std::collections::BTreeMap;
use std::ops::{Add, Mul};

use glam::{DVec3, UVec3};

use crate::error::setting::{Interval, SettingError};
use crate::volume::{Members, Volume};

/// Why control points are not a valid [`Ramp`].
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RampError {
    /// There are no control points.
    #[error("no control points, allowed: at least one")]
    Empty,
    /// A position is infinite or NaN.
    #[error("control point {index}: found the position {position:?}, allowed: a finite number")]
    #[non_exhaustive]
    NotFinite {
        /// The point's index.
        index: usize,
        /// The position.
        position: f64,
    },
    /// A position is not above the previous one.
    #[error(
        "control point {index}: found the position {position:?}, allowed: above {before:?}, that of the point before"
    )]
    #[non_exhaustive]
    NotIncreasing {
        /// The point's index, at least 1.
        index: usize,
        /// Its position.
        position: f64,
        /// The previous point's position.
        before: f64,
    },
}

/// A piecewise linear function through control points, constant before the first and after the last.
#[derive(Clone, Debug, PartialEq)]
pub struct Ramp<T> {
    /// At least one point; positions are finite and strictly increasing.
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
            return Err(RampError::NotFinite { index, position: points[index].0 });
        }
        if let Some(at) = points.windows(2).position(|pair| pair[1].0 <= pair[0].0) {
            return Err(RampError::NotIncreasing { index: at + 1, position: points[at + 1].0, before: points[at].0 });
        }
        Ok(Self { points })
    }

    /// A ramp through points that are known to satisfy [`Self::new`].
    pub(crate) fn through(points: Vec<(f64, T)>) -> Self {
        debug_assert!(!points.is_empty() && points.is_sorted_by(|a, b| a.0 < b.0));
        Self { points }
    }

    /// The control points, by ascending position.
    pub fn points(&self) -> &[(f64, T)] {
        &self.points
    }

    /// The ramp's value at a position; at a control point it is exactly that point's value.
    pub fn at(&self, position: f64) -> T {
        let after = self.points.partition_point(|point| point.0 <= position);
        if after == 0 || after == self.points.len() {
            return self.points[after.saturating_sub(1)].1;
        }
        let ((x0, y0), (x1, y1)) = (self.points[after - 1], self.points[after]);
        // Points more than f64::MAX apart have an infinite distance; half of it is finite.
        let scale = if (x1 - x0).is_finite() { 1.0 } else { 0.5 };
        let share = (position * scale - x0 * scale) / (x1 * scale - x0 * scale);
        y0 * (1.0 - share) + y1 * share
    }
}

/// The appearance of a channel's voxels by their values, gradients and, in a segmented volume, labels. Functions that take those of a volume's channels draw
/// as many channels as they are given.
#[derive(Clone, Debug, PartialEq)]
pub struct TransferFunction {
    /// Red, green and blue in [0, 1] over voxel values.
    pub color: Ramp<DVec3>,
    /// Opacity per unit length in [0, 1] over voxel values.
    pub opacity: Ramp<f64>,
    /// A factor in [0, 1] over gradient magnitudes (value per world unit); `None` means 1 everywhere.
    pub gradient_opacity: Option<Ramp<f64>>,
    /// Closed intervals `[lo, hi]` of the values that take part, at least one; `None` means all values.
    pub iso_ranges: Option<Vec<[f64; 2]>>,
    /// Whether values are labels, and gradients those of the membership of a voxel's value (SPEC §15). Without effect for
    /// [`Classification::After`](super::Classification::After).
    pub membership: bool,
    /// Tables for single labels of a segmented volume. Labels without tables use the ramps above. Other volumes ignore them.
    pub labels: BTreeMap<u16, LabelTables>,
}

/// A label's own tables.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelTables {
    /// Whether the label's voxels take part.
    pub visible: bool,
    /// Replaces [`TransferFunction::color`]; `None` uses it.
    pub color: Option<Ramp<DVec3>>,
    /// Replaces [`TransferFunction::opacity`]; `None` uses it.
    pub opacity: Option<Ramp<f64>>,
    /// Replaces [`TransferFunction::gradient_opacity`]; `None` uses it.
    pub gradient_opacity: Option<Ramp<f64>>,
    /// Whether normals are those of the label's membership in the segmentation (SPEC §15), and not the values'. Not for
    /// [`Classification::After`](super::Classification::After).
    pub membership: bool,
}

impl Default for LabelTables {
    fn default() -> Self {
        Self { visible: true, color: None, opacity: None, gradient_opacity: None, membership: false }
    }
}

impl LabelTables {
    /// Checks that the values are in range; `key` names the tables in errors, such as `transfer.label[0]`.
    ///
    /// # Errors
    /// If a colour, opacity or factor is not in [0, 1].
    pub fn check(&self, key: &str) -> Result<(), SettingError> {
        let (color, opacity, gradient_opacity) =
            (self.color.as_ref(), self.opacity.as_ref(), self.gradient_opacity.as_ref());
        Parts { color, opacity, gradient_opacity, ..Parts::default() }.check(key)
    }

    /// Whether these tables change the appearance of voxels; otherwise they only decide which voxels take part.
    pub fn matter_to_shading(&self) -> bool {
        self.visible && self.matter()
    }

    /// Whether they differ from those of labels without any. Classified after splatting (SPEC §9), invisible labels must be known, too.
    pub fn matter(&self) -> bool {
        let is_other = self.color.is_some() || self.opacity.is_some() || self.gradient_opacity.is_some();
        !self.visible || is_other || self.membership
    }
}

/// The tables that apply to the voxels of one label, its own or the common ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tables<'a> {
    /// Whether the label's voxels take part.
    pub visible: bool,
    /// The colour, as in [`TransferFunction::color`].
    pub color: &'a Ramp<DVec3>,
    /// The opacity, as in [`TransferFunction::opacity`].
    pub opacity: &'a Ramp<f64>,
    /// The gradient opacity, as in [`TransferFunction::gradient_opacity`].
    pub gradient_opacity: Option<&'a Ramp<f64>>,
    /// The iso-ranges of [`TransferFunction::iso_ranges`], the same for all labels.
    pub iso_ranges: Option<&'a [[f64; 2]]>,
    /// The labels whose membership has the normals (SPEC §15); those that are the values have the gradients of opacities, too.
    pub members: Option<Members>,
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

    /// The gradient of a voxel that opacities depend on.
    pub(crate) fn gradient(&self, volume: &Volume, voxel: UVec3) -> DVec3 {
        match self.members {
            Some(of @ Members::OfValues) => volume.membership_gradient(of, voxel),
            Some(Members::OfLabels) | None => volume.gradient(voxel),
        }
    }

    /// The end of an iso-range that a value is, but for the rounding of a place between two values found by it; otherwise the value. An iso-range
    /// may be a single value.
    pub(crate) fn exact(&self, value: f64, [from, to]: [f64; 2]) -> f64 {
        let rounding = 4.0 * f64::EPSILON * from.abs().max(to.abs());
        let ends = self.iso_ranges.iter().flat_map(|ranges| ranges.iter().flatten().copied());
        ends.into_iter().find(|end| (end - value).abs() <= rounding).unwrap_or(value)
    }

    /// Whether a value lies in an iso-range.
    pub fn in_iso_range(&self, value: f64) -> bool {
        self.iso_ranges.is_none_or(|ranges| ranges.iter().any(|&[lo, hi]| lo <= value && value <= hi))
    }
}

/// The most control points of a ramp of opacities or factors, and the most iso-ranges: pixels of surfaces look at all of them.
pub(crate) const MAX_POINTS: usize = 1 << 12;

/// The most control points of a ramp of colours: those of a palette of 16 bits.
pub(crate) const MAX_COLORS: usize = 1 << 16;

/// The most pieces of all tables, those of labels included, over which opacities and colours are linear: of each piece backends keep up to 700 bytes.
const MAX_PIECES: usize = 1 << 19;

/// Checks the number of entries of a list.
fn check_length(key: &str, count: usize, most: usize) -> Result<(), SettingError> {
    if count > most {
        return Err(SettingError::new(key, format!("{count} entries"), format!("at most {most} entries, not {count}")));
    }
    Ok(())
}

/// A channel's tables, with its labels' by their numbers; `None` stands for a short ramp that is chosen from the volume.
#[derive(Default)]
pub(crate) struct Parts<'a> {
    pub(crate) color: Option<&'a Ramp<DVec3>>,
    pub(crate) opacity: Option<&'a Ramp<f64>>,
    pub(crate) gradient_opacity: Option<&'a Ramp<f64>>,
    pub(crate) iso_ranges: Option<&'a [[f64; 2]]>,
    pub(crate) labels: Vec<(u64, &'a LabelTables)>,
}

impl Parts<'_> {
    /// Checks that the values of ramps are in [0, 1], that the list of intervals is not empty, that these are finite and not reversed, and that nothing is too
    /// long; `Ramp` itself checks its positions.
    pub(crate) fn check(&self, table: &str) -> Result<(), SettingError> {
        let colors = self.color.map_or(&[][..], Ramp::points);
        check_length(&format!("{table}.color"), colors.len(), MAX_COLORS)?;
        for (at, (_, rgb)) in colors.iter().enumerate() {
            Interval::SHARE.check_each(&format!("{table}.color[{at}][1]"), &rgb.to_array())?;
        }
        for (name, ramp) in [("opacity", self.opacity), ("gradient_opacity", self.gradient_opacity)] {
            let shares = ramp.map_or(&[][..], Ramp::points);
            check_length(&format!("{table}.{name}"), shares.len(), MAX_POINTS)?;
            for (at, &(_, share)) in shares.iter().enumerate() {
                Interval::SHARE.check(&format!("{table}.{name}[{at}][1]"), share)?;
            }
        }
        let list = format!("{table}.iso_ranges");
        if self.iso_ranges.is_some_and(<[_]>::is_empty) {
            return Err(SettingError::new(list, "[]", "an array of one or more [lo, hi]"));
        }
        let ranges = self.iso_ranges.unwrap_or_default();
        check_length(&list, ranges.len(), MAX_POINTS)?;
        for (at, range) in ranges.iter().enumerate() {
            let key = format!("{list}[{at}]");
            Interval::FINITE.check_each(&key, range)?;
            if range[0] > range[1] {
                return Err(SettingError::new(key, &range[..], "[lo, hi] with lo <= hi"));
            }
        }
        self.labels.iter().try_for_each(|(label, tables)| tables.check(&format!("{table}.label[{label}]")))
    }
}

/// Checks that the tables of all channels have a bounded number of pieces: those of a channel count again for each label that uses them.
pub(crate) fn check_pieces<'a>(table: &str, channels: impl Iterator<Item = Parts<'a>>) -> Result<(), SettingError> {
    let of_opacity = |ramp: Option<&Ramp<f64>>| ramp.map_or(1, opacity_pieces);
    let of_color = |ramp: Option<&Ramp<DVec3>>| ramp.map_or(1, |ramp| ramp.points().len());
    let of_channel = |Parts { color, opacity, iso_ranges, labels, .. }: Parts| {
        let (opacities, colors) = (of_opacity(opacity), of_color(color));
        let ends = 2 * iso_ranges.map_or(0, <[_]>::len);
        let of_label = |(_, own): (u64, &LabelTables)| {
            let opacities = own.opacity.as_ref().map_or(opacities, opacity_pieces);
            opacities + own.color.as_ref().map_or(colors, |ramp| ramp.points().len()) + ends
        };
        let all = labels.into_iter().map(of_label).chain([opacities + colors + ends]);
        all.fold(0_usize, usize::saturating_add)
    };
    let pieces = channels.map(of_channel).fold(0_usize, usize::saturating_add);
    if pieces > MAX_PIECES {
        let found = format!("tables of {pieces} pieces, those of labels included");
        return Err(SettingError::new(
            table,
            found,
            format!("at most {MAX_PIECES}: fewer control points, iso-ranges or labels"),
        ));
    }
    Ok(())
}

/// The most pieces that a ramp of opacities is cut into: `exponential` cuts each of its own wherever 1 - α has fallen to 0.84 (SPEC §9).
fn opacity_pieces(ramp: &Ramp<f64>) -> usize {
    let transparency = |alpha: f64| (1.0 - alpha).max(1e-4);
    let cuts = |pair: &[(f64, f64)]| {
        let ratio = transparency(pair[0].1) / transparency(pair[1].1);
        (libm::log(ratio).abs() / 0.173) as usize
    };
    ramp.points().len() + ramp.points().windows(2).map(cuts).sum::<usize>()
}

impl TransferFunction {
    /// Checks that the values are in range.
    ///
    /// # Errors
    /// If a colour, opacity or factor is not in [0, 1] (in labels' tables, too), the list of iso-ranges is empty, an iso-range is
    /// reversed or not finite, or there are more control points, iso-ranges or labels' tables than are drawn (65 536 points of colours, 4096 of others,
    /// 4096 iso-ranges, 524 288 pieces of all tables).
    pub fn check(&self) -> Result<(), SettingError> {
        Self::check_channels(std::slice::from_ref(self))
    }

    /// [`Self::check`] of the transfer functions of several channels.
    pub(crate) fn check_channels(channels: &[Self]) -> Result<(), SettingError> {
        for (number, of) in channels.iter().enumerate() {
            of.parts().check(&if number == 0 {
                "transfer".to_owned()
            } else {
                format!("channel[{number}].transfer")
            })?;
        }
        check_pieces("transfer", channels.iter().map(Self::parts))
    }

    pub(crate) fn parts(&self) -> Parts<'_> {
        Parts {
            color: Some(&self.color),
            opacity: Some(&self.opacity),
            gradient_opacity: self.gradient_opacity.as_ref(),
            iso_ranges: self.iso_ranges.as_deref(),
            labels: self.labels.iter().map(|(&label, tables)| (label.into(), tables)).collect(),
        }
    }

    /// A transfer function with only colour and opacity.
    pub(crate) fn by_value(color: Ramp<DVec3>, opacity: Ramp<f64>) -> Self {
        let labels = BTreeMap::new();
        Self { color, opacity, gradient_opacity: None, iso_ranges: None, membership: false, labels }
    }

    /// A transfer function without any opacity.
    pub(crate) fn transparent() -> Self {
        Self::by_value(Ramp::through(vec![(0.0, DVec3::ZERO)]), Ramp::through(vec![(0.0, 0.0)]))
    }

    /// Whether any voxels have normals of the membership of their labels.
    pub(crate) fn has_membership(&self) -> bool {
        self.membership || self.labels.values().any(|tables| tables.membership)
    }

    /// Whether the opacity of any voxels depends on its gradient.
    #[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
    pub(crate) fn is_by_gradient(&self) -> bool {
        self.gradient_opacity.is_some() || self.labels.values().any(|tables| tables.gradient_opacity.is_some())
    }

    /// The tables that apply to voxels of a label; `None` means those of a volume that is not segmented.
    pub fn tables(&self, label: Option<u16>) -> Tables<'_> {
        let own = label.and_then(|label| self.labels.get(&label));
        let of_label = own.filter(|own| own.membership).map(|_| Members::OfLabels);
        Tables {
            visible: own.is_none_or(|own| own.visible),
            color: own.and_then(|own| own.color.as_ref()).unwrap_or(&self.color),
            opacity: own.and_then(|own| own.opacity.as_ref()).unwrap_or(&self.opacity),
            gradient_opacity: own.and_then(|own| own.gradient_opacity.as_ref()).or(self.gradient_opacity.as_ref()),
            iso_ranges: self.iso_ranges.as_deref(),
            members: of_label.or(self.membership.then_some(Members::OfValues)),
        }
    }

    /// [`Tables::alpha`] without a label.
    pub fn alpha(&self, value: f64, gradient_magnitude: f64) -> f64 {
        self.tables(None).alpha(value, gradient_magnitude)
    }

    /// Whether a value lies in an iso-range.
    pub fn in_iso_range(&self, value: f64) -> bool {
        self.tables(None).in_iso_range(value)
    }
}
