//! Pictures that tell how they were made, and `sheetsplat verify`.

use std::io::{Cursor, Write};

use serde_json::json;
use sheetsplat::Volume;
use sheetsplat::headless::{Backend, Headless, HeadlessOptions};
use sheetsplat::image::PngDepth;
use sheetsplat::provenance::{Provenance, Sources, Verifier};
use sheetsplat::scene::OpenVolume;
use sheetsplat::volume::Inputs;

use crate::common::cases::cases;
use crate::common::random_scene::Case;
use crate::streaming::write_ball;
use crate::*;

/// The keyword of the text in PNG files.
const KEYWORD: &str = "sheetsplat picture";

/// A camera and a size that make small pictures of small volumes.
const LOOK: &str = "--size 24x20 --backend cpu --set transfer.opacity=[[0,0],[7,0.5]]";

/// A PNG's pixels, and its texts.
fn decoded(bytes: &[u8]) -> (png::Info<'static>, Vec<u8>) {
    let mut reader = png::Decoder::new(Cursor::new(bytes)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut pixels).unwrap();
    (reader.info().clone(), pixels)
}

/// The text of a picture; `None` if it has none.
fn told(bytes: &[u8]) -> Option<Value> {
    let (info, _) = decoded(bytes);
    let chunk = info.utf8_text.iter().find(|chunk| chunk.keyword == KEYWORD)?;
    Some(serde_json::from_str(&chunk.get_text().unwrap()).unwrap())
}

/// The same picture with another text, behind its pixels as other programs write it, or other pixels.
fn rewritten(bytes: &[u8], text: &str, change: impl FnOnce(&mut [u8])) -> Vec<u8> {
    let (info, mut pixels) = decoded(bytes);
    change(&mut pixels);
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, info.width, info.height);
    encoder.set_color(info.color_type);
    encoder.set_depth(info.bit_depth);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&pixels).unwrap();
    let mut compressed = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
    compressed.write_all(text.as_bytes()).unwrap();
    // Compressed, by zlib, in no language, without a translated keyword.
    let chunk = [KEYWORD.as_bytes(), b"\0\x01\0\0\0", &compressed.finish().unwrap()].concat();
    writer.write_chunk(png::chunk::iTXt, &chunk).unwrap();
    writer.finish().unwrap();
    file
}

/// A text with its hash.
fn sealed(mut text: Value) -> String {
    text["check"] = json!("");
    let made: Provenance = serde_json::from_value(text.clone()).unwrap();
    text["check"] = json!(blake3::hash(serde_json::to_string(&made).unwrap().as_bytes()).to_hex().to_string());
    text.to_string()
}

impl Folder {
    /// Asserts that a picture, or several, are the same.
    fn assert_verified(&self, arguments: &str) {
        let run = self.run(&format!("verify {arguments}"));
        assert_eq!(run.code, Some(0), "{arguments}\n{}{}", run.stdout, run.stderr);
        assert!(run.stdout.contains(": the same "), "{}", run.stdout);
    }

    /// Asserts an exit code, and words of the report.
    fn assert_unverified(&self, arguments: &str, code: i32, words: &[&str]) {
        let run = self.run(&format!("verify {arguments}"));
        assert_eq!(run.code, Some(code), "{arguments}\n{}{}", run.stdout, run.stderr);
        for word in words {
            assert!(run.stdout.contains(word), "{arguments}: no {word:?} in\n{}", run.stdout);
        }
    }

    /// A small volume whose values differ in every direction.
    fn write_small(&self, name: &str) {
        let values: Vec<f32> = (0..5 * 6 * 7).map(|at| ((at * at) % 11) as f32).collect();
        self.write_nrrd(name, [5, 6, 7], [1.0, 1.5, 1.0], &values);
    }

    /// Changes a byte of a file.
    fn change(&self, name: &str, at: usize) {
        let mut bytes = self.read(name);
        bytes[at] ^= 1;
        self.write(name, bytes);
    }
}

