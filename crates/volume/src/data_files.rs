//! Data files that a header names: one, a list, or a numbered pattern.

use std::path::{Path, PathBuf};

use glam::UVec3;

use super::VolumeError;
use super::access::Access;
use super::error::volume::invalid;
use super::samples::Samples;
use super::source::Source;
use super::voxels::Voxels;

/// The maximum width of a number in a file's name.
const MAX_WIDTH: usize = 20;

/// The data files, in the order of their samples.
pub(super) struct DataFiles {
    /// The folder that their names are relative to.
    folder: PathBuf,
    names: Names,
    /// The number of axes that one file covers completely: 1 for rows, 2 for slices, 3 for slabs of one or more slices.
    axes: usize,
}

enum Names {
    Listed(Vec<String>),
    Numbered { pattern: Pattern, min: i64, step: i64, count: u64 },
}

impl DataFiles {
    /// One file with all samples of the header at `header`.
    pub(super) fn one(header: &Path, name: &str) -> Self {
        Self::listed(header, vec![name.to_owned()], 3)
    }

    pub(super) fn listed(header: &Path, names: Vec<String>, axes: usize) -> Self {
        Self { folder: header.parent().unwrap_or(Path::new("")).to_owned(), names: Names::Listed(names), axes }
    }

    /// A pattern, the first and last number and the step between numbers, as text; `None` if these do not parse.
    pub(super) fn numbered(header: &Path, [pattern, min, max, step]: [&str; 4], axes: usize) -> Option<Self> {
        let [min, max, step] = [min, max, step].map(|number| number.parse::<i64>().ok());
        let (min, max, step) = (min?, max?, step?);
        let steps = (i128::from(max) - i128::from(min)).checked_div(step.into()).filter(|&steps| steps >= 0)?;
        let count = u64::try_from(steps + 1).ok()?;
        let names = Names::Numbered { pattern: Pattern::parse(pattern)?, min, step, count };
        Some(Self { names, ..Self::listed(header, Vec::new(), axes) })
    }

    /// The number of files.
    pub(super) fn count(&self) -> u64 {
        match &self.names {
            Names::Listed(names) => names.len() as u64,
            &Names::Numbered { count, .. } => count,
        }
    }

    /// The samples of all files, each read by `read`. `field` is the header's field that names the files.
    pub(super) fn read(
        &self,
        header: &Path,
        field: &str,
        samples: &Samples,
        access: &Access,
        read: impl Fn(Source, &Samples) -> Result<Voxels, VolumeError>,
    ) -> Result<Voxels, VolumeError> {
        let count = self.count();
        let part = self
            .part(samples.dims, count)
            .map_err(|allowed| invalid(header, field, format!("{count} files"), allowed))?;
        let part = Samples { dims: part, ..*samples };
        let mut values = access.wanted().none();
        for at in 0..count {
            let name = match &self.names {
                Names::Listed(names) => names[at as usize].clone(),
                // The number lies between the first and the last one, which have 64 bits.
                Names::Numbered { pattern, min, step, .. } => {
                    pattern.name(min.wrapping_add(step.wrapping_mul(at as i64)))
                }
            };
            let of_file = read(access.open(&self.folder.join(name))?, &part)?;
            if count == 1 {
                return Ok(of_file);
            }
            values.append_from(&of_file, 0..of_file.count()).map_err(samples.too_many(header))?;
        }
        values.shrink_to_fit();
        Ok(values)
    }

    /// The dimensions of the part of a volume in each of `count` files.
    ///
    /// # Errors
    /// The numbers of files that are allowed.
    fn part(&self, dims: UVec3, count: u64) -> Result<UVec3, String> {
        let UVec3 { x, y, z } = dims;
        let (part, expected) = match self.axes {
            1 => (UVec3::new(x, 1, 1), u64::from(y) * u64::from(z)),
            2 => (UVec3::new(x, y, 1), u64::from(z)),
            _ if count > 0 && u64::from(z).is_multiple_of(count) => {
                return Ok(UVec3::new(x, y, (u64::from(z) / count) as u32));
            }
            _ => return Err(format!("as many as share {z} slices evenly")),
        };
        if count == expected {
            Ok(part)
        } else {
            Err(format!("{expected}, one for each {}", ["row", "slice"][self.axes - 1]))
        }
    }
}

/// A name with one number in it, as C's `printf` formats it: `slice%03d.raw`.
struct Pattern {
    before: String,
    after: String,
    width: usize,
    has_zeros: bool,
}

impl Pattern {
    fn parse(text: &str) -> Option<Self> {
        // `%%` gets a placeholder of its own.
        let text = text.replace("%%", "\0");
        let (before, number) = text.split_once('%')?;
        let end = number.find(|character: char| !character.is_ascii_digit())?;
        let (digits, after) = number.split_at(end);
        let after = after.strip_prefix(['d', 'i', 'u']).filter(|after| !after.contains('%'))?;
        let width = if digits.is_empty() { 0 } else { digits.parse().ok()? };
        let [before, after] = [before, after].map(|part| part.replace('\0', "%"));
        (width <= MAX_WIDTH).then(|| Self { before, after, width, has_zeros: digits.starts_with('0') })
    }

    fn name(&self, number: i64) -> String {
        let Self { before, after, width, has_zeros } = self;
        if *has_zeros { format!("{before}{number:0width$}{after}") } else { format!("{before}{number:width$}{after}") }
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;

    #[test]
    fn patterns_are_those_of_printf() {
        let name = |pattern: &str, number| Pattern::parse(pattern).map(|pattern| pattern.name(number));
        assert_eq!(name("a%d.raw", 7).unwrap(), "a7.raw");
        assert_eq!(name("a%03d.raw", 7).unwrap(), "a007.raw");
        assert_eq!(name("a%3i", -7).unwrap(), "a -7");
        assert_eq!(name("%03u%%b", -7).unwrap(), "-07%b");
        for none in ["a", "%", "%s", "%d%d", "%999d", "%-3d", "%ld", "%.2d"] {
            assert_eq!(name(none, 7), None, "{none}");
        }
    }

    #[test]
    fn numbers_run_from_the_first_to_the_last() {
        let count = |min: &str, max: &str, step: &str| {
            DataFiles::numbered(Path::new("a"), ["%d", min, max, step], 2).map(|files| match files.names {
                Names::Numbered { count, .. } => count,
                Names::Listed(_) => 0,
            })
        };
        assert_eq!(count("1", "20", "1"), Some(20));
        assert_eq!(count("1", "20", "3"), Some(7));
        assert_eq!(count("20", "1", "-1"), Some(20));
        assert_eq!(count("5", "5", "1"), Some(1));
        assert_eq!(count("-9223372036854775808", "9223372036854775807", "1"), None);
        for (min, max, step) in [("1", "20", "0"), ("20", "10", "1"), ("1", "20", "-1"), ("1", "x", "1")] {
            assert_eq!(count(min, max, step), None, "{min} {max} {step}");
        }
    }
}
