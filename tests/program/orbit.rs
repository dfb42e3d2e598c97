//! `sheetsplat orbit`: turntables, in parts and as movies.

use glam::DMat3;
use image::AnimationDecoder;

use crate::*;

/// Frames that all differ from one another.
const TURNING: &str = "builtin:marschner-lobb:12 --set image.width=28 --set image.height=20 \
                       --set transfer.opacity=[[60,0],[200,0.6]] --set camera={direction=[0.3,0.9,-0.2],up=[0.1,0,1],fit='volume'}";

impl Folder {
    fn orbit(&self, arguments: &str) {
        let run = self.run(&format!("orbit {arguments}"));
        run.assert_success();
        assert!(!run.stderr.contains(['\r', '\x1b', '[']), "progress is for terminals: {arguments}\n{}", run.stderr);
    }
}

fn set(names: &[&str]) -> BTreeSet<String> {
    names.iter().map(|&name| name.to_owned()).collect()
}

#[test]
fn frames_are_the_same_however_they_are_shared_out() {
    for (rasterizer, extension) in RASTERIZERS.iter().zip(["png", "npy"]) {
        let folder = Folder::new();
        let turning = format!("{TURNING} {rasterizer} --turn 100 --count 4");
        folder.orbit(&format!("{turning} -o all-%02d.{extension}"));
        folder.orbit(&format!("{turning} -o part-##.{extension} --frames 2..4"));
        folder.orbit(&format!("{turning} -o part-##.{extension} --frames 0..2"));
        let mut frames = BTreeSet::new();
        for frame in 0..4 {
            let all = folder.read(&format!("all-0{frame}.{extension}"));
            assert_eq!(all, folder.read(&format!("part-0{frame}.{extension}")), "frame {frame}");

            let rotation =
                DMat3::from_axis_angle(DVec3::new(0.1, 0.0, 1.0).normalize(), (25.0 * f64::from(frame)).to_radians());
            let [x, y, z] = (rotation * DVec3::new(0.3, 0.9, -0.2)).to_array();
            folder.render(&format!(
                "{TURNING} {rasterizer} --set camera.direction=[{x:?},{y:?},{z:?}] -o one.{extension}"
            ));
            assert_eq!(all, folder.read(&format!("one.{extension}")), "frame {frame}");
            frames.insert(all);
        }
        assert_eq!(frames.len(), 4, "all frames differ");
    }
}

#[test]
fn the_camera_turns_by_the_right_hand_and_ends_a_step_early() {
    let folder = Folder::new();
    let from = |direction: &str| folder.pixels(&format!("{SMALL} {WHOLE} --set camera.direction={direction}"));
    folder.orbit(&format!("{SMALL} {WHOLE} --set camera.direction=[0,1,0] --count 4 -o %d.npy"));
    assert_eq!(folder.names(), set(&["#.npy.made", "0.npy", "1.npy", "2.npy", "3.npy"]));
    for (frame, direction) in ["[0,1,0]", "[-1,0,0]", "[0,-1,0]", "[1,0,0]"].into_iter().enumerate() {
        let (.., turned) = folder.read_npy(&format!("{frame}.npy"));
        let decibels = psnr(&turned, &from(direction).2, BLACK, 50);
        assert_at_least(decibels, 120.0, format_args!("frame {frame}"));
    }
    folder.orbit(&format!(
        "{SMALL} {WHOLE} --set camera.direction=[0,1,0] --turn -180 --count 2 --frames 1..2 -o back-%d.npy"
    ));
    let (.., turned) = folder.read_npy("back-1.npy");
    assert_at_least(psnr(&turned, &from("[1,0,0]").2, BLACK, 50), 120.0, "turned back");
}

