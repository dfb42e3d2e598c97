//! The channels that share sheets (SPEC §10): all of them, or one by one where each has an image of its own.

use std::sync::Arc;

use fearless_simd::Level;

use super::after;
use super::after::Coefficients;
use super::frame::{Drawing, Host, Reused, Voxels};
use super::material::Materials;
use crate::error::RenderError;
use crate::finished::FinishedScene;
use crate::geometry::view_geometry::ViewGeometry;
use crate::image::channels::Joining;
use crate::lists::brick::BrickList;
use crate::lists::classify::{brick_list, channels};
use crate::scene::Scene;
use crate::settings::splatting::Classification;
use crate::settings::transfer_function::TransferFunction;
use crate::volume::Volume;

/// Channels that share sheets.
#[derive(Clone, Debug)]
pub(super) struct Layer {
    volume: Arc<Volume>,
    transfer: Vec<TransferFunction>,
    list: List,
}

/// What voxels are drawn from.
#[derive(Clone, Debug)]
enum List {
    /// Those that take part in any channel, their materials, and memory for frames.
    Before(Box<BrickList>, Materials, Reused),
    /// Those of each channel.
    After(Vec<Coefficients>),
}

impl Layer {
    fn new(volume: &Arc<Volume>, transfer: &[TransferFunction], scene: &Scene) -> Result<Self, RenderError> {
        let list = List::new(volume, transfer, scene)?;
        Ok(Self { volume: Arc::clone(volume), transfer: transfer.to_vec(), list })
    }

    /// Computes again what a change of the scene makes obsolete.
    fn update(&mut self, transfer: &[TransferFunction], (old, new): (&Scene, &Scene)) -> Result<(), RenderError> {
        let is_same_clip = old.clip == new.clip;
        let (old, splatting) = (&old.splatting, &new.splatting);
        let is_same_kernel =
            (old.radius, old.falloff, old.is_exact()) == (splatting.radius, splatting.falloff, splatting.is_exact());
        let is_same_function = *transfer == self.transfer;
        match &mut self.list {
            List::Before(..) if splatting.classification == Classification::Before => {
                if !(is_same_function && is_same_kernel && is_same_clip) {
                    self.list = List::new(&self.volume, transfer, new)?;
                }
            }
            List::After(coefficients) if splatting.classification == Classification::After && is_same_kernel => {
                if !(is_same_function && splatting.compositing == old.compositing) {
                    coefficients.iter_mut().for_each(Coefficients::retest);
                }
            }
            _ => self.list = List::new(&self.volume, transfer, new)?,
        }
        self.transfer = transfer.to_vec();
        Ok(())
    }

    /// Draws the channels into one set of sheets.
    fn draw(&mut self, scene: &Scene, view: ViewGeometry, host: Host, level: Level) -> Drawing {
        let Self { volume, transfer, list } = self;
        match list {
            List::Before(bricks, materials, reused) => {
                let channels = channels(volume, transfer).collect();
                let voxels = Voxels::Whole { channels, bricks: bricks.bricks(), materials };
                reused.draw((volume.grid(), voxels), scene, view, host, level)
            }
            List::After(coefficients) => {
                let sharing = coefficients.len();
                for (of, coefficients) in channels(volume, transfer).zip(&mut *coefficients) {
                    coefficients.prepare(of.0, scene);
                    coefficients.look(of, &scene.splatting, &view, sharing);
                }
                let frames = channels(volume, transfer).zip(&*coefficients).enumerate();
                let frame = |(number, ((volume, transfer), coefficients))| {
                    let matter = after::Matter::Whole { volume, coefficients };
                    after::Frame::new(number, (matter, transfer), scene, view, host.clone())
                };
                after::Frame::draw(&frames.map(frame).collect::<Vec<_>>(), level)
            }
        }
    }
}

impl List {
    fn new(volume: &Volume, transfer: &[TransferFunction], scene: &Scene) -> Result<Self, RenderError> {
        if scene.splatting.classification == Classification::After {
            let coefficients = channels(volume, transfer).map(|(volume, _)| Coefficients::new(volume, scene));
            return Ok(Self::After(coefficients.collect::<Result<_, _>>()?));
        }
        let clipped = scene.clip.voxels(volume.grid(), scene.splatting.radius);
        let bricks = brick_list(volume, transfer, &clipped);
        let materials = Materials::new(bricks.bricks().len(), channels(volume, transfer).count());
        Ok(Self::Before(Box::new(bricks), materials, Reused::default()))
    }
}

/// How the layers' images become one; `None` if there is one layer of all channels.
fn joining(volume: &Volume, scene: &Scene) -> Option<Joining> {
    let splatting = &scene.splatting;
    Joining::of_channels(volume.channel_count(), splatting.compositing, splatting.classification)
}

/// The layers of a scene whose classification is known.
pub(super) fn layers(
    volume: &Arc<Volume>,
    FinishedScene { scene, transfer }: &FinishedScene,
) -> Result<Vec<Layer>, RenderError> {
    if joining(volume, scene).is_none() {
        return Ok(vec![Layer::new(volume, transfer, scene)?]);
    }
    let channels = volume.shared_channels().zip(transfer);
    channels.map(|(volume, transfer)| Layer::new(volume, std::slice::from_ref(transfer), scene)).collect()
}

