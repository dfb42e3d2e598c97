//! The fuzz targets of images and scenes; those of volumes are in `crates/volume/tests/fuzz`. Included by the libFuzzer package and by `tests/hostile`.

use std::path::Path;

use sheetsplat::Scene;
use sheetsplat::golden::Picture;

use crate::input::{Target, file};

/// The targets by name.
pub(crate) const TARGETS: [(&str, Target); 4] = [
    ("png-image", |bytes| image("image.png", bytes)),
    ("exr-image", |bytes| image("image.exr", bytes)),
    ("npy-image", |bytes| image("image.npy", bytes)),
    ("scene", scene),
];

/// Reads an image as `compare` and goldens do.
fn image(name: &str, bytes: &[u8]) {
    if let Ok(Picture { image, .. }) = Picture::open(&file(name, bytes)) {
        assert_eq!(image.pixels.len(), image.width as usize * image.height as usize);
    }
}

/// The first line is an override, the rest a scene.
fn scene(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    let (set, scene) = text.split_once('\0').unwrap_or(("", &text));
    let sets = if set.is_empty() { vec![] } else { vec![set.to_owned()] };
    _ = Scene::parse(scene, "a scene", Path::new("."), &sets);
}
