//! Consistency of the documents: every link has a target, every reference to the specification has a section, and the README is short.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The files with one of some extensions in the repository.
fn files(extensions: &[&str]) -> Vec<PathBuf> {
    fn collect(folder: &Path, extensions: &[&str], found: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            if path.is_dir() {
                if !["target", ".git", "node_modules"].contains(&name.as_str()) {
                    collect(&path, extensions, found);
                }
            } else if path.extension().is_some_and(|found| extensions.iter().any(|extension| found == *extension)) {
                found.push(path);
            }
        }
    }
    let mut found = Vec::new();
    collect(root(), extensions, &mut found);
    found.sort();
    found
}

/// The targets of a document's links, outside code blocks.
fn links(text: &str) -> Vec<String> {
    let mut is_code = false;
    let mut found = Vec::new();
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            is_code = !is_code;
        } else if !is_code {
            found.extend(
                line.split("](").skip(1).filter_map(|rest| rest.split_once(')')).map(|(target, _)| target.to_owned()),
            );
        }
    }
    found
}

/// A heading's anchor on a forge.
fn anchor(heading: &str) -> String {
    let kept = heading.trim().to_lowercase();
    kept.chars()
        .filter(|c| c.is_alphanumeric() || *c == ' ' || *c == '-' || *c == '_')
        .map(|c| if c == ' ' { '-' } else { c })
        .collect()
}

fn anchors(document: &Path) -> BTreeSet<String> {
    let text = std::fs::read_to_string(document).unwrap();
    text.lines().filter(|line| line.starts_with('#')).map(|line| anchor(line.trim_start_matches('#'))).collect()
}

#[test]
fn every_link_leads_somewhere() {
    let documents = files(&["md"]);
    assert!(documents.len() > 10, "{documents:?}");
    let mut broken = Vec::new();
    let mut checked = 0;
    for document in &documents {
        let text = std::fs::read_to_string(document).unwrap();
        for link in links(&text).iter().filter(|link| !link.contains("://") && !link.starts_with("mailto:")) {
            checked += 1;
            let (path, fragment) = link.split_once('#').unwrap_or((link, ""));
            let target = if path.is_empty() { document.clone() } else { document.parent().unwrap().join(path) };
            let leads = target.exists()
                && (fragment.is_empty()
                    || target.extension().is_none_or(|md| md != "md")
                    || anchors(&target).contains(fragment));
            if !leads {
                broken.push(format!("{}: {link}", document.display()));
            }
        }
    }
    assert!(checked > 50, "{checked} links were found");
    assert!(broken.is_empty(), "{} broken links:\n{}", broken.len(), broken.join("\n"));
}

#[test]
fn every_reference_to_the_specification_has_a_section_there() {
    let text = std::fs::read_to_string(root().join("docs/spec.md")).unwrap();
    let sections: BTreeSet<u32> =
        text.lines().filter_map(|line| line.strip_prefix("## ")?.split('.').next()?.parse().ok()).collect();
    let mut references = 0;
    let mut missing = Vec::new();
    for file in files(&["rs", "wgsl"]).iter().filter(|file| !file.ends_with("tests/house/docs.rs")) {
        let text = std::fs::read_to_string(file).unwrap();
        for rest in text.split("SPEC §").skip(1) {
            // This also covers "SPEC §§4–6".
            let digits: String = rest.trim_start_matches('§').chars().take_while(char::is_ascii_digit).collect();
            references += 1;
            if !digits.parse().is_ok_and(|section: u32| sections.contains(&section)) {
                missing.push(format!("{}: SPEC §{}", file.display(), rest.lines().next().unwrap_or_default()));
            }
        }
    }
    assert!(references > 50, "{references} references were found");
    assert!(missing.is_empty(), "{} without a section:\n{}", missing.len(), missing.join("\n"));
}

#[test]
fn files_that_the_documents_name_exist() {
    let mut missing = Vec::new();
    let mut names = 0;
    for document in ["docs/architecture.md", "docs/paper.md", "docs/accuracy.md", "CONTRIBUTING.md"] {
        let text = std::fs::read_to_string(root().join(document)).unwrap();
        for name in text.split('`').skip(1).step_by(2) {
            let is_file = ["src/", "shaders/", "tests/", "benches/"].iter().any(|folder| name.starts_with(folder));
            if is_file && !name.contains(['*', ' ']) && !name.contains("NAME") {
                names += 1;
                if !root().join(name).exists() {
                    missing.push(format!("{document}: {name}"));
                }
            }
        }
    }
    assert!(names > 50, "{names} files are named");
    assert!(missing.is_empty(), "{missing:?}");
}

#[test]
fn the_readme_is_short() {
    let text = std::fs::read_to_string(root().join("README.md")).unwrap();
    assert!(text.lines().count() <= 200, "{} lines", text.lines().count());
}

/// A file that a reader can keep in mind.
#[test]
fn no_source_file_has_more_than_500_lines() {
    let lines = |path: &PathBuf| std::fs::read_to_string(path).unwrap().lines().count();
    let files = files(&["rs", "wgsl"]);
    assert!(files.len() > 200, "{}", files.len());
    let long: Vec<_> = files.iter().filter(|path| lines(path) > 500).collect();
    assert!(long.is_empty(), "{long:?}");
}

/// `benches/history.md` describes the keys.
#[test]
fn every_line_of_the_history_is_a_figure() {
    let text = std::fs::read_to_string(root().join("benches/history.jsonl")).unwrap();
    assert!(text.lines().count() > 0);
    for line in text.lines() {
        let figure: serde_json::Map<String, serde_json::Value> = serde_json::from_str(line).unwrap();
        let found: BTreeSet<&str> = figure.keys().map(String::as_str).collect();
        let expected = ["date", "commit", "machine", "scene", "program", "settings", "quantity", "value"];
        assert_eq!(found, BTreeSet::from(expected), "{line}");
        assert!(figure["value"].as_f64().is_some_and(|value| value > 0.0 && value.is_finite()), "{line}");
    }
}
