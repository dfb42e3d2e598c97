//! Circles of files: files that import from one another, directly or through others, so that none can be read without the rest.
//!
//! A name is imported from the file that defines it, not from one that re-exports it. Tests at the end of a file do not count.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// A module's path in its crate: `["zarr", "array"]`; empty for the root.
type Module = Vec<String>;

/// The words of a path: `["super", "array", "Held"]`.
type Words = Vec<String>;

/// The maximum number of re-exports that a name is followed through.
const MAX_DEPTH: u32 = 8;

/// The names in a file.
struct File {
    /// The paths after `use`, and the name that each gets.
    imports: Vec<(Words, String)>,
    /// All other paths of at least two words.
    paths: Vec<Words>,
    /// The macros that the file defines.
    macros: Vec<String>,
}

/// The files of a crate by their modules.
pub(super) struct Files(BTreeMap<Module, File>);

impl Files {
    /// Reads the files in a folder with a crate's root, without those in `bin`.
    pub(super) fn read(root: &Path) -> Self {
        fn collect(folder: &Path, module: &[String], found: &mut BTreeMap<Module, File>) {
            for entry in fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                let stem = path.file_stem().unwrap().to_string_lossy().into_owned();
                let is_own = ["mod", "lib", "main"].contains(&stem.as_str());
                let inner = if is_own { module.to_vec() } else { [module, &[stem]].concat() };
                if path.is_dir() {
                    collect(&path, &inner, found);
                } else if path.extension().is_some_and(|extension| extension == "rs") {
                    found.insert(inner, File::parse(&fs::read_to_string(path).unwrap()));
                }
            }
        }
        let mut found = BTreeMap::new();
        collect(root, &[], &mut found);
        found.retain(|module, _| module.first().is_none_or(|first| first != "bin"));
        Self(found)
    }

    /// Files of these names and texts.
    pub(super) fn of_texts(texts: &[(&str, &str)]) -> Self {
        let module = |name: &str| name.split('/').filter(|word| *word != "lib").map(str::to_owned).collect();
        Self(texts.iter().map(|(name, text)| (module(name), File::parse(text))).collect())
    }

    pub(super) fn count(&self) -> usize {
        self.0.len()
    }

    /// The circles of at least two files, each with the files of the circle that a file imports from.
    pub(super) fn circles(&self) -> Vec<BTreeMap<String, BTreeSet<String>>> {
        let edges: BTreeMap<&Module, BTreeSet<Module>> = self.0.keys().map(|from| (from, self.used(from))).collect();
        let reached: BTreeMap<&Module, BTreeSet<&Module>> =
            edges.keys().map(|from| (*from, reached(&edges, from))).collect();
        let name = |module: &Module| if module.is_empty() { "lib".to_owned() } else { module.join("/") };
        let mut circles = Vec::new();
        for (from, others) in &reached {
            let is_inside = |other: &Module| others.contains(other) && reached[other].contains(from);
            // A circle is told once, by its first file.
            if is_inside(from) && reached.keys().find(|other| is_inside(other)) == Some(from) {
                let members = edges.iter().filter(|(other, _)| is_inside(other));
                let inner = |used: &BTreeSet<Module>| used.iter().filter(|other| is_inside(other)).map(name).collect();
                circles.push(members.map(|(other, used)| (name(other), inner(used))).collect());
            }
        }
        circles
    }

    /// The other files that a file uses.
    fn used(&self, from: &Module) -> BTreeSet<Module> {
        let File { imports, paths, .. } = &self.0[from];
        let all = imports.iter().map(|(path, _)| path).chain(paths);
        let named = all.filter(|path| path.iter().any(|word| word != "super"));
        named.filter_map(|path| Some(self.resolve(from, path, 0)?.0)).filter(|other| other != from).collect()
    }

    /// The module that defines what a path in a file names, and the words that are no modules; `None` outside the crate.
    fn resolve<'a>(&'a self, from: &[String], path: &'a [String], depth: u32) -> Option<(Module, &'a [String])> {
        match path.first()?.as_str() {
            "crate" => self.within(Vec::new(), &path[1..], depth),
            "self" => self.within(from.to_vec(), &path[1..], depth),
            "super" => {
                let up = path.iter().take_while(|word| *word == "super").count();
                self.within(from[..from.len().checked_sub(up)?].to_vec(), &path[up..], depth)
            }
            first => {
                let is_child = self.0.contains_key(&[from, &[first.to_owned()]].concat());
                let is_known = is_child || self.0[from].imports.iter().any(|(_, name)| name == first);
                if is_known { self.within(from.to_vec(), path, depth) } else { None }
            }
        }
    }

    /// As [`Self::resolve`], for words that begin in a module.
    fn within<'a>(&'a self, module: Module, words: &'a [String], depth: u32) -> Option<(Module, &'a [String])> {
        let Some((word, rest)) = words.split_first() else { return Some((module, words)) };
        if depth > MAX_DEPTH {
            return None;
        }
        let child = [module.as_slice(), std::slice::from_ref(word)].concat();
        if self.0.contains_key(&child) {
            return self.within(child, rest, depth);
        }
        let mut imported = self.0[&module].imports.iter().filter(|(_, name)| name == word).peekable();
        if imported.peek().is_some() {
            let mut defined = imported.filter_map(|(path, _)| self.resolve(&module, path, depth + 1));
            return match defined.next()? {
                (module, []) => self.within(module, rest, depth + 1),
                found => Some(found),
            };
        }
        // Exported macros are named from the root.
        let by_macro = self.0.iter().find(|(_, file)| module.is_empty() && file.macros.contains(word));
        Some((by_macro.map_or(module, |(other, _)| other.clone()), words))
    }
}

