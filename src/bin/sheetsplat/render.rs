//! `sheetsplat render`.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::ValueEnum;
use sheetsplat::error::{Error, RenderError};
use sheetsplat::headless::{Headless, HeadlessOptions, Rendering};
use sheetsplat::image::{Image, ImageError, PngDepth, aside};
use sheetsplat::reference;
use sheetsplat::scene::{Scene, SceneError, VolumeSource};
use sheetsplat::stats::Stats;
use sheetsplat::volume::{self, Volume};

use crate::Failure;

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// A scene file (.toml), a volume file, or builtin:NAME[:N].
    input: String,
    /// The image: .png, .exr or .npy.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Set a scene value, as in --set splatting.slab_width=2.0. Can be repeated.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// The side of the patient to look at, where the volume's file says how the patient lies; in place of the scene's
    /// camera.direction and camera.up.
    #[arg(long, value_enum, value_name = "SIDE")]
    view: Option<View>,
    #[command(flatten)]
    raw: Raw,
    /// Bits per channel of a PNG.
    #[arg(long, value_enum, default_value = "8")]
    depth: Depth,
    /// Write counts and times as JSON.
    #[arg(long, value_name = "FILE")]
    stats: Option<PathBuf>,
    /// The GPU, or the slow f64 evaluation on the CPU that it is tested against.
    #[arg(long, value_enum, default_value = "gpu")]
    backend: Backend,
    /// Time every stage on the GPU, where the adapter has timestamp queries: stages_ms in the statistics, and printed.
    #[arg(long)]
    profile: bool,
    /// Part of the name of the adapter to use.
    #[arg(long, value_name = "NAME", env = "WGPU_ADAPTER_NAME")]
    adapter: Option<String>,
}

/// What a raw file has no header to say; short for --set of the scene's keys, and before them.
#[derive(clap::Args)]
struct Raw {
    /// Voxels of a file without a header: short for --set volume.dims=[X,Y,Z].
    #[arg(long, value_name = "X,Y,Z")]
    dims: Option<String>,
    /// Its samples' type, uint8, int16, float32, …: short for --set volume.type=TYPE.
    #[arg(long, value_name = "TYPE")]
    r#type: Option<String>,
    /// Its byte order, little or big: short for --set volume.endian=ORDER.
    #[arg(long, value_name = "ORDER")]
    endian: Option<String>,
    /// Bytes before its first sample: short for --set volume.offset=N.
    #[arg(long, value_name = "N")]
    offset: Option<String>,
    /// World units from voxel to voxel, of any volume: short for --set volume.spacing=[X,Y,Z].
    #[arg(long, value_name = "X,Y,Z")]
    spacing: Option<String>,
}

