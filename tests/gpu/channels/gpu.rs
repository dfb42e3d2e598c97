//! Several channels on the GPU, by both rasterizers.

use std::collections::BTreeMap;

use glam::{DVec3, UVec3};
use sheetsplat::headless::{Backend, GpuHeadless};
use sheetsplat::scene::TransferSettings;
use sheetsplat::settings::{
    Classification, Compositing, Gradient, Interpolation, LabelTables, Order, Ramp, Rasterizer, SlabProfile, Splatting,
};
use sheetsplat::volume::{Labels, Volume};
use sheetsplat::wgpu::{Features, Limits, TextureFormat};
use sheetsplat::{DeviceRequirements, GpuVolume, Image, Scene, SceneView};

use super::{BY_SUMS, CLASSIFICATIONS, draw, joined, random_case, set_transfers, single};
use crate::common::cases::in_turns;
use crate::common::compare::{assert_at_least, assert_at_most, decibels};
use crate::common::devices::{gpu, on_adapter};
use crate::common::images::{largest_difference, rms};
use crate::common::{COMPOSITINGS, RASTERIZERS, Random, camera, scene, transfer};

fn by(rasterizer: Rasterizer, scene: &Scene) -> Scene {
    Scene { splatting: Splatting { rasterizer, ..scene.splatting }, ..scene.clone() }
}

/// Every compositing, with either way to classify.
fn modes() -> impl Iterator<Item = (Classification, Compositing)> {
    COMPOSITINGS.into_iter().enumerate().flat_map(|(turn, compositing)| {
        in_turns(turn, CLASSIFICATIONS).into_iter().map(move |classification| (classification, compositing))
    })
}

/// The rasterizers that draw several channels.
fn rasterizers(volume: &Volume, splatting: &Splatting) -> &'static [Rasterizer] {
    let is_after = splatting.classification == Classification::After;
    // To find a surface among the cells of labels' tables may take more loops than a driver allows in one dispatch.
    let is_labelled = volume.channels().any(|channel| channel.labels().is_some());
    let is_long = is_after && is_labelled && splatting.compositing == Compositing::Surface;
    if is_long { &[Rasterizer::Quads] } else { &RASTERIZERS }
}

/// Compares an image with the twin's.
fn assert_is_the_twins(gpu: &GpuHeadless, volume: &Volume, scene: &Scene, what: &str) {
    let Splatting { classification, compositing, .. } = scene.splatting;
    let expected = draw(Backend::Reference, volume, scene);
    for &rasterizer in rasterizers(volume, &scene.splatting) {
        let actual = gpu.render_volume(volume.clone(), &by(rasterizer, scene)).unwrap();
        let what = format!("{what}, {classification:?} {compositing:?} by {rasterizer:?}");
        // Quads round amounts to f16.
        let required = match (classification, rasterizer) {
            (Classification::After, _) => 60.0,
            (_, Rasterizer::Quads) => 66.0,
            _ => 80.0,
        };
        if compositing == Compositing::Surface {
            // A surface is there or not, and in one voxel's cell or the next, which rounding decides at rims.
            let pixels = actual.image.pixels.iter().zip(&expected.image.pixels);
            let is_off = |(a, b): &(&[f32; 4], &[f32; 4])| (0..4).any(|at| (a[at] - b[at]).abs() > 0.01);
            let (off, others): (Vec<_>, Vec<_>) = pixels.partition(is_off);
            let all = actual.image.pixels.len();
            println!("{what}: {} of {all} pixels are off", off.len());
            assert!(off.len() * 100 <= all, "{what}: {} of {all} pixels are off", off.len());
            let squares = others.iter().flat_map(|(a, b)| (0..4).map(move |at| f64::from(a[at] - b[at]).powi(2)));
            let distance = (squares.sum::<f64>() / (4 * others.len()) as f64).sqrt();
            assert!(distance == 0.0 || decibels(distance) >= required, "{what}: {:.1} dB", decibels(distance));
        } else if actual.image != expected.image {
            let measured = decibels(rms(&actual.image, &expected.image));
            println!("{what}: {measured:.1} dB");
            assert_at_least(measured, required, &what);
        }
        let (counts, twin) = (actual.stats.counts, expected.stats.counts);
        assert_eq!(counts.voxels_in_range, twin.voxels_in_range, "{what}");
    }
}

