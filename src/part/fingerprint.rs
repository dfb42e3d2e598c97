//! The fingerprint of a scene (SPEC §11): everything that bears on its image, and nothing else: neither paths nor what draws it.

use std::path::Path;

use crate::light::StreamedLight;
use crate::scene::{Channel, Fitting, OpenVolume, Scene, SceneError, VolumeSource};
use crate::settings::clip::Clip;
use crate::settings::splatting::Rasterizer;
use crate::volume::{StreamedVolume, Thinned, Volume};

/// The texts that begin what is hashed; another meaning of fingerprints needs another text.
const DOMAIN: &str = "sheetsplat part 1\n";
const DOMAIN_OF_MATTER: &str = "sheetsplat light 1\n";
#[cfg(feature = "golden")]
const DOMAIN_OF_CHANNEL: &str = "sheetsplat channel 1\n";

/// The fingerprint of a scene of a volume, as hexadecimal digits. It is the same on every machine. Of a volume that is streamed it has the identities of its
/// stores in place of the values.
///
/// # Errors
/// If the scene cannot be written as TOML.
pub fn fingerprint(volume: &OpenVolume, scene: &Scene) -> Result<String, SceneError> {
    let mut explicit = scene.explicit(volume.sample());
    if let OpenVolume::Streamed(_) = volume {
        explicit.splatting = explicit.splatting.streamed();
    }
    let is_lit = explicit.shading.light_key().is_some();
    of_settings(DOMAIN, (volume, is_lit), explicit)
}

/// The fingerprint of what keeps light off in a scene with everything stated (SPEC §14): the volume, transfer functions and cuts.
///
/// # Errors
/// As for [`fingerprint`].
pub(crate) fn of_matter(volume: &OpenVolume, explicit: &Scene) -> Result<String, SceneError> {
    // How faces are shaded changes no light.
    let clip = Clip { shade_faces: Clip::default().shade_faces, ..explicit.clip.clone() };
    let channels = explicit.channels.clone();
    let matter = Scene { channels, clip, fitting: Fitting::NONE, ..Scene::new(VolumeSource::Memory) };
    of_settings(DOMAIN_OF_MATTER, (volume, true), matter)
}

/// The hash of settings and a volume; `is_lit` of the voxels that the light of a stream is made of, too.
fn of_settings(domain: &str, (volume, is_lit): (&OpenVolume, bool), explicit: Scene) -> Result<String, SceneError> {
    let mut hash = blake3::Hasher::new();
    hash.update(domain.as_bytes()).update(settings(explicit)?.as_bytes());
    add_grid(&mut hash, volume);
    match volume {
        OpenVolume::Whole(volume) => add_values(&mut hash, volume),
        OpenVolume::Streamed(volume) => {
            add_identities(&mut hash, volume);
            if is_lit {
                let Thinned { level, stride, .. } = StreamedLight::thinned(volume);
                hash.update(b"\nlight ").update(&(level as u64).to_le_bytes()).update(&stride.to_le_bytes());
            }
        }
    }
    Ok(hash.finalize().to_hex().to_string())
}

/// The hash of each channel of a volume, as hexadecimal digits: of its grid, values, labels and colours, or if it is streamed, of the identities of its
/// stores.
#[cfg(feature = "golden")]
pub(crate) fn of_channels(volume: &OpenVolume) -> Vec<String> {
    let of_channel = |number: usize| {
        let channel = volume.of_channel(number);
        let mut hash = blake3::Hasher::new();
        hash.update(DOMAIN_OF_CHANNEL.as_bytes());
        add_grid(&mut hash, &channel);
        match &channel {
            OpenVolume::Whole(volume) => add_values(&mut hash, volume),
            OpenVolume::Streamed(volume) => add_identities(&mut hash, volume),
        }
        hash.finalize().to_hex().to_string()
    };
    (0..volume.sample().channel_count()).map(of_channel).collect()
}

/// Hashes the size and the place of a volume's voxels.
fn add_grid(hash: &mut blake3::Hasher, volume: &OpenVolume) {
    let grid = volume.grid();
    for (count, spacing) in grid.dims.to_array().into_iter().zip(grid.spacing.to_array()) {
        hash.update(&count.to_le_bytes()).update(&spacing.to_le_bytes());
    }
    if volume.level() > 0 {
        // A level lies where the finest one does, and has its unit.
        for number in [grid.unit()].into_iter().chain(grid.place().to_array()) {
            hash.update(&number.to_le_bytes());
        }
    }
}

/// Hashes what identifies the stores of channels and labels: digits, each but the first behind a word that says what it is of.
fn add_identities(hash: &mut blake3::Hasher, volume: &StreamedVolume) {
    for (number, channel) in volume.channels.iter().enumerate() {
        if number > 0 {
            hash.update(b"\nchannel ");
        }
        hash.update(channel.values.store.identity().as_bytes());
        if let Some(labels) = &channel.labels {
            hash.update(b"\nlabels ").update(labels.store.identity().as_bytes());
        }
    }
}

/// Hashes values, labels and colours, in blocks, because the hash is fastest over long slices.
fn add_values(hash: &mut blake3::Hasher, volume: &Volume) {
    for channel in volume.channels() {
        for values in channel.values().chunks(1 << 14) {
            let bytes: Vec<u8> = values.iter().flat_map(|value| bits(value).to_le_bytes()).collect();
            hash.update(&bytes);
        }
        for labels in channel.labels().unwrap_or_default().chunks(1 << 14) {
            let bytes: Vec<u8> = labels.iter().flat_map(|label| label.to_le_bytes()).collect();
            hash.update(&bytes);
        }
        for colors in channel.colors().unwrap_or_default().chunks(1 << 12) {
            let bytes: Vec<u8> = colors.iter().flatten().flat_map(|number| number.to_le_bytes()).collect();
            hash.update(&bytes);
        }
    }
}

/// The bits of a value; all holes are alike, and so are both zeros.
fn bits(value: f32) -> u32 {
    if value.is_nan() { f32::NAN.to_bits() } else { (value + 0.0).to_bits() }
}

/// The settings as text, without those that name the volume or what draws it.
fn settings(mut scene: Scene) -> Result<String, SceneError> {
    scene.channels = scene.channels.map(|Channel { visible, transfer, .. }| Channel {
        visible,
        transfer,
        ..Channel::new(VolumeSource::Memory)
    });
    scene.splatting.rasterizer = Rasterizer::Auto;
    // Tiles never change an image.
    scene.splatting.tiles = true;
    scene.to_toml(Path::new(""))
}
