//! The pages of one file.

use std::fmt::{self, Display, Formatter};
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use ::tiff::decoder::ifd::Value;
use ::tiff::decoder::{ChunkType, Decoder, DecodingSampleType, Limits};
use ::tiff::tags::{ByteOrder, Tag};
use ::tiff::{ColorType, TiffError};

use super::super::VolumeError;
use super::super::access::Access;
use super::super::display::ChannelDisplay;
use super::super::error::volume::{invalid, io_error};
use super::super::sample_type::SampleType;
use super::directory::{descriptions, low_byte_of, most_values, overlong_entry};
use super::display;
use super::overlay::Overlay;
use super::trial::{self, is_suspicious};

/// The tags' values that are used.
const UNCOMPRESSED: u16 = 1;
const REDUCED: u32 = 1;
const WHITE_IS_ZERO: u16 = 0;
const BLACK_IS_ZERO: u8 = 1;
const PALETTE: u16 = 3;
const HIGHEST_BIT_FIRST: u16 = 1;

/// The tag of a page that holds several slices.
const IMAGE_DEPTH: u16 = 32997;

/// LZW's longest string is 4096 bytes for a code of 12 bits; the other compressions here expand less.
const MAX_EXPANSION: u64 = 4096;

/// The number of colours in a palette for 8-bit indices.
const COLORS: usize = 256;

/// The size and sample type of a page.
#[derive(Clone, Copy, PartialEq)]
pub(super) struct Page {
    pub(super) size: [u32; 2],
    /// The samples of a pixel, which lie side by side: one, or three or four of a colour.
    pub(super) samples: u32,
    /// The type of the samples that become values.
    pub(super) kind: SampleType,
    /// The bits of a sample in the file: those of the type, or 1 of whether a pixel is set.
    bits: u32,
}

impl Page {
    /// The bytes of the samples as they are stored, whose rows begin at whole bytes.
    fn stored_bytes(self) -> u64 {
        let [width, height] = self.size.map(u64::from);
        // Products of a 32-bit size and a few bits fit in 64 bits.
        (width * u64::from(self.samples) * u64::from(self.bits)).div_ceil(8).saturating_mul(height)
    }

    /// The samples that become values.
    fn unpacked(self, bytes: Vec<u8>) -> Vec<u8> {
        if self.bits > 1 {
            return bytes;
        }
        let width = self.size[0] as usize;
        let row = |row: &[u8]| (0..width).map(|x| row[x / 8] >> (7 - x % 8) & 1).collect::<Vec<u8>>();
        bytes.chunks(width.div_ceil(8)).flat_map(row).collect()
    }

    pub(super) fn bytes(self) -> u64 {
        let [width, height] = self.size.map(u64::from);
        // The product of two 32-bit sizes fits in 64 bits.
        (width * height).saturating_mul(self.kind.bytes() * u64::from(self.samples))
    }

    /// Planes of samples as pixels, whose samples lie side by side.
    fn side_by_side(self, planes: &[u8]) -> Vec<u8> {
        let (sample, samples) = (self.kind.bytes() as usize, self.samples as usize);
        let plane = planes.len() / samples;
        let pixel = |at: usize| (0..samples).flat_map(move |number| &planes[number * plane + at..][..sample]);
        (0..plane).step_by(sample).flat_map(pixel).copied().collect()
    }
}

impl Display for Page {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let [width, height] = self.size;
        let colors = if self.samples > 1 { format!(" colours of {}", self.samples) } else { String::new() };
        write!(f, "{width} × {height}{colors} ")?;
        match self.bits {
            1 => f.write_str("bits"),
            _ => self.kind.fmt(f),
        }
    }
}

/// A file, positioned at one of its pages.
pub(super) struct Pages {
    pub(super) path: PathBuf,
    /// The current page.
    pub(super) page: Page,
    /// Whether the samples of a pixel lie in planes of their own in the file.
    is_planar: bool,
    /// Red, green and blue for each value, if the pixels are indices of a palette.
    pub(super) palette: Option<Vec<[u8; 3]>>,
    decoder: Decoder<Overlay>,
    /// The number of the current directory.
    number: u32,
    /// The bytes of the file that no page so far has claimed.
    unclaimed: u64,
    /// The offsets of the page's chunks: strips or tiles.
    offsets: Vec<u64>,
    counts: Vec<u64>,
}

