//! `sheetsplat view`: a window with the picture and its settings.

mod app;
mod channels;
mod editor;
mod guest;
mod histogram;
mod pace;
mod panel;
mod plot;
mod screenshot;

use std::cell::RefCell;
use std::path::PathBuf;
use std::rc::Rc;

use eframe::NativeOptions;
use eframe::egui::{IconData, ViewportBuilder};
use sheetsplat::headless::Backend;
use sheetsplat::image::Image;
use sheetsplat::scene::Scene;

use crate::arguments::Input;
use crate::failure::Failure;
use crate::outputs::Outputs;
use app::App;

#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  sheetsplat view builtin:head
  sheetsplat view scene.toml --size 1600x1000")]
pub(crate) struct Arguments {
    #[command(flatten)]
    input: Input,
    /// Size of the window in points (pixels, unless the display is scaled).
    #[arg(long, value_name = "WxH", default_value = "1280x800", value_parser = parse_size)]
    size: [u16; 2],
    /// Save the window's first complete frame and close the window: .png, .exr or .npy.
    #[arg(long, value_name = "FILE")]
    screenshot: Option<PathBuf>,
}

/// The result, unless the user closed the window.
type Outcome = Rc<RefCell<Option<Result<(), Failure>>>>;

/// Parses `WxH`.
fn parse_size(text: &str) -> Result<[u16; 2], String> {
    let parse = |side: &str| side.parse::<u16>().ok().filter(|side| (100..=16384).contains(side));
    let sides = text.split_once('x').and_then(|(width, height)| Some([parse(width)?, parse(height)?]));
    sides.ok_or_else(|| "allowed: WxH, each 100 to 16384".to_owned())
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    if let Some(path) = &arguments.screenshot {
        Image::check_format(path)?;
    }
    let backend = arguments.input.backend;
    if !matches!(backend, Backend::Auto | Backend::Gpu) {
        return Err(Failure::Input(format!("--backend: found {backend}, allowed: gpu or auto for a window")));
    }
    let mut scene = arguments.input.scene()?;
    let named: Vec<_> = arguments.screenshot.iter().map(|path| ("--screenshot", path.as_path())).collect();
    let outputs = Outputs::check(&named, false, &arguments.input.files(&scene))?;
    // Levels are chosen for the window's first picture.
    let image = scene.image;
    [scene.image.width, scene.image.height] = arguments.size.map(u32::from);
    scene = Scene { image, ..arguments.input.choose_levels(&scene, Scene::explicit_all_around)? };
    let volume = arguments.input.load_volume(&scene, &outputs)?;
    arguments.input.look_at(&volume, &mut scene)?;

    let title = format!("{} - sheetsplat", arguments.input.name);
    let viewport = ViewportBuilder::default()
        .with_inner_size(arguments.size.map(f32::from))
        .with_title(&title)
        .with_icon(IconData::default());
    let options = NativeOptions {
        viewport,
        wgpu_options: guest::device_options(arguments.input.adapter.clone()),
        // Pictures are shown, and saved, without changes.
        dithering: false,
        ..NativeOptions::default()
    };
    let outcome = Outcome::default();
    let shared = outcome.clone();
    let start =
        |context: &eframe::CreationContext<'_>| match App::new(context, arguments, scene, volume, shared.clone()) {
            Ok(app) => Ok(Box::new(app) as Box<dyn eframe::App>),
            Err(failure) => {
                let message = failure.message().to_owned();
                *shared.borrow_mut() = Some(Err(failure));
                Err(message.into())
            }
        };
    let result = eframe::run_native("sheetsplat", options, Box::new(start));
    let outcome = outcome.borrow_mut().take();
    match (outcome, result) {
        (Some(outcome), _) => outcome,
        (None, Err(error)) => Err(Failure::Other(format!("no window: {error}"))),
        (None, Ok(())) if arguments.screenshot.is_some() => {
            Err(Failure::Other("--screenshot: the window was closed before its first frame".to_owned()))
        }
        (None, Ok(())) => Ok(()),
    }
}
