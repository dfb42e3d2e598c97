//! Presets: a transfer function for a kind of data, with the shading and compositing that go with it.

use glam::DVec3;

use super::hounsfield::Hounsfield;
use super::object::Object;
use super::quantile::quantiles;
use super::{categories, constant, xray};
use crate::settings::shading::Shading;
use crate::settings::splatting::Compositing;
use crate::settings::transfer_function::{Ramp, TransferFunction};
use crate::volume::Volume;

/// A kind of data, and what of it is to be seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Preset {
    /// CT: the skin, opaque.
    CtSkin,
    /// CT: bone alone, opaque.
    CtBone,
    /// CT with a contrast agent: vessels red, bone behind and among them.
    CtVessels,
    /// MR of a head: the skin; where a cut opens it, tissues differ.
    MrHead,
    /// A summed projection, of any data.
    Xray,
    /// A maximum intensity projection, of any data.
    Mip,
    /// Fluorescence: what glows above the background, unshaded.
    Confocal,
    /// Labels: a colour for each; see [`categories`].
    Labels,
}

/// Control points: Hounsfield units and what is there.
type Points<T> = [(f64, T)];

impl Preset {
    /// All of them, with the names that scene files use.
    pub const ALL: [(&'static str, Self); 8] = [
        ("ct-skin", Self::CtSkin),
        ("ct-bone", Self::CtBone),
        ("ct-vessels", Self::CtVessels),
        ("mr-head", Self::MrHead),
        ("xray", Self::Xray),
        ("mip", Self::Mip),
        ("confocal", Self::Confocal),
        ("labels", Self::Labels),
    ];

    /// Light and material.
    pub fn shading(self) -> Shading {
        let shading = Shading::default();
        match self {
            Self::CtSkin => shading,
            // Where a cut opens a head, gradients are mostly noise.
            Self::MrHead => Shading { ambient: 0.4, diffuse: 0.6, specular: 0.1, ..shading },
            Self::CtBone | Self::CtVessels => Shading { specular: 0.35, shininess: 40.0, ..shading },
            Self::Xray | Self::Mip | Self::Confocal => Shading { enabled: false, ..shading },
            // Inside of a label there is no gradient, and all light is ambient.
            Self::Labels => Shading { ambient: 0.4, diffuse: 0.6, specular: 0.1, ..shading },
        }
    }

    /// How sheets become an image.
    pub fn compositing(self) -> Compositing {
        match self {
            Self::Xray => Compositing::Xray,
            Self::Mip => Compositing::Maximum,
            _ => Compositing::Exponential,
        }
    }

    /// The transfer function for a volume. Those of CT are in Hounsfield units: the values as they are where one in a thousand is below
    /// -100; else, where the greatest lies within 1500 to 8191, 1024 is taken to have been added; for all else the background
    /// (what Otsu's threshold finds) is taken for air, -1000, and the faintest eighth of the rest for water, 0. Where
    /// [`Self::Labels`] finds no labels, it is as [`TransferFunction::from_histogram`].
    pub fn transfer(self, volume: &Volume) -> TransferFunction {
        let values = volume.values();
        match self {
            Self::CtSkin => ct(
                values,
                &[(-575.0, [0.92, 0.74, 0.62]), (125.0, [0.95, 0.78, 0.66]), (575.0, [1.0, 0.95, 0.85])],
                &[(-575.0, 0.0), (-275.0, 0.9)],
            ),
            Self::CtBone => ct(
                values,
                &[(150.0, [0.82, 0.66, 0.48]), (500.0, [0.93, 0.86, 0.71]), (1500.0, [1.0, 0.98, 0.93])],
                &[(150.0, 0.0), (350.0, 0.9)],
            ),
            Self::CtVessels => ct(
                values,
                &[
                    (120.0, [0.55, 0.05, 0.04]),
                    (300.0, [0.85, 0.2, 0.12]),
                    (450.0, [0.93, 0.8, 0.62]),
                    (900.0, [1.0, 0.97, 0.9]),
                ],
                &[(120.0, 0.0), (220.0, 0.3), (450.0, 0.5)],
            ),
            Self::MrHead => Object::find(values).map_or_else(|| constant(0.5), |object| mr_head(&object)),
            Self::Xray => xray::transfer(volume),
            Self::Mip => Object::find(values).map_or_else(|| constant(0.5), |object| mip(values, &object)),
            Self::Confocal => Object::find(values).map_or_else(|| constant(0.5), |object| confocal(&object)),
            Self::Labels => labels(volume).unwrap_or_else(|| TransferFunction::from_histogram(volume)),
        }
    }

    /// Whether a volume is what the preset is for: all volumes but those without labels, for [`Self::Labels`].
    pub fn suits(self, volume: &Volume) -> bool {
        self != Self::Labels || volume.labels().is_some() || categories::values(volume).is_some()
    }
}

fn ct(values: &[f32], color: &Points<[f64; 3]>, opacity: &Points<f64>) -> TransferFunction {
    let scale = Hounsfield::of(values);
    let color = color.iter().map(|&(units, rgb)| (scale.value(units), DVec3::from(rgb))).collect();
    let opacity = opacity.iter().map(|&(units, opacity)| (scale.value(units), opacity)).collect();
    TransferFunction::by_value(Ramp::through(color), Ramp::through(opacity))
}

fn mr_head(object: &Object) -> TransferFunction {
    let Object { faint, bright, .. } = *object;
    let threshold = object.threshold();
    // Even where values rise towards the skin, so that it shows no grain.
    let color = vec![
        (threshold, DVec3::new(0.78, 0.56, 0.46)),
        (faint, DVec3::new(0.82, 0.6, 0.5)),
        (bright.max(2.0 * faint - threshold), DVec3::new(1.0, 0.97, 0.92)),
    ];
    TransferFunction::by_value(Ramp::through(color), object.surface(0.9))
}

/// White, brighter from the background to what few voxels exceed.
fn mip(values: &[f32], object: &Object) -> TransferFunction {
    const TAIL: f64 = 0.0005;
    let background = object.background;
    let top = quantiles(values, |value| f64::from(value) > background, [1.0 - TAIL]);
    let top = top.map_or(object.bright, |[top]| f64::from(top));
    let color = Ramp::through(vec![(background, DVec3::ONE)]);
    TransferFunction::by_value(color, Ramp::through(vec![(background, 0.0), (top, 1.0)]))
}

fn confocal(object: &Object) -> TransferFunction {
    let Object { background, bright, .. } = *object;
    let color = vec![(background, DVec3::new(0.0, 0.35, 0.05)), (bright, DVec3::new(0.55, 1.0, 0.6))];
    let start = (background + object.threshold()) / 2.0;
    TransferFunction::by_value(Ramp::through(color), Ramp::through(vec![(start, 0.0), (bright, 0.5)]))
}

fn labels(volume: &Volume) -> Option<TransferFunction> {
    match volume.labels() {
        Some(labels) => {
            let labels = categories::tables(labels);
            Some(TransferFunction { labels, ..TransferFunction::from_histogram(volume) })
        }
        None => categories::values(volume).map(|labels| categories::transfer(&labels)),
    }
}
