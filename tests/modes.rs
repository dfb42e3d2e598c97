//! Compositing by means (`splatting::Compositing`; SPEC is silent): whole frames by each rasterizer against the f64 twin, and what
//! maximum, minimum, average and surface must show, whatever the view. `cargo test --release --test modes -- --nocapture` prints what was
//! measured.
#![expect(clippy::unwrap_used, reason = "tests")]

#[expect(dead_code, reason = "not every file needs all of it")]
mod common;

use glam::{DVec3, UVec3};
use sheetsplat::camera::Projection;
use sheetsplat::clip::Clip;
use sheetsplat::error::RenderError;
use sheetsplat::headless::{Headless, HeadlessOptions, readback};
use sheetsplat::image::Image;
use sheetsplat::reference::{self, Host};
use sheetsplat::scene::Scene;
use sheetsplat::splatting::{Compositing, Method, Order};
use sheetsplat::stats::Counts;
use sheetsplat::view::View;
use sheetsplat::volume::{Volume, builtin};

use common::images::largest_difference;
use common::surfaces::{DepthRange, surfaces};
use common::{
    BY_MEANS, FORMS, RASTERIZERS, Random, SPACINGS, camera, gpu, lavapipe, random_eye, random_volume, scene, transfer,
};

/// Where an opacity, a slab's middle or a ray is on an edge, rounding may decide otherwise: in so many of the pixels.
const OUTLIERS: f64 = 0.001;

/// The share of pixels with a channel that differs by more.
fn share_off(a: &[[f32; 4]], b: &[[f32; 4]], by: f32) -> f64 {
    assert_eq!(a.len(), b.len());
    let is_off = |(a, b): &(&[f32; 4], &[f32; 4])| a.iter().zip(*b).any(|(a, b)| !((a - b).abs() <= by));
    a.iter().zip(b).filter(is_off).count() as f64 / a.len() as f64
}

