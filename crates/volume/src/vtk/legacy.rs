//! Legacy VTK files: a text header of keywords and values, with arbitrary line breaks, then the samples as text or as big-endian bytes.

use std::io::{self, BufRead, Read};
use std::path::Path;

use glam::{DVec3, UVec3};

use super::super::VolumeError;
use super::super::access::Access;
use super::super::error::volume::{invalid, io_error};
use super::super::fields::Fields;
use super::super::grid::{SIZES, dims_of};
use super::super::loaded::Loaded;
use super::super::numbers::TextEnd;
use super::super::sample_type::SampleType;
use super::super::samples::Samples;
use super::super::source::{MAX_HEADER, Source};
use super::super::stream::Stream;
use super::super::text::{number, shown, three};
use super::super::unit;
use super::rectilinear::{Coordinates, resampled};

/// The keywords of coordinates.
const COORDINATES: [&str; 3] = ["X_COORDINATES", "Y_COORDINATES", "Z_COORDINATES"];

/// The keywords that may follow an array.
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

/// Reads a file's first array with one component.
pub(in super::super) fn read(path: &Path, access: &Access) -> Result<Loaded, VolumeError> {
    let mut header = Header::open(path, access)?;
    let array = header.find_array()?;
    let (dims, kind, spacing) = (header.dims(&array)?, array.kind, header.spacing()?);
    let coordinates = header.coordinates(array.of_cells)?;
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
    match coordinates {
        Some(coordinates) => resampled(path, coordinates, loaded, access),
        None => Ok(Loaded { spacing, ..loaded }),
    }
}

/// Refuses a file in which anything but another array follows the samples. `left` is the number of bytes from the samples on.
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

/// A file whose header has been read up to the samples.
struct Header {
    file: Source,
    is_text: bool,
    is_rectilinear: bool,
    fields: Fields,
    /// The coordinates that have been read, in the order x, y, z.
    places: [Option<Vec<f64>>; 3],
    budget: u64,
}

/// What the header says about the samples.
struct Array {
    kind: SampleType,
    of_cells: bool,
    /// The number of points or cells.
    count: u64,
}

impl Header {
    /// Reads the first two lines, and the word that says how samples are written.
    fn open(path: &Path, access: &Access) -> Result<Self, VolumeError> {
        let mut file = access.open(path)?;
        let mut budget = MAX_HEADER;
        let mut line = || Ok(file.line(&mut budget)?.unwrap_or_default());
        let [magic, _title] = [line()?, line()?];
        if !magic.starts_with("# vtk DataFile Version") {
            return Err(invalid(path, "magic", shown(&magic), "a first line # vtk DataFile Version"));
        }
        let (fields, places) = (Fields::new(path.to_owned()), Default::default());
        let mut header = Self { file, is_text: false, is_rectilinear: false, fields, places, budget };
        let encoding = header.next_word()?.unwrap_or_default();
        header.is_text = match encoding.to_ascii_uppercase().as_str() {
            "ASCII" => true,
            "BINARY" => false,
            _ => return Err(invalid(path, "encoding", shown(&encoding), "ASCII or BINARY")),
        };
        Ok(header)
    }

    /// The next word, across line breaks; `None` at the end of the file.
    fn next_word(&mut self) -> Result<Option<String>, VolumeError> {
        let mut word = Vec::new();
        while let Some(&byte) = self.file.reader.fill_buf().map_err(io_error(&self.file.path))?.first() {
            if byte.is_ascii_whitespace() && !word.is_empty() {
                break;
            }
            self.budget = self
                .budget
                .checked_sub(1)
                .ok_or_else(|| self.fields.invalid("header", "more", format!("less than {MAX_HEADER} bytes")))?;
            self.file.reader.consume(1);
            if !byte.is_ascii_whitespace() {
                word.push(byte);
            }
        }
        Ok((!word.is_empty()).then(|| String::from_utf8_lossy(&word).into_owned()))
    }

    fn word(&mut self) -> Result<String, VolumeError> {
        self.next_word()?.ok_or_else(|| {
            self.fields.invalid("header", "the end of the file", "SCALARS, or an array of FIELD, with one component")
        })
    }

    fn words<const N: usize>(&mut self) -> Result<[String; N], VolumeError> {
        let mut words = [const { String::new() }; N];
        for word in &mut words {
            *word = self.word()?;
        }
        Ok(words)
    }

