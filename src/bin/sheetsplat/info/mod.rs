//! `sheetsplat info`: the contents of a volume file and the distribution of its values.

mod statistics;

use std::fmt::Write;

use glam::DVec3;
use serde::{Serialize, Serializer};
use sheetsplat::appearance::{Preset, categories, quantiles};
use sheetsplat::internals::plain_whole;
use sheetsplat::scene::{OpenVolume, Scene, VolumeSource};
use sheetsplat::settings::{Camera, Projection};
use sheetsplat::volume::{Orientation, SampleType, StreamedVolume, Volume};

use crate::arguments::Input;
use crate::failure::Failure;
use crate::outputs::Outputs;
use crate::picture;
use crate::stdout::stdout;
use statistics::{Histogram, extent_and_mean};

#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  sheetsplat info head.nii.gz
  sheetsplat info series/ --json
  sheetsplat info head.png")]
pub(crate) struct Arguments {
    #[command(flatten)]
    input: Input,
    /// One line of JSON instead of text.
    #[arg(long)]
    json: bool,
}

/// Percentiles, and their names in JSON.
const PERCENTILES: [(f64, &str); 9] = [
    (0.1, "0.1"),
    (1.0, "1"),
    (5.0, "5"),
    (25.0, "25"),
    (50.0, "50"),
    (75.0, "75"),
    (95.0, "95"),
    (99.0, "99"),
    (99.9, "99.9"),
];

/// Columns and rows of the histogram.
const COLUMNS: usize = 64;
const ROWS: usize = 8;

#[derive(Serialize)]
struct Info {
    format: &'static str,
    dims: [u32; 3],
    /// The size of the sample that values below are from, where the volume does not fit into memory; `None` if they are from all of it.
    sample: Option<[u32; 3]>,
    r#type: String,
    spacing: [f64; 3],
    unit: Option<String>,
    /// Of the file.
    channels: u32,
    /// The names of the channels that are read, where known.
    channel_names: Vec<Option<String>>,
    /// Whether voxels have colours of their own, whose luminances the values are.
    colors: bool,
    /// Of the file.
    times: u32,
    /// The marks that tell the times apart, where they are more than their numbers.
    time_names: Vec<String>,
    /// The series of the folder; empty if there is only one.
    series: Vec<String>,
    /// The sizes of the file's levels; `None` if it is no store of levels.
    levels: Option<Vec<[u32; 3]>>,
    /// The level that the fields below, and sizes and spacing, are about.
    level: u32,
    /// The file's numbers of labels, by labels from 0 on, where these stand for others.
    ids: Option<Vec<u64>>,
    /// Voxels whose samples are NaN or infinite; the fields below are about the others.
    holes: u64,
    min: f64,
    max: f64,
    mean: f64,
    #[serde(serialize_with = "as_map")]
    percentiles: [f64; PERCENTILES.len()],
    frame: Frame,
    /// Why the camera looks in its direction: the rule by which the volume chose it, or that it is stated.
    eye: String,
    /// The preset that fits, if any.
    preset: Option<&'static str>,
    /// The facts that were assumed, as nothing states them.
    assumed: Vec<String>,
}

/// What the camera shows, in world units from the volume's centre.
#[derive(Serialize)]
struct Frame {
    center: [f64; 3],
    direction: [f64; 3],
    up: [f64; 3],
    /// The image's height; `None` in perspective.
    height: Option<f64>,
    /// The distance from the eye to the centre; `None` if orthographic.
    distance: Option<f64>,
}

