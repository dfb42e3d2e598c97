//! Several channels on the GPU, by both rasterizers.

use sheetsplat::headless::Backend;
use sheetsplat::settings::{Compositing, Rasterizer, Splatting};
use sheetsplat::volume::Volume;
use sheetsplat::{GpuVolume, Scene, SceneView};

use super::common::compare::{assert_at_least, assert_at_most, decibels};
use super::common::images::{largest_difference, rms};
use super::common::{RASTERIZERS, Random, gpu, scene, transfer};
use super::{BY_SUMS, draw, joined, random_case, set_transfers, single};

fn by(rasterizer: Rasterizer, scene: &Scene) -> Scene {
    Scene { splatting: Splatting { rasterizer, ..scene.splatting }, ..scene.clone() }
}

#[test]
fn whole_frames_are_those_of_the_twin() {
    let gpu = gpu();
    let mut random = Random(121);
    for (round, compositing) in BY_SUMS.into_iter().cycle().take(8).enumerate() {
        let count = 2 + round % 3;
        let (volume, mut scene) = random_case(&mut random, count);
        scene.splatting.compositing = compositing;
        let expected = draw(Backend::Reference, &volume, &scene);
        for rasterizer in RASTERIZERS {
            let actual = gpu.render_volume(volume.clone(), &by(rasterizer, &scene)).unwrap();
            let what = format!("{count} channels, {compositing:?} by {rasterizer:?}");
            // Quads round amounts to f16. A surface is there or not, which rounding decides at its rim.
            let required = match (rasterizer, compositing) {
                (_, Compositing::Surface) => 40.0,
                (Rasterizer::Quads, _) => 66.0,
                _ => 80.0,
            };
            if actual.image != expected.image {
                assert_at_least(decibels(rms(&actual.image, &expected.image)), required, &what);
            }
            assert_eq!(actual.stats.counts.voxels_in_range, expected.stats.counts.voxels_in_range, "{what}");
        }
    }
}

#[test]
fn neither_order_nor_empty_channels_matter() {
    let gpu = gpu();
    let mut random = Random(9);
    for compositing in BY_SUMS {
        let (volume, mut scene) = random_case(&mut random, 3);
        scene.splatting.compositing = compositing;
        let scene = scene.explicit(&volume);
        let channels: Vec<_> = volume.channels().collect();
        let settings: Vec<_> = scene.channels().map(|channel| channel.transfer.clone()).collect();
        let image = |rasterizer, order: &[usize]| {
            let mut scene = by(rasterizer, &scene);
            let transfers: Vec<_> = order.iter().map(|&number| settings[number].clone()).collect();
            set_transfers(&mut scene, &transfers);
            let channels: Vec<_> = order.iter().map(|&number| channels[number]).collect();
            gpu.render_volume(joined(&channels), &scene).unwrap().image
        };
        for rasterizer in RASTERIZERS {
            let distance = largest_difference(&image(rasterizer, &[0, 1, 2]), &image(rasterizer, &[2, 0, 1]));
            // Sums of channels that are rounded to f16 may round differently.
            let allowed = if rasterizer == Rasterizer::Quads { 1e-3 } else { 2e-6 };
            assert_at_most(distance, allowed, format!("{compositing:?} by {rasterizer:?}"));
            let mut hidden = by(rasterizer, &scene);
            hidden.further[1].visible = false;
            let hidden = gpu.render_volume(volume.clone(), &hidden).unwrap().image;
            assert_eq!(hidden, image(rasterizer, &[0, 1]), "{compositing:?} by {rasterizer:?}");
        }
    }
}

#[test]
fn a_volume_split_by_voxels_is_the_whole() {
    let gpu = gpu();
    let mut random = Random(61);
    for (round, compositing) in BY_SUMS.into_iter().enumerate() {
        let both = super::sums::split(&mut random, round, compositing);
        for rasterizer in RASTERIZERS {
            let image = |(volume, scene): &(_, Scene)| gpu.render_volume(Volume::clone(volume), &by(rasterizer, scene));
            let [whole, split] = both.each_ref().map(|of| image(of).unwrap().image);
            let distance = rms(&whole, &split);
            if distance > 0.0 {
                assert_at_least(decibels(distance), 100.0, format!("{compositing:?} by {rasterizer:?}"));
            }
            assert!(whole.pixels.iter().any(|pixel| pixel[..3] != [0.0; 3]));
        }
    }
}

