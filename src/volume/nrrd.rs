//! NRRD files: a text header, then the samples, in the same file or in one of their own.
//!
//! Only the grid is read: axes are those of the array, so orientation, origin, units and the fields that describe what a
//! sample means (`old min`, `kinds`, …) do not change the volume. Whatever the header promises is checked before memory
//! is asked for, and samples become `f32` as they are read, so a load needs little more than the values themselves.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, Read, Seek};
use std::path::{Path, PathBuf};

use flate2::bufread::MultiGzDecoder;
use glam::{DVec3, UVec3};

use super::{Grid, Labels, Volume, VolumeError};

/// No header line is longer than this, in bytes.
const MAX_LINE: u64 = 64 << 10;
/// No header is longer than this, in bytes.
const MAX_HEADER: u64 = 1 << 20;
/// Samples are converted this many bytes at a time: a multiple of the size of every type.
const CHUNK: u64 = 64 << 10;
/// Deflate spends at least 2 bits on a match of at most 258 bytes, so no stream expands by more.
const MAX_EXPANSION: u64 = 1032;
/// Largest cosine between two axes that still counts as a right angle.
const MAX_COSINE: f64 = 1e-4;

/// Reads the volume of one NRRD file, or of the detached header and the data file it names.
pub(super) fn read(path: &Path) -> Result<Volume, VolumeError> {
    let Opened { dims, spacing, layout, data } = Opened::new(path)?;
    let values = layout.read(data, layout.sample.values)?;
    Volume::new(&path.display().to_string(), dims, spacing.unwrap_or(DVec3::ONE), values)
}

/// Reads such a file's samples as labels.
pub(super) fn read_labels(path: &Path) -> Result<Labels, VolumeError> {
    let Opened { dims, spacing, layout, data } = Opened::new(path)?;
    let values = layout.read(data, layout.sample.labels)?;
    Ok(Labels { origin: path.display().to_string(), dims, spacing, values: values.into(), names: BTreeMap::new() })
}

/// What a header says, and the file that the samples are in.
struct Opened {
    dims: UVec3,
    /// If the header gives one.
    spacing: Option<DVec3>,
    layout: Layout,
    data: Source,
}

impl Opened {
    fn new(path: &Path) -> Result<Self, VolumeError> {
        let mut file = Source::open(path)?;
        let header = Header::read(&mut file)?;
        let (dims, spacing) = (header.dims()?, header.spacing()?);
        let layout = header.layout(dims)?;
        let data = header.data_path()?.map_or(Ok(file), |path| Source::open(&path))?;
        Ok(Self { dims, spacing, layout, data })
    }
}

/// One file while it is read.
struct Source {
    path: PathBuf,
    bytes: u64,
    reader: BufReader<File>,
}

impl Source {
    fn open(path: &Path) -> Result<Self, VolumeError> {
        // Asked before opening: to open a pipe would wait for its writer.
        let metadata = fs::metadata(path).map_err(io_error(path))?;
        if !metadata.is_file() {
            return Err(invalid(path, "file", "a folder, pipe or device", "a regular file"));
        }
        let reader = BufReader::with_capacity(CHUNK as usize, File::open(path).map_err(io_error(path))?);
        Ok(Self { path: path.to_owned(), bytes: metadata.len(), reader })
    }

    /// How many bytes are left to read.
    fn left(&mut self) -> Result<u64, VolumeError> {
        Ok(self.bytes.saturating_sub(self.reader.stream_position().map_err(io_error(&self.path))?))
    }

    /// The next header line without its end, or `None` at the end of the file; `budget` is what the header may still
    /// take up.
    fn line(&mut self, budget: &mut u64) -> Result<Option<String>, VolumeError> {
        let (mut line, limit) = (Vec::new(), MAX_LINE.min(*budget));
        let read = self.reader.by_ref().take(limit).read_until(b'\n', &mut line);
        let read = read.map_err(io_error(&self.path))? as u64;
        if read == limit && !line.ends_with(b"\n") {
            let allowed = format!("lines of less than {MAX_LINE} bytes, less than {MAX_HEADER} bytes in all");
            return Err(invalid(&self.path, "header", "more", allowed));
        }
        *budget -= read;
        let text = line.strip_suffix(b"\n").unwrap_or(&line);
        let text = text.strip_suffix(b"\r").unwrap_or(text);
        Ok((read > 0).then(|| String::from_utf8_lossy(text).into_owned()))
    }

