//! Codecs, by which the numbers of a chunk become the bytes that a store holds: <https://zarr-specs.readthedocs.io/en/latest/v3/codecs/index.html>.
//!
//! Axes may be stored in another order. Numbers become bytes one after the other, or in a shard of smaller chunks. Bytes may be shuffled, compressed, or followed by a checksum.
//! No step decodes to more bytes than its chunk can take.

use std::borrow::Cow;

use super::super::VolumeError;
use super::extension::Extension;
use super::json::Json;
use super::shards::Layout;
use super::steps::{Step, compressed};

/// The maximum number of codecs in a list.
const MAX_CODECS: usize = 16;

/// A codec as metadata state it.
pub(super) enum Codec<'a> {
    /// For each stored axis, the decoded axis.
    Transpose(Vec<usize>),
    Bytes {
        is_big_endian: bool,
    },
    Shards(Json<'a>),
    Step(Step),
}

/// The codecs of a chunk.
pub(super) struct Codecs {
    /// The shape of the decoded chunk, the number of bytes of a number in it, and that of all of them.
    shape: Vec<u64>,
    element: usize,
    bytes: u64,
    /// For each stored axis, the decoded axis.
    order: Vec<usize>,
    packing: Packing,
    /// In the order in which they encode, with the maximum number of bytes that each one decodes to.
    steps: Vec<(Step, u64)>,
    /// The maximum number of bytes of the encoded chunk.
    limit: u64,
    /// The maximum number of bytes that decoding takes, with those that it is given and returns.
    memory: u64,
}

enum Packing {
    Bytes { is_swapped: bool },
    Shards(Box<Layout>, Box<Codecs>),
}

impl<'a> Codec<'a> {
    /// A codec of an array with some number of axes, whose numbers have `element` bytes.
    fn read(name: &Json, configuration: &Json<'a>, axes: usize, element: usize) -> Result<Self, VolumeError> {
        Ok(match name.text().unwrap_or_default() {
            "transpose" => {
                configuration.only(&["order"])?;
                let order = configuration.get("order");
                let allowed = format!("a list of the {axes} axes, numbered from 0");
                let axes_found = order.integers(&allowed)?;
                let mut sorted = axes_found.clone();
                sorted.sort_unstable();
                if !sorted.into_iter().eq(0..axes as u64) {
                    return Err(order.invalid(&allowed));
                }
                Self::Transpose(axes_found.into_iter().map(|axis| axis as usize).collect())
            }
            "bytes" | "endian" => {
                configuration.only(&["endian"])?;
                let endian = configuration.get("endian");
                match endian.text() {
                    None if element == 1 && !endian.is_some() => Self::Bytes { is_big_endian: false },
                    Some(order @ ("little" | "big")) => Self::Bytes { is_big_endian: order == "big" },
                    _ => return Err(endian.invalid("little or big")),
                }
            }
            "crc32c" => {
                configuration.only(&[])?;
                Self::Step(Step::Checksum)
            }
            "sharding_indexed" => Self::Shards(configuration.clone()),
            _ => Self::Step(Step::read(name, configuration)?),
        })
    }
}

impl Codecs {
    /// The codecs that a list of version 3 states, of a chunk whose numbers have as many bytes as the fill value.
    pub(super) fn read(list: &Json, shape: &[u64], fill: &[u8]) -> Result<Self, VolumeError> {
        let mut codecs = Vec::new();
        for member in list.list("a list of codecs")? {
            let Extension { name, configuration, is_optional } = Extension::read(&member)?;
            match Codec::read(&name, &configuration, shape.len(), fill.len()) {
                Ok(codec) => codecs.push(codec),
                Err(_) if is_optional => {}
                Err(error) => return Err(error),
            }
        }
        Self::new(list, codecs, shape, fill)
    }

