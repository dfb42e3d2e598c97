//! The pixels of a tile, over the background (SPEC §5) or, for a part of an image (SPEC §11), as the compositing buffer holds them.

use super::sheets::{Buffers, COLUMNS};
use crate::part::Resolver;

/// The pixels of a tile, row by row; without a resolver those of its compositing buffer.
pub(super) fn tile(resolver: Option<&Resolver>, buffers: &Buffers) -> Vec<[f32; 4]> {
    let pixel = |row: &[[f32; COLUMNS]; 4], x: usize| {
        let acc = [row[0][x], row[1][x], row[2][x], row[3][x]];
        resolver.map_or(acc, |resolver| resolver.pixel(acc))
    };
    buffers.acc.iter().flat_map(|row| (0..COLUMNS).map(move |x| pixel(row, x))).collect()
}