#[test]
fn whole_frames_are_those_of_the_twin() {
    let gpu = gpu();
    let mut random = Random(121);
    let both = CLASSIFICATIONS.into_iter().flat_map(|of| COMPOSITINGS.map(|compositing| (of, compositing)));
    for (round, (classification, compositing)) in both.enumerate() {
        let count = 2 + round % 3;
        let (volume, mut scene) = random_case(&mut random, count);
        (scene.splatting.classification, scene.splatting.compositing) = (classification, compositing);
        // Of the backends only this one draws back to front, and surfaces front to back only.
        if round % 4 == 1 && compositing != Compositing::Surface {
            scene.splatting.order = Order::BackToFront;
        }
        assert_is_the_twins(gpu, &volume, &scene, &format!("{count} channels"));
    }
}

/// Tiles find the voxels of all channels at once. Here some channels share bricks, some have their own, holes lie in others' matter, and at a pixel a voxel more
/// voxels lie behind a patch than are held at a time.
#[test]
fn channels_of_different_bricks_are_each_drawn_whole() {
    let gpu = gpu();
    let mut random = Random(813);
    for (count, side, pixels) in [(3, 26, 30), (10, 14, 40)] {
        let dims = UVec3::splat(side);
        let channel = |number: u32| {
            let middle = DVec3::splat(f64::from(side)) * (0.3 + 0.05 * f64::from(number));
            let reach = f64::from(side) * if number == 0 { 0.9 } else { 0.25 };
            let values = (0..dims.element_product()).map(|index| {
                let voxel = UVec3::new(index % side, index / side % side, index / (side * side)).as_dvec3();
                let is_hole = number % 2 == 1 && random.bits().is_multiple_of(40);
                if is_hole { f32::NAN } else { ((reach - voxel.distance(middle)) * 30.0).max(0.0) as f32 }
            });
            Volume::new("ball", dims, DVec3::ONE, values.collect()).unwrap()
        };
        let channels: Vec<Volume> = (0..count).map(channel).collect();
        let volume = joined(&channels.iter().collect::<Vec<_>>());
        let mut scene = scene(pixels, pixels);
        scene.camera = camera([0.3, 0.9, -0.2], f64::from(side) * 1.1);
        scene.splatting.classification = Classification::After;
        scene.splatting.compositing = Compositing::Exponential;
        let transfers: Vec<TransferSettings> = (0..count)
            .map(|number| {
                let color = [1.0, f64::from(number) / f64::from(count), f64::from(number % 2)];
                transfer(&[(0.0, color)], &[(20.0, 0.0), (90.0, 0.2)])
            })
            .collect();
        set_transfers(&mut scene, &transfers);
        scene.splatting.culling = false;
        assert_is_the_twins(gpu, &volume, &scene, &format!("{count} channels"));
        let [quads, tiles] = [Rasterizer::Quads, Rasterizer::Tiles]
            .map(|rasterizer| gpu.render_volume(volume.clone(), &by(rasterizer, &scene)).unwrap().stats.counts);
        assert_eq!(tiles.voxels_shaded, quads.voxels_shaded, "{count} channels");
    }
}

#[test]
fn exact_fields_are_those_of_the_twin() {
    let gpu = gpu();
    let mut random = Random(122);
    for (round, compositing) in COMPOSITINGS.into_iter().enumerate() {
        let (volume, mut scene) = random_case(&mut random, 3);
        if round % 2 == 0 {
            scene.shading.gradient = Gradient::Kernel;
        }
        scene.splatting.classification = Classification::After;
        (scene.splatting.compositing, scene.splatting.interpolation) = (compositing, Interpolation::Exact);
        assert_is_the_twins(gpu, &volume, &scene, "exact");
    }
}

