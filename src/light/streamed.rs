//! The light of a volume that is read by boxes (SPEC §14): that of a level, or of every nth voxel, which is read as a whole and stays in memory.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::kept::KeptLight;
use super::lights::Lights;
use super::view;
use crate::error::RenderError;
use crate::error::setting::SettingError;
use crate::scene::Scene;
use crate::settings::shading::Shading;
use crate::settings::transfer_function::TransferFunction;
use crate::stats::Stats;
use crate::volume::{Grid, StreamedChannel, StreamedVolume, Texel, Thinned, Volume};

/// The maximum number of voxels that light is made of.
const MOST_VOXELS: u64 = 1 << 24;

/// The part of the memory of chunks that light may take. They have half of the limit, so that it takes a quarter of this.
const SHARE: u64 = 2;

/// The light of a view of a volume that is streamed. Clones share it.
#[derive(Clone, Debug, Default)]
pub struct StreamedLight {
    made: Arc<Mutex<Made>>,
}

/// What frames keep.
#[derive(Debug, Default)]
struct Made {
    /// The voxels that light is made of, once they have been read.
    voxels: Option<Arc<Volume>>,
    light: KeptLight,
}

impl StreamedLight {
    /// The voxels of a volume that light is made of, whatever memory there is.
    pub fn thinned(volume: &StreamedVolume) -> Thinned {
        volume.thinned(MOST_VOXELS)
    }

    /// Checks that memory holds a scene's light sheets and what they are made of.
    ///
    /// # Errors
    /// If it does not.
    pub fn check(volume: &StreamedVolume, scene: &Scene) -> Result<(), SettingError> {
        let Shading { occlusion, shadow, light_step, .. } = scene.shading;
        let Some(key) = scene.shading.light_key() else { return Ok(()) };
        let Thinned { dims, spacing, .. } = Self::thinned(volume);
        let stacks = [occlusion, shadow].iter().filter(|amount| **amount > 0.0).count();
        let grid = Grid::new(dims, spacing);
        let side = view::side(grid.bounding_radius(scene.splatting.radius) / volume.grid().unit(), light_step);
        let bytes_of = |channel: &StreamedChannel| {
            let labels = if channel.labels.is_some() { size_of::<u16>() } else { 0 };
            let colors = if channel.values.store.has_colors() { size_of::<Texel>() } else { 0 };
            size_of::<f32>() + labels + colors
        };
        // Beside the values, their amounts.
        let of_voxel = volume.channels.iter().map(bytes_of).sum::<usize>() + size_of::<f32>();
        let sheets = side.powi(3) * (size_of::<f32>() * stacks) as f64;
        let needed = grid.voxels() as f64 * of_voxel as f64 + sheets;
        let allowed = (volume.memory / SHARE) as f64;
        if needed <= allowed {
            return Ok(());
        }
        let mib = |bytes: f64| (bytes / f64::from(1 << 20)).ceil();
        let amount = if key == "shading.occlusion" { occlusion } else { shadow };
        let found = format!(
            "{amount}, whose light needs {} MiB, {} MiB of them for sheets, where it may take {:.0} MiB, a quarter of the memory",
            mib(needed),
            mib(sheets),
            (allowed / f64::from(1 << 20)).floor(),
        );
        let least = mib(needed * 2.0 * SHARE as f64);
        Err(SettingError::new(key, found, format!("0, {least} MiB of memory, or a larger shading.light_step")))
    }

    /// The light sheets of a scene with a camera that is framed, for the voxels that are drawn; `None` without occlusion, shadow or shading. The first call
    /// that needs the voxels that light is made of reads them.
    ///
    /// # Errors
    /// If the store cannot be read, or sheets would take more than 4 GiB.
    pub fn lights(
        &self,
        (volume, transfer): (&StreamedVolume, &[TransferFunction]),
        scene: &Scene,
    ) -> Result<Option<Arc<Lights>>, RenderError> {
        if scene.shading.light_key().is_none() {
            *self.made() = Made::default();
            return Ok(None);
        }
        let mut made = self.made();
        let voxels = made.voxels(volume)?;
        let lights = made.light.lights((&voxels, transfer), scene, &scene.camera)?;
        Ok(lights.map(|lights| Arc::new(lights.on(volume.grid()))))
    }

    /// The voxels that light is made of.
    ///
    /// # Errors
    /// If the store cannot be read.
    pub fn voxels(&self, volume: &StreamedVolume) -> Result<Arc<Volume>, RenderError> {
        self.made().voxels(volume)
    }

    /// A frame's statistics with those of its light, if it has any.
    pub fn noted_in(&self, volume: &StreamedVolume, stats: Stats) -> Stats {
        let made = self.made();
        if made.voxels.is_none() {
            return stats;
        }
        let Thinned { level, stride, .. } = Self::thinned(volume);
        let (light_level, light_stride) = (Some(level as u64), Some(stride.into()));
        Stats { light_level, light_stride, ..made.light.noted_in(stats) }
    }

    fn made(&self) -> MutexGuard<'_, Made> {
        self.made.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Made {
    /// The voxels that light is made of, which are read if they were not.
    fn voxels(&mut self, volume: &StreamedVolume) -> Result<Arc<Volume>, RenderError> {
        if let Some(voxels) = &self.voxels {
            return Ok(Arc::clone(voxels));
        }
        let voxels = Arc::new(volume.read_thinned(StreamedLight::thinned(volume))?);
        Ok(Arc::clone(self.voxels.insert(voxels)))
    }
}