impl Frame {
    fn of(camera: &Camera) -> Self {
        let (height, distance) = match camera.projection {
            Projection::Orthographic { height } => (height, None),
            Projection::Perspective { distance, .. } => (None, distance),
        };
        let [center, direction, up] = [camera.middle(), camera.direction, camera.up].map(|vector| vector.to_array());
        Self { center, direction, up, height, distance }
    }
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let input = &arguments.input;
    if picture::is_picture(&input.name) {
        return stdout(of_picture(input, arguments.json)?.as_bytes());
    }
    let scene = input.scene()?;
    let outputs = Outputs::check(&[], true, &input.files(&scene))?;
    // What is told is about the volume itself, whatever a picture would show of it.
    let opened = input.open_volume(&at_finest_level(&scene), &outputs)?;
    let volume = opened.sample();
    let eye = if input.view.is_some() { None } else { scene.eye(volume) };
    let scene = input.settled(volume, &scene, Scene::explicit)?;
    let suggested = Preset::suggested(volume);
    let [min, max, mean] = extent_and_mean(volume.values());
    let percentiles = quantiles(volume.values(), |_| true, PERCENTILES.map(|(percent, _)| percent / 100.0));
    let encoding = volume.encoding();
    let info = Info {
        format: encoding.map_or("builtin", |encoding| encoding.format),
        dims: opened.grid().dims.to_array(),
        sample: matches!(opened, OpenVolume::Streamed(_)).then(|| volume.dims().to_array()),
        r#type: encoding.map_or(SampleType::F32, |encoding| encoding.sample_type).to_string(),
        spacing: opened.grid().spacing.to_array(),
        unit: volume.unit().map(str::to_owned),
        channels: encoding.map_or(1, |encoding| encoding.channels).max(volume.channels().count() as u32),
        channel_names: volume.channels().map(|channel| channel.channel_name().map(str::to_owned)).collect(),
        colors: volume.colors().is_some(),
        times: encoding.map_or(1, |encoding| encoding.times),
        time_names: volume.time_names().to_vec(),
        series: volume.series_names().to_vec(),
        levels: Some(levels(&opened)).filter(|levels| !levels.is_empty()),
        level: opened.level(),
        ids: volume.label_ids().map(<[_]>::to_vec),
        holes: volume.holes(),
        min,
        max,
        mean,
        percentiles: percentiles.unwrap_or_default().map(f64::from),
        frame: Frame::of(&scene.camera),
        eye: eye.map_or_else(|| "where it is stated".to_owned(), |eye| eye.to_string()),
        preset: Preset::ALL.iter().find(|(_, preset)| suggested == Some(*preset)).map(|(name, _)| *name),
        assumed: assumed(volume, &scene),
    };
    let text = if arguments.json {
        serde_json::to_string(&info).map_err(|error| Failure::Other(error.to_string()))? + "\n"
    } else {
        plain_whole(&described(&info, volume, scene.channels.first().index.unwrap_or(0))).to_string()
    };
    stdout(text.as_bytes())
}

/// How a picture was made, without a look at the files that its scene names.
fn of_picture(input: &Input, is_json: bool) -> Result<String, Failure> {
    let made = picture::open(input.name.as_ref(), &input.options())?;
    if !is_json {
        return Ok(plain_whole(&made.to_string()).to_string());
    }
    Ok(made.to_json().map_err(|error| Failure::Other(error.to_string()))? + "\n")
}

/// The sizes of the levels of a store with levels.
fn levels(volume: &OpenVolume) -> Vec<[u32; 3]> {
    match volume {
        OpenVolume::Whole(volume) => volume.levels().iter().map(|dims| dims.to_array()).collect(),
        OpenVolume::Streamed(StreamedVolume { channels, .. }) => {
            channels.first().values.store.levels().iter().map(|level| level.grid.dims.to_array()).collect()
        }
    }
}

/// The scene with the finest level stated of every file whose level is open.
fn at_finest_level(scene: &Scene) -> Scene {
    let finest =
        |volume: &VolumeSource, level: Option<u32>| level.or(matches!(volume, VolumeSource::File(_)).then_some(0));
    let mut scene = scene.clone();
    for channel in scene.channels.iter_mut() {
        channel.level = finest(&channel.volume, channel.level);
    }
    scene
}

/// Serializes percentiles by name, ascending.
fn as_map<S: Serializer>(percentiles: &[f64], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(PERCENTILES.iter().map(|&(_, name)| name).zip(percentiles))
}

