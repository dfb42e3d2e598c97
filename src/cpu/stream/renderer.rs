//! A view of a store.

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
use crate::cpu::frame::{Drawing, Frame, Host, Voxels};
use crate::cpu::project::Projection;
use crate::cpu::simd::{self, Simd};
use crate::cpu::{check, statistics};
use crate::error::RenderError;
use crate::error::setting::SettingError;
use crate::geometry::view_geometry::ViewGeometry;
use crate::image::Image;
use crate::kernel::Kernel;
use crate::rendering::Rendering;
use crate::scene::Scene;
use crate::scene::names::{METHODS, name_of};
use crate::settings::splatting::{Classification, Interpolation, Method};
use crate::settings::transfer_function::TransferFunction;
use crate::settings::window::{Region, Window};
use crate::stats::{Stats, StoreCounts};
use crate::volume::range::range_of;
use crate::volume::{Grid, Store, StoreLevel, Volume, VolumeError};

/// The minimum number of threads that read: a server, or a disk, answers several requests in the time of one.
const LEAST_READERS: usize = 8;

/// The maximum number of chunks that a tile lets be read at once.
const MOST_AHEAD: u64 = 16;

/// Bytes that boxes of voxels may take however little memory chunks may.
const LEAST_HELD: usize = 64 << 20;

