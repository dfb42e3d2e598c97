//! Targets of every kind hold the image of headless rendering, as exactly as they can.

use sheetsplat::{Blend, RendererOptions};
use wgpu::TextureFormat;

use crate::compare::assert_at_most;
use crate::{F16, Host, OPAQUE, f16, headless, pixels, scene};

/// A half-transparent background, so that every pixel's colour is premultiplied by another alpha.
const TINTED: &str = "[0.9, 0.4, 0.1, 0.5]";

fn replacing(format: TextureFormat) -> RendererOptions {
    RendererOptions::for_target(format).with_blend(Blend::Replace)
}

fn render(host: &Host, options: RendererOptions, background: &str) -> Vec<u8> {
    let renderer = host.renderer(options);
    host.render(&renderer, options.target_format, &mut host.view(&scene(background)))
}

/// The error of lavapipe's sRGB encoding in steps of a byte.
const SRGB_STEPS: f64 = 0.7;

/// sRGB's curve.
fn decode(color: f64) -> f64 {
    if color <= 0.04045 { color / 12.92 } else { ((color + 0.055) / 1.055).powf(2.4) }
}

fn linear([r, g, b, a]: [f32; 4]) -> [f64; 4] {
    let alpha = f64::from(a);
    let decode = |channel: f32| decode(f64::from(channel) / alpha) * alpha;
    if a == 0.0 { [0.0; 4] } else { [decode(r), decode(g), decode(b), alpha] }
}

#[test]
fn f32_targets_hold_the_same_bytes() {
    let host = Host::new();
    for background in [OPAQUE, TINTED] {
        let expected = headless(&scene(background));
        let actual = render(&host, replacing(TextureFormat::Rgba32Float), background);
        assert!(pixels(&actual) == expected, "{background}");
        let alphas = expected.iter().filter(|pixel| pixel[3] > 0.6 && pixel[3] < 1.0).count();
        assert_eq!(alphas > 1000, background == TINTED, "{alphas} pixels of the head over {background}");
    }
}

#[test]
fn unorm_targets_round() {
    let host = Host::new();
    for (format, order) in [(TextureFormat::Rgba8Unorm, [0, 1, 2, 3]), (TextureFormat::Bgra8Unorm, [2, 1, 0, 3])] {
        let expected = headless(&scene(TINTED));
        let actual = render(&host, replacing(format), TINTED);
        for (actual, expected) in actual.as_chunks::<4>().0.iter().zip(&expected) {
            for (at, channel) in order.into_iter().enumerate() {
                let exact = f64::from(expected[channel]).min(1.0) * 255.0;
                let error = (f64::from(actual[at]) - exact).abs();
                assert_at_most(error, 0.501, format_args!("{format:?}: {actual:?}, not {expected:?}"));
            }
        }
    }
}

#[test]
fn f16_targets_round() {
    let host = Host::new();
    let expected = headless(&scene(TINTED));
    for is_linear in [false, true] {
        let options = replacing(TextureFormat::Rgba16Float).with_linear(is_linear);
        let actual: Vec<[u16; 4]> = bytemuck::pod_collect_to_vec(&render(&host, options, TINTED));
        for (actual, &expected) in actual.iter().zip(&expected) {
            let expected = if is_linear { linear(expected) } else { expected.map(f64::from) };
            for (actual, expected) in actual.map(f16).into_iter().zip(expected) {
                // Plus the error of a power in f32.
                let allowed = expected * (F16 + 1e-5) + 1e-7;
                let what = format_args!("linear {is_linear}: {actual}, not {expected}");
                assert_at_most((actual - expected).abs(), allowed, what);
            }
        }
    }
}

/// Opaque pixels look the same in targets that hold linear light.
#[test]
fn srgb_targets_show_the_same_bytes() {
    let host = Host::new();
    for (format, order) in
        [(TextureFormat::Rgba8UnormSrgb, [0, 1, 2, 3]), (TextureFormat::Bgra8UnormSrgb, [2, 1, 0, 3])]
    {
        let expected = headless(&scene(OPAQUE));
        let actual = render(&host, replacing(format), OPAQUE);
        for (actual, expected) in actual.as_chunks::<4>().0.iter().zip(&expected) {
            for (at, channel) in order.into_iter().enumerate() {
                let exact = f64::from(expected[channel]).min(1.0) * 255.0;
                let error = (f64::from(actual[at]) - exact).abs();
                assert_at_most(error, SRGB_STEPS, format_args!("{format:?}: {actual:?}, not {expected:?}"));
            }
        }
    }
}

/// Translucent pixels are decoded before they are multiplied by alpha, as sRGB blending requires.
#[test]
fn srgb_targets_hold_premultiplied_light() {
    let host = Host::new();
    let expected = headless(&scene(TINTED));
    let actual = render(&host, replacing(TextureFormat::Rgba8UnormSrgb), TINTED);
    for (actual, expected) in actual.as_chunks::<4>().0.iter().zip(&expected) {
        for (channel, (&actual, light)) in actual.iter().zip(linear(*expected)).enumerate() {
            let code = f64::from(actual) / 255.0;
            let half = SRGB_STEPS / 255.0;
            let (low, high) = match channel {
                3 => (code - half, code + half),
                _ => (decode((code - half).max(0.0)), decode(code + half)),
            };
            assert!((low - 1e-5..=high + 1e-5).contains(&light), "channel {channel}: {code}, but light {light}");
        }
    }
}
