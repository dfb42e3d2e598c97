//! A volume on the GPU, shared by any number of views and renderers on one device.

use std::borrow::Cow;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use wgpu::{Device, Queue, TextureView};

use crate::after::normalization::Normalization;
use crate::error::RenderError;
use crate::error::setting::SettingError;
use crate::gpu::all_channels::one_after_the_other;
use crate::gpu::coefficients::Coefficients;
use crate::gpu::fault::scoped;
use crate::gpu::membership::{self, Shaded};
use crate::gpu::ramps::Stored;
use crate::gpu::volume_texture::{OwnColors, Pages, ValueFormat, VolumeTexture};
use crate::lists::brick::BrickList;
use crate::lists::value_list::ValueList;
use crate::volume::{Texel, ValueSlice, Volume};

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
    /// The colours of the channels whose voxels have their own, and the number in them that stands for 1.
    colors: Option<(VolumeTexture, u32)>,
    /// The labels of all segmented channels, uploaded when tables first need them.
    labels: OnceLock<VolumeTexture>,
    value_list: OnceLock<ValueList>,
    /// Of each channel's values.
    numbers: OnceLock<Vec<Normalization>>,
    /// Those of the kernel that was last asked for.
    coefficients: Mutex<Option<KeptCoefficients>>,
    /// The gradients of membership of the labels that were last asked for.
    membership: Mutex<Option<KeptMembership>>,
    /// Where the volume holds no voxels, and pages of them are on the device.
    pages: Option<Paged>,
}

/// Of a volume that is read while it is drawn, what is on a device: pages of a box of its voxels, all that bear on what is drawn of it.
#[derive(Debug)]
#[cfg_attr(target_arch = "wasm32", expect(dead_code, reason = "browsers draw what is in memory"))]
pub(crate) struct Paged {
    /// The slots of the box's pages, of each channel's values, then of labels, then of colours.
    pub(crate) slots: VolumeTexture,
    /// The bits of a voxel's place in its page along each axis.
    pub(crate) bits: u32,
    /// What slots hold.
    pub(crate) values: VolumeTexture,
    pub(crate) labels: Option<VolumeTexture>,
    pub(crate) colors: Option<(VolumeTexture, u32)>,
    /// Of each channel's values.
    pub(crate) numbers: Vec<Normalization>,
    /// The voxels that are drawn: what [`ClassifiedVolume::lists`](super::classified_volume::ClassifiedVolume) would be of the box in memory.
    pub(crate) lists: Vec<BrickList>,
}

/// The coefficients for a kernel's radius and falloff.
type KeptCoefficients = ((f64, f64), Arc<Coefficients>);

/// The gradients of membership for what is shaded by them.
type KeptMembership = (Vec<Shaded>, Arc<VolumeTexture>);

