//! Zarr stores that lie, streamed: an error that names the chunk, and no image.

use std::fs;

use serde_json::{Value, json};

use crate::*;

/// Voxels along z, y and x of the finest level, and along a chunk's sides.
const SHAPE: [usize; 3] = [48, 48, 64];
const CHUNK: usize = 16;

/// A limit that the values do not fit into, and an opaque object, of which the chunks at x = 0 are seen.
const STREAMED: &str = "--memory 580000B --level 0 --set image={width=80,height=60} --set camera.fit=volume \
                        --set camera.direction=[1,0,0] --set transfer={color=[[0,[1,1,1]]],opacity=[[0,0.9],[255,1]]} \
                        --set splatting={classification=\"before\",culling=false}";

/// The codec of uncompressed numbers.
fn bytes() -> Value {
    json!({"name": "bytes", "configuration": {"endian": "little"}})
}

/// The metadata of an array, in chunks or in shards of 2×2×2 chunks.
fn array(shape: [usize; 3], codecs: Value, is_sharded: bool) -> Value {
    let shards = json!([{"name": "sharding_indexed", "configuration": {
        "chunk_shape": vec![CHUNK; 3], "codecs": codecs, "index_codecs": [bytes()], "index_location": "end",
    }}]);
    let outer = if is_sharded { 2 * CHUNK } else { CHUNK };
    json!({
        "zarr_format": 3, "node_type": "array", "shape": shape, "data_type": "float32", "fill_value": 0,
        "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": vec![outer; 3]}},
        "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}},
        "codecs": if is_sharded { shards } else { codecs },
    })
}

/// The bytes of a chunk, whose values depend on its place.
fn chunk(at: [usize; 3]) -> Vec<u8> {
    let value = |index: usize| (1 + index % 200 + at.iter().sum::<usize>()) as f32;
    (0..CHUNK.pow(3)).flat_map(|index| value(index).to_le_bytes()).collect()
}

/// Writes an image of two levels, whose coarser one fits into the memory for a sample.
fn write(folder: &Folder, codecs: &Value, is_sharded: bool) {
    let store = folder.path("store.zarr");
    _ = fs::remove_dir_all(&store);
    let write = |name: &str, bytes: &[u8]| {
        let path = store.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    };
    let axes = ["z", "y", "x"].map(|name| json!({"name": name, "type": "space"}));
    let dataset = |path: &str, scale: f64| json!({"path": path, "coordinateTransformations": [{"type": "scale", "scale": vec![scale; 3]}]});
    let group = json!({"zarr_format": 3, "node_type": "group", "attributes": {"ome": {
        "version": "0.5", "multiscales": [{"axes": axes, "datasets": [dataset("0", 1.0), dataset("1", 4.0)]}],
    }}});
    write("zarr.json", group.to_string().as_bytes());
    write("0/zarr.json", array(SHAPE, codecs.clone(), is_sharded).to_string().as_bytes());
    let coarse = array(SHAPE.map(|count| count / 4), json!([bytes()]), false);
    write("1/zarr.json", coarse.to_string().as_bytes());
    write("1/c/0/0/0", &chunk([0; 3]));
    let counts = SHAPE.map(|count| count / CHUNK);
    let all = |counts: [usize; 3]| {
        let rows = move |z| (0..counts[1]).flat_map(move |y| (0..counts[2]).map(move |x| [z, y, x]));
        (0..counts[0]).flat_map(rows)
    };
    if !is_sharded {
        all(counts).for_each(|at| write(&format!("0/c/{}/{}/{}", at[0], at[1], at[2]), &chunk(at)));
        return;
    }
    for shard in all(counts.map(|count| count.div_ceil(2))) {
        let (mut bytes, mut index) = (Vec::new(), Vec::new());
        for inner in all([2; 3]) {
            let at: [usize; 3] = std::array::from_fn(|axis| 2 * shard[axis] + inner[axis]);
            let is_there = (0..3).all(|axis| at[axis] < counts[axis]);
            let entry = if is_there { [bytes.len() as u64, 4 * CHUNK.pow(3) as u64] } else { [u64::MAX; 2] };
            index.extend(entry.map(u64::to_le_bytes).concat());
            bytes.extend(if is_there { chunk(at) } else { Vec::new() });
        }
        write(&format!("0/c/{}/{}/{}", shard[0], shard[1], shard[2]), &[bytes, index].concat());
    }
}

/// Streams the store chunk by chunk by the CPU, and box by box by the GPU; neither of which must draw anything.
fn assert_refused(folder: &Folder, words: &[&str]) {
    for backend in ["cpu", "gpu"] {
        let run = render(folder, backend, "");
        run.assert_failure(2, words);
        assert!(!folder.path("image.npy").exists(), "{backend} {words:?}");
    }
}

