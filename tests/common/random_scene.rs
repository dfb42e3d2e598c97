//! Random scenes over the whole range of every key of a scene file (SPEC §7), image sizes and economies aside, and volumes for them. A seed
//! determines a scene, on every machine.

use std::collections::BTreeMap;
use std::path::Path;

use glam::{DVec3, UVec3};
use sheetsplat::scene::{Channel, ImageSettings, Scene, TransferSettings, VolumeSource};
use sheetsplat::settings::{
    Camera, Classification, Clip, Compositing, FootprintBox, Gradient, Interpolation, LabelTables, Light, Method,
    Order, Projection, Ramp, Shading, SlabProfile, Splatting,
};
use sheetsplat::volume::{Channels, Grid, Labels, SampleType, Volume};

use super::{COMPOSITINGS, Random};

/// How far a decision lies from its boundary where rounding may change it: of a pixel's side, and of a volume's range of values.
const NEAR: f64 = 1e-4;

/// The most slabs through a volume, which the f64 evaluation draws one by one.
const MOST_SLABS: f64 = 160.0;

/// A random scene and its volume.
#[derive(Clone, Debug)]
pub(crate) struct Case {
    pub(crate) volume: Volume,
    pub(crate) scene: Scene,
    style: u64,
    seed: u64,
}

impl Case {
    /// The scene of a seed. Scenes with the same `style` share the settings that pipelines of a GPU depend on most.
    pub(crate) fn new(style: u64, seed: u64) -> Self {
        Self::moved_by(style, seed, None)
    }

    /// The same scene, with the camera and every value moved by at most [`NEAR`]. Pixels that jump lie next to a decision.
    pub(crate) fn moved(&self, turn: u64) -> Self {
        Self::moved_by(self.style, self.seed, Some(turn))
    }

    fn moved_by(style: u64, seed: u64, turn: Option<u64>) -> Self {
        let mut random = Random(seed.wrapping_mul(0x2545_f491_4f6c_dd1d) ^ style);
        let mut noise = turn.map(|turn| Random(turn.wrapping_add(seed << 8)));
        let splatting = splatting(&mut Random(style), &mut random);
        let gradient = Random(style ^ 0x1234).pick(&[Gradient::Differences, Gradient::Kernel]);
        // It has an effect after splatting alone.
        let is_after = splatting.classification == Classification::After;
        let gradient = if is_after { gradient } else { Gradient::Differences };
        // In homogeneous matter rounding decides the direction of the kernel's gradient.
        let texture = if gradient == Gradient::Kernel { 0.02 } else { 0.0 };
        let volume = random_volume(&mut random, texture, noise.as_mut());
        let mut scene = scene(style, &mut random, &volume, splatting);
        scene.shading.gradient = gradient;
        if let Some(noise) = &mut noise {
            move_camera(&mut scene, volume.grid(), noise);
        }
        Self { volume, scene, style, seed }
    }

    /// Everything that repeats the scene.
    pub(crate) fn describe(&self) -> String {
        let Self { volume, scene, style, seed } = self;
        let toml = scene.to_toml(Path::new("")).unwrap();
        let (dims, spacing, channels) = (volume.dims(), volume.spacing(), volume.channels().count());
        format!("Case::new({style}, {seed}): {dims} voxels, spacing {spacing}, {channels} channels\n{toml}")
    }
}

/// A random number with a uniform logarithm.
fn logarithmic(random: &mut Random, low: f64, high: f64) -> f64 {
    // Functions of a crate, so that every machine has the same scene.
    let steps = libm::log2(high / low);
    (low * libm::exp2(random.uniform(0.0, steps))).clamp(low, high)
}

fn one_in(random: &mut Random, count: u64) -> bool {
    random.bits().is_multiple_of(count)
}

fn color(random: &mut Random) -> DVec3 {
    random.within(DVec3::ZERO, DVec3::ONE)
}

