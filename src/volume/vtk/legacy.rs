//! The older files: a text header of keywords, then the samples as text or, big-endian, as they are.

use std::io::{self, BufRead, Read};
use std::path::Path;

use glam::{DVec3, UVec3};

use super::super::VolumeError;
use super::super::access::Access;
use super::super::fields::Fields;
use super::super::loaded::Loaded;
use super::super::numbers::TextEnd;
use super::super::samples::{SIZES, SampleType, Samples, Stream, Voxel, dims_of};
use super::super::source::{MAX_HEADER, Source, invalid, io_error, number, shown, three};

/// What may follow an array.
const KEYWORDS: &[&str] = &[
    "METADATA",
    "FIELD",
    "SCALARS",
    "COLOR_SCALARS",
    "LOOKUP_TABLE",
    "VECTORS",
    "NORMALS",
    "TENSORS",
    "TENSORS6",
    "TEXTURE_COORDINATES",
    "GLOBAL_IDS",
    "PEDIGREE_IDS",
    "POINT_DATA",
    "CELL_DATA",
];

/// Reads the first array of single numbers in one file.
pub(in super::super) fn read<T: Voxel>(path: &Path, access: &Access) -> Result<Loaded<T>, VolumeError> {
    let mut header = Header::open(path, access)?;
    let array = header.find_array()?;
    let (dims, kind, spacing) = (header.dims(&array)?, array.kind, header.spacing()?);
    let Header { mut file, is_text, .. } = header;
    let big_endian = !is_text || cfg!(target_endian = "big");
    let samples = Samples { kind, dims, big_endian, rescale: None, z_fastest: false };
    let stream = if is_text {
        Stream::text(file, kind, TextEnd::Words(KEYWORDS))?
    } else {
        check_rest(path, access, file.left()?, &samples)?;
        Stream::raw(file)?
    };
    let loaded = Loaded::new(dims, kind, stream.samples(&samples, !is_text)?);
    Ok(Loaded { spacing, ..loaded })
}

/// Refuses a file in which something else than another array follows the samples, whose beginning has `left` bytes after it.
fn check_rest(path: &Path, access: &Access, left: u64, samples: &Samples) -> Result<(), VolumeError> {
    let mut stream = Stream::raw(access.open(path)?)?;
    let all = stream.exactly_left().unwrap_or_default();
    stream.skip(all.saturating_sub(left).saturating_add(samples.bytes()))?;
    let rest = stream.bytes(stream.exactly_left().unwrap_or_default().min(4096))?;
    let rest = String::from_utf8_lossy(&rest);
    match rest.split_whitespace().next() {
        Some(word) if !KEYWORDS.contains(&word) => Err(samples.mismatch(path, left)),
        _ => Ok(()),
    }
}

/// A file whose header is read as far as the samples.
struct Header {
    file: Source,
    is_text: bool,
    fields: Fields,
    budget: u64,
}

/// What is said of the samples.
struct Array {
    kind: SampleType,
    of_cells: bool,
    /// How many points or cells there are.
    count: u64,
}

impl Header {
    /// Reads the first three lines.
    fn open(path: &Path, access: &Access) -> Result<Self, VolumeError> {
        let mut file = access.open(path)?;
        let mut budget = MAX_HEADER;
        let mut line = || Ok(file.line(&mut budget)?.unwrap_or_default());
        let [magic, _title, encoding] = [line()?, line()?, line()?];
        if !magic.starts_with("# vtk DataFile Version") {
            return Err(invalid(path, "magic", shown(&magic), "a first line # vtk DataFile Version"));
        }
        let is_text = match encoding.trim() {
            "ASCII" => true,
            "BINARY" => false,
            other => return Err(invalid(path, "encoding", shown(other), "ASCII or BINARY")),
        };
        Ok(Self { file, is_text, fields: Fields::new(path.to_owned()), budget })
    }