fn render(folder: &Folder, backend: &str, rest: &str) -> Run {
    let two = [("RAYON_NUM_THREADS", "2")];
    folder.run_with(&two, "", &format!("render store.zarr {STREAMED} --backend {backend} -o image.npy{rest}"))
}

#[test]
fn damaged_chunks_are_named() {
    let folder = Folder::new();
    let plain = json!([bytes()]);
    let damaged = |name: &str, change: &dyn Fn(Vec<u8>) -> Vec<u8>| {
        let path = folder.path("store.zarr").join(name);
        fs::write(&path, change(fs::read(&path).unwrap())).unwrap();
    };
    for is_sharded in [false, true] {
        write(&folder, &plain, is_sharded);
        for backend in ["cpu", "gpu"] {
            render(&folder, backend, " --stats stats.json").assert_success();
            let stats: Value = serde_json::from_slice(&folder.read("stats.json")).unwrap();
            let [total, read] = ["chunks_total", "chunks_read"].map(|key| stats[key].as_u64().unwrap());
            assert_eq!((total, read), (36, 36), "{backend}");
            // Not the sample's, which is of the other level.
            assert_eq!(stats["sample_chunks_read"].as_u64(), Some(1), "{stats}");
            fs::remove_file(folder.path("image.npy")).unwrap();
        }
    }
    // A shard that is cut off: its last bytes are no index of it.
    damaged("0/c/0/0/0", &|bytes| bytes[..bytes.len() / 2].to_vec());
    assert_refused(&folder, &["0/c/0/0/0: chunk: found ", "in the chunk from ["]);
    // Too short for an index.
    damaged("0/c/0/0/0", &|bytes| bytes[..9].to_vec());
    assert_refused(&folder, &["0/c/0/0/0: chunk: found a shard of 9 bytes, whose index alone takes 128"]);

    write(&folder, &plain, false);
    damaged("0/c/1/1/0", &|bytes| bytes[..1000].to_vec());
    assert_refused(
        &folder,
        &["0/c/1/1/0: chunk: found ", "in the chunk from [16, 16, 0]", "undamaged chunk of [16, 16, 16]"],
    );
    // Chunks that are not compressed as the metadata say.
    write(&folder, &json!([bytes(), {"name": "gzip", "configuration": {"level": 5}}]), false);
    assert_refused(&folder, &["0/c/", ": chunk: found ", "in the chunk from ["]);
    // Chunks without the checksum that the metadata promise.
    write(&folder, &json!([bytes(), {"name": "crc32c"}]), true);
    assert_refused(&folder, &["0/c/", ": chunk: found ", "in the chunk from ["]);
}

/// Links that lead to themselves, and to the folder in which they are.
#[cfg(unix)]
#[test]
fn links_in_circles_are_errors() {
    let folder = Folder::new();
    let plain = json!([bytes()]);
    write(&folder, &plain, false);
    let path = folder.path("store.zarr/0/c/1/1/0");
    fs::remove_file(&path).unwrap();
    std::os::unix::fs::symlink(&path, &path).unwrap();
    assert_refused(&folder, &["0/c/1/1/0: "]);
    folder.run("render store.zarr --level 0 --backend cpu -o image.npy").assert_failure(2, &["0/c/1/1/0: "]);

    // A level that is the store itself, which has no array at its root.
    write(&folder, &plain, false);
    fs::remove_dir_all(folder.path("store.zarr/0")).unwrap();
    std::os::unix::fs::symlink(folder.path("store.zarr"), folder.path("store.zarr/0")).unwrap();
    folder.run("render store.zarr --level 0 --backend cpu -o image.npy").assert_failure(2, &["0/zarr.json: "]);
    assert!(!folder.path("image.npy").exists());
}

/// A chunk that is gone since an index was made.
#[test]
fn chunks_missing_against_an_index_are_named() {
    let folder = Folder::new();
    write(&folder, &json!([bytes()]), false);
    folder.run("index store.zarr -o store.index").assert_success();
    for backend in ["cpu", "gpu"] {
        render(&folder, backend, " --index store.index").assert_success();
        fs::remove_file(folder.path("image.npy")).unwrap();
    }
    fs::remove_file(folder.path("store.zarr/0/c/0/2/0")).unwrap();
    for backend in ["cpu", "gpu"] {
        let expected =
            "store.index: chunk: found no chunk [0, 2, 0] of level 0 in the store, allowed: the one with values from";
        render(&folder, backend, " --index store.index").assert_failure(2, &[expected]);
        assert!(!folder.path("image.npy").exists());
        // Without an index it is one whose values are all the fill value.
        render(&folder, backend, "").assert_success();
        fs::remove_file(folder.path("image.npy")).unwrap();
    }
}
