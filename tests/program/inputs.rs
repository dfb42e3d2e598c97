//! Inputs: volume files by name or by arguments, and the side from which they are seen.

use crate::*;

const SIZE: &str = "--set image.width=16 --set image.height=12";

/// `--view front` of the patients below.
const FRONT: &str = "--set camera.direction=[0,0,-1] --set camera.up=[0,1,0]";

/// The same volume twice: x runs to the patient's left, y to the head, z to the front; unknown.
fn with_patients() -> Folder {
    let folder = Folder::new();
    let values: Vec<u8> = (0..60).map(|i| (i * 4) as u8).collect();
    let axes = "space: LPS\nspace directions: (1,0,0) (0,0,2) (0,-1,0)";
    let write = |name: &str, axes: &str| {
        let header = format!("NRRD0004\ntype: uint8\ndimension: 3\nsizes: 5 4 3\n{axes}\nencoding: raw\n\n");
        folder.write(name, [header.as_bytes(), &values].concat());
    };
    write("lying.nrrd", axes);
    write("nowhere.nrrd", "spacings: 1 2 1");
    folder
}

#[test]
fn views_are_the_anatomys() {
    let folder = with_patients();
    let (size, front) = (SIZE, FRONT);
    let plain = folder.pixels(&format!("nowhere.nrrd {size} {front}"));
    assert_eq!(folder.pixels(&format!("lying.nrrd {size} --view front")), plain);
    assert_eq!(folder.pixels(&format!("lying.nrrd {size} --view front --set camera.direction=[1,0,0]")), plain);
    assert_ne!(folder.pixels(&format!("lying.nrrd {size} --view back")), plain);
    let found = ["nowhere.nrrd", "--view", "no orientation", "camera.direction"];
    folder.run(&format!("render nowhere.nrrd {size} --view front -o out.png")).assert_failure(2, &found);
    folder
        .run(&format!("render lying.nrrd {size} --view above -o out.png"))
        .assert_failure(2, &["above", "top, bottom"]);
}

/// Frames, tiles and times start from the same view as a picture.
#[test]
fn every_subcommand_takes_views() {
    let folder = with_patients();
    let orbit = |name: &str, arguments: &str| {
        folder.run(&format!("orbit {arguments} {SIZE} {WHOLE} --count 3 -o {name}-%d.npy")).assert_success();
        [0, 1, 2].map(|frame| folder.read_npy(&format!("{name}-{frame}.npy")))
    };
    let frames = orbit("view", "lying.nrrd --view front");
    assert_eq!(frames, orbit("camera", &format!("nowhere.nrrd {FRONT}")));
    assert_eq!(frames[0], folder.pixels(&format!("lying.nrrd {SIZE} {WHOLE} --view front")));

    let swept = "--set splatting.slab_width=1,2";
    let sweep = |arguments: &str| {
        let run = folder.run(&format!("sweep {arguments} {SIZE} -o sheet.npy"));
        run.assert_success();
        folder.read_npy("sheet.npy")
    };
    let sheet = sweep(&format!("nowhere.nrrd {FRONT} {swept}"));
    assert_eq!(sweep(&format!("lying.nrrd --view front {swept}")), sheet);
    let both = "--view front --set camera.up=[0,0,1],[1,0,0]";
    folder.run(&format!("sweep lying.nrrd {both} -o out.npy")).assert_failure(2, &["--view", "camera.up"]);

    let found = ["nowhere.nrrd", "--view", "no orientation"];
    folder.run("bench nowhere.nrrd --view front").assert_failure(2, &found);
}

