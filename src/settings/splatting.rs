//! Splatting settings (SPEC §§4–6): kernel, slabs, compositing, early splat elimination.

use super::economies::Economies;
use super::key::Keyed;
use crate::error::setting::{Interval, SettingError};
use crate::kernel::Kernel;

/// Checks the opacity of a first hit, which a ray must be able to reach.
pub(crate) fn check_first_hit(opacity: f64) -> Result<(), SettingError> {
    Interval::THRESHOLD.check("first_hit", opacity)
}

/// The maximum falloff for [`Classification::After`]: beyond it, no kernel reaches the middle between eight voxels.
const MAX_FALLOFF_AFTER: f64 = 11.0;

/// The maximum of [`sheets_per_test`]: the sheets of a group that tiles draw on a GPU.
#[cfg(any(feature = "cpu", feature = "gpu"))]
const MOST_SHEETS_PER_TEST: f64 = 4.0;

/// The number of sheets after which pixels are tested for being opaque, if each stops by itself ([`Classification::After`]): a small group of sheets (§6), of
/// one `unit` in depth at most. A test after every thin sheet would stop pixels in the middle of a surface, just beyond the threshold.
#[cfg(any(feature = "cpu", feature = "gpu"))]
pub(crate) fn sheets_per_test(slab_width: f64) -> u32 {
    (1.0 / slab_width).clamp(1.0, MOST_SHEETS_PER_TEST) as u32
}

/// The minimum of the kernel's discrete transform, relative to its maximum, for [`Interpolation::Exact`]; below it, coefficients would
/// amplify noise without bound.
const MIN_RESPONSE: f64 = 0.002;

/// Which voxels share a sheet buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Method {
    /// Kernel sections between planes parallel to the image (§3.2).
    ImageAligned,
    /// Whole kernels, with sheets along the volume slices most parallel to the image (§3.1).
    AxisAligned,
    /// No sheets: every voxel is composited by itself, back to front (§3, Westover's first form).
    CompositeEverySample,
}

/// What is splatted, which determines where the transfer function and shading are applied.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Classification {
    /// [`Self::After`] where the transfer function comes from a preset or is chosen for the volume and no other setting excludes it, else
    /// [`Self::Before`]: the rule of [`Scene::classification`](crate::Scene::classification), which views apply when they are made.
    Auto,
    /// Voxels are classified and shaded, and their colours are splatted (the paper, SPEC §§3–6).
    Before,
    /// Values and gradients are splatted onto the slab planes; what each pixel sees between two planes is classified and shaded there
    /// (SPEC §9; Mueller, Möller, Crawfis, *Splatting without the blur*, Vis 1999). Image-aligned sheets only.
    After,
}

/// How the kernel reconstructs values for [`Classification::After`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Interpolation {
    /// [`Self::Exact`] where the greatest or the least value of a ray is shown of a volume in memory and the kernel allows it, else [`Self::Smooth`].
    Auto,
    /// The kernel's weighted mean of the voxels' values, which smooths them.
    Smooth,
    /// The weighted mean of coefficients for which every voxel keeps its exact value.
    Exact,
}

/// How values run between two slab planes for [`Classification::After`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SlabProfile {
    /// Linearly.
    Linear,
    /// Linearly to the middle of the cubic through the values and slopes at both planes, and on from there.
    Cubic,
}

/// How kernel sections are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FootprintForm {
    /// 128 pre-integrated sections, of which the nearest is used (§3.2).
    Sections,
    /// The cumulative kernel integral of eq. 3, of which two entries are subtracted, for any slab width (§3.3.1).
    SummedArea,
}

/// How a sheet's accumulated amount becomes colour and opacity. The numbers are those in the shaders.
///
/// From [`Self::Maximum`] on, the means of sheets count: amounts are opacities per unit length, as for [`Self::Linear`], and a sheet's
/// mean at a pixel is its content there divided by the length of the pixel's ray within its slab, in `unit`s (axis-aligned: from one
/// slice to the next). The mean holds the mean opacity per unit length, and the colour times that. If a cut leaves only part of a slab,
/// its mean counts in proportion, except for [`Self::Minimum`]. Means need sheets, so any method except [`Method::CompositeEverySample`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Compositing {
    /// The paper's rule: opacities add up within a sheet, to at most 1.
    Linear,
    /// Amounts are optical depths: a sheet's opacity is `1 - exp(-amount)`, for any slab width.
    Exponential,
    /// A summed projection, clamped to 1 at the end.
    Xray,
    /// Maximum intensity: the mean with the highest opacity along a ray, the nearest of equal ones. An opacity above 1 is first scaled to 1.
    Maximum,
    /// Minimum intensity: the mean with the lowest opacity, of the slabs whose middle on the ray lies where kernels are complete: inside all
    /// cuts and in the box of voxel centres, reduced on every side by the kernel's radius but by at most a quarter of the box; in
    /// perspective also beyond the near plane by the kernels' reach. If that stretch is shorter than a slab, the slab around its middle
    /// counts. The pixel is empty where the ray misses it.
    Minimum,
    /// The sum of sheets divided by the length of the ray in the box of voxels (half a voxel around their centres), from the near plane on.
    /// Every channel is clamped to 1. The pixel is empty where the ray misses the box of voxel centres.
    Average,
    /// An iso-surface: opaque where the mean opacity, interpolated linearly between the middles of slabs, first reaches one half, with the
    /// mean's colour there. Nothing in front of it counts. Front to back only.
    Surface,
}

