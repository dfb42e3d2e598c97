//! Writes scenes as TOML, the inverse of `tables`.

use std::fmt::Write;
use std::path::{Component, Path, PathBuf};

use glam::DVec3;
use toml::Value;

use super::names::{
    BOXES, CLASSIFICATIONS, COMPOSITINGS, FITS, FORMS, GRADIENTS, INTERPOLATIONS, LABEL_GRADIENTS, METHODS, ORDERS,
    PROFILES, RASTERIZERS, name_of,
};
use super::{Channel, Fitting, ImageSettings, Scene, SceneError, TransferSettings, VolumeSource};
use crate::appearance::{Colormap, Preset};
use crate::settings::camera::{Camera, Projection};
use crate::settings::clip::Clip;
use crate::settings::economies::Economies;
use crate::settings::shading::{Gradient, Light, Shading};
use crate::settings::splatting::{Classification, Splatting};
use crate::settings::transfer_function::Ramp;
use crate::volume::{RawLayout, is_address};

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
        if let Some(preset) = transfer.preset {
            text.line("preset", name_of(&Preset::ALL, preset));
        }
        // One channel without a name has no need of a table.
        let is_one = channels.len() == 1 && name.is_none() && *visible;
        for (number, channel) in channels.iter().enumerate() {
            text.channel = (!is_one).then_some(number);
            write_channel(&mut text, name_of_file, channel)?;
        }
        text.channel = None;
        // Without these tables the camera is this one again (SPEC §2).
        if !(is_one && !transfer.states_more() && *camera == Camera::of_object()) {
            write_camera(&mut text, camera);
        }
        write_image(&mut text, image);
        // Settings that the preset that fits is to choose are not written.
        let light_step = fitting.light_step && transfer.preset.is_some();
        let fitting = if self.is_fitting() { *fitting } else { Fitting { light_step, ..Fitting::NONE } };
        let unstated = transfer.preset.map_or_else(Clip::default, Preset::clip).shade_faces;
        let leaves_faces = clip.shade_faces == unstated && fitting.is_open <= fitting.shade_faces;
        write_clip(&mut text, clip, leaves_faces);
        write_shading(&mut text, shading, transfer.preset, fitting);
        write_splatting(&mut text, splatting, fitting);
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
    let Channel { name, visible, volume, spacing, labels, label_table, index, time, level, series, transfer } = channel;
    if text.channel.is_some() {
        let _ = writeln!(text.text, "\n[[channel]]");
        text.given("name", name.as_deref());
        if !visible {
            text.line("visible", false);
        }
    }
    let key = |name: &str| match text.channel {
        Some(number) => format!("channel[{number}].volume.{name}"),
        None => format!("volume.{name}"),
    };
    let (of_path, of_labels, of_table, of_offset) = (key("path"), key("labels"), key("label_table"), key("offset"));
    // A later channel without a volume is one of the first one's.
    if *volume != VolumeSource::Memory || text.channel.is_none_or(|number| number == 0) {
        text.table("volume");
    }
    match volume {
        VolumeSource::File(path) => text.line("path", name_of_file(path, &of_path)?),
        VolumeSource::Raw(path, layout) => {
            let RawLayout { dims, sample_type, big_endian, offset } = *layout;
            text.line("path", name_of_file(path, &of_path)?);
            text.line("dims", dims.to_array().map(i64::from).map(Value::from).to_vec());
            text.line("type", sample_type.to_string());
            text.line("endian", if big_endian { "big" } else { "little" });
            let allowed = format!("at most {}, the largest integer in TOML", i64::MAX);
            let offset = i64::try_from(offset).map_err(|_| invalid(&of_offset, offset.to_string(), &allowed));
            text.line("offset", offset?);
        }
        VolumeSource::Builtin(name) => text.line("builtin", name.as_str()),
        VolumeSource::Memory => {}
    }
    text.given("spacing", spacing.map(vector));
    let labels = labels.as_ref().map(|path| name_of_file(path, &of_labels));
    text.given("labels", labels.transpose()?);
    let table = label_table.as_ref().map(|path| match path.to_str() {
        Some(name) if name.starts_with("builtin:") => Ok(name.to_owned()),
        _ => name_of_file(path, &of_table),
    });
    text.given("label_table", table.transpose()?);
    text.given("index", index.map(i64::from));
    text.given("time", time.map(i64::from));
    text.given("level", level.map(i64::from));
    text.given("series", series.as_deref());
    write_transfer(text, transfer);
    Ok(())
}

