//! Pictures with the text of how they were made.

use std::path::Path;

use super::names::Names;
use super::sources::Sources;
use super::text::Provenance;
use crate::image::described::Kind;
use crate::image::{Image, ImageError, MAX_TEXT, PngDepth};
use crate::scene::{Scene, SceneError};
use crate::stats::Stats;

impl Provenance {
    /// How a picture at a path is made: a scene of the whole image, in which everything is stated ([`Scene::explicit`]); what its volume was read from; the
    /// statistics of the frame; and the names of the annotations beside it.
    ///
    /// # Errors
    /// If the scene cannot be written as TOML.
    pub fn of(
        path: &Path,
        scene: &Scene,
        sources: &Sources,
        stats: &Stats,
        annotate: &[String],
    ) -> Result<Self, SceneError> {
        let names = Names::new(path, scene);
        let Stats { backend, adapter, .. } = stats;
        let version = env!("CARGO_PKG_VERSION").to_owned();
        let mut made = Self::new(version, backend.clone(), names.scene(scene)?);
        made.adapter = (backend == "gpu" && !adapter.is_empty()).then(|| adapter.clone());
        made.annotate = annotate.to_vec();
        made.streamed = sources.is_streamed;
        made.files = sources.named(&names);
        made.values.clone_from(&sources.values);
        Ok(made)
    }

    /// The bytes of a picture's file with this text. A file whose format has no room for it (`.npy`) has none; nor has a picture whose scene is too long,
    /// which a warning tells.
    ///
    /// # Errors
    /// As for [`Image::encode`].
    pub fn encode(&self, image: &Image, path: &Path, depth: PngDepth) -> Result<Vec<u8>, ImageError> {
        let Some(kind) = Kind::of(path, depth)? else { return image.encode(path, depth) };
        let text = self.with_pixels(kind, image).and_then(|made| made.to_json());
        let text = text.map_err(|source| ImageError::Encode { path: path.to_owned(), source: source.into() })?;
        if text.len() > MAX_TEXT {
            log::warn!("{}: its scene, of {} bytes, is too long to be kept in the picture", path.display(), text.len());
            return image.encode(path, depth);
        }
        image.encode_described(path, depth, Some(&text))
    }

    /// With the fields that tell of the pixels.
    pub(super) fn with_pixels(&self, kind: Kind, image: &Image) -> serde_json::Result<Self> {
        let depth = match kind {
            Kind::Png(PngDepth::Eight) => Some(8),
            Kind::Png(PngDepth::Sixteen) => Some(16),
            Kind::Float => None,
        };
        let mut made = Self { depth, pixels: kind.hash(image), ..self.clone() };
        made.check = made.checked()?;
        Ok(made)
    }

    /// How the file holds its pixels.
    pub(super) fn kind(&self) -> Kind {
        match self.depth {
            Some(16) => Kind::Png(PngDepth::Sixteen),
            Some(_) => Kind::Png(PngDepth::Eight),
            None => Kind::Float,
        }
    }
}
