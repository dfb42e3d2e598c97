//! The native backend: the renderer of SPEC §§2–8 on all cores, without a GPU or a driver.
//!
//! ```text
//! bricks ─ bin ─→ every tile of 32×32 pixels, its sheets front to back in a ring of eight:
//!                   cull       what opaque pixels hide, brick by brick, then voxel by voxel
//!                   shade      eight visible voxels at a time
//!                   splat      all sections of a voxel, eight pixels at a time
//!                   composite  one sheet, once every voxel before it is drawn
//!        ─ resolve ─→ image
//! ```
//!
//! Stages are those of the GPU, by the same names. The same scene gives the same bytes on every machine (SPEC §12): pixels are `f32` by IEEE
//! `+ - × ÷ √`, never contracted, and every pixel's sums are taken in one order, whatever the number of threads and the vectors' width.

mod bin;
mod composite;
mod count;
mod cull;
mod cut;
mod frame;
mod kernel;
mod project;
mod resolve;
mod shade;
mod sheets;
mod splat;
mod support;
mod tile;
mod vector;

use std::sync::Arc;
use std::time::Instant;

use fearless_simd::Level;

use crate::error::RenderError;
use crate::headless::Rendering;
use crate::lists::brick::BrickList;
use crate::lists::classify::classify;
use crate::scene::{ImageSettings, Scene};
use crate::setting_error::{Interval, SettingError};
use crate::settings::camera::Camera;
use crate::settings::transfer_function::TransferFunction;
use crate::stats::Stats;
use crate::volume::Volume;
use frame::Frame;

/// A view of a volume, drawn on the CPU.
#[derive(Clone, Debug)]
pub struct CpuRenderer {
    volume: Arc<Volume>,
    scene: Scene,
    transfer: TransferFunction,
    bricks: BrickList,
    level: Level,
}

impl CpuRenderer {
    /// Classifies a volume's voxels under a scene's transfer function. The scene's own volume is not looked at.
    ///
    /// # Errors
    /// If the scene asks for what this backend does not draw, or for what the volume does not have.
    pub fn new(volume: impl Into<Arc<Volume>>, scene: &Scene) -> Result<Self, RenderError> {
        let volume = volume.into();
        scene.check()?;
        scene.transfer.check_volume(&volume)?;
        support::check(scene)?;
        let transfer = scene.transfer.resolve(&volume);
        let clipped = scene.clip.voxels(volume.grid(), scene.splatting.radius);
        let bricks = BrickList::new(volume.grid(), &classify(&volume, &transfer, &clipped));
        Ok(Self { volume, scene: scene.clone(), transfer, bricks, level: Level::new() })
    }

    /// The settings.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Changes the camera.
    ///
    /// # Errors
    /// If a setting is not allowed; then nothing changes.
    pub fn set_camera(&mut self, camera: Camera) -> Result<(), SettingError> {
        camera.check()?;
        self.scene.camera = camera;
        Ok(())
    }

    /// Turns the camera about its `up` by an angle in degrees, right-handed.
    ///
    /// # Errors
    /// If the angle is not finite; then nothing changes.
    pub fn turn(&mut self, degrees: f64) -> Result<(), SettingError> {
        Interval::FINITE.check("degrees", degrees)?;
        self.set_camera(self.scene.camera.turned(degrees))
    }

    /// Draws a frame on the threads of the current rayon pool. Their number never changes a bit of the image.
    ///
    /// # Errors
    /// If the scene asks for more than can be computed.
    pub fn draw(&self) -> Result<Rendering, RenderError> {
        let start = Instant::now();
        let scene = self.scene.framed(&self.volume, &self.transfer);
        let frame = Frame::new(&self.volume, &self.transfer, self.bricks.bricks(), &scene)?;
        let (image, counts) = frame.draw(self.level);
        let ImageSettings { width, height, .. } = self.scene.image;
        let stats = Stats {
            adapter: "CPU".to_owned(),
            driver: format!("{:?}", self.level).split('(').next().unwrap_or_default().to_lowercase(),
            backend: "cpu".to_owned(),
            rasterizer: "cpu".to_owned(),
            width,
            height,
            counts,
            frame_ms: milliseconds_since(start),
            ..Stats::default()
        };
        Ok(Rendering { image, stats })
    }
}

/// Renders a volume that is in memory. The scene's own volume is not looked at.
///
/// # Errors
/// If the scene asks for what this backend does not draw, or for what the volume does not have.
pub fn render(volume: impl Into<Arc<Volume>>, scene: &Scene) -> Result<Rendering, RenderError> {
    let start = Instant::now();
    let renderer = CpuRenderer::new(volume, scene)?;
    let prepare_ms = milliseconds_since(start);
    let mut rendering = renderer.draw()?;
    rendering.stats.prepare_ms = prepare_ms;
    Ok(rendering)
}

fn milliseconds_since(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}