#[test]
fn raw_files_are_what_the_arguments_say() {
    let folder = Folder::new();
    let values: Vec<f32> = (0..60).map(|i| (i * 4) as f32).collect();
    folder.write_nrrd("a.nrrd", [5, 4, 3], [1.0, 1.0, 2.0], &values);
    folder.write("a.raw", values.iter().flat_map(|&value| (value as u16).to_be_bytes()).collect::<Vec<u8>>());
    let size = format!("{SIZE} {WHOLE}");
    let plain = folder.pixels(&format!("a.nrrd {size}"));
    let raw = format!("a.raw {size} --type uint16 --endian big --spacing 1,1,2");
    for dims in ["5,4,3", "5x4x3"] {
        assert_eq!(folder.pixels(&format!("{raw} --dims {dims}")), plain);
    }
    assert_eq!(
        folder.pixels(&format!("{raw} --dims 5,4,2 --offset 40 --set volume.offset=0 --set volume.dims=[5,4,3]")),
        plain
    );
    folder.run(&format!("orbit {raw} --dims 5,4,3 --count 1 -o frame-%d.npy")).assert_success();
    assert_eq!(folder.read_npy("frame-0.npy"), plain);
    let refused = |arguments: &str, words: &[&str]| {
        folder.run(&format!("render {arguments} -o out.png")).assert_failure(2, words);
    };
    refused(&format!("a.raw {size}"), &["a.raw", "format", "\".raw\"", "volume.dims"]);
    refused(&raw, &["--dims: found no such key"]);
    refused(&format!("{raw} --dims 5,4"), &["--dims: found [5, 4]", "three positive integers"]);
    refused(&format!("{raw} --dims 5,4,2"), &["a.raw", "data", "120 bytes", "80 bytes"]);
    refused("a.raw --dims 5,4,3 --type half", &["--type: found \"half\"", "uint16"]);
}

/// Where a file states nothing, or nothing valid, a warning says what is assumed.
#[test]
fn warnings_state_what_is_assumed() {
    let folder = Folder::new();
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures");
    let warned = |input: &str, words: &str| {
        let run = folder.run(&format!("render {input} {SIZE} -o out.npy"));
        run.assert_success();
        assert!(run.stderr.contains(words), "{}", run.stderr);
    };
    let fixture = |name: &str| fixtures.join(name).display().to_string();
    warned(&fixture("plain.tif"), "plain.tif: no distance between slices is given: taken to be 0.5 mm");
    let movie = fs::read(fixture("imagej.tif")).unwrap();
    let at = movie.windows(8).position(|window| window == b"slices=3").unwrap();
    folder.write("movie.tif", [&movie[..at], b"frames=3", &movie[at + 8..]].concat());
    warned("movie.tif", "movie.tif: the description says 3 frames: taken to be slices");
    warned(&fixture("series/IM1"), "IM1: one slice; a folder with all slices of a series is read as one volume");

    // The middle slice is displaced by a twentieth of a step.
    fs::create_dir(folder.path("series")).unwrap();
    for name in ["IM1", "IM2", "IM3.dcm"] {
        fs::copy(fixtures.join("series").join(name), folder.path("series").join(name)).unwrap();
    }
    let slice = folder.read("series/IM3.dcm");
    let position = b"DS\x10\x0012.0\\-21.5\\32.0  ";
    let at = slice.windows(position.len()).position(|window| window == position).unwrap();
    let shifted = [&slice[..at], b"DS\x10\x0012.1\\-21.55\\32.1 ", &slice[at + position.len()..]].concat();
    folder.write("series/IM3.dcm", shifted);
    warned(
        "series",
        "series: slices are not evenly spaced: taken to be 3.0000 mm apart, which is wrong by up to 0.1500 mm",
    );

    // One number is missing.
    fs::create_dir(folder.path("slices")).unwrap();
    for (from, to) in [(8, 8), (9, 9), (10, 11)] {
        let from = fixtures.join(format!("slices/z{from}.tif"));
        fs::copy(from, folder.path(&format!("slices/z{to}.tif"))).unwrap();
    }
    warned("slices", "slices: the slices' numbers go up by [1, 2]: they are treated as neighbours");
}

