//! `sheetsplat view` as a user starts it. Needs an X11 display, such as that of `xvfb-run`, and a GPU or lavapipe.
#![expect(clippy::unwrap_used, reason = "tests")]

use std::path::Path;
use std::process::{Command, Output};

use image::{Rgba, RgbaImage};

/// The size of the window; the panel is at its right.
const WINDOW: [u32; 2] = [900, 600];
const PANEL: u32 = 330;

const SCENE: &str = "builtin:head:48 --set camera.fit=volume --set camera.direction=[0.55,0.8,-0.12] --set image.background=[0,0,0.4,1]";

fn sheetsplat(folder: &Path, arguments: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_sheetsplat"));
    command.env("WGPU_ADAPTER_NAME", "llvmpipe").current_dir(folder).args(arguments.split(' '));
    command
}

fn succeeds(mut command: Command) {
    let Output { status, stderr, .. } = command.output().unwrap();
    assert!(status.success(), "{}", String::from_utf8_lossy(&stderr));
}

fn assert_fails(mut command: Command, code: i32, words: &[&str]) {
    let Output { status, stderr, .. } = command.output().unwrap();
    let stderr = String::from_utf8(stderr).unwrap();
    assert_eq!(status.code(), Some(code), "{command:?}\n{stderr}");
    assert!(!stderr.contains("panicked"), "{command:?}\n{stderr}");
    for word in words {
        assert!(stderr.contains(word), "{command:?}: no {word:?} in\n{stderr}");
    }
}

fn open(folder: &Path, name: &str) -> RgbaImage {
    image::open(folder.join(name)).unwrap().into_rgba8()
}

/// The largest difference of any channel.
fn difference(a: &Rgba<u8>, b: &Rgba<u8>) -> u8 {
    a.0.iter().zip(b.0).map(|(a, b)| a.abs_diff(b)).max().unwrap()
}

#[test]
fn the_window_shows_the_rendering_and_the_panel() {
    let folder = tempfile::tempdir().unwrap();
    let [width, height] = WINDOW;
    succeeds(sheetsplat(folder.path(), &format!("view {SCENE} --size {width}x{height} --screenshot window.png")));
    let window = open(folder.path(), "window.png");
    assert_eq!(window.dimensions(), (width, height));

    // The picture equals what `render` makes with the same number of pixels.
    let picture = width - PANEL;
    let size = format!("--set image.width={picture} --set image.height={height}");
    succeeds(sheetsplat(folder.path(), &format!("render {SCENE} {size} -o image.png")));
    let image = open(folder.path(), "image.png");
    let background = Rgba([0, 0, 102, 255]);
    assert!(difference(image.get_pixel(picture / 2, height / 2), &background) > 50, "the head is in the middle");
    assert_eq!(*image.get_pixel(1, 1), background);
    // The last columns are the panel's edge.
    let differing = image
        .enumerate_pixels()
        .filter(|(x, y, pixel)| x + 2 < picture && difference(pixel, window.get_pixel(*x, *y)) > 1);
    assert_eq!(differing.count(), 0);

    let panel = image::imageops::crop_imm(&window, picture + 2, 0, PANEL - 2, height).to_image();
    let share = |is: &dyn Fn(&Rgba<u8>) -> bool| {
        panel.pixels().filter(|pixel| is(pixel)).count() as f64 / f64::from(panel.width() * panel.height())
    };
    let [plain, text] = [share(&|p| p[0] == p[1] && p[1] == p[2] && p[0] < 60), share(&|p| p[0] > 120)];
    assert!(plain > 0.5, "most of the panel is dark grey: {plain}");
    assert!(text > 0.02, "and has light text and curves: {text}");
    let skin = share(&|p| p[0] > 200 && p[0] > p[1].saturating_add(20) && p[1] > p[2]);
    assert!(skin > 0.001, "and the colours of the transfer function: {skin}");
}