/// Settings of splatting. Those that a GPU compiles pipelines for come from the style.
fn splatting(style: &mut Random, random: &mut Random) -> Splatting {
    let (before, after) = (Classification::Before, Classification::After);
    let classification = style.pick(&[before, after]);
    let compositing = style.pick(&[&COMPOSITINGS[..], &[Compositing::Linear, Compositing::Exponential]].concat());
    let aligned = Method::ImageAligned;
    let methods = [aligned, aligned, aligned, aligned, Method::AxisAligned, Method::CompositeEverySample];
    let method = if classification == after { aligned } else { style.pick(&methods) };
    let method = if compositing.is_by_means() && method == Method::CompositeEverySample { aligned } else { method };
    let order = style.pick(&[Order::FrontToBack, Order::FrontToBack, Order::BackToFront]);
    let order = if compositing == Compositing::Surface { Order::FrontToBack } else { order };
    let (rectangle, parallelogram) = (FootprintBox::Rectangle, FootprintBox::Parallelogram);
    let any = random.uniform(1.0, 4.0);
    let falloff = logarithmic(random, 0.02, 16.0);
    // By a generator of its own, so that older cases stay.
    let slab_profile = Random(random.0 ^ 0x2545_f491_4f6c_dd1d).pick(&[SlabProfile::Cubic, SlabProfile::Linear]);
    let mut splatting = Splatting {
        method,
        classification,
        slab_profile,
        compositing,
        order,
        radius: random.pick(&[1.0, 2.0, 2.0, any, any, 4.0]),
        falloff: random.pick(&[2.0, 2.0, falloff, falloff, 0.001, 16.0]),
        slab_width: logarithmic(random, 0.05, 8.0),
        opacity_threshold: random.uniform(0.2, 1.0),
        tiles: !one_in(random, 4),
        footprint_box: style.pick(&[rectangle, rectangle, parallelogram]),
        ..Splatting::default()
    };
    if classification == after {
        splatting.falloff = splatting.falloff.min(11.0);
        splatting.interpolation = style.pick(&[Interpolation::Smooth, Interpolation::Exact]);
        // Exact coefficients exist for narrow kernels only.
        for falloff in [1.0, 2.0, 4.0, 8.0].into_iter().filter(|_| splatting.interpolation == Interpolation::Exact) {
            if splatting.check().is_err() {
                splatting.falloff = falloff;
            }
        }
    }
    splatting
}

/// A volume of random shapes, sizes, spacings and values, sometimes with holes, labels, channels or colours.
fn random_volume(random: &mut Random, texture: f64, mut noise: Option<&mut Random>) -> Volume {
    let ratio = random.pick(&[1.0, 1.0, 1.5, 3.0, 5.0, 10.0, 20.0]);
    let axis = random.bits() as usize % 3;
    let mut dims = [(); 3].map(|()| random.uniform(3.0, 13.0) as u32);
    let mut spacing = [random.uniform(1.0, 1.3); 3];
    spacing[axis] *= ratio;
    if ratio > 2.0 {
        dims[axis] = (dims[axis] as f64 / ratio).ceil() as u32 + 1;
    }
    if one_in(random, 12) {
        dims[random.bits() as usize % 3] = random.pick(&[1, 2]);
    }
    let (dims, spacing) = (UVec3::from(dims), DVec3::from(spacing) * logarithmic(random, 0.01, 100.0));
    let kind = random.bits() % 16;
    if kind == 0 {
        return colors(random, noise, dims, spacing);
    }
    let count = if kind < 3 { random.uniform(2.0, 4.0) as usize } else { 1 };
    let mut channels: Vec<Volume> =
        (0..count).map(|_| values(random, texture, noise.as_deref_mut(), (dims, spacing))).collect();
    let first = channels.remove(0);
    if count > 1 {
        return first.with_channels("random", channels).unwrap();
    }
    if kind == 3 {
        let labels = (0..dims.element_product()).map(|_| (random.bits() % 4) as u16).collect();
        let labels =
            Labels { origin: "labels".to_owned(), dims, spacing: None, values: labels, names: BTreeMap::new() };
        return first.with_labels(labels).unwrap();
    }
    first
}

/// Noise, balls, waves, or plateaus, of any range of values, sometimes with holes.
fn values(
    random: &mut Random,
    texture: f64,
    mut noise: Option<&mut Random>,
    (dims, spacing): (UVec3, DVec3),
) -> Volume {
    let kind = random.bits() % 4;
    let scale = random.pick(&[1.0, 255.0, 255.0, 65535.0]);
    let least = scale * random.pick(&[0.0, 0.0, -0.5, 3.0]);
    let balls: Vec<(DVec3, f64)> =
        (0..3).map(|_| (random.within(DVec3::ZERO, dims.as_dvec3()), random.uniform(1.0, 6.0))).collect();
    let wave = random.within(DVec3::splat(-1.0), DVec3::splat(1.0));
    let holes = if one_in(random, 8) { random.pick(&[3, 11, 101]) } else { u64::MAX };
    let grid = Grid::new(dims, spacing);
    let value = |index| {
        let p = grid.voxel_at(index).as_dvec3();
        let inside = balls.iter().any(|(center, radius)| p.distance(*center) < *radius);
        let share = match kind {
            0 => random.uniform(0.0, 1.0),
            1 if inside => random.uniform(0.6, 1.0),
            1 => random.uniform(0.0, 0.1),
            2 => 0.5 + 0.5 * libm::sin(wave.dot(p)),
            _ if inside => 0.75,
            _ => 0.25 * f64::from(grid.voxel_at(index).x % 2),
        };
        let share = share + texture * random.uniform(0.0, 1.0);
        let share = share + noise.as_mut().map_or(0.0, |noise| NEAR * noise.uniform(-1.0, 1.0));
        let is_hole = index > 0 && random.bits() % holes == 1;
        if is_hole { f32::NAN } else { (least + scale * share) as f32 }
    };
    Volume::new("random", dims, spacing, (0..dims.element_product()).map(value).collect()).unwrap()
}