/// The program reports the number of holes once, whatever it does with the volume; a volume of only holes is bad input.
#[test]
fn holes_are_reported_once() {
    let folder = Folder::new();
    let values: Vec<f32> = (0..60).map(|at| if at % 20 == 7 { f32::NAN } else { (at * 4) as f32 }).collect();
    folder.write_nrrd("a.nrrd", [5, 4, 3], [1.0; 3], &values);
    let note = "a.nrrd: 3 of 60 samples are NaN or infinite: these holes are not drawn";
    for command in [
        format!("render a.nrrd {SIZE} -o out.npy"),
        format!("orbit a.nrrd {SIZE} --count 3 -o out-%d.npy"),
        format!("sweep a.nrrd {SIZE} --set splatting.slab_width=1,2 -o out.npy"),
        format!("bench a.nrrd {SIZE} --frames 1 --rotate 5"),
        "info a.nrrd".to_owned(),
    ] {
        let run = folder.run(&command);
        assert_eq!(run.code, Some(0), "{command}\n{}", run.stderr);
        assert_eq!(run.stderr.matches(note).count(), 1, "{command}\n{}", run.stderr);
        let quiet = folder.run(&format!("{command} --quiet"));
        assert_eq!((quiet.code, quiet.stderr.contains("hole")), (Some(0), false), "{command}\n{}", quiet.stderr);
    }
    let (_, _, pixels) = folder.pixels(&format!("a.nrrd {SIZE} --backend reference"));
    assert!(pixels.as_flattened().iter().all(|channel| channel.is_finite()));
    folder.write_nrrd("b.nrrd", [2, 1, 1], [1.0; 3], &[f32::NAN, f32::NEG_INFINITY]);
    for command in ["render b.nrrd -o b.png", "info b.nrrd"] {
        folder.run(command).assert_failure(2, &["b.nrrd", "data", "NaN or infinite", "at least one finite sample"]);
    }
    assert!(!folder.names().contains("b.png"));
}

#[test]
fn every_subcommand_confines_what_it_reads() {
    let folder = with_patients();
    fs::create_dir(folder.path("in")).unwrap();
    fs::copy(folder.path("nowhere.nrrd"), folder.path("in/good.nrrd")).unwrap();
    folder.write("in/scene.toml", "volume.path = '../nowhere.nrrd'");
    folder.write("scene.toml", "volume.path = 'in/good.nrrd'");
    folder.render(&format!("in/good.nrrd {SIZE} --confine in -o good.npy"));
    folder.render(&format!("in/scene.toml {SIZE} -o good.npy"));
    let words =
        ["nowhere.nrrd: file: found a path that leads elsewhere", "files within in, to which reading is confined"];
    for (command, output) in [("render", "-o a.npy"), ("orbit", "-o a-%d.npy"), ("bench", ""), ("info", "")] {
        for input in ["in/scene.toml", "nowhere.nrrd"] {
            let run = folder.run(format!("{command} {input} --confine in {output}").trim_end());
            run.assert_failure(2, &words);
        }
        let scene = folder.run(format!("{command} scene.toml --confine in {output}").trim_end());
        scene.assert_failure(2, &["scene.toml: file: found a path that leads elsewhere"]);
    }
    let sweep = "sweep in/scene.toml --confine in -o a.npy --set splatting.slab_width=1,2";
    folder.run(sweep).assert_failure(2, &words);
    folder.run("render in/good.nrrd --confine nothing -o a.npy").assert_failure(2, &["nothing: No such file"]);
    assert!(!folder.path("a.npy").exists());
}

