//! The table of the transfer function's integrals, read in f32, against the twin's quadrature.

use std::collections::BTreeMap;

use glam::DVec3;
use sheetsplat::internals::after::normalization::Normalization;
use sheetsplat::internals::after::slab_integral::{SlabIntegral, table};
use sheetsplat::internals::reference::after::slab_integral::SlabIntegral as Twin;
use sheetsplat::settings::{Compositing, Ramp, SlabProfile, Splatting, TransferFunction};

use crate::common::Random;

/// Ramps over values in `[min, max]`: smooth ones, steps, and peaks one value wide beside plateaus.
fn random_transfer(random: &mut Random, [min, max]: [f64; 2]) -> TransferFunction {
    let size = max - min;
    let mut opacity = Vec::new();
    for _ in 0..1 + random.bits() % 4 {
        let at = (random.uniform(min, max)).round();
        let height = random.pick(&[0.001, 0.3, 0.9, 0.9999, 1.0]);
        let narrow: &[f64] = match random.bits() % 4 {
            0 => &[0.5],
            1 => &[1.0],
            _ => &[],
        };
        let width = narrow.first().copied().unwrap_or_else(|| random.uniform(0.01, 0.3) * size);
        opacity.extend([(at - width, 0.0), (at, height), (at + width, random.pick(&[0.0, height]))]);
    }
    opacity.sort_by(|a, b| a.0.total_cmp(&b.0));
    opacity.dedup_by(|a, b| a.0 == b.0);
    let color = |random: &mut Random| random.within(DVec3::ZERO, DVec3::ONE);
    let mut colors: Vec<(f64, DVec3)> =
        (0..1 + random.bits() % 4).map(|_| (random.uniform(min, max), color(random))).collect();
    colors.sort_by(|a, b| a.0.total_cmp(&b.0));
    let ends = |random: &mut Random| [random.uniform(min, max), random.uniform(min, max)].map(f64::round);
    let ranges = (0..2).map(|_| ends(random)).map(|[a, b]| [a.min(b), a.max(b)]).collect();
    TransferFunction {
        color: Ramp::new(colors).unwrap(),
        opacity: Ramp::new(opacity).unwrap(),
        gradient_opacity: None,
        iso_ranges: random.pick(&[false, true]).then_some(ranges),
        membership: false,
        labels: BTreeMap::new(),
    }
}

/// 8-bit values, 16-bit values, and values whose range is far from 0. Where values begin and end equal or nearly so, close together and far apart.
#[test]
fn tables_are_the_quadrature() {
    let mut random = Random(17);
    let mut compared = 0;
    for case in 0..3000 {
        let range = random.pick(&[[0.0, 255.0], [-1024.0, 3071.0], [0.0, 65535.0], [1e6, 1e6 + 900.0]]);
        let transfer = random_transfer(&mut random, range);
        let tables = transfer.tables(None);
        let compositing = random.pick(&[Compositing::Linear, Compositing::Exponential]);
        let numbers = Normalization::new(range);
        let slab_profile = random.pick(&[SlabProfile::Linear, SlabProfile::Cubic]);
        let points = table(&tables, &Splatting { compositing, slab_profile, ..Splatting::default() }, &numbers);
        // The middles of cubic slabs lie beyond all values.
        let size = if slab_profile == SlabProfile::Cubic { range[1] - range[0] } else { 0.0 };
        let range = [range[0] - size, range[1] + size];
        for _ in 0..8 {
            let f0 = random.uniform(range[0], range[1]);
            let step = random.pick(&[0.0, 1e-6, 0.01, 1.0, 30.0, 3e4]) * random.uniform(-1.0, 1.0);
            let ends = [f0, (f0 + step).clamp(range[0], range[1])].map(|value| numbers.apply(value) as f32);
            let values = ends.map(|x| numbers.base + f64::from(x) / numbers.scale);
            let ours = SlabIntegral::new(&points, compositing, ends);
            let Some(twin) = Twin::new(&tables, compositing, values) else {
                assert!(ours.is_none_or(|ours| ours.amount < 1e-6), "{case}: {ours:?} of nothing at {values:?}");
                continue;
            };
            let (amount, color, share) = ours.map_or((0.0, DVec3::ZERO, 0.5), |ours| {
                (f64::from(ours.amount), ours.color.as_dvec3(), f64::from(ours.share))
            });
            assert!(
                (amount - twin.amount).abs() <= 3e-5 * twin.amount + 1e-6,
                "{case}: {amount} {twin:?} {values:?} {compositing:?} {transfer:?}"
            );
            if twin.amount > 1e-3 {
                let far = (color - twin.color).abs().max_element();
                assert!(far <= 1e-4 && (share - twin.share).abs() <= 1e-4, "{case}: {ours:?} {twin:?} {values:?}");
                compared += 1;
            }
        }
    }
    assert!(compared > 5000, "{compared}");
}

/// A peak that is as narrow as values are apart keeps its digits beside a plateau of 65000 values.
#[test]
fn narrow_peaks_beside_plateaus() {
    let color = Ramp::new(vec![(0.0, DVec3::X), (65535.0, DVec3::Y)]).unwrap();
    let opacity = vec![(65000.0, 0.9), (65001.0, 0.0), (65100.0, 0.0), (65100.5, 0.01), (65101.0, 0.0)];
    let opacity = Ramp::new(opacity).unwrap();
    let transfer = TransferFunction {
        color,
        opacity,
        gradient_opacity: None,
        iso_ranges: None,
        membership: false,
        labels: BTreeMap::new(),
    };
    let numbers = Normalization::new([0.0, 65535.0]);
    let points = table(&transfer.tables(None), &Splatting::default(), &numbers);
    let ends = [65050.0, 65400.0].map(|value| numbers.apply(value) as f32);
    let ours = SlabIntegral::new(&points, Compositing::Linear, ends).unwrap();
    let expected = 0.005 / 350.0;
    assert!((f64::from(ours.amount) / expected - 1.0).abs() < 1e-5, "{ours:?}, not {expected}");
    assert!((f64::from(ours.share) - 50.5 / 350.0).abs() < 1e-5, "{ours:?}");
}
