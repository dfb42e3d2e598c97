//! NRRD files: a text header, then the samples in the same file or in one or more data files.
//!
//! Axes are the array's. Fields that describe the meaning of samples (`old min`, `kinds`, …) do not change the volume.

use std::collections::BTreeMap;
use std::io::{BufRead, Read};
use std::path::Path;

use glam::{DMat3, DVec3, UVec3};

use super::VolumeError;
use super::access::Access;
use super::data_files::DataFiles;
use super::error::volume::{invalid, io_error};
use super::fields::Fields;
use super::grid::{SIZES, dims_of};
use super::loaded::{Legend, Loaded};
use super::numbers::TextEnd;
use super::orientation::{Orientation, RAS_FROM_LPS};
use super::sample_type::SampleType;
use super::samples::Samples;
use super::series::{MAX_CHANNELS, Series, SeriesOrder};
use super::shear::{self, Lattice};
use super::source::{MAX_HEADER, Source};
use super::stream::Stream;
use super::text::{lower, shown, three, vector};
use super::unit::{self, NON_UNIFORM, warn_of_itk};
use super::voxels::Voxels;

/// The field with the axes, which need not be at right angles.
const DIRECTIONS: &str = "space directions";

/// Reads one NRRD file, or the detached header and the data file it names.
pub(super) fn read(path: &Path, access: &Access) -> Result<Loaded, VolumeError> {
    let mut file = access.open(path)?;
    let header = Header::read(&mut file)?;
    let axes = header.axes()?;
    let dims = header.dims(&axes)?;
    let Place { lattice, orientation, unit } = header.place(&axes)?;
    let left_handed = orientation.is_none() && lattice.is_some_and(|lattice| header.is_left_handed(lattice.axes));
    let layout = header.layout(dims, axes.series)?;
    let values = match header.data_files()? {
        Some(files) if axes.series.count() > 1 && files.count() > 1 => {
            return Err(header.0.invalid("data file", format!("{} files", files.count()), "one file of four axes"));
        }
        Some(files) => {
            files.read(path, "data file", &layout.samples, access, |file, samples| layout.read(file, samples))?
        }
        None => layout.read(file, &layout.samples)?,
    };
    let loaded = Loaded::new(dims, layout.samples.kind, values);
    let spacing = lattice.map(|lattice| lattice.spacing);
    let series = axes.series;
    let legends = header.legends(series);
    warn_of_itk(path, header.1.get(NON_UNIFORM).map(String::as_str));
    let value_unit = header.value_unit();
    let loaded = Loaded { spacing, unit, value_unit, orientation, left_handed, legends, series, ..loaded };
    match lattice {
        Some(lattice) => lattice.straighten(path, DIRECTIONS, loaded, access),
        None => Ok(loaded),
    }
}

/// The meaning of a file's axes.
struct Axes {
    /// The one of five axes that has one sample and is left out.
    left_out: Option<usize>,
    /// The one of the other axes that is not in space.
    other: Option<usize>,
    series: Series,
}

impl Axes {
    /// The words about axes in space.
    fn in_space<'a>(&self, words: impl Iterator<Item = &'a str>) -> impl Iterator<Item = &'a str> {
        without(without(words, self.left_out), self.other)
    }
}

/// Where the voxels lie, as far as a file states it.
struct Place {
    lattice: Option<Lattice>,
    orientation: Option<Orientation>,
    unit: Option<String>,
}

/// The words about all axes but one.
fn without<'a>(words: impl Iterator<Item = &'a str>, axis: Option<usize>) -> impl Iterator<Item = &'a str> {
    words.enumerate().filter(move |(at, _)| Some(*at) != axis).map(|(_, word)| word)
}

/// The fields of a header under the first of their spellings, its key/value pairs, and the names of files in a list at its end.
struct Header(Fields, BTreeMap<String, String>, Vec<String>);

