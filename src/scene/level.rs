//! The levels of stores that a scene leaves open (SPEC §13): the coarsest whose voxels are no larger than a pixel.

use std::path::Path;

use glam::DVec3;

use super::{ImageSettings, Scene, VolumeSource, load};
use crate::settings::camera::{Camera, Projection};
use crate::volume::{
    Access, Grid, ReadOptions, Volume, VolumeError, check_grids, is_address, levels, sample_of_channels,
};

/// The number of bytes of values by which a camera is framed that fits the object: enough for its box, and quickly read.
const FRAME_BYTES: u64 = 1 << 24;

/// A voxel counts as no larger than a pixel if it is larger by less than this fraction, because both are rounded.
const ROUNDING: f64 = 1e-9;

/// A channel whose level is to be chosen: its number, and the grids of the levels from the finest, at least two.
type Open = (usize, Vec<Grid>);

impl Scene {
    /// The scene with a level stated for every channel that reads a store of several and leaves it open (`volume.level = auto`): the coarsest whose
    /// voxels are no larger than a pixel, in perspective at the point of the volume's box that is nearest in depth. `explicit` places the camera:
    /// [`Self::explicit`], or [`Self::explicit_all_around`] for cameras that turn. If the camera fits an object, a coarse level is read for this.
    ///
    /// [`Self::load_volume`] does this with [`Self::explicit`]. A scene that is invalid, and a file that cannot be opened, leave the level open: drawing
    /// and reading tell why.
    ///
    /// # Errors
    /// If the volume by which the camera is placed cannot be read, if no level fits in memory, or if a store at an address cannot be opened.
    pub fn choose_levels(
        &self,
        options: &ReadOptions,
        explicit: impl Fn(&Self, &Volume) -> Self,
    ) -> Result<Self, VolumeError> {
        // No other format has levels.
        let has_stores = cfg!(feature = "zarr");
        if !has_stores || options.level.is_some() || self.check().is_err() {
            return Ok(self.clone());
        }
        let open = open_channels(self, options)?;
        if open.is_empty() {
            return Ok(self.clone());
        }
        let camera = if self.camera.needs_object() || self.camera.has_open_eye() {
            let volume = coarse_volume(self, &open, options)?;
            if self.check_volume(&volume).is_err() {
                return Ok(self.clone());
            }
            explicit(self, &volume).camera
        } else {
            self.camera
        };
        let mut scene = self.clone();
        let mut drawn = None;
        for (number, levels) in open {
            // All channels are drawn on the first one's grid.
            let pixel = |grid: &Grid| self.pixel(&camera, &levels[0], drawn.as_ref().unwrap_or(grid));
            let level = coarsest(&levels, pixel);
            if number == 0 {
                drawn = Some(levels[level]);
            }
            scene.state_level(number, level);
        }
        Ok(scene)
    }

    /// [`pixel_at_nearest`] with the scene's image and kernel.
    fn pixel(&self, camera: &Camera, finest: &Grid, drawn: &Grid) -> f64 {
        let ImageSettings { width, height, .. } = self.image;
        let camera = camera.explicit(drawn, self.splatting.radius, width, height);
        pixel_at_nearest(&camera, finest, height)
    }

    /// States the level of a channel.
    fn state_level(&mut self, channel: usize, level: usize) {
        self.channels[channel].level = Some(level as u32);
    }

    /// The level that the scene states, or else that of a volume which comes from a file with several.
    pub(super) fn level_in(&self, volume: &Volume) -> Option<u32> {
        let first = self.channels.first();
        let has_levels = matches!(first.volume, VolumeSource::File(_)) && volume.levels().len() > 1;
        first.level.or(has_levels.then(|| volume.level()))
    }
}

/// The number of the coarsest level none of whose spacings is larger than a pixel, whose size is a function of the level that is drawn; 0 if all have a
/// larger one.
fn coarsest(levels: &[Grid], pixel: impl Fn(&Grid) -> f64) -> usize {
    let is_fine = |grid: &Grid| grid.spacing.max_element() <= pixel(grid) * (1.0 + ROUNDING);
    levels.iter().rposition(is_fine).unwrap_or(0)
}

/// The size of a pixel in world units, for a camera with everything stated and an image that is `height` pixels high. In perspective it is the size at the
/// near plane, or at the point of the box of the finest level's voxels that is nearest in depth, if that lies behind the near plane.
fn pixel_at_nearest(camera: &Camera, finest: &Grid, height: u32) -> f64 {
    let height = f64::from(height);
    match camera.projection {
        Projection::Orthographic { height: of_image } => of_image.unwrap_or(f64::NAN) / height,
        Projection::Perspective { fov_y, distance, near } => {
            let w = camera.basis().w;
            let half: DVec3 = finest.dims.as_dvec3() * finest.spacing / 2.0;
            let of_box = distance.unwrap_or(f64::NAN) - camera.middle().dot(w) - half.dot(w.abs());
            let depth = of_box.max(near.unwrap_or_else(|| finest.unit()));
            depth * 2.0 * libm::tan(fov_y.to_radians() / 2.0) / height
        }
    }
}