/// Two channels, with a camera that does not depend on the window.
const CHANNELS: &str = "
    shading.enabled = false
    splatting.compositing = 'exponential'
    [camera]
    direction = [0.55, 0.8, -0.12]
    [image]
    background = [0, 0, 0.4, 1]
    [[channel]]
    name = 'soft'
    volume.builtin = 'head:48'
    transfer = {color = [[0, [1, 0, 1]]], opacity = [[20, 0], [60, 0.03]]}
    [[channel]]
    name = 'hard'
    volume.builtin = 'head:48'
    transfer = {color = [[0, [0, 1, 0]]], opacity = [[150, 0], [200, 0.2]]}
";

#[test]
fn the_panel_lists_channels_in_their_colours() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("two.toml"), CHANNELS).unwrap();
    let [width, height] = WINDOW;
    let picture = width - PANEL;
    let mut pictures = Vec::new();
    for (name, set) in [("both", ""), ("hard", " --set channel[0].visible=false")] {
        let view = format!("view two.toml{set} --size {width}x{height} --screenshot {name}.png");
        succeeds(sheetsplat(folder.path(), &view));
        let window = open(folder.path(), &format!("{name}.png"));
        let size = format!("--set image.width={picture} --set image.height={height}");
        succeeds(sheetsplat(folder.path(), &format!("render two.toml{set} {size} -o image.png")));
        let image = open(folder.path(), "image.png");
        let differing = image
            .enumerate_pixels()
            .filter(|(x, y, pixel)| x + 2 < picture && difference(pixel, window.get_pixel(*x, *y)) > 1);
        assert_eq!(differing.count(), 0, "{name}");
        // Hidden channels are listed too, each with its name and a field in its colour.
        let panel = image::imageops::crop_imm(&window, picture + 2, 0, PANEL - 2, height).to_image();
        let count = |is: fn(&&Rgba<u8>) -> bool| panel.pixels().filter(is).count();
        let magenta = count(|pixel| pixel[0] > 200 && pixel[1] < 60 && pixel[2] > 200);
        let green = count(|pixel| pixel[0] < 60 && pixel[1] > 200 && pixel[2] < 60);
        assert!(magenta > 150 && green > 150, "{name}: {magenta} magenta pixels, {green} green ones");
        pictures.push(image);
    }
    assert!(pictures[0] != pictures[1]);
}

#[test]
fn failures_end_with_a_message() {
    let folder = tempfile::tempdir().unwrap();
    let fails = |code, arguments: &str, words: &[&str]| assert_fails(sheetsplat(folder.path(), arguments), code, words);
    fails(2, "view builtin:head:16 --size 900", &["--size", "900", "WxH", "100 to 16384"]);
    fails(2, "view builtin:head:16 --size 900x7", &["--size", "900x7", "100 to 16384"]);
    fails(2, "view builtin:head:16 --screenshot out.jpg", &["out.jpg", ".jpg", ".png"]);
    fails(2, "view missing.nrrd", &["missing.nrrd"]);
    fails(2, "view builtin:head:16 --set splatting.slab_width=9", &["splatting.slab_width", "9", "[0.05, 8]"]);
    let refused = "--set splatting.rasterizer=quads --set splatting.footprint_box=parallelogram";
    fails(2, &format!("view builtin:head:16 {refused} --screenshot out.png"), &["splatting.rasterizer", "\"quads\""]);
    fails(1, "view builtin:head:16 --adapter nonesuch", &["nonesuch", "llvmpipe"]);
    fails(1, "view builtin:head:16 --screenshot missing/out.png", &["missing/out.png"]);
    let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().collect();
    assert!(left.is_empty(), "{left:?}");
}

#[test]
fn without_a_display_there_is_no_window() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = sheetsplat(folder.path(), "view builtin:head:16");
    command.env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY").env_remove("WAYLAND_SOCKET");
    assert_fails(command, 1, &["no window", "DISPLAY"]);
}
