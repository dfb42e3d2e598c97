//! `sheetsplat render`.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::ValueEnum;
use sheetsplat::error::RenderError;
use sheetsplat::headless::Rendering;
use sheetsplat::image::{Image, aside};
use sheetsplat::reference;
use sheetsplat::scene::Scene;
use sheetsplat::stats::Stats;
use sheetsplat::volume::Volume;

use crate::arguments::{Depth, Input, log_frame};
use crate::failure::Failure;

#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  sheetsplat render builtin:head -o head.png
  sheetsplat render head.nrrd -o image.exr --set splatting.slab_width=0.5 --stats stats.json
  sheetsplat render ct.nii.gz -o face.png --view front
  sheetsplat render ct.raw -o ct.png --dims 256,256,113 --type uint16 --endian big")]
pub(crate) struct Arguments {
    #[command(flatten)]
    input: Input,
    /// The image: .png, .exr or .npy.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
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
    let input = &arguments.input;
    let mut scene = input.scene()?;
    let start = Instant::now();
    let volume = input.load_volume(&scene)?;
    let load_ms = start.elapsed().as_secs_f64() * 1e3;
    input.look_at(&volume, &mut scene)?;
    let Rendering { image, mut stats } = match arguments.backend {
        Backend::Gpu => input.headless(arguments.profile)?.render_volume(volume, &scene),
        Backend::Reference => render_reference(&volume, &scene),
    }
    .map_err(|error| input.failure(error))?;
    stats.load_ms = load_ms;
    log_frame(&arguments.output.display().to_string(), &stats);
    // Aside before the image is saved: either both files are there in the end or neither.
    let failed = |path: &Path, error: std::io::Error| Failure::Other(format!("{}: {error}", path.display()));
    let stats_file = match &arguments.stats {
        Some(path) => {
            let json = serde_json::to_string_pretty(&stats).map_err(|error| Failure::Other(error.to_string()))?;
            Some((path, aside(path, (json + "\n").as_bytes()).map_err(|error| failed(path, error))?))
        }
        None => None,
    };
    image.save(&arguments.output, arguments.depth.into())?;
    if arguments.profile && stats.stages_ms.is_empty() {
        log::warn!("--profile: found no timestamp queries on {}", stats.adapter);
    }
    for (stage, ms) in &stats.stages_ms {
        println!("{stage:10} {ms:10.3} ms");
    }
    if let Some((path, file)) = stats_file {
        file.persist(path).map_err(|error| failed(path, error.error))?;
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