    fn skip_lines(&mut self, lines: u64) -> Result<(), VolumeError> {
        for skipped in 0..lines {
            if self.reader.skip_until(b'\n').map_err(io_error(&self.path))? == 0 {
                let allowed = format!("at most the {skipped} lines of the file");
                return Err(invalid(&self.path, "line skip", lines, allowed));
            }
        }
        Ok(())
    }
}

/// The fields of a header, under the format's first spelling of their names.
struct Header {
    path: PathBuf,
    fields: BTreeMap<String, String>,
}

impl Header {
    /// Reads the header and leaves `file` where the data of an attached one begin.
    fn read(file: &mut Source) -> Result<Self, VolumeError> {
        let mut magic = Vec::new();
        file.reader.by_ref().take(10).read_until(b'\n', &mut magic).map_err(io_error(&file.path))?;
        let magic = String::from_utf8_lossy(&magic);
        let version = magic.strip_suffix("\r\n").or(magic.strip_suffix('\n')).and_then(|m| m.strip_prefix("NRRD000"));
        if !matches!(version, Some("1" | "2" | "3" | "4" | "5")) {
            return Err(invalid(&file.path, "magic", shown(&magic), "a first line NRRD0001 to NRRD0005"));
        }
        let mut header = Self { path: file.path.clone(), fields: BTreeMap::new() };
        let mut budget = MAX_HEADER;
        while let Some(line) = file.line(&mut budget)? {
            if line.is_empty() {
                return Ok(header);
            }
            header.add(&line)?;
        }
        match header.get("data file") {
            Some(_) => Ok(header),
            None => Err(header.invalid("header", "the end of the file", "a blank line before the data")),
        }
    }

    /// Adds a line that is not blank.
    fn add(&mut self, line: &str) -> Result<(), VolumeError> {
        if line.starts_with('#') {
            return Ok(());
        }
        // `key:=value` or `field: value`, whichever delimiter comes first: a value may hold the other. Some writers leave
        // out the space.
        let delimits =
            |&(at, _): &(usize, &str)| matches!(line.as_bytes().get(at + 1), Some(b'=' | b' ' | b'\t') | None);
        let Some((at, _)) = line.match_indices(':').find(delimits).or_else(|| line.match_indices(':').next()) else {
            return Err(self.invalid("header", shown(line), "`field: value`, `key:=value` or `# comment`"));
        };
        let (name, value) = line.split_at(at);
        let value = value.strip_prefix(':').unwrap_or(value);
        if value.starts_with('=') {
            return Ok(());
        }
        let name = name.trim().to_ascii_lowercase();
        let name = match name.as_str() {
            "datafile" => "data file",
            "lineskip" => "line skip",
            "byteskip" => "byte skip",
            name => name,
        };
        match self.fields.insert(name.to_owned(), value.trim().to_owned()) {
            None => Ok(()),
            Some(_) => Err(self.invalid(name, "the field twice", "each field once")),
        }
    }

    fn get(&self, name: &str) -> Option<&str> {
        self.fields.get(name).map(String::as_str)
    }

    fn invalid(&self, field: &str, found: impl Display, allowed: impl Display) -> VolumeError {
        invalid(&self.path, field, found, allowed)
    }

    /// A field as `parse` makes it from its text, or from the lack of it.
    fn value<T>(&self, name: &str, allowed: &str, parse: impl Fn(Option<&str>) -> Option<T>) -> Result<T, VolumeError> {
        let text = self.get(name);
        parse(text).ok_or_else(|| self.invalid(name, text.map_or("no such field".to_owned(), shown), allowed))
    }

