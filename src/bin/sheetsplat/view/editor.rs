//! The transfer function as draggable control points: plain data, in values and opacities.

use glam::DVec3;
use sheetsplat::settings::{Ramp, TransferFunction};

/// A control point of both ramps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ControlPoint {
    pub(super) value: f64,
    /// The opacity per unit length, in [0, 1].
    pub(super) opacity: f64,
    /// Red, green and blue in [0, 1].
    pub(super) color: DVec3,
}

/// The colour and opacity ramps with common control points.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Editor {
    /// At least one point, by ascending value.
    points: Vec<ControlPoint>,
    /// The range of values within which points can be moved.
    range: [f64; 2],
    pub(super) selected: Option<usize>,
}

impl Editor {
    /// The ramps of a transfer function, unchanged: each gets points where only the other one has some. `values` are the volume's minimum
    /// and maximum.
    pub(super) fn new(transfer: &TransferFunction, values: [f64; 2]) -> Self {
        let TransferFunction { color, opacity, .. } = transfer;
        let mut positions: Vec<f64> = color.points().iter().map(|point| point.0).collect();
        positions.extend(opacity.points().iter().map(|point| point.0));
        positions.sort_unstable_by(f64::total_cmp);
        // Compared as numbers, because 0 and -0 are one position.
        positions.dedup_by(|a, b| a == b);
        let points: Vec<ControlPoint> = positions
            .into_iter()
            .map(|value| ControlPoint { value, opacity: opacity.at(value), color: color.at(value) })
            .collect();
        let lo = points.iter().map(|point| point.value).fold(values[0], f64::min);
        let hi = points.iter().map(|point| point.value).fold(values[1], f64::max);
        // An empty range has no scale.
        let margin = if lo < hi { 0.0 } else { (lo.abs() / 10.0).max(0.5) };
        Self { points, range: [lo - margin, hi + margin], selected: None }
    }

    pub(super) fn points(&self) -> &[ControlPoint] {
        &self.points
    }

    pub(super) fn range(&self) -> [f64; 2] {
        self.range
    }

    /// The minimum distance between points when they are moved or added.
    fn gap(&self) -> f64 {
        (self.range[1] - self.range[0]) / 1000.0
    }

    /// The point nearest to the pointer on the screen, if it is within `reach`. `distance` gives a point's distance from the pointer.
    pub(super) fn hit(&self, reach: f64, distance: impl Fn(&ControlPoint) -> f64) -> Option<usize> {
        let distances = self.points.iter().map(distance).enumerate();
        distances.filter(|hit| hit.1 <= reach).min_by(|a, b| a.1.total_cmp(&b.1)).map(|hit| hit.0)
    }

    /// Moves a point as far as its neighbours, the range and [0, 1] allow.
    pub(super) fn drag(&mut self, index: usize, value: f64, opacity: f64) {
        let before = index.checked_sub(1).map(|before| self.points[before].value);
        let after = self.points.get(index + 1).map(|after| after.value);
        let lo = before.map_or(self.range[0], |before| before + self.gap());
        let hi = after.map_or(self.range[1], |after| after - self.gap());
        let point = &mut self.points[index];
        point.opacity = opacity.clamp(0.0, 1.0);
        // A scene file may have neighbours closer than the minimum distance, which hold the point in place.
        if lo <= hi {
            point.value = value.clamp(lo, hi);
        }
    }

    /// Adds a point with the colour at its value, and selects it; does nothing where a point already is.
    pub(super) fn add(&mut self, value: f64, opacity: f64) {
        let value = value.clamp(self.range[0], self.range[1]);
        if self.points.iter().any(|point| (point.value - value).abs() < self.gap()) {
            return;
        }
        let Some(color) = self.ramp(|point| point.color).map(|ramp| ramp.at(value)) else { return };
        let index = self.points.partition_point(|point| point.value < value);
        self.points.insert(index, ControlPoint { value, opacity: opacity.clamp(0.0, 1.0), color });
        self.selected = Some(index);
    }

    /// Removes a point, unless it is the only one.
    pub(super) fn remove(&mut self, index: usize) {
        if self.points.len() > 1 {
            self.points.remove(index);
            self.selected = None;
        }
    }

    /// Gives a point another colour.
    pub(super) fn recolor(&mut self, index: usize, color: DVec3) {
        self.points[index].color = color;
    }

    fn ramp<T>(&self, of: impl Fn(&ControlPoint) -> T) -> Option<Ramp<T>>
    where
        T: Copy + std::ops::Add<Output = T> + std::ops::Mul<f64, Output = T>,
    {
        Ramp::new(self.points.iter().map(|point| (point.value, of(point))).collect()).ok()
    }

