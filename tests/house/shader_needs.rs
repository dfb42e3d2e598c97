//! Each file of the shaders imports the files whose names it uses, and no others, so that it can be read by itself. Files of several stages
//! (`shared/`) say which names each stage declares for them.

use std::collections::{BTreeMap, BTreeSet};

use sheetsplat::internals::gpu::shaders::{self, Shader};

/// A file's text without comments.
fn code(text: &str) -> String {
    text.lines().map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n")
}

/// The words of some code, each with the characters before and after it.
fn words(code: &str) -> Vec<(char, &str, char)> {
    let mut found = Vec::new();
    let mut start = None;
    for (at, c) in code.char_indices().chain([(code.len(), ' ')]) {
        let is_word = c.is_ascii_alphanumeric() || c == '_';
        match (start, is_word) {
            (None, true) => start = Some(at),
            (Some(first), false) => {
                found.push((code[..first].chars().next_back().unwrap_or(' '), &code[first..at], c));
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
        let mut words = words(line).into_iter().map(|(_, word, _)| word);
        match words.next() {
            Some("fn" | "struct" | "const" | "override" | "alias") => found.extend(words.next()),
            // The name follows the address space.
            Some("var") => found.extend(line.split(':').next().and_then(|head| head.split([' ', '>']).next_back())),
            _ => {}
        }
    }
    found
}

/// The declarations of some code, each with what belongs to it.
fn declarations(code: &str) -> Vec<String> {
    let mut found: Vec<String> = Vec::new();
    for line in code.lines() {
        match found.last_mut() {
            Some(last) if line.is_empty() || line.starts_with([' ', '\t', ')', '}']) => *last += line,
            _ => found.push(line.to_owned()),
        }
        if let Some(last) = found.last_mut() {
            last.push('\n');
        }
    }
    found
}

/// Names that a declaration has for itself: variables and parameters.
fn own(code: &str) -> BTreeSet<&str> {
    let mut found = BTreeSet::new();
    // The names of members are used only behind dots.
    if code.starts_with("struct") {
        return found;
    }
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

/// The names that some code uses and does not declare inside.
fn used(code: &str) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for declaration in declarations(code) {
        let own = own(&declaration);
        let names = words(&declaration).into_iter().filter(|&(before, _, after)| before != '.' && after != ':');
        found.extend(names.map(|(_, word, _)| word).filter(|word| !own.contains(word)).map(str::to_owned));
    }
    found
}

/// The names that each file of the shader needs, by the file that declares them.
fn needs(shader: &Shader) -> BTreeMap<&'static str, BTreeMap<&'static str, BTreeSet<String>>> {
    let codes: Vec<(&str, String)> = shader.files.iter().map(|&(path, text)| (path, code(text))).collect();
    let mut all = BTreeMap::new();
    for (path, text) in &codes {
        let (here, used) = (declared(text), used(text));
        let mut needed: BTreeMap<&str, BTreeSet<String>> = BTreeMap::new();
        for (other, other_text) in codes.iter().filter(|(other, _)| other != path) {
            for name in declared(other_text) {
                if used.contains(name) && !here.contains(name) {
                    needed.entry(*other).or_default().insert(name.to_owned());
                }
            }
        }
        all.insert(*path, needed);
    }
    all
}

/// What a file imports, by the lines at its head.
fn imported(text: &str) -> impl Iterator<Item = &str> {
    text.lines().take_while(|line| line.starts_with("//")).filter_map(|line| line.strip_prefix("// #import "))
}

/// The paths of the files that an import means in a shader.
fn meaning(shader: &Shader, import: &str) -> BTreeSet<String> {
    let bound: Vec<&str> = shader.variant.iter().filter(|(name, _)| *name == import).map(|&(_, file)| file).collect();
    let files = if bound.is_empty() { vec![import] } else { bound };
    files.iter().map(|file| format!("{file}.wgsl")).collect()
}

/// Whether a name of one file that another uses is a parameter of that one, which belongs to several stages: each stage declares its own.
fn is_given(user: &str, declarer: &str) -> bool {
    user.starts_with("shared/") && !declarer.starts_with("shared/")
}

#[test]
fn every_file_imports_what_it_uses_and_nothing_else() {
    let mut failures = BTreeSet::new();
    let mut unused: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for shader in shaders::ALL {
        for &(path, text) in shader.files {
            unused.entry(path).or_insert_with(|| imported(text).collect());
        }
    }
    for shader in shaders::ALL {
        let needs = needs(shader);
        for &(path, text) in shader.files {
            let needed = || needs[path].iter().filter(|(other, _)| !is_given(path, other));
            let meanings: BTreeSet<String> = imported(text).flat_map(|import| meaning(shader, import)).collect();
            for (other, names) in needed().filter(|(other, _)| !meanings.contains(**other)) {
                failures.insert(format!("shaders/{path} uses {names:?} and does not import {other}"));
            }
            let is_used = |import: &str| needed().any(|(other, _)| meaning(shader, import).contains(*other));
            unused.entry(path).or_default().retain(|import| !is_used(import));
        }
    }
    for (path, imports) in unused.iter().filter(|(_, imports)| !imports.is_empty()) {
        failures.insert(format!("shaders/{path} uses no name of {imports:?}"));
    }
    assert!(failures.is_empty(), "{failures:#?}");
}

#[test]
fn shared_files_say_what_the_stage_declares() {
    let mut given: BTreeMap<&str, BTreeSet<String>> = BTreeMap::new();
    let mut texts: BTreeMap<&str, &str> = BTreeMap::new();
    for shader in shaders::ALL {
        texts.extend(shader.files.iter().copied());
        for (path, others) in needs(shader) {
            let names = others.into_iter().filter(|(other, _)| is_given(path, other)).flat_map(|(_, names)| names);
            given.entry(path).or_default().extend(names);
        }
    }
    let mut failures = Vec::new();
    for (path, text) in texts {
        let names: Vec<String> = given[path].iter().map(|name| format!("`{name}`")).collect();
        let expected = match &names[..] {
            [] => None,
            [one] => Some(format!("// The stage declares {one}.")),
            [first @ .., last] => Some(format!("// The stage declares {} and {last}.", first.join(", "))),
        };
        let stated = text.lines().find(|line| line.starts_with("// The stage declares "));
        if stated != expected.as_deref() {
            failures.push(format!("shaders/{path}: {stated:?}, expected: {expected:?}"));
        }
    }
    assert!(failures.is_empty(), "{failures:#?}");
}

#[test]
fn no_files_import_each_other_in_a_circle() {
    for shader in shaders::ALL {
        let imports = |text| imported(text).flat_map(|import| meaning(shader, import)).collect();
        let mut rest: BTreeMap<&str, BTreeSet<String>> =
            shader.files.iter().map(|&(path, text)| (path, imports(text))).collect();
        assert!(rest.len() > 2, "{}", shader.stage);
        // Files that import none of the rest are removed until none is left.
        while !rest.is_empty() {
            let free: Vec<&str> = rest.iter().filter(|(_, others)| others.is_empty()).map(|(path, _)| *path).collect();
            assert!(!free.is_empty(), "{}: circles, and files that import them: {rest:#?}", shader.stage);
            for path in free {
                rest.remove(path);
                rest.values_mut().for_each(|others| others.retain(|other| other != path));
            }
        }
    }
}

#[test]
fn needs_are_found() {
    let needs = needs(&shaders::GATHER[0]);
    assert!(needs["gather/queue.wgsl"]["gather/bits.wgsl"].contains("ballot"), "{:?}", needs["gather/queue.wgsl"]);
    assert!(needs["gather/walk.wgsl"]["gather/state.wgsl"].contains("lanes"), "{:?}", needs["gather/walk.wgsl"]);
    assert!(needs["gather/walk.wgsl"].len() > 3, "{:?}", needs["gather/walk.wgsl"]);
    let text = "@group(0) @binding(1) var<storage, read> bricks: array<Brick>;\nfn f(a: u32) -> u32 {\n    let b = a;\n    return b + c.x;\n}\nstruct S {\n    d: D,\n}\nfn g() {\n    d();\n}";
    assert_eq!(declared(text), BTreeSet::from(["bricks", "f", "S", "g"]));
    let used = used(text);
    assert!(["Brick", "c", "d", "D"].iter().all(|name| used.contains(*name)), "{used:?}");
    assert!(["a", "b", "x"].iter().all(|name| !used.contains(*name)), "{used:?}");
    assert_eq!(imported("// #import a\n//\n// #import b\n\n// #import c\n").collect::<Vec<_>>(), ["a", "b"]);
}