impl Header {
    /// Reads the header and leaves `file` where attached data begins.
    fn read(file: &mut Source) -> Result<Self, VolumeError> {
        let mut magic = Vec::new();
        file.reader.by_ref().take(10).read_until(b'\n', &mut magic).map_err(io_error(&file.path))?;
        let magic = String::from_utf8_lossy(&magic);
        let version = magic.strip_suffix("\r\n").or(magic.strip_suffix('\n')).and_then(|m| m.strip_prefix("NRRD000"));
        if !matches!(version, Some("1" | "2" | "3" | "4" | "5")) {
            return Err(invalid(&file.path, "magic", shown(&magic), "a first line NRRD0001 to NRRD0005"));
        }
        let mut header = Self(Fields::new(file.path.clone()), BTreeMap::new(), Vec::new());
        let mut budget = MAX_HEADER;
        while let Some(line) = file.line(&mut budget)? {
            if line.is_empty() {
                return Ok(header);
            }
            header.add(&line)?;
            if header.0.get("data file").is_some_and(is_list) {
                header.2 = file.lines(&mut budget)?;
            }
        }
        match header.0.get("data file") {
            Some(_) => Ok(header),
            None => Err(header.0.invalid("header", "the end of the file", "a blank line before the data")),
        }
    }

    /// Adds a line that is not blank.
    fn add(&mut self, line: &str) -> Result<(), VolumeError> {
        if line.starts_with('#') {
            return Ok(());
        }
        // A line is `key:=value` or `field: value`, whichever delimiter comes first: a value may contain the other one. Some writers omit
        // the space.
        let delimits =
            |&(at, _): &(usize, &str)| matches!(line.as_bytes().get(at + 1), Some(b'=' | b' ' | b'\t') | None);
        let Some((at, _)) = line.match_indices(':').find(delimits).or_else(|| line.match_indices(':').next()) else {
            return Err(self.0.invalid("header", shown(line), "`field: value`, `key:=value` or `# comment`"));
        };
        let (name, value) = line.split_at(at);
        let value = value.strip_prefix(':').unwrap_or(value);
        if let Some(value) = value.strip_prefix('=') {
            self.1.insert(name.trim().to_owned(), value.trim().to_owned());
            return Ok(());
        }
        let name = name.trim().to_ascii_lowercase();
        let name = match name.as_str() {
            "datafile" => "data file",
            "lineskip" => "line skip",
            "byteskip" => "byte skip",
            name => name,
        };
        self.0.add(name, value)
    }

