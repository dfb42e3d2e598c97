//! The files that a run writes: never one that it reads, whole or not at all, and no others.
#![cfg(unix)]

use std::fs::{File, OpenOptions, Permissions};
use std::io::Read;
use std::net::Shutdown;
use std::os::fd::OwnedFd;
use std::os::unix::fs::{FileTypeExt, MetadataExt, PermissionsExt, symlink};
use std::os::unix::net::{UnixListener, UnixStream};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Child, ExitStatus};
use std::thread;
use std::time::Duration;

use sheetsplat::image::{Image, PngDepth};

use crate::*;

/// An adapter that does not exist, with which the first step that needs a device fails: earlier errors come before it.
const NO_DEVICE: &str = "--adapter Voodoo";

/// A folder with files of every kind that a run may read.
fn with_inputs() -> Folder {
    let folder = Folder::new();
    folder.write_nrrd("a.nrrd", [2, 2, 2], [1.0, 1.0, 1.0], &[0.0, 1.0, 2.0, 3.0, 3.0, 3.0, 0.0, 0.0]);
    let header = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nencoding: raw\ndata file: nrrd.raw\n";
    folder.write("a.nhdr", header);
    folder.write("nrrd.raw", [0, 1, 2, 3, 4, 5, 6, 7]);
    let header = "NDims = 3\nDimSize = 2 2 2\nElementType = MET_UCHAR\nElementDataFile = meta.raw\n";
    folder.write("a.mhd", header);
    folder.write("meta.raw", [0, 1, 2, 3, 4, 5, 6, 7]);
    let array = b"\x93NUMPY\x01\x00\x46\x00{'descr': '|u1', 'fortran_order': False, 'shape': (2, 2, 2)}";
    let padding = [vec![b' '; 70 - (array.len() - 10) - 1], b"\n".to_vec()].concat();
    for name in ["a.npy", "a-1.npy"] {
        folder.write(name, [array.as_slice(), &padding, &[0, 1, 2, 3, 4, 5, 6, 7]].concat());
    }
    folder.write("scene.toml", "[volume]\npath = \"a.nrrd\"\nlabels = \"labels.nrrd\"\n");
    fs::copy(folder.path("a.nrrd"), folder.path("labels.nrrd")).unwrap();
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures");
    for series in ["slices", "series"] {
        fs::create_dir(folder.path(series)).unwrap();
        for entry in fs::read_dir(fixtures.join(series)).unwrap() {
            let path = entry.unwrap().path();
            fs::copy(&path, folder.path(series).join(path.file_name().unwrap())).unwrap();
        }
    }
    for name in ["pair.hdr", "pair.img"] {
        fs::copy(fixtures.join(name), folder.path(name)).unwrap();
    }
    let image = Image { width: 2, height: 2, pixels: vec![[0.5, 0.25, 0.125, 1.0]; 4] };
    image.save(&folder.path("image.png"), PngDepth::Eight).unwrap();
    symlink(".", folder.path("here")).unwrap();
    folder
}

/// Asserts that a run is refused because of a file, which stays unchanged.
fn assert_refused(folder: &Folder, arguments: &str, words: &[&str], kept: &str) {
    let (before, names) = (folder.read(kept), folder.names());
    folder.run(arguments).assert_failure(2, &[words, &["allowed: another file"]].concat());
    assert_eq!(folder.read(kept), before, "{arguments}: {kept}");
    assert_eq!(folder.names(), names, "{arguments}: files");
}