    /// The words of the next line that is not blank.
    fn words(&mut self) -> Result<Vec<String>, VolumeError> {
        while let Some(line) = self.file.line(&mut self.budget)? {
            let words: Vec<String> = line.split_whitespace().map(str::to_owned).collect();
            if !words.is_empty() {
                return Ok(words);
            }
        }
        Err(self.fields.invalid("header", "the end of the file", "SCALARS, or an array of FIELD, with one component"))
    }

    /// Reads on to the samples of the first array of single numbers.
    fn find_array(&mut self) -> Result<Array, VolumeError> {
        let mut section: Option<(bool, u64)> = None;
        loop {
            let words = self.words()?;
            let words: Vec<&str> = words.iter().map(String::as_str).collect();
            match (words.as_slice(), section) {
                (["DATASET", "STRUCTURED_POINTS"], _) => {}
                ([name @ ("DIMENSIONS" | "SPACING" | "ASPECT_RATIO" | "ORIGIN"), values @ ..], None) => {
                    self.fields.add(name, &values.join(" "))?;
                }
                ([name @ ("POINT_DATA" | "CELL_DATA"), count], _) => {
                    let count = self.number(name, count)?;
                    section = Some((*name == "CELL_DATA", count));
                }
                (["METADATA", ..], _) => self.skip_metadata()?,
                (["SCALARS", _name, kind, components @ ..], Some((of_cells, count))) => {
                    let kind = self.kind(kind)?;
                    let components = components.first().map_or(Ok(1), |number| self.number("SCALARS", number))?;
                    match self.words()?.first().map(String::as_str) {
                        Some("LOOKUP_TABLE") => {}
                        other => {
                            let found = shown(other.unwrap_or_default());
                            return Err(self.fields.invalid("SCALARS", found, "LOOKUP_TABLE in the next line"));
                        }
                    }
                    if components == 1 {
                        return Ok(Array { kind, of_cells, count });
                    }
                    self.skip(kind, count.saturating_mul(components))?;
                }
                (["VECTORS" | "NORMALS", _name, kind], Some((_, count))) => {
                    let kind = self.kind(kind)?;
                    self.skip(kind, count.saturating_mul(3))?;
                }
                (["FIELD", _name, arrays], _) => {
                    let arrays = self.number("FIELD", arrays)?;
                    if let Some(array) = self.find_in_field(arrays, section)? {
                        return Ok(array);
                    }
                }
                _ => {
                    let allowed = "a file of STRUCTURED_POINTS with DIMENSIONS, SPACING, ORIGIN, then POINT_DATA or CELL_DATA \
                                   with SCALARS or FIELD";
                    return Err(self.fields.invalid("header", shown(&words.join(" ")), allowed));
                }
            }
        }
    }

    /// Reads on to the first of some arrays that has a number for each point or cell, or behind the last one.
    fn find_in_field(&mut self, arrays: u64, section: Option<(bool, u64)>) -> Result<Option<Array>, VolumeError> {
        let mut found = 0;
        while found < arrays {
            let words = self.words()?;
            let words: Vec<&str> = words.iter().map(String::as_str).collect();
            let [name, components, tuples, kind] = words.as_slice() else {
                if words[0] == "METADATA" {
                    self.skip_metadata()?;
                    continue;
                }
                let allowed = "name, components, tuples and type of an array";
                return Err(self.fields.invalid("FIELD", shown(&words.join(" ")), allowed));
            };
            let (components, tuples) = (self.number(name, components)?, self.number(name, tuples)?);
            let kind = self.kind(kind)?;
            if let Some((of_cells, count)) = section.filter(|&(_, count)| (components, tuples) == (1, count)) {
                return Ok(Some(Array { kind, of_cells, count }));
            }
            self.skip(kind, components.saturating_mul(tuples))?;
            found += 1;
        }
        Ok(None)
    }

    /// Skips what is said of an array, up to a blank line.
    fn skip_metadata(&mut self) -> Result<(), VolumeError> {
        while self.file.line(&mut self.budget)?.is_some_and(|line| !line.trim().is_empty()) {}
        Ok(())
    }

