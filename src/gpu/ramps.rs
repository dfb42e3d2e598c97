//! A transfer function's control points, and the tables by which the stages that shade find those of a voxel.

use std::ops::{Add, Mul};

use glam::DVec4;

use crate::after::normalization::Normalization;
use crate::after::slab_integral;
use crate::lists::iso_range::{ValueSet, of_ordinal, ordinal};
use crate::settings::splatting::Splatting;
use crate::settings::transfer_function::{LabelTables, Ramp, Tables, TransferFunction};

/// The control points of the channels that share sheets (SPEC §10).
#[derive(Clone, Debug, PartialEq)]
pub struct Ramps {
    /// For every channel the main ramps, then those of labels that have their own, then the table of labels if there are any; at the end the table
    /// of channels.
    ///
    /// Ramps are the points for colour, opacity and gradient opacity in turn, each the value, then rgb or (ordinate, 0, 0), and after them the
    /// table of their integrals ([`slab_integral`]) if there is one. Tables hold numbers that are exact in `f32`. That of labels holds for
    /// every label the start of its ramps and the end of each; the last entry is the main ramps', and serves all greater labels. That of channels
    /// holds three entries for each channel:
    ///
    /// 1. the start of its main ramps, and the end of each;
    /// 2. the start of its table of labels and the number of its last entry; [`Stored::labels`], 0 without such a table; and [`Stored::colors`];
    /// 3. with integrals the values per number, the length below which moments are rounding errors
    ///    ([`FieldPlanes::min_moment`](super::layout::FieldPlanes)), and the channel's number among those of `channels` with colours of voxels' own,
    ///    from 1, or 0 without any.
    pub points: Vec<[f32; 4]>,
    /// The end of each of the first channel's main ramps.
    pub ends: [u32; 3],
    /// The start of the table of channels in `points`.
    pub channel_table: u32,
    /// The number of channels.
    pub channels: u32,
    /// The number of the first of them among all channels of the volume.
    pub first_channel: u32,
    /// The maximum number of control points in each ramp.
    lengths: [u32; 3],
    /// The maximum number of cells in a table of integrals.
    cells: u32,
    /// The most steps of a search for a cell.
    search_steps: u32,
}

/// Where labels and colours of a channel are stored among those of all channels of a volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stored {
    /// The channel's number among the segmented ones, from 1; 0 if it has no labels.
    pub labels: u32,
    /// The channel's number among those with colours of voxels' own, from 1; 0 if it has none.
    pub colors: u32,
}

impl Stored {
    /// Those of a volume of one channel, which has at most one of each.
    pub const ALONE: Self = Self { labels: 1, colors: 1 };
}

/// What integrals of ramps are made for (SPEC §9).
#[derive(Clone, Copy, Debug)]
pub struct Integration<'a> {
    /// The kernel, slabs and compositing.
    pub splatting: &'a Splatting,
    /// What the values of each channel are splatted as.
    pub numbers: &'a [Normalization],
}

impl Ramps {
    /// The ramps of a volume of one channel; a missing gradient opacity is 1 everywhere.
    pub fn new(transfer: &TransferFunction) -> Self {
        Self::of_channels(std::slice::from_ref(transfer), &[Stored::ALONE], 0, None)
    }

    /// The ramps of as many channels as are stored, given the number of the first one in the volume. With tables of
    /// the ramps' integrals for classification after splatting.
    pub fn of_channels(
        transfer: &[TransferFunction],
        stored: &[Stored],
        first_channel: u32,
        integration: Option<Integration<'_>>,
    ) -> Self {
        // A voxel that takes part in one channel may be invisible in another.
        let is_alone = stored.len() == 1;
        let only_shades = is_alone && integration.is_none();
        let matter = |tables: &LabelTables| if only_shades { tables.matter_to_shading() } else { tables.matter() };
        let (mut points, mut cells, mut search_steps) = (Vec::new(), 0, 0);
        let (mut mains, mut all, mut labelled) = (Vec::new(), Vec::new(), Vec::new());
        for (number, (transfer, stored)) in transfer.iter().zip(stored).enumerate() {
            let mut append = |points: &mut Vec<[f32; 4]>, label| {
                let tables = transfer.tables(label);
                let bounds = append(points, &tables, is_alone);
                if let Some(Integration { splatting, numbers }) = integration {
                    let table = slab_integral::table(&tables, splatting, &numbers[number]);
                    cells = cells.max(table[0][0] as u32);
                    search_steps = search_steps.max(slab_integral::search_steps(&table));
                    points.extend(table);
                }
                all.push(bounds);
                bounds
            };
            let main = append(&mut points, None);
            let own: Vec<u16> =
                (transfer.labels.iter()).filter(|(_, tables)| matter(tables)).map(|(&label, _)| label).collect();
            mains.push(main);
            let Some(&last) = own.last().filter(|_| stored.labels > 0) else {
                labelled.push([0, 0, 0, stored.colors]);
                continue;
            };
            let mut table = vec![main; usize::from(last) + 2];
            for label in own {
                table[usize::from(label)] = append(&mut points, Some(label));
            }
            labelled.push([points.len() as u32, table.len() as u32 - 1, stored.labels, stored.colors]);
            points.extend(table.into_iter().map(exact));
        }
        let channel_table = points.len() as u32;
        let mut colored = 0;
        for (number, (main, labelled)) in mains.iter().zip(labelled).enumerate() {
            points.extend([exact(*main), exact(labelled)]);
            points.push(integration.map_or([0.0; 4], |Integration { splatting, numbers }| {
                let has_colors = labelled[3] > 0;
                colored += u32::from(has_colors);
                let place = if has_colors { colored } else { 0 };
                let numbers = &numbers[number];
                [numbers.scale.recip() as f32, numbers.min_moment(splatting.radius), place as f32, 0.0]
            }));
        }
        let lengths = [0, 1, 2].map(|ramp| all.iter().map(|ends| ends[ramp + 1] - ends[ramp]).max().unwrap_or(0));
        let [_, ends @ ..] = mains[0];
        Self { points, ends, channel_table, channels: mains.len() as u32, first_channel, lengths, cells, search_steps }
    }

