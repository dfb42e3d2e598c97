//! Volumes that are larger than `--memory`.

use std::fs;

use serde_json::{Value, json};

use crate::*;

/// A file without a header, of a solid ball: 18 MiB.
pub(crate) fn write_ball(folder: &Folder) -> &'static str {
    let [nx, ny, nz] = [192_u32, 160, 155];
    let value = |[x, y, z]: [u32; 3]| {
        let [x, y, z] = [(x, nx), (y, ny), (z, nz)].map(|(at, count)| f64::from(at) / f64::from(count - 1) - 0.5);
        (600.0 * (0.45 - (x * x + y * y + z * z).sqrt())).clamp(0.0, 250.0).trunc() as f32
    };
    let voxels = (0..nz).flat_map(|z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z])));
    folder.write("ball.raw", voxels.flat_map(|voxel| value(voxel).to_le_bytes()).collect::<Vec<u8>>());
    "ball.raw --dims 192,160,155 --type float32 --endian little --set splatting.classification=before --set image={width=120,height=90}"
}

#[test]
fn a_volume_larger_than_memory_has_the_bytes_of_one_that_fits() {
    let folder = Folder::new();
    let ball = write_ball(&folder);
    let stated = "--set transfer.opacity=[[0,0],[60,0],[200,0.8]] --set camera.direction=[0.3,1,-0.4] \
                  --set camera.center=[0,0,0] --set camera.height=230 --set transfer.color=[[0,[1,0.9,0.8]]] --backend cpu";
    folder.render(&format!("{ball} {stated} -o whole.npy"));
    let two = [("RAYON_NUM_THREADS", "2")];
    let run = |rest: &str| folder.run_with(&two, "", &format!("render {ball} {rest} --memory 17MiB"));
    run(&format!("{stated} -o streamed.npy --stats stats.json")).assert_success();
    assert!(folder.read("streamed.npy") == folder.read("whole.npy"), "the images differ");
    let stats: Value = serde_json::from_slice(&folder.read("stats.json")).unwrap();
    let of = |key: &str| stats[key].as_u64().unwrap();
    assert_eq!((of("chunks_total"), of("level"), of("voxels_total")), (27, 0, 192 * 160 * 155));
    assert!((1..=27).contains(&of("chunks_read")), "{stats}");
    assert_eq!(of("bytes_read") % 64, 0);
    assert!(of("chunk_bytes") <= 17 << 20, "{stats}");
    // However many threads there are: memory decides how many draw.
    let many = [("RAYON_NUM_THREADS", "16")];
    for rest in
        [format!("{stated} -o many.npy"), format!("{stated} -o many-after.npy --set splatting.classification=after")]
    {
        let arguments = format!("render {ball} {rest} --memory 17MiB --stats many.json");
        folder.run_with(&many, "", &arguments).assert_success();
        let stats: Value = serde_json::from_slice(&folder.read("many.json")).unwrap();
        assert!((1..=17 << 20).contains(&stats["chunk_bytes"].as_u64().unwrap()), "{stats}");
    }
    assert!(folder.read("many.npy") == folder.read("whole.npy"), "the images differ");
    assert_eq!((of("sample_chunks_read"), of("sample_bytes_read")), (27, 4 * 192 * 160 * 155), "{stats}");

    // With an index the same bytes after splatting, too.
    let after = format!("{stated} --set splatting.classification=after");
    folder.render(&format!("{ball} {after} -o whole.npy"));
    folder.run(&format!("index {ball} -o ball.index")).assert_success();
    run(&format!("{after} --index ball.index -o streamed.npy")).assert_success();
    assert!(folder.read("streamed.npy") == folder.read("whole.npy"), "the images differ");
    run(&format!("{after} --index ball.raw -o no.npy")).assert_failure(2, &["ball.raw: "]);
    folder.write("other.index", "sheetsplat index 1\nidentity 0\n");
    run(&format!("{after} --index other.index -o no.npy"))
        .assert_failure(2, &["other.index: identity: found 0, allowed: ", "that of the store"]);
    // Where the volume fits into memory, too.
    for (volume, index, expected) in [
        (ball, "missing.index", "missing.index: "),
        (ball, "other.index", "other.index: identity: found 0"),
        ("builtin:head:16", "ball.index", "ball.index: index: found an index for a volume that comes from no file"),
    ] {
        folder.run(&format!("render {volume} --index {index} -o no.npy")).assert_failure(2, &[expected]);
    }
    folder
        .run(&format!("index {ball} -o ball.raw"))
        .assert_failure(2, &["--output ball.raw: found the same file as the input"]);
    folder
        .run(&format!("index {ball} --index ball.index -o no.index"))
        .assert_failure(2, &["--index: found an index for the store, allowed: --output"]);
    folder
        .run("index builtin:head -o no.index")
        .assert_failure(2, &["builtin:head: found a volume that is not read by boxes"]);

    // What a scene leaves open is chosen for a sample.
    run("--backend cpu -o open.png").assert_success();
    run("--set splatting.classification=after --backend cpu -o after.png").assert_success();
    run("--set splatting.classification=after --set splatting.interpolation=exact --backend cpu -o no.png")
        .assert_failure(2, &["splatting.interpolation: found \"exact\" for a volume that is streamed, allowed: "]);
    folder
        .run_with(&two, "", &format!("render {ball} --backend cpu --memory 3MiB -o no.png"))
        .assert_failure(2, &["bytes of memory, allowed: at most the memory limit of 3145728 bytes"]);
    assert!(!folder.path("no.png").exists() && !folder.path("no.exr").exists());
}

