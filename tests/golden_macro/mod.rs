//! Golden images as other projects' tests use them. Needs no GPU.

mod blessing;
mod comparing;
mod sites;

use std::collections::BTreeSet;
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use sheetsplat::assert_golden;
use sheetsplat::golden::{Bless, Failure, Golden, GoldenError, MadeOn, Outcome, Picture, Reason, Subject, Tolerance};
use sheetsplat::headless::Rendering;
use sheetsplat::image::Image;
use sheetsplat::stats::Stats;

/// The name of the golden of this program that is of no scene.
pub(crate) const GRADIENT: &str = "gradient";

/// A picture of 20×10 opaque pixels with a gradient.
fn gradient() -> Image {
    let pixel = |at: u16| [f32::from(at % 20) / 19.0, f32::from(at / 20) / 9.0, 0.25, 1.0];
    Image { width: 20, height: 10, pixels: (0..200).map(pixel).collect() }
}

/// The gradient with the first `pixels` brighter in blue by some steps of 255.
fn bluer(steps: u8, pixels: usize) -> Image {
    let mut image = gradient();
    for pixel in &mut image.pixels[..pixels] {
        pixel[2] += f32::from(steps) / 255.0;
    }
    image
}

/// A picture by another renderer, with its adapter.
struct Made(Image, MadeOn);

impl Subject for Made {
    fn image(&self) -> &Image {
        &self.0
    }

    fn made_on(&self) -> Option<MadeOn> {
        Some(self.1.clone())
    }
}

fn made(image: Image, adapter: &str, driver: &str) -> Made {
    Made(image, MadeOn { adapter: adapter.to_owned(), driver: driver.to_owned() })
}

/// A temporary folder with a golden `NAME.png`, and a folder `failures`.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    /// A golden that blesses nothing, whatever the environment says.
    fn golden(&self, name: &str) -> Golden {
        Golden::new(name, self.0.path(), self.failures()).unwrap().bless(Bless::None)
    }

    /// A golden that exists.
    fn with(&self, name: &str, subject: &impl Subject) -> Golden {
        let golden = self.golden(name);
        assert_eq!(golden.clone().bless(Bless::All).check(subject).unwrap(), Outcome::Blessed(golden.path()));
        golden
    }

    fn failures(&self) -> PathBuf {
        self.0.path().join("failures")
    }

    /// The names of the files that failures left.
    fn left(&self) -> BTreeSet<String> {
        names(&self.failures())
    }
}

/// The names of the files in a folder; empty if it does not exist.
fn names(folder: &Path) -> BTreeSet<String> {
    let Ok(entries) = fs::read_dir(folder) else { return BTreeSet::new() };
    entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
}

/// The failure of a check.
fn failure(result: Result<Outcome, GoldenError>) -> Failure {
    match result {
        Err(GoldenError::Failure(failure)) => *failure,
        other => panic!("{other:?}"),
    }
}

/// The message of a test that panics.
fn complaint(test: impl FnOnce()) -> String {
    *catch_unwind(AssertUnwindSafe(test)).unwrap_err().downcast::<String>().unwrap()
}

#[test]
fn the_macro_compares_with_the_file_beside_the_test() {
    assert_golden!(GRADIENT, gradient());
    if Bless::from_env().unwrap().contains(GRADIENT) {
        // Blessing would also rewrite the goldens that must fail below.
        return;
    }
    assert_golden!(GRADIENT, &bluer(3, 200));
    assert_golden!(GRADIENT, bluer(80, 2), Tolerance::new(0, 0.01).unwrap());

    let said = complaint(|| assert_golden!(GRADIENT, bluer(4, 3)));
    let beside = Path::new("tests").join("golden_macro").join("goldens").join("gradient.png");
    assert!(said.contains(beside.to_str().unwrap()), "{said}");
    assert!(said.contains("3 of 20×10 pixels (1.500 %) differ by more than 3 of 255"), "{said}");
    assert!(said.contains("SHEETSPLAT_BLESS=gradient"), "{said}");
    let left =
        Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("goldens").join("tests").join("golden_macro").join("mod");
    let files = ["gradient-actual.png", "gradient-difference.png", "gradient-report.txt"].map(str::to_owned);
    assert_eq!(names(&left), BTreeSet::from(files));
    assert!(said.contains(left.to_str().unwrap()), "{said}");

    assert_golden!(GRADIENT, gradient());
    assert_eq!(names(&left), BTreeSet::new(), "a success removes what a failure left");

    let said = complaint(|| assert_golden!("no/name", gradient()));
    assert!(said.contains("no/name") && said.contains("letters"), "{said}");
}

