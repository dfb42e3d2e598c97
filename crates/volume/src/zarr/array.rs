//! An array of a Zarr store, read chunk by chunk.

use std::borrow::Cow;
use std::fmt::{self, Debug, Display, Formatter};
use std::ops::Range;
use std::sync::Arc;

use glam::UVec3;
use serde_json::Value;

use super::super::VolumeError;
use super::super::access::Access;
use super::super::error::volume::invalid;
use super::super::sample_type::SampleType;
use super::super::samples::Samples;
use super::super::voxel::Voxel;
use super::axes::{Axes, KINDS};
use super::codec::Codecs;
use super::json::Json;
use super::keys::Keys;
use super::metadata::{self, ChunkKeys, Metadata};
use super::shards::{MAX_IN_SHARD, Shards};
use super::steps::compressed;
use crate::parallel;
use crate::parallel::prelude::*;

/// The maximum number of chunks of an array: more take longer to look for than anyone waits.
const MAX_CHUNKS: u64 = 1 << 26;

/// Numbers by kind of axis, in the order t, c, z, y, x.
pub(super) type Sizes = [u64; KINDS];

/// An array whose axes are known.
pub(super) struct ZarrArray {
    keys: Arc<Keys>,
    /// Where the array lies in the store.
    path: String,
    metadata: Value,
    /// The codecs of a chunk; of an inner one, where chunks lie in shards.
    codecs: Codecs,
    /// How chunks are found in shards, if they lie in such.
    shards: Option<Shards>,
    chunk_keys: ChunkKeys,
    axes: Axes,
    /// Whether the order of axes is assumed, as nothing names them.
    pub(super) are_axes_assumed: bool,
    pub(super) kind: SampleType,
    /// The bytes of the value of voxels in chunks that the store does not hold, and whether the metadata state it.
    fill: Vec<u8>,
    has_fill: bool,
    pub(super) shape: Sizes,
    /// The shape of a chunk or shard that has a key.
    outer: Vec<u64>,
    /// The shape of a chunk; of an inner one, where chunks lie in shards.
    chunk: Sizes,
    /// The number of values in a chunk.
    in_chunk: u64,
    /// The maximum number of chunks that are read at once, however many threads there are.
    most_at_once: usize,
}

impl Debug for ZarrArray {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { kind, shape, chunk, .. } = self;
        f.debug_struct("ZarrArray").field("kind", kind).field("shape", shape).field("chunk", chunk).finish()
    }
}

/// The values of a chunk that the store holds, and the number of its bytes there.
type Decoded<T> = Option<(Vec<T>, u64)>;

/// What a store holds of a region: chunks, and their bytes as they are stored.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Held {
    pub(super) chunks: u64,
    pub(super) bytes: u64,
}

/// A box in an array: some channels at one time.
pub(super) struct Region {
    pub(super) channels: Range<u64>,
    pub(super) time: u64,
    pub(super) from: UVec3,
    pub(super) dims: UVec3,
}

impl Region {
    /// The number of values.
    pub(super) fn count(&self) -> usize {
        (self.channels.end - self.channels.start) as usize * self.dims.as_usizevec3().element_product()
    }

    /// The first place, and that after the last.
    fn bounds(&self) -> [Sizes; 2] {
        let [from, to] = [self.from.as_u64vec3(), self.from.as_u64vec3() + self.dims.as_u64vec3()];
        let first = [self.time, self.channels.start, from.z, from.y, from.x];
        [first, [self.time + 1, self.channels.end, to.z, to.y, to.x]]
    }
}