impl Compositing {
    /// The number of variants.
    pub const COUNT: usize = Self::ALL.len();

    /// All, with their names in scene files.
    pub const ALL: [(&str, Self); 7] = [
        ("linear", Self::Linear),
        ("exponential", Self::Exponential),
        ("xray", Self::Xray),
        ("maximum", Self::Maximum),
        ("minimum", Self::Minimum),
        ("average", Self::Average),
        ("surface", Self::Surface),
    ];

    /// Whether the means of sheets count.
    pub fn is_by_means(self) -> bool {
        self.is_choice() || self.has_surface()
    }

    /// Whether sheets cover one another by their opacities (eq. 2).
    pub fn is_by_opacity(self) -> bool {
        matches!(self, Self::Linear | Self::Exponential)
    }

    /// Whether sheets are added up.
    pub fn is_sum(self) -> bool {
        matches!(self, Self::Xray | Self::Average)
    }

    /// Whether amounts are optical depths.
    pub fn is_optical_depth(self) -> bool {
        self == Self::Exponential
    }

    /// Whether the greatest or the least along a ray is kept.
    pub fn is_extreme(self) -> bool {
        matches!(self, Self::Maximum | Self::Minimum)
    }

    /// Whether the least along a ray is kept.
    pub fn keeps_least(self) -> bool {
        self == Self::Minimum
    }

    /// Whether the mean along a ray is shown.
    pub fn is_average(self) -> bool {
        self == Self::Average
    }

    /// Whether iso-surfaces are shown, at the first of which a ray ends.
    pub fn has_surface(self) -> bool {
        self == Self::Surface
    }

    /// Whether one value stands for all along a ray.
    pub fn is_choice(self) -> bool {
        self.is_extreme() || self.is_average()
    }

    /// Whether one of the values along a ray is chosen and then classified (SPEC §9).
    pub fn chooses_values(self, classification: Classification) -> bool {
        self.is_choice() && classification == Classification::After
    }

    /// Whether the mean of the values along a ray is classified (SPEC §9).
    pub fn shows_means(self, classification: Classification) -> bool {
        self.is_average() && classification == Classification::After
    }

    /// Whether sheets count where they are empty: before splatting, these are minima.
    pub fn counts_empty(self, classification: Classification) -> bool {
        self.keeps_least() && classification != Classification::After
    }

    /// Whether values without an opacity change pixels, because one of all along a ray is chosen, or the least sheet, which may show nothing.
    pub fn counts_all_values(self, classification: Classification) -> bool {
        self.keeps_least() || self.chooses_values(classification)
    }

    /// The compositing by which the compositing buffer becomes an image: after splatting sums are clamped, and all others are premultiplied RGBA already.
    pub(crate) fn finished_as(self, classification: Classification) -> Self {
        if classification == Classification::After && self != Self::Xray { Self::Linear } else { self }
    }

    /// Whether opaque pixels hide what lies behind them; otherwise nothing can be culled (§6).
    pub fn hides(self) -> bool {
        self.is_by_opacity() || self.has_surface()
    }
}

/// The order in which sheets are composited. The numbers are those in the shaders.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Order {
    /// Nearest sheet first.
    FrontToBack,
    /// Farthest sheet first; the same image.
    BackToFront,
}

/// How kernel sections are drawn. The images agree up to rounding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Rasterizer {
    /// Tiles if the device, the view and the footprint form allow it, otherwise quads.
    Auto,
    /// Footprint quads, drawn into sheet buffers (§3.2).
    Quads,
    /// A compute stage in which every tile gathers its sections front to back. It needs 16 KiB of workgroup memory
    /// (WebGPU's default) and the summed-area form, and draws fastest with subgroups of 4 to 64 threads ([`TILE_FEATURES`](crate::gpu::device::TILE_FEATURES)). Without them threads share
    /// values in workgroup memory; browsers have only quads, and DirectX 12 too where its compiler gives no subgroups. After splatting, sums with the kernel's gradient or colours need
    /// 18 to 30 KiB, without subgroups sums of several channels, too; tiles use so much on software drivers only.
    Tiles,
}

