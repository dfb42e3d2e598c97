//! Options of headless rendering.

use super::Backend;
#[cfg(feature = "gpu")]
use crate::gpu::device::DeviceRequirements;
#[cfg(feature = "gpu")]
use crate::gpu::options::RendererOptions;
use crate::settings::splatting::Rasterizer;
#[cfg(feature = "gpu")]
use wgpu::TextureFormat;

/// The backend, and how a GPU is chosen and opened. Start from [`Self::default`] or `Self::DETERMINISTIC` and change them by the `with_` functions.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct HeadlessOptions {
    /// The backend that computes images.
    pub backend: Backend,
    /// Part of the adapter's name, in any case; `None` prefers an adapter that can run the renderer, and a GPU to a software driver.
    pub adapter: Option<String>,
    /// Features and limits to request; `None` requests [`DeviceRequirements::for_adapter`].
    #[cfg(feature = "gpu")]
    pub requirements: Option<DeviceRequirements>,
    /// Format of the sheet buffer; see `RendererOptions`.
    #[cfg(feature = "gpu")]
    pub sheet_format: Option<TextureFormat>,
    /// Sheets drawn by one quad; see `RendererOptions`.
    pub sheets_per_group: Option<u32>,
    /// The rasterizer for scenes that name none; see `RendererOptions`.
    pub rasterizer: Rasterizer,
    /// Times every stage; see `RendererOptions`.
    pub profile: bool,
}

impl HeadlessOptions {
    /// The most capable adapter, and on it what [`RendererOptions::DETERMINISTIC`] promises.
    #[cfg(feature = "gpu")]
    pub const DETERMINISTIC: Self = Self {
        backend: Backend::Gpu,
        adapter: None,
        requirements: None,
        sheet_format: RendererOptions::DETERMINISTIC.sheet_format,
        sheets_per_group: RendererOptions::DETERMINISTIC.sheets_per_group,
        rasterizer: RendererOptions::DETERMINISTIC.rasterizer,
        profile: false,
    };

    /// These options with another backend.
    pub fn with_backend(self, backend: Backend) -> Self {
        Self { backend, ..self }
    }

    /// These options with the adapter that has this in its name, ignoring case.
    pub fn with_adapter(self, name: impl Into<String>) -> Self {
        Self { adapter: Some(name.into()), ..self }
    }

    /// These options with a device of these features and limits.
    #[cfg(feature = "gpu")]
    pub fn with_requirements(self, requirements: DeviceRequirements) -> Self {
        Self { requirements: Some(requirements), ..self }
    }

    /// These options with another format of the sheet buffer.
    #[cfg(feature = "gpu")]
    pub fn with_sheet_format(self, format: TextureFormat) -> Self {
        Self { sheet_format: Some(format), ..self }
    }

    /// These options with another number of sheets that one quad draws.
    pub fn with_sheets_per_group(self, sheets: u32) -> Self {
        Self { sheets_per_group: Some(sheets), ..self }
    }

    /// These options with another rasterizer for scenes that do not name one.
    pub fn with_rasterizer(self, rasterizer: Rasterizer) -> Self {
        Self { rasterizer, ..self }
    }

    /// These options with every stage timed, or no stage.
    pub fn with_profile(self, profile: bool) -> Self {
        Self { profile, ..self }
    }
}

/// [`Backend::Auto`] with the most capable adapter.
impl Default for HeadlessOptions {
    fn default() -> Self {
        Self {
            backend: Backend::Auto,
            adapter: None,
            #[cfg(feature = "gpu")]
            requirements: None,
            #[cfg(feature = "gpu")]
            sheet_format: None,
            sheets_per_group: None,
            rasterizer: Rasterizer::Auto,
            profile: false,
        }
    }
}
