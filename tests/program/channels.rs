//! Several channels and times (SPEC §10) on the command line.

use std::io::Write;

use crate::*;

/// Two channels at three times, by ImageJ.
const IMAGEJ: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures/channels/imagej.tif");

/// Colours in bytes, by NumPy.
const COLORS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures/colors/rgb.npy");

/// Shows every time of both channels differently.
const LOOK: &str = "--backend cpu --set image={width=28,height=20} --set camera.fit=volume \
                    --set channel[0].transfer={opacity=[[0,0],[25000,0.6]],color=[[0,[0,0,1]],[20000,[1,1,0]]]} \
                    --set channel[1].transfer={opacity=[[0,0],[30000,0.6]],color=[[0,[1,0,0]],[21000,[0,1,0.5]]]}";

fn text(folder: &Folder, name: &str) -> String {
    String::from_utf8(folder.read(name)).unwrap()
}

/// The same scene with a volume for every channel: one file, by two numbers.
const TWO_TABLES: &str = "
    [camera]
    fit = 'volume'
    [image]
    width = 28
    height = 20
    [[channel]]
    volume = {path = 'FILE', index = 0}
    transfer = {opacity = [[0, 0], [25000, 0.6]], color = [[0, [0, 0, 1]], [20000, [1, 1, 0]]]}
    [[channel]]
    volume = {path = 'FILE', index = 1}
    transfer = {opacity = [[0, 0], [30000, 0.6]], color = [[0, [1, 0, 0]], [21000, [0, 1, 0.5]]]}
";

#[test]
fn saved_time_series_of_several_channels_turn_and_are_swept() {
    let folder = Folder::new();
    let run =
        folder.run(&format!("orbit {IMAGEJ} {LOOK} --set camera.direction=[0,1,0] --time 0..3 --turn 60 --count 3 --no-metadata -o a%d.png --save-scene s.toml"));
    run.assert_success();
    let frames: BTreeSet<Vec<u8>> = (0..3).map(|frame| folder.read(&format!("a{frame}.png"))).collect();
    assert_eq!(frames.len(), 3, "all times differ");
    let saved = text(&folder, "s.toml");
    assert_eq!((saved.matches("[[channel]]").count(), saved.matches("path = ").count()), (2, 1), "{saved}");
    folder.write("two.toml", TWO_TABLES.replace("FILE", IMAGEJ));
    for scene in ["s.toml", "two.toml"] {
        let run = folder
            .run(&format!("orbit {scene} --backend cpu --time 0..3 --turn 60 --count 3 --no-metadata -o b%d.png"));
        run.assert_success();
        for frame in 0..3 {
            let [first, second] = ["a", "b"].map(|name| folder.read(&format!("{name}{frame}.png")));
            assert!(first == second, "{scene}, frame {frame}");
            fs::remove_file(folder.path(&format!("b{frame}.png"))).unwrap();
        }
        // The times of one scene below one another, and one by one.
        folder.run(&format!("sweep {scene} --backend cpu --set volume.time=0,2 -o sheet.png")).assert_success();
        let sheet = image::open(folder.path("sheet.png")).unwrap().into_rgba8();
        let tiles: Vec<_> = [0, 2]
            .into_iter()
            .enumerate()
            .map(|(column, time)| {
                folder.render(&format!("{scene} --backend cpu --time {time} -o one.png"));
                let one = image::open(folder.path("one.png")).unwrap().into_rgba8();
                let wide = sheet.width() / 2;
                let found = (0..wide).find(|&left| {
                    let left = column as u32 * wide + left;
                    let fits = left + 28 <= sheet.width();
                    fits && image::imageops::crop_imm(&sheet, left, 8, 28, 20).to_image() == one
                });
                assert!(found.is_some(), "{scene}: time {time} is not in the sheet");
                one
            })
            .collect();
        assert!(tiles[0] != tiles[1], "{scene}");
        folder
            .run(&format!("orbit {scene} --time 1..4 --count 2 -o no%d.png"))
            .assert_failure(2, &["--time: found 1..4, allowed: within 0..3, the times of"]);
    }
    // The level of one file, and its spacing, are those of all of its channels too.
    folder.render("two.toml --backend cpu --spacing 1,2,3 --no-metadata -o two.png");
    let run =
        folder.run("render two.toml --backend cpu --set channel[0].volume.spacing=[1,2,3] --no-metadata -o no.png");
    run.assert_success();
    assert!(run.stderr.contains("channel[1].volume: resampled from [5, 4, 3] to [5, 4, 3] voxels"), "{}", run.stderr);
    assert!(folder.read("two.png") != folder.read("no.png"));
}

