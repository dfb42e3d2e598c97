//! A view of a volume that any backend can draw.

use std::sync::Arc;

use super::Backend;
use super::boxed::BoxedView;
use super::given_light::GivenLight;
use super::reference::ReferenceView;
#[cfg(feature = "cpu")]
use crate::cpu::{CpuRenderer, StreamRenderer};
use crate::error::RenderError;
use crate::error::setting::{Interval, SettingError};
#[cfg(feature = "gpu")]
use crate::renderer::scene_view::SceneView;
use crate::scene::{OpenVolume, Scene};
use crate::settings::camera::Camera;
use crate::stats::StoreCounts;
use crate::stored_light::{StoredLight, explicit};

/// A view of a volume for any number of frames, made by [`Headless::view`](super::Headless::view). Frames share the sorted lists.
#[derive(Debug)]
pub struct HeadlessView {
    backend: ViewBackend,
    /// What was read of a store for the volume.
    pub(super) reads: Option<StoreCounts>,
    /// Light that is not made for the view, and as its backend takes it.
    stored: Option<(Arc<StoredLight>, GivenLight)>,
}

/// The view of the backend that made it.
#[derive(Debug)]
pub(super) enum ViewBackend {
    #[cfg(feature = "gpu")]
    Gpu(Box<SceneView>),
    #[cfg(feature = "cpu")]
    Cpu(Box<CpuRenderer>),
    /// A volume that is read while the CPU draws it.
    #[cfg(feature = "cpu")]
    Stream(Box<StreamRenderer>),
    Reference(Box<ReferenceView>),
    /// A volume that is read while another backend draws it, box by box.
    Boxed(Box<BoxedView>),
}

impl ViewBackend {
    pub(super) fn backend(&self) -> Backend {
        match self {
            #[cfg(feature = "gpu")]
            Self::Gpu(_) => Backend::Gpu,
            #[cfg(feature = "cpu")]
            Self::Cpu(_) | Self::Stream(_) => Backend::Cpu,
            Self::Reference(_) => Backend::Reference,
            Self::Boxed(view) => view.backend(),
        }
    }
}

impl HeadlessView {
    pub(super) fn new(backend: ViewBackend, reads: Option<StoreCounts>) -> Self {
        Self { backend, reads, stored: None }
    }

    pub(super) fn backend_ref(&self) -> &ViewBackend {
        &self.backend
    }

    pub(super) fn backend_mut(&mut self) -> &mut ViewBackend {
        &mut self.backend
    }

    /// The view in stored light, for which it makes no light sheets. Pictures are the same.
    ///
    /// # Errors
    /// If the light is another scene's, or the backend is the f64 evaluation.
    pub fn with_light(mut self, light: Arc<StoredLight>) -> Result<Self, RenderError> {
        let given = GivenLight::of_stored(&light, (&self.volume(), self.scene()), self.backend.backend())?;
        self.set_light(&given);
        self.stored = Some((light, given));
        Ok(self)
    }

    /// The stored light, for another scene.
    ///
    /// # Errors
    /// If it is not that scene's.
    pub(super) fn light_for(&self, scene: &Scene) -> Result<Option<GivenLight>, RenderError> {
        let given = |(light, _): &(Arc<StoredLight>, _)| {
            GivenLight::of_stored(light, (&self.volume(), scene), self.backend.backend())
        };
        self.stored.as_ref().map(given).transpose()
    }

    /// Draws in the stored light from [`Self::light_for`].
    pub(super) fn renew_light(&mut self, given: GivenLight) {
        self.set_light(&given);
        if let Some((_, stored)) = &mut self.stored {
            *stored = given;
        }
    }

    /// Light that is not made for the view.
    pub(super) fn given_light(&self) -> Option<&GivenLight> {
        self.stored.as_ref().map(|(_, given)| given)
    }

    /// Draws in light that is made elsewhere.
    pub(super) fn set_light(&mut self, light: &GivenLight) {
        match &mut self.backend {
            #[cfg(feature = "gpu")]
            ViewBackend::Gpu(view) => view.light = GivenLight::kept(Some(light)),
            #[cfg(feature = "cpu")]
            ViewBackend::Cpu(view) => view.set_light(GivenLight::kept(Some(light))),
            #[cfg(feature = "cpu")]
            ViewBackend::Stream(view) => view.set_light(GivenLight::kept(Some(light))),
            ViewBackend::Reference(view) => view.set_light(Some(light)),
            ViewBackend::Boxed(view) => view.set_light(light.clone()),
        }
    }

