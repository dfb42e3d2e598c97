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

/// The points of opacities by gradients, for errors.
const BY_GRADIENT: &str = "[gradient magnitude, factor]";

/// The keys outside all tables.
#[derive(Clone, Debug, Default)]
pub(super) struct Root {
    pub(super) preset: Option<Preset>,
}

impl Keyed for Root {
    const KEYS: &'static [Key<Self>] = &[key!(preset, chosen(&Preset::ALL), "The kind of data, by default what fits")];
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
        key!(path, Text("a volume file's path"), "The volume's file, relative to the scene file"),
        key!(builtin, Text("a builtin volume's name"), "A builtin volume, in place of path"),
        key!("spacing", channel.spacing, Vector(SPACING), "The distances of voxels, in place of the file's"),
        key!(labels, Text("a label file's path"), "A file with a label for every voxel"),
        #[cfg(not(target_arch = "wasm32"))]
        key!(label_table, Text("a table's path, or builtin:freesurfer"), "A table of the labels' names and colours"),
        key!("index", channel.index, Number32, "The only channel that is read, counted from 0"),
        key!("time", channel.time, Number32, "The time that is read, counted from 0"),
        key!("level", channel.level, Level, "The level of a store, from 0 for the finest"),
        key!("series", channel.series, Series, "The series of a DICOM folder, by number or identity"),
        key!(dims, Dims, "Voxels along x, y and z of a file without a header"),
        key!("type", sample_type, chosen(&SampleType::NAMED), "The type of samples without a header"),
        key!("endian", big_endian, chosen(ENDIANS), "The order of the bytes of samples without a header"),
        key!(offset, Bytes, "Bytes before the first sample without a header"),
    ];
}

impl Keyed for ImageSettings {
    const KEYS: &'static [Key<Self>] = &[
        key!(width, Pixels, "Pixels per row"),
        key!(height, Pixels, "Rows of pixels"),
        key!(background, Background, "Red, green, blue and straight alpha"),
    ];
}

impl Keyed for TransferSettings {
    const KEYS: &'static [Key<Self>] = &[
        key!(color, Colors, "Points [value, [r, g, b]]"),
        key!(opacity, Shares("[value, opacity]"), "Points [value, opacity], per smallest voxel spacing"),
        key!(gradient_opacity, Shares(BY_GRADIENT), "Points [gradient magnitude, factor of the opacity]"),
        key!(iso_ranges, Ranges, "The values that take part, [lo, hi]"),
        key!("label", labels, Labels, "Tables of single labels"),
        key!(colormap, chosen(&Colormap::ALL), "In place of color, over the visible values"),
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
        key!(label, Label, "The label's number in the file"),
        key!("visible", tables.visible, Switch, "Whether the label's voxels take part"),
        key!("color", tables.color, Colors, "In place of transfer.color"),
        key!("opacity", tables.opacity, Shares("[value, opacity]"), "In place of transfer.opacity"),
        key!("gradient_opacity", tables.gradient_opacity, Shares(BY_GRADIENT), "In place of transfer.gradient_opacity"),
        key!("gradient", tables.membership, choice(LABEL_GRADIENTS), "Membership: normals of the label's own shape"),
    ];
}

impl Keyed for Channel {
    const KEYS: &'static [Key<Self>] = &[
        key!(name, Text("a name"), "The name in legends and picks"),
        key!(visible, Switch, "Whether the channel is drawn"),
    ];
}
