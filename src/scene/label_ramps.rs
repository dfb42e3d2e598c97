//! Ramps of label maps whose numbers take more than 16 bits: scenes speak the file's numbers, and values are their places among all ([`Volume::label_ids`]).

use std::ops::{Add, Mul};

use crate::settings::transfer_function::{Ramp, TransferFunction};
use crate::volume::Volume;

/// An interval without a label.
const NOWHERE: [f64; 2] = [-1.0, -1.0];

/// A place and the number that it stands for, in ascending order; `None` if a volume's values are no places.
fn places_and_ids(volume: &Volume) -> Option<impl Iterator<Item = (f64, f64)>> {
    // Pages take such numbers for values.
    let ids = volume.label_ids().filter(|_| cfg!(not(target_arch = "wasm32")) && volume.labels().is_none())?;
    Some((0_u32..).zip(ids).map(|(place, &id)| (f64::from(place), id as f64)))
}

/// A transfer function over places, of which the colours, the opacities and the intervals may be over the file's numbers.
pub(super) fn by_place(transfer: TransferFunction, volume: &Volume, are_by_id: [bool; 2]) -> TransferFunction {
    match places_and_ids(volume) {
        Some(pairs) => moved(transfer, &pairs.collect::<Vec<_>>(), are_by_id),
        None => transfer,
    }
}

/// A transfer function over the file's numbers, from one over places.
pub(super) fn by_id(transfer: TransferFunction, volume: &Volume) -> TransferFunction {
    match places_and_ids(volume) {
        Some(pairs) => moved(transfer, &pairs.map(|(place, id)| (id, place)).collect::<Vec<_>>(), [true; 2]),
        None => transfer,
    }
}

/// Intervals, and colours and opacities if they are to be, at other positions: each of these behind its new one.
fn moved(
    transfer: TransferFunction,
    positions: &[(f64, f64)],
    [colors_are, opacities_are]: [bool; 2],
) -> TransferFunction {
    let range = |&[low, high]: &[f64; 2]| {
        let first = positions.partition_point(|&(_, from)| from < low);
        let end = positions.partition_point(|&(_, from)| from <= high);
        (first < end).then(|| [positions[first].0, positions[end - 1].0])
    };
    let ranges = |ranges: Vec<[f64; 2]>| {
        let ranges: Vec<[f64; 2]> = ranges.iter().filter_map(range).collect();
        if ranges.is_empty() { vec![NOWHERE] } else { ranges }
    };
    TransferFunction {
        color: if colors_are { sampled(&transfer.color, positions) } else { transfer.color },
        opacity: if opacities_are { sampled(&transfer.opacity, positions) } else { transfer.opacity },
        iso_ranges: transfer.iso_ranges.map(ranges),
        ..transfer
    }
}

/// A ramp through the values of another one. Points between equal ones are left out, and so are those of numbers that are one as `f64`.
fn sampled<T>(ramp: &Ramp<T>, positions: &[(f64, f64)]) -> Ramp<T>
where
    T: Copy + PartialEq + Add<Output = T> + Mul<f64, Output = T>,
{
    let mut points = Vec::<(f64, T)>::new();
    for &(at, from) in positions {
        let value = ramp.at(from);
        match points.as_slice() {
            [.., (last, _)] if *last >= at => continue,
            [.., (_, before), (_, last)] if *before == value && *last == value => {
                points.pop();
            }
            _ => {}
        }
        points.push((at, value));
    }
    Ramp::through(points)
}
