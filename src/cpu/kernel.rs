//! The kernel as pixels evaluate it: eq. 3 in closed form, by polynomials. The same form as `shaders/gather/kernel.wgsl`.
//!
//! `H(a, b, t)` is `H(0, 0, t)` times the Gaussian of `ρ² = a² + b²`, and t ends where the chord of the kernel's ball does. So a section between
//! two planes is the difference of `H(0, 0, t)` there, each clamped to what it is at the rim, times one Gaussian for all sections of a voxel.

use std::f64::consts::LOG2_E;

use fearless_simd::f32x8;
use fearless_simd::prelude::*;

use super::vector::{exp2, polynomial};
use crate::kernel::Kernel;

/// Coefficients for pixels and voxels.
#[derive(Clone, Debug)]
pub(super) struct KernelTables {
    /// The distance from which the kernel is 0, grid units.
    pub(super) support: f32,
    support_squared: f32,
    /// The coefficients of `H(0, 0, t) / t` as a polynomial in `2t²/support² - 1`.
    cumulative: [f32; 16],
    /// `2 / support²`.
    scale: f32,
    /// The factor from ρ² to the Gaussian's exponent of 2.
    exponent: f32,
}

impl KernelTables {
    pub(super) fn new(kernel: &Kernel) -> Self {
        let support = kernel.support();
        Self {
            support: support as f32,
            support_squared: (support * support) as f32,
            cumulative: kernel.cumulative_polynomial::<16>(1.0).map(|coefficient| coefficient as f32),
            scale: (2.0 / (support * support)) as f32,
            exponent: (-kernel.falloff() * LOG2_E) as f32,
        }
    }

    /// `H(0, 0, t)` of eq. 3, the kernel's integral along the ray through its centre, from the centre to t.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn along<S: Simd>(&self, simd: S, t: f32x8<S>) -> f32x8<S> {
        let t = t.max(f32x8::splat(simd, -self.support)).min(f32x8::splat(simd, self.support));
        t * polynomial(&self.cumulative, t * t * self.scale - 1.0)
    }

    /// How far a section between two planes reaches from the kernel's axis, as a fraction of the support; slightly more, because f32 rounds.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn reach<S: Simd>(&self, simd: S, a: f32x8<S>, b: f32x8<S>) -> f32x8<S> {
        let zero = f32x8::splat(simd, 0.0);
        // 0 between the planes, whichever of them is nearer to the eye.
        let nearest = a.min(b).max(zero) + (zero - a.max(b)).max(zero);
        let fraction = nearest * (1.0 / self.support);
        ((1.0 + 1e-4) - fraction * fraction).max(zero).sqrt()
    }

    /// `H(0, 0, t)` where the chord of the kernel's ball ends.
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn rim<S: Simd, V: SimdFloat<S, Element = f32>>(&self, simd: S, rho_squared: V) -> V {
        let chord_squared = (V::splat(simd, self.support_squared) - rho_squared).max(V::splat(simd, 0.0));
        chord_squared.sqrt() * polynomial(&self.cumulative, chord_squared * self.scale - 1.0)
    }

    /// The Gaussian of ρ².
    #[cfg_attr(not(debug_assertions), inline(always))]
    pub(super) fn in_plane<S: Simd>(&self, simd: S, rho_squared: f32x8<S>) -> f32x8<S> {
        // Far from the voxel the rim is 0; the other factor must be finite.
        exp2(simd, (rho_squared * self.exponent).max(f32x8::splat(simd, -126.0)))
    }
}
