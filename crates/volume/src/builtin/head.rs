//! A phantom of a human head, modelled in millimetres: x to the left ear, y to the back, z to the crown.

use glam::{DVec3, dvec2, dvec3};

use super::Grid;
use super::sdf::Part::{Add, AddTube, Cut, CutTube};
use super::sdf::{Layer, Part, ellipsoid, intersection, sculpt, smoothstep, tube, union, wave};

/// World units per millimetre, such that the head from the crown to below the chin fills the volume's height.
const SCALE: f64 = 0.635;

/// Height of the cut through the neck.
const NECK: f64 = -124.0;

/// Where the spinal cord ends, below the cut.
const SPINE: [f64; 3] = [0.0, 40.0, -140.0];

/// The thickness of the grey matter on the brain.
const CORTEX: f64 = 3.2;

const EYE: DVec3 = dvec3(32.5, -76.5, 6.0);

/// The labels' names. Grey and white matter include the cerebellum, the brainstem and the optic nerves.
pub(super) const LABELS: &[(u16, &str)] = &[
    (label::AIR, "air"),
    (label::SKIN, "skin and soft tissue"),
    (label::SKULL, "skull"),
    (label::FLUID, "fluid around the brain"),
    (label::GREY, "grey matter"),
    (label::WHITE, "white matter"),
    (label::VENTRICLES, "ventricles"),
    (label::EYES, "eyes"),
];

mod label {
    pub(super) const AIR: u16 = 0;
    pub(super) const SKIN: u16 = 1;
    pub(super) const SKULL: u16 = 2;
    pub(super) const FLUID: u16 = 3;
    pub(super) const GREY: u16 = 4;
    pub(super) const WHITE: u16 = 5;
    pub(super) const VENTRICLES: u16 = 6;
    pub(super) const EYES: u16 = 7;
}

/// Values rise inwards from tissue to tissue (skin, bone, brain, eyes), so every threshold between two of them finds one clean
/// surface, without the fringe where a steeper edge passes through another tissue's value.
pub(super) fn painted(grid: &Grid) -> (Vec<f32>, Vec<u16>) {
    let layer = |value, label, distance: fn(DVec3) -> f64| {
        Layer::new(value, label, move |p| SCALE * distance(mirrored(p / SCALE)))
    };
    grid.paint(&[
        layer(90.0, label::SKIN, skin),
        layer(150.0, label::SKULL, bone),
        layer(50.0, label::FLUID, cavity),
        layer(200.0, label::GREY, brain).with_core(SCALE * CORTEX, 225.0, label::WHITE),
        layer(200.0, label::GREY, nuclei),
        layer(40.0, label::VENTRICLES, ventricles),
        layer(0.0, label::AIR, airways),
        layer(245.0, label::EYES, eyeball),
        layer(255.0, label::EYES, lens),
        layer(0.0, label::AIR, |p| p.z - NECK),
    ])
}

/// The position on the modelled side, with the crease in the middle rounded off.
fn mirrored(p: DVec3) -> DVec3 {
    dvec3((p.x * p.x + 1.0).sqrt() - 0.5, p.y, p.z)
}

/// The skin over the vault of the skull.
fn vault(p: DVec3) -> f64 {
    sculpt(p, f64::INFINITY, &VAULT)
}

const VAULT: [Part; 4] = [
    Add([0.0, 10.0, 44.0], [74.0, 86.0, 78.0], 1.0),
    // Forehead, back of the head, side.
    Add([0.0, -34.0, 46.0], [58.0, 60.0, 56.0], 30.0),
    Add([0.0, 48.0, 24.0], [62.0, 50.0, 50.0], 30.0),
    Add([18.0, 18.0, 34.0], [57.0, 56.0, 52.0], 30.0),
];

fn skin(p: DVec3) -> f64 {
    let d = vault(p);
    // No part of the face reaches the top of the head.
    if p.z > 85.0 {
        return d;
    }
    let d = sculpt(p, d, &FACE);
    let d = eyelids(p, d);
    let d = sculpt(p, d, &NOSE_AND_MOUTH);
    union(d, ear(p), 4.0)
}

