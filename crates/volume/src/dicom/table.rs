//! The table that gives the values of samples (PS3.3 C.11.1, `ModalityLUTSequence`).

use super::super::VolumeError;
use super::super::sample_type::{Sample, SampleType, for_sample_type};
use super::dataset::{Dataset, tags};

/// The values of whole numbers from the first one on; those before and behind have the first or the last value.
pub(super) struct Table {
    first: i64,
    values: Vec<u16>,
}

impl Table {
    /// Reads a table, given the item of the sequence.
    pub(super) fn read(item: &Dataset, is_signed: bool) -> Result<Self, VolumeError> {
        let allowed = "the number of values, the first sample, and 8 or 16 bits";
        let stated = item.shorts(tags::LUT_DESCRIPTOR).ok_or_else(|| item.missing(tags::LUT_DESCRIPTOR, allowed))?;
        let &[count, first, bits @ (8 | 10..=16)] = stated.as_slice() else {
            return Err(item.invalid(tags::LUT_DESCRIPTOR, format!("{stated:?}"), allowed));
        };
        // 65536 does not fit.
        let count = if count == 0 { 1 << 16 } else { usize::from(count) };
        let allowed = format!("{count} numbers of {bits} bits");
        let words = item.shorts(tags::LUT_DATA).ok_or_else(|| item.missing(tags::LUT_DATA, &allowed))?;
        // Numbers of 8 bits lie two by two in words, or each in one of its own.
        let values: Vec<u16> = match words.len() {
            length if length == count => words,
            length if bits == 8 && length == count.div_ceil(2) => {
                words.iter().flat_map(|word| [word & 0xff, word >> 8]).take(count).collect()
            }
            length => return Err(item.invalid(tags::LUT_DATA, format!("{} bytes", 2 * length), allowed)),
        };
        let first = if is_signed { i64::from(first.cast_signed()) } else { i64::from(first) };
        Ok(Self { first, values })
    }

    /// The values of a frame's samples, as numbers of 16 bits in the machine's byte order.
    pub(super) fn values_of(&self, samples: &[u8], kind: SampleType) -> Vec<u8> {
        let last = self.values.len() as i64 - 1;
        for_sample_type!(kind, Number => {
            let samples = samples.as_chunks().0.iter().map(|&sample| Number::from_ne_bytes(sample));
            samples.flat_map(|sample| {
                let at = (sample.to_f64() as i64).saturating_sub(self.first).clamp(0, last);
                self.values[at as usize].to_ne_bytes()
            }).collect()
        })
    }
}
