//! Compositing by means (`settings::Compositing`), by sheets and by slices, with first hits and a host's surfaces, against the twin.

use glam::DVec3;
use sheetsplat::cpu::CpuRenderer;
use sheetsplat::internals::reference::{self, Host};
use sheetsplat::scene::Scene;
use sheetsplat::settings::{Compositing, Method, Order, Ramp};
use sheetsplat::volume::Volume;

use crate::common::compare::assert_at_most;
use crate::common::{BY_MEANS, COMPOSITINGS, Random, transfer};
use crate::native::{head, psnr, random_case, shown, surfaces, twin};

/// Where an opacity, a slab's middle or a ray is on an edge, rounding may decide otherwise: in this share of the pixels.
pub(crate) const OUTLIERS: f64 = 0.0005;

/// What channels may differ by elsewhere.
const TOLERANCE: f32 = 1e-4;

/// The share of pixels with a channel that differs by more than the tolerance.
pub(crate) fn share_off(a: &[[f32; 4]], b: &[[f32; 4]]) -> f64 {
    assert_eq!(a.len(), b.len());
    // NaN is close to nothing.
    let is_close = |(a, b): (&f32, &f32)| (a - b).abs() <= TOLERANCE;
    let is_off = |(a, b): &(&[f32; 4], &[f32; 4])| !a.iter().zip(*b).all(is_close);
    a.iter().zip(b).filter(is_off).count() as f64 / a.len() as f64
}

/// A random view whose transfer function leaves gaps, with sheets.
fn random_sheets(random: &mut Random) -> (Volume, Scene) {
    let (volume, mut scene) = random_case(random);
    let (haze, solid) = (random.pick(&[0.0, 0.02, 0.3]), random.pick(&[0.3, 0.9, 1.0]));
    scene.channels[0].transfer =
        transfer(&[(0.0, [0.2, 0.5, 1.0]), (200.0, [1.0, 0.9, 0.8])], &[(10.0, 0.0), (20.0, haze), (200.0, solid)]);
    if random.bits().is_multiple_of(4) {
        scene.channels[0].transfer.gradient_opacity = Some(Ramp::new(vec![(0.0, 0.2), (60.0, 1.0)]).unwrap());
    }
    scene.splatting.method = random.pick(&[Method::ImageAligned, Method::ImageAligned, Method::AxisAligned]);
    scene.splatting.slab_width = random.pick(&[0.5, 1.0, 2.0, 3.0]);
    scene.splatting.radius = random.pick(&[1.4, 2.0, 2.7]);
    scene.splatting.falloff = 2.0;
    scene.splatting.culling = false;
    (volume, scene)
}

#[test]
fn any_view_is_that_of_the_twin() {
    const CASES: usize = 14;
    let mut random = Random(2024);
    for compositing in COMPOSITINGS {
        let (mut shows, mut off, mut hits_off, mut hits_seen) = (0, 0.0, 0, 0);
        for case in 0..CASES {
            let (volume, mut scene) = random_sheets(&mut random);
            scene.splatting.compositing = compositing;
            let first_hit = (compositing != Compositing::Minimum && case % 2 == 0).then(|| random.pick(&[0.05, 0.4]));
            if compositing == Compositing::Surface || first_hit.is_some() {
                scene.splatting.order = Order::FrontToBack;
            }
            let surfaces = (case % 3 == 0).then(|| surfaces::depths(&mut random, &volume, &scene));
            let unit = volume.grid().unit();
            let in_units =
                surfaces.as_ref().map(|depths| depths.iter().map(|&depth| f64::from(depth) / unit).collect());
            let in_units: Option<Vec<f64>> = in_units;
            let host = Host { first_hit, surfaces: in_units.as_deref() };
            let expected =
                reference::render_for(host, &volume, &[scene.channels[0].transfer.resolve(&volume)], &scene, None)
                    .unwrap();
            shows += usize::from(shown(&expected.image) > 0.1);
            let mut renderer = CpuRenderer::new(volume.clone(), &scene).unwrap();
            renderer.set_surfaces(surfaces).unwrap();
            renderer.set_first_hit(first_hit).unwrap();
            let image = renderer.draw().unwrap().image;
            let share = share_off(&image.pixels, &expected.image.pixels);
            assert_at_most(share, 8.0 * OUTLIERS, format_args!("case {case}: pixels with {scene:?}"));
            off += share / CASES as f64;
            let hits = renderer.first_hits().unwrap_or_default().iter().map(|depth| f64::from(*depth) / unit);
            assert_eq!(hits.len(), expected.first_hits.len(), "case {case}");
            for (hit, expected) in hits.zip(&expected.first_hits) {
                hits_seen += usize::from(expected.is_finite());
                let is_close = hit == *expected || (hit - expected).abs() / expected.abs().max(10.0) <= 1e-3;
                hits_off += usize::from(!is_close);
            }
        }
        println!("{compositing:?}: {off:.5} of the pixels are off; {hits_off} of {hits_seen} hits");
        assert_at_most(off, OUTLIERS, format_args!("{compositing:?}: pixels"));
        assert!(shows >= CASES / 3, "{compositing:?}: only {shows} cases show much");
        if compositing != Compositing::Minimum {
            // An average is rarely half opaque.
            assert!(hits_seen > 200, "{compositing:?}: only {hits_seen} hits");
            assert!(hits_off <= hits_seen / 500, "{compositing:?}: {hits_off} of {hits_seen} hits");
        }
    }
}

/// Where nothing is on an edge, the modes are as exact as the others.
#[test]
fn a_head_by_means() {
    let (volume, plain) = head();
    for (compositing, order) in
        BY_MEANS.into_iter().flat_map(|mode| [Order::FrontToBack, Order::BackToFront].map(|order| (mode, order)))
    {
        if compositing == Compositing::Surface && order == Order::BackToFront {
            continue;
        }
        let mut scene = plain.clone();
        (scene.splatting.compositing, scene.splatting.order) = (compositing, order);
        // Something everywhere, for the minimum, and enough of it for a surface.
        scene.channels[0].transfer.opacity = Some(Ramp::new(vec![(0.0, 0.1), (200.0, 0.9)]).unwrap());
        let expected = twin(&volume, &scene);
        assert!(shown(&expected) > 0.05, "{compositing:?} shows nothing");
        let psnr = psnr(&crate::native::draw(&volume, &scene).image, &expected);
        println!("{compositing:?}, {order:?}: {psnr:.1} dB");
        assert!(psnr > 80.0, "{compositing:?}, {order:?}: {psnr} dB");
    }
}

/// Behind a surface everything is culled, and nothing changes; nothing else culls.
#[test]
fn surfaces_cull_and_the_others_do_not() {
    let (volume, mut scene) = head();
    scene.camera.direction = DVec3::new(0.4, 0.8, -0.3);
    scene.channels[0].transfer.opacity = Some(Ramp::new(vec![(30.0, 0.0), (60.0, 1.0)]).unwrap());
    // Below what a surface that is not reached keeps.
    scene.splatting.opacity_threshold = 0.2;
    for compositing in BY_MEANS {
        scene.splatting.compositing = compositing;
        let [with, without] = [true, false].map(|culling| {
            scene.splatting.culling = culling;
            crate::native::draw(&volume, &scene)
        });
        assert_eq!(with.image, without.image, "{compositing:?}");
        let [with, without] = [with, without].map(|drawn| drawn.stats.counts.sections_rasterized);
        match compositing {
            Compositing::Surface => assert!(with < without * 4 / 5, "{with} of {without}"),
            _ => assert_eq!(with, without, "{compositing:?}"),
        }
    }
}
