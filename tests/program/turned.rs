//! Files with left-handed axes: those of one head in RAS and in LAS order have one picture, byte for byte.

use std::path::Path;

use serde_json::{Value, json};

use crate::*;

/// A file that nibabel wrote (`tests/fixtures/make.py`).
fn fixture(name: &str) -> String {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures/turned")).join(name).display().to_string()
}

const SIZE: &str = "--set image={width=60,height=50} --backend cpu";

#[test]
fn pictures_of_one_head_are_the_same() {
    let folder = Folder::new();
    let picture = |name: &str, rest: &str| folder.pixels(&format!("{} {SIZE} {rest}", fixture(name)));
    for rest in [
        "--set splatting.slab_width=0.7",
        "--view front",
        "--preset mip",
        "--set splatting.classification=before --set transfer.opacity=[[20,0],[60,0.9]]",
        "--set clip.crop=[[-20,-20,-20],[3,20,20]]",
    ] {
        assert_eq!(picture("ras.nii", rest), picture("las.nii", rest), "{rest}");
    }
    // The ball is on the patient's right, which is on the left from the front.
    let (width, _, pixels) =
        picture("las.nii", "--view front --set transfer.opacity=[[150,0],[200,0.9]] --set camera.fit=volume");
    let shown: Vec<usize> = (0..pixels.len()).filter(|&at| pixels[at][3] > 0.5 && pixels[at][0] > 0.0).collect();
    assert!(!shown.is_empty() && shown.iter().all(|at| at % width < width / 2), "{shown:?}");
    // Words at the edges, and a saved scene.
    let annotated = |name: &str| {
        let rest = "--view front --annotate sides --save-scene saved.toml -o out.png --no-metadata \
                    --set image={width=240,height=200}";
        folder.render(&format!("{} --backend cpu {rest}", fixture(name)));
        let saved = String::from_utf8(folder.read("saved.toml")).unwrap();
        folder.render("saved.toml --backend cpu -o again.png");
        (folder.read("out.png"), saved.replace(name, ""))
    };
    assert!(annotated("ras.nii") == annotated("las.nii"), "annotations or scenes differ");
}

#[test]
fn labels_and_channels_are_turned_too() {
    let folder = Folder::new();
    let labelled = |name: &str, labels: &str| {
        let labels =
            format!("--set volume.labels={:?} --set transfer.label=[{{label=2,color=[[0,[1,0,0]]]}}]", fixture(labels));
        folder.pixels(&format!("{} {SIZE} {labels}", fixture(name)))
    };
    let expected = labelled("ras.nii", "labels-ras.nii");
    for (name, labels) in [("las.nii", "labels-las.nii"), ("las.nii", "labels-ras.nii"), ("ras.nii", "labels-las.nii")]
    {
        assert!(labelled(name, labels) == expected, "{name} {labels}");
    }
    let channels = |names: [&str; 2]| {
        let tables = names.map(|name| format!("[[channel]]\n[channel.volume]\npath = {:?}\n", fixture(name)));
        folder.write("scene.toml", tables.concat());
        let run = folder.run(&format!("render scene.toml {SIZE} -o channels.npy"));
        run.assert_success();
        assert!(!run.stderr.contains("resampled"), "{}", run.stderr);
        folder.read_npy("channels.npy")
    };
    let expected = channels(["ras.nii", "labels-ras.nii"]);
    assert!(channels(["las.nii", "labels-ras.nii"]) == expected && channels(["las.nii", "labels-las.nii"]) == expected);
}

#[test]
fn info_says_that_x_is_turned() {
    let folder = Folder::new();
    let info = |name: &str| folder.run(&format!("info {}", fixture(name))).stdout;
    let [ras, las] = ["ras.nii", "las.nii"].map(info);
    assert!(ras.contains("x to the right, y to the front, z to the head\n"), "{ras}");
    assert!(
        las.contains("x to the left, y to the front, z to the head; left-handed, so that pictures have x turned\n"),
        "{las}"
    );
    let other =
        |text: &str| text.lines().filter(|line| !line.starts_with("orientation")).collect::<Vec<_>>().join("\n");
    assert_eq!(other(&ras), other(&las));
}

/// Sizes of a volume that does not fit into the memory that a scene gets.
const DIMS: [usize; 3] = [190, 120, 112];

/// The values of a ball aside.
fn values() -> Vec<f32> {
    let value = |at: usize| {
        let place = [at % DIMS[0], at / DIMS[0] % DIMS[1], at / DIMS[0] / DIMS[1]];
        let squares = place.iter().zip([70.0, 66.0, 50.0]).map(|(&at, middle)| (at as f64 - middle).powi(2));
        (250.0 - 6.0 * squares.sum::<f64>().sqrt()).clamp(0.0, 200.0) as f32
    };
    (0..DIMS.iter().product()).map(value).collect()
}

const STREAMED: &str = "--set camera.direction=[0.3,1,-0.4] --set camera.fit=volume --set transfer={color=[[0,[1,1,1]]],opacity=[[0,0],[100,0],[200,0.8]]} \
                        --set image={width=60,height=50} --backend cpu --set splatting.classification=before";

