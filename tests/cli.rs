//! The program as a user runs it: outputs, statistics, messages and exit codes. Needs a GPU or lavapipe.
#![cfg(feature = "cli")]
#![expect(clippy::unwrap_used, reason = "tests")]

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use glam::DVec3;
use serde_json::Value;

/// A temporary folder, which is also the program's current directory.
struct Folder(tempfile::TempDir);

/// What a run of the program left behind.
struct Run {
    arguments: String,
    code: Option<i32>,
    stdout: String,
    stderr: String,
}

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        fs::write(self.path(name), bytes).unwrap();
    }

    fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap()
    }

    /// The names of the files and folders in it.
    fn names(&self) -> BTreeSet<String> {
        fs::read_dir(self.0.path()).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
    }

    /// An NRRD file of floats.
    fn write_nrrd(&self, name: &str, dims: [usize; 3], spacing: [f64; 3], values: &[f32]) {
        assert_eq!(values.len(), dims.iter().product::<usize>());
        let [nx, ny, nz] = dims;
        let [sx, sy, sz] = spacing;
        let header = format!(
            "NRRD0004\ntype: float\ndimension: 3\nsizes: {nx} {ny} {nz}\nspacings: {sx:e} {sy:e} {sz:e}\n\
             encoding: raw\nendian: little\n\n"
        );
        let bytes = values.iter().flat_map(|value| value.to_le_bytes());
        self.write(name, header.into_bytes().into_iter().chain(bytes).collect::<Vec<u8>>());
    }

    /// Runs the program with arguments separated by spaces.
    fn run(&self, arguments: &str) -> Run {
        self.run_in("", arguments)
    }

    fn run_in(&self, folder: &str, arguments: &str) -> Run {
        let output = Command::new(env!("CARGO_BIN_EXE_sheetsplat"))
            .env("WGPU_ADAPTER_NAME", "llvmpipe")
            .args(arguments.split(' '))
            .current_dir(self.path(folder))
            .output()
            .unwrap();
        Run {
            arguments: arguments.to_owned(),
            code: output.status.code(),
            stdout: String::from_utf8(output.stdout).unwrap(),
            stderr: String::from_utf8(output.stderr).unwrap(),
        }
    }

    /// Renders what must succeed.
    fn render(&self, arguments: &str) {
        self.run(&format!("render {arguments}")).assert_success();
    }

    /// Renders into an NPY file and reads it: width, height, pixels.
    fn pixels(&self, arguments: &str) -> (usize, usize, Vec<[f32; 4]>) {
        self.render(&format!("{arguments} -o pixels.npy"));
        self.read_npy("pixels.npy")
    }

    fn read_npy(&self, name: &str) -> (usize, usize, Vec<[f32; 4]>) {
        let bytes = self.read(name);
        let file = npyz::NpyFile::new(bytes.as_slice()).unwrap();
        let [height, width, 4] = *file.shape() else { panic!("shape {:?}", file.shape()) };
        assert_eq!(file.order(), npyz::Order::C);
        let channels: Vec<f32> = file.into_vec().unwrap();
        (width as usize, height as usize, channels.as_chunks().0.to_vec())
    }

    fn stats(&self, arguments: &str) -> Value {
        self.render(&format!("{arguments} -o stats.npy --stats stats.json"));
        serde_json::from_slice(&self.read("stats.json")).unwrap()
    }
}

impl Run {
    fn assert_success(&self) {
        assert_eq!(self.code, Some(0), "{}\n{}", self.arguments, self.stderr);
        assert_eq!(self.stdout, "", "{}", self.arguments);
    }

    /// A failure that says all of `words`, in any place, and only on stderr.
    fn assert_failure(&self, code: i32, words: &[&str]) {
        let Self { arguments, stderr, .. } = self;
        assert!(!stderr.contains("panicked"), "{arguments}\n{stderr}");
        assert_eq!(self.code, Some(code), "{arguments}\n{stderr}");
        assert_eq!(self.stdout, "", "{arguments}");
        for word in words {
            assert!(stderr.contains(word), "{arguments}: no {word:?} in\n{stderr}");
        }
    }
}

/// Decibels over the pixels where either image differs from the background (premultiplied).
fn psnr(a: &[[f32; 4]], b: &[[f32; 4]], background: [f32; 4]) -> f64 {
    assert_eq!(a.len(), b.len());
    let pixels: Vec<_> = a.iter().zip(b).filter(|&(a, b)| *a != background || *b != background).collect();
    assert!(pixels.len() > 50, "only {} pixels show anything", pixels.len());
    let squares: f64 =
        pixels.iter().flat_map(|(a, b)| a.iter().zip(*b)).map(|(&a, &b)| (f64::from(a) - f64::from(b)).powi(2)).sum();
    -10.0 * (squares / (pixels.len() * 4) as f64).log10()
}

const BLACK: [f32; 4] = [0.0, 0.0, 0.0, 1.0];

/// A small picture with everything between transparent and opaque in it.
const SMALL: &str = "builtin:marschner-lobb:12 --set image.width=27 --set image.height=20 \
                     --set transfer.opacity=[[60,0],[200,0.6]] --set camera.direction=[0.3,0.9,-0.2]";

/// The reference backend culls nothing.
const UNCULLED: &str = "--set splatting.culling=false";

const TRANSPARENT: &str = "--set image.background=[0.2,0.4,0.6,0.25]";