#[test]
fn no_output_is_an_input() {
    let folder = with_inputs();
    for (arguments, option, input) in [
        ("render a.npy -o a.npy", "--output", "a.npy"),
        ("render a.npy -o here/here/a.npy", "--output", "a.npy"),
        ("render a.nrrd -o a.png --stats here/a.nrrd", "--stats", "a.nrrd"),
        ("render scene.toml -o a.png --save-scene scene.toml", "--save-scene", "scene.toml"),
        ("render scene.toml -o a.png --stats a.nrrd", "--stats", "a.nrrd"),
        ("render scene.toml -o a.png --stats labels.nrrd", "--stats", "labels.nrrd"),
        ("render a.nrrd -o a.png --set volume.labels=labels.nrrd --stats labels.nrrd", "--stats", "labels.nrrd"),
        ("render a.nhdr -o a.png --stats a.nhdr", "--stats", "a.nhdr"),
        ("render a.nhdr -o a.png --stats nrrd.raw", "--stats", "nrrd.raw"),
        ("render a.mhd -o a.png --stats meta.raw", "--stats", "meta.raw"),
        ("render pair.hdr -o a.png --stats pair.img", "--stats", "pair.img"),
        ("render pair.img -o a.png --stats pair.hdr", "--stats", "pair.hdr"),
        ("render meta.raw --dims 2,2,2 --type uint8 -o a.png --stats meta.raw", "--stats", "meta.raw"),
        ("render slices -o a.png --stats slices/z9.tif", "--stats", "slices/z9.tif"),
        ("render series -o a.png --stats series/IM1", "--stats", "series/IM1"),
        ("orbit a-1.npy -o a-%d.npy --overwrite", "--output", "a-1.npy"),
        ("orbit a-1.npy -o a-%d.npy", "--output", "a-1.npy"),
        ("sweep a.npy -o a.npy --set splatting.slab_width=1,2", "--output", "a.npy"),
        ("sweep a.nrrd -o a.npy --set volume.path=a.nrrd,a.npy", "--output", "a.npy"),
    ] {
        assert_refused(&folder, &format!("{arguments} {NO_DEVICE}"), &[option, "the input", input], input);
    }
    for (file, input) in [
        ("a.nhdr", "a.nhdr"),
        ("a.nhdr", "nrrd.raw"),
        ("a.mhd", "here/meta.raw"),
        ("a.npy", "a.npy"),
        ("pair.hdr", "pair.img"),
        ("pair.img", "pair.hdr"),
    ] {
        assert_refused(&folder, &format!("index {file} -o {input}"), &["--output", "the input"], input);
    }
    assert_refused(&folder, "compare image.png image.png --difference here/image.png", &["--difference"], "image.png");
    // Other files beside the slices may be written.
    folder.render("series -o series/a.png --set image={width=8,height=8}");
    folder.render("series -o series/a.png --set image={width=8,height=8}");
}

#[test]
fn an_input_by_another_name_is_no_output() {
    let folder = with_inputs();
    fs::hard_link(folder.path("a.nrrd"), folder.path("hard.gif")).unwrap();
    fs::hard_link(folder.path("nrrd.raw"), folder.path("hard.png")).unwrap();
    symlink("here/a.nrrd", folder.path("soft.apng")).unwrap();
    symlink("image.png", folder.path("soft.png")).unwrap();
    for (arguments, kept) in [
        ("orbit a.nrrd -o hard.gif", "a.nrrd"),
        ("orbit here/a.nrrd -o soft.apng", "a.nrrd"),
        ("orbit scene.toml -o hard.gif", "a.nrrd"),
        ("render a.nhdr -o hard.png", "nrrd.raw"),
    ] {
        assert_refused(&folder, &format!("{arguments} {NO_DEVICE}"), &["--output", "the input"], kept);
    }
    // The header of a later tile's volume names the file.
    let sweep = format!("sweep a.nrrd -o hard.png --set volume.path=a.nrrd,a.nhdr {NO_DEVICE}");
    assert_refused(&folder, &sweep, &["--output", "the input"], "nrrd.raw");
    assert_refused(&folder, "compare image.png image.png --difference soft.png", &["--difference"], "image.png");
}

