//! What windows of a view are drawn from: boxes of voxels in memory, or with a GPU pages on it.

use std::ops::Range;

use super::channel::VoxelBox;
use super::chunks::{Chunks, Step};
#[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
use super::open_pixels::OpenPixels;
#[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
use super::pages::{Pages, Paging};
use crate::error::RenderError;
use crate::geometry::view_geometry::ViewGeometry;
use crate::headless::Headless;
use crate::headless::given_light::GivenLight;
use crate::part::Content;
use crate::scene::Scene;
use crate::settings::Gradient;
use crate::settings::window::{Region, Window};
use crate::stats::{Stats, StoreCounts};
use crate::volume::range::range_of;
use crate::volume::{StreamedVolume, Volume};

/// The side in pixels of the regions that an image is divided into where windows are drawn from boxes. A region whose voxels do not fit into memory is divided
/// further.
const SIDE: u32 = 256;

/// The part of a region's time that its quarters must take less than, so that they are drawn instead.
const DIVIDED: f64 = 0.8;

/// What windows of a view are drawn from.
pub(super) enum Source<'a> {
    Boxes(Box<Chunks<'a>>),
    #[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
    Pages(Box<Pages<'a>>),
}

/// The voxels that a window needs.
pub(super) enum Needed {
    Box(VoxelBox),
    #[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
    Pages(Paging),
}

/// A window's pixels, the statistics of drawing them, and the range among whose values pixels chose theirs, if that is not the volume's.
type Drawn = (Content, Stats, Option<[f32; 2]>);

impl<'a> Source<'a> {
    /// # Errors
    /// If the chunks are too many, or the device has no room for pages.
    #[cfg_attr(
        not(all(feature = "gpu", not(target_arch = "wasm32"))),
        expect(unused_variables, reason = "only a GPU has pages")
    )]
    pub(super) fn new(
        headless: &'a Headless,
        volume: &'a StreamedVolume,
        scene: &Scene,
        view: &ViewGeometry,
    ) -> Result<Self, RenderError> {
        #[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
        if let Some(gpu) = headless.gpu()
            && let Some(pages) = Pages::new(gpu, volume, scene, view)?
        {
            return Ok(Self::Pages(Box::new(pages)));
        }
        Ok(Self::Boxes(Box::new(Chunks::new(volume, scene, view)?)))
    }

    pub(super) fn chunks(&self) -> &Chunks<'a> {
        match self {
            Self::Boxes(chunks) => chunks,
            #[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
            Self::Pages(pages) => pages.chunks(),
        }
    }

    /// What has been read.
    pub(super) fn counts(&self) -> StoreCounts {
        match self {
            Self::Boxes(chunks) => chunks.counts(),
            #[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
            Self::Pages(pages) => pages.counts(),
        }
    }

    /// The side in pixels of the regions that are drawn one after the other. A box around all that an oblique region sees is mostly empty of it, and pages are not.
    pub(super) fn side(&self) -> u32 {
        match self {
            Self::Boxes(_) => SIDE,
            #[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
            Self::Pages(_) => u32::MAX,
        }
    }

    /// The minimum side of a region. A few pixels' boxes are about as large as a pixel's, and their pages are more.
    pub(super) fn least_side(&self) -> u32 {
        match self {
            Self::Boxes(_) => 8,
            #[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
            Self::Pages(_) => 1,
        }
    }

    /// The first step in which slabs behind a region's open pixels are drawn, all pixels if nothing hides anything; `None` if its quarters are to be drawn instead.
    ///
    /// # Errors
    /// If a store cannot be read.
    #[cfg_attr(
        not(all(feature = "gpu", not(target_arch = "wasm32"))),
        expect(unused_variables, reason = "only pages depend on pixels")
    )]
    pub(super) fn step(
        &mut self,
        (region, quarters): (&Region, &[Region]),
        is_open: Option<&[bool]>,
        slabs: &Range<i32>,
    ) -> Result<Option<Step<Needed>>, RenderError> {
        let step = match self {
            Self::Boxes(chunks) => {
                box_step(chunks, (region, quarters), slabs).map(|(slabs, needed)| (slabs, needed.map(Needed::Box)))
            }
            #[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
            Self::Pages(pages) => {
                let open = match is_open {
                    Some(is_open) => OpenPixels::new(*region, is_open.iter().copied()),
                    None => OpenPixels::all(*region),
                };
                let step = pages.step((region, &open), slabs, is_open.is_some())?;
                step.map(|(slabs, needed)| (slabs, needed.map(Needed::Pages)))
            }
        };
        Ok(step)
    }

    /// Draws a window of a scene from the voxels that it needs; `None` if nothing of them can be seen.
    ///
    /// # Errors
    /// If a store cannot be read, or the backend fails.
    pub(super) fn draw(
        &mut self,
        headless: &Headless,
        needed: Needed,
        (scene, light): (&Scene, Option<&GivenLight>),
        (window, closed): (&Window, Option<&[bool]>),
    ) -> Result<Option<Drawn>, RenderError> {
        match (self, needed) {
            (Self::Boxes(chunks), Needed::Box(within)) => {
                let Some((volume, channels)) = chunks.read(within)? else { return Ok(None) };
                let range = range_of(volume.values().iter());
                // A channel of which nothing is seen changes nothing, so that its table is left out.
                let mut scene = scene.of_channels(&channels);
                let has_labels = volume.channels().any(Volume::is_known_label_map);
                if scene.shading.gradient == Gradient::Membership && !has_labels {
                    scene.shading.gradient = Gradient::Differences;
                }
                let (content, stats) = headless.draw_box(volume, &scene, (window, closed), light)?;
                Ok(Some((content, stats, range)))
            }
            #[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
            (Self::Pages(pages), Needed::Pages(paging)) => {
                let (content, stats) = pages.draw(paging, (window, closed), light)?;
                Ok(Some((content, stats, None)))
            }
            #[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
            // Each is drawn from what it asked for.
            _ => Ok(None),
        }
    }
}

/// The first step in which slabs behind a region are drawn from a box; `None` if its quarters are to be drawn instead.
fn box_step(chunks: &Chunks<'_>, (region, quarters): (&Region, &[Region]), slabs: &Range<i32>) -> Option<Step> {
    let whole = chunks.deepest(region, slabs.clone());
    let time = |step: &Option<Step>| chunks.voxels_per_slab(step.as_ref());
    let of_quarters = quarters.iter().map(|quarter| time(&chunks.deepest(quarter, slabs.clone())));
    // A flat box around what an oblique region sees is mostly empty of it.
    let is_divided = quarters.len() > 1 && of_quarters.sum::<f64>() < DIVIDED * time(&whole);
    whole.filter(|_| !is_divided)
}
