//! Ramps, the meaning of opacities, and transfer functions chosen for volumes without one.

use std::collections::BTreeMap;
use std::path::Path;

use glam::{DVec3, UVec3};
use sheetsplat::appearance::Preset;
use sheetsplat::scene::{Scene, TransferSettings, VolumeSource};
use sheetsplat::settings::{Ramp, RampError, TransferFunction};
use sheetsplat::volume::Volume;

use crate::common::Random;
use crate::common::shared::shared;

#[test]
fn ramp_evaluation() {
    let ramp = Ramp::new(vec![(0.1, 0.3), (0.2, 0.7), (1.0, 0.1)]).unwrap();
    for &(position, value) in ramp.points() {
        assert_eq!(ramp.at(position), value);
    }
    assert_eq!((ramp.at(-1e300), ramp.at(f64::NEG_INFINITY)), (0.3, 0.3));
    assert_eq!((ramp.at(1.1), ramp.at(f64::INFINITY)), (0.1, 0.1));
    assert!((ramp.at(0.15) - 0.5).abs() < 1e-15);
    assert!((ramp.at(0.4) - 0.55).abs() < 1e-15);

    let color = Ramp::new(vec![(0.0, DVec3::ZERO), (2.0, DVec3::new(1.0, 0.5, 0.0))]).unwrap();
    assert_eq!(color.at(1.0), DVec3::new(0.5, 0.25, 0.0));
    assert_eq!(Ramp::new(vec![(5.0, 0.5)]).unwrap().at(3.0), 0.5);
    assert_eq!(Ramp::new(vec![(f64::MIN, 0.0), (f64::MAX, 1.0)]).unwrap().at(0.0), 0.5);
    assert_eq!(Ramp::new(vec![(0.0, 0.25), (5e-324, 1.0)]).unwrap().at(0.0), 0.25);

    assert_eq!(Ramp::<f64>::new(vec![]), Err(RampError::Empty));
    let error = Ramp::new(vec![(0.0, 0.0), (f64::NAN, 1.0)]).unwrap_err();
    assert!(matches!(error, RampError::NotFinite { index: 1, position, .. } if position.is_nan()), "{error}");
    let error = Ramp::new(vec![(0.0, 0.0), (1.0, 0.0), (0.5, 1.0)]).unwrap_err();
    assert!(matches!(error, RampError::NotIncreasing { index: 2, position: 0.5, before: 1.0, .. }), "{error}");
}

/// Projections are white in the dark and black in the light, unless their colours are stated.
#[test]
fn projections_are_dark_on_a_light_background() {
    for (preset, background, colors, is_dark) in [
        ("xray", "[0,0,0,1]", "", false),
        ("xray", "[1,1,1,1]", "", true),
        ("mip", "[0.9,0.9,0.8,1]", "", true),
        ("mip", "[1,1,1,0.2]", "", false),
        ("mip", "[1,1,1,1]", "transfer.color=[[0,[1,1,1]]]", false),
        ("confocal", "[1,1,1,1]", "", false),
    ] {
        let sets = [format!("preset={preset}"), format!("image.background={background}"), colors.to_owned()];
        let sets: Vec<String> = sets.into_iter().filter(|set| !set.is_empty()).collect();
        let scene = Scene::from_volume(VolumeSource::Builtin("head:16".to_owned()), &sets).unwrap();
        let color = scene.resolve(&scene.load_volume().unwrap())[0].color.clone();
        let dark = color.points().iter().all(|(_, rgb)| *rgb == DVec3::ZERO);
        assert_eq!(dark, is_dark, "{preset} on {background}: {color:?}");
    }
}

#[test]
fn alpha() {
    let mut transfer = TransferFunction {
        color: Ramp::new(vec![(0.0, DVec3::ONE)]).unwrap(),
        opacity: Ramp::new(vec![(0.0, 0.0), (10.0, 1.0)]).unwrap(),
        gradient_opacity: None,
        iso_ranges: None,
        membership: false,
        labels: BTreeMap::new(),
    };
    assert_eq!((transfer.alpha(5.0, 0.0), transfer.alpha(20.0, 0.0)), (0.5, 1.0));
    transfer.gradient_opacity = Some(Ramp::new(vec![(0.0, 0.0), (4.0, 1.0)]).unwrap());
    assert_eq!((transfer.alpha(5.0, 1.0), transfer.alpha(5.0, 9.0)), (0.125, 0.5));
    transfer.iso_ranges = Some(vec![[2.0, 4.0], [6.0, 6.0]]);
    let taking_part = [1.9, 2.0, 4.0, 4.1, 6.0, 7.0].map(|value| transfer.alpha(value, 9.0) > 0.0);
    assert_eq!(taking_part, [false, true, true, false, true, false]);
    assert_eq!(taking_part, [1.9, 2.0, 4.0, 4.1, 6.0, 7.0].map(|value| transfer.in_iso_range(value)));
}

