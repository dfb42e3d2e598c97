//! MetaImage files: a text header, then the samples, raw or as a zlib stream, in the same file (`.mha`) or in one or more data files
//! (`.mhd`).
//!
//! Directions and origins are in LPS, as in ITK. The file must end where the samples end.

use std::path::Path;

use glam::{DMat3, DVec3, UVec3};

use super::VolumeError;
use super::access::Access;
use super::data_files::DataFiles;
use super::fields::Fields;
use super::grid::{SIZES, dims_of};
use super::loaded::Loaded;
use super::orientation::{Orientation, RAS_FROM_LPS, unit_directions};
use super::sample_type::SampleType;
use super::samples::Samples;
use super::series::{MAX_CHANNELS, Series, SeriesOrder};
use super::source::{MAX_HEADER, Source};
use super::stream::Stream;
use super::text::{number, shown};
use super::unit::{self, NON_UNIFORM, unit, warn_of_itk};

/// Reads one MetaImage file, or the header and the data file it names.
pub(super) fn read(path: &Path, access: &Access) -> Result<Loaded, VolumeError> {
    let mut file = access.open(path)?;
    let header = Header::read(&mut file)?;
    let series = header.series()?;
    let (spacing, orientation) = (header.spacing()?, header.orientation()?);
    let samples = header.samples()?;
    let (is_compressed, header_size) = (header.flag("CompressedData")?.unwrap_or(false), header.header_size()?);
    let read = |data: Source, samples: &Samples| {
        let mut stream = if is_compressed { Stream::zlib(data)? } else { Stream::raw(data)? };
        let bytes = samples.bytes().saturating_mul(series.count());
        let before_the_end = stream.exactly_left().unwrap_or(0).saturating_sub(bytes);
        stream.skip(header_size.unwrap_or(before_the_end))?;
        stream.series(samples, &series, false)
    };
    let values = match header.data_files(&samples)? {
        Some(files) if series.count() > 1 && files.count() > 1 => {
            let found = format!("{} volumes in {} files", series.count(), files.count());
            return Err(header.0.invalid("ElementDataFile", found, "one file of several channels or times"));
        }
        Some(files) => files.read(path, "ElementDataFile", &samples, access, read)?,
        None => read(file, &samples)?,
    };
    let Samples { dims, kind, .. } = samples;
    let unit = header.0.get("DistanceUnits").and_then(unit);
    warn_of_itk(path, header.0.get(NON_UNIFORM));
    let loaded = Loaded::new(dims, kind, values);
    Ok(Loaded { spacing, unit, orientation, series, ..loaded })
}

/// The fields of a header, and the names of files in a list at its end.
struct Header(Fields, Vec<String>);

impl Header {
    /// Reads the header and leaves `file` where the data of a local one begins.
    fn read(file: &mut Source) -> Result<Self, VolumeError> {
        let mut fields = Fields::new(file.path.clone());
        let mut budget = MAX_HEADER;
        while let Some(line) = file.line(&mut budget)? {
            let Some((name, value)) = line.split_once('=') else {
                return Err(fields.invalid("header", shown(&line), "`Field = value`"));
            };
            fields.add(name.trim(), value)?;
            if name.trim() == "ElementDataFile" {
                let is_list = value.split_whitespace().next() == Some("LIST");
                let listed = if is_list { file.lines(&mut budget)? } else { Vec::new() };
                return Ok(Self(fields, listed));
            }
        }
        Err(fields.invalid("header", "the end of the file", "a last field ElementDataFile"))
    }

    /// The number of axes: three, and perhaps that of times.
    fn axes(&self) -> Result<usize, VolumeError> {
        self.0.value("NDims", "3 or 4", |text| text?.parse().ok().filter(|axes| [3, 4].contains(axes)))
    }

