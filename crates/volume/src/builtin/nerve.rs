//! A ganglion nerve cell as a confocal microscope sees it: a cell body and branching dendrites in empty space.

use glam::{DVec3, UVec3, dvec3};

use super::Grid;
use super::sdf::{ellipsoid, smoothstep, wave};
use crate::parallel::prelude::*;

/// By how many world units a tube appears thicker along z, where the microscope blurs more.
const BLUR: f64 = 2.2;

/// Half the width of an edge in world units, within a slice and along z.
const SOFTNESS: (f64, f64) = (1.8, 4.5);

/// Length of one straight piece of a dendrite.
const STEP: f64 = 4.0;

/// The minimum radius of a dendrite.
const THINNEST: f64 = 2.0;

/// Half the size of the box that contains the cell.
const BOX: DVec3 = dvec3(246.0, 246.0, 178.0);

const SOMA: DVec3 = dvec3(46.0, 39.0, 41.0);

/// A piece of a dendrite: a straight tube that tapers and darkens from `from` to `to`.
struct Segment {
    from: DVec3,
    to: DVec3,
    radii: (f64, f64),
    values: (f64, f64),
}

pub(super) fn values(grid: &Grid) -> Vec<f32> {
    let segments = grow();
    let slice = grid.dims.x as usize * grid.dims.y as usize;
    let mut values = vec![0.0_f32; slice * grid.dims.z as usize];
    values.par_chunks_mut(slice).enumerate().for_each(|(z, values)| {
        let mut put = |low: DVec3, high: DVec3, value: &dyn Fn(DVec3) -> f64| {
            let voxel = |p: DVec3| p / grid.spacing + grid.center();
            let (low, high) = (voxel(low), voxel(high));
            if (z as f64) < low.z || z as f64 > high.z {
                return;
            }
            // Negative bounds become 0 in the conversion.
            for y in low.y.ceil() as u32..((high.y + 1.0).floor() as u32).min(grid.dims.y) {
                for x in low.x.ceil() as u32..((high.x + 1.0).floor() as u32).min(grid.dims.x) {
                    let p = grid.world_position(UVec3::new(x, y, z as u32));
                    let out = &mut values[x as usize + grid.dims.x as usize * y as usize];
                    *out = out.max(value(p).round() as f32);
                }
            }
        };
        put(-1.5 * SOMA, 1.5 * SOMA, &soma);
        for segment in &segments {
            let reach = (segment.radii.0.max(segment.radii.1) + SOFTNESS.1) * segment.blur();
            put(segment.from.min(segment.to) - reach, segment.from.max(segment.to) + reach, &|p| segment.value(p));
        }
    });
    values
}

/// The uneven cell body, with a darker nucleus and a bright nucleolus in it.
fn soma(p: DVec3) -> f64 {
    let bumps = wave(p.x / 43.0 + 0.1) * wave(p.y / 37.0) + wave(p.y / 41.0 + 0.3) * wave(p.z / 47.0);
    let nucleus = ellipsoid(p, dvec3(6.0, -4.0, 3.0), dvec3(17.0, 16.0, 16.0));
    let nucleolus = (p - dvec3(9.0, -1.0, 5.0)).length() - 5.0;
    let inside = 250.0 - 75.0 * smoothstep(2.0, -2.0, nucleus) + 80.0 * smoothstep(2.0, -2.0, nucleolus);
    inside.min(255.0) * coverage(ellipsoid(p, DVec3::ZERO, SOMA) - 1.6 * bumps, p / SOMA)
}

/// The fraction of a voxel that is inside, from the distance to the surface and its normal there (of any length).
fn coverage(distance: f64, normal: DVec3) -> f64 {
    let along_z = normal.z * normal.z / normal.length_squared().max(1e-12);
    let soft = SOFTNESS.0 + (SOFTNESS.1 - SOFTNESS.0) * along_z;
    smoothstep(soft, -soft, distance)
}

impl Segment {
    /// How much longer the tube's cross section is along each axis because of the blur.
    fn blur(&self) -> DVec3 {
        dvec3(1.0, 1.0, 1.0 + BLUR / self.radii.0)
    }

    fn value(&self, p: DVec3) -> f64 {
        let blur = self.blur();
        let (axis, q) = ((self.to - self.from) / blur, (p - self.from) / blur);
        let t = (q.dot(axis) / axis.length_squared()).clamp(0.0, 1.0);
        let between = |(from, to): (f64, f64)| from + t * (to - from);
        let away = q - t * axis;
        between(self.values) * coverage(away.length() - between(self.radii), away)
    }
}

/// SplitMix64, which gives the same numbers on every machine.
struct Random(u64);

impl Random {
    /// A uniform number in [0, 1).
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + self.uniform() * (high - low)
    }

    /// A uniform point in the unit ball.
    fn in_ball(&mut self) -> DVec3 {
        loop {
            let p = DVec3::from_array(std::array::from_fn(|_| self.between(-1.0, 1.0)));
            if p.length_squared() <= 1.0 {
                return p;
            }
        }
    }
}

