//! Light sheets (SPEC §14): `T_{k+1} = B(T_k·exp(-a_k))` slab by slab, and T at a point.

use glam::{DVec3, DVec4};

use super::band::Band;
use super::box_filter::{Area, BoxFilter};
use super::matter::LightMatter;
use super::splat::Splatter;
use super::view::LightView;
use crate::kernel::Kernel;
use crate::parallel::prelude::*;
use crate::volume::Grid;

/// Where a grid's voxel (0, 0, 0) lies, in `unit`s from the world's origin.
fn first_voxel(grid: &Grid) -> DVec3 {
    grid.place() / grid.unit() - grid.center() * grid.aspect()
}

/// The light that each plane gets from one direction.
#[derive(Clone, Debug)]
pub struct LightSheets {
    /// Rows whose products with positions (x, y, z, 1), in `unit`s from the world's origin, are places as [`Self::rows`] tells.
    place: [DVec4; 3],
    /// The pixels along each side of a plane.
    pub side: usize,
    /// The number of the first plane, before the first slab that any kernel touches.
    pub first: i32,
    planes: usize,
    /// T, plane by plane and row by row: a plane more than there are slabs. Empty if no voxel takes part.
    pub light: Vec<f32>,
}

/// Sheets while they are made.
struct Growing {
    filter: BoxFilter,
    /// The pixels of the last plane that may have lost light.
    area: Area,
    light: Vec<f32>,
}

impl LightSheets {
    /// The sheets of a view, for each spread given as a variance in pixels² per slab, in memory that may be used again.
    pub(super) fn new<const N: usize>(
        matter: &LightMatter,
        light: &LightView,
        kernel: &Kernel,
        variances: [f64; N],
        mut memory: [Vec<f32>; N],
    ) -> [Self; N] {
        let slabs = light.slabs(&matter.bricks);
        let ([x, y, plane], side) = (light.place, light.side);
        let rows = [x, y, plane - DVec4::W * f64::from(slabs.start)];
        let (aspect, first) = (matter.grid.aspect(), first_voxel(&matter.grid));
        let place = rows.map(|row| {
            let of_position = row.truncate() / aspect;
            of_position.extend(row.w - of_position.dot(first))
        });
        if slabs.is_empty() {
            return variances.map(|_| Self { place, side, first: 0, planes: 0, light: Vec::new() });
        }
        let (pixels, count) = (side * side, slabs.len());
        let mut number = 0;
        let mut stacks = variances.map(|variance| {
            let mut light = std::mem::take(&mut memory[number]);
            number += 1;
            light.resize(pixels * (count + 1), 1.0);
            light.par_chunks_mut(pixels).for_each(|plane| plane.fill(1.0));
            Growing { filter: BoxFilter::new(variance), area: Area::NONE, light }
        });
        let splatter = Splatter::new(matter, light, kernel, slabs.start);
        let (mut bands, height) = Band::<N>::all(&splatter);
        for (k, begun) in splatter.begun(count).into_iter().enumerate() {
            for Growing { filter, area, .. } in &mut stacks {
                *area = area.and(begun).grown(filter.reach(), side);
            }
            let planes = stacks.each_ref().map(|stack| &stack.light[k * pixels..(k + 1) * pixels]);
            bands.par_iter_mut().for_each(|band| {
                band.draw(&splatter, k, &planes);
                for ((Growing { filter, area, .. }, plane), number) in stacks.iter().zip(planes).zip(0..) {
                    band.spread(number, (filter, area), plane);
                }
            });
            let bands = &bands;
            for (number, Growing { filter, area, light }) in stacks.iter_mut().enumerate() {
                let (rows, columns) = (area.low[1]..area.end[1], area.low[0]..area.end[0]);
                if area.is_empty() {
                    continue;
                }
                let plane = &mut light[(k + 1) * pixels..][..pixels];
                plane.par_chunks_mut(side).enumerate().with_min_len(height).for_each(|(y, to)| {
                    let row = |offset: isize| {
                        let y = y.checked_add_signed(offset).filter(|y| *y < side)?;
                        Some(&bands[y / height].along[number][y % height * side..][..side])
                    };
                    if rows.contains(&y) {
                        filter.down(columns.clone(), row, to);
                    }
                });
            }
        }
        stacks.map(|stack| Self { place, side, first: slabs.start, planes: count + 1, light: stack.light })
    }

