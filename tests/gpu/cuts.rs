//! Clip planes, a host's surfaces, and first hits (SPEC is silent; `clip`, `surfaces`): each rasterizer against the f64 evaluation, with
//! culling, against a ray march, with changing lists, and with errors. `cargo test --test gpu cuts:: -- --nocapture` prints the
//! measurements.

use std::sync::Arc;

use glam::{DVec3, UVec2, UVec3};
use sheetsplat::settings::Clip;
use sheetsplat::settings::Projection;

use sheetsplat::cpu::CpuRenderer;
use sheetsplat::headless::{GpuHeadless, readback};
use sheetsplat::image::Image;
use sheetsplat::internals::reference::{self, Host, ray_march};
use sheetsplat::internals::view_geometry::ViewGeometry;
use sheetsplat::scene::Scene;
use sheetsplat::settings::{Classification, Compositing, Method, Order, Rasterizer, Splatting};
use sheetsplat::stats::Counts;
use sheetsplat::volume::{Grid, Volume, builtin};
use sheetsplat::{Pick, RenderError, SceneView, SettingError};

use crate::common::cases::cases;
use crate::common::compare::{assert_at_least, assert_at_most};
use crate::common::devices::{DRAWINGS, Drawing, gpu};
use crate::common::images::{BLACK, largest_difference, psnr};
use crate::common::surfaces::{DepthRange, surfaces};
use crate::common::{RASTERIZERS, Random, SPACINGS, camera, random_eye, random_volume, scene, transfer};

/// Any view of any volume.
fn random_case(random: &mut Random) -> (Volume, Scene) {
    let spacing = random.pick(&SPACINGS);
    let volume = random_volume(random, (6.0, 16.0), spacing);
    let mut scene = scene(random.uniform(20.0, 70.0) as u32, random.uniform(20.0, 60.0) as u32);
    scene.splatting.method = random.pick(&[Method::ImageAligned, Method::ImageAligned, Method::AxisAligned]);
    match random.bits() % 2 {
        0 => scene.camera.direction = random.direction(),
        _ => scene.camera = random_eye(random, volume.grid()),
    }
    let (haze, solid) = (random.pick(&[0.0, 0.02, 0.2]), random.pick(&[0.3, 0.9, 1.0]));
    let opacity = [(5.0, 0.0), (20.0, haze), (200.0, solid)];
    scene.channels[0].transfer = transfer(&[(0.0, [0.2, 0.5, 1.0]), (200.0, [1.0, 0.9, 0.8])], &opacity);
    scene.splatting.compositing = random.pick(&[Compositing::Linear, Compositing::Exponential, Compositing::Xray]);
    scene.splatting.slab_width = random.pick(&[0.5, 1.0, 2.0]);
    scene.splatting.radius = random.pick(&[1.4, 2.0, 2.7]);
    (volume, scene)
}

/// Up to six planes through the volume, and sometimes a box.
fn random_clip(random: &mut Random, grid: &Grid) -> Clip {
    let half = grid.center() * grid.spacing;
    let plane = |random: &mut Random| {
        let normal = random.direction() * random.uniform(0.1, 5.0);
        let through = random.within(-half, half) * 0.6;
        // The plane mostly keeps the side with the centre.
        let d = -normal.dot(through);
        let sign = if d < 0.0 && !random.bits().is_multiple_of(4) { -1.0 } else { 1.0 };
        [normal.x * sign, normal.y * sign, normal.z * sign, d * sign]
    };
    let count = random.pick(&[0, 1, 1, 2, 6]);
    let planes: Vec<[f64; 4]> = (0..count).map(|_| plane(random)).collect();
    let crop = (planes.is_empty() || random.bits().is_multiple_of(4)).then(|| {
        let low = random.within(-half, DVec3::ZERO);
        [low, low + random.within(grid.spacing, half * 1.5 + grid.spacing)]
    });
    let shade_faces = count != 1;
    Clip { planes, crop, shade_faces }
}

