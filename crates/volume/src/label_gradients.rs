//! The gradients of the membership of a volume's labels (SPEC §15).

use glam::{DVec3, UVec3};

use super::Volume;
use super::membership::{Block, Members};
use super::sample_type::Sample;
use super::value_slice::ValueSlice;
use crate::for_type;

impl Volume {
    /// The gradient of the membership of a voxel's label (SPEC §15) per world unit: smoothed over the 4 voxels on every side, 0 where all these have one
    /// label, and in a hole. A volume that is not segmented has no gradients [`Members::OfLabels`].
    ///
    /// # Panics
    /// If the voxel lies outside the volume.
    pub fn membership_gradient(&self, of: Members, voxel: UVec3) -> DVec3 {
        let (dims, spacing) = (self.dims(), self.spacing());
        assert!(voxel.cmplt(dims).all(), "voxel {voxel} outside {dims}");
        let gradient = self.membership_block(of, voxel).map_or([0.0; 3], |block| block.at(voxel));
        DVec3::from(gradient.map(f64::from)) / spacing
    }

    /// Whether any value in the block of 8×8×8 voxels that holds a voxel has a gradient of membership.
    #[doc(hidden)]
    pub fn has_membership(&self, voxel: UVec3) -> bool {
        self.membership_block(Members::OfValues, voxel).is_some()
    }

    fn membership_block(&self, of: Members, voxel: UVec3) -> Option<&Block> {
        let (grid, values, kept) = (self.grid(), self.values(), &self.membership[of as usize]);
        match of {
            Members::OfValues => {
                for_type!(ValueSlice, values, values => kept.block(grid, voxel, |index| values[index].to_f32()))
            }
            Members::OfLabels => {
                let (labels, has_holes) = (self.labels()?, self.holes() > 0);
                kept.block(grid, voxel, |index| match has_holes && values.at(index).is_nan() {
                    true => f32::NAN,
                    false => labels[index].into(),
                })
            }
        }
    }
}
