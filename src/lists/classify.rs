//! Classification (SPEC §3): which voxels take part. Shading determines their appearance.

use std::ops::Range;

use super::brick::BrickList;
use super::iso_range::ValueSet;
use crate::parallel::prelude::*;
use crate::settings::clip::ClippedVoxels;
use crate::settings::transfer_function::TransferFunction;
use crate::volume::Volume;

/// The indices of the voxels that take part, in memory order.
pub fn classify(volume: &Volume, transfer: &[TransferFunction], clipped: &ClippedVoxels) -> Vec<u32> {
    let mut voxels = brick_list(volume, transfer, clipped).voxels();
    voxels.sort_unstable();
    voxels
}

/// The bricks of the voxels that take part.
pub fn brick_list(volume: &Volume, transfer: &[TransferFunction], clipped: &ClippedVoxels) -> BrickList {
    let taking_part = TakingPart::new(volume, transfer);
    let row_of = |y: u32, z: u32| volume.dims().x * (y + volume.dims().y * z);
    BrickList::by_rows(volume.grid(), &|y, z, flags: &mut [bool]| {
        taking_part.flag(row_of(y, z), clipped.in_row(y, z, flags.len() as u32), flags);
    })
}

/// Concatenates what `pick` selects from every row of voxels along x, given its y, its z and the index of its first voxel, in memory order.
pub fn in_rows(volume: &Volume, pick: impl Fn(u32, u32, u32) -> Vec<u32> + Sync) -> Vec<u32> {
    let dims = volume.dims();
    let row = |row: u32| pick(row % dims.y, row / dims.y, row * dims.x);
    let rows: Vec<Vec<u32>> = (0..dims.y * dims.z).into_par_iter().map(row).collect();
    rows.concat()
}

/// The channels that are drawn (SPEC §10), each with its transfer function.
pub fn channels<'a>(
    volume: &'a Volume,
    transfer: &'a [TransferFunction],
) -> impl Iterator<Item = (&'a Volume, &'a TransferFunction)> {
    volume.channels().zip(transfer)
}

/// Tells of voxels that are not clipped whether they take part: in any channel they are no holes, visible, inside an iso-range, and have an opacity above 0,
/// with their own A if they have colours of their own.
#[derive(Debug)]
pub struct TakingPart<'a> {
    channels: Vec<InChannel<'a>>,
}

/// The same of one channel.
#[derive(Debug)]
struct InChannel<'a> {
    volume: &'a Volume,
    transfer: &'a TransferFunction,
    /// The values that can take part in voxels whose labels have no tables.
    values: ValueSet,
    /// Those of labels with tables, by label.
    of_labels: Vec<(u16, ValueSet)>,
    /// Whether values decide alone.
    is_by_value: bool,
}

impl<'a> TakingPart<'a> {
    /// Prepares the decision.
    pub fn new(volume: &'a Volume, transfer: &'a [TransferFunction]) -> Self {
        Self { channels: channels(volume, transfer).map(InChannel::of).collect() }
    }

    /// Whether a voxel, given by its index, takes part.
    pub fn takes_part(&self, index: u32) -> bool {
        self.channels.iter().any(|channel| channel.takes_part(index))
    }

    /// Sets the flags of those voxels of a row that take part, given the index of its first voxel and those that are inside of all cuts.
    pub fn flag(&self, first: u32, inside: Range<u32>, flags: &mut [bool]) {
        // What is empty may lie anywhere.
        if inside.is_empty() {
            return;
        }
        let (first, flags) = (first + inside.start, &mut flags[inside.start as usize..inside.end as usize]);
        for channel in &self.channels {
            if channel.is_by_value {
                let first = first as usize;
                channel.values.flag(channel.volume.values().slice(first..first + flags.len()), flags);
            } else {
                for (flag, index) in flags.iter_mut().zip(first..) {
                    *flag |= channel.takes_part(index);
                }
            }
        }
    }
}

impl<'a> InChannel<'a> {
    fn of((volume, transfer): (&'a Volume, &'a TransferFunction)) -> Self {
        let labels = if volume.labels().is_some() { transfer.labels.keys() } else { Default::default() };
        let of_label = |&label: &u16| (label, ValueSet::of_tables(&transfer.tables(Some(label))));
        let of_labels: Vec<_> = labels.map(of_label).collect();
        let is_by_value = of_labels.is_empty() && transfer.gradient_opacity.is_none() && volume.colors().is_none();
        Self { volume, transfer, values: ValueSet::of(transfer), of_labels, is_by_value }
    }

