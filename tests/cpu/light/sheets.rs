//! The stage against the f64 evaluation: stacks plane by plane, and lookups.

use std::sync::Arc;

use glam::DVec3;
use sheetsplat::Scene;
use sheetsplat::internals::light::{KeptLight, LightSheets, LightStack};
use sheetsplat::internals::reference::light;
use sheetsplat::settings::{Light, Ramp, Shading};
use sheetsplat::volume::Volume;

use super::{in_units, lights, on_threads};
use crate::common::compare::{assert_at_most, largest};
use crate::common::{Random, SPACINGS, random_volume, scene, transfer};

/// A volume in some light: hazy, or opaque, so that there is darkness behind it.
fn case(random: &mut Random) -> (Volume, Scene) {
    let spacing = random.pick(&SPACINGS);
    let volume = random_volume(random, (9.0, 26.0), spacing);
    let mut scene = scene(8, 8);
    (scene.camera.direction, scene.camera.up) = (random.direction(), random.direction());
    let solid = random.pick(&[0.02, 0.2, 0.9, 1.0]);
    scene.channels[0].transfer =
        transfer(&[(0.0, [1.0; 3])], &[(5.0, 0.0), (20.0, random.pick(&[0.0, 0.01, 1.0])), (200.0, solid)]);
    if random.bits().is_multiple_of(3) {
        scene.channels[0].transfer.gradient_opacity = Some(Ramp::new(vec![(0.0, 0.1), (60.0, 1.0)]).unwrap());
    }
    if random.bits().is_multiple_of(3) {
        let normal = random.direction();
        scene.clip.planes = vec![[normal.x, normal.y, normal.z, random.uniform(-2.0, 4.0)]];
    }
    let kernels = [(2.0, 2.0), (2.0, 2.0), (1.0, 4.0), (3.0, 0.7), (4.0, 16.0)];
    (scene.splatting.radius, scene.splatting.falloff) = random.pick(&kernels);
    let fixed = Light::Direction(random.direction() * 3.0);
    scene.shading = Shading {
        occlusion: random.pick(&[0.7, 1.0]),
        occlusion_spread: random.pick(&[8.0, 3.0, 0.0]),
        shadow: random.pick(&[0.6, 1.0]),
        shadow_spread: random.pick(&[0.5, 0.0]),
        light_step: random.pick(&[2.0, 2.0, 0.7, 5.0, 16.0]),
        light: random.pick(&[Light::Headlight, Light::UpperLeft, fixed]),
        ..scene.shading
    };
    (volume, scene)
}

/// The largest difference of a stack from the f64 evaluation's.
fn apart(sheets: &LightSheets, expected: &light::LightSheets) -> f64 {
    let planes = expected.planes.concat();
    assert_eq!(sheets.light.len(), planes.len());
    assert_eq!(sheets.first, expected.first);
    largest(sheets.light.iter().zip(&planes).map(|(&light, exact)| f64::from(light) - exact))
}

#[test]
fn stacks_are_those_of_the_f64_evaluation() {
    let mut random = Random(52);
    let (mut worst, mut dark): (f64, u32) = (0.0, 0);
    // Along the light there is no `up`, so another axis takes its place, of equal ones the first.
    let along =
        [[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 1.0, 0.05], [1.0, 1.0, 1.0], [-2.0, 1.0, 1.0], [1.0, 2.0, -2.0]];
    for number in 0..40 {
        let (volume, mut scene) = case(&mut random);
        if let Some(&along) = along.get(number) {
            let up = DVec3::from(along);
            (scene.camera.direction, scene.camera.up) = (up.any_orthogonal_vector(), up);
            scene.shading.light = Light::Direction(-up);
        }
        let transfer = [scene.channels[0].transfer.resolve(&volume)];
        let basis = scene.camera.basis();
        let found = lights(&volume, &scene);
        let to_light = match scene.shading.light {
            Light::Direction(direction) => direction.normalize(),
            Light::UpperLeft => (-basis.w - basis.u / 2.0 + basis.v / 2.0).normalize(),
            _ => -basis.w,
        };
        let Shading { occlusion_spread, shadow_spread, .. } = scene.shading;
        let stacks = [(&found.occlusion, -basis.w, occlusion_spread), (&found.shadow, to_light, shadow_spread)];
        for (stack, to_light, spread) in stacks {
            let expected = light::LightSheets::new((&volume, &transfer), &scene, to_light, spread).unwrap();
            let light = stack.as_ref().unwrap();
            let apart = apart(&light.sheets, &expected);
            worst = worst.max(apart);
            dark += u32::from(light.sheets.light.iter().any(|&light| light < 0.9));
            assert_at_most(apart, 2e-3, format_args!("{number}: {:?}", scene.shading));
            for _ in 0..200 {
                let end = volume.dims().as_dvec3() + 1.0;
                let voxel = random.within(-2.0 * DVec3::ONE, end);
                let exact = expected.at(in_units(&volume, voxel));
                assert_at_most((f64::from(light.at(voxel)) - exact).abs(), 2e-3, format_args!("{number} at {voxel}"));
            }
        }
    }
    println!("largest difference of T: {worst:e}");
    assert!(dark > 50, "only {dark} stacks of 80 have shadows");
}

