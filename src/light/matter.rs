//! The matter that keeps light off (SPEC §14): the amounts of voxels, summed over channels, brick by brick. It depends on neither camera nor light.

use glam::UVec3;

use crate::lists::brick::{self, Brick, BrickList};
use crate::lists::classify::{brick_list, channels};
use crate::parallel::prelude::*;
use crate::settings::clip::Clip;
use crate::settings::transfer_function::TransferFunction;
use crate::volume::{Grid, Volume};

/// The opacity beyond which amounts no longer grow (SPEC §5).
const MAX_ALPHA: f64 = 0.9999;

/// The values whose amounts a thread remembers.
const KNOWN: usize = 1 << 9;

/// The slots of a brick.
pub(super) const SLOTS: usize = brick::BRICK_VOXELS as usize;

/// The bricks that a thread looks at at a time.
const BRICKS: usize = 1024;

/// The voxels that take part and whose centres no cut leaves out, with their amounts per `unit`.
#[derive(Clone, Debug)]
pub struct LightMatter {
    pub(super) grid: Grid,
    pub(super) bricks: Vec<Brick>,
    /// By brick and slot; 0 where no voxel takes part.
    amounts: Vec<[f32; SLOTS]>,
}

impl LightMatter {
    /// The matter of a volume under a transfer function and cuts.
    pub fn new(volume: &Volume, transfer: &[TransferFunction], clip: &Clip) -> Self {
        let bricks = lit_bricks(volume, transfer, clip).bricks().to_vec();
        let is_by_value = volume.channel_count() == 1
            && volume.labels().is_none()
            && volume.colors().is_none()
            && transfer.iter().all(|transfer| transfer.gradient_opacity.is_none());
        let of_bricks = |bricks: &[Brick], amounts: &mut [[f32; SLOTS]]| {
            // Most volumes have few values.
            let mut known = [(f32::NAN, 0.0); KNOWN];
            let mut of_voxel = |voxel: UVec3| {
                let value = volume.value(voxel);
                let bits = value.to_bits();
                let (of, known) = &mut known[(bits ^ bits >> 16) as usize % KNOWN];
                if !is_by_value || *of != value {
                    (*of, *known) = (value, amount(volume, transfer, voxel) as f32);
                }
                *known
            };
            for (brick, amounts) in bricks.iter().zip(amounts) {
                brick::voxels(brick).for_each(|(slot, voxel)| amounts[slot as usize] = of_voxel(voxel));
            }
        };
        let mut amounts = vec![[0.0; SLOTS]; bricks.len()];
        let chunks = bricks.par_chunks(BRICKS).zip(amounts.par_chunks_mut(BRICKS));
        chunks.for_each(|(bricks, amounts)| of_bricks(bricks, amounts));
        Self { grid: *volume.grid(), bricks, amounts }
    }

    /// The amounts of a brick's voxels, by slot.
    #[inline(always)]
    pub(super) fn amounts(&self, number: usize) -> &[f32; SLOTS] {
        &self.amounts[number]
    }
}

/// The bricks of the voxels that take part and whose centres no cut leaves out.
pub(super) fn lit_bricks(volume: &Volume, transfer: &[TransferFunction], clip: &Clip) -> BrickList {
    // Kernels without extent: their centres decide.
    brick_list(volume, transfer, &clip.voxels(volume.grid(), 0.0))
}

/// `-ln(1 - min(α, 0.9999))` of a voxel, summed over all channels.
fn amount(volume: &Volume, transfer: &[TransferFunction], voxel: UVec3) -> f64 {
    let index = volume.grid().index_of(voxel);
    let of_channel = |(volume, transfer): (&Volume, &TransferFunction)| {
        let value = f64::from(volume.values().at(index as usize));
        if value.is_nan() {
            return 0.0;
        }
        let tables = transfer.tables(volume.label(index));
        let gradient = tables.gradient_opacity.map_or(0.0, |_| tables.gradient(volume, voxel).length());
        let own = volume.color(index).map_or(1.0, |color| color.w);
        -libm::log1p(-(tables.alpha(value, gradient) * own).min(MAX_ALPHA))
    };
    channels(volume, transfer).map(of_channel).sum()
}
