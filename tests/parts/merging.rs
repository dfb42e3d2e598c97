//! Parts of a frame against the whole of it.

use std::sync::{Arc, LazyLock};

use glam::{DVec3, UVec3};
use sheetsplat::cpu::CpuRenderer;
use sheetsplat::headless::{Backend, Headless, HeadlessOptions};
use sheetsplat::part::{Content, Extreme};
use sheetsplat::scene::{Channel, Scene, VolumeSource};
use sheetsplat::settings::{
    Classification, Compositing, Fit, Interpolation, Order, Projection, Ramp, Rasterizer, Region, Window,
};
use sheetsplat::volume::{Volume, builtin};
use sheetsplat::{Image, Part};

use crate::common::compare::{assert_at_least, assert_at_most};
use crate::common::images::largest_difference;
use crate::common::pool::{Lent, Pool};
use crate::common::{COMPOSITINGS, scene};

/// By how much a merged image may differ from the whole one (SPEC §11).
const ALLOWED: f64 = 1e-6;

/// The renderer of a backend.
pub(crate) fn headless(backend: Backend) -> &'static Headless {
    static GPUS: Pool<Headless> = Pool::new();
    static CPU: LazyLock<Headless> = LazyLock::new(|| new(Backend::Cpu));
    static REFERENCE: LazyLock<Headless> = LazyLock::new(|| new(Backend::Reference));
    thread_local!(static GPU: Lent<Headless> = GPUS.lend(|| new(Backend::Gpu)));
    fn new(backend: Backend) -> Headless {
        Headless::new(&HeadlessOptions::default().with_backend(backend)).unwrap()
    }
    match backend {
        Backend::Gpu => GPU.with(|lent| lent.thing),
        Backend::Cpu => &CPU,
        Backend::Reference => &REFERENCE,
        _ => panic!("{backend:?} is no backend that tests name"),
    }
}

/// A head from a slanted direction, where nothing is culled before a pixel is wholly opaque.
pub(crate) fn head(size: u32, [width, height]: [u32; 2]) -> (Arc<Volume>, Scene) {
    let mut scene = scene(width, height);
    let volume = builtin::volume(&format!("head:{size}")).unwrap();
    scene.camera.direction = DVec3::new(0.4, 0.9, -0.3);
    scene.camera.fit = Fit::Object;
    // Even air is seen, so that minima and averages are not empty.
    scene.channels[0].transfer.color =
        Some(Ramp::new(vec![(0.0, DVec3::new(0.3, 0.5, 0.9)), (255.0, DVec3::new(1.0, 0.8, 0.4))]).unwrap());
    scene.channels[0].transfer.opacity = Some(Ramp::new(vec![(0.0, 0.02), (60.0, 0.05), (255.0, 0.7)]).unwrap());
    scene.image.background = [0.2, 0.4, 0.6, 0.5];
    scene.splatting.opacity_threshold = 1.0;
    (Arc::new(volume), scene)
}

/// Four regions of an image, divided off its middle and off the edges of tiles.
fn quarters([width, height]: [u32; 2]) -> [Region; 4] {
    let (x, y) = (width * 2 / 5 + 1, height / 3 + 2);
    [[0, 0, x, y], [x, 0, width - x, y], [0, y, x, height - y], [x, y, width - x, height - y]]
        .map(|[x, y, width, height]| Region { x, y, width, height })
}

/// The slabs of a scene.
fn slabs(headless: &Headless, volume: &Arc<Volume>, scene: &Scene) -> std::ops::Range<i32> {
    let mut view = headless.view(Arc::clone(volume), scene).unwrap();
    let window = Window { slabs: 0..0, region: Region { x: 0, y: 0, width: 1, height: 1 } };
    headless.draw_part(&mut view, &window).unwrap().0.identity.slabs
}

