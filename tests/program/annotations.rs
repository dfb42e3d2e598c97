//! `--annotate`: scale bar, colour bar, legend, sides of the patient.

use image::RgbaImage;

use crate::*;

/// In images whose shorter side has at most 240 pixels: the distance from the image's edges to words, of a line to the next, and the scale bar's thickness.
const PAD: u32 = 4;
const LINE: u32 = 10;
const THICK: u32 = 2;

/// The height that a scale bar takes with its label.
const BELOW: u32 = LINE + THICK + 2 * PAD;

/// Bars and text over black.
const INK: [u8; 4] = [255; 4];

impl Folder {
    fn annotated(&self, arguments: &str) -> RgbaImage {
        self.render(&format!("{arguments} -o annotated.png"));
        image::open(self.path("annotated.png")).unwrap().into_rgba8()
    }
}

/// The length of the longest run of ink in a row of pixels.
fn longest_run(image: &RgbaImage, row: u32) -> usize {
    let is_ink: Vec<bool> = (0..image.width()).map(|x| image.get_pixel(x, row).0 == INK).collect();
    is_ink.split(|ink| !ink).map(<[bool]>::len).max().unwrap()
}

/// The scale bar's length in pixels.
fn bar(image: &RgbaImage) -> usize {
    let bottom = image.height() - PAD;
    let lengths: BTreeSet<usize> = (bottom - THICK..bottom).map(|row| longest_run(image, row)).collect();
    assert_eq!(lengths.len(), 1, "not straight: {lengths:?}");
    lengths.into_iter().next().unwrap()
}

const CUBE: &str =
    "builtin:cube --set camera.direction=[0,1,0] --set image.width=320 --set image.height=200 --annotate scale";

#[test]
fn a_scale_bar_is_as_long_as_it_says() {
    let folder = Folder::new();
    // World units over the image's height, and the bar's length: the longest round one within a quarter of the width.
    for (height, length) in [(100.0, 20.0), (40.0, 10.0), (200.0, 50.0), (62.5, 20.0), (64.0, 20.0)] {
        let image = folder.annotated(&format!("{CUBE} --set camera.height={height}"));
        let expected: f64 = length * f64::from(200 - BELOW) / height;
        assert!(expected <= 320.0 / 4.0 && expected * 2.5 >= 320.0 / 4.0, "{height}");
        assert_eq!(bar(&image), expected.round() as usize, "{height}");
    }
    // Compared with the picture: the cube's side is 32 units, seen head-on.
    let image = folder.annotated(&format!("{CUBE} --set camera.height=100 --set splatting.radius=1"));
    let lit = (0..320).filter(|&x| image.get_pixel(x, 90).0[0] > 90).count() as f64;
    assert!((lit / bar(&image) as f64 - 32.0 / 20.0).abs() < 0.06, "{lit} pixels");
    // In the volume's own unit.
    let image =
        folder.annotated(&format!("{CUBE} --set camera.height=0.01 --set volume.spacing=[0.0001,0.0001,0.0002]"));
    assert_eq!(bar(&image), 36, "0.002 units");
    // The text differs although the bar does not.
    let [first, second] =
        ["100", "1000"].map(|height| folder.annotated(&format!("{CUBE} --set camera.height={height}")));
    assert_eq!(bar(&first), bar(&second));
    let text = |image: &RgbaImage| image::imageops::crop_imm(image, PAD, 200 - BELOW, 100, LINE).to_image();
    assert!(text(&first) != text(&second));
}

#[test]
fn a_scale_bar_has_the_volumes_unit() {
    let folder = Folder::new();
    let values: Vec<f32> = (0..512).map(|i| (i % 7) as f32).collect();
    folder.write_nrrd("plain.nrrd", [8, 8, 8], [1.0, 1.0, 1.0], &values);
    let plain = String::from_utf8_lossy(&folder.read("plain.nrrd")[..60]).into_owned();
    assert!(plain.contains("dimension: 3\n"));
    let texts = ["mm", "um", "\u{b5}m"].map(|unit| {
        let header = "dimension: 3\n";
        let bytes = folder.read("plain.nrrd");
        let at = bytes.windows(header.len()).position(|window| window == header.as_bytes()).unwrap() + header.len();
        let units = format!("units: \"{unit}\" \"{unit}\" \"{unit}\"\n");
        folder.write("units.nrrd", [&bytes[..at], units.as_bytes(), &bytes[at..]].concat());
        folder.annotated("units.nrrd --set image={width=320,height=200} --set camera.height=100 --annotate scale")
    });
    let plain =
        folder.annotated("plain.nrrd --set image={width=320,height=200} --set camera.height=100 --annotate scale");
    assert_eq!(bar(&plain), bar(&texts[0]));
    assert!(plain != texts[0] && texts[0] != texts[1]);
}

