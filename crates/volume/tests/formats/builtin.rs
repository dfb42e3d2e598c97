//! The procedural volumes: sizes, scaling, determinism and contents.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::{DVec3, UVec3};
use sheetsplat_volume::{Volume, VolumeError, builtin};

fn volume(name: &str) -> Volume {
    builtin::volume(name).unwrap()
}

/// The fraction of voxels with a value in `low..=high`.
fn fraction(volume: &Volume, low: f32, high: f32) -> f64 {
    let count = volume.values().iter().filter(|value| (low..=high).contains(value)).count();
    count as f64 / volume.values().len() as f64
}

fn at(volume: &Volume, world: [f64; 3]) -> f32 {
    let voxel = DVec3::from(world) / volume.spacing() + volume.grid().center();
    volume.value(voxel.round().as_uvec3())
}

fn assert_bytes(volume: &Volume) {
    assert!(volume.values().iter().all(|value| (0.0..=255.0).contains(&value) && value.fract() == 0.0));
}

/// The parts of the error about a name: the origin, the field, what was found and what is allowed.
fn complaint(name: &str) -> [String; 4] {
    match builtin::volume(name).unwrap_err() {
        VolumeError::Invalid { origin, field, found, allowed, .. } => [origin, field, found, allowed],
        error => panic!("{error}"),
    }
}

#[test]
fn paper_sizes() {
    let expected = [
        ("cube", [48, 48, 48], [1.0, 1.0, 1.0]),
        ("head", [256, 256, 163], [1.0, 1.0, 1.0]),
        ("nerve", [512, 512, 76], [1.0, 1.0, 5.0]),
        ("tomato", [256, 256, 64], [1.0, 1.0, 3.0]),
        ("marschner-lobb", [64, 64, 64], [1.0, 1.0, 1.0]),
    ];
    assert_eq!(expected.map(|(name, ..)| name), builtin::NAMES);
    for (name, dims, spacing) in expected {
        let volume = volume(name);
        assert_eq!((volume.dims(), volume.spacing()), (dims.into(), spacing.into()), "{name}");
    }
}

#[test]
fn scaling_keeps_the_extent() {
    for (name, extent) in [
        ("cube", [48.0, 48.0, 48.0]),
        ("head", [256.0, 256.0, 163.0]),
        ("nerve", [512.0, 512.0, 380.0]),
        ("tomato", [256.0, 256.0, 192.0]),
        ("marschner-lobb", [64.0, 64.0, 64.0]),
    ] {
        for n in [2, 3, 17, 64, 100] {
            let volume = volume(&format!("{name}:{n}"));
            assert_eq!(volume.dims().max_element(), n, "{name}:{n}");
            for (axis, extent) in extent.into_iter().enumerate() {
                let (voxels, wanted) = (f64::from(volume.dims()[axis]), extent / volume.spacing()[axis]);
                // Every dimension has at least one voxel.
                assert!((voxels - wanted.max(1.0)).abs() <= 0.5 + 1e-9, "{name}:{n}: {voxels} voxels for {wanted}");
            }
        }
    }
    assert_eq!(volume("nerve:128").spacing(), DVec3::new(4.0, 4.0, 20.0));
    assert_eq!(volume("nerve:2").dims(), UVec3::new(2, 2, 1));
}

#[test]
fn the_same_in_every_run() {
    let single = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let several = rayon::ThreadPoolBuilder::new().num_threads(5).build().unwrap();
    for name in builtin::NAMES {
        let name = format!("{name}:61");
        let first = volume(&name);
        assert_eq!(first, volume(&name), "{name}");
        assert_eq!(first, single.install(|| volume(&name)), "{name} in one thread");
        assert_eq!(first, several.install(|| volume(&name)), "{name} in five threads");
    }
}

#[test]
fn cube_is_binary() {
    let cube = volume("cube");
    assert!(cube.values().iter().all(|value| value == 0.0 || value == 255.0));
    assert_eq!(cube.values().iter().filter(|&value| value == 255.0).count(), 32 * 32 * 32);
    assert_eq!(cube.value(UVec3::splat(8)), 255.0);
    assert_eq!(cube.value(UVec3::splat(39)), 255.0);
    assert_eq!(cube.value(UVec3::new(7, 24, 24)), 0.0);
    assert_eq!(cube.value(UVec3::new(24, 24, 40)), 0.0);
}