#[test]
fn existing_images_are_not_drawn_again() {
    let folder = Folder::new();
    let drawn = |arguments: &str| {
        let run = folder.run(format!("orbit {TURNING} --count 3 -o f%d.png {arguments}").trim());
        run.assert_success();
        run.stderr.lines().filter(|line| line.contains("kept")).map(str::to_owned).collect::<String>()
    };
    folder.write("f1.png", "not an image");
    assert_eq!(drawn(""), "");
    assert_eq!(folder.names(), set(&["f#.png.made", "f0.png", "f1.png", "f2.png"]), "nothing else stays");
    let frames = || ["f0.png", "f1.png", "f2.png"].map(|name| folder.read(name));
    let first = frames();
    fs::remove_file(folder.path("f2.png")).unwrap();
    assert_eq!(drawn(""), "2 of 3 frames are kept, drawn before");
    assert_eq!(frames(), first);
    // If every frame exists already, no device is needed.
    assert_eq!(drawn("--adapter nonesuch"), "3 of 3 frames are kept, drawn before");
    // Names are not believed: empty, damaged and exchanged frames are drawn again, and those of another scene.
    folder.write("f0.png", "");
    folder.write("f1.png", &first[1][..first[1].len() - 1]);
    assert_eq!(drawn(""), "1 of 3 frames are kept, drawn before");
    assert_eq!(frames(), first);
    folder.write("f0.png", &first[1]);
    assert_eq!(drawn(""), "2 of 3 frames are kept, drawn before");
    assert_eq!(frames(), first);
    for other in ["--set splatting.radius=1.5", "--turn 90", "--set volume.builtin=marschner-lobb:13"] {
        let stderr = drawn(other);
        // The first frame of every turn is the same.
        assert_eq!(stderr, if other == "--turn 90" { "1 of 3 frames are kept, drawn before" } else { "" }, "{other}");
        assert_ne!(frames(), first, "{other}");
        drawn("--overwrite");
        assert_eq!(frames(), first, "{other}");
    }
    // A list is no image, and without it all frames are drawn.
    folder.write("f#.png.made", [0xff; 1000]);
    assert_eq!(drawn(""), "");
    assert_eq!(frames(), first);
    folder.orbit(&format!("{TURNING} --count 3 -o f%d.png --overwrite --depth 16"));
    assert!(matches!(image::open(folder.path("f1.png")).unwrap(), image::DynamicImage::ImageRgba16(_)));
}

#[test]
fn an_apng_holds_the_frames_with_alpha() {
    let folder = Folder::new();
    let turning = format!("{TURNING} {TRANSPARENT} --count 5 --frames 1..4");
    folder.orbit(&format!("{turning} -o f%d.png"));
    folder.write("movie.apng", "old");
    folder.orbit(&format!("{turning} -o movie.apng --fps 20"));
    let bytes = folder.read("movie.apng");
    let decoder = image::codecs::png::PngDecoder::new(std::io::Cursor::new(bytes)).unwrap().apng().unwrap();
    let frames = decoder.into_frames().collect_frames().unwrap();
    assert_eq!(frames.len(), 3);
    for (frame, number) in frames.iter().zip(1..) {
        assert_eq!(frame.delay().numer_denom_ms(), (50, 1));
        let still = image::open(folder.path(&format!("f{number}.png"))).unwrap().to_rgba8();
        assert_eq!(*frame.buffer(), still, "frame {number}");
    }
    folder.orbit(&format!("{turning} -o deep.apng --depth 16"));
    folder.orbit(&format!("{turning} -o deep%d.png --depth 16"));
    let [first, still] = ["deep.apng", "deep1.png"]
        .map(|name| image::load_from_memory_with_format(&folder.read(name), image::ImageFormat::Png).unwrap());
    assert!(matches!(first, image::DynamicImage::ImageRgba16(_)));
    assert_eq!(first, still);
}

#[test]
fn a_gif_is_over_black_and_keeps_time() {
    let folder = Folder::new();
    let turning = format!("{TURNING} {TRANSPARENT} --count 6");
    folder.orbit(&format!("{turning} -o f%d.npy"));
    folder.orbit(&format!("{turning} -o movie.gif --fps 30"));
    let mut options = gif::DecodeOptions::new();
    options.set_color_output(gif::ColorOutput::RGBA);
    let bytes = folder.read("movie.gif");
    let mut decoder = options.read_info(bytes.as_slice()).unwrap();
    assert_eq!((decoder.width(), decoder.height(), decoder.repeat()), (28, 20, gif::Repeat::Infinite));
    let mut delays = Vec::new();
    while let Some(frame) = decoder.read_next_frame().unwrap() {
        let (.., still) = folder.read_npy(&format!("f{}.npy", delays.len()));
        let shown: Vec<[f32; 4]> = frame
            .buffer
            .as_chunks::<4>()
            .0
            .iter()
            .map(|pixel| pixel.map(|channel| f32::from(channel) / 255.0))
            .collect();
        let over_black: Vec<[f32; 4]> = still.iter().map(|&[r, g, b, _]| [r, g, b, 1.0]).collect();
        let decibels = psnr(&shown, &over_black, [0.0; 4], 50);
        assert_at_least(decibels, 53.0, format_args!("frame {}", delays.len()));
        delays.push(frame.delay);
    }
    // Delays are in hundredths of a second; six frames last 20.
    assert_eq!(delays, [3, 4, 3, 3, 4, 3]);
}