const FACE: [Part; 21] = [
    // The neck, with the muscle from behind the ear to the breastbone.
    AddTube([0.0, 24.0, -30.0], [0.0, 26.0, -140.0], (50.0, 52.0), 26.0),
    AddTube([60.0, 26.0, -30.0], [24.0, -20.0, -140.0], (10.0, 10.0), 18.0),
    Add([0.0, -23.0, -116.0], [8.0, 8.0, 10.0], 14.0),
    // Temple hollow.
    Cut([113.0, -56.0, 32.0], [48.0, 46.0, 46.0], 30.0),
    // Middle of the face, jaw, chin.
    Add([0.0, -40.0, -22.0], [54.0, 50.0, 60.0], 24.0),
    AddTube([49.0, -4.0, -20.0], [42.0, -12.0, -58.0], (17.0, 13.0), 24.0),
    AddTube([42.0, -14.0, -60.0], [12.0, -74.0, -89.0], (13.0, 13.0), 24.0),
    Add([0.0, -56.0, -76.0], [34.0, 34.0, 22.0], 20.0),
    Add([0.0, -86.0, -90.0], [15.0, 12.0, 12.0], 14.0),
    // Cheekbone and its arch, cheek.
    Add([44.0, -62.0, -13.0], [19.0, 20.0, 15.0], 20.0),
    AddTube([50.0, -50.0, -12.0], [58.0, -8.0, -10.0], (8.0, 8.0), 26.0),
    Add([44.0, -30.0, -40.0], [17.0, 26.0, 26.0], 18.0),
    Add([34.0, -64.0, -46.0], [22.0, 24.0, 26.0], 20.0),
    // Brow ridge.
    AddTube([8.0, -86.0, 21.0], [32.0, -81.0, 26.0], (8.5, 8.0), 16.0),
    AddTube([32.0, -81.0, 26.0], [47.0, -66.0, 19.0], (8.0, 6.0), 24.0),
    // Eye socket.
    Cut([32.0, -97.0, 7.0], [17.0, 14.0, 10.5], 14.0),
    Cut([16.5, -97.0, 7.0], [6.0, 10.0, 10.0], 10.0),
    // The muzzle over the teeth, and the fold beside it.
    Add([0.0, -77.0, -57.0], [30.0, 23.0, 26.0], 18.0),
    CutTube([21.0, -106.0, -38.0], [37.0, -95.0, -62.0], (5.0, 4.0), 18.0),
    // Below the lower lip, below the corners of the mouth.
    Cut([0.0, -106.0, -77.0], [18.0, 9.0, 4.5], 10.0),
    Cut([32.0, -92.0, -68.0], [6.0, 6.0, 6.0], 12.0),
];

/// Closed lids over the eyeball; the upper one overhangs the lower.
fn eyelids(p: DVec3, d: f64) -> f64 {
    let q = p - EYE;
    // The lash line sags towards the outer third; above it there is a fold, and the upper lid is the thicker one.
    let line = q.z + 5.0 - 0.022 * (q.x - 1.0) * (q.x - 1.0) + 0.06 * q.x;
    let fold = ((q.z - 7.0 + 0.016 * q.x * q.x) / 3.0).abs().min(1.0);
    let radius = 13.8 + 1.3 * smoothstep(-1.2, 1.2, line) - 1.2 * smoothstep(1.0, 0.0, fold);
    union(d, ellipsoid(q, DVec3::ZERO, dvec3(radius + 2.5, radius, radius - 0.5)), 6.0)
}

