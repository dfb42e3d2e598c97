//! Views by the f64 evaluation.

use std::sync::Arc;

use web_time::Instant;

use super::given_light::GivenLight;
use super::timed::milliseconds_since;
use super::{Backend, Rendering};
use crate::error::RenderError;
use crate::error::setting::SettingError;
use crate::finished::FinishedScene;
use crate::geometry::view_geometry::ViewGeometry;
use crate::part::{self, Content, Part};
use crate::pick::{FirstHits, Pick};
use crate::reference::{self, Host, Lights};
use crate::scene::Scene;
use crate::settings::camera::Camera;
use crate::settings::splatting::check_first_hit;
use crate::settings::window::{Region, Window};
use crate::stats::Stats;
use crate::volume::Volume;

/// A view of a volume, drawn in f64 with nothing culled.
#[derive(Clone, Debug)]
pub(super) struct ReferenceView {
    volume: Arc<Volume>,
    finished: FinishedScene,
    first_hit: Option<f64>,
    hits: Option<FirstHits>,
    /// Light that is made elsewhere.
    light: Option<Arc<Lights>>,
}

impl ReferenceView {
    /// # Errors
    /// If a setting of the scene is invalid, or the volume lacks what the transfer function needs.
    pub(super) fn new(volume: impl Into<Arc<Volume>>, scene: &Scene) -> Result<Self, RenderError> {
        let volume = volume.into();
        let finished = FinishedScene::new(&volume, scene)?;
        Ok(Self { volume, finished, first_hit: None, hits: None, light: None })
    }

    pub(super) fn volume(&self) -> &Arc<Volume> {
        &self.volume
    }

    pub(super) fn scene(&self) -> &Scene {
        &self.finished.scene
    }

    /// Draws parts in light that is made elsewhere.
    pub(super) fn set_light(&mut self, light: Option<&GivenLight>) {
        self.light = light.and_then(GivenLight::exact).map(|lights| Arc::new(lights.on(self.volume.grid())));
    }

    /// Changes the scene; then the last frame's first hits are gone.
    pub(super) fn set_scene(&mut self, scene: &Scene) -> Result<(), RenderError> {
        *self = Self { first_hit: self.first_hit, ..Self::new(self.volume.clone(), scene)? };
        Ok(())
    }

    pub(super) fn set_camera(&mut self, camera: Camera) -> Result<(), SettingError> {
        self.finished.set_camera(camera)
    }

    pub(super) fn set_first_hit(&mut self, opacity: Option<f64>) -> Result<(), SettingError> {
        opacity.map_or(Ok(()), check_first_hit)?;
        self.first_hit = opacity;
        Ok(())
    }

    pub(super) fn pick(&self, pixel: [u32; 2]) -> Result<Option<Pick>, SettingError> {
        FirstHits::pick(self.hits.as_ref(), (&self.volume, &self.finished.transfer), pixel, &self.scene().image)
    }

    /// Draws a part of the image.
    pub(super) fn draw_part(&self, window: &Window) -> Result<(Part, Stats), RenderError> {
        part::check(&self.volume, self.scene(), window)?;
        let (content, view, stats) = self.draw_content(window)?;
        Ok((Part::new((&self.volume.clone().into(), self.scene()), &view, window, content)?, stats))
    }

    /// Draws the pixels of a part, and returns them with their view and statistics.
    pub(super) fn draw_content(&self, window: &Window) -> Result<(Content, ViewGeometry, Stats), RenderError> {
        let start = Instant::now();
        let Self { volume, finished: FinishedScene { scene, transfer }, .. } = self;
        let (_, view) = self.finished.framed(volume, volume.grid())?;
        let opened = window.opened(&view.slabs_of(volume.grid()));
        let content = reference::part(volume, transfer, (scene, self.light.as_ref()), &opened)?;
        Ok((content, view, self.stats(start)?))
    }

    pub(super) fn draw(&mut self) -> Result<Rendering, RenderError> {
        let start = Instant::now();
        let Self { volume, finished, first_hit, .. } = self;
        let FinishedScene { scene, transfer } = &*finished;
        if first_hit.is_some() {
            scene.splatting.check_rays(!scene.clip.is_empty(), *first_hit)?;
        }
        let host = Host { first_hit: *first_hit, ..Host::default() };
        let drawn = reference::render_for(host, volume, transfer, scene, None)?;
        let image = drawn.image;
        if first_hit.is_some() {
            let (_, view) = finished.framed(volume, volume.grid())?;
            let depths = drawn.first_hits.iter().map(|depth| (depth * volume.grid().unit()) as f32).collect();
            self.hits = Some(FirstHits { view, region: Region::whole(view.size), depths });
        } else {
            self.hits = None;
        }
        let stats = self.stats(start)?;
        Ok(Rendering { image, stats })
    }

    /// The statistics of a frame that began at a time.
    fn stats(&self, start: Instant) -> Result<Stats, RenderError> {
        Ok(Stats {
            adapter: "CPU".to_owned(),
            driver: "f64".to_owned(),
            backend: Backend::Reference.name().to_owned(),
            api: "none".to_owned(),
            rasterizer: Backend::Reference.name().to_owned(),
            width: self.scene().image.width,
            height: self.scene().image.height,
            frame_ms: milliseconds_since(start),
            counts: reference::count(&self.volume, &self.finished.transfer, self.scene())?,
            ..Stats::default()
        })
    }
}
