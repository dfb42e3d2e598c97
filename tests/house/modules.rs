//! Modules depend on one another in one direction: those at the top level without exception, files with a few that are written down.

mod circles;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use circles::Files;

/// The folders of crates, without `bin`, and the circles of files in each: a file of the circle, and the number of its files. Circles make it hard to read
/// one file without the others, so they may only shrink.
const CIRCLES: [(&str, &[(&str, usize)]); 3] = [
    ("src", &[("cpu", 20), ("headless", 5)]),
    ("src/bin/sheetsplat", &[]),
    ("crates/volume/src", &[("zarr/codec", 2)]),
];

/// The modules of the library at its top level, each with those that its code names; tests at the end of a file do not count.
fn dependencies() -> BTreeMap<String, BTreeSet<String>> {
    fn collect(path: &Path, names: &mut BTreeSet<String>) {
        if path.is_dir() {
            fs::read_dir(path).unwrap().for_each(|entry| collect(&entry.unwrap().path(), names));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let text = fs::read_to_string(path).unwrap();
            let code = text.lines().take_while(|line| *line != "#[cfg(test)]");
            for line in code.filter(|line| !line.trim_start().starts_with("//")) {
                let mentions = line.split("crate::").skip(1);
                names.extend(mentions.map(|rest| rest.split(|c: char| !c.is_alphanumeric() && c != '_')).map(
                    |mut words| {
                        // A list in braces would hide modules from this test.
                        let name = words.next().unwrap_or_default();
                        assert!(!name.is_empty(), "{}: {line}", path.display());
                        name.to_owned()
                    },
                ));
            }
        }
    }
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(source).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        if !["lib", "bin"].contains(&name.as_str()) {
            collect(&path, found.entry(name).or_default());
        }
    }
    let modules: BTreeSet<String> = found.keys().cloned().collect();
    for (name, used) in &mut found {
        used.retain(|other| other != name && modules.contains(other));
    }
    found
}

#[test]
fn no_modules_import_each_other_in_a_cycle() {
    let mut rest = dependencies();
    let count: usize = rest.values().map(BTreeSet::len).sum();
    assert!(rest.len() > 15 && count > 80, "{} modules with {count} dependencies", rest.len());
    // Modules that depend on none of the rest are removed until none is left.
    while !rest.is_empty() {
        let free: Vec<String> = rest.iter().filter(|(_, used)| used.is_empty()).map(|(name, _)| name.clone()).collect();
        assert!(!free.is_empty(), "these depend on each other in a cycle, or on modules that do: {rest:#?}");
        for name in free {
            rest.remove(&name);
            for used in rest.values_mut() {
                used.remove(&name);
            }
        }
    }
}

#[test]
fn circles_of_files_do_not_grow() {
    let mut wrong = Vec::new();
    for (folder, known) in CIRCLES {
        let files = Files::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join(folder));
        assert!(files.count() > 40, "only {} files in {folder}", files.count());
        let circles = files.circles();
        for circle in &circles {
            let row = known.iter().find(|(name, _)| circle.contains_key(*name));
            let (name, allowed) = row.copied().unwrap_or((circle.keys().next().unwrap(), 0));
            let count = circle.len();
            if count > allowed {
                let found = format!("the circle of {name} has {count} files, allowed: {allowed}");
                wrong.push(format!("{folder}: {found}; give what they share a file of its own: {circle:#?}"));
            } else if count < allowed {
                wrong.push(format!("{folder}: the circle of {name} has shrunk: write {count}"));
            }
        }
        for (name, _) in known.iter().filter(|(name, _)| !circles.iter().any(|circle| circle.contains_key(*name))) {
            wrong.push(format!("{folder}: {name} is in no circle any more: remove its row"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn circles_are_found_through_other_files() {
    let files = Files::of_texts(&[
        ("lib", "mod a;\nmod b;\npub use b::B;\npub use rayon::prelude;"),
        ("a", "use super::{B, c::C as Other};\nuse crate::prelude::*;\npub struct A;"),
        ("b", "mod deep;\npub struct B;\nfn f() -> crate::b::deep::D {}"),
        ("b/deep", "use super::super::c::{self};\npub struct D(c::C);\nmod inner {\n    use super::D;\n}"),
        ("c", "pub struct C;\n#[cfg(test)]\nuse super::a;"),
    ]);
    assert!(files.circles().is_empty(), "{:?}", files.circles());
    let files = Files::of_texts(&[
        ("lib", "mod a;\nmod b;\npub use b::B;"),
        ("a", "use super::B;\npub struct A;"),
        ("b", "mod deep;\npub struct B;"),
        ("b/deep", "fn f(_: crate::a::A, _: super::B) {}"),
        ("c", "pub use super::a::A;"),
    ]);
    assert!(files.circles().is_empty(), "{:?}", files.circles());
    let files = Files::of_texts(&[
        ("lib", "mod a;\nmod b;\npub use b::deep::D;"),
        ("a", "use super::D;\npub struct A;"),
        ("b", "mod deep;"),
        ("b/deep", "use super::super::{\n    c::A,\n};\npub struct D(A);"),
        ("c", "pub use super::a::A;"),
    ]);
    let circles = files.circles();
    let names: Vec<_> = circles.iter().map(|circle| circle.keys().map(String::as_str).collect::<Vec<_>>()).collect();
    assert_eq!(names, [["a", "b/deep"]]);
}

/// The standard library's functions are the system's, whose last bits differ between machines (SPEC §12). What only the f64 evaluation, the program's texts and the
/// report of a comparison need may use them.
#[test]
fn functions_of_numbers_are_those_of_libm() {
    const FUNCTIONS: [&str; 21] = [
        "sin", "cos", "tan", "sin_cos", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "exp", "exp2",
        "exp_m1", "ln", "ln_1p", "log2", "log10", "powf", "cbrt", "hypot",
    ];
    const EXEMPT: [&str; 3] = ["src/bin", "src/reference", "src/golden/comparison.rs"];
    fn scan(root: &Path, path: &Path, lines: &mut usize, found: &mut Vec<String>) {
        if EXEMPT.iter().any(|exempt| path == root.join(exempt)) {
            return;
        }
        if path.is_dir() {
            fs::read_dir(path).unwrap().for_each(|entry| scan(root, &entry.unwrap().path(), lines, found));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let text = fs::read_to_string(path).unwrap();
            for line in text.lines().take_while(|line| *line != "#[cfg(test)]") {
                *lines += 1;
                // Called, or named for another function to call.
                let uses = |function: &&str| {
                    line.contains(&format!(".{function}(")) || line.contains(&format!("f64::{function})"))
                };
                if FUNCTIONS.iter().any(uses) {
                    found.push(format!("{}: {line}", path.display()));
                }
            }
        }
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let (mut lines, mut found) = (0, Vec::new());
    for folder in ["src", "crates/volume/src"] {
        scan(root, &root.join(folder), &mut lines, &mut found);
    }
    assert!(lines > 45_000, "only {lines} lines");
    assert!(found.is_empty(), "{found:#?}");
}
