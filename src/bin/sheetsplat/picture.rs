//! Pictures that tell how they were made: those that are the input, and those that are written.

use std::cell::{OnceCell, RefCell};
use std::path::{Path, PathBuf};

use sheetsplat::headless::Backend;
use sheetsplat::image::{Image, PngDepth};
use sheetsplat::provenance::{Provenance, Sources};
use sheetsplat::scene::{OpenVolume, Scene, SceneError, VolumeSource};
use sheetsplat::stats::Stats;
use sheetsplat::volume::{Inputs, ReadOptions};

use crate::failure::Failure;
use crate::stdin;

/// A picture as the input, and the files that are read.
#[derive(clap::Args)]
pub(crate) struct Picture {
    /// A folder in which to look for the files of a picture's scene that are not in the picture's own folder. Can be repeated.
    #[arg(long, value_name = "DIR")]
    search: Vec<PathBuf>,
    /// How the picture was made, if it is the input.
    #[arg(skip)]
    read: OnceCell<Provenance>,
    /// The files of the volume that was opened last.
    #[arg(skip)]
    inputs: RefCell<Inputs>,
}

/// Whether an input is a picture, by its extension; volumes have others.
pub(crate) fn is_picture(name: &str) -> bool {
    let extension = Path::new(name).extension();
    extension.is_some_and(|extension| ["png", "exr"].iter().any(|known| extension.eq_ignore_ascii_case(known)))
}

/// Reads how a picture was made.
pub(crate) fn open(path: &Path, options: &ReadOptions) -> Result<Provenance, Failure> {
    let read = Provenance::open(path, options).map_err(|error| Failure::Input(error.to_string()))?;
    read.ok_or_else(|| {
        let allowed = "one that sheetsplat render wrote, without --no-metadata";
        Failure::Input(format!("{}: found a picture that holds no scene, allowed: {allowed}", path.display()))
    })
}

impl Picture {
    /// The scene of a picture, with overrides.
    pub(crate) fn scene(
        &self,
        path: &Path,
        sets: &[String],
        options: &ReadOptions,
    ) -> Result<Result<Scene, SceneError>, Failure> {
        let read = match self.read.get() {
            Some(read) => read,
            None => self.read.get_or_init({
                let read = open(path, options)?;
                || read
            }),
        };
        Ok(read.scene(path, &self.search, sets))
    }

    /// The names of the annotations of the picture that is the input.
    pub(crate) fn annotations(&self) -> &[String] {
        self.read.get().map_or(&[], Provenance::annotations)
    }

    /// The backend for one that was asked for: `auto` stands for the one without a driver that drew the input.
    pub(crate) fn backend(&self, asked: Backend) -> Backend {
        let drew = self.read.get().and_then(|read| read.backend().parse().ok());
        drew.filter(|drew| asked == Backend::Auto && *drew != Backend::Gpu).unwrap_or(asked)
    }

    /// A new list of files for a volume that is about to be opened.
    pub(crate) fn noting(&self) -> Inputs {
        let inputs = Inputs::default();
        self.inputs.replace(inputs.clone());
        inputs
    }

    /// The files and values behind the volume that was opened last.
    pub(crate) fn sources(&self, volume: &OpenVolume, scene: &Scene) -> Sources {
        Sources::of(Some(volume), &named(scene), &self.inputs.borrow())
    }
}

/// The scene without a volume from standard input, which no other process can read.
fn named(scene: &Scene) -> Scene {
    let mut scene = scene.clone();
    for channel in scene.channels.iter_mut() {
        if channel.volume.path() == Some(Path::new(stdin::NAME)) {
            channel.volume = VolumeSource::Memory;
        }
    }
    scene
}

/// The option to write pictures that tell nothing.
#[derive(clap::Args)]
pub(crate) struct Metadata {
    /// Leave the scene, the version, the backend and the hashes of the files out of PNG and EXR files.
    #[arg(long)]
    no_metadata: bool,
}

/// The text of a picture, beside its pixels.
pub(crate) struct Told<'a> {
    /// The scene of the whole image, with everything stated.
    pub(crate) scene: &'a Scene,
    pub(crate) sources: &'a Sources,
    pub(crate) stats: &'a Stats,
    /// The names of the annotations.
    pub(crate) annotate: &'a [String],
}

impl Metadata {
    /// Whether pictures tell nothing.
    pub(crate) fn is_bare(&self) -> bool {
        self.no_metadata
    }

    /// The files and values behind a volume, if pictures are to tell it.
    pub(crate) fn sources(&self, picture: &Picture, (volume, scene): (&OpenVolume, &Scene)) -> Option<Sources> {
        (!self.no_metadata).then(|| picture.sources(volume, scene))
    }

    /// The bytes of a picture's file.
    pub(crate) fn encode(
        &self,
        image: &Image,
        (path, depth): (&Path, PngDepth),
        told: Option<Told<'_>>,
    ) -> Result<Vec<u8>, Failure> {
        let Some(Told { scene, sources, stats, annotate }) = told.filter(|_| !self.no_metadata) else {
            return Ok(image.encode(path, depth)?);
        };
        let made = Provenance::of(path, &named(scene), sources, stats, annotate)?;
        Ok(made.encode(image, path, depth)?)
    }
}