#[test]
fn video_encoders_get_planes_of_luma_and_chroma() {
    let folder = Folder::new();
    let turning = format!("{TURNING} --count 3 --fps 25");
    folder.orbit(&format!("{turning} -o movie.y4m"));
    let streamed = folder.command(&format!("orbit {turning} -o -")).output().unwrap();
    assert_eq!(streamed.status.code(), Some(0));
    assert!(streamed.stdout == folder.read("movie.y4m"), "the stream is the file");
    let header = b"YUV4MPEG2 W28 H20 F25:1 Ip A1:1 C420jpeg XCOLORRANGE=LIMITED\n";
    assert!(streamed.stdout.starts_with(header));
    assert_eq!(streamed.stdout.len(), header.len() + 3 * (6 + 28 * 20 * 3 / 2));

    folder.orbit(&format!("{turning} -o full.y4m --chroma 444 --set image.width=27"));
    let full = folder.read("full.y4m");
    let header = b"YUV4MPEG2 W27 H20 F25:1 Ip A1:1 C444 XCOLORRANGE=LIMITED\n";
    assert!(full.starts_with(header));
    assert_eq!(full.len(), header.len() + 3 * (6 + 27 * 20 * 3));
    // The corner is black, and the middle is not.
    let luma = &full[header.len() + 6..][..27 * 20];
    assert_eq!(luma[0], 16);
    assert!(luma[10 * 27 + 13] > 30 && luma.iter().all(|y| (16..=235).contains(y)));
}

#[test]
fn bad_usage_and_input_are_2_and_leave_nothing() {
    let folder = Folder::new();
    for (arguments, words) in [
        ("-o out.png", &["--output", "out.png", "frame-%04d.png", ".apng", ".gif"] as &[&str]),
        ("-o %d-%d.png", &["--output", "%d-%d.png"]),
        ("-o %d.jpg", &["%d.jpg", ".jpg", ".png"]),
        ("-o out.mp4", &["--output", "out.mp4", ".y4m"]),
        ("-o %d.png --count 0", &["--count", "0"]),
        ("-o %d.png --count 4 --frames 2..5", &["--frames", "2..5", "0..4", "--count"]),
        ("-o %d.png --frames 2..2", &["--frames", "2..2", "A..B"]),
        ("-o %d.png --frames 3", &["--frames", "'3'", "A..B"]),
        ("-o %d.png --turn inf", &["--turn", "inf", "finite"]),
        ("-o out.gif --fps 60", &["--fps", "60", "50"]),
        ("-o out.gif --set image.width=65536", &["image.width", "65536", "65535"]),
        ("-o out.y4m --set image.width=27", &["image.width", "27×20", "even", "--chroma 444"]),
        ("-o - --set image.height=19", &["image.height", "28×19", "even"]),
        ("-o %d.png --set image.width=0", &["image.width", "0"]),
        ("-o out.apng --set volume.builtin=nonesuch", &["nonesuch"]),
    ] {
        folder.run(&format!("orbit {TURNING} {arguments}")).assert_failure(2, words);
        assert_eq!(folder.names(), BTreeSet::new(), "{arguments}");
    }
    folder.run("orbit gone.toml -o %d.png").assert_failure(2, &["gone.toml"]);
    for output in ["no/%d.png", "no/out.gif"] {
        folder
            .run(&format!("orbit {TURNING} --count 1 -o {output}"))
            .assert_failure(2, &["no/", "the folder no: No such file"]);
    }
    folder.run(&format!("orbit {TURNING} -o out.apng --adapter nonesuch")).assert_failure(1, &["nonesuch", &adapter()]);
    assert_eq!(folder.names(), BTreeSet::new());
}