    /// The codecs that `list` states.
    pub(super) fn new(list: &Json, codecs: Vec<Codec>, shape: &[u64], fill: &[u8]) -> Result<Self, VolumeError> {
        if codecs.len() > MAX_CODECS {
            return Err(list.invalid(&format!("at most {MAX_CODECS} codecs")));
        }
        let (mut order, mut packings, mut rest) = ((0..shape.len()).collect::<Vec<_>>(), Vec::new(), Vec::new());
        for codec in codecs {
            match codec {
                Codec::Transpose(axes) => order = axes.into_iter().map(|axis| order[axis]).collect(),
                Codec::Step(step) => rest.push(step),
                packing => packings.push(packing),
            }
        }
        let bytes = shape.iter().fold(fill.len() as u64, |bytes, size| bytes.saturating_mul(*size));
        let bound = compressed(bytes);
        let (packing, mut limit, mut memory) = match &packings[..] {
            [Codec::Bytes { is_big_endian }] => {
                let is_swapped = *is_big_endian != cfg!(target_endian = "big");
                (Packing::Bytes { is_swapped }, bytes, bytes)
            }
            [Codec::Shards(configuration)] => {
                let stored: Vec<u64> = order.iter().map(|&axis| shape[axis]).collect();
                let (layout, codecs) = Layout::read(configuration, &stored, fill)?;
                // An entry of the index, and what a compression adds to a chunk of few numbers.
                let limit = bound.saturating_add(64 * layout.count());
                let index = 32 * layout.count();
                let memory = limit.saturating_add(bytes).saturating_add(index).saturating_add(codecs.memory);
                (Packing::Shards(Box::new(layout), Box::new(codecs)), limit, memory)
            }
            _ => return Err(list.invalid("one of bytes and sharding_indexed, beside other codecs")),
        };
        if !order.is_sorted() {
            memory = memory.max(bytes.saturating_mul(2));
        }
        let mut steps = Vec::new();
        for step in rest {
            steps.push((step, limit));
            let encoded = step.bound(limit, bound);
            memory = memory.max(limit.saturating_add(encoded));
            limit = encoded;
        }
        Ok(Self { shape: shape.to_vec(), element: fill.len(), bytes, order, packing, steps, limit, memory })
    }

    /// The codecs of the chunks in shards, and how these lie there, if that is all that the codecs state.
    pub(super) fn split(self) -> (Self, Option<Layout>) {
        match self {
            Self { packing: Packing::Shards(layout, codecs), order, steps, .. }
                if steps.is_empty() && order.is_sorted() =>
            {
                (*codecs, Some(*layout))
            }
            codecs => (codecs, None),
        }
    }

    /// The shape of the decoded chunk.
    pub(super) fn shape(&self) -> &[u64] {
        &self.shape
    }

    /// The maximum number of bytes of the encoded chunk.
    pub(super) fn limit(&self) -> u64 {
        self.limit
    }

    /// The number of bytes of the encoded chunk, if it does not depend on the numbers.
    pub(super) fn length(&self) -> Option<u64> {
        let is_fixed = self.steps.iter().all(|(step, _)| !matches!(step, Step::Compression(_)));
        (is_fixed && matches!(self.packing, Packing::Bytes { .. })).then_some(self.limit)
    }

    /// The maximum number of bytes that decoding takes, with those that it is given and returns.
    pub(super) fn memory(&self) -> u64 {
        self.memory
    }

    /// Decodes a chunk into numbers in the machine's byte order. The error says what is wrong with it.
    pub(super) fn decode(&self, mut code: Cow<[u8]>) -> Result<Vec<u8>, String> {
        if code.len() as u64 > self.limit {
            return Err(format!("the size of an encoded chunk is {}, expected at most {}", code.len(), self.limit));
        }
        for (step, limit) in self.steps.iter().rev() {
            code = step.decode(code, *limit)?;
        }
        let code = match &self.packing {
            Packing::Bytes { .. } => code,
            Packing::Shards(layout, codecs) => Cow::Owned(layout.decode(&code, codecs)?),
        };
        if code.len() as u64 != self.bytes {
            return Err(format!("the size of a decoded chunk is {}, expected {}", code.len(), self.bytes));
        }
        let mut decoded = code.into_owned();
        let is_swapped = matches!(self.packing, Packing::Bytes { is_swapped: true });
        match self.element {
            1 => self.arrange::<1>(&mut decoded, false),
            2 => self.arrange::<2>(&mut decoded, is_swapped),
            4 => self.arrange::<4>(&mut decoded, is_swapped),
            _ => self.arrange::<8>(&mut decoded, is_swapped),
        }
        Ok(decoded)
    }

