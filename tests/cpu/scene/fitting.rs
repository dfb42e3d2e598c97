//! The preset that fits a volume is used where a scene states no appearance.

use std::path::Path;

use glam::{DVec3, UVec3};
use sheetsplat::appearance::Preset;
use sheetsplat::cpu;
use sheetsplat::scene::{Scene, VolumeSource};
use sheetsplat::settings::{Classification, Compositing, Shading, TransferFunction};
use sheetsplat::{Volume, appearance};

/// A ball of soft tissue with a core of bone, in air.
fn body() -> Volume {
    let values = (0..20 * 20 * 20).map(|at: u32| {
        let from_middle = UVec3::new(at % 20, at / 20 % 20, at / 400).as_dvec3() - 9.5;
        match from_middle.length() {
            radius if radius < 4.0 => 700.0 + (at % 50) as f32,
            radius if radius < 8.0 => 40.0 + (at % 7) as f32,
            _ => -1000.0,
        }
    });
    Volume::new("body", UVec3::splat(20), DVec3::ONE, values.collect()).unwrap()
}

fn scene(text: &str, sets: &[&str]) -> Scene {
    let sets: Vec<String> = ["image={width=24,height=24}"].iter().chain(sets).map(|&set| set.to_owned()).collect();
    Scene::parse_for(VolumeSource::Memory, text, "text", Path::new(""), &sets).unwrap()
}

#[test]
fn the_preset_that_fits_is_used_unless_anything_else_is_stated() {
    let volume = body();
    assert_eq!(Preset::suggested(&volume), Some(Preset::CtBone));
    let draw = |scene: &Scene| cpu::render(volume.clone(), scene).unwrap().image.pixels;
    let by_name = scene("", &["preset=ct-bone"]);
    for text in ["", "[camera]\nfit = 'object'", "[shading]"] {
        let open = scene(text, &[]);
        let named = Scene { camera: open.camera, ..by_name.clone() };
        let fitted = open.fitted(&volume);
        assert_eq!(
            (fitted.channels[0].transfer.preset, fitted.shading, fitted.splatting.compositing),
            (Some(Preset::CtBone), Preset::CtBone.shading(), Compositing::Exponential),
            "{text}"
        );
        assert_eq!(fitted.fitted(&volume), fitted, "{text}");
        assert_eq!(open.classification(&volume), Classification::After, "{text}");
        assert_eq!(open.resolve(&volume)[..], [Preset::CtBone.transfer(&volume)], "{text}");
        assert_eq!(open.explicit(&volume), named.explicit(&volume), "{text}");
        assert!(draw(&open) == draw(&named), "{text}");
    }
    // A host's scene.
    let fitted = Scene::new(VolumeSource::Memory).fitted(&volume);
    assert_eq!(fitted.channels[0].transfer.preset, Some(Preset::CtBone));

    // With anything of a transfer function, the histogram chooses the rest.
    for (text, sets) in
        [("[transfer]", &[][..]), ("", &["transfer.colormap=magma"]), ("transfer.opacity = [[0, 1]]", &[])]
    {
        let stated = scene(text, sets);
        assert_eq!(stated.fitted(&volume), stated, "{text} {sets:?}");
    }
    let other = scene("", &["preset=mip"]);
    assert_eq!(other.fitted(&volume), other);
}

/// Scaled to the range of numbers such as -1e30, all other values would be one `f32`, so that nothing would be seen after splatting.
#[test]
fn numbers_beyond_an_f32s_digits_hide_nothing() {
    let draw = |wild: Option<f32>, stated: &[&str]| {
        let mut values: Vec<f32> = body().values().iter().collect();
        wild.into_iter().for_each(|wild| values[..8].fill(wild));
        let volume = Volume::new("body", UVec3::splat(20), DVec3::ONE, values).unwrap();
        let scene = scene("camera = { center = [0, 0, 0], height = 20, direction = [0, 1, 0] }", stated);
        let pixels = cpu::render(volume.clone(), &scene).unwrap().image.pixels;
        let lit = pixels.iter().filter(|pixel| pixel[..3].iter().sum::<f32>() > 0.2).count();
        (lit, scene.fitted(&volume).classification(&volume))
    };
    let (alone, classification) = draw(None, &[]);
    assert_eq!((alone > 40, classification), (true, Classification::After), "{alone}");
    for (wild, expected) in
        [(-1e30, Classification::Before), (1e30, Classification::Before), (-32_768.0, Classification::After)]
    {
        let (lit, classification) = draw(Some(wild), &[]);
        assert!(classification == expected && lit * 10 >= alone * 9, "{wild}: {lit} of {alone}, {classification:?}");
    }
    // A stated key stays.
    let (_, classification) = draw(Some(-1e30), &["splatting.classification=after"]);
    assert_eq!(classification, Classification::After);
}

