//! Pictures drawn again and compared.

use std::path::{Path, PathBuf};

use super::Deviation;
use super::names::Names;
use super::sources::Sources;
use super::text::{Provenance, SourceFile};
use crate::golden::{Comparison, MadeOn, Subject, Tolerance};
use crate::headless::{Backend, Headless, HeadlessOptions, Rendering};
use crate::image::described::Kind;
use crate::image::{Image, PngDepth};
use crate::scene::{OpenVolume, Scene, VolumeSource};
use crate::volume::{Inputs, ReadOptions};

/// Draws pictures again from the scenes in their files, and compares their pixels.
///
/// ```
/// use sheetsplat::headless::{Backend, Headless, HeadlessOptions};
/// use sheetsplat::image::PngDepth;
/// use sheetsplat::provenance::{Provenance, Sources, Verifier};
/// use sheetsplat::scene::{OpenVolume, Scene, VolumeSource};
/// use sheetsplat::volume::Inputs;
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # let folder = tempfile::tempdir()?;
/// let path = folder.path().join("head.png");
/// let settings = ["image={width=32,height=32}".to_owned()];
/// let scene = Scene::from_volume(VolumeSource::Builtin("head:16".to_owned()), &settings)?;
/// let volume = OpenVolume::from(scene.load_volume()?);
/// let scene = scene.explicit(volume.sample());
/// let headless = Headless::new(&HeadlessOptions::default().with_backend(Backend::Cpu))?;
/// let drawn = headless.render_volume(volume.clone(), &scene)?;
/// let sources = Sources::of(Some(&volume), &scene, &Inputs::default());
/// let provenance = Provenance::of(&path, &scene, &sources, &drawn.stats, &[])?;
/// std::fs::write(&path, provenance.encode(&drawn.image, &path, PngDepth::Eight)?)?;
///
/// assert!(Verifier::default().verify(&path)?.reasons.is_empty());
/// # Ok(())
/// # }
/// ```
#[derive(Debug, Default)]
pub struct Verifier {
    options: ReadOptions,
    search: Vec<PathBuf>,
    volume: Option<OpenVolume>,
    oracle: u32,
    any_version: bool,
    /// Renderers, by their backend and their adapter's name.
    opened: Vec<(Backend, Option<String>, Headless)>,
}

/// The finding about a picture.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Verified {
    /// How it was made.
    pub provenance: Provenance,
    /// Why it is not the picture that it says it is; empty if it is.
    pub reasons: Vec<String>,
    /// The differences of its pixels from those that were drawn again, unless the sizes differ or a pixel is not finite.
    pub comparison: Option<Comparison>,
    /// How far the pixels that were drawn again are from the f64 evaluation, if that was asked for.
    pub deviation: Option<Deviation>,
}

/// Why a picture cannot be verified.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}: cannot be verified: {why}", path.display())]
#[non_exhaustive]
pub struct Unverifiable {
    /// The picture.
    pub path: PathBuf,
    /// The reason.
    pub why: String,
}

impl Verifier {
    /// With options for reading pictures and volumes.
    pub fn with_options(self, options: ReadOptions) -> Self {
        Self { options, ..self }
    }

    /// With folders in which files are looked for that are not in a picture's own folder.
    pub fn searching(self, folders: impl IntoIterator<Item = PathBuf>) -> Self {
        Self { search: folders.into_iter().collect(), ..self }
    }

    /// With a volume in place of those of the pictures' scenes, for volumes from memory.
    pub fn with_volume(self, volume: impl Into<OpenVolume>) -> Self {
        Self { volume: Some(volume.into()), ..self }
    }

    /// With some pixels of each picture evaluated in f64.
    pub fn with_oracle(self, pixels: u32) -> Self {
        Self { oracle: pixels, ..self }
    }

    /// With pictures of other versions, too, if their pixels are the same.
    pub fn of_any_version(self) -> Self {
        Self { any_version: true, ..self }
    }

