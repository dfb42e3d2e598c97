//! One file: the format of its pixels, and the positions of its frames.

use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use super::super::VolumeError;
use super::super::access::Access;
use super::super::error::volume::{invalid, io_error};
use super::super::sample_type::SampleType;
use super::codecs::Codec;
use super::dataset::{Dataset, Tag, tags};
use super::elements::{Elements, PixelData};
use super::frames::{self, Assumed, Frame};
use super::marks::{self, Marked};
use super::palette::{self, Palette};
use super::segments::Segments;
use super::table::Table;

/// The class of files that contain no image but a list of other files.
const DIRECTORY: &str = "1.2.840.10008.1.3.10";

/// The photometric interpretation of pixels that are indices of a palette.
const INDICES: &str = "PALETTE COLOR";

/// A file's statements about the series that it belongs to.
pub(super) struct Belonging {
    pub(super) path: PathBuf,
    pub(super) series: String,
    /// The number of the series; the largest if the file states none.
    pub(super) series_number: i64,
    pub(super) description: String,
}

/// A file with pixels.
pub(super) enum Opened {
    Image(Box<Image>),
    /// One that cannot be part of a volume.
    Refused {
        belonging: Belonging,
        /// Whether it has a position, so that the volume would lack it.
        is_placed: bool,
        error: VolumeError,
    },
}

/// An image of one or more frames.
pub(super) struct Image {
    pub(super) path: PathBuf,
    pub(super) belonging: Belonging,
    /// The instance's identity and number, each empty if the file does not state it.
    pub(super) instance: String,
    pub(super) number: String,
    /// The file's statements about all its frames that tell images at one place apart.
    pub(super) marked: Marked,
    /// The missing element, for want of which frames were placed by defaults.
    pub(super) assumed: Option<Assumed>,
    pub(super) pixels: Pixels,
    /// The values of samples, if a table states them.
    table: Option<Table>,
    /// The colours of values, if these are indices.
    pub(super) palette: Option<Palette>,
    /// The segments, if the image is a segmentation.
    pub(super) segments: Option<Segments>,
    /// The unit of the rescaled values.
    pub(super) value_unit: Option<String>,
    pub(super) frames: Vec<Frame>,
    codec: Codec,
    data: PixelData,
    /// All native pixels, if the file is deflated.
    inflated: Option<Vec<u8>>,
}

/// The unit that RescaleType names; that of CT is HU unless it says otherwise (DICOM PS3.3 C.11.1.1.2). `US` means unspecified.
fn value_unit(data: &Dataset) -> Option<String> {
    let of_ct = || (data.text(tags::MODALITY).as_deref() == Some("CT")).then(|| "HU".to_owned());
    data.text(tags::RESCALE_TYPE).or_else(of_ct).filter(|unit| unit != "US")
}

/// The pixel format of every frame of an image.
#[derive(Clone, Copy)]
pub(super) struct Pixels {
    pub(super) columns: u16,
    pub(super) rows: u16,
    pub(super) kind: SampleType,
    /// The samples of a pixel: one, or three of a colour.
    pub(super) samples: u16,
    /// Whether all red samples of a frame are stored first, then all green ones, then all blue ones.
    is_planar: bool,
    /// Whether samples are bits, the lowest bit of a byte first, without gaps between rows and frames (PS3.5 8.1.1).
    is_packed: bool,
    /// The number of significant low bits in a sample.
    bits: u16,
    big_endian: bool,
    /// Whether the minimum sample is white.
    is_inverted: bool,
    /// Whether the samples are a luminance and two differences of colours.
    is_ybr: bool,
}

