//! Shards: values of a key in which several chunks lie, with an index of where each begins.
//!
//! zarrs reads shards too, but adds an index's numbers unchecked and reports a chunk that a shard does not hold as one of 2⁶⁴ bytes.

use std::borrow::Cow;
use std::collections::HashMap;
use std::num::NonZeroU64;
use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

use serde_json::Value;
use zarrs::array::codec::CodecChain;
use zarrs::array::codec::api::{ArrayToBytesCodecTraits, BytesRepresentation, CodecOptions};
use zarrs::array::{FillValue, data_type};
use zarrs::metadata::v3::MetadataV3;

use super::keys::Keys;

/// The number in an index that stands for a chunk that the shard does not hold.
const ABSENT: u64 = u64::MAX;

/// The maximum number of chunks in a shard, whose places are read at once, and of places that are kept.
pub(super) const MAX_IN_SHARD: u64 = 1 << 22;

/// How an array's shards are read.
pub(super) struct Shards {
    /// The codecs of a chunk.
    pub(super) codecs: CodecChain,
    /// The shape of a chunk.
    pub(super) chunk: Vec<NonZeroU64>,
    index: CodecChain,
    is_index_first: bool,
    /// The shape of an index: the number of chunks along each axis, and two numbers for each chunk.
    index_shape: Vec<NonZeroU64>,
    index_bytes: u64,
    /// Indices that were read; `None` for shards that are not in the store.
    read: Mutex<HashMap<String, Option<Arc<[u64]>>>>,
}

impl Shards {
    /// The shards of an array; `None` if its chunks are in no shards, or other codecs change whole shards. The error says what is wrong.
    pub(super) fn of(metadata: &Value, shard: &[NonZeroU64]) -> Result<Option<Self>, String> {
        let Some([codec]) = metadata["codecs"].as_array().map(Vec::as_slice) else { return Ok(None) };
        if codec["name"] != "sharding_indexed" {
            return Ok(None);
        }
        let configuration = &codec["configuration"];
        let chain = |key: &str| {
            let codecs: Vec<MetadataV3> =
                serde_json::from_value(configuration[key].clone()).map_err(|error| format!("{key}: {error}"))?;
            CodecChain::from_metadata(&codecs).map_err(|error| format!("{key}: {error}"))
        };
        let (codecs, index) = (chain("codecs")?, chain("index_codecs")?);
        let chunk: Vec<NonZeroU64> = serde_json::from_value(configuration["chunk_shape"].clone())
            .map_err(|error| format!("chunk_shape: {error}"))?;
        let divides = |(shard, chunk): (&NonZeroU64, &NonZeroU64)| shard.get().is_multiple_of(chunk.get());
        if chunk.len() != shard.len() || !shard.iter().zip(&chunk).all(divides) {
            return Err(format!("chunks of {chunk:?} in a shard of {shard:?}"));
        }
        let counts = shard.iter().zip(&chunk).filter_map(|(shard, chunk)| NonZeroU64::new(shard.get() / chunk.get()));
        let index_shape: Vec<NonZeroU64> = counts.chain(NonZeroU64::new(2)).collect();
        let count = index_shape.iter().try_fold(1_u64, |product, size| product.checked_mul(size.get()));
        if count.is_none_or(|count| count > 2 * MAX_IN_SHARD) {
            return Err(format!("more than {MAX_IN_SHARD} chunks in a shard"));
        }
        let representation = index.encoded_representation(&index_shape, &data_type::uint64(), &FillValue::from(ABSENT));
        let Ok(BytesRepresentation::FixedSize(index_bytes)) = representation else {
            return Err("index_codecs: an index of unknown length".to_owned());
        };
        let is_index_first = configuration["index_location"] == "start";
        Ok(Some(Self { codecs, chunk, index, is_index_first, index_shape, index_bytes, read: Mutex::default() }))
    }

    /// The number of bytes of an index.
    pub(super) fn index_bytes(&self) -> u64 {
        self.index_bytes
    }

    /// The place of a chunk in the shard of a key, by the chunk's place in the array's grid of chunks; `None` if the store does not hold it.
    pub(super) fn range(&self, keys: &Keys, key: &str, chunk: &[u64]) -> Result<Option<Range<u64>>, String> {
        let Some(index) = self.index_of(keys, key)? else { return Ok(None) };
        let at =
            self.index_shape.iter().zip(chunk).fold(0, |at, (count, place)| at * count.get() + place % count.get());
        let entry = index.get(2 * at as usize..2 * at as usize + 2);
        match entry {
            Some(&[ABSENT, ABSENT]) => Ok(None),
            Some(&[from, bytes]) => {
                let end = from.checked_add(bytes).ok_or("an index that leads out of the shard")?;
                Ok(Some(from..end))
            }
            _ => Err("an index of too few chunks".to_owned()),
        }
    }

    /// The index of a shard; `None` if the store does not hold the shard.
    fn index_of(&self, keys: &Keys, key: &str) -> Result<Option<Arc<[u64]>>, String> {
        let kept = || self.read.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(index) = kept().get(key) {
            return Ok(index.clone());
        }
        let index = match keys.bytes(key).map_err(|error| error.to_string())? {
            None => None,
            Some(bytes) => {
                let from = if self.is_index_first { 0 } else { bytes.saturating_sub(self.index_bytes) };
                if bytes < self.index_bytes {
                    return Err(format!("a shard of {bytes} bytes, whose index alone takes {}", self.index_bytes));
                }
                let code = keys.range(key, from..from + self.index_bytes).map_err(|error| error.to_string())?;
                let (fill, options) = (FillValue::from(ABSENT), CodecOptions::default().with_concurrent_target(1));
                let decoded =
                    self.index.decode(Cow::Owned(code), &self.index_shape, &data_type::uint64(), &fill, &options);
                let decoded = decoded.map_err(|error| format!("the shard's index: {error}"))?;
                let bytes = decoded.into_fixed().map_err(|error| error.to_string())?;
                Some(bytes.as_chunks().0.iter().map(|&number| u64::from_ne_bytes(number)).collect())
            }
        };
        let mut kept = kept();
        if kept.len() as u64 * self.index_bytes > 16 * MAX_IN_SHARD {
            kept.clear();
        }
        kept.insert(key.to_owned(), index.clone());
        Ok(index)
    }
}
