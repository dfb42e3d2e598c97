//! Where the camera stands if nothing states it (SPEC §2), by what files state, and the sphere that turning cameras take.

use std::fmt::Write as _;

use crate::*;

/// The direction and up of a file's camera by `info`, and the line of text that says why.
fn eye(folder: &Folder, arguments: &str) -> ([[f64; 3]; 2], String) {
    let json = folder.run(&format!("info {arguments} --json"));
    assert_eq!(json.code, Some(0), "{}", json.stderr);
    let json: Value = serde_json::from_str(&json.stdout).unwrap();
    let vector = |key: &str| [0, 1, 2].map(|at| json["frame"][key][at].as_f64().unwrap());
    let text = folder.run(&format!("info {arguments}")).stdout;
    let line = text.lines().find_map(|line| line.strip_prefix("eye          ")).unwrap();
    assert!(line.starts_with(json["eye"].as_str().unwrap()), "{line}\n{json}");
    ([vector("direction"), vector("up")], line.to_owned())
}

/// Writes an NRRD file of values that no preset fits, with further lines of its header.
fn write(folder: &Folder, dims: [usize; 3], geometry: &str) {
    let [nx, ny, nz] = dims;
    let mut header = String::new();
    writeln!(header, "NRRD0004\ntype: uchar\ndimension: 3\nsizes: {nx} {ny} {nz}\nencoding: raw\n{geometry}\n")
        .unwrap();
    let values = (0..nx * ny * nz).map(|at| (at * 37 % 251) as u8);
    folder.write("a.nrrd", header.into_bytes().into_iter().chain(values).collect::<Vec<u8>>());
}

/// SPEC §2: minus `e = (n·cos β + t·sin β)·cos γ + up·sin γ`, `t = up × n`.
fn direction([nx, ny, nz]: [f64; 3], [ux, uy, uz]: [f64; 3], [beta, gamma]: [f64; 2]) -> [f64; 3] {
    let t = [uy * nz - uz * ny, uz * nx - ux * nz, ux * ny - uy * nx];
    let ([n, up], [beta, gamma]) = ([[nx, ny, nz], [ux, uy, uz]], [beta, gamma].map(f64::to_radians));
    [0, 1, 2].map(|at| -((n[at] * beta.cos() + t[at] * beta.sin()) * gamma.cos() + up[at] * gamma.sin()))
}

#[track_caller]
fn assert_eye(folder: &Folder, arguments: &str, expected: [[f64; 3]; 2], why: &str) {
    let (found, line) = eye(folder, arguments);
    let difference = found.as_flattened().iter().zip(expected.as_flattened()).map(|(a, b)| (a - b).abs());
    assert!(difference.fold(0.0, f64::max) < 1e-9, "{found:?} {expected:?}");
    assert!(line.contains(why), "{line}");
}

const X: [f64; 3] = [1.0, 0.0, 0.0];
const Y: [f64; 3] = [0.0, 1.0, 0.0];
const Z: [f64; 3] = [0.0, 0.0, 1.0];

