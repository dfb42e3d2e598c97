//! The ranges of the values in a store's chunks, noted once, so that chunks without any value that matters need not be read (SPEC §13).

use std::fmt::Write;
use std::sync::Arc;

use glam::UVec3;

use super::range::{EMPTY, finite_range, union};
use super::{Store, StoreFacts, StoreLevel, Texel, VolumeError};
use crate::parallel::prelude::*;

/// The first line of a file.
const TITLE: &str = "sheetsplat index 1";

/// The most chunks of a level that are indexed.
const MOST_CHUNKS: u128 = 1 << 26;

/// The range of the values in every chunk of a store.
#[derive(Clone, Debug, PartialEq)]
pub struct StoreIndex {
    identity: String,
    levels: Vec<Level>,
}

#[derive(Clone, Debug, PartialEq)]
struct Level {
    chunks: UVec3,
    /// Their minima and maxima, x fastest; [`EMPTY`] where there are only holes.
    ranges: Vec<[f32; 2]>,
}

impl StoreIndex {
    /// Reads all values of all levels of a store, on the threads of the current rayon pool. `progress` is told of every chunk. `origin` names the store in
    /// errors.
    ///
    /// # Errors
    /// If the store cannot be read, or has more than 2²⁶ chunks in a level.
    pub fn new(store: &dyn Store, origin: &str, progress: &(dyn Fn() + Sync)) -> Result<Self, VolumeError> {
        let levels = store.levels().iter().enumerate();
        let levels = levels.map(|(number, level)| Level::new(store, number, level, origin, progress));
        Ok(Self { identity: store.identity(), levels: levels.collect::<Result<_, _>>()? })
    }

    /// The contents of a file.
    pub fn encode(&self) -> String {
        let mut text = format!("{TITLE}\nidentity {}\n", self.identity);
        for Level { chunks, ranges } in &self.levels {
            // Writing to a string never fails.
            let _ = writeln!(text, "level {} {} {}", chunks.x, chunks.y, chunks.z);
            for [min, max] in ranges {
                let _ = writeln!(text, "{min} {max}");
            }
        }
        text
    }

    /// The index in a file's contents. `origin` names the file in errors.
    ///
    /// # Errors
    /// If they are not what [`Self::encode`] writes.
    pub fn decode(origin: &str, text: &str) -> Result<Self, VolumeError> {
        let error = |line: usize, found: &str, allowed: &str| {
            let found: String = found.chars().take(80).collect();
            invalid_in(origin, format!("line {}", line + 1), format!("{found:?}"), allowed)
        };
        let mut lines = text.lines().enumerate();
        let mut next = |allowed: &str| lines.next().ok_or_else(|| error(text.lines().count(), "the end", allowed));
        let (_, title) = next(TITLE)?;
        if title != TITLE {
            return Err(error(0, title, TITLE));
        }
        let (_, identity) = next("identity")?;
        let Some(identity) = identity.strip_prefix("identity ") else {
            return Err(error(1, identity, "identity and a store's identity"));
        };
        let mut levels: Vec<Level> = Vec::new();
        for (at, line) in lines {
            match (line.strip_prefix("level "), levels.last_mut()) {
                (Some(chunks), _) => {
                    let chunks = numbers::<u32, 3>(chunks).map(UVec3::from);
                    let chunks = chunks.ok_or_else(|| error(at, line, "level and its chunks along x, y and z"))?;
                    levels.push(Level { chunks, ranges: Vec::new() });
                }
                (None, Some(level)) => {
                    let range = numbers::<f32, 2>(line).filter(|&[min, max]| min <= max || [min, max] == EMPTY);
                    level.ranges.push(range.ok_or_else(|| error(at, line, "a minimum and a maximum"))?);
                }
                (None, None) => return Err(error(at, line, "level and its chunks along x, y and z")),
            }
        }
        for (number, Level { chunks, ranges }) in levels.iter().enumerate() {
            if count_of(*chunks) != ranges.len() as u128 {
                let found = format!("{} ranges of {chunks} chunks", ranges.len());
                return Err(invalid_in(origin, format!("level {number}"), found, "one for each chunk"));
            }
        }
        Ok(Self { identity: identity.to_owned(), levels })
    }

    /// Whether the index is of a store.
    pub(super) fn is_of(&self, store: &dyn Store) -> bool {
        self.identity == store.identity()
    }

    /// The range of all values of a level; `None` if all are holes.
    fn range(&self, level: usize) -> Option<[f32; 2]> {
        let all = self.levels.get(level)?.ranges.iter().copied().fold(EMPTY, union);
        (all != EMPTY).then_some(all)
    }
}

