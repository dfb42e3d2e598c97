//! Words about a picture's appearance where the scene leaves it to the volume.

use sheetsplat::appearance::{Eye, Preset};
use sheetsplat::scene::Scene;
use sheetsplat::volume::Volume;

use crate::progress::tell;

/// Tells which preset was chosen for a volume's file and why, and that the file does not say which way is up.
pub(crate) fn tell_choices(is_wanted: bool, name: &str, scene: &Scene, volume: &Volume) {
    // Builtin volumes have no file that could say more.
    if volume.encoding().is_none() {
        return;
    }
    let fitted = scene.fitted(volume);
    if let Some(preset) = fitted.transfer.preset.filter(|_| scene.transfer.preset.is_none()) {
        let chosen = Preset::ALL.iter().find(|(_, of)| *of == preset).map_or("none", |(name, _)| name);
        let other = if preset == Preset::None { "" } else { " (--preset none: the surface that stands out)" };
        tell(is_wanted, &format!("{name}: preset {chosen}, as {}{other}", reason(preset)));
    }
    if let Some(eye @ Eye::Unknown) = fitted.eye(volume) {
        tell(is_wanted, &format!("{name}: seen {eye}"));
    }
}

/// Why a preset fits ([`Preset::suggested`]).
fn reason(preset: Preset) -> &'static str {
    match preset {
        Preset::Photo => "voxels have colours of their own",
        Preset::Labels => "the values are labels",
        Preset::Confocal => "there are several channels, or lengths in µm or nm",
        Preset::CtBone => "the values are Hounsfield units, with bone",
        Preset::CtSkin => "the values are Hounsfield units, without bone",
        Preset::MrHead => "size and values are those of a head in MR",
        _ => "no other fits: the surface that stands out is shown",
    }
}
