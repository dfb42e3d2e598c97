//! A volume on the GPU, shared by any number of views and renderers of one device.

use std::sync::{Arc, OnceLock};

use wgpu::{Device, Queue, TextureView};

use crate::after::normalization::Normalization;
use crate::error::RenderError;
use crate::gpu::fault::scoped;
use crate::gpu::volume_texture::{ValueFormat, VolumeTexture};
use crate::lists::value_list::ValueList;
use crate::volume::Volume;

/// A volume and its textures on a device. A clone is the same volume: nothing is uploaded twice.
#[derive(Clone, Debug)]
pub struct GpuVolume {
    shared: Arc<Shared>,
}

#[derive(Debug)]
struct Shared {
    device: Device,
    volume: Arc<Volume>,
    values: VolumeTexture,
    /// Uploaded when tables first ask for labels.
    labels: OnceLock<VolumeTexture>,
    value_list: OnceLock<ValueList>,
    numbers: OnceLock<Normalization>,
}

impl GpuVolume {
    /// Uploads a volume's values: 4 bytes a voxel, or 1 or 2 where they are whole numbers in a range of 256 or 65536. Labels, 2 bytes a
    /// voxel, follow when a view first has tables for some.
    ///
    /// # Errors
    /// If the volume needs more layers than the device's textures have, or the device fails.
    pub fn new(device: &Device, queue: &Queue, volume: impl Into<Arc<Volume>>) -> Result<Self, RenderError> {
        Self::new_in_chunks(device, queue, volume, &|| {})
    }

    /// The same for a caller that submits every chunk of values that was written. The queue keeps its own copies of them until then.
    ///
    /// # Errors
    /// See [`Self::new`].
    pub(crate) fn new_in_chunks(
        device: &Device,
        queue: &Queue,
        volume: impl Into<Arc<Volume>>,
        written: &dyn Fn(),
    ) -> Result<Self, RenderError> {
        let volume = volume.into();
        let upload = || VolumeTexture::upload_in_chunks(device, queue, volume.values(), written);
        let values = scoped(device, upload)??;
        let (device, labels, value_list) = (device.clone(), OnceLock::new(), OnceLock::new());
        let numbers = OnceLock::new();
        Ok(Self { shared: Arc::new(Shared { device, volume, values, labels, value_list, numbers }) })
    }

    /// What [`Self::gpu_bytes`] of a volume will be: as long as no view shades by label, and after that. Looks at all values.
    ///
    /// # Errors
    /// If the volume needs more layers than the device's textures have.
    pub fn estimate(device: &Device, volume: &Volume) -> Result<[u64; 2], RenderError> {
        let values = volume.values();
        estimate(device, values.len(), ValueFormat::of(values))
    }

    /// The same of this volume.
    ///
    /// # Errors
    /// See [`Self::estimate`].
    pub(crate) fn needs(&self) -> Result<[u64; 2], RenderError> {
        estimate(&self.shared.device, self.shared.volume.values().len(), self.value_format())
    }

    /// The volume.
    pub fn volume(&self) -> &Arc<Volume> {
        &self.shared.volume
    }

    /// The voxels sorted by value (Table 1), once for all views. Sorted when first asked for, so that a single frame need not
    /// wait for it; a program with iso-ranges to move asks when it has loaded the volume.
    pub fn value_list(&self) -> &ValueList {
        self.shared.value_list.get_or_init(|| ValueList::new(self.shared.volume.values()))
    }

    /// The numbers that values are splatted as where classification comes after splatting; found when first asked for.
    pub(crate) fn numbers(&self) -> Normalization {
        let find = || Normalization::of(self.shared.volume.values().iter().copied());
        *self.shared.numbers.get_or_init(|| find().unwrap_or(Normalization::new([0.0; 2])))
    }

    /// Bytes of GPU memory, however many views there are.
    pub fn gpu_bytes(&self) -> u64 {
        let textures = [Some(&self.shared.values), self.shared.labels.get()];
        textures.into_iter().flatten().map(|texture| texture.gpu_bytes).sum()
    }

    /// The device that it is on.
    pub(crate) fn device(&self) -> &Device {
        &self.shared.device
    }

    /// What the values' texels mean.
    pub(crate) fn value_format(&self) -> ValueFormat {
        self.shared.values.format
    }

    /// The values, in their format.
    pub(crate) fn values(&self) -> &TextureView {
        &self.shared.values.view
    }

    /// The labels, `R16Uint`, if they were uploaded.
    pub(crate) fn labels(&self) -> Option<&TextureView> {
        self.shared.labels.get().map(|labels| &labels.view)
    }

    /// Uploads the labels, if there are any and they are not there yet.
    ///
    /// # Errors
    /// If they need more layers than the device's textures have, or the device fails.
    pub(crate) fn upload_labels(&self, device: &Device, queue: &Queue) -> Result<(), RenderError> {
        if let (None, Some(labels)) = (self.shared.labels.get(), self.shared.volume.labels()) {
            // Those that there was no memory for are not kept.
            let labels = scoped(device, || VolumeTexture::upload_labels(device, queue, labels))??;
            // Another thread may have been first: its are the same.
            let _ = self.shared.labels.set(labels);
        }
        Ok(())
    }
}

fn estimate(device: &Device, voxels: usize, format: ValueFormat) -> Result<[u64; 2], RenderError> {
    let [values, labels] = VolumeTexture::estimate(&device.limits(), voxels as u64, format)?;
    Ok([values, values + labels])
}
