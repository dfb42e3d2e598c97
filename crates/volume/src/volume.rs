//! A volume in memory: its grid, values, and what its file states.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{DMat3, DVec3, UVec3};

use super::coefficients::KeptCoefficients;
use super::counts::StoreCounts;
use super::display::ChannelDisplay;
use super::encoding::Encoding;
use super::error::volume::{VolumeError, refused};
use super::grid::{Grid, check_spacing};
use super::label_facts::LabelFacts;
use super::membership::KeptMembership;
use super::orientation::{MAX_COSINE, Orientation};
use super::sample_type::Sample;
use super::store::StoreFacts;
use super::texel::Texel;
use super::unit;
use super::value_slice::ValueSlice;
use super::values::Values;
use crate::for_type;

/// A scalar volume on a rectilinear grid (SPEC §2): `dims` voxels, x fastest in memory, `spacing` world units apart.
///
/// World axes are the volume's axes and the origin is the volume's centre. World axes are right-handed: the first axis of a file whose axes are left-handed is
/// turned ([`Grid::is_turned`]). Values are finite `f32`, except in holes (SPEC §3), where
/// they are NaN. They are kept in the fewest bits that hold every one of them ([`Values`]). A segmented volume also has a label per voxel, and a volume of colours a colour ([`Self::from_colors`]). A volume may have several
/// channels on one grid ([`Self::channels`]); this one is then the first.
#[derive(Clone, Debug)]
pub struct Volume {
    pub(super) grid: Grid,
    pub(super) values: Values,
    /// The number of NaN values.
    pub(super) holes: u64,
    pub(super) colors: Option<Arc<[Texel]>>,
    pub(super) labels: Option<Arc<[u16]>>,
    pub(super) label_names: BTreeMap<u16, String>,
    /// The colours of a segmented volume's labels, where its file states them.
    pub(super) label_colors: Vec<(f64, DVec3)>,
    /// The file's numbers of labels, which are the values or those of a segmented volume; `None` if they are the labels themselves.
    pub(super) label_ids: Option<Arc<[u64]>>,
    /// Whether the values are known to be labels.
    pub(super) is_label_map: bool,
    /// The order of axes that was assumed, and whether the spacing was, because the file states none.
    pub(super) assumed_axes: Option<&'static str>,
    pub(super) is_spacing_assumed: bool,
    pub(super) orientation: Option<Orientation>,
    pub(super) unit: Option<String>,
    pub(super) value_unit: Option<String>,
    pub(super) encoding: Option<Encoding>,
    pub(super) palette: Option<Vec<(f64, DVec3)>>,
    pub(super) channel_name: Option<String>,
    pub(super) display: Option<ChannelDisplay>,
    pub(super) time_names: Vec<String>,
    pub(super) series_names: Vec<String>,
    /// The channels after this one, none of which has others.
    pub(super) others: Vec<Arc<Volume>>,
    pub(super) levels: Vec<UVec3>,
    pub(super) level: u32,
    /// How much of a store was read; not part of the volume itself.
    pub(super) reads: Option<StoreCounts>,
    /// The grid of the voxels that the values are a sample of, if they are one.
    pub(super) sampled: Option<Grid>,
    /// Not part of the volume itself; clones share them, since their values are the same.
    pub(super) coefficients: KeptCoefficients,
    pub(super) label_facts: LabelFacts,
    /// The gradients of membership of its values and of its labels, shared as the coefficients are.
    pub(super) membership: [KeptMembership; 2],
}

impl PartialEq for Volume {
    /// Two holes compare as equal.
    fn eq(&self, other: &Self) -> bool {
        let Self { grid, values, holes, labels, label_names, orientation, unit, encoding, palette, .. } = other;
        let Self { colors, channel_name, value_unit, display, others, levels, level, .. } = other;
        let facts = (grid, holes, labels, label_names, orientation, unit, encoding, palette);
        let of_labels = (&other.label_ids, &other.label_colors);
        let channels = (colors, channel_name, value_unit, display, others, levels, level);
        let Self { grid, holes, labels, label_names, orientation, unit, encoding, palette, .. } = self;
        let own = (
            &self.colors,
            &self.channel_name,
            &self.value_unit,
            &self.display,
            &self.others,
            &self.levels,
            &self.level,
        );
        facts == (grid, holes, labels, label_names, orientation, unit, encoding, palette)
            && channels == own
            && of_labels == (&self.label_ids, &self.label_colors)
            && self.values().iter().zip(values.as_slice()).all(|(a, b)| a == b || a.is_nan() && b.is_nan())
    }
}

