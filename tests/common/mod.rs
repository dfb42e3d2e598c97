//! Helpers that several tests share.

pub(crate) mod adapter;
pub(crate) mod cases;
pub(crate) mod compare;
#[cfg(feature = "gpu")]
pub(crate) mod devices;
pub(crate) mod images;
pub(crate) mod label_maps;
pub(crate) mod pool;
pub(crate) mod random_scene;
pub(crate) mod shared;
pub(crate) mod store;
#[cfg(feature = "gpu")]
pub(crate) mod surfaces;
pub(crate) mod tally;
pub(crate) mod values;

use glam::{DVec3, DVec4, UVec3};
use sheetsplat::scene::{ImageSettings, Scene, TransferSettings, VolumeSource};
use sheetsplat::settings::Ramp;
use sheetsplat::settings::{Camera, Projection};
use sheetsplat::settings::{Compositing, Light, Rasterizer, Shading, Splatting};
use sheetsplat::volume::{Grid, Volume};

/// The maximum relative error of rounding to the nearest f32.
pub(crate) const F32: f64 = 1.0 / (1 << 24) as f64;
/// The maximum relative error of rounding to the nearest f16; below 2⁻¹⁴ the absolute error is at most half a step of 2⁻²⁴.
pub(crate) const F16: f64 = 1.0 / (1 << 11) as f64;

/// Every way to composite sheets.
pub(crate) const COMPOSITINGS: [Compositing; Compositing::COUNT] = [
    Compositing::Linear,
    Compositing::Exponential,
    Compositing::Xray,
    Compositing::Maximum,
    Compositing::Minimum,
    Compositing::Average,
    Compositing::Surface,
];

/// The compositings by amounts, which need no sheets.
pub(crate) const BY_AMOUNTS: [Compositing; 3] = [Compositing::Linear, Compositing::Exponential, Compositing::Xray];

/// The compositings by means.
pub(crate) const BY_MEANS: [Compositing; 4] =
    [Compositing::Maximum, Compositing::Minimum, Compositing::Average, Compositing::Surface];

/// Both rasterizers, whatever `auto` would choose.
pub(crate) const RASTERIZERS: [Rasterizer; 2] = [Rasterizer::Quads, Rasterizer::Tiles];

/// Four f32 per pixel, as read back.
pub(crate) fn pixels(bytes: &[u8]) -> Vec<DVec4> {
    bytemuck::pod_collect_to_vec::<_, [f32; 4]>(bytes).iter().map(|pixel| DVec4::from(pixel.map(f64::from))).collect()
}

/// A scene that shows a whole volume, which the test supplies, classified before splatting unless the test says otherwise.
pub(crate) fn scene(width: u32, height: u32) -> Scene {
    let image = ImageSettings { width, height, ..ImageSettings::default() };
    let (camera, splatting) = (Camera::default(), Splatting::default());
    Scene { image, camera, splatting, ..Scene::new(VolumeSource::Builtin("cube".to_owned())) }
}

/// A material in the light of both kinds of sheets.
pub(crate) fn lit_by_sheets(shading: Shading) -> Shading {
    Shading {
        ambient: 0.6,
        diffuse: 0.4,
        light: Light::UpperLeft,
        occlusion: 0.8,
        shadow: 0.7,
        light_step: 1.5,
        ..shading
    }
}

/// An orthographic camera that shows `height` world units.
pub(crate) fn camera(direction: [f64; 3], height: f64) -> Camera {
    let projection = Projection::Orthographic { height: Some(height) };
    Camera { projection, direction: DVec3::from(direction), ..Camera::default() }
}

/// Balls in a haze of noise: values of 0 to 20, and of 150 to 250 in the balls. Dimensions are at least `least` and less than `end`, and
/// rarely multiples of a brick's side.
pub(crate) fn random_volume(random: &mut Random, (least, end): (f64, f64), spacing: [f64; 3]) -> Volume {
    let dims = UVec3::from([(); 3].map(|()| random.uniform(least, end) as u32));
    let balls: Vec<(DVec3, f64)> =
        (0..5).map(|_| (random.within(DVec3::ZERO, dims.as_dvec3()), random.uniform(0.06, 0.3) * end)).collect();
    let grid = Grid::new(dims, DVec3::from(spacing));
    let value = |index| {
        let p = grid.voxel_at(index).as_dvec3();
        let inside = balls.iter().any(|(center, radius)| p.distance(*center) < *radius);
        (if inside { random.uniform(150.0, 250.0) } else { random.uniform(0.0, 20.0) }) as f32
    };
    let values = (0..dims.element_product()).map(value).collect();
    Volume::new("random", dims, grid.spacing, values).unwrap()
}

/// Spacings of volumes in perspective.
pub(crate) const SPACINGS: [[f64; 3]; 4] = [[1.0, 1.0, 1.0], [1.0, 1.0, 3.0], [1.0, 1.0, 5.0], [3.0, 1.0, 2.0]];

/// An eye far outside a volume, close by, or inside it, that looks at the volume, past it, or out of it, at a narrow or wide angle. The near
/// plane is one `unit` away, or closer, or cuts the volume.
pub(crate) fn random_eye(random: &mut Random, grid: &Grid) -> Camera {
    let half = grid.center() * grid.spacing + grid.spacing;
    let place = random.bits() % 4;
    let position = match place {
        0 => random.direction() * half.length() * random.uniform(1.5, 4.0),
        1 => random.direction() * half.length() * random.uniform(0.8, 1.2),
        _ => random.within(-half, half),
    };
    let center = random.within(-half, half) * if place == 3 { 2.0 } else { 0.6 };
    let distance = (center - position).length();
    let near = random.pick(&[None, Some(0.3 * grid.unit()), Some(2.5 * grid.unit()), Some(0.5 * distance)]);
    let projection = Projection::Perspective { fov_y: random.uniform(10.0, 110.0), distance: Some(distance), near };
    Camera {
        projection,
        direction: center - position,
        up: random.direction(),
        center: Some(center),
        ..Camera::default()
    }
}

/// Control points of a colour and an opacity ramp.
pub(crate) fn transfer(color: &[(f64, [f64; 3])], opacity: &[(f64, f64)]) -> TransferSettings {
    TransferSettings {
        color: Some(Ramp::new(color.iter().map(|&(at, rgb)| (at, DVec3::from(rgb))).collect()).unwrap()),
        opacity: Some(Ramp::new(opacity.to_vec()).unwrap()),
        ..TransferSettings::default()
    }
}

/// SplitMix64, which gives the same numbers in every run.
#[derive(Debug)]
pub(crate) struct Random(pub(crate) u64);

impl Random {
    /// 64 random bits.
    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A uniform number in [low, high).
    pub(crate) fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A random choice.
    pub(crate) fn pick<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[self.bits() as usize % choices.len()]
    }

    /// A uniform point in a box.
    pub(crate) fn within(&mut self, low: DVec3, high: DVec3) -> DVec3 {
        low + DVec3::from([(); 3].map(|()| self.uniform(0.0, 1.0))) * (high - low)
    }

    /// A uniform direction.
    pub(crate) fn direction(&mut self) -> DVec3 {
        loop {
            let p = DVec3::from_array([(); 3].map(|()| self.uniform(-1.0, 1.0)));
            if (0.1..1.0).contains(&p.length()) {
                return p.normalize();
            }
        }
    }
}