    /// Draws a picture again and compares it: byte for byte, or where a GPU drew it, on the same adapter within [`Tolerance::default`].
    ///
    /// # Errors
    /// If the file holds no scene, a file that it names is missing, its volume came from memory and none is given, or it cannot be drawn.
    pub fn verify(&mut self, path: &Path) -> Result<Verified, Unverifiable> {
        let failed = |why: String| Unverifiable { path: path.to_owned(), why: own_words(path, why) };
        let read = Provenance::open(path, &self.options).map_err(|error| failed(error.to_string()))?;
        let made = read.ok_or_else(|| failed(nothing(path)))?;
        let picture = Image::open_with(path, &self.options).map_err(|error| failed(error.to_string()))?;
        let mut reasons = changed_file(&made, &picture);
        let version = env!("CARGO_PKG_VERSION");
        if made.version != version && !self.any_version {
            reasons.push(format!("another version: it was drawn by {}, and this is {version}", made.version));
        }
        match self.draw_again(path, &made, &mut reasons) {
            Ok((image, drawn, deviation)) => {
                let kind = made.kind();
                let tolerance = if made.backend == "gpu" { Tolerance::default() } else { Tolerance::EXACT };
                let comparison = Comparison::new(&picture, &image, tolerance).ok();
                let is_within = made.backend == "gpu" && comparison.as_ref().is_some_and(Comparison::passes);
                if made.backend == "gpu" {
                    self.check_adapter(&made, &drawn).map_err(failed)?;
                }
                reasons.extend(differences(kind, &picture, &image).filter(|_| !is_within));
                Ok(Verified { provenance: made, reasons, comparison, deviation })
            }
            // A file that was changed says no more.
            Err(why) if !reasons.is_empty() => {
                reasons.push(format!("it cannot be drawn again: {}", own_words(path, why)));
                Ok(Verified { provenance: made, reasons, comparison: None, deviation: None })
            }
            Err(why) => Err(failed(why)),
        }
    }

    /// The image that a picture's text describes, what drew it, and its deviation. The files and values behind the volume are compared.
    fn draw_again(
        &mut self,
        path: &Path,
        made: &Provenance,
        reasons: &mut Vec<String>,
    ) -> Result<(Image, Rendering, Option<Deviation>), String> {
        let told = |error: &dyn std::fmt::Display| error.to_string();
        let scene = made.scene(path, &self.search, &[]).map_err(|error| told(&error))?;
        let inputs = Inputs::default();
        let volume = match &self.volume {
            Some(volume) => volume.clone(),
            None if scene.channels.first().volume == VolumeSource::Memory => {
                return Err("its volume came from memory, and none is given".to_owned());
            }
            None => scene.open_volume_with(&self.options.clone().noted_in(&inputs)).map_err(|error| told(&error))?,
        };
        let sources = Sources::of(Some(&volume), &scene, &inputs);
        reasons.extend(changed_sources(made, &sources, &Names::new(path, &scene)));
        let (words, scene) = worded(&made.annotate, &scene, &volume)?;
        let headless = self.headless(made, &scene)?;
        let drawn = headless.render_volume(volume.clone(), &scene).map_err(|error| told(&error))?;
        let count = self.oracle;
        let deviation = (count > 0).then(|| Deviation::of(&volume, &scene, &drawn.image, count)).transpose();
        let image = words(&drawn.image, &scene, &volume);
        Ok((image, drawn, deviation.map_err(|error| format!("--oracle: {error}"))?))
    }

    /// The renderer that draws a picture again.
    fn headless(&mut self, made: &Provenance, scene: &Scene) -> Result<&Headless, String> {
        let backend: Backend = made.backend.parse()?;
        let adapter = made.adapter.clone();
        let known = self.opened.iter().position(|(of, named, _)| *of == backend && *named == adapter);
        let at = match known {
            Some(at) => at,
            None => {
                let mut options = HeadlessOptions::default().with_backend(backend);
                options.adapter.clone_from(&adapter);
                let opened = Headless::for_scenes(&options, [scene]);
                let opened = opened.map_err(|error| match &adapter {
                    Some(name) => format!("it was drawn on {name}, which is not here: {error}"),
                    None => error.to_string(),
                })?;
                self.opened.push((backend, adapter, opened));
                self.opened.len() - 1
            }
        };
        Ok(&self.opened[at].2)
    }

    /// Checks that the adapter is the same, because adapters round differently.
    fn check_adapter(&self, made: &Provenance, drawn: &Rendering) -> Result<(), String> {
        let here = drawn.made_on();
        let there = made.adapter.clone().map(|adapter| MadeOn { adapter, driver: String::new() });
        if MadeOn::same(there.as_ref(), here.as_ref()) {
            return Ok(());
        }
        let named = |of: &Option<MadeOn>| of.as_ref().map_or("an unknown adapter".to_owned(), |of| of.adapter.clone());
        Err(format!("it was drawn on {}, and this is {}; adapters round differently", named(&there), named(&here)))
    }
}

/// An error's words without the picture's name, which comes before them anyway.
fn own_words(path: &Path, why: String) -> String {
    why.strip_prefix(&format!("{}: ", path.display())).map(str::to_owned).unwrap_or(why)
}

/// Why there is nothing to verify.
fn nothing(path: &Path) -> String {
    let is_array = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("npy"));
    match is_array {
        true => "NPY files have no room for a scene; PNG and EXR files do".to_owned(),
        false => "it holds no scene, as pictures that sheetsplat render writes do".to_owned(),
    }
}

