//! Images against a dense ray march of the same pre-shaded field (`reference::ray_march`): those of the f64 evaluation, the GPU's by each
//! rasterizer, and the native backend's. `cargo test --test gpu ray_march:: -- --nocapture` prints the measurements.

use glam::{DVec3, UVec2};
use sheetsplat::image::Image;
use sheetsplat::internals::reference::{self, ray_march};
use sheetsplat::scene::Scene;
use sheetsplat::settings::Compositing;
use sheetsplat::settings::Projection;
use sheetsplat::volume::{Volume, builtin};

use crate::common::compare::assert_at_least;
use crate::common::devices::{DRAWINGS, gpu};
use crate::common::images::{BLACK, psnr};
use crate::common::shared::shared;
use crate::common::{camera, scene, transfer};

/// Some pixels of an image by the ray march.
struct Marched {
    at: Vec<UVec2>,
    pixels: Vec<[f32; 4]>,
}

impl Marched {
    /// Every `stride`th pixel across and down.
    fn new(volume: &Volume, scene: &Scene, stride: u32) -> Self {
        let lines = |size: u32| (0..size).step_by(stride as usize);
        let at: Vec<UVec2> =
            lines(scene.image.height).flat_map(|y| lines(scene.image.width).map(move |x| UVec2::new(x, y))).collect();
        let pixels = ray_march::pixels(volume, &[scene.channels[0].transfer.resolve(volume)], scene, &at).unwrap();
        Self { at, pixels }
    }

    fn psnr(&self, image: &Image) -> f64 {
        let pixels: Vec<[f32; 4]> =
            self.at.iter().map(|at| image.pixels[(at.x + at.y * image.width) as usize]).collect();
        psnr(&pixels, &self.pixels, BLACK, 500)
    }
}

fn twin(volume: &Volume, scene: &Scene) -> Image {
    let mut scene = scene.clone();
    // Rays march to their ends.
    scene.splatting.culling = false;
    reference::render(volume, &[scene.channels[0].transfer.resolve(volume)], &scene).unwrap()
}

/// Asserts that the f64 evaluation, the GPU and the native backend come as close to the march as required, in dB.
fn assert_close(name: &str, volume: Volume, mut scene: Scene, stride: u32, required: f64) {
    let marched = Marched::new(&volume, &scene, stride);
    let by_twin = marched.psnr(&twin(&volume, &scene));
    let gpu = gpu();
    let drawn = DRAWINGS.map(|drawing| {
        // Closing, which no march has, adds as little as culling takes away.
        scene.splatting.opacity_threshold = 0.9999;
        [false, true].map(|culling| {
            scene.splatting.culling = culling;
            marched.psnr(&drawing.render(gpu, &volume, &scene).image)
        })
    });
    println!("{name}: twin {by_twin:.1} dB; by {DRAWINGS:?}, without and with culling: {drawn:.1?} dB");
    let all = [&[by_twin][..], drawn.as_flattened()].concat();
    all.iter().for_each(|&decibels| assert_at_least(decibels, required, name));
}

/// The nerve with a field of view of 30°, in an image so large that a grid unit covers a pixel at the far end and the low-pass rule has no
/// effect.
#[test]
fn nerve() {
    let mut scene = scene(288, 288);
    scene.camera.projection = Projection::Perspective { fov_y: 30.0, distance: None, near: None };
    scene.splatting.compositing = Compositing::Exponential;
    assert_close("builtin:nerve:128", builtin::volume("nerve:128").unwrap(), scene, 2, 46.5);
}

/// A strongly anisotropic head, translucent and shaded, as few slices are often made of one.
#[test]
fn anisotropic_head() {
    let volume = builtin::volume("head:64").unwrap().with_spacing("head", DVec3::new(1.0, 1.0, 4.0)).unwrap();
    let mut scene = scene(192, 192);
    scene.camera = camera([0.4, 0.9, -0.3], 1.0);
    scene.camera.projection = Projection::Perspective { fov_y: 25.0, distance: None, near: None };
    scene.channels[0].transfer =
        transfer(&[(40.0, [0.9, 0.6, 0.4]), (255.0, [1.0, 1.0, 0.9])], &[(30.0, 0.0), (120.0, 0.1)]);
    scene.splatting.compositing = Compositing::Exponential;
    assert_close("builtin:head:64 at 1:1:4", volume, scene, 2, 55.0);
}

/// A scan of the same kind.
#[test]
#[ignore = "needs the shared data: SHEETSPLAT_SHARED=FOLDER"]
fn shared_quarter_head() {
    let mut scene = Scene::open(&shared("scenes/quarter-head-perspective.toml"), &[]).unwrap();
    (scene.image.width, scene.image.height) = (192, 192);
    let volume = scene.load_volume().unwrap();
    assert_close("quarter-head-perspective", volume, scene, 1, 45.0);
}

/// Orthographic, slabs and march have the same field, so the error is that of the slab width and proportional to its square.
#[test]
fn thin_slabs() {
    let volume = builtin::volume("head:32").unwrap().with_spacing("head", DVec3::new(1.0, 1.0, 3.0)).unwrap();
    let mut scene = scene(72, 60);
    scene.channels[0].transfer =
        transfer(&[(40.0, [0.9, 0.6, 0.4]), (255.0, [1.0, 1.0, 0.9])], &[(30.0, 0.0), (120.0, 0.3)]);
    scene.camera = camera([0.4, 0.9, -0.3], 60.0);
    scene.splatting.compositing = Compositing::Exponential;
    let marched = Marched::new(&volume, &scene, 1);
    let decibels = [1.0, 0.5, 0.25].map(|slab_width| {
        scene.splatting.slab_width = slab_width;
        marched.psnr(&twin(&volume, &scene))
    });
    println!("slab widths 1, 0.5, 0.25: {decibels:.1?} dB");
    assert_at_least(decibels[0], 62.0, "slabs as wide as voxels");
    assert_at_least(decibels[1] - decibels[0], 10.0, "slabs half as wide");
    assert_at_least(decibels[2] - decibels[1], 10.0, "slabs a quarter as wide");
}
