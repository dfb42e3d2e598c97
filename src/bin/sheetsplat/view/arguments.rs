//! The arguments of `sheetsplat view`, and its result.

use std::cell::RefCell;
use std::path::PathBuf;
use std::rc::Rc;

use crate::arguments::Input;
use crate::failure::Failure;

#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  sheetsplat view builtin:head
  sheetsplat view scene.toml --size 1600x1000")]
pub(crate) struct Arguments {
    #[command(flatten)]
    pub(super) input: Input,
    /// Save the window's first complete frame and close the window: .png, .exr or .npy.
    #[arg(long, value_name = "FILE")]
    pub(super) screenshot: Option<PathBuf>,
}

/// The result, unless the user closed the window.
pub(super) type Outcome = Rc<RefCell<Option<Result<(), Failure>>>>;

impl Arguments {
    /// The size of the window in points (pixels, unless the display is scaled).
    pub(super) fn size(&self) -> Result<[u16; 2], Failure> {
        let [width, height] = self.input.size().unwrap_or([1280, 800]);
        let side = |side: u32| u16::try_from(side).ok().filter(|side| (100..=16384).contains(side));
        let sides = side(width).zip(side(height)).map(Into::into);
        let failure =
            || Failure::Input(format!("--size: found {width}x{height}, allowed for a window: each 100 to 16384"));
        sides.ok_or_else(failure)
    }
}