    /// The settings.
    pub fn scene(&self) -> &Scene {
        match &self.backend {
            #[cfg(feature = "gpu")]
            ViewBackend::Gpu(view) => view.scene(),
            #[cfg(feature = "cpu")]
            ViewBackend::Cpu(view) => view.scene(),
            #[cfg(feature = "cpu")]
            ViewBackend::Stream(view) => view.scene(),
            ViewBackend::Reference(view) => view.scene(),
            ViewBackend::Boxed(view) => view.scene(),
        }
    }

    /// The volume that it shows.
    pub fn volume(&self) -> OpenVolume {
        match &self.backend {
            #[cfg(feature = "gpu")]
            ViewBackend::Gpu(view) => view.volume().volume().clone().into(),
            #[cfg(feature = "cpu")]
            ViewBackend::Cpu(view) => view.volume().clone().into(),
            #[cfg(feature = "cpu")]
            ViewBackend::Stream(view) => OpenVolume::Streamed(view.volume().clone()),
            ViewBackend::Reference(view) => view.volume().clone().into(),
            ViewBackend::Boxed(view) => OpenVolume::Streamed(view.volume().clone()),
        }
    }

    /// Changes the camera.
    ///
    /// # Errors
    /// If a setting is not allowed, or stored light comes from elsewhere for this camera; then nothing changes.
    pub fn set_camera(&mut self, camera: Camera) -> Result<(), SettingError> {
        if let Some((light, _)) = &self.stored {
            let turned = Scene { camera, ..self.scene().clone() };
            light.check(&explicit(&self.volume(), &turned)?)?;
        }
        match &mut self.backend {
            #[cfg(feature = "gpu")]
            ViewBackend::Gpu(view) => view.set_camera(camera),
            #[cfg(feature = "cpu")]
            ViewBackend::Cpu(view) => view.set_camera(camera),
            #[cfg(feature = "cpu")]
            ViewBackend::Stream(view) => view.set_camera(camera),
            ViewBackend::Reference(view) => view.set_camera(camera),
            ViewBackend::Boxed(view) => view.set_camera(camera),
        }
    }

    /// Turns the camera about its `up` by an angle in degrees, by the right hand.
    ///
    /// # Errors
    /// If the angle is not finite; then nothing changes.
    pub fn turn(&mut self, degrees: f64) -> Result<(), SettingError> {
        Interval::FINITE.check("degrees", degrees)?;
        self.set_camera(self.scene().camera.turned(degrees))
    }

    /// Records, for [`Headless::pick`](super::Headless::pick), the depth at which each pixel's opacity reaches a value in (0, 1]; `None` records
    /// no depth. It needs front-to-back order and, with culling, at most
    /// [`Splatting::opacity_threshold`](crate::settings::Splatting::opacity_threshold).
    /// `minimum` has no first hits; for
    /// `surface` the depth is the surface's, whatever the value.
    ///
    /// # Errors
    /// If the value is not in (0, 1], or the volume is read while it is drawn; then nothing changes.
    pub fn set_first_hit(&mut self, opacity: Option<f64>) -> Result<(), SettingError> {
        match &mut self.backend {
            #[cfg(feature = "gpu")]
            ViewBackend::Gpu(view) => view.set_first_hit(opacity),
            #[cfg(feature = "cpu")]
            ViewBackend::Cpu(view) => view.set_first_hit(opacity),
            #[cfg(feature = "cpu")]
            ViewBackend::Stream(_) => no_first_hits(opacity),
            ViewBackend::Boxed(..) => no_first_hits(opacity),
            ViewBackend::Reference(view) => view.set_first_hit(opacity),
        }
    }
}

/// Refuses first hits of a volume that is read while it is drawn.
fn no_first_hits(opacity: Option<f64>) -> Result<(), SettingError> {
    opacity.map_or(Ok(()), |_| Err(streamed_first_hits()))
}

/// The error for first hits of a volume that is read while it is drawn.
pub(super) fn streamed_first_hits() -> SettingError {
    SettingError::new("first_hit", "first hits of a volume that is streamed", "none, or more memory")
}
