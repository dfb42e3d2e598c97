//! Errors as exceptions of the module `sheetsplat.errors`.

use std::fmt::Display;

use pyo3::PyErr;
use sheetsplat::golden::{ComparisonError, GoldenError, LaxTolerance};
use sheetsplat::image::ImageError;
use sheetsplat::part::MergeError;
use sheetsplat::provenance::Unverifiable;
use sheetsplat::scene::SceneError;
use sheetsplat::volume::VolumeError;
use sheetsplat::{DeviceError, RenderError, SettingError, headless};

/// The classes of exceptions.
mod classes {
    use pyo3::import_exception;
    import_exception!(sheetsplat.errors, DeviceError);
    import_exception!(sheetsplat.errors, FileError);
    import_exception!(sheetsplat.errors, GoldenError);
    import_exception!(sheetsplat.errors, ImageError);
    import_exception!(sheetsplat.errors, MergeError);
    import_exception!(sheetsplat.errors, RenderError);
    import_exception!(sheetsplat.errors, SceneError);
    import_exception!(sheetsplat.errors, VolumeError);
}

/// The origin of settings from `--set`, by which keyword arguments are passed on.
const OVERRIDE: &str = "--set";

/// An error of this package on its way to Python.
pub(crate) struct Raised(PyErr);

impl From<Raised> for PyErr {
    fn from(raised: Raised) -> Self {
        raised.0
    }
}

impl From<PyErr> for Raised {
    fn from(error: PyErr) -> Self {
        Self(error)
    }
}

/// Fields of an exception, by which programs can tell what was wrong.
fn fields(key: &str, found: &str, allowed: &str) -> [Option<String>; 3] {
    [key, found, allowed].map(|text| Some(text.to_owned()))
}

/// The exception for a setting that is not allowed.
pub(crate) fn setting(key: &str, found: &str, allowed: &str) -> Raised {
    let [named, was, may_be] = fields(key, found, allowed);
    let message = format!("{key}: found {found}, allowed: {allowed}");
    Raised(classes::SceneError::new_err((message, named, was, may_be)))
}

/// The exception for a volume that is not allowed.
pub(crate) fn volume(field: &str, found: &str, allowed: &str) -> Raised {
    let [named, was, may_be] = fields(field, found, allowed);
    let message = format!("array: {field}: found {found}, allowed: {allowed}");
    Raised(classes::VolumeError::new_err((message, named, was, may_be)))
}

/// The exception of a file that cannot be read or written; its `errno` is the operating system's.
pub(crate) fn file(path: &std::path::Path, source: &std::io::Error) -> Raised {
    let message = match source.raw_os_error() {
        // The operating system's number follows the message; Python shows it itself.
        Some(number) => source.to_string().replace(&format!(" (os error {number})"), ""),
        None => source.to_string(),
    };
    Raised(classes::FileError::new_err((source.raw_os_error(), message, path.display().to_string())))
}

impl From<SceneError> for Raised {
    fn from(error: SceneError) -> Self {
        match &error {
            SceneError::Io { path, source, .. } => file(path, source),
            SceneError::Invalid { origin, key, found, allowed, .. } => {
                let allowed = allowed.to_string();
                if origin == OVERRIDE {
                    return setting(key, found, &allowed);
                }
                let [key, found, allowed] = fields(key, found, &allowed);
                Self(classes::SceneError::new_err((error.to_string(), key, found, allowed)))
            }
            _ => Self(classes::SceneError::new_err(error.to_string())),
        }
    }
}

impl From<VolumeError> for Raised {
    fn from(error: VolumeError) -> Self {
        match &error {
            VolumeError::Io { path, source, .. } => file(path, source),
            VolumeError::Invalid { field, found, allowed, .. } => {
                let [key, found, allowed] = fields(field, found, allowed);
                Self(classes::VolumeError::new_err((error.to_string(), key, found, allowed)))
            }
            _ => Self(classes::VolumeError::new_err(error.to_string())),
        }
    }
}

impl From<SettingError> for Raised {
    fn from(error: SettingError) -> Self {
        setting(&error.key, &error.found.to_string(), &error.allowed.to_string())
    }
}

impl From<RenderError> for Raised {
    fn from(error: RenderError) -> Self {
        match error {
            RenderError::OutOfRange(error) => error.into(),
            RenderError::Volume(error) => error.into(),
            error @ RenderError::Limit { .. } => Self(classes::RenderError::new_err(error.to_string())),
            error => Self(classes::DeviceError::new_err(error.to_string())),
        }
    }
}

/// The exception for what does not survive a fork.
pub(crate) fn forked(what: &str) -> Raised {
    let message = format!(
        "{what}: found a forked process, allowed: the process that imported sheetsplat, or one that is spawned"
    );
    Raised(classes::DeviceError::new_err(message))
}

/// The exception where the operating system starts no thread.
pub(crate) fn no_threads(found: impl Display) -> Raised {
    let message = format!("threads: found {found}, allowed: as many threads as the machine has cores, and one more");
    Raised(classes::DeviceError::new_err(message))
}

impl From<DeviceError> for Raised {
    fn from(error: DeviceError) -> Self {
        Self(classes::DeviceError::new_err(error.to_string()))
    }
}

impl From<headless::Error> for Raised {
    fn from(error: headless::Error) -> Self {
        match error {
            headless::Error::Scene(error) => error.into(),
            headless::Error::Volume(error) => error.into(),
            headless::Error::Device(error) => error.into(),
            headless::Error::Render(error) => error.into(),
            error => Self(classes::RenderError::new_err(error.to_string())),
        }
    }
}

impl From<ImageError> for Raised {
    fn from(error: ImageError) -> Self {
        match &error {
            ImageError::Io { path, source, .. } => file(path, source),
            _ => Self(classes::ImageError::new_err(error.to_string())),
        }
    }
}

/// The exception for a picture that is not allowed.
pub(crate) fn picture(path: &std::path::Path, found: &str, allowed: &str) -> Raised {
    Raised(classes::ImageError::new_err(format!("{}: found {found}, allowed: {allowed}", path.display())))
}

/// The exception for a picture that cannot be verified.
impl From<Unverifiable> for Raised {
    fn from(error: Unverifiable) -> Self {
        Self(classes::ImageError::new_err(error.to_string()))
    }
}

impl From<MergeError> for Raised {
    fn from(error: MergeError) -> Self {
        Self(classes::MergeError::new_err(error.to_string()))
    }
}

impl From<ComparisonError> for Raised {
    fn from(error: ComparisonError) -> Self {
        Self(classes::ImageError::new_err(error.to_string()))
    }
}

impl From<LaxTolerance> for Raised {
    fn from(error: LaxTolerance) -> Self {
        Self(classes::GoldenError::new_err(error.to_string()))
    }
}

impl From<GoldenError> for Raised {
    fn from(error: GoldenError) -> Self {
        match error {
            GoldenError::File(error) => error.into(),
            error => Self(classes::GoldenError::new_err(error.to_string())),
        }
    }
}
