//! Splatting settings (SPEC §§4–6): kernel, slabs, compositing, early splat elimination.

use std::ops::Bound::{Excluded, Included};

use crate::geometry::kernel::Kernel;
use crate::setting_error::{Interval, SettingError};

/// Kernel radii, grid units.
pub(crate) const RADIUS: Interval = Interval::new(Included(1.0), Included(4.0));
/// Gaussian exponents of kernels.
pub(crate) const FALLOFF: Interval = Interval::new(Excluded(0.0), Included(16.0));
/// Widths of slabs, `unit`s.
pub(crate) const SLAB_WIDTH: Interval = Interval::new(Included(0.05), Included(8.0));

/// Checks an opacity whose depth is asked for: one that a ray can reach.
pub(crate) fn check_first_hit(opacity: f64) -> Result<(), SettingError> {
    Interval::THRESHOLD.check("first_hit", opacity)
}

/// The largest falloff with [`Classification::After`]: with more, no kernel reaches the middle between eight voxels.
const MAX_FALLOFF_AFTER: f64 = 11.0;

/// The least that the kernel's discrete transform may have of its maximum for [`Interpolation::Exact`]; below, coefficients would
/// amplify noise without bound.
const MIN_RESPONSE: f64 = 0.002;

/// Which voxels share a sheet buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Method {
    /// Kernel sections between planes parallel to the image (§3.2).
    ImageAligned,
    /// Whole kernels, the volume slices most parallel to the image (§3.1).
    AxisAligned,
    /// None: every voxel is composited by itself, back to front (§3, Westover's first form).
    CompositeEverySample,
}

/// What is splatted, and so where transfer function and shading are applied.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Classification {
    /// Voxels are classified and shaded, and their colours are splatted (the paper, SPEC §§3–6).
    Before,
    /// Values and gradients are splatted onto the slab planes; what each pixel sees between two planes is classified and shaded there
    /// (SPEC §9; Mueller, Möller, Crawfis, *Splatting without the blur*, Vis 1999). Image-aligned sheets only.
    After,
}

/// How the kernel reconstructs values for [`Classification::After`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// The kernel's weighted mean of the voxels' values, which smooths them.
    Smooth,
    /// The weighted mean of coefficients that are chosen so that every voxel has exactly its value.
    Exact,
}

/// How kernel sections are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FootprintForm {
    /// 128 pre-integrated sections, the nearest one picked (§3.2).
    Sections,
    /// The cumulative kernel integral of eq. 3, two entries subtracted: any slab width (§3.3.1).
    SummedArea,
}

/// How a sheet's accumulated amount becomes colour and opacity; numbered as in the shaders.
///
/// From [`Self::Maximum`] on it is sheets' means that count: amounts are opacities per unit length, as for [`Self::Linear`], and the mean of
/// a sheet at a pixel is what it holds there over the length of the pixel's ray within its slab, in `unit`s (axis-aligned: from one slice
/// to the next), so the mean opacity per unit length, and colour times that. What a cut leaves of a slab counts by its share of the slab, but for
/// [`Self::Minimum`]. They need sheets, so a method other than [`Method::CompositeEverySample`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Compositing {
    /// The paper's: opacities add up within a sheet, at most to 1.
    Linear,
    /// Amounts are optical depths: a sheet's opacity is `1 - exp(-amount)`, whatever the slab width.
    Exponential,
    /// Summed projection, clamped to 1 at the end.
    Xray,
    /// Maximum intensity: of the means along a ray the one of most opacity, the nearest of equal ones. Above 1 opacity is scaled to 1
    /// first.
    Maximum,
    /// Minimum intensity: the one of least opacity, of the slabs whose middle on the ray lies where kernels are complete: in the box of
    /// voxel centres, less the kernel's radius on every side but no more than a quarter of the box; in perspective also as far beyond the near plane
    /// as kernels reach; and inside of all that cuts. Where that stretch is shorter than a slab, it is the slab around its middle. Nothing
    /// where the ray misses it.
    Minimum,
    /// The sum of sheets over the length of the ray in the volume, which is what the ray's part in the box of voxels (half a voxel
    /// around their centres) shows, from the near plane on. Every channel is clamped to 1. Nothing where the ray misses the box of voxel
    /// centres.
    Average,
    /// An iso-surface's look: opaque where the mean opacity first reaches one half, if it grows evenly from the middle of a slab to that of the
    /// next, with the colour that the mean has there. Nothing in front of it counts. Front to back only.
    Surface,
}

