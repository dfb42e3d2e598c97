//! Light sheets (SPEC §14): the f64 evaluation of `src/light/`. A second splatting, seen from the light, leaves in every sheet what light remains (Nulkar and
//! Mueller, *Splatting with shadows*, Volume Graphics 2001); a box filter spreads it from sheet to sheet (Schott and others, *A directional occlusion
//! shading model for interactive direct volume rendering*, 2009).

use std::sync::Arc;

use glam::{DVec3, DVec4};

use super::opacity::{alpha, amount};
use super::{Buffer, Geometry, Section, Splat, sheets, splat};
use crate::error::RenderError;
use crate::error::setting::scaled;
use crate::kernel::Kernel;
use crate::lists::classify::channels;
use crate::parallel::prelude::*;
use crate::scene::Scene;
use crate::settings::clip::HalfSpace;
use crate::settings::light::Light;
use crate::settings::splatting::Compositing;
use crate::settings::transfer_function::TransferFunction;
use crate::volume::{Grid, Volume};

/// The light that a scene's shading takes from light sheets.
#[derive(Clone, Debug, Default)]
pub struct Lights {
    /// The amount of occlusion, and its sheets.
    occlusion: Option<(f64, Arc<LightSheets>)>,
    /// The amount of shadow, and its sheets.
    shadow: Option<(f64, Arc<LightSheets>)>,
    /// Where the grid's centre lies whose voxels light is made of, in `unit`s.
    place: DVec3,
    /// From that centre to that of the grid whose points are lit.
    offset: DVec3,
}

/// A and S: what is left of ambient and of other light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Left {
    /// A.
    pub ambient: f64,
    /// S.
    pub direct: f64,
}

impl Left {
    /// All light.
    pub const ALL: Self = Self { ambient: 1.0, direct: 1.0 };
}

impl Lights {
    /// The light sheets of a scene whose camera is framed; of all channels, whatever part of the image is drawn.
    ///
    /// # Errors
    /// If the scene needs more than can be computed.
    pub fn new(volume: &Volume, transfer: &[TransferFunction], scene: &Scene) -> Result<Self, RenderError> {
        let shading = &scene.shading;
        if !shading.enabled {
            return Ok(Self::default());
        }
        let basis = scene.camera.basis();
        let to_light = match shading.light {
            Light::Headlight => -basis.w,
            Light::UpperLeft => (basis.v / 2.0 - basis.u / 2.0 - basis.w).normalize(),
            Light::Direction(direction) => scaled(direction).normalize(),
        };
        let sheets = |amount: f64, to_light: DVec3, spread: f64| {
            let sheets = || LightSheets::new((volume, transfer), scene, to_light, spread);
            (amount > 0.0).then(|| sheets().map(|sheets| (amount, Arc::new(sheets)))).transpose()
        };
        Ok(Self {
            occlusion: sheets(shading.occlusion, -basis.w, shading.occlusion_spread)?,
            shadow: sheets(shading.shadow, to_light, shading.shadow_spread)?,
            place: volume.grid().place() / volume.grid().unit(),
            offset: DVec3::ZERO,
        })
    }

    /// The given light sheets, or a scene's.
    pub(super) fn or_new(
        given: Option<&Arc<Self>>,
        volume: &Volume,
        transfer: &[TransferFunction],
        scene: &Scene,
    ) -> Result<Arc<Self>, RenderError> {
        given.map_or_else(|| Self::new(volume, transfer, scene).map(Arc::new), |given| Ok(Arc::clone(given)))
    }

    /// The same light for points of another grid of the volume: of another level, or of a box.
    pub fn on(&self, grid: &Grid) -> Self {
        Self { offset: grid.place() / grid.unit() - self.place, ..self.clone() }
    }

    /// The light that is left at a point, in `unit`s from the grid's centre.
    pub fn left(&self, p: DVec3) -> Left {
        let p = p + self.offset;
        let left = |light: &Option<(f64, Arc<LightSheets>)>| {
            light.as_ref().map_or(1.0, |(amount, sheets)| 1.0 - amount * (1.0 - sheets.at(p)))
        };
        Left { ambient: left(&self.occlusion), direct: left(&self.shadow) }
    }
}