#[test]
fn labels_of_every_channel_have_their_tables() {
    let gpu = gpu();
    let mut random = Random(123);
    for (round, (classification, compositing)) in modes().enumerate() {
        let (volume, mut scene) = random_case(&mut random, 3);
        (scene.splatting.classification, scene.splatting.compositing) = (classification, compositing);
        // The middle channel is not segmented, and in every other case the first one is not either.
        let segmented = |channel: &Volume, phase: u32| {
            let dims = channel.dims();
            let label = |index: u32| (index % dims.x / 4 + index / dims.x % dims.y / 4 + phase) % 3;
            let values = (0..dims.element_product()).map(|index| label(index) as u16).collect();
            let labels = Labels { origin: "test".to_owned(), dims, spacing: None, values, names: BTreeMap::new() };
            single(channel).with_labels(labels).unwrap()
        };
        let channels: Vec<&Volume> = volume.channels().collect();
        let first = if round % 2 == 0 { segmented(channels[0], 1) } else { single(channels[0]) };
        let volume = joined(&[&first, channels[1], &segmented(channels[2], 0)]);
        let hidden = LabelTables { visible: false, ..LabelTables::default() };
        let bright = LabelTables {
            color: Some(Ramp::new(vec![(0.0, glam::DVec3::new(1.0, 0.9, 0.1))]).unwrap()),
            opacity: Some(Ramp::new(vec![(40.0, 0.0), (160.0, 0.9)]).unwrap()),
            ..LabelTables::default()
        };
        let mut transfers: Vec<TransferSettings> =
            scene.channels.iter().map(|channel| channel.transfer.clone()).collect();
        transfers[2].labels = BTreeMap::from([(0, hidden.clone()), (1, bright.clone())]);
        if round % 2 == 0 {
            transfers[0].labels = BTreeMap::from([(1, hidden), (2, bright)]);
        }
        set_transfers(&mut scene, &transfers);
        let without = {
            let mut plain = scene.clone();
            transfers[2].labels.clear();
            set_transfers(&mut plain, &transfers);
            draw(Backend::Cpu, &volume, &plain).image
        };
        assert_ne!(draw(Backend::Cpu, &volume, &scene).image, without, "the tables of the last channel show");
        assert_is_the_twins(gpu, &volume, &scene, "labels");
    }
}

#[test]
fn neither_order_nor_empty_channels_matter() {
    let gpu = gpu();
    let mut random = Random(9);
    for (classification, compositing) in modes() {
        let (volume, mut scene) = random_case(&mut random, 3);
        (scene.splatting.classification, scene.splatting.compositing) = (classification, compositing);
        let scene = scene.explicit(&volume);
        let channels: Vec<_> = volume.channels().collect();
        let settings: Vec<_> = scene.channels.iter().map(|channel| channel.transfer.clone()).collect();
        let image = |rasterizer, order: &[usize]| {
            let mut scene = by(rasterizer, &scene);
            let transfers: Vec<_> = order.iter().map(|&number| settings[number].clone()).collect();
            set_transfers(&mut scene, &transfers);
            let channels: Vec<_> = order.iter().map(|&number| channels[number]).collect();
            gpu.render_volume(joined(&channels), &scene).unwrap().image
        };
        for rasterizer in RASTERIZERS {
            let distance = largest_difference(&image(rasterizer, &[0, 1, 2]), &image(rasterizer, &[2, 0, 1]));
            println!("{classification:?} {compositing:?} by {rasterizer:?}: {distance:.1e}");
            // Sums of channels that are rounded to f16 may round differently.
            let are_rounded = (classification, rasterizer) == (Classification::Before, Rasterizer::Quads);
            let allowed = if are_rounded && BY_SUMS.contains(&compositing) { 1e-3 } else { 1e-6 };
            assert_at_most(distance, allowed, format!("{classification:?} {compositing:?} by {rasterizer:?}"));
            let mut hidden = by(rasterizer, &scene);
            hidden.channels[2].visible = false;
            let hidden = gpu.render_volume(volume.clone(), &hidden).unwrap().image;
            assert_eq!(hidden, image(rasterizer, &[0, 1]), "{classification:?} {compositing:?} by {rasterizer:?}");
        }
    }
}

