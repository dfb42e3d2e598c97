//! Shards: values of a key in which several chunks lie, with an index of where each begins.

use std::borrow::Cow;
use std::collections::HashMap;
use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

use super::super::VolumeError;
use super::codec::Codecs;
use super::json::Json;
use super::keys::Keys;

/// The number in an index that stands for a chunk that the shard does not hold.
const ABSENT: u64 = u64::MAX;

/// The maximum number of chunks in a shard, whose places are read at once, and of places that are kept.
pub(super) const MAX_IN_SHARD: u64 = 1 << 22;

/// How chunks lie in a shard.
pub(super) struct Layout {
    /// The shape of a chunk, and the number of chunks along each axis.
    chunk: Vec<u64>,
    counts: Vec<u64>,
    /// The codecs of the index, two numbers for each chunk, and the index's length in the shard.
    index: Codecs,
    index_bytes: u64,
    is_index_first: bool,
    /// The bytes of a number that no chunk holds.
    fill: Vec<u8>,
}

impl Layout {
    /// The layout of shards of some shape, and the codecs of chunks in them.
    pub(super) fn read(configuration: &Json, shard: &[u64], fill: &[u8]) -> Result<(Self, Codecs), VolumeError> {
        configuration.only(&["chunk_shape", "codecs", "index_codecs", "index_location"])?;
        let chunk_shape = configuration.get("chunk_shape");
        let allowed =
            format!("shards of a whole number of chunks, at most {MAX_IN_SHARD}: a shard has {shard:?} values");
        let chunk = chunk_shape.integers(&allowed)?;
        let divides = |(shard, chunk): (&u64, &u64)| *chunk > 0 && shard.is_multiple_of(*chunk);
        if chunk.len() != shard.len() || !shard.iter().zip(&chunk).all(divides) {
            return Err(chunk_shape.invalid(&allowed));
        }
        let counts: Vec<u64> = shard.iter().zip(&chunk).map(|(shard, chunk)| shard / chunk).collect();
        let count = counts.iter().try_fold(1_u64, |product, &count| product.checked_mul(count));
        if count.is_none_or(|count| count > MAX_IN_SHARD) {
            return Err(chunk_shape.invalid(&allowed));
        }
        let index_codecs = configuration.get("index_codecs");
        let index = Codecs::read(&index_codecs, &[&counts[..], &[2]].concat(), &ABSENT.to_ne_bytes())?;
        let index_bytes = index.length();
        let index_bytes = index_bytes.ok_or_else(|| index_codecs.invalid("codecs that give every index one length"))?;
        let location = configuration.get("index_location");
        let is_index_first = match location.text() {
            None if !location.is_some() => false,
            Some(place @ ("start" | "end")) => place == "start",
            _ => return Err(location.invalid("start or end")),
        };
        let codecs = Codecs::read(&configuration.get("codecs"), &chunk, fill)?;
        Ok((Self { chunk, counts, index, index_bytes, is_index_first, fill: fill.to_vec() }, codecs))
    }

    /// The number of chunks in a shard.
    pub(super) fn count(&self) -> u64 {
        self.counts.iter().product()
    }

    /// Where the index of a shard of some bytes lies.
    fn place_of_index(&self, bytes: u64) -> Result<Range<u64>, String> {
        let last = bytes.checked_sub(self.index_bytes);
        let last =
            last.ok_or_else(|| format!("a shard of {bytes} bytes, whose index alone takes {}", self.index_bytes))?;
        let from = if self.is_index_first { 0 } else { last };
        Ok(from..from + self.index_bytes)
    }

    /// The numbers of an index.
    fn numbers(&self, code: Cow<[u8]>) -> Result<Vec<u64>, String> {
        let bytes = self.index.decode(code).map_err(|error| format!("the shard's index: {error}"))?;
        Ok(bytes.as_chunks().0.iter().map(|&number| u64::from_ne_bytes(number)).collect())
    }