    /// Sheets that were stored, given where positions are among them, the pixels along each side of a plane, the number of the first plane, and how many there
    /// are.
    #[cfg(feature = "codecs")]
    pub(crate) fn stored(place: [DVec4; 3], side: usize, (first, planes): (i32, usize), light: Vec<f32>) -> Self {
        Self { place, side, first, planes, light }
    }

    /// Rows whose products with positions (x, y, z, 1), in `unit`s from the world's origin, are places as [`Self::rows`] tells.
    #[cfg(feature = "codecs")]
    pub(crate) fn place(&self) -> [DVec4; 3] {
        self.place
    }

    /// The number of planes; 0 if no voxel takes part.
    pub fn planes(&self) -> usize {
        self.planes
    }

    /// Rows whose products with voxel coordinates (i, j, k, 1) of a grid of the volume, of any level or box, are where a point is looked up: in pixels right of
    /// the first one's centre and below it, and in planes from the first one on.
    pub fn rows(&self, grid: &Grid) -> [DVec4; 3] {
        let (aspect, first) = (grid.aspect(), first_voxel(grid));
        self.place.map(|row| (row.truncate() * aspect).extend(row.w + row.truncate().dot(first)))
    }

    /// T at a place as [`Self::rows`] gives it: bilinear between pixel centres, 1 beyond the image, linear between planes, and that of the first and the last
    /// plane beyond them.
    pub fn at_place(&self, [x, y, plane]: [f32; 3]) -> f32 {
        let Some(last) = self.planes().checked_sub(1) else { return 1.0 };
        let plane = plane.clamp(0.0, last as f32);
        // Casts round towards 0, which is down from here on.
        let near = plane as usize;
        let far = (near + 1).min(last);
        let [a, b] = match x >= 0.0 && y >= 0.0 && x < (self.side - 1) as f32 && y < (self.side - 1) as f32 {
            true => self.inside([near, far], [x, y]),
            false => [near, far].map(|plane| self.beside(plane, [x, y])),
        };
        a + (b - a) * (plane - near as f32)
    }

    /// T in two planes between four pixels.
    fn inside(&self, planes: [usize; 2], [x, y]: [f32; 2]) -> [f32; 2] {
        let (left, top) = (x as usize, y as usize);
        let (right, down) = (x - left as f32, y - top as f32);
        planes.map(|plane| {
            let at = (plane * self.side + top) * self.side + left;
            let row = |at: usize| self.light[at] + (self.light[at + 1] - self.light[at]) * right;
            let (upper, lower) = (row(at), row(at + self.side));
            upper + (lower - upper) * down
        })
    }

    /// T in a plane at its border, or beyond.
    fn beside(&self, plane: usize, [x, y]: [f32; 2]) -> f32 {
        let side = self.side as i64;
        let at = |x: i64, y: i64| {
            let is_inside = (0..side).contains(&x) && (0..side).contains(&y);
            if is_inside { self.light[plane * self.side * self.side + (y * side + x) as usize] } else { 1.0 }
        };
        // Far beyond the image there is as much light as beside it.
        let [x, y] = [x, y].map(|at| at.clamp(-2.0, side as f32 + 1.0));
        let (left, top) = (libm::floorf(x), libm::floorf(y));
        let (right, down) = (x - left, y - top);
        let row = |y: i64| {
            let (a, b) = (at(left as i64, y), at(left as i64 + 1, y));
            a + (b - a) * right
        };
        let (upper, lower) = (row(top as i64), row(top as i64 + 1));
        upper + (lower - upper) * down
    }
}