/// Parts, movies and contact sheets of a volume that is streamed have the bytes of those of one in memory.
#[test]
fn everything_is_drawn_of_a_volume_larger_than_memory() {
    let folder = Folder::new();
    let ball = write_ball(&folder);
    let stated = "--set transfer.opacity=[[0,0],[60,0],[200,0.8]] --set splatting.opacity_threshold=1 --backend cpu \
                  --set camera.direction=[0.3,1,-0.4] --set camera.center=[0,0,0] --set camera.height=230 \
                  --set transfer.color=[[0,[1,0.9,0.8]]]";
    let two = [("RAYON_NUM_THREADS", "2")];
    let run = |what: &str, rest: &str| {
        for (name, memory) in [("whole", "1GiB"), ("streamed", "17MiB")] {
            let rest = rest.replace("NAME", name);
            folder.run_with(&two, "", &format!("{what} {ball} {stated} {rest} --memory {memory}")).assert_success();
        }
    };
    let assert_same = |ends: &[&str]| {
        for end in ends {
            assert!(folder.read(&format!("streamed{end}")) == folder.read(&format!("whole{end}")), "{end}");
        }
    };
    // With an index, and without one.
    folder.run(&format!("index {ball} -o ball.index")).assert_success();
    run("orbit", "-o NAME-#.npy --count 3 --frames 1..3");
    assert_same(&["-1.npy", "-2.npy"]);
    run("orbit", "-o NAME-i#.npy --count 3 --frames 1..2 --index ball.index");
    assert_same(&["-i1.npy"]);
    run("sweep", "-o NAME.npy --set splatting.slab_width=1,2 --index ball.index");
    assert_same(&[".npy"]);
    let chunks = |index: &str| {
        let bench = folder.run_with(&two, "", &format!("bench {ball} {stated} --frames 1 --memory 17MiB{index}"));
        let report: Value =
            serde_json::from_str(&bench.stdout).unwrap_or_else(|error| panic!("{error}: {}", bench.stderr));
        report["chunks_read"].as_u64().unwrap()
    };
    // Without one, chunks beside the ball are read to find that they are empty.
    assert!(chunks(" --index ball.index") <= chunks(""));
    for command in ["orbit", "sweep --set splatting.slab_width=1,2", "split -n 2"] {
        let output = if command == "orbit" { " -o no-#.npy" } else { " -o no.npy" };
        let output = if command.starts_with("split") { "" } else { output };
        folder
            .run_with(&two, "", &format!("{command} {ball} --memory 17MiB --index missing.index{output}"))
            .assert_failure(2, &["missing.index: "]);
    }

    let split = folder.run_with(&two, "", &format!("split {ball} {stated} -n 6 --memory 17MiB --index ball.index"));
    assert_eq!((split.code, split.stdout.lines().count()), (Some(0), 6), "{}", split.stderr);
    for (at, window) in split.stdout.lines().enumerate() {
        run("render", &format!("-o NAME-{at}.exr {window}"));
    }
    run("render", "-o NAME.npy");
    assert_same(&[".npy"]);
    for name in ["whole", "streamed"] {
        let parts: Vec<String> = (0..6).map(|at| format!("{name}-{at}.exr")).collect();
        folder.run(&format!("merge {} -o {name}-merged.npy", parts.join(" "))).assert_success();
    }
    assert_same(&["-merged.npy"]);
    // Facts are told by a sample.
    let info = folder.run_with(&two, "", &format!("info {ball} --json --memory 17MiB"));
    let info: Value = serde_json::from_str(&info.stdout).unwrap();
    assert_eq!((info["dims"].clone(), info["type"].clone()), (json!([192, 160, 155]), json!("float32")));
    assert_eq!((info["format"].clone(), info["sample"].clone()), (json!("raw"), json!([64, 54, 52])));
    assert!(info["max"].as_f64().unwrap() > 200.0, "{info}");
    // Parts of a store and of its values do not mix, as only the latter are known value by value.
    let mixed = "streamed-0.exr whole-1.exr whole-2.exr whole-3.exr whole-4.exr whole-5.exr";
    folder
        .run(&format!("merge {mixed} -o no.npy"))
        .assert_failure(2, &["whole-1.exr: scene: found ", ", as in streamed-0.exr"]);
}