    fn dims(&self) -> Result<UVec3, VolumeError> {
        self.value("dimension", "3", |text| text?.parse::<u32>().ok().filter(|&dimension| dimension == 3))?;
        self.value("sizes", "three positive integers, at most 4294967295 voxels", |text| {
            let sizes = three(text?.split_whitespace().map(|size| size.parse::<u32>().ok()))?;
            let voxels = sizes.iter().try_fold(1_u32, |product, &size| product.checked_mul(size))?;
            (voxels > 0).then_some(UVec3::from_array(sizes))
        })
    }

    fn spacing(&self) -> Result<Option<DVec3>, VolumeError> {
        match (self.get("spacings"), self.get("space directions")) {
            (None, None) => Ok(None),
            (None, Some(_)) => self.directed_spacing().map(Some),
            (Some(_), None) => self.value("spacings", "three positive finite numbers", |text| {
                let spacings = three(text?.split_whitespace().map(number))?;
                spacings.iter().all(|&spacing| spacing > 0.0).then_some(Some(DVec3::from_array(spacings)))
            }),
            (Some(_), Some(_)) => {
                Err(self.invalid("space directions", "`spacings` as well", "one of `spacings` and `space directions`"))
            }
        }
    }

    /// The lengths of the axis vectors of `space directions`.
    fn directed_spacing(&self) -> Result<DVec3, VolumeError> {
        let name = "space directions";
        let axes =
            self.value(name, "three vectors (x,y,z) of positive finite length, none of them `none`", |text| {
                let axes = vectors(text?)?;
                axes.iter().all(|axis| axis.length() > 0.0 && axis.length().is_finite()).then_some(axes)
            })?;
        let [x, y, z] = axes.map(|axis| axis / axis.length());
        let cosine = DVec3::new(x.dot(y), y.dot(z), z.dot(x)).abs().max_element();
        if cosine > MAX_COSINE {
            let found = format!("axes that are not orthogonal, at a cosine of {cosine:.6}");
            return Err(self.invalid(name, found, format!("orthogonal axes, cosines of at most {MAX_COSINE}")));
        }
        Ok(DVec3::from_array(axes.map(DVec3::length)))
    }

    /// Where the samples are, if they are not in the header's own file.
    fn data_path(&self) -> Result<Option<PathBuf>, VolumeError> {
        let Some(name) = self.get("data file") else { return Ok(None) };
        match name.split_whitespace().collect::<Vec<_>>().as_slice() {
            // `slice%03d.raw 1 20 1` is a pattern, and the numbers it runs through.
            [pattern, _, _, _, ..] if pattern.contains('%') => {}
            [] | ["LIST", ..] => {}
            _ => return Ok(Some(self.path.parent().unwrap_or(Path::new("")).join(name))),
        }
        Err(self.invalid("data file", shown(name), "the name of one file, no LIST and no pattern"))
    }

    fn layout(&self, dims: UVec3) -> Result<Layout, VolumeError> {
        let sample = self.value("type", Sample::ALLOWED, |text| Sample::parse(text?))?;
        let big_endian = self.value("endian", "little or big", |text| match text.map(lower).as_deref() {
            Some("little") => Some(false),
            Some("big") => Some(true),
            None if sample.bytes == 1 => Some(false),
            _ => None,
        })?;
        let gzip = self.value("encoding", "raw, gzip or gz", |text| match lower(text?).as_str() {
            "raw" => Some(false),
            "gzip" | "gz" => Some(true),
            _ => None,
        })?;
        let line_skip = self.value("line skip", "a number of lines", |text| text.unwrap_or("0").parse().ok())?;
        let byte_skip = self.value("byte skip", "a number of bytes, or -1 if encoding is raw", |text| match text {
            Some("-1") => (!gzip).then_some(None),
            text => text.unwrap_or("0").parse().ok().map(Some),
        })?;
        let skips = self.get("line skip").or(self.get("byte skip")).is_some();
        let window = skips && self.get("data file").is_some();
        // `dims` has fitted the product in 32 bits.
        Ok(Layout { sample, dims, count: dims.element_product(), big_endian, gzip, line_skip, byte_skip, window })
    }
}

