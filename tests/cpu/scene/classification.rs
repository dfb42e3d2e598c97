//! Whether values are classified before or after splatting where a scene does not state it (SPEC §9).

use glam::UVec3;
use sheetsplat::Volume;
use sheetsplat::cpu;
use sheetsplat::scene::Scene;
use sheetsplat::settings::{Classification, Splatting};
use sheetsplat::volume::builtin;

use super::parse;
use Classification::{After, Before};

fn head() -> Volume {
    builtin::volume("head:16").unwrap()
}

/// The scene of a text with overrides.
fn scene(text: &str, sets: &[&str]) -> Scene {
    parse(&format!("volume.builtin = 'head:16'\nimage = {{ width = 24, height = 24 }}\n{text}"), sets).unwrap()
}

#[test]
fn presets_and_chosen_transfer_functions_are_classified_after_splatting() {
    let transfer = "[transfer]\ncolor = [[0, [1, 1, 1]]]\nopacity = [[0, 0], [255, 1]]";
    for (text, sets, expected) in [
        ("", &[][..], After),
        ("preset = 'ct-skin'", &[], After),
        ("preset = 'mr-head'\ntransfer.opacity = [[0, 0.5]]", &[], After),
        ("preset = 'xray'", &[], Before),
        ("preset = 'mip'", &[], After),
        ("preset = 'confocal'", &[], Before),
        ("preset = 'labels'", &[], Before),
        (transfer, &[], Before),
        ("[transfer]", &[], Before),
        ("", &["transfer.colormap=viridis"], Before),
        (transfer, &["preset=ct-bone"], After),
        // Stated, whatever the rest.
        (transfer, &["splatting.classification=after"], After),
        ("preset = 'mip'", &["splatting.classification=after"], After),
        ("preset = 'ct-skin'", &["splatting.classification=before"], Before),
        // What excludes it.
        ("", &["splatting.method=axis-aligned"], Before),
        ("", &["splatting.method=composite-every-sample", "splatting.rasterizer=quads"], Before),
        ("", &["splatting.experimental.beta=0.9"], Before),
        ("", &["splatting.falloff=12"], Before),
        ("", &["splatting.interpolation=exact", "splatting.falloff=0.9"], Before),
        ("", &["splatting.falloff=0.9"], After),
        ("", &["splatting.rasterizer=tiles"], After),
        ("", &["splatting.rasterizer=tiles", "splatting.compositing=maximum"], After),
        ("", &["splatting.compositing=maximum"], After),
    ] {
        let scene = scene(text, sets);
        assert_eq!(scene.classification(&head()), expected, "{text} {sets:?}");
        assert_eq!(scene.explicit(&head()).splatting.classification, expected, "{text} {sets:?}");
    }
}

#[test]
fn label_maps_that_are_found_are_classified_before_splatting() {
    // Whole numbers in pieces of one value each.
    let values = (0..4096_u32).map(|index| ((index % 16 / 8) + 2 * (index / 256 / 8)) as f32).collect();
    let volume = Volume::new("blocks", UVec3::splat(16), glam::DVec3::ONE, values).unwrap();
    assert!(sheetsplat::appearance::categories::is_label_map(&volume));
    assert_eq!(scene("", &[]).classification(&volume), Before);
    assert_eq!(scene("preset = 'ct-skin'", &[]).classification(&volume), After);
}

/// The rule decides what is drawn, and the scene that states everything draws the same.
#[test]
fn images_are_those_of_the_stated_classification() {
    let draw = |scene: &Scene| cpu::render(head(), scene).unwrap().image.pixels;
    for (text, expected, other) in
        [("", After, Before), ("preset = 'mr-head'", After, Before), ("preset = 'confocal'", Before, After)]
    {
        let scene = scene(text, &[]);
        let stated =
            |classification| Scene { splatting: Splatting { classification, ..scene.splatting }, ..scene.clone() };
        let drawn = draw(&scene);
        assert!(drawn.iter().flatten().all(|channel| channel.is_finite()));
        assert!(drawn == draw(&stated(expected)), "{text}");
        assert!(drawn == draw(&scene.explicit(&head())), "{text}, explicit");
        assert!(drawn != draw(&stated(other)), "{text}, {other:?}");
    }
}
