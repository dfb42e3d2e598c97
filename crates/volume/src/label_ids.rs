//! Labels as files number them: ids, whole numbers of up to 64 bits, of which a volume keeps 16 bits a voxel.

use std::collections::{BTreeMap, TryReserveError};
use std::path::Path;
use std::sync::Arc;

use super::error::volume::{VolumeError, invalid};
use super::sample_type::{Sample, SampleType};
use super::voxel::{Many, Voxel};

/// The number of different labels that 16 bits tell apart.
const MOST: usize = 1 << 16;

/// The ids of many voxels, each kept as the place of its id among those that came before.
#[derive(Debug, Default)]
pub(super) struct LabelIds {
    places: Vec<u16>,
    /// The different ids in the order in which they came.
    ids: Vec<u64>,
    place_of: BTreeMap<u64, u16>,
    /// The first id for which no place was left.
    left_out: Option<u64>,
}

/// Labels in memory, and what they stand for.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Numbered {
    pub(super) labels: Vec<u16>,
    /// The ids of the labels from 0 on, in ascending order; `None` if labels are ids themselves. Label 0 is id 0 in any case.
    pub(super) ids: Option<Arc<[u64]>>,
}

impl LabelIds {
    /// The labels: the ids themselves if 16 bits hold all of them, or else their places among all in ascending order.
    ///
    /// # Errors
    /// If there are more different labels than 16 bits tell apart. The error names the file.
    pub(super) fn numbered(self, path: &Path) -> Result<Numbered, VolumeError> {
        let no_label = (!self.place_of.contains_key(&0)).then_some(0);
        let ids: Vec<u64> = no_label.into_iter().chain(self.place_of.keys().copied()).collect();
        if self.left_out.is_some() || ids.len() > MOST {
            let found = format!("more than {MOST} different labels");
            return Err(invalid(path, "data", found, format!("at most {MOST}, 0 among them")));
        }
        let is_direct = ids.last().is_none_or(|&last| last < MOST as u64);
        let label = |id: &u64| if is_direct { *id as u16 } else { ids.partition_point(|other| other < id) as u16 };
        let label_of: Vec<u16> = self.ids.iter().map(label).collect();
        let mut labels = self.places;
        labels.iter_mut().for_each(|place| *place = label_of[usize::from(*place)]);
        Ok(Numbered { labels, ids: (!is_direct).then(|| ids.into()) })
    }

    fn place(&mut self, id: u64) -> u16 {
        if let Some(&place) = self.place_of.get(&id) {
            return place;
        }
        if self.ids.len() == MOST {
            self.left_out = Some(id);
            return 0;
        }
        let place = self.ids.len() as u16;
        self.ids.push(id);
        self.place_of.insert(id, place);
        place
    }
}

impl From<Vec<u64>> for LabelIds {
    fn from(ids: Vec<u64>) -> Self {
        let mut all = Self::default();
        all.extend(&ids);
        all
    }
}

impl LabelIds {
    fn extend(&mut self, ids: &[u64]) {
        // Neighbours mostly have one label.
        let mut last = None;
        for &id in ids {
            let place = match last {
                Some((same, place)) if same == id => place,
                _ => self.place(id),
            };
            last = Some((id, place));
            self.places.push(place);
        }
    }
}

impl Many<u64> for LabelIds {
    fn count(&self) -> usize {
        self.places.len()
    }

    fn at(&self, index: usize) -> u64 {
        self.ids[usize::from(self.places[index])]
    }

    fn try_reserve_exact(&mut self, count: usize) -> Result<(), TryReserveError> {
        self.places.try_reserve_exact(count)
    }

    fn append(&mut self, voxels: &[u64]) -> Result<(), TryReserveError> {
        self.places.try_reserve(voxels.len())?;
        self.extend(voxels);
        Ok(())
    }

    fn shrink_to_fit(&mut self) {
        self.places.shrink_to_fit();
    }

    #[cfg(feature = "tiff")]
    fn swap(&mut self, first: usize, other: usize, count: usize) {
        super::values::swap(&mut self.places, first, other, count);
    }
}

/// The id of a label.
impl Voxel for u64 {
    type Many = LabelIds;

    const ALLOWED: &'static str = "labels, whole numbers from 0 on";
    const HOLE: Self = 0;
    const HOLDS_ALL: bool = false;

    fn of(sample: impl Sample) -> Option<Self> {
        sample.to_id()
    }

    /// The nearer of the two labels.
    fn between(self, other: Self, part: f64) -> Self {
        if part < 0.5 { self } else { other }
    }

    fn bytes(_: SampleType, _: bool) -> u64 {
        size_of::<u16>() as u64
    }
}

/// The label that stands for an id, if any does.
pub(super) fn label_of(id: u64, ids: Option<&[u64]>) -> Option<u16> {
    match ids {
        None => id.try_into().ok(),
        Some(ids) => ids.binary_search(&id).ok().and_then(|label| label.try_into().ok()),
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;

    fn numbered(ids: &[u64]) -> Result<Numbered, VolumeError> {
        LabelIds::from(ids.to_vec()).numbered(Path::new("a.nrrd"))
    }

    #[test]
    fn small_ids_are_labels_themselves() {
        let found = numbered(&[7, 7, 0, 65_535, 7]).unwrap();
        assert_eq!(found, Numbered { labels: vec![7, 7, 0, 65_535, 7], ids: None });
    }

    #[test]
    fn large_ids_are_numbered_in_ascending_order() {
        let largest = u64::MAX;
        let found = numbered(&[largest, 312_782_546, 0, 312_782_546, 997, largest - 1]).unwrap();
        assert_eq!(found.labels, [4, 2, 0, 2, 1, 3]);
        assert_eq!(found.ids.as_deref(), Some(&[0, 997, 312_782_546, largest - 1, largest][..]));
        // Label 0 is id 0, be there a voxel of it or not.
        assert_eq!(numbered(&[70_000]).unwrap().labels, [1]);
    }

    #[test]
    fn more_labels_than_16_bits_tell_apart_are_refused() {
        let most: Vec<u64> = (0..65_535).map(|at| 100_000 + at).collect();
        assert_eq!(numbered(&most).unwrap().labels[65_534], 65_535);
        let more: Vec<u64> = (0..65_536).map(|at| 100_000 + at).collect();
        let message = numbered(&more).unwrap_err().to_string();
        assert!(message.starts_with("a.nrrd: data: found more than 65536 different labels, allowed:"), "{message}");
        let many_more: Vec<u64> = (0..70_000).collect();
        assert!(numbered(&many_more).is_err());
    }

    #[test]
    fn ids_are_whole_and_exact() {
        assert_eq!(u64::of(u64::MAX), Some(u64::MAX));
        assert_eq!(u64::of(9_007_199_254_740_993_i64), Some(9_007_199_254_740_993));
        assert_eq!(u64::of(18_446_744_073_709_549_568.0_f64), Some(18_446_744_073_709_549_568));
        assert_eq!((u64::of(-0.0_f32), u64::of(3_i8)), (Some(0), Some(3)));
        assert_eq!([u64::of(-1_i8), u64::of(-1_i64), u64::of(-1.0_f32)], [None; 3]);
        assert_eq!([u64::of(0.5_f64), u64::of(f64::NAN), u64::of(f64::INFINITY), u64::of(2e19_f64)], [None; 4]);
    }
}
