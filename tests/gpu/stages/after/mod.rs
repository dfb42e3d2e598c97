//! The stages of classification after splatting (SPEC §9) against the twin's field and composited pixels: by quads `values`, `field` and `classify`,
//! each given the numbers that the stage before it should give, and by tiles `gather_planes`.

mod classify;
mod field;
mod gather_planes;
mod values;

use std::collections::BTreeMap;
use std::ops::Range;

use glam::{DVec3, DVec4, UVec3};
use sheetsplat::headless::GpuHeadless;
use sheetsplat::internals::after::normalization::Normalization;
use sheetsplat::internals::brick;
use sheetsplat::internals::brick::BrickList;
use sheetsplat::internals::gpu::layout::{Brick, FieldPlanes, FieldVoxel};
use sheetsplat::internals::gpu::ramps::{Integration, Ramps, Stored};
use sheetsplat::internals::gpu::uniforms;
use sheetsplat::internals::gpu::volume_texture::VolumeTexture;
use sheetsplat::internals::kernel::Kernel;
use sheetsplat::internals::plane_geometry::PlaneGeometry;
use sheetsplat::internals::reference::{Host, after::Frame};
use sheetsplat::internals::view_geometry::ViewGeometry;
use sheetsplat::scene::Scene;
use sheetsplat::settings::{Classification, Compositing, Gradient, Interpolation, Projection, Ramp, TransferFunction};
use sheetsplat::volume::{Volume, builtin};
use sheetsplat::wgpu::{Buffer, BufferUsages};

use crate::common::{camera, scene, transfer};
use crate::stages::init;

/// A small head, with some holes if asked for.
fn head(spacing: [f64; 3], has_holes: bool) -> Volume {
    let head = builtin::volume("head:16").unwrap();
    let hole = |index: usize| has_holes && index % 37 == 5;
    let values = head.values().iter().enumerate().map(|(index, value)| if hole(index) { f32::NAN } else { value });
    Volume::new("head", head.dims(), DVec3::from(spacing), values.collect()).unwrap()
}

/// A scene that shows most of the head.
fn head_scene(projection: Option<Projection>) -> Scene {
    let mut scene = scene(45, 40);
    scene.splatting.classification = Classification::After;
    scene.channels[0].transfer = transfer(
        &[(40.0, [0.9, 0.6, 0.4]), (255.0, [1.0, 1.0, 0.9])],
        &[(30.0, 0.0), (70.0, 0.3), (71.0, 0.02), (150.0, 0.0), (200.0, 0.8)],
    );
    scene.camera = camera([0.4, 0.9, -0.3], 22.0);
    scene.camera.projection = projection.unwrap_or(scene.camera.projection);
    scene
}

/// A perspective camera whose eye is near enough for kernels of different sizes.
const PERSPECTIVE: Projection = Projection::Perspective { fov_y: 40.0, distance: Some(34.0), near: None };

/// Volumes and scenes that between them use every variant of the stages.
fn cases() -> Vec<(&'static str, Volume, Scene)> {
    let mut cases = Vec::new();
    for (name, spacing, has_holes, projection) in [
        ("orthographic", [1.0, 1.0, 1.0], false, None),
        ("orthographic, holes", [1.0, 1.3, 2.0], true, None),
        ("perspective", [1.0, 0.8, 1.6], false, Some(PERSPECTIVE)),
    ] {
        for gradient in [Gradient::Differences, Gradient::Kernel] {
            let mut scene = head_scene(projection);
            scene.shading.gradient = gradient;
            if gradient == Gradient::Kernel && !has_holes {
                scene.splatting.interpolation = Interpolation::Exact;
                scene.splatting.falloff = 1.2;
            }
            cases.push((name, head(spacing, has_holes), scene));
        }
    }
    cases
}

