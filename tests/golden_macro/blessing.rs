//! Which goldens are rewritten, and with what.

use std::process::Command;

use sheetsplat::wgpu::{AdapterInfo, Backend, DeviceType};

use super::*;

#[test]
fn a_missing_golden_fails_and_says_how_to_make_it() {
    let folder = Folder::new();
    let failed = failure(folder.golden("new").check(&gradient()));
    assert!(matches!(failed.reason, Reason::Missing), "{failed}");
    for words in ["\"new\"", "new.png", "SHEETSPLAT_BLESS=new", "new-*"] {
        assert!(failed.to_string().contains(words), "no {words:?} in\n{failed}");
    }
    assert_eq!(folder.left(), BTreeSet::from(["new-actual.png", "new-report.txt"].map(str::to_owned)));
    assert!(!folder.golden("new").path().exists());

    let golden = folder.with("new", &gradient());
    assert_eq!(folder.left(), BTreeSet::new());
    let Outcome::Passed(comparison) = golden.check(&gradient()).unwrap() else { panic!("blessed") };
    assert_eq!((comparison.max, comparison.mean, comparison.psnr_db), ([0; 4], 0.0, f64::INFINITY));
}

#[test]
fn only_what_fails_and_is_named_is_rewritten() {
    let folder = Folder::new();
    let names = Bless::parse("a, c").unwrap();
    let [a, b, c] = ["a", "b", "c"].map(|name| folder.with(name, &gradient()).bless(names.clone()));
    let bytes = |golden: &Golden| fs::read(golden.path()).unwrap();
    let before = bytes(&a);
    assert!(matches!(a.check(&bluer(3, 200)).unwrap(), Outcome::Passed(_)));
    assert_eq!(bytes(&a), before, "what passes stays as it is");
    failure(b.check(&bluer(4, 200)));
    assert_eq!(bytes(&b), before, "not named");
    assert_eq!(c.check(&bluer(4, 200)).unwrap(), Outcome::Blessed(c.path()));
    assert_ne!(bytes(&c), before);
    assert!(matches!(c.check(&bluer(4, 200)).unwrap(), Outcome::Passed(_)));
    assert!(matches!(folder.with("all-of-it", &gradient()).check(&gradient()), Ok(Outcome::Passed(_))));
}

#[test]
fn a_golden_says_what_it_was_made_on_and_keeps_alpha() {
    let folder = Folder::new();
    let mut image = gradient();
    image.pixels[5] = [0.2, 0.1, 0.0, 0.4];
    let subject = made(image, "Grafikkarte 日本", "Treiber 1.2");
    let golden = folder.with("a", &subject);
    let opened = Picture::open(&golden.path()).unwrap();
    assert_eq!(opened.made_on, subject.made_on());
    let mut info = AdapterInfo::new(DeviceType::Cpu, Backend::Vulkan);
    (info.name, info.driver, info.driver_info) = (MESA_15.to_owned(), "llvmpipe".to_owned(), "Mesa 22".to_owned());
    let of_a_host = folder.with("c", &(&gradient(), &info));
    let made_on = MadeOn { adapter: MESA_15.to_owned(), driver: "llvmpipe Mesa 22".to_owned() };
    assert_eq!(Picture::open(&of_a_host.path()).unwrap().made_on, Some(made_on));
    let [r, g, b, a] = opened.image.pixels[5].map(|channel| (channel * 255.0).round());
    assert_eq!([r, g, b, a], [51.0, 26.0, 0.0, 102.0]);
    let opaque = folder.with("b", &gradient());
    assert_eq!(image::open(golden.path()).unwrap().color(), image::ColorType::Rgba8);
    assert_eq!(image::open(opaque.path()).unwrap().color(), image::ColorType::Rgb8);
}

#[test]
fn invalid_names_are_refused() {
    for name in ["", "all", "a/b", "a\\b", "..", ".hidden", "a,b", "a b", "ä", "a\n"] {
        let error = Golden::new(name, "goldens", "failures").unwrap_err();
        assert!(matches!(&error, GoldenError::Name { found } if found == name), "{name:?}: {error}");
    }
    for name in ["a", "head-xray", "v1.2_b", "7", "All"] {
        assert_eq!(
            Golden::new(name, "goldens", "failures").unwrap().path(),
            Path::new("goldens").join(format!("{name}.png"))
        );
    }
}

#[test]
fn the_variable_holds_all_or_names() {
    assert_eq!(Bless::parse("").unwrap(), Bless::None);
    assert_eq!(Bless::parse(" , ").unwrap(), Bless::None);
    assert_eq!(Bless::parse("all").unwrap(), Bless::All);
    assert_eq!(Bless::parse("a,all").unwrap(), Bless::All);
    let names = Bless::parse(" a,b ,").unwrap();
    assert_eq!(["a", "b", "c", ""].map(|name| names.contains(name)), [true, true, false, false]);
    for text in ["a b", "goldens/a.png", "a;b"] {
        let error = Bless::parse(text).unwrap_err().to_string();
        assert!(error.contains("SHEETSPLAT_BLESS") && error.contains(text), "{error}");
    }
}

const FOLDER: &str = "GOLDEN_TEST_FOLDER";

/// Another process of this program runs the test below with the variable set.
#[test]
fn the_variable_is_read() {
    let folder = Folder::new();
    folder.with("a", &bluer(100, 200));
    let check = |bless: Option<&str>| {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command.args(["--exact", "golden_macro::blessing::checks_in_the_given_folder", "--ignored"]);
        command
            .env(FOLDER, folder.0.path())
            .env_remove(Bless::VARIABLE)
            .envs(bless.map(|bless| (Bless::VARIABLE, bless)));
        let output = command.output().unwrap();
        let said = String::from_utf8(output.stdout).unwrap();
        assert!(said.contains("running 1 test"), "{said}");
        output.status.success()
    };
    assert!(!check(None));
    assert!(!check(Some("b")));
    assert!(!check(Some("a/b")));
    assert!(check(Some("b,a")));
    assert!(check(None), "blessed just now");
    fs::remove_file(folder.golden("a").path()).unwrap();
    assert!(check(Some("all")));
}

#[test]
#[ignore = "run by the test above"]
fn checks_in_the_given_folder() {
    let folder = PathBuf::from(std::env::var_os(FOLDER).unwrap());
    let golden = Golden::new("a", &folder, folder.join("failures")).unwrap();
    golden.check(&gradient()).unwrap();
}
