//! Measurements of images for captions and tables.

use std::sync::Arc;

use glam::{DVec3, UVec3, dvec3};
use sheetsplat::headless::GpuHeadless;
use sheetsplat::image::Image;
use sheetsplat::internals::reference;
use sheetsplat::scene::Scene;
use sheetsplat::settings::Method;
use sheetsplat::volume::Volume;

use crate::scenes::{open, turned};

/// Image-aligned and axis-aligned.
pub(crate) const METHODS: [Method; 2] = [Method::ImageAligned, Method::AxisAligned];

/// PSNR and largest difference of premultiplied RGBA with peak 1, over the pixels where either image differs from black.
pub(crate) fn difference(actual: &Image, expected: &Image) -> (f64, f64) {
    const BLACK: [f32; 4] = [0.0, 0.0, 0.0, 1.0];
    let shown = actual.pixels.iter().zip(&expected.pixels).filter(|(a, b)| **a != BLACK || **b != BLACK);
    let errors: Vec<f64> = shown.flat_map(|(a, b)| (0..4).map(|i| f64::from(a[i]) - f64::from(b[i]))).collect();
    let mean_square = errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64;
    (-10.0 * mean_square.log10(), errors.iter().fold(0.0, |most: f64, error| most.max(error.abs())))
}

/// The mean of red, green and blue over all pixels.
pub(crate) fn brightness(image: &Image) -> f64 {
    let sum: f64 = image.pixels.iter().flat_map(|pixel| &pixel[..3]).map(|&channel| f64::from(channel)).sum();
    sum / (3 * image.pixels.len()) as f64
}

/// The root mean square of the differences in red, green and blue over all pixels.
pub(crate) fn rms(a: &Image, b: &Image) -> f64 {
    let squares = a.pixels.iter().zip(&b.pixels).flat_map(|(a, b)| (0..3).map(|i| f64::from(a[i] - b[i]).powi(2)));
    (squares.sum::<f64>() / (3 * a.pixels.len()) as f64).sqrt()
}

/// The brightness of a cube's right face divided by that of its left one, away from their edges: means over pixels at these distances from
/// the image's middle, as fractions of its height.
pub(crate) fn right_over_left(image: &Image) -> f64 {
    let side = f64::from(image.height);
    let face = |sign: f64| {
        let reds = image.pixels.iter().enumerate().filter_map(|(at, pixel)| {
            let (x, y) = (at % image.width as usize, at / image.width as usize);
            let [x, y] = [x, y].map(|pixel| (pixel as f64 + 0.5) / side - 0.5);
            ((0.07..0.19).contains(&(sign * x)) && y.abs() < 0.12).then_some(f64::from(pixel[0]))
        });
        let (count, sum) = reds.fold((0.0, 0.0), |(count, sum), red| (count + 1.0, sum + red));
        sum / count
    };
    face(1.0) / face(-1.0)
}

/// A turn from 0° to 90°, with the brightness of its frames.
pub(crate) struct Turn {
    pub(crate) brightness: Vec<f64>,
}

impl Turn {
    /// The degrees between frames.
    const STEP: f64 = 0.5;
    /// The side of an image in pixels.
    pub(crate) const SIDE: u32 = 256;

    pub(crate) fn new(headless: &GpuHeadless, volume: &Arc<Volume>, scene: &Scene, method: Method) -> Self {
        let mut scene = scene.clone();
        (scene.image.width, scene.image.height) = (Self::SIDE, Self::SIDE);
        scene.splatting.method = method;
        let mut view = headless.view(volume.clone(), &scene).unwrap();
        let frames = (90.0 / Self::STEP) as u32 + 1;
        let brightness = (0..frames)
            .map(|frame| {
                view.set_camera(turned(&scene, f64::from(frame) * Self::STEP).camera).unwrap();
                brightness(&headless.draw(&mut view).unwrap().image)
            })
            .collect();
        Self { brightness }
    }

    /// The brightness at an angle.
    pub(crate) fn at(&self, degrees: f64) -> f64 {
        self.brightness[(degrees / Self::STEP) as usize]
    }

