//! `sheetsplat compare`.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

use sheetsplat::golden::{Comparison, ComparisonError, Picture, Tolerance};
use sheetsplat::image::{Image, PngDepth};
use sheetsplat::volume::ReadOptions;

use crate::failure::Failure;
use crate::outputs::{self, Outputs};
use crate::reading::Reading;

#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  sheetsplat compare actual.png golden.png --difference difference.png
  sheetsplat compare drawn/ goldens/ --tolerance 3")]
pub(crate) struct Arguments {
    /// An image: .png, .exr or .npy. Or a folder with such images.
    actual: PathBuf,
    /// The image that it should match, in any of these formats and of the same size. Or a folder whose images have the same names.
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
    let compare = |paths: [&Path; 2]| compare(paths, tolerance, &options);
    if [actual, golden].iter().all(|path| path.is_dir()) {
        return compare_folders([actual, golden], difference.as_deref(), compare);
    }
    let (comparison, report) = compare([actual, golden])?;
    let mut saved = Vec::new();
    if let Some(path) = difference {
        saved.push((path.as_path(), comparison.difference_image().encode(path, PngDepth::Eight)?));
    }
    outputs::write(&saved, report.as_bytes())?;
    if comparison.passes() { Ok(()) } else { Err(differ([actual, golden])) }
}

/// Compares two images, and reports how they differ and what they were made on.
fn compare(paths: [&Path; 2], tolerance: Tolerance, options: &ReadOptions) -> Result<(Comparison, String), Failure> {
    let open = |path: &Path| Picture::open_with(path, options).map_err(|error| Failure::Input(error.to_string()));
    let pictures = [open(paths[0])?, open(paths[1])?];
    let comparison = Comparison::new(&pictures[0].image, &pictures[1].image, tolerance).map_err(|error| {
        let message = format!("{}: {error}", both(paths));
        // Images of different sizes are valid input: the result is that they differ.
        if matches!(error, ComparisonError::Size { .. }) { Failure::Other(message) } else { Failure::Input(message) }
    })?;
    let mut report = format!("{comparison}\n");
    for (path, picture) in paths.into_iter().zip(&pictures) {
        if let Some(made_on) = &picture.made_on {
            report += &format!("{} made on: {made_on}\n", path.display());
        }
    }
    Ok((comparison, report))
}

/// Compares the images of two folders that have the same name. An image without a counterpart differs.
fn compare_folders(
    folders: [&Path; 2],
    difference: Option<&Path>,
    compare: impl Fn([&Path; 2]) -> Result<(Comparison, String), Failure>,
) -> Result<(), Failure> {
    if let Some(path) = difference {
        let message = format!("--difference: found {} for folders, allowed: an image for two images", path.display());
        return Err(Failure::Input(message));
    }
    let [actual, golden] = [images_in(folders[0])?, images_in(folders[1])?];
    let names: BTreeSet<&OsString> = actual.union(&golden).collect();
    if names.is_empty() {
        return Err(Failure::Input(format!("{}: found no image, allowed: .png, .exr or .npy files", both(folders))));
    }
    let (mut report, mut differing) = (String::new(), 0);
    for &name in &names {
        let shown = Path::new(name).display();
        let missing =
            [(&actual, folders[0]), (&golden, folders[1])].into_iter().find(|(in_it, _)| !in_it.contains(name));
        let outcome = match missing {
            Some((_, folder)) => Err(Failure::Other(format!("none in {}", folder.display()))),
            None => compare(folders.map(|folder| folder.join(name)).each_ref().map(PathBuf::as_path)),
        };
        let (passes, text) = match outcome {
            Ok((comparison, text)) => (comparison.passes(), text),
            Err(Failure::Other(message)) => (false, message + "\n"),
            Err(failure) => return Err(failure),
        };
        report += &format!("{shown}: {}\n{text}", if passes { "passes" } else { "differs" });
        differing += usize::from(!passes);
    }
    report += &format!("{differing} of {} images differ\n", names.len());
    outputs::write(&[], report.as_bytes())?;
    if differing == 0 { Ok(()) } else { Err(differ(folders)) }
}

/// The names of the images in a folder.
fn images_in(folder: &Path) -> Result<BTreeSet<OsString>, Failure> {
    let failed = |error| Failure::Input(format!("{}: {error}", folder.display()));
    let mut names = BTreeSet::new();
    for entry in folder.read_dir().map_err(failed)? {
        let name = entry.map_err(failed)?.file_name();
        if Image::check_format(name.as_ref()).is_ok() {
            names.insert(name);
        }
    }
    Ok(names)
}

fn both([actual, golden]: [&Path; 2]) -> String {
    format!("{} and {}", actual.display(), golden.display())
}

fn differ(paths: [&Path; 2]) -> Failure {
    Failure::Other(format!("{} differ", both(paths)))
}