#[test]
fn pictures_are_the_same_when_they_are_drawn_again() {
    let folder = Folder::new();
    folder.write_small("a.nrrd");
    for (name, rest) in [
        ("8.png", "--depth 8"),
        ("16.png", "--depth 16"),
        ("float.exr", "--depth 8"),
        ("clear.png", "--background transparent --preset ct-bone"),
        ("words.png", "--annotate scale,colors --set image={width=160,height=120}"),
        ("turned.png", "--azimuth 33 --elevation -12"),
        ("perspective.png", "--set camera.projection=perspective --set splatting.classification=after"),
    ] {
        folder.render(&format!("a.nrrd {LOOK} {rest} -o {name}"));
        folder.assert_verified(name);
    }
    folder.render(&format!("builtin:head:16 {LOOK} -o head.png"));
    folder.render("a.nrrd --size 12 --backend reference -o exact.png");
    folder.assert_verified("head.png exact.png .");
    // The f64 evaluation beside it.
    let run = folder.run("verify 8.png float.exr --oracle 40");
    assert_eq!(run.code, Some(0), "{}{}", run.stdout, run.stderr);
    let deviations = run.stdout.lines().filter_map(|line| {
        let (_, rest) = line.split_once("  40 pixels differ from the f64 evaluation by at most ")?;
        rest.split_once(" of 255")?.0.parse::<f64>().ok()
    });
    let deviations: Vec<f64> = deviations.collect();
    assert!(
        deviations.len() == 2 && deviations.iter().all(|&deviation| deviation > 0.0 && deviation < 0.01),
        "{}",
        run.stdout
    );
}

#[test]
fn every_change_is_told_with_its_reason() {
    let folder = Folder::new();
    folder.write_small("a.nrrd");
    folder.render(&format!("a.nrrd {LOOK} -o a.png"));
    let (picture, text) = (folder.read("a.png"), told(&folder.read("a.png")).unwrap());
    // Programs that compress a picture anew, and put its text at the end, change nothing.
    folder.write("b.png", rewritten(&picture, &text.to_string(), |_| {}));
    folder.assert_verified("b.png");
    folder.write("b.png", rewritten(&picture, &text.to_string(), |pixels| pixels[4 * 250] ^= 1));
    folder.assert_unverified(
        "b.png",
        1,
        &["b.png: differs", "its pixels were changed", "1 of 480 pixels differ, by up to 1 of 255"],
    );

    let with = |key: &str, value: Value| {
        let mut text = text.clone();
        text[key] = value;
        text
    };
    let scene = text["scene"].as_str().unwrap();
    let wider = json!(scene.replace("slab_width = 1.0", "slab_width = 2.0"));
    assert_ne!(wider, text["scene"]);
    // With the hash of the text left, and with that of the new text.
    for (key, value, words) in [
        ("scene", wider, " of 480 pixels differ, by up to "),
        ("version", json!("0.0.1"), "another version: it was drawn by 0.0.1, and this is "),
        ("pixels", json!("0".repeat(64)), "its pixels were changed"),
    ] {
        folder.write("b.png", rewritten(&picture, &with(key, value.clone()).to_string(), |_| {}));
        folder.assert_unverified("b.png", 1, &["its text was changed", words]);
        folder.write("b.png", rewritten(&picture, &sealed(with(key, value)), |_| {}));
        folder.assert_unverified("b.png", 1, &[words]);
        assert!(!folder.run("verify b.png").stdout.contains("its text was changed"));
    }
    folder.write("b.png", rewritten(&picture, &with("backend", json!("reference")).to_string(), |_| {}));
    folder.assert_unverified("b.png", 1, &["its text was changed"]);
    folder.write("b.png", rewritten(&picture, &sealed(with("version", json!("0.0.1"))), |_| {}));
    folder.assert_verified("b.png --any-version");

    // One voxel, which is far from what is seen or not: the file tells.
    let length = folder.read("a.nrrd").len();
    folder.change("a.nrrd", length - 2);
    folder.assert_unverified("a.png", 1, &["the file a.nrrd was changed"]);
    assert_eq!(folder.run("verify a.png --difference d.png").code, Some(1));
    assert_eq!(decoded(&folder.read("d.png")).0.size(), (24, 20));
    folder.run("verify a.png a.png --difference d.png").assert_failure(2, &["--difference", "one picture"]);
    folder.run("verify a.png --difference a.png").assert_failure(2, &["--difference", "allowed: another file"]);
}