impl Raw {
    fn sets(&self) -> Vec<String> {
        let array = |key: &str, value: &Option<String>| value.as_ref().map(|value| format!("volume.{key}=[{value}]"));
        let plain = |key: &str, value: &Option<String>| value.as_ref().map(|value| format!("volume.{key}={value}"));
        let sets = [
            array("dims", &self.dims),
            plain("type", &self.r#type),
            plain("endian", &self.endian),
            plain("offset", &self.offset),
            array("spacing", &self.spacing),
        ];
        sets.into_iter().flatten().collect()
    }
}

#[derive(Clone, Copy, ValueEnum)]
enum Depth {
    #[value(name = "8")]
    Eight,
    #[value(name = "16")]
    Sixteen,
}

#[derive(Clone, Copy, ValueEnum)]
enum View {
    Front,
    Back,
    Left,
    Right,
    Top,
    Bottom,
}

#[derive(Clone, Copy, ValueEnum)]
enum Backend {
    Gpu,
    Reference,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    Image::check_format(&arguments.output)?;
    if arguments.stats.as_ref() == Some(&arguments.output) {
        let path = arguments.output.display();
        return Err(Failure::Input(format!("--stats: found {path}, allowed: another file than --output")));
    }
    let sets = [arguments.raw.sets(), arguments.set.clone()].concat();
    let mut scene = open_scene(&arguments.input, &sets)?;
    let failed = |error| Failure::of(error, &arguments.input);
    let start = Instant::now();
    let volume = scene.load_volume().map_err(|error| failed(error.into()))?;
    let load_ms = start.elapsed().as_secs_f64() * 1e3;
    if let Some(view) = arguments.view {
        look_at(view, &volume, &arguments.input, &mut scene)?;
    }
    let Rendering { image, mut stats } = match arguments.backend {
        Backend::Gpu => {
            let (adapter, profile) = (arguments.adapter.clone(), arguments.profile);
            let options = HeadlessOptions { adapter, profile, ..HeadlessOptions::default() };
            let headless = Headless::new(&options).map_err(|error| Failure::Other(error.to_string()))?;
            headless.render_volume(volume, &scene)
        }
        Backend::Reference => render_reference(&volume, &scene),
    }
    .map_err(|error| failed(error.into()))?;
    stats.load_ms = load_ms;
    let depth = match arguments.depth {
        Depth::Eight => PngDepth::Eight,
        Depth::Sixteen => PngDepth::Sixteen,
    };
    // Aside before the image is saved: either both files are there in the end or neither.
    let failed = |path: &Path, error: std::io::Error| Failure::Other(format!("{}: {error}", path.display()));
    let stats_file = match &arguments.stats {
        Some(path) => {
            let json = serde_json::to_string_pretty(&stats).map_err(|error| Failure::Other(error.to_string()))?;
            Some((path, aside(path, (json + "\n").as_bytes()).map_err(|error| failed(path, error))?))
        }
        None => None,
    };
    image.save(&arguments.output, depth)?;
    if arguments.profile && stats.stages_ms.is_empty() {
        eprintln!("sheetsplat: --profile: found no timestamp queries on {}", stats.adapter);
    }
    for (stage, ms) in &stats.stages_ms {
        println!("{stage:10} {ms:10.3} ms");
    }
    if let Some((path, file)) = stats_file {
        file.persist(path).map_err(|error| failed(path, error.error))?;
    }
    Ok(())
}

/// A scene file by its extension; anything else is a volume.
pub(crate) fn open_scene(input: &str, sets: &[String]) -> Result<Scene, SceneError> {
    match input.strip_prefix("builtin:") {
        Some(name) => Scene::from_volume(VolumeSource::Builtin(name.to_owned()), sets),
        None if input.ends_with(".toml") => Scene::open(input.as_ref(), sets),
        None => Scene::from_volume(VolumeSource::File(input.into()), sets),
    }
}

/// Turns the camera to a side of the patient.
fn look_at(view: View, volume: &Volume, input: &str, scene: &mut Scene) -> Result<(), Failure> {
    let Some(orientation) = volume.orientation() else {
        let allowed = "a volume whose file says how the patient lies, or --set camera.direction and camera.up";
        return Err(Failure::Input(format!("{input}: --view: found no orientation in the file, allowed: {allowed}")));
    };
    let side = match view {
        View::Front => volume::View::Front,
        View::Back => volume::View::Back,
        View::Left => volume::View::Left,
        View::Right => volume::View::Right,
        View::Top => volume::View::Top,
        View::Bottom => volume::View::Bottom,
    };
    [scene.camera.direction, scene.camera.up] = orientation.direction_and_up(side);
    if orientation.is_mirrored() {
        eprintln!(
            "sheetsplat: {input}: --view: the axes are left-handed, so the image is a mirror image of the patient"
        );
    }
    Ok(())
}

fn render_reference(volume: &Volume, scene: &Scene) -> Result<Rendering, RenderError> {
    let start = Instant::now();
    let transfer = scene.transfer.resolve(volume);
    let image = reference::render(volume, &transfer, scene)?;
    let stats = Stats {
        adapter: "CPU".to_owned(),
        driver: "f64".to_owned(),
        backend: "reference".to_owned(),
        rasterizer: "reference".to_owned(),
        width: image.width,
        height: image.height,
        frame_ms: start.elapsed().as_secs_f64() * 1e3,
        counts: reference::count(volume, &transfer, scene)?,
        ..Stats::default()
    };
    Ok(Rendering { image, stats })
}

impl Failure {
    /// What is wrong with rendering `input`; scene and volume errors name their file themselves.
    pub(crate) fn of(error: Error, input: &str) -> Self {
        match error {
            Error::Scene(_) | Error::Volume(_) => Self::Input(error.to_string()),
            Error::Render(RenderError::OutOfRange { .. } | RenderError::Limit { .. }) => {
                Self::Input(format!("{input}: {error}"))
            }
            _ => Self::Other(error.to_string()),
        }
    }
}

impl From<SceneError> for Failure {
    fn from(error: SceneError) -> Self {
        Self::Input(error.to_string())
    }
}

impl From<ImageError> for Failure {
    fn from(error: ImageError) -> Self {
        match error {
            ImageError::Format { .. } => Self::Input(error.to_string()),
            _ => Self::Other(error.to_string()),
        }
    }
}
