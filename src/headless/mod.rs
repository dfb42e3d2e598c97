//! Rendering without a host: images in memory, by the [`Backend`] that is asked for or there is.

mod backend;
#[cfg(feature = "gpu")]
pub mod device;
#[cfg(feature = "gpu")]
mod driver;
mod error;
#[cfg(feature = "gpu")]
mod gpu;
mod options;
#[cfg(feature = "gpu")]
pub mod readback;
mod reference;
mod view;

use std::sync::Arc;
use std::time::Instant;

pub use self::backend::Backend;
pub use self::error::Error;
#[cfg(feature = "gpu")]
pub use self::gpu::GpuHeadless;
pub use self::options::HeadlessOptions;
use self::reference::ReferenceView;
pub use self::view::HeadlessView;
use self::view::ViewBackend;
#[cfg(feature = "cpu")]
use crate::cpu::CpuRenderer;
use crate::device_error::DeviceError;
use crate::error::RenderError;
use crate::image::Image;
use crate::pick::Pick;
use crate::scene::Scene;
#[cfg(any(feature = "gpu", feature = "cpu"))]
use crate::setting_error::SettingError;
use crate::stats::Stats;
use crate::volume::Volume;

/// Renders by any backend. On the GPU it has a device of its own, on the CPU it needs no driver.
#[derive(Debug)]
pub struct Headless {
    drawer: Drawer,
}

#[derive(Debug)]
enum Drawer {
    #[cfg(feature = "gpu")]
    Gpu(Box<GpuHeadless>),
    #[cfg(feature = "cpu")]
    Cpu,
    Reference,
}

/// An image with its statistics.
#[derive(Clone, Debug, PartialEq)]
pub struct Rendering {
    /// The image, over the scene's background.
    pub image: Image,
    /// Its counts and times.
    pub stats: Stats,
}

impl Headless {
    /// Chooses a backend; for the GPU opens a device and compiles the renderer.
    ///
    /// # Errors
    /// If the GPU is asked for and there is no such adapter, it gives no device, or the device cannot run the renderer; or if the backend is
    /// not compiled in.
    pub fn new(options: &HeadlessOptions) -> Result<Self, DeviceError> {
        Self::for_scenes(options, [])
    }

    /// The same for some scenes: [`Backend::Auto`] takes the GPU if one of them names a rasterizer, or asks for what the CPU does not draw.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn for_scenes<'a>(
        options: &HeadlessOptions,
        scenes: impl IntoIterator<Item = &'a Scene>,
    ) -> Result<Self, DeviceError> {
        let drawer = match Backend::resolved(options, scenes) {
            #[cfg(feature = "gpu")]
            Backend::Gpu => Drawer::Gpu(Box::new(GpuHeadless::new(options)?)),
            #[cfg(feature = "cpu")]
            Backend::Cpu => Drawer::Cpu,
            Backend::Reference => Drawer::Reference,
            backend => return Err(DeviceError::MissingBackend { backend: backend.name() }),
        };
        Ok(Self { drawer })
    }

    /// What draws; never [`Backend::Auto`].
    pub fn backend(&self) -> Backend {
        match self.drawer {
            #[cfg(feature = "gpu")]
            Drawer::Gpu(_) => Backend::Gpu,
            #[cfg(feature = "cpu")]
            Drawer::Cpu => Backend::Cpu,
            Drawer::Reference => Backend::Reference,
        }
    }

    /// Loads the scene's volume and renders it.
    ///
    /// # Errors
    /// If the volume cannot be loaded, the scene asks for what the backend cannot do, or the device fails.
    pub fn render(&self, scene: &Scene) -> Result<Rendering, Error> {
        // An invalid scene is refused before its volume is loaded.
        scene.check().map_err(RenderError::from)?;
        let start = Instant::now();
        let volume = scene.load_volume()?;
        let load_ms = milliseconds_since(start);
        let mut rendering = self.render_volume(volume, scene)?;
        rendering.stats.load_ms = load_ms;
        Ok(rendering)
    }

    /// Renders a volume that is already in memory. The scene's own volume is ignored.
    ///
    /// # Errors
    /// If the scene asks for what the backend cannot do, or the device fails.
    pub fn render_volume(&self, volume: impl Into<Arc<Volume>>, scene: &Scene) -> Result<Rendering, RenderError> {
        let start = Instant::now();
        let mut view = self.view(volume, scene)?;
        let classify_ms = milliseconds_since(start);
        let mut rendering = self.draw(&mut view)?;
        rendering.stats.prepare_ms += classify_ms;
        Ok(rendering)
    }

    /// A view of a volume as a scene sets it up, for any number of frames. The scene's own volume is not looked at.
    ///
    /// # Errors
    /// If the scene asks for what the backend cannot do, the volume is larger than the device's textures, or the device fails.
    pub fn view(&self, volume: impl Into<Arc<Volume>>, scene: &Scene) -> Result<HeadlessView, RenderError> {
        Ok(HeadlessView::new(match &self.drawer {
            #[cfg(feature = "gpu")]
            Drawer::Gpu(gpu) => ViewBackend::Gpu(Box::new(gpu.view(volume, scene)?)),
            #[cfg(feature = "cpu")]
            Drawer::Cpu => ViewBackend::Cpu(Box::new(CpuRenderer::new(volume, scene)?)),
            Drawer::Reference => ViewBackend::Reference(Box::new(ReferenceView::new(volume, scene)?)),
        }))
    }

    /// Draws one frame of a view.
    ///
    /// # Errors
    /// If the scene asks for what the backend cannot do, the device fails, or the view is another backend's.
    pub fn draw(&self, view: &mut HeadlessView) -> Result<Rendering, RenderError> {
        match (&self.drawer, view.backend_mut()) {
            #[cfg(feature = "gpu")]
            (Drawer::Gpu(gpu), ViewBackend::Gpu(view)) => gpu.draw(view),
            #[cfg(feature = "cpu")]
            (Drawer::Cpu, ViewBackend::Cpu(view)) => view.draw(),
            (Drawer::Reference, ViewBackend::Reference(view)) => view.draw(),
            #[cfg(any(feature = "gpu", feature = "cpu"))]
            (_, other) => Err(self.refuse(other.backend()).into()),
        }
    }

    /// What the last drawn frame of a view shows first at a pixel, counted from the upper left; `None` where the opacity of
    /// [`HeadlessView::set_first_hit`] is not reached.
    ///
    /// # Errors
    /// If the frame has no first hits, the pixel is off the image, the device fails, or the view is another backend's.
    pub fn pick(&self, view: &HeadlessView, pixel: [u32; 2]) -> Result<Option<Pick>, RenderError> {
        match (&self.drawer, view.backend_ref()) {
            #[cfg(feature = "gpu")]
            (Drawer::Gpu(gpu), ViewBackend::Gpu(view)) => gpu.pick(view, pixel),
            #[cfg(feature = "cpu")]
            (Drawer::Cpu, ViewBackend::Cpu(view)) => Ok(view.pick(pixel)?),
            (Drawer::Reference, ViewBackend::Reference(view)) => Ok(view.pick(pixel)?),
            #[cfg(any(feature = "gpu", feature = "cpu"))]
            (_, other) => Err(self.refuse(other.backend()).into()),
        }
    }

    #[cfg(any(feature = "gpu", feature = "cpu"))]
    fn refuse(&self, found: Backend) -> SettingError {
        SettingError::new(
            "view",
            format!("one of the {found} backend"),
            format!("one of the {} backend", self.backend()),
        )
    }
}

fn milliseconds_since(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1e3
}