impl Pages {
    /// Opens a file at its first page.
    pub(super) fn open(path: &Path, access: &Access) -> Result<Self, VolumeError> {
        let mut file = access.open(path)?;
        let unclaimed = file.left()?;
        let mut reader = BufReader::new(file.reader.into_inner());
        let overlong = overlong_entry(&mut reader, unclaimed).map_err(io_error(path))?;
        if let Some((tag, values)) = overlong {
            let allowed = format!("at most {} in so small a file", most_values(unclaimed));
            return Err(invalid(path, &format!("tag {tag}"), format!("{values} values"), allowed));
        }
        reader.rewind().map_err(io_error(path))?;
        let decoder = Decoder::new(Overlay::new(reader)).map_err(failed(path, "page 1"))?;
        // The decoder allocates memory for the values of tags; the memory for pages is reserved here.
        let mut limits = Limits::default();
        limits.intermediate_buffer_size = usize::MAX;
        limits.decoding_buffer_size = most_values(unclaimed) as usize * size_of::<Value>();
        let mut pages = Self {
            path: path.to_owned(),
            page: Page { size: [0; 2], samples: 1, kind: SampleType::U8, bits: 8 },
            is_planar: false,
            palette: None,
            decoder: decoder.with_limits(limits),
            number: 1,
            unclaimed,
            offsets: Vec::new(),
            counts: Vec::new(),
        };
        if pages.is_reduced()? && !pages.next()? {
            return Err(invalid(path, "pages", "reduced pictures only", "one of full size"));
        }
        pages.describe()?;
        pages.check_chunks()?;
        Ok(pages)
    }

    /// The page's name in errors.
    pub(super) fn name(&self) -> String {
        format!("page {}", self.number)
    }

    pub(super) fn has_more(&self) -> bool {
        self.decoder.more_images()
    }

    /// Goes to the next page that is not a thumbnail; `false` if there is none.
    pub(super) fn next(&mut self) -> Result<bool, VolumeError> {
        while self.decoder.more_images() {
            self.number += 1;
            self.decoder.next_image().map_err(failed(&self.path, &self.name()))?;
            if !self.is_reduced()? {
                self.describe()?;
                self.check_chunks()?;
                return Ok(true);
            }
        }
        Ok(false)
    }

    pub(super) fn is_big_endian(&self) -> bool {
        self.decoder.byte_order() == ByteOrder::BigEndian
    }

    pub(super) fn unsigned<N: TryFrom<u64>>(&mut self, tag: Tag) -> Result<Option<N>, VolumeError> {
        let name = self.name();
        self.decoder.find_tag_unsigned(tag).map_err(failed(&self.path, &name))
    }

    /// A tag's positive fraction; `None` if it is missing or invalid.
    pub(super) fn fraction(&mut self, tag: Tag) -> Option<f64> {
        let value = match self.decoder.find_tag(tag).ok()?? {
            Value::Rational(numerator, denominator) => f64::from(numerator) / f64::from(denominator),
            Value::Float(value) => value.into(),
            Value::Double(value) => value,
            _ => return None,
        };
        (value > 0.0 && value.is_finite()).then_some(value)
    }

    /// The first page's descriptions, in any encoding. The decoder knows only the last one.
    pub(super) fn descriptions(&mut self) -> Result<Vec<String>, VolumeError> {
        let directory = self.decoder.ifd_pointer().map_or(0, |pointer| pointer.0);
        let (path, limit) = (self.path.clone(), self.unclaimed);
        let file = self.decoder.inner();
        let mut all = Vec::new();
        for (at, length) in descriptions(file, directory).map_err(io_error(&path))? {
            if length > limit {
                let found = format!("{length} bytes");
                return Err(invalid(&path, "ImageDescription", found, "no more than the file has"));
            }
            let mut bytes = vec![0; length as usize];
            let read = file.seek(SeekFrom::Start(at)).and_then(|_| file.read_exact(&mut bytes));
            read.map_err(|error| match error.raw_os_error() {
                Some(_) => io_error(&path)(error),
                None => invalid(&path, "ImageDescription", error, "a text within the file"),
            })?;
            all.push(String::from_utf8_lossy(&bytes).trim_end_matches('\0').to_owned());
        }
        Ok(all)
    }

    /// The number of a tag's values; 0 if the page has no such tag.
    pub(super) fn count_of(&mut self, tag: u16) -> Result<u32, VolumeError> {
        let entry = self.decoder.image_ifd().find_entry(Tag::from_u16_exhaustive(tag));
        let count = entry.map_or(0, |entry| entry.count());
        count.try_into().map_err(|_| invalid(&self.path, &format!("tag {tag}"), count, "at most 4294967295 values"))
    }