    /// The maximum number of control points in each ramp, over all labels and channels.
    pub fn lengths(&self) -> [u32; 3] {
        self.lengths
    }

    /// The maximum number of cells in a table of integrals, over all labels and channels; 0 without such tables.
    pub fn cells(&self) -> u32 {
        self.cells
    }

    /// The most steps of a search for the cell of a number, over all labels and channels.
    pub fn search_steps(&self) -> u32 {
        self.search_steps
    }
}

/// An entry of a table.
fn exact(numbers: [u32; 4]) -> [f32; 4] {
    numbers.map(|number| number as f32)
}

/// Appends the control points of a label's ramps. Returns their start, and the end of each. Unless the channel is alone, the opacity is 0 at values
/// with which its voxels do not take part: they may be drawn for another channel.
fn append(points: &mut Vec<[f32; 4]>, tables: &Tables, is_alone: bool) -> [u32; 4] {
    let mut bounds = [points.len() as u32; 4];
    let scalar = |(at, y): (f64, f64)| DVec4::new(at, y, 0.0, 0.0);
    let color = in_f32(tables.color).into_iter().map(|(at, rgb)| DVec4::new(at, rgb.x, rgb.y, rgb.z)).collect();
    let opacity = if is_alone { in_f32(tables.opacity) } else { in_f32(&visible_opacity(tables)) };
    let opacity = opacity.into_iter().map(scalar).collect();
    let gradient_opacity = tables.gradient_opacity.map_or(vec![(0.0, 1.0)], in_f32).into_iter().map(scalar).collect();
    let ramps: [Vec<DVec4>; 3] = [color, opacity, gradient_opacity];
    for (end, ramp) in bounds[1..].iter_mut().zip(ramps) {
        points.extend(ramp.iter().map(|point| point.as_vec4().to_array()));
        *end = points.len() as u32;
    }
    bounds
}

/// The opacity of `f32` values, 0 at those outside the iso-ranges and where nothing is visible.
fn visible_opacity(tables: &Tables) -> Ramp<f64> {
    if tables.visible && tables.iso_ranges.is_none() {
        return tables.opacity.clone();
    }
    let ends = [f32::MIN, f32::MAX].map(ordinal);
    let mut points: Vec<(f64, f64)> = Vec::new();
    for range in ValueSet::of_tables(tables).ranges() {
        let [first, last] = [range.start, range.end - 1].map(|at| at.clamp(ends[0], ends[1]));
        let inner = tables
            .opacity
            .points()
            .iter()
            .filter(|point| f64::from(of_ordinal(first)) < point.0 && point.0 < f64::from(of_ordinal(last)));
        let value = |at: u32| f64::from(of_ordinal(at));
        let seen = |at: u32| (value(at), tables.opacity.at(value(at)));
        // Between neighbouring numbers there are no values.
        points.extend((first > ends[0]).then(|| (value(first - 1), 0.0)));
        points.push(seen(first));
        points.extend(inner);
        points.push(seen(last));
        points.extend((last < ends[1]).then(|| (value(last + 1), 0.0)));
    }
    // A range of one value, and one that begins right behind another's end, give points twice.
    points.dedup_by_key(|point| point.0);
    Ramp::new(points).unwrap_or_else(|_| Ramp::through(vec![(0.0, 0.0)]))
}

/// A ramp's control points, clipped to the range of `f32`, like values.
fn in_f32<T>(ramp: &Ramp<T>) -> Vec<(f64, T)>
where
    T: Copy + Add<Output = T> + Mul<f64, Output = T>,
{
    let limit = f64::from(f32::MAX);
    let given = ramp.points();
    let cut = |at: f64| Some((at, ramp.at(at)));
    let before = cut(-limit).filter(|_| given.iter().any(|point| point.0 <= -limit));
    let after = cut(limit).filter(|_| given.iter().any(|point| point.0 >= limit));
    let between = given.iter().copied().filter(|point| point.0.abs() < limit);
    before.into_iter().chain(between).chain(after).collect()
}
