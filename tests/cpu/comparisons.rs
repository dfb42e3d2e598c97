//! The comparisons that other tests rely on fail when they must: for NaN, for a black image, and for an image that is one pixel off.

use std::panic::{UnwindSafe, catch_unwind};

use glam::{DVec3, DVec4};
use sheetsplat::image::Image;
use sheetsplat::internals::reference;
use sheetsplat::volume::builtin;

use crate::common::compare::{apart, assert_at_least, assert_at_most, decibels, largest, root_mean_square};
use crate::common::images::{BLACK, color_rms, largest_difference, psnr, rms};
use crate::common::{scene, transfer};

/// The lowest PSNR in dB that any test requires of two renderings with the same slabs, and the largest difference of a channel that any test
/// allows.
const WEAKEST: (f64, f64) = (34.0, 0.05);

/// A translucent, shaded head by the f64 evaluation.
fn head() -> Image {
    let volume = builtin::volume("head:32").unwrap();
    let mut scene = scene(96, 80);
    scene.camera.direction = DVec3::new(0.4, 0.9, -0.3);
    scene.channels[0].transfer =
        transfer(&[(40.0, [0.9, 0.6, 0.4]), (255.0, [1.0, 1.0, 0.9])], &[(30.0, 0.0), (120.0, 0.3)]);
    reference::render(&volume, &[scene.channels[0].transfer.resolve(&volume)], &scene).unwrap()
}

fn filled(value: f32) -> Image {
    Image { pixels: vec![[value; 4]; head().pixels.len()], ..head() }
}

/// The head with one channel of one pixel replaced.
fn with_one(value: f32) -> Image {
    let mut image = head();
    image.pixels[96 * 40 + 48][1] = value;
    image
}

/// The head one pixel farther to the right or down.
fn shifted(by: usize) -> Image {
    let mut image = head();
    image.pixels.rotate_right(by);
    image
}

fn fails<T>(what: &str, compare: impl FnOnce() -> T + UnwindSafe) {
    assert!(catch_unwind(compare).is_err(), "{what} passes");
}

#[test]
fn numbers_that_are_not_finite_are_never_close() {
    for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for broken in [filled(value), with_one(value)] {
            for (actual, expected) in [(broken.clone(), head()), (head(), broken.clone()), (broken.clone(), broken)] {
                type Measure = fn(&Image, &Image) -> f64;
                let measures: [(&str, Measure); 4] = [
                    ("the largest difference", largest_difference),
                    ("the root of the mean square", rms),
                    ("that of the colours", color_rms),
                    ("the PSNR", |a, b| psnr(&a.pixels, &b.pixels, BLACK, 0)),
                ];
                for (name, measure) in measures {
                    let (actual, expected) = (actual.clone(), expected.clone());
                    fails(&format!("{name} of {value}"), move || measure(&actual, &expected));
                }
            }
        }
        let value = f64::from(value);
        fails("largest", move || largest([0.0, value, 1.0]));
        fails("root_mean_square", move || root_mean_square([0.0, value, 1.0]));
        for at in 0..4 {
            let mut pixel = DVec4::ZERO;
            pixel[at] = value;
            fails("apart", move || apart(pixel, DVec4::ONE));
            fails("apart", move || apart(DVec4::ONE, pixel));
        }
        fails("assert_at_most", move || assert_at_most(value, 1.0, ""));
        fails("what is allowed", move || assert_at_most(0.0, value, ""));
        fails("what is required", move || assert_at_least(0.0, value, ""));
    }
    fails("a PSNR of NaN", || assert_at_least(f64::NAN, 1.0, ""));
    fails("nothing", || root_mean_square([]));
}

#[test]
fn bounds_are_kept_to_the_last_bit() {
    assert_at_least(1.0, 1.0, "");
    assert_at_least(f64::INFINITY, 1.0, "equal images");
    assert_at_most(1.0, 1.0, "");
    fails("less", || assert_at_least(1.0_f64.next_down(), 1.0, ""));
    fails("more", || assert_at_most(1.0_f64.next_up(), 1.0, ""));
    assert_eq!(largest([0.5, -2.0, 1.0]), 2.0);
    assert_eq!(root_mean_square([3.0, -3.0]), 3.0);
    assert_eq!(decibels(0.01), 40.0);
}

#[test]
fn a_black_and_a_shifted_image_pass_no_test() {
    let (least, most) = WEAKEST;
    let head = head();
    assert_at_least(psnr(&head.pixels, &head.pixels, BLACK, 500), least, "the same image");
    let black = Image { pixels: vec![BLACK; head.pixels.len()], ..head };
    let head = self::head();
    for (name, image) in
        [("black", black), ("transparent", filled(0.0)), ("to the right", shifted(1)), ("down", shifted(96))]
    {
        let decibels = psnr(&image.pixels, &head.pixels, BLACK, 500);
        let difference = largest_difference(&image, &head);
        println!("{name}: {decibels:.1} dB, {difference:.3}");
        fails(name, || assert_at_least(decibels, least, ""));
        fails(name, || assert_at_most(difference, most, ""));
    }
    // Empty images are not compared where something must be visible.
    let nothing = [BLACK; 100];
    assert_eq!(psnr(&nothing, &nothing, BLACK, 0), f64::INFINITY);
    fails("nothing", move || psnr(&nothing, &nothing, BLACK, 1));
    fails("other sizes", move || psnr(&nothing, &nothing[1..], BLACK, 0));
}
