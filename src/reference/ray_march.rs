//! A ray march of the pre-shaded Gaussian field, which splatting approximates: without slabs, sheets or footprints.
//!
//! The field is `Σ (C·m, m)·h(distance in the warped grid)` over the voxels that take part, with amounts per `unit` of length. It is sampled
//! at the middle of steps of [`STEP`] `unit`s along the ray of a pixel's centre, from the near plane on, and each step is composited like
//! an `exponential` sheet. The scene's own compositing is ignored, because the other modes have no meaning here.
//!
//! Rays have no width, so there is no low-pass rule: comparisons are valid where a grid unit covers at least a pixel.

use glam::{DVec3, DVec4, IVec3, UVec2, UVec3};

use super::composite::composite_pixel;
use super::{Buffer, Geometry, Lights, cut, resolve, shading};
use crate::error::RenderError;
use crate::kernel::Kernel;
use crate::parallel::prelude::*;
use crate::scene::Scene;
use crate::settings::splatting::{Compositing, Order};
use crate::settings::transfer_function::TransferFunction;
use crate::volume::{Grid, Volume};

/// The length of a step in `unit`s.
pub const STEP: f64 = 0.05;

/// A ray ends early when its pixel cannot change by more than this.
const REST: f64 = 1e-7;

/// Marches the rays of some pixels of a scene.
///
/// # Errors
/// If the scene asks for more than can be computed.
pub fn pixels(
    volume: &Volume,
    transfer: &[TransferFunction],
    scene: &Scene,
    pixels: &[UVec2],
) -> Result<Vec<[f32; 4]>, RenderError> {
    let mut exponential = scene.framed(volume, transfer);
    exponential.splatting.compositing = Compositing::Exponential;
    let geometry = Geometry::new(volume.grid(), &exponential)?;
    let field = Field::new(volume, transfer, &exponential, &geometry)?;
    let marched = pixels.par_iter().map(|&pixel| field.march(&PixelRay::new(&geometry, pixel))).collect();
    let acc = Buffer { width: pixels.len(), pixels: marched };
    // Rays march to their ends.
    exponential.splatting.culling = false;
    let finished = (Compositing::Exponential, &exponential.splatting);
    Ok(resolve::resolve(&acc, finished, scene.image.background).into_image().pixels)
}

/// The ray of a pixel's centre in voxel coordinates, as a function of its length in `unit`s.
struct PixelRay {
    origin: DVec3,
    step: DVec3,
    /// The start: at the near plane, at a clip plane, or at minus infinity.
    first: f64,
    /// The end: at a clip plane, or at infinity.
    last: f64,
}

impl PixelRay {
    fn new(geometry: &Geometry, pixel: UVec2) -> Self {
        let Geometry { basis, grid, .. } = geometry;
        let offset = pixel.as_dvec2() + 0.5 - geometry.size / 2.0;
        let in_plane = (offset.x * basis.u - offset.y * basis.v) * geometry.pix;
        let (origin, direction, first) = match &geometry.eye {
            None => (geometry.center + in_plane, basis.w, f64::NEG_INFINITY),
            Some(eye) => {
                let r = (in_plane + eye.distance * basis.w).normalize();
                (eye.position, r, eye.near / r.dot(basis.w))
            }
        };
        // Converts depths along w to lengths.
        let per_depth = direction.dot(basis.w).recip();
        let inside = cut::PixelRay::new(geometry, pixel).inside(&geometry.clip);
        Self {
            origin: origin / grid.aspect() + grid.center(),
            step: direction / grid.aspect(),
            first: first.max(inside.start * per_depth),
            last: inside.end * per_depth,
        }
    }

    fn at(&self, length: f64) -> DVec3 {
        self.origin + length * self.step
    }

