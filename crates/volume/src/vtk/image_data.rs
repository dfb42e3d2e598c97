//! XML ImageData or RectilinearGrid of one piece. The samples are in the XML as text or base64, or appended after it as base64 or raw bytes, optionally in
//! blocks compressed by zlib or LZ4.

use std::io::{self, BufRead, Read, Seek, SeekFrom};
use std::ops::RangeInclusive;
use std::path::Path;

use glam::{DMat3, DVec3, UVec3};
use quick_xml::Reader;
use quick_xml::events::Event;

use super::super::VolumeError;
use super::super::access::Access;
use super::super::error::volume::{invalid, io_error};
use super::super::fields::Fields;
use super::super::grid::{SIZES, dims_of};
use super::super::loaded::Loaded;
use super::super::numbers::TextEnd;
use super::super::orientation::unit_directions;
use super::super::sample_type::SampleType;
use super::super::samples::Samples;
use super::super::series::{MAX_CHANNELS, Series, SeriesOrder};
use super::super::stream::Stream;
use super::super::text::{number, three};
use super::super::unit;
use super::super::xml;
use super::blocks::{Base64, Blocks, Compressor, HeaderType};
use super::choice::warn_of_choice;
use super::rectilinear::{Coordinates, resampled};

/// The files that are read.
const ALLOWED: &str = "an XML file of VTK with ImageData or RectilinearGrid";

const TYPES: [(&str, SampleType); 10] = [
    ("Int8", SampleType::I8),
    ("UInt8", SampleType::U8),
    ("Int16", SampleType::I16),
    ("UInt16", SampleType::U16),
    ("Int32", SampleType::I32),
    ("UInt32", SampleType::U32),
    ("Int64", SampleType::I64),
    ("UInt64", SampleType::U64),
    ("Float32", SampleType::F32),
    ("Float64", SampleType::F64),
];

/// Reads the array of one file.
pub(in super::super) fn read(path: &Path, access: &Access) -> Result<Loaded, VolumeError> {
    let header = Header::read(path, access)?;
    let left_handed = !header.is_rectilinear && header.is_left_handed()?;
    let array = header.choose()?;
    let dims = header.dims(array)?;
    let samples = header.samples(array, dims)?;
    let channels = array.components().unwrap_or(1);
    let series = Series { channels, order: SeriesOrder::Interleaved, ..Series::default() };
    let Some(side) = dims_of([u64::from(dims.x) * u64::from(channels), dims.y.into(), dims.z.into()]) else {
        let found = format!("{channels} components of {dims}");
        return Err(header.image.invalid("NumberOfComponents", found, "at most 4294967295 numbers"));
    };
    let stream = header.open(path, access, array, &Samples { dims: side, ..samples })?;
    let values = stream.series(&samples, &series, false)?;
    let loaded = Loaded { series, ..Loaded::new(dims, samples.kind, values) };
    if header.is_rectilinear {
        let coordinates = header.coordinates(path, access, array.of_cells)?;
        return resampled(path, coordinates, loaded, access);
    }
    Ok(Loaded { spacing: Some(header.spacing()?), left_handed, ..loaded })
}

/// The elements that are needed, as their attributes.
struct Header {
    file: Fields,
    image: Fields,
    /// Whether the image is a RectilinearGrid.
    is_rectilinear: bool,
    arrays: Vec<Array>,
    /// The arrays of coordinates.
    coordinates: Vec<Array>,
    /// The attributes of the appended data, and the position where it begins.
    appended: Option<(Fields, u64)>,
}

struct Array {
    fields: Fields,
    of_cells: bool,
    /// Whether its section names it as the active one.
    is_active: bool,
    /// The position of its text, if it has text.
    at: u64,
}

