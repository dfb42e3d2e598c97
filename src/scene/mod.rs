//! Scenes: what an image shows and how, from a scene file, from `--set` overrides, or from a volume alone (SPEC §7).

mod channel;
mod channels;
mod check;
mod color;
mod definition;
mod error;
mod fitting;
pub(crate) mod image_settings;
mod keys;
mod label_ramps;
mod level;
mod load;
mod only;
pub(crate) mod open;
mod overrides;
mod reader;
#[cfg(feature = "cli")]
mod schema;
mod slots;
mod source;
mod tables;
mod transfer_settings;
pub(crate) mod writer;

use std::path::Path;
use std::sync::Arc;

use glam::UVec3;
use toml::Table;

pub use channel::Channel;
pub use definition::Scene;
pub use error::SceneError;
pub use fitting::Fitting;
use fitting::is_builtin_head;
pub use image_settings::ImageSettings;
pub use open::OpenVolume;
#[cfg(feature = "cli")]
pub use schema::schema;
pub use source::VolumeSource;
pub use transfer_settings::TransferSettings;

use crate::appearance::{Eye, Preset, categories, exceeds_digits};
use crate::error::setting::SettingError;
use crate::lists::extent;
use crate::settings::camera::Camera;
use crate::settings::clip::Clip;
use crate::settings::framing::{Extent, Sphere};
use crate::settings::shading::Shading;
use crate::settings::splatting::{Classification, Splatting};
use crate::settings::transfer_function::TransferFunction;
use crate::volume::{Access, Channels, ReadOptions, Store, Volume, VolumeError};
use keys::Root;
use overrides::apply_override;
use reader::{OVERRIDE, Origins, Section};

impl Scene {
    /// Reads a scene file and applies `--set` overrides. A relative `volume.path` or `volume.labels`, overridden or not, is relative
    /// to the scene file's folder.
    ///
    /// # Errors
    /// If the file cannot be read, has more than 16 MiB or is not TOML, if a key is unknown, if a value is not allowed, or if the file takes more memory
    /// than [`ReadOptions::memory`] allows by default.
    pub fn open(path: &Path, sets: &[String]) -> Result<Self, SceneError> {
        Self::open_with(path, sets, &ReadOptions::default())
    }

    /// Like [`Self::open`], with a folder that the scene file must lie in and a memory limit. [`Self::load_volume_with`] reads the files that the scene names.
    ///
    /// # Errors
    /// As for [`Self::open`], and if the scene file lies outside the folder.
    pub fn open_with(path: &Path, sets: &[String], options: &ReadOptions) -> Result<Self, SceneError> {
        let access = Access::new(options)?;
        let text = access.text(path, MAX_TEXT)?.map_err(|source| SceneError::Io { path: path.to_owned(), source })?;
        reserve_text(path, text.len(), &access)?;
        Self::parse(&text, &path.display().to_string(), path.parent().unwrap_or(Path::new("")), sets)
    }

    /// Parses a scene from text, as [`Self::open`] does from a file. `origin` names the text in errors; a relative `volume.path` or
    /// `volume.labels` is relative to `folder`.
    ///
    /// # Errors
    /// If the text has more than 16 MiB or is not TOML, if a key is unknown, or if a value is not allowed.
    pub fn parse(text: &str, origin: &str, folder: &Path, sets: &[String]) -> Result<Self, SceneError> {
        Self::build(parse_table(text, origin)?, origin, folder, None, sets)
    }

    /// Parses a scene from text that need not name a volume: `source` is the volume of a text that names none.
    ///
    /// # Errors
    /// As for [`Self::parse`].
    pub fn parse_for(
        source: VolumeSource,
        text: &str,
        origin: &str,
        folder: &Path,
        sets: &[String],
    ) -> Result<Self, SceneError> {
        Self::build(parse_table(text, origin)?, origin, folder, Some(source), sets)
    }

    /// A scene of a volume with every setting at its default, except the `--set` overrides. A relative `volume.path` or `volume.labels` in
    /// these is relative to the current directory.
    ///
    /// # Errors
    /// If an override's key is unknown or its value is not allowed.
    pub fn from_volume(source: VolumeSource, sets: &[String]) -> Result<Self, SceneError> {
        Self::build(Table::new(), OVERRIDE, Path::new(""), Some(source), sets)
    }

    /// Loads or computes the volume, with all channels, and the scene's spacing and labels if it states them. The label file's spacing must equal the
    /// volume's, unless the scene's spacing replaces both. Of a store with several levels, [`Self::choose_levels`] chooses one.
    ///
    /// # Errors
    /// If the volume or label file cannot be read, is of no known format or does not hold what its header promises, if the labels do not
    /// fit the volume, if there is no such builtin volume, or if both need more memory than [`ReadOptions::memory`] allows by default.
    pub fn load_volume(&self) -> Result<Volume, VolumeError> {
        self.load_volume_with(&ReadOptions::default())
    }

