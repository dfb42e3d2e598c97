//! Presets: a transfer function for a kind of data, with matching shading and compositing.

use glam::{DVec3, UVec3};

use super::colormap::Colormap;
use super::haze::constant;
use super::hounsfield::Hounsfield;
use super::object::Object;
use super::quantile::quantiles;
use super::{categories, channel_display, xray};
use crate::settings::clip::Clip;
use crate::settings::light::Light;
use crate::settings::shading::Shading;
use crate::settings::splatting::{Compositing, Interpolation, Splatting};
use crate::settings::transfer_function::{Ramp, TransferFunction};
use crate::volume::{ValueSlice, Volume};

/// A kind of data, and which part of it is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Preset {
    /// CT: opaque skin.
    CtSkin,
    /// CT: opaque bone only.
    CtBone,
    /// CT with a contrast agent: red vessels, with bone.
    CtVessels,
    /// MR of a head: the skin; a cut shows different tissues.
    MrHead,
    /// A summed projection of any data.
    Xray,
    /// A maximum intensity projection of any data.
    Mip,
    /// Fluorescence: values above the background, or within the window that the file states, unshaded; several channels each in its own colour.
    Confocal,
    /// Labels: one colour each; see [`categories`].
    Labels,
    /// Several channels (SPEC §10): the first gray, such as CT, with a surface that lets the others through, which are hot and translucent, such as PET.
    Fusion,
    /// A volume of colours (SPEC §10), such as photographed slices: opaque, in these colours. Other volumes are gray.
    Photo,
    /// No preset: a surface around what stands out ([`TransferFunction::from_histogram`]), even where another preset fits.
    None,
}

/// Control points at Hounsfield units.
type Points<T> = [(f64, T)];

impl Preset {
    /// All presets with their names in scene files.
    pub const ALL: [(&'static str, Self); 11] = [
        ("ct-skin", Self::CtSkin),
        ("ct-bone", Self::CtBone),
        ("ct-vessels", Self::CtVessels),
        ("mr-head", Self::MrHead),
        ("xray", Self::Xray),
        ("mip", Self::Mip),
        ("confocal", Self::Confocal),
        ("labels", Self::Labels),
        ("fusion", Self::Fusion),
        ("photo", Self::Photo),
        ("none", Self::None),
    ];

    /// Light and material.
    pub fn shading(self) -> Shading {
        let shading = Shading::default();
        match self {
            Self::Fusion | Self::None => shading,
            Self::CtSkin => Shading { ambient: 0.7, diffuse: 0.45, ..lit() },
            // Where a cut opens a head, gradients are mostly noise.
            Self::MrHead => Shading { ambient: 0.85, diffuse: 0.45, specular: 0.1, ..lit() },
            Self::CtBone => Shading { ambient: 0.75, diffuse: 0.45, specular: 0.3, shininess: 40.0, ..lit() },
            Self::CtVessels => Shading { specular: 0.35, shininess: 40.0, ..shading },
            Self::Xray | Self::Mip | Self::Confocal => Shading { enabled: false, ..shading },
            // Photographs are lit already, and gradients within matter of one colour are mostly noise.
            Self::Photo => Shading { enabled: false, ..shading },
            // Inside a label the gradient is 0, so all light is ambient.
            Self::Labels => Shading { ambient: 0.4, diffuse: 0.6, specular: 0.1, ..shading },
        }
    }

    /// Nothing is cut away. Where cuts open a scan, their faces show the slice's own colours; gradients there are mostly noise.
    pub fn clip(self) -> Clip {
        let is_scan = matches!(self, Self::CtSkin | Self::CtBone | Self::CtVessels | Self::MrHead | Self::Fusion);
        Clip { shade_faces: !is_scan, ..Clip::default() }
    }

    /// How sheets become an image.
    pub fn compositing(self) -> Compositing {
        match self {
            Self::Xray => Compositing::Xray,
            Self::Mip => Compositing::Maximum,
            Self::None => Splatting::default().compositing,
            _ => Compositing::Exponential,
        }
    }

    /// How values are interpolated after splatting: projections of the greatest values keep them.
    pub(crate) fn interpolation(self) -> Interpolation {
        if self == Self::Mip { Interpolation::Auto } else { Interpolation::Smooth }
    }

    /// Whether images gain by classification after splatting (SPEC §9), which is then the default. Sums and unshaded haze have no
    /// edges that it would sharpen, and numbers of labels cannot be interpolated.
    pub(crate) fn is_classified_after(self) -> bool {
        !matches!(self, Self::Xray | Self::Confocal | Self::Labels | Self::Fusion)
    }

    /// Whether amounts are added up or compared: a label map among several channels then keeps no colours, and on a light background all are dark, as on film.
    pub(crate) fn is_projection(self) -> bool {
        matches!(self, Self::Xray | Self::Mip)
    }

    /// The transfer function for a volume. Those for CT are in Hounsfield units: the values themselves if one in a thousand is below -100;
    /// or else the values less 1024 if the maximum lies within 1500 to 8191; or else a scale on which the background (by Otsu's threshold)
    /// is air, -1000, and the faintest eighth of the rest is water, 0. Without labels in the volume, [`Self::Labels`] gives
    /// [`TransferFunction::from_histogram`].
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
            Self::Confocal => confocal(volume),
            Self::Labels => labels(volume).unwrap_or_else(|| TransferFunction::from_histogram(volume)),
            Self::Fusion => Object::find(values).map_or_else(|| constant(0.1), |object| glass(volume, &object)),
            Self::None => TransferFunction::from_histogram(volume),
            Self::Photo => Object::find(values).map_or_else(|| constant(0.5), |object| solid(&object)),
        }
    }

    /// The transfer function for a channel after the first of several: with [`Self::Fusion`] hot and translucent, else as for the first.
    pub(crate) fn transfer_of_later(self, volume: &Volume) -> TransferFunction {
        match self {
            Self::Fusion => Object::find(volume.values()).map_or_else(|| constant(0.1), |object| hot(volume, &object)),
            _ => self.transfer(volume),
        }
    }

    /// Whether the preset is applicable to a volume: always, except [`Self::Labels`] to a volume without labels.
    pub fn suits(self, volume: &Volume) -> bool {
        self != Self::Labels || volume.labels().is_some() || categories::values(volume).is_some()
    }
}

