//! The gradients of the membership of labels (SPEC §15) on the GPU: blocks of 8×8×8 voxels, of which only those that have gradients are there.
//! `shaders/shared/gradient.wgsl` looks them up.

use std::collections::BTreeSet;

use glam::{DVec3, UVec3};
use wgpu::{Device, Limits, Queue};

use crate::error::RenderError;
use crate::gpu::volume_texture::{ValueFormat, VolumeTexture};
use crate::parallel::prelude::*;
use crate::settings::transfer_function::TransferFunction;
use crate::volume::{Grid, Members, Volume};

/// The side of a block in voxels, and the words of its mask: a bit for each voxel.
const SIDE: u32 = 8;
const MASK: usize = 16;

/// The words for each channel before all others: where its directory begins, or 0, and whether its labels lie beside its values.
const HEADER: usize = 2;

/// The voxels of a channel that have normals of their label's membership.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Shaded {
    /// No voxel.
    Nothing,
    /// Every voxel: the values are the labels.
    LabelMap,
    /// The voxels of some labels of a segmented volume.
    Labels(BTreeSet<u16>),
}

impl Shaded {
    fn of((volume, transfer): (&Volume, &TransferFunction)) -> Self {
        let labels: BTreeSet<u16> =
            transfer.labels.iter().filter(|(_, tables)| tables.membership).map(|(label, _)| *label).collect();
        match (volume.labels().is_some(), transfer.membership) {
            (true, _) if !labels.is_empty() => Self::Labels(labels),
            (_, true) => Self::LabelMap,
            _ => Self::Nothing,
        }
    }
}

/// The voxels of each channel that have such normals, if any voxel has.
pub(crate) fn shaded(volume: &Volume, transfer: &[TransferFunction]) -> Option<Vec<Shaded>> {
    let channels: Vec<Shaded> = volume.channels().zip(transfer).map(Shaded::of).collect();
    channels.iter().any(|shaded| *shaded != Shaded::Nothing).then_some(channels)
}

/// Uploads what the shaders look up.
///
/// # Errors
/// If it needs more layers than the device's textures have.
pub(crate) fn upload(
    device: &Device,
    queue: &Queue,
    volume: &Volume,
    shaded: &[Shaded],
) -> Result<VolumeTexture, RenderError> {
    let named = ("sheetsplat.membership", "the gradients of membership");
    VolumeTexture::upload_words(device, queue, named, &words(volume, shaded))
}

/// The bytes that [`upload`] will take.
///
/// # Errors
/// As for [`upload`].
pub(crate) fn estimate(limits: &Limits, volume: &Volume, shaded: &[Shaded]) -> Result<u64, RenderError> {
    let [bytes, _] = VolumeTexture::estimate(limits, words(volume, shaded).len() as u64, ValueFormat::Bits)?;
    Ok(bytes)
}

/// The header, then for each channel the place of every block's record, or 0, and these: a mask of the voxels that have gradients, and half of these gradients, in
/// membership per `unit`.
fn words(volume: &Volume, shaded: &[Shaded]) -> Vec<u32> {
    let mut words = vec![0; HEADER * shaded.len()];
    for (number, (channel, shaded)) in volume.channels().zip(shaded).enumerate() {
        if *shaded == Shaded::Nothing {
            continue;
        }
        let directory = words.len();
        words[HEADER * number] = directory as u32;
        words[HEADER * number + 1] = u32::from(*shaded != Shaded::LabelMap);
        let across = channel.dims().map(|count| count.div_ceil(SIDE));
        let blocks = Grid::new(across, DVec3::ONE);
        let records: Vec<Option<Vec<u32>>> = (0..across.element_product())
            .into_par_iter()
            .map(|number| record(channel, shaded, blocks.voxel_at(number)))
            .collect();
        words.resize(directory + records.len(), 0);
        for (block, record) in records.into_iter().enumerate() {
            if let Some(record) = record {
                words[directory + block] = words.len() as u32;
                words.extend(record);
            }
        }
    }
    words
}

/// The record of a block, given by its place among blocks, if any of its voxels has a gradient. A voxel of a label map that has none has a gradient of 0; that of
/// a label beside values has the values' gradient, so that one of 0 is there, too.
fn record(channel: &Volume, shaded: &Shaded, block: UVec3) -> Option<Vec<u32>> {
    let (of, labels) = match shaded {
        Shaded::Labels(labels) => (Members::OfLabels, Some(labels)),
        Shaded::LabelMap if channel.has_membership(SIDE * block) => (Members::OfValues, None),
        Shaded::LabelMap | Shaded::Nothing => return None,
    };
    let (grid, per_unit) = (channel.grid(), channel.grid().unit() / 2.0);
    let mut record = vec![0; MASK];
    let in_block = Grid::new(UVec3::splat(SIDE), DVec3::ONE);
    for slot in 0..in_block.dims.element_product() {
        let voxel = SIDE * block + in_block.voxel_at(slot);
        if voxel.cmpge(grid.dims).any() {
            continue;
        }
        let label = || channel.label(grid.index_of(voxel));
        if labels.is_some_and(|labels| label().is_none_or(|label| !labels.contains(&label))) {
            continue;
        }
        let gradient = channel.membership_gradient(of, voxel);
        if labels.is_some() || gradient != DVec3::ZERO {
            record[slot as usize / 32] |= 1 << (slot % 32);
            record.extend((gradient * per_unit).as_vec3().to_array().map(f32::to_bits));
        }
    }
    (record.len() > MASK).then_some(record)
}
