//! Rendering without a host, to images in memory. A [`Backend`] draws them: the GPU, the processor or the f64 evaluation.

mod backend;
mod blank;
mod boxed;
#[cfg(feature = "gpu")]
mod content;
#[cfg(feature = "gpu")]
pub mod device;
#[cfg(feature = "gpu")]
mod driver;
mod error;
mod given_light;
#[cfg(feature = "gpu")]
mod gpu;
mod joined;
mod options;
#[cfg(feature = "gpu")]
pub mod readback;
mod reference;
mod timed;
mod view;

use self::boxed::BoxedView;
pub use self::error::Error;
use self::given_light::GivenLight;
#[cfg(feature = "gpu")]
pub use self::gpu::GpuHeadless;
pub use self::options::HeadlessOptions;
use self::reference::ReferenceView;
use self::timed::{load_and_render, opened, view_and_draw};
pub use self::view::HeadlessView;
use self::view::ViewBackend;
#[cfg(feature = "cpu")]
use crate::cpu::{CpuRenderer, StreamRenderer};
use crate::error::RenderError;
use crate::error::device::DeviceError;
use crate::error::setting::SettingError;
use crate::part::{self, Content, Part};
use crate::pick::Pick;
pub use crate::rendering::{Backend, Rendering};
use crate::scene::{OpenVolume, Scene};
use crate::settings::splatting::Splatting;
use crate::settings::window::Window;
use crate::stats::Stats;
use crate::volume::{StreamedVolume, Volume};

/// Renders with one backend. On the GPU it opens its own device; on the CPU it needs no driver.
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

impl Headless {
    /// Chooses a backend; for the GPU opens a device and compiles the renderer.
    ///
    /// # Errors
    /// If the backend is not compiled in. With the GPU: if there is no such adapter, it opens no device, or the device cannot run the renderer.
    pub fn new(options: &HeadlessOptions) -> Result<Self, DeviceError> {
        Self::for_scenes(options, [])
    }

    /// As [`Self::new`], for scenes that are known: [`Backend::Auto`] takes the GPU if one of them names a rasterizer, or uses a setting that
    /// the CPU backend does not draw.
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

    /// The backend that draws; never [`Backend::Auto`].
    pub fn backend(&self) -> Backend {
        match self.drawer {
            #[cfg(feature = "gpu")]
            Drawer::Gpu(_) => Backend::Gpu,
            #[cfg(feature = "cpu")]
            Drawer::Cpu => Backend::Cpu,
            Drawer::Reference => Backend::Reference,
        }
    }

    /// Opens the scene's volume and renders it: a volume that does not fit into memory is read while it is drawn, where that can be
    /// ([`Scene::open_volume`]).
    ///
    /// # Errors
    /// If the volume cannot be read, the backend cannot draw one of the scene's settings, or the device fails.
    pub fn render(&self, scene: &Scene) -> Result<Rendering, Error> {
        load_and_render(scene, Scene::open_volume, |volume| self.render_volume(volume, scene))
    }

    /// Renders a volume that is already open. The scene's own volume is ignored.
    ///
    /// # Errors
    /// If the backend cannot draw the volume or one of the scene's settings, or the device fails.
    pub fn render_volume(&self, volume: impl Into<OpenVolume>, scene: &Scene) -> Result<Rendering, RenderError> {
        view_and_draw(|| self.view(volume, scene), |view| self.draw(view))
    }

    /// Loads the scene's volume and renders a part of its image (SPEC §11).
    ///
    /// # Errors
    /// If the volume cannot be loaded, the backend cannot draw one of the scene's settings, the scene has no parts, the window does not lie in
    /// the image, or the device fails.
    #[doc(alias = "Scene::part")]
    pub fn render_part(&self, scene: &Scene, window: &Window) -> Result<Part, Error> {
        let volume = opened(scene, Scene::open_volume)?;
        let mut view = self.view(volume, scene)?;
        Ok(self.draw_part(&mut view, window)?.0)
    }

    /// Draws a part of a view's image (SPEC §11), and returns it with its statistics.
    ///
    /// # Errors
    /// As for [`Self::draw`], if the scene has no parts, or the window does not lie in the image.
    pub fn draw_part(&self, view: &mut HeadlessView, window: &Window) -> Result<(Part, Stats), RenderError> {
        let reads = view.reads;
        let volume = view.volume();
        if part::adds_up(volume.sample(), view.scene()) {
            let backend = view.backend_ref().backend();
            if backend != self.backend() {
                return Err(self.refuse(backend).into());
            }
            return joined::draw_part((&volume, view.scene()), (window, view.given_light()), self);
        }
        let (part, stats) = match (&self.drawer, view.backend_mut()) {
            #[cfg(feature = "gpu")]
            (Drawer::Gpu(gpu), ViewBackend::Gpu(view)) => gpu.draw_part(view, window),
            #[cfg(feature = "cpu")]
            (_, ViewBackend::Cpu(view)) if self.draws_by_cpu() => view.draw_part(window),
            #[cfg(feature = "cpu")]
            (_, ViewBackend::Stream(view)) if self.draws_by_cpu() => view.draw_part(window),
            (Drawer::Reference, ViewBackend::Reference(view)) => view.draw_part(window),
            (_, ViewBackend::Boxed(view)) if view.backend() == self.backend() => view.draw_part(window, self),
            (_, other) => Err(self.refuse(other.backend()).into()),
        }?;
        Ok((part, Stats { store: stats.store.or(reads), ..stats }))
    }

