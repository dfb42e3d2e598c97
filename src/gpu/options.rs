//! Options of a renderer: how it draws, and into what kind of target.

use wgpu::{BlendState, Device, Features, TextureFormat, TextureFormatFeatureFlags, TextureSampleType, TextureUsages};

use crate::gpu::device::DeviceError;
use crate::settings::splatting::Rasterizer;

/// Options of a renderer: [`Self::for_target`] or [`Self::DETERMINISTIC`], changed by the `with_` functions.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct RendererOptions {
    /// The format of the sheet buffer, `Rgba32Float` or `Rgba16Float`; `None` means the more precise one that the device can blend.
    pub sheet_format: Option<TextureFormat>,
    /// The number of sheets that one quad draws: 1, 2 or 4; `None` means as many as the device's colour attachments allow.
    pub sheets_per_group: Option<u32>,
    /// The rasterizer for scenes with `splatting.rasterizer = "auto"`.
    pub rasterizer: Rasterizer,
    /// Whether every stage is timed, if the device has timestamp queries.
    pub profile: bool,
    /// The format of the targets: any renderable format with float or normalised numbers.
    pub target_format: TextureFormat,
    /// How images are combined with the target's content.
    pub blend: Blend,
    /// Whether the target holds linear light. Colours are display-referred (SPEC §3); for such a target they are decoded by sRGB's curve, so that
    /// an opaque image looks the same in every format. `None` follows the format: sRGB formats hold linear light.
    pub linear: Option<bool>,
    /// The format of the depth attachment in the host's passes. It is neither tested nor written.
    pub depth_format: Option<TextureFormat>,
    /// The number of samples per pixel in the targets. All samples of a pixel get the same colour.
    pub sample_count: u32,
}

/// How an image is combined with the target's content.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Blend {
    /// The premultiplied image is composited over it: `image + (1 - image.a)·target`, in the target's own numbers, so in linear light if it holds
    /// that. With an opaque background the image replaces it.
    Over,
    /// The image replaces it.
    Replace,
}

impl RendererOptions {
    /// Options that use everything the device supports and composite over the content of targets of a format.
    pub const fn for_target(format: TextureFormat) -> Self {
        Self {
            sheet_format: None,
            sheets_per_group: None,
            rasterizer: Rasterizer::Auto,
            profile: false,
            target_format: format,
            blend: Blend::Over,
            linear: None,
            depth_format: None,
            sample_count: 1,
        }
    }

    /// Options under which the image does not depend on the device's limits and features: on one adapter and driver a scene gives the same bytes
    /// on every device that has at least WebGPU's default limits. Sheets are `Rgba16Float`, 4 per quad, and drawn by quads. Scenes that
    /// require tiles are drawn by tiles, or refused on a device that has none. The target format is `Rgba32Float`; a host may
    /// change it and the fields after it.
    pub const DETERMINISTIC: Self = Self {
        sheet_format: Some(TextureFormat::Rgba16Float),
        sheets_per_group: Some(4),
        rasterizer: Rasterizer::Quads,
        blend: Blend::Replace,
        ..Self::for_target(TextureFormat::Rgba32Float)
    };

    /// These options with another format of the sheet buffer.
    pub const fn with_sheet_format(self, format: TextureFormat) -> Self {
        Self { sheet_format: Some(format), ..self }
    }

    /// These options with another number of sheets that one quad draws.
    pub const fn with_sheets_per_group(self, sheets: u32) -> Self {
        Self { sheets_per_group: Some(sheets), ..self }
    }

    /// These options with another rasterizer for scenes that do not name one.
    pub const fn with_rasterizer(self, rasterizer: Rasterizer) -> Self {
        Self { rasterizer, ..self }
    }

    /// These options with every stage timed, or no stage.
    pub const fn with_profile(self, profile: bool) -> Self {
        Self { profile, ..self }
    }

