//! Words about a picture's appearance where the scene leaves it to the volume.

use sheetsplat::appearance::{Eye, Preset, categories};
use sheetsplat::scene::Scene;
use sheetsplat::volume::Volume;

use crate::progress::tell;

/// Tells which preset was chosen for a volume's file and why, and that the file does not say which way is up.
pub(crate) fn tell_choices(is_wanted: bool, name: &str, scene: &Scene, volume: &Volume) {
    // Builtin volumes have no file that could say more.
    if volume.encoding().is_none() {
        return;
    }
    if volume.is_known_label_map() && volume.colors().is_none() && !categories::is_label_map(volume) {
        let found = "the file says that the values are labels, but some are no whole numbers from 0 to 65535";
        tell(is_wanted, &format!("{name}: {found}: drawn as amounts"));
    }
    let fitted = scene.fitted(volume);
    if let Some(preset) =
        fitted.channels.first().transfer.preset.filter(|_| scene.channels.first().transfer.preset.is_none())
    {
        let chosen = Preset::ALL.iter().find(|(_, of)| *of == preset).map_or("none", |(name, _)| name);
        let other = if preset == Preset::None { "" } else { " (--preset none: the surface that stands out)" };
        tell(is_wanted, &format!("{name}: preset {chosen}, as {}{other}", reason(preset, volume)));
    }
    if let Some(eye @ Eye::Unknown) = fitted.eye(volume) {
        tell(is_wanted, &format!("{name}: seen {eye}"));
    }
}

/// Why a preset fits ([`Preset::suggested`]).
fn reason(preset: Preset, volume: &Volume) -> &'static str {
    match preset {
        Preset::Photo => "voxels have colours of their own",
        Preset::Labels if volume.is_known_label_map() => "the file says that the values are labels",
        Preset::Labels => "the values look like labels",
        Preset::Confocal => "there are several channels, or lengths in µm or nm",
        Preset::CtBone => "the values are Hounsfield units, with bone",
        Preset::CtSkin => "the values are Hounsfield units, without bone",
        Preset::MrHead => "size and values are those of a head in MR",
        _ => "no other fits: the surface that stands out is shown",
    }
}
