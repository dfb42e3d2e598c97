//! Scenes whose volume is a Zarr store at an address, served by this process.

use std::path::PathBuf;

use sheetsplat::scene::{Scene, VolumeSource};
use sheetsplat::volume::ReadOptions;

use crate::server::Server;
use crate::{fixture, values};

#[test]
fn addresses_are_no_paths() {
    let server = Server::new(fixture("zarr"));
    let address = format!("{}/files/image-0.5.zarr", server.address);
    let folder = tempfile::tempdir().unwrap();
    let text = format!(
        "[volume]\npath = \"{address}\"\nindex = 0\nspacing = [1, 1, 1]\nlabels = \"{address}/labels/cells\"\n"
    );
    let scene = Scene::parse(&text, "a", folder.path(), &[]).unwrap();
    assert_eq!(scene.channels[0].volume, VolumeSource::File(PathBuf::from(&address)));
    let volume = scene.load_volume().unwrap();
    assert_eq!((volume.values(), volume.labels().is_some()), ((&values()).into(), true));
    let written = scene.to_toml(folder.path()).unwrap();
    assert_eq!(Scene::parse(&written, "a", folder.path(), &[]).unwrap(), scene);

    // Where reading is confined, nothing is asked for.
    server.take_requests();
    let confined = ReadOptions::default().confined_to(folder.path());
    let message = scene.load_volume_with(&confined).unwrap_err().to_string();
    assert!(message.starts_with(&format!("{address}: file: found an address")), "{message}");
    assert_eq!(server.take_requests(), [""; 0]);
}
