//! How much memory is available, and sizes as text.

use std::fs;
use std::path::Path;

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

/// Three quarters of the machine's memory, of what the process's control groups may use, or of all addresses, whichever is least. In a browser only the
/// last is known.
pub(super) fn default_limit() -> u64 {
    let mut system = System::new();
    system.refresh_memory();
    let machine = Some(system.total_memory()).filter(|&bytes| bytes > 0);
    let groups = fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
    let group = group_limit(&groups, Path::new("/sys/fs/cgroup"));
    machine.into_iter().chain(group).fold(usize::MAX as u64, u64::min) / 4 * 3
}

/// The smallest limit of some control groups and their ancestors. `groups` is the text of Linux's `/proc/self/cgroup`, lines of
/// `ID:CONTROLLERS:PATH`; `root` is where groups are mounted.
fn group_limit(groups: &str, root: &Path) -> Option<u64> {
    let limits = groups.lines().filter_map(|line| {
        let mut parts = line.splitn(3, ':').skip(1);
        let (controllers, group) = (parts.next()?, parts.next()?);
        let (folder, file) = match controllers {
            // Version 2 has a single tree of groups.
            "" => (root.to_owned(), "memory.max"),
            _ if controllers.split(',').any(|name| name == "memory") => (root.join("memory"), "memory.limit_in_bytes"),
            _ => return None,
        };
        // Within a container the path may be the one outside it, so groups may be missing.
        let groups = Path::new(group.trim_start_matches('/')).ancestors();
        let limit = |group: &Path| fs::read_to_string(folder.join(group).join(file)).ok()?.trim().parse::<u64>().ok();
        groups.filter_map(limit).min()
    });
    limits.min()
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
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
    fn limits_of_control_groups() {
        let root = tempfile::tempdir().unwrap();
        let write = |file: &str, text: &str| {
            let path = root.path().join(file);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        };
        let limit = |groups: &str| group_limit(groups, root.path());
        assert_eq!(limit("0::/a/b\n"), None);
        write("a/b/memory.max", "max\n");
        assert_eq!(limit("0::/a/b\n"), None);
        write("a/memory.max", "4096\n");
        assert_eq!(limit("0::/a/b\n"), Some(4096));
        write("a/b/memory.max", "8192\n");
        assert_eq!((limit("0::/a/b\n"), limit("0::/\n")), (Some(4096), None));
        write("memory/docker/memory.limit_in_bytes", "1024\n");
        let both = "12:cpu:/docker\n3:memory,hugetlb:/docker\n0::/a/b\n";
        assert_eq!(limit(both), Some(1024));
        // Within a container the container's own path does not exist.
        write("memory/memory.limit_in_bytes", "512\n");
        assert_eq!(limit("3:memory:/elsewhere\n"), Some(512));
    }

    #[test]
    fn the_default_is_less_than_the_machine_has() {
        let mut system = System::new();
        system.refresh_memory();
        assert!((1..=system.total_memory() / 4 * 3).contains(&default_limit()));
    }
}