/// The files that a file uses, directly or through others.
fn reached<'a>(edges: &'a BTreeMap<&Module, BTreeSet<Module>>, from: &Module) -> BTreeSet<&'a Module> {
    let (mut seen, mut next) = (BTreeSet::new(), vec![from]);
    while let Some(module) = next.pop() {
        let new: Vec<&Module> = edges[module].iter().filter(|other| seen.insert(*other)).collect();
        next.extend(new);
    }
    seen
}

impl File {
    fn parse(text: &str) -> Self {
        let is_test = |line: &str| line == "#[cfg(test)]" || line.starts_with("#[cfg(all(test");
        let mut lines = text.lines().take_while(|line| !is_test(line)).map(code_of);
        let (mut imports, mut macros, mut others, mut inline_end) = (Vec::new(), Vec::new(), String::new(), None);
        while let Some(line) = lines.next() {
            let indent = &line[..line.len() - line.trim_start().len()];
            let statement = without_visibility(line.trim_start());
            if statement.starts_with("mod ") && statement.ends_with('{') {
                inline_end = Some(format!("{indent}}}"));
            } else if inline_end.as_ref() == Some(&line) {
                inline_end = None;
            }
            // In a module within the file, `super` is the file.
            let is_inline = inline_end.is_some();
            let outer = |line: &str| if is_inline { without_super(line) } else { line.to_owned() };
            if let Some(tree) = statement.strip_prefix("use ") {
                let mut tree = outer(tree);
                while !tree.contains(';') {
                    let Some(next) = lines.next() else { break };
                    tree.push_str(&next);
                }
                expand(&[], tree.split(';').next().unwrap_or_default(), &mut imports);
            } else {
                macros
                    .extend(statement.strip_prefix("macro_rules! ").map(|rest| rest.trim_end_matches(" {").to_owned()));
                others.push_str(&outer(&line));
                others.push('\n');
            }
        }
        Self { imports, paths: paths(&others), macros }
    }
}

/// A line without its comment and paths of visibility.
fn code_of(line: &str) -> String {
    let code = line.split("//").next().unwrap_or_default().trim_end();
    let Some((before, (_, after))) =
        code.split_once("pub(in ").map(|(before, rest)| (before, rest.split_once(')').unwrap_or_default()))
    else {
        return code.to_owned();
    };
    format!("{before}pub{after}")
}

fn without_visibility(statement: &str) -> &str {
    let visible = ["pub(crate) ", "pub(super) ", "pub "];
    visible.iter().find_map(|word| statement.strip_prefix(word)).unwrap_or(statement)
}

/// A line with one `super` less in each path.
fn without_super(line: &str) -> String {
    line.split("super::super::").map(|part| part.replace("super::", "self::")).collect::<Vec<_>>().join("super::")
}

/// The paths of a tree of imports, and their names.
fn expand(prefix: &[String], tree: &str, found: &mut Vec<(Words, String)>) {
    let joined = |path: &str| -> Words {
        let words = path.split("::").map(|word| word.trim().to_owned());
        prefix.iter().cloned().chain(words).collect()
    };
    if let Some((head, list)) = tree.trim().split_once('{') {
        let head = head.trim().strip_suffix("::").map_or_else(|| prefix.to_vec(), joined);
        let list = &list[..list.rfind('}').unwrap_or(list.len())];
        let (mut depth, mut start) = (0, 0);
        for (at, character) in list.char_indices().chain([(list.len(), ',')]) {
            match character {
                '{' => depth += 1,
                '}' => depth -= 1,
                ',' if depth == 0 => {
                    expand(&head, &list[start..at], found);
                    start = at + 1;
                }
                _ => {}
            }
        }
    } else if !tree.trim().is_empty() {
        let (path, alias) = tree.trim().split_once(" as ").map_or((tree, None), |(path, alias)| (path, Some(alias)));
        let mut path = joined(path);
        if path.last().is_some_and(|last| last == "self") {
            path.pop();
        }
        let name = alias.map_or_else(|| path.last().cloned().unwrap_or_default(), |alias| alias.trim().to_owned());
        // An import of one word is another crate.
        if path.len() > 1 {
            found.push((path, name));
        }
    }
}

/// The paths of at least two words in some code.
fn paths(code: &str) -> Vec<Words> {
    let is_in_path = |c: char| c.is_alphanumeric() || c == '_' || c == ':';
    let runs = code.split(|c| !is_in_path(c)).filter(|run| run.contains("::"));
    let words = |run: &str| {
        run.trim_end_matches(':').split("::").map(str::to_owned).take_while(|word| !word.is_empty()).collect()
    };
    runs.map(words).filter(|path: &Words| path.len() > 1).collect()
}
