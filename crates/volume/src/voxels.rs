//! The voxels of a file while it is read: values, or ids of labels. Readers are compiled once for both.

use std::collections::TryReserveError;

use super::label_ids::LabelIds;
use super::sample_type::SampleType;
use super::values::Values;
use super::voxel::{Many, Voxel};

/// The numbers that a file's samples become.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Wanted {
    Values,
    /// Ids of labels.
    Ids,
}

impl Wanted {
    /// None of these numbers.
    pub(super) fn none(self) -> Voxels {
        match self {
            Self::Values => Voxels::Values(Values::default()),
            Self::Ids => Voxels::Ids(LabelIds::default()),
        }
    }

    /// The greatest number of bytes that the number of a sample takes among others.
    pub(super) fn bytes(self, kind: SampleType, is_rescaled: bool) -> u64 {
        match self {
            Self::Values => f32::bytes(kind, is_rescaled),
            Self::Ids => u64::bytes(kind, is_rescaled),
        }
    }

    /// The number of bytes of such a number alone.
    pub(super) fn alone(self) -> u64 {
        match self {
            Self::Values => size_of::<f32>() as u64,
            Self::Ids => size_of::<u64>() as u64,
        }
    }
}

/// Many voxels of one kind.
#[derive(Debug)]
pub(super) enum Voxels {
    Values(Values),
    Ids(LabelIds),
}

/// Evaluates an expression for voxels of either kind.
macro_rules! for_voxels {
    ($voxels:expr, $many:ident => $result:expr) => {
        match $voxels {
            Voxels::Values($many) => $result,
            Voxels::Ids($many) => $result,
        }
    };
}

impl From<Values> for Voxels {
    fn from(values: Values) -> Self {
        Self::Values(values)
    }
}

impl From<LabelIds> for Voxels {
    fn from(ids: LabelIds) -> Self {
        Self::Ids(ids)
    }
}

impl Voxels {
    /// The values of a file that was read for them.
    pub(super) fn into_values(self) -> Values {
        match self {
            Self::Values(values) => values,
            Self::Ids(_) => unreachable!("ids where values were wanted"),
        }
    }

    /// The ids of a file that was read for them.
    pub(super) fn into_ids(self) -> LabelIds {
        match self {
            Self::Ids(ids) => ids,
            Self::Values(_) => unreachable!("values where ids were wanted"),
        }
    }

    /// No voxels of the same kind.
    pub(super) fn none_alike(&self) -> Self {
        match self {
            Self::Values(_) => Wanted::Values.none(),
            Self::Ids(_) => Wanted::Ids.none(),
        }
    }

    pub(super) fn count(&self) -> usize {
        for_voxels!(self, many => many.count())
    }

    /// Makes room for further voxels.
    ///
    /// # Errors
    /// If there is no memory for them.
    pub(super) fn try_reserve_exact(&mut self, count: usize) -> Result<(), TryReserveError> {
        for_voxels!(self, many => Many::try_reserve_exact(many, count))
    }

    pub(super) fn shrink_to_fit(&mut self) {
        for_voxels!(self, many => Many::shrink_to_fit(many));
    }

    /// Exchanges two runs of `count` voxels, of which the first one ends before the other begins.
    #[cfg(feature = "tiff")]
    pub(super) fn swap(&mut self, first: usize, other: usize, count: usize) {
        for_voxels!(self, many => Many::swap(many, first, other, count));
    }

    /// Appends those of others of the same kind that have some indices.
    ///
    /// # Errors
    /// If there is no memory for them. Those before may be lost then.
    pub(super) fn append_from(
        &mut self,
        others: &Self,
        indices: impl Iterator<Item = usize>,
    ) -> Result<(), TryReserveError> {
        /// The voxels that are copied at a time.
        const BLOCK: usize = 1 << 12;
        let (mut indices, mut block) = (indices, Vec::with_capacity(BLOCK));
        loop {
            block.clear();
            block.extend(indices.by_ref().take(BLOCK));
            if block.is_empty() {
                return Ok(());
            }
            self.append_block(others, &block)?;
        }
    }

    fn append_block(&mut self, others: &Self, indices: &[usize]) -> Result<(), TryReserveError> {
        match (self, others) {
            (Self::Values(values), Self::Values(others)) => append(values, others, indices),
            (Self::Ids(ids), Self::Ids(others)) => append(ids, others, indices),
            _ => unreachable!("values among ids"),
        }
    }
}

#[cfg(test)]
impl From<Vec<f32>> for Voxels {
    fn from(values: Vec<f32>) -> Self {
        Self::Values(values.into())
    }
}

#[cfg(test)]
impl From<Vec<u64>> for Voxels {
    fn from(ids: Vec<u64>) -> Self {
        Self::Ids(ids.into())
    }
}

#[cfg(test)]
impl Voxels {
    /// The values; none if these are ids.
    pub(super) fn values(&self) -> super::value_slice::ValueSlice<'_> {
        match self {
            Self::Values(values) => values.as_slice(),
            Self::Ids(_) => [0.0_f32; 0].as_slice().into(),
        }
    }

    /// The ids; none if these are values.
    pub(super) fn ids(&self) -> Vec<u64> {
        match self {
            Self::Values(_) => Vec::new(),
            Self::Ids(ids) => (0..ids.count()).map(|at| ids.at(at)).collect(),
        }
    }
}

fn append<T>(many: &mut impl Many<T>, others: &impl Many<T>, indices: &[usize]) -> Result<(), TryReserveError> {
    let voxels: Vec<T> = indices.iter().map(|&index| others.at(index)).collect();
    many.append(&voxels)
}