    /// The number of slices in the page.
    pub(super) fn depth(&mut self) -> Result<u32, VolumeError> {
        Ok(self.unsigned(Tag::from_u16_exhaustive(IMAGE_DEPTH))?.unwrap_or(1))
    }

    /// The first page's displays of channels by ImageJ's own tags. Damaged ones are left out, with a warning.
    pub(super) fn image_j_displays(&mut self) -> Result<Vec<ChannelDisplay>, VolumeError> {
        let [counts, metadata] = [50838, 50839].map(Tag::from_u16_exhaustive);
        let Some(bytes) = self.bytes_of(metadata, "IJMetadata")? else { return Ok(Vec::new()) };
        let counts: Option<Vec<u64>> = self.decoder.find_tag_unsigned_vec(counts).ok().flatten();
        let found = display::of_image_j(&bytes, &counts.unwrap_or_default(), self.is_big_endian());
        if found.is_none() {
            log::warn!("{}: the tag IJMetadata is damaged: its windows and colours are left out", self.path.display());
        }
        Ok(found.unwrap_or_default())
    }

    /// The bytes of a tag.
    fn bytes_of(&mut self, tag: Tag, field: &str) -> Result<Option<Vec<u8>>, VolumeError> {
        let (name, limit) = (self.name(), self.unclaimed);
        let mut directory = self.decoder.image_ifd();
        let Some(entry) = directory.find_entry(tag) else { return Ok(None) };
        if entry.count() > limit {
            let found = format!("{} bytes", entry.count());
            return Err(invalid(&self.path, field, found, "no more than the file has"));
        }
        let mut bytes = vec![0; entry.count() as usize];
        directory.find_tag_bytes(tag, &mut bytes, 0).map_err(failed(&self.path, &name))?;
        Ok(Some(bytes))
    }

    fn is_reduced(&mut self) -> Result<bool, VolumeError> {
        Ok(self.unsigned::<u32>(Tag::NewSubfileType)?.is_some_and(|kind| kind & REDUCED != 0))
    }

    /// Determines the page's size and type. Refuses a page that is not a grid of numbers or that promises more than the file can hold.
    fn describe(&mut self) -> Result<(), VolumeError> {
        let name = self.name();
        let order = self.unsigned::<u16>(Tag::FillOrder)?.unwrap_or(HIGHEST_BIT_FIRST);
        if order != HIGHEST_BIT_FIRST {
            return Err(invalid(&self.path, "FillOrder", order, "1: the highest bit comes first"));
        }
        let depth = self.depth()?;
        if depth > 1 && (self.number > 1 || self.has_more()) {
            return Err(invalid(
                &self.path,
                "ImageDepth",
                format!("{depth} in {name} of several"),
                "1, or a single page",
            ));
        }
        self.palette = self.take_palette()?;
        let failed = failed(&self.path, &name);
        let (width, height) = self.decoder.dimensions().map_err(&failed)?;
        let color = self.decoder.colortype().map_err(&failed)?;
        let layout = self.decoder.image_buffer_layout().map_err(&failed)?;
        let samples = match color {
            ColorType::RGB(_) | ColorType::RGBA(_) => u32::from(color.num_samples()),
            _ => 1,
        };
        let planes = layout.planes as u32;
        let kind = match (color, layout.sample_type) {
            (ColorType::RGB(8 | 16 | 32 | 64) | ColorType::RGBA(8 | 16 | 32 | 64), Some(sample_type))
                if planes == 1 || planes == samples =>
            {
                Some(sample_type)
            }
            (ColorType::Gray(8), Some(sample_type)) if self.palette.is_some() => Some(sample_type),
            (ColorType::Gray(1), Some(DecodingSampleType::U8)) if self.palette.is_none() => {
                Some(DecodingSampleType::U8)
            }
            (ColorType::Gray(8 | 16 | 32 | 64), Some(sample_type)) if self.palette.is_none() => Some(sample_type),
            _ => None,
        };
        let bits = u32::from(color.bit_depth());
        let Some(kind) = kind.map(sample_type_of) else {
            let found = match color {
                _ if self.palette.is_some() => format!("indices of a palette, {color:?}"),
                _ => format!("{color:?}, {:?}", layout.sample_format),
            };
            let allowed = "one sample a pixel, or RGB or RGBA: an integer of 1 or 8 to 64 bits, a float of 16 to 64 bits, or an index of 8 bits of a palette";
            return Err(invalid(&self.path, &name, found, allowed));
        };
        self.page = Page { size: [width, height], samples, kind, bits };
        self.is_planar = planes > 1;
        let tags = match self.decoder.get_chunk_type() {
            ChunkType::Strip => [Tag::StripOffsets, Tag::StripByteCounts],
            ChunkType::Tile => [Tag::TileOffsets, Tag::TileByteCounts],
        };
        let [offsets, counts] = tags.map(|tag| self.decoder.find_tag_unsigned_vec(tag));
        self.offsets = offsets.map_err(&failed)?.unwrap_or_default();
        self.counts = counts.map_err(&failed)?.unwrap_or_default();
        Ok(())
    }