impl GpuVolume {
    /// Uploads a volume's values: for each channel 4 bytes per voxel, or 1 or 2 if they are whole numbers in a range of 256 or 65536, and for a channel of
    /// colours 4 bytes more, or 8 if these have more than 8 bits. Labels, 2 bytes per voxel and segmented channel, follow when a view first has tables
    /// for them.
    ///
    /// # Errors
    /// If the volume has more values than 32 bits count, or needs more layers than the device's textures have, or if the device fails.
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
        check_count(&volume)?;
        let joined = joined_values(&volume);
        let all = joined.as_ref().map_or(volume.values(), ValueSlice::from);
        let upload = || VolumeTexture::upload_in_chunks(device, queue, all, written);
        let values = scoped(device, upload)??;
        drop(joined);
        let colors = all_colors(&volume);
        let colors = colors.map(|colors| scoped(device, || VolumeTexture::upload_colors(device, queue, &colors)));
        let colors = colors.transpose()?.transpose()?;
        let (device, labels, value_list) = (device.clone(), OnceLock::new(), OnceLock::new());
        let (numbers, coefficients) = (OnceLock::new(), Mutex::default());
        Ok(Self::sharing(Shared {
            device,
            volume,
            values,
            colors,
            labels,
            value_list,
            numbers,
            coefficients,
            membership: Mutex::default(),
            pages: None,
        }))
    }

    /// A volume without voxels ([`Volume::hollow`]), with pages of them on a device. Only frames can be drawn of it: nothing that needs its values on the CPU.
    #[cfg(not(target_arch = "wasm32"))]
    pub(crate) fn paged(device: &Device, volume: Volume, mut pages: Paged) -> Self {
        Self::sharing(Shared {
            device: device.clone(),
            volume: Arc::new(volume),
            values: pages.values.clone(),
            colors: pages.colors.clone(),
            labels: pages.labels.clone().map_or_else(OnceLock::new, OnceLock::from),
            value_list: OnceLock::new(),
            numbers: std::mem::take(&mut pages.numbers).into(),
            coefficients: Mutex::default(),
            membership: Mutex::default(),
            pages: Some(pages),
        })
    }

    fn sharing(shared: Shared) -> Self {
        #[cfg_attr(
            target_family = "wasm",
            expect(clippy::arc_with_non_send_sync, reason = "a browser's wgpu belongs to one thread")
        )]
        let shared = Arc::new(shared);
        Self { shared }
    }

    /// What [`Self::gpu_bytes`] of a volume will be, before and after a view shades by label. Examines all values.
    ///
    /// # Errors
    /// If the volume needs more layers than the device's textures have.
    pub fn estimate(device: &Device, volume: &Volume) -> Result<[u64; 2], RenderError> {
        let joined = joined_values(volume);
        let all = joined.as_ref().map_or(volume.values(), ValueSlice::from);
        estimate(device, volume, all.len(), ValueFormat::of(all))
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
        let coefficients = self.kept_coefficients().as_ref().map_or(0, |(_, kept)| kept.gpu_bytes());
        let membership = self.kept_membership().as_ref().map_or(0, |(_, kept)| kept.gpu_bytes);
        textures.into_iter().flatten().map(|texture| texture.gpu_bytes).sum::<u64>() + coefficients + membership
    }

    /// The volume's device.
    pub(crate) fn device(&self) -> &Device {
        &self.shared.device
    }

    /// The format of the values' texels.
    pub(crate) fn value_format(&self) -> ValueFormat {
        self.shared.values.format
    }

    /// The values of all channels, one channel after the other, in their format.
    pub(crate) fn values(&self) -> &TextureView {
        &self.shared.values.view
    }

    /// The colours of the channels whose voxels have their own, one channel after the other.
    pub(crate) fn colors(&self) -> Option<OwnColors<'_>> {
        self.shared.colors.as_ref().map(|(texture, full)| OwnColors { view: &texture.view, full: *full })
    }

    /// The slots of pages, where voxels are in pages.
    pub(crate) fn pages(&self) -> Option<Pages<'_>> {
        self.in_pages().map(|pages| Pages { view: &pages.slots.view, bits: pages.bits })
    }

    /// What is drawn of a volume in pages.
    pub(crate) fn given_lists(&self) -> Option<&[BrickList]> {
        self.in_pages().map(|pages| &pages.lists[..])
    }

    /// The pages, where voxels are in pages. In a browser, where code must be short, they never are.
    #[inline(always)]
    fn in_pages(&self) -> Option<&Paged> {
        self.shared.pages.as_ref().filter(|_| !cfg!(target_arch = "wasm32"))
    }

    /// The labels of all segmented channels, one channel after the other, `R16Uint`, if they were uploaded.
    pub(crate) fn labels(&self) -> Option<&TextureView> {
        self.shared.labels.get().map(|labels| &labels.view)
    }

    /// Where each channel's labels and colours are among these.
    pub(crate) fn stored(&self) -> Vec<Stored> {
        let [labels, colors] = self.first_stored();
        let mut before = Stored { labels, colors };
        let stored = |channel: &Volume| {
            let has = [channel.labels().is_some(), channel.colors().is_some()];
            before.labels += u32::from(has[0]);
            before.colors += u32::from(has[1]);
            let number = |has, number| if has { number } else { 0 };
            Stored { labels: number(has[0], before.labels), colors: number(has[1], before.colors) }
        };
        self.shared.volume.channels().map(stored).collect()
    }

    /// How many channels come before the first one's labels, and before the first one's colours: where voxels are in pages all share one count of slots.
    fn first_stored(&self) -> [u32; 2] {
        if self.in_pages().is_none() {
            return [0; 2];
        }
        let channels = || self.shared.volume.channels();
        let (all, labelled) = (channels().count(), channels().filter(|channel| channel.labels().is_some()).count());
        [all as u32, (all + labelled) as u32]
    }

    /// What each channel's values are splatted as where they are classified afterwards (SPEC §9).
    pub(crate) fn numbers(&self) -> &[Normalization] {
        let of_channel =
            |channel: &Volume| Normalization::of(channel.values().iter()).unwrap_or(Normalization::new([0.0; 2]));
        self.shared.numbers.get_or_init(|| self.shared.volume.channels().map(of_channel).collect())
    }

    fn kept_membership(&self) -> MutexGuard<'_, Option<KeptMembership>> {
        self.shared.membership.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The gradients of membership for what is shaded by them, uploaded at the first request. The gradients of the previous request are dropped.
    ///
    /// # Errors
    /// If they need more layers than the device's textures have, or the device fails.
    pub(crate) fn membership(&self, queue: &Queue, shaded: &[Shaded]) -> Result<Arc<VolumeTexture>, RenderError> {
        if let Some((_, kept)) = self.kept_membership().as_ref().filter(|(of, _)| of == shaded) {
            return Ok(Arc::clone(kept));
        }
        let Shared { device, volume, .. } = &*self.shared;
        let uploaded = scoped(device, || membership::upload(device, queue, volume, shaded))??;
        #[cfg_attr(
            target_arch = "wasm32",
            expect(clippy::arc_with_non_send_sync, reason = "a browser's wgpu belongs to one thread")
        )]
        let uploaded = Arc::new(uploaded);
        *self.kept_membership() = Some((shaded.to_vec(), Arc::clone(&uploaded)));
        Ok(uploaded)
    }

    fn kept_coefficients(&self) -> MutexGuard<'_, Option<KeptCoefficients>> {
        self.shared.coefficients.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The coefficients of all channels for a kernel's radius and falloff, computed at the first request. Those of the previous kernel are dropped.
    ///
    /// # Errors
    /// If no coefficients interpolate the values.
    pub(crate) fn coefficients(&self, kernel: (f64, f64)) -> Result<Arc<Coefficients>, RenderError> {
        if let Some((_, kept)) = self.kept_coefficients().as_ref().filter(|(of, _)| *of == kernel) {
            return Ok(Arc::clone(kept));
        }
        let coefficients = Coefficients::of_volume(&self.shared.volume, kernel).map(Arc::new)?;
        *self.kept_coefficients() = Some((kernel, Arc::clone(&coefficients)));
        Ok(coefficients)
    }

    /// Uploads the labels, if there are any and they are not uploaded yet.
    ///
    /// # Errors
    /// If they need more layers than the device's textures have, or the device fails.
    pub(crate) fn upload_labels(&self, device: &Device, queue: &Queue) -> Result<(), RenderError> {
        if let (None, Some(labels)) = (self.shared.labels.get(), all_labels(&self.shared.volume)) {
            // Labels whose allocation failed are not kept.
            let labels = scoped(device, || VolumeTexture::upload_labels(device, queue, &labels))??;
            // Another thread may have been first; its labels are the same.
            let _ = self.shared.labels.set(labels);
        }
        Ok(())
    }
}