#[test]
fn exr_and_npy_hold_the_same_premultiplied_floats() {
    let folder = Folder::new();
    folder.render(&format!("{SMALL} {TRANSPARENT} -o out.exr"));
    folder.render(&format!("{SMALL} {TRANSPARENT} -o out.npy"));
    let (width, height, npy) = folder.read_npy("out.npy");
    assert_eq!((width, height), (27, 20));
    let image::DynamicImage::ImageRgba32F(exr) = image::open(folder.path("out.exr")).unwrap() else {
        panic!("an EXR of other than f32 RGBA");
    };
    assert_eq!(exr.dimensions(), (27, 20));
    assert_eq!(exr.into_raw(), npy.as_flattened());
    let [r, g, b, a] = npy[0];
    assert_eq!([r, g, b, a].map(|channel| (channel * 1e6).round()), [50_000.0, 100_000.0, 150_000.0, 250_000.0]);
    let alphas = npy.iter().map(|pixel| pixel[3]);
    assert!(alphas.clone().fold(0.0, f32::max) > 0.9, "nothing is nearly opaque");
    assert!(npy.iter().all(|pixel| pixel[..3].iter().all(|&channel| channel <= pixel[3] + 1e-6)), "not premultiplied");
}

#[test]
fn png_holds_the_rounded_floats_with_straight_alpha() {
    let folder = Folder::new();
    for background in [TRANSPARENT, "--set image.background=[1,1,1,0]", "--set image.background=[0.1,0.2,0.9,1]"] {
        let (width, _, pixels) = folder.pixels(&format!("{SMALL} {background}"));
        folder.render(&format!("{SMALL} {background} -o 8.png"));
        folder.render(&format!("{SMALL} {background} -o 16.png --depth 16"));
        let (eight, sixteen) = match ["8.png", "16.png"].map(|name| image::open(folder.path(name)).unwrap()) {
            [image::DynamicImage::ImageRgba8(eight), image::DynamicImage::ImageRgba16(sixteen)] => (eight, sixteen),
            other => panic!("PNG types {:?}", other.map(|image| image.color())),
        };
        for (at, premultiplied) in pixels.iter().enumerate() {
            let [r, g, b, a] = premultiplied.map(f64::from);
            let straight = if a > 0.0 { [r / a, g / a, b / a, a] } else { [0.0; 4] };
            let (x, y) = ((at % width) as u32, (at / width) as u32);
            for (channel, wanted) in straight.map(|channel| channel.clamp(0.0, 1.0)).into_iter().enumerate() {
                let in_8 = f64::from(eight.get_pixel(x, y)[channel]);
                let in_16 = f64::from(sixteen.get_pixel(x, y)[channel]);
                assert!((in_8 - wanted * 255.0).abs() < 0.501, "{background} {x} {y} {channel}: {in_8} {wanted}");
                assert!((in_16 - wanted * 65535.0).abs() < 0.55, "{background} {x} {y} {channel}: {in_16} {wanted}");
            }
        }
    }
    // The last background is opaque, the first is not: the corner shows nothing else.
    folder.render(&format!("{SMALL} {TRANSPARENT} -o 8.png"));
    assert_eq!(image::open(folder.path("8.png")).unwrap().to_rgba8().get_pixel(0, 0).0, [51, 102, 153, 64]);
}

#[test]
fn two_runs_write_the_same_bytes() {
    let folder = Folder::new();
    for extension in ["png", "exr", "npy"] {
        for name in ["first", "second"] {
            folder.render(&format!("{SMALL} {TRANSPARENT} -o {name}.{extension}"));
        }
        let [first, second] = ["first", "second"].map(|name| folder.read(&format!("{name}.{extension}")));
        assert_eq!(first, second, "{extension}");
    }
}

#[test]
fn an_output_file_is_replaced_whole_and_readable() {
    let folder = Folder::new();
    folder.write("out.png", vec![b'x'; 1 << 20]);
    folder.render(&format!("{SMALL} -o out.png"));
    assert!(image::open(folder.path("out.png")).is_ok());
    assert_eq!(folder.names(), BTreeSet::from(["out.png".to_owned()]), "no temporary file stays");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        folder.write("any", "");
        let mode = |name: &str| fs::metadata(folder.path(name)).unwrap().permissions().mode();
        assert_eq!(mode("out.png"), mode("any"), "like any file the user makes");
    }
}

#[test]
fn a_volume_file_needs_no_scene() {
    let folder = Folder::new();
    let values: Vec<f32> = (0..1000)
        .map(|i| DVec3::new(f64::from(i % 10), f64::from(i / 10 % 10), f64::from(i / 100)) - 4.5)
        .map(|p| if p.length() < 3.0 { 900.0 } else { -1000.0 })
        .collect();
    folder.write_nrrd("ball.nrrd", [10, 10, 10], [1.0, 1.0, 1.0], &values);
    let (width, height, pixels) = folder.pixels("ball.nrrd");
    assert_eq!((width, height), (512, 512), "the default size");
    let at = |x: usize, y: usize| pixels[y * width + x];
    assert_eq!(at(0, 0), BLACK);
    assert!(at(256, 256)[0] > 0.2, "the ball is in the middle: {:?}", at(256, 256));
    assert!(pixels.iter().flatten().all(|channel| (0.0..=1.001).contains(channel)));
}