    /// The axes in space, and the fourth one: the channels of a voxel if it is the first axis, times if it is the last, unless its kind says that
    /// these are channels.
    fn axes(&self) -> Result<Axes, VolumeError> {
        let dimension = self.0.value("dimension", "3 or 4, or 5 if an axis has one sample", |text| {
            text?.parse::<usize>().ok().filter(|dimension| (3..=5).contains(dimension))
        })?;
        if dimension == 3 {
            return Ok(Axes { left_out: None, other: None, series: Series::default() });
        }
        let mut sizes = self.0.value("sizes", &format!("{dimension} positive integers"), |text| {
            let sizes: Option<Vec<u32>> = text?.split_whitespace().map(|size| size.parse().ok()).collect();
            sizes.filter(|sizes| sizes.len() == dimension && sizes.iter().all(|&size| size > 0))
        })?;
        let kinds = self.0.get("kinds").map(lower).unwrap_or_default();
        let kinds: Vec<&str> = kinds.split_whitespace().collect();
        let in_space = |kind: &str| ["domain", "space", "???", "none"].contains(&kind);
        let words = self.0.get(DIRECTIONS).or(self.0.get("spacings")).map(lower).unwrap_or_default();
        let words: Vec<&str> =
            if words.contains('(') { vector_words(&words) } else { words.split_whitespace().collect() };
        let is_none = |word: &str| ["none", "nan"].contains(&word);
        // If there are several, this is the last one that is not in space, or else the last one.
        let in_no_space = |&axis: &usize| {
            kinds.get(axis).is_some_and(|kind| !in_space(kind)) || words.get(axis).is_some_and(|word| is_none(word))
        };
        let single = || (0..dimension).rev().filter(|&axis| sizes[axis] == 1);
        let left_out = if dimension == 5 { single().find(in_no_space).or(single().next()) } else { None };
        if dimension == 5 && left_out.is_none() {
            return Err(self.0.invalid("sizes", format!("{sizes:?}"), "five of which one is 1"));
        }
        let kinds: Vec<&str> = without(kinds.into_iter(), left_out).collect();
        let words: Vec<&str> = without(words.into_iter(), left_out).collect();
        if let Some(axis) = left_out {
            sizes.remove(axis);
        }
        let by_kind = kinds.iter().position(|kind| !in_space(kind));
        let by_direction = words.iter().position(|word| is_none(word));
        let other = by_kind.or(by_direction).unwrap_or(3);
        let is_time = match kinds.get(other) {
            Some(&"time") => true,
            Some(kind) if !in_space(kind) => false,
            _ => other == 3,
        };
        let count = sizes[other];
        let is_color = match kinds.get(other) {
            Some(&"rgb-color") => count == 3,
            Some(&"rgba-color") => count == 4,
            _ => false,
        };
        let series = match (other, is_time) {
            (0, false) => Series { channels: count, times: 1, order: SeriesOrder::Interleaved, is_color },
            (3, false) => Series { channels: count, times: 1, order: SeriesOrder::ChannelsFirst, is_color },
            (3, true) => Series { channels: 1, times: count, order: SeriesOrder::ChannelsFirst, is_color: false },
            _ => {
                let found = format!("axis {other} of four that is not in space");
                return Err(self.0.invalid("kinds", found, "axis 0 (channels), or axis 3 (channels or times)"));
            }
        };
        if series.channels > MAX_CHANNELS {
            return Err(self.0.invalid("sizes", format!("{count} channels"), format!("at most {MAX_CHANNELS}")));
        }
        Ok(Axes { left_out, other: Some(other), series })
    }

    fn dims(&self, axes: &Axes) -> Result<UVec3, VolumeError> {
        self.0.value("sizes", SIZES, |text| {
            dims_of(three(axes.in_space(text?.split_whitespace()).map(|size| size.parse::<u32>().ok()))?)
        })
    }

    fn place(&self, axes: &Axes) -> Result<Place, VolumeError> {
        match (self.0.get("spacings"), self.0.get(DIRECTIONS)) {
            (None, None) => Ok(Place { lattice: None, orientation: None, unit: self.unit(axes, DVec3::ONE).0 }),
            (None, Some(_)) => {
                let vectors = self.directions(axes)?;
                let along = |axis: usize| vectors.iter().map(|vector| vector[axis].abs()).fold(0.0, f64::max);
                let (unit, factors) = self.unit(axes, DVec3::new(along(0), along(1), along(2)));
                let lattice = Lattice::of(vectors.map(|vector| factors * vector));
                let lattice = lattice.map_err(|found| self.0.invalid(DIRECTIONS, found, shear::allowed()))?;
                let orientation = self.orientation(lattice.axes, factors)?;
                Ok(Place { lattice: Some(lattice), orientation, unit })
            }
            (Some(_), None) => {
                let spacings = self.0.value("spacings", "three positive finite numbers, or 0 or NaN", |text| {
                    let spacings = three(axes.in_space(text?.split_whitespace()).map(|word| word.parse().ok()))?;
                    unit::known((&self.0.path, "spacings"), spacings)
                })?;
                let (unit, factors) = self.unit(axes, spacings);
                let lattice = Some(Lattice::straight(factors * spacings, DMat3::IDENTITY));
                Ok(Place { lattice, orientation: None, unit })
            }
            (Some(_), Some(_)) => {
                let allowed = "one of `spacings` and `space directions`";
                Err(self.0.invalid(DIRECTIONS, "`spacings` as well", allowed))
            }
        }
    }

