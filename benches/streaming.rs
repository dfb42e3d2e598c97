//! Volumes that fit into no memory (SPEC §13): a ball of 2048³ `uint8` voxels in an OME-Zarr store, drawn with `--memory 2GiB`.
//!
//! `cargo bench --bench streaming -- [SIDE] FOLDER` makes the stores in a folder, unless they are there (for 2048 voxels it takes 4 GB), and draws each
//! whole process with either classification: seconds, chunks, and peak memory. Beside them stand the seconds that reading the same number of bytes takes, and those of a level that
//! fits into memory.

#![expect(clippy::unwrap_used, reason = "a bench")]

#[expect(dead_code, reason = "not every bench needs all of it")]
mod common;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use rayon::prelude::*;
use serde_json::{Value, json};

/// Voxels along a chunk's sides.
const CHUNK: usize = 64;
const LEVELS: usize = 4;

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
        "| volume | classification | seconds | chunks read | of | of those that the store holds | MB read | peak MiB |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for classification in ["before", "after"] {
        for (level, memory) in [(0, "2GiB"), (2, "16GiB")] {
            let run = draw(&store, level, memory, classification, &folder);
            let Run { seconds, stats, peak } = run;
            let of = |key: &str| stats[key].as_u64().map_or("–".to_owned(), |number| number.to_string());
            let held = count_files(&store.join(level.to_string()));
            let megabytes = stats["bytes_read"].as_u64().map_or(0, |bytes| bytes / 1_000_000);
            let dims = side >> level;
            println!(
                "| {dims}³, `--memory {memory}` | {classification} | {seconds:.1} | {} | {} | {held} | {megabytes} | {} |",
                of("chunks_read"),
                of("chunks_total"),
                peak >> 20
            );
            if stats["chunks_read"].is_u64() && level == 0 {
                let reading = read(&store.join("0"), stats["chunks_read"].as_u64().unwrap());
                println!("| | reading as many chunks alone | {reading:.1} | | | | | |");
            }
        }
    }
}

/// A process that drew.
struct Run {
    seconds: f64,
    stats: Value,
    /// The most bytes that it had in memory.
    peak: u64,
}

/// Draws a level by the program.
fn draw(store: &Path, level: usize, memory: &str, classification: &str, folder: &Path) -> Run {
    let (image, stats) = (folder.join(format!("{classification}-{level}.png")), folder.join("stats.json"));
    let start = Instant::now();
    let mut process = Command::new(env!("CARGO_BIN_EXE_sheetsplat"))
        .arg("render")
        .arg(store)
        .args(["--backend", "cpu", "--memory", memory, "--level", &level.to_string()])
        .args(["--set", "image={width=1024,height=1024}", "--set", "camera={direction=[1,0.4,-0.3],fit=\"volume\"}"])
        .args(["--set", "transfer={color=[[0,[0.2,0.1,0]],[255,[1,0.9,0.8]]],opacity=[[60,0],[100,1]]}"])
        .args(["--set", "splatting.compositing=exponential"])
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
    let array = json!({
        "zarr_format": 3, "node_type": "array", "shape": [side, side, side], "data_type": "uint8", "fill_value": 0,
        "chunk_grid": { "name": "regular", "configuration": { "chunk_shape": [CHUNK, CHUNK, CHUNK] } },
        "chunk_key_encoding": { "name": "default", "configuration": { "separator": "/" } },
        "codecs": [{ "name": "bytes" }], "dimension_names": ["z", "y", "x"],
    });
    fs::write(folder.join("zarr.json"), array.to_string()).unwrap();
    let across = side.div_ceil(CHUNK);
    (0..across * across).into_par_iter().for_each(|at| {
        let (z, y) = (at / across, at % across);
        for x in 0..across {
            let value = |at: usize| {
                let voxel = [x * CHUNK + at % CHUNK, y * CHUNK + at / CHUNK % CHUNK, z * CHUNK + at / (CHUNK * CHUNK)];
                ball(voxel.map(|index| (index as f64 + 0.5) / side as f64 - 0.5))
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

/// The value at a place of a volume of side 1 around 0.
fn ball([x, y, z]: [f64; 3]) -> u8 {
    let radius = (x * x + y * y + z * z).sqrt();
    let ripple = (x * RIPPLES).sin() * (y * RIPPLES).sin() * (z * RIPPLES).sin();
    if radius < RADIUS * (1.0 + 0.03 * ripple) { (160.0 + 80.0 * ripple) as u8 } else { 0 }
}
