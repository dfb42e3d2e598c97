//! A volume on the GPU, shared by any number of views and renderers on one device.

use std::borrow::Cow;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use wgpu::{Device, Limits, Queue, TextureView};

use crate::after::coefficients;
use crate::after::normalization::Normalization;
use crate::error::RenderError;
use crate::gpu::fault::scoped;
use crate::gpu::volume_texture::{OwnColors, ValueFormat, VolumeTexture};
use crate::lists::value_list::ValueList;
use crate::parallel::prelude::*;
use crate::volume::Volume;

/// A volume and its textures on a device. Clones share the textures.
#[derive(Clone, Debug)]
pub struct GpuVolume {
    shared: Arc<Shared>,
}

#[derive(Debug)]
struct Shared {
    device: Device,
    volume: Arc<Volume>,
    values: VolumeTexture,
    /// The first channel's colours of voxels' own, and the number in them that stands for 1.
    colors: Option<(VolumeTexture, u32)>,
    /// The labels, uploaded when tables first need them.
    labels: OnceLock<VolumeTexture>,
    value_list: OnceLock<ValueList>,
    /// Of the values; `None` if all are holes.
    numbers: OnceLock<Option<Normalization>>,
    /// Those of the kernel that was last asked for.
    coefficients: Mutex<Option<Arc<Coefficients>>>,
}

/// Coefficients that interpolate the values: [`coefficients::of_volume`].
#[derive(Debug)]
pub(crate) struct Coefficients {
    /// The kernel's radius and falloff.
    kernel: (f64, f64),
    /// As values; NaN at holes.
    pub(crate) values: Arc<[f32]>,
    /// What they are splatted as.
    pub(crate) numbers: Normalization,
    /// Uploaded with the first frame.
    texture: OnceLock<VolumeTexture>,
}

impl GpuVolume {
    /// Uploads a volume's values: 4 bytes per voxel, or 1 or 2 if they are whole numbers in a range of 256 or 65536, and for a volume of colours 4
    /// bytes more, or 8 if these have more than 8 bits. Labels, 2 bytes per voxel,
    /// follow when a view first has tables for them.
    ///
    /// # Errors
    /// If the volume needs more layers than the device's textures have, or the device fails.
    pub fn new(device: &Device, queue: &Queue, volume: impl Into<Arc<Volume>>) -> Result<Self, RenderError> {
        Self::new_in_chunks(device, queue, volume, &|| {})
    }

