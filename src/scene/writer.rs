//! Writes scenes as TOML, the inverse of `tables`.

use std::fmt::Write;
use std::path::{Component, Path, PathBuf};

use toml::Value;

use super::keys::{LabelTable, Root, VolumeTable};
use super::{Channel, Fitting, Scene, SceneError, TransferSettings, VolumeSource, slots};
use crate::appearance::Preset;
use crate::settings::camera::Camera;
use crate::settings::camera_table::CameraTable;
use crate::settings::clip::Clip;
use crate::settings::economies::TABLE;
use crate::settings::key::{Key, Keyed, Slot};
use crate::settings::shading::Shading;
use crate::volume::{RawLayout, builtin_name, is_address};

/// The maximum number of control points written on one line.
const ON_ONE_LINE: usize = 3;

impl Scene {
    /// The scene as the text of a scene file in `folder`, which must exist if the scene names files: their paths are written relative to it
    /// if they are relative. [`Self::open`] reads it back as the same scene. What the scene leaves to the volume is omitted;
    /// [`Self::explicit`] fills it in. A volume in memory has no name, so that [`Self::parse_for`] reads such a scene back. A scene file that states any
    /// of its camera or its transfer function looks in the default direction unless it states another, and so does such a scene that is read back.
    ///
    /// # Errors
    /// If the path of the volume or of its labels is not UTF-8, or the offset in a raw file exceeds TOML's integers.
    pub fn to_toml(&self, folder: &Path) -> Result<String, SceneError> {
        self.to_toml_naming(&|path, key| within(folder, path, key))
    }

    /// [`Self::to_toml`] with other names of files, each given by its path and the key that it is written for.
    pub(crate) fn to_toml_naming(&self, name_of_file: &NameOfFile<'_>) -> Result<String, SceneError> {
        let Self { channels, camera, image, clip, shading, splatting, fitting } = self;
        let Channel { name, visible, transfer, .. } = channels.first();
        let mut text = Text::default();
        text.keys(&Root { preset: transfer.preset }, &[], |_, _| true);
        // One channel without a name has no need of a table.
        let is_one = channels.len() == 1 && name.is_none() && *visible;
        for (number, channel) in channels.iter().enumerate() {
            text.channel = (!is_one).then_some(number);
            write_channel(&mut text, name_of_file, channel)?;
        }
        text.channel = None;
        // Without these tables the camera is this one again (SPEC §2).
        if !(is_one && !transfer.states_more() && *camera == Camera::of_object()) {
            let camera = CameraTable::from(*camera);
            text.table("camera");
            let first = ["projection", "height", "fov_y", "distance", "near"];
            text.keys(&camera, &first, |name, _| name != "fov_y" || camera.is_perspective);
        }
        text.table("image");
        text.keys(image, &[], |_, _| true);
        // Settings that the preset that fits is to choose are not written.
        let light_step = fitting.light_step && transfer.preset.is_some();
        let fitting = if self.is_fitting() { *fitting } else { Fitting { light_step, ..Fitting::NONE } };
        let unstated = transfer.preset.map_or_else(Clip::default, Preset::clip).shade_faces;
        let leaves_faces = clip.shade_faces == unstated && fitting.is_open <= fitting.shade_faces;
        // Scenes that do not state it stay as they were, and so do the fingerprints of their parts.
        if !(clip.is_empty() && leaves_faces) {
            text.table("clip");
            text.keys(clip, &[], |name, _| name != "shade_faces" || !leaves_faces);
        }
        write_shading(&mut text, shading, transfer.preset, fitting);
        text.table("splatting");
        text.keys(splatting, &[], |name, is_default| !(is_default && fitting.leaves(name)));
        text.table(TABLE);
        text.keys(&splatting.experimental, &[], |_, _| true);
        Ok(text.text)
    }
}

/// The name that is written for a file's path, given the key.
type NameOfFile<'a> = dyn Fn(&Path, &str) -> Result<String, SceneError> + 'a;

/// Lines of TOML.
#[derive(Default)]
struct Text {
    text: String,
    /// The channel that is being written, if it has a table.
    channel: Option<usize>,
}

fn write_channel(text: &mut Text, name_of_file: &NameOfFile<'_>, channel: &Channel) -> Result<(), SceneError> {
    if text.channel.is_some() {
        let _ = writeln!(text.text, "\n[[channel]]");
        text.keys(channel, &[], |_, is_default| !is_default);
    }
    let key = |name: &str| match text.channel {
        Some(number) => format!("channel[{number}].volume.{name}"),
        None => format!("volume.{name}"),
    };
    let within = |name: &str, path: &Path| name_of_file(path, &key(name));
    let mut table = VolumeTable { channel: channel.clone(), ..VolumeTable::default() };
    match &channel.volume {
        VolumeSource::File(path) => table.path = Some(within("path", path)?),
        VolumeSource::Raw(path, layout) => {
            let RawLayout { dims, sample_type, big_endian, offset } = *layout;
            if i64::try_from(offset).is_err() {
                let allowed = format!("at most {}, the largest integer in TOML", i64::MAX);
                return Err(invalid(&key("offset"), offset.to_string(), &allowed));
            }
            table.path = Some(within("path", path)?);
            (table.dims, table.sample_type) = (Some(dims), Some(sample_type));
            (table.big_endian, table.offset) = (Some(big_endian), Some(offset));
        }
        VolumeSource::Builtin(name) => table.builtin = Some(name.clone()),
        VolumeSource::Memory => {}
    }
    table.labels = channel.labels.as_ref().map(|path| within("labels", path)).transpose()?;
    let of_labels = channel.label_table.as_ref().map(|path| match builtin_name(path) {
        Some(name) => Ok(format!("builtin:{name}")),
        None => within("label_table", path),
    });
    table.label_table = of_labels.transpose()?;
    // A later channel without a volume is one of the first one's.
    if channel.volume != VolumeSource::Memory || text.channel.is_none_or(|number| number == 0) {
        text.table("volume");
    }
    text.keys(&table, &["path", "dims", "type", "endian", "offset"], |_, _| true);
    write_transfer(text, &channel.transfer);
    Ok(())
}