#[test]
fn files_behind_a_volume_are_told_apart() {
    let folder = Folder::new();
    let header = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nencoding: raw\ndata file: a.raw\n";
    folder.write("a.nhdr", header);
    folder.write("a.raw", [0, 1, 2, 3, 4, 5, 6, 7]);
    folder.write(
        "labels.nrrd",
        [header.replace("data file: a.raw\n", "\n").as_bytes(), &[0, 1, 0, 1, 1, 1, 0, 0]].concat(),
    );
    folder.render(&format!("a.nhdr {LOOK} --set volume.labels=labels.nrrd -o a.png"));
    folder.assert_verified("a.png");
    for (name, at) in [("a.raw", 3), ("labels.nrrd", header.len() - 10)] {
        folder.change(name, at);
        folder.assert_unverified("a.png", 1, &[&format!("the file {name} was changed")]);
        folder.change(name, at);
        folder.assert_verified("a.png");
    }
    // A folder of slices.
    let series = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/series");
    fs::create_dir(folder.path("series")).unwrap();
    let mut names = Vec::new();
    for entry in fs::read_dir(series).unwrap() {
        let path = entry.unwrap().path();
        names.push(path.file_name().unwrap().to_owned().into_string().unwrap());
        fs::copy(&path, folder.path("series").join(&names[names.len() - 1])).unwrap();
    }
    folder.render("series --size 24x20 --backend cpu -o series.png");
    folder.assert_verified("series.png");
    let files = told(&folder.read("series.png")).unwrap()["files"].clone();
    assert!(
        files.as_array().unwrap().iter().all(|file| file["path"].as_str().unwrap().starts_with("series/")),
        "{files}"
    );
    let last = format!("series/{}", names[0]);
    folder.change(&last, folder.read(&last).len() - 1);
    folder.assert_unverified("series.png", 1, &[&format!("the file {last} was changed")]);
}

/// Stores and files that are read in pieces have the hashes of values, or of what identifies them.
#[test]
fn volumes_that_are_read_in_pieces_are_told_by_their_values() {
    let folder = Folder::new();
    let store = folder.path("a.zarr");
    fs::create_dir(&store).unwrap();
    let metadata = json!({
        "zarr_format": 2, "shape": [4, 4, 4], "chunks": [4, 4, 4], "dtype": "|u1", "compressor": null, "fill_value": 0,
        "order": "C", "filters": null,
    });
    fs::write(store.join(".zarray"), metadata.to_string()).unwrap();
    fs::write(store.join("0.0.0"), (0..64).collect::<Vec<u8>>()).unwrap();
    folder.render("a.zarr --size 24x20 --backend cpu -o a.png");
    folder.assert_verified("a.png");
    folder.change("a.zarr/0.0.0", 17);
    folder.assert_unverified("a.png", 1, &["the values of channel 0 were changed (a.zarr)"]);

    let ball = write_ball(&folder);
    let memory = [("RAYON_NUM_THREADS", "2")];
    folder.run_with(&memory, "", &format!("render {ball} --backend cpu --memory 17MiB -o ball.png")).assert_success();
    assert_eq!(told(&folder.read("ball.png")).unwrap()["streamed"], json!(true));
    let run = folder.run_with(&memory, "", "verify ball.png --memory 17MiB");
    assert_eq!(run.code, Some(0), "{}{}", run.stdout, run.stderr);

    // A host gives what no file holds.
    let mut stdin = folder.command("render - --size 24x20 --backend cpu -o pipe.png");
    folder.write_small("b.nrrd");
    stdin.stdin(fs::File::open(folder.path("b.nrrd")).unwrap());
    assert!(stdin.status().unwrap().success());
    folder.assert_unverified("pipe.png", 2, &["its volume came from memory"]);
}

