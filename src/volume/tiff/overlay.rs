//! A file that reads as if one of its bytes were another.
//!
//! The decoder decodes no page that says its pixels are indices of a palette, though they are stored as grey ones are. So such a page
//! is read as one that says grey.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};

pub(super) struct Overlay {
    pub(super) file: BufReader<File>,
    /// Where the next byte to be read is.
    at: u64,
    /// Where the byte is, and what is read there.
    replaced: Option<(u64, u8)>,
}

impl Overlay {
    pub(super) fn new(file: BufReader<File>) -> Self {
        Self { file, at: 0, replaced: None }
    }

    /// Reads `byte` at this place from now on, and the file's own bytes anywhere else.
    pub(super) fn replace(&mut self, at: u64, byte: u8) {
        self.replaced = Some((at, byte));
    }
}

impl Read for Overlay {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = self.file.read(buffer)?;
        if let Some((at, byte)) = self.replaced
            && let Some(offset) = at.checked_sub(self.at)
            && offset < read as u64
        {
            buffer[offset as usize] = byte;
        }
        self.at += read as u64;
        Ok(read)
    }
}

impl Seek for Overlay {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.at = self.file.seek(to)?;
        Ok(self.at)
    }
}
