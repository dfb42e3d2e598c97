//! NumPy's NPY files: a header of three fields, then the samples.
//!
//! An array's axes are z, y and x, whichever is fastest in memory, after times and channels if there are any, or before red, green, blue and perhaps A:
//! a last axis of 3 or 4 after three others is that of colours. The header is read here, not by a
//! crate for NPY: `npyz` allocates whatever length a header states, multiplies sizes unchecked, recurses into nested brackets, and takes a sixth
//! of the time that a test crate's dependencies take to build.

use std::path::Path;

use glam::UVec3;

use super::VolumeError;
use super::access::Access;
use super::error::volume::invalid;
use super::grid::{SIZES, dims_of};
use super::loaded::{ASSUMED_AXES, Loaded};
use super::sample_type::SampleType;
use super::samples::Samples;
use super::series::{MAX_CHANNELS, Series, SeriesOrder};
use super::source::MAX_HEADER;
use super::stream::Stream;
use super::text::shown;
use super::values::Values;

/// The names of types. Truth is a byte, 0 or 1.
const TYPES: [(&str, SampleType); 12] = [
    ("b1", SampleType::U8),
    ("i1", SampleType::I8),
    ("u1", SampleType::U8),
    ("i2", SampleType::I16),
    ("u2", SampleType::U16),
    ("i4", SampleType::I32),
    ("u4", SampleType::U32),
    ("i8", SampleType::I64),
    ("u8", SampleType::U64),
    ("f2", SampleType::F16),
    ("f4", SampleType::F32),
    ("f8", SampleType::F64),
];

/// An array of numbers that is no volume: the pixels of an image, or of a part of one.
pub struct Array {
    /// The axes' lengths, from the last one, which is the fastest in memory.
    pub dims: UVec3,
    /// The type of the numbers in the file.
    pub kind: SampleType,
    /// The numbers, in the order of the file.
    pub values: Values,
}

impl From<Loaded> for Array {
    fn from(Loaded { dims, kind, values, .. }: Loaded) -> Self {
        Self { dims, kind, values: values.into_values() }
    }
}

/// Reads the array of one file.
pub fn array(path: &Path, access: &Access) -> Result<Array, VolumeError> {
    read(path, access).map(Array::from)
}

/// Reads the volume of one file.
pub(super) fn read(path: &Path, access: &Access) -> Result<Loaded, VolumeError> {
    read_array(path, Stream::raw(access.open(path)?)?)
}

/// Reads an array from the beginning of its header.
pub(super) fn read_array(path: &Path, mut stream: Stream) -> Result<Loaded, VolumeError> {
    let (samples, series) = parse(path, &header(path, &mut stream)?)?;
    let Samples { dims, kind, .. } = samples;
    let values = stream.series(&samples, &series, false)?;
    Ok(Loaded { series, assumed_axes: Some(ASSUMED_AXES), ..Loaded::new(dims, kind, values) })
}

/// The text between the header's length and the samples.
fn header(path: &Path, stream: &mut Stream) -> Result<String, VolumeError> {
    let start = stream.bytes(8)?;
    let length = match start.strip_prefix(b"\x93NUMPY") {
        Some([1, 0]) => stream.bytes(2)?,
        Some([2 | 3, 0]) => stream.bytes(4)?,
        _ => {
            let found = format!("\"{}\"", start.escape_ascii());
            return Err(invalid(path, "magic", found, "\\x93NUMPY and version 1.0, 2.0 or 3.0"));
        }
    };
    let length = length.iter().rev().fold(0, |length, &byte| length << 8 | u64::from(byte));
    if length > MAX_HEADER {
        return Err(invalid(path, "header", format!("{length} bytes"), format!("at most {MAX_HEADER} bytes")));
    }
    Ok(String::from_utf8_lossy(&stream.bytes(length)?).into_owned())
}