/// All parts of an image: some slab ranges of each of four regions. The outer ones reach beyond the scene's slabs.
pub(crate) fn parts(headless: &Headless, volume: &Arc<Volume>, scene: &Scene, ranges: i32) -> Vec<Part> {
    let all = slabs(headless, volume, scene);
    assert!(all.len() as i32 > 2 * ranges, "{all:?}");
    let mut view = headless.view(Arc::clone(volume), scene).unwrap();
    let cut = |at: i32| match at {
        0 => all.start - 7,
        at if at == ranges => all.end + 3,
        at => all.start + all.len() as i32 * at / ranges,
    };
    let windows = quarters([scene.image.width, scene.image.height])
        .into_iter()
        .flat_map(|region| (0..ranges).map(move |at| Window { slabs: cut(at)..cut(at + 1), region }));
    windows.map(|window| headless.draw_part(&mut view, &window).unwrap().0).collect()
}

/// Merges some slab ranges of 4 regions, and compares them with the whole image.
pub(crate) fn compare(backend: Backend, volume: &Arc<Volume>, scene: &Scene) {
    let headless = headless(backend);
    let whole = headless.render_volume(Arc::clone(volume), scene).unwrap().image;
    let ranges = if backend == Backend::Gpu { 3 } else { 8 };
    let mut parts = parts(headless, volume, scene, ranges);
    // The order in which parts are given does not matter.
    parts.reverse();
    parts.swap(3, 7);
    let merged = Image::merge(parts).unwrap();
    let what = format!("{backend} {:?}", scene.splatting);
    let shown = whole.pixels.iter().filter(|pixel| **pixel != whole.pixels[0]).count();
    assert_at_least(shown as f64 / whole.pixels.len() as f64, 0.08, &what);
    assert_at_most(largest_difference(&merged, &whole), ALLOWED, what);
}

fn scenes(compositing: Compositing, classification: Classification, size: u32) -> [(Arc<Volume>, Scene); 2] {
    let perspective = Projection::Perspective { fov_y: 40.0, distance: None, near: None };
    let other = if compositing == Compositing::Surface { Order::FrontToBack } else { Order::BackToFront };
    let views = [(Projection::Orthographic { height: None }, Order::FrontToBack), (perspective, other)];
    let of_view = |(projection, order)| {
        let (volume, mut scene) = head(size, [size + 13, size + 5]);
        scene.camera.projection = projection;
        scene.splatting.order = order;
        scene.splatting.compositing = compositing;
        scene.splatting.classification = classification;
        if compositing == Compositing::Surface {
            scene.channels[0].transfer.opacity = Some(Ramp::new(vec![(0.0, 0.0), (40.0, 0.7), (255.0, 0.9)]).unwrap());
        }
        (volume, scene)
    };
    views.map(of_view)
}

#[test]
fn parts_of_every_compositing_merge() {
    for compositing in COMPOSITINGS {
        for (volume, scene) in scenes(compositing, Classification::Before, 24) {
            compare(Backend::Cpu, &volume, &scene);
        }
    }
}

#[test]
fn parts_classified_after_splatting_merge() {
    for compositing in COMPOSITINGS {
        for (volume, mut scene) in scenes(compositing, Classification::After, 24) {
            // Coefficients reach further than values.
            let is_exact = scene.camera.projection != Projection::Orthographic { height: None };
            scene.splatting.interpolation = if is_exact { Interpolation::Exact } else { Interpolation::Smooth };
            // Among values that count as equal, as in homogeneous matter, another part's point may be chosen, with another gradient.
            scene.shading.enabled = !matches!(compositing, Compositing::Minimum | Compositing::Maximum);
            compare(Backend::Cpu, &volume, &scene);
        }
    }
}

/// A scene's volume with a second channel of waves, whose colours differ.
fn with_channel((volume, mut scene): (Arc<Volume>, Scene)) -> (Arc<Volume>, Scene) {
    let wave = |index: u32| (volume.grid().voxel_at(index).as_dvec3().element_sum() * 0.9).sin() as f32;
    let waves = (0..volume.dims().element_product()).map(|index| 100.0 + 90.0 * wave(index)).collect();
    let second = Volume::new("waves", volume.dims(), volume.spacing(), waves).unwrap();
    let mut channel = Channel::new(VolumeSource::Memory);
    channel.transfer = scene.channels[0].transfer.clone();
    channel.transfer.color = Some(Ramp::new(vec![(0.0, DVec3::X), (200.0, DVec3::Y)]).unwrap());
    scene.channels.push(channel);
    (Arc::new(Volume::clone(&volume).with_channels("test", vec![second]).unwrap()), scene)
}