    /// The unit, and the factors of lengths along the axes of space, or of the array: quoted names.
    fn unit(&self, axes: &Axes, spacing: DVec3) -> (Option<String>, DVec3) {
        let quoted = |text: &'_ str| text.split('"').skip(1).step_by(2).map(str::to_owned).collect::<Vec<_>>();
        let (field, names) = match (self.0.get("space units").map(quoted), self.0.get("units").map(quoted)) {
            (Some(names), _) => ("space units", names),
            (None, Some(names)) if names.len() == 3 => ("units", names),
            (None, Some(names)) => {
                ("units", axes.in_space(names.iter().map(String::as_str)).map(str::to_owned).collect())
            }
            (None, None) => return (None, DVec3::ONE),
        };
        match names.as_slice() {
            [x, y, z] => unit::shared((&self.0.path, field), spacing, [x, y, z].map(|name| Some(name.as_str()))),
            _ => (None, DVec3::ONE),
        }
    }

    /// The unit of the values.
    fn value_unit(&self) -> Option<String> {
        let stated = self.0.get("sample units")?.trim().trim_matches('"');
        (!stated.is_empty()).then(|| stated.to_owned())
    }

    /// The names and colours of segments, as 3D Slicer writes them: `Segment0_LabelValue:=3`, `Segment0_Name:=liver`, and three numbers in [0, 1],
    /// `Segment0_Color:=0.5 0.68 0.2`. Where segments overlap, labels lie in several layers, which are channels: `Segment0_Layer:=1`.
    fn legends(&self, series: Series) -> Vec<Legend> {
        let legend = |layer: Option<u32>| {
            let names = self.segments("_Name", layer).map(|(label, name)| (label, name.clone())).collect();
            Legend { names, palette: self.palette(layer), are_labels: false }
        };
        if series.channels > 1 {
            (0..series.channels).map(|layer| legend(Some(layer))).collect()
        } else {
            vec![legend(None)]
        }
    }

    /// The colours of the segments of a layer, or of all.
    fn palette(&self, layer: Option<u32>) -> Option<Vec<(f64, DVec3)>> {
        let color = |text: &String| {
            let numbers: Option<Vec<f64>> = text.split_whitespace().map(|number| number.parse().ok()).collect();
            let [red, green, blue] = numbers?.try_into().ok()?;
            Some(DVec3::new(red, green, blue))
                .filter(|color| color.cmpge(DVec3::ZERO).all() && color.cmple(DVec3::ONE).all())
        };
        let colors = self.segments("_Color", layer).filter_map(|(label, text)| Some((label as f64, color(text)?)));
        Legend::ascending(colors.collect())
    }

    /// The labels of the segments of a layer, or of all, and what is said of each by a key with some end.
    fn segments(&self, end: &str, layer: Option<u32>) -> impl Iterator<Item = (u64, &String)> {
        self.1.iter().filter_map(move |(key, value)| {
            let segment = key.strip_suffix("_LabelValue").filter(|segment| segment.starts_with("Segment"))?;
            // One that states no layer lies in the first.
            let own = self.1.get(&format!("{segment}_Layer")).map_or(Some(0), |layer| layer.parse().ok());
            if layer.is_some_and(|layer| own != Some(layer)) {
                return None;
            }
            Some((value.parse().ok()?, self.1.get(&format!("{segment}{end}"))?))
        })
    }

    /// The vectors of `space directions`.
    fn directions(&self, of: &Axes) -> Result<[DVec3; 3], VolumeError> {
        let allowed = "three vectors (x,y,z) of positive finite length, none of them `none`";
        self.0.value(DIRECTIONS, allowed, |text| {
            // That of an axis which is not in space is `none`.
            let text = lower(text?);
            let words: Vec<&str> = without(vector_words(&text).into_iter(), of.left_out).collect();
            let is_there = of.other.is_none_or(|other| words.get(other) == Some(&"none"));
            let axes = three(without(words.into_iter(), of.other).map(vector)).filter(|_| is_there)?;
            axes.iter().all(|axis| axis.length() > 0.0 && axis.length().is_finite()).then_some(axes)
        })
    }

