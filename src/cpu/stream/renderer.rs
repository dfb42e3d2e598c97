//! A view of a volume that is read while it is drawn.

use std::sync::Arc;

use fearless_simd::Level;
use glam::UVec3;
use web_time::Instant;

use super::Stream;
use super::pool::{Pool, Reads};
use super::ranges::Ranges;
use super::source::{Source, Splats};
use crate::after::normalization::Normalization;
use crate::cpu::after::{self, Matter};
use crate::cpu::frame::{Drawing, Host, Reused, Voxels};
use crate::cpu::project::Projection;
use crate::cpu::sheets::{COLUMNS, ROWS};
use crate::cpu::simd::{self, Simd};
use crate::cpu::{check, statistics};
use crate::error::RenderError;
use crate::error::setting::SettingError;
use crate::finished::FinishedScene;
use crate::geometry::view_geometry::ViewGeometry;
use crate::image::Image;
use crate::kernel::Kernel;
use crate::light::{KeptLight, StreamedLight};
use crate::lists::iso_range::ValueSet;
use crate::parallel::{ThreadPool, ThreadPoolBuilder, current_num_threads};
use crate::part::{self, Content, Part};
use crate::rendering::Rendering;
use crate::scene::Scene;
use crate::scene::open::CHUNKS_OF_THREAD;
use crate::settings::camera::Camera;
use crate::settings::splatting::Classification;
use crate::settings::window::{Region, Window};
use crate::stats::{Stats, StoreCounts};
use crate::volume::range::range_of;
use crate::volume::{StoreLevel, StreamedLevel, StreamedVolume, Values, Volume};

/// The minimum number of threads that read: a server, or a disk, answers several requests in the time of one.
const LEAST_READERS: usize = 8;

/// The maximum number of chunks that a tile lets be read at once.
const MOST_AHEAD: u64 = 16;

/// Bytes that boxes of voxels may take however little memory chunks may.
const LEAST_HELD: u64 = 64 << 20;

/// A view of a volume that is drawn on the CPU while it is read.
#[derive(Clone, Debug)]
pub struct StreamRenderer {
    volume: StreamedVolume,
    /// The volume's only values.
    values: StreamedLevel,
    finished: FinishedScene,
    /// The minimum and maximum of the sample's values; `None` if all are holes.
    sampled: Option<[f32; 2]>,
    simd: Simd,
    level: Level,
    light: StreamedLight,
    /// Light that is made elsewhere.
    given: Option<KeptLight>,
}

impl StreamRenderer {
    /// Prepares a volume to be drawn in a scene, whose own volume is ignored. What the scene leaves open, such as the transfer function and
    /// the camera's frame, is chosen for the volume's sample.
    ///
    /// # Errors
    /// If the store has no such level, or its chunks are too many or too large; if the volume has labels, colours or several channels; or if a setting is not supported: exact interpolation, and methods other than image-aligned.
    pub fn new(volume: StreamedVolume, scene: &Scene) -> Result<Self, RenderError> {
        let Some(values) = volume.only_values().cloned() else {
            let found = match &*volume.channels {
                [_, _, ..] => "several channels",
                [only] if only.labels.is_some() => "labels",
                _ => "colours",
            };
            let allowed =
                "one channel of values without labels and colours, or `Headless`, which draws others box by box";
            return Err(SettingError::new("volume", format!("{found} of a volume that is streamed"), allowed).into());
        };
        let levels = values.store.levels();
        if values.level >= levels.len() {
            let allowed = format!("0 to {}", levels.len() - 1);
            return Err(SettingError::new("volume.level", values.level.to_string(), allowed).into());
        }
        Source::check(&levels[values.level])?;
        let (simd, level) = simd::chosen()?;
        let finished = finished(&volume, scene)?;
        let sampled = range_of(volume.sample.values().iter());
        let (light, given) = (StreamedLight::default(), None);
        Ok(Self { volume, values, finished, sampled, simd, level, light, given })
    }

    /// Draws in light that is made elsewhere.
    pub(crate) fn set_light(&mut self, light: KeptLight) {
        self.given = Some(light);
    }

    /// The volume that is drawn.
    pub(crate) fn volume(&self) -> &StreamedVolume {
        &self.volume
    }

    /// The settings.
    pub fn scene(&self) -> &Scene {
        &self.finished.scene
    }