impl Compositing {
    /// How many there are.
    pub const COUNT: usize = 7;

    /// Whether sheets' means count.
    pub fn is_by_means(self) -> bool {
        matches!(self, Self::Maximum | Self::Minimum | Self::Average | Self::Surface)
    }

    /// Whether what is opaque hides what lies behind it: nothing else can be culled (§6).
    pub fn hides(self) -> bool {
        matches!(self, Self::Linear | Self::Exponential | Self::Surface)
    }
}

/// The order in which sheets meet the compositing buffer; numbered as in the shaders.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// Nearest sheet first.
    FrontToBack,
    /// Farthest sheet first; the same image.
    BackToFront,
}

/// How kernel sections get to the pixels. The same image to rounding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Rasterizer {
    /// By tiles where device, view and footprint form allow it, else by quads.
    Auto,
    /// Footprint quads, drawn into sheet buffers (§3.2).
    Quads,
    /// Compute: every tile gathers its sections front to back. Needs [`TILE_FEATURES`](crate::gpu::device::TILE_FEATURES) with 8 to 32 threads, 16 KiB of
    /// memory for a workgroup as WebGPU has by default, and the summed-area form.
    Tiles,
}

/// What is tested for being opaque around a footprint (§6, Fig. 13).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FootprintBox {
    /// The bounding rectangle.
    Rectangle,
    /// The parallelogram that the shear of eq. 9 makes of a square: less, where the grid is anisotropic and seen obliquely. By
    /// tiles only, as its filter is not separable. In perspective, where every voxel has its own shear, the rectangle still.
    Parallelogram,
}

/// Ways to draw less where it hardly shows (§8, the paper's future work). By tiles only.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Economies {
    /// Voxels with an opacity per unit length below this are projected as whole kernels, into the sheet that their centre lies in.
    /// 0 for none.
    pub whole_below: f64,
    /// β-acceleration: where everything within a kernel's box has this opacity by then, the kernel is projected whole, into the first
    /// group of sheets that it reaches. Changes no channel by more than `1 - beta`. Front to back only, and none for
    /// [`Compositing::Surface`]; 1 for off.
    pub beta: f64,
    /// A footprint ends where it adds less than this to its sheet's alpha. 0 for the whole kernel.
    pub resolution: f64,
}

impl Default for Economies {
    /// None.
    fn default() -> Self {
        Self { whole_below: 0.0, beta: 1.0, resolution: 0.0 }
    }
}

/// All splatting settings of a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Splatting {
    /// Image-aligned or axis-aligned sheets, or none.
    pub method: Method,
    /// Kernel radius in grid units, 1 to 4.
    pub radius: f64,
    /// Gaussian exponent of the kernel, above 0, at most 16.
    pub falloff: f64,
    /// Where transfer function and shading are applied.
    pub classification: Classification,
    /// How values between voxels are reconstructed; without effect for [`Classification::Before`].
    pub interpolation: Interpolation,
    /// Slab width Δ in `unit`s of world length along a ray, 0.05 to 8.
    pub slab_width: f64,
    /// How kernel sections are stored.
    pub footprint: FootprintForm,
    /// How sheets are composited.
    pub compositing: Compositing,
    /// In which order sheets are composited.
    pub order: Order,
    /// Opacity from which a pixel counts as opaque, above 0, at most 1 (§6): with culling no channel differs by more than
    /// 1 minus this from the image without. For [`Compositing::Surface`] it is 1.
    pub opacity_threshold: f64,
    /// Early splat elimination (§6): splats behind opaque pixels alone are not drawn. Without effect back to front and where
    /// nothing hides ([`Compositing::hides`]).
    pub culling: bool,
    /// Composite only tiles that received splats (§6). Never changes the image. Without effect for [`Compositing::Minimum`], which looks at
    /// what is empty, too.
    pub tiles: bool,
    /// How kernel sections get to the pixels.
    pub rasterizer: Rasterizer,
    /// What early splat elimination tests.
    pub footprint_box: FootprintBox,
    /// What is left out where it hardly shows.
    pub economies: Economies,
}