    /// A view of a volume with a scene's settings, for any number of frames. The scene's own volume is ignored.
    ///
    /// # Errors
    /// If the backend cannot draw one of the scene's settings, the volume is larger than the device's textures, or the device fails.
    pub fn view(&self, volume: impl Into<OpenVolume>, scene: &Scene) -> Result<HeadlessView, RenderError> {
        let volume = match volume.into() {
            OpenVolume::Whole(volume) => volume,
            OpenVolume::Streamed(volume) => return self.stream(volume, scene),
        };
        let reads = volume.reads();
        let backend = match &self.drawer {
            #[cfg(feature = "gpu")]
            Drawer::Gpu(gpu) => ViewBackend::Gpu(Box::new(gpu.view(volume, scene)?)),
            #[cfg(feature = "cpu")]
            Drawer::Cpu => ViewBackend::Cpu(Box::new(CpuRenderer::new(volume, scene)?)),
            Drawer::Reference => ViewBackend::Reference(Box::new(ReferenceView::new(volume, scene)?)),
        };
        Ok(HeadlessView::new(backend, reads))
    }

    /// A view of a volume that is read while it is drawn: on the CPU chunk by chunk, if it has one channel without labels, otherwise box by box.
    fn stream(&self, volume: StreamedVolume, scene: &Scene) -> Result<HeadlessView, RenderError> {
        #[cfg(feature = "cpu")]
        if self.draws_by_cpu() && volume.only_values().is_some() {
            return Ok(HeadlessView::new(ViewBackend::Stream(Box::new(StreamRenderer::new(volume, scene)?)), None));
        }
        let view = BoxedView::new(volume, scene, self.backend())?;
        Ok(HeadlessView::new(ViewBackend::Boxed(Box::new(view)), None))
    }