#[test]
fn a_failure_leaves_the_image_where_it_differs_and_a_report() {
    let folder = Folder::new();
    let golden = folder.with("a", &gradient());
    let actual = bluer(51, 1);
    let failed = failure(golden.check(&actual));
    assert_eq!(folder.left(), BTreeSet::from(["a-actual.png", "a-difference.png", "a-report.txt"].map(str::to_owned)));
    let opened = Picture::open(&folder.failures().join("a-actual.png")).unwrap().image;
    assert!(
        opened.pixels.iter().zip(&actual.pixels).all(|(a, b)| (0..4).all(|i| (a[i] - b[i]).abs() < 0.5 / 255.0 + 1e-6))
    );
    let difference = Picture::open(&folder.failures().join("a-difference.png")).unwrap().image;
    assert_eq!((difference.width, difference.height), (20, 10));
    assert_eq!(difference.pixels[0][0], 1.0, "red beyond the tolerance");
    assert!(difference.pixels[1..].iter().all(|&pixel| pixel == [0.0, 0.0, 0.0, 1.0]));
    let report = fs::read_to_string(folder.failures().join("a-report.txt")).unwrap();
    assert_eq!(report, format!("{failed}\n"));

    failure(folder.golden("b").check(&actual));
    golden.check(&gradient()).unwrap();
    let left = BTreeSet::from(["b-actual.png", "b-report.txt"].map(str::to_owned));
    assert_eq!(folder.left(), left, "only its own are removed");
}

/// An error in writing the failure's files does not hide why the image fails.
#[test]
fn a_failure_that_leaves_nothing_still_says_why() {
    let folder = Folder::new();
    let golden = folder.with("a", &gradient()).failures(folder.0.path().join("a.png"));
    let failed = failure(golden.check(&bluer(9, 200)));
    assert!(failed.left_in.is_err());
    let said = failed.to_string();
    assert!(said.contains("differ by more than 3") && said.contains("nothing left: "), "{said}");
}

#[test]
fn an_invalid_image_neither_passes_nor_is_blessed() {
    let folder = Folder::new();
    let golden = folder.with("a", &gradient()).bless(Bless::All);
    let bytes = fs::read(golden.path()).unwrap();
    let mut nan = gradient();
    nan.pixels[47][1] = f32::NAN;
    let short = Image { height: 11, ..gradient() };
    let empty = Image { width: 0, height: 10, pixels: Vec::new() };
    for (image, words) in [(nan, "NaN at x 7, y 2"), (short, "200 pixels for 20×11"), (empty, "0 pixels for 0×10")] {
        let error = golden.check(&image).unwrap_err();
        assert!(matches!(error, GoldenError::Subject { .. }), "{error}");
        assert!(error.to_string().contains(words) && error.to_string().contains("\"a\""), "{error}");
    }
    assert_eq!(fs::read(golden.path()).unwrap(), bytes);
    assert_eq!(folder.left(), BTreeSet::new());
}

