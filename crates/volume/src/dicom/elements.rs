//! Data elements: reads a file and keeps the few that are needed.
//!
//! Lengths are checked against the file before anything is kept, and other elements are skipped.

use std::path::Path;
use std::sync::Arc;

use super::super::VolumeError;
use super::super::access::Access;
use super::super::error::volume::invalid;
use super::super::head::is_bare_dicom;
use super::bytes::Bytes;
use super::dataset::{Dataset, Tag, name, shown_tag, tags};

const SEQUENCES: [Tag; 16] = [
    tags::SEGMENTS,
    tags::SEGMENT_IDENTIFICATION,
    tags::GRADIENTS,
    tags::ECHO,
    tags::DIFFUSION,
    tags::CARDIAC,
    tags::MR_FRAME_TYPE,
    tags::FRAME_CONTENT,
    tags::MODALITY_LUT,
    tags::DETECTORS,
    tags::PLANE_POSITION,
    tags::PLANE_ORIENTATION,
    tags::PIXEL_MEASURES,
    tags::PIXEL_TRANSFORMATION,
    tags::SHARED_GROUPS,
    tags::FRAME_GROUPS,
];
const PIXELS: [Tag; 3] = [tags::FLOAT_PIXEL_DATA, tags::DOUBLE_PIXEL_DATA, tags::PIXEL_DATA];

const ITEM: Tag = 0xfffe_e000;
const ITEM_END: Tag = 0xfffe_e00d;
const SEQUENCE_END: Tag = 0xfffe_e0dd;
/// The transfer syntax of files that are deflated after the meta information.
const DEFLATED: &str = "1.2.840.10008.1.2.1.99";

/// The length of a value that ends with a delimiter.
const UNDEFINED: u32 = u32::MAX;

/// The maximum depth of nested sequences; the standard's need five.
const MAX_DEPTH: u32 = 32;
/// The maximum number of items kept in all sequences: a few for every frame.
const MAX_ITEMS: u32 = 1 << 20;
/// The maximum size in bytes of a value that is kept: a table of 65536 numbers of 16 bits.
const MAX_VALUE: u32 = 1 << 17;

/// A file's elements, and the place of its pixels.
pub(super) struct Elements {
    pub(super) data: Dataset,
    pub(super) transfer_syntax: String,
    pub(super) big_endian: bool,
    pub(super) pixels: Option<(Tag, PixelData)>,
    /// The rest of the file. In a deflated file, which cannot seek back, these are the native pixels.
    pub(super) rest: Bytes,
}

/// The place of pixels in the file.
pub(super) enum PixelData {
    /// Uncompressed samples.
    Native {
        at: u64,
        bytes: u64,
        /// Whether they are written as 16-bit words.
        in_words: bool,
    },
    /// Compressed frames, each with its first byte and its length, without the table of offsets.
    Fragments(Vec<[u64; 2]>),
}

impl Elements {
    /// Reads the elements before the pixels; those after them are ignored.
    pub(super) fn read(path: &Path, access: &Access) -> Result<Self, VolumeError> {
        let (head, bytes) = Bytes::open(access.open(path)?)?;
        let mut parser = Parser {
            path: path.into(),
            bytes,
            begun: None,
            implicit: false,
            big_endian: false,
            items: 0,
            pixels: None,
        };
        let magic = head.get(128..132);
        if magic == Some(b"DICM") {
            parser.bytes.skip(132)?;
        } else if !is_bare_dicom(&head) {
            let magic = magic.map_or("the end of the file".to_owned(), |magic| format!("\"{}\"", magic.escape_ascii()));
            return Err(invalid(path, "magic", magic, "DICM after 128 bytes, or elements from the first byte on"));
        }
        let mut meta = parser.empty();
        while !parser.bytes.is_at_end()? {
            let tag = parser.bytes.take::<4>()?;
            parser.begun = Some(tag);
            // The meta information is little-endian, whichever order the rest has.
            if tag[..2] != [2, 0] {
                break;
            }
            let header = parser.header()?;
            parser.value(&header, u64::MAX, &mut meta)?;
        }
        let transfer_syntax = match meta.text(tags::TRANSFER_SYNTAX) {
            Some(syntax) => syntax,
            // Without these elements the file has the default encoding, or explicit types if its elements show them.
            None if head.starts_with(&[8, 0]) => {
                let is_explicit = head.get(4..6).is_some_and(|kind| kind.iter().all(u8::is_ascii_uppercase));
                if is_explicit { "1.2.840.10008.1.2.1" } else { "1.2.840.10008.1.2" }.to_owned()
            }
            None => return Err(meta.missing(tags::TRANSFER_SYNTAX, "how the file is encoded")),
        };
        (parser.implicit, parser.big_endian) = match transfer_syntax.as_str() {
            "1.2.840.10008.1.2" => (true, false),
            "1.2.840.10008.1.2.2" => (false, true),
            _ => (false, false),
        };
        if transfer_syntax == DEFLATED {
            let begun = parser.begun.take();
            parser.bytes = parser.bytes.inflated(begun.as_ref().map_or(&[], |begun| begun))?;
        }
        let mut data = parser.elements(u64::MAX, 0)?;
        data.values.extend(meta.values);
        let Parser { big_endian, pixels, bytes, .. } = parser;
        Ok(Self { data, transfer_syntax, big_endian, pixels, rest: bytes })
    }
}

