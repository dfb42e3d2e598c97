//! Light sheets (SPEC §14): their definition, the stage against it, and pictures in their light.
//! `cargo test --test cpu light:: -- --nocapture` prints the measurements.

mod pictures;
mod presets;
mod sheets;
mod streams;
mod twin;

use std::sync::Arc;

use glam::DVec3;
use sheetsplat::Scene;
use sheetsplat::internals::light::{KeptLight, Lights};
use sheetsplat::volume::Volume;

/// The light sheets of a scene that states its camera.
fn lights(volume: &Volume, scene: &Scene) -> Arc<Lights> {
    let transfer = [scene.channels[0].transfer.resolve(volume)];
    KeptLight::default().lights((volume, &transfer), scene, &scene.camera).unwrap().unwrap()
}

/// A point in voxel coordinates, in `unit`s from the grid's centre.
fn in_units(volume: &Volume, voxel: DVec3) -> DVec3 {
    (voxel - volume.grid().center()) * volume.grid().aspect()
}

/// The result of a computation on some number of threads.
fn on_threads<T: Send>(threads: usize, give: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(give)
}
