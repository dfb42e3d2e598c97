//! Volumes by themselves: readers of files, stores that are read by boxes, series, and procedural volumes. No renderer, no GPU.
//!
//! [`Volume::open`] reads a whole file, [`open_store`] reads boxes of one. Every reader is bounded: a damaged or hostile file gives a [`VolumeError`] that names
//! the file, the field, what was found and what is allowed, and never takes more memory than [`ReadOptions::memory`].
//!
//! ```
//! use sheetsplat_volume::{Volume, glam::{DVec3, UVec3}};
//!
//! let volume = Volume::from_values("ramp", UVec3::new(4, 1, 1), DVec3::ONE, vec![0_u8, 1, 2, 3])?;
//! assert_eq!(volume.value(UVec3::new(2, 0, 0)), 2.0);
//! # Ok::<(), sheetsplat_volume::VolumeError>(())
//! ```

mod access;
mod adapted;
mod address;
pub mod builtin;
mod channels;
mod coefficients;
mod colors;
mod counts;
mod data_files;
#[cfg(feature = "dicom")]
mod dicom;
mod display;
mod error;
mod fields;
mod file;
mod folder;
mod format;
mod grid;
mod index;
mod labels;
mod loaded;
mod memory;
#[cfg(feature = "metaimage")]
mod metaimage;
#[cfg(feature = "mgh")]
mod mgh;
#[cfg(feature = "nifti")]
mod nifti;
#[cfg(feature = "npy")]
pub mod npy;
#[cfg(feature = "npy")]
pub mod npz;
mod nrrd;
mod numbers;
mod orientation;
pub mod parallel;
pub mod range;
mod raw;
mod resample;
mod sample;
mod samples;
mod seek;
mod series;
mod shear;
mod source;
mod store;
mod streamed;
mod text;
#[cfg(feature = "tiff")]
mod tiff;
mod unit;
mod value_slice;
mod values;
mod voxel;
#[cfg(feature = "vtk")]
mod vtk;
#[cfg(any(feature = "tiff", feature = "vtk"))]
mod xml;
#[cfg(feature = "zarr")]
mod zarr;
#[cfg(any(feature = "npy", feature = "zarr"))]
mod zip;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use glam::{DVec3, UVec3};

use access::Access;
pub use access::ReadOptions;
pub use adapted::ChunkProgress;
use coefficients::KeptCoefficients;
use colors::COLOR_BYTES;
pub use colors::Texel;
pub use counts::StoreCounts;
pub use display::ChannelDisplay;
pub use error::setting::{Allowed, Found, Interval, SettingError};
pub use error::volume::VolumeError;
use error::volume::refused;
pub use file::{BytesRead, Files};
pub use grid::Grid;
use grid::check_spacing;
pub use index::{IndexedStore, StoreIndex};
pub use labels::Labels;
use labels::labels_of;
use loaded::{Levels, Loaded};
pub use orientation::{Orientation, PatientSide};
pub use raw::RawLayout;
pub use sample::sample;
use samples::Sample;
pub use samples::SampleType;
use store::facts_of_channel;
pub use store::{Store, StoreFacts, StoreLevel, open_raw_store, open_store};
pub use streamed::{StreamedChannel, StreamedLevel, StreamedVolume};
pub use value_slice::{ValueIter, ValueSlice};
pub use values::Values;

pub use glam;

/// What the renderer uses besides. Nothing here is part of the public interface; it changes without notice.
#[doc(hidden)]
pub mod internals {
    pub use crate::HollowChannel;
    pub use crate::access::Access;
    pub use crate::adapted::AdaptedStore;
    pub use crate::address::{is_address, written_in};
    pub use crate::colors::COLOR_BYTES;
    pub use crate::error::setting;
    pub use crate::format::levels;
    pub use crate::grid::{SPACING, check_spacing};
    pub use crate::labels::labels_of;
    #[cfg(feature = "npy")]
    pub use crate::npy;
    #[cfg(feature = "npy")]
    pub use crate::npz;
    pub use crate::parallel;
    pub use crate::range;
    pub use crate::resample::Resampling;
    pub use crate::samples::{SIZES, Sample, dims_of};
    pub use crate::series::Selection;
    pub use crate::store::{raw_store, store, stores};
    pub use crate::streamed::{check_grids, sample_of_channels};
}

