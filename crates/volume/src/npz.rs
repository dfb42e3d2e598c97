//! NumPy's NPZ files: ZIP archives of NPY files, stored or deflated.

use std::path::Path;

use super::VolumeError;
use super::access::Access;
use super::address::archive_and_inner;
use super::error::volume::invalid;
use super::loaded::Loaded;
use super::npy::{self, Array};
use super::text::shown;
use super::zip::Directory;
use super::zip::Member;

/// The maximum number of names shown in an error.
const SHOWN: usize = 12;

/// Reads the only array of a file, or the one that the path names after a colon: `file.npz:name`.
pub(super) fn read(path: &Path, access: &Access) -> Result<Loaded, VolumeError> {
    let (archive, wanted) = archive_and_inner(path);
    let mut file = access.open(archive)?;
    let members = Directory::read(&mut file)?.members(&mut file, ".npy")?;
    let names = || {
        let names = members.iter().take(SHOWN).map(|member| shown(array_name(member)));
        let more = if members.len() > SHOWN { ", …" } else { "" };
        format!("{} arrays: {}{more}", members.len(), names.collect::<Vec<_>>().join(", "))
    };
    let member = match (wanted, members.as_slice()) {
        (None, [member]) => member,
        (None, _) => {
            return Err(invalid(
                archive,
                "arrays",
                names(),
                "one array, or its name behind a colon, as in file.npz:name",
            ));
        }
        (Some(name), _) => members
            .iter()
            .find(|member| array_name(member) == name)
            .ok_or_else(|| invalid(path, "arrays", names(), format!("an array called {}", shown(name))))?,
    };
    npy::read_array(path, member.open(file)?)
}

/// Reads the text of one file of an archive, of at most `most` bytes, and one array.
pub fn text_and_array(
    path: &Path,
    (text, most): (&str, u64),
    array: &str,
    access: &Access,
) -> Result<(String, Array), VolumeError> {
    let mut file = access.open(path)?;
    let directory = Directory::read(&mut file)?;
    let mut member = |name: &str| {
        let found = directory.members(&mut file, name)?.into_iter().find(|member| member.name == name);
        found.ok_or_else(|| invalid(path, "archive", "none with this name", format!("a file {name} in it")))
    };
    let (text, array) = (member(text)?, member(array)?);
    if text.bytes > most {
        return Err(invalid(path, &text.name, format!("{} bytes", text.bytes), format!("at most {most} bytes")));
    }
    let bytes = text.open(file)?.bytes(text.bytes)?;
    Ok((String::from_utf8_lossy(&bytes).into_owned(), npy::read_array(path, array.open(access.open(path)?)?)?.into()))
}

/// The name of a file's array in NumPy.
fn array_name(member: &Member) -> &str {
    member.name.strip_suffix(".npy").unwrap_or(&member.name)
}