    /// Like [`Self::load_volume`], with a folder that files must lie in, a memory limit for values and labels together, and files that are outputs.
    ///
    /// # Errors
    /// As for [`Self::load_volume`], and if a file lies outside the folder or is an output.
    pub fn load_volume_with(&self, options: &ReadOptions) -> Result<Volume, VolumeError> {
        let scene = self.choose_levels(options, Self::explicit)?;
        load::channels(&scene, &Access::new(options)?)
    }

    /// Opens the scene's volume to be read by boxes (SPEC §13), if it is one file without labels or a spacing of the scene's; `None` for any other.
    pub fn open_store(&self, options: &ReadOptions) -> Option<Result<Arc<dyn Store>, VolumeError>> {
        match Access::new(options) {
            Ok(access) => load::store(self, &access),
            Err(error) => Some(Err(error)),
        }
    }

    /// The same scene with everything stated that depends on the volume: the transfer function, the camera's position and the level. Preset and colour
    /// map are replaced by their results. It renders the same image.
    pub fn explicit(&self, volume: &Volume) -> Self {
        self.explicit_by(volume, |scene, transfer, size| {
            scene.extent(volume, transfer).map(|extent| extent.fit(&scene.camera, size))
        })
    }

    /// Like [`Self::explicit`], but a camera that fits an object ([`Fit::Object`](crate::settings::Fit::Object)) is placed so that the object stays in the image at
    /// constant size in whichever direction the camera turns: for movies and for cameras that follow a pointer.
    pub fn explicit_all_around(&self, volume: &Volume) -> Self {
        self.explicit_by(volume, |scene, transfer, size| {
            scene.sphere(volume, transfer).map(|sphere| sphere.fit(&scene.camera, size))
        })
    }

    /// `fit` gives the camera for a transfer function and an image's size, or `None` if it stays.
    fn explicit_by(
        &self,
        volume: &Volume,
        fit: impl Fn(&Self, &[TransferFunction], [u32; 2]) -> Option<Camera>,
    ) -> Self {
        let settled = self.settled(volume);
        let ImageSettings { width, height, .. } = self.image;
        let camera = fit(&settled, &settled.resolve(volume), [width, height]).unwrap_or(settled.camera);
        let camera = camera.explicit(volume.drawn_grid(), self.splatting.radius, width, height);
        let mut channels = settled.explicit_channels(volume);
        channels.first_mut().level = self.level_in(volume);
        Self { camera, channels, ..settled }
    }

    /// The box that a camera fits under a transfer function (for a scene that leaves it to the volume, that of
    /// [`Self::resolve`]): the box around the kernels of all voxels that take part and are not cut away. If the opacity was
    /// chosen automatically, the outermost 0.1 % of them at either end of each axis are ignored as noise. `None` if the camera needs no such
    /// box, or no voxel takes part.
    pub fn extent(&self, volume: &Volume, transfer: &[TransferFunction]) -> Option<Extent> {
        let voxels = self.shown_voxels(volume, transfer)?;
        Some(Extent::of_voxels(volume.grid(), voxels, self.splatting.radius))
    }

    /// The sphere about the middle of [`Self::extent`] that holds these voxels and their kernels, for cameras that turn. `None` as there.
    pub fn sphere(&self, volume: &Volume, transfer: &[TransferFunction]) -> Option<Sphere> {
        let (grid, kernel) = (volume.grid(), self.splatting.radius);
        let voxels = self.shown_voxels(volume, transfer)?;
        let farthest = extent::farthest(volume, transfer, &self.clip.voxels(grid, kernel), voxels);
        let center = Extent::of_voxels(grid, voxels, kernel).center();
        Some(Sphere { center, radius: farthest + kernel * grid.spacing.max_element() })
    }

    /// The first and the last voxel of the box that a camera fits; `None` as for [`Self::extent`].
    fn shown_voxels(&self, volume: &Volume, transfer: &[TransferFunction]) -> Option<[UVec3; 2]> {
        /// The ignored fraction of voxels at either end of each axis.
        const SPECKS: f64 = 0.001;
        if !self.camera.needs_object() {
            return None;
        }
        let clipped = self.clip.voxels(volume.grid(), self.splatting.radius);
        let specks = if self.channels.iter().any(|channel| channel.transfer.opacity.is_none()) { SPECKS } else { 0.0 };
        extent::of_voxels(volume, transfer, &clipped, specks)
    }