    /// These options with another format of the targets.
    pub const fn with_target_format(self, target_format: TextureFormat) -> Self {
        Self { target_format, ..self }
    }

    /// These options with another way to combine images with the target's content.
    pub const fn with_blend(self, blend: Blend) -> Self {
        Self { blend, ..self }
    }

    /// These options with targets that hold linear light, or display-referred colours, whatever their format implies.
    pub const fn with_linear(self, linear: bool) -> Self {
        Self { linear: Some(linear), ..self }
    }

    /// These options with a depth attachment in the host's passes.
    pub const fn with_depth_format(self, format: TextureFormat) -> Self {
        Self { depth_format: Some(format), ..self }
    }

    /// These options with another number of samples per pixel.
    pub const fn with_sample_count(self, sample_count: u32) -> Self {
        Self { sample_count, ..self }
    }

    /// Whether images are decoded to linear light.
    pub(crate) fn is_linear(&self) -> bool {
        self.linear.unwrap_or(self.target_format.is_srgb())
    }

    /// How images are blended.
    pub(crate) fn blend_state(&self) -> Option<BlendState> {
        match self.blend {
            Blend::Over => Some(BlendState::PREMULTIPLIED_ALPHA_BLENDING),
            Blend::Replace => None,
        }
    }

    /// Checks the options about the target. A device with `TEXTURE_ADAPTER_SPECIFIC_FORMAT_FEATURES` does not report what its adapter supports, so
    /// only what no device supports is refused there.
    ///
    /// # Errors
    /// If the device cannot render to, or blend, targets or depth attachments with these options.
    pub(crate) fn check_target(&self, device: &Device) -> Result<(), DeviceError> {
        let features = device.features();
        let refused =
            |option, found, allowed: &str| Err(DeviceError::Unsupported { option, found, allowed: allowed.to_owned() });
        let format = self.target_format;
        let is_float = matches!(format.sample_type(None, Some(features)), Some(TextureSampleType::Float { .. }));
        if !is_float || format.is_compressed() || format.is_multi_planar_format() {
            let allowed = "formats of float or normalised numbers that can be rendered to";
            return refused("target_format", format!("{format:?}"), allowed);
        }
        if let Some(depth) = self.depth_format
            && !depth.has_depth_aspect()
        {
            return refused("depth_format", format!("{depth:?}"), "formats with depth");
        }
        if !matches!(self.sample_count, 1 | 2 | 4 | 8 | 16) {
            return refused("sample_count", self.sample_count.to_string(), "1, 2, 4, 8 or 16");
        }
        if features.contains(Features::TEXTURE_ADAPTER_SPECIFIC_FORMAT_FEATURES) {
            return Ok(());
        }
        let guaranteed = format.guaranteed_format_features(features);
        if !guaranteed.allowed_usages.contains(TextureUsages::RENDER_ATTACHMENT) {
            let found = format!("{format:?}, which this device need not be able to render to");
            return refused("target_format", found, "formats that can be rendered to with the device's features");
        }
        if self.blend == Blend::Over && !guaranteed.flags.contains(TextureFormatFeatureFlags::BLENDABLE) {
            let found = format!("Over in {format:?}, which this device need not be able to blend");
            let with = if format == TextureFormat::Rgba32Float { ", or the feature FLOAT32_BLENDABLE" } else { "" };
            return refused("blend", found, &format!("Replace, or formats that can be blended{with}"));
        }
        for format in [Some(format), self.depth_format].into_iter().flatten() {
            let flags = format.guaranteed_format_features(features).flags;
            if !flags.sample_count_supported(self.sample_count) {
                let found = format!("{} of {format:?}", self.sample_count);
                let counts = flags.supported_sample_counts();
                let counts: Vec<String> = counts.iter().map(u32::to_string).collect();
                return refused("sample_count", found, &format!("{} of it on this device", counts.join(" or ")));
            }
        }
        Ok(())
    }
}
