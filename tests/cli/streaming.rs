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
    run("orbit", "-o NAME-#.npy --count 3 --frames 1..3");
    assert_same(&["-1.npy", "-2.npy"]);
    run("sweep", "-o NAME.npy --set splatting.slab_width=1,2");
    assert_same(&[".npy"]);

    let split = folder.run_with(&two, "", &format!("split {ball} {stated} -n 6 --memory 17MiB"));
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
