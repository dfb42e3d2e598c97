//! A phantom of a human head, sculpted in millimetres: x to the left ear, y to the back, z to the crown.

use glam::{DVec3, dvec3};

use super::sdf::Part::{Add, AddTube, Cut, CutTube};
use super::sdf::{Grid, Layer, Part, ellipsoid, intersection, sculpt, smoothstep, tube, union, wave};

/// World units per millimetre: the head from the crown to below the chin fills the volume's height.
const SCALE: f64 = 0.635;

/// Height of the cut through the neck.
const NECK: f64 = -124.0;

const EYE: DVec3 = dvec3(32.5, -79.0, 6.0);

/// The values rise from tissue to tissue inwards — skin, bone, brain, eyes — so that every threshold between two of
/// them finds one clean surface, without the fringe where a steeper edge passes through the value of another tissue.
pub(super) fn values(grid: &Grid) -> Vec<f32> {
    let layer = |value, distance: fn(DVec3) -> f64| Layer::new(value, move |p| SCALE * distance(mirrored(p / SCALE)));
    grid.paint(&[
        layer(90.0, skin),
        layer(150.0, bone),
        layer(50.0, cavity),
        layer(200.0, grey_matter),
        layer(225.0, white_matter),
        layer(40.0, ventricles),
        layer(0.0, airways),
        layer(245.0, eyeball),
        layer(255.0, lens),
    ])
}

/// The side that is modelled, its edge in the middle rounded off.
fn mirrored(p: DVec3) -> DVec3 {
    dvec3((p.x * p.x + 1.0).sqrt() - 0.5, p.y, p.z)
}

fn vault(p: DVec3) -> f64 {
    sculpt(p, f64::INFINITY, &VAULT)
}

const VAULT: [Part; 4] = [
    Add([0.0, 10.0, 44.0], [74.0, 86.0, 78.0], 1.0),
    // Forehead, back of the head, side.
    Add([0.0, -32.0, 46.0], [60.0, 62.0, 56.0], 30.0),
    Add([0.0, 48.0, 24.0], [62.0, 50.0, 50.0], 30.0),
    Add([18.0, 14.0, 34.0], [57.0, 60.0, 52.0], 30.0),
];

fn skin(p: DVec3) -> f64 {
    let d = sculpt(p, vault(p), &FACE);
    let d = eyelids(p, d);
    let d = sculpt(p, d, &NOSE_AND_MOUTH);
    let d = union(d, ear(p), 4.0);
    intersection(d, NECK - p.z, 3.0)
}

const FACE: [Part; 19] = [
    // Neck, with the muscle from behind the ear to the breastbone.
    AddTube([0.0, 22.0, -30.0], [0.0, 26.0, -140.0], (54.0, 55.0), 22.0),
    AddTube([62.0, 26.0, -30.0], [24.0, -22.0, -140.0], (10.0, 11.0), 14.0),
    Add([0.0, -27.0, -116.0], [8.0, 8.0, 10.0], 10.0),
    // Temple hollow.
    Cut([82.0, -52.0, 34.0], [18.0, 30.0, 30.0], 18.0),
    // Middle of the face, jaw, chin.
    Add([0.0, -42.0, -24.0], [54.0, 48.0, 60.0], 20.0),
    AddTube([50.0, -2.0, -20.0], [46.0, -8.0, -62.0], (17.0, 15.0), 20.0),
    AddTube([46.0, -10.0, -62.0], [15.0, -74.0, -88.0], (14.0, 13.0), 22.0),
    Add([0.0, -56.0, -78.0], [34.0, 32.0, 20.0], 20.0),
    Add([0.0, -84.0, -90.0], [15.0, 13.0, 12.0], 14.0),
    // Cheekbone and its arch, cheek.
    Add([47.0, -62.0, -14.0], [18.0, 19.0, 13.0], 16.0),
    AddTube([52.0, -58.0, -12.0], [66.0, -8.0, -10.0], (8.0, 6.0), 18.0),
    Add([36.0, -66.0, -44.0], [22.0, 22.0, 24.0], 16.0),
    // Brow ridge.
    AddTube([9.0, -86.0, 22.0], [32.0, -83.0, 27.0], (9.0, 8.0), 14.0),
    AddTube([32.0, -83.0, 27.0], [52.0, -66.0, 20.0], (8.0, 7.0), 14.0),
    // Eye socket.
    Cut([31.0, -98.0, 7.0], [16.0, 14.0, 11.0], 12.0),
    Cut([16.0, -97.0, 7.0], [7.0, 10.0, 10.0], 9.0),
    // The muzzle over the teeth, and the fold beside it.
    Add([0.0, -78.0, -57.0], [31.0, 22.0, 25.0], 16.0),
    CutTube([19.0, -106.0, -36.0], [36.0, -94.0, -64.0], (5.0, 4.0), 16.0),
    // Below the lower lip.
    Cut([0.0, -106.0, -76.0], [18.0, 9.0, 4.5], 8.0),
];

