//! `sheetsplat compare`.

use std::path::{Path, PathBuf};

use sheetsplat::golden::{Comparison, ComparisonError, Picture, Tolerance};
use sheetsplat::image::{Image, PngDepth};

use crate::failure::Failure;
use crate::outputs::{self, Outputs};
use crate::reading::Reading;

#[derive(clap::Args)]
#[command(after_help = "Example:\n  sheetsplat compare actual.png golden.png --difference difference.png")]
pub(crate) struct Arguments {
    /// An image: .png, .exr or .npy.
    actual: PathBuf,
    /// The image that it should match, in any of these formats and of the same size.
    golden: PathBuf,
    /// Steps of 255 that a channel may differ by: 0 to 16.
    #[arg(long, value_name = "STEPS", default_value_t = Tolerance::default().per_channel())]
    tolerance: u8,
    /// Fraction of the pixels that may differ by more: 0 to 0.01.
    #[arg(long, value_name = "SHARE", default_value_t = Tolerance::default().outliers())]
    outliers: f64,
    /// Save an image of the differences: black to grey within the tolerance, red to yellow beyond it.
    #[arg(long, value_name = "FILE")]
    difference: Option<PathBuf>,
    #[command(flatten)]
    reading: Reading,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let Arguments { actual, golden, tolerance, outliers, difference, reading } = arguments;
    let tolerance = Tolerance::new(*tolerance, *outliers).map_err(|error| Failure::Input(error.to_string()))?;
    if let Some(path) = difference {
        Image::check_format(path)?;
    }
    let named: Vec<_> = difference.iter().map(|path| ("--difference", path.as_path())).collect();
    Outputs::check(&named, true, &[actual.clone(), golden.clone()])?;
    let options = reading.options();
    let open = |path: &Path| Picture::open_with(path, &options).map_err(|error| Failure::Input(error.to_string()));
    let pictures = [open(actual)?, open(golden)?];
    let files = format!("{} and {}", actual.display(), golden.display());
    let comparison = Comparison::new(&pictures[0].image, &pictures[1].image, tolerance).map_err(|error| {
        let message = format!("{files}: {error}");
        // Images of different sizes are valid input: the result is that they differ.
        if matches!(error, ComparisonError::Size { .. }) { Failure::Other(message) } else { Failure::Input(message) }
    })?;
    let mut saved = Vec::new();
    if let Some(path) = difference {
        saved.push((path.as_path(), comparison.difference_image().encode(path, PngDepth::Eight)?));
    }
    let mut report = format!("{comparison}\n");
    for (path, picture) in [actual, golden].into_iter().zip(&pictures) {
        if let Some(made_on) = &picture.made_on {
            report += &format!("{} made on: {made_on}\n", path.display());
        }
    }
    outputs::write(&saved, report.as_bytes())?;
    if comparison.passes() { Ok(()) } else { Err(Failure::Other(format!("{files} differ"))) }
}