#[test]
fn head_has_its_tissues() {
    let head = volume("head:128");
    assert_bytes(&head);
    let air = fraction(&head, 0.0, 0.0);
    assert!((0.80..0.92).contains(&air), "air {air}");
    for (tissue, value, low) in
        [("skin", 90.0, 0.015), ("skull", 150.0, 0.002), ("grey", 200.0, 0.001), ("white", 225.0, 0.002)]
    {
        let found = fraction(&head, value - 8.0, value + 8.0);
        assert!(found > low && found < 0.1, "{tissue} {found}");
    }
    // A sample in front of the forehead, and one in each of the inner tissues.
    assert_eq!(at(&head, [0.0, -75.0, 30.0]), 0.0);
    assert_eq!(at(&head, [21.0, -48.6, 3.8]), 245.0, "eye");
    assert_eq!(at(&head, [11.4, 17.8, 33.0]), 40.0, "ventricle");
    assert_eq!(at(&head, [0.0, 0.0, -72.0]), 0.0, "windpipe");
    // The face looks towards -y: in the middle plane the tip of the nose is the foremost skin.
    let y_of_first = |z: f64| {
        let found = (0..256).map(|y| f64::from(y) - 127.5).find(|&y| at(&head, [0.0, y, z]) > 45.0);
        found.unwrap()
    };
    let (nose, brow, lips) = (y_of_first(-19.0), y_of_first(14.0), y_of_first(-36.0));
    assert!(nose < brow - 5.0 && nose < lips - 5.0, "nose {nose}, brow {brow}, lips {lips}");
}

#[test]
fn head_is_symmetric() {
    let head = volume("head:64");
    let UVec3 { x: nx, y: ny, z: nz } = head.dims();
    for voxel in (0..nx * ny * nz).map(|index| head.grid().voxel_at(index)) {
        let mirrored = UVec3::new(nx - 1 - voxel.x, voxel.y, voxel.z);
        assert_eq!(head.value(voxel), head.value(mirrored), "{voxel}");
        let label = |p: UVec3| head.label(p.x + nx * (p.y + ny * p.z));
        assert_eq!(label(voxel), label(mirrored), "{voxel}");
    }
}

/// A label's name, and the values inside its tissue.
type Tissue = (&'static str, &'static [f32]);

/// The segmented builtin volumes, and their tissues by label.
const TISSUES: [(&str, &[Tissue]); 2] = [
    (
        "head",
        &[
            ("air", &[0.0]),
            ("skin and soft tissue", &[90.0]),
            ("skull", &[150.0]),
            ("fluid around the brain", &[50.0]),
            ("grey matter", &[200.0]),
            ("white matter", &[225.0]),
            ("ventricles", &[40.0]),
            ("eyes", &[245.0, 255.0]),
        ],
    ),
    (
        "tomato",
        &[
            ("air", &[0.0]),
            ("wall", &[90.0]),
            ("gel", &[50.0]),
            ("placenta", &[140.0]),
            ("core", &[170.0]),
            ("seeds", &[230.0]),
        ],
    ),
];

/// Every label exists and names its tissue: it covers every voxel that, like its neighbours, has that tissue's value.
#[test]
fn labels_are_the_tissues() {
    for (name, tissues) in TISSUES {
        let names: Vec<(u16, &str)> = (0..).zip(tissues.iter().map(|tissue| tissue.0)).collect();
        assert_eq!(builtin::labels(name), Some(&names[..]));
        assert_eq!(builtin::labels(&format!("{name}:99")), Some(&names[..]));
        let volume = volume(name);
        let (values, dims) = (volume.values(), volume.dims());
        let steps = [1, dims.x as usize, (dims.x * dims.y) as usize];
        let mut inside = vec![0; tissues.len()];
        for (index, value) in values.iter().enumerate() {
            let at = volume.grid().voxel_at(index as u32);
            if at.cmpeq(UVec3::ZERO).any() || (at + 1).cmpeq(dims).any() {
                continue;
            }
            let mut neighbours = steps.iter().flat_map(|step| [index - step, index + step]);
            let Some(tissue) = tissues.iter().position(|tissue| tissue.1.contains(&value)) else { continue };
            if neighbours.all(|at| values.at(at) == value) {
                assert_eq!(volume.label(index as u32), Some(tissue as u16), "{name}: {at} of {value}");
                inside[tissue] += 1;
            }
        }
        assert!(inside.iter().all(|&count| count > 50), "{name}: {inside:?}");
    }
    for name in ["cube", "nerve:64", "marschner-lobb:20"] {
        assert_eq!((builtin::labels(name), volume(name).labels()), (Some(&[][..]), None), "{name}");
    }
    assert_eq!(builtin::labels("skull"), None);
}

