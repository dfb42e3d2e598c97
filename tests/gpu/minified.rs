//! Minified views (the low-pass rule of SPEC §5): at a quarter of its size a view equals the box-filtered full-size view.
//! `cargo test --test gpu minified:: -- --nocapture` prints the measurements.

use sheetsplat::image::Image;
use sheetsplat::internals::kernel::Kernel;
use sheetsplat::internals::reference::composite::composite;
use sheetsplat::internals::reference::footprint::Ray;
use sheetsplat::internals::reference::{Buffer, Geometry, Lights, resolve, shading, sheets, splat};
use sheetsplat::scene::Scene;
use sheetsplat::volume::{Volume, builtin};

use crate::common::compare::{self, assert_at_least};
use crate::common::devices::{DRAWINGS, Drawing, gpu};
use crate::common::images::color_rms;
use crate::common::shared::shared;
use crate::common::{camera, scene, transfer};

const FACTOR: u32 = 4;

/// The image after a box filter.
fn box_filtered(image: &Image) -> Image {
    let (width, height) = (image.width / FACTOR, image.height / FACTOR);
    let pixel = |at: u32| {
        let corner = (at % width + at / width * image.width) * FACTOR;
        let block =
            (0..FACTOR * FACTOR).map(|i| image.pixels[(corner + i % FACTOR + i / FACTOR * image.width) as usize]);
        let sum = block.fold([0.0; 4], |sum: [f32; 4], pixel| std::array::from_fn(|i| sum[i] + pixel[i]));
        sum.map(|channel| channel / (FACTOR * FACTOR) as f32)
    };
    Image { width, height, pixels: (0..width * height).map(pixel).collect() }
}

fn minified(scene: &Scene) -> Scene {
    let mut small = scene.clone();
    small.image.width /= FACTOR;
    small.image.height /= FACTOR;
    small
}

/// The PSNR in dB over the colours of all pixels.
fn decibels(a: &Image, b: &Image) -> f64 {
    compare::decibels(color_rms(a, b))
}

/// The PSNR in dB, by whatever draws, between a view at a quarter of its size and the box-filtered one; also the latter.
fn by_all(volume: &Volume, scene: &Scene) -> ([f64; 3], Image) {
    let gpu = gpu();
    let filtered = box_filtered(&Drawing::Native.render(gpu, volume, scene).image);
    let small = minified(scene);
    (DRAWINGS.map(|drawing| decibels(&drawing.render(gpu, volume, &small).image, &filtered)), filtered)
}

/// The f64 image of an orthographic view without the low-pass rule, with footprints of any size.
fn without_low_pass(volume: &Volume, scene: &Scene) -> Image {
    let transfer = scene.channels[0].transfer.resolve(volume);
    let kernel = Kernel::new(scene.splatting.radius, scene.splatting.falloff);
    let mut geometry = Geometry::new(volume.grid(), scene).unwrap();
    let ray = Ray::new(geometry.basis.w, &geometry.basis, volume.grid().aspect());
    (geometry.footprint_from_pixels, geometry.amplitude) = (ray.footprint_from_units * geometry.pix, 1.0);
    let voxels = shading::taking_part(volume, std::slice::from_ref(&transfer), &geometry);
    let splats =
        shading::splats(&voxels, volume, std::slice::from_ref(&transfer), (scene, &Lights::default()), &geometry);
    let mut acc = Buffer::new(scene.image.width, scene.image.height);
    for (k, bucket) in sheets::buckets(&voxels, &splats, &geometry, &kernel) {
        let in_sheet: Vec<_> = bucket.iter().map(|&index| splats[index as usize]).collect();
        let sheet = splat::sheet(&in_sheet, k, &geometry, &kernel);
        composite(&mut acc, &sheet, scene.splatting.compositing, scene.splatting.order);
    }
    let finished = (scene.splatting.compositing, &scene.splatting);
    resolve::resolve(&acc, finished, scene.image.background).into_image()
}

/// The rule is for structures finer than a pixel: without it a pixel shows whatever lies behind its centre. (Solid objects are closer to
/// the filtered image without it, because the rule blurs slightly more than a box.)
#[test]
fn fine_structures() {
    let volume = builtin::volume("nerve:160").unwrap();
    let mut scene = scene(320, 320);
    scene.camera = camera([0.2, 0.9, -0.5], 960.0);
    scene.splatting.culling = false;
    let (drawn, filtered) = by_all(&volume, &scene);
    let without = decibels(&without_low_pass(&volume, &minified(&scene)), &filtered);
    println!("builtin:nerve:160: {drawn:.1?} dB, without the low-pass rule {without:.1} dB");
    for decibels in drawn {
        assert_at_least(decibels, 34.0, "fine structures");
        assert_at_least(decibels - without, 2.5, "what the low-pass rule gains");
    }
}

/// A solid head and a translucent one.
#[test]
fn heads() {
    let volume = builtin::volume("head:96").unwrap();
    for (opacity, least) in [(1.0, 34.0), (0.05, 34.0)] {
        let mut scene = scene(320, 320);
        scene.camera.direction = glam::DVec3::new(0.4, 0.9, -0.3);
        scene.channels[0].transfer =
            transfer(&[(40.0, [0.9, 0.6, 0.4]), (255.0, [1.0, 1.0, 0.9])], &[(30.0, 0.0), (60.0, opacity)]);
        scene.splatting.culling = false;
        let (drawn, _) = by_all(&volume, &scene);
        drawn.into_iter().for_each(|decibels| assert_at_least(decibels, least, format_args!("opacity {opacity}")));
    }
}

/// Scans at the size of their scenes.
#[test]
#[ignore = "needs the shared data: SHEETSPLAT_SHARED=FOLDER"]
fn shared_ct_heads() {
    for (name, least) in [("ct-head-opaque", 34.0), ("ct-head-semi", 40.0)] {
        let mut scene = Scene::open(&shared(&format!("scenes/{name}.toml")), &[]).unwrap();
        // Culling would change the image within its bound.
        scene.splatting.culling = false;
        let volume = scene.load_volume().unwrap();
        let (drawn, filtered) = by_all(&volume, &scene);
        let without = decibels(&without_low_pass(&volume, &minified(&scene)), &filtered);
        println!("{name}: {drawn:.1?} dB, without the low-pass rule {without:.1} dB");
        drawn.into_iter().for_each(|decibels| assert_at_least(decibels, least, name));
    }
}