/// The arrays of a channel whose volume has no values ([`Volume::hollow`]).
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
            label_colors: Vec::new(),
            label_ids: None,
            is_label_map: false,
            assumed_axes: None,
            is_spacing_assumed: false,
            orientation: None,
            unit: None,
            value_unit: None,
            encoding: None,
            palette: None,
            channel_name: None,
            display: None,
            time_names: Vec::new(),
            series_names: Vec::new(),
            others: Vec::new(),
            levels: Vec::new(),
            level: 0,
            reads: None,
            sampled: None,
            coefficients: KeptCoefficients::default(),
            label_facts: LabelFacts::default(),
            membership: Default::default(),
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
        Self { others: channels.map(Arc::new).collect(), ..first }
    }

    /// The same values with another spacing (world units between neighbouring voxels; of a coarser level, those of the finest).
    ///
    /// # Errors
    /// If a spacing is not within [1e-100, 1e100] or is more than 10⁴ times another.
    pub fn with_spacing(mut self, origin: &str, spacing: DVec3) -> Result<Self, VolumeError> {
        check_spacing("spacing", spacing).map_err(|error| refused(origin, error))?;
        self.grid = self.grid.with_finest_spacing(spacing);
        self.is_spacing_assumed = false;
        self.grid.check().map_err(|error| refused(origin, error))?;
        for channel in &mut self.others {
            Arc::make_mut(channel).grid = self.grid;
        }
        Ok(self)
    }

    /// The same volume with what its file states beside its grid and values.
    pub(super) fn stating(self, origin: &str, facts: StoreFacts) -> Result<Self, VolumeError> {
        let StoreFacts { encoding, spacing, unit, value_unit, orientation, palette, .. } = facts;
        let StoreFacts { label_names, are_labels, assumed_axes, .. } = facts;
        let StoreFacts { channel_name, display, time_names, series_names, .. } = facts;
        let volume = Self { encoding, unit, value_unit, palette, label_names, channel_name, display, ..self };
        let volume = Self { is_label_map: are_labels, assumed_axes, is_spacing_assumed: spacing.is_none(), ..volume };
        Self { time_names, series_names, ..volume }.oriented(origin, orientation)
    }

    /// The marks that tell the times of the volume's file apart, from the first on, where they are more than their numbers.
    pub fn time_names(&self) -> &[String] {
        &self.time_names
    }

    /// The series among which the volume's was chosen, in the order of their numbers from 0; empty if there is only one.
    pub fn series_names(&self) -> &[String] {
        &self.series_names
    }

    /// The number of voxels along x, y and z of each level that the volume's store holds, from the finest; empty if it comes from no such store.
    pub fn levels(&self) -> &[UVec3] {
        &self.levels
    }

    /// The number of the level that this volume is, from 0 for the finest.
    pub fn level(&self) -> u32 {
        self.level
    }

    /// How much of a store was read for this volume, with all channels; `None` if it comes from no store.
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

    /// The same volume with another world unit, by its name or symbol: `micron` and `um` both become `µm`. `none` and `pixel` mean no unit.
    pub fn with_unit(self, name: &str) -> Self {
        Self { unit: unit::unit(name), ..self }
    }

    /// The unit of the values, if the file states it: `HU`, or whatever else it states.
    pub fn value_unit(&self) -> Option<&str> {
        self.value_unit.as_deref()
    }

    /// The same volume with another unit of its values.
    pub fn with_value_unit(self, unit: Option<String>) -> Self {
        Self { value_unit: unit, ..self }
    }

    /// How the volume lies in a patient, if known. The axes are right-handed: those of a file whose axes are not ([`Self::file_orientation`]) with the first
    /// one turned.
    pub fn orientation(&self) -> Option<&Orientation> {
        self.orientation.as_ref()
    }

    /// The same volume with another orientation of its file's or array's own axes, or with an unknown one. If they are left-handed, the first axis is turned.
    /// `origin` names the volume in errors.
    ///
    /// # Errors
    /// If the axes are not orthogonal unit vectors (to 1 in 10⁴), or a number is not finite.
    pub fn with_orientation(self, origin: &str, orientation: Option<Orientation>) -> Result<Self, VolumeError> {
        Ok(self.with_turned(false).oriented(origin, orientation)?.right_handed(false))
    }

    /// The same volume with another orientation of its axes.
    fn oriented(mut self, origin: &str, orientation: Option<Orientation>) -> Result<Self, VolumeError> {
        if let Some(Orientation { axes, origin: first }) = orientation {
            let excess = (axes.transpose() * axes - DMat3::IDENTITY).to_cols_array();
            if !(first.is_finite() && excess.iter().all(|excess| excess.abs() <= 2.0 * MAX_COSINE)) {
                let allowed = "finite orthogonal unit vectors and a finite origin".to_owned();
                return Err(VolumeError::invalid(
                    origin,
                    "orientation",
                    format!("{:?}, {first:?}", axes.to_cols_array_2d()),
                    allowed,
                ));
            }
        }
        self.orientation = orientation;
        Ok(self)
    }

    /// How the file says that the channel is shown; `None` if it says nothing.
    pub fn display(&self) -> Option<&ChannelDisplay> {
        self.display.as_ref()
    }

    /// The same volume with another way to show its first channel.
    pub fn with_display(mut self, display: Option<ChannelDisplay>) -> Self {
        self.display = display;
        self
    }

    /// How the file stored the values; `None` if they come from no file.
    pub fn encoding(&self) -> Option<Encoding> {
        self.encoding
    }

    /// The coefficients that interpolate the values with a kernel of a radius and falloff, computed at the first request and kept for later
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

    /// All values, x fastest, then y, then z; where the file's axes are left-handed, x is turned ([`Grid::file_voxel`]). Holes are NaN.
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