#[test]
fn parts_of_several_channels_merge() {
    use Compositing::{Average, Exponential, Linear, Maximum, Minimum, Surface, Xray};
    for classification in [Classification::Before, Classification::After] {
        for compositing in [Linear, Exponential, Xray, Surface, Maximum, Minimum, Average] {
            for (volume, mut scene) in scenes(compositing, classification, 24).map(with_channel) {
                scene.shading.enabled = !matches!(compositing, Minimum | Maximum);
                compare(Backend::Cpu, &volume, &scene);
            }
        }
    }
}

const SOME: Window = Window { slabs: 0..2, region: Region { x: 0, y: 0, width: 4, height: 4 } };

/// Of the surfaces of several channels the nearest one is that of the nearest part that has one.
#[test]
fn parts_of_the_nearest_surfaces_merge() {
    for (volume, mut scene) in scenes(Compositing::Surface, Classification::After, 24).map(with_channel) {
        // Both channels are seen.
        let alone = |number: usize| {
            let mut scene = scene.clone();
            let nothing = Some(Ramp::new(vec![(0.0, 0.0)]).unwrap());
            match number {
                0 => scene.channels[0].transfer.opacity = nothing,
                _ => scene.channels[1].transfer.opacity = nothing,
            }
            headless(Backend::Cpu).render_volume(Arc::clone(&volume), &scene).unwrap().image
        };
        let both = headless(Backend::Cpu).render_volume(Arc::clone(&volume), &scene).unwrap().image;
        assert!([0, 1].iter().all(|&number| largest_difference(&both, &alone(number)) > 0.2));
        compare(Backend::Reference, &volume, &scene);
        for rasterizer in [Rasterizer::Quads, Rasterizer::Tiles] {
            scene.splatting.rasterizer = rasterizer;
            compare(Backend::Gpu, &volume, &scene);
        }
        let drawn = parts(headless(Backend::Cpu), &volume, &scene, 2);
        assert!(drawn.iter().all(|part| (part.identity.images, part.contents.len()) == (1, 1)));
    }
}

/// Where channels share no sheets, a part has pixels for each, and every backend draws them.
#[test]
fn parts_of_images_that_add_up_merge() {
    let cases = [
        (Compositing::Maximum, Classification::Before),
        (Compositing::Minimum, Classification::After),
        (Compositing::Average, Classification::Before),
        (Compositing::Average, Classification::After),
    ];
    for (compositing, classification) in cases {
        let [(volume, mut scene), _] = scenes(compositing, classification, 24).map(with_channel);
        scene.shading.enabled = false;
        for backend in [Backend::Gpu, Backend::Reference] {
            compare(backend, &volume, &scene);
        }
        let drawn = parts(headless(Backend::Cpu), &volume, &scene, 2);
        assert!(drawn.iter().all(|part| (part.identity.images, part.contents.len()) == (2, 2)));
        let counts = |content: &Content| {
            let has_points = content.extremes.iter().any(|extreme| extreme.counted >= Extreme::POINT);
            has_points || content.extremes.is_empty() && content.colors.iter().any(|color| color[3] > 0.0)
        };
        assert!(drawn.iter().any(|part| part.contents.iter().all(counts)), "{compositing:?}");
        // In files, too.
        let folder = tempfile::tempdir().unwrap();
        let reopened = ["part.exr", "part.npz"].map(|name| {
            drawn[0].save(&folder.path().join(name)).unwrap();
            Part { name: drawn[0].name.clone(), ..Part::open(&folder.path().join(name)).unwrap() }
        });
        assert!(reopened.iter().all(|part| *part == drawn[0]));
        // A channel without opacity changes nothing.
        scene.channels[1].transfer.opacity = Some(Ramp::new(vec![(0.0, 0.0)]).unwrap());
        compare(Backend::Cpu, &volume, &scene);
        let mut short = parts(headless(Backend::Cpu), &volume, &scene, 2);
        short[1].contents.truncate(1);
        let message = Image::merge(short).unwrap_err().to_string();
        assert!(message.contains("images of channels: found 1, allowed: 2"), "{message}");
        // A view of another backend is refused, as it is elsewhere.
        let mut view = headless(Backend::Reference).view(Arc::clone(&volume), &scene).unwrap();
        let message = headless(Backend::Cpu).draw_part(&mut view, &SOME).unwrap_err().to_string();
        assert!(message.starts_with("view: found one of the reference backend"), "{message}");
        // What draws all channels at once refuses it.
        let message = CpuRenderer::new(volume, &scene).unwrap().draw_part(&SOME).unwrap_err().to_string();
        assert!(message.contains("of several channels for a part of an image"), "{message}");
    }
}

