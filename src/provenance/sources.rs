//! Hashes that identify the volume of a picture. A file that was read whole has the hash of its bytes. Where files were read in pieces, or the volume came from
//! memory, each channel's values have one.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

use super::names::{Names, files_of};
use super::text::SourceFile;
use crate::part::fingerprint;
use crate::scene::{OpenVolume, Scene, VolumeSource};
use crate::volume::{Inputs, archive_and_inner, is_address};

/// Files that are larger than these bytes for each voxel of each channel, and some for headers, hold more than what was read of them: eight are the largest
/// sample.
const BYTES_PER_VOXEL: u64 = 16;
const BYTES_OF_HEADER: u64 = 16 << 20;

/// Archives of stores, of which chunks are read.
const ARCHIVES: [&str; 2] = ["zip", "ozx"];

/// The files and values behind a volume.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sources {
    /// Files and stores, with the hashes of those that were read whole.
    files: Vec<(PathBuf, Option<String>)>,
    pub(super) values: Vec<String>,
    pub(super) is_streamed: bool,
}

impl Sources {
    /// The sources of a scene's volume, given the files that were read for it ([`ReadOptions::noted_in`](crate::volume::ReadOptions::noted_in)). Without the volume,
    /// where a host has it no more, values stay unknown that no file's hash tells. A file that cannot be read once more has no hash, and then values have.
    pub fn of(volume: Option<&OpenVolume>, scene: &Scene, inputs: &Inputs) -> Self {
        let named = files_of(scene);
        if let Some(volume @ OpenVolume::Streamed(_)) = volume {
            let files = named.into_iter().map(|path| (path, None)).collect();
            return Self { files, values: fingerprint::of_channels(volume), is_streamed: true };
        }
        let most = volume.map_or(u64::MAX, |volume| {
            let voxels = volume.grid().voxels().saturating_mul(volume.sample().channel_count() as u64);
            voxels.saturating_mul(BYTES_PER_VOXEL).saturating_add(BYTES_OF_HEADER)
        });
        let mut files = Vec::new();
        for path in inputs.files() {
            let hash = hash_up_to(&path, most).unwrap_or_default();
            files.push((path, hash));
        }
        files.extend(inputs.folders().into_iter().map(|path| (path, None)));
        files.extend(named.into_iter().filter(|path| is_address(path)).map(|path| (path, None)));
        let is_builtin = matches!(scene.channels.first().volume, VolumeSource::Builtin(_));
        let are_known = files.iter().all(|(_, hash)| hash.is_some()) && (is_builtin || !files.is_empty());
        let values = volume.filter(|_| !are_known).map_or_else(Vec::new, fingerprint::of_channels);
        Self { files, values, is_streamed: false }
    }

    /// The files by their names in a picture's text, sorted: threads open the files of a folder in any order.
    pub(super) fn named(&self, names: &Names) -> Vec<SourceFile> {
        let named =
            |(path, hash): &(PathBuf, Option<String>)| SourceFile { path: names.of(path), blake3: hash.clone() };
        let mut files: Vec<SourceFile> = self.files.iter().map(named).collect();
        files.sort_by(|one, other| (&one.path, &one.blake3).cmp(&(&other.path, &other.blake3)));
        files
    }
}

/// The hash of a file's bytes; `None` if it has more than the most, or is an archive that is read in pieces.
fn hash_up_to(path: &Path, most: u64) -> io::Result<Option<String>> {
    let (path, _) = archive_and_inner(path);
    let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    if ARCHIVES.iter().any(|archive| extension.eq_ignore_ascii_case(archive)) || path.metadata()?.len() > most {
        return Ok(None);
    }
    hash_of(path).map(Some)
}

/// The hash of a file's bytes.
pub(super) fn hash_of(path: &Path) -> io::Result<String> {
    Ok(blake3::Hasher::new().update_reader(File::open(path)?)?.finalize().to_hex().to_string())
}