/// Closed lids over the eyeball; the upper one overhangs the lower.
fn eyelids(p: DVec3, d: f64) -> f64 {
    let q = p - EYE;
    // The lash line sags towards the outer third.
    let line = q.z + 5.0 - 0.022 * (q.x - 1.0) * (q.x - 1.0) + 0.06 * q.x;
    let radius = 13.6 + 1.7 * smoothstep(-1.2, 1.2, line);
    let lid = ellipsoid(q, DVec3::ZERO, dvec3(radius + 2.5, radius, radius - 0.5));
    let d = union(d, lid, 5.0);
    // The fold above the upper lid.
    let fold = 7.5 - 0.016 * q.x * q.x;
    sculpt(q, d, &[CutTube([-11.0, -12.0, fold - 2.0], [14.0, -10.0, fold - 2.0], (1.2, 1.2), 4.0)])
}

const NOSE_AND_MOUTH: [Part; 16] = [
    // Bridge, back, tip, wings, column.
    AddTube([0.0, -88.0, 18.0], [0.0, -96.0, 4.0], (7.0, 6.0), 12.0),
    AddTube([0.0, -95.0, 6.0], [0.0, -112.0, -26.0], (6.0, 8.0), 12.0),
    Add([0.0, -114.0, -30.0], [9.0, 8.5, 8.0], 6.0),
    Add([12.0, -102.0, -34.0], [7.0, 9.5, 7.5], 5.0),
    AddTube([0.0, -112.0, -37.0], [0.0, -98.0, -43.0], (3.5, 4.0), 5.0),
    // Nostril.
    CutTube([6.6, -109.0, -41.5], [6.0, -97.0, -30.0], (3.6, 3.0), 2.5),
    // Lips, upper and lower.
    AddTube([4.0, -97.0, -54.5], [22.0, -88.0, -59.5], (4.2, 2.2), 6.0),
    Add([0.0, -97.5, -56.0], [7.0, 5.5, 4.5], 5.0),
    AddTube([0.0, -95.0, -66.0], [12.0, -92.5, -65.0], (5.2, 4.6), 5.0),
    AddTube([12.0, -92.5, -65.0], [22.0, -86.5, -61.5], (4.6, 2.0), 5.0),
    // Between the lips, and their corner.
    CutTube([0.0, -102.5, -60.5], [9.0, -101.0, -60.0], (1.5, 1.4), 3.0),
    CutTube([9.0, -101.0, -60.0], [24.0, -89.5, -61.0], (1.4, 1.2), 3.0),
    Cut([25.5, -91.0, -61.5], [2.6, 5.0, 3.0], 4.0),
    // Groove above the upper lip.
    CutTube([0.0, -103.5, -44.0], [0.0, -104.0, -52.0], (2.6, 3.0), 4.0),
    // Tear corner, behind the wing of the nose.
    Cut([18.0, -92.0, 4.0], [3.0, 4.0, 2.6], 5.0),
    CutTube([17.0, -106.0, -28.0], [19.5, -98.0, -42.0], (1.6, 2.0), 4.0),
];

fn ear(p: DVec3) -> f64 {
    // The ear's own axes: outwards, backwards along the flap, upwards.
    let (out, back, up) = (dvec3(0.88, -0.46, -0.06), dvec3(0.44, 0.84, 0.32), dvec3(-0.1, -0.31, 0.945));
    let q = p - dvec3(76.0, 14.0, -4.0);
    let q = dvec3(q.dot(out), q.dot(back), q.dot(up));
    if q.length() > 60.0 {
        return q.length() - 40.0;
    }
    let flap = ellipsoid(q, dvec3(0.0, 0.0, 3.0), dvec3(3.5, 17.5, 28.0));
    // The outline is an ellipse that narrows towards the lobe.
    let outline = dvec3(0.0, q.y / (1.0 + 0.010 * (q.z - 5.0)), (q.z - 3.0) * 0.62);
    let rim = (outline.length() - 16.5).hypot(q.x - 1.5 + 0.0) - 3.0;
    let rim = intersection(rim, -q.z - 14.0 - 0.9 * q.y.min(0.0), 4.0).max(rim);
    let d = union(flap, rim, 4.0);
    sculpt(
        q,
        d,
        &[
            // The inner ridge, the lobe, the flap before the canal.
            AddTube([1.5, 7.5, -12.0], [1.8, 8.5, 8.0], (2.6, 2.6), 4.0),
            AddTube([1.8, 8.5, 8.0], [1.0, 2.0, 20.0], (2.6, 2.0), 4.0),
            Add([0.5, -6.0, -25.0], [3.8, 8.0, 9.0], 6.0),
            // The bowl and the canal.
            Cut([4.0, -3.0, -3.0], [7.0, 9.0, 13.0], 4.0),
            Add([2.5, -13.0, -5.0], [4.0, 4.5, 7.0], 4.0),
        ],
    )
}