/// A file that could not be opened again is not begun.
#[test]
fn parts_of_too_many_images_are_refused() {
    let channel =
        || Volume::new("test", UVec3::splat(2), DVec3::ONE, vec![0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]).unwrap();
    let volume = channel().with_channels("test", (0..256).map(|_| channel()).collect()).unwrap();
    let (_, mut scene) = head(8, [16, 16]);
    scene.splatting.compositing = Compositing::Maximum;
    let headless = headless(Backend::Reference);
    let mut view = headless.view(volume, &scene).unwrap();
    let message = headless.draw_part(&mut view, &SOME).unwrap_err().to_string();
    assert_eq!(
        message,
        "volume: found 257 channels whose images are added up for a part of an image, allowed: at most 256"
    );
}

/// In homogeneous matter sheets are equal but for the order in which they are added up, which parts do not change.
#[test]
fn parts_choose_among_equal_sheets_as_the_whole_does() {
    for compositing in [Compositing::Maximum, Compositing::Minimum] {
        for (volume, mut scene) in scenes(compositing, Classification::Before, 40) {
            let opacity = if compositing == Compositing::Minimum { [0.6, 0.3] } else { [0.0, 0.6] };
            scene.channels[0].transfer.opacity = Some(Ramp::new(vec![(30.0, opacity[0]), (50.0, opacity[1])]).unwrap());
            // Along an axis every slab holds the same sections.
            scene.camera.direction = DVec3::Y;
            compare(Backend::Cpu, &volume, &scene);
        }
    }
}

fn parts_of_the_gpu_merge(rasterizer: Rasterizer, classification: Classification) {
    for compositing in COMPOSITINGS {
        // Every other compositing in perspective, and back to front.
        for (volume, mut scene) in
            scenes(compositing, classification, 24).into_iter().skip(compositing as usize % 2).take(1)
        {
            scene.splatting.rasterizer = rasterizer;
            scene.shading.enabled = !matches!(compositing, Compositing::Minimum | Compositing::Maximum);
            compare(Backend::Gpu, &volume, &scene);
        }
    }
}

#[test]
fn parts_of_quads_merge() {
    parts_of_the_gpu_merge(Rasterizer::Quads, Classification::Before);
}

#[test]
fn parts_of_quads_classified_after_splatting_merge() {
    parts_of_the_gpu_merge(Rasterizer::Quads, Classification::After);
}

#[test]
fn parts_of_tiles_merge() {
    parts_of_the_gpu_merge(Rasterizer::Tiles, Classification::Before);
}

#[test]
fn parts_of_tiles_classified_after_splatting_merge() {
    parts_of_the_gpu_merge(Rasterizer::Tiles, Classification::After);
}