    /// The part of the ray within a box, from the near plane on and inside all clip planes.
    fn within(&self, low: DVec3, high: DVec3) -> (f64, f64) {
        (0..3).fold((self.first, self.last), |(first, last), axis| {
            // A ray parallel to an axis's planes gives infinities of opposite signs inside them, or NaN on one of them.
            let at = [low, high].map(|plane| (plane[axis] - self.origin[axis]) / self.step[axis]);
            (first.max(at[0].min(at[1])), last.min(at[0].max(at[1])))
        })
    }
}

/// The field, and the regions where it is not 0.
struct Field {
    grid: Grid,
    kernel: Kernel,
    /// `(C·m, m)` of the voxels that take part, preceded by a 0 for all others.
    emissions: Vec<DVec4>,
    /// For every voxel its index in `emissions`.
    places: Vec<u32>,
    /// Cubes with sides of [`Self::CUBE`] voxels, from `-radius` on: whether any kernel reaches into them.
    cubes: UVec3,
    is_reached: Vec<bool>,
}

impl Field {
    const CUBE: f64 = 4.0;

    fn new(
        volume: &Volume,
        transfer: &[TransferFunction],
        scene: &Scene,
        geometry: &Geometry,
    ) -> Result<Self, RenderError> {
        let lights = Lights::new(volume, transfer, scene)?;
        let grid = *volume.grid();
        let kernel = Kernel::new(scene.splatting.radius, scene.splatting.falloff);
        let voxels = shading::taking_part(volume, transfer, geometry);
        let emission = |&index: &u32| shading::emission(volume, transfer, (scene, &lights), geometry, index);
        let mut emissions = vec![DVec4::ZERO];
        emissions.extend(voxels.par_iter().map(emission).numbers());
        let mut places = vec![0; volume.values().len()];
        voxels.iter().zip(1..).for_each(|(&voxel, place)| places[voxel as usize] = place);

        let cubes = ((grid.dims.as_dvec3() + 2.0 * kernel.radius()) / Self::CUBE).ceil().as_uvec3();
        let mut is_reached = vec![false; cubes.element_product() as usize];
        for &index in &voxels {
            let at = grid.voxel_at(index).as_dvec3();
            let low = (at / Self::CUBE).floor().as_uvec3();
            let high = ((at + 2.0 * kernel.radius()) / Self::CUBE).floor().as_uvec3().min(cubes - 1);
            for (z, y) in (low.z..=high.z).flat_map(|z| (low.y..=high.y).map(move |y| (z, y))) {
                let row = (cubes.x * (y + cubes.y * z)) as usize;
                is_reached[row + low.x as usize..=row + high.x as usize].fill(true);
            }
        }
        Ok(Self { grid, kernel, emissions, places, cubes, is_reached })
    }

    /// Whether any kernel may reach a point in voxel coordinates.
    fn is_reached(&self, at: DVec3) -> bool {
        let cube = ((at + self.kernel.radius()) / Self::CUBE).floor().as_ivec3();
        let inside = cube.cmpge(IVec3::ZERO).all() && cube.cmplt(self.cubes.as_ivec3()).all();
        let cube = cube.as_uvec3();
        inside && self.is_reached[(cube.x + self.cubes.x * (cube.y + self.cubes.y * cube.z)) as usize]
    }

