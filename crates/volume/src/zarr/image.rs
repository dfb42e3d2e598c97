//! An image of a Zarr store: an OME-Zarr image or label image, or a plain array.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DMat3, DVec3};
use serde_json::Value;

use super::super::VolumeError;
use super::super::access::Access;
use super::super::address::archive_and_inner;
use super::super::display::ChannelDisplay;
use super::super::error::volume::{invalid, refused};
use super::super::grid::{Grid, check_spacing};
use super::super::loaded::{ASSUMED_AXES, Legend, Loaded};
use super::super::orientation::Orientation;
use super::super::series::{MAX_CHANNELS, Series};
use super::super::voxels::Voxels;
use super::array::ZarrArray;
use super::axes::Axis;
use super::display;
use super::json::{self, Json};
use super::keys::Keys;
use super::multiscale::Multiscale;

/// The maximum number of levels; each halves the sizes.
const MAX_LEVELS: usize = 32;

/// Scales that are smaller by less than this fraction count as equal.
const ROUNDING: f64 = 1e-6;

/// An image with its levels.
#[derive(Debug)]
pub(super) struct Image {
    pub(super) keys: Arc<Keys>,
    /// From the finest, at least one.
    pub(super) levels: Vec<Level>,
    pub(super) unit: Option<String>,
    /// The directions of x, y and z in the patient (RAS).
    orientation: Option<DMat3>,
    pub(super) series: Series,
    pub(super) channel_names: Vec<String>,
    pub(super) displays: Vec<ChannelDisplay>,
    pub(super) legend: Legend,
    /// Whether it is an array without a scale.
    is_plain: bool,
    /// The metadata of the image and its levels.
    pub(super) metadata: Vec<Value>,
}

/// An image at one resolution.
#[derive(Debug)]
pub(super) struct Level {
    pub(super) array: ZarrArray,
    pub(super) grid: Grid,
    /// The place of the first voxel's centre.
    first: DVec3,
}

/// A group or an array: the file with its attributes, and what that holds.
struct Node {
    file: PathBuf,
    value: Value,
}

impl Node {
    /// The node at a path of a store; `None` if the store has no node there.
    fn read(keys: &Keys, path: &str) -> Result<Option<Self>, VolumeError> {
        let at = |file: &str| if path.is_empty() { file.to_owned() } else { format!("{path}/{file}") };
        for name in ["zarr.json", ".zattrs"] {
            if let Some(bytes) = keys.metadata(&at(name))? {
                let file = keys.file(&at(name));
                return Ok(Some(Self { value: json::parse(&file, &bytes)?, file }));
            }
        }
        let has_array = keys.bytes(&at(".zarray"))?.is_some();
        let is_node = has_array || keys.bytes(&at(".zgroup"))?.is_some();
        Ok(is_node.then(|| Self { file: keys.file(&at(".zattrs")), value: Value::Null }))
    }

    /// What concerns OME-Zarr: a key of its own since version 0.5.
    fn ome(&self) -> Json<'_> {
        let all = Json::new(&self.file, &self.value);
        let attributes = if self.file.ends_with("zarr.json") { all.get("attributes") } else { all };
        let ome = attributes.get("ome");
        if ome.is_some() { ome } else { attributes }
    }
}

impl Image {
    /// Opens the image of a folder or of an archive, as in `file.ozx` and `file.ozx:labels/cells`.
    pub(super) fn open(path: &Path, access: &Access) -> Result<Self, VolumeError> {
        let (store, inner) = archive_and_inner(path);
        let keys = if access.is_address(path)? {
            Keys::of_address(path, access)?
        } else if access.is_folder(store)? {
            access.check_folder(store)?;
            Keys::of_folder(path, access)
        } else {
            Keys::of_archive(store, inner.unwrap_or_default(), access)?
        };
        let keys = Arc::new(keys);
        let Some(root) = Node::read(&keys, "")? else {
            let allowed = "a Zarr store: zarr.json, .zgroup or .zarray";
            return Err(invalid(path, "metadata", "nothing", allowed));
        };
        // A converted file, whose images are numbered.
        if root.ome().get("bioformats2raw.layout").is_some() && !root.ome().get("multiscales").is_some() {
            let first = Node::read(&keys, "0")?;
            let first = first.ok_or_else(|| invalid(&keys.file("0"), "metadata", "nothing", "the first image"))?;
            if Node::read(&keys, "1")?.is_some() {
                log::warn!("{}: several images: the first, 0, is read", path.display());
            }
            return Self::of_node(keys, &first, "0");
        }
        let is_array = root.value.get("node_type").and_then(Value::as_str) == Some("array");
        if is_array || keys.bytes(".zarray")?.is_some() {
            return Self::plain(keys);
        }
        Self::of_node(keys, &root, "")
    }