    /// Puts the bytes of numbers, and the numbers, in their order.
    fn arrange<const N: usize>(&self, bytes: &mut Vec<u8>, is_swapped: bool) {
        if is_swapped {
            bytes.as_chunks_mut::<N>().0.iter_mut().for_each(|number| number.reverse());
        }
        let Some(last) = self.shape.len().checked_sub(1).filter(|_| !self.order.is_sorted()) else { return };
        let shape: Vec<usize> = self.shape.iter().map(|&size| size as usize).collect();
        // How far apart neighbours along an axis are stored.
        let (mut strides, mut stride) = (vec![0; shape.len()], 1);
        for &axis in self.order.iter().rev() {
            strides[axis] = stride;
            stride *= shape[axis];
        }
        let stored = bytes.as_chunks::<N>().0;
        let (mut numbers, mut place) = (Vec::with_capacity(stored.len()), vec![0; last]);
        while numbers.len() < stored.len() {
            let from: usize = place.iter().zip(&strides).map(|(at, stride)| at * stride).sum();
            numbers.extend(stored[from..].iter().step_by(strides[last]).take(shape[last]));
            for axis in (0..last).rev() {
                place[axis] = (place[axis] + 1) % shape[axis];
                if place[axis] > 0 {
                    break;
                }
            }
        }
        *bytes = numbers.into_flattened();
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use std::path::Path;

    use serde_json::{Value, json};

    use super::*;

    /// The codecs of a chunk of 16-bit numbers, whose fill value is 9.
    fn codecs(list: &Value, shape: &[u64]) -> Result<Codecs, String> {
        let file = json!({ "codecs": list });
        let list = Json::new(Path::new("zarr.json"), &file).get("codecs");
        Codecs::read(&list, shape, &9_u16.to_ne_bytes()).map_err(|error| error.to_string())
    }

    fn decode(list: &Value, shape: &[u64], code: &[u8]) -> Result<Vec<u16>, String> {
        let bytes = codecs(list, shape).unwrap().decode(Cow::Borrowed(code))?;
        assert_eq!(Ok(&bytes), codecs(list, shape).unwrap().decode(Cow::Owned(code.to_vec())).as_ref());
        Ok(bytes.as_chunks().0.iter().map(|&number| u16::from_ne_bytes(number)).collect())
    }

    fn bytes(endian: &str) -> Value {
        json!({"name": "bytes", "configuration": {"endian": endian}})
    }

    fn transpose(order: &[u64]) -> Value {
        json!({"name": "transpose", "configuration": {"order": order}})
    }

    fn little(numbers: impl IntoIterator<Item = u16>) -> Vec<u8> {
        numbers.into_iter().flat_map(u16::to_le_bytes).collect()
    }

    fn checked(bytes: &[u8]) -> Vec<u8> {
        [bytes, &crc32c::crc32c(bytes).to_le_bytes()].concat()
    }

    #[test]
    fn numbers_in_either_order_of_bytes() {
        let code = [1, 2, 3, 4];
        assert_eq!(decode(&json!([bytes("little")]), &[2], &code), Ok(vec![0x201, 0x403]));
        assert_eq!(decode(&json!([bytes("big")]), &[2], &code), Ok(vec![0x102, 0x304]));
        let error = |shape: u64| decode(&json!([bytes("big")]), &[shape], &code).unwrap_err();
        assert_eq!(error(3), "the size of a decoded chunk is 4, expected 6");
        assert_eq!(error(1), "the size of an encoded chunk is 4, expected at most 2");
    }

    #[test]
    fn axes_in_any_order() {
        let shape = [2, 3, 4];
        // The value of a number tells its place.
        let value = |place: [u64; 3]| (100 * place[0] + 10 * place[1] + place[2]) as u16;
        let places = |sizes: [u64; 3]| {
            let rows = move |a| (0..sizes[1]).flat_map(move |b| (0..sizes[2]).map(move |c| [a, b, c]));
            (0..sizes[0]).flat_map(rows)
        };
        let expected: Vec<u16> = places(shape).map(value).collect();
        for order in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
            let stored = places(order.map(|axis| shape[axis as usize])).map(|stored| {
                let mut place = [0; 3];
                order.iter().zip(stored).for_each(|(&axis, at)| place[axis as usize] = at);
                value(place)
            });
            let code = little(stored);
            assert_eq!(
                decode(&json!([transpose(&order), bytes("little")]), &shape, &code).unwrap(),
                expected,
                "{order:?}"
            );
            let big: Vec<u8> = code.as_chunks().0.iter().flat_map(|&[low, high]| [high, low]).collect();
            assert_eq!(decode(&json!([transpose(&order), bytes("big")]), &shape, &big).unwrap(), expected, "{order:?}");
            // The same in two steps: first the last two axes change places.
            let first = order.map(|axis| [0, 2, 1][axis as usize]);
            let list = json!([transpose(&[0, 2, 1]), transpose(&first), bytes("little")]);
            assert_eq!(decode(&list, &shape, &code).unwrap(), expected, "{order:?}");
        }
    }