    /// The page's palette. Afterwards the decoder reads the page as grey.
    fn take_palette(&mut self) -> Result<Option<Vec<[u8; 3]>>, VolumeError> {
        if self.unsigned::<u16>(Tag::PhotometricInterpretation)? != Some(PALETTE) {
            return Ok(None);
        }
        let name = self.name();
        let failed = failed(&self.path, &name);
        let channels = self.decoder.find_tag_unsigned_vec::<u16>(Tag::ColorMap).map_err(&failed)?.unwrap_or_default();
        let [red, green, blue] = [0, 1, 2].map(|channel| channels.chunks(COLORS).nth(channel).unwrap_or_default());
        if channels.len() != 3 * COLORS {
            let found = format!("{} numbers", channels.len());
            return Err(invalid(&self.path, "ColorMap", found, format!("{} numbers, of 8-bit indices", 3 * COLORS)));
        }
        let directory = self.decoder.ifd_pointer().map_or(0, |pointer| pointer.0);
        let tag = Tag::PhotometricInterpretation.to_u16();
        let at = low_byte_of(self.decoder.inner(), directory, tag).map_err(io_error(&self.path))?;
        let at = at.ok_or_else(|| invalid(&self.path, "PhotometricInterpretation", "no short", "a short"))?;
        self.decoder.inner().replace(at, BLACK_IS_ZERO);
        self.decoder.seek_to_image(self.number as usize - 1).map_err(&failed)?;
        // The colours have 16 bits, but some programs write 8-bit numbers.
        let shift = if channels.iter().all(|&number| number < 256) { 0 } else { 8 };
        let colors = red.iter().zip(green).zip(blue);
        Ok(Some(colors.map(|((&r, &g), &b)| [r, g, b].map(|number| (number >> shift) as u8)).collect()))
    }

    /// Refuses chunks that claim more than is left of the file, or that promise more than they can hold.
    fn check_chunks(&mut self) -> Result<(), VolumeError> {
        let method = self.unsigned::<u16>(Tag::Compression)?.unwrap_or(UNCOMPRESSED);
        let expansion = if method == UNCOMPRESSED { 1 } else { MAX_EXPANSION };
        let claimed = self.counts.iter().fold(0_u64, |sum, &count| sum.saturating_add(count));
        let Some(unclaimed) = self.unclaimed.checked_sub(claimed) else {
            let allowed = format!("the {} bytes that are left of the file", self.unclaimed);
            return Err(invalid(&self.path, &self.name(), format!("{claimed} bytes of samples"), allowed));
        };
        self.unclaimed = unclaimed;
        for chunk in 0..self.counts.len() {
            let (width, height) = match self.decoder.get_chunk_type() {
                ChunkType::Strip => self.decoder.chunk_data_dimensions(chunk as u32),
                ChunkType::Tile => self.decoder.chunk_dimensions(),
            };
            let samples = if self.is_planar { 1 } else { self.page.samples };
            let bytes = Page { size: [width, height], samples, ..self.page }.stored_bytes();
            let (offset, count) = (self.offsets.get(chunk).copied().unwrap_or(u64::MAX), self.counts[chunk]);
            let mut holds = count.saturating_mul(expansion) >= bytes;
            if holds && method != UNCOMPRESSED && is_suspicious(count, bytes) {
                let file = &mut self.decoder.inner().file;
                let code = file.seek(SeekFrom::Start(offset)).map(|_| file.take(count));
                holds = code.and_then(|code| trial::holds(code, method, bytes)).map_err(io_error(&self.path))?;
            }
            if !holds {
                let (found, allowed) = (format!("{count} bytes for {bytes}"), "a strip or tile that holds its pixels");
                return Err(invalid(&self.path, &self.name(), found, allowed));
            }
        }
        Ok(())
    }

    fn is_compressed(&mut self) -> Result<bool, VolumeError> {
        Ok(self.unsigned::<u16>(Tag::Compression)?.is_some_and(|method| method != UNCOMPRESSED))
    }