#[test]
fn a_builtin_volume_needs_no_scene() {
    let folder = Folder::new();
    folder.render("builtin:head:16 -o head.png");
    let image = image::open(folder.path("head.png")).unwrap().to_rgba8();
    assert_eq!(image.dimensions(), (512, 512));
    let lit = image.pixels().filter(|pixel| pixel.0[0] > 60).count();
    assert!(lit > 20_000, "only {lit} pixels show the head");
}

#[test]
fn sets_are_what_a_scene_file_says() {
    let folder = Folder::new();
    folder.write(
        "scene.toml",
        "[volume]\nbuiltin = \"marschner-lobb:12\"\nspacing = [1, 2, 1.5]\n\
         [camera]\ndirection = [1, 1, 0.5]\nup = [0, 1, 0]\nheight = 20\n\
         [image]\nwidth = 30\nheight = 21\n[transfer]\nopacity = [[60, 0], [200, 0.6]]\n\
         [splatting]\ncompositing = \"exponential\"\nfootprint = \"sections\"\nslab_width = 0.5\n",
    );
    folder.write("plain.toml", "[volume]\nbuiltin = \"cube:4\"\n[splatting]\nslab_width = 3\n");
    folder.render("scene.toml -o scene.npy");
    let sets = "--set volume.spacing=[1,2,1.5] --set camera={direction=[1,1,0.5],up=[0,1,0],height=20} \
                --set image.width=30 --set image.height=21 --set transfer.opacity=[[60,0],[200,0.6]] \
                --set splatting.compositing=exponential --set splatting.footprint=\"sections\" \
                --set splatting.slab_width=0.5";
    folder.render(&format!("builtin:marschner-lobb:12 {sets} -o sets.npy"));
    folder.render(&format!("plain.toml --set volume.builtin=marschner-lobb:12 {sets} -o overridden.npy"));
    assert_eq!(folder.read("scene.npy"), folder.read("sets.npy"));
    assert_eq!(folder.read("scene.npy"), folder.read("overridden.npy"));
}

#[test]
fn paths_are_relative_to_the_scene_file() {
    let folder = Folder::new();
    for name in ["scenes", "data", "elsewhere"] {
        fs::create_dir(folder.path(name)).unwrap();
    }
    let values: Vec<f32> = (0..64).map(|i| (i % 7) as f32).collect();
    folder.write_nrrd("data/small.nrrd", [4, 4, 4], [1.0, 1.0, 2.0], &values);
    folder.write("scenes/scene.toml", "[volume]\npath = \"../data/small.nrrd\"\n[image]\nwidth = 16\nheight = 16\n");
    folder.run_in("elsewhere", "render ../scenes/scene.toml -o here.npy").assert_success();
    folder.run_in("scenes", "render scene.toml -o ../elsewhere/there.npy").assert_success();
    folder
        .run_in("data", "render small.nrrd --set image={width=16,height=16} -o ../elsewhere/file.npy")
        .assert_success();
    assert_eq!(folder.read("elsewhere/here.npy"), folder.read("elsewhere/there.npy"));
    assert_eq!(folder.read("elsewhere/here.npy"), folder.read("elsewhere/file.npy"));
}

/// The keys of SPEC §8, and what the program counts besides; no more and no less.
const STATS_KEYS: [&str; 20] = [
    "adapter",
    "backend",
    "bricks_tested",
    "bricks_visited",
    "driver",
    "frame_ms",
    "gpu_bytes",
    "height",
    "load_ms",
    "prepare_ms",
    "quads",
    "sections_rasterized",
    "sections_total",
    "sheets",
    "tiles_composited",
    "tiles_total",
    "voxels_in_range",
    "voxels_shaded",
    "voxels_total",
    "width",
];

fn keys(stats: &Value) -> Vec<&str> {
    let mut keys: Vec<&str> = stats.as_object().unwrap().keys().map(String::as_str).collect();
    keys.sort_unstable();
    keys
}

fn count(stats: &Value, key: &str) -> u64 {
    stats[key].as_u64().unwrap_or_else(|| panic!("{key} in {stats}"))
}

/// Asserts counts by key.
fn assert_counts(what: &str, stats: &Value, expected: &[(&str, u64)]) {
    for &(key, expected) in expected {
        assert_eq!(count(stats, key), expected, "{what}: {key} in {stats:#}");
    }
}