    /// The channels, which are the numbers of each voxel, and the times. Refuses anything but a volume.
    fn series(&self) -> Result<Series, VolumeError> {
        let is = |name: &str, expected: &str, default: &str| {
            let matches = |text: Option<&str>| (text.unwrap_or(default).eq_ignore_ascii_case(expected)).then_some(());
            self.0.value(name, expected, matches)
        };
        is("ObjectType", "Image", "Image")?;
        is("BinaryData", "True", "True")?;
        let channels = self.0.value("ElementNumberOfChannels", &format!("1 to {MAX_CHANNELS}"), |text| {
            text.unwrap_or("1").parse().ok().filter(|channels| (1..=MAX_CHANNELS).contains(channels))
        })?;
        let times = match self.axes()? {
            3 => 1,
            _ => self.0.value("DimSize", &format!("{SIZES}, and a number of times"), |text| {
                text?.split_whitespace().nth(3)?.parse().ok().filter(|&times| times > 0)
            })?,
        };
        let order = if channels > 1 { SeriesOrder::Interleaved } else { SeriesOrder::ChannelsFirst };
        Ok(Series { channels, times, order, is_color: false })
    }

    /// A field that is `True` or `False`.
    fn flag(&self, name: &str) -> Result<Option<bool>, VolumeError> {
        self.0.value(name, "True or False", |text| match text.map(str::to_ascii_lowercase).as_deref() {
            None => Some(None),
            Some("true" | "1") => Some(Some(true)),
            Some("false" | "0") => Some(Some(false)),
            Some(_) => None,
        })
    }

    /// `count` numbers, from the first field with one of these names that is present.
    fn numbers(&self, names: &[&str], count: usize) -> Result<Option<(String, Vec<f64>)>, VolumeError> {
        let Some(name) = names.iter().find(|name| self.0.get(name).is_some()) else { return Ok(None) };
        let numbers = self.0.value(name, &format!("finite numbers, {count} of them"), |text| {
            let numbers = text?.split_whitespace().map(number).collect::<Option<Vec<_>>>()?;
            Some(numbers).filter(|numbers| numbers.len() == count)
        })?;
        Ok(Some(((*name).to_owned(), numbers)))
    }

    /// A number for each axis in space, from the first field with one of these names that is present.
    fn in_space(&self, names: &[&str]) -> Result<Option<(String, DVec3)>, VolumeError> {
        let found = self.numbers(names, self.axes()?)?;
        Ok(found.map(|(name, numbers)| (name, DVec3::from_slice(&numbers))))
    }

    fn samples(&self) -> Result<Samples, VolumeError> {
        let axes = self.axes()?;
        let dims: UVec3 = self.0.value("DimSize", SIZES, |text| {
            let sizes: Option<Vec<u32>> = text?.split_whitespace().map(|size| size.parse().ok()).collect();
            let sizes = sizes.filter(|sizes| sizes.len() == axes)?;
            dims_of([sizes[0], sizes[1], sizes[2]])
        })?;
        let kind = self.0.value("ElementType", TYPES, |text| sample_type(text?))?;
        let (old, new) = ("ElementByteOrderMSB", "BinaryDataByteOrderMSB");
        let big_endian = match (self.flag(new)?, self.flag(old)?) {
            (Some(new), Some(old)) if old != new => {
                return Err(self.0.invalid("BinaryDataByteOrderMSB", new, format!("{old}, as ElementByteOrderMSB")));
            }
            (Some(big_endian), _) | (None, Some(big_endian)) => big_endian,
            (None, None) if kind.bytes() == 1 => false,
            (None, None) => return Err(self.0.invalid("BinaryDataByteOrderMSB", "no such field", "True or False")),
        };
        let one = |name: &str| self.numbers(&[name], 1).map(|found| found.map(|(_, numbers)| numbers[0]));
        let slope = one("ElementToIntensityFunctionSlope")?.unwrap_or(1.0);
        let intercept = one("ElementToIntensityFunctionOffset")?.unwrap_or(0.0);
        let rescale = Some([slope, intercept]).filter(|&rescale| rescale != [1.0, 0.0]);
        Ok(Samples { kind, dims, big_endian, rescale, z_fastest: false })
    }

    fn spacing(&self) -> Result<Option<DVec3>, VolumeError> {
        let Some((name, spacing)) = self.in_space(&["ElementSpacing", "ElementSize"])? else { return Ok(None) };
        let spacing = spacing.to_array();
        unit::known((&self.0.path, &name), spacing)
            .map(Some)
            .ok_or_else(|| self.0.invalid(&name, format!("{spacing:?}"), "three positive finite numbers, or 0"))
    }

