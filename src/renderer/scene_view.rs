//! A view: what is shown and how, and what the next frame can reuse. Every setter states its cost (§5.1).

use std::sync::{Arc, OnceLock};

use wgpu::{CommandEncoder, Device, Texture};

use crate::error::setting::{Interval, SettingError};
use crate::error::{RenderError, check_device};
use crate::finished::FinishedScene;
use crate::geometry::surfaces::Surfaces;
use crate::gpu::classified_volume::{ClassifiedVolume, Touched};
use crate::gpu::counts::PendingCounts;
use crate::gpu::fault::scoped;
use crate::gpu::gpu_volume::GpuVolume;
use crate::gpu::hiding::Hiding;
use crate::gpu::light_texture::LightTexture;
use crate::light::{KeptLight, Lights};
pub use crate::rasterizer::Prepared;
use crate::renderer::pick::PendingPick;
use crate::renderer::prepared_frame::{Drawing, PreparedFrame, PreparedLayer};
use crate::scene::{ImageSettings, Scene};
use crate::settings::camera::Camera;
use crate::settings::clip::Clip;
use crate::settings::framing::Extent;
use crate::settings::light::Light;
use crate::settings::shading::Shading;
use crate::settings::splatting::{Splatting, check_first_hit};
use crate::settings::transfer_function::{Parts, TransferFunction};
use crate::settings::window::Window;
use crate::volume::Channels;

/// A view of a volume: camera, image, transfer function, shading and splatting settings, and the last frame's buffers. Setters take effect
/// with the next [`Renderer::prepare`](crate::renderer::Renderer::prepare). A setter that refuses a value names the field, as reading a
/// scene file does, and changes nothing.
#[derive(Debug)]
pub struct SceneView {
    pub(crate) volume: ClassifiedVolume,
    pub(crate) scene: Scene,
    pub(crate) hiding: Option<Hiding>,
    pub(crate) first_hit: Option<f64>,
    /// What is drawn, if that is a part of the image (SPEC §11).
    pub(crate) window: Option<Window>,
    pub(crate) frame: Option<PreparedFrame>,
    /// Light sheets and what they are made of (SPEC §14), and their copy on the GPU.
    pub(crate) light: KeptLight,
    pub(crate) light_texture: Option<LightTexture>,
    /// The box that the camera frames by default, once it was needed.
    pub(crate) extent: OnceLock<Option<Extent>>,
}

impl SceneView {
    /// Uploads the bricks of the voxels that take part under a scene's transfer function to the volume's device. The scene's own volume is
    /// ignored.
    ///
    /// # Errors
    /// If a setting is invalid ([`Scene::check`]); if the scene has tables or a preset for labels and the volume has none; if the volume is on
    /// another device; or if the device fails.
    pub fn new(device: &Device, volume: &GpuVolume, scene: &Scene) -> Result<Self, RenderError> {
        check_device(device, volume.device(), "the volume")?;
        let FinishedScene { scene, transfer } = FinishedScene::new(volume.volume(), scene)?;
        let clipped = scene.clip.voxels(volume.volume().grid(), scene.splatting.radius);
        let splatting = &scene.splatting;
        let volume = scoped(device, || ClassifiedVolume::new(device, volume, transfer, clipped, splatting))?;
        Ok(Self {
            volume,
            scene,
            hiding: None,
            first_hit: None,
            window: None,
            frame: None,
            light: KeptLight::default(),
            light_texture: None,
            extent: OnceLock::new(),
        })
    }

    /// The settings. Its `volume` and `transfer` are those with which the view was made.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The camera of the next frame: the scene's, with the direction that the volume chooses where it is open, and if it fits an object ([`Fit::Object`](crate::settings::Fit::Object)), with its open
    /// values chosen for its direction and the image's size. The object's box ([`Scene::extent`]) is found once, with the first frame that
    /// needs it, so that the picture does not move when the transfer function changes. For a camera that turns at constant distance, use
    /// [`Scene::explicit_all_around`].
    pub fn camera(&self) -> Camera {
        let (camera, image) = (self.scene.camera_for(self.volume.volume()), &self.scene.image);
        if !camera.needs_object() {
            return camera;
        }
        let extent = self.extent.get_or_init(|| self.scene.extent(self.volume.volume(), self.volume.transfer()));
        extent.map_or(camera, |extent| extent.fit(&camera, [image.width, image.height]))
    }

    /// The light sheets of the next frame, if its scene has any. Those that are still valid are not made again.
    pub(crate) fn lights(&mut self) -> Result<Option<Arc<Lights>>, RenderError> {
        let camera = self.camera();
        self.light.lights((self.volume.volume(), self.volume.transfer()), &self.scene, &camera)
    }