/// Whatever lies in a store's folder is an input, also what is not there yet.
#[test]
fn no_output_lies_in_a_store() {
    let folder = Folder::new();
    fs::create_dir_all(folder.path("v.zarr/0")).unwrap();
    let multiscales = r#"{"multiscales": [{"version": "0.4", "datasets": [{"path": "0", "coordinateTransformations": [{"type": "scale",
        "scale": [1, 1, 1]}]}], "axes": [{"name": "z", "type": "space"}, {"name": "y", "type": "space"}, {"name": "x", "type": "space"}]}]}"#;
    let array = r#"{"zarr_format": 2, "shape": [4, 2, 2], "chunks": [2, 2, 2], "dtype": "|u1", "compressor": null, "fill_value": 0,
        "order": "C", "filters": null}"#;
    folder.write("v.zarr/.zgroup", r#"{"zarr_format": 2}"#);
    folder.write("v.zarr/.zattrs", multiscales);
    folder.write("v.zarr/0/.zarray", array);
    folder.write("v.zarr/0/0.0.0", [1, 2, 3, 4, 5, 6, 7, 8]);
    folder.write("notes", "kept");
    symlink("v.zarr", folder.path("soft.zarr")).unwrap();
    symlink("v.zarr/0/0.0.0", folder.path("soft")).unwrap();
    symlink("../../notes", folder.path("v.zarr/0/notes")).unwrap();
    fs::hard_link(folder.path("v.zarr/0/0.0.0"), folder.path("hard")).unwrap();
    fs::hard_link(folder.path("v.zarr/.zattrs"), folder.path("attributes")).unwrap();
    let kept = ["v.zarr/.zgroup", "v.zarr/.zattrs", "v.zarr/0/.zarray", "v.zarr/0/0.0.0", "notes"];
    for output in
        kept.into_iter().chain(["soft", "hard", "attributes", "v.zarr/0/notes", "v.zarr/0/1.0.0", "v.zarr/new"])
    {
        for store in ["v.zarr", "soft.zarr"] {
            let before = kept.map(|name| folder.read(name));
            for arguments in [
                format!("index {store} -o {output}"),
                format!("render {store} -o a.png --stats {output} {NO_DEVICE}"),
                format!("render {store} -o a.png --save-scene s.toml --stats {output} {NO_DEVICE}"),
            ] {
                let words = ["the input that --", output, "would replace", "allowed: another file"];
                folder.run(&arguments).assert_failure(2, &words);
                assert_eq!(kept.map(|name| folder.read(name)), before, "{arguments}");
                let is_new = |name: &str| folder.path(name).exists();
                assert!(!is_new("v.zarr/0/1.0.0") && !is_new("v.zarr/new") && !is_new("a.png"), "{arguments}");
            }
        }
    }
    folder.run("index v.zarr -o v.index").assert_success();
}

#[test]
fn two_outputs_are_two_files() {
    let folder = with_inputs();
    folder.write("old.png", "old");
    symlink("old.png", folder.path("soft")).unwrap();
    symlink("new.png", folder.path("dangling")).unwrap();
    for arguments in ["-o old.png --stats soft", "-o old.png --stats here/old.png", "-o new.png --stats dangling"] {
        let words = ["--stats", "the same file as --output"];
        assert_refused(&folder, &format!("render a.nrrd {arguments} {NO_DEVICE}"), &words, "old.png");
    }
    let twice = "-o old.png --stats s.toml --save-scene here/s.toml";
    let words = ["--save-scene", "s.toml", "the same file as --stats"];
    assert_refused(&folder, &format!("render a.nrrd {twice} {NO_DEVICE}"), &words, "old.png");
    let frames = "orbit a.nrrd -o soft-%d.png --count 2 --overwrite";
    symlink("soft-1.png", folder.path("soft-0.png")).unwrap();
    assert_refused(&folder, &format!("{frames} {NO_DEVICE}"), &["--output", "soft-1.png"], "old.png");
}

/// Runs with standard output appended to a file.
fn run_into(folder: &Folder, file: &str, arguments: &str) -> (Option<i32>, String) {
    let file = OpenOptions::new().append(true).create(true).open(folder.path(file)).unwrap();
    let output = folder.command(arguments).stdout(file).output().unwrap();
    (output.status.code(), String::from_utf8(output.stderr).unwrap())
}

#[test]
fn standard_output_is_an_output() {
    let folder = with_inputs();
    for (arguments, input) in [
        (format!("info a.nrrd {NO_DEVICE}"), "a.nrrd"),
        (format!("bench scene.toml {NO_DEVICE}"), "labels.nrrd"),
        ("orbit a.nhdr -o -".to_owned(), "nrrd.raw"),
        (format!("render a.nrrd -o a.png --profile {NO_DEVICE}"), "a.nrrd"),
        (format!("render a.nrrd -o image.png --profile {NO_DEVICE}"), "image.png"),
        ("compare image.png image.png".to_owned(), "image.png"),
    ] {
        let (before, names) = (folder.read(input), folder.names());
        let (code, stderr) = run_into(&folder, input, &arguments);
        assert_eq!(code, Some(2), "{arguments}: {stderr}");
        assert!(stderr.contains("standard output") && stderr.contains(input), "{arguments}: {stderr}");
        assert_eq!(folder.read(input), before, "{arguments}");
        assert_eq!(folder.names(), names, "{arguments}");
    }
    // The previous content of the file stays. A link of our own is used, because a bug must not replace /dev/stdout of a user who may do that.
    folder.write("log", "before\n");
    symlink("/proc/self/fd/1", folder.path("printed")).unwrap();
    let (code, stderr) = run_into(&folder, "log", &format!("render {SMALL} -o a.png --stats printed"));
    assert_eq!(code, Some(0), "{stderr}");
    let log = String::from_utf8(folder.read("log")).unwrap();
    let stats: Value = serde_json::from_str(log.strip_prefix("before\n").unwrap()).unwrap();
    assert_eq!(stats["width"], 27);
}