/// How a picture's file is not as it was written.
fn changed_file(made: &Provenance, picture: &Image) -> Vec<String> {
    let mut reasons = Vec::new();
    if made.checked().is_ok_and(|check| check != made.check) {
        reasons.push("its text was changed after it was drawn".to_owned());
    }
    if made.kind().hash(picture) != made.pixels {
        reasons.push("its pixels were changed after it was drawn".to_owned());
    }
    reasons
}

/// How what the volume was read from is not as it was.
fn changed_sources(made: &Provenance, sources: &Sources, names: &Names) -> Vec<String> {
    // Where a file was found elsewhere, its name is the same.
    let alone = |path: &str| path.rsplit('/').next().unwrap_or(path).to_owned();
    let mut reasons = Vec::new();
    for SourceFile { path, blake3 } in sources.named(names) {
        let Some(hash) = blake3 else { continue };
        let mut before = made.files.iter().filter(|file| alone(&file.path) == alone(&path)).peekable();
        if before.peek().is_none() {
            reasons.push(format!("the volume is read from {path}, and was not then"));
        } else if before.all(|file| file.blake3.as_ref().is_some_and(|before| *before != hash)) {
            reasons.push(format!("the file {path} was changed"));
        }
    }
    if made.streamed != sources.is_streamed {
        // Other hashes, though the voxels may be the same.
        return reasons;
    }
    let is_stated = !made.values.is_empty() && !sources.values.is_empty();
    if is_stated && made.values.len() != sources.values.len() {
        let (now, then) = (sources.values.len(), made.values.len());
        reasons.push(format!("the volume has {now} channels, and had {then}"));
    } else if is_stated {
        let pairs = (0..).zip(made.values.iter().zip(&sources.values));
        let changed = pairs.filter(|(_, (then, now))| then != now);
        let stores: Vec<&str> =
            made.files.iter().filter(|file| file.blake3.is_none()).map(|file| file.path.as_str()).collect();
        let of = if stores.is_empty() { String::new() } else { format!(" ({})", stores.join(", ")) };
        reasons
            .extend(changed.map(|(number, _): (usize, _)| format!("the values of channel {number} were changed{of}")));
    }
    reasons
}

/// How many pixels differ, and by how much; `None` if none does.
fn differences(kind: Kind, picture: &Image, again: &Image) -> Option<String> {
    let sizes = [picture, again].map(|image| [image.width, image.height]);
    if sizes[0] != sizes[1] {
        let [[w, h], [width, height]] = sizes;
        return Some(format!("it has {w}×{h} pixels, and {width}×{height} are drawn"));
    }
    let [then, now] = [picture, again].map(|image| kind.channels(image));
    let differing = then.iter().zip(&now).filter(|(then, now)| then != now).count();
    let full = match kind {
        Kind::Png(PngDepth::Sixteen) => Some(65535),
        Kind::Png(_) => Some(255),
        Kind::Float => None,
    };
    let channels = then.iter().flatten().zip(now.iter().flatten());
    let most = match full {
        Some(full) => {
            let most = channels.map(|(then, now)| then.abs_diff(*now)).max().unwrap_or(0);
            format!("{most} of {full}")
        }
        None => {
            // In total order NaN is larger than any number.
            let apart = channels.map(|(then, now)| (f32::from_bits(*then) - f32::from_bits(*now)).abs());
            format!("{:e}", apart.max_by(f32::total_cmp).unwrap_or(0.0))
        }
    };
    (differing > 0).then(|| format!("{differing} of {} pixels differ, by up to {most}", then.len()))
}

/// Draws words beside the picture of a scene.
type Words = Box<dyn Fn(&Image, &Scene, &OpenVolume) -> Image>;

/// The words beside a picture, given the scene of the whole image; and the scene of the picture.
#[cfg(feature = "annotate")]
fn worded(names: &[String], scene: &Scene, volume: &OpenVolume) -> Result<(Words, Scene), String> {
    let annotations: Result<Vec<_>, _> = names.iter().map(|name| name.parse::<crate::annotate::Annotation>()).collect();
    let annotations = annotations.map_err(|error| error.to_string())?;
    if annotations.is_empty() {
        return Ok((Box::new(|image, _, _| image.clone()), scene.clone()));
    }
    scene.check_for(volume.sample()).map_err(|error| error.to_string())?;
    let layout = crate::annotate::layout(&annotations, scene, volume.sample()).map_err(|error| error.to_string())?;
    let beside = layout.scene(scene);
    Ok((Box::new(move |image, scene, volume| layout.draw(image, scene, volume.sample())), beside))
}

#[cfg(not(feature = "annotate"))]
fn worded(names: &[String], scene: &Scene, _: &OpenVolume) -> Result<(Words, Scene), String> {
    match names {
        [] => Ok((Box::new(|image, _, _| image.clone()), scene.clone())),
        _ => Err("it has words beside it, and this program was built without them".to_owned()),
    }
}
