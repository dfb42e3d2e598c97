//! The records that `shaders/shade.wgsl` writes (projection and shading) for a whole frame, decoded, against `reference::shading`.
//! `cull.rs` tests which voxels are drawn.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3, DVec4, UVec3};
use sheetsplat::headless::GpuHeadless;
use sheetsplat::internals::ClippedVoxels;
use sheetsplat::internals::brick;
use sheetsplat::internals::classify::classify;
use sheetsplat::internals::gpu::layout;
use sheetsplat::internals::kernel::Kernel;
use sheetsplat::internals::pass::cull::Cull;
use sheetsplat::internals::reference::{Geometry, shading};
use sheetsplat::internals::view_geometry::ViewGeometry;
use sheetsplat::scene::{Scene, TransferSettings};
use sheetsplat::settings::{Camera, Compositing, Method, Projection};
use sheetsplat::settings::{LabelTables, Ramp, TransferFunction};
use sheetsplat::settings::{Light, Shading};
use sheetsplat::volume::{Labels, Volume};

use crate::common::compare::assert_at_most;
use crate::common::devices::gpu;
use crate::common::{BY_AMOUNTS, F16, F32, Random, SPACINGS, camera, random_eye, scene, transfer};
use crate::stages::cull::{Culling, Groups};

/// Values of a volume with noise everywhere, so that gradients have all directions.
fn noise(dims: UVec3, spacing: DVec3) -> Volume {
    let mut random = Random(1);
    let values = (0..dims.element_product()).map(|_| random.uniform(0.0, 255.0) as f32).collect();
    Volume::new("noise", dims, spacing, values).unwrap()
}

fn skin() -> TransferSettings {
    transfer(
        &[(20.0, [0.1, 0.3, 0.9]), (120.0, [0.9, 0.7, 0.6]), (250.0, [1.0, 1.0, 1.0])],
        &[(10.0, 0.0), (100.0, 0.3), (200.0, 1.0)],
    )
}

fn oblique() -> Scene {
    Scene { camera: camera([0.3, 0.9, -0.2], 40.0), ..scene(64, 48) }.with_transfer(skin())
}

/// The f32 error of a ramp's value: the control points and the position are rounded and subtracted, in the segment's own units; ordinates,
/// fraction and mix add a few roundings of numbers up to 1.
fn ramp_error<T: Copy>(points: &[(f64, T)], difference: impl Fn(T, T) -> f64, at: f64) -> f64 {
    let steepest = points.windows(2).map(|pair| difference(pair[1].1, pair[0].1) / (pair[1].0 - pair[0].0));
    let positions = points.iter().fold(at.abs(), |most, point| most.max(point.0.abs()));
    F32 * (8.0 + 4.0 * positions * steepest.fold(0.0, f64::max))
}

/// The error bound of the GPU's record of a voxel, from the precisions of its number formats and functions, and from the f32 error of its ray's
/// direction.
fn tolerance(
    volume: &Volume,
    index: u32,
    transfer: &TransferFunction,
    (scene, geometry): (&Scene, &Geometry),
    ray_error: f64,
    amount: DVec4,
) -> DVec4 {
    let value = f64::from(volume.values().at(index as usize));
    let magnitude = volume.gradient(volume.grid().voxel_at(index)).length();
    let tables = transfer.tables(volume.label(index));
    let alpha = tables.alpha(value, magnitude);
    let scalar = |a: f64, b: f64| (a - b).abs();
    let factor_error = tables.gradient_opacity.map_or(0.0, |ramp| ramp_error(ramp.points(), scalar, magnitude));
    let alpha_error = ramp_error(tables.opacity.points(), scalar, value) + factor_error + F32;

    // -ln(1 - α): WGSL's log is accurate to 2⁻²¹ for arguments in [0.5, 2] and to 3 ULP beyond.
    let m = shading::amount(scene.splatting.compositing, alpha);
    let m_error = match scene.splatting.compositing {
        Compositing::Exponential => alpha_error / (1.0 - alpha.min(0.9999)) + 2.0_f64.powi(-21) + 8.0 * F32 * m,
        _ => alpha_error,
    };

    // A gradient's components are rounded three times and divided twice; the square root halves the relative error of the sum of squares.
    let normal_error = 16.0 * F32 + ray_error;
    let Shading { ambient, diffuse, specular, shininess, .. } = scene.shading;
    let color_error = ramp_error(tables.color.points(), |a: DVec3, b| (a - b).abs().max_element(), value);
    // pow is exp2(y·log2(x)): log2 to 2⁻²¹, times y; exp2 to 3 ULP, and more where its result is small. A cosine's power is steep at 0 if
    // the exponent is below 1, and at 1 if it is above.
    let (cosine, stretch) = highlight_cosine(volume, index, scene, geometry);
    let half_error = 16.0 * F32 + ray_error * stretch;
    let steepest = [cosine - half_error, cosine + half_error]
        .map(|off| (off.clamp(0.0, 1.0).powf(shininess) - cosine.powf(shininess)).abs());
    let highlight_error = specular * (steepest[0].max(steepest[1]) + (shininess + 2.0) * 2.0_f64.powi(-21));
    let shaded_error = color_error * (ambient + diffuse) + diffuse * normal_error + highlight_error + 8.0 * F32;
    let c_error = if scene.shading.enabled { shaded_error } else { color_error };

    let color = amount.truncate() / amount.w;
    let before_f16 = (color * m_error + m * c_error).extend(m_error) + 4.0 * F32 * amount;
    before_f16 + amount * F16 + 2.0_f64.powi(-25)
}

