//! `sheetsplat merge`.

use std::path::PathBuf;

use sheetsplat::{Image, Part};

use crate::arguments::Depth;
use crate::failure::Failure;
use crate::outputs::{self, Outputs};
use crate::reading::Reading;

#[derive(clap::Args)]
#[command(after_help = "\
Example:
  sheetsplat render scene.toml -o front.exr --slabs -200..0
  sheetsplat render scene.toml -o back.exr --slabs 0..200
  sheetsplat merge front.exr back.exr -o image.png")]
pub(crate) struct Arguments {
    /// All parts of one image, in any order.
    #[arg(required = true, value_name = "PART")]
    parts: Vec<PathBuf>,
    /// The image: .png, .exr or .npy.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Bits per channel of a PNG.
    #[arg(long, value_enum, default_value = "8")]
    depth: Depth,
    #[command(flatten)]
    reading: Reading,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let Arguments { parts, output, depth, reading } = arguments;
    Image::check_format(output)?;
    Outputs::check(&[("--output", output)], false, parts)?;
    let options = reading.options();
    let input = |error: &dyn std::fmt::Display| Failure::Input(error.to_string());
    let parts = parts.iter().map(|path| Part::open_with(path, &options).map_err(|error| input(&error)));
    let image = Image::merge(parts.collect::<Result<Vec<_>, _>>()?).map_err(|error| input(&error))?;
    outputs::write(&[(output, image.encode(output, (*depth).into())?)], &[])
}
