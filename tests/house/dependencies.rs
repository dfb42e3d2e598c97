//! The requirements of compiled crates: licences and sources that `deny.toml` allows, and the compiler version.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;

use serde_json::Value;

/// The output of `cargo metadata`: the packages and their resolved graph.
fn metadata(arguments: &[&str]) -> Value {
    let cargo = Command::new(env!("CARGO"))
        .args(["metadata", "--locked", "--format-version", "1"])
        .args(arguments)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    assert!(cargo.status.success(), "{}", String::from_utf8_lossy(&cargo.stderr));
    serde_json::from_slice(&cargo.stdout).unwrap()
}

fn text<'a>(value: &'a Value, key: &str) -> &'a str {
    value[key].as_str().unwrap_or_default()
}

/// Packages by their identifiers.
fn packages(metadata: &Value) -> BTreeMap<&str, &Value> {
    metadata["packages"].as_array().unwrap().iter().map(|package| (text(package, "id"), package)).collect()
}

fn version(text: &str) -> Vec<u32> {
    let mut parts: Vec<u32> = text.split('.').map(|part| part.parse().unwrap()).collect();
    parts.resize(3, 0);
    parts
}

/// The stated `rust-version` is the highest of all dependencies with the default features: neither too low a promise, nor higher than needed.
#[test]
fn the_stated_compiler_is_that_of_the_dependencies() {
    let metadata = metadata(&[]);
    let packages = packages(&metadata);
    let nodes = metadata["resolve"]["nodes"].as_array().unwrap();
    let nodes: BTreeMap<&str, &Value> = nodes.iter().map(|node| (text(node, "id"), node)).collect();
    let ours = packages.values().find(|package| text(package, "name") == "sheetsplat").unwrap();
    let (mut reached, mut next) = (BTreeSet::new(), vec![text(ours, "id")]);
    while let Some(id) = next.pop() {
        if reached.insert(id) {
            let dependencies = nodes[id]["deps"].as_array().unwrap().iter();
            let compiled = dependencies.filter(|dependency| {
                dependency["dep_kinds"].as_array().unwrap().iter().any(|kind| text(kind, "kind") != "dev")
            });
            next.extend(compiled.map(|dependency| text(dependency, "pkg")));
        }
    }
    reached.remove(text(ours, "id"));
    assert!(reached.len() > 50, "only {} dependencies", reached.len());
    let needed = reached.iter().map(|id| packages[id]).filter(|package| !package["rust_version"].is_null());
    let most = needed.max_by_key(|package| version(text(package, "rust_version"))).unwrap();
    let [stated, most_version] = [ours, &most].map(|package| text(package, "rust_version"));
    let name = text(most, "name");
    assert_eq!(version(stated), version(most_version), "{name} needs Rust {most_version}, Cargo.toml says {stated}");
}

/// Whether an SPDX expression is satisfied by the allowed licences. `/` is an old notation for `OR`.
fn is_allowed(expression: &str, allowed: &dyn Fn(&str) -> bool) -> bool {
    let spaced = expression.replace('/', " OR ").replace('(', " ( ").replace(')', " ) ");
    let mut words = spaced.split_whitespace().peekable();
    let result = any(&mut words, allowed);
    assert_eq!(words.next(), None, "{expression}");
    result
}

type Words<'a> = std::iter::Peekable<std::str::SplitWhitespace<'a>>;

fn any(words: &mut Words<'_>, allowed: &dyn Fn(&str) -> bool) -> bool {
    let mut result = all(words, allowed);
    while words.next_if_eq(&"OR").is_some() {
        result |= all(words, allowed);
    }
    result
}

fn all(words: &mut Words<'_>, allowed: &dyn Fn(&str) -> bool) -> bool {
    let mut result = one(words, allowed);
    while words.next_if_eq(&"AND").is_some() {
        result &= one(words, allowed);
    }
    result
}

fn one(words: &mut Words<'_>, allowed: &dyn Fn(&str) -> bool) -> bool {
    let word = words.next().unwrap();
    if word == "(" {
        let result = any(words, allowed);
        assert_eq!(words.next(), Some(")"));
        return result;
    }
    match words.next_if_eq(&"WITH") {
        Some(_) => allowed(&format!("{word} WITH {}", words.next().unwrap())),
        None => allowed(word),
    }
}

#[test]
fn expressions_of_licences() {
    let allowed = |name: &str| ["A", "B", "C WITH D"].contains(&name);
    for expression in
        ["A", "X OR A", "X/A", "A AND B", "(X OR A) AND B", "X OR (A AND (B OR Y))", "C WITH D", "X AND Y OR A"]
    {
        assert!(is_allowed(expression, &allowed), "{expression}");
    }
    for expression in ["X", "A AND X", "(A OR B) AND X", "C", "A WITH D", "A AND (X OR Y)"] {
        assert!(!is_allowed(expression, &allowed), "{expression}");
    }
}

/// `cargo deny` checks more where it is installed; this part is checked everywhere.
#[test]
fn licences_and_sources_are_allowed() {
    let policy = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("deny.toml")).unwrap();
    let policy: toml::Table = policy.parse().unwrap();
    let words = |value: &toml::Value| -> BTreeSet<String> {
        value.as_array().unwrap().iter().map(|word| word.as_str().unwrap().to_owned()).collect()
    };
    let allowed = words(&policy["licenses"]["allow"]);
    let exceptions: BTreeMap<&str, BTreeSet<String>> = policy["licenses"]["exceptions"]
        .as_array()
        .unwrap()
        .iter()
        .map(|exception| (exception["crate"].as_str().unwrap(), words(&exception["allow"])))
        .collect();
    let registries = words(&policy["sources"]["allow-registry"]);
    let metadata = metadata(&["--all-features"]);
    let mut used = BTreeSet::new();
    for package in packages(&metadata).values() {
        let (name, source) = (text(package, "name"), package["source"].as_str());
        let Some(source) = source else {
            assert!(name.starts_with("sheetsplat"), "{name} comes from a folder");
            continue;
        };
        let registry = source.strip_prefix("registry+").unwrap_or_else(|| panic!("{name} comes from {source}"));
        assert!(registries.contains(registry), "{name} comes from {registry}");
        let is_excepted = |licence: &str| exceptions.get(name).is_some_and(|more| more.contains(licence));
        let licence = text(package, "license");
        let holds = is_allowed(licence, &|licence| allowed.contains(licence) || is_excepted(licence));
        assert!(holds, "{name} is under {licence:?}, allowed: {allowed:?}");
        used.extend(exceptions.contains_key(name).then_some(name));
    }
    assert_eq!(used, exceptions.keys().copied().collect(), "exceptions for crates that are not there");
}

/// Tests that render on the processor compile neither wgpu nor naga, nor the program's crates.
#[test]
fn the_native_backend_needs_no_wgpu() {
    let cargo = Command::new(env!("CARGO"))
        .args([
            "tree",
            "--locked",
            "--edges",
            "normal",
            "--prefix",
            "none",
            "--no-default-features",
            "--features",
            "cpu,golden",
        ])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    assert!(cargo.status.success(), "{}", String::from_utf8_lossy(&cargo.stderr));
    let tree = String::from_utf8(cargo.stdout).unwrap();
    let names: BTreeSet<&str> = tree.lines().filter_map(|line| line.split(' ').next()).collect();
    assert!(names.contains("fearless_simd") && names.contains("png"), "{names:?}");
    for name in ["wgpu", "wgpu-core", "wgpu-hal", "naga", "pollster", "clap", "ash"] {
        assert!(!names.contains(name), "{name} is compiled");
    }
}
