//! The window's contents: the picture, which the pointer controls, and the panel.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use eframe::egui::emath::GuiRounding;
use eframe::egui::{
    CentralPanel, Color32, ColorImage, Context, Panel, PointerButton, Rect, Response, ScrollArea, Sense, Ui,
    ViewportCommand, pos2,
};
use glam::DVec2;
use sheetsplat::image::PngDepth;
use sheetsplat::scene::{ImageSettings, Scene};
use sheetsplat::settings::{Camera, Sphere, TransferFunction, navigation};
use sheetsplat::volume::{self, Volume};

use super::arguments::{Arguments, Outcome};
use super::channels::{Change, Channels};
use super::editor::Editor;
use super::guest::Guest;
use super::histogram::{Histogram, extent};
use super::pace::Pace;
use super::{panel, plot, screenshot};
use crate::failure::Failure;

/// Degrees that the camera turns for a drag over the picture's whole height.
const TURN: f64 = 180.0;

/// The zoom factor's exponent per point of scrolling.
const ZOOM_PER_POINT: f64 = 0.0015;

/// The pause after a scroll before the picture is refined.
const SCROLL_PAUSE: Duration = Duration::from_millis(300);

/// The maximum time to wait for the window's pixels.
const CAPTURE_PATIENCE: Duration = Duration::from_secs(20);

pub(super) struct App {
    input: String,
    scene: Scene,
    transfer: volume::Channels<TransferFunction>,
    channels: Channels,
    /// The scene's original camera.
    home: Camera,
    /// What a camera that fits the object shows.
    object: Option<Sphere>,
    editor: Editor,
    histogram: Histogram,
    guest: Guest,
    pace: Pace,
    scrolled: Option<Instant>,
    /// The picture's rectangle in the window, in pixels.
    picture: Rect,
    /// Why the current scene cannot be drawn.
    problem: Option<String>,
    /// A message about the last saved file.
    saved: String,
    capture: Option<Capture>,
    /// The file for the window's first complete frame, after which the window closes.
    screenshot: Option<PathBuf>,
    outcome: Outcome,
}

/// The window's pixels, requested for a file.
struct Capture {
    arrival: Receiver<Arc<ColorImage>>,
    since: Instant,
    part: Option<Rect>,
    path: PathBuf,
}

impl App {
    pub(super) fn new(
        context: &eframe::CreationContext<'_>,
        arguments: &Arguments,
        mut scene: Scene,
        volume: Volume,
        outcome: Outcome,
    ) -> Result<Self, Failure> {
        let Some(host) = &context.wgpu_render_state else {
            return Err(Failure::Other("the window has no wgpu device".to_owned()));
        };
        let object = scene.sphere(&volume, &scene.resolve(&volume));
        let guest = Guest::new(host, volume, &scene, &arguments.input.name)?;
        // The panel shows the choice, and the user may change it.
        scene.splatting.classification = guest.classification();
        let channels = Channels::new(&scene, guest.volume());
        let transfer = match channels.are_several() {
            true => Channels::transfer(&scene, guest.volume()),
            false => guest.transfer().clone(),
        };
        let values = guest.volume().values();
        let editor = Editor::new(transfer.first(), extent(values));
        Ok(Self {
            input: arguments.input.name.clone(),
            home: scene.camera,
            object,
            transfer,
            channels,
            histogram: Histogram::new(values, editor.range()),
            editor,
            guest,
            scene,
            pace: Pace::default(),
            scrolled: None,
            picture: Rect::NOTHING,
            problem: None,
            saved: String::new(),
            capture: None,
            screenshot: arguments.screenshot.clone(),
            outcome,
        })
    }

