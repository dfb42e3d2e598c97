//! The files of the tile rasterizer's shader list at the top what they need from which other file, and the lists are correct. WGSL has no
//! imports, so a file can be read by itself only if it says where its names come from.

use std::collections::{BTreeMap, BTreeSet};

use sheetsplat::internals::gpu::shaders::{self, Shader};

/// A file's text without comments.
fn code(text: &str) -> String {
    text.lines().map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n")
}

/// The words of some code, each with the character before it.
fn words(code: &str) -> Vec<(char, &str)> {
    let mut found = Vec::new();
    let mut start = None;
    for (at, c) in code.char_indices().chain([(code.len(), ' ')]) {
        let is_word = c.is_ascii_alphanumeric() || c == '_';
        match (start, is_word) {
            (None, true) => start = Some(at),
            (Some(first), false) => {
                found.push((code[..first].chars().next_back().unwrap_or(' '), &code[first..at]));
                start = None;
            }
            _ => {}
        }
    }
    found
}

/// What a file declares for others: functions, structs, constants, overrides and variables outside functions.
fn declared(code: &str) -> BTreeSet<&str> {
    let at_top = code.lines().filter(|line| !line.starts_with([' ', '}', '\t']));
    let mut found = BTreeSet::new();
    for line in at_top {
        let line = if line.starts_with('@') { line.split_once(") ").map_or(line, |(_, rest)| rest) } else { line };
        let line = if line.starts_with('@') { line.split_once(") ").map_or(line, |(_, rest)| rest) } else { line };
        let mut words = words(line).into_iter().map(|(_, word)| word);
        match words.next() {
            Some("fn" | "struct" | "const" | "override" | "alias") => found.extend(words.next()),
            // The name follows the address space.
            Some("var") => found.extend(line.split(':').next().and_then(|head| head.split([' ', '>']).next_back())),
            _ => {}
        }
    }
    found
}

/// Names that a file's functions and structs declare for themselves: variables, parameters and fields.
fn own(code: &str) -> BTreeSet<&str> {
    let mut found = BTreeSet::new();
    let all = words(code);
    for pair in all.windows(2) {
        if matches!(pair[0].1, "let" | "var") {
            found.insert(pair[1].1);
        }
    }
    for (before, _) in code.match_indices(':') {
        let head = &code[..before];
        let start = head.rfind(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).map_or(0, |at| at + 1);
        found.insert(&head[start..]);
    }
    found
}

/// The names that each file of the shader needs, by the file that declares them.
fn needs(shader: &Shader) -> BTreeMap<&'static str, BTreeMap<&'static str, BTreeSet<String>>> {
    let codes: Vec<(&str, String)> = shader.files.iter().map(|&(path, text)| (path, code(text))).collect();
    let mut all = BTreeMap::new();
    for (path, text) in &codes {
        let (here, own) = (declared(text), own(text));
        let used: BTreeSet<&str> =
            words(text).into_iter().filter(|&(before, _)| before != '.').map(|(_, word)| word).collect();
        let mut needed: BTreeMap<&str, BTreeSet<String>> = BTreeMap::new();
        for (other, other_text) in codes.iter().filter(|(other, _)| other != path) {
            for name in declared(other_text) {
                if used.contains(name) && !here.contains(name) && !own.contains(name) {
                    needed.entry(*other).or_default().insert(name.to_owned());
                }
            }
        }
        all.insert(*path, needed);
    }
    all
}

#[test]
fn every_file_of_the_tile_rasterizer_lists_what_it_needs() {
    // A file of several stages needs what it needs in any.
    let stages = [shaders::GATHER, shaders::GATHER_PLANES].concat();
    let mut needs: BTreeMap<&str, BTreeMap<&str, BTreeSet<String>>> = BTreeMap::new();
    let mut texts: BTreeMap<&str, &str> = BTreeMap::new();
    for stage in &stages {
        texts.extend(stage.files.iter().copied());
        for (path, others) in self::needs(stage) {
            for (other, names) in others {
                needs.entry(path).or_default().entry(other).or_default().extend(names);
            }
        }
    }
    let mut failures = Vec::new();
    for (path, text) in texts.into_iter().filter(|(path, _)| path.starts_with("gather/")) {
        let expected: Vec<String> = (needs.entry(path).or_default().iter())
            .map(|(other, names)| {
                format!("// Needs {other}: {}.", names.iter().cloned().collect::<Vec<_>>().join(", "))
            })
            .collect();
        let stated: Vec<&str> = text.lines().filter(|line| line.starts_with("// Needs ")).collect();
        if stated != expected {
            failures.push(format!("shaders/{path} should say:\n{}", expected.join("\n")));
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n\n"));
}

#[test]
fn needs_are_found() {
    let needs = needs(&shaders::GATHER[0]);
    assert!(needs["gather/queue.wgsl"]["gather/bits.wgsl"].contains("ballot"), "{:?}", needs["gather/queue.wgsl"]);
    assert!(needs["gather/walk.wgsl"]["gather/patch.wgsl"].contains("lanes"), "{:?}", needs["gather/walk.wgsl"]);
    assert!(needs["gather/walk.wgsl"].len() > 3, "{:?}", needs["gather/walk.wgsl"]);
    let text = "@group(0) @binding(1) var<storage, read> bricks: array<Brick>;\nfn f(a: u32) -> u32 {\n    let b = a;\n    return b + c.x;\n}";
    assert_eq!(declared(text), BTreeSet::from(["bricks", "f"]));
    assert!(own(text).contains("a") && own(text).contains("b") && !own(text).contains("c"));
}
