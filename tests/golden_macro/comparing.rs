//! The counts of a comparison.

use sheetsplat::golden::{Comparison, ComparisonError, LaxTolerance};

use super::*;

/// An image of 8-bit pixels with straight alpha, premultiplied.
fn image(width: u32, pixels: &[[u8; 4]]) -> Image {
    let premultiplied = |pixel: &[u8; 4]| {
        let [r, g, b, a] = pixel.map(|channel| f32::from(channel) / 255.0);
        [r * a, g * a, b * a, a]
    };
    Image { width, height: pixels.len() as u32 / width, pixels: pixels.iter().map(premultiplied).collect() }
}

fn compare(actual: &Image, golden: &Image) -> Comparison {
    Comparison::new(actual, golden, Tolerance::default()).unwrap()
}

#[test]
fn differences_are_counted() {
    let golden = image(40, &[[100, 100, 100, 255]; 2000]);
    let mut pixels = [[100, 100, 100, 255]; 2000];
    pixels[4 * 40 + 3] = [103, 97, 100, 255];
    let within = compare(&image(40, &pixels), &golden);
    assert_eq!((within.max, within.worst, within.outliers, within.passes()), ([3, 3, 0, 0], [3, 4], 0, true));
    pixels[6 * 40 + 5] = [100, 100, 104, 255];
    pixels[8 * 40 + 7] = [40, 100, 100, 255];
    let beyond = compare(&image(40, &pixels), &golden);
    assert_eq!((beyond.max, beyond.worst, beyond.outliers, beyond.passes()), ([60, 3, 4, 0], [7, 8], 2, false));
    assert!((beyond.mean - (3.0 + 3.0 + 4.0 + 60.0) / 3.0 / 2000.0).abs() < 1e-12);
    let mean_square: f64 = (9.0 + 9.0 + 16.0 + 3600.0) / 3.0 / 2000.0;
    assert!((beyond.psnr_db - 20.0 * (255.0 / mean_square.sqrt()).log10()).abs() < 1e-9);
    let sweep = Comparison::SWEEP.map(|threshold| beyond.beyond(threshold));
    assert_eq!((Comparison::SWEEP, sweep), ([0, 1, 2, 3, 5, 10, 20, 50, 100], [3, 3, 3, 2, 1, 1, 1, 1, 0]));

    let report = beyond.to_string();
    for words in [
        "2 of 40×50 pixels (0.100 %) differ by more than 3 of 255, allowed: 0.000 %",
        "red 60, green 3, blue 4, alpha 0; worst at x 7, y 8",
        &format!("{:.4}", beyond.mean),
        &format!("{:.2} dB", beyond.psnr_db),
        "      2:         3 (0.150 %)",
        "    100:         0 (0.000 %)",
    ] {
        assert!(report.contains(words), "no {words:?} in\n{report}");
    }
}

#[test]
fn outliers_are_allowed_up_to_their_share() {
    for (share, pixels) in [(0.0, 0), (0.001, 2), (0.0035, 7), (0.01, 20)] {
        let tolerance = Tolerance::new(0, share).unwrap();
        let golden = image(40, &[[9, 9, 9, 255]; 2000]);
        for (outliers, passes) in [(pixels, true), (pixels + 1, false)] {
            let mut actual = golden.clone();
            actual.pixels[..outliers].fill([1.0; 4]);
            assert_eq!(Comparison::new(&actual, &golden, tolerance).unwrap().passes(), passes, "{share} {outliers}");
        }
    }
}

/// The colour of a transparent pixel does not count.
#[test]
fn invisible_colour_does_not_count() {
    let transparent = image(2, &[[255, 0, 0, 0], [0, 255, 0, 0]]);
    assert_eq!(compare(&transparent, &image(2, &[[0, 0, 255, 0], [0; 4]])).max, [0; 4]);
    let faint = compare(&image(1, &[[255, 255, 255, 2]]), &image(1, &[[0, 0, 0, 2]]));
    assert_eq!((faint.max, faint.passes()), ([2, 2, 2, 0], true));
    let clear = compare(&image(1, &[[255, 0, 0, 128]]), &image(1, &[[0, 0, 0, 128]]));
    assert_eq!((clear.max, clear.passes()), ([128, 0, 0, 0], false));
    let alpha = compare(&image(1, &[[0, 0, 0, 255]]), &image(1, &[[0, 0, 0, 155]]));
    assert_eq!((alpha.max, alpha.mean), ([0, 0, 0, 100], 25.0), "alpha is one of four channels where there is any");
}

#[test]
fn lax_tolerances_are_refused() {
    for (per_channel, outliers) in [(0, 0.0), (3, 0.001), (16, 0.01)] {
        let tolerance = Tolerance::new(per_channel, outliers).unwrap();
        assert_eq!((tolerance.per_channel(), tolerance.outliers()), (per_channel, outliers));
    }
    assert_eq!(Tolerance::new(16, 0.01).unwrap(), Tolerance::WIDEST);
    assert_eq!(Tolerance::new(3, 0.0).unwrap(), Tolerance::default());
    for (per_channel, outliers, words) in [
        (17, 0.0, ["per channel", "17", "0 to 16"]),
        (255, 0.0, ["per channel", "255", "0 to 16"]),
        (3, 0.0101, ["outliers", "0.0101", "0 to 0.01"]),
        (3, -0.001, ["outliers", "-0.001", "0 to 0.01"]),
        (3, f64::NAN, ["outliers", "NaN", "0 to 0.01"]),
    ] {
        let error: LaxTolerance = Tolerance::new(per_channel, outliers).unwrap_err();
        assert!(words.iter().all(|word| error.to_string().contains(word)), "{error}");
    }
}

#[test]
fn images_that_cannot_be_compared_are_an_error() {
    let golden = gradient();
    let compare = |actual: &Image, golden: &Image| Comparison::new(actual, golden, Tolerance::default()).unwrap_err();
    let turned = Image { width: 10, height: 20, ..gradient() };
    let size = ComparisonError::Size { actual: [10, 20], golden: [20, 10] };
    assert_eq!(compare(&turned, &golden), size);
    let mut infinite = gradient();
    infinite.pixels[0][3] = f32::INFINITY;
    let which = |error| match error {
        ComparisonError::NotFinite { which, .. } | ComparisonError::Pixels { which, .. } => which,
        other => panic!("{other}"),
    };
    let missing = Image { pixels: Vec::new(), ..gradient() };
    for broken in [infinite, missing] {
        assert_eq!(which(compare(&broken, &golden)), "actual");
        assert_eq!(which(compare(&golden, &broken)), "golden");
    }
}
