//! Information about the program and the machine.

use crate::*;

impl Folder {
    /// The output of a run that must succeed.
    fn prints(&self, arguments: &str) -> String {
        let run = self.run(arguments);
        assert_eq!(run.code, Some(0), "{arguments}: {}", run.stderr);
        assert!(!run.stdout.contains('\x1b'), "colours are for terminals: {arguments}");
        run.stdout
    }

    fn assert_prints(&self, arguments: &str, words: &[&str]) {
        let stdout = self.prints(arguments);
        for word in words {
            assert!(stdout.contains(word), "{arguments}: no {word:?} in\n{stdout}");
        }
    }
}

/// The subcommands, without those of other features.
const COMMANDS: [&str; 10] =
    ["render", "orbit", "sweep", "bench", "compare", "light", "adapters", "schema", "completions", "man"];

#[test]
fn help_and_version_are_results() {
    let folder = Folder::new();
    for command in COMMANDS {
        folder.assert_prints("--help", &[&format!("\n  {command} ")]);
        folder.assert_prints(
            &format!("{command} --help"),
            &["Example", &format!("\n  sheetsplat {command}"), "--verbose"],
        );
    }
    folder
        .assert_prints("--help", &["Volume rendering by", "Examples:\n  sheetsplat render", "Exit codes", "RUST_LOG"]);
    folder.assert_prints("render --help", &["Render a scene file", "--set", "WGPU_ADAPTER_NAME"]);
    folder.assert_prints("bench --help", &["Time a first frame", "--frames"]);
    folder.assert_prints("orbit --help", &["Draw a turntable", "--count"]);
    folder.assert_prints("sweep --help", &["Draw a contact sheet", "--columns"]);
    folder.assert_prints("compare --help", &["Compare two images", "--outliers"]);
    folder.assert_prints("--version", &[env!("CARGO_PKG_VERSION")]);
}

#[test]
fn adapters_are_listed_with_what_they_can_do() {
    let folder = Folder::new();
    let list = folder.prints("adapters");
    // Adapters start at the margin, and their properties are indented.
    let llvmpipe = list.split_inclusive('\n').skip_while(|line| !line.starts_with("llvmpipe")).collect::<String>();
    let rows: Vec<_> = llvmpipe.lines().skip(1).take_while(|line| line.starts_with("  ")).collect();
    let keys: Vec<_> = rows.iter().filter_map(|row| row.split_whitespace().next()).collect();
    assert_eq!(keys, ["driver", "type", "backend", "usable", "chosen"], "{list}");
    for (row, words) in rows.iter().zip(["llvmpipe Mesa", "Cpu", "vulkan", "yes", "yes"]) {
        assert!(row.contains(words), "no {words:?} in {row}");
    }
    // The list is printed even if none of the adapters has the requested name.
    let run = folder.run("adapters --adapter nonesuch");
    assert_eq!(run.code, Some(1));
    assert!(run.stdout.contains("llvmpipe") && !run.stdout.contains("chosen   yes"), "{}", run.stdout);
    assert!(run.stderr.contains("nonesuch"), "{}", run.stderr);
}

#[test]
fn shells_complete_every_subcommand() {
    let folder = Folder::new();
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        folder.assert_prints(&format!("completions {shell}"), &COMMANDS);
        folder.assert_prints(&format!("completions {shell}"), &["outliers", "chroma"]);
    }
    folder.run("completions dos").assert_failure(2, &["dos", "bash", "zsh"]);
}

#[test]
fn man_pages_are_of_the_program_and_of_each_subcommand() {
    let folder = Folder::new();
    folder.assert_prints("man", &[".TH sheetsplat 1", "sheetsplat\\-render(1)", "Exit codes"]);
    for command in COMMANDS {
        folder.assert_prints(&format!("man {command}"), &[&format!(".TH sheetsplat-{command} 1"), "Example"]);
    }
    folder.assert_prints("man orbit", &["turntable", "\\-\\-count", "\\-\\-verbose"]);
    folder.run("man nonesuch").assert_failure(2, &["man", "nonesuch", "render, orbit"]);
}

#[test]
fn verbose_says_what_is_done_and_quiet_no_more_than_errors() {
    let folder = Folder::new();
    let said = |environment: &[(&str, &str)], arguments: &str| {
        let run =
            folder.run_with(environment, "", &format!("orbit {SMALL} --count 2 -o %d.png --overwrite{arguments}"));
        run.assert_success();
        run.stderr
    };
    let info = "12, 12, 12] voxels";
    let verbose = said(&[], " -v");
    let on_adapter = format!("on {}", adapter());
    for words in [info, "frame 1: ", &on_adapter] {
        assert!(verbose.contains(words), "no {words:?} in\n{verbose}");
    }
    assert!(!verbose.contains('\x1b'), "{verbose}");
    assert!(!said(&[], "").contains(info));
    assert!(said(&[("RUST_LOG", "info")], " --quiet").contains(info), "RUST_LOG overrules it");
    assert!(!said(&[("RUST_LOG", "error")], " -v").contains(info), "RUST_LOG overrules it");
    assert!(!said(&[], " --quiet").contains("sheetsplat"));
    // How far the coefficients are, of values and of colours.
    let exact = "--backend cpu --set splatting.classification=after --set splatting.interpolation=exact -o a.png";
    let progress = folder.run(&format!("render {SMALL} {exact} -v")).stderr;
    for percent in [30, 60, 100] {
        let words = format!("coefficients of splatting.interpolation = \"exact\": {percent} %");
        assert!(progress.contains(&words), "no {words:?} in\n{progress}");
    }
    let colors = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/colors/rgba.nrrd");
    let progress = folder.run(&format!("render {} {exact} -v", colors.display())).stderr;
    for percent in [25, 50, 100] {
        let words = format!("coefficients of the voxels' colours: {percent} %");
        assert!(progress.contains(&words), "no {words:?} in\n{progress}");
    }
    assert!(!folder.run(&format!("render {SMALL} {exact}")).stderr.contains('%'), "standard error is no terminal");
    folder.run("--quiet --verbose adapters").assert_failure(2, &["--quiet", "--verbose"]);
    folder.run("render gone.toml -o out.png --quiet").assert_failure(2, &["gone.toml"]);
}