    fn number(&self, field: &str, text: &str) -> Result<u64, VolumeError> {
        text.parse().map_err(|_| self.fields.invalid(field, shown(text), "a number of points, cells or components"))
    }

    fn kind(&self, name: &str) -> Result<SampleType, VolumeError> {
        let known = TYPES.iter().find(|(known, _)| known.eq_ignore_ascii_case(name));
        known.map(|&(_, kind)| kind).ok_or_else(|| {
            let names: Vec<&str> = TYPES.iter().map(|&(name, _)| name).collect();
            self.fields.invalid("type", shown(name), names.join(", "))
        })
    }

    /// Skips so many samples.
    fn skip(&mut self, kind: SampleType, samples: u64) -> Result<(), VolumeError> {
        let path = &self.file.path;
        let skipped = if self.is_text {
            skip_words(&mut self.file.reader, samples)
        } else {
            let bytes = samples.saturating_mul(kind.bytes());
            io::copy(&mut self.file.reader.by_ref().take(bytes), &mut io::sink()).map(|skipped| skipped == bytes)
        };
        match skipped.map_err(io_error(path))? {
            true => Ok(()),
            false => Err(invalid(path, "data", "the end of the file", format!("{samples} samples of an array"))),
        }
    }

    fn dims(&self, array: &Array) -> Result<UVec3, VolumeError> {
        let points: UVec3 = self.fields.value("DIMENSIONS", SIZES, |text| {
            dims_of(three(text?.split_whitespace().map(|size| size.parse::<u32>().ok()))?)
        })?;
        // A flat grid has cells all the same.
        let dims = if array.of_cells { (points - 1).max(UVec3::ONE) } else { points };
        let voxels = u64::from(dims.element_product());
        if voxels == array.count {
            return Ok(dims);
        }
        let name = if array.of_cells { "CELL_DATA" } else { "POINT_DATA" };
        Err(self.fields.invalid(name, array.count, format!("{voxels}, as DIMENSIONS says")))
    }

    fn spacing(&self) -> Result<Option<DVec3>, VolumeError> {
        let names = ["SPACING", "ASPECT_RATIO"];
        let Some(name) = names.into_iter().find(|name| self.fields.get(name).is_some()) else { return Ok(None) };
        self.fields.value(name, "three positive finite numbers", |text| {
            let spacing = three(text?.split_whitespace().map(number))?;
            spacing.iter().all(|&spacing| spacing > 0.0).then_some(Some(DVec3::from_array(spacing)))
        })
    }
}

/// The types' names; a long has 8 bytes, as where most of these files come from.
const TYPES: &[(&str, SampleType)] = &[
    ("char", SampleType::I8),
    ("signed_char", SampleType::I8),
    ("unsigned_char", SampleType::U8),
    ("short", SampleType::I16),
    ("unsigned_short", SampleType::U16),
    ("int", SampleType::I32),
    ("unsigned_int", SampleType::U32),
    ("vtkIdType", SampleType::I32),
    ("long", SampleType::I64),
    ("unsigned_long", SampleType::U64),
    ("vtktypeint64", SampleType::I64),
    ("vtktypeuint64", SampleType::U64),
    ("float", SampleType::F32),
    ("double", SampleType::F64),
];

/// Skips words, and the space before each; `false` if there are too few.
fn skip_words(reader: &mut impl BufRead, words: u64) -> io::Result<bool> {
    let mut left = words;
    let mut in_word = false;
    loop {
        let buffer = reader.fill_buf()?;
        let length = buffer.len();
        let ends = buffer.iter().position(|byte| {
            let is_space = byte.is_ascii_whitespace();
            left -= u64::from(in_word && is_space);
            in_word = !is_space;
            left == 0
        });
        match ends {
            Some(end) => {
                reader.consume(end);
                return Ok(true);
            }
            None if length == 0 => return Ok(left == u64::from(in_word)),
            None => reader.consume(length),
        }
    }
}