/// The depths of a host's wavy surface around the volume's middle, with gaps.
fn random_surface(random: &mut Random, view: &ViewGeometry, unit: f64) -> Vec<f64> {
    let middle = view.rays().depth_of(DVec3::ZERO);
    let size = UVec2::from(view.size);
    let (slope, wave) = (random.direction() * 8.0 / unit.max(1.0), random.uniform(0.5, 4.0));
    (0..size.x * size.y)
        .map(|at| {
            let place = UVec2::new(at % size.x, at / size.x).as_dvec2() / size.as_dvec2() - 0.5;
            let is_hole = (place.x * 9.0).sin() * (place.y * 7.0).cos() > 0.6;
            let depth = middle + slope.x * place.x + slope.y * place.y + wave * (place.x * 20.0).sin();
            if is_hole { f64::INFINITY } else { depth.max(0.05) }
        })
        .collect()
}

fn view_of(volume: &Volume, scene: &Scene) -> ViewGeometry {
    let size = [scene.image.width, scene.image.height];
    ViewGeometry::new(volume.grid(), &scene.camera, &scene.splatting, size).unwrap()
}

/// Draws a frame, with its first hits in `unit`s if requested.
fn draw(gpu: &GpuHeadless, view: &mut SceneView) -> (Image, Vec<f64>, Counts) {
    let rendering = gpu.draw(view).unwrap();
    let unit = view.volume().grid().unit();
    let hits = view.first_hits().map_or(Vec::new(), |texture| {
        let bytes = readback::texture(gpu.device(), gpu.queue(), texture).unwrap();
        bytemuck::pod_collect_to_vec::<_, f32>(&bytes).into_iter().map(|depth| f64::from(depth) / unit).collect()
    });
    (rendering.image, hits, rendering.stats.counts)
}

/// The same by the native backend, with a host's surface in `unit`s.
fn draw_natively(
    volume: &Volume,
    scene: &Scene,
    (depths, first_hit): (Option<&[f64]>, Option<f64>),
) -> (Image, Vec<f64>, Counts) {
    let unit = volume.grid().unit();
    let mut renderer = CpuRenderer::new(volume.clone(), scene).unwrap();
    let world = |depth: &f64| (depth * unit) as f32;
    renderer.set_surfaces(depths.map(|depths| depths.iter().map(world).collect())).unwrap();
    renderer.set_first_hit(first_hit).unwrap();
    let rendering = renderer.draw().unwrap();
    let hits = renderer.first_hits().unwrap_or_default().iter().map(|&depth| f64::from(depth) / unit).collect();
    (rendering.image, hits, rendering.stats.counts)
}

#[test]
fn cuts_equal_the_reference() {
    let gpu = gpu();
    let mut random = Random(1905);
    let mut worst = [f64::INFINITY; 3];
    let mut changed = 0;
    let cases = cases(14, 40);
    for case in 0..cases as u32 {
        let (volume, mut scene) = random_case(&mut random);
        scene.splatting.culling = false;
        // The number of pipelines is kept small.
        scene.splatting.order = if scene.splatting.compositing == Compositing::Exponential {
            Order::BackToFront
        } else {
            Order::FrontToBack
        };
        let unit = volume.grid().unit();
        let transfer = scene.channels[0].transfer.resolve(&volume);
        let whole = reference::render(&volume, std::slice::from_ref(&transfer), &scene).unwrap();
        if case % 3 != 0 {
            scene.clip = random_clip(&mut random, volume.grid());
        }
        let view = view_of(&volume, &scene);
        let depths = (case % 3 != 1).then(|| random_surface(&mut random, &view, unit));
        let first_hit = (scene.splatting.order == Order::FrontToBack).then(|| random.pick(&[0.05, 0.5, 0.9]));
        let host = Host { surfaces: depths.as_deref(), first_hit };
        let expected = reference::render_for(host, &volume, std::slice::from_ref(&transfer), &scene, None).unwrap();
        changed += usize::from(largest_difference(&whole, &expected.image) > 0.1);
        let range = random.pick(&[DepthRange::Standard, DepthRange::Reversed, DepthRange::Infinite]);
        for (drawing, worst) in DRAWINGS.into_iter().zip(&mut worst) {
            let (image, hits, _) = if let Drawing::By(rasterizer) = drawing {
                scene.splatting.rasterizer = rasterizer;
                let mut scene_view = gpu.view(volume.clone(), &scene).unwrap();
                let (origin, planes) = ([case % 4, case % 5], [0.01, 1000.0]);
                let given = depths.as_ref().map(|depths| surfaces(gpu, &view, unit, range, planes, depths, origin));
                scene_view.set_surfaces(given).unwrap();
                scene_view.set_first_hit(first_hit).unwrap();
                draw(gpu, &mut scene_view)
            } else {
                draw_natively(&volume, &scene, (depths.as_deref(), first_hit))
            };
            let decibels = psnr(&image.pixels, &expected.image.pixels, BLACK, 0);
            assert_at_least(decibels, 68.0, format_args!("case {case}, {drawing:?}, {range:?} with {scene:?}"));
            *worst = worst.min(decibels);
            assert_eq!(hits.len(), expected.first_hits.len());
            let is_close = |(hit, expected): &(&f64, &f64)| {
                // The depth is infinite where nothing is hit.
                hit == expected || (**hit - **expected).abs() / expected.abs().max(10.0) <= 1e-3
            };
            let off = hits.len() - hits.iter().zip(&expected.first_hits).filter(is_close).count();
            assert!(off <= hits.len() / 200, "case {case}, {drawing:?}: {off} of {} hits with {scene:?}", hits.len());
        }
    }
    println!("cut frames: at least {worst:.1?} dB by {DRAWINGS:?}");
    assert!(changed > cases / 2, "cuts show in {changed} cases only");
}