impl ZarrArray {
    /// Opens the array at a path of a store. Its axes are `axes`, or those that it names, or else the last ones of t, c, z,
    /// y, x.
    pub(super) fn open(keys: &Arc<Keys>, path: &str, axes: Option<&Axes>) -> Result<Self, VolumeError> {
        let (file, mut metadata) = metadata::find(keys, path)?;
        let stated = Metadata::read(&Json::new(&file, &metadata))?;
        let Metadata { shape, number, fill, has_fill, chunk_keys, codecs } = stated;
        let wrong_axes = || {
            let allowed = match axes {
                Some(axes) => format!("{}, as many as there are axes", axes.count()),
                None => "3 to 5: z, y and x, after channels and times if there are any".to_owned(),
            };
            invalid(&file, "shape", format!("{} dimensions", shape.len()), allowed)
        };
        let mut are_axes_assumed = false;
        let axes = match axes {
            Some(axes) => Some(*axes).filter(|axes| axes.count() == shape.len()),
            None => {
                let names = metadata::axis_names(keys, path, &Json::new(&file, &metadata), shape.len())?;
                if !names.is_empty() {
                    // In version 2 another file states the names, by which the store's identity differs, too.
                    metadata["dimension_names"] = names.clone().into();
                }
                Axes::named(&names).or_else(|| {
                    are_axes_assumed = true;
                    let plain = Axes::plain(shape.len());
                    if let Some(plain) = plain.filter(|_| !Axes::say_nothing(&names)) {
                        let (file, names) = (file.display(), names.join(", "));
                        log::warn!("{file}: axes named {names}: taken to be {plain}");
                    }
                    plain
                })
            }
        };
        let axes = axes.ok_or_else(wrong_axes)?;
        let kind = number.kind();
        let outer = codecs.shape().to_vec();
        let (codecs, layout) = codecs.split();
        let (inner, shards) = (codecs.shape(), layout.map(Shards::new));
        let product = |sizes: &[u64]| sizes.iter().try_fold(1_u64, |product, &size| product.checked_mul(size));
        let shown = |sizes: &[u64]| sizes.iter().map(u64::to_string).collect::<Vec<_>>().join(" × ");
        let is_grid = |sizes: &[u64]| sizes.iter().all(|&size| (1..=u64::from(u32::MAX)).contains(&size));
        if !is_grid(&shape) {
            return Err(invalid(&file, "shape", shown(&shape), "positive sizes, at most 4294967295 each"));
        }
        let in_chunk = product(inner).filter(|count| *count <= u64::from(u32::MAX) && is_grid(&outer));
        let in_chunk =
            in_chunk.ok_or_else(|| invalid(&file, "chunks", shown(inner), "at most 4294967295 values in a chunk"))?;
        let counts: Vec<u64> = shape.iter().zip(inner).map(|(shape, chunk)| shape.div_ceil(*chunk)).collect();
        if product(&counts).is_none_or(|count| count > MAX_CHUNKS) {
            return Err(invalid(
                &file,
                "chunks",
                format!("{} chunks", shown(&counts)),
                format!("at most {MAX_CHUNKS}"),
            ));
        }
        let (shape, chunk) = (axes.sort(&shape, 1), axes.sort(inner, 1));
        let (keys, path) = (Arc::clone(keys), path.to_owned());
        let opened = Self {
            most_at_once: usize::MAX,
            keys,
            path,
            metadata,
            are_axes_assumed,
            codecs,
            shards,
            chunk_keys,
            axes,
            kind,
            fill,
            has_fill,
            shape,
            outer,
            chunk,
            in_chunk,
        };
        opened.keys.permit(opened.encoded_bytes());
        Ok(opened)
    }

    /// What the store states about the array.
    pub(super) fn metadata(&self) -> Value {
        self.metadata.clone()
    }

    /// The number of voxels along x, y and z.
    pub(super) fn dims(&self) -> UVec3 {
        let [.., z, y, x] = self.shape.map(|size| size as u32);
        UVec3::new(x, y, z)
    }

    /// The number of voxels of a chunk along x, y and z.
    pub(super) fn chunk_dims(&self) -> UVec3 {
        let [.., z, y, x] = self.chunk.map(|size| u32::try_from(size).unwrap_or(u32::MAX));
        UVec3::new(x, y, z).min(self.dims())
    }

    /// The maximum number of bytes that a chunk, or the places of a shard's chunks, may have in the store.
    fn encoded_bytes(&self) -> u64 {
        let chunk = compressed(self.in_chunk.saturating_mul(self.kind.bytes())).max(self.codecs.limit());
        chunk.max(self.shards.as_ref().map_or(0, Shards::index_bytes))
    }

