//! Small pictures of the builtin volumes by each rasterizer, compared with those in `tests/goldens`.
//!
//! They are made on Mesa's lavapipe, and compared there only. It draws the same picture in every run, but differs between
//! processors by up to 3 of 255 (approximate reciprocals): so much is tolerated, and a few outliers. What a failing
//! picture looks like, and where it differs, is left in `target/goldens`. `SHEETSPLAT_BLESS=all`, or the names of scenes
//! with commas between them, rewrites the goldens that fail, and only those.
#![expect(clippy::unwrap_used, reason = "tests")]

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{DynamicImage, Rgb, RgbImage, RgbaImage};
use sheetsplat::headless::{Headless, HeadlessOptions};
use sheetsplat::image::PngDepth;
use sheetsplat::scene::{Scene, VolumeSource};
use sheetsplat::splatting::{FootprintForm, Rasterizer};

/// Steps of 255 that a channel may differ by.
const TOLERANCE: u8 = 3;
/// One pixel in so many may have a channel that differs by more.
const PIXELS_PER_OUTLIER: usize = 1000;
/// Rasterizers find voxels to be hidden at different sheets, which may change the picture by one minus this: too little to see.
const OPACITY_THRESHOLD: f64 = 0.999;
/// Bytes that a golden may have.
const MAX_BYTES: u64 = 64 << 10;

/// Name, builtin volume, and the settings that differ from the defaults.
const SCENES: [(&str, &str, &[&str]); 12] = [
    ("head", "head:72", &["image={width=160,height=160}", "camera={direction=[0.5,0.85,-0.2],height=170.0}"]),
    (
        "head-xray",
        "head:64",
        &[
            "image={width=128,height=96}",
            "camera={direction=[1,0.2,0],height=180.0}",
            "transfer={color=[[0,[1,1,1]]], opacity=[[20,0],[255,0.07]]}",
            "shading.enabled=false",
            "splatting.compositing=\"xray\"",
        ],
    ),
    (
        "head-labels",
        "head:64",
        &[
            "image={width=144,height=144,background=[0.1,0.1,0.15,1]}",
            "camera={direction=[0.75,0.6,-0.2],height=170.0}",
            "transfer={opacity=[[0,0]],label=[\
             {label=1,color=[[0,[0.95,0.75,0.6]]],opacity=[[0,0.06]]},\
             {label=4,color=[[0,[0.85,0.45,0.45]]],opacity=[[60,0],[120,0.9]]},\
             {label=5,color=[[0,[0.85,0.45,0.45]]],opacity=[[60,0],[120,0.9]]},\
             {label=7,color=[[240,[0.95,0.95,1]],[255,[0.1,0.3,0.7]]],opacity=[[0,0.9]]},\
             {label=2,visible=false,opacity=[[0,1]]}]}",
            "splatting.compositing=\"exponential\"",
        ],
    ),
    (
        "head-translucent-back-to-front",
        "head:56",
        &[
            "image={width=128,height=128,background=[1,1,1,1]}",
            "camera={direction=[-0.7,0.6,-0.4],height=170.0}",
            "transfer.opacity=[[30,0],[60,0.05],[110,0.05],[200,0.9]]",
            "splatting={order=\"back-to-front\",slab_width=2.0,footprint=\"sections\"}",
        ],
    ),
    ("nerve", "nerve:128", &["image={width=160,height=160}", "camera={direction=[0.3,0.4,-0.85],height=480.0}"]),
    (
        "nerve-minified",
        "nerve:160",
        &["image={width=64,height=48,background=[0.1,0.1,0.3,1]}", "camera.direction=[0.2,0.9,-0.5]"],
    ),
    (
        "tomato-exponential",
        "tomato:72",
        &[
            "image={width=144,height=112}",
            "camera={direction=[0.3,0.5,-0.8],height=220.0}",
            "transfer={color=[[40,[0.9,0.2,0.1]],[120,[1,0.6,0.2]],[220,[0.9,1,0.6]]],opacity=[[30,0],[90,0.02],[200,0.3]]}",
            "splatting={compositing=\"exponential\",slab_width=0.5}",
        ],
    ),
    (
        "tomato-transparent-background",
        "tomato:64",
        &[
            "image={width=128,height=128,background=[0,0,0,0]}",
            "camera={direction=[0.1,1,-0.4],height=280.0}",
            "splatting={footprint=\"sections\",radius=1.4}",
        ],
    ),
    (
        "nerve-perspective",
        "nerve:144",
        &[
            "image={width=160,height=120}",
            "camera={projection=\"perspective\",fov_y=70.0,distance=330.0,near=20.0,direction=[0.5,0.6,-0.4],center=[40,0,0]}",
        ],
    ),
    (
        "head-axis-aligned",
        "head:72",
        &[
            "image={width=128,height=128}",
            "camera={direction=[0.62,0.66,-0.35],height=170.0}",
            "splatting={method=\"axis-aligned\",compositing=\"exponential\"}",
        ],
    ),
    (
        "cube-fixed-light",
        "cube:40",
        &[
            "image={width=128,height=128,background=[1,1,1,1]}",
            "camera={direction=[0.55,0.7,-0.45],height=70.0}",
            "shading={light=[-1,-2,4],specular=0.5,shininess=8.0}",
            "splatting.falloff=1.2",
        ],
    ),
    (
        "marschner-lobb-sections",
        "marschner-lobb:48",
        &[
            "image={width=160,height=128,background=[0.2,0.2,0.2,1]}",
            "camera={direction=[0.2,0.7,-0.7],height=70.0}",
            "transfer={color=[[100,[0.3,0.5,0.9]],[150,[1,0.9,0.5]]],opacity=[[115,0],[130,0.9]]}",
            "splatting={footprint=\"sections\",slab_width=0.7}",
        ],
    ),
];

