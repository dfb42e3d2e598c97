//! Errors by cause: messages and exit codes.

use crate::*;

/// Asserts that a run fails, in a folder with a volume, some scenes, and an output file that must not change.
pub(crate) fn assert_fails(code: i32, arguments: &str, words: &[&str]) {
    let folder = Folder::new();
    folder.write_nrrd("good.nrrd", [2, 2, 2], [1.0, 1.0, 1.0], &[1.0; 8]);
    folder.write("unknown.toml", "[volume]\npath = \"good.nrrd\"\n[camera]\nzoom = 3\n");
    folder.write("gone.toml", "[volume]\npath = \"gone.nrrd\"\n");
    folder.write("syntax.toml", "[volume\npath = 3\n");
    folder.write("latin.toml", b"[volume]\npath = \"caf\xe9.nrrd\"\n");
    folder.write("empty.toml", "");
    folder.write("empty.nrrd", "");
    folder.write("short.nrrd", &folder.read("good.nrrd")[..120]);
    folder.write_nrrd("labels.nrrd", [2, 2, 2], [1.0, 1.0, 1.0], &[0.0, 1.0, 2.0, 3.0, 3.0, 3.0, 0.0, 0.0]);
    folder.write_nrrd("half.nrrd", [2, 2, 2], [1.0, 1.0, 1.0], &[0.0, 1.0, 2.0, 3.0, 3.0, 3.5, 0.0, 0.0]);
    folder.write_nrrd("larger.nrrd", [2, 2, 3], [1.0, 1.0, 1.0], &[0.0; 12]);
    folder.write_nrrd("longer.nrrd", [2, 2, 2], [1.0, 1.0, 3.0], &[0.0; 8]);
    folder.write("labelled.toml", "[volume]\npath = \"good.nrrd\"\n[[transfer.label]]\nlabel = 3\n");
    folder.write("picture.jpg", "not a volume");
    fs::create_dir(folder.path("folder.toml")).unwrap();
    fs::create_dir(folder.path("folder.nrrd")).unwrap();
    fs::create_dir(folder.path("folder.png")).unwrap();
    folder.write("out.png", "precious");
    let before = folder.names();
    folder.run(arguments).assert_failure(code, words);
    assert_eq!(folder.names(), before, "{arguments}: files");
    assert_eq!(folder.read("out.png"), b"precious", "{arguments}");
}

#[test]
fn bad_usage_is_2() {
    assert_fails(2, "render", &["INPUT", "--output"]);
    assert_fails(2, "render good.nrrd", &["--output"]);
    assert_fails(2, "render -o out.png", &["required"]);
    assert_fails(2, "paint good.nrrd -o out.png", &["paint", "--help"]);
    assert_fails(2, "render good.nrrd -o out.png --depth 12", &["--depth", "12", "8", "16"]);
    assert_fails(
        2,
        "render good.nrrd -o out.png --backend cuda",
        &["--backend", "cuda", "auto", "gpu", "cpu", "reference"],
    );
    assert_fails(2, "render good.nrrd -o out.png --frames 3", &["--frames"]);
    assert_fails(2, "render good.nrrd -o out.gif", &["out.gif", "\".gif\"", ".png", ".exr", ".npy"]);
    assert_fails(2, "render good.nrrd -o out", &["out: ", "none", ".png"]);
    assert_fails(2, "render good.nrrd -o .", &[".png"]);
    assert_fails(2, "render good.nrrd -o new.png --stats new.png", &["--stats", "new.png", "--output"]);
}

#[test]
fn bad_input_is_2() {
    assert_fails(2, "render gone.nrrd -o out.png", &["gone.nrrd", "No such file"]);
    assert_fails(2, "render missing.toml -o out.png", &["missing.toml", "No such file"]);
    assert_fails(2, "render gone.toml -o out.png", &["gone.nrrd", "No such file"]);
    assert_fails(2, "render unknown.toml -o out.png", &["unknown.toml", "camera.zoom", "unknown key", "direction"]);
    assert_fails(2, "render syntax.toml -o out.png", &["syntax.toml", "line 1"]);
    assert_fails(2, "render latin.toml -o out.png", &["latin.toml", "UTF-8"]);
    assert_fails(2, "render empty.toml -o out.png", &["empty.toml", "volume.path", "volume.builtin"]);
    assert_fails(2, "render folder.toml -o out.png", &["folder.toml", "directory"]);
    assert_fails(2, "render folder.nrrd -o out.png", &["folder.nrrd", "folder", "a volume file"]);
    assert_fails(2, "render empty.nrrd -o out.png", &["empty.nrrd", "magic", "NRRD0001"]);
    assert_fails(2, "render short.nrrd -o out.png", &["short.nrrd", "data", "32 bytes"]);
    assert_fails(2, "render picture.jpg -o out.png", &["picture.jpg", "\".jpg\"", ".nrrd"]);
    assert_fails(2, "render builtin:brain -o out.png", &["builtin:brain", "brain", "marschner-lobb"]);
    assert_fails(2, "render builtin:head:1 -o out.png", &["builtin:head:1", "size", "1024"]);
    assert_fails(2, "render builtin: -o out.png", &["builtin:", "head"]);
}

