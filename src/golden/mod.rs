//! Golden images for tests: pictures that somebody has checked once, with which later pictures are compared.
//!
//! [`assert_golden!`](crate::assert_golden) compares an image with `goldens/NAME.png` in the folder of the test's source file:
//!
//! ```no_run
//! use sheetsplat::assert_golden;
//! use sheetsplat::golden::Tolerance;
//! # use sheetsplat::headless::{Headless, HeadlessOptions};
//! # use sheetsplat::scene::{Scene, VolumeSource};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let headless = Headless::new(&HeadlessOptions::default())?;
//! # let scene = Scene::from_volume(VolumeSource::Builtin("head:48".to_owned()), &[])?;
//! let rendering = headless.render(&scene)?;
//! assert_golden!("head", rendering);
//! // With its own tolerance: 4 of 255 per channel, and one pixel in 1000 may differ by more.
//! assert_golden!("head", rendering, Tolerance::new(4, 0.001)?);
//! # Ok(())
//! # }
//! ```
//!
//! [`golden!`](crate::golden!) gives the golden as a value on which more can be set, and [`Golden::check`] returns a result instead of
//! panicking. [`Comparison`] alone compares any two images:
//!
//! ```
//! use sheetsplat::golden::{Comparison, Tolerance};
//! use sheetsplat::image::Image;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let golden = Image { width: 8, height: 4, pixels: vec![[0.5, 0.5, 0.5, 1.0]; 32] };
//! let mut actual = golden.clone();
//! actual.pixels[9] = [0.5, 0.7, 0.5, 1.0];
//! let comparison = Comparison::new(&actual, &golden, Tolerance::default())?;
//! assert!(!comparison.passes());
//! assert_eq!((comparison.max, comparison.worst, comparison.outliers), ([0, 51, 0, 0], [1, 1], 1));
//! # Ok(())
//! # }
//! ```
//!
//! # The native backend
//!
//! [`cpu`](crate::headless::Backend::Cpu) gives the same bytes on every machine. So a picture and a golden that were both made by it must be equal to the last
//! bit, unless the test allows a tolerance:
//!
//! ```no_run
//! use sheetsplat::assert_golden;
//! use sheetsplat::headless::{Backend, Headless, HeadlessOptions};
//! # use sheetsplat::scene::{Scene, VolumeSource};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let scene = Scene::from_volume(VolumeSource::Builtin("head:48".to_owned()), &[])?;
//! let headless = Headless::new(&HeadlessOptions::default().with_backend(Backend::Cpu))?;
//! assert_golden!("head", headless.render(&scene)?);
//! # Ok(())
//! # }
//! ```
//!
//! # Blessing
//!
//! `SHEETSPLAT_BLESS=all cargo test`, or the names of goldens separated by commas, makes an image the golden if it fails or has no
//! golden yet. Goldens that pass are not touched. Look at what changed before you commit it.
//!
//! # Failures
//!
//! A failed image is left under `target/goldens`, in a folder named like the test's source file, with an image of the differences and
//! a report. A later success removes these files.
//!
//! # Adapters
//!
//! A [`Rendering`](crate::headless::Rendering) knows the adapter and driver that made it. So does its golden, in the PNG's texts
//! `Adapter` and `Driver`; reports name both. If the adapters differ, [`Tolerance::WIDEST`] replaces the test's tolerance, because GPUs
//! round differently. The same holds for an image of unknown origin and a golden that names its adapter.

mod bless;
mod comparison;
mod error;
mod file;
mod made_on;
mod site;
mod subject;
mod tolerance;

use std::io::ErrorKind;
use std::path::PathBuf;

pub use bless::Bless;
pub use comparison::{Comparison, ComparisonError};
pub use error::{Failure, GoldenError, Reason};
pub use made_on::MadeOn;
#[doc(hidden)]
pub use site::Site;
pub use subject::{Picture, Subject};
pub use tolerance::{LaxTolerance, Tolerance};

use crate::image::{Image, ImageError, PngDepth, output};

