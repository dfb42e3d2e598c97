//! `sheetsplat info`.

use crate::*;

/// The output of `info`.
#[track_caller]
fn info(folder: &Folder, arguments: &str) -> String {
    let run = folder.run(&format!("info {arguments}"));
    assert_eq!(run.code, Some(0), "{arguments}\n{}", run.stderr);
    run.stdout
}

fn fixture(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(name).display().to_string()
}

#[test]
fn json_has_the_files_facts() {
    let folder = Folder::new();
    let json = |arguments: &str| -> Value {
        let text = info(&folder, &format!("{arguments} --json"));
        assert_eq!(text.lines().count(), 1, "{text}");
        serde_json::from_str(&text).unwrap()
    };
    let sform = json(&fixture("itk.nii.gz"));
    assert_eq!(sform["format"], "NIfTI");
    assert_eq!(sform["dims"], serde_json::json!([5, 4, 3]));
    assert_eq!(sform["type"], "float64");
    assert_eq!(sform["unit"], "mm");
    for (spacing, expected) in sform["spacing"].as_array().unwrap().iter().zip([0.5, 2.0, 3.0]) {
        assert!((spacing.as_f64().unwrap() - expected).abs() < 1e-6);
    }
    assert_eq!([&sform["min"], &sform["max"], &sform["mean"]], [0.0, 234.0, 117.0]);

    // After slope and intercept, and with arguments.
    let sloped = json(&fixture("sform.nii"));
    assert_eq!([&sloped["type"], &sloped["unit"]], [&Value::from("int16"), &Value::Null]);
    assert_eq!([&sloped["min"], &sloped["max"], &sloped["mean"]], [-3.0, 114.0, 55.5]);
    let values: Vec<u8> = (0..=255).flat_map(|value| [value; 4]).collect();
    folder.write("a.bin", values);
    let raw = json("a.bin --dims 32,32,1 --type uint8 --set volume.spacing=[1,2,3]");
    assert_eq!(raw["format"], "raw");
    assert_eq!(raw["spacing"], serde_json::json!([1.0, 2.0, 3.0]));
    let percentiles = raw["percentiles"].as_object().unwrap();
    let expected = [("0.1", 0.0), ("1", 2.0), ("5", 12.0), ("25", 64.0), ("50", 128.0), ("75", 191.0)];
    for (name, value) in expected.into_iter().chain([("95", 243.0), ("99", 253.0), ("99.9", 255.0)]) {
        assert_eq!(percentiles[name], value, "{name}");
    }
    assert_eq!(percentiles.len(), 9);
}

