//! The metadata of an array as plain data: `zarr.json` of [version 3] and `.zarray` of [version 2].
//!
//! [version 3]: <https://zarr-specs.readthedocs.io/en/latest/v3/core/index.html>
//! [version 2]: <https://zarr-specs.readthedocs.io/en/latest/v2/v2.0.html>

use std::path::PathBuf;

use serde_json::Value;

use super::super::VolumeError;
use super::super::error::volume::invalid;
use super::codec::{Codec, Codecs};
use super::extension::Extension;
use super::json::{self, Json};
use super::keys::Keys;
use super::number::Number;
use super::steps::Step;

/// An array's metadata.
pub(super) struct Metadata {
    pub(super) shape: Vec<u64>,
    pub(super) number: Number,
    /// The bytes of the fill value in the machine's order; of zero, where version 2 states none.
    pub(super) fill: Vec<u8>,
    pub(super) has_fill: bool,
    pub(super) chunk_keys: ChunkKeys,
    /// The codecs of a chunk or a shard, which know its shape.
    pub(super) codecs: Codecs,
}

/// The names of chunks.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct ChunkKeys {
    prefix: Option<&'static str>,
    separator: &'static str,
}

/// The file with the metadata of the array at a path of a store, and what it holds.
pub(super) fn find(keys: &Keys, path: &str) -> Result<(PathBuf, Value), VolumeError> {
    for name in ["zarr.json", ".zarray"] {
        let key = if path.is_empty() { name.to_owned() } else { format!("{path}/{name}") };
        if let Some(bytes) = keys.metadata(&key)? {
            let file = keys.file(&key);
            let value = json::parse(&file, &bytes)?;
            return Ok((file, value));
        }
    }
    Err(invalid(&keys.file(path), "array", "nothing", "an array: zarr.json or .zarray"))
}

/// The names of an array's axes: its `dimension_names`, or the `_ARRAY_DIMENSIONS` among the attributes that xarray writes in version 2; an empty list if
/// it states none. An axis without a name has an empty one.
pub(super) fn axis_names(keys: &Keys, path: &str, file: &Json, axes: usize) -> Result<Vec<String>, VolumeError> {
    let allowed = format!("a list of {axes} names, one for each axis");
    let read = |names: Json| -> Result<Vec<String>, VolumeError> {
        if !names.is_some() {
            return Ok(Vec::new());
        }
        let list = names.list(&allowed)?;
        let name = |name: &Json| match name.value() {
            Some(Value::Null) => Some(String::new()),
            _ => name.text().map(str::to_owned),
        };
        let named = list.iter().map(name).collect::<Option<Vec<_>>>().filter(|named| named.len() == axes);
        named.ok_or_else(|| names.invalid(&allowed))
    };
    if !file.is_in(".zarray") {
        return read(file.get("dimension_names"));
    }
    let key = if path.is_empty() { ".zattrs".to_owned() } else { format!("{path}/.zattrs") };
    let Some(bytes) = keys.metadata(&key)? else { return Ok(Vec::new()) };
    let file = keys.file(&key);
    let attributes = json::parse(&file, &bytes)?;
    read(Json::new(&file, &attributes).get("_ARRAY_DIMENSIONS"))
}

impl Metadata {
    /// Reads what a file with one of the two names holds.
    pub(super) fn read(file: &Json) -> Result<Self, VolumeError> {
        let is_old = file.is_in(".zarray");
        file.get("zarr_format").expect(&Value::from(if is_old { 2 } else { 3 }))?;
        if is_old { Self::version_2(file) } else { Self::version_3(file) }
    }

    fn version_3(file: &Json) -> Result<Self, VolumeError> {
        file.get("node_type").expect(&"array".into())?;
        let transformers = file.get("storage_transformers");
        for transformer in if transformers.is_some() { transformers.list("a list")? } else { Vec::new() } {
            let transformer = Extension::read(&transformer)?;
            if !transformer.is_optional {
                return Err(transformer.name.invalid("no storage transformer"));
            }
        }
        let Extension { name, configuration, .. } = Extension::read(&file.get("data_type"))?;
        let number = name.text().and_then(Number::named).ok_or_else(|| name.invalid(&Number::names()))?;
        configuration.only(&[])?;
        let fill_value = file.get("fill_value");
        let fill = fill_value.value().and_then(|value| number.fill(value));
        let fill = fill.ok_or_else(|| fill_value.invalid(&number.fills()))?;
        let Extension { name, configuration, .. } = Extension::read(&file.get("chunk_grid"))?;
        name.expect(&"regular".into())?;
        configuration.only(&["chunk_shape"])?;
        let (shape, chunk) = shapes(&file.get("shape"), &configuration.get("chunk_shape"))?;
        let Extension { name, configuration, .. } = Extension::read(&file.get("chunk_key_encoding"))?;
        configuration.only(&["separator"])?;
        let separator = configuration.get("separator");
        let chunk_keys = match name.text() {
            Some("default") => ChunkKeys { prefix: Some("c"), separator: separator_of(&separator, "/")? },
            Some("v2") => ChunkKeys { prefix: None, separator: separator_of(&separator, ".")? },
            _ => return Err(name.invalid("default or v2")),
        };
        let codecs = Codecs::read(&file.get("codecs"), &chunk, &fill)?;
        Ok(Self { shape, number, fill, has_fill: true, chunk_keys, codecs })
    }

