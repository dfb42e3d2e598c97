//! The native backend: the renderer of SPEC §§2–8 on all cores, without a GPU or a driver.
//!
//! ```text
//! bricks ─ bin ─→ every tile of 32×64 pixels, its sheets front to back in a ring of six:
//!                   cull       bricks, then voxels, that opaque pixels hide
//!                   shade      eight visible voxels at a time, from materials that bricks keep from frame to frame
//!                   splat      the pixels that a voxel reaches, all of its sections at a time
//!                   composite  a sheet, once every voxel that reaches it is drawn
//!        ─ resolve ─→ image
//!        ─ first_hit ─→ the depths at which an opacity was reached, if requested
//! ```
//!
//! Where classification comes after splatting, `after` walks the tiles.
//!
//! Functions that work with vectors are inlined into the function that an instruction set is chosen for, or choose it themselves; else their vectors would pass
//! through memory. A closure that is called several times may be compiled as a function of its own, without the instruction set, and so may `map` of an array of
//! vectors: inlined functions and arrays written out take their place. Builds without optimization are the exception, since there one function with everything
//! inlined would need megabytes of stack.
//!
//! Stages are those of the GPU, by the same names. The same scene gives the same bytes on every machine (SPEC §12): pixels are `f32` by IEEE
//! `+ - × ÷ √`, never contracted, and every pixel's sums are taken in one order, whatever the number of threads and the vectors' width.

mod after;
mod batch;
mod bin;
mod composite;
mod count;
mod cull;
mod cut;
mod first_hit;
mod frame;
mod kernel;
mod layer;
mod material;
mod means;
mod project;
mod queue;
mod ray;
mod reached;
mod resolve;
mod shade;
mod sheets;
mod simd;
mod splat;
mod stream;
mod support;
mod tile;
mod vector;

use std::sync::Arc;

use fearless_simd::Level;
use web_time::Instant;

use crate::error::RenderError;
use crate::error::setting::{Interval, SettingError};
use crate::finished::FinishedScene;
use crate::geometry::view_geometry::ViewGeometry;
use crate::image::Image;
use crate::light::KeptLight;
use crate::part::{self, Content, Part};
use crate::pick::{FirstHits, Pick};
use crate::rendering::{Backend, Rendering};
use crate::scene::Scene;
use crate::settings::camera::Camera;
use crate::settings::splatting::check_first_hit;
use crate::settings::window::{Region, Window};
use crate::stats::{Counts, Stats};
use crate::volume::Volume;
use cut::Surfaces;
use frame::{Drawing, Host};
use layer::Layer;
pub use simd::Simd;
pub use stream::StreamRenderer;

/// A view of a volume, drawn on the CPU.
#[derive(Clone, Debug)]
pub struct CpuRenderer {
    volume: Arc<Volume>,
    finished: FinishedScene,
    layers: Vec<Layer>,
    simd: Simd,
    level: Level,
    first_hit: Option<f64>,
    /// The depths of a host's opaque surfaces.
    surfaces: Option<Arc<[f32]>>,
    /// The last frame's first hits.
    hits: Option<FirstHits>,
    /// Light sheets and what they are made of.
    light: KeptLight,
}

impl CpuRenderer {
    /// Classifies a volume's voxels under a scene's transfer function. The scene's own volume is ignored.
    ///
    /// # Errors
    /// If this backend does not support a setting of the scene, or the volume lacks what the scene needs, such as labels.
    pub fn new(volume: impl Into<Arc<Volume>>, scene: &Scene) -> Result<Self, RenderError> {
        let volume = volume.into();
        let finished = FinishedScene::new(&volume, scene)?;
        check(scene)?;
        let (simd, level) = simd::chosen()?;
        let layers = layer::layers(&volume, &finished)?;
        let (first_hit, surfaces, hits, light) = (None, None, None, KeptLight::default());
        Ok(Self { volume, finished, layers, simd, level, first_hit, surfaces, hits, light })
    }

    /// The volume that is drawn.
    pub(crate) fn volume(&self) -> &Arc<Volume> {
        &self.volume
    }

    /// Draws in light that is made elsewhere.
    pub(crate) fn set_light(&mut self, light: KeptLight) {
        self.light = light;
    }

    /// The settings.
    pub fn scene(&self) -> &Scene {
        &self.finished.scene
    }

    /// Draws by an instruction set other than the best one, or than that which the environment variable `SHEETSPLAT_SIMD` names. No bit of an
    /// image changes.
    ///
    /// # Errors
    /// If the machine or the build lacks it; then nothing changes.
    pub fn set_simd(&mut self, simd: Simd) -> Result<(), SettingError> {
        self.level = simd.checked()?;
        self.simd = simd;
        Ok(())
    }

