//! Properties of every image with classification after splatting, whatever draws it.

use glam::{DVec3, UVec3};
use sheetsplat::cpu::{self, CpuRenderer};
use sheetsplat::image::Image;
use sheetsplat::scene::Scene;
use sheetsplat::settings::{Compositing, Interpolation, Light, Rasterizer, Window};
use sheetsplat::volume::{Volume, builtin};

use crate::after::images::head;
use crate::after::{eye, render, scene, volume};
use crate::common::compare::{assert_at_least, assert_at_most};
use crate::common::devices::gpu;
use crate::common::images::{BLACK, color_rms, psnr, rms};
use crate::common::{BY_AMOUNTS, Random, camera, transfer};

/// What draws images.
#[derive(Clone, Copy)]
struct Drawing {
    name: &'static str,
    /// The relative error of amounts.
    exactness: f64,
    draw: fn(&Volume, &Scene) -> Image,
}

const DRAWINGS: [Drawing; 4] = [
    Drawing { name: "twin", exactness: 1e-5, draw: render },
    Drawing { name: "quads", exactness: 1e-4, draw: |volume, scene| by(Rasterizer::Quads, volume, scene) },
    Drawing { name: "tiles", exactness: 1e-4, draw: |volume, scene| by(Rasterizer::Tiles, volume, scene) },
    Drawing { name: "cpu", exactness: 1e-4, draw: by_cpu },
];

impl Drawing {
    fn image(&self, volume: &Volume, scene: &Scene) -> Image {
        let image = (self.draw)(volume, scene);
        let is_finite = image.pixels.iter().flatten().all(|channel| channel.is_finite());
        assert!(is_finite, "{}: a pixel that is not finite", self.name);
        image
    }
}

/// Draws by a rasterizer of the GPU, without culling.
fn by(rasterizer: Rasterizer, volume: &Volume, scene: &Scene) -> Image {
    let mut scene = scene.clone();
    (scene.splatting.rasterizer, scene.splatting.culling) = (rasterizer, false);
    gpu().render_volume(volume.clone(), &scene).unwrap().image
}

/// Draws on the CPU's cores, without culling.
fn by_cpu(volume: &Volume, scene: &Scene) -> Image {
    let mut scene = scene.clone();
    scene.splatting.culling = false;
    cpu::render(volume.clone(), &scene).unwrap().image
}

/// The field has the value of homogeneous matter, far from other matter: its opacity, where values are chosen or averaged, and its colour, where
/// amounts add up.
#[test]
fn constants_are_reconstructed() {
    const VALUE: f64 = 137.3;
    let volume = volume([40, 20, 20], DVec3::new(1.0, 1.3, 0.8), |voxel| {
        if voxel.x < 28 { VALUE } else { f64::from(voxel.x * 7 % 5) * 60.0 }
    });
    for draw in DRAWINGS {
        for (compositing, interpolation, projection) in [
            (Compositing::Maximum, Interpolation::Smooth, None),
            (Compositing::Minimum, Interpolation::Exact, None),
            (Compositing::Average, Interpolation::Smooth, Some(eye(15.0))),
            (Compositing::Linear, Interpolation::Smooth, None),
            (Compositing::Exponential, Interpolation::Exact, None),
            (Compositing::Xray, Interpolation::Smooth, Some(eye(15.0))),
        ] {
            let mut scene = scene(12, 12);
            scene.camera = camera([0.1, 1.0, -0.2], 6.0);
            scene.camera.center = Some(DVec3::new(-8.0, 0.0, 0.0));
            scene.camera.projection = projection.unwrap_or(scene.camera.projection);
            (scene.splatting.compositing, scene.splatting.interpolation) = (compositing, interpolation);
            scene.splatting.slab_width = 0.7;
            scene.shading.enabled = false;
            let is_of_amounts = BY_AMOUNTS.contains(&compositing);
            let (dark, opacity) = if is_of_amounts { (0.0, (0.02, 0.02)) } else { (1.0, (0.0, 1.0)) };
            scene.channels[0].transfer =
                transfer(&[(0.0, [dark; 3]), (255.0, [1.0; 3])], &[(0.0, opacity.0), (255.0, opacity.1)]);
            for pixel in draw.image(&volume, &scene).pixels {
                let share = if is_of_amounts { pixel[0] / pixel[3] } else { pixel[3] };
                let error = (f64::from(share) * 255.0 - VALUE) / 255.0;
                assert_at_most(error.abs(), 1e-5, format_args!("{} {compositing:?}: {pixel:?}", draw.name));
            }
        }
    }
}