#[test]
fn files_elsewhere_have_their_names_alone_and_are_searched() {
    let folder = Folder::new();
    for name in ["alice", "alice/secret", "figures", "data"] {
        fs::create_dir(folder.path(name)).unwrap();
    }
    folder.write_small("alice/secret/a.nrrd");
    folder.write_small("figures/inside.nrrd");
    let absolute = folder.path("alice/secret/a.nrrd").display().to_string();
    let here = folder.0.path().file_name().unwrap().to_str().unwrap();
    let holds = |name: &str, word: &str| {
        let bytes = folder.read(name);
        bytes.windows(word.len()).any(|window| window == word.as_bytes())
    };
    for (name, input) in
        [("a.png", "alice/secret/a.nrrd"), ("a.exr", &absolute), ("b.png", "figures/../alice/secret/a.nrrd")]
    {
        let name = format!("figures/{name}");
        folder.render(&format!("{input} {LOOK} -o {name}"));
        assert!(holds(&name, "a.nrrd") && !holds(&name, "alice") && !holds(&name, here), "{name}");
        folder.assert_unverified(&name, 2, &["cannot be verified", "found no file a.nrrd", "--search"]);
        folder.assert_verified(&format!("{name} --search alice/secret"));
        folder.run(&format!("render {name} -o again.png")).assert_failure(2, &[&name, "a.nrrd", "--search"]);
    }
    folder.render(&format!("figures/inside.nrrd {LOOK} -o figures/inside.png"));
    // The one with the hash is taken, whatever lies before it.
    folder.write_nrrd("data/a.nrrd", [2, 2, 2], [1.0; 3], &[0.0; 8]);
    folder.assert_verified("figures --search data --search alice/secret");
    folder.assert_unverified("figures/a.png --search data", 1, &["the file a.nrrd was changed"]);
    // Wherever the pictures are moved with what lies beside them.
    fs::rename(folder.path("figures"), folder.path("moved")).unwrap();
    folder.assert_verified("moved/inside.png");
}

#[test]
fn no_metadata_leaves_the_same_pixels_alone() {
    let folder = Folder::new();
    folder.write_small("a.nrrd");
    for (name, bare) in [("a.png", "bare.png"), ("a.exr", "bare.exr")] {
        folder.render(&format!("a.nrrd {LOOK} -o {name}"));
        folder.render(&format!("a.nrrd {LOOK} -o {bare} --no-metadata"));
        let [with, without] = [name, bare].map(|name| folder.read(name));
        let mentions = |bytes: &[u8]| bytes.windows(10).any(|window| window == b"sheetsplat");
        assert!(mentions(&with) && !mentions(&without), "{name}");
        let [with, without] = [name, bare].map(|name| sheetsplat::Image::open(&folder.path(name)).unwrap());
        assert_eq!(with, without);
        folder.assert_unverified(bare, 2, &["cannot be verified", "it holds no scene"]);
        folder.run(&format!("info {bare}")).assert_failure(2, &[bare, "holds no scene", "--no-metadata"]);
        folder.run(&format!("render {bare} -o again.png")).assert_failure(2, &[bare, "holds no scene"]);
    }
    // The compressed pixels, too.
    let data = |name: &str| {
        let bytes = folder.read(name);
        let at = bytes.windows(4).position(|window| window == b"IDAT").unwrap();
        bytes[at..].to_vec()
    };
    assert_eq!(data("a.png"), data("bare.png"));
    folder.render(&format!("a.nrrd {LOOK} -o a.npy"));
    folder.assert_unverified("a.npy", 2, &["NPY files have no room for a scene"]);
    folder.assert_unverified("a.npy a.png", 2, &["a.png: the same pixels"]);
    folder.run("verify").assert_failure(2, &["PICTURE"]);
    fs::create_dir(folder.path("empty")).unwrap();
    folder.run("verify empty").assert_failure(2, &["empty: found no picture"]);
}