#[test]
fn memory_has_a_limit() {
    let folder = with_patients();
    folder.render(&format!("nowhere.nrrd {SIZE} --memory 60 -o good.npy"));
    let words = ["nowhere.nrrd: data: found 5 × 4 × 3 voxels, which take 60 bytes", "the memory limit of 59 bytes"];
    folder.run("render nowhere.nrrd --memory 59B -o a.npy").assert_failure(2, &words);
    let words = ["builtin:cube:1024", "4294967296 bytes", "the memory limit of 2147483648 bytes"];
    folder.run("info builtin:cube:1024 --memory 2GiB").assert_failure(2, &words);
    folder.run("info nowhere.nrrd --memory 2XB").assert_failure(2, &["--memory", "2XB", "such as 2GiB"]);
    // The header claims far more than the file holds, and than any machine has.
    let header = "NRRD0004\ntype: float\nendian: little\ndimension: 3\nsizes: 1600 1600 1600\nencoding: bzip2\n\n";
    folder.write("bomb.nrrd", header);
    let words = [
        "bomb.nrrd: data: found 1600 × 1600 × 1600 voxels",
        "16384000000 bytes",
        "the memory limit of 8000000000 bytes",
    ];
    folder.run("info bomb.nrrd --memory 8GB").assert_failure(2, &words);
}

/// Each value has the file's colour, whatever the range of visible values.
#[test]
fn a_files_palette_is_a_colour_map() {
    let folder = Folder::new();
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures");
    let (palette, gray) = (fixtures.join("palette.tif"), fixtures.join("packbits.tif"));
    let scene = |name: &str, colormap: &str| {
        folder.render(&format!("{name} {SIZE}{colormap} -o out.npy --save-scene out.toml"));
        String::from_utf8(folder.read("out.toml")).unwrap()
    };
    let saved = scene(&palette.display().to_string(), " --colormap file");
    let color = |value: f64| format!("[{value:.1}, [{}, {}, 0.2]]", value / 255.0, (255.0 - value) / 255.0);
    for value in [51.0, 102.0, 204.0] {
        assert!(saved.contains(&color(value)), "no {} in {saved}", color(value));
    }
    assert_eq!(scene(&palette.display().to_string(), " --set transfer.colormap=file"), saved);
    let without = |saved: &str| saved.lines().filter(|line| !line.starts_with("path")).collect::<Vec<_>>().join("\n");
    let [plain, other] = [&palette, &gray].map(|path| without(&scene(&path.display().to_string(), "")));
    assert_eq!(plain, other, "the default stays");
    let words = ["packbits.tif", "transfer.colormap", "file, for a volume without a palette", "another colour map"];
    let gray = format!("render {} --colormap file -o a.npy", gray.display());
    folder.run(&gray).assert_failure(2, &words);
}

/// A volume file from standard input is read as one from the disk; what is none is refused, and so is another file beside it.
#[test]
fn standard_input_is_a_volume_file() {
    let folder = Folder::new();
    let run = |input: &str, arguments: &str| {
        let file = std::fs::File::open(folder.path(input)).unwrap();
        folder.command(arguments).stdin(file).output().unwrap()
    };
    let values: Vec<f32> = (0..60).map(|at| at as f32).collect();
    folder.write_nrrd("a.nrrd", [5, 4, 3], [1.0, 2.0, 3.0], &values);
    let output = run("a.nrrd", "info - --json");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let info: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&info["dims"], &info["format"]), (&serde_json::json!([5, 4, 3]), &Value::from("NRRD")));
    assert_eq!([&info["min"], &info["max"]], [0.0, 59.0]);
    folder.pixels("a.nrrd --size 16 --backend cpu");
    assert!(run("a.nrrd", "render - --size 16 --backend cpu -o piped.npy").status.success());
    assert_eq!(folder.read("piped.npy"), folder.read("pixels.npy"));
    folder.write("text", b"no volume");
    let refused = [
        ("text", "info -", "-: format: found none"),
        ("a.nrrd", "info - --memory 100", "standard input: more than the memory limit of 100 bytes"),
        ("a.nrrd", "info - --set volume.labels=a.nrrd", "no such file among those given: -"),
    ];
    for (input, arguments, words) in refused {
        let output = run(input, arguments);
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments}: {message}");
        assert!(message.contains(words), "{arguments}: {message}");
    }
}