/// Voxels behind a cut are culled like voxels behind opaque ones.
#[test]
fn culling_keeps_its_guarantee() {
    let gpu = gpu();
    let mut random = Random(64);
    let mut fewer = [0; 3];
    let cases = cases(8, 24);
    for case in 0..cases {
        let (volume, mut scene) = random_case(&mut random);
        scene.splatting.compositing = Compositing::Linear;
        scene.splatting.opacity_threshold = random.pick(&[0.8, 0.95, 1.0]);
        scene.clip = if case % 2 == 0 { random_clip(&mut random, volume.grid()) } else { Clip::default() };
        let view = view_of(&volume, &scene);
        let unit = volume.grid().unit();
        let depths = random_surface(&mut random, &view, unit);
        for (drawing, fewer) in DRAWINGS.into_iter().zip(&mut fewer) {
            let [with, without] = [true, false].map(|culling| {
                scene.splatting.culling = culling;
                let Drawing::By(rasterizer) = drawing else {
                    return draw_natively(&volume, &scene, (Some(&depths), None));
                };
                scene.splatting.rasterizer = rasterizer;
                let mut scene_view = gpu.view(volume.clone(), &scene).unwrap();
                let range = DepthRange::Reversed;
                scene_view
                    .set_surfaces(Some(surfaces(gpu, &view, unit, range, [0.01, 1000.0], &depths, [0, 0])))
                    .unwrap();
                draw(gpu, &mut scene_view)
            });
            let allowed = 1.0 - scene.splatting.opacity_threshold + 2e-5;
            let difference = largest_difference(&with.0, &without.0);
            assert_at_most(difference, allowed, format_args!("case {case}, {drawing:?} with {scene:?}"));
            let [with, without] = [with, without].map(|(_, _, counts)| counts.sections_rasterized);
            assert!(with <= without);
            *fewer += usize::from(with < without);
        }
    }
    assert!(fewer.iter().all(|&fewer| fewer >= cases / 2), "culling culls in {fewer:?} of {cases} cases");
}