    fn takes_part(&self, index: u32) -> bool {
        let Self { volume, transfer, .. } = self;
        let (value, label) = (volume.values().at(index as usize), volume.label(index));
        let own = label.and_then(|label| self.of_labels.binary_search_by_key(&label, |of| of.0).ok());
        let values = own.map_or(&self.values, |own| &self.of_labels[own].1);
        // Most voxels are excluded by their values: the gradient is computed only if needed.
        if !values.contains(value) {
            return false;
        }
        let tables = transfer.tables(label);
        volume.alpha_of(index) > 0.0
            && (tables.gradient_opacity.is_none()
                || tables.alpha(value.into(), tables.gradient(volume, volume.grid().voxel_at(index)).length()) > 0.0)
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use std::collections::BTreeMap;
    use std::slice::from_ref;

    use glam::{DVec3, UVec3};

    use super::*;
    use crate::settings::clip::Clip;
    use crate::settings::transfer_function::{LabelTables, Ramp};
    use crate::volume::{Labels, SampleType};

    const DIMS: UVec3 = UVec3::new(11, 6, 9);

    /// A voxel takes part if its opacity by the definition (SPEC §3) is above 0 in some channel, and it is not clipped.
    #[test]
    fn voxels_with_an_opacity_take_part() {
        let count = DIMS.element_product();
        let noise = |index: u32, seed: u32| index.wrapping_add(seed).wrapping_mul(2_654_435_761) >> 20;
        let whole = |seed| (0..count).map(|index| (noise(index, seed) % 200) as f32).collect::<Vec<_>>();
        let holed =
            (0..count).map(|index| if noise(index, 3) % 5 == 0 { f32::NAN } else { noise(index, 5) as f32 / 20.0 });
        let volume = |values: Vec<f32>| Volume::new("noise", DIMS, DVec3::new(1.0, 2.0, 0.5), values).unwrap();
        let labels = Labels {
            origin: "labels".to_owned(),
            dims: DIMS,
            spacing: None,
            values: (0..count).map(|index| (noise(index, 7) % 4) as u16).collect(),
            names: BTreeMap::new(),
        };
        let labelled = volume(whole(2)).with_labels(labels).unwrap();
        let two = volume(whole(1)).with_channels("noise", vec![volume(holed.clone().collect())]).unwrap();
        // A is 0 in a third of the voxels.
        let color = |index: u32| {
            [0, 20, 40, 60].map(|seed| noise(index, seed) as f32 % 200.0).map(|n| if n < 66.0 { 0.0 } else { n })
        };
        let colors: Vec<[f32; 4]> = (0..count).map(color).collect();
        let colored = Volume::from_colors("colors", DIMS, DVec3::ONE, (&colors, SampleType::U8)).unwrap();
        let ramp = |points: &[(f64, f64)]| Ramp::new(points.to_vec()).unwrap();
        let by_value = TransferFunction::by_value(
            Ramp::new(vec![(0.0, DVec3::ONE)]).unwrap(),
            ramp(&[(20.0, 0.0), (40.0, 0.5), (60.0, 0.0), (90.0, 0.0), (120.0, 1.0)]),
        );
        let graded = TransferFunction { gradient_opacity: Some(ramp(&[(5.0, 0.0), (60.0, 1.0)])), ..by_value.clone() };
        let in_range = TransferFunction { iso_ranges: Some(vec![[30.0, 35.0], [100.0, 130.0]]), ..by_value.clone() };
        let of_labels = TransferFunction {
            labels: BTreeMap::from([
                (1, LabelTables { visible: false, ..LabelTables::default() }),
                (2, LabelTables { opacity: Some(ramp(&[(0.0, 0.0), (1.0, 1.0)])), ..LabelTables::default() }),
                (
                    3,
                    LabelTables { gradient_opacity: Some(ramp(&[(30.0, 1.0), (31.0, 0.0)])), ..LabelTables::default() },
                ),
            ]),
            ..by_value.clone()
        };
        let of_two = [by_value.clone(), graded.clone()];
        let cut = Clip { planes: vec![[0.5, -0.3, 0.4, 0.2]], ..Clip::default() };
        for (name, volume, transfer) in [
            ("values", &volume(whole(0)), from_ref(&by_value)),
            ("holes", &volume(holed.collect()), from_ref(&by_value)),
            ("gradients", &volume(whole(4)), from_ref(&graded)),
            ("iso-ranges", &volume(whole(6)), from_ref(&in_range)),
            ("labels", &labelled, from_ref(&of_labels)),
            ("unused labels", &labelled, from_ref(&by_value)),
            ("channels", &two, &of_two[..]),
            ("colours", &colored, from_ref(&by_value)),
        ] {
            for clip in [&Clip::default(), &cut] {
                let clipped = clip.voxels(volume.grid(), 2.0);
                let has_opacity = |index: u32| {
                    channels(volume, transfer).any(|(volume, transfer)| {
                        let gradient = volume.gradient(volume.grid().voxel_at(index)).length();
                        let value = f64::from(volume.values().at(index as usize));
                        let is_shown = transfer.tables(volume.label(index)).alpha(value, gradient) > 0.0;
                        !value.is_nan() && is_shown && volume.color(index).is_none_or(|color| color.w > 0.0)
                    })
                };
                let expected: Vec<u32> = (0..count)
                    .filter(|&index| clipped.contain(volume.grid().voxel_at(index)) && has_opacity(index))
                    .collect();
                assert!(expected.len() > 20 && expected.len() + 20 < count as usize, "{name}: {}", expected.len());
                assert_eq!(classify(volume, transfer, &clipped), expected, "{name}");
                assert_eq!(brick_list(volume, transfer, &clipped), BrickList::new(volume.grid(), &expected), "{name}");
                let of = TakingPart::new(volume, transfer);
                let alone = |&index: &u32| clipped.contain(volume.grid().voxel_at(index)) && of.takes_part(index);
                assert_eq!((0..count).filter(alone).collect::<Vec<_>>(), expected, "{name}");
            }
        }
    }
}