#[test]
fn one_channel_is_chosen() {
    let folder = Folder::new();
    folder.render(&format!("{IMAGEJ} {LOOK} --no-metadata -o both.png --save-scene s.toml"));
    let both = folder.read("both.png");
    let of = |arguments: &str| {
        folder.render(&format!("{arguments} --backend cpu --no-metadata -o one.png"));
        folder.read("one.png")
    };
    assert!(of("s.toml") == both);
    let mut different = BTreeSet::from([both]);
    for (number, other) in [(0, 1), (1, 0)] {
        let chosen = of(&format!("s.toml --channel {number}"));
        let hidden = of(&format!("s.toml --set channel[{other}].visible=false"));
        assert!(chosen == hidden, "channel {number}");
        different.insert(chosen);
    }
    assert_eq!(different.len(), 3);
    // A channel that was hidden is shown where it is the only one.
    folder.write("hidden.toml", text(&folder, "s.toml").replace("[[channel]]", "[[channel]]\nvisible = false"));
    assert!(of("hidden.toml --channel 1") == of("s.toml --channel 1"));
    // Of one channel there is no second table.
    let run = folder.run("render s.toml --channel 1 --set channel[1].visible=false -o no.png");
    run.assert_failure(2, &["channel: found tables for 2 channels, allowed: at most 1"]);
    folder.write("two.toml", TWO_TABLES.replace("FILE", IMAGEJ));
    // Where every channel names its volume, the first one's number changes.
    assert!(of("two.toml --channel 1") == of("two.toml --set channel[0].volume.index=1"));
    for input in [IMAGEJ, "s.toml", "two.toml"] {
        let run = folder.run(&format!("render {input} --channel 2 -o no.png"));
        run.assert_failure(2, &["channel: found 2, allowed: 0 to 1"]);
        let run = folder.run(&format!("render {input} --channel x -o no.png"));
        run.assert_failure(2, &["--channel: found \"x\" (string)"]);
    }
}

#[test]
fn one_time_fits_where_two_do_not() {
    let folder = Folder::new();
    // Three times of two channels of 32³ bytes, which take 64 KiB of memory a time.
    let header = "{'descr': '|u1', 'fortran_order': False, 'shape': (3, 2, 32, 32, 32), }\n";
    let mut file = b"\x93NUMPY\x01\x00".to_vec();
    file.write_all(&(header.len() as u16).to_le_bytes()).unwrap();
    file.write_all(header.as_bytes()).unwrap();
    let ball = |at: usize, volume: usize| {
        let [x, y, z] = [at % 32, at / 32 % 32, at / 1024].map(|place| place as f64 - 15.5);
        let radius = 6.0 + volume as f64;
        (200.0 * (1.0 - (x * x + y * y + z * z).sqrt() / radius)).max(0.0) as u8
    };
    for volume in 0..6 {
        let bytes: Vec<u8> = (0..32_usize.pow(3)).map(|at| ball(at, volume)).collect();
        file.write_all(&bytes).unwrap();
    }
    folder.write("times.npy", file);
    let small = "times.npy --backend cpu --set image={width=24,height=24} --turn 0 --count 3";
    folder.run(&format!("orbit {small} --time 0..3 --memory 70000B -o f%d.png")).assert_success();
    let frames: BTreeSet<Vec<u8>> = (0..3).map(|frame| folder.read(&format!("f{frame}.png"))).collect();
    assert_eq!(frames.len(), 3, "all times differ");
    // Less than one time needs.
    let run = folder.run(&format!("orbit {small} --time 0..3 --memory 60000B -o no%d.png"));
    run.assert_failure(2, &["times.npy", "memory"]);
}