    /// The eye that a volume chooses for the camera; `None` if the scene states its direction or up.
    pub fn eye(&self, volume: &Volume) -> Option<Eye> {
        self.camera.has_open_eye().then(|| Eye::of(volume, self.fitted(volume).channels.first().transfer.preset))
    }

    /// The camera with the direction and up that a volume chooses ([`Self::eye`]), or its own.
    pub fn camera_for(&self, volume: &Volume) -> Camera {
        self.eye(volume).map_or(self.camera, |eye| self.camera.looking(eye.direction_and_up()))
    }

    /// The scene with a camera that no longer depends on the object.
    pub(crate) fn framed(&self, volume: &Volume, transfer: &[TransferFunction]) -> Self {
        let ImageSettings { width, height, .. } = self.image;
        let settled = self.settled(volume);
        let extent = settled.extent(volume, transfer);
        let camera = extent.map_or(settled.camera, |extent| extent.fit(&settled.camera, [width, height]));
        Self { camera, ..settled }
    }

    /// Whether values are classified before or after splatting, for a volume (SPEC §9): as stated, or with [`Classification::Auto`] after
    /// it where the transfer function comes from a preset (except `xray`, `confocal` and `labels`) or is chosen for the volume, unless
    /// another setting excludes that or the volume, or one of several channels, is a label map ([`categories`]).
    pub fn classification(&self, volume: &Volume) -> Classification {
        let splatting = &self.splatting;
        if splatting.classification != Classification::Auto {
            return splatting.classification;
        }
        if self.is_fitting() {
            return self.fitted(volume).classification(volume);
        }
        let are_several = volume.channel_count() > 1;
        let is_sharper = (0..).zip(volume.channels()).all(|(number, volume)| {
            let transfer = &self.settings_of(number).transfer;
            match transfer.preset {
                None | Some(Preset::None) => !transfer.states_more() && !categories::is_label_map(volume),
                Some(preset) => {
                    let may_be_labels = are_several && preset.is_classified_after() && !preset.is_projection();
                    preset.is_classified_after() && !(may_be_labels && categories::is_label_map(volume))
                }
            }
        });
        let allows_after = splatting.allows_after() && self.membership_key().is_none();
        if is_sharper && allows_after { Classification::After } else { Classification::Before }
    }

    /// The scene with the preset that fits a volume, [`Preset::None`] if none does, where it states no appearance: no preset, and nothing of a
    /// transfer function.
    pub fn fitted(&self, volume: &Volume) -> Self {
        let step = |shading: Shading, preset| {
            let preset_and_kernel = (preset, self.splatting.radius);
            let light_step = self.fitting.light_step(&shading, preset_and_kernel, volume.drawn_grid());
            Shading { light_step, ..shading }
        };
        if !self.is_fitting() {
            let shading =
                self.channels.first().transfer.preset.map_or(self.shading, |preset| step(self.shading, preset));
            return Self { shading, ..self.clone() };
        }
        let preset = Preset::suggested(volume).unwrap_or(Preset::None);
        let fitted =
            self.clone().with_transfer(TransferSettings { preset: Some(preset), ..TransferSettings::default() });
        // The surface that stands out of the builtin head is its skin.
        let lit_by = if preset == Preset::None && is_builtin_head(volume) { Preset::CtSkin } else { preset };
        let shading = step(self.fitting.fitted(self.shading, lit_by.shading()), lit_by);
        let of_preset = Splatting { compositing: preset.compositing(), ..Splatting::default() };
        let mut splatting = self.fitting.fitted(self.splatting, of_preset);
        let clip = self.fitting.fitted(self.clip.clone(), preset.clip());
        if splatting.classification == Classification::Auto && exceeds_digits(volume) {
            splatting.classification = Classification::Before;
        }
        Self { clip, shading, splatting, fitting: Fitting::NONE, ..fitted }
    }

    /// Whether the preset that fits is used.
    fn is_fitting(&self) -> bool {
        self.fitting.is_open
            && self.channels.len() == 1
            && self.channels.first().transfer == TransferSettings::default()
    }

    /// The scene with a preset, a classification, and a direction of its camera, that no longer depend on the volume.
    pub(crate) fn settled(&self, volume: &Volume) -> Self {
        let fitted = self.fitted(volume);
        let splatting = Splatting { classification: fitted.classification(volume), ..fitted.splatting };
        let shading = Shading { gradient: fitted.gradient(volume), ..fitted.shading };
        Self { splatting, shading, camera: fitted.camera_for(volume), fitting: Fitting::NONE, ..fitted }
    }