    #[test]
    fn checksums_are_checked() {
        let list = json!([bytes("little"), "crc32c"]);
        assert_eq!(crc32c::crc32c(b"123456789"), 0xe306_9283);
        let code = checked(&little([1, 2]));
        assert_eq!((decode(&list, &[2], &code), codecs(&list, &[2]).unwrap().length()), (Ok(vec![1, 2]), Some(8)));
        for at in 0..code.len() {
            let mut damaged = code.clone();
            damaged[at] ^= 1;
            let error = decode(&list, &[2], &damaged).unwrap_err();
            assert_eq!(error, "another checksum (crc32c) than that of the bytes", "{at}");
        }
        assert_eq!(decode(&list, &[2], &code[..3]).unwrap_err(), "fewer bytes than a checksum has");
    }

    #[test]
    fn shuffled_bytes() {
        let list = |element: u64| json!([bytes("little"), {"name": "numcodecs.shuffle", "configuration": {"elementsize": element}}]);
        assert_eq!(decode(&list(2), &[3], &[1, 2, 3, 0, 0, 1]), Ok(vec![1, 2, 0x103]));
        assert_eq!(decode(&list(4), &[3], &[0; 6]).unwrap_err(), "6 bytes, shuffled in elements of 4");
        assert_eq!(decode(&list(u64::MAX), &[3], &[]).unwrap_err(), "the size of a decoded chunk is 0, expected 6");
    }

    /// Two chunks of 1 × 2 numbers, the second at the beginning, and one that is absent, in shards that are chunks of shards.
    #[test]
    fn shards_in_shards() {
        let shards = |chunk: &[u64], codecs: Value, place: &str| {
            json!({"name": "sharding_indexed", "configuration": {
                "chunk_shape": chunk, "codecs": codecs, "index_codecs": [bytes("little"), "crc32c"], "index_location": place,
            }})
        };
        let inner = |place: &str| shards(&[1, 2], json!([bytes("little")]), place);
        let index =
            |numbers: &[u64]| checked(&numbers.iter().flat_map(|number| number.to_le_bytes()).collect::<Vec<_>>());
        let numbers = little([30, 40, 10, 20]);
        let none = u64::MAX;
        let end = [numbers.clone(), index(&[4, 4, none, none, 0, 4])].concat();
        assert_eq!(decode(&json!([inner("end")]), &[1, 6], &end).unwrap(), [10, 20, 9, 9, 30, 40]);
        assert_eq!(decode(&json!([inner("end")]), &[3, 2], &end).unwrap(), [10, 20, 9, 9, 30, 40]);
        let start = [index(&[56, 4, none, none, 52, 4]), numbers].concat();
        assert_eq!(
            decode(&json!([inner("start"), "crc32c"]), &[3, 2], &checked(&start)).unwrap(),
            [10, 20, 9, 9, 30, 40]
        );
        assert_eq!(
            decode(&json!([transpose(&[1, 0]), inner("start")]), &[2, 3], &start).unwrap(),
            [10, 9, 30, 20, 9, 40]
        );
        let nested = json!([shards(&[3, 2], json!([inner("start")]), "end")]);
        let whole = [start.clone(), index(&[none, none, 0, start.len() as u64])].concat();
        assert_eq!(decode(&nested, &[3, 4], &whole).unwrap(), [9, 9, 10, 20, 9, 9, 9, 9, 9, 9, 30, 40]);
        for (numbers, words) in [
            ([56, 4, none, none, 57, 4], "bytes 57..61 of a shard of 60"),
            ([none - 2, 4, 0, 0, 0, 0], "an index that leads out of the shard"),
            ([none, 0, 0, 0, 0, 0], "of a shard of 60"),
            ([52, 8, 0, 0, 0, 0], "the size of an encoded chunk is 8, expected at most 4"),
            ([52, 2, 0, 0, 0, 0], "the size of a decoded chunk is 2, expected 4"),
        ] {
            let error = decode(&json!([inner("start")]), &[3, 2], &[index(&numbers), start[52..].to_vec()].concat());
            assert!(error.clone().unwrap_err().contains(words), "{error:?}");
        }
        let error = decode(&json!([inner("start")]), &[3, 2], &start[..51]).unwrap_err();
        assert_eq!(error, "a shard of 51 bytes, whose index alone takes 52");
        // Alone they are read chunk by chunk.
        assert!(codecs(&nested, &[3, 4]).unwrap().split().1.is_some());
        assert!(codecs(&json!([inner("start"), "crc32c"]), &[3, 2]).unwrap().split().1.is_none());
        assert!(codecs(&json!([transpose(&[1, 0]), inner("start")]), &[2, 3]).unwrap().split().1.is_none());
    }