/// An OME-Zarr image of three channels of 64³ numbers, each a ball in another corner, in chunks of 16³: 3 MiB. Chunks of zeros are left out.
fn write_channels(folder: &Folder) {
    const SIDE: u32 = 64;
    let axes =
        ["c", "z", "y", "x"].map(|name| json!({"name": name, "type": if name == "c" { "channel" } else { "space" }}));
    let dataset = json!({"path": "0", "coordinateTransformations": [{"type": "scale", "scale": [1, 1, 1, 1]}]});
    let group = json!({"zarr_format": 3, "node_type": "group", "attributes": {"ome": {
        "version": "0.5", "multiscales": [{"axes": axes, "datasets": [dataset]}],
    }}});
    let array = json!({
        "zarr_format": 3, "node_type": "array", "shape": [3, SIDE, SIDE, SIDE], "data_type": "float32", "fill_value": 0,
        "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": [1, 16, 16, 16]}},
        "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}}, "codecs": [{"name": "bytes", "configuration": {"endian": "little"}}],
    });
    fs::create_dir_all(folder.path("three.zarr/0")).unwrap();
    folder.write("three.zarr/zarr.json", group.to_string());
    folder.write("three.zarr/0/zarr.json", array.to_string());
    for (channel, chunk) in (0..3).flat_map(|channel| (0..64).map(move |chunk: u32| (channel, chunk))) {
        let low = [chunk % 4, chunk / 4 % 4, chunk / 16].map(|at| 16 * at);
        let value = |index: u32| ball(channel, [index % 16 + low[0], index / 16 % 16 + low[1], index / 256 + low[2]]);
        let bytes: Vec<u8> = (0..16 * 16 * 16).flat_map(|index| value(index).to_le_bytes()).collect();
        if bytes.iter().any(|&byte| byte > 0) {
            let path =
                folder.path(&format!("three.zarr/0/c/{channel}/{}/{}/{}", low[2] / 16, low[1] / 16, low[0] / 16));
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, bytes).unwrap();
        }
    }
}

/// The value at a voxel of a ball among 64³ voxels, in a corner for each of three channels.
fn ball(channel: u32, voxel: [u32; 3]) -> f32 {
    let center = [[24.0, 26.0, 25.0], [40.0, 30.0, 28.0], [30.0, 40.0, 36.0]][channel as usize];
    let square: f32 = voxel.iter().zip(center).map(|(&at, center): (_, f32)| (at as f32 - center).powi(2)).sum();
    (15.0 * (18.0 - square.sqrt())).clamp(0.0, 200.0).floor()
}

