//! Parts of an image (SPEC §11): some slabs, some pixels, or both, drawn anywhere and at any time, that merge exactly into the whole image.
//!
//! [`Headless::render_part`](crate::headless::Headless::render_part) draws a part of a scene's image, and [`Image::merge`](crate::Image::merge) puts the parts
//! together.
//!
//! ```
//! use sheetsplat::headless::{Backend, Headless, HeadlessOptions};
//! use sheetsplat::scene::VolumeSource;
//! use sheetsplat::settings::{Region, Window};
//! use sheetsplat::{Image, Scene};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let settings = ["image={width=64,height=64}".to_owned(), "splatting.opacity_threshold=1".to_owned()];
//! let scene = Scene::from_volume(VolumeSource::Builtin("head:48".to_owned()), &settings)?;
//! let headless = Headless::new(&HeadlessOptions::default().with_backend(Backend::Cpu))?;
//! let region = Region::whole([64, 64]);
//! let front = headless.render_part(&scene, &Window { slabs: -1000..0, region })?;
//! let back = headless.render_part(&scene, &Window { slabs: 0..1000, region })?;
//! let image = Image::merge([back, front])?;
//! assert_eq!(image.pixels.len(), 64 * 64);
//! # Ok(())
//! # }
//! ```

mod content;
#[cfg(feature = "codecs")]
mod description;
#[cfg(feature = "codecs")]
mod exr;
#[cfg(feature = "codecs")]
mod file;
mod fingerprint;
mod mean;
mod merge;
#[cfg(feature = "codecs")]
mod npz;
mod resolve;
mod split;

use std::ops::Range;

use glam::UVec3;

pub use content::{Content, Extreme};
pub use mean::MeanTables;
pub(crate) use mean::note_labels;
pub use merge::MergeError;
#[cfg(feature = "cpu")]
pub(crate) use resolve::Resolver;
pub use split::split;

use crate::error::RenderError;
use crate::error::setting::SettingError;
use crate::geometry::view_geometry::ViewGeometry;
use crate::image::channels::Joining;
use crate::scene::{OpenVolume, Scene};
use crate::settings::splatting::{Classification, Compositing, Method, Order};
use crate::settings::window::Window;
use crate::volume::Volume;
use content::Rule;

/// A part of an image: f32 pixels without the background, and what identifies them.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// A name for errors: the file, or what the part shows.
    pub name: String,
    /// The image that it is a part of.
    pub identity: Identity,
    /// The slabs and pixels that it shows.
    pub window: Window,
    /// Its pixels.
    pub content: Content,
    /// Where channels share no sheets (SPEC §10) and their images are added up, the pixels of the channels after the first; otherwise empty.
    pub further: Vec<Content>,
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
        Ok(Self::named(identity, window.clone(), vec![content]))
    }

    /// A part with its slabs and pixels as its name.
    pub(crate) fn named(identity: Identity, window: Window, contents: Vec<Content>) -> Self {
        let Window { slabs: Range { start, end }, region } = &window;
        let name = format!("slabs {start}..{end} of region {region}");
        let mut contents = contents.into_iter();
        let (content, further) = (contents.next().unwrap_or_default(), contents.collect());
        Self { name, identity, window, content, further }
    }

    /// The pixels of all images that are added up.
    pub(crate) fn contents(&self) -> impl Iterator<Item = &Content> {
        std::iter::once(&self.content).chain(&self.further)
    }
}

impl Identity {
    /// What the parts of a scene of a volume have in common.
    pub(crate) fn of((volume, scene): (&OpenVolume, &Scene), view: &ViewGeometry) -> Result<Self, RenderError> {
        let refused = |error: crate::scene::SceneError| SettingError::new("scene", error.to_string(), "another scene");
        Ok(Self {
            fingerprint: fingerprint::fingerprint(volume, scene).map_err(refused)?,
            size: view.size,
            slabs: view.slabs_of(volume.grid()),
            compositing: scene.splatting.compositing,
            classification: scene.classification(volume.sample()),
            order: scene.splatting.order,
            background: scene.image.background,
            images: if adds_up(volume.sample(), scene) { volume.sample().channels().count() } else { 1 },
            means: MeanTables::of(volume.sample(), scene),
        })
    }

    /// Whether pixels carry extremes.
    pub(crate) fn has_extremes(&self) -> bool {
        self.rule().has_extremes()
    }

    /// Whether pixels note labels, whose tables classify means.
    pub(crate) fn notes_labels(&self) -> bool {
        self.means.iter().any(MeanTables::has_labels)
    }

    fn rule(&self) -> Rule {
        Rule { compositing: self.compositing, classification: self.classification }
    }
}

/// The most images that are added up.
const MAX_IMAGES: usize = 256;

/// Whether each of a volume's channels has an image of its own, and these are added up. Of surfaces the nearest is shown, which is also that of the nearest
/// part that has one, so that their parts are of one image.
pub(crate) fn adds_up(volume: &Volume, scene: &Scene) -> bool {
    let joining = Joining::of(scene.splatting.compositing, scene.classification(volume));
    joining == Some(Joining::Sum) && !volume.further().is_empty()
}

/// Checks that a renderer, which draws all channels at once, can draw parts of a scene.
///
/// # Errors
/// If channels share no sheets.
#[cfg(any(feature = "cpu", feature = "gpu"))]
pub(crate) fn check_sheets(volume: &Volume, scene: &Scene) -> Result<(), SettingError> {
    if !adds_up(volume, scene) {
        return Ok(());
    }
    let compositing = crate::scene::names::name_of(crate::scene::names::COMPOSITINGS, scene.splatting.compositing);
    let found = format!("\"{compositing}\" of several channels for a part of an image");
    Err(SettingError::new(
        "splatting.compositing",
        found,
        "\"linear\", \"exponential\" or \"xray\", or Headless::draw_part",
    ))
}

/// Checks, before anything is drawn, that a scene has parts, and that a window is one.
///
/// # Errors
/// If the scene's method is not image-aligned, an economy is in use, its compositing has no parts, or the window does not lie in the image.
pub(crate) fn check(volume: &Volume, scene: &Scene, window: &Window) -> Result<(), SettingError> {
    let splatting = &scene.splatting;
    let channels = volume.channels().count();
    if adds_up(volume, scene) && channels > MAX_IMAGES {
        let found = format!("{channels} channels whose images are added up for a part of an image");
        return Err(SettingError::new("volume", found, format!("at most {MAX_IMAGES}")));
    }
    if splatting.method != Method::ImageAligned {
        let method = crate::scene::names::name_of(crate::scene::names::METHODS, splatting.method);
        let found = format!("\"{method}\" for a part of an image");
        return Err(SettingError::new("splatting.method", found, "\"image-aligned\""));
    }
    if let Some(economy) = splatting.experimental.in_use() {
        let found = format!("{} for a part of an image", economy.value);
        return Err(SettingError::new(economy.key, found, economy.off.to_string()));
    }
    let Range { start, end } = window.slabs;
    if start > end {
        return Err(SettingError::new("slabs", format!("{start}..{end}"), "A..B, A at most B"));
    }
    window.region.check([scene.image.width, scene.image.height])
}