const NOSE_AND_MOUTH: [Part; 18] = [
    // Sides, bridge, back, tip, wing, column of the nose.
    AddTube([0.0, -80.0, 10.0], [0.0, -92.0, -30.0], (11.0, 16.0), 14.0),
    AddTube([0.0, -87.0, 18.0], [0.0, -97.0, 2.0], (7.0, 6.0), 14.0),
    AddTube([0.0, -96.0, 4.0], [0.0, -111.0, -26.0], (6.0, 8.5), 10.0),
    Add([0.0, -113.0, -30.0], [9.5, 9.0, 8.5], 8.0),
    Add([11.5, -102.0, -35.0], [7.0, 10.0, 7.5], 8.0),
    AddTube([0.0, -111.0, -36.0], [0.0, -94.0, -42.0], (4.5, 6.0), 8.0),
    // Nostril.
    CutTube([7.0, -109.0, -44.0], [6.5, -97.0, -31.0], (3.4, 3.4), 2.5),
    // Lips, upper and lower.
    AddTube([4.0, -96.5, -55.0], [23.0, -86.0, -60.0], (5.0, 2.6), 6.0),
    Add([0.0, -97.0, -57.0], [6.0, 5.5, 4.0], 6.0),
    AddTube([0.0, -94.5, -66.0], [11.0, -92.5, -65.5], (5.8, 5.2), 6.0),
    AddTube([11.0, -92.5, -65.5], [23.0, -86.0, -61.5], (5.2, 2.4), 6.0),
    // Between the lips, and their corner.
    CutTube([0.0, -102.0, -60.6], [9.0, -100.5, -60.2], (1.7, 1.6), 4.0),
    CutTube([9.0, -100.5, -60.2], [24.0, -90.5, -61.0], (1.6, 1.6), 4.0),
    Cut([27.0, -93.0, -61.5], [4.0, 6.0, 4.0], 8.0),
    // Groove above the upper lip.
    CutTube([0.0, -105.0, -45.0], [0.0, -105.0, -53.0], (3.0, 3.5), 6.0),
    // Tear corner, behind the wing of the nose.
    Cut([17.0, -92.0, 3.0], [3.0, 4.0, 2.6], 6.0),
    CutTube([18.5, -108.0, -28.0], [21.0, -100.0, -42.0], (2.0, 2.4), 7.0),
    AddTube([0.0, -96.0, -46.0], [0.0, -94.0, -50.0], (2.0, 2.0), 6.0),
];

fn ear(p: DVec3) -> f64 {
    // The ear's own axes: outwards, backwards along the flap, and upwards.
    let (out, back, up) = (dvec3(0.88, -0.46, -0.06), dvec3(0.44, 0.84, 0.32), dvec3(-0.1, -0.31, 0.945));
    let q = p - dvec3(74.5, 14.0, -4.0);
    let q = dvec3(q.dot(out), q.dot(back), q.dot(up));
    if q.length() > 60.0 {
        return q.length() - 40.0;
    }
    let flap = ellipsoid(q, dvec3(0.0, 0.0, 3.0), dvec3(3.5, 17.5, 28.0));
    // The outline is an ellipse that narrows towards the lobe.
    let outline = dvec2(q.y / (1.0 + 0.01 * (q.z - 5.0)), (q.z - 3.0) * 0.62);
    let rim = dvec2(outline.length() - 16.5, q.x - 1.5).length() - 3.0;
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
            Cut([7.0, -3.0, -3.0], [7.5, 9.0, 13.0], 4.0),
            Add([2.5, -13.0, -5.0], [4.0, 4.5, 7.0], 4.0),
        ],
    )
}

fn bone(p: DVec3) -> f64 {
    // The vault without its lower part, where the neck and the face are.
    let d = intersection(vault(p) + 6.5, floor(p) - 7.0, 8.0);
    let d = sculpt(p, d, &SKULL);
    let d = union(d, teeth(p), 2.0);
    let d = union(d, fossa(p) - 6.0, 8.0);
    // The spine: bodies in front of the canal, arches around it.
    let rings = 1.6 * wave(p.z / 17.0);
    let bodies = tube(p, dvec3(0.0, 20.0, -34.0), dvec3(0.0, 22.0, -140.0), (12.0, 13.0));
    let arches = tube(p, dvec3(0.0, 38.0, -44.0), SPINE.into(), (13.0, 14.5));
    let d = union(d, union(bodies, arches, 4.0) - rings, 4.0);
    // Bone keeps a minimum distance from the air: the thickness of the soft tissue over it.
    if d > 5.0 { d } else { intersection(d, skin(p) + 3.5, 3.0) }
}

