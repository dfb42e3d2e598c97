//! Errors that end the program.

use sheetsplat::RenderError;
use sheetsplat::headless::Error;
use sheetsplat::image::ImageError;
use sheetsplat::scene::SceneError;

/// An error, classified by its exit code.
#[derive(Debug)]
pub(crate) enum Failure {
    /// Bad usage or bad input: exit code 2.
    Input(String),
    /// Anything else: exit code 1.
    Other(String),
}

impl Failure {
    pub(crate) fn message(&self) -> &str {
        match self {
            Self::Input(message) | Self::Other(message) => message,
        }
    }

    /// The failure to draw `input`. Scene and volume errors name their file themselves.
    pub(crate) fn of(error: Error, input: &str) -> Self {
        match error {
            Error::Scene(_) | Error::Volume(_) => Self::Input(error.to_string()),
            Error::Render(RenderError::OutOfRange(_) | RenderError::Limit { .. }) => {
                Self::Input(format!("{input}: {error}"))
            }
            _ => Self::Other(error.to_string()),
        }
    }
}

impl From<SceneError> for Failure {
    fn from(error: SceneError) -> Self {
        Self::Input(error.to_string())
    }
}

impl From<ImageError> for Failure {
    fn from(error: ImageError) -> Self {
        match error {
            ImageError::Format { .. } => Self::Input(error.to_string()),
            _ => Self::Other(error.to_string()),
        }
    }
}