    /// Changes the scene, whose own volume is ignored. What voxels are drawn from is computed again only if the transfer function, the clip planes,
    /// the kernel or the classification change; coefficients that interpolate the values only with the kernel.
    ///
    /// # Errors
    /// As for [`Self::new`]; then nothing changes.
    pub fn set_scene(&mut self, scene: &Scene) -> Result<(), RenderError> {
        let finished = FinishedScene::new(&self.volume, scene)?;
        check(scene)?;
        layer::update(&mut self.layers, &self.volume, (&self.finished, &finished))?;
        self.finished = finished;
        Ok(())
    }

    /// Changes the camera.
    ///
    /// # Errors
    /// If a setting is not allowed; then nothing changes.
    pub fn set_camera(&mut self, camera: Camera) -> Result<(), SettingError> {
        self.finished.set_camera(camera)
    }

    /// Turns the camera about its `up` by an angle in degrees, right-handed.
    ///
    /// # Errors
    /// If the angle is not finite; then nothing changes.
    pub fn turn(&mut self, degrees: f64) -> Result<(), SettingError> {
        Interval::FINITE.check("degrees", degrees)?;
        self.set_camera(self.scene().camera.turned(degrees))
    }

    /// Asks for the depth at which every pixel's opacity reaches a value, above 0 and at most 1; `None` for none. Front to back only, and
    /// with culling at most [`Splatting::opacity_threshold`](crate::settings::Splatting::opacity_threshold); not for
    /// `minimum`, and whatever the value that of the surface for
    /// `surface`. See [`Self::first_hits`] and [`Self::pick`].
    ///
    /// # Errors
    /// If the value is not in (0, 1]; then nothing changes.
    pub fn set_first_hit(&mut self, opacity: Option<f64>) -> Result<(), SettingError> {
        opacity.map_or(Ok(()), check_first_hit)?;
        self.first_hit = opacity;
        Ok(())
    }

    /// Sets opaque surfaces of a host, or removes them with `None`: for every pixel of the image, row by row, the depth of the surface in world
    /// units along the camera's direction, from the eye, orthographic from the plane through [`Camera::center`]; infinite without a surface. The
    /// volume is visible only in front of them, and voxels behind them are culled as behind opaque ones (§6). A surface within a slab
    /// cuts the slab's sheet in proportion.
    ///
    /// # Errors
    /// If a depth is NaN; then nothing changes. A number of depths other than that of the image's pixels is an error of [`Self::draw`].
    pub fn set_surfaces(&mut self, depths: Option<Vec<f32>>) -> Result<(), SettingError> {
        if let Some(at) = depths.as_ref().and_then(|depths| depths.iter().position(|depth| depth.is_nan())) {
            return Err(SettingError::new(format!("surfaces[{at}]"), f64::NAN, "a number, or infinity"));
        }
        self.surfaces = depths.map(Into::into);
        Ok(())
    }

    /// The surfaces for an image of some width and height.
    fn surfaces_of(&self, size: [u32; 2]) -> Result<Option<Surfaces>, SettingError> {
        let Some(depths) = &self.surfaces else { return Ok(None) };
        let size = size.map(|side| side as usize);
        let pixels = size[0] * size[1];
        if depths.len() != pixels {
            let found = format!("{} depths", depths.len());
            return Err(SettingError::new("surfaces", found, format!("{pixels}, one for every pixel")));
        }
        Ok(Some(Surfaces { depths: Arc::clone(depths), size, unit: self.volume.grid().unit() }))
    }

    /// The last frame's first hits, row by row, if they were asked for: depths in world units along the camera's direction, from the eye,
    /// orthographic from the plane through [`Camera::center`]; infinite where the opacity is not reached. Within a sheet opacity is taken to
    /// grow evenly.
    pub fn first_hits(&self) -> Option<&[f32]> {
        self.hits.as_ref().map(|hits| hits.depths.as_slice())
    }

    /// The point that the last frame shows first at a pixel, counted from the upper left; `None` where the opacity of [`Self::set_first_hit`] is not
    /// reached.
    ///
    /// # Errors
    /// If the frame has no first hits, or the pixel is off the image.
    pub fn pick(&self, pixel: [u32; 2]) -> Result<Option<Pick>, SettingError> {
        FirstHits::pick(self.hits.as_ref(), (&self.volume, &self.finished.transfer), pixel, &self.scene().image)
    }

    /// Draws a frame on the threads of the current rayon pool. Their number never changes a bit of the image.
    ///
    /// # Errors
    /// If the scene exceeds a limit, such as the number of slabs.
    pub fn draw(&mut self) -> Result<Rendering, RenderError> {
        let start = Instant::now();
        self.draw_pixels(Region::whole(self.finished.size()), start)
    }

    /// Draws the pixels of a region as [`Self::draw`] would: the returned image has the region's width and height, and counts are those of its work. It
    /// lets several renderers, each with the volume, share a frame. First hits exist for the region's pixels only.
    ///
    /// # Errors
    /// As for [`Self::draw`], or if the region does not lie in the image.
    pub fn draw_region(&mut self, region: Region) -> Result<Rendering, RenderError> {
        let start = Instant::now();
        region.check(self.finished.size())?;
        self.draw_pixels(region, start)
    }