    /// The field at a point in voxel coordinates.
    fn at(&self, at: DVec3) -> DVec4 {
        let (radius, dims) = (self.kernel.radius(), self.grid.dims);
        let low = (at - radius).ceil().max(DVec3::ZERO).as_uvec3();
        let high = (at + radius).floor().min(dims.as_dvec3() - 1.0).as_ivec3();
        // A Gaussian of a distance is the product of the Gaussians of its components; at most nine voxels are within reach along an axis.
        let mut gaussians = [[(0.0, 0.0); 9]; 3];
        for axis in 0..3 {
            for (voxel, gaussian) in (low[axis]..).zip(&mut gaussians[axis]) {
                let squared = (f64::from(voxel) - at[axis]).powi(2);
                *gaussian = (squared, (-self.kernel.falloff() * squared).exp());
            }
        }
        let [along_x, along_y, along_z] = gaussians;
        let mut sum = DVec4::ZERO;
        for (z, (zz, gz)) in (low.z..).zip(along_z).take_while(|(z, _)| *z as i32 <= high.z) {
            for (y, (yy, gy)) in (low.y..).zip(along_y).take_while(|(y, _)| *y as i32 <= high.y) {
                let row = (dims.x * (y + dims.y * z)) as usize;
                for (x, (xx, gx)) in (low.x..).zip(along_x).take_while(|(x, _)| *x as i32 <= high.x) {
                    let place = self.places[row + x as usize];
                    if place > 0 && xx + yy + zz <= radius * radius {
                        sum += self.emissions[place as usize] * (gx * gy * gz);
                    }
                }
            }
        }
        sum * self.kernel.value(0.0)
    }

    /// The compositing buffer's content at the end of a ray.
    fn march(&self, ray: &PixelRay) -> DVec4 {
        let reach = self.kernel.radius();
        let (first, last) = ray.within(DVec3::splat(-reach), self.grid.dims.as_dvec3() - 1.0 + reach);
        let mut acc = DVec4::ZERO;
        // Not `>=`, because the ends are NaN for a ray along a face.
        let steps = if first < last { ((last - first) / STEP).ceil() as u64 } else { 0 };
        for step in 0..steps {
            let at = ray.at(first + (step as f64 + 0.5) * STEP);
            if self.is_reached(at) {
                composite_pixel(&mut acc, self.at(at) * STEP, Compositing::Exponential, Order::FrontToBack);
                if acc.w > 1.0 - REST {
                    break;
                }
            }
        }
        acc
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;
    use crate::scene::VolumeSource;
    use crate::settings::camera::{Camera, Projection};
    use crate::settings::transfer_function::Ramp;

    /// A single voxel: the field along a ray through its middle is the kernel, and its integral is the footprint.
    #[test]
    fn a_ray_gathers_the_kernel() {
        let mut values = vec![0.0; 27];
        values[13] = 1.0;
        let volume = Volume::new("voxel", UVec3::splat(3), DVec3::new(1.0, 1.0, 2.0), values).unwrap();
        let mut scene = Scene::new(VolumeSource::Builtin("cube".to_owned()));
        scene.channels[0].transfer.opacity = Some(Ramp::new(vec![(0.5, 0.0), (1.0, 0.6)]).unwrap());
        (scene.image.width, scene.image.height, scene.image.background) = (1, 1, [0.0; 4]);
        let transfer = scene.resolve(&volume);
        let kernel = Kernel::new(2.0, 2.0);
        for (direction, up, stretch) in [(DVec3::Y, DVec3::Z, 1.0), (DVec3::Z, DVec3::Y, 2.0)] {
            for projection in [
                Projection::Orthographic { height: Some(1.0) },
                Projection::Perspective { fov_y: 10.0, distance: Some(20.0), near: None },
                // The near plane cuts the kernel.
                Projection::Perspective { fov_y: 10.0, distance: Some(20.0), near: Some(20.0 - stretch) },
            ] {
                let near = match projection {
                    Projection::Perspective { near: Some(_), .. } => -1.0,
                    _ => -2.0,
                };
                scene.camera = Camera { projection, direction, up, center: Some(DVec3::ZERO), ..Camera::default() };
                let alpha = pixels(&volume, &transfer, &scene, &[UVec2::ZERO]).unwrap()[0][3];
                let amount = -(1.0_f64 - 0.6).ln() * kernel.section(0.0, near, 2.0) * stretch;
                assert!(
                    (f64::from(alpha) - (1.0 - (-amount).exp())).abs() < 1e-4,
                    "{direction} {projection:?}: {alpha}"
                );
            }
        }
    }
}