/// The channels that leave open which of several levels is read. Of a volume with a file of labels, only levels count that the labels have too.
///
/// # Errors
/// If a store at an address cannot be opened: to ask again would take as long.
fn open_channels(scene: &Scene, options: &ReadOptions) -> Result<Vec<Open>, VolumeError> {
    let Ok(access) = Access::new(options) else { return Ok(Vec::new()) };
    let of_file = |path: &Path| match levels(path, &access) {
        Err(error) if is_address(path) => Err(error),
        levels => Ok(levels.unwrap_or_default()),
    };
    let mut open = Vec::new();
    for (number, channel) in scene.channels.iter().enumerate() {
        let (VolumeSource::File(path), None) = (&channel.volume, channel.level) else { continue };
        let mut grids = of_file(path)?;
        if let Some(labels) = &channel.labels {
            let labels = of_file(labels)?;
            let of_both = grids.iter().zip(&labels).take_while(|(grid, labels)| grid.dims == labels.dims).count();
            grids.truncate(of_both);
        }
        if let Some(spacing) = channel.spacing {
            grids = grids.into_iter().map(|grid| grid.with_finest_spacing(spacing)).collect();
        }
        if grids.len() > 1 {
            open.push((number, grids));
        }
    }
    Ok(open)
}

/// The scene's volume at coarse levels, from which the camera's frame is taken: of each open channel the finest level within a few bytes, or else the
/// coarsest; of a single one that is too large even so, every nth voxel.
fn coarse_volume(scene: &Scene, open: &[Open], options: &ReadOptions) -> Result<Volume, VolumeError> {
    let bytes = FRAME_BYTES.min(options.memory_limit() / 8);
    let is_small = |grid: &Grid| grid.voxels().saturating_mul(4) <= bytes;
    if open.iter().any(|(_, levels)| !levels.iter().any(is_small))
        && let Some(Ok(channels)) = load::streamed(scene, &Access::new(options)?)
        && check_grids(&channels).is_ok()
    {
        return sample_of_channels(&channels, bytes);
    }
    let mut coarse = scene.clone();
    for (number, levels) in open {
        coarse.state_level(*number, levels.iter().position(is_small).unwrap_or(levels.len() - 1));
    }
    load::channels(&coarse, &Access::new(options)?)
}

#[cfg(test)]
mod tests {
    use glam::UVec3;

    use super::*;
    use crate::settings::camera::Fit;

    /// Three levels, the finest of 64 × 64 × 32 voxels at 0.5 × 0.5 × 1.
    fn pyramid() -> Vec<Grid> {
        let finest = Grid::new(UVec3::new(64, 64, 32), DVec3::new(0.5, 0.5, 1.0));
        let coarser =
            |by: u32| Grid::new(finest.dims / by, finest.spacing * f64::from(by)).coarser_than(&finest, DVec3::ZERO);
        vec![finest, coarser(2), coarser(4)]
    }

    fn chosen(projection: Projection, center: DVec3, height: u32) -> usize {
        let camera =
            Camera { projection, center: Some(center), direction: DVec3::X, fit: Fit::Volume, ..Camera::default() };
        let levels = pyramid();
        coarsest(&levels, |grid| pixel_at_nearest(&camera.explicit(grid, 2.0, height, height), &levels[0], height))
    }

    #[test]
    fn the_largest_spacing_is_at_most_an_orthographic_pixel() {
        for (height_world, level) in
            [(10.0, 0), (99.0, 0), (199.999, 0), (200.0, 1), (399.999, 1), (400.0, 2), (1e9, 2)]
        {
            let projection = Projection::Orthographic { height: Some(height_world) };
            assert_eq!(chosen(projection, DVec3::new(0.0, 7.0, -3.0), 100), level, "{height_world}");
        }
        // The quotient of lengths that are no sums of powers of 2 may be rounded down.
        let tenths = [0.1, 0.2, 0.4].map(|spacing| Grid::new(UVec3::ONE, DVec3::splat(spacing)));
        for height in [3.0, 7.0, 77.0, 1023.0] {
            assert_eq!(coarsest(&tenths, |_| 0.1 * height * 2.0 / height), 1, "{height}");
        }
        // By default the whole volume is shown.
        let levels: Vec<usize> = [5, 20, 40, 2000]
            .map(|height| chosen(Projection::Orthographic { height: None }, DVec3::ZERO, height))
            .to_vec();
        assert_eq!(levels, [2, 1, 0, 0]);
    }

    #[test]
    fn a_pixel_in_perspective_is_that_of_the_nearest_point() {
        // A pixel is as large as a hundredth of its depth; the box reaches 16 from its middle.
        let fov_y = 2.0 * 0.5_f64.atan().to_degrees();
        let at = |distance, center: [f64; 3], near| {
            let projection = Projection::Perspective { fov_y, distance: Some(distance), near };
            chosen(projection, DVec3::from(center), 100)
        };
        for (nearest, level) in [(50.0, 0), (199.999, 0), (200.0, 1), (399.999, 1), (400.0, 2), (5000.0, 2)] {
            assert_eq!(at(nearest + 16.0, [0.0; 3], None), level, "{nearest}");
            assert_eq!(at(nearest - 4.0, [-20.0, 300.0, 8.0], None), level, "{nearest}");
        }
        // Nothing is seen before the near plane, and nothing lies behind the eye.
        assert_eq!(at(100.0, [0.0; 3], Some(200.0)), 1);
        assert_eq!(at(1.0, [50.0, 0.0, 0.0], None), 0);
    }

    #[test]
    fn numbers_that_are_nan_choose_the_finest() {
        assert_eq!(coarsest(&pyramid(), |_| f64::NAN), 0);
    }
}