/// The pixels around a footprint that are tested for opacity (§6, Fig. 13).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FootprintBox {
    /// The bounding rectangle.
    Rectangle,
    /// The parallelogram that the shear of eq. 9 makes of a square, which is smaller if the grid is anisotropic and seen obliquely. Tiles
    /// only, because its filter is not separable. In perspective, where every voxel has its own shear, the rectangle is used instead.
    Parallelogram,
}

/// All splatting settings of a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Splatting {
    /// Which voxels share a sheet.
    pub method: Method,
    /// The kernel's radius in grid units, 1 to 4.
    pub radius: f64,
    /// The kernel's Gaussian exponent, above 0 and at most 16.
    pub falloff: f64,
    /// Where the transfer function and shading are applied.
    pub classification: Classification,
    /// How values between voxels are reconstructed; without effect for [`Classification::Before`].
    pub interpolation: Interpolation,
    /// The slab width Δ in `unit`s of world length along a ray, 0.05 to 8.
    pub slab_width: f64,
    /// How values run between slab planes; without effect for [`Classification::Before`], and where one value is chosen for a pixel.
    pub slab_profile: SlabProfile,
    /// How kernel sections are stored.
    pub footprint: FootprintForm,
    /// How sheets are composited.
    pub compositing: Compositing,
    /// The order in which sheets are composited.
    pub order: Order,
    /// The opacity from which a pixel counts as opaque, above 0 and at most 1 (§6). With culling, no channel differs by more than 1 minus
    /// this from the image without. [`Compositing::Surface`] uses 1.
    pub opacity_threshold: f64,
    /// Early splat elimination (§6): splats entirely behind opaque pixels are not drawn. Without effect back to front, and where nothing
    /// hides ([`Compositing::hides`]).
    pub culling: bool,
    /// Composite only tiles that received splats (§6), which never changes the image. Without effect for [`Compositing::Minimum`], for which
    /// empty tiles count too.
    pub tiles: bool,
    /// How kernel sections are drawn.
    pub rasterizer: Rasterizer,
    /// The pixels that early splat elimination tests.
    pub footprint_box: FootprintBox,
    /// Economies where they are hardly visible; off by default.
    pub experimental: Economies,
}

impl Splatting {
    /// Checks that the values are in range and go together, independently of the device and the rasterizer.
    ///
    /// # Errors
    /// If a number is not finite or out of its range, means are combined with a method without sheets, surfaces with back to front, or
    /// classification after splatting with a setting that excludes it (SPEC §9).
    pub fn check(&self) -> Result<(), SettingError> {
        self.check_keys("splatting")?;
        self.experimental.check_keys(super::economies::TABLE)?;
        let refused = |found: String, allowed: &str| Err(SettingError::new("splatting.compositing", found, allowed));
        let name = format!("{:?}", self.compositing).to_lowercase();
        if self.compositing.is_by_means() && self.method == Method::CompositeEverySample {
            let found = format!("\"{name}\" with splatting.method = \"composite-every-sample\"");
            return refused(found, "\"linear\", \"exponential\" or \"xray\" with it, or a method with sheets");
        }
        if self.compositing.has_surface() && self.order == Order::BackToFront {
            let found = format!("\"{name}\" with splatting.order = \"back-to-front\"");
            return refused(found, "\"front-to-back\" with it");
        }
        if self.classification == Classification::After { self.check_after() } else { Ok(()) }
    }

    /// Whether what is drawn hides what comes later (SPEC §5): front to back, with a compositing that hides.
    pub(crate) fn hides(&self) -> bool {
        self.order == Order::FrontToBack && self.compositing.hides()
    }

    /// The opacity from which pixels count as opaque. While no surface has been reached, alpha is a mean below one half; a surface itself is opaque.
    pub(crate) fn opaque_from(&self) -> f64 {
        if self.compositing.has_surface() { 1.0 } else { self.opacity_threshold }
    }

    /// [`Self::opaque_from`], if what lies behind opaque pixels is not drawn.
    pub(crate) fn culls_from(&self) -> Option<f64> {
        (self.culling && self.hides()).then(|| self.opaque_from())
    }

    /// The number of segments of a slab after splatting, along each of which values run linearly.
    pub fn segments(&self) -> u32 {
        if self.slab_profile == SlabProfile::Cubic && !self.compositing.is_choice() { 2 } else { 1 }
    }

    /// Whether no other setting excludes [`Classification::After`].
    pub(crate) fn allows_after(&self) -> bool {
        self.check_after().is_ok()
    }

