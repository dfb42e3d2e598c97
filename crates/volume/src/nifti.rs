//! NIfTI-1 and NIfTI-2 files: a binary header, then the samples in the same file (`.nii`) or in a second one (`.hdr`, `.img`), each
//! gzipped or not.
//!
//! The sform determines spacing and orientation, or else the qform; without either only `pixdim` counts. The file must end where the
//! samples end. A pair of files without NIfTI's magic is Analyze 7.5, which has the same fields but no affine and no unit other than millimetres.
//! Headers that break the standard's rules are read as nibabel and ITK read them. The value of a complex sample is its
//! magnitude.

use std::io::BufRead;
use std::path::{Path, PathBuf};

use glam::{DMat3, DQuat, DVec3, UVec3};

use super::VolumeError;
use super::access::Access;
use super::error::volume::{invalid, io_error};
use super::grid::{SIZES, dims_of};
use super::loaded::{Legend, Loaded};
use super::orientation::Orientation;
use super::sample_type::SampleType;
use super::samples::Samples;
use super::series::{MAX_CHANNELS, Series, SeriesOrder};
use super::shear::{self, Lattice};
use super::stream::Stream;
use super::value_slice::ValueSlice;
use super::voxels::{Voxels, Wanted};

/// The format's codes of data types, and the bits of each.
const TYPES: [(i64, SampleType); 10] = [
    (2, SampleType::U8),
    (4, SampleType::I16),
    (8, SampleType::I32),
    (16, SampleType::F32),
    (64, SampleType::F64),
    (256, SampleType::I8),
    (512, SampleType::U16),
    (768, SampleType::U32),
    (1024, SampleType::I64),
    (1280, SampleType::U64),
];

/// Codes of colours, with the number of bytes of each: red, green and blue, and A.
const COLOR_TYPES: [(i64, u32); 2] = [(128, 3), (2304, 4)];

/// Codes of complex data types, and the type of their parts.
const COMPLEX_TYPES: [(i64, SampleType); 2] = [(32, SampleType::F32), (1792, SampleType::F64)];

/// The code of millimetres.
const MILLIMETERS: u8 = 2;

/// The intent of values that are labels, `NIFTI_INTENT_LABEL`.
const LABELS: i64 = 1002;

/// The fields with the sform.
const SFORM: &str = "srow_x, srow_y, srow_z";

/// Reads a single file, or a pair of files by the name of either.
pub(super) fn read(path: &Path, access: &Access) -> Result<Loaded, VolumeError> {
    let header_path = sibling(path, ".img", ".hdr").unwrap_or_else(|| path.to_owned());
    let mut stream = open(&header_path, access)?;
    let header = Header::read(&header_path, &mut stream)?;
    let ((dims, series), vox_offset) = (header.dims_and_series()?, header.vox_offset()?);
    let (kind, is_complex) = header.sample_type()?;
    let rescale = if series.is_color { None } else { header.rescale()? };
    let (lattice, orientation) = header.lattice_and_orientation()?;
    if header.is_pair {
        let Some(data) = sibling(&header_path, ".hdr", ".img") else {
            return Err(header.invalid(
                "magic",
                "that of a pair of files",
                "that of a single file, or a name with .hdr",
            ));
        };
        stream = open(&data, access)?;
    }
    stream.skip(vox_offset)?;
    let samples = Samples { kind, dims, big_endian: header.big_endian, rescale, z_fastest: false };
    let values = if is_complex && series.count() > 1 {
        return Err(header.invalid("dim", format!("{:?}", header.dim), "one volume of complex samples"));
    } else if is_complex {
        log::warn!("{}: the samples are complex: the values are their magnitudes", path.display());
        magnitudes(&header, &samples, stream, access)?
    } else {
        stream.series(&samples, &series, false)?
    };
    let (spacing, unit) = (Some(lattice.spacing), header.unit());
    let legends = vec![Legend { are_labels: header.intent_code == LABELS, ..Legend::default() }];
    let loaded = Loaded { spacing, unit, orientation, legends, series, ..Loaded::new(dims, kind, values) };
    lattice.straighten(path, SFORM, loaded, access)
}