/// Asserts that something of several channels is drawn the same with a limit that it does not fit into, and returns the statistics.
fn assert_streamed_alike(folder: &Folder, what: &str, memory: &str) -> Value {
    folder.render(&format!("{what} -o whole.npy"));
    folder
        .run_with(&ONE_THREAD, "", &format!("render {what} --memory {memory} -o streamed.npy --stats stats.json"))
        .assert_success();
    let [whole, streamed] = ["whole.npy", "streamed.npy"].map(|name| folder.read_npy(name).2);
    assert!(whole.iter().any(|pixel| *pixel != whole[0]), "{what}: nothing shows");
    let differences = whole.iter().flatten().zip(streamed.iter().flatten()).map(|(a, b)| (a - b).abs());
    let largest = differences.fold(0.0, f32::max);
    assert!(largest <= 2e-6, "{what}: {largest:e}");
    serde_json::from_slice(&folder.read("stats.json")).unwrap()
}

/// Every thread may hold chunks, so that fewer threads need less memory.
const ONE_THREAD: [(&str, &str); 1] = [("RAYON_NUM_THREADS", "1")];

/// What all images of several channels have in common.
const CAMERA: &str = "--set camera={direction=[0.3,1,-0.4],fit=\"volume\"} --set image={width=150,height=130} --set splatting.opacity_threshold=1";

#[test]
fn channels_of_an_image_larger_than_memory_are_streamed() {
    let folder = Folder::new();
    write_channels(&folder);
    let table = |number: u32, color: &str| {
        format!("--set channel[{number}].transfer={{opacity=[[0,0],[40,0],[200,0.6]],color=[[0,{color}]]}}")
    };
    let look = format!("three.zarr {CAMERA} {} {}", table(0, "[1,0,0]"), table(2, "[0,0.3,1]"));
    let of = |stats: &Value, key: &str| stats[key].as_u64().unwrap();
    for backend in ["cpu", "gpu", "reference"] {
        let shown = format!("{look} {} --backend {backend} --set splatting.classification=before", table(1, "[0,1,0]"));
        let stats = assert_streamed_alike(&folder, &shown, "2MiB");
        assert_eq!((of(&stats, "chunks_total"), of(&stats, "voxels_total")), (3 * 64, 64 * 64 * 64), "{backend}");
        assert!((3..3 * 64).contains(&of(&stats, "chunks_read")), "{backend}: {stats}");
        assert_eq!(of(&stats, "bytes_read"), of(&stats, "chunks_read") * 4 * 16 * 16 * 16, "{backend}");
        // A hidden channel, and one without opacity.
        let hidden = format!("{shown} --set channel[0].visible=false --set channel[2].transfer.opacity=[[0,0]]");
        let fewer = assert_streamed_alike(&folder, &hidden, "2MiB");
        assert!((1..64).contains(&of(&fewer, "chunks_read")), "{backend}: {fewer}");
    }
    // What the image leaves open is chosen for a sample; the channels share no sheets; one channel alone.
    let after = format!("{look} {} --backend cpu --set splatting.classification=after", table(1, "[0,1,0]"));
    let stats = assert_streamed_alike(&folder, &after, "2MiB");
    assert!(of(&stats, "sample_chunks_read") >= 3, "{stats}");
    assert_streamed_alike(&folder, &format!("{after} --set splatting.compositing=maximum"), "2MiB");
    let one = format!(
        "three.zarr {CAMERA} --channel 1 --backend cpu --set transfer={{opacity=[[0,0],[40,0],[200,0.6]],color=[[0,[1,1,1]]]}}"
    );
    let stats = assert_streamed_alike(&folder, &one, "900KiB");
    assert_eq!(of(&stats, "chunks_total"), 64);
    for preset in ["confocal", "fusion"] {
        let open = format!("render three.zarr --preset {preset} --memory 2MiB --backend cpu -o open.png");
        folder.run_with(&ONE_THREAD, "", &open).assert_success();
    }

    // An index of one channel: nothing is read of it if all of its values are below those that show.
    folder.run("index three.zarr --channel 1 -o one.index").assert_success();
    let dim = format!("{after} --set channel[1].transfer.opacity=[[0,0],[210,0],[220,1]]");
    let plain = assert_streamed_alike(&folder, &dim, "2MiB");
    let told = assert_streamed_alike(&folder, &format!("{dim} --index one.index"), "2MiB");
    assert!(of(&told, "chunks_read") < of(&plain, "chunks_read"), "{told} {plain}");
    folder.run("index three.zarr -o all.index").assert_failure(2, &["three.zarr: channels: found 3, allowed: "]);
    assert_streamed_alike(&folder, &format!("{after} --set splatting.compositing=surface"), "2MiB");

    // Parts, and what tells of the volume.
    for (at, slabs) in ["-100..0", "0..100"].iter().enumerate() {
        let part = format!("render {after} --memory 2MiB --slabs {slabs} -o part-{at}.exr");
        folder.run_with(&ONE_THREAD, "", &part).assert_success();
    }
    folder.run("merge part-0.exr part-1.exr -o merged.npy").assert_success();
    folder.run_with(&ONE_THREAD, "", &format!("render {after} --memory 2MiB -o streamed.npy")).assert_success();
    let [merged, streamed] = ["merged.npy", "streamed.npy"].map(|name| folder.read_npy(name).2);
    let differences = merged.iter().flatten().zip(streamed.iter().flatten()).map(|(a, b)| (a - b).abs());
    assert!(differences.fold(0.0, f32::max) <= 1e-6);
    let info = folder.run_with(&ONE_THREAD, "", "info three.zarr --json --memory 2MiB");
    let info: Value = serde_json::from_str(&info.stdout).unwrap();
    assert_eq!((info["channels"].clone(), info["dims"].clone()), (json!(3), json!([64, 64, 64])), "{info}");
}