    fn version_2(file: &Json) -> Result<Self, VolumeError> {
        let dtype = file.get("dtype");
        let number = dtype.text().and_then(Number::of_dtype);
        let (number, is_big_endian) = number
            .ok_or_else(|| dtype.invalid("|b1, |i1, |u1, or < or > with one of i2, i4, i8, u2, u4, u8, f2, f4, f8"))?;
        let fill_value = file.get("fill_value");
        let fill = match fill_value.value() {
            Some(Value::Number(truth)) if number == Number::Bool => number.parse(&truth.to_string()),
            Some(value) => number.fill(value),
            None => number.parse("0"),
        };
        let fill = fill.ok_or_else(|| fill_value.invalid(&format!("null, or {}", number.fills())))?;
        let (shape, chunk) = shapes(&file.get("shape"), &file.get("chunks"))?;
        let separator = separator_of(&file.get("dimension_separator"), ".")?;
        let order = file.get("order");
        let mut codecs = match order.text() {
            Some("C") => Vec::new(),
            Some("F") => vec![Codec::Transpose((0..shape.len()).rev().collect())],
            _ => return Err(order.invalid("C or F")),
        };
        codecs.push(Codec::Bytes { is_big_endian });
        let (filters, compressor) = (file.get("filters"), file.get("compressor"));
        let filters = if filters.is_some() { filters.list("null or a list")? } else { Vec::new() };
        for codec in filters.iter().chain(compressor.is_some().then_some(&compressor)) {
            codecs.push(Codec::Step(Step::read(&codec.get("id"), codec)?));
        }
        let codecs = Codecs::new(file, codecs, &chunk, &fill)?;
        let (has_fill, chunk_keys) = (fill_value.is_some(), ChunkKeys { prefix: None, separator });
        Ok(Self { shape, number, fill, has_fill, chunk_keys, codecs })
    }
}

/// The shapes of an array and of its chunks.
fn shapes(shape: &Json, chunk: &Json) -> Result<(Vec<u64>, Vec<u64>), VolumeError> {
    let array = shape.integers("a list of sizes")?;
    let allowed = format!("{} positive sizes, as many as the array has", array.len());
    let sizes = chunk.integers(&allowed)?;
    if sizes.len() != array.len() || sizes.contains(&0) {
        return Err(chunk.invalid(&allowed));
    }
    Ok((array, sizes))
}

