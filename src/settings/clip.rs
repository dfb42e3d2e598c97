//! Clipping: planes and a crop box that cut parts of a volume away, through kernels. The paper does not have it; every viewer does.
//!
//! The field of the kernels is cut, ray by ray: a single stretch of a pixel's ray lies inside all planes, and a sheet counts there by the
//! fraction of its slab that the stretch covers. Cuts are as fine as slabs in any direction, and move without steps. Voxels whose
//! kernels lie entirely outside do not take part.
//!
//! A cut face shows the opened inside: gradients are those of the whole volume, and the plane's normal does not shade the face; without
//! [`Clip::shade_faces`] it has the slice's own colours. The face is as soft as kernels: a voxel in front of the plane is visible as far as its
//! kernel reaches behind it.

use std::ops::Range;

use glam::{DVec3, DVec4, UVec3};

use crate::error::setting::{Interval, SettingError};
use crate::volume::Grid;

/// The maximum number of planes, in addition to a crop box.
pub const MAX_PLANES: usize = 6;

/// What is cut away; nothing by default. A point is kept if it lies inside all planes and the box.
#[derive(Clone, Debug, PartialEq)]
pub struct Clip {
    /// At most [`MAX_PLANES`] planes; `[nx, ny, nz, d]` keeps the world points p with `n·p + d ≥ 0`. Normals have any length except 0.
    pub planes: Vec<[f64; 4]>,
    /// The corners of the box that is kept, the lower one first, in world units.
    pub crop: Option<[DVec3; 2]>,
    /// Whether cut faces are shaded, by gradients of the whole volume, which emboss noise (SPEC §3). If not, a voxel whose cell meets a plane or a
    /// face of the box has its colour as it is, and with classification after splatting the slab in which a ray enters through a cut.
    pub shade_faces: bool,
}

/// The cells that planes and the faces of a crop box cut through: those of voxels at cut faces (SPEC §3).
#[cfg(any(feature = "cpu", feature = "gpu"))]
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct CutCells {
    /// Rows whose products with (i, j, k, 1) are a voxel's distances from the planes, in extents of a cell along their normals.
    pub(crate) planes: Vec<DVec4>,
    /// The same for the box's six faces, positive inside; empty without a box.
    pub(crate) crop: Vec<DVec4>,
}

#[cfg(feature = "cpu")]
impl CutCells {
    /// Whether one is a voxel's.
    pub(crate) fn contain(&self, voxel: DVec3) -> bool {
        /// The slack of distances from planes in extents of cells, for those that meet a cell's very end.
        const FACE_SLACK: f64 = 1e-9;
        let distance = |row: &DVec4| row.dot(voxel.extend(1.0));
        let meets = |row: &DVec4| distance(row).abs() <= 0.5 + FACE_SLACK;
        let touches_box = || self.crop.iter().all(|row| distance(row) >= -0.5 - FACE_SLACK);
        self.planes.iter().any(meets) || (self.crop.iter().any(meets) && touches_box())
    }
}

impl Default for Clip {
    /// Nothing is cut away, and cut faces would be shaded.
    fn default() -> Self {
        Self { planes: Vec::new(), crop: None, shade_faces: true }
    }
}

/// One side of a plane, in `unit`s (SPEC §2): `normal·p + offset ≥ 0`, with a normal of length 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfSpace {
    /// The normal, which points to the side that is kept.
    pub normal: DVec3,
    /// The distance of the volume's centre from the plane, negative if the centre is cut away.
    pub offset: f64,
}

impl HalfSpace {
    /// Those whose intersection is a box, given its centre from a grid's, and half its size, both in grid steps.
    pub(crate) fn around(center: DVec3, half: DVec3, grid: &Grid) -> [Self; 6] {
        let [x, y, z] = DVec3::AXES;
        let (center, half) = (center * grid.aspect(), half * grid.aspect());
        [x, y, z, -x, -y, -z].map(|normal| Self { normal, offset: normal.abs().dot(half) - normal.dot(center) })
    }
}

impl Clip {
    /// Whether nothing is cut away.
    pub fn is_empty(&self) -> bool {
        self.planes.is_empty() && self.crop.is_none()
    }

    /// Checks that the values are in range.
    ///
    /// # Errors
    /// If there are too many planes, a normal is 0, a number is not finite, or a box has no volume.
    pub fn check(&self) -> Result<(), SettingError> {
        if self.planes.len() > MAX_PLANES {
            let found = format!("{} planes", self.planes.len());
            return Err(SettingError::new("clip.planes", found, format!("at most {MAX_PLANES} planes")));
        }
        for (at, plane) in self.planes.iter().enumerate() {
            let key = format!("clip.planes[{at}]");
            Interval::FINITE.check_each(&key, plane)?;
            if normalized(plane).is_none() {
                return Err(SettingError::new(key, &plane[..], "[nx, ny, nz, d] with a normal other than 0"));
            }
        }
        let Some([low, high]) = self.crop else { return Ok(()) };
        Interval::FINITE.check_each("clip.crop[0]", &low.to_array())?;
        Interval::FINITE.check_each("clip.crop[1]", &high.to_array())?;
        if !low.cmplt(high).all() {
            let found = format!("[{low}, {high}]");
            let allowed = "[[x, y, z], [x, y, z]], each number of the first below that of the second";
            return Err(SettingError::new("clip.crop", found, allowed));
        }
        Ok(())
    }