#[test]
fn no_preset_is_the_surface_of_the_histogram() {
    let volume = body();
    for (text, classification) in
        [("preset = 'none'", Classification::After), ("preset = 'none'\n[transfer]", Classification::Before)]
    {
        let none = scene(text, &[]);
        assert_eq!(none.resolve(&volume)[..], [TransferFunction::from_histogram(&volume)], "{text}");
        assert_eq!((none.shading, none.splatting.compositing), (Shading::default(), Compositing::Linear), "{text}");
        assert_eq!(none.classification(&volume), classification, "{text}");
    }
    // So is that of a volume that no preset fits.
    let ramp =
        Volume::new("ramp", UVec3::splat(8), DVec3::ONE, (0..512).map(|at| (at * 37 % 251) as f32 / 3.0).collect());
    let ramp = ramp.unwrap();
    assert_eq!(Preset::suggested(&ramp), None);
    assert_eq!(scene("", &[]).fitted(&ramp).channels[0].transfer.preset, Some(Preset::None));
    assert_eq!(
        scene("", &[]).explicit(&ramp),
        Scene { camera: scene("", &[]).camera, ..scene("preset = 'none'", &[]) }.explicit(&ramp)
    );
    // Whole numbers in pieces of one value each are labels, which are classified before.
    let values = (0..4096_u32).map(|index| ((index % 16 / 8) + 2 * (index / 256 / 8)) as f32).collect();
    let blocks = Volume::new("blocks", UVec3::splat(16), DVec3::ONE, values).unwrap();
    assert!(appearance::categories::is_label_map(&blocks));
    assert_eq!(scene("preset = 'none'", &[]).classification(&blocks), Classification::Before);
}

/// A stated key stays, be it the default; and so does what a host has set to something else.
#[test]
fn stated_keys_win_over_the_preset_that_fits() {
    let volume = body();
    let of_bone = Preset::CtBone.shading();
    let shading = Shading::default();
    assert!(of_bone.specular != shading.specular && of_bone.shininess != shading.shininess);
    for (text, sets) in [
        ("shading.specular = 0.2\nsplatting.compositing = 'linear'", &[][..]),
        ("", &["shading.specular=0.2", "splatting.compositing=linear"]),
    ] {
        let fitted = scene(text, sets).fitted(&volume);
        assert_eq!((fitted.shading.specular, fitted.shading.shininess), (0.2, of_bone.shininess), "{text}");
        assert_eq!(fitted.splatting.compositing, Compositing::Linear, "{text}");
    }
    let mut set = Scene::new(VolumeSource::Memory);
    (set.shading.ambient, set.splatting.compositing) = (0.75, Compositing::Maximum);
    let fitted = set.fitted(&volume);
    assert_eq!((fitted.shading.ambient, fitted.shading.specular), (0.75, of_bone.specular));
    assert_eq!(fitted.splatting.compositing, Compositing::Maximum);
}

/// Settings that the preset is to choose stay open in a scene that is written.
#[test]
fn open_scenes_stay_open() {
    for text in [
        "",
        "shading.specular = 0.2",
        "splatting.compositing = 'linear'",
        "preset = 'none'",
        "[camera]\nup = [0, 0, 1]",
    ] {
        let open = scene(text, &[]);
        assert_eq!(scene(&open.to_toml(Path::new("")).unwrap(), &[]), open, "{text}");
    }
}
