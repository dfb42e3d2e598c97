//! Laws that relate images of several channels to images of one.

use sheetsplat::headless::Backend;
use sheetsplat::image::Image;
use sheetsplat::scene::{Scene, TransferSettings};
use sheetsplat::settings::{Compositing, Ramp};
use sheetsplat::volume::Volume;

use super::{CLASSIFICATIONS, NATIVE, draw, joined, random_case, set_transfers, single};
use crate::common::compare::{assert_at_least, assert_at_most, decibels, largest};
use crate::common::images::rms;
use crate::common::{COMPOSITINGS, Random, transfer};

/// The image of one channel of a scene, seen by the same camera.
fn of_channel(backend: Backend, volume: &Volume, scene: &Scene, number: usize) -> Image {
    let mut scene = scene.explicit(volume);
    scene.channels.swap(0, number);
    scene.channels.truncate(1);
    draw(backend, &single(volume.channel(number).unwrap()), &scene).image
}

#[test]
fn projections_of_channels_are_sums() {
    let mut random = Random(3);
    for classification in CLASSIFICATIONS {
        for compositing in [Compositing::Xray, Compositing::Maximum, Compositing::Minimum, Compositing::Average] {
            let (volume, mut scene) = random_case(&mut random, 3);
            (scene.splatting.classification, scene.splatting.compositing) = (classification, compositing);
            scene.image.background = [0.0; 4];
            // Sums that stay below 1.
            let mut channels: Vec<TransferSettings> =
                scene.channels.iter().map(|channel| channel.transfer.clone()).collect();
            for transfer in &mut channels {
                let faint = transfer.opacity.iter().flat_map(|ramp| ramp.points()).map(|&(at, y)| (at, y * 0.02));
                transfer.opacity = Some(Ramp::new(faint.collect()).unwrap());
            }
            set_transfers(&mut scene, &channels);
            for backend in NATIVE {
                let all = draw(backend, &volume, &scene).image;
                let parts = [0, 1, 2].map(|number| of_channel(backend, &volume, &scene, number));
                let shown = parts.iter().filter(|part| part.pixels.iter().any(|pixel| pixel[3] > 0.0)).count();
                assert!(shown > 1, "{shown} channels show something");
                let errors = all.pixels.iter().enumerate().flat_map(|(at, pixel)| {
                    let of = |channel: usize| parts.iter().map(|part| f64::from(part.pixels[at][channel])).sum::<f64>();
                    [0, 1, 2, 3].map(|channel| f64::from(pixel[channel]) - of(channel).min(1.0))
                });
                assert_at_most(largest(errors), 1e-6, format!("{backend} {classification:?} {compositing:?}"));
            }
        }
    }
}

#[test]
fn a_channel_that_shows_nothing_changes_nothing() {
    let mut random = Random(4);
    for (classification, compositing) in
        CLASSIFICATIONS.into_iter().flat_map(|c| COMPOSITINGS.map(|compositing| (c, compositing)))
    {
        let (volume, mut scene) = random_case(&mut random, 2);
        (scene.splatting.classification, scene.splatting.compositing) = (classification, compositing);
        let scene = scene.explicit(&volume);
        for backend in NATIVE {
            let alone = of_channel(backend, &volume, &scene, 0);
            let mut hidden = scene.clone();
            hidden.channels[1].visible = false;
            assert_eq!(draw(backend, &volume, &hidden).image, alone, "{backend} {classification:?} {compositing:?}");
            let mut transparent = scene.clone();
            transparent.channels[1].transfer.opacity = Some(Ramp::new(vec![(0.0, 0.0)]).unwrap());
            assert_eq!(draw(backend, &volume, &transparent).image, alone, "{classification:?} {compositing:?}");
            // The first channel, too.
            let mut second = scene.clone();
            second.channels[0].visible = false;
            let expected = of_channel(backend, &volume, &scene, 1);
            assert_eq!(draw(backend, &volume, &second).image, expected, "{classification:?} {compositing:?}");
        }
    }
}

/// A volume with its scene, and the volume split by voxels into two channels with theirs.
pub(super) fn split(random: &mut Random, round: usize, compositing: Compositing) -> [(Volume, Scene); 2] {
    let (volume, mut scene) = random_case(random, 1);
    scene.shading.enabled = false;
    scene.splatting.compositing = compositing;
    scene.channels[0].transfer = transfer(
        &[(0.0, [0.2, 0.4, 1.0]), (200.0, [1.0, 0.5, 0.0])],
        &[(10.0, 0.0), (200.0, 0.3 + 0.2 * round as f64)],
    );
    let scene = scene.explicit(&volume);
    // In checks, whose footprints overlap everywhere.
    let side: Vec<bool> = (0..volume.values().len() as u32)
        .map(|index| (volume.grid().voxel_at(index).element_sum() / 2).is_multiple_of(2))
        .collect();
    let half = |of: bool| {
        let values = volume.values().iter().zip(&side).map(|(value, &side)| if side == of { value } else { 0.0 });
        Volume::new("half", volume.dims(), volume.spacing(), values.collect()).unwrap()
    };
    let halves = joined(&[&half(true), &half(false)]);
    let mut split = scene.clone();
    set_transfers(&mut split, &[scene.channels[0].transfer.clone(), scene.channels[0].transfer.clone()]);
    [(volume, scene), (halves, split)]
}

#[test]
fn a_volume_split_by_voxels_is_the_whole() {
    let mut random = Random(6);
    for (round, compositing) in super::BY_SUMS.into_iter().enumerate() {
        let both = split(&mut random, round, compositing);
        for backend in NATIVE {
            let [whole, split] = both.each_ref().map(|(volume, scene)| draw(backend, volume, scene).image);
            let distance = rms(&whole, &split);
            if distance > 0.0 {
                assert_at_least(decibels(distance), 100.0, format!("{backend} {compositing:?}"));
            }
            let shown = whole.pixels.iter().filter(|pixel| pixel[..3] != [0.0; 3]).count();
            assert!(shown * 10 > whole.pixels.len(), "{shown} pixels show something");
        }
    }
}