/// `|n·hv|` of SPEC §3, and the factor by which normalising `l + c` enlarges the errors of its terms.
fn highlight_cosine(volume: &Volume, index: u32, scene: &Scene, geometry: &Geometry) -> (f64, f64) {
    let voxel = volume.grid().voxel_at(index);
    let to_eye = -geometry.ray(voxel);
    let to_light = match scene.shading.light {
        Light::Headlight => to_eye,
        Light::Direction(direction) => direction.normalize(),
        other => unreachable!("{other:?}"),
    };
    let normal = volume.gradient(voxel).normalize_or_zero();
    let sum = to_light + to_eye;
    (normal.dot(sum.normalize_or_zero()).abs(), 2.0 / sum.length().max(1e-6))
}

/// The f32 errors of a voxel's pixel coordinates, sheet depth and depth from the eye.
pub(crate) fn place_error(view: &ViewGeometry, voxel: UVec3, center: DVec2) -> DVec4 {
    // A dot product of four: every term has a rounded coefficient and product and passes up to three sums; the f64 evaluation's different
    // formula adds one more rounding.
    let p = voxel.as_dvec3().extend(1.0);
    let [x, y, depth, from_eye] = view.screen_from_voxel.map(|row| 6.0 * F32 * (row * p).abs().element_sum());
    // Pixel coordinates are a quotient, accurate to WGSL's 2.5 ULP, added to the image's middle.
    let w = view.screen_from_voxel[3].dot(p);
    let from_middle = center - DVec2::from(view.size.map(f64::from)) / 2.0;
    let quotient = (DVec2::new(x, y) + from_middle.abs() * from_eye) / w + 5.0 * F32 * from_middle.abs();
    (quotient + F32 * center.abs()).extend(depth).extend(from_eye)
}

/// Culls a frame, group by group, and compares the splat record of every voxel on the screen with the f64 evaluation.
fn check(name: &str, volume: &Volume, scene: &Scene) {
    let shaded = shaded(gpu(), name, volume, scene);
    assert!(shaded > 50, "{name}: {shaded} voxels");
}

