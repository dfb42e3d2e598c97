//! `sheetsplat view`: a window with the picture and its settings.

mod app;
mod arguments;
mod channels;
mod editor;
mod guest;
mod histogram;
mod pace;
mod panel;
mod plot;
mod screenshot;

use eframe::NativeOptions;
use eframe::egui::{IconData, ViewportBuilder};
use sheetsplat::headless::Backend;
use sheetsplat::image::Image;
use sheetsplat::scene::Scene;

use crate::failure::Failure;
use crate::outputs::Outputs;
use app::App;
pub(crate) use arguments::Arguments;
use arguments::Outcome;

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    if let Some(path) = &arguments.screenshot {
        Image::check_format(path)?;
    }
    let backend = arguments.input.backend;
    if !matches!(backend, Backend::Auto | Backend::Gpu) {
        return Err(Failure::Input(format!("--backend: found {backend}, allowed: gpu or auto for a window")));
    }
    let size = arguments.size()?;
    let mut scene = arguments.input.scene()?;
    let named: Vec<_> = arguments.screenshot.iter().map(|path| ("--screenshot", path.as_path())).collect();
    let outputs = Outputs::check(&named, false, &arguments.input.files(&scene))?;
    // Levels are chosen for the window's first picture.
    let image = scene.image;
    [scene.image.width, scene.image.height] = size.map(u32::from);
    scene = Scene { image, ..arguments.input.choose_levels(&scene, Scene::explicit_all_around)? };
    let volume = arguments.input.load_volume(&scene, &outputs)?;
    arguments.input.choose_view(&volume, &mut scene)?;
    scene = scene.fitted(&volume);
    scene.camera = scene.camera_for(&volume);

    let title = format!("{} - sheetsplat", arguments.input.name);
    let viewport = ViewportBuilder::default()
        .with_inner_size(size.map(f32::from))
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