/// In rows along y from outside, above the face, where no bone is near, the skin begins where it fills half a voxel.
#[test]
fn a_label_begins_half_way() {
    let head = volume("head");
    let UVec3 { x: nx, y: ny, z: nz } = head.dims();
    let mut entered = 0;
    for (x, z) in (nz * 2 / 3..nz).flat_map(|z| (0..nx).map(move |x| (x, z))) {
        let row = (0..ny).map(|y| x + nx * (y + ny * z));
        for index in row {
            let (value, label) = (head.values().at(index as usize), head.label(index).unwrap());
            if label != 0 {
                assert!(label == 1 && value >= 45.0, "{value} is {label}");
                entered += 1;
                break;
            }
            assert!(value <= 45.0, "{value} is air");
        }
    }
    assert!(entered > 3000, "{entered} rows enter the head");
}

#[test]
fn nerve_is_sparse() {
    let nerve = volume("nerve");
    assert_bytes(&nerve);
    let cell = 1.0 - fraction(&nerve, 0.0, 0.0);
    assert!((0.01..0.05).contains(&cell), "cell {cell}");
    assert_eq!(at(&nerve, [-20.0, -10.0, 0.0]), 250.0, "cell body");
    // Dendrites surround the cell body and are darker than it.
    let dims = nerve.dims();
    let mut brightest = [0.0_f32; 8];
    for index in 0..dims.element_product() {
        let p = nerve.grid().world_position(nerve.grid().voxel_at(index));
        if p.truncate().length() > 150.0 {
            let octant = usize::from(p.x > 0.0) + 2 * usize::from(p.y > 0.0) + 4 * usize::from(p.z > 0.0);
            brightest[octant] = brightest[octant].max(nerve.values().at(index as usize));
        }
    }
    assert!(brightest.iter().all(|value| (120.0..240.0).contains(value)), "{brightest:?}");
}

#[test]
fn tomato_has_its_tissues() {
    let tomato = volume("tomato:128");
    assert_bytes(&tomato);
    for (tissue, value, low, high) in [
        ("air", 0.0, 0.5, 0.8),
        ("wall", 90.0, 0.08, 0.25),
        ("gel", 50.0, 0.04, 0.2),
        ("placenta", 140.0, 0.005, 0.05),
        ("core", 170.0, 0.003, 0.05),
    ] {
        let found = fraction(&tomato, value, value);
        assert!((low..high).contains(&found), "{tissue} {found}");
    }
    let seeds = fraction(&tomato, 195.0, 230.0);
    assert!((0.0003..0.02).contains(&seeds), "seeds {seeds}");
    assert_eq!(tomato.values().iter().fold(0.0, f32::max), 230.0);
    assert_eq!(at(&tomato, [0.0, 0.0, 0.0]), 170.0, "core");
}

#[test]
fn marschner_lobb_is_its_formula() {
    let volume = volume("marschner-lobb");
    for voxel in [[0, 0, 0], [63, 0, 31], [17, 42, 5], [32, 32, 63], [40, 12, 20]] {
        let [x, y, z] = voxel.map(|i| -1.0 + 2.0 * f64::from(i) / 63.0);
        let ripple = (TAU * 6.0 * (FRAC_PI_2 * x.hypot(y)).cos()).cos();
        let expected = 255.0 * (1.0 - (FRAC_PI_2 * z).sin() + 0.25 * (1.0 + ripple)) / 2.5;
        assert!((f64::from(volume.value(voxel.into())) - expected).abs() < 1e-4, "{voxel:?}");
    }
    // Values are not rounded to whole numbers.
    assert!(volume.values().iter().filter(|value| value.fract() != 0.0).count() > volume.values().len() / 2);
}

#[test]
fn errors_name_what_is_allowed() {
    for name in ["skull", "", "Head", "skull:32"] {
        let [origin, field, found, allowed] = complaint(name);
        assert_eq!((origin, field), (format!("builtin:{name}"), "name".to_owned()));
        assert_eq!(found, format!("\"{}\"", name.split(':').next().unwrap()));
        assert!(builtin::NAMES.iter().all(|known| allowed.contains(known)), "{allowed}");
    }
    for size in ["1", "0", "1025", "-4", "64.0", "", "64:2", "99999999999"] {
        let [origin, field, found, allowed] = complaint(&format!("head:{size}"));
        assert_eq!((origin, field.as_str()), (format!("builtin:head:{size}"), "size"));
        assert_eq!(found, format!("\"{size}\""));
        assert_eq!(allowed, "a whole number from 2 to 1024");
    }
}
