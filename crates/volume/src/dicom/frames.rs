//! The positions and scales of a file's frames.

use std::sync::Arc;

use glam::DVec3;

use super::super::VolumeError;
use super::dataset::{Dataset, Tag, tags};
use super::marks::{self, Marked};

/// A frame's position, in LPS and millimetres.
pub(super) struct Frame {
    /// The position of the first pixel.
    pub(super) position: DVec3,
    /// The directions of x and y.
    pub(super) directions: [DVec3; 2],
    /// The distances between pixels along x and y.
    pub(super) spacing: [f64; 2],
    /// The distance between slices, if the frame states it.
    pub(super) between: Option<f64>,
    /// This distance, or else the thickness of a slice, if the frame states it.
    pub(super) thickness: Option<f64>,
    /// Slope and intercept.
    pub(super) rescale: [f64; 2],
    /// The unit of rescaled values, such as `HU`.
    pub(super) rescale_type: Option<Arc<str>>,
    /// The frame's statements that tell images at one place apart.
    pub(super) marked: Marked,
}

/// Whether a file states where its image is.
pub(super) fn are_placed(data: &Dataset) -> bool {
    let has = |data: &Dataset| data.text(tags::POSITION).is_some();
    has(data) || data.items(tags::DETECTORS).iter().any(has) || !data.items(tags::FRAME_GROUPS).is_empty()
}

/// The frames, by each frame's own groups of elements, the shared groups, or the file's own elements; and what the file lacks, so that they were placed by
/// defaults.
pub(super) fn read(data: &Dataset, count: usize) -> Result<(Vec<Frame>, Option<Assumed>), VolumeError> {
    let shared = data.items(tags::SHARED_GROUPS).first();
    let groups = data.items(tags::FRAME_GROUPS);
    let is_enhanced = !groups.is_empty() || shared.is_some();
    if is_enhanced && groups.len() != count && (count > 1 || !groups.is_empty()) {
        let allowed = format!("{count}, one per frame");
        return Err(data.invalid(tags::FRAME_GROUPS, format!("{} items", groups.len()), allowed));
    }
    let is_classic = !is_enhanced && count > 1;
    let (places, mut assumed) = if is_classic { places(data, count)? } else { (Places::Own, None) };
    let detector = data.items(tags::DETECTORS).first();
    let scaling = data.numbers(tags::DOSE_SCALING)?.map_or(1.0, |[scaling]| scaling);
    let mut last_type: Option<Arc<str>> = None;
    let mut frames = Vec::new();
    for frame in 0..count {
        let own = groups.get(frame);
        let group = |sequence: Tag| {
            let mut groups = [own, shared].into_iter().flatten();
            groups.find_map(|groups| groups.items(sequence).first()).unwrap_or(data)
        };
        let positive = |text: Option<[f64; 1]>| text.map(|[number]| number.abs()).filter(|&number| number > 0.0);
        let plane = |sequence: Tag, tag: Tag| match group(sequence) {
            plane if plane.text(tag).is_some() => plane,
            plane => detector.filter(|detector| detector.text(tag).is_some()).unwrap_or(plane),
        };
        let is_bare = matches!(assumed, Some(Assumed::Places | Assumed::Grid));
        let allowed = "the image's position in the patient";
        let position = plane(tags::PLANE_POSITION, tags::POSITION);
        let orientation = plane(tags::PLANE_ORIENTATION, tags::ORIENTATION);
        let (position, orientation) =
            match (position.numbers(tags::POSITION)?, orientation.numbers::<6>(tags::ORIENTATION)?) {
                (Some(first), Some(orientation)) => (first, orientation),
                _ if is_bare => ([0.0; 3], [1.0, 0.0, 0.0, 0.0, 1.0, 0.0]),
                (None, _) => return Err(position.missing(tags::POSITION, allowed)),
                (_, None) => return Err(orientation.missing(tags::ORIENTATION, allowed)),
            };
        let [row, column] = [0, 3].map(|first| DVec3::from_slice(&orientation[first..]));
        let measures = group(tags::PIXEL_MEASURES);
        let stated = match measures.numbers(tags::PIXEL_SPACING)? {
            None if is_bare => measures.numbers(tags::IMAGER_SPACING)?,
            stated => stated,
        };
        let [y, x] = match stated {
            None if is_bare => {
                assumed = Some(Assumed::Grid);
                [1.0; 2]
            }
            stated => stated.ok_or_else(|| measures.missing(tags::PIXEL_SPACING, "the distances between pixels"))?,
        };
        if x <= 0.0 || y <= 0.0 {
            return Err(measures.invalid(tags::PIXEL_SPACING, format!("[{y}, {x}]"), "two positive numbers"));
        }
        let between = positive(measures.numbers(tags::SPACING_BETWEEN_SLICES)?);
        let thickness = between.or(positive(measures.numbers(tags::SLICE_THICKNESS)?));
        let values = group(tags::PIXEL_TRANSFORMATION);
        let slope = values.numbers(tags::SLOPE)?.map_or(1.0, |[slope]| slope);
        let intercept = values.numbers(tags::INTERCEPT)?.map_or(0.0, |[intercept]| intercept);
        // All frames of a type share its text.
        let rescale_type = values.text(tags::RESCALE_TYPE);
        if last_type.as_deref() != rescale_type.as_deref() {
            last_type = rescale_type.map(Arc::from);
        }
        let normal = row.cross(column).normalize_or_zero();
        let along = match &places {
            Places::Own => 0.0,
            Places::Offsets(offsets) => offsets[frame],
            Places::Absolute(heights) => (heights[frame] - position[2]) * normal.z.signum(),
            Places::Steps(step, slices) => {
                let slice = slices.as_ref().map_or(frame as f64, |slices| f64::from(slices[frame]) - 1.0);
                slice * step.or(thickness).unwrap_or(1.0)
            }
        };
        frames.push(Frame {
            position: DVec3::from_array(position) + along * normal,
            directions: [row, column],
            spacing: [x, y],
            between,
            thickness,
            rescale: [slope * scaling, intercept * scaling],
            rescale_type: last_type.clone(),
            marked: marks::of_frame(data, own, frame),
        });
    }
    Ok((frames, assumed))
}