#[test]
fn words_stand_beside_the_picture_and_grow_with_it() {
    let folder = Folder::new();
    let cube = "builtin:cube:8 --set camera.direction=[1,2,-0.5] --annotate scale,colors";
    let mut heights = Vec::new();
    for size in [64_u32, 256, 1024] {
        let image = folder.annotated(&format!("{cube} --size {size}"));
        assert_eq!(image.dimensions(), (size, size));
        // The rows of the scale's label: those with ink above the bar, left of the picture's middle.
        let is_inked = |row: u32| (0..size / 3).any(|x| image.get_pixel(x, row).0[0] > 128);
        let rows: Vec<u32> = (size * 3 / 4..size).filter(|&row| is_inked(row)).collect();
        let end = rows.windows(2).position(|pair| pair[1] > pair[0] + 1).map_or(rows.len(), |at| at + 1);
        heights.push(end as f64);
    }
    // 5.8 pixels of 8, 6.2 of 8.5 and 25 of 34.
    assert!((5.0..=8.0).contains(&heights[0]) && (5.0..=9.0).contains(&heights[1]), "{heights:?}");
    assert!((heights[2] / heights[1] - 4.0).abs() < 0.8, "{heights:?}");
}

#[test]
fn words_are_readable_on_any_background() {
    let folder = Folder::new();
    let at = |image: &RgbaImage, x: u32, y: u32| image.get_pixel(x, y).0;
    let bar_row = 200 - PAD - 1;
    for (background, paper, ink) in [
        ("[0,0,0,1]", [0, 0, 0, 255], [255; 4]),
        ("[1,1,1,1]", [255; 4], [0, 0, 0, 255]),
        ("[0.3,0.3,0.35,1]", [77, 77, 89, 255], [255; 4]),
        ("[0.6,0.6,0.6,1]", [153, 153, 153, 255], [0, 0, 0, 255]),
        ("[1,1,1,0]", [0; 4], [0, 0, 0, 255]),
    ] {
        let sets = format!("--set camera.height=100 --set image.background={background}");
        let image = folder.annotated(&format!("{CUBE} {sets}"));
        assert_eq!(at(&image, PAD + 10, bar_row), ink, "{background}");
        assert_eq!(at(&image, 300, bar_row), paper, "{background}");
        // Where the background is open, what lies behind is unknown: a halo is around the ink.
        let above = at(&image, PAD + 2, bar_row - THICK);
        assert_eq!(above, if paper[3] == 0 { [255; 4] } else { paper }, "{background}");
        // The picture is that of the room beside the words, and no word covers it.
        let alone = CUBE.replace("height=200", &format!("height={}", 200 - BELOW)).replace(" --annotate scale", "");
        folder.render(&format!("{alone} {sets} -o plain.png"));
        let plain = image::open(folder.path("plain.png")).unwrap().into_rgba8();
        assert_eq!(plain.dimensions(), (320, 200 - BELOW));
        for (x, y, pixel) in plain.enumerate_pixels() {
            // A halo is two pixels wide at most.
            let is_far = y + 2 < plain.height() || paper[3] == 255;
            assert!(!is_far || pixel == image.get_pixel(x, y), "{background} {x} {y}");
        }
    }
}