    /// The orientation; each row of the matrix is an axis of the volume, of which that of times is not looked at.
    fn orientation(&self) -> Result<Option<Orientation>, VolumeError> {
        let count = self.axes()?;
        let names = ["TransformMatrix", "Rotation", "Orientation"];
        let Some((name, matrix)) = self.numbers(&names, count * count)? else {
            return Ok(None);
        };
        let axes = unit_directions([0, 1, 2].map(|axis| DVec3::from_slice(&matrix[axis * count..])))
            .map_err(|(found, allowed)| self.0.invalid(&name, found, allowed))?;
        let origin = self.in_space(&["Offset", "Position", "Origin"])?;
        let origin = origin.map_or(DVec3::ZERO, |(_, origin)| origin);
        Ok(Some(Orientation { axes: DMat3::from_diagonal(RAS_FROM_LPS) * axes, origin: RAS_FROM_LPS * origin }))
    }

    /// The number of bytes to skip in the data file; `None` if the samples end where the file ends.
    fn header_size(&self) -> Result<Option<u64>, VolumeError> {
        let is_compressed = self.flag("CompressedData")?.unwrap_or(false);
        self.0.value("HeaderSize", "a number of bytes, or -1 if the data are not compressed", |text| match text {
            Some("-1") => (!is_compressed).then_some(None),
            Some(text) if !is_compressed => text.parse().ok().map(Some),
            Some("0") | None => Some(Some(0)),
            Some(_) => None,
        })
    }

    /// The data files; `None` if the samples are in the header's own file.
    fn data_files(&self, samples: &Samples) -> Result<Option<DataFiles>, VolumeError> {
        let value = self.0.get("ElementDataFile").unwrap_or_default();
        let header = &self.0.path;
        let files = match value.split_whitespace().collect::<Vec<_>>().as_slice() {
            [] => None,
            [local] if local.eq_ignore_ascii_case("LOCAL") => return Ok(None),
            ["LIST"] => Some(DataFiles::listed(header, self.1.clone(), 2)),
            ["LIST", axes] => {
                let axes = axes.strip_suffix(['D', 'd']).unwrap_or(axes).parse().ok();
                let axes = axes.filter(|axes| (1..=3).contains(axes));
                axes.map(|axes| DataFiles::listed(header, self.1.clone(), axes))
            }
            &[pattern, min, max, step] if pattern.contains('%') => {
                DataFiles::numbered(header, [pattern, min, max, step], 2)
            }
            // ITK counts from 1.
            [pattern] if pattern.contains('%') => {
                DataFiles::numbered(header, [pattern, "1", &samples.dims.z.to_string(), "1"], 2)
            }
            _ => Some(DataFiles::one(header, value)),
        };
        let allowed = "LOCAL, the name of one file, a pattern with one %d, alone or with the numbers `min max step`, or LIST, perhaps with \
                       how many axes a file has whole, and names in the lines after it";
        files.map(Some).ok_or_else(|| self.0.invalid("ElementDataFile", shown(value), allowed))
    }
}

const TYPES: &str = "MET_CHAR, MET_UCHAR, MET_SHORT, MET_USHORT, MET_INT, MET_UINT, MET_LONG, MET_ULONG, \
                     MET_LONG_LONG, MET_ULONG_LONG, MET_FLOAT or MET_DOUBLE";

fn sample_type(name: &str) -> Option<SampleType> {
    Some(match name {
        "MET_CHAR" => SampleType::I8,
        "MET_UCHAR" => SampleType::U8,
        "MET_SHORT" => SampleType::I16,
        "MET_USHORT" => SampleType::U16,
        // A long has 4 bytes in these files, whatever C says.
        "MET_INT" | "MET_LONG" => SampleType::I32,
        "MET_UINT" | "MET_ULONG" => SampleType::U32,
        "MET_LONG_LONG" => SampleType::I64,
        "MET_ULONG_LONG" => SampleType::U64,
        "MET_FLOAT" => SampleType::F32,
        "MET_DOUBLE" => SampleType::F64,
        _ => return None,
    })
}