/// Like [`check`]; returns the number of shaded voxels.
fn shaded(gpu: &GpuHeadless, name: &str, volume: &Volume, scene: &Scene) -> usize {
    let transfer = scene.channels[0].transfer.resolve(volume);
    let mut scene = scene.clone();
    scene.splatting.culling = false;
    let scene = &scene;
    let sheets = 2;
    let stage = Cull::new(gpu.device(), sheets);
    let voxels = classify(volume, std::slice::from_ref(&transfer), &ClippedVoxels::default());
    let labels = volume.labels().filter(|_| transfer.labels.values().any(LabelTables::matter_to_shading));
    let of_volume = (volume.grid(), volume.values(), labels);
    let culling = Culling::new(gpu, (&stage, Groups::Sheets(sheets)), of_volume, &voxels, &transfer, scene);
    assert!(culling.plan.groups.len() > 1 || culling.view.perspective.is_some(), "{name}: one group");
    (0..culling.plan.groups.len()).for_each(|group| culling.cull(group));
    let (records, states, view) = (culling.splats(), culling.states(), culling.view);

    let geometry = Geometry::new(volume.grid(), scene).unwrap();
    let taking_part = shading::taking_part(volume, std::slice::from_ref(&transfer), &geometry);
    let expected = shading::shade(volume, std::slice::from_ref(&transfer), scene, &geometry).unwrap();
    let twins: BTreeMap<u32, &shading::Splat> = taking_part.iter().copied().zip(&expected).collect();
    let held: usize = culling.bricks.iter().map(|brick| brick::voxels(brick).count()).sum();
    assert_eq!(held, voxels.len(), "{name}: bricks hold every voxel");
    let is_beyond_near = |index: &&u32| geometry.is_beyond_near(volume.grid().voxel_at(**index));
    assert_eq!(voxels.iter().filter(is_beyond_near).count(), twins.len(), "{name}: which voxels take part");
    // A voxel is on the screen if its footprint's box contains a pixel's centre; f32 may differ where it barely does.
    let kernel = Kernel::new(scene.splatting.radius, scene.splatting.falloff);
    let inside = |index: u32| {
        let Some(&twin) = twins.get(&index) else { return f64::NEG_INFINITY };
        let sheets = match geometry.method {
            Method::ImageAligned => geometry.slabs(twin, kernel.radius()),
            _ => 0..1,
        };
        let boxes = sheets.filter_map(|k| geometry.section(twin, k, &kernel)).map(|section| {
            let half_box = section.footprint.half_box(kernel.support());
            let (low, high) = (section.center - half_box, section.center + half_box);
            (high - 0.5).min(geometry.size - 0.5 - low).min_element()
        });
        boxes.fold(f64::NEG_INFINITY, f64::max)
    };
    let mut shaded = Vec::new();
    for (at, (brick, (hidden, of_brick))) in culling.bricks.iter().zip(states).enumerate() {
        for (slot, _) in brick::voxels(brick) {
            let id = (at as u32 * brick::BRICK_VOXELS + slot) as usize;
            let (inside, is_shaded) = (inside(culling.indices[id]), of_brick >> slot & 1 == 1);
            assert!(inside.abs() < 1e-3 || is_shaded == (inside > 0.0), "{name}: {id} is {inside} px on the screen");
            // In perspective boxes shrink: a shaded voxel is hidden once nothing of it is left on the screen.
            let is_one = is_shaded != (hidden >> slot & 1 == 1);
            assert!(geometry.eye.is_some() || is_one, "{name}: {id} is shaded or hidden");
            if is_shaded {
                shaded.push(id);
            }
        }
    }

    for &id in &shaded {
        let (record, index) = (&records[id], culling.indices[id]);
        let twin = twins[&index];
        let voxel = volume.grid().voxel_at(index);
        let layout::Splat { x_px, y_px, depth, from_eye, .. } = *record;
        let actual = DVec4::from([x_px, y_px, depth, from_eye].map(f64::from));
        let depth = match geometry.method {
            Method::ImageAligned => twin.depth + view.slabs.origin,
            _ => f64::from(geometry.slice(voxel)),
        };
        let expected = twin.center.extend(depth).extend(geometry.eye.map_or(1.0, |_| twin.depth));
        let place_error = place_error(&view, voxel, twin.center);
        for at in 0..4 {
            let what = format_args!("{name}: {voxel} at {actual}, not {expected}");
            assert_at_most((actual[at] - expected[at]).abs(), place_error[at], what);
        }

        let actual = decode(record);
        // The records leave factors that depend on the ray and on the section to the splat stage.
        let expected = twin.amount / geometry.scale(voxel);
        // The GPU computes the ray from the voxel's position on the screen.
        let ray_error =
            geometry.eye.map_or(0.0, |eye| place_error.x.hypot(place_error.y) * eye.pixel_per_depth + 16.0 * F32);
        let tolerance = tolerance(volume, index, &transfer, (scene, &geometry), ray_error, expected);
        for at in 0..4 {
            let what = format_args!("{name}: {voxel} is {actual}, not {expected}");
            assert_at_most((actual[at] - expected[at]).abs(), tolerance[at], what);
        }
    }
    shaded.len()
}

fn decode(record: &layout::Splat) -> DVec4 {
    DVec4::from_array([record.rg, record.rg >> 16, record.ba, record.ba >> 16].map(|bits| f16(bits as u16)))
}

fn f16(bits: u16) -> f64 {
    let (exponent, mantissa) = (i32::from(bits >> 10 & 31), f64::from(bits & 1023));
    assert!(bits < 0x7c00, "{bits:#06x} is negative or not finite");
    if exponent == 0 { mantissa * 2.0_f64.powi(-24) } else { (1024.0 + mantissa) * 2.0_f64.powi(exponent - 25) }
}