    /// Reads on to the samples of the first array with one component.
    fn find_array(&mut self) -> Result<Array, VolumeError> {
        let mut section: Option<(bool, u64)> = None;
        loop {
            let keyword = self.word()?.to_ascii_uppercase();
            match (keyword.as_str(), section) {
                ("DATASET", _) => {
                    let kind = self.word()?;
                    self.is_rectilinear = match kind.to_ascii_uppercase().as_str() {
                        "STRUCTURED_POINTS" => false,
                        "RECTILINEAR_GRID" => true,
                        _ => return Err(self.unknown(&format!("DATASET {kind}"))),
                    }
                }
                (name @ ("DIMENSIONS" | "SPACING" | "ASPECT_RATIO" | "ORIGIN"), None) => {
                    let values: [String; 3] = self.words()?;
                    let text = values.join(" ");
                    if values.iter().any(|value| value.parse::<f64>().is_err()) {
                        return Err(self.fields.invalid(name, shown(&text), "three numbers"));
                    }
                    self.fields.add(name, &text)?;
                }
                (name, None) if COORDINATES.contains(&name) => {
                    let [count, kind] = self.words()?;
                    let (count, kind) = (self.number(name, &count)?, self.kind(&kind)?);
                    self.begin_samples()?;
                    let places = self.numbers(name, kind, count)?;
                    let axis = COORDINATES.iter().position(|known| *known == name).unwrap_or_default();
                    self.places[axis] = Some(places);
                }
                (name @ ("POINT_DATA" | "CELL_DATA"), _) => {
                    let count = self.word()?;
                    section = Some((name == "CELL_DATA", self.number(name, &count)?));
                }
                ("METADATA", _) => self.skip_metadata()?,
                ("SCALARS", Some((of_cells, count))) => {
                    let _name = self.word()?;
                    // The number of components may be missing, so these words are on one line.
                    let line = self.file.line(&mut self.budget)?.unwrap_or_default();
                    let mut words = line.split_whitespace();
                    let kind = words.next().unwrap_or_default();
                    let components = words.next().map_or(Ok(1), |number| self.number("SCALARS", number))?;
                    let [lookup_table, _name] = self.words()?;
                    if !lookup_table.eq_ignore_ascii_case("LOOKUP_TABLE") {
                        let allowed = "LOOKUP_TABLE in the next line";
                        return Err(self.fields.invalid("SCALARS", shown(&lookup_table), allowed));
                    }
                    self.begin_samples()?;
                    if components == 1 && kind != "bit" {
                        return Ok(Array { kind: self.kind(kind)?, of_cells, count });
                    }
                    self.skip(kind, count.saturating_mul(components))?;
                }
                ("VECTORS" | "NORMALS", Some((_, count))) => self.skip_tuples(3, count)?,
                ("TENSORS", Some((_, count))) => self.skip_tuples(9, count)?,
                ("TENSORS6", Some((_, count))) => self.skip_tuples(6, count)?,
                ("GLOBAL_IDS" | "PEDIGREE_IDS", Some((_, count))) => self.skip_tuples(1, count)?,
                (name @ "TEXTURE_COORDINATES", Some((_, count))) => {
                    let [_name, components, kind] = self.words()?;
                    let components = self.number(name, &components)?;
                    self.begin_samples()?;
                    self.skip(&kind, count.saturating_mul(components))?;
                }
                // Bytes, or as text fractions of 255.
                (name @ "COLOR_SCALARS", Some((_, count))) => {
                    let [_name, components] = self.words()?;
                    let components = self.number(name, &components)?;
                    self.begin_samples()?;
                    self.skip("unsigned_char", count.saturating_mul(components))?;
                }
                // The same for red, green, blue and A of each entry.
                (name @ "LOOKUP_TABLE", _) => {
                    let [_name, entries] = self.words()?;
                    let entries = self.number(name, &entries)?;
                    self.begin_samples()?;
                    self.skip("unsigned_char", entries.saturating_mul(4))?;
                }
                ("FIELD", _) => {
                    let [_name, arrays] = self.words()?;
                    let arrays = self.number("FIELD", &arrays)?;
                    if let Some(array) = self.find_in_field(arrays, section)? {
                        return Ok(array);
                    }
                }
                (other, _) => return Err(self.unknown(other)),
            }
        }
    }

    fn unknown(&self, found: &str) -> VolumeError {
        let allowed = "a file of STRUCTURED_POINTS with DIMENSIONS, SPACING, ORIGIN, or RECTILINEAR_GRID with DIMENSIONS and coordinates, then POINT_DATA or CELL_DATA with SCALARS or FIELD";
        self.fields.invalid("header", shown(found), allowed)
    }

    /// Reads on to the first of `arrays` arrays that has one number per point or cell, or past the last one.
    fn find_in_field(&mut self, arrays: u64, section: Option<(bool, u64)>) -> Result<Option<Array>, VolumeError> {
        let mut found = 0;
        while found < arrays {
            let name = self.word()?;
            if name == "METADATA" {
                self.skip_metadata()?;
                continue;
            }
            let [components, tuples, kind] = self.words()?;
            let (components, tuples) = (self.number(&name, &components)?, self.number(&name, &tuples)?);
            self.begin_samples()?;
            let is_wanted = |&(_, count): &(bool, u64)| (components, tuples) == (1, count);
            let is_number = !["bit", "string", "variant"].contains(&kind.to_ascii_lowercase().as_str());
            if let Some((of_cells, count)) = section.filter(is_wanted).filter(|_| is_number) {
                return Ok(Some(Array { kind: self.kind(&kind)?, of_cells, count }));
            }
            self.skip(&kind, components.saturating_mul(tuples))?;
            found += 1;
        }
        Ok(None)
    }