/// A volume in a view, as the stages get it.
struct Prepared<'a> {
    gpu: &'a GpuHeadless,
    name: String,
    volume: &'a Volume,
    scene: &'a Scene,
    view: ViewGeometry,
    numbers: Normalization,
    /// c for every voxel.
    coefficients: Vec<f32>,
    bricks: Vec<Brick>,
    values: VolumeTexture,
    frame: Buffer,
    field_planes: FieldPlanes,
    /// One `FieldPlanes`.
    planes: Buffer,
    control_points: Buffer,
}

impl<'a> Prepared<'a> {
    fn new(
        gpu: &'a GpuHeadless,
        (name, volume, scene): (&str, &'a Volume, &'a Scene),
        transfer: &TransferFunction,
        twin: &Frame<'_>,
    ) -> Self {
        let (device, queue, splatting) = (gpu.device(), gpu.queue(), &scene.splatting);
        let grid = volume.grid();
        let view = ViewGeometry::new(grid, &scene.camera, splatting, [scene.image.width, scene.image.height]).unwrap();
        let coefficients: Vec<f32> = twin.field().coefficients().iter().map(|&c| c as f32).collect();
        let numbers = Normalization::of(coefficients.iter().copied()).unwrap();
        let integration = Integration { splatting, numbers: std::slice::from_ref(&numbers) };
        let ramps = Ramps::of_channels(
            std::slice::from_ref(transfer),
            &[Stored { labels: 1, colors: 0 }],
            0,
            Some(integration),
        );
        let kernel = Kernel::new(splatting.radius, splatting.falloff);
        let values = VolumeTexture::upload(device, queue, volume.values()).unwrap();
        let frame = uniforms::frame(&view, &kernel, (grid, values.format), &ramps, scene);
        let planes = uniforms::planes(&PlaneGeometry::new(&view, grid), &view, values.format, &numbers);
        let voxels: Vec<u32> = (0..grid.dims.element_product()).collect();
        Self {
            gpu,
            name: format!("{name}, {:?}", scene.shading.gradient),
            bricks: BrickList::new(grid, &voxels).bricks().to_vec(),
            frame: init(device, &[frame], BufferUsages::UNIFORM),
            field_planes: planes,
            planes: init(device, &[planes], BufferUsages::UNIFORM),
            control_points: init(device, &ramps.points, BufferUsages::STORAGE),
            volume,
            scene,
            view,
            numbers,
            coefficients,
            values,
        }
    }

    /// Whether coefficients differ from the values.
    fn is_exact(&self) -> bool {
        self.scene.splatting.interpolation == Interpolation::Exact
    }

    fn has_holes(&self) -> bool {
        self.volume.values().iter().any(|value| value.is_nan())
    }

    /// Every voxel that is not a hole, by its place in the list of records.
    fn voxels(&self) -> BTreeMap<u32, UVec3> {
        let all = (0..).zip(&self.bricks).flat_map(|(number, brick)| {
            brick::voxels(brick).map(move |(slot, voxel)| (number * brick::BRICK_VOXELS + slot, voxel))
        });
        all.filter(|&(_, voxel)| !self.volume.value(voxel).is_nan()).collect()
    }

    /// The planes that any kernel reaches.
    fn reached_planes(&self) -> Range<i32> {
        let corners = (0..8_u32).map(|corner| {
            let last = (self.volume.dims() - 1).as_dvec3();
            let at = DVec3::new(f64::from(corner & 1), f64::from(corner >> 1 & 1), f64::from(corner >> 2)) * last;
            (self.view.screen_from_voxel[2].dot(at.extend(1.0)) - self.view.slabs.origin) / self.view.slabs.width
        });
        let (low, high) = corners.fold((f64::MAX, f64::MIN), |(low, high), depth| (low.min(depth), high.max(depth)));
        let reach = self.view.reach / self.view.slabs.width;
        (low - reach).floor() as i32..(high + reach).ceil() as i32 + 1
    }
}

/// Runs a check for each case, with what the stages get and the twin.
fn each_case(gpu: &GpuHeadless, check: impl Fn(&Prepared<'_>, &Frame<'_>)) {
    for (name, volume, scene) in cases() {
        with_case(gpu, (name, &volume, &scene), &check);
    }
}