#[test]
fn pipes_and_devices_are_written_to() {
    let folder = with_inputs();
    symlink("/proc/self/fd/1", folder.path("printed")).unwrap();
    let run = folder.run(&format!("render {SMALL} -o a.png --stats printed"));
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert_eq!(serde_json::from_str::<Value>(&run.stdout).unwrap()["width"], 27);
    assert!(fs::symlink_metadata(folder.path("printed")).unwrap().is_symlink());
    for (name, arguments) in [
        ("pipe.npy", format!("render {SMALL} -o pipe.npy")),
        ("pipe.png", "compare image.png image.png --difference pipe.png".to_owned()),
        ("pipe.y4m", format!("orbit {SMALL} --count 3 --chroma 444 -o pipe.y4m")),
    ] {
        assert!(Command::new("mkfifo").arg(folder.path(name)).status().unwrap().success());
        let path = folder.path(name);
        let reader = thread::spawn(move || fs::read(path).unwrap());
        let run = folder.run(&arguments);
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        assert!(fs::symlink_metadata(folder.path(name)).unwrap().file_type().is_fifo(), "{name} was replaced");
        let plain = arguments.replace("pipe", "plain");
        assert_eq!(folder.run(&plain).code, Some(0));
        assert_eq!(reader.join().unwrap(), folder.read(&name.replace("pipe", "plain")), "{name}");
    }
}

#[test]
fn sockets_are_refused() {
    let folder = with_inputs();
    let _listener = UnixListener::bind(folder.path("socket.png")).unwrap();
    for arguments in
        [&format!("render a.nrrd {NO_DEVICE} -o socket.png"), "compare image.png image.png --difference socket.png"]
    {
        folder.run(arguments).assert_failure(2, &["socket.png", "found a socket"]);
    }
    assert!(fs::symlink_metadata(folder.path("socket.png")).unwrap().file_type().is_socket());
}

#[test]
fn links_stay_and_their_targets_are_replaced() {
    let folder = with_inputs();
    fs::create_dir(folder.path("there")).unwrap();
    folder.write("there/old.png", "old");
    symlink("there/old.png", folder.path("first.png")).unwrap();
    symlink("first.png", folder.path("second.png")).unwrap();
    symlink("there/new.png", folder.path("dangling.png")).unwrap();
    for (link, target) in [("second.png", "there/old.png"), ("dangling.png", "there/new.png")] {
        folder.run(&format!("compare image.png image.png --difference {link}"));
        assert!(fs::symlink_metadata(folder.path(link)).unwrap().is_symlink(), "{link}");
        assert!(!fs::symlink_metadata(folder.path(target)).unwrap().is_symlink(), "{target}");
        assert_eq!(image::open(folder.path(target)).unwrap().to_rgba8().dimensions(), (2, 2), "{target}");
    }
    symlink("loop.png", folder.path("loop.png")).unwrap();
    folder.run("compare image.png image.png --difference loop.png").assert_failure(1, &["loop.png", "symbolic link"]);
}

#[test]
fn a_file_that_is_replaced_keeps_its_mode() {
    let folder = with_inputs();
    for mode in [0o600, 0o640, 0o666, 0o755] {
        folder.write("out.png", "old");
        fs::set_permissions(folder.path("out.png"), Permissions::from_mode(mode)).unwrap();
        let run = folder.run("compare image.png image.png --difference out.png");
        assert_eq!(run.code, Some(0), "{}", run.stderr);
        assert_ne!(folder.read("out.png"), b"old");
        assert_eq!(fs::metadata(folder.path("out.png")).unwrap().mode() & 0o7777, mode, "{mode:o}");
    }
}

