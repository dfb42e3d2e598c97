//! `sheetsplat render`.

use std::path::PathBuf;
use std::time::Instant;

use sheetsplat::headless::Rendering;
use sheetsplat::image::Image;
use sheetsplat::scene::{OpenVolume, Scene};

use crate::annotate::Annotate;
use crate::arguments::{Depth, Input, check_scene_file, log_frame, scene_file};
use crate::failure::Failure;
use crate::light::{self, Stored};
use crate::look;
use crate::memory::peak_rss_mib;
use crate::outputs::{self, Outputs};
use crate::parts::Part;
use crate::picture::{Metadata, Told};
use crate::progress::{Progress, tell};

#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  sheetsplat render builtin:head -o head.png
  sheetsplat render head.nrrd -o image.exr --set splatting.slab_width=0.5 --stats stats.json
  sheetsplat render ct.nii.gz -o face.png --view front
  sheetsplat render ct.raw -o ct.png --dims 256,256,113 --type uint16 --endian big
  sheetsplat render ct.nrrd -o skull.png --preset ct-bone --annotate scale --save-scene skull.toml
  sheetsplat render skull.png -o closer.png --set camera.height=120
  sheetsplat render cells.nrrd -o cells.png --preset confocal --colormap magma --annotate scale,colors
  sheetsplat render scene.toml -o part.exr --slabs 0..64 --region 0,0,512,256 --light light.npz")]
pub(crate) struct Arguments {
    #[command(flatten)]
    input: Input,
    /// The image: .png, .exr or .npy; a part of it: .exr or .npz.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Bits per channel of a PNG.
    #[arg(long, value_enum, default_value = "8")]
    depth: Depth,
    /// Write counts and times as JSON.
    #[arg(long, value_name = "FILE")]
    stats: Option<PathBuf>,
    /// Write the complete scene that was rendered as a scene file, with everything that presets, colour maps and the volume determined.
    #[arg(long, value_name = "FILE")]
    save_scene: Option<PathBuf>,
    #[command(flatten)]
    metadata: Metadata,
    #[command(flatten)]
    annotate: Annotate,
    #[command(flatten)]
    part: Part,
    #[command(flatten)]
    light: Stored,
    /// Time every stage on the GPU, where the adapter has timestamp queries: stages_ms in the statistics, and printed.
    #[arg(long)]
    profile: bool,
}

pub(crate) fn run(arguments: &Arguments, progress: bool) -> Result<(), Failure> {
    let Arguments { input, output, stats: stats_file, save_scene, .. } = arguments;
    check_files(arguments)?;
    let scene = input.scene()?;
    let mut named = vec![("--output", output.as_path())];
    named.extend(stats_file.as_deref().map(|path| ("--stats", path)));
    named.extend(save_scene.as_deref().map(|path| ("--save-scene", path)));
    let inputs = [input.files(&scene), Vec::from_iter(arguments.light.file())].concat();
    let outputs = Outputs::check(&named, arguments.profile, &inputs)?;
    let light = arguments.light.open(input)?;
    let start = Instant::now();
    let scene = input.choose_levels(&scene, Scene::explicit)?;
    let volume = input.open_volume(&scene, &outputs)?;
    let load_ms = start.elapsed().as_secs_f64() * 1e3;
    look::tell_choices(progress, &input.name, &scene, volume.sample());
    let start = Instant::now();
    let (words, scene) = arguments.annotate.settled((input, output), volume.sample(), &scene, Scene::explicit)?;
    let explicit_ms = start.elapsed().as_secs_f64() * 1e3;
    let window = arguments.part.window(&scene);
    // Like a frame of `orbit`, a part is drawn once.
    if let Some(window) = &window
        && arguments.part.is_done(output, input, (&volume, &scene), window)?
    {
        tell(progress, &format!("{}: kept, drawn before", output.display()));
        return Ok(());
    }
    let is_streamed = matches!(volume, OpenVolume::Streamed(_));
    let bar = Progress::of_chunks(progress);
    let volume = bar.watch(volume);
    let (bytes, mut stats) = match window {
        Some(window) => {
            let (part, stats) = arguments.part.draw(input, (volume, &scene), &window, light.as_ref())?;
            (part.encode(output)?, stats)
        }
        None => {
            let headless = input.headless(arguments.profile, [&scene])?;
            let start = Instant::now();
            let view = light::view(&headless, volume.clone(), &scene, light.as_ref());
            let mut view = view.map_err(|error| input.failure(error))?;
            let view_ms = start.elapsed().as_secs_f64() * 1e3;
            let Rendering { image, mut stats } = headless.draw(&mut view).map_err(|error| input.failure(error))?;
            stats.prepare_ms += view_ms;
            let image = words.draw(image, &scene, volume.sample());
            let whole = words.whole(&scene);
            let sources = arguments.metadata.sources(&input.picture, (&volume, &whole));
            let told =
                sources.as_ref().map(|sources| Told { scene: &whole, sources, stats: &stats, annotate: words.names() });
            (arguments.metadata.encode(&image, (output, arguments.depth.into()), told)?, stats)
        }
    };
    drop(bar);
    stats.peak_rss_mib = peak_rss_mib().filter(|_| is_streamed);
    stats.load_ms = load_ms;
    stats.prepare_ms += explicit_ms;
    log_frame(&output.display().to_string(), &stats);
    let mut files = vec![(output.as_path(), bytes)];
    if let Some(path) = stats_file {
        let json = serde_json::to_string_pretty(&stats).map_err(|error| Failure::Other(error.to_string()))?;
        files.push((path, (json + "\n").into_bytes()));
    }
    if let Some(path) = save_scene {
        files.push((path, scene_file(&words.whole(&scene), path)?));
    }
    if arguments.profile && stats.stages_ms.is_empty() {
        log::warn!("--profile: found no timestamp queries on {}", stats.adapter);
    }
    // The map is empty without --profile.
    let profile: String = stats.stages_ms.iter().map(|(stage, ms)| format!("{stage:10} {ms:10.3} ms\n")).collect();
    outputs::write(&files, profile.as_bytes())
}

/// Checks the extensions of the files to be written.
fn check_files(arguments: &Arguments) -> Result<(), Failure> {
    let Arguments { output, save_scene, .. } = arguments;
    if arguments.part.is_empty() {
        Image::check_format(output)?;
        arguments.annotate.check_format(output)?;
    } else {
        arguments.part.check(output, !arguments.annotate.is_empty())?;
    }
    save_scene.as_deref().map_or(Ok(()), check_scene_file)
}