#[test]
fn f16_is_decoded() {
    assert_eq!(
        [0x3c00, 0x3555, 0x0001, 0x0400, 0x7bff].map(f16),
        [1.0, 0.333251953125, 2.0_f64.powi(-24), 2.0_f64.powi(-14), 65504.0]
    );
}

const DIMS: UVec3 = UVec3::new(11, 9, 8);

#[test]
fn compositing_and_light() {
    let volume = noise(DIMS, DVec3::ONE);
    for compositing in BY_AMOUNTS {
        for light in [Light::Headlight, Light::Direction(DVec3::new(2.0, -1.0, 3.0))] {
            let mut scene = oblique();
            scene.splatting.compositing = compositing;
            scene.shading.light = light;
            check(&format!("{compositing:?} {light:?}"), &volume, &scene);
        }
    }
}

#[test]
fn light_from_behind_has_no_half_vector() {
    let mut scene = oblique();
    scene.shading.light = Light::Direction(scene.camera.direction);
    check("opposite light", &noise(DIMS, DVec3::ONE), &scene);
}

#[test]
fn strong_and_sharp_highlights() {
    for (specular, shininess) in [(3.0, 0.5), (1.0, 1.0), (0.7, 200.0)] {
        let mut scene = oblique();
        scene.shading = Shading { ambient: 0.0, diffuse: 0.4, specular, shininess, ..Shading::default() };
        check(&format!("highlight {specular} {shininess}"), &noise(DIMS, DVec3::ONE), &scene);
    }
}

#[test]
fn shading_off() {
    let mut scene = oblique();
    scene.shading.enabled = false;
    check("unshaded", &noise(DIMS, DVec3::ONE), &scene);
}

#[test]
fn anisotropic_and_minified() {
    for spacing in [[1.0, 1.0, 5.0], [3.2, 3.2, 1.5], [0.2, 0.7, 0.4]].map(DVec3::from) {
        for height in [20.0, 150.0] {
            let mut scene = oblique();
            scene.camera = camera([-0.5, 0.4, 0.8], height * spacing.min_element());
            scene.splatting.compositing = Compositing::Exponential;
            check(&format!("spacing {spacing} height {height}"), &noise(DIMS, spacing), &scene);
        }
    }
}

/// Every voxel is lit and seen along its own ray, up to the near plane.
#[test]
fn any_eye_and_slices() {
    let gpu = gpu();
    let mut random = Random(19);
    let mut all = 0;
    for method in [Method::ImageAligned, Method::AxisAligned] {
        for light in [Light::Headlight, Light::Direction(DVec3::new(2.0, -1.0, 3.0))] {
            for spacing in SPACINGS.into_iter().cycle().take(8) {
                let volume = noise(DIMS, spacing.into());
                let mut scene = oblique();
                (scene.splatting.method, scene.shading.light) = (method, light);
                scene.splatting.compositing = random.pick(&[Compositing::Linear, Compositing::Exponential]);
                if method == Method::ImageAligned || !random.bits().is_multiple_of(3) {
                    scene.camera = random_eye(&mut random, volume.grid());
                }
                all += shaded(gpu, &format!("{method:?} {light:?} {spacing:?} {:?}", scene.camera), &volume, &scene);
            }
        }
    }
    assert!(all > 3000, "only {all} voxels were shaded");
}

/// There are borders on all sides, and axes without neighbours.
#[test]
fn flat_and_narrow() {
    for (dims, direction) in
        [([40, 9, 1], [0.9, 0.1, -0.3]), ([1, 13, 12], [0.1, 0.9, 0.3]), ([2, 1, 70], [0.3, 0.2, 0.9])]
    {
        let mut scene = oblique();
        scene.camera = camera(direction, 90.0);
        check(&format!("{dims:?}"), &noise(UVec3::from(dims), DVec3::new(1.0, 2.0, 1.5)), &scene);
    }
}