impl Image {
    /// Reads the elements before the pixels; `None` if the file is not an image.
    pub(super) fn open(path: &Path, access: &Access) -> Result<Option<Opened>, VolumeError> {
        let elements = Elements::read(path, access)?;
        let data = &elements.data;
        if elements.pixels.is_none() || data.text(tags::MEDIA_SOP_CLASS).as_deref() == Some(DIRECTORY) {
            return Ok(None);
        }
        let belonging = |data: &Dataset| Belonging {
            path: path.to_owned(),
            series: data.text(tags::SERIES).unwrap_or_default(),
            series_number: data.text(tags::SERIES_NUMBER).and_then(|text| text.parse().ok()).unwrap_or(i64::MAX),
            description: [tags::MODALITY, tags::SERIES_DESCRIPTION]
                .into_iter()
                .filter_map(|tag| data.text(tag))
                .collect::<Vec<_>>()
                .join(" "),
        };
        let (refused, is_placed) = (belonging(data), frames::are_placed(data));
        match Self::of(path, elements, belonging, access) {
            Ok(image) => Ok(image.map(|image| Opened::Image(Box::new(image)))),
            Err(error) => Ok(Some(Opened::Refused { belonging: refused, is_placed, error })),
        }
    }

    fn of(
        path: &Path,
        elements: Elements,
        belonging: impl Fn(&Dataset) -> Belonging,
        access: &Access,
    ) -> Result<Option<Self>, VolumeError> {
        let Elements { data, transfer_syntax, big_endian, pixels, mut rest } = elements;
        let Some((tag, pixel_data)) = pixels else { return Ok(None) };
        let codec =
            Codec::of(&transfer_syntax).map_err(|found| data.invalid(tags::TRANSFER_SYNTAX, found, Codec::ALLOWED))?;
        let pixels = Pixels::of(&data, tag, big_endian, codec)?;
        if let PixelData::Native { in_words: true, .. } = pixel_data
            && big_endian
            && pixels.kind.bytes() == 1
        {
            return Err(data.invalid(tag, "bytes in big-endian words", "bytes, or samples of 2 bytes"));
        }
        let count = data.numbers::<1>(tags::FRAMES)?.map_or(1.0, |[count]| count);
        if count.fract() != 0.0 || !(1.0..=f64::from(u32::MAX)).contains(&count) {
            return Err(data.invalid(tags::FRAMES, count, "a positive integer"));
        }
        let count = count as usize;
        pixels.check(&data, tag, &pixel_data, count, codec)?;
        let (frames, assumed) = frames::read(&data, count)?;
        let is_signed = matches!(pixels.kind, SampleType::I8 | SampleType::I16 | SampleType::I32);
        let segments = Segments::read(&data, count)?;
        let value_unit = value_unit(&data);
        let has_palette = data.text(tags::PHOTOMETRIC).as_deref() == Some(INDICES);
        let palette = has_palette.then(|| palette::read(&data, is_signed)).transpose()?;
        let table = data.items(tags::MODALITY_LUT).first().map(|item| Table::read(item, is_signed)).transpose()?;
        let inflated = match &pixel_data {
            PixelData::Native { bytes, .. } if rest.is_inflated() => {
                access.reserve(path, "PixelData", format!("{count} inflated frames"), *bytes)?;
                Some(rest.read_up_to(*bytes)?)
            }
            _ => None,
        };
        Ok(Some(Self {
            path: path.to_owned(),
            belonging: belonging(&data),
            instance: data.text(tags::SOP_INSTANCE).unwrap_or_default(),
            number: data.text(tags::INSTANCE_NUMBER).unwrap_or_default(),
            marked: marks::of_file(&data),
            assumed,
            frames,
            pixels,
            table: table.filter(|_| pixels.samples == 1),
            palette,
            segments,
            value_unit,
            codec,
            data: pixel_data,
            inflated,
        }))
    }

    /// The type of the samples that [`Self::frame`] gives.
    pub(super) fn kind(&self) -> SampleType {
        if self.table.is_some() { SampleType::U16 } else { self.pixels.kind }
    }

