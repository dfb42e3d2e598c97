//! Arguments that several subcommands take.

use std::time::Instant;

use clap::ValueEnum;
use clap::builder::PossibleValuesParser;
use sheetsplat::appearance::{Colormap, Preset};
use sheetsplat::headless::{Error, Headless, HeadlessOptions};
use sheetsplat::image::PngDepth;
use sheetsplat::scene::{Scene, SceneError, VolumeSource};
use sheetsplat::stats::Stats;
use sheetsplat::volume::Volume;

use crate::failure::Failure;

/// What to draw, and on which adapter.
#[derive(clap::Args)]
pub(crate) struct Input {
    /// A scene file (.toml), a volume file (.nrrd, .nhdr), or builtin:NAME[:N].
    #[arg(value_name = "INPUT")]
    pub(crate) name: String,
    /// Set a scene value, as in --set splatting.slab_width=2.0. Can be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub(crate) sets: Vec<String>,
    #[command(flatten)]
    look: Look,
    /// Part of the name of the adapter to use.
    #[arg(long, value_name = "NAME", env = "WGPU_ADAPTER_NAME")]
    pub(crate) adapter: Option<String>,
}

/// Appearance by name; short for --set of the scene's keys, and before them.
#[derive(clap::Args)]
struct Look {
    /// Transfer function, shading and compositing for a kind of data, where the scene gives none of its own: short for --set
    /// preset=NAME.
    #[arg(long, value_name = "NAME", value_parser = PossibleValuesParser::new(Preset::ALL.map(|(name, _)| name)))]
    preset: Option<String>,
    /// Colours over the values that show, in place of the scene's: short for --set transfer.colormap=NAME.
    #[arg(long, value_name = "NAME", value_parser = PossibleValuesParser::new(Colormap::ALL.map(|(name, _)| name)))]
    colormap: Option<String>,
}

impl Look {
    fn sets(&self) -> impl Iterator<Item = String> {
        let preset = self.preset.iter().map(|name| format!("preset={name}"));
        preset.chain(self.colormap.iter().map(|name| format!("transfer.colormap={name}")))
    }
}

impl Input {
    pub(crate) fn scene(&self) -> Result<Scene, SceneError> {
        self.scene_with(&self.sets)
    }

    /// The scene with these settings in place of the arguments'. By its extension a scene file; anything else is a volume.
    pub(crate) fn scene_with(&self, sets: &[String]) -> Result<Scene, SceneError> {
        let sets = &self.look.sets().chain(sets.iter().cloned()).collect::<Vec<_>>();
        match self.name.strip_prefix("builtin:") {
            Some(name) => Scene::from_volume(VolumeSource::Builtin(name.to_owned()), sets),
            None if self.name.ends_with(".toml") => Scene::open(self.name.as_ref(), sets),
            None => Scene::from_volume(VolumeSource::File(self.name.clone().into()), sets),
        }
    }

    pub(crate) fn load_volume(&self, scene: &Scene) -> Result<Volume, Failure> {
        let start = Instant::now();
        let volume = scene.load_volume().map_err(|error| self.failure(error))?;
        log::info!("{}: {} voxels, loaded in {:.1?}", self.name, volume.grid().dims, start.elapsed());
        Ok(volume)
    }

    pub(crate) fn headless(&self, profile: bool) -> Result<Headless, Failure> {
        let options = HeadlessOptions { adapter: self.adapter.clone(), profile, ..HeadlessOptions::default() };
        let start = Instant::now();
        let headless = Headless::new(&options).map_err(|error| Failure::Other(error.to_string()))?;
        log::info!("renderer ready after {:.1?}", start.elapsed());
        Ok(headless)
    }

    pub(crate) fn failure(&self, error: impl Into<Error>) -> Failure {
        Failure::of(error.into(), &self.name)
    }
}

#[derive(Clone, Copy, ValueEnum)]
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

/// Logs what a frame was drawn on, and how long it took.
pub(crate) fn log_frame(what: &str, stats: &Stats) {
    let Stats { adapter, rasterizer, prepare_ms, frame_ms, .. } = stats;
    log::info!("{what}: {:.1} ms by {rasterizer} on {adapter}", prepare_ms + frame_ms);
}
