//! The command line program.
#![deny(clippy::print_stdout, clippy::print_stderr, reason = "they panic where a pipe is closed or a disk is full")]

mod adapters;
mod annotate;
mod arguments;
mod bench;
mod compare;
#[cfg(target_os = "linux")]
mod desktop;
mod documents;
mod failure;
mod index;
mod info;
mod interrupt;
mod light;
mod logging;
mod look;
mod memory;
mod orbit;
mod outputs;
mod parts;
mod picture;
mod progress;
mod reading;
mod render;
mod stdin;
mod stdout;
mod sweep;
mod verify;
#[cfg(feature = "viewer")]
mod view;

use std::io::Write;
use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand};

use failure::Failure;
use sheetsplat::internals::plain_lines;

const EXAMPLES: &str = "\
Examples:
  sheetsplat render builtin:head -o head.png
  sheetsplat render scene.toml -o image.exr --set camera.direction=[1,0,0]
  sheetsplat orbit head.nrrd -o turn.gif
  sheetsplat info head.nrrd
  sheetsplat verify head.png
  sheetsplat adapters

Exit codes: 0 success, 2 bad usage or input, 1 anything else. Logs: -v, or the environment variable RUST_LOG.";

/// Volume rendering by image-aligned sheet-buffer splatting.
#[derive(Parser)]
#[command(version, about, after_help = EXAMPLES)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    /// Print only errors: no progress, no warnings.
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    quiet: bool,
    /// Log volumes and frames instead of showing progress. RUST_LOG takes precedence.
    #[arg(short, long, global = true)]
    verbose: bool,
}

#[derive(Subcommand)]
enum Command {
    /// Render a scene file, a volume file, or a builtin volume to an image.
    Render(render::Arguments),
    /// Draw a turntable: numbered images or a movie of the camera turning about its up vector.
    Orbit(orbit::Arguments),
    /// Draw a contact sheet: --set KEY=A,B,C gives one tile per value; two of them give a grid.
    Sweep(sweep::Arguments),
    /// Time a first frame and turning frames, and print one line of JSON.
    Bench(bench::Arguments),
    /// Merge parts, drawn by render --slabs and --region, into the image.
    Merge(parts::merge::Arguments),
    /// Make a scene's light sheets, for --light.
    Light(light::Arguments),
    /// Write the ranges of the values in a volume's chunks, for --index.
    Index(index::Arguments),
    /// Print --slabs and --region of parts that take about equal time, a line for each.
    Split(parts::split::Arguments),
    /// Compare two images and print the differences; exit code 1 if they exceed the tolerance.
    Compare(compare::Arguments),
    /// Draw pictures again from the scenes in their files; exit code 1 if a pixel differs, and why.
    Verify(verify::Arguments),
    /// Describe a volume: format, size, unit, orientation, and the distribution of its values; or how a picture was made.
    Info(info::Arguments),
    /// List the adapters, whether each is usable, and if not, which limits it lacks.
    Adapters(adapters::Arguments),
    /// Print the JSON Schema of scene files, by which editors complete them.
    #[command(after_help = "Example:\n  sheetsplat schema > scene.schema.json")]
    Schema,
    /// Print completions for a shell.
    Completions(documents::Completions),
    /// Print a man page.
    Man(documents::Man),
    /// Show a scene in a window, to turn and change it; its image size is ignored.
    #[cfg(feature = "viewer")]
    View(view::Arguments),
    /// Show a scene in a window: this program was built without it.
    #[cfg(not(feature = "viewer"))]
    #[command(hide = true)]
    View {
        #[arg(trailing_var_arg = true, allow_hyphen_values = true, hide = true)]
        _arguments: Vec<std::ffi::OsString>,
    },
}

fn main() -> ExitCode {
    #[cfg(target_os = "linux")]
    desktop::leave_out_if_missing();
    // Clap itself exits with 2 on bad usage, and with 0 on --help.
    let Arguments { command, quiet, verbose } = Arguments::parse();
    let filter = match (quiet, verbose) {
        (true, _) => "error",
        (false, false) => "error,sheetsplat=warn",
        (false, true) => "error,sheetsplat=info",
    };
    let progress = !quiet && !verbose;
    logging::start(filter, verbose, progress);
    interrupt::listen();
    let result = match command {
        Command::Render(arguments) => render::run(&arguments, progress),
        Command::Orbit(arguments) => orbit::run(&arguments, progress),
        Command::Sweep(arguments) => sweep::run(&arguments, progress),
        Command::Bench(arguments) => bench::run(&arguments),
        Command::Merge(arguments) => parts::merge::run(&arguments),
        Command::Light(arguments) => light::run(&arguments, progress),
        Command::Index(arguments) => index::run(&arguments, progress),
        Command::Split(arguments) => parts::split::run(&arguments),
        Command::Compare(arguments) => compare::run(&arguments),
        Command::Verify(arguments) => verify::run(&arguments),
        Command::Info(arguments) => info::run(&arguments),
        Command::Adapters(arguments) => adapters::run(&arguments),
        Command::Schema => stdout::stdout(sheetsplat::scene::schema().as_bytes()),
        Command::Completions(arguments) => documents::completions(&arguments, Arguments::command()),
        Command::Man(arguments) => documents::man(&arguments, Arguments::command()),
        #[cfg(feature = "viewer")]
        Command::View(arguments) => view::run(&arguments),
        #[cfg(not(feature = "viewer"))]
        Command::View { .. } => Err(Failure::Input(
            "view: found a program without a window, allowed: one built by `cargo build --release --features viewer`"
                .to_owned(),
        )),
    };
    let Err(failure) = result else { return ExitCode::SUCCESS };
    // Standard error may be closed.
    let _ = writeln!(std::io::stderr(), "sheetsplat: {}", plain_lines(failure.message()));
    match failure {
        Failure::Input(_) => ExitCode::from(2),
        Failure::Other(_) => ExitCode::FAILURE,
    }
}