/// Appends the samples in some bytes, a whole number of them; `true` if they are big endian. Stops at one that is not allowed, and
/// gives it back.
type Convert<T> = fn(bool, &[u8], &mut Vec<T>) -> Result<(), f64>;

/// The type of the samples in the file.
#[derive(Clone, Copy)]
struct Sample {
    bytes: u64,
    values: Convert<f32>,
    labels: Convert<u16>,
}

impl Sample {
    const ALLOWED: &str = "int8, uint8, int16, uint16, int32, uint32, int64, uint64, float, double, or their C names";

    fn parse(text: &str) -> Option<Self> {
        macro_rules! sample {
            ($type:ty) => {
                Self {
                    bytes: size_of::<$type>() as u64,
                    values: |big_endian, bytes, values| {
                        let from_bytes = if big_endian { <$type>::from_be_bytes } else { <$type>::from_le_bytes };
                        values.extend(bytes.as_chunks().0.iter().map(|&sample| from_bytes(sample) as f32));
                        Ok(())
                    },
                    labels: |big_endian, bytes, labels| {
                        let from_bytes = if big_endian { <$type>::from_be_bytes } else { <$type>::from_le_bytes };
                        for &sample in bytes.as_chunks().0 {
                            let sample = from_bytes(sample) as f64;
                            let label = sample as u16;
                            if f64::from(label) != sample {
                                return Err(sample);
                            }
                            labels.push(label);
                        }
                        Ok(())
                    },
                }
            };
        }
        let words: Vec<_> = text.split_whitespace().map(lower).collect();
        Some(match words.join(" ").as_str() {
            "signed char" | "int8" | "int8_t" => sample!(i8),
            "uchar" | "unsigned char" | "uint8" | "uint8_t" => sample!(u8),
            "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => sample!(i16),
            "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => sample!(u16),
            "int" | "signed int" | "int32" | "int32_t" => sample!(i32),
            "uint" | "unsigned int" | "uint32" | "uint32_t" => sample!(u32),
            "longlong" | "long long" | "long long int" | "signed long long" | "signed long long int" => sample!(i64),
            "int64" | "int64_t" => sample!(i64),
            "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => sample!(u64),
            "float" => sample!(f32),
            "double" => sample!(f64),
            _ => return None,
        })
    }
}

/// How the samples lie in their file.
struct Layout {
    sample: Sample,
    dims: UVec3,
    count: u32,
    big_endian: bool,
    gzip: bool,
    line_skip: u64,
    /// `None`: the samples end where the file ends.
    byte_skip: Option<u64>,
    /// The header says where in a file of another format the samples begin, so something may follow them.
    window: bool,
}

impl Layout {
    fn read<T>(&self, mut file: Source, convert: Convert<T>) -> Result<Vec<T>, VolumeError> {
        file.skip_lines(self.line_skip)?;
        if self.gzip { self.read_gzip(file, convert) } else { self.read_raw(file, convert) }
    }

    fn read_raw<T>(&self, mut file: Source, convert: Convert<T>) -> Result<Vec<T>, VolumeError> {
        let left = file.left()?;
        let skip = self.byte_skip.unwrap_or(left.saturating_sub(self.bytes()));
        let held = left.saturating_sub(skip);
        if held < self.bytes() || held > self.bytes() && !self.window {
            return Err(self.mismatch(&file.path, held));
        }
        file.reader.seek_relative(skip as i64).map_err(io_error(&file.path))?;
        // The file holds them all, so memory for them may be asked for at once.
        self.read_samples(&file.path, &mut file.reader, self.count as usize, convert)
    }

