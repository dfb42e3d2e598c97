//! The scene in a picture, and the files that it names.

use std::path::{Path, PathBuf};

use super::names::{files_of, is_kept};
use super::sources::hash_of;
use super::text::Provenance;
use crate::image::open::of_volume;
use crate::image::{ImageError, described};
use crate::scene::{Scene, SceneError, VolumeSource, reserve_text};
use crate::volume::{Access, ReadOptions, archive_and_inner, is_address, written_in};

impl Provenance {
    /// Reads how a picture was made; `None` if its file does not tell.
    ///
    /// # Errors
    /// If the file cannot be read, is no PNG, EXR or NPY file, its text is too long, damaged, or of another version's format, or the scene takes more memory
    /// than the options allow.
    pub fn open(path: &Path, options: &ReadOptions) -> Result<Option<Self>, ImageError> {
        let Some(text) = described::text(path, options)? else { return Ok(None) };
        let read = Self::from_json(path, &text)?;
        let access = Access::new(options).map_err(of_volume)?;
        reserve_text(path, read.scene.len(), &access).map_err(of_volume)?;
        Ok(Some(read))
    }

    /// The scene of a picture, and `--set` overrides over it. Its files are looked for in the picture's folder and then in other folders, by their paths and
    /// their names; of several of one name the one with the hash is taken. A volume from memory stays one.
    ///
    /// # Errors
    /// If the text holds no scene or a path that leads elsewhere, an override is not allowed, or a file is missing.
    pub fn scene(&self, picture: &Path, search: &[PathBuf], sets: &[String]) -> Result<Scene, SceneError> {
        let origin = picture.display().to_string();
        let parse =
            |folder: &Path, sets: &[String]| Scene::parse_for(VolumeSource::Memory, &self.scene, &origin, folder, sets);
        let invalid = |found: String, allowed: &str| SceneError::Invalid {
            origin: origin.clone(),
            key: "volume.path".to_owned(),
            found,
            allowed: allowed.into(),
        };
        let kept: Vec<String> =
            files_of(&parse(Path::new(""), &[])?).iter().map(|path| path.to_string_lossy().into_owned()).collect();
        if let Some(path) = kept.iter().find(|path| !is_kept(path)) {
            return Err(invalid(path.clone(), "a name, or a path in the picture's folder"));
        }
        let folder = picture.parent().unwrap_or(Path::new(""));
        let mut scene = parse(folder, sets)?;
        for name in kept.iter().filter(|name| !is_address(Path::new(name))) {
            let written = written_in(folder, name);
            if !files_of(&scene).contains(&written) {
                // An override names another.
                continue;
            }
            let found = self.find(name, folder, search).ok_or_else(|| {
                let allowed = "it beside the picture, or in a folder of --search";
                invalid(format!("no file {name}"), allowed)
            })?;
            replace(&mut scene, &written, &found);
        }
        Ok(scene)
    }

    /// A file by its name.
    fn find(&self, name: &str, folder: &Path, search: &[PathBuf]) -> Option<PathBuf> {
        // Behind the number that tells files of one name apart, and behind the picture's own folders.
        let alone = name.rsplit('/').next().unwrap_or(name);
        let beside = std::iter::once(written_in(folder, name));
        let elsewhere = search.iter().flat_map(|folder| [folder.join(name), folder.join(alone)]);
        let mut found: Vec<PathBuf> =
            beside.chain(elsewhere).filter(|path| archive_and_inner(path).0.exists()).collect();
        let hash = self.files.iter().find(|file| file.path == name).and_then(|file| file.blake3.as_ref());
        if let Some(hash) = hash.filter(|_| found.len() > 1)
            && let Some(at) = found.iter().position(|path| hash_of(path).is_ok_and(|own| own == *hash))
        {
            return Some(found.swap_remove(at));
        }
        found.into_iter().next()
    }
}

/// Puts a path in the place of another in a scene.
fn replace(scene: &mut Scene, old: &Path, new: &Path) {
    for channel in scene.channels.iter_mut() {
        if let VolumeSource::File(path) | VolumeSource::Raw(path, _) = &mut channel.volume
            && path == old
        {
            new.clone_into(path);
        }
        for path in [&mut channel.labels, &mut channel.label_table].into_iter().flatten() {
            if path == old {
                new.clone_into(path);
            }
        }
    }
}
