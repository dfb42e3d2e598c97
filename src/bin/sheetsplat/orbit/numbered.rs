//! Names of numbered images.

use std::path::{Path, PathBuf};

/// A file name with a placeholder for the frame's number: `%d`, `%04d` or `####`.
#[derive(Debug, PartialEq)]
pub(super) struct Pattern {
    folder: PathBuf,
    before: String,
    /// The minimum number of digits.
    digits: usize,
    after: String,
}

impl Pattern {
    /// Parses a file name; `None` if it has no placeholder, or more than one.
    pub(super) fn parse(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_str()?;
        let start = name.find(['%', '#'])?;
        let (before, rest) = name.split_at(start);
        let (digits, after) = match rest.strip_prefix('%') {
            Some(rest) => {
                let (width, after) = rest.split_once('d')?;
                let digits = if width.is_empty() { 1 } else { width.strip_prefix('0')?.parse().ok()? };
                (digits, after)
            }
            None => {
                let after = rest.trim_start_matches('#');
                (rest.len() - after.len(), after)
            }
        };
        // A frame number has up to ten digits; a much larger width is a mistake.
        if after.contains(['%', '#']) || !(1..=20).contains(&digits) {
            return None;
        }
        Some(Self { folder: path.with_file_name(""), before: before.to_owned(), digits, after: after.to_owned() })
    }

    /// The name of the list of all frames that were made.
    pub(super) fn list(&self) -> PathBuf {
        let Self { folder, before, after, .. } = self;
        folder.join(format!("{before}#{after}.made"))
    }

    /// The file name of a frame.
    pub(super) fn path(&self, frame: u32) -> PathBuf {
        let Self { folder, before, after, .. } = self;
        let digits = self.digits;
        folder.join(format!("{before}{frame:0digits$}{after}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn name(pattern: &str, frame: u32) -> Option<String> {
        Pattern::parse(pattern.as_ref()).map(|pattern| pattern.path(frame).display().to_string())
    }

    #[test]
    fn percent_and_hashes_are_a_number() {
        assert_eq!(name("frame-%04d.png", 7).as_deref(), Some("frame-0007.png"));
        assert_eq!(name("frame-%04d.png", 123_456).as_deref(), Some("frame-123456.png"));
        assert_eq!(name("frame-%d.png", 7).as_deref(), Some("frame-7.png"));
        assert_eq!(name("###.exr", 7).as_deref(), Some("007.exr"));
        assert_eq!(name("a #1/b.#.npy", 12).as_deref(), Some("a #1/b.12.npy"));
    }

    #[test]
    fn anything_else_is_no_pattern() {
        for pattern in ["a.png", "#/a.png", "%4d.png", "%s.png", "%0d.png", "%099d.png", "#-#.png", "%d#.png", "", "/"]
        {
            assert_eq!(name(pattern, 1), None, "{pattern}");
        }
    }
}
