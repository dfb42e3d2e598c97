//! The integral of the transfer function over the values between two slab planes (SPEC §9): pre-integration (Engel, Kraus, Ertl,
//! *High-quality pre-integrated volume rendering using hardware-accelerated pixel shading*, 2001), here without a table.
//!
//! The values run linearly from f0 to f1, `v(t) = f0 + (f1 - f0)·t` for t from 0 to 1. With m(v) the amount per unit length,
//! `m̄ = ∫m dt`, `C̄ = ∫m·C dt / ∫m dt`, and `(v̄ - f0)/(f1 - f0) = ∫m·t dt / ∫m dt`, which is stable even if f0 and f1 are equal.
//!
//! α and C are linear, and the integrands smooth, between control points, ends of iso-ranges and the point where α reaches its cap, so each
//! of these pieces has its own quadrature. Gauss's with `NODES` nodes is exact for products of linear functions. The logarithm of
//! `exponential` diverges towards `1 - α = 0`: pieces over which `1 - α` falls to less than half are split wherever it halves, after
//! which the quadrature errs by less than 1e-12.

use glam::DVec3;

use crate::reference::shading::amount;
use crate::settings::splatting::Compositing;
use crate::settings::transfer_function::{Ramp, Tables};

/// The cap of opacities in the logarithm of `exponential` (SPEC §5).
const MAX_ALPHA: f64 = 0.9999;

/// Gauss–Legendre nodes in [-1, 1] with their weights; one of each symmetric pair.
const NODES: [(f64, f64); 4] = [
    (0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.525_532_409_916_329, 0.313_706_645_877_887_3),
    (0.796_666_477_413_626_7, 0.222_381_034_453_374_48),
    (0.960_289_856_497_536_3, 0.101_228_536_290_376_26),
];

/// The means over a slab.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlabIntegral {
    /// `m̄`, the mean amount per unit length, without gradient opacity; above 0.
    pub amount: f64,
    /// `C̄`, unshaded.
    pub color: DVec3,
    /// `(v̄ - f0)/(f1 - f0)` in [0, 1]; ½ if f0 and f1 are equal.
    pub share: f64,
}

impl SlabIntegral {
    /// The means over the values from f0 to f1; `None` if all of them are transparent.
    pub fn new(tables: &Tables, compositing: Compositing, [f0, f1]: [f64; 2]) -> Option<Self> {
        if !tables.visible {
            return None;
        }
        let at = |t: f64| f0 + (f1 - f0) * t;
        let (mut amounts, mut colors, mut moments) = (0.0, DVec3::ZERO, 0.0);
        let knots = knots(tables, [f0, f1]);
        for piece in knots.windows(2) {
            let [start, end] = [piece[0], piece[1]];
            let [alpha_start, alpha_end] = [start, end].map(|t| tables.opacity.at(at(t)));
            if alpha_start.max(alpha_end) <= 0.0 || !tables.in_iso_range(at((start + end) / 2.0)) {
                continue;
            }
            for (start, end) in smooth_pieces(compositing, start, end, alpha_start, alpha_end) {
                for (t, weight) in nodes(start, end) {
                    let alpha = tables.opacity.at(at(t));
                    let m = weight * amount(compositing, alpha);
                    amounts += m;
                    colors += m * tables.color.at(at(t));
                    moments += m * t;
                }
            }
        }
        (amounts > 0.0).then(|| Self { amount: amounts, color: colors / amounts, share: moments / amounts })
    }
}

/// Whether any value from f0 to f1 has an opacity above 0, including a single value with its own iso-range.
pub fn is_visible(tables: &Tables, [f0, f1]: [f64; 2]) -> bool {
    let at = |t: f64| f0 + (f1 - f0) * t;
    let alpha = |t: f64| tables.opacity.at(at(t));
    let knots = knots(tables, [f0, f1]);
    let shows_inside = |piece: &[f64]| {
        tables.in_iso_range(at((piece[0] + piece[1]) / 2.0)) && alpha(piece[0]).max(alpha(piece[1])) > 0.0
    };
    let shows_at = |&t: &f64| tables.in_iso_range(at(t)) && alpha(t) > 0.0;
    tables.visible && (knots.iter().any(shows_at) || knots.windows(2).any(shows_inside))
}

