//! The borders of regions, by which labels are told from amounts.

use super::Volume;
use crate::parallel::prelude::*;

/// Whether regions of a volume have sharp borders, as those of labels do. Where a voxel's neighbours on an axis differ, it has a
/// third value in at most a third of all cases; in images mostly. At least half of the pairs of neighbours that are not background are equal.
pub fn are_sharp(volume: &Volume, background: f32) -> bool {
    Borders::of(volume, background).are_sharp()
}

/// The maximum number of rows that are examined, and their distance.
const MOST_ROWS: u64 = 8192;
const PRIME: u64 = 1_000_003;

/// Counts of how values change between neighbours along the axes.
#[derive(Clone, Copy, Default)]
struct Borders {
    /// Voxels between two different values, and those of them that have a third value.
    between: [u64; 2],
    /// Pairs of neighbours that are not both background, and the equal ones among them.
    pairs: [u64; 2],
}

impl Borders {
    /// Counts in a sample of the volume's rows.
    fn of(volume: &Volume, background: f32) -> Self {
        let (dims, values) = (volume.dims(), volume.values());
        let [nx, ny, nz] = dims.to_array().map(|n| n as usize);
        let steps = [(1, nx), (nx, ny), (nx * ny, nz)];
        let row = |row: usize| {
            let mut borders = Self::default();
            for x in 0..nx {
                let at = row * nx + x;
                if values.at(at).is_nan() {
                    continue;
                }
                for ((step, count), place) in steps.into_iter().zip([x, row % ny, row / ny]) {
                    if place + 1 == count {
                        continue;
                    }
                    let [here, next] = [values.at(at), values.at(at + step)];
                    if next.is_nan() {
                        continue;
                    }
                    if here != background || next != background {
                        borders.pairs[0] += 1;
                        borders.pairs[1] += u64::from(here == next);
                    }
                    if place > 0 && !values.at(at - step).is_nan() && values.at(at - step) != next {
                        borders.between[0] += 1;
                        borders.between[1] += u64::from(here != next && here != values.at(at - step));
                    }
                }
            }
            borders
        };
        // The distance is prime, so that the rows are spread over the volume.
        let rows = (ny * nz) as u64;
        let place = |at: u64| if rows > MOST_ROWS { at * PRIME % rows } else { at };
        let looked_at = (0..rows.min(MOST_ROWS)).into_par_iter().map(|at| place(at) as usize);
        looked_at.map(row).reduce(Self::default, Self::and)
    }

    fn and(self, other: Self) -> Self {
        let sum = |a: [u64; 2], b: [u64; 2]| [a[0] + b[0], a[1] + b[1]];
        Self { between: sum(self.between, other.between), pairs: sum(self.pairs, other.pairs) }
    }

    fn are_sharp(&self) -> bool {
        3 * self.between[1] <= self.between[0] && 2 * self.pairs[1] >= self.pairs[0]
    }
}
