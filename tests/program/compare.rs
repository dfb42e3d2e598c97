//! Comparing image files.

use sheetsplat::image::{Image, PngDepth};

use crate::*;

/// A folder with `a.png`, and with `b.png` that differs from it in some pixels by some steps of 255 in green.
fn folder_with(pixels: usize, steps: u8) -> Folder {
    let folder = Folder::new();
    let image = Image { width: 25, height: 40, pixels: vec![[0.5, 0.25, 0.125, 1.0]; 1000] };
    image.save(&folder.path("a.png"), PngDepth::Eight).unwrap();
    let mut other = image;
    for pixel in &mut other.pixels[30..30 + pixels] {
        pixel[1] += f32::from(steps) / 255.0;
    }
    other.save(&folder.path("b.png"), PngDepth::Eight).unwrap();
    folder
}

/// Compares in a folder, and asserts the exit code and words in the report.
fn assert_compares(folder: &Folder, arguments: &str, code: i32, words: &[&str]) {
    let run = folder.run(&format!("compare {arguments}"));
    assert_eq!(run.code, Some(code), "{arguments}\n{}{}", run.stdout, run.stderr);
    assert_eq!(run.stderr.is_empty(), code == 0, "{arguments}\n{}", run.stderr);
    for word in words {
        assert!(run.stdout.contains(word), "{arguments}: no {word:?} in\n{}", run.stdout);
    }
}

#[test]
fn images_that_are_alike_are_0_and_others_1() {
    let folder = folder_with(1, 4);
    assert_compares(&folder, "a.png a.png", 0, &["0 of 25×40 pixels", "PSNR: inf dB"]);
    assert_compares(&folder, "a.png b.png", 1, &["1 of 25×40 pixels (0.100 %)", "green 4", "worst at x 5, y 1"]);
    assert_compares(
        &folder,
        "a.png b.png --tolerance 4",
        0,
        &["0 of 25×40", "mean difference: 0.0013", "PSNR: 70.86 dB"],
    );
    assert_compares(&folder, "a.png b.png --outliers 0.001", 0, &["1 of 25×40", "allowed: 0.100 %"]);
    assert_compares(&folder, "b.png a.png --outliers 0.0009", 1, &["1 of 25×40", "      3:         1 (0.100 %)"]);
    folder.run("compare a.png b.png").assert_says("a.png and b.png differ");
}

impl Run {
    fn assert_says(&self, words: &str) {
        assert!(self.stderr.contains(words), "{}: no {words:?} in\n{}", self.arguments, self.stderr);
    }
}

#[test]
fn folders_are_compared_name_by_name() {
    let folder = folder_with(1, 4);
    for (name, files) in [("drawn", ["a.png", "b.png"]), ("same", ["a.png", "b.png"]), ("other", ["b.png", "a.png"])] {
        fs::create_dir(folder.path(name)).unwrap();
        for (from, to) in files.into_iter().zip(["a.png", "b.png"]) {
            fs::copy(folder.path(from), folder.path(name).join(to)).unwrap();
        }
        folder.write(&format!("{name}/note.txt"), "no image");
    }
    assert_compares(&folder, "drawn same", 0, &["a.png: passes", "b.png: passes", "0 of 2 images differ"]);
    assert_compares(
        &folder,
        "drawn other",
        1,
        &["a.png: differs", "b.png: differs", "green 4", "2 of 2 images differ"],
    );
    assert_compares(&folder, "drawn other --tolerance 4", 0, &["0 of 2 images differ"]);
    fs::remove_file(folder.path("same/b.png")).unwrap();
    assert_compares(&folder, "drawn same", 1, &["b.png: differs", "none in same", "1 of 2 images differ"]);
    assert_compares(&folder, "same drawn", 1, &["b.png: differs", "none in same", "1 of 2 images differ"]);
    fs::create_dir(folder.path("empty")).unwrap();
    let refused =
        |arguments: &str, words: &[&str]| folder.run(&format!("compare {arguments}")).assert_failure(2, words);
    refused("empty empty", &["empty and empty", "no image", ".png, .exr or .npy"]);
    refused("drawn a.png", &["drawn"]);
    refused("drawn same --difference d.png", &["--difference", "for folders"]);
}

#[test]
fn an_image_of_where_they_differ_is_saved_either_way() {
    let folder = folder_with(3, 5);
    for (tolerance, code, color) in [(3, 1, [255, 50, 0, 255]), (5, 0, [100, 100, 100, 255])] {
        assert_compares(&folder, &format!("a.png b.png --tolerance {tolerance} --difference d.png"), code, &[]);
        let difference = image::open(folder.path("d.png")).unwrap().to_rgba8();
        assert_eq!(difference.dimensions(), (25, 40));
        assert_eq!(difference.get_pixel(6, 1).0, color);
        assert_eq!(difference.get_pixel(9, 1).0, [0, 0, 0, 255]);
    }
}