/// What a picture and its golden differ in.
struct Difference {
    max: u8,
    mean: f64,
    outliers: usize,
    picture: RgbImage,
}

impl Difference {
    fn new(actual: &RgbaImage, golden: &RgbaImage) -> Self {
        let mut difference =
            Self { max: 0, mean: 0.0, outliers: 0, picture: RgbImage::new(actual.width(), actual.height()) };
        for ((actual, golden), out) in actual.pixels().zip(golden.pixels()).zip(difference.picture.pixels_mut()) {
            let channels: [u8; 4] = std::array::from_fn(|i| actual.0[i].abs_diff(golden.0[i]));
            let most = channels.into_iter().max().unwrap();
            difference.max = difference.max.max(most);
            difference.mean += channels.into_iter().map(f64::from).sum::<f64>() / 4.0;
            difference.outliers += usize::from(most > TOLERANCE);
            // Within the tolerance dark grey, beyond it red.
            let shade = most.saturating_mul(20);
            *out = if most > TOLERANCE { Rgb([255, shade / 2, 0]) } else { Rgb([shade, shade, shade]) };
        }
        difference.mean /= f64::from(actual.width() * actual.height());
        difference
    }
}

const GOLDENS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/goldens");

fn golden_path(name: &str) -> PathBuf {
    Path::new(GOLDENS).join(name).with_extension("png")
}

/// Why a picture does not pass, if so.
fn complaint(name: &str, actual: &RgbaImage, folder: &Path) -> Option<String> {
    let path = golden_path(name);
    let golden = match image::open(&path) {
        Ok(golden) => golden.to_rgba8(),
        Err(error) => return Some(format!("{}: {error}", path.display())),
    };
    let bytes = std::fs::metadata(&path).unwrap().len();
    if bytes > MAX_BYTES {
        return Some(format!("{} has {bytes} bytes, allowed: {MAX_BYTES}", path.display()));
    }
    if golden.dimensions() != actual.dimensions() {
        return Some(format!("is {:?} pixels, its golden {:?}", actual.dimensions(), golden.dimensions()));
    }
    let Difference { max, mean, outliers, picture } = Difference::new(actual, &golden);
    let pixels = actual.pixels().len();
    if outliers <= pixels / PIXELS_PER_OUTLIER {
        return None;
    }
    let path = folder.join(format!("{name}-difference.png"));
    picture.save(&path).unwrap();
    Some(format!(
        "differs by {max} at most, by {mean:.3} on average, by more than {TOLERANCE} in {outliers} of {pixels} pixels: {}",
        path.display()
    ))
}