/// Asserts that an image matches its golden, `goldens/NAME.png` in the folder of the source file.
///
/// `assert_golden!(name, image)`, or `assert_golden!(name, image, tolerance)`, where `image` is a [`Subject`](crate::golden::Subject)
/// or a reference to one. See [`golden`](mod@crate::golden).
///
/// # Panics
/// If the image differs, with a report, or on any other [`GoldenError`](crate::golden::GoldenError).
#[macro_export]
macro_rules! assert_golden {
    ($name:expr, $image:expr $(,)?) => {
        $crate::assert_golden!(@ $name, $image, None)
    };
    ($name:expr, $image:expr, $tolerance:expr $(,)?) => {
        $crate::assert_golden!(@ $name, $image, Some($tolerance))
    };
    (@ $name:expr, $image:expr, $tolerance:expr) => {{
        // Outside of closures, so that the expressions may use `?`.
        let (image, tolerance): (_, Option<$crate::golden::Tolerance>) = (&$image, $tolerance);
        let compare = |golden: $crate::golden::Golden| match tolerance {
            Some(tolerance) => golden.tolerance(tolerance).check(image),
            None => golden.check(image),
        };
        match $crate::golden!($name).and_then(compare) {
            Ok($crate::golden::Outcome::Passed(_)) => {}
            Ok($crate::golden::Outcome::Blessed(path)) => println!("blessed {}", path.display()),
            Err(error) => panic!("{error}"),
        }
    }};
}

/// The golden with which [`assert_golden!`](crate::assert_golden) would compare here: a
/// `Result<`[`Golden`](crate::golden::Golden)`, `[`GoldenError`](crate::golden::GoldenError)`>`.
#[macro_export]
macro_rules! golden {
    ($name:expr $(,)?) => {
        $crate::golden::Golden::beside(
            $name,
            $crate::golden::Site {
                manifest_dir: env!("CARGO_MANIFEST_DIR"),
                file: file!(),
                target_tmpdir: option_env!("CARGO_TARGET_TMPDIR"),
            },
        )
    };
}

/// A golden, and the settings for comparisons with it.
#[derive(Clone, Debug)]
pub struct Golden {
    name: String,
    folder: PathBuf,
    failures: PathBuf,
    /// If the test says one.
    tolerance: Option<Tolerance>,
    bless: Option<Bless>,
}

/// The result of a successful check.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// The image matches its golden.
    Passed(Comparison),
    /// The image has become the golden, this file.
    Blessed(PathBuf),
}

impl Golden {
    /// The golden `folder/NAME.png`. The files of failures go into the folder `failures`.
    ///
    /// # Errors
    /// If the name has characters other than letters, digits, `-`, `_` and `.`, begins with `.`, is empty, or is `all`.
    pub fn new(name: &str, folder: impl Into<PathBuf>, failures: impl Into<PathBuf>) -> Result<Self, GoldenError> {
        bless::check_name(name)?;
        Ok(Self {
            name: name.to_owned(),
            folder: folder.into(),
            failures: failures.into(),
            tolerance: None,
            bless: None,
        })
    }

    /// The function behind [`golden!`](crate::golden!).
    ///
    /// # Errors
    /// As for [`Golden::new`], and if the source file does not exist.
    #[doc(hidden)]
    pub fn beside(name: &str, site: Site<'_>) -> Result<Self, GoldenError> {
        Self::new(name, site.goldens()?, site.failures())
    }

    /// Replaces the default tolerance, which is [`Tolerance::EXACT`] if the native backend made both image and golden, and else
    /// [`Tolerance::default`].
    #[must_use]
    pub fn tolerance(self, tolerance: Tolerance) -> Self {
        Self { tolerance: Some(tolerance), ..self }
    }

    /// Puts the files of failures into another folder, for several images that share a golden.
    #[must_use]
    pub fn failures(self, folder: impl Into<PathBuf>) -> Self {
        Self { failures: folder.into(), ..self }
    }

