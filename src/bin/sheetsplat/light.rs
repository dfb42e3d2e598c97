//! `sheetsplat light`, and `--light` of the commands that draw in what it has made.

use std::path::PathBuf;
use std::sync::Arc;

use sheetsplat::headless::{Headless, HeadlessView};
use sheetsplat::image::ImageError;
use sheetsplat::scene::{OpenVolume, Scene};
use sheetsplat::volume::ReadOptions;
use sheetsplat::{RenderError, StoredLight};

use crate::arguments::Input;
use crate::failure::Failure;
use crate::look;
use crate::outputs::{self, Outputs};
use crate::progress::Progress;

#[derive(clap::Args)]
#[command(after_help = "\
Example:
  sheetsplat light scene.toml -o light.npz
  sheetsplat render scene.toml -o part.exr --slabs 0..64 --light light.npz")]
pub(crate) struct Arguments {
    #[command(flatten)]
    input: Input,
    /// The light: .npz.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
}

/// Makes a scene's light sheets.
pub(crate) fn run(arguments: &Arguments, progress: bool) -> Result<(), Failure> {
    let Arguments { input, output } = arguments;
    let refused = |error: ImageError| Failure::Input(error.to_string());
    StoredLight::check_format(output).map_err(refused)?;
    let scene = input.scene()?;
    let outputs = Outputs::check(&[("--output", output)], false, &input.files(&scene))?;
    let scene = input.choose_levels(&scene, Scene::explicit)?;
    let volume = input.open_volume(&scene, &outputs)?;
    look::tell_choices(progress, &input.name, &scene, volume.sample());
    let scene = input.settled(volume.sample(), &scene, Scene::explicit)?;
    let bar = Progress::of_chunks(progress);
    let light = StoredLight::of(&bar.watch(volume), &scene).map_err(|error| input.failure(error))?;
    drop(bar);
    outputs::write(&[(output, light.encode(output).map_err(refused)?)], &[])
}

/// Light that was made before.
#[derive(clap::Args)]
pub(crate) struct Stored {
    /// Draw in the light that `sheetsplat light` has made of the same scene, which gives the same picture sooner.
    #[arg(long, value_name = "FILE")]
    light: Option<PathBuf>,
}

impl Stored {
    /// The file.
    pub(crate) fn file(&self) -> Option<PathBuf> {
        self.light.clone()
    }

    /// Reads the file, if there is one.
    pub(crate) fn open(&self, input: &Input) -> Result<Option<Arc<StoredLight>>, Failure> {
        let mut options = ReadOptions::default();
        options.memory = input.options().memory;
        let open = |path: &PathBuf| {
            let light = StoredLight::open_with(path, &options);
            light.map(Arc::new).map_err(|error| Failure::Input(error.to_string()))
        };
        self.light.as_ref().map(open).transpose()
    }
}

/// A view of a volume, in the light of a file if there is one.
pub(crate) fn view(
    headless: &Headless,
    volume: OpenVolume,
    scene: &Scene,
    light: Option<&Arc<StoredLight>>,
) -> Result<HeadlessView, RenderError> {
    let view = headless.view(volume, scene)?;
    match light {
        Some(light) => view.with_light(Arc::clone(light)),
        None => Ok(view),
    }
}