#[test]
fn a_bad_set_is_2() {
    let render = |set: &str, words: &[&str]| {
        assert_fails(2, &format!("render good.nrrd -o out.png --set {set}"), &[&["--set"], words].concat());
    };
    render("splatting.slab_width=9", &["splatting.slab_width", "9", "[0.05, 8]"]);
    render("splatting.slab_width=wide", &["splatting.slab_width", "wide", "[0.05, 8]"]);
    render("splatting.slabwidth=1", &["splatting.slabwidth", "unknown key", "slab_width"]);
    render("image.width=0", &["image.width", "0", "texture limit"]);
    render("image.width=-3", &["image.width", "-3"]);
    render("image.width=64.5", &["image.width", "64.5"]);
    render("camera.up=[0,1,0]", &["camera.up", "parallel"]);
    render("camera.direction=[0,0,0]", &["camera.direction"]);
    render("camera.height=inf", &["camera.height", "inf"]);
    render("camera.height=nan", &["camera.height", "nan"]);
    render("transfer.opacity=[[1,0],[0,1]]", &["transfer.opacity[1]"]);
    render("transfer.opacity=[]", &["transfer.opacity"]);
    render("nothing", &["nothing", "table.key=value"]);
    render("=3", &["table.key=value"]);
}

#[test]
fn bad_labels_are_2() {
    for backend in ["gpu", "cpu", "reference"] {
        let render = |input: &str, labels: &str, words: &[&str]| {
            let set = format!("--set volume.labels={labels} --backend {backend}");
            assert_fails(2, &format!("render {input} -o out.png {set}"), words);
        };
        render("good.nrrd", "half.nrrd", &["half.nrrd", "data", "3.5 at voxel [1, 0, 1]", "from 0 on"]);
        render("good.nrrd", "larger.nrrd", &["larger.nrrd", "sizes", "[2, 2, 3]", "[2, 2, 2]"]);
        render("good.nrrd", "longer.nrrd", &["longer.nrrd", "spacing", "3.0", "[1.0, 1.0, 1.0]"]);
        render("labelled.toml", "gone.nrrd", &["gone.nrrd", "No such file"]);
        render("builtin:head:16", "labels.nrrd", &["labels.nrrd", "sizes", "[2, 2, 2]", "[16, 16, 10]"]);
        let without = format!("render labelled.toml -o out.png --backend {backend}");
        assert_fails(2, &without, &["labelled.toml", "transfer.label", "without labels", "volume.labels"]);
    }
    assert_fails(
        2,
        "render builtin:cube -o out.png --set transfer.label=[{label=1}]",
        &["--set", "transfer.label", "volume.labels"],
    );
}

#[test]
fn an_image_beyond_the_texture_limit_is_2() {
    let render = |set: &str, words: &[&str]| {
        assert_fails(2, &format!("render good.nrrd -o out.png {set}"), words);
    };
    render("--set image.width=100000", &["good.nrrd", "image.width", "100000", "max_texture_dimension_2d"]);
    render("--set image.height=4294967295", &["image.height", "4294967295", "max_texture_dimension_2d"]);
    render("--set image.height=4294967296", &["image.height", "4294967296"]);
    render("--set image.width=4294967295 --backend reference", &["good.nrrd", "image.width", "4294967295"]);
}

#[test]
fn other_failures_are_1() {
    assert_fails(1, "render good.nrrd -o out.png --adapter Voodoo", &["Voodoo", "required", "actual"]);
    let small = "render good.nrrd --set image={width=8,height=8}";
    assert_fails(2, &format!("{small} -o no/such/folder/out.png"), &["the folder no/such/folder: No such file"]);
    assert_fails(1, &format!("{small} -o folder.png"), &["folder.png", "directory"]);
    assert_fails(2, &format!("{small} -o good.nrrd/out.png"), &["good.nrrd/out.png"]);
    // Either both files are written or neither.
    assert_fails(
        2,
        &format!("{small} -o new.png --stats no/stats.json"),
        &["no/stats.json", "the folder no: No such file"],
    );
    assert_fails(1, &format!("{small} -o new.png --stats folder.png"), &["folder.png", "directory"]);
    assert_fails(2, &format!("{small} -o no/new.png --stats stats.json"), &["no/new.png", "No such file"]);
}