    /// The orientation for axes with these directions; `None` in a space that is not a patient's.
    fn orientation(&self, axes: DMat3, factors: DVec3) -> Result<Option<Orientation>, VolumeError> {
        let ras_from_space = match self.0.get("space").map(lower).as_deref() {
            Some("right-anterior-superior" | "ras") => DVec3::ONE,
            Some("left-anterior-superior" | "las") => DVec3::new(-1.0, 1.0, 1.0),
            Some("left-posterior-superior" | "lps") => RAS_FROM_LPS,
            _ => return Ok(None),
        };
        let origin = self.0.value("space origin", "a vector (x,y,z)", |text| text.map_or(Some(DVec3::ZERO), vector))?;
        let axes = DMat3::from_diagonal(ras_from_space) * axes;
        Ok(Some(Orientation { axes, origin: ras_from_space * factors * origin }))
    }

    /// Whether axes with these directions are left-handed, in a space that is right-handed unless it says otherwise.
    fn is_left_handed(&self, axes: DMat3) -> bool {
        let space = self.0.get("space").map(lower).unwrap_or_default();
        let is_left_handed = space.starts_with("3d-left-handed") || space.starts_with("3dlh");
        (axes.determinant() < 0.0) != is_left_handed
    }

    /// The data files; `None` if the samples are in the header's own file.
    fn data_files(&self) -> Result<Option<DataFiles>, VolumeError> {
        let Some(value) = self.0.get("data file") else { return Ok(None) };
        let header = &self.0.path;
        let axes = |text: &str| text.parse().ok().filter(|axes| (1..=3).contains(axes));
        let files = match value.split_whitespace().collect::<Vec<_>>().as_slice() {
            [] => None,
            ["LIST"] => Some(DataFiles::listed(header, self.2.clone(), 2)),
            ["LIST", each] => axes(each).map(|axes| DataFiles::listed(header, self.2.clone(), axes)),
            &[pattern, min, max, step] if pattern.contains('%') => {
                DataFiles::numbered(header, [pattern, min, max, step], 2)
            }
            &[pattern, min, max, step, each] if pattern.contains('%') => {
                axes(each).and_then(|axes| DataFiles::numbered(header, [pattern, min, max, step], axes))
            }
            _ => Some(DataFiles::one(header, value)),
        };
        let allowed = "the name of one file, a pattern with one %d and the numbers `min max step`, or LIST and names in the lines after \
                       it; behind the last two how many axes a file has whole, 1 to 3";
        files.map(Some).ok_or_else(|| self.0.invalid("data file", shown(value), allowed))
    }

    fn layout(&self, dims: UVec3, series: Series) -> Result<Layout, VolumeError> {
        let kind = self.0.value("type", TYPES, |text| sample_type(text?))?;
        let allowed = if cfg!(feature = "bzip2") {
            "raw, gzip or gz, bzip2 or bz2, ascii, text or txt, or hex"
        } else {
            "raw, gzip or gz, ascii, text or txt, or hex; not compiled in: bzip2 or bz2 (the feature bzip2)"
        };
        let encoding = self.0.value("encoding", allowed, |text| {
            Some(match lower(text?).as_str() {
                "raw" => Encoding::Raw,
                "gzip" | "gz" => Encoding::Gzip,
                #[cfg(feature = "bzip2")]
                "bzip2" | "bz2" => Encoding::Bzip2,
                "ascii" | "text" | "txt" => Encoding::Text,
                "hex" => Encoding::Hex,
                _ => return None,
            })
        })?;
        let big_endian = self.0.value("endian", "little or big", |text| match text.map(lower).as_deref() {
            Some("little") => Some(false),
            Some("big") => Some(true),
            None if kind.bytes() == 1 || encoding == Encoding::Text => Some(false),
            _ => None,
        })?;
        let line_skip = self.0.value("line skip", "a number of lines", |text| text.unwrap_or("0").parse().ok())?;
        let byte_skip =
            self.0.value("byte skip", "a number of bytes, or -1 if encoding is raw", |text| match text {
                Some("-1") => (encoding == Encoding::Raw).then_some(None),
                text => text.unwrap_or("0").parse().ok().map(Some),
            })?;
        let skips = self.0.get("line skip").or(self.0.get("byte skip")).is_some();
        let window = skips && self.0.get("data file").is_some();
        // Text is converted to samples in the machine's byte order.
        let big_endian = if encoding == Encoding::Text { cfg!(target_endian = "big") } else { big_endian };
        let samples = Samples { kind, dims, big_endian, rescale: None, z_fastest: false };
        Ok(Layout { samples, series, encoding, line_skip, byte_skip, window })
    }
}