fn colors(random: &mut Random, mut noise: Option<&mut Random>, dims: UVec3, spacing: DVec3) -> Volume {
    let kind = random.pick(&[SampleType::U8, SampleType::F32]);
    let most = if kind == SampleType::U8 { 255.0 } else { 1.0 };
    let mut number = |least: f64| {
        let share = random.uniform(least, 1.0) + noise.as_mut().map_or(0.0, |noise| NEAR * noise.uniform(-1.0, 0.0));
        (share.max(0.0) * most) as f32
    };
    let colors: Vec<[f32; 4]> =
        (0..dims.element_product()).map(|_| [number(0.0), number(0.0), number(0.0), number(0.5)]).collect();
    Volume::from_colors("random", dims, spacing, (&colors, kind)).unwrap()
}

fn scene(style: u64, random: &mut Random, volume: &Volume, mut splatting: Splatting) -> Scene {
    let mut style = Random(style ^ 0x5851_f42d_4c95_7f2d);
    let grid = volume.grid();
    let size = [(); 2].map(|()| random.uniform(24.0, 40.0) as u32);
    let is_perspective = one_in(&mut style, 2);
    let camera = camera(random, grid, splatting.radius, is_perspective);
    let extent = 2.0 * grid.bounding_radius(splatting.radius) / grid.unit();
    splatting.slab_width = splatting.slab_width.max(extent / MOST_SLABS).min(8.0);
    let background = if one_in(random, 2) { [0.0, 0.0, 0.0, 1.0] } else { [(); 4].map(|()| random.uniform(0.0, 1.0)) };
    let image = ImageSettings { width: size[0], height: size[1], background };
    let every = Method::CompositeEverySample;
    let direction = random.direction() * logarithmic(random, 0.001, 1000.0);
    let shading = Shading {
        enabled: !one_in(&mut style, 4),
        ambient: random.pick(&[0.2, 0.0, 1.5]),
        diffuse: random.uniform(0.0, 1.5),
        specular: random.uniform(0.0, 1.5),
        shininess: logarithmic(random, 0.1, 300.0),
        light: match random.pick(&[Light::Headlight, Light::Headlight, Light::Direction(direction)]) {
            // By a generator of its own, so that older cases stay.
            Light::Headlight => Random(random.0 ^ 0x6c69_6768_7421).pick(&[Light::Headlight, Light::UpperLeft]),
            light => light,
        },
        ..Shading::default()
    };
    let clip = if splatting.method == every { Clip::default() } else { clip(random, grid) };
    let mut transfers: Vec<TransferSettings> =
        volume.channels().map(|channel| transfer(random, channel, splatting.compositing)).collect();
    if volume.labels().is_some() {
        transfers[0].labels = label_tables(random, volume, splatting.compositing);
    }
    let channels = transfers.into_iter().map(|transfer| {
        let mut channel = Channel::new(VolumeSource::Memory);
        channel.transfer = transfer;
        channel
    });
    let channels = Channels::of(channels).unwrap();
    Scene { channels, image, camera, clip, shading, splatting, ..Scene::new(VolumeSource::Memory) }
}

/// An orthographic camera close by or far off, or an eye far off, near, or within the volume.
fn camera(random: &mut Random, grid: &Grid, radius: f64, is_perspective: bool) -> Camera {
    let sphere = grid.bounding_radius(radius);
    let half = grid.center() * grid.spacing;
    let mut direction = random.direction();
    if one_in(random, 8) {
        direction = random.pick(&DVec3::AXES) * random.pick(&[1.0, -1.0]);
    }
    let up = loop {
        let up = random.direction();
        if up.dot(direction).abs() < 0.999 {
            break up;
        }
    };
    let center = random.within(-half, half) * 0.6;
    let projection = if is_perspective {
        let fov_y = random.pick(&[20.0, 45.0, 90.0, 140.0]) + random.uniform(-10.0, 10.0);
        let whole = sphere / libm::sin(fov_y.to_radians() / 2.0);
        let distance = random.pick(&[0.2 * sphere, 0.6 * sphere, 0.6 * whole, whole, whole, 2.0 * whole]);
        let distance = distance * random.uniform(0.7, 1.0);
        let near = random.pick(&[None, Some(0.01 * sphere), Some(0.4 * distance), Some(2.5 * grid.unit())]);
        Projection::Perspective { fov_y, distance: Some(distance), near }
    } else {
        let share = random.pick(&[0.15, 0.4, 0.6, 1.0, 1.0, 3.0]) * random.uniform(0.7, 1.0);
        Projection::Orthographic { height: Some(2.0 * sphere * share) }
    };
    let center = if one_in(random, 3) { None } else { Some(center) };
    Camera { projection, direction: direction * logarithmic(random, 0.01, 100.0), up, center, ..Camera::default() }
}

