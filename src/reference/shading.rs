//! Classification and shading (SPEC §3): the f64 evaluation of `shaders/shade.wgsl`.

use glam::{DVec3, DVec4};

use super::light::{Left, Lights};
use super::opacity::alpha;
pub use super::opacity::amount;
pub use super::section::Splat;
use super::{Geometry, membership};
use crate::error::RenderError;
use crate::error::setting::scaled;
use crate::lists::classify::channels;
use crate::parallel::prelude::*;
use crate::scene::Scene;
use crate::settings::light::Light;
use crate::settings::transfer_function::TransferFunction;
use crate::volume::Volume;

/// The indices in memory of the voxels that take part, ascending.
pub fn taking_part(volume: &Volume, transfer: &[TransferFunction], geometry: &Geometry) -> Vec<u32> {
    let has_alpha =
        |&index: &u32| channels(volume, transfer).any(|(volume, transfer)| alpha(volume, transfer, index) > 0.0);
    let is_shown = |&index: &u32| {
        let voxel = volume.grid().voxel_at(index);
        geometry.is_beyond_near(voxel) && geometry.is_inside(voxel)
    };
    let voxels = (0..volume.values().len() as u32).into_par_iter();
    voxels.filter(|index| has_alpha(index) && is_shown(index)).collect()
}

/// Projects and shades the voxels that take part, in memory order.
///
/// # Errors
/// If the scene's light sheets need more than can be computed.
pub fn shade(
    volume: &Volume,
    transfer: &[TransferFunction],
    scene: &Scene,
    geometry: &Geometry,
) -> Result<Vec<Splat>, RenderError> {
    let lights = Lights::new(volume, transfer, scene)?;
    Ok(splats(&taking_part(volume, transfer, geometry), volume, transfer, (scene, &lights), geometry))
}

/// Projects and shades voxels, given by their indices in memory.
pub fn splats(
    voxels: &[u32],
    volume: &Volume,
    transfer: &[TransferFunction],
    (scene, lights): (&Scene, &Lights),
    geometry: &Geometry,
) -> Vec<Splat> {
    let splat = |&index: &u32| {
        let voxel = volume.grid().voxel_at(index);
        let amount = emission(volume, transfer, (scene, lights), geometry, index) * geometry.scale(voxel);
        let alpha = channels(volume, transfer).map(|(volume, transfer)| alpha(volume, transfer, index)).sum();
        Splat { center: geometry.pixel(voxel), depth: geometry.depth(voxel), amount, alpha }
    };
    voxels.par_iter().map(splat).collect()
}

/// `(C·m, m)` of a voxel, the sum of all channels' (SPEC §10): their footprints are the same, so one splat draws them all.
pub fn emission(
    volume: &Volume,
    transfer: &[TransferFunction],
    (scene, lights): (&Scene, &Lights),
    geometry: &Geometry,
    index: u32,
) -> DVec4 {
    let voxel = volume.grid().voxel_at(index);
    let left = lights.left(volume.grid().world_position(voxel) / volume.grid().unit());
    let of_channel = |(volume, transfer): (&Volume, &TransferFunction)| match alpha(volume, transfer, index) {
        0.0 => DVec4::ZERO,
        alpha => {
            let value = f64::from(volume.values().at(index as usize));
            let tables = transfer.tables(volume.label(index));
            let base = volume.color(index).map_or_else(|| tables.color.at(value), DVec4::truncate);
            let gradient =
                tables.members.map_or_else(|| volume.gradient(voxel), |of| membership::gradient(volume, of, voxel));
            let is_face = !scene.clip.shade_faces && geometry.is_cut(voxel, scene.clip.planes.len());
            let color = if is_face { base } else { color(scene, base, gradient, -geometry.ray(voxel), left) };
            color.extend(1.0) * amount(scene.splatting.compositing, alpha)
        }
    };
    channels(volume, transfer).map(of_channel).sum()
}

/// `C` of SPEC §3, with what light sheets leave of the light (SPEC §14).
pub fn color(Scene { shading, camera, .. }: &Scene, color: DVec3, gradient: DVec3, to_eye: DVec3, left: Left) -> DVec3 {
    if !shading.enabled {
        return color;
    }
    let normal = if gradient.length() < 1e-12 { DVec3::ZERO } else { -gradient.normalize() };
    let basis = camera.basis();
    let to_light = match shading.light {
        Light::Headlight => to_eye,
        Light::UpperLeft => (basis.v / 2.0 - basis.u / 2.0 - basis.w).normalize(),
        Light::Direction(direction) => scaled(direction).normalize(),
    };
    let half = to_light + to_eye;
    let half = if half.length() < 1e-12 { DVec3::ZERO } else { half.normalize() };
    let highlight = match normal.dot(half).abs() {
        0.0 => 0.0,
        cosine => shading.specular * cosine.powf(shading.shininess),
    };
    let diffuse = shading.diffuse * left.direct * normal.dot(to_light).abs();
    (color * (shading.ambient * left.ambient + diffuse) + left.direct * highlight).clamp(DVec3::ZERO, DVec3::ONE)
}
