//! `--annotate`: scale bar, colour bar, legend.

use image::RgbaImage;

use crate::*;

/// Pixels from the image's edges to a plate, and from the plate's edges to its content.
const MARGIN: u32 = 8;
const PADDING: u32 = 6;

/// The brightness of bars and text on a plate over black.
const INK: u8 = 230;

impl Folder {
    fn annotated(&self, arguments: &str) -> RgbaImage {
        self.render(&format!("{arguments} -o annotated.png"));
        image::open(self.path("annotated.png")).unwrap().into_rgba8()
    }
}

/// The length of the longest run of ink in a row of pixels.
fn longest_run(image: &RgbaImage, row: u32) -> usize {
    let is_ink: Vec<bool> = (0..image.width()).map(|x| image.get_pixel(x, row).0 == [INK, INK, INK, 255]).collect();
    is_ink.split(|ink| !ink).map(<[bool]>::len).max().unwrap()
}

/// The scale bar's length in pixels.
fn bar(image: &RgbaImage) -> usize {
    let bottom = image.height() - MARGIN - PADDING;
    let lengths: BTreeSet<usize> = (bottom - 3..bottom).map(|row| longest_run(image, row)).collect();
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
        let expected: f64 = length * 200.0 / height;
        assert!(expected <= 320.0 / 4.0 && expected * 2.5 >= 320.0 / 4.0, "{height}");
        assert_eq!(bar(&image), expected.round() as usize, "{height}");
    }
    // Compared with the picture: the cube's side is 32 units, seen head-on.
    let image = folder.annotated(&format!("{CUBE} --set camera.height=100 --set splatting.radius=1"));
    let lit = (0..320).filter(|&x| image.get_pixel(x, 100).0[0] > 90).count() as f64;
    assert!((lit / bar(&image) as f64 - 32.0 / 20.0).abs() < 0.06, "{lit} pixels");
    // In the volume's own unit.
    let image =
        folder.annotated(&format!("{CUBE} --set camera.height=0.01 --set volume.spacing=[0.0001,0.0001,0.0002]"));
    assert_eq!(bar(&image), 40, "0.002 units");
    // The text differs although the bar does not.
    let [first, second] =
        ["100", "1000"].map(|height| folder.annotated(&format!("{CUBE} --set camera.height={height}")));
    assert_eq!(bar(&first), bar(&second));
    let text = |image: &RgbaImage| image::imageops::crop_imm(image, MARGIN, 200 - 40, 100, 20).to_image();
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
fn a_plate_keeps_text_readable_on_any_background() {
    let folder = Folder::new();
    for background in ["[0,0,0,1]", "[1,1,1,1]", "[0.5,0.5,0.5,1]", "[1,1,1,0]"] {
        let image = folder.annotated(&format!("{CUBE} --set camera.height=100 --set image.background={background}"));
        let corner = image.get_pixel(MARGIN, 200 - MARGIN - 1).0;
        let ink = image.get_pixel(MARGIN + 36, 200 - MARGIN - PADDING - 2).0;
        assert!(ink[3] == 255 && ink[0] >= INK - 1, "{background} {ink:?}");
        assert!(corner[0] < 80 && corner[3] > 180, "{background}: {corner:?}");
        // The rest of the image is unchanged.
        folder.render(&format!(
            "{} --set camera.height=100 --set image.background={background} -o plain.png",
            &CUBE[..CUBE.len() - 17]
        ));
        let plain = image::open(folder.path("plain.png")).unwrap().into_rgba8();
        for (x, y, pixel) in plain.enumerate_pixels() {
            let is_plate = x < 120 && y > 140;
            assert!(is_plate || pixel == image.get_pixel(x, y), "{background} {x} {y}");
        }
    }
}