    fn read_gzip<T>(&self, mut file: Source, convert: Convert<T>) -> Result<Vec<T>, VolumeError> {
        let skip = self.byte_skip.unwrap_or(0);
        let most = file.left()?.saturating_mul(MAX_EXPANSION).saturating_sub(skip);
        if most < self.bytes() {
            return Err(self.mismatch(&file.path, format!("at most {most}")));
        }
        let mut stream = MultiGzDecoder::new(file.reader);
        io::copy(&mut stream.by_ref().take(skip), &mut io::sink()).map_err(gzip_error(&file.path))?;
        // What the stream holds is not known yet: memory grows with what comes out of it.
        let values = self.read_samples(&file.path, &mut stream, 0, convert)?;
        // Reading on to the end is also what checks the last checksum.
        match io::copy(&mut stream.take(1), &mut io::sink()).map_err(gzip_error(&file.path))? {
            0 => Ok(values),
            _ => Err(self.mismatch(&file.path, format!("more than {}", self.bytes()))),
        }
    }

    fn read_samples<T>(
        &self,
        path: &Path,
        stream: &mut impl Read,
        expected: usize,
        convert: Convert<T>,
    ) -> Result<Vec<T>, VolumeError> {
        let too_many = |error| invalid(path, "data", format!("{} samples: {error}", self.count), "fewer");
        let (mut values, mut chunk) = (Vec::new(), Vec::with_capacity(CHUNK as usize));
        values.try_reserve_exact(expected).map_err(too_many)?;
        let mut left = self.bytes();
        while left > 0 {
            chunk.clear();
            let wanted = left.min(CHUNK);
            let read = stream.take(wanted).read_to_end(&mut chunk).map_err(gzip_error(path))? as u64;
            if read < wanted {
                return Err(self.mismatch(path, self.bytes() - left + read));
            }
            values.try_reserve(chunk.len() / self.sample.bytes as usize).map_err(too_many)?;
            convert(self.big_endian, &chunk, &mut values).map_err(|sample| {
                let voxel = Grid { dims: self.dims, spacing: DVec3::ONE }.voxel_at(values.len() as u32);
                invalid(path, "data", format!("{sample} at voxel {voxel}"), "labels, whole numbers from 0 to 65535")
            })?;
            left -= read;
        }
        values.shrink_to_fit();
        Ok(values)
    }

    /// What the samples take up in the file, decompressed.
    fn bytes(&self) -> u64 {
        u64::from(self.count) * self.sample.bytes
    }

    fn mismatch(&self, path: &Path, held: impl Display) -> VolumeError {
        let allowed = format!("{} bytes ({} samples of {})", self.bytes(), self.count, self.sample.bytes);
        invalid(path, "data", format!("{held} bytes"), allowed)
    }
}

fn invalid(path: &Path, field: &str, found: impl Display, allowed: impl Display) -> VolumeError {
    let (found, allowed) = (found.to_string(), allowed.to_string());
    VolumeError::Invalid { origin: path.display().to_string(), field: field.to_owned(), found, allowed }
}

fn io_error(path: &Path) -> impl Fn(io::Error) -> VolumeError {
    |source| VolumeError::Io { path: path.to_owned(), source }
}

/// The decoder reports damage as an I/O error, without the code that the operating system's own carry.
fn gzip_error(path: &Path) -> impl Fn(io::Error) -> VolumeError {
    |error| match error.raw_os_error() {
        Some(_) => io_error(path)(error),
        None => invalid(path, "data", error, "whole and undamaged gzip members"),
    }
}

/// Text from the file, short and on one line.
fn shown(text: &str) -> String {
    let short: String = text.chars().take(60).collect();
    format!("{short:?}{}", if short.len() < text.len() { "…" } else { "" })
}

fn lower(text: &str) -> String {
    text.to_ascii_lowercase()
}

fn three<T>(items: impl Iterator<Item = Option<T>>) -> Option<[T; 3]> {
    items.collect::<Option<Vec<T>>>()?.try_into().ok()
}

fn number(text: &str) -> Option<f64> {
    text.trim().parse().ok().filter(|number: &f64| number.is_finite())
}

/// Three vectors `(x,y,z)`, with or without space between and within them.
fn vectors(text: &str) -> Option<[DVec3; 3]> {
    three(text.strip_suffix(')')?.split(')').map(|vector| {
        let components = vector.trim_start().strip_prefix('(')?;
        three(components.split(',').map(number)).map(DVec3::from_array)
    }))
}