    /// Whether voxels keep their exact values, in a volume in memory.
    pub(crate) fn is_exact(&self) -> bool {
        match self.interpolation {
            Interpolation::Smooth => false,
            Interpolation::Exact => true,
            Interpolation::Auto => self.compositing.is_extreme() && self.allows_exact(),
        }
    }

    /// Whether coefficients of the kernel can give every voxel its value.
    fn allows_exact(&self) -> bool {
        Kernel::new(self.radius, self.falloff).min_discrete_response() >= MIN_RESPONSE
    }

    /// The radius within which a kernel is drawn: after splatting all of it, because where the nearest voxels are equal, voxels of the least weights decide the
    /// direction of a gradient (SPEC §9).
    #[cfg(feature = "gpu")]
    pub(crate) fn drawn_radius(&self, kernel: &Kernel) -> f64 {
        if self.classification == Classification::After { kernel.radius() } else { kernel.support() }
    }

    /// The settings for a volume that is streamed, whose voxels are interpolated as they are.
    pub(crate) fn streamed(self) -> Self {
        let is_auto = self.interpolation == Interpolation::Auto;
        Self { interpolation: if is_auto { Interpolation::Smooth } else { self.interpolation }, ..self }
    }

    /// Checks that the settings allow what of rays is looked at: whether anything is cut, and the opacity whose depth is asked for.
    ///
    /// # Errors
    /// If they do not.
    pub(crate) fn check_rays(&self, is_cut: bool, first_hit: Option<f64>) -> Result<(), SettingError> {
        let refused = |key, found: &str, allowed: &str| Err(SettingError::new(key, found, allowed));
        if self.method == Method::CompositeEverySample && (is_cut || first_hit.is_some()) {
            let found = "\"composite-every-sample\" with clip planes, surfaces or first hits";
            return refused("splatting.method", found, "a method with sheets");
        }
        let Some(opacity) = first_hit else { return Ok(()) };
        if self.compositing.keeps_least() {
            let allowed = "another compositing: the minimum is known only at the end of a ray";
            return refused("splatting.compositing", "\"minimum\" with first hits", allowed);
        }
        check_first_hit(opacity)?;
        if self.culling && self.compositing.hides() && opacity > self.opacity_threshold {
            let allowed = format!("above 0, at most {}, the opacity_threshold", self.opacity_threshold);
            return Err(SettingError::new("first_hit", opacity, allowed));
        }
        if self.order != Order::FrontToBack {
            return refused("splatting.order", "\"back-to-front\" with first hits", "\"front-to-back\"");
        }
        Ok(())
    }

    /// Checks what [`Classification::After`] asks of the other settings.
    fn check_after(&self) -> Result<(), SettingError> {
        let refused = |key: &str, found: String, allowed: &str| Err(SettingError::new(key, found, allowed));
        let by_method = match self.method {
            Method::AxisAligned => Some("splatting.method = \"axis-aligned\""),
            Method::CompositeEverySample => Some("splatting.method = \"composite-every-sample\""),
            Method::ImageAligned => None,
        };
        if let Some(method) = by_method {
            let allowed = "\"before\" with it, or \"image-aligned\"";
            return refused("splatting.classification", format!("\"after\" with {method}"), allowed);
        }
        if let Some(economy) = self.experimental.in_use() {
            let allowed = format!("\"before\" with it, or {} = {}", economy.key, economy.off);
            return refused("splatting.classification", format!("\"after\" with {economy}"), &allowed);
        }
        if self.falloff > MAX_FALLOFF_AFTER {
            let found = format!("{} with splatting.classification = \"after\"", self.falloff);
            return refused("splatting.falloff", found, &format!("at most {MAX_FALLOFF_AFTER} with it"));
        }
        if self.interpolation == Interpolation::Exact && !self.allows_exact() {
            let Self { radius, falloff, .. } = self;
            let found = format!("\"exact\" with splatting.radius = {radius} and splatting.falloff = {falloff}");
            let allowed = "\"smooth\" with them, or a larger falloff (0.95 and above at radius 2)";
            return refused("splatting.interpolation", found, allowed);
        }
        Ok(())
    }
}

impl Default for Splatting {
    fn default() -> Self {
        Self {
            method: Method::ImageAligned,
            radius: 2.0,
            falloff: 2.0,
            classification: Classification::Before,
            interpolation: Interpolation::Smooth,
            slab_width: 1.0,
            slab_profile: SlabProfile::Cubic,
            footprint: FootprintForm::SummedArea,
            compositing: Compositing::Linear,
            order: Order::FrontToBack,
            opacity_threshold: 0.95,
            culling: true,
            tiles: true,
            rasterizer: Rasterizer::Auto,
            footprint_box: FootprintBox::Rectangle,
            experimental: Economies::default(),
        }
    }
}