/// Why a store could not be drawn.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StreamError {
    /// The store could not be read.
    #[error(transparent)]
    Volume(#[from] VolumeError),
    /// The scene cannot be drawn.
    #[error(transparent)]
    Render(#[from] RenderError),
}

impl From<SettingError> for StreamError {
    fn from(error: SettingError) -> Self {
        Self::Render(error.into())
    }
}

/// A view of a store that is drawn on the CPU without being in memory as a whole.
#[derive(Clone, Debug)]
pub struct StreamRenderer {
    store: Arc<dyn Store>,
    level: usize,
    scene: Scene,
    transfer: TransferFunction,
    /// The minimum and maximum of the sample's values; `None` if all are holes.
    sampled: Option<[f32; 2]>,
    /// The bytes that chunks may hold.
    memory: usize,
    simd: Simd,
    vectors: Level,
}

impl StreamRenderer {
    /// Prepares a level of a store to be drawn in a scene, whose own volume is ignored. What the scene leaves open, such as the transfer function and
    /// the camera's frame, is chosen for a sample of the values: a coarser level, or a subset of the voxels, with the same box. Chunks may hold
    /// `memory` bytes together, beyond which those are dropped and read again that no tile is drawn from.
    ///
    /// # Errors
    /// If the store has no such level, or its chunks are too many or too large; if the scene has several channels, or the sample has labels, colours or
    /// several channels; or if a setting is not supported: exact interpolation, and methods other than image-aligned.
    pub fn new(
        store: Arc<dyn Store>,
        level: usize,
        sample: &Volume,
        scene: &Scene,
        memory: u64,
    ) -> Result<Self, StreamError> {
        scene.check()?;
        scene.check_volume(sample)?;
        check(scene)?;
        let levels = store.levels().len();
        if level >= levels {
            return Err(SettingError::new("volume.level", level.to_string(), format!("0 to {}", levels - 1)).into());
        }
        check_sample(sample, scene)?;
        Source::check(&store.levels()[level])?;
        let (simd, vectors) = simd::chosen()?;
        let transfer = scene.resolve(sample);
        let scene = scene.framed(sample, &transfer);
        check_streamed(&scene)?;
        let sampled = range_of(sample.values().iter().copied());
        let memory = usize::try_from(memory).unwrap_or(usize::MAX);
        Ok(Self { store, level, scene, transfer, sampled, memory, simd, vectors })
    }

    /// The settings, with what the sample decided.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Draws a frame on the threads of the current rayon pool, while others read. Neither their number nor the memory changes a bit of the
    /// image. Of a volume classified after splatting voxels and sections are not counted.
    ///
    /// # Errors
    /// If the store cannot be read, or the scene exceeds a limit, such as the number of slabs.
    pub fn draw(&self) -> Result<Rendering, StreamError> {
        let start = Instant::now();
        let (scene, grid) = (&self.scene, self.store.levels()[self.level].grid);
        let size = [scene.image.width, scene.image.height];
        let view = ViewGeometry::new(&grid, &scene.camera, &scene.splatting, size)?;
        let window = Window { slabs: Window::ALL_SLABS, region: Region::whole(size) };
        let stream = Arc::new(self.stream(view, &window)?);
        let host = Host { window, is_part: false, first_hit: None, surfaces: None };
        let Drawing { content, counts, .. } = match scene.splatting.classification {
            Classification::After => {
                let nothing = Volume::piece(Grid { dims: UVec3::ZERO, ..grid }, Vec::new());
                let (numbers, is_range_known) = self.numbers();
                let matter = Matter::Streamed { stream: &stream, nothing: &nothing, numbers, is_range_known };
                let frame = after::Frame::new(0, (matter, &self.transfer), scene, view, host);
                self.check_held(frame.held_bytes())?;
                after::Frame::draw(&[frame], self.vectors)
            }
            _ => Frame::new(&grid, Voxels::Streamed(&stream), scene, view, host, self.vectors).draw(self.vectors),
        };
        if let Some(failure) = stream.pool.take_failure() {
            return Err(failure.into());
        }
        let Reads { chunks, bytes, most_held, .. } = stream.pool.reads();
        let image = Image { width: size[0], height: size[1], pixels: content.colors };
        let store = StoreCounts {
            level: self.level as u64,
            chunks_total: self.store.levels()[self.level].chunks().as_u64vec3().element_product(),
            chunks_read: chunks.len() as u64,
            bytes_read: bytes,
            chunk_bytes: most_held,
        };
        let stats = Stats { store: Some(store), ..statistics(self.simd, size, counts, start) };
        Ok(Rendering { image, stats })
    }

    /// Checks that the boxes of voxels fit into memory that threads copy from chunks, given the bytes of one.
    fn check_held(&self, bytes: f64) -> Result<(), SettingError> {
        let all = bytes * rayon::current_num_threads() as f64;
        let memory = self.memory.max(LEAST_HELD);
        if all <= memory as f64 {
            return Ok(());
        }
        let found = format!("{}, in which 32×32 pixels see a box of voxels of {bytes:.0} bytes", self.level);
        let allowed =
            format!("a coarser level, more pixels, or more memory than {memory} bytes for all threads' boxes");
        Err(SettingError::new("volume.level", found, allowed))
    }

    /// The map from values to the numbers that are interpolated, and whether its range is that of all values.
    fn numbers(&self) -> (Normalization, bool) {
        let known = self.store.range(self.level);
        let range = known.or(self.sampled).unwrap_or([0.0; 2]);
        (Normalization::new(range.map(f64::from)), known.is_some())
    }

    /// The store in a view.
    fn stream(&self, view: ViewGeometry, window: &Window) -> Result<Stream, SettingError> {
        let Self { store, level, scene, transfer, .. } = self;
        let (splatting, grid) = (&scene.splatting, store.levels()[*level].grid);
        let slabs = window.with_lead(splatting.compositing, Classification::Before).slabs;
        let threads = rayon::current_num_threads();
        let readers = rayon::ThreadPoolBuilder::new().num_threads(threads.max(LEAST_READERS)).build();
        let readers =
            readers.map_err(|error| SettingError::new("threads", error.to_string(), "threads that can be started"))?;
        let side = Source::side(store.levels()[*level].chunk, &grid);
        let chunk_bytes = side.as_u64vec3().element_product().saturating_mul(4);
        let ahead = self.memory as u64 / chunk_bytes / (2 * threads as u64);
        Ok(Stream {
            ahead: ahead.clamp(2, MOST_AHEAD) as usize,
            source: Source {
                store: Arc::clone(store),
                level: *level,
                grid,
                side,
                ranges: Ranges::new(StoreLevel { grid, chunk: side }.chunks().element_product()),
                splats: (splatting.classification == Classification::Before).then(|| Splats {
                    transfer: transfer.clone(),
                    clipped: scene.clip.voxels(&grid, splatting.radius),
                    projection: Projection::new(view, splatting.order, &slabs),
                    support: Kernel::new(splatting.radius, splatting.falloff).support(),
                }),
            },
            pool: Pool::new(self.memory),
            readers,
        })
    }
}

/// Checks that a scene and the sample of its volume are of one channel of values.
fn check_sample(sample: &Volume, scene: &Scene) -> Result<(), SettingError> {
    let found = match sample {
        _ if !scene.further.is_empty() || !sample.further().is_empty() => "several channels",
        _ if sample.labels().is_some() => "labels",
        _ if sample.colors().is_some() => "colours",
        _ => return Ok(()),
    };
    let found = format!("{found} of a volume that is streamed");
    Err(SettingError::new("volume", found, "one channel of values without labels, or more memory"))
}

/// Checks that a scene whose classification is known can be streamed.
fn check_streamed(scene: &Scene) -> Result<(), SettingError> {
    let splatting = &scene.splatting;
    if (splatting.classification, splatting.interpolation) == (Classification::After, Interpolation::Exact) {
        let found = "\"exact\" for a volume that is streamed";
        return Err(SettingError::new("splatting.interpolation", found, "\"smooth\", or more memory"));
    }
    if splatting.method != Method::ImageAligned {
        let found = format!("{:?} for a volume that is streamed", name_of(METHODS, splatting.method));
        return Err(SettingError::new("splatting.method", found, "\"image-aligned\", or more memory"));
    }
    Ok(())
}
