//! Volumes that fit into no memory: drawn while they are read.

use std::path::Path;
use std::sync::Arc;

use sheetsplat::Scene;
use sheetsplat::cpu::StreamRenderer;
use sheetsplat::headless::{Backend, Rendering};
use sheetsplat::volume::{IndexedStore, Store, StoreIndex, Volume, sample};

use crate::arguments::Input;
use crate::failure::Failure;

/// A store that is drawn while it is read.
pub(crate) struct Streamed {
    store: Arc<dyn Store>,
    level: usize,
    /// The bytes that values may take.
    memory: u64,
}

impl Streamed {
    /// The scene's volume, if it has one channel, can be read by boxes, and fits into no memory; `None` for any other. A file that cannot be opened gives
    /// `None` too: reading it as a whole then tells why.
    pub(crate) fn of(input: &Input, scene: &Scene) -> Option<Self> {
        let is_on_cpu = match input.backend {
            Backend::Cpu => true,
            Backend::Auto => input.adapter.is_none(),
            _ => false,
        };
        if !is_on_cpu {
            return None;
        }
        let options = input.reading.options();
        let memory = options.memory_limit();
        let store = scene.open_store(&options)?.ok()?;
        let level = scene.level.unwrap_or(0) as usize;
        let of = store.levels().get(level)?;
        let bytes = |dims: [u32; 3]| dims.into_iter().fold(4, |bytes: u64, n| bytes.saturating_mul(n.into()));
        // Every thread that draws or reads holds some chunks, beside those that wait for other tiles.
        let least = bytes(of.chunk.to_array()).saturating_mul(4 * rayon::current_num_threads() as u64);
        (bytes(of.grid.dims.to_array()) > memory && least <= memory / 2).then_some(Self { store, level, memory })
    }

    /// The same store with the index in a file, if one is stated.
    pub(crate) fn indexed(self, input: &Input, index: Option<&Path>) -> Result<Self, Failure> {
        let Some(path) = index else { return Ok(self) };
        let origin = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|error| Failure::Input(format!("{origin}: {error}")))?;
        let index = StoreIndex::decode(&origin, &text);
        let store = index.and_then(|index| IndexedStore::new(Arc::clone(&self.store), index, &origin));
        let store = Arc::new(store.map_err(|error| input.failure(error))?);
        Ok(Self { store, ..self })
    }

    /// Reads a sample of the values, from which everything is chosen that the scene leaves open.
    pub(crate) fn sample(&self, input: &Input) -> Result<Volume, Failure> {
        let start = std::time::Instant::now();
        let volume = sample(&input.name, &*self.store, self.memory / 8).map_err(|error| input.failure(error))?;
        let whole = self.store.levels()[self.level].grid.dims;
        log::info!("{}: {whole} voxels, a sample of {} read in {:.1?}", input.name, volume.dims(), start.elapsed());
        Ok(volume)
    }

    /// Draws the scene, whose settings no longer depend on the volume.
    pub(crate) fn draw(&self, input: &Input, sample: &Volume, scene: &Scene) -> Result<Rendering, Failure> {
        let store = Arc::clone(&self.store);
        let rendering =
            StreamRenderer::new(store, self.level, sample, scene, self.memory / 2).and_then(|renderer| renderer.draw());
        rendering.map_err(|error| input.failure(error))
    }
}