    /// A frame's samples, in the machine's byte order.
    pub(super) fn frame(&self, index: usize, access: &Access) -> Result<Vec<u8>, VolumeError> {
        let Pixels { columns, rows, kind, .. } = self.pixels;
        let [first, size] = self.pixels.stretch(index);
        let mut bytes = match (&self.data, &self.inflated) {
            (PixelData::Native { .. }, Some(all)) => {
                let of_frame = all.get(first as usize..).unwrap_or_default();
                let of_frame = &of_frame[..of_frame.len().min(size as usize)];
                self.check_read(of_frame.len(), size)?;
                of_frame.to_vec()
            }
            (&PixelData::Native { at, .. }, None) => self.read(&[[at + first, size]], access)?,
            (PixelData::Fragments(fragments), _) => {
                // A single frame may be split into several fragments.
                let of_frame = if self.frames.len() == 1 { fragments } else { &fragments[index..=index] };
                let code = self.read(of_frame, access)?;
                self.codec.decode(code, [columns, rows], self.pixels.bytes_per_pixel()).map_err(|found| {
                    invalid(&self.path, "PixelData", found, format!("a frame of {columns} × {rows} {kind}"))
                })?
            }
        };
        if self.pixels.is_packed {
            bytes = self.pixels.unpacked(&bytes, index);
        }
        if self.codec == Codec::None && self.pixels.big_endian != cfg!(target_endian = "big") {
            bytes.chunks_exact_mut(kind.bytes() as usize).for_each(<[u8]>::reverse);
        }
        self.pixels.make_numbers(&mut bytes);
        let mut bytes = self.pixels.side_by_side(bytes, self.codec);
        if self.pixels.is_ybr {
            bytes.as_chunks_mut().0.iter_mut().for_each(|pixel| *pixel = rgb(*pixel));
        }
        if let Some(table) = &self.table {
            bytes = table.values_of(&bytes, kind);
        }
        Ok(bytes)
    }

    /// The bytes of some ranges of the file, each given by its first byte and its length.
    fn read(&self, stretches: &[[u64; 2]], access: &Access) -> Result<Vec<u8>, VolumeError> {
        let mut file = access.open(&self.path)?;
        let mut all = Vec::new();
        for &[at, bytes] in stretches {
            file.reader.seek(SeekFrom::Start(at)).map_err(io_error(&self.path))?;
            let read = file.reader.by_ref().take(bytes).read_to_end(&mut all).map_err(io_error(&self.path))?;
            self.check_read(read, bytes)?;
        }
        Ok(all)
    }

    fn check_read(&self, read: usize, bytes: u64) -> Result<(), VolumeError> {
        if read as u64 == bytes {
            return Ok(());
        }
        Err(invalid(&self.path, "PixelData", format!("{read} bytes of a frame"), format!("{bytes} bytes")))
    }
}