/// Two rows of teeth on an elliptic arch.
fn teeth(p: DVec3) -> f64 {
    let (x, y) = (p.x / 25.0, (p.y + 50.0).min(0.0) / 34.0);
    let arch = (dvec2(x, y).length() - 1.0) * 28.0;
    // The position along the row of teeth: 0 in the middle of the face and 1 at the last molar.
    let along = x / (x - y + 1e-9);
    let gap = 0.9 * wave(8.0 * along - 0.25).max(0.0);
    let row = (p.z + 59.5).abs();
    let d = intersection(arch.abs() - 4.0 + 1.4 * gap, row - 11.0, 3.0);
    let d = intersection(d, p.y + 46.0, 2.0);
    intersection(d, 1.0 - row, 1.5)
}

/// Distance below the floor of the brain's cavity: shelves that descend from front to back.
fn floor(p: DVec3) -> f64 {
    24.0 - 26.0 * smoothstep(-48.0, -30.0, p.y) - 8.0 * smoothstep(10.0, 34.0, p.y) - p.z
}

const SKULL: [Part; 21] = [
    // Upper jaw, cheekbone and its arch, rim of the socket, bridge of the nose.
    Add([0.0, -58.0, -38.0], [29.0, 29.0, 19.0], 8.0),
    Add([28.0, -44.0, 6.0], [26.0, 13.0, 20.0], 12.0),
    AddTube([20.0, -74.0, -20.0], [46.0, -64.0, -14.0], (8.0, 8.0), 10.0),
    AddTube([46.0, -62.0, -14.0], [61.0, -24.0, -10.0], (5.5, 3.6), 6.0),
    AddTube([61.0, -24.0, -10.0], [61.0, 8.0, -9.0], (3.6, 5.0), 6.0),
    AddTube([50.0, -62.0, -12.0], [49.0, -64.0, 20.0], (5.0, 5.0), 8.0),
    AddTube([8.0, -84.0, 22.0], [48.0, -66.0, 22.0], (7.0, 6.0), 12.0),
    AddTube([0.0, -84.0, 22.0], [0.0, -92.0, 2.0], (8.0, 5.0), 8.0),
    AddTube([12.0, -78.0, 10.0], [17.0, -78.0, -24.0], (5.0, 6.0), 8.0),
    // Sockets of the teeth; lower jaw: joint, angle, chin.
    AddTube([0.0, -82.0, -76.0], [20.0, -66.0, -74.0], (8.0, 7.0), 8.0),
    AddTube([53.0, 2.0, -14.0], [43.0, -6.0, -56.0], (5.5, 6.5), 8.0),
    AddTube([49.0, -16.0, -16.0], [42.0, -14.0, -50.0], (3.5, 7.0), 14.0),
    AddTube([42.0, -10.0, -58.0], [14.0, -70.0, -86.0], (7.0, 7.5), 8.0),
    AddTube([14.0, -72.0, -86.0], [0.0, -82.0, -88.0], (7.5, 9.0), 8.0),
    AddTube([41.0, -20.0, -56.0], [21.0, -64.0, -74.0], (6.0, 7.0), 14.0),
    // The bump behind the ear, the base.
    AddTube([58.0, 22.0, -8.0], [54.0, 18.0, -36.0], (12.0, 6.0), 8.0),
    AddTube([0.0, -30.0, -8.0], [0.0, 26.0, -18.0], (18.0, 18.0), 12.0),
    // Eye socket, nasal opening, palate.
    CutTube([33.5, -94.0, 5.0], [14.0, -46.0, 8.0], (18.0, 5.0), 4.0),
    Cut([7.5, -92.0, -28.0], [7.5, 26.0, 10.0], 4.0),
    Cut([4.0, -90.0, -16.0], [6.0, 20.0, 16.0], 4.0),
    Cut([0.0, -46.0, -62.0], [20.0, 34.0, 14.0], 6.0),
];

fn cavity(p: DVec3) -> f64 {
    let d = intersection(vault(p) + 14.0, floor(p), 8.0);
    let d = union(d, fossa(p), 8.0);
    // The spinal canal.
    union(d, tube(p, dvec3(0.0, 36.0, -24.0), SPINE.into(), (10.0, 8.0)), 8.0)
}

/// The hollow in the back of the skull's base, for the cerebellum.
fn fossa(p: DVec3) -> f64 {
    ellipsoid(p, dvec3(0.0, 39.0, -9.0), dvec3(47.0, 36.0, 31.0))
}

