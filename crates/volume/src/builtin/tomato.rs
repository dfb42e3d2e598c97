//! A tomato in a magnetic resonance scan: wall, gel, placenta, core and seeds. The stem is at +z.

use std::f64::consts::TAU;
use std::sync::LazyLock;

use glam::{DVec2, DVec3, dvec2, dvec3};

use super::Grid;
use super::sdf::{Layer, ellipsoid, intersection, smoothstep, tube, union, wave};

/// The number of chambers around the core.
const COUNT: usize = 5;

/// Half the thickness of the walls between chambers, and the thickness of the outer wall.
const SEPTUM: f64 = 4.5;
const WALL: f64 = 15.0;

/// The number of seeds in each chamber.
const SEEDS: u32 = 22;

/// The labels' names.
pub(super) const LABELS: &[(u16, &str)] = &[
    (0, "air"),
    (label::WALL, "wall"),
    (label::GEL, "gel"),
    (label::PLACENTA, "placenta"),
    (label::CORE, "core"),
    (label::SEEDS, "seeds"),
];

mod label {
    pub(super) const WALL: u16 = 1;
    pub(super) const GEL: u16 = 2;
    pub(super) const PLACENTA: u16 = 3;
    pub(super) const CORE: u16 = 4;
    pub(super) const SEEDS: u16 = 5;
}

pub(super) fn painted(grid: &Grid) -> (Vec<f32>, Vec<u16>) {
    let mut layers = vec![
        Layer::new(90.0, label::WALL, outside),
        Layer::new(50.0, label::GEL, chambers),
        Layer::new(140.0, label::PLACENTA, placenta),
        Layer::new(170.0, label::CORE, core),
    ];
    layers.extend((0..COUNT as u32 * SEEDS).map(|index| {
        let seed = Seed::new(index);
        Layer::new(230.0, label::SEEDS, move |p| seed.distance(p))
    }));
    grid.paint(&layers)
}

/// A chamber's directions from the core.
struct Chamber {
    /// The middle direction.
    axis: DVec2,
    /// The directions of the septa on both sides.
    sides: [DVec2; 2],
}

/// The chambers, whose widths differ.
static CHAMBERS: LazyLock<[Chamber; COUNT]> = LazyLock::new(|| {
    let axes = [0.03, 0.235, 0.42, 0.63, 0.825].map(|turn| dvec2(libm::cos(TAU * turn), libm::sin(TAU * turn)));
    std::array::from_fn(|i| Chamber {
        axis: axes[i],
        sides: [1, COUNT - 1].map(|step| (axes[(i + step) % COUNT] - axes[i]).normalize()),
    })
});

/// The skin: a flattened ball with a shallow furrow over every septum, a dimple at the stem, and a stub of the stem.
fn outside(p: DVec3) -> f64 {
    let xy = p.truncate();
    let across = sector(xy);
    let shoulder = smoothstep(-70.0, 60.0, p.z);
    // Deep near the stem, shallow elsewhere; its width grows with the distance from the fruit's axis.
    let width = 0.55 * xy.length() + 1.0;
    let furrow = (4.0 + 8.0 * shoulder) * smoothstep(8.0, 60.0, xy.length()) * smoothstep(-width, 0.0, across);
    let body = union(
        ellipsoid(p, dvec3(0.0, 0.0, 4.0), dvec3(114.0, 114.0, 74.0)),
        ellipsoid(p, dvec3(0.0, 0.0, -16.0), dvec3(98.0, 98.0, 68.0)),
        30.0,
    );
    let dimple = ellipsoid(p, dvec3(0.0, 0.0, 92.0), dvec3(42.0, 42.0, 30.0));
    let d = intersection(body + furrow, -dimple, 26.0);
    union(d, tube(p, dvec3(0.0, 0.0, 50.0), dvec3(4.0, 3.0, 78.0), (7.0, 5.0)), 8.0)
}

/// Distance to the nearest chamber's wedge (negative inside), whose sides are the planes halfway to its neighbours.
fn sector(xy: DVec2) -> f64 {
    let wedges = CHAMBERS.iter().map(|chamber| chamber.sides.map(|side| side.dot(xy)));
    wedges.map(|[a, b]| intersection(a, b, 14.0)).fold(f64::INFINITY, f64::min)
}

/// The gel: within the outer wall, around the core, between the septa.
fn chambers(p: DVec3) -> f64 {
    let d = intersection(sector(p.truncate()) + SEPTUM, outside(p) + WALL, 18.0);
    intersection(d, 14.0 - core(p), 12.0)
}

/// The tissue that carries the seeds: from the core into every chamber.
fn placenta(p: DVec3) -> f64 {
    let lobes = CHAMBERS.iter().map(|chamber| {
        let center = (chamber.axis * 42.0).extend(-4.0);
        ellipsoid(p, center, dvec3(21.0, 21.0, 38.0))
    });
    let lobes = lobes.fold(f64::INFINITY, f64::min);
    let bumps = wave(p.x / 23.0) * wave(p.y / 19.0 + 0.2) + wave(p.z / 21.0);
    intersection(lobes - 1.5 * bumps, chambers(p), 4.0)
}

/// The column in the middle, widest under the stem.
fn core(p: DVec3) -> f64 {
    union(
        tube(p, dvec3(0.0, 0.0, 46.0), dvec3(0.0, 0.0, -44.0), (19.0, 15.0)),
        ellipsoid(p, dvec3(0.0, 0.0, 40.0), dvec3(34.0, 34.0, 14.0)),
        16.0,
    )
}

/// A flattened drop, its long axis away from the placenta.
struct Seed {
    center: DVec3,
    /// The directions along, across and through the seed.
    axes: [DVec3; 3],
}

impl Seed {
    fn new(index: u32) -> Self {
        let (chamber, index) = ((index / SEEDS) as usize, index % SEEDS);
        let out = CHAMBERS[chamber].axis;
        let side = out.perp();
        // The seeds lie on a golden spiral over the outer half of the placenta, with jitter so that rows do not show.
        let jitter =
            |k: u32| wave(f64::from(index * (2 * k + 3) + chamber as u32 * 7) * 0.618_034 + 0.1 * f64::from(k));
        let z = 1.0 - 2.0 * (f64::from(index) + 0.5) / f64::from(SEEDS);
        let angle = (f64::from(index) * 0.381_966).fract() - 0.5;
        let r = (1.0 - z * z).sqrt();
        let turn = dvec2(libm::cos(angle * 3.6), libm::sin(angle * 3.6)) * r;
        let away = (out * turn.x + side * turn.y).extend(z);
        let center = (out * 44.0).extend(-4.0) + away * dvec3(25.0, 25.0, 43.0) * (1.0 + 0.05 * jitter(1));
        let long = (away + 0.4 * dvec3(jitter(2), jitter(3), jitter(4))).normalize();
        let wide = long.cross(dvec3(jitter(5), jitter(6), 1.3)).normalize_or(DVec3::X);
        Self { center, axes: [long, wide, long.cross(wide)] }
    }

    fn distance(&self, p: DVec3) -> f64 {
        const RADII: DVec3 = dvec3(8.0, 5.6, 3.2);
        let q = p - self.center;
        let length = q.length();
        if length > 16.0 {
            return length - 8.0;
        }
        ellipsoid(DVec3::from(self.axes.map(|axis| axis.dot(q))), DVec3::ZERO, RADII)
    }
}