    /// Decodes all chunks of a shard.
    pub(super) fn decode(&self, shard: &[u8], codecs: &Codecs) -> Result<Vec<u8>, String> {
        let part = |range: Range<u64>| {
            let [from, to] = [range.start, range.end].map(|at| usize::try_from(at).unwrap_or(usize::MAX));
            shard.get(from..to)
        };
        let index = part(self.place_of_index(shard.len() as u64)?).unwrap_or_default();
        let index = self.numbers(Cow::Borrowed(index))?;
        let shape: Vec<u64> = self.counts.iter().zip(&self.chunk).map(|(count, size)| count * size).collect();
        let mut decoded = self.fill.repeat(shape.iter().product::<u64>() as usize);
        for at in 0..self.count() {
            let Some(range) = chunk_of(&index, at)? else { continue };
            let found = range.clone();
            let code = part(range).ok_or_else(|| format!("bytes {found:?} of a shard of {}", shard.len()))?;
            let place = unravel(at, &self.counts);
            let width = self.fill.len() * self.chunk.last().map_or(1, |&size| size as usize);
            for (row, values) in codecs.decode(Cow::Borrowed(code))?.chunks_exact(width).enumerate() {
                let inner = unravel(row as u64 * self.chunk.last().unwrap_or(&1), &self.chunk);
                let value = (0..shape.len())
                    .fold(0, |value, axis| value * shape[axis] + place[axis] * self.chunk[axis] + inner[axis]);
                let to = value as usize * self.fill.len();
                decoded[to..to + width].copy_from_slice(values);
            }
        }
        Ok(decoded)
    }
}

/// The place along each axis of an element of an array.
fn unravel(mut index: u64, shape: &[u64]) -> Vec<u64> {
    let mut place = vec![0; shape.len()];
    for (at, size) in place.iter_mut().zip(shape).rev() {
        (*at, index) = (index % size, index / size);
    }
    place
}

/// The bytes of a chunk by its number in the shard; `None` if the shard does not hold it.
fn chunk_of(index: &[u64], at: u64) -> Result<Option<Range<u64>>, String> {
    match index.as_chunks().0.get(at as usize) {
        Some(&[ABSENT, ABSENT]) => Ok(None),
        Some(&[from, bytes]) => {
            let end = from.checked_add(bytes).ok_or("an index that leads out of the shard")?;
            Ok(Some(from..end))
        }
        None => Err("an index of too few chunks".to_owned()),
    }
}

/// How an array's shards are read, chunk by chunk.
pub(super) struct Shards {
    layout: Layout,
    /// Indices that were read; `None` for shards that are not in the store.
    read: Mutex<HashMap<String, Option<Arc<[u64]>>>>,
}

impl Shards {
    pub(super) fn new(layout: Layout) -> Self {
        Self { layout, read: Mutex::default() }
    }

    /// The number of bytes of an index.
    pub(super) fn index_bytes(&self) -> u64 {
        self.layout.index_bytes
    }

    /// The place of a chunk in the shard of a key, by the chunk's place in the array's grid of chunks; `None` if the store does not hold it.
    pub(super) fn range(&self, keys: &Keys, key: &str, chunk: &[u64]) -> Result<Option<Range<u64>>, String> {
        let Some(index) = self.index_of(keys, key)? else { return Ok(None) };
        let at = self.layout.counts.iter().zip(chunk).fold(0, |at, (count, place)| at * count + place % count);
        chunk_of(&index, at)
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
                let place = self.layout.place_of_index(bytes)?;
                let code = keys.range(key, place).map_err(|error| error.to_string())?;
                Some(self.layout.numbers(Cow::Owned(code))?.into())
            }
        };
        let mut kept = kept();
        if kept.len() as u64 * self.index_bytes() > 16 * MAX_IN_SHARD {
            kept.clear();
        }
        kept.insert(key.to_owned(), index.clone());
        Ok(index)
    }
}