fn volume(values: Vec<f32>) -> Volume {
    Volume::new("test", UVec3::new(values.len() as u32, 1, 1), DVec3::ONE, values).unwrap()
}

/// The chosen transfer function, after checks that apply to every volume.
fn chosen(values: Vec<f32>) -> TransferFunction {
    let volume = volume(values);
    let transfer = TransferFunction::from_histogram(&volume);
    assert_eq!(Ramp::new(transfer.color.points().to_vec()).as_ref(), Ok(&transfer.color));
    assert_eq!(Ramp::new(transfer.opacity.points().to_vec()).as_ref(), Ok(&transfer.opacity));
    let alphas = || volume.values().iter().map(|value| transfer.alpha(f64::from(value), 0.0));
    assert!(alphas().all(|alpha| (0.0..=1.0).contains(&alpha)));
    assert!(alphas().any(|alpha| alpha >= 0.5), "nothing shows");
    for value in volume.values() {
        let color = transfer.color.at(f64::from(value));
        assert!(color.is_finite() && color.min_element() >= 0.0 && color.max_element() <= 1.0);
    }
    transfer
}

/// The value at which the chosen opacity is half its maximum.
fn surface(transfer: &TransferFunction) -> f64 {
    let points = transfer.opacity.points();
    (points[0].0 + points[1].0) / 2.0
}

/// Volumes with an object: of `count` values, one in `period` is `object`, and the others are `background`.
fn two_valued(background: f32, object: f32, count: usize, period: usize) -> Vec<f32> {
    (0..count).map(|at| if at % period == 0 { object } else { background }).collect()
}

#[test]
fn chosen_for_two_values() {
    // Including one step of f32, the smallest and the largest range, and sparse objects.
    let next = f32::from_bits(1.0_f32.to_bits() + 1);
    let pairs =
        [(0.0, 1.0), (1.0, next), (1e-12, 2e-12), (0.0, f32::from_bits(1)), (-1e30, 1e30), (f32::MIN, f32::MAX)];
    for (background, object) in pairs {
        for period in [2, 10, 150, 5000] {
            let transfer = chosen(two_valued(background, object, 10_000, period));
            assert_eq!(transfer.alpha(f64::from(background), 0.0), 0.0, "{background} {object} {period}");
            assert_eq!(transfer.alpha(f64::from(object), 0.0), 0.9, "{background} {object} {period}");
        }
        chosen(two_valued(object, background, 10_000, 2));
        chosen(two_valued(object, background, 10_000, 5000));
    }
}

#[test]
fn chosen_for_a_constant() {
    for value in [0.0, -3.0, 1e30, 1e-40, f32::MAX] {
        assert_eq!(chosen(vec![value; 27]).alpha(f64::from(value), 0.0), 0.5);
    }
    assert_eq!(chosen(vec![7.0]).alpha(7.0, 0.0), 0.5);
}

#[test]
fn chosen_for_noisy_data() {
    // Background 0 to 19, a faint fifth of the object from 80 on, the rest from 130 on; and the same far from 0.
    let noisy = |at: usize| {
        let noise = (at * 7919 % 20) as f32;
        noise
            + match at % 20 {
                0 => 80.0,
                4 | 8 | 12 | 16 => 130.0,
                _ => 0.0,
            }
    };
    let threshold = surface(&chosen((0..20_000).map(noisy).collect()));
    assert!((40.0..55.0).contains(&threshold), "{threshold}");
    let threshold = surface(&chosen((0..20_000).map(|at| noisy(at) * 1e27 - 1e30).collect()));
    assert!((-0.96e30..-0.945e30).contains(&threshold), "{threshold}");

    // A cleared background, 99.5 % of the voxels, around values from 20 to 255: even the faintest of these are visible.
    let sparse = |at: usize| if at.is_multiple_of(200) { (20 + at / 200 * 37 % 236) as f32 } else { 0.0 };
    let transfer = chosen((0..100_000).map(sparse).collect());
    assert!(transfer.alpha(0.0, 0.0) == 0.0 && transfer.alpha(35.0, 0.0) == 0.9);
    let [(_, dark), (_, bright)] = transfer.color.points()[..] else { panic!("two colours") };
    assert!(bright.cmpge(dark).all());
}

/// A body of soft tissue with bone in air, a fifth of its voxels; every `period`th voxel has another value, in a run.
fn body_with(count: usize, wild: f32) -> Vec<f32> {
    let noise = |at: usize| (at * 7919 % 49) as f32 - 24.0;
    let body = |at: usize| match at % 20 {
        0 => 900.0,
        5 | 10 | 15 => 40.0,
        _ => -1000.0,
    };
    let mut values: Vec<f32> = (0..85_184).map(|at| body(at) + noise(at)).collect();
    (0..count).for_each(|at| values[at * 97] = wild + if wild == 26_000.0 { noise(at) * 60.0 } else { 0.0 });
    values
}

