//! A part of an image, and what identifies the image.

use std::ops::Range;

use glam::UVec3;

use super::check::adds_up;
use super::content::Content;
use super::fingerprint;
use super::mean::{MeanTables, note_labels};
use crate::error::RenderError;
use crate::error::setting::SettingError;
use crate::geometry::view_geometry::ViewGeometry;
use crate::scene::{OpenVolume, Scene, SceneError};
use crate::settings::splatting::{Classification, Compositing, Order, Splatting};
use crate::settings::window::Window;
use crate::volume::Channels;

/// A part of an image: f32 pixels without the background, and what identifies them.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// A name for errors: the file, or what the part shows.
    pub name: String,
    /// The image that it is a part of.
    pub identity: Identity,
    /// The slabs and pixels that it shows.
    pub window: Window,
    /// Its pixels: of every channel where channels share no sheets (SPEC §10) and their images are added up, otherwise of the only image.
    pub contents: Channels<Content>,
}

/// What the parts of one image have in common.
#[derive(Clone, Debug, PartialEq)]
pub struct Identity {
    /// A hash of everything that bears on the image, in hexadecimal digits: the volume's values, or if it is streamed, what identifies the store's; not paths,
    /// nor what draws.
    pub fingerprint: String,
    /// Width and height of the whole image.
    pub size: [u32; 2],
    /// The scene's slabs, from the first to the last that a kernel may reach.
    pub slabs: Range<i32>,
    /// How sheets are composited.
    pub compositing: Compositing,
    /// Where voxels, or pixels, are classified.
    pub classification: Classification,
    /// The order in which sheets are composited.
    pub order: Order,
    /// The opacity from which pixels count as opaque, and whether anything is culled: [`Image::merge`](crate::image::Image::merge) closes pixels by them (SPEC §6).
    pub opacity_threshold: f64,
    /// See [`Self::opacity_threshold`].
    pub culling: bool,
    /// Straight-alpha RGBA.
    pub background: [f64; 4],
    /// The number of images that are added up: that of the channels where these share no sheets, else 1.
    pub images: usize,
    /// For `average` classified after splatting, what classifies the means in each of these.
    pub means: Vec<MeanTables>,
}

impl Part {
    /// A part that a backend has drawn.
    pub(crate) fn new(
        (volume, scene): (&OpenVolume, &Scene),
        view: &ViewGeometry,
        window: &Window,
        mut content: Content,
    ) -> Result<Self, RenderError> {
        let identity = Identity::of((volume, scene), view)?;
        if let (true, OpenVolume::Whole(volume)) = (identity.notes_labels(), volume) {
            let grid = volume.grid();
            let label = |voxel: &UVec3| volume.label(grid.index_of(*voxel)).unwrap_or_default();
            let labels_at = |voxels: &[UVec3]| Ok::<_, RenderError>(voxels.iter().map(label).collect());
            note_labels((view, scene, grid), &window.region, &mut content, labels_at)?;
        }
        Ok(Self::named(identity, window.clone(), content))
    }

    /// Whether this is the part of a scene's image in a window, whatever drew it.
    ///
    /// # Errors
    /// If the scene cannot be written as TOML.
    pub fn shows(&self, volume: &OpenVolume, scene: &Scene, window: &Window) -> Result<bool, SceneError> {
        Ok(self.window == *window && self.identity.fingerprint == fingerprint::fingerprint(volume, scene)?)
    }

    /// A part with its slabs and pixels as its name.
    pub(crate) fn named(identity: Identity, window: Window, contents: impl Into<Channels<Content>>) -> Self {
        let Window { slabs: Range { start, end }, region } = &window;
        let name = format!("slabs {start}..{end} of region {region}");
        Self { name, identity, window, contents: contents.into() }
    }
}

impl Identity {
    /// What the parts of a scene of a volume have in common.
    pub(crate) fn of((volume, scene): (&OpenVolume, &Scene), view: &ViewGeometry) -> Result<Self, RenderError> {
        let refused = |error: SceneError| SettingError::new("scene", error.to_string(), "another scene");
        Ok(Self {
            fingerprint: fingerprint::fingerprint(volume, scene).map_err(refused)?,
            size: view.size,
            slabs: view.slabs_of(volume.grid()),
            compositing: scene.splatting.compositing,
            classification: scene.classification(volume.sample()),
            order: scene.splatting.order,
            opacity_threshold: scene.splatting.opacity_threshold,
            culling: scene.splatting.culling,
            background: scene.image.background,
            images: if adds_up(volume.sample(), scene) { volume.sample().channel_count() } else { 1 },
            means: MeanTables::of(volume.sample(), scene),
        })
    }

    /// Whether pixels carry extremes.
    pub(crate) fn has_extremes(&self) -> bool {
        self.compositing.chooses_values(self.classification)
    }

    /// Whether pixels note labels, whose tables classify means.
    pub(crate) fn notes_labels(&self) -> bool {
        self.means.iter().any(MeanTables::has_labels)
    }

    /// The settings by which its pixels are finished.
    pub(super) fn splatting(&self) -> Splatting {
        let Self { compositing, opacity_threshold, culling, .. } = *self;
        Splatting { compositing, opacity_threshold, culling, ..Splatting::default() }
    }
}