#[test]
fn stacks_have_the_same_bytes_on_any_number_of_threads() {
    let mut random = Random(53);
    for _ in 0..6 {
        let (volume, scene) = case(&mut random);
        let bits = |threads: usize| {
            let found = on_threads(threads, || lights(&volume, &scene));
            let bits = |stack: &Option<LightStack>| {
                stack.as_ref().unwrap().sheets.light.iter().map(|light| light.to_bits()).collect::<Vec<_>>()
            };
            [bits(&found.occlusion), bits(&found.shadow)]
        };
        let alone = bits(1);
        assert!([2, 3, 16].iter().all(|&threads| bits(threads) == alone), "{:?}", scene.shading);
    }
}

#[test]
fn stacks_are_kept_while_nothing_that_they_depend_on_changes() {
    let (volume, mut scene) = case(&mut Random(54));
    scene.shading.light = Light::Direction(DVec3::new(1.0, -2.0, 0.5));
    let mut kept = KeptLight::default();
    let mut stacks = |scene: &Scene| {
        let transfer = [scene.channels[0].transfer.resolve(&volume)];
        let lights = kept.lights((&volume, &transfer), scene, &scene.camera).unwrap().unwrap();
        [&lights.occlusion, &lights.shadow].map(|stack| Arc::clone(&stack.as_ref().unwrap().sheets))
    };
    let [occlusion, shadow] = stacks(&scene);
    scene.shading.ambient = 0.7;
    scene.shading.shadow = 0.2;
    let same = stacks(&scene);
    assert!(Arc::ptr_eq(&same[0], &occlusion) && Arc::ptr_eq(&same[1], &shadow));
    // Occlusion is towards the camera, and the shadow's light stands still.
    scene.camera = scene.camera.turned(20.0);
    let turned = stacks(&scene);
    assert!(!Arc::ptr_eq(&turned[0], &occlusion) && Arc::ptr_eq(&turned[1], &shadow));
    scene.shading.shadow_spread = 4.0;
    let spread = stacks(&scene);
    assert!(Arc::ptr_eq(&spread[0], &turned[0]) && !Arc::ptr_eq(&spread[1], &turned[1]));
    let mut changed = |change: fn(&mut Scene)| {
        let before = stacks(&scene);
        change(&mut scene);
        let after = stacks(&scene);
        assert!(before.iter().zip(&after).all(|(before, after)| !Arc::ptr_eq(before, after)));
    };
    changed(|scene| scene.splatting.radius = 1.5);
    changed(|scene| scene.channels[0].transfer.opacity = Some(Ramp::new(vec![(0.0, 0.1), (200.0, 0.9)]).unwrap()));
    changed(|scene| scene.channels[0].transfer.iso_ranges = Some(vec![[10.0, 300.0]]));
    changed(|scene| scene.clip.planes.push([1.0, 0.0, 0.0, 1.0]));
    changed(|scene| scene.camera.up = DVec3::new(0.2, 0.3, 0.8));
}

#[test]
fn a_step_that_needs_too_much_memory_is_refused() {
    let (volume, mut scene) = case(&mut Random(55));
    let volume = volume.with_spacing("long", DVec3::new(1.0, 1.0, 400.0)).unwrap();
    scene.shading.light_step = 0.5;
    let transfer = [scene.channels[0].transfer.resolve(&volume)];
    let error = KeptLight::default().lights((&volume, &transfer), &scene, &scene.camera).unwrap_err();
    let message = error.to_string();
    for words in ["shading.light_step", "0.5", "GB of light sheets", "at least"] {
        assert!(message.contains(words), "no {words:?} in {message}");
    }
}