/// The complex samples whose magnitudes are computed at a time.
const BLOCK: usize = 1 << 14;

/// The magnitudes of complex samples, each a real and an imaginary part. Slope and intercept are applied first: the slope to both
/// parts, the intercept to the real part.
fn magnitudes(header: &Header, samples: &Samples, mut stream: Stream, access: &Access) -> Result<Voxels, VolumeError> {
    let UVec3 { x, y, z } = samples.dims;
    let dims = dims_of([2 * u64::from(x), y.into(), z.into()])
        .ok_or_else(|| header.invalid("dim", samples.dims, "at most 2147483647 complex voxels"))?;
    stream.access = access.wanting(Wanted::Values);
    let parts = stream.samples(&Samples { dims, rescale: None, ..*samples }, false)?.into_values();
    let [slope, intercept] = samples.rescale.unwrap_or([1.0, 0.0]);
    samples.reserve(&header.path, access)?;
    let mut values = access.wanted().none();
    let of = Samples { kind: SampleType::F64, big_endian: false, rescale: None, ..*samples };
    let parts = parts.as_slice();
    for from in (0..parts.len()).step_by(2 * BLOCK) {
        let pairs = parts.slice(from..parts.len().min(from + 2 * BLOCK));
        let magnitude = |pair: ValueSlice<'_>| {
            let [real, imaginary] = pair.run(0);
            libm::hypot(f64::from(real) * slope + intercept, f64::from(imaginary) * slope)
        };
        let bytes: Vec<u8> = pairs.chunks(2).flat_map(|pair| magnitude(pair).to_le_bytes()).collect();
        of.append(&header.path, &bytes, &mut values)?;
    }
    Ok(values)
}

/// The file's name with the ending `from`, or `from` and `.gz`, replaced by `to`; `None` if it ends otherwise. The new ending is in
/// upper case if the old one is.
fn sibling(path: &Path, from: &str, to: &str) -> Option<PathBuf> {
    let name = path.file_name()?.to_str()?;
    [str::to_ascii_lowercase, str::to_ascii_uppercase].iter().find_map(|case| {
        let (stem, gz) = name.strip_suffix(&case(".gz")).map_or((name, ""), |stem| (stem, &name[stem.len()..]));
        Some(path.with_file_name(format!("{}{}{gz}", stem.strip_suffix(&case(from))?, case(to))))
    })
}

fn open(path: &Path, access: &Access) -> Result<Stream, VolumeError> {
    let mut file = access.open(path)?;
    let is_gzip = file.reader.fill_buf().map_err(io_error(path))?.starts_with(&[0x1f, 0x8b]);
    if is_gzip { Stream::gzip(file) } else { Stream::raw(file) }
}

/// The fields that count, with the same types in both versions.
struct Header {
    path: PathBuf,
    /// The size of the header in bytes.
    bytes: u64,
    big_endian: bool,
    is_pair: bool,
    dim: [i64; 8],
    datatype: i64,
    bitpix: i64,
    pixdim: [f64; 4],
    xyzt_units: u8,
    vox_offset: f64,
    slope_and_intercept: [f64; 2],
    intent_code: i64,
    qform_code: i64,
    sform_code: i64,
    quatern_bcd: DVec3,
    qoffset: DVec3,
    /// `srow_x`, `srow_y`, `srow_z`.
    srows: [[f64; 4]; 3],
}

/// A header's bytes, read by offset.
struct Bytes {
    bytes: Vec<u8>,
    big_endian: bool,
}

