//! Imports between WGSL files, resolved when the library is compiled: a page has no comments at run time, so no imports either.

/// A file below `shaders/`.
#[derive(Clone, Copy)]
pub(super) struct File {
    /// The name by which others import it: its path without the extension.
    pub(super) name: &'static str,
    pub(super) path: &'static str,
    pub(super) text: &'static str,
    pub(super) imports: &'static [&'static str],
}

/// The maximum number of a file's imports.
pub(super) const MOST: usize = 32;

/// What a text imports in the comments at its head, and the number of these imports.
pub(super) const fn of(text: &'static str) -> ([&'static str; MOST], usize) {
    let (mut names, mut count, mut rest) = ([""; MOST], 0, text);
    while starts_with(rest, "//") {
        let mut end = 0;
        while rest.as_bytes()[end] != b'\n' {
            end += 1;
        }
        if starts_with(rest, "// #import ") {
            names[count] = rest.split_at(end).0.split_at("// #import ".len()).1;
            count += 1;
        }
        rest = rest.split_at(end + 1).1;
    }
    (names, count)
}

const fn starts_with(text: &str, start: &str) -> bool {
    text.len() >= start.len() && is_same(text.as_bytes().split_at(start.len()).0, start.as_bytes())
}

const fn is_same(a: &[u8], b: &[u8]) -> bool {
    let mut left = a.len();
    while a.len() == b.len() && left > 0 && a[left - 1] == b[left - 1] {
        left -= 1;
    }
    a.len() == b.len() && left == 0
}

/// Some of `N` files, by their numbers, in the order in which a source has them: each once, and behind those that it imports, except where these
/// import it, too.
pub(super) struct Order<const N: usize> {
    numbers: [usize; N],
    pub(super) count: usize,
    is_begun: [bool; N],
}

impl<const N: usize> Order<N> {
    /// A file and all that it needs. A variant says which files stand for imports that are no files' names.
    pub(super) const fn new(files: &[File], first: &str, variant: &[(&str, &str)]) -> Self {
        Self { numbers: [0; N], count: 0, is_begun: [false; N] }.with(files, first, variant)
    }

    /// With what an import means.
    const fn with(self, files: &[File], import: &str, variant: &[(&str, &str)]) -> Self {
        let (mut order, mut at, mut is_file) = (self, 0, true);
        while at < variant.len() {
            if is_same(variant[at].0.as_bytes(), import.as_bytes()) {
                order = order.with_file(files, variant[at].1, variant);
                is_file = false;
            }
            at += 1;
        }
        if is_file { order.with_file(files, import, variant) } else { order }
    }

    const fn with_file(self, files: &[File], name: &str, variant: &[(&str, &str)]) -> Self {
        let (mut order, number, mut at) = (self, number_of(files, name), 0);
        // A file that is begun but not in the order yet imports itself, in a circle.
        if order.is_begun[number] {
            return order;
        }
        order.is_begun[number] = true;
        while at < files[number].imports.len() {
            order = order.with(files, files[number].imports[at], variant);
            at += 1;
        }
        order.numbers[order.count] = number;
        order.count += 1;
        order
    }

    /// The files' paths and texts.
    pub(super) const fn parts<const M: usize>(&self, files: &[File]) -> [(&'static str, &'static str); M] {
        let (mut parts, mut at) = ([("", ""); M], 0);
        while at < M {
            let file = &files[self.numbers[at]];
            parts[at] = (file.path, file.text);
            at += 1;
        }
        parts
    }
}

/// The number of the file with a name. If there is none, the compiler's message says the name.
const fn number_of(files: &[File], name: &str) -> usize {
    let mut number = 0;
    while number < files.len() {
        if is_same(files[number].name.as_bytes(), name.as_bytes()) {
            return number;
        }
        number += 1;
    }
    panic!("{}", name)
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn file(name: &'static str, imports: &'static [&'static str]) -> File {
        File { name, path: name, text: name, imports }
    }

    const FILES: [File; 6] = [
        file("unused", &["low"]),
        file("top", &["left", "right", "either"]),
        file("left", &["low", "right"]),
        file("right", &["left", "low"]),
        file("low", &[]),
        file("other", &["low"]),
    ];

    fn order(first: &str, variant: &[(&str, &str)]) -> Vec<&'static str> {
        let order = Order::<6>::new(&FILES, first, variant);
        order.parts::<6>(&FILES)[..order.count].iter().map(|&(path, _)| path).collect()
    }

    #[test]
    fn imports_come_first_and_once_even_in_circles() {
        assert_eq!(order("other", &[]), ["low", "other"]);
        assert_eq!(order("left", &[]), ["low", "right", "left"]);
        assert_eq!(order("right", &[]), ["low", "left", "right"]);
        assert_eq!(order("top", &[("either", "low")]), ["low", "right", "left", "top"]);
        let both = [("either", "low"), ("either", "other"), ("neither", "unused")];
        assert_eq!(order("top", &both), ["low", "right", "left", "other", "top"]);
    }

    #[test]
    #[should_panic(expected = "either")]
    fn an_import_of_no_file_is_refused() {
        order("top", &[]);
    }

    #[test]
    fn only_the_head_of_a_file_imports() {
        let (names, count) = of("// #import shared/frame\n// Head.\n// #import b\n\n// #import c\nfn d() {}\n");
        assert_eq!(names[..count], ["shared/frame", "b"]);
        assert_eq!(of("fn d() {}\n// #import c\n").1, 0);
        assert_eq!(of("").1, 0);
    }
}