    /// Goes to the first sample: text begins at the next word, binary data in the next line.
    fn begin_samples(&mut self) -> Result<(), VolumeError> {
        if !self.is_text {
            self.file.line(&mut self.budget)?;
        }
        Ok(())
    }

    /// Skips an array's metadata, up to a blank line.
    fn skip_metadata(&mut self) -> Result<(), VolumeError> {
        let _rest_of_line = self.file.line(&mut self.budget)?;
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

    /// Skips an array of which a name and a type are stated, with as many numbers for each of `count` points or cells.
    fn skip_tuples(&mut self, numbers: u64, count: u64) -> Result<(), VolumeError> {
        let [_name, kind] = self.words()?;
        self.begin_samples()?;
        self.skip(&kind, count.saturating_mul(numbers))
    }

    /// Skips `samples` samples of the type with a name. Eight bits are a byte, and a string as text is a word.
    fn skip(&mut self, kind: &str, samples: u64) -> Result<(), VolumeError> {
        let bytes = match kind.to_ascii_lowercase().as_str() {
            "bit" => samples.div_ceil(8),
            "string" if self.is_text => 0,
            _ => samples.saturating_mul(self.kind(kind)?.bytes()),
        };
        let path = &self.file.path;
        let skipped = if self.is_text {
            skip_words(&mut self.file.reader, samples)
        } else {
            io::copy(&mut self.file.reader.by_ref().take(bytes), &mut io::sink()).map(|skipped| skipped == bytes)
        };
        match skipped.map_err(io_error(path))? {
            true => Ok(()),
            false => Err(invalid(path, "data", "the end of the file", format!("{samples} samples of an array"))),
        }
    }

    fn dims(&self, array: &Array) -> Result<UVec3, VolumeError> {
        let points = self.points()?;
        // A flat grid has one layer of cells.
        let dims = if array.of_cells { (points - 1).max(UVec3::ONE) } else { points };
        let voxels = u64::from(dims.element_product());
        if voxels == array.count {
            return Ok(dims);
        }
        let name = if array.of_cells { "CELL_DATA" } else { "POINT_DATA" };
        Err(self.fields.invalid(name, array.count, format!("{voxels}, as DIMENSIONS says")))
    }

    /// The next numbers, of a header.
    fn numbers(&mut self, name: &str, kind: SampleType, count: u64) -> Result<Vec<f64>, VolumeError> {
        if self.is_text {
            let mut bytes = Vec::new();
            for _ in 0..count {
                let word = self.word()?;
                let allowed = || format!("{count} numbers of type {kind}");
                kind.parse(&word, &mut bytes).ok_or_else(|| self.fields.invalid(name, shown(&word), allowed()))?;
            }
            return Ok(kind.numbers(&bytes, cfg!(target_endian = "big")));
        }
        let expected = count.saturating_mul(kind.bytes());
        if expected > self.budget {
            return Err(self.fields.invalid(name, count, format!("coordinates of less than {MAX_HEADER} bytes")));
        }
        let mut bytes = Vec::new();
        self.file.reader.by_ref().take(expected).read_to_end(&mut bytes).map_err(io_error(&self.file.path))?;
        self.budget -= expected;
        if bytes.len() as u64 != expected {
            return Err(self.fields.invalid(name, "the end of the file", format!("{count} numbers of type {kind}")));
        }
        Ok(kind.numbers(&bytes, true))
    }

    /// The coordinates of points or cells; `None` if the grid is regular.
    fn coordinates(&mut self, of_cells: bool) -> Result<Option<[Coordinates; 3]>, VolumeError> {
        if !self.is_rectilinear {
            return Ok(None);
        }
        let dims = self.points()?.to_array();
        let mut all = Vec::new();
        for (axis, name) in COORDINATES.into_iter().enumerate() {
            let places = self.places[axis].take().unwrap_or_default();
            if places.len() != dims[axis] as usize {
                let allowed = format!("{}, as DIMENSIONS says", dims[axis]);
                return Err(self.fields.invalid(name, format!("{} numbers", places.len()), allowed));
            }
            let coordinates = Coordinates { name: name.to_owned(), places };
            all.push(if of_cells { coordinates.of_cells() } else { coordinates });
        }
        Ok(all.try_into().ok())
    }

    /// The number of points along each axis.
    fn points(&self) -> Result<UVec3, VolumeError> {
        self.fields.value("DIMENSIONS", SIZES, |text| {
            dims_of(three(text?.split_whitespace().map(|size| size.parse::<u32>().ok()))?)
        })
    }

    fn spacing(&self) -> Result<Option<DVec3>, VolumeError> {
        let names = ["SPACING", "ASPECT_RATIO"];
        let Some(name) = names.into_iter().find(|name| self.fields.get(name).is_some()) else { return Ok(None) };
        self.fields.value(name, "three positive finite numbers, or 0", |text| {
            let spacing = three(text?.split_whitespace().map(number))?;
            unit::known((&self.fields.path, name), spacing).map(Some)
        })
    }
}

/// The types' names. A long has 8 bytes, as on the systems where most of these files come from.
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

/// Skips `words` words with the space before each; `false` if there are fewer.
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
