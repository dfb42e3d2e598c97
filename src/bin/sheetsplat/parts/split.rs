//! `sheetsplat split`.

use sheetsplat::part;
use sheetsplat::scene::Scene;
use sheetsplat::settings::Window;

use crate::arguments::Input;
use crate::failure::Failure;
use crate::outputs::Outputs;
use crate::stdout::stdout;

#[derive(clap::Args)]
#[command(after_help = "\
Example:
  sheetsplat split scene.toml -n 64 | parallel --colsep ' ' sheetsplat render scene.toml -o part-{#}.exr {1} {2} {3} {4}")]
pub(crate) struct Arguments {
    #[command(flatten)]
    input: Input,
    /// Number of parts.
    #[arg(short = 'n', long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=65_536))]
    parts: u32,
}

/// Prints the options of every part, a line each.
pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let Arguments { input, parts } = arguments;
    let scene = input.scene()?;
    let outputs = Outputs::check(&[], true, &input.files(&scene))?;
    let scene = input.choose_levels(&scene, Scene::explicit)?;
    let volume = input.open_volume(&scene, &outputs)?;
    let scene = input.settled(volume.sample(), &scene, Scene::explicit)?;
    let windows = part::split(&volume, &scene, *parts as usize);
    let line = |Window { slabs, region }: Window| format!("--slabs {}..{} --region {region}\n", slabs.start, slabs.end);
    let lines: String = windows.map_err(|error| input.failure(error))?.into_iter().map(line).collect();
    stdout(lines.as_bytes())
}