    /// Values of a level with what the metadata state about all of them.
    pub(super) fn stated(&self, level: usize, values: Voxels) -> Loaded {
        let Level { array, grid, first } = &self.levels[level];
        let spacing = Some(grid.spacing).filter(|_| !self.is_plain);
        let assumed_axes = Some(ASSUMED_AXES).filter(|_| array.are_axes_assumed);
        let orientation = self.orientation.map(|axes| Orientation { axes, origin: axes * *first });
        Loaded {
            spacing,
            assumed_axes,
            orientation,
            unit: self.unit.clone(),
            series: self.series,
            channel_names: self.channel_names.clone(),
            displays: self.displays.clone(),
            legends: vec![self.legend.clone()],
            ..Loaded::new(grid.dims, array.kind, values)
        }
    }

    /// An array without further metadata, whose voxels are as far apart along all axes.
    fn plain(keys: Arc<Keys>) -> Result<Self, VolumeError> {
        let array = ZarrArray::open(&keys, "", None)?;
        let grid = Grid::new(array.dims(), DVec3::ONE);
        let levels = vec![Level { array, grid, first: DVec3::ZERO }];
        let metadata = vec![levels[0].array.metadata()];
        let (channel_names, displays, legend) = (Vec::new(), Vec::new(), Legend::default());
        let (unit, orientation, series, is_plain) = (None, None, series_of(&keys, &levels)?, true);
        Ok(Self { keys, levels, unit, orientation, series, channel_names, displays, legend, is_plain, metadata })
    }

    /// The image whose levels lie below a group of a store.
    fn of_node(keys: Arc<Keys>, node: &Node, path: &str) -> Result<Self, VolumeError> {
        let ome = node.ome();
        let multiscales = ome.get("multiscales");
        let all = multiscales.members();
        let Some(multiscale) = all.first() else {
            let allowed = "an image of OME-Zarr 0.4 or 0.5; of a store with several images, one's own path";
            return Err(multiscales.invalid(allowed));
        };
        if all.len() > 1 {
            log::warn!("{}: {} multiscale images: the first is read", node.file.display(), all.len());
        }
        let multiscale = Multiscale::read(&keys.path, multiscale)?;
        if multiscale.datasets.len() > MAX_LEVELS {
            let found = format!("{} levels", multiscale.datasets.len());
            return Err(invalid(&node.file, "datasets", found, format!("at most {MAX_LEVELS}")));
        }
        let (mut levels, mut metadata) = (Vec::<Level>::new(), vec![node.value.clone()]);
        // The centre of the finest level in the image's own space.
        let mut origin_of_world = DVec3::ZERO;
        for dataset in &multiscale.datasets {
            let place = if path.is_empty() { dataset.path.clone() } else { format!("{path}/{}", dataset.path) };
            let array = ZarrArray::open(&keys, &place, Some(&multiscale.axes))?;
            let grid = Grid::new(array.dims(), dataset.spacing);
            let origin = keys.file(&place);
            check_spacing("spacing", grid.spacing).map_err(|error| refused(&origin.display().to_string(), error))?;
            let is_coarser = |finer: &Level| {
                let [time, channel, ..] = array.shape;
                let has_no_more =
                    array.dims().cmple(finer.grid.dims).all() && finer.array.shape[..2] == [time, channel];
                has_no_more && grid.spacing.cmpge(finer.grid.spacing * (1.0 - ROUNDING)).all()
            };
            if !levels.last().is_none_or(is_coarser) {
                let allowed =
                    "as many channels and times as the level before, and along no axis more voxels or a smaller scale";
                let found = format!("{:?} (t, c, z, y, x), voxels of {}", array.shape, grid.spacing);
                return Err(invalid(&origin, "level", found, allowed));
            }
            metadata.push(array.metadata());
            let center = dataset.first + grid.center() * grid.spacing;
            let grid = match levels.first() {
                Some(finest) => grid.coarser_than(&finest.grid, center - origin_of_world),
                None => {
                    origin_of_world = center;
                    grid
                }
            };
            levels.push(Level { array, grid, first: dataset.first });
        }
        let (channel_names, displays) = display::channels(&ome.get("omero"));
        let mut legend = display::labels(&ome.get("image-label"));
        legend.are_labels = legend.are_labels || is_listed_as_labels(&keys);
        let is_plain = false;
        let (unit, orientation, series) = (multiscale.unit, multiscale.orientation, series_of(&keys, &levels)?);
        Ok(Self { keys, levels, unit, orientation, series, channel_names, displays, legend, is_plain, metadata })
    }
}

/// Whether the group `labels` in which an image lies lists it.
fn is_listed_as_labels(keys: &Keys) -> bool {
    const LABELS: &str = "labels";
    let Some((group, name)) = keys.of_group(LABELS) else { return false };
    // An image may be opened where its surroundings may not be.
    let node = Node::read(&group, "").ok().flatten();
    node.is_some_and(|node| node.ome().get(LABELS).members().iter().any(|member| member.text() == Some(&name)))
}

/// The channels and times, which all levels have.
fn series_of(keys: &Keys, levels: &[Level]) -> Result<Series, VolumeError> {
    let [times, channels] = [Axis::Time, Axis::Channel].map(|axis| levels[0].array.shape[axis as usize] as u32);
    if channels > MAX_CHANNELS {
        return Err(invalid(&keys.path, "channels", channels, format!("at most {MAX_CHANNELS}")));
    }
    Ok(Series { channels, times, ..Series::default() })
}