#[test]
fn frames_are_those_that_render_chooses_and_presets_fit_the_kind_of_data() {
    let folder = Folder::new();
    // A block of 4 × 6 × 8 voxels from voxel (3, 2, 1) on, in air.
    let inside = |[x, y, z]: [usize; 3]| (3..7).contains(&x) && (2..8).contains(&y) && (1..9).contains(&z);
    let voxels = (0..12 * 12 * 12).map(|at| inside([at % 12, at / 12 % 12, at / 144]));
    let values: Vec<f32> = voxels.clone().map(|inside| if inside { 90.0 } else { 0.0 }).collect();
    folder.write_nrrd("block.nrrd", [12; 3], [2.0, 1.0, 0.5], &values);
    let json =
        |arguments: &str| -> Value { serde_json::from_str(&info(&folder, &format!("{arguments} --json"))).unwrap() };
    let block = json("block.nrrd --set camera.direction=[0,1,0]");
    assert_eq!(block["frame"]["center"], serde_json::json!([-2.0, -1.0, -0.5]));
    // Along y: the block's width of 3 spacings plus two kernels of 2 grid units is 14, its height of 7 and 4 of them is 5.5.
    assert_eq!(block["frame"]["height"], 14.0 / 0.9);
    assert_eq!([&block["frame"]["distance"], &block["preset"]], [&Value::Null; 2]);
    let text = info(&folder, "block.nrrd --set camera.direction=[0,1,0]");
    assert!(text.contains("frame        center -2, -1, -0.5, height 15.5556 (no unit)\n"), "{text}");
    assert!(text.contains("preset       none fits; the transfer function follows the values\n"), "{text}");
    folder.render("block.nrrd -o block.png --set camera.direction=[0,1,0] --set image.width=20 --set image.height=20 --save-scene block.toml");
    let saved: toml::Table = String::from_utf8(folder.read("block.toml")).unwrap().parse().unwrap();
    assert_eq!(saved["camera"]["height"].as_float(), block["frame"]["height"].as_f64());
    let eye = json("block.nrrd --set camera={projection=\"perspective\",direction=[0,1,0]}");
    assert!(eye["frame"]["distance"].as_f64().unwrap() > 14.0 && eye["frame"]["height"].is_null(), "{eye}");

    // A body of soft tissue with some bone, in signed and unsigned Hounsfield units.
    let tissue = |at: usize| if at.is_multiple_of(20) { 700.0 } else { 40.0 + (at % 7) as f32 };
    let body = |offset: f32| -> Vec<f32> {
        voxels.clone().enumerate().map(|(at, inside)| offset + if inside { tissue(at) } else { -1000.0 }).collect()
    };
    folder.write_nrrd("ct.nrrd", [12; 3], [1.0; 3], &body(0.0));
    folder.write_nrrd("unsigned.nrrd", [12; 3], [1.0; 3], &body(1024.0));
    for name in ["ct.nrrd", "unsigned.nrrd"] {
        assert_eq!(json(name)["preset"], "ct-bone", "{name}");
    }
    let soft: Vec<f32> = body(0.0).iter().map(|&value| value.min(60.0)).collect();
    folder.write_nrrd("soft.nrrd", [12; 3], [1.0; 3], &soft);
    assert_eq!(json("soft.nrrd")["preset"], "ct-skin");
    let labels: Vec<f32> = (0..1728_usize).map(|at| (at % 12 / 3 * 7) as f32).collect();
    folder.write_nrrd("labels.nrrd", [12; 3], [1.0; 3], &labels);
    assert_eq!(json("labels.nrrd")["preset"], "labels");
}

#[test]
fn text_has_them_and_a_histogram() {
    let folder = Folder::new();
    let text = info(&folder, &fixture("series"));
    let has = |line: &str| assert!(text.lines().any(|found| found == line), "no {line:?} in\n{text}");
    has("format       DICOM");
    has("type         int16");
    has("dims         5 × 4 × 3");
    has("spacing      0.5 × 2 × 3 mm");
    has("orientation  x to the left (within 48°), y to the back (within 48°), z to the left (within 48°)");
    has("range        0 to 234, mean 117");
    has("       50 %  120");
    has(&format!("0{:>63}", 234));
    // Three slices with values a hundred apart.
    let isos = text.lines().find_map(|line| line.strip_prefix("iso-values   ")).unwrap();
    let isos: Vec<f64> = isos.trim_end_matches(" (suggested)").split(", ").map(|iso| iso.parse().unwrap()).collect();
    assert!(isos.len() == 2 && (34.0..100.0).contains(&isos[0]) && (134.0..200.0).contains(&isos[1]), "{isos:?}");
    let bars = |text: &str| text.chars().filter(|character| ('▁'..='█').contains(character)).count();
    assert!(bars(&text) > 100, "{text}");

    folder.write_nrrd("one.nrrd", [2, 2, 1], [1.0; 3], &[7.25; 4]);
    let constant = info(&folder, "one.nrrd");
    assert!(constant.contains("range        7.25 to 7.25, mean 7.25\n"), "{constant}");
    assert!(constant.contains("orientation  not given\n") && constant.contains("1 × 1 × 1 (no unit)"), "{constant}");
    assert!(!constant.contains("iso-values") && bars(&constant) == 0, "{constant}");
    assert!(info(&folder, "builtin:cube").contains("format       builtin\n"));
}

