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
    // The builtin head is lit by sheets.
    let mut expected = [&STATS_KEYS[..], &["light_bytes", "light_ms"]].concat();
    expected.sort_unstable();
    assert_eq!(keys(&auto), expected);
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
    let least = if cfg!(target_arch = "aarch64") { "neon" } else { "sse2" };
    let (simplest, same) = drawn_with(&[("SHEETSPLAT_SIMD", least)]);
    assert_eq!((&best["backend"], &simplest["driver"]), (&"cpu".into(), &least.into()));
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

/// A machine without the loader: an empty file in its place cannot be opened.
#[cfg(target_os = "linux")]
#[test]
fn without_a_loader_the_first_command_draws() {
    let folder = Folder::new();
    fs::create_dir(folder.path("no-loader")).unwrap();
    for name in ["libvulkan.so.1", "libvulkan.so"] {
        folder.write(&format!("no-loader/{name}"), "");
    }
    let library = folder.path("no-loader").into_os_string().into_string().unwrap();
    let without_loader = |arguments: &str| {
        let environment = [("LD_LIBRARY_PATH", library.as_str())];
        let mut command = folder.command(arguments);
        command.env_remove("WGPU_ADAPTER_NAME").env_remove("SHEETSPLAT_BACKEND").env_remove("SHEETSPLAT_SIMD");
        let output = command.envs(environment).output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    // README's first command.
    let readme = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("README.md")).unwrap();
    let command = readme.lines().find_map(|line| line.strip_prefix("cargo run --release -- ")).unwrap();
    assert!(command.starts_with("render builtin:head -o head.png"), "{command}");
    let command = command.split('#').next().unwrap().trim_end();
    let (code, stderr) = without_loader(&format!("{command} --stats stats.json"));
    assert_eq!(code, Some(0), "{stderr}");
    let stats: Value = serde_json::from_slice(&folder.read("stats.json")).unwrap();
    assert_eq!(stats["backend"], "cpu", "{stats}");
    let picture = image::open(folder.path("head.png")).unwrap().to_rgba8();
    assert!(picture.pixels().filter(|pixel| pixel.0[0] > 60).count() > 20_000, "the head is in the picture");
    // With a driver whose loader is missing nothing else is found, either.
    let (code, stderr) = without_loader("render builtin:cube:8 -o none.png --backend gpu");
    assert!(code == Some(1) && stderr.contains("no GPU adapter"), "{stderr}");
}

/// A store that is read while it is drawn.
#[test]
fn instruction_sets_change_no_byte_of_a_stream() {
    let folder = Folder::new();
    let ball = crate::streaming::write_ball(&folder);
    let stated = "--set transfer.opacity=[[0,0],[60,0],[200,0.8]] --set camera.direction=[0.3,1,-0.4] \
                  --set camera.center=[0,0,0] --set camera.height=230 --set transfer.color=[[0,[1,0.9,0.8]]] --backend cpu";
    let levels = sheetsplat::cpu::Simd::available();
    assert!(levels.len() >= 2, "{levels:?}");
    for classification in ["before", "after"] {
        let render = format!(
            "render {ball} {stated} --set splatting.classification={classification} --memory 17MiB --stats stats.json"
        );
        for level in &levels {
            let environment = [("SHEETSPLAT_SIMD", level.name()), ("RAYON_NUM_THREADS", "2")];
            folder.run_with(&environment, "", &format!("{render} -o {}.npy", level.name())).assert_success();
            let stats = stats(&folder);
            assert_eq!((&stats["driver"], &stats["chunks_total"]), (&level.name().into(), &27.into()), "{stats}");
            let same =
                folder.read(&format!("{}.npy", level.name())) == folder.read(&format!("{}.npy", levels[0].name()));
            assert!(same, "{level:?}, {classification}");
        }
    }
}
