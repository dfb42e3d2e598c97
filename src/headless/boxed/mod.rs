//! Volumes that fit into no memory, drawn by a backend that draws volumes in memory: region by region, front to back, each time as many slabs (SPEC §11) as
//! the box of voxels holds that bears on them. Where a region is opaque, no more boxes are read.

mod channel;
mod chunks;

use std::ops::Range;

use web_time::Instant;

use super::{Headless, joined, milliseconds_since};
use crate::error::RenderError;
use crate::error::setting::SettingError;
use crate::geometry::view_geometry::ViewGeometry;
use crate::image::Image;
use crate::image::channels::Joining;
use crate::part::{self, Content, Extreme, Identity, MergeError, Part};
use crate::rendering::{Backend, Rendering};
use crate::scene::Scene;
use crate::scene::names::{COMPOSITINGS, name_of};
use crate::settings::camera::Camera;
use crate::settings::splatting::{Compositing, Order};
use crate::settings::window::{Region, Window};
use crate::stats::{Counts, Stats};
use crate::volume::range::range_of;
use crate::volume::{StreamedVolume, check_grids};
pub(super) use channel::opaque_values;
use chunks::{Chunks, Filled};

/// The side in pixels of the regions that an image is divided into. A region whose voxels do not fit into memory is divided further.
const SIDE: u32 = 256;

/// The minimum side of a region.
const LEAST_SIDE: u32 = 8;

/// A view of a volume that is read while it is drawn.
#[derive(Clone, Debug)]
pub(super) struct BoxedView {
    volume: StreamedVolume,
    scene: Scene,
    /// What draws the boxes.
    backend: Backend,
}

impl BoxedView {
    /// # Errors
    /// If a setting of the scene is invalid, or not supported for a volume that is streamed.
    pub(super) fn new(volume: StreamedVolume, scene: &Scene, backend: Backend) -> Result<Self, RenderError> {
        check(&volume, scene, backend)?;
        Ok(Self { volume, scene: scene.clone(), backend })
    }

    pub(super) fn backend(&self) -> Backend {
        self.backend
    }

    pub(super) fn volume(&self) -> &StreamedVolume {
        &self.volume
    }

    pub(super) fn scene(&self) -> &Scene {
        &self.scene
    }

    pub(super) fn set_scene(&mut self, scene: &Scene) -> Result<(), RenderError> {
        check(&self.volume, scene, self.backend)?;
        self.scene = scene.clone();
        Ok(())
    }

    pub(super) fn set_camera(&mut self, camera: Camera) -> Result<(), SettingError> {
        camera.check()?;
        self.scene.camera = camera;
        Ok(())
    }

    /// Draws a frame.
    pub(super) fn draw(&self, headless: &Headless) -> Result<Rendering, RenderError> {
        let start = Instant::now();
        if part::joining(&self.volume.sample, &self.scene).is_some() {
            return joined::draw(&self.volume, &self.scene, headless);
        }
        let size = [self.scene.image.width, self.scene.image.height];
        let (parts, stats) = self.parts(&Window::whole(size), headless)?;
        let image = Image::merge(parts).map_err(unmerged)?;
        Ok(Rendering { image, stats: Stats { frame_ms: milliseconds_since(start), ..stats } })
    }

    /// Draws a part of the image.
    pub(super) fn draw_part(&self, window: &Window, headless: &Headless) -> Result<(Part, Stats), RenderError> {
        let start = Instant::now();
        let (parts, stats) = self.parts(window, headless)?;
        let part = side_by_side(parts, window);
        Ok((part?, Stats { frame_ms: milliseconds_since(start), ..stats }))
    }