/// Light by sheets (SPEC §14) for one opaque surface. Ambient light carries the occlusion, so that presets state more of it than the default.
fn lit() -> Shading {
    Shading { light: Light::UpperLeft, occlusion: 0.7, shadow: 0.5, ..Shading::default() }
}

fn ct(values: ValueSlice<'_>, color: &Points<[f64; 3]>, opacity: &Points<f64>) -> TransferFunction {
    let scale = Hounsfield::of(values);
    let color = color.iter().map(|&(units, rgb)| (scale.value(units), DVec3::from(rgb))).collect();
    let opacity = opacity.iter().map(|&(units, opacity)| (scale.value(units), opacity)).collect();
    TransferFunction::by_value(Ramp::through(color), Ramp::through(opacity))
}

fn mr_head(object: &Object) -> TransferFunction {
    let Object { faint, bright, .. } = *object;
    let threshold = object.threshold();
    // Even where values rise towards the skin, so that no grain shows.
    let color = vec![
        (threshold, DVec3::new(0.78, 0.56, 0.46)),
        (faint, DVec3::new(0.82, 0.6, 0.5)),
        (bright.max(2.0 * faint - threshold), DVec3::new(1.0, 0.97, 0.92)),
    ];
    TransferFunction::by_value(Ramp::through(color), object.surface(0.9))
}

/// Gray and opaque.
fn solid(object: &Object) -> TransferFunction {
    let Object { faint, bright, .. } = *object;
    let color =
        vec![(object.threshold(), DVec3::splat(0.55)), (bright.max(2.0 * faint - object.threshold()), DVec3::ONE)];
    TransferFunction::by_value(Ramp::through(color), object.surface(0.9))
}

/// Gray like glass, so that what glows within is seen: a surface, little in most of the object, and what is brighter, such as bone, denser again.
fn glass(volume: &Volume, object: &Object) -> TransferFunction {
    /// Opacities times the volume's mean extent, so that volumes of any resolution let as much through.
    const DEPTHS: [f64; 3] = [16.0, 1.5, 8.0];
    const MOST: f64 = 0.25;
    let [surface, inside, bright] = DEPTHS.map(|depth| (depth / extent(volume)).min(MOST));
    let threshold = object.threshold();
    let mut opacity = vec![
        (threshold - (threshold - object.background) / 3.0, 0.0),
        (threshold, surface),
        (object.faint, inside),
        (object.bright, inside),
        (object.bright + (object.bright - threshold) / 2.0, bright),
    ];
    // In homogeneous matter the two are one.
    opacity.dedup_by_key(|point| point.0);
    TransferFunction { opacity: Ramp::through(opacity), ..solid(object) }
}

