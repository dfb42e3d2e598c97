//! Spacings, units, space directions and the patient's sides.

use glam::{DMat3, DVec3};
use sheetsplat_volume::{Orientation, PatientSide};

use super::{Folder, PLAIN, assert_refused, bytes};
use crate::{assert_near, assert_warned, warned};

#[test]
fn spacings() {
    let folder = Folder::new();
    let open = |line: &str| folder.attached(&format!("{PLAIN}{line}\n"), &bytes());
    assert_eq!(open("spacings: 1 0.5e-3\t+2.").unwrap().spacing(), DVec3::new(1.0, 0.5e-3, 2.0));
    let allowed = "three positive finite numbers";
    for wrong in ["1 1", "1 1 1 1", "1 1 inf", "1 -1 1", "0 -1 1", "1 1 x", "", "1,1,1", "1 1 1e400"] {
        assert_refused(open(&format!("spacings: {wrong}")), "volume.nrrd", "spacings", wrong, allowed);
    }
}

#[test]
fn units() {
    let folder = Folder::new();
    let unit = |fields: &str| {
        let volume = folder.attached(&format!("{PLAIN}{fields}\n"), &bytes()).unwrap();
        volume.unit().map(str::to_owned)
    };
    assert_eq!(unit("spacings: 1 1 1"), None);
    assert_eq!(unit("units: \"um\" \"um\" \"micron\"").as_deref(), Some("µm"));
    assert_eq!(unit("space units: \"mm\" \"mm\" \"mm\"\nunits: \"m\" \"m\" \"m\"").as_deref(), Some("mm"));
    assert_eq!(unit("units: \"mm\" \"mm\" \"s\""), None);
    assert_eq!(unit("units: \"mm\" \"mm\" \"\"").as_deref(), Some("mm"));
    assert_eq!(unit("units: mm"), None);
}

/// Lengths are converted to the unit of the finest axis, of the array for `units` and of the world for `space units`; 0 and NaN are no spacings.
#[test]
fn several_units_and_open_spacings() {
    let folder = Folder::new();
    let open = |fields: &str| warned(|| folder.attached(&format!("{PLAIN}{fields}\n"), &bytes()).unwrap());
    let (volume, warnings) = open("spacings: 0.25 0.25 500\nunits: \"um\" \"um\" \"nm\"");
    assert_near(volume.spacing(), DVec3::new(0.25, 0.25, 0.5));
    assert_eq!(volume.unit(), Some("µm"));
    assert_warned(&warnings, "units: \"um\", \"um\", \"nm\": lengths are converted to µm");
    let directions = "space: RAS\nspace directions: (0,0.5,0) (-250,0,0) (0,0,0.5)\nspace origin: (1000,2,3)";
    let (volume, _) = open(&format!("{directions}\nspace units: \"nm\" \"um\" \"um\""));
    assert_near(volume.spacing(), DVec3::new(500.0, 250.0, 500.0));
    assert_near(volume.orientation().unwrap().origin, DVec3::new(1000.0, 2000.0, 3000.0));
    assert_eq!(volume.unit(), Some("nm"));
    for (spacings, expected) in [("0.5 2 0", [0.5, 2.0, 0.5]), ("nan 2 0", [2.0; 3]), ("0 0 0", [1.0; 3])] {
        let (volume, warnings) = open(&format!("spacings: {spacings}"));
        assert_eq!(volume.spacing(), DVec3::from_array(expected), "{spacings}");
        assert_warned(&warnings, "an axis without a spacing is taken to have");
    }
}

#[test]
fn space_directions() {
    let folder = Folder::new();
    let open = |value: &str| folder.attached(&format!("{PLAIN}space directions: {value}\n"), &bytes());
    let spacing = |value: &str| open(value).unwrap().spacing();
    assert_eq!(spacing("(1,0,0) (0,1,0) (0,0,1)"), DVec3::ONE);
    assert_eq!(spacing("(0,-2,0)(0.5,0,0)( 0 , 0 , 3 )"), DVec3::new(2.0, 0.5, 3.0));

    let rotation = glam::DMat3::from_euler(glam::EulerRot::XYZ, 0.3, -1.1, 2.0);
    let expected = DVec3::new(0.7, 0.7, 3.25);
    let directions = |matrix: glam::DMat3| {
        let vectors = matrix.to_cols_array_2d().map(|[x, y, z]| format!("({x},{y},{z})"));
        vectors.join(" ")
    };
    let rotated = spacing(&directions(rotation * glam::DMat3::from_diagonal(expected)));
    assert!((rotated - expected).abs().max_element() < 1e-14, "{rotated}");

    let skewed = |cosine: f64| format!("(1,0,0) ({cosine},1,0) (0,0,1)");
    assert_eq!(spacing(&skewed(0.9e-4)).y, 1.0_f64.hypot(0.9e-4));
    for skew in [6.0, -1e9] {
        let allowed = "each less than 80° from a right angle";
        assert_refused(open(&skewed(skew)), "volume.nrrd", "space directions", "from a right angle", allowed);
    }
    let allowed = "three vectors (x,y,z) of positive finite length";
    for wrong in [
        "none (0,1,0) (0,0,1)",
        "(1,0,0) (0,1,0)",
        "(1,0,0) (0,1,0) (0,0,1) (0,0,1)",
        "(1,0) (0,1) (0,0)",
        "(1,0,0) (0,1,0) (0,0,0)",
        "(1,0,0) (0,1,0) (0,0,nan)",
        "(1,0,0) (0,1,0) (0,0,1e200)",
        "(1,0,0) (0,1,0) (0,0,1",
        "(1,0,0) (0,1,0) 0,0,1)",
        "1 0 0",
        "",
    ] {
        assert_refused(open(wrong), "volume.nrrd", "space directions", wrong, allowed);
    }
    let both = open("(1,0,0) (0,1,0) (0,0,1)\nspacings: 1 1 1");
    assert_refused(both, "volume.nrrd", "space directions", "`spacings` as well", "one of");
}