    fn panel(&mut self, ui: &mut Ui) {
        match self.channels.are_several() {
            true => ui.heading(format!("Transfer function of {}", self.channels.edited_name())),
            false => ui.heading("Transfer function"),
        };
        let before = self.editor.points().to_vec();
        plot::show(ui, &mut self.editor, &self.histogram);
        if before != self.editor.points() {
            let edited = self.channels.edited_of(&mut self.transfer);
            *edited = self.editor.apply(edited);
        }
        if self.channels.are_several() {
            ui.separator();
            ui.heading("Channels");
            let change = self.channels.show(ui, &mut self.transfer);
            self.follow(change);
        }
        ui.separator();
        ui.heading("Splatting");
        panel::splatting(ui, &mut self.scene.splatting);
        ui.separator();
        ui.heading("Light");
        panel::shading(ui, &mut self.scene.shading, self.scene.splatting.classification);
        ui.separator();
        ui.heading("Frame");
        panel::stats(ui, self.guest.stats());
        ui.separator();
        ui.horizontal_wrapped(|ui| {
            if ui.button("Reset camera").clicked() {
                self.scene.camera = self.home;
            }
            let is_idle = self.capture.is_none();
            if ui.add_enabled(is_idle, eframe::egui::Button::new("Save picture")).clicked() {
                self.capture(ui.ctx(), screenshot::free_name("png"), Some(self.picture));
            }
            if ui.add_enabled(is_idle, eframe::egui::Button::new("Save window")).clicked() {
                self.capture(ui.ctx(), screenshot::free_name("png"), None);
            }
            if ui.button("Save scene").clicked() {
                self.save_scene();
            }
        });
        ui.label(&self.saved);
        if let Some(problem) = &self.problem {
            ui.colored_label(Color32::LIGHT_RED, problem);
        }
    }

    /// Makes the editor follow a change in the list of channels, and the histogram where another channel is edited.
    fn follow(&mut self, change: Option<Change>) {
        let edited = self.channels.edited_of(&mut self.transfer);
        match change {
            Some(Change::Edited) => {
                let volume = self.guest.volume();
                let values = volume.channel(self.channels.edited()).unwrap_or(volume).values();
                self.editor = Editor::new(edited, extent(values));
                self.histogram = Histogram::new(values, self.editor.range());
            }
            Some(Change::Color) => self.editor = Editor::new(edited, self.editor.range()),
            None => {}
        }
    }

    /// The camera for an image of `size` pixels, with the object whole from every direction where the scene leaves that open.
    fn camera(&self, size: [u32; 2]) -> Camera {
        let camera = &self.scene.camera;
        self.object.map_or(*camera, |object| object.fit(camera, size))
    }

    /// Handles orbit, zoom and pan. Returns whether the pointer is changing the picture.
    fn navigate(&mut self, ui: &Ui, response: &Response) -> bool {
        let points = response.rect.size();
        let size = [points.x.max(1.0) as u32, points.y.max(1.0) as u32];
        let shown = self.camera(size);
        let (camera, radius) = (&mut self.scene.camera, self.scene.splatting.radius);
        let height = navigation::height(&shown, self.guest.grid(), radius, size);
        let moved = DVec2::new(response.drag_delta().x.into(), response.drag_delta().y.into()) / f64::from(size[1]);
        let pans = ui.input(|input| input.modifiers.shift) || !response.dragged_by(PointerButton::Primary);
        if moved != DVec2::ZERO {
            if pans {
                camera.center = shown.center;
                navigation::pan(camera, moved * height);
            } else {
                navigation::orbit(camera, moved * TURN);
            }
        }
        if response.hovered() {
            let (scroll, pinch) =
                ui.input(|input| (f64::from(input.smooth_scroll_delta().y), f64::from(input.zoom_delta())));
            let factor = (-scroll * ZOOM_PER_POINT).exp() / pinch;
            if factor != 1.0 {
                navigation::zoom(camera, self.guest.grid(), height, factor);
                self.scrolled = Some(Instant::now());
            }
        }
        if self.scrolled.is_some_and(|scrolled| scrolled.elapsed() > SCROLL_PAUSE) {
            self.scrolled = None;
        }
        if self.scrolled.is_some() {
            ui.ctx().request_repaint_after(SCROLL_PAUSE);
        }
        self.scrolled.is_some() || ui.input(|input| input.pointer.any_down())
    }