impl Bytes {
    /// The bytes of a number, in little-endian order.
    fn at<const N: usize>(&self, at: usize) -> [u8; N] {
        let mut bytes = [0; N];
        bytes.copy_from_slice(&self.bytes[at..at + N]);
        if self.big_endian {
            bytes.reverse();
        }
        bytes
    }

    fn i16(&self, at: usize) -> i64 {
        i16::from_le_bytes(self.at(at)).into()
    }

    fn i32(&self, at: usize) -> i64 {
        i32::from_le_bytes(self.at(at)).into()
    }

    fn f32s<const N: usize>(&self, at: usize) -> [f64; N] {
        std::array::from_fn(|i| f32::from_le_bytes(self.at(at + 4 * i)).into())
    }

    fn f64s<const N: usize>(&self, at: usize) -> [f64; N] {
        std::array::from_fn(|i| f64::from_le_bytes(self.at(at + 8 * i)))
    }
}

impl Header {
    /// Reads only the header.
    fn read(path: &Path, stream: &mut Stream) -> Result<Self, VolumeError> {
        let mut bytes = stream.bytes(348)?;
        let size = bytes.first_chunk().map_or([0; 4], |&size| size);
        let (version, big_endian) = match (i32::from_le_bytes(size), i32::from_be_bytes(size)) {
            (348, _) => (1, false),
            (_, 348) => (1, true),
            (540, _) => (2, false),
            (_, 540) => (2, true),
            (size, _) => return Err(invalid(path, "sizeof_hdr", size, "348 or 540, in either byte order")),
        };
        if version == 2 {
            bytes.extend(stream.bytes(540 - 348)?);
        }
        let magic = if version == 1 { &bytes[344..348] } else { &bytes[4..12] };
        let mut is_analyze = false;
        let is_pair = match magic {
            b"n+1\0" | b"n+2\0\r\n\x1a\n" => false,
            b"ni1\0" | b"ni2\0\r\n\x1a\n" => true,
            // There lies the minimum of all values.
            [first, ..] if version == 1 && *first != b'n' && sibling(path, ".hdr", ".img").is_some() => {
                log::warn!("{}: Analyze 7.5, which does not say which side is left", path.display());
                is_analyze = true;
                true
            }
            other => {
                let allowed = if version == 1 { "n+1 or ni1" } else { "n+2 or ni2, then \\0\\r\\n\\x1a\\n" };
                return Err(invalid(path, "magic", format!("\"{}\"", other.escape_ascii()), allowed));
            }
        };
        let path = path.to_owned();
        let bytes = Bytes { bytes, big_endian };
        if version == 1 {
            let [[vox_offset], [slope], [intercept]] = [108, 112, 116].map(|at| bytes.f32s(at));
            let code = |at: usize| if is_analyze { 0 } else { bytes.i16(at) };
            return Ok(Self {
                path,
                bytes: 348,
                big_endian,
                is_pair,
                dim: std::array::from_fn(|i| bytes.i16(40 + 2 * i)),
                datatype: bytes.i16(70),
                bitpix: bytes.i16(72),
                pixdim: bytes.f32s(76),
                xyzt_units: if is_analyze { MILLIMETERS } else { bytes.bytes[123] },
                vox_offset,
                slope_and_intercept: [slope, intercept],
                intent_code: code(68),
                qform_code: code(252),
                sform_code: code(254),
                quatern_bcd: DVec3::from_array(bytes.f32s(256)),
                qoffset: DVec3::from_array(bytes.f32s(268)),
                srows: [280, 296, 312].map(|at| bytes.f32s(at)),
            });
        }
        let [[slope], [intercept]] = [176, 184].map(|at| bytes.f64s(at));
        Ok(Self {
            path,
            bytes: 540,
            big_endian,
            is_pair,
            dim: std::array::from_fn(|i| i64::from_le_bytes(bytes.at(16 + 8 * i))),
            datatype: bytes.i16(12),
            bitpix: bytes.i16(14),
            pixdim: bytes.f64s(104),
            xyzt_units: i32::from_le_bytes(bytes.at(500)) as u8,
            vox_offset: i64::from_le_bytes(bytes.at(168)) as f64,
            slope_and_intercept: [slope, intercept],
            intent_code: bytes.i32(504),
            qform_code: bytes.i32(344),
            sform_code: bytes.i32(348),
            quatern_bcd: DVec3::from_array(bytes.f64s(352)),
            qoffset: DVec3::from_array(bytes.f64s(376)),
            srows: [400, 432, 464].map(|at| bytes.f64s(at)),
        })
    }

