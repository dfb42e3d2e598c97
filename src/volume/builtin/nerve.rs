//! A ganglion nerve cell as a confocal microscope sees it: a cell body, dendrites that branch, and nothing around.

use glam::{DVec3, dvec3};
use rayon::prelude::*;

use super::sdf::{Grid, ellipsoid, smoothstep, wave};

/// The microscope's point spread: along z it blurs farther than within a slice.
const BLUR: DVec3 = dvec3(1.0, 1.0, 2.0);

/// Half the width of an edge, world units.
const SOFTNESS: f64 = 1.8;

/// Length of one straight piece of a dendrite.
const STEP: f64 = 4.0;

/// A dendrite does not get thinner than this.
const THINNEST: f64 = 2.0;

/// Half the box that the cell stays in.
const BOX: DVec3 = dvec3(246.0, 246.0, 178.0);

const SOMA: DVec3 = dvec3(40.0, 34.0, 37.0);

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
            let voxel = |p: DVec3| p / grid.spacing + (grid.dims.as_dvec3() - 1.0) / 2.0;
            let (low, high) = (voxel(low), voxel(high));
            if (z as f64) < low.z || z as f64 > high.z {
                return;
            }
            // Negative bounds become 0 in the conversion.
            for y in low.y.ceil() as u32..((high.y + 1.0).floor() as u32).min(grid.dims.y) {
                for x in low.x.ceil() as u32..((high.x + 1.0).floor() as u32).min(grid.dims.x) {
                    let p = grid.position(dvec3(f64::from(x), f64::from(y), z as f64));
                    let out = &mut values[x as usize + grid.dims.x as usize * y as usize];
                    *out = out.max(value(p).round() as f32);
                }
            }
        };
        put(-1.5 * SOMA, 1.5 * SOMA, &soma);
        for segment in &segments {
            let reach = (segment.radii.0.max(segment.radii.1) + SOFTNESS) * BLUR;
            put(segment.from.min(segment.to) - reach, segment.from.max(segment.to) + reach, &|p| segment.value(p));
        }
    });
    values
}

/// The cell body, uneven, with the nucleus darker and a bright nucleolus in it.
fn soma(p: DVec3) -> f64 {
    let bumps = wave(p.x / 43.0 + 0.1) * wave(p.y / 37.0) + wave(p.y / 41.0 + 0.3) * wave(p.z / 47.0);
    let nucleus = ellipsoid(p, dvec3(6.0, -4.0, 3.0), dvec3(17.0, 16.0, 16.0));
    let nucleolus = (p - dvec3(9.0, -1.0, 5.0)).length() - 5.0;
    let inside = 250.0 - 75.0 * smoothstep(2.0, -2.0, nucleus) + 80.0 * smoothstep(2.0, -2.0, nucleolus);
    inside.min(255.0) * coverage(ellipsoid(p, DVec3::ZERO, SOMA) - 1.6 * bumps)
}

fn coverage(distance: f64) -> f64 {
    smoothstep(SOFTNESS, -SOFTNESS, distance)
}

impl Segment {
    fn value(&self, p: DVec3) -> f64 {
        let (axis, q) = ((self.to - self.from) / BLUR, (p - self.from) / BLUR);
        let t = (q.dot(axis) / axis.length_squared()).clamp(0.0, 1.0);
        let between = |(from, to): (f64, f64)| from + t * (to - from);
        between(self.values) * coverage((q - t * axis).length() - between(self.radii))
    }
}

/// SplitMix64: the same numbers on every machine.
struct Random(u64);

impl Random {
    /// Uniform in [0, 1).
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

    /// Uniform in the unit ball.
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
    /// Rate at which the direction turns: changes slowly, so that dendrites are curved and not jagged.
    turn: DVec3,
    radius: f64,
    /// World units from the cell body.
    path: f64,
    /// World units until it branches.
    branch: f64,
}