#[test]
fn the_sides_of_the_patient_are_at_the_edges() {
    let folder = Folder::new();
    let values: Vec<f32> = (0..1000).map(|at: u32| if (at / 10 % 10).abs_diff(5) < 3 { 9.0 } else { 0.0 }).collect();
    folder.write_nrrd("plain.nrrd", [10; 3], [1.0; 3], &values);
    let plain = String::from_utf8_lossy(&folder.read("plain.nrrd")).into_owned();
    assert!(plain.contains("spacings: "));
    // The same volume in a patient, with x, y and z to the left, the back and the head.
    let bytes = folder.read("plain.nrrd");
    let end = bytes.windows(2).position(|pair| pair == b"\n\n").unwrap();
    let header = String::from_utf8_lossy(&bytes[..end]).into_owned();
    let header: Vec<&str> = header.lines().filter(|line| !line.starts_with("spacings")).collect();
    let space = "space: left-posterior-superior\nspace directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (0,0,0)";
    folder.write("patient.nrrd", [format!("{}\n{space}", header.join("\n")).as_bytes(), &bytes[end..]].concat());
    let seen = |side: &str| {
        folder.annotated(&format!("patient.nrrd --set image={{width=200,height=160}} --annotate sides --view {side}"))
    };
    // The letter at the left, right, upper and lower edge.
    let letters = |image: &RgbaImage| {
        let crop = |x, y, width, height| {
            let strip = image::imageops::crop_imm(image, x, y, width, height).to_image();
            let inked: Vec<(u32, u32)> =
                strip.enumerate_pixels().filter(|(.., pixel)| pixel.0[0] > 100).map(|(x, y, _)| (x, y)).collect();
            let left = inked.iter().map(|&(x, _)| x).min().unwrap();
            let top = inked.iter().map(|&(_, y)| y).min().unwrap();
            inked.into_iter().map(|(x, y)| (x - left, y - top)).collect::<BTreeSet<_>>()
        };
        [crop(0, 70, 14, 20), crop(186, 70, 14, 20), crop(90, 0, 20, LINE), crop(90, 160 - LINE, 20, LINE)]
    };
    let [front, left, top] = ["front", "left", "top"].map(|side| letters(&seen(side)));
    let back = letters(&seen("back"));
    // R L S I, A P S I and L R A P: each letter is drawn alike wherever it is, and no two letters alike.
    assert_eq!([&front[0], &front[1]], [&back[1], &back[0]]);
    assert_eq!([&front[0], &front[1]], [&top[1], &top[0]]);
    assert_eq!([&front[2], &front[3]], [&left[2], &left[3]]);
    assert_eq!([&left[0], &left[1]], [&top[2], &top[3]]);
    let different: BTreeSet<_> = front.iter().chain(&left[..2]).collect();
    assert_eq!(different.len(), 6, "R L S I A P");
    folder
        .run("render plain.nrrd -o a.png --annotate sides")
        .assert_failure(2, &["--annotate: sides: found a volume that states no patient", "allowed"]);
}

#[test]
fn a_colour_bar_has_the_units_of_the_values_beside_it() {
    let folder = Folder::new();
    let values: Vec<f32> = (0..512).map(|i| (i % 7) as f32 * 100.0).collect();
    folder.write_nrrd("plain.nrrd", [8, 8, 8], [1.0, 1.0, 1.0], &values);
    let bytes = folder.read("plain.nrrd");
    let at = bytes.windows(13).position(|window| window == b"dimension: 3\n").unwrap();
    let width_of_bar = |name: &str| {
        let colors = "--set transfer.color=[[0,[1,0,0]],[700,[0,0,1]]] --set transfer.opacity=[[0,0.4]]";
        let image = folder.annotated(&format!(
            "{name} {colors} --set image={{width=200,height=160}} --annotate colors --backend cpu"
        ));
        // The bar's left edge stands farther from the image's where a title does.
        let is_bar = |x: &u32| (50..100).all(|y| image.get_pixel(*x, y).0[1] == 0 && image.get_pixel(*x, y).0[0] > 40);
        200 - (100..200).find(is_bar).unwrap()
    };
    let without = width_of_bar("plain.nrrd");
    folder.write("units.nrrd", [&bytes[..at], b"sample units: g/cm\xc2\xb3\n", &bytes[at..]].concat());
    assert_eq!(width_of_bar("units.nrrd"), without + LINE + 2, "a line that runs upwards, and a gap");
}

#[test]
fn a_scene_saved_with_words_gives_the_same_image_with_them() {
    let folder = Folder::new();
    let words = "--annotate scale,colors --backend cpu";
    folder.render(&format!("builtin:marschner-lobb:12 --size 200x160 {words} -o a.png --save-scene a.toml"));
    folder.render(&format!("a.toml {words} -o b.png"));
    assert_eq!(folder.read("a.png"), folder.read("b.png"));
}

/// Python's tests compare with the same file.
#[test]
fn words_are_the_same_bytes_everywhere() {
    let folder = Folder::new();
    let image = folder.annotated("builtin:marschner-lobb:12 --size 200x160 --annotate scale,colors --backend cpu");
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/annotated.png");
    assert!(image == image::open(path).unwrap().into_rgba8());
}

