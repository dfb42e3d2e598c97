//! A view of a file with one byte replaced.
//!
//! The decoder refuses pages whose pixels are indices of a palette, though they are stored like grey ones. Such a page is read with its
//! header changed to say grey.

use std::io::{self, BufReader, Read, Seek, SeekFrom};

use super::super::file::File;

pub(super) struct Overlay {
    pub(super) file: BufReader<File>,
    /// The position of the next byte.
    at: u64,
    /// The position of the replaced byte, and its replacement.
    replaced: Option<(u64, u8)>,
}

impl Overlay {
    pub(super) fn new(file: BufReader<File>) -> Self {
        Self { file, at: 0, replaced: None }
    }

    /// Replaces the byte at this position from now on.
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