    fn invalid(&self, field: &str, found: impl std::fmt::Display, allowed: impl std::fmt::Display) -> VolumeError {
        invalid(&self.path, field, found, allowed)
    }

    /// The fourth axis is time, and the fifth one has the components of vectors.
    fn dims_and_series(&self) -> Result<(UVec3, Series), VolumeError> {
        let [rank, x, y, z, rest @ ..] = self.dim;
        let more = rank.checked_sub(3).and_then(|more| usize::try_from(more).ok()).and_then(|more| rest.get(..more));
        let size =
            |at: usize| more.map(|sizes| sizes.get(at).copied().unwrap_or(1)).and_then(|n| u32::try_from(n).ok());
        let has_no_more = more.is_some_and(|sizes| sizes.iter().skip(2).all(|&size| size == 1));
        let series = size(0).zip(size(1)).map(|(times, channels)| {
            let order = SeriesOrder::TimesFirst;
            Series { channels, times, order, is_color: false }
        });
        let series = series.filter(|of| has_no_more && of.count() > 0 && of.channels <= MAX_CHANNELS);
        let series = match self.components() {
            None => series,
            Some(components) => series.filter(|of| of.channels == 1).map(|of| Series::of_colors(components, of.times)),
        };
        dims_of([x, y, z]).zip(series).ok_or_else(|| {
            let allowed = format!(
                "3 to 7, then {SIZES}, a number of times, at most {MAX_CHANNELS} components, and any further sizes 1"
            );
            self.invalid("dim", format!("{:?}", self.dim), allowed)
        })
    }

    /// The type of the samples or of their parts, and whether they are complex.
    /// The number of bytes of a colour, if samples are colours.
    fn components(&self) -> Option<u32> {
        COLOR_TYPES.iter().find(|(code, _)| *code == self.datatype).map(|&(_, components)| components)
    }

    fn sample_type(&self) -> Result<(SampleType, bool), VolumeError> {
        let of =
            |types: &[(i64, SampleType)]| types.iter().find(|(code, _)| *code == self.datatype).map(|&(_, kind)| kind);
        let (complex, components) = (of(&COMPLEX_TYPES), self.components());
        let Some(kind) = complex.or_else(|| of(&TYPES)).or(components.map(|_| SampleType::U8)) else {
            let real = TYPES.map(|(code, kind)| format!("{code} ({kind})")).join(", ");
            let complex = COMPLEX_TYPES.map(|(code, kind)| format!("{code} (complex of {kind})")).join(", ");
            let allowed = format!("{real}, {complex}, 128 (RGB24), 2304 (RGBA32)");
            return Err(self.invalid("datatype", self.datatype, allowed));
        };
        let numbers = if complex.is_some() { 2 } else { components.unwrap_or(1).into() };
        let bits = 8 * kind.bytes() as i64 * numbers;
        if self.bitpix != bits {
            return Err(self.invalid("bitpix", self.bitpix, format!("{bits}, as datatype {} has", self.datatype)));
        }
        Ok((kind, complex.is_some()))
    }

    /// The number of bytes between the header, or the beginning of the second file, and the samples.
    fn vox_offset(&self) -> Result<u64, VolumeError> {
        let before = if self.is_pair { 0 } else { self.bytes };
        // In a single file four bytes after the header announce extensions.
        let least = if self.is_pair { 0 } else { before + 4 };
        let offset = self.vox_offset;
        if offset.fract() != 0.0 || !(least as f64..=i64::MAX as f64).contains(&offset) {
            return Err(self.invalid("vox_offset", offset, format!("a whole number from {least}")));
        }
        Ok(offset as u64 - before)
    }