/// Any view of any volume, from outside, beside or inside, cut or not.
fn random_case(random: &mut Random) -> (Volume, Scene) {
    let spacing = random.pick(&SPACINGS);
    let volume = random_volume(random, (6.0, 16.0), spacing);
    let mut scene = scene(random.uniform(20.0, 70.0) as u32, random.uniform(20.0, 60.0) as u32);
    scene.splatting.method = random.pick(&[Method::ImageAligned, Method::ImageAligned, Method::AxisAligned]);
    scene.camera.direction = random.direction();
    if random.bits().is_multiple_of(2) {
        scene.camera = random_eye(random, volume.grid());
    }
    let (haze, solid) = (random.pick(&[0.0, 0.02, 0.3]), random.pick(&[0.3, 0.9, 1.0]));
    // Voxels without opacity leave gaps.
    let opacity = [(10.0, 0.0), (20.0, haze), (200.0, solid)];
    scene.transfer = transfer(&[(0.0, [0.2, 0.5, 1.0]), (200.0, [1.0, 0.9, 0.8])], &opacity);
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

/// Depths of a host's wall before a part of the image.
fn wall(view: &View) -> Vec<f64> {
    let middle = view.rays().depth_of(DVec3::ZERO);
    let depth = |at: u32| match (at % view.size[0]) * 4 / view.size[0] {
        0 => (middle - 2.3).max(0.05),
        1 => (middle + 3.1).max(0.05),
        _ => f64::INFINITY,
    };
    (0..view.size[0] * view.size[1]).map(depth).collect()
}

/// Draws a frame, with its first hits in `unit`s if they were asked for.
fn draw(gpu: &Headless, volume: &Volume, scene: &Scene, first_hit: Option<f64>, walls: bool) -> (Image, Vec<f64>) {
    let unit = volume.grid().unit();
    let mut view = gpu.view(volume.clone(), scene).unwrap();
    view.set_first_hit(first_hit);
    if walls {
        let seen = view_of(volume, scene);
        let depths = wall(&seen);
        let range = DepthRange::Standard;
        view.set_surfaces(Some(surfaces(gpu, &seen, unit, range, [0.01, 1000.0], &depths, [1, 2])));
    }
    let image = gpu.draw(&mut view).unwrap().image;
    let hits = view.first_hits().map_or(Vec::new(), |texture| {
        let bytes = readback::texture(gpu.device(), gpu.queue(), texture).unwrap();
        bytemuck::pod_collect_to_vec::<_, f32>(&bytes).into_iter().map(|depth| f64::from(depth) / unit).collect()
    });
    (image, hits)
}

fn view_of(volume: &Volume, scene: &Scene) -> View {
    View::new(volume.grid(), &scene.camera, &scene.splatting, [scene.image.width, scene.image.height]).unwrap()
}

fn render(gpu: &Headless, volume: &Volume, scene: &Scene) -> (Image, Counts) {
    let rendering = gpu.render_volume(volume.clone(), scene).unwrap();
    (rendering.image, rendering.stats.counts)
}

#[test]
fn any_view_is_that_of_the_twin() {
    let gpu = gpu();
    let mut random = Random(2024);
    for compositing in BY_MEANS {
        let mut shown = 0;
        let mut off = [0.0; 2];
        const CASES: usize = 20;
        for case in 0..CASES {
            let (volume, mut scene) = random_case(&mut random);
            scene.splatting.compositing = compositing;
            let walls = random.bits().is_multiple_of(3);
            let first_hit = (compositing != Compositing::Minimum && case % 2 == 0).then(|| random.pick(&[0.05, 0.4]));
            if compositing != Compositing::Surface && first_hit.is_none() {
                scene.splatting.order = random.pick(&[Order::FrontToBack, Order::BackToFront]);
            }
            let depths = walls.then(|| wall(&view_of(&volume, &scene)));
            let host = Host { surfaces: depths.as_deref(), first_hit };
            let expected =
                reference::render_for(host, &volume, &scene.transfer.resolve(&volume), &scene, None).unwrap();
            let background = expected.image.pixels.iter().filter(|pixel| {
                let [r, g, b, a] = scene.image.background;
                **pixel == [r * a, g * a, b * a, a].map(|channel| channel as f32)
            });
            shown += usize::from(background.count() + 100 < expected.image.pixels.len());
            for (rasterizer, off) in RASTERIZERS.into_iter().zip(&mut off) {
                scene.splatting.rasterizer = rasterizer;
                let (image, hits) = draw(&gpu, &volume, &scene, first_hit, walls);
                // Quads round amounts to f16.
                let share = share_off(&image.pixels, &expected.image.pixels, 2e-3);
                *off += share / CASES as f64;
                assert!(share <= 4.0 * OUTLIERS, "case {case}, {rasterizer:?}: {share} of the pixels with {scene:?}");
                assert_eq!(hits.len(), expected.first_hits.len());
                let is_off = |(hit, expected): &(&f64, &f64)| {
                    hit != expected && !((**hit - **expected).abs() / expected.abs().max(10.0) <= 1e-3)
                };
                let off = hits.iter().zip(&expected.first_hits).filter(is_off).count();
                assert!(
                    off <= hits.len() / 100,
                    "case {case}, {rasterizer:?}: {off} of {} hits with {scene:?}",
                    hits.len()
                );
            }
        }
        println!("{compositing:?}: {off:.5?} of the pixels are off by {RASTERIZERS:?}");
        assert!(off.iter().all(|&off| off <= OUTLIERS), "{compositing:?}: {off:?} of the pixels are off");
        assert!(shown >= CASES / 3, "{compositing:?}: only {shown} cases show much");
    }
}

/// What a constant volume is made of: opacity, and colour without shading.
const OPACITY: f64 = 0.3;
const COLOR: [f64; 3] = [0.2, 0.5, 0.9];

/// A constant volume, seen as a kernel reconstructs it that leaves no ripple.
fn constant(dims: [u32; 3], spacing: DVec3) -> (Volume, Scene) {
    let dims = UVec3::from(dims);
    let volume = Volume::new("constant", dims, spacing, vec![1.0; dims.element_product() as usize]).unwrap();
    let mut scene = scene(120, 108);
    scene.camera.up = DVec3::new(0.1, 0.2, 1.0);
    (scene.splatting.radius, scene.splatting.falloff) = (3.0, 1.0);
    scene.shading.enabled = false;
    scene.image.background = [0.0; 4];
    scene.transfer = transfer(&[(0.0, COLOR)], &[(0.0, OPACITY)]);
    (volume, scene)
}

/// Of a pixel's ray what lies in the box of half the given extent, grid steps: from where to where, grid steps from the volume's centre.
fn in_box(volume: &Volume, scene: &Scene, pixel: usize, half: DVec3) -> Option<[DVec3; 2]> {
    let (grid, rays, width) = (volume.grid(), view_of(volume, scene).rays(), scene.image.width as usize);
    let size = glam::DVec2::new(f64::from(scene.image.width), f64::from(scene.image.height));
    let place = glam::DVec2::new((pixel % width) as f64, (pixel / width) as f64) + 0.5 - size / 2.0;
    let [origin, end] = [0.0, 1.0].map(|depth| rays.at(place, depth) / grid.aspect());
    let (mut first, mut last) = (f64::NEG_INFINITY, f64::INFINITY);
    for axis in 0..3 {
        let at = [-half[axis], half[axis]].map(|plane| (plane - origin[axis]) / (end - origin)[axis]);
        (first, last) = (first.max(at[0].min(at[1])), last.min(at[0].max(at[1])));
    }
    (first < last).then(|| [first, last].map(|depth| origin + depth * (end - origin)))
}

/// Views of a constant volume: any direction, with an eye and without, sheets of any width and slices.
fn views_of_a_constant(random: &mut Random) -> Vec<(Volume, Scene)> {
    let mut views = Vec::new();
    for case in 0..12 {
        let spacing = DVec3::from(random.pick(&[[1.0, 1.0, 1.0], [1.0, 1.0, 2.0], [1.5, 2.0, 1.0]]));
        let (volume, mut scene) = constant([22, 20, 21], spacing);
        scene.camera.direction = if case == 0 { DVec3::Y } else { random.direction() };
        if case % 3 == 1 {
            scene.camera.projection = Projection::Perspective { fov_y: 20.0, distance: None, near: None };
        }
        if case % 4 == 3 {
            scene.splatting.method = Method::AxisAligned;
        }
        scene.splatting.slab_width = random.pick(&[0.4, 1.0, 1.7]);
        views.push((volume, scene));
    }
    views
}

#[test]
fn the_average_of_a_constant_is_the_constant() {
    let gpu = gpu();
    let (mut inside, mut brightest) = (0, 0.0_f64);
    for (volume, mut scene) in views_of_a_constant(&mut Random(5)) {
        scene.splatting.compositing = Compositing::Average;
        let (center, radius) = (volume.grid().center(), scene.splatting.radius);
        for rasterizer in RASTERIZERS {
            scene.splatting.rasterizer = rasterizer;
            let image = render(&gpu, &volume, &scene).0;
            for (at, pixel) in image.pixels.iter().enumerate() {
                let alpha = f64::from(pixel[3]);
                brightest = brightest.max(alpha / OPACITY);
                let Some(ends) = in_box(&volume, &scene, at, center + 0.5) else {
                    assert_eq!(alpha, 0.0, "pixel {at} is beside the volume: {scene:?}");
                    continue;
                };
                // Farther from the faces' edges than kernels reach, also of a ray that comes in slanted.
                let is_inside = |end: DVec3| {
                    (center + 0.5 - end.abs()).to_array().iter().filter(|&&step| step >= 1.5 * radius).count() == 2
                };
                if ends.into_iter().all(is_inside) {
                    inside += 1;
                    // f16 amounts by quads; and with an eye kernels are seen as along their own ray from everywhere.
                    let tolerance = if view_of(&volume, &scene).perspective.is_some() { 5e-3 } else { 2e-3 };
                    assert!((alpha / OPACITY - 1.0).abs() < tolerance, "pixel {at}: {alpha} with {scene:?}");
                    assert!((f64::from(pixel[2]) / alpha - COLOR[2]).abs() < 2e-3, "pixel {at}: {pixel:?}");
                }
            }
        }
    }
    println!("{inside} pixels, at most {brightest:.3} times the constant at edges");
    assert!(inside > 5000, "only {inside} pixels were compared");
    // Kernels blur the volume's edges; no edge outshines what is inside by more than that.
    assert!(brightest < 1.2, "{brightest} times the constant");
}

#[test]
fn the_minimum_of_a_constant_is_the_constant_inside() {
    let gpu = gpu();
    let mut inside = 0;
    for (volume, mut scene) in views_of_a_constant(&mut Random(6)) {
        scene.splatting.compositing = Compositing::Minimum;
        let complete = volume.grid().center() - scene.splatting.radius;
        // A middle may be a hundredth of a slab outside.
        let [within, around] = [complete - 0.1, complete + 0.1];
        for (rasterizer, order) in RASTERIZERS.into_iter().zip([Order::FrontToBack, Order::BackToFront]) {
            (scene.splatting.rasterizer, scene.splatting.order) = (rasterizer, order);
            let image = render(&gpu, &volume, &scene).0;
            for (at, pixel) in image.pixels.iter().enumerate() {
                let alpha = f64::from(pixel[3]);
                if in_box(&volume, &scene, at, within).is_some() {
                    inside += 1;
                    assert!((alpha / OPACITY - 1.0).abs() < 5e-3, "pixel {at}: {alpha} with {scene:?}");
                } else if in_box(&volume, &scene, at, around).is_none() {
                    assert_eq!(*pixel, [0.0; 4], "pixel {at}: {scene:?}");
                }
            }
        }
    }
    assert!(inside > 5000, "only {inside} pixels were compared");
}

/// The least opacity is 0 where there is anything without, wherever along the ray it is, and however little of the volume takes part.
#[test]
fn the_minimum_of_a_gap_is_nothing() {
    let gpu = gpu();
    for empty in [4..9, 20..60, 0..50, 12..60] {
        let (volume, mut scene) = constant([15, 60, 15], DVec3::ONE);
        let values: Vec<f32> = (0..volume.values().len() as u32)
            .map(|index| f32::from(!empty.contains(&volume.grid().voxel_at(index).y)))
            .collect();
        let volume = Volume::new("gap", volume.grid().dims, DVec3::ONE, values).unwrap();
        (scene.splatting.radius, scene.splatting.falloff) = (1.5, 2.0);
        scene.splatting.compositing = Compositing::Minimum;
        scene.transfer = transfer(&[(0.0, COLOR)], &[(0.0, 0.0), (1.0, OPACITY)]);
        scene.camera = camera([0.0, 1.0, 0.0], 20.0);
        for (rasterizer, order) in
            RASTERIZERS.into_iter().flat_map(|r| [Order::FrontToBack, Order::BackToFront].map(|order| (r, order)))
        {
            (scene.splatting.rasterizer, scene.splatting.order) = (rasterizer, order);
            scene.clip = Clip::default();
            let image = render(&gpu, &volume, &scene).0;
            assert!(image.pixels.iter().all(|pixel| *pixel == [0.0; 4]), "{empty:?} {rasterizer:?} {order:?}");
            // What is cut away is no gap.
            let side = |y: u32, sign: f64| [0.0, sign, 0.0, -sign * (f64::from(y) - 29.5 + sign)];
            let kept = if empty.end < 55 { side(empty.end + 1, 1.0) } else { side(empty.start - 2, -1.0) };
            scene.clip.planes = vec![kept];
            let image = render(&gpu, &volume, &scene).0;
            let alpha = image.pixels[54 * 120 + 60][3];
            assert!(alpha > 0.25, "{empty:?} {rasterizer:?} {order:?}: {alpha}");
        }
    }
}

/// The same where whole groups of sheets are empty, between others, before and behind them: nothing is drawn there.
#[test]
fn the_minimum_of_empty_groups_is_nothing() {
    let gpu = gpu();
    // By slabs of 8 and groups of 4: something in every slab of two groups, and nothing in that between them.
    for parts in [&[0..16, 52..100][..], &[0..16], &[52..100], &[0..100]] {
        let (volume, mut scene) = constant([9, 100, 9], DVec3::ONE);
        let value = |index| f32::from(parts.iter().any(|part| part.contains(&volume.grid().voxel_at(index).y)));
        let volume = Volume::new("parts", volume.grid().dims, DVec3::ONE, (0..8100).map(value).collect()).unwrap();
        scene.camera = camera([0.0, 1.0, 0.0], 4.0);
        (scene.splatting.radius, scene.splatting.falloff) = (2.0, 2.0);
        (scene.splatting.compositing, scene.splatting.slab_width) = (Compositing::Minimum, 8.0);
        scene.transfer = transfer(&[(0.0, COLOR)], &[(0.0, 0.0), (1.0, OPACITY)]);
        for (rasterizer, order) in
            RASTERIZERS.into_iter().flat_map(|r| [Order::FrontToBack, Order::BackToFront].map(|order| (r, order)))
        {
            (scene.splatting.rasterizer, scene.splatting.order) = (rasterizer, order);
            let image = render(&gpu, &volume, &scene).0;
            if parts[0].len() == 100 {
                let alpha = image.pixels[54 * 120 + 60][3];
                assert!(alpha > 0.25, "{rasterizer:?} {order:?}: {alpha}");
            } else {
                let is_empty = image.pixels.iter().all(|pixel| *pixel == [0.0; 4]);
                assert!(is_empty, "{parts:?} {rasterizer:?} {order:?}");
            }
        }
    }
}

/// Looked at from the other side a picture is mirrored.
#[test]
fn maximum_and_average_are_the_same_from_behind() {
    let gpu = gpu();
    let volume = builtin::volume("head:40").unwrap();
    let mut random = Random(77);
    for (compositing, rasterizer) in
        [Compositing::Maximum, Compositing::Average].into_iter().flat_map(|c| RASTERIZERS.map(|r| (c, r)))
    {
        for width in [0.5, 1.0, 2.0] {
            let mut scene = scene(70, 61);
            (scene.splatting.compositing, scene.splatting.rasterizer) = (compositing, rasterizer);
            scene.splatting.slab_width = width;
            scene.shading.enabled = false;
            scene.transfer = transfer(&[(0.0, [1.0, 0.7, 0.4])], &[(0.0, 0.0), (255.0, 1.0)]);
            let direction = random.direction();
            let [front, behind] = [direction, -direction].map(|direction| {
                scene.camera.direction = direction;
                render(&gpu, &volume, &scene).0
            });
            let mirrored = behind.pixels.chunks(70).flat_map(|row| row.iter().rev().copied()).collect();
            let difference = largest_difference(&front, &Image { pixels: mirrored, ..behind });
            assert!(difference < 1e-4, "{compositing:?} {rasterizer:?} {width}: {difference}");
            assert!(front.pixels.iter().filter(|pixel| pixel[0] > 0.02).count() > 300);
        }
    }
}

/// Half a volume of one opacity, half of none, cut by a plane between voxels.
fn step(opacity: f64) -> (Volume, Scene) {
    let (volume, mut scene) = constant([40, 40, 40], DVec3::ONE);
    let values = (0..64_000).map(|index| f32::from(volume.grid().voxel_at(index).y >= 20)).collect();
    let volume = Volume::new("step", volume.grid().dims, DVec3::ONE, values).unwrap();
    scene.camera = camera([0.2, 1.0, -0.3], 12.0);
    (scene.splatting.radius, scene.splatting.falloff) = (2.0, 2.0);
    scene.splatting.compositing = Compositing::Surface;
    scene.transfer = transfer(&[(0.0, [1.0, 0.0, 0.0]), (1.0, COLOR)], &[(0.0, 0.0), (1.0, opacity)]);
    (volume, scene)
}

/// The surface of a step is opaque, where the step is, and has the inside's colour; what never reaches one half shows nothing.
#[test]
fn the_surface_of_a_step() {
    let gpu = gpu();
    for (rasterizer, width) in RASTERIZERS.into_iter().flat_map(|r| [0.3, 1.0, 1.6].map(|width| (r, width))) {
        for projection in [None, Some(Projection::Perspective { fov_y: 12.0, distance: Some(60.0), near: None })] {
            let (volume, mut scene) = step(1.0);
            scene.camera.projection = projection.unwrap_or(scene.camera.projection);
            (scene.splatting.rasterizer, scene.splatting.slab_width) = (rasterizer, width);
            let mut view = gpu.view(volume, &scene).unwrap();
            view.set_first_hit(Some(0.7));
            let image = gpu.draw(&mut view).unwrap().image;
            for (at, pixel) in image.pixels.iter().enumerate() {
                let color = COLOR.map(|channel| channel as f32);
                let is_inside = pixel.iter().zip(color).all(|(a, b)| (a - b).abs() < 1e-3);
                assert!(is_inside && pixel[3] == 1.0, "pixel {at}: {pixel:?} with {scene:?}");
            }
            for pixel in [[60, 54], [6, 100], [110, 4]] {
                let pick = gpu.pick(&view, pixel).unwrap().unwrap();
                // Between the voxels before and behind it, as exactly as the mean grows evenly.
                assert!(pick.position.y.abs() < 0.1 * f64::max(width, 1.0), "{rasterizer:?}, {width}: {pick:?}");
            }
            // As far in as it is half as opaque.
            let (volume, mut scene) = step(0.6);
            (scene.splatting.rasterizer, scene.splatting.slab_width) = (rasterizer, width);
            let image = render(&gpu, &volume, &scene).0;
            assert!(image.pixels.iter().all(|pixel| pixel[3] == 1.0));
            let (volume, mut scene) = step(0.45);
            (scene.splatting.rasterizer, scene.splatting.slab_width) = (rasterizer, width);
            let image = render(&gpu, &volume, &scene).0;
            assert!(image.pixels.iter().all(|pixel| *pixel == [0.0; 4]));
        }
    }
}

/// Haze that a gap parts from a surface leaves no colour on it, though no sheet between them is composited.
#[test]
fn what_a_gap_parts_from_a_surface_does_not_count() {
    let gpu = gpu();
    let (volume, mut scene) = constant([9, 100, 9], DVec3::ONE);
    // By slabs of 8 and groups of 4: haze up to the end of one group, nothing in the next, and the surface in the first sheet after
    // that.
    let value = |index| match volume.grid().voxel_at(index).y {
        0..=15 => 1.0,
        52.. => 2.0,
        _ => 0.0,
    };
    let values = (0..8100).map(value).collect();
    let volume = Volume::new("haze", volume.grid().dims, DVec3::ONE, values).unwrap();
    scene.camera = camera([0.0, 1.0, 0.0], 4.0);
    (scene.splatting.radius, scene.splatting.falloff) = (2.0, 2.0);
    (scene.splatting.compositing, scene.splatting.slab_width) = (Compositing::Surface, 8.0);
    scene.transfer =
        transfer(&[(1.0, [1.0, 0.0, 0.0]), (2.0, [0.0, 0.0, 1.0])], &[(0.0, 0.0), (1.0, 0.45), (2.0, 0.9)]);
    let expected = reference::render(&volume, &scene.transfer.resolve(&volume), &scene).unwrap();
    for (rasterizer, tiles) in
        RASTERIZERS.into_iter().flat_map(|rasterizer| [true, false].map(|tiles| (rasterizer, tiles)))
    {
        (scene.splatting.rasterizer, scene.splatting.tiles) = (rasterizer, tiles);
        for pixels in [&expected, &render(&gpu, &volume, &scene).0].map(|image| &image.pixels) {
            let is_blue = |pixel: &[f32; 4]| pixel[3] == 1.0 && pixel[0] < 1e-6 && (pixel[2] - 1.0).abs() < 2e-3;
            assert!(pixels.iter().all(is_blue), "{rasterizer:?}, {tiles}: {:?}", pixels[6540]);
        }
    }
}

/// How far a surface by slabs as wide as voxels is from that by the thinnest. Taken as the first sheet of one half as it is, its colours are
/// those of other depths from ring to ring: 27 dB for the head, 27 for the waves.
#[test]
fn a_surface_has_no_rings() {
    let gpu = gpu();
    for (name, direction, opacity, least) in [
        ("head:40", [0.5, 0.85, -0.2], [(30.0, 0.0), (60.0, 1.0)], 31.0),
        ("marschner-lobb:40", [0.2, 0.7, -0.7], [(115.0, 0.0), (130.0, 0.9)], 28.0),
    ] {
        let volume = builtin::volume(name).unwrap();
        let mut scene = scene(128, 128);
        scene.camera.direction = DVec3::from(direction);
        scene.splatting.compositing = Compositing::Surface;
        scene.transfer =
            transfer(&[(20.0, [0.9, 0.3, 0.2]), (110.0, [0.8, 0.75, 0.3]), (200.0, [0.3, 0.5, 1.0])], &opacity);
        scene.image.background = [0.0; 4];
        for rasterizer in RASTERIZERS {
            scene.splatting.rasterizer = rasterizer;
            let [wide, thin] = [1.0, 0.05].map(|width| {
                scene.splatting.slab_width = width;
                render(&gpu, &volume, &scene).0.pixels
            });
            let (mut squares, mut count) = (0.0, 0);
            for (a, b) in wide.iter().zip(&thin).filter(|(a, b)| a[3] == 1.0 && b[3] == 1.0) {
                squares += (0..3).map(|channel| f64::from(a[channel] - b[channel]).powi(2)).sum::<f64>();
                count += 3;
            }
            let decibels = -10.0 * (squares / f64::from(count)).log10();
            println!("{name}, {rasterizer:?}: {decibels:.1} dB over {count} colours");
            assert!(count > 3000 && decibels > least, "{name}, {rasterizer:?}: {decibels:.1} dB");
        }
    }
}

/// Behind a surface everything is culled, and nothing changes.
#[test]
fn surfaces_cull_and_the_others_do_not() {
    let gpu = gpu();
    let volume = builtin::volume("head:48").unwrap();
    let mut scene = scene(100, 90);
    scene.camera.direction = DVec3::new(0.4, 0.8, -0.3);
    // Below what a surface that is not reached keeps.
    scene.splatting.opacity_threshold = 0.2;
    let projections = [scene.camera.projection, Projection::Perspective { fov_y: 40.0, distance: None, near: None }];
    for (compositing, projection) in
        BY_MEANS.into_iter().flat_map(|compositing| projections.map(|projection| (compositing, projection)))
    {
        (scene.splatting.compositing, scene.camera.projection) = (compositing, projection);
        for (rasterizer, footprint) in FORMS {
            (scene.splatting.rasterizer, scene.splatting.footprint) = (rasterizer, footprint);
            let [with, without] = [true, false].map(|culling| {
                scene.splatting.culling = culling;
                render(&gpu, &volume, &scene)
            });
            let share = share_off(&with.0.pixels, &without.0.pixels, 1e-4);
            assert!(share <= OUTLIERS, "{compositing:?}, {rasterizer:?}, {footprint:?}: {share} of the pixels");
            let [with, without] = [with, without].map(|(_, counts)| counts.sections_rasterized);
            match compositing {
                Compositing::Surface => assert!(with < without * 2 / 3, "{rasterizer:?}: {with} of {without}"),
                _ => assert_eq!(with, without, "{compositing:?}, {rasterizer:?}"),
            }
        }
    }
}

/// How sheets are grouped and which tiles are composited is none of the picture's business.
#[test]
fn tiles_and_groups_change_nothing() {
    let renderers =
        [1, 2, 4].map(|n| Headless::new(&HeadlessOptions { sheets_per_group: Some(n), ..lavapipe() }).unwrap());
    let mut random = Random(91);
    for (case, compositing) in (0..12).zip(BY_MEANS.into_iter().cycle()) {
        let (volume, mut scene) = random_case(&mut random);
        scene.splatting.compositing = compositing;
        for rasterizer in RASTERIZERS {
            scene.splatting.rasterizer = rasterizer;
            let [with, without] = [true, false].map(|tiles| {
                scene.splatting.tiles = tiles;
                render(&renderers[2], &volume, &scene).0
            });
            assert_eq!(with, without, "case {case}, {rasterizer:?}");
        }
        scene.splatting.rasterizer = RASTERIZERS[0];
        let [one, two, four] = [0, 1, 2].map(|at| render(&renderers[at], &volume, &scene).0);
        for few in [one, two] {
            let share = share_off(&few.pixels, &four.pixels, 1e-4);
            assert!(share <= 5.0 * OUTLIERS, "case {case}: {share} of the pixels with {scene:?}");
        }
    }
}

/// Volumes a voxel thick, or of a single one, and views along their faces.
#[test]
fn thin_volumes() {
    let gpu = gpu();
    for (dims, direction) in [
        ([1, 9, 9], DVec3::X),
        ([1, 9, 9], DVec3::new(1.0, 0.4, 0.3)),
        ([9, 9, 1], DVec3::NEG_Z),
        ([9, 1, 9], DVec3::X),
        ([2, 9, 9], DVec3::X),
        ([1, 1, 1], DVec3::new(0.5, 0.7, -0.4)),
        ([4, 4, 4], DVec3::Y),
    ] {
        for (compositing, method) in
            BY_MEANS.into_iter().flat_map(|c| [Method::ImageAligned, Method::AxisAligned].map(|method| (c, method)))
        {
            let (volume, mut scene) = constant(dims, DVec3::ONE);
            scene.transfer = transfer(&[(0.0, COLOR)], &[(0.0, 0.9)]);
            scene.camera = camera(direction.to_array(), 3.0);
            scene.camera.up = DVec3::new(0.0, 0.6, 0.8);
            (scene.splatting.compositing, scene.splatting.method) = (compositing, method);
            (scene.splatting.radius, scene.splatting.falloff) = (2.0, 2.0);
            let expected = reference::render(&volume, &scene.transfer.resolve(&volume), &scene).unwrap();
            for rasterizer in RASTERIZERS {
                scene.splatting.rasterizer = rasterizer;
                let image = render(&gpu, &volume, &scene).0;
                let what = format!("{dims:?} {direction} {compositing:?} {method:?} {rasterizer:?}");
                let share = share_off(&image.pixels, &expected.pixels, 2e-3);
                assert!(share <= 5.0 * OUTLIERS, "{what}: {share} of the pixels");
                let alpha = image.pixels[54 * 120 + 60][3];
                // Edge on, a single layer of voxel centres is nowhere.
                let may_be_nothing = compositing == Compositing::Surface || dims[1] == 1;
                assert!(may_be_nothing || alpha > 0.1, "{what}: {alpha}");
            }
        }
    }
}

#[test]
fn what_does_not_go_together_is_refused() {
    let gpu = gpu();
    let volume = builtin::volume("head:24").unwrap();
    let refusal = |scene: &Scene, first_hit: Option<f64>| {
        let mut view = gpu.view(volume.clone(), scene).unwrap();
        view.set_first_hit(first_hit);
        match gpu.draw(&mut view) {
            Err(RenderError::OutOfRange { key, found, allowed }) => {
                assert_eq!(key, "splatting.compositing");
                format!("{found}, allowed: {allowed}")
            }
            other => panic!("{:?}", other.map(|rendering| rendering.stats)),
        }
    };
    let assert_words = |message: &str, words: &[&str]| {
        words.iter().for_each(|word| assert!(message.contains(word), "no {word:?} in {message}"));
    };
    for compositing in BY_MEANS {
        let mut scene = scene(20, 20);
        (scene.splatting.compositing, scene.splatting.method) = (compositing, Method::CompositeEverySample);
        let name = format!("\"{}\"", format!("{compositing:?}").to_lowercase());
        assert_words(&refusal(&scene, None), &[&name, "composite-every-sample", "\"linear\""]);
        assert!(reference::render(&volume, &scene.transfer.resolve(&volume), &scene).is_err());
    }
    let mut scene = scene(20, 20);
    (scene.splatting.compositing, scene.splatting.order) = (Compositing::Surface, Order::BackToFront);
    assert_words(&refusal(&scene, None), &["\"surface\"", "back-to-front", "\"front-to-back\""]);
    assert!(reference::render(&volume, &scene.transfer.resolve(&volume), &scene).is_err());
    scene.splatting.compositing = Compositing::Minimum;
    assert_words(&refusal(&scene, Some(0.5)), &["\"minimum\" with first hits"]);
}
