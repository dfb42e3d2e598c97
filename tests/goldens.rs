//! Small pictures of the builtin volumes, compared with those in `tests/goldens`.
//!
//! The native backend makes them, and draws every byte of them again on any machine, with every instruction set that it has (or with the one that
//! `SHEETSPLAT_SIMD` names). Each rasterizer on Mesa's lavapipe (or on the adapter that `SHEETSPLAT_TEST_ADAPTER` names) is held to them with a tolerance:
//! f32 sums are taken in other orders there, and lavapipe's approximate reciprocals differ between processors. A failing picture and its
//! differences are left in `target/goldens`. `SHEETSPLAT_BLESS=all`, or the names of scenes separated by commas, rewrites the goldens that fail, and only those.
#![expect(clippy::unwrap_used, reason = "tests")]

#[cfg(feature = "gpu")]
#[path = "common/adapter.rs"]
mod adapter;
mod golden_macro;
mod golden_scenes;

use std::path::{Path, PathBuf};

use glam::{DVec3, UVec3};
use sheetsplat::cpu::{CpuRenderer, Simd};
use sheetsplat::golden;
use sheetsplat::golden::{Bless, Comparison, Picture, Tolerance};
use sheetsplat::headless::{Backend, Headless, HeadlessOptions, Rendering};
use sheetsplat::scene::{Scene, VolumeSource};
use sheetsplat::settings::Classification;
use sheetsplat::volume::{SampleType, Volume};

use golden_scenes::SCENES;

/// Rasterizers find voxels hidden at different sheets, which may change the picture by one minus this: too little to see.
const OPACITY_THRESHOLD: f64 = 0.999;
/// The maximum size of a golden in bytes.
const MAX_BYTES: u64 = 64 << 10;

/// The name of the golden of a volume of colours, which is none of the builtin ones.
const COLORS: &str = "colors-photo";

/// A fruit of colours with a core, cut open, and its scene with the preset for photographs.
fn colors() -> (Volume, Scene) {
    let side = 40_u32;
    let color = |index: u32| {
        let place = UVec3::new(index % side, index / side % side, index / side / side).as_dvec3();
        let from_center = (place - (f64::from(side) - 1.0) / 2.0) / (0.45 * f64::from(side));
        let radius = from_center.length() * (1.0 + 0.1 * from_center.z.abs());
        let rgb = match radius {
            radius if radius > 1.0 => [0.0; 3],
            radius if radius > 0.88 => [200.0 + 40.0 * from_center.z, 60.0 + 50.0 * (9.0 * from_center.x).sin(), 30.0],
            radius if radius > 0.3 => [245.0, 235.0 - 30.0 * radius, 180.0],
            _ => [120.0, 70.0, 30.0],
        };
        let [red, green, blue] = rgb.map(|number: f64| number.round() as f32);
        [red, green, blue, 255.0]
    };
    let colors: Vec<[f32; 4]> = (0..side.pow(3)).map(color).collect();
    let volume = Volume::from_colors("fruit", UVec3::splat(side), DVec3::ONE, (&colors, SampleType::U8)).unwrap();
    let sets = [
        "preset=photo",
        "image={width=112,height=112}",
        "camera={direction=[0.4,0.8,-0.4],height=46.0}",
        "clip.planes=[[0,1,0.2,0]]",
        "camera.fit=volume",
    ]
    .map(str::to_owned);
    let mut scene = Scene::from_volume(VolumeSource::Memory, &sets).unwrap();
    scene.splatting.opacity_threshold = OPACITY_THRESHOLD;
    scene.splatting.classification = Classification::Before;
    (volume, scene)
}

/// The scene of a row of [`SCENES`].
fn scene((name, volume, settings): (&str, &str, &[&str])) -> Scene {
    let settings: Vec<String> =
        settings.iter().chain(&["camera.fit=volume"]).map(|&setting| setting.to_owned()).collect();
    let mut scene = Scene::from_volume(VolumeSource::Builtin(volume.to_owned()), &settings).unwrap();
    scene.splatting.opacity_threshold = OPACITY_THRESHOLD;
    let is_after = name.starts_with("after-");
    scene.splatting.classification = if is_after { Classification::After } else { Classification::Before };
    scene
}

fn failures() -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("goldens")
}

#[test]
fn the_native_backend_draws_the_goldens_byte_by_byte() {
    if let Bless::Names(names) = Bless::from_env().unwrap() {
        for name in names {
            let is_known =
                [COLORS, golden_macro::GRADIENT].contains(&name.as_str()) || SCENES.iter().any(|scene| scene.0 == name);
            assert!(is_known, "{}: no scene \"{name}\"", Bless::VARIABLE);
        }
    }
    let cpu = Headless::new(&HeadlessOptions::default().with_backend(Backend::Cpu)).unwrap();
    let named = std::env::var("SHEETSPLAT_SIMD").ok();
    let check = |name: &str, rendering: &Rendering| {
        assert!(
            named.as_ref().is_none_or(|named| *named == rendering.stats.driver),
            "{name}: {}",
            rendering.stats.driver
        );
        let golden = golden!(name).unwrap().tolerance(Tolerance::EXACT).failures(failures().join("cpu"));
        golden.check(rendering).err().map(|complaint| complaint.to_string())
    };
    let of_row = |row: (&str, _, _)| check(row.0, &cpu.render(&scene(row)).unwrap());
    let mut complaints: Vec<String> = SCENES.into_iter().filter_map(of_row).collect();
    let (volume, photo) = colors();
    complaints.extend(check(COLORS, &cpu.render_volume(volume, &photo).unwrap()));
    assert!(complaints.is_empty(), "{}", complaints.join("\n\n"));
}