#[test]
fn spacings_out_of_range_are_2() {
    for (spacing, words) in [
        ("[1e-300,1e-300,1e-300]", ["volume.spacing[0]", "1e-300", "1e-100"]),
        ("[1,1e300,1e300]", ["volume.spacing[1]", "1e300", "1e100"]),
        ("[1,1,1e6]", ["volume.spacing", "1000000.0", "10000 times"]),
    ] {
        let arguments = format!("render good.nrrd -o out.png --set volume.spacing={spacing}");
        assert_fails(2, &arguments, &[&["--set"][..], &words].concat());
    }
}

/// Each value is allowed by itself, but together they exceed what floats and memory can hold.
#[test]
fn values_beyond_any_renderer_are_2() {
    for backend in ["gpu", "cpu", "reference"] {
        let render = |sets: &str, words: &[&str]| {
            let arguments = format!("render good.nrrd -o out.png --backend {backend} {sets}");
            assert_fails(2, &arguments, &[&["good.nrrd"], words].concat());
        };
        render("--set camera.height=1e-300", &["camera.height", "1e-300", "5.12e-23"]);
        render("--set camera.height=1e300", &["camera.height", "1e300", "5.12e27"]);
        let deep = "--set camera.direction=[0,1,0] --set volume.spacing=[1,1e4,1] --set splatting.slab_width=0.05";
        render(deep, &["splatting.slab_width", "0.05", "65536 slabs"]);
        let perspective =
            |sets: &str, words: &[&str]| render(&format!("--set camera.projection=perspective {sets}"), words);
        perspective("--set camera.near=1e-300", &["camera.near", "1e-300", "9.6e-23"]);
        perspective("--set camera.near=1e300", &["camera.near", "1e300", "9.6e27"]);
        perspective("--set camera.distance=1e300", &["camera.distance", "1e300"]);
        perspective("--set camera.distance=1e12", &["camera.distance", "1e12", "slabs"]);
        perspective("--set camera.fov_y=1e-12", &["camera.distance", "slabs"]);
        perspective(deep, &["splatting.slab_width", "0.05", "65536 slabs"]);
    }
}

/// The driver's textures cannot be that large.
#[test]
fn a_device_that_fails_is_1() {
    let set = "--set image.width=16384 --set image.height=16384 --set splatting.rasterizer=\"quads\"";
    let arguments = format!("render good.nrrd -o out.png --adapter llvmpipe {set}");
    assert_fails(1, &arguments, &["the device is out of memory", "sheetsplat.sheets"]);
}

/// The loader finds no driver.
#[cfg(target_os = "linux")]
#[test]
fn without_a_driver_the_error_says_what_to_install() {
    let folder = Folder::new();
    let nowhere = ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"].map(|variable| (variable, "/nonexistent.json"));
    let run = folder.run_with(&nowhere, "", "render builtin:cube:8 -o a.png");
    run.assert_failure(1, &["no GPU adapter", "actual: none", "install", "lavapipe"]);
    assert!(folder.names().is_empty());
}