    /// The position of the page's samples, if only samples follow it.
    pub(super) fn contiguous(&mut self) -> Result<u64, VolumeError> {
        let mut ends = self.offsets.iter().zip(&self.counts).map(|(offset, count)| offset.checked_add(*count));
        let follow = self.offsets.iter().skip(1).all(|&offset| ends.next() == Some(Some(offset)));
        let is_strips = self.decoder.get_chunk_type() == ChunkType::Strip;
        let is_whole = u64::from(self.page.bits) == 8 * self.page.kind.bytes();
        let is_one_piece = follow && is_strips && is_whole && !self.is_planar && !self.is_compressed()?;
        let first = self.offsets.first().filter(|_| is_one_piece);
        let allowed = "as many as the description says, or uncompressed samples in one piece";
        first.copied().ok_or_else(|| invalid(&self.path, "pages", "1", allowed))
    }

    /// The page's samples, in the machine's byte order.
    pub(super) fn bytes(&mut self) -> Result<Vec<u8>, VolumeError> {
        // The size was checked against the file, and zeroed memory is committed only when it is written.
        let mut bytes = vec![0; self.page.stored_bytes() as usize];
        if self.is_planar && self.decoder.get_chunk_type() == ChunkType::Tile {
            self.read_planes_of_tiles(&mut bytes)?;
        } else {
            let name = self.name();
            self.decoder.read_image_bytes(&mut bytes).map_err(failed(&self.path, &name))?;
        }
        if self.unsigned::<u16>(Tag::PhotometricInterpretation)? == Some(WHITE_IS_ZERO) {
            if matches!(self.page.kind, SampleType::F16 | SampleType::F32 | SampleType::F64) {
                let allowed = "BlackIsZero, for floats";
                return Err(invalid(&self.path, "PhotometricInterpretation", "WhiteIsZero", allowed));
            }
            // The decoder inverts pages where 0 is white.
            bytes.iter_mut().for_each(|byte| *byte = !*byte);
        }
        let bytes = self.page.unpacked(bytes);
        Ok(if self.is_planar { self.page.side_by_side(&bytes) } else { bytes })
    }

    /// Reads planes tile by tile. The decoder takes a tile at the bottom of any plane but the first for one without padding, and panics.
    fn read_planes_of_tiles(&mut self, bytes: &mut [u8]) -> Result<(), VolumeError> {
        let name = self.name();
        let failed = failed(&self.path, &name);
        let [width, height] = self.page.size;
        let sample = self.page.bits as usize / 8;
        let (tile_width, tile_height) = self.decoder.chunk_dimensions();
        let (across, down) = (width.div_ceil(tile_width), height.div_ceil(tile_height));
        let plane_bytes = width as usize * height as usize * sample;
        let mut tile = Vec::new();
        for (number, plane) in (0..).zip(bytes.chunks_mut(plane_bytes)) {
            for at in 0..across * down {
                let chunk = number * across * down + at;
                let (columns, rows) = self.decoder.chunk_data_dimensions(chunk);
                tile.resize(columns as usize * rows as usize * sample, 0);
                self.decoder.read_chunk_bytes(chunk, &mut tile).map_err(&failed)?;
                let (left, top) = (at % across * tile_width, at / across * tile_height);
                let of_row = columns as usize * sample;
                for (y, row) in (top..height).zip(tile.chunks(of_row)) {
                    let first = (y as usize * width as usize + left as usize) * sample;
                    plane[first..first + of_row].copy_from_slice(row);
                }
            }
        }
        Ok(())
    }
}

fn sample_type_of(sample_type: DecodingSampleType) -> SampleType {
    match sample_type {
        DecodingSampleType::U8 => SampleType::U8,
        DecodingSampleType::U16 => SampleType::U16,
        DecodingSampleType::U32 => SampleType::U32,
        DecodingSampleType::U64 => SampleType::U64,
        DecodingSampleType::I8 => SampleType::I8,
        DecodingSampleType::I16 => SampleType::I16,
        DecodingSampleType::I32 => SampleType::I32,
        DecodingSampleType::I64 => SampleType::I64,
        DecodingSampleType::F16 => SampleType::F16,
        DecodingSampleType::F32 => SampleType::F32,
        DecodingSampleType::F64 => SampleType::F64,
    }
}

/// Tells damage from errors of the operating system: the decoder reports damage as an I/O error without an OS error code.
fn failed(path: &Path, page: &str) -> impl Fn(TiffError) -> VolumeError {
    move |error| match error {
        TiffError::IoError(error) if error.raw_os_error().is_some() => io_error(path)(error),
        error => invalid(path, page, error, "grey or RGB pixels, as they are or by LZW, Deflate or PackBits"),
    }
}