/// Channels of several files, one of them segmented.
#[test]
fn channels_of_several_files_larger_than_memory_are_streamed() {
    let folder = Folder::new();
    // 4.4 MiB each, and half of it as labels.
    let dims = [112_u32, 104, 100];
    let header = |kind: &str, [x, y, z]: [u32; 3]| {
        format!(
            "NRRD0004\ntype: {kind}\ndimension: 3\nsizes: {x} {y} {z}\nspacings: 1 1 2\nencoding: raw\nendian: little\n\n"
        )
    };
    let write = |name: &str, kind: &str, value: &dyn Fn([u32; 3]) -> Vec<u8>| {
        let voxels =
            (0..dims.iter().product()).map(|at| [at % dims[0], at / dims[0] % dims[1], at / dims[0] / dims[1]]);
        folder.write(name, [header(kind, dims).into_bytes(), voxels.flat_map(value).collect()].concat());
    };
    write("0.nrrd", "float", &|voxel| ball(0, voxel.map(|at| at / 2)).to_le_bytes().into());
    write("1.nrrd", "float", &|voxel| ball(1, voxel.map(|at| at / 2)).to_le_bytes().into());
    write("labels.nrrd", "uchar", &|[x, y, _]| vec![u8::from(x > 60) + 2 * u8::from(y > 60)]);
    folder.write("small.nrrd", [header("float", [100; 3]).into_bytes(), vec![7; 4_000_000]].concat());
    let scene = |second: &str, labels: &str| {
        format!(
            "camera = {{direction = [0.3, 1, -0.4], fit = 'volume'}}
            image = {{width = 70, height = 60}}
            splatting = {{opacity_threshold = 1, classification = 'after'}}
            [[channel]]
            volume = {{path = '0.nrrd', labels = '{labels}'}}
            transfer = {{opacity = [[0, 0], [40, 0], [200, 0.6]], color = [[0, [1, 0, 0]]], label = [
                {{label = 1, visible = false}}, {{label = 2, color = [[0, [1, 1, 0]]]}}]}}
            [[channel]]
            volume = {{path = '{second}'}}
            transfer = {{opacity = [[0, 0], [40, 0], [200, 0.6]], color = [[0, [0, 1, 0]]]}}\n"
        )
    };
    folder.write("scene.toml", scene("1.nrrd", "labels.nrrd"));
    let stats = assert_streamed_alike(&folder, "scene.toml --backend cpu", "9MiB");
    assert_eq!((stats["chunks_total"].clone(), stats["chunks_read"].clone()), (json!(24), json!(24)), "{stats}");
    let hidden = "scene.toml --backend cpu --set channel[0].visible=false";
    assert_eq!(assert_streamed_alike(&folder, hidden, "9MiB")["chunks_read"], json!(8));

    folder.write("grids.toml", scene("small.nrrd", "labels.nrrd"));
    folder.write("sizes.toml", scene("1.nrrd", "small.nrrd"));
    for (scene, words) in [
        ("grids.toml", "small.nrrd: channel[1].volume: found a grid of [100, 100, 100] voxels of [1, 1, 2], allowed: "),
        ("sizes.toml", "small.nrrd: labels: found a grid of [100, 100, 100] voxels of [1, 1, 2], allowed: "),
    ] {
        let run = format!("render {scene} --backend cpu --memory 8500KiB -o no.png");
        folder.run_with(&ONE_THREAD, "", &run).assert_failure(2, &[words, "[112, 104, 100]", "or more memory"]);
    }
}

