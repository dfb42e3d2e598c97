//! Parts in NPZ files: ZIP archives of an array and the description, both stored. The only two entries are written here, because crates for ZIP would do
//! no more than fill in these headers.

use std::path::Path;

use flate2::Crc;

use super::Part;
use super::channels::{Decoded, channel_names, check_hash, to_channels};
use super::description::{from_json, to_json};
use crate::image::ImageError;
use crate::image::open::{content, of_volume};
use crate::volume::{Access, SampleType, npy, npz};

/// The members.
const PIXELS: &str = "pixels.npy";
const DESCRIPTION: &str = "part.json";

/// The maximum length of a description in bytes.
const MAX_DESCRIPTION: u64 = 1 << 20;

/// The bytes of a part's file.
pub(super) fn encode(path: &Path, part: &Part) -> Result<Vec<u8>, ImageError> {
    let failed = |source: std::io::Error| ImageError::Io { path: path.to_owned(), source };
    let json = to_json(part).map_err(|error| failed(error.into()))?;
    if json.len() as u64 > MAX_DESCRIPTION {
        let found = format!("{} bytes, of which tables are the most", json.len());
        return Err(content(path, DESCRIPTION, found, format!("at most {MAX_DESCRIPTION}, or a file .exr")));
    }
    let (region, channels) = (part.window.region, to_channels(part));
    let shape = [u64::from(region.height), u64::from(region.width), channels.len() as u64];
    let pixels = (0..region.pixels()).flat_map(|at| channels.iter().map(move |channel| channel[at]));
    let array = npy::encode(&shape, pixels);
    archive(&[(PIXELS, &array), (DESCRIPTION, json.as_bytes())]).ok_or_else(|| {
        let found = format!("region {region}, of 4 GiB or more");
        content(path, "size", found, "less, or a file .exr".to_owned())
    })
}

/// An archive of stored files; `None` if it needs more than the 32 bits of its sizes.
pub(crate) fn archive(files: &[(&str, &[u8])]) -> Option<Vec<u8>> {
    let (mut bytes, mut directory) = (Vec::new(), Vec::new());
    for (name, file) in files {
        let mut sum = Crc::new();
        sum.update(file);
        let [at, size] = [bytes.len(), file.len()].map(|number| u32::try_from(number).ok());
        let mut header = Vec::new();
        // Version 2.0 is needed; no flags; stored; at midnight, on 1 January 1980.
        [20_u16, 0, 0, 0, 0x21].iter().for_each(|number| header.extend(number.to_le_bytes()));
        [sum.sum(), size?, size?].iter().for_each(|number| header.extend(number.to_le_bytes()));
        // The lengths of the name and of the extra field.
        [name.len() as u16, 0].iter().for_each(|number| header.extend(number.to_le_bytes()));
        bytes.extend([&b"PK\x03\x04"[..], &header, name.as_bytes(), file].concat());
        // Made by version 2.0; no comment, on disk 0, no attributes.
        directory.extend([&b"PK\x01\x02\x14\0"[..], &header, &[0; 10], &at?.to_le_bytes(), name.as_bytes()].concat());
    }
    let [at, size] = [bytes.len(), directory.len()].map(|number| u32::try_from(number).ok());
    let count = (files.len() as u16).to_le_bytes();
    bytes.extend(&directory);
    let end = [&b"PK\x05\x06\0\0\0\0"[..], &count, &count, &size?.to_le_bytes(), &at?.to_le_bytes(), &[0; 2]];
    bytes.extend(end.concat());
    Some(bytes)
}

/// What identifies the part in a file, and its channels.
pub(super) fn decode(path: &Path, access: &Access) -> Result<Decoded, ImageError> {
    let read = npz::text_and_array(path, (DESCRIPTION, MAX_DESCRIPTION), PIXELS, access);
    let (json, array) = read.map_err(of_volume)?;
    let (identity, window, pixels) = from_json(path, &json)?;
    let (region, names) = (window.region, channel_names(&identity));
    let [channels, width, height] = array.dims.to_array();
    if [channels, width, height] != [names.len() as u32, region.width, region.height] {
        let allowed = format!("({}, {}, {}), as the description says", region.height, region.width, names.len());
        return Err(content(path, "shape", format!("({height}, {width}, {channels})"), allowed));
    }
    if array.kind != SampleType::F32 {
        return Err(content(path, "descr", array.kind.to_string(), "float32".to_owned()));
    }
    let channel = |channel: usize| array.values.as_slice().iter().skip(channel).step_by(names.len()).collect();
    let channels: Vec<_> = (0..names.len()).map(channel).collect();
    check_hash(path, &pixels, &channels)?;
    Ok((identity, window, channels))
}
