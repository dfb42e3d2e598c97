//! The signal of Marschner and Lobb, "An Evaluation of Reconstruction Filters for Volume Rendering" (Visualization 1994): a volume of it, and exact
//! pictures of its surface at half of its range, with which pictures of the volume are compared.

use std::f64::consts::{PI, TAU};
use std::fs;
use std::io;
use std::path::Path;

use glam::{DMat3, DVec2, DVec3};

/// The signal's frequency, and the amplitude of its ripples.
const FREQUENCY: f64 = 6.0;
const AMPLITUDE: f64 = 0.25;

/// Samples along each axis of the volume, which spans -1 to 1.
const SAMPLES: usize = 41;
/// Grid steps from the volume's centre to its side.
const HALF: f64 = (SAMPLES - 1) as f64 / 2.0;

/// Pixels along each side of a picture, and the world units that they show.
const PIXELS: usize = 512;
const HEIGHT: f64 = 36.0;
/// Rays along each side of a pixel.
const RAYS: usize = 3;

/// The step in grid units with which a ray looks for the surface, before bisection finds it.
const STEP: f64 = 0.05;

const COLOR: DVec3 = DVec3::new(0.9, 0.8, 0.6);
const AMBIENT: f64 = 0.15;
const DIFFUSE: f64 = 0.85;

fn signal(at: DVec3) -> f64 {
    let ripples = (TAU * FREQUENCY * (PI * at.truncate().length() / 2.0).cos()).cos();
    (1.0 - (PI * at.z / 2.0).sin() + AMPLITUDE * (1.0 + ripples)) / (2.0 * (1.0 + AMPLITUDE))
}

fn gradient(at: DVec3) -> DVec3 {
    let radius = at.truncate().length().max(1e-12);
    let inner = TAU * FREQUENCY * (PI * radius / 2.0).cos();
    let by_radius = AMPLITUDE * inner.sin() * TAU * FREQUENCY * (PI * radius / 2.0).sin() * PI / 2.0;
    let along_z = -PI / 2.0 * (PI * at.z / 2.0).cos();
    (at.truncate() * by_radius / radius).extend(along_z) / (2.0 * (1.0 + AMPLITUDE))
}

/// Writes the volume as 8-bit NRRD, and a scene that sees its surface from a direction by diffuse light alone.
///
/// # Errors
/// If a file cannot be written.
pub(crate) fn write(folder: &Path, direction: DVec3) -> io::Result<()> {
    let place = |index: usize| 2.0 * index as f64 / (SAMPLES - 1) as f64 - 1.0;
    let mut file = format!(
        "NRRD0005\ntype: uint8\ndimension: 3\nsizes: {SAMPLES} {SAMPLES} {SAMPLES}\nspacings: 1 1 1\nencoding: raw\n\n"
    )
    .into_bytes();
    for z in 0..SAMPLES {
        for y in 0..SAMPLES {
            for x in 0..SAMPLES {
                file.push((signal(DVec3::new(place(x), place(y), place(z))) * 255.0).round() as u8);
            }
        }
    }
    fs::write(folder.join("signal.nrrd"), file)?;
    let scene = format!(
        "[volume]\npath = \"signal.nrrd\"\n\
         [camera]\ndirection = {:?}\nup = [0, 0, 1]\nheight = {HEIGHT}\n\
         [image]\nwidth = {PIXELS}\nheight = {PIXELS}\nbackground = [0, 0, 0, 1]\n\
         [transfer]\ncolor = [[0, {:?}]]\nopacity = [[124.0, 0.0], [131.0, 1.0]]\n\
         [shading]\nenabled = true\nambient = {AMBIENT}\ndiffuse = {DIFFUSE}\nspecular = 0.0\nshininess = 10\n\
         [splatting]\ncompositing = \"exponential\"\n",
        direction.to_array(),
        COLOR.to_array(),
    );
    fs::write(folder.join("scene.toml"), scene)
}

/// The exact picture, and the pixels that count: those whose rays all meet the surface inside the volume, not its cut at the volume's sides.
pub(crate) struct Truth {
    pixels: Vec<Option<DVec3>>,
}

impl Truth {
    /// The surface as it is seen along a direction, with 3×3 rays per pixel.
    pub(crate) fn new(direction: DVec3) -> Self {
        let ahead = direction.normalize();
        let right = ahead.cross(DVec3::Z).normalize();
        let axes = DMat3::from_cols(right, right.cross(ahead), ahead);
        let mut pixels = vec![None; PIXELS * PIXELS];
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        let rows = PIXELS.div_ceil(threads);
        std::thread::scope(|scope| {
            for (thread, chunk) in pixels.chunks_mut(rows * PIXELS).enumerate() {
                scope.spawn(move || {
                    for (at, pixel) in chunk.iter_mut().enumerate() {
                        *pixel = mean_of_rays(&axes, at % PIXELS, thread * rows + at / PIXELS);
                    }
                });
            }
        });
        Self { pixels }
    }

    /// The peak signal-to-noise ratio of a picture's colours in dB, over the pixels that count.
    pub(crate) fn psnr(&self, picture: impl ExactSizeIterator<Item = [f32; 3]>) -> f64 {
        assert_eq!(picture.len(), self.pixels.len());
        let differences = self.pixels.iter().zip(picture).filter_map(|(truth, color)| {
            let difference = (*truth)? - DVec3::from(color.map(f64::from));
            assert!(difference.is_finite());
            Some(difference.length_squared() / 3.0)
        });
        let squares: Vec<f64> = differences.collect();
        assert!(squares.len() > PIXELS * PIXELS / 10, "{} pixels see the surface", squares.len());
        10.0 * (squares.len() as f64 / squares.iter().sum::<f64>()).log10()
    }
}

fn mean_of_rays(axes: &DMat3, x: usize, y: usize) -> Option<DVec3> {
    let mut sum = DVec3::ZERO;
    for ray in 0..RAYS * RAYS {
        let within = (DVec2::new((ray % RAYS) as f64, (ray / RAYS) as f64) + 0.5) / RAYS as f64;
        let px = DVec2::new(x as f64, y as f64) + within - PIXELS as f64 / 2.0;
        let world = px * DVec2::new(1.0, -1.0) * (HEIGHT / PIXELS as f64);
        sum += color_along(axes.x_axis * world.x + axes.y_axis * world.y, axes.z_axis)?;
    }
    Some(sum / (RAYS * RAYS) as f64)
}

/// The surface's colour along a ray in grid units from the volume's centre; `None` where the ray misses it or meets a cut first.
fn color_along(origin: DVec3, ahead: DVec3) -> Option<DVec3> {
    let [near, far] = [-1.0, 1.0].map(|side| (side * HALF * ahead.signum() - origin) / ahead);
    let (enter, leave) = (near.max_element(), far.min_element());
    let at = |depth: f64| (origin + ahead * depth) / HALF;
    let is_inside = |depth: f64| signal(at(depth)) >= 0.5;
    if enter >= leave || is_inside(enter) {
        return None;
    }
    let steps = ((leave - enter) / STEP) as usize;
    let last = (1..=steps).map(|step| enter + step as f64 * STEP).find(|&depth| is_inside(depth))?;
    let (mut outside, mut inside) = (last - STEP, last);
    for _ in 0..30 {
        let middle = 0.5 * (outside + inside);
        if is_inside(middle) { inside = middle } else { outside = middle }
    }
    let normal = gradient(at(inside)).normalize();
    Some(COLOR * (AMBIENT + DIFFUSE * normal.dot(ahead).abs()))
}