/// The positions between f0 and f1 at which α or C has a kink or m a step, ascending from 0 to 1.
pub fn knots(tables: &Tables, [f0, f1]: [f64; 2]) -> Vec<f64> {
    fn positions<T>(ramp: &Ramp<T>) -> impl Iterator<Item = f64> + '_
    where
        T: Copy + std::ops::Add<Output = T> + std::ops::Mul<f64, Output = T>,
    {
        ramp.points().iter().map(|(position, _)| *position)
    }
    let (low, high) = (f0.min(f1), f0.max(f1));
    let iso_ranges = tables.iso_ranges.iter().flat_map(|ranges| ranges.iter().flatten().copied());
    let values = positions(tables.opacity).chain(positions(tables.color)).chain(iso_ranges);
    let between = values.filter(|&value| low < value && value < high).map(|value| (value - f0) / (f1 - f0));
    let mut knots: Vec<f64> = [0.0, 1.0].into_iter().chain(between).collect();
    knots.sort_by(f64::total_cmp);
    knots.dedup();
    knots
}

/// Splits a piece over which α is linear into pieces over which m is smooth enough for the quadrature.
fn smooth_pieces(compositing: Compositing, start: f64, end: f64, alpha_start: f64, alpha_end: f64) -> Vec<(f64, f64)> {
    let mut cuts = vec![start];
    if compositing.is_optical_depth() && alpha_start != alpha_end {
        // The transparencies 1 - α at both ends, the larger one first, and the ends' positions.
        let [larger, smaller] =
            [1.0 - alpha_start.min(alpha_end), (1.0 - alpha_start.max(alpha_end)).max(1.0 - MAX_ALPHA)];
        let place = |transparency: f64| {
            start + (end - start) * ((1.0 - transparency - alpha_start) / (alpha_end - alpha_start)).clamp(0.0, 1.0)
        };
        let halved = std::iter::successors(Some(larger / 2.0), |transparency| Some(transparency / 2.0));
        cuts.extend(halved.take_while(|&transparency| transparency > smaller).map(place));
        cuts.push(place(smaller));
    }
    cuts.push(end);
    cuts.sort_by(f64::total_cmp);
    cuts.windows(2).map(|pair| (pair[0], pair[1])).filter(|(start, end)| start < end).collect()
}

