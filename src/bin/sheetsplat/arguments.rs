//! Arguments that several subcommands share.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::ValueEnum;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use sheetsplat::RenderError;
use sheetsplat::appearance::{Colormap, Preset};
use sheetsplat::headless::{Backend, Error, Headless, HeadlessOptions};
use sheetsplat::image::PngDepth;
use sheetsplat::scene::{OpenVolume, Scene, SceneError, VolumeSource};
use sheetsplat::settings::navigation;
use sheetsplat::stats::Stats;
use sheetsplat::volume::{self, ReadOptions, StreamedVolume, Volume};

use crate::failure::Failure;
use crate::outputs::Outputs;
use crate::picture::{self, Picture};
use crate::reading::Reading;
use crate::stdin;

/// The flags that set keys of the scene, in the order in which they are applied.
const FLAGS: [(&str, &str); 16] = [
    ("--dims", "volume.dims"),
    ("--type", "volume.type"),
    ("--endian", "volume.endian"),
    ("--offset", "volume.offset"),
    ("--spacing", "volume.spacing"),
    ("--channel", "volume.index"),
    ("--time", "volume.time"),
    ("--level", "volume.level"),
    ("--series", "volume.series"),
    ("--preset", "preset"),
    ("--preset", "volume.label_table"),
    ("--colormap", "transfer.colormap"),
    ("--size", "image.width"),
    ("--size", "image.height"),
    ("--background", "image.background"),
    ("--window", "transfer.opacity"),
];

/// The preset of label maps with a table of labels.
const FREESURFER: &str = "freesurfer";

/// The scene to draw, and the adapter.
#[derive(clap::Args)]
pub(crate) struct Input {
    /// A scene file (.toml), a picture that tells its scene (.png, .exr), a volume file, the address of a Zarr store (http:// or https://), builtin:NAME[:N],
    /// or - for a volume file from standard input, of a format that its first bytes tell and whose header names no other file.
    #[arg(value_name = "INPUT")]
    pub(crate) name: String,
    /// Set a scene value, as in --set splatting.slab_width=2.0. Can be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub(crate) sets: Vec<String>,
    #[command(flatten)]
    raw: Raw,
    #[command(flatten)]
    look: Look,
    #[command(flatten)]
    pub(crate) reading: Reading,
    #[command(flatten)]
    pub(crate) picture: Picture,
    /// The ranges of the values in the volume's chunks, made by `sheetsplat index`: where the volume fits into no memory, chunks are not read whose values
    /// cannot be seen.
    #[arg(long, value_name = "FILE")]
    pub(crate) index: Option<PathBuf>,
    /// The side of the patient to look at, if the volume's file states how the patient lies; replaces the scene's camera.direction
    /// and camera.up.
    #[arg(long, value_enum, value_name = "SIDE")]
    pub(crate) view: Option<View>,
    /// One label alone, by its name or its number in the file: all others are hidden.
    #[arg(long, value_name = "LABEL")]
    only: Option<String>,
    /// Degrees by which the eye goes to the right about camera.up, from where it would be.
    #[arg(long, value_name = "DEG", value_parser = parse_degrees, allow_negative_numbers = true)]
    azimuth: Option<f64>,
    /// Degrees by which the eye goes up, after --azimuth.
    #[arg(long, value_name = "DEG", value_parser = parse_degrees, allow_negative_numbers = true)]
    elevation: Option<f64>,
    /// What draws: a GPU by its driver, the CPU's cores without one, the slow f64 evaluation that both are tested against, or a GPU if there is
    /// one and else the CPU. --adapter, --profile and a scene's rasterizer mean the GPU.
    #[arg(
        long, value_name = "BACKEND", env = "SHEETSPLAT_BACKEND", default_value = "auto",
        value_parser = PossibleValuesParser::new(Backend::ALL.map(Backend::name)).try_map(|name| name.parse::<Backend>()),
    )]
    pub(crate) backend: Backend,
    /// Part of the name of the adapter to use.
    #[arg(long, value_name = "NAME", env = "WGPU_ADAPTER_NAME")]
    pub(crate) adapter: Option<String>,
}

/// Parses an angle in degrees: a finite number.
pub(crate) fn parse_degrees(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|turn: &f64| turn.is_finite()).ok_or_else(|| "allowed: a finite number".to_owned())
}

