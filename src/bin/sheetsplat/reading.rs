//! Limits on reading: which files may be opened, and how much memory may be used.

use std::path::PathBuf;

use sheetsplat::volume::ReadOptions;

#[derive(clap::Args)]
pub(crate) struct Reading {
    /// Read no file outside this folder once links are followed: neither the input nor the files it names.
    #[arg(long, value_name = "DIR")]
    confine: Option<PathBuf>,
    /// Maximum memory for the volume and its labels, or for each image, such as 2GiB. The default is three quarters of what the
    /// machine has or the process's control group may use.
    #[arg(long, value_name = "SIZE", value_parser = parse_size)]
    memory: Option<u64>,
}

impl Reading {
    pub(crate) fn options(&self) -> ReadOptions {
        let mut options = ReadOptions::default();
        (options.confine, options.memory) = (self.confine.clone(), self.memory);
        options
    }
}

const UNITS: [(&str, u64); 9] = [
    ("KiB", 1 << 10),
    ("MiB", 1 << 20),
    ("GiB", 1 << 30),
    ("TiB", 1 << 40),
    ("kB", 1_000),
    ("MB", 1_000_000),
    ("GB", 1_000_000_000),
    ("TB", 1_000_000_000_000),
    ("B", 1),
];

/// Parses a size with its unit; bytes without one.
fn parse_size(text: &str) -> Result<u64, String> {
    let unit = UNITS.into_iter().find(|(name, _)| text.to_ascii_lowercase().ends_with(&name.to_ascii_lowercase()));
    let (name, bytes) = unit.unwrap_or(("", 1));
    let number = text[..text.len() - name.len()].trim().parse::<f64>().ok();
    let size = number.map(|number| number * bytes as f64).filter(|size| (1.0..=u64::MAX as f64).contains(size));
    size.map(|size| size as u64).ok_or_else(|| {
        let units = UNITS.map(|(name, _)| name).join(", ");
        format!("allowed: a number of bytes, at least 1, or a number and one of {units}, such as 2GiB")
    })
}

#[cfg(test)]
mod tests {
    use super::parse_size;

    #[test]
    fn sizes_have_units() {
        for (text, bytes) in [
            ("1", 1),
            ("4096", 4096),
            ("2GiB", 2 << 30),
            ("1.5 MiB", 3 << 19),
            ("3kb", 3000),
            ("7B", 7),
            ("1TB", 1_000_000_000_000),
        ] {
            assert_eq!(parse_size(text), Ok(bytes), "{text}");
        }
        for text in ["", "0", "-1", "GiB", "1XB", "0.5", "nan", "inf", "1e30", "2é", "é"] {
            assert!(parse_size(text).is_err(), "{text}");
        }
    }
}