#[test]
fn one_channel_is_a_scene_of_one_volume() {
    let gpu = gpu();
    let keys = "transfer.opacity = [[30, 0], [200, 0.5]]\ntransfer.color = [[0, [1, 0.5, 0]]]\n\
                [camera]\ndirection = [0.3, 1, -0.2]\n[image]\nwidth = 40\nheight = 40\n";
    let parse = |text: &str| Scene::parse(text, "test", std::path::Path::new(""), &[]).unwrap();
    let one = parse(&format!("volume.builtin = 'head:20'\n{keys}"));
    let table = parse(&format!("[[channel]]\nname = 'head'\nvolume.builtin = 'head:20'\n{keys}"));
    for classification in super::CLASSIFICATIONS {
        for rasterizer in RASTERIZERS {
            let [first, second] = [&one, &table].map(|scene| {
                let mut scene = by(rasterizer, scene);
                scene.splatting.classification = classification;
                gpu.render(&scene).unwrap().image
            });
            assert_eq!(first, second, "{classification:?} by {rasterizer:?}");
            assert!(first.pixels.iter().any(|pixel| pixel[0] > 0.1));
        }
    }
}

#[test]
fn a_transfer_function_of_several_channels_can_change() {
    let gpu = gpu();
    let mut random = Random(31);
    let (volume, mut scene) = random_case(&mut random, 2);
    scene.camera = super::common::camera([0.3, 1.0, 0.2], 20.0);
    let device = gpu.device();
    let uploaded = GpuVolume::new(device, gpu.queue(), volume.clone()).unwrap();
    let mut view = SceneView::new(device, &uploaded, &scene).unwrap();
    gpu.draw(&mut view).unwrap();
    scene.further[0].transfer = transfer(&[(0.0, [0.1, 0.9, 0.4])], &[(60.0, 0.0), (120.0, 0.8)]);
    let touched = view.set_transfer_function(scene.resolve(&volume)).unwrap();
    assert!(touched.entered + touched.left > 0);
    let changed = gpu.draw(&mut view).unwrap().image;
    assert_eq!(changed, gpu.render_volume(volume, &scene).unwrap().image);
}

#[test]
fn refusals_name_the_setting() {
    let gpu = gpu();
    let mut random = Random(2);
    let (volume, scene) = random_case(&mut random, 2);
    let refusal = |change: &dyn Fn(&mut Scene)| {
        let mut scene = scene.clone();
        change(&mut scene);
        gpu.render_volume(volume.clone(), &scene).unwrap_err().to_string()
    };
    let after = refusal(&|scene| scene.splatting.classification = sheetsplat::settings::Classification::After);
    assert!(after.starts_with("splatting.classification: found \"after\" for 2 channels"), "{after}");
    let maximum = refusal(&|scene| scene.splatting.compositing = Compositing::Maximum);
    assert!(maximum.starts_with("splatting.compositing: found \"maximum\" for 2 channels"), "{maximum}");
}

#[test]
fn memory_grows_with_the_channels() {
    let gpu = gpu();
    let mut random = Random(12);
    let (volume, _) = random_case(&mut random, 4);
    let mut all = scene(32, 32);
    let visible = transfer(&[(0.0, [1.0; 3])], &[(50.0, 0.1)]);
    set_transfers(&mut all, &[visible.clone(), visible.clone(), visible.clone(), visible]);
    let bytes = |volume| GpuVolume::estimate(gpu.device(), volume).unwrap()[0];
    let (one, four) = (bytes(&single(&volume)), bytes(&volume));
    assert!(four <= 4 * one && four > one, "{four} and {one} bytes");
    gpu.render_volume(volume, &all).unwrap();
}