#[test]
fn stats_of_a_single_voxel() {
    let folder = Folder::new();
    folder.write_nrrd("one.nrrd", [1, 1, 1], [1.0, 1.0, 1.0], &[1.0]);
    let haze = "--set transfer.opacity=[[0,0.5]] --set image.width=40 --set image.height=70";
    // In the middle of plane 0: two slabs before it, two behind.
    let stats = folder.stats(&format!("one.nrrd {haze}"));
    assert_eq!(keys(&stats), STATS_KEYS);
    let (tiles, sheets) = (2 * 3, 4);
    let expected = [
        ("width", 40),
        ("height", 70),
        ("voxels_total", 1),
        ("voxels_in_range", 1),
        ("voxels_shaded", 1),
        ("sections_total", 4),
        ("sections_rasterized", 4),
        ("sheets", sheets),
        ("tiles_total", tiles * sheets),
    ];
    assert_counts("one voxel", &stats, &expected);
    assert!(count(&stats, "tiles_composited") <= tiles * sheets);
    for key in ["load_ms", "prepare_ms", "frame_ms"] {
        let milliseconds = stats[key].as_f64().unwrap();
        assert!((0.0..600_000.0).contains(&milliseconds), "{key}: {milliseconds}");
    }
    // At the least the sheet, the compositing buffer and the target, 16 bytes a pixel in the last two.
    assert!(count(&stats, "gpu_bytes") > 40 * 70 * (8 + 16 + 16), "{stats:#}");
    for key in ["adapter", "driver", "backend"] {
        assert!(!stats[key].as_str().unwrap().is_empty(), "{key}");
    }

    // Half a spacing off the planes: a fifth slab. Its neighbour does not take part.
    folder.write_nrrd("two.nrrd", [1, 2, 1], [1.0, 1.0, 1.0], &[1.0, 9.0]);
    let stats = folder.stats(&format!("two.nrrd {haze} --set transfer.iso_ranges=[[0,5]]"));
    let expected = [("voxels_total", 2), ("voxels_in_range", 1), ("sections_total", 5), ("sheets", 5)];
    assert_counts("half a spacing", &stats, &expected);

    // None takes part.
    let stats = folder.stats("one.nrrd --set transfer.opacity=[[0,0]]");
    let none = ["voxels_in_range", "voxels_shaded", "sections_total", "sections_rasterized", "sheets", "tiles_total"];
    assert_counts("none takes part", &stats, &none.map(|key| (key, 0)));

    // Off the screen: counted, not drawn.
    let stats = folder.stats(&format!("one.nrrd {haze} --set camera.center=[1000,0,0]"));
    let expected = [("voxels_in_range", 1), ("sections_total", 4), ("sections_rasterized", 0), ("sheets", 4)];
    assert_counts("off the screen", &stats, &expected);
}

/// SPEC §5's slabs counted one by one: sections and sheets of a volume that takes part as a whole.
fn count_sections(dims: [u32; 3], spacing: DVec3, w: DVec3, radius: f64, slab_width: f64) -> (u64, u64) {
    let unit = spacing.min_element();
    let warped = w.normalize() * unit / spacing;
    let (width, normal) = (slab_width * warped.length(), warped.normalize());
    let (mut sections, mut first, mut last) = (0, i64::MAX, i64::MIN);
    for z in 0..dims[2] {
        for y in 0..dims[1] {
            for x in 0..dims[0] {
                let voxel = DVec3::new(f64::from(x), f64::from(y), f64::from(z));
                let center = (DVec3::from(dims.map(f64::from)) - 1.0) / 2.0;
                let depth = (voxel - center).dot(normal);
                let around = (depth / width) as i64;
                let reach = (radius / width) as i64 + 3;
                for k in around - reach..around + reach {
                    let overlap = (depth + radius).min((k + 1) as f64 * width) - (depth - radius).max(k as f64 * width);
                    // More than rounding.
                    if overlap > 1e-9 {
                        sections += 1;
                        first = first.min(k);
                        last = last.max(k);
                    }
                }
            }
        }
    }
    (sections, (last - first + 1) as u64)
}

#[test]
fn stats_count_the_sections_of_the_specification() {
    let folder = Folder::new();
    let dims = [5, 4, 3];
    folder.write_nrrd("small.nrrd", dims.map(|side| side as usize), [1.0, 1.0, 1.0], &[1.0; 60]);
    let mut failures = Vec::new();
    for (direction, spacing, radius, slab_width) in [
        ([0.0, 1.0, 0.0], [1.0, 1.0, 1.0], 2.0, 1.0),
        ([0.0, 0.0, -1.0], [1.0, 1.0, 5.0], 2.0, 1.0),
        ([0.0, 0.0, 1.0], [1.0, 1.0, 3.0], 1.4, 0.5),
        ([1.0, 0.0, 0.0], [3.2, 3.2, 1.5], 2.0, 2.0),
        ([0.6, 0.8, 0.0], [1.0, 1.0, 1.0], 2.0, 1.0),
        ([0.0, 0.6, -0.8], [2.0, 2.0, 2.0], 1.4, 0.2),
        ([0.3, 0.9, -0.2], [1.0, 1.0, 5.0], 2.0, 3.0),
        ([0.5, 0.1, 0.7], [3.2, 3.2, 1.5], 2.0, 0.5),
        ([1.0, 1.0, 1.0], [1.0, 1.0, 2.0], 4.0, 8.0),
        ([1.0, 2.0, 2.0], [1.0, 1.0, 1.0], 1.0, 0.05),
    ] {
        let stats = folder.stats(&format!(
            "small.nrrd --set image.width=8 --set image.height=8 --set transfer.opacity=[[0,0.5]] \
             --set camera.direction={} --set volume.spacing={} --set splatting.radius={radius} \
             --set splatting.slab_width={slab_width} --set camera.up=[0.1,0.2,1] {UNCULLED}",
            format!("{direction:?}").replace(' ', ""),
            format!("{spacing:?}").replace(' ', ""),
        ));
        let counted =
            ["sections_total", "sections_rasterized", "sheets", "voxels_shaded"].map(|key| count(&stats, key));
        let (sections, sheets) = count_sections(dims, DVec3::from(spacing), DVec3::from(direction), radius, slab_width);
        let expected = [sections, sections, sheets, 60];
        if counted != expected {
            failures.push(format!("{direction:?} {spacing:?} {radius} {slab_width}: {counted:?}, not {expected:?}"));
        }
    }
    assert!(failures.is_empty(), "sections, on screen, sheets, shaded:\n{}", failures.join("\n"));
}

