//! Numbers in text.

use std::io::{self, BufRead, Read};

use super::sample_type::SampleType;

/// The maximum number of bytes in a number.
const MAX_TOKEN: usize = 64;

/// The character that ends a text of numbers; the end of the file ends it too.
#[derive(Clone, Copy, Debug)]
pub(super) enum TextEnd {
    /// Only the end of the file.
    File,
    /// An XML tag.
    #[cfg(feature = "vtk")]
    Tag,
    /// One of these words, which begin the next section.
    #[cfg(feature = "vtk")]
    Words(&'static [&'static str]),
}

/// Numbers in a text, read as the bytes of samples in the machine's byte order.
pub(super) struct Numbers<R> {
    reader: R,
    kind: SampleType,
    end: TextEnd,
    token: Vec<u8>,
    samples: Vec<u8>,
    /// The number of bytes of `samples` that are consumed.
    read: usize,
    has_ended: bool,
}

impl<R: BufRead> Numbers<R> {
    pub(super) fn new(reader: R, kind: SampleType, end: TextEnd) -> Self {
        Self { reader, kind, end, token: Vec::new(), samples: Vec::new(), read: 0, has_ended: false }
    }

    /// Converts the reader's buffer into samples, except a number at its end, which may continue.
    fn fill(&mut self) -> io::Result<()> {
        self.samples.clear();
        self.read = 0;
        let buffer = self.reader.fill_buf()?;
        if buffer.is_empty() {
            self.has_ended = true;
            if !self.token.is_empty() {
                // The last number may have been cut off.
                return Err(io::Error::other("the end of the file after a digit, not after a line"));
            }
            return Ok(());
        }
        let length = buffer.len();
        // The buffer is copied, so that tokens can be finished in between.
        let buffer = buffer.to_vec();
        for &byte in &buffer {
            match byte {
                #[cfg(feature = "vtk")]
                b'<' if matches!(self.end, TextEnd::Tag) => self.has_ended = true,
                byte if !byte.is_ascii_whitespace() => {
                    self.token.push(byte);
                    if self.token.len() > MAX_TOKEN {
                        return Err(self.no_number());
                    }
                    continue;
                }
                _ => {}
            }
            self.finish_token()?;
            if self.has_ended {
                break;
            }
        }
        self.reader.consume(length);
        Ok(())
    }

    fn finish_token(&mut self) -> io::Result<()> {
        if self.token.is_empty() {
            return Ok(());
        }
        let text = str::from_utf8(&self.token).unwrap_or_default();
        if self.kind.parse(text, &mut self.samples).is_none() {
            match self.end {
                #[cfg(feature = "vtk")]
                TextEnd::Words(words) if words.contains(&text) => self.has_ended = true,
                _ => return Err(self.no_number()),
            }
        }
        self.token.clear();
        Ok(())
    }

    fn no_number(&self) -> io::Error {
        io::Error::other(format!("\"{}\", no number of type {}", self.token.escape_ascii(), self.kind))
    }
}

impl<R: BufRead> Read for Numbers<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while self.read == self.samples.len() && !self.has_ended {
            self.fill()?;
        }
        let read = (&self.samples[self.read..]).read(buffer)?;
        self.read += read;
        Ok(read)
    }
}

#[cfg(all(test, feature = "vtk"))]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use std::io::BufReader;

    use super::*;

    fn bytes(text: &str, kind: SampleType) -> io::Result<Vec<u8>> {
        let end = if text.contains('<') { TextEnd::Tag } else { TextEnd::Words(&["METADATA"]) };
        let mut bytes = Vec::new();
        // A buffer that ends in the middle of numbers.
        let text = format!("{text}\n");
        let mut numbers = Numbers::new(BufReader::with_capacity(3, text.as_bytes()), kind, end);
        numbers.read_to_end(&mut bytes)?;
        Ok(bytes)
    }

    #[test]
    fn numbers_end_where_the_text_does() {
        for text in ["1 -2\n300", " 1\t-2 300 ", "1 -2 300</DataArray>4", "1 -2 300\nMETADATA\n4"] {
            let expected: Vec<u8> = [1_i16, -2, 300].iter().flat_map(|number| number.to_ne_bytes()).collect();
            assert_eq!(bytes(text, SampleType::I16).unwrap(), expected, "{text}");
        }
        assert_eq!(bytes("1.5e2 nan", SampleType::F32).unwrap()[..4], 150.0_f32.to_ne_bytes());
        assert_eq!(bytes("18446744073709551615", SampleType::U64).unwrap(), u64::MAX.to_ne_bytes());
    }

    #[test]
    fn a_number_that_may_go_on_is_none() {
        let message =
            Numbers::new("1 23".as_bytes(), SampleType::U8, TextEnd::File).read_to_end(&mut Vec::new()).unwrap_err();
        assert!(message.to_string().contains("the end of the file after a digit"), "{message}");
    }

    #[test]
    fn what_is_no_number_is_told() {
        for text in ["1 300", "1 x", "1 1.5", "1 -1", &"1".repeat(1000), "1 é"] {
            let message = bytes(text, SampleType::U8).unwrap_err().to_string();
            assert!(message.contains("no number of type uint8"), "{text}: {message}");
        }
    }
}