/// Where a ramp reaches a value, it is lit as the plane that it is there, to 0.1 degrees.
#[test]
fn normals_of_a_ramp() {
    let slope = DVec3::new(1.0, 2.0, -0.7);
    let volume = volume([40, 40, 40], DVec3::new(1.0, 1.0, 1.25), |voxel| {
        // Per world unit, from the middle.
        slope.dot((voxel.as_dvec3() - 19.5) * DVec3::new(1.0, 1.0, 1.25)) + 500.0
    });
    for (draw, compositing) in DRAWINGS.into_iter().flat_map(|draw| {
        [Compositing::Surface, Compositing::Linear, Compositing::Exponential].map(|compositing| (draw, compositing))
    }) {
        for projection in [None, Some(eye(60.0))] {
            for light in [DVec3::new(-1.0, -0.5, 0.3), DVec3::new(0.2, -1.0, -0.9)] {
                let mut scene = scene(16, 16);
                scene.camera = camera([0.4, 1.0, 0.3], 16.0);
                scene.camera.projection = projection.unwrap_or(scene.camera.projection);
                scene.splatting.compositing = compositing;
                (scene.shading.ambient, scene.shading.diffuse, scene.shading.specular) = (0.0, 1.0, 0.0);
                scene.shading.light = Light::Direction(light);
                scene.channels[0].transfer = transfer(&[(0.0, [1.0; 3])], &[(500.0, 0.0), (500.1, 1.0)]);
                let angle = slope.angle_between(light);
                let expected = angle.min(std::f64::consts::PI - angle).to_degrees();
                for pixel in draw.image(&volume, &scene).pixels {
                    // Every slab behind the value is lit by the same normal.
                    let is_opaque = if compositing == Compositing::Surface { pixel[3] == 1.0 } else { pixel[3] > 0.99 };
                    assert!(is_opaque, "{}, {compositing:?}: {pixel:?}", draw.name);
                    let error = f64::from(pixel[0] / pixel[3]).acos().to_degrees() - expected;
                    let what = format_args!("{}, {compositing:?}, {light}: {pixel:?}", draw.name);
                    assert_at_most(error.abs(), 0.1, what);
                }
            }
        }
    }
}

/// A ray's opacity depends on its length in the box of voxel cells, for any direction, spacing and slab width.
#[test]
fn a_uniform_slab_is_as_opaque_as_it_is_thick() {
    for draw in DRAWINGS {
        const OPACITY: f64 = 0.07;
        let mut random = Random(5);
        for case in 0..20 {
            let spacing = random.pick(&[DVec3::ONE, DVec3::new(1.0, 1.0, 5.0), DVec3::new(2.0, 1.0, 1.5)]);
            let axis = case % 3;
            let mut dims = UVec3::splat(40);
            dims[axis] = 4;
            let volume = volume(dims.to_array(), spacing, |_| 1.0);
            let direction = loop {
                let direction = random.direction();
                if direction[axis].abs() > 0.75 {
                    break direction;
                }
            };
            let mut scene = scene(9, 9);
            let up = scene.camera.up;
            scene.camera = camera(direction.to_array(), 3.0);
            scene.camera.up = up;
            if case % 2 == 1 {
                scene.camera.projection =
                    sheetsplat::settings::Projection::Perspective { fov_y: 2.0, distance: Some(60.0), near: None };
            }
            scene.splatting.slab_width = random.pick(&[0.3, 1.0, 1.7]);
            scene.splatting.compositing = Compositing::Exponential;
            scene.shading.enabled = false;
            scene.channels[0].transfer = transfer(&[(0.0, [0.2, 0.5, 0.9])], &[(0.0, OPACITY)]);
            let units = 4.0 * spacing[axis] / spacing.min_element();
            let basis = scene.camera.basis();
            let per_pixel = if case % 2 == 1 { 2.0 * 1.0_f64.to_radians().tan() / 9.0 } else { 0.0 };
            let image = draw.image(&volume, &scene);
            for (at, pixel) in (0..).zip(&image.pixels) {
                // Every pixel's own ray.
                let [x, y] = [at % 9, at / 9].map(|place| (f64::from(place) - 4.0) * per_pixel);
                let ray = (basis.w + x * basis.u - y * basis.v).normalize();
                let expected = 1.0 - (1.0 - OPACITY).powf(units / ray[axis].abs());
                let what = format_args!("{}, {direction}: {pixel:?}, not {expected}", draw.name);
                assert_at_most((f64::from(pixel[3]) / expected - 1.0).abs(), draw.exactness, what);
                assert_at_most((f64::from(pixel[2] / pixel[3]) - 0.9).abs(), 1e-5, what);
            }
        }
    }
}

