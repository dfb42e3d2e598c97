//! Volumes.

use std::path::PathBuf;
use std::sync::Arc;

use numpy::{PyArray1, PyArray3, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use sheetsplat::appearance::{Preset, quantiles};
use sheetsplat::glam::{DMat3, DVec3, UVec3};
use sheetsplat::scene::{OpenVolume, VolumeSource};
use sheetsplat::volume::{Channels, Inputs, Labels, Orientation, ReadOptions, ValueSlice, Values};

use crate::array;
use crate::error::{self, Raised, setting};
use crate::image;
use crate::process::{detached, prepare_numpy};
use crate::scene::Scene;
use crate::warnings;

/// The name of volumes from arrays in errors.
pub(crate) const ORIGIN: &str = "array";

/// What the names of builtin volumes begin with, where paths are allowed too.
const BUILTIN: &str = "builtin:";

/// The fractions of `info`'s percentiles, and their names.
const PERCENTILES: [(f64, &str); 9] = [
    (0.001, "0.1"),
    (0.01, "1"),
    (0.05, "5"),
    (0.25, "25"),
    (0.5, "50"),
    (0.75, "75"),
    (0.95, "95"),
    (0.99, "99"),
    (0.999, "99.9"),
];

/// A volume, shared by every view of it: in memory, or read while it is drawn.
#[pyclass(frozen, module = "sheetsplat._native")]
pub(crate) struct Volume(pub(crate) OpenVolume, pub(crate) Inputs);

impl Volume {
    /// The bytes that each value of the channels takes.
    fn value_bytes(&self) -> Vec<usize> {
        let channels = self.0.sample().channels();
        channels.map(|channel| channel.values().bytes() / channel.values().len()).collect()
    }

    /// The volume, which must be in memory for something.
    pub(crate) fn whole(&self, field: &str) -> Result<&Arc<sheetsplat::Volume>, Raised> {
        match &self.0 {
            OpenVolume::Whole(volume) => Ok(volume),
            OpenVolume::Streamed(_) => Err(streamed(field)),
        }
    }
}

/// The error for a volume that must be in memory for something.
fn streamed(field: &str) -> Raised {
    error::volume(field, "a volume that is streamed", "one in memory: a coarser level, or more memory")
}

/// The number of bytes that have been read, which another thread may ask for meanwhile.
#[pyclass(frozen, module = "sheetsplat._native")]
#[derive(Default)]
pub(crate) struct BytesRead(sheetsplat::volume::BytesRead);

#[pymethods]
impl BytesRead {
    #[new]
    fn new() -> Self {
        Self::default()
    }

    #[getter]
    fn count(&self) -> u64 {
        self.0.count()
    }
}

/// The options for reading with a memory limit, such as `2GiB`, with an index of a store's chunks, and with something that counts the bytes.
pub(crate) fn reading(
    memory: Option<&str>,
    index: Option<PathBuf>,
    bytes_read: Option<&BytesRead>,
) -> Result<ReadOptions, Raised> {
    let mut options = ReadOptions::default();
    options.index = index;
    options.bytes_read = bytes_read.map(|read| read.0.clone());
    let parse = |text: &str| {
        let parsed = ReadOptions::parse_memory(text);
        parsed.map_err(|allowed| setting("memory", &format!("{text:?}"), allowed.trim_start_matches("allowed: ")))
    };
    options.memory = memory.map(parse).transpose()?;
    Ok(options)
}

/// Checks the sizes of an array `[z, y, x]`, with some channels, of which each value takes some bytes, and maybe labels, before it is made.
#[pyfunction]
pub(crate) fn check_sizes(shape: Vec<usize>, channels: Vec<usize>, labels: bool, memory: Option<&str>) -> PyResult<()> {
    let limit = reading(memory, None, None)?.memory_limit();
    Ok(array::Sizes::of(&shape)?.check(&channels, labels, limit)?)
}

#[pymethods]
impl Volume {
    /// A volume of arrays `[z, y, x]`, one for each channel. `axes` are the directions of x, y and z in the patient (RAS), and `masked` is the number of
    /// samples that are holes on purpose.
    #[staticmethod]
    #[pyo3(signature = (channels, spacing, labels=None, axes=None, origin=[0.0; 3], memory=None, unit=None, masked=0))]
    #[expect(clippy::too_many_arguments, reason = "the package's Python part passes its own")]
    fn from_arrays(
        py: Python<'_>,
        channels: Vec<Bound<'_, PyAny>>,
        spacing: [f64; 3],
        labels: Option<&Bound<'_, PyAny>>,
        axes: Option<[[f64; 3]; 3]>,
        origin: [f64; 3],
        memory: Option<&str>,
        unit: Option<String>,
        masked: u64,
    ) -> PyResult<Self> {
        prepare_numpy(py)?;
        check_spacing(spacing)?;
        let limit = reading(memory, None, None)?.memory_limit();
        let bytes = channels.iter().map(array::value_bytes).collect::<PyResult<Vec<_>>>()?;
        for channel in &channels {
            array::sizes(channel)?.check(&bytes, labels.is_some(), limit)?;
        }
        let channels = channels.iter().map(array::values).collect::<Result<Vec<_>, _>>()?;
        let labels = labels.map(|labels| read_labels(labels, &bytes, limit)).transpose()?;
        if let (Some((of_labels, ..)), Some((sizes, _))) = (&labels, channels.first()) {
            check_labels(*of_labels, *sizes)?;
        }
        let orientation =
            axes.map(|axes| Orientation { axes: DMat3::from_cols_array_2d(&axes), origin: origin.into() });
        let volume = detached(py, move || {
            let channel = |(dims, values): ([u32; 3], Values)| {
                sheetsplat::Volume::from_values(ORIGIN, dims.into(), zyx(spacing), values)
            };
            let channels = Channels::of(channels).ok_or_else(|| error::volume("channels", "none", "at least one"))?;
            let volume = sheetsplat::Volume::of_channels(ORIGIN, channels.try_map(channel)?)?;
            let volume = volume.with_orientation(ORIGIN, orientation)?;
            let volume = unit.iter().fold(volume, |volume, unit| volume.with_unit(unit));
            let volume = changed(volume, None, labels)?.into();
            warn_of_holes(&volume, masked);
            Ok(volume)
        })?;
        Ok(Self(volume, Inputs::default()))
    }

    /// A volume file, a folder of slices, or `builtin:NAME`: the channel, the time and the level that `selection` states. The scene in which it will be shown
    /// chooses a level that is left open, or the finest is taken. The spacing, in the order z, y, x, and the labels of an array go before the file's.
    /// `content` is the file itself, of which `path` is then only the name.
    #[staticmethod]
    #[pyo3(signature = (path, memory, selection, scene, bytes_read, changes=None, index=None, series=None, content=None))]
    #[expect(clippy::too_many_arguments, reason = "the package's Python part passes its own")]
    fn open(
        py: Python<'_>,
        path: PathBuf,
        memory: Option<&str>,
        selection: [Option<u32>; 3],
        scene: Option<&Scene>,
        bytes_read: Option<&BytesRead>,
        changes: Option<Changes<'_>>,
        index: Option<PathBuf>,
        series: Option<String>,
        content: Option<Vec<u8>>,
    ) -> PyResult<Self> {
        let inputs = Inputs::default();
        let mut options = reading(memory, index, bytes_read)?.noted_in(&inputs);
        options.files = content.map(|content| [(path.clone(), content)].into_iter().collect());
        let (spacing, labels) = changes.unwrap_or_default();
        let labels = labels.map(|labels| read_labels(&labels, &[], options.memory_limit())).transpose()?;
        if let Some((_, labels, _)) = &labels {
            options.memory = Some(options.memory_limit().saturating_sub(size_of_val(&**labels) as u64));
        }
        let builtin = path.to_str().and_then(|path| path.strip_prefix(BUILTIN)).map(str::to_owned);
        let source = builtin.clone().map_or(VolumeSource::File(path), VolumeSource::Builtin);
        let mut shown = match scene {
            Some(scene) => scene.scene.clone().with_volume(source),
            None => sheetsplat::Scene::from_volume(source, &[]).map_err(Raised::from)?,
        };
        for channel in &mut shown.channels[1..] {
            (channel.volume, channel.spacing, channel.labels) = (VolumeSource::Memory, None, None);
        }
        let first = shown.channels.first_mut();
        [first.index, first.time, first.level] = selection;
        first.series = series;
        (first.spacing, first.labels) = (None, None);
        if scene.is_none() && builtin.is_none() {
            first.level = first.level.or(Some(0));
        }
        let volume = detached(py, move || {
            let volume = replaced(shown.open_volume_with(&options)?, spacing, labels)?;
            warn_of_holes(&volume, 0);
            Ok(volume)
        })?;
        Ok(Self(volume, inputs))
    }

    /// The same values with another spacing, in the order z, y, x, or with labels of an array. The values are copied, because views may share these.
    #[pyo3(signature = (spacing=None, labels=None, memory=None))]
    fn replaced(
        &self,
        py: Python<'_>,
        spacing: Option<[f64; 3]>,
        labels: Option<&Bound<'_, PyAny>>,
        memory: Option<&str>,
    ) -> PyResult<Self> {
        let limit = reading(memory, None, None)?.memory_limit();
        let labels = labels.map(|labels| read_labels(labels, &self.value_bytes(), limit)).transpose()?;
        let volume = self.0.clone();
        Ok(Self(detached(py, move || replaced(volume, spacing, labels))?, self.1.clone()))
    }

    /// The files that were read for it.
    #[getter]
    fn inputs(&self) -> image::Inputs {
        image::Inputs(self.1.clone())
    }

    /// The number of voxels along z, y and x.
    #[getter]
    fn shape(&self) -> [u32; 3] {
        let UVec3 { x, y, z } = self.0.grid().dims;
        [z, y, x]
    }

    /// World units between voxels along z, y and x.
    #[getter]
    fn spacing(&self) -> [f64; 3] {
        let DVec3 { x, y, z } = self.0.grid().spacing;
        [z, y, x]
    }

    /// The bytes of memory that the values of all channels take; of a volume that is streamed, those of the sample.
    #[getter]
    fn nbytes(&self) -> usize {
        self.0.sample().channels().map(|channel| channel.values().bytes()).sum()
    }

    /// The number of channels.
    #[getter]
    fn channels(&self) -> usize {
        self.0.sample().channel_count()
    }

    /// Whether each voxel has a label beside its value.
    #[getter]
    fn labelled(&self) -> bool {
        self.0.sample().labels().is_some()
    }

    #[getter]
    fn unit(&self) -> Option<&str> {
        self.0.sample().unit()
    }

    /// Of a volume that is streamed, in the sample.
    #[getter]
    fn holes(&self) -> u64 {
        self.0.sample().holes()
    }

    /// Whether the volume is read while it is drawn.
    #[getter]
    fn streamed(&self) -> bool {
        matches!(self.0, OpenVolume::Streamed(_))
    }

    /// The number of the level that is drawn.
    #[getter]
    fn level(&self) -> u32 {
        self.0.level()
    }

    /// A copy of a channel's values, `[z, y, x]`, in the order of the file or the array.
    fn values<'py>(&self, py: Python<'py>, channel: usize) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let count = self.channels();
        let allowed = || error::volume("channel", &channel.to_string(), &format!("0 to {}", count - 1));
        let channel = self.whole("values")?.channels().nth(channel).ok_or_else(allowed)?;
        prepare_numpy(py)?;
        let mut values = channel.values().to_vec();
        channel.grid().reorder(&mut values);
        PyArray1::from_vec(py, values).reshape(self.shape().map(|size| size as usize))
    }

    /// Facts about the volume, by the names of `sheetsplat info --json`; sizes and spacings are in the order z, y, x. Of one that is streamed, the values are those
    /// of the sample.
    fn info<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (volume, measured) = (self.0.sample(), Arc::clone(self.0.sample()));
        let ([min, max, mean], percentiles, suggested) = detached(py, move || {
            let (values, shares) = (measured.values(), PERCENTILES.map(|(share, _)| share));
            Ok((extent_and_mean(values), quantiles(values, |_| true, shares), Preset::suggested(&measured)))
        })?;
        let info = PyDict::new(py);
        info.set_item("shape", self.shape())?;
        info.set_item("spacing", self.spacing())?;
        info.set_item("level", self.level())?;
        info.set_item("streamed", self.streamed())?;
        info.set_item("unit", volume.unit())?;
        info.set_item("format", volume.encoding().map(|encoding| encoding.format))?;
        info.set_item("type", volume.encoding().map(|encoding| encoding.sample_type.to_string()))?;
        info.set_item("times", volume.encoding().map_or(1, |encoding| encoding.times))?;
        info.set_item("time_names", volume.time_names().to_vec())?;
        info.set_item("series", volume.series_names().to_vec())?;
        info.set_item("holes", volume.holes())?;
        info.set_item("min", min)?;
        info.set_item("max", max)?;
        info.set_item("mean", mean)?;
        let named = PyDict::new(py);
        for ((_, name), value) in PERCENTILES.iter().zip(percentiles.unwrap_or_default()) {
            named.set_item(name, value)?;
        }
        info.set_item("percentiles", named)?;
        let axes = volume.file_orientation().map(|orientation| orientation.axes.to_cols_array_2d());
        info.set_item("axes", axes)?;
        info.set_item("labels", volume.labels().is_some())?;
        info.set_item(
            "preset",
            Preset::ALL.iter().find(|(_, preset)| suggested == Some(*preset)).map(|(name, _)| *name),
        )?;
        Ok(info)
    }
}