/// A run by a user who may write into the folder but is not root, who may write everything.
fn unprivileged(folder: &Folder, arguments: &str) -> Command {
    fs::set_permissions(folder.path(""), Permissions::from_mode(0o777)).unwrap();
    if fs::metadata(folder.path("")).unwrap().uid() != 0 {
        return folder.command(arguments);
    }
    // The program is copied to where other users can reach it, by another process, because a test that starts a program at that moment
    // would hold the copy open.
    let program = folder.path("sheetsplat");
    assert!(Command::new("cp").arg(env!("CARGO_BIN_EXE_sheetsplat")).arg(&program).status().unwrap().success());
    let mut command = Command::new(program);
    command.env("WGPU_ADAPTER_NAME", adapter()).args(arguments.split(' ')).current_dir(folder.path(""));
    command.uid(65534).gid(65534);
    command
}

#[test]
fn a_file_that_may_not_be_written_stays() {
    let folder = with_inputs();
    folder.write("out.png", "precious");
    fs::set_permissions(folder.path("out.png"), Permissions::from_mode(0o444)).unwrap();
    for arguments in
        ["compare image.png image.png --difference out.png", &format!("render a.nrrd -o out.png --stats s {NO_DEVICE}")]
    {
        let output = unprivileged(&folder, arguments).output().unwrap();
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{arguments}: {stderr}");
        assert!(stderr.contains("out.png: Permission denied"), "{arguments}: {stderr}");
        assert_eq!(folder.read("out.png"), b"precious", "{arguments}");
    }
}

/// Either everything is written or nothing, whichever output fails.
#[test]
fn failed_printing_leaves_no_file() {
    let folder = with_inputs();
    let names = folder.names();
    let full = || OpenOptions::new().write(true).open("/dev/full").unwrap();
    let outputs = "-o new.png --stats new.json --save-scene new.toml";
    for arguments in [
        format!("render {SMALL} --profile {outputs}"),
        "compare image.png image.png --difference new.png".to_owned(),
        "info a.nrrd".to_owned(),
    ] {
        let output = folder.command(&arguments).stdout(full()).output().unwrap();
        assert_fails_to_print(output.status, &String::from_utf8(output.stderr).unwrap(), &arguments);
        assert_eq!(folder.names(), names, "{arguments}, full");

        let output = folder.command(&arguments).stdout(closed()).output().unwrap();
        assert_fails_to_print(output.status, &String::from_utf8(output.stderr).unwrap(), &arguments);
        assert_eq!(folder.names(), names, "{arguments}, closed");
    }
}

/// Run by a user who cannot replace a device that is mistaken for a file.
#[test]
fn a_full_device_leaves_no_file() {
    let folder = with_inputs();
    symlink("/dev/full", folder.path("full.png")).unwrap();
    let arguments = format!("render {SMALL} -o full.png --stats new.json --save-scene new.toml");
    let mut command = unprivileged(&folder, &arguments);
    let names = folder.names();
    let output = command.output().unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    assert!(stderr.contains("full.png: No space left"), "{stderr}");
    assert_eq!(folder.names(), names);
    assert!(fs::symlink_metadata(folder.path("full.png")).unwrap().is_symlink());
}

/// A standard output that nobody reads. It is no pipe: another test that starts a program at that moment would for a while hold the pipe's reader open.
fn closed() -> OwnedFd {
    let (writer, reader) = UnixStream::pair().unwrap();
    reader.shutdown(Shutdown::Both).unwrap();
    writer.into()
}

fn assert_fails_to_print(status: ExitStatus, stderr: &str, arguments: &str) {
    assert_eq!(status.code(), Some(1), "{arguments}: {stderr}");
    assert!(stderr.contains("standard output: "), "{arguments}: {stderr}");
}

/// Warnings and errors that cannot be written have no other effect.
#[test]
fn a_full_standard_error_is_no_error() {
    let folder = with_inputs();
    let full = || OpenOptions::new().write(true).open("/dev/full").unwrap();
    let status = |arguments: &str| folder.command(arguments).stderr(full()).status().unwrap().code();
    assert_eq!(status(&format!("render {SMALL} -o out.png -v")), Some(0));
    assert_eq!(status("render gone.nrrd -o out.png"), Some(2));
    assert_eq!(status("render a.nrrd"), Some(2));
}