    fn draw_pixels(&mut self, region: Region, start: Instant) -> Result<Rendering, RenderError> {
        let window = Window { slabs: Window::ALL_SLABS, region };
        let (Drawing { content, counts, first_hits }, view) = self.drawing(window, false)?;
        self.hits = self.first_hit.map(|_| FirstHits { view, region, depths: first_hits });
        let image = Image { width: region.width, height: region.height, pixels: content.colors };
        Ok(Rendering { image, stats: self.statistics(counts, start) })
    }

    /// Draws a part of the image (SPEC §11), and returns it with its statistics. First hits are not noted.
    ///
    /// # Errors
    /// As for [`Self::draw`], if the scene has no parts, a host has set surfaces, or the window does not lie in the image.
    pub fn draw_part(&mut self, window: &Window) -> Result<(Part, Stats), RenderError> {
        let start = Instant::now();
        part::check_sheets(&self.volume, self.scene())?;
        part::check(&self.volume, self.scene(), window)?;
        if self.surfaces.is_some() {
            return Err(SettingError::new("surfaces", "a host's surfaces for a part of an image", "none").into());
        }
        let (Drawing { content, counts, .. }, view) = self.drawing(window.clone(), true)?;
        let part = Part::new((&self.volume.clone().into(), self.scene()), &view, window, content)?;
        Ok((part, self.statistics(counts, start)))
    }

    /// Draws a window to those of its pixels, row by row, that are not closed, and returns them with statistics.
    pub(crate) fn draw_box(
        &mut self,
        window: &Window,
        closed: Option<&[bool]>,
    ) -> Result<(Content, Stats), RenderError> {
        let start = Instant::now();
        self.surfaces = closed.map(|closed| {
            // In front of everything.
            let depth = |&closed: &bool| if closed { f32::NEG_INFINITY } else { f32::INFINITY };
            let (Region { x, y, width, .. }, [across, down]) = (window.region, self.finished.size());
            let mut depths = vec![f32::INFINITY; across as usize * down as usize];
            for (row, closed) in (y..).zip(closed.chunks_exact(width as usize)) {
                let row = &mut depths[(x + row * across) as usize..][..width as usize];
                row.iter_mut().zip(closed).for_each(|(to, closed)| *to = depth(closed));
            }
            depths.into()
        });
        let (Drawing { content, counts, .. }, _) = self.drawing(window.clone(), true)?;
        Ok((content, self.statistics(counts, start)))
    }

    /// The statistics of a frame that began at a time.
    fn statistics(&self, counts: Counts, start: Instant) -> Stats {
        self.light.noted_in(statistics(self.simd, self.finished.size(), counts, start))
    }

    /// Draws a window of the image, as pixels or as a part.
    fn drawing(&mut self, window: Window, is_part: bool) -> Result<(Drawing, ViewGeometry), RenderError> {
        let is_cut = self.surfaces.is_some() || !self.scene().clip.is_empty();
        self.scene().splatting.check_rays(is_cut, self.first_hit)?;
        let (scene, view) = self.finished.framed(&self.volume, self.volume.grid())?;
        let window = if is_part { window.opened(&view.slabs_of(self.volume.grid())) } else { window };
        let first_hit = self.first_hit.filter(|_| !is_part);
        let surfaces = self.surfaces_of(view.size)?;
        let lights = self.light.lights((&self.volume, &self.finished.transfer), &scene, &scene.camera)?;
        let host = Host { window, is_part, first_hit, surfaces, lights };
        Ok((layer::draw(&mut self.layers, &scene, view, host, self.level), view))
    }
}

/// The statistics of a frame of some width and height that began at a time.
fn statistics(simd: Simd, [width, height]: [u32; 2], counts: Counts, start: Instant) -> Stats {
    Stats {
        adapter: "CPU".to_owned(),
        driver: simd.name().to_owned(),
        backend: Backend::Cpu.name().to_owned(),
        api: "none".to_owned(),
        rasterizer: Backend::Cpu.name().to_owned(),
        width,
        height,
        counts,
        frame_ms: milliseconds_since(start),
        ..Stats::default()
    }
}

/// Checks, as far as possible without the volume, that this backend supports all settings of a scene.
///
/// # Errors
/// If it does not support a setting, or the image is too large.
pub fn check(scene: &Scene) -> Result<(), RenderError> {
    support::check(scene)
}

/// Renders a volume that is in memory. The scene's own volume is ignored.
///
/// # Errors
/// If this backend does not support a setting of the scene, or the volume lacks what the scene needs, such as labels.
pub fn render(volume: impl Into<Arc<Volume>>, scene: &Scene) -> Result<Rendering, RenderError> {
    let start = Instant::now();
    let mut renderer = CpuRenderer::new(volume, scene)?;
    let prepare_ms = milliseconds_since(start);
    let mut rendering = renderer.draw()?;
    rendering.stats.prepare_ms = prepare_ms;
    Ok(rendering)
}

fn milliseconds_since(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}