/// The two deeply folded halves of the brain.
fn cerebrum(p: DVec3, room: f64) -> f64 {
    // The cleft between the halves ends above the bridge that connects them; behind it the cerebellum lies below.
    let bridge = ellipsoid(p, dvec3(0.0, 4.0, 34.0), dvec3(34.0, 40.0, 24.0));
    let cleft = intersection(p.x - 1.0, -bridge, 4.0);
    let below = 12.0 - 20.0 * smoothstep(36.0, 16.0, p.y) - 0.1 * p.x - p.z;
    let d = intersection(intersection(room, -cleft, 4.0), below, 6.0);
    let d = sculpt(p, d, &[CutTube([52.0, -36.0, 12.0], [68.0, 28.0, 40.0], (5.0, 3.5), 5.0)]);
    if (-28.0..8.0).contains(&d) { intersection(d, -furrow(p, -d), 3.5) } else { d }
}

/// Distance to the furrows between the folds: a warped labyrinth of sheets that closes with the depth below the surface.
fn furrow(p: DVec3, depth: f64) -> f64 {
    const PERIOD: f64 = 30.0;
    let warp = dvec3(wave(p.y / 71.0 + 0.1), wave(p.z / 63.0 + 0.4), wave(p.x / 67.0 + 0.8));
    let q = (p + 9.0 * warp) / PERIOD;
    let q = q + 0.06 * dvec3(wave(2.1 * q.z), wave(1.9 * q.x + 0.3), wave(2.3 * q.y + 0.6));
    let cosine = |t: f64| wave(t + 0.25);
    let sheet = wave(q.x) * cosine(q.y) + wave(q.y) * cosine(q.z) + wave(q.z) * cosine(q.x);
    sheet.abs() * PERIOD / 8.5 - 1.6 * (1.0 - (depth / 13.0).powi(3))
}

fn cerebellum(p: DVec3, room: f64) -> f64 {
    let d = ellipsoid(p, dvec3(20.0, 42.0, -8.0), dvec3(28.0, 30.0, 25.0));
    let d = intersection(intersection(d, room, 4.0), p.z - 9.0 + 0.1 * p.x, 6.0);
    d + 1.1 * wave((p.z + 0.25 * p.y + 0.006 * p.x * p.x) / 7.0)
}

fn brainstem(p: DVec3) -> f64 {
    sculpt(p, f64::INFINITY, &BRAINSTEM)
}

const BRAINSTEM: [Part; 4] = [
    AddTube([0.0, 12.0, 26.0], [0.0, 18.0, -2.0], (12.0, 12.0), 1.0),
    Add([0.0, 12.0, -4.0], [15.0, 13.0, 12.0], 6.0),
    AddTube([0.0, 18.0, -4.0], [0.0, 36.0, -40.0], (11.0, 6.0), 6.0),
    AddTube([0.0, 36.0, -40.0], SPINE, (6.0, 5.0), 4.0),
];

fn optic_nerve(p: DVec3) -> f64 {
    let chiasm = dvec3(4.0, -14.0, 8.0);
    let nerve = tube(p, dvec3(31.5, -66.0, 6.0), chiasm, (2.4, 2.2));
    union(nerve, tube(p, chiasm, dvec3(12.0, 10.0, 16.0), (2.2, 3.0)), 2.0)
}

/// All nervous tissue: grey outside, white below a depth of [`CORTEX`].
fn brain(p: DVec3) -> f64 {
    // The room that the fluid around the brain leaves.
    let room = cavity(p) + 2.5;
    cerebrum(p, room).min(cerebellum(p, room)).min(brainstem(p)).min(optic_nerve(p))
}

/// Grey matter deep inside: the thalamus and the putamen.
fn nuclei(p: DVec3) -> f64 {
    let thalamus = ellipsoid(p, dvec3(11.0, 10.0, 36.0), dvec3(8.0, 14.0, 8.0));
    thalamus.min(ellipsoid(p, dvec3(27.0, -4.0, 36.0), dvec3(5.0, 20.0, 10.0)))
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
