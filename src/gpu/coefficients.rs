//! The coefficients of `interpolation = "exact"` (SPEC §9) on the GPU.

use std::sync::{Arc, OnceLock};

use wgpu::{Device, Limits, Queue, TextureView};

use crate::after::coefficients;
use crate::after::normalization::Normalization;
use crate::error::RenderError;
use crate::gpu::all_channels::one_after_the_other;
use crate::gpu::fault::scoped;
use crate::gpu::volume_texture::{ValueFormat, VolumeTexture};
use crate::parallel::prelude::*;
use crate::volume::Volume;

/// Coefficients that interpolate the values of a volume's channels, and the colours of voxels that have their own: [`coefficients::of_volume`].
#[derive(Debug)]
pub(crate) struct Coefficients {
    /// For each channel, as values; NaN at holes.
    pub(crate) values: Vec<Arc<[f32]>>,
    /// What each channel's are splatted as.
    pub(crate) numbers: Vec<Normalization>,
    /// For each channel whose voxels have colours of their own.
    colors: Vec<Arc<[[f32; 4]]>>,
    /// Uploaded with the first frame.
    texture: OnceLock<VolumeTexture>,
    color_texture: OnceLock<VolumeTexture>,
}

impl Coefficients {
    /// Those of a volume for a kernel's radius and falloff.
    ///
    /// # Errors
    /// If no coefficients interpolate the values: those of [`coefficients::exact`].
    pub(super) fn of_volume(volume: &Volume, kernel: (f64, f64)) -> Result<Self, RenderError> {
        let (mut values, mut numbers, mut colors) = (Vec::new(), Vec::new(), Vec::new());
        for channel in volume.channels() {
            let exact = coefficients::of_volume(channel, kernel)?;
            numbers.push(Normalization::of(exact.iter().copied()).unwrap_or(Normalization::new([0.0; 2])));
            values.push(exact);
            colors.extend(coefficients::of_colors(channel, kernel)?);
        }
        Ok(Self { values, numbers, colors, texture: OnceLock::new(), color_texture: OnceLock::new() })
    }

    /// Bytes of GPU memory that they will take.
    ///
    /// # Errors
    /// If they need more layers than textures may have.
    pub(crate) fn estimate(&self, limits: &Limits) -> Result<u64, RenderError> {
        let voxels: usize = self.values.iter().map(|values| values.len()).sum();
        let colored: usize = self.colors.iter().map(|colors| colors.len()).sum();
        let [numbers, _] = VolumeTexture::estimate(limits, voxels as u64, ValueFormat::Bits)?;
        let colors = if colored > 0 { VolumeTexture::estimate_color_bits(limits, colored as u64)? } else { 0 };
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

    /// The bits of the numbers of all channels on the GPU, one channel after the other, `R32Uint`.
    ///
    /// # Errors
    /// If they need more layers than the device's textures have, or the device fails.
    pub(crate) fn texture(&self, device: &Device, queue: &Queue) -> Result<&TextureView, RenderError> {
        kept(&self.texture, || {
            let mut all: Vec<f32> = Vec::new();
            for (values, numbers) in self.values.iter().zip(&self.numbers) {
                all.extend(values.par_iter().map(|&c| numbers.apply(f64::from(c)) as f32).numbers());
            }
            scoped(device, || VolumeTexture::upload_bits(device, queue, &all))?
        })
    }

    /// The bits of the colours' coefficients, one channel with colours after the other, `Rgba32Uint`; `None` if no voxels have colours of their own.
    ///
    /// # Errors
    /// As for [`Self::texture`].
    pub(crate) fn color_texture(&self, device: &Device, queue: &Queue) -> Result<Option<&TextureView>, RenderError> {
        if self.colors.is_empty() {
            return Ok(None);
        }
        let upload = || {
            let colors = one_after_the_other(self.colors.iter().map(|colors| &**colors)).unwrap_or_default();
            scoped(device, || VolumeTexture::upload_color_bits(device, queue, &colors))?
        };
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