#[test]
fn no_temporary_file_outlives_a_signal() {
    for (signal, number) in [("INT", 2), ("TERM", 15), ("HUP", 1)] {
        let folder = Folder::new();
        let mut child = long_orbit(&folder, "").spawn().unwrap();
        wait_for_temporary(&folder, &mut child);
        send(signal, &child);
        assert_eq!(child.wait().unwrap().signal(), Some(number), "ended by the signal itself");
        assert_eq!(folder.names(), BTreeSet::new(), "{signal}");
    }
}

#[test]
fn signals_that_the_caller_ignores_are_ignored() {
    let folder = Folder::new();
    let mut child = long_orbit(&folder, "trap '' INT HUP; ").spawn().unwrap();
    wait_for_temporary(&folder, &mut child);
    send("INT", &child);
    send("HUP", &child);
    // It goes on drawing.
    let size = || folder.names().iter().map(|name| fs::metadata(folder.path(name)).unwrap().len()).sum::<u64>();
    let before = size();
    wait_until(&mut child, || size() > before);
    send("TERM", &child);
    assert_eq!(child.wait().unwrap().signal(), Some(15));
    assert_eq!(folder.names(), BTreeSet::new());
}

/// A long series of frames, started from a shell.
fn long_orbit(folder: &Folder, before: &str) -> Command {
    // Whoever runs the tests may ignore signals, as `nohup` does.
    let mut command = Command::new("env");
    let program = env!("CARGO_BIN_EXE_sheetsplat");
    let script = format!("{before}exec '{program}' orbit {SMALL} --count 1000000 -o turn.apng");
    command
        .args(["--default-signal", "sh", "-c", &script])
        .env("WGPU_ADAPTER_NAME", adapter())
        .current_dir(folder.path(""));
    command
}

fn wait_for_temporary(folder: &Folder, child: &mut Child) {
    wait_until(child, || !folder.names().is_empty());
    assert!(folder.names().iter().all(|name| name.starts_with(".sheetsplat-")), "{:?}", folder.names());
}

/// Waits for what a child does as long as it runs, however slow the machine is.
fn wait_until(child: &mut Child, is_done: impl Fn() -> bool) {
    while !is_done() {
        assert!(child.try_wait().unwrap().is_none(), "ended by itself");
        thread::sleep(Duration::from_millis(20));
    }
}

fn send(signal: &str, child: &Child) {
    let status = Command::new("kill").args(["-s", signal, &child.id().to_string()]).status().unwrap();
    assert!(status.success());
}

#[test]
fn extensions_are_of_either_case() {
    let folder = with_inputs();
    for name in ["A.PNG", "A.EXR", "A.NPY"] {
        folder.render(&format!("{SMALL} -o {name} --save-scene S.TOML"));
        assert_eq!(folder.run(&format!("compare {name} {name} --difference D.Png")).code, Some(0), "{name}");
    }
    folder.render("S.TOML -o B.PNG");
    assert_eq!(folder.read("A.PNG"), folder.read("B.PNG"));
    folder.run(&format!("render {SMALL} -o A.EXR --annotate scale")).assert_failure(2, &["--annotate", "A.EXR"]);
    let mut start = [0; 4];
    for (name, magic) in [("A.GIF", b"GIF8"), ("A.APNG", b"\x89PNG"), ("A.Y4M", b"YUV4")] {
        folder.run(&format!("orbit {SMALL} --count 2 --chroma 444 -o {name}")).assert_success();
        File::open(folder.path(name)).unwrap().read_exact(&mut start).unwrap();
        assert_eq!(&start, magic, "{name}");
    }
    folder.run(&format!("orbit {SMALL} --count 2 -o F%d.PNG --save-scene O.TOML")).assert_success();
    folder.render("O.TOML -o O.PNG");
    assert_eq!(folder.read("F0.PNG"), folder.read("O.PNG"));
    // The data file of a pair has the same case as its header.
    for (from, to) in [("pair.hdr", "P.HDR"), ("pair.img", "P.IMG"), ("a.nrrd", "A.NRRD")] {
        fs::copy(folder.path(from), folder.path(to)).unwrap();
    }
    let size = "--set image={width=16,height=12}";
    for (lower, upper) in [("pair.hdr", "P.HDR"), ("pair.hdr", "P.IMG"), ("a.nrrd", "A.NRRD")] {
        assert_eq!(folder.pixels(&format!("{upper} {size}")), folder.pixels(&format!("{lower} {size}")), "{upper}");
    }
}
