//! Finds the point of a volume that is visible at a pixel.
//!
//! `cargo run --release --example picking -- [X Y]`

use std::path::Path;

use sheetsplat::Scene;
use sheetsplat::headless::{Headless, HeadlessOptions};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<u32> = std::env::args().skip(1).map(|text| text.parse()).collect::<Result<_, _>>()?;
    let pixel = if let [x, y] = arguments[..] { [x, y] } else { [128, 128] };
    let text = "volume.builtin = 'head:96'\nimage = { width = 256, height = 256 }";
    let scene = Scene::parse(text, "picking", Path::new("."), &[])?;
    let headless = Headless::new(&HeadlessOptions::default())?;
    let mut view = headless.view(scene.load_volume()?, &scene)?;

    // A pixel's first hit is where its opacity reaches one half.
    view.set_first_hit(Some(0.5))?;
    headless.draw(&mut view)?;
    match headless.pick(&view, pixel)? {
        Some(pick) => println!("pixel {pixel:?} shows the point {:.1} at depth {:.1}", pick.position, pick.depth),
        None => println!("pixel {pixel:?} shows the background"),
    }
    Ok(())
}