/// How a file stores a volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Encoding {
    /// The format's name: `NRRD`, `NIfTI`, `raw`.
    pub format: &'static str,
    /// The type of its samples, before slope and intercept are applied.
    pub sample_type: SampleType,
    /// The number of channels in the file, of which the volume may be one.
    pub channels: u32,
    /// The number of times in the file, of which the volume is one.
    pub times: u32,
}

/// A scalar volume on a rectilinear grid (SPEC §2): `dims` voxels, x fastest in memory, `spacing` world units apart.
///
/// World axes are the volume's axes and the origin is the volume's centre. Values are finite `f32`, except in holes (SPEC §3), where
/// they are NaN. They are kept in the fewest bits that hold every one of them ([`Values`]). A segmented volume also has a label per voxel, and a volume of colours a colour ([`Self::from_colors`]). A volume may have further
/// channels on the same grid ([`Self::further`]).
#[derive(Clone, Debug)]
pub struct Volume {
    grid: Grid,
    values: Values,
    /// The number of NaN values.
    holes: u64,
    colors: Option<Arc<[Texel]>>,
    labels: Option<Arc<[u16]>>,
    label_names: BTreeMap<u16, String>,
    /// Whether the values are known to be labels.
    is_label_map: bool,
    orientation: Option<Orientation>,
    unit: Option<String>,
    encoding: Option<Encoding>,
    palette: Option<Vec<(f64, DVec3)>>,
    channel_name: Option<String>,
    display: Option<ChannelDisplay>,
    further: Vec<Arc<Volume>>,
    levels: Vec<UVec3>,
    level: u32,
    /// What was read of a store; not part of the volume itself.
    reads: Option<StoreCounts>,
    /// The grid of the voxels that the values are a sample of, if they are one.
    sampled: Option<Grid>,
    /// Not part of the volume itself; clones share them, since their values are the same.
    coefficients: KeptCoefficients,
}

impl PartialEq for Volume {
    /// Two holes compare as equal.
    fn eq(&self, other: &Self) -> bool {
        let Self { grid, values, holes, labels, label_names, orientation, unit, encoding, palette, .. } = other;
        let Self { colors, channel_name, display, further, levels, level, .. } = other;
        let facts = (grid, holes, labels, label_names, orientation, unit, encoding, palette);
        let channels = (colors, channel_name, display, further, levels, level);
        let Self { grid, holes, labels, label_names, orientation, unit, encoding, palette, .. } = self;
        facts == (grid, holes, labels, label_names, orientation, unit, encoding, palette)
            && channels == (&self.colors, &self.channel_name, &self.display, &self.further, &self.levels, &self.level)
            && self.values().iter().zip(values.as_slice()).all(|(a, b)| a == b || a.is_nan() && b.is_nan())
    }
}

/// What a channel of a volume without values has ([`Volume::hollow`]).
#[derive(Clone, Copy, Debug)]
pub struct HollowChannel {
    /// Whether it has labels.
    pub labels: bool,
    /// Whether it has colours.
    pub colors: bool,
    /// Whether it has holes.
    pub holes: bool,
}

impl Volume {
    /// Makes a volume from its values, x fastest. A NaN or infinite value is a hole (SPEC §3). `origin` names the volume in errors. Of values that have 8
    /// or 16 bits, [`Self::from_values`] makes one without a copy.
    ///
    /// # Errors
    /// If a dimension is 0, there are more than `u32::MAX` voxels, the number of values differs from the product of the dimensions, a
    /// spacing is not within [1e-100, 1e100] or is more than 10⁴ times another, or no value is finite.
    pub fn new(origin: &str, dims: UVec3, spacing: DVec3, values: Vec<f32>) -> Result<Self, VolumeError> {
        Self::from_values(origin, dims, spacing, values)
    }

