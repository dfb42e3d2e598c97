//! How much memory is available, and sizes as text.

use sysinfo::System;

/// Units of sizes, in bytes.
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

/// Parses a size with its unit; bytes without one. The error tells what is allowed.
pub(super) fn parse_size(text: &str) -> Result<u64, String> {
    let unit = UNITS.into_iter().find(|(name, _)| text.to_ascii_lowercase().ends_with(&name.to_ascii_lowercase()));
    let (name, bytes) = unit.unwrap_or(("", 1));
    let number = text[..text.len() - name.len()].trim().parse::<f64>().ok();
    let size = number.map(|number| number * bytes as f64).filter(|size| (1.0..=u64::MAX as f64).contains(size));
    size.map(|size| size as u64).ok_or_else(|| {
        let units = UNITS.map(|(name, _)| name).join(", ");
        format!("allowed: a number of bytes, at least 1, or a number and one of {units}, such as 2GiB")
    })
}

/// Three quarters of the machine's memory, of what the process's control group may use, or of all addresses, whichever is least. In a browser only the
/// last is known.
pub(super) fn default_limit() -> u64 {
    let mut system = System::new();
    system.refresh_memory();
    let machine = Some(system.total_memory()).filter(|&bytes| bytes > 0);
    let group = machine.and_then(|_| system.cgroup_limits()).map(|limits| limits.total_memory);
    machine.into_iter().chain(group).fold(usize::MAX as u64, u64::min) / 4 * 3
}

#[cfg(test)]
mod tests {
    use super::*;

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

    #[test]
    fn the_default_is_less_than_the_machine_has() {
        let mut system = System::new();
        system.refresh_memory();
        assert!((1..=system.total_memory() / 4 * 3).contains(&default_limit()));
    }
}
