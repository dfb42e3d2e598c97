//! Shading (SPEC §3) of eight voxels at a time, once for every tile in which a voxel is visible, as in `shaders/shade.wgsl`.

use fearless_simd::prelude::*;
use fearless_simd::{f32x8, mask32x8};
use glam::DVec3;

use super::material::Material;
use super::vector::{LANES, mask, optical_depth, power};
use crate::light::Left;
use crate::settings::camera::ViewBasis;
use crate::settings::shading::{MAX_SHADING, Shading};
use crate::settings::splatting::Compositing;

/// Up to eight voxels to be shaded, by lane.
#[derive(Clone, Debug)]
pub(super) struct Unshaded {
    color: [[f32; LANES]; 3],
    /// α, the opacity per unit length.
    alpha: [f32; LANES],
    normal: [[f32; LANES]; 3],
    to_eye: [[f32; LANES]; 3],
    /// The factor for amounts.
    scale: [f32; LANES],
    /// The shares that are left of ambient and of other light (SPEC §14).
    left: [[f32; LANES]; 2],
    /// The bits of lanes that are not shaded, because a cut goes through them.
    faces: u32,
}

impl Unshaded {
    /// No voxels, in full light.
    pub(super) fn new() -> Self {
        let zero = [0.0; LANES];
        Self {
            color: [zero; 3],
            alpha: zero,
            normal: [zero; 3],
            to_eye: [zero; 3],
            scale: zero,
            left: [[1.0; LANES]; 2],
            faces: 0,
        }
    }

    /// Puts into a lane what is left of light.
    #[inline(always)]
    pub(super) fn set_left(&mut self, lane: usize, Left { ambient, direct }: Left) {
        (self.left[0][lane], self.left[1][lane]) = (ambient, direct);
    }

    /// Says which lanes have voxels that a cut goes through.
    #[inline(always)]
    pub(super) fn set_faces(&mut self, faces: u32) {
        self.faces = faces;
    }

    /// Puts a voxel's material into a lane.
    #[inline(always)]
    pub(super) fn set_material(&mut self, lane: usize, material: &Material) {
        self.alpha[lane] = material.alpha;
        for axis in 0..3 {
            self.color[axis][lane] = material.color[axis];
            self.normal[axis][lane] = material.normal[axis];
        }
    }

    /// Puts into a lane what depends on the view.
    #[inline(always)]
    pub(super) fn set_view(&mut self, lane: usize, to_eye: DVec3, scale: f64) {
        self.scale[lane] = scale as f32;
        for axis in 0..3 {
            self.to_eye[axis][lane] = to_eye[axis] as f32;
        }
    }
}

/// A colour where a mask is set, and another one elsewhere.
#[inline(always)]
pub(super) fn select<S: Simd>(is: mask32x8<S>, one: [f32x8<S>; 3], other: [f32x8<S>; 3]) -> [f32x8<S>; 3] {
    std::array::from_fn(|channel| is.select(one[channel], other[channel]))
}

/// A frame's light, material and compositing.
#[derive(Clone, Debug)]
pub(super) struct Shader {
    is_enabled: bool,
    /// The direction to the light; `None` for a headlight.
    to_light: Option<[f32; 3]>,
    ambient: f32,
    diffuse: f32,
    specular: f32,
    shininess: f32,
    is_optical_depth: bool,
}

impl Shader {
    pub(super) fn new(shading: &Shading, basis: &ViewBasis, compositing: Compositing) -> Self {
        let capped = |weight: f64| weight.min(MAX_SHADING) as f32;
        Self {
            is_enabled: shading.enabled,
            to_light: shading.light.direction(basis).map(|to_light| to_light.as_vec3().to_array()),
            ambient: capped(shading.ambient),
            diffuse: capped(shading.diffuse),
            specular: capped(shading.specular),
            shininess: capped(shading.shininess),
            is_optical_depth: compositing.is_optical_depth(),
        }
    }

    /// `(C·m, m)` times the scale of every lane's voxel.
    #[inline(always)]
    pub(super) fn shade<S: Simd>(&self, simd: S, voxels: &Unshaded) -> [[f32; LANES]; 4] {
        let load = |lanes: &[f32; LANES]| f32x8::load_array_ref(simd, lanes);
        let alpha = load(&voxels.alpha);
        let amount = match self.is_optical_depth {
            true => optical_depth(simd, alpha.min(f32x8::splat(simd, 0.9999))),
            false => alpha,
        } * load(&voxels.scale);
        let of = |[x, y, z]: &[[f32; LANES]; 3]| [load(x), load(y), load(z)];
        let left = [load(&voxels.left[0]), load(&voxels.left[1])];
        let color = of(&voxels.color);
        let shaded = self.color(simd, color, of(&voxels.normal), of(&voxels.to_eye), left);
        let [red, green, blue] = select(mask(simd, voxels.faces), color, shaded);
        [(red * amount).to_array(), (green * amount).to_array(), (blue * amount).to_array(), amount.to_array()]
    }

    /// The colours in this light, of which A and S are left. A normal of 0 stands for a voxel without a direction, which gets ambient light alone.
    #[inline(always)]
    pub(super) fn color<S: Simd>(
        &self,
        simd: S,
        color: [f32x8<S>; 3],
        normal: [f32x8<S>; 3],
        to_eye: [f32x8<S>; 3],
        [ambient, direct]: [f32x8<S>; 2],
    ) -> [f32x8<S>; 3] {
        if !self.is_enabled {
            return color;
        }
        let (diffuse, highlight) = self.lighting(simd, normal, to_eye);
        let (factor, highlight) = (diffuse * direct + ambient * self.ambient, highlight * direct);
        let (zero, one) = (f32x8::splat(simd, 0.0), f32x8::splat(simd, 1.0));
        let lit = |channel: f32x8<S>| (channel * factor + highlight).max(zero).min(one);
        let [red, green, blue] = color;
        [lit(red), lit(green), lit(blue)]
    }

    /// The diffuse and the specular term: two-sided, and 0 without a normal.
    #[inline(always)]
    fn lighting<S: Simd>(&self, simd: S, normal: [f32x8<S>; 3], to_eye: [f32x8<S>; 3]) -> (f32x8<S>, f32x8<S>) {
        let splat = |component: f32| f32x8::splat(simd, component);
        let to_light = match self.to_light {
            None => to_eye,
            Some([x, y, z]) => [splat(x), splat(y), splat(z)],
        };
        let dot = |a: [f32x8<S>; 3], b: [f32x8<S>; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let half = [to_light[0] + to_eye[0], to_light[1] + to_eye[1], to_light[2] + to_eye[2]];
        let squared = dot(half, half);
        // Light from straight behind has no half vector.
        let has_half = squared.simd_gt(splat(1e-12));
        let zero = splat(0.0);
        let length = has_half.select(squared, splat(1.0)).sqrt();
        let cosine = has_half.select(dot(normal, half).abs() / length, zero);
        let diffuse = dot(normal, to_light).abs() * self.diffuse;
        let highlight = if self.specular > 0.0 { power(simd, cosine, self.shininess) * self.specular } else { zero };
        (diffuse, highlight)
    }
}
