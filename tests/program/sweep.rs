//! `sheetsplat sweep`: contact sheets.

use image::RgbaImage;

use crate::*;

/// Pixels around cells, and the height of a line of text.
const MARGIN: u32 = 8;
const LINE: u32 = 16;

/// Wide enough for the labels in these tests.
const WIDE: &str = "builtin:marschner-lobb:12 --set image.width=300 --set image.height=40 \
                    --set transfer.opacity=[[60,0],[200,0.6]] --set camera.direction=[0.3,0.9,-0.2]";
const WIDTH: u32 = 300;
const HEIGHT: u32 = 40;

impl Folder {
    fn sweep(&self, arguments: &str) -> RgbaImage {
        let run = self.run(&format!("sweep {arguments} -o sheet.png"));
        run.assert_success();
        assert!(!run.stderr.contains(['\r', '\x1b', '[']), "progress is for terminals: {arguments}\n{}", run.stderr);
        self.image("sheet.png")
    }

    fn image(&self, name: &str) -> RgbaImage {
        image::open(self.path(name)).unwrap().into_rgba8()
    }

    /// Asserts that the tile with this upper left corner equals the image that `render` gives.
    fn assert_tile(&self, sheet: &RgbaImage, corner: [u32; 2], arguments: &str) {
        self.render(&format!("{arguments} -o tile.png"));
        let tile = self.image("tile.png");
        let shown = image::imageops::crop_imm(sheet, corner[0], corner[1], tile.width(), tile.height()).to_image();
        assert!(shown == tile, "{arguments} is not at {corner:?}");
    }
}

/// The part of a sheet that contains a tile's label.
fn label(sheet: &RgbaImage, [x, y]: [u32; 2], lines: u32) -> RgbaImage {
    image::imageops::crop_imm(sheet, x, y, WIDTH, lines * LINE).to_image()
}

/// Whether the part contains text, light on dark.
fn is_written(label: &RgbaImage) -> bool {
    let light = label.pixels().filter(|pixel| pixel.0[0] > 150).count();
    light > 40 && light < label.pixels().len() / 5
}

#[test]
fn one_swept_setting_is_a_row_of_tiles() {
    let folder = Folder::new();
    let sheet = folder.sweep(&format!("{WIDE} --set splatting.slab_width=0.5,1,2"));
    assert_eq!(sheet.dimensions(), (3 * (WIDTH + MARGIN) + MARGIN, HEIGHT + LINE + 2 * MARGIN));
    let corner = |column: u32| [MARGIN + column * (WIDTH + MARGIN), MARGIN];
    let below = |column: u32| label(&sheet, [corner(column)[0], MARGIN + HEIGHT], 1);
    for (column, width) in [0, 1, 2].into_iter().zip(["0.5", "1", "2"]) {
        folder.assert_tile(&sheet, corner(column), &format!("{WIDE} --set splatting.slab_width={width}"));
        assert!(is_written(&below(column)), "{column}");
    }
    assert!(below(0) != below(1) && below(1) != below(2), "labels say the values");
    assert_eq!(folder.names(), ["sheet.png", "tile.png"].map(str::to_owned).into());
}

#[test]
fn rows_can_be_shorter() {
    let folder = Folder::new();
    let sheet = folder.sweep(&format!("{WIDE} --set splatting.slab_width=0.5,1,2 --columns 2"));
    assert_eq!(sheet.dimensions(), (2 * (WIDTH + MARGIN) + MARGIN, 2 * (HEIGHT + LINE + MARGIN) + MARGIN));
    let second_row = MARGIN + HEIGHT + LINE + MARGIN;
    folder.assert_tile(&sheet, [MARGIN, second_row], &format!("{WIDE} --set splatting.slab_width=2"));
    let rest = image::imageops::crop_imm(&sheet, WIDTH + 2 * MARGIN, second_row, WIDTH, HEIGHT + LINE).to_image();
    assert!(rest.pixels().all(|pixel| pixel == sheet.get_pixel(0, 0)), "nothing is where no tile is");
}

#[test]
fn two_swept_settings_are_a_grid() {
    let folder = Folder::new();
    let axes = "--set camera.direction=[1,0,0],[0,1,0.5],[0,1,0] --set splatting.compositing=linear,xray";
    let sheet = folder.sweep(&format!("{WIDE} {axes}"));
    let cell = [WIDTH + MARGIN, HEIGHT + 2 * LINE + MARGIN];
    assert_eq!(sheet.dimensions(), (3 * cell[0] + MARGIN, 2 * cell[1] + MARGIN));
    for (row, compositing) in [0, 1].into_iter().zip(["linear", "xray"]) {
        for (column, direction) in [0, 1, 2].into_iter().zip(["[1,0,0]", "[0,1,0.5]", "[0,1,0]"]) {
            let corner = [MARGIN + column * cell[0], MARGIN + row * cell[1]];
            let sets = format!("--set camera.direction={direction} --set splatting.compositing={compositing}");
            folder.assert_tile(&sheet, corner, &format!("{WIDE} {sets}"));
            for line in 0..2 {
                assert!(is_written(&label(&sheet, [corner[0], corner[1] + HEIGHT + line * LINE], 1)), "{sets}");
            }
        }
    }
}