impl Splatting {
    /// Checks what types do not say, whatever the device and the rasterizer.
    ///
    /// # Errors
    /// If a number is not finite or out of its range, means are asked for where there are no sheets, surfaces back to front, or
    /// classification after splatting with what excludes it (SPEC §9).
    pub fn check(&self) -> Result<(), SettingError> {
        RADIUS.check("splatting.radius", self.radius)?;
        FALLOFF.check("splatting.falloff", self.falloff)?;
        SLAB_WIDTH.check("splatting.slab_width", self.slab_width)?;
        Interval::THRESHOLD.check("splatting.opacity_threshold", self.opacity_threshold)?;
        let Economies { whole_below, beta, resolution } = self.economies;
        Interval::SHARE.check("splatting.whole_below", whole_below)?;
        Interval::THRESHOLD.check("splatting.beta", beta)?;
        Interval::SHARE.check("splatting.resolution", resolution)?;
        let refused = |found: String, allowed: &str| Err(SettingError::new("splatting.compositing", found, allowed));
        let name = format!("{:?}", self.compositing).to_lowercase();
        if self.compositing.is_by_means() && self.method == Method::CompositeEverySample {
            let found = format!("\"{name}\" with splatting.method = \"composite-every-sample\"");
            return refused(found, "\"linear\", \"exponential\" or \"xray\" with it, or a method with sheets");
        }
        if self.compositing == Compositing::Surface && self.order == Order::BackToFront {
            let found = format!("\"{name}\" with splatting.order = \"back-to-front\"");
            return refused(found, "\"front-to-back\" with it");
        }
        match self.classification {
            Classification::Before => Ok(()),
            Classification::After => self.check_after(),
        }
    }

    /// Checks what [`Classification::After`] asks of the other settings.
    fn check_after(&self) -> Result<(), SettingError> {
        let refused = |key: &str, found: String, allowed: &str| Err(SettingError::new(key, found, allowed));
        let excluded = match (self.method, &self.economies) {
            (Method::AxisAligned, _) => Some("splatting.method = \"axis-aligned\"".to_owned()),
            (Method::CompositeEverySample, _) => Some("splatting.method = \"composite-every-sample\"".to_owned()),
            (_, Economies { whole_below, .. }) if *whole_below > 0.0 => {
                Some(format!("splatting.whole_below = {whole_below}"))
            }
            (_, Economies { beta, .. }) if *beta < 1.0 => Some(format!("splatting.beta = {beta}")),
            (_, Economies { resolution, .. }) if *resolution > 0.0 => {
                Some(format!("splatting.resolution = {resolution}"))
            }
            _ => None,
        };
        if let Some(setting) = excluded {
            return refused("splatting.classification", format!("\"after\" with {setting}"), "\"before\" with it");
        }
        if self.falloff > MAX_FALLOFF_AFTER {
            let found = format!("{} with splatting.classification = \"after\"", self.falloff);
            return refused("splatting.falloff", found, &format!("at most {MAX_FALLOFF_AFTER} with it"));
        }
        let response = || Kernel::new(self.radius, self.falloff).min_discrete_response();
        if self.interpolation == Interpolation::Exact && response() < MIN_RESPONSE {
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
            footprint: FootprintForm::SummedArea,
            compositing: Compositing::Linear,
            order: Order::FrontToBack,
            opacity_threshold: 0.95,
            culling: true,
            tiles: true,
            rasterizer: Rasterizer::Auto,
            footprint_box: FootprintBox::Rectangle,
            economies: Economies::default(),
        }
    }
}