/// Computes again what a change of the scene makes obsolete.
pub(super) fn update(
    layers: &mut Vec<Layer>,
    volume: &Arc<Volume>,
    (old, new): (&FinishedScene, &FinishedScene),
) -> Result<(), RenderError> {
    let scenes = (&old.scene, &new.scene);
    match joining(volume, scenes.1) {
        joined if joined.is_some() != joining(volume, scenes.0).is_some() => *layers = self::layers(volume, new)?,
        None => layers[0].update(&new.transfer, scenes)?,
        Some(_) => {
            for (layer, transfer) in layers.iter_mut().zip(&new.transfer) {
                layer.update(std::slice::from_ref(transfer), scenes)?;
            }
        }
    }
    Ok(())
}

/// Draws all layers and joins their images.
pub(super) fn draw(layers: &mut [Layer], scene: &Scene, view: ViewGeometry, host: Host, level: Level) -> Drawing {
    let Some(joining) = joining(&layers[0].volume, scene) else {
        return layers[0].draw(scene, view, host, level);
    };
    let mut by_itself = scene.clone();
    by_itself.image.background = [0.0; 4];
    let first_hit = joining.first_hit(host.first_hit);
    let draw = |layer: &mut Layer| layer.draw(&by_itself, view, Host { first_hit, ..host.clone() }, level);
    let (first, others) = layers.split_at_mut(1);
    let mut all = draw(&mut first[0]);
    for layer in others {
        let Drawing { content, counts, first_hits } = draw(layer);
        joining.join((&mut all.content.colors, &mut all.first_hits), (&content.colors, &first_hits));
        all.counts.add_channel(&counts);
    }
    // Parts have no background yet.
    let background = if host.is_part { [0.0; 4] } else { scene.image.background };
    joining.finish(&mut all.content.colors, background);
    if host.first_hit.is_none() {
        all.first_hits.clear();
    }
    all
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;
    use crate::cpu::CpuRenderer;
    use crate::scene::VolumeSource;
    use crate::settings::splatting::Interpolation;
    use crate::settings::transfer_function::Ramp;
    use crate::volume::ValueSlice;

    /// Where what voxels are drawn from lies in memory.
    fn list_of(renderer: &CpuRenderer) -> *const () {
        let layer = &renderer.layers[0];
        match &layer.list {
            List::Before(bricks, ..) => bricks.bricks().as_ptr().cast(),
            List::After(coefficients) => match coefficients[0].all(&layer.volume) {
                ValueSlice::F32(all) => all.as_ptr().cast(),
                values => panic!("{values:?} are no coefficients"),
            },
        }
    }

    #[test]
    fn a_changed_scene_keeps_what_does_not_depend_on_the_change() {
        let sets = ["image={width=16,height=16}".to_owned()];
        for (classification, interpolation) in
            [(Classification::Before, Interpolation::Smooth), (Classification::After, Interpolation::Exact)]
        {
            let mut scene = Scene::from_volume(VolumeSource::Builtin("head:12".to_owned()), &sets).unwrap();
            (scene.splatting.classification, scene.splatting.interpolation) = (classification, interpolation);
            let mut renderer = CpuRenderer::new(scene.load_volume().unwrap(), &scene).unwrap();
            renderer.draw().unwrap();
            let list = list_of(&renderer);
            scene.camera = scene.camera.turned(20.0);
            scene.shading.ambient = 0.5;
            scene.splatting.compositing = crate::appearance::Preset::Xray.compositing();
            scene.splatting.slab_width = 0.5;
            renderer.set_scene(&scene).unwrap();
            renderer.draw().unwrap();
            assert_eq!(list_of(&renderer), list, "{classification:?}");
            scene.splatting.radius = 1.5;
            renderer.set_scene(&scene).unwrap();
            assert_ne!(list_of(&renderer), list, "{classification:?}");
        }
    }

    /// Another transfer function tests the kept ranges of bricks anew, and makes another list of bricks only if it shows others.
    #[test]
    fn a_changed_transfer_function_tests_the_kept_ranges() {
        let sets = ["image={width=16,height=16}", "camera.fit=volume"].map(str::to_owned);
        let mut scene = Scene::from_volume(VolumeSource::Builtin("head:24".to_owned()), &sets).unwrap();
        scene.splatting.classification = Classification::After;
        let mut renderer = CpuRenderer::new(scene.load_volume().unwrap(), &scene).unwrap();
        let mut places = |points: &[(f64, f64)]| {
            scene.channels[0].transfer.opacity = Some(Ramp::new(points.to_vec()).unwrap());
            renderer.set_scene(&scene).unwrap();
            renderer.draw().unwrap();
            let List::After(coefficients) = &renderer.layers[0].list else { unreachable!() };
            coefficients[0].places()
        };
        let first = places(&[(60.0, 0.0), (100.0, 0.5)]);
        let ([first_bricks, first_ranges], first_count) = first;
        assert!(first_bricks.is_some() && first_ranges.is_some());
        // The same values have an opacity.
        assert_eq!(places(&[(60.0, 0.0), (80.0, 0.1), (120.0, 0.9)]), first);
        // Nothing has an opacity.
        let ([_, ranges], count) = places(&[(1e6, 0.0), (2e6, 0.9)]);
        assert!(first_count > 0 && count == 0, "{count} of {first_count}");
        assert_eq!(ranges, first_ranges);
    }
}