#[test]
fn orientation() {
    let folder = Folder::new();
    let open = |space: &str, rest: &str| {
        let directions = "space directions: (0,-2,0) (0.5,0,0) (0,0,3)";
        folder.attached(&format!("{PLAIN}space: {space}\n{directions}\n{rest}"), &bytes())
    };
    for (names, signs) in [
        (["right-anterior-superior", "RAS"], DVec3::ONE),
        (["left-anterior-superior", "las"], DVec3::new(-1.0, 1.0, 1.0)),
        (["Left-Posterior-Superior", "LPS"], DVec3::new(-1.0, -1.0, 1.0)),
    ] {
        let axes = [DVec3::NEG_Y, DVec3::X, DVec3::Z].map(|axis| axis * signs);
        for name in names {
            let volume = open(name, "space origin: (1, 2.5, -3)\n").unwrap();
            let orientation = volume.file_orientation().unwrap();
            assert_eq!(orientation.axes, DMat3::from_cols_array_2d(&axes.map(|axis| axis.to_array())), "{name}");
            assert_eq!(orientation.origin, DVec3::new(1.0, 2.5, -3.0) * signs, "{name}");
            assert_eq!(orientation.is_mirrored(), signs.element_product() < 0.0, "{name}");
            assert_eq!(volume.grid().is_turned(), orientation.is_mirrored(), "{name}");
            assert_eq!(open(name, "").unwrap().file_orientation().unwrap().origin, DVec3::ZERO);
        }
    }
    // Spaces other than a patient's have no orientation.
    assert_eq!(open("scanner-xyz", "").unwrap().orientation(), None);
    assert_eq!(
        folder.attached(&format!("{PLAIN}space: RAS\nspacings: 1 1 1\n"), &bytes()).unwrap().orientation(),
        None
    );
    for wrong in ["1 2 3", "(1,2)", "(1,2,nan)", "none"] {
        let refused = open("RAS", &format!("space origin: {wrong}\n"));
        assert_refused(refused, "volume.nrrd", "space origin", wrong, "a vector (x,y,z)");
    }
}

#[test]
fn anatomical_views() {
    // A volume whose x runs to the patient's left, y to the head, z to the front.
    let folder = Folder::new();
    let header = format!("{PLAIN}space: LPS\nspace directions: (1,0,0) (0,0,1) (0,-1,0)\n");
    let volume = folder.attached(&header, &bytes()).unwrap();
    let orientation = volume.orientation().unwrap();
    assert!(!orientation.is_mirrored());
    let [left, up, front] = DMat3::IDENTITY.to_cols_array_2d().map(DVec3::from_array);
    for (view, expected) in [
        (PatientSide::Front, [-front, up]),
        (PatientSide::Back, [front, up]),
        (PatientSide::Left, [-left, up]),
        (PatientSide::Right, [left, up]),
        (PatientSide::Top, [-up, front]),
        (PatientSide::Bottom, [up, front]),
    ] {
        assert_eq!(orientation.direction_and_up(view), expected, "{view:?}");
    }
    // Seen from the front, the patient's left is on the right.
    let [direction, up] = orientation.direction_and_up(PatientSide::Front);
    assert_eq!(direction.cross(up), left);
}

#[test]
fn orientations_are_orthonormal() {
    let volume = Folder::new().attached(PLAIN, &bytes()).unwrap();
    let set = |axes: DMat3, origin: DVec3| volume.clone().with_orientation("here", Some(Orientation { axes, origin }));
    let mirrored = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
    let turned = set(mirrored, DVec3::ONE).unwrap();
    assert!(turned.file_orientation().unwrap().is_mirrored() && !turned.orientation().unwrap().is_mirrored());
    assert!(turned.clone().with_orientation("here", None).unwrap() == volume, "as the array was");
    let skewed = DMat3::from_cols(DVec3::X, DVec3::new(1e-3, 1.0, 0.0), DVec3::Z);
    let wrong = [(skewed, DVec3::ZERO), (DMat3::IDENTITY * 1.001, DVec3::ZERO), (DMat3::IDENTITY, DVec3::NAN)];
    for (axes, origin) in wrong.into_iter().chain([(DMat3::NAN, DVec3::ZERO)]) {
        assert_refused(set(axes, origin), "here", "orientation", "[", "finite orthogonal unit vectors");
    }
}
