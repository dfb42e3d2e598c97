//! The depths at which an opacity is reached (first hits), as in `shaders/first_hit.wgsl`.

use super::cut::TileRays;
use super::ray::PixelRays;
use super::sheets::Buffers;

/// The first hits of a tile's pixels, row by row: world units along the view direction, from the eye; orthographic from the plane through the camera's
/// centre. Infinite where the opacity is not reached.
pub(super) fn depths(buffers: &Buffers, tile: &TileRays, rays: &PixelRays, origin: [usize; 2], unit: f64) -> Vec<f32> {
    let pixels =
        buffers.hits.iter().enumerate().flat_map(|(y, row)| row.iter().enumerate().map(move |(x, hit)| (x, y, *hit)));
    let depth = |(x, y, hit): (usize, usize, f32)| match hit.is_finite() {
        true => (rays.of([origin[0] + x, origin[1] + y]).depth(tile.slab(hit)) * unit) as f32,
        false => f32::INFINITY,
    };
    pixels.map(depth).collect()
}