/// A vector from numbers in the order z, y, x.
pub(crate) fn zyx([z, y, x]: [f64; 3]) -> DVec3 {
    DVec3::new(x, y, z)
}

/// The sizes along x, y and z, the labels of an array, and the numbers that they stand for if these are others.
type LabelArray = ([u32; 3], Arc<[u16]>, Option<Arc<[u64]>>);

/// A spacing in the order z, y, x, and an array of labels, which go before a file's.
type Changes<'py> = (Option<[f64; 3]>, Option<Bound<'py, PyAny>>);

/// Checks a spacing in the order z, y, x, which errors keep.
pub(crate) fn check_spacing(spacing: [f64; 3]) -> Result<(), Raised> {
    let checked = sheetsplat::internals::check_spacing("spacing", spacing.into());
    checked.map_err(|wrong| error::volume(&wrong.key, &wrong.found.to_string(), &wrong.allowed.to_string()))
}

/// Checks that labels have the sizes of values. Errors have them in the order z, y, x.
fn check_labels(labels: [u32; 3], values: [u32; 3]) -> Result<(), Raised> {
    if labels == values {
        return Ok(());
    }
    let shown = |[x, y, z]: [u32; 3]| format!("{z}×{y}×{x}");
    let found = format!("labels of {} voxels", shown(labels));
    Err(error::volume("sizes", &found, &format!("{}, as the values along z, y and x", shown(values))))
}