/// A folder of several series and a file of several times, and what chooses one of them.
#[test]
fn series_and_times_are_listed() {
    let folder = Folder::new();
    let times = info(&folder, &fixture("dicom/times.dcm"));
    let line =
        "times        2: 0 TemporalPositionIndex 1, 1 TemporalPositionIndex 2; what follows is about one, by --time";
    assert!(times.lines().any(|found| found == line), "{times}");
    let path = folder.path("export");
    std::fs::create_dir(&path).unwrap();
    for name in ["series/IM1", "series/IM2", "series/IM3.dcm", "jpeg2000-large.dcm"] {
        let name = Path::new(name);
        let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(name);
        std::fs::copy(from, path.join(name.file_name().unwrap())).unwrap();
    }
    let text = info(&folder, "export");
    let of = |name: &str| text.lines().find_map(|line| line.strip_prefix(name)).unwrap_or_default().trim().to_owned();
    assert_eq!(of("dims "), "5 × 4 × 3");
    assert!(of("series ").starts_with("0: 3 of 5 × 4") && of("series ").contains("1: 1 of 70 × 50"), "{text}");
    let second: Value = serde_json::from_str(&info(&folder, "export --json --series 1")).unwrap();
    assert_eq!(second["dims"], serde_json::json!([70, 50, 1]));
    assert_eq!(second["series"].as_array().unwrap().len(), 2);
    let run = folder.run("render export --series 9 -o no.png");
    run.assert_failure(2, &["series: found 9, allowed: a number or a SeriesInstanceUID of 0: 3 of 5 × 4"]);
}

/// Holes are counted; all other figures are about the finite samples.
#[test]
fn holes_are_counted_and_left_out() {
    let folder = Folder::new();
    let values: Vec<f32> = (0..10).map(|at| if at % 5 == 4 { f32::INFINITY } else { at as f32 }).collect();
    folder.write_nrrd("a.nrrd", [5, 2, 1], [1.0; 3], &values);
    let json: Value = serde_json::from_str(&info(&folder, "a.nrrd --json")).unwrap();
    assert_eq!(json["holes"], 2);
    assert_eq!([&json["min"], &json["max"], &json["mean"]], [0.0, 8.0, 4.0]);
    assert_eq!([&json["percentiles"]["0.1"], &json["percentiles"]["99.9"]], [0.0, 8.0]);
    let text = info(&folder, "a.nrrd");
    assert!(text.contains("\nholes        2 samples are NaN or infinite\nrange        0 to 8, mean 4\n"), "{text}");
    folder.write_nrrd("b.nrrd", [2, 1, 1], [1.0; 3], &[1.0, 2.0]);
    let json: Value = serde_json::from_str(&info(&folder, "b.nrrd --json")).unwrap();
    assert_eq!(json["holes"], 0);
    assert!(!info(&folder, "b.nrrd").contains("holes"));
}

#[test]
fn files_that_are_not_volumes_are_bad_input() {
    let folder = Folder::new();
    folder.run("info missing.nrrd").assert_failure(2, &["missing.nrrd"]);
    folder.write("a.nii", "no volume");
    folder.run("info a.nii --json").assert_failure(2, &["a.nii", "header", "9 bytes", "348 bytes"]);
}

/// The facts that were taken from the file, those that were assumed, and each warning once.
#[test]
fn assumptions_are_told() {
    let folder = Folder::new();
    let json = |arguments: &str| -> Value {
        let json: Value = serde_json::from_str(&info(&folder, &format!("{arguments} --json"))).unwrap();
        let text = info(&folder, arguments);
        let facts: Vec<&str> = json["assumed"].as_array().unwrap().iter().map(|fact| fact.as_str().unwrap()).collect();
        let line = if facts.is_empty() { "nothing".to_owned() } else { facts.join("; ") };
        assert!(text.contains(&format!("\nassumed      {line}\n")), "{text}");
        serde_json::json!([json["assumed"], text.lines().find_map(|line| line.strip_prefix("axes         "))])
    };
    let array = "the array's last ones are z, y and x";
    let orientation = "orientation: that of no patient, with right-handed axes";
    let assumed = [&format!("axes: {array}"), "spacing: 1 along each axis", "unit: none", orientation];
    assert_eq!(json(&fixture("c.npy")), serde_json::json!([assumed, array]));
    let stated = "x, y and z as the file states them";
    assert_eq!(json(&fixture("itk.nii.gz")), serde_json::json!([[], stated]));
    // A scene's spacing and unit are stated.
    let of_scene = json(&format!("{} --set volume.spacing=[1,2,3]", fixture("c.npy")));
    assert_eq!(of_scene[0], serde_json::json!([assumed[0], assumed[2], assumed[3]]));
    assert!(info(&folder, &fixture("qform-big.nii.gz")).contains("; left-handed, so that pictures have x turned\n"));
    assert_eq!(json("builtin:cube:8"), serde_json::json!([[], Value::Null]));

    let warned = folder.run(&format!("info {}", fixture("plain.tif"))).stderr;
    assert_eq!(warned.matches("no distance between slices is given").count(), 1, "{warned}");
}

