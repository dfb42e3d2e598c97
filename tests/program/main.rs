//! The program as a user runs it: outputs, statistics, messages and exit codes. Needs a GPU or lavapipe.
#![expect(clippy::unwrap_used, reason = "tests")]

mod annotations;
mod backends;
mod bench;
mod channels;
#[expect(dead_code, reason = "not every program needs all of it")]
#[path = "../common/mod.rs"]
mod common;
mod compare;
mod errors;
mod extremes;
mod eyes;
mod files;
mod flags;
mod http;
mod info;
mod inputs;
mod levels;
mod light;
mod looks;
mod orbit;
mod outputs;
mod parts;
mod program;
mod provenance;
mod rasterizers;
mod schema;
#[path = "../common/http.rs"]
mod server;
mod statistics;
mod stores;
mod streaming;
mod sweep;
mod turned;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use glam::DVec3;
use serde_json::Value;

use common::adapter::adapter;
use common::compare::{assert_at_least, assert_at_most};
use common::images::{BLACK, psnr};
use common::shared::shared;

/// A camera that does not follow what is visible, so that one picture and many have the same framing.
const WHOLE: &str = "--set camera.fit=volume";

/// A temporary folder, which is also the program's current directory.
struct Folder(tempfile::TempDir);

/// The output of a run of the program.
struct Run {
    arguments: String,
    code: Option<i32>,
    stdout: String,
    stderr: String,
}

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        fs::write(self.path(name), bytes).unwrap();
    }

    fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap()
    }

    /// The names of the files and subfolders in the folder.
    fn names(&self) -> BTreeSet<String> {
        fs::read_dir(self.0.path()).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
    }

    /// An NRRD file of floats.
    fn write_nrrd(&self, name: &str, dims: [usize; 3], spacing: [f64; 3], values: &[f32]) {
        assert_eq!(values.len(), dims.iter().product::<usize>());
        let [nx, ny, nz] = dims;
        let [sx, sy, sz] = spacing;
        let header = format!(
            "NRRD0004\ntype: float\ndimension: 3\nsizes: {nx} {ny} {nz}\nspacings: {sx:e} {sy:e} {sz:e}\n\
             encoding: raw\nendian: little\n\n"
        );
        let bytes = values.iter().flat_map(|value| value.to_le_bytes());
        self.write(name, header.into_bytes().into_iter().chain(bytes).collect::<Vec<u8>>());
    }

    /// Runs the program with arguments separated by spaces.
    fn run(&self, arguments: &str) -> Run {
        self.run_in("", arguments)
    }

    fn run_in(&self, folder: &str, arguments: &str) -> Run {
        self.run_with(&[], folder, arguments)
    }

    /// With environment variables.
    fn run_with(&self, environment: &[(&str, &str)], folder: &str, arguments: &str) -> Run {
        let output = self.command(arguments).envs(environment.iter().copied()).current_dir(self.path(folder)).output();
        let output = output.unwrap();
        Run {
            arguments: arguments.to_owned(),
            code: output.status.code(),
            stdout: String::from_utf8(output.stdout).unwrap(),
            stderr: String::from_utf8(output.stderr).unwrap(),
        }
    }

    fn command(&self, arguments: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_sheetsplat"));
        command.env("WGPU_ADAPTER_NAME", adapter()).args(arguments.split(' ')).current_dir(&self.0);
        command
    }

    /// Renders and asserts success.
    fn render(&self, arguments: &str) {
        self.run(&format!("render {arguments}")).assert_success();
    }

    /// Renders into an NPY file and reads it: width, height, pixels.
    fn pixels(&self, arguments: &str) -> (usize, usize, Vec<[f32; 4]>) {
        self.render(&format!("{arguments} -o pixels.npy"));
        self.read_npy("pixels.npy")
    }

    fn read_npy(&self, name: &str) -> (usize, usize, Vec<[f32; 4]>) {
        let bytes = self.read(name);
        let file = npyz::NpyFile::new(bytes.as_slice()).unwrap();
        let [height, width, 4] = *file.shape() else { panic!("shape {:?}", file.shape()) };
        assert_eq!(file.order(), npyz::Order::C);
        let channels: Vec<f32> = file.into_vec().unwrap();
        (width as usize, height as usize, channels.as_chunks().0.to_vec())
    }

    fn stats(&self, arguments: &str) -> Value {
        self.render(&format!("{arguments} -o stats.npy --stats stats.json"));
        serde_json::from_slice(&self.read("stats.json")).unwrap()
    }
}

impl Run {
    fn assert_success(&self) {
        assert_eq!(self.code, Some(0), "{}\n{}", self.arguments, self.stderr);
        assert_eq!(self.stdout, "", "{}", self.arguments);
    }

    /// Asserts a failure whose message, only on standard error, contains all of `words` in any order.
    fn assert_failure(&self, code: i32, words: &[&str]) {
        let Self { arguments, stderr, .. } = self;
        assert!(!stderr.contains("panicked"), "{arguments}\n{stderr}");
        assert_eq!(self.code, Some(code), "{arguments}\n{stderr}");
        assert_eq!(self.stdout, "", "{arguments}");
        for word in words {
            assert!(stderr.contains(word), "{arguments}: no {word:?} in\n{stderr}");
        }
    }
}

/// A small picture with everything between transparent and opaque in it.
const SMALL: &str = "builtin:marschner-lobb:12 --set image.width=27 --set image.height=20 \
                     --set transfer.opacity=[[60,0],[200,0.6]] --set camera.direction=[0.3,0.9,-0.2]";

/// Each of the rasterizers, whatever `auto` would choose.
const QUADS: &str = "--set splatting.rasterizer=quads";
const TILES: &str = "--set splatting.rasterizer=tiles";
const RASTERIZERS: [&str; 2] = [QUADS, TILES];

/// Whatever draws, beside the reference backend.
const DRAWINGS: [&str; 3] = [QUADS, TILES, "--backend cpu"];

/// The reference backend culls nothing.
const UNCULLED: &str = "--set splatting.culling=false";

const TRANSPARENT: &str = "--set image.background=[0.2,0.4,0.6,0.25]";
