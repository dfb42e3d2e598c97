//! The level of a store that is drawn: `--level`, or the coarsest whose voxels are no larger than a pixel.

use crate::statistics::count;
use crate::*;

/// Voxels of 0.5 × 2 × 3 at level 0, and twice as large at level 1.
fn two_levels() -> String {
    format!("{}/tests/fixtures/zarr/ngff.zarr --backend cpu", env!("CARGO_MANIFEST_DIR"))
}

/// A store of a ball with 96³ and 48³ voxels, the finer ones at a distance of 1, in chunks of 32³ numbers.
pub(crate) fn write_pyramid(folder: &Folder) {
    let transformations = |scale: f64| {
        let shift = (scale - 1.0) / 2.0;
        format!(
            r#"[{{"type":"scale","scale":[{scale},{scale},{scale}]}},{{"type":"translation","translation":[{shift},{shift},{shift}]}}]"#
        )
    };
    let datasets = [1.0, 2.0]
        .map(|scale| format!(r#"{{"path":"{}","coordinateTransformations":{}}}"#, scale - 1.0, transformations(scale)));
    let axes = ["z", "y", "x"].map(|name| format!(r#"{{"name":"{name}","type":"space"}}"#)).join(",");
    let ome = format!(r#"{{"version":"0.5","multiscales":[{{"axes":[{axes}],"datasets":[{}]}}]}}"#, datasets.join(","));
    let group = format!(r#"{{"zarr_format":3,"node_type":"group","attributes":{{"ome":{ome}}}}}"#);
    fs::create_dir(folder.path("ball.zarr")).unwrap();
    folder.write("ball.zarr/zarr.json", group);
    for (level, side) in [(0, 96_u32), (1, 48)] {
        let array = format!(
            r#"{{"zarr_format":3,"node_type":"array","shape":[{side},{side},{side}],"data_type":"float32","fill_value":0,
            "chunk_grid":{{"name":"regular","configuration":{{"chunk_shape":[32,32,32]}}}},
            "chunk_key_encoding":{{"name":"default","configuration":{{"separator":"/"}}}},"codecs":[{{"name":"bytes","configuration":{{"endian":"little"}}}}]}}"#
        );
        let value = |z: u32, y: u32, x: u32| {
            let at = |index: u32| (f64::from(index) + 0.5) / f64::from(side) - 0.5;
            let distance = DVec3::new(at(x), at(y), at(z)).length();
            if [x, y, z].iter().any(|&index| index >= side) {
                0.0
            } else {
                (600.0 * (0.4 - distance)).clamp(0.0, 250.0).trunc() as f32
            }
        };
        let across = side.div_ceil(32);
        for chunk in 0..across.pow(3) {
            let [x, y, z] = [chunk % across, chunk / across % across, chunk / across / across];
            let path = folder.path(&format!("ball.zarr/{level}/c/{z}/{y}/{x}"));
            let value = |at: u32| value(32 * z + at / 1024, 32 * y + at / 32 % 32, 32 * x + at % 32);
            let bytes: Vec<u8> = (0..1 << 15).flat_map(|at| value(at).to_le_bytes()).collect();
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, bytes).unwrap();
        }
        folder.write(&format!("ball.zarr/{level}/zarr.json"), array);
    }
}

#[test]
fn voxels_are_no_larger_than_a_pixel() {
    let folder = Folder::new();
    let store = two_levels();
    let level = |rest: &str| {
        let stats = folder.stats(&format!("{store} {rest}"));
        let counts = ["level", "chunks_total", "chunks_read", "voxels_total"].map(|key| count(&stats, key));
        let expected = if counts[0] == 0 { [0, 12, 12, 60] } else { [1, 1, 1, 4] };
        assert_eq!(counts, expected, "{rest}");
        // Bytes, of which two layers are read at a time; the coarse level is one layer.
        let bytes = if counts[0] == 0 { 60 + 4 * 40 } else { 4 * 4 };
        assert!(count(&stats, "bytes_read") > 0 && count(&stats, "chunk_bytes") == bytes, "{stats}");
        counts[0]
    };
    // The coarse voxels are 6 high.
    let flat = "--set camera.center=[0,0,0] --set camera.height=60";
    assert_eq!(level(&format!("{flat} --set image={{width=10,height=10}}")), 1);
    assert_eq!(level(&format!("{flat} --set image={{width=10,height=11}}")), 0);
    assert_eq!(level(&format!("{flat} --set image={{width=10,height=10}} --level 0")), 0);
    assert_eq!(level(&format!("{flat} --set image={{width=10,height=11}} --level 1")), 1);
    assert_eq!(level(&format!("{flat} --set image={{width=10,height=10}} --level auto")), 1);
    assert_eq!(level(&format!("{flat} --set image={{width=10,height=10}} --set volume.spacing=[1,4,6.01]")), 0);
    // The box reaches 4.5 from its middle to the eye, and half of the height is seen at its distance.
    let deep = "--set camera.projection=perspective --set camera.direction=[0,0,1] --set camera.up=[0,1,0] --set camera.center=[0,0,0] \
                --set camera.fov_y=53.13010235415598 --set image={width=9,height=10}";
    assert_eq!(level(&format!("{deep} --set camera.distance=64.6")), 1);
    assert_eq!(level(&format!("{deep} --set camera.distance=64.4")), 0);
    // What the camera shows by itself depends on the values.
    assert_eq!(level("--set image={width=2,height=2}"), 1);
    assert_eq!(level("--set image={width=200,height=200}"), 0);
    assert_eq!(level(&format!("{WHOLE} --set image={{width=2,height=2}}")), 1);

    // What is saved draws the same level whatever the size.
    folder.render(&format!("{store} -o small.npy --set image={{width=2,height=2}} --save-scene small.toml"));
    assert!(String::from_utf8(folder.read("small.toml")).unwrap().contains("level = 1"));
    // What is told of a file does not depend on a camera.
    let told = folder.run(&format!("info {store} --json --set image={{width=2,height=2}}"));
    let told: Value = serde_json::from_str(&told.stdout).unwrap();
    assert_eq!((count(&told, "level"), told["dims"][0].as_u64()), (0, Some(5)));
    // Movies and measurements have a camera that turns about all of the object.
    let measured = folder.run(&format!("bench {store} --frames 1 --set image={{width=2,height=2}}"));
    assert_eq!(count(&serde_json::from_str(&measured.stdout).unwrap(), "level"), 1, "{}", measured.stderr);
    folder
        .run(&format!(
            "orbit {store} -o frame-#.png --count 2 --set image={{width=2,height=2}} --save-scene orbit.toml"
        ))
        .assert_success();
    assert!(String::from_utf8(folder.read("orbit.toml")).unwrap().contains("level = 1"));
}

#[test]
fn levels_larger_than_memory_are_streamed() {
    let folder = Folder::new();
    write_pyramid(&folder);
    let two = [("RAYON_NUM_THREADS", "2")];
    let ball = "ball.zarr --memory 3MiB --set splatting.classification=before";
    let stats = |rest: &str| -> Value {
        folder
            .run_with(&two, "", &format!("render {ball} --backend cpu -o image.npy --stats stats.json {rest}"))
            .assert_success();
        serde_json::from_slice(&folder.read("stats.json")).unwrap()
    };
    let large = stats("--set image={width=100,height=100}");
    assert_eq!(["level", "chunks_total", "voxels_total"].map(|key| count(&large, key)), [0, 27, 96 * 96 * 96]);
    assert!(count(&large, "chunks_read") > 0 && count(&large, "chunk_bytes") <= 3 << 20, "{large}");
    let small = stats("--set image={width=20,height=20}");
    assert_eq!(["level", "chunks_total", "voxels_total"].map(|key| count(&small, key)), [1, 8, 48 * 48 * 48]);
    let stated = stats("--set image={width=20,height=20} --level 0");
    assert_eq!(count(&stated, "level"), 0);
    // Another backend draws boxes of it.
    let average = "--backend reference --set image={width=100,height=100} --level 0 --set splatting.compositing=average \
                   --set transfer.opacity=[[0,0],[255,0.5]] --set transfer.color=[[0,[1,0.9,0.8]]] \
                   --set camera.direction=[0.3,1,-0.4] --set camera.center=[0,0,0] --set camera.height=120";
    folder.run_with(&two, "", &format!("render {ball} {average} -o boxes.npy")).assert_success();
    folder.render(&format!("ball.zarr --set splatting.classification=before {average} -o whole.npy"));
    let [(.., boxes), (.., whole)] = ["boxes.npy", "whole.npy"].map(|name| folder.read_npy(name));
    let differences = boxes.as_flattened().iter().zip(whole.as_flattened()).map(|(a, b)| (a - b).abs());
    assert!(differences.fold(0.0, f32::max) < 1e-6 && whole.iter().any(|pixel| pixel[3] > 0.01));
}