/// A glow that is hotter, and denser, where values are greater.
fn hot(volume: &Volume, object: &Object) -> TransferFunction {
    let opacity = Ramp::through(vec![(object.threshold(), 0.0), (object.bright, 0.25)]);
    let glow = TransferFunction::by_value(Ramp::through(vec![(object.background, DVec3::ONE)]), opacity);
    TransferFunction { color: Colormap::Hot.of(volume, &glow).unwrap_or(glow.color.clone()), ..glow }
}

/// The opacity of labels over a first channel that is to be seen too: every label but 0.
pub(super) fn translucent_labels() -> Ramp<f64> {
    Ramp::through(vec![(0.0, 0.0), (1.0, 0.3)])
}

/// White, with an opacity that rises from the background to a value that few voxels exceed.
fn mip(values: ValueSlice<'_>, object: &Object) -> TransferFunction {
    const TAIL: f64 = 0.0005;
    let (background, ceiling) = (object.background, object.ceiling);
    let is_shown = |value| background < f64::from(value) && f64::from(value) <= ceiling;
    let top = quantiles(values, is_shown, [1.0 - TAIL]);
    let top = top.map_or(object.bright, |[top]| f64::from(top));
    let color = Ramp::through(vec![(background, DVec3::ONE)]);
    TransferFunction::by_value(color, Ramp::through(vec![(background, 0.0), (top, 1.0)]))
}

/// A haze over the window that the volume's file states, or else from the background to the brightest eighth of the object; in the file's colours,
/// or else green.
fn confocal(volume: &Volume) -> TransferFunction {
    haze(volume, |_| 0.5)
}

/// The same for one of several channels, so thin that one lets others behind it through: the mean ray through the volume meets an
/// optical depth of `DEPTH`.
pub(super) fn confocal_of_several(volume: &Volume) -> TransferFunction {
    const DEPTH: f64 = 0.4;
    const MOST: f64 = 0.5;
    // Whole numbers, whose sum does not depend on their order.
    const STEPS: f64 = 65536.0;
    haze(volume, |[start, top]| {
        let share = |value: f32| ((f64::from(value) - start) / (top - start)).clamp(0.0, 1.0);
        let sum: u64 = volume.values().par_iter().map(|value| (share(value) * STEPS) as u64).sum();
        let mean = sum as f64 / STEPS / (volume.values().len() as u64 - volume.holes()) as f64;
        (DEPTH / (mean * extent(volume))).min(MOST)
    })
}

/// The mean of a volume's sides without holes around it, in its smallest spacing.
fn extent(volume: &Volume) -> f64 {
    (finite_dims(volume).as_dvec3() * volume.grid().aspect()).element_sum() / 3.0
}

/// The voxels along each axis of the box of the finite values.
fn finite_dims(volume: &Volume) -> UVec3 {
    if volume.holes() == 0 {
        return volume.dims();
    }
    let finite = volume.values().par_iter().enumerate().filter(|(_, value)| !value.is_nan());
    let voxels = finite.map(|(index, _)| volume.grid().voxel_at(index as u32)).map(|voxel| (voxel, voxel));
    let join = |a: (UVec3, UVec3), b: (UVec3, UVec3)| (a.0.min(b.0), a.1.max(b.1));
    let (low, high) = voxels.reduce(|| (UVec3::MAX, UVec3::ZERO), join);
    high + 1 - low
}

/// [`confocal`] with the opacity at a window's end.
fn haze(volume: &Volume, opacity: impl Fn([f64; 2]) -> f64) -> TransferFunction {
    let (object, display) = (Object::find(volume.values()), volume.display());
    let around = |object: &Object| [(object.background + object.threshold()) / 2.0, object.bright];
    let window = display.and_then(|display| display.window).or(object.as_ref().map(around));
    let Some([start, top]) = window else { return constant(0.5) };
    let dark = object.map_or(start, |object| object.background).min(start);
    let green = || Ramp::through(vec![(dark, DVec3::new(0.0, 0.35, 0.05)), (top, DVec3::new(0.55, 1.0, 0.6))]);
    let color = display.and_then(channel_display::color).unwrap_or_else(green);
    TransferFunction::by_value(color, Ramp::through(vec![(start, 0.0), (top, opacity([start, top]))]))
}

fn labels(volume: &Volume) -> Option<TransferFunction> {
    match volume.labels() {
        Some(labels) => {
            let labels = categories::tables_of(volume, labels);
            Some(TransferFunction { labels, ..TransferFunction::from_histogram(volume) })
        }
        None => categories::values(volume)
            .map(|labels| categories::transfer_of(volume, &labels, volume.palette().unwrap_or_default())),
    }
}
