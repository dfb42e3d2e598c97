//! What draws: `--backend`, `SHEETSPLAT_BACKEND`, `SHEETSPLAT_SIMD`, and a machine without any driver.

use crate::statistics::{STATS_KEYS, keys};
use crate::*;

const HEAD: &str = "builtin:head:24 --set image.width=60 --set image.height=50";

/// Runs the program where no adapter is named, and no Vulkan driver is found.
fn run_without_driver(folder: &Folder, environment: &[(&str, &str)], arguments: &str) -> Run {
    let mut command = folder.command(arguments);
    command.env_remove("WGPU_ADAPTER_NAME").env_remove("SHEETSPLAT_BACKEND").env_remove("SHEETSPLAT_SIMD");
    for variable in ["VK_ICD_FILENAMES", "VK_DRIVER_FILES"] {
        command.env(variable, "/nonexistent/driver.json");
    }
    let output = command.envs(environment.iter().copied()).output().unwrap();
    Run {
        arguments: arguments.to_owned(),
        code: output.status.code(),
        stdout: String::from_utf8(output.stdout).unwrap(),
        stderr: String::from_utf8(output.stderr).unwrap(),
    }
}

fn stats(folder: &Folder) -> Value {
    serde_json::from_slice(&folder.read("stats.json")).unwrap()
}

#[test]
fn without_a_driver_the_cpu_draws() {
    let folder = Folder::new();
    let render = format!("render {HEAD} -o auto.npy --stats stats.json");
    run_without_driver(&folder, &[], &render).assert_success();
    let auto = stats(&folder);
    assert_eq!((&auto["backend"], &auto["rasterizer"], &auto["api"]), (&"cpu".into(), &"cpu".into(), &"none".into()));
    assert_eq!(keys(&auto), STATS_KEYS);
    // The same bytes, whoever asks for them.
    for arguments in
        [format!("render {HEAD} -o cpu.npy --backend cpu"), format!("render {HEAD} -o cpu.npy --backend auto")]
    {
        run_without_driver(&folder, &[], &arguments).assert_success();
        assert_eq!(folder.read("auto.npy"), folder.read("cpu.npy"), "{arguments}");
    }
    // Whatever adapter the environment names.
    folder.run(&format!("render {HEAD} -o cpu.npy --backend cpu")).assert_success();
    assert_eq!(folder.read("auto.npy"), folder.read("cpu.npy"));
    // An adapter or a rasterizer that is named means the GPU, and there is none.
    for named in ["--adapter radeon", "--set splatting.rasterizer=tiles", "--backend gpu", "--profile"] {
        let run = run_without_driver(&folder, &[], &format!("render {HEAD} -o none.npy {named}"));
        assert_eq!(run.code, Some(1), "{named}: {}", run.stderr);
        assert!(run.stderr.contains("no GPU adapter"), "{named}: {}", run.stderr);
    }
    assert!(!folder.names().contains("none.npy"));
}

#[test]
fn every_subcommand_takes_a_backend() {
    let folder = Folder::new();
    for backend in ["cpu", "reference"] {
        let bench =
            run_without_driver(&folder, &[], &format!("bench {HEAD} --frames 2 --rotate 5 --backend {backend}"));
        assert_eq!(bench.code, Some(0), "{}", bench.stderr);
        let report: Value = serde_json::from_str(&bench.stdout).unwrap();
        assert_eq!(report["backend"], backend, "{report:#}");
        run_without_driver(&folder, &[], &format!("orbit {HEAD} --count 2 -o {backend}-%d.png --backend {backend}"))
            .assert_success();
        let sweep = format!("sweep {HEAD} -o {backend}.png --set splatting.radius=1.5,2 --backend {backend}");
        run_without_driver(&folder, &[], &sweep).assert_success();
    }
    let names = folder.names();
    for name in ["cpu-0.png", "cpu-1.png", "cpu.png", "reference-0.png", "reference-1.png", "reference.png"] {
        assert!(names.contains(name), "no {name} in {names:?}");
    }
}

#[test]
fn the_environment_chooses() {
    let folder = Folder::new();
    let render = format!("render {HEAD} -o out.npy --stats stats.json");
    let drawn_with = |environment: &[(&str, &str)]| {
        run_without_driver(&folder, environment, &render).assert_success();
        (stats(&folder), folder.read("out.npy"))
    };
    let (reference, _) = drawn_with(&[("SHEETSPLAT_BACKEND", "reference")]);
    assert_eq!(reference["backend"], "reference");
    let (best, image) = drawn_with(&[("SHEETSPLAT_BACKEND", "cpu")]);
    let (scalar, same) = drawn_with(&[("SHEETSPLAT_SIMD", "scalar")]);
    assert_eq!((&best["backend"], &scalar["driver"]), (&"cpu".into(), &"scalar".into()));
    assert_eq!(image, same);
    for (variable, value) in
        [("SHEETSPLAT_BACKEND", "cuda"), ("SHEETSPLAT_SIMD", "mmx"), ("SHEETSPLAT_SIMD", missing())]
    {
        let run = run_without_driver(&folder, &[(variable, value)], &render);
        assert_eq!(run.code, Some(2), "{variable}: {}", run.stderr);
        assert!(run.stderr.contains(value), "{variable}: {}", run.stderr);
    }
}

/// An instruction set that no machine of this kind has.
fn missing() -> &'static str {
    if cfg!(target_arch = "aarch64") { "avx2" } else { "neon" }
}

#[test]
fn what_a_backend_does_not_draw_is_named() {
    let folder = Folder::new();
    let economy = format!("render {HEAD} -o out.png --backend cpu --set splatting.experimental.beta=0.9");
    let run = folder.run(&economy);
    assert_eq!(run.code, Some(2), "{}", run.stderr);
    ["splatting.experimental.beta", "\"cpu\""]
        .iter()
        .for_each(|word| assert!(run.stderr.contains(word), "{}", run.stderr));
}
