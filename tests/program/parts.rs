//! `sheetsplat render --slabs --region`, `merge` and `split`.

use std::path::Path;
use std::process::Command;

use sheetsplat::Image;

use crate::*;

/// A scene of few pixels and many slabs.
const SCENE: &str = "builtin:head:24 --backend cpu --set image={width=40,height=30,background=[0.1,0.2,0.3,1]} \
                     --set splatting.opacity_threshold=1 --set transfer.opacity=[[0,0],[60,0.1],[200,0.5]]";

impl Folder {
    /// Draws every line of `split` as a part, and returns the names of their files.
    fn draw_split(&self, count: u32) -> Vec<String> {
        let split = self.run(&format!("split {SCENE} -n {count}"));
        assert_eq!(split.code, Some(0), "{}", split.stderr);
        let part = |(at, line): (usize, &str)| {
            let name = format!("part-{at:02}.exr");
            self.render(&format!("{SCENE} -o {name} {line}"));
            name
        };
        split.stdout.lines().enumerate().map(part).collect()
    }
}

#[test]
fn parts_of_split_merge_into_the_image() {
    let folder = Folder::new();
    let parts = folder.draw_split(7);
    assert_eq!(parts.len(), 7);
    folder.render(&format!("{SCENE} -o whole.exr"));
    folder.run(&format!("merge {} -o merged.exr", parts.join(" "))).assert_success();
    let open = |name: &str| Image::open(&folder.path(name)).unwrap();
    let (merged, whole) = (open("merged.exr"), open("whole.exr"));
    let difference = common::images::largest_difference(&merged, &whole);
    assert_at_most(difference, 1e-6, "7 parts");
    // The f64 evaluation draws the same scene, so its parts merge with the others.
    let [region, slabs] = ["--region 0,0,40,30", "--slabs -3..900"];
    folder.render(&format!("{SCENE} -o front.exr {region} --slabs -900..-3"));
    let reference = SCENE.replace("--backend cpu", "--backend reference");
    folder.render(&format!("{reference} -o back.exr {slabs}"));
    folder.run("merge back.exr front.exr -o merged.exr --quiet").assert_success();
    assert_at_most(common::images::largest_difference(&open("merged.exr"), &whole), 1e-4, "by two backends");

    let refused =
        |files: &str, message: &str| folder.run(&format!("merge {files} -o refused.png")).assert_failure(2, &[message]);
    refused(&parts[1..].join(" "), "parts: found none with ");
    refused(&format!("{} {}", parts.join(" "), parts[0]), "also shows");
    folder.render(&format!("{SCENE} -o other.exr {region} --slabs -900..-3 --set splatting.order=back-to-front"));
    refused("back.exr other.exr", "other.exr: order: found back-to-front, allowed: front-to-back, as in back.exr");
    folder.render(&format!("{SCENE} -o other.exr {region} --slabs -900..-3 --set shading.ambient=0.3 --overwrite"));
    refused("back.exr other.exr", "other.exr: scene: found ");
    refused("back.exr missing.exr", "missing.exr: ");
    refused("whole.exr", "whole.exr: part: found ");
    refused("back.exr front.png", "front.png: extension: found \".png\"");
    assert!(!folder.path("refused.png").exists());
}

/// As `orbit`'s frames are.
#[test]
fn parts_that_exist_are_not_drawn_again() {
    let folder = Folder::new();
    let part = format!("{SCENE} -o part.exr --slabs -9..4");
    folder.render(&part);
    let first = folder.read("part.exr");
    let time = || fs::metadata(folder.path("part.exr")).unwrap().modified().unwrap();
    let old = time();
    let again = |arguments: &str| {
        let run = folder.run(format!("render {part} {arguments}").trim());
        run.assert_success();
        run.stderr.contains("part.exr: kept, drawn before\n")
    };
    assert!(again("") && again("--set splatting.rasterizer=quads"));
    assert_eq!((time(), folder.read("part.exr")), (old, first.clone()));
    assert!(!again("--overwrite"));
    // Names are not believed: empty and damaged parts are drawn again, and those of other scenes, volumes, slabs and pixels.
    let mut damaged = first.clone();
    let last = damaged.len() - 20;
    damaged[last] ^= 1;
    for bytes in [&b""[..], b"not a part", &first[..first.len() / 2], &damaged] {
        folder.write("part.exr", bytes);
        assert!(!again(""), "{} bytes", bytes.len());
        assert_eq!(folder.read("part.exr"), first);
    }
    for other in ["--set shading.ambient=0.3", "--set volume.builtin=head:25", "--region 0,0,40,29"] {
        assert!(!again(other), "{other}");
        assert_ne!(folder.read("part.exr"), first, "{other}");
        assert!(!again("") && folder.read("part.exr") == first, "{other}");
    }
    assert_eq!(folder.names().len(), 1);
}

#[test]
fn what_has_no_parts_is_refused() {
    let folder = Folder::new();
    for (arguments, message) in [
        ("-o part.png --slabs 0..3", "part.png: extension: found \".png\", allowed: .exr or .npz"),
        ("-o part.npy --region 0,0,4,4", "part.npy: extension: found \".npy\", allowed: .exr or .npz"),
        (
            "-o part.exr --region 30,0,11,4",
            "region: found 30,0,11,4, allowed: X,Y,W,H of at least one pixel within the image of 40×30",
        ),
        (
            "-o part.exr --slabs 0..3 --set splatting.method=axis-aligned",
            "splatting.method: found \"axis-aligned\" for a part",
        ),
        ("-o part.exr --slabs 0..3 --annotate scale", "--annotate: found it with --slabs or --region"),
        ("-o part.exr --slabs 3..0", "A..B"),
        ("-o part.exr --region 1,2,3", "X,Y,W,H"),
        ("-o part.exr --overwrite", "--overwrite"),
    ] {
        folder.run(&format!("render {SCENE} {arguments}")).assert_failure(2, &[message]);
    }
    folder.run(&format!("split {SCENE} -n 0")).assert_failure(2, &["0"]);
    assert!(folder.names().is_empty(), "{:?}", folder.names());
}

/// The example for `make` draws the image, and draws nothing again that is there.
#[test]
fn make_draws_parts() {
    let folder = Folder::new();
    let text =
        "[volume]\nbuiltin = \"head:24\"\n[image]\nwidth = 40\nheight = 30\n[splatting]\nopacity_threshold = 1\n";
    std::fs::write(folder.path("scene.toml"), text).unwrap();
    let rules = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/parts.mk");
    let make = || {
        let mut make = Command::new("make");
        make.current_dir(folder.path("")).arg("-f").arg(&rules).arg("IMAGE=made.exr").arg("PARTS=5");
        let made = make.arg(concat!("SHEETSPLAT=", env!("CARGO_BIN_EXE_sheetsplat"))).output().unwrap();
        assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
        String::from_utf8(made.stdout).unwrap()
    };
    assert_eq!(make().matches(" render ").count(), 5);
    assert_eq!(make().matches("sheetsplat ").count(), 0);
    folder.render("scene.toml -o whole.exr --backend cpu");
    let open = |name: &str| Image::open(&folder.path(name)).unwrap();
    let difference = common::images::largest_difference(&open("made.exr"), &open("whole.exr"));
    assert_at_most(difference, 1e-6, "make");
}
