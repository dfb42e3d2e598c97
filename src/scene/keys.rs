//! The keys of `[volume]`, `[image]`, `[transfer]` and `[[channel]]`, and those outside all tables. [`settings`](crate::settings) has the others.

use glam::UVec3;

use super::{Channel, ImageSettings, TransferSettings};
use crate::appearance::{Colormap, Preset};
use crate::settings::key::Slot::{
    Background, Bytes, Colors, Dims, Label, Labels, Level, Number32, Pixels, Ranges, Series, Shares, Switch, Text,
    Vector,
};
use crate::settings::key::{Key, Keyed, choice, chosen, key};
use crate::settings::keys::{ENDIANS, LABEL_GRADIENTS};
use crate::settings::transfer_function::LabelTables;
use crate::volume::{SPACING, SampleType};

/// The keys outside all tables.
#[derive(Clone, Debug, Default)]
pub(super) struct Root {
    pub(super) preset: Option<Preset>,
}

impl Keyed for Root {
    const KEYS: &'static [Key<Self>] =
        &[key("preset", "The kind of data, by default what fits", |r| chosen(&Preset::ALL, &mut r.preset))];
}

/// `[volume]`.
#[derive(Clone, Debug, Default)]
pub(super) struct VolumeTable {
    pub(super) path: Option<String>,
    pub(super) builtin: Option<String>,
    pub(super) labels: Option<String>,
    pub(super) label_table: Option<String>,
    /// The keys that are a channel's as they stand.
    pub(super) channel: Channel,
    pub(super) dims: Option<UVec3>,
    pub(super) sample_type: Option<SampleType>,
    pub(super) big_endian: Option<bool>,
    pub(super) offset: Option<u64>,
}

impl Keyed for VolumeTable {
    const KEYS: &'static [Key<Self>] = &[
        key("path", "Relative to the scene file", |v| Text("a volume file's path", &mut v.path)),
        key("builtin", "In place of path", |v| Text("a builtin volume's name", &mut v.builtin)),
        key("spacing", "Overrides the file's, in world units", |v| Vector(SPACING, &mut v.channel.spacing)),
        key("labels", "A file with a label for every voxel", |v| Text("a label file's path", &mut v.labels)),
        #[cfg(not(target_arch = "wasm32"))]
        key("label_table", "The labels' names and colours", |v| {
            Text("a table's path, or builtin:freesurfer", &mut v.label_table)
        }),
        key("index", "The only channel that is read, counted from 0", |v| Number32(&mut v.channel.index)),
        key("time", "The time that is read, counted from 0", |v| Number32(&mut v.channel.time)),
        key("level", "The level of a store, from 0 for the finest", |v| Level(&mut v.channel.level)),
        key("series", "Which series of a DICOM folder is read", |v| Series(&mut v.channel.series)),
        key("dims", "The voxels of a file without a header", |v| Dims(&mut v.dims)),
        key("type", "The type of its samples", |v| chosen(&SampleType::NAMED, &mut v.sample_type)),
        key("endian", "The order of the bytes of a sample", |v| chosen(ENDIANS, &mut v.big_endian)),
        key("offset", "Bytes before the first sample", |v| Bytes(&mut v.offset)),
    ];
}

impl Keyed for ImageSettings {
    const KEYS: &'static [Key<Self>] = &[
        key("width", "Pixels per row", |i| Pixels(&mut i.width)),
        key("height", "Rows of pixels", |i| Pixels(&mut i.height)),
        key("background", "Red, green, blue and straight alpha", |i| Background(&mut i.background)),
    ];
}

impl Keyed for TransferSettings {
    const KEYS: &'static [Key<Self>] = &[
        key("color", "Points [value, [r, g, b]]", |t| Colors(&mut t.color)),
        key("opacity", "Points [value, opacity], per smallest voxel spacing", |t| {
            Shares("[value, opacity]", &mut t.opacity)
        }),
        key("gradient_opacity", "Points [gradient magnitude, factor of the opacity]", |t| {
            Shares("[gradient magnitude, factor]", &mut t.gradient_opacity)
        }),
        key("iso_ranges", "The values that take part, [lo, hi]", |t| Ranges(&mut t.iso_ranges)),
        key("label", "Tables of single labels", |t| Labels(&mut t.labels)),
        key("colormap", "In place of color, over the visible values", |t| chosen(&Colormap::ALL, &mut t.colormap)),
    ];
}

/// `[[transfer.label]]`.
#[derive(Clone, Debug, Default)]
pub(super) struct LabelTable {
    pub(super) label: Option<u64>,
    pub(super) tables: LabelTables,
}

impl Keyed for LabelTable {
    const KEYS: &'static [Key<Self>] = &[
        key("label", "The label's number in the file", |l| Label(&mut l.label)),
        key("visible", "Whether the label's voxels take part", |l| Switch(&mut l.tables.visible)),
        key("color", "In place of transfer.color", |l| Colors(&mut l.tables.color)),
        key("opacity", "In place of transfer.opacity", |l| Shares("[value, opacity]", &mut l.tables.opacity)),
        key("gradient_opacity", "In place of transfer.gradient_opacity", |l| {
            Shares("[gradient magnitude, factor]", &mut l.tables.gradient_opacity)
        }),
        key("gradient", "What gives normals: membership, the label's own shape, not with classification after", |l| {
            choice(LABEL_GRADIENTS, &mut l.tables.membership)
        }),
    ];
}

impl Keyed for Channel {
    const KEYS: &'static [Key<Self>] = &[
        key("name", "In legends and picks", |c| Text("a name", &mut c.name)),
        key("visible", "Whether the channel is drawn", |c| Switch(&mut c.visible)),
    ];
}
