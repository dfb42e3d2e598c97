//! Light that a view does not make itself: that of all channels for one of them, and that of a whole volume for a box of it (SPEC §14).

use std::sync::Arc;
#[cfg(feature = "gpu")]
use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::error::RenderError;
use crate::error::setting::SettingError;
#[cfg(feature = "gpu")]
use crate::gpu::light_texture::LightTexture;
use crate::light::{KeptLight, Lights, StreamedLight};
use crate::reference;
use crate::rendering::Backend;
use crate::scene::{OpenVolume, Scene};
use crate::stats::Stats;
use crate::stored_light::StoredLight;
use crate::volume::StreamedVolume;

/// Light as a backend takes it.
#[derive(Clone, Debug)]
pub(super) struct GivenLight {
    form: Form,
    /// A GPU's copy, which boxes use one after the other.
    #[cfg(feature = "gpu")]
    texture: Arc<Mutex<Option<LightTexture>>>,
}

#[derive(Clone, Debug)]
enum Form {
    #[cfg_attr(
        not(any(feature = "cpu", feature = "gpu")),
        expect(dead_code, reason = "the f64 evaluation has another form")
    )]
    Sheets(Arc<Lights>),
    /// For the f64 evaluation.
    Exact(Arc<reference::Lights>),
}

impl GivenLight {
    fn new(form: Form) -> Self {
        Self {
            form,
            #[cfg(feature = "gpu")]
            texture: Arc::default(),
        }
    }

    /// The light of all channels of a volume, for a scene with everything stated, with which a backend draws each of them by itself; `None` without occlusion,
    /// shadow or shading. The second value adds this light to statistics.
    ///
    /// # Errors
    /// If a store cannot be read, or light needs more than can be computed.
    pub(super) fn of_channels(
        (volume, scene): (&OpenVolume, &Scene),
        backend: Backend,
    ) -> Result<Option<(Self, Noted)>, RenderError> {
        if scene.shading.light_key().is_none() {
            return Ok(None);
        }
        let transfer = scene.resolve(volume.sample());
        match volume {
            OpenVolume::Whole(volume) if backend == Backend::Reference => {
                let lights = reference::Lights::new(volume, &transfer, scene)?;
                Ok(Some((Self::new(Form::Exact(Arc::new(lights))), Noted::Nothing)))
            }
            OpenVolume::Whole(volume) => {
                let mut light = KeptLight::default();
                let lights = light.lights((volume, &transfer), scene, &scene.camera)?;
                Ok(lights.map(|lights| (Self::new(Form::Sheets(lights)), Noted::Whole(Box::new(light)))))
            }
            OpenVolume::Streamed(volume) => {
                let light = StreamedLight::default();
                let given = Self::of_streamed(&light, (volume, scene), backend)?;
                Ok(given.map(|given| (given, Noted::Streamed(light, volume.clone()))))
            }
        }
    }

    /// The light of a volume that is streamed, for a scene with everything stated; `None` without occlusion, shadow or shading.
    ///
    /// # Errors
    /// If the store cannot be read, or light needs more than can be computed.
    pub(super) fn of_streamed(
        light: &StreamedLight,
        (volume, scene): (&StreamedVolume, &Scene),
        backend: Backend,
    ) -> Result<Option<Self>, RenderError> {
        if scene.shading.light_key().is_none() {
            return Ok(None);
        }
        let transfer = scene.resolve(&volume.sample);
        if backend == Backend::Reference {
            let lights = reference::Lights::new(&*light.voxels(volume)?, &transfer, scene)?;
            return Ok(Some(Self::new(Form::Exact(Arc::new(lights)))));
        }
        let lights = light.lights((volume, &transfer), scene)?;
        Ok(lights.map(|lights| Self::new(Form::Sheets(lights))))
    }

    /// The light of a file, for a scene of a volume.
    ///
    /// # Errors
    /// If the file's light is another scene's, or the backend is the f64 evaluation, which makes its own.
    pub(super) fn of_stored(
        stored: &StoredLight,
        (volume, scene): (&OpenVolume, &Scene),
        backend: Backend,
    ) -> Result<Self, RenderError> {
        if backend == Backend::Reference {
            let allowed = "backend \"gpu\" or \"cpu\", or light of its own";
            return Err(SettingError::new("light", "stored light for backend \"reference\"", allowed).into());
        }
        Ok(Self::new(Form::Sheets(stored.lights(volume, scene)?)))
    }

    /// The light as a native backend or a GPU keeps it.
    #[cfg(any(feature = "cpu", feature = "gpu"))]
    pub(super) fn kept(given: Option<&Self>) -> KeptLight {
        match given.map(|given| &given.form) {
            Some(Form::Sheets(lights)) => KeptLight::given(Arc::clone(lights)),
            _ => KeptLight::default(),
        }
    }

    /// The light as the f64 evaluation takes it.
    pub(super) fn exact(&self) -> Option<&Arc<reference::Lights>> {
        match &self.form {
            Form::Exact(lights) => Some(lights),
            Form::Sheets(_) => None,
        }
    }

    /// A GPU's copy of it, if there is one.
    #[cfg(feature = "gpu")]
    pub(super) fn texture(&self) -> MutexGuard<'_, Option<LightTexture>> {
        self.texture.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The light that a frame's statistics are to state, by where it comes from.
pub(super) enum Noted {
    Nothing,
    Whole(Box<KeptLight>),
    Streamed(StreamedLight, StreamedVolume),
}

impl Noted {
    /// A frame's statistics with those of its light.
    pub(super) fn noted_in(&self, stats: Stats) -> Stats {
        match self {
            Self::Nothing => stats,
            Self::Whole(light) => light.noted_in(stats),
            Self::Streamed(light, volume) => light.noted_in(volume, stats),
        }
    }
}