/// A header that says that values are labels decides, whatever they look like.
#[test]
fn labels_are_known_by_the_header_or_by_their_looks() {
    let folder = Folder::new();
    let of = |name: &str| -> (Value, Option<String>) {
        let json: Value = serde_json::from_str(&info(&folder, &format!("{name} --json"))).unwrap();
        let text = info(&folder, name);
        (json["preset"].clone(), text.lines().find_map(|line| line.strip_prefix("labels       ")).map(str::to_owned))
    };
    let plain = std::fs::read(fixture("nifti2.nii")).unwrap();
    folder.write("plain.nii", &plain);
    assert_eq!(of("plain.nii"), (Value::Null, None));
    let mut labels = plain;
    labels[504..508].copy_from_slice(&1002_i32.to_le_bytes());
    folder.write("labels.nii", labels);
    let stated = "the file says that the values are labels";
    assert_eq!(of("labels.nii"), ("labels".into(), Some(stated.to_owned())));
    let run = folder.run("render labels.nii -o a.png --size 8 --backend cpu");
    assert!(run.stderr.contains(&format!("preset labels, as {stated}")), "{}", run.stderr);
    assert_eq!(of(&fixture("zarr/image-0.5.zarr/labels/cells")).1.as_deref(), Some(stated));

    let mut fractions = std::fs::read(fixture("sform.nii")).unwrap();
    fractions[68..70].copy_from_slice(&1002_i16.to_le_bytes());
    folder.write("fractions.nii", fractions);
    let refused = format!("{stated}, but some are no whole numbers from 0 to 65535");
    let run = folder.run("render fractions.nii -o b.png --size 8 --backend cpu");
    assert!(run.stderr.contains(&format!("{refused}: drawn as amounts")), "{}", run.stderr);
    assert_eq!(of("fractions.nii"), (Value::Null, Some(refused)));

    let regions: Vec<f32> = (0..1728_usize).map(|at| (at % 12 / 3 * 7) as f32).collect();
    folder.write_nrrd("regions.nrrd", [12; 3], [1.0; 3], &regions);
    let (preset, reason) = of("regions.nrrd");
    assert!(preset == "labels" && reason.unwrap().starts_with("the values look like labels: whole numbers"));
}

#[test]
fn labels_beyond_16_bits_are_told_by_their_numbers() {
    let folder = Folder::new();
    let header =
        "NRRD0004\ntype: uint64\ndimension: 3\nsizes: 8 2 2\nspacings: 1 1 1\nendian: little\nencoding: raw\n\n";
    let ids = [0, 70_000, 312_782_547, u64::MAX];
    let labels = (0..32).flat_map(|at: usize| ids[at % 8 / 2].to_le_bytes());
    folder.write("labels.nrrd", header.bytes().chain(labels).collect::<Vec<u8>>());
    let json: Value = serde_json::from_str(&info(&folder, "labels.nrrd --json")).unwrap();
    assert_eq!((&json["ids"], &json["max"]), (&serde_json::json!(ids), &serde_json::json!(3.0)));
    let text = info(&folder, "labels.nrrd");
    let told = "ids          0 to 18446744073709551615; values and labels below are their places, 0 to 3";
    assert!(text.contains(told), "{text}");
    let plain: Value = serde_json::from_str(&info(&folder, &format!("{} --json", fixture("nifti2.nii")))).unwrap();
    assert_eq!(plain["ids"], Value::Null);
}