fn move_camera(scene: &mut Scene, grid: &Grid, noise: &mut Random) {
    let camera = &mut scene.camera;
    let pixel = match camera.projection {
        Projection::Orthographic { height } => height.unwrap_or(grid.unit()) / f64::from(scene.image.height),
        Projection::Perspective { .. } => grid.unit(),
    };
    camera.center = Some(camera.middle() + NEAR * pixel * noise.direction());
}

/// Planes and boxes, in a third of the scenes.
fn clip(random: &mut Random, grid: &Grid) -> Clip {
    let half = grid.center() * grid.spacing + 0.5 * grid.spacing;
    let mut clip = Clip::default();
    if one_in(random, 4) {
        clip.planes = (0..1 + random.bits() % 3)
            .map(|_| {
                let normal = random.direction() * logarithmic(random, 0.1, 10.0);
                let reach = normal.abs().dot(half);
                [normal.x, normal.y, normal.z, reach * random.uniform(0.0, 0.8)]
            })
            .collect();
    }
    if one_in(random, 6) {
        clip.crop = Some([-half * random.uniform(0.2, 1.1), half * random.uniform(0.2, 1.1)]);
    }
    // A generator of its own, so that scenes stay the same but for this.
    clip.shade_faces = one_in(&mut Random(random.0 ^ 0x51ab), 2);
    clip
}

/// Rising positions over a range and a little beyond it.
fn positions(random: &mut Random, [low, high]: [f64; 2]) -> Vec<f64> {
    let margin = 0.2 * (high - low);
    let count = random.pick(&[1, 2, 2, 3, 4, 8, 20]);
    let mut positions: Vec<f64> = (0..count).map(|_| random.uniform(low - margin, high + margin)).collect();
    positions.sort_by(f64::total_cmp);
    positions.dedup();
    positions
}

fn transfer(random: &mut Random, volume: &Volume, compositing: Compositing) -> TransferSettings {
    let values = || volume.values().iter().filter(|value| value.is_finite()).map(f64::from);
    let [low, high] = values().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)]);
    let range = [low, if high > low { high } else { low + 1.0 }];
    let colors = positions(random, range).into_iter().map(|at| (at, color(random))).collect();
    let mut settings = TransferSettings { color: Some(Ramp::new(colors).unwrap()), ..TransferSettings::default() };
    settings.opacity = Some(opacities(random, range, compositing));
    if one_in(random, 4) {
        let steepest = (range[1] - range[0]) / volume.spacing().min_element();
        settings.gradient_opacity = Some(opacities(random, [0.0, steepest], Compositing::Maximum));
    }
    if one_in(random, 5) {
        let ranges = (0..1 + random.bits() % 3).map(|_| {
            let [a, b] = [(); 2].map(|()| random.uniform(range[0], range[1]));
            if one_in(random, 2) { [a, range[1] + 1.0] } else { [a.min(b), a.max(b)] }
        });
        settings.iso_ranges = Some(ranges.collect());
    }
    settings
}

/// Anything from haze to solid matter, with and without gaps, and enough of it for a compositing to show it.
fn opacities(random: &mut Random, range: [f64; 2], compositing: Compositing) -> Ramp<f64> {
    let is_gradual = matches!(compositing, Compositing::Linear | Compositing::Exponential | Compositing::Xray);
    let most = if is_gradual { random.pick(&[0.05, 0.3, 1.0, 1.0]) } else { 1.0 };
    let gaps = if compositing == Compositing::Minimum { u64::MAX } else { random.pick(&[3, u64::MAX]) };
    let positions = positions(random, range);
    let opacity = |at| (at, if random.bits() % gaps == 1 { 0.0 } else { most * random.uniform(0.2, 1.0) });
    Ramp::new(positions.into_iter().map(opacity).collect()).unwrap()
}

fn label_tables(random: &mut Random, volume: &Volume, compositing: Compositing) -> BTreeMap<u64, LabelTables> {
    let shown = transfer(random, volume, compositing);
    let shown = LabelTables { color: shown.color, opacity: shown.opacity, ..LabelTables::default() };
    BTreeMap::from([(1, shown), (2, LabelTables { visible: false, ..LabelTables::default() })])
}
