//! The part of shading that depends on neither view nor light: every voxel's colour, opacity and normal (SPEC §3). A brick keeps those of its voxels
//! from the first frame that shows it.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicIsize, Ordering};

use glam::{DVec3, DVec4, UVec3};

use super::count::bits;
use crate::lists::brick;
use crate::lists::brick::{BRICK_VOXELS, Brick};
use crate::settings::shading::MIN_GRADIENT;
use crate::settings::transfer_function::TransferFunction;
use crate::volume::{Members, Volume};

/// The maximum number of bricks of one channel whose materials are kept, 2 KiB for each. Those of other bricks are computed again in every tile in which a voxel is
/// visible.
const MOST_KEPT: isize = 1 << 15;

/// A voxel's material.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Material {
    pub(super) color: [f32; 3],
    /// α, the opacity per unit length.
    pub(super) alpha: f32,
    /// The normal, a unit vector; 0 if the gradient is too short to have a direction.
    pub(super) normal: [f32; 3],
}

/// The materials of a brick: those of all channels (SPEC §10) for each slot.
pub(super) type BrickMaterials = Box<[Material]>;

/// The materials of all bricks that any view has shown.
#[derive(Debug)]
pub(super) struct Materials {
    channels: usize,
    bricks: Vec<OnceLock<BrickMaterials>>,
    /// The number of other bricks that may be kept.
    room: AtomicIsize,
}

impl Materials {
    /// The materials of a number of bricks, none of which has been seen yet, in a number of channels.
    pub(super) fn new(bricks: usize, channels: usize) -> Self {
        let room = AtomicIsize::new(MOST_KEPT / channels as isize);
        Self { channels, bricks: (0..bricks).map(|_| OnceLock::new()).collect(), room }
    }

    /// A voxel's materials in all channels, given by its slot.
    #[inline(always)]
    pub(super) fn of_slot<'a>(&self, brick: &'a BrickMaterials, slot: u32) -> &'a [Material] {
        &brick[slot as usize * self.channels..][..self.channels]
    }

    /// Reads the materials of a brick that will be drawn, if they are known: what is read counts for nothing, but is in the cache when the sheets of the brick's
    /// voxels come.
    pub(super) fn read_ahead(&self, number: u32, brick: &Brick) {
        if let Some(materials) = self.bricks[number as usize].get() {
            let read = |slot: u32| materials[slot as usize * self.channels].alpha.to_bits();
            std::hint::black_box(bits(brick::present(brick)).fold(0, |all, slot| all | read(slot)));
        }
    }

    /// The materials of a brick, given by its number; `None` if they are not kept.
    pub(super) fn of_brick(
        &self,
        number: u32,
        channels: &[(&Volume, &TransferFunction)],
        brick: &Brick,
    ) -> Option<&BrickMaterials> {
        let kept = &self.bricks[number as usize];
        // Two threads that meet the same brick reserve room twice, so that less is kept, never more.
        if kept.get().is_none() && self.room.fetch_sub(1, Ordering::Relaxed) <= 0 {
            self.room.fetch_add(1, Ordering::Relaxed);
            return None;
        }
        Some(kept.get_or_init(|| {
            let mut materials = vec![Material::default(); BRICK_VOXELS as usize * self.channels];
            for (slot, voxel) in brick::voxels(brick) {
                let of_voxel = &mut materials[slot as usize * self.channels..];
                for (material, (volume, transfer)) in of_voxel.iter_mut().zip(channels) {
                    *material = Material::of(volume, transfer, voxel);
                }
            }
            materials.into()
        }))
    }
}

/// A copy has no materials yet.
impl Clone for Materials {
    fn clone(&self) -> Self {
        Self::new(self.bricks.len(), self.channels)
    }
}

impl Material {
    /// The material of a voxel in a channel. A hole has no opacity.
    pub(super) fn of(volume: &Volume, transfer: &TransferFunction, voxel: UVec3) -> Self {
        let index = volume.grid().index_of(voxel);
        let value = f64::from(volume.values().at(index as usize));
        let tables = transfer.tables(volume.label(index));
        let gradient = tables.gradient(volume, voxel);
        let magnitude = gradient.length();
        let own = volume.color(index);
        let color = own.map_or_else(|| tables.color.at(value), DVec4::truncate);
        let opacity = own.map_or(1.0, |color| color.w);
        let of_label = tables.members.filter(|&of| of == Members::OfLabels);
        let facing = of_label.map_or(gradient, |of| volume.membership_gradient(of, voxel));
        let length = facing.length();
        let normal = if length < MIN_GRADIENT { DVec3::ZERO } else { facing / -length };
        Self {
            color: color.as_vec3().to_array(),
            alpha: if value.is_nan() { 0.0 } else { (tables.alpha(value, magnitude) * opacity) as f32 },
            normal: normal.as_vec3().to_array(),
        }
    }
}