/// Parses `WxH`, or `W` for a square.
fn parse_size(text: &str) -> Result<[u32; 2], String> {
    let (width, height) = text.split_once(['x', '×']).unwrap_or((text, text));
    let parse = |side: &str| side.parse().ok().filter(|side| *side > 0);
    let sides = parse(width).zip(parse(height));
    sides.map(Into::into).ok_or_else(|| "allowed: W or WxH, integers >= 1".to_owned())
}

/// Parses `LO,HI`, the first one less than the second one.
fn parse_window(text: &str) -> Result<[f64; 2], String> {
    let parse = |end: &str| end.trim().parse().ok().filter(|end: &f64| end.is_finite());
    let ends = text.split_once(',').and_then(|(low, high)| parse(low).zip(parse(high)));
    ends.filter(|(low, high)| low < high).map(Into::into).ok_or_else(|| "allowed: LO,HI, LO less than HI".to_owned())
}

/// Appearance by name: shorthand for the scene's keys, applied before --set.
#[derive(clap::Args)]
struct Look {
    /// Transfer function, shading and compositing for a kind of data, where the scene states none: short for --set
    /// preset=NAME. freesurfer is labels with the names and colours of FreeSurfer's: volume.label_table=builtin:freesurfer.
    #[arg(long, value_name = "NAME", value_parser = PossibleValuesParser::new(Preset::ALL.map(|(name, _)| name).into_iter().chain([FREESURFER])))]
    preset: Option<String>,
    /// The picture's size in pixels, or a window's in points: short for --set image.width=W and image.height=H. W alone is square.
    #[arg(long, value_name = "W[xH]", value_parser = parse_size)]
    size: Option<[u32; 2]>,
    /// The colour behind the object, by CSS: white, #fff or transparent. Short for --set image.background=COLOR.
    #[arg(long, value_name = "COLOR")]
    background: Option<String>,
    /// Colours over the visible values, or the palette of the volume's file, in place of the scene's: short for --set
    /// transfer.colormap=NAME.
    #[arg(long, value_name = "NAME", value_parser = PossibleValuesParser::new(Colormap::ALL.map(|(name, _)| name)))]
    colormap: Option<String>,
    /// Opacities from 0 at the value LO and below to 1 at HI and above, in place of the scene's: short for --set transfer.opacity=[[LO,0],[HI,1]].
    /// It is the window of a MIP's brightness.
    #[arg(long, value_name = "LO,HI", allow_hyphen_values = true, value_parser = parse_window)]
    window: Option<[f64; 2]>,
}

/// The layout of a raw file: shorthand for the scene's keys, applied before --set.
#[derive(clap::Args)]
struct Raw {
    /// Voxels of a file without a header, also XxYxZ: short for --set volume.dims=[X,Y,Z].
    #[arg(long, value_name = "X,Y,Z")]
    dims: Option<String>,
    /// Its samples' type, uint8, int16, float32, …: short for --set volume.type=TYPE.
    #[arg(long, value_name = "TYPE")]
    r#type: Option<String>,
    /// Its byte order, little or big: short for --set volume.endian=ORDER.
    #[arg(long, value_name = "ORDER")]
    endian: Option<String>,
    /// Bytes before its first sample: short for --set volume.offset=N.
    #[arg(long, value_name = "N")]
    offset: Option<String>,
    /// World units from voxel to voxel, of any volume: short for --set volume.spacing=[X,Y,Z].
    #[arg(long, value_name = "X,Y,Z")]
    spacing: Option<String>,
    /// The only channel, counted from 0, to show of a file with several: short for --set volume.index=N.
    #[arg(long, value_name = "N")]
    channel: Option<String>,
    /// The time, counted from 0, to show of a file with several: short for --set volume.time=N. `orbit` also takes A..B, the times A to B - 1 in turn.
    #[arg(long, value_name = "N")]
    time: Option<String>,
    /// The level, counted from 0 for the finest, to show of a store with several: short for --set volume.level=N. The default, auto, is the coarsest
    /// whose voxels are no larger than a pixel.
    #[arg(long, value_name = "N")]
    level: Option<String>,
    /// The series of a DICOM folder with several, by its number, counted from 0, or its SeriesInstanceUID: short for --set volume.series=N. The default is
    /// the largest; `info` lists them.
    #[arg(long, value_name = "N or UID")]
    series: Option<String>,
}

#[derive(Clone, Copy, ValueEnum)]
pub(crate) enum View {
    Front,
    Back,
    Left,
    Right,
    Top,
    Bottom,
}

impl From<View> for volume::PatientSide {
    fn from(view: View) -> Self {
        match view {
            View::Front => Self::Front,
            View::Back => Self::Back,
            View::Left => Self::Left,
            View::Right => Self::Right,
            View::Top => Self::Top,
            View::Bottom => Self::Bottom,
        }
    }
}