    /// The maximum number of bytes that reading `chunks` chunks at once takes, beside the values that are read.
    pub(super) fn chunk_memory<T>(&self, chunks: usize) -> u64 {
        let decoded = self.in_chunk.saturating_mul(self.kind.bytes()).saturating_add(self.encoded_bytes());
        let values = self.in_chunk.saturating_mul(size_of::<T>() as u64);
        let bytes = decoded.max(self.codecs.memory()).saturating_add(values).saturating_mul(chunks as u64);
        let all: u64 = (0..KINDS).map(|axis| self.shape[axis].div_ceil(self.chunk[axis])).product();
        let indices = if self.shards.is_some() { 32 * all.min(MAX_IN_SHARD) } else { 0 };
        bytes.saturating_add(indices)
    }

    /// Reads no more chunks at once than memory of some bytes holds, or one.
    pub(super) fn keep_within<T>(&mut self, bytes: u64) {
        let threads = parallel::current_num_threads();
        self.most_at_once = (1..=threads).rev().find(|&chunks| self.chunk_memory::<T>(chunks) <= bytes).unwrap_or(1);
    }

    /// The maximum number of chunks that are read at once.
    pub(super) fn most_at_once(&self) -> usize {
        parallel::current_num_threads().min(self.most_at_once)
    }

    /// Reserves the memory for reading `chunks` chunks at once.
    pub(super) fn reserve<T>(&self, chunks: usize, access: &Access) -> Result<(), VolumeError> {
        let bytes = self.chunk_memory::<T>(chunks);
        access.reserve(
            &self.keys.path,
            "chunks",
            format!("chunks of {} values, {chunks} at once", self.in_chunk),
            bytes,
        )
    }

    /// The chunks that a region meets: the first one's place in the grid of chunks, and how many there are.
    fn chunks(&self, region: &Region) -> [Sizes; 2] {
        let [first, end] = region.bounds();
        let low: Sizes = std::array::from_fn(|axis| first[axis] / self.chunk[axis]);
        [low, std::array::from_fn(|axis| end[axis].div_ceil(self.chunk[axis]) - low[axis])]
    }

    /// The number of voxels along z of a piece of the array that is read before its values are converted to the type that holds them in the fewest bits;
    /// `None` if the array is read whole, because its values need all bits of `T`, or because a chunk holds several channels.
    fn thickness<T: Voxel>(&self) -> Option<u32> {
        let [_, of_channels, thickness, ..] = self.chunk;
        let is_narrower = T::bytes(self.kind, false) < size_of::<T>() as u64;
        (is_narrower && of_channels == 1).then(|| thickness.min(self.dims().z.into()) as u32)
    }

    /// The maximum number of bytes that the values of some channels of the whole array take while they are read.
    pub(super) fn memory<T: Voxel>(&self, channels: u64) -> u64 {
        let values =
            |layers: u32| self.dims().with_z(layers).as_u64vec3().to_array().into_iter().fold(1, u64::saturating_mul);
        let (each, all) = (size_of::<T>() as u64, values(self.dims().z).saturating_mul(channels));
        match self.thickness::<T>().map(values).filter(|&piece| piece < all) {
            None => all.saturating_mul(each),
            Some(piece) => all.saturating_mul(T::bytes(self.kind, false)).saturating_add(piece.saturating_mul(each)),
        }
    }

    /// Some channels of the whole array, in pieces in the order of memory. A chunk belongs to one piece only.
    pub(super) fn pieces<T: Voxel>(&self, channels: Range<u64>, time: u64) -> Vec<Region> {
        let dims = self.dims();
        let Some(thickness) = self.thickness::<T>() else {
            return vec![Region { channels, time, from: UVec3::ZERO, dims }];
        };
        let piece = |channel: u64, z: u32| Region {
            channels: channel..channel + 1,
            time,
            from: UVec3::ZERO.with_z(z),
            dims: dims.with_z(thickness.min(dims.z - z)),
        };
        let starts = move || (0..dims.z).step_by(thickness as usize);
        channels.flat_map(|channel| starts().map(move |z| piece(channel, z))).collect()
    }

    /// The number of chunks that a region meets.
    pub(super) fn count(&self, region: &Region) -> u64 {
        let [_, counts] = self.chunks(region);
        counts.iter().product()
    }

    /// The number of chunks that are decoded at once to read a region.
    pub(super) fn at_once(&self, region: &Region) -> usize {
        self.most_at_once().min(self.count(region) as usize)
    }

