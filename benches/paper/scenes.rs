//! The scenes of tables and pictures: `assets/paper/NAME.toml`, and the measured volumes if they exist.

use std::path::{Path, PathBuf};

use glam::{DMat3, DVec3};
use sheetsplat::scene::{Scene, VolumeSource};

/// The view along the x axis, from which the tables show the nerve.
const SIDE_ON: &str = "camera.direction=[1,0,0]";

/// The neuron's spacing, five times as large between slices; its file does not state it.
const NEURON_SPACING: DVec3 = DVec3::new(1.0, 1.0, 5.0);

/// The folder of pictures, captions and scenes.
pub(crate) fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/paper")
}

/// A scene in the folder, with some settings changed.
pub(crate) fn open(name: &str, sets: &[&str]) -> Scene {
    let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
    Scene::open(&folder().join(name).with_extension("toml"), &sets).unwrap()
}

/// A measured volume or its scene, if it exists.
fn shared(path: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared").join(path);
    path.exists().then_some(path)
}

/// The nerve's scene with a measured cell in it, if that exists.
pub(crate) fn neuron() -> Option<Scene> {
    let scene = open("nerve", &[]);
    shared("data/neuron.nrrd").map(|path| {
        let mut scene = scene.with_volume(VolumeSource::File(path));
        scene.channels.first_mut().spacing = Some(NEURON_SPACING);
        scene
    })
}

/// A scene whose camera is turned right-handed about its `up` by some degrees.
pub(crate) fn turned(scene: &Scene, degrees: f64) -> Scene {
    let mut scene = scene.clone();
    let rotation = DMat3::from_axis_angle(scene.camera.up.normalize(), degrees.to_radians());
    scene.camera.direction = rotation * scene.camera.direction;
    scene
}

/// A row of the tables: a scene, and the paper's figures for a scene of the same kind.
pub(crate) struct Row {
    pub(crate) name: &'static str,
    pub(crate) scene: Scene,
    /// The seconds in the columns of Table 2.
    pub(crate) table_2: Option<[f64; 5]>,
    /// The seconds in the columns of Table 3, which has some of the rows.
    pub(crate) table_3: Option<[f64; 5]>,
    /// The columns of Table 4.
    pub(crate) table_4: Option<[&'static str; 8]>,
}

/// The paper's rows, and measured heads if they exist; only the wanted ones, if any are named.
pub(crate) fn rows(wanted: &[&str]) -> Vec<Row> {
    let row = |name, scene, table_2, table_3, table_4| Row {
        name,
        scene,
        table_2: Some(table_2),
        table_3,
        table_4: Some(table_4),
    };
    let mut rows = vec![
        row(
            "opaque head",
            open("opaque-head", &[]),
            [54.6, 22.5, 21.2, 12.7, 10.2],
            Some([12.7, 10.5, 8.1, 6.4, 11.8]),
            ["10.6 M", "2.2 M", "20 %", "118 k", "18 %", "11.1 M", "321 k", "3 %"],
        ),
        row(
            "transp. head",
            open("transparent-head", &[]),
            [35.8, 15.8, 22.5, 14.8, 9.7],
            None,
            ["10.6 M", "1.4 M", "13 %", "413 k", "29 %", "7.1 M", "1.5 M", "21 %"],
        ),
        row(
            "nerve side-view",
            open("nerve", &[SIDE_ON]),
            [26.0, 14.3, 33.1, 12.5, 9.8],
            None,
            ["19.9 M", "1.0 M", "5 %", "114 k", "11 %", "4.0 M", "331 k", "8 %"],
        ),
        row(
            "nerve head-on",
            open("nerve", &[]),
            [17.6, 9.0, 11.3, 8.4, 4.7],
            Some([8.4, 6.9, 5.3, 4.5, 7.2]),
            ["19.9 M", "1.0 M", "5 %", "301 k", "30 %", "4.0 M", "923 k", "23 %"],
        ),
        row(
            "tomato",
            open("tomato", &[]),
            [36.4, 14.9, 23.8, 15.5, 10.3],
            Some([15.5, 12.6, 10.1, 8.2, 13.1]),
            ["4.2 M", "1.3 M", "30 %", "672 k", "51 %", "6.7 M", "2.5 M", "37 %"],
        ),
    ];
    // Four sections per kernel, as in the paper's Table 4, whose slabs were as far apart as slices.
    let coarse = open("nerve", &["splatting.slab_width=5.0"]);
    rows.push(Row {
        name: "nerve head-on, slab width=5.0",
        scene: coarse,
        table_2: None,
        table_3: None,
        table_4: None,
    });
    let measured = ["ct-head-opaque", "ct-head-semi", "mr-head-opaque"];
    rows.extend(measured.into_iter().filter_map(|name| {
        let scene = Scene::open(&shared(&format!("scenes/{name}.toml"))?, &[]).unwrap();
        Some(Row { name, scene, table_2: None, table_3: None, table_4: None })
    }));
    let unknown = wanted.iter().find(|name| rows.iter().all(|row| row.name != **name));
    assert!(unknown.is_none(), "no row {unknown:?}");
    rows.retain(|row| wanted.is_empty() || wanted.contains(&row.name));
    rows
}