const TYPES: &str = "int8, uint8, int16, uint16, int32, uint32, int64, uint64, float, double, or their C names";

fn sample_type(text: &str) -> Option<SampleType> {
    let words: Vec<_> = text.split_whitespace().map(lower).collect();
    Some(match words.join(" ").as_str() {
        "signed char" | "int8" | "int8_t" => SampleType::I8,
        "uchar" | "unsigned char" | "uint8" | "uint8_t" => SampleType::U8,
        "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => SampleType::I16,
        "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => SampleType::U16,
        "int" | "signed int" | "int32" | "int32_t" => SampleType::I32,
        "uint" | "unsigned int" | "uint32" | "uint32_t" => SampleType::U32,
        "longlong" | "long long" | "long long int" | "signed long long" | "signed long long int" => SampleType::I64,
        "int64" | "int64_t" => SampleType::I64,
        "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => SampleType::U64,
        "float" => SampleType::F32,
        "double" => SampleType::F64,
        _ => return None,
    })
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Encoding {
    Raw,
    Gzip,
    #[cfg(feature = "bzip2")]
    Bzip2,
    Text,
    Hex,
}

/// How the samples are stored in their file, or in each of their files.
struct Layout {
    /// The samples of all files together, for one volume.
    samples: Samples,
    series: Series,
    encoding: Encoding,
    line_skip: u64,
    /// The number of bytes to skip; `None` if the samples end where the file ends.
    byte_skip: Option<u64>,
    /// The header says where the samples begin in a file of another format, so more data may follow them.
    window: bool,
}

impl Layout {
    /// Reads the samples in one file.
    fn read(&self, mut file: Source, samples: &Samples) -> Result<Voxels, VolumeError> {
        file.skip_lines(self.line_skip)?;
        if matches!(self.encoding, Encoding::Text | Encoding::Hex) {
            file.skip(self.byte_skip.unwrap_or_default())?;
        }
        let mut stream = match self.encoding {
            Encoding::Raw => Stream::raw(file)?,
            Encoding::Gzip => Stream::gzip(file)?,
            #[cfg(feature = "bzip2")]
            Encoding::Bzip2 => Stream::bzip2(file),
            Encoding::Text => {
                return Stream::text(file, samples.kind, TextEnd::File)?.series(samples, &self.series, false);
            }
            Encoding::Hex => return Stream::hex(file)?.series(samples, &self.series, false),
        };
        let bytes = samples.bytes().saturating_mul(self.series.count());
        let before_the_end = |left: u64| left.saturating_sub(bytes);
        stream.skip(self.byte_skip.unwrap_or_else(|| stream.exactly_left().map_or(0, before_the_end)))?;
        // Beyond the samples a compressed stream must end.
        stream.series(samples, &self.series, self.window && self.encoding == Encoding::Raw)
    }
}

/// Whether the value of `data file` announces a list of names.
fn is_list(value: &str) -> bool {
    value.split_whitespace().next() == Some("LIST")
}

/// Vectors `(x,y,z)`, with or without spaces in and between them, and words such as `none`.
fn vector_words(text: &str) -> Vec<&str> {
    let mut words = Vec::new();
    let mut rest = text.trim_start();
    while !rest.is_empty() {
        let end = if rest.starts_with('(') {
            rest.find(')').map(|at| at + 1)
        } else {
            rest.find(|c: char| c.is_ascii_whitespace() || c == '(')
        };
        let (word, after) = rest.split_at(end.unwrap_or(rest.len()));
        words.push(word);
        rest = after.trim_start();
    }
    words
}
