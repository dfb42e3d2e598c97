//! `sheetsplat sweep`: contact sheets.

mod axis;
mod sheet;

use std::path::PathBuf;

use sheetsplat::image::Image;
use sheetsplat::scene::{Channel, OpenVolume, Scene, TransferSettings};

use crate::annotate::Annotate;
use crate::arguments::{Depth, Input, log_frame};
use crate::failure::Failure;
use crate::outputs::{self, Outputs};
use crate::progress::Progress;
use axis::{Axis, swept};
use sheet::{Layout, Tile};

/// The maximum length of a sheet's longer side in pixels; a square sheet of this size needs 4 GiB as floats.
const LARGEST: u32 = 16_384;

#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  sheetsplat sweep builtin:head -o sheet.png --set splatting.slab_width=0.5,1,2
  sheetsplat sweep scene.toml -o grid.png --set splatting.radius=1.4,2 --set splatting.compositing=linear,exponential")]
pub(crate) struct Arguments {
    #[command(flatten)]
    input: Input,
    #[command(flatten)]
    annotate: Annotate,
    /// The sheet: .png, .exr or .npy.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Tiles per row; by default all values of the setting, or of the first one of two.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    columns: Option<u32>,
    /// Bits per channel of a PNG.
    #[arg(long, value_enum, default_value = "8")]
    depth: Depth,
}

pub(crate) fn run(arguments: &Arguments, progress: bool) -> Result<(), Failure> {
    let Arguments { input, output, .. } = arguments;
    Image::check_format(output)?;
    arguments.annotate.check_format(output)?;
    let axes = swept(&input.sets);
    check(&axes, arguments)?;
    let columns = arguments.columns.unwrap_or(axes[0].values.len() as u32);

    // All scenes are read before the first is drawn, so that bad values are found at once.
    let mut scenes = Vec::new();
    for values in combinations(&axes) {
        let mut sets = input.sets.clone();
        let assign = |(axis, value): (&Axis, &String)| (axis.at, format!("{}={value}", axis.key));
        for (at, set) in axes.iter().zip(&values).map(assign) {
            sets[at] = set;
        }
        let label = axes.iter().zip(&values).map(|(axis, value)| format!("{} = {value}", axis.key));
        scenes.push((input.scene_with(&sets)?, label.collect::<Vec<_>>()));
    }
    let sizes: Vec<_> =
        scenes.iter().map(|(scene, label)| ([scene.image.width, scene.image.height], label.as_slice())).collect();
    let layout = Layout::new(columns, &sizes).filter(|layout| layout.size.iter().all(|&side| side <= LARGEST));
    let layout = layout.ok_or_else(|| {
        let count = scenes.len();
        let allowed = format!("sheets of at most {LARGEST} pixels a side");
        Failure::Input(format!("{}: found {count} tiles in rows of {columns}, allowed: {allowed}", output.display()))
    })?;
    let inputs: Vec<_> = scenes.iter().flat_map(|(scene, _)| input.files(scene)).collect();
    let outputs = Outputs::check(&[("--output", output)], false, &inputs)?;
    for (scene, _) in &mut scenes {
        *scene = input.choose_levels(scene, Scene::explicit)?;
    }
    check_volumes(input, &scenes, &outputs)?;
    let tiles = draw(arguments, scenes, &outputs, progress)?;
    outputs::write(&[(output, layout.draw(&tiles).encode(output, arguments.depth.into())?)], &[])
}

fn check(axes: &[Axis], arguments: &Arguments) -> Result<(), Failure> {
    let keys: Vec<&str> = axes.iter().map(|axis| axis.key.as_str()).collect();
    let found = if keys.is_empty() { "none".to_owned() } else { keys.join(", ") };
    if !(1..=2).contains(&axes.len()) {
        let allowed = "one or two, as in --set splatting.slab_width=0.5,1,2";
        return Err(Failure::Input(format!("--set: settings with several values: found {found}, allowed: {allowed}")));
    }
    for Axis { at, key, .. } in axes {
        // A later override would make the label wrong.
        let mut later = arguments.input.sets[at + 1..].iter().filter_map(|set| set.split_once('='));
        if later.any(|(later, _)| later.trim() == key) {
            let allowed = "only before them";
            return Err(Failure::Input(format!(
                "--set: {key}: found again after its several values, allowed: {allowed}"
            )));
        }
        if arguments.input.view.is_some() && ["camera", "camera.direction", "camera.up"].contains(&key.as_str()) {
            return Err(Failure::Input(format!("--view: found with several values of {key}, allowed: a single value")));
        }
    }
    if let (Some(columns), 2) = (arguments.columns, axes.len()) {
        return Err(Failure::Input(format!(
            "--columns: found {columns} with {found}, allowed: with one swept setting"
        )));
    }
    Ok(())
}

/// All combinations of the axes' values; those of the first axis change fastest.
fn combinations(axes: &[Axis]) -> Vec<Vec<String>> {
    let mut all: Vec<Vec<String>> = vec![Vec::new()];
    for axis in axes {
        let with = |value: &String| {
            all.iter().map(|values| [values.as_slice(), std::slice::from_ref(value)].concat()).collect()
        };
        all = axis.values.iter().flat_map(|value| -> Vec<_> { with(value) }).collect();
    }
    all
}

/// Reads every volume once if there are several, before anything is drawn: this finds bad volumes, and the data files that headers
/// name.
fn check_volumes(input: &Input, scenes: &[(Scene, Vec<String>)], outputs: &Outputs) -> Result<(), Failure> {
    for (at, (scene, _)) in scenes.iter().enumerate().skip(1) {
        if !scenes[..at].iter().any(|(earlier, _)| has_same_volume(earlier, scene)) {
            input.read_volume(scene, outputs)?;
        }
    }
    Ok(())
}

fn has_same_volume(a: &Scene, b: &Scene) -> bool {
    // Appearance aside, every key of a channel is one of its volume.
    let volumes = |scene: &Scene| {
        scene.channels.clone().map(|mut channel: Channel| {
            (channel.name, channel.visible, channel.transfer) = (None, true, TransferSettings::default());
            channel
        })
    };
    volumes(a) == volumes(b)
}

/// Draws every scene. A volume is loaded again only if it differs from the previous one.
fn draw(
    arguments: &Arguments,
    scenes: Vec<(Scene, Vec<String>)>,
    outputs: &Outputs,
    progress: bool,
) -> Result<Vec<Tile>, Failure> {
    let Arguments { input, annotate, .. } = arguments;
    let headless = input.headless(false, scenes.iter().map(|(scene, _)| scene))?;
    let progress = Progress::new(scenes.len(), progress);
    let mut last: Option<(Scene, OpenVolume)> = None;
    let mut tiles = Vec::new();
    for (scene, label) in scenes {
        // Any other volume is dropped before the next one is read.
        let volume = match last.take().filter(|(last, _)| has_same_volume(last, &scene)) {
            Some((_, volume)) => volume,
            None => input.open_volume(&scene, outputs)?,
        };
        let (words, scene) = annotate.settled((input, &arguments.output), volume.sample(), &scene, Scene::explicit)?;
        let rendering =
            headless.render_volume(progress.watch(volume.clone()), &scene).map_err(|error| input.failure(error))?;
        log_frame(&label.join(", "), &rendering.stats);
        tiles.push(Tile { image: words.draw(rendering.image, &scene, volume.sample()), label });
        progress.step();
        last = Some((scene, volume));
    }
    Ok(tiles)
}