/// A transparent channel leaves the image alone, also as the first of two, where it leaves the first list of bricks empty.
#[test]
fn a_channel_without_opacity_changes_nothing() {
    let gpu = gpu();
    let mut random = Random(15);
    for (classification, compositing) in modes() {
        let (volume, mut scene) = random_case(&mut random, 2);
        (scene.splatting.classification, scene.splatting.compositing) = (classification, compositing);
        let mut scene = scene.explicit(&volume);
        let second = scene.channels[1].transfer.clone();
        let nothing = transfer(&[(0.0, [0.9, 0.1, 0.1])], &[(0.0, 0.0), (250.0, 0.0)]);
        set_transfers(&mut scene, &[nothing, second.clone()]);
        for rasterizer in RASTERIZERS {
            let mut alone = by(rasterizer, &scene);
            set_transfers(&mut alone, std::slice::from_ref(&second));
            let only = single(volume.channels().nth(1).unwrap());
            let [both, one] = [(volume.clone(), by(rasterizer, &scene)), (only, alone)]
                .map(|(volume, scene)| gpu.render_volume(volume, &scene).unwrap().image);
            let what = format!("{classification:?} {compositing:?} by {rasterizer:?}");
            assert_at_most(largest_difference(&both, &one), 1e-6, &what);
            // The second channel is nowhere opaque enough for a surface after splatting.
            let shows = one.pixels.iter().any(|pixel| *pixel != one.pixels[0]);
            assert!(shows || compositing == Compositing::Surface, "{what}");
        }
    }
}