/// A wall in front of everything hides everything and costs almost nothing; a wall behind everything changes nothing.
#[test]
fn walls() {
    let gpu = gpu();
    let volume = Arc::new(builtin::volume("head:48").unwrap());
    let mut scene = scene(100, 90);
    scene.camera.direction = DVec3::new(0.4, 0.8, -0.3);
    let unit = volume.grid().unit();
    for (drawing, projection) in DRAWINGS.into_iter().flat_map(|drawing| {
        let perspective = Projection::Perspective { fov_y: 40.0, distance: Some(400.0), near: None };
        [Projection::Orthographic { height: None }, perspective].map(|projection| (drawing, projection))
    }) {
        scene.camera.projection = projection;
        let view = view_of(&volume, &scene);
        let middle = view.rays().depth_of(DVec3::ZERO);
        let with_wall = |depth: Option<f64>| {
            let wall = depth.map(|depth| vec![depth; 9000]);
            let Drawing::By(rasterizer) = drawing else {
                return draw_natively(&volume, &scene, (wall.as_deref(), None));
            };
            let scene = Scene { splatting: Splatting { rasterizer, ..scene.splatting }, ..scene.clone() };
            let mut scene_view = gpu.view(volume.clone(), &scene).unwrap();
            let planes = [middle - 60.0, middle + 90.0];
            scene_view
                .set_surfaces(wall.map(|wall| surfaces(gpu, &view, unit, DepthRange::Standard, planes, &wall, [0, 0])))
                .unwrap();
            draw(gpu, &mut scene_view)
        };
        let (none, behind, before, between) = (
            with_wall(None),
            with_wall(Some(middle + 50.0)),
            with_wall(Some(middle - 50.0)),
            with_wall(Some(middle - 12.0)),
        );
        // The native backend scales the sheets of rays that end, by 1 here but for rounding.
        let rounding = if drawing == Drawing::Native { 2e-6 } else { 0.0 };
        assert_at_most(largest_difference(&none.0, &behind.0), rounding, format_args!("{drawing:?}, {projection:?}"));
        assert!(before.0.pixels.iter().all(|&pixel| pixel == BLACK));
        let [hidden, cut, all] = [&before, &between, &none].map(|(_, _, counts)| counts.sections_rasterized);
        assert!(hidden < all / 10, "{drawing:?}: {hidden} sections behind a wall, {all} without");
        assert!(cut <= all);
        // The wall runs through the face.
        let difference = largest_difference(&between.0, &none.0);
        println!("{drawing:?}: {hidden}, {cut}, {all} sections, difference {difference}");
        assert_at_least(difference, 0.5, format_args!("{drawing:?}, {projection:?}"));
    }
}

/// A clipped field equals a ray march through the part that is kept.
#[test]
fn cuts_are_exact_along_rays() {
    let gpu = gpu();
    let volume = builtin::volume("tomato:40").unwrap();
    let mut scene = scene(120, 100);
    scene.channels[0].transfer =
        transfer(&[(40.0, [0.9, 0.2, 0.1]), (220.0, [0.9, 1.0, 0.6])], &[(30.0, 0.0), (90.0, 0.1), (200.0, 0.5)]);
    scene.splatting.compositing = Compositing::Exponential;
    scene.splatting.culling = false;
    scene.splatting.slab_width = 0.5;
    let grid = *volume.grid();
    let half = grid.center() * grid.spacing;
    let perspective = Projection::Perspective { fov_y: 30.0, distance: None, near: None };
    for (projection, normal, d) in [
        (Projection::Orthographic { height: None }, [0.0, 1.0, 0.0], 0.0),
        (Projection::Orthographic { height: None }, [1.0, 0.3, 0.1], 4.0),
        (perspective, [0.5, 1.0, 0.4], -3.0),
        (perspective, [1.0, 0.0, 0.0], 0.0),
    ] {
        scene.camera = camera([0.3, 0.9, -0.25], 1.0);
        scene.camera.projection = projection;
        scene.clip.planes = vec![[normal[0], normal[1], normal[2], d]];
        scene.clip.crop = Some([-half * DVec3::new(2.0, 2.0, 0.5), half * 2.0]);
        let transfer = scene.channels[0].transfer.resolve(&volume);
        let pixels: Vec<UVec2> = (0..12_000).step_by(7).map(|at| UVec2::new(at % 120, at / 120)).collect();
        let whole = Scene { clip: Clip::default(), ..scene.clone() };
        let [marched, marched_whole] = [&scene, &whole]
            .map(|scene| ray_march::pixels(&volume, std::slice::from_ref(&transfer), scene, &pixels).unwrap());
        for drawing in [Drawing::By(Rasterizer::Tiles), Drawing::Native] {
            let [decibels, unclipped] = [(&scene, &marched), (&whole, &marched_whole)].map(|(scene, marched)| {
                let image = drawing.render(gpu, &volume, scene).image;
                let drawn: Vec<[f32; 4]> = pixels.iter().map(|at| image.pixels[(at.y * 120 + at.x) as usize]).collect();
                psnr(&drawn, marched, BLACK, 100)
            });
            let what = format!("{drawing:?}, {normal:?} {d}, {projection:?}");
            println!("{what}: {decibels:.1} dB, {unclipped:.1} dB of the whole volume");
            assert_at_least(decibels, 47.0, what);
        }
    }
}

