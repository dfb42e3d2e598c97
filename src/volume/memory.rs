//! How much memory is available.

use std::fs;
use std::path::Path;

use sysinfo::System;

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