/// Where pixels stop by themselves, an opaque one stops where a group of sheets of one `unit` ends, four sheets at most, and not in the middle of matter, just beyond
/// the threshold. Parts show it: pictures are closed.
#[test]
fn opaque_pixels_stop_behind_groups_of_sheets() {
    let volume = volume([24, 16, 24], DVec3::ONE, |_| 1.0);
    let mut scene = scene(9, 9);
    scene.camera = camera([0.0, 1.0, 0.0], 6.0);
    scene.splatting.compositing = Compositing::Exponential;
    scene.shading.enabled = false;
    // Pixels become opaque 3.3 units behind the volume's near side, which is a multiple of the slab widths from its middle.
    scene.channels[0].transfer = transfer(&[(0.0, [1.0; 3])], &[(0.0, 0.6)]);
    let whole = Window::whole([9, 9]);
    for (slab_width, units) in [(2.0, 4.0), (1.0, 4.0), (0.5, 4.0), (0.25, 4.0), (0.125, 3.5)] {
        scene.splatting.slab_width = slab_width;
        let (by_cores, _) = CpuRenderer::new(volume.clone(), &scene).unwrap().draw_part(&whole).unwrap();
        scene.splatting.rasterizer = Rasterizer::Tiles;
        let (by_tiles, _) = gpu().draw_part(&mut gpu().view(volume.clone(), &scene).unwrap(), &whole).unwrap();
        for (name, part) in [("cpu", by_cores), ("tiles", by_tiles)] {
            let expected = 1.0 - 0.4_f64.powf(units);
            assert_eq!(part.contents[0].colors.len(), 81, "{name}");
            for pixel in &part.contents[0].colors {
                let what = format_args!("{name}, slab width {slab_width}: {pixel:?}, not {expected}");
                assert_at_most((f64::from(pixel[3]) - expected).abs(), 1e-5, what);
            }
            let picture = Image::merge([part]).unwrap();
            assert!(picture.pixels.iter().all(|pixel| pixel[3] == 1.0), "{name}: closed");
        }
    }
}

#[test]
fn thinner_slabs_converge() {
    for draw in DRAWINGS {
        for (projection, compositing) in
            [(None, Compositing::Exponential), (Some(eye(800.0)), Compositing::Xray), (None, Compositing::Maximum)]
        {
            let (volume, mut scene) = head();
            scene.camera.projection = projection.unwrap_or(scene.camera.projection);
            scene.splatting.compositing = compositing;
            let images = [1.0, 0.5, 0.25, 0.125].map(|width| {
                scene.splatting.slab_width = width;
                draw.image(&volume, &scene)
            });
            let steps: Vec<f64> = images.windows(2).map(|pair| rms(&pair[0], &pair[1])).collect();
            println!("{}: {compositing:?}: {steps:.5?}", draw.name);
            assert!(steps[0] > 1e-4 && steps[0] < 0.1, "{compositing:?}: {steps:?}");
            // A maximum is taken over only the planes' points.
            let factor = if compositing == Compositing::Maximum { 0.8 } else { 0.7 };
            assert!(steps[1] < factor * steps[0] && steps[2] < factor * steps[1], "{compositing:?}: {steps:?}");
        }
    }
}