#[test]
fn the_reference_backend_agrees_with_the_gpu() {
    let folder = Folder::new();
    for sets in [
        "--set splatting.compositing=exponential --set volume.spacing=[1,1,3]",
        "--set splatting.compositing=linear --set splatting.order=back-to-front",
        "--set splatting.compositing=xray --set splatting.slab_width=0.5",
    ] {
        let (.., gpu) = folder.pixels(&format!("{SMALL} {sets} {UNCULLED}"));
        let (.., reference) = folder.pixels(&format!("{SMALL} {sets} --backend reference"));
        let decibels = psnr(&gpu, &reference, BLACK);
        assert!(decibels >= 60.0, "{sets}: {decibels:.1} dB");
    }
    folder.render(&format!("{SMALL} --backend reference -o out.png --stats stats.json"));
    let stats: Value = serde_json::from_slice(&folder.read("stats.json")).unwrap();
    assert_eq!(keys(&stats), STATS_KEYS);
    assert_eq!(stats["backend"], "reference");
}

/// Runs what must fail, in a folder with a volume and some scenes, with an output file that must not change.
fn assert_fails(code: i32, arguments: &str, words: &[&str]) {
    let folder = Folder::new();
    folder.write_nrrd("good.nrrd", [2, 2, 2], [1.0, 1.0, 1.0], &[1.0; 8]);
    folder.write("unknown.toml", "[volume]\npath = \"good.nrrd\"\n[camera]\nzoom = 3\n");
    folder.write("gone.toml", "[volume]\npath = \"gone.nrrd\"\n");
    folder.write("syntax.toml", "[volume\npath = 3\n");
    folder.write("latin.toml", b"[volume]\npath = \"caf\xe9.nrrd\"\n");
    folder.write("empty.toml", "");
    folder.write("empty.nrrd", "");
    folder.write("short.nrrd", &folder.read("good.nrrd")[..120]);
    folder.write("picture.jpg", "not a volume");
    fs::create_dir(folder.path("folder.toml")).unwrap();
    fs::create_dir(folder.path("folder.nrrd")).unwrap();
    fs::create_dir(folder.path("folder.png")).unwrap();
    folder.write("out.png", "precious");
    let before = folder.names();
    folder.run(arguments).assert_failure(code, words);
    assert_eq!(folder.names(), before, "{arguments}: files");
    assert_eq!(folder.read("out.png"), b"precious", "{arguments}");
}

#[test]
fn bad_usage_is_2() {
    assert_fails(2, "render", &["INPUT", "--output"]);
    assert_fails(2, "render good.nrrd", &["--output"]);
    assert_fails(2, "render -o out.png", &["required"]);
    assert_fails(2, "paint good.nrrd -o out.png", &["paint", "--help"]);
    assert_fails(2, "render good.nrrd -o out.png --depth 12", &["--depth", "12", "8", "16"]);
    assert_fails(2, "render good.nrrd -o out.png --backend cuda", &["--backend", "cuda", "gpu", "reference"]);
    assert_fails(2, "render good.nrrd -o out.png --frames 3", &["--frames"]);
    assert_fails(2, "render good.nrrd -o out.gif", &["out.gif", "\".gif\"", ".png", ".exr", ".npy"]);
    assert_fails(2, "render good.nrrd -o out", &["out: ", "none", ".png"]);
    assert_fails(2, "render good.nrrd -o .", &[".png"]);
    assert_fails(2, "render good.nrrd -o new.png --stats new.png", &["--stats", "new.png", "--output"]);
}

#[test]
fn bad_input_is_2() {
    assert_fails(2, "render gone.nrrd -o out.png", &["gone.nrrd", "No such file"]);
    assert_fails(2, "render missing.toml -o out.png", &["missing.toml", "No such file"]);
    assert_fails(2, "render gone.toml -o out.png", &["gone.nrrd", "No such file"]);
    assert_fails(2, "render unknown.toml -o out.png", &["unknown.toml", "camera.zoom", "unknown key", "direction"]);
    assert_fails(2, "render syntax.toml -o out.png", &["syntax.toml", "line 1"]);
    assert_fails(2, "render latin.toml -o out.png", &["latin.toml", "UTF-8"]);
    assert_fails(2, "render empty.toml -o out.png", &["empty.toml", "volume.path", "volume.builtin"]);
    assert_fails(2, "render folder.toml -o out.png", &["folder.toml", "directory"]);
    assert_fails(2, "render folder.nrrd -o out.png", &["folder.nrrd", "folder", "regular file"]);
    assert_fails(2, "render empty.nrrd -o out.png", &["empty.nrrd", "magic", "NRRD0001"]);
    assert_fails(2, "render short.nrrd -o out.png", &["short.nrrd", "data", "32 bytes"]);
    assert_fails(2, "render picture.jpg -o out.png", &["picture.jpg", "\".jpg\"", ".nrrd"]);
    assert_fails(2, "render builtin:brain -o out.png", &["builtin:brain", "brain", "marschner-lobb"]);
    assert_fails(2, "render builtin:head:1 -o out.png", &["builtin:head:1", "size", "1024"]);
    assert_fails(2, "render builtin: -o out.png", &["builtin:", "head"]);
}

