//! Volumes that fit into no memory (SPEC §13): a ball of 2048³ `uint8` voxels in an OME-Zarr store, drawn with `--memory 2GiB`, a quarter of its bytes, and the
//! volumes of scene files in chunks of 32³ and of 16³ voxels.
//!
//! `cargo bench --bench streaming -- [SIDE] FOLDER [SCENE…]` makes the stores in a folder, unless they are there (for 2048 voxels it takes 4 GB), and draws each
//! by a whole process with either backend and classification: seconds, chunks, and peak memory. Beside them stand the seconds that reading the same number of bytes takes,
//! those of a level that fits into memory, and those of a scene's own volume in memory.

#![expect(clippy::unwrap_used, reason = "a bench")]

#[expect(dead_code, reason = "not every bench needs all of it")]
mod common;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use glam::UVec3;
use rayon::prelude::*;
use serde_json::{Value, json};
use sheetsplat::Volume;
use sheetsplat::volume::{IndexedStore, ReadOptions, Store, StoreIndex, open_store};

/// Voxels along a chunk's sides.
const CHUNK: usize = 64;
/// Those of a scene's volume, which is drawn in chunks of either size.
const CHUNKS_OF_SCENE: [usize; 2] = [32, 16];
const LEVELS: usize = 4;

/// The backends, each with a classification.
type How = [&'static str; 2];
const HOW: [How; 4] = [["cpu", "before"], ["cpu", "after"], ["gpu", "before"], ["gpu", "after"]];

/// The ball's radius for a volume of side 1, and its ripples: along the radius, so that it is opaque from everywhere, with a surface that is not smooth.
const RADIUS: f64 = 0.42;
const RIPPLES: f64 = 40.0;

fn main() {
    let (side, folders) = common::arguments(2048);
    let folder = PathBuf::from(folders.first().map_or("streaming", |folder| folder));
    let store = folder.join(format!("ball-{side}.ome.zarr"));
    if !store.exists() {
        let start = Instant::now();
        make_store(&store, side);
        println!("{} made in {:.0} s\n", store.display(), start.elapsed().as_secs_f64());
    }
    println!(
        "| volume | backend | classification | seconds | chunks read | of | of those with visible values | MB read | peak MiB |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    let memory = format!("{}MiB", (side.pow(3) / 4) >> 20);
    for how in HOW {
        for (level, memory) in [(0, memory.as_str()), (2, "16GiB")] {
            let name = format!("{}³, `--memory {memory}`", side >> level);
            let level_of = level.to_string();
            let run = draw(&store, &["--memory", memory, "--level", &level_of], &ball_sets(), how, &folder);
            // Every chunk that the store holds is of the ball.
            print_row(&name, how, &run, count_files(&store.join(&level_of)));
            if level == 0 {
                let reading = read(&store.join("0"), run.stats["chunks_read"].as_u64().unwrap());
                println!("| | | reading as many chunks alone | {reading:.1} | | | | | |");
            }
        }
    }
    for scene in folders.iter().skip(1) {
        CHUNKS_OF_SCENE.into_iter().for_each(|chunk| draw_scene(scene, chunk, &folder));
    }
}

/// Draws a scene's volume in memory, and streamed from a store with an index.
fn draw_scene(name: &str, chunk: usize, folder: &Path) {
    let scene = common::open(name);
    let volume = scene.load_volume().unwrap();
    let label = common::label(name);
    let store = folder.join(format!("{label}-{chunk}.zarr"));
    if !store.exists() {
        make_plain(&store, &volume, chunk);
    }
    let index = folder.join(format!("{label}-{chunk}.index"));
    let mut process = Command::new(env!("CARGO_BIN_EXE_sheetsplat"));
    assert!(process.arg("index").arg(&store).arg("-o").arg(&index).status().unwrap().success());
    let indexed = {
        let store = open_store(&store, &ReadOptions::default()).unwrap();
        let text = fs::read_to_string(&index).unwrap();
        IndexedStore::new(store, StoreIndex::decode("index", &text).unwrap(), "index").unwrap()
    };
    let opacity = scene.channels[0].transfer.opacity.clone().unwrap();
    let across = indexed.levels()[0].chunks();
    let is_visible = |at: &u32| {
        let chunk = UVec3::new(at % across.x, at / across.x % across.y, at / (across.x * across.y));
        let [min, max] = indexed.chunk_range(0, chunk).unwrap().map(f64::from);
        (0..=256).any(|step| opacity.at(min + (max - min) * f64::from(step) / 256.0) > 0.0)
    };
    let visible = (0..across.element_product()).filter(is_visible).count();
    // Three quarters of the values as f32, in which chunks are held.
    let memory = format!("{}B", 3 * volume.values().len());
    let path = format!("volume.path={:?}", store.canonicalize().unwrap().display().to_string());
    let sets = ["splatting.compositing=exponential".to_owned(), "camera.fit=volume".to_owned()];
    let streamed = [sets.as_slice(), &[path]].concat();
    for how in HOW {
        let whole = draw(Path::new(name), &[], &sets, how, folder);
        print_row(&format!("{label} in memory"), how, &whole, visible);
        let index = index.display().to_string();
        let arguments = ["--memory", &memory, "--index", &index];
        let run = draw(Path::new(name), &arguments, &streamed, how, folder);
        print_row(&format!("{label} in chunks of {chunk}³"), how, &run, visible);
    }
}

fn print_row(name: &str, [backend, classification]: How, run: &Run, visible: usize) {
    let Run { seconds, stats, peak } = run;
    let of = |key: &str| stats[key].as_u64().map_or("–".to_owned(), |number| number.to_string());
    let megabytes = stats["bytes_read"].as_u64().map_or(0, |bytes| bytes / 1_000_000);
    let [read, total] = ["chunks_read", "chunks_total"].map(of);
    println!(
        "| {name} | {backend} | {classification} | {seconds:.1} | {read} | {total} | {visible} | {megabytes} | {} |",
        peak >> 20
    );
}

/// How the ball is drawn.
fn ball_sets() -> Vec<String> {
    [
        "image={width=1024,height=1024}",
        "camera={direction=[1,0.4,-0.3],fit=\"volume\"}",
        "transfer={color=[[0,[0.2,0.1,0]],[255,[1,0.9,0.8]]],opacity=[[60,0],[100,1]]}",
        "splatting.compositing=exponential",
    ]
    .map(str::to_owned)
    .to_vec()
}

/// A process that drew.
struct Run {
    seconds: f64,
    stats: Value,
    /// The most bytes that it had in memory.
    peak: u64,
}

/// Draws an input by the program.
fn draw(input: &Path, arguments: &[&str], sets: &[String], [backend, classification]: How, folder: &Path) -> Run {
    let (image, stats) = (folder.join(format!("{backend}-{classification}.png")), folder.join("stats.json"));
    let start = Instant::now();
    let sets = sets.iter().flat_map(|set| ["--set", set]);
    let mut process = Command::new(env!("CARGO_BIN_EXE_sheetsplat"))
        .arg("render")
        .arg(input)
        .args(["--backend", backend])
        .args(arguments)
        .args(sets)
        .args(["--set", &format!("splatting.classification={classification}")])
        .arg("-o")
        .arg(image)
        .arg("--stats")
        .arg(&stats)
        .spawn()
        .unwrap();
    let mut peak = 0;
    let status = loop {
        peak = peak.max(memory_of(process.id()));
        match process.try_wait().unwrap() {
            Some(status) => break status,
            None => std::thread::sleep(Duration::from_millis(5)),
        }
    };
    assert!(status.success());
    let seconds = start.elapsed().as_secs_f64();
    Run { seconds, stats: serde_json::from_slice(&fs::read(stats).unwrap()).unwrap(), peak }
}

/// The most bytes that a process has had in memory until now.
fn memory_of(process: u32) -> u64 {
    let status = fs::read_to_string(format!("/proc/{process}/status")).unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|line| line.trim().trim_end_matches(" kB").parse::<u64>().ok()).map_or(0, |kilobytes| kilobytes << 10)
}

/// The seconds that reading a number of chunk files takes.
fn read(level: &Path, count: u64) -> f64 {
    let files = files(level);
    let start = Instant::now();
    let bytes: usize = files.par_iter().take(count as usize).map(|file| fs::read(file).unwrap().len()).sum();
    assert!(bytes > 0);
    start.elapsed().as_secs_f64()
}

fn count_files(level: &Path) -> usize {
    files(level).len()
}

/// The chunks that a level holds.
fn files(level: &Path) -> Vec<PathBuf> {
    let folders = |folder: &Path| fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect::<Vec<_>>();
    let planes = folders(&level.join("c"));
    planes.iter().flat_map(|plane| folders(plane)).flat_map(|row| folders(&row)).collect()
}

/// Writes an OME-Zarr 0.5 store of uncompressed chunks; those without any part of the ball are left out.
fn make_store(store: &Path, side: usize) {
    fs::create_dir_all(store).unwrap();
    let axes = ["z", "y", "x"].map(|name| json!({ "name": name, "type": "space", "unit": "micrometer" }));
    let scale = |level: usize| vec![(1_usize << level) as f64; 3];
    let datasets: Vec<Value> = (0..LEVELS)
        .map(|level| {
            let shift = vec![((1_usize << level) as f64 - 1.0) / 2.0; 3];
            json!({ "path": level.to_string(), "coordinateTransformations": [
                { "type": "scale", "scale": scale(level) }, { "type": "translation", "translation": shift }] })
        })
        .collect();
    let multiscales = json!([{ "name": "ball", "axes": axes, "datasets": datasets }]);
    let ome = json!({ "version": "0.5", "multiscales": multiscales });
    let group = json!({ "zarr_format": 3, "node_type": "group", "attributes": { "ome": ome } });
    fs::write(store.join("zarr.json"), group.to_string()).unwrap();
    for level in 0..LEVELS {
        make_level(&store.join(level.to_string()), side >> level);
    }
}

fn make_level(folder: &Path, side: usize) {
    fs::create_dir_all(folder).unwrap();
    let array = metadata([side; 3], "uint8", CHUNK, &json!({}));
    fs::write(folder.join("zarr.json"), array.to_string()).unwrap();
    let across = side.div_ceil(CHUNK);
    let places: Vec<f64> = (0..side).map(|index| (index as f64 + 0.5) / side as f64 - 0.5).collect();
    // The place and the ripple's factor of every voxel along an axis.
    let waves: Vec<(f64, f64)> = places.into_iter().map(|at| (at, (at * RIPPLES).sin())).collect();
    (0..across * across).into_par_iter().for_each(|at| {
        let (z, y) = (at / across, at % across);
        for x in 0..across {
            let value = |at: usize| {
                let voxel = [x * CHUNK + at % CHUNK, y * CHUNK + at / CHUNK % CHUNK, z * CHUNK + at / (CHUNK * CHUNK)];
                ball(voxel.map(|index| waves[index]))
            };
            let values: Vec<u8> = (0..CHUNK * CHUNK * CHUNK).map(value).collect();
            if values.iter().any(|&value| value > 0) {
                let row = folder.join(format!("c/{z}/{y}"));
                fs::create_dir_all(&row).unwrap();
                fs::write(row.join(x.to_string()), values).unwrap();
            }
        }
    });
}

/// Writes the values of a volume as an OME-Zarr store of one level.
fn make_plain(store: &Path, volume: &Volume, side: usize) {
    let [nx, ny, nz] = volume.dims().to_array().map(|n| n as usize);
    let [x, y, z] = volume.spacing().to_array();
    let axes = ["z", "y", "x"].map(|name| json!({ "name": name, "type": "space" }));
    let transformations = json!([{ "type": "scale", "scale": [z, y, x] }]);
    let datasets = json!([{ "path": "0", "coordinateTransformations": transformations }]);
    let ome = json!({ "version": "0.5", "multiscales": [{ "axes": axes, "datasets": datasets }] });
    let group = json!({ "zarr_format": 3, "node_type": "group", "attributes": { "ome": ome } });
    let array = metadata([nz, ny, nx], "float32", side, &json!({ "endian": "little" }));
    let chunks = [nx, ny, nz].map(|n| n.div_ceil(side));
    fs::create_dir_all(store.join("0")).unwrap();
    fs::write(store.join("zarr.json"), group.to_string()).unwrap();
    fs::write(store.join("0/zarr.json"), array.to_string()).unwrap();
    for at in 0..chunks.iter().product() {
        let [i, j, k] = [at % chunks[0], at / chunks[0] % chunks[1], at / (chunks[0] * chunks[1])];
        let values = (0..side.pow(3)).map(|at| {
            let [x, y, z] = [i * side + at % side, j * side + at / side % side, k * side + at / (side * side)];
            // Chunks at the end are whole in the file.
            if x < nx && y < ny && z < nz { volume.values().at(x + nx * (y + ny * z)) } else { 0.0 }
        });
        let row = store.join(format!("0/c/{k}/{j}"));
        fs::create_dir_all(&row).unwrap();
        fs::write(row.join(i.to_string()), values.flat_map(f32::to_le_bytes).collect::<Vec<u8>>()).unwrap();
    }
}

/// The metadata of an array of uncompressed chunks.
fn metadata(shape: [usize; 3], data_type: &str, chunk: usize, bytes: &Value) -> Value {
    json!({
        "zarr_format": 3, "node_type": "array", "shape": shape, "data_type": data_type, "fill_value": 0,
        "chunk_grid": { "name": "regular", "configuration": { "chunk_shape": [chunk, chunk, chunk] } },
        "chunk_key_encoding": { "name": "default", "configuration": { "separator": "/" } },
        "codecs": [{ "name": "bytes", "configuration": bytes }], "dimension_names": ["z", "y", "x"],
    })
}

/// The value at a place of a volume of side 1 around 0, given with the ripple's factors.
fn ball([(x, a), (y, b), (z, c)]: [(f64, f64); 3]) -> u8 {
    let radius = (x * x + y * y + z * z).sqrt();
    let ripple = a * b * c;
    if radius < RADIUS * (1.0 + 0.03 * ripple) { (160.0 + 80.0 * ripple) as u8 } else { 0 }
}
