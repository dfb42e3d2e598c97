//! Unions over spheres around voxels: which voxels have one of a set nearer to them than a distance, 64 voxels of a row at a time.

use std::ops::Range;

use glam::UVec3;

use crate::lists::brick;
use crate::lists::iso_range::ordinal;
use crate::parallel::prelude::*;
use crate::volume::ValueSlice;

/// Voxels in a word.
const WORD: usize = u64::BITS as usize;

/// A set of voxels: a bit for each, row by row along x.
pub(super) struct VoxelSet {
    dims: UVec3,
    words: Vec<u64>,
}

/// The whole offsets from a voxel that a sphere around it holds: the rows of its section across x, by how far they reach along x.
pub(super) struct Sphere(Vec<Vec<[i32; 2]>>);

impl Sphere {
    /// The offsets whose squares are at most a number.
    pub(super) fn new(squared: u32) -> Self {
        let half = squared.isqrt() as i32;
        let mut rows = vec![Vec::new(); half as usize + 1];
        for [y, z] in (-half..=half).flat_map(|z| (-half..=half).map(move |y| [y, z])) {
            if let Some(rest) = squared.checked_sub((y * y + z * z) as u32) {
                rows[rest.isqrt() as usize].push([y, z]);
            }
        }
        Self(rows)
    }
}

impl VoxelSet {
    /// The voxels of a grid whose values have ordinals in a range.
    pub(super) fn new(dims: UVec3, values: ValueSlice<'_>, ordinals: &Range<u32>) -> Self {
        let across = dims.x as usize;
        let length = ordinals.end - ordinals.start;
        let row = |row: usize| {
            let mut flags = vec![false; across];
            let values = values.slice(row * across..(row + 1) * across);
            values.flag(&mut flags, |value| ordinal(value).wrapping_sub(ordinals.start) < length);
            flags.chunks(WORD).map(brick::packed).collect::<Vec<_>>()
        };
        let rows = (dims.y * dims.z) as usize;
        Self { dims, words: (0..rows).into_par_iter().with_min_len(16).flat_map_iter(row).collect() }
    }

    /// Which voxels of a row, given by y and z, have one of the set in the sphere around them.
    pub(super) fn around(&self, [y, z]: [u32; 2], sphere: &Sphere) -> Vec<u64> {
        let count = (self.dims.x as usize).div_ceil(WORD);
        let mut all = vec![0; count];
        for (reach, rows) in sphere.0.iter().enumerate().filter(|(_, rows)| !rows.is_empty()) {
            let mut joined = vec![0; count];
            for [dy, dz] in rows {
                let (y, z) = (y.wrapping_add_signed(*dy), z.wrapping_add_signed(*dz));
                if y < self.dims.y && z < self.dims.z {
                    let row = &self.words[(y + self.dims.y * z) as usize * count..][..count];
                    joined.iter_mut().zip(row).for_each(|(joined, row)| *joined |= row);
                }
            }
            spread(&mut joined, reach);
            all.iter_mut().zip(joined).for_each(|(all, joined)| *all |= joined);
        }
        all
    }
}

/// Sets the bits up to a distance of less than a word from those that are set, to either side.
fn spread(words: &mut [u64], reach: usize) {
    let mut width = 0;
    while width < reach {
        // Without a gap even from a row's first bit, which has become width + 1 bits.
        let step = (width + 1).min(reach - width);
        let (left, right) = (|word: u64| word << step, |word: u64| word >> step);
        let carry = WORD - step;
        let mut before = 0;
        for at in 0..words.len() {
            let word = words[at];
            let next = words.get(at + 1).copied().unwrap_or(0);
            words[at] = word | left(word) | before >> carry | right(word) | next << carry;
            before = word;
        }
        width += step;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// In rows of a word, of several, and of parts of one.
    #[test]
    fn a_voxel_finds_what_a_plain_search_finds() {
        for dims in [UVec3::new(64, 5, 6), UVec3::new(150, 4, 3), UVec3::new(9, 11, 10)] {
            let count = dims.element_product();
            let at = |index: u32| UVec3::new(index % dims.x, index / dims.x % dims.y, index / dims.x / dims.y);
            let values: Vec<f32> =
                (0..count).map(|index| if index.wrapping_mul(2_654_435_761) >> 24 < 2 { 1.0 } else { 0.0 }).collect();
            let set = VoxelSet::new(dims, (&values).into(), &(ordinal(0.5)..ordinal(2.0)));
            for squared in [0, 1, 3, 24, 25, 130, 256] {
                let sphere = Sphere::new(squared);
                for index in 0..count {
                    let voxel = at(index);
                    let distance = |other: u32| (at(other).as_ivec3() - voxel.as_ivec3()).length_squared() as u32;
                    let expected = (0..count).any(|other| values[other as usize] == 1.0 && distance(other) <= squared);
                    let row = set.around([voxel.y, voxel.z], &sphere);
                    let found = row[voxel.x as usize / WORD] >> (voxel.x as usize % WORD) & 1 == 1;
                    assert_eq!(found, expected, "{dims} {voxel} {squared}");
                }
            }
        }
    }
}