/// The element that a file of several frames lacks, so that these are taken to be stacked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Assumed {
    /// The distance between frames.
    Steps,
    /// The position and the directions of the image.
    Places,
    /// These, and the size of pixels.
    Grid,
}

impl Assumed {
    /// The missing elements.
    pub(super) fn names(self) -> &'static str {
        match self {
            Self::Steps => "SpacingBetweenSlices and GridFrameOffsetVector",
            Self::Places => "ImagePositionPatient",
            Self::Grid => "ImagePositionPatient and PixelSpacing",
        }
    }
}

/// How the frames of a file without groups of elements for each lie.
enum Places {
    /// Each states its own position.
    Own,
    /// Offsets along the normal.
    Offsets(Vec<f64>),
    /// Coordinates along the patient's z axis.
    Absolute(Vec<f64>),
    /// A step along the normal from slice to slice, or the slices' thickness; and the slice of each frame, if frames are not simply one after the other.
    Steps(Option<f64>, Option<Vec<u16>>),
}

/// The places of a classic file's frames, and the element without which they were assumed.
fn places(data: &Dataset, count: usize) -> Result<(Places, Option<Assumed>), VolumeError> {
    // PS3.3 C.8.8.3.2: offsets if the first number is 0, else coordinates, of which the first is the image's.
    if let Some(offsets) = data.list(tags::OFFSETS, count)? {
        let is_relative = offsets[0] == 0.0;
        return Ok((if is_relative { Places::Offsets(offsets) } else { Places::Absolute(offsets) }, None));
    }
    // C.8.4.15: negative if slices run against the normal.
    let step = data.numbers(tags::SPACING_BETWEEN_SLICES)?.map(|[step]| step).filter(|&step| step != 0.0);
    let slices = data.shorts(tags::SLICE_VECTOR);
    if let Some(slices) = slices.as_ref().filter(|slices| slices.len() != count || slices.contains(&0)) {
        let found = format!("{} numbers", slices.len());
        return Err(data.invalid(tags::SLICE_VECTOR, found, format!("{count} numbers from 1 on, one per frame")));
    }
    let is_stated = are_placed(data);
    let assumed = match (is_stated, step) {
        (false, _) => Some(Assumed::Places),
        (true, None) => Some(Assumed::Steps),
        (true, Some(_)) => None,
    };
    Ok((Places::Steps(step, slices), assumed))
}