impl Level {
    fn new(
        store: &dyn Store,
        number: usize,
        level: &StoreLevel,
        origin: &str,
        progress: &(dyn Fn() + Sync),
    ) -> Result<Self, VolumeError> {
        let (StoreLevel { grid, chunk }, chunks) = (level, level.chunks());
        let count = count_of(chunks);
        if count > MOST_CHUNKS {
            let allowed = format!("at most {MOST_CHUNKS}");
            return Err(invalid_in(origin, format!("level {number}"), format!("{count} chunks"), allowed));
        }
        let range = |at: u32| {
            let at = UVec3::new(at % chunks.x, at / chunks.x % chunks.y, at / (chunks.x * chunks.y));
            progress();
            if !store.contains(number, at)? {
                return Ok(finite_range(&[store.fill()]));
            }
            let (from, dims) = (at * *chunk, (*chunk).min(grid.dims - at * *chunk));
            let mut values = vec![0.0; dims.element_product() as usize];
            store.read(number, from, dims, &mut values)?;
            Ok(finite_range(&values))
        };
        let ranges = (0..count as u32).into_par_iter().map(range).collect::<Result<_, VolumeError>>()?;
        Ok(Self { chunks, ranges })
    }
}

fn invalid_in(
    origin: &str,
    field: impl AsRef<str>,
    found: impl Into<String>,
    allowed: impl Into<String>,
) -> VolumeError {
    VolumeError::invalid(origin, field.as_ref(), found, allowed)
}

/// The number of chunks, which may be more than 64 bits hold where metadata lie.
fn count_of(chunks: UVec3) -> u128 {
    chunks.to_array().map(u128::from).iter().product()
}

/// Numbers with spaces between.
fn numbers<T: std::str::FromStr, const N: usize>(text: &str) -> Option<[T; N]> {
    let numbers: Option<Vec<T>> = text.split(' ').map(|number| number.parse().ok()).collect();
    numbers?.try_into().ok()
}

/// A store whose chunks' ranges are known.
#[derive(Debug)]
pub struct IndexedStore {
    store: Arc<dyn Store>,
    index: StoreIndex,
    /// The index, for errors.
    origin: String,
}

impl IndexedStore {
    /// A store with its index. `origin` names the index in errors. Nothing tells whether values have changed since the index was made, if the store's
    /// metadata have not.
    ///
    /// # Errors
    /// If the index is that of another store.
    pub fn new(store: Arc<dyn Store>, index: StoreIndex, origin: &str) -> Result<Self, VolumeError> {
        let identity = store.identity();
        if index.identity != identity {
            return Err(invalid_in(origin, "identity", index.identity, format!("{identity}, that of the store")));
        }
        let chunks = |levels: Vec<UVec3>| format!("levels of {levels:?} chunks");
        let ours: Vec<UVec3> = store.levels().iter().map(StoreLevel::chunks).collect();
        let theirs: Vec<UVec3> = index.levels.iter().map(|level| level.chunks).collect();
        if ours != theirs {
            return Err(invalid_in(origin, "level", chunks(theirs), format!("{}, those of the store", chunks(ours))));
        }
        Ok(Self { store, index, origin: origin.to_owned() })
    }

    /// Checks that the index has the fill value alone for a chunk that the store does not hold: it was made when the store held others.
    fn check_absent(&self, level: usize, chunk: UVec3) -> Result<(), VolumeError> {
        let absent = finite_range(&[self.store.fill()]);
        match self.chunk_range(level, chunk) {
            Some(range) if range != absent => {
                let [min, max] = range;
                let found = format!("no chunk {chunk} of level {level} in the store");
                let values =
                    if range == EMPTY { "only holes".to_owned() } else { format!("values from {min} to {max}") };
                Err(invalid_in(&self.origin, "chunk", found, format!("the one with {values} that the index tells of")))
            }
            _ => Ok(()),
        }
    }

    /// Checks that chunks are held which share voxels with a box and are told to have other values than the fill value, given the box's values. If all that
    /// was read of one is the fill value, the store may lack it.
    fn check_read(&self, level: usize, (from, dims): (UVec3, UVec3), values: &[f32]) -> Result<(), VolumeError> {
        let (side, fill) = (self.levels()[level].chunk, self.store.fill());
        let absent = finite_range(&[fill]);
        let is_fill = |voxel: UVec3| {
            let [x, y, z] = (voxel - from).to_array().map(|n| n as usize);
            let value = values[x + dims.x as usize * (y + dims.y as usize * z)];
            value == fill || value.is_nan() && fill.is_nan()
        };
        let (first, last) = (from / side, (from + dims - 1) / side);
        let rows = (first.z..=last.z).flat_map(|z| (first.y..=last.y).map(move |y| (y, z)));
        for chunk in rows.flat_map(|(y, z)| (first.x..=last.x).map(move |x| UVec3::new(x, y, z))) {
            if self.chunk_range(level, chunk).is_none_or(|range| range == absent) {
                continue;
            }
            let (low, end) = (from.max(chunk * side), (from + dims).min((chunk + 1) * side));
            let mut voxels = (low.z..end.z)
                .flat_map(|z| (low.y..end.y).flat_map(move |y| (low.x..end.x).map(move |x| UVec3::new(x, y, z))));
            if voxels.all(is_fill) {
                self.contains(level, chunk)?;
            }
        }
        Ok(())
    }
}