#[test]
fn a_bad_set_is_2() {
    let render = |set: &str, words: &[&str]| {
        assert_fails(2, &format!("render good.nrrd -o out.png --set {set}"), &[&["--set"], words].concat());
    };
    render("splatting.slab_width=9", &["splatting.slab_width", "9", "[0.05, 8]"]);
    render("splatting.slab_width=wide", &["splatting.slab_width", "wide", "[0.05, 8]"]);
    render("splatting.slabwidth=1", &["splatting.slabwidth", "unknown key", "slab_width"]);
    render("image.width=0", &["image.width", "0", "texture limit"]);
    render("image.width=-3", &["image.width", "-3"]);
    render("image.width=64.5", &["image.width", "64.5"]);
    render("camera.up=[0,1,0]", &["camera.up", "parallel"]);
    render("camera.direction=[0,0,0]", &["camera.direction"]);
    render("camera.height=inf", &["camera.height", "inf"]);
    render("camera.height=nan", &["camera.height", "nan"]);
    render("transfer.opacity=[[1,0],[0,1]]", &["transfer.opacity[1]"]);
    render("transfer.opacity=[]", &["transfer.opacity"]);
    render("nothing", &["nothing", "table.key=value"]);
    render("=3", &["table.key=value"]);
}

#[test]
fn what_is_not_implemented_is_2() {
    for backend in ["gpu", "reference"] {
        let render = |set: &str, words: &[&str]| {
            assert_fails(2, &format!("render good.nrrd -o out.png --backend {backend} --set {set}"), words);
        };
        render("camera.projection=perspective", &["good.nrrd", "camera.projection", "perspective", "orthographic"]);
        render("splatting.method=axis-aligned", &["good.nrrd", "splatting.method", "axis-aligned", "image-aligned"]);
    }
}

#[test]
fn an_image_beyond_the_texture_limit_is_2() {
    let render = |set: &str, words: &[&str]| {
        assert_fails(2, &format!("render good.nrrd -o out.png {set}"), words);
    };
    render("--set image.width=100000", &["good.nrrd", "image.width", "100000", "max_texture_dimension_2d"]);
    render("--set image.height=4294967295", &["image.height", "4294967295", "max_texture_dimension_2d"]);
    render("--set image.height=4294967296", &["image.height", "4294967296"]);
    render("--set image.width=4294967295 --backend reference", &["good.nrrd", "image.width", "4294967295"]);
}

#[test]
fn what_is_nobodys_input_is_1() {
    assert_fails(1, "render good.nrrd -o out.png --adapter Voodoo", &["Voodoo", "required", "actual"]);
    let small = "render good.nrrd --set image={width=8,height=8}";
    assert_fails(1, &format!("{small} -o no/such/folder/out.png"), &["no/such/folder/out.png", "No such file"]);
    assert_fails(1, &format!("{small} -o folder.png"), &["folder.png", "directory"]);
    assert_fails(1, &format!("{small} -o good.nrrd/out.png"), &["good.nrrd/out.png"]);
    // Both files or neither.
    assert_fails(1, &format!("{small} -o new.png --stats no/stats.json"), &["no/stats.json", "No such file"]);
    assert_fails(1, &format!("{small} -o new.png --stats folder.png"), &["folder.png", "directory"]);
    assert_fails(1, &format!("{small} -o no/new.png --stats stats.json"), &["no/new.png", "No such file"]);
}

/// Each is allowed by itself, together they leave what floats and memory hold.
#[test]
fn what_no_renderer_can_do_is_2() {
    for backend in ["gpu", "reference"] {
        let render = |sets: &str, words: &[&str]| {
            let arguments = format!("render good.nrrd -o out.png --backend {backend} {sets}");
            assert_fails(2, &arguments, &[&["good.nrrd"], words].concat());
        };
        render("--set volume.spacing=[1e-300,1e-300,1e-300]", &["spacing", "1e-300", "1e-100"]);
        render("--set volume.spacing=[1e300,1e300,1e300]", &["spacing", "1e300", "1e100"]);
        render("--set volume.spacing=[1,1,1e6]", &["spacing", "1000000.0", "10000 times"]);
        render("--set camera.height=1e-300", &["camera.height", "1e-300", "5.1e-23"]);
        render("--set camera.height=1e300", &["camera.height", "1e300", "5.1e27"]);
        let deep = "--set volume.spacing=[1,1e4,1] --set splatting.slab_width=0.05";
        render(deep, &["splatting.slab_width", "0.05", "65536 slabs"]);
    }
}

/// A ball of radius 4, 200 in 10, in 12³ voxels.
fn ball() -> Vec<f32> {
    let voxel = |i: i32| DVec3::new(f64::from(i % 12), f64::from(i / 12 % 12), f64::from(i / 144)) - 5.5;
    (0..1728).map(|i| if voxel(i).length() < 4.0 { 200.0 } else { 10.0 }).collect()
}