/// The rules in their order: each file follows the first one that it meets.
#[test]
fn files_tell_where_the_camera_stands() {
    let minus = |vector: [f64; 3]| vector.map(|part| -part);
    let folder = Folder::new();
    let lps = "space: left-posterior-superior\nspace directions: (1,0,0) (0,1,0) (0,0,1)";
    let um = "spacings: 1 1 1\nunits: \"um\" \"um\" \"um\"";
    let plain = "spacings: 1 1 1";

    write(&folder, [9, 8, 2], lps);
    assert_eye(&folder, "a.nrrd", [minus(Z), Y], "along z, which has one or two samples");
    write(&folder, [1, 8, 9], um);
    assert_eye(&folder, "a.nrrd", [minus(X), Z], "along x");

    write(&folder, [9, 8, 3], lps);
    let front = |anterior, superior| [direction(anterior, superior, [20.0, 10.0]), superior];
    assert_eye(&folder, "a.nrrd", front(minus(Y), Z), "in front of the patient, as the file states");
    // Sagittal slices from the patient's left: x runs to the back, y to the feet, z to the right.
    let sagittal = "space: RAS\nspace directions: (0,-1,0) (0,0,-1) (1,0,0)\nspace units: \"um\" \"um\" \"um\"";
    write(&folder, [9, 8, 3], sagittal);
    assert_eye(&folder, "a.nrrd", front(minus(X), minus(Y)), "as the file states");

    write(&folder, [9, 8, 3], um);
    assert_eye(&folder, "a.nrrd", [Z, minus(Y)], "microscope");
    write(&folder, [9, 8, 3], plain);
    assert_eye(&folder, "a.nrrd --preset confocal", [Z, minus(Y)], "microscope");

    let aside = |side, up| [direction(side, up, [30.0, 20.0]), up];
    assert_eye(&folder, "a.nrrd", aside(Z, Y), "the extent along z is the smallest by half");
    // In a space that is not a patient's, and by lengths.
    write(&folder, [8, 8, 8], "space: 3D-right-handed\nspace directions: (4,0,0) (0,2,0) (0,0,4)");
    assert_eye(&folder, "a.nrrd", aside(Y, Z), "the extent along y");
    write(&folder, [8, 8, 5], plain);
    assert_eye(
        &folder,
        "a.nrrd",
        aside(minus(Y), Z),
        "states no orientation (if the object lies otherwise, state camera.up)",
    );
    assert_eye(&folder, "a.nrrd --set camera.fit=volume --set preset=mip", aside(minus(Y), Z), "no orientation");

    // What is stated.
    assert_eye(&folder, "a.nrrd --set camera.direction=[0,1,0]", [Y, Z], "where it is stated");
    assert_eye(&folder, "a.nrrd --set camera.up=[0,0,-1]", [Y, minus(Z)], "where it is stated");
    write(&folder, [9, 8, 3], lps);
    assert_eye(&folder, "a.nrrd --view back", [minus(Y), Z], "where it is stated");
    for keys in ["[camera]", "[transfer]\nopacity = [[0, 0.5]]", "[camera]\nfit = 'object'"] {
        folder.write("a.toml", format!("volume.path = 'a.nrrd'\n{keys}"));
        assert_eye(&folder, "a.toml", [Y, Z], "where it is stated");
    }
}

/// A disc in one or two slices is seen face on, along whichever axis they lie.
#[test]
fn discs_in_one_slice_are_seen_face_on() {
    let folder = Folder::new();
    for thin in 0..3 {
        for slices in [1, 2] {
            let mut dims = [32; 3];
            dims[thin] = slices;
            let [nx, ny, nz] = dims;
            let value = |at: usize| {
                let place = [at % nx, at / nx % ny, at / nx / ny];
                let squares = (0..3).filter(|&axis| axis != thin).map(|axis| (place[axis] as f32 - 15.5).powi(2));
                if squares.sum::<f32>() < 144.0 { 200.5 } else { 0.0 }
            };
            let values: Vec<f32> = (0..nx * ny * nz).map(value).collect();
            folder.write_nrrd("disc.nrrd", dims, [1.0; 3], &values);
            let (width, _, pixels) = folder.pixels("disc.nrrd --backend cpu --size 40");
            let seen: Vec<[usize; 2]> = (0..pixels.len())
                .filter(|&at| pixels[at][..3].iter().sum::<f32>() > 0.1)
                .map(|at| [at % width, at / width])
                .collect();
            let side = |axis: usize| {
                let [least, most] = [seen.iter().map(|at| at[axis]).min(), seen.iter().map(|at| at[axis]).max()];
                (most.unwrap() + 1 - least.unwrap()) as f64
            };
            let [wide, high] = [side(0), side(1)];
            let filled = seen.len() as f64 / (wide * high);
            assert!((wide - high).abs() <= 2.0 && wide >= 24.0, "{dims:?}: {wide} × {high}");
            assert!((filled - std::f64::consts::FRAC_PI_4).abs() < 0.08, "{dims:?}: {filled}");
        }
    }
}

/// NIfTI's method 1 has axes of a patient, whatever else the file leaves open.
#[test]
fn a_nifti_file_without_codes_has_the_formats_axes() {
    let folder = Folder::new();
    let fixture = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/sform.nii");
    let mut bytes = std::fs::read(fixture).unwrap();
    // `qform_code` and `sform_code`.
    bytes[252..256].fill(0);
    folder.write("a.nii", bytes);
    let up = [0.0, 0.0, 1.0];
    let front = [direction([0.0, 1.0, 0.0], up, [20.0, 10.0]), up];
    assert_eye(&folder, "a.nii", front, "in front of the patient, assumed by the format's method 1");
    folder.run("render a.nii -o a.png --view front").assert_failure(2, &["--view", "no orientation"]);
}