#[test]
fn a_picture_is_a_scene_to_go_on_from() {
    let folder = Folder::new();
    folder.write_small("a.nrrd");
    folder.render(&format!(
        "a.nrrd {LOOK} --annotate scale --set image={{width=160,height=120}} -o a.png --save-scene saved.toml"
    ));
    // The same bytes by the same backend, whatever `auto` means here.
    folder.render("a.png -o again.png");
    assert!(folder.read("a.png") == folder.read("again.png"));
    folder.render("a.png -o wide.png --set image.width=200");
    assert_eq!(decoded(&folder.read("wide.png")).0.width, 200);
    folder.assert_verified("wide.png");
    // Data has no words.
    folder.render("a.png -o data.exr");
    folder.render("saved.toml --backend cpu -o plain.exr");
    assert!(folder.read("data.exr") == folder.read("plain.exr"));
    folder.run("render a.png -o a.png").assert_failure(2, &["a.png", "allowed: another file"]);
    folder.run("render a.png -o b.png --set camera.zoom=2").assert_failure(2, &["camera.zoom", "unknown key"]);
    let run = folder.run("info a.png");
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    let saved = String::from_utf8(folder.read("saved.toml")).unwrap();
    assert!(run.stdout.ends_with(&saved), "{}", run.stdout);
    for words in
        ["version      ", "backend      cpu\n", "annotate     scale\n", "file         a.nrrd, blake3 ", "pixels       "]
    {
        assert!(run.stdout.contains(words), "no {words:?} in\n{}", run.stdout);
    }
    let json: Value = serde_json::from_str(&folder.run("info a.png --json").stdout).unwrap();
    assert_eq!((&json, json["scene"].as_str()), (&told(&folder.read("a.png")).unwrap(), Some(saved.as_str())));
}

/// Nothing in a picture reaches the terminal as it is, or leads out of its folder.
#[test]
fn hostile_pictures_are_refused() {
    let folder = Folder::new();
    folder.write_small("a.nrrd");
    folder.render(&format!("a.nrrd {LOOK} -o a.png"));
    let (picture, text) = (folder.read("a.png"), told(&folder.read("a.png")).unwrap());
    let write = |text: &str| folder.write("b.png", rewritten(&picture, text, |_| {}));
    let scene = text["scene"].as_str().unwrap();
    for (path, shown) in [("/etc/passwd", "/etc/passwd"), ("../a.nrrd", "../a.nrrd"), ("\\u001b[2J/../b", "\\u{1b}[2J")]
    {
        let mut text = text.clone();
        text["scene"] = json!(scene.replace("\"a.nrrd\"", &format!("\"{path}\"")));
        write(&sealed(text.clone()));
        folder.assert_unverified("b.png", 2, &["volume.path", shown, "in the picture's folder"]);
        folder.run("render b.png -o c.png").assert_failure(2, &["b.png", "volume.path", shown]);
        text["files"][0]["path"] = json!(path.replace("\\u001b", "\u{1b}"));
        write(&text.to_string());
        let run = folder.run("info b.png");
        assert_eq!(run.code, Some(2), "{}", run.stdout);
        assert!(
            run.stderr.contains("b.png: picture.files[0].path: found ") && !run.stderr.contains('\x1b'),
            "{}",
            run.stderr
        );
    }
    let mut loud = text.clone();
    loud["version"] = json!("1\u{1b}[2J\r2");
    write(&sealed(loud));
    for command in ["info b.png", "verify b.png", "info b.png --json"] {
        let run = folder.run(command);
        assert!(!run.stdout.contains(['\x1b', '\r']) && !run.stdout.is_empty(), "{}", run.stdout);
    }
    let mut broken = text.clone();
    broken["scene"] = json!("x = \u{1b}");
    for (text, words) in [
        (String::new(), "picture: found "),
        ("{}".to_owned(), "picture: found missing field"),
        (text.to_string().replace("\"format\":1", "\"format\":7"), "picture.format: found 7, allowed: 1"),
        (sealed(broken), "line 1"),
    ] {
        write(&text);
        folder.assert_unverified("b.png", 2, &["b.png: cannot be verified: ", words]);
    }
    // A text that is short in the file and endless when it is read.
    write(&" ".repeat(40 << 20));
    assert!(folder.read("b.png").len() < 1 << 20);
    folder.assert_unverified("b.png", 2, &["b.png: cannot be verified: "]);
    // A scene that takes more memory than is allowed.
    let mut long = text.clone();
    long["scene"] = json!(format!("{scene}\n# {}", "x".repeat(1 << 20)));
    write(&sealed(long));
    folder.assert_unverified("b.png --memory 100MiB", 2, &["1048", "bytes of a scene", "memory limit"]);
    folder.write("short.png", &picture[..picture.len() / 2]);
    folder.assert_unverified("short.png", 2, &["short.png: cannot be verified: "]);
    folder.assert_unverified("gone.png", 2, &["gone.png: cannot be verified: ", "No such file"]);
}