/// Parses `{'descr': '<f4', 'fortran_order': False, 'shape': (3, 4, 5), }`, whose fields come in any order.
fn parse(path: &Path, header: &str) -> Result<(Samples, Series), VolumeError> {
    let field = |name: &str, allowed: &str| {
        let dict = header.trim().strip_prefix('{').and_then(|dict| dict.strip_suffix('}'));
        let after = dict.and_then(|dict| dict.split_once(&format!("'{name}'")));
        let value = after.and_then(|(_, after)| after.trim_start().strip_prefix(':'));
        value.map(str::trim_start).ok_or_else(|| invalid(path, name, format!("none in {}", shown(header)), allowed))
    };

    let types = format!("'<', '>' or '|', and one of {}", TYPES.map(|(name, _)| name).join(", "));
    let descr = field("descr", &types)?;
    let sample_type = || {
        let (descr, _) = descr.strip_prefix('\'')?.split_once('\'')?;
        let (order, name) = descr.split_at_checked(1)?;
        let &(_, kind) = TYPES.iter().find(|(known, _)| *known == name)?;
        match order {
            "<" => Some((kind, false)),
            ">" => Some((kind, true)),
            "|" if kind.bytes() == 1 => Some((kind, false)),
            _ => None,
        }
    };
    let (kind, big_endian) = sample_type().ok_or_else(|| invalid(path, "descr", shown(descr), &types))?;

    let order = field("fortran_order", "True or False")?;
    let z_fastest = match (order.starts_with("True"), order.starts_with("False")) {
        (true, _) => true,
        (_, true) => false,
        _ => return Err(invalid(path, "fortran_order", shown(order), "True or False")),
    };

    let allowed = format!(
        "three dimensions z, y, x: {SIZES}; or z, y, x and 3 or 4 of a colour, or c, z, y, x, or t, c, z, y, x, with at most {MAX_CHANNELS} channels"
    );
    let shape = field("shape", &allowed)?;
    let dims = || -> Option<(UVec3, Series)> {
        let (sizes, _) = shape.strip_prefix('(')?.split_once(')')?;
        let sizes = sizes.trim_end().strip_suffix(',').unwrap_or(sizes);
        let sizes: Option<Vec<u32>> = sizes.split(',').map(|size| size.trim().parse().ok()).collect();
        // In Fortran order, times and channels change first, and the numbers of a colour last.
        let order = if z_fastest { SeriesOrder::TimesInChannels } else { SeriesOrder::ChannelsFirst };
        let colors = |components: u32| {
            let series = Series::of_colors(components, 1);
            if z_fastest { Series { order: SeriesOrder::ChannelsFirst, ..series } } else { series }
        };
        let ([z, y, x], series) = match *sizes?.as_slice() {
            [z, y, x] => ([z, y, x], Series::default()),
            [z, y, x, components @ 3..=4] => ([z, y, x], colors(components)),
            [channels, z, y, x] => ([z, y, x], Series { channels, times: 1, order, is_color: false }),
            [times, channels, z, y, x] => ([z, y, x], Series { channels, times, order, is_color: false }),
            _ => return None,
        };
        let is_some = series.count() > 0 && series.channels <= MAX_CHANNELS;
        Some((dims_of([x, y, z])?, series)).filter(|_| is_some)
    };
    let (dims, series) = dims().ok_or_else(|| invalid(path, "shape", shown(shape), &allowed))?;
    Ok((Samples { kind, dims, big_endian, rescale: None, z_fastest }, series))
}
/// The bytes of a file that holds an array of `f32` in C order.
pub fn encode(shape: &[u64], numbers: impl Iterator<Item = f32>) -> Vec<u8> {
    /// Numbers begin at a multiple of this.
    const ALIGNMENT: usize = 64;
    let sides: String = shape.iter().map(|side| format!("{side}, ")).collect();
    let mut header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({sides}), }}");
    // Before it are the magic string, the version, and its length; a line feed ends it.
    let before = 10;
    let padded = (before + header.len() + 1).next_multiple_of(ALIGNMENT) - before;
    header.extend(std::iter::repeat_n(' ', padded - 1 - header.len()));
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((padded as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(numbers.flat_map(f32::to_le_bytes));
    bytes
}