/// Values whose differences, and gradients whose squares, exceed `f32`; and spacings that do.
#[test]
fn extreme_values_and_spacings() {
    let extremes =
        [(1.0, 1.0), (1e36, 1.0), (1e-30, 1.0), (1e36, 1e40), (1e36, 1e50), (1e36, 1e51), (1.0, 6e99), (1.0, 1e-100)];
    for (value, spacing) in extremes {
        let spacing = spacing * DVec3::new(1.0, 1.5, 1.2);
        let mut random = Random(3);
        // Values have both signs, so differences are up to twice as large.
        let values = (0..DIMS.element_product()).map(|_| (value * random.uniform(-300.0, 300.0)) as f32).collect();
        let volume = Volume::new("extreme", DIMS, spacing, values).unwrap();
        let camera = camera([0.3, 0.9, -0.2], 40.0 * spacing.min_element());
        let mut scene = Scene { camera, ..scene(64, 48) }.with_transfer(transfer(
            &[(-200.0 * value, [0.1, 0.3, 0.9]), (250.0 * value, [1.0, 0.8, 0.6])],
            &[(-300.0 * value, 0.1), (100.0 * value, 0.3), (200.0 * value, 1.0)],
        ));
        let name = format!("values {value:e}, spacing {spacing:?}");
        check(&name, &volume, &scene);
        // Where f32 can represent the gradients, their opacity is tested, too.
        let gradient = 300.0 * value / spacing.min_element();
        if (1e-11..1e37).contains(&gradient) {
            let points = vec![(0.1 * gradient, 0.2), (0.5 * gradient, 0.9), (0.8 * gradient, 0.4)];
            scene.channels[0].transfer.gradient_opacity = Some(Ramp::new(points).unwrap());
            check(&format!("{name}, gradient opacity"), &volume, &scene);
        }
    }
}

/// The volume has more values than a layer of its texture: neighbours along every axis are in different layers, and the last row is not full.
#[test]
fn values_in_several_layers() {
    let dims = UVec3::new(2049, 1100, 2);
    // Around value 2048², which is at (1, 947, 1), and around the last one: the voxels that take part there, and their values.
    let places = [(0..32, 940..956, [20.0, 120.0]), (2021..2049, 1086..1100, [140.0, 255.0])];
    let mut random = Random(12);
    let values = (0..dims.element_product())
        .map(|index| {
            let (x, y) = (index % dims.x, index / dims.x % dims.y);
            let place = places.iter().find(|(xs, ys, _)| xs.contains(&x) && ys.contains(&y));
            let [low, high] = place.map_or([0.0, 10.0], |place| place.2);
            random.uniform(low, high) as f32
        })
        .collect();
    let volume = Volume::new("layers", dims, DVec3::new(1.0, 1.0, 1.5), values).unwrap();
    for (xs, ys, range) in places {
        let mut scene = oblique();
        scene.camera = camera([0.02, 0.5, -0.9], 30.0);
        scene.camera.center = Some(volume.grid().world_position(UVec3::new(xs.start + 14, ys.start + 7, 1)));
        scene.channels[0].transfer.iso_ranges = Some(vec![range]);
        check(&format!("layers, from {xs:?} {ys:?}"), &volume, &scene);
    }
}

#[test]
fn gradient_opacity_and_iso_ranges() {
    let mut scene = oblique();
    scene.channels[0].transfer.gradient_opacity = Some(Ramp::new(vec![(5.0, 0.0), (30.0, 0.25), (90.0, 1.0)]).unwrap());
    scene.channels[0].transfer.iso_ranges = Some(vec![[30.0, 90.0], [120.0, 240.0]]);
    check("gradient opacity", &noise(DIMS, DVec3::new(1.0, 2.0, 1.5)), &scene);
}

/// Voxels beside scattered holes and blocks of holes, and between holes on all sides; orthographic and in perspective.
#[test]
fn gradients_beside_holes() {
    let whole = noise(DIMS, DVec3::new(1.0, 2.0, 1.5));
    let mut random = Random(9);
    let mut is_hole = |name: &str, at: UVec3| match name {
        "scattered" => random.bits().is_multiple_of(4),
        "a block" => at.cmpge(DIMS / 3).all() && at.cmplt(2 * DIMS / 3).all(),
        _ => at.element_sum().is_multiple_of(2),
    };
    for name in ["scattered", "a block", "alternating"] {
        let sample = |(index, value)| if is_hole(name, whole.grid().voxel_at(index)) { f32::NAN } else { value };
        let values = (0..).zip(whole.values()).map(sample).collect();
        let volume = Volume::new(name, DIMS, whole.spacing(), values).unwrap();
        let mut scene = oblique();
        scene.channels[0].transfer.gradient_opacity =
            Some(Ramp::new(vec![(0.0, 0.2), (30.0, 0.25), (90.0, 1.0)]).unwrap());
        for compositing in [Compositing::Linear, Compositing::Exponential] {
            scene.splatting.compositing = compositing;
            check(name, &volume, &scene);
        }
        let projection = Projection::Perspective { fov_y: 60.0, distance: Some(25.0), near: Some(4.0) };
        scene.camera = Camera { projection, ..scene.camera };
        check(&format!("{name}, in perspective"), &volume, &scene);
    }
}

