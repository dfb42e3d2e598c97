//! The command line program.

mod arguments;
mod bench;
mod compare;
mod failure;
mod orbit;
mod progress;
mod render;
mod sweep;
#[cfg(feature = "viewer")]
mod view;

use std::io::Write;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

use failure::Failure;

/// Volume rendering by image-aligned sheet-buffer splatting.
#[derive(Parser)]
#[command(version, about)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    /// Show no progress.
    #[arg(short, long, global = true)]
    quiet: bool,
}

#[derive(Subcommand)]
enum Command {
    /// Render a scene file, a volume file, or a builtin volume to an image.
    Render(render::Arguments),
    /// Draw a turntable: numbered images or a movie of the camera turning about its up.
    Orbit(orbit::Arguments),
    /// Draw a contact sheet: --set KEY=A,B,C gives a tile for each value, two of them a grid.
    Sweep(sweep::Arguments),
    /// Time a first frame and turning frames; prints one line of JSON.
    Bench(bench::Arguments),
    /// Compare two images: prints what they differ in, exit code 1 if by more than is allowed.
    Compare(compare::Arguments),
    /// Show a scene in a window, to be turned and changed; its image size is not looked at.
    #[cfg(feature = "viewer")]
    View(view::Arguments),
}

fn main() -> ExitCode {
    env_logger::Builder::from_env(env_logger::Env::default().default_filter_or("error")).init();
    // Clap itself exits with 2 on bad usage, with 0 on --help.
    let Arguments { command, quiet } = Arguments::parse();
    let result = match command {
        Command::Render(arguments) => render::run(&arguments),
        Command::Orbit(arguments) => orbit::run(&arguments, quiet),
        Command::Sweep(arguments) => sweep::run(&arguments, quiet),
        Command::Bench(arguments) => bench::run(&arguments),
        Command::Compare(arguments) => compare::run(&arguments),
        #[cfg(feature = "viewer")]
        Command::View(arguments) => view::run(&arguments),
    };
    let Err(failure) = result else { return ExitCode::SUCCESS };
    // `eprintln` would panic where nobody can be told.
    let _ = writeln!(std::io::stderr(), "sheetsplat: {}", failure.message());
    match failure {
        Failure::Input(_) => ExitCode::from(2),
        Failure::Other(_) => ExitCode::FAILURE,
    }
}