#[test]
fn extremes_agree_with_the_reference() {
    let folder = Folder::new();
    folder.write_nrrd("ball.nrrd", [12; 3], [1.0; 3], &ball());
    let huge: Vec<f32> = ball().into_iter().map(|value| if value > 100.0 { 3e38 } else { -3e38 }).collect();
    folder.write_nrrd("huge.nrrd", [12; 3], [1.0; 3], &huge);
    let view = "--set image={width=48,height=40} --set camera.direction=[0.3,0.9,-0.2]";
    for case in [
        "ball.nrrd --set volume.spacing=[1e-30,1e-30,1e-30]",
        "ball.nrrd --set volume.spacing=[1e30,1e30,1e30]",
        "ball.nrrd --set volume.spacing=[1000,1,1000]",
        "ball.nrrd --set volume.spacing=[1,1,10000] --set camera.height=30",
        "ball.nrrd --set camera.direction=[1e-300,1e-300,1e-301]",
        "ball.nrrd --set camera.height=1e-6 --set camera.center=[0.3,0.2,0.1]",
        "ball.nrrd --set camera.height=1e-12 --set camera.center=[2.91,0.2,1.3]",
        "ball.nrrd --set transfer.opacity=[[-1e300,0],[1e300,1]]",
        "ball.nrrd --set transfer.opacity=[[-1e300,0.2],[100,0.5],[1e300,0.1]]",
        "ball.nrrd --set transfer.opacity=[[-3e38,0],[3e38,1]]",
        "ball.nrrd --set transfer.gradient_opacity=[[-1e300,0],[1e300,1]]",
        "ball.nrrd --set transfer.color=[[-1e300,[1,0,0]],[1e300,[0,1,1]]]",
        "ball.nrrd --set shading.ambient=1e300 --set transfer.color=[[0,[0,0.5,1]]]",
        "ball.nrrd --set shading.shininess=1e300",
        "ball.nrrd --set shading.shininess=1e-300 --set shading.light=[0.3,0.9,-0.2]",
        "huge.nrrd",
        "huge.nrrd --set transfer.opacity=[[-3e38,0],[3e38,0.9]]",
    ] {
        let (.., gpu) = folder.pixels(&format!("{case} {view} {UNCULLED}"));
        let (.., reference) = folder.pixels(&format!("{case} {view} --backend reference"));
        assert!(gpu.iter().flatten().all(|channel| channel.is_finite()), "{case}");
        let decibels = psnr(&gpu, &reference, BLACK);
        assert!(decibels >= 60.0, "{case}: {decibels:.1} dB");
    }
}

/// The low-pass rule makes amounts tiny, of which a pixel adds up very many.
#[test]
fn minified_volumes_keep_their_opacity() {
    let folder = Folder::new();
    folder.write_nrrd("haze.nrrd", [24; 3], [1.0; 3], &[1.0; 24 * 24 * 24]);
    for opacity in [0.01, 0.0001] {
        let render = format!("haze.nrrd --set image={{width=2,height=2}} --set transfer.opacity=[[0,{opacity}]]");
        let (.., gpu) = folder.pixels(&render);
        let (.., reference) = folder.pixels(&format!("{render} --backend reference"));
        for (gpu, reference) in gpu.iter().flatten().zip(reference.iter().flatten()) {
            assert!((gpu - reference).abs() <= 1e-3 * reference, "{opacity}: {gpu}, not {reference}");
        }
    }
}

#[test]
fn the_smallest_and_the_narrowest() {
    let folder = Folder::new();
    folder.write_nrrd("ball.nrrd", [12; 3], [1.0; 3], &ball());
    folder.write_nrrd("one.nrrd", [1; 3], [1.0; 3], &[5.0]);
    for (volume, width, height) in
        [("one", 1, 1), ("ball", 1, 1), ("ball", 1, 200), ("ball", 8192, 1), ("ball", 1, 8192), ("one", 3, 5)]
    {
        let render = format!("{volume}.nrrd --set image={{width={width},height={height}}}");
        let (found_width, found_height, gpu) = folder.pixels(&format!("{render} {UNCULLED}"));
        assert_eq!((found_width, found_height), (width, height));
        let (.., reference) = folder.pixels(&format!("{render} --backend reference"));
        assert!(reference.iter().any(|pixel| pixel[0] > 0.0), "{render} is black");
        for (gpu, reference) in gpu.iter().flatten().zip(reference.iter().flatten()) {
            assert!((gpu - reference).abs() <= 2e-3, "{render}: {gpu}, not {reference}");
        }
    }
    // Nothing but background.
    for sets in ["camera.center=[1e300,1e300,1e300]", "transfer.iso_ranges=[[1e30,2e30]]", "transfer.opacity=[[0,0]]"] {
        let (.., pixels) = folder.pixels(&format!("ball.nrrd --set image={{width=9,height=7}} --set {sets}"));
        assert_eq!(pixels, [BLACK; 63], "{sets}");
    }
}

/// What `bench` prints besides the last frame's stats.
const BENCH_KEYS: [&str; 5] = ["first_frame_ms", "max_frame_ms", "median_frame_ms", "min_frame_ms", "peak_rss_mib"];

impl Folder {
    /// Runs what must print exactly one line of JSON.
    fn bench(&self, arguments: &str) -> Value {
        let run = self.run(&format!("bench {arguments}"));
        assert_eq!(run.code, Some(0), "{arguments}\n{}", run.stderr);
        let line = run.stdout.strip_suffix('\n').unwrap();
        assert!(!line.contains('\n'), "one line: {}", run.stdout);
        serde_json::from_str(line).unwrap()
    }
}