#[test]
fn a_colour_bar_has_the_transfer_functions_colours() {
    let folder = Folder::new();
    let ramp = "--set transfer.color=[[0,[1,0,0]],[255,[0,0,1]]] --set transfer.opacity=[[0,0.4]]";
    let image = folder
        .annotated(&format!("builtin:marschner-lobb:12 {ramp} --set image={{width=200,height=160}} --annotate colors"));
    // The bar has six tenths of the height within the margins, in the middle; most of it is blue above and red below.
    let column = (0..200)
        .rev()
        .find(|&x| {
            let [r, g, b, _] = image.get_pixel(x, 80).0;
            g == 0 && r > 60 && b > 60
        })
        .unwrap();
    let rows: Vec<[u8; 4]> = (0..160).map(|y| image.get_pixel(column - 4, y).0).collect();
    let colored: Vec<usize> =
        (0..160).filter(|&y| rows[y][1] == 0 && u32::from(rows[y][0]) + u32::from(rows[y][2]) > 250).collect();
    assert_eq!(colored.len(), 91, "{colored:?}");
    let [top, bottom] = [rows[colored[0]], rows[colored[90]]];
    assert!(top[2] > 220 && top[0] < 35 && bottom[0] > 220 && bottom[2] < 35, "{top:?} {bottom:?}");
    assert!(colored.windows(2).all(|pair| rows[pair[0]][0] <= rows[pair[1]][0]), "from above to below");
    // Ticks and numbers are beside it.
    let light = |x: u32| (0..160).filter(|&y| image.get_pixel(x, y).0[1] > 120).count();
    assert!((2..=6).contains(&light(column + 2)), "ticks at 50, 100, 150, 200 and perhaps 250");
    assert!((column + 6..197).map(light).sum::<usize>() > 40, "numbers");
}

#[test]
fn a_projections_colour_bar_is_as_bright_as_the_projection() {
    let folder = Folder::new();
    let image =
        folder.annotated("builtin:marschner-lobb:12 --preset mip --set image={width=200,height=160} --annotate colors");
    // Colours are grey, and darker downwards, in the column that is grey throughout.
    let greys = |x: u32| -> Vec<u8> { (38..122).map(|y| image.get_pixel(x, y).0[0]).collect() };
    let falls = |greys: &Vec<u8>| greys.windows(2).all(|pair| pair[0] >= pair[1]) && greys[0] > 235 && greys[83] < 60;
    assert!((100..192).map(greys).any(|greys| falls(&greys)));
}

#[test]
fn a_legend_names_every_label_in_its_colour() {
    let folder = Folder::new();
    // Slabs of labels 1, 2, 3 and 300, and of 0.
    let labels = [0.0, 1.0, 2.0, 3.0, 300.0, 0.0];
    let values: Vec<f32> = (0..24 * 24 * 24).map(|i: usize| labels[i % 24 / 4]).collect();
    folder.write_nrrd("labels.nrrd", [24, 24, 24], [1.0, 1.0, 1.0], &values);
    let image = folder
        .annotated("labels.nrrd --set image={width=220,height=160} --annotate legend --set shading.enabled=false");
    let patch = |row: u32| image.get_pixel(PAD + 5, PAD + LINE * row + 5).0;
    let colors: Vec<[u8; 4]> = (0..4).map(patch).collect();
    assert_eq!(colors.iter().collect::<BTreeSet<_>>().len(), 4, "{colors:?}");
    for (row, label) in [1, 2, 3, 300].into_iter().enumerate() {
        let expected = sheetsplat::appearance::categories::color(label) * 255.0;
        let [r, g, b, _] = colors[row].map(f64::from);
        assert!(expected.distance(DVec3::new(r, g, b)) < 1.5, "{label}: {:?}", colors[row]);
        // The voxels have the same colours.
        let is_there = image.enumerate_pixels().any(|(x, _, pixel)| x > 80 && pixel.0 == colors[row]);
        assert!(is_there, "{label} is not in the picture");
    }
    assert_eq!(patch(4), [0, 0, 0, 255], "no more");
    // In a segmented volume, the labels with colours are listed.
    let segmented = "builtin:head:24 --set image={width=320,height=160} --annotate legend";
    let of = |sets: &str| folder.annotated(&format!("{segmented} --set transfer.label=[{sets}]"));
    let image = of(
        "{label=3,color=[[0,[1,0,0]]]},{label=5,color=[[0,[0,1,0]]]},{label=7,visible=false,color=[[0,[0,0,1]]]},{label=1,opacity=[[0,0]]}",
    );
    let patch = |row: u32| image.get_pixel(PAD + 5, PAD + LINE * row + 5).0;
    assert_eq!([patch(0), patch(1), patch(2)], [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 0, 255]]);
    // Names are shown too: "3 fluid around the brain" and "5 white matter".
    let start = PAD + 13;
    let text_end = |row: u32| {
        let rows = PAD + LINE * row..PAD + LINE * (row + 1);
        (0..start + 112).rev().find(|&x| rows.clone().any(|y| image.get_pixel(x, y).0[1] > 120)).unwrap()
    };
    let [long, short] = [text_end(0), text_end(1)].map(|end| end - start);
    assert!((86..=100).contains(&long) && (52..=64).contains(&short), "{long} {short}");
}

