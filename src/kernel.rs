//! The reconstruction kernel and the closed form of its sections (SPEC §4).

use std::f64::consts::PI;

/// A truncated Gaussian `h(r) = κ·exp(-falloff·r²)` for `r ≤ radius`, radially symmetric in the warped grid.
///
/// Lengths are in grid units. κ makes the integral of h over its ball equal 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kernel {
    radius: f64,
    falloff: f64,
    kappa: f64,
}

impl Kernel {
    /// A kernel with the given radius (grid units) and Gaussian exponent, both above 0.
    pub fn new(radius: f64, falloff: f64) -> Self {
        Self { radius, falloff, kappa: 1.0 / (4.0 * PI * radial_moment(radius, falloff)) }
    }

    /// The kernel's radius in grid units.
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// The Gaussian's exponent.
    pub fn falloff(&self) -> f64 {
        self.falloff
    }

    /// The radius beyond which the kernel is too small for an f32 buffer: `radius`, or less where the Gaussian falls below 2⁻²⁴ of its peak.
    pub fn support(&self) -> f64 {
        self.radius.min((24.0 * std::f64::consts::LN_2 / self.falloff).sqrt())
    }

    /// `h(r)`.
    pub fn value(&self, r: f64) -> f64 {
        if r <= self.radius { self.kappa * libm::exp(-self.falloff * r * r) } else { 0.0 }
    }

    /// `H(x, y, z)` of eq. 3 with `rho_squared = x² + y²`, for the Gaussian without truncation; odd in z.
    pub fn cumulative(&self, rho_squared: f64, z: f64) -> f64 {
        let root = self.falloff.sqrt();
        self.kappa * libm::exp(-self.falloff * rho_squared) * (PI.sqrt() / 2.0) * libm::erf(root * z) / root
    }

    /// The rest of `H(x, y, z)` up to the kernel's support, `H(x, y, support) - H(x, y, z)`, to full relative precision even if it is tiny.
    /// `z` must lie in [0, support].
    pub fn cumulative_beyond(&self, rho_squared: f64, z: f64) -> f64 {
        let root = self.falloff.sqrt();
        let beyond = libm::erfc(root * z) - libm::erfc(root * self.support());
        self.kappa * libm::exp(-self.falloff * rho_squared) * (PI.sqrt() / 2.0) * beyond / root
    }

    /// The coefficients, z⁰ first, of a polynomial in z that approximates `H(0, 0, t) / t` for t² from `(1 - span)·support²`, where z is -1,
    /// to `support²`, where z is 1.
    pub fn cumulative_polynomial<const N: usize>(&self, span: f64) -> [f64; N] {
        let count = N as f64;
        let nodes: [f64; N] = std::array::from_fn(|i| libm::cos(PI * (i as f64 + 0.5) / count));
        let at_nodes = nodes.map(|z| {
            let t = self.support() * (1.0 - span * (1.0 - z) / 2.0).sqrt();
            self.cumulative(0.0, t) / t
        });
        // The current and the previous Chebyshev polynomial, as coefficients of powers of z.
        let (mut before, mut current) = ([0.0; N], [0.0; N]);
        current[0] = 1.0;
        let mut sum = [0.0; N];
        for n in 0..N {
            let weight = if n == 0 { 1.0 } else { 2.0 } / count;
            let chebyshev = |z: f64| libm::cos(n as f64 * libm::acos(z));
            let coefficient: f64 = nodes.iter().zip(at_nodes).map(|(&z, f)| f * chebyshev(z)).sum::<f64>() * weight;
            sum.iter_mut().zip(current).for_each(|(sum, power)| *sum += coefficient * power);
            // T₁ = z, then Tₙ₊₁ = 2z·Tₙ - Tₙ₋₁.
            let factor = if n == 0 { 1.0 } else { 2.0 };
            let next = std::array::from_fn(|i| if i == 0 { 0.0 } else { factor * current[i - 1] } - before[i]);
            (before, current) = (current, next);
        }
        sum
    }

    /// The minimum of the discrete kernel's Fourier transform relative to its maximum: the transform of `exp(-falloff·r²)` at the grid offsets
    /// with `r < radius`, sampled at multiples of π/16. This fraction of the highest frequencies survives convolution with the kernel.
    pub fn min_discrete_response(&self) -> f64 {
        const STEPS: usize = 16;
        let reach = self.radius.ceil() as usize;
        let cosines: Vec<Vec<f64>> = (0..=STEPS)
            .map(|step| (0..=reach).map(|offset| libm::cos(PI * (step * offset) as f64 / STEPS as f64)).collect())
            .collect();
        // Offsets come in pairs ±d along each axis.
        let count = |offset: usize| if offset == 0 { 1.0 } else { 2.0 };
        let cube = |n: usize| (0..n).flat_map(move |x| (0..n).flat_map(move |y| (0..n).map(move |z| [x, y, z])));
        let weights: Vec<([usize; 3], f64)> = cube(reach + 1)
            .map(|offset| (offset, offset.map(|d| (d * d) as f64).iter().sum::<f64>()))
            .filter(|(_, squared)| *squared < self.radius * self.radius)
            .map(|(offset, squared)| {
                (offset, libm::exp(-self.falloff * squared) * offset.map(count).iter().product::<f64>())
            })
            .collect();
        let response = |frequency: [usize; 3]| {
            let term = |&([x, y, z], weight): &([usize; 3], f64)| {
                weight * cosines[frequency[0]][x] * cosines[frequency[1]][y] * cosines[frequency[2]][z]
            };
            weights.iter().map(term).sum::<f64>()
        };
        let min = cube(STEPS + 1).filter(|f| f.is_sorted()).map(response).fold(f64::INFINITY, f64::min);
        min / response([0; 3])
    }