/// After a plane has moved, the view equals a fresh one, and only voxels that enter or leave were touched.
#[test]
fn moved_planes_are_fresh_ones() {
    let gpu = gpu();
    let volume = Arc::new(builtin::volume("head:40").unwrap());
    let mut random = Random(12);
    let mut scene = scene(60, 50);
    scene.camera.direction = DVec3::new(0.3, 0.8, -0.3);
    scene.camera.projection = Projection::Orthographic { height: Some(260.0) };
    let mut view = gpu.view(volume.clone(), &scene).unwrap();
    let mut last = draw(gpu, &mut view).2.voxels_in_range;
    for step in 0..20 {
        scene.clip = if step == 7 { Clip::default() } else { random_clip(&mut random, volume.grid()) };
        let touched = view.set_clip(scene.clip.clone()).unwrap();
        if step % 5 == 4 {
            scene.splatting.radius = random.pick(&[1.4, 2.0, 3.0]);
            view.set_splatting(scene.splatting).unwrap();
        }
        let changed = draw(gpu, &mut view);
        let count = changed.2.voxels_in_range;
        if step % 5 != 4 {
            assert_eq!(count, last + touched.entered - touched.left, "step {step}");
        }
        last = count;
        let fresh = draw(gpu, &mut gpu.view(volume.clone(), &scene).unwrap());
        assert_eq!(changed, fresh, "step {step}: {:?}", scene.clip);
    }
    // Half a head is left.
    let touched = view.set_clip(Clip { planes: vec![[0.0, 1.0, 0.0, 0.0]], ..Clip::default() }).unwrap();
    let again = view.set_clip(Clip { planes: vec![[0.0, 7.0, 0.0, 0.0]], ..Clip::default() }).unwrap();
    assert!(touched.entered + touched.left > 0);
    assert_eq!((again.entered, again.left), (0, 0), "the same plane");
}

/// Picks find the point under the cursor.
#[test]
fn picks() {
    let gpu = gpu();
    let mut values = vec![0.0_f32; 21 * 21 * 21];
    let grid = Grid::new(UVec3::splat(21), DVec3::new(1.0, 2.0, 1.0));
    // A plate at y = 12, with values that increase along x.
    for (x, z) in (0..21).flat_map(|x| (0..21).map(move |z| (x, z))) {
        values[grid.index_of(UVec3::new(x, 12, z)) as usize] = 100.0 + x as f32;
    }
    let volume = Volume::new("plate", grid.dims, grid.spacing, values).unwrap();
    let mut scene = scene(21, 21);
    scene.channels[0].transfer = transfer(&[(0.0, [1.0; 3])], &[(50.0, 0.0), (100.0, 1.0)]);
    let projections = [
        (Projection::Orthographic { height: Some(21.0) }, 4.0),
        (Projection::Perspective { fov_y: 90.0, distance: Some(6.5), near: None }, 10.5),
    ];
    let classifications = [Classification::Before, Classification::After];
    let ways = RASTERIZERS.into_iter().flat_map(|rasterizer| classifications.map(|first| (rasterizer, first)));
    for ((rasterizer, classification), (projection, depth)) in
        ways.flat_map(|way| projections.map(|projection| (way, projection)))
    {
        (scene.splatting.rasterizer, scene.splatting.classification) = (rasterizer, classification);
        scene.camera.projection = projection;
        let mut view = gpu.view(volume.clone(), &scene).unwrap();
        view.set_first_hit(Some(0.5)).unwrap();
        gpu.draw(&mut view).unwrap();
        let picked = gpu.pick(&view, [13, 6]).unwrap().unwrap();
        // The opacity reaches one half before the plate's middle, by less than a voxel. A plate of interpolated values is less opaque.
        let end = if classification == Classification::After { depth + 0.5 } else { depth };
        assert!((depth - 2.0..end).contains(&picked.depth), "{projection:?}: {picked:?}, not {depth}");
        // Orthographic, pixels and voxels coincide; in perspective the plate is 21 units across at a depth of 10.5 units.
        assert_eq!((picked.voxel, picked.value), (UVec3::new(13, 12, 14), 113.0), "{projection:?}: {picked:?}");
        let plate = DVec3::new(3.0, 4.0, 4.0);
        assert!((picked.position - plate).abs().cmple(DVec3::new(0.6, 2.0, 0.6)).all(), "{picked:?}");
        let Pick { label, .. } = picked;
        assert_eq!(label, None);
        // Beside the plate the opacity is not reached.
        scene.camera.center = Some(DVec3::new(100.0, 0.0, 0.0));
        let mut beside = gpu.view(volume.clone(), &scene).unwrap();
        beside.set_first_hit(Some(0.5)).unwrap();
        gpu.draw(&mut beside).unwrap();
        assert_eq!(gpu.pick(&beside, [3, 3]).unwrap(), None);
        let error = gpu.pick(&beside, [21, 3]).unwrap_err().to_string();
        assert!(error.contains("[21, 3]") && error.contains("21×21"), "{error}");
        scene.camera.center = Some(DVec3::ZERO);
    }
}