#[test]
fn a_saved_scene_renders_the_frames_bytes() {
    let folder = Folder::new();
    let small = "--set image={width=60,height=40} --set camera.direction=[0,1,0]";
    for sets in ["--preset ct-skin", "--set camera.projection=perspective", WHOLE] {
        folder
            .run(&format!("orbit builtin:head:32 {small} {sets} -o f%d.png --count 4 --overwrite --save-scene s.toml"))
            .assert_success();
        folder.run("render s.toml -o first.png").assert_success();
        assert!(folder.read("first.png") == folder.read("f0.png"), "{sets}");
        // A quarter turn about z, right-handed, from y.
        let direction = "--set camera.direction=[-1,6.123233995736766e-17,0]";
        folder.run(&format!("render s.toml {direction} -o second.png")).assert_success();
        assert!(folder.read("second.png") == folder.read("f1.png"), "{sets}");
        let text = String::from_utf8(folder.read("s.toml")).unwrap();
        let camera = text.parse::<toml::Table>().unwrap()["camera"].clone();
        assert!(
            camera.get("center").is_some() && (camera.get("height").or(camera.get("distance"))).is_some(),
            "{text}"
        );
    }
    // All frames exist already, but the scene does not.
    folder.run(&format!("orbit builtin:head:32 {small} -o f%d.png --count 4 --save-scene again.toml")).assert_success();
    assert!(folder.path("again.toml").exists());
    folder
        .run("orbit builtin:cube:8 -o f%d.png --save-scene s.json")
        .assert_failure(2, &["--save-scene", "s.json", ".toml"]);
    // A scene that is read is not overwritten.
    let before = folder.read("s.toml");
    for output in ["f%d.png", "f.gif"] {
        let run = folder.run(&format!("orbit s.toml --count 4 -o {output} --save-scene ./s.toml"));
        run.assert_failure(2, &["--save-scene", "s.toml"]);
    }
    assert!(folder.read("s.toml") == before && !folder.path("f.gif").exists());
}

/// Three times of one volume.
const TIMES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures/channels/times.nii");

#[test]
fn times_and_turns_go_together() {
    let folder = Folder::new();
    let look = "--set image={width=24,height=20} --set camera.direction=[0,1,0] --set transfer={opacity=[[0,0],[25000,0.9]],color=[[0,[0,0,1]],[20000,[1,1,0]]]}";
    folder.orbit(&format!("{TIMES} {look} --time 0..3 --turn 90 --count 6 -o all-%d.png --save-scene turn.toml"));
    let scene = String::from_utf8(folder.read("turn.toml")).unwrap();
    assert!(scene.contains("time = 0"), "{scene}");
    let mut frames = BTreeSet::new();
    for frame in 0..6 {
        let direction = DMat3::from_axis_angle(DVec3::Z, (15.0 * f64::from(frame)).to_radians()) * DVec3::Y;
        let [x, y, z] = direction.to_array();
        let time = frame / 2;
        folder.render(&format!("turn.toml --time {time} --set camera.direction=[{x:?},{y:?},{z:?}] -o one.png"));
        let all = folder.read(&format!("all-{frame}.png"));
        assert!(all == folder.read("one.png"), "frame {frame}");
        frames.insert(all);
    }
    assert_eq!(frames.len(), 6, "all frames differ");
    // Each frame is independent of the others.
    folder.orbit(&format!("{TIMES} {look} --time 0..3 --turn 90 --count 6 --frames 3..5 -o part-%d.png"));
    assert!(
        [3, 4]
            .iter()
            .all(|frame| folder.read(&format!("part-{frame}.png")) == folder.read(&format!("all-{frame}.png")))
    );
    for (times, expected) in [
        ("0..4", "--time: found 0..4, allowed: within 0..3, the times of"),
        ("2..2", "--time: found 2..2, allowed: A..B"),
        ("..2", "--time: found ..2, allowed: A..B"),
        ("3", "time: found 3, allowed: 0 to 2"),
    ] {
        let run = folder.run(&format!("orbit {TIMES} {look} --time {times} --count 2 -o no-%d.png"));
        run.assert_failure(2, &[expected]);
    }
    let run = folder.run(&format!("render {TIMES} {look} --time 0..2 -o no.png"));
    run.assert_failure(2, &["--time: found \"0..2\""]);
}
