//! What hosts rely on: types that can move to other threads, and a library that leaves submitting and waiting to them.

use std::fs;
use std::path::{Path, PathBuf};

use sheetsplat::DeviceError;
use sheetsplat::PendingCounts;
use sheetsplat::PendingPick;
use sheetsplat::Surfaces;
use sheetsplat::headless::{GpuHeadless, Rendering};
use sheetsplat::image::Image;
use sheetsplat::settings::Clip;
use sheetsplat::stats::Stats;
use sheetsplat::{
    Camera, DeviceRequirements, GpuVolume, Placement, Renderer, RendererOptions, Scene, SceneView, Volume,
};

/// This compiles only if the types are `Send` and `Sync`.
const _: () = {
    const fn is_send_and_sync<T: Send + Sync>() {}
    const fn is_send<T: Send>() {}
    is_send_and_sync::<DeviceRequirements>();
    is_send_and_sync::<DeviceError>();
    is_send_and_sync::<Renderer>();
    is_send_and_sync::<RendererOptions>();
    is_send_and_sync::<Placement>();
    is_send_and_sync::<GpuVolume>();
    is_send_and_sync::<SceneView>();
    is_send_and_sync::<Scene>();
    is_send_and_sync::<Camera>();
    is_send_and_sync::<Clip>();
    is_send_and_sync::<Surfaces>();
    is_send_and_sync::<Volume>();
    is_send_and_sync::<Image>();
    is_send_and_sync::<Stats>();
    is_send_and_sync::<GpuHeadless>();
    is_send_and_sync::<Rendering>();
    is_send_and_sync::<sheetsplat::headless::Error>();
    // One thread at a time asks for it.
    is_send::<PendingCounts>();
    is_send::<PendingPick>();
};

/// What only `headless` does: open a device, submit, and wait.
const ITS_OWN: [&str; 9] = [
    ".submit(",
    ".poll(",
    "block_on",
    "request_device",
    "request_adapter",
    "enumerate_adapters",
    "Instance::new",
    "wait_indefinitely",
    ".recv()",
];

fn sources(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        // The programs are hosts themselves.
        if path.ends_with("src/bin") {
            continue;
        }
        if path.is_dir() { sources(&path, files) } else { files.push(path) }
    }
}

#[test]
fn only_headless_owns_a_device_submits_and_waits() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&source, &mut files);
    assert!(files.len() > 50, "{} files", files.len());
    let mut in_headless = Vec::new();
    for file in files {
        let text = fs::read_to_string(&file).unwrap();
        let used = ITS_OWN.iter().filter(|&&word| text.contains(word));
        if file.starts_with(source.join("headless")) {
            in_headless.extend(used);
        } else {
            assert_eq!(used.collect::<Vec<_>>(), [] as [&&str; 0], "{}", file.display());
        }
    }
    let unused: Vec<_> = ITS_OWN.iter().filter(|word| !in_headless.contains(word)).collect();
    assert_eq!(unused, [&"request_adapter"], "else the words are not those that headless uses");
}
