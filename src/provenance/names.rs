//! The names that files have in a picture's text: their paths in the picture's folder, or else their names alone, so that nothing tells whose folders they
//! lie in.

use std::path::{Component, Path, PathBuf};

use crate::scene::writer::invalid;
use crate::scene::{Channel, Scene, SceneError};
use crate::volume::{builtin_name, is_address};

/// The files that a scene names, and their names in a picture's text.
pub(super) struct Names {
    /// The picture's folder.
    folder: PathBuf,
    /// The places of the scene's files, and their names, which are distinct.
    named: Vec<(PathBuf, String)>,
}

impl Names {
    /// The names of a scene's files for a picture at a path.
    pub(super) fn new(picture: &Path, scene: &Scene) -> Self {
        let (folder, _) = place(picture);
        let mut names = Self { folder, named: Vec::new() };
        for path in files_of(scene) {
            let at = joined(&path);
            if names.named.iter().any(|(known, _)| *known == at) {
                continue;
            }
            let name = names.alone(&path);
            // Files of one name in several folders outside the picture's are told apart by numbers before their names.
            let is_taken = |name: &String| names.named.iter().any(|(_, taken)| taken == name);
            let numbered = (2..).map(|number: u32| format!("{number}/{name}"));
            let name = std::iter::once(name.clone()).chain(numbered).find(|name| !is_taken(name)).unwrap_or(name);
            names.named.push((at, name));
        }
        names
    }

    /// The name of a file that was read: one of the scene's, one in a folder that the scene names, or any other.
    pub(super) fn of(&self, path: &Path) -> String {
        let at = joined(path);
        let within = self.named.iter().find_map(|(named, name)| Some((name, at.strip_prefix(named).ok()?)));
        match within {
            Some((name, rest)) if rest.as_os_str().is_empty() => name.clone(),
            Some((name, rest)) => format!("{name}/{}", slashed(rest)),
            None => self.alone(path),
        }
    }

    /// A file's path in the picture's folder, or its name.
    fn alone(&self, path: &Path) -> String {
        if is_address(path) {
            return without_secrets(&path.to_string_lossy());
        }
        let (folder, rest) = place(path);
        match folder.strip_prefix(&self.folder) {
            Ok(within) => slashed(&within.join(rest)),
            Err(_) => slashed(&rest),
        }
    }

    /// The scene as a scene file with these names.
    pub(super) fn scene(&self, scene: &Scene) -> Result<String, SceneError> {
        scene.to_toml_naming(&|path, key| match path.to_str() {
            Some(_) => Ok(self.of(path)),
            None => Err(invalid(key, path.display().to_string(), "a path in UTF-8")),
        })
    }
}

/// The files that a scene names: volumes, labels, and tables of labels.
pub(super) fn files_of(scene: &Scene) -> Vec<PathBuf> {
    let of_channel = |channel: &Channel| {
        let table = channel.label_table.clone().filter(|path| builtin_name(path).is_none());
        [channel.volume.path().map(Path::to_path_buf), channel.labels.clone(), table]
    };
    scene.channels.iter().flat_map(of_channel).flatten().collect()
}

/// The deepest folder of a path that exists, without links, and the rest of the path, whose last part may be a link, or a part of an archive.
fn place(path: &Path) -> (PathBuf, PathBuf) {
    for ancestor in path.ancestors().skip(1) {
        let folder = if ancestor.as_os_str().is_empty() { Path::new(".") } else { ancestor };
        if let (Ok(canonical), Ok(rest)) = (folder.canonicalize(), path.strip_prefix(ancestor))
            && canonical.is_dir()
        {
            return (canonical, rest.to_owned());
        }
    }
    (PathBuf::new(), path.file_name().map(PathBuf::from).unwrap_or_default())
}

fn joined(path: &Path) -> PathBuf {
    if is_address(path) {
        return path.to_owned();
    }
    let (folder, rest) = place(path);
    folder.join(rest)
}

/// The parts of a relative path with slashes between them, on every system.
fn slashed(path: &Path) -> String {
    let parts = path.components().filter_map(|part| match part {
        Component::Normal(name) => Some(name.to_string_lossy()),
        _ => None,
    });
    parts.collect::<Vec<_>>().join("/")
}

/// An address without the name and password of a user, and without a query, which may hold a signature.
fn without_secrets(address: &str) -> String {
    let plain = address.split(['?', '#']).next().unwrap_or_default();
    let Some((scheme, rest)) = plain.split_once("://") else { return plain.to_owned() };
    let (server, path) = rest.split_at(rest.find('/').unwrap_or(rest.len()));
    let server = server.rsplit('@').next().unwrap_or_default();
    format!("{scheme}://{server}{path}")
}

/// Whether a name is one that texts of pictures have: an address, or a path that leads out of no folder.
pub(super) fn is_kept(name: &str) -> bool {
    let is_inside = |part: Component<'_>| matches!(part, Component::Normal(_));
    // Backslashes and colons of drives lead elsewhere on Windows alone, whose components know them.
    is_address(Path::new(name)) || !name.is_empty() && Path::new(name).components().all(is_inside)
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;
    use crate::scene::VolumeSource;
    use crate::volume::Channels;

    #[test]
    fn names_tell_of_no_folder_outside_the_pictures() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for name in ["figures/data", "alice/series", "bob"] {
            std::fs::create_dir_all(at(name)).unwrap();
        }
        for name in ["figures/data/a.nrrd", "alice/b.nrrd", "alice/series/1.dcm", "bob/b.nrrd", "bob/c.npz"] {
            std::fs::write(at(name), "").unwrap();
        }
        let paths = ["figures/data/a.nrrd", "figures/../alice/b.nrrd", "alice/series", "bob/b.nrrd", "bob/c.npz:inner"];
        let channel = |path: &str| Channel::new(VolumeSource::File(at(path)));
        let mut channels = paths.map(channel).to_vec();
        channels.push(Channel::new(VolumeSource::File("https://alice:secret@a.b/c.zarr?token=x".into())));
        let scene = Scene { channels: Channels::of(channels).unwrap(), ..Scene::new(VolumeSource::Memory) };
        let names = Names::new(&at("figures/picture.png"), &scene);
        let text = names.scene(&scene).unwrap();
        let written: Vec<&str> = text.lines().filter_map(|line| line.strip_prefix("path = ")).collect();
        let expected = ["data/a.nrrd", "b.nrrd", "series", "2/b.nrrd", "c.npz:inner", "https://a.b/c.zarr"];
        assert_eq!(written, expected.map(|name| format!("{name:?}")));
        assert_eq!(names.of(&at("alice/series/1.dcm")), "series/1.dcm");
        assert_eq!(names.of(&at("bob/c.npz")), "c.npz");
        assert!(!text.contains("alice") && !text.contains("secret") && !text.contains("token"), "{text}");
    }

    #[test]
    fn kept_names_lead_out_of_no_folder() {
        for name in ["a.nrrd", "data/a.nrrd", "https://a.b/c.zarr", "a..b", "c.npz:inner"] {
            assert!(is_kept(name), "{name}");
        }
        for name in ["", "/etc/passwd", "../a", "a/../../b", "a/.."] {
            assert!(!is_kept(name), "{name}");
        }
    }
}
