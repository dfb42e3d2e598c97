//! Renders two volumes with the same settings and prints the difference between the pictures.
//!
//! `cargo run --release --example compare_volumes -- [FIRST SECOND]`

use sheetsplat::Scene;
use sheetsplat::golden::{Comparison, Tolerance};
use sheetsplat::headless::{Headless, HeadlessOptions};
use sheetsplat::scene::VolumeSource;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let source = |at: usize, builtin: &str| match arguments.get(at) {
        Some(path) => VolumeSource::File(path.into()),
        None => VolumeSource::Builtin(builtin.to_owned()),
    };
    let settings = ["image={width=256,height=256}".to_owned()];
    let headless = Headless::new(&HeadlessOptions::default())?;

    let first = Scene::from_volume(source(0, "head:64"), &settings)?;
    // Both use the transfer function that is chosen for the first volume.
    let first = first.explicit(&first.load_volume()?);
    let second = first.clone().with_volume(source(1, "head:48"));
    let [first, second] = [headless.render(&first)?, headless.render(&second)?];

    let comparison = Comparison::new(&first.image, &second.image, Tolerance::default())?;
    println!("{comparison}");
    Ok(())
}
