//! Errors of comparisons with goldens.

use std::fmt::{Display, Formatter};
use std::path::PathBuf;

use super::{Comparison, ComparisonError, LaxTolerance, MadeOn};
use crate::image::ImageError;

/// The environment variable that says which goldens may be rewritten.
pub(super) const VARIABLE: &str = "SHEETSPLAT_BLESS";

/// Why an image was not compared with its golden, or differs from it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GoldenError {
    /// The golden's name is invalid.
    #[error("golden: found name {found:?}, allowed: letters, digits, \"-\", \"_\" and, not first, \".\"; not \"all\"")]
    Name {
        /// The name.
        found: String,
    },
    /// The environment variable is invalid.
    #[error("{variable}: {0}", variable = VARIABLE)]
    Bless(Box<GoldenError>),
    /// The tolerance exceeds the widest one.
    #[error(transparent)]
    Lax(#[from] LaxTolerance),
    /// The test's source file is not where it was when compiled.
    #[error("{file}: not found in {} nor above it; Golden::new takes the folder of the goldens", manifest_dir.display())]
    Source {
        /// The file.
        file: String,
        /// The package's folder.
        manifest_dir: PathBuf,
    },
    /// The image itself is invalid.
    #[error("golden \"{name}\": {source}")]
    Subject {
        /// The golden's name.
        name: String,
        /// What is wrong with it.
        source: ComparisonError,
    },
    /// A golden could not be written, or the files of an earlier failure could not be removed.
    #[error(transparent)]
    File(#[from] ImageError),
    /// The image differs from its golden.
    #[error(transparent)]
    Failure(#[from] Box<Failure>),
}

/// An image that failed. Its display is a report of several lines.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub struct Failure {
    /// The golden's name.
    pub name: String,
    /// The golden's file.
    pub golden: PathBuf,
    /// The adapter and driver that made the golden, if its file names them.
    pub golden_made_on: Option<MadeOn>,
    /// The adapter and driver that made the image, if known.
    pub actual_made_on: Option<MadeOn>,
    /// Why the image failed.
    pub reason: Reason,
    /// The folder with `NAME-actual.png`, `NAME-report.txt` and, for images of equal size, `NAME-difference.png`; or the error that
    /// prevented writing them.
    pub left_in: Result<PathBuf, ImageError>,
}

/// Why an image failed.
#[derive(Debug)]
#[non_exhaustive]
pub enum Reason {
    /// There is no golden.
    Missing,
    /// The golden cannot be read.
    Unreadable(ImageError),
    /// The golden and the image cannot be compared.
    Incomparable(ComparisonError),
    /// They differ by more than the tolerance.
    Differs(Comparison),
}

impl Display for Failure {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let Self { name, golden, left_in, .. } = self;
        let golden = golden.display();
        let made_on = |made_on: &Option<MadeOn>| match made_on {
            Some(made_on) => made_on.to_string(),
            None => "an unknown adapter".to_owned(),
        };
        match &self.reason {
            Reason::Missing => writeln!(f, "golden \"{name}\": {golden} does not exist")?,
            Reason::Unreadable(error) => writeln!(f, "golden \"{name}\": {error}")?,
            Reason::Incomparable(error) => writeln!(f, "golden \"{name}\": {golden}: {error}")?,
            Reason::Differs(comparison) => {
                writeln!(f, "golden \"{name}\": {golden}: the actual image differs")?;
                writeln!(f, "{comparison}")?;
                if !MadeOn::same(self.golden_made_on.as_ref(), self.actual_made_on.as_ref()) {
                    writeln!(f, "compared with the widest tolerance, because the adapters differ")?;
                }
                writeln!(f, "golden made on: {}", made_on(&self.golden_made_on))?;
            }
        }
        writeln!(f, "actual image made on: {}", made_on(&self.actual_made_on))?;
        match left_in {
            Ok(folder) => writeln!(f, "left: {}-*", folder.join(name).display())?,
            Err(error) => writeln!(f, "nothing left: {error}")?,
        }
        write!(f, "{VARIABLE}={name} makes the actual image the golden, if it is right")
    }
}
