//! A test with a golden image, like one in a project's `tests/` folder.
//!
//! `SHEETSPLAT_BLESS=all cargo run --release --example golden_test` makes the golden, and every later run compares with it.

use sheetsplat::Scene;
use sheetsplat::golden::{Golden, Outcome};
use sheetsplat::headless::{Headless, HeadlessOptions};
use sheetsplat::scene::VolumeSource;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args().nth(1).map_or_else(std::env::temp_dir, Into::into);
    let headless = Headless::new(&HeadlessOptions::default())?;
    let settings = ["image={width=96,height=96}".to_owned()];
    let scene = Scene::from_volume(VolumeSource::Builtin("head:48".to_owned()), &settings)?;
    let rendering = headless.render(&scene)?;

    // In a test, `assert_golden!("head", rendering)` finds the folder `goldens` beside the test and reads `SHEETSPLAT_BLESS` itself.
    let golden = Golden::new("head", &folder, folder.join("failures"))?.bless(sheetsplat::golden::Bless::from_env()?);
    match golden.check(&rendering)? {
        Outcome::Passed(comparison) => println!("{comparison}"),
        Outcome::Blessed(path) => println!("made {}", path.display()),
    }
    Ok(())
}
