//! How much was read of a store.

use serde::Serialize;

/// How much of a store is read for a frame, or for a volume that is read whole (SPEC §13).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct StoreCounts {
    /// The level that was drawn; 0 is the finest.
    pub level: u64,
    /// The chunks of the level, in all channels that are read.
    pub chunks_total: u64,
    /// The number of those chunks that were read. A chunk that is read again counts once.
    pub chunks_read: u64,
    /// The bytes of the store that reading them took, without those of reading again what was dropped.
    pub bytes_read: u64,
    /// The most bytes of values and bricks that were in memory at a time. It depends on the order in which threads draw. For a volume that is read as a
    /// whole, the bytes of its values.
    pub chunk_bytes: u64,
    /// The chunks that were read for the sample of a volume that is streamed.
    pub sample_chunks_read: u64,
    /// The bytes of those chunks in the store.
    pub sample_bytes_read: u64,
}
