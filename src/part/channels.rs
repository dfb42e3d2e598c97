//! The channels of parts in files.

use std::path::Path;

use super::{Content, Extreme, Identity, Part};
use crate::image::ImageError;
use crate::image::open::{MAX_EXPANSION, content, of_volume};
use crate::settings::window::Window;
use crate::volume::Access;

/// What identifies the part in a file, and its channels.
pub(super) type Decoded = (Identity, Window, Vec<Vec<f32>>);

/// The names of a part's channels: those of images after the first have their numbers before them.
pub(super) fn channel_names(identity: &Identity) -> Vec<String> {
    const ALL: [&str; 7] = ["R", "G", "B", "A", "value", "counted", "label"];
    let names = match (identity.has_extremes(), identity.notes_labels()) {
        (false, _) => &ALL[..4],
        (true, false) => &ALL[..6],
        (true, true) => &ALL,
    };
    let of_image = |image: usize| {
        names.iter().map(move |name| if image == 0 { (*name).to_owned() } else { format!("{image}.{name}") })
    };
    (0..identity.images).flat_map(of_image).collect()
}

/// The pixels of a part, channel by channel.
pub(super) fn to_channels(part: &Part) -> Vec<Vec<f32>> {
    let per_image = channel_names(&part.identity).len() / part.identity.images;
    part.contents.iter().flat_map(|of_image| to_channels_of(of_image).into_iter().take(per_image)).collect()
}

fn to_channels_of(Content { colors, extremes }: &Content) -> Vec<Vec<f32>> {
    let mut channels: Vec<Vec<f32>> =
        (0..4).map(|channel| colors.iter().map(|color| color[channel]).collect()).collect();
    if !extremes.is_empty() {
        channels.push(extremes.iter().map(|extreme| extreme.value).collect());
        channels.push(extremes.iter().map(|extreme| extreme.counted).collect());
        channels.push(extremes.iter().map(|extreme| extreme.label).collect());
    }
    channels
}

/// The pixels of one of a part's images from its channels, which have equal lengths.
pub(super) fn from_channels(channels: &[Vec<f32>]) -> Content {
    let pixels = channels.first().map_or(0, Vec::len);
    let colors = (0..pixels).map(|at| std::array::from_fn(|channel| channels[channel][at])).collect();
    let extreme = |at: usize| {
        let [value, counted, label] = [4, 5, 6].map(|channel| channels.get(channel).map_or(0.0, |of| of[at]));
        Extreme { value, counted, label }
    };
    let extremes = if channels.len() > 4 { (0..pixels).map(extreme).collect() } else { Vec::new() };
    Content { colors, extremes }
}

/// The hash of the bits of channels, in hexadecimal digits.
pub(crate) fn hash_of(channels: &[impl AsRef<[f32]>]) -> String {
    let mut hash = blake3::Hasher::new();
    for samples in channels.iter().flat_map(|channel| channel.as_ref().chunks(1 << 14)) {
        let bytes: Vec<u8> = samples.iter().flat_map(|sample| sample.to_le_bytes()).collect();
        hash.update(&bytes);
    }
    hash.finalize().to_hex().to_string()
}

/// Checks that channels are those that were written, by their hash.
pub(super) fn check_hash(path: &Path, stated: &str, channels: &[Vec<f32>]) -> Result<(), ImageError> {
    if stated == hash_of(channels) {
        return Ok(());
    }
    Err(content(path, "part.pixels", "other pixels".to_owned(), format!("those of hash {stated}")))
}

/// Reserves the memory of a part's pixels, which its file's bytes must be able to hold.
pub(super) fn reserve(
    path: &Path,
    (identity, window): (&Identity, &Window),
    bytes: usize,
    access: &Access,
) -> Result<(), ImageError> {
    let channels = channel_names(identity).len() as u64;
    let needed = window.region.pixels() as u64 * channels * size_of::<f32>() as u64;
    let region = &window.region;
    if needed > MAX_EXPANSION * bytes as u64 {
        let found = format!("region {region} in {bytes} bytes");
        return Err(content(path, "size", found, format!("at most {MAX_EXPANSION} times as many bytes of pixels")));
    }
    // As in the file, channel by channel, and pixel by pixel.
    access.reserve(path, "size", format_args!("region {region}"), needed.saturating_mul(3)).map_err(of_volume)
}