/// The light that each plane gets from one direction.
#[derive(Clone, Debug)]
pub struct LightSheets {
    geometry: Geometry,
    /// `b·l`, by which points are moved towards the light.
    bias: DVec3,
    /// The first plane's number.
    pub first: i32,
    /// T of every plane, row by row; empty if no voxel takes part.
    pub planes: Vec<Vec<f64>>,
}

impl LightSheets {
    /// The sheets towards the unit vector `to_light`, whose light gains the variance `spread` in `unit`s² per `unit` of its way.
    ///
    /// # Errors
    /// If the scene needs more than can be computed.
    pub fn new(
        (volume, transfer): (&Volume, &[TransferFunction]),
        scene: &Scene,
        to_light: DVec3,
        spread: f64,
    ) -> Result<Self, RenderError> {
        let step = scene.shading.light_step;
        let geometry = Geometry::of_light(volume.grid(), scene, to_light)?;
        let kernel = Kernel::new(scene.splatting.radius, scene.splatting.falloff);
        let clip = scene.clip.half_spaces(volume.grid());
        let (voxels, splats) = lit_voxels((volume, transfer), &geometry, &clip);
        let buckets = sheets::buckets(&voxels, &splats, &geometry, &kernel);
        let bias = to_light * scene.splatting.radius * (geometry.grid.aspect() * to_light).length();
        let (Some(first), Some(last)) = (buckets.keys().next(), buckets.keys().next_back()) else {
            return Ok(Self { geometry, bias, first: 0, planes: Vec::new() });
        };
        let weights = box_weights(spread / step);
        let width = geometry.size.x as usize;
        let mut planes = vec![vec![1.0; width * width]];
        for k in *first..=*last {
            let amounts = match buckets.get(&k) {
                Some(bucket) => sheet(bucket, &splats, k, &geometry, &kernel),
                None => Buffer::new(width as u32, width as u32),
            };
            let before = &planes[planes.len() - 1];
            let after: Vec<f64> = before.iter().zip(&amounts.pixels).map(|(t, a)| t * (-a.w).exp()).collect();
            planes.push(spread_light(&spread_light(&after, width, 1, &weights), width, width, &weights));
        }
        Ok(Self { first: *first, geometry, bias, planes })
    }

    /// T at a point, in `unit`s from the grid's centre.
    pub fn at(&self, p: DVec3) -> f64 {
        let Some(last) = self.planes.len().checked_sub(1) else { return 1.0 };
        let q = p + self.bias;
        let from_middle = q - self.geometry.center;
        let (basis, middle) = (&self.geometry.basis, self.geometry.size / 2.0 - 0.5);
        let x = middle.x + basis.u.dot(from_middle) / self.geometry.pix;
        let y = middle.y - basis.v.dot(from_middle) / self.geometry.pix;
        let z = self.geometry.orthographic_depth(q) / self.geometry.slab_width - f64::from(self.first);
        let z = z.clamp(0.0, last as f64);
        let near = (z.floor() as usize).min(last);
        let far = (near + 1).min(last);
        let [a, b] = [near, far].map(|plane| self.in_plane(plane, x, y));
        a + (b - a) * (z - near as f64)
    }

    /// T in a plane, between pixel centres; 1 beyond the image.
    fn in_plane(&self, plane: usize, x: f64, y: f64) -> f64 {
        let width = self.geometry.size.x as i64;
        let at = |x: i64, y: i64| {
            let is_inside = (0..width).contains(&x) && (0..width).contains(&y);
            if is_inside { self.planes[plane][(x + y * width) as usize] } else { 1.0 }
        };
        let (left, top) = (x.floor() as i64, y.floor() as i64);
        let row = |y: i64| {
            let (a, b) = (at(left, y), at(left + 1, y));
            a + (b - a) * (x - x.floor())
        };
        row(top) + (row(top + 1) - row(top)) * (y - y.floor())
    }
}

