//! `sheetsplat bench`, and `--profile`.

use crate::errors::assert_fails;
use crate::statistics::{STATS_KEYS, count, keys};
use crate::*;

/// The keys that `bench` prints in addition to the last frame's statistics.
const BENCH_KEYS: [&str; 5] = ["first_frame_ms", "max_frame_ms", "median_frame_ms", "min_frame_ms", "peak_rss_mib"];

impl Folder {
    /// Runs a bench that must print exactly one line of JSON.
    fn bench(&self, arguments: &str) -> Value {
        let run = self.run(&format!("bench {arguments}"));
        assert_eq!(run.code, Some(0), "{arguments}\n{}", run.stderr);
        let line = run.stdout.strip_suffix('\n').unwrap();
        assert!(!line.contains('\n'), "one line: {}", run.stdout);
        serde_json::from_str(line).unwrap()
    }
}

#[test]
fn bench_prints_one_line_of_json() {
    let folder = Folder::new();
    let before = folder.names();
    for frames in ["--frames 1", "--frames 4 --rotate 30", "--frames 3 --rotate -7.5", "--rotate 0"] {
        let report = folder.bench(&format!("{SMALL} {frames}"));
        let mut expected: Vec<&str> = STATS_KEYS.into_iter().chain(BENCH_KEYS).collect();
        expected.sort_unstable();
        assert_eq!(keys(&report), expected);
        let ms = |key: &str| {
            let milliseconds = report[key].as_f64().unwrap();
            assert!(milliseconds.is_finite() && milliseconds >= 0.0, "{key}: {milliseconds}");
            milliseconds
        };
        let [min, median, max] = ["min_frame_ms", "median_frame_ms", "max_frame_ms"].map(ms);
        assert!(0.0 < min && min <= median && median <= max, "{report:#}");
        if frames == "--frames 1" {
            assert_eq!([min, max], [median; 2], "{report:#}");
        }
        // A device, the pipelines and a frame take time; the program and a driver use memory.
        assert!(ms("first_frame_ms") > 0.0 && ms("load_ms") >= 0.0, "{report:#}");
        #[cfg(target_os = "linux")]
        assert!(report["peak_rss_mib"].as_f64().unwrap() > 5.0, "{report:#}");
        assert_eq!((count(&report, "width"), count(&report, "height")), (27, 20));
        for key in ["adapter", "driver", "backend"] {
            assert!(!report[key].as_str().unwrap().is_empty(), "{key}");
        }
    }
    assert_eq!(folder.names(), before, "nothing is left");
}

/// Every frame is turned further, right-handed about the camera's up; the first one is not turned.
#[test]
fn bench_turns_the_camera() {
    let folder = Folder::new();
    folder.write_nrrd("box.nrrd", [7, 5, 3], [1.0, 1.0, 1.0], &[1.0; 105]);
    let sets = "--set image.width=33 --set image.height=40 --set transfer.opacity=[[0,0.4]]";
    let counts = |stats: &Value| {
        let keys = ["sections_total", "sections_rasterized", "sheets", "quads", "voxels_shaded", "bricks_visited"];
        keys.map(|key| count(stats, key))
    };
    // The direction turns about (0, 0, 1) from (0, 1, 0), and about (0, 1, 0) from (1, 0, 0).
    for (arguments, direction, up) in [
        ("--frames 1 --rotate 90", "[-1,0,0]", "[0,0,1]"),
        ("--frames 3 --rotate 30", "[-1,0,0]", "[0,0,1]"),
        ("--frames 3 --rotate -30", "[1,0,0]", "[0,0,1]"),
        ("--frames 2 --rotate 0", "[0,1,0]", "[0,0,1]"),
        ("--frames 1 --rotate 26.56505117707799 --set camera.direction=[1,0,0]", "[2,0,-1]", "[0,1,0]"),
    ] {
        let report = folder.bench(&format!("box.nrrd {sets} --set camera.up={up} {arguments}"));
        let stats = folder.stats(&format!("box.nrrd {sets} --set camera.up={up} --set camera.direction={direction}"));
        assert_eq!(counts(&report), counts(&stats), "{arguments}: {report:#} {stats:#}");
    }
}

#[test]
fn bench_of_bad_input_is_2() {
    assert_fails(2, "bench", &["INPUT"]);
    assert_fails(2, "bench good.nrrd --frames 0", &["--frames", "0"]);
    assert_fails(2, "bench good.nrrd --frames -1", &["-1"]);
    assert_fails(2, "bench good.nrrd --frames many", &["--frames", "many"]);
    assert_fails(2, "bench good.nrrd --rotate round", &["--rotate", "round"]);
    for angle in ["nan", "inf", "-inf"] {
        assert_fails(2, &format!("bench good.nrrd --rotate={angle}"), &["--rotate", angle, "a finite number"]);
    }
    assert_fails(2, "bench good.nrrd -o out.png", &["-o"]);
    assert_fails(2, "bench gone.nrrd", &["gone.nrrd", "No such file"]);
    assert_fails(2, "bench missing.toml", &["missing.toml", "No such file"]);
    assert_fails(2, "bench short.nrrd", &["short.nrrd", "data", "32 bytes"]);
    assert_fails(2, "bench unknown.toml", &["unknown.toml", "camera.zoom", "unknown key"]);
    assert_fails(2, "bench builtin:brain", &["builtin:brain", "brain"]);
    assert_fails(2, "bench good.nrrd --set splatting.slab_width=9", &["--set", "splatting.slab_width", "9"]);
    assert_fails(
        2,
        "bench good.nrrd --set splatting.rasterizer=tiles --set splatting.footprint=sections",
        &["sections"],
    );
    assert_fails(1, "bench good.nrrd --adapter Voodoo", &["Voodoo"]);
}

#[test]
fn profiles_say_where_the_time_goes() {
    for (rasterizer, stages) in
        [(QUADS, &["composite", "cull", "resolve", "splat"][..]), (TILES, &["gather", "resolve"])]
    {
        let folder = Folder::new();
        let report = folder.bench(&format!("{SMALL} {rasterizer} --frames 1 --profile"));
        assert_eq!(keys(&report["stages_ms"]), stages);
        let run = folder.run(&format!("render {SMALL} {rasterizer} -o image.png --stats stats.json --profile"));
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        let stats: Value = serde_json::from_slice(&folder.read("stats.json")).unwrap();
        assert_eq!(keys(&stats["stages_ms"]), stages);
        // One line per stage: its name and milliseconds.
        let lines: Vec<Vec<&str>> = run.stdout.lines().map(|line| line.split_whitespace().collect()).collect();
        assert_eq!(lines.iter().map(|line| line[0]).collect::<Vec<_>>(), stages, "{}", run.stdout);
        for line in lines {
            let printed: f64 = line[1].parse().unwrap();
            assert!((printed - stats["stages_ms"][line[0]].as_f64().unwrap()).abs() < 6e-4, "{line:?} {stats:#}");
            assert_eq!(line[2], "ms");
        }
    }
}

/// On the reference backend nothing can be timed: a warning says so, and the image is rendered.
#[test]
fn profiles_need_timestamps() {
    let folder = Folder::new();
    let run = folder.run(&format!("render {SMALL} {UNCULLED} -o image.png --backend reference --profile"));
    run.assert_success();
    assert!(run.stderr.contains("--profile") && run.stderr.contains("CPU"), "{}", run.stderr);
    assert!(folder.names().contains("image.png"));
}
