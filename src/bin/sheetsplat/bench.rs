//! `sheetsplat bench`.

use std::time::Instant;

use serde::Serialize;
use sheetsplat::RenderError;
use sheetsplat::scene::Scene;
use sheetsplat::stats::Stats;

use crate::arguments::{Input, parse_degrees};
use crate::failure::Failure;
use crate::memory::peak_rss_mib;
use crate::outputs::Outputs;
use crate::stdout::stdout;

#[derive(clap::Args)]
#[command(after_help = "Example:\n  sheetsplat bench builtin:head --frames 20 --rotate 3")]
pub(crate) struct Arguments {
    #[command(flatten)]
    input: Input,
    /// Frames to time after the first one.
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..))]
    frames: u32,
    /// Degrees to turn about the camera's up vector before each of them.
    #[arg(long, value_name = "DEGREES", default_value_t = 0.0, allow_negative_numbers = true, value_parser = parse_degrees)]
    rotate: f64,
    /// Time every stage on the GPU, where the adapter has timestamp queries: stages_ms in the statistics.
    #[arg(long)]
    profile: bool,
}

/// The printed report: times in milliseconds, and the last frame's statistics.
#[derive(Serialize)]
struct Report {
    first_frame_ms: f64,
    median_frame_ms: f64,
    min_frame_ms: f64,
    max_frame_ms: f64,
    peak_rss_mib: Option<f64>,
    #[serde(flatten)]
    last: Stats,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let input = &arguments.input;
    let scene = input.scene()?;
    let outputs = Outputs::check(&[], true, &input.files(&scene))?;
    let start = Instant::now();
    let scene = input.choose_levels(&scene, Scene::explicit_all_around)?;
    let volume = input.open_volume(&scene, &outputs)?;
    let load_ms = milliseconds_since(start);
    let scene = input.settled(volume.sample(), &scene, Scene::explicit_all_around)?;

    let start = Instant::now();
    let headless = input.headless(arguments.profile, [&scene])?;
    let mut view = headless.view(volume, &scene).map_err(|error| input.failure(error))?;
    let mut last = headless.draw(&mut view).map_err(|error| input.failure(error))?.stats;
    let first_frame_ms = milliseconds_since(start);

    let mut times = Vec::new();
    for _ in 0..arguments.frames {
        view.turn(arguments.rotate).map_err(|error| input.failure(RenderError::from(error)))?;
        let start = Instant::now();
        last = headless.draw(&mut view).map_err(|error| input.failure(error))?.stats;
        times.push(milliseconds_since(start));
    }
    times.sort_by(f64::total_cmp);
    last.load_ms = load_ms;
    let report = Report {
        first_frame_ms,
        median_frame_ms: (times[(times.len() - 1) / 2] + times[times.len() / 2]) / 2.0,
        min_frame_ms: times[0],
        max_frame_ms: times[times.len() - 1],
        peak_rss_mib: peak_rss_mib(),
        last,
    };
    let json = serde_json::to_string(&report).map_err(|error| Failure::Other(error.to_string()))?;
    stdout((json + "\n").as_bytes())
}

fn milliseconds_since(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}