impl Text {
    fn table(&mut self, name: &str) {
        let gap = if self.text.is_empty() { "" } else { "\n" };
        let parent = if self.channel.is_some() { "channel." } else { "" };
        let _ = writeln!(self.text, "{gap}[{parent}{name}]");
    }

    fn line(&mut self, key: &str, value: impl Into<Value>) {
        let _ = writeln!(self.text, "{key} = {}", value.into());
    }

    fn given(&mut self, key: &str, value: Option<impl Into<Value>>) {
        if let Some(value) = value {
            self.line(key, value);
        }
    }

    /// Writes a ramp as `[position, value]` points.
    fn ramp<T>(&mut self, key: &str, ramp: Option<&Ramp<T>>, value: impl Fn(&T) -> Value)
    where
        T: Copy + std::ops::Add<Output = T> + std::ops::Mul<f64, Output = T>,
    {
        let Some(ramp) = ramp else { return };
        let points: Vec<Value> =
            ramp.points().iter().map(|(at, y)| Value::Array(vec![(*at).into(), value(y)])).collect();
        if points.len() <= ON_ONE_LINE {
            return self.line(key, points);
        }
        let _ = writeln!(self.text, "{key} = [");
        for point in points {
            let _ = writeln!(self.text, "    {point},");
        }
        let _ = writeln!(self.text, "]");
    }

    fn ramps(
        &mut self,
        color: Option<&Ramp<DVec3>>,
        opacity: Option<&Ramp<f64>>,
        gradient_opacity: Option<&Ramp<f64>>,
    ) {
        self.ramp("color", color, |&rgb| vector(rgb));
        self.ramp("opacity", opacity, |&opacity| opacity.into());
        self.ramp("gradient_opacity", gradient_opacity, |&factor| factor.into());
    }
}

fn vector(vector: DVec3) -> Value {
    numbers(vector.to_array())
}

fn numbers(numbers: impl IntoIterator<Item = f64>) -> Value {
    Value::Array(numbers.into_iter().map(Value::from).collect())
}

fn write_camera(text: &mut Text, camera: &Camera) {
    let Camera { projection, direction, up, center, fit, is_eye_open: _ } = camera;
    text.table("camera");
    match *projection {
        Projection::Orthographic { height } => {
            text.line("projection", "orthographic");
            text.given("height", height);
        }
        Projection::Perspective { fov_y, distance, near } => {
            text.line("projection", "perspective");
            text.line("fov_y", fov_y);
            text.given("distance", distance);
            text.given("near", near);
        }
    }
    text.line("direction", vector(*direction));
    text.line("up", vector(*up));
    text.given("center", center.map(vector));
    text.line("fit", name_of(FITS, *fit));
}

fn write_image(text: &mut Text, image: &ImageSettings) {
    let ImageSettings { width, height, background } = *image;
    text.table("image");
    text.line("width", i64::from(width));
    text.line("height", i64::from(height));
    text.line("background", numbers(background));
}

fn write_clip(text: &mut Text, clip: &Clip, leaves_faces: bool) {
    let Clip { planes, crop, shade_faces } = clip;
    if clip.is_empty() && leaves_faces {
        return;
    }
    text.table("clip");
    text.line("planes", planes.iter().map(|&plane| numbers(plane)).collect::<Vec<_>>());
    text.given("crop", crop.map(|corners| corners.map(vector).to_vec()));
    // Scenes that do not state it stay as they were, and so do the fingerprints of their parts.
    if !leaves_faces {
        text.line("shade_faces", *shade_faces);
    }
}

fn write_transfer(text: &mut Text, transfer: &TransferSettings) {
    let TransferSettings { preset: _, colormap, color, opacity, gradient_opacity, iso_ranges, labels } = transfer;
    // An empty table would state that the scene has its own transfer function (SPEC §9).
    if transfer.states_more() {
        text.table("transfer");
    }
    text.given("colormap", colormap.map(|map| name_of(&Colormap::ALL, map)));
    text.ramps(color.as_ref(), opacity.as_ref(), gradient_opacity.as_ref());
    let ranges = iso_ranges.as_ref().map(|ranges| ranges.iter().map(|&range| numbers(range)).collect::<Vec<_>>());
    text.given("iso_ranges", ranges);
    for (&label, tables) in labels {
        let parent = if text.channel.is_some() { "channel." } else { "" };
        let _ = writeln!(text.text, "\n[[{parent}transfer.label]]");
        match i64::try_from(label) {
            Ok(label) => text.line("label", label),
            Err(_) => text.line("label", label.to_string()),
        }
        text.line("visible", tables.visible);
        text.ramps(tables.color.as_ref(), tables.opacity.as_ref(), tables.gradient_opacity.as_ref());
        if tables.membership {
            text.line("gradient", name_of(LABEL_GRADIENTS, true));
        }
    }
}

