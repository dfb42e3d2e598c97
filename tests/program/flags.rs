//! Flags that set keys, their names in errors, and the look of messages.

use crate::*;

const CUBE: &str = "builtin:cube:12";

#[test]
fn size_and_background_are_short_for_keys() {
    let folder = Folder::new();
    for (flags, sets) in [
        ("--size 20x10", "--set image={width=20,height=10}"),
        ("--size 14", "--set image={width=14,height=14}"),
        ("--size 9 --background white", "--set image={width=9,height=9,background=[1,1,1,1]}"),
        ("--size 9 --background #08f", "--set image={width=9,height=9,background=[0,0.53333336,1,1]}"),
        ("--size 9 --background transparent", "--set image={width=9,height=9,background=[0,0,0,0]}"),
        // As for the other flags, --set goes before.
        ("--size 9 --set image.height=5", "--set image={width=9,height=5}"),
    ] {
        let by_flags = folder.pixels(&format!("{CUBE} {WHOLE} {flags}"));
        assert_eq!(by_flags, folder.pixels(&format!("{CUBE} {WHOLE} {sets}")), "{flags}");
    }
    for (flags, words) in [
        ("--size 0", ["--size", "allowed: W or WxH, integers >= 1"]),
        ("--size 3x", ["--size", "allowed: W or WxH, integers >= 1"]),
        ("--background whit", ["--background: found \"whit\"", "a CSS colour"]),
        ("--spacing 1,2", ["--spacing: found [1, 2]", "3 numbers"]),
        ("--channel one", ["--channel: found \"one\"", "an integer >= 0"]),
        // A key that --set states too is called by its name.
        ("--background white --set image.background=red5", ["--set: image.background", "red5"]),
    ] {
        folder.run(&format!("render {CUBE} {flags} -o out.png")).assert_failure(2, &words);
    }
}

/// The eye goes round the object by the right hand about up, and then up.
#[test]
fn azimuth_and_elevation_turn_the_eye() {
    let folder = Folder::new();
    let scene = |flags: &str| {
        folder
            .run(&format!("render {CUBE} --size 8 --backend cpu {flags} -o out.png --save-scene out.toml"))
            .assert_success();
        let saved: toml::Table = String::from_utf8(folder.read("out.toml")).unwrap().parse().unwrap();
        let number = |value: &toml::Value| value.as_float().or(value.as_integer().map(|whole| whole as f64)).unwrap();
        let direction: Vec<f64> = saved["camera"]["direction"].as_array().unwrap().iter().map(number).collect();
        DVec3::from_slice(&direction).normalize()
    };
    let assert_near = |found: DVec3, expected: DVec3| assert!(found.abs_diff_eq(expected, 1e-9), "{found} {expected}");
    let front = "--set camera.direction=[0,1,0]";
    assert_near(scene(&format!("{front} --azimuth 90")), DVec3::NEG_X);
    assert_near(scene(&format!("{front} --elevation 30")), DVec3::new(0.0, 0.75_f64.sqrt(), -0.5));
    assert_near(scene(&format!("{front} --azimuth -90 --elevation -30")), DVec3::new(0.75_f64.sqrt(), 0.0, 0.5));
    // From where the eye is by itself.
    let own = scene("--quiet");
    let turned = scene("--azimuth 40");
    assert!((own.dot(turned) - 1.0).abs() > 0.1 && (own.z - turned.z).abs() < 1e-9, "{own} {turned}");
    let above = folder.run(&format!("render {CUBE} {front} --elevation 90 -o out.png"));
    above.assert_failure(2, &["--elevation: found 90", "at most 89"]);
    folder
        .run(&format!("render {CUBE} --azimuth north -o out.png"))
        .assert_failure(2, &["--azimuth", "a finite number"]);
}

#[test]
fn a_misspelt_key_suggests_the_key() {
    let folder = Folder::new();
    let run = folder.run(&format!("render {CUBE} --set splatting.slab_with=2 -o out.png"));
    run.assert_failure(2, &["--set: splatting.slab_with", "an unknown key (perhaps slab_width)", "allowed: method"]);
}

