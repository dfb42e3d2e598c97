//! Volumes that fit into no memory, drawn by a backend that draws volumes in memory: region by region, front to back, each time as many slabs (SPEC §11) as
//! the box of voxels holds that bears on them. Where a region is opaque, no more boxes are read.

#[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
mod block;
mod channel;
mod chunks;
mod kept;
#[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
mod needed_pages;
#[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
mod open_pixels;
#[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
mod page_pool;
#[cfg(all(feature = "gpu", not(target_arch = "wasm32")))]
mod pages;
mod source;

use std::ops::Range;

use web_time::Instant;

use super::given_light::GivenLight;
use super::timed::milliseconds_since;
use super::{Headless, joined};
use crate::error::RenderError;
use crate::error::setting::SettingError;
use crate::finished::FinishedScene;
use crate::geometry::view_geometry::ViewGeometry;
use crate::image::Image;
use crate::light::StreamedLight;
use crate::part::{self, Content, Extreme, Identity, MergeError, Part};
use crate::rendering::{Backend, Rendering};
use crate::scene::Scene;
use crate::settings::camera::Camera;
use crate::settings::window::{Region, Window};
use crate::stats::{Counts, Stats};
use crate::volume::StreamedVolume;
use crate::volume::range::range_of;
pub(super) use channel::opaque_values;
use source::{Needed, Source};

/// A view of a volume that is read while it is drawn.
#[derive(Clone, Debug)]
pub(super) struct BoxedView {
    volume: StreamedVolume,
    finished: FinishedScene,
    /// What draws the boxes.
    backend: Backend,
    light: StreamedLight,
    /// Light that is made elsewhere.
    given: Option<GivenLight>,
}

impl BoxedView {
    /// # Errors
    /// If a setting of the scene is invalid, or not supported for a volume that is streamed.
    pub(super) fn new(volume: StreamedVolume, scene: &Scene, backend: Backend) -> Result<Self, RenderError> {
        let finished = finished(&volume, scene, backend)?;
        Ok(Self { volume, finished, backend, light: StreamedLight::default(), given: None })
    }

    pub(super) fn backend(&self) -> Backend {
        self.backend
    }

    /// Draws in light that is made elsewhere.
    pub(super) fn set_light(&mut self, light: GivenLight) {
        self.given = Some(light);
    }

    pub(super) fn volume(&self) -> &StreamedVolume {
        &self.volume
    }

    pub(super) fn scene(&self) -> &Scene {
        &self.finished.scene
    }

    pub(super) fn set_scene(&mut self, scene: &Scene) -> Result<(), RenderError> {
        self.finished = finished(&self.volume, scene, self.backend)?;
        Ok(())
    }

    pub(super) fn set_camera(&mut self, camera: Camera) -> Result<(), SettingError> {
        self.finished.set_camera(camera)
    }

    /// Draws a frame.
    pub(super) fn draw(&self, headless: &Headless) -> Result<Rendering, RenderError> {
        let start = Instant::now();
        if part::adds_up(&self.volume.sample, self.scene()) {
            return joined::draw((&self.volume, self.scene()), self.given.as_ref(), headless);
        }
        let (parts, stats) = self.parts(&Window::whole(self.finished.size()), headless)?;
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
        let Self { volume, finished, backend, .. } = self;
        part::check(&volume.sample, self.scene(), window)?;
        let scene = finished.scene.explicit(&volume.sample);
        let view = ViewGeometry::new(volume.grid(), &scene.camera, &scene.splatting, finished.size())?;
        let mut walk = Walk {
            identity: Identity::of((&volume.clone().into(), &scene), &view)?,
            slabs: window.within(&view.slabs_of(volume.grid())),
            source: Source::new(headless, volume, &scene, &view)?,
            light: match &self.given {
                Some(given) => Some(given.clone()),
                None => GivenLight::of_streamed(&self.light, (volume, &scene), *backend)?,
            },
            scene,
            headless,
            range: volume
                .channels
                .first()
                .values
                .range()
                .or_else(|| range_of(volume.sample.values().iter()))
                .unwrap_or([0.0; 2]),
            parts: Vec::new(),
            stats: Stats::default(),
        };
        for region in tiles(&window.region, walk.source.side()) {
            walk.region(region)?;
        }
        let Walk { source, parts, stats, .. } = walk;
        let store = volume.with_sample(source.counts());
        let counts = Counts { voxels_total: volume.grid().voxels(), ..stats.counts };
        let [width, height] = view.size;
        // Nothing may have been drawn.
        let backend = backend.name().to_owned();
        let stats = Stats { store: Some(store), counts, width, height, backend, ..stats };
        Ok((parts, self.light.noted_in(volume, stats)))
    }
}

