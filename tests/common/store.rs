//! A volume in memory that is read by boxes.

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use glam::UVec3;
use sheetsplat::volume::{
    Encoding, SampleType, Store, StoreFacts, StoreLevel, StreamedChannel, StreamedLevel, StreamedVolume, Texel, Volume,
    VolumeError,
};

/// A volume in memory as a store that notes what is read of it.
#[derive(Debug)]
pub(crate) struct MemoryStore {
    pub(crate) volume: Volume,
    pub(crate) levels: [StoreLevel; 1],
    /// The first voxels of all boxes that were read.
    pub(crate) read: Mutex<BTreeSet<[u32; 3]>>,
    /// Chunks from this plane on cannot be read.
    pub(crate) broken_from: Option<u32>,
    /// Whether it knows the range of all values.
    pub(crate) is_range_known: bool,
    /// What identifies it.
    pub(crate) identity: &'static str,
    /// The number of boxes that were read.
    pub(crate) reads: AtomicU64,
    pub(crate) decodes_whole_chunks: bool,
    /// The type of its samples, if it states one.
    pub(crate) sample_type: Option<SampleType>,
}

impl MemoryStore {
    pub(crate) fn new(volume: &Volume, chunk: UVec3) -> Self {
        let levels = [StoreLevel { grid: *volume.grid(), chunk }];
        Self {
            volume: volume.clone(),
            levels,
            read: Mutex::default(),
            broken_from: None,
            is_range_known: true,
            identity: "memory",
            reads: AtomicU64::new(0),
            decodes_whole_chunks: false,
            sample_type: None,
        }
    }

    fn value(&self, voxel: UVec3) -> f32 {
        self.volume.value(voxel)
    }
}

impl Store for MemoryStore {
    fn levels(&self) -> &[StoreLevel] {
        &self.levels
    }

    fn read(&self, level: usize, from: UVec3, dims: UVec3, values: &mut [f32]) -> Result<u64, VolumeError> {
        assert_eq!((level, values.len()), (0, dims.element_product() as usize));
        assert!((from + dims).cmple(self.volume.dims()).all(), "{from} {dims}");
        if self.broken_from.is_some_and(|plane| from.z + dims.z > plane) {
            let source = std::io::Error::other("the disk is gone");
            return Err(VolumeError::io("store", source));
        }
        self.reads.fetch_add(1, Ordering::Relaxed);
        self.read.lock().unwrap().insert(from.to_array());
        let voxels = (0..dims.z).flat_map(|z| (0..dims.y).flat_map(move |y| (0..dims.x).map(move |x| [x, y, z])));
        for (value, at) in values.iter_mut().zip(voxels) {
            *value = self.value(from + UVec3::from(at));
        }
        Ok(values.len() as u64)
    }

    fn has_colors(&self) -> bool {
        self.volume.colors().is_some()
    }

    fn read_colors(
        &self,
        level: usize,
        from: UVec3,
        dims: UVec3,
        values: &mut [f32],
        colors: &mut [Texel],
    ) -> Result<u64, VolumeError> {
        let bytes = self.read(level, from, dims, values)?;
        assert_eq!(colors.len(), values.len());
        let (own, grid) = (self.volume.colors().unwrap(), self.volume.grid());
        let voxels = (0..dims.z).flat_map(|z| (0..dims.y).flat_map(move |y| (0..dims.x).map(move |x| [x, y, z])));
        for (color, at) in colors.iter_mut().zip(voxels) {
            *color = own[grid.index_of(from + UVec3::from(at)) as usize];
        }
        Ok(bytes)
    }

    /// A chunk in which all voxels are 0 and without colours is not held.
    fn contains(&self, _: usize, chunk: UVec3) -> Result<bool, VolumeError> {
        let side = self.levels[0].chunk;
        let (from, end) = (chunk * side, ((chunk + 1) * side).min(self.volume.dims()));
        assert!(from.cmplt(end).all(), "chunk {chunk}");
        let mut voxels =
            (from.z..end.z).flat_map(|z| (from.y..end.y).flat_map(move |y| (from.x..end.x).map(move |x| [x, y, z])));
        Ok(self.has_colors() || voxels.any(|at| self.value(at.into()) != 0.0))
    }

    fn fill(&self) -> f32 {
        0.0
    }

    fn decodes_whole_chunks(&self) -> bool {
        self.decodes_whole_chunks
    }

    fn range(&self, _: usize) -> Option<[f32; 2]> {
        let ends = |[least, greatest]: [f32; 2], value: f32| [least.min(value), greatest.max(value)];
        self.is_range_known.then(|| self.volume.values().iter().fold([f32::INFINITY, f32::NEG_INFINITY], ends))
    }

    fn facts(&self) -> StoreFacts {
        let encoding = |sample_type| Encoding { format: "test", sample_type, channels: 1, times: 1 };
        let mut facts = StoreFacts::default();
        facts.encoding = self.sample_type.map(encoding);
        facts
    }

    fn identity(&self) -> String {
        self.identity.to_owned()
    }
}

/// A level of a store of one channel, to be streamed with a sample.
pub(crate) fn streamed(store: Arc<dyn Store>, level: usize, sample: &Volume, memory: u64) -> StreamedVolume {
    let channels = StreamedChannel::from(StreamedLevel::new("store", store, level)).into();
    StreamedVolume { channels, sample: Arc::new(sample.clone()), memory }
}