#[test]
fn a_window_is_short_for_opacities_and_excludes_others() {
    let folder = Folder::new();
    let pixels = |arguments: &str| folder.pixels(&format!("{CUBE} --size 16 --backend cpu {arguments}"));
    let windowed = pixels("--preset mip --window -20,200");
    assert_eq!(windowed, pixels("--preset mip --set transfer.opacity=[[-20,0],[200,1]]"));
    assert_ne!(windowed, pixels("--preset mip --window 100,300"));
    for (arguments, said) in [
        ("--window 200,100", ["--window", "200,100", "LO less than HI"]),
        ("--window 200", ["--window", "200", "LO,HI"]),
        ("--window nan,1", ["--window", "nan,1", "LO,HI"]),
        ("--window 0,1e999", ["--window", "1e999", "LO,HI"]),
        ("--window 0,9 --set transfer.opacity=[[0,1]]", ["--window", "0,9", "--set transfer.opacity=[[0,1]]"]),
        ("--window 0,9 --preset xray", ["--window", "xray", "another preset"]),
        ("--window 0,9 --set preset=labels", ["--window", "labels", "another preset"]),
    ] {
        folder.run(&format!("render {CUBE} --size 16 {arguments} -o out.png")).assert_failure(2, &said);
    }
    assert!(!folder.path("out.png").exists());
}

/// Modules and times are for those who ask for a log.
#[test]
fn warnings_are_plain_and_come_once() {
    let folder = Folder::new();
    let values: Vec<f32> = (0..27).map(|i| if i == 13 { f32::NAN } else { i as f32 }).collect();
    folder.write_nrrd("holed.nrrd", [3, 3, 3], [1.0; 3], &values);
    let stated = "--preset none --set camera.direction=[0,1,0]";
    let run = folder.run(&format!("render holed.nrrd {stated} --size 9 -o out.png"));
    run.assert_success();
    let message = "sheetsplat: warning: holed.nrrd: 1 of 27 samples are NaN or infinite: these holes are not drawn\n";
    assert_eq!(run.stderr, message);
    let logged = folder.run("-v render holed.nrrd --size 9 -o out.png");
    assert!(logged.stderr.contains("[WARN  sheetsplat") && logged.stderr.contains("[INFO  "), "{}", logged.stderr);
}

#[test]
fn pictures_that_show_nothing_say_why() {
    let folder = Folder::new();
    let said = |arguments: &str| {
        let run = folder.run(&format!("render {CUBE} --size 12 --backend cpu {arguments} -o out.png"));
        run.assert_success();
        run.stderr
    };
    let above = said("--set transfer.opacity=[[300,0],[400,1]]");
    assert!(above.contains("no pixel differs from the background: no voxel takes part"), "{above}");
    assert!(above.contains("from 0 to 255"), "{above}");
    for away in ["--set camera.center=[500,0,0] --set camera.height=5", "--set transfer.opacity=[[0,0],[400,1e-9]]"] {
        let away = said(&format!("--set transfer.color=[[0,[1,1,1]]] {away}"));
        assert!(away.contains("no pixel differs from the background: the voxels that take part lie outside"), "{away}");
    }
    for shown in ["--depth 8", "--background white", "--background transparent", "--set splatting.compositing=surface"]
    {
        assert_eq!(said(shown), "", "{shown}");
    }
}

/// Mesa's choice of a GPU by the desktop would print an error each time that adapters are listed.
#[cfg(target_os = "linux")]
#[test]
fn without_a_desktop_session_no_error_is_printed() {
    let folder = Folder::new();
    for arguments in ["adapters", "render builtin:cube:12 --size 9 --backend gpu -o out.png"] {
        let mut command = folder.command(arguments);
        let output = command.env_remove("XDG_RUNTIME_DIR").env_remove("NODEVICE_SELECT").output().unwrap();
        assert_eq!(
            (output.status.code(), String::from_utf8_lossy(&output.stderr).as_ref()),
            (Some(0), ""),
            "{arguments}"
        );
    }
}

#[cfg(not(feature = "viewer"))]
#[test]
fn a_program_without_a_window_says_so() {
    let folder = Folder::new();
    for arguments in ["view", "view builtin:head --size 800x600 --set a=b"] {
        folder.run(arguments).assert_failure(2, &["view", "without a window", "--features viewer"]);
    }
}