fn described(info: &Info, volume: &Volume, first_channel: u32) -> String {
    let mut text = String::new();
    let mut line = |name: &str, value: String| _ = writeln!(text, "{name:<12} {value}");
    let [x, y, z] = info.dims;
    line("format", info.format.to_owned());
    line("type", info.r#type.clone());
    line("dims", format!("{x} × {y} × {z}"));
    let [x, y, z] = info.spacing.map(short);
    line("spacing", format!("{x} × {y} × {z} {}", info.unit.as_deref().unwrap_or("(no unit)")));
    if info.channels > 1 {
        let names =
            (0..).zip(volume.channels()).filter_map(|(at, channel)| Some(format!("{at} {}", channel.channel_name()?)));
        let names = names.collect::<Vec<_>>().join(", ");
        let names = if names.is_empty() { names } else { format!(": {names}") };
        line("channels", format!("{}{names}; what follows is about channel {}", info.channels, first_channel));
    }
    if info.colors {
        line("colors", "every voxel has its own; what follows is about their luminance".to_owned());
    }
    if info.times > 1 {
        let names = (0..).zip(&info.time_names).map(|(at, name)| format!("{at} {name}")).collect::<Vec<_>>().join(", ");
        let names = if names.is_empty() { names } else { format!(": {names}") };
        line("times", format!("{}{names}; what follows is about one, by --time", info.times));
    }
    if !info.series.is_empty() {
        line("series", format!("{}; what follows is about one, by --series", info.series.join(", ")));
    }
    if let Some(levels) = &info.levels {
        let sizes = levels.iter().zip(0..).map(|([x, y, z], level)| format!("{level}: {x} × {y} × {z}"));
        let sizes = sizes.collect::<Vec<_>>().join(", ");
        line("levels", format!("{sizes}; what is told is about {}, by --level", info.level));
    }
    if let Some(found) = labels(volume) {
        line("labels", found.to_owned());
    }
    if let Some(ids @ [first, .., last]) = volume.label_ids() {
        line("ids", format!("{first} to {last}; values and labels below are their places, 0 to {}", ids.len() - 1));
    }
    if let Some([x, y, z]) = info.sample {
        line(
            "sample",
            format!("{x} × {y} × {z}, as the volume does not fit into memory; values below are the sample's"),
        );
    }
    let turned = if volume.grid().is_turned() { "; left-handed, so that pictures have x turned" } else { "" };
    let stated = volume.file_orientation().map_or("not given".to_owned(), |stated| orientation(&stated));
    line("orientation", stated + turned);
    if volume.encoding().is_some() {
        let assumed = info.assumed.iter().find_map(|fact| fact.strip_prefix("axes: "));
        line("axes", assumed.unwrap_or("x, y and z as the file states them").to_owned());
    }
    line("assumed", if info.assumed.is_empty() { "nothing".to_owned() } else { info.assumed.join("; ") });
    if info.holes > 0 {
        line("holes", format!("{} samples are NaN or infinite", info.holes));
    }
    line("range", format!("{} to {}, mean {}", short(info.min), short(info.max), short(info.mean)));
    let [x, y, z] = info.frame.center.map(short);
    let (name, length) = match info.frame.distance {
        Some(distance) => ("distance", Some(distance)),
        None => ("height", info.frame.height),
    };
    let length = length.map_or(String::new(), |length| format!(", {name} {}", short(length)));
    line("frame", format!("center {x}, {y}, {z}{length} {}", info.unit.as_deref().unwrap_or("(no unit)")));
    let [direction, up] = [info.frame.direction, info.frame.up].map(|vector| vector.map(short).join(", "));
    line("eye", format!("{}: direction {direction}, up {up}", info.eye));
    line("preset", info.preset.unwrap_or("none fits; the transfer function follows the values").to_owned());
    for (&(_, name), &value) in PERCENTILES.iter().zip(&info.percentiles) {
        line(&format!("{name:>9} %"), short(value));
    }
    if info.min == info.max {
        return text;
    }
    // Outliers would take up most of the width.
    let tails = [info.percentiles[0], info.percentiles[PERCENTILES.len() - 1]];
    let histogram = Histogram::new(volume.values(), if tails[0] < tails[1] { tails } else { [info.min, info.max] });
    let isos: Vec<String> = histogram.iso_values().into_iter().map(short).collect();
    line("iso-values", format!("{} (suggested)", isos.join(", ")));
    text + &chart(&histogram)
}

/// Why the values count as labels, or why not though the file says that they are; `None` if nothing says so.
fn labels(volume: &Volume) -> Option<&'static str> {
    if volume.colors().is_some() {
        return None;
    }
    Some(match (volume.is_known_label_map(), categories::is_label_map(volume)) {
        (true, true) => "the file says that the values are labels",
        (true, false) => "the file says that the values are labels, but some are no whole numbers from 0 to 65535",
        (false, true) => "the values look like labels: whole numbers, at least three, in regions with sharp borders",
        (false, false) => return None,
    })
}