/// Parts of the GPU and of the CPU belong to one image, and a view draws whole images after parts.
#[test]
fn parts_of_all_backends_merge() {
    for compositing in [Compositing::Linear, Compositing::Maximum] {
        let (volume, mut scene) = head(32, [50, 40]);
        scene.splatting.compositing = compositing;
        // With clip planes rays are cut anyway.
        scene.clip.planes = vec![[0.3, 1.0, 0.2, 3.0]];
        let [gpu, cpu] = [Backend::Gpu, Backend::Cpu].map(headless);
        let mut view = gpu.view(Arc::clone(&volume), &scene).unwrap();
        let before = gpu.draw(&mut view).unwrap().image;
        let mixed = parts(gpu, &volume, &scene, 4).into_iter().zip(parts(cpu, &volume, &scene, 4));
        let chosen = mixed.enumerate().map(|(at, (gpu, cpu))| if at % 3 == 0 { cpu } else { gpu });
        let merged = Image::merge(chosen).unwrap();
        assert_at_most(largest_difference(&merged, &before), 2e-5, format!("{compositing:?}"));
        let window = Window { slabs: -2..3, region: Region { x: 3, y: 5, width: 20, height: 9 } };
        gpu.draw_part(&mut view, &window).unwrap();
        assert_eq!(gpu.draw(&mut view).unwrap().image.pixels, before.pixels);
    }
}

#[test]
fn parts_of_the_twin_merge() {
    for compositing in COMPOSITINGS {
        for classification in [Classification::Before, Classification::After] {
            let [(volume, scene), _] = scenes(compositing, classification, 24);
            compare(Backend::Reference, &volume, &scene);
        }
    }
}

/// Culling within a part counts the part's own opacity, so that every channel is within 1 - T of the un-culled image.
#[test]
fn culled_parts_merge_within_the_threshold() {
    let (volume, mut scene) = head(48, [90, 70]);
    scene.splatting.opacity_threshold = 0.9;
    let headless = headless(Backend::Cpu);
    let merged = Image::merge(parts(headless, &volume, &scene, 3)).unwrap();
    scene.splatting.culling = false;
    let whole = headless.render_volume(Arc::clone(&volume), &scene).unwrap().image;
    let difference = largest_difference(&merged, &whole);
    assert_at_most(difference, 0.1, "T = 0.9");
    // Something was culled.
    assert_at_least(difference, 1e-4, "T = 0.9");
}

/// Pairs of neighbours merge into parts that give the bytes of the whole, and what cannot be joined is named.
#[test]
fn pairs_are_joined() {
    let (volume, mut scene) = head(32, [50, 40]);
    let headless = headless(Backend::Cpu);
    for compositing in COMPOSITINGS {
        scene.splatting.compositing = compositing;
        let parts = parts(headless, &volume, &scene, 5);
        let at_once = Image::merge(parts.clone()).unwrap();
        let mut joined = Vec::new();
        for region in parts.chunks(5) {
            let [a, b, c, d, e] = <[Part; 5]>::try_from(region.to_vec()).unwrap();
            let front = Part::join([b, a]).unwrap();
            assert_eq!(front.window.region, region[0].window.region);
            assert_eq!(front.window.slabs.end, region[1].window.slabs.end);
            joined.push(Part::join([Part::join([front, Part::join([c, d]).unwrap()]).unwrap(), e]).unwrap());
            // All at once they are the same.
            assert_eq!(joined.last().unwrap().contents, Part::join(region.to_vec()).unwrap().contents);
        }
        assert_eq!(Image::merge(joined).unwrap().pixels, at_once.pixels, "{compositing:?}");
        if compositing == Compositing::Linear {
            let error = Part::join([parts[0].clone(), parts[2].clone()]).unwrap_err().to_string();
            assert!(error.starts_with("parts: found none with slabs "), "{error}");
            let error = Part::join([parts[0].clone(), parts[6].clone()]).unwrap_err().to_string();
            assert!(error.contains(": region: found 21,0,"), "{error}");
            let error = Part::join([parts[0].clone(), parts[0].clone()]).unwrap_err().to_string();
            assert!(error.contains("allowed: parts that do not overlap"), "{error}");
            assert_eq!(Part::join([]).unwrap_err().to_string(), "parts: found none, allowed: all parts of one image");
        }
    }
}