    /// Changes the scene, whose own volume is ignored.
    ///
    /// # Errors
    /// As for [`Self::new`]; then nothing changes.
    pub fn set_scene(&mut self, scene: &Scene) -> Result<(), RenderError> {
        self.finished = finished(&self.volume, scene)?;
        Ok(())
    }

    /// Changes the camera.
    ///
    /// # Errors
    /// If a setting is not allowed; then nothing changes.
    pub fn set_camera(&mut self, camera: Camera) -> Result<(), SettingError> {
        self.finished.set_camera(camera)
    }

    /// Draws a frame on the threads of the current rayon pool, or on fewer if memory holds chunks for fewer, while others read. Neither their number nor the memory changes a bit of the
    /// image. Of a volume classified after splatting voxels and sections are not counted.
    ///
    /// # Errors
    /// If the store cannot be read, or the scene exceeds a limit, such as the number of slabs.
    pub fn draw(&self) -> Result<Rendering, RenderError> {
        let start = Instant::now();
        let (scene, view) = self.finished.framed(&self.volume.sample, self.volume.grid())?;
        let size = view.size;
        let window = Window { slabs: Window::ALL_SLABS, region: Region::whole(size) };
        let (content, stats) = self.drawing(&scene, (view, window, false), start)?;
        let image = Image { width: size[0], height: size[1], pixels: content.colors };
        Ok(Rendering { image, stats })
    }

    /// Draws a part of the image (SPEC §11), and returns it with its statistics. Only chunks are read that matter to it.
    ///
    /// # Errors
    /// As for [`Self::draw`], if the scene has no parts, or the window does not lie in the image.
    pub fn draw_part(&self, window: &Window) -> Result<(Part, Stats), RenderError> {
        let start = Instant::now();
        part::check(&self.volume.sample, self.scene(), window)?;
        let (scene, view) = self.finished.framed(&self.volume.sample, self.volume.grid())?;
        let opened = window.opened(&view.slabs_of(self.volume.grid()));
        let (content, stats) = self.drawing(&scene, (view, opened, true), start)?;
        let part = Part::new((&self.volume.clone().into(), self.scene()), &view, window, content)?;
        Ok((part, stats))
    }

    /// Draws a window of the image, as pixels or as a part.
    fn drawing(
        &self,
        scene: &Scene,
        (view, window, is_part): (ViewGeometry, Window, bool),
        start: Instant,
    ) -> Result<(Content, Stats), RenderError> {
        let (size, grid) = (view.size, *self.volume.grid());
        let threads = self.threads();
        let stream = Arc::new(self.stream((scene, view), &window)?);
        let lights = match self.given.clone() {
            // Given light has the sample's grid.
            Some(mut given) => {
                let lights = given.lights((&self.volume.sample, &self.finished.transfer), scene, &scene.camera)?;
                lights.map(|lights| Arc::new(lights.on(&grid)))
            }
            None => self.light.lights((&self.volume, &self.finished.transfer), scene)?,
        };
        let host = Host { window, is_part, first_hit: None, surfaces: None, lights };
        let Drawing { content, counts, .. } = match scene.splatting.classification {
            Classification::After => {
                let nothing = Volume::piece(grid.resized(UVec3::ZERO), Values::default());
                let (numbers, is_range_known) = self.numbers();
                let matter = Matter::Streamed { stream: &stream, nothing: &nothing, numbers, is_range_known };
                let frame = after::Frame::new(0, (matter, self.finished.transfer.first()), scene, view, host);
                let threads = threads.min(self.holders(frame.held_bytes())?);
                on_threads(threads, || after::Frame::draw(&[frame], self.level))?
            }
            _ => on_threads(threads, || {
                Reused::default().draw((&grid, Voxels::Streamed(&stream)), scene, view, host, self.level)
            })?,
        };
        if let Some(failure) = stream.pool.take_failure() {
            return Err(failure.into());
        }
        let Reads { chunks, bytes, most_held, .. } = stream.pool.reads();
        let StreamedLevel { store, level, .. } = &self.values;
        let mut read = StoreCounts::default();
        read.level = *level as u64;
        read.chunks_total = store.levels()[*level].chunks().as_u64vec3().element_product();
        read.chunks_read = chunks.len() as u64;
        read.bytes_read = bytes;
        read.chunk_bytes = most_held;
        let store = self.volume.with_sample(read);
        let stats = Stats { store: Some(store), ..statistics(self.simd, size, counts, start) };
        Ok((content, self.light.noted_in(&self.volume, stats)))
    }