    /// Reads a region that lies in the array, channel by channel, x fastest, into as many values. Returns what the store
    /// holds of it.
    pub(super) fn read<T: Voxel>(&self, region: &Region, values: &mut [T]) -> Result<Held, VolumeError> {
        debug_assert_eq!(values.len(), region.count());
        let [low, counts] = self.chunks(region);
        let total = self.count(region);
        let at_once = self.at_once(region) as u64;
        let place = |mut index: u64| {
            let mut place = low;
            for axis in (0..KINDS).rev() {
                place[axis] += index % counts[axis];
                index /= counts[axis];
            }
            place
        };
        let (mut next, mut held) = (0, Held::default());
        while next < total {
            let batch = next..total.min(next + at_once);
            next = batch.end;
            let decode = |index| Ok((place(index), self.decode(place(index))?));
            let decoded: Vec<(Sizes, Decoded<T>)> =
                batch.into_par_iter().map(decode).collect::<Result<_, VolumeError>>()?;
            for (place, chunk) in decoded {
                held.chunks += u64::from(chunk.is_some());
                held.bytes += chunk.as_ref().map_or(0, |(_, bytes)| *bytes);
                let chunk = chunk.map_or_else(|| self.filled(place), |(chunk, _)| Ok(chunk))?;
                self.copy(place, &chunk, region, values);
            }
        }
        self.keys.check_presence()?;
        Ok(held)
    }

    /// A chunk that the store does not hold.
    fn filled<T: Voxel>(&self, place: Sizes) -> Result<Vec<T>, VolumeError> {
        self.check_absent(place)?;
        let fill =
            self.convert::<T>(self.fill.clone()).map_err(|sample| self.refused::<T>(&self.key(place), sample))?;
        Ok(fill.repeat(self.in_chunk as usize))
    }

    /// The error for a sample that no voxel can have.
    fn refused<T: Voxel>(&self, key: &str, sample: f64) -> VolumeError {
        invalid(&self.keys.file(key), "data", format!("{sample} in the chunk"), T::ALLOWED)
    }

    /// Decodes the chunk at a place of the grid of chunks, if the store holds it; values are in the order of the array's axes. Also returns the number of
    /// its bytes in the store.
    fn decode<T: Voxel>(&self, place: Sizes) -> Result<Decoded<T>, VolumeError> {
        let key = self.key(place);
        let Some(code) = self.encoded(&key, place)? else { return Ok(None) };
        let length = code.len() as u64;
        let decoded = self.codecs.decode(Cow::Owned(code)).map_err(|error| self.damaged(&key, place, &error))?;
        let values = self.convert(decoded).map_err(|sample| self.refused::<T>(&key, sample))?;
        Ok(Some((values, length)))
    }

    /// The bytes of the chunk at a place, encoded; `None` if the store does not hold it.
    fn encoded(&self, key: &str, place: Sizes) -> Result<Option<Vec<u8>>, VolumeError> {
        let Some(shards) = &self.shards else {
            return self.keys.whole(key);
        };
        let range = shards.range(&self.keys, key, &self.axes.unsort(place));
        let Some(range) = range.map_err(|error| self.damaged(key, place, &error))? else { return Ok(None) };
        match self.keys.bytes(key)? {
            Some(bytes) if range.end <= bytes => self.keys.range(key, range).map(Some),
            bytes => {
                let found = format!("bytes {range:?} of a shard of {}", bytes.unwrap_or(0));
                Err(self.damaged(key, place, &found))
            }
        }
    }

    /// The voxels of numbers as the store holds them, in the machine's byte order.
    fn convert<T: Voxel>(&self, bytes: Vec<u8>) -> Result<Vec<T>, f64> {
        let big_endian = cfg!(target_endian = "big");
        let dims = UVec3::new((bytes.len() as u64 / self.kind.bytes()) as u32, 1, 1);
        let layout = Samples { kind: self.kind, dims, big_endian, rescale: None, z_fastest: false };
        let mut voxels = Vec::with_capacity(dims.x as usize);
        self.keys.access.note_rounding(self.kind.convert(&layout, &bytes, &mut voxels)?);
        Ok(voxels)
    }

