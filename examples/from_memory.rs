//! Draws numbers that a program has computed, with settings as fields instead of a scene file.
//!
//! `cargo run --release --example from_memory -- [FILE.png]`

use std::path::PathBuf;

use glam::{DVec3, UVec3};
use sheetsplat::Scene;
use sheetsplat::headless::{Headless, HeadlessOptions};
use sheetsplat::image::PngDepth;
use sheetsplat::scene::{ImageSettings, TransferSettings, VolumeSource};
use sheetsplat::settings::{Ramp, Shading};
use sheetsplat::volume::Volume;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).map_or_else(|| std::env::temp_dir().join("waves.png"), PathBuf::from);

    // Values x fastest, of any type that volumes keep, here bytes; and the distances of voxels, here twice as long along z.
    let dims = UVec3::new(64, 64, 32);
    let wave = |index: u32| {
        let [x, y, z] = [index % dims.x, index / dims.x % dims.y, index / (dims.x * dims.y)].map(f64::from);
        (127.5 + 127.5 * (0.2 * x).sin() * (0.2 * y).cos() * (0.4 * z).sin()) as u8
    };
    let values: Vec<u8> = (0..dims.element_product()).map(wave).collect();
    let volume = Volume::from_values("waves", dims, DVec3::new(1.0, 1.0, 2.0), values)?;

    let mut scene = Scene::new(VolumeSource::Memory);
    scene.channels.first_mut().transfer = TransferSettings {
        color: Some(Ramp::new(vec![(0.0, DVec3::new(0.1, 0.3, 0.8)), (255.0, DVec3::new(1.0, 0.6, 0.2))])?),
        opacity: Some(Ramp::new(vec![(160.0, 0.0), (220.0, 0.6)])?),
        ..TransferSettings::default()
    };
    scene.camera = scene.camera.looking([DVec3::new(0.5, 0.8, -0.4), DVec3::Z]);
    scene.image = ImageSettings { width: 320, height: 320, background: [1.0; 4] };
    scene.shading = Shading { specular: 0.4, ..scene.shading };

    let headless = Headless::new(&HeadlessOptions::default())?;
    let rendering = headless.render_volume(volume, &scene)?;
    rendering.image.save(&path, PngDepth::Eight)?;
    println!("{}", path.display());
    Ok(())
}