/// The voxels that take part, whatever `near` is, and whose centres no cut leaves out: their indices, and their splats, which have amounts alone.
fn lit_voxels(
    (volume, transfer): (&Volume, &[TransferFunction]),
    geometry: &Geometry,
    clip: &[HalfSpace],
) -> (Vec<u32>, Vec<Splat>) {
    let grid = volume.grid();
    let splat = |index: u32| {
        let voxel = grid.voxel_at(index);
        let of_channel = |(volume, transfer)| amount(Compositing::Exponential, alpha(volume, transfer, index));
        let sum: f64 = channels(volume, transfer).map(of_channel).sum();
        let p = grid.world_position(voxel) / grid.unit();
        let is_kept = clip.iter().all(|HalfSpace { normal, offset }| normal.dot(p) + offset >= 0.0);
        let amount = DVec4::W * sum * geometry.scale(voxel);
        let splat = Splat { center: geometry.pixel(voxel), depth: geometry.depth(voxel), amount, alpha: 1.0 };
        (is_kept && sum > 0.0).then_some((index, splat))
    };
    (0..volume.values().len() as u32).into_par_iter().filter_map(splat).collect::<Vec<_>>().into_iter().unzip()
}

/// The amounts `sheet.a` of a slab.
fn sheet(bucket: &[u32], splats: &[Splat], k: i32, geometry: &Geometry, kernel: &Kernel) -> Buffer {
    let section = |&index: &u32| geometry.section(&splats[index as usize], k, kernel);
    let sections: Vec<Section> = bucket.iter().filter_map(section).collect();
    let mut sheet = Buffer::new(geometry.size.x as u32, geometry.size.y as u32);
    splat::draw(&sections, kernel, &mut sheet, |pixel, amount| *pixel += amount);
    sheet
}

/// The weights of the box filter of a variance in pixels², at offsets from 0 on: 1 up to ⌊h⌋ and `h - ⌊h⌋` behind, each over `2h + 1`.
pub fn box_weights(variance: f64) -> Vec<f64> {
    let weights = |h: f64| -> Vec<f64> {
        let offsets = 0..=h.floor() as u32 + 1;
        offsets.map(|offset| (h + 1.0 - f64::from(offset)).clamp(0.0, 1.0) / (2.0 * h + 1.0)).collect()
    };
    let variance_of =
        |h: f64| (0_u32..).zip(weights(h)).map(|(at, weight)| 2.0 * f64::from(at * at) * weight).sum::<f64>();
    // The variance grows with h, and that of h is at least h²/3.
    let [mut low, mut high] = [0.0, (3.0 * variance).sqrt() + 1.0];
    for _ in 0..100 {
        let middle = (low + high) / 2.0;
        if variance_of(middle) <= variance {
            low = middle;
        } else {
            high = middle;
        }
    }
    weights(low)
}

/// A plane filtered along lines whose pixels are `step` apart, of planes of `width` pixels along each side; beyond the image T is 1.
fn spread_light(plane: &[f64], width: usize, step: usize, weights: &[f64]) -> Vec<f64> {
    let pixel = |at: usize| {
        let along = at / step % width;
        let tap = |offset: i64| {
            let place = along as i64 + offset;
            if (0..width as i64).contains(&place) { plane[(at as i64 + offset * step as i64) as usize] } else { 1.0 }
        };
        let pair = |(offset, weight): (i64, &f64)| weight * (tap(offset) + tap(-offset));
        weights[0] * tap(0) + (1..).zip(&weights[1..]).map(pair).sum::<f64>()
    };
    (0..plane.len()).into_par_iter().map(pixel).numbers()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn box_filters_have_their_variance() {
        for variance in [0.0, 0.1, 0.25, 0.5, 2.0 / 3.0, 1.0, 2.0, 3.9, 4.0, 31.7, 128.0] {
            let weights = box_weights(variance);
            let sum = weights[0] + 2.0 * weights[1..].iter().sum::<f64>();
            let squares: f64 = (0_u32..).zip(&weights).map(|(at, weight)| 2.0 * f64::from(at * at) * weight).sum();
            assert!((sum - 1.0).abs() < 1e-12, "{variance}: {sum}");
            assert!((squares - variance).abs() < 1e-9, "{squares}, not {variance}");
            assert!(weights.iter().all(|&weight| weight >= 0.0), "{variance}: {weights:?}");
        }
    }
}