    /// The value of voxels in chunks that the store does not hold.
    pub(super) fn fill(&self) -> f32 {
        // Every number is a value.
        self.convert::<f32>(self.fill.clone()).ok().and_then(|values| values.first().copied()).unwrap_or(f32::NAN)
    }

    /// Copies what lies in a region of the chunk at a place of the grid of chunks.
    fn copy<T: Voxel>(&self, place: Sizes, chunk: &[T], region: &Region, values: &mut [T]) {
        let [first, end] = region.bounds();
        let origin: Sizes = std::array::from_fn(|axis| place[axis] * self.chunk[axis]);
        let low: Sizes = std::array::from_fn(|axis| first[axis].max(origin[axis]));
        let high: Sizes = std::array::from_fn(|axis| end[axis].min(origin[axis] + self.chunk[axis]));
        let strides = self.strides();
        let width = (high[4] - low[4]) as usize;
        for channel in low[1]..high[1] {
            for z in low[2]..high[2] {
                for y in low[3]..high[3] {
                    let at = [low[0], channel, z, y, low[4]];
                    let from: u64 = (0..KINDS).map(|axis| (at[axis] - origin[axis]) * strides[axis]).sum();
                    let row = (1..4).fold(0, |row, axis| row * (end[axis] - first[axis]) + at[axis] - first[axis]);
                    let to = (row * (end[4] - first[4]) + low[4] - first[4]) as usize;
                    let row = chunk[from as usize..].iter().step_by(strides[4].max(1) as usize);
                    for (value, &voxel) in values[to..to + width].iter_mut().zip(row) {
                        *value = voxel;
                    }
                }
            }
        }
    }

    /// How far apart neighbours along an axis lie in a chunk.
    fn strides(&self) -> Sizes {
        let mut strides = self.axes.unsort(self.chunk);
        let mut stride = 1;
        for size in strides.iter_mut().rev() {
            stride *= std::mem::replace(size, stride);
        }
        self.axes.sort(&strides, 0)
    }

    /// Whether the store holds the chunk that lies at a place along x, y and z, of a channel and time.
    pub(super) fn contains(&self, channel: u64, time: u64, chunk: UVec3) -> Result<bool, VolumeError> {
        let [x, y, z] = chunk.to_array().map(u64::from);
        let place = [time / self.chunk[0], channel / self.chunk[1], z, y, x];
        let key = self.key(place);
        let is_held = match &self.shards {
            None => self.keys.bytes(&key)?.is_some(),
            Some(shards) => {
                let range = shards.range(&self.keys, &key, &self.axes.unsort(place));
                range.map_err(|error| self.damaged(&key, place, &error))?.is_some()
            }
        };
        if !is_held {
            self.keys.check_presence()?;
            self.check_absent(place)?;
        }
        Ok(is_held)
    }

    /// Checks that a chunk may be absent: that the metadata state its voxels' value.
    fn check_absent(&self, place: Sizes) -> Result<(), VolumeError> {
        if self.has_fill {
            return Ok(());
        }
        let allowed = "the chunk, or metadata with a fill_value other than null";
        Err(invalid(&self.keys.file(&self.key(place)), "chunk", "nothing", allowed))
    }

    /// The key of the chunk or the shard in which the chunk at a place lies.
    fn key(&self, place: Sizes) -> String {
        let origin: Vec<u64> = self.axes.unsort(std::array::from_fn(|axis| place[axis] * self.chunk[axis]));
        let chunk: Vec<u64> = origin.iter().zip(&self.outer).map(|(at, size)| at / size).collect();
        let name = self.chunk_keys.name(&chunk);
        if self.path.is_empty() { name } else { format!("{}/{name}", self.path) }
    }

    /// The error for a chunk that cannot be decoded.
    fn damaged(&self, key: &str, place: Sizes, error: &dyn Display) -> VolumeError {
        let origin = self.axes.unsort(std::array::from_fn(|axis| place[axis] * self.chunk[axis]));
        let found = format!("{error}, in the chunk from {origin:?}");
        let shape = self.axes.unsort(self.chunk);
        invalid(&self.keys.file(key), "chunk", found, format!("a whole and undamaged chunk of {shape:?} values"))
    }
}
