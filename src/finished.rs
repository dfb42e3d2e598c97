//! A scene that is finished for a volume, once, for every backend.

use crate::error::RenderError;
use crate::error::setting::SettingError;
use crate::geometry::view_geometry::ViewGeometry;
use crate::light::StreamedLight;
use crate::scene::Scene;
use crate::settings::camera::Camera;
use crate::settings::transfer_function::TransferFunction;
use crate::volume::{Channels, Grid, StreamedVolume, Volume, check_grids};

/// A scene that is finished for a volume: its settings are checked, and what it leaves to the volume is chosen, except for the camera's frame, which follows
/// the camera ([`Self::framed`]).
#[derive(Clone, Debug)]
pub(crate) struct FinishedScene {
    /// The settings. Its transfer functions are those that were stated.
    pub(crate) scene: Scene,
    /// The transfer functions of the volume's channels.
    pub(crate) transfer: Channels<TransferFunction>,
}

impl FinishedScene {
    /// A scene for a volume in memory. The scene's own volume is ignored.
    ///
    /// # Errors
    /// If a setting is invalid, or the volume lacks what the scene needs, such as labels.
    pub(crate) fn new(volume: &Volume, scene: &Scene) -> Result<Self, SettingError> {
        scene.check_for(volume)?;
        let scene = scene.settled(volume);
        Ok(Self { transfer: scene.resolve(volume), scene })
    }

    /// A scene for a volume that is read while it is drawn, by whose sample it is finished.
    ///
    /// # Errors
    /// As for [`Self::new`], if channels or labels lie on several grids, or if a setting is not for such volumes.
    pub(crate) fn streamed(volume: &StreamedVolume, scene: &Scene) -> Result<Self, RenderError> {
        let mut finished = Self::new(&volume.sample, scene)?;
        check_grids(&volume.channels)?;
        scene.check_streamed(volume)?;
        StreamedLight::check(volume, scene)?;
        finished.scene.splatting = finished.scene.splatting.streamed();
        Ok(finished)
    }

    /// The image's width and height.
    pub(crate) fn size(&self) -> [u32; 2] {
        [self.scene.image.width, self.scene.image.height]
    }

    /// Changes the camera.
    ///
    /// # Errors
    /// If a setting is invalid; then nothing changes.
    pub(crate) fn set_camera(&mut self, camera: Camera) -> Result<(), SettingError> {
        camera.check()?;
        self.scene.camera = camera;
        Ok(())
    }

    /// The scene with the frame of its camera, and its view of a grid. `volume` is the one by which it was finished.
    ///
    /// # Errors
    /// If the view exceeds a limit, such as the number of slabs.
    pub(crate) fn framed(&self, volume: &Volume, grid: &Grid) -> Result<(Scene, ViewGeometry), RenderError> {
        let scene = self.scene.framed(volume, &self.transfer);
        let view = ViewGeometry::new(grid, &scene.camera, &scene.splatting, self.size())?;
        Ok((scene, view))
    }
}
