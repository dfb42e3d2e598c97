//! Renders two pictures of a builtin volume to PNG files, without a window.
//!
//! `cargo run --release --example headless -- [FOLDER]`

use std::path::{Path, PathBuf};

use sheetsplat::Scene;
use sheetsplat::headless::{Headless, HeadlessOptions};
use sheetsplat::image::PngDepth;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args().nth(1).map_or_else(std::env::temp_dir, PathBuf::from);
    let text = "
        volume.builtin = 'tomato:96'
        image = { width = 320, height = 320, background = [1, 1, 1, 1] }
        clip.planes = [[0, 1, 0, 0]]
        splatting.compositing = 'exponential'
    ";
    let scene = Scene::parse(text, "headless", Path::new("."), &[])?;
    let headless = Headless::new(&HeadlessOptions::default())?;

    // A view keeps what the next picture can reuse; only the camera changes here.
    let mut view = headless.view(scene.load_volume()?, &scene)?;
    for name in ["first.png", "turned.png"] {
        let rendering = headless.draw(&mut view)?;
        let path = folder.join(name);
        rendering.image.save(&path, PngDepth::Eight)?;
        println!("{}: {} kernel sections drawn", path.display(), rendering.stats.counts.sections_rasterized);
        view.turn(30.0)?;
    }
    Ok(())
}