    /// `source` is the volume of a scene whose tables name none.
    fn build(
        mut root: Table,
        origin: &str,
        folder: &Path,
        source: Option<VolumeSource>,
        sets: &[String],
    ) -> Result<Self, SceneError> {
        // Without these tables, the object is to be shown; overrides of single keys do not change that.
        let is_bare = !["transfer", "channel", "camera"].iter().any(|table| root.contains_key(*table));
        let camera_by_default = if is_bare { Camera::of_object() } else { Camera::default() };
        let overridden = sets.iter().map(|set| apply_override(&mut root, set)).collect::<Result<_, _>>()?;
        let origins = Origins { file: origin, overridden, written: root.clone() };
        let mut root = Section::root(&origins, root);
        let channels = tables::channel_tables(&mut root)?;
        let states_transfer = channels.iter().any(|channel| channel.states_transfer);
        let [camera, image, clip, shading, splatting] = [
            root.section("camera")?,
            root.section("image")?,
            root.section("clip")?,
            root.section("shading")?,
            root.section("splatting")?,
        ];
        // Unknown tables are reported first: a misspelt table best explains why keys seem to be missing.
        let Root { preset } = root.filled(Root::default())?;
        let splatting_of_preset = Splatting {
            compositing: preset.map_or(Splatting::default().compositing, Preset::compositing),
            interpolation: preset.map_or(Splatting::default().interpolation, Preset::interpolation),
            classification: if states_transfer && preset.is_none_or(|preset| preset == Preset::None) {
                Classification::Before
            } else {
                Classification::Auto
            },
            ..Splatting::default()
        };
        let channels = tables::channels(channels, folder, source, preset)?;
        let is_open = preset.is_none() && !states_transfer && channels.len() <= 1;
        let unstated = tables::fitting([&shading, &splatting, &clip]);
        let of_preset = Fitting { light_step: preset.is_some() && unstated.light_step, ..Fitting::NONE };
        let fitting = if is_open { unstated } else { of_preset };
        let scene = Self {
            channels: Channels::of(channels).unwrap_or_else(|| Channel::default().into()),
            camera: tables::camera(camera, camera_by_default)?,
            image: image.filled(ImageSettings::default())?,
            clip: clip.filled(preset.map_or_else(Clip::default, Preset::clip))?,
            shading: shading.filled(preset.map_or_else(Shading::default, Preset::shading))?,
            splatting: tables::splatting(splatting, splatting_of_preset)?,
            fitting,
        };
        scene.check_tables().map_err(|error| origins.refused(error))?;
        let whole = |error: SettingError| origins.invalid(&error.key, &[], error.found.to_string(), error.allowed);
        scene.check_membership().map_err(whole)?;
        if preset == Some(Preset::Labels) && scene.splatting.classification == Classification::After {
            let (key, found) = ("splatting.classification", "\"after\" with preset = \"labels\"");
            return Err(origins.invalid(key, &["preset"], found, "\"before\" with it"));
        }
        // Tables too long to be quoted are counted.
        scene.check_pieces().map_err(whole)?;
        Ok(scene)
    }
}

/// The maximum length of a scene's text in bytes: tables of 65 536 labels, each of which states its colour and opacity, fit.
const MAX_TEXT: u64 = 16 << 20;

/// The bytes of memory that reading a scene takes for each byte of its text: at most 112 were measured, of short numbers in arrays.
const PER_BYTE: u64 = 128;

/// The length of a text whose memory is not counted.
const SMALL_TEXT: u64 = 16 << 10;

/// Reserves the memory that reading the text of a scene takes.
///
/// # Errors
/// If it exceeds the memory limit.
pub(crate) fn reserve_text(path: &Path, length: usize, access: &Access) -> Result<(), VolumeError> {
    let length = length as u64;
    if length <= SMALL_TEXT {
        return Ok(());
    }
    access.reserve(path, "size", format_args!("{length} bytes of a scene"), length.saturating_mul(PER_BYTE))
}

fn check_length(length: u64, origin: &str) -> Result<(), SceneError> {
    if length <= MAX_TEXT {
        return Ok(());
    }
    let (origin, key, found) = (origin.to_owned(), "size".to_owned(), format!("more than {MAX_TEXT} bytes"));
    Err(SceneError::Invalid { origin, key, found, allowed: format!("at most {MAX_TEXT} bytes of a scene").into() })
}

fn parse_table(text: &str, origin: &str) -> Result<Table, SceneError> {
    check_length(text.len() as u64, origin)?;
    text.parse().map_err(|error: toml::de::Error| SceneError::Syntax {
        origin: origin.to_owned(),
        message: error.to_string().trim_end().to_owned(),
    })
}
