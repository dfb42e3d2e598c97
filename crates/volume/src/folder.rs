//! Folders of slices.

use std::fs;
use std::path::{Path, PathBuf};

use super::VolumeError;
use super::access::Access;
use super::error::volume::io_error;

/// The files in a folder, without those of its subfolders, in natural order.
pub(super) fn files(folder: &Path, access: &Access) -> Result<Vec<PathBuf>, VolumeError> {
    if let Some(given) = access.given() {
        let mut files: Vec<PathBuf> = given.in_folder(folder).cloned().collect();
        sort(&mut files);
        return Ok(files);
    }
    let mut files = Vec::new();
    for entry in fs::read_dir(access.resolve(folder)?).map_err(io_error(folder))? {
        let path = folder.join(entry.map_err(io_error(folder))?.file_name());
        if fs::metadata(&path).is_ok_and(|metadata| metadata.is_file()) {
            files.push(path);
        }
    }
    sort(&mut files);
    Ok(files)
}

/// Sorts files of one folder in natural order.
fn sort(files: &mut [PathBuf]) {
    files.sort_by_cached_key(|path| natural(&path.file_name().unwrap_or_default().to_string_lossy()));
}

/// A part of a name.
#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Part {
    /// The number of its digits without leading zeros, so that numbers of any size compare, and the digits.
    Number(usize, String),
    Text(String),
}

/// A name in parts that sort in natural order: 2 before 10. The last part is the name itself, which decides between `01` and `1`.
pub(super) fn natural(name: &str) -> Vec<Part> {
    let mut parts = Vec::new();
    let mut rest = name;
    while let Some(first) = rest.chars().next() {
        let is_digit = |character: char| character.is_ascii_digit();
        let end = rest.find(|character| is_digit(character) != is_digit(first)).unwrap_or(rest.len());
        let (part, after) = rest.split_at(end);
        let digits = part.trim_start_matches('0');
        parts.push(match is_digit(first) {
            true => Part::Number(digits.len(), digits.to_owned()),
            false => Part::Text(part.to_owned()),
        });
        rest = after;
    }
    parts.push(Part::Text(name.to_owned()));
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_sort_as_numbers() {
        let sorted = ["a2b10.tif", "a10b1.tif", "a010b2.tif", "a99999999999999999999.tif", "b1.tif", "b.tif"];
        let mut names = sorted;
        names.reverse();
        names.sort_by_cached_key(|name| natural(name));
        assert_eq!(names, sorted);
    }
}