/// The quadrature's nodes and weights on an interval.
fn nodes(start: f64, end: f64) -> impl Iterator<Item = (f64, f64)> {
    let (middle, half) = ((start + end) / 2.0, (end - start) / 2.0);
    let pair = move |(node, weight): (f64, f64)| {
        [(middle - half * node, half * weight), (middle + half * node, half * weight)]
    };
    NODES.into_iter().flat_map(pair)
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;
    use crate::settings::transfer_function::TransferFunction;

    fn transfer(opacity: &[(f64, f64)]) -> TransferFunction {
        let color = vec![(0.0, DVec3::new(1.0, 0.0, 0.2)), (100.0, DVec3::new(0.0, 0.5, 0.2))];
        TransferFunction::by_value(Ramp::new(color).unwrap(), Ramp::new(opacity.to_vec()).unwrap())
    }

    /// The means by summation.
    fn summed(tables: &Tables, compositing: Compositing, [f0, f1]: [f64; 2]) -> [f64; 5] {
        const STEPS: usize = 400_000;
        let mut sums = [0.0; 5];
        for step in 0..STEPS {
            let t = (step as f64 + 0.5) / STEPS as f64;
            let v = f0 + (f1 - f0) * t;
            let m = if tables.in_iso_range(v) { amount(compositing, tables.opacity.at(v)) } else { 0.0 };
            let color = tables.color.at(v);
            let terms = [m, m * color.x, m * color.y, m * color.z, m * t];
            sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term / STEPS as f64);
        }
        sums
    }

    #[test]
    fn means_are_those_of_many_samples() {
        let ranges = [None, Some(vec![[12.0, 33.0], [48.0, 48.0], [60.0, 1e6]])];
        for (opacity, iso_ranges) in [
            vec![(10.0, 0.0), (60.0, 1.0)],
            vec![(30.0, 0.0), (30.1, 0.9), (31.1, 0.9), (31.2, 0.0)],
            vec![(0.0, 0.9999), (50.0, 1.0), (80.0, 0.3)],
            vec![(0.0, 0.4)],
        ]
        .into_iter()
        .flat_map(|opacity| ranges.clone().map(|ranges| (opacity.clone(), ranges)))
        {
            let transfer = TransferFunction { iso_ranges, ..transfer(&opacity) };
            let tables = transfer.tables(None);
            for compositing in [Compositing::Linear, Compositing::Exponential] {
                for ends in [[0.0, 100.0], [90.0, 20.0], [29.0, 32.0], [59.9, 60.1]] {
                    let [m, r, g, b, moment] = summed(&tables, compositing, ends);
                    let Some(means) = SlabIntegral::new(&tables, compositing, ends) else {
                        assert_eq!(m, 0.0);
                        continue;
                    };
                    let close = |a: f64, b: f64| (a - b).abs() < 1e-4 * a.abs().max(1e-3);
                    let color = means.color * means.amount;
                    assert!(
                        close(m, means.amount)
                            && [r, g, b].iter().zip(color.to_array()).all(|(&a, b)| close(a, b))
                            && close(moment, means.share * means.amount),
                        "{opacity:?} {compositing:?} {ends:?}: {means:?}, not {m} {:?} {}",
                        [r / m, g / m, b / m],
                        moment / m
                    );
                }
            }
        }
    }

    /// Compares with closed forms: the integral of -ln(1-α) for linear α, and that of a product of two linear functions.
    #[test]
    fn closed_forms() {
        let transfer = transfer(&[(0.0, 0.0), (100.0, 0.9999)]);
        let tables = transfer.tables(None);
        let exponential = SlabIntegral::new(&tables, Compositing::Exponential, [0.0, 100.0]).unwrap();
        // With x = 1 - α: ∫ -ln x dx from 1e-4 to 1 = [x - x·ln x], over the range of x.
        let x: f64 = 1.0 - 0.9999;
        let expected = (1.0 - (x - x * x.ln())) / (1.0 - x);
        assert!((exponential.amount - expected).abs() < 1e-12, "{} {expected}", exponential.amount);
        let linear = SlabIntegral::new(&tables, Compositing::Linear, [0.0, 100.0]).unwrap();
        assert!((linear.amount - 0.49995).abs() < 1e-12);
        assert!((linear.share - 2.0 / 3.0).abs() < 1e-12);
        // ∫ t·(1-t) / ∫ t.
        assert!((linear.color - DVec3::new(1.0 / 3.0, 1.0 / 3.0, 0.2)).abs().max_element() < 1e-12);
    }

    #[test]
    fn equal_and_nearly_equal_ends() {
        let transfer = transfer(&[(0.0, 0.0), (100.0, 0.8)]);
        let tables = transfer.tables(None);
        for compositing in [Compositing::Linear, Compositing::Exponential] {
            let equal = SlabIntegral::new(&tables, compositing, [40.0, 40.0]).unwrap();
            assert!((equal.amount - amount(compositing, 0.32)).abs() < 1e-12);
            assert!((equal.share - 0.5).abs() < 1e-12);
            for step in [1e-13, 1e-9, 1e-5] {
                for ends in [[40.0, 40.0 + step], [40.0 + step, 40.0]] {
                    let near = SlabIntegral::new(&tables, compositing, ends).unwrap();
                    assert!((near.amount - equal.amount).abs() < step);
                    assert!((near.share - 0.5).abs() < 1e-6 && (near.color - equal.color).length() < 1e-6);
                }
            }
        }
        // Only one value has an opacity, so only a pixel that sees nothing else shows it.
        let iso_ranges = Some(vec![[40.0, 40.0]]);
        let single = TransferFunction { iso_ranges, ..transfer.clone() };
        let tables = single.tables(None);
        assert!(SlabIntegral::new(&tables, Compositing::Linear, [40.0, 40.0]).is_some());
        assert_eq!(SlabIntegral::new(&tables, Compositing::Linear, [39.0, 41.0]), None);
    }
}