struct Parser {
    path: Arc<Path>,
    /// The bytes after `begun`.
    bytes: Bytes,
    /// The tag of the next element, if it was already read.
    begun: Option<[u8; 4]>,
    implicit: bool,
    big_endian: bool,
    /// The number of items kept so far.
    items: u32,
    pixels: Option<(Tag, PixelData)>,
}

/// An element's tag, type and length.
struct Header {
    tag: Tag,
    is_sequence: bool,
    /// Whether its value may be a sequence whose elements have no explicit types.
    is_unknown: bool,
    /// Whether its value, if its length is undefined, consists of fragments, not of items with elements.
    has_fragments: bool,
    in_words: bool,
    length: u32,
}

impl Parser {
    fn empty(&self) -> Dataset {
        Dataset::new(self.path.clone(), self.big_endian)
    }

    fn u16(&mut self) -> Result<u16, VolumeError> {
        let bytes = self.bytes.take()?;
        Ok(if self.big_endian { u16::from_be_bytes(bytes) } else { u16::from_le_bytes(bytes) })
    }

    fn u32(&mut self) -> Result<u32, VolumeError> {
        let bytes = self.bytes.take()?;
        Ok(if self.big_endian { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) })
    }

    fn header(&mut self) -> Result<Header, VolumeError> {
        let [a, b, c, d] = self.begun.take().map_or_else(|| self.bytes.take(), Ok)?;
        let tag = if self.big_endian { [a, b, c, d] } else { [b, a, d, c] };
        let tag = Tag::from_be_bytes(tag);
        let has_fragments = PIXELS.contains(&tag);
        let mut header =
            Header { tag, is_sequence: false, is_unknown: false, has_fragments, in_words: false, length: 0 };
        if self.implicit || matches!(tag, ITEM | ITEM_END | SEQUENCE_END) {
            header.is_sequence = SEQUENCES.contains(&tag);
            header.in_words = true;
            header.length = self.u32()?;
            return Ok(header);
        }
        let kind = self.bytes.take::<2>()?;
        if !kind.iter().all(u8::is_ascii_uppercase) {
            let found = format!("the type \"{}\"", kind.escape_ascii());
            return Err(invalid(&self.path, &shown_tag(tag), found, "a type of two letters"));
        }
        header.is_sequence = kind == *b"SQ";
        header.is_unknown = kind == *b"UN";
        header.in_words = kind == *b"OW";
        header.has_fragments |= kind[0] == b'O';
        let is_long = [b"OB", b"OD", b"OF", b"OL", b"OV", b"OW", b"SQ", b"SV", b"UC", b"UN", b"UR", b"UT", b"UV"];
        header.length = if is_long.contains(&&kind) {
            self.bytes.take::<2>()?;
            self.u32()?
        } else {
            self.u16()?.into()
        };
        Ok(header)
    }

    /// Elements up to a place in the file, or to the end of an item.
    fn elements(&mut self, end: u64, depth: u32) -> Result<Dataset, VolumeError> {
        let mut data = self.empty();
        if depth > MAX_DEPTH {
            return Err(invalid(
                &self.path,
                "elements",
                "sequences nested deeper",
                format!("at most {MAX_DEPTH} levels"),
            ));
        }
        while self.begun.is_some() || self.bytes.at() < end && !self.bytes.is_at_end()? {
            let header = self.header()?;
            if header.tag == ITEM_END && depth > 0 {
                break;
            }
            if depth == 0 && PIXELS.contains(&header.tag) {
                self.pixels = Some((header.tag, self.pixels(&header)?));
                break;
            }
            if header.length == UNDEFINED && header.has_fragments {
                // They are the pixels of an icon, say, or of a private element.
                self.pixels(&header)?;
            } else if header.length == UNDEFINED || header.is_sequence {
                self.sequence(&header, end, depth, &mut data)?;
            } else {
                self.value(&header, end, &mut data)?;
            }
        }
        Ok(data)
    }

    /// Reads a value, or skips it.
    fn value(&mut self, header: &Header, end: u64, data: &mut Dataset) -> Result<(), VolumeError> {
        let &Header { tag, length, .. } = header;
        self.check_length(header, end)?;
        if name(tag).is_none() || length > MAX_VALUE {
            return self.bytes.skip(length.into());
        }
        let mut value = vec![0; length as usize];
        self.bytes.read(&mut value)?;
        data.values.insert(tag, value);
        Ok(())
    }

    fn check_length(&self, header: &Header, end: u64) -> Result<(), VolumeError> {
        let left = end.saturating_sub(self.bytes.at()).min(self.bytes.at_most());
        if u64::from(header.length) <= left {
            return Ok(());
        }
        let found = format!("{} bytes", header.length);
        Err(invalid(&self.path, &shown_tag(header.tag), found, format!("at most the {left} that are left")))
    }

    /// Reads the items of a sequence, or only finds their end if they are not needed.
    fn sequence(&mut self, header: &Header, end: u64, depth: u32, data: &mut Dataset) -> Result<(), VolumeError> {
        let &Header { tag, length, .. } = header;
        let is_kept = SEQUENCES.contains(&tag);
        let end = if length == UNDEFINED {
            end
        } else {
            self.check_length(header, end)?;
            if !is_kept {
                return self.bytes.skip(length.into());
            }
            self.bytes.at() + u64::from(length)
        };
        // A sequence of unknown type is encoded with implicit types.
        let implicit = self.implicit;
        self.implicit |= header.is_unknown;
        let mut items = Vec::new();
        while self.bytes.at() < end {
            let item = self.header()?;
            match item.tag {
                SEQUENCE_END => break,
                ITEM => {}
                other => return Err(invalid(&self.path, &shown_tag(tag), shown_tag(other), "items")),
            }
            let item_end = if item.length == UNDEFINED {
                end
            } else {
                self.check_length(&item, end)?;
                self.bytes.at() + u64::from(item.length)
            };
            let item = self.elements(item_end, depth + 1)?;
            if is_kept {
                self.items += 1;
                if self.items > MAX_ITEMS {
                    let allowed = format!("at most {MAX_ITEMS} items");
                    return Err(invalid(&self.path, &shown_tag(tag), "more", allowed));
                }
                items.push(item);
            }
        }
        self.implicit = implicit;
        if is_kept {
            data.items.insert(tag, items);
        }
        Ok(())
    }

    fn pixels(&mut self, header: &Header) -> Result<PixelData, VolumeError> {
        if header.length != UNDEFINED {
            self.check_length(header, u64::MAX)?;
            let (at, bytes) = (self.bytes.at(), header.length.into());
            return Ok(PixelData::Native { at, bytes, in_words: header.in_words });
        }
        let mut fragments = Vec::new();
        loop {
            let item = self.header()?;
            match item.tag {
                SEQUENCE_END => break,
                ITEM => {}
                other => return Err(invalid(&self.path, &shown_tag(header.tag), shown_tag(other), "fragments")),
            }
            self.check_length(&item, u64::MAX)?;
            fragments.push([self.bytes.at(), item.length.into()]);
            self.bytes.skip(item.length.into())?;
        }
        // The first fragment is the table of offsets.
        fragments.drain(..fragments.len().min(1));
        Ok(PixelData::Fragments(fragments))
    }
}
