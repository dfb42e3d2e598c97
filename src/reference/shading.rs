//! Classification and shading, SPEC §3; the twin of `shaders/shade.wgsl`.

use glam::{DVec2, DVec3, DVec4};
use rayon::prelude::*;

use super::Geometry;
use crate::scene::Scene;
use crate::shading::{Light, Shading};
use crate::splatting::Compositing;
use crate::transfer_function::TransferFunction;
use crate::volume::Volume;

/// A projected and shaded voxel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Splat {
    /// Pixel coordinates.
    pub center: DVec2,
    /// Warped depth.
    pub depth: f64,
    /// `(C·m, m)` times the low-pass amplitude over λ.
    pub amount: DVec4,
}

/// The voxels that take part, in memory order.
pub fn shade(volume: &Volume, transfer: &TransferFunction, scene: &Scene, geometry: &Geometry) -> Vec<Splat> {
    let to_eye = -geometry.basis.w;
    (0..volume.values().len() as u32)
        .into_par_iter()
        .filter_map(|index| {
            let voxel = volume.grid().voxel_at(index);
            let value = f64::from(volume.values()[index as usize]);
            let gradient = volume.gradient(voxel);
            let tables = transfer.tables(volume.label(index));
            let alpha = tables.alpha(value, gradient.length());
            (alpha > 0.0).then(|| {
                let m = amount(scene.splatting.compositing, alpha);
                let color = color(&scene.shading, tables.color.at(value), gradient, to_eye);
                Splat {
                    center: geometry.pixel(voxel),
                    depth: geometry.depth(voxel),
                    amount: color.extend(1.0) * m * geometry.amplitude / geometry.lambda,
                }
            })
        })
        .collect()
}

/// `m`: the amount per unit length (SPEC §5).
pub fn amount(compositing: Compositing, alpha: f64) -> f64 {
    match compositing {
        Compositing::Linear | Compositing::Xray => alpha,
        Compositing::Exponential => -(-alpha.min(0.9999)).ln_1p(),
    }
}

/// `C` of SPEC §3.
pub fn color(shading: &Shading, color: DVec3, gradient: DVec3, to_eye: DVec3) -> DVec3 {
    if !shading.enabled {
        return color;
    }
    let normal = if gradient.length() < 1e-12 { DVec3::ZERO } else { -gradient.normalize() };
    let to_light = match shading.light {
        Light::Headlight => to_eye,
        Light::Direction(direction) => direction.normalize(),
    };
    let half = to_light + to_eye;
    let half = if half.length() < 1e-12 { DVec3::ZERO } else { half.normalize() };
    let highlight = match normal.dot(half).abs() {
        0.0 => 0.0,
        cosine => shading.specular * cosine.powf(shading.shininess),
    };
    let diffuse = shading.diffuse * normal.dot(to_light).abs();
    (color * (shading.ambient + diffuse) + highlight).clamp(DVec3::ZERO, DVec3::ONE)
}