    /// Half the length of the chord that the kernel's ball cuts from a ray at distance √`rho_squared`.
    pub fn half_chord(&self, rho_squared: f64) -> f64 {
        (self.radius * self.radius - rho_squared).max(0.0).sqrt()
    }

    /// `S(a, b; t0, t1)`, the kernel section between the depths `t0 ≤ t1` along a ray that passes the centre at distance √`rho_squared`: the
    /// difference of two entries of eq. 3. Clamping to the chord applies the ball's truncation.
    pub fn section(&self, rho_squared: f64, t0: f64, t1: f64) -> f64 {
        let chord = self.half_chord(rho_squared);
        let (near, far) = (t0.clamp(-chord, chord), t1.clamp(-chord, chord));
        if near == far {
            return 0.0;
        }
        self.cumulative(rho_squared, far) - self.cumulative(rho_squared, near)
    }
}

/// `∫₀ᴿ r²·exp(-f·r²) dr`. The closed form cancels where `f·R²` is small; a series converges fast there.
fn radial_moment(radius: f64, falloff: f64) -> f64 {
    let x = falloff * radius * radius;
    if x < 1.0 {
        let mut power = radius * radius * radius;
        let mut sum = 0.0;
        for n in 0..24 {
            let n = f64::from(n);
            sum += power / (2.0 * n + 3.0);
            power *= -x / (n + 1.0);
        }
        sum
    } else {
        PI.sqrt() * libm::erf(x.sqrt()) / (4.0 * falloff * falloff.sqrt()) - radius * libm::exp(-x) / (2.0 * falloff)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KERNELS: [(f64, f64); 6] = [(2.0, 2.0), (1.4, 2.0), (4.0, 16.0), (1.0, 1e-9), (1.0, 0.999), (1.0, 1.001)];

    #[test]
    fn kappa_makes_the_ball_integral_one() {
        for (radius, falloff) in KERNELS {
            let kernel = Kernel::new(radius, falloff);
            let steps = 20_000;
            let dr = radius / f64::from(steps);
            let integral: f64 =
                (0..steps).map(|i| (f64::from(i) + 0.5) * dr).map(|r| 4.0 * PI * r * r * kernel.value(r) * dr).sum();
            assert!((integral - 1.0).abs() < 1e-7, "radius {radius} falloff {falloff}: {integral}");
        }
    }

    #[test]
    fn a_section_is_the_integral_of_the_kernel() {
        for (radius, falloff) in KERNELS {
            let kernel = Kernel::new(radius, falloff);
            for rho in [0.0, 0.3, 0.9, 1.3] {
                for (t0, t1) in [(-0.4, 0.1), (0.2, 1.2), (-9.0, 9.0), (1.0, 5.0), (3.9, 4.4)] {
                    let steps = 40_000;
                    let dt = (t1 - t0) / f64::from(steps);
                    let sum: f64 = (0..steps)
                        .map(|i| t0 + (f64::from(i) + 0.5) * dt)
                        .map(|t| kernel.value((rho * rho + t * t).sqrt()) * dt)
                        .sum();
                    let section = kernel.section(rho * rho, t0, t1);
                    assert!(
                        (section - sum).abs() < 1e-3 * kernel.value(0.0),
                        "{radius} {rho} {t0}..{t1}: {section} {sum}"
                    );
                }
            }
        }
    }

    #[test]
    fn the_polynomial_is_the_cumulative_kernel() {
        fn error<const N: usize>(kernel: &Kernel, span: f64) -> f64 {
            let coefficients = kernel.cumulative_polynomial::<N>(span);
            let whole = 2.0 * kernel.cumulative(0.0, kernel.support());
            (0..=2000).fold(0.0, |worst: f64, step| {
                let z = f64::from(step) / 1000.0 - 1.0;
                let t = kernel.support() * (1.0 - span * (1.0 - z) / 2.0).max(0.0).sqrt();
                let found = t * coefficients.iter().rev().fold(0.0, |sum, coefficient| sum * z + coefficient);
                worst.max((found - kernel.cumulative(0.0, t)).abs() / whole)
            })
        }
        // To f32's precision of a whole footprint.
        for (radius, falloff) in KERNELS.into_iter().chain([(4.0, 0.1), (4.0, 2.0), (2.0, 16.0)]) {
            let kernel = Kernel::new(radius, falloff);
            assert!(
                error::<16>(&kernel, 1.0) < 2.0_f64.powi(-24),
                "{radius} {falloff}: {:e}",
                error::<16>(&kernel, 1.0)
            );
            assert!(
                error::<8>(&kernel, 0.45) < 2.0_f64.powi(-24),
                "{radius} {falloff}: {:e}",
                error::<8>(&kernel, 0.45)
            );
        }
        assert!(error::<16>(&Kernel::new(2.0, 2.0), 1.0) < 1e-11);
    }

    #[test]
    fn sections_of_one_kernel_sum_to_the_whole_footprint() {
        let kernel = Kernel::new(2.0, 2.0);
        for rho_squared in [0.0, 0.5, 2.0, 3.9] {
            let whole = kernel.section(rho_squared, -2.0, 2.0);
            let parts: f64 =
                (-9..9).map(|k| kernel.section(rho_squared, f64::from(k) * 0.3, f64::from(k + 1) * 0.3)).sum();
            assert!((whole - parts).abs() < 1e-14);
        }
    }
}
