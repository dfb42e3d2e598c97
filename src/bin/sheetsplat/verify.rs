//! `sheetsplat verify`.

use std::path::{Path, PathBuf};

use sheetsplat::image::{Image, PngDepth};
use sheetsplat::internals::plain_whole;
use sheetsplat::provenance::{Verified, Verifier};

use crate::failure::Failure;
use crate::outputs::{self, Outputs};
use crate::picture::is_picture;
use crate::reading::Reading;

#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  sheetsplat verify figure.png
  sheetsplat verify docs/figures --search data --oracle 100

Exit codes: 0 all pictures are what they say they are, 1 one is not, 2 one cannot be verified.")]
pub(crate) struct Arguments {
    /// Pictures that `render`, `orbit` or Python wrote, .png or .exr; or folders with such pictures.
    #[arg(required = true, value_name = "PICTURE")]
    pictures: Vec<PathBuf>,
    /// A folder in which to look for the files of a picture's scene that are not in the picture's own folder. Can be repeated.
    #[arg(long, value_name = "DIR")]
    search: Vec<PathBuf>,
    /// Evaluate some pixels of each picture in f64, and state the largest deviation.
    #[arg(long, value_name = "N", default_value_t = 0)]
    oracle: u32,
    /// Accept pictures of other versions whose pixels are the same.
    #[arg(long)]
    any_version: bool,
    /// Save an image of the differences of the only picture: black to red to yellow.
    #[arg(long, value_name = "FILE")]
    difference: Option<PathBuf>,
    #[command(flatten)]
    reading: Reading,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let Arguments { pictures, search, oracle, any_version, difference, reading } = arguments;
    let pictures = expanded(pictures)?;
    if let Some(path) = difference {
        Image::check_format(path)?;
        if pictures.len() != 1 {
            let found = format!("{} for {} pictures", path.display(), pictures.len());
            return Err(Failure::Input(format!("--difference: found {found}, allowed: an image for one picture")));
        }
    }
    let named: Vec<_> = difference.iter().map(|path| ("--difference", path.as_path())).collect();
    let outputs = Outputs::check(&named, true, &pictures)?;
    let options = reading.options().with_outputs(outputs.written());
    let verifier = Verifier::default().with_options(options).searching(search.clone()).with_oracle(*oracle);
    let mut verifier = if *any_version { verifier.of_any_version() } else { verifier };
    let (mut differing, mut unverified) = (0, 0);
    for path in &pictures {
        let (report, saved) = match verifier.verify(path) {
            Ok(verified) => {
                differing += usize::from(!verified.reasons.is_empty());
                let image = difference.as_ref().zip(verified.comparison.as_ref());
                let saved = image.map(|(path, comparison)| {
                    Ok::<_, Failure>((path.as_path(), comparison.difference_image().encode(path, PngDepth::Eight)?))
                });
                (described(path, &verified), saved.transpose()?)
            }
            Err(error) => {
                unverified += 1;
                (format!("{error}\n"), None)
            }
        };
        // Names and hashes are those of files.
        outputs::write(&Vec::from_iter(saved), plain_whole(&report).to_string().as_bytes())?;
    }
    match (differing, unverified, pictures.len()) {
        (0, 0, _) => Ok(()),
        (0, count, all) => Err(Failure::Input(format!("{count} of {all} pictures cannot be verified"))),
        (count, _, all) => Err(Failure::Other(format!("{count} of {all} pictures are not what they say they are"))),
    }
}

/// The pictures, with those in folders in place of the folders, by their names.
fn expanded(paths: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
    let mut pictures = Vec::new();
    for path in paths {
        if !path.is_dir() {
            Image::check_format(path)?;
            pictures.push(path.clone());
            continue;
        }
        let failed = |error| Failure::Input(format!("{}: {error}", path.display()));
        let entries = path.read_dir().map_err(failed)?.map(|entry| entry.map(|entry| entry.path()));
        let mut found: Vec<PathBuf> = entries.collect::<Result<_, _>>().map_err(failed)?;
        found.retain(|path| is_picture(&path.to_string_lossy()));
        if found.is_empty() {
            return Err(Failure::Input(format!("{}: found no picture, allowed: .png or .exr files", path.display())));
        }
        found.sort();
        pictures.extend(found);
    }
    Ok(pictures)
}

/// A line for a picture, and one for each reason why it is not what it says it is.
fn described(path: &Path, verified: &Verified) -> String {
    let Verified { provenance: made, reasons, deviation, .. } = verified;
    let by = made.adapter().map_or(made.backend().to_owned(), |adapter| format!("{} on {adapter}", made.backend()));
    let verdict = match (reasons.is_empty(), made.backend()) {
        (false, _) => "differs",
        (true, "gpu") => "the same within the tolerance",
        (true, _) => "the same pixels",
    };
    let mut report = format!("{}: {verdict}, by {by}, version {}\n", path.display(), made.version());
    for line in reasons.iter().cloned().chain(deviation.map(|deviation| deviation.to_string())) {
        report += &format!("  {line}\n");
    }
    report
}