/// Fig. 3's cube from 44.8° to 45.2°. Unshaded it hardly changes. Its lit faces do: normals have no length, so the light ends abruptly where
/// kernels end, and the bright edge in front moves; but no more than at other angles, and by a tenth of what axis-aligned sheets do there.
#[test]
fn the_cube_does_not_pop() {
    for draw in DRAWINGS {
        let volume = builtin::volume("cube").unwrap();
        for (compositing, interpolation) in
            [(Compositing::Linear, Interpolation::Smooth), (Compositing::Exponential, Interpolation::Exact)]
        {
            let mut scene = scene(128, 128);
            scene.camera.up = DVec3::Z;
            scene.channels[0].transfer =
                transfer(&[(0.0, [0.0, 0.5, 1.0]), (255.0, [1.0; 3])], &[(0.0, 0.0), (255.0, 0.5)]);
            (scene.shading.ambient, scene.shading.diffuse, scene.shading.specular) = (0.0, 1.0, 0.0);
            (scene.splatting.compositing, scene.splatting.interpolation) = (compositing, interpolation);
            let turned = |scene: &Scene, from: f64| {
                let [before, after] = [from, from + 0.4].map(|degrees: f64| {
                    let (sine, cosine) = degrees.to_radians().sin_cos();
                    let mut scene = scene.clone();
                    scene.camera.direction = DVec3::new(sine, cosine, 0.0);
                    draw.image(&volume, &scene)
                });
                assert!(before.pixels.iter().filter(|pixel| pixel[3] > 0.9).count() > 2000);
                color_rms(&before, &after)
            };
            let [lit, lit_elsewhere] = [44.8, 43.3].map(|from| turned(&scene, from));
            scene.shading.enabled = false;
            let unlit = turned(&scene, 44.8);
            println!(
                "{}: {compositing:?} {interpolation:?}: {lit:.5}, {lit_elsewhere:.5}, unlit {unlit:.5}",
                draw.name
            );
            assert!(unlit < 0.003, "{compositing:?} {interpolation:?}: {unlit}");
            assert!(lit < 0.006 && lit < 1.1 * lit_elsewhere, "{lit} {lit_elsewhere}");
        }
    }
}

/// Rounding puts the mean of equal values beyond all of them, which must not make the matter at the end of the values' range vanish.
#[test]
fn matter_at_the_end_of_the_range_is_matter() {
    for inverted in [false, true] {
        let cube = builtin::volume("cube").unwrap();
        let values = cube.values().iter().map(|value| if inverted { 255.0 - value } else { value }).collect();
        let volume = Volume::new("cube", cube.grid().dims, cube.spacing(), values).unwrap();
        let mut scene = scene(96, 96);
        scene.camera = camera([0.70463, 0.70957, 0.2], 40.0);
        let ends = if inverted { [0.5, 0.0] } else { [0.0, 0.5] };
        scene.channels[0].transfer =
            transfer(&[(0.0, [0.0, 0.5, 1.0]), (255.0, [1.0; 3])], &[(0.0, ends[0]), (255.0, ends[1])]);
        (scene.shading.ambient, scene.shading.diffuse, scene.shading.specular) = (0.0, 1.0, 0.0);
        scene.splatting.culling = false;
        let expected = render(&volume, &scene);
        for draw in &DRAWINGS[1..] {
            let decibels = psnr(&draw.image(&volume, &scene).pixels, &expected.pixels, BLACK, 1000);
            assert_at_least(decibels, 70.0, format_args!("{}, inverted {inverted}", draw.name));
        }
    }
}

/// Half a volume that hides everything behind it gives the same image as a surface and by nearly opaque compositing.
#[test]
fn surface_and_exponential_agree_on_an_opaque_step() {
    for draw in DRAWINGS {
        let volume = volume([20, 20, 20], DVec3::ONE, |voxel| {
            let p = voxel.as_dvec3() - 9.5;
            if p.length() < 7.3 { 100.0 } else { 0.0 }
        });
        for slab_width in [0.25, 0.125] {
            let mut scene = scene(64, 64);
            scene.camera = camera([0.2, 1.0, -0.3], 18.0);
            scene.image.background = [0.0, 0.0, 0.0, 1.0];
            scene.shading.light = Light::Direction(DVec3::new(-0.5, -1.0, 0.5));
            scene.channels[0].transfer = transfer(&[(0.0, [0.9, 0.5, 0.2])], &[(49.9, 0.0), (50.1, 1.0)]);
            scene.splatting.slab_width = slab_width;
            let [surface, exponential] = [Compositing::Surface, Compositing::Exponential].map(|compositing| {
                scene.splatting.compositing = compositing;
                draw.image(&volume, &scene)
            });
            let decibels = psnr(&surface.pixels, &exponential.pixels, BLACK, 1000);
            println!("{}: slab width {slab_width}: {decibels:.1} dB", draw.name);
            assert!(decibels > 40.0, "slab width {slab_width}: {decibels}");
        }
    }
}