/// The facts that neither the volume's file nor the scene states.
fn assumed(volume: &Volume, scene: &Scene) -> Vec<String> {
    let mut assumed = volume.assumptions();
    // The spacing of streamed volumes lies in their grids.
    assumed.retain(|fact| scene.channels.first().spacing.is_none() || !fact.starts_with("spacing"));
    if categories::is_label_map(volume) && !volume.is_known_label_map() {
        assumed.push("labels: the values look like labels".to_owned());
    }
    assumed
}

/// The anatomical directions of the file's own axes.
fn orientation(orientation: &Orientation) -> String {
    let sides = [["right", "left"], ["front", "back"], ["head", "feet"]];
    let axis = |axis: DVec3| {
        let along = (0..3).fold(0, |best, i| if axis[i].abs() > axis[best].abs() { i } else { best });
        let degrees = axis[along].abs().min(1.0).acos().to_degrees();
        let side = sides[along][usize::from(axis[along] < 0.0)];
        if degrees < 0.5 { side.to_owned() } else { format!("{side} (within {degrees:.0}°)") }
    };
    let [x, y, z] = [0, 1, 2].map(|i| axis(orientation.axes.col(i)));
    format!("x to the {x}, y to the {y}, z to the {z}")
}

/// A bar chart over values, with logarithmic counts.
fn chart(histogram: &Histogram) -> String {
    const EIGHTHS: [char; 9] = [' ', '▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
    let bars = histogram.counts.chunks(histogram.counts.len() / COLUMNS);
    let heights: Vec<f64> = bars.map(|counts| (counts.iter().sum::<u64>() as f64).ln_1p()).collect();
    let highest = heights.iter().copied().fold(1.0, f64::max);
    let mut text = String::new();
    for row in (0..ROWS).rev() {
        let cell = |height: &f64| {
            let eighths = height / highest * (8 * ROWS) as f64 - (8 * row) as f64;
            // Any count above 0 is visible.
            let least = if row == 0 && *height > 0.0 { 1 } else { 0 };
            EIGHTHS[(eighths.round().clamp(0.0, 8.0) as usize).max(least)]
        };
        let line: String = heights.iter().map(cell).collect();
        text += line.trim_end();
        text.push('\n');
    }
    let [low, high] = histogram.range.map(short);
    let width = COLUMNS.saturating_sub(low.chars().count());
    text + &format!("{low}{high:>width$}\n")
}

/// A number with a useful number of digits.
fn short(number: f64) -> String {
    let exponent = if number == 0.0 { 0 } else { number.abs().log10().floor() as i32 };
    if !(-5..=9).contains(&exponent) {
        return format!("{number:.4e}");
    }
    let decimals = (5 - exponent).clamp(0, 9) as usize;
    let text = format!("{number:.decimals$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}