    /// The half spaces whose intersection is kept.
    pub fn half_spaces(&self, grid: &Grid) -> Vec<HalfSpace> {
        let unit = grid.unit();
        let planes = self.planes.iter().filter_map(normalized);
        let crop = self.crop.iter().flat_map(|&[low, high]| {
            DVec3::AXES.into_iter().flat_map(move |axis| [(axis, -axis.dot(low)), (-axis, axis.dot(high))])
        });
        planes
            .chain(crop)
            .map(|(normal, offset)| HalfSpace { normal, offset: (offset + normal.dot(grid.place())) / unit })
            .collect()
    }

    /// The cells of voxels that are not shaded because cuts go through them; `None` if cut faces are shaded, or nothing is cut.
    #[cfg(any(feature = "cpu", feature = "gpu"))]
    pub(crate) fn unshaded_cells(&self, grid: &Grid) -> Option<CutCells> {
        if self.shade_faces || self.is_empty() {
            return None;
        }
        let row = |HalfSpace { normal, offset }| {
            let steps = normal * grid.aspect();
            steps.extend(offset - steps.dot(grid.center())) / steps.abs().element_sum()
        };
        let mut planes: Vec<DVec4> = self.half_spaces(grid).into_iter().map(row).collect();
        let crop = planes.split_off(self.planes.len());
        Some(CutCells { planes, crop })
    }

    /// The voxels that may be visible: those whose kernels, with a radius in grid units, reach inside.
    pub fn voxels(&self, grid: &Grid, radius: f64) -> ClippedVoxels {
        let planes = self.half_spaces(grid).into_iter().map(|HalfSpace { normal, offset }| {
            // In the warped grid, where kernels are balls, in grid units.
            let warped = normal * grid.aspect();
            let row = warped.extend(offset - warped.dot(grid.center())) / warped.length();
            row + radius * DVec4::W
        });
        ClippedVoxels { planes: planes.collect() }
    }
}

/// The plane with a normal of length 1; `None` if the normal is 0.
fn normalized(plane: &[f64; 4]) -> Option<(DVec3, f64)> {
    let [x, y, z, d] = *plane;
    let normal = DVec3::new(x, y, z);
    // Scaled first, because squares overflow f64 long before the numbers do.
    let largest = normal.abs().max_element();
    let length = largest * (normal / largest).length();
    let (normal, offset) = (normal / largest / (length / largest), d / length);
    (largest > 0.0 && normal.is_finite() && offset.is_finite()).then_some((normal, offset))
}

/// The voxels whose kernels reach inside.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ClippedVoxels {
    /// Rows whose products with (i, j, k, 1) are at least 0 for these voxels.
    planes: Vec<DVec4>,
}

impl ClippedVoxels {
    /// Whether a voxel is one of them.
    pub fn contain(&self, voxel: UVec3) -> bool {
        let voxel = voxel.as_dvec3().extend(1.0);
        self.planes.iter().all(|plane| plane.dot(voxel) >= 0.0)
    }