#[test]
fn info_lists_channels_and_times() {
    let folder = Folder::new();
    let info = |arguments: &str| {
        let run = folder.run(&format!("info {arguments}"));
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        run.stdout
    };
    let json = |arguments: &str| -> Value { serde_json::from_str(&info(&format!("{arguments} --json"))).unwrap() };
    let both = json(IMAGEJ);
    assert_eq!([&both["channels"], &both["times"]], [2, 3]);
    assert_eq!([&both["max"], &both["preset"]], [&Value::from(234.0), &Value::from("confocal")]);
    let text = info(IMAGEJ);
    assert!(text.contains("\nchannels     2; what follows is about channel 0\n"), "{text}");
    assert!(text.contains("\ntimes        3; what follows is about one, by --time\n"), "{text}");
    // One of them.
    let one = json(&format!("{IMAGEJ} --channel 1 --time 2"));
    assert_eq!([&one["channels"], &one["times"]], [2, 3]);
    assert_eq!([&one["min"], &one["max"]], [21000.0, 21234.0]);
    assert!(info(&format!("{IMAGEJ} --channel 1")).contains("what follows is about channel 1\n"));
    // Names, where the file has them, or the scene.
    let named = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures/channels/ome-tczyx.tif");
    assert!(info(named).contains("\nchannels     2: 0 nuclei, 1 membranes; what follows is about channel 0\n"));
    assert_eq!(json(named)["channel_names"], serde_json::json!(["nuclei", "membranes"]));
    assert_eq!(json(IMAGEJ)["channel_names"], serde_json::json!([null, null]));
    assert_eq!(json("builtin:cube:8")["channel_names"], serde_json::json!([null]));
}

#[test]
fn a_volume_of_colours_suggests_its_preset_and_shows_its_colours() {
    let folder = Folder::new();
    let run = folder.run(&format!("info {COLORS} --json"));
    let info: Value = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!(
        [&info["colors"], &info["preset"], &info["channels"]],
        [&Value::from(true), &Value::from("photo"), &Value::from(1)]
    );
    let text = folder.run(&format!("info {COLORS}")).stdout;
    assert!(text.contains("\ncolors       every voxel has its own; what follows is about their luminance\n"), "{text}");
    assert!(text.contains("\npreset       photo\n"), "{text}");
    // Red to the left, green to the right, all of one luminance.
    let header = "{'descr': '|u1', 'fortran_order': False, 'shape': (16, 16, 16, 3), }\n";
    let mut file = b"\x93NUMPY\x01\x00".to_vec();
    file.write_all(&(header.len() as u16).to_le_bytes()).unwrap();
    file.write_all(header.as_bytes()).unwrap();
    for at in 0..16_usize.pow(3) {
        let inside = [at % 16, at / 16 % 16, at / 256].iter().all(|place| (4..12).contains(place));
        let color: [u8; 3] = match (inside, at % 16 < 8) {
            (false, _) => [0; 3],
            (true, true) => [240, 0, 0],
            (true, false) => [0, 71, 0],
        };
        file.write_all(&color).unwrap();
    }
    folder.write("colors.npy", file);
    let side = "--backend cpu --set image={width=64,height=64} --set camera={direction=[0,0,1],up=[0,-1,0]}";
    // Cut open, because at a surface the colours are those between the matter's and the air's.
    let (width, _, pixels) = folder.pixels(&format!("colors.npy --preset photo {side} --set clip.planes=[[0,0,1,0]]"));
    let at = |x: usize| pixels[32 * width + x];
    let [left, right] = [at(20), at(43)];
    assert!((left[0] - 240.0 / 255.0).abs() < 0.02 && left[1] < 0.02 && left[2] < 0.02, "{left:?}");
    assert!((right[1] - 71.0 / 255.0).abs() < 0.02 && right[0] < 0.02 && right[2] < 0.02, "{right:?}");
    // A volume of values is gray.
    let (.., pixels) = folder.pixels(&format!("builtin:head:24 --preset photo {side}"));
    assert!(pixels.iter().all(|[red, green, blue, _]| red == green && green == blue));
    assert!(pixels.iter().filter(|pixel| pixel[0] > 0.4).count() > 500);
}