#[test]
fn volumes_and_sizes_can_be_swept() {
    let folder = Folder::new();
    let sheet = folder.sweep(&format!("{WIDE} --set volume.builtin=cube:8,marschner-lobb:12 --set image.height=30,40"));
    let cell = [WIDTH + MARGIN, HEIGHT + 2 * LINE + MARGIN];
    for (column, row, sets) in [
        (0, 0, "--set volume.builtin=cube:8 --set image.height=30"),
        (1, 0, "--set volume.builtin=marschner-lobb:12 --set image.height=30"),
        (0, 1, "--set volume.builtin=cube:8 --set image.height=40"),
    ] {
        folder.assert_tile(&sheet, [MARGIN + column * cell[0], MARGIN + row * cell[1]], &format!("{WIDE} {sets}"));
    }
    assert!(is_written(&label(&sheet, [MARGIN, MARGIN + 30], 2)), "labels are just below their tiles");
}

#[test]
fn bad_usage_and_input_are_2_and_leave_nothing() {
    let folder = Folder::new();
    for (arguments, words) in [
        ("-o sheet.png", &["--set", "found none", "splatting.slab_width=0.5,1,2"] as &[&str]),
        ("-o sheet.jpg --set splatting.radius=1,2", &["sheet.jpg", ".jpg", ".png"]),
        (
            "-o s.png --set splatting.radius=1,2 --set splatting.falloff=1,2 --set image.width=8,9",
            &["--set", "splatting.radius, splatting.falloff, image.width", "one or two"],
        ),
        ("-o s.png --set splatting.radius=1,2,9", &["--set", "splatting.radius", "9", "[1, 4]"]),
        ("-o s.png --set splatting.radius=1,", &["--set", "splatting.radius", "\"\""]),
        ("-o s.png --set splatting.radius=1,2 --set splatting.radius=3", &["--set", "splatting.radius", "found again"]),
        ("-o s.png --set nonesuch.key=1,2", &["nonesuch"]),
        ("-o s.png --set splatting.radius=1,2 --set splatting.falloff=1,2 --columns 2", &["--columns", "2", "one"]),
        ("-o s.png --set splatting.radius=1,2 --columns 0", &["--columns", "0"]),
        ("-o s.png --set splatting.radius=1,2 --set image.width=20000", &["s.png", "2 tiles", "16384"]),
        ("-o s.png --set splatting.radius=1,2 --set image.width=4294967295", &["s.png", "2 tiles", "16384"]),
        ("-o s.png --set volume.builtin=cube:8,nonesuch", &["nonesuch"]),
    ] {
        folder.run(&format!("sweep {WIDE} {arguments}")).assert_failure(2, words);
        assert_eq!(folder.names(), BTreeSet::new(), "{arguments}");
    }
    folder.run("sweep gone.toml -o s.png --set splatting.radius=1,2").assert_failure(2, &["gone.toml"]);
    let fails = |code: i32, arguments: &str, words: &[&str]| {
        folder.run(&format!("sweep {WIDE} {arguments}")).assert_failure(code, words);
    };
    fails(1, "-o s.png --set splatting.radius=1,2 --adapter nonesuch", &["nonesuch", &adapter()]);
    fails(2, "-o no/s.png --set splatting.radius=1,2", &["no/s.png", "the folder no: No such file"]);
    assert_eq!(folder.names(), BTreeSet::new());
}

#[test]
fn times_are_swept() {
    let folder = Folder::new();
    let times = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures/channels/times.nii");
    let look = format!(
        "{times} --set image={{width=300,height=40}} --set transfer={{opacity=[[0,0],[25000,0.9]],color=[[0,[0,0,1]],[20000,[1,1,0]]]}}"
    );
    let sheet = folder.sweep(&format!("{look} --set volume.time=0,2"));
    for (column, time) in [0, 2].into_iter().enumerate() {
        folder.assert_tile(
            &sheet,
            [MARGIN + column as u32 * (WIDTH + MARGIN), MARGIN],
            &format!("{look} --time {time}"),
        );
    }
    let tile = |column: u32| {
        image::imageops::crop_imm(&sheet, MARGIN + column * (WIDTH + MARGIN), MARGIN, WIDTH, HEIGHT).to_image()
    };
    assert!(tile(0) != tile(1), "the times differ");
}

/// Every key of a volume makes another one, not only its file.
#[test]
fn tables_of_labels_are_swept() {
    let folder = Folder::new();
    folder.write("red.txt", "1 skin 255 0 0\n");
    folder.write("blue.txt", "1 skin 0 0 255\n");
    let look = "builtin:head:16 --preset labels --set image={width=300,height=40}";
    let sheet = folder.sweep(&format!("{look} --set volume.label_table=red.txt,blue.txt"));
    let tile = |column: u32, name: &str| {
        let corner = [MARGIN + column * (WIDTH + MARGIN), MARGIN];
        folder.assert_tile(&sheet, corner, &format!("{look} --set volume.label_table={name}.txt"));
        image::imageops::crop_imm(&sheet, corner[0], corner[1], WIDTH, HEIGHT).to_image()
    };
    assert!(tile(0, "red") != tile(1, "blue"), "the tables differ");
}
