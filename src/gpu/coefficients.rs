//! The coefficients of `interpolation = "exact"` (SPEC §9) on the GPU.

use std::sync::{Arc, OnceLock};

use wgpu::{Device, Limits, Queue, TextureView};

use crate::after::coefficients;
use crate::after::normalization::Normalization;
use crate::error::RenderError;
use crate::gpu::fault::scoped;
use crate::gpu::volume_texture::{ValueFormat, VolumeTexture};
use crate::parallel::prelude::*;
use crate::volume::Volume;

/// Coefficients that interpolate the values of one channel, and the colours of its voxels if they have their own: [`coefficients::of_volume`].
#[derive(Debug)]
pub(crate) struct Coefficients {
    /// As values; NaN at holes.
    pub(crate) values: Arc<[f32]>,
    /// What they are splatted as.
    pub(crate) numbers: Normalization,
    colors: Option<Arc<[[f32; 4]]>>,
    /// Uploaded with the first frame.
    texture: OnceLock<VolumeTexture>,
    color_texture: OnceLock<VolumeTexture>,
}

impl Coefficients {
    /// Those of a channel for a kernel's radius and falloff.
    ///
    /// # Errors
    /// If no coefficients interpolate the values: those of [`coefficients::exact`].
    pub(super) fn of_channel(channel: &Volume, kernel: (f64, f64)) -> Result<Self, RenderError> {
        let values = coefficients::of_volume(channel, kernel)?;
        let numbers = Normalization::of(values.iter().copied()).unwrap_or(Normalization::new([0.0; 2]));
        let colors = coefficients::of_colors(channel, kernel)?;
        Ok(Self { values, numbers, colors, texture: OnceLock::new(), color_texture: OnceLock::new() })
    }

    /// Bytes of GPU memory that they will take.
    ///
    /// # Errors
    /// If they need more layers than textures may have.
    pub(crate) fn estimate(&self, limits: &Limits) -> Result<u64, RenderError> {
        let voxels = self.values.len() as u64;
        let [numbers, _] = VolumeTexture::estimate(limits, voxels, ValueFormat::Bits)?;
        let colors = self.colors.as_ref().map_or(Ok(0), |_| VolumeTexture::estimate_color_bits(limits, voxels))?;
        Ok(numbers + colors)
    }

    /// Bytes of GPU memory that they take.
    pub(super) fn gpu_bytes(&self) -> u64 {
        [&self.texture, &self.color_texture]
            .into_iter()
            .filter_map(OnceLock::get)
            .map(|texture| texture.gpu_bytes)
            .sum()
    }

    /// The bits of the numbers on the GPU, `R32Uint`.
    ///
    /// # Errors
    /// If they need more layers than the device's textures have, or the device fails.
    pub(crate) fn texture(&self, device: &Device, queue: &Queue) -> Result<&TextureView, RenderError> {
        kept(&self.texture, || {
            let numbers = self.numbers;
            let numbers: Vec<f32> = self.values.par_iter().map(|&c| numbers.apply(f64::from(c)) as f32).collect();
            scoped(device, || VolumeTexture::upload_bits(device, queue, &numbers))?
        })
    }

    /// The bits of the colours' coefficients, `Rgba32Uint`; `None` if voxels have no colours of their own.
    ///
    /// # Errors
    /// As for [`Self::texture`].
    pub(crate) fn color_texture(&self, device: &Device, queue: &Queue) -> Result<Option<&TextureView>, RenderError> {
        let Some(colors) = &self.colors else { return Ok(None) };
        let upload = || scoped(device, || VolumeTexture::upload_color_bits(device, queue, colors))?;
        kept(&self.color_texture, upload).map(Some)
    }
}

/// A texture that is uploaded when it is first needed.
fn kept(
    texture: &OnceLock<VolumeTexture>,
    upload: impl FnOnce() -> Result<VolumeTexture, RenderError>,
) -> Result<&TextureView, RenderError> {
    if texture.get().is_none() {
        let uploaded = upload()?;
        // Another thread may have been first: its texture is the same.
        let _ = texture.set(uploaded);
    }
    let missing = || RenderError::Readback("the coefficients' texture is gone".to_owned());
    texture.get().map(|texture| &texture.view).ok_or_else(missing)
}