#[test]
fn what_opaque_sums_hide_is_culled() {
    let gpu = gpu();
    let mut random = Random(77);
    for classification in CLASSIFICATIONS {
        let (volume, mut scene) = random_case(&mut random, 3);
        scene.splatting.classification = classification;
        scene.splatting.compositing = Compositing::Exponential;
        // Opaque only together.
        let dense = transfer(&[(0.0, [0.9, 0.5, 0.2]), (200.0, [0.3, 0.9, 1.0])], &[(20.0, 0.0), (90.0, 0.6)]);
        set_transfers(&mut scene, &[dense.clone(), dense.clone(), dense]);
        for rasterizer in RASTERIZERS {
            let mut scene = by(rasterizer, &scene);
            let whole = gpu.render_volume(volume.clone(), &scene).unwrap();
            scene.splatting.culling = true;
            for threshold in [0.5, 0.95, 1.0] {
                scene.splatting.opacity_threshold = threshold;
                let culled = gpu.render_volume(volume.clone(), &scene).unwrap();
                let what = format!("{classification:?} by {rasterizer:?}, {threshold}");
                let allowed = 1.0 - threshold + 1e-5;
                assert_at_most(largest_difference(&culled.image, &whole.image), allowed, &what);
                let (some, all) = (culled.stats.counts.sections_rasterized, whole.stats.counts.sections_rasterized);
                assert!(threshold > 0.5 || some < all, "{what}: {some} of {all} sections");
            }
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
    let keys = "transfer.opacity = [[0, 0.2], [200, 0.9]]\ntransfer.color = [[0, [1, 0.5, 0]]]\n\
                [camera]\ndirection = [0.3, 1, -0.2]\n[image]\nwidth = 40\nheight = 40\n";
    let parse = |text: &str| Scene::parse(text, "test", std::path::Path::new(""), &[]).unwrap();
    let one = parse(&format!("volume.builtin = 'head:20'\n{keys}"));
    let table = parse(&format!("[[channel]]\nname = 'head'\nvolume.builtin = 'head:20'\n{keys}"));
    for (classification, compositing) in modes() {
        for rasterizer in RASTERIZERS {
            let [first, second] = [&one, &table].map(|scene| {
                let mut scene = by(rasterizer, scene);
                (scene.splatting.classification, scene.splatting.compositing) = (classification, compositing);
                gpu.render(&scene).unwrap().image
            });
            assert_eq!(first, second, "{classification:?} {compositing:?} by {rasterizer:?}");
            assert!(first.pixels.iter().any(|pixel| pixel[0] > 0.1), "{classification:?} {compositing:?}");
        }
    }
}

#[test]
fn a_changed_view_is_drawn_as_a_new_one() {
    let gpu = gpu();
    let mut random = Random(31);
    let (volume, mut scene) = random_case(&mut random, 3);
    scene.camera = camera([0.3, 1.0, 0.2], 20.0);
    let device = gpu.device();
    let uploaded = GpuVolume::new(device, gpu.queue(), volume.clone()).unwrap();
    let mut view = SceneView::new(device, &uploaded, &scene).unwrap();
    let mut touched = 0;
    for step in 0..15 {
        match step % 3 {
            0 => scene.splatting.compositing = random.pick(&COMPOSITINGS),
            1 => scene.splatting.classification = random.pick(&CLASSIFICATIONS),
            _ => {
                let low = random.uniform(20.0, 90.0);
                scene.channels[1].transfer = transfer(&[(0.0, [0.1, 0.9, 0.4])], &[(low, 0.0), (low + 60.0, 0.8)]);
                let change = view.set_transfer_function(scene.resolve(&volume)).unwrap();
                touched += u64::from(change.entered + change.left > 0);
            }
        }
        view.set_splatting(scene.splatting).unwrap();
        let estimate = gpu.renderer().estimate(&SceneView::new(device, &uploaded, &scene).unwrap()).unwrap();
        let changed = gpu.draw(&mut view).unwrap();
        let new = gpu.render_volume(volume.clone(), &scene).unwrap();
        let what = format!("step {step}: {:?} {:?}", scene.splatting.classification, scene.splatting.compositing);
        // Bricks that have entered come last, so that sums are rounded in another order, which decides at a surface's rim.
        if changed.image != new.image {
            let required = if scene.splatting.compositing == Compositing::Surface { 40.0 } else { 90.0 };
            assert_at_least(decibels(rms(&changed.image, &new.image)), required, &what);
        }
        let (counts, expected) = (changed.stats.counts, new.stats.counts);
        assert_eq!(counts.voxels_in_range, expected.voxels_in_range, "{what}");
        assert_eq!((counts.sections_total, counts.sheets), (expected.sections_total, expected.sheets), "{what}");
        // The target is not the view's.
        let target = u64::from(scene.image.width * scene.image.height) * 16;
        assert_eq!(new.stats.gpu_bytes - target, estimate, "{what}");
    }
    assert!(touched > 0, "no change of a transfer function moves a voxel");
}

#[test]
fn picks_are_those_of_the_native_backend() {
    let gpu = gpu();
    let mut random = Random(32);
    for (classification, compositing) in modes().filter(|(_, compositing)| *compositing != Compositing::Minimum) {
        let (volume, mut scene) = random_case(&mut random, 2);
        (scene.splatting.classification, scene.splatting.compositing) = (classification, compositing);
        // So opaque that averages and surfaces are hit.
        let opaque = |red: f64| transfer(&[(0.0, [red, 0.6, 0.3])], &[(20.0, 0.0), (70.0, 0.9)]);
        set_transfers(&mut scene, &[opaque(0.9), opaque(0.1)]);
        let opacity = 0.2;
        let mut native = sheetsplat::cpu::CpuRenderer::new(volume.clone(), &scene).unwrap();
        native.set_first_hit(Some(opacity)).unwrap();
        native.draw().unwrap();
        for rasterizer in RASTERIZERS {
            let mut view = gpu.view(volume.clone(), &by(rasterizer, &scene)).unwrap();
            view.set_first_hit(Some(opacity)).unwrap();
            gpu.draw(&mut view).unwrap();
            let what = format!("{classification:?} {compositing:?} by {rasterizer:?}");
            let (mut agreeing, mut channels, mut all) = (0, [0; 2], 0);
            for pixel in (0..scene.image.height).step_by(3).flat_map(|y| (0..scene.image.width).map(move |x| [x, y])) {
                let [found, expected] = [gpu.pick(&view, pixel).unwrap(), native.pick(pixel).unwrap()];
                all += 1;
                let is_same = match (found, expected) {
                    (Some(found), Some(expected)) => {
                        channels[found.channel] += 1;
                        (found.depth - expected.depth).abs() < 0.02 && found.channel == expected.channel
                    }
                    (None, None) => true,
                    _ => false,
                };
                agreeing += usize::from(is_same);
            }
            // Rounding decides at rims, and between a voxel and its neighbour.
            assert!(agreeing * 20 >= all * 19, "{what}: {agreeing} of {all} picks agree");
            assert!(channels[0] + channels[1] > 10, "{what}: {channels:?}");
        }
    }
}

/// Four channels of waves, and a scene that shows all of them.
fn four_channels(random: &mut Random) -> (Volume, Scene) {
    let (volume, _) = random_case(random, 4);
    let mut all = scene(32, 32);
    all.splatting.culling = false;
    let visible = transfer(&[(0.0, [0.2, 0.9, 0.5])], &[(50.0, 0.0), (180.0, 0.3)]);
    set_transfers(&mut all, &[visible.clone(), visible.clone(), visible.clone(), visible]);
    (volume, all)
}

/// The first channels of a volume and its scene.
fn first_channels(volume: &Volume, scene: &Scene, count: usize) -> (Volume, Scene) {
    let channels: Vec<&Volume> = volume.channels().take(count).collect();
    let mut scene = scene.clone();
    scene.channels.truncate(count);
    (joined(&channels), scene)
}

#[test]
fn four_channels_keep_within_webgpus_default_limits() {
    let least = |features| {
        let requirements = DeviceRequirements { features, limits: Limits::default() };
        GpuHeadless::new(&on_adapter().with_requirements(requirements)).unwrap()
    };
    let [with_f16, with_f32] = [Features::empty(), Features::FLOAT32_BLENDABLE].map(least);
    assert_eq!(with_f16.renderer().sheet_format(), TextureFormat::Rgba16Float);
    let full = gpu();
    let (volume, scene) = four_channels(&mut Random(13));
    for count in 1..=4 {
        let (volume, mut scene) = first_channels(&volume, &scene, count);
        for (classification, compositing) in modes() {
            (scene.splatting.classification, scene.splatting.compositing) = (classification, compositing);
            scene.splatting.rasterizer = Rasterizer::Quads;
            let images: Vec<Image> =
                [full, &with_f32, &with_f16].map(|gpu| gpu.render_volume(volume.clone(), &scene).unwrap().image).into();
            let what = format!("{count} channels, {classification:?} {compositing:?}");
            let [f32_sheets, f16_sheets] = [1, 2].map(|at| decibels(rms(&images[0], &images[at])));
            // The boundaries of groups and lists may differ, which moves roundings.
            assert!(images[0] == images[1] || f32_sheets >= 70.0, "{what}: {f32_sheets}");
            let required = if compositing == Compositing::Surface { 25.0 } else { 40.0 };
            assert!(images[0] == images[2] || f16_sheets >= required, "{what}: {f16_sheets}");
        }
    }
}

#[test]
fn memory_grows_with_the_channels() {
    let gpu = gpu();
    let (volume, scene) = four_channels(&mut Random(12));
    let bytes = |volume| GpuVolume::estimate(gpu.device(), volume).unwrap()[0];
    let (one, four) = (bytes(&single(&volume)), bytes(&volume));
    assert!(four <= 4 * one && four > one, "{four} and {one} bytes");
    let channels: Vec<Volume> = volume.channels().map(single).collect();
    for ((classification, compositing), rasterizer) in
        modes().flat_map(|mode| RASTERIZERS.map(|rasterizer| (mode, rasterizer)))
    {
        let used_by = |volume: &Volume, count| {
            let (volume, mut scene) = first_channels(volume, &scene, count);
            (scene.splatting.classification, scene.splatting.compositing) = (classification, compositing);
            scene.splatting.rasterizer = rasterizer;
            // The halves of cubic slabs are sheets of all channels, which tiles keep until the last channel's.
            scene.splatting.slab_profile = SlabProfile::Linear;
            gpu.render_volume(volume, &scene).unwrap().stats.gpu_bytes
        };
        let alone: Vec<u64> = channels.iter().map(|channel| used_by(channel, 1)).collect();
        let used = [1, 2, 3, 4].map(|count| used_by(&volume, count));
        let what =
            format!("{classification:?} {compositing:?} by {rasterizer:?}: {used:?} bytes, channels alone {alone:?}");
        // The buffers that join images come with the second channel.
        let joined = 20 * 32 * 32 + 1024;
        for (count, &used_by) in (1..).zip(&used) {
            assert!(used_by <= alone[..count].iter().sum::<u64>() + joined, "{what}");
        }
        assert!(used.is_sorted(), "{what}");
    }
}