    /// Shows the picture in the rest of the window. Returns whether it was drawn again.
    fn picture(&mut self, ui: &mut Ui) -> bool {
        let scale = ui.pixels_per_point();
        let rect = ui.max_rect().round_to_pixels(scale);
        let response = ui.allocate_rect(rect, Sense::drag());
        let is_changing = self.navigate(ui, &response);
        self.picture = rect * scale;
        let pixel = self.pace.pixel(is_changing);
        let [width, height] = [rect.width(), rect.height()].map(|points| ((points * scale).round() as u32).max(1));
        let [width, height] = [width, height].map(|pixels| pixels.div_ceil(pixel));
        self.scene.image = ImageSettings { width, height, ..self.scene.image };
        let shown = Scene { camera: self.camera([width, height]), ..self.scene.clone() };
        let result = self.guest.show(&shown, &self.channels.shown(&self.transfer));
        let drawn = matches!(result, Ok(true));
        match result {
            Ok(true) => {
                self.pace.drawn(pixel, self.guest.stats().frame_ms + self.guest.stats().prepare_ms);
                self.problem = None;
            }
            Ok(false) => {}
            Err(error) => {
                let failure = Failure::of(error.into(), &self.input);
                self.problem = Some(failure.message().to_owned());
                if self.screenshot.is_some() {
                    self.finish(ui.ctx(), Err(failure));
                }
            }
        }
        if let Some(texture) = self.guest.texture() {
            let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
            ui.painter().image(texture, rect, whole, Color32::WHITE);
        }
        drawn
    }

    /// Requests the window's pixels.
    fn capture(&mut self, context: &Context, path: PathBuf, part: Option<Rect>) {
        let (sender, arrival) = channel();
        context.request_screenshot(move |window| {
            // The receiver may have been dropped.
            let _ = sender.send(window);
        });
        self.capture = Some(Capture { arrival, since: Instant::now(), part, path });
    }

    /// Saves the current scene, with the size that the picture has in the window.
    fn save_scene(&mut self) {
        let path = screenshot::free_name("toml");
        let size = self.picture.size();
        let [width, height] = [size.x.round() as u32, size.y.round() as u32];
        let image = ImageSettings { width, height, ..self.scene.image };
        let mut scene = Scene { image, camera: self.camera([width, height]), ..self.scene.clone() };
        if self.channels.are_several() {
            scene = scene.explicit(self.guest.volume());
            self.channels.note(&mut scene, &self.transfer);
        }
        let result = screenshot::save_scene(&scene, &self.transfer, self.guest.volume(), &path);
        self.saved = saved(&path, &result);
    }

    /// Saves the window's pixels once they have arrived.
    fn save(&mut self, context: &Context) {
        let Some(Capture { arrival, since, part, path }) = &self.capture else { return };
        let result = match arrival.try_recv() {
            Ok(window) => screenshot::image(&window, *part).save(path, PngDepth::Eight).map_err(Failure::from),
            Err(_) if since.elapsed() < CAPTURE_PATIENCE => {
                // Pixels arrive only while frames are drawn.
                context.request_repaint();
                return;
            }
            Err(_) => Err(Failure::Other(format!("{}: the window's pixels did not arrive", path.display()))),
        };
        self.saved = saved(path, &result);
        self.capture = None;
        if self.screenshot.is_some() {
            self.finish(context, result);
        }
    }

    /// Closes the window.
    fn finish(&mut self, context: &Context, result: Result<(), Failure>) {
        self.outcome.borrow_mut().get_or_insert(result);
        context.send_viewport_cmd(ViewportCommand::Close);
    }
}

/// The message about a saved file.
fn saved(path: &Path, result: &Result<(), Failure>) -> String {
    match result {
        Ok(()) => format!("saved {}", path.display()),
        Err(failure) => failure.message().to_owned(),
    }
}

impl eframe::App for App {
    fn ui(&mut self, ui: &mut Ui, _frame: &mut eframe::Frame) {
        let context = ui.ctx().clone();
        self.save(&context);
        Panel::right("settings").default_size(330.0).show(ui, |ui| {
            ScrollArea::vertical().auto_shrink(false).show(ui, |ui| self.panel(ui));
        });
        let drawn = CentralPanel::no_frame().show(ui, |ui| self.picture(ui)).inner;
        if drawn {
            // The statistics shown are the previous frame's.
            context.request_repaint();
        } else if self.outcome.borrow().is_none()
            && self.capture.is_none()
            && let Some(path) = self.screenshot.clone()
        {
            self.capture(&context, path, None);
        }
    }
}
