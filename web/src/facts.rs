//! What a page shows of a volume and its scene: plain data for JavaScript.

use serde::Serialize;
use sheetsplat::Scene;
use sheetsplat::appearance::{Colormap, Preset, histogram};
use sheetsplat::glam::DVec3;
use sheetsplat::settings::TransferFunction;
use sheetsplat::volume::Volume;

/// The maximum number of bins in a histogram.
const MAX_BINS: f64 = 256.0;

/// A volume, and how its scene shows it.
#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct Facts {
    dims: [u32; 3],
    spacing: [f64; 3],
    unit: Option<String>,
    format: Option<&'static str>,
    holes: f64,
    labels: bool,
    /// The preset that fits the values, if they tell.
    suggested: Option<&'static str>,
    presets: Vec<&'static str>,
    colormaps: Vec<&'static str>,
    channels: Vec<Channel>,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct Channel {
    name: String,
    /// The smallest and the greatest value.
    range: [f64; 2],
    /// Counts of values in equal intervals of the range, which hold equally many integers if all values are.
    histogram: Vec<f64>,
    /// The transfer function's control points.
    opacity: Vec<(f64, f64)>,
    color: Vec<(f64, [f64; 3])>,
}

impl Facts {
    pub(crate) fn new(volume: &Volume, scene: &Scene) -> Self {
        let transfer = scene.resolve(volume);
        let name_of = |preset: Preset| Preset::ALL.iter().find(|(_, other)| *other == preset).map(|(name, _)| *name);
        let channels = volume.channels().zip(transfer.channels()).enumerate();
        Self {
            dims: volume.dims().to_array(),
            spacing: volume.spacing().to_array(),
            unit: volume.unit().map(str::to_owned),
            format: volume.encoding().map(|encoding| encoding.format),
            holes: volume.holes() as f64,
            labels: volume.labels().is_some(),
            suggested: Preset::suggested(volume).and_then(name_of),
            presets: Preset::ALL.iter().filter(|(_, preset)| preset.suits(volume)).map(|(name, _)| *name).collect(),
            colormaps: Colormap::ALL.iter().map(|(name, _)| *name).collect(),
            channels: channels
                .map(|(number, (channel, transfer))| {
                    let name = scene.channel_name(volume, number);
                    Channel::new(name, channel.values(), transfer)
                })
                .collect(),
        }
    }
}

impl Channel {
    fn new(name: String, values: &[f32], transfer: &TransferFunction) -> Self {
        let finite = || values.iter().copied().filter(|value| !value.is_nan());
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
        let color = |&(value, color): &(f64, DVec3)| (value, color.to_array());
        Self {
            name,
            range: [low, high].map(f64::from),
            histogram: histogram(values, bins, bin).into_iter().map(|count| count as f64).collect(),
            opacity: transfer.opacity.points().to_vec(),
            color: transfer.color.points().iter().map(color).collect(),
        }
    }
}
