//! Marks that tell images at one place apart: times, b-values, echoes, types.

use std::cmp::Ordering;
use std::sync::Arc;

use super::super::text::number;
use super::dataset::{Dataset, Tag, name, tags};

/// An element by which images at one place differ.
pub(super) struct Mark {
    tag: Tag,
    /// The sequences that hold it in a frame's group of elements; empty if it has no place there.
    within: &'static [Tag],
    /// Whether it parts channels, not times.
    pub(super) is_channel: bool,
}

/// The elements, the clearest first.
pub(super) const MARKS: [Mark; 19] = [
    Mark { tag: tags::TEMPORAL_POSITION, within: &[], is_channel: false },
    Mark { tag: tags::TEMPORAL_INDEX, within: &[tags::FRAME_CONTENT], is_channel: false },
    Mark { tag: tags::ECHO_NUMBERS, within: &[], is_channel: true },
    Mark { tag: tags::ECHO_TIME, within: &[], is_channel: true },
    Mark { tag: tags::EFFECTIVE_ECHO_TIME, within: &[tags::ECHO], is_channel: true },
    Mark { tag: tags::COMPLEX_COMPONENT, within: &[tags::MR_FRAME_TYPE], is_channel: true },
    Mark { tag: tags::FRAME_TYPE, within: &[tags::MR_FRAME_TYPE], is_channel: true },
    Mark { tag: tags::IMAGE_TYPE, within: &[], is_channel: true },
    Mark { tag: tags::ENERGY_WINDOW_VECTOR, within: &[], is_channel: true },
    Mark { tag: tags::B_VALUE, within: &[tags::DIFFUSION], is_channel: false },
    Mark { tag: tags::GRADIENT, within: &[tags::DIFFUSION, tags::GRADIENTS], is_channel: false },
    Mark { tag: tags::TRIGGER_DELAY, within: &[tags::CARDIAC], is_channel: false },
    Mark { tag: tags::TRIGGER_TIME, within: &[], is_channel: false },
    Mark { tag: tags::FRAME_REFERENCE_TIME, within: &[], is_channel: false },
    Mark { tag: tags::PHASE_VECTOR, within: &[], is_channel: false },
    Mark { tag: tags::TIME_SLOT_VECTOR, within: &[], is_channel: false },
    Mark { tag: tags::TIME_SLICE_VECTOR, within: &[], is_channel: false },
    Mark { tag: tags::ACQUISITION_NUMBER, within: &[], is_channel: false },
    Mark { tag: tags::ACQUISITION_TIME, within: &[], is_channel: false },
];

/// Marks whose values are binary numbers.
const BINARY: [Tag; 5] =
    [tags::TEMPORAL_INDEX, tags::EFFECTIVE_ECHO_TIME, tags::B_VALUE, tags::GRADIENT, tags::TRIGGER_DELAY];

/// Marks that are a number for every frame of the file.
const VECTORS: [Tag; 4] =
    [tags::ENERGY_WINDOW_VECTOR, tags::PHASE_VECTOR, tags::TIME_SLOT_VECTOR, tags::TIME_SLICE_VECTOR];

impl Mark {
    pub(super) fn name(&self) -> &'static str {
        name(self.tag).unwrap_or_default()
    }
}

/// The values of marks, by their numbers.
pub(super) type Marked = Vec<(usize, Arc<str>)>;

/// The marks that a file states for all its frames.
pub(super) fn of_file(data: &Dataset) -> Marked {
    let of = |mark: &Mark| if VECTORS.contains(&mark.tag) { None } else { value(data, mark.tag) };
    (0..).zip(&MARKS).filter_map(|(at, mark)| Some((at, of(mark)?))).collect()
}

/// The marks that a file states for one of its frames, given the frame's group of elements.
pub(super) fn of_frame(data: &Dataset, group: Option<&Dataset>, frame: usize) -> Marked {
    let of = |mark: &Mark| {
        if VECTORS.contains(&mark.tag) {
            return data.shorts(mark.tag)?.get(frame).map(|number| number.to_string().into());
        }
        let mut item = group.filter(|_| !mark.within.is_empty())?;
        for &sequence in mark.within {
            item = item.items(sequence).first()?;
        }
        value(item, mark.tag)
    };
    (0..).zip(&MARKS).filter_map(|(at, mark)| Some((at, of(mark)?))).collect()
}

fn value(data: &Dataset, tag: Tag) -> Option<Arc<str>> {
    let value = if BINARY.contains(&tag) { data.binary(tag) } else { data.text(tag) };
    value.map(Arc::from)
}

/// The order of two values: that of their numbers, or else of their texts.
pub(super) fn order(a: &str, b: &str) -> Ordering {
    let numbers = |text: &str| text.split('\\').map(number).collect::<Option<Vec<f64>>>();
    match (numbers(a), numbers(b)) {
        (Some(a), Some(b)) => a.partial_cmp(&b).unwrap_or(Ordering::Equal),
        _ => Ordering::Equal,
    }
    .then_with(|| a.cmp(b))
}