    /// Like [`Self::new`], of values of any type in which volumes keep theirs, such as a `Vec<u8>` or a `Vec<i16>`. They are taken as they are, or narrowed
    /// if fewer bits hold them.
    ///
    /// ```
    /// use sheetsplat_volume::Volume;
    /// use sheetsplat_volume::glam::{DVec3, UVec3};
    ///
    /// let volume = Volume::from_values("ramp", UVec3::new(4, 1, 1), DVec3::ONE, vec![0_u16, 1, 2, 1000])?;
    /// assert_eq!(volume.values(), [0.0, 1.0, 2.0, 1000.0]);
    /// assert_eq!(volume.values().bytes(), 8);
    /// # Ok::<(), sheetsplat_volume::VolumeError>(())
    /// ```
    ///
    /// # Errors
    /// As for [`Self::new`].
    pub fn from_values(
        origin: &str,
        dims: UVec3,
        spacing: DVec3,
        values: impl Into<Values>,
    ) -> Result<Self, VolumeError> {
        let values: Values = values.into();
        let invalid = |field: &str, found: String, allowed: &str| VolumeError::invalid(origin, field, found, allowed);
        let grid = Grid::new(dims, spacing);
        grid.check().map_err(|error| refused(origin, error))?;
        let count = dims.element_product();
        let found = values.as_slice().len();
        if found != count as usize {
            return Err(invalid("data", format!("{found} values"), &format!("{count} values")));
        }
        let volume = Self::punched(grid, values.narrowed());
        if volume.holes == u64::from(count) {
            return Err(invalid("data", "only NaN or infinite samples".to_owned(), "at least one finite sample"));
        }
        Ok(volume)
    }

    /// A volume with holes where samples are NaN or infinite, which may be all.
    #[doc(hidden)]
    pub fn punched(grid: Grid, values: impl Into<Values>) -> Self {
        let mut values = values.into();
        let holes = values.punch_holes();
        Self { holes, ..Self::piece(grid, values) }
    }

    /// A piece of a volume, with values that are finite or NaN already. They are kept as they are, and its holes are not counted.
    #[doc(hidden)]
    pub fn piece(grid: Grid, values: impl Into<Values>) -> Self {
        Self {
            grid,
            values: values.into(),
            holes: 0,
            colors: None,
            labels: None,
            label_names: BTreeMap::new(),
            is_label_map: false,
            orientation: None,
            unit: None,
            encoding: None,
            palette: None,
            channel_name: None,
            display: None,
            further: Vec::new(),
            levels: Vec::new(),
            level: 0,
            reads: None,
            sampled: None,
            coefficients: KeptCoefficients::default(),
        }
    }

    /// A volume without values: its grid, and what `like` tells of its channels, whether they have labels, colours, and holes. Nothing that reads values may
    /// be asked of it.
    #[doc(hidden)]
    pub fn hollow(grid: Grid, like: &[HollowChannel]) -> Self {
        let channel = |&HollowChannel { labels, colors, holes }: &HollowChannel| Self {
            labels: labels.then(|| Arc::from([])),
            colors: colors.then(|| Arc::from([])),
            holes: holes.into(),
            ..Self::piece(grid, Values::default())
        };
        let mut channels = like.iter().map(channel);
        let first = channels.next().unwrap_or_else(|| Self::piece(grid, Values::default()));
        Self { further: channels.map(Arc::new).collect(), ..first }
    }

    /// The same values with another spacing (world units between neighbouring voxels; of a coarser level, those of the finest).
    ///
    /// # Errors
    /// If a spacing is not within [1e-100, 1e100] or is more than 10⁴ times another.
    pub fn with_spacing(mut self, origin: &str, spacing: DVec3) -> Result<Self, VolumeError> {
        check_spacing("spacing", spacing).map_err(|error| refused(origin, error))?;
        self.grid = self.grid.with_finest_spacing(spacing);
        self.grid.check().map_err(|error| refused(origin, error))?;
        for channel in &mut self.further {
            Arc::make_mut(channel).grid = self.grid;
        }
        Ok(self)
    }