impl Pixels {
    fn of(data: &Dataset, tag: Tag, big_endian: bool, codec: Codec) -> Result<Self, VolumeError> {
        let required = |tag: Tag| data.unsigned(tag)?.ok_or_else(|| data.missing(tag, "a number for every image"));
        let [columns, rows] = [required(tags::COLUMNS)?, required(tags::ROWS)?];
        for (tag, size) in [(tags::COLUMNS, columns), (tags::ROWS, rows)] {
            if size == 0 {
                return Err(data.invalid(tag, size, "at least 1"));
            }
        }
        let samples = data.unsigned(tags::SAMPLES_PER_PIXEL)?.unwrap_or(1);
        if ![1, 3].contains(&samples) {
            return Err(data.invalid(tags::SAMPLES_PER_PIXEL, samples, "1 or 3"));
        }
        let is_planar = samples > 1 && data.unsigned(tags::PLANAR)?.unwrap_or(0) == 1;
        let photometric = data.text(tags::PHOTOMETRIC).unwrap_or_default();
        let [is_inverted, is_ybr] = match photometric.as_str() {
            // Which float is white is undefined.
            "MONOCHROME1" if tag == tags::PIXEL_DATA && samples == 1 => [true, false],
            "MONOCHROME2" if samples == 1 => [false; 2],
            INDICES if tag == tags::PIXEL_DATA && samples == 1 => [false; 2],
            "RGB" if samples == 3 && codec != Codec::Jpeg => [false; 2],
            // The decoder of JPEG gives red, green and blue.
            "YBR_FULL" | "YBR_FULL_422" if samples == 3 && codec == Codec::Jpeg => [false; 2],
            "YBR_FULL" if samples == 3 => [false, true],
            _ => {
                let allowed = match (samples, codec) {
                    (1, _) => "MONOCHROME2, or MONOCHROME1 or PALETTE COLOR for whole numbers",
                    (_, Codec::Jpeg) => "YBR_FULL or YBR_FULL_422 for colours",
                    _ => "RGB or YBR_FULL for colours",
                };
                return Err(data.invalid(tags::PHOTOMETRIC, photometric, allowed));
            }
        };
        let allocated = required(tags::BITS_ALLOCATED)?;
        if samples > 1 && (tag != tags::PIXEL_DATA || ![8, 16].contains(&allocated)) {
            return Err(data.invalid(tags::BITS_ALLOCATED, allocated, "whole numbers of 8 or 16 bits for colours"));
        }
        if is_ybr && allocated != 8 {
            return Err(data.invalid(tags::BITS_ALLOCATED, allocated, "8 bits for YBR_FULL"));
        }
        let is_signed = data.unsigned(tags::PIXEL_REPRESENTATION)?.unwrap_or(0) == 1;
        let is_packed = tag == tags::PIXEL_DATA && allocated == 1 && codec == Codec::None;
        let kind = match (tag, allocated, is_signed) {
            (_, 1, false) if is_packed => SampleType::U8,
            (tags::FLOAT_PIXEL_DATA, 32, _) => SampleType::F32,
            (tags::DOUBLE_PIXEL_DATA, 64, _) => SampleType::F64,
            (tags::PIXEL_DATA, 8, false) => SampleType::U8,
            (tags::PIXEL_DATA, 8, true) => SampleType::I8,
            (tags::PIXEL_DATA, 16, false) => SampleType::U16,
            (tags::PIXEL_DATA, 16, true) => SampleType::I16,
            (tags::PIXEL_DATA, 32, false) => SampleType::U32,
            (tags::PIXEL_DATA, 32, true) => SampleType::I32,
            _ => {
                let allowed = "1 (uncompressed), 8, 16 or 32, of floats 32 or 64";
                return Err(data.invalid(tags::BITS_ALLOCATED, allocated, allowed));
            }
        };
        let pixels = Self {
            columns,
            rows,
            kind,
            samples,
            is_planar,
            is_packed,
            bits: allocated,
            big_endian,
            is_inverted,
            is_ybr,
        };
        if tag != tags::PIXEL_DATA {
            return Ok(pixels);
        }
        let bits = data.unsigned(tags::BITS_STORED)?.unwrap_or(allocated);
        if !(1..=allocated).contains(&bits) {
            return Err(data.invalid(tags::BITS_STORED, bits, format!("1 to {allocated}")));
        }
        let high = data.unsigned(tags::HIGH_BIT)?.unwrap_or(bits - 1);
        if high != bits - 1 {
            return Err(data.invalid(tags::HIGH_BIT, high, format!("{}, the highest of {bits}", bits - 1)));
        }
        Ok(Self { bits, ..pixels })
    }

    /// The size of a frame in bytes, each bit in a byte of its own.
    fn bytes(&self) -> u64 {
        u64::from(self.columns) * u64::from(self.rows) * self.bytes_per_pixel() as u64
    }

    /// The first byte of an uncompressed frame among those of all, and the number of bytes that hold it.
    fn stretch(&self, index: usize) -> [u64; 2] {
        let (index, size) = (index as u64, self.bytes());
        if !self.is_packed {
            return [index * size, size];
        }
        let [first, end] = [index * size / 8, ((index + 1) * size).div_ceil(8)];
        [first, end - first]
    }

    /// The samples of a frame of bits, each in a byte, given the bytes that hold it.
    fn unpacked(&self, bytes: &[u8], index: usize) -> Vec<u8> {
        let size = self.bytes() as usize;
        let first = index * size % 8;
        (first..first + size).map(|bit| bytes[bit / 8] >> (bit % 8) & 1).collect()
    }

    fn bytes_per_pixel(&self) -> usize {
        self.kind.bytes() as usize * usize::from(self.samples)
    }