/// A process that streams has no more in memory than its limit, beside what any process of the program has. The C library returns freed memory at once here,
/// because what it keeps for later is not the program's.
#[cfg(target_os = "linux")]
#[test]
fn memory_stays_within_the_limit() {
    let folder = Folder::new();
    let side = 256_u32;
    let value = |index: u32| {
        let at = [index % side, index / side % side, index / side / side].map(|n| f64::from(n) / f64::from(side) - 0.5);
        (400.0 * (0.5 - at.iter().map(|n| n * n).sum::<f64>().sqrt())).clamp(0.0, 250.0) as f32
    };
    folder.write("ball.raw", (0..side.pow(3)).flat_map(|index| value(index).to_le_bytes()).collect::<Vec<u8>>());
    let ball = "ball.raw --dims 256,256,256 --type float32 --endian little";
    let set = "--backend cpu --set image={width=96,height=96} --set camera.direction=[0,1,0] --set camera.fit=volume --set transfer.opacity=[[60,0],[80,1]] \
               --set transfer.color=[[0,[1,1,1]]]";
    let two = [("RAYON_NUM_THREADS", "2"), ("MALLOC_TRIM_THRESHOLD_", "65536")];
    let peak = |what: &str| {
        let run = folder.run_with(&two, "", &format!("bench {what} {set} --frames 1"));
        let report: Value = serde_json::from_str(&run.stdout).unwrap_or_else(|error| panic!("{error}: {}", run.stderr));
        report["peak_rss_mib"].as_f64().unwrap()
    };
    let base = peak("builtin:head:8");
    // The values take 64 MiB.
    for classification in ["before", "after"] {
        let set = format!("--set splatting.classification={classification}");
        let streamed = peak(&format!("{ball} {set} --memory 40MiB"));
        let whole = peak(&format!("{ball} {set}"));
        println!("{classification}: {base:.0} MiB without a volume, {streamed:.0} streamed, {whole:.0} in memory");
        // Eight more are for what does not grow with the volume, such as the sheets of the threads' tiles.
        assert!(streamed - base <= 48.0 && whole - base >= 64.0, "{base} {streamed} {whole}");
    }
    folder
        .run_with(&two, "", &format!("render {ball} {set} --memory 40MiB -o a.npy --stats stats.json"))
        .assert_success();
    let stats: Value = serde_json::from_slice(&folder.read("stats.json")).unwrap();
    assert!((base..base + 48.0).contains(&stats["peak_rss_mib"].as_f64().unwrap()), "{base} {stats}");
    folder.run(&format!("render builtin:head:8 {set} -o a.npy --stats stats.json")).assert_success();
    let stats: Value = serde_json::from_slice(&folder.read("stats.json")).unwrap();
    assert!(stats["peak_rss_mib"].is_null() && stats["sample_chunks_read"].is_null(), "{stats}");
}
