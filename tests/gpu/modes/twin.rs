//! Frames of random and of extremely thin volumes against the f64 evaluation; and refused settings.

use glam::DVec3;
use sheetsplat::RenderError;
use sheetsplat::cpu::CpuRenderer;
use sheetsplat::internals::reference::{self, Host};
use sheetsplat::internals::view_geometry::ViewGeometry;
use sheetsplat::scene::Scene;
use sheetsplat::settings::{Compositing, Method, Order};
use sheetsplat::volume::builtin;

use crate::common::cases::{cases, in_turns};
use crate::common::compare::assert_at_most;
use crate::common::devices::{DRAWINGS, gpu};
use crate::common::{BY_MEANS, Random, camera, scene, transfer};
use crate::modes::{COLOR, HostFrame, OUTLIERS, constant, draw_for_host, random_case, render, share_off, view_of};

/// The depths of a host's wall in front of a part of the image.
fn wall(view: &ViewGeometry) -> Vec<f64> {
    let middle = view.rays().depth_of(DVec3::ZERO);
    let depth = |at: u32| match (at % view.size[0]) * 4 / view.size[0] {
        0 => (middle - 2.3).max(0.05),
        1 => (middle + 3.1).max(0.05),
        _ => f64::INFINITY,
    };
    (0..view.size[0] * view.size[1]).map(depth).collect()
}

#[test]
fn any_view_equals_the_reference() {
    let gpu = gpu();
    let mut random = Random(2024);
    for compositing in BY_MEANS {
        let mut shown = 0;
        let mut off = [0.0; 3];
        let cases = cases(5, 16);
        for case in 0..cases {
            let (volume, mut scene) = random_case(&mut random);
            scene.splatting.compositing = compositing;
            let walls = random.bits().is_multiple_of(3);
            let first_hit = (compositing != Compositing::Minimum && case % 2 == 0).then(|| random.pick(&[0.05, 0.4]));
            if compositing != Compositing::Surface && first_hit.is_none() {
                scene.splatting.order = random.pick(&[Order::FrontToBack, Order::BackToFront]);
            }
            let depths = walls.then(|| wall(&view_of(&volume, &scene)));
            let host = Host { surfaces: depths.as_deref(), first_hit };
            let expected =
                reference::render_for(host, &volume, &[scene.channels[0].transfer.resolve(&volume)], &scene, None)
                    .unwrap();
            let background = expected.image.pixels.iter().filter(|pixel| {
                let [r, g, b, a] = scene.image.background;
                **pixel == [r * a, g * a, b * a, a].map(|channel| channel as f32)
            });
            shown += usize::from(background.count() + 100 < expected.image.pixels.len());
            for (drawing, off) in DRAWINGS.into_iter().zip(&mut off) {
                let host = (first_hit, depths.as_deref());
                let HostFrame { image, hits, .. } = draw_for_host(drawing, gpu, (&volume, &scene), host, &[]);
                // Quads round amounts to f16.
                let share = share_off(&image.pixels, &expected.image.pixels, 2e-3);
                *off += share / cases as f64;
                assert_at_most(share, 8.0 * OUTLIERS, format_args!("case {case}, {drawing:?}: pixels with {scene:?}"));
                assert_eq!(hits.len(), expected.first_hits.len());
                let is_close = |(hit, expected): &(&f64, &f64)| {
                    hit == expected || (**hit - **expected).abs() / expected.abs().max(10.0) <= 1e-3
                };
                let off = hits.len() - hits.iter().zip(&expected.first_hits).filter(is_close).count();
                assert!(
                    off <= hits.len() / 100,
                    "case {case}, {drawing:?}: {off} of {} hits with {scene:?}",
                    hits.len()
                );
            }
        }
        println!("{compositing:?}: {off:.5?} of the pixels are off by {DRAWINGS:?}");
        off.into_iter().for_each(|off| assert_at_most(off, OUTLIERS, format_args!("{compositing:?}: pixels")));
        assert!(shown >= cases / 3, "{compositing:?}: only {shown} cases show much");
    }
}