    /// The volume, classified by the current transfer function.
    pub fn volume(&self) -> &ClassifiedVolume {
        &self.volume
    }

    /// Changes colours, opacities, gradient opacity, iso-ranges or the labels' tables. Voxels whose opacity stays above 0 are only shaded again;
    /// see [`ClassifiedVolume::set_transfer_function`].
    ///
    /// # Errors
    /// If a setting is invalid; then nothing changes.
    pub fn set_transfer_function(
        &mut self,
        transfer: impl Into<Channels<TransferFunction>>,
    ) -> Result<Touched, SettingError> {
        let transfer = transfer.into();
        TransferFunction::check_channels(&transfer)?;
        Ok(self.volume.set_transfer_function(transfer))
    }

    /// Changes only the iso-ranges; touches only voxels that enter or leave.
    ///
    /// # Errors
    /// If the list of iso-ranges is empty, or one is not finite or reversed; then nothing changes.
    pub fn set_iso_ranges(&mut self, iso_ranges: Option<Vec<[f64; 2]>>) -> Result<Touched, SettingError> {
        Parts { iso_ranges: iso_ranges.as_deref(), ..Parts::default() }.check("transfer")?;
        Ok(self.volume.set_iso_ranges(iso_ranges))
    }

    /// Shows or hides the voxels of a label of a segmented volume; touches only those.
    pub fn set_label_visible(&mut self, label: u16, visible: bool) -> Touched {
        self.volume.set_label_visible(label, visible)
    }

    /// Changes the camera: bricks are sorted into buckets again.
    ///
    /// # Errors
    /// If a setting is invalid; then nothing changes.
    pub fn set_camera(&mut self, camera: Camera) -> Result<(), SettingError> {
        camera.check()?;
        self.scene.camera = camera;
        Ok(())
    }

    /// Moves the light; voxels are shaded again. A direction points to the light and may have any length except 0.
    ///
    /// # Errors
    /// If the direction is 0 or not finite; then nothing changes.
    pub fn set_light(&mut self, light: Light) -> Result<(), SettingError> {
        self.set_shading(Shading { light, ..self.scene.shading })
    }

    /// Changes the material; voxels are shaded again. With [`Shading::occlusion`] or [`Shading::shadow`] the next frame makes light sheets on the CPU, and so
    /// does every frame before which their light, the camera that it follows, the transfer function, cuts or the kernel change.
    ///
    /// # Errors
    /// If a setting is invalid; then nothing changes.
    pub fn set_shading(&mut self, shading: Shading) -> Result<(), SettingError> {
        shading.check()?;
        self.scene.shading = shading;
        Ok(())
    }

    /// Changes the splatting settings. Another slab width or kernel sorts bricks into buckets again, and another kernel also makes another
    /// footprint table. If planes clip the volume, another radius lets voxels enter or leave.
    ///
    /// # Errors
    /// If a setting is invalid; then nothing changes.
    pub fn set_splatting(&mut self, splatting: Splatting) -> Result<(), SettingError> {
        splatting.check()?;
        let Scene { clip, splatting: old, .. } = &self.scene;
        if !clip.is_empty() && splatting.radius != old.radius {
            self.volume.set_clip(clip.voxels(self.volume.grid(), splatting.radius));
        }
        self.scene.splatting = splatting;
        self.scene.splatting.classification = self.scene.classification(self.volume.volume());
        self.volume.set_splatting(&self.scene.splatting);
        Ok(())
    }

    /// Changes what is cut away. Touches only voxels that enter or leave.
    ///
    /// # Errors
    /// If there are too many planes, or a plane or the box is invalid; then nothing changes.
    pub fn set_clip(&mut self, clip: Clip) -> Result<Touched, SettingError> {
        clip.check()?;
        let clipped = clip.voxels(self.volume.grid(), self.scene.splatting.radius);
        self.scene.clip = clip;
        Ok(self.volume.set_clip(clipped))
    }

    /// Sets opaque surfaces of the host, or removes them with `None`. The volume is visible only in front of them, and voxels behind them are
    /// culled as behind opaque ones (§6). A surface within a slab cuts the slab's sheet in proportion, as clip planes do
    /// ([`Clip`](crate::settings::Clip)). The texture must have its content when the frame is submitted.
    ///
    /// # Errors
    /// If [`Surfaces::check`] refuses them; then nothing changes.
    pub fn set_surfaces(&mut self, surfaces: Option<Surfaces>) -> Result<(), SettingError> {
        surfaces.as_ref().map_or(Ok(()), Surfaces::check)?;
        self.hiding = surfaces.map(Hiding::Surfaces);
        Ok(())
    }