#[test]
fn another_size_fails() {
    let folder = Folder::new();
    let golden = folder.with("a", &gradient());
    let turned = Image { width: 10, height: 20, ..gradient() };
    let failed = failure(golden.check(&turned));
    assert!(matches!(failed.reason, Reason::Incomparable(_)), "{failed}");
    assert!(failed.to_string().contains("10×20") && failed.to_string().contains("20×10"), "{failed}");
    assert_eq!(folder.left(), BTreeSet::from(["a-actual.png", "a-report.txt"].map(str::to_owned)));
}

#[test]
fn a_golden_that_is_no_image_fails() {
    let folder = Folder::new();
    let golden = folder.golden("a");
    fs::write(golden.path(), "not a PNG").unwrap();
    let failed = failure(golden.check(&gradient()));
    assert!(matches!(failed.reason, Reason::Unreadable(_)), "{failed}");
    assert!(failed.to_string().contains("a.png"), "{failed}");
    golden.clone().bless(Bless::All).check(&gradient()).unwrap();
    assert!(matches!(golden.check(&gradient()).unwrap(), Outcome::Passed(_)));
}

const MESA_15: &str = "llvmpipe (LLVM 15.0.6, 256 bits)";
const MESA_19: &str = "llvmpipe (LLVM 19.1.7, 512 bits)";

/// A picture of the native backend is exactly its golden, unless the test allows a tolerance; and says what made it.
#[test]
fn the_native_backend_is_compared_exactly() {
    let folder = Folder::new();
    let rendering = |image: Image, backend: &str| {
        let mut stats = Stats::default();
        (stats.backend, stats.adapter, stats.driver) = (backend.to_owned(), "CPU".to_owned(), "avx2".to_owned());
        Rendering { image, stats }
    };
    let golden = folder.with("head", &rendering(gradient(), "cpu"));
    golden.check(&rendering(gradient(), "cpu")).unwrap();
    let error = golden.check(&rendering(bluer(1, 1), "cpu")).unwrap_err().to_string();
    for words in ["differ by more than 0 of 255", "cpu backend"] {
        assert!(error.contains(words), "no {words:?} in {error}");
    }
    assert!(!error.contains("avx2"), "{error}");
    golden.clone().tolerance(Tolerance::new(1, 0.0).unwrap()).check(&rendering(bluer(1, 1), "cpu")).unwrap();
    // Another backend is another adapter.
    golden.check(&rendering(bluer(15, 1), "reference")).unwrap();
}

#[test]
fn another_adapter_is_compared_with_the_widest_tolerance() {
    let folder = Folder::new();
    let golden = folder.with("a", &made(gradient(), MESA_15, "Mesa 22"));
    let check = |image: Image, adapter: &str| golden.check(&made(image, adapter, "driver 2"));
    // 2 of 200 pixels are 1 %.
    for wider in [bluer(16, 200), bluer(200, 2)] {
        assert!(matches!(check(wider.clone(), "Voodoo").unwrap(), Outcome::Passed(_)));
        assert!(matches!(golden.check(&wider).unwrap(), Outcome::Passed(_)), "an unknown adapter is another");
        let failed = failure(check(wider.clone(), MESA_15));
        assert!(!failed.to_string().contains("widest"), "{failed}");
        failure(check(wider, MESA_19));
    }
    for too_wide in [bluer(17, 3), bluer(200, 3)] {
        let said = failure(check(too_wide, "Voodoo")).to_string();
        for words in ["3 of 20×10", "16 of 255", "1.000 %", "widest", MESA_15, "Mesa 22", "Voodoo", "driver 2"] {
            assert!(said.contains(words), "no {words:?} in\n{said}");
        }
    }
}

#[test]
fn images_of_unknown_origin_use_the_tests_tolerance() {
    let folder = Folder::new();
    let golden = folder.with("a", &gradient());
    assert_eq!(Picture::open(&golden.path()).unwrap().made_on, None);
    failure(golden.check(&bluer(4, 200)));
    assert!(matches!(golden.check(&made(bluer(4, 200), MESA_15, "")).unwrap(), Outcome::Passed(_)));
}
