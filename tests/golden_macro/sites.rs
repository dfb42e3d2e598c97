//! The places of a test's goldens, in packages and workspaces.

use sheetsplat::golden::Site;

use super::*;

/// A workspace with a root package and a member, each with a test.
fn workspace() -> tempfile::TempDir {
    let root = tempfile::tempdir().unwrap();
    for file in ["tests/a.rs", "crates/member/tests/a.rs", "crates/member/src/draw/tests.rs"] {
        let path = root.path().join(file);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, "").unwrap();
    }
    root
}

#[test]
fn goldens_are_beside_the_source_file() {
    let root = workspace();
    let at = |path: &str| root.path().join(path).to_str().unwrap().to_owned();
    for (manifest_dir, file, golden) in [
        ("", "tests/a.rs", "tests/goldens/x.png"),
        // For a member, `file!()` is relative to the workspace.
        ("crates/member", "crates/member/tests/a.rs", "crates/member/tests/goldens/x.png"),
        ("crates/member", "crates/member/src/draw/tests.rs", "crates/member/src/draw/goldens/x.png"),
        // For a dependency of another workspace, or with other build tools, it is relative to the package, or absolute.
        ("crates/member", "tests/a.rs", "crates/member/tests/goldens/x.png"),
        ("crates/member", &at("crates/member/tests/a.rs"), "crates/member/tests/goldens/x.png"),
    ] {
        let manifest_dir = at(manifest_dir);
        let site = Site { manifest_dir: &manifest_dir, file, target_tmpdir: None };
        assert_eq!(Golden::beside("x", site).unwrap().path(), root.path().join(golden), "{manifest_dir} {file}");
    }
}

#[test]
fn a_source_file_that_is_gone_is_an_error() {
    let root = workspace();
    let site = Site { manifest_dir: root.path().to_str().unwrap(), file: "tests/gone.rs", target_tmpdir: None };
    let error = Golden::beside("x", site).unwrap_err();
    assert!(matches!(error, GoldenError::Source { .. }), "{error}");
    assert!(error.to_string().contains("tests/gone.rs") && error.to_string().contains(site.manifest_dir), "{error}");
}

#[test]
fn failures_are_left_in_the_target_folder_by_source_file() {
    let root = workspace();
    let manifest_dir = root.path().join("crates/member").to_str().unwrap().to_owned();
    let tmpdir = root.path().join("built/tmp").to_str().unwrap().to_owned();
    let file = "crates/member/tests/a.rs";
    let left_in = |target_tmpdir| {
        let golden = Golden::beside("x", Site { manifest_dir: &manifest_dir, file, target_tmpdir }).unwrap();
        failure(golden.bless(Bless::None).check(&gradient())).left_in.unwrap()
    };
    let integration_test = left_in(Some(tmpdir.as_str()));
    assert_eq!(integration_test, root.path().join("built/goldens/crates/member/tests/a"));
    assert_eq!(names(&integration_test), BTreeSet::from(["x-actual.png", "x-report.txt"].map(str::to_owned)));
    // Unit tests are not given a folder, but their programs run in it.
    let unit_test = left_in(None);
    assert_eq!(
        unit_test,
        Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("goldens").join("crates/member/tests/a")
    );
    fs::remove_dir_all(unit_test).unwrap();
}