/// Volumes that are one voxel thick, or a single voxel, and views along their faces.
#[test]
fn thin_volumes() {
    let gpu = gpu();
    let views = [
        ([1, 9, 9], DVec3::X),
        ([1, 9, 9], DVec3::new(1.0, 0.4, 0.3)),
        ([9, 9, 1], DVec3::NEG_Z),
        ([9, 1, 9], DVec3::X),
        ([2, 9, 9], DVec3::X),
        ([1, 1, 1], DVec3::new(0.5, 0.7, -0.4)),
        ([4, 4, 4], DVec3::Y),
    ];
    for (number, (dims, direction)) in views.into_iter().enumerate() {
        for (compositing, method) in BY_MEANS.into_iter().enumerate().flat_map(|(turn, compositing)| {
            in_turns(turn + number, [Method::ImageAligned, Method::AxisAligned])
                .into_iter()
                .map(move |method| (compositing, method))
        }) {
            let (volume, mut scene) = constant(dims, DVec3::ONE);
            scene.channels[0].transfer = transfer(&[(0.0, COLOR)], &[(0.0, 0.9)]);
            scene.camera = camera(direction.to_array(), 3.0);
            scene.camera.up = DVec3::new(0.0, 0.6, 0.8);
            (scene.splatting.compositing, scene.splatting.method) = (compositing, method);
            (scene.splatting.radius, scene.splatting.falloff) = (2.0, 2.0);
            let expected = reference::render(&volume, &[scene.channels[0].transfer.resolve(&volume)], &scene).unwrap();
            for drawing in DRAWINGS {
                let image = render(drawing, gpu, &volume, &scene).0;
                let what = format!("{dims:?} {direction} {compositing:?} {method:?} {drawing:?}");
                let share = share_off(&image.pixels, &expected.pixels, 2e-3);
                assert_at_most(share, 2.0 * OUTLIERS, &what);
                let alpha = image.pixels[54 * 120 + 60][3];
                // Seen edge-on, a single layer of voxel centres covers no pixel.
                let may_be_nothing = compositing == Compositing::Surface || dims[1] == 1;
                assert!(may_be_nothing || alpha > 0.1, "{what}: {alpha}");
            }
        }
    }
}

#[test]
fn settings_that_exclude_each_other_are_refused() {
    let gpu = gpu();
    let volume = builtin::volume("head:24").unwrap();
    let refusal = |scene: &Scene, first_hit: Option<f64>| {
        let by_gpu = gpu.view(volume.clone(), scene).and_then(|mut view| {
            view.set_first_hit(first_hit)?;
            gpu.draw(&mut view)
        });
        let natively = CpuRenderer::new(volume.clone(), scene).and_then(|mut renderer| {
            renderer.set_first_hit(first_hit)?;
            renderer.draw()
        });
        let [by_gpu, natively] = [by_gpu, natively].map(|rendered| match rendered {
            Err(RenderError::OutOfRange(error)) => {
                assert_eq!(error.key, "splatting.compositing");
                error.to_string()
            }
            other => panic!("{:?}", other.map(|rendering| rendering.stats)),
        });
        assert_eq!(by_gpu, natively, "both name the same");
        by_gpu
    };
    let assert_words = |message: &str, words: &[&str]| {
        words.iter().for_each(|word| assert!(message.contains(word), "no {word:?} in {message}"));
    };
    for compositing in BY_MEANS {
        let mut scene = scene(20, 20);
        (scene.splatting.compositing, scene.splatting.method) = (compositing, Method::CompositeEverySample);
        let name = format!("\"{}\"", format!("{compositing:?}").to_lowercase());
        assert_words(&refusal(&scene, None), &[&name, "composite-every-sample", "\"linear\""]);
        assert!(reference::render(&volume, &[scene.channels[0].transfer.resolve(&volume)], &scene).is_err());
    }
    let mut scene = scene(20, 20);
    (scene.splatting.compositing, scene.splatting.order) = (Compositing::Surface, Order::BackToFront);
    assert_words(&refusal(&scene, None), &["\"surface\"", "back-to-front", "\"front-to-back\""]);
    assert!(reference::render(&volume, &[scene.channels[0].transfer.resolve(&volume)], &scene).is_err());
    scene.splatting.compositing = Compositing::Minimum;
    assert_words(&refusal(&scene, Some(0.5)), &["\"minimum\" with first hits"]);
}
