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
        let (bytes, mut end) = (rest.as_bytes(), 0);
        while bytes[end] != b'\n' {
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

/// The files' imports by number, found once for all shaders: the compiler is slow at comparing names. `VARYING` stands for an import that is no file's name.
pub(super) type Numbers<const N: usize> = [[usize; MOST]; N];

const VARYING: usize = usize::MAX;

pub(super) const fn numbers<const N: usize>(files: &[File; N]) -> Numbers<N> {
    let (mut numbers, mut file) = ([[VARYING; MOST]; N], 0);
    while file < N {
        let (imports, mut at) = (files[file].imports, 0);
        while at < imports.len() {
            numbers[file][at] = number_of(files, imports[at]);
            at += 1;
        }
        file += 1;
    }
    numbers
}

const fn number_of<const N: usize>(files: &[File; N], name: &str) -> usize {
    let mut number = 0;
    while number < N {
        if files[number].name.len() == name.len() && is_same(files[number].name.as_bytes(), name.as_bytes()) {
            return number;
        }
        number += 1;
    }
    VARYING
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
    pub(super) const fn new(files: &[File; N], imports: &Numbers<N>, first: &str, variant: &[(&str, &str)]) -> Self {
        let mut order = Self { numbers: [0; N], count: 0, is_begun: [false; N] };
        order.add(files, imports, number_of(files, first), variant);
        order
    }

    const fn add(&mut self, files: &[File; N], imports: &Numbers<N>, number: usize, variant: &[(&str, &str)]) {
        // A file that is begun but not in the order yet imports itself, in a circle.
        if self.is_begun[number] {
            return;
        }
        self.is_begun[number] = true;
        let mut at = 0;
        while at < files[number].imports.len() {
            if imports[number][at] == VARYING {
                self.add_variants(files, imports, files[number].imports[at], variant);
            } else {
                self.add(files, imports, imports[number][at], variant);
            }
            at += 1;
        }
        self.numbers[self.count] = number;
        self.count += 1;
    }

    /// Adds the files that a variant names for an import. If there are none, compilation fails with the import's name.
    const fn add_variants(&mut self, files: &[File; N], imports: &Numbers<N>, import: &str, variant: &[(&str, &str)]) {
        let (mut at, mut is_known) = (0, false);
        while at < variant.len() {
            if is_same(variant[at].0.as_bytes(), import.as_bytes()) {
                self.add(files, imports, number_of(files, variant[at].1), variant);
                is_known = true;
            }
            at += 1;
        }
        if !is_known {
            panic!("{}", import);
        }
    }

    /// The files' paths and texts.
    pub(super) const fn parts<const M: usize>(&self, files: &[File; N]) -> [(&'static str, &'static str); M] {
        let (mut parts, mut at) = ([("", ""); M], 0);
        while at < M {
            let file = &files[self.numbers[at]];
            parts[at] = (file.path, file.text);
            at += 1;
        }
        parts
    }
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
        let order = Order::new(&FILES, &numbers(&FILES), first, variant);
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
