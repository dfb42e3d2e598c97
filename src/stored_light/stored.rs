//! Light sheets, and the scenes that they belong to.

use std::sync::Arc;

use crate::error::RenderError;
use crate::error::setting::SettingError;
use crate::light::{KeptLight, LightSheets, LightSource, LightStack, Lights, StreamedLight, sources};
use crate::part::fingerprint;
use crate::scene::{OpenVolume, Scene, SceneError};

/// The names of both stacks.
pub(super) const NAMES: [&str; 2] = ["occlusion", "shadow"];

/// The light sheets of a scene (SPEC §14), made by [`Self::of`] or read by `StoredLight::open`. A view that draws
/// [with them](crate::headless::HeadlessView::with_light) makes none.
#[derive(Clone, Debug)]
pub struct StoredLight {
    /// A name for errors: the file, or "light".
    pub(super) name: String,
    /// The fingerprint of what keeps light off.
    pub(super) matter: String,
    /// The stacks of occlusion and of shadow.
    pub(super) stacks: [Option<(LightSource, Arc<LightSheets>)>; 2],
}

impl StoredLight {
    /// The light sheets of a scene.
    ///
    /// # Errors
    /// If the scene has neither `shading.occlusion` nor `shading.shadow`, nothing in it keeps light off, the volume cannot be read, or sheets would take more
    /// than 4 GiB.
    pub fn of(volume: &OpenVolume, scene: &Scene) -> Result<Self, RenderError> {
        let explicit = explicit(volume, scene)?;
        let transfer = explicit.resolve(volume.sample());
        let lights = match volume {
            OpenVolume::Whole(volume) => {
                KeptLight::default().lights((volume, &transfer), &explicit, &explicit.camera)?
            }
            OpenVolume::Streamed(volume) => {
                StreamedLight::check(volume, &explicit)?;
                StreamedLight::default().lights((volume, &transfer), &explicit)?
            }
        };
        let lights = lights.ok_or_else(|| unlit("shading"))?;
        let sheets = [&lights.occlusion, &lights.shadow].map(|stack| stack.as_ref().map(|of| Arc::clone(&of.sheets)));
        if sheets.iter().flatten().all(|sheets| sheets.planes() == 0) {
            return Err(
                SettingError::new("transfer", "no voxel that keeps light off", "a scene that shows something").into()
            );
        }
        let [mut occlusion, mut shadow] = sources(&explicit, &explicit.camera);
        let [of_occlusion, of_shadow] = sheets;
        let stacks = [occlusion.take().zip(of_occlusion), shadow.take().zip(of_shadow)];
        Ok(Self { name: "light".to_owned(), matter: matter(volume, &explicit)?, stacks })
    }

    /// Checks, without looking at a volume, a transfer function or cuts, that these are the sheets of a scene in which everything is stated
    /// ([`Scene::explicit`]).
    ///
    /// # Errors
    /// If the scene has no light by sheets, or its light comes from elsewhere, spreads otherwise, or has other steps or kernels.
    pub fn check(&self, scene: &Scene) -> Result<(), SettingError> {
        let wanted = sources(scene, &scene.camera);
        if wanted.iter().all(Option::is_none) {
            return Err(unlit(&self.name));
        }
        for ((name, wanted), stored) in NAMES.iter().zip(wanted).zip(&self.stacks) {
            let Some(wanted) = wanted else { continue };
            let key = |field: &str| format!("{}: {name}{field}", self.name);
            let Some((found, _)) = stored else {
                return Err(SettingError::new(key(""), "none", "light sheets of it, as the scene has them"));
            };
            let fields = found.fields().into_iter().zip(wanted.fields());
            if let Some(((field, found), (_, wanted))) = fields.into_iter().find(|(found, wanted)| found != wanted) {
                return Err(SettingError::new(key(&format!(".{field}")), found, format!("{wanted}, as in the scene")));
            }
        }
        Ok(())
    }

    /// The light of a scene of a volume.
    ///
    /// # Errors
    /// If these are not its sheets.
    pub(crate) fn lights(&self, volume: &OpenVolume, scene: &Scene) -> Result<Arc<Lights>, RenderError> {
        let explicit = explicit(volume, scene)?;
        self.check(&explicit)?;
        let wanted = matter(volume, &explicit)?;
        if wanted != self.matter {
            let key = format!("{}: matter", self.name);
            let allowed = format!("{wanted}, of the scene's volume, transfer function and cuts");
            return Err(SettingError::new(key, self.matter.clone(), allowed).into());
        }
        let stack = |number: usize, amount: f64| {
            let (_, sheets) = self.stacks[number].as_ref()?;
            let rows = sheets.rows(volume.grid());
            (amount > 0.0).then(|| LightStack { amount: amount as f32, sheets: Arc::clone(sheets), rows })
        };
        let shading = &explicit.shading;
        Ok(Arc::new(Lights { occlusion: stack(0, shading.occlusion), shadow: stack(1, shading.shadow) }))
    }
}

/// A scene of a volume with everything stated.
///
/// # Errors
/// If a setting is invalid.
pub(crate) fn explicit(volume: &OpenVolume, scene: &Scene) -> Result<Scene, SettingError> {
    scene.check()?;
    Ok(scene.explicit(volume.sample()))
}

/// The fingerprint of what keeps light off in a scene with everything stated.
fn matter(volume: &OpenVolume, explicit: &Scene) -> Result<String, RenderError> {
    let refused = |error: SceneError| SettingError::new("scene", error.to_string(), "another scene");
    Ok(fingerprint::of_matter(volume, explicit).map_err(refused)?)
}

fn unlit(key: &str) -> SettingError {
    let allowed = "shading.occlusion or shading.shadow above 0, and shading.enabled = true";
    SettingError::new(key.to_owned(), "a scene without light sheets", allowed)
}