#[test]
fn streamed_files_are_turned() {
    let folder = Folder::new();
    let values = values();
    let write = |name: &str, space: &str, values: &[f32]| {
        let [x, y, z] = DIMS;
        let header = format!(
            "NRRD0004\ntype: float\ndimension: 3\nsizes: {x} {y} {z}\nspace: {space}\nspace directions: (1,0,0) (0,1,0) (0,0,1)\n\
             encoding: raw\nendian: little\n\n"
        );
        let bytes = values.iter().flat_map(|value| value.to_le_bytes());
        folder.write(name, header.into_bytes().into_iter().chain(bytes).collect::<Vec<u8>>());
    };
    write("ras.nrrd", "RAS", &values);
    let turned: Vec<f32> = values.chunks(DIMS[0]).flat_map(|row| row.iter().rev().copied()).collect();
    write("las.nrrd", "LAS", &turned);
    let two = [("RAYON_NUM_THREADS", "2")];
    let draw = |arguments: &str| {
        folder
            .run_with(&two, "", &format!("render {arguments} {STREAMED} -o out.npy --stats stats.json"))
            .assert_success();
        let stats: Value = serde_json::from_slice(&folder.read("stats.json")).unwrap();
        (folder.read_npy("out.npy"), stats["chunks_read"].as_u64().unwrap_or(0))
    };
    let (whole, _) = draw("las.nrrd");
    let (streamed, read) = draw("las.nrrd --memory 9MiB");
    assert!(whole == streamed && whole == draw("ras.nrrd").0 && read > 0, "{read} chunks");
    let (of_ras, read_of_ras) = draw("ras.nrrd --memory 9MiB");
    assert!(of_ras == streamed && read == read_of_ras);
    // Which chunks show nothing is known in the turned order.
    folder.run("index las.nrrd -o las.index").assert_success();
    let (indexed, read_by_index) = draw("las.nrrd --memory 9MiB --index las.index");
    assert!(indexed == whole && read_by_index < read, "{read_by_index} of {read} chunks");
}

#[test]
fn stores_are_turned() {
    let folder = Folder::new();
    // Chunks that do not divide the first axis.
    let (sizes, chunk) = ([44_usize, 40, 36], 16_usize);
    let value = |[x, y, z]: [usize; 3]| {
        let squares = [(x, 30.0), (y, 18.0), (z, 20.0)].map(|(at, middle)| (at as f64 - middle).powi(2));
        (220.0 - 16.0 * squares.iter().sum::<f64>().sqrt()).clamp(0.0, 200.0) as f32
    };
    let write = |name: &str, to: &str, turned: bool| {
        let store = folder.path(name);
        let axes = [("z", "inferior-to-superior"), ("y", "posterior-to-anterior"), ("x", to)];
        let axes = axes.map(
            |(name, to)| json!({"name": name, "type": "space", "orientation": {"type": "anatomical", "value": to}}),
        );
        let level = json!({"path": "0", "coordinateTransformations": [{"type": "scale", "scale": [1.0, 1.0, 1.0]}]});
        let group = json!({"zarr_format": 3, "node_type": "group", "attributes": {"ome": {
            "version": "0.6", "multiscales": [{"axes": axes, "datasets": [level]}],
        }}});
        let array = json!({
            "zarr_format": 3, "node_type": "array", "shape": [sizes[2], sizes[1], sizes[0]], "data_type": "float32", "fill_value": 0,
            "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": vec![chunk; 3]}},
            "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}},
            "codecs": [{"name": "bytes", "configuration": {"endian": "little"}}],
        });
        let put = |name: &str, bytes: &[u8]| {
            let path = store.join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, bytes).unwrap();
        };
        put("zarr.json", group.to_string().as_bytes());
        put("0/zarr.json", array.to_string().as_bytes());
        let counts = sizes.map(|size| size.div_ceil(chunk));
        for at in 0..counts.iter().product() {
            let place = [at % counts[0], at / counts[0] % counts[1], at / counts[0] / counts[1]];
            let voxel = |index: usize| {
                let own = [index % chunk, index / chunk % chunk, index / chunk / chunk];
                let [x, y, z] = [0, 1, 2].map(|axis| place[axis] * chunk + own[axis]);
                value([if turned { (sizes[0] - 1).wrapping_sub(x) } else { x }, y, z])
            };
            let values: Vec<f32> = (0..chunk.pow(3)).map(voxel).collect();
            // The empty ones are not held.
            if values.iter().any(|&value| value > 0.0) {
                let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
                put(&format!("0/c/{}/{}/{}", place[2], place[1], place[0]), &bytes);
            }
        }
    };
    write("ras.zarr", "left-to-right", false);
    write("las.zarr", "right-to-left", true);
    let two = [("RAYON_NUM_THREADS", "2")];
    let draw = |arguments: &str| {
        folder
            .run_with(&two, "", &format!("render {arguments} {STREAMED} -o out.npy --stats stats.json"))
            .assert_success();
        let stats: Value = serde_json::from_slice(&folder.read("stats.json")).unwrap();
        (folder.read_npy("out.npy"), stats["chunks_read"].as_u64().unwrap())
    };
    let (whole, _) = draw("ras.zarr");
    assert!(whole == draw("las.zarr").0);
    for name in ["ras.zarr", "las.zarr"] {
        let (streamed, read) = draw(&format!("{name} --memory 240KiB"));
        assert!(streamed == whole && read > 0, "{name}: {read} chunks");
    }
}
