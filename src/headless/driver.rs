//! Advice on which package installs a driver.

/// The advice for this machine.
pub(super) fn advice() -> String {
    // Systems without systemd have only the second file.
    let paths = ["/etc/os-release", "/usr/lib/os-release"];
    let os_release = paths.iter().find_map(|path| std::fs::read_to_string(path).ok());
    advice_for(std::env::consts::OS, &os_release.unwrap_or_default())
}

/// Distributions by their names in os-release(5), and the command that installs Mesa's drivers, including lavapipe, and the Vulkan loader.
const DISTRIBUTIONS: [(&[&str], &str); 5] = [
    (&["debian", "ubuntu"], "apt install mesa-vulkan-drivers libvulkan1"),
    (&["fedora", "rhel", "centos"], "dnf install mesa-vulkan-drivers vulkan-loader"),
    (&["arch"], "pacman -S vulkan-swrast vulkan-icd-loader"),
    (&["suse", "opensuse"], "zypper install libvulkan_lvp libvulkan1"),
    (&["alpine"], "apk add mesa-vulkan-swrast vulkan-loader"),
];

/// The advice for an operating system; on Linux its os-release(5) file names the distribution.
fn advice_for(os: &str, os_release: &str) -> String {
    match os {
        "macos" => "macOS includes its driver, Metal: there is nothing to install".to_owned(),
        "windows" => "install the driver of the GPU's maker, which brings DirectX 12 and Vulkan".to_owned(),
        "linux" => {
            let names = names(os_release);
            let known = |name: &String| DISTRIBUTIONS.iter().find(|(known, _)| known.contains(&name.as_str()));
            let command = names.iter().find_map(known).map(|(_, command)| command);
            let what = command.map_or("install a Vulkan loader and Mesa's Vulkan drivers".to_owned(), |command| {
                format!("`{command}` installs one")
            });
            format!("{what} that needs no GPU (lavapipe), and those of AMD and Intel; for NVIDIA install NVIDIA's")
        }
        _ => "install a Vulkan driver and the Vulkan loader".to_owned(),
    }
}

/// A distribution's ID, followed by those of the distributions it is like.
fn names(os_release: &str) -> Vec<String> {
    let value = |key: &str| {
        let mut values = os_release.lines().filter_map(|line| line.trim().strip_prefix(key)?.strip_prefix('='));
        values.next_back().unwrap_or_default().trim_matches(['"', '\'']).to_lowercase()
    };
    let like = value("ID_LIKE");
    std::iter::once(value("ID")).chain(like.split_whitespace().map(str::to_owned)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_package_is_the_distributions() {
        for (os_release, packages) in [
            ("PRETTY_NAME=\"Debian GNU/Linux 12\"\nID=debian\n", "apt install mesa-vulkan-drivers libvulkan1"),
            ("NAME=\"Ubuntu\"\nID=ubuntu\nID_LIKE=debian", "apt install mesa-vulkan-drivers libvulkan1"),
            ("ID=pop\nID_LIKE=\"ubuntu debian\"\n", "apt install mesa-vulkan-drivers libvulkan1"),
            ("ID=fedora\nVERSION_ID=42", "dnf install mesa-vulkan-drivers vulkan-loader"),
            ("ID=\"rocky\"\nID_LIKE=\"rhel centos fedora\"", "dnf install mesa-vulkan-drivers vulkan-loader"),
            ("ID=arch", "pacman -S vulkan-swrast vulkan-icd-loader"),
            ("ID='manjaro'\nID_LIKE=arch", "pacman -S vulkan-swrast vulkan-icd-loader"),
            ("ID=\"opensuse-tumbleweed\"\nID_LIKE=\"opensuse suse\"", "zypper install libvulkan_lvp libvulkan1"),
            ("ID=alpine", "apk add mesa-vulkan-swrast vulkan-loader"),
            ("ID=unheard-of", "a Vulkan loader and Mesa's Vulkan drivers"),
            ("", "a Vulkan loader and Mesa's Vulkan drivers"),
        ] {
            let advice = advice_for("linux", os_release);
            assert!(advice.contains(packages), "{os_release:?}: {advice}");
        }
        // Other systems have no distributions.
        assert!(advice_for("macos", "ID=debian").contains("Metal"));
        assert!(advice_for("windows", "").contains("driver of the GPU's maker"));
        assert!(advice_for("freebsd", "ID=freebsd").contains("Vulkan loader"));
    }
}