impl Header {
    /// Reads the XML, up to the appended data if there is any.
    fn read(path: &Path, access: &Access) -> Result<Self, VolumeError> {
        let mut reader = Reader::from_reader(access.open(path)?.reader);
        let (mut file, mut image, mut piece) = (None, None, None);
        let (mut arrays, mut coordinates, mut appended) = (Vec::new(), Vec::new(), None);
        let mut in_coordinates = false;
        let mut section: Option<(bool, Option<String>)> = None;
        // The names of active arrays in the sections.
        let mut active_names = Vec::new();
        let mut buffer = Vec::new();
        while appended.is_none() {
            buffer.clear();
            let element = match reader.read_event_into(&mut buffer).map_err(|error| xml::damage(path, error))? {
                Event::Start(element) | Event::Empty(element) => element,
                Event::End(end) if matches!(end.name().as_ref(), "PointData" | "CellData") => {
                    section = None;
                    continue;
                }
                Event::End(end) if end.name().as_ref() == "Coordinates" => {
                    in_coordinates = false;
                    continue;
                }
                Event::End(end) if end.name().as_ref() == "VTKFile" => break,
                Event::Eof => {
                    return Err(invalid(path, "header", "the end of the file", ALLOWED));
                }
                _ => continue,
            };
            let fields = xml::attributes(path, &element)?;
            match (element.name().as_ref(), &section) {
                ("VTKFile", _) => file = file.or(Some(fields)),
                ("ImageData" | "RectilinearGrid", _) => image = image.or(Some(fields)),
                ("Piece", _) if piece.is_some() => return Err(invalid(path, "Piece", "more than one", "one")),
                ("Piece", _) => piece = Some(fields),
                (name @ ("PointData" | "CellData"), _) => {
                    let active = fields.get("Scalars").map(str::to_owned);
                    active_names.extend(active.clone());
                    section = Some((name == "CellData", active));
                }
                ("Coordinates", _) => in_coordinates = true,
                ("DataArray", _) if in_coordinates => {
                    coordinates.push(Array { is_active: false, of_cells: false, at: reader.buffer_position(), fields });
                }
                ("DataArray", Some((of_cells, active))) => arrays.push(Array {
                    is_active: active.is_some() && fields.get("Name") == active.as_deref(),
                    of_cells: *of_cells,
                    at: reader.buffer_position(),
                    fields,
                }),
                ("AppendedData", _) => {
                    let Some(skipped) = underscore(reader.get_mut()).map_err(io_error(path))? else {
                        return Err(invalid(path, "AppendedData", "no underscore", "one before the data"));
                    };
                    appended = Some((fields, reader.buffer_position() + skipped));
                }
                _ => {}
            }
        }
        let missing = |element: &str| invalid(path, element, "no such element", ALLOWED);
        let file = file.ok_or_else(|| missing("VTKFile"))?;
        let is_rectilinear = file.value("type", "ImageData or RectilinearGrid", |text| match text? {
            "ImageData" => Some(false),
            "RectilinearGrid" => Some(true),
            _ => None,
        })?;
        let image = image.ok_or_else(|| missing("ImageData"))?;
        let (whole, part) =
            (extent(&image, "WholeExtent")?, extent(&piece.ok_or_else(|| missing("Piece"))?, "Extent")?);
        if part != whole {
            return Err(image.invalid("Extent", format!("{part:?}"), format!("{whole:?}, as the whole")));
        }
        let has_array = |name: &&String| arrays.iter().any(|array: &Array| array.is_active && array.name() == *name);
        if let Some(name) = active_names.iter().find(|name| !has_array(name)) {
            return Err(image.invalid("Scalars", name, "the name of an array that is there"));
        }
        Ok(Self { file, image, is_rectilinear, arrays, coordinates, appended })
    }

    /// How the samples of an array are stored.
    fn samples(&self, array: &Array, dims: UVec3) -> Result<Samples, VolumeError> {
        let kind = array.fields.value("type", &TYPES.map(|(name, _)| name).join(", "), |text| {
            TYPES.iter().find(|(name, _)| Some(*name) == text).map(|&(_, kind)| kind)
        })?;
        let big_endian = self.file.value("byte_order", "LittleEndian or BigEndian", |text| match text {
            None | Some("LittleEndian") => Some(false),
            Some("BigEndian") => Some(true),
            Some(_) => None,
        })?;
        // Text has no byte order: numbers come from it in the machine's.
        let big_endian = if array.is_text() { cfg!(target_endian = "big") } else { big_endian };
        Ok(Samples { kind, dims, big_endian, rescale: None, z_fastest: false })
    }