/// The bytes of a volume with a number of values in all channels.
fn estimate(device: &Device, volume: &Volume, values: usize, format: ValueFormat) -> Result<[u64; 2], RenderError> {
    let limits = device.limits();
    let segmented = volume.channels().filter(|channel| channel.labels().is_some()).count().max(1);
    let [values, _] = VolumeTexture::estimate(&limits, values as u64, format)?;
    let [_, labels] = VolumeTexture::estimate(&limits, (volume.values().len() * segmented) as u64, format)?;
    let colors = all_colors(volume).map_or(Ok(0), |colors| VolumeTexture::estimate_colors(&limits, &colors))?;
    Ok([values + colors, values + colors + labels])
}

/// Checks that 32 bits count the values of all channels.
fn check_count(volume: &Volume) -> Result<(), SettingError> {
    let count = volume.channels().count();
    let values = volume.values().len() as u64 * count as u64;
    if count > 1 && values > u64::from(u32::MAX) {
        let found = format!("{values} values in {count} channels");
        return Err(SettingError::new("channel", found, format!("at most {}", u32::MAX)));
    }
    Ok(())
}

/// The values of all channels, one channel after the other, if there are several.
fn joined_values(volume: &Volume) -> Option<Vec<f32>> {
    let are_several = volume.channel_count() > 1;
    are_several.then(|| volume.channels().flat_map(Volume::values).collect())
}

/// The colours of the channels whose voxels have their own.
fn all_colors(volume: &Volume) -> Option<Cow<'_, [Texel]>> {
    one_after_the_other(volume.channels().filter_map(Volume::colors))
}

/// The labels of all segmented channels.
fn all_labels(volume: &Volume) -> Option<Cow<'_, [u16]>> {
    one_after_the_other(volume.channels().filter_map(Volume::labels))
}