/// Metal, a clipped artefact, or a number for what was not measured, in up to one voxel of 200.
#[test]
fn few_wild_values_do_not_hide_the_rest() {
    let body = chosen(body_with(0, 0.0));
    assert!((-600.0..-300.0).contains(&surface(&body)), "{body:?}");
    for count in [17, 85, 425] {
        for wild in [26_000.0, 32_767.0, -32_768.0, 1e30, -1e30, f32::MAX] {
            let values = body_with(count, wild);
            let transfer = chosen(values.clone());
            assert!((surface(&transfer) - surface(&body)).abs() < 40.0, "{count} of {wild}: {transfer:?}");
            assert!(transfer.alpha(40.0, 0.0) > 0.8 && transfer.alpha(-1000.0, 0.0) == 0.0, "{count} of {wild}");
            // The colours tell the body apart, not the wild values.
            let [(_, _), (bright, _)] = transfer.color.points()[..] else { panic!("two colours") };
            assert!((800.0..1000.0).contains(&bright), "{count} of {wild}: {bright}");
            for preset in [Preset::Mip, Preset::Xray] {
                let volume = Volume::new("test", UVec3::new(44, 44, 44), DVec3::ONE, values.clone()).unwrap();
                let alone = Volume::new("test", UVec3::new(44, 44, 44), DVec3::ONE, body_with(0, 0.0)).unwrap();
                let [wild_alpha, alpha] = [&volume, &alone].map(|volume| preset.transfer(volume).alpha(900.0, 0.0));
                let has_high = wild > 0.0;
                assert!(!has_high || (wild_alpha / alpha - 1.0).abs() < 0.2, "{count} of {wild}: {wild_alpha} {alpha}");
            }
        }
        // Both at once, and holes.
        let mut values = body_with(count, 1e30);
        (0..count).for_each(|at| values[at * 101 + 50] = -1e30);
        (0..9).for_each(|at| values[at * 103 + 7] = f32::NAN);
        let transfer = TransferFunction::from_histogram(&volume(values));
        assert!((surface(&transfer) - surface(&body)).abs() < 40.0, "{count}: {transfer:?}");
    }
}

/// Rare values that are no mistakes: beads in noise, and a tail of brightness such as that of labelled cells in tissue.
#[test]
fn rare_objects_stay() {
    let mut random = Random(7);
    // The sum of twelve numbers is nearly normal.
    let mut noise = || (0..12).map(|_| random.uniform(0.0, 10.0)).sum::<f64>();
    let beads = |at: usize| if at.is_multiple_of(250) { 4000.0 } else { noise() as f32 };
    let threshold = surface(&chosen((0..100_000).map(beads).collect()));
    assert!((1500.0..3000.0).contains(&threshold), "{threshold}");
    let mut random = Random(8);
    let mut uniform = || random.uniform(0.0, 1.0);
    let cells = |at: usize| match at % 200 {
        0 => 200.0 - 1200.0 * (1.0 - uniform()).ln() as f32,
        of if of.is_multiple_of(2) => 100.0 + 10.0 * uniform() as f32,
        _ => 200.0 + 10.0 * uniform() as f32,
    };
    let threshold = surface(&chosen((0..100_000).map(cells).collect()));
    assert!(threshold > 400.0, "{threshold}");
}

#[test]
#[ignore = "needs the shared data: SHEETSPLAT_SHARED=FOLDER"]
fn shared_volumes_have_surfaces() {
    let surfaces = [
        ("quarter-head", 400.0..700.0),
        ("ct-head", 400.0..700.0),
        ("mr-head", 20.0..60.0),
        ("beads-confocal", 8.0..20.0),
    ];
    for (name, expected) in surfaces {
        let path = shared(&format!("data/{name}.nrrd"));
        let threshold = surface(&TransferFunction::from_histogram(&Volume::open(&path).unwrap()));
        assert!(expected.contains(&threshold), "{name}: {threshold}");
    }
}

fn settings(table: &str) -> TransferSettings {
    let text = format!("[volume]\npath = 'a.nrrd'\n[transfer]\n{table}\n");
    Scene::parse(&text, "scene.toml", Path::new("folder"), &[]).unwrap().channels[0].transfer.clone()
}

#[test]
fn missing_tables_are_chosen() {
    let volume = volume(two_valued(0.0, 100.0, 100, 3));
    let chosen = TransferFunction::from_histogram(&volume);
    assert_eq!(TransferSettings::default().resolve(&volume), chosen);

    let transfer = settings("opacity = [[1, 0.5]]\niso_ranges = [[0, 2]]");
    let resolved = transfer.resolve(&volume);
    assert_eq!((resolved.color, resolved.opacity.at(0.0)), (chosen.color, 0.5));
    assert_eq!(resolved.iso_ranges, Some(vec![[0.0, 2.0]]));

    let transfer = settings("color = [[1, [1, 1, 1]]]");
    let resolved = transfer.resolve(&volume);
    assert_eq!((resolved.color.at(0.0), resolved.opacity), (DVec3::ONE, chosen.opacity));
}