    /// The coordinates of the points along each axis, or of the centres of cells.
    fn coordinates(&self, path: &Path, access: &Access, of_cells: bool) -> Result<[Coordinates; 3], VolumeError> {
        let extent = extent(&self.image, "WholeExtent")?;
        let found = format!("{} arrays", self.coordinates.len());
        let [x, y, z] = self.coordinates.as_slice() else {
            return Err(invalid(path, "Coordinates", found, "three arrays, along x, y and z"));
        };
        let along = |axis: usize, array: &Array| {
            // The values have been read, so that it is small enough.
            let count = (extent[2 * axis + 1] - extent[2 * axis] + 1) as u32;
            let name = format!("Coordinates of {}", ["x", "y", "z"][axis]);
            if array.components() != Some(1) {
                return Err(invalid(path, &name, "an array of several components", "one number for each point"));
            }
            let samples = self.samples(array, UVec3::new(count, 1, 1))?;
            access.reserve(path, &name, format!("{count} numbers"), 2 * samples.bytes())?;
            let mut bytes = Vec::new();
            let read = self.open(path, access, array, &samples)?.read_up_to(samples.bytes(), &mut bytes)?;
            if read < samples.bytes() {
                let allowed = format!("{} bytes ({count} numbers of type {})", samples.bytes(), samples.kind);
                return Err(invalid(path, &name, format!("{read} bytes"), allowed));
            }
            let coordinates = Coordinates { name, places: samples.kind.numbers(&bytes, samples.big_endian) };
            Ok(if of_cells { coordinates.of_cells() } else { coordinates })
        };
        Ok([along(0, x)?, along(1, y)?, along(2, z)?])
    }

    fn spacing(&self) -> Result<DVec3, VolumeError> {
        self.image.value("Spacing", "three positive finite numbers, or 0", |text| {
            let spacing = three(text.unwrap_or("1 1 1").split_whitespace().map(number))?;
            unit::known((&self.image.path, "Spacing"), spacing)
        })
    }

    /// Whether the axes are left-handed. Refuses a direction matrix whose axes are not orthogonal unit vectors.
    fn is_left_handed(&self) -> Result<bool, VolumeError> {
        let Some(matrix) = self.image.value("Direction", "nine finite numbers", |text| match text {
            None => Some(None),
            Some(text) => {
                let numbers = text.split_whitespace().map(number).collect::<Option<Vec<_>>>()?;
                numbers.try_into().ok().map(|numbers| Some(DMat3::from_cols_array(&numbers)))
            }
        })?
        else {
            return Ok(false);
        };
        // The file stores the matrix row by row.
        let rows = matrix.transpose();
        let directions = unit_directions([rows.x_axis, rows.y_axis, rows.z_axis]);
        let is_left_handed = directions.map(|axes| axes.determinant() < 0.0);
        is_left_handed.map_err(|(found, allowed)| self.image.invalid("Direction", found, allowed))
    }

    /// The array to read: the active one, or else the first one with one component, or else the first one.
    fn choose(&self) -> Result<&Array, VolumeError> {
        let with = |allowed: RangeInclusive<u32>| -> Vec<&Array> {
            let is_allowed = |array: &&Array| array.components().is_some_and(|count| allowed.contains(&count));
            self.arrays.iter().filter(is_allowed).collect()
        };
        let (mut numbers, vectors) = (with(1..=1), with(1..=MAX_CHANNELS));
        if numbers.is_empty() || vectors.iter().any(|array| array.is_active) {
            numbers = vectors;
        }
        let active = numbers.iter().find(|array| array.is_active);
        let of_points = numbers.iter().find(|array| !array.of_cells);
        let Some(chosen) = active.or(of_points).or(numbers.first()) else {
            let all = self.arrays.iter().map(|array| {
                let components = array.fields.get("NumberOfComponents").unwrap_or("1");
                format!("{} ({components} components)", array.name())
            });
            let found = format!("arrays {}", all.collect::<Vec<_>>().join(", "));
            return Err(self.image.invalid(
                "DataArray",
                found,
                format!("at least one with 1 to {MAX_CHANNELS} components"),
            ));
        };
        if active.is_none() {
            warn_of_choice(&self.image.path, numbers.iter().map(|array| array.name()), chosen.name());
        }
        Ok(chosen)
    }

    fn dims(&self, array: &Array) -> Result<UVec3, VolumeError> {
        let extent = extent(&self.image, "WholeExtent")?;
        let size = |axis: usize| {
            let steps = extent[2 * axis + 1].checked_sub(extent[2 * axis]).filter(|&steps| steps >= 0)?;
            // A flat grid has one layer of cells.
            if array.of_cells { Some(steps.max(1)) } else { steps.checked_add(1) }
        };
        let sizes = || dims_of([size(0)?, size(1)?, size(2)?]);
        sizes().ok_or_else(|| {
            self.image.invalid(
                "WholeExtent",
                format!("{extent:?}"),
                format!("a last point behind the first one, or the same, along x, y and z; {SIZES}"),
            )
        })
    }