impl Input {
    /// The size that `--size` gives, pixels or points.
    #[cfg(feature = "viewer")]
    pub(crate) fn size(&self) -> Option<[u32; 2]> {
        self.look.size
    }

    /// The options for reading the scene and its volume.
    pub(crate) fn options(&self) -> ReadOptions {
        let mut options = self.reading.options();
        options.index.clone_from(&self.index);
        if self.name == stdin::NAME {
            options.files = Some(stdin::file(options.memory_limit()));
        }
        options
    }

    pub(crate) fn scene(&self) -> Result<Scene, Failure> {
        self.scene_with(&self.sets)
    }

    /// The scene with these settings in place of those of --set. The input is a scene file by its extension, or else a volume.
    pub(crate) fn scene_with(&self, sets: &[String]) -> Result<Scene, Failure> {
        self.scene_of(self.raw.time.as_deref(), sets)
    }

    /// The scene at its first time and the times of --time A..B; at its own time if --time is no range.
    pub(crate) fn scene_and_times(&self) -> Result<(Scene, Option<Range<u32>>), Failure> {
        let Some(text) = self.raw.time.as_deref().filter(|text| text.contains("..")) else {
            return Ok((self.scene()?, None));
        };
        let times = parse_range(text).map_err(|allowed| Failure::Input(format!("--time: found {text}, {allowed}")))?;
        Ok((self.scene_of(Some(&times.start.to_string()), &self.sets)?, Some(times)))
    }

    fn scene_of(&self, time: Option<&str>, sets: &[String]) -> Result<Scene, Failure> {
        let is_opacity = |set: &&String| set.split_once('=').is_some_and(|(key, _)| key.trim() == "transfer.opacity");
        if let (Some([low, high]), Some(set)) = (self.look.window, sets.iter().find(is_opacity)) {
            let allowed = "one of the two, as both state the opacities";
            return Err(Failure::Input(format!("--window: found {low},{high} and --set {set}, allowed: {allowed}")));
        }
        let sets: Vec<String> = self.flags(time).chain(sets.iter().cloned()).collect();
        let scene = match self.name.strip_prefix("builtin:") {
            Some(name) => Scene::from_volume(VolumeSource::Builtin(name.to_owned()), &sets),
            None if self.is_scene_file() => Scene::open_with(self.name.as_ref(), &sets, &self.options()),
            None if picture::is_picture(&self.name) => {
                self.picture.scene(self.name.as_ref(), &sets, &self.options())?
            }
            None => Scene::from_volume(VolumeSource::File(self.name.clone().into()), &sets),
        };
        let scene = scene.map_err(|error| self.by_flag(&error))?;
        let unfit = [Preset::Xray, Preset::Labels, Preset::Photo];
        if let (Some([low, high]), Some(preset)) =
            (self.look.window, scene.channels.first().transfer.preset.filter(|of| unfit.contains(of)))
        {
            let name = Preset::ALL.iter().find(|(_, of)| *of == preset).map_or("", |(name, _)| name);
            let allowed = "another preset, as this one's opacities are no window of values";
            return Err(Failure::Input(format!(
                "--window: found {low},{high} and the preset {name}, allowed: {allowed}"
            )));
        }
        Ok(scene)
    }