fn separator_of(separator: &Json, default: &'static str) -> Result<&'static str, VolumeError> {
    match separator.text() {
        None if !separator.is_some() => Ok(default),
        Some("/") => Ok("/"),
        Some(".") => Ok("."),
        _ => Err(separator.invalid("/ or .")),
    }
}

impl ChunkKeys {
    /// The name of the chunk at a place in the grid of chunks.
    pub(super) fn name(&self, place: &[u64]) -> String {
        let prefix = self.prefix.map(str::to_owned);
        let parts: Vec<String> = prefix.into_iter().chain(place.iter().map(u64::to_string)).collect();
        parts.join(self.separator)
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use std::path::Path;

    use serde_json::json;

    use super::super::super::sample_type::SampleType;
    use super::*;

    fn version_2() -> Value {
        json!({
            "zarr_format": 2, "shape": [2, 3, 4], "chunks": [2, 3, 2], "dtype": "<u2", "fill_value": 7, "order": "C",
            "compressor": null, "filters": null,
        })
    }

    fn version_3() -> Value {
        json!({
            "zarr_format": 3, "node_type": "array", "shape": [2, 3, 4], "data_type": "uint16", "fill_value": 7,
            "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": [2, 3, 2]}},
            "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}},
            "codecs": [{"name": "bytes", "configuration": {"endian": "little"}}, "gzip"],
        })
    }

    fn read(value: &Value) -> Result<Metadata, String> {
        let name = if value["zarr_format"] == 2 { ".zarray" } else { "zarr.json" };
        Metadata::read(&Json::new(Path::new(name), value)).map_err(|error| error.to_string())
    }

    /// Reads metadata in which a value is replaced; without it, where the value is null.
    fn with(mut metadata: Value, key: &str, value: Value) -> Result<Metadata, String> {
        metadata[key] = value;
        read(&metadata)
    }

    #[track_caller]
    fn assert_refused(result: Result<Metadata, String>, words: &str) {
        let error = result.err().unwrap();
        assert!(error.contains(words), "{error}\n{words}");
    }

    #[test]
    fn types_of_version_2() {
        let numbers = |dtype: &str| {
            let read = with(version_2(), "dtype", json!(dtype)).unwrap();
            assert_eq!(read.fill.len() as u64, read.number.kind().bytes());
            read.number
        };
        for (dtype, kind) in [
            ("|i1", SampleType::I8),
            ("|u1", SampleType::U8),
            ("<i2", SampleType::I16),
            (">u2", SampleType::U16),
            (">i4", SampleType::I32),
            ("<u4", SampleType::U32),
            ("<i8", SampleType::I64),
            (">u8", SampleType::U64),
            ("<f2", SampleType::F16),
            (">f2", SampleType::F16),
            ("<f4", SampleType::F32),
            (">f8", SampleType::F64),
        ] {
            assert_eq!(numbers(dtype), Number::Sample(kind), "{dtype}");
        }
        assert_eq!(Number::of_dtype("|b1"), Some((Number::Bool, false)));
        let half = Number::Sample(SampleType::F16);
        assert_eq!((Number::of_dtype("<f2"), Number::of_dtype(">f2")), (Some((half, false)), Some((half, true))));
        for dtype in ["u2", "|u2", "=u2", "<u1", "<b1", "<b2", "<f1", "<c8", "|S4", "<M8[s]", "<", "", "<u3", "<ü"] {
            assert_refused(with(version_2(), "dtype", json!(dtype)), ".zarray: dtype: found \"");
        }
    }

    #[test]
    fn what_version_2_may_leave_out() {
        let plain = read(&version_2()).unwrap();
        assert_eq!((plain.shape, plain.codecs.shape()), (vec![2, 3, 4], &[2, 3, 2][..]));
        assert_eq!((plain.chunk_keys.name(&[0, 10, 2]), plain.codecs.length()), ("0.10.2".to_owned(), Some(24)));
        assert!(plain.has_fill && plain.fill == 7_u16.to_ne_bytes());
        for key in ["compressor", "filters", "dimension_separator"] {
            let mut metadata = version_2();
            metadata.as_object_mut().unwrap().remove(key);
            assert_eq!(read(&metadata).unwrap().codecs.length(), Some(24), "{key}");
        }
        let null = with(version_2(), "fill_value", Value::Null).unwrap();
        assert!(!null.has_fill && null.fill == [0, 0]);
        let slash = with(version_2(), "dimension_separator", json!("/")).unwrap();
        assert_eq!(slash.chunk_keys.name(&[0, 10, 2]), "0/10/2");
        assert_eq!(with(version_2(), "filters", json!([])).unwrap().codecs.length(), Some(24));
        assert_eq!(with(version_2(), "compressor", json!({"id": "zlib", "level": 1})).unwrap().codecs.length(), None);
        for (key, value, words) in [
            ("zarr_format", json!(3), "zarr.json: node_type: found nothing, allowed: \"array\""),
            ("order", json!("K"), "order: found \"K\", allowed: C or F"),
            ("order", Value::Null, "order: found nothing"),
            ("dimension_separator", json!("_"), "dimension_separator: found \"_\", allowed: / or ."),
            ("chunks", json!([2, 3]), "chunks: found \"[2,3]\", allowed: 3 positive sizes"),
            ("chunks", json!([2, 3, 0]), "chunks: found \"[2,3,0]\""),
            ("shape", json!([2, 3, -4]), "shape: found \"[2,3,-4]\""),
            ("filters", json!("none"), "filters: found \"none\", allowed: null or a list"),
            (
                "filters",
                json!([{"id": "delta"}]),
                "filters[0].id: found \"delta\", allowed: blosc, bz2, gzip, shuffle, zlib, zstd",
            ),
            ("filters", json!([{"id": "shuffle", "elementsize": 0}]), "filters[0].elementsize: found \"0\""),
            ("compressor", json!({"id": "lzma"}), "compressor.id: found \"lzma\""),
            ("compressor", json!({"id": "bytes"}), "compressor.id: found \"bytes\""),
            ("compressor", json!("zlib"), "compressor.id: found nothing"),
        ] {
            assert_refused(with(version_2(), key, value), words);
        }
    }

    #[test]
    fn spellings_of_version_3() {
        let plain = read(&version_3()).unwrap();
        assert_eq!((plain.shape, plain.codecs.shape()), (vec![2, 3, 4], &[2, 3, 2][..]));
        assert!(plain.has_fill && plain.fill == 7_u16.to_ne_bytes());
        for (encoding, name) in [
            (json!("default"), "c/0/10/2"),
            (json!({"name": "default", "configuration": {"separator": "."}}), "c.0.10.2"),
            (json!({"name": "v2", "configuration": {}}), "0.10.2"),
            (json!({"name": "v2", "configuration": {"separator": "/"}}), "0/10/2"),
        ] {
            let read = with(version_3(), "chunk_key_encoding", encoding).unwrap();
            assert_eq!(read.chunk_keys.name(&[0, 10, 2]), name);
        }
        for (key, value) in [
            ("data_type", json!({"name": "uint16"})),
            ("data_type", json!({"name": "uint16", "configuration": {}})),
            ("dimension_names", json!(["z", null, "x"])),
            ("another", json!({"must_understand": false})),
            ("storage_transformers", json!([])),
            ("storage_transformers", json!([{"name": "x", "must_understand": false}])),
            ("codecs", json!([{"name": "bytes", "configuration": {"endian": "big"}, "must_understand": true}])),
            ("codecs", json!([{"name": "endian", "configuration": {"endian": "big"}}])),
            (
                "codecs",
                json!([{"name": "bytes", "configuration": {"endian": "big"}}, {"name": "jpeg", "must_understand": false}]),
            ),
        ] {
            let read = with(version_3(), key, value.clone()).unwrap_or_else(|error| panic!("{value}: {error}"));
            assert_eq!((read.number, read.codecs.shape()), (Number::Sample(SampleType::U16), &[2, 3, 2][..]));
        }
        for (key, value, words) in [
            ("zarr_format", json!("3"), "zarr_format: found \"3\", allowed: 3"),
            ("node_type", json!("group"), "node_type: found \"group\", allowed: \"array\""),
            ("data_type", json!("complex64"), "data_type: found \"complex64\", allowed: int8, uint8"),
            ("data_type", json!({"name": "r16"}), "data_type.name: found \"r16\""),
            ("data_type", json!(16), "data_type: found \"16\", allowed: a name"),
            (
                "data_type",
                json!({"name": "uint16", "configuration": {"unit": "s"}}),
                "data_type.configuration.unit: found \"s\"",
            ),
            (
                "data_type",
                json!({"name": "uint16", "configuration": 3}),
                "data_type.configuration: found \"3\", allowed: an object",
            ),
            ("data_type", json!({"name": "uint16", "must_understand": 3}), "data_type.must_understand: found \"3\""),
            ("fill_value", Value::Null, "fill_value: found nothing, allowed: a whole number of the type uint16"),
            ("chunk_grid", json!("rectilinear"), "chunk_grid: found \"rectilinear\", allowed: \"regular\""),
            ("chunk_grid", json!("regular"), "chunk_grid.configuration.chunk_shape: found nothing"),
            ("chunk_key_encoding", json!("flat"), "chunk_key_encoding: found \"flat\", allowed: default or v2"),
            ("chunk_key_encoding", Value::Null, "chunk_key_encoding: found nothing"),
            (
                "storage_transformers",
                json!(["x"]),
                "storage_transformers[0]: found \"x\", allowed: no storage transformer",
            ),
            ("storage_transformers", json!({}), "storage_transformers: found \"{}\", allowed: a list"),
            ("codecs", json!({}), "codecs: found \"{}\", allowed: a list of codecs"),
            ("codecs", json!(["bytes"]), "codecs[0].configuration.endian: found nothing, allowed: little or big"),
            ("codecs", json!([7]), "codecs[0]: found \"7\", allowed: a name"),
        ] {
            assert_refused(with(version_3(), key, value), &format!("zarr.json: {words}"));
        }
    }

    /// Version 3 has only true and false.
    #[test]
    fn booleans_of_version_2() {
        for (value, expected) in
            [(json!(1), Some(vec![1])), (json!(0), Some(vec![0])), (json!(true), Some(vec![1])), (json!(2), None)]
        {
            let mut metadata = version_2();
            metadata["dtype"] = json!("|b1");
            assert_eq!(with(metadata, "fill_value", value).ok().map(|read| read.fill), expected);
        }
    }
}
