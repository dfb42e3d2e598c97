//! The segments of a segmentation, their names and colours, and the segment of each frame (PS3.3 C.8.20, C.8.35).

use std::collections::BTreeSet;

use glam::{DMat3, DVec3};

use super::super::VolumeError;
use super::super::loaded::Legend;
use super::dataset::{Dataset, tags};

/// The classes of segmentations: with frames of single segments, and with numbers of segments for samples.
const SEGMENTATION: &str = "1.2.840.10008.5.1.4.1.1.66.4";
const LABEL_MAP: &str = "1.2.840.10008.5.1.4.1.1.66.7";

/// The meaning of samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Meaning {
    /// 1 in the frame's segment, 0 outside.
    Binary,
    /// How much of the voxel is in the frame's segment, from 0 to this number.
    Fractional(u16),
    /// The number of the voxel's segment; 0 outside all.
    Numbers,
}

/// A segment, as the file describes it.
struct Segment {
    number: u16,
    name: Option<String>,
    color: Option<DVec3>,
}

/// The segments of a file.
pub(super) struct Segments {
    pub(super) meaning: Meaning,
    /// The number of each frame's segment; empty where samples are numbers of segments.
    pub(super) of_frames: Vec<u16>,
    segments: Vec<Segment>,
}

impl Segments {
    /// The segments of a file with some number of frames; `None` if it is no segmentation.
    pub(super) fn read(data: &Dataset, frames: usize) -> Result<Option<Self>, VolumeError> {
        let class = data.text(tags::SOP_CLASS).or_else(|| data.text(tags::MEDIA_SOP_CLASS));
        let is_map = match class.as_deref() {
            Some(SEGMENTATION) => false,
            Some(LABEL_MAP) => true,
            _ => return Ok(None),
        };
        let stated = data.text(tags::SEGMENTATION_TYPE);
        let meaning = match (stated.as_deref(), is_map) {
            (Some("LABELMAP"), _) | (None, true) => Meaning::Numbers,
            (Some("BINARY"), false) => Meaning::Binary,
            (Some("FRACTIONAL"), false) => {
                let allowed = "the sample that stands for 1";
                match data.unsigned(tags::MAX_FRACTION)? {
                    Some(0) => return Err(data.invalid(tags::MAX_FRACTION, 0, "1 or more")),
                    most => Meaning::Fractional(most.ok_or_else(|| data.missing(tags::MAX_FRACTION, allowed))?),
                }
            }
            (found, _) => {
                let found = found.unwrap_or("no such element");
                return Err(data.invalid(tags::SEGMENTATION_TYPE, found, "BINARY, FRACTIONAL or LABELMAP"));
            }
        };
        let segments = data.items(tags::SEGMENTS).iter().map(Segment::read).collect::<Result<_, _>>()?;
        let numbers = |frame: usize| number_of(data, frame);
        let of_frames = if meaning == Meaning::Numbers {
            Vec::new()
        } else {
            (0..frames).map(numbers).collect::<Result<_, _>>()?
        };
        Ok(Some(Self { meaning, of_frames, segments }))
    }

    /// The names and colours of some segments, or of all, by their numbers.
    pub(super) fn legend(&self, of: Option<&BTreeSet<u16>>) -> Legend {
        let shown = || self.segments.iter().filter(|segment| of.is_none_or(|of| of.contains(&segment.number)));
        let names = shown().filter_map(|segment| Some((segment.number.into(), segment.name.clone()?))).collect();
        let mut palette: Vec<(f64, DVec3)> =
            shown().filter_map(|segment| Some((segment.number.into(), segment.color?))).collect();
        palette.sort_by(|a, b| a.0.total_cmp(&b.0));
        Legend { names, palette: Some(palette).filter(|palette| !palette.is_empty()), are_labels: true }
    }

    /// A segment's name, or its number.
    pub(super) fn name(&self, number: u16) -> String {
        let named = self.segments.iter().find(|segment| segment.number == number);
        named.and_then(|segment| segment.name.clone()).unwrap_or_else(|| format!("segment {number}"))
    }
}

impl Segment {
    fn read(item: &Dataset) -> Result<Self, VolumeError> {
        let number = item.unsigned(tags::SEGMENT_NUMBER)?;
        let number = number.ok_or_else(|| item.missing(tags::SEGMENT_NUMBER, "the number of the segment"))?;
        let color = item.shorts(tags::RECOMMENDED_COLOR);
        let color = color.and_then(|numbers| <[u16; 3]>::try_from(numbers).ok()).map(srgb);
        Ok(Self { number, name: item.text(tags::SEGMENT_LABEL), color })
    }
}

/// The number of a frame's segment, by the frame's own groups of elements or the shared ones.
fn number_of(data: &Dataset, frame: usize) -> Result<u16, VolumeError> {
    let (own, shared) = (data.items(tags::FRAME_GROUPS).get(frame), data.items(tags::SHARED_GROUPS).first());
    let mut groups = [own, shared].into_iter().flatten();
    let identified = groups.find_map(|groups| groups.items(tags::SEGMENT_IDENTIFICATION).first());
    let allowed = "the segment of every frame";
    let item = identified.ok_or_else(|| data.missing(tags::SEGMENT_IDENTIFICATION, allowed))?;
    match item.unsigned(tags::REFERENCED_SEGMENT)? {
        Some(0) => Err(item.invalid(tags::REFERENCED_SEGMENT, 0, "1 or more")),
        number => number.ok_or_else(|| item.missing(tags::REFERENCED_SEGMENT, allowed)),
    }
}

/// The sRGB colour of a CIELab colour, encoded as PS3.3 C.10.7.1.1 says: L* of 0 to 100, and a* and b* of -128 to 127, each as 0 to 65535. The standard
/// names D50 for its white, but DCMTK, dcm4che, dcmjs and highdicom, which write segmentations, take sRGB's own, D65; so does this.
fn srgb(encoded: [u16; 3]) -> DVec3 {
    /// The white of D65 (IEC 61966-2-1).
    const WHITE: DVec3 = DVec3::new(0.950_47, 1.0, 1.088_83);
    /// Linear sRGB from XYZ, by columns.
    const RGB_FROM_XYZ: DMat3 = DMat3::from_cols_array(&[
        3.240_454_2,
        -0.969_266_0,
        0.055_643_4, //
        -1.537_138_5,
        1.876_010_8,
        -0.204_025_9, //
        -0.498_531_4,
        0.041_556_0,
        1.057_225_2,
    ]);
    let [l, a, b] = encoded.map(|number| f64::from(number) / 65535.0);
    let [l, a, b] = [100.0 * l, 255.0 * a - 128.0, 255.0 * b - 128.0];
    // CIE 15:2004, 8.2.1.1, inverted.
    let y = (l + 16.0) / 116.0;
    let cube = |f: f64| if f > 6.0 / 29.0 { f * f * f } else { 3.0 * (6.0_f64 / 29.0).powi(2) * (f - 4.0 / 29.0) };
    let xyz = DVec3::new(cube(y + a / 500.0), cube(y), cube(y - b / 200.0)) * WHITE;
    // IEC 61966-2-1; colours outside sRGB take the nearest number of each component.
    let encoded = |linear: f64| match linear {
        linear if linear <= 0.003_130_8 => 12.92 * linear,
        linear => 1.055 * libm::pow(linear, 1.0 / 2.4) - 0.055,
    };
    let rgb = (RGB_FROM_XYZ * xyz).clamp(DVec3::ZERO, DVec3::ONE);
    DVec3::from_array(rgb.to_array().map(encoded)).clamp(DVec3::ZERO, DVec3::ONE)
}