/// If the environment names an instruction set, the test above has drawn with it; under an emulator the others would take long.
#[test]
fn every_instruction_set_draws_the_goldens_byte_by_byte() {
    if std::env::var_os("SHEETSPLAT_SIMD").is_some() {
        return;
    }
    let levels = Simd::available();
    assert!(levels.len() >= 2, "only {levels:?}");
    let mut complaints = Vec::new();
    for row in SCENES {
        let scene = scene(row);
        let volume = scene.load_volume().unwrap();
        let mut renderer = CpuRenderer::new(volume, &scene).unwrap();
        let golden = Picture::open(&golden!(row.0).unwrap().path()).unwrap().image;
        for &level in &levels {
            renderer.set_simd(level).unwrap();
            let rendering = renderer.draw().unwrap();
            assert_eq!(rendering.stats.driver, level.name(), "{}", row.0);
            let comparison = Comparison::new(&rendering.image, &golden, Tolerance::EXACT).unwrap();
            if !comparison.passes() {
                complaints.push(format!("{} with {}: {comparison}", row.0, level.name()));
            }
        }
    }
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}

#[test]
fn every_golden_is_of_a_scene_small_and_made_by_the_native_backend() {
    let names = SCENES.iter().map(|scene| scene.0).chain([COLORS]);
    let paths: Vec<PathBuf> = names.map(|name| golden!(name).unwrap().path()).collect();
    for file in std::fs::read_dir(paths[0].parent().unwrap()).unwrap() {
        let path = file.unwrap().path();
        let shown = path.display();
        assert!(paths.contains(&path), "{shown} is of no scene");
        let bytes = std::fs::metadata(&path).unwrap().len();
        assert!(bytes <= MAX_BYTES, "{shown} has {bytes} bytes, allowed: {MAX_BYTES}");
        // A golden that names no backend would be compared with the widest tolerance.
        let made_on = Picture::open(&path).unwrap().made_on;
        assert!(made_on.as_ref().is_some_and(|it| it.adapter == "cpu backend"), "{shown}: made on {made_on:?}");
    }
}

/// The rasterizers' pictures.
#[cfg(feature = "gpu")]
mod gpu {
    use sheetsplat::golden;
    use sheetsplat::golden::{Comparison, Picture, Tolerance};
    use sheetsplat::headless::{GpuHeadless, HeadlessOptions};
    use sheetsplat::image::PngDepth;
    use sheetsplat::scene::Scene;
    use sheetsplat::settings::{Classification, FootprintForm, Rasterizer};

    use super::adapter::adapter;
    use super::{COLORS, SCENES, colors, failures, scene};

    /// The steps of 255 by which a channel of the GPU's pictures may differ.
    const TOLERANCE: u8 = 3;
    /// The fraction of the pixels that may differ by more.
    const OUTLIERS: f64 = 0.001;

    /// Whether a rasterizer draws the scene.
    fn is_drawn_by(rasterizer: Rasterizer, scene: &Scene) -> bool {
        let splatting = &scene.splatting;
        match rasterizer {
            Rasterizer::Tiles if splatting.classification == Classification::After => true,
            Rasterizer::Tiles => splatting.footprint != FootprintForm::Sections,
            _ => true,
        }
    }

    #[test]
    fn the_gpus_pictures_look_like_the_goldens() {
        let options = HeadlessOptions::default().with_adapter(adapter());
        let gpu = GpuHeadless::new(&options)
            .unwrap_or_else(|error| panic!(".ci/setup --lavapipe installs what is missing: {error}"));
        let tolerance = Tolerance::new(TOLERANCE, OUTLIERS).unwrap();
        let mut complaints = Vec::new();
        let (volume, photo) = colors();
        let image = gpu.render_volume(volume, &photo).unwrap().image;
        let golden = Picture::open(&golden!(COLORS).unwrap().path()).unwrap().image;
        let comparison = Comparison::new(&image, &golden, tolerance).unwrap();
        complaints.extend((!comparison.passes()).then(|| format!("{COLORS}: {comparison}")));
        for row in SCENES {
            let mut scene = scene(row);
            let golden = Picture::open(&golden!(row.0).unwrap().path()).unwrap().image;
            for rasterizer in [Rasterizer::Quads, Rasterizer::Tiles] {
                if !is_drawn_by(rasterizer, &scene) {
                    continue;
                }
                scene.splatting.rasterizer = rasterizer;
                let image = gpu.render(&scene).unwrap_or_else(|error| panic!("{}: {error}", row.0)).image;
                let comparison = Comparison::new(&image, &golden, tolerance).unwrap();
                if !comparison.passes() {
                    let folder = failures().join(format!("{rasterizer:?}").to_lowercase());
                    std::fs::create_dir_all(&folder).unwrap();
                    let left = |what: &str| folder.join(format!("{}-{what}.png", row.0));
                    image.save(&left("actual"), PngDepth::Eight).unwrap();
                    comparison.difference_image().save(&left("difference"), PngDepth::Eight).unwrap();
                    complaints.push(format!("{} by {rasterizer:?}: {comparison}, see {}", row.0, folder.display()));
                }
            }
        }
        assert!(complaints.is_empty(), "{}", complaints.join("\n\n"));
    }
}