#[test]
fn channels_have_a_legend_and_a_colour_bar_each() {
    let folder = Folder::new();
    let wide = LOOK.replace("width=28,height=20", "width=400,height=160");
    let open = |arguments: &str| {
        folder.render(&format!("{arguments} -o annotated.png"));
        image::open(folder.path("annotated.png")).unwrap().into_rgba8()
    };
    let plain = open(&format!("{IMAGEJ} {wide}"));
    // Two patches, from a channel's colour at its lowest value to that at its highest: blue and red, where values are low.
    let legend = open(&format!("{IMAGEJ} {wide} --annotate legend"));
    let patch = |row: u32| legend.get_pixel(9, 9 + 10 * row).0;
    let [first, second, third] = [0, 1, 2].map(patch);
    assert!(first[2] > 240 && first[0] < 10 && second[0] > 230 && second[2] < 20, "{first:?} {second:?}");
    assert_eq!(third, plain.get_pixel(0, 0).0, "no more");
    // Hidden channels are left out, and names are those of the scene.
    let hidden = open(&format!("{IMAGEJ} {wide} --set channel[0].visible=false --annotate legend"));
    assert_eq!(hidden.get_pixel(9, 9).0, second);
    let named = open(&format!("{IMAGEJ} {wide} --set channel[0].name=nuclei --annotate legend"));
    assert!(named != legend && named.get_pixel(9, 9) == legend.get_pixel(9, 9));
    // Colour bars stand side by side at the right.
    let bars = open(&format!("{IMAGEJ} {wide} --annotate colors"));
    let count = |is: fn(&[u8; 4]) -> bool| {
        (200..400).filter(|&x| (60..100).all(|y| is(&bars.get_pixel(x, y).0))).collect::<Vec<u32>>()
    };
    let blue = count(|color| color[2] > 240 && color[0] < 10);
    let red = count(|color| color[0] > 230 && color[2] < 20);
    assert_eq!((blue.len(), red.len()), (6, 6), "{blue:?} {red:?}");
    assert!(blue.iter().max() < red.iter().min());
    // Labels stand in the legend one by one, and have no bar.
    let values: Vec<f32> = (0..4096_usize).map(|at| [0.0, 1.0, 2.0, 9.0][at % 16 / 4]).collect();
    folder.write_nrrd("labels.nrrd", [16; 3], [1.0; 3], &values);
    let amounts: Vec<f32> = (0..4096_usize).map(|at| ((at / 256) as f32 * 0.4).sin()).collect();
    folder.write_nrrd("amounts.nrrd", [16; 3], [1.0; 3], &amounts);
    folder.write(
        "labels.toml",
        "image = {width = 400, height = 160}\n[[channel]]\nvolume.path = 'amounts.nrrd'\n[[channel]]\nvolume.path = 'labels.nrrd'",
    );
    let image = open("labels.toml --backend cpu --annotate legend");
    for (row, label) in [(1, 1), (2, 2), (3, 9)] {
        let expected = sheetsplat::appearance::categories::color(label) * 255.0;
        let [red, green, blue, _] = image.get_pixel(9, 9 + 10 * row).0.map(f64::from);
        assert!(expected.distance(DVec3::new(red, green, blue)) < 1.5, "{label}");
    }
    assert!(open("labels.toml --backend cpu --annotate colors") != open("labels.toml --backend cpu"));
    let none = "--set channel[0].visible=false --set channel[1].visible=false";
    let run = folder.run(&format!("render labels.toml {none} --annotate legend -o no.png"));
    run.assert_failure(2, &["--annotate: legend: found no channel with an opacity above 0"]);
    let run = folder.run(&format!("render labels.toml {none} --annotate colors -o no.png"));
    run.assert_failure(2, &["--annotate: colors: found no voxel with an opacity above 0"]);
}

#[test]
fn a_resampled_channel_is_warned_about() {
    let folder = Folder::new();
    let amounts: Vec<f32> = (0..512_usize).map(|at| (at / 64) as f32 * 0.3).collect();
    folder.write_nrrd("mr.nrrd", [8; 3], [1.0; 3], &amounts);
    folder.write_nrrd("pet.nrrd", [8; 3], [1.5; 3], &amounts);
    let labels: Vec<f32> = (0..512_usize).map(|at| [0.0, 3.0, 4.0, 5.0][at % 8 / 2]).collect();
    folder.write_nrrd("labels.nrrd", [8; 3], [1.5; 3], &labels);
    let channels = ["mr", "pet", "labels"].map(|name| format!("[[channel]]\nvolume.path = '{name}.nrrd'\n"));
    folder.write("three.toml", channels.concat());
    let run = folder.run("render three.toml --backend cpu --set image={width=16,height=16} -o three.png");
    run.assert_success();
    for line in [
        "pet.nrrd: channel[1].volume: resampled from [8, 8, 8] to [8, 8, 8] voxels, the first channel's\n",
        "labels.nrrd: channel[2].volume: resampled from [8, 8, 8] to [8, 8, 8] voxels, the first channel's, each label the nearest one\n",
    ] {
        assert!(run.stderr.contains(line), "no {line:?} in\n{}", run.stderr);
    }
    // What lies on the first one's grid is not resampled.
    folder.write("two.toml", format!("{0}{0}", channels[0]));
    let run = folder.run("render two.toml --backend cpu --set image={width=16,height=16} -o two.png");
    run.assert_success();
    assert!(!run.stderr.contains("resampled"), "{}", run.stderr);
}
