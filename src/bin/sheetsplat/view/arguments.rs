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
    /// Size of the window in points (pixels, unless the display is scaled).
    #[arg(long, value_name = "WxH", default_value = "1280x800", value_parser = parse_size)]
    pub(super) size: [u16; 2],
    /// Save the window's first complete frame and close the window: .png, .exr or .npy.
    #[arg(long, value_name = "FILE")]
    pub(super) screenshot: Option<PathBuf>,
}

/// The result, unless the user closed the window.
pub(super) type Outcome = Rc<RefCell<Option<Result<(), Failure>>>>;

/// Parses `WxH`.
fn parse_size(text: &str) -> Result<[u16; 2], String> {
    let parse = |side: &str| side.parse::<u16>().ok().filter(|side| (100..=16384).contains(side));
    let sides = text.split_once('x').and_then(|(width, height)| Some([parse(width)?, parse(height)?]));
    sides.ok_or_else(|| "allowed: WxH, each 100 to 16384".to_owned())
}