    /// The stretch of them in a row of `length` voxels along x.
    pub fn in_row(&self, y: u32, z: u32, length: u32) -> Range<u32> {
        if self.planes.is_empty() {
            return 0..length;
        }
        let from = DVec4::new(0.0, f64::from(y), f64::from(z), 1.0);
        let (mut first, mut end) = (0.0_f64, f64::from(length));
        for plane in &self.planes {
            let crossing = -plane.dot(from) / plane.x;
            if plane.x > 0.0 {
                first = first.max(crossing);
            } else if plane.x < 0.0 {
                end = end.min(crossing + 1.0);
            }
        }
        // The estimate may be off by one, so the test of single voxels decides.
        let is_kept = |x: u32| self.contain(UVec3::new(x, y, z));
        let mut kept =
            (first - 1.0).clamp(0.0, f64::from(length)) as u32..(end + 1.0).clamp(0.0, f64::from(length)) as u32;
        while kept.start < kept.end && !is_kept(kept.start) {
            kept.start += 1;
        }
        while kept.start < kept.end && !is_kept(kept.end - 1) {
            kept.end -= 1;
        }
        kept
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;

    fn grid() -> Grid {
        Grid::new(UVec3::new(9, 7, 5), DVec3::new(2.0, 2.0, 6.0))
    }

    #[test]
    fn a_crop_box_keeps_kernels_that_reach_in() {
        let crop = Some([DVec3::new(-1.0, -1e9, -1e9), DVec3::new(3.0, 1e9, 6.0)]);
        let voxels = Clip { crop, ..Clip::default() }.voxels(&grid(), 1.25);
        // Along x, voxels are 2 apart, number 4 is the centre, and kernels add 1.25 voxels on either side.
        let kept: Vec<u32> = (0..9).filter(|&x| voxels.contain(UVec3::new(x, 3, 2))).collect();
        assert_eq!(kept, [3, 4, 5, 6]);
        let kept: Vec<u32> = (0..5).filter(|&z| voxels.contain(UVec3::new(4, 3, z))).collect();
        assert_eq!(kept, [0, 1, 2, 3, 4]);
    }

    #[test]
    fn cut_cells_are_those_that_planes_and_faces_meet() {
        // Cells along x end at -9, -7, … 9. The plane lies within voxel 4's, whose centre is 0; the next one ends where voxels 6 and 7 meet.
        let cells = |clip: Clip| Clip { shade_faces: false, ..clip }.unshaded_cells(&grid()).unwrap();
        let along_x = |cells: &CutCells, y: f64| -> Vec<u32> {
            (0..9).filter(|&x| cells.contain(DVec3::new(f64::from(x), y, 2.0))).collect()
        };
        let plane = |d: f64| Clip { planes: vec![[3.0, 0.0, 0.0, 3.0 * d]], ..Clip::default() };
        assert_eq!(along_x(&cells(plane(0.5)), 0.0), [4]);
        assert_eq!(along_x(&cells(plane(-5.0)), 6.0), [6, 7]);
        // The box's faces across x, and all voxels beside that across y, which ends at 3 within voxel 4's cells.
        let crop = Some([DVec3::new(-4.5, -1e9, -1e9), DVec3::new(0.5, 3.0, 1e9)]);
        let cells = cells(Clip { crop, ..Clip::default() });
        assert_eq!(along_x(&cells, 3.0), [2, 4]);
        assert_eq!(along_x(&cells, 4.0), [2, 3, 4]);
        assert_eq!(along_x(&cells, 6.0), [0u32; 0]);
        assert!(plane(0.5).unshaded_cells(&grid()).is_none());
        assert!(Clip { shade_faces: false, ..Clip::default() }.unshaded_cells(&grid()).is_none());
    }

    #[test]
    fn rows_are_what_voxels_are() {
        let grid = grid();
        for at in 0..200 {
            let angle = f64::from(at);
            let planes = [1.0, 1.7, 2.9].map(|factor: f64| {
                let (sine, cosine) = (angle * factor).sin_cos();
                [sine, cosine * factor.sin(), (angle + factor).sin(), 6.0 * (angle * factor).cos()]
            });
            let crop = (at % 3 == 0).then_some([DVec3::splat(-5.0), DVec3::splat(4.0)]);
            let voxels =
                Clip { planes: planes.to_vec(), crop, ..Clip::default() }.voxels(&grid, 0.5 + f64::from(at % 4));
            for (y, z) in (0..7).flat_map(|y| (0..5).map(move |z| (y, z))) {
                let each: Vec<u32> = (0..9).filter(|&x| voxels.contain(UVec3::new(x, y, z))).collect();
                assert_eq!(voxels.in_row(y, z, 9).collect::<Vec<u32>>(), each, "{planes:?} {crop:?}");
            }
        }
    }

    #[test]
    fn what_is_no_plane_or_box_is_refused() {
        let planes = |planes: &[[f64; 4]]| Clip { planes: planes.to_vec(), ..Clip::default() };
        let crop = |low: DVec3, high: DVec3| Clip { crop: Some([low, high]), ..Clip::default() };
        planes(&[[1e-200, 0.0, 0.0, 1e-200]; 6]).check().unwrap();
        crop(DVec3::ZERO, DVec3::ONE).check().unwrap();
        for (clip, words) in [
            (planes(&[[1.0, 0.0, 0.0, 0.0]; 7]), ["clip.planes", "7 planes", "at most 6"]),
            (planes(&[[0.0, 0.0, 0.0, 1.0]]), ["clip.planes[0]", "[0, 0, 0, 1]", "other than 0"]),
            (planes(&[[f64::NAN, 0.0, 0.0, 1.0]]), ["clip.planes[0][0]", "NaN", "finite"]),
            (planes(&[[1.0, 0.0, 0.0, f64::INFINITY]]), ["clip.planes[0][3]", "inf", "finite"]),
            (crop(DVec3::ONE, DVec3::new(2.0, 1.0, 2.0)), ["clip.crop", "[2, 1, 2]", "below"]),
            (crop(DVec3::NAN, DVec3::ONE), ["clip.crop[0][0]", "NaN", "finite"]),
        ] {
            let message = clip.check().unwrap_err().to_string();
            words.iter().for_each(|word| assert!(message.contains(word), "no {word:?} in {message}"));
        }
    }
}