    /// Requests the depth at which every pixel's opacity reaches a value above 0 and at most 1, or nothing with `None`. Front to back only, and
    /// with culling at most [`Splatting::opacity_threshold`]. Not for `minimum`;
    /// for `surface` it is the surface's depth for any value. See
    /// [`Self::first_hits`] and [`Self::pick`].
    ///
    /// # Errors
    /// If the value is not in (0, 1]; then nothing changes.
    pub fn set_first_hit(&mut self, opacity: Option<f64>) -> Result<(), SettingError> {
        opacity.map_or(Ok(()), check_first_hit)?;
        self.first_hit = opacity;
        Ok(())
    }

    /// The depths of first hits, an `R32Float` texture of the image's size (to sample or copy), if they were requested and a frame was
    /// prepared; recording the frame writes them. They are in world units along the camera's direction, from the eye or, orthographic, from
    /// the plane through [`Camera::center`], and infinite where the opacity is not reached. Within a sheet opacity grows linearly.
    pub fn first_hits(&self) -> Option<&Texture> {
        self.frame.as_ref()?.first_hits.as_ref().map(|hits| &hits.texture)
    }

    /// Records a copy of the first hit at a pixel, counted from the upper left: after [`Renderer::record`](crate::renderer::Renderer::record),
    /// in the same encoder or a later one. `None` if first hits were not requested or the pixel lies outside the image. Allocates a few bytes.
    pub fn pick(&self, device: &Device, encoder: &mut CommandEncoder, pixel: [u32; 2]) -> Option<PendingPick> {
        let frame = self.frame.as_ref()?;
        let hits = frame.first_hits.as_ref()?;
        let is_inside = pixel[0] < frame.view.size[0] && pixel[1] < frame.view.size[1];
        is_inside.then(|| {
            let of = (self.volume.volume(), &**self.volume.transfer());
            PendingPick::record(device, encoder, &hits.texture, pixel, &frame.view, of)
        })
    }

    /// Changes the image's size, which allocates all buffers of that size again, or its background, which costs nothing.
    ///
    /// # Errors
    /// If a setting is invalid; then nothing changes.
    pub fn set_image(&mut self, image: ImageSettings) -> Result<(), SettingError> {
        image.check()?;
        self.scene.image = image;
        Ok(())
    }

    /// Turns the camera right-handed about its `up` by an angle in degrees.
    ///
    /// # Errors
    /// If the angle is not finite; then nothing changes.
    pub fn turn(&mut self, degrees: f64) -> Result<(), SettingError> {
        Interval::FINITE.check("degrees", degrees)?;
        self.set_camera(self.scene.camera.turned(degrees))
    }

    /// The prepared frame's rasterizer, `"quads"` or `"tiles"`.
    pub fn rasterizer(&self) -> Option<&'static str> {
        self.frame.as_ref()?.first_drawing().map(Drawing::rasterizer)
    }

    /// Why the prepared frame is drawn by quads although neither the scene nor the renderer requires them: a feature that the device lacks, or a
    /// limit of the tile rasterizer that the frame exceeds. `None` if the frame is drawn by tiles, or if the settings exclude tiles. A renderer
    /// logs the first such reason.
    pub fn fallback(&self) -> Option<&RenderError> {
        self.frame.as_ref()?.fallback.as_ref()
    }

    /// Bytes of GPU memory that the view uses, including its volume's, which other views may share; [`GpuVolume::gpu_bytes`] is the volume's
    /// share. All of it is freed when view and volume are dropped and the submitted work is done. A buffer that is larger than a frame needs
    /// is kept if it is at most 4 times as large as a new view's; textures always fit.
    pub fn gpu_bytes(&self) -> u64 {
        self.frame.as_ref().map_or(self.volume.gpu_bytes(), PreparedFrame::gpu_bytes)
    }

    /// Requests the counts of the frame that was last recorded and submitted, once per frame; `None` without such a frame. They arrive when the
    /// device is polled after the frame is done; nothing waits.
    pub fn counts(&mut self) -> Option<PendingCounts> {
        let (volume, frame) = (&self.volume, self.frame.as_mut()?);
        let staging = frame.staging.take()?;
        let PreparedFrame { layers, totals, view, .. } = frame;
        let of_layer = |of: &PreparedLayer| volume.totals(&of.layer, view, &of.drawing.group_slabs());
        let totals = totals.get_or_insert_with(|| layers.iter().map(of_layer).collect()).clone();
        Some(PendingCounts::new(totals, staging))
    }
}