#[test]
fn no_gradient_is_ambient_light_only() {
    let values = vec![180.0; DIMS.element_product() as usize];
    let volume = Volume::new("constant", DIMS, DVec3::ONE, values).unwrap();
    check("constant", &volume, &oblique());
    let mut scene = oblique();
    scene.channels[0].transfer.gradient_opacity = Some(Ramp::new(vec![(0.0, 0.5), (30.0, 1.0)]).unwrap());
    check("constant, gradient opacity", &volume, &scene);
}

#[test]
fn many_control_points_and_values_exactly_on_them() {
    let mut random = Random(7);
    let mut points: Vec<f64> = (0..300).map(|_| random.uniform(0.0, 255.0).round() + 0.25).collect();
    points.sort_by(f64::total_cmp);
    points.dedup();
    let rgb = |random: &mut Random| [(); 3].map(|()| random.uniform(0.0, 1.0));
    let color: Vec<_> = points.iter().map(|&at| (at, rgb(&mut random))).collect();
    let opacity: Vec<_> = points.iter().rev().step_by(3).rev().map(|&at| (at, random.uniform(0.1, 1.0))).collect();
    let transfer = transfer(&color, &opacity);
    let mut scene = oblique().with_transfer(transfer);
    scene.splatting.compositing = Compositing::Exponential;
    check("many control points", &noise(DIMS, DVec3::ONE), &scene);

    let on_points = (0..DIMS.element_product() as usize).map(|i| points[i * 7 % points.len()] as f32).collect();
    let volume = Volume::new("on points", DIMS, DVec3::ONE, on_points).unwrap();
    check("values at control points", &volume, &scene);
    scene.channels[0].transfer = crate::common::transfer(&[(3.0, [0.2, 0.4, 0.8])], &[(100.25, 0.75)]);
    check("one control point", &volume, &scene);
}

/// Labels with complete and partial tables of their own, and some that only hide; labels after the last table use the main one.
#[test]
fn labels_have_their_own_tables() {
    let labelled = |labels: &[u16]| {
        let volume = noise(DIMS, DVec3::new(1.0, 2.0, 1.5));
        let mut random = Random(5);
        let values = (0..volume.values().len()).map(|_| labels[random.bits() as usize % labels.len()]).collect();
        let labels = Labels { origin: "noise".to_owned(), dims: DIMS, spacing: None, values, names: BTreeMap::new() };
        volume.with_labels(labels).unwrap()
    };
    let own = LabelTables {
        color: Some(Ramp::new(vec![(0.0, DVec3::new(0.9, 0.1, 0.2)), (200.0, DVec3::new(0.2, 0.6, 0.1))]).unwrap()),
        opacity: Some(Ramp::new(vec![(0.0, 0.9), (60.0, 0.0), (80.0, 0.0), (255.0, 0.5)]).unwrap()),
        gradient_opacity: Some(Ramp::new(vec![(5.0, 0.0), (30.0, 0.25), (90.0, 1.0)]).unwrap()),
        ..LabelTables::default()
    };
    let hidden = LabelTables { visible: false, ..own.clone() };
    let colored = LabelTables { color: own.color.clone(), ..LabelTables::default() };
    for [first, second, third, rest] in [[0, 1, 2, 3], [7, 300, 65535, 4], [1, 2, 65534, 65535]] {
        let volume = labelled(&[first, second, third, rest]);
        let mut scene = oblique();
        scene.splatting.compositing = Compositing::Exponential;
        scene.channels[0].transfer.labels = [(first, own.clone()), (second, hidden.clone()), (third, colored.clone())]
            .map(|(label, tables)| (u64::from(label), tables))
            .into();
        check(&format!("labels up to {third}"), &volume, &scene);
        scene.channels[0].transfer.gradient_opacity = Some(Ramp::new(vec![(20.0, 0.1), (70.0, 0.8)]).unwrap());
        scene.channels[0].transfer.iso_ranges = Some(vec![[20.0, 150.0], [180.0, 250.0]]);
        check(&format!("labels up to {third}, iso-ranges"), &volume, &scene);
        scene.channels[0].transfer.labels = [(u64::from(second), hidden.clone())].into();
        check(&format!("label {second} hidden"), &volume, &scene);
    }
}