    /// Reads a volume file. Its first bytes determine the format, or else its extension: NRRD (`.nrrd`, `.nhdr`), and, each with the
    /// feature of its name, NIfTI (`.nii`, `.hdr`, `.img`, also with `.gz`), MGH (`.mgh`, `.mgz`), MetaImage (`.mha`, `.mhd`), NPY
    /// (`.npy`) and its archives (`.npz`: their only array, or the one named as in `file.npz:name`), TIFF (`.tif`, `.tiff`), DICOM
    /// (`.dcm`), VTK (`.vti`, `.vtk`) and Zarr (folders, and archives `.zip` and `.ozx`). The path may also be a folder of slices: TIFF files of one page,
    /// or the DICOM files of one series.
    ///
    /// # Errors
    /// If the file cannot be read, is of no format that is compiled in, does not hold what its header promises, or needs more memory
    /// than [`ReadOptions::memory`] allows by default.
    pub fn open(path: &Path) -> Result<Self, VolumeError> {
        Self::open_with(path, &ReadOptions::default())
    }

    /// Like [`Self::open`], with a folder that files must lie in and a memory limit.
    ///
    /// # Errors
    /// As for [`Self::open`], and if the file, or one that its header names, lies outside the folder.
    pub fn open_with(path: &Path, options: &ReadOptions) -> Result<Self, VolumeError> {
        Self::read(path, &Access::new(options)?)
    }

    #[doc(hidden)]
    pub fn read(path: &Path, access: &Access) -> Result<Self, VolumeError> {
        let (format, loaded) = format::read::<f32>(path, access)?;
        let first_channel = access.selection().channel.unwrap_or(0) as usize;
        let channels = first_channel..(loaded.series.channels as usize).max(first_channel + 1);
        let facts: Vec<StoreFacts> =
            channels.enumerate().map(|(at, channel)| facts_of_channel(loaded.facts(format, channel), at)).collect();
        let mut facts = facts.into_iter();
        let Loaded { dims, kind: sample_type, spacing, series, levels, mut values, .. } = loaded;
        let origin = path.display().to_string();
        let spacing = spacing.unwrap_or(DVec3::ONE);
        if series.is_color {
            let bytes = COLOR_BYTES * u64::from(dims.element_product());
            access.reserve(path, "data", format!("{dims} voxels with colours"), bytes)?;
            let volume = Self::from_components(&origin, dims, spacing, (values.as_slice(), sample_type))?;
            let facts = facts.next().unwrap_or_default();
            return volume.stating(&origin, StoreFacts { palette: None, channel_name: None, display: None, ..facts });
        }
        // All channels' values, one after the other.
        let voxels = dims.element_product() as usize;
        let mut further = Vec::new();
        while values.as_slice().len() > voxels {
            further.push(values.split_off(values.as_slice().len() - voxels));
        }
        values.shrink_to_fit();
        let mut channel = |values: Values| {
            Self::from_values(&origin, dims, spacing, values)?.stating(&origin, facts.next().unwrap_or_default())
        };
        let mut first = channel(values)?;
        let further = further.into_iter().rev().map(channel).collect::<Result<_, VolumeError>>()?;
        if let Some(Levels { dims, level, grid, reads }) = levels {
            grid.check().map_err(|error| refused(&origin, error))?;
            (first.grid, first.levels, first.level, first.reads) = (grid, dims, level, Some(reads));
        }
        first.with_channels(&origin, further)
    }

    /// The same volume with what its file states beside its grid and values.
    fn stating(self, origin: &str, facts: StoreFacts) -> Result<Self, VolumeError> {
        let StoreFacts { encoding, spacing: _, unit, orientation, palette, label_names, channel_name, display } = facts;
        Self { encoding, unit, palette, label_names, channel_name, display, ..self }
            .with_orientation(origin, orientation)
    }

    /// The number of voxels along x, y and z of each level that the volume's store holds, from the finest; empty if it comes from no such store.
    pub fn levels(&self) -> &[UVec3] {
        &self.levels
    }

