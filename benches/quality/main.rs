//! How near pictures of the Marschner–Lobb signal (41³ samples of 8 bits, diffuse light) come to its exact surface, in dB, from three directions.
//!
//! `cargo bench --bench quality -- [BACKEND] [PYTHON]` draws with a backend, `cpu` by default, and with VTK's ray casters if a Python with VTK is given
//! (`benches/peers/vtk_bench.py` says how it is installed). Slab widths and VTK's sample distances are 1, 0.5 and 0.25 voxels. It also times the
//! coefficients of `interpolation = "exact"`.

#![expect(clippy::unwrap_used, reason = "a bench")]

mod marschner_lobb;

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;

use glam::DVec3;
use sheetsplat::headless::{Backend, Headless, HeadlessOptions};
use sheetsplat::internals::after::coefficients;
use sheetsplat::scene::Scene;
use sheetsplat::volume::builtin;

use marschner_lobb::Truth;

const DIRECTIONS: [DVec3; 3] = [DVec3::new(0.4, 0.6, -0.7), DVec3::new(-0.8, 0.5, -0.3), DVec3::new(0.3, -0.9, -0.5)];
const WIDTHS: [f64; 3] = [1.0, 0.5, 0.25];

/// A row of the table, and the settings beside the scene's own.
const KINDS: [(&str, &[&str]); 7] = [
    ("before", &["splatting.classification=before"]),
    ("smooth, differences", &["splatting.classification=after"]),
    ("smooth, kernel", &["splatting.classification=after", "shading.gradient=kernel"]),
    ("exact, differences", &["splatting.classification=after", "splatting.interpolation=exact"]),
    ("exact, kernel", &["splatting.classification=after", "splatting.interpolation=exact", "shading.gradient=kernel"]),
    (
        "exact, kernel, falloff 1",
        &[
            "splatting.classification=after",
            "splatting.interpolation=exact",
            "shading.gradient=kernel",
            "splatting.falloff=1",
        ],
    ),
    (
        "the same, un-culled",
        &[
            "splatting.classification=after",
            "splatting.interpolation=exact",
            "shading.gradient=kernel",
            "splatting.falloff=1",
            "splatting.culling=false",
        ],
    ),
];

/// Volumes for whose values the coefficients of `exact` are timed, and the kernels: those with a falloff of 1 and the defaults separate.
const SOLVED: [&str; 2] = ["head:128", "head"];
const KERNELS: [(&str, (f64, f64)); 3] =
    [("radius 2, falloff 1", (2.0, 1.0)), ("radius 2, falloff 2", (2.0, 2.0)), ("radius 2.7, falloff 1", (2.7, 1.0))];

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| !argument.starts_with("--")).collect();
    let backend: Backend = arguments.first().map_or(Ok(Backend::Cpu), |name| name.parse()).unwrap();
    let headless = Headless::new(&HeadlessOptions::default().with_backend(backend)).unwrap();
    time_coefficients();
    let folder = tempfile::tempdir().unwrap();
    for direction in DIRECTIONS {
        let truth = Truth::new(direction);
        marschner_lobb::write(folder.path(), direction).unwrap();
        println!("\nAlong {:?}:\n", direction.to_array());
        println!("| | {} |", WIDTHS.map(|width| width.to_string()).join(" | "));
        println!("|---|---|---|---|");
        for (kind, settings) in KINDS {
            let row = WIDTHS.map(|width| truth.psnr(ours(&headless, folder.path(), settings, width).into_iter()));
            print_row(&format!("{kind} ({backend})"), row);
        }
        let Some(python) = arguments.get(1) else { continue };
        for mapper in ["gpu", "cpu"] {
            let row = WIDTHS.map(|step| truth.psnr(vtk(python, folder.path(), mapper, step).into_iter()));
            print_row(&format!("VTK {mapper}"), row);
        }
    }
}

/// Prints how long the coefficients take: the shortest of up to three runs, as many as begin within a second.
fn time_coefficients() {
    for (name, (kernel_name, kernel)) in SOLVED.into_iter().flat_map(|name| KERNELS.map(|kernel| (name, kernel))) {
        let volume = builtin::volume(name).unwrap();
        let (begin, mut least) = (Instant::now(), f64::INFINITY);
        for run in 0..3 {
            if run > 0 && begin.elapsed().as_secs_f64() > 1.0 {
                break;
            }
            let start = Instant::now();
            coefficients::exact(volume.grid(), volume.values(), kernel, &|_| {}).unwrap();
            least = least.min(start.elapsed().as_secs_f64() * 1000.0);
        }
        println!("coefficients of {name}, {}, {kernel_name}: {least:.0} ms", volume.dims());
    }
}

fn print_row(name: &str, row: [f64; 3]) {
    println!("| {name} | {} |", row.map(|psnr| format!("{psnr:.2}")).join(" | "));
}

fn ours(headless: &Headless, folder: &Path, settings: &[&str], width: f64) -> Vec<[f32; 3]> {
    let mut sets: Vec<String> = settings.iter().map(|&setting| setting.to_owned()).collect();
    sets.push(format!("splatting.slab_width={width}"));
    let scene = Scene::open(&folder.join("scene.toml"), &sets).unwrap();
    let image = headless.render(&scene).unwrap().image;
    image.pixels.iter().map(|&[r, g, b, _]| [r, g, b]).collect()
}

fn vtk(python: &str, folder: &Path, mapper: &str, step: f64) -> Vec<[f32; 3]> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/peers/vtk_bench.py");
    let png = folder.join("vtk.png");
    let status = Command::new(python)
        .arg(script)
        .arg(folder.join("scene.toml"))
        .args(["--mapper", mapper, "--frames", "1", "--step", &step.to_string(), "--png"])
        .arg(&png)
        .stdout(Stdio::null())
        .status();
    assert!(status.unwrap().success(), "{python} fails");
    let picture = image::open(png).unwrap().to_rgb8();
    picture.pixels().map(|pixel| pixel.0.map(|channel| f32::from(channel) / 255.0)).collect()
}