/// All dendrites, from the cell body to the last twig.
fn grow() -> Vec<Segment> {
    /// Where the primary dendrites leave, and how thick they are.
    const PRIMARY: [([f64; 3], f64); 8] = [
        ([1.0, 0.15, 0.25], 11.0),
        ([0.35, 0.9, -0.2], 9.5),
        ([-0.7, 0.75, 0.35], 9.0),
        ([-1.0, -0.1, -0.3], 11.5),
        ([-0.45, -0.85, 0.45], 9.0),
        ([0.5, -0.9, -0.25], 10.0),
        ([0.3, 0.1, 1.0], 8.5),
        ([-0.2, 0.25, -1.0], 8.0),
    ];
    let random = &mut Random(11);
    let mut segments = Vec::new();
    let mut tips: Vec<Tip> = PRIMARY
        .iter()
        .map(|&(direction, radius)| {
            let direction = DVec3::from(direction).normalize();
            let branch = random.between(35.0, 75.0);
            Tip { at: direction * SOMA * 0.7, direction, turn: DVec3::ZERO, radius, path: 0.0, branch }
        })
        .collect();
    while let Some(mut tip) = tips.pop() {
        let steps = tip.path + random.between(150.0, 340.0) + 14.0 * tip.radius;
        while tip.path < steps && (tip.at.abs() + tip.radius).cmplt(BOX).all() {
            let before = (tip.at, tip.radius, tip.value());
            tip.advance(random);
            segments.push(Segment {
                from: before.0,
                to: tip.at,
                radii: (before.1, tip.radius),
                values: (before.2, tip.value()),
            });
            if tip.radius < 3.0 && random.uniform() < 0.10 {
                segments.push(tip.spine(random));
            }
            if tip.branch < 0.0 && tip.radius > 1.15 * THINNEST {
                tips.push(tip.fork(random));
            }
        }
    }
    segments
}

impl Tip {
    /// Fades from the cell body outwards.
    fn value(&self) -> f64 {
        130.0 + 110.0 / (1.0 + self.path / 90.0)
    }

    fn advance(&mut self, random: &mut Random) {
        self.turn = 0.86 * self.turn + 0.075 * random.in_ball();
        // Outwards, but along the walls of the box rather than through them.
        let wall = self.at / BOX * (self.at / BOX).abs() * (self.at / BOX).abs();
        let outwards = 0.012 * self.at.normalize_or_zero() - 0.11 * wall;
        self.direction = (self.direction + self.turn + outwards).normalize();
        self.at += STEP * self.direction;
        self.path += STEP;
        self.branch -= STEP;
        // The trunk's base flares into the cell body.
        let taper = if self.path < 40.0 { 0.965 } else { 0.9945 };
        self.radius = (self.radius * taper).max(THINNEST);
    }

    /// A thin bump on the side of a twig.
    fn spine(&self, random: &mut Random) -> Segment {
        let aside = random.in_ball();
        let aside = (aside - aside.dot(self.direction) * self.direction).normalize_or(DVec3::Z);
        let to = self.at + (self.radius + random.between(2.5, 5.0)) * aside;
        Segment { from: self.at, to, radii: (1.0, 1.7), values: (self.value(), self.value()) }
    }

    /// Splits into two: this one goes on, the other is returned. Their cross sections follow Rall's 3/2 power law.
    fn fork(&mut self, random: &mut Random) -> Self {
        let share = random.between(0.25, 0.5);
        let aside = random.in_ball() * dvec3(1.0, 1.0, 0.8);
        let aside = (aside - aside.dot(self.direction) * self.direction).normalize_or(DVec3::X);
        let radius = |share: f64| (self.radius * libm::cbrt(share * share)).max(THINNEST);
        let (thin, thick) = (radius(share), radius(1.0 - share));
        let (away, little) = (random.between(0.7, 1.1), random.between(0.2, 0.45));
        let other = Self {
            at: self.at,
            direction: (self.direction + away * aside).normalize(),
            turn: DVec3::ZERO,
            radius: thin,
            path: self.path,
            branch: random.between(30.0, 90.0),
        };
        self.direction = (self.direction - little * aside).normalize();
        self.radius = thick;
        self.branch = random.between(30.0, 90.0);
        other
    }
}
