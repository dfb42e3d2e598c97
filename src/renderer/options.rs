//! What a renderer is made for: how it draws, and what it draws into.

use wgpu::{BlendState, Device, Features, TextureFormat, TextureFormatFeatureFlags, TextureSampleType, TextureUsages};

use crate::gpu::device::DeviceError;
use crate::settings::splatting::Rasterizer;

/// What a renderer is made for: [`Self::for_target`] or [`Self::DETERMINISTIC`], changed by the `with_` functions.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct RendererOptions {
    /// Format of the sheet buffer, `Rgba32Float` or `Rgba16Float`; `None` takes the better one that the device blends.
    pub sheet_format: Option<TextureFormat>,
    /// Sheets drawn by one quad: 1, 2 or 4; `None` takes as many as the device's colour attachments allow.
    pub sheets_per_group: Option<u32>,
    /// What scenes with `splatting.rasterizer = "auto"` are drawn by.
    pub rasterizer: Rasterizer,
    /// Times every stage, where the device has timestamp queries.
    pub profile: bool,
    /// Format of the targets that images are presented in: any that can be rendered to and holds float or normalised numbers.
    pub target_format: TextureFormat,
    /// What becomes of what is there.
    pub blend: Blend,
    /// Whether the target holds linear light. Colours are display-referred (SPEC §3); for such a target they are decoded by
    /// sRGB's curve, so that an opaque image looks the same in every format. `None` is what the format says: sRGB formats hold linear light.
    pub linear: Option<bool>,
    /// Format of the depth attachment of the passes drawn in. It is neither tested nor written.
    pub depth_format: Option<TextureFormat>,
    /// Samples per pixel of the targets. All of a pixel's get the same colour.
    pub sample_count: u32,
}

/// What becomes of what is in the target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Blend {
    /// The image, premultiplied, goes over it: `image + (1 - image.a)·target`, of the numbers that the target holds, so where those are
    /// linear light that is blended. With an opaque background it is the image.
    Over,
    /// The image takes its place.
    Replace,
}

impl RendererOptions {
    /// Draws as well as the device can, over what is in targets of a format.
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

    /// Nothing is left to the device's abilities: on one adapter and driver a scene gives the same bytes on every device that has WebGPU's
    /// default limits, whatever else it has. Sheets are `Rgba16Float`, 4 at once, and drawn by quads. Scenes that insist on tiles
    /// are drawn by tiles, or are an error on a device that has no subgroups. Images are `Rgba32Float`, as they are; change
    /// `target_format` and what follows it as the host needs.
    pub const DETERMINISTIC: Self = Self {
        sheet_format: Some(TextureFormat::Rgba16Float),
        sheets_per_group: Some(4),
        rasterizer: Rasterizer::Quads,
        blend: Blend::Replace,
        ..Self::for_target(TextureFormat::Rgba32Float)
    };

    /// With another format of the sheet buffer.
    pub const fn with_sheet_format(self, format: TextureFormat) -> Self {
        Self { sheet_format: Some(format), ..self }
    }

    /// With another number of sheets drawn by one quad.
    pub const fn with_sheets_per_group(self, sheets: u32) -> Self {
        Self { sheets_per_group: Some(sheets), ..self }
    }

    /// With another rasterizer for scenes that leave the choice.
    pub const fn with_rasterizer(self, rasterizer: Rasterizer) -> Self {
        Self { rasterizer, ..self }
    }

    /// With every stage timed, or none.
    pub const fn with_profile(self, profile: bool) -> Self {
        Self { profile, ..self }
    }

    /// With another format of the targets.
    pub const fn with_target_format(self, target_format: TextureFormat) -> Self {
        Self { target_format, ..self }
    }

    /// With another way to treat what is in the target.
    pub const fn with_blend(self, blend: Blend) -> Self {
        Self { blend, ..self }
    }

    /// With targets that hold linear light, or display-referred colours, whatever their format says.
    pub const fn with_linear(self, linear: bool) -> Self {
        Self { linear: Some(linear), ..self }
    }

    /// With a depth attachment in the passes drawn in.
    pub const fn with_depth_format(self, format: TextureFormat) -> Self {
        Self { depth_format: Some(format), ..self }
    }

    /// With another number of samples per pixel.
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

    /// Checks what concerns the target. Of a device with `TEXTURE_ADAPTER_SPECIFIC_FORMAT_FEATURES`, which does not say what its
    /// adapter adds, only what none can do.
    ///
    /// # Errors
    /// If the device cannot render to, or blend, targets or depth attachments of that kind.
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