/// Writes a golden as small as PNG allows.
fn bless(name: &str, actual: &RgbaImage) {
    let opaque = actual.pixels().all(|pixel| pixel.0[3] == 255);
    let picture = DynamicImage::ImageRgba8(actual.clone());
    let picture = if opaque { DynamicImage::ImageRgb8(picture.to_rgb8()) } else { picture };
    let path = golden_path(name);
    std::fs::create_dir_all(GOLDENS).unwrap();
    let file = std::io::BufWriter::new(std::fs::File::create(&path).unwrap());
    let encoder = PngEncoder::new_with_quality(file, CompressionType::Best, FilterType::Adaptive);
    picture.write_with_encoder(encoder).unwrap();
    println!("blessed {}", path.display());
}

#[test]
fn pictures_look_like_their_goldens() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap().join("goldens");
    std::fs::create_dir_all(&folder).unwrap();
    let blessed = std::env::var("SHEETSPLAT_BLESS").unwrap_or_default();
    let blessed: BTreeSet<&str> = blessed.split(',').filter(|name| !name.is_empty()).collect();
    for name in &blessed {
        assert!(*name == "all" || SCENES.iter().any(|scene| scene.0 == *name), "SHEETSPLAT_BLESS: no scene \"{name}\"");
    }
    let options = HeadlessOptions { adapter: Some("llvmpipe".to_owned()), ..HeadlessOptions::default() };
    let gpu = Headless::new(&options)
        .unwrap_or_else(|error| panic!(".ci/setup --lavapipe installs what is missing: {error}"));
    let mut complaints = Vec::new();
    for (name, volume, settings) in SCENES {
        let settings: Vec<String> = settings.iter().map(|&setting| setting.to_owned()).collect();
        let mut scene = Scene::from_volume(VolumeSource::Builtin(volume.to_owned()), &settings).unwrap();
        scene.splatting.opacity_threshold = OPACITY_THRESHOLD;
        for rasterizer in [Rasterizer::Quads, Rasterizer::Tiles] {
            if (rasterizer, scene.splatting.footprint) == (Rasterizer::Tiles, FootprintForm::Sections) {
                continue;
            }
            scene.splatting.rasterizer = rasterizer;
            let picture = folder.join(format!("{name}-{rasterizer:?}.png").to_lowercase());
            gpu.render(&scene).unwrap().image.save(&picture, PngDepth::Eight).unwrap();
            let actual = image::open(&picture).unwrap().to_rgba8();
            let complaint = complaint(name, &actual, &folder);
            if complaint.is_some() && (blessed.contains("all") || blessed.contains(name)) {
                bless(name, &actual);
                continue;
            }
            let Some(complaint) = complaint else {
                std::fs::remove_file(&picture).unwrap();
                continue;
            };
            complaints.push(format!("{name}, {rasterizer:?} ({}): {complaint}", picture.display()));
        }
    }
    assert!(complaints.is_empty(), "SHEETSPLAT_BLESS rewrites what is right:\n{}", complaints.join("\n"));
}

#[test]
fn every_golden_has_a_scene() {
    for file in std::fs::read_dir(GOLDENS).unwrap() {
        let path = file.unwrap().path();
        assert!(SCENES.iter().any(|scene| golden_path(scene.0) == path), "{} is of no scene", path.display());
    }
}

/// The comparison itself: it must see what is there to see.
#[test]
fn differences_are_counted() {
    let golden = RgbaImage::from_pixel(40, 50, image::Rgba([100, 100, 100, 255]));
    let mut actual = golden.clone();
    actual.put_pixel(3, 4, image::Rgba([103, 97, 100, 255]));
    let within = Difference::new(&actual, &golden);
    assert_eq!((within.max, within.outliers), (3, 0));
    actual.put_pixel(5, 6, image::Rgba([100, 100, 104, 255]));
    actual.put_pixel(7, 8, image::Rgba([100, 100, 100, 155]));
    let beyond = Difference::new(&actual, &golden);
    assert_eq!((beyond.max, beyond.outliers), (100, 2));
    assert!((beyond.mean - (6.0 + 4.0 + 100.0) / 4.0 / 2000.0).abs() < 1e-12);
}