    /// A stream of the array's bytes.
    fn open(&self, path: &Path, access: &Access, array: &Array, samples: &Samples) -> Result<Stream, VolumeError> {
        let Array { fields, at, .. } = array;
        let (at, encoding) = match (fields.get("format"), &self.appended) {
            _ if array.is_text() => (*at, "ascii"),
            (Some("binary"), _) => (*at, "base64"),
            (Some("appended"), Some((appended, first))) => {
                let offset = fields.value("offset", "a number of bytes", |text| text?.trim().parse::<u64>().ok())?;
                let encodings = ["raw", "base64"];
                let encoding = appended.value("encoding", "raw or base64", |text| {
                    encodings.into_iter().find(|&encoding| Some(encoding) == text)
                })?;
                (first.saturating_add(offset), encoding)
            }
            (other, _) => {
                let allowed = "ascii, binary, or, if there are appended data, appended";
                return Err(fields.invalid("format", other.unwrap_or("none"), allowed));
            }
        };
        let mut file = access.open(path)?;
        file.reader.seek(SeekFrom::Start(at)).map_err(io_error(path))?;
        let left = file.left()?;
        let (reader, expansion): (Box<dyn Read>, u64) = match encoding {
            "ascii" => return Stream::text(file, samples.kind, TextEnd::Tag),
            "base64" => self.unpacked(Base64::new(file.reader), samples, access)?,
            _ => self.unpacked(file.reader, samples, access)?,
        };
        Ok(Stream::decoded(
            path,
            reader,
            "numbers, base64 or blocks as the header says",
            left.saturating_mul(expansion),
            access,
        ))
    }

    /// The bytes after the array's own header, decompressed, and their maximum number.
    fn unpacked(
        &self,
        mut reader: impl Read + 'static,
        samples: &Samples,
        access: &Access,
    ) -> Result<(Box<dyn Read>, u64), VolumeError> {
        let bytes = self.file.value("header_type", "UInt32 or UInt64", |text| match text {
            None | Some("UInt32") => Some(4),
            Some("UInt64") => Some(8),
            Some(_) => None,
        })?;
        let allowed = "vtkZLibDataCompressor or vtkLZ4DataCompressor";
        let compressor = self.file.value("compressor", allowed, |text| match text {
            None => Some(None),
            Some("vtkZLibDataCompressor") => Some(Some(Compressor::Zlib)),
            Some("vtkLZ4DataCompressor") => Some(Some(Compressor::Lz4)),
            Some(_) => None,
        })?;
        let header = HeaderType { bytes, big_endian: samples.big_endian };
        let damaged = |error| invalid(&self.file.path, "data", error, "as many bytes as the header says");
        if let Some(compressor) = compressor {
            let blocks = Blocks::new(reader, header, compressor, samples.bytes()).map_err(damaged)?;
            let (path, block) = (&self.file.path, blocks.largest());
            access.reserve(path, "data", format!("a block of {block} bytes"), block)?;
            return Ok((Box::new(blocks), compressor.max_expansion()));
        }
        let held = header.read(&mut reader).map_err(damaged)?;
        if held != samples.bytes() {
            return Err(samples.mismatch(&self.file.path, held));
        }
        Ok((Box::new(reader.take(held)), 1))
    }
}

impl Array {
    fn is_text(&self) -> bool {
        self.fields.get("format") == Some("ascii")
    }

    fn name(&self) -> &str {
        self.fields.get("Name").unwrap_or("without a name")
    }

    /// The numbers of a point or cell; `None` if the file states something else.
    fn components(&self) -> Option<u32> {
        self.fields.get("NumberOfComponents").map_or(Some(1), |text| text.parse().ok())
    }
}

/// The first and last point along x, y and z.
fn extent(fields: &Fields, name: &str) -> Result<[i64; 6], VolumeError> {
    fields.value(name, "six integers", |text| {
        text?.split_whitespace().map(|number| number.parse().ok()).collect::<Option<Vec<_>>>()?.try_into().ok()
    })
}

/// Skips white space and an underscore before appended data. Returns the number of bytes; `None` if there is no underscore.
fn underscore(reader: &mut impl BufRead) -> io::Result<Option<u64>> {
    let mut skipped = 0;
    loop {
        match reader.fill_buf()?.first() {
            Some(byte) if byte.is_ascii_whitespace() => {}
            Some(b'_') => return Ok(Some(skipped + 1)),
            _ => return Ok(None),
        }
        reader.consume(1);
        skipped += 1;
    }
}