impl Store for IndexedStore {
    fn levels(&self) -> &[StoreLevel] {
        self.store.levels()
    }

    fn read(&self, level: usize, from: UVec3, dims: UVec3, values: &mut [f32]) -> Result<u64, VolumeError> {
        let bytes = self.store.read(level, from, dims, values)?;
        self.check_read(level, (from, dims), values)?;
        Ok(bytes)
    }

    fn has_colors(&self) -> bool {
        self.store.has_colors()
    }

    fn read_colors(
        &self,
        level: usize,
        from: UVec3,
        dims: UVec3,
        values: &mut [f32],
        colors: &mut [Texel],
    ) -> Result<u64, VolumeError> {
        let bytes = self.store.read_colors(level, from, dims, values, colors)?;
        self.check_read(level, (from, dims), values)?;
        Ok(bytes)
    }

    /// A chunk that the store lacks, although the index tells values of it, is an error.
    fn contains(&self, level: usize, chunk: UVec3) -> Result<bool, VolumeError> {
        let is_held = self.store.contains(level, chunk)?;
        if !is_held {
            self.check_absent(level, chunk)?;
        }
        Ok(is_held)
    }

    fn fill(&self) -> f32 {
        self.store.fill()
    }

    fn decodes_whole_chunks(&self) -> bool {
        self.store.decodes_whole_chunks()
    }

    fn memory(&self, level: usize) -> u64 {
        self.store.memory(level)
    }

    fn range(&self, level: usize) -> Option<[f32; 2]> {
        self.index.range(level)
    }

    fn chunk_range(&self, level: usize, chunk: UVec3) -> Option<[f32; 2]> {
        let Level { chunks, ranges } = self.index.levels.get(level)?;
        ranges.get((chunk.x + chunks.x * (chunk.y + chunks.y * chunk.z)) as usize).copied()
    }

    fn facts(&self) -> StoreFacts {
        self.store.facts()
    }

    fn identity(&self) -> String {
        self.store.identity()
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        let ranges = vec![[-0.1, 1e-40], EMPTY, [f32::MIN, f32::MAX], [3.0, 3.0]];
        let levels =
            vec![Level { chunks: UVec3::new(2, 1, 2), ranges }, Level { chunks: UVec3::ONE, ranges: vec![EMPTY] }];
        let index = StoreIndex { identity: "ab12".to_owned(), levels };
        assert_eq!(StoreIndex::decode("index", &index.encode()).unwrap(), index);
        assert_eq!(index.range(0), Some([f32::MIN, f32::MAX]));
        assert_eq!((index.range(1), index.range(2)), (None, None));
    }

    #[test]
    fn other_files_are_refused() {
        for (text, expected) in [
            ("", "line 1: found \"the end\", allowed: sheetsplat index 1"),
            ("PNG", "line 1: found \"PNG\", allowed: sheetsplat index 1"),
            ("sheetsplat index 1\nlevel 1 1 1", "line 2: found \"level 1 1 1\", allowed: identity and"),
            ("sheetsplat index 1\nidentity a\n0 1", "line 3: found \"0 1\", allowed: level and"),
            ("sheetsplat index 1\nidentity a\nlevel 1 1", "line 3: found \"level 1 1\", allowed: level and"),
            ("sheetsplat index 1\nidentity a\nlevel 1 1 1\n2 1", "line 4: found \"2 1\", allowed: a minimum"),
            ("sheetsplat index 1\nidentity a\nlevel 1 1 1\nNaN 1", "line 4: found \"NaN 1\", allowed: a minimum"),
            (
                "sheetsplat index 1\nidentity a\nlevel 4294967295 4294967295 9\n0 1",
                "level 0: found 1 ranges of [4294967295, 4294967295, 9] chunks, allowed: one for each chunk",
            ),
        ] {
            let error = StoreIndex::decode("a.index", text).unwrap_err().to_string();
            assert!(error.starts_with("a.index") && error.contains(expected), "{error}");
        }
    }
}
