//! The f64 evaluation by itself: light behind matter that is simple enough to be computed by hand.

use glam::{DVec3, UVec3};
use sheetsplat::Scene;
use sheetsplat::internals::reference::light::LightSheets;
use sheetsplat::volume::Volume;

use super::in_units;
use crate::common::compare::assert_at_most;
use crate::common::{SPACINGS, scene, transfer};

/// A block of one value, whose voxels all have an opacity.
fn block(dims: UVec3, spacing: DVec3, opacity: f64) -> (Volume, Scene) {
    let volume = Volume::new("block", dims, spacing, vec![1.0; dims.element_product() as usize]).unwrap();
    let mut scene = scene(8, 8);
    scene.channels[0].transfer = transfer(&[(0.0, [1.0; 3])], &[(0.0, opacity)]);
    (volume, scene)
}

fn sheets(volume: &Volume, scene: &Scene, to_light: DVec3, spread: f64) -> LightSheets {
    LightSheets::new((volume, &[scene.channels[0].transfer.resolve(volume)]), scene, to_light, spread).unwrap()
}

/// Behind a block there is `exp(-m·length)` of the light, `m = -ln(1 - α)`, whatever the spacing, the step and the spread: a filter leaves even light even.
#[test]
fn a_block_leaves_what_its_thickness_leaves() {
    for spacing in SPACINGS.map(DVec3::from) {
        for (step, spread) in [(0.5, 0.0), (1.0, 2.0), (2.0, 1.0)] {
            let (volume, mut scene) = block(UVec3::new(45, 5, 45), spacing, 0.1);
            // A wide kernel has no ripple.
            (scene.splatting.radius, scene.splatting.falloff) = (4.0, 1.0);
            scene.shading.light_step = step;
            let sheets = sheets(&volume, &scene, -DVec3::Y, spread);
            // Far enough behind the block that all of its kernels are passed, although points are moved towards the light.
            let behind = sheets.at(in_units(&volume, DVec3::new(22.0, 20.0, 22.0)));
            let length = 5.0 * spacing.y / volume.grid().unit();
            assert_at_most(
                (behind / 0.9_f64.powf(length) - 1.0).abs(),
                1e-3,
                format_args!("{spacing} {step} {spread}"),
            );
            assert_eq!(sheets.at(in_units(&volume, DVec3::new(22.0, -9.0, 22.0))), 1.0, "before the block");
            assert_eq!(sheets.at(in_units(&volume, DVec3::new(-200.0, 20.0, 22.0))), 1.0, "beside the sheets");
        }
    }
}

/// The optical depth of one voxel's shadow, summed over pixels, is the voxel's volume times its amount; without a filter, the same on every plane behind it.
#[test]
fn one_voxel_has_the_shadow_of_its_volume() {
    for spacing in SPACINGS.map(DVec3::from) {
        for to_light in [-DVec3::Y, DVec3::new(0.3, -0.8, 0.5).normalize()] {
            let (volume, mut scene) = block(UVec3::ONE, spacing, 0.3);
            scene.shading.light_step = 0.5;
            let sheets = sheets(&volume, &scene, to_light, 0.0);
            let last = sheets.planes.last().unwrap();
            let depth = last.iter().map(|light| -light.ln()).sum::<f64>() * 0.5 * 0.5;
            let expected = -0.7_f64.ln() * volume.grid().aspect().element_product();
            assert_at_most((depth / expected - 1.0).abs(), 2e-3, format_args!("{spacing} {to_light}"));
        }
    }
}

/// A shadow's variance grows by the spread for each `unit` of the way.
#[test]
fn a_shadow_spreads_by_its_variance() {
    for (step, spread) in [(0.5, 0.4), (1.0, 0.7), (2.0, 1.0)] {
        // A voxel that keeps off very little light, and far behind it one that keeps off less, so that there are planes between them.
        let dims = UVec3::new(1, 33, 1);
        let values = (0..33)
            .map(|y| {
                if y == 0 {
                    1.0
                } else if y == 32 {
                    0.5
                } else {
                    0.0
                }
            })
            .collect();
        let volume = Volume::new("two", dims, DVec3::ONE, values).unwrap();
        let mut scene = scene(8, 8);
        scene.channels[0].transfer = transfer(&[(0.0, [1.0; 3])], &[(0.0, 0.0), (0.5, 1e-9), (1.0, 1e-3)]);
        scene.shading.light_step = step;
        let sheets = sheets(&volume, &scene, -DVec3::Y, spread);
        let side = (sheets.planes[0].len() as f64).sqrt() as usize;
        let variance = |plane: usize| {
            let (mut sum, mut squares) = (0.0, 0.0);
            for (at, light) in sheets.planes[plane].iter().enumerate() {
                let x = (at % side) as f64 - (side - 1) as f64 / 2.0;
                sum += 1.0 - light;
                squares += (1.0 - light) * x * x;
            }
            squares / sum * step * step
        };
        let (first, last) = ((7.0 / step) as usize, (15.0 / step) as usize);
        let gained = (variance(last) - variance(first)) / ((last - first) as f64 * step);
        assert_at_most((gained / spread - 1.0).abs(), 1e-3, format_args!("{step} {spread}"));
    }
}