    /// The number of the level that this volume is, from 0 for the finest.
    pub fn level(&self) -> u32 {
        self.level
    }

    /// What was read of a store for this volume, with all channels; `None` if it comes from no store.
    pub fn reads(&self) -> Option<StoreCounts> {
        self.reads
    }

    /// The grid of the voxels.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// The grid of the voxels that are drawn: the volume's own, or that which it is a sample of.
    #[doc(hidden)]
    pub fn drawn_grid(&self) -> &Grid {
        self.sampled.as_ref().unwrap_or(&self.grid)
    }

    /// The number of voxels along x, y and z.
    pub fn dims(&self) -> UVec3 {
        self.grid.dims
    }

    /// The distance between neighbouring voxels along x, y and z, in world units.
    pub fn spacing(&self) -> DVec3 {
        self.grid.spacing
    }

    /// The name of the world unit, if the file states it: `mm`, `µm`, or whatever else it states.
    pub fn unit(&self) -> Option<&str> {
        self.unit.as_deref()
    }

    /// How the file stored the values; `None` if they come from no file.
    pub fn encoding(&self) -> Option<Encoding> {
        self.encoding
    }

    /// The coefficients that interpolate the values with a kernel of a radius and falloff, computed at the first request and kept for further
    /// ones with the same kernel.
    #[doc(hidden)]
    pub fn coefficients<E>(
        &self,
        kernel: (f64, f64),
        compute: impl FnOnce() -> Result<Arc<[f32]>, E>,
    ) -> Result<Arc<[f32]>, E> {
        self.coefficients.get_or_compute(kernel, compute)
    }

    /// The colours (red, green and blue in [0, 1]) that the file assigns to values, in ascending order; `None` without a palette.
    pub fn palette(&self) -> Option<&[(f64, DVec3)]> {
        self.palette.as_deref()
    }

    /// All values, x fastest, then y, then z. Holes are NaN.
    pub fn values(&self) -> ValueSlice<'_> {
        self.values.as_slice()
    }

    /// The number of holes: voxels whose samples are NaN or infinite. They appear in no image and no statistics.
    pub fn holes(&self) -> u64 {
        self.holes
    }

    /// The value of one voxel; NaN in a hole.
    ///
    /// # Panics
    /// If the voxel lies outside the volume.
    pub fn value(&self, voxel: UVec3) -> f32 {
        let dims = self.dims();
        assert!(voxel.cmplt(dims).all(), "voxel {voxel} outside {dims}");
        self.values().at((voxel.x + dims.x * (voxel.y + dims.y * voxel.z)) as usize)
    }

    /// The gradient in value per world unit, estimated in the unwarped space (§4.2) by central differences: one-sided at the border and
    /// beside a hole, 0 along an axis without a neighbour on either side, and 0 in a hole.
    pub fn gradient(&self, voxel: UVec3) -> DVec3 {
        for_type!(ValueSlice, self.values(), values => self.gradient_of(values, voxel))
    }

    fn gradient_of<T: Sample>(&self, values: &[T], voxel: UVec3) -> DVec3 {
        let value = |index: usize| values[index].to_f32();
        let Grid { dims, spacing, .. } = self.grid;
        let strides = [1, dims.x as usize, dims.x as usize * dims.y as usize];
        let at: usize = (0..3).map(|axis| voxel[axis] as usize * strides[axis]).sum();
        if value(at).is_nan() {
            return DVec3::ZERO;
        }
        let difference = |axis: usize| {
            let stride = strides[axis];
            let has_before = voxel[axis] > 0 && !value(at - stride).is_nan();
            let has_after = voxel[axis] + 1 < dims[axis] && !value(at + stride).is_nan();
            let steps = u8::from(has_before) + u8::from(has_after);
            if steps == 0 {
                return 0.0;
            }
            let low = value(if has_before { at - stride } else { at });
            let high = value(if has_after { at + stride } else { at });
            (f64::from(high) - f64::from(low)) / (f64::from(steps) * spacing[axis])
        };
        DVec3::new(difference(0), difference(1), difference(2))
    }
}
