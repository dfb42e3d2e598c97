//! The kernel as pixels evaluate it: eq. 3 in closed form, by polynomials. The same form as `shaders/gather/kernel.wgsl`.
//!
//! `H(a, b, t)` is `H(0, 0, t)` times the Gaussian of `ρ² = a² + b²`, and t ends where the chord of the kernel's ball does. So a section between
//! two planes is the difference of `H(0, 0, t)` there, each clamped to what it is at the rim, times one Gaussian for all sections of a voxel.

use std::f64::consts::LOG2_E;

use fearless_simd::prelude::*;

use super::vector::{exp2, polynomial, short_polynomial};
use crate::kernel::Kernel;

/// Coefficients for pixels and voxels.
#[derive(Clone, Debug)]
pub(super) struct KernelTables {
    /// The distance from which the kernel is 0, grid units.
    pub(super) support: f32,
    pub(super) support_squared: f32,
    /// The coefficients of `H(0, 0, t) / t` as a polynomial in `2t²/support² - 1`.
    cumulative: [f32; 16],
    /// True if the first twelve of them are enough.
    is_short: bool,
    /// `2 / support²`.
    scale: f32,
    /// The factor from ρ² to the Gaussian's exponent of 2.
    exponent: f32,
}

impl KernelTables {
    pub(super) fn new(kernel: &Kernel) -> Self {
        let support = kernel.support();
        // At falloff·support² = 8, that of the default kernel, the terms from z¹² on sum to 1e-8 of the polynomial's value.
        let is_short = kernel.falloff() * support * support <= 8.0;
        let mut cumulative = [0.0; 16];
        match is_short {
            true => cumulative[..12].copy_from_slice(&kernel.cumulative_polynomial::<12>(1.0)),
            false => cumulative = kernel.cumulative_polynomial(1.0),
        }
        Self {
            support: support as f32,
            support_squared: (support * support) as f32,
            cumulative: cumulative.map(|coefficient| coefficient as f32),
            is_short,
            scale: (2.0 / (support * support)) as f32,
            exponent: (-kernel.falloff() * LOG2_E) as f32,
        }
    }

    /// `H(0, 0, t)` of eq. 3, the kernel's integral along the ray through its centre, from the centre to t.
    #[inline(always)]
    pub(super) fn along<S: Simd, V: SimdFloat<S, Element = f32>>(&self, simd: S, t: V) -> V {
        let t = t.max(V::splat(simd, -self.support)).min(V::splat(simd, self.support));
        t * self.cumulative_per_distance(t * t)
    }

    /// `H(0, 0, t)` where the chord of the kernel's ball ends.
    #[inline(always)]
    pub(super) fn rim<S: Simd, V: SimdFloat<S, Element = f32>>(&self, simd: S, rho_squared: V) -> V {
        let chord_squared = (V::splat(simd, self.support_squared) - rho_squared).max(V::splat(simd, 0.0));
        chord_squared.sqrt() * self.cumulative_per_distance(chord_squared)
    }

    /// `H(0, 0, t) / t`, given t².
    #[inline(always)]
    fn cumulative_per_distance<S: Simd, V: SimdFloat<S, Element = f32>>(&self, squared: V) -> V {
        let z = squared * self.scale - 1.0;
        match self.is_short {
            true => short_polynomial(&self.cumulative, z),
            false => polynomial(&self.cumulative, z),
        }
    }

    /// The Gaussian of ρ².
    #[inline(always)]
    pub(super) fn in_plane<S: Simd, V: SimdFloat<S, Element = f32>>(&self, simd: S, rho_squared: V) -> V {
        // Far from the voxel the rim is 0; the other factor must be finite.
        exp2(simd, (rho_squared * self.exponent).max(V::splat(simd, -126.0)))
    }
}