    /// The settings that the flags are short for, with a time to be shown.
    fn flags(&self, time: Option<&str>) -> impl Iterator<Item = String> {
        let Self { raw: Raw { dims, r#type, endian, offset, spacing, channel, time: _, level, series }, look, .. } =
            self;
        let Look { preset, size, background, colormap, window } = look;
        let vector =
            |numbers: &Option<String>| numbers.as_ref().map(|text| format!("[{}]", text.replace(['x', '×'], ",")));
        let [width, height] = [0, 1].map(|side| size.map(|size| size[side].to_string()));
        let texts = [
            vector(dims),
            r#type.clone(),
            endian.clone(),
            offset.clone(),
            vector(spacing),
            channel.clone(),
            time.map(str::to_owned),
            level.clone(),
            // Text, because an identity may look like a number.
            series.as_ref().map(|text| format!("{text:?}")),
            preset.as_deref().map(|name| if name == FREESURFER { "labels" } else { name }.to_owned()),
            preset.as_deref().filter(|name| *name == FREESURFER).map(|name| format!("builtin:{name}")),
            colormap.clone(),
            width,
            height,
            background.clone(),
            window.map(|[low, high]| format!("[[{low:?}, 0], [{high:?}, 1]]")),
        ];
        FLAGS.iter().zip(texts).filter_map(|((_, key), text)| Some(format!("{key}={}", text?)))
    }

    /// The failure of a scene, by the flag's name where a flag has set the key.
    fn by_flag(&self, error: &SceneError) -> Failure {
        let message = error.to_string();
        let SceneError::Invalid { origin, key, .. } = error else { return Failure::Input(message) };
        // With several channels the keys of a volume are the first one's.
        let own = key.strip_prefix("channel[0].").unwrap_or(key);
        let is_of = |set: &str| own.strip_prefix(set).is_some_and(|rest| rest.is_empty() || rest.starts_with('['));
        let is_set = self.sets.iter().filter_map(|set| set.split_once('=')).any(|(set, _)| is_of(set.trim()));
        match FLAGS.iter().find(|(_, set)| is_of(set)).filter(|_| origin == "--set" && !is_set) {
            Some((flag, _)) => Failure::Input(message.replacen(&format!("--set: {key}"), flag, 1)),
            None => Failure::Input(message),
        }
    }

    fn is_scene_file(&self) -> bool {
        Path::new(&self.name).extension().is_some_and(|extension| extension.eq_ignore_ascii_case("toml"))
    }

    /// The input files named by the arguments and the scene. A header may name more.
    pub(crate) fn files(&self, scene: &Scene) -> Vec<PathBuf> {
        let is_read = self.is_scene_file() || picture::is_picture(&self.name);
        let scene_file = is_read.then(|| self.name.clone().into());
        let mut files: Vec<PathBuf> = scene_file.into_iter().chain(self.index.clone()).collect();
        for channel in &scene.channels {
            files.extend(channel.volume.path().map(Path::to_path_buf));
            files.extend(channel.labels.clone());
            files.extend(channel.label_table.clone());
        }
        files
    }

    /// The scene with the levels stated that it leaves open. `explicit` is as for [`Self::settled`].
    pub(crate) fn choose_levels(
        &self,
        scene: &Scene,
        explicit: impl Fn(&Scene, &Volume) -> Scene,
    ) -> Result<Scene, Failure> {
        let chosen = scene.choose_levels(&self.options(), explicit).map_err(|error| self.failure(error))?;
        if let Some(level) = chosen.channels.first().level.filter(|_| scene.channels.first().level.is_none()) {
            log::info!("{}: level {level} is drawn", self.name);
        }
        Ok(chosen)
    }

    /// Opens the scene's volume, from files that are not outputs: loads it, or if it fits into no memory and can be read by boxes, a sample of it.
    pub(crate) fn open_volume(&self, scene: &Scene, outputs: &Outputs) -> Result<OpenVolume, Failure> {
        let start = Instant::now();
        let volume = self.read_volume(scene, outputs)?;
        match &volume {
            OpenVolume::Whole(volume) => self.log_volume(volume, start),
            OpenVolume::Streamed(StreamedVolume { sample, .. }) => {
                let (name, dims) = (&self.name, volume.grid().dims);
                log::info!("{name}: {dims} voxels, a sample of {} read in {:.1?}", sample.dims(), start.elapsed());
            }
        }
        Ok(volume)
    }

    /// Loads the scene's volume, which must fit into memory, from files that are not outputs.
    #[cfg(feature = "viewer")]
    pub(crate) fn load_volume(&self, scene: &Scene, outputs: &Outputs) -> Result<Volume, Failure> {
        let start = Instant::now();
        let loaded = scene.load_volume_with(&self.options().with_outputs(outputs.written()));
        let volume = loaded.map_err(|error| self.failure(error))?;
        self.log_volume(&volume, start);
        Ok(volume)
    }

    fn log_volume(&self, volume: &Volume, start: Instant) {
        log::info!("{}: {} voxels, loaded in {:.1?}", self.name, volume.grid().dims, start.elapsed());
        let (holes, samples) = (volume.holes(), volume.values().len());
        if holes > 0 {
            log::warn!("{}: {holes} of {samples} samples are NaN or infinite: these holes are not drawn", self.name);
        }
    }

    /// Opens the volume without logging anything.
    pub(crate) fn read_volume(&self, scene: &Scene, outputs: &Outputs) -> Result<OpenVolume, Failure> {
        let options = self.options().with_outputs(outputs.written()).noted_in(&self.picture.noting());
        scene.open_volume_with(&options).map_err(|error| self.failure(error))
    }

    /// The scene as it is drawn, with everything stated that depends on the volume, so that a saved scene equals the drawn one. `explicit`
    /// is [`Scene::explicit`], or [`Scene::explicit_all_around`] for cameras that turn.
    pub(crate) fn settled(
        &self,
        volume: &Volume,
        scene: &Scene,
        explicit: impl Fn(&Scene, &Volume) -> Scene,
    ) -> Result<Scene, Failure> {
        let mut scene = scene.clone();
        self.choose_view(volume, &mut scene)?;
        scene.check_volume(volume).map_err(|error| self.failure(RenderError::from(error)))?;
        Ok(explicit(&scene, volume))
    }

    /// Leaves one label by --only, and turns the scene's camera to the side of the patient given by --view, and by --azimuth and --elevation.
    pub(crate) fn choose_view(&self, volume: &Volume, scene: &mut Scene) -> Result<(), Failure> {
        if let Some(label) = &self.only {
            *scene = scene.only(label, volume).map_err(|error| Failure::Input(format!("--{error}")))?;
        }
        self.look_at_side(volume, scene)?;
        let [azimuth, elevation] = [self.azimuth, self.elevation].map(Option::unwrap_or_default);
        if azimuth != 0.0 || elevation != 0.0 {
            let moved = navigation::eye_moved(&scene.camera_for(volume), azimuth, elevation);
            scene.camera = moved.map_err(|error| Failure::Input(format!("--{error}")))?;
        }
        Ok(())
    }

    fn look_at_side(&self, volume: &Volume, scene: &mut Scene) -> Result<(), Failure> {
        let (Some(view), name) = (self.view, &self.name) else { return Ok(()) };
        let Some(orientation) = volume.orientation() else {
            let allowed = "a volume whose file says how the patient lies, or --set camera.direction and camera.up";
            return Err(Failure::Input(format!(
                "{name}: --view: found no orientation in the file, allowed: {allowed}"
            )));
        };
        scene.camera = scene.camera.looking(orientation.direction_and_up(view.into()));
        Ok(())
    }

    /// What draws some scenes.
    pub(crate) fn headless<'a>(
        &self,
        profile: bool,
        scenes: impl IntoIterator<Item = &'a Scene>,
    ) -> Result<Headless, Failure> {
        let backend = self.picture.backend(self.backend);
        let mut options = HeadlessOptions::default().with_profile(profile).with_backend(backend);
        options.adapter = self.adapter.clone();
        let start = Instant::now();
        let headless = Headless::for_scenes(&options, scenes).map_err(|error| Failure::Other(error.to_string()))?;
        log::info!("{} renderer ready after {:.1?}", headless.backend(), start.elapsed());
        Ok(headless)
    }

    pub(crate) fn failure(&self, error: impl Into<Error>) -> Failure {
        Failure::of(error.into(), &self.name)
    }
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
pub(crate) enum Depth {
    #[value(name = "8")]
    Eight,
    #[value(name = "16")]
    Sixteen,
}

impl From<Depth> for PngDepth {
    fn from(depth: Depth) -> Self {
        match depth {
            Depth::Eight => Self::Eight,
            Depth::Sixteen => Self::Sixteen,
        }
    }
}

/// Logs the adapter that drew a frame, and the time it took.
pub(crate) fn log_frame(what: &str, stats: &Stats) {
    let Stats { adapter, rasterizer, prepare_ms, frame_ms, .. } = stats;
    log::info!("{what}: {:.1} ms by {rasterizer} on {adapter}", prepare_ms + frame_ms);
}

/// Parses `A..B`, which must not be empty.
pub(crate) fn parse_range(text: &str) -> Result<Range<u32>, String> {
    let parse = |(from, to): (&str, &str)| Some(from.parse().ok()?..to.parse().ok()?);
    let range = text.split_once("..").and_then(parse).filter(|range| !range.is_empty());
    range.ok_or_else(|| "allowed: A..B, A less than B".to_owned())
}

/// Checks the name of a scene file that will be written.
pub(crate) fn check_scene_file(path: &Path) -> Result<(), Failure> {
    match path.extension() {
        Some(extension) if extension.eq_ignore_ascii_case("toml") => Ok(()),
        _ => Err(Failure::Input(format!("--save-scene: found {}, allowed: a file .toml", path.display()))),
    }
}

/// The bytes of a scene file to be written at a path.
pub(crate) fn scene_file(scene: &Scene, path: &Path) -> Result<Vec<u8>, Failure> {
    Ok(scene.to_toml(path.parent().unwrap_or(Path::new("")))?.into_bytes())
}