#[test]
fn every_format_holds_the_same_image() {
    let folder = Folder::new();
    for name in ["8.png", "image.exr", "image.npy"] {
        folder.render(&format!("{SMALL} {TRANSPARENT} -o {name}"));
    }
    folder.render(&format!("{SMALL} {TRANSPARENT} -o 16.png --depth 16"));
    let names = ["8.png", "16.png", "image.exr", "image.npy"];
    for (actual, golden) in names.iter().flat_map(|actual| names.map(|golden| (actual, golden))) {
        // Values near the middle between two 8-bit numbers may be rounded differently from 16 bits.
        assert_compares(&folder, &format!("{actual} {golden} --tolerance 1"), 0, &["27×20"]);
    }
    assert_compares(&folder, "image.exr image.npy --tolerance 0", 0, &[]);
    assert_compares(&folder, "8.png image.npy --tolerance 0", 0, &[]);
    folder.render(&format!("{SMALL} -o opaque.png"));
    assert_compares(&folder, "opaque.png image.npy", 1, &[]);
}

#[test]
fn a_png_without_alpha_is_opaque() {
    let folder = folder_with(0, 0);
    image::open(folder.path("a.png")).unwrap().to_rgb8().save(folder.path("rgb.png")).unwrap();
    assert_compares(&folder, "rgb.png a.png --tolerance 0", 0, &[]);
    image::open(folder.path("a.png")).unwrap().to_luma8().save(folder.path("grey.png")).unwrap();
    assert_compares(&folder, "grey.png a.png", 1, &["alpha 0;"]);
}

#[test]
fn the_report_names_what_goldens_were_made_on() {
    let folder = folder_with(0, 0);
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/goldens/head.png");
    fs::copy(golden, folder.path("golden.png")).unwrap();
    assert_compares(&folder, "golden.png golden.png", 0, &["golden.png made on: cpu backend"]);
    let run = folder.run("compare a.png b.png");
    assert!(!run.stdout.contains("made on"), "{}", run.stdout);
}

#[test]
fn other_sizes_are_1() {
    let folder = folder_with(0, 0);
    folder.render(&format!("{SMALL} -o small.png"));
    folder.run("compare a.png small.png").assert_failure(1, &["a.png and small.png", "25×40", "27×20"]);
}