    /// The parts of a window, one for each region.
    fn parts(&self, window: &Window, headless: &Headless) -> Result<(Vec<Part>, Stats), RenderError> {
        let Self { volume, scene, backend } = self;
        part::check(&volume.sample, scene, window)?;
        let scene = scene.explicit(&volume.sample);
        let view =
            ViewGeometry::new(volume.grid(), &scene.camera, &scene.splatting, [scene.image.width, scene.image.height])?;
        let mut walk = Walk {
            identity: Identity::of((&volume.clone().into(), &scene), &view)?,
            slabs: window.within(&view.slabs_of(volume.grid())),
            chunks: Chunks::new(volume, &scene, &view)?,
            scene,
            headless,
            range: volume.first.values.range().or_else(|| range_of(volume.sample.values().iter())).unwrap_or([0.0; 2]),
            parts: Vec::new(),
            stats: Stats::default(),
        };
        for region in tiles(&window.region, SIDE) {
            walk.region(region)?;
        }
        let Walk { chunks, parts, stats, .. } = walk;
        let store = volume.with_sample(chunks.counts());
        let counts = Counts { voxels_total: volume.grid().voxels(), ..stats.counts };
        let [width, height] = view.size;
        // Nothing may have been drawn.
        let backend = backend.name().to_owned();
        Ok((parts, Stats { store: Some(store), counts, width, height, backend, ..stats }))
    }
}

/// The drawing of some regions.
struct Walk<'a> {
    scene: Scene,
    identity: Identity,
    /// The slabs that are drawn.
    slabs: Range<i32>,
    chunks: Chunks<'a>,
    /// What draws the boxes.
    headless: &'a Headless,
    /// The minimum and maximum of the first channel's values, or of its sample's; there is no other channel where pixels choose values.
    range: [f32; 2],
    parts: Vec<Part>,
    stats: Stats,
}

impl Walk<'_> {
    /// Draws a region, or where the voxels behind it fit into no memory, its quarters.
    fn region(&mut self, region: Region) -> Result<(), RenderError> {
        let Some(steps) = self.chunks.steps(&region, &self.slabs) else {
            let side = region.width.max(region.height).div_ceil(2);
            if side < LEAST_SIDE {
                return Err(self.chunks.too_large().into());
            }
            return tiles(&region, side).into_iter().try_for_each(|region| self.region(region));
        };
        let mut drawn = self.empty(&Window { slabs: self.slabs.start..self.slabs.start, region });
        for (slabs, needed) in steps {
            if self.is_opaque(&drawn.content) {
                break;
            }
            let window = Window { slabs, region };
            let next = match needed.map_or(Ok(None), |needed| self.chunks.read(needed))? {
                Some(filled) => self.part(filled, &window)?,
                None => self.empty(&window),
            };
            drawn = Part::join([drawn, next]).map_err(unmerged)?;
        }
        // What opaque pixels hide counts as drawn.
        drawn.window.slabs = self.slabs.clone();
        self.parts.push(drawn);
        Ok(())
    }

    /// Draws a window from the voxels that it needs. A channel of which nothing is seen changes nothing, so that its table is left out.
    fn part(&mut self, (volume, channels): Filled, window: &Window) -> Result<Part, RenderError> {
        // Means are noted as they are.
        let is_choice = self.identity.has_extremes() && self.scene.splatting.compositing != Compositing::Average;
        let range = if is_choice { range_of(volume.values().iter()) } else { None };
        let (mut content, stats) = self.headless.draw_box(volume, &self.scene.of_channels(&channels), window)?;
        if let Some(range) = range {
            in_range(&mut content.extremes, range, self.range);
        }
        let (counts, prepare_ms) = (self.stats.counts, self.stats.prepare_ms);
        self.stats = Stats { prepare_ms: prepare_ms + stats.prepare_ms, ..stats };
        let own = std::mem::replace(&mut self.stats.counts, counts);
        self.stats.counts.add_channel(&own);
        Ok(Part::named(self.identity.clone(), window.clone(), vec![content]))
    }

    /// A window that shows nothing.
    fn empty(&self, window: &Window) -> Part {
        let content = Content::empty(window.region.pixels(), self.identity.has_extremes());
        Part::named(self.identity.clone(), window.clone(), vec![content])
    }

    /// Whether nothing behind what is drawn can be seen.
    fn is_opaque(&self, content: &Content) -> bool {
        let splatting = &self.scene.splatting;
        let enough = match splatting.compositing {
            Compositing::Surface => 1.0,
            _ => splatting.opacity_threshold as f32,
        };
        splatting.compositing.hides()
            && splatting.culling
            && splatting.order == Order::FrontToBack
            && content.colors.iter().all(|color| color[3] >= enough)
    }
}

