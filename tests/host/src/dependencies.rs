//! The dependencies of an application that embeds the library.

use std::process::Command;

#[test]
fn neither_command_line_nor_codecs_nor_windows() {
    let tree = Command::new(env!("CARGO"))
        .args(["tree", "--offline", "--locked", "-p", "sheetsplat-host", "-e", "normal", "--prefix", "none"])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    let names = String::from_utf8(tree.stdout).unwrap();
    let names: Vec<&str> = names.lines().filter_map(|line| line.split_whitespace().next()).collect();
    assert!(names.contains(&"sheetsplat") && names.contains(&"wgpu"), "{names:?} {:?}", tree.stderr);
    for unwanted in [
        "clap",
        "env_logger",
        "serde_json",
        "image",
        "png",
        "exr",
        "npyz",
        "jpeg-decoder",
        "tempfile",
        "tiff",
        "winit",
        "minifb",
    ] {
        assert!(!names.contains(&unwanted), "{unwanted} is compiled into an application that did not ask for it");
    }
}