#[test]
fn frames_tell_their_own_scenes() {
    let folder = Folder::new();
    folder.write_small("a.nrrd");
    folder.run(&format!("orbit a.nrrd {LOOK} --count 3 -o %d.png")).assert_success();
    folder.assert_verified("0.png 1.png 2.png");
    let scenes = [0, 1, 2].map(|frame| told(&folder.read(&format!("{frame}.png"))).unwrap()["scene"].clone());
    assert!(scenes[0] != scenes[1] && scenes[1] != scenes[2]);
    folder.run(&format!("orbit a.nrrd {LOOK} --count 3 -o %d.png --no-metadata")).assert_success();
    assert_eq!(told(&folder.read("1.png")), None);
}

/// The GPU's pictures within its tolerance, on the adapter that they name.
#[test]
fn pictures_of_a_gpu_are_compared_on_its_adapter() {
    let folder = Folder::new();
    folder.render(&format!("{SMALL} --backend gpu -o a.png"));
    folder.assert_verified("a.png");
    let (picture, mut text) = (folder.read("a.png"), told(&folder.read("a.png")).unwrap());
    assert!(text["adapter"].as_str().unwrap().contains(&adapter()), "{text}");
    text["adapter"] = json!("Voodoo 2");
    folder.write("b.png", rewritten(&picture, &sealed(text), |_| {}));
    folder.assert_unverified("b.png", 2, &["it was drawn on Voodoo 2, which is not here"]);
}

/// Every key of a scene survives in the text, to the last bit, and a voxel, a key or a version that is another one is told.
#[test]
fn random_scenes_are_the_same_when_they_are_drawn_again() {
    let folder = Folder::new();
    let headless = Headless::new(&HeadlessOptions::default().with_backend(Backend::Cpu)).unwrap();
    let (mut verified, mut changed) = (0, 0);
    for seed in 0..cases(100, 1000) as u64 {
        let Case { volume, scene, .. } = Case::new(seed, seed);
        let volume = OpenVolume::from(volume);
        let scene = scene.explicit(volume.sample());
        // Some settings are the GPU's alone.
        let Ok(drawn) = headless.render_volume(volume.clone(), &scene) else { continue };
        let path = folder.path(["a.png", "a.exr"][seed as usize % 2]);
        let sources = Sources::of(Some(&volume), &scene, &Inputs::default());
        let made = Provenance::of(&path, &scene, &sources, &drawn.stats, &[]).unwrap();
        let write = |made: &Provenance| {
            fs::write(&path, made.encode(&drawn.image, &path, PngDepth::Sixteen).unwrap()).unwrap();
        };
        let with = |key: &str, value: Value| {
            let mut text: Value = serde_json::from_str(&made.to_json().unwrap()).unwrap();
            text[key] = value;
            write(&serde_json::from_value(text).unwrap());
        };
        let reasons = |volume: &OpenVolume| {
            Verifier::default().with_volume(volume.clone()).verify(&path).unwrap().reasons.join("\n")
        };
        write(&made);
        assert_eq!(reasons(&volume), "", "{seed}: {}", made.scene_text());
        let whole = volume.sample();
        if whole.channel_count() == 1 && whole.labels().is_none() && whole.colors().is_none() {
            let mut values: Vec<f32> = whole.values().iter().collect();
            let at = seed as usize % values.len();
            values[at] = if values[at].is_finite() { values[at] + 1.0 } else { 0.0 };
            let other = Volume::new("other", whole.dims(), whole.grid().spacing, values).unwrap();
            let told = reasons(&other.into());
            assert!(told.contains("the values of channel 0 were changed"), "{seed}: {told}");
            changed += 1;
        }
        with("version", json!("0.0.1"));
        assert!(reasons(&volume).starts_with("another version: it was drawn by 0.0.1"), "{seed}");
        with("scene", json!(made.scene_text().replacen("\nwidth = ", "\nwidth = 1", 1)));
        assert!(reasons(&volume).contains(" pixels, and "), "{seed}: {}", reasons(&volume));
        verified += 1;
    }
    assert!(verified > 60 && changed > 30, "{verified} scenes, {changed} voxels");
}