impl Text {
    fn table(&mut self, name: &str) {
        let gap = if self.text.is_empty() { "" } else { "\n" };
        let parent = if self.channel.is_some() { "channel." } else { "" };
        let _ = writeln!(self.text, "{gap}[{parent}{name}]");
    }

    /// Writes the keys that have values, some of them first. A key and whether it has its default decide if it is kept.
    fn keys<T: Keyed>(&mut self, settings: &T, first: &[&str], is_kept: impl Fn(&str, bool) -> bool) {
        let (mut settings, mut default) = (settings.clone(), T::default());
        let of_first = first.iter().filter_map(|name| T::KEYS.iter().find(|key| key.name == *name));
        let others = T::KEYS.iter().filter(|key| !first.contains(&key.name));
        for Key { name, slot, .. } in of_first.chain(others) {
            let value = slots::value(&slot(&mut settings));
            let is_default = value == slots::value(&slot(&mut default));
            if let Some(value) = value.filter(|_| is_kept(name, is_default)) {
                let is_ramp = matches!(slot(&mut settings), Slot::Colors(_) | Slot::Shares(..));
                self.line(name, is_ramp, &value);
            }
        }
    }

    fn line(&mut self, key: &str, is_ramp: bool, value: &Value) {
        let _ = match value {
            Value::Array(points) if is_ramp && points.len() > ON_ONE_LINE => {
                let points: String = points.iter().map(|point| format!("    {point},\n")).collect();
                writeln!(self.text, "{key} = [\n{points}]")
            }
            _ => writeln!(self.text, "{key} = {value}"),
        };
    }
}

fn write_transfer(text: &mut Text, transfer: &TransferSettings) {
    // An empty table would state that the scene has its own transfer function (SPEC §9).
    if transfer.states_more() {
        text.table("transfer");
    }
    text.keys(transfer, &["colormap"], |_, _| true);
    for (&label, tables) in &transfer.labels {
        let parent = if text.channel.is_some() { "channel." } else { "" };
        let _ = writeln!(text.text, "\n[[{parent}transfer.label]]");
        let table = LabelTable { label: Some(label), tables: tables.clone() };
        text.keys(&table, &[], |name, is_default| !(name == "gradient" && is_default));
    }
}

fn write_shading(text: &mut Text, shading: &Shading, preset: Option<Preset>, fitting: Fitting) {
    let has_light = preset.map_or_else(Shading::default, Preset::shading).light_key().is_some();
    let is_open = fitting.is_open;
    text.table("shading");
    let first = ["enabled", "ambient", "diffuse", "specular", "shininess"];
    text.keys(shading, &first, |name, is_default| match name {
        _ if !is_default => true,
        // Scenes without light sheets stay as they were, and so do the fingerprints of their parts. Where a preset has or may choose light, its keys are stated.
        "occlusion" | "shadow" => is_open && !fitting.leaves(name) || has_light,
        "light_step" => (is_open || has_light) && !fitting.leaves(name),
        "occlusion_spread" | "shadow_spread" => false,
        _ => !fitting.leaves(name),
    });
}

/// A file's path: unchanged if absolute or an address, or else relative to a folder.
fn within(folder: &Path, path: &Path, key: &str) -> Result<String, SceneError> {
    let found = if path.is_absolute() || is_address(path) { path.to_owned() } else { relative(folder, path) };
    found.to_str().map(str::to_owned).ok_or_else(|| invalid(key, found.display().to_string(), "a path in UTF-8"))
}

/// The error for a value that cannot be written.
pub(crate) fn invalid(key: &str, found: String, allowed: &str) -> SceneError {
    SceneError::Invalid { origin: "scene".to_owned(), key: key.to_owned(), found, allowed: allowed.into() }
}

/// The path from a folder to a file; the file's absolute path if either does not exist or they share no root.
fn relative(folder: &Path, path: &Path) -> PathBuf {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    // Links are resolved first, because `..` behind a link leads elsewhere.
    let (Ok(from), Ok(to)) = (folder.canonicalize(), path.canonicalize()) else {
        return std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    };
    let shared = from.components().zip(to.components()).take_while(|(a, b)| a == b).count();
    if shared == 0 {
        return to;
    }
    let up = from.components().skip(shared).map(|_| Component::ParentDir);
    up.chain(to.components().skip(shared)).collect()
}