#[test]
fn unsuitable_surfaces_are_refused() {
    let gpu = gpu();
    let volume = Arc::new(builtin::volume("head:24").unwrap());
    let mut scene = scene(40, 30);
    let unit = volume.grid().unit();
    let seen = view_of(&volume, &scene);
    let depths = vec![f64::INFINITY; 1200];
    let refusal = |scene: &Scene, change: &dyn Fn(&mut SceneView) -> Result<(), SettingError>| {
        let mut view = gpu.view(volume.clone(), scene).unwrap();
        let changed = change(&mut view).map_err(RenderError::from);
        changed.and_then(|()| gpu.draw(&mut view)).map(|rendering| rendering.stats).unwrap_err().to_string()
    };
    let good = surfaces(gpu, &seen, unit, DepthRange::Standard, [-99.0, 99.0], &depths, [0, 0]);
    let assert_words = |message: &str, words: &[&str]| {
        words.iter().for_each(|word| assert!(message.contains(word), "no {word:?} in {message}"));
    };
    let mut small = good.clone();
    small.origin = [4, 1];
    let message = refusal(&scene, &|view| view.set_surfaces(Some(small.clone())));
    assert_words(&message, &["surfaces.depth", "43×32", "44×31"]);
    let mut turned = good.clone();
    turned.clip_from_world *= glam::DMat4::from_rotation_z(0.01);
    let message = refusal(&scene, &|view| view.set_surfaces(Some(turned.clone())));
    assert_words(&message, &["surfaces.clip_from_world", "pixels off the camera's", "0.02"]);
    let mut broken = good.clone();
    broken.clip_from_world.x_axis.x = f64::NAN;
    let message = refusal(&scene, &|view| view.set_surfaces(Some(broken.clone())));
    assert_words(&message, &["surfaces.clip_from_world"]);
    for (opacity, allowed) in [(0.0, "(0, 1]"), (f64::NAN, "(0, 1]"), (0.96, "at most 0.95, the opacity_threshold")] {
        let message = refusal(&scene, &|view| view.set_first_hit(Some(opacity)));
        assert_words(&message, &["first_hit", allowed]);
    }
    let mut backwards = scene.clone();
    backwards.splatting.order = Order::BackToFront;
    assert_words(&refusal(&backwards, &|view| view.set_first_hit(Some(0.5))), &["splatting.order", "front-to-back"]);
    scene.splatting.method = Method::CompositeEverySample;
    scene.clip.planes = vec![[1.0, 0.0, 0.0, 0.0]];
    assert_words(&refusal(&scene, &|_| Ok(())), &["splatting.method", "composite-every-sample", "clip planes"]);
    scene.clip.planes = vec![[1.0, 0.0, 0.0, 0.0]; 7];
    assert_words(&gpu.view(volume.clone(), &scene).unwrap_err().to_string(), &["clip.planes", "7 planes"]);
}
