//! Compositing by means (`splatting::Compositing`; SPEC is silent): whole frames by each rasterizer and the native backend against the f64 evaluation, and
//! properties of maximum, minimum, average and surface in every view. `cargo test --test gpu modes:: -- --nocapture` prints the
//! measurements.

mod along_rays;
mod culling;
mod surface;
mod twin;

use glam::{DVec3, UVec3};
use sheetsplat::Pick;
use sheetsplat::cpu::CpuRenderer;
use sheetsplat::headless::{GpuHeadless, readback};
use sheetsplat::image::Image;
use sheetsplat::internals::view_geometry::ViewGeometry;
use sheetsplat::scene::Scene;
use sheetsplat::settings::{Method, Splatting};
use sheetsplat::stats::Counts;
use sheetsplat::volume::Volume;

use crate::common::devices::Drawing;
use crate::common::surfaces::{DepthRange, surfaces};
use crate::common::{Random, SPACINGS, random_eye, random_volume, scene, transfer};

/// The fraction of pixels in which an opacity, a slab's middle or a ray lies on an edge, so that rounding decides.
pub(crate) const OUTLIERS: f64 = 0.0003;

/// The fraction of pixels with a channel that differs by more than `by`.
pub(crate) fn share_off(a: &[[f32; 4]], b: &[[f32; 4]], by: f32) -> f64 {
    assert_eq!(a.len(), b.len());
    // The negation also counts NaN.
    let is_close = |(a, b): (&f32, &f32)| (a - b).abs() <= by;
    let is_off = |(a, b): &(&[f32; 4], &[f32; 4])| !a.iter().zip(*b).all(is_close);
    a.iter().zip(b).filter(is_off).count() as f64 / a.len() as f64
}

/// Any view of any volume, from outside, beside or inside, with or without cuts.
pub(crate) fn random_case(random: &mut Random) -> (Volume, Scene) {
    let spacing = random.pick(&SPACINGS);
    let volume = random_volume(random, (6.0, 16.0), spacing);
    let mut scene = scene(random.uniform(20.0, 70.0) as u32, random.uniform(20.0, 60.0) as u32);
    scene.splatting.method = random.pick(&[Method::ImageAligned, Method::ImageAligned, Method::AxisAligned]);
    scene.camera.direction = random.direction();
    if random.bits().is_multiple_of(2) {
        scene.camera = random_eye(random, volume.grid());
    }
    let (haze, solid) = (random.pick(&[0.0, 0.02, 0.3]), random.pick(&[0.3, 0.9, 1.0]));
    // Transparent voxels leave gaps.
    let opacity = [(10.0, 0.0), (20.0, haze), (200.0, solid)];
    scene.channels[0].transfer = transfer(&[(0.0, [0.2, 0.5, 1.0]), (200.0, [1.0, 0.9, 0.8])], &opacity);
    scene.splatting.slab_width = random.pick(&[0.5, 1.0, 2.0, 3.0]);
    scene.splatting.radius = random.pick(&[1.4, 2.0, 2.7]);
    scene.splatting.culling = false;
    scene.image.background = random.pick(&[[0.0, 0.0, 0.0, 1.0], [0.2, 0.4, 0.6, 0.5]]);
    if random.bits().is_multiple_of(2) {
        let half = volume.grid().center() * volume.grid().spacing;
        let normal = random.direction();
        let through = random.within(-half, half) * 0.5;
        scene.clip.planes = vec![[normal.x, normal.y, normal.z, -normal.dot(through)]];
    }
    if random.bits().is_multiple_of(4) {
        let half = volume.grid().center() * volume.grid().spacing;
        scene.clip.crop = Some([-half * 0.6, half * 0.7 + volume.grid().spacing * 0.1]);
    }
    (volume, scene)
}

pub(crate) fn view_of(volume: &Volume, scene: &Scene) -> ViewGeometry {
    ViewGeometry::new(volume.grid(), &scene.camera, &scene.splatting, [scene.image.width, scene.image.height]).unwrap()
}

pub(crate) fn render(drawing: Drawing, gpu: &GpuHeadless, volume: &Volume, scene: &Scene) -> (Image, Counts) {
    let rendering = drawing.render(gpu, volume, scene);
    (rendering.image, rendering.stats.counts)
}

/// A frame as a host asks for it.
pub(crate) struct HostFrame {
    pub(crate) image: Image,
    /// In `unit`s; empty unless they are asked for.
    pub(crate) hits: Vec<f64>,
    /// Of the pixels that are asked for.
    pub(crate) picks: Vec<Option<Pick>>,
}

/// Draws a frame with first hits, behind a host's surface at some depths in `unit`s, and picks some pixels.
pub(crate) fn draw_for_host(
    drawing: Drawing,
    gpu: &GpuHeadless,
    (volume, scene): (&Volume, &Scene),
    (first_hit, depths): (Option<f64>, Option<&[f64]>),
    pixels: &[[u32; 2]],
) -> HostFrame {
    let unit = volume.grid().unit();
    let in_units = |depths: &[f32]| depths.iter().map(|&depth| f64::from(depth) / unit).collect();
    let Drawing::By(rasterizer) = drawing else {
        let mut renderer = CpuRenderer::new(volume.clone(), scene).unwrap();
        renderer.set_first_hit(first_hit).unwrap();
        let in_world = |depths: &[f64]| depths.iter().map(|depth| (depth * unit) as f32).collect();
        renderer.set_surfaces(depths.map(in_world)).unwrap();
        let image = renderer.draw().unwrap().image;
        let picks = pixels.iter().map(|&pixel| renderer.pick(pixel).unwrap()).collect();
        return HostFrame { image, hits: renderer.first_hits().map_or(Vec::new(), in_units), picks };
    };
    let splatting = Splatting { rasterizer, ..scene.splatting };
    let scene = Scene { splatting, ..scene.clone() };
    let mut view = gpu.view(volume.clone(), &scene).unwrap();
    view.set_first_hit(first_hit).unwrap();
    let seen = view_of(volume, &scene);
    let given = depths.map(|depths| surfaces(gpu, &seen, unit, DepthRange::Standard, [0.01, 1000.0], depths, [1, 2]));
    view.set_surfaces(given).unwrap();
    let image = gpu.draw(&mut view).unwrap().image;
    let hits = view.first_hits().map_or(Vec::new(), |texture| {
        let bytes = readback::texture(gpu.device(), gpu.queue(), texture).unwrap();
        in_units(&bytemuck::pod_collect_to_vec::<_, f32>(&bytes))
    });
    HostFrame { image, hits, picks: pixels.iter().map(|&pixel| gpu.pick(&view, pixel).unwrap()).collect() }
}

/// The constant volume's opacity, and its unshaded colour.
pub(crate) const OPACITY: f64 = 0.3;
pub(crate) const COLOR: [f64; 3] = [0.2, 0.5, 0.9];

/// A constant volume, with a kernel that leaves no ripple.
pub(crate) fn constant(dims: [u32; 3], spacing: DVec3) -> (Volume, Scene) {
    let dims = UVec3::from(dims);
    let volume = Volume::new("constant", dims, spacing, vec![1.0; dims.element_product() as usize]).unwrap();
    let mut scene = scene(120, 108);
    scene.camera.up = DVec3::new(0.1, 0.2, 1.0);
    (scene.splatting.radius, scene.splatting.falloff) = (3.0, 1.0);
    scene.shading.enabled = false;
    scene.image.background = [0.0; 4];
    scene.channels[0].transfer = transfer(&[(0.0, COLOR)], &[(0.0, OPACITY)]);
    (volume, scene)
}