    /// The number of threads that draw: as many as there are, or as memory holds the chunks of.
    fn threads(&self) -> usize {
        let most = self.volume.memory / self.chunk_bytes().saturating_mul(CHUNKS_OF_THREAD).max(1);
        current_num_threads().min(usize::try_from(most).unwrap_or(usize::MAX)).max(1)
    }

    /// The bytes of a chunk's values.
    fn chunk_bytes(&self) -> u64 {
        let level = &self.values.store.levels()[self.values.level];
        Source::side(level.chunk, &level.grid).as_u64vec3().element_product().saturating_mul(4)
    }

    /// The number of threads whose boxes of voxels fit into memory, which they copy from chunks, given the bytes of one.
    ///
    /// # Errors
    /// If not even one fits.
    fn holders(&self, bytes: f64) -> Result<usize, SettingError> {
        let memory = self.volume.memory.max(LEAST_HELD);
        let holders = memory as f64 / bytes;
        if holders >= 1.0 {
            return Ok(holders as usize);
        }
        let found =
            format!("{}, in which {COLUMNS}×{ROWS} pixels see a box of voxels of {bytes:.0} bytes", self.values.level);
        let allowed = format!("a coarser level, more pixels, or more memory than {memory} bytes for a box");
        Err(SettingError::new("volume.level", found, allowed))
    }

    /// The map from values to the numbers that are interpolated, and whether its range is that of all values.
    fn numbers(&self) -> (Normalization, bool) {
        let known = self.values.range();
        let range = known.or(self.sampled).unwrap_or([0.0; 2]);
        (Normalization::new(range.map(f64::from)), known.is_some())
    }

    /// The store in a view.
    fn stream(&self, (scene, view): (&Scene, ViewGeometry), window: &Window) -> Result<Stream, SettingError> {
        let (StreamedLevel { store, level, .. }, memory) = (&self.values, self.volume.memory);
        let (splatting, grid) = (&scene.splatting, store.levels()[*level].grid);
        let slabs = window.with_lead(splatting.compositing, Classification::Before).slabs;
        let threads = self.threads();
        let side = Source::side(store.levels()[*level].chunk, &grid);
        // A quarter of the memory for chunks that are being read.
        let room = usize::try_from(memory / self.chunk_bytes().saturating_mul(4).max(1)).unwrap_or(usize::MAX);
        let readers = pool(threads.max(LEAST_READERS).min(room).max(1))?;
        let ahead = memory / self.chunk_bytes().max(1) / (2 * threads as u64);
        Ok(Stream {
            ahead: ahead.clamp(2, MOST_AHEAD) as usize,
            source: Source {
                store: Arc::clone(store),
                level: *level,
                grid,
                side,
                ranges: Ranges::new(StoreLevel { grid, chunk: side }.chunks().element_product()),
                splats: (splatting.classification == Classification::Before).then(|| Splats {
                    transfer: self.finished.transfer.first().clone(),
                    shown: ValueSet::of_tables(&self.finished.transfer.first().tables(None)),
                    clipped: scene.clip.voxels(&grid, splatting.radius),
                    projection: Projection::new(view, splatting.order, &slabs),
                    support: Kernel::new(splatting.radius, splatting.falloff).support(),
                }),
            },
            pool: Pool::new(usize::try_from(memory).unwrap_or(usize::MAX)),
            readers,
        })
    }
}

fn pool(threads: usize) -> Result<ThreadPool, SettingError> {
    let pool = ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map_err(|error| SettingError::new("threads", error.to_string(), "threads that can be started"))
}

/// Draws on the current threads, or on fewer.
fn on_threads<R: Send>(threads: usize, draw: impl FnOnce() -> R + Send) -> Result<R, SettingError> {
    if threads >= current_num_threads() { Ok(draw()) } else { Ok(pool(threads)?.install(draw)) }
}

/// The scene that a volume is drawn in.
fn finished(volume: &StreamedVolume, scene: &Scene) -> Result<FinishedScene, RenderError> {
    let finished = FinishedScene::streamed(volume, scene)?;
    check(scene).map(|()| finished)
}
