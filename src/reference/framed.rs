//! Scenes whose settings are checked and whose cameras are framed, for every way to evaluate them.

use crate::error::setting::SettingError;
use crate::scene::Scene;
use crate::settings::transfer_function::TransferFunction;
use crate::volume::Volume;

/// A scene with its camera's frame. The settings are checked first, because framing needs valid ones.
pub(super) fn framed(volume: &Volume, transfer: &[TransferFunction], scene: &Scene) -> Result<Scene, SettingError> {
    scene.check()?;
    TransferFunction::check_channels(transfer)?;
    Ok(scene.framed(volume, transfer))
}
