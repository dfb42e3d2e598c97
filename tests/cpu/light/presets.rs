//! Presets that light volumes by sheets.

use std::path::Path;

use glam::{DVec3, UVec3};
use sheetsplat::appearance::Preset;
use sheetsplat::scene::{Scene, VolumeSource};
use sheetsplat::settings::{Gradient, Light, Shading};
use sheetsplat::volume::{Volume, builtin};

use crate::common::compare::assert_at_least;
use crate::common::images::rms;
use crate::native::draw;

const HEAD: &str = "builtin:head:64";

/// A scene of the builtin head.
fn scene(sets: &[&str]) -> Scene {
    let sets: Vec<String> =
        [&["image={width=96,height=96,background=[0,0,0,0]}"], sets].concat().into_iter().map(str::to_owned).collect();
    let source = VolumeSource::Builtin(HEAD.trim_start_matches("builtin:").to_owned());
    Scene::from_volume(source, &sets).unwrap()
}

/// The mean brightness of opaque pixels, by the weights of Rec. 709.
fn brightness(pixels: &[[f32; 4]]) -> f64 {
    let opaque: Vec<&[f32; 4]> = pixels.iter().filter(|pixel| pixel[3] > 0.9).collect();
    assert!(opaque.len() > 1000, "{}", opaque.len());
    let of = |pixel: &&[f32; 4]| 0.2126 * pixel[0] + 0.7152 * pixel[1] + 0.0722 * pixel[2];
    opaque.iter().map(|pixel| f64::from(of(pixel))).sum::<f64>() / opaque.len() as f64
}

/// Heads are about as bright as with the headlight that presets had.
#[test]
fn heads_stay_as_bright() {
    const HEADLIGHT: Shading = Shading {
        enabled: true,
        ambient: 0.2,
        diffuse: 0.7,
        specular: 0.2,
        shininess: 20.0,
        light: Light::Headlight,
        gradient: Gradient::Auto,
        occlusion: 0.0,
        occlusion_spread: 8.0,
        shadow: 0.0,
        shadow_spread: 0.5,
        light_step: 2.0,
    };
    for (sets, former) in [
        (&[][..], HEADLIGHT),
        (&["preset=ct-skin"], HEADLIGHT),
        (&["preset=ct-bone"], Shading { specular: 0.35, shininess: 40.0, ..HEADLIGHT }),
        (&["preset=mr-head"], Shading { ambient: 0.4, diffuse: 0.6, specular: 0.1, ..HEADLIGHT }),
    ] {
        let lit = scene(sets);
        let volume = lit.load_volume().unwrap();
        let lit = lit.explicit(&volume);
        assert_eq!((lit.shading.light, lit.shading.occlusion, lit.shading.shadow), (Light::UpperLeft, 0.7, 0.5));
        let unlit = Scene { shading: former, ..lit.clone() };
        let [lit, unlit] = [&lit, &unlit].map(|scene| draw(&volume, scene).image);
        assert_at_least(rms(&lit, &unlit), 0.02, format_args!("{sets:?}: sheets change something"));
        let [lit, unlit] = [&lit, &unlit].map(|image| brightness(&image.pixels));
        println!("{sets:?}: {lit:.3}, was {unlit:.3}");
        assert!((lit / unlit - 1.0).abs() < 0.2, "{sets:?}: {lit} {unlit}");
    }
}

/// Keys that are stated win, also those that equal a default, and a scene that is written and read back is the same.
#[test]
fn stated_keys_of_light_win() {
    let headlight = "shading={light=\"headlight\",occlusion=0,shadow=0,light_step=2}";
    for preset in [&[][..], &["preset=ct-bone"]] {
        let lit = scene(preset);
        let stated = scene(&[preset, &[headlight]].concat());
        let volume = lit.load_volume().unwrap();
        let shading = stated.explicit(&volume).shading;
        assert_eq!((shading.light, shading.occlusion, shading.shadow), (Light::Headlight, 0.0, 0.0), "{preset:?}");
        assert!(lit.explicit(&volume).shading.occlusion > 0.0);
        for scene in [&lit, &stated, &lit.explicit(&volume), &stated.explicit(&volume)] {
            let text = scene.to_toml(Path::new("")).unwrap();
            let read = Scene::parse(&text, "text", Path::new(""), &[]).unwrap();
            assert_eq!(read.explicit(&volume).shading, scene.explicit(&volume).shading, "{text}");
        }
    }
    // The volume that is drawn decides, not the one that the scene names.
    let cube = builtin::volume("cube:12").unwrap();
    let unlit = Shading { gradient: Gradient::Differences, ..Shading::default() };
    assert_eq!(scene(&[]).explicit(&cube).shading, unlit);
    // A transfer function of its own, or no preset, leaves the head in the headlight.
    for sets in [&["preset=none"], &["transfer.opacity=[[30,0],[60,0.8]]"]] {
        let scene = scene(sets);
        let volume = scene.load_volume().unwrap();
        assert_eq!(scene.explicit(&volume).shading, unlit, "{sets:?}");
    }
}

/// Large volumes have larger steps, unless a step is stated.
#[test]
fn steps_grow_with_the_volume() {
    // Half the diagonal is 200, 300 and 5000 voxels.
    for (count, expected) in [(400, 2.0), (600, 4.0), (10_000, 16.0)] {
        let dims = UVec3::new(2, 2, count);
        let values = (0..4 * count).map(|at| (at % 97) as f32 * 30.0 - 1000.0).collect();
        let volume = Volume::new("rod", dims, DVec3::ONE, values).unwrap();
        let step = |sets: &[&str]| {
            let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
            Scene::from_volume(VolumeSource::Memory, &sets).unwrap().fitted(&volume).shading.light_step
        };
        for preset in ["preset=ct-skin", "preset=ct-bone", "preset=mr-head"] {
            assert_eq!(step(&[preset]), expected, "{preset} {count}");
            assert_eq!(step(&[preset, "shading.light_step=2"]), 2.0, "{preset} {count}");
        }
        // Others light nothing.
        assert_eq!((step(&["preset=none", "shading.occlusion=1"]), step(&["preset=ct-vessels"])), (2.0, 2.0));
    }
    assert!(Preset::CtBone.shading().occlusion > 0.0 && Preset::CtVessels.shading().occlusion == 0.0);
}
