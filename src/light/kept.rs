//! A view keeps its light from frame to frame: the matter while the transfer function and the cuts stay, and each stack of sheets while its light stays.

use std::sync::Arc;

use web_time::Instant;

use super::lights::{LightStack, Lights};
use super::matter::LightMatter;
#[cfg(feature = "gpu")]
use super::matter::lit_bricks;
use super::sheets::LightSheets;
use super::source::{LightSource, sources};
use super::view::LightView;
use crate::error::RenderError;
use crate::kernel::Kernel;
use crate::scene::Scene;
use crate::settings::camera::Camera;
use crate::settings::clip::Clip;
use crate::settings::shading::Shading;
use crate::settings::transfer_function::TransferFunction;
use crate::stats::Stats;
use crate::volume::Volume;

/// The light of a view of one volume.
#[derive(Clone, Debug, Default)]
pub struct KeptLight {
    matter: Option<KeptMatter>,
    /// The stacks of occlusion and of shadow.
    sheets: [Option<(LightSource, Arc<LightSheets>)>; 2],
    /// Milliseconds that the last call took.
    milliseconds: f64,
    /// Lights that are made elsewhere.
    given: Option<Arc<Lights>>,
}

/// Matter, and what it depends on.
#[derive(Clone, Debug)]
struct KeptMatter {
    transfer: Vec<TransferFunction>,
    clip: Clip,
    matter: LightMatter,
}

impl KeptLight {
    /// Light that is made elsewhere, of more than the voxels of a view: of all channels, or of the whole volume of a box.
    pub fn given(lights: Arc<Lights>) -> Self {
        Self { given: Some(lights), ..Self::default() }
    }

    /// The light sheets of a scene with a camera that is framed, always of the same volume; `None` without occlusion, shadow or shading. What has not
    /// changed since the last call is not made again.
    ///
    /// # Errors
    /// If sheets would take more than 4 GiB.
    pub fn lights(
        &mut self,
        (volume, transfer): (&Volume, &[TransferFunction]),
        scene: &Scene,
        camera: &Camera,
    ) -> Result<Option<Arc<Lights>>, RenderError> {
        let start = Instant::now();
        if scene.shading.light_key().is_none() {
            *self = Self { given: self.given.take(), ..Self::default() };
            return Ok(None);
        }
        if let Some(given) = &self.given {
            return Ok(Some(Arc::new(given.on(volume.grid()))));
        }
        let is_same = |kept: &KeptMatter| kept.transfer == transfer && kept.clip == scene.clip;
        let matter = match self.matter.take().filter(is_same) {
            Some(kept) => kept,
            None => {
                self.sheets = [None, None];
                let matter = LightMatter::new(volume, transfer, &scene.clip);
                KeptMatter { transfer: transfer.to_vec(), clip: scene.clip.clone(), matter }
            }
        };
        let matter = &self.matter.insert(matter).matter;
        let Shading { occlusion, shadow, .. } = scene.shading;
        let wanted = sources(scene, camera);
        // Sheets that nobody else holds any more give their memory to new ones.
        let mut memory = [Vec::new(), Vec::new()];
        for ((kept, wanted), memory) in self.sheets.iter_mut().zip(wanted).zip(&mut memory) {
            let old = kept.take_if(|(source, _)| Some(*source) != wanted);
            *memory = old.and_then(|(_, sheets)| Arc::into_inner(sheets)).map_or_else(Vec::new, |sheets| sheets.light);
        }
        let is_missing = |number: usize| wanted[number].filter(|_| self.sheets[number].is_none());
        let missing = [is_missing(0), is_missing(1)];
        let kernel = Kernel::new(scene.splatting.radius, scene.splatting.falloff);
        let view = |source: &LightSource| LightView::new(&matter.grid, scene, camera.up, source.to_light);
        let variance = |source: &LightSource| source.spread / source.step;
        match missing {
            // Both take the same amounts.
            [Some(first), Some(second)] if first.to_light == second.to_light => {
                let variances = [variance(&first), variance(&second)];
                let [a, b] = LightSheets::new(matter, &view(&first)?, &kernel, variances, memory);
                self.sheets = [Some((first, Arc::new(a))), Some((second, Arc::new(b)))];
            }
            missing => {
                for ((kept, source), memory) in self.sheets.iter_mut().zip(missing).zip(memory) {
                    if let Some(source) = source {
                        let [sheets] =
                            LightSheets::new(matter, &view(&source)?, &kernel, [variance(&source)], [memory]);
                        *kept = Some((source, Arc::new(sheets)));
                    }
                }
            }
        }
        let of = |number: usize, amount: f64| {
            let (_, sheets) = self.sheets[number].as_ref()?;
            let rows = sheets.rows(volume.grid());
            Some(LightStack { amount: amount as f32, sheets: Arc::clone(sheets), rows })
        };
        let lights = Lights { occlusion: of(0, occlusion), shadow: of(1, shadow) };
        self.milliseconds = start.elapsed().as_secs_f64() * 1e3;
        Ok(Some(Arc::new(lights)))
    }

    /// The pixels along each side of the sheets that [`Self::lights`] would give, and the number of planes of both stacks; 0 without occlusion, shadow or
    /// shading.
    ///
    /// # Errors
    /// As for [`Self::lights`].
    #[cfg(feature = "gpu")]
    pub(crate) fn extent(
        (volume, transfer): (&Volume, &[TransferFunction]),
        scene: &Scene,
        camera: &Camera,
    ) -> Result<[u32; 2], RenderError> {
        let wanted = sources(scene, camera);
        if wanted.iter().flatten().next().is_none() {
            return Ok([0; 2]);
        }
        let bricks = lit_bricks(volume, transfer, &scene.clip);
        let [mut side, mut planes] = [0; 2];
        for source in wanted.iter().flatten() {
            let light = LightView::new(volume.grid(), scene, camera.up, source.to_light)?;
            let slabs = light.slabs(bricks.bricks()).len() as u32;
            (side, planes) = (light.side as u32, planes + if slabs > 0 { slabs + 1 } else { 0 });
        }
        Ok([side, planes])
    }

    /// A frame's statistics with those of its light sheets, if it has any.
    pub fn noted_in(&self, stats: Stats) -> Stats {
        let sheets = self.sheets.iter().flatten().map(|(_, sheets)| sheets);
        let bytes: u64 = sheets.map(|sheets| size_of_val(&sheets.light[..]) as u64).sum();
        if self.matter.is_none() {
            return stats;
        }
        Stats { light_ms: Some(self.milliseconds), light_bytes: Some(bytes), ..stats }
    }
}
