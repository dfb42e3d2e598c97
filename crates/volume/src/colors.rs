//! Volumes of colours (SPEC §10): one channel, whose voxels have colours of their own and are classified by their luminance.

use std::sync::Arc;

use glam::{DVec3, DVec4, UVec3};

use super::error::volume::VolumeError;
use super::sample_type::SampleType;
use super::texel::{Texel, luminance, shares, texel};
use super::value_slice::ValueSlice;
use super::volume::Volume;
use crate::parallel::prelude::*;

impl Volume {
    /// A volume of colours: red, green, blue and A of every voxel, x fastest, as numbers of a type: integers over that type's maximum are shares of
    /// 1, and floats are shares themselves, clamped to [0, 1]. The volume's values are the luminances of these numbers. A voxel with a number that
    /// is NaN or infinite is a hole. `origin` names the volume in errors.
    ///
    /// # Errors
    /// As for [`Self::new`].
    pub fn from_colors(
        origin: &str,
        dims: UVec3,
        spacing: DVec3,
        (colors, kind): (&[[f32; 4]], SampleType),
    ) -> Result<Self, VolumeError> {
        let values = colors.par_iter().map(|color| luminance(*color)).numbers();
        let texels: Arc<[Texel]> = colors.par_iter().map(|color| texel(*color, kind)).numbers().into();
        Ok(Self { colors: Some(texels), ..Self::new(origin, dims, spacing, values)? })
    }

    /// The same from the numbers as files are read: all red ones, all green ones, all blue ones, and all A if there are as many left.
    pub(super) fn from_components(
        origin: &str,
        dims: UVec3,
        spacing: DVec3,
        (numbers, kind): (ValueSlice<'_>, SampleType),
    ) -> Result<Self, VolumeError> {
        let count = dims.element_product() as usize;
        let full = kind.full() as f32;
        let color = |at| {
            [0, 1, 2, 3].map(|component| {
                let index = component * count + at;
                if index < numbers.len() { numbers.at(index) } else { full }
            })
        };
        let colors: Vec<[f32; 4]> = (0..count).into_par_iter().map(color).numbers();
        Self::from_colors(origin, dims, spacing, (&colors, kind))
    }

    /// The volume of the luminances that its values are, with the colours, one for each voxel.
    #[doc(hidden)]
    pub fn with_texels(self, colors: Vec<Texel>) -> Self {
        Self { colors: Some(colors.into()), ..self }
    }

    /// The colours of all voxels, if this is a volume of colours.
    pub fn colors(&self) -> Option<&[Texel]> {
        self.colors.as_deref()
    }

    /// The colour of a voxel and its A in [0, 1], given by its index in memory, if this is a volume of colours.
    ///
    /// # Panics
    /// If it is one and the voxel lies outside it.
    pub fn color(&self, index: u32) -> Option<DVec4> {
        self.colors.as_ref().map(|colors| shares(colors[index as usize]))
    }

    /// A of a voxel: 1 where the volume has no colours of its own.
    #[doc(hidden)]
    pub fn alpha_of(&self, index: u32) -> f64 {
        self.color(index).map_or(1.0, |color| color.w)
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;

    #[test]
    fn numbers_become_shares_of_their_types_maximum() {
        let of = |kind, numbers: [f32; 4]| {
            let volume = Volume::from_colors("test", UVec3::ONE, DVec3::ONE, (&[numbers], kind)).unwrap();
            (volume.color(0).unwrap().to_array(), volume.values().at(0))
        };
        let (color, value) = of(SampleType::U8, [255.0, 51.0, 0.0, 102.0]);
        assert_eq!(color, [1.0, 0.2, 0.0, 0.4]);
        assert!((f64::from(value) - (0.2126 * 255.0 + 0.7152 * 51.0)).abs() < 1e-5);
        assert_eq!(of(SampleType::U16, [65535.0, 13107.0, 0.0, 65535.0]).0, [1.0, 0.2, 0.0, 1.0]);
        let (color, value) = of(SampleType::F32, [1.5, 0.2, -1.0, 1.0]);
        assert_eq!(color, [1.0, 0.2, 0.0, 1.0]);
        // The luminance is that of the stored numbers.
        assert!((f64::from(value) - (0.2126 * 1.5 + 0.7152 * 0.2 - 0.0722)).abs() < 1e-6);
        assert_eq!(of(SampleType::I16, [32767.0, -5.0, 0.0, 0.0]).0, [1.0, 0.0, 0.0, 0.0]);
        // The largest 32-bit integer is no f32.
        assert_eq!(of(SampleType::U32, [u32::MAX as f32, 0.0, 0.0, 0.0]).0[0], 1.0);
    }

    #[test]
    fn a_number_that_is_not_finite_makes_a_hole() {
        let colors = [[0.5, 0.5, 0.5, 1.0], [f32::NAN, 0.5, 0.5, 1.0], [0.5, 0.5, 0.5, f32::INFINITY]];
        let volume = Volume::from_colors("test", UVec3::new(3, 1, 1), DVec3::ONE, (&colors, SampleType::F32)).unwrap();
        assert_eq!(volume.holes(), 2);
    }
}
