//! What a page shows of a volume and its scene: plain data for JavaScript.

use serde::Serialize;
use sheetsplat::Scene;
use sheetsplat::appearance::{Colormap, Preset, histogram};
use sheetsplat::glam::DVec3;
use sheetsplat::settings::{Camera, Compositing, Projection, Splatting, TransferFunction};
use sheetsplat::volume::Volume;

/// The maximum number of bins in a histogram.
const MAX_BINS: f64 = 256.0;

/// A volume, and how its scene shows it.
#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Facts<'a> {
    dims: [u32; 3],
    spacing: [f64; 3],
    unit: Option<String>,
    format: Option<&'static str>,
    holes: f64,
    labels: bool,
    /// The directions of x, y and z in a patient's RAS.
    orientation: Option<[[f64; 3]; 3]>,
    /// The preset that fits the values, if they tell.
    suggested: Option<&'static str>,
    presets: Vec<&'static str>,
    colormaps: Vec<&'static str>,
    /// The scene's preset.
    preset: Option<&'static str>,
    slab_width: f64,
    occlusion: f64,
    shadow: f64,
    compositing: &'static str,
    /// What the preset would choose.
    preset_compositing: &'static str,
    projection: &'static str,
    planes: Vec<[f64; 4]>,
    crop: Option<[[f64; 3]; 2]>,
    channels: Vec<Channel<'a>>,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct Channel<'a> {
    name: String,
    visible: bool,
    /// The scene's colour map.
    colormap: Option<&'static str>,
    /// Whether the scene states the colours one by one.
    has_colors: bool,
    range: [f64; 2],
    histogram: &'a [f64],
    /// The transfer function's control points.
    opacity: Vec<(f64, f64)>,
    color: Vec<(f64, [f64; 3])>,
}

/// The distribution of a channel's values.
pub(crate) struct Histogram {
    /// The smallest and the greatest value.
    range: [f64; 2],
    /// Counts of values in equal intervals of the range, which hold equally many integers if all values are.
    counts: Vec<f64>,
}

impl<'a> Facts<'a> {
    /// `histograms` are those of the volume's channels.
    pub(crate) fn new(volume: &Volume, scene: &Scene, histograms: &'a [Histogram]) -> Self {
        // A hidden channel keeps its colours and opacities.
        let mut seen = scene.clone();
        seen.channels.iter_mut().for_each(|channel| channel.visible = true);
        let transfer = seen.resolve(volume);
        let channels = histograms.iter().zip(&transfer).enumerate();
        let preset = scene.channels.first().transfer.preset;
        let fitted = scene.fitted(volume);
        let of_preset =
            fitted.channels.first().transfer.preset.map_or(Splatting::default().compositing, Preset::compositing);
        Self {
            dims: volume.dims().to_array(),
            spacing: volume.spacing().to_array(),
            unit: volume.unit().map(str::to_owned),
            format: volume.encoding().map(|encoding| encoding.format),
            holes: volume.holes() as f64,
            labels: volume.labels().is_some(),
            orientation: volume.orientation().map(|orientation| orientation.axes.to_cols_array_2d()),
            suggested: Preset::suggested(volume).and_then(|preset| name_of(&Preset::ALL, preset)),
            presets: Preset::ALL.iter().filter(|(_, preset)| preset.suits(volume)).map(|(name, _)| *name).collect(),
            colormaps: Colormap::ALL.iter().map(|(name, _)| *name).collect(),
            preset: preset.and_then(|preset| name_of(&Preset::ALL, preset)),
            slab_width: scene.splatting.slab_width,
            occlusion: fitted.shading.occlusion,
            shadow: fitted.shading.shadow,
            compositing: compositing_name(fitted.splatting.compositing),
            preset_compositing: compositing_name(of_preset),
            projection: projection_name(&scene.camera),
            planes: scene.clip.planes.clone(),
            crop: scene.clip.crop.map(|corners| corners.map(|corner| corner.to_array())),
            channels: channels
                .map(|(number, (histogram, transfer))| {
                    Channel::new(scene, number, scene.channel_name(volume, number), histogram, transfer)
                })
                .collect(),
        }
    }
}

impl<'a> Channel<'a> {
    fn new(scene: &Scene, number: usize, name: String, histogram: &'a Histogram, transfer: &TransferFunction) -> Self {
        // A scene with settings for one channel shows all by them.
        let settings = scene.channels.get(if scene.channels.len() == 1 { 0 } else { number });
        let stated = settings.as_ref().map(|settings| &settings.transfer);
        let color = |&(value, color): &(f64, DVec3)| (value, color.to_array());
        Self {
            name,
            visible: settings.as_ref().is_none_or(|settings| settings.visible),
            colormap: stated.and_then(|stated| name_of(&Colormap::ALL, stated.colormap?)),
            has_colors: stated.is_some_and(|stated| stated.color.is_some()),
            range: histogram.range,
            histogram: &histogram.counts,
            opacity: transfer.opacity.points().to_vec(),
            color: transfer.color.points().iter().map(color).collect(),
        }
    }
}

impl Histogram {
    pub(crate) fn new(channel: &Volume) -> Self {
        let values = channel.values();
        let finite = || values.iter().filter(|value| !value.is_nan());
        let [low, high] =
            finite().fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)]);
        let (first, width) = (f64::from(low), f64::from(high) - f64::from(low));
        let is_whole = finite().all(|value| value.fract() == 0.0);
        let interval = if is_whole { ((width + 1.0) / MAX_BINS).ceil() } else { width / MAX_BINS };
        let bins = if is_whole { ((width + 1.0) / interval).ceil() } else { MAX_BINS } as usize;
        let bin = |value: f32| {
            let at = ((f64::from(value) - first) / interval) as usize;
            (!value.is_nan()).then_some(at.min(bins - 1))
        };
        let counts = histogram(values, bins, bin).into_iter().map(|count| count as f64).collect();
        Self { range: [low, high].map(f64::from), counts }
    }
}

/// Where a camera is.
#[derive(Serialize)]
pub(crate) struct Placed {
    direction: [f64; 3],
    up: [f64; 3],
    center: [f64; 3],
    height: f64,
    projection: &'static str,
}

impl Placed {
    /// A camera with everything stated, and the height in world units of what the picture shows at its centre's depth.
    pub(crate) fn new(camera: &Camera, height: f64) -> Self {
        let [direction, up] = [camera.direction, camera.up].map(|vector| vector.normalize().to_array());
        Self { direction, up, center: camera.middle().to_array(), height, projection: projection_name(camera) }
    }
}

fn projection_name(camera: &Camera) -> &'static str {
    match camera.projection {
        Projection::Orthographic { .. } => "orthographic",
        Projection::Perspective { .. } => "perspective",
    }
}

fn compositing_name(compositing: Compositing) -> &'static str {
    name_of(&Compositing::ALL, compositing).unwrap_or_default()
}

fn name_of<T: PartialEq>(names: &[(&'static str, T)], wanted: T) -> Option<&'static str> {
    names.iter().find(|(_, other)| *other == wanted).map(|(name, _)| *name)
}