#[test]
fn bench_prints_one_line_of_json() {
    let folder = Folder::new();
    let before = folder.names();
    for frames in ["--frames 1", "--frames 4 --rotate 30", "--frames 3 --rotate -7.5", "--rotate 0"] {
        let report = folder.bench(&format!("{SMALL} {frames}"));
        let mut expected: Vec<&str> = STATS_KEYS.into_iter().chain(BENCH_KEYS).collect();
        expected.sort_unstable();
        assert_eq!(keys(&report), expected);
        let ms = |key: &str| {
            let milliseconds = report[key].as_f64().unwrap();
            assert!((0.0..600_000.0).contains(&milliseconds), "{key}: {milliseconds}");
            milliseconds
        };
        let [min, median, max] = ["min_frame_ms", "median_frame_ms", "max_frame_ms"].map(ms);
        assert!(0.0 < min && min <= median && median <= max, "{report:#}");
        if frames == "--frames 1" {
            assert_eq!([min, max], [median; 2], "{report:#}");
        }
        // A device, the pipelines and a frame take their time; this program and a driver take their memory.
        assert!(ms("first_frame_ms") > 0.0 && ms("load_ms") >= 0.0, "{report:#}");
        #[cfg(target_os = "linux")]
        assert!(report["peak_rss_mib"].as_f64().unwrap() > 5.0, "{report:#}");
        assert_eq!((count(&report, "width"), count(&report, "height")), (27, 20));
        for key in ["adapter", "driver", "backend"] {
            assert!(!report[key].as_str().unwrap().is_empty(), "{key}");
        }
    }
    assert_eq!(folder.names(), before, "nothing is left");
}

/// Every frame is turned further, by the right hand about the camera's up, the first one not at all.
#[test]
fn bench_turns_the_camera() {
    let folder = Folder::new();
    folder.write_nrrd("box.nrrd", [7, 5, 3], [1.0, 1.0, 1.0], &[1.0; 105]);
    let sets = "--set image.width=33 --set image.height=40 --set transfer.opacity=[[0,0.4]]";
    let counts = |stats: &Value| {
        let keys = ["sections_total", "sections_rasterized", "sheets", "quads", "voxels_shaded", "bricks_visited"];
        keys.map(|key| count(stats, key))
    };
    // About (0, 0, 1) from (0, 1, 0), and about (0, 1, 0) from (1, 0, 0).
    for (arguments, direction, up) in [
        ("--frames 1 --rotate 90", "[-1,0,0]", "[0,0,1]"),
        ("--frames 3 --rotate 30", "[-1,0,0]", "[0,0,1]"),
        ("--frames 3 --rotate -30", "[1,0,0]", "[0,0,1]"),
        ("--frames 2 --rotate 0", "[0,1,0]", "[0,0,1]"),
        ("--frames 1 --rotate 26.56505117707799 --set camera.direction=[1,0,0]", "[2,0,-1]", "[0,1,0]"),
    ] {
        let report = folder.bench(&format!("box.nrrd {sets} --set camera.up={up} {arguments}"));
        let stats = folder.stats(&format!("box.nrrd {sets} --set camera.up={up} --set camera.direction={direction}"));
        assert_eq!(counts(&report), counts(&stats), "{arguments}: {report:#} {stats:#}");
    }
}

#[test]
fn bench_of_bad_input_is_2() {
    assert_fails(2, "bench", &["INPUT"]);
    assert_fails(2, "bench good.nrrd --frames 0", &["--frames", "0"]);
    assert_fails(2, "bench good.nrrd --frames -1", &["-1"]);
    assert_fails(2, "bench good.nrrd --frames many", &["--frames", "many"]);
    assert_fails(2, "bench good.nrrd --rotate round", &["--rotate", "round"]);
    assert_fails(2, "bench good.nrrd -o out.png", &["-o"]);
    assert_fails(2, "bench gone.nrrd", &["gone.nrrd", "No such file"]);
    assert_fails(2, "bench missing.toml", &["missing.toml", "No such file"]);
    assert_fails(2, "bench short.nrrd", &["short.nrrd", "data", "32 bytes"]);
    assert_fails(2, "bench unknown.toml", &["unknown.toml", "camera.zoom", "unknown key"]);
    assert_fails(2, "bench builtin:brain", &["builtin:brain", "brain"]);
    assert_fails(2, "bench good.nrrd --set splatting.slab_width=9", &["--set", "splatting.slab_width", "9"]);
    assert_fails(2, "bench good.nrrd --set camera.projection=perspective", &["good.nrrd", "camera.projection"]);
    assert_fails(1, "bench good.nrrd --adapter Voodoo", &["Voodoo"]);
}

#[test]
fn help_and_version_are_results() {
    let folder = Folder::new();
    for (arguments, words) in [
        ("--help", "render"),
        ("--help", "bench"),
        ("render --help", "--set"),
        ("bench --help", "--frames"),
        ("--version", env!("CARGO_PKG_VERSION")),
    ] {
        let run = folder.run(arguments);
        assert_eq!(run.code, Some(0), "{arguments}: {}", run.stderr);
        assert!(run.stdout.contains(words), "{arguments}: {}", run.stdout);
    }
}

/// A real, strongly anisotropic volume, where the data lie beside the checkout.
#[test]
fn the_quarter_head_agrees_with_the_reference() {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/scenes/quarter-head-perspective.toml");
    if !scene.exists() {
        println!("skipped: there is no {}", scene.display());
        return;
    }
    let folder = Folder::new();
    let render =
        format!("{} --set camera.projection=orthographic --set image.width=96 --set image.height=96", scene.display());
    let (.., gpu) = folder.pixels(&format!("{render} {UNCULLED}"));
    let (.., reference) = folder.pixels(&format!("{render} --backend reference"));
    let decibels = psnr(&gpu, &reference, BLACK);
    println!("{decibels:.1} dB");
    assert!(decibels >= 60.0, "{decibels:.1} dB");
}