fn bone(p: DVec3) -> f64 {
    let vault = vault(p) + 6.5;
    // Without its lower part, where neck and face are.
    let d = intersection(vault, floor(p) - 8.0, 8.0);
    let d = sculpt(p, d, &SKULL);
    let spine = tube(p, dvec3(0.0, 36.0, -30.0), dvec3(0.0, 38.0, -140.0), (13.0, 13.0)) - 2.0 * wave(p.z / 19.0);
    let d = union(d, spine, 4.0);
    // Never nearer to the air than the soft tissue over it.
    intersection(d, skin(p) + 3.5, 3.0)
}

/// How far below the floor of the brain's cavity: shelves that go down from front to back.
fn floor(p: DVec3) -> f64 {
    let height = 24.0 - 26.0 * smoothstep(-48.0, -30.0, p.y) - 32.0 * smoothstep(10.0, 34.0, p.y);
    height - p.z
}

const SKULL: [Part; 17] = [
    // Upper jaw, cheekbone and its arch, rim of the socket.
    Add([0.0, -62.0, -30.0], [34.0, 24.0, 30.0], 8.0),
    AddTube([26.0, -76.0, -18.0], [47.0, -64.0, -12.0], (9.0, 8.0), 8.0),
    AddTube([47.0, -62.0, -12.0], [64.0, -24.0, -9.0], (5.5, 3.6), 6.0),
    AddTube([64.0, -24.0, -9.0], [62.0, 8.0, -8.0], (3.6, 5.0), 6.0),
    AddTube([50.0, -64.0, -10.0], [50.0, -66.0, 20.0], (5.0, 5.0), 6.0),
    AddTube([8.0, -84.0, 22.0], [48.0, -68.0, 22.0], (6.5, 6.0), 8.0),
    AddTube([0.0, -84.0, 22.0], [0.0, -93.0, 2.0], (8.0, 5.0), 6.0),
    // Lower jaw: joint, angle, chin.
    AddTube([54.0, 0.0, -14.0], [49.0, -2.0, -58.0], (6.0, 7.0), 5.0),
    AddTube([49.0, -4.0, -58.0], [14.0, -72.0, -84.0], (8.0, 8.0), 5.0),
    AddTube([14.0, -72.0, -84.0], [0.0, -80.0, -86.0], (8.0, 9.0), 5.0),
    AddTube([44.0, -18.0, -56.0], [12.0, -76.0, -72.0], (5.0, 6.0), 6.0),
    // The bump behind the ear, the base.
    AddTube([58.0, 22.0, -8.0], [54.0, 18.0, -36.0], (12.0, 6.0), 8.0),
    AddTube([0.0, -30.0, -8.0], [0.0, 26.0, -18.0], (20.0, 20.0), 12.0),
    // Orbit, nasal opening, under the arch.
    CutTube([34.0, -92.0, 6.0], [14.0, -46.0, 6.0], (18.0, 5.0), 4.0),
    Cut([9.0, -92.0, -26.0], [7.0, 26.0, 13.0], 4.0),
    Cut([6.0, -90.0, -14.0], [6.0, 18.0, 15.0], 4.0),
    Cut([0.0, -40.0, -60.0], [30.0, 46.0, 16.0], 6.0),
];

fn cavity(p: DVec3) -> f64 {
    let d = intersection(vault(p) + 14.0, floor(p), 8.0);
    // The spinal canal.
    union(d, tube(p, dvec3(0.0, 30.0, -10.0), dvec3(0.0, 38.0, -140.0), (13.0, 8.0)), 10.0)
}

/// The outside of the brain, without its folds.
fn brain(p: DVec3) -> f64 {
    cavity(p) + 3.0
}

fn grey_matter(p: DVec3) -> f64 {
    brain(p)
}

fn white_matter(p: DVec3) -> f64 {
    brain(p) + 6.0
}

fn ventricles(p: DVec3) -> f64 {
    sculpt(p, f64::INFINITY, &VENTRICLES)
}

const VENTRICLES: [Part; 5] = [
    AddTube([9.0, -34.0, 44.0], [10.0, -8.0, 56.0], (4.5, 5.0), 1.0),
    AddTube([10.0, -8.0, 56.0], [18.0, 28.0, 52.0], (5.0, 6.0), 4.0),
    AddTube([18.0, 28.0, 52.0], [28.0, 40.0, 34.0], (6.0, 6.0), 4.0),
    AddTube([28.0, 40.0, 34.0], [38.0, 0.0, 14.0], (6.0, 3.5), 4.0),
    AddTube([24.0, 46.0, 44.0], [16.0, 66.0, 42.0], (5.0, 2.0), 4.0),
];

fn airways(p: DVec3) -> f64 {
    tube(p, dvec3(0.0, -4.0, -50.0), dvec3(0.0, -2.0, -140.0), (9.0, 9.0))
}

fn eyeball(p: DVec3) -> f64 {
    let cornea = (p - EYE - dvec3(0.0, -5.0, 0.0)).length() - 7.8;
    union((p - EYE).length() - 11.8, cornea, 1.0)
}

fn lens(p: DVec3) -> f64 {
    ellipsoid(p, EYE + dvec3(0.0, -7.5, 0.0), dvec3(5.0, 2.5, 5.0))
}