    /// The largest change from one frame to the next.
    pub(crate) fn largest_change(&self) -> f64 {
        self.brightness.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max)
    }

    /// The largest pop and its angle. A pop is the difference between a frame's distances to its two neighbours, which excludes steady
    /// changes, such as those of the light and of what is hidden.
    pub(crate) fn largest_pop(&self) -> (f64, f64) {
        let pops = self.brightness.windows(3).map(|three| (three[0] - 2.0 * three[1] + three[2]).abs());
        let (at, most) = pops.enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
        (most, (at + 1) as f64 * Self::STEP)
    }

    /// The brightness of the brightest frame divided by that of the darkest one.
    pub(crate) fn spread(&self) -> f64 {
        let (least, most) = (self.brightness.iter()).fold((f64::MAX, 0.0_f64), |(lo, hi), &b| (lo.min(b), hi.max(b)));
        most / least
    }
}

/// A ball of constant value on a grid of 1:1:5, unshaded, which should not change in a turn.
pub(crate) fn ball() -> Volume {
    let (dims, spacing) = (UVec3::new(65, 65, 13), dvec3(1.0, 1.0, 5.0));
    sampled(dims, spacing, |p| 255.0 * (0.5 + (24.0 - p.length()) / 5.0).clamp(0.0, 1.0))
}

fn sampled(dims: UVec3, spacing: DVec3, value: impl Fn(DVec3) -> f64) -> Volume {
    let center = (dims.as_dvec3() - 1.0) / 2.0;
    let voxels = (0..dims.z).flat_map(|z| (0..dims.y).flat_map(move |y| (0..dims.x).map(move |x| UVec3::new(x, y, z))));
    let values = voxels.map(|voxel| value((voxel.as_dvec3() - center) * spacing) as f32).collect();
    Volume::new("bench", dims, spacing, values).unwrap()
}

/// The change of an X-ray image of a 1:1:5 volume if its slices are interpolated to 1:1:1 instead of warped (§4.2): rms and largest
/// difference relative to the image's maximum, by the f64 evaluation. First with the Gaussian that makes the two kernels one, then
/// linearly.
pub(crate) fn warp_or_slices(degrees: f64) -> [(f64, f64); 2] {
    /// The number of slices added at both ends, so that the interpolation ends within the volume.
    const MARGIN: u32 = 3;
    let thick = ball();
    let dims = thick.dims();
    let fine = UVec3::new(dims.x, dims.y, 5 * (dims.z - 1 + 2 * MARGIN) + 1);
    let resliced = |weight: &dyn Fn(f64) -> f64| {
        let center = dims.as_dvec3() / 2.0 - 0.5;
        sampled(fine, DVec3::ONE, |p| {
            let [x, y] = [p.x + center.x, p.y + center.y].map(|i| i.round() as u32);
            let slice = |z: u32| f64::from(thick.value(UVec3::new(x, y, z)));
            (0..dims.z).map(|z| slice(z) * weight(p.z / 5.0 - (f64::from(z) - center.z))).sum()
        })
    };
    // The kernel's Gaussian is exp(-2·r²), with a variance of 1/4 voxels; five times as long, its variance is 25/4 units, of which the
    // interpolation contributes what the round kernel lacks: 24/4, or 6/25 slices.
    let variance: f64 = 6.0 / 25.0;
    let gaussian = |t: f64| (-t * t / (2.0 * variance)).exp() / (std::f64::consts::TAU * variance).sqrt();
    let linear = |t: f64| (1.0 - t.abs()).max(0.0);
    let scene = turned(
        &open(
            "ball",
            &["image={width=64,height=64}", "splatting.compositing=\"xray\"", "transfer.opacity=[[0,0],[510,0.02]]"],
        ),
        degrees,
    );
    let image = |volume: &Volume| reference::render(volume, &scene.resolve(volume), &scene).unwrap();
    let warped = image(&thick);
    let peak = warped.pixels.iter().fold(0.0_f32, |peak, pixel| peak.max(pixel[0]));
    let weights: [&dyn Fn(f64) -> f64; 2] = [&gaussian, &linear];
    weights.map(|weight| {
        let sliced = image(&resliced(weight));
        let largest =
            warped.pixels.iter().zip(&sliced.pixels).fold(0.0, |most: f32, (a, b)| most.max((a[0] - b[0]).abs()));
        (rms(&warped, &sliced) / f64::from(peak), f64::from(largest / peak))
    })
}