/// The tip of a growing dendrite.
struct Tip {
    at: DVec3,
    direction: DVec3,
    /// The rate at which the direction turns. It changes slowly, so that dendrites are curved, not jagged.
    turn: DVec3,
    radius: f64,
    /// The value that the radius tends to.
    goal: f64,
    /// The distance grown from the cell body, in world units.
    path: f64,
    /// The distance to the next branch, in world units.
    branch: f64,
}

/// All dendrites, from the cell body to the last twig.
fn grow() -> Vec<Segment> {
    /// Where the primary dendrites start, and their radii.
    const PRIMARY: [([f64; 3], f64); 8] = [
        ([1.0, 0.15, 0.25], 13.0),
        ([0.35, 0.9, -0.2], 10.0),
        ([-0.7, 0.75, 0.35], 10.0),
        ([-1.0, -0.1, -0.3], 13.5),
        ([-0.45, -0.85, 0.45], 10.0),
        ([0.5, -0.9, -0.25], 12.0),
        ([0.3, 0.1, 1.0], 9.5),
        ([-0.2, 0.25, -1.0], 9.5),
    ];
    let random = &mut Random(11);
    let mut segments = Vec::new();
    let mut tips: Vec<Tip> = PRIMARY
        .iter()
        .map(|&(direction, radius)| {
            let direction = DVec3::from(direction).normalize();
            let branch = random.between(35.0, 75.0);
            Tip { at: direction * SOMA * 0.6, direction, turn: DVec3::ZERO, radius, goal: radius, path: 0.0, branch }
        })
        .collect();
    while let Some(mut tip) = tips.pop() {
        let end = tip.path + random.between(60.0, 180.0) + 18.0 * tip.radius;
        while tip.path < end && (tip.at.abs() + tip.radius).cmplt(BOX).all() {
            let before = (tip.at, tip.radius, tip.value());
            tip.advance(random);
            segments.push(Segment {
                from: before.0,
                to: tip.at,
                radii: (before.1, tip.radius),
                values: (before.2, tip.value()),
            });
            if tip.radius < 3.0 && random.uniform() < 0.08 {
                segments.push(tip.spine(random));
            }
            if tip.branch < 0.0 && tip.radius > 1.15 * THINNEST {
                tips.push(tip.fork(random));
            }
        }
        segments.push(tip.end());
    }
    segments
}

impl Tip {
    /// The value at the tip, which fades from the cell body outwards.
    fn value(&self) -> f64 {
        130.0 + 110.0 / (1.0 + self.path / 90.0)
    }

    fn advance(&mut self, random: &mut Random) {
        self.turn = 0.85 * self.turn + 0.06 * random.in_ball();
        // The tip grows outwards, but along the walls of the box rather than through them.
        let wall = self.at / BOX * (self.at / BOX).abs() * (self.at / BOX).abs();
        let outwards = 0.03 * self.at.normalize_or_zero() - 0.12 * wall;
        self.direction = (self.direction + self.turn + outwards).normalize();
        self.at += STEP * self.direction;
        self.path += STEP;
        self.branch -= STEP;
        // The trunk's base flares into the cell body.
        let taper = if self.path < 40.0 { 0.965 } else { 0.9945 };
        self.goal = (self.goal * taper).max(THINNEST);
        self.radius += 0.3 * (self.goal - self.radius);
    }

    /// The last piece, which tapers off.
    fn end(&self) -> Segment {
        let to = self.at + 2.5 * STEP * self.direction;
        Segment { from: self.at, to, radii: (self.radius, 0.4), values: (self.value(), self.value()) }
    }

    /// A thin bump on the side of a twig.
    fn spine(&self, random: &mut Random) -> Segment {
        let aside = random.in_ball();
        let aside = (aside - aside.dot(self.direction) * self.direction).normalize_or(DVec3::Z);
        let to = self.at + (self.radius + random.between(2.5, 5.0)) * aside;
        Segment { from: self.at, to, radii: (1.0, 1.7), values: (self.value(), self.value()) }
    }

    /// Splits into two: this tip continues, the other one is returned. Their cross sections follow Rall's 3/2 power law.
    fn fork(&mut self, random: &mut Random) -> Self {
        let share = random.between(0.25, 0.5);
        let aside = random.in_ball() * dvec3(1.0, 1.0, 0.8);
        let aside = (aside - aside.dot(self.direction) * self.direction).normalize_or(DVec3::X);
        let radius = |share: f64| (self.goal * libm::cbrt(share * share)).max(THINNEST);
        let (thin, thick) = (radius(share), radius(1.0 - share));
        let (away, little) = (random.between(0.7, 1.1), random.between(0.2, 0.45));
        let other = Self {
            at: self.at,
            direction: (self.direction + away * aside).normalize(),
            turn: DVec3::ZERO,
            radius: thin,
            goal: thin,
            path: self.path,
            branch: random.between(30.0, 90.0),
        };
        self.direction = (self.direction - little * aside).normalize();
        self.goal = thick;
        self.branch = random.between(30.0, 90.0);
        other
    }
}
