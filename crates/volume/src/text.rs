//! Numbers and vectors in headers, and text from files as errors show it.

use std::fmt::{self, Display, Formatter, Write};

use glam::DVec3;

/// The number of characters that a message shows of a text.
const MOST_SHOWN: usize = 1000;

/// Text of a file as messages show it: on one line, without characters that a terminal obeys or that reverse the text behind them, and cut after
/// 1000 characters.
pub fn plain(text: &str) -> Plain<'_> {
    Plain { text, has_lines: false, most: MOST_SHOWN }
}

/// As [`plain`], for texts of several lines, each of which is cut.
pub fn plain_lines(text: &str) -> Plain<'_> {
    Plain { text, has_lines: true, most: MOST_SHOWN }
}

/// As [`plain_lines`], for results, of which nothing is cut.
pub fn plain_whole(text: &str) -> Plain<'_> {
    Plain { text, has_lines: true, most: usize::MAX }
}

/// A text that is written with escapes.
#[derive(Clone, Copy, Debug)]
pub struct Plain<'a> {
    text: &'a str,
    has_lines: bool,
    most: usize,
}

impl Display for Plain<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let mut in_line = 0_usize;
        for character in self.text.chars() {
            if self.has_lines && character == '\n' {
                in_line = 0;
                f.write_char(character)?;
                continue;
            }
            in_line += 1;
            let is_format =
                matches!(character, '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
            if in_line > self.most {
                if in_line == self.most + 1 {
                    f.write_char('…')?;
                }
            } else if character.is_control() || is_format {
                Display::fmt(&character.escape_default(), f)?;
            } else {
                f.write_char(character)?;
            }
        }
        Ok(())
    }
}

/// Text from a file, shortened and on one line.
pub(super) fn shown(text: &str) -> String {
    let short: String = text.chars().take(60).collect();
    format!("{short:?}{}", if short.len() < text.len() { "…" } else { "" })
}

pub(super) fn lower(text: &str) -> String {
    text.to_ascii_lowercase()
}

pub(super) fn three<T>(items: impl Iterator<Item = Option<T>>) -> Option<[T; 3]> {
    items.collect::<Option<Vec<T>>>()?.try_into().ok()
}

/// A finite number.
pub(super) fn number(text: &str) -> Option<f64> {
    text.trim().parse().ok().filter(|number: &f64| number.is_finite())
}

/// A vector `(x,y,z)`, with or without spaces around the numbers.
pub(super) fn vector(text: &str) -> Option<DVec3> {
    let components = text.trim().strip_prefix('(')?.strip_suffix(')')?;
    three(components.split(',').map(number)).map(DVec3::from_array)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn terminals_obey_no_text_of_files() {
        assert_eq!(plain("a\u{1b}[2J\nb\u{9b}\u{202e}é").to_string(), "a\\u{1b}[2J\\nb\\u{9b}\\u{202e}é");
        assert_eq!(plain_lines("a\u{7}\nb\r").to_string(), "a\\u{7}\nb\\r");
        let long = "x".repeat(1 << 20);
        assert_eq!(plain(&long).to_string(), format!("{}…", &long[..1000]));
        assert_eq!(plain_lines(&format!("{long}\nb")).to_string(), format!("{}…\nb", &long[..1000]));
        assert_eq!(plain_whole(&long).to_string(), long);
    }
}