/// A picture, the scene that is saved with it, and a movie's first frame look from the same eye.
#[test]
fn pictures_are_drawn_from_there() {
    let folder = Folder::new();
    let size = "--set image={width=40,height=30} --backend cpu";
    folder.render(&format!("builtin:nerve:24 {size} -o a.npy --save-scene a.toml"));
    let camera = String::from_utf8(folder.read("a.toml")).unwrap().parse::<toml::Table>().unwrap()["camera"].clone();
    let saved = ["direction", "up"].map(|key| [0, 1, 2].map(|at| camera[key][at].as_float().unwrap()));
    let ([found, up], _) = eye(&folder, "builtin:nerve:24");
    assert_eq!(saved, [found, up]);
    folder.render(&format!("a.toml {size} -o again.npy"));
    assert!(folder.read("again.npy") == folder.read("a.npy"));
    let [x, y, z] = found;
    let stated = folder.pixels(&format!("builtin:nerve:24 {size} --set camera.direction=[{x},{y},{z}]"));
    assert_eq!(stated, folder.pixels(&format!("builtin:nerve:24 {size}")));
    for backend in ["cpu", "gpu", "reference"] {
        let movie =
            format!("builtin:nerve:24 --backend {backend} --set image={{width=40,height=30}} --set camera.fit=volume");
        folder.run(&format!("orbit {movie} --count 4 -o {backend}-%d.npy")).assert_success();
        assert_eq!(folder.read_npy(&format!("{backend}-0.npy")), folder.pixels(&movie), "{backend}");
    }
}

/// The sphere is as small as the voxels that are shown, not as the corners of their box.
#[test]
fn turning_cameras_take_the_sphere_about_the_boxs_middle() {
    let folder = Folder::new();
    let (dims, spacing) = ([14_usize, 12, 10], [1.0, 2.0, 0.5]);
    // A cross: no voxel lies at a corner of its box, from voxel (2, 1, 3) to (12, 9, 8).
    let is_in = |[x, y, z]: [usize; 3]| {
        [(2..=12).contains(&x), y == 5, z == 5] == [true; 3]
            || [x == 7, (1..=9).contains(&y), z == 5] == [true; 3]
            || [x == 7, y == 5, (3..=8).contains(&z)] == [true; 3]
    };
    let count = dims.iter().product::<usize>();
    let voxels = (0..count).map(|at| [at % 14, at / 14 % 12, at / 168]);
    let values: Vec<f32> = voxels.clone().map(|voxel| if is_in(voxel) { 100.0 } else { 0.0 }).collect();
    folder.write_nrrd("cross.nrrd", dims, spacing, &values);
    let middle = [7.0, 5.0, 5.5];
    let distance = |voxel: [usize; 3]| {
        let squares = (0..3).map(|axis| ((voxel[axis] as f64 - middle[axis]) * spacing[axis]).powi(2));
        squares.sum::<f64>().sqrt()
    };
    let farthest = voxels.filter(|&voxel| is_in(voxel)).map(distance).fold(0.0, f64::max);
    // The radius of the kernel is 2 grid units.
    let radius = farthest + 2.0 * 2.0;
    for (width, height) in [(40.0, 30.0), (30.0, 40.0)] {
        let saved = |projection: &str| {
            let look = "--backend cpu --set transfer.opacity=[[40,0],[60,0.5]]";
            let size = format!("--set image={{width={width},height={height}}} --set camera.projection={projection}");
            folder
                .run(&format!("orbit cross.nrrd {look} {size} --count 1 -o %d.png --overwrite --save-scene s.toml"))
                .assert_success();
            String::from_utf8(folder.read("s.toml")).unwrap().parse::<toml::Table>().unwrap()["camera"].clone()
        };
        let close = |found: &toml::Value, expected: f64| {
            let found = found.as_float().unwrap();
            assert!((found - expected).abs() < 1e-9 * expected.abs(), "{found} {expected}");
        };
        let camera = saved("orthographic");
        for axis in 0..3 {
            let center = (middle[axis] - (dims[axis] as f64 - 1.0) / 2.0) * spacing[axis];
            close(&camera["center"][axis], center);
        }
        close(&camera["height"], 2.0 * radius * f64::max(1.0, height / width) / 0.9);
        let t = (15.0_f64).to_radians().tan();
        let angle = (0.9 * t * f64::min(1.0, width / height)).atan();
        close(&saved("perspective")["distance"], radius / angle.sin());
    }
}