fn with_case(
    gpu: &GpuHeadless,
    (name, volume, scene): (&str, &Volume, &Scene),
    check: impl Fn(&Prepared<'_>, &Frame<'_>),
) {
    with_host(gpu, Host::default(), (name, volume, scene), check);
}

/// The same for a host's surfaces, in `unit`s, and first hits.
fn with_host(
    gpu: &GpuHeadless,
    host: Host<'_>,
    (name, volume, scene): (&str, &Volume, &Scene),
    check: impl Fn(&Prepared<'_>, &Frame<'_>),
) {
    let transfer = scene.channels[0].transfer.resolve(volume);
    let twin = Frame::new(host, volume, std::slice::from_ref(&transfer), scene).unwrap();
    check(&Prepared::new(gpu, (name, volume, scene), &transfer, &twin), &twin);
}

/// Planes and a box that cut through the head.
fn cut(scene: &mut Scene) {
    scene.clip.planes = vec![[0.3, 1.0, 0.2, 1.5], [-1.0, 0.2, 0.1, 4.0]];
    scene.clip.crop = Some([DVec3::new(-6.0, -5.0, -9.0), DVec3::new(5.5, 7.0, 6.0)]);
}

/// Asserts that the words of first hits, sheet depths or 0, are where the twin has them. Returns the number of hits.
fn assert_hits(prepared: &Prepared<'_>, twin: &Frame<'_>, words: &[u32], what: &str) -> usize {
    let slabs = &prepared.view.slabs;
    let (mut hits, mut off) = (0, 0);
    for (word, expected) in words.iter().zip(twin.composite()) {
        let found = (*word != 0).then(|| (f64::from(f32::from_bits(*word)) - slabs.origin) / slabs.width);
        hits += usize::from(expected.first_hit.is_some());
        off += usize::from(match (found, expected.first_hit) {
            (Some(found), Some(expected)) => (found - expected).abs() > 2e-3,
            (None, None) => false,
            _ => true,
        });
    }
    // Where opacity hardly grows, rounding moves the hit.
    assert!(off * 400 <= words.len(), "{what}: {off} of {hits} hits");
    hits
}

/// A power of two from -126 to 127.
fn power_of_2(exponent: i32) -> f64 {
    2.0_f64.powi(exponent)
}

/// The gradient of a record, numbers per `unit`.
fn gradient_of(record: &FieldVoxel) -> DVec3 {
    let part = |bits: u32| f64::from(bits as u16 as i16) / 32767.0;
    let scale = power_of_2((record.gradient_z >> 16) as i32 - 256);
    DVec3::new(part(record.gradient_xy), part(record.gradient_xy >> 16), part(record.gradient_z)) * scale
}

/// What the compositing buffer means: for a minimum it holds 2 minus the opacity, and 0 for nothing.
fn resolved(compositing: Compositing, color: DVec4) -> DVec4 {
    match compositing {
        Compositing::Minimum if color.w > 0.0 => color.truncate().extend(2.0 - color.w),
        _ => color,
    }
}

/// A scene in which a compositing shows much.
fn shown_by(compositing: Compositing, projection: Option<Projection>) -> Scene {
    let mut scene = head_scene(projection);
    scene.splatting.compositing = compositing;
    let opacity: Option<&[(f64, f64)]> = match compositing {
        Compositing::Maximum => Some(&[(20.0, 0.0), (100.0, 0.2), (250.0, 0.9)]),
        Compositing::Minimum => Some(&[(0.0, 0.9), (60.0, 0.6), (250.0, 0.1)]),
        Compositing::Average => Some(&[(10.0, 0.0), (60.0, 0.7), (90.0, 0.2)]),
        Compositing::Surface => Some(&[(30.0, 0.0), (70.0, 0.7), (200.0, 0.8)]),
        _ => None,
    };
    if let Some(points) = opacity {
        scene.channels[0].transfer.opacity = Some(Ramp::new(points.to_vec()).unwrap());
    }
    scene
}
