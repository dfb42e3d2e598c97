//! The two stored forms of kernel footprints, as texture arrays (§§3.2, 3.3.1; SPEC §4).
//!
//! Footprints are symmetric in a and b, so a layer holds one quadrant, with its first texel at the centre and its last at the extent. The
//! summed-area table does not include the ball's truncation: the splat shader clamps z to the chord, so the table stays smooth up to
//! the rim.

use crate::kernel::Kernel;
use crate::settings::splatting::FootprintForm;

/// The number of pre-integrated sections (§3.2).
pub const SECTIONS: u32 = 128;
/// The side of a section's quadrant in texels.
pub const SECTION_SIZE: u32 = 64;
/// The number of layers of the summed-area table, from the centre plane to the kernel's support.
pub const SUMMED_AREA_LAYERS: u32 = 64;
/// The side of the summed-area table's quadrant in texels.
pub const SUMMED_AREA_SIZE: u32 = 32;

/// A footprint texture array on the CPU.
#[derive(Clone, Debug, PartialEq)]
pub struct FootprintTable {
    /// The form of the table.
    pub form: FootprintForm,
    /// The side of a layer in texels.
    pub size: u32,
    /// The number of layers.
    pub layers: u32,
    /// One number per texel for sections, two for the summed-area form, x fastest, then y, then layer.
    pub texels: Vec<f32>,
}

impl FootprintTable {
    /// The size of a table's texels in bytes.
    pub fn bytes(form: FootprintForm) -> u64 {
        let [size, layers, numbers] = match form {
            FootprintForm::Sections => [SECTION_SIZE, SECTIONS, 1],
            FootprintForm::SummedArea => [SUMMED_AREA_SIZE, SUMMED_AREA_LAYERS, 2],
        };
        u64::from(size * size * layers * numbers) * size_of::<f32>() as u64
    }

    /// The table for slabs of `width` warped grid units; the summed-area form does not depend on it.
    pub fn new(form: FootprintForm, kernel: &Kernel, width: f64) -> Self {
        match form {
            FootprintForm::Sections => sections(kernel, width),
            FootprintForm::SummedArea => summed_area(kernel),
        }
    }
}

/// The distance between the middles of neighbouring stored sections: (radius + width / 2) / 128 (§3.2).
pub fn section_spacing(kernel: &Kernel, width: f64) -> f64 {
    (kernel.radius() + width / 2.0) / f64::from(SECTIONS)
}

/// The extent of a kernel section between the depths `t0` and `t1`: beyond this distance from the centre the section is 0. Footprints
/// are trimmed to it (§3.2).
pub fn section_extent(kernel: &Kernel, t0: f64, t1: f64) -> f64 {
    let nearest = if t0 * t1 <= 0.0 { 0.0 } else { t0.abs().min(t1.abs()) };
    (kernel.support().powi(2) - nearest * nearest).max(0.0).sqrt()
}

/// Layer i is the section whose middle is i spacings from the kernel's centre, over its own trimmed extent.
fn sections(kernel: &Kernel, width: f64) -> FootprintTable {
    let spacing = section_spacing(kernel, width);
    let texels = (0..SECTIONS).flat_map(|layer| {
        let middle = f64::from(layer) * spacing;
        let (t0, t1) = (middle - width / 2.0, middle + width / 2.0);
        let texel = section_extent(kernel, t0, t1) / f64::from(SECTION_SIZE - 1);
        quadrant(SECTION_SIZE, texel).map(move |(a, b)| kernel.section(a * a + b * b, t0, t1) as f32)
    });
    FootprintTable { form: FootprintForm::Sections, size: SECTION_SIZE, layers: SECTIONS, texels: texels.collect() }
}

/// Layer i is `H(a, b, support) - H(a, b, z)` of eq. 3 at z = i / (layers - 1) of the support, and H's derivative in z, which is h, per
/// layer. Entries are counted from the rim: for a slab that barely reaches into a kernel, two entries counted from the centre would
/// cancel.
fn summed_area(kernel: &Kernel) -> FootprintTable {
    let texel = kernel.support() / f64::from(SUMMED_AREA_SIZE - 1);
    let spacing = kernel.support() / f64::from(SUMMED_AREA_LAYERS - 1);
    let texels = (0..SUMMED_AREA_LAYERS).flat_map(|layer| {
        let z = spacing * f64::from(layer);
        quadrant(SUMMED_AREA_SIZE, texel).flat_map(move |(a, b)| {
            let derivative = spacing * kernel.value(0.0) * libm::exp(-kernel.falloff() * (a * a + b * b + z * z));
            [kernel.cumulative_beyond(a * a + b * b, z) as f32, derivative as f32]
        })
    });
    FootprintTable {
        form: FootprintForm::SummedArea,
        size: SUMMED_AREA_SIZE,
        layers: SUMMED_AREA_LAYERS,
        texels: texels.collect(),
    }
}

/// The footprint coordinates of a layer's texels.
fn quadrant(size: u32, texel: f64) -> impl Iterator<Item = (f64, f64)> {
    (0..size).flat_map(move |y| (0..size).map(move |x| (f64::from(x) * texel, f64::from(y) * texel)))
}