    /// A transfer function with these ramps and the rest of `like`.
    pub(super) fn apply(&self, like: &TransferFunction) -> TransferFunction {
        let color = self.ramp(|point| point.color).unwrap_or_else(|| like.color.clone());
        let opacity = self.ramp(|point| point.opacity).unwrap_or_else(|| like.opacity.clone());
        TransferFunction { color, opacity, ..like.clone() }
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    /// A transfer function with opacity points at 10, 20 and 40, and colour points at 0 and 20.
    fn transfer() -> TransferFunction {
        TransferFunction {
            color: Ramp::new(vec![(0.0, DVec3::X), (20.0, DVec3::Y)]).unwrap(),
            opacity: Ramp::new(vec![(10.0, 0.0), (20.0, 0.5), (40.0, 1.0)]).unwrap(),
            gradient_opacity: Some(Ramp::new(vec![(3.0, 0.5)]).unwrap()),
            iso_ranges: Some(vec![[5.0, 60.0]]),
            membership: false,
            labels: BTreeMap::new(),
        }
    }

    fn editor() -> Editor {
        Editor::new(&transfer(), [-20.0, 100.0])
    }

    fn values(editor: &Editor) -> Vec<f64> {
        editor.points().iter().map(|point| point.value).collect()
    }

    #[test]
    fn points_are_those_of_both_ramps_and_change_neither() {
        let (editor, old) = (editor(), transfer());
        assert_eq!(values(&editor), [0.0, 10.0, 20.0, 40.0]);
        let new = editor.apply(&old);
        for value in [-5.0, 0.0, 5.0, 10.0, 13.0, 20.0, 31.0, 40.0, 99.0] {
            assert!((new.opacity.at(value) - old.opacity.at(value)).abs() < 1e-12, "{value}");
            assert!(new.color.at(value).abs_diff_eq(old.color.at(value), 1e-12), "{value}");
        }
        assert_eq!((new.gradient_opacity, new.iso_ranges), (old.gradient_opacity, old.iso_ranges));
    }

    #[test]
    fn the_range_holds_all_values_and_points_and_has_an_extent() {
        assert_eq!(editor().range(), [-20.0, 100.0]);
        assert_eq!(Editor::new(&transfer(), [15.0, 30.0]).range(), [0.0, 40.0]);
        let constant = TransferFunction {
            color: Ramp::new(vec![(7.0, DVec3::ONE)]).unwrap(),
            opacity: Ramp::new(vec![(7.0, 0.5)]).unwrap(),
            ..transfer()
        };
        let [lo, hi] = Editor::new(&constant, [7.0, 7.0]).range();
        assert!(lo < 7.0 && 7.0 < hi, "{lo} {hi}");
    }

    #[test]
    fn the_nearest_point_within_reach_is_hit() {
        let editor = editor();
        let at = |value: f64| editor.hit(4.0, |point| (point.value - value).abs());
        assert_eq!(
            [at(-3.0), at(6.0), at(8.0), at(17.0), at(35.0), at(41.0)],
            [Some(0), Some(1), Some(1), Some(2), None, Some(3)]
        );
    }

    #[test]
    fn a_point_stays_between_its_neighbours_and_the_bounds() {
        let mut editor = editor();
        editor.drag(1, 15.0, 0.25);
        assert_eq!((editor.points()[1].value, editor.points()[1].opacity), (15.0, 0.25));
        editor.drag(1, 90.0, 2.0);
        assert!(editor.points()[1].value < 20.0 && editor.points()[1].value > 19.5, "{editor:?}");
        assert_eq!(editor.points()[1].opacity, 1.0);
        editor.drag(1, -90.0, -2.0);
        assert!(editor.points()[1].value > 0.0 && editor.points()[1].value < 0.5, "{editor:?}");
        assert_eq!(editor.points()[1].opacity, 0.0);
        editor.drag(0, -90.0, 0.0);
        editor.drag(3, 900.0, 0.0);
        assert_eq!((editor.points()[0].value, editor.points()[3].value), (-20.0, 100.0));
    }

    #[test]
    fn neighbours_closer_than_the_gap_hold_a_point() {
        let step = TransferFunction { opacity: Ramp::new(vec![(19.99, 0.0), (20.01, 0.5)]).unwrap(), ..transfer() };
        let mut editor = Editor::new(&step, [-20.0, 100.0]);
        editor.drag(2, 50.0, 0.75);
        assert_eq!((editor.points()[2].value, editor.points()[2].opacity), (20.0, 0.75));
    }

    #[test]
    fn an_added_point_takes_the_colour_that_is_there() {
        let mut editor = editor();
        editor.add(5.0, 0.9);
        assert_eq!(values(&editor), [0.0, 5.0, 10.0, 20.0, 40.0]);
        assert_eq!(editor.selected, Some(1));
        assert!(editor.points()[1].color.abs_diff_eq(DVec3::new(0.75, 0.25, 0.0), 1e-12));
        assert_eq!(editor.apply(&transfer()).opacity.at(5.0), 0.9);
        editor.add(5.01, 0.1);
        assert_eq!(values(&editor).len(), 5, "on top of another");
    }

    #[test]
    fn all_points_but_the_last_can_be_removed() {
        let mut editor = editor();
        editor.selected = Some(2);
        editor.remove(1);
        assert_eq!((values(&editor), editor.selected), (vec![0.0, 20.0, 40.0], None));
        for _ in 0..5 {
            editor.remove(0);
        }
        assert_eq!(values(&editor), [40.0]);
    }
}