    /// Like [`Self::new`], for a caller that submits after every chunk of values; until then the queue keeps its own copies of them.
    ///
    /// # Errors
    /// As for [`Self::new`].
    pub(crate) fn new_in_chunks(
        device: &Device,
        queue: &Queue,
        volume: impl Into<Arc<Volume>>,
        written: &dyn Fn(),
    ) -> Result<Self, RenderError> {
        let volume = volume.into();
        let all = all_values(&volume);
        let upload = || VolumeTexture::upload_in_chunks(device, queue, &all, written);
        let values = scoped(device, upload)??;
        drop(all);
        let colors =
            volume.colors().map(|colors| scoped(device, || VolumeTexture::upload_colors(device, queue, colors)));
        let colors = colors.transpose()?.transpose()?;
        let (device, labels, value_list) = (device.clone(), OnceLock::new(), OnceLock::new());
        let (numbers, coefficients) = (OnceLock::new(), Mutex::default());
        let shared = Shared { device, volume, values, colors, labels, value_list, numbers, coefficients };
        #[cfg_attr(
            target_family = "wasm",
            expect(clippy::arc_with_non_send_sync, reason = "a browser's wgpu belongs to one thread")
        )]
        let shared = Arc::new(shared);
        Ok(Self { shared })
    }

    /// What [`Self::gpu_bytes`] of a volume will be, before and after a view shades by label. Examines all values.
    ///
    /// # Errors
    /// If the volume needs more layers than the device's textures have.
    pub fn estimate(device: &Device, volume: &Volume) -> Result<[u64; 2], RenderError> {
        let values = all_values(volume);
        estimate(device, volume, values.len(), ValueFormat::of(&values))
    }

    /// [`Self::estimate`] for this volume.
    ///
    /// # Errors
    /// As for [`Self::estimate`].
    pub(crate) fn needs(&self) -> Result<[u64; 2], RenderError> {
        let volume = &self.shared.volume;
        let values = volume.values().len() * volume.channels().count();
        estimate(&self.shared.device, volume, values, self.value_format())
    }

    /// The volume.
    pub fn volume(&self) -> &Arc<Volume> {
        &self.shared.volume
    }

    /// The voxels sorted by value (Table 1), once for all views. They are sorted on the first call, so that a single frame need not wait for it;
    /// a program that will move iso-ranges calls it when it has loaded the volume.
    pub fn value_list(&self) -> &ValueList {
        self.shared.value_list.get_or_init(|| ValueList::new(self.shared.volume.values()))
    }

    /// Bytes of GPU memory, independent of the number of views.
    pub fn gpu_bytes(&self) -> u64 {
        let colors = self.shared.colors.as_ref().map(|(texture, _)| texture);
        let textures = [Some(&self.shared.values), colors, self.shared.labels.get()];
        let coefficients =
            self.last_coefficients().and_then(|last| last.texture.get().map(|texture| texture.gpu_bytes));
        textures.into_iter().flatten().map(|texture| texture.gpu_bytes).sum::<u64>() + coefficients.unwrap_or(0)
    }

    /// The volume's device.
    pub(crate) fn device(&self) -> &Device {
        &self.shared.device
    }

    /// The format of the values' texels.
    pub(crate) fn value_format(&self) -> ValueFormat {
        self.shared.values.format
    }

    /// The values, in their format.
    pub(crate) fn values(&self) -> &TextureView {
        &self.shared.values.view
    }

    /// The first channel's colours of voxels' own.
    pub(crate) fn colors(&self) -> Option<OwnColors<'_>> {
        self.shared.colors.as_ref().map(|(texture, full)| OwnColors { view: &texture.view, full: *full })
    }

    /// The labels, `R16Uint`, if they were uploaded.
    pub(crate) fn labels(&self) -> Option<&TextureView> {
        self.shared.labels.get().map(|labels| &labels.view)
    }

    /// What the values are splatted as where they are classified afterwards (SPEC §9).
    pub(crate) fn numbers(&self) -> Normalization {
        let of_values = || Normalization::of(self.shared.volume.values().iter().copied());
        self.shared.numbers.get_or_init(of_values).unwrap_or(Normalization::new([0.0; 2]))
    }

    fn last_coefficients(&self) -> Option<Arc<Coefficients>> {
        self.shared.coefficients.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// The coefficients for a kernel's radius and falloff, computed at the first request. Those of the previous kernel are dropped.
    ///
    /// # Errors
    /// If no coefficients interpolate the values: those of [`coefficients::of_volume`].
    pub(crate) fn coefficients(&self, kernel: (f64, f64)) -> Result<Arc<Coefficients>, RenderError> {
        if let Some(last) = self.last_coefficients().filter(|last| last.kernel == kernel) {
            return Ok(last);
        }
        let volume = &self.shared.volume;
        let values = coefficients::of_volume(volume, kernel)?;
        let numbers = Normalization::of(values.iter().copied()).unwrap_or(Normalization::new([0.0; 2]));
        #[cfg_attr(
            target_family = "wasm",
            expect(clippy::arc_with_non_send_sync, reason = "a browser's wgpu belongs to one thread")
        )]
        let found = Arc::new(Coefficients { kernel, values, numbers, texture: OnceLock::new() });
        *self.shared.coefficients.lock().unwrap_or_else(PoisonError::into_inner) = Some(Arc::clone(&found));
        Ok(found)
    }

    /// Uploads the labels, if there are any and they are not uploaded yet.
    ///
    /// # Errors
    /// If they need more layers than the device's textures have, or the device fails.
    pub(crate) fn upload_labels(&self, device: &Device, queue: &Queue) -> Result<(), RenderError> {
        if let (None, Some(labels)) = (self.shared.labels.get(), self.shared.volume.labels()) {
            // Labels whose allocation failed are not kept.
            let labels = scoped(device, || VolumeTexture::upload_labels(device, queue, labels))??;
            // Another thread may have been first; its labels are the same.
            let _ = self.shared.labels.set(labels);
        }
        Ok(())
    }
}

impl Coefficients {
    /// Bytes of GPU memory that they will take.
    ///
    /// # Errors
    /// If they need more layers than textures may have.
    pub(crate) fn estimate(&self, limits: &Limits) -> Result<u64, RenderError> {
        Ok(VolumeTexture::estimate(limits, self.values.len() as u64, ValueFormat::Bits)?[0])
    }

    /// The bits of the numbers on the GPU, `R32Uint`.
    ///
    /// # Errors
    /// If they need more layers than the device's textures have, or the device fails.
    pub(crate) fn texture(&self, device: &Device, queue: &Queue) -> Result<&TextureView, RenderError> {
        if self.texture.get().is_none() {
            let numbers = self.numbers;
            let numbers: Vec<f32> = self.values.par_iter().map(|&c| numbers.apply(f64::from(c)) as f32).collect();
            let uploaded = scoped(device, || VolumeTexture::upload_bits(device, queue, &numbers))??;
            // Another thread may have been first: its are the same.
            let _ = self.texture.set(uploaded);
        }
        let missing = || RenderError::Readback("the coefficients' texture is gone".to_owned());
        self.texture.get().map(|texture| &texture.view).ok_or_else(missing)
    }
}

/// The bytes of a volume with a number of values in all channels.
fn estimate(device: &Device, volume: &Volume, values: usize, format: ValueFormat) -> Result<[u64; 2], RenderError> {
    let limits = device.limits();
    let [values, _] = VolumeTexture::estimate(&limits, values as u64, format)?;
    let [_, labels] = VolumeTexture::estimate(&limits, volume.values().len() as u64, format)?;
    let colors = volume.colors().map_or(Ok(0), |colors| VolumeTexture::estimate_colors(&limits, colors))?;
    Ok([values + colors, values + colors + labels])
}

/// The values of all channels, one channel after the other.
fn all_values(volume: &Volume) -> Cow<'_, [f32]> {
    match volume.further() {
        [] => Cow::Borrowed(volume.values()),
        _ => Cow::Owned(volume.channels().flat_map(Volume::values).copied().collect()),
    }
}