/// Warns of holes, but for the samples that are masked.
pub(crate) fn warn_of_holes(volume: &OpenVolume, masked: u64) {
    let OpenVolume::Whole(volume) = volume else { return };
    let (holes, samples) = (volume.channels().map(sheetsplat::Volume::holes).sum::<u64>(), volume.values().len());
    if holes > masked {
        let count = holes - masked;
        warnings::warn(format!("{count} of {samples} samples are NaN or infinite: these holes are not drawn"));
    }
}

/// The symbol of a unit of length, such as `µm` for `micron`, or else the name itself; `None` if the name says that there is no unit.
#[pyfunction]
pub(crate) fn symbol(name: &str) -> Option<String> {
    sheetsplat::internals::unit(name)
}

/// The labels of an array, which may take a number of bytes together with the values of some channels, of which each value takes some bytes.
/// Labels with numbers of their own are a pair of the array and these numbers, ascending from that of label 0, which is 0.
fn read_labels(labels: &Bound<'_, PyAny>, channels: &[usize], limit: u64) -> Result<LabelArray, Raised> {
    let (array, ids) = match labels.extract::<(Bound<'_, PyAny>, Vec<u64>)>() {
        Ok((array, ids)) => (array, Some(ids.into())),
        Err(_) => (labels.clone(), None),
    };
    array::sizes(&array)?.check(channels, true, limit)?;
    let (dims, labels) = array::labels(&array)?;
    Ok((dims, labels, ids))
}

