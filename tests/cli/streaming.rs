//! Volumes that are larger than `--memory`.

use serde_json::{Value, json};

use crate::*;

/// A file of bytes without a header, of a solid ball: 18 MiB as numbers of 4 bytes.
pub(crate) fn write_ball(folder: &Folder) -> &'static str {
    let [nx, ny, nz] = [192_u32, 160, 155];
    let value = |[x, y, z]: [u32; 3]| {
        let [x, y, z] = [(x, nx), (y, ny), (z, nz)].map(|(at, count)| f64::from(at) / f64::from(count - 1) - 0.5);
        (600.0 * (0.45 - (x * x + y * y + z * z).sqrt())).clamp(0.0, 250.0) as u8
    };
    let voxels = (0..nz).flat_map(|z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z])));
    folder.write("ball.raw", voxels.map(value).collect::<Vec<u8>>());
    "ball.raw --dims 192,160,155 --type uint8 --set splatting.classification=before --set image={width=120,height=90}"
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
    assert_eq!((of("sample_chunks_read"), of("sample_bytes_read")), (27, 192 * 160 * 155), "{stats}");

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
    folder
        .run(&format!("index {ball} -o ball.raw"))
        .assert_failure(2, &["--output: found ball.raw, which is also the input"]);
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
    run("--set splatting.compositing=average --backend reference -o no.png")
        .assert_failure(2, &["splatting.compositing: found \"average\" for a volume that is streamed by this backend"]);
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
    assert_eq!((info["dims"].clone(), info["type"].clone()), (json!([192, 160, 155]), json!("uint8")));
    assert_eq!((info["format"].clone(), info["sample"].clone()), (json!("raw"), json!([64, 54, 52])));
    assert!(info["max"].as_f64().unwrap() > 200.0, "{info}");
    // Parts of a store and of its values do not mix, as only the latter are known value by value.
    let mixed = "streamed-0.exr whole-1.exr whole-2.exr whole-3.exr whole-4.exr whole-5.exr";
    folder
        .run(&format!("merge {mixed} -o no.npy"))
        .assert_failure(2, &["whole-1.exr: scene: found ", ", as in streamed-0.exr"]);
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
        (400.0 * (0.5 - at.iter().map(|n| n * n).sum::<f64>().sqrt())).clamp(0.0, 250.0) as u8
    };
    folder.write("ball.raw", (0..side.pow(3)).map(value).collect::<Vec<u8>>());
    let ball = "ball.raw --dims 256,256,256 --type uint8";
    let set = "--backend cpu --set image={width=96,height=96} --set camera.fit=volume --set transfer.opacity=[[60,0],[80,1]] \
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