/// The drawing of some regions.
struct Walk<'a> {
    scene: Scene,
    identity: Identity,
    /// The slabs that are drawn.
    slabs: Range<i32>,
    source: Source<'a>,
    /// The light of the whole volume.
    light: Option<GivenLight>,
    /// What draws the boxes.
    headless: &'a Headless,
    /// The minimum and maximum of the first channel's values, or of its sample's; there is no other channel where pixels choose values.
    range: [f32; 2],
    parts: Vec<Part>,
    stats: Stats,
}

impl Walk<'_> {
    /// Draws a region.
    fn region(&mut self, region: Region) -> Result<(), RenderError> {
        let nothing = Content::empty(region.pixels(), self.identity.has_extremes());
        // What opaque pixels hide counts as drawn.
        let (slabs, mut content) = (self.slabs.clone(), self.behind(region, self.slabs.clone(), nothing)?);
        if self.identity.notes_labels() {
            self.source.chunks().note_labels(&self.scene, &region, &mut content)?;
        }
        self.parts.push(Part::named(self.identity.clone(), Window { slabs, region }, content));
        Ok(())
    }

    /// Draws slabs behind what a region shows already, as many at a time as fit into memory with the voxels that the region's open pixels need. Where those of
    /// a single slab do not fit, or quarters of the region share fewer voxels, which are read for each of them, the quarters are drawn.
    fn behind(&mut self, region: Region, mut slabs: Range<i32>, mut drawn: Content) -> Result<Content, RenderError> {
        while slabs.start < slabs.end {
            let Some(open) = self.open_box(&drawn, &region) else { break };
            let longer = open.width.max(open.height);
            let quarters = tiles(&open, longer.div_ceil(2).max(self.source.least_side()));
            let is_open = self.open_pixels(&cut_out(&drawn, &region, &open));
            let Some((step, needed)) = self.source.step((&open, &quarters), is_open.as_deref(), &slabs)? else {
                if longer <= self.source.least_side() {
                    return Err(self.source.chunks().too_large().into());
                }
                for quarter in quarters {
                    let behind = self.behind(quarter, slabs.clone(), cut_out(&drawn, &region, &quarter))?;
                    put((&behind, &quarter), (&mut drawn, &region));
                }
                break;
            };
            slabs.start = step.end;
            if let Some(needed) = needed {
                let front = cut_out(&drawn, &region, &open);
                let window = Window { slabs: step, region: open };
                if let Some(joined) = self.join(front, needed, window)? {
                    put((&joined, &open), (&mut drawn, &region));
                }
            }
        }
        Ok(drawn)
    }

    /// Draws a window from the voxels that it needs, behind what its region shows already; `None` if nothing of them can be seen.
    fn join(&mut self, front: Content, needed: Needed, window: Window) -> Result<Option<Content>, RenderError> {
        let closed = self.open_pixels(&front).map(|open| open.iter().map(|is_open| !is_open).collect::<Vec<_>>());
        let closed = closed.filter(|closed| closed.contains(&true));
        let Some(content) = self.draw(needed, &window, closed.as_deref())? else { return Ok(None) };
        let part =
            |slabs, content: Content| Part::named(self.identity.clone(), Window { slabs, ..window.clone() }, content);
        let start = window.slabs.start;
        let joined = Part::join([part(start - 1..start, front), part(window.slabs.clone(), content)]);
        Ok(joined.map_err(unmerged)?.contents.into_iter().next())
    }

    /// Draws a window from the voxels that it needs.
    fn draw(
        &mut self,
        needed: Needed,
        window: &Window,
        closed: Option<&[bool]>,
    ) -> Result<Option<Content>, RenderError> {
        let Some((mut content, stats, range)) =
            self.source.draw(self.headless, needed, (&self.scene, self.light.as_ref()), (window, closed))?
        else {
            return Ok(None);
        };
        // Means are noted as they are.
        let is_choice = self.identity.has_extremes() && !self.scene.splatting.compositing.is_average();
        if let Some(range) = range.filter(|_| is_choice) {
            in_range(&mut content.extremes, range, self.range);
        }
        let (counts, prepare_ms) = (self.stats.counts, self.stats.prepare_ms);
        self.stats = Stats { prepare_ms: prepare_ms + stats.prepare_ms, ..stats };
        let own = std::mem::replace(&mut self.stats.counts, counts);
        self.stats.counts.add_channel(&own);
        Ok(Some(content))
    }

    /// For each pixel whether anything can be seen behind it; `None` if nothing hides what lies behind it.
    fn open_pixels(&self, content: &Content) -> Option<Vec<bool>> {
        let opaque = self.scene.splatting.culls_from()? as f32;
        Some(content.colors.iter().map(|color| color[3] < opaque).collect())
    }

    /// The smallest box of a region's pixels behind which anything can be seen; `None` if there is no such pixel.
    fn open_box(&self, content: &Content, region: &Region) -> Option<Region> {
        let Some(opaque) = self.scene.splatting.culls_from().map(|opacity| opacity as f32) else {
            return Some(*region);
        };
        let (mut low, mut high) = ([u32::MAX; 2], [0; 2]);
        for (color, at) in content.colors.iter().zip(0..).filter(|(color, _)| color[3] < opaque) {
            debug_assert!(color[3].is_finite());
            let place: [u32; 2] = [at % region.width, at / region.width];
            for axis in 0..2 {
                (low[axis], high[axis]) = (low[axis].min(place[axis]), high[axis].max(place[axis]));
            }
        }
        let [width, height] = [0, 1].map(|axis| (high[axis] + 1).saturating_sub(low[axis]));
        (width > 0).then(|| Region { x: region.x + low[0], y: region.y + low[1], width, height })
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

/// The scene that a volume is drawn in box by box by a backend.
#[cfg_attr(not(feature = "cpu"), expect(unused_variables, reason = "only the native backend refuses settings"))]
fn finished(volume: &StreamedVolume, scene: &Scene, backend: Backend) -> Result<FinishedScene, RenderError> {
    let finished = FinishedScene::streamed(volume, scene)?;
    #[cfg(feature = "cpu")]
    if backend == Backend::Cpu {
        crate::cpu::check(scene)?;
    }
    Ok(finished)
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
        if identity.is_none() {
            content = Content::empty(region.pixels(), part.identity.has_extremes());
        }
        put((part.contents.first(), &part.window.region), (&mut content, region));
        identity = Some(part.identity);
    }
    let identity = identity.ok_or_else(|| RenderError::Readback("a window has no region".to_owned()))?;
    Ok(Part::named(identity, window.clone(), content))
}

/// The pixels of a region within another one.
fn cut_out(content: &Content, region: &Region, own: &Region) -> Content {
    fn part<T: Copy>(pixels: &[T], region: &Region, own: &Region) -> Vec<T> {
        let rows = pixels.chunks_exact(region.width as usize).skip((own.y - region.y) as usize);
        let first = (own.x - region.x) as usize;
        rows.take(own.height as usize).flat_map(|row| &row[first..first + own.width as usize]).copied().collect()
    }
    Content { colors: part(&content.colors, region, own), extremes: part(&content.extremes, region, own) }
}

/// Puts the pixels of a region where they are in one around it.
fn put((from, own): (&Content, &Region), (to, region): (&mut Content, &Region)) {
    copy((&from.colors, own), (&mut to.colors, region));
    copy((&from.extremes, own), (&mut to.extremes, region));
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
