//! Numbers and vectors in headers, and text from files as errors show it.

use std::borrow::Cow;
use std::fmt::{self, Display, Formatter, Write};

use glam::DVec3;

/// The number of characters that a message shows of a line, and that of its lines.
const MOST_SHOWN: usize = 1000;
const MOST_LINES: usize = 100;

/// Text of a file as messages show it: on one line, without characters that a terminal obeys or that reverse the text behind them, cut after
/// 1000 characters, and without the passwords of addresses.
pub fn plain(text: &str) -> Plain<'_> {
    Plain { text, has_lines: false, most: MOST_SHOWN }
}

/// As [`plain`], for texts of up to 100 lines, each of which is cut.
pub fn plain_lines(text: &str) -> Plain<'_> {
    Plain { text, has_lines: true, most: MOST_SHOWN }
}

/// As [`plain_lines`], for results, of which nothing is cut.
pub fn plain_whole(text: &str) -> Plain<'_> {
    Plain { text, has_lines: true, most: usize::MAX }
}

/// A text with three dots in place of the names and passwords of the addresses in it (`https://name:password@server/`).
pub(super) fn without_passwords(text: &str) -> Cow<'_, str> {
    let mut shown = Cow::Borrowed("");
    let mut rest = text;
    while let Some(at) = rest.find("://") {
        let (scheme, place) = rest.split_at(at + 3);
        // The part with a password ends before the path, a query, or what is around the address.
        let end = place.find(|c: char| "/?#\"'<>\\".contains(c) || c.is_whitespace()).unwrap_or(place.len());
        shown += scheme;
        rest = match place[..end].rfind('@') {
            Some(at) => {
                shown += "…";
                &place[at..]
            }
            None => place,
        };
    }
    if rest.len() == text.len() {
        return Cow::Borrowed(text);
    }
    shown + rest
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
        let (mut in_line, mut lines) = (0_usize, 0_usize);
        for character in without_passwords(self.text).chars() {
            if self.has_lines && character == '\n' {
                (in_line, lines) = (0, lines + 1);
                if self.most == MOST_SHOWN && lines == MOST_LINES {
                    return f.write_str("\n…");
                }
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
        let lines = "a\n".repeat(1 << 20);
        assert_eq!(plain_lines(&lines).to_string(), format!("{}…", &lines[..200]));
        assert_eq!(plain_whole(&lines).to_string(), lines);
    }

    #[test]
    fn passwords_are_hidden() {
        let hidden = |text: &str| without_passwords(text).into_owned();
        assert_eq!(hidden("https://me:secret@a.b/c@d"), "https://…@a.b/c@d");
        assert_eq!(hidden("at http://me:se@cret@a:80, HTTPS://x@y?z@w"), "at http://…@a:80, HTTPS://…@y?z@w");
        for text in ["", "a@b", "https://a.b/c@d", "a://", "http://a http://b \"http://c\" me@d"] {
            assert_eq!(hidden(text), text);
        }
        for shown in [plain, plain_lines, plain_whole] {
            assert_eq!(shown("http://me:secret@a").to_string(), "http://…@a");
        }
    }
}
