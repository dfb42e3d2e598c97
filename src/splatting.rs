//! Splatting settings (SPEC §§4–6): kernel, slabs, compositing, early splat elimination.

/// Which voxels share a sheet buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Kernel sections between planes parallel to the image (§3.2).
    ImageAligned,
    /// Whole kernels, the volume slices most parallel to the image (§3.1).
    AxisAligned,
    /// None: every voxel is composited by itself, back to front (§3, Westover's first form).
    CompositeEverySample,
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
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Compositing {
    /// The paper's: opacities add up within a sheet, at most to 1.
    Linear,
    /// Amounts are optical depths: a sheet's opacity is `1 - exp(-amount)`, whatever the slab width.
    Exponential,
    /// Summed projection, clamped to 1 at the end.
    Xray,
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
pub enum Rasterizer {
    /// By tiles where device, view and footprint form allow it, else by quads.
    Auto,
    /// Footprint quads, drawn into sheet buffers (§3.2).
    Quads,
    /// Compute: every tile gathers its sections front to back. Needs [`wgpu::Features::SUBGROUP`] with 8 to 32 threads and the
    /// summed-area form.
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
    /// group of sheets that it reaches. Changes no channel by more than `1 - beta`. Front to back only; 1 for off.
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
    /// Slab width Δ in `unit`s of world length along a ray, 0.05 to 8.
    pub slab_width: f64,
    /// How kernel sections are stored.
    pub footprint: FootprintForm,
    /// How sheets are composited.
    pub compositing: Compositing,
    /// In which order sheets are composited.
    pub order: Order,
    /// Opacity from which a pixel counts as opaque, above 0, at most 1 (§6): with culling no channel differs by more than
    /// 1 minus this from the image without.
    pub opacity_threshold: f64,
    /// Early splat elimination (§6): splats behind opaque pixels alone are not drawn. Without effect back to front and for
    /// `Xray`.
    pub culling: bool,
    /// Composite only tiles that received splats (§6). Never changes the image.
    pub tiles: bool,
    /// How kernel sections get to the pixels.
    pub rasterizer: Rasterizer,
    /// What early splat elimination tests.
    pub footprint_box: FootprintBox,
    /// What is left out where it hardly shows.
    pub economies: Economies,
}

impl Default for Splatting {
    fn default() -> Self {
        Self {
            method: Method::ImageAligned,
            radius: 2.0,
            falloff: 2.0,
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