fn write_shading(text: &mut Text, shading: &Shading, preset: Option<Preset>, fitting: Fitting) {
    let default = Shading::default();
    let of_preset = preset.map_or(default, Preset::shading);
    let Shading {
        enabled,
        ambient,
        diffuse,
        specular,
        shininess,
        light,
        gradient,
        occlusion,
        occlusion_spread,
        shadow,
        shadow_spread,
        light_step,
    } = *shading;
    text.table("shading");
    if !(fitting.enabled && enabled == default.enabled) {
        text.line("enabled", enabled);
    }
    if !(fitting.ambient && ambient == default.ambient) {
        text.line("ambient", ambient);
    }
    if !(fitting.diffuse && diffuse == default.diffuse) {
        text.line("diffuse", diffuse);
    }
    if !(fitting.specular && specular == default.specular) {
        text.line("specular", specular);
    }
    if !(fitting.shininess && shininess == default.shininess) {
        text.line("shininess", shininess);
    }
    match light {
        _ if fitting.light && light == default.light => {}
        Light::Headlight => text.line("light", "headlight"),
        Light::UpperLeft => text.line("light", "upper-left"),
        Light::Direction(direction) => text.line("light", vector(direction)),
    }
    // A scene that does not state it leaves it to the volume.
    if gradient != Gradient::Auto {
        text.line("gradient", name_of(GRADIENTS, gradient));
    }
    // Scenes without light sheets stay as they were, and so do the fingerprints of their parts. Where a preset has or may choose light, its keys are stated.
    let is_open = fitting.is_open;
    let has_light = of_preset.light_key().is_some();
    let of_light = [
        ("occlusion", occlusion, default.occlusion, is_open && !fitting.occlusion || has_light),
        ("occlusion_spread", occlusion_spread, default.occlusion_spread, false),
        ("shadow", shadow, default.shadow, is_open && !fitting.shadow || has_light),
        ("shadow_spread", shadow_spread, default.shadow_spread, false),
        ("light_step", light_step, default.light_step, (is_open || has_light) && !fitting.light_step),
    ];
    for (key, stated, _, _) in
        of_light.into_iter().filter(|(_, stated, default, is_kept)| stated != default || *is_kept)
    {
        text.line(key, stated);
    }
}

fn write_splatting(text: &mut Text, splatting: &Splatting, fitting: Fitting) {
    let Splatting { method, radius, falloff, slab_width, footprint, compositing, order, .. } = *splatting;
    let Splatting { opacity_threshold, culling, tiles, rasterizer, footprint_box, experimental, .. } = *splatting;
    let Splatting { classification, interpolation, slab_profile, .. } = *splatting;
    let Economies { whole_below, beta, resolution } = experimental;
    text.table("splatting");
    text.line("method", name_of(METHODS, method));
    text.line("radius", radius);
    text.line("falloff", falloff);
    text.line("slab_width", slab_width);
    text.line("slab_profile", name_of(PROFILES, slab_profile));
    // A scene that does not state it leaves it to the volume.
    if classification != Classification::Auto {
        text.line("classification", name_of(CLASSIFICATIONS, classification));
    }
    text.line("interpolation", name_of(INTERPOLATIONS, interpolation));
    text.line("footprint", name_of(FORMS, footprint));
    if !(fitting.compositing && compositing == Splatting::default().compositing) {
        text.line("compositing", name_of(COMPOSITINGS, compositing));
    }
    text.line("order", name_of(ORDERS, order));
    text.line("opacity_threshold", opacity_threshold);
    text.line("culling", culling);
    text.line("tiles", tiles);
    text.line("rasterizer", name_of(RASTERIZERS, rasterizer));
    text.line("footprint_box", name_of(BOXES, footprint_box));
    text.table("splatting.experimental");
    text.line("whole_below", whole_below);
    text.line("beta", beta);
    text.line("resolution", resolution);
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