/// Converts values that pixels chose, places in the range of a box's values, into places in the range of all.
fn in_range(extremes: &mut [Extreme], own: [f32; 2], all: [f32; 2]) {
    let span = |[low, high]: [f32; 2]| if high > low { f64::from(high) - f64::from(low) } else { 1.0 };
    for extreme in extremes.iter_mut().filter(|extreme| extreme.counted >= Extreme::POINT) {
        let value = f64::from(own[0]) + f64::from(extreme.value) * span(own);
        extreme.value = ((value - f64::from(all[0])) / span(all)) as f32;
    }
}

/// Checks that a scene can be drawn box by box by a backend.
#[cfg_attr(not(feature = "cpu"), expect(unused_variables, reason = "only the native backend refuses settings"))]
fn check(volume: &StreamedVolume, scene: &Scene, backend: Backend) -> Result<(), RenderError> {
    scene.check()?;
    check_grids((&volume.first, &volume.further))?;
    scene.check_volume(&volume.sample)?;
    scene.check_streamed(volume)?;
    #[cfg(feature = "cpu")]
    if backend == Backend::Cpu {
        crate::cpu::check(scene)?;
    }
    let of = if part::joining(&volume.sample, scene) == Some(Joining::Nearest) {
        // First hits tell which channel is the nearest, and parts do not carry them.
        "several channels of a volume"
    } else if part::has_labelled_means(&volume.sample, scene) {
        "tables of labels of a volume"
    } else {
        return Ok(());
    };
    let compositing = name_of(COMPOSITINGS, scene.splatting.compositing);
    let found = format!("{compositing:?} with splatting.classification = \"after\" for {of} that is streamed");
    Err(SettingError::new("splatting.compositing", found, "another one, or more memory").into())
}

/// The squares of some side, or what is left of them, that cover a region.
fn tiles(region: &Region, side: u32) -> Vec<Region> {
    let along = |start: u32, length: u32| (start..start + length).step_by(side as usize);
    let rest = |at: u32, start: u32, length: u32| side.min(start + length - at);
    let rows = along(region.y, region.height);
    let row = |y: u32| {
        let height = rest(y, region.y, region.height);
        let tile = move |x: u32| Region { x, y, width: rest(x, region.x, region.width), height };
        along(region.x, region.width).map(tile)
    };
    rows.flat_map(row).collect()
}

/// One part of the regions of a window.
fn side_by_side(parts: Vec<Part>, window: &Window) -> Result<Part, RenderError> {
    let Window { region, .. } = window;
    let mut content = Content::default();
    let mut identity = None;
    for part in parts {
        let own = part.window.region;
        if identity.is_none() {
            content = Content::empty(region.pixels(), part.identity.has_extremes());
        }
        copy((&part.content.colors, &own), (&mut content.colors, region));
        copy((&part.content.extremes, &own), (&mut content.extremes, region));
        identity = Some(part.identity);
    }
    let identity = identity.ok_or_else(|| RenderError::Readback("a window has no region".to_owned()))?;
    Ok(Part::named(identity, window.clone(), vec![content]))
}

/// Copies the pixels of a region, row by row, to where they are in one around it; pixels may carry nothing.
fn copy<T: Copy>((from, own): (&[T], &Region), (to, region): (&mut [T], &Region)) {
    for (row, y) in from.chunks_exact(own.width as usize).zip(own.y - region.y..) {
        let first = (own.x - region.x + y * region.width) as usize;
        to[first..first + row.len()].copy_from_slice(row);
    }
}

/// Parts of one walk merge.
fn unmerged(error: MergeError) -> RenderError {
    RenderError::Readback(error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_cover_a_region_once() {
        let region = Region { x: 5, y: 7, width: 21, height: 9 };
        let all = tiles(&region, 8);
        assert_eq!(all.iter().map(Region::pixels).sum::<usize>(), region.pixels());
        assert_eq!(all.len(), 6);
        for (at, tile) in all.iter().enumerate() {
            assert!(tile.columns().start >= 5 && tile.columns().end <= 26 && tile.rows().end <= 16, "{tile}");
            assert!(all[..at].iter().all(|other| !other.overlaps(tile)), "{tile}");
        }
    }
}