#[test]
fn a_colour_bar_has_the_transfer_functions_colours() {
    let folder = Folder::new();
    let ramp = "--set transfer.color=[[0,[1,0,0]],[255,[0,0,1]]] --set transfer.opacity=[[0,0.4]]";
    let image = folder
        .annotated(&format!("builtin:marschner-lobb:12 {ramp} --set image={{width=200,height=160}} --annotate colors"));
    // The bar has half of the image's height, in the middle; most of it is blue above and red below.
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
    assert_eq!(colored.len(), 80, "{colored:?}");
    let [top, bottom] = [rows[colored[0]], rows[colored[79]]];
    assert!(top[2] > 220 && top[0] < 35 && bottom[0] > 220 && bottom[2] < 35, "{top:?} {bottom:?}");
    assert!(colored.windows(2).all(|pair| rows[pair[0]][0] <= rows[pair[1]][0]), "from above to below");
    // Ticks and numbers are beside it.
    let light = |x: u32| (0..160).filter(|&y| image.get_pixel(x, y).0[1] > 120).count();
    assert_eq!(light(column + 2), 2, "ticks at 100 and 200");
    assert!((column + 8..190).map(light).sum::<usize>() > 60, "numbers");
}

#[test]
fn a_projections_colour_bar_is_as_bright_as_the_projection() {
    let folder = Folder::new();
    let image =
        folder.annotated("builtin:marschner-lobb:12 --preset mip --set image={width=200,height=160} --annotate colors");
    // Colours are grey, and darker downwards, in the column that is grey throughout.
    let greys = |x: u32| -> Vec<u8> { (41..119).map(|y| image.get_pixel(x, y).0[0]).collect() };
    let falls = |greys: &Vec<u8>| greys.windows(2).all(|pair| pair[0] >= pair[1]) && greys[0] > 235 && greys[77] < 60;
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
    let patch = |row: u32| image.get_pixel(MARGIN + PADDING + 10, MARGIN + PADDING + 16 * row + 8).0;
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
    let patch = |row: u32| image.get_pixel(MARGIN + PADDING + 10, MARGIN + PADDING + 16 * row + 8).0;
    assert_eq!([patch(0), patch(1), patch(2)], [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 0, 255]]);
    // Names are shown too: "3 fluid around the brain" and "5 white matter".
    let text_end = |row: u32| {
        let rows = MARGIN + PADDING + 16 * row..MARGIN + PADDING + 16 * (row + 1);
        (0..320).rev().find(|&x| rows.clone().any(|y| image.get_pixel(x, y).0[1] > 120)).unwrap()
    };
    let start = MARGIN + PADDING + 26;
    assert_eq!([text_end(0), text_end(1)].map(|end| (end - start) / 7 + 1), [24, 14]);
}

#[test]
fn a_long_legend_has_several_columns() {
    let folder = Folder::new();
    let label = |i: usize| i / (24 * 24) / 2 * 3 + i % 24 / 8;
    let values: Vec<f32> = (0..24 * 24 * 24).map(|i| if label(i) == 0 { 0.0 } else { label(i) as f32 + 9.0 }).collect();
    folder.write_nrrd("labels.nrrd", [24, 24, 24], [1.0, 1.0, 1.0], &values);
    let image = folder.annotated("labels.nrrd --set image={width=300,height=200} --annotate legend,scale");
    let patch =
        |column: u32, row: u32| image.get_pixel(MARGIN + PADDING + 10 + column, MARGIN + PADDING + 16 * row + 8).0;
    // 35 labels are in 8 rows above the scale bar; a column consists of a patch, a gap, two digits and a gap.
    let columns = [0, 54, 108, 162, 216];
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
    let tile = image::imageops::crop_imm(&sheet, MARGIN, MARGIN, 320, 200).to_image();
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
            &["--annotate", "axes", "scale", "colors", "legend"] as &[&str],
        ),
        ("render builtin:cube:8 -o a.exr --annotate scale", &["--annotate", "a.exr", "PNG"]),
        ("orbit builtin:cube:8 -o %d.npy --annotate scale", &["--annotate", "%d.npy", "PNG"]),
        (
            "render builtin:cube:8 -o a.png --annotate scale --set camera.projection=perspective",
            &["--annotate", "scale", "perspective", "orthographic"],
        ),
        (
            "render builtin:cube:8 -o a.png --annotate scale --set image.width=40",
            &["--annotate", "image.width", "40×512", "at least"],
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
        ("render builtin:head:16 -o a.png --annotate legend", &["legend", "colour of its own", "--preset labels"]),
    ] {
        folder.run(arguments).assert_failure(2, words);
        assert_eq!(folder.names(), before, "{arguments}");
    }
}
