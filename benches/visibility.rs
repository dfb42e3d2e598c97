//! The paper's visibility tests and areas (§6), counted by the f64 evaluation, sheet by sheet: sections that pass the test of the centre's pixel
//! (Fig. 11a), of the parallelogram (Fig. 13) and of its rectangle; and pixels composited within the bounding box of the voxels' centres, within
//! tiles, and convolved within tiles whose counters exceed the threshold.
//!
//! `cargo bench --bench visibility -- [SIDE] [SCENE]…` takes the image's side in pixels, and scene files or builtin volumes.

#![expect(clippy::unwrap_used, reason = "a bench")]

#[expect(dead_code, reason = "not every bench needs all of it")]
mod common;

use sheetsplat::internals::reference;
use sheetsplat::internals::reference::visibility::Test;

fn main() {
    let (side, scenes) = common::arguments(256);
    let side = u32::try_from(side).unwrap();
    let builtin = ["builtin:head:96", "builtin:nerve:128", "builtin:tomato:96"].map(str::to_owned);
    let scenes = if scenes.is_empty() { builtin.to_vec() } else { scenes };
    println!("| scene | sections | centre | parallelogram | rectangle | bounding box | tiles | counted tiles |");
    println!("|---|---|---|---|---|---|---|---|");
    for name in &scenes {
        let mut scene = common::open(name);
        (scene.image.width, scene.image.height) = (side, side);
        let volume = scene.load_volume().unwrap();
        let transfer = scene.resolve(&volume);
        let all = reference::count(&volume, &transfer, &scene).unwrap();
        let culled = |test| reference::render_culled(&volume, &transfer, &scene, Some(test)).unwrap();
        let share = |test| 100.0 * culled(test).sections as f64 / all.sections_total as f64;
        let rectangle = culled(Test::Box);
        let pixels = (u64::from(side).pow(2) * all.sheets) as f64;
        let area = |pixels_within: u64| 100.0 * pixels_within as f64 / pixels;
        println!(
            "| {} | {} | {:.2} % | {:.2} % | {:.2} % | {:.1} % | {:.1} % | {:.1} % |",
            common::label(name),
            all.sections_total,
            share(Test::Center),
            share(Test::Parallelogram),
            100.0 * rectangle.sections as f64 / all.sections_total as f64,
            area(rectangle.areas.bounding_box),
            area(rectangle.areas.tiles),
            area(rectangle.areas.counted_tiles),
        );
    }
    println!("\nAreas are of all pixels of all sheets; {side}×{side} pixels.");
}