/// An open volume with another spacing, in the order z, y, x, or other labels.
fn replaced(volume: OpenVolume, spacing: Option<[f64; 3]>, labels: Option<LabelArray>) -> Result<OpenVolume, Raised> {
    if spacing.is_none() && labels.is_none() {
        return Ok(volume);
    }
    match volume {
        // Without a copy if nobody shares it.
        OpenVolume::Whole(volume) => Ok(changed(Arc::unwrap_or_clone(volume), spacing, labels)?.into()),
        OpenVolume::Streamed(_) => Err(streamed("spacing or labels")),
    }
}

fn changed(
    mut volume: sheetsplat::Volume,
    spacing: Option<[f64; 3]>,
    labels: Option<LabelArray>,
) -> Result<sheetsplat::Volume, Raised> {
    if let Some(spacing) = spacing {
        check_spacing(spacing)?;
        volume = volume.with_spacing(ORIGIN, zyx(spacing))?;
    }
    if let Some((dims, values, ids)) = labels {
        check_labels(dims, volume.dims().to_array())?;
        let names = volume.label_names().clone();
        let labels = Labels { origin: "labels".to_owned(), dims: dims.into(), spacing: None, values, names };
        volume = volume.with_labels(labels)?;
        if let Some(ids) = ids {
            volume = volume.with_label_ids(ids);
        }
    }
    Ok(volume)
}

/// The minimum, maximum and mean of the values that are not NaN.
pub(crate) fn extent_and_mean(values: ValueSlice<'_>) -> [f64; 3] {
    let start = [f64::INFINITY, f64::NEG_INFINITY, 0.0, 0.0];
    let finite = values.iter().filter(|value| !value.is_nan()).map(f64::from);
    let [min, max, sum, count] =
        finite.fold(start, |[min, max, sum, count], value| [min.min(value), max.max(value), sum + value, count + 1.0]);
    [min, max, sum / count]
}