    #[test]
    fn what_is_not_allowed_is_named() {
        let sharded = |key: &str, value: Value| {
            let mut configuration =
                json!({"chunk_shape": [1, 2], "codecs": [bytes("big")], "index_codecs": [bytes("big")]});
            configuration[key] = value;
            json!([{"name": "sharding_indexed", "configuration": configuration}])
        };
        let place = "codecs[0].configuration";
        for (list, words) in [
            (json!([]), "codecs: found \"[]\", allowed: one of bytes and sharding_indexed"),
            (json!([bytes("big"), bytes("big")]), "allowed: one of bytes and sharding_indexed"),
            (
                json!([bytes("big"), "jpeg"]),
                "codecs[1]: found \"jpeg\", allowed: blosc, bz2, gzip, shuffle, zlib, zstd",
            ),
            (json!([{"name": "jpeg"}, bytes("big")]), "codecs[0].name: found \"jpeg\""),
            (json!([bytes("middle")]), "codecs[0].configuration.endian: found \"middle\", allowed: little or big"),
            (json!([{"name": "bytes", "configuration": {"size": 2}}]), "codecs[0].configuration.size: found \"2\""),
            (
                json!([bytes("big"), {"name": "crc32c", "configuration": {"location": "start"}}]),
                "codecs[1].configuration.location",
            ),
            (
                json!([transpose(&[0]), bytes("big")]),
                "codecs[0].configuration.order: found \"[0]\", allowed: a list of the 2 axes",
            ),
            (json!([transpose(&[0, 0]), bytes("big")]), "found \"[0,0]\""),
            (json!([transpose(&[0, 2]), bytes("big")]), "found \"[0,2]\""),
            (json!(vec![bytes("big"); 17]), "allowed: at most 16 codecs"),
            (sharded("chunk_shape", json!([1, 3])), &format!("{place}.chunk_shape: found \"[1,3]\"")),
            (sharded("chunk_shape", json!([0, 2])), &format!("{place}.chunk_shape: found \"[0,2]\"")),
            (sharded("chunk_shape", json!([2])), &format!("{place}.chunk_shape: found \"[2]\"")),
            (sharded("codecs", json!(["jpeg"])), &format!("{place}.codecs[0]: found \"jpeg\"")),
            (sharded("codecs", Value::Null), &format!("{place}.codecs: found nothing")),
            (sharded("index_codecs", json!([bytes("big"), "gzip"])), &format!("{place}.index_codecs: found")),
            (
                sharded("index_location", json!("middle")),
                &format!("{place}.index_location: found \"middle\", allowed: start or end"),
            ),
            (sharded("size", json!(1)), &format!("{place}.size: found \"1\"")),
        ] {
            let error = codecs(&list, &[2, 4]).err().unwrap();
            assert!(error.starts_with("zarr.json: codecs") && error.contains(words), "{error}\n{words}");
        }
        let many = codecs(&sharded("chunk_shape", json!([1, 2])), &[1 << 40, 1 << 40]).err().unwrap();
        assert!(many.contains("at most 4194304"), "{many}");
    }

    /// Shapes whose numbers no machine holds, and what the steps take.
    #[test]
    fn bounds_of_bytes() {
        let gzip = json!([bytes("big"), "gzip"]);
        let huge = codecs(&gzip, &[u64::MAX, u64::MAX]).unwrap();
        assert_eq!((huge.limit(), huge.memory()), (u64::MAX, u64::MAX));
        assert!(huge.decode(Cow::Borrowed(&[])).is_err());
        let list = |count: usize| [vec![bytes("big")], vec![json!("gzip"); count]].concat();
        for count in 1..8 {
            // No number of compressions makes a step take more than twice the bytes, and 64 KiB.
            let codecs = codecs(&json!(list(count)), &[100]).unwrap();
            assert_eq!((codecs.limit(), codecs.length()), (400 + 65536, None));
            assert!(codecs.memory() <= 2 * codecs.limit());
        }
        assert_eq!(codecs(&json!([transpose(&[1, 0]), bytes("big")]), &[2, 4]).unwrap().memory(), 32);
    }
}