    /// Slope and intercept; `None` if the slope is 0 or not finite, in which case neither applies.
    fn rescale(&self) -> Result<Option<[f64; 2]>, VolumeError> {
        let [slope, intercept] = self.slope_and_intercept;
        if slope == 0.0 || !slope.is_finite() || [slope, intercept] == [1.0, 0.0] {
            return Ok(None);
        }
        if !intercept.is_finite() {
            let allowed = format!("a finite number, as the slope is {slope}");
            return Err(self.invalid("scl_inter", intercept, allowed));
        }
        Ok(Some([slope, intercept]))
    }

    fn unit(&self) -> Option<String> {
        // The higher bits are the unit of time.
        let name = match self.xyzt_units & 7 {
            1 => "m",
            MILLIMETERS => "mm",
            3 => "µm",
            _ => return None,
        };
        Some(name.to_owned())
    }

    fn lattice_and_orientation(&self) -> Result<(Lattice, Option<Orientation>), VolumeError> {
        if self.sform_code > 0 {
            let [x, y, z, first] = [0, 1, 2, 3].map(|i| DVec3::from_array(self.srows.map(|row| row[i])));
            let lattice = Lattice::of([x, y, z]).map_err(|found| self.invalid(SFORM, found, shear::allowed()))?;
            let origin = self.origin(SFORM, first)?;
            return Ok((lattice, Some(Orientation { axes: lattice.axes, origin })));
        }
        let spacing = self.spacing()?;
        if self.qform_code <= 0 {
            return Ok((Lattice::straight(spacing, DMat3::IDENTITY), None));
        }
        let axes = self.qform_axes()?;
        let origin = self.origin("qoffset_x, qoffset_y, qoffset_z", self.qoffset)?;
        Ok((Lattice::straight(spacing, axes), Some(Orientation { axes, origin })))
    }

    /// The spacing by `pixdim`. As in nibabel and ITK, 0 is read as 1 and negative numbers by their magnitude.
    fn spacing(&self) -> Result<DVec3, VolumeError> {
        let [_, written @ ..] = self.pixdim;
        if !written.iter().all(|spacing| spacing.is_finite()) {
            return Err(self.invalid("pixdim", format!("{written:?}"), "three finite numbers"));
        }
        let spacing = written.map(|spacing| if spacing == 0.0 { 1.0 } else { spacing.abs() });
        if spacing != written {
            log::warn!("{}: pixdim: {written:?} is not a spacing: using {spacing:?}", self.path.display());
        }
        Ok(DVec3::from_array(spacing))
    }

    fn qform_axes(&self) -> Result<DMat3, VolumeError> {
        let squares = self.quatern_bcd.length_squared();
        // Stored as `f32`, the squares of a half turn may add up to a little more than 1.
        if squares.is_nan() || squares > 1.0 + 1e-5 {
            let allowed = "three numbers whose squares add up to at most 1";
            return Err(self.invalid("quatern_b, quatern_c, quatern_d", self.quatern_bcd, allowed));
        }
        let rotation = DQuat::from_vec4(self.quatern_bcd.extend((1.0 - squares).max(0.0).sqrt())).normalize();
        let handedness = DVec3::new(1.0, 1.0, if self.pixdim[0] < 0.0 { -1.0 } else { 1.0 });
        Ok(DMat3::from_quat(rotation) * DMat3::from_diagonal(handedness))
    }

    fn origin(&self, field: &str, origin: DVec3) -> Result<DVec3, VolumeError> {
        if origin.is_finite() { Ok(origin) } else { Err(self.invalid(field, origin, "finite numbers")) }
    }
}