#[test]
fn a_long_legend_has_several_columns() {
    let folder = Folder::new();
    let label = |i: usize| i / (24 * 24) / 2 * 3 + i % 24 / 8;
    let values: Vec<f32> = (0..24 * 24 * 24).map(|i| if label(i) == 0 { 0.0 } else { label(i) as f32 + 9.0 }).collect();
    folder.write_nrrd("labels.nrrd", [24, 24, 24], [1.0, 1.0, 1.0], &values);
    let image = folder.annotated("labels.nrrd --set image={width=300,height=200} --annotate legend,scale");
    let patch = |column: u32, row: u32| image.get_pixel(PAD + 5 + column, PAD + LINE * row + 5).0;
    // 35 labels are in 17 rows above the scale bar; a column consists of a patch, a gap, two digits and a gap.
    let columns = [0, 30, 60];
    assert!(
        columns.iter().all(|&column| patch(column, 0)[..3] != [0; 3]),
        "{:?}",
        columns.map(|column| patch(column, 0))
    );
    folder
        .run("render labels.nrrd -o a.png --set image={width=100,height=100} --annotate legend,scale")
        .assert_failure(2, &["--annotate", "image.width", "100×100", "allowed: at least"]);
    assert!(!folder.path("a.png").exists());
}

#[test]
fn movies_and_sheets_are_annotated_too() {
    let folder = Folder::new();
    let cube = CUBE.replace("builtin:cube ", "builtin:cube --set camera.height=100 ");
    let still = folder.annotated(&cube);
    folder.run(&format!("orbit {cube} --count 2 --turn 90 -o %d.png")).assert_success();
    assert_eq!(folder.read("0.png"), folder.read("annotated.png"));
    assert_eq!(bar(&image::open(folder.path("1.png")).unwrap().into_rgba8()), bar(&still));
    folder.run(&format!("sweep {cube} --set camera.height=100,1000 -o sheet.png")).assert_success();
    let sheet = image::open(folder.path("sheet.png")).unwrap().into_rgba8();
    let tile = image::imageops::crop_imm(&sheet, 8, 8, 320, 200).to_image();
    assert!(tile == still);
}

#[test]
fn impossible_annotations_are_refused_by_name() {
    let folder = Folder::new();
    let values: Vec<f32> = (0..512).map(|i| (i / 64 / 2) as f32).collect();
    folder.write_nrrd("labels.nrrd", [8, 8, 8], [1.0, 1.0, 1.0], &values);
    let before = folder.names();
    for (arguments, words) in [
        (
            "render builtin:cube:8 -o a.png --annotate axes",
            &["--annotate", "axes", "scale", "colors", "legend", "sides"] as &[&str],
        ),
        ("render builtin:cube:8 -o a.exr --annotate scale", &["--annotate", "a.exr", "PNG"]),
        ("orbit builtin:cube:8 -o %d.npy --annotate scale", &["--annotate", "%d.npy", "PNG"]),
        (
            "render builtin:cube:8 -o a.png --annotate scale --set camera.projection=perspective",
            &["--annotate", "scale", "perspective", "orthographic"],
        ),
        (
            "render builtin:cube:8 -o a.png --annotate scale --set image.width=12",
            &["--annotate", "image.width", "12×512", "at least"],
        ),
        (
            "render builtin:cube:8 -o a.png --annotate colors --preset xray",
            &["--annotate", "colors", "xray", "any other"],
        ),
        ("render labels.nrrd -o a.png --annotate colors", &["--annotate", "colors", "labels", "legend"]),
        (
            "render builtin:cube:8 -o a.png --annotate colors --set transfer.opacity=[[0,0]]",
            &["colors", "opacity above 0"],
        ),
        ("render builtin:marschner-lobb:8 -o a.png --annotate legend", &["legend", "without labels", "segmented"]),
        ("render builtin:head:16 -o a.png --annotate legend", &["legend", "colour of its own", "labels"]),
    ] {
        folder.run(arguments).assert_failure(2, words);
        assert_eq!(folder.names(), before, "{arguments}");
    }
}