    /// A frame's samples with those of a pixel side by side, red first.
    fn side_by_side(&self, bytes: Vec<u8>, codec: Codec) -> Vec<u8> {
        let (sample, count) = (self.kind.bytes() as usize, usize::from(self.samples));
        match codec {
            // A pixel's bytes were decoded as those of one number, whose order is the machine's.
            Codec::Rle if count > 1 && cfg!(target_endian = "little") => bytes
                .chunks_exact(sample * count)
                .flat_map(|pixel| pixel.chunks_exact(sample).rev().flatten())
                .copied()
                .collect(),
            Codec::None if self.is_planar => {
                let pixels = bytes.len() / (sample * count);
                let of_pixel = |at: usize| {
                    (0..count).flat_map(move |plane| {
                        let first = (plane * pixels + at) * sample;
                        first..first + sample
                    })
                };
                (0..pixels).flat_map(of_pixel).map(|at| bytes[at]).collect()
            }
            _ => bytes,
        }
    }

    /// Refuses pixel data whose size or number differs from that of the frames.
    fn check(
        &self,
        data: &Dataset,
        tag: Tag,
        pixel_data: &PixelData,
        frames: usize,
        codec: Codec,
    ) -> Result<(), VolumeError> {
        match pixel_data {
            PixelData::Native { bytes, .. } if codec == Codec::None => {
                let samples = self.bytes().saturating_mul(frames as u64);
                let expected = if self.is_packed { samples.div_ceil(8) } else { samples };
                // The size is padded to an even number.
                if *bytes == expected || *bytes == expected.saturating_add(expected % 2) {
                    return Ok(());
                }
                let Self { columns, rows, kind, .. } = self;
                let allowed = format!("{expected} bytes ({frames} frames of {columns} × {rows} {kind})");
                let allowed = if self.is_packed { allowed.replace("uint8", "bits") } else { allowed };
                Err(data.invalid(tag, format!("{bytes} bytes"), allowed))
            }
            PixelData::Fragments(fragments) if codec != Codec::None => {
                if frames == fragments.len() || frames == 1 && !fragments.is_empty() {
                    return Ok(());
                }
                let found = format!("{} fragments for {frames} frames", fragments.len());
                Err(data.invalid(tag, found, "one for each frame"))
            }
            PixelData::Native { .. } => Err(data.invalid(tag, "bare samples", "frames as the transfer syntax says")),
            PixelData::Fragments(_) => Err(data.invalid(tag, "fragments", "bare samples, as the transfer syntax says")),
        }
    }

    /// Inverts samples whose minimum is white. Sets the bits above the significant ones, which may hold overlays, to the sign or to 0.
    fn make_numbers(&self, bytes: &mut [u8]) {
        let shift = 8 * self.kind.bytes() as u32 - u32::from(self.bits);
        if shift == 0 && !self.is_inverted {
            return;
        }
        macro_rules! make {
            ($type:ty) => {{
                // The inverse of a number, signed or unsigned, is its bitwise complement.
                let inverse = if self.is_inverted { !0 } else { 0 };
                for sample in bytes.as_chunks_mut().0 {
                    *sample = ((<$type>::from_ne_bytes(*sample) ^ inverse) << shift >> shift).to_ne_bytes();
                }
            }};
        }
        match self.kind {
            SampleType::U8 => make!(u8),
            SampleType::I8 => make!(i8),
            SampleType::U16 => make!(u16),
            SampleType::I16 => make!(i16),
            SampleType::U32 => make!(u32),
            SampleType::I32 => make!(i32),
            SampleType::U64 | SampleType::I64 | SampleType::F16 | SampleType::F32 | SampleType::F64 => {}
        }
    }
}

/// Red, green and blue of a luminance and two differences of colours (`YBR_FULL`: ITU-R BT.601 over the whole range).
fn rgb([y, blue, red]: [u8; 3]) -> [u8; 3] {
    let [y, blue, red] = [f64::from(y), f64::from(blue) - 128.0, f64::from(red) - 128.0];
    let colors = [y + 1.402 * red, y - 0.344_136 * blue - 0.714_136 * red, y + 1.772 * blue];
    colors.map(|color| color.round().clamp(0.0, 255.0) as u8)
}
