//! Images of random scenes compared with the f64 evaluation, pixels next to a decision left out and counted.

use sheetsplat::image::Image;
use sheetsplat::internals::reference;
use sheetsplat::scene::Scene;
use sheetsplat::settings::{Classification, Compositing, Gradient};

use super::compare::{decibels, root_mean_square};
use super::images::largest_difference;
use super::random_scene::Case;

/// How far a channel of the f64 evaluation jumps where a scene is moved by a hair and a decision changes.
const JUMP: f32 = 5e-3;

/// The most pixels that may be left out.
const LEFT_OUT: f64 = 1e-3;

/// The moved scenes that show whether a pixel lies next to a decision.
const TURNS: u64 = 6;

/// The difference that rounding in f32 sums may make.
const ROUNDING: f64 = 2e-5;

/// The number of comparisons, and the failures.
#[derive(Debug)]
pub(crate) struct Tally {
    compared: usize,
    shown: usize,
    pixels: usize,
    left_out: usize,
    worst: f64,
    failures: Vec<String>,
}

impl Tally {
    pub(crate) fn new() -> Self {
        Self { compared: 0, shown: 0, pixels: 0, left_out: 0, worst: f64::INFINITY, failures: Vec::new() }
    }

    /// Compares an image, drawn without culling, with the f64 evaluation's.
    pub(crate) fn compare(&mut self, case: &Case, (expected, actual): (&Image, &Image), required: f64, by: &str) {
        self.compared += 1;
        self.pixels += expected.pixels.len();
        if !shows(expected, case.scene.image.background) {
            // Hardly anything is there, so that decibels would say nothing.
            if largest_difference(expected, actual) > 0.02 {
                self.failures.push(format!("{by}: something where nothing is, {}", case.describe()));
            }
            return;
        }
        self.shown += 1;
        let errors: Vec<[f64; 4]> = expected.pixels.iter().zip(&actual.pixels).map(|(a, b)| error(*a, *b)).collect();
        let mut measured = decibels(root_mean_square(errors.iter().flatten().copied()));
        if measured < required {
            let undecided = undecided(case, expected);
            let left_out = undecided.iter().filter(|undecided| **undecided).count();
            self.left_out += left_out;
            if left_out < errors.len() {
                let decided = errors.iter().zip(&undecided).filter(|(_, undecided)| !**undecided);
                measured = decibels(root_mean_square(decided.flat_map(|(error, _)| error).copied()));
            }
        }
        if measured < required {
            let largest = errors.iter().enumerate().max_by(|a, b| size(a.1).total_cmp(&size(b.1))).unwrap();
            self.failures.push(format!(
                "{by}: {measured:.1} dB, required {required}; pixel {} is off by {:.2e}; {}",
                largest.0,
                size(largest.1),
                case.describe()
            ));
        }
        self.worst = self.worst.min(measured - required);
    }

    /// Compares an image drawn with culling with the one without (SPEC §6).
    pub(crate) fn compare_culled(&mut self, case: &Case, (whole, culled): (&Image, &Image), by: &str) {
        let compositing = case.scene.splatting.compositing;
        let is_gradual = matches!(compositing, Compositing::Linear | Compositing::Exponential);
        let allowed = if is_gradual { 1.0 - case.scene.splatting.opacity_threshold } else { 0.0 } + ROUNDING;
        let measured = largest_difference(whole, culled);
        if measured > allowed {
            let text = format!("{by}: culling changes {measured}, allowed {allowed}; {}", case.describe());
            self.failures.push(text);
        }
    }

    /// Fails if a comparison did, if too many pixels were left out, or if too few scenes show anything.
    pub(crate) fn finish(self) {
        let Self { compared, shown, pixels, left_out, worst, failures } = self;
        println!(
            "{shown} of {compared} images show something, {left_out} of {pixels} pixels left out, worst {worst:+.1} dB"
        );
        assert!(failures.is_empty(), "{} failures:\n{}", failures.len(), failures.join("\n\n"));
        assert!(left_out as f64 <= LEFT_OUT * pixels as f64, "{left_out} of {pixels} pixels are left out");
        assert!(shown * 2 >= compared, "only {shown} of {compared} images show something");
    }
}

/// The dB that SPEC §12 asks of the native backend.
pub(crate) fn required(scene: &Scene) -> f64 {
    match (scene.splatting.classification, scene.shading.gradient) {
        (Classification::After, Gradient::Kernel) => 55.0,
        (Classification::After, _) => 60.0,
        _ => 80.0,
    }
}

/// The f64 evaluation of a case, without culling.
pub(crate) fn evaluate(case: &Case) -> Image {
    let transfer = case.scene.resolve(&case.volume);
    reference::render(&case.volume, &transfer, &case.scene)
        .unwrap_or_else(|error| panic!("{error}: {}", case.describe()))
}

/// The pixels that jump when the scene is moved by a hair.
fn undecided(case: &Case, expected: &Image) -> Vec<bool> {
    let mut undecided = vec![false; expected.pixels.len()];
    for turn in 0..TURNS {
        let moved = evaluate(&case.moved(turn));
        for ((undecided, a), b) in undecided.iter_mut().zip(&expected.pixels).zip(&moved.pixels) {
            *undecided |= a.iter().zip(b).any(|(a, b)| (a - b).abs() > JUMP);
        }
    }
    undecided
}

/// Whether a twentieth of the pixels differ from the background, and some pixels from others.
fn shows(image: &Image, [r, g, b, a]: [f64; 4]) -> bool {
    let background = [r * a, g * a, b * a, a].map(|channel| channel as f32);
    let apart = |a: &[f32; 4], b: &[f32; 4]| a.iter().zip(b).any(|(a, b)| (a - b).abs() > 0.02);
    let pixels = || image.pixels.iter();
    let shown = pixels().filter(|pixel| apart(pixel, &background)).count();
    shown * 20 >= image.pixels.len() && pixels().any(|pixel| apart(pixel, &image.pixels[image.pixels.len() / 2]))
}

fn error(a: [f32; 4], b: [f32; 4]) -> [f64; 4] {
    std::array::from_fn(|channel| f64::from(a[channel]) - f64::from(b[channel]))
}

fn size(error: &[f64; 4]) -> f64 {
    error.iter().fold(0.0, |largest: f64, channel| largest.max(channel.abs()))
}