    /// Sets which goldens are blessed, in place of the environment variable.
    #[must_use]
    pub fn bless(self, bless: Bless) -> Self {
        Self { bless: Some(bless), ..self }
    }

    /// The golden's file.
    pub fn path(&self) -> PathBuf {
        self.folder.join(format!("{}.png", self.name))
    }

    /// Compares an image with the golden. If it fails and the golden is blessed, the image becomes the golden.
    ///
    /// # Errors
    /// If the image fails and the golden is not blessed, if the image is invalid, or if a file cannot be written.
    pub fn check(&self, subject: &impl Subject) -> Result<Outcome, GoldenError> {
        let bless = self.bless.clone().map_or_else(Bless::from_env, Ok)?;
        let (image, made_on) = (subject.image(), subject.made_on());
        let pixels = comparison::eight_bit(image, "actual")
            .map_err(|source| GoldenError::Subject { name: self.name.clone(), source })?;
        let write = |path: PathBuf| file::write(&path, [image.width, image.height], &pixels, made_on.as_ref());
        match self.compare(image, made_on.as_ref()) {
            Ok(comparison) => {
                self.clear()?;
                Ok(Outcome::Passed(comparison))
            }
            Err(_) if bless.contains(&self.name) => {
                write(self.path())?;
                self.clear()?;
                Ok(Outcome::Blessed(self.path()))
            }
            Err(mut failure) => {
                // An error in writing these files must not hide why the image fails.
                let left =
                    self.clear().and_then(|()| write(self.left("actual.png"))).and_then(|()| self.leave(&failure));
                failure.left_in = left.map(|()| self.failures.clone());
                Err(failure.into())
            }
        }
    }

    /// The comparison if it passes, or else a failure that has not written any files yet.
    fn compare(&self, actual: &Image, made_on: Option<&MadeOn>) -> Result<Comparison, Box<Failure>> {
        let failure = |reason, golden_made_on| {
            Box::new(Failure {
                name: self.name.clone(),
                golden: self.path(),
                golden_made_on,
                actual_made_on: made_on.cloned(),
                reason,
                left_in: Ok(self.failures.clone()),
            })
        };
        let golden = Picture::open(&self.path()).map_err(|error| match error {
            ImageError::Io { source, .. } if source.kind() == ErrorKind::NotFound => failure(Reason::Missing, None),
            error => failure(Reason::Unreadable(error), None),
        })?;
        let same = MadeOn::same(golden.made_on.as_ref(), made_on);
        let is_exact = made_on.is_some_and(MadeOn::is_exact);
        let default = if is_exact { Tolerance::EXACT } else { Tolerance::default() };
        let tolerance = if same { self.tolerance.unwrap_or(default) } else { Tolerance::WIDEST };
        match Comparison::new(actual, &golden.image, tolerance) {
            Ok(comparison) if comparison.passes() => Ok(comparison),
            Ok(comparison) => Err(failure(Reason::Differs(comparison), golden.made_on)),
            Err(error) => Err(failure(Reason::Incomparable(error), golden.made_on)),
        }
    }

    /// The path of one of a failure's files.
    fn left(&self, what: &str) -> PathBuf {
        self.failures.join(format!("{}-{what}", self.name))
    }

    /// Writes the report and the image of the differences.
    fn leave(&self, failure: &Failure) -> Result<(), ImageError> {
        if let Reason::Differs(comparison) = &failure.reason {
            comparison.difference_image().save(&self.left("difference.png"), PngDepth::Eight)?;
        }
        let path = self.left("report.txt");
        output::write(&path, format!("{failure}\n").as_bytes()).map_err(|source| ImageError::Io { path, source })
    }

    /// Removes the files of an earlier failure.
    fn clear(&self) -> Result<(), ImageError> {
        for path in ["actual.png", "difference.png", "report.txt"].map(|what| self.left(what)) {
            match std::fs::remove_file(&path) {
                Err(source) if source.kind() != ErrorKind::NotFound => {
                    return Err(ImageError::Io { path, source });
                }
                _ => {}
            }
        }
        Ok(())
    }
}