    /// Draws a window of a box of voxels of a volume that is streamed, in the light of the whole volume if there is any. Of pixels that are closed, row by row, no more need be drawn.
    #[cfg_attr(
        not(any(feature = "cpu", feature = "gpu")),
        expect(unused_variables, reason = "the f64 evaluation draws what is hidden, too")
    )]
    fn draw_box(
        &self,
        volume: Volume,
        scene: &Scene,
        (window, closed): (&Window, Option<&[bool]>),
        light: Option<&GivenLight>,
    ) -> Result<(Content, Stats), RenderError> {
        match &self.drawer {
            #[cfg(feature = "gpu")]
            Drawer::Gpu(gpu) => gpu.draw_box(volume, scene, (window, closed), light),
            #[cfg(feature = "cpu")]
            Drawer::Cpu => {
                let mut renderer = CpuRenderer::new(volume, scene)?;
                renderer.set_light(GivenLight::kept(light));
                renderer.draw_box(window, closed)
            }
            Drawer::Reference => {
                let mut view = ReferenceView::new(volume, scene)?;
                view.set_light(light);
                let (content, _, stats) = view.draw_content(window)?;
                Ok((content, stats))
            }
        }
    }

    /// Changes a view's scene, whose own volume is ignored. Only what depends on the change is computed again: on the CPU as
    /// [`CpuRenderer::set_scene`](crate::cpu::CpuRenderer::set_scene) says; on the GPU everything but the uploaded volume, unless only the camera changes.
    ///
    /// # Errors
    /// As for [`Self::view`], if another backend made the view, or the view has stored light that is another scene's; then nothing changes.
    pub fn set_scene(&self, view: &mut HeadlessView, scene: &Scene) -> Result<(), RenderError> {
        let light = view.light_for(scene)?;
        self.set_unlit_scene(view, scene)?;
        if let Some(light) = light {
            view.renew_light(light);
        }
        Ok(())
    }

    fn set_unlit_scene(&self, view: &mut HeadlessView, scene: &Scene) -> Result<(), RenderError> {
        match (&self.drawer, view.backend_mut()) {
            #[cfg(feature = "gpu")]
            (Drawer::Gpu(gpu), ViewBackend::Gpu(view)) => {
                let turned = Scene { camera: scene.camera, ..view.scene().clone() };
                if turned == *scene {
                    return Ok(view.set_camera(scene.camera)?);
                }
                let mut new = crate::SceneView::new(gpu.device(), view.volume().gpu_volume(), scene)?;
                new.first_hit = view.first_hit;
                **view = new;
                Ok(())
            }
            #[cfg(feature = "cpu")]
            (_, ViewBackend::Cpu(view)) if self.draws_by_cpu() => view.set_scene(scene),
            #[cfg(feature = "cpu")]
            (_, ViewBackend::Stream(view)) if self.draws_by_cpu() => view.set_scene(scene),
            (Drawer::Reference, ViewBackend::Reference(view)) => view.set_scene(scene),
            (_, ViewBackend::Boxed(view)) if view.backend() == self.backend() => view.set_scene(scene),
            (_, other) => Err(self.refuse(other.backend()).into()),
        }
    }

    /// Draws one frame of a view. A warning in the log says if it shows nothing, and the likely reason.
    ///
    /// # Errors
    /// If the backend cannot draw one of the scene's settings, the device fails, or another backend made the view.
    pub fn draw(&self, view: &mut HeadlessView) -> Result<Rendering, RenderError> {
        let reads = view.reads;
        let rendering = match (&self.drawer, view.backend_mut()) {
            #[cfg(feature = "gpu")]
            (Drawer::Gpu(gpu), ViewBackend::Gpu(view)) => gpu.draw(view),
            #[cfg(feature = "cpu")]
            (_, ViewBackend::Cpu(view)) if self.draws_by_cpu() => view.draw(),
            #[cfg(feature = "cpu")]
            (_, ViewBackend::Stream(view)) if self.draws_by_cpu() => view.draw(),
            (Drawer::Reference, ViewBackend::Reference(view)) => view.draw(),
            (_, ViewBackend::Boxed(view)) if view.backend() == self.backend() => view.draw(self),
            (_, other) => Err(self.refuse(other.backend()).into()),
        }?;
        if blank::is_blank(&rendering.image, view.scene().image.background) {
            log::warn!("{}", blank::reason(&rendering.stats, view.volume().sample()));
        }
        if let Some((key, why)) = view.scene().shading.idle_light() {
            log::warn!("{key} has no effect: {why}");
        }
        if self.backend() == Backend::Gpu && view.scene().loses_normals_on_gpu() {
            let Splatting { falloff, .. } = view.scene().splatting;
            log::warn!(
                "splatting.falloff = {falloff}: with shading.gradient = \"kernel\" a GPU loses some normals, the backend cpu none"
            );
        }
        let store = rendering.stats.store.or(reads);
        Ok(Rendering { stats: Stats { store, ..rendering.stats }, ..rendering })
    }

    /// The first voxel that the last drawn frame of a view shows at a pixel, counted from the upper left; `None` where the pixel does not reach
    /// the opacity of [`HeadlessView::set_first_hit`].
    ///
    /// # Errors
    /// If the frame has no first hits, the pixel lies outside the image, the device fails, or another backend made the view.
    pub fn pick(&self, view: &HeadlessView, pixel: [u32; 2]) -> Result<Option<Pick>, RenderError> {
        match (&self.drawer, view.backend_ref()) {
            #[cfg(feature = "gpu")]
            (Drawer::Gpu(gpu), ViewBackend::Gpu(view)) => gpu.pick(view, pixel),
            #[cfg(feature = "cpu")]
            (_, ViewBackend::Cpu(view)) if self.draws_by_cpu() => Ok(view.pick(pixel)?),
            #[cfg(feature = "cpu")]
            (_, ViewBackend::Stream(_)) if self.draws_by_cpu() => Err(view::streamed_first_hits().into()),
            (Drawer::Reference, ViewBackend::Reference(view)) => Ok(view.pick(pixel)?),
            (_, ViewBackend::Boxed(view)) if view.backend() == self.backend() => {
                Err(view::streamed_first_hits().into())
            }
            (_, other) => Err(self.refuse(other.backend()).into()),
        }
    }

    /// The GPU, if that draws.
    #[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
    fn gpu(&self) -> Option<&GpuHeadless> {
        match &self.drawer {
            Drawer::Gpu(gpu) => Some(gpu),
            #[cfg(feature = "cpu")]
            Drawer::Cpu => None,
            Drawer::Reference => None,
        }
    }

    /// Whether views of the CPU are drawn.
    #[cfg(feature = "cpu")]
    fn draws_by_cpu(&self) -> bool {
        matches!(self.drawer, Drawer::Cpu)
    }

    fn refuse(&self, found: Backend) -> SettingError {
        SettingError::new(
            "view",
            format!("one of the {found} backend"),
            format!("one of the {} backend", self.backend()),
        )
    }
}