/// Names and texts of files reach the terminal with their control characters escaped: in errors, warnings, and what `info` tells.
#[test]
fn terminals_obey_no_file() {
    let folder = Folder::new();
    let nrrd = |fields: &str| {
        format!(
            "NRRD0005\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nencoding: raw\n{fields}\n\n\u{1}\u{2}\u{3}\u{4}\u{5}\u{6}\u{7}\u{8}"
        )
    };
    let spaces = "space dimension: 3\nspace directions: (1,0,0) (0,1,0) (0,0,1)\nspace units: \"mm\u{1b}[2J\" \"mm\u{1b}[2J\" \"mm\u{1b}[2J\"";
    folder.write("unit.nrrd", nrrd(spaces));
    folder.write("field.nrrd", nrrd("thick\u{1b}ness: 3\nsizes: 2\u{1b} 2 2"));
    folder.write("data.nhdr", nrrd("data file: gone\u{1b}[31m.raw"));
    folder.write("syntax.toml", "volume.path = 'a.nrrd'\ncamera = \u{1b}[31m\n");
    folder.write("line.toml", format!("volume.path = 'a.nrrd'\ncamera = {}\n", "x".repeat(1 << 20)));
    folder.write("key.toml", "volume.path = 'a.nrrd'\n\"cam\\u001bera\" = 3\n");
    folder.write("value.toml", "volume.path = 'a.nrrd'\nsplatting.order = \"front\\u001b\\nsheetsplat: forged\"\n");
    folder.write("path.toml", "volume.path = \"gone\\u001b[31m.nrrd\"\n");
    folder.write("long.toml", format!("volume.path = \"{}\"\n", "gone".repeat(1 << 18)));
    for name in [
        "unit.nrrd",
        "field.nrrd",
        "data.nhdr",
        "syntax.toml",
        "key.toml",
        "value.toml",
        "path.toml",
        "line.toml",
        "long.toml",
    ] {
        for arguments in
            [format!("info {name}"), format!("info {name} --json"), format!("render {name} -o a.png --backend cpu")]
        {
            let Run { stdout, stderr, .. } = folder.run(&arguments);
            for text in [&stdout, &stderr] {
                assert!(!text.contains(|c: char| c.is_control() && c != '\n'), "{arguments}: {text:?}");
                assert!(text.len() < 8000, "{arguments}: {} bytes", text.len());
                assert!(!text.lines().any(|line| line == "sheetsplat: forged"), "{arguments}: {text:?}");
            }
        }
    }
}

/// A folder that takes no files is found before anything is read or drawn.
#[cfg(target_os = "linux")]
#[test]
fn folders_that_take_no_files_are_2() {
    let folder = Folder::new();
    for arguments in
        ["render gone.nrrd -o /proc/e.png", "render builtin:cube:8 -o a.png --stats /proc/s.json --adapter nonesuch"]
    {
        folder.run(arguments).assert_failure(2, &["/proc/", "the folder /proc: "]);
    }
    folder.run("orbit builtin:cube:8 -o /proc/%d.png --adapter nonesuch").assert_failure(2, &["the folder /proc: "]);
    assert!(folder.names().is_empty());
}

/// What a small scene file may cost is limited.
#[test]
fn scenes_are_limited() {
    let folder = Folder::new();
    let scene = |rest: &str| format!("[volume]\nbuiltin = \"head:16\"\n[image]\nwidth = 8\nheight = 8\n{rest}\n");
    let refused = |name: &str, options: &str, words: &[&str]| {
        let run = folder.run(format!("render {name} -o a.png --backend cpu {options}").trim());
        run.assert_failure(2, &[&[name][..], words].concat());
        assert!(run.stderr.len() < 2000);
    };
    let list = |count: usize, item: &dyn Fn(usize) -> String| (0..count).map(item).collect::<Vec<_>>().join(",");
    let range = |at: usize| format!("[{at},{at}.5]");
    let point = |at: usize| format!("[{at},{}]", at % 2);
    let color = |at: usize| format!("[{at},[0,0,0]]");
    for (count, key, text) in [
        (4097, "iso_ranges", list(4097, &range)),
        (4097, "opacity", list(4097, &point)),
        (4097, "gradient_opacity", list(4097, &point)),
        (65_537, "color", list(65_537, &color)),
    ] {
        folder.write("long.toml", scene(&format!("[transfer]\n{key} = [{text}]")));
        let allowed = format!("allowed: at most {} entries, not {count}", count - 1);
        refused("long.toml", "", &[&format!("transfer.{key}: found ["), &allowed]);
    }
    // A ramp that all labels share counts for each of them.
    let labels: String = (0..600).map(|label| format!("[[transfer.label]]\nlabel = {label}\n")).collect();
    folder.write(
        "labels.toml",
        scene(&format!("[transfer]\nopacity = [{}]\n{labels}", list(4000, &|at| format!("[{at},0.5]")))),
    );
    refused(
        "labels.toml",
        "",
        &["transfer: found tables of ", " pieces, those of labels included, allowed: at most 524288"],
    );
    // Text takes memory, too.
    folder.write("text.toml", scene(&format!("# {}", "x".repeat(100_000))));
    refused("text.toml", "--memory 10MiB", &["size: found ", " bytes of a scene, which take "]);
    folder.run("render text.toml -o a.png --backend cpu --memory 100MiB").assert_success();
    folder.write("huge.toml", scene(&format!("# {}", "x".repeat(16 << 20))));
    refused("huge.toml", "", &["size: found more than 16777216 bytes, allowed: at most 16777216 bytes"]);
}