#[test]
fn bad_usage_and_input_are_2_and_leave_nothing() {
    let folder = folder_with(1, 90);
    folder.write("text.png", "not an image");
    folder.write("a.gif", "GIF89a");
    folder.write("short.png", &folder.read("a.png")[..60]);
    let floats = |name: &str, pixels: Vec<[f32; 4]>| {
        Image { width: 2, height: 1, pixels }.save(&folder.path(name), PngDepth::Eight).unwrap();
    };
    floats("good.npy", vec![[0.5; 4]; 2]);
    floats("nan.npy", vec![[0.5; 4], [0.5, f32::NAN, 0.5, 0.5]]);
    floats("good.exr", vec![[0.5; 4]; 2]);
    folder.write("short.npy", &folder.read("good.npy")[..150]);
    folder.write("short.exr", &folder.read("good.exr")[..200]);
    let npy = String::from_utf8_lossy(&folder.read("good.npy")[..128]).into_owned();
    let with_header = |name: &str, from: &str, to: &str| {
        assert!(npy.contains(from), "{npy}");
        let mut bytes = folder.read("good.npy");
        let at = bytes.windows(from.len()).position(|window| window == from.as_bytes()).unwrap();
        bytes.splice(at..at + from.len(), to.bytes());
        folder.write(name, bytes);
    };
    with_header("flat.npy", "(1, 2, 4", "(2, 2, 2");
    with_header("empty.npy", "(1, 2, 4", "(0, 2, 4");
    with_header("huge.npy", "(1, 2, 4, ), }      ", "(20000, 50000, 4), }");
    with_header("f8.npy", "<f4", "<f8");
    folder.write("f8.npy", [folder.read("f8.npy"), vec![0; 32]].concat());
    // The sizes that two small files claim are changed to 100 000 × 100 000: in the PNG's first chunk, with its checksum, and in the EXR's two
    // windows.
    let mut png = folder.read("a.png");
    png[16..24].copy_from_slice(&[100_000_u32.to_be_bytes(); 2].concat());
    let mut crc = flate2::Crc::new();
    crc.update(&png[12..29]);
    png[29..33].copy_from_slice(&crc.sum().to_be_bytes());
    folder.write("huge.png", png);
    let mut exr = folder.read("good.exr");
    let [small, huge] = [[0_i32, 0, 1, 0], [0, 0, 99_999, 99_999]].map(|window| window.map(i32::to_le_bytes).concat());
    let windows: Vec<usize> = (0..exr.len() - 16).filter(|&at| exr[at..at + 16] == small).collect();
    assert_eq!(windows.len(), 2);
    windows.into_iter().for_each(|at| exr[at..at + 16].copy_from_slice(&huge));
    folder.write("huge.exr", exr);
    fs::create_dir(folder.path("folder.png")).unwrap();
    let before = folder.names();
    for (arguments, words) in [
        ("a.png", &["GOLDEN"] as &[&str]),
        ("a.png b.png --tolerance 17", &["tolerance per channel", "17", "0 to 16"]),
        ("a.png b.png --tolerance some", &["--tolerance", "some"]),
        ("a.png b.png --outliers 0.02", &["outliers", "0.02", "0 to 0.01"]),
        ("a.png b.png --outliers nan", &["outliers", "NaN", "0 to 0.01"]),
        ("a.png b.png --difference d.gif", &["d.gif", ".gif", ".png"]),
        ("a.png b.png --memory 100", &["a.png", "size", "memory limit of 100 bytes"]),
        ("a.png b.png --confine folder.png", &["a.png", "reading is confined"]),
        ("a.png b.png --difference a.png", &["--difference", "a.png", "another file"]),
        ("gone.png b.png --difference d.png", &["gone.png", "No such file"]),
        ("a.png gone.png --difference d.png", &["gone.png", "No such file"]),
        ("a.png folder.png", &["folder.png", "directory"]),
        ("a.gif b.png", &["a.gif", "\".gif\"", ".png, .exr or .npy"]),
        ("text.png b.png", &["text.png", "PNG"]),
        ("a.png short.png", &["short.png"]),
        ("short.exr good.exr", &["short.exr"]),
        ("short.npy good.npy", &["short.npy"]),
        ("f8.npy good.npy", &["f8.npy", "descr", "float64", "float32"]),
        ("flat.npy good.npy", &["flat.npy", "shape", "(2, 2, 2)", "(height, width, 4)"]),
        ("empty.npy good.npy", &["empty.npy", "shape", "(0, 2, 4", "three positive integers"]),
        ("huge.npy good.npy", &["huge.npy", "data", "32 bytes", "16000000000 bytes"]),
        ("huge.png good.npy", &["huge.png", "size", "100000 × 100000 pixels in", "at most"]),
        ("huge.exr good.npy", &["huge.exr", "size", "100000 × 100000 pixels"]),
        ("nan.npy good.npy --difference d.png", &["nan.npy", "the actual image", "NaN", "x 1, y 0"]),
        ("good.exr nan.npy", &["nan.npy", "the golden image", "NaN", "finite"]),
    ] {
        folder.run(&format!("compare {arguments}")).assert_failure(2, words);
        assert_eq!(folder.names(), before, "{arguments}");
    }
    folder.run("compare a.png b.png --difference no/d.png").assert_failure(2, &["no/d.png", "No such file"]);
    folder.run("compare a.png b.png --difference folder.png").assert_failure(1, &["folder.png", "directory"]);
}

/// An array may be in either order; other programs write both.
#[test]
fn npy_of_any_order_and_length() {
    let folder = Folder::new();
    let pixel = |at: u16| [0, 1, 2, 3].map(|channel| f32::from(4 * at + channel) / 64.0);
    let image = Image { width: 3, height: 5, pixels: (0..15).map(pixel).collect() };
    image.save(&folder.path("a.npy"), PngDepth::Eight).unwrap();
    let header = |order: &str| {
        let text = format!("{{'descr': '>f4', 'fortran_order': {order}, 'shape': (5, 3, 4)}}\n");
        [b"\x93NUMPY\x02\0", &(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat()
    };
    let value = |y: usize, x: usize, channel: usize| image.pixels[y * 3 + x][channel].to_be_bytes();
    let fortran = (0..60).flat_map(|at| value(at % 5, at / 5 % 3, at / 15));
    folder.write("f.npy", header("True").into_iter().chain(fortran).collect::<Vec<u8>>());
    let c = (0..60).flat_map(|at| value(at / 12, at / 4 % 3, at % 4));
    folder.write("c.npy", header("False").into_iter().chain(c).collect::<Vec<u8>>());
    for name in ["a.npy", "f.npy", "c.npy"] {
        assert_eq!(Image::open(&folder.path(name)).unwrap(), image, "{name}");
    }
}
